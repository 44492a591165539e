//! Sizes of particles, part of [`super::Report`].

use serde::{Deserialize, Serialize};

/// Sizes of the particles of a shape, as scales of the shape's lengths, beside the requested distribution. They include the
/// particles present at the end and those that left through outlets in the stage. Quantiles are accurate to a cell of
/// [`crate::population::census::Census`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizesOf {
    /// Name of the shape.
    pub shape: String,
    /// Requested distribution, in words.
    pub law: String,
    /// Number of particles, present or gone.
    pub particles: u64,
    /// Number of particles that have left.
    #[serde(default)]
    pub left: u64,
    /// Figures of the requested distribution.
    pub asked: Figures,
    /// Figures of the sizes found.
    pub found: Figures,
    /// Largest difference of the two cumulative curves by number (Kolmogorov-Smirnov distance).
    pub largest_difference_by_number: f64,
    /// Largest difference of the two cumulative curves by mass.
    pub largest_difference_by_mass: f64,
    /// The cumulative curves.
    pub curve: Vec<Below>,
}

impl SizesOf {
    /// Number of intervals of a curve, one less than its rows.
    pub const ROWS: usize = 64;
}

/// Figures of a distribution of scales.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// 10, 50 and 90 % by number are below these.
    pub by_number_d10_d50_d90: [f64; 3],
    /// 10, 50 and 90 % by mass are below these.
    pub by_mass_d10_d50_d90: [f64; 3],
    /// Mean scale, by number.
    pub mean: f64,
    /// Standard deviation, by number.
    pub deviation: f64,
    /// Sum of cubes over sum of squares.
    pub sauter_mean: f64,
}

/// Cumulative shares below a scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Below {
    /// The scale.
    pub scale: f64,
    /// Requested share by number.
    pub asked_by_number: f64,
    /// Found share by number.
    pub found_by_number: f64,
    /// Requested share by mass.
    pub asked_by_mass: f64,
    /// Found share by mass.
    pub found_by_mass: f64,
}
