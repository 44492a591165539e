//! The rounded polyhedron: all points within a radius of a convex polyhedron, its core.
//!
//! Between the cores of two of them lies a gap as wide as both radii less the overlap, so that a contact is
//! exact for the price of a distance. Choose it for grains with worn edges; sharp ones need dearer methods,
//! and a small radius spares them.

use super::hull::{Hull, HullError};
use super::moments::{Moments, Placement, Principal};
use super::polyhedron::convex;
use super::{Convex, Core};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// A rounded polyhedron about its centre of mass, in its principal axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoundedPolyhedron {
    core: Hull,
    radius: f64,
    volume: f64,
    gyration: Vec3,
    placement: Placement,
}

impl RoundedPolyhedron {
    /// All points within `radius` [m] of the polyhedron with corners at `points` [m], in any axes and order.
    ///
    /// # Errors
    /// As [`super::Polyhedron::new`].
    pub fn new(points: &[Vec3], radius: f64) -> Result<Self, HullError> {
        let core = convex(points)?;
        let Principal { volume, gyration, placement } =
            Moments::of_rounded(&core, radius).principal();
        let core = core.seen_from(&placement.centre, placement.axes.to_rotation_matrix().matrix());
        Ok(Self { core, radius, volume, gyration, placement })
    }

    /// The polyhedron inside, about the centre of mass of the whole.
    pub const fn core(&self) -> &Hull {
        &self.core
    }

    /// Radius of the edges [m].
    pub const fn radius(&self) -> f64 {
        self.radius
    }

    /// Where the centre of mass and the principal axes lie in the axes in which the corners were given.
    pub const fn placement(&self) -> &Placement {
        &self.placement
    }
}

impl Convex for RoundedPolyhedron {
    #[inline]
    fn support(&self, direction: &Vec3) -> Vec3 {
        self.core.support(direction) + direction * (self.radius / direction.norm())
    }

    fn bounding_radius(&self) -> f64 {
        self.core.bounding_radius() + self.radius
    }

    fn inscribed_radius(&self) -> f64 {
        self.core.inscribed_radius() + self.radius
    }

    fn volume(&self) -> f64 {
        self.volume
    }

    fn gyration(&self) -> Vec3 {
        self.gyration
    }

    fn half_lengths(&self) -> Vec3 {
        self.core.half_extents().add_scalar(self.radius)
    }

    fn contains(&self, point: &Vec3) -> bool {
        self.core.is_near(point, self.radius)
    }

    fn smallest_curvature_radius(&self) -> f64 {
        self.radius
    }

    #[inline]
    fn margin(&self) -> f64 {
        self.radius
    }

    #[inline]
    fn core_support(&self, direction: &Vec3) -> Vec3 {
        self.core.support(direction)
    }

    #[inline]
    fn core(&self) -> Core<'_> {
        Core::Hull(&self.core)
    }

    fn placement(&self) -> Option<&Placement> {
        Some(&self.placement)
    }
}
