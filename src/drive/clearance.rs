//! How much room a wall that a drive moves has between the opposite side and far out of the domain.

use crate::cell::Cell;
use crate::population::Library;
use crate::walls::{Across, Wall, ends};

/// Where a wall can press on nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Astray {
    /// So near to the opposite wall, or to the domain's side, that nothing fits between.
    Closed {
        /// How near [m].
        gap: f64,
    },
    /// A plane out of the domain by more than the domain's width.
    Open,
    /// Triangles out of the domain, on whatever side.
    Gone,
}

impl Astray {
    /// `None` of a wall that is where it can press on the thinnest particle.
    pub(super) fn of(wall: &Wall, walls: &[Wall], cell: &Cell, library: &Library) -> Option<Self> {
        if wall.is_far_out_of(cell) {
            return Some(Self::Gone);
        }
        let domain @ (low, high) = cell.corners();
        // Of a plane across an axis what is between it and what it faces; of others what they leave of the domain.
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
