//! What a grain is. A shape gives its support point; a smooth one also gives the matrix or
//! curvature from which the common-normal solver works. Contact resolution knows nothing else,
//! so a new convex shape is one file here and one arm in each `match` below.

pub mod ellipsoid;
pub mod half_space;
pub mod sphere;

use crate::math::{Mat3, Vec3};
pub use ellipsoid::{Ellipsoid, Form};
pub use half_space::HalfSpace;
use serde::{Deserialize, Serialize};
pub use sphere::Sphere;

/// Which family of shape: pairs are resolved in batches of one pair of kinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A ball.
    Sphere,
    /// A tri-axial ellipsoid.
    Ellipsoid,
    /// The solid side of a plane: a wall.
    HalfSpace,
}

impl Kind {
    /// Every kind, in the order of batches.
    pub const ALL: [Self; 3] = [Self::Sphere, Self::Ellipsoid, Self::HalfSpace];

    /// As the scene file and reports name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Ellipsoid => "ellipsoid",
            Self::HalfSpace => "plane",
        }
    }
}

/// A body's geometry, centred on its centre of mass, axes along its principal axes of inertia.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Shape {
    /// A ball.
    Sphere(Sphere),
    /// A tri-axial ellipsoid.
    Ellipsoid(Ellipsoid),
    /// The solid side of a plane: a wall.
    HalfSpace(HalfSpace),
}

impl Shape {
    /// The family it belongs to.
    pub const fn kind(&self) -> Kind {
        match self {
            Self::Sphere(_) => Kind::Sphere,
            Self::Ellipsoid(_) => Kind::Ellipsoid,
            Self::HalfSpace(_) => Kind::HalfSpace,
        }
    }

    /// The farthest point along `direction` (any length but zero), both in the shape's own frame [m].
    ///
    /// A half-space has none; it is never asked (walls have closed forms).
    #[inline]
    pub fn support(&self, direction: &Vec3) -> Vec3 {
        match self {
            Self::Sphere(s) => s.support(direction),
            Self::Ellipsoid(e) => e.support(direction),
            Self::HalfSpace(_) => Vec3::repeat(f64::NAN),
        }
    }

    /// Radius of the smallest ball about the centre that holds the shape [m].
    pub fn bounding_radius(&self) -> f64 {
        match self {
            Self::Sphere(s) => s.radius,
            Self::Ellipsoid(e) => e.bounding_radius(),
            Self::HalfSpace(_) => f64::INFINITY,
        }
    }

    /// Radius of the largest ball about the centre inside the shape [m].
    pub fn inscribed_radius(&self) -> f64 {
        match self {
            Self::Sphere(s) => s.radius,
            Self::Ellipsoid(e) => e.inscribed_radius(),
            Self::HalfSpace(_) => f64::INFINITY,
        }
    }

    /// Volume [m³].
    pub fn volume(&self) -> f64 {
        match self {
            Self::Sphere(s) => s.volume(),
            Self::Ellipsoid(e) => e.volume(),
            Self::HalfSpace(_) => f64::INFINITY,
        }
    }

    /// The matrix of an ellipsoid or a sphere in place, see [`Form`] [m²]; not a number for other shapes.
    #[inline]
    pub fn form(&self, frame: &Mat3) -> Form {
        match self {
            Self::Sphere(s) => {
                let square = s.radius * s.radius;
                [square, square, square, 0.0, 0.0, 0.0]
            }
            Self::Ellipsoid(e) => e.form(frame),
            Self::HalfSpace(_) => [f64::NAN; 6],
        }
    }

    /// Principal moments of inertia over mass [m²].
    pub fn gyration(&self) -> Vec3 {
        match self {
            Self::Sphere(s) => s.gyration(),
            Self::Ellipsoid(e) => e.gyration(),
            Self::HalfSpace(_) => Vec3::repeat(f64::INFINITY),
        }
    }

    /// Half lengths along the local axes of a box around the shape [m]: the semi-axes, for drawing.
    pub fn semi_axes(&self) -> Vec3 {
        match self {
            Self::Sphere(s) => Vec3::repeat(s.radius),
            Self::Ellipsoid(e) => e.semi_axes,
            Self::HalfSpace(_) => Vec3::repeat(f64::INFINITY),
        }
    }

    /// Largest `dᵀ (1 + m [r]ᵀ I⁻¹ [r]) d` over surface points `r` and unit directions `d`: how many
    /// times more compliant a surface point is than the centre of mass. 3.5 for a sphere. Enters the
    /// stable time step. Sampled over 1,026 normals of the shape's own frame.
    pub fn surface_compliance(&self) -> f64 {
        let gyration = self.gyration();
        let inverse = Mat3::from_diagonal(&gyration.map(|g| 1.0 / g));
        let mut largest: f64 = 1.0;
        let count = 1026;
        for i in 0..count {
            // Spherical Fibonacci points; only a bound is wanted, so the platform's sine will do.
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
            let angle = 2.399_963_229_728_653 * f64::from(i);
            let ring = (1.0 - z * z).sqrt();
            let normal = Vec3::new(ring * angle.cos(), ring * angle.sin(), z);
            let cross = self.support(&normal).cross_matrix();
            let compliance = Mat3::identity() + cross.transpose() * inverse * cross;
            largest = largest.max(compliance.symmetric_eigenvalues().max());
        }
        largest
    }
}
