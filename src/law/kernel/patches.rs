//! Contacts in scenes that have bodies with faces or straight sides.
//!
//! Contacts of two polyhedra, of two spherocylinders, or of one of them and a plane, have a patch. They are found one after
//! the other. The other contacts are found eight at a time, picked from a window of the list. Then all contacts of the
//! window are summed in their order. The bits of a contact do not depend on the other contacts. Without a patch, its force
//! and springs have the same bits as in scenes without faces.
//!
//! A face presses in an area. The normal force is the model's at the overlap `D`, times the gain `g = |grad D|`, so that
//! its energy is still the model's at `D` ([`crate::contact::thickness`]). In addition there act
//!
//! - the elastic couple about the normal, the rest of the gradient;
//! - the moment of the normal dashpot spread over the patch, `c g n × [C (n × ω)]` on A, with the covariance `C` of the
//!   patch and `ω = ω_A - ω_B`. It dissipates rocking. It is zero for a point, and about the line of an edge;
//! - the moment of a model that has one;
//! - torsion: a spring `φ` [m] with `dφ = a ω·n dt`, its stretch at a distance `a` from the axis, with the constants of the
//!   tangential spring and Coulomb's limit. Its moment is `a` times its force. When `a` changes, `φ` and its energy stay.
//!   Where its stiffness grows with the overlap the force stays, and where it falls `φ` stays, as for the tangential
//!   spring. So no energy is created.
//!
//! `a` is the mean distance of the points of the patch from the normal, for friction in each point under even pressure
//! ([`crate::contact::Patch::mean_distance`]). Tangential friction and torsion share Coulomb's limit
//! ([`super::within_limit`]).
//!
//! All forces except the elastic normal force and couple are remembered with the point where they acted, so that
//! dissipation is exactly their work. The integration error of the elastic ones appears in the energy error of the report.
//! The point must be remembered because it runs from edge to edge when a body rocks; no support point could replace it.

use super::balance::{Powers, Stored};
use super::{
    Action, Arms, CONTACT_POINT, Contact, Contacts, Geometry, GeometryInLanes, Kept, Losses,
    MOST_STATE, MOST_STATE_OF_MOMENTS, Model, Pair, Particles, Separated, Slot, add, geometries_at,
    pieces, read_state, rows_at, triple as in_lanes, vector, vectors,
};
use crate::contact::{Previous, StateColumn};
use crate::lanes::{Eight, Gather, Kernel, Row, RowPairs, Triple, WIDTH};
use crate::law::hertz::mean_while_growing;
use crate::math::Vec3;

/// State columns after those of the model.
pub(super) const REMEMBERED: [StateColumn; 5] = [
    CONTACT_POINT,
    StateColumn::new("dissipative_force", 3, "N"),
    StateColumn::new("dissipative_moment", 3, "N m"),
    StateColumn::new("pressing_force", 1, "N"),
    StateColumn::new("torsion", 1, "m"),
];

/// Constants of the resistance to turning on a patch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Turning {
    /// Normal dashpot [N s/m].
    pub normal_dashpot: f64,
    /// Tangential stiffness [N/m]; 0 without friction.
    pub tangential_stiffness: f64,
    /// Tangential dashpot [N s/m]; 0 without friction.
    pub tangential_dashpot: f64,
    /// Coefficient of friction [-].
    pub friction: f64,
}

impl Turning {
    /// Part of the stretch that stays when these constants change to `now` [-].
    fn kept(&self, now: &Self) -> f64 {
        let (last, now) = (self.tangential_stiffness, now.tangential_stiffness);
        if last < now { last / now } else { 1.0 }
    }
}

/// Values of `REMEMBERED` by name.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Memory {
    /// Point where the forces acted, from the centre of A [m].
    point: Vec3,
    /// Force of dashpots and friction on B [N].
    force: Vec3,
    /// Moment of dashpots, torsion and the model on B about the point [N m].
    moment: Vec3,
    /// Normal force [N].
    pub(super) press: f64,
    /// Stretch of the torsional spring [m].
    torsion: f64,
}

impl Memory {
    /// Number of values.
    pub(super) const WIDTH: usize = 11;

    /// Reads the values; all zero if there are none.
    pub(super) fn read(numbers: &[f64]) -> Self {
        let Ok(&[a, b, c, d, e, f, g, h, i, press, torsion]) =
            <&[f64; Self::WIDTH]>::try_from(numbers)
        else {
            return Self::default();
        };
        let (point, force) = (Vec3::new(a, b, c), Vec3::new(d, e, f));
        Self { point, force, moment: Vec3::new(g, h, i), press, torsion }
    }

    fn write(&self, numbers: &mut [f64]) {
        let Self { point, force, moment, press, torsion } = self;
        let all = point.iter().chain(force).chain(moment).chain([press, torsion]);
        for (number, value) in numbers.iter_mut().zip(all) {
            *number = *value;
        }
    }

    /// Elastic energy of torsion [J].
    pub(super) fn stored(&self, turning: &Turning) -> f64 {
        0.5 * turning.tangential_stiffness * self.torsion * self.torsion
    }

    /// Powers of the remembered forces at a normal, when they acted. `of_model` is the model's part of the moment,
    /// `viscous` the part of tangential dashpots in the force.
    fn powers(
        &self,
        normal: &Vec3,
        of_model: &Vec3,
        viscous: Option<Vec3>,
        (motion, when): (&Motion, usize),
    ) -> Powers<f64> {
        let (velocity, turning) = (motion.at(&self.point, when), motion.turning());
        let rest = self.moment - of_model;
        let torsion = normal * rest.dot(normal);
        let in_plane = self.in_plane(normal);
        Powers {
            pressing: (self.force - in_plane).dot(&velocity) + (rest - torsion).dot(&turning),
            rubbing: in_plane.dot(&velocity) + torsion.dot(&turning),
            turning: Some(of_model.dot(&turning)),
            damping: viscous.map(|force| force.dot(&velocity)),
        }
    }

    /// Tangential force on B, for the normal at which it acted [N].
    fn in_plane(&self, normal: &Vec3) -> Vec3 {
        self.force - normal * self.force.dot(normal)
    }

    /// Whole force on B, for the normal at which it acted [N].
    fn total_force(&self, normal: &Vec3) -> Vec3 {
        normal * (self.press - self.force.dot(normal)) + self.force
    }
}

/// Gains of velocities without prediction.
const NO_GAINS: [[Vec3; 2]; 2] = [[Vec3::new(0.0, 0.0, 0.0); 2]; 2];

/// Positions and motion of two bodies.
struct Motion {
    /// From the centre of A to that of B, now and at the last step [m].
    r: [Vec3; 2],
    /// Velocities of the centres of A and B [m/s].
    velocity: [Vec3; 2],
    /// Angular velocities [rad/s].
    spin: [Vec3; 2],
    /// Predicted gains of `velocity` [m/s] and `spin` [rad/s] of each.
    ahead: [[Vec3; 2]; 2],
    /// Velocity of the surface of B against B in the contact plane, now and at the last step, if B is a belt [m/s].
    belt: [Vec3; 2],
    /// Is B a wall?
    with_wall: bool,
}

impl Motion {
    /// Motion of a pair, with the present and the last normal.
    fn of(pair: Pair, particles: &Particles, dt: f64, normals: [&Vec3; 2]) -> Self {
        let r = particles.bodies().relative(pair);
        let bodies = [pair.a, pair.b].map(Slot::index);
        let mut velocity = bodies.map(|k| particles.velocity[k]);
        velocity[1] += particles.sliding_of_image(pair);
        let spin = [pair.a, pair.b].map(|slot| particles.angular_velocity_of(slot));
        let belt = normals.map(|normal| particles.belt_at(pair.b, normal));
        let with_wall = pair.b.index() >= particles.first_facet();
        let ahead = if particles.needs.ahead && dt > 0.0 {
            bodies.map(|k| particles.ahead_of(k))
        } else {
            NO_GAINS
        };
        let last = r - (velocity[1] - velocity[0]) * dt;
        Self { r: [r, last], velocity, spin, ahead, belt, with_wall }
    }

    /// No motion, for laws that need no velocities.
    fn none(pair: Pair, particles: &Particles) -> Self {
        let r = particles.bodies().relative(pair);
        let zeros = [Vec3::zeros(); 2];
        let (velocity, spin, belt) = (zeros, zeros, zeros);
        Self { r: [r; 2], velocity, spin, ahead: NO_GAINS, belt, with_wall: false }
    }

    /// See [`super::Motion::ahead`] [m/s].
    fn ahead(&self, point: &Vec3) -> Vec3 {
        let [[of_a, spin_a], [of_b, spin_b]] = &self.ahead;
        of_a - of_b + spin_a.cross(point) - spin_b.cross(&(point - self.r[0]))
    }

    /// See [`super::Motion::midway`] [m/s].
    fn midway(&self, dt: f64) -> Vec3 {
        let around = if self.with_wall { self.spin[1] * 2.0 } else { self.spin[0] + self.spin[1] };
        around.cross(&(self.velocity[0] - self.velocity[1])) * (0.25 * dt)
    }

    /// Velocity of A's surface against B's at a point from the centre of A, now or at the last step [m/s].
    fn at(&self, point: &Vec3, when: usize) -> Vec3 {
        let of_a = self.velocity[0] + self.spin[0].cross(point);
        let of_b = self.velocity[1] + self.belt[when];
        of_a - of_b - self.spin[1].cross(&(point - self.r[when]))
    }

    /// `ω_A - ω_B` [rad/s].
    fn turning(&self) -> Vec3 {
        self.spin[0] - self.spin[1]
    }

    /// Work on B of one force over half a step [J], now or at the last step.
    fn work_on_b(&self, force: &Vec3, moment: &Vec3, point: &Vec3, when: usize, half: f64) -> f64 {
        let arm = point - self.r[when];
        let velocity = self.velocity[1] + self.belt[when];
        half * (force.dot(&velocity) + (arm.cross(force) + moment).dot(&self.spin[1]))
    }
}

/// Contacts whose forces are to be found.
pub(super) struct WithPatches<'a, 'b, M: Model>(pub(super) Contacts<'a, 'b, M>);

impl<M: Model> Kernel for WithPatches<'_, '_, M> {
    type Home = M;

    #[inline(always)]
    fn run<L: Eight>(self) {
        let Self(mut contacts) = self;
        if contacts.law.needs.velocity {
            contacts.in_windows::<L, true>();
        } else {
            contacts.in_windows::<L, false>();
        }
        contacts.add_separated_before(usize::MAX);
    }
}

/// Contacts found before they are summed: few enough for the nearest cache, and enough that hardly a lane is empty.
const WINDOW: usize = 128;

/// Forces, moments and losses of the contacts of a window.
struct Window {
    /// Force on B [N], and what each body loses [J].
    forces: [[f64; 4]; WINDOW],
    /// Moments on B and A [N m], and what each body loses to friction [J].
    torques: [[[f64; 4]; 2]; WINDOW],
    /// Energy that each body loses in other channels [J], see [`Losses`].
    parts: [[f64; 3]; WINDOW],
    /// Work of a wall on the particle [J].
    wall_work: [f64; WINDOW],
}

impl Window {
    /// Notes rows of the force on B, and of the moments on B and A, of contacts at these places in a window that begins at `first`.
    #[inline(always)]
    fn note<R: Row>(&mut self, places: &[u32], first: usize, rows: &[[R; WIDTH]; 3]) {
        let [forces, on_b, on_a] = rows;
        for (lane, &place) in places.iter().enumerate() {
            let place = place as usize - first;
            forces[lane].write(&mut self.forces[place]);
            on_b[lane].write(&mut self.torques[place][0]);
            on_a[lane].write(&mut self.torques[place][1]);
        }
    }

    /// Notes the losses of each body to tangential dashpots and to moments [J].
    #[inline(always)]
    fn note_parts(&mut self, places: &[u32], first: usize, parts: [[f64; WIDTH]; 2]) {
        for (lane, &place) in places.iter().enumerate() {
            self.parts[place as usize - first] = [parts[0][lane], parts[1][lane], 0.0];
        }
    }
}

/// State of eight contacts without a patch.
#[derive(Clone, Copy)]
struct MemoryInLanes<L> {
    /// See [`Memory`]; there is no torsion.
    point: Triple<L>,
    force: Triple<L>,
    moment: Triple<L>,
    press: L,
}

impl<L: Eight> MemoryInLanes<L> {
    /// Viscous part of the tangential force, beside an elastic part `rub` [N].
    #[inline(always)]
    fn viscous(&self, normal: Triple<L>, rub: Triple<L>) -> Triple<L> {
        self.force.minus(normal.times(self.force.dot(normal))).minus(rub)
    }
}

/// Eight contacts without a patch.
struct WithoutPatch<L> {
    /// Their places in the list.
    at: [usize; WIDTH],
    /// Contact points from the centres of A [m].
    point: Triple<L>,
    now: GeometryInLanes<L>,
    last: GeometryInLanes<L>,
    before: MemoryInLanes<L>,
}

/// Eight contacts without a patch at a step.
struct Instant<L> {
    normal: Triple<L>,
    /// Normal force without that of the spring [N].
    beyond: L,
    memory: MemoryInLanes<L>,
    action: Action<L>,
    /// Elastic energy of moments [J].
    turned: L,
}

/// Forces and moments of one contact.
struct Acting {
    /// Force on B [N].
    force: Vec3,
    /// Moment on B about the contact point [N m].
    moment: Vec3,
    memory: Memory,
    /// Part of the model in the moment [N m].
    of_model: Vec3,
    /// Part of tangential dashpots in the force [N].
    viscous: Vec3,
    /// Is friction below its limit?
    sticks: bool,
    /// Elastic energy of friction and torsion [J].
    stored: f64,
}

impl<M: Model> Contacts<'_, '_, M> {
    /// Finds the forces of all contacts, and sums them in the order of the list.
    #[inline(always)]
    fn in_windows<L: Eight, const MOVES: bool>(&mut self) {
        let all = self.work.pairs;
        let pairs = RowPairs::new(bytemuck::cast_slice(all), self.particles.slots());
        let mut window = Window {
            forces: [[0.0; 4]; WINDOW],
            torques: [[[0.0; 4]; 2]; WINDOW],
            parts: [[0.0; 3]; WINDOW],
            wall_work: [0.0; WINDOW],
        };
        for first in (0..all.len()).step_by(WINDOW) {
            let count = WINDOW.min(all.len() - first);
            // Every place is written to both lists and kept in one: no branch to mispredict.
            let (mut points, mut faces) = ([0_u32; WINDOW + 1], [0_u32; WINDOW + 1]);
            let (mut with_point, mut with_face) = (0, 0);
            for (pair, place) in all[first..][..count].iter().zip(first as u32..) {
                let has_patch = self.law.has_patch(*pair, self.particles);
                (points[with_point], faces[with_face]) = (place, place);
                with_point += usize::from(!has_patch);
                with_face += usize::from(has_patch);
            }
            for places in points[..with_point].chunks(WIDTH) {
                self.picked::<L, MOVES>(places, pairs, first, &mut window);
            }
            for &place in &faces[..with_face] {
                self.on_patch(place as usize, first, &mut window);
            }
            self.sum_window(first, count, &window);
        }
    }

    /// Finds the forces of up to eight contacts without a patch, of the window that begins at `first`.
    #[inline(always)]
    fn picked<L: Eight, const MOVES: bool>(
        &mut self,
        places: &[u32],
        pairs: RowPairs,
        first: usize,
        window: &mut Window,
    ) {
        let Self { law, particles, dt, .. } = *self;
        let mut room = [[0; 2]; WIDTH];
        let [a, b] = pairs.picked(places, &mut room);
        let constants = self.constants::<L>([a, b]).of_law;
        let with_walls = b.at(0) >= particles.first_facet();
        let zero = L::all(0.0);

        let (mut room, mut wide) = ([zero; MOST_STATE], [zero; MOST_STATE_OF_MOMENTS]);
        let state = if M::MOMENTS { &mut wide[..law.width] } else { &mut room[..law.width] };
        let WithoutPatch { at, point, now, last, before } = self.read_picked(places, state);
        let arms = self.arms_at::<L>([a, b], point, before.point, MOVES || with_walls);
        let mut motion = if MOVES {
            super::Motion::of::<M>(particles, [a, b], arms.now, arms.last, dt)
        } else {
            super::Motion::none()
        };
        let belts = if MOVES && with_walls { super::belts::<L>(particles, b) } else { None };
        let belts = motion.carried_by(belts, [&now, &last]);

        let mut contact = motion.contact(&last, &now, dt).timed(zero);
        let last_acting = law.model.last(&constants, last.overlap, state);
        if M::FORESEES && law.needs.ahead && law.needs.tangential_dashpots {
            contact.last_viscous = before.viscous(last.normal, last_acting.rub);
        }
        let turned_before =
            if M::MOMENTS { law.model.turned(&constants, last.overlap, state) } else { zero };
        let acting = law.model.act(&constants, &contact, state);
        let beyond = acting.press - law.model.elastic(&constants, now.overlap);
        let now_acting = MemoryInLanes {
            point,
            force: now.normal.times(beyond).plus(acting.rub),
            moment: if M::MOMENTS { acting.moment } else { Triple::zero() },
            press: acting.press,
        };
        self.write_picked(&at[..places.len()], state, &now_acting);
        let force = now.normal.times(acting.press).plus(acting.rub);
        let mut on = [arms.now[1].cross(force), force.cross(arms.now[0])];
        if M::MOMENTS {
            on = [on[0].plus(acting.moment), on[1].minus(acting.moment)];
        }
        let mut lost = Losses::none();
        if MOVES && dt > 0.0 {
            let turned =
                if M::MOMENTS { law.model.turned(&constants, now.overlap, state) } else { zero };
            let last = Instant {
                normal: last.normal,
                beyond: before.force.dot(last.normal),
                memory: before,
                action: last_acting,
                turned: turned_before,
            };
            let (memory, action) = (now_acting, acting);
            let now = Instant { normal: now.normal, beyond, memory, action, turned };
            lost = self.lost_between([&last, &now], &motion);
        }
        let shares = L::all(super::shares(with_walls));
        let (share, rubbed) = (shares * lost.all, shares * lost.of_friction);
        window.note(places, first, &[force.rows(share), on[0].rows(rubbed), on[1].rows(rubbed)]);
        if M::MOMENTS || law.needs.tangential_dashpots {
            let [of_dashpots, of_turning, _] = lost.parts;
            let parts = [(shares * of_dashpots).store(), (shares * of_turning).store()];
            window.note_parts(places, first, parts);
        }
        if with_walls {
            let along = last.normal.times(before.press - before.force.dot(last.normal));
            let last_force = along.plus(before.force);
            let moments = arms.last[1].cross(last_force).plus(before.moment).plus(on[0]);
            let work = self.work_of_walls(b, [last_force, force], moments, belts);
            for (&place, work) in places.iter().zip(work) {
                window.wall_work[place as usize - first] = work;
            }
        }
    }

    /// Work of walls on particles by the last forces on walls and those of now [J], as for contacts with a patch. `moments` is the sum of both
    /// moments about the walls' reference points [N m]; `belts` are velocities of surfaces now and at the last step [m/s].
    #[inline(always)]
    fn work_of_walls<L: Eight>(
        &self,
        walls: Gather,
        [last_force, force]: [Triple<L>; 2],
        moments: Triple<L>,
        belts: Option<[Triple<L>; 2]>,
    ) -> [f64; WIDTH] {
        let (velocity, spin) = super::velocities::<L>(self.particles, walls);
        let mut work = last_force.plus(force).dot(velocity) + moments.dot(spin);
        if let Some([now, last]) = belts {
            work = work + force.dot(now) + last_force.dot(last);
        }
        (L::all(0.0) - L::all(0.5 * self.dt) * work).store()
    }

    /// Losses of up to eight contacts without a patch, between the last step and this one.
    #[inline(always)]
    fn lost_between<L: Eight>(
        &self,
        [last, now]: [&Instant<L>; 2],
        motion: &super::Motion<L>,
    ) -> Losses<L> {
        let zero = L::all(0.0);
        let power =
            last.memory.force.dot(motion.last_velocity) + now.memory.force.dot(motion.velocity);
        let pressing = last.beyond * motion.last_velocity.dot(last.normal)
            + now.beyond * motion.velocity.dot(now.normal);
        let turning = if M::MOMENTS {
            Some(last.memory.moment.plus(now.action.moment).dot(motion.turning))
        } else {
            None
        };
        let stored = [
            Stored::of([zero, last.action.stored[1]], last.turned),
            Stored::of([zero, now.action.stored[1]], now.turned),
        ];
        let damping = if self.law.needs.tangential_dashpots {
            let viscous = last.memory.viscous(last.normal, last.action.rub);
            let power = viscous.dot(motion.last_velocity) + now.action.viscous.dot(motion.velocity);
            Some(power.or(zero, L::all(1.0).at_most(now.action.kept.force)))
        } else {
            None
        };
        let powers = Powers { pressing, rubbing: power - pressing, turning, damping };
        powers.balance(stored, L::all(0.5 * self.dt), [u8::MAX; 2])
    }

    /// Arms from the centres of A and B to the contact points, now and at the last step. Points are given from A.
    #[inline(always)]
    fn arms_at<L: Eight>(
        &self,
        [a, b]: [Gather; 2],
        point: Triple<L>,
        last_point: Triple<L>,
        moves: bool,
    ) -> Arms<L> {
        let Particles { position, cell, .. } = self.particles;
        let to_b = cell.nearest_of(vectors::<L>(position, b).minus(vectors(position, a)));
        let last_to_b = if moves {
            to_b.minus(super::parting::<L>(self.particles, [a, b]).times(L::all(self.dt)))
        } else {
            to_b
        };
        Arms { now: [point, point.minus(to_b)], last: [last_point, last_point.minus(last_to_b)] }
    }

    /// Reads up to eight contacts without a patch, now and at the last step; the other lanes repeat the first. The model's
    /// state goes to `state`.
    #[inline(always)]
    fn read_picked<L: Eight>(&self, places: &[u32], state: &mut [L]) -> WithoutPatch<L> {
        let Self { law, work, .. } = self;
        let mut at = [places[0] as usize; WIDTH];
        for (at, &place) in at.iter_mut().zip(places) {
            *at = place as usize;
        }
        let mut from = [Previous::NONE; WIDTH];
        for (from, &at) in from.iter_mut().zip(&at) {
            *from = if work.from.is_empty() { Previous::at(at) } else { work.from[at] };
        }
        let rows = rows_at(work.last.state, law.stride, &from);
        read_state(&rows, state);
        let mut memories = [[L::all(0.0); 4]; 3];
        for (columns, first) in memories.iter_mut().zip([0, 4, 7]) {
            let four = pieces::<4>(&rows, law.width + first).expect("a patch follows");
            *columns = L::columns_of_4(&four);
        }
        let [[x, y, z, force_x], [force_y, force_z, moment_x, _], [moment_y, moment_z, press, _]] =
            memories;
        WithoutPatch {
            at,
            point: in_lanes(&rows_of(work.points, &at)),
            now: GeometryInLanes::of(&rows_of(work.geometry, &at)),
            last: GeometryInLanes::of(&geometries_at(work.last.geometry, &from)),
            before: MemoryInLanes {
                point: Triple { x, y, z },
                force: Triple { x: force_x, y: force_y, z: force_z },
                moment: Triple { x: moment_x, y: moment_y, z: moment_z },
                press,
            },
        }
    }

    /// Writes the new state of contacts without a patch.
    #[inline(always)]
    fn write_picked<L: Eight>(
        &mut self,
        places: &[usize],
        columns: &[L],
        memory: &MemoryInLanes<L>,
    ) {
        let (width, stride) = (columns.len(), self.law.stride);
        let mut at = 0;
        while at < width {
            let last = width - 1;
            let block = L::rows_of_4([
                columns[at],
                columns[last.min(at + 1)],
                columns[last.min(at + 2)],
                columns[last.min(at + 3)],
            ]);
            // Values past the row's width are overwritten later.
            self.write_fours(places, at, &block);
            at += 4;
        }
        let MemoryInLanes { point, force, moment, press } = *memory;
        let block = L::rows_of_4([point.x, point.y, point.z, force.x]);
        self.write_fours(places, width, &block);
        let block = L::rows_of_4([force.y, force.z, press, press]);
        self.write_fours(places, width + 4, &block);
        // Written one by one: callgrind does not know all instructions that compilers use for columns of zeros.
        let (moment, press) = (moment.store(), press.store());
        for (lane, &place) in places.iter().enumerate() {
            let row = &mut self.work.state[place * stride..][..stride];
            let rest = row.last_chunk_mut().expect("a patch follows");
            *rest = [moment[0][lane], moment[1][lane], moment[2][lane], press[lane], 0.0];
        }
    }

    /// Writes four values to the rows of some contacts.
    #[inline(always)]
    fn write_fours<R: Row>(&mut self, places: &[usize], at: usize, fours: &[R; WIDTH]) {
        let stride = self.law.stride;
        for (&place, four) in places.iter().zip(fours) {
            let row = &mut self.work.state[place * stride..][..stride];
            four.write(row[at..].first_chunk_mut().expect("a patch follows"));
        }
    }

    /// Adds the forces, moments and losses of a window's contacts to their bodies, in the order of the list. Losses of
    /// contacts that have separated come in between.
    #[inline(always)]
    fn sum_window(&mut self, first: usize, count: usize, window: &Window) {
        let Window { forces, torques, parts, wall_work } = window;
        let first_facet = self.particles.first_facet();
        for (place, lane) in (first..first + count).zip(0..) {
            self.add_separated_before(place);
            let (pair, force) = (self.work.pairs[place], forces[lane]);
            self.work.forces[place] = force.first_three().into();
            add(&mut self.sums.force, pair.b.index(), force);
            add(&mut self.sums.force, pair.a.index(), force.opposite());
            add(&mut self.sums.torque, pair.b.index(), torques[lane][0]);
            add(&mut self.sums.torque, pair.a.index(), torques[lane][1]);
            for slot in [pair.b, pair.a] {
                self.sums.add_parts(slot.index(), parts[lane]);
            }
            if pair.b.index() >= first_facet {
                let [lost, rubbed] = [force[3], torques[lane][0][3]];
                self.note_on_wall(place, wall_work[lane], lost, rubbed);
                if self.particles.facets.any_torque {
                    self.sums.at_walls.push(torques[lane][1].first_three().into());
                }
            }
        }
    }

    /// Motion of the bodies of a pair, with the present and the last normal.
    fn motion(&self, pair: Pair, normals: [&Vec3; 2]) -> Motion {
        // The work of walls is recorded under every law.
        if self.law.needs.velocity || pair.b.index() >= self.particles.first_facet() {
            Motion::of(pair, self.particles, self.dt, normals)
        } else {
            Motion::none(pair, self.particles)
        }
    }

    /// Finds the forces of a contact with a patch, of the window that begins at `first`.
    #[inline(never)]
    fn on_patch(&mut self, place: usize, first: usize, window: &mut Window) {
        let Self { law, particles, dt, .. } = *self;
        let pair = self.work.pairs[place];
        let place_before =
            if self.work.from.is_empty() { place } else { self.work.from[place].index() };
        let last = self.work.last.geometry.get(place_before).copied().unwrap_or_default();
        let Geometry { normal, overlap } = self.work.geometry[place];
        let constants = match self.work.shares.get(place) {
            Some(&share) => law.of_shares(pair, particles, share).of_law,
            None => law.constants(pair, particles),
        };
        let motion = self.motion(pair, [&normal, &last.normal]);

        let (mut room, mut wide) = ([0.0; MOST_STATE], [0.0; MOST_STATE_OF_MOMENTS]);
        let state = if M::MOMENTS { &mut wide[..law.width] } else { &mut room[..law.width] };
        let mut before = Memory::default();
        if last.touched() {
            let remembered = &self.work.last.state[place_before * law.stride..][..law.stride];
            state.copy_from_slice(&remembered[..law.width]);
            before = Memory::read(&remembered[law.width..]);
        }
        let last_turning = law.model.turning(&constants, last.overlap);
        let last_action = law.model.last(&constants, last.overlap, state);
        let stored_before = Stored::of(
            [0.0, last_action.stored[1] + before.stored(&last_turning)],
            law.model.turned(&constants, last.overlap, state),
        );
        let turning = law.model.turning(&constants, overlap);
        let last_viscous = if law.needs.tangential_dashpots {
            before.in_plane(&last.normal) - vector(last_action.rub)
        } else {
            Vec3::zeros()
        };
        let Acting { force, moment, memory, of_model, viscous, sticks, stored } = self.acting(
            place,
            &constants,
            [&last_turning, &turning],
            (&last, &before, &last_viscous),
            &motion,
            state,
        );

        let point = self.work.points[place];
        let half = 0.5 * dt;
        let mut lost = Losses::none();
        if law.needs.velocity && dt > 0.0 {
            let of_last = if M::MOMENTS { vector(last_action.moment) } else { Vec3::zeros() };
            let damps = sticks && law.needs.tangential_dashpots;
            let powers = before
                .powers(&last.normal, &of_last, damps.then_some(last_viscous), (&motion, 1))
                .and(memory.powers(&normal, &of_model, damps.then_some(viscous), (&motion, 0)));
            let turning = law.model.turned(&constants, overlap, state);
            let stored = Stored::of([0.0, stored], turning);
            lost = powers.balance([stored_before, stored], half, [u8::MAX; 2]);
        }
        let row = &mut self.work.state[place * law.stride..][..law.stride];
        row[..law.width].copy_from_slice(state);
        memory.write(&mut row[law.width..]);

        let with_wall = pair.b.index() >= particles.first_facet();
        let share_of = |energy| if with_wall { energy } else { 0.5 * energy };
        let (share, rubbed) = (share_of(lost.all), share_of(lost.of_friction));
        let arm_b = point - motion.r[0];
        let on_b = arm_b.cross(&force) + moment;
        let on_a = force.cross(&point) - moment;
        let lane = place - first;
        window.forces[lane] = [force.x, force.y, force.z, share];
        window.torques[lane] = [[on_b.x, on_b.y, on_b.z, rubbed], [on_a.x, on_a.y, on_a.z, rubbed]];
        window.parts[lane] = lost.parts.map(share_of);
        if with_wall {
            let last_force = before.total_force(&last.normal);
            let on_wall = motion.work_on_b(&last_force, &before.moment, &before.point, 1, half)
                + motion.work_on_b(&force, &moment, &point, 0, half);
            window.wall_work[lane] = -on_wall;
        }
    }

    /// Forces and moments of a contact. `state` holds the model's values of the last step on entry and those for the next
    /// step on return.
    fn acting(
        &self,
        place: usize,
        constants: &M::Constants<f64>,
        [last_turning, turning]: [&Turning; 2],
        (last, before, last_viscous): (&Geometry, &Memory, &Vec3),
        motion: &Motion,
        state: &mut [f64],
    ) -> Acting {
        let Self { law, dt, .. } = *self;
        let Geometry { normal, overlap } = self.work.geometry[place];
        let (point, patch) = (self.work.points[place], &self.work.patches[place]);
        let at_point = motion.at(&point, 0);
        let velocity = at_point + motion.midway(dt);
        let approach = velocity.dot(&normal);
        let sliding = velocity - normal * approach;
        let spin = motion.spin[0] + motion.spin[1];
        let contact = Contact {
            normal: triple(&normal),
            last_normal: triple(&last.normal),
            overlap,
            last_overlap: last.overlap,
            gain: patch.gain,
            approach,
            sliding: triple(&sliding),
            foreseen: triple(&(at_point + motion.ahead(&point))),
            last_viscous: triple(last_viscous),
            twist: 0.5 * dt * spin.dot(&normal),
            turning: triple(&motion.turning()),
            touched: u8::from(last.touched()),
            extended: law.is_extended(self.work.pairs[place], self.particles),
            torsion: 0.0,
            dt,
            begun: 0,
            lasted: dt,
            ends: 0,
            left: 1.0,
        }
        .timed(0.0);
        let twisting = motion.turning();
        let kept = last_turning.kept(turning);
        let mean = if last.touched() { mean_while_growing(1.0 - kept) } else { 1.0 };
        let lever = patch.mean_distance(&normal);
        let speed = lever * twisting.dot(&normal);
        let torsion = Torsion::of(turning, before.torsion * kept, speed, mean * contact.lasted);
        let contact = Contact { torsion: torsion.force, ..contact };
        let now = law.model.act(constants, &contact, state);
        let rub = vector(now.rub);
        let elastic = law.model.elastic(constants, overlap);

        let torsion = torsion.within(turning, &now.kept, dt);
        let rocking = normal.cross(&patch.times(&normal.cross(&twisting)));
        let mut moment =
            normal * (lever * torsion.force) - rocking * (turning.normal_dashpot * patch.gain);
        let of_model = if M::MOMENTS { vector(now.moment) } else { Vec3::zeros() };
        if M::MOMENTS {
            moment += of_model;
        }
        let memory = Memory {
            point,
            force: normal * (now.press - elastic * patch.gain) + rub,
            moment,
            press: now.press,
            torsion: torsion.stretch,
        };
        Acting {
            force: normal * now.press + rub,
            moment: moment + patch.lever * elastic,
            memory,
            of_model,
            viscous: vector(now.viscous),
            sticks: now.kept.force >= 1.0,
            stored: now.stored[1] + memory.stored(turning),
        }
    }

    /// Adds the loss of a separated contact. Its force is zero now; its stored energy counts as dissipated.
    #[cold]
    pub(super) fn add_separated_with_patches(&mut self, separated: Separated) {
        let Self { law, particles, dt, .. } = *self;
        let half = 0.5 * dt;
        let last = &self.work.last;
        let (pair, geometry) = (last.pairs[separated.place], &last.geometry[separated.place]);
        let remembered = &last.state[separated.place * law.stride..][..law.stride];
        let (state, memory) = remembered.split_at(law.width);
        let memory = Memory::read(memory);
        let motion = self.motion(pair, [&geometry.normal; 2]);
        let mut lost = Losses::none();
        if law.needs.velocity && half > 0.0 {
            let constants = law.constants(pair, particles);
            let last = law.model.last(&constants, geometry.overlap, state);
            let of_torsion = memory.stored(&law.model.turning(&constants, geometry.overlap));
            let of_model = if M::MOMENTS { vector(last.moment) } else { Vec3::zeros() };
            let stored = Stored::of(
                [0.0, last.stored[1] + of_torsion],
                law.model.turned(&constants, geometry.overlap, state),
            );
            let powers = memory.powers(&geometry.normal, &of_model, None, (&motion, 1));
            lost = powers.balance([stored, Stored::none()], half, [u8::MAX; 2]);
        }
        // The force has fallen to zero: only the half of the last step counts.
        if pair.b.index() >= particles.first_facet() {
            let force = memory.total_force(&geometry.normal);
            let on_wall = motion.work_on_b(&force, &memory.moment, &memory.point, 1, half);
            self.note_parting(pair, memory.point, -on_wall, &lost);
        }
        self.sums.lose(pair, lost, particles.first_facet());
    }
}

/// Spring and dashpot of torsion about the normal.
struct Torsion {
    /// Force of A on B, the moment over the mean distance [N].
    force: f64,
    /// Viscous part [N].
    viscous: f64,
    /// Stretch [m].
    stretch: f64,
}

impl Torsion {
    /// Force before any limit, from the remaining stretch `left` [m] and a speed [m/s] that has acted for `lasted` [s].
    fn of(turning: &Turning, left: f64, speed: f64, lasted: f64) -> Self {
        let Turning { tangential_stiffness, tangential_dashpot, friction, .. } = *turning;
        if tangential_stiffness <= 0.0 || friction <= 0.0 {
            return Self { force: 0.0, viscous: 0.0, stretch: 0.0 };
        }
        let stretch = left + speed * lasted;
        let viscous = tangential_dashpot * speed;
        Self { force: tangential_stiffness * stretch + viscous, viscous, stretch }
    }

    /// Force and stretch within Coulomb's limit, with the factor of contacts that end, see [`super::within_limit`].
    fn within(self, turning: &Turning, kept: &Kept<f64>, dt: f64) -> Self {
        let Kept { torsion: kept, remains, .. } = *kept;
        let Self { force, viscous, stretch } = self;
        // No time has passed at the start of a stage, so the spring stays unchanged.
        let stretch = if kept < 1.0 && dt > 0.0 {
            (force * kept - viscous) / turning.tangential_stiffness
        } else {
            stretch
        };
        Self { force: force * kept * remains, viscous, stretch: stretch * remains }
    }
}

/// Rows at eight places.
#[inline(always)]
fn rows_of<'a, T>(all: &'a [T], at: &[usize; WIDTH]) -> [&'a T; WIDTH] {
    let mut rows = [&all[at[0]]; WIDTH];
    for (row, &at) in rows.iter_mut().zip(at) {
        *row = &all[at];
    }
    rows
}

fn triple(v: &Vec3) -> Triple<f64> {
    Triple { x: v.x, y: v.y, z: v.z }
}
