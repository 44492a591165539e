//! A box cut into equal cells.

use super::measures::MeasureError;
use super::region::Bounds;
use crate::math::Vec3;

/// Cells of a box, x fastest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Lowest corner of the box [m].
    pub low: Vec3,
    /// Sides of a cell [m].
    pub sides: Vec3,
    /// How many along x, y, z.
    pub cells: [usize; 3],
}

/// So many cells at most: some gigabytes of fields.
const MOST: f64 = 2e7;

impl Grid {
    /// Cells of about this side [m], whole ones in the box.
    ///
    /// # Errors
    /// A box without volume, or too many cells.
    pub fn of(bounds: &Bounds, side: f64) -> Result<Self, MeasureError> {
        let lengths = bounds.lengths();
        if !(side > 0.0 && side.is_finite()) {
            return Err(MeasureError::NoSide { side });
        }
        let counts = lengths.map(|length| (length / side).round().max(1.0));
        if !(counts.product() <= MOST && lengths.min() > 0.0) {
            return Err(MeasureError::TooManyCells { cells: counts.product(), most: MOST });
        }
        let cells = [0, 1, 2].map(|k| counts[k] as usize);
        Ok(Self { low: bounds.low, sides: lengths.component_div(&counts), cells })
    }

    /// How many cells.
    pub fn len(&self) -> usize {
        self.cells.iter().product()
    }

    /// Never: there is a cell at least.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Volume of a cell [m³].
    pub fn volume(&self) -> f64 {
        self.sides.product()
    }

    /// The middle of a cell [m].
    pub fn centre(&self, cell: usize) -> Vec3 {
        let [x, y, _] = self.cells;
        let place = [cell % x, cell / x % y, cell / x / y];
        self.low + Vec3::from_fn(|k, _| (place[k] as f64 + 0.5) * self.sides[k])
    }

    /// The cell with these indices along the axes, if there is one.
    pub fn cell(&self, place: [i64; 3]) -> Option<usize> {
        let inside = (0..3).all(|k| (0..self.cells[k] as i64).contains(&place[k]));
        let [x, y, z] = place.map(|index| index as usize);
        inside.then(|| (z * self.cells[1] + y) * self.cells[0] + x)
    }

    /// The cell that a point lies in, if there is one.
    pub fn cell_at(&self, point: &Vec3) -> Option<usize> {
        let at = |k: usize| ((point[k] - self.low[k]) / self.sides[k]).floor() as i64;
        self.cell([at(0), at(1), at(2)])
    }
}
