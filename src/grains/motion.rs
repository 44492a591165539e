//! Time integration: the central differences of the paper, with its global damping, as kick, drift, kick.
//!
//! After every step, velocities and angular momenta are those at the time of the positions and orientations. For forces `F` and damping `ξ`
//! (a force `-ξ m v` and a moment `-ξ I ω`; Lim and Andrade 2014, DOI 10.1002/nag.2203), a step of `dt = 2h` is
//!
//! `v⁺ = (1 - ξ h) v + h F/m`, `x' = x + dt v⁺`, forces `F'` at `x'` with `v⁺`, `v' = (v⁺ + h F'/m) / (1 + ξ h)`.
//!
//! This equals the paper's `v⁺ = ((1 - ξ h) v⁻ + dt F/m) / (1 + ξ h)` for the velocities in the middle of the steps (velocity Verlet: Swope et
//! al. 1982, DOI 10.1063/1.442716). The angular momentum `L` is kicked by the moment in the same way. In world axes the damping moment is
//! `-ξ L`, so free bodies keep `L` to the last bit.
//!
//! A free rotation follows the implicit midpoint rule in the body's axes. Its angular velocity `ω` there solves `I ω + h ω × I ω = Rᵀ L`, and
//! the orientation rotates by the quaternion `(1, h ω)`, normalised (Cayley's form, which needs no sine and gives the same bits on every
//! machine). `ω` is found to rounding, so a free rotation keeps the kinetic energy to rounding, also for needles and discs (Austin,
//! Krishnaprasad and Wang 1993, DOI 10.1006/jcph.1993.1128). The scheme is of second order in `dt`. Laws use this `ω` and `v⁺`, so that work is
//! force times the displacement of the bodies.
//!
//! Contacts begin and end between steps. An elastic collision of two spheres thereby changes their relative kinetic energy by a part that
//! depends on the beginning of the contact within a step. Its mean is nearly zero. The largest value is
//!
//! | step over the stable limit | 5 % | 10 % | 20 % | 40 % | 80 % |
//! |---|---|---|---|---|---|
//! | change in one collision | 1.3e-4 | 3.7e-4 | 8.0e-4 | 8.0e-3 | 2.6e-2 |

#![expect(clippy::inline_always, reason = "see `lanes`")]

pub mod affine;
pub mod ahead;

use crate::lanes::{self, Eight, Kernel, Lanes, Triple, WIDTH, row};
use crate::math::{Quat, Vec3, Vec3AndNumber};
use crate::particles::Particles;
use crate::particles::columns::Quantity;
use crate::population::of_inertia;
use crate::shape::Kind;
use nalgebra::Quaternion;

/// Gravity and damping, which act on every particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Gravity [m/s²].
    pub gravity: Vec3,
    /// Global damping ξ [1/s].
    pub damping: f64,
}

impl Field {
    /// Force on a particle without global damping: its contacts and gravity [N].
    #[inline]
    pub fn force(&self, particles: &Particles, slot: usize) -> Vec3 {
        self.beside(&particles.force[slot], particles.mass(slot))
    }

    /// Force without global damping, from that of the contacts [N] and the mass [kg].
    #[inline(always)]
    fn beside(&self, of_contacts: &Vec3AndNumber, mass: f64) -> Vec3 {
        of_contacts.vector + self.gravity * mass
    }

    /// Velocity that the second kick of a step of `dt` [s] turns into `velocity` without contacts [m/s].
    ///
    /// It is that of a particle inserted within a step.
    pub fn before_last_kick(&self, velocity: &Vec3, dt: f64) -> Vec3 {
        velocity * (1.0 + 0.5 * self.damping * dt) - self.gravity * (0.5 * dt)
    }

    /// Velocity of a particle after the first kick of a step of `dt` [s], from that before it [m/s].
    pub fn after_first_kick(&self, particles: &Particles, slot: usize, dt: f64) -> Vec3 {
        let (force, mass) = (self.force(particles, slot), particles.mass(slot));
        Kick::first(self, dt).after(&particles.velocity[slot], &force, mass)
    }

    /// Velocity into which the second kick of a step of `dt` [s] turns `velocity` without contacts [m/s].
    pub fn after_last_kick(&self, velocity: &Vec3, dt: f64) -> Vec3 {
        (velocity + self.gravity * (0.5 * dt)) / (1.0 + 0.5 * self.damping * dt)
    }
}

/// Largest displacements of owned particles in a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Farthest {
    /// Displacement of a centre [m], and the slot.
    pub moved: (f64, usize),
    /// Angle of rotation [rad], and the slot. Spheres are left out, because their orientation has no effect.
    pub turned: (f64, usize),
}

/// Change of velocities in half of a step: `v⁺ = (slower v + half F/m) faster`.
#[derive(Clone, Copy)]
struct Kick {
    /// Half of the step [s].
    half: f64,
    /// Global damping [1/s].
    damping: f64,
    slower: f64,
    faster: f64,
    /// Whether it begins at the time of the positions; otherwise it ends there.
    is_first: bool,
}

impl Kick {
    fn first(field: &Field, dt: f64) -> Self {
        let (half, damping) = (0.5 * dt, field.damping);
        Self { half, damping, slower: 1.0 - half * damping, faster: 1.0, is_first: true }
    }

    fn last(field: &Field, dt: f64) -> Self {
        let (half, damping) = (0.5 * dt, field.damping);
        Self { half, damping, slower: 1.0, faster: 1.0 / (1.0 + half * damping), is_first: false }
    }

    /// Velocity after the kick, from the velocity before it, the force without damping, and the mass.
    #[inline]
    fn after(&self, before: &Vec3, force: &Vec3, mass: f64) -> Vec3 {
        (before * self.slower + force * (self.half / mass)) * self.faster
    }

    /// Energy per mass taken by damping; also for an angular momentum and its angular velocities.
    ///
    /// The damping force belongs to the velocity at the time of the positions, its work to the mean of before and after.
    #[inline]
    fn lost(&self, at_positions: &Vec3, before: &Vec3, after: &Vec3) -> f64 {
        self.half * self.damping * at_positions.dot(&((before + after) * 0.5))
    }

    /// Kicks the angular velocities of spheres, which have no orientation.
    fn spheres<const SIZED: bool>(self, particles: &mut Particles) {
        let Particles { spin: Some(spin), library, shape, scale, accumulated, owned, .. } =
            particles
        else {
            return;
        };
        let owned = *owned;
        let (shape, torque) = (&shape[..owned], &spin.torque[..owned]);
        let angular_velocity = &mut spin.angular_velocity[..owned];
        for slot in 0..owned {
            let inertia = library.inertia_at(shape[slot], scale_in::<SIZED>(scale, slot)).x;
            let before = angular_velocity[slot];
            let after = self.after(&before, &torque[slot].vector, inertia);
            angular_velocity[slot] = after;
            if self.damping > 0.0 {
                let at_positions = if self.is_first { &before } else { &after };
                accumulated.damp(slot, inertia * self.lost(at_positions, &before, &after));
            }
        }
    }
}

/// Scale of a body; 1 if the scene has no such column. Chosen once per loop, so a missing column costs nothing.
#[inline(always)]
fn scale_in<const SIZED: bool>(column: &[f64], slot: usize) -> f64 {
    if SIZED { column[slot] } else { 1.0 }
}

/// Kicks all owned particles by the forces at their positions for half of `dt` [s], and moves them for all of it.
pub fn kick_and_drift(particles: &mut Particles, field: &Field, dt: f64) -> Farthest {
    if particles.needs.ahead {
        ahead::foresee(particles, field, dt);
    }
    if particles.needs.scale {
        kick_and_drift_of::<true>(particles, field, dt)
    } else {
        kick_and_drift_of::<false>(particles, field, dt)
    }
}

fn kick_and_drift_of<const SIZED: bool>(
    particles: &mut Particles,
    field: &Field,
    dt: f64,
) -> Farthest {
    let kick = Kick::first(field, dt);
    let mut farthest = Farthest::default();
    let mut farthest_squared = 0.0;
    let Particles {
        library,
        shape,
        scale,
        force,
        velocity,
        position,
        travel,
        accumulated,
        owned,
        ..
    } = &mut *particles;
    // Slices of one length need no bounds checks.
    let owned = *owned;
    let (shape, force, velocity) = (&shape[..owned], &force[..owned], &mut velocity[..owned]);
    let (position, travel) = (&mut position[..owned], &mut travel[..owned]);
    for slot in 0..owned {
        let mass = library.mass_at(shape[slot], scale_in::<SIZED>(scale, slot));
        let before = velocity[slot];
        let after = kick.after(&before, &field.beside(&force[slot], mass), mass);
        velocity[slot] = after;
        let from = position[slot];
        let to = from + after * dt;
        position[slot] = to;
        // Between the rounded positions: far from the origin `after · dt` may be shorter.
        let moved_squared = (to - from).norm_squared();
        travel[slot] += moved_squared.sqrt();
        if moved_squared > farthest_squared {
            farthest_squared = moved_squared;
            farthest.moved.1 = slot;
        }
        if kick.damping > 0.0 {
            accumulated.damp(slot, mass * kick.lost(&before, &before, &after));
        }
    }
    farthest.moved.0 = farthest_squared.sqrt();
    wrap(particles);
    if particles.orientation.is_some() {
        let turned = &mut farthest.turned;
        lanes::dispatch(Turn::<SIZED> { particles, kick, dt, turned });
    } else {
        kick.spheres::<SIZED>(particles);
    }
    farthest
}

/// Second kick of a step of `dt` [s], by the forces at the new positions.
pub fn kick(particles: &mut Particles, field: &Field, dt: f64) {
    if particles.needs.scale {
        kick_of::<true>(particles, field, dt);
    } else {
        kick_of::<false>(particles, field, dt);
    }
}

fn kick_of<const SIZED: bool>(particles: &mut Particles, field: &Field, dt: f64) {
    let kick = Kick::last(field, dt);
    let Particles { library, shape, scale, force, velocity, accumulated, owned, .. } =
        &mut *particles;
    let owned = *owned;
    let (shape, force, velocity) = (&shape[..owned], &force[..owned], &mut velocity[..owned]);
    for slot in 0..owned {
        let mass = library.mass_at(shape[slot], scale_in::<SIZED>(scale, slot));
        let before = velocity[slot];
        let after = kick.after(&before, &field.beside(&force[slot], mass), mass);
        velocity[slot] = after;
        if kick.damping > 0.0 {
            accumulated.damp(slot, mass * kick.lost(&after, &before, &after));
        }
    }
    if particles.orientation.is_none() {
        kick.spheres::<SIZED>(particles);
    } else {
        kick_momenta(particles, kick);
    }
}

/// Second kick of angular momenta. Angular velocities stay those of the rotation, as the next step computes them again.
fn kick_momenta(particles: &mut Particles, kick: Kick) {
    for slot in 0..particles.owned {
        let Some(spin) = &mut particles.spin else { return };
        let before = spin.angular_momentum[slot];
        let after = kick.after(&before, &spin.torque[slot].vector, 1.0);
        spin.angular_momentum[slot] = after;
        if kick.damping > 0.0 {
            let [first, last] =
                [before, after].map(|momentum| particles.angular_velocity_for(slot, &momentum));
            particles.accumulated.damp(slot, kick.lost(&after, &first, &last));
        }
    }
}

/// Part of the energy conserved by central differences that is not energy of the positions and velocities [J].
///
/// For a spring it is `-(ω dt)²/4` of its elastic energy, by which the energy of an oscillation varies within a period without a loss.
pub fn step_energy(particles: &Particles, slot: usize, field: &Field, dt: f64) -> f64 {
    if particles.is_held(slot) {
        return 0.0;
    }
    let force = field.force(particles, slot);
    let velocity = particles.velocity[slot];
    let acceleration = force / particles.mass(slot) - velocity * field.damping;
    let mut energy = force.dot(&acceleration);
    if let Some(spin) = &particles.spin {
        let torque = spin.torque[slot].vector;
        let kick = torque - particles.angular_momentum(slot) * field.damping;
        energy += particles.angular_velocity_for(slot, &kick).dot(&torque);
    }
    -0.125 * dt * dt * energy
}

/// Energy that the last kick of a step of `dt` [s] gives to a particle without contacts, without damping [J].
///
/// It includes [`step_energy`] after the kick.
pub fn last_work(particles: &Particles, slot: usize, field: &Field, dt: f64) -> f64 {
    let weight = field.gravity * particles.mass(slot);
    0.5 * dt * weight.dot(&particles.velocity[slot])
}

/// Moves particles that have left through a periodic face back in through the opposite one.
///
/// This is done in every step, so that a position never depends on when the pairs were listed.
pub fn wrap(particles: &mut Particles) {
    if !particles.needs.image {
        return;
    }
    let mut is_any_far = false;
    let rounding = particles.cell.rounding_of_images();
    let [low, high] = particles.cell.wraps_outside();
    for slot in 0..particles.owned {
        let place = &particles.position[slot];
        let is_beyond = |axis: usize| place[axis] < low[axis] || place[axis] >= high[axis];
        if !(is_beyond(0) | is_beyond(1) | is_beyond(2)) {
            continue;
        }
        let Particles { cell, position, velocity, image, travel, .. } = &mut *particles;
        let before = velocity[slot];
        let (faces, is_far) = cell.wrap(&mut position[slot], &mut velocity[slot], &mut image[slot]);
        for _ in 0..faces {
            travel[slot] += rounding;
        }
        if faces > 0 {
            count_change_of_frame(particles, slot, &before);
        }
        is_any_far |= is_far;
    }
    if is_any_far {
        bring_back(particles);
    }
}

/// Moves particles back along periodic axes that are farther outside than a step of a valid run can carry them.
///
/// This occurs for a domain that begins elsewhere, or in an unstable run. Each particle is then in the subdomain of its owner.
pub fn bring_back(particles: &mut Particles) {
    if !particles.needs.image {
        return;
    }
    for slot in 0..particles.owned {
        let Particles { cell, position, velocity, image, .. } = &mut *particles;
        let before = velocity[slot];
        cell.bring_back(&mut position[slot], &mut velocity[slot], &mut image[slot]);
        count_change_of_frame(particles, slot, &before);
    }
}

/// Counts the change of kinetic energy of a particle that passes to a sliding image, which is due to the shear of the cell.
///
/// `before` is its velocity on the other side [m/s].
fn count_change_of_frame(particles: &mut Particles, slot: usize, before: &Vec3) {
    let after = particles.velocity[slot];
    if after != *before {
        let gained = 0.5 * particles.mass(slot) * (after - before).dot(&(after + before));
        particles.accumulated[Quantity::Received][slot] += gained;
    }
}

/// Kick of angular momenta for half a step, and rotation for a whole one, for eight particles at once.
///
/// `SIZED` if particles have scales.
struct Turn<'a, const SIZED: bool> {
    particles: &'a mut Particles,
    kick: Kick,
    dt: f64,
    /// Largest angle [rad], and its slot.
    turned: &'a mut (f64, usize),
}

impl<const SIZED: bool> Kernel for Turn<'_, SIZED> {
    type Home = Self;

    #[inline(always)]
    fn run<L: Eight>(mut self) {
        for first in (0..self.particles.owned).step_by(WIDTH) {
            self.eight::<L>(first);
        }
    }
}

impl<const SIZED: bool> Turn<'_, SIZED> {
    /// Processes up to eight particles; the other lanes repeat the last.
    #[inline(always)]
    fn eight<L: Eight>(&mut self, first: usize) {
        let Self { particles, kick, dt, turned } = self;
        let Particles {
            spin: Some(spin),
            orientation: Some(orientation),
            library,
            shape,
            scale,
            accumulated,
            travel,
            owned,
            ..
        } = &mut **particles
        else {
            return;
        };
        let (kick, dt) = (*kick, *dt);
        let count = (*owned - first).min(WIDTH);
        let shapes = &shape[first..first + count];

        let mut momenta = [spin.angular_momentum[first].as_ref(); WIDTH];
        let mut torques = [bytemuck::cast_ref(&spin.torque[first]); WIDTH];
        let mut quaternions = [orientation.quaternion[first].coords.as_ref(); WIDTH];
        let mut inertias = [library.inertia[shapes[0].index()].as_ref(); WIDTH];
        for lane in 0..WIDTH {
            let slot = first + lane.min(count - 1);
            momenta[lane] = spin.angular_momentum[slot].as_ref();
            torques[lane] = bytemuck::cast_ref(&spin.torque[slot]);
            quaternions[lane] = orientation.quaternion[slot].coords.as_ref();
            inertias[lane] = library.inertia[shape[slot].index()].as_ref();
        }
        let (before, torque) = (Triple::<L>::of(&momenta), Triple::of_four(&torques));
        let (start, mut inertia) = (Rotation::of(&quaternions), Triple::of(&inertias));
        if SIZED {
            let mut factors = [of_inertia(scale[first]); WIDTH];
            for (factor, scale) in factors.iter_mut().zip(&scale[first..first + count]) {
                *factor = of_inertia(*scale);
            }
            inertia = inertia.times(L::load(&factors));
        }

        let half = L::all(kick.half);
        let momentum = before.times(L::all(kick.slower)).plus(torque.times(half));
        let in_body = start.to_body(momentum);
        let velocity = midpoint_velocity(in_body, inertia, half);
        let end = start.turned(velocity.times(half));
        let in_world = end.to_world(velocity).store();
        // The rotation of Cayley's form is smaller than the angle ω dt.
        let angle = (velocity.dot(velocity).sqrt() * L::all(dt)).store();

        let momentum_now = momentum.store();
        let end = end.store();
        for (lane, shape) in shapes.iter().enumerate() {
            let slot = first + lane;
            spin.angular_momentum[slot] = row(&momentum_now, lane).into();
            spin.angular_velocity[slot] = row(&in_world, lane).into();
            let [i, j, k, w] = end.each_ref().map(|column| column[lane]);
            let quaternion = Quat::new_unchecked(Quaternion::new(w, i, j, k));
            let scale = scale_in::<SIZED>(scale, slot);
            orientation.set(slot, quaternion, &library.shapes[shape.index()], scale);
            // The orientation of a sphere has no effect.
            if library.shapes[shape.index()].kind() != Kind::Sphere {
                travel[slot] += library.radius[shape.index()] * scale * angle[lane];
                if angle[lane] > turned.0 {
                    **turned = (angle[lane], slot);
                }
            }
        }
        if kick.damping > 0.0 {
            let mean = start.angular_velocity(inertia, before.plus(momentum)).times(L::all(0.5));
            let lost = (half * L::all(kick.damping) * before.dot(mean)).store();
            for (slot, lost) in (first..first + count).zip(lost) {
                accumulated.damp(slot, lost);
            }
        }
    }
}

/// Euler's products of angular velocities, each times a factor.
#[inline(always)]
fn coupling<L: Lanes>(by: Triple<L>, w: Triple<L>) -> Triple<L> {
    Triple { x: by.x * w.y * w.z, y: by.y * w.z * w.x, z: by.z * w.x * w.y }
}

/// Largest number of Newton steps; free rotations of a stable run need one or two.
const MOST_SWEEPS: usize = 20;
/// Square of a correction, over that of the angular velocity, after which the next one is below rounding.
const LAST_CORRECTION: f64 = 1e-16;

/// Angular velocity `ω` of the midpoint rule in the body's axes [rad/s]: `I ω + h ω × I ω = L`, by Newton's method.
///
/// The start is from Euler's equations. Each lane stops by itself, so it has the same bits in any company.
#[inline(always)]
fn midpoint_velocity<L: Lanes>(momentum: Triple<L>, inertia: Triple<L>, half: L) -> Triple<L> {
    let Triple { x: ix, y: iy, z: iz } = inertia;
    // No moment of inertia exceeds the sum of the others, so none of these exceeds h.
    let by =
        Triple { x: half * (iz - iy) / ix, y: half * (ix - iz) / iy, z: half * (iy - ix) / iz };
    let at_start = Triple { x: momentum.x / ix, y: momentum.y / iy, z: momentum.z / iz };
    let mut velocity = at_start.minus(coupling(by, at_start));
    let mut moving = u8::MAX;
    for _ in 0..MOST_SWEEPS {
        let residual = velocity.plus(coupling(by, velocity)).minus(at_start);
        // The Jacobian has ones on its diagonal.
        let (xy, xz) = (by.x * velocity.z, by.x * velocity.y);
        let (yx, yz) = (by.y * velocity.z, by.y * velocity.x);
        let (zx, zy) = (by.z * velocity.y, by.z * velocity.x);
        let one = L::all(1.0);
        let column_x = Triple { x: one - yz * zy, y: yz * zx - yx, z: yx * zy - zx };
        let column_y = Triple { x: xz * zy - xy, y: one - xz * zx, z: xy * zx - zy };
        let column_z = Triple { x: xy * yz - xz, y: xz * yx - yz, z: one - xy * yx };
        let determinant = column_x.x + xy * column_x.y + xz * column_x.z;
        let solved = column_x.times(residual.x).plus(column_y.times(residual.y));
        let correction = solved.plus(column_z.times(residual.z)).over(determinant);
        velocity = velocity.minus(correction).or(velocity, moving);
        let left = L::all(LAST_CORRECTION) * velocity.dot(velocity);
        moving &= left.less(correction.dot(correction));
        if moving == 0 {
            break;
        }
    }
    velocity
}

/// Orientations in lanes: unit quaternions.
#[derive(Clone, Copy)]
struct Rotation<L> {
    i: L,
    j: L,
    k: L,
    w: L,
}

impl<L: Eight> Rotation<L> {
    /// Loads eight orientations from memory: i, j, k, w.
    #[inline(always)]
    fn of(rows: &[&[f64; 4]; WIDTH]) -> Self {
        let [i, j, k, w] = L::columns_of_4(rows);
        Self { i, j, k, w }
    }

    /// The numbers of all lanes, by component.
    #[inline(always)]
    fn store(self) -> [[f64; WIDTH]; 4] {
        [self.i.store(), self.j.store(), self.k.store(), self.w.store()]
    }
}

impl<L: Lanes> Rotation<L> {
    /// Orientation after a rotation by the quaternion `(1, x, y, z)` in the body's axes, normalised.
    #[inline(always)]
    fn turned(self, by: Triple<L>) -> Self {
        let Triple { x, y, z } = by;
        let Self { i, j, k, w } = self;
        let (new_i, new_j) = (i + w * x + j * z - k * y, j + w * y + k * x - i * z);
        let (new_k, new_w) = (k + w * z + i * y - j * x, w - i * x - j * y - k * z);
        let squared = (new_i * new_i + new_k * new_k) + (new_j * new_j + new_w * new_w);
        let length = squared.sqrt();
        Self { i: new_i / length, j: new_j / length, k: new_k / length, w: new_w / length }
    }

    /// Body's own axes in the world.
    #[inline(always)]
    fn axes(self) -> [Triple<L>; 3] {
        let Self { i, j, k, w } = self;
        let two = L::all(2.0);
        let (ww, ii, jj, kk) = (w * w, i * i, j * j, k * k);
        let (ij, wk, wj) = (i * j * two, w * k * two, w * j * two);
        let (ik, jk, wi) = (i * k * two, j * k * two, w * i * two);
        [
            Triple { x: ww + ii - jj - kk, y: wk + ij, z: ik - wj },
            Triple { x: ij - wk, y: ww - ii + jj - kk, z: wi + jk },
            Triple { x: wj + ik, y: jk - wi, z: ww - ii - jj + kk },
        ]
    }

    /// `Rᵀ v`: a vector of the world in the body's axes.
    #[inline(always)]
    fn to_body(self, vector: Triple<L>) -> Triple<L> {
        let [x, y, z] = self.axes();
        Triple { x: x.dot(vector), y: y.dot(vector), z: z.dot(vector) }
    }

    /// `R v`: a vector of the body's axes in the world.
    #[inline(always)]
    fn to_world(self, vector: Triple<L>) -> Triple<L> {
        let [x, y, z] = self.axes();
        x.times(vector.x).plus(y.times(vector.y)).plus(z.times(vector.z))
    }

    /// `R I⁻¹ Rᵀ L`.
    #[inline(always)]
    fn angular_velocity(self, inertia: Triple<L>, momentum: Triple<L>) -> Triple<L> {
        let in_body = self.to_body(momentum);
        let Triple { x, y, z } = inertia;
        self.to_world(Triple { x: in_body.x / x, y: in_body.y / y, z: in_body.z / z })
    }
}

#[cfg(test)]
mod tests {
    use super::{Field, Kick, Turn};
    use crate::lanes::{self, Kernel, Portable};
    use crate::math::Vec3;
    use crate::particles::Particles;
    use crate::particles::columns::Quantity;
    use crate::particles::crowd::crowd;

    /// Rotates all particles, with the kernel run by `run`.
    fn turn<const SIZED: bool>(particles: &mut Particles, run: impl Fn(Turn<SIZED>)) {
        let turned = &mut (0.0, 0);
        let field = Field { gravity: Vec3::zeros(), damping: 3.0 };
        run(Turn { particles, kick: Kick::first(&field, 1e-5), dt: 1e-5, turned });
    }

    fn bits(particles: &Particles, slot: usize) -> Vec<u64> {
        let (spin, orientation) =
            (particles.spin.as_ref().unwrap(), particles.orientation.as_ref().unwrap());
        let numbers = (spin.angular_momentum[slot].iter())
            .chain(&spin.angular_velocity[slot])
            .chain(&orientation.quaternion[slot].coords)
            .chain(&orientation.form[slot])
            .chain([&particles.travel[slot], &particles.accumulated[Quantity::Dissipated][slot]]);
        numbers.map(|x| x.to_bits()).collect()
    }

    /// Same bits with and without vector registers, in any company, and as by `angular_velocity_for`.
    #[test]
    fn lanes_give_the_same_bits_everywhere() {
        same_bits::<false>();
        same_bits::<true>();
    }

    fn same_bits<const SIZED: bool>() {
        let before = crowd(21, SIZED);
        let (mut dispatched, mut portable) = (before.clone(), before.clone());
        turn::<SIZED>(&mut dispatched, |kernel| lanes::dispatch(kernel));
        turn::<SIZED>(&mut portable, |kernel| kernel.run::<Portable>());
        for slot in 0..before.owned {
            assert_ne!(bits(&dispatched, slot), bits(&before, slot), "particle {slot} turns");
            assert_eq!(bits(&dispatched, slot), bits(&portable, slot), "particle {slot}");
            let [from, to] = [&before, &dispatched]
                .map(|all| all.orientation.as_ref().unwrap().quaternion[slot]);
            let turned = to * from.inverse();
            let turning = turned.imag() / (0.5e-5 * turned.w);
            let kept = dispatched.spin.as_ref().unwrap().angular_velocity[slot];
            assert!(
                (turning - kept).norm() < 1e-9 * kept.norm(),
                "particle {slot}: {turning} {kept}"
            );

            let mut alone = before.clone();
            alone.strip_to_owned();
            while alone.owned > slot + 1 {
                alone.take_owned(slot + 1);
            }
            for other in (0..slot).rev() {
                alone.take_owned(other);
            }
            alone.travel.resize(1, 0.0);
            turn::<SIZED>(&mut alone, |kernel| lanes::dispatch(kernel));
            assert_eq!(bits(&dispatched, slot), bits(&alone, 0), "particle {slot} alone");
        }
    }
}
