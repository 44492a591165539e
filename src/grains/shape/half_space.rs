//! The solid side of a plane: a facet of a wall.

use super::Convex;
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// All points `p` with `p · normal <= offset`, in the axes of its wall; particles live on the other side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HalfSpace {
    /// Unit normal, out of the solid, towards the particles.
    pub normal: Vec3,
    /// How far in front of the wall's reference point the plane lies, along the normal [m].
    pub offset: f64,
}

impl HalfSpace {
    /// Whose plane goes through the reference point of its wall.
    pub const fn at_reference(normal: Vec3) -> Self {
        Self { normal, offset: 0.0 }
    }
}

/// It has no support point and no end, and is never asked for them: whatever meets a plane has a closed form.
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
        self.normal.dot(point) <= self.offset
    }
}
