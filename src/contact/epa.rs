//! Expanding polytope: the overlap of any two convex bodies, to a tolerance.
//!
//! Van den Bergen (2001), "Proximity queries and penetration depth computation on 3D game objects". A
//! polytope inside the Minkowski difference grows at the face nearest to the origin, until that face is
//! as far out as the difference itself. It needs nothing but support points and finds the true
//! overlap however deep; it is the slowest method, and its normal is only as good as the square root of
//! the tolerance. Choose it for sharp shapes, or to check another method.
//!
//! Two departures from the textbook make it robust. The first tetrahedron is built from support points
//! along the axes of its own edges and is never flat; it need not hold the origin, because distances of
//! faces carry a sign and a face that has the origin outside is the next to be moved out. And the
//! answer carries its own proof: the least overlap over all directions seen is an upper bound, the
//! nearest face a lower one, and only their difference ends the iteration.

use super::gjk::{Difference, Separation, separate};
use super::{ContactResolver, Outcome, Posed, Why, touch_along};
use crate::math::Vec3;

/// Rounding of the bounds, in units of the pair's length.
const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// Corners of the polytope: ellipsoids take about 35 at 1e-8, but hundreds where the overlap is nearly the
/// same along a range of directions.
const CORNERS: usize = 1000;

/// Resolves two convex bodies by GJK and the expanding polytope.
///
/// The overlap returned is that of the *bodies* along the best direction, at most `tolerance` more
/// than the true one and never less but for rounding.
#[derive(Clone, Copy, Debug)]
pub struct Epa {
    /// How far the overlap may be above the true one, relative to the size of the larger body (its
    /// bounding radius, rounded down to a power of two).
    pub tolerance: f64,
}

impl Default for Epa {
    /// At 1e-8 the normal is good to 1e-4 rad.
    fn default() -> Self {
        Self { tolerance: 1e-8 }
    }
}

impl ContactResolver for Epa {
    fn name(&self) -> &'static str {
        "epa"
    }

    #[inline]
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, _warm: Option<&Vec3>) -> Outcome {
        let m = Difference::new(a, b, r);
        let squared = m.r.norm_squared();
        if squared > m.reach * m.reach {
            return Outcome::Apart((squared.sqrt() - m.reach) * m.unit);
        }
        // Coincident centres have an overlap, if no unique normal. A warm start would only put a corner
        // where the polytope must become finest, and slivers around it.
        let start = if squared == 0.0 { Vec3::x() } else { m.r };
        match separate(&m, &start, 0.0, 0.0) {
            Separation::Beyond(distance) => return Outcome::Apart(distance * m.unit),
            Separation::Apart(_) => return Outcome::Apart(0.0),
            Separation::NotConverged => return Outcome::Failed(Why::NoConvergence),
            Separation::Intersecting => {}
        }
        match Polytope::new(&m, &start.normalize()).expand(&m, self.tolerance + ROUNDING) {
            Some(normal) => touch_along(a, b, r, &normal).outcome(),
            None => Outcome::Failed(Why::NoConvergence),
        }
    }
}

/// A triangle of the polytope.
#[derive(Clone, Copy)]
struct Face {
    /// Counter-clockwise, seen from outside.
    corners: [u16; 3],
    /// Outward unit normal.
    normal: Vec3,
    /// Of its plane from the origin; negative if the origin is outside.
    distance: f64,
}

/// A convex polytope with corners on the boundary of the difference.
struct Polytope {
    corners: Vec<Vec3>,
    faces: Vec<Face>,
}

impl Polytope {
    /// A tetrahedron that is not flat: each new corner is at least half as far out of the span of the
    /// others as the difference is wide.
    fn new(m: &Difference, start: &Vec3) -> Self {
        let (p, q) = (m.support(start), m.support(&-start));
        let edge = (q - p).normalize();
        let from_edge = |x: &Vec3| (x - p).cross(&edge).norm_squared();
        let across = edge.cross(&Vec3::ith(edge.iamin(), 1.0)).normalize();
        let sides = [m.support(&across), m.support(&-across)];
        let s = sides[usize::from(from_edge(&sides[0]) < from_edge(&sides[1]))];
        let up = (q - p).cross(&(s - p)).normalize();
        let (above, below) = (m.support(&up), m.support(&-up));
        // Bottom face first: from the fourth corner it must look clockwise.
        let t = if (above - p).dot(&up) < (p - below).dot(&up) { below } else { above };
        let corners = if (t - p).dot(&up) > 0.0 { vec![p, s, q, t] } else { vec![p, q, s, t] };
        let mut polytope = Self { corners, faces: Vec::with_capacity(96) };
        for face in [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]] {
            polytope.add_face(face);
        }
        polytope
    }

    fn add_face(&mut self, corners: [u16; 3]) {
        let [p, q, s] = corners.map(|c| self.corners[usize::from(c)]);
        let across = (q - p).cross(&(s - p));
        let length = across.norm();
        // A face without area has no plane: it is never the nearest, and nothing sees it.
        let (normal, distance) = if length > 0.0 {
            let normal = across / length;
            (normal, normal.dot(&((p + q + s) / 3.0)))
        } else {
            (Vec3::zeros(), f64::INFINITY)
        };
        self.faces.push(Face { corners, normal, distance });
    }

    fn nearest_face(&self) -> Option<&Face> {
        let mut faces = self.faces.iter();
        let mut nearest = faces.next()?;
        for face in faces {
            if face.distance < nearest.distance {
                nearest = face;
            }
        }
        Some(nearest)
    }

    /// The direction of least overlap to within `tolerance`, or `None` if the iteration stalls.
    fn expand(mut self, m: &Difference, tolerance: f64) -> Option<Vec3> {
        let mut horizon = Vec::with_capacity(32);
        let mut least = f64::INFINITY;
        let mut best = Vec3::zeros();
        while self.corners.len() < CORNERS {
            let Face { normal, distance, .. } = *self.nearest_face()?;
            let corner = m.support(&normal);
            let overlap = corner.dot(&normal);
            if overlap < least {
                (least, best) = (overlap, normal);
            }
            // A direction along which the bodies do not overlap settles the matter at once.
            if least - distance <= tolerance || least <= 0.0 {
                return Some(best);
            }
            if overlap - distance <= f64::EPSILON {
                // The face cannot move: the polytope is finer than rounding.
                return None;
            }
            self.insert(corner, &mut horizon);
        }
        None
    }

    /// Replaces every face that sees `corner` by faces from their outline to it.
    fn insert(&mut self, corner: Vec3, horizon: &mut Vec<(u16, u16)>) {
        let new = self.corners.len() as u16;
        self.corners.push(corner);
        horizon.clear();
        for i in (0..self.faces.len()).rev() {
            let face = &self.faces[i];
            if corner.dot(&face.normal) > face.distance {
                let [p, q, s] = self.faces.swap_remove(i).corners;
                for (from, to) in [(p, q), (q, s), (s, p)] {
                    // An edge between two visible faces comes once in each direction.
                    match horizon.iter().position(|&edge| edge == (to, from)) {
                        Some(i) => drop(horizon.swap_remove(i)),
                        None => horizon.push((from, to)),
                    }
                }
            }
        }
        for &(from, to) in &*horizon {
            self.add_face([from, to, new]);
        }
    }
}
