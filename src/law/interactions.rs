//! Constants of contacts by pairs of materials, whatever the law.

use crate::ids::MaterialId;
use serde::{Deserialize, Serialize};

/// Constants of contacts of a law.
pub trait Mixing: Copy {
    /// Of a contact between two materials about which the scene says nothing more.
    fn mixed(a: &Self, b: &Self) -> Self;
}

impl<C: Mixing, D: Mixing> Mixing for (C, D) {
    fn mixed(a: &Self, b: &Self) -> Self {
        (C::mixed(&a.0, &b.0), D::mixed(&a.1, &b.1))
    }
}

/// The constants of every pair of materials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interactions<C> {
    materials: usize,
    constants: Vec<C>,
}

impl<C: Mixing> Interactions<C> {
    /// Mixed from those of each material with itself.
    pub fn new(own: &[C]) -> Self {
        let constants = own.iter().flat_map(|a| own.iter().map(|b| C::mixed(a, b))).collect();
        Self { materials: own.len(), constants }
    }

    /// A part of each.
    pub fn map<P>(&self, part: impl Fn(&C) -> P) -> Interactions<P> {
        let constants = self.constants.iter().map(part).collect();
        Interactions { materials: self.materials, constants }
    }

    /// Of these two materials, in either order.
    #[inline]
    pub fn of(&self, a: MaterialId, b: MaterialId) -> &C {
        &self.constants[a.index() * self.materials + b.index()]
    }

    /// Replaces those of two materials.
    pub fn set(&mut self, a: MaterialId, b: MaterialId, constants: C) {
        self.constants[a.index() * self.materials + b.index()] = constants;
        self.constants[b.index() * self.materials + a.index()] = constants;
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &C> {
        self.constants.iter()
    }
}
