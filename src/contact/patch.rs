//! Where bodies with edges and faces touch: the centroid of what they share.
//!
//! Along a common normal, a face lies on a face or an edge on a face, and any of their points is a support
//! point. The contact point is then the centroid of the patch that both support features share: for an
//! edge on a face the middle of the common segment, for a corner the corner itself.
//!
//! Taken literally, that point would jump by half a face when a face tilts by one rounding error, and a
//! resting cube would be tossed from corner to corner. So each body is cut off at a small depth `t` below
//! its support plane, a fixed part of the overlap, and the section stands for the feature: it shrinks
//! steadily from the whole face to an edge or a corner while the face tilts by `t` over its width. The
//! centroid `c(t)` of the sections' common part differs from that of the features in first order of `t`;
//! `2 c(t/2) - c(t)` does not, and is exact for corners, for crossing edges and for faces.
//!
//! Sections are convex polygons, clipped edge by edge (Sutherland and Hodgman 1974,
//! DOI 10.1145/360767.360802). A curved body has one support point and needs none of this.

use super::Posed;
use crate::math::Vec3;
use crate::shape::{Core, hull::Hull};

/// Depth of the sections, as a part of the overlap: faces within that much of being flush, over their width,
/// count as such in part.
const DEPTH: f64 = 1e-3;
/// Least depth, as a part of the smaller body's size: rounding of its corners.
const ROUNDING: f64 = 1e-10;
/// A polygon with less area than this part of its squared outline is a segment.
const THIN: f64 = 1e-14;
/// Segments at a lesser angle [rad] are parallel.
const PARALLEL: f64 = 1e-7;

/// The contact point of two bodies, seen along their normal from A to B: its part across the normal, from
/// the centre of A, in world axes [m].
pub(super) fn centre_between(a: &Posed, b: &Posed, r: &Vec3, normal: &Vec3, overlap: f64) -> Vec3 {
    let (size_a, size_b) = (a.shape.bounding_radius(), b.shape.bounding_radius());
    let size = if size_a < size_b { size_a } else { size_b };
    let across = r - normal * r.dot(normal);
    extrapolated(size, overlap, |depth| {
        let mut on_b = section(b, &-normal, depth);
        // Counter-clockwise about the normal of A, too.
        on_b.reverse();
        for point in &mut on_b {
            *point += across;
        }
        centre(&section(a, normal, depth), &on_b, normal)
    })
}

/// The same of a body on a wall; `normal` from the body to the wall.
pub(super) fn centre_on_plane(a: &Posed, normal: &Vec3, overlap: f64) -> Vec3 {
    extrapolated(a.shape.bounding_radius(), overlap, |depth| {
        centroid(&section(a, normal, depth), normal)
    })
}

/// `2 c(t/2) - c(t)`
fn extrapolated(size: f64, overlap: f64, centre: impl Fn(f64) -> Vec3) -> Vec3 {
    let depth = DEPTH * overlap + ROUNDING * size;
    centre(0.5 * depth) * 2.0 - centre(depth)
}

/// The section of a body's core at `depth` below its support plane, laid flat through the body's centre:
/// a polygon, counter-clockwise about `normal`, or the two ends of a segment, or a point.
fn section(body: &Posed, normal: &Vec3, depth: f64) -> Vec<Vec3> {
    let flat = |p: Vec3| p - normal * p.dot(normal);
    match body.shape.core() {
        Core::Curved => vec![flat(body.core_support(normal))],
        Core::Segment(half) => {
            let axis = body.frame.column(0) * half;
            let top = if axis.dot(normal) < 0.0 { -axis } else { axis };
            let fall = 2.0 * top.dot(normal);
            // From the upper end to the lower one, or to where the depth is reached.
            let part = if fall > depth { depth / fall } else { 1.0 };
            vec![flat(top), flat(top - top * (2.0 * part))]
        }
        Core::Hull(hull) => hull_section(hull, body, normal, depth),
    }
}

fn hull_section(hull: &Hull, body: &Posed, normal: &Vec3, depth: f64) -> Vec<Vec3> {
    let height = body.core_support(normal).dot(normal) - depth;
    let x = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize() * hull.bounding_radius();
    let y = normal.cross(&x);
    let mut polygon = vec![-x - y, x - y, x + y, y - x];
    let mut clipped = Vec::with_capacity(16);
    for plane in hull.planes() {
        let outward = body.frame * plane.normal;
        clip(&mut polygon, &outward, plane.offset - height * outward.dot(normal), &mut clipped);
    }
    if polygon.is_empty() {
        // Thinner than rounding.
        let top = body.core_support(normal);
        polygon.push(top - normal * top.dot(normal));
    }
    polygon
}

/// Leaves of a convex polygon the part with `p · outward <= offset`.
fn clip(polygon: &mut Vec<Vec3>, outward: &Vec3, offset: f64, clipped: &mut Vec<Vec3>) {
    clipped.clear();
    for (k, here) in polygon.iter().enumerate() {
        let next = polygon[(k + 1) % polygon.len()];
        let (inside, then) = (offset - here.dot(outward), offset - next.dot(outward));
        if inside >= 0.0 {
            clipped.push(*here);
        }
        if (inside > 0.0 && then < 0.0) || (inside < 0.0 && then > 0.0) {
            clipped.push(here + (next - here) * (inside / (inside - then)));
        }
    }
    std::mem::swap(polygon, clipped);
}

/// The centroid of what two sections share. If they share nothing, as for a normal that is not the common
/// one, the middle between points of them that are near each other.
fn centre(a: &[Vec3], b: &[Vec3], normal: &Vec3) -> Vec3 {
    if let (&[p, q], &[s, t]) = (a, b) {
        let (on_a, on_b) = nearest_of_segments(&[p, q], &[s, t]);
        return (on_a + on_b) * 0.5;
    }
    let (subject, clipper) = if a.len() <= b.len() { (a, b) } else { (b, a) };
    let mut shared = subject.to_vec();
    let mut clipped = Vec::with_capacity(16);
    for (k, from) in clipper.iter().enumerate() {
        let outward = (clipper[(k + 1) % clipper.len()] - from).cross(normal);
        clip(&mut shared, &outward, from.dot(&outward), &mut clipped);
    }
    // The edges of fewer than three corners bound nothing.
    if clipper.len() > 2 && !shared.is_empty() {
        return centroid(&shared, normal);
    }
    let on_a = nearest(a, &centroid(b, normal), normal);
    let on_b = nearest(b, &on_a, normal);
    (on_a + on_b) * 0.5
}

/// The centroid of a polygon's area; of its outline, if it has none.
fn centroid(polygon: &[Vec3], normal: &Vec3) -> Vec3 {
    let first = polygon[0];
    let (mut area, mut moment) = (0.0, Vec3::zeros());
    let (mut outline, mut border) = (0.0, Vec3::zeros());
    for (k, here) in polygon.iter().enumerate() {
        let (p, q) = (here - first, polygon[(k + 1) % polygon.len()] - first);
        let doubled = p.cross(&q).dot(normal);
        area += doubled;
        moment += (p + q) * (doubled / 3.0);
        let length = (q - p).norm();
        outline += length;
        border += (p + q) * (0.5 * length);
    }
    if area > THIN * (outline * outline) {
        first + moment / area
    } else if outline > 0.0 {
        first + border / outline
    } else {
        first
    }
}

/// The point of a polygon nearest to another point of its plane.
fn nearest(polygon: &[Vec3], point: &Vec3, normal: &Vec3) -> Vec3 {
    let mut best = polygon[0];
    let mut inside = polygon.len() > 2;
    for (k, &p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        inside &= (q - p).cross(&(point - p)).dot(normal) >= 0.0;
        let (foot, _) = nearest_of_segments(&[p, q], &[*point, *point]);
        if (foot - point).norm_squared() < (best - point).norm_squared() {
            best = foot;
        }
    }
    if inside { *point } else { best }
}

/// Two points of two segments at the shortest distance (Ericson 2005, *Real-Time Collision Detection*,
/// section 5.1.9). Of parallel segments the middle of the part where they face each other.
pub(super) fn nearest_of_segments(a: &[Vec3; 2], b: &[Vec3; 2]) -> (Vec3, Vec3) {
    let (u, v, w) = (a[1] - a[0], b[1] - b[0], a[0] - b[0]);
    let (uu, vv, uv) = (u.norm_squared(), v.norm_squared(), u.dot(&v));
    let (uw, vw) = (u.dot(&w), v.dot(&w));
    let crossed = uu * vv - uv * uv;
    // The fraction of A's length nearest to a fraction of B's, and the other way.
    let on_a = |t: f64| if uu > 0.0 { ((t * uv - uw) / uu).clamp(0.0, 1.0) } else { 0.0 };
    let on_b = |s: f64| if vv > 0.0 { ((s * uv + vw) / vv).clamp(0.0, 1.0) } else { 0.0 };
    let s = if crossed > PARALLEL * PARALLEL * (uu * vv) {
        ((uv * vw - uw * vv) / crossed).clamp(0.0, 1.0)
    } else {
        // Where B's ends face A, or A's nearest ends.
        0.5 * (on_a(0.0) + on_a(1.0))
    };
    let t = on_b(s);
    (a[0] + u * on_a(t), b[0] + v * t)
}
