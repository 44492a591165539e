//! System-wide scalars: energies, momentum, contacts. Every sum is exact, so that the digits of the log do not depend on
//! the number of ranks.

use crate::cell::{Cell, Shear, Strained};
use crate::comm::Comm;
use crate::contact::Pair;
use crate::contacts::{Contacts, Loaded};
use crate::ids::Slot;
use crate::law::ForceLaw;
use crate::math::{ExactSum, Vec3, larger_number};
use crate::motion::{self, Field};
use crate::particles::Particles;
use crate::particles::columns::Quantity;
use crate::walls::Wall;
use serde::{Deserialize, Serialize};

/// Largest energy error without a warning.
const MAY_MISS: f64 = 2e-3;

/// Energies of particles that were taken out [J].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Departed {
    /// Energy that they had received, minus that which they have taken away.
    pub received: f64,
    /// Energy that had been dissipated at them.
    pub dissipated: f64,
    /// Parts of the dissipated energy, see [`Quantity::CHANNELS`].
    pub channels: [f64; Quantity::CHANNELS.len()],
}

/// Scalar measures at a moment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measures {
    /// Particles.
    pub particles: u64,
    /// Held particles. Like walls they have no energy, and do not count in means over particles.
    pub held: u64,
    /// Contacts between particles that are not held.
    pub contacts: u64,
    /// Contacts with walls and with held particles.
    pub wall_contacts: u64,
    /// Kinetic energy of translation [J].
    pub translation: f64,
    /// Kinetic energy of rotation [J].
    pub rotation: f64,
    /// Potential energy in gravity, zero at the origin [J].
    pub gravity: f64,
    /// Elastic energy of contacts [J].
    pub stored: f64,
    /// Energy that central differences conserve in addition, see [`motion::step_energy`] [J].
    pub step_energy: f64,
    /// Energy dissipated so far [J].
    pub dissipated: f64,
    /// Parts of the dissipated energy, see [`Quantity::CHANNELS`] [J].
    pub channels: [f64; Quantity::CHANNELS.len()],
    /// Energy received so far from new particles, moving walls, and moved or pushed groups, minus that of particles taken
    /// out [J].
    pub received: f64,
    /// Mean normal force between particles [N].
    pub mean_normal_force: f64,
    /// Largest overlap over the shortest axis (a diameter) of the smaller body [-].
    pub largest_overlap: f64,
    /// Largest speed [m/s].
    pub largest_speed: f64,
    /// Highest point of a particle's bounding sphere along z [m].
    pub top: f64,
    /// Mean resultant force of a particle over the mean contact force [-]; 0 without contacts. The number of contacts
    /// counts as at least the number of particles, so that one impact in a falling cloud does not look like equilibrium.
    pub unbalanced: f64,
    /// Force of the particles on each wall [N].
    pub wall_forces: Vec<Vec3>,
    /// Torque of the particles on each wall about its reference point [N m]; 0 if no wall asks for it.
    pub wall_torques: Vec<Vec3>,
    /// Power of the surfaces of belts on the particles, beyond that of their walls, by wall [W]; 0 for other walls.
    pub belt_powers: Vec<f64>,
    /// Sum of the contact forces on the particles of each group [N].
    pub group_forces: Vec<Vec3>,
    /// Torque of the contacts on each group that turns, about its reference point [N m]; 0 for others.
    pub group_torques: Vec<Vec3>,
    /// Stress of a cell that is sheared or carried by a flow.
    pub bulk: Option<Bulk>,
}

/// Stress in the whole of a cell that is sheared or carried by a flow, compression positive, by [`COMPONENTS`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bulk {
    /// Displacement over height so far, for a sheared cell [-].
    pub strain: f64,
    /// Rate of a flow that carries the cell, integrated over time, compression positive [-].
    pub strains: Option<[f64; 6]>,
    /// Contact stress: the symmetric part of the sum of force times branch over the volume (Love 1927; Christoffersen,
    /// Mehrabadi and Nemat-Nasser 1981, DOI 10.1115/1.3157619) [Pa].
    pub of_contacts: [f64; 6],
    /// Kinetic stress: the sum of mass times velocity times velocity over the volume, with velocities relative to the mean
    /// flow [Pa].
    pub of_motion: [f64; 6],
    /// Volume of all particles over that of the cell [-].
    pub solid_fraction: f64,
}

impl Bulk {
    /// Stress of contacts and motion, compression positive, by [`COMPONENTS`] [Pa].
    pub fn stress(&self) -> [f64; 6] {
        std::array::from_fn(|k| self.of_contacts[k] + self.of_motion[k])
    }
}

/// Axes of the components of a stress, in the order of output.
pub const COMPONENTS: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]];

/// Causes of an energy error that does not depend on the step.
const AT_ONCE: &str = "Contacts that begin or end abruptly (at rims of sheets, in folds of meshes with `smooth = 0` \
     and in pits where several folds meet)";

/// Largest rounding error of the energy balance, over the sum of its terms.
const ROUNDING: f64 = 1e-12;

impl Measures {
    /// Kinetic energy [J].
    pub fn kinetic(&self) -> f64 {
        self.translation + self.rotation
    }

    /// Energy without the dissipated part [J].
    pub fn mechanical(&self) -> f64 {
        self.kinetic() + self.gravity + self.stored
    }

    /// Energy error: received - (mechanical + step energy + dissipated) [J].
    pub fn missing(&self) -> f64 {
        self.received - self.mechanical() - self.step_energy - self.dissipated
    }

    /// Energy dissipated by normal dashpots: the rest of all channels [J].
    pub fn of_normal_dashpots(&self) -> f64 {
        self.channels.iter().fold(self.dissipated, |rest, part| rest - part)
    }

    /// One part of the dissipated energy [J].
    ///
    /// # Panics
    /// If it is not one of [`Quantity::CHANNELS`].
    pub fn taken_by(&self, channel: Quantity) -> f64 {
        let place = Quantity::CHANNELS.iter().position(|one| *one == channel);
        self.channels[place.expect("a channel")]
    }

    /// Kinetic and elastic energy, both of which change with the motion [J]. Adhesion stores negative energy.
    pub fn moving(&self) -> f64 {
        self.kinetic() + self.stored.abs()
    }

    /// Energy error over the dissipated energy, or over `most_moving` where the run dissipates less: the largest kinetic
    /// and elastic energy of the run [J]. 0 within rounding.
    pub fn part_missing(&self, most_moving: f64) -> f64 {
        let terms = [self.received, self.kinetic(), self.gravity, self.stored, self.dissipated];
        if self.missing().abs() <= ROUNDING * terms.iter().map(|term| term.abs()).sum::<f64>() {
            return 0.0;
        }
        self.missing() / if self.dissipated > most_moving { self.dissipated } else { most_moving }
    }

    /// Step [s] with which the energy error would be within the limit, if steps of `dt` [s] exceed it: the error of
    /// contacts of a few steps falls with the square of the step. `most_moving` is the largest kinetic and elastic energy
    /// of the run, for runs that dissipate less [J].
    pub fn step_that_balances(&self, most_moving: f64, dt: f64) -> Option<f64> {
        let part = self.part_missing(most_moving).abs();
        (part > MAY_MISS).then(|| dt * (MAY_MISS / part).sqrt())
    }

    /// A warning about a large energy error with steps of `dt` [s], with a step that helps, if one can. Steps that are
    /// short against the stable `limit` [s] hardly cause so large an error.
    pub fn poor_balance(&self, most_moving: f64, dt: f64, limit: Option<f64>) -> Option<String> {
        let enough = self.step_that_balances(most_moving, dt)?;
        let what = self.what_is_missing(most_moving);
        let of_limit = limit.map_or(f64::INFINITY, |limit| dt / limit);
        Some(if self.part_missing(most_moving).abs() < 4.0 * of_limit * of_limit {
            format!(
                "{what}. If contacts last too few steps, a step of {enough:.1e} s would reduce the error to about {} \
                 %. {AT_ONCE} cause the same error with any step",
                100.0 * MAY_MISS
            )
        } else {
            format!(
                "{what}. Steps of {:.2} % of the stable limit hardly cause this: a shorter step will not help. \
                 {AT_ONCE} do",
                100.0 * of_limit
            )
        })
    }

    /// Text about the energy error and its reference. `most_moving` as above [J].
    pub fn what_is_missing(&self, most_moving: f64) -> String {
        let of = if self.dissipated > most_moving {
            "the dissipated energy"
        } else {
            "the largest kinetic and elastic energy"
        };
        let part = self.part_missing(most_moving);
        let verb = if part > 0.0 { "lost" } else { "made" };
        format!("the energy error is {:.2} % of {of}: energy was {verb}", 100.0 * part.abs())
    }

    /// Mean number of contacts of a particle, with walls.
    pub fn coordination(&self) -> f64 {
        let free = self.particles - self.held;
        if free == 0 {
            return 0.0;
        }
        (2 * self.contacts + self.wall_contacts) as f64 / free as f64
    }
}

/// Index of a sum.
#[derive(Clone, Copy)]
enum SumIndex {
    Translation,
    Rotation,
    Gravity,
    Stored,
    StepEnergy,
    Dissipated,
    Received,
    NormalForce,
    /// Resultant force on a particle: its contacts and gravity.
    Resultant,
    /// Force of a contact, including its tangential part.
    ContactForce,
    /// First of [`Quantity::CHANNELS`].
    FirstChannel,
}

/// First sum of forces on walls.
const FIRST_WALL: usize = SumIndex::FirstChannel as usize + Quantity::CHANNELS.len();

/// Measures the whole system at the end of a step of `dt` [s]. Collective.
pub fn measure(
    particles: &Particles,
    contacts: &Contacts,
    law: &dyn ForceLaw,
    moments_at_walls: &[Vec3],
    field: &Field,
    dt: f64,
    comm: &mut dyn Comm,
) -> Measures {
    let walls = particles.walls.len();
    let mut totals = Totals::new(walls, particles);
    let mut at_walls = moments_at_walls.iter();
    for slot in 0..particles.owned {
        totals.add_particle(particles, slot, field, dt);
    }
    // A contact counts on the rank that owns its first particle.
    for contact in contacts.loaded(law, particles) {
        let moment =
            if particles.wall_of(contact.pair.b).is_some() { at_walls.next() } else { None };
        totals.add_to_groups(&contact, particles);
        if !particles.is_owned(contact.pair.a) {
            continue;
        }
        totals.add_contact(&contact, law, particles);
        totals.add_torque(&contact, moment, particles);
        totals.add_work_ahead(&contact, particles, dt);
    }
    totals.combine(comm);
    let strained = particles.cell.strained();
    let bulk = particles.cell.moves().then(|| Bulk {
        strain: particles.cell.shear().map_or(0.0, |Shear { strain, .. }| strain),
        strains: strained.map(|Strained { strain, .. }| COMPONENTS.map(|[i, j]| -strain[(i, j)])),
        of_contacts: totals.stress(0, &particles.cell),
        of_motion: totals.stress(1, &particles.cell),
        solid_fraction: totals.volume(&particles.cell),
    });
    let groups = particles.groups.len();
    let of_groups =
        |first: usize| totals.of_walls(totals.groups.map(|all| all + 3 * first), groups);
    let (group_forces, group_torques) = (of_groups(0), of_groups(groups));
    Measures { group_forces, group_torques, bulk, ..totals.measures(walls) }
}

/// Sums, counts and maxima of the owned particles, then of all ranks.
struct Totals {
    sums: Vec<ExactSum>,
    /// Number of terms of each sum that were not finite: energies of finite numbers may overflow.
    infinite: Vec<i64>,
    /// Particles, contacts between particles, contacts with walls, held particles.
    counts: [i64; 4],
    /// Overlap over the shortest axis [-], speed [m/s], height [m].
    maxima: [f64; 3],
    /// First sum of stresses, followed by that of volumes, if there are any.
    stresses: Option<usize>,
    /// First sum of torques on walls, if there are any.
    torques: Option<usize>,
    /// First sum of powers of belts, if there are any.
    belts: Option<usize>,
    /// First sum of forces on groups, followed by those of torques, if there are any.
    groups: Option<usize>,
}

impl Totals {
    fn new(walls: usize, particles: &Particles) -> Self {
        let mut count = FIRST_WALL + 3 * walls;
        let mut more = |is_there: bool, how_many: usize| {
            let first = is_there.then_some(count);
            count += if is_there { how_many } else { 0 };
            first
        };
        let stresses = more(particles.cell.moves(), 2 * COMPONENTS.len() + 1);
        let torques = more(particles.facets.any_torque, 3 * walls);
        let belts = more(particles.walls.iter().any(Wall::is_belt), walls);
        let groups = more(!particles.groups.is_empty(), 6 * particles.groups.len());
        Self {
            sums: vec![ExactSum::default(); count],
            infinite: vec![0; count],
            counts: [0; 4],
            maxima: [0.0, 0.0, f64::NEG_INFINITY],
            stresses,
            torques,
            belts,
            groups,
        }
    }

    /// Adds the symmetric part of a product to the stress [J] of contacts (`kind` 0) or of motion (1).
    fn add_stress(&mut self, kind: usize, product: impl Fn(usize, usize) -> f64) {
        let Some(first) = self.stresses else { return };
        for (k, [i, j]) in COMPONENTS.into_iter().enumerate() {
            let both = 0.5 * (product(i, j) + product(j, i));
            self.add_at(first + kind * COMPONENTS.len() + k, both);
        }
    }

    /// Stress of contacts (`kind` 0) or of motion (1) [Pa].
    fn stress(&self, kind: usize, cell: &Cell) -> [f64; 6] {
        let first = self.stresses.unwrap_or_default() + kind * COMPONENTS.len();
        std::array::from_fn(|k| self.value_at(first + k) / cell.volume())
    }

    /// Adds to the volume of all particles [m³].
    fn add_volume(&mut self, volume: impl Fn() -> f64) {
        let Some(first) = self.stresses else { return };
        self.add_at(first + 2 * COMPONENTS.len(), volume());
    }

    /// Volume of all particles over that of the cell [-].
    fn volume(&self, cell: &Cell) -> f64 {
        self.stresses.map_or(0.0, |first| self.value_at(first + 2 * COMPONENTS.len()))
            / cell.volume()
    }

    fn add(&mut self, of: SumIndex, term: f64) {
        self.add_at(of as usize, term);
    }

    fn add_at(&mut self, of: usize, term: f64) {
        if term.is_finite() {
            self.sums[of].add(term);
        } else {
            self.infinite[of] += 1;
        }
    }

    fn add_particle(&mut self, particles: &Particles, slot: usize, field: &Field, dt: f64) {
        self.counts[0] += 1;
        self.add(SumIndex::Dissipated, particles.accumulated[Quantity::Dissipated][slot]);
        for (of, quantity) in (SumIndex::FirstChannel as usize..).zip(Quantity::CHANNELS) {
            if let Some(energy) = particles.accumulated[quantity].get(slot) {
                self.add_at(of, *energy);
            }
        }
        self.add(SumIndex::Received, particles.accumulated[Quantity::Received][slot]);
        self.add_volume(|| particles.volume(slot));
        let top = particles.position[slot].z + particles.radius(slot);
        self.maxima[2] = larger_number(self.maxima[2], top);
        if particles.is_held(slot) {
            self.counts[3] += 1;
            self.add_torque_on_group(particles, slot);
            return;
        }
        let mass = particles.mass(slot);
        let velocity = particles.velocity[slot];
        self.add(SumIndex::Resultant, field.force(particles, slot).norm());
        self.add(SumIndex::Translation, 0.5 * mass * velocity.norm_squared());
        self.add(SumIndex::Gravity, -mass * unwrapped(particles, slot).dot(&field.gravity));
        self.add(SumIndex::Rotation, rotation(particles, slot));
        self.add(SumIndex::StepEnergy, motion::step_energy(particles, slot, field, dt));
        if self.stresses.is_some() {
            let own = velocity - particles.cell.flow_at(&particles.position[slot]);
            self.add_stress(1, |i, j| mass * own[i] * own[j]);
        }
        self.maxima[1] = larger_number(self.maxima[1], velocity.norm());
    }

    /// Adds the torque of contacts on a held particle about the reference point of its group, if the group turns.
    fn add_torque_on_group(&mut self, particles: &Particles, slot: usize) {
        let (Some(first), Some(group)) = (self.groups, particles.group_of(slot)) else { return };
        let Some(about) = particles.groups[group].about else { return };
        let own = particles.spin.as_ref().map_or_else(Vec3::zeros, |spin| spin.torque[slot].vector);
        let arm = particles.position[slot] - about;
        let torque = own + arm.cross(&particles.force[slot].vector);
        let first = first + 3 * (particles.groups.len() + group);
        for axis in 0..3 {
            self.add_at(first + axis, torque[axis]);
        }
    }

    /// Adds the force of a contact to the groups of its owned particles.
    fn add_to_groups(&mut self, contact: &Loaded, particles: &Particles) {
        let Some(first) = self.groups else { return };
        for (slot, sign) in [(contact.pair.a, -1.0), (contact.pair.b, 1.0)] {
            let Some(group) = particles.group_of(particles.body_of(slot).index()) else { continue };
            for axis in 0..3 {
                self.add_at(first + 3 * group + axis, sign * contact.force[axis]);
            }
        }
    }

    fn add_contact(&mut self, contact: &Loaded, law: &dyn ForceLaw, particles: &Particles) {
        let &Loaded { pair, geometry, state, normal_force, force, .. } = contact;
        let Pair { a, b } = pair;
        self.add(SumIndex::Stored, law.stored(pair, particles, geometry, state));
        self.add(SumIndex::ContactForce, force.norm());
        if self.stresses.is_some() {
            let branch = particles.bodies().relative(particles.bodies_of(pair));
            self.add_stress(0, |i, j| force[i] * branch[j]);
        }
        let overlap = geometry.overlap / shortest_axis(particles, a, b);
        self.maxima[0] = larger_number(self.maxima[0], overlap);
        if let Some(wall) = particles.wall_of(b) {
            self.counts[2] += 1;
            for axis in 0..3 {
                self.add_at(FIRST_WALL + 3 * wall + axis, force[axis]);
            }
            if let Some(first) = self.belts {
                self.add_at(first + wall, -force.dot(&particles.belt_at(b, &geometry.normal)));
            }
        } else if [a, b].iter().any(|&slot| particles.is_held(particles.body_of(slot).index())) {
            self.counts[2] += 1;
        } else {
            self.counts[1] += 1;
            self.add(SumIndex::NormalForce, normal_force);
        }
    }

    /// Adds the torque on a wall about its reference point. `moment` is that on the particle about its centre [N m], if
    /// particles turn; about a common point the two are opposite.
    fn add_torque(&mut self, contact: &Loaded, moment: Option<&Vec3>, particles: &Particles) {
        let Some(first) = self.torques else { return };
        let Some(wall) = particles.wall_of(contact.pair.b) else { return };
        let moment = moment.copied().unwrap_or_else(|| contact.force.cross(&contact.point));
        let to_wall = particles.bodies().relative(contact.pair);
        let torque = -to_wall.cross(&contact.force) - moment;
        for axis in 0..3 {
            self.add_at(first + 3 * wall + axis, torque[axis]);
        }
    }

    /// Subtracts the work of sliding images that belongs to the first half of the next step.
    fn add_work_ahead(&mut self, contact: &Loaded, particles: &Particles, dt: f64) {
        if self.stresses.is_some() {
            let work = particles.work_on_image(contact.pair, &contact.force, [0.0, 0.5 * dt]);
            self.add(SumIndex::Received, work);
        }
    }

    /// Combines the sums over all ranks. Collective.
    fn combine(&mut self, comm: &mut dyn Comm) {
        let mut numbers: Vec<i64> =
            self.sums.iter().flat_map(|sum| sum.limbs().iter().copied()).collect();
        numbers.extend(&self.infinite);
        numbers.extend(self.counts);
        comm.sum(&mut numbers);
        comm.max(&mut self.maxima);
        let (limbs, rest) = numbers.split_at(self.sums.len() * ExactSum::LIMBS);
        let (infinite, counts) = rest.split_at(self.sums.len());
        self.sums = limbs.chunks_exact(ExactSum::LIMBS).map(ExactSum::from_limbs).collect();
        self.infinite.copy_from_slice(infinite);
        self.counts.copy_from_slice(counts);
    }

    fn value(&self, of: SumIndex) -> f64 {
        self.value_at(of as usize)
    }

    fn value_at(&self, of: usize) -> f64 {
        if self.infinite[of] == 0 { self.sums[of].value() } else { f64::NAN }
    }

    /// Vectors of walls from a first sum on; 0 if they were not summed.
    fn of_walls(&self, first: Option<usize>, walls: usize) -> Vec<Vec3> {
        let vector = |first: usize| Vec3::from_fn(|axis, _| self.value_at(first + axis));
        (0..walls).map(|k| first.map_or_else(Vec3::zeros, |first| vector(first + 3 * k))).collect()
    }

    fn measures(&self, walls: usize) -> Measures {
        let [particles, contacts, wall_contacts, held] = self.counts;
        let free = particles - held;
        let contact_force = self.value(SumIndex::ContactForce);
        Measures {
            particles: particles as u64,
            held: held as u64,
            contacts: contacts as u64,
            wall_contacts: wall_contacts as u64,
            translation: self.value(SumIndex::Translation),
            rotation: self.value(SumIndex::Rotation),
            gravity: self.value(SumIndex::Gravity),
            stored: self.value(SumIndex::Stored),
            step_energy: self.value(SumIndex::StepEnergy),
            dissipated: self.value(SumIndex::Dissipated),
            channels: std::array::from_fn(|k| self.value_at(SumIndex::FirstChannel as usize + k)),
            received: self.value(SumIndex::Received),
            mean_normal_force: if contacts == 0 {
                0.0
            } else {
                self.value(SumIndex::NormalForce) / contacts as f64
            },
            unbalanced: if contact_force > 0.0 && free > 0 {
                let among = ((contacts + wall_contacts) as f64).max(free as f64);
                self.value(SumIndex::Resultant) * among / (contact_force * free as f64)
            } else {
                0.0
            },
            largest_overlap: self.maxima[0],
            largest_speed: self.maxima[1],
            top: self.maxima[2],
            wall_forces: self.of_walls(Some(FIRST_WALL), walls),
            wall_torques: self.of_walls(self.torques, walls),
            belt_powers: (0..walls)
                .map(|wall| self.belts.map_or(0.0, |first| self.value_at(first + wall)))
                .collect(),
            group_forces: Vec::new(),
            group_torques: Vec::new(),
            bulk: None,
        }
    }
}

/// Kinetic and potential energy of an owned particle; 0 for a held one [J].
pub fn free_energy(particles: &Particles, slot: usize, field: &Field) -> f64 {
    if particles.is_held(slot) {
        return 0.0;
    }
    let mass = particles.mass(slot);
    let translation = 0.5 * mass * particles.velocity[slot].norm_squared();
    let gravity = -mass * unwrapped(particles, slot).dot(&field.gravity);
    translation + gravity + rotation(particles, slot)
}

/// Kinetic energy of rotation of an owned particle [J].
fn rotation(particles: &Particles, slot: usize) -> f64 {
    0.5 * particles.angular_velocity(slot).dot(&particles.angular_momentum(slot))
}

/// Shortest axis of the smaller of two bodies, a diameter [m].
pub fn shortest_axis(particles: &Particles, a: Slot, b: Slot) -> f64 {
    let radius = |slot: Slot| particles.inscribed_radius(slot.index());
    2.0 * radius(a).min(radius(b))
}

/// Position of a particle without periodic wrapping [m].
pub fn unwrapped(particles: &Particles, slot: usize) -> Vec3 {
    let position = particles.position[slot];
    if particles.needs.image {
        particles.cell.unwrapped(position, &particles.image[slot])
    } else {
        position
    }
}
