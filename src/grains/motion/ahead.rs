//! Foreseen gains of velocities until the time of the positions.
//!
//! Forces belong to positions, and velocities are those of half a step `h` before them. Damping forces from these velocities are of first order.
//! The gain of a velocity until then, `h a`, is foreseen from previous steps, with decreasing weight:
//!
//! `e' = (1 - w) e + w h a`, `w = 0.7`.
//!
//! In a steady motion `e` is `h a`. In others it lags by `1/w` steps, so damping is of second order. With `w = 1`, packings would need shorter
//! steps: for a velocity that changes its sign in every step `e` is `w/(2 - w)`, here 0.54. A contact has a more accurate value of its own part
//! of `e`, see `law::kernel::dashpots`.

use super::{Field, Kick};
use crate::particles::Particles;

/// Weight of the last step.
const WEIGHT: f64 = 0.7;

/// Updates the foreseen gains of velocities before the first kick of a step of `dt` [s]. They stay zero for held particles.
pub fn foresee(particles: &mut Particles, field: &Field, dt: f64) {
    let kick = Kick::first(field, dt);
    let any_held = particles.library.held_shapes > 0;
    let mut gains = std::mem::take(&mut particles.ahead);
    for (slot, gain) in gains.velocity[..particles.owned].iter_mut().enumerate() {
        if !(any_held && particles.is_held(slot)) {
            let (before, mass) = (particles.velocity[slot], particles.mass(slot));
            let after = kick.after(&before, &field.beside(&particles.force[slot], mass), mass);
            *gain = *gain * (1.0 - WEIGHT) + (after - before) * WEIGHT;
        }
    }
    if let Some(spin) = &particles.spin {
        for (slot, gain) in gains.angular_velocity[..particles.owned].iter_mut().enumerate() {
            if !(any_held && particles.is_held(slot)) {
                let before = particles.angular_momentum(slot);
                let after = kick.after(&before, &spin.torque[slot].vector, 1.0);
                let mut kicked = after - before;
                if particles.needs.orientation {
                    // Euler's torque: angular velocities of bodies other than spheres change without a moment.
                    let turning = particles.angular_velocity_for(slot, &before);
                    kicked -= turning.cross(&before) * kick.half;
                }
                let turned = particles.angular_velocity_for(slot, &kicked);
                *gain = *gain * (1.0 - WEIGHT) + turned * WEIGHT;
            }
        }
    }
    particles.ahead = gains;
}
