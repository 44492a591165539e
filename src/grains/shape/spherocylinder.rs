//! Spherocylinder: all points within a radius of a segment.

use super::{Convex, Core};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A cylinder along x about the origin, with a hemisphere on each end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spherocylinder {
    /// Length of the axis, from the centre of one sphere to that of the other [m].
    pub length: f64,
    /// Radius of cylinder and spheres [m].
    pub radius: f64,
}

impl Spherocylinder {
    fn cylinder(&self) -> f64 {
        PI * self.radius * self.radius * self.length
    }

    fn sphere(&self) -> f64 {
        4.0 / 3.0 * PI * self.radius * self.radius * self.radius
    }
}

impl Convex for Spherocylinder {
    #[inline]
    fn support(&self, direction: &Vec3) -> Vec3 {
        self.core_support(direction) + direction * (self.radius / direction.norm())
    }

    /// Half the length from tip to tip.
    fn bounding_radius(&self) -> f64 {
        0.5 * self.length + self.radius
    }

    fn inscribed_radius(&self) -> f64 {
        self.radius
    }

    fn volume(&self) -> f64 {
        self.cylinder() + self.sphere()
    }

    /// Sum for a cylinder and two hemispheres, whose centres of mass are `3/8 r` outside the ends of the axis.
    fn gyration(&self) -> Vec3 {
        let (l, r) = (self.length, self.radius);
        let (cylinder, sphere) = (self.cylinder(), self.sphere());
        let along = cylinder * (0.5 * r * r) + sphere * (0.4 * r * r);
        let across = cylinder * (0.25 * r * r + l * l / 12.0)
            + sphere * (0.4 * r * r + 0.25 * l * l + 0.375 * l * r);
        Vec3::new(along, across, across) / (cylinder + sphere)
    }

    fn half_lengths(&self) -> Vec3 {
        Vec3::new(self.bounding_radius(), self.radius, self.radius)
    }

    fn contains(&self, point: &Vec3) -> bool {
        let half = 0.5 * self.length;
        let beside = Vec3::new(point.x - point.x.clamp(-half, half), point.y, point.z);
        beside.norm() <= self.radius
    }

    fn smallest_curvature_radius(&self) -> f64 {
        self.radius
    }

    #[inline]
    fn margin(&self) -> f64 {
        self.radius
    }

    /// The end of the axis that is farther along `direction`.
    #[inline]
    fn core_support(&self, direction: &Vec3) -> Vec3 {
        let half = 0.5 * self.length;
        Vec3::new(if direction.x < 0.0 { -half } else { half }, 0.0, 0.0)
    }

    #[inline]
    fn core(&self) -> Core<'_> {
        Core::Segment(0.5 * self.length)
    }
}
