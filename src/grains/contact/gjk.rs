//! Distance of two convex bodies by GJK, from their support points alone.
//!
//! Gilbert, Johnson and Keerthi (1988), DOI 10.1109/56.2083, with the signed-volumes sub-distance of Montanari, Petrinic and Barbieri
//! (2017), DOI 10.1145/3083724. Corners are kept by the signs of volumes, which stay correct for the flat simplices at the end of the
//! iteration. The method needs only support points. It converges linearly for round bodies; where curvature is known, the common-normal
//! method is faster and far more accurate.
//!
//! For round bodies a secant through the last support points gives the next one faster ([`secant`]). The bounds that end the iteration
//! hold for any direction, so secants cannot cause a wrong answer.
//!
//! The answer is one of three that must not be confused: apart, intersecting, or not known.

use super::{Posed, count_direction, unit_of_length};
use crate::math::{Mat3, Vec3};
use crate::shape::Shape;

/// Rounding of a difference of support points, in units of the pair's length.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// Iteration limit: ellipsoids take 10 to 25 supports.
const ITERATIONS: u32 = 200;

/// Relative duality gap below which a stalled iteration is accepted.
///
/// The direction is then accurate to 1e-5, far better than the error of erosion itself.
const STALLED: f64 = 1e-10;

/// Distance below which a stalled iteration reports the bodies as intersecting [units].
///
/// The caller then continues: erosion with smaller bodies, EPA with its own bounds.
const KISSING: f64 = 1e-8;

/// Part of the last gap between the bounds below which a secant must bring it.
const WORTHWHILE: f64 = 0.25;

/// Source of a body's support points.
#[derive(Clone, Copy)]
enum Support<'a> {
    /// An ellipsoid, `M Mᵀ n / |Mᵀ n|`: the columns of `M` are its semi-axes in the world [m].
    Ellipsoid(Mat3),
    Body(&'a Posed<'a>),
    /// The body without its margin.
    Core(&'a Posed<'a>),
}

impl<'a> Support<'a> {
    fn of(body: &'a Posed<'a>) -> Self {
        match body.shape {
            Shape::Ellipsoid(e) => {
                let mut axes = *body.frame;
                for (mut axis, length) in axes.column_iter_mut().zip(&e.semi_axes) {
                    axis *= *length * body.scale;
                }
                Self::Ellipsoid(axes)
            }
            _ => Self::Body(body),
        }
    }

    #[inline]
    fn along(&self, direction: &Vec3) -> Vec3 {
        match self {
            Self::Ellipsoid(axes) => {
                let scaled = axes.tr_mul(direction);
                axes * (scaled / scaled.norm())
            }
            Self::Body(body) => body.support(direction),
            Self::Core(body) => body.core_support(direction),
        }
    }
}

/// The Minkowski difference A − B of two bodies in place, in units of the pair's length.
///
/// The bodies intersect if it contains the origin. Otherwise their distance is that of the difference from the origin.
#[derive(Clone, Copy)]
pub(super) struct Difference<'a> {
    bodies: [&'a Posed<'a>; 2],
    supports: [Support<'a>; 2],
    /// Vector from the centre of A to the centre of B.
    pub(super) r: Vec3,
    /// Sum of the bounding radii.
    pub(super) reach: f64,
    /// The unit of length [m].
    pub(super) unit: f64,
    /// Factor by which both bodies are scaled about their centres.
    scale: f64,
    /// Whether neither body has edges or faces, where support points jump.
    pub(super) is_smooth: bool,
}

impl<'a> Difference<'a> {
    /// The difference of two bodies with `r` [m] from the centre of A to the centre of B.
    pub(super) fn new(a: &'a Posed<'a>, b: &'a Posed<'a>, r: &Vec3) -> Self {
        let (radius_a, radius_b) = (a.bounding_radius(), b.bounding_radius());
        let unit = unit_of_length(radius_a, radius_b);
        let per_metre = 1.0 / unit;
        let reach = (radius_a + radius_b) * per_metre;
        let (bodies, supports) = ([a, b], [Support::of(a), Support::of(b)]);
        let is_smooth = bodies.iter().all(|body| body.is_curved());
        Self { bodies, supports, r: r * per_metre, reach, unit, scale: per_metre, is_smooth }
    }

    /// Copy with both bodies scaled about their centres by `1 - ratio`.
    pub(super) fn eroded(&self, ratio: f64) -> Self {
        Self { scale: (1.0 - ratio) / self.unit, ..*self }
    }

    /// Copy with both bodies without their margins.
    pub(super) fn cores(&self) -> Self {
        Self { supports: self.bodies.map(Support::Core), ..*self }
    }

    /// Farthest point along `direction` (of any length but zero).
    #[inline]
    pub(super) fn support(&self, direction: &Vec3) -> Vec3 {
        let [a, b] = &self.supports;
        (a.along(direction) - b.along(&-direction)) * self.scale - self.r
    }

    /// Whether a point [m], relative to the centre of A, is in both unscaled bodies.
    pub(super) fn holds(&self, point: &Vec3) -> bool {
        let [a, b] = self.bodies;
        a.contains(point) && b.contains(&(point - self.r * self.unit))
    }

    #[inline]
    pub(super) fn corner(&self, direction: Vec3) -> Corner {
        count_direction();
        Corner { point: self.support(&direction), direction }
    }
}

/// A support point of the difference, and a direction along which it is the farthest.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    pub(super) point: Vec3,
    pub(super) direction: Vec3,
}

/// Direction by the secant method, in the two dimensions of directions near the unit vector `near`.
///
/// At the extremum of overlap or distance, the support point `s(n)` lies on the line of `n`. The secant assumes that support points
/// depend linearly on directions. On smooth bodies each use adds the correct digits of the last two (Wolfe 1959,
/// DOI 10.1145/368518.368542). The result is `None` if the directions of the corners, or the result, are far from `near`.
pub(super) fn secant(corners: &[Corner; 3], near: &Vec3) -> Option<Vec3> {
    // Directions of height 1 above the plane across `near`, and the deviations of their support points from these lines in that plane.
    let mut lacking = [Vec3::zeros(); 3];
    let mut directions = [Vec3::zeros(); 3];
    for (k, corner) in corners.iter().enumerate() {
        let height = corner.direction.dot(near);
        if height * height < 0.5 * corner.direction.norm_squared() || height < 0.0 {
            return None;
        }
        directions[k] = corner.direction / height;
        lacking[k] = corner.point - directions[k] * corner.point.dot(near);
    }
    let [p, q, s] = lacking;
    let parts = [q.cross(&s), s.cross(&p), p.cross(&q)].map(|across| across.dot(near));
    let whole = (parts[0] + parts[1]) + parts[2];
    let [p, q, s] = directions;
    let sum = (p * parts[0] + q * parts[1]) + s * parts[2];
    let direction = sum / whole;
    // With height 1, at most 45° away. For a triangle without area this is NaN, and the result `None`.
    (direction.norm_squared() < 2.0).then_some(direction)
}

/// Result of GJK.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Separation {
    /// Apart, with the unit vector from A to B along the shortest distance.
    Apart(Vec3),
    /// Farther apart than the given limit, with a lower bound of the distance [units].
    Beyond(f64),
    /// The bodies share a point, or come so close that rounding decides.
    Intersecting,
    /// The iteration stalled or reached its limit: nothing is known.
    NotConverged,
}

/// Separation of two bodies.
///
/// `start` is a guess of the direction from A to B, of any length but zero. The iteration ends when the distance is known to the relative
/// `tolerance` (no finer than rounding), or is certainly more than `beyond` [units].
pub(super) fn separate(m: &Difference, start: &Vec3, tolerance: f64, beyond: f64) -> Separation {
    enclose(m, start, tolerance, beyond).0
}

/// `separate` with the last simplex: if that has four corners, it contains the origin.
pub(super) fn enclose(
    m: &Difference,
    start: &Vec3,
    tolerance: f64,
    beyond: f64,
) -> (Separation, Simplex) {
    let first = m.corner(*start);
    let mut simplex = Simplex { corners: [first; 4], count: 1 };
    let mut answer = simplex.search(m, tolerance, beyond, m.is_smooth);
    if answer == Separation::NotConverged && m.is_smooth {
        // Secants may have led to corners so close to each other that they determine nothing.
        simplex = Simplex { corners: [first; 4], count: 1 };
        answer = simplex.search(m, tolerance, beyond, false);
    }
    (answer, simplex)
}

/// One to four corners around the point of the difference nearest to the origin; the newest is last.
pub(super) struct Simplex {
    corners: [Corner; 4],
    count: usize,
}

/// The point of a simplex nearest to the origin.
struct Nearest {
    point: Vec3,
    squared: f64,
    /// Barycentric coordinates; zero for corners that are not needed.
    weights: [f64; 4],
}

impl Nearest {
    /// No point yet.
    fn nowhere() -> Self {
        Self { point: Vec3::repeat(f64::INFINITY), squared: f64::INFINITY, weights: [0.0; 4] }
    }

    #[inline]
    fn improve(&mut self, other: Self) {
        if other.squared < self.squared {
            *self = other;
        }
    }
}

impl Simplex {
    /// The corners, if there are four.
    pub(super) fn tetrahedron(&self) -> Option<&[Corner; 4]> {
        (self.count == 4).then_some(&self.corners)
    }

    /// Searches from one corner, with or without secants.
    fn search(&mut self, m: &Difference, tolerance: f64, beyond: f64, secants: bool) -> Separation {
        // A bound within rounding of the limit is inconclusive.
        let certain = beyond + ROUNDING;
        let Corner { point: first, direction: start } = self.corners[0];
        let along = -start.dot(&first);
        if along > 0.0 && along * along > (certain * certain) * start.norm_squared() {
            return Separation::Beyond(along / start.norm());
        }
        // The point of the simplex nearest to the origin.
        let mut nearest = first;
        let mut squared = nearest.norm_squared();
        if !squared.is_finite() {
            return Separation::NotConverged;
        }
        let (mut guess, mut last_gap) = (None, f64::INFINITY);
        for _ in 0..ITERATIONS {
            if squared <= ROUNDING * ROUNDING {
                return Separation::Intersecting;
            }
            let guessed = guess.is_some();
            let direction = guess.take().unwrap_or(-nearest);
            let corner = m.corner(direction);
            // The plane through the corner across the direction bounds the distance from below.
            let (along, length) = (-direction.dot(&corner.point), direction.norm_squared());
            if along > 0.0 && along * along > (certain * certain) * length {
                return Separation::Beyond(along / length.sqrt());
            }
            let (distance, length) = (squared.sqrt(), length.sqrt());
            let gap = distance * (distance - along / length);
            if gap <= tolerance * squared + ROUNDING * distance {
                return Separation::Apart(direction / length);
            }
            // A secant with little progress is not followed by another.
            let has_paid = !guessed || gap < WORTHWHILE * last_gap;
            last_gap = gap;
            if guessed && nearest.dot(&corner.point) >= squared {
                // Not beyond the simplex: the standard direction of GJK is next.
                continue;
            }
            let before = (self.corners, self.count);
            self.corners[self.count] = corner;
            self.count += 1;
            let Some(next) = self.reduce() else { return Separation::Intersecting };
            let shorter = next.norm_squared();
            if shorter < squared {
                (nearest, squared) = (next, shorter);
                if let ([p, q, s], true) = (&self.corners[..self.count], secants && has_paid) {
                    guess = secant(&[*p, *q, *s], &(nearest / -squared.sqrt()));
                }
            } else if guessed {
                // Below the resolution of the simplex: the standard direction may still make progress.
                (self.corners, self.count) = before;
            } else if gap <= STALLED * squared {
                // No progress below the resolution of the simplex, but the bounds are close.
                return Separation::Apart(nearest / -distance);
            } else if distance <= KISSING {
                return Separation::Intersecting;
            } else {
                return Separation::NotConverged;
            }
        }
        Separation::NotConverged
    }

    /// Drops the corners that the point nearest to the origin does not need, and returns the point; `None` if the origin is inside.
    fn reduce(&mut self) -> Option<Vec3> {
        let nearest = match self.count {
            2 => self.on_segment(0, 1),
            3 => self.on_triangle(0, 1, 2),
            _ => self.in_tetrahedron()?,
        };
        let mut kept = 0;
        for i in 0..self.count {
            if nearest.weights[i] > 0.0 {
                self.corners[kept] = self.corners[i];
                kept += 1;
            }
        }
        self.count = kept;
        Some(nearest.point)
    }

    #[inline]
    fn on_segment(&self, i: usize, j: usize) -> Nearest {
        let p = self.corners[i].point;
        let edge = self.corners[j].point - p;
        let (along, length) = (-p.dot(&edge), edge.norm_squared());
        let mut weights = [0.0; 4];
        let point = if along <= 0.0 || length == 0.0 {
            weights[i] = 1.0;
            p
        } else if along >= length {
            weights[j] = 1.0;
            self.corners[j].point
        } else {
            weights[j] = along / length;
            weights[i] = 1.0 - weights[j];
            p + edge * weights[j]
        };
        Nearest { point, squared: point.norm_squared(), weights }
    }

    /// Point of a triangle nearest to the origin, by the signed areas that the foot of the origin makes with the edges.
    ///
    /// Each area is multiplied by that of the triangle. These triple products do not need the foot.
    fn on_triangle(&self, i: usize, j: usize, k: usize) -> Nearest {
        let [p, q, s] = [i, j, k].map(|corner| self.corners[corner].point);
        let (pq, qs) = (q - p, s - q);
        let normal = pq.cross(&qs);
        let parts =
            [normal.dot(&q.cross(&qs)), normal.dot(&s.cross(&(p - s))), normal.dot(&p.cross(&pq))];
        if parts[0] > 0.0 && parts[1] > 0.0 && parts[2] > 0.0 {
            let inverse = 1.0 / ((parts[0] + parts[1]) + parts[2]);
            let mut weights = [0.0; 4];
            (weights[i], weights[j], weights[k]) =
                (parts[0] * inverse, parts[1] * inverse, parts[2] * inverse);
            let point = (p * weights[i] + q * weights[j]) + s * weights[k];
            return Nearest { point, squared: point.norm_squared(), weights };
        }
        let mut best = Nearest::nowhere();
        for (part, i, j) in [(parts[0], j, k), (parts[1], k, i), (parts[2], i, j)] {
            if part <= 0.0 {
                best.improve(self.on_segment(i, j));
            }
        }
        best
    }

    /// Point of the tetrahedron nearest to the origin; `None` if the origin is inside.
    ///
    /// The origin is inside if the signed volume with each corner moved to the origin has the sign of the whole.
    #[inline]
    fn in_tetrahedron(&self) -> Option<Nearest> {
        let [p, q, s, t] = self.corners.map(|corner| corner.point);
        let (pq, st) = (p.cross(&q), s.cross(&t));
        let parts = [q.dot(&st), -p.dot(&st), pq.dot(&t), -pq.dot(&s)];
        // From edges: for a small tetrahedron far away, the sum of the parts would be rounding only.
        let whole = (q - p).dot(&(s - p).cross(&(t - p)));
        let same_side =
            |part: f64| if whole > 0.0 { part > 0.0 } else { part < 0.0 && whole < 0.0 };
        if parts.into_iter().all(same_side) {
            return None;
        }
        let mut best = Nearest::nowhere();
        // The face opposite the newest corner needs no check: it was the simplex before.
        for (part, i, j) in [(parts[0], 1, 2), (parts[1], 0, 2), (parts[2], 0, 1)] {
            if !same_side(part) {
                best.improve(self.on_triangle(i, j, 3));
            }
        }
        Some(best)
    }
}

#[cfg(test)]
mod tests {
    use super::{Difference, Separation, separate};
    use crate::contact::Posed;
    use crate::math::{Mat3, Vec3};
    use crate::shape::{Ellipsoid, Shape, Sphere};

    fn sphere(radius: f64) -> Shape {
        Shape::Sphere(Sphere { radius })
    }

    fn between(a: &Shape, b: &Shape, r: Vec3, beyond: f64) -> Separation {
        let frame = Mat3::identity();
        let (a, b) = (Posed::new(a, &frame), Posed::new(b, &frame));
        separate(&Difference::new(&a, &b, &r), &Vec3::new(0.3, -0.2, 0.9), 1e-12, beyond)
    }

    #[test]
    fn spheres_apart() {
        let r = Vec3::new(1.0, -2.0, 2.0);
        let Separation::Apart(n) = between(&sphere(1.0), &sphere(1.5), r, f64::INFINITY) else {
            panic!("a clearance of 0.5 was not seen")
        };
        // The error of the direction is the square root of the tolerance.
        assert!((n - r / 3.0).norm() < 2e-6, "{n}");
    }

    #[test]
    fn asked_only_for_less_than_the_clearance() {
        let r = Vec3::new(1.0, -2.0, 2.0);
        let Separation::Beyond(distance) = between(&sphere(1.0), &sphere(1.5), r, 0.49) else {
            panic!("0.5 is more than 0.49")
        };
        assert!((0.49..=0.5 + 1e-15).contains(&distance), "{distance}");
    }

    #[test]
    fn spheres_intersecting() {
        for r in [Vec3::new(1.0, -2.0, 2.0) * 0.8, Vec3::new(1e-9, 0.0, 0.0), Vec3::zeros()] {
            assert_eq!(
                between(&sphere(1.0), &sphere(1.5), r, 0.0),
                Separation::Intersecting,
                "{r}"
            );
        }
    }

    #[test]
    fn aligned_bodies_touching_exactly() {
        // Every simplex of this pair lies in a plane of symmetry.
        let e = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(1.0, 0.5, 0.25) });
        let answer = between(&e, &e, Vec3::new(2.0, 0.0, 0.0), 0.0);
        assert!(matches!(answer, Separation::Intersecting | Separation::Apart(_)), "{answer:?}");
    }

    #[test]
    fn not_a_number_is_not_an_answer() {
        let r = Vec3::new(f64::NAN, 0.0, 0.0);
        assert_eq!(between(&sphere(1.0), &sphere(1.0), r, 0.0), Separation::NotConverged);
    }
}
