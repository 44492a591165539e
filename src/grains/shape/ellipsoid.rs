//! Tri-axial ellipsoid `x²/a² + y²/b² + z²/c² = 1`.

use super::{Convex, CurvedSupport};
use crate::math::{Mat3, Vec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Matrix `A = R diag(a²) Rᵀ` of an ellipsoid in place: xx, yy, zz, xy, xz, yz [m²].
///
/// The surface is `x·A⁻¹ x = 1`, and the support function `√(n·A n)`.
pub type Form = [f64; 6];

/// An ellipsoid about the origin with its axes along x, y, z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ellipsoid {
    /// Half the length along each local axis [m].
    pub semi_axes: Vec3,
}

impl Convex for Ellipsoid {
    /// `D² d / |D d|` with `D = diag(semi_axes)`.
    #[inline]
    fn support(&self, direction: &Vec3) -> Vec3 {
        let scaled = self.semi_axes.component_mul(direction);
        let length = scaled.norm();
        self.semi_axes.component_mul(&(scaled / length))
    }

    #[inline]
    fn form(&self, frame: &Mat3) -> Form {
        let x = frame.column(0) * self.semi_axes.x;
        let y = frame.column(1) * self.semi_axes.y;
        let z = frame.column(2) * self.semi_axes.z;
        let entry = |i: usize, j: usize| (x[i] * x[j] + y[i] * y[j]) + z[i] * z[j];
        [entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)]
    }

    #[inline]
    fn curved_support(&self, direction: &Vec3) -> Option<CurvedSupport> {
        let scaled = self.semi_axes.component_mul(direction);
        let inverse = 1.0 / scaled.norm();
        let n = scaled * inverse;
        // Two unit vectors across n: Duff et al. (2017), "Building an orthonormal basis, revisited".
        let sign = 1.0_f64.copysign(n.z);
        let (a, b) = (-1.0 / (sign + n.z), -n.x * (n.y / (sign + n.z)));
        let across = [
            Vec3::new(1.0 + sign * (n.x * n.x * a), sign * b, -sign * n.x),
            Vec3::new(b, sign + n.y * n.y * a, -n.y),
        ];
        Some(CurvedSupport {
            point: self.semi_axes.component_mul(&n),
            weight: [inverse; 2],
            along: across.map(|v| self.semi_axes.component_mul(&v)),
        })
    }

    fn bounding_radius(&self) -> f64 {
        self.semi_axes.max()
    }

    fn inscribed_radius(&self) -> f64 {
        self.semi_axes.min()
    }

    /// Shortest² / longest.
    fn smallest_curvature_radius(&self) -> f64 {
        let shortest = self.inscribed_radius();
        shortest * shortest / self.bounding_radius()
    }

    fn volume(&self) -> f64 {
        4.0 / 3.0 * PI * self.semi_axes.x * self.semi_axes.y * self.semi_axes.z
    }

    /// `((b²+c²), (a²+c²), (a²+b²)) / 5`
    fn gyration(&self) -> Vec3 {
        let s = self.semi_axes.component_mul(&self.semi_axes);
        Vec3::new(s.y + s.z, s.x + s.z, s.x + s.y) / 5.0
    }

    fn half_lengths(&self) -> Vec3 {
        self.semi_axes
    }

    fn contains(&self, point: &Vec3) -> bool {
        point.component_div(&self.semi_axes).norm() <= 1.0
    }
}
