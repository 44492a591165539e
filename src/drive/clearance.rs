//! Room of a wall that a drive moves, between the opposite side and the outside of the domain.

use crate::cell::Cell;
use crate::population::Library;
use crate::walls::{Across, Wall, ends};

/// State of a wall that can press on no particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Unloaded {
    /// So near to the opposite wall, or to the domain's side, that no particle fits between.
    Closed {
        /// Gap [m].
        gap: f64,
    },
    /// Plane outside the domain by more than the domain's width.
    Open,
    /// Triangles outside the domain, on any side.
    Gone,
}

impl Unloaded {
    /// `None` for a wall that can press on the thinnest particle.
    pub(super) fn of(wall: &Wall, walls: &[Wall], cell: &Cell, library: &Library) -> Option<Self> {
        if wall.is_far_out_of(cell) {
            return Some(Self::Gone);
        }
        let domain @ (low, high) = cell.corners();
        // For a plane across an axis, the gap to the opposite side; for others the part of the domain that they
        // leave.
        let (gap, outside, width) = if let Some(Across { axis, inwards, place }) = wall.across() {
            let [lowest, highest] = ends(walls, axis);
            let (place, own, facing) = if inwards > 0.0 {
                (place, low[axis], highest.unwrap_or(high[axis]))
            } else {
                (-place, -high[axis], -lowest.unwrap_or(low[axis]))
            };
            (facing - place, own - place, high[axis] - low[axis])
        } else {
            (wall.room_before(&domain)?, -wall.depth(&domain), (high - low).norm())
        };
        if gap < library.least_inscribed_radius() {
            return Some(Self::Closed { gap });
        }
        (outside > width).then_some(Self::Open)
    }
}
