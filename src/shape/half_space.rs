//! The solid side of a plane: every wall is one.

use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// All points `p` with `(p - point on the plane) · normal <= 0`; particles live on the other side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HalfSpace {
    /// Unit normal, out of the solid, towards the particles.
    pub normal: Vec3,
}
