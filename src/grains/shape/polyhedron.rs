//! Convex polyhedron, from its corners.
//!
//! The corners may be given in any axes. The body is moved to its centre of mass and rotated into its principal axes, in which a particle
//! moves. [`Polyhedron::placement`] gives these in the axes of the file.

use super::facets::{Facets, Plane};
use super::hull::{Hull, HullError, size};
use super::moments::{Moments, Placement, Principal};
use super::{Convex, Core};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// Depth inside the hull of the others, over the size, beyond which a point is an error. A shallower one is on a face, and left out.
const INSIDE: f64 = 1e-6;

/// A convex polyhedron about its centre of mass, in its principal axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Polyhedron {
    hull: Hull,
    volume: f64,
    gyration: Vec3,
    placement: Placement,
}

impl Polyhedron {
    /// A polyhedron with corners at `points` [m], in any axes and order.
    ///
    /// # Errors
    /// If the points are too few, the same, in one plane, not finite, or if one of them is inside.
    pub fn new(points: &[Vec3]) -> Result<Self, HullError> {
        Ok(Self::of(&convex(points)?))
    }

    /// The hull of points [m], in any axes and order.
    ///
    /// # Errors
    /// If the points are too few, the same, in one plane, or not finite.
    pub fn around(points: &[Vec3]) -> Result<Self, HullError> {
        Ok(Self::of(&Hull::of(points)?))
    }

    fn of(hull: &Hull) -> Self {
        let Principal { volume, gyration, placement } = Moments::of(hull).principal();
        let hull = hull.seen_from(&placement.centre, placement.axes.to_rotation_matrix().matrix());
        Self { hull, volume, gyration, placement }
    }

    /// Surface.
    pub const fn hull(&self) -> &Hull {
        &self.hull
    }

    /// Centre of mass and principal axes in the axes in which the corners were given.
    pub const fn placement(&self) -> &Placement {
        &self.placement
    }
}

impl Convex for Polyhedron {
    #[inline]
    fn support(&self, direction: &Vec3) -> Vec3 {
        self.hull.support(direction)
    }

    fn bounding_radius(&self) -> f64 {
        self.hull.bounding_radius()
    }

    fn inscribed_radius(&self) -> f64 {
        self.hull.inscribed_radius()
    }

    fn volume(&self) -> f64 {
        self.volume
    }

    fn gyration(&self) -> Vec3 {
        self.gyration
    }

    fn half_lengths(&self) -> Vec3 {
        self.hull.half_extents()
    }

    fn contains(&self, point: &Vec3) -> bool {
        self.hull.is_near(point, 0.0)
    }

    #[inline]
    fn core(&self) -> Core<'_> {
        Core::Hull(&self.hull)
    }

    #[inline]
    fn facets(&self) -> Option<&Facets> {
        Some(self.hull.facets())
    }

    fn placement(&self) -> Option<&Placement> {
        Some(&self.placement)
    }
}

/// Hull of points that are all its corners, or at least on its surface.
pub(super) fn convex(points: &[Vec3]) -> Result<Hull, HullError> {
    let hull = Hull::of(points)?;
    match deepest(&hull, points) {
        (index, depth) if depth > INSIDE * size(points) => Err(HullError::Inside { index, depth }),
        _ => Ok(hull),
    }
}

/// Difference of unit normals below which two faces are one.
const ONE_FACE: f64 = 1e-5;

/// Checks that no point is within a face of the hull, as for a body with a dent or a hole. A point may be on an edge.
///
/// # Errors
/// For the first such point, or if there is no hull.
pub fn corners_only(points: &[Vec3]) -> Result<(), HullError> {
    let hull = Hull::of(points)?;
    let rounding = INSIDE * size(points);
    let is_within = |point: &Vec3| {
        let holds = |plane: &&Plane| (plane.normal.dot(point) - plane.offset).abs() <= rounding;
        let mut holding = hull.planes().iter().filter(holds);
        holding.next().is_some_and(|first| {
            holding.all(|plane| (plane.normal - first.normal).norm() < ONE_FACE)
        })
    };
    points.iter().position(is_within).map_or(Ok(()), |index| Err(HullError::WithinFace { index }))
}

/// The point farthest below the surface, and its depth [m].
pub(super) fn deepest(hull: &Hull, points: &[Vec3]) -> (usize, f64) {
    let depths = points.iter().map(|point| hull.depth(point)).enumerate();
    depths.fold((0, f64::NEG_INFINITY), |best, item| if item.1 > best.1 { item } else { best })
}
