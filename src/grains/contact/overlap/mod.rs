//! Contacts of bodies with faces or straight sides, from the shared volume and not from one depth.
//!
//! A polyhedron on a face has no single contact point and no smooth depth. The deepest point jumps from corner to corner when the face
//! tilts. A force that depends on one depth gains energy, or lets a block at rest creep.
//!
//! Here the polyhedron that both bodies share is computed exactly ([`crate::shape::clip`]). The energy of the contact is that of a spring
//! compressed by the thickness of this polyhedron ([`faces`]). The space behind the triangles of a wall is treated in the same way
//! ([`surface`]). A spherocylinder has the same problem along its straight side. It gets the thickness of a line, on a plane or another
//! spherocylinder ([`sides`]), and on triangles, cylinders and cones ([`sides_on_surface`]).

mod faces;
mod seen;
mod sides;
mod sides_on_surface;
mod surface;
mod thickness;
mod together;
mod unions;

use faces::of_faces;
use sides::of_sides;
pub use surface::{OverlapWithSurface, thickness_on_surface};
pub use thickness::Thickness;
use thickness::size_of_both;
pub use unions::{OfPieces, PairOfPieces, thickness_of_pieces, thickness_of_pieces_on_surface};

use super::gjk::{Difference, Separation, separate};
use super::{
    Batch, ContactResolver, Definition, Found, Outcome, Patch, Posed, Touch, Why, touch_along,
};
use crate::math::Vec3;
use crate::shape::Shape;

/// Thickness of the volume that two bodies share, with its gradient.
///
/// Either A has faces and B has faces or is a half-space, or A has a straight side and B has one or is a half-space. `r` points from the
/// centre of A to that of B, or to the reference point of its wall [m]. Returns `None` for other bodies, if the bodies share nothing, or
/// if one is inside the other so that no force is left.
pub fn thickness(a: &Posed, b: &Posed, r: &Vec3) -> Option<Thickness> {
    of_sides(a, b, r).map_or_else(|| of_faces(a, b, r), Result::ok)
}

/// Resolver of two bodies with faces, or two spherocylinders, or one of these (A) and a half-space, by the thickness of the shared volume.
///
/// The thickness is the overlap, and the normal is the direction of the force. Each contact of a batch also gets a [`Patch`], which a law
/// needs for the complete force.
#[derive(Clone, Copy, Debug, Default)]
pub struct Overlap;

impl Overlap {
    /// The shared volume of a pair, or the outcome if there is none.
    fn shared(a: &Posed, b: &Posed, r: &Vec3, touched: bool) -> Result<Thickness, Outcome> {
        if let Some(found) = of_sides(a, b, r) {
            return found;
        }
        let excess = |body: &Posed| body.shape.excess() * body.scale;
        let beyond = excess(a) + excess(b);
        // Bodies that touched usually touch again; others are more often apart.
        let mut known = None;
        if !touched {
            known = clearance(a, b, r);
            if let Some(clear) = known.filter(|&clear| clear > beyond) {
                return Err(Outcome::Apart(clear - beyond));
            }
        }
        of_faces(a, b, r).ok_or_else(|| match known.or_else(|| clearance(a, b, r)) {
            Some(clear) => Outcome::Apart((clear - beyond).max(0.0)),
            None => Outcome::Failed(Why::TooDeep),
        })
    }
}

impl ContactResolver for Overlap {
    fn name(&self) -> &'static str {
        "thickness"
    }

    fn definition(&self) -> Definition {
        Definition::Thickness
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        Self::shared(a, b, r, warm.is_some())
            .map_or_else(|outcome| outcome, |found| Outcome::Touching(touch(&found)))
    }

    fn resolve(&self, batch: &Batch, found: &mut Found) {
        for &index in batch.active {
            let pair = batch.pairs[index as usize];
            let r = batch.bodies.relative(pair);
            let frames = batch.bodies.frames(pair);
            let (a, b) = batch.bodies.posed(pair, &frames);
            match Self::shared(&a, &b, &r, batch.last_normal(index).is_some()) {
                Ok(shared) => found.contacts.push_with(index, &touch(&shared), &patch(&shared)),
                Err(outcome) => found.note(index, outcome),
            }
        }
    }
}

/// Contact geometry and patch of a thickness.
pub fn contact_of(found: &Thickness) -> (Touch, Patch) {
    (touch(found), patch(found))
}

fn touch(found: &Thickness) -> Touch {
    Touch { overlap: found.thickness, normal: found.normal, point: found.point }
}

fn patch(found: &Thickness) -> Patch {
    let Thickness { thickness, gain, couple, covariance: c, .. } = *found;
    let covariance = [c.m11, c.m22, c.m33, c.m23, c.m13, c.m12];
    Patch { gain, lever: couple / thickness, covariance }
}

/// An overlap below this part of the size counts as none.
const THIN: f64 = 1e-8;
/// Relative duality gap of the distance between bodies.
const TOLERANCE: f64 = 1e-6;

/// Lower bound of the distance of two bodies [m], 0 if they hardly overlap; `None` if they do.
///
/// The bodies are the rounded ones, not the polyhedra that represent them.
fn clearance(a: &Posed, b: &Posed, r: &Vec3) -> Option<f64> {
    let thin = THIN * size_of_both(a.bounding_radius(), b.bounding_radius());
    let clear = |clearance: f64| (clearance > -thin).then_some(clearance.max(0.0));
    if let Shape::HalfSpace(plane) = b.shape {
        let normal = -(b.frame * plane.normal);
        let overlap = (a.support(&normal) - r).dot(&normal) + plane.offset;
        return clear(-overlap);
    }
    let bodies = Difference::new(a, b, r);
    let squared = bodies.r.norm_squared();
    if squared > bodies.reach * bodies.reach {
        return clear((squared.sqrt() - bodies.reach) * bodies.unit);
    }
    match separate(&bodies, &bodies.r, TOLERANCE, f64::INFINITY) {
        Separation::Apart(normal) => clear(-touch_along(a, b, r, &normal).overlap),
        Separation::Beyond(distance) => clear(distance * bodies.unit),
        Separation::Intersecting | Separation::NotConverged => None,
    }
}
