//! Sphere: the shape with closed forms for everything.

use super::{Convex, CurvedSupport, Ellipsoid, Form};
use crate::math::{Mat3, Vec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A sphere about the origin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sphere {
    /// Radius [m].
    pub radius: f64,
}

impl Convex for Sphere {
    #[inline]
    fn support(&self, direction: &Vec3) -> Vec3 {
        direction * (self.radius / direction.norm())
    }

    fn bounding_radius(&self) -> f64 {
        self.radius
    }

    fn inscribed_radius(&self) -> f64 {
        self.radius
    }

    fn volume(&self) -> f64 {
        4.0 / 3.0 * PI * self.radius * self.radius * self.radius
    }

    fn gyration(&self) -> Vec3 {
        Vec3::repeat(0.4 * self.radius * self.radius)
    }

    fn half_lengths(&self) -> Vec3 {
        Vec3::repeat(self.radius)
    }

    fn contains(&self, point: &Vec3) -> bool {
        point.norm() <= self.radius
    }

    #[inline]
    fn curved_support(&self, direction: &Vec3) -> Option<CurvedSupport> {
        Ellipsoid { semi_axes: Vec3::repeat(self.radius) }.curved_support(direction)
    }

    fn smallest_curvature_radius(&self) -> f64 {
        self.radius
    }

    #[inline]
    fn form(&self, _: &Mat3) -> Form {
        let square = self.radius * self.radius;
        [square, square, square, 0.0, 0.0, 0.0]
    }

    #[inline]
    fn margin(&self) -> f64 {
        self.radius
    }

    #[inline]
    fn core_support(&self, _: &Vec3) -> Vec3 {
        Vec3::zeros()
    }
}
