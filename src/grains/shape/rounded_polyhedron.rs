//! Rounded polyhedron: all points within a radius of a convex polyhedron, its core.
//!
//! The gap between the cores of two of them is the sum of both radii less the overlap. An exact contact thus costs no more than a distance. It
//! suits particles with worn edges; sharp ones need more expensive methods, which a small radius avoids.
//!
//! In contacts of faces it is represented by a polyhedron ([`RoundedPolyhedron::chamfered`]): its faces, and one chamfer for each edge and
//! corner, all tangent to the rounded surface.

use super::clip::inside;
use super::facets::{Facets, Plane};
use super::hull::{Hull, HullError};
use super::moments::{Moments, Placement, Principal};
use super::polyhedron::convex;
use super::{Convex, Core};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// Sine of the angle below which two normals belong to one face within rounding.
const SAME_FACE: f64 = 1e-12;
/// Half edge of a cube that contains the chamfered body, over the bounding radius of the rounded one.
const ROOM: f64 = 16.0;

/// Serialised data of a rounded polyhedron, from which all other data follow.
#[derive(Serialize, Deserialize)]
struct Written {
    core: Hull,
    radius: f64,
    volume: f64,
    gyration: Vec3,
    placement: Placement,
}

impl From<Written> for RoundedPolyhedron {
    fn from(Written { core, radius, volume, gyration, placement }: Written) -> Self {
        // Facets of the core, for values that `RoundedPolyhedron::new` rejects.
        let chamfered = chamfered(&core, radius).unwrap_or_else(|| core.facets().clone());
        let distance = |vertex: &Vec3| core.distance(vertex);
        let farthest = chamfered.vertices().iter().map(distance).fold(radius, f64::max);
        let excess = farthest - radius;
        Self { core, radius, volume, gyration, placement, chamfered, excess }
    }
}

impl From<RoundedPolyhedron> for Written {
    fn from(body: RoundedPolyhedron) -> Self {
        let RoundedPolyhedron { core, radius, volume, gyration, placement, .. } = body;
        Self { core, radius, volume, gyration, placement }
    }
}

/// A rounded polyhedron about its centre of mass, in its principal axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Written", into = "Written")]
pub struct RoundedPolyhedron {
    core: Hull,
    radius: f64,
    volume: f64,
    gyration: Vec3,
    placement: Placement,
    chamfered: Facets,
    excess: f64,
}

impl RoundedPolyhedron {
    /// All points within `radius` [m] of the polyhedron with corners at `points` [m], in any axes and order.
    ///
    /// # Errors
    /// See [`super::Polyhedron::new`]; also if the radius is outside the range of computations.
    pub fn new(points: &[Vec3], radius: f64) -> Result<Self, HullError> {
        let core = convex(points)?;
        if chamfered(&core, radius).is_none() {
            return Err(HullError::Size { size: core.bounding_radius() + radius });
        }
        let Principal { volume, gyration, placement } =
            Moments::of_rounded(&core, radius).principal();
        let core = core.seen_from(&placement.centre, placement.axes.to_rotation_matrix().matrix());
        Ok(Written { core, radius, volume, gyration, placement }.into())
    }

    /// Polyhedron that represents the body in contacts of faces.
    ///
    /// It contains the rounded body. At a chamfered edge whose faces meet at right angles it extends 8 % of the radius beyond it.
    pub const fn chamfered(&self) -> &Facets {
        &self.chamfered
    }

    /// Polyhedron inside, about the centre of mass of the whole.
    pub const fn core(&self) -> &Hull {
        &self.core
    }

    /// Radius of the edges [m].
    pub const fn radius(&self) -> f64 {
        self.radius
    }

    /// Centre of mass and principal axes in the axes in which the corners were given.
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
        (self.core.bounding_radius() + self.radius).max(self.chamfered.bounding_radius())
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

    #[inline]
    fn facets(&self) -> Option<&Facets> {
        Some(&self.chamfered)
    }

    fn excess(&self) -> f64 {
        self.excess
    }

    fn placement(&self) -> Option<&Placement> {
        Some(&self.placement)
    }
}

/// Faces moved outwards by a radius, and a chamfer across each edge and corner; `None` if the values leave the range of computations.
fn chamfered(core: &Hull, radius: f64) -> Option<Facets> {
    let vertex = |k: u32| core.vertices()[k as usize];
    let normal = |plane: u32| core.planes()[plane as usize].normal;
    let mut planes: Vec<Plane> = core.planes().to_vec();
    for plane in &mut planes {
        plane.offset += radius;
    }
    let tangent = |across: Vec3, at: Vec3| {
        let normal = across.normalize();
        Plane { normal, offset: normal.dot(&at) + radius }
    };

    let triangles = core.triangles();
    let mut sides: Vec<((u32, u32), u32)> = triangles
        .iter()
        .flat_map(|t| [0, 1, 2].map(|k| ((t.corners[k], t.corners[(k + 1) % 3]), t.plane)))
        .collect();
    sides.sort_unstable();
    for &((from, to), plane) in sides.iter().filter(|((from, to), _)| from < to) {
        let Ok(back) = sides.binary_search_by_key(&(to, from), |&(side, _)| side) else { continue };
        let (left, right) = (normal(plane), normal(sides[back].1));
        if left.cross(&right).norm() > SAME_FACE {
            planes.push(tangent(left + right, vertex(from)));
        }
    }

    for k in 0..core.vertices().len() as u32 {
        let mut around: Vec<u32> =
            triangles.iter().filter(|t| t.corners.contains(&k)).map(|t| t.plane).collect();
        around.sort_unstable();
        around.dedup();
        planes.push(tangent(around.iter().map(|&plane| normal(plane)).sum(), vertex(k)));
    }
    let half_edge = ROOM * (core.bounding_radius() + radius);
    inside(&planes, half_edge)
}
