//! The spherocylinder: all points within a radius of a segment.

use crate::math::Vec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A cylinder along x about the origin, with a half ball on each end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Spherocylinder {
    /// Length of the axis, from the centre of one ball to that of the other [m].
    pub length: f64,
    /// Radius of cylinder and balls [m].
    pub radius: f64,
}

impl Spherocylinder {
    /// Farthest point along `direction` [m].
    #[inline]
    pub fn support(&self, direction: &Vec3) -> Vec3 {
        self.core_support(direction) + direction * (self.radius / direction.norm())
    }

    /// The end of the axis that is farther along `direction` [m].
    #[inline]
    pub fn core_support(&self, direction: &Vec3) -> Vec3 {
        let half = 0.5 * self.length;
        Vec3::new(if direction.x < 0.0 { -half } else { half }, 0.0, 0.0)
    }

    /// Half the length from tip to tip [m].
    pub fn bounding_radius(&self) -> f64 {
        0.5 * self.length + self.radius
    }

    /// Half lengths of the box around it [m].
    pub fn half_extents(&self) -> Vec3 {
        Vec3::new(self.bounding_radius(), self.radius, self.radius)
    }

    fn cylinder(&self) -> f64 {
        PI * self.radius * self.radius * self.length
    }

    fn ball(&self) -> f64 {
        4.0 / 3.0 * PI * self.radius * self.radius * self.radius
    }

    /// Volume [m³].
    pub fn volume(&self) -> f64 {
        self.cylinder() + self.ball()
    }

    /// Principal moments of inertia over mass [m²], of a cylinder and two half balls, whose centres of mass
    /// are `3/8 r` outside the ends of the axis.
    pub fn gyration(&self) -> Vec3 {
        let (l, r) = (self.length, self.radius);
        let (cylinder, ball) = (self.cylinder(), self.ball());
        let along = cylinder * (0.5 * r * r) + ball * (0.4 * r * r);
        let across = cylinder * (0.25 * r * r + l * l / 12.0)
            + ball * (0.4 * r * r + 0.25 * l * l + 0.375 * l * r);
        Vec3::new(along, across, across) / (cylinder + ball)
    }
}
