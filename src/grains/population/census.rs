//! Counts of particles of a shape by size.
//!
//! The cells have equal ratios, between the limits of the shape's law or of scales from lists beyond them. Sums are of integers, so they are the
//! same in any order.

use super::Library;
use crate::ids::ShapeId;
use crate::population::sizes::By;

/// Resolution of the sums of squares and cubes of scales over the largest: sums of 10^8 still fit.
const PARTS: f64 = (1_u64 << 36) as f64;

/// Numbers of particles by size.
#[derive(Clone, Debug, PartialEq)]
pub struct Census {
    limits: [f64; 2],
    /// Sums by the upper edge of the cell, from that of cell -1: numbers, then cubes in parts of the largest.
    ///
    /// They are followed by the sums of scales and of their squares, in parts of the largest.
    sums: Vec<i64>,
}

impl Census {
    /// Number of cells between the smallest and the largest scale.
    pub const CELLS: usize = 4096;
    /// Number of sums.
    pub const SUMS: usize = 2 * (Self::CELLS + 1) + 2;

    /// An empty census; `None` if the shape has a single size.
    pub fn of_shape(shape: ShapeId, library: &Library) -> Option<Self> {
        let law = library.sizes[shape.index()].distribution()?.limits();
        let known = library.scales[shape.index()];
        let limits = [law[0].min(known[0]), law[1].max(known[1])];
        Some(Self { limits, sums: vec![0; Self::SUMS] })
    }

    /// Least and largest scale. A census with other limits cannot be added.
    pub const fn limits(&self) -> [f64; 2] {
        self.limits
    }

    /// Counts one particle.
    pub fn add(&mut self, scale: f64) {
        let [least, largest] = self.limits;
        let place = libm::log(scale / least) / libm::log(largest / least) * Self::CELLS as f64;
        // It is counted below the upper edge of its cell.
        let edge = 1 + (place.max(0.0) as usize).min(Self::CELLS - 1);
        let part = scale / largest;
        let cubes = Self::CELLS + 1;
        self.sums[edge] += 1;
        self.sums[cubes + edge] += (part * part * part * PARTS) as i64;
        self.sums[2 * cubes] += (part * PARTS) as i64;
        self.sums[2 * cubes + 1] += (part * part * PARTS) as i64;
    }

    /// All sums, [`Self::SUMS`] numbers.
    pub fn sums(&self) -> &[i64] {
        &self.sums
    }

    /// All sums, to be summed over ranks.
    pub fn sums_mut(&mut self) -> &mut [i64] {
        &mut self.sums
    }

    /// Adds the sums of another census with the same limits.
    pub fn add_all(&mut self, sums: &[i64]) {
        for (all, other) in self.sums.iter_mut().zip(sums) {
            *all += other;
        }
    }

    /// Number of particles counted.
    pub fn count(&self) -> i64 {
        self.sums[..=Self::CELLS].iter().sum()
    }

    /// Scale at an edge of the cells.
    pub fn edge(&self, edge: usize) -> f64 {
        let [least, largest] = self.limits;
        least * libm::pow(largest / least, edge as f64 / Self::CELLS as f64)
    }

    /// Shares below all edges.
    pub fn below(&self, by: By) -> Vec<f64> {
        let cubes = Self::CELLS + 1;
        let cells = match by {
            By::Number => &self.sums[..cubes],
            By::Mass => &self.sums[cubes..2 * cubes],
        };
        let all = cells.iter().sum::<i64>().max(1) as f64;
        let summed = cells.iter().scan(0, |sum, &one| {
            *sum += one;
            Some(*sum as f64 / all)
        });
        summed.collect()
    }

    /// Means of scales, of their squares and of their cubes.
    pub fn mean_powers(&self) -> [f64; 3] {
        let (cubes, count) = (Self::CELLS + 1, self.count().max(1) as f64);
        let [_, largest] = self.limits;
        let of_cubes = self.sums[cubes..2 * cubes].iter().sum::<i64>();
        let sums = [self.sums[2 * cubes], self.sums[2 * cubes + 1], of_cubes];
        let mean = |sum: i64, power: i32| sum as f64 / PARTS / count * largest.powi(power);
        [mean(sums[0], 1), mean(sums[1], 2), mean(sums[2], 3)]
    }
}
