//! Plane walls: every rank has them all.

use crate::cell::Cell;
use crate::ids::ShapeId;
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// A plane that particles do not pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wall {
    /// Its name in the scene.
    pub name: String,
    /// A point of the plane [m].
    pub point: Vec3,
    /// Unit normal, towards the particles.
    pub normal: Vec3,
    /// Velocity [m/s].
    pub velocity: Vec3,
    /// Does the scene move it, at a given velocity or by a servo?
    pub moves: bool,
    /// Its half-space in the library of shapes.
    pub shape: ShapeId,
    /// Where it stood when the pairs were listed [m].
    pub listed_at: Vec3,
}

impl Wall {
    /// The axis along which its normal lies, and the normal's component, 1 or -1; `None` if it is tilted.
    pub fn across(&self) -> Option<(usize, f64)> {
        (0..3).map(|axis| (axis, self.normal[axis])).find(|&(_, along)| along.abs() == 1.0)
    }
}

/// Where the room of the particles ends along an axis: at the innermost walls that stand across it [m];
/// `None` on a side without one.
pub fn ends(walls: &[Wall], axis: usize) -> [Option<f64>; 2] {
    let places = |inwards: f64| {
        let facing = move |wall: &&Wall| wall.across() == Some((axis, inwards));
        walls.iter().filter(facing).map(move |wall| wall.point[axis])
    };
    [places(1.0).reduce(f64::max), places(-1.0).reduce(f64::min)]
}

/// Area on which the particles press against a wall across an axis: periods, or distances of walls, along
/// both other axes [m²]; `None` if a side is open.
pub fn area(walls: &[Wall], cell: &Cell, axis: usize) -> Option<f64> {
    let between_walls = |axis| match ends(walls, axis) {
        [Some(low), Some(high)] => Some(high - low),
        _ => None,
    };
    let width = |axis| cell.period(axis).or_else(|| between_walls(axis));
    Some(width((axis + 1) % 3)? * width((axis + 2) % 3)?)
}
