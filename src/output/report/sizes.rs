//! Sizes of particles, as [`super::Report`] has them.

use serde::{Deserialize, Serialize};

/// Sizes of the particles of a shape, as scales of the shape's lengths, beside what the scene asks for: of those that are there at the end,
/// and of those that have left through outlets in the stage. Quantiles are found to a cell of [`crate::population::census::Census`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SizesOf {
    /// The shape's name.
    pub shape: String,
    /// The law asked for, in words.
    pub law: String,
    /// How many particles there are or were.
    pub particles: u64,
    /// How many of them have left.
    #[serde(default)]
    pub left: u64,
    /// What was asked for.
    pub asked: Figures,
    /// What is there.
    pub found: Figures,
    /// The largest difference of the two cumulative curves by number (Kolmogorov and Smirnov's).
    pub largest_difference_by_number: f64,
    /// The same by mass.
    pub largest_difference_by_mass: f64,
    /// The cumulative curves.
    pub curve: Vec<Below>,
}

impl SizesOf {
    /// Rows of a curve, less one.
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

/// Shares below a scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Below {
    /// The scale.
    pub scale: f64,
    /// Asked for, by number.
    pub asked_by_number: f64,
    /// Found, by number.
    pub found_by_number: f64,
    /// Asked for, by mass.
    pub asked_by_mass: f64,
    /// Found, by mass.
    pub found_by_mass: f64,
}
