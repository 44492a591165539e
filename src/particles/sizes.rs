//! Which sizes new particles have.

use crate::random::Random;
use serde::{Deserialize, Serialize};

/// How the scales of the particles of a shape are distributed, by number. A scale is the ratio of a
/// particle's lengths to those of its shape; mass goes with its cube, moments of inertia with its fifth power.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Sizes {
    /// All particles are as large as their shape.
    #[default]
    One,
    /// Any scale between these two is equally likely.
    Uniform([f64; 2]),
}

impl Sizes {
    /// The scale of a new particle. Nothing is drawn if there is no choice.
    pub fn draw(&self, random: &mut Random) -> f64 {
        match *self {
            Self::One => 1.0,
            Self::Uniform([least, largest]) => least + (largest - least) * random.unit(),
        }
    }

    /// Least and largest scale.
    pub const fn scales(&self) -> [f64; 2] {
        match *self {
            Self::One => [1.0; 2],
            Self::Uniform(scales) => scales,
        }
    }

    /// In words, for `--plan`; empty if all are alike.
    pub fn words(&self) -> String {
        match *self {
            Self::One => String::new(),
            Self::Uniform([a, b]) => format!("uniform from {a:?} to {b:?}, by number"),
        }
    }

    /// The mean cube of scales: the mean volume of particles over that of their shape.
    pub fn mean_volume(&self) -> f64 {
        match *self {
            Self::One => 1.0,
            Self::Uniform([a, b]) => 0.25 * (a + b) * (a * a + b * b),
        }
    }
}
