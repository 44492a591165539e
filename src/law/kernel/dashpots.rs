//! Dashpots with predicted velocities.
//!
//! Forces belong to positions, and velocities `v` to half a step `h` before: a dashpot `c` on these is of first order in
//! the step. Optionally it uses the velocity predicted for the time of the positions, `v + e`
//! ([`dem_grains::motion::ahead`]). In `e` the contact's own force `F` is that of earlier steps. It is replaced by the
//! present force, which is solved for:
//!
//! `F = k δ + c (v + e + r F' - r F)`, `r = h/m`,
//!
//! with the last force `F'`. Any `r` is of second order. In the contact plane `r` is 7/2 of that along the normal, as for
//! spheres. Without `e` and `F'` a contact at rest would press with only `1/(1 + c r)` of its spring force.
//!
//! Let `s` be the part of each contact's own force in the resistance to a motion. Then the stable step has
//! `ω² Δt² + (3.1 - 4 s) γ Δt <= 4`. With velocities of half a step before it has `ω² Δt² + 2 γ Δt <= 4`.
//!
//! A contact begins between two steps. Its first force acts from then on until half a step after the positions: for
//! `s + 1/2` of a step, where `s` is the part of the step in contact. A dashpot that has grown with the power `p` of the
//! time counts `s/(1 + p) + 1/2`.

use super::{Contact, Dashpots, Hardest, Kept};
use crate::lanes::{Lanes, Triple};

/// Acceleration of two spheres' surfaces in the contact plane over the force between them and `1/m` [-].
const IN_PLANE: f64 = 3.5;

impl Dashpots {
    /// The last force, if velocities are predicted.
    #[inline(always)]
    pub(in super::super) fn last<const MAY: bool, L: Lanes>(self, force: L) -> Option<L> {
        if MAY && self.foreseen { Some(force) } else { None }
    }

    /// The last tangential force with this elastic part [N], if velocities are predicted.
    #[inline(always)]
    pub(in super::super) fn last_in_plane<const MAY: bool, L: Lanes>(
        self,
        elastic: Triple<L>,
        contact: &Contact<L>,
    ) -> Option<Triple<L>> {
        if MAY && self.foreseen { Some(elastic.plus(contact.last_viscous)) } else { None }
    }

    /// Tangential force [N] of sliding contacts, whose force would be `force` without a limit [N]. `carried` is the last
    /// elastic part in the present plane [N].
    #[inline(always)]
    pub(in super::super) fn sliding<const MAY: bool, L: Lanes>(
        self,
        (force, limit): (Triple<L>, L),
        carried: Triple<L>,
        kept: &Kept<L>,
        contact: &Contact<L>,
    ) -> Triple<L> {
        let limited = force.times(kept.force);
        let slides = kept.force.less(L::all(1.0));
        if !MAY || !self.foreseen || slides == 0 || contact.extended {
            return limited;
        }
        let last = carried.plus(super::carried(contact.last_viscous, contact));
        turned(last, force, limit).or(limited, slides & contact.touched)
    }

    /// Constants of a contact as they count in the stable step of packings.
    pub(in super::super) const fn in_packings(self, mut hardest: Hardest) -> Hardest {
        if self.foreseen {
            hardest.dashpots[1] *= 1.2;
        }
        hardest
    }
}

impl<L: Lanes> Contact<L> {
    /// `r` of a reduced mass `m` [s/kg], given `1/m` [1/kg].
    #[inline(always)]
    fn own(&self, inverse_mass: L) -> L {
        L::all(0.5 * self.dt) * inverse_mass
    }

    /// Dashpot [N s/m] with the weight of contacts that have begun since the last step; `power` is that of the overlap with
    /// which it grows.
    #[inline(always)]
    fn timely(&self, dashpot: L, power: f64) -> L {
        if self.begun == 0 {
            return dashpot;
        }
        let weight = L::all(0.5) + self.lasted * L::all(1.0 / (self.dt * (1.0 + power)));
        (dashpot * weight).or(dashpot, self.begun)
    }

    /// Normal force [N] of a spring with the force `elastic` [N] and a dashpot [N s/m] that grows with a power of the
    /// overlap. `last` is the force of the last step [N], if velocities are predicted. `inverse_mass` is that of both
    /// bodies [1/kg].
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

/// A force that follows Coulomb's limit [N] while it slides through a step, from `last` towards `force` without a limit [N].
///
/// The force first grows to the limit in a straight line. Then it turns along the limit into the direction of its change, by
/// `d tan(θ/2) / dx = -tan(θ/2)` with the angle `θ` between both and the change `x` over the limit. The exponential of this
/// is replaced by a fraction with errors of the third order (Krieg and Krieg 1977, DOI 10.1115/1.3454568, for plasticity).
#[inline(always)]
fn turned<L: Lanes>(last: Triple<L>, force: Triple<L>, limit: L) -> Triple<L> {
    let (zero, half, one) = (L::all(0.0), L::all(0.5), L::all(1.0));
    let change = force.minus(last);
    // Part of the change up to the limit.
    let (a, b, c) = (change.dot(change), last.dot(change), last.dot(last) - limit * limit);
    let square = b * b - a * c;
    let reaches = (square.or(zero, zero.less(square)).sqrt() - b) / a;
    let part = reaches.or(one, reaches.less(one)).or(zero, c.less(zero));
    let at_limit = last.plus(change.times(part));
    let size = at_limit.dot(at_limit).sqrt();
    let way = a.sqrt();
    let (from, along) = (at_limit.over(size), change.over(way));
    let x = (one - part) * way / (half * (size + limit));
    let decay = one / (one + x + half * x * x);
    let cosine = from.dot(along);
    let (ahead, behind) = (one + cosine, decay * decay * (one - cosine));
    let two = L::all(2.0) * decay;
    let both = along.times(ahead - behind - two * cosine).plus(from.times(two));
    // Directions without a size are those of the force itself.
    let turned = both.times(limit / (ahead + behind));
    let is_known = zero.less(size) & zero.less(way) & zero.less(ahead + behind);
    let size = force.dot(force).sqrt();
    turned.or(force.times(limit / size), is_known)
}

/// Dashpot in the contact plane, for use beside a spring and under friction's limit.
#[derive(Clone, Copy)]
pub struct InPlane<L> {
    /// Dashpot [N s/m].
    dashpot: L,
    /// Velocity that it acts on, without the effect of the contact's own force [m/s].
    velocity: Triple<L>,
    /// Decrease of that velocity per force of the contact [s/kg], if velocities are predicted.
    own: Option<L>,
}

impl<L: Lanes> InPlane<L> {
    /// Dashpot of a contact with this last tangential force [N], see [`Contact::damped`].
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

    /// Force of spring and dashpot together, without a limit [N].
    #[inline(always)]
    pub fn beside(&self, spring: Triple<L>) -> Triple<L> {
        let both = spring.plus(self.velocity.times(self.dashpot));
        match self.own {
            Some(own) => both.over(L::all(1.0) + self.dashpot * own),
            None => both,
        }
    }

    /// Part of the dashpot, if spring and dashpot together give this force [N].
    #[inline(always)]
    pub fn part_of(&self, force: Triple<L>) -> Triple<L> {
        let velocity = match self.own {
            Some(own) => self.velocity.minus(force.times(own)),
            None => self.velocity,
        };
        velocity.times(self.dashpot)
    }
}
