//! A convex shape against a plane facet of a wall: the closed form.
//!
//! The normal is the wall's, so the support point against it is the deepest point: exact for every
//! shape that has a support function, and always chosen for this pair. Of an edge or a face that lies on the
//! wall, the contact point is the centroid.

use super::{ContactResolver, Outcome, Posed, Touch, patch};
use crate::math::Vec3;
use crate::shape::Shape;

/// Resolves any convex shape (A) against a half-space (B). The relative position runs from the
/// centre of A to the reference point of the wall; the plane lies in the axes of the wall.
#[derive(Clone, Copy, Debug, Default)]
pub struct AgainstHalfSpace;

impl ContactResolver for AgainstHalfSpace {
    fn name(&self) -> &'static str {
        "half-space"
    }

    /// # Panics
    /// If B is not a half-space: the table of resolvers was filled wrongly.
    #[inline]
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, _warm: Option<&Vec3>) -> Outcome {
        let Shape::HalfSpace(plane) = b.shape else {
            unreachable!("a facet is the second body of its pairs")
        };
        let normal = -(b.frame * plane.normal);
        let deepest = a.support(&normal);
        let overlap = (deepest - r).dot(&normal) + plane.offset;
        // P_B is the foot of P_A on the plane; the contact point is half way.
        let mut point = deepest - normal * (0.5 * overlap);
        if overlap > 0.0 && !a.is_curved() {
            point = patch::centre_on_plane(a, &normal, overlap) + normal * point.dot(&normal);
        }
        Touch { overlap, normal, point }.outcome()
    }
}
