//! Plane walls: every rank has them all.

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
    /// Its half-space in the library of shapes.
    pub shape: ShapeId,
    /// Where it stood when the pairs were listed [m].
    pub listed_at: Vec3,
}
