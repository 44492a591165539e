//! Errors of measures.

use super::PostError;
use super::draw::PlotError;
use crate::math::Vec3;
use crate::output::SnapshotError;
use crate::text::{MOST_NAMED, listed};
use std::io;
use std::path::PathBuf;

/// Errors of a measure.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// The snapshot cannot be used.
    #[error(transparent)]
    Post(#[from] PostError),
    /// A file cannot be read or written.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// A chart cannot be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// A table or image cannot be written.
    #[error("cannot write {path}: {cause}", path = path.display())]
    Unwritten {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        cause: io::Error,
    },
    /// An error, with the name of the file.
    #[error("{file}: {error}")]
    In {
        /// The file.
        file: String,
        /// Error in the file.
        error: Box<MeasureError>,
    },
    /// The length is not positive.
    #[error(
        "the length {side} m is not above 0: write it in metres (0.004) or particle diameters (1.5d)"
    )]
    NoSide {
        /// The length [m].
        side: f64,
    },
    /// The grid is too fine.
    #[error(
        "a grid of {cells:.3e} cells exceeds the maximum of {most:.0e}: make --grid larger, or give a --region"
    )]
    TooManyCells {
        /// Requested number of cells.
        cells: f64,
        /// Largest number of cells.
        most: f64,
    },
    /// The cells are too coarse for the weight.
    #[error(
        "cells of {side:e} m are larger than the width of the fields, {width:e} m: make --grid smaller, or omit it"
    )]
    CoarserThanWeight {
        /// Side of a cell [m].
        side: f64,
        /// Width [m].
        width: f64,
    },
    /// The weight of a particle would reach its own image.
    #[error(
        "the weights reach {range:e} m, more than half of the period along {axis}, {period:e} m: make --fields \
         smaller"
    )]
    WiderThanPeriod {
        /// The axis.
        axis: &'static str,
        /// Its period [m].
        period: f64,
        /// Range of the weight [m].
        range: f64,
    },
    /// The edges of the periodic cell are not along the axes, as the cells of fields must be.
    #[error("the edges of the cell are tilted: fields need a cell with edges along the axes")]
    Leaning,
    /// There are no particles in the region.
    #[error("the region contains no particle: make it larger, or choose another snapshot")]
    NobodyThere,
    /// The shape does not exist.
    #[error("the snapshot has no shape `{name}`; it has: {}", listed(known, MOST_NAMED))]
    NoSuchShape {
        /// Requested name.
        name: String,
        /// Names of all shapes.
        known: Vec<String>,
    },
    /// All particles are of one group.
    #[error("all {grains} particles of the region are in one group: mixing needs two")]
    OneGroup {
        /// Number of particles.
        grains: u64,
    },
    /// Gravity does not define a vertical.
    #[error("gravity is {gravity:?} m/s2: the angle of a surface needs gravity along -z", gravity = gravity.as_slice())]
    NoVertical {
        /// Gravity [m/s²].
        gravity: Vec3,
    },
    /// The heap is too small or too flat.
    #[error(
        "only {strips} strips of columns are on the slope, and three are needed: the heap is too flat or has too few \
         particles"
    )]
    NoSurface {
        /// Number of strips between foot and top.
        strips: usize,
    },
    /// The plane is across a periodic axis.
    #[error(
        "{axis} is periodic: snapshots do not show in which direction a particle crossed a plane across it"
    )]
    AcrossPeriod {
        /// The axis.
        axis: &'static str,
    },
    /// The outlet does not exist.
    #[error(
        "history.csv has no outlet `{name}`; {}",
        if known.is_empty() { "it has no outlet, so give a plane, -z=0.05".to_owned() } else { format!("it has: {}", listed(known, MOST_NAMED)) }
    )]
    NoSuchOutlet {
        /// Requested name.
        name: String,
        /// Names of all outlets.
        known: Vec<String>,
    },
    /// A window was given, and nothing has a mean.
    #[error(
        "nothing to average in the window: history.csv has no wall that turns and no stress of a cell or of walls; give \
         --flow, or omit --window"
    )]
    NothingToAverage,
    /// There are fewer than two rows for a rate.
    #[error(
        "{rows} rows in the window, and a rate or a mean needs two: give more snapshots (--series), or a larger --window"
    )]
    FewRows {
        /// Number of rows.
        rows: usize,
    },
}

impl MeasureError {
    /// Whether only this snapshot has nothing to measure, while another of its run may have, perhaps within the same margin.
    pub(super) const fn is_of_one_state(&self, has_margin: bool) -> bool {
        match self {
            Self::NobodyThere | Self::OneGroup { .. } | Self::NoSurface { .. } => true,
            Self::Post(error) => has_margin && error.is_of_margin(),
            _ => false,
        }
    }
}
