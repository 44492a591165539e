//! Resistance to rolling and twisting: springs with a limit, to add to any model of forces.
//!
//! Where A turns against B with `ω = ω_A - ω_B`, an angle `θ` grows by `ω dt`. Its part in the contact plane is rolling,
//! the part along the normal is twisting. Each resists with a moment
//!
//! `M = k θ + c ω`, at most `μ R_r N`, with `k = 2.25 k_n (μ R_r)²` and `c = 2 η √(I k)`.
//!
//! This is the elastic-plastic spring of type C of Ai, Chen, Rotter and Ooi (2011, DOI 10.1016/j.powtec.2010.09.030,
//! section 3.3) with their stiffness, used for twisting too.
//!
//! - `1/R_r = 1/R_A + 1/R_B` with the bounding radii, for any shapes; at a wall it is the radius of the particle.
//! - `k_n` is the normal force without dashpots over the overlap: the stiffness of a linear spring, `4/3 E* √(R* δ)` of
//!   Hertz.
//! - `1/I` is the sum of `1 / (7/5 m R²)` of both bodies for rolling, of `1 / (2/5 m R²)` for twisting: the values of
//!   spheres.
//! - `N` is the normal force of the model, dashpot included.
//!
//! Both `k θ` and the sum are cut to the limit. At the limit of the spring the dashpot can only reduce the moment, and
//! nothing jumps where rolling begins or ends. Where the stiffness grows the moment stays, where it falls the angle stays,
//! so that no energy is created.
//!
//! Relative angular velocities do not depend on the observer, even a rotating one, nor on the sizes of the bodies. The part
//! in the plane is carried along like tangential springs.
//!
//! In contacts of faces and straight sides friction resists twisting through their extent (see [`Turning`]): the twisting
//! spring is left out there.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::hertz::mean_while_growing;
use super::kernel::{Action, Contact, Model, Spread, Turning, carried};
use super::{About, Body, Hardest, Mixing};
use crate::contact::StateColumn;
use crate::ids::MaterialId;
use crate::lanes::{Lanes, Triple};
use crate::particles::Needs;
use crate::population::Library;
use crate::shape::Shape;
use serde::{Deserialize, Serialize};

/// Constants of a contact between two materials; by default nothing resists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Constants {
    /// Moment over `R_r N` at the limit of rolling [-].
    pub rolling_friction: f64,
    /// Moment over `R_r N` at the limit of twisting [-].
    pub twisting_friction: f64,
    /// Damping ratio `η` of both dashpots [-].
    pub damping_ratio: f64,
}

impl Mixing for Constants {
    /// The lower frictions, the mean damping ratio.
    fn mixed(a: &Self, b: &Self) -> Self {
        let lower = |a: f64, b: f64| if a < b { a } else { b };
        Self {
            rolling_friction: lower(a.rolling_friction, b.rolling_friction),
            twisting_friction: lower(a.twisting_friction, b.twisting_friction),
            damping_ratio: 0.5 * (a.damping_ratio + b.damping_ratio),
        }
    }
}

/// Constants of every pair of materials.
pub type Interactions = super::Interactions<Constants>;

/// Stiffness over `k_n (μ R_r)²`.
const STIFFNESS: f64 = 2.25;
/// Moments of inertia of a sphere over `m R²`.
const ABOUT_CONTACT: f64 = 1.4;
const ABOUT_CENTRE: f64 = 0.4;

/// Angle by which A has rolled on B.
const ROLLED: StateColumn = StateColumn::new("rolled", 3, "rad");
/// Angle by which A has twisted against B about the normal.
const TWISTED: StateColumn = StateColumn::new("twisted", 1, "rad");
/// Normal stiffness `k_n` of the last touch, which gives the energy together with the angles.
const NORMAL_STIFFNESS: StateColumn = StateColumn::new("turning_load_stiffness", 1, "N/m");
/// Whole moment of the last touch, if there are dashpots or twisting contributes to it.
const MOMENT: StateColumn = StateColumn::new("turning_moment", 3, "N m");

/// Model of forces with resistance to rolling and twisting.
#[derive(Clone, Debug)]
pub struct Rolling<M> {
    forces: M,
    interactions: Interactions,
    /// Does any contact resist rolling, and twisting?
    rolls: bool,
    twists: bool,
    /// Is the moment remembered?
    remembers: bool,
    state: Vec<StateColumn>,
    /// Number of its values before those of the forces.
    own: usize,
    /// Moment of inertia of a sphere of the shape's mass and bounding radius over the shape's smallest one [-], by shape.
    inertia_ratio: Vec<f64>,
}

impl<M: Model> Rolling<M> {
    /// Adds resistance to these forces.
    pub fn new(forces: M, interactions: Interactions, library: &Library) -> Self {
        let any = |holds: fn(Constants) -> bool| interactions.iter().any(holds);
        let rolls = any(|c| c.rolling_friction > 0.0);
        let twists = any(|c| c.twisting_friction > 0.0);
        let remembers = twists || any(|c| c.rolling_friction > 0.0 && c.damping_ratio > 0.0);
        let columns = [
            (rolls, ROLLED),
            (twists, TWISTED),
            (rolls || twists, NORMAL_STIFFNESS),
            (remembers, MOMENT),
        ];
        let mut state: Vec<_> =
            columns.into_iter().filter(|(is_in, _)| *is_in).map(|(_, c)| c).collect();
        let own = StateColumn::total_width(&state);
        state.extend_from_slice(forces.state());
        let inertia_ratio = |shape: &Shape| {
            let of_sphere = 0.4 * shape.bounding_radius() * shape.bounding_radius();
            // Walls do not turn.
            if shape.kind().is_of_walls() { 1.0 } else { of_sphere / shape.gyration().min() }
        };
        let inertia_ratio = library.shapes.iter().map(inertia_ratio).collect();
        Self { forces, interactions, rolls, twists, remembers, state, own, inertia_ratio }
    }

    /// Does any contact resist turning?
    fn turns(&self) -> bool {
        self.rolls || self.twists
    }

    /// State of turning.
    #[inline(always)]
    fn read<L: Lanes>(&self, state: &[L]) -> Turned<L> {
        let zero = L::all(0.0);
        let mut turned = Turned {
            rolled: Triple::zero(),
            twisted: zero,
            stiffness: zero,
            moment: Triple::zero(),
        };
        let mut at = 0;
        if self.rolls {
            turned.rolled = triple(state);
            at += 3;
        }
        if self.twists {
            turned.twisted = state[at];
            at += 1;
        }
        turned.stiffness = state[at];
        if self.remembers {
            turned.moment = triple(&state[at + 1..]);
        }
        turned
    }

    #[inline(always)]
    fn write<L: Lanes>(&self, turned: &Turned<L>, state: &mut [L]) {
        let mut at = 0;
        if self.rolls {
            write(turned.rolled, state);
            at += 3;
        }
        if self.twists {
            state[at] = turned.twisted;
            at += 1;
        }
        state[at] = turned.stiffness;
        if self.remembers {
            write(turned.moment, &mut state[at + 1..]);
        }
    }

    /// Normal force without dashpots over the overlap [N/m]; 0 without overlap.
    #[inline(always)]
    fn stiffness_of<L: Lanes>(&self, constants: &Resisting<M::Constants<L>, L>, overlap: L) -> L {
        let zero = L::all(0.0);
        let stiffness = self.forces.elastic(&constants.forces, overlap) / overlap;
        stiffness.or(zero, zero.less(overlap))
    }
}

/// State of A's turning against B.
#[derive(Clone, Copy, Debug)]
struct Turned<L> {
    /// Rolling angle in the contact plane [rad].
    rolled: Triple<L>,
    /// Twisting angle about the normal [rad].
    twisted: L,
    /// Stiffness of the normal force [N/m].
    stiffness: L,
    /// Moment of A on B at the last touch, if it is remembered [N m].
    moment: Triple<L>,
}

/// Spring against rolling or twisting.
#[derive(Clone, Copy, Debug)]
struct Spring<L> {
    /// Largest moment over the normal force, `μ R_r` [m].
    lever: L,
    /// Stiffness over that of the normal force, `2.25 (μ R_r)²` [m²].
    stiffness: L,
    /// Dashpot over the root of the stiffness of the normal force [√kg m].
    dashpot: L,
}

impl Spring<f64> {
    /// Spring with a friction coefficient, and moments of inertia of bodies over `m R²` [-].
    fn new(friction: f64, damping_ratio: f64, [a, b]: [&Body; 2], inertia: f64) -> Self {
        let lever = friction / (1.0 / a.radius + 1.0 / b.radius);
        let stiffness = STIFFNESS * lever * lever;
        // For a wall the inverse is 0, by its mass or its radius.
        let inverse = |body: &Body| 1.0 / (inertia * body.mass * body.radius * body.radius);
        let critical = 2.0 * (stiffness / (inverse(a) + inverse(b))).sqrt();
        Self { lever, stiffness, dashpot: damping_ratio * critical }
    }
}

impl<L: Lanes> Spring<L> {
    #[inline(always)]
    fn spread<C>(of: &impl Spread<C, L>, get: impl Fn(&C) -> &Spring<f64>) -> Self {
        Self {
            lever: of.of(|c| get(c).lever),
            stiffness: of.of(|c| get(c).stiffness),
            dashpot: of.of(|c| get(c).dashpot),
        }
    }

    /// Moment of A on B [N m], and the angle left within the limit.
    #[inline(always)]
    fn resist(
        &self,
        load: &Load<L>,
        angle: Triple<L>,
        turning: Triple<L>,
        contact: &Contact<L>,
    ) -> [Triple<L>; 2] {
        let zero = L::all(0.0);
        let stiffness = self.stiffness * load.stiffness;
        let limit = self.lever * load.press;
        let elastic = angle.times(stiffness);
        let left =
            angle.times(part_within(elastic, limit)).or(Triple::zero(), zero.less(stiffness));
        let moment = left.times(stiffness).plus(turning.times(self.dashpot * load.root));
        let size = moment.dot(moment).sqrt();
        let remains = contact.remains(|| size / limit);
        [moment.times(part_within(moment, limit) * remains), left.times(remains)]
    }
}

/// Factor that cuts a vector to the limit.
#[inline(always)]
fn part_within<L: Lanes>(vector: Triple<L>, limit: L) -> L {
    let size = vector.dot(vector).sqrt();
    (limit / size).or(L::all(1.0), limit.less(size))
}

/// Normal force and stiffness of a contact.
#[derive(Clone, Copy)]
struct Load<L> {
    /// Normal force [N]; 0 where it pulls.
    press: L,
    /// Its stiffness [N/m], and the square root of the stiffness.
    stiffness: L,
    root: L,
}

/// Constants of a contact: those of the forces, and both springs.
#[derive(Clone, Copy, Debug)]
pub struct Resisting<C, L> {
    forces: C,
    rolling: Spring<L>,
    twisting: Spring<L>,
}

impl<C, L: Lanes> Resisting<C, L> {
    /// Elastic energy of both springs [J].
    #[inline(always)]
    fn stored(&self, turned: &Turned<L>) -> L {
        let Turned { rolled, twisted, stiffness, .. } = *turned;
        let rolled = self.rolling.stiffness * rolled.dot(rolled);
        let twisted = self.twisting.stiffness * twisted * twisted;
        L::all(0.5) * stiffness * (rolled + twisted)
    }
}

/// Access to the constants of the forces.
struct OfForces<'a, S>(&'a S);

impl<C, L, S: Spread<Resisting<C, f64>, L>> Spread<C, L> for OfForces<'_, S> {
    #[inline(always)]
    fn of(&self, get: impl Fn(&C) -> f64) -> L {
        self.0.of(|constants| get(&constants.forces))
    }
}

#[inline(always)]
fn triple<L: Lanes>(state: &[L]) -> Triple<L> {
    Triple { x: state[0], y: state[1], z: state[2] }
}

#[inline(always)]
fn write<L: Lanes>(vector: Triple<L>, state: &mut [L]) {
    [state[0], state[1], state[2]] = [vector.x, vector.y, vector.z];
}

impl<M: Model> About for Rolling<M> {
    fn within(&self) -> Option<&dyn About> {
        Some(&self.forces)
    }

    fn name(&self) -> &'static str {
        self.forces.name()
    }

    /// A spring against turning acts like a tangential one at the surface: `k / R²`, where `R_r` is at most the radius.
    /// About each axis there is rolling or twisting. Bodies with smaller moments of inertia than a sphere feel it more.
    fn hardest(&self, body: &Body, other: MaterialId, reduced_mass: f64) -> Hardest {
        let mut hardest = self.forces.hardest(body, other, reduced_mass);
        let (normal, inertia_ratio) = (hardest.stiffness, self.inertia_ratio[body.shape.index()]);
        let Constants { rolling_friction, twisting_friction, damping_ratio } =
            self.interactions.of(body.material, other);
        let friction = rolling_friction.max(twisting_friction);
        let stiffness = STIFFNESS * friction * friction * normal;
        let critical = 2.0 * (ABOUT_CONTACT * reduced_mass * stiffness).sqrt();
        hardest.turning = [stiffness, damping_ratio * critical].map(|part| inertia_ratio * part);
        hardest
    }

    fn words(&self, a: MaterialId, b: MaterialId) -> String {
        let Constants { rolling_friction, twisting_friction, damping_ratio } =
            self.interactions.of(a, b);
        if !self.turns() {
            return self.forces.words(a, b);
        }
        format!(
            "{}, rolling friction {rolling_friction}, twisting friction {twisting_friction}, their damping ratio \
             {damping_ratio}",
            self.forces.words(a, b)
        )
    }

    fn left_out(&self) -> Vec<&'static str> {
        let reasons = [
            (!self.rolls, "no resistance to rolling: rolling_friction is 0 everywhere"),
            (!self.twists, "no resistance to twisting: twisting_friction is 0 everywhere"),
        ];
        let own = reasons.into_iter().filter(|(is_out, _)| *is_out).map(|(_, reason)| reason);
        self.forces.left_out().into_iter().chain(own).collect()
    }
}

impl<M: Model> Model for Rolling<M> {
    type Constants<L: Lanes> = Resisting<M::Constants<L>, L>;

    const MOMENTS: bool = true;
    const BY_CURVATURE: bool = M::BY_CURVATURE;
    const FORESEES: bool = M::FORESEES;
    const FACES: bool = M::FACES;

    fn needs(&self) -> Needs {
        Needs { velocity: true, spin: true, turning: self.turns(), ..self.forces.needs() }
    }

    fn state(&self) -> &[StateColumn] {
        &self.state
    }

    fn constants(&self, a: &Body, b: &Body) -> Self::Constants<f64> {
        let Constants { rolling_friction, twisting_friction, damping_ratio } =
            self.interactions.of(a.material, b.material);
        Resisting {
            forces: self.forces.constants(a, b),
            rolling: Spring::new(rolling_friction, damping_ratio, [a, b], ABOUT_CONTACT),
            twisting: Spring::new(twisting_friction, damping_ratio, [a, b], ABOUT_CENTRE),
        }
    }

    #[inline(always)]
    fn spread<L: Lanes>(of: &impl Spread<Self::Constants<f64>, L>) -> Self::Constants<L> {
        Resisting {
            forces: M::spread(&OfForces(of)),
            rolling: Spring::spread(of, |c| &c.rolling),
            twisting: Spring::spread(of, |c| &c.twisting),
        }
    }

    #[inline(always)]
    fn curved<L: Lanes>(
        &self,
        constants: &Self::Constants<L>,
        root_of_radius: L,
    ) -> Self::Constants<L> {
        let forces = self.forces.curved(&constants.forces, root_of_radius);
        Resisting { forces, ..*constants }
    }

    #[inline(always)]
    fn last<L: Lanes>(&self, constants: &Self::Constants<L>, overlap: L, state: &[L]) -> Action<L> {
        let (own, of_forces) = state.split_at(self.own);
        let mut action = self.forces.last(&constants.forces, overlap, of_forces);
        if !self.turns() {
            return action;
        }
        let turned = self.read(own);
        action.stored[1] = action.stored[1] + constants.stored(&turned);
        action.moment = if self.remembers {
            turned.moment
        } else {
            turned.rolled.times(constants.rolling.stiffness * turned.stiffness)
        };
        action
    }

    #[inline(always)]
    fn act<L: Lanes>(
        &self,
        constants: &Self::Constants<L>,
        contact: &Contact<L>,
        state: &mut [L],
    ) -> Action<L> {
        let (own, of_forces) = state.split_at_mut(self.own);
        let mut action = self.forces.act(&constants.forces, contact, of_forces);
        if !self.turns() {
            return action;
        }
        let zero = L::all(0.0);
        let Contact { normal, turning, touched, dt, lasted, .. } = *contact;
        let stiffness = self.stiffness_of(constants, contact.overlap);
        let press = action.press.or(zero, zero.less(action.press));
        let load = Load { press, stiffness, root: stiffness.sqrt() };
        // Where the contact has become stiffer the moment stays, and the angle shrinks.
        let mut turned = self.read(own);
        let stiffer = turned.stiffness.less(stiffness);
        let one = L::all(1.0);
        let kept = (turned.stiffness / stiffness).or(one, stiffer);
        // The stiffness during the step was lower, by Hertz's law.
        let mean = mean_while_growing(one - kept).or(one, touched & stiffer);
        let lasted = lasted * mean;
        turned.stiffness = stiffness;
        turned.moment = Triple::zero();
        let twisting = turning.dot(normal);
        if self.rolls {
            let rolling = turning.minus(normal.times(twisting));
            let before = carried(turned.rolled, contact).times(kept);
            let angle = before.plus(rolling.times(lasted));
            let [moment, left] = constants.rolling.resist(&load, angle, rolling, contact);
            turned.moment = moment;
            turned.rolled = if dt > 0.0 { left } else { before };
        }
        if self.twists && !contact.extended {
            let before = (turned.twisted * kept).or(zero, touched);
            let angle = before + twisting * lasted;
            let along = |number: L| Triple { x: number, y: zero, z: zero };
            let [moment, left] =
                constants.twisting.resist(&load, along(angle), along(twisting), contact);
            turned.moment = turned.moment.plus(normal.times(moment.x));
            turned.twisted = if dt > 0.0 { left.x } else { before };
        }
        self.write(&turned, own);
        action.moment = turned.moment;
        action.stored[1] = action.stored[1] + constants.stored(&turned);
        action
    }

    #[inline(always)]
    fn turned<L: Lanes>(&self, constants: &Self::Constants<L>, _overlap: L, state: &[L]) -> L {
        if !self.turns() {
            return L::all(0.0);
        }
        constants.stored(&self.read(state))
    }

    /// Moments can dissipate even where tangential forces cannot.
    #[inline(always)]
    fn dissipates<L: Lanes>(&self, constants: &Self::Constants<L>) -> [u8; 2] {
        let [normally, _] = self.forces.dissipates(&constants.forces);
        [normally, u8::MAX]
    }

    #[inline(always)]
    fn elastic<L: Lanes>(&self, constants: &Self::Constants<L>, overlap: L) -> L {
        self.forces.elastic(&constants.forces, overlap)
    }

    fn turning(&self, constants: &Self::Constants<f64>, overlap: f64) -> Turning {
        self.forces.turning(&constants.forces, overlap)
    }

    fn stiffness(&self, constants: &Self::Constants<f64>, overlap: f64, dt: f64) -> f64 {
        self.forces.stiffness(&constants.forces, overlap, dt)
    }
}
