//! What velocities are foreseen to gain until the time of the positions.
//!
//! Forces belong to positions, and velocities are those of half a step `h` before them. A dashpot that feels these is of first
//! order. What a velocity gains until then, `h a`, is foreseen from the steps before, with less weight the longer ago:
//!
//! `e' = (1 - w) e + w h a`, `w = 2/3`.
//!
//! In a steady motion `e` is `h a`; otherwise it is that of `(2 - w)/w` half steps ago, so a dashpot is of second order. With `w = 1`
//! steps would have to be shorter in packings: what changes its sign in every step is foreseen with `w/(2 - w)` of it too much, which
//! is 1/2 here. What the own force of a contact adds to `e` the contact knows better, see `law::kernel::dashpots`.

use super::{Field, Kick};
use crate::math::Vec3;
use crate::particles::Particles;

/// Weight of the last step.
const WEIGHT: f64 = 2.0 / 3.0;

/// Foresees what velocities gain, before the first kick of a step of `dt` [s]. Of particles that are held it is nothing.
pub fn foresee(particles: &mut Particles, field: &Field, dt: f64) {
    let kick = Kick::first(field, dt);
    for slot in 0..particles.owned {
        if particles.is_held(slot) {
            continue;
        }
        let [mut gain, mut turning] = particles.ahead_of(slot);
        let (before, mass) = (particles.velocity[slot], particles.mass(slot));
        let after = kick.after(&before, &field.force(particles, slot), mass);
        gain = gain * (1.0 - WEIGHT) + (after - before) * WEIGHT;
        particles.ahead.velocity[slot] = gain;
        if let Some(spin) = &particles.spin {
            turning *= 1.0 - WEIGHT;
            // Of spheres angular velocities are kicked; of others they are those of half a step before until the next turn.
            turning += if particles.needs.orientation {
                spin.angular_velocity[slot] * (-0.5 * WEIGHT)
            } else {
                let before = spin.angular_velocity[slot];
                let inertia = particles.inertia(slot).x;
                (kick.after(&before, &spin.torque[slot].vector, inertia) - before) * WEIGHT
            };
            particles.ahead.angular_velocity[slot] = turning;
        }
    }
}

/// The rest of [`foresee`], after the turn of the step.
pub fn foresee_turns(particles: &mut Particles) {
    if !particles.needs.orientation {
        return;
    }
    for slot in 0..particles.owned {
        if particles.is_held(slot) {
            continue;
        }
        let Some(spin) = &particles.spin else { return };
        let turning: &mut Vec3 = &mut particles.ahead.angular_velocity[slot];
        *turning += spin.angular_velocity[slot] * (0.5 * WEIGHT);
    }
}
