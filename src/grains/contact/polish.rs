//! Refinement of a contact between a superellipsoid and any other body to the last digits.
//!
//! Where a superellipsoid is nearly flat, its support point moves far with the last digits of the normal. A normal that is accurate
//! enough for the overlap does not determine the contact point. Newton's method, started from the normal of another method, does. A body
//! with edges has no curvature; the corner or edge that touches replaces it: a point, or an arc that is as good as straight.

use super::smooth_common_normal::touch_beside;
use super::{Posed, PosedCore, Touch};
use crate::math::{Mat3, Vec3};
use crate::shape::{Convex, CurvedSupport, Kind, Shape};
use std::sync::Arc;

/// Radius of the arc that replaces an edge, over the size of its body: the normal is tilted by the inverse.
const STRAIGHT: f64 = 1e10;
/// A vertex counts as higher than another if it is so by this part of the body's size; less may be rounding.
const HIGHER: f64 = 1e-12;
/// Vertices at most this far below the highest one, over the body's size, belong to one face.
const FLUSH: f64 = 1e-7;
/// Largest difference between the overlap of corner or edge and that of the bodies, over their size.
const SAME: f64 = 1e-8;
/// Largest number of corners and edges tried.
const FEATURES: u32 = 5;

/// The contact with normal and point refined to rounding, where possible.
pub(super) fn polished(a: &Posed, b: &Posed, r: &Vec3, touch: Touch) -> Touch {
    let can_be_flat =
        |body: &Posed| matches!(body.shape.kind(), Kind::Superellipsoid | Kind::PolySuperellipsoid);
    // Pairs that are apart, or whose overlap is NaN, are not refined.
    let found = if touch.overlap > 0.0 && (can_be_flat(a) || can_be_flat(b)) {
        match (a.is_curved(), b.is_curved()) {
            (true, true) => {
                touch_beside(a, b, r, &touch.normal).filter(|t| t.overlap <= touch.overlap)
            }
            (true, false) => on_feature(a, b, r, &touch),
            (false, true) => {
                let back = |t: Touch| Touch { normal: -t.normal, point: t.point + r, ..t };
                let swapped = Touch { normal: -touch.normal, ..touch };
                on_feature(b, a, &-r, &swapped).map(back)
            }
            (false, false) => None,
        }
    } else {
        None
    };
    // Newton's method may end on another side of a body, where the overlap is larger.
    found
        .filter(|t| {
            t.overlap <= touch.overlap + SAME * a.bounding_radius().min(b.bounding_radius())
        })
        .unwrap_or(touch)
}

/// Refines a contact of a smooth body and one with edges. Returns `None` where a face touches.
///
/// Goes from corner to edge to corner until the highest point of the feature is the one that touches.
fn on_feature(smooth: &Posed, sharp: &Posed, r: &Vec3, touch: &Touch) -> Option<Touch> {
    let size = sharp.bounding_radius();
    let mut feature = Feature::first(sharp, &-touch.normal, size)?;
    let mut normal = touch.normal;
    for _ in 0..FEATURES {
        let stand_in = Shape::Other(Arc::new(feature));
        let frame = Mat3::identity();
        let found = touch_beside(smooth, &Posed::new(&stand_in, &frame), r, &normal)?;
        normal = found.normal;
        let Some(next) = feature.next(sharp, &(found.point - r), &-normal, size) else {
            let overlap = (smooth.support(&normal) - sharp.support(&-normal) - r).dot(&normal);
            let same = (overlap - found.overlap).abs() <= SAME * size;
            return same.then_some(Touch { overlap, ..found });
        };
        feature = next;
    }
    None
}

/// A corner or an edge of a body, with the sphere rolled around it, in world axes about the body's centre.
#[derive(Clone, Copy, Debug)]
struct Feature {
    /// The corner, or the middle of the edge [m].
    middle: Vec3,
    /// Unit vector along the edge.
    along: Vec3,
    /// Half the length of the edge; 0 for a corner [m].
    half: f64,
    margin: f64,
    /// Bounding radius of the body [m].
    size: f64,
}

impl Feature {
    fn corner(sharp: &Posed, corner: Vec3, size: f64) -> Self {
        let margin = sharp.margin();
        Self { middle: corner, along: Vec3::x(), half: 0.0, margin, size }
    }

    fn edge(sharp: &Posed, [p, q]: [Vec3; 2], size: f64) -> Self {
        let (middle, half) = ((p + q) * 0.5, (q - p) * 0.5);
        let length = half.norm();
        Self { middle, along: half / length, half: length, margin: sharp.margin(), size }
    }

    /// The feature farthest along a unit vector; `None` for a face.
    fn first(sharp: &Posed, outward: &Vec3, size: f64) -> Option<Self> {
        match sharp.core() {
            PosedCore::Curved => None,
            PosedCore::Segment(end) => Some(Self::edge(sharp, [-end, end], size)),
            PosedCore::Hull(hull) => match hull.top(outward, FLUSH * size)[..] {
                [k] => Some(Self::corner(sharp, hull.vertex(k), size)),
                [i, j] => Some(Self::edge(sharp, [hull.vertex(i), hull.vertex(j)], size)),
                _ => None,
            },
        }
    }

    /// The feature that touches instead, if it is not this one.
    fn next(&self, sharp: &Posed, point: &Vec3, outward: &Vec3, size: f64) -> Option<Self> {
        if self.half > 0.0 {
            let at = (point - self.middle).dot(&self.along);
            let end = self.middle + self.along * self.half.copysign(at);
            return (at.abs() > self.half).then(|| Self::corner(sharp, end, size));
        }
        let PosedCore::Hull(hull) = sharp.core() else { return None };
        let highest = hull.support(outward);
        let rise = (highest - self.middle).dot(outward);
        (rise > HIGHER * size).then(|| Self::edge(sharp, [self.middle, highest], size))
    }
}

/// Only the functions that Newton's method needs.
impl Convex for Feature {
    fn support(&self, direction: &Vec3) -> Vec3 {
        let end = self.half.copysign(self.along.dot(direction));
        self.middle + self.along * end + direction.normalize() * self.margin
    }

    /// The support function of an arc is `c·n + R (u·n)² / 2`, to the second order of the tilt `u·n`.
    fn curved_support(&self, n: &Vec3) -> Option<CurvedSupport> {
        let radius = if self.half > 0.0 { STRAIGHT * self.size } else { 0.0 };
        let tilt = self.along.dot(n);
        let moved = radius * tilt;
        let flat = self.along - n * tilt;
        let point = self.middle + n * self.margin + flat * moved + n * (0.5 * (moved * tilt));
        let u = flat.try_normalize(1e-6)?;
        Some(CurvedSupport {
            point,
            weight: [self.margin + radius * flat.norm_squared(), self.margin]
                .map(|h| h / self.size / self.size),
            along: [u * self.size, n.cross(&u) * self.size],
        })
    }

    fn bounding_radius(&self) -> f64 {
        self.size
    }

    fn inscribed_radius(&self) -> f64 {
        self.margin
    }

    fn volume(&self) -> f64 {
        0.0
    }

    fn gyration(&self) -> Vec3 {
        Vec3::zeros()
    }

    fn contains(&self, _: &Vec3) -> bool {
        false
    }
}
