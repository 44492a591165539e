//! What a grain is. A shape gives its support point; a smooth one also gives the matrix or
//! curvature from which the common-normal solver works. Contact resolution knows nothing else,
//! so a new convex shape is one file here and one arm in each `match` below.

pub mod ellipsoid;
pub mod half_space;
pub mod hull;
pub mod mesh;
pub mod moments;
pub mod poly_superellipsoid;
pub mod polyhedron;
mod power;
pub mod rounded_polyhedron;
pub mod sphere;
pub mod spherocylinder;
pub mod superellipsoid;

use crate::math::{Mat3, Vec3};
pub use ellipsoid::{Ellipsoid, Form};
pub use half_space::HalfSpace;
use hull::Hull;
use moments::Placement;
pub use poly_superellipsoid::PolySuperellipsoid;
pub use polyhedron::Polyhedron;
pub use rounded_polyhedron::RoundedPolyhedron;
use serde::{Deserialize, Serialize};
pub use sphere::Sphere;
pub use spherocylinder::Spherocylinder;
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
    /// A cylinder with a half ball on each end.
    Spherocylinder,
    /// A convex polyhedron.
    Polyhedron,
    /// A convex polyhedron with a ball rolled around it.
    RoundedPolyhedron,
    /// The solid side of a plane: a wall.
    HalfSpace,
}

impl Kind {
    /// Every kind, in the order of batches.
    pub const ALL: [Self; 8] = [
        Self::Sphere,
        Self::Ellipsoid,
        Self::Superellipsoid,
        Self::PolySuperellipsoid,
        Self::Spherocylinder,
        Self::Polyhedron,
        Self::RoundedPolyhedron,
        Self::HalfSpace,
    ];

    /// As the scene file and reports name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Ellipsoid => "ellipsoid",
            Self::Superellipsoid => "superellipsoid",
            Self::PolySuperellipsoid => "poly-superellipsoid",
            Self::Spherocylinder => "spherocylinder",
            Self::Polyhedron => "polyhedron",
            Self::RoundedPolyhedron => "rounded-polyhedron",
            Self::HalfSpace => "plane",
        }
    }

    /// Has it a common normal, which needs curvature everywhere?
    pub const fn is_smooth(self) -> bool {
        self.is_ellipsoidal() || matches!(self, Self::Superellipsoid | Self::PolySuperellipsoid)
    }

    /// Is it an ellipsoid, if only a round one?
    pub const fn is_ellipsoidal(self) -> bool {
        matches!(self, Self::Sphere | Self::Ellipsoid)
    }

    /// Is it a point, a segment or a polyhedron with a ball rolled around it?
    pub const fn has_margin(self) -> bool {
        matches!(self, Self::Sphere | Self::Spherocylinder | Self::RoundedPolyhedron)
    }
}

/// What is flat of a shape: where a whole edge or face of it can touch another body.
#[derive(Clone, Copy, Debug)]
pub enum Core<'a> {
    /// Nothing: it is curved everywhere.
    Curved,
    /// A segment of this half length along the local x [m].
    Segment(f64),
    /// The faces and edges of a polyhedron.
    Hull(&'a Hull),
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
    /// A cylinder with a half ball on each end.
    Spherocylinder(Spherocylinder),
    /// A convex polyhedron.
    Polyhedron(Box<Polyhedron>),
    /// A convex polyhedron with a ball rolled around it.
    RoundedPolyhedron(Box<RoundedPolyhedron>),
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
            Self::Spherocylinder(_) => Kind::Spherocylinder,
            Self::Polyhedron(_) => Kind::Polyhedron,
            Self::RoundedPolyhedron(_) => Kind::RoundedPolyhedron,
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
            Self::Spherocylinder(s) => s.support(direction),
            Self::Polyhedron(p) => p.hull().support(direction),
            Self::RoundedPolyhedron(p) => p.support(direction),
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
            Self::Spherocylinder(_)
            | Self::Polyhedron(_)
            | Self::RoundedPolyhedron(_)
            | Self::HalfSpace(_) => None,
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
            Self::Spherocylinder(s) => s.radius,
            Self::RoundedPolyhedron(p) => p.radius(),
            Self::Polyhedron(_) | Self::HalfSpace(_) => 0.0,
        }
    }

    /// Radius of the smallest ball about the centre that holds the shape [m].
    pub fn bounding_radius(&self) -> f64 {
        match self {
            Self::Sphere(s) => s.radius,
            Self::Ellipsoid(e) => e.bounding_radius(),
            Self::Superellipsoid(s) => s.bounding_radius(),
            Self::PolySuperellipsoid(p) => p.bounding_radius(),
            Self::Spherocylinder(s) => s.bounding_radius(),
            Self::Polyhedron(p) => p.hull().bounding_radius(),
            Self::RoundedPolyhedron(p) => p.bounding_radius(),
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
            Self::Spherocylinder(s) => s.radius,
            Self::Polyhedron(p) => p.hull().inscribed_radius(),
            Self::RoundedPolyhedron(p) => p.inscribed_radius(),
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
            Self::Spherocylinder(s) => s.volume(),
            Self::Polyhedron(p) => p.volume(),
            Self::RoundedPolyhedron(p) => p.volume(),
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
            _ => [f64::NAN; 6],
        }
    }

    /// Principal moments of inertia over mass [m²].
    pub fn gyration(&self) -> Vec3 {
        match self {
            Self::Sphere(s) => s.gyration(),
            Self::Ellipsoid(e) => e.gyration(),
            Self::Superellipsoid(s) => s.gyration(),
            Self::PolySuperellipsoid(p) => p.gyration(),
            Self::Spherocylinder(s) => s.gyration(),
            Self::Polyhedron(p) => p.gyration(),
            Self::RoundedPolyhedron(p) => p.gyration(),
            Self::HalfSpace(_) => Vec3::repeat(f64::INFINITY),
        }
    }

    /// Radius of the ball that rolls around the shape's core: that of a sphere, of a spherocylinder, of the
    /// edges of a rounded polyhedron; 0 for all others [m].
    #[inline]
    pub fn margin(&self) -> f64 {
        match self {
            Self::Sphere(s) => s.radius,
            Self::Spherocylinder(s) => s.radius,
            Self::RoundedPolyhedron(p) => p.radius(),
            Self::Ellipsoid(_)
            | Self::Superellipsoid(_)
            | Self::PolySuperellipsoid(_)
            | Self::Polyhedron(_)
            | Self::HalfSpace(_) => 0.0,
        }
    }

    /// The farthest point along `direction` of what is left without the margin [m].
    #[inline]
    pub fn core_support(&self, direction: &Vec3) -> Vec3 {
        match self {
            Self::Sphere(_) => Vec3::zeros(),
            Self::Spherocylinder(s) => s.core_support(direction),
            Self::RoundedPolyhedron(p) => p.core().support(direction),
            other => other.support(direction),
        }
    }

    /// What is flat of it.
    #[inline]
    pub fn core(&self) -> Core<'_> {
        match self {
            Self::Spherocylinder(s) => Core::Segment(0.5 * s.length),
            Self::Polyhedron(p) => Core::Hull(p.hull()),
            Self::RoundedPolyhedron(p) => Core::Hull(p.core()),
            Self::Sphere(_)
            | Self::Ellipsoid(_)
            | Self::Superellipsoid(_)
            | Self::PolySuperellipsoid(_)
            | Self::HalfSpace(_) => Core::Curved,
        }
    }

    /// Where its axes lie in those of the user's file, if they had to be found.
    pub fn placement(&self) -> Option<&Placement> {
        match self {
            Self::Polyhedron(p) => Some(p.placement()),
            Self::RoundedPolyhedron(p) => Some(p.placement()),
            _ => None,
        }
    }

    /// Half lengths along the local axes of the smallest box about the centre that holds the shape [m]: the
    /// semi-axes of an ellipsoid. For drawing.
    pub fn semi_axes(&self) -> Vec3 {
        match self {
            Self::Sphere(s) => Vec3::repeat(s.radius),
            Self::Ellipsoid(e) => e.semi_axes,
            Self::Superellipsoid(s) => s.semi_axes(),
            Self::PolySuperellipsoid(p) => p.half_lengths(),
            Self::Spherocylinder(s) => s.half_extents(),
            Self::Polyhedron(p) => p.hull().half_extents(),
            Self::RoundedPolyhedron(p) => p.half_extents(),
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
