//! A box divided into equal cells.

use super::errors::MeasureError;
use super::region::Bounds;
use crate::math::Vec3;

/// Cells of a box, x fastest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Lowest corner of the box [m].
    pub low: Vec3,
    /// Sides of a cell [m].
    pub sides: Vec3,
    /// Number of cells along x, y, z.
    pub cells: [usize; 3],
}

/// Largest number of cells: some gigabytes of fields.
const MOST: f64 = 2e7;

impl Grid {
    /// Whole cells of about this side [m] in the box.
    ///
    /// # Errors
    /// If the box has no volume, or there are too many cells.
    pub fn of(bounds: &Bounds, side: f64) -> Result<Self, MeasureError> {
        Self::with(bounds, side, f64::round)
    }

    /// Whole cells of at most this side [m] in the box.
    ///
    /// # Errors
    /// See [`Grid::of`].
    pub fn of_at_most(bounds: &Bounds, side: f64) -> Result<Self, MeasureError> {
        // Whole numbers up to rounding are kept.
        Self::with(bounds, side, |cells| (cells * (1.0 - 1e-9)).ceil())
    }

    fn with(bounds: &Bounds, side: f64, whole: impl Fn(f64) -> f64) -> Result<Self, MeasureError> {
        let lengths = bounds.lengths();
        if !(side > 0.0 && side.is_finite()) {
            return Err(MeasureError::NoSide { side });
        }
        let counts = lengths.map(|length| whole(length / side).max(1.0));
        let has_volume = lengths.min() > 0.0;
        if !has_volume {
            return Err(MeasureError::TooManyCells { cells: counts.product(), most: MOST });
        }
        Self::of_counts(bounds.low, lengths.component_div(&counts), &counts)
    }

    fn of_counts(low: Vec3, sides: Vec3, counts: &Vec3) -> Result<Self, MeasureError> {
        let all = counts.product();
        if all <= MOST {
            Ok(Self { low, sides, cells: [0, 1, 2].map(|k| counts[k] as usize) })
        } else {
            Err(MeasureError::TooManyCells { cells: all, most: MOST })
        }
    }

    /// The grid extended by whole cells on each side until the box lies in it. Existing cells stay in place.
    ///
    /// # Errors
    /// If there are too many cells.
    pub fn reaching(&self, bounds: &Bounds) -> Result<Self, MeasureError> {
        let counts = Vec3::from(self.cells.map(|cells| cells as f64));
        let high = self.low + counts.component_mul(&self.sides);
        let missing =
            |from_to: Vec3| from_to.component_div(&self.sides).map(|n| (n - 1e-9).ceil().max(0.0));
        let [below, above] = [missing(self.low - bounds.low), missing(bounds.high - high)];
        let low = self.low - below.component_mul(&self.sides);
        Self::of_counts(low, self.sides, &(counts + below + above))
    }

    /// The grid shifted to have a face across an axis at this place [m], with one more cell to cover the
    /// uncovered side.
    ///
    /// # Errors
    /// If there are too many cells.
    pub fn with_face(&self, axis: usize, place: f64) -> Result<Self, MeasureError> {
        let side = self.sides[axis];
        let faces = (place - self.low[axis]) / side;
        let off = faces - faces.round();
        let (mut low, mut counts) = (self.low, Vec3::from(self.cells.map(|cells| cells as f64)));
        low[axis] += off * side - if off > 0.0 { side } else { 0.0 };
        counts[axis] += if off == 0.0 { 0.0 } else { 1.0 };
        Self::of_counts(low, self.sides, &counts)
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.cells.iter().product()
    }

    /// Always false: there is at least one cell.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Volume of a cell [m³].
    pub fn volume(&self) -> f64 {
        self.sides.product()
    }

    /// Centre of a cell [m].
    pub fn centre(&self, cell: usize) -> Vec3 {
        let [x, y, _] = self.cells;
        let place = [cell % x, cell / x % y, cell / x / y];
        self.low + Vec3::from_fn(|k, _| (place[k] as f64 + 0.5) * self.sides[k])
    }

    /// Cell with these indices along the axes, if there is one.
    pub fn cell(&self, place: [i64; 3]) -> Option<usize> {
        let inside = (0..3).all(|k| (0..self.cells[k] as i64).contains(&place[k]));
        let [x, y, z] = place.map(|index| index as usize);
        inside.then(|| (z * self.cells[1] + y) * self.cells[0] + x)
    }

    /// Cell that contains a point, if there is one.
    pub fn cell_at(&self, point: &Vec3) -> Option<usize> {
        self.cell(self.place_of(point))
    }

    /// Cell that contains a point; for a point outside, the nearest along each axis.
    pub fn nearest_cell(&self, point: &Vec3) -> Option<usize> {
        let place = self.place_of(point);
        self.cell([0, 1, 2].map(|k| place[k].clamp(0, self.cells[k] as i64 - 1)))
    }

    fn place_of(&self, point: &Vec3) -> [i64; 3] {
        [0, 1, 2].map(|k| ((point[k] - self.low[k]) / self.sides[k]).floor() as i64)
    }
}
