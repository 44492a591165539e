//! Dashpots that foresee.
//!
//! Forces belong to positions, and velocities `v` are those of half a step `h` before: a dashpot `c` that feels them is of first order in
//! the step. By choice it feels what `v` is foreseen to be at the positions, `v + e` ([`dem_grains::motion::ahead`]). In `e` the contact's own
//! force `F` is that of earlier steps. It goes out for the force of now, which is solved for:
//!
//! `F = k δ + c (v + e + r F' - r F)`, `r = h/m`,
//!
//! with the last force `F'`. Any `r` is of second order. In the contact plane it is 7/2 of that along the normal, as of spheres.
//! Without `e` and `F'` a contact at rest would press by `1/(1 + c r)` of its spring alone.
//!
//! With the part `s` of what resists a motion in each contact's own force, the stable step has `ω² Δt² + (3.1 - 4 s) γ Δt <= 4`. Where forces
//! feel the velocity of half a step before it has `ω² Δt² + 2 γ Δt <= 4`.
//!
//! A contact begins between two steps. Its first force acts from then on until half a step after the positions: for `s + 1/2` of a step.
//! A dashpot that has grown with the power `p` of the time counts `s/(1 + p) + 1/2`.

use super::{Contact, Dashpots, Hardest};
use crate::lanes::{Lanes, Triple};

/// Acceleration of two surfaces in the plane over the force between them and `1/m`, of spheres [-].
const IN_PLANE: f64 = 3.5;

impl Dashpots {
    /// The last force, if it is in what is foreseen.
    #[inline(always)]
    pub(in super::super) fn last<L: Lanes>(self, force: L) -> Option<L> {
        if self.foreseen { Some(force) } else { None }
    }

    /// The last force in the contact plane, with this elastic part [N], if it is in what is foreseen.
    #[inline(always)]
    pub(in super::super) fn last_in_plane<L: Lanes>(
        self,
        elastic: Triple<L>,
        contact: &Contact<L>,
    ) -> Option<Triple<L>> {
        if self.foreseen { Some(elastic.plus(contact.last_viscous)) } else { None }
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

    /// A dashpot as it counts where contacts have begun since the last step [N s/m], where it grows with this power of the overlap.
    #[inline(always)]
    fn timely(&self, dashpot: L, power: f64) -> L {
        if self.begun == 0 {
            return dashpot;
        }
        let weight = L::all(0.5) + self.lasted * L::all(1.0 / (self.dt * (1.0 + power)));
        (dashpot * weight).or(dashpot, self.begun)
    }

    /// The force along the normal [N] of a spring with the force `elastic` [N] and a dashpot [N s/m]. Where velocities are foreseen `last`
    /// is the force of the last step [N]. `inverse_mass` is that of both bodies [1/kg]. The dashpot grows with a power of the overlap.
    #[inline(always)]
    pub fn damped(
        &self,
        elastic: L,
        (dashpot, power): (L, f64),
        inverse_mass: L,
        last: Option<L>,
    ) -> L {
        let Some(last) = last else { return elastic + dashpot * self.approach * self.gain };
        let (dashpot, own) = (self.timely(dashpot * self.gain, power), self.own(inverse_mass));
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
    /// What a force takes of that [s/kg], where it is foreseen.
    own: Option<L>,
}

impl<L: Lanes> InPlane<L> {
    /// Of a contact with this last force in the plane [N], see [`Contact::damped`].
    #[inline(always)]
    pub fn of(
        contact: &Contact<L>,
        (dashpot, power): (L, f64),
        inverse_mass: L,
        last: Option<Triple<L>>,
    ) -> Self {
        let Some(last) = last else {
            return Self { dashpot, velocity: contact.sliding, own: None };
        };
        let own = contact.own(inverse_mass) * L::all(IN_PLANE);
        let foreseen = contact.foreseen.plus(last.times(own));
        let velocity = foreseen.minus(contact.normal.times(foreseen.dot(contact.normal)));
        Self { dashpot: contact.timely(dashpot, power), velocity, own: Some(own) }
    }

    /// The force with that of a spring, without a limit [N].
    #[inline(always)]
    pub fn beside(&self, spring: Triple<L>) -> Triple<L> {
        let both = spring.plus(self.velocity.times(self.dashpot));
        match self.own {
            Some(own) => both.over(L::all(1.0) + self.dashpot * own),
            None => both,
        }
    }

    /// The part of the dashpot where both together are this force [N].
    #[inline(always)]
    pub fn part_of(&self, force: Triple<L>) -> Triple<L> {
        let velocity = match self.own {
            Some(own) => self.velocity.minus(force.times(own)),
            None => self.velocity,
        };
        velocity.times(self.dashpot)
    }
}
