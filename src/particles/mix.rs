//! Which shapes new particles have.

use crate::ids::ShapeId;
use serde::{Deserialize, Serialize};

/// Shapes and the share of the particles, by number, that each gets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mix {
    /// Shape and cumulative share, the last one 1.
    pub cumulative: Vec<(ShapeId, f64)>,
}

impl Mix {
    /// From shares of any positive sum.
    pub fn new(shares: &[(ShapeId, f64)]) -> Self {
        let total: f64 = shares.iter().map(|&(_, share)| share).sum();
        let mut sum = 0.0;
        let mut cumulative: Vec<_> = shares
            .iter()
            .map(|&(shape, share)| {
                sum += share;
                (shape, sum / total)
            })
            .collect();
        if let Some(last) = cumulative.last_mut() {
            last.1 = 1.0;
        }
        Self { cumulative }
    }

    /// The shape at this place of [0, 1).
    pub fn pick(&self, unit: f64) -> ShapeId {
        let at = self.cumulative.partition_point(|&(_, share)| share <= unit);
        self.cumulative[at.min(self.cumulative.len() - 1)].0
    }

    /// Shapes and their shares of 1.
    pub fn shares(&self) -> impl Iterator<Item = (ShapeId, f64)> + '_ {
        let below = std::iter::once(0.0).chain(self.cumulative.iter().map(|&(_, share)| share));
        self.cumulative.iter().zip(below).map(|(&(shape, share), below)| (shape, share - below))
    }

    /// The shapes.
    pub fn shapes(&self) -> impl Iterator<Item = ShapeId> + '_ {
        self.cumulative.iter().map(|&(shape, _)| shape)
    }
}
