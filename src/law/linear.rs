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

use super::{Constants, ForceLaw, Interactions, Load, Memory, WallWork};
use crate::contact::{History, Pair, nearest_images, vectors, vectors_at};
use crate::ids::{MaterialId, Slot};
use crate::lanes::{self, Eight, Kernel, Lanes, Triple, WIDTH, row};
use crate::math::Vec3;
use crate::particles::{Needs, Particles};

/// The linear spring and dashpot with Coulomb friction.
#[derive(Clone, Debug)]
pub struct Linear {
    interactions: Interactions,
    limit_damping: bool,
}

impl Linear {
    /// With these constants; if `limit_damping`, no dashpot makes a contact attractive.
    pub const fn new(interactions: Interactions, limit_damping: bool) -> Self {
        Self { interactions, limit_damping }
    }

    /// Of the materials of a pair.
    #[inline]
    fn constants(&self, pair: Pair, particles: &Particles) -> &Constants {
        self.interactions.of(particles.material(pair.a), particles.material(pair.b))
    }

    fn has_dashpots(&self) -> bool {
        self.interactions
            .iter()
            .any(|c| c.normal_damping_ratio > 0.0 || c.tangential_damping_ratio > 0.0)
    }
}

/// Elastic energy of a contact in its normal and its tangential spring [J].
fn stored(constants: &Constants, overlap: f64, spring: &Vec3) -> [f64; 2] {
    [
        0.5 * constants.normal_stiffness * overlap * overlap,
        0.5 * constants.tangential_stiffness * spring.norm_squared(),
    ]
}

/// Contacts whose loads are to be found.
struct Contacts<'a, 'b> {
    law: &'a Linear,
    loads: &'a mut [Load],
    memory: &'a mut Memory<'b>,
    particles: &'a Particles,
    dt: f64,
    wall_work: &'a mut Vec<WallWork>,
    /// Is there any dashpot?
    damped: bool,
    /// Is there anything that dissipates?
    lossy: bool,
}

impl Kernel for Contacts<'_, '_> {
    #[inline(always)]
    fn run<L: Eight>(mut self) {
        for first in (0..self.loads.len()).step_by(WIDTH) {
            self.eight::<L>(first);
        }
    }
}

impl Contacts<'_, '_> {
    /// The loads of up to eight contacts; the other lanes repeat the last.
    #[inline(always)]
    fn eight<L: Eight>(&mut self, first: usize) {
        let Self { law, loads, memory, particles, dt, wall_work, damped, lossy } = self;
        let (particles, dt) = (*particles, *dt);
        let count = (loads.len() - first).min(WIDTH);
        let mut places = [first; WIDTH];
        let mut pairs = [memory.pair(first); WIDTH];
        let (mut a, mut b) = ([pairs[0].a; WIDTH], [pairs[0].b; WIDTH]);
        let mut touches = [&loads[first]; WIDTH];
        let mut histories = [&memory.history[first]; WIDTH];
        for lane in 0..WIDTH {
            let place = first + lane.min(count - 1);
            places[lane] = place;
            pairs[lane] = memory.pair(place);
            (a[lane], b[lane]) = (pairs[lane].a, pairs[lane].b);
            touches[lane] = &loads[place];
            histories[lane] = &memory.history[place];
        }
        let springs = Springs::<L>::of(law, &pairs, particles, *damped);
        let (normal, overlap) = read_touches::<L>(&touches);
        let point = if memory.points.is_empty() {
            normal.times(radii::<L>(particles, &a) - L::all(0.5) * overlap)
        } else {
            vectors_at(memory.points, &places)
        };
        let (last_normal, last_overlap) = read_histories::<L>(&histories);
        let last_normal_force = if *damped {
            L::load(&places.map(|place| memory.normal_forces[place]))
        } else {
            springs.normal * last_overlap
        };
        let has_springs = !memory.springs.is_empty();
        let mut last_spring = Triple::zero();
        if has_springs {
            last_spring = vectors_at(memory.springs, &places);
        }

        // velocity of A's surface against B's: positive along the normal is approach
        let position = &particles.position;
        let to_b = vectors::<L>(position, &b).minus(vectors(position, &a));
        let to_b = nearest_images(to_b, &particles.period);
        let (of_a, spin_a) = velocities::<L>(particles, &a);
        let (of_b, spin_b) = velocities::<L>(particles, &b);
        let bodies = Moving { approach: of_a.minus(of_b), spin_a, spin_b };
        let velocity = bodies.surfaces(point, point.minus(to_b));
        let approach = velocity.dot(normal);
        let twist = L::all(0.5 * dt) * spin_a.plus(spin_b).dot(normal);
        // The same where the last force acted. Of bodies other than spheres that place is not remembered.
        let last_velocity = if memory.points.is_empty() {
            let half = L::all(0.5) * last_overlap;
            let arm_a = last_normal.times(radii::<L>(particles, &a) - half);
            bodies.surfaces(arm_a, last_normal.times(half - radii::<L>(particles, &b)))
        } else {
            velocity
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
        let dissipated = if *lossy && dt > 0.0 { dissipated.store() } else { [0.0; WIDTH] };
        let impulse = last_press.plus(last_rub).plus(force).plus(dashpot).times(half_step);

        let (force, spring, normal) = (force.store(), spring.store(), normal.store());
        let (overlap, normal_force) = (overlap.store(), normal_force.store());
        let impulse = impulse.store();
        for lane in 0..count {
            let place = first + lane;
            let history = &mut memory.history[place];
            history.normal = row(&normal, lane).into();
            history.overlap = overlap[lane];
            if *damped {
                memory.normal_forces[place] = normal_force[lane];
            }
            if has_springs {
                memory.springs[place] = row(&spring, lane).into();
            }
            loads[place].force = row(&force, lane).into();
            loads[place].dissipated = dissipated[lane];
            let pair = pairs[lane];
            if pair.b.index() >= particles.first_wall() {
                let of_wall = &particles.velocity[pair.b.index()];
                note_wall_work(pair, -Vec3::from(row(&impulse, lane)).dot(of_wall), wall_work);
            }
        }
    }
}

/// Normals and overlaps of touches that stand in the places of their loads.
#[inline(always)]
fn read_touches<L: Eight>(touches: &[&Load; WIDTH]) -> (Triple<L>, L) {
    let mut normal = [touches[0].force.as_ref(); WIDTH];
    let mut overlap = [0.0; WIDTH];
    for (lane, load) in touches.iter().enumerate() {
        let touch = load.touch();
        (normal[lane], overlap[lane]) = (touch.0.as_ref(), touch.1);
    }
    (Triple::of(&normal), L::load(&overlap))
}

/// Normals and overlaps of the last touches.
#[inline(always)]
fn read_histories<L: Eight>(histories: &[&History; WIDTH]) -> (Triple<L>, L) {
    let mut normal = [histories[0].normal.as_ref(); WIDTH];
    let mut overlap = [0.0; WIDTH];
    for (lane, history) in histories.iter().enumerate() {
        normal[lane] = history.normal.as_ref();
        overlap[lane] = history.overlap;
    }
    (Triple::of(&normal), L::load(&overlap))
}

/// The radii of spheres; 0 of walls, which do not turn [m].
#[inline(always)]
fn radii<L: Eight>(particles: &Particles, slots: &[Slot; WIDTH]) -> L {
    L::load(&slots.map(|slot| {
        let radius = particles.radius(slot.index());
        if radius.is_finite() { radius } else { 0.0 }
    }))
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
    /// Which of them have a normal dashpot.
    damped: u8,
    /// Which of them feel tangential motion.
    frictional: u8,
}

impl<L: Eight> Springs<L> {
    #[inline(always)]
    fn of(law: &Linear, pairs: &[Pair; WIDTH], particles: &Particles, damped: bool) -> Self {
        let (mut normal, mut tangential) = ([0.0; WIDTH], [0.0; WIDTH]);
        let mut friction = [0.0; WIDTH];
        let mut dashpots = [[0.0; WIDTH]; 2];
        let (mut with_dashpot, mut frictional) = (0, 0);
        for (lane, pair) in pairs.iter().enumerate() {
            let constants = law.constants(*pair, particles);
            normal[lane] = constants.normal_stiffness;
            tangential[lane] = constants.tangential_stiffness;
            friction[lane] = constants.friction;
            with_dashpot |= u8::from(constants.normal_damping_ratio > 0.0) << lane;
            frictional |= u8::from(constants.is_frictional()) << lane;
            if damped {
                let mass = reduced_mass(particles, *pair);
                dashpots[0][lane] = dashpot(constants.normal_damping_ratio, mass, normal[lane]);
                dashpots[1][lane] =
                    dashpot(constants.tangential_damping_ratio, mass, tangential[lane]);
            }
        }
        Self {
            normal: L::load(&normal),
            tangential: L::load(&tangential),
            friction: L::load(&friction),
            dashpots: if damped {
                Some([L::load(&dashpots[0]), L::load(&dashpots[1])])
            } else {
                None
            },
            damped: with_dashpot,
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

/// Takes note of what a wall gives to the particle that presses on it [J]; most stand still.
#[inline]
fn note_wall_work(pair: Pair, energy: f64, wall_work: &mut Vec<WallWork>) {
    if energy != 0.0 {
        wall_work.push(WallWork { pair, energy });
    }
}

/// Force over velocity of a dashpot with this part of critical damping [N s/m].
#[inline]
fn dashpot(ratio: f64, mass: f64, stiffness: f64) -> f64 {
    2.0 * ratio * (mass * stiffness).sqrt()
}

/// `m_A m_B / (m_A + m_B)`, or `m_A` against a wall [kg].
#[inline]
fn reduced_mass(particles: &Particles, pair: Pair) -> f64 {
    let mass_a = particles.mass(pair.a.index());
    if pair.b.index() >= particles.first_wall() {
        return mass_a;
    }
    let mass_b = particles.mass(pair.b.index());
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
            dashpots: self.has_dashpots(),
            ..Needs::default()
        }
    }

    fn apply(
        &self,
        loads: &mut [Load],
        memory: &mut Memory,
        particles: &Particles,
        dt: f64,
        wall_work: &mut Vec<WallWork>,
    ) {
        let (damped, lossy) = (self.has_dashpots(), self.needs().velocity);
        lanes::dispatch(Contacts {
            law: self,
            loads,
            memory,
            particles,
            dt,
            wall_work,
            damped,
            lossy,
        });
    }

    fn part(
        &self,
        loads: &mut [Load],
        memory: &Memory,
        particles: &Particles,
        dt: f64,
        wall_work: &mut Vec<WallWork>,
    ) {
        let bodies = particles.bodies();
        let lossy = self.needs().velocity;
        let still = memory.pairs.len() - loads.len();
        for (place, load) in (still..).zip(loads) {
            let (pair, history, spring) =
                (memory.pair(place), &memory.history[place], memory.spring(place));
            // Where the last force acted: in the middle of the overlap of the farthest points along the last normal.
            let frames = bodies.frames(pair);
            let (body, other) = bodies.posed(pair, &frames);
            let into = history.normal * (0.5 * history.overlap);
            let arm_a = body.support(&history.normal) - into;
            let arm_b = if pair.b.index() >= particles.first_wall() {
                Vec3::zeros()
            } else {
                other.support(&-history.normal) + into
            };
            let velocity = surface_velocity(particles, pair, &arm_a, &arm_b);
            let constants = self.constants(pair, particles);
            let normal_force = memory
                .normal_forces
                .get(place)
                .copied()
                .unwrap_or(constants.normal_stiffness * history.overlap);
            let press = history.normal * normal_force;
            let mut rub = spring * constants.tangential_stiffness;
            if constants.is_frictional() {
                let sliding = velocity - history.normal * velocity.dot(&history.normal);
                let mass = reduced_mass(particles, pair);
                let ratio = constants.tangential_damping_ratio;
                rub += sliding * dashpot(ratio, mass, constants.tangential_stiffness);
            }
            // The force fell to nothing on the way: half of it did the work.
            let work = |force: &Vec3, velocity: &Vec3| 0.5 * dt * force.dot(velocity);
            if pair.b.index() >= particles.first_wall() {
                let of_wall = &particles.velocity[pair.b.index()];
                note_wall_work(pair, -work(&(press + rub), of_wall), wall_work);
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
            *load = Load { dissipated, ..Load::default() };
        }
    }

    fn elastic(&self, pair: Pair, particles: &Particles, overlap: f64) -> f64 {
        self.constants(pair, particles).normal_stiffness * overlap
    }

    fn stiffness(&self, pair: Pair, particles: &Particles, dt: f64) -> f64 {
        let constants = self.constants(pair, particles);
        let stiffness = constants.normal_stiffness;
        let mass = reduced_mass(particles, pair);
        stiffness + dashpot(constants.normal_damping_ratio, mass, stiffness) / dt
    }

    fn stored(&self, a: MaterialId, b: MaterialId, overlap: f64, spring: &Vec3) -> f64 {
        stored(self.interactions.of(a, b), overlap, spring).iter().sum()
    }
}

#[cfg(test)]
mod tests {
    use super::{Contacts, Linear};
    use crate::contact::{History, Pair, Touch};
    use crate::ids::Slot;
    use crate::lanes::{self, Kernel, Portable};
    use crate::law::{Constants, Interactions, Load, Memory};
    use crate::math::Vec3;
    use crate::particles::{Particles, crowd};
    use crate::random::Random;

    /// What touches, and what is remembered.
    #[derive(Clone)]
    struct Touching {
        loads: Vec<Load>,
        history: Vec<History>,
        springs: Vec<Vec3>,
        normal_forces: Vec<f64>,
        points: Vec<Vec3>,
    }

    impl Touching {
        fn of(&self, place: usize) -> Self {
            Self {
                loads: vec![self.loads[place]],
                history: vec![self.history[place]],
                springs: vec![self.springs[place]],
                normal_forces: vec![self.normal_forces[place]],
                points: self.points.get(place).copied().into_iter().collect(),
            }
        }

        fn load(
            mut self,
            law: &Linear,
            pairs: &[Pair],
            particles: &Particles,
            run: impl Fn(Contacts),
        ) -> Self {
            let which: Vec<u32> = (0..pairs.len() as u32).collect();
            let mut memory = Memory {
                listed: pairs,
                pairs: &which,
                history: &mut self.history,
                springs: &mut self.springs,
                normal_forces: &mut self.normal_forces,
                points: &self.points,
            };
            run(Contacts {
                lossy: true,
                law,
                loads: &mut self.loads,
                memory: &mut memory,
                particles,
                dt: 1e-5,
                wall_work: &mut Vec::new(),
                damped: law.has_dashpots(),
            });
            self
        }

        fn bits(&self, place: usize) -> Vec<u64> {
            let Load { force, dissipated } = &self.loads[place];
            let History { normal, overlap } = &self.history[place];
            let vectors = [force, normal, &self.springs[place]];
            let scalars = [dissipated, overlap, &self.normal_forces[place]];
            let numbers = vectors.into_iter().flatten().chain(scalars);
            numbers.map(|x| x.to_bits()).collect()
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
        let pairs: Vec<_> = (0..39).map(|k| Pair { a: Slot(k), b: Slot(k + 1) }).collect();
        let mut random = Random::of(5, 0);
        let mut vector = |size: f64| Vec3::from_fn(|_, _| size * random.signed());
        let mut touching = Touching {
            loads: vec![],
            history: vec![],
            springs: vec![],
            normal_forces: vec![],
            points: vec![],
        };
        for k in 0..pairs.len() {
            let normal = vector(1.0).normalize();
            let touch = Touch { overlap: 1e-5, normal, point: vector(1e-3) };
            let last = (normal + vector(1e-3)).normalize();
            let first_time = k % 5 == 0;
            touching.loads.push(Load::of(&touch));
            touching.points.push(touch.point);
            touching.history.push(if first_time {
                History::default()
            } else {
                History { normal: last, overlap: 9e-6 }
            });
            touching.normal_forces.push(if first_time { 0.0 } else { 9e-3 });
            let across = vector(5e-6 * (k % 3) as f64);
            let spring = across - last * across.dot(&last);
            touching.springs.push(if first_time { Vec3::zeros() } else { spring });
        }
        for (name, mixed, own, all_balls) in [
            ("plain", smooth, rough, false),
            ("damped", smooth, damped, false),
            ("balls", smooth, rough, true),
        ] {
            let mut interactions = Interactions::new(&[]);
            interactions.materials = 2;
            interactions.constants = vec![own, mixed, mixed, rough];
            let law = Linear::new(interactions, true);
            let mut before = touching.clone();
            if all_balls {
                before.points.clear();
            }
            for (pair, spring) in pairs.iter().zip(&mut before.springs) {
                if !law.constants(*pair, &particles).is_frictional() {
                    *spring = Vec3::zeros();
                }
            }
            let dispatched = before.clone().load(&law, &pairs, &particles, |c| lanes::dispatch(c));
            let portable = before.clone().load(&law, &pairs, &particles, |c| c.run::<Portable>());
            for (place, pair) in pairs.iter().enumerate() {
                let bits = dispatched.bits(place);
                assert_eq!(bits, portable.bits(place), "{name}, pair {place}");
                let alone =
                    before.of(place).load(&law, &[*pair], &particles, |c| lanes::dispatch(c));
                assert_eq!(bits, alone.bits(0), "{name}, pair {place} alone");
            }
        }
    }
}
