//! What the columns of a snapshot hold: numbers of any kind, in memory as they are used and in files as they are stored.

use super::SnapshotError;
use super::hdf5::{Column, Element, Piece, SnapshotFile};
use super::order::Order;
use crate::ids::{GlobalId, ShapeId, Standing};
use crate::math::Vec3;
use std::borrow::Cow;

/// As a file knows a column.
pub(super) fn column<'a>(place: &'a str, unit: &'a str, values: &dyn Numbers) -> Column<'a> {
    Column { place, width: values.labels().len(), unit }
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

    /// Writes all rows in this order. Collective.
    ///
    /// # Errors
    /// As [`SnapshotFile::rows`].
    fn write(
        &self,
        file: &mut SnapshotFile,
        column: &Column,
        order: &Order,
    ) -> Result<(), SnapshotError>;

    /// All rows as a file has them.
    fn bytes(&self) -> Vec<u8>;

    /// What VTK calls the type of the numbers in a file.
    fn vtk_name(&self) -> &'static str;

    /// Adds the rows of another rank.
    fn add_rows(&mut self, bytes: &[u8]);

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

    fn write(
        &self,
        file: &mut SnapshotFile,
        column: &Column,
        order: &Order,
    ) -> Result<(), SnapshotError> {
        file.rows_in(order, column, &T::to_elements(self))
    }

    fn bytes(&self) -> Vec<u8> {
        bytemuck::cast_slice(&T::to_elements(self)).to_vec()
    }

    fn vtk_name(&self) -> &'static str {
        T::Element::VTK
    }

    fn add_rows(&mut self, bytes: &[u8]) {
        self.extend(T::from_elements(bytemuck::pod_collect_to_vec(bytes)));
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

impl Plain for u16 {
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

impl Value for Standing {
    type Element = u64;

    const LABELS: &'static [&'static str] = SCALAR;

    fn number(&self, _k: usize) -> f64 {
        self.0 as f64
    }

    fn to_elements(rows: &[Self]) -> Cow<'_, [u64]> {
        rows.iter().map(|standing| standing.0).collect()
    }

    fn from_elements(elements: Vec<u64>) -> Vec<Self> {
        elements.into_iter().map(Self).collect()
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
