//! Values of the columns of a snapshot: numbers of any kind, in their form in memory and their form in files.

use super::SnapshotError;
use super::hdf5::{Column, Element, Piece, SnapshotFile};
use super::order::Order;
use crate::ids::{GlobalId, ShapeId, Standing};
use crate::math::Vec3;
use std::borrow::Cow;

/// Description of a column for a file.
pub(super) fn column<'a>(place: &'a str, unit: &'a str, values: &dyn Numbers) -> Column<'a> {
    Column { place, width: values.labels().len(), unit }
}

/// Numbers of particles or contacts, a fixed number of each.
pub trait Numbers {
    /// Number of rows.
    fn rows(&self) -> usize;

    /// Suffixes to the name of the column, one for each number of a row.
    fn labels(&self) -> &'static [&'static str];

    /// Number `k` of a row; identifiers and counts are converted.
    fn number(&self, row: usize, k: usize) -> f64;

    /// Bytes of a row in a file.
    fn row_bytes(&self) -> usize;

    /// Writes all rows in the given order. Collective.
    ///
    /// # Errors
    /// See [`SnapshotFile::rows`].
    fn write(
        &self,
        file: &mut SnapshotFile,
        column: &Column,
        order: &Order,
    ) -> Result<(), SnapshotError>;

    /// All rows in their form in a file.
    fn bytes(&self) -> Vec<u8>;

    /// VTK's name of the type of the numbers in a file.
    fn vtk_name(&self) -> &'static str;

    /// Adds the rows of another rank.
    fn add_rows(&mut self, bytes: &[u8]);

    /// Replaces all rows by those of a file.
    ///
    /// # Errors
    /// See [`Piece::read`].
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

/// Value of a column for one particle or contact.
pub trait Value: Copy {
    /// Type of the numbers in a file.
    type Element: Element;

    /// Suffixes to the name of the column, one for each number.
    const LABELS: &'static [&'static str];

    /// Number `k` of the value.
    fn number(&self, k: usize) -> f64;

    /// Converts rows to their form in a file.
    fn to_elements(rows: &[Self]) -> Cow<'_, [Self::Element]>;

    /// Converts elements of a file to rows.
    fn from_elements(elements: Vec<Self::Element>) -> Vec<Self>;
}

/// Numbers with the same layout in memory and in a file.
pub trait Plain: bytemuck::Pod {
    /// Type of one number.
    type Element: Element + Into<f64>;

    /// See [`Value::LABELS`].
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
