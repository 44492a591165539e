//! Linear springs (Cundall and Strack 1979, DOI 10.1680/geot.1979.29.1.47): the paper's law.
//!
//! Normal: `N = k_n δ + γ_n δ̇`, by default never attractive. Tangential: `T = k_t ξ + γ_t ξ̇` with a spring `ξ` in the
//! contact plane that is carried along when the pair turns and grows with the sliding velocity. Beyond Coulomb's limit `T`
//! is cut to `μ N`, and the spring to `ξ = (T - γ_t ξ̇) / k_t`. So spring and dashpot together equal the limit, and nothing
//! jumps where sliding begins or ends (Luding 2008, DOI 10.1007/s10035-008-0099-x, section 2.4). This law suits scenes
//! where stiffness only has to be high enough. The contact time does not depend on the velocity, so one time step serves a
//! whole run.
//!
//! The normal force dissipates where it has a dashpot, the tangential force where there is friction.

#![expect(clippy::inline_always, reason = "see `lanes`")]

mod constants;

pub use constants::{Constants, damping_ratio_of_restitution};

use super::kernel::{
    Action, Contact, InPlane, Kept, Model, Spread, Turning, carried, dashpot, reduced_mass,
    within_limit,
};
use super::{About, Body, Dashpots, Hardest};
use crate::contact::StateColumn;
use crate::ids::MaterialId;
use crate::lanes::{Lanes, Triple};
use crate::particles::Needs;
use serde::{Deserialize, Serialize};

/// Constants of every pair of materials.
pub type Interactions = super::Interactions<Constants>;

/// Settings of this law in a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Constants of every pair of materials.
    pub interactions: Interactions,
    /// Options of dashpots.
    pub dashpots: Dashpots,
}

impl Settings {
    /// Linear springs and dashpots with friction.
    pub(super) fn model<const FORESEES: bool>(&self) -> Linear<FORESEES> {
        Linear::new(self.interactions.clone(), self.dashpots)
    }
}

/// The linear spring and dashpot with Coulomb friction. Dashpots use predicted velocities only with `FORESEES`.
#[derive(Clone, Debug)]
pub(crate) struct Linear<const FORESEES: bool> {
    interactions: Interactions,
    dashpots: Dashpots,
    /// Is there any dashpot?
    damped: bool,
    /// Does any contact feel tangential motion?
    frictional: bool,
    state: Vec<StateColumn>,
}

/// Tangential spring, the stretch of A's surface against B's, if there is friction.
const SPRING: StateColumn = StateColumn::new("spring", 3, "m");
/// Normal force of the last touch, if there are dashpots. Without them it follows from the overlap.
const NORMAL_FORCE: StateColumn = StateColumn::new("normal_force", 1, "N");

impl<const FORESEES: bool> Linear<FORESEES> {
    /// Model with these constants.
    pub(crate) fn new(interactions: Interactions, dashpots: Dashpots) -> Self {
        let damped = interactions
            .iter()
            .any(|c| c.normal_damping_ratio > 0.0 || c.tangential_damping_ratio > 0.0);
        let frictional = interactions.iter().any(|c| c.is_frictional());
        let columns = [(frictional, SPRING), (damped, NORMAL_FORCE)];
        let state = columns.into_iter().filter(|(is_in, _)| *is_in).map(|(_, c)| c).collect();
        Self { interactions, dashpots, damped, frictional, state }
    }

    /// Remembered tangential springs [m].
    #[inline(always)]
    fn spring<L: Lanes>(&self, state: &[L]) -> Triple<L> {
        if self.frictional {
            Triple { x: state[0], y: state[1], z: state[2] }
        } else {
            Triple::zero()
        }
    }
}

/// Springs, dashpots and friction of contacts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Springs<L> {
    /// Normal stiffness [N/m].
    normal: L,
    /// Tangential stiffness [N/m].
    tangential: L,
    /// Coefficient of friction [-].
    friction: L,
    /// Normal and tangential dashpots [N s/m].
    dashpots: [L; 2],
    /// Inverse reduced mass [1/kg].
    inverse_mass: L,
}

impl<L: Lanes> Springs<L> {
    /// Contacts that feel tangential motion, as bits of lanes.
    #[inline(always)]
    fn frictional(&self) -> u8 {
        let zero = L::all(0.0);
        zero.less(self.friction) & zero.less(self.tangential)
    }

    /// Elastic energy in the normal and the tangential spring [J].
    #[inline(always)]
    fn stored(&self, overlap: L, spring: Triple<L>) -> [L; 2] {
        let half = L::all(0.5);
        [half * self.normal * overlap * overlap, half * self.tangential * spring.dot(spring)]
    }
}

impl<const FORESEES: bool> Linear<FORESEES> {
    /// Normal force of spring and dashpot [N].
    #[inline(always)]
    fn press<L: Lanes>(&self, springs: &Springs<L>, contact: &Contact<L>, state: &[L]) -> L {
        let mut force = springs.normal * contact.overlap * contact.gain;
        if self.damped {
            let last = self.dashpots.last::<FORESEES, _>(state[state.len() - 1]);
            force = contact.damped(force, (springs.dashpots[0], 0.0), springs.inverse_mass, last);
            if self.dashpots.limited {
                let zero = L::all(0.0);
                force = zero.or(force, force.less(zero));
            }
        }
        force
    }

    /// Tangential force of A on B [N], its spring [m], and the parts that Coulomb's limit leaves. `carried` is the spring
    /// of the last step carried into the present plane, `last` the spring as it was [m]. Beyond the limit the force is cut
    /// to it, and the spring to what the dashpot leaves of it.
    #[inline(always)]
    fn rub<L: Lanes>(
        &self,
        springs: &Springs<L>,
        normal_force: L,
        (carried, last): (Triple<L>, Triple<L>),
        contact: &Contact<L>,
    ) -> (Triple<L>, Triple<L>, Kept<L>) {
        let zero = L::all(0.0);
        let Contact { sliding, lasted, .. } = *contact;
        let spring = carried.plus(sliding.times(lasted));
        let mut force = spring.times(springs.tangential);
        let mut dashpot = None;
        if self.damped {
            let elastic = last.times(springs.tangential);
            let last = self.dashpots.last_in_plane::<FORESEES, _>(elastic, contact);
            let in_plane =
                InPlane::of(contact, (springs.dashpots[1], 0.0), springs.inverse_mass, last);
            force = in_plane.beside(force);
            dashpot = Some(in_plane);
        }
        let limit = springs.friction * normal_force.or(zero, zero.less(normal_force));
        let kept = within_limit(force, limit, contact);
        let slides = kept.force.less(L::all(1.0));
        let elastic = carried.times(springs.tangential);
        let limited = self.dashpots.sliding::<FORESEES, _>((force, limit), elastic, &kept, contact);
        let mut elastic = limited;
        if let Some(dashpot) = dashpot {
            elastic = limited.minus(dashpot.part_of(limited));
        }
        let stretched = elastic.over(springs.tangential);
        let stretched = stretched.or(Triple::zero(), zero.less(springs.tangential));
        let force = limited.or(force, slides).times(kept.remains);
        let spring = stretched.or(spring, slides).times(kept.remains);
        (force, spring, kept)
    }
}

impl<const FORESEES: bool> About for Linear<FORESEES> {
    fn name(&self) -> &'static str {
        "linear"
    }

    fn hardest(&self, body: &Body, other: MaterialId, reduced_mass: f64) -> Hardest {
        let constants = self.interactions.of(body.material, other);
        let normal = (constants.normal_stiffness, constants.normal_damping_ratio);
        let tangential = if constants.is_frictional() {
            (constants.tangential_stiffness, constants.tangential_damping_ratio)
        } else {
            (0.0, 0.0)
        };
        let dashpots = [normal, tangential]
            .map(|(stiffness, ratio)| 2.0 * ratio * (stiffness * reduced_mass).sqrt());
        let stiffness = normal.0.max(tangential.0);
        self.dashpots.in_packings(Hardest { stiffness, dashpots, turning: [0.0; 2] })
    }

    fn words(&self, a: MaterialId, b: MaterialId) -> String {
        let constants = self.interactions.of(a, b);
        format!(
            "normal stiffness {:.4e} N/m, tangential {:.4e} N/m, friction {}, damping ratio {:.4}",
            constants.normal_stiffness,
            constants.tangential_stiffness,
            constants.friction,
            constants.normal_damping_ratio
        )
    }

    fn left_out(&self) -> Vec<&'static str> {
        let dashpots = self.interactions.iter().any(|c| c.normal_damping_ratio > 0.0);
        let reasons = [
            (!self.frictional, "no tangential history: friction is 0 everywhere"),
            (!dashpots, "no dashpots: restitution is 1 everywhere"),
        ];
        reasons.into_iter().filter(|(is_out, _)| *is_out).map(|(_, reason)| reason).collect()
    }
}

impl<const FORESEES: bool> Model for Linear<FORESEES> {
    type Constants<L: Lanes> = Springs<L>;

    const FORESEES: bool = FORESEES;

    fn needs(&self) -> Needs {
        let dashpot = self.interactions.iter().any(|c| c.normal_damping_ratio > 0.0);
        Needs {
            velocity: self.frictional || dashpot || self.dashpots.foreseen,
            spin: self.frictional,
            ahead: self.damped && self.dashpots.foreseen,
            friction: self.frictional,
            tangential_dashpots: self
                .interactions
                .iter()
                .any(|c| c.is_frictional() && c.tangential_damping_ratio > 0.0),
            ..Needs::default()
        }
    }

    fn state(&self) -> &[StateColumn] {
        &self.state
    }

    fn constants(&self, a: &Body, b: &Body) -> Springs<f64> {
        let constants = self.interactions.of(a.material, b.material);
        let Constants { normal_stiffness, tangential_stiffness, friction, .. } = constants;
        let mass = reduced_mass(a, b);
        Springs {
            normal: normal_stiffness,
            tangential: tangential_stiffness,
            friction,
            dashpots: [
                dashpot(constants.normal_damping_ratio, mass, normal_stiffness),
                dashpot(constants.tangential_damping_ratio, mass, tangential_stiffness),
            ],
            inverse_mass: 1.0 / mass,
        }
    }

    #[inline(always)]
    fn spread<L: Lanes>(of: &impl Spread<Springs<f64>, L>) -> Springs<L> {
        Springs {
            normal: of.of(|c| c.normal),
            tangential: of.of(|c| c.tangential),
            friction: of.of(|c| c.friction),
            dashpots: [of.of(|c| c.dashpots[0]), of.of(|c| c.dashpots[1])],
            inverse_mass: of.of(|c| c.inverse_mass),
        }
    }

    #[inline(always)]
    fn dissipates<L: Lanes>(&self, springs: &Springs<L>) -> [u8; 2] {
        [L::all(0.0).less(springs.dashpots[0]), springs.frictional()]
    }

    #[inline(always)]
    fn last<L: Lanes>(&self, springs: &Springs<L>, overlap: L, state: &[L]) -> Action<L> {
        let spring = self.spring(state);
        Action {
            press: if self.damped { state[state.len() - 1] } else { springs.normal * overlap },
            rub: spring.times(springs.tangential),
            viscous: Triple::zero(),
            kept: Kept::all(),
            moment: Triple::zero(),
            stored: springs.stored(overlap, spring),
        }
    }

    #[inline(always)]
    fn act<L: Lanes>(
        &self,
        springs: &Springs<L>,
        contact: &Contact<L>,
        state: &mut [L],
    ) -> Action<L> {
        let zero = Triple::zero();
        let press = self.press(springs, contact, state);
        let (mut spring, mut rub, mut kept) = (zero, zero, Kept::all());
        let frictional = springs.frictional();
        if frictional != 0 {
            let last = self.spring(state);
            let carried = carried(last, contact);
            let (friction, stretched, left) = self.rub(springs, press, (carried, last), contact);
            // No time has passed at the start of a stage, so the spring stays unchanged.
            let now = if contact.dt > 0.0 { stretched } else { carried };
            spring = now.or(zero, frictional);
            rub = friction.or(zero, frictional);
            kept = left;
        }
        if self.frictional {
            [state[0], state[1], state[2]] = [spring.x, spring.y, spring.z];
        }
        if self.damped {
            state[state.len() - 1] = press;
        }
        Action {
            press,
            rub,
            viscous: rub.minus(spring.times(springs.tangential)),
            kept,
            moment: zero,
            stored: springs.stored(contact.overlap, spring),
        }
    }

    #[inline(always)]
    fn elastic<L: Lanes>(&self, springs: &Springs<L>, overlap: L) -> L {
        springs.normal * overlap
    }

    fn turning(&self, springs: &Springs<f64>, _overlap: f64) -> Turning {
        let Springs {
            tangential, friction, dashpots: [normal_dashpot, tangential_dashpot], ..
        } = *springs;
        let frictional = friction > 0.0;
        Turning {
            normal_dashpot,
            tangential_stiffness: if frictional { tangential } else { 0.0 },
            tangential_dashpot: if frictional { tangential_dashpot } else { 0.0 },
            friction,
        }
    }

    fn stiffness(&self, springs: &Springs<f64>, _overlap: f64, dt: f64) -> f64 {
        springs.normal + springs.dashpots[0] / dt
    }
}
