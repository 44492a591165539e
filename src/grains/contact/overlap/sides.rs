//! Thickness of straight sides: spherocylinders with each other and with planes. For triangles see [`super::sides_on_surface`].
//!
//! Two spherocylinders that lie side by side touch along a line. The shortest distance of their axes gives no stable contact point: it jumps
//! from end to end when one of them tilts. A body at rest on such a contact rocks for ever.
//!
//! # Definition
//!
//! Let `s` run along the axis of A. `δ(s)` is the depth in the other body of the sphere about this point of the axis: the sum of the radii
//! less the distance from the point to the axis of B, or its depth below a plane. Over the part of the axis where `δ > 0`,
//!
//! `D² = ∫ δ³ ds / ∫ δ ds`.
//!
//! Where A lies flat on B, `δ` is the same everywhere, and `D = δ`, whatever the length. For two spherocylinders `D²` is the mean of the values
//! of both axes, so their order does not matter. The elastic energy is `k D² / 2`, as for faces ([`super::faces`]). Force and moment are its
//! gradient. Where the point at `s` is pushed along `n(s)`,
//!
//! `dU = k/2 ∫ (3 δ² - D²) dδ ds / ∫ δ ds`
//!
//! The ends of the part where `δ > 0` add nothing, as `δ = 0` there. Each point presses on the nearest one of the other axis along the line
//! between both. Momentum and angular momentum are therefore conserved.
//!
//! # Properties
//!
//! - On a plane `δ` is linear, and `D² = (δ₁² + δ₂²) / 2` with the depths of both ends, or 0 for an end above the plane. This is a spring of
//!   `k / 2` under each end: it is stiff against tilting, and its energy has no kink.
//! - Crossing spherocylinders have `24/35 k = 0.69 k` at any angle, as `δ` is a parabola. A round end on a plane and two ends in line have
//!   `k / 2`. A spherocylinder of no length has `k`, like a sphere.
//!
//! # Integrals
//!
//! The distance from a point to a segment has three parts: to one end, to a line, to the other end. In each of them `δ` is analytic, and its
//! integrals are computed by Gauss' rule with eight points. For overlaps of 10 % of the sum of the radii, the singularities of `δ` are 2 half
//! widths off the real axis, and the rule is accurate to `4.4⁻¹⁶ = 1e-10`. The derivatives are those of the exact integrals.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::thickness::{THIN, Thickness};
use crate::contact::patch::nearest_of_segments;
use crate::contact::{Outcome, Posed, PosedCore, Why};
use crate::lanes::{Eight, Kernel, Triple, WIDTH, dispatch};
use crate::math::{Mat3, Vec3};
use crate::shape::Shape;

/// Points of Gauss' rule with eight points on [-1, 1].
const PLACES: [f64; WIDTH] = [
    -0.960_289_856_497_536_3,
    -0.796_666_477_413_626_7,
    -0.525_532_409_916_329,
    -0.183_434_642_495_649_8,
    0.183_434_642_495_649_8,
    0.525_532_409_916_329,
    0.796_666_477_413_626_7,
    0.960_289_856_497_536_3,
];
/// Weights of these points.
const WEIGHTS: [f64; WIDTH] = [
    0.101_228_536_290_376_26,
    0.222_381_034_453_374_48,
    0.313_706_645_877_887_3,
    0.362_683_783_378_362,
    0.362_683_783_378_362,
    0.313_706_645_877_887_3,
    0.222_381_034_453_374_48,
    0.101_228_536_290_376_26,
];

/// A directed axis.
pub(super) struct Side {
    /// Vector from the centre to one end [m].
    pub(super) end: Vec3,
    /// Radius of the sphere rolled around the axis [m].
    pub(super) radius: f64,
}

impl Side {
    pub(super) fn of(body: &Posed) -> Option<Self> {
        match body.core() {
            PosedCore::Segment(end) if body.shape.kind().has_side() => {
                Some(Self { end, radius: body.margin() })
            }
            _ => None,
        }
    }
}

/// Thickness of two spherocylinders, or of one on a half-space, or the outcome if there is none; `None` for other bodies.
///
/// `r` points from the centre of A to that of B, or to the reference point of its wall [m].
pub(super) fn of_sides(a: &Posed, b: &Posed, r: &Vec3) -> Option<Result<Thickness, Outcome>> {
    let side = Side::of(a)?;
    if let Shape::HalfSpace(plane) = b.shape {
        let normal = -(b.frame * plane.normal);
        return Some(side.on_plane(&normal, r.dot(&normal) - plane.offset));
    }
    Some(side.on_side(&Side::of(b)?, r))
}

/// Integrals along the axis over the overlap with another body. Forces and moments are over the stiffness.
struct Along {
    /// `D²` [m²].
    squared: f64,
    /// Force on the other body [m].
    force: Vec3,
    /// Moment of that force about the centre of this body [m²].
    moment: Vec3,
    /// Mean place and variance of `δ`, for a half length of 1 [-].
    mean: f64,
    variance: f64,
}

/// Integrals over `s`.
#[derive(Default)]
pub(super) struct Integrals {
    /// Integrals of `δ`, `s δ`, `s² δ` and `δ³`.
    pub(super) depth: [f64; 4],
    /// Integrals of `n` and `δ² n`.
    pub(super) normal: [Vec3; 2],
    /// Integrals of `s n` and `s δ² n`.
    pub(super) moment: [Vec3; 2],
}

impl Integrals {
    /// Adds the part from `low` to `high`, where `δ` is linear with these values at both ends, along one normal.
    ///
    /// Gauss' rule with two points is exact.
    pub(super) fn add_straight(
        &mut self,
        [low, high]: [f64; 2],
        [first, last]: [f64; 2],
        n: &Vec3,
    ) {
        let half = 0.5 * (high - low);
        for place in [-1.0, 1.0] {
            let part = 0.5 * (1.0 + place / 3.0_f64.sqrt());
            let (s, depth) = (low + (high - low) * part, first + (last - first) * part);
            self.add_point(half, s, depth, n);
        }
    }

    /// Adds a part with any smooth `δ` and normal, as functions of `s`.
    pub(super) fn add_bent(&mut self, [low, high]: [f64; 2], at: impl Fn(f64) -> (f64, Vec3)) {
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        for (place, weight) in PLACES.iter().zip(WEIGHTS) {
            let s = middle + half * place;
            let (depth, n) = at(s);
            self.add_point(half * weight, s, depth, &n);
        }
    }

    fn add_point(&mut self, weight: f64, s: f64, depth: f64, n: &Vec3) {
        let squared = depth * depth;
        for (sum, value) in self.depth.iter_mut().zip([1.0, s, s * s, squared]) {
            *sum += weight * depth * value;
        }
        for (k, value) in [1.0, squared].into_iter().enumerate() {
            self.normal[k] += n * (weight * value);
            self.moment[k] += n * (weight * value * s);
        }
    }

    /// Adds the part from `low` to `high`, where the nearest point of the other axis is at `w[0] + s w[1]` from the point at `s`.
    pub(super) fn add(&mut self, [low, high]: [f64; 2], w: &[Vec3; 2], reach: f64) {
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let mut sums = [0.0; 10];
        dispatch(Part { middle, half, w, reach, sums: &mut sums });
        for (sum, part) in self.depth.iter_mut().zip(sums) {
            *sum += half * part;
        }
        // The direction is `(w[0] + s w[1]) / |w|`.
        for (k, [zeroth, first, second]) in
            [[sums[4], sums[5], sums[6]], [sums[7], sums[8], sums[9]]].into_iter().enumerate()
        {
            self.normal[k] += (w[0] * zeroth + w[1] * first) * half;
            self.moment[k] += (w[0] * first + w[1] * second) * half;
        }
    }
}

/// A part of an axis, with all points of Gauss' rule at once.
struct Part<'a> {
    middle: f64,
    half: f64,
    w: &'a [Vec3; 2],
    reach: f64,
    /// Sums of `δ`, `s δ`, `s² δ`, `δ³`, and of `1`, `s`, `s²` and `δ²`, `s δ²`, `s² δ²` over the distance `|w|`.
    sums: &'a mut [f64; 10],
}

impl Kernel for Part<'_> {
    type Home = Self;

    #[inline(always)]
    fn run<L: Eight>(self) {
        let Self { middle, half, w: [start, slope], reach, sums } = self;
        let all = |v: &Vec3| Triple { x: L::all(v.x), y: L::all(v.y), z: L::all(v.z) };
        let weight = L::load(&WEIGHTS);
        let s = L::all(middle) + L::all(half) * L::load(&PLACES);
        let to_other = all(start).plus(all(slope).times(s));
        let distance = to_other.dot(to_other).sqrt();
        let depth = L::all(reach) - distance;
        let squared = depth * depth;
        let inverse = weight / distance;
        let once = weight * depth;
        let pushed = squared * inverse;
        let (by_s, inverse_by_s, pushed_by_s) = (once * s, inverse * s, pushed * s);
        *sums = [
            total(once),
            total(by_s),
            total(by_s * s),
            total(once * squared),
            total(inverse),
            total(inverse_by_s),
            total(inverse_by_s * s),
            total(pushed),
            total(pushed_by_s),
            total(pushed_by_s * s),
        ];
    }
}

/// Sum over all lanes.
#[inline(always)]
fn total<L: Eight>(lanes: L) -> f64 {
    let [a, b, c, d, e, f, g, h] = lanes.store();
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

/// Range between two values of `s` where `|w[0] + s w[1]| < reach`.
fn within([low, high]: [f64; 2], w: &[Vec3; 2], reach: f64) -> Option<[f64; 2]> {
    let (a, b) = (w[1].norm_squared(), w[0].dot(&w[1]));
    let c = w[0].norm_squared() - reach * reach;
    let discriminant = b * b - a * c;
    let [first, last] = if discriminant > 0.0 {
        let q = -(b + discriminant.sqrt().copysign(b));
        let roots = [q / a, c / q];
        if b < 0.0 { [roots[1], roots[0]] } else { roots }
    } else if c < 0.0 {
        // The axes are parallel.
        [low, high]
    } else {
        return None;
    };
    let (low, high) = (low.max(first), high.min(last));
    (low < high).then_some([low, high])
}

impl Side {
    /// Integrals along this axis in the spherocylinder about another axis.
    fn along(&self, other: &Self, r: &Vec3) -> Option<Along> {
        let reach = self.radius + other.radius;
        // The nearest point of the other line is at t = start + slope s.
        let squared_length = other.end.norm_squared();
        let of_other =
            |v: &Vec3| if squared_length > 0.0 { v.dot(&other.end) / squared_length } else { 0.0 };
        let (slope, start) = (of_other(&self.end), -of_other(r));
        let mut integrals = Integrals::default();
        let mut add = |part: [f64; 2], [t, by_s]: [f64; 2]| {
            let w = [r + other.end * t, other.end * by_s - self.end];
            if let Some(part) = within(part, &w, reach) {
                integrals.add(part, &w, reach);
            }
        };
        if slope == 0.0 {
            add([-1.0, 1.0], [start.clamp(-1.0, 1.0), 0.0]);
        } else {
            let first_end = -1.0_f64.copysign(slope);
            let at = |t: f64| ((t - start) / slope).clamp(-1.0, 1.0);
            let [from, to] = [at(first_end), at(-first_end)];
            add([-1.0, from], [first_end, 0.0]);
            add([from, to], [start, slope]);
            add([to, 1.0], [-first_end, 0.0]);
        }
        let Integrals { depth: [depth, first, second, cubed], normal, moment } = integrals;
        if depth <= 0.0 {
            return None;
        }
        let squared = cubed / depth;
        let gradient = |of: [Vec3; 2]| (of[1] * 3.0 - of[0] * squared) / (2.0 * depth);
        let mean = first / depth;
        Some(Along {
            squared,
            force: gradient(normal),
            moment: self.end.cross(&gradient(moment)),
            mean,
            variance: (second / depth - mean * mean).max(0.0),
        })
    }

    /// Thickness in the spherocylinder about another axis.
    fn on_side(&self, other: &Self, r: &Vec3) -> Result<Thickness, Outcome> {
        let reach = self.radius + other.radius;
        let ends = |side: &Self, centre: &Vec3| [centre - side.end, centre + side.end];
        let (p, q) = nearest_of_segments(&ends(self, &Vec3::zeros()), &ends(other, r));
        let distance = (q - p).norm();
        if distance >= reach {
            return Err(Outcome::Apart(distance - reach));
        }
        if distance.is_nan() {
            return Err(Outcome::Failed(Why::NotFinite));
        }
        // The direction of such a short vector is a rounding error.
        if distance <= 1e-12 * reach {
            return Err(Outcome::Failed(Why::TooDeep));
        }
        let thin = Outcome::Apart(0.0);
        let (Some(of_a), Some(of_b)) = (self.along(other, r), other.along(self, &-r)) else {
            return Err(thin);
        };
        let squared = 0.5 * (of_a.squared + of_b.squared);
        let thickness = squared.sqrt();
        let is_thick = thickness > THIN * self.radius;
        if !is_thick {
            return Err(thin);
        }
        let force = (of_a.force - of_b.force) * 0.5;
        let on_a = of_b.moment + r.cross(&of_b.force);
        let moment = (of_a.moment - on_a) * 0.5;

        let middles = [self.end * of_a.mean, r + other.end * of_b.mean];
        let part = (self.radius - 0.5 * thickness) / (reach - thickness);
        let centroid = middles[0] + (middles[1] - middles[0]) * part;
        let line =
            |side: &Self, along: &Along| side.end * side.end.transpose() * (0.5 * along.variance);
        let covariance = line(self, &of_a) + line(other, &of_b);
        Ok(Thickness::pressing(thickness, force, moment, centroid, covariance))
    }

    /// Thickness in the half-space behind a plane at this height along its normal [m].
    fn on_plane(&self, normal: &Vec3, height: f64) -> Result<Thickness, Outcome> {
        let rise = self.end.dot(normal);
        let [one, other] = [self.radius - height + rise, self.radius - height - rise];
        let deepest = one.max(other);
        if !deepest.is_finite() {
            return Err(Outcome::Failed(Why::NotFinite));
        }
        let [press, counter] = [one.max(0.0), other.max(0.0)];
        let thickness = (0.5 * (press * press + counter * counter)).sqrt();
        let is_thick = thickness > THIN * self.radius;
        if !is_thick {
            return Err(Outcome::Apart((-deepest).max(0.0)));
        }
        let sum = press + counter;
        let variance = if press > 0.0 && counter > 0.0 {
            (sum * sum + 2.0 * press * counter) / (4.5 * sum * sum)
        } else {
            let length = 2.0 * deepest / (one - other).abs();
            length * length / 18.0
        };
        let across = self.end - normal * rise;
        let point = across * ((press - counter) / sum) + normal * (height + 0.5 * thickness);
        let covariance: Mat3 = self.end * self.end.transpose() * variance;
        let gain = 0.5 * sum / thickness;
        Ok(Thickness {
            thickness,
            normal: *normal,
            gain,
            point,
            couple: Vec3::zeros(),
            centroid: point,
            covariance,
        })
    }
}
