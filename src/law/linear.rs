//! Linear springs (Cundall and Strack 1979, DOI 10.1680/geot.1979.29.1.47): the paper's law.
//!
//! Normal: `N = k_n δ + γ_n δ̇`, by default never attractive. Tangential: `T = k_t ξ + γ_t ξ̇` with a spring `ξ` in the contact
//! plane that is carried along when the pair turns and grows with the sliding velocity. Beyond Coulomb's limit `T` is cut
//! to `μ N`, and the spring to `ξ = (T - γ_t ξ̇) / k_t`, so that spring and dashpot together make up the limit and nothing
//! jumps where sliding begins or ends (Luding 2008, DOI 10.1007/s10035-008-0099-x, section 2.4). Choose it where stiffness
//! only has to be high enough; the contact time then does not depend on the velocity, so one time step serves a whole run.
//!
//! With the central differences of [`crate::motion`], the work of a force between two steps is the mean of its
//! values at both times the displacement. What a contact dissipates is that work minus the change of
//! its elastic energy, from the step before the first touch to the step after the last: of the normal force where it has a
//! dashpot, of the tangential force where there is friction. The others dissipate nothing, so that what a long step makes of
//! them is missing from the energy balance, and is reported. Where there is neither friction nor dashpot, the velocities of
//! ghosts need not be known.
//!
//! Contacts go eight at once.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::{Constants, ForceLaw, Interactions, Parted, Sums, Work, add};
use crate::contact::{History, Pair, Place, nearest_images, vectors};
use crate::ids::{MaterialId, Slot};
use crate::lanes::{self, Eight, Kernel, Lanes, Triple, WIDTH, row};
use crate::math::Vec3;
use crate::particles::{Library, Needs, Particles};

/// The linear spring and dashpot with Coulomb friction.
#[derive(Clone, Debug)]
pub struct Linear {
    interactions: Interactions,
    limit_damping: bool,
    /// Constants of every pair of shapes, walls included; none if there are too many.
    table: Vec<Row>,
    /// How many shapes the table has.
    shapes: usize,
    /// Is there any dashpot?
    damped: bool,
}

/// A table of more shapes would not stay in the cache.
const MOST_SHAPES: usize = 128;

impl Linear {
    /// With these constants, between bodies of a library; if `limit_damping`, no dashpot makes a contact attractive.
    pub fn new(interactions: Interactions, limit_damping: bool, library: &Library) -> Self {
        let damped = interactions
            .iter()
            .any(|c| c.normal_damping_ratio > 0.0 || c.tangential_damping_ratio > 0.0);
        let mut law = Self { interactions, limit_damping, table: Vec::new(), shapes: 0, damped };
        let shapes = library.shapes.len();
        if shapes <= MOST_SHAPES {
            let all = (0..shapes).flat_map(|a| (0..shapes).map(move |b| (a, b)));
            law.table = all.map(|(a, b)| law.row(a, b, library)).collect();
            law.shapes = shapes;
        }
        law
    }

    /// Of the materials of a pair.
    #[inline]
    fn constants(&self, pair: Pair, particles: &Particles) -> &Constants {
        self.interactions.of(particles.material(pair.a), particles.material(pair.b))
    }

    /// Of two shapes, from the table if they are in it.
    #[inline(always)]
    fn row_of(&self, (a, b): (usize, usize), particles: &Particles) -> Row {
        match self.table.get(a * self.shapes + b) {
            Some(row) => *row,
            None => self.row(a, b, &particles.library),
        }
    }

    /// Normal and tangential dashpot of a pair [N s/m].
    fn dashpots(&self, pair: Pair, particles: &Particles) -> [f64; 2] {
        let [a, b] = [pair.a, pair.b].map(|slot| particles.shape[slot.index()].index());
        self.row_of((a, b), particles).dashpots
    }

    /// Of two shapes; the second may be a wall.
    #[inline(never)]
    fn row(&self, a: usize, b: usize, library: &Library) -> Row {
        let constants = self.interactions.of(library.materials[a], library.materials[b]);
        let Constants { normal_stiffness, tangential_stiffness, friction, .. } = *constants;
        let mass = reduced_mass(library, a, b);
        Row {
            normal: normal_stiffness,
            tangential: tangential_stiffness,
            friction,
            dashpots: [
                dashpot(constants.normal_damping_ratio, mass, normal_stiffness),
                dashpot(constants.tangential_damping_ratio, mass, tangential_stiffness),
            ],
            radii: [a, b].map(|shape| {
                let radius = library.radius[shape];
                if radius.is_finite() { radius } else { 0.0 }
            }),
            is_damped: constants.normal_damping_ratio > 0.0,
            is_frictional: constants.is_frictional(),
        }
    }
}

/// The constants of a contact between two shapes.
#[derive(Clone, Copy, Debug)]
struct Row {
    /// Normal stiffness [N/m].
    normal: f64,
    /// Tangential stiffness [N/m].
    tangential: f64,
    /// Coefficient of friction [-].
    friction: f64,
    /// Normal and tangential dashpot [N s/m].
    dashpots: [f64; 2],
    /// Bounding radii of both; 0 of a wall, which does not turn [m].
    radii: [f64; 2],
    /// Is there a normal dashpot?
    is_damped: bool,
    /// Does it feel tangential motion?
    is_frictional: bool,
}

/// Elastic energy of a contact in its normal and its tangential spring [J].
fn stored(constants: &Constants, overlap: f64, spring: &Vec3) -> [f64; 2] {
    [
        0.5 * constants.normal_stiffness * overlap * overlap,
        0.5 * constants.tangential_stiffness * spring.norm_squared(),
    ]
}

/// Contacts whose forces are to be found.
struct Contacts<'a, 'b> {
    law: &'a Linear,
    work: &'a mut Work<'b>,
    particles: &'a Particles,
    dt: f64,
    sums: &'a mut Sums,
    /// Is there anything that dissipates?
    lossy: bool,
    /// Of those that have parted, how many have been summed.
    summed: usize,
}

impl Kernel for Contacts<'_, '_> {
    #[inline(always)]
    fn run<L: Eight>(mut self) {
        for first in (0..self.work.pairs.len()).step_by(WIDTH) {
            self.eight::<L>(first);
        }
        self.part_before(usize::MAX);
    }
}

/// What is remembered of a contact that did not touch.
static NEW: History = History { normal: Vec3::new(0.0, 0.0, 0.0), overlap: 0.0 };

impl Contacts<'_, '_> {
    /// Up to eight contacts; the other lanes repeat the last.
    #[inline(always)]
    fn eight<L: Eight>(&mut self, first: usize) {
        let Self { law, particles, dt, lossy, .. } = *self;
        let work = &*self.work;
        let damped = law.damped;
        let count = (work.pairs.len() - first).min(WIDTH);
        let pairs = eight_from(work.pairs, first, count);
        let places = eight_from(work.from, first, count);
        let (mut a, mut b) = ([Slot(0); WIDTH], [Slot(0); WIDTH]);
        for lane in 0..WIDTH {
            (a[lane], b[lane]) = (pairs[lane].a, pairs[lane].b);
        }
        // As a rule all of them touched at the last step, one after the other: then they stand there as they do here.
        let start = places[0].index();
        let mut as_before = true;
        for (lane, place) in places.iter().enumerate() {
            as_before &= place.index() == start + lane;
        }
        let springs = Springs::<L>::of(law, &pairs, particles);
        let (normal, overlap) = read::<L>(&rows_from(work.history, first, count));
        let has_points = !work.points.is_empty();
        let point = if has_points {
            triple::<L>(&rows_from(work.points, first, count))
        } else {
            normal.times(springs.radii[0] - L::all(0.5) * overlap)
        };
        let last_rows = if as_before {
            rows_from(work.last.history, start, WIDTH)
        } else {
            rows_at(work.last.history, &places, &NEW)
        };
        let (last_normal, last_overlap) = read::<L>(&last_rows);
        let last_normal_force = if damped && as_before {
            L::load(&eight_from(work.last.normal_forces, start, WIDTH))
        } else if damped {
            let mut forces = [0.0; WIDTH];
            for (force, place) in forces.iter_mut().zip(places) {
                *force = *at(work.last.normal_forces, place, &0.0);
            }
            L::load(&forces)
        } else {
            springs.normal * last_overlap
        };
        let has_springs = !work.springs.is_empty();
        let mut last_spring = Triple::zero();
        if has_springs {
            let rows = if as_before {
                rows_from(work.last.springs, start, WIDTH)
            } else {
                rows_at(work.last.springs, &places, &NEW.normal)
            };
            last_spring = triple(&rows);
        }

        // velocity of A's surface against B's: positive along the normal is approach
        let position = &particles.position;
        let to_b = vectors::<L>(position, &b).minus(vectors(position, &a));
        let to_b = nearest_images(to_b, &particles.period);
        let (of_a, spin_a) = velocities::<L>(particles, &a);
        let (of_b, spin_b) = velocities::<L>(particles, &b);
        let bodies = Moving { approach: of_a.minus(of_b), spin_a, spin_b };
        let arm_b = point.minus(to_b);
        let velocity = bodies.surfaces(point, arm_b);
        let approach = velocity.dot(normal);
        let twist = L::all(0.5 * dt) * spin_a.plus(spin_b).dot(normal);
        // The same where the last force acted. Of bodies other than spheres that place is not remembered.
        let last_velocity = if has_points {
            velocity
        } else {
            let half = L::all(0.5) * last_overlap;
            let arm_a = last_normal.times(springs.radii[0] - half);
            bodies.surfaces(arm_a, last_normal.times(half - springs.radii[1]))
        };

        // before, and now
        let last_press = last_normal.times(last_normal_force);
        let last_rub = last_spring.times(springs.tangential);
        let normal_force = springs.press(overlap, approach, law.limit_damping);
        let press = normal.times(normal_force);
        let mut rub = Triple::zero();
        let mut spring = Triple::zero();
        // What the tangential force of the last touch had and is not remembered: as much as now.
        let mut dashpot = Triple::zero();
        if springs.frictional != 0 {
            let zero = Triple::zero();
            // Where the normal turns right round, centres have passed each other: nothing can be carried.
            let kept = L::all(-1.0 + 1e-8).less(last_normal.dot(normal));
            let touched = L::all(0.0).less(last_normal.dot(last_normal));
            let carried = carried(last_spring, last_normal, normal, twist).or(zero, kept & touched);
            let sliding = velocity.minus(normal.times(approach));
            let (friction, stretched) =
                springs.rub(normal_force, carried.plus(sliding.times(L::all(dt))), sliding);
            // At the start of a stage no time has passed: a spring stays as it was.
            let now = if dt > 0.0 { stretched } else { carried };
            spring = now.or(zero, springs.frictional);
            rub = friction.or(zero, springs.frictional);
            dashpot = rub.minus(spring.times(springs.tangential)).or(zero, touched);
        }
        let force = press.plus(rub);

        let half_step = L::all(0.5 * dt);
        let zero = L::all(0.0);
        let stored = springs.stored(overlap, spring);
        let stored_before = springs.stored(last_overlap, last_spring);
        let pressed = last_press.dot(last_velocity) + press.dot(velocity);
        let rubbed = last_rub.dot(last_velocity) + rub.plus(dashpot).dot(velocity);
        let of_dashpots = half_step * pressed - (stored[0] - stored_before[0]);
        let of_friction = half_step * rubbed - (stored[1] - stored_before[1]);
        let dissipated =
            of_dashpots.or(zero, springs.damped) + of_friction.or(zero, springs.frictional);
        let dissipated = if lossy && dt > 0.0 { dissipated } else { zero };
        let impulse = last_press.plus(last_rub).plus(force).plus(dashpot).times(half_step);

        let (back, on_a, on_b) =
            (Triple::zero().minus(force), force.cross(point), arm_b.cross(force));
        let (forces, backs) = (force.rows(dissipated), back.rows(zero));
        let (on_a, on_b) = (on_a.rows(zero), on_b.rows(zero));
        let states = spring.rows(normal_force);
        let impulse = impulse.store();
        for lane in 0..count {
            let place = first + lane;
            self.part_before(place);
            let [x, y, z, normal_force] = states[lane];
            if damped {
                self.work.normal_forces[place] = normal_force;
            }
            if has_springs {
                self.work.springs[place] = Vec3::new(x, y, z);
            }
            let [x, y, z, lost] = forces[lane];
            self.work.forces[place] = Vec3::new(x, y, z);
            let pair = pairs[lane];
            let (a, b) = (pair.a.index(), pair.b.index());
            add(&mut self.sums.force, a, &backs[lane]);
            add(&mut self.sums.torque, a, &on_a[lane]);
            add(&mut self.sums.force, b, &forces[lane]);
            add(&mut self.sums.torque, b, &on_b[lane]);
            if lossy {
                self.sums.lose(pair, lost, particles.first_wall());
            }
            if b >= particles.first_wall() {
                let of_wall = &particles.velocity[b];
                let impulse = Vec3::from(row(&impulse, lane));
                self.sums.note_wall_work(pair, -impulse.dot(of_wall));
            }
        }
    }

    /// Sums what the contacts lost that have come apart and stand before this one.
    #[inline(always)]
    fn part_before(&mut self, place: usize) {
        while let Some(parted) = self.work.parted.get(self.summed)
            && parted.before <= place
        {
            self.part(*parted);
            self.summed += 1;
        }
    }

    /// No force is left, but what the last contact lost.
    #[cold]
    fn part(&mut self, parted: Parted) {
        let Self { law, particles, dt, lossy, .. } = *self;
        let last = &self.work.last;
        let bodies = particles.bodies();
        let (pair, history) = (last.pairs[parted.place], &last.history[parted.place]);
        let spring = last.springs.get(parted.place).copied().unwrap_or_default();
        // Where the last force acted: in the middle of the overlap of the farthest points along the last normal.
        let frames = bodies.frames(pair);
        let (body, other) = bodies.posed(pair, &frames);
        let into = history.normal * (0.5 * history.overlap);
        let arm_a = body.support(&history.normal) - into;
        let with_wall = pair.b.index() >= particles.first_wall();
        let arm_b = if with_wall { Vec3::zeros() } else { other.support(&-history.normal) + into };
        let velocity = surface_velocity(particles, pair, &arm_a, &arm_b);
        let constants = law.constants(pair, particles);
        let elastic = constants.normal_stiffness * history.overlap;
        let normal_force = last.normal_forces.get(parted.place).copied().unwrap_or(elastic);
        let press = history.normal * normal_force;
        let mut rub = spring * constants.tangential_stiffness;
        if constants.is_frictional() {
            let sliding = velocity - history.normal * velocity.dot(&history.normal);
            rub += sliding * law.dashpots(pair, particles)[1];
        }
        // The force fell to nothing on the way: half of it did the work.
        let work = |force: &Vec3, velocity: &Vec3| 0.5 * dt * force.dot(velocity);
        if with_wall {
            let of_wall = &particles.velocity[pair.b.index()];
            self.sums.note_wall_work(pair, -work(&(press + rub), of_wall));
        }
        let stored = stored(constants, history.overlap, &spring);
        let mut dissipated = 0.0;
        if lossy && dt > 0.0 {
            if constants.normal_damping_ratio > 0.0 {
                dissipated += work(&press, &velocity) + stored[0];
            }
            if constants.is_frictional() {
                dissipated += work(&rub, &velocity) + stored[1];
            }
        }
        self.sums.lose(pair, dissipated, particles.first_wall());
    }
}

/// What stands at a place, or what stands for those that have none.
#[inline(always)]
fn at<'a, T>(all: &'a [T], place: Place, otherwise: &'a T) -> &'a T {
    match all.get(place.index()) {
        Some(one) => one,
        None => otherwise,
    }
}

/// The same of eight.
#[inline(always)]
fn rows_at<'a, T>(all: &'a [T], places: &[Place; WIDTH], otherwise: &'a T) -> [&'a T; WIDTH] {
    let mut rows = [otherwise; WIDTH];
    for (row, place) in rows.iter_mut().zip(places) {
        *row = at(all, *place, otherwise);
    }
    rows
}

/// Those from a place on; if there are less than eight, the last one again.
#[inline(always)]
fn rows_from<T>(all: &[T], first: usize, count: usize) -> [&T; WIDTH] {
    let mut rows = [&all[first]; WIDTH];
    if let Some(eight) = all[first..].first_chunk::<WIDTH>() {
        for (row, one) in rows.iter_mut().zip(eight) {
            *row = one;
        }
    } else {
        for (lane, row) in rows.iter_mut().enumerate() {
            *row = &all[first + lane.min(count - 1)];
        }
    }
    rows
}

/// The same, copied.
#[inline(always)]
fn eight_from<T: Copy>(all: &[T], first: usize, count: usize) -> [T; WIDTH] {
    if let Some(eight) = all[first..].first_chunk::<WIDTH>() {
        return *eight;
    }
    let mut eight = [all[first]; WIDTH];
    for (lane, one) in eight.iter_mut().enumerate() {
        *one = all[first + lane.min(count - 1)];
    }
    eight
}

/// Vectors.
#[inline(always)]
fn triple<L: Eight>(vectors: &[&Vec3; WIDTH]) -> Triple<L> {
    let mut rows = [vectors[0].as_ref(); WIDTH];
    for (row, vector) in rows.iter_mut().zip(vectors) {
        *row = vector.as_ref();
    }
    Triple::of(&rows)
}

/// Normals and overlaps.
#[inline(always)]
fn read<L: Eight>(histories: &[&History; WIDTH]) -> (Triple<L>, L) {
    let mut rows: [&[f64; 4]; WIDTH] = [bytemuck::cast_ref(histories[0]); WIDTH];
    for (row, history) in rows.iter_mut().zip(histories) {
        *row = bytemuck::cast_ref(*history);
    }
    let [x, y, z, overlap] = L::columns_of_4(&rows);
    (Triple { x, y, z }, overlap)
}

/// Springs, dashpots and friction of contacts.
struct Springs<L> {
    /// Normal stiffness [N/m].
    normal: L,
    /// Tangential stiffness [N/m].
    tangential: L,
    /// Coefficient of friction [-].
    friction: L,
    /// Normal and tangential dashpots [N s/m], if there are any.
    dashpots: Option<[L; 2]>,
    /// Bounding radii of A and B; 0 of walls [m].
    radii: [L; 2],
    /// Which of them have a normal dashpot.
    damped: u8,
    /// Which of them feel tangential motion.
    frictional: u8,
}

impl<L: Eight> Springs<L> {
    #[inline(always)]
    fn of(law: &Linear, pairs: &[Pair; WIDTH], particles: &Particles) -> Self {
        let mut shapes = [(0, 0); WIDTH];
        let mut alike = true;
        for (of_pair, pair) in shapes.iter_mut().zip(pairs) {
            let a = particles.shape[pair.a.index()].index();
            *of_pair = (a, particles.shape[pair.b.index()].index());
        }
        for of_pair in shapes {
            alike &= of_pair == shapes[0];
        }
        if alike {
            Self::of_one(&law.row_of(shapes[0], particles), law.damped)
        } else {
            Self::of_each(law, &shapes, particles)
        }
    }

    /// As most are: eight times the same.
    #[inline(always)]
    fn of_one(row: &Row, damped: bool) -> Self {
        Self {
            normal: L::all(row.normal),
            tangential: L::all(row.tangential),
            friction: L::all(row.friction),
            dashpots: if damped {
                Some([L::all(row.dashpots[0]), L::all(row.dashpots[1])])
            } else {
                None
            },
            radii: [L::all(row.radii[0]), L::all(row.radii[1])],
            damped: if row.is_damped { u8::MAX } else { 0 },
            frictional: if row.is_frictional { u8::MAX } else { 0 },
        }
    }

    #[inline(always)]
    fn of_each(law: &Linear, shapes: &[(usize, usize); WIDTH], particles: &Particles) -> Self {
        let (mut normal, mut tangential) = ([0.0; WIDTH], [0.0; WIDTH]);
        let mut friction = [0.0; WIDTH];
        let (mut dashpots, mut radii) = ([[0.0; WIDTH]; 2], [[0.0; WIDTH]; 2]);
        let (mut damped, mut frictional) = (0, 0);
        for (lane, of_pair) in shapes.iter().enumerate() {
            let row = law.row_of(*of_pair, particles);
            normal[lane] = row.normal;
            tangential[lane] = row.tangential;
            friction[lane] = row.friction;
            damped |= u8::from(row.is_damped) << lane;
            frictional |= u8::from(row.is_frictional) << lane;
            for body in 0..2 {
                dashpots[body][lane] = row.dashpots[body];
                radii[body][lane] = row.radii[body];
            }
        }
        Self {
            normal: L::load(&normal),
            tangential: L::load(&tangential),
            friction: L::load(&friction),
            dashpots: if law.damped {
                Some([L::load(&dashpots[0]), L::load(&dashpots[1])])
            } else {
                None
            },
            radii: [L::load(&radii[0]), L::load(&radii[1])],
            damped,
            frictional,
        }
    }
}

impl<L: Lanes> Springs<L> {
    /// Spring and dashpot along the normal [N].
    #[inline(always)]
    fn press(&self, overlap: L, approach: L, limited: bool) -> L {
        let mut force = self.normal * overlap;
        if let Some([dashpot, _]) = self.dashpots {
            force = force + dashpot * approach;
            if limited {
                let zero = L::all(0.0);
                force = zero.or(force, force.less(zero));
            }
        }
        force
    }

    /// Spring, dashpot and friction in the contact plane: the tangential force of A on B [N], and the spring [m]. Where
    /// they exceed Coulomb's limit the force is cut to it, and the spring to what the dashpot leaves of it.
    #[inline(always)]
    fn rub(
        &self,
        normal_force: L,
        spring: Triple<L>,
        sliding: Triple<L>,
    ) -> (Triple<L>, Triple<L>) {
        let zero = L::all(0.0);
        let mut force = spring.times(self.tangential);
        if let Some([_, dashpot]) = self.dashpots {
            force = force.plus(sliding.times(dashpot));
        }
        let limit = self.friction * normal_force.or(zero, zero.less(normal_force));
        let size = force.dot(force).sqrt();
        let slides = limit.less(size);
        let limited = force.times(limit / size);
        let mut elastic = limited;
        if let Some([_, dashpot]) = self.dashpots {
            elastic = elastic.minus(sliding.times(dashpot));
        }
        let stretched = elastic.over(self.tangential);
        let stretched = stretched.or(Triple::zero(), zero.less(self.tangential));
        (limited.or(force, slides), stretched.or(spring, slides))
    }

    /// Elastic energy in the normal and the tangential spring [J].
    #[inline(always)]
    fn stored(&self, overlap: L, spring: Triple<L>) -> [L; 2] {
        let half = L::all(0.5);
        [half * self.normal * overlap * overlap, half * self.tangential * spring.dot(spring)]
    }
}

/// Turns a spring from the plane of `old` into the plane of `new` by the shortest rotation (Rodrigues' formula
/// without angles), and by `twist` about the normal [rad].
#[inline(always)]
fn carried<L: Lanes>(spring: Triple<L>, old: Triple<L>, new: Triple<L>, twist: L) -> Triple<L> {
    let one = L::all(1.0);
    let carried = spring.minus(old.plus(new).times(spring.dot(new) / (one + old.dot(new))));
    let turned = carried.plus(new.cross(carried).times(twist));
    turned.over((one + twist * twist).sqrt())
}

/// How two bodies move. (No closure in its place: it would be compiled without vector registers.)
#[derive(Clone, Copy)]
struct Moving<L> {
    /// Velocity of A's centre against B's [m/s].
    approach: Triple<L>,
    /// Angular velocities [rad/s].
    spin_a: Triple<L>,
    spin_b: Triple<L>,
}

impl<L: Lanes> Moving<L> {
    /// Velocity of A's surface against B's, at these places from their centres [m/s].
    #[inline(always)]
    fn surfaces(self, arm_a: Triple<L>, arm_b: Triple<L>) -> Triple<L> {
        self.approach.plus(self.spin_a.cross(arm_a)).minus(self.spin_b.cross(arm_b))
    }
}

/// Velocities of the centres of bodies [m/s], and angular velocities [rad/s].
#[inline(always)]
fn velocities<L: Eight>(particles: &Particles, slots: &[Slot; WIDTH]) -> (Triple<L>, Triple<L>) {
    let velocity = vectors::<L>(&particles.velocity, slots);
    let Some(spin) = &particles.spin else { return (velocity, Triple::zero()) };
    (velocity, vectors::<L>(&spin.angular_velocity, slots))
}

/// Velocity of A's surface against B's: positive along the normal is approach [m/s].
#[inline]
fn surface_velocity(particles: &Particles, pair: Pair, arm_a: &Vec3, arm_b: &Vec3) -> Vec3 {
    // A wall does not turn, and its arm is as long as the plane is wide.
    let of_b = if pair.b.index() >= particles.first_wall() {
        particles.velocity[pair.b.index()]
    } else {
        particles.velocity_at(pair.b, arm_b)
    };
    particles.velocity_at(pair.a, arm_a) - of_b
}

/// Force over velocity of a dashpot with this part of critical damping [N s/m].
#[inline]
fn dashpot(ratio: f64, mass: f64, stiffness: f64) -> f64 {
    2.0 * ratio * (mass * stiffness).sqrt()
}

/// `m_A m_B / (m_A + m_B)`, or `m_A` against a wall [kg].
#[inline]
fn reduced_mass(library: &Library, a: usize, b: usize) -> f64 {
    let mass_a = library.mass[a];
    if b >= library.particle_shapes {
        return mass_a;
    }
    let mass_b = library.mass[b];
    mass_a * mass_b / (mass_a + mass_b)
}

impl ForceLaw for Linear {
    fn name(&self) -> &'static str {
        "linear"
    }

    fn needs(&self) -> Needs {
        let friction = self.interactions.iter().any(Constants::is_frictional);
        let dashpot = self.interactions.iter().any(|c| c.normal_damping_ratio > 0.0);
        Needs {
            velocity: friction || dashpot,
            spin: friction,
            springs: friction,
            dashpots: self.damped,
            ..Needs::default()
        }
    }

    fn apply(&self, work: &mut Work, particles: &Particles, dt: f64, sums: &mut Sums) {
        let lossy = self.needs().velocity;
        lanes::dispatch(Contacts { law: self, work, particles, dt, sums, lossy, summed: 0 });
    }

    fn elastic(&self, pair: Pair, particles: &Particles, overlap: f64) -> f64 {
        self.constants(pair, particles).normal_stiffness * overlap
    }

    fn stiffness(&self, pair: Pair, particles: &Particles, dt: f64) -> f64 {
        let constants = self.constants(pair, particles);
        let stiffness = constants.normal_stiffness;
        stiffness + self.dashpots(pair, particles)[0] / dt
    }

    fn stored(&self, a: MaterialId, b: MaterialId, overlap: f64, spring: &Vec3) -> f64 {
        stored(self.interactions.of(a, b), overlap, spring).iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::{Contacts, Linear};
    use crate::contact::{History, Pair, Place};
    use crate::ids::Slot;
    use crate::lanes::{self, Kernel, Portable};
    use crate::law::{Constants, Interactions, Last, Sums, Work};
    use crate::math::Vec3;
    use crate::particles::{Particles, crowd};
    use crate::random::Random;

    /// What touches, and what is remembered.
    #[derive(Clone, Default)]
    struct Touching {
        pairs: Vec<Pair>,
        now: Vec<History>,
        points: Vec<Vec3>,
        from: Vec<Place>,
        history: Vec<History>,
        springs: Vec<Vec3>,
        normal_forces: Vec<f64>,
    }

    /// What a law finds.
    struct Found {
        springs: Vec<Vec3>,
        normal_forces: Vec<f64>,
        forces: Vec<Vec3>,
        sums: Sums,
    }

    impl Touching {
        fn of(&self, place: usize) -> Self {
            Self {
                pairs: vec![self.pairs[place]],
                now: vec![self.now[place]],
                points: self.points.get(place).copied().into_iter().collect(),
                from: vec![self.from[place]],
                ..self.clone()
            }
        }

        fn apply(&self, law: &Linear, particles: &Particles, run: impl Fn(Contacts)) -> Found {
            let count = self.pairs.len();
            let zeros = vec![Vec3::zeros(); particles.owned];
            let mut found = Found {
                springs: vec![Vec3::zeros(); count],
                normal_forces: vec![0.0; count],
                forces: vec![Vec3::zeros(); count],
                sums: Sums {
                    force: zeros.clone(),
                    torque: zeros,
                    dissipated: vec![0.0; particles.owned],
                    wall_work: Vec::new(),
                },
            };
            let mut work = Work {
                pairs: &self.pairs,
                history: &self.now,
                points: &self.points,
                from: &self.from,
                last: Last {
                    pairs: &self.pairs,
                    history: &self.history,
                    springs: &self.springs,
                    normal_forces: &self.normal_forces,
                },
                parted: &[],
                springs: &mut found.springs,
                normal_forces: &mut found.normal_forces,
                forces: &mut found.forces,
            };
            run(Contacts {
                law,
                work: &mut work,
                particles,
                dt: 1e-5,
                sums: &mut found.sums,
                lossy: true,
                summed: 0,
            });
            found
        }
    }

    impl Found {
        fn bits(&self, place: usize) -> Vec<u64> {
            let vectors = [&self.forces[place], &self.springs[place]];
            let numbers = vectors.into_iter().flatten().chain([&self.normal_forces[place]]);
            numbers.map(|x| x.to_bits()).collect()
        }

        fn bits_of_sums(&self) -> Vec<u64> {
            let Sums { force, torque, dissipated, .. } = &self.sums;
            let vectors = force.iter().chain(torque).flatten();
            vectors.chain(dissipated).map(|x| x.to_bits()).collect()
        }
    }

    /// With and without vector registers and in any company: sliding and sticking, with and without friction, for the
    /// first time and again.
    #[test]
    fn lanes_give_the_same_bits_everywhere() {
        let particles = crowd(40);
        let rough = Constants {
            normal_stiffness: 1e3,
            tangential_stiffness: 800.0,
            friction: 0.3,
            ..Constants::default()
        };
        let smooth = Constants { friction: 0.0, ..rough };
        let damped =
            Constants { normal_damping_ratio: 0.2, tangential_damping_ratio: 0.1, ..rough };
        let mut random = Random::of(5, 0);
        let mut vector = |size: f64| Vec3::from_fn(|_, _| size * random.signed());
        let mut touching = Touching::default();
        for k in 0..39 {
            touching.pairs.push(Pair { a: Slot(k), b: Slot(k + 1) });
            let normal = vector(1.0).normalize();
            touching.now.push(History { normal, overlap: 1e-5 });
            touching.points.push(vector(1e-3));
            if k % 5 == 0 {
                touching.from.push(Place::NONE);
                continue;
            }
            touching.from.push(Place::among(touching.history.len()));
            let last = (normal + vector(1e-3)).normalize();
            touching.history.push(History { normal: last, overlap: 9e-6 });
            touching.normal_forces.push(9e-3);
            let across = vector(5e-6 * f64::from(k % 3));
            touching.springs.push(across - last * across.dot(&last));
        }
        for (name, mixed, own, all_balls) in [
            ("plain", smooth, rough, false),
            ("damped", smooth, damped, false),
            ("balls", smooth, rough, true),
        ] {
            let mut interactions = Interactions::new(&[]);
            interactions.materials = 2;
            interactions.constants = vec![own, mixed, mixed, rough];
            let law = Linear::new(interactions, true, &particles.library);
            let mut before = touching.clone();
            if all_balls {
                before.points.clear();
            }
            for (pair, place) in before.pairs.iter().zip(&before.from) {
                if !law.constants(*pair, &particles).is_frictional()
                    && let Some(spring) = before.springs.get_mut(place.index())
                {
                    *spring = Vec3::zeros();
                }
            }
            let dispatched = before.apply(&law, &particles, |c| lanes::dispatch(c));
            let portable = before.apply(&law, &particles, |c| c.run::<Portable>());
            assert_eq!(dispatched.bits_of_sums(), portable.bits_of_sums(), "{name}");
            for place in 0..before.pairs.len() {
                let bits = dispatched.bits(place);
                assert_eq!(bits, portable.bits(place), "{name}, pair {place}");
                let alone = before.of(place).apply(&law, &particles, |c| lanes::dispatch(c));
                assert_eq!(bits, alone.bits(0), "{name}, pair {place} alone");
            }
        }
    }
}
