//! Bodies with a margin, resolved by the distance of their cores.
//!
//! A sphere has a point as its core, a spherocylinder a segment, and a rounded polyhedron a polyhedron, each with a sphere rolled
//! around it. A body without a margin is its own core. As long as the cores are apart, at a distance `D` along `n`, `n` is the common
//! normal and the overlap is `r_A + r_B - D`. This is erosion along the surface normal, which is exact, unlike radial erosion.
//!
//! Segments and points have closed forms. For all others GJK ends after a few supports. Where the cores intersect, the overlap is more
//! than the sum of both radii, and the next resolver of the chain must answer.

use super::gjk::{Difference, Separation, separate};
use super::patch::nearest_of_segments;
use super::polish::polished;
use super::{ContactResolver, Outcome, Posed, PosedCore, Touch, Why, touch_along};
use crate::math::Vec3;
use crate::shape::Shape;

/// Relative duality gap at which GJK stops: two polyhedra reach it, or rounding, in a few steps.
const TOLERANCE: f64 = 1e-14;

/// Resolver of two bodies of which at least one has a margin.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cores;

impl ContactResolver for Cores {
    fn name(&self) -> &'static str {
        "cores"
    }

    #[inline]
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        if let (Some(on_a), Some(on_b)) = (axis(a), axis(b)) {
            return between_axes(a, &on_a, b, &on_b, r);
        }
        let m = Difference::new(a, b, r);
        let squared = m.r.norm_squared();
        if squared > m.reach * m.reach {
            return Outcome::Apart((squared.sqrt() - m.reach) * m.unit);
        }
        if squared == 0.0 {
            return Outcome::Failed(Why::TooDeep);
        }
        let margins = (a.margin() + b.margin()) / m.unit;
        match separate(&m.cores(), warm.unwrap_or(&m.r), TOLERANCE, margins) {
            Separation::Apart(normal) => polished(a, b, r, touch_along(a, b, r, &normal)).outcome(),
            Separation::Beyond(distance) => Outcome::Apart((distance - margins) * m.unit),
            Separation::Intersecting => Outcome::Failed(Why::TooDeep),
            Separation::NotConverged => Outcome::Failed(Why::NoConvergence),
        }
    }
}

/// Vector from the centre to the end of the segment that is the body's core, in world axes [m]; zero for a sphere.
fn axis(body: &Posed) -> Option<Vec3> {
    match (body.core(), body.shape) {
        (PosedCore::Segment(end), _) => Some(end),
        (_, Shape::Sphere(_)) => Some(Vec3::zeros()),
        _ => None,
    }
}

/// Closed form: the shortest line between two segments, each given by the vector from its middle to one of its ends.
fn between_axes(a: &Posed, on_a: &Vec3, b: &Posed, on_b: &Vec3, r: &Vec3) -> Outcome {
    let (p, q) = nearest_of_segments(&[-on_a, *on_a], &[r - on_b, r + on_b]);
    let (radius_a, reach) = (a.margin(), a.margin() + b.margin());
    let between = q - p;
    let distance = between.norm();
    if distance > reach {
        return Outcome::Apart(distance - reach);
    }
    if distance.is_nan() {
        return Outcome::Failed(Why::NotFinite);
    }
    // The direction of such a short vector is a rounding error.
    if distance <= 1e-12 * reach {
        return Outcome::Failed(Why::TooDeep);
    }
    let overlap = reach - distance;
    let normal = between / distance;
    Touch { overlap, normal, point: p + normal * (radius_a - 0.5 * overlap) }.outcome()
}
