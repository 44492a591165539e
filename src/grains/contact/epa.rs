//! Expanding polytope: the overlap of any two convex bodies, to a tolerance.
//!
//! Van den Bergen (2001), "Proximity queries and penetration depth computation on 3D game objects". A polytope inside the Minkowski
//! difference grows at the face nearest to the origin, until that face is as far out as the difference itself. The method needs only
//! support points and finds the true overlap at any depth. It is for sharp shapes and for checks of other methods.
//!
//! It departs from the textbook in four ways:
//!
//! - The last tetrahedron of GJK is used only if it is not flat. The one built otherwise need not contain the origin: distances of faces
//!   carry a sign, and a face that has the origin outside is the next to be moved out.
//! - The answer carries its own proof. The least overlap over all directions seen is an upper bound, the nearest face a lower one, and
//!   only their difference ends the iteration.
//! - For smooth bodies, a few secant steps from the nearest face determine the direction to rounding. The proof alone leaves it
//!   uncertain by the square root of the tolerance.
//! - For smooth bodies that touched before, secants from the last normal come first. The polytope begins with corners around their
//!   result, where it must be fine, and little more than the proof remains.

use super::gjk::{Corner, Difference, Separation, enclose, secant};
use super::polish::polished;
use super::{Batch, ContactResolver, Found, Outcome, Posed, Why, touch_along};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Rounding of the bounds, in units of the pair's length.
const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// Height above a face from which a corner sees it [units]: less may be rounding.
const SEES: f64 = 4.0 * f64::EPSILON;
/// A tetrahedron with less volume than this part of its longest edge cubed, times 6, is flat.
const FLAT: f64 = 1e-4;
/// Limit of the corners of the polytope.
///
/// Ellipsoids take about 30 at 1e-8, but hundreds where the overlap is nearly the same along a range of directions.
const CORNERS: usize = 1000;
/// Limit of secants at the end; smooth bodies take 3 to 5.
const SECANTS: u32 = 8;
/// A secant that does not bring the remainder below this part of the last one is the last.
const WORTHWHILE: f64 = 0.25;
/// Remainder below which secants have found the overlap to rounding [units squared].
const FOUND: f64 = 1e-16;
/// Tilt of the directions with which secants from the last normal begin.
const NEAR: f64 = 1e-3;
/// Largest tilt of the rings around the result of the secants.
const FAR: f64 = 0.2;
const HALF_ROOT_3: f64 = 0.866_025_403_784_438_6;

/// Resolver of two convex bodies by GJK and the expanding polytope.
///
/// The overlap is that of the *bodies* along the best direction. It exceeds the true one by at most `tolerance`, and is never less
/// except for rounding.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Epa {
    /// Largest excess over the true overlap, relative to the size of the larger body (its bounding radius, rounded down to a power of two).
    ///
    /// For smooth bodies the excess is hardly ever more than rounding, unless the tolerance is so coarse that two minima are confused.
    pub tolerance: f64,
    /// Whether secants end the iteration where both bodies are smooth. Without them, this is EPA as in the paper.
    pub polish: bool,
}

impl Default for Epa {
    fn default() -> Self {
        Self::new(1e-8)
    }
}

impl Epa {
    /// EPA to this tolerance, with secants at the end.
    pub const fn new(tolerance: f64) -> Self {
        Self { tolerance, polish: true }
    }

    /// Contact along a normal, polished if enabled.
    fn touch_along(self, a: &Posed, b: &Posed, r: &Vec3, normal: &Vec3) -> Outcome {
        let touch = touch_along(a, b, r, normal);
        if self.polish { polished(a, b, r, touch).outcome() } else { touch.outcome() }
    }

    #[inline]
    fn touch_with(
        self,
        polytope: &mut Polytope,
        a: &Posed,
        b: &Posed,
        r: &Vec3,
        warm: Option<&Vec3>,
    ) -> Outcome {
        let m = Difference::new(a, b, r);
        let squared = m.r.norm_squared();
        if squared > m.reach * m.reach {
            return Outcome::Apart((squared.sqrt() - m.reach) * m.unit);
        }
        let polish = self.polish && m.is_smooth;
        let tolerance = self.tolerance + ROUNDING;
        if let Some(corner) = warm.filter(|_| polish).and_then(|last| near(&m, last)) {
            if corner.overlap() <= 0.0 {
                return Outcome::Apart(-corner.overlap() * m.unit);
            }
            let begun = polytope.begin_about(&m, &corner, tolerance);
            if let Some(normal) =
                begun.and_then(|()| polytope.expand(&m, tolerance, Some(corner), polish))
            {
                return self.touch_along(a, b, r, &normal);
            }
        }
        // Coincident centres have an overlap, but no unique normal.
        let start = if squared == 0.0 { Vec3::x() } else { m.r };
        let (answer, simplex) = enclose(&m, &start, 0.0, 0.0);
        match answer {
            Separation::Beyond(distance) => return Outcome::Apart(distance * m.unit),
            Separation::Apart(_) => return Outcome::Apart(0.0),
            // The polytope of a stalled iteration may not contain the origin, which does no harm.
            Separation::NotConverged | Separation::Intersecting => {}
        }
        match simplex.tetrahedron() {
            Some(corners) if !is_flat(corners) => polytope.begin(corners),
            _ => polytope.begin(&tetrahedron(&m, &start.normalize())),
        }
        match polytope.expand(&m, tolerance, None, polish) {
            Some(normal) => self.touch_along(a, b, r, &normal),
            None => Outcome::Failed(Why::NoConvergence),
        }
    }
}

impl ContactResolver for Epa {
    fn name(&self) -> &'static str {
        "epa"
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        self.touch_with(&mut Polytope::default(), a, b, r, warm)
    }

    /// Resolves the pairs one after the other and reuses the memory of the polytope.
    fn resolve(&self, batch: &Batch, found: &mut Found) {
        let mut polytope = Polytope::default();
        for &index in batch.active {
            let pair = batch.pairs[index as usize];
            let r = batch.bodies.relative(pair);
            let frames = batch.bodies.frames(pair);
            let (a, b) = batch.bodies.posed(pair, &frames);
            let warm = batch.last_normal(index);
            found.note(index, self.touch_with(&mut polytope, &a, &b, &r, warm));
        }
    }
}

/// Six times the volume, positive if the first three corners are counter-clockwise seen from the fourth.
fn volume(corners: &[Corner; 4]) -> f64 {
    let [p, q, s, t] = corners.each_ref().map(|corner| corner.point);
    (q - p).cross(&(s - p)).dot(&(t - p))
}

fn is_flat(corners: &[Corner; 4]) -> bool {
    let [p, rest @ ..] = corners.each_ref().map(|corner| corner.point);
    let longest = rest.iter().map(|q| (q - p).norm_squared()).fold(0.0, f64::max);
    volume(corners).abs() < FLAT * longest * longest.sqrt()
}

/// A tetrahedron that is not flat.
///
/// The distance of each new corner from the span of the others is at least half the width of the difference.
fn tetrahedron(m: &Difference, start: &Vec3) -> [Corner; 4] {
    let (p, q) = (m.corner(*start), m.corner(-start));
    let edge = (q.point - p.point).normalize();
    let from_edge = |x: &Corner| (x.point - p.point).cross(&edge).norm_squared();
    let across = edge.cross(&Vec3::ith(edge.iamin(), 1.0)).normalize();
    let sides = [m.corner(across), m.corner(-across)];
    let s = sides[usize::from(from_edge(&sides[0]) < from_edge(&sides[1]))];
    let up = (q.point - p.point).cross(&(s.point - p.point)).normalize();
    let (above, below) = (m.corner(up), m.corner(-up));
    let height = |x: &Corner| (x.point - p.point).dot(&up);
    let t = if height(&above) < -height(&below) { below } else { above };
    [p, q, s, t]
}

/// Three unit vectors around a unit vector, tilted by this tangent.
fn around(normal: &Vec3, tilt: f64) -> [Vec3; 3] {
    let u = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize();
    let v = normal.cross(&u);
    let sides = [u, v * HALF_ROOT_3 - u * 0.5, -v * HALF_ROOT_3 - u * 0.5];
    sides.map(|side| (normal + side * tilt).normalize())
}

/// Corner of least overlap near the last direction, a unit vector, if secants find it, or a corner without overlap.
fn near(m: &Difference, last: &Vec3) -> Option<Corner> {
    let corner = m.corner(*last);
    if corner.overlap() <= 0.0 {
        return Some(corner);
    }
    let [p, q, _] = around(last, NEAR);
    let best = secants(m, [corner, m.corner(p), m.corner(q)], corner);
    (best.remainder() <= FOUND || best.overlap() <= 0.0).then_some(best)
}

/// A triangle of the polytope.
struct Face {
    /// Corners, counter-clockwise seen from outside.
    corners: [u32; 3],
    /// Faces beyond the edges from each corner to the next.
    neighbours: [u32; 3],
    /// Outward unit normal.
    normal: Vec3,
    /// Distance of the plane from the origin; negative if the origin is outside.
    distance: f64,
    /// Whether the face was replaced.
    gone: bool,
}

impl Face {
    /// Whether a point is on the outer side.
    #[inline]
    fn is_seen_from(&self, point: &Vec3) -> bool {
        point.dot(&self.normal) > self.distance + SEES
    }

    /// Index of the edge that starts at this corner of the face.
    fn edge_from(&self, corner: u32) -> usize {
        self.corners.iter().position(|&c| c == corner).unwrap_or(0)
    }
}

/// An edge of the outline that a corner sees, counter-clockwise, and the face beyond it.
struct Edge {
    from: u32,
    to: u32,
    /// Face and edge on the side that is not seen.
    beyond: (u32, usize),
}

/// A convex polytope with corners on the boundary of the difference; cleared for each pair to keep its memory.
#[derive(Default)]
struct Polytope {
    corners: Vec<Corner>,
    faces: Vec<Face>,
    /// Faces that may still be the nearest, by distance.
    near: BinaryHeap<Reverse<(i64, u32)>>,
    /// Edges of seen faces, still to be crossed.
    crossings: Vec<(u32, usize)>,
    horizon: Vec<Edge>,
}

/// Integer with the order of the floating-point numbers.
fn key(distance: f64) -> i64 {
    let bits = distance.to_bits() as i64;
    bits ^ (((bits >> 63) as u64) >> 1) as i64
}

impl Polytope {
    fn begin(&mut self, corners: &[Corner; 4]) {
        self.corners.clear();
        self.faces.clear();
        self.near.clear();
        let unit = |c: &Corner| Corner { direction: c.direction.normalize(), ..*c };
        self.corners.extend(corners.iter().map(unit));
        if volume(corners) > 0.0 {
            // The bottom face comes first, and must look clockwise from the fourth corner.
            self.corners.swap(1, 2);
        }
        let faces = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]];
        let neighbours = [[1, 2, 3], [3, 2, 0], [1, 3, 0], [2, 1, 0]];
        for (corners, neighbours) in faces.into_iter().zip(neighbours) {
            self.add_face(corners, neighbours, f64::INFINITY);
        }
    }

    /// Begins with a small face around the direction of least overlap, where the polytope must be finest.
    ///
    /// Rings around it widen as fast as the proof allows. Returns `None` where [`Polytope::insert`] does.
    fn begin_about(&mut self, m: &Difference, best: &Corner, tolerance: f64) -> Option<()> {
        let overlap = best.overlap();
        // The small face is no deeper below the surface than the tolerance, for radii of curvature up to 4.
        let smallest = (0.5 * tolerance).sqrt();
        // Up to this ratio of their tilts, a face between two rings is farther out than the overlap.
        let wider = (0.5 / overlap).clamp(3.0, 100.0);
        let [p, q, s] = around(&best.direction, -1.0).map(|direction| m.corner(direction));
        self.begin(&[p, q, s, m.corner(-best.direction)]);
        let mut tilt = smallest;
        while tilt * wider < FAR {
            tilt *= wider;
        }
        // Each ring is turned by half against the previous one.
        let mut side = 1.0;
        loop {
            for direction in around(&best.direction, side * tilt) {
                self.grow(m.corner(direction), overlap)?;
            }
            if tilt < 2.0 * smallest {
                return Some(());
            }
            (tilt, side) = (tilt / wider, -side);
        }
    }

    /// Adds a corner if it is outside. Returns `None` where [`Polytope::insert`] does.
    fn grow(&mut self, corner: Corner, enough: f64) -> Option<()> {
        match self.faces.iter().position(|face| !face.gone && face.is_seen_from(&corner.point)) {
            Some(face) => self.insert(corner, face as u32, enough),
            None => Some(()),
        }
    }

    /// Adds a face. A face at a distance of `enough` or more will never be the nearest one.
    fn add_face(&mut self, corners: [u32; 3], neighbours: [u32; 3], enough: f64) {
        let [p, q, s] = corners.map(|c| self.corners[c as usize].point);
        let across = (q - p).cross(&(s - p));
        let length = across.norm();
        // A face without area has no plane: it is never the nearest, and no corner sees it.
        let (normal, distance) = if length > 0.0 {
            let normal = across / length;
            (normal, normal.dot(&((p + q + s) / 3.0)))
        } else {
            (Vec3::zeros(), f64::INFINITY)
        };
        if distance < enough {
            self.near.push(Reverse((key(distance), self.faces.len() as u32)));
        }
        self.faces.push(Face { corners, neighbours, normal, distance, gone: false });
    }

    fn nearest_face(&mut self) -> Option<u32> {
        loop {
            let Reverse((_, face)) = self.near.pop()?;
            if !self.faces[face as usize].gone {
                return Some(face);
            }
        }
    }

    /// Direction of least overlap to within `tolerance`, or `None` if the iteration stalls.
    ///
    /// `best` is the corner with the least overlap so far.
    fn expand(
        &mut self,
        m: &Difference,
        tolerance: f64,
        mut best: Option<Corner>,
        polish: bool,
    ) -> Option<Vec3> {
        let mut least = best.map_or(f64::INFINITY, |corner| corner.overlap());
        let mut last = None;
        loop {
            if self.corners.len() >= CORNERS {
                return None;
            }
            let Some(nearest) = self.nearest_face() else {
                // All faces are farther out than the overlap along the best direction.
                break;
            };
            let Face { normal, distance, .. } = self.faces[nearest as usize];
            if last.is_none() && least - distance <= tolerance {
                // The bounds already agree before the first step.
                break;
            }
            last = Some(nearest);
            let corner = m.corner(normal);
            let overlap = corner.overlap();
            if overlap < least {
                (least, best) = (overlap, Some(corner));
            }
            // A direction without overlap proves that the bodies are apart.
            if least <= 0.0 {
                return Some(normal);
            }
            if least - distance <= tolerance {
                break;
            }
            if overlap - distance <= SEES {
                // The face cannot move: the polytope is finer than rounding.
                return None;
            }
            self.insert(corner, nearest, least)?;
        }
        let best = best?;
        let polished = last.filter(|_| polish).map(|face| {
            let corners = self.faces[face as usize].corners.map(|c| self.corners[c as usize]);
            secants(m, corners, best)
        });
        Some(polished.unwrap_or(best).direction)
    }

    /// Replaces every face that sees `corner`, `first` among them, by faces from their outline to it.
    ///
    /// Returns `None` if the outline is not one closed line, which rounding can cause.
    fn insert(&mut self, corner: Corner, first: u32, enough: f64) -> Option<()> {
        let new = self.corners.len() as u32;
        self.corners.push(corner);
        self.horizon.clear();
        self.crossings.clear();
        self.crossings.extend([(first, 2), (first, 1), (first, 0)]);
        self.faces[first as usize].gone = true;
        // Depth first with left turns, edges come in their order around the outline.
        while let Some((face, edge)) = self.crossings.pop() {
            let Face { corners, neighbours, .. } = &self.faces[face as usize];
            let (from, to, beyond) = (corners[edge], corners[(edge + 1) % 3], neighbours[edge]);
            let there = &mut self.faces[beyond as usize];
            if there.gone {
                continue;
            }
            let back = there.edge_from(to);
            if there.is_seen_from(&corner.point) {
                there.gone = true;
                self.crossings.extend([(beyond, (back + 2) % 3), (beyond, (back + 1) % 3)]);
            } else {
                self.horizon.push(Edge { from, to, beyond: (beyond, back) });
            }
        }
        let horizon = std::mem::take(&mut self.horizon);
        let count = horizon.len();
        let base = self.faces.len() as u32;
        let mut is_closed = count > 2;
        for (k, edge) in horizon.iter().enumerate() {
            let next = (k + 1) % count;
            is_closed &= edge.to == horizon[next].from;
            let (face, side) = edge.beyond;
            self.faces[face as usize].neighbours[side] = base + k as u32;
            let before = (k + count - 1) % count;
            let around = [face, base + next as u32, base + before as u32];
            self.add_face([edge.from, edge.to, new], around, enough);
        }
        self.horizon = horizon;
        is_closed.then_some(())
    }
}

/// The best corner after a few secants that start from three and never increase the overlap.
fn secants(m: &Difference, mut corners: [Corner; 3], best: Corner) -> Corner {
    let (least, mut best, mut left) = (best.overlap(), best, f64::INFINITY);
    for _ in 0..SECANTS {
        let Some(direction) = secant(&corners, &best.direction) else { break };
        let corner = m.corner(direction.normalize());
        let remainder = corner.remainder();
        if !(remainder < WORTHWHILE * left && corner.overlap() <= least + ROUNDING) {
            break;
        }
        (best, left) = (corner, remainder);
        let remainders = corners.each_ref().map(Corner::remainder);
        let worst = (1..3).fold(0, |k, i| if remainders[i] > remainders[k] { i } else { k });
        corners[worst] = corner;
    }
    best
}

/// For corners whose directions are unit vectors.
impl Corner {
    /// Overlap along the direction of the corner [units].
    fn overlap(&self) -> f64 {
        self.point.dot(&self.direction)
    }

    /// Squared distance of the point from the line of its direction [units²].
    fn remainder(&self) -> f64 {
        (self.point - self.direction * self.overlap()).norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::Epa;
    use crate::contact::{ContactResolver, Outcome, Posed, directions_tried, orientations};
    use crate::math::Vec3;
    use crate::shape::{Ellipsoid, Shape};

    /// Result for the `k`-th pair of equal ellipsoids with this overlap along the normal of [`orientations`].
    fn found(epa: Epa, semi_axes: Vec3, k: f64, overlap: f64, last: Option<&Vec3>) -> Outcome {
        let shape = Shape::Ellipsoid(Ellipsoid { semi_axes });
        let ([one, other], normal) = orientations(k);
        let a = Posed::new(&shape, &one);
        let b = Posed::new(&shape, &other);
        let r = a.support(&normal) - b.support(&-normal) - normal * overlap;
        epa.touch(&a, &b, &r, last)
    }

    /// A coarse polytope is enough for smooth bodies: the secants refine it.
    #[test]
    fn secants_find_the_normal() {
        let semi_axes = Vec3::new(1.0, 0.5, 0.4);
        for i in 0..500 {
            let k = f64::from(i);
            let normal = orientations(k).1;
            // Less than the least radii of curvature, so there is no other minimum.
            let overlap = 1e-3 + 0.02 * (0.9 * k).sin().abs();
            let outcome = found(Epa::new(1e-5), semi_axes, k, overlap, None);
            let Outcome::Touching(touch) = outcome else { panic!("pair {i} was not resolved") };
            assert!(
                (touch.overlap - overlap).abs() < 1e-14,
                "pair {i}: {:e}",
                touch.overlap - overlap
            );
            // By the secants, as the polytope alone is accurate to 1e-3.
            assert!((touch.normal - normal).norm() < 1e-8, "pair {i}: {}", touch.normal);
        }
    }

    /// The last normal saves half of the work or more, and a wrong one does no harm.
    #[test]
    fn goes_on_from_the_last_normal() {
        let semi_axes = Vec3::new(2.0, 1.0, 1.0);
        let supports = |epa: Epa, within: f64, last: &dyn Fn(f64, Vec3) -> Option<Vec3>| {
            let before = directions_tried();
            for i in 0..500 {
                let k = f64::from(i);
                let overlap = 1e-4 + 0.01 * (0.9 * k).sin().abs();
                let last = last(k, orientations(k).1);
                let outcome = found(epa, semi_axes, k, overlap, last.as_ref());
                let Outcome::Touching(touch) = outcome else { panic!("pair {i} was not resolved") };
                let off = touch.overlap - overlap;
                assert!(off.abs() < within, "pair {i} from {last:?}: {off:e}");
            }
            (directions_tried() - before) as f64 / 500.0
        };
        let turned = |k: f64, normal: Vec3, by: f64| {
            Some((normal + Vec3::new(k.sin(), (2.0 * k).cos(), (3.0 * k).sin()) * by).normalize())
        };
        for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
            let epa = Epa::new(tolerance);
            let cold = supports(epa, tolerance, &|_, _| None);
            let warm = supports(epa, 1e-14, &|k, normal| turned(k, normal, 1e-4));
            assert!(warm < 0.6 * cold, "{tolerance:e}: {warm} after {cold}");
            supports(epa, tolerance, &|k, normal| turned(k, normal, 0.1));
            supports(epa, tolerance, &|_, normal| Some(-normal));
        }
    }

    /// Bodies that have come apart are never reported as touching, whatever the last normal was.
    #[test]
    fn the_last_normal_of_bodies_apart() {
        let semi_axes = Vec3::new(2.0, 1.0, 0.7);
        for i in 0..500 {
            let k = f64::from(i);
            let normal = orientations(k).1;
            let clearance = 1e-8 + 1e-6 * (0.9 * k).sin().abs();
            for last in [normal, orientations(k + 0.1).1, -normal] {
                let outcome = found(Epa::new(1e-4), semi_axes, k, -clearance, Some(&last));
                let Outcome::Apart(bound) = outcome else { panic!("pair {i} touches") };
                assert!(bound <= clearance + 4e-15, "pair {i}: {bound:e} of {clearance:e}");
            }
        }
    }
}
