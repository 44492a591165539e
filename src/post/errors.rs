//! Why a measure that was asked for could not be made.

use super::PostError;
use super::draw::PlotError;
use crate::math::Vec3;
use crate::output::SnapshotError;
use crate::text::{MOST_NAMED, listed};
use std::io;
use std::path::PathBuf;

/// Why a measure could not be made.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// A snapshot that cannot be used.
    #[error(transparent)]
    Post(#[from] PostError),
    /// A file that cannot be read or written.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// A chart.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// A table or image that cannot be written.
    #[error("cannot write {path}: {cause}", path = path.display())]
    Unwritten {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// An error with the file in which it is.
    #[error("{file}: {error}")]
    In {
        /// The file.
        file: String,
        /// The error.
        error: Box<MeasureError>,
    },
    /// A length that is none.
    #[error("a length of {side} m: write one above 0, in metres (0.004) or grain diameters (1.5d)")]
    NoSide {
        /// The length [m].
        side: f64,
    },
    /// A grid that is too fine.
    #[error(
        "a grid of {cells:.3e} cells, and {most:.0e} are the most: make --grid larger, or give a --region"
    )]
    TooManyCells {
        /// How many there would be.
        cells: f64,
        /// How many there may be.
        most: f64,
    },
    /// Cells that miss the weight.
    #[error(
        "cells of {side:e} m are larger than the width of the fields, {width:e} m: make --grid smaller, or leave it out"
    )]
    CoarserThanWeight {
        /// Side of a cell [m].
        side: f64,
        /// Width [m].
        width: f64,
    },
    /// A grain would meet its own image.
    #[error(
        "the weights reach {range:e} m, over half of the period along {axis}, {period:e} m: make --fields smaller"
    )]
    WiderThanPeriod {
        /// The axis.
        axis: &'static str,
        /// Its period [m].
        period: f64,
        /// How far the weight reaches [m].
        range: f64,
    },
    /// The edges of the cell lean, and cells of fields are upright.
    #[error(
        "the edges of the cell lean, so images stand beside the cells of a grid: fields are there for cells whose edges are along the axes only"
    )]
    Leaning,
    /// No grains where it is measured.
    #[error("no grain is in the region: make it larger, or name another snapshot")]
    NobodyThere,
    /// A shape that is not there.
    #[error("the snapshot has no shape `{name}`; it has: {}", listed(known, MOST_NAMED))]
    NoSuchShape {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
    /// Nothing to mix.
    #[error("all {grains} grains of the region are of one group: mixing needs two")]
    OneGroup {
        /// How many.
        grains: u64,
    },
    /// No up and down.
    #[error("gravity is {gravity:?} m/s2, and the angle of a surface needs it along -z", gravity = gravity.as_slice())]
    NoVertical {
        /// Gravity [m/s²].
        gravity: Vec3,
    },
    /// A heap that is too small or flat.
    #[error(
        "only {strips} strips of columns are on the slope, three are needed: the heap is too flat or too small for its grains"
    )]
    NoSurface {
        /// Strips between foot and top.
        strips: usize,
    },
    /// A plane that images pass.
    #[error(
        "{axis} is periodic: which way a grain went through a plane across it cannot be told from snapshots"
    )]
    AcrossPeriod {
        /// The axis.
        axis: &'static str,
    },
    /// An outlet that is not there.
    #[error(
        "history.csv has no outlet `{name}`; {}",
        if known.is_empty() { "it has none, so give a plane, -z=0.05".to_owned() } else { format!("it has: {}", listed(known, MOST_NAMED)) }
    )]
    NoSuchOutlet {
        /// What was asked for.
        name: String,
        /// What there is.
        known: Vec<String>,
    },
    /// No rate without two times.
    #[error(
        "{rows} rows in the window, and a rate needs two: name more snapshots (--series), or make --window larger"
    )]
    FewRows {
        /// How many.
        rows: usize,
    },
}

impl MeasureError {
    /// Whether this snapshot only has nothing to measure, where another one of its run may have, perhaps within the same margin.
    pub(super) const fn is_of_one_state(&self, has_margin: bool) -> bool {
        match self {
            Self::NobodyThere | Self::OneGroup { .. } | Self::NoSurface { .. } => true,
            Self::Post(error) => has_margin && error.is_of_margin(),
            _ => false,
        }
    }
}
