//! The solid side of a plane: every wall is one.

use super::Convex;
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// All points `p` with `(p - point on the plane) · normal <= 0`; particles live on the other side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HalfSpace {
    /// Unit normal, out of the solid, towards the particles.
    pub normal: Vec3,
}

/// It has no support point and no end, and is never asked for them: whatever meets a wall has a closed form.
impl Convex for HalfSpace {
    #[inline]
    fn support(&self, _: &Vec3) -> Vec3 {
        Vec3::repeat(f64::NAN)
    }

    fn bounding_radius(&self) -> f64 {
        f64::INFINITY
    }

    fn inscribed_radius(&self) -> f64 {
        f64::INFINITY
    }

    fn volume(&self) -> f64 {
        f64::INFINITY
    }

    fn gyration(&self) -> Vec3 {
        Vec3::repeat(f64::INFINITY)
    }

    fn half_lengths(&self) -> Vec3 {
        Vec3::repeat(f64::INFINITY)
    }

    fn contains(&self, point: &Vec3) -> bool {
        self.normal.dot(point) <= 0.0
    }
}
