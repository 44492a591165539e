//! The columns of particles and contacts in snapshots. Each is declared once, in [`PARTICLE_COLUMNS`] or
//! [`CONTACT_COLUMNS`]: writing, reading, comparing and the bytes of `--plan` follow.

use super::SnapshotError;
use super::hdf5::{Column, Element, Piece, SnapshotFile};
use super::tables::{ContactRow, ContactTable, ParticleTable, Rows};
use crate::ids::{GlobalId, ShapeId};
use crate::math::Vec3;
use crate::particles::Needs;
use std::borrow::Cow;

/// A column of the particles file.
pub struct ParticleColumn {
    /// What messages call it.
    pub name: &'static str,
    /// Where in the file, from `/`. Columns of one group stand one after the other.
    pub place: &'static str,
    /// Unit of its numbers; `1` for a pure number.
    pub unit: &'static str,
    /// Is it there? A column that is always there counts as present without rows, too.
    pub presence: Presence,
    /// Of a table.
    get: fn(&ParticleTable) -> &dyn Numbers,
    /// The same, to be filled.
    get_mut: fn(&mut ParticleTable) -> &mut dyn Numbers,
}

/// When a column is there.
pub enum Presence {
    /// In every snapshot.
    Always,
    /// Where the scene needs it; else the table leaves it empty.
    If(fn(&Needs) -> bool),
}

/// All of them, in the order in which they are written.
pub static PARTICLE_COLUMNS: [ParticleColumn; 15] = [
    ParticleColumn {
        name: "position",
        place: "/VTKHDF/Points",
        unit: "m",
        presence: Presence::Always,
        get: |table| &table.position,
        get_mut: |table| &mut table.position,
    },
    ParticleColumn {
        name: "id",
        place: "/VTKHDF/PointData/id",
        unit: "1",
        presence: Presence::Always,
        get: |table| &table.id,
        get_mut: |table| &mut table.id,
    },
    ParticleColumn {
        name: "shape",
        place: "/VTKHDF/PointData/shape",
        unit: "1",
        presence: Presence::Always,
        get: |table| &table.shape,
        get_mut: |table| &mut table.shape,
    },
    ParticleColumn {
        name: "scale",
        place: "/VTKHDF/PointData/scale",
        unit: "1",
        presence: Presence::If(|needs| needs.scale),
        get: |table| &table.scale,
        get_mut: |table| &mut table.scale,
    },
    ParticleColumn {
        name: "quaternion",
        place: "/VTKHDF/PointData/quaternion",
        unit: "1",
        presence: Presence::If(|needs| needs.orientation),
        get: |table| &table.quaternion,
        get_mut: |table| &mut table.quaternion,
    },
    ParticleColumn {
        name: "velocity",
        place: "/VTKHDF/PointData/velocity",
        unit: "m/s",
        presence: Presence::Always,
        get: |table| &table.velocity,
        get_mut: |table| &mut table.velocity,
    },
    ParticleColumn {
        name: "angular_velocity",
        place: "/VTKHDF/PointData/angular_velocity",
        unit: "rad/s",
        presence: Presence::If(|needs| needs.spin),
        get: |table| &table.angular_velocity,
        get_mut: |table| &mut table.angular_velocity,
    },
    ParticleColumn {
        name: "force",
        place: "/VTKHDF/PointData/force",
        unit: "N",
        presence: Presence::Always,
        get: |table| &table.force,
        get_mut: |table| &mut table.force,
    },
    ParticleColumn {
        name: "torque",
        place: "/VTKHDF/PointData/torque",
        unit: "N m",
        presence: Presence::If(|needs| needs.spin),
        get: |table| &table.torque,
        get_mut: |table| &mut table.torque,
    },
    ParticleColumn {
        name: "coordination",
        place: "/VTKHDF/PointData/coordination",
        unit: "1",
        presence: Presence::Always,
        get: |table| &table.coordination,
        get_mut: |table| &mut table.coordination,
    },
    ParticleColumn {
        name: "rank",
        place: "/VTKHDF/PointData/rank",
        unit: "1",
        presence: Presence::Always,
        get: |table| &table.rank,
        get_mut: |table| &mut table.rank,
    },
    ParticleColumn {
        name: "dissipated",
        place: "/restart/particles/dissipated",
        unit: "J",
        presence: Presence::Always,
        get: |table| &table.dissipated,
        get_mut: |table| &mut table.dissipated,
    },
    ParticleColumn {
        name: "received",
        place: "/restart/particles/received",
        unit: "J",
        presence: Presence::Always,
        get: |table| &table.received,
        get_mut: |table| &mut table.received,
    },
    ParticleColumn {
        name: "image",
        place: "/restart/particles/image",
        unit: "1",
        presence: Presence::If(|needs| needs.image),
        get: |table| &table.image,
        get_mut: |table| &mut table.image,
    },
    ParticleColumn {
        name: "angular_momentum",
        place: "/restart/particles/angular_momentum",
        unit: "kg m^2/s",
        presence: Presence::If(|needs| needs.spin),
        get: |table| &table.angular_momentum,
        get_mut: |table| &mut table.angular_momentum,
    },
];

impl ParticleColumn {
    /// Its numbers in a table.
    pub fn of<'a>(&self, table: &'a ParticleTable) -> &'a dyn Numbers {
        (self.get)(table)
    }

    /// Does a scene with these needs have it?
    pub fn is_there(&self, needs: &Needs) -> bool {
        match self.presence {
            Presence::Always => true,
            Presence::If(is_needed) => is_needed(needs),
        }
    }

    /// May a table leave it empty?
    pub const fn is_optional(&self) -> bool {
        matches!(self.presence, Presence::If(_))
    }

    /// The group in which it stands.
    pub fn group(&self) -> &'static str {
        self.place.rsplit_once('/').map_or("", |(group, _)| group)
    }

    /// Fills it from a file; a column that the file does not have stays empty if it may.
    pub(super) fn read(
        &self,
        table: &mut ParticleTable,
        piece: &Piece,
    ) -> Result<(), SnapshotError> {
        if self.is_optional() && !piece.has(self.place) {
            return Ok(());
        }
        let values = (self.get_mut)(table);
        values.read(piece, &column(self.place, self.unit, values))
    }

    /// Writes the rows of this rank. Collective.
    pub(super) fn write(
        &self,
        table: &ParticleTable,
        file: &mut SnapshotFile,
    ) -> Result<(), SnapshotError> {
        let values = self.of(table);
        values.write(file, &column(self.place, self.unit, values))
    }
}

/// A column of the contacts file.
pub struct ContactColumn {
    /// What messages call it.
    pub name: &'static str,
    /// Where in the file, from `/`.
    pub place: &'static str,
    /// Unit of its numbers; `1` for a pure number.
    pub unit: &'static str,
    /// Of a table.
    get: fn(&ContactTable) -> &dyn Numbers,
    /// The same, to be filled.
    get_mut: fn(&mut ContactTable) -> &mut dyn Numbers,
    /// Of rows that come one by one.
    collect: fn(&dyn Rows<ContactRow>) -> Box<dyn Numbers>,
}

/// All of them, in the order in which they are written. The centre of A is a point of the lines that the file shows.
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
    /// Its numbers in a table.
    pub fn of<'a>(&self, table: &'a ContactTable) -> &'a dyn Numbers {
        (self.get)(table)
    }

    /// Fills it from a file.
    pub(super) fn read(
        &self,
        table: &mut ContactTable,
        piece: &Piece,
    ) -> Result<(), SnapshotError> {
        let values = (self.get_mut)(table);
        values.read(piece, &column(self.place, self.unit, values))
    }

    /// Writes the rows of this rank; only this column of them is ever held. Collective.
    pub(super) fn write(
        &self,
        rows: &dyn Rows<ContactRow>,
        file: &mut SnapshotFile,
    ) -> Result<(), SnapshotError> {
        let values = (self.collect)(rows);
        values.write(file, &column(self.place, self.unit, &*values))
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

/// One column of rows that come one by one.
fn collected<T: Value + 'static>(
    rows: &dyn Rows<ContactRow>,
    get: impl Fn(&ContactRow) -> T,
) -> Box<dyn Numbers> {
    let mut column = Vec::with_capacity(rows.count());
    rows.each(&mut |row| column.push(get(row)));
    Box::new(column)
}

/// As a file knows a column.
fn column<'a>(place: &'a str, unit: &'a str, values: &dyn Numbers) -> Column<'a> {
    Column { place, width: values.labels().len(), unit }
}

/// Elements of a particle in all columns.
pub fn particle_elements() -> usize {
    let empty = ParticleTable::default();
    PARTICLE_COLUMNS.iter().map(|column| column.of(&empty).labels().len()).sum()
}

/// Elements of a contact in all columns.
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

/// Numbers of particles or contacts, so many of each.
pub trait Numbers {
    /// How many rows there are.
    fn rows(&self) -> usize;

    /// What follows the name of the column for each number of a row.
    fn labels(&self) -> &'static [&'static str];

    /// A number of a row; of names and counts, too.
    fn number(&self, row: usize, k: usize) -> f64;

    /// Bytes of a row in a file.
    fn row_bytes(&self) -> usize;

    /// Writes all rows. Collective.
    ///
    /// # Errors
    /// As [`SnapshotFile::rows`].
    fn write(&self, file: &mut SnapshotFile, column: &Column) -> Result<(), SnapshotError>;

    /// Replaces all rows by those of a file.
    ///
    /// # Errors
    /// As [`Piece::read`].
    fn read(&mut self, piece: &Piece, column: &Column) -> Result<(), SnapshotError>;
}

impl<T: Value> Numbers for Vec<T> {
    fn rows(&self) -> usize {
        self.len()
    }

    fn labels(&self) -> &'static [&'static str] {
        T::LABELS
    }

    fn number(&self, row: usize, k: usize) -> f64 {
        self[row].number(k)
    }

    fn row_bytes(&self) -> usize {
        T::LABELS.len() * size_of::<T::Element>()
    }

    fn write(&self, file: &mut SnapshotFile, column: &Column) -> Result<(), SnapshotError> {
        file.rows(column, &T::to_elements(self))
    }

    fn read(&mut self, piece: &Piece, column: &Column) -> Result<(), SnapshotError> {
        *self = T::from_elements(piece.read(column)?);
        Ok(())
    }
}

const SCALAR: &[&str] = &[""];
const VECTOR: &[&str] = &[".x", ".y", ".z"];

/// What a column has of a particle or a contact.
pub trait Value: Copy {
    /// As a file holds its numbers.
    type Element: Element;

    /// What follows the name of the column for each number.
    const LABELS: &'static [&'static str];

    /// One of its numbers.
    fn number(&self, k: usize) -> f64;

    /// As a file holds them.
    fn to_elements(rows: &[Self]) -> Cow<'_, [Self::Element]>;

    /// From a file.
    fn from_elements(elements: Vec<Self::Element>) -> Vec<Self>;
}

/// Numbers that stand in memory as in a file.
pub trait Plain: bytemuck::Pod {
    /// One of them.
    type Element: Element + Into<f64>;

    /// As [`Value::LABELS`].
    const LABELS: &'static [&'static str];
}

impl Plain for f64 {
    type Element = Self;

    const LABELS: &'static [&'static str] = SCALAR;
}

impl Plain for i32 {
    type Element = Self;

    const LABELS: &'static [&'static str] = SCALAR;
}

impl Plain for Vec3 {
    type Element = f64;

    const LABELS: &'static [&'static str] = VECTOR;
}

impl Plain for [i32; 3] {
    type Element = i32;

    const LABELS: &'static [&'static str] = VECTOR;
}

impl Plain for [f64; 4] {
    type Element = f64;

    const LABELS: &'static [&'static str] = &[".w", ".x", ".y", ".z"];
}

impl<T: Plain> Value for T {
    type Element = T::Element;

    const LABELS: &'static [&'static str] = T::LABELS;

    fn number(&self, k: usize) -> f64 {
        Self::to_elements(std::slice::from_ref(self))[k].into()
    }

    fn to_elements(rows: &[Self]) -> Cow<'_, [T::Element]> {
        bytemuck::cast_slice(rows).into()
    }

    fn from_elements(elements: Vec<T::Element>) -> Vec<Self> {
        bytemuck::pod_collect_to_vec(&elements)
    }
}

impl Value for GlobalId {
    type Element = i64;

    const LABELS: &'static [&'static str] = SCALAR;

    fn number(&self, _k: usize) -> f64 {
        self.to_file() as f64
    }

    fn to_elements(rows: &[Self]) -> Cow<'_, [i64]> {
        rows.iter().map(|id| id.to_file()).collect()
    }

    fn from_elements(elements: Vec<i64>) -> Vec<Self> {
        elements.into_iter().map(Self::from_file).collect()
    }
}

impl Value for ShapeId {
    type Element = u16;

    const LABELS: &'static [&'static str] = SCALAR;

    fn number(&self, _k: usize) -> f64 {
        f64::from(self.0)
    }

    fn to_elements(rows: &[Self]) -> Cow<'_, [u16]> {
        rows.iter().map(|shape| shape.0).collect()
    }

    fn from_elements(elements: Vec<u16>) -> Vec<Self> {
        elements.into_iter().map(Self).collect()
    }
}
