//! The ball: the shape with closed forms for everything.

use crate::math::Vec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A ball about the origin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sphere {
    /// Radius [m].
    pub radius: f64,
}

impl Sphere {
    /// Farthest point along `direction` [m].
    #[inline]
    pub fn support(&self, direction: &Vec3) -> Vec3 {
        direction * (self.radius / direction.norm())
    }

    /// Volume [m³].
    pub fn volume(&self) -> f64 {
        4.0 / 3.0 * PI * self.radius * self.radius * self.radius
    }

    /// Principal moments of inertia over mass [m²].
    pub fn gyration(&self) -> Vec3 {
        Vec3::repeat(0.4 * self.radius * self.radius)
    }
}
