//! Conversion between a running simulation and the tables of a snapshot.

use super::Simulation;
use crate::comm::{Comm, Parcel, wire};
use crate::contact::{ContactRecord, ContactRecords, Pair, StateColumn};
use crate::contacts::Loaded;
use crate::drive::{DriveError, Restart, SavedState, all_observers};
use crate::ids::{GlobalId, Rank, ShapeId, Standing};
use crate::math::{Quat, Vec3};
use crate::motion;
use crate::output::header::{Header, ShapeRow, WallRow};
use crate::output::tables::{ContactRecordRows, ContactRow, ContactTable, ParticleTable, Rows};
use crate::particles::Particles;
use crate::particles::records::Particle;
use crate::shape::Kind;
use nalgebra::Quaternion;
use std::collections::{BTreeMap, BTreeSet};

/// Touching contacts whose first particle this rank owns.
struct FirstOwned<'a>(&'a Simulation);

impl FirstOwned<'_> {
    fn is_one(&self, pair: Pair) -> bool {
        self.0.particles.is_owned(pair.a)
    }

    fn how_many(&self) -> usize {
        self.0.contacts.iter().filter(|&(pair, _)| self.is_one(pair)).count()
    }
}

impl Rows<ContactRow> for FirstOwned<'_> {
    fn count(&self) -> usize {
        self.how_many()
    }

    fn each(&self, take: &mut dyn FnMut(&ContactRow)) {
        let Simulation { particles, contacts, law, .. } = self.0;
        let own = contacts.loaded(&**law, particles).filter(|contact| self.is_one(contact.pair));
        own.for_each(|contact| take(&row_of(&contact, particles)));
    }
}

/// Row of a contact between bodies: for pieces of unions that of their bodies, from the one with the lower id.
fn row_of(contact: &Loaded, particles: &Particles) -> ContactRow {
    let Loaded { pair: Pair { a, b }, geometry, normal_force, force, point, .. } = *contact;
    let whole = Pair { a: particles.body_of(a), b: particles.body_of(b) };
    let [of_a, of_b] = [whole.a, whole.b].map(|slot| particles.id[slot.index()]);
    let centre = particles.position[whole.a.index()];
    let point = point + (particles.position[a.index()] - centre);
    let with_wall = b.index() >= particles.first_facet();
    let row = ContactRow {
        a: of_a,
        b: of_b,
        centre,
        branch: if with_wall { point } else { particles.bodies().relative(whole) },
        point: centre + point,
        normal: geometry.normal,
        overlap: geometry.overlap,
        normal_force,
        shear_force: force - geometry.normal * normal_force,
    };
    if of_a < of_b {
        return row;
    }
    ContactRow {
        a: of_b,
        b: of_a,
        centre: particles.position[whole.b.index()],
        branch: -row.branch,
        normal: -row.normal,
        shear_force: -row.shear_force,
        ..row
    }
}

impl ContactRecordRows for FirstOwned<'_> {
    fn columns(&self) -> &[StateColumn] {
        self.0.contacts.remembered()
    }

    fn count(&self) -> usize {
        self.how_many()
    }

    fn each(&self, take: &mut dyn FnMut(&ContactRecord)) {
        for (pair, named) in self.0.contacts.named(&self.0.particles) {
            if self.is_one(pair) {
                take(&named);
            }
        }
    }
}

impl Simulation {
    /// Header of a snapshot of this moment. `scene` is the scene's text, `wall_forces` comes from
    /// [`crate::measure::Measures`] [N]. Collective, if there are drives.
    pub fn header(&self, scene: &str, wall_forces: &[Vec3], comm: &mut dyn Comm) -> Header {
        let library = &self.particles.library;
        Header {
            step: self.step,
            time: self.time(),
            dt: self.dt,
            stage_begin: self.stage_begin,
            stage_shift: self.stage_shift,
            next_id: self.next_id,
            departed: self.departed,
            most_moving: self.most_moving,
            stop: String::new(),
            cell: self.particles.cell,
            gravity: self.field.gravity,
            walls: self
                .particles
                .walls
                .iter()
                .zip(wall_forces)
                .map(|(wall, &force)| {
                    let (point, normal) = wall.surface();
                    let (name, velocity) = (wall.name.clone(), wall.velocity);
                    WallRow { name, point, normal, velocity, force, body: wall.saved() }
                })
                .collect(),
            triangles: self
                .particles
                .walls
                .iter()
                .filter_map(|wall| wall.mesh.as_ref())
                .flat_map(|mesh| mesh.surface.triangles())
                .map(|[a, b, c]| [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z])
                .collect(),
            drives: self.saved_drives(comm),
            shapes: (0..library.own_shapes())
                .map(|k| ShapeRow {
                    name: library.names[k].clone(),
                    kind: library.shapes[k].kind().name().to_owned(),
                    semi_axes: library.shapes[k].semi_axes(),
                    volume: library.shapes[k].volume(),
                    mass: library.mass[k],
                    inertia: library.inertia[k],
                    scales: library.scales[k],
                    most: library.most_of(ShapeId(k as u16)),
                    geometry: Some(library.shapes[k].clone()).filter(|s| s.kind() != Kind::Other),
                })
                .collect(),
            scene: scene.to_owned(),
        }
    }

    /// States of all drives and observers that have one. Collective, if there are any.
    fn saved_drives(&self, comm: &mut dyn Comm) -> Vec<SavedState> {
        let walls = &self.particles.walls;
        let saved = self.all_observers().map(|observer| SavedState {
            drive: observer.name().to_owned(),
            columns: observer.save(walls, comm),
        });
        saved.filter(|saved| !saved.columns.is_empty()).collect()
    }

    /// Restores each drive and observer from the saved state of its name. One without a saved state stays
    /// unchanged in a new stage, and may refuse within a stage.
    ///
    /// # Errors
    /// If a drive cannot go on from it.
    pub fn resume_drives(
        &mut self,
        saved: &[SavedState],
        is_new_stage: bool,
        comm: &dyn Comm,
    ) -> Result<(), DriveError> {
        let Particles { library, walls, .. } = &mut self.particles;
        let is_root = comm.is_root();
        for observer in all_observers(&mut self.drives, &mut self.observers) {
            match saved.iter().find(|saved| saved.drive == observer.name()) {
                Some(saved) => {
                    let restart = Restart { saved, is_new_stage, library, is_root };
                    observer.resume(&restart, walls)?;
                }
                None if is_new_stage => {}
                None => observer.joins()?,
            }
        }
        Ok(())
    }

    /// Owned particles.
    pub fn particle_table(&self, rank: Rank) -> ParticleTable {
        let particles = &self.particles;
        let owned = 0..particles.owned;
        let mut table = ParticleTable {
            id: particles.id[owned.clone()].to_vec(),
            shape: (particles.shape[owned.clone()].iter())
                .map(|&shape| particles.library.free(shape))
                .collect(),
            group: particles.group.clone(),
            scale: particles.scale.get(owned.clone()).unwrap_or_default().to_vec(),
            position: particles.position[owned.clone()].to_vec(),
            velocity: particles.velocity[owned.clone()].to_vec(),
            force: particles.force.iter().map(|row| row.vector).collect(),
            coordination: self.contacts.coordination(particles),
            rank: vec![rank.0 as i32; particles.owned],
            accumulated: particles.accumulated.clone(),
            standing: particles.standing[owned.clone()].to_vec(),
            image: particles.image.clone(),
            velocity_ahead: particles
                .ahead
                .velocity
                .get(owned.clone())
                .unwrap_or_default()
                .to_vec(),
            angular_velocity_ahead: particles
                .ahead
                .angular_velocity
                .get(owned.clone())
                .unwrap_or_default()
                .to_vec(),
            ..ParticleTable::default()
        };
        if let Some(orientation) = &particles.orientation {
            table.quaternion = orientation.quaternion[owned.clone()]
                .iter()
                .map(|q| [q.w, q.i, q.j, q.k])
                .collect();
        }
        if let Some(spin) = &particles.spin {
            table.angular_momentum = owned.clone().map(|s| particles.angular_momentum(s)).collect();
            table.angular_velocity = owned.map(|s| particles.angular_velocity(s)).collect();
            table.torque = spin.torque.iter().map(|row| row.vector).collect();
        }
        table
    }

    /// Contacts whose first particle this rank owns.
    pub fn contact_table(&self) -> ContactTable {
        let mut table = ContactTable::default();
        self.contact_rows().each(&mut |row| table.push(row));
        table
    }

    /// Rows of [`Simulation::contact_table`].
    pub const fn contact_rows(&self) -> impl Rows<ContactRow> {
        FirstOwned(self)
    }

    /// Records of the touching contacts whose first particle this rank owns.
    pub fn contact_records(&self) -> ContactRecords {
        let rows = self.contact_record_rows();
        let mut records = ContactRecords::of(rows.columns());
        rows.each(&mut |row| records.push(row));
        records
    }

    /// Rows of [`Simulation::contact_records`].
    pub const fn contact_record_rows(&self) -> impl ContactRecordRows {
        FirstOwned(self)
    }

    /// Restores a state from a snapshot: on each rank any part of its particles and records, which go to their owners.
    /// Forces come from the snapshot, so the next step continues without a difference. Collective.
    pub fn take_up(
        &mut self,
        particles: &[Particle],
        records: &ContactRecords,
        comm: &mut dyn Comm,
    ) {
        self.particles.strip_to_owned();
        for particle in particles {
            self.particles.push_owned(particle);
        }
        motion::bring_back(&mut self.particles);
        let work = vec![1; self.particles.owned];
        self.domain.recut(&self.particles, &work, comm);
        self.domain.migrate(&mut self.particles, &self.contacts, &BTreeSet::new(), comm);
        let owned = &self.particles.id[..self.particles.owned];
        let records = records.with_columns(self.contacts.remembered());
        let carried = records_to_owners(owned, &records, comm);
        self.relist(&carried, comm);
    }
}

/// Sends each record to the owners of both its particles, through a directory that is distributed over all ranks by id: no
/// rank holds more than its share. Collective.
fn records_to_owners(
    owned: &[GlobalId],
    records: &ContactRecords,
    comm: &mut dyn Comm,
) -> ContactRecords {
    let size = u64::from(comm.size());
    let home = |id: GlobalId| Rank((id.0 % size) as u32);

    let mut entries: BTreeMap<Rank, Vec<GlobalId>> = BTreeMap::new();
    for &id in owned {
        entries.entry(home(id)).or_default().push(id);
    }
    let mut directory = BTreeMap::new();
    for parcel in comm.route(to_parcels(entries)) {
        for id in wire::decode::<Vec<GlobalId>>(&parcel.bytes) {
            directory.insert(id, parcel.rank);
        }
    }

    // By rank of the directory: ids and rows to ask for.
    let none = || (Vec::new(), ContactRecords::of(records.columns()));
    let mut asked: BTreeMap<Rank, (Vec<GlobalId>, ContactRecords)> = BTreeMap::new();
    for named in records.iter() {
        for id in [named.a, named.b] {
            if id.wall_index().is_none() {
                let id = id.body();
                let (ids, rows) = asked.entry(home(id)).or_insert_with(none);
                ids.push(id);
                rows.push(&named);
            }
        }
    }
    let none = || ContactRecords::of(records.columns());
    let mut forwarded: BTreeMap<Rank, ContactRecords> = BTreeMap::new();
    for parcel in comm.route(to_parcels(asked)) {
        let (ids, rows): (Vec<GlobalId>, ContactRecords) = wire::decode(&parcel.bytes);
        for (id, named) in ids.iter().zip(rows.iter()) {
            if let Some(&owner) = directory.get(id) {
                forwarded.entry(owner).or_insert_with(none).push(&named);
            }
        }
    }
    let mut mine = none();
    for parcel in comm.route(to_parcels(forwarded)) {
        mine.append(&wire::decode(&parcel.bytes));
    }
    mine
}

fn to_parcels<T: serde::Serialize>(by_rank: BTreeMap<Rank, T>) -> Vec<Parcel> {
    by_rank
        .into_iter()
        .map(|(rank, values)| Parcel { rank, bytes: wire::encode(&values) })
        .collect()
}

/// Particles of a table; `shape_of` translates the snapshot's shapes into the scene's.
pub fn particles_of(table: &ParticleTable, shape_of: impl Fn(ShapeId) -> ShapeId) -> Vec<Particle> {
    let vector = |column: &[Vec3], row: usize| column.get(row).copied().unwrap_or_default();
    (0..table.id.len())
        .map(|row| Particle {
            id: table.id[row],
            shape: shape_of(table.shape[row]),
            scale: table.scale_of(row),
            group: table.group.get(row).copied().unwrap_or_default(),
            position: table.position[row],
            velocity: table.velocity[row],
            force: table.force[row],
            accumulated: table.accumulated.row(row),
            standing: table.standing.get(row).copied().unwrap_or(Standing::LAST),
            image: table.image.get(row).copied().unwrap_or_default(),
            // Exact bits, not normalised again.
            quaternion: table.quaternion.get(row).map_or_else(Quat::identity, |&[w, x, y, z]| {
                Quat::new_unchecked(Quaternion::new(w, x, y, z))
            }),
            angular_momentum: vector(&table.angular_momentum, row),
            angular_velocity: vector(&table.angular_velocity, row),
            ahead: [&table.velocity_ahead, &table.angular_velocity_ahead]
                .map(|column| vector(column, row)),
            torque: vector(&table.torque, row),
        })
        .collect()
}
