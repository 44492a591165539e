//! Constants of contacts by pairs of materials, for any law.

use crate::ids::MaterialId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Constants of contacts of a law, with a rule to mix them.
pub trait Mixing: Copy {
    /// Constants for two materials without a setting of their own for the pair.
    fn mixed(a: &Self, b: &Self) -> Self;
}

impl<C: Mixing, D: Mixing> Mixing for (C, D) {
    fn mixed(a: &Self, b: &Self) -> Self {
        (C::mixed(&a.0, &b.0), D::mixed(&a.1, &b.1))
    }
}

/// Largest number of materials for which the constants of all pairs are stored; for more they are mixed on
/// demand.
const MOST_IN_TABLE: usize = 64;

/// Constants of every pair of materials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interactions<C> {
    /// Each material with itself, mixed for pairs that are not set.
    own: Vec<C>,
    /// Pairs set explicitly, the lower id first.
    set: BTreeMap<[MaterialId; 2], C>,
    /// All pairs; empty if there are too many.
    table: Vec<C>,
}

impl<C: Mixing> Interactions<C> {
    /// Constants mixed from those of each material with itself.
    pub fn new(own: &[C]) -> Self {
        let mut new = Self { own: own.to_vec(), set: BTreeMap::new(), table: Vec::new() };
        if own.len() <= MOST_IN_TABLE {
            new.table = own.iter().flat_map(|a| own.iter().map(|b| C::mixed(a, b))).collect();
        }
        new
    }

    /// A part of each constant. The part must be mixed like the whole.
    pub fn map<P>(&self, part: impl Fn(&C) -> P) -> Interactions<P> {
        Interactions {
            own: self.own.iter().map(&part).collect(),
            set: self.set.iter().map(|(pair, constants)| (*pair, part(constants))).collect(),
            table: self.table.iter().map(&part).collect(),
        }
    }

    /// Constants of two materials, in either order.
    #[inline]
    pub fn of(&self, a: MaterialId, b: MaterialId) -> C {
        match self.table.get(a.index() * self.own.len() + b.index()) {
            Some(constants) => *constants,
            None => self.found(a, b),
        }
    }

    #[inline(never)]
    fn found(&self, a: MaterialId, b: MaterialId) -> C {
        let mixed = || C::mixed(&self.own[a.index()], &self.own[b.index()]);
        self.set.get(&[a.min(b), a.max(b)]).copied().unwrap_or_else(mixed)
    }

    /// Replaces the constants of two materials.
    pub fn set(&mut self, a: MaterialId, b: MaterialId, constants: C) {
        let materials = self.own.len();
        self.set.insert([a.min(b), a.max(b)], constants);
        for place in [(a, b), (b, a)].map(|(a, b)| a.index() * materials + b.index()) {
            if let Some(held) = self.table.get_mut(place) {
                *held = constants;
            }
        }
    }

    /// Constants of all pairs, each once.
    pub fn iter(&self) -> impl Iterator<Item = C> {
        let count = self.own.len();
        let ids = move |from: usize| (from..count).map(|id| MaterialId(id as u16));
        ids(0).flat_map(move |a| ids(a.index()).map(move |b| self.of(a, b)))
    }
}
