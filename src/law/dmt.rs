//! Adhesion after Derjaguin, Muller and Toporov (1975, DOI 10.1016/0021-9797(75)90018-1): an attraction added to the forces
//! of any model, for hard and small spheres.
//!
//! While two spheres overlap they attract each other with `F_a = 2π w R*`, at any overlap: `N = N_model - F_a`. `1/R*` is
//! the sum of `1/R` of both, 0 for a wall. `w` is the work of adhesion per area [J/m²], `w = 2 √(γ_A γ_B)` with the surface
//! energies of the materials. The pull-off force is `F_a`, at an overlap of 0. Its energy `-F_a δ` is stored. With the
//! elastic force of Hertz the contact energy has a well: a sphere that enters without kinetic energy leaves without any.
//! Adhesion itself dissipates nothing, unlike that of Johnson, Kendall and Roberts, where contacts outlive the overlap.
//!
//! Friction and resistance to rolling and twisting have their limits from the force that presses the surfaces together,
//! `N + F_a`.
//!
//! The law holds for small Tabor parameters, `(R* w² / (E*² z³))^(1/3) < 0.1` or so with the distance `z` of atoms, 0.2 to
//! 0.4 nm (Johnson and Greenwood 1997, J. Colloid Interface Sci. 192, 326).

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::kernel::{Action, Contact, Model, Spread, Turning};
use super::{About, Body, Hardest, Mixing};
use crate::contact::StateColumn;
use crate::ids::MaterialId;
use crate::lanes::Lanes;
use crate::particles::Needs;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Constants of a contact between two materials; by default nothing attracts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Constants {
    /// Surface energy `γ`, half the work of adhesion [J/m²].
    pub surface_energy: f64,
}

impl Mixing for Constants {
    /// The geometric mean (Girifalco and Good 1957, J. Phys. Chem. 61, 904).
    fn mixed(a: &Self, b: &Self) -> Self {
        Self { surface_energy: (a.surface_energy * b.surface_energy).sqrt() }
    }
}

/// Constants of every pair of materials.
pub type Interactions = super::Interactions<Constants>;

/// Model of forces with an attraction.
#[derive(Clone, Debug)]
pub struct Dmt<M> {
    forces: M,
    interactions: Interactions,
}

impl<M: Model> Dmt<M> {
    /// Adds the attraction to these forces.
    pub fn new(forces: M, interactions: Interactions) -> Self {
        Self { forces, interactions }
    }

    /// Do any materials attract each other?
    fn attracts(&self) -> bool {
        self.interactions.iter().any(|constants| constants.surface_energy > 0.0)
    }
}

/// Constants of a contact: those of the forces, and the attraction [N].
#[derive(Clone, Copy, Debug)]
pub struct Attracting<C, L> {
    forces: C,
    attraction: L,
}

impl<C, L: Lanes> Attracting<C, L> {
    /// Attraction at an overlap [N].
    #[inline(always)]
    fn at(&self, overlap: L) -> L {
        let zero = L::all(0.0);
        self.attraction.or(zero, zero.less(overlap))
    }

    /// Subtracts the attraction from an action.
    #[inline(always)]
    fn attracted(&self, mut action: Action<L>, overlap: L) -> Action<L> {
        let attraction = self.at(overlap);
        action.press = action.press - attraction;
        action.stored[0] = action.stored[0] - attraction * overlap;
        action
    }
}

/// Access to the constants of the forces.
struct OfForces<'a, S>(&'a S);

impl<C, L, S: Spread<Attracting<C, f64>, L>> Spread<C, L> for OfForces<'_, S> {
    #[inline(always)]
    fn of(&self, get: impl Fn(&C) -> f64) -> L {
        self.0.of(|constants| get(&constants.forces))
    }
}

impl<M: Model> About for Dmt<M> {
    fn within(&self) -> Option<&dyn About> {
        Some(&self.forces)
    }

    fn name(&self) -> &'static str {
        self.forces.name()
    }

    fn hardest(&self, body: &Body, other: MaterialId, reduced_mass: f64) -> Hardest {
        self.forces.hardest(body, other, reduced_mass)
    }

    fn words(&self, a: MaterialId, b: MaterialId) -> String {
        let Constants { surface_energy } = self.interactions.of(a, b);
        let forces = self.forces.words(a, b);
        if !self.attracts() {
            return forces;
        }
        format!("{forces}, surface energy {surface_energy} J/m2 (adhesion of DMT)")
    }
}

impl<M: Model> Model for Dmt<M> {
    type Constants<L: Lanes> = Attracting<M::Constants<L>, L>;

    const MOMENTS: bool = M::MOMENTS;
    const BY_CURVATURE: bool = M::BY_CURVATURE;
    const FORESEES: bool = M::FORESEES;
    const FACES: bool = M::FACES;

    fn needs(&self) -> Needs {
        self.forces.needs()
    }

    fn state(&self) -> &[StateColumn] {
        self.forces.state()
    }

    fn constants(&self, a: &Body, b: &Body) -> Self::Constants<f64> {
        let work = 2.0 * self.interactions.of(a.material, b.material).surface_energy;
        let radius = 1.0 / (1.0 / a.radius + 1.0 / b.radius);
        Attracting { forces: self.forces.constants(a, b), attraction: 2.0 * PI * work * radius }
    }

    #[inline(always)]
    fn spread<L: Lanes>(of: &impl Spread<Self::Constants<f64>, L>) -> Self::Constants<L> {
        Attracting { forces: M::spread(&OfForces(of)), attraction: of.of(|c| c.attraction) }
    }

    #[inline(always)]
    fn curved<L: Lanes>(
        &self,
        constants: &Self::Constants<L>,
        root_of_radius: L,
    ) -> Self::Constants<L> {
        let forces = self.forces.curved(&constants.forces, root_of_radius);
        Attracting { forces, ..*constants }
    }

    #[inline(always)]
    fn last<L: Lanes>(&self, constants: &Self::Constants<L>, overlap: L, state: &[L]) -> Action<L> {
        constants.attracted(self.forces.last(&constants.forces, overlap, state), overlap)
    }

    #[inline(always)]
    fn act<L: Lanes>(
        &self,
        constants: &Self::Constants<L>,
        contact: &Contact<L>,
        state: &mut [L],
    ) -> Action<L> {
        let action = self.forces.act(&constants.forces, contact, state);
        constants.attracted(action, contact.overlap)
    }

    #[inline(always)]
    fn dissipates<L: Lanes>(&self, constants: &Self::Constants<L>) -> [u8; 2] {
        self.forces.dissipates(&constants.forces)
    }

    #[inline(always)]
    fn turned<L: Lanes>(&self, constants: &Self::Constants<L>, overlap: L, state: &[L]) -> L {
        self.forces.turned(&constants.forces, overlap, state)
    }

    #[inline(always)]
    fn elastic<L: Lanes>(&self, constants: &Self::Constants<L>, overlap: L) -> L {
        self.forces.elastic(&constants.forces, overlap) - constants.at(overlap)
    }

    fn turning(&self, constants: &Self::Constants<f64>, overlap: f64) -> Turning {
        self.forces.turning(&constants.forces, overlap)
    }

    fn stiffness(&self, constants: &Self::Constants<f64>, overlap: f64, dt: f64) -> f64 {
        self.forces.stiffness(&constants.forces, overlap, dt)
    }
}
