//! Contact point of bodies with edges and faces: the centroid of the shared features.
//!
//! Where a face or an edge lies on a face, along the common normal, all their points are support points. The contact point is the
//! centroid of the patch that both support features share. It is the middle of the common segment for an edge on a face, and the corner
//! itself for a corner.
//!
//! With exact features, that point would jump by half a face when a face tilts by one rounding error. A resting cube would rock from
//! corner to corner. A feature is therefore the part of the body within a small depth `t` of the support plane, a fixed part of the
//! overlap. Where that is a face, the section of the body at that depth represents it. It shrinks steadily from the whole face to an edge
//! while the face tilts by `t` over its width; the section of an edge shrinks to a corner in the same way.
//!
//! The centroid `c(t)` of the sections' common part deviates from that of the features in first order of `t`. `2 c(t/2) - c(t)` does
//! not. It is exact for faces that are flush, and does not jump where parallel sides take over from each other.
//!
//! Sections are convex polygons, clipped edge by edge (Sutherland and Hodgman 1974, DOI 10.1145/360767.360802). A curved body has one
//! support point and needs none of this.

use super::{Posed, PosedCore, PosedHull};
use crate::math::Vec3;

/// Depth of the sections, as a part of the overlap: faces that are flush to within that depth over their width count in part.
const DEPTH: f64 = 1e-3;
/// Least depth, as a part of the size of the smaller body: rounding of its corners.
const ROUNDING: f64 = 1e-10;
/// A polygon with less area than this part of its squared outline is a segment.
const THIN: f64 = 1e-14;
/// Segments at a smaller angle are parallel [rad].
const PARALLEL: f64 = 1e-7;

/// Part of the contact point across the normal, relative to the centre of A, in world axes [m].
///
/// `normal` points from A to B.
pub(super) fn centre_between(a: &Posed, b: &Posed, r: &Vec3, normal: &Vec3, overlap: f64) -> Vec3 {
    let (size_a, size_b) = (a.bounding_radius(), b.bounding_radius());
    let depth = depth(overlap, if size_a < size_b { size_a } else { size_b });
    let across = flat(r, normal);
    let (on_a, on_b) = (Feature::of(a, normal, depth), Feature::of(b, &-normal, depth));
    extrapolated(depth, |depth| centre(&on_a, &on_b, &across, depth, normal))
}

/// Part of the contact point across the normal for a body on a wall; `normal` points from the body to the wall.
pub(super) fn centre_on_plane(a: &Posed, normal: &Vec3, overlap: f64) -> Vec3 {
    let depth = depth(overlap, a.bounding_radius());
    let on_a = Feature::of(a, normal, depth);
    extrapolated(depth, |depth| centroid(&on_a.section(depth), normal))
}

fn depth(overlap: f64, size: f64) -> f64 {
    DEPTH * overlap + ROUNDING * size
}

/// `2 c(t/2) - c(t)`
fn extrapolated(depth: f64, centre: impl Fn(f64) -> Vec3) -> Vec3 {
    centre(0.5 * depth) * 2.0 - centre(depth)
}

/// Part of a vector across a unit vector.
fn flat(p: &Vec3, normal: &Vec3) -> Vec3 {
    p - normal * p.dot(normal)
}

/// Part of a body's core within a depth of its support plane, projected onto the plane through the body's centre.
enum Feature<'a> {
    /// The support point of a curved body.
    Round(Vec3),
    Corner(Vec3),
    /// An edge from its upper to its lower end, which is deeper by `fall` [m].
    Edge {
        top: Vec3,
        bottom: Vec3,
        fall: f64,
    },
    Face(Face<'a>),
}

/// A face, or a corner so blunt that its neighbours are as high.
struct Face<'a> {
    hull: PosedHull<'a>,
    /// Direction along which the face is the highest.
    normal: Vec3,
    /// Height above the body's centre [m].
    height: f64,
}

impl Face<'_> {
    /// Section of the polyhedron at this depth.
    fn section(&self, depth: f64) -> Vec<Vec3> {
        let Self { hull, normal, .. } = self;
        let x = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize() * hull.bounding_radius();
        let y = normal.cross(&x);
        let mut polygon = self.shared(vec![-x - y, x - y, x + y, y - x], &Vec3::zeros(), depth);
        if polygon.is_empty() {
            // Thinner than rounding.
            polygon.push(flat(&hull.support(normal), normal));
        }
        polygon
    }

    /// Part of a polygon, segment or point in the section at this depth of the body whose centre is at `centre`.
    fn shared(&self, mut polygon: Vec<Vec3>, centre: &Vec3, depth: f64) -> Vec<Vec3> {
        // Vector from a point of the flat polygon to that of the section.
        let rise = self.normal * (self.height - depth) - centre;
        let mut clipped = Vec::with_capacity(16);
        for (outward, offset) in self.hull.planes() {
            clip(&mut polygon, &outward, offset - rise.dot(&outward), &mut clipped);
        }
        polygon
    }
}

impl<'a> Feature<'a> {
    fn of(body: &Posed<'a>, normal: &Vec3, depth: f64) -> Self {
        let edge = |top: Vec3, bottom: Vec3| Self::Edge {
            top: flat(&top, normal),
            bottom: flat(&bottom, normal),
            fall: (top - bottom).dot(normal),
        };
        match body.core() {
            PosedCore::Curved => Self::Round(flat(&body.core_support(normal), normal)),
            PosedCore::Segment(end) => {
                if end.dot(normal) < 0.0 {
                    edge(-end, end)
                } else {
                    edge(end, -end)
                }
            }
            PosedCore::Hull(hull) => {
                let top = hull.top(normal, depth);
                match top[..] {
                    [k] => Self::Corner(flat(&hull.vertex(k), normal)),
                    [i, j] => edge(hull.vertex(i), hull.vertex(j)),
                    _ => {
                        let height = hull.height(top[0], normal);
                        Self::Face(Face { hull, normal: *normal, height })
                    }
                }
            }
        }
    }

    /// Section at this depth: a polygon, counter-clockwise about the normal, or the two ends of a segment, or a point.
    fn section(&self, depth: f64) -> Vec<Vec3> {
        match *self {
            Self::Round(point) | Self::Corner(point) => vec![point],
            Self::Edge { top, bottom, fall } => {
                let part = if fall > depth { depth / fall } else { 1.0 };
                vec![top, top + (bottom - top) * part]
            }
            Self::Face(ref face) => face.section(depth),
        }
    }
}

/// Keeps the part of a convex polygon with `p · outward <= offset`.
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

/// Centroid of the common part of two sections, the second displaced by `across`.
///
/// Sections share nothing if the normal is not the common one. The result is then the middle between points of them near each other.
fn centre(a: &Feature, b: &Feature, across: &Vec3, depth: f64, normal: &Vec3) -> Vec3 {
    let section_b = || -> Vec<Vec3> {
        // Counter-clockwise about the normal of A as well.
        b.section(depth).into_iter().rev().map(|p| p + across).collect()
    };
    let shared = match (a, b) {
        (_, Feature::Face(face)) => face.shared(a.section(depth), across, depth),
        (Feature::Face(face), _) => face.shared(section_b(), &Vec3::zeros(), depth),
        _ => {
            let ends = |section: &[Vec3]| [section[0], section[section.len() - 1]];
            let (p, q) = nearest_of_segments(&ends(&a.section(depth)), &ends(&section_b()));
            // Where a curved body is nearly flat, its support point moves far with the last digits of the normal. The point of a corner or
            // an edge does not.
            return match (a, b) {
                (Feature::Round(_), Feature::Edge { .. } | Feature::Corner(_)) => q,
                (Feature::Edge { .. } | Feature::Corner(_), Feature::Round(_)) => p,
                _ => (p + q) * 0.5,
            };
        }
    };
    if shared.is_empty() {
        let (a, b) = (a.section(depth), section_b());
        let on_a = nearest(&a, &centroid(&b, normal), normal);
        let on_b = nearest(&b, &on_a, normal);
        return (on_a + on_b) * 0.5;
    }
    centroid(&shared, normal)
}

/// Centroid of a polygon's area, or of its outline if the area is zero.
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

/// Nearest points of two segments (Ericson 2005, *Real-Time Collision Detection*, section 5.1.9).
///
/// For parallel segments, the middle of the part where they face each other.
pub(super) fn nearest_of_segments(a: &[Vec3; 2], b: &[Vec3; 2]) -> (Vec3, Vec3) {
    let (u, v, w) = (a[1] - a[0], b[1] - b[0], a[0] - b[0]);
    let (uu, vv, uv) = (u.norm_squared(), v.norm_squared(), u.dot(&v));
    let (uw, vw) = (u.dot(&w), v.dot(&w));
    let crossed = uu * vv - uv * uv;
    // The fraction of A's length nearest to a fraction of B's, and the reverse.
    let on_a = |t: f64| if uu > 0.0 { ((t * uv - uw) / uu).clamp(0.0, 1.0) } else { 0.0 };
    let on_b = |s: f64| if vv > 0.0 { ((s * uv + vw) / vv).clamp(0.0, 1.0) } else { 0.0 };
    let s = if crossed > PARALLEL * PARALLEL * (uu * vv) {
        ((uv * vw - uw * vv) / crossed).clamp(0.0, 1.0)
    } else {
        // Middle of the part of A that faces B, or A's nearest end.
        0.5 * (on_a(0.0) + on_a(1.0))
    };
    let t = on_b(s);
    (a[0] + u * on_a(t), b[0] + v * t)
}
