//! Solid side of a plane: a facet of a wall.

use super::Convex;
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// All points `p` with `p · normal <= offset`, in the axes of the wall; particles are on the other side.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HalfSpace {
    /// Unit normal, out of the solid, towards the particles.
    pub normal: Vec3,
    /// Distance of the plane in front of the wall's reference point, along the normal [m].
    pub offset: f64,
}

impl HalfSpace {
    /// A half-space whose plane contains the reference point of its wall.
    pub const fn at_reference(normal: Vec3) -> Self {
        Self { normal, offset: 0.0 }
    }
}

/// It has no support point and no bounds, and resolvers never ask for them: all contacts with a plane have closed forms.
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
