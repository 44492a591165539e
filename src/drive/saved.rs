//! The state of a drive in a snapshot.

use super::DriveError;
use crate::contact::StateColumn;
use crate::math::ExactSum;
use crate::population::Library;
use serde::{Deserialize, Serialize};

/// State of a drive in a snapshot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedState {
    /// The drive's name.
    pub drive: String,
    /// Its columns.
    pub columns: Vec<SavedColumn>,
}

/// Data from which a drive continues.
#[derive(Clone, Copy)]
pub struct Restart<'a> {
    /// Its state in the snapshot.
    pub saved: &'a SavedState,
    /// Does another stage begin?
    pub is_new_stage: bool,
    /// Shapes of the particles.
    pub library: &'a Library,
    /// Is this rank 0? Sums that are not yet added up belong to it.
    pub is_root: bool,
}

impl Restart<'_> {
    /// This rank's part of a sum over all ranks, saved by its limbs: rank 0 has all of it.
    pub fn sum(&self, limbs: &[i64]) -> ExactSum {
        if self.is_root { ExactSum::from_limbs(limbs) } else { ExactSum::default() }
    }
}

/// A column of a [`SavedState`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedColumn {
    /// Name and unit, and numbers per row; texts have one.
    pub column: StateColumn,
    /// Values, row by row.
    pub values: Values,
}

/// Values of a column of a [`SavedState`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Values {
    /// Texts.
    Texts(Vec<String>),
    /// Real numbers.
    Reals(Vec<f64>),
    /// Integers.
    Integers(Vec<i64>),
    /// Integers that are never negative.
    Counts(Vec<u64>),
}

impl Values {
    /// Number of numbers or texts.
    pub fn len(&self) -> usize {
        match self {
            Self::Texts(values) => values.len(),
            Self::Reals(values) => values.len(),
            Self::Integers(values) => values.len(),
            Self::Counts(values) => values.len(),
        }
    }

    /// Values as a list in text form.
    pub fn words(&self) -> String {
        match self {
            Self::Texts(values) => format!("{values:?}"),
            Self::Reals(values) => format!("{values:?}"),
            Self::Integers(values) => format!("{values:?}"),
            Self::Counts(values) => format!("{values:?}"),
        }
    }

    /// Size in a file, where all texts are as long as the longest [bytes].
    pub fn bytes(&self) -> usize {
        let element = match self {
            Self::Texts(values) => values.iter().map(String::len).max().unwrap_or(0),
            Self::Reals(_) | Self::Integers(_) | Self::Counts(_) => size_of::<f64>(),
        };
        self.len() * element
    }

    /// Is the column empty?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl SavedColumn {
    /// A column with these rows.
    pub const fn new(column: StateColumn, values: Values) -> Self {
        Self { column, values }
    }

    /// A column of texts.
    pub fn texts(column: StateColumn, rows: impl Iterator<Item = String>) -> Self {
        Self::new(column, Values::Texts(rows.collect()))
    }

    /// A column of real numbers.
    pub fn reals(column: StateColumn, rows: impl Iterator<Item = f64>) -> Self {
        Self::new(column, Values::Reals(rows.collect()))
    }

    /// A column of integers.
    pub fn integers(column: StateColumn, rows: impl Iterator<Item = i64>) -> Self {
        Self::new(column, Values::Integers(rows.collect()))
    }

    /// A column of integers that are never negative.
    pub fn counts(column: StateColumn, rows: impl Iterator<Item = u64>) -> Self {
        Self::new(column, Values::Counts(rows.collect()))
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.values.len() / self.column.width.max(1)
    }
}

impl SavedState {
    /// A column of texts.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn texts(&self, column: &StateColumn) -> Result<&[String], DriveError> {
        self.find(column, |values| if let Values::Texts(them) = values { Some(them) } else { None })
    }

    /// A column of real numbers.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn reals(&self, column: &StateColumn) -> Result<&[f64], DriveError> {
        self.find(column, |values| if let Values::Reals(them) = values { Some(them) } else { None })
    }

    /// A column of integers.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn integers(&self, column: &StateColumn) -> Result<&[i64], DriveError> {
        self.find(
            column,
            |values| if let Values::Integers(them) = values { Some(them) } else { None },
        )
    }

    /// A column of integers that are never negative.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn counts(&self, column: &StateColumn) -> Result<&[u64], DriveError> {
        self.find(
            column,
            |values| if let Values::Counts(them) = values { Some(them) } else { None },
        )
    }

    fn find<'a, T>(
        &'a self,
        wanted: &StateColumn,
        of_type: impl FnOnce(&'a Values) -> Option<&'a Vec<T>>,
    ) -> Result<&'a [T], DriveError> {
        let found = self.columns.iter().find(|saved| saved.column == *wanted);
        found.and_then(|saved| of_type(&saved.values)).map(Vec::as_slice).ok_or_else(|| {
            let (drive, StateColumn { name, unit, width }) = (&self.drive, wanted);
            DriveError(format!(
                "the state of `{drive}` has no column `{name}` of {width} numbers in \"{unit}\" of the type that this \
                 version uses: another version of `{drive}` wrote it. Continue with that version, or run the scene \
                 again"
            ))
        })
    }
}
