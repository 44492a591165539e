//! System-wide scalars: energies, momentum, contacts. Every sum is exact, so that every digit of the
//! log is the same on any number of ranks.

use crate::comm::Comm;
use crate::contact::Pair;
use crate::contacts::{Contacts, Loaded};
use crate::ids::Slot;
use crate::law::ForceLaw;
use crate::math::{ExactSum, Vec3};
use crate::motion::{self, Field};
use crate::particles::Particles;
use crate::particles::columns::Quantity;
use serde::{Deserialize, Serialize};

/// What particles that were taken out have left behind in the balance of energies [J].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Departed {
    /// What they had received, less what they have taken away.
    pub received: f64,
    /// What had been dissipated at them.
    pub dissipated: f64,
}

/// The scalars of a moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measures {
    /// Particles.
    pub particles: u64,
    /// Contacts between particles.
    pub contacts: u64,
    /// Contacts with walls.
    pub wall_contacts: u64,
    /// Kinetic energy of translation [J].
    pub translation: f64,
    /// Kinetic energy of rotation [J].
    pub rotation: f64,
    /// Energy in gravity, zero at the origin [J].
    pub gravity: f64,
    /// Elastic energy of contacts [J].
    pub stored: f64,
    /// What central differences conserve beyond these energies, see [`motion::step_energy`] [J].
    pub step_energy: f64,
    /// Energy dissipated so far [J].
    pub dissipated: f64,
    /// Energy that came in with particles and from moving walls so far, less what went out with particles [J].
    pub received: f64,
    /// Mean normal force between particles [N].
    pub mean_normal_force: f64,
    /// Largest overlap over the shortest axis (a diameter) of the smaller body [-].
    pub largest_overlap: f64,
    /// Largest speed [m/s].
    pub largest_speed: f64,
    /// Highest point of a particle's bounding sphere along z [m].
    pub top: f64,
    /// Mean resultant force of a particle over the mean contact force, of as many contacts as particles at least: one
    /// hard blow among grains that fall does not stand for all; 0 without contacts [-].
    pub unbalanced: f64,
    /// Force of the particles on each wall [N].
    pub wall_forces: Vec<Vec3>,
}

impl Measures {
    /// Kinetic energy [J].
    pub fn kinetic(&self) -> f64 {
        self.translation + self.rotation
    }

    /// Everything but what was dissipated [J].
    pub fn mechanical(&self) -> f64 {
        self.kinetic() + self.gravity + self.stored
    }

    /// What the balance is short of: received - (mechanical + step energy + dissipated) [J].
    pub fn missing(&self) -> f64 {
        self.received - self.mechanical() - self.step_energy - self.dissipated
    }

    /// Kinetic and elastic energy: what moves, and comes and goes with the motion [J].
    pub fn moving(&self) -> f64 {
        self.kinetic() + self.stored
    }

    /// Mean number of contacts of a particle, with walls.
    pub fn coordination(&self) -> f64 {
        if self.particles == 0 {
            return 0.0;
        }
        (2 * self.contacts + self.wall_contacts) as f64 / self.particles as f64
    }
}

/// Which sum stands where.
enum Of {
    Translation,
    Rotation,
    Gravity,
    Stored,
    StepEnergy,
    Dissipated,
    Received,
    NormalForce,
    /// Of a particle: its contacts and gravity.
    Resultant,
    /// Of a contact, tangential force included.
    ContactForce,
    FirstWall,
}

/// Measures the whole system at the end of a step of `dt` [s]. Collective.
pub fn measure(
    particles: &Particles,
    contacts: &Contacts,
    law: &dyn ForceLaw,
    field: &Field,
    dt: f64,
    comm: &mut dyn Comm,
) -> Measures {
    let walls = particles.walls.len();
    let mut sums = vec![ExactSum::default(); Of::FirstWall as usize + 3 * walls];
    // Energies of numbers that are finite may not be.
    let mut infinite = vec![0; sums.len()];
    let mut add = |of: usize, term: f64| {
        if term.is_finite() {
            sums[of].add(term);
        } else {
            infinite[of] += 1;
        }
    };
    let mut maxima = [0.0, 0.0, f64::NEG_INFINITY];
    let mut counts = [particles.owned as i64, 0, 0];

    for slot in 0..particles.owned {
        let mass = particles.mass(slot);
        add(Of::Resultant as usize, field.force(particles, slot).norm());
        let velocity = particles.velocity[slot];
        add(Of::Translation as usize, 0.5 * mass * velocity.norm_squared());
        add(Of::Gravity as usize, -mass * unwrapped(particles, slot).dot(&field.gravity));
        add(Of::Dissipated as usize, particles.accumulated[Quantity::Dissipated][slot]);
        add(Of::Received as usize, particles.accumulated[Quantity::Received][slot]);
        add(Of::Rotation as usize, rotation(particles, slot));
        add(Of::StepEnergy as usize, motion::step_energy(particles, slot, field, dt));
        maxima[1] = larger(maxima[1], velocity.norm());
        maxima[2] = larger(maxima[2], particles.position[slot].z + particles.radius(slot));
    }

    for contact in contacts.loaded(law, particles) {
        let Loaded { pair, geometry, state, normal_force, force, point: _ } = contact;
        let Pair { a, b } = pair;
        let wall = particles.wall_of(b);
        // A contact counts where its first particle is owned.
        if a.index() >= particles.owned {
            continue;
        }
        add(Of::Stored as usize, law.stored(pair, particles, geometry, state));
        maxima[0] = larger(maxima[0], geometry.overlap / shortest_axis(particles, a, b));
        add(Of::ContactForce as usize, force.norm());
        if let Some(wall) = wall {
            counts[2] += 1;
            for axis in 0..3 {
                add(Of::FirstWall as usize + 3 * wall + axis, force[axis]);
            }
        } else {
            counts[1] += 1;
            add(Of::NormalForce as usize, normal_force);
        }
    }

    let mut limbs: Vec<i64> = sums.iter().flat_map(|s| s.limbs().iter().copied()).collect();
    limbs.extend(infinite);
    limbs.extend(counts);
    comm.sum(&mut limbs);
    comm.max(&mut maxima);
    let (limbs, rest) = limbs.split_at(sums.len() * ExactSum::LIMBS);
    let (infinite, counts) = rest.split_at(sums.len());
    let value = |of: usize| match infinite[of] {
        0 => ExactSum::from_limbs(&limbs[of * ExactSum::LIMBS..(of + 1) * ExactSum::LIMBS]).value(),
        _ => f64::NAN,
    };
    let all_contacts = (counts[1] + counts[2]) as f64;
    let contact_force = value(Of::ContactForce as usize);
    Measures {
        particles: counts[0] as u64,
        contacts: counts[1] as u64,
        wall_contacts: counts[2] as u64,
        translation: value(Of::Translation as usize),
        rotation: value(Of::Rotation as usize),
        gravity: value(Of::Gravity as usize),
        stored: value(Of::Stored as usize),
        step_energy: value(Of::StepEnergy as usize),
        dissipated: value(Of::Dissipated as usize),
        received: value(Of::Received as usize),
        mean_normal_force: if counts[1] == 0 {
            0.0
        } else {
            value(Of::NormalForce as usize) / counts[1] as f64
        },
        unbalanced: if contact_force > 0.0 {
            let among = all_contacts.max(counts[0] as f64);
            value(Of::Resultant as usize) * among / (contact_force * counts[0] as f64)
        } else {
            0.0
        },
        largest_overlap: maxima[0],
        largest_speed: maxima[1],
        top: maxima[2],
        wall_forces: (0..walls)
            .map(|k| Vec3::from_fn(|axis, _| value(Of::FirstWall as usize + 3 * k + axis)))
            .collect(),
    }
}

/// Kinetic energy and energy in gravity of an owned particle [J].
pub fn free_energy(particles: &Particles, slot: usize, field: &Field) -> f64 {
    let mass = particles.mass(slot);
    let translation = 0.5 * mass * particles.velocity[slot].norm_squared();
    let gravity = -mass * unwrapped(particles, slot).dot(&field.gravity);
    translation + gravity + rotation(particles, slot)
}

/// Kinetic energy of rotation of an owned particle [J].
fn rotation(particles: &Particles, slot: usize) -> f64 {
    0.5 * particles.angular_velocity(slot).dot(&particles.angular_momentum(slot))
}

/// The shortest axis of the smaller of two bodies, a diameter [m].
pub fn shortest_axis(particles: &Particles, a: Slot, b: Slot) -> f64 {
    let radius = |slot: Slot| particles.inscribed_radius(slot.index());
    2.0 * radius(a).min(radius(b))
}

/// Where a particle would be without periods [m].
pub fn unwrapped(particles: &Particles, slot: usize) -> Vec3 {
    let position = particles.position[slot];
    if particles.needs.image {
        particles.cell.unwrapped(position, &particles.image[slot])
    } else {
        position
    }
}

/// The larger of two numbers; the first where the second is not a number.
pub fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}
