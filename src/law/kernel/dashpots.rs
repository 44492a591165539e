//! Dashpots of second order in the step.
//!
//! Forces belong to positions, and velocities `v` are those of half a step `h` before. What its own force `F` makes of the velocity until
//! then a dashpot `c` knows, and solves for:
//!
//! `F = k δ + c (v - r F)`, `r = h/m`; in the contact plane `r` is 7/2 of that along the normal, as of spheres.
//!
//! A collision of two spheres is of second order so. Other contacts and fields are felt half a step late, unless velocities are
//! foreseen ([`crate::motion::ahead`]): `v` then gains `e`, in which the contact's own force is that of earlier steps and goes out,
//!
//! `F = k δ + c (v + e + r F' - r F)` with the last force `F'`.
//!
//! Any `r` is of second order there. With the part `s` of what resists a motion in each contact's own force, the stable step has
//! `ω² Δt² + (3.1 - 4 s) γ Δt <= 4`; with velocities of half a step before it has `ω² Δt² + 2 γ Δt <= 4` at most.
//!
//! A contact begins between two steps. Its first force acts from then on until half a step after the positions: for `s + 1/2` of a step,
//! so the dashpot counts as much.

use super::Contact;
use crate::lanes::{Lanes, Triple};
use crate::{Dashpots, Hardest};

/// Acceleration of two surfaces in the plane over the force between them and `1/m`, of spheres [-].
const IN_PLANE: f64 = 3.5;

impl Dashpots {
    /// The last force, if it is in what is foreseen.
    #[inline(always)]
    pub(in super::super) fn last<L: Lanes>(self, force: L) -> L {
        if self.foreseen { force } else { L::all(0.0) }
    }

    /// The last force in the contact plane, with this elastic part [N], if it is in what is foreseen.
    #[inline(always)]
    pub(in super::super) fn last_in_plane<L: Lanes>(
        self,
        elastic: Triple<L>,
        contact: &Contact<L>,
    ) -> Triple<L> {
        if self.foreseen { elastic.plus(contact.last_viscous) } else { Triple::zero() }
    }

    /// A contact as it counts in the stable step of packings.
    pub(in super::super) const fn in_packings(self, mut hardest: Hardest) -> Hardest {
        if self.foreseen {
            hardest.dashpots[1] *= 1.2;
        }
        hardest
    }
}

impl<L: Lanes> Contact<L> {
    /// `r` of a reduced mass `m`, given `1/m` [1/kg]: [s/kg].
    #[inline(always)]
    fn own(&self, inverse_mass: L) -> L {
        L::all(0.5 * self.dt) * inverse_mass
    }

    /// A dashpot as it counts where contacts have begun since the last step [N s/m].
    #[inline(always)]
    fn timely(&self, dashpot: L) -> L {
        if self.begun == 0 {
            return dashpot;
        }
        let weight = L::all(0.5) + self.lasted * L::all(1.0 / self.dt);
        (dashpot * weight).or(dashpot, self.begun)
    }

    /// The force along the normal [N] of a spring with the force `elastic` [N] and a dashpot [N s/m]; `last` is that of the last
    /// step [N], `inverse_mass` of both bodies [1/kg].
    #[inline(always)]
    pub fn damped(&self, elastic: L, dashpot: L, inverse_mass: L, last: L) -> L {
        let dashpot = self.timely(dashpot);
        let own = self.own(inverse_mass);
        let approach = self.foreseen.dot(self.normal) + own * last;
        (elastic + dashpot * approach) / (L::all(1.0) + dashpot * own)
    }
}

/// A dashpot in the contact plane, beside a spring and under friction's limit.
#[derive(Clone, Copy)]
pub struct InPlane<L> {
    /// [N s/m]
    dashpot: L,
    /// What it feels but for the force of the contact itself [m/s].
    velocity: Triple<L>,
    /// What a force takes of that [s/kg].
    own: L,
}

impl<L: Lanes> InPlane<L> {
    /// Of a contact with this last force in the plane [N], see [`Contact::damped`].
    #[inline(always)]
    pub fn of(contact: &Contact<L>, dashpot: L, inverse_mass: L, last: Triple<L>) -> Self {
        let dashpot = contact.timely(dashpot);
        let own = contact.own(inverse_mass) * L::all(IN_PLANE);
        let foreseen = contact.foreseen.plus(last.times(own));
        let across = contact.normal.times(foreseen.dot(contact.normal));
        Self { dashpot, velocity: foreseen.minus(across), own }
    }

    /// The force with that of a spring, without a limit [N].
    #[inline(always)]
    pub fn beside(&self, spring: Triple<L>) -> Triple<L> {
        let both = spring.plus(self.velocity.times(self.dashpot));
        both.over(L::all(1.0) + self.dashpot * self.own)
    }

    /// The part of the dashpot where both together are this force [N].
    #[inline(always)]
    pub fn part_of(&self, force: Triple<L>) -> Triple<L> {
        self.velocity.minus(force.times(self.own)).times(self.dashpot)
    }
}
