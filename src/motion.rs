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

#![expect(clippy::inline_always, reason = "see `lanes`")]

use crate::lanes::{self, Eight, Kernel, Lanes, Triple, WIDTH, row};
use crate::math::{Quat, Vec3};
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
    let damping = field.damping;
    if particles.attitude.is_some() {
        lanes::dispatch(Turn { particles, slower, faster, damping, dt });
    } else if particles.spin.is_some() {
        spin_spheres(particles, slower, faster, damping, dt);
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
    let mut is_any_far = false;
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
                is_any_far |= *x > low + period;
            } else if *x < low {
                *x += period;
                particles.image[slot][axis] -= 1;
                is_any_far |= *x < low;
            }
        }
    }
    if is_any_far {
        bring_back(particles);
    }
}

/// Brings back along periodic axes what is farther out than a step of a sound run can carry it: the state of a domain
/// that begins elsewhere, or of a run that has become unstable. Each particle is then where its owner's subdomain is.
pub fn bring_back(particles: &mut Particles) {
    if !particles.needs.image {
        return;
    }
    for slot in 0..particles.owned {
        for axis in 0..3 {
            let (low, period) = (particles.low[axis], particles.period[axis]);
            let x = &mut particles.position[slot][axis];
            // The high face is left alone, where rounding may have put a particle until the next step.
            if !period.is_finite() || !x.is_finite() || (low..=low + period).contains(x) {
                continue;
            }
            let turns = ((*x - low) / period).floor();
            *x = (*x - turns * period).clamp(low, low + period);
            let image = &mut particles.image[slot][axis];
            *image = image.saturating_add(turns as i32);
        }
    }
}

/// Kicks the angular velocities of spheres, of which nobody sees how they are turned.
fn spin_spheres(particles: &mut Particles, slower: f64, faster: f64, damping: f64, dt: f64) {
    let Particles { spin: Some(spin), library, shape, dissipated, owned, .. } = particles else {
        return;
    };
    for slot in 0..*owned {
        let inertia = library.inertia[shape[slot].index()].x;
        let before = spin.angular_velocity[slot];
        let after = (before * slower + spin.torque[slot] * (dt / inertia)) * faster;
        spin.angular_velocity[slot] = after;
        if damping > 0.0 {
            let mean = (before + after) * 0.5;
            dissipated[slot] += damping * dt * inertia * mean.norm_squared();
        }
    }
}

/// Kicks the angular momenta and turns the attitudes, of eight particles at once.
struct Turn<'a> {
    particles: &'a mut Particles,
    slower: f64,
    faster: f64,
    damping: f64,
    dt: f64,
}

impl Kernel for Turn<'_> {
    #[inline(always)]
    fn run<L: Eight>(mut self) {
        for first in (0..self.particles.owned).step_by(WIDTH) {
            self.eight::<L>(first);
        }
    }
}

impl Turn<'_> {
    /// Up to eight; the other lanes repeat the last.
    #[inline(always)]
    fn eight<L: Eight>(&mut self, first: usize) {
        let Self { particles, slower, faster, damping, dt } = self;
        let Particles {
            spin: Some(spin),
            attitude: Some(attitude),
            library,
            shape,
            dissipated,
            travel,
            owned,
            ..
        } = &mut **particles
        else {
            return;
        };
        let (damping, dt) = (*damping, *dt);
        let count = (*owned - first).min(WIDTH);
        let shapes = &shape[first..first + count];

        let mut momenta = [spin.angular_momentum[first].as_ref(); WIDTH];
        let mut torques = [spin.torque[first].as_ref(); WIDTH];
        let mut quaternions = [attitude.quaternion[first].coords.as_ref(); WIDTH];
        let mut inertias = [library.inertia[shapes[0].index()].as_ref(); WIDTH];
        for lane in 0..WIDTH {
            let slot = first + lane.min(count - 1);
            momenta[lane] = spin.angular_momentum[slot].as_ref();
            torques[lane] = spin.torque[slot].as_ref();
            quaternions[lane] = attitude.quaternion[slot].coords.as_ref();
            inertias[lane] = library.inertia[shape[slot].index()].as_ref();
        }
        let (before, torque) = (Triple::<L>::of(&momenta), Triple::of(&torques));
        let (start, inertia) = (Rotation::of(&quaternions), Triple::of(&inertias));

        let kicked = before.times(L::all(*slower)).plus(torque.times(L::all(dt)));
        let momentum = kicked.times(L::all(*faster));
        let mut velocity = start.angular_velocity(inertia, momentum);
        for _ in 0..2 {
            let halfway = start.turned(velocity, 0.5 * dt);
            velocity = halfway.angular_velocity(inertia, momentum);
        }
        let end = start.turned(velocity, dt);
        let at_end = end.angular_velocity(inertia, momentum).store();
        // Cayley's turn is smaller than the angle ω dt.
        let angle = (velocity.dot(velocity).sqrt() * L::all(dt)).store();

        let momentum_now = momentum.store();
        let end = end.store();
        for (lane, shape) in shapes.iter().enumerate() {
            let slot = first + lane;
            spin.angular_momentum[slot] = row(&momentum_now, lane).into();
            spin.angular_velocity[slot] = row(&at_end, lane).into();
            let [i, j, k, w] = end.each_ref().map(|column| column[lane]);
            let quaternion = Quat::new_unchecked(Quaternion::new(w, i, j, k));
            attitude.set(slot, quaternion, &library.shapes[shape.index()]);
            travel[slot] += library.radius[shape.index()] * angle[lane];
        }
        if damping > 0.0 {
            let mean = before.plus(momentum).times(L::all(0.5));
            let ratio = mean.dot(mean) / momentum.dot(momentum);
            let lost = (L::all(damping * dt) * velocity.dot(momentum) * ratio).store();
            for (dissipated, lost) in dissipated[first..first + count].iter_mut().zip(lost) {
                if lost.is_finite() {
                    *dissipated += lost;
                }
            }
        }
    }
}

/// Attitudes in lanes: unit quaternions.
#[derive(Clone, Copy)]
struct Rotation<L> {
    i: L,
    j: L,
    k: L,
    w: L,
}

impl<L: Eight> Rotation<L> {
    /// From eight places in memory: i, j, k, w.
    #[inline(always)]
    fn of(rows: &[&[f64; 4]; WIDTH]) -> Self {
        let [i, j, k, w] = L::columns_of_4(rows);
        Self { i, j, k, w }
    }

    /// To memory.
    #[inline(always)]
    fn store(self) -> [[f64; WIDTH]; 4] {
        [self.i.store(), self.j.store(), self.k.store(), self.w.store()]
    }
}

impl<L: Lanes> Rotation<L> {
    /// The attitude after turning for `dt` at a constant angular velocity in world axes.
    #[inline(always)]
    fn turned(self, angular_velocity: Triple<L>, dt: f64) -> Self {
        let Triple { x, y, z } = angular_velocity.times(L::all(0.5 * dt));
        let Self { i, j, k, w } = self;
        // the product of (1, x, y, z) and the quaternion
        let (new_i, new_j) = (i + x * w + y * k - z * j, j - x * k + y * w + z * i);
        let (new_k, new_w) = (k + x * j - y * i + z * w, w - x * i - y * j - z * k);
        let squared = (new_i * new_i + new_k * new_k) + (new_j * new_j + new_w * new_w);
        let length = squared.sqrt();
        Self { i: new_i / length, j: new_j / length, k: new_k / length, w: new_w / length }
    }

    /// `R I⁻¹ Rᵀ L`.
    #[inline(always)]
    fn angular_velocity(self, inertia: Triple<L>, momentum: Triple<L>) -> Triple<L> {
        let Self { i, j, k, w } = self;
        let two = L::all(2.0);
        let (ww, ii, jj, kk) = (w * w, i * i, j * j, k * k);
        let (ij, wk, wj) = (i * j * two, w * k * two, w * j * two);
        let (ik, jk, wi) = (i * k * two, j * k * two, w * i * two);
        let axis_x = Triple { x: ww + ii - jj - kk, y: wk + ij, z: ik - wj };
        let axis_y = Triple { x: ij - wk, y: ww - ii + jj - kk, z: wi + jk };
        let axis_z = Triple { x: wj + ik, y: jk - wi, z: ww - ii - jj + kk };
        let along_x = axis_x.times(axis_x.dot(momentum) / inertia.x);
        let along_y = axis_y.times(axis_y.dot(momentum) / inertia.y);
        let along_z = axis_z.times(axis_z.dot(momentum) / inertia.z);
        along_x.plus(along_y).plus(along_z)
    }
}

#[cfg(test)]
mod tests {
    use super::Turn;
    use crate::lanes::{self, Kernel, Portable};
    use crate::particles::{Particles, crowd};

    fn turn(particles: &mut Particles) -> Turn<'_> {
        Turn { particles, slower: 0.99, faster: 0.98, damping: 3.0, dt: 1e-5 }
    }

    fn bits(particles: &Particles, slot: usize) -> Vec<u64> {
        let (spin, attitude) =
            (particles.spin.as_ref().unwrap(), particles.attitude.as_ref().unwrap());
        let numbers = (spin.angular_momentum[slot].iter())
            .chain(&spin.angular_velocity[slot])
            .chain(&attitude.quaternion[slot].coords)
            .chain(&attitude.form[slot])
            .chain([&particles.travel[slot], &particles.dissipated[slot]]);
        numbers.map(|x| x.to_bits()).collect()
    }

    /// With and without vector registers, in any company, and as `angular_velocity_for` has it.
    #[test]
    fn lanes_give_the_same_bits_everywhere() {
        let before = crowd(21);
        let (mut dispatched, mut portable) = (before.clone(), before.clone());
        lanes::dispatch(turn(&mut dispatched));
        turn(&mut portable).run::<Portable>();
        for slot in 0..before.owned {
            assert_ne!(bits(&dispatched, slot), bits(&before, slot), "particle {slot} turns");
            assert_eq!(bits(&dispatched, slot), bits(&portable, slot), "particle {slot}");
            let spin = dispatched.spin.as_ref().unwrap();
            let again = dispatched.angular_velocity_for(slot, &spin.angular_momentum[slot]);
            assert_eq!(spin.angular_velocity[slot], again, "particle {slot}");

            let mut alone = before.clone();
            alone.strip_to_owned();
            while alone.owned > slot + 1 {
                alone.take_owned(slot + 1);
            }
            for other in (0..slot).rev() {
                alone.take_owned(other);
            }
            alone.travel.truncate(1);
            lanes::dispatch(turn(&mut alone));
            assert_eq!(bits(&dispatched, slot), bits(&alone, 0), "particle {slot} alone");
        }
    }
}
