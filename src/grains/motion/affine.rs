//! A flow that carries the cell and its bodies (see [`crate::cell`]).
//!
//! Velocities are relative to the flow: `dx/dt = v + L x`, `m dv/dt = F - m L v` (the SLLOD equations; Evans and Morriss 1984,
//! DOI 10.1103/PhysRevA.30.1528). Rotation is not driven. A step of `dt = 2h` applies the first half of `-m L v` before its first kick and the
//! other half, implicitly, after its last. In between the places move with the edges of the cell, so a body with `v = 0` keeps its fraction of
//! each edge. The scheme is of second order in `dt`.
//!
//! The flow's work on the motion, `-m v · L v`, is received energy. So is its work on the contacts, which the simulation counts.

use super::Field;
use crate::cell::upper_inverse;
use crate::math::{Mat3, Vec3};
use crate::particles::Particles;
use crate::particles::columns::Quantity;

/// Moves the cell and the bodies by the flow in a step of `dt` [s], before its first kick.
///
/// It uses the implicit midpoint rule: `x' - x = dt (v⁺ + L (x + x') / 2)` with the velocity `v⁺` after the kick. `reach` is the largest distance
/// of bodies that may touch [m].
pub fn carry(particles: &mut Particles, field: &Field, dt: f64, reach: f64) {
    let Some(stretch) = particles.cell.carry(dt, reach) else { return };
    let (low, _) = particles.cell.corners();
    let (half, one) = (stretch.rate * (0.5 * dt), Mat3::identity());
    let beside = upper_inverse(&(one - half)) - one;
    for slot in 0..particles.owned {
        let before = particles.velocity[slot];
        let pulled = before - half * before;
        change_velocity(particles, slot, pulled);
        let kicked = field.after_first_kick(particles, slot, dt);
        let from = particles.position[slot] - low;
        let own = beside * kicked * dt;
        particles.position[slot] = low + (stretch.places * from + own);
        particles.travel[slot] += own.norm();
        let listed = &mut particles.listed_at[slot];
        *listed = low + stretch.places * (*listed - low);
    }
    // For ghosts only the displacement relative to the flow counts, once their new positions arrive.
    for slot in particles.owned..particles.owned + particles.ghosts {
        let from = particles.position[slot] - low;
        particles.position[slot] = low + stretch.places * from;
    }
    let nearer = (stretch.places - one).norm() * reach * (1.0 + 1e-9);
    let way = 0.5 * nearer + particles.cell.rounding_of_images();
    let bodies = particles.first_facet();
    for travel in particles.travel.iter_mut().take(bodies) {
        *travel += way;
    }
}

/// Applies the other half of the flow's effect on velocities in a step of `dt` [s], after its last kick.
pub fn settle(particles: &mut Particles, dt: f64) {
    let Some(rate) = particles.cell.rate().filter(|rate| *rate != Mat3::zeros()) else { return };
    let inverse = upper_inverse(&(Mat3::identity() + rate * (0.5 * dt)));
    for slot in 0..particles.owned {
        let after = inverse * particles.velocity[slot];
        change_velocity(particles, slot, after);
    }
}

/// Sets the velocity of a body and counts the change of energy as received.
fn change_velocity(particles: &mut Particles, slot: usize, after: Vec3) {
    let before = std::mem::replace(&mut particles.velocity[slot], after);
    let gained = 0.5 * particles.mass(slot) * (after - before).dot(&(after + before));
    particles.accumulated[Quantity::Received][slot] += gained;
}
