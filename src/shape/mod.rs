//! What a grain is. A shape gives its support point; a smooth one also gives the matrix or
//! curvature from which the common-normal solver works. Contact resolution knows nothing else,
//! so a new convex shape is one file here and one arm in each `match` below.

pub mod ellipsoid;
pub mod half_space;
pub mod poly_superellipsoid;
mod power;
pub mod sphere;
pub mod superellipsoid;

use crate::math::{Mat3, Vec3};
pub use ellipsoid::Ellipsoid;
pub use half_space::HalfSpace;
pub use poly_superellipsoid::PolySuperellipsoid;
use serde::{Deserialize, Serialize};
pub use sphere::Sphere;
pub use superellipsoid::{CurvedSupport, Superellipsoid};

/// Which family of shape: pairs are resolved in batches of one pair of kinds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// A ball.
    Sphere,
    /// A tri-axial ellipsoid.
    Ellipsoid,
    /// A superellipsoid.
    Superellipsoid,
    /// Eight octants of superellipsoids.
    PolySuperellipsoid,
    /// The solid side of a plane: a wall.
    HalfSpace,
}

impl Kind {
    /// Every kind, in the order of batches.
    pub const ALL: [Self; 5] = [
        Self::Sphere,
        Self::Ellipsoid,
        Self::Superellipsoid,
        Self::PolySuperellipsoid,
        Self::HalfSpace,
    ];

    /// As the scene file and reports name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Ellipsoid => "ellipsoid",
            Self::Superellipsoid => "superellipsoid",
            Self::PolySuperellipsoid => "poly-superellipsoid",
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
    /// A superellipsoid.
    Superellipsoid(Superellipsoid),
    /// Eight octants of superellipsoids.
    PolySuperellipsoid(Box<PolySuperellipsoid>),
    /// The solid side of a plane: a wall.
    HalfSpace(HalfSpace),
}

impl Shape {
    /// The family it belongs to.
    pub const fn kind(&self) -> Kind {
        match self {
            Self::Sphere(_) => Kind::Sphere,
            Self::Ellipsoid(_) => Kind::Ellipsoid,
            Self::Superellipsoid(_) => Kind::Superellipsoid,
            Self::PolySuperellipsoid(_) => Kind::PolySuperellipsoid,
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
            Self::Superellipsoid(s) => s.support(direction),
            Self::PolySuperellipsoid(p) => p.support(direction),
            Self::HalfSpace(_) => Vec3::repeat(f64::NAN),
        }
    }

    /// Support point and curvature along a unit vector, both in the shape's own frame; `None` if the surface
    /// has edges.
    #[inline]
    pub fn curved_support(&self, direction: &Vec3) -> Option<CurvedSupport> {
        match self {
            Self::Sphere(s) => {
                Some(Ellipsoid { semi_axes: Vec3::repeat(s.radius) }.curved_support(direction))
            }
            Self::Ellipsoid(e) => Some(e.curved_support(direction)),
            Self::Superellipsoid(s) => s.curved_support(direction),
            Self::PolySuperellipsoid(p) => p.curved_support(direction),
            Self::HalfSpace(_) => None,
        }
    }

    /// A better way than a straight one to follow a `step` of `direction`, where the shape knows one: see
    /// [`Superellipsoid::follow`].
    #[inline]
    pub fn follow(&self, here: &CurvedSupport, direction: &Vec3, step: &Vec3) -> Option<Vec3> {
        match self {
            Self::Superellipsoid(s) => s.follow(here, direction, step),
            Self::PolySuperellipsoid(p) => p.follow(here, direction, step),
            _ => None,
        }
    }

    /// Smallest radius of curvature anywhere on the surface [m]; 0 where there are edges or crests.
    pub fn smallest_curvature_radius(&self) -> f64 {
        match self {
            Self::Sphere(s) => s.radius,
            Self::Ellipsoid(e) => e.smallest_curvature_radius(),
            Self::Superellipsoid(s) => s.smallest_curvature_radius(),
            Self::PolySuperellipsoid(p) => p.smallest_curvature_radius(),
            Self::HalfSpace(_) => 0.0,
        }
    }

    /// Radius of the smallest ball about the centre that holds the shape [m].
    pub fn bounding_radius(&self) -> f64 {
        match self {
            Self::Sphere(s) => s.radius,
            Self::Ellipsoid(e) => e.bounding_radius(),
            Self::Superellipsoid(s) => s.bounding_radius(),
            Self::PolySuperellipsoid(p) => p.bounding_radius(),
            Self::HalfSpace(_) => f64::INFINITY,
        }
    }

    /// Radius of the largest ball about the centre inside the shape [m].
    pub fn inscribed_radius(&self) -> f64 {
        match self {
            Self::Sphere(s) => s.radius,
            Self::Ellipsoid(e) => e.inscribed_radius(),
            Self::Superellipsoid(s) => s.inscribed_radius(),
            Self::PolySuperellipsoid(p) => p.inscribed_radius(),
            Self::HalfSpace(_) => f64::INFINITY,
        }
    }

    /// Volume [m³].
    pub fn volume(&self) -> f64 {
        match self {
            Self::Sphere(s) => s.volume(),
            Self::Ellipsoid(e) => e.volume(),
            Self::Superellipsoid(s) => s.volume(),
            Self::PolySuperellipsoid(p) => p.volume(),
            Self::HalfSpace(_) => f64::INFINITY,
        }
    }

    /// Principal moments of inertia over mass [m²].
    pub fn gyration(&self) -> Vec3 {
        match self {
            Self::Sphere(s) => s.gyration(),
            Self::Ellipsoid(e) => e.gyration(),
            Self::Superellipsoid(s) => s.gyration(),
            Self::PolySuperellipsoid(p) => p.gyration(),
            Self::HalfSpace(_) => Vec3::repeat(f64::INFINITY),
        }
    }

    /// Half lengths along the local axes of a box around the shape [m]: the semi-axes, for drawing.
    pub fn semi_axes(&self) -> Vec3 {
        match self {
            Self::Sphere(s) => Vec3::repeat(s.radius),
            Self::Ellipsoid(e) => e.semi_axes,
            Self::Superellipsoid(s) => s.semi_axes(),
            Self::PolySuperellipsoid(p) => p.half_lengths(),
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
