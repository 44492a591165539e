//! A smooth body against a facet of a triangle mesh: a face, an edge or a corner ([`crate::shape::triangle_mesh`]).
//!
//! `h` is the support function of the body about its centre, and `c` points from a point of the facet to that centre. The bound of the
//! overlap along a direction `n` out of the surface is `δ(n) = h(-n) - n·c`.
//!
//! | facet | directions | overlap |
//! |---|---|---|
//! | face | its normal, on the side of the centre | `δ`, as for a plane, if the deepest point of the body is over the face and has passed through it |
//! | edge | those between the normals of its faces | least `δ`, if it lies between both normals and on the edge: roots of `dδ/dn` in one angle |
//! | strip of a cylinder or a cone | its normals | from inside each local maximum of `δ` (a long body has two), from outside the least `δ`; its foot must be between the ends and in the body |
//! | rim at the end of such a surface | from one normal of it over the outward direction to the other | least `δ` of the tangent taken as an edge, where it is at the point of the rim |
//! | edge, in a fold | from the normal of one of its faces to the plane of the other | least `δ`, for the face that the body has left |
//! | corner | at right angles or more to its edges | least `δ`, as for a sphere of radius zero |
//!
//! Directions are on the side of the surface where the centre of the body is. Otherwise a long body in a shallow fold would be pushed
//! through it.
//!
//! A contact that leaves one facet at its border continues at another with the same normal, so forces on convex surfaces are continuous.
//! Each contact at edges and corners is found once. Regions extend by [`BORDER`] over their borders, so that none is lost by rounding.
//! Duplicates from that are merged when contacts are sorted.
//! found twice is merged when contacts are put in order.

use super::gjk::{Difference, Separation, separate};
use super::{
    Chain, ContactResolver, Epa, Outcome, Posed, SmoothCommonNormal, Touch, Why, touch_of_sphere,
};
use crate::math::{Mat3, Vec3};
use crate::shape::triangle_mesh::{MeshFacet, Rim, Strip, Tangent, TriangleMesh, is_over};
use crate::shape::{Shape, Sphere, Spherocylinder};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Extent of the region of a facet beyond its border, over the radius of the body.
const BORDER: f64 = 1e-9;
/// Largest part in which the directions of an edge are searched [rad].
const PART: f64 = 0.25 * PI;
/// Accuracy of the angle about an edge [rad].
const ANGLE: f64 = 1e-15;
/// Relative duality gap where only the separation of bodies is needed.
const APART: f64 = 1e-6;
/// Radius of the sphere that replaces a point, over the size of the particle.
const POINT: f64 = 1e-9;

/// Resolver of any smooth shape (A) against a facet of a mesh (B).
///
/// The relative position points from the centre of A to the reference point of the wall.
pub struct AgainstTriangleMesh {
    /// Resolver against a point.
    points: Chain,
}

impl Default for AgainstTriangleMesh {
    fn default() -> Self {
        let fallbacks: Vec<Box<dyn ContactResolver>> =
            vec![Box::new(Epa::new(1e-10)), Box::new(Epa::default())];
        Self { points: Chain::new(Box::new(SmoothCommonNormal), fallbacks) }
    }
}

impl ContactResolver for AgainstTriangleMesh {
    fn name(&self) -> &'static str {
        "triangle-mesh"
    }

    /// # Panics
    /// If B is not a triangle mesh, that is, if the table of resolvers is wrong.
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        let Shape::TriangleMesh(mesh) = b.shape else {
            unreachable!("a facet is the second body of its pairs")
        };
        // In the axes of the wall, in which the facets are fixed.
        let frame = b.frame.tr_mul(a.frame);
        let body = Body {
            a: Posed { frame: &frame, ..*a },
            radius: if let Shape::Sphere(Sphere { radius }) = a.shape {
                radius * a.scale
            } else {
                0.0
            },
            centre: -b.frame.tr_mul(r),
            border: BORDER * a.bounding_radius(),
        };
        let outcome = match mesh.facet(b.facet) {
            MeshFacet::Face { normal, offset } => body.on_face(mesh, b.facet, &normal, offset),
            edge @ MeshFacet::Edge { .. } => body.on_edge(mesh, &edge),
            MeshFacet::Strip(strip) => body.on_strip(&strip),
            MeshFacet::Rim(rim) => body.on_rim(&rim),
            MeshFacet::Corner { at } => {
                let warm = warm.map(|normal| b.frame.tr_mul(normal));
                body.on_corner(&at, mesh.edges_at(b.facet), &self.points, warm.as_ref())
            }
        };
        match outcome {
            Outcome::Touching(Touch { overlap, normal, point }) => Outcome::Touching(Touch {
                overlap,
                normal: b.frame * normal,
                point: b.frame * point,
            }),
            Outcome::Apart(_) if mesh.has_images() => ELSEWHERE,
            outcome => outcome,
        }
    }
}

/// A body in the axes of the wall.
struct Body<'a> {
    a: Posed<'a>,
    /// Radius of a sphere; 0 for other shapes [m].
    radius: f64,
    /// Centre [m].
    centre: Vec3,
    /// Extent of regions beyond their borders [m].
    border: f64,
}

/// Ranges of directions in which the two faces of an edge act beyond it, in its fold; `None` if the faces count as one.
///
/// Each range goes from the normal of one face to the plane of the other. It is given as for the outside of an edge: a direction, one a
/// quarter turn on, and an angle [rad].
fn folds(
    mesh: &TriangleMesh,
    (first, quarter, opening): &(Vec3, Vec3, f64),
) -> Option<[(Vec3, Vec3, f64); 2]> {
    let in_fold = FRAC_PI_2 - opening;
    let (sine, cosine) = libm::sincos(*opening);
    let (last, next) = (first * cosine + quarter * sine, quarter * cosine - first * sine);
    (in_fold > 0.0 && mesh.is_fold(cosine))
        .then_some([(-first, *quarter, in_fold), (-last, -next, in_fold)])
}

/// A body that overlaps a line.
struct OnLine {
    /// Overlap [m].
    overlap: f64,
    /// Direction out of the line.
    out: Vec3,
    /// Deepest point, relative to the centre [m].
    deepest: Vec3,
}

/// Another facet has the contact; the pair is examined again at the next step.
const ELSEWHERE: Outcome = Outcome::Apart(0.0);

impl Body<'_> {
    /// Apart if a point is farther away than the bounding radius.
    fn apart_from(&self, nearest: &Vec3) -> Option<Outcome> {
        let clearance = (self.centre - nearest).norm() - self.a.bounding_radius();
        (clearance > 0.0).then_some(Outcome::Apart(clearance))
    }

    fn on_face(&self, mesh: &TriangleMesh, face: u32, normal: &Vec3, offset: f64) -> Outcome {
        let height = self.centre.dot(normal) - offset;
        let (into, height) = if height < 0.0 { (*normal, -height) } else { (-normal, height) };
        let deepest = self.a.support(&into);
        let overlap = deepest.dot(&into) - height;
        let point = deepest - into * (0.5 * overlap);
        let touch = Touch { overlap, normal: into, point }.outcome();
        if let Outcome::Touching(_) = touch {
            let foot = self.centre + deepest - into * overlap;
            if !mesh.is_on_face(face, &foot, self.border) {
                return ELSEWHERE;
            }
            if self.radius == 0.0 {
                // Beside the rim of a sheet, a long body may reach the plane where no face is.
                let crossing = self.centre + deepest * (height / (height + overlap));
                let is_through = self.a.contains(&(foot - self.centre))
                    || mesh.is_on_face(face, &crossing, self.border);
                if !is_through || !self.comes_through(mesh, face, &foot, &deepest) {
                    return ELSEWHERE;
                }
            }
        }
        touch
    }

    /// Whether a body has passed through a face, with its deepest point over the foot on it.
    fn comes_through(&self, mesh: &TriangleMesh, face: u32, foot: &Vec3, deepest: &Vec3) -> bool {
        // The end of a body over an edge can reach the back of the face beyond it.
        if mesh.between(Some(face), &self.centre, foot, self.border).is_some() {
            return false;
        }
        // The end of a body beside a sharp edge is over the other face, outside of the wall.
        let end = self.centre + deepest;
        let is_beside = |behind: Vec3| {
            !self.a.contains(&(behind - self.centre))
                && mesh.between(None, &self.centre, &end, 0.0).is_none()
        };
        !mesh.between(Some(face), &end, foot, self.border).is_some_and(is_beside)
    }

    fn on_edge(&self, mesh: &TriangleMesh, edge: &MeshFacet) -> Outcome {
        let MeshFacet::Edge { from, along, length, first, quarter, opening } = edge else {
            unreachable!("an edge is an edge")
        };
        let way = self.centre - from;
        let place = way.dot(along).clamp(0.0, *length);
        if let Some(apart) = self.apart_from(&(from + along * place)) {
            return apart;
        }
        let is_on = |place: f64| (-self.border..=length + self.border).contains(&place);
        let outside = (*first, *quarter, *opening);
        if self.radius > 0.0 {
            let place = way.dot(along);
            let out = way - along * place;
            let is_in = |(first, quarter, opening): &(Vec3, Vec3, f64)| {
                let angle = libm::atan2(out.dot(quarter), out.dot(first));
                (-BORDER..=opening + BORDER).contains(&angle)
            };
            let is_felt = || is_in(&outside) || folds(mesh, &outside).iter().flatten().any(is_in);
            return if is_on(place) && is_felt() { self.sphere_at(&out) } else { ELSEWHERE };
        }
        let seen = |(first, quarter, opening): &(Vec3, Vec3, f64)| {
            self.on_line(&way, [first, quarter], *opening)
        };
        let found =
            seen(&outside).or_else(|| folds(mesh, &outside).iter().flatten().find_map(seen));
        let Some(found) = found else { return ELSEWHERE };
        if found.overlap > 0.0 && !is_on((found.deepest + way).dot(along)) {
            return ELSEWHERE;
        }
        self.where_it_reaches(&found, |body| body.reaches(from, along, *length, first))
    }

    /// Least overlap along the directions in which a line faces: from the first by the angle `opening` towards a quarter turn on.
    ///
    /// `way` points from the line to the centre.
    fn on_line(&self, way: &Vec3, [first, quarter]: [&Vec3; 2], opening: f64) -> Option<OnLine> {
        let direction = |angle: f64| {
            let (sine, cosine) = libm::sincos(angle);
            (first * cosine + quarter * sine, quarter * cosine - first * sine)
        };
        // Position of the deepest point along a direction beyond the edge, towards larger angles: -dδ/dθ.
        let beyond = |angle: f64| {
            let (out, on) = direction(angle);
            (self.a.support(&-out) + way).dot(&on)
        };
        // δ may have several minima, as for a flat body that contains the edge: one of them on each side.
        let parts = (opening / PART).ceil().max(1.0);
        let mut from = (0.0, beyond(0.0));
        let mut found: Option<OnLine> = None;
        for part in 1..=parts as u32 {
            let angle = opening * (f64::from(part) / parts);
            let to = (angle, beyond(angle));
            let leeway = |is_border: bool| if is_border { self.border } else { 0.0 };
            if from.1 >= -leeway(part == 1) && to.1 <= leeway(angle >= opening) {
                let (out, _) = direction(root(beyond, from, to));
                let deepest = self.a.support(&-out);
                let overlap = -(deepest + way).dot(&out);
                if out.dot(way) > 0.0 && found.as_ref().is_none_or(|least| overlap < least.overlap)
                {
                    found = Some(OnLine { overlap, out, deepest });
                }
            }
            from = to;
        }
        found
    }

    /// A body beside an edge may be deep along a direction in which the edge faces without reaching it.
    fn where_it_reaches(&self, found: &OnLine, reaches: impl Fn(&Self) -> bool) -> Outcome {
        let OnLine { overlap, out, deepest } = *found;
        let foot = deepest + out * overlap;
        if overlap > 0.0 && !self.a.contains(&foot) && !reaches(self) {
            return ELSEWHERE;
        }
        let touch =
            Touch { overlap, normal: -out, point: deepest + out * (0.5 * overlap) }.outcome();
        // It may be nearer to other edges.
        if let Outcome::Apart(_) = touch { ELSEWHERE } else { touch }
    }

    /// Whether a point of an edge lies in the body.
    fn reaches(&self, from: &Vec3, along: &Vec3, length: f64, across: &Vec3) -> bool {
        let radius = POINT * self.a.bounding_radius();
        let segment = Shape::Spherocylinder(Spherocylinder { length, radius });
        let frame = Mat3::from_columns(&[*along, *across, along.cross(across)]);
        let middle = from + along * (0.5 * length) - self.centre;
        let segment = Posed::new(&segment, &frame);
        let bodies = Difference::new(&self.a, &segment, &middle);
        let found = separate(&bodies, &bodies.r, APART, f64::INFINITY);
        !matches!(found, Separation::Apart(_) | Separation::Beyond(_))
    }

    /// Contact with a strip of a cylinder or a cone.
    ///
    /// `n` is the normal away from the axis, and `n·x = d` is the plane that touches the surface along a line. Then `δ = h(n) + n·c - d` for a
    /// body inside and `d - n·c + h(-n)` for one outside. A body on the axis that touches all around is found by the first strip only.
    fn on_strip(&self, strip: &Strip) -> Outcome {
        let Strip { from, axis, length, radius, slope, first, quarter, .. } = strip;
        let way = self.centre - from;
        let height = way.dot(axis);
        let out = way - axis * height;
        let steep = (1.0 + slope * slope).sqrt();
        let within = (radius + slope * height - out.norm()) / steep;
        let clearance = within.abs() - self.a.bounding_radius();
        if clearance > 0.0 {
            return Outcome::Apart(clearance);
        }
        let side = within.signum();
        let directions = |angle: f64| {
            let (sine, cosine) = libm::sincos(angle);
            let across = first * cosine + quarter * sine;
            ((across - axis * *slope) / steep, quarter * cosine - first * sine)
        };
        // Slope of δ with the angle for a body inside; its negative for a body outside.
        let grows = |angle: f64| {
            let (normal, on) = directions(angle);
            (self.a.support(&(normal * side)) + way).dot(&on)
        };
        let angle =
            if self.radius > 0.0 { self.of_sphere(&out, strip) } else { self.around(grows, strip) };
        let Some(angle) = angle else { return ELSEWHERE };
        let into = directions(angle).0 * side;
        // From outside, a contact on the far side is behind the surface.
        if side < 0.0 && self.radius == 0.0 && into.dot(&out) >= 0.0 {
            return ELSEWHERE;
        }
        let deepest = self.a.support(&into);
        let overlap = (deepest + way).dot(&into) - side * radius / steep;
        let foot = deepest - into * overlap;
        let is_on =
            |place: &Vec3| (-self.border..=length + self.border).contains(&(way + place).dot(axis));
        if overlap <= 0.0 || !is_on(&foot) {
            return ELSEWHERE;
        }
        // Beyond its end, a long body may touch the continuation of the surface.
        let crossing = deepest * (1.0 - overlap / deepest.dot(&into));
        if self.radius == 0.0 && !self.a.contains(&foot) && !is_on(&crossing) {
            return ELSEWHERE;
        }
        Touch { overlap, normal: into, point: deepest - into * (0.5 * overlap) }.outcome()
    }

    /// Angle of a sphere whose centre is at this vector from the axis, if it is on this strip.
    fn of_sphere(&self, out: &Vec3, strip: &Strip) -> Option<f64> {
        let Strip { first, quarter, opening, is_first, .. } = strip;
        if out.norm() <= self.border {
            return is_first.then_some(0.0);
        }
        let angle = libm::atan2(out.dot(quarter), out.dot(first));
        (-BORDER..=opening + BORDER).contains(&angle).then_some(angle)
    }

    /// Root of a function of the angle that is not negative at the first line of a strip and not positive at the last.
    ///
    /// A function that is zero all around the axis has its root on the first strip only.
    fn around(&self, f: impl Fn(f64) -> f64, strip: &Strip) -> Option<f64> {
        let (low, high) = (f(0.0), f(strip.opening));
        let all_around = low.abs() <= self.border && high.abs() <= self.border;
        let is_there = low >= -self.border && high <= self.border;
        (is_there && (strip.is_first || !all_around))
            .then(|| root(f, (0.0, low), (strip.opening, high)))
    }

    fn on_rim(&self, rim: &Rim) -> Outcome {
        let Rim { strip, outwards, .. } = rim;
        let way = self.centre - rim.centre();
        let height = way.dot(&strip.axis);
        let out = way - strip.axis * height;
        let beside = out.norm() - rim.radius();
        let clearance = (beside * beside + height * height).sqrt() - self.a.bounding_radius();
        if clearance > 0.0 {
            return Outcome::Apart(clearance);
        }
        // Most bodies near the end of a surface do not extend beyond it.
        let over = strip.axis * *outwards;
        if (way + self.a.support(&over)).dot(&over) <= 0.0 {
            return ELSEWHERE;
        }
        if self.radius > 0.0 {
            return self.sphere_on_rim(rim, &out);
        }
        // All directions around the rim: the search for its point does not end at the normals of the surface.
        let seen = |tangent: &Tangent| {
            let Tangent { at, first, quarter, .. } = tangent;
            self.on_line(&(self.centre - at), [first, quarter], TAU)
        };
        // Distance of the deepest point beyond the plane of the axis and a point of the rim.
        let beyond = |angle: f64| {
            let tangent = rim.tangent(angle);
            seen(&tangent).map_or(0.0, |of| (of.deepest + way).dot(&tangent.along))
        };
        let Some(angle) = self.around(beyond, strip) else { return ELSEWHERE };
        let tangent = rim.tangent(angle);
        let Some(found) = seen(&tangent) else { return ELSEWHERE };
        let Tangent { at, along, first, quarter } = &tangent;
        if found.out.dot(quarter) < -BORDER {
            return ELSEWHERE;
        }
        let reach = self.a.bounding_radius();
        let from = at - along * reach;
        self.where_it_reaches(&found, |body| body.reaches(&from, along, 2.0 * reach, first))
    }

    /// Least scale of the body about its centre at which it touches a triangle, if it does so at `most`.
    ///
    /// It first touches the plane of the triangle, or one of its sides.
    fn least_in(&self, corners: &[Vec3; 3], most: f64) -> Option<f64> {
        let [a, b, c] = corners;
        let normal = (b - a).cross(&(c - a)).normalize();
        let height = (a - self.centre).dot(&normal);
        let into = if height < 0.0 { -normal } else { normal };
        let deepest = self.a.support(&into);
        let scale = height.abs() / deepest.dot(&into);
        if scale >= most {
            return None;
        }
        if is_over(corners, &(self.centre + deepest * scale), 0.0) {
            return Some(scale);
        }
        let is_cut = |scale: f64| {
            let body = Body { a: Posed { scale: self.a.scale * scale, ..self.a }, ..*self };
            [(a, b), (b, c), (c, a)].iter().any(|(from, to)| {
                let (way, length) = (*to - *from, (*to - *from).norm());
                body.reaches(from, &(way / length), length, &normal)
            })
        };
        is_cut(most).then(|| {
            let (mut low, mut high) = (scale, most);
            for _ in 0..20 {
                let middle = 0.5 * (low + high);
                if is_cut(middle) { high = middle } else { low = middle }
            }
            high
        })
    }

    fn sphere_on_rim(&self, rim: &Rim, out: &Vec3) -> Outcome {
        let Some(angle) = self.of_sphere(out, &rim.strip) else { return ELSEWHERE };
        let tangent = rim.tangent(angle);
        let way = self.centre - tangent.at;
        if way.dot(&tangent.quarter) < -BORDER * way.norm() {
            ELSEWHERE
        } else {
            self.sphere_at(&way)
        }
    }

    fn on_corner(
        &self,
        at: &Vec3,
        mut edges: impl Iterator<Item = Vec3>,
        points: &Chain,
        warm: Option<&Vec3>,
    ) -> Outcome {
        if let Some(apart) = self.apart_from(at) {
            return apart;
        }
        let way = self.centre - at;
        let outcome = if self.radius > 0.0 {
            self.sphere_at(&way)
        } else {
            // A point has no curvature, so a small sphere replaces it. Its radius is subtracted from the overlap.
            let radius = POINT * self.a.bounding_radius();
            let (point, upright) = (Shape::Sphere(Sphere { radius }), Mat3::identity());
            match points.touch(&self.a, &Posed::new(&point, &upright), &-way, warm) {
                Outcome::Touching(Touch { overlap, normal, point }) => Touch {
                    overlap: overlap - radius,
                    normal,
                    point: point + normal * (0.5 * radius),
                }
                .outcome(),
                other => other,
            }
        };
        match outcome {
            Outcome::Touching(Touch { normal, .. })
                if normal.dot(&way) >= 0.0 || edges.any(|along| -normal.dot(&along) > BORDER) =>
            {
                ELSEWHERE
            }
            outcome => outcome,
        }
    }

    /// Contact of a sphere whose centre is at this vector from the nearest point [m].
    fn sphere_at(&self, way: &Vec3) -> Outcome {
        let distance = way.norm();
        if distance == 0.0 {
            return Outcome::Failed(Why::TooDeep);
        }
        let (overlap, normal) = (self.radius - distance, -way / distance);
        Touch { overlap, normal, point: touch_of_sphere(self.radius, &normal, overlap) }.outcome()
    }
}

/// Part by which a smooth body must shrink about its centre to be free of all triangles of a wall, and the face that cuts it deepest.
///
/// `r` points from its centre to the reference point of the wall [m]. Returns `None` if the part is less than `least`.
pub fn cut(a: &Posed, b: &Posed, r: &Vec3, least: f64) -> Option<(f64, u32)> {
    let Shape::TriangleMesh(mesh) = b.shape else { return None };
    // The triangles of a cylinder or a cone are not its surface.
    if mesh.is_round() {
        return None;
    }
    let frame = b.frame.tr_mul(a.frame);
    let centre = -b.frame.tr_mul(r);
    let body = Body { a: Posed { frame: &frame, ..*a }, radius: 0.0, centre, border: 0.0 };
    let mut found = (1.0 - least, None);
    mesh.for_each_triangle_near(&centre, a.bounding_radius(), |face, corners| {
        if let Some(scale) = body.least_in(corners, found.0) {
            found = (scale, Some(face));
        }
    });
    found.1.map(|face| (1.0 - found.0, face))
}

/// Root of a continuous function that is not negative at the lower angle and not positive at the upper one, except for rounding.
///
/// Regula falsi in the Illinois form (Dowell and Jarratt 1971, DOI 10.1007/BF01934364), with bisection where that is slow.
fn root(
    f: impl Fn(f64) -> f64,
    (mut a, mut at_a): (f64, f64),
    (mut b, mut at_b): (f64, f64),
) -> f64 {
    if at_a <= 0.0 {
        return a;
    }
    if at_b >= 0.0 {
        return b;
    }
    let mut last = 0.0;
    for step in 0..200 {
        let width = b - a;
        if width <= ANGLE {
            break;
        }
        let secant = a + width * (at_a / (at_a - at_b));
        let x = if step % 4 == 3 { a + 0.5 * width } else { secant.clamp(a, b) };
        let at_x = f(x);
        if at_x == 0.0 || x == a || x == b {
            return x;
        }
        // The value of an end that stayed twice is halved.
        let stayed = if at_x * last > 0.0 { 0.5 } else { 1.0 };
        if at_x > 0.0 {
            (a, at_a, at_b) = (x, at_x, at_b * stayed);
        } else {
            (b, at_b, at_a) = (x, at_x, at_a * stayed);
        }
        last = at_x;
    }
    a + 0.5 * (b - a)
}
