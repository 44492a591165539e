//! Records of touching contacts. They are saved, and migrate with their particles.

use crate::ids::GlobalId;
use crate::math::Vec3;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::ops::Range;

/// Geometry of a contact at the last step.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Serialize,
    Deserialize,
    bytemuck::Pod,
    bytemuck::Zeroable,
)]
// Aligned so that no row spans two cache lines.
#[repr(C, align(32))]
pub struct Geometry {
    /// Normal from A to B at the last step; zero if the pair did not touch.
    pub normal: Vec3,
    /// Overlap at the last step [m].
    pub overlap: f64,
}

impl Geometry {
    /// Whether the pair touched at the last step.
    #[inline]
    pub fn touched(&self) -> bool {
        self.normal != Vec3::zeros()
    }
}

/// Numbers that a law keeps for each touching contact.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StateColumn {
    /// Name in files and reports.
    pub name: Cow<'static, str>,
    /// Unit, as text.
    pub unit: Cow<'static, str>,
    /// Number of values per contact, 3 for a vector.
    pub width: usize,
}

impl StateColumn {
    /// A column declared by a law.
    pub const fn new(name: &'static str, width: usize, unit: &'static str) -> Self {
        Self { name: Cow::Borrowed(name), unit: Cow::Borrowed(unit), width }
    }

    /// Total number of values per contact in all of these columns.
    pub fn total_width(columns: &[Self]) -> usize {
        columns.iter().map(|column| column.width).sum()
    }

    /// Each column with the range of its values among those of a contact.
    pub fn ranges(columns: &[Self]) -> impl Iterator<Item = (&Self, Range<usize>)> {
        columns.iter().scan(0, |start, column| {
            let place = *start..*start + column.width;
            *start = place.end;
            Some((column, place))
        })
    }
}

/// Records of touching contacts, under the ids of their bodies.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactRecords {
    columns: Vec<StateColumn>,
    ends: Vec<(GlobalId, GlobalId)>,
    geometry: Vec<Geometry>,
    state: Vec<f64>,
}

/// The record of a touching contact, under the ids of its bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactRecord<'a> {
    /// The lower id.
    pub a: GlobalId,
    /// The higher id.
    pub b: GlobalId,
    /// Normal and overlap.
    pub geometry: Geometry,
    /// Values kept by the law, column after column.
    pub state: &'a [f64],
}

impl ContactRecords {
    /// An empty list of records with these columns of the law.
    pub fn of(columns: &[StateColumn]) -> Self {
        Self { columns: columns.to_vec(), ..Self::default() }
    }

    /// Columns of the law.
    pub fn columns(&self) -> &[StateColumn] {
        &self.columns
    }

    /// Number of records.
    pub const fn len(&self) -> usize {
        self.ends.len()
    }

    /// Whether there are no records.
    pub const fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Ids of the bodies of a record, the lower first.
    pub fn ends(&self, row: usize) -> (GlobalId, GlobalId) {
        self.ends[row]
    }

    /// The record of a row.
    pub fn get(&self, row: usize) -> ContactRecord<'_> {
        let (a, b) = self.ends[row];
        let width = StateColumn::total_width(&self.columns);
        let state = &self.state[row * width..(row + 1) * width];
        ContactRecord { a, b, geometry: self.geometry[row], state }
    }

    /// All records.
    pub fn iter(&self) -> impl Iterator<Item = ContactRecord<'_>> {
        (0..self.len()).map(|row| self.get(row))
    }

    /// Adds a record, which must have as many values as the columns.
    pub fn push(&mut self, named: &ContactRecord) {
        let ContactRecord { a, b, geometry, state } = *named;
        debug_assert_eq!(state.len(), StateColumn::total_width(&self.columns));
        self.ends.push((a, b));
        self.geometry.push(geometry);
        self.state.extend_from_slice(state);
    }

    /// Adds the records of `other`, which has the same columns.
    pub fn append(&mut self, other: &Self) {
        debug_assert!(other.is_empty() || other.columns == self.columns);
        self.ends.extend_from_slice(&other.ends);
        self.geometry.extend_from_slice(&other.geometry);
        self.state.extend_from_slice(&other.state);
    }

    /// Copy with renamed second bodies; records whose second body gets no name are dropped.
    #[must_use]
    pub fn renamed(&self, name: impl Fn(GlobalId) -> Option<GlobalId>) -> Self {
        let mut renamed = Self::of(&self.columns);
        for named in self.iter() {
            if let Some(b) = name(named.b) {
                renamed.push(&ContactRecord { b, ..named });
            }
        }
        renamed
    }

    /// Copy with other columns; values of new columns are zero.
    #[must_use]
    pub fn with_columns(&self, columns: &[StateColumn]) -> Self {
        let place_of = |wanted: &StateColumn| {
            StateColumn::ranges(&self.columns)
                .find(|(column, _)| *column == wanted)
                .map(|(_, place)| place)
        };
        let places: Vec<_> = columns.iter().map(place_of).collect();
        let mut state = Vec::with_capacity(self.len() * StateColumn::total_width(columns));
        for named in self.iter() {
            for (column, place) in columns.iter().zip(&places) {
                match place {
                    Some(place) => state.extend_from_slice(&named.state[place.clone()]),
                    None => state.extend(std::iter::repeat_n(0.0, column.width)),
                }
            }
        }
        Self {
            columns: columns.to_vec(),
            ends: self.ends.clone(),
            geometry: self.geometry.clone(),
            state,
        }
    }
}
