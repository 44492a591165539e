//! Exclusion of held particles from the kicks of the others.

use crate::math::{Quat, Vec3, Vec3AndNumber};
use crate::motion::Field;
use crate::particles::Particles;

/// Saved state of a held particle during a kick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Idle {
    slot: usize,
    force: Vec3AndNumber,
    velocity: Vec3,
    /// Torque, angular momentum and angular velocity.
    spin: Option<(Vec3AndNumber, Option<Vec3>, Vec3)>,
    /// Exact bits, because a kernel normalises quaternions.
    quaternion: Option<Quat>,
}

impl Idle {
    /// Saves the state and sets one that no kick changes: at rest, under a force that balances its
    /// weight.
    pub(super) fn begin(particles: &mut Particles, slot: usize, field: &Field) -> Self {
        let weight = field.gravity * particles.mass(slot);
        let Particles { force, velocity, spin, orientation, .. } = particles;
        Self {
            slot,
            force: std::mem::replace(&mut force[slot], (-weight).into()),
            velocity: std::mem::take(&mut velocity[slot]),
            spin: spin.as_mut().map(|spin| {
                (
                    std::mem::take(&mut spin.torque[slot]),
                    spin.angular_momentum.get_mut(slot).map(std::mem::take),
                    std::mem::take(&mut spin.angular_velocity[slot]),
                )
            }),
            quaternion: orientation.as_ref().map(|all| all.quaternion[slot]),
        }
    }

    /// Restores the state, and returns the slot.
    pub(super) fn end(self, particles: &mut Particles) -> usize {
        let Self { slot, force, velocity, spin, quaternion } = self;
        let scale = particles.scale_of(slot);
        particles.force[slot] = force;
        particles.velocity[slot] = velocity;
        if let (Some(all), Some((torque, momentum, turning))) = (&mut particles.spin, spin) {
            all.torque[slot] = torque;
            all.angular_velocity[slot] = turning;
            if let Some(momentum) = momentum {
                all.angular_momentum[slot] = momentum;
            }
        }
        let Particles { orientation, library, shape, .. } = particles;
        if let (Some(all), Some(quaternion)) = (orientation, quaternion) {
            all.set(slot, quaternion, &library.shapes[shape[slot].index()], scale);
        }
        slot
    }
}

/// Sets the velocities of a held particle to zero.
pub(super) fn stop(particles: &mut Particles, slot: usize) {
    particles.velocity[slot] = Vec3::zeros();
    if let Some(spin) = &mut particles.spin {
        spin.angular_velocity[slot] = Vec3::zeros();
        if let Some(momentum) = spin.angular_momentum.get_mut(slot) {
            *momentum = Vec3::zeros();
        }
    }
}
