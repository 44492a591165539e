//! Particle shapes: convex bodies, given by their support point.
//!
//! # A new shape
//!
//! 1. A file here with a type that implements [`Convex`]: support point, radii, volume, inertia. Erosion, EPA and walls need nothing else.
//!    The rest of the trait makes contacts better or cheaper: curvature for the common-normal solver, a margin or flat faces for the
//!    resolvers that use them.
//! 2. A line in the list of shapes below, which generates [`Kind`], [`Shape`] and the names.
//! 3. Its keys, and the code that reads them, in `src/scene/geometry.rs`: the compiler asks for them.
//!
//! Only polyhedra and rounded polyhedra have flat faces, whose contacts have an area. Only spherocylinders have straight sides, whose
//! contacts have a length ([`crate::contact::Overlap`]). The sides of a superellipsoid are nearly flat for small exponents
//! ([`Superellipsoid::EXPONENTS`]).
//!
//! A program that uses this crate needs neither 2 nor 3: [`Shape::Other`] holds any convex body.

pub mod clip;
pub mod ellipsoid;
pub mod facets;
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
pub mod triangle_mesh;
pub mod union;

use crate::math::{Mat3, Vec3, directions};
pub use ellipsoid::{Ellipsoid, Form};
use facets::Facets;
pub use half_space::HalfSpace;
use hull::Hull;
use moments::Placement;
pub use poly_superellipsoid::PolySuperellipsoid;
pub use polyhedron::Polyhedron;
pub use rounded_polyhedron::RoundedPolyhedron;
use serde::{Deserialize, Serialize};
pub use sphere::Sphere;
pub use spherocylinder::Spherocylinder;
use std::borrow::Borrow;
use std::fmt::Debug;
use std::ops::RangeInclusive;
use std::sync::Arc;
pub use superellipsoid::{CurvedSupport, Superellipsoid};
pub use triangle_mesh::TriangleMesh;
pub use union::Union;

/// Lengths whose powers, as in moments and curvatures, do not overflow or underflow [m].
pub const LENGTHS: RangeInclusive<f64> = 1e-40..=1e30;

/// A convex body about its centre of mass, with axes along its principal axes of inertia.
pub trait Convex: Debug + Send + Sync {
    /// Farthest point along `direction` (any length but zero) [m].
    fn support(&self, direction: &Vec3) -> Vec3;

    /// Radius of the smallest sphere about the centre that contains the body, or a little more [m].
    fn bounding_radius(&self) -> f64;

    /// Radius of the largest sphere about the centre inside the body, or a little less [m].
    fn inscribed_radius(&self) -> f64;

    /// Volume [m³].
    fn volume(&self) -> f64;

    /// Principal moments of inertia over mass [m²].
    fn gyration(&self) -> Vec3;

    /// Whether a point is in the body.
    fn contains(&self, point: &Vec3) -> bool;

    /// Half lengths along the local axes of the smallest box about the centre that contains the body [m].
    fn half_lengths(&self) -> Vec3 {
        Vec3::from_fn(|i, _| {
            let axis = Vec3::ith(i, 1.0);
            self.support(&axis)[i].max(-self.support(&-axis)[i])
        })
    }

    /// Support point and curvature along a unit vector; `None` if the surface has edges.
    #[inline]
    fn curved_support(&self, _direction: &Vec3) -> Option<CurvedSupport> {
        None
    }

    /// Normal at `point + hessian · step`, of any length: the new direction if the support point moves in a straight line.
    ///
    /// `here` is the curved support along the unit vector `direction`, and `step` a small step of it. The result agrees with the moved direction
    /// to first order. It is far closer to a minimum near a flat face, where the support point moves with a small power of the direction.
    /// Returns `None` where this brings nothing.
    /// with a small power of the direction. `None` where there is no use in it.
    #[inline]
    fn follow(&self, _here: &CurvedSupport, _direction: &Vec3, _step: &Vec3) -> Option<Vec3> {
        None
    }

    /// Smallest radius of curvature anywhere on the surface [m]; 0 where there are edges or crests.
    fn smallest_curvature_radius(&self) -> f64 {
        0.0
    }

    /// Matrix of an ellipsoid or a sphere in place, see [`Form`] [m²]; NaN for other shapes.
    ///
    /// The columns of `frame` are the axes of the body in the world.
    #[inline]
    fn form(&self, _frame: &Mat3) -> Form {
        [f64::NAN; 6]
    }

    /// Radius of the sphere rolled around the shape's core [m]: that of a sphere, of a spherocylinder, of the edges of a rounded polyhedron.
    ///
    /// It is 0 for all other shapes.
    #[inline]
    fn margin(&self) -> f64 {
        0.0
    }

    /// Farthest point of the core, which is the body without its margin, along `direction` [m].
    #[inline]
    fn core_support(&self, direction: &Vec3) -> Vec3 {
        self.support(direction)
    }

    /// Flat part of the shape. A contact point is in the middle of a face only if the face is known.
    #[inline]
    fn core(&self) -> Core<'_> {
        Core::Curved
    }

    /// Faces of a polyhedron, or of the polyhedron that represents the body in contacts with other such bodies and with planes.
    #[inline]
    fn facets(&self) -> Option<&Facets> {
        None
    }

    /// Extent of that polyhedron beyond the body that it represents [m].
    fn excess(&self) -> f64 {
        0.0
    }

    /// Axes of the body in those of the user's file, if they were computed.
    fn placement(&self) -> Option<&Placement> {
        None
    }
}

/// Flat part of a shape, where a whole edge or face can touch another body.
#[derive(Clone, Copy, Debug)]
pub enum Core<'a> {
    /// No flat part: the shape is curved everywhere.
    Curved,
    /// A segment of this half length along the local x [m].
    Segment(f64),
    /// The faces and edges of a polyhedron.
    Hull(&'a Hull),
}

/// Generates [`Kind`] and [`Shape`] from a list of types, each with the type that [`Shape`] holds, its name and its [`Property`]s.
macro_rules! shapes {
    ($(
        $(#[$doc:meta])*
        $kind:ident ($(#[$held_as:meta])* $held:ty), $name:literal, $facts:expr;
    )*) => {
        /// Family of a shape: pairs are resolved in batches of one pair of kinds.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Kind {
            $($(#[$doc])* $kind,)*
        }

        impl Kind {
            /// All kinds, in the order of batches.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$kind),*];

            /// Name in the scene file and in reports.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$kind => $name,)*
                }
            }

            const fn facts(self) -> &'static [Property] {
                match self {
                    $(Self::$kind => $facts,)*
                }
            }
        }

        /// Geometry of a body, centred on its centre of mass, with axes along its principal axes of inertia.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub enum Shape {
            $($(#[$doc])* $(#[$held_as])* $kind($held),)*
        }

        impl Shape {
            /// Kind of the shape.
            pub const fn kind(&self) -> Kind {
                match self {
                    $(Self::$kind(_) => Kind::$kind,)*
                }
            }
        }

        dispatched! { ($($kind)*) }
    };
}

/// Gives [`Shape`] the methods of [`Convex`] as its own.
///
/// Each is a `match` instead of a virtual call, because resolvers spend their time in support points.
macro_rules! dispatched {
    ($kinds:tt) => {
        dispatched! { $kinds
            support(direction: &Vec3) -> Vec3;
            bounding_radius() -> f64;
            inscribed_radius() -> f64;
            volume() -> f64;
            gyration() -> Vec3;
            half_lengths() -> Vec3;
            contains(point: &Vec3) -> bool;
            curved_support(direction: &Vec3) -> Option<CurvedSupport>;
            follow(here: &CurvedSupport, direction: &Vec3, step: &Vec3) -> Option<Vec3>;
            smallest_curvature_radius() -> f64;
            form(frame: &Mat3) -> Form;
            margin() -> f64;
            core_support(direction: &Vec3) -> Vec3;
            core() -> Core<'_>;
            facets() -> Option<&Facets>;
            excess() -> f64;
            placement() -> Option<&Placement>;
        }
    };
    ($kinds:tt $($method:ident($($argument:ident: $of:ty),*) -> $result:ty;)*) => {
        impl Shape {
            $(
                #[doc = concat!("See [`Convex::", stringify!($method), "`].")]
                #[inline]
                pub fn $method(&self, $($argument: $of),*) -> $result {
                    dispatched!(match self $kinds $method ($($argument),*))
                }
            )*
        }
    };
    (match $shape:ident ($($kind:ident)*) $method:ident $arguments:tt) => {
        match $shape {
            $(Self::$kind(body) => dispatched!(call $kind $method body $arguments),)*
        }
    };
    (call $kind:ident $method:ident $body:ident ($($argument:ident),*)) => {
        <$kind as Convex>::$method(Borrow::<$kind>::borrow($body), $($argument),*)
    };
}

/// Properties on which resolvers may rely.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Property {
    /// It has a common normal, because it has curvature everywhere.
    Smooth,
    /// It is a point, a segment or a polyhedron with a sphere rolled around it.
    Margin,
    /// It has [`Convex::facets`].
    Faces,
}

/// Type behind [`Shape::Other`].
type Other = dyn Convex;

shapes! {
    /// A sphere.
    Sphere(Sphere), "sphere", &[Property::Smooth, Property::Margin];
    /// A tri-axial ellipsoid.
    Ellipsoid(Ellipsoid), "ellipsoid", &[Property::Smooth];
    /// A superellipsoid.
    Superellipsoid(Superellipsoid), "superellipsoid", &[Property::Smooth];
    /// Eight octants of superellipsoids.
    PolySuperellipsoid(Box<PolySuperellipsoid>), "poly-superellipsoid", &[Property::Smooth];
    /// A cylinder with a hemisphere on each end.
    Spherocylinder(Spherocylinder), "spherocylinder", &[Property::Margin];
    /// A convex polyhedron.
    Polyhedron(Box<Polyhedron>), "polyhedron", &[Property::Faces];
    /// A convex polyhedron with a sphere rolled around it.
    RoundedPolyhedron(Box<RoundedPolyhedron>), "rounded-polyhedron", &[Property::Margin, Property::Faces];
    /// Any body of convex pieces, which represent it in contacts.
    Union(Box<Union>), "union", &[];
    /// Any convex body of a program that uses this crate. It cannot occur in scene files and messages between ranks.
    Other(#[serde(with = "not_sent")] Arc<dyn Convex>), "other", &[];
    /// The solid side of a plane: a wall.
    HalfSpace(HalfSpace), "plane", &[];
    /// The surface of a wall of triangles.
    TriangleMesh(#[serde(with = "triangle_mesh::shared")] Arc<TriangleMesh>), "triangle-mesh", &[];
}

/// A shape of a program that uses this crate stays in its process.
mod not_sent {
    use super::Convex;
    use serde::{Deserializer, Serializer, de, ser};
    use std::sync::Arc;

    const WHY: &str =
        "a shape of kind \"other\" cannot be written or sent: create it on every rank";

    pub(super) fn serialize<S: Serializer>(_: &Arc<dyn Convex>, _: S) -> Result<S::Ok, S::Error> {
        Err(ser::Error::custom(WHY))
    }

    pub(super) fn deserialize<'a, D: Deserializer<'a>>(_: D) -> Result<Arc<dyn Convex>, D::Error> {
        Err(de::Error::custom(WHY))
    }
}

impl Kind {
    /// Whether it is a surface of a wall and not of particles.
    pub const fn is_of_walls(self) -> bool {
        matches!(self, Self::HalfSpace | Self::TriangleMesh)
    }

    /// Whether it has a common normal, which needs curvature everywhere.
    pub fn is_smooth(self) -> bool {
        self.facts().contains(&Property::Smooth)
    }

    /// Whether it is an ellipsoid or a sphere.
    pub const fn is_ellipsoidal(self) -> bool {
        matches!(self, Self::Sphere | Self::Ellipsoid)
    }

    /// Whether it is a point, a segment or a polyhedron with a sphere rolled around it.
    pub fn has_margin(self) -> bool {
        self.facts().contains(&Property::Margin)
    }

    /// Whether it is a polyhedron, rounded or not.
    pub fn has_faces(self) -> bool {
        self.facts().contains(&Property::Faces)
    }

    /// Whether it has a straight side.
    pub fn has_side(self) -> bool {
        self == Self::Spherocylinder
    }

    /// Kinds of extended contacts that it can have as the first and as the second body, as bits.
    ///
    /// A pair with a common bit has such a contact. Contacts of faces, between two polyhedra, and of straight sides, between two spherocylinders,
    /// have an extent. So do their contacts with planes and with triangles.
    pub fn extended(self) -> [u8; 2] {
        let own = u8::from(self.has_faces()) | u8::from(self.has_side()) << 1;
        let with_walls = match self {
            Self::HalfSpace | Self::TriangleMesh => 3,
            _ => own,
        };
        [own, with_walls]
    }
}

/// Identity of the object, not equality of the bodies.
impl PartialEq for dyn Convex {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::addr_eq(self, other)
    }
}

impl Shape {
    /// Copy of a superellipsoid, or of its octants, with exponents of at least `least`, below 1; `None` for other shapes.
    #[must_use]
    pub fn with_exponents_from(&self, least: f64) -> Option<Self> {
        match self {
            Self::Superellipsoid(body) => {
                let exponents = body.exponents().map(|e| e.max(least));
                Some(Self::Superellipsoid(Superellipsoid::new(body.semi_axes(), exponents)))
            }
            Self::PolySuperellipsoid(body) => {
                let exponents = body.exponents().map(|e| e.max(least));
                let [positive, negative] = body.semi_axes();
                let body = PolySuperellipsoid::new(positive, negative, exponents);
                Some(Self::PolySuperellipsoid(Box::new(body)))
            }
            _ => None,
        }
    }

    /// Radius of the sphere of equal volume [m].
    pub fn equal_radius(&self) -> f64 {
        match self {
            Self::Sphere(ball) => ball.radius,
            _ => libm::cbrt(0.75 / std::f64::consts::PI * self.volume()),
        }
    }

    /// [`Convex::half_lengths`], which are the semi-axes of an ellipsoid [m].
    pub fn semi_axes(&self) -> Vec3 {
        self.half_lengths()
    }

    /// [`Convex::curved_support`] of two shapes, with the same bits; faster where both are superellipsoids.
    #[inline]
    pub fn curved_supports(
        shapes: [&Self; 2],
        directions: [&Vec3; 2],
    ) -> [Option<CurvedSupport>; 2] {
        match shapes {
            [Self::Superellipsoid(a), Self::Superellipsoid(b)]
                if a.as_ellipsoid().is_none() && b.as_ellipsoid().is_none() =>
            {
                Superellipsoid::curved_supports([a, b], directions)
            }
            [Self::PolySuperellipsoid(a), Self::PolySuperellipsoid(b)] => {
                PolySuperellipsoid::curved_supports([a, b], directions)
            }
            _ => [0, 1].map(|k| shapes[k].curved_support(directions[k])),
        }
    }

    /// Largest compliance of a surface point over that of the centre of mass [-], for the stable time step.
    ///
    /// It is the largest `dᵀ (1 + m [r]ᵀ I⁻¹ [r]) d` over surface points `r` and unit directions `d`: 3.5 for a sphere. It is sampled over
    /// [`directions`] in the shape's own frame.
    pub fn surface_compliance(&self) -> f64 {
        let gyration = self.gyration();
        let inverse = Mat3::from_diagonal(&gyration.map(|g| 1.0 / g));
        let mut largest: f64 = 1.0;
        for normal in directions() {
            let cross = self.support(&normal).cross_matrix();
            let compliance = Mat3::identity() + cross.transpose() * inverse * cross;
            largest = largest.max(compliance.symmetric_eigenvalues().max());
        }
        largest
    }
}
