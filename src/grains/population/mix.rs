//! Mixes of shapes for new particles.

use crate::ids::ShapeId;
use serde::{Deserialize, Serialize};

/// Shapes with their shares of the particles by number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mix {
    /// Shape and cumulative share; the last is 1.
    pub cumulative: Vec<(ShapeId, f64)>,
}

impl Mix {
    /// A mix from shares of any positive sum.
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

    /// A mix from shares of the mass, of any positive sum.
    ///
    /// The share by number is that by mass over the mean mass of a particle of the shape [kg].
    pub fn by_mass(shares: &[(ShapeId, f64)], mean_mass: impl Fn(ShapeId) -> f64) -> Self {
        let masses = || shares.iter().map(|&(shape, _)| mean_mass(shape));
        // Ratios stay within the range of floating-point numbers, however small masses are.
        let least = masses().fold(f64::INFINITY, f64::min);
        let by_number: Vec<_> = shares
            .iter()
            .zip(masses())
            .map(|(&(shape, share), mass)| (shape, share * (least / mass)))
            .collect();
        Self::new(&by_number)
    }

    /// Shape at this position in [0, 1).
    pub fn pick(&self, unit: f64) -> ShapeId {
        let at = self.cumulative.partition_point(|&(_, share)| share <= unit);
        self.cumulative[at.min(self.cumulative.len() - 1)].0
    }

    /// Shapes with their shares of 1.
    pub fn shares(&self) -> impl Iterator<Item = (ShapeId, f64)> + '_ {
        let below = std::iter::once(0.0).chain(self.cumulative.iter().map(|&(_, share)| share));
        self.cumulative.iter().zip(below).map(|(&(shape, share), below)| (shape, share - below))
    }

    /// The shapes.
    pub fn shapes(&self) -> impl Iterator<Item = ShapeId> + '_ {
        self.cumulative.iter().map(|&(shape, _)| shape)
    }
}

#[cfg(test)]
mod tests {
    use super::Mix;
    use crate::ids::ShapeId;

    /// A shape with twice the mass of another, whose particles are eight times as heavy, has a fourth of the number.
    #[test]
    fn shares_by_mass_are_divided_by_the_mass_of_one() {
        for unit in [1.0, 1e-300, 1e300] {
            let mean_mass = |shape: ShapeId| [1.0, 3.0, 8.0][shape.index()] * unit;
            let mix = Mix::by_mass(&[(ShapeId(0), 1e10), (ShapeId(2), 2e10)], mean_mass);
            let shares: Vec<_> = mix.shares().collect();
            assert_eq!(shares, [(ShapeId(0), 0.8), (ShapeId(2), 1.0 - 0.8)], "{unit:e}");
        }
        // A single shape has the whole share at any mass.
        let shares = [(ShapeId(1), 7.0)];
        assert_eq!(Mix::by_mass(&shares, |_| 0.3), Mix::new(&shares));
    }
}
