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

use super::{ForceLaw, Interactions, Load};
use crate::contact::{Contact, History, Pair};
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

/// Turns a vector of the plane of `old` into the plane of `new` by the shortest rotation (Rodrigues'
/// formula without angles).
#[inline]
fn carried(spring: &Vec3, old: &Vec3, new: &Vec3) -> Vec3 {
    spring - (old + new) * (spring.dot(new) / (1.0 + old.dot(new)))
}

/// Velocity of A's surface against B's: positive along the normal is approach.
#[inline]
fn sliding_velocity(particles: &Particles, pair: Pair, arm_a: &Vec3, arm_b: &Vec3) -> Vec3 {
    // A wall does not turn, and its arm is as long as the plane is wide.
    let of_b = if pair.b.index() >= particles.first_wall() {
        particles.velocity[pair.b.index()]
    } else {
        particles.velocity_at(pair.b, arm_b)
    };
    particles.velocity_at(pair.a, arm_a) - of_b
}

impl ForceLaw for Linear {
    fn name(&self) -> &'static str {
        "linear"
    }

    fn needs(&self) -> Needs {
        let friction = self.interactions.iter().any(super::Constants::is_frictional);
        let dashpot = self.interactions.iter().any(|c| c.normal_damping_ratio > 0.0);
        Needs { velocity: friction || dashpot, spin: friction, ..Needs::default() }
    }

    fn apply(
        &self,
        contacts: &[Contact],
        pairs: &[Pair],
        history: &mut [History],
        particles: &Particles,
        dt: f64,
        loads: &mut Vec<Load>,
    ) {
        let bodies = particles.bodies();
        let first_wall = particles.first_wall();
        for contact in contacts {
            let pair = pairs[contact.pair as usize];
            let history = &mut history[contact.pair as usize];
            let touch = &contact.touch;
            let normal = touch.normal;
            let is_wall = pair.b.index() >= first_wall;

            let arm_a = touch.point;
            let arm_b = touch.point - bodies.relative(pair);
            let velocity = sliding_velocity(particles, pair, &arm_a, &arm_b);
            let approach = velocity.dot(&normal);

            let constants =
                self.interactions.of(particles.material(pair.a), particles.material(pair.b));
            let mass = {
                let mass_a = particles.mass(pair.a.index());
                if is_wall {
                    mass_a
                } else {
                    let mass_b = particles.mass(pair.b.index());
                    mass_a * mass_b / (mass_a + mass_b)
                }
            };

            let mut normal_force = constants.normal_stiffness * touch.overlap;
            if constants.normal_damping_ratio > 0.0 {
                let dashpot = 2.0
                    * constants.normal_damping_ratio
                    * (mass * constants.normal_stiffness).sqrt();
                normal_force += dashpot * approach;
                if self.limit_damping && normal_force < 0.0 {
                    normal_force = 0.0;
                }
            }
            let work = 0.5 * (history.normal_force + normal_force) * (approach * dt);
            let stored = 0.5
                * constants.normal_stiffness
                * (touch.overlap * touch.overlap - history.overlap * history.overlap);
            let mut dissipated = work - stored;
            history.overlap = touch.overlap;
            history.normal_force = normal_force;

            let mut force = normal * normal_force;
            if constants.is_frictional() {
                let mut spring = history.spring;
                if history.touched() {
                    spring = carried(&spring, &history.normal, &normal);
                    if let Some(spin) = &particles.spin {
                        let twist = 0.5
                            * dt
                            * (spin.angular_velocity[pair.a.index()]
                                + spin.angular_velocity[pair.b.index()])
                            .dot(&normal);
                        spring =
                            (spring + normal.cross(&spring) * twist) / (1.0 + twist * twist).sqrt();
                    }
                }
                let before = spring;
                let sliding = velocity - normal * approach;
                spring += sliding * dt;
                let mut tangential = spring * constants.tangential_stiffness;
                if constants.tangential_damping_ratio > 0.0 {
                    let dashpot = 2.0
                        * constants.tangential_damping_ratio
                        * (mass * constants.tangential_stiffness).sqrt();
                    tangential += sliding * dashpot;
                }
                let pressure = if normal_force > 0.0 { normal_force } else { 0.0 };
                let limit = constants.friction * pressure;
                let size = tangential.norm();
                if size > limit {
                    tangential *= limit / size;
                    spring = if constants.tangential_stiffness > 0.0 {
                        tangential / constants.tangential_stiffness
                    } else {
                        Vec3::zeros()
                    };
                }
                let work = (before * constants.tangential_stiffness + tangential).dot(&sliding)
                    * (0.5 * dt);
                let stored = 0.5
                    * constants.tangential_stiffness
                    * (spring.norm_squared() - before.norm_squared());
                dissipated += work - stored;
                history.spring = spring;
                force += tangential;
            }
            history.normal = normal;

            let received =
                if is_wall { -force.dot(&particles.velocity[pair.b.index()]) * dt } else { 0.0 };
            loads.push(Load {
                force,
                normal_force,
                torque_a: -arm_a.cross(&force),
                torque_b: arm_b.cross(&force),
                dissipated: if dt > 0.0 { dissipated } else { 0.0 },
                received,
            });
        }
    }

    fn part(
        &self,
        parted: &[u32],
        pairs: &[Pair],
        history: &[History],
        particles: &Particles,
        dt: f64,
        loads: &mut Vec<Load>,
    ) {
        let bodies = particles.bodies();
        for &pair in parted {
            let history = &history[pair as usize];
            let pair = pairs[pair as usize];
            // Where the surfaces were nearest: A's farthest point along the last normal.
            let arm_a = bodies.posed(pair.a).support(&history.normal);
            let arm_b = arm_a - bodies.relative(pair);
            let velocity = sliding_velocity(particles, pair, &arm_a, &arm_b);
            let (of_a, of_b) = (particles.material(pair.a), particles.material(pair.b));
            let stiffness = self.interactions.of(of_a, of_b).tangential_stiffness;
            let force = history.normal * history.normal_force + history.spring * stiffness;
            // The force fell to nothing on the way: half of it did the work.
            let work = 0.5 * dt * force.dot(&velocity);
            let dissipated = work + self.stored(of_a, of_b, history);
            loads.push(Load {
                dissipated: if dt > 0.0 { dissipated } else { 0.0 },
                ..Load::default()
            });
        }
    }

    fn stored(&self, a: MaterialId, b: MaterialId, history: &History) -> f64 {
        let constants = self.interactions.of(a, b);
        0.5 * constants.normal_stiffness * history.overlap * history.overlap
            + 0.5 * constants.tangential_stiffness * history.spring.norm_squared()
    }
}
