//! Linear springs (Cundall and Strack 1979, DOI 10.1680/geot.1979.29.1.47): the paper's law.
//!
//! Normal: `N = k_n δ + γ_n δ̇`, by default never attractive. Tangential: a spring `ξ` in the contact plane
//! that is carried along when the pair turns, grows with the sliding velocity and is cut at
//! Coulomb's limit. Choose it where stiffness only has to be high enough; the contact time then does not
//! depend on the velocity, so one time step serves a whole run.
//!
//! With the leapfrog of [`crate::motion`], the work of a force between two steps is the mean of its
//! values at both times the displacement. What a contact dissipates is that work minus the change of
//! its elastic energy, from the step before the first touch to the step after the last.

use super::{Constants, ForceLaw, Interactions, Load, Memory, WallWork};
use crate::contact::{History, Pair, Touch};
use crate::ids::MaterialId;
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
}

/// Two surfaces at their contact point.
struct Meeting<'a> {
    constants: &'a Constants,
    /// Reduced mass of the pair [kg].
    mass: f64,
    normal: Vec3,
    /// Of A's surface against B's [m/s].
    velocity: Vec3,
    /// Its part along the normal [m/s].
    approach: f64,
    /// Turn of the pair about the normal in this step [rad].
    twist: f64,
    dt: f64,
}

impl Meeting<'_> {
    /// Spring and dashpot along the normal; brings `history` up to date.
    #[inline]
    fn press(&self, overlap: f64, limited: bool, history: &mut History) {
        let stiffness = self.constants.normal_stiffness;
        let mut force = stiffness * overlap;
        let ratio = self.constants.normal_damping_ratio;
        if ratio > 0.0 {
            force += 2.0 * ratio * (self.mass * stiffness).sqrt() * self.approach;
            if limited && force < 0.0 {
                force = 0.0;
            }
        }
        history.overlap = overlap;
        history.normal_force = force;
    }

    /// Spring, dashpot and friction in the contact plane: the tangential force of A on B [N]; brings
    /// `spring` up to date. `history` has this step's normal force and the last step's normal.
    #[inline]
    fn rub(&self, history: &History, spring: &mut Vec3) -> Vec3 {
        let stiffness = self.constants.tangential_stiffness;
        let before = if history.touched() {
            let carried = carried(spring, &history.normal, &self.normal);
            let turned = carried + self.normal.cross(&carried) * self.twist;
            turned / (1.0 + self.twist * self.twist).sqrt()
        } else {
            Vec3::zeros()
        };
        let sliding = self.velocity - self.normal * self.approach;
        *spring = before + sliding * self.dt;
        let mut force = *spring * stiffness;
        let ratio = self.constants.tangential_damping_ratio;
        if ratio > 0.0 {
            force += sliding * (2.0 * ratio * (self.mass * stiffness).sqrt());
        }
        let pressure = if history.normal_force > 0.0 { history.normal_force } else { 0.0 };
        let limit = self.constants.friction * pressure;
        let size = force.norm();
        if size > limit {
            force *= limit / size;
            *spring = if stiffness > 0.0 { force / stiffness } else { Vec3::zeros() };
        }
        force
    }
}

/// Turns a vector of the plane of `old` into the plane of `new` by the shortest rotation (Rodrigues'
/// formula without angles).
#[inline]
fn carried(spring: &Vec3, old: &Vec3, new: &Vec3) -> Vec3 {
    spring - (old + new) * (spring.dot(new) / (1.0 + old.dot(new)))
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

/// The force of A on B at the last touch, dashpots in the contact plane left out [N].
#[inline]
fn last_force(history: &History, spring: &Vec3, constants: &Constants) -> Vec3 {
    history.normal * history.normal_force + spring * constants.tangential_stiffness
}

/// Elastic energy of a contact [J].
#[inline]
fn stored(constants: &Constants, overlap: f64, spring: &Vec3) -> f64 {
    0.5 * constants.normal_stiffness * overlap * overlap
        + 0.5 * constants.tangential_stiffness * spring.norm_squared()
}

/// Takes note of what a wall gives to the particle that presses on it [J]; most stand still.
#[inline]
fn note_wall_work(pair: Pair, energy: f64, wall_work: &mut Vec<WallWork>) {
    if energy != 0.0 {
        wall_work.push(WallWork { pair, energy });
    }
}

/// Sum of the angular velocities of two bodies, twice the mean [rad/s].
#[inline]
fn both_spins(particles: &Particles, pair: Pair) -> Vec3 {
    particles.spin.as_ref().map_or_else(Vec3::zeros, |spin| {
        spin.angular_velocity[pair.a.index()] + spin.angular_velocity[pair.b.index()]
    })
}

/// `m_A m_B / (m_A + m_B)`, or `m_A` against a wall [kg].
#[inline]
fn reduced_mass(particles: &Particles, pair: Pair, with_wall: bool) -> f64 {
    let mass_a = particles.mass(pair.a.index());
    if with_wall {
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
            ..Needs::default()
        }
    }

    fn apply(
        &self,
        touches: Vec<Touch>,
        memory: &mut Memory,
        particles: &Particles,
        dt: f64,
        wall_work: &mut Vec<WallWork>,
    ) -> Vec<Load> {
        let bodies = particles.bodies();
        let first_wall = particles.first_wall();
        let load = |(place, touch): (usize, Touch)| {
            let pair = memory.pair(place);
            let spring = memory.spring(place);
            let history = &mut memory.history[place];
            let with_wall = pair.b.index() >= first_wall;

            let arm_a = touch.point;
            let arm_b = touch.point - bodies.relative(pair);
            let velocity = surface_velocity(particles, pair, &arm_a, &arm_b);
            let meeting = Meeting {
                constants: self
                    .interactions
                    .of(particles.material(pair.a), particles.material(pair.b)),
                mass: reduced_mass(particles, pair, with_wall),
                normal: touch.normal,
                velocity,
                approach: velocity.dot(&touch.normal),
                twist: 0.5 * dt * both_spins(particles, pair).dot(&touch.normal),
                dt,
            };
            let constants = meeting.constants;
            let before = last_force(history, &spring, constants);
            let stored_before = stored(constants, history.overlap, &spring);
            meeting.press(touch.overlap, self.limit_damping, history);
            let mut force = touch.normal * history.normal_force;
            let mut stored_now = stored(constants, touch.overlap, &Vec3::zeros());
            // What the force of the last step has and is not remembered: as much as now.
            let mut dashpot = Vec3::zeros();
            if constants.is_frictional() {
                let spring = &mut memory.springs[place];
                let friction = meeting.rub(history, spring);
                force += friction;
                stored_now = stored(constants, touch.overlap, spring);
                dashpot = friction - *spring * constants.tangential_stiffness;
            }
            history.normal = touch.normal;

            let impulse = (before + force + dashpot) * (0.5 * dt);
            if with_wall {
                let energy = -impulse.dot(&particles.velocity[pair.b.index()]);
                note_wall_work(pair, energy, wall_work);
            }
            let dissipated = impulse.dot(&velocity) - (stored_now - stored_before);
            Load { force, point: touch.point, dissipated: if dt > 0.0 { dissipated } else { 0.0 } }
        };
        touches.into_iter().enumerate().map(load).collect()
    }

    fn part(
        &self,
        memory: &Memory,
        particles: &Particles,
        dt: f64,
        loads: &mut Vec<Load>,
        wall_work: &mut Vec<WallWork>,
    ) {
        let bodies = particles.bodies();
        for place in loads.len()..memory.pairs.len() {
            let (pair, history, spring) =
                (memory.pair(place), &memory.history[place], memory.spring(place));
            // Where the surfaces were nearest: A's farthest point along the last normal.
            let frames = bodies.frames(pair);
            let (body, _) = bodies.posed(pair, &frames);
            let arm_a = body.support(&history.normal);
            let arm_b = arm_a - bodies.relative(pair);
            let velocity = surface_velocity(particles, pair, &arm_a, &arm_b);
            let (of_a, of_b) = (particles.material(pair.a), particles.material(pair.b));
            let force = last_force(history, &spring, self.interactions.of(of_a, of_b));
            // The force fell to nothing on the way: half of it did the work.
            let work = |velocity: &Vec3| 0.5 * dt * force.dot(velocity);
            if pair.b.index() >= particles.first_wall() {
                note_wall_work(pair, -work(&particles.velocity[pair.b.index()]), wall_work);
            }
            let dissipated = work(&velocity) + self.stored(of_a, of_b, history.overlap, &spring);
            let dissipated = if dt > 0.0 { dissipated } else { 0.0 };
            loads.push(Load { dissipated, ..Load::default() });
        }
    }

    fn stiffness(&self, pair: Pair, particles: &Particles, dt: f64) -> f64 {
        let constants =
            self.interactions.of(particles.material(pair.a), particles.material(pair.b));
        let stiffness = constants.normal_stiffness;
        let mass = reduced_mass(particles, pair, pair.b.index() >= particles.first_wall());
        stiffness + 2.0 * constants.normal_damping_ratio * (mass * stiffness).sqrt() / dt
    }

    fn stored(&self, a: MaterialId, b: MaterialId, overlap: f64, spring: &Vec3) -> f64 {
        stored(self.interactions.of(a, b), overlap, spring)
    }
}
