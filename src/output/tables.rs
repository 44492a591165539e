//! Content of a snapshot as plain tables, shared by the run that writes, the restart that reads and the post-processor.
//!
//! A column is a field of [`ParticleTable`] or [`ContactTable`] and is declared once, in [`PARTICLE_COLUMNS`] or
//! [`CONTACT_COLUMNS`]. A quantity that accumulates over the life of a particle is declared as a [`Quantity`] alone. Writing,
//! reading, comparing and the bytes of `--plan` follow from these declarations.
//!
//! # Files
//!
//! A snapshot is two HDF5 files, each valid VTKHDF `PolyData` of one part: `particles_<step>.vtkhdf` (vertices) and
//! `contacts_<step>.vtkhdf` (lines). Particles are ordered by id, contacts by the id of A, then of B. The order does not depend
//! on the number of ranks; only the column `rank` does. A column that the scene does not need is absent.
//!
//! Both files carry the groups `/run`, `/domain`, `/walls`, `/shapes` ([`super::header::Header`]). Each drive that saves its
//! state has a group with its name, such as `/rain`. The particles file also carries `/restart` with the data that only a restart
//! needs.
//!
//! - `/shapes/geometry`: geometry of each shape, a JSON text.
//! - `/walls/body`: a JSON text for walls that turn or have several planes, with reference point, orientation (i, j, k, w),
//!   angular velocity, and planes in the axes of the wall.
//! - `/shapes/scales`: smallest and largest scale of each shape for which the stage has made room. A continued stage takes time
//!   step and skin from them, even if such particles have left.
//! - `/shapes/most`: largest possible number of particles of each shape, infinite if unknown. The stable time step follows from
//!   it.
//!
//! | place | rows | content |
//! |---|---|---|
//! | particles `/VTKHDF/Points` | particles × 3 | centres [m] |
//! | particles `/VTKHDF/PointData/<name>` | particles | the other columns of [`ParticleTable`] that a picture shows; the attribute `order` of `quaternion` is `w, x, y, z` |
//! | particles `/restart/particles/<name>` | particles | `standing` in the order of space ([`crate::particles::order`]), `angular_momentum`, `velocity_ahead`, `angular_velocity_ahead`, `image`, and each [`Quantity`] under its name |
//! | particles `/restart/contacts/<name>` | touching pairs | `a`, `b`, `normal`, `overlap`, and the state of the contact law under its names |
//! | contacts `/VTKHDF/Points` | 2 per contact × 3 | centre of A; centre of B's nearest image, or the foot on the wall [m] |
//! | contacts `/VTKHDF/CellData/<name>` | contacts | the columns of [`ContactTable`] |

use super::SnapshotError;
use super::columns::{Numbers, Value, column};
use super::hdf5::{Piece, SnapshotFile};
use super::order::Order;
use crate::contact::{ContactRecord, ContactRecords, StateColumn};
use crate::ids::{GlobalId, ShapeId, Standing};
use crate::math::Vec3;
use crate::particles::Needs;
use crate::particles::columns::{Accumulated, Presence, Quantity};
use std::borrow::Cow;
use std::sync::LazyLock;

// --- particles ---

/// Particles of a snapshot, of a piece of it or of a rank: columns of one length. An optional column that the scene does not need
/// is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ParticleTable {
    /// Permanent id.
    pub id: Vec<GlobalId>,
    /// Shape, an index into [`super::header::Header::shapes`].
    pub shape: Vec<ShapeId>,
    /// Lengths over those of the shape [-]. Optional: absent if all particles are as large as their shapes.
    pub scale: Vec<f64>,
    /// Number of the group, from 1 in the order of the scene; 0 for particles in none. Optional: absent if the scene has no
    /// groups.
    pub group: Vec<u16>,
    /// Centre [m].
    pub position: Vec<Vec3>,
    /// Velocity at the time of `position` [m/s].
    pub velocity: Vec<Vec3>,
    /// Sum of the contact forces at `position` and of the forces applied to groups, without gravity and damping [N].
    pub force: Vec<Vec3>,
    /// Number of contacts with particles and walls.
    pub coordination: Vec<i32>,
    /// Rank that owned the particle.
    pub rank: Vec<i32>,
    /// Quantities accumulated over the life of each particle. Optional where a [`Quantity`] is.
    pub accumulated: Accumulated<Vec<f64>>,
    /// Place in the order of space. Optional: tables that no run made need not have it.
    pub standing: Vec<Standing>,
    /// Whole periods added to `position` to follow the particle through a periodic domain. Optional.
    pub image: Vec<[i32; 3]>,
    /// Orientation (w, x, y, z), body to world. Optional: absent if all are spheres.
    pub quaternion: Vec<[f64; 4]>,
    /// Angular momentum at the time of `position`, world axes [kg m²/s]. Optional.
    pub angular_momentum: Vec<Vec3>,
    /// Angular velocity at the time of `position`, world axes [rad/s]. Optional, with `angular_momentum`.
    pub angular_velocity: Vec<Vec3>,
    /// Moment at `position`, world axes [N m]. Optional, with `angular_momentum`.
    pub torque: Vec<Vec3>,
    /// Predicted change of the velocity ([`crate::motion::ahead`]) [m/s]. Optional.
    pub velocity_ahead: Vec<Vec3>,
    /// Predicted change of the angular velocity, world axes [rad/s]. Optional.
    pub angular_velocity_ahead: Vec<Vec3>,
}

impl ParticleTable {
    /// Lengths of a particle over those of its shape [-].
    pub fn scale_of(&self, row: usize) -> f64 {
        self.scale.get(row).copied().unwrap_or(1.0)
    }

    /// Volume, and so mass, of a particle over that of its shape [-].
    pub fn volume_ratio(&self, row: usize) -> f64 {
        self.scale_of(row).powi(3)
    }

    /// All columns in bytes, to be sent to another rank.
    pub(super) fn bytes(&self) -> Vec<Vec<u8>> {
        PARTICLE_COLUMNS.iter().map(|column| column.of(self).bytes()).collect()
    }

    /// Adds the rows of another rank.
    pub(super) fn append(&mut self, columns: &[Vec<u8>]) {
        for (column, bytes) in PARTICLE_COLUMNS.iter().zip(columns) {
            column.of_mut(self).add_rows(bytes);
        }
    }
}

/// A column of the particles file.
pub struct ParticleColumn {
    /// Name in messages.
    pub name: &'static str,
    /// Path in the file, from `/`. Columns of one group are consecutive.
    pub place: Cow<'static, str>,
    /// Unit of the numbers; `1` for a pure number.
    pub unit: &'static str,
    /// Condition under which the column exists. A column that always exists counts as present without rows, too.
    pub presence: Presence,
    /// Place of the values in a table.
    values: Storage,
}

/// Place of the values of a column in a table.
enum Storage {
    /// A field of the table, for reading and for filling.
    Own(fn(&ParticleTable) -> &dyn Numbers, fn(&mut ParticleTable) -> &mut dyn Numbers),
    /// One of the accumulated quantities.
    Accumulated(Quantity),
}

/// All columns, in the order in which they are written.
pub static PARTICLE_COLUMNS: LazyLock<Vec<ParticleColumn>> = LazyLock::new(|| {
    let accumulated = Quantity::ALL.map(ParticleColumn::of_quantity);
    shown().into_iter().chain(accumulated).chain(of_restart()).collect()
});

/// Name of the column of orientations.
pub const QUATERNION: &str = "quaternion";

/// Columns that a picture shows.
fn shown() -> [ParticleColumn; 12] {
    let always = Presence::Always;
    [
        own("position", "/VTKHDF/Points", "m", always, |t| &t.position, |t| &mut t.position),
        own("id", "/VTKHDF/PointData/id", "1", always, |t| &t.id, |t| &mut t.id),
        own("shape", "/VTKHDF/PointData/shape", "1", always, |t| &t.shape, |t| &mut t.shape),
        own(
            "scale",
            "/VTKHDF/PointData/scale",
            "1",
            Presence::If(|needs| needs.scale),
            |t| &t.scale,
            |t| &mut t.scale,
        ),
        own(
            "group",
            "/VTKHDF/PointData/group",
            "1",
            Presence::If(|needs| needs.group),
            |t| &t.group,
            |t| &mut t.group,
        ),
        own(
            QUATERNION,
            "/VTKHDF/PointData/quaternion",
            "1",
            Presence::If(|needs| needs.orientation),
            |t| &t.quaternion,
            |t| &mut t.quaternion,
        ),
        own(
            "velocity",
            "/VTKHDF/PointData/velocity",
            "m/s",
            always,
            |t| &t.velocity,
            |t| &mut t.velocity,
        ),
        own(
            "angular_velocity",
            "/VTKHDF/PointData/angular_velocity",
            "rad/s",
            Presence::If(|needs| needs.spin),
            |t| &t.angular_velocity,
            |t| &mut t.angular_velocity,
        ),
        own("force", "/VTKHDF/PointData/force", "N", always, |t| &t.force, |t| &mut t.force),
        own(
            "torque",
            "/VTKHDF/PointData/torque",
            "N m",
            Presence::If(|needs| needs.spin),
            |t| &t.torque,
            |t| &mut t.torque,
        ),
        own(
            "coordination",
            "/VTKHDF/PointData/coordination",
            "1",
            always,
            |t| &t.coordination,
            |t| &mut t.coordination,
        ),
        own("rank", "/VTKHDF/PointData/rank", "1", always, |t| &t.rank, |t| &mut t.rank),
    ]
}

/// Further columns for a restart.
fn of_restart() -> [ParticleColumn; 5] {
    [
        own(
            "standing",
            "/restart/particles/standing",
            "1",
            Presence::If(|_| true),
            |t| &t.standing,
            |t| &mut t.standing,
        ),
        own(
            "velocity_ahead",
            "/restart/particles/velocity_ahead",
            "m/s",
            Presence::If(|needs| needs.ahead),
            |t| &t.velocity_ahead,
            |t| &mut t.velocity_ahead,
        ),
        own(
            "angular_velocity_ahead",
            "/restart/particles/angular_velocity_ahead",
            "rad/s",
            Presence::If(|needs| needs.ahead && needs.spin),
            |t| &t.angular_velocity_ahead,
            |t| &mut t.angular_velocity_ahead,
        ),
        own(
            "image",
            "/restart/particles/image",
            "1",
            Presence::If(|needs| needs.image),
            |t| &t.image,
            |t| &mut t.image,
        ),
        own(
            "angular_momentum",
            "/restart/particles/angular_momentum",
            "kg m^2/s",
            Presence::If(|needs| needs.spin),
            |t| &t.angular_momentum,
            |t| &mut t.angular_momentum,
        ),
    ]
}

/// A column with a field of its own in the table.
fn own(
    name: &'static str,
    place: &'static str,
    unit: &'static str,
    presence: Presence,
    get: fn(&ParticleTable) -> &dyn Numbers,
    get_mut: fn(&mut ParticleTable) -> &mut dyn Numbers,
) -> ParticleColumn {
    ParticleColumn { name, place: place.into(), unit, presence, values: Storage::Own(get, get_mut) }
}

impl ParticleColumn {
    fn of_quantity(quantity: Quantity) -> Self {
        Self {
            name: quantity.name(),
            place: Cow::Owned(format!("/restart/particles/{}", quantity.name())),
            unit: quantity.unit(),
            presence: quantity.presence(),
            values: Storage::Accumulated(quantity),
        }
    }

    /// Values of the column in a table.
    pub fn of<'a>(&self, table: &'a ParticleTable) -> &'a dyn Numbers {
        match self.values {
            Storage::Own(get, _) => get(table),
            Storage::Accumulated(quantity) => &table.accumulated[quantity],
        }
    }

    /// True if a scene with these needs has the column.
    pub fn is_there(&self, needs: &Needs) -> bool {
        self.presence.holds(needs)
    }

    /// True if a table may leave the column empty.
    pub const fn is_optional(&self) -> bool {
        matches!(self.presence, Presence::If(_))
    }

    /// Path of the group that contains the column.
    pub fn group(&self) -> &str {
        self.place.rsplit_once('/').map_or("", |(group, _)| group)
    }

    /// Fills the column from a file. An optional column that the file does not have stays empty.
    pub(super) fn read(
        &self,
        table: &mut ParticleTable,
        piece: &Piece,
    ) -> Result<(), SnapshotError> {
        if self.is_optional() && !piece.has(&self.place) {
            return Ok(());
        }
        let values = self.of_mut(table);
        values.read(piece, &column(&self.place, self.unit, values))
    }

    fn of_mut<'a>(&self, table: &'a mut ParticleTable) -> &'a mut dyn Numbers {
        match self.values {
            Storage::Own(_, get_mut) => get_mut(table),
            Storage::Accumulated(quantity) => &mut table.accumulated[quantity],
        }
    }

    /// Writes the rows of this rank. Collective.
    pub(super) fn write(
        &self,
        table: &ParticleTable,
        order: &Order,
        file: &mut SnapshotFile,
    ) -> Result<(), SnapshotError> {
        let values = self.of(table);
        values.write(file, &column(&self.place, self.unit, values), order)
    }
}

// --- contacts ---

/// Contacts of a snapshot, or of a piece of it: columns of one length. Each contact appears once, on the rank that owns A.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactTable {
    /// Lower id.
    pub a: Vec<GlobalId>,
    /// Higher id; in the file, wall `k` is `-(k + 1)`.
    pub b: Vec<GlobalId>,
    /// Centre of A [m].
    pub centre: Vec<Vec3>,
    /// Vector from the centre of A to the centre of B's nearest image, or for a wall to the contact point [m].
    pub branch: Vec<Vec3>,
    /// Contact point [m].
    pub point: Vec<Vec3>,
    /// Unit normal from A to B.
    pub normal: Vec<Vec3>,
    /// Overlap [m].
    pub overlap: Vec<f64>,
    /// Magnitude of the normal force, compression positive [N].
    pub normal_force: Vec<f64>,
    /// Tangential force that A exerts on B [N].
    pub shear_force: Vec<Vec3>,
}

/// A row of a [`ContactTable`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactRow {
    /// Lower id.
    pub a: GlobalId,
    /// Higher id, or that of a wall.
    pub b: GlobalId,
    /// See [`ContactTable::centre`] [m].
    pub centre: Vec3,
    /// See [`ContactTable::branch`] [m].
    pub branch: Vec3,
    /// See [`ContactTable::point`] [m].
    pub point: Vec3,
    /// See [`ContactTable::normal`].
    pub normal: Vec3,
    /// See [`ContactTable::overlap`] [m].
    pub overlap: f64,
    /// See [`ContactTable::normal_force`] [N].
    pub normal_force: f64,
    /// See [`ContactTable::shear_force`] [N].
    pub shear_force: Vec3,
}

impl ContactRow {
    /// Total force that A exerts on B [N].
    pub fn force(&self) -> Vec3 {
        self.normal * self.normal_force + self.shear_force
    }
}

impl ContactTable {
    /// Adds a contact.
    pub fn push(&mut self, row: &ContactRow) {
        self.a.push(row.a);
        self.b.push(row.b);
        self.centre.push(row.centre);
        self.branch.push(row.branch);
        self.point.push(row.point);
        self.normal.push(row.normal);
        self.overlap.push(row.overlap);
        self.normal_force.push(row.normal_force);
        self.shear_force.push(row.shear_force);
    }

    /// Total force that A exerts on B [N].
    pub fn force(&self, contact: usize) -> Vec3 {
        self.normal[contact] * self.normal_force[contact] + self.shear_force[contact]
    }

    /// All columns of these rows in bytes, to be sent to another rank.
    pub(super) fn bytes(rows: &dyn Rows<ContactRow>) -> Vec<Vec<u8>> {
        let centres: Box<dyn Numbers> = collected(rows, |row| row.centre);
        let columns = CONTACT_COLUMNS.iter().map(|column| (column.collect)(rows));
        columns.chain([centres]).map(|column| column.bytes()).collect()
    }

    /// Adds the rows of another rank.
    pub(super) fn append(&mut self, columns: &[Vec<u8>]) {
        for (column, bytes) in CONTACT_COLUMNS.iter().zip(columns) {
            (column.get_mut)(self).add_rows(bytes);
        }
        if let Some(centres) = columns.last() {
            self.centre.add_rows(centres);
        }
    }
}

/// A column of the contacts file.
pub struct ContactColumn {
    /// Name in messages.
    pub name: &'static str,
    /// Path in the file, from `/`.
    pub place: &'static str,
    /// Unit of the numbers; `1` for a pure number.
    pub unit: &'static str,
    /// Values in a table.
    get: fn(&ContactTable) -> &dyn Numbers,
    /// Values in a table, to be filled.
    get_mut: fn(&mut ContactTable) -> &mut dyn Numbers,
    /// Collects the column from rows that are visited one by one.
    collect: fn(&dyn Rows<ContactRow>) -> Box<dyn Numbers>,
}

/// All columns, in the order in which they are written. The centre of A is not among them: it is a point of the lines in the
/// file.
pub static CONTACT_COLUMNS: [ContactColumn; 8] = [
    ContactColumn {
        name: "a",
        place: "/VTKHDF/CellData/a",
        unit: "1",
        get: |table| &table.a,
        get_mut: |table| &mut table.a,
        collect: |rows| collected(rows, |row| row.a),
    },
    ContactColumn {
        name: "b",
        place: "/VTKHDF/CellData/b",
        unit: "1",
        get: |table| &table.b,
        get_mut: |table| &mut table.b,
        collect: |rows| collected(rows, |row| row.b),
    },
    ContactColumn {
        name: "branch",
        place: "/VTKHDF/CellData/branch",
        unit: "m",
        get: |table| &table.branch,
        get_mut: |table| &mut table.branch,
        collect: |rows| collected(rows, |row| row.branch),
    },
    ContactColumn {
        name: "point",
        place: "/VTKHDF/CellData/point",
        unit: "m",
        get: |table| &table.point,
        get_mut: |table| &mut table.point,
        collect: |rows| collected(rows, |row| row.point),
    },
    ContactColumn {
        name: "normal",
        place: "/VTKHDF/CellData/normal",
        unit: "1",
        get: |table| &table.normal,
        get_mut: |table| &mut table.normal,
        collect: |rows| collected(rows, |row| row.normal),
    },
    ContactColumn {
        name: "overlap",
        place: "/VTKHDF/CellData/overlap",
        unit: "m",
        get: |table| &table.overlap,
        get_mut: |table| &mut table.overlap,
        collect: |rows| collected(rows, |row| row.overlap),
    },
    ContactColumn {
        name: "normal_force",
        place: "/VTKHDF/CellData/normal_force",
        unit: "N",
        get: |table| &table.normal_force,
        get_mut: |table| &mut table.normal_force,
        collect: |rows| collected(rows, |row| row.normal_force),
    },
    ContactColumn {
        name: "shear_force",
        place: "/VTKHDF/CellData/shear_force",
        unit: "N",
        get: |table| &table.shear_force,
        get_mut: |table| &mut table.shear_force,
        collect: |rows| collected(rows, |row| row.shear_force),
    },
];

impl ContactColumn {
    /// Values of the column in a table.
    pub fn of<'a>(&self, table: &'a ContactTable) -> &'a dyn Numbers {
        (self.get)(table)
    }

    /// Fills the column from a file.
    pub(super) fn read(
        &self,
        table: &mut ContactTable,
        piece: &Piece,
    ) -> Result<(), SnapshotError> {
        let values = (self.get_mut)(table);
        values.read(piece, &column(self.place, self.unit, values))
    }

    /// Writes the rows of this rank. Only this column of them is in memory. Collective.
    pub(super) fn write(
        &self,
        rows: &dyn Rows<ContactRow>,
        order: &Order,
        file: &mut SnapshotFile,
    ) -> Result<(), SnapshotError> {
        let values = (self.collect)(rows);
        values.write(file, &column(self.place, self.unit, &*values), order)
    }
}

impl Rows<ContactRow> for ContactTable {
    fn count(&self) -> usize {
        self.a.len()
    }

    fn each(&self, take: &mut dyn FnMut(&ContactRow)) {
        for k in 0..self.a.len() {
            take(&ContactRow {
                a: self.a[k],
                b: self.b[k],
                centre: self.centre[k],
                branch: self.branch[k],
                point: self.point[k],
                normal: self.normal[k],
                overlap: self.overlap[k],
                normal_force: self.normal_force[k],
                shear_force: self.shear_force[k],
            });
        }
    }

    fn uneven(&self) -> Option<(&'static str, usize)> {
        let centres = [("centre", self.centre.len())];
        let others = CONTACT_COLUMNS.iter().map(|column| (column.name, column.of(self).rows()));
        others.chain(centres).find(|(_, rows)| *rows != self.a.len())
    }
}

/// Collects one column of rows that are visited one by one.
fn collected<T: Value + 'static>(
    rows: &dyn Rows<ContactRow>,
    get: impl Fn(&ContactRow) -> T,
) -> Box<dyn Numbers> {
    let mut column = Vec::with_capacity(rows.count());
    rows.each(&mut |row| column.push(get(row)));
    Box::new(column)
}

/// Number of elements of a particle in all columns.
pub fn particle_elements() -> usize {
    let empty = ParticleTable::default();
    PARTICLE_COLUMNS.iter().map(|column| column.of(&empty).labels().len()).sum()
}

/// Number of elements of a contact in all columns.
pub fn contact_elements() -> usize {
    let empty = ContactTable::default();
    CONTACT_COLUMNS.iter().map(|column| column.of(&empty).labels().len()).sum()
}

/// Bytes of a particle in the columns that a scene needs.
pub fn particle_bytes(needs: &Needs) -> usize {
    let empty = ParticleTable::default();
    let there = PARTICLE_COLUMNS.iter().filter(|column| column.is_there(needs));
    there.map(|column| column.of(&empty).row_bytes()).sum()
}

// --- rows that are visited one by one ---

/// Rows that are visited one by one, as often as needed. A snapshot is written column by column; all columns of its rows at once
/// would be most of the memory of a run.
pub trait Rows<Row> {
    /// Number of rows.
    fn count(&self) -> usize;

    /// Visits every row, always in the same order.
    fn each(&self, take: &mut dyn FnMut(&Row));

    /// Name and length of a column whose length differs from that of the first. Only tables stored in columns can have one.
    fn uneven(&self) -> Option<(&'static str, usize)> {
        None
    }
}

/// Records of touching contacts that are visited one by one.
pub trait ContactRecordRows {
    /// Columns of the state of the contact law.
    fn columns(&self) -> &[StateColumn];

    /// Number of records.
    fn count(&self) -> usize;

    /// Visits every record, always in the same order.
    fn each(&self, take: &mut dyn FnMut(&ContactRecord));
}

impl ContactRecordRows for ContactRecords {
    fn columns(&self) -> &[StateColumn] {
        self.columns()
    }

    fn count(&self) -> usize {
        self.len()
    }

    fn each(&self, take: &mut dyn FnMut(&ContactRecord)) {
        self.iter().for_each(|named| take(&named));
    }
}
