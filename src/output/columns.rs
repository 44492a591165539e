//! The columns of particles and contacts in snapshots. Each is declared once, in [`PARTICLE_COLUMNS`] or
//! [`CONTACT_COLUMNS`], and what accumulates as a [`Quantity`]: writing, reading, comparing and the bytes of `--plan` follow.

use super::SnapshotError;
use super::hdf5::{Column, Element, Piece, SnapshotFile};
use super::tables::{ContactRow, ContactTable, ParticleTable, Rows};
use crate::ids::{GlobalId, ShapeId};
use crate::math::Vec3;
use crate::particles::Needs;
use crate::particles::columns::{Presence, Quantity};
use std::borrow::Cow;
use std::sync::LazyLock;

/// A column of the particles file.
pub struct ParticleColumn {
    /// What messages call it.
    pub name: &'static str,
    /// Where in the file, from `/`. Columns of one group stand one after the other.
    pub place: Cow<'static, str>,
    /// Unit of its numbers; `1` for a pure number.
    pub unit: &'static str,
    /// Is it there? A column that is always there counts as present without rows, too.
    pub presence: Presence,
    /// Where in a table.
    values: Storage,
}

/// Where the numbers of a column stand in a table.
enum Storage {
    /// In a field: to be read, and to be filled.
    Own(fn(&ParticleTable) -> &dyn Numbers, fn(&mut ParticleTable) -> &mut dyn Numbers),
    /// Among those that have accumulated.
    Accumulated(Quantity),
}

/// All of them, in the order in which they are written.
pub static PARTICLE_COLUMNS: LazyLock<Vec<ParticleColumn>> = LazyLock::new(|| {
    let accumulated = Quantity::ALL.map(ParticleColumn::of_quantity);
    shown().into_iter().chain(accumulated).chain(of_restart()).collect()
});

/// What a picture shows.
fn shown() -> [ParticleColumn; 11] {
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
            "quaternion",
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

/// What a restart needs besides.
fn of_restart() -> [ParticleColumn; 2] {
    [
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

    /// Its numbers in a table.
    pub fn of<'a>(&self, table: &'a ParticleTable) -> &'a dyn Numbers {
        match self.values {
            Storage::Own(get, _) => get(table),
            Storage::Accumulated(quantity) => &table.accumulated[quantity],
        }
    }

    /// Does a scene with these needs have it?
    pub fn is_there(&self, needs: &Needs) -> bool {
        self.presence.holds(needs)
    }

    /// May a table leave it empty?
    pub const fn is_optional(&self) -> bool {
        matches!(self.presence, Presence::If(_))
    }

    /// The group in which it stands.
    pub fn group(&self) -> &str {
        self.place.rsplit_once('/').map_or("", |(group, _)| group)
    }

    /// Fills it from a file; a column that the file does not have stays empty if it may.
    pub(super) fn read(
        &self,
        table: &mut ParticleTable,
        piece: &Piece,
    ) -> Result<(), SnapshotError> {
        if self.is_optional() && !piece.has(&self.place) {
            return Ok(());
        }
        let values = match self.values {
            Storage::Own(_, get_mut) => get_mut(table),
            Storage::Accumulated(quantity) => &mut table.accumulated[quantity],
        };
        values.read(piece, &column(&self.place, self.unit, values))
    }

    /// Writes the rows of this rank. Collective.
    pub(super) fn write(
        &self,
        table: &ParticleTable,
        file: &mut SnapshotFile,
    ) -> Result<(), SnapshotError> {
        let values = self.of(table);
        values.write(file, &column(&self.place, self.unit, values))
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
