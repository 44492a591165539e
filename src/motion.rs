//! Integration: the leapfrog of the paper, with its global damping.
//!
//! Velocities and angular momenta stand half a step behind positions and attitudes. With damping `ξ`
//! (a force `-ξ m v` and a moment `-ξ I ω`; Lim and Andrade 2014, DOI 10.1002/nag.2203)
//!
//! `v⁺ = ((1 - ξ dt/2) v⁻ + dt F/m) / (1 + ξ dt/2)`, `x⁺ = x + dt v⁺`,
//!
//! and the same for the angular momentum `L` with the moment: in world axes the damping moment is
//! `-ξ L`, so free bodies keep `L` to the last bit. The attitude turns by the angular velocity at
//! mid-step, `ω = R I⁻¹ Rᵀ L⁺`, where `R` is the attitude half-way, found by two sweeps of the
//! implicit midpoint rule. A turn is the quaternion `(1, dt ω/2)`, normalised (Cayley's form): no
//! sine, the same bits on every machine. All is second order in `dt`.

use crate::math::{Mat3, Quat, Vec3};
use crate::particles::Particles;
use nalgebra::Quaternion;

/// What acts on every particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Gravity [m/s²].
    pub gravity: Vec3,
    /// Global damping ξ [1/s].
    pub damping: f64,
}

/// Advances all owned particles by a step of `dt` [s], from the forces at their positions.
pub fn kick_and_drift(particles: &mut Particles, field: &Field, dt: f64) {
    let slower = 1.0 - 0.5 * field.damping * dt;
    let faster = 1.0 / (1.0 + 0.5 * field.damping * dt);
    for slot in 0..particles.owned {
        let mass = particles.mass(slot);
        let force = particles.force[slot] + field.gravity * mass;
        let before = particles.velocity[slot];
        let after = (before * slower + force * (dt / mass)) * faster;
        particles.velocity[slot] = after;
        particles.position[slot] += after * dt;
        particles.travel[slot] += after.norm() * dt;
        if field.damping > 0.0 {
            // With the mean velocity this is exact: the change of kinetic energy is (F v - ξ m v²) dt.
            let mean = (before + after) * 0.5;
            particles.dissipated[slot] += field.damping * dt * mass * mean.norm_squared();
        }
    }
    wrap(particles);
    if particles.spin.is_some() {
        turn(particles, slower, faster, field.damping, dt);
    }
}

/// Moves the walls by a step of `dt` [s].
pub fn move_walls(particles: &mut Particles, dt: f64) {
    for wall in &mut particles.walls {
        wall.point += wall.velocity * dt;
    }
    particles.refresh_walls();
}

/// Brings particles that have left through a periodic face back in through the other. In every
/// step, so that a position never depends on when the pairs were listed.
fn wrap(particles: &mut Particles) {
    if !particles.needs.image {
        return;
    }
    for slot in 0..particles.owned {
        for axis in 0..3 {
            let period = particles.period[axis];
            if !period.is_finite() {
                continue;
            }
            let low = particles.low[axis];
            let x = &mut particles.position[slot][axis];
            if *x >= low + period {
                *x -= period;
                particles.image[slot][axis] += 1;
            } else if *x < low {
                *x += period;
                particles.image[slot][axis] -= 1;
            }
        }
    }
}

/// Kicks the angular momenta and turns the attitudes.
fn turn(particles: &mut Particles, slower: f64, faster: f64, damping: f64, dt: f64) {
    let Particles { spin: Some(spin), attitude, library, shape, dissipated, travel, owned, .. } =
        particles
    else {
        return;
    };
    for slot in 0..*owned {
        let inertia = &library.inertia[shape[slot].index()];
        let before = spin.angular_momentum[slot];
        let momentum = (before * slower + spin.torque[slot] * dt) * faster;
        spin.angular_momentum[slot] = momentum;
        let mean_spin;
        if let Some(attitude) = attitude {
            let start = attitude.quaternion[slot];
            let mut frame = start.to_rotation_matrix().into_inner();
            let mut angular_velocity = spin_of(&frame, inertia, &momentum);
            for _ in 0..2 {
                let halfway = turned(&start, &angular_velocity, 0.5 * dt);
                frame = halfway.to_rotation_matrix().into_inner();
                angular_velocity = spin_of(&frame, inertia, &momentum);
            }
            mean_spin = angular_velocity;
            let end = turned(&start, &angular_velocity, dt);
            frame = attitude.set(slot, end, &library.shapes[shape[slot].index()]);
            spin.angular_velocity[slot] = spin_of(&frame, inertia, &momentum);
            // Cayley's turn is smaller than the angle ω dt.
            travel[slot] += library.radius[shape[slot].index()] * (angular_velocity.norm() * dt);
        } else {
            mean_spin = momentum / inertia.x;
            spin.angular_velocity[slot] = mean_spin;
        }
        if damping > 0.0 {
            let mean_momentum = (before + momentum) * 0.5;
            let ratio = mean_momentum.norm_squared() / momentum.norm_squared();
            if ratio.is_finite() {
                dissipated[slot] += damping * dt * mean_spin.dot(&momentum) * ratio;
            }
        }
    }
}

/// `R I⁻¹ Rᵀ L`.
#[inline]
fn spin_of(frame: &Mat3, inertia: &Vec3, momentum: &Vec3) -> Vec3 {
    frame * frame.tr_mul(momentum).component_div(inertia)
}

/// The attitude after turning for `dt` at a constant angular velocity in world axes.
#[inline]
fn turned(start: &Quat, angular_velocity: &Vec3, dt: f64) -> Quat {
    let half = angular_velocity * (0.5 * dt);
    Quat::new_normalize(Quaternion::new(1.0, half.x, half.y, half.z) * start.quaternion())
}
