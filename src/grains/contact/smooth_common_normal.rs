//! Common normal of any two smooth bodies by Newton's method on the unit sphere, for pairs with a superellipsoid.
//!
//! Minimises `δ(n) = h_A(n) + h_B(-n) - n·r` over unit vectors `n` like [`CommonNormal`]. The differences follow from those between
//! superellipsoids and ellipsoids:
//!
//! * A Hessian is given as two dyads per body ([`CurvedSupport`]), not as a matrix. It is infinite across flat faces and zero at crests.
//!   From dyads, the trace, the determinant on the tangent plane and the adjugate are sums without a minus sign. Eigenvalues ten orders
//!   apart therefore keep their digits.
//! * Near a flat face the support point moves like a small power of the direction, and Newton's step overshoots without end. The flatter
//!   body then follows the step on its surface: the step moves its support point in a straight line, and the new direction is the normal
//!   there ([`Shape::follow`]). Any other step is damped until it brings a part of the predicted decrease (Armijo; Nocedal and Wright
//!   2006, *Numerical Optimization*, chapter 3).
//! * The iteration ends by Newton's decrement, the overlap still to be gained. The size of a step is no criterion where curvature has no
//!   bounds.
//! * Radii of curvature may be zero, and the certificate of a global minimum then fails. In that case a minimum whose overlap is not small
//!   beside the radii of curvature *there* competes with another one: the one that Newton's method finds from the direction of a coarse EPA.
//!
//! A pair that is not settled within the evaluations goes to the next resolver of the chain.

use super::{
    CommonNormal, ContactResolver, Epa, Outcome, Posed, Touch, Why, count_direction, unit_of_length,
};
use crate::math::{Mat3, Vec3};
use crate::shape::{CurvedSupport, Ellipsoid, Shape};

/// Limit of directions tried.
const EVALUATIONS: u32 = 30;
/// Longest step [rad].
const LONGEST_STEP: f64 = 0.5;
/// Part of the predicted decrease that a step must bring (Armijo).
const SUFFICIENT: f64 = 1e-4;
/// Part of the predicted decrease that a step on a surface must bring, or the damped step is taken.
const WORTHWHILE: f64 = 0.01;
/// Rounding of `δ`, in units of the pair's length.
const ROUNDING: f64 = 4e-15;
/// With less than this to be gained [units], `δ` is rounding only, and the decrement itself must decrease.
const NEAR: f64 = 1e-14;
/// With less than this to be gained [units], a step that changes nothing is the last.
///
/// The gain may be overestimated by the Hessian of a flat face.
const BELOW_ROUNDING: f64 = 1e-11;
/// With less than this to be gained [units], nothing is left after the closing correction.
const NOTHING: f64 = 1e-28;
/// A minimum must compete if its overlap is more than this part of the radii of curvature, or of the inscribed radii.
const DOUBTFUL: f64 = 0.1;
/// Finds the competing minimum, which may be this far above the global one [units].
const RIVAL: Epa = Epa::new(1e-7);

/// Finds a start where the first one was too far off.
const START: Epa = Epa::new(1e-10);

/// Resolver of smooth bodies of any kind by their common normal.
#[derive(Clone, Copy, Debug, Default)]
pub struct SmoothCommonNormal;

impl ContactResolver for SmoothCommonNormal {
    fn name(&self) -> &'static str {
        "common-normal"
    }

    /// Resolves a pair. Two ellipsoids, also superellipsoids with exponents of 1, are left to [`CommonNormal`].
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        if let (Some(round_a), Some(round_b)) = (ellipsoid(a.shape), ellipsoid(b.shape)) {
            let (round_a, round_b) = (Shape::Ellipsoid(round_a), Shape::Ellipsoid(round_b));
            let a = Posed { shape: &round_a, ..*a };
            let b = Posed { shape: &round_b, ..*b };
            return CommonNormal.touch(&a, &b, r, warm);
        }
        let (radius_a, radius_b) = (a.bounding_radius(), b.bounding_radius());
        let reach = radius_a + radius_b;
        let squared = r.norm_squared();
        if squared > reach * reach {
            return Outcome::Apart(squared.sqrt() - reach);
        }
        let unit = unit_of_length(radius_a, radius_b);
        let pair = SmoothPair::new([a, b], r, unit);
        let start = warm.copied().or_else(|| pair.cold_start());
        // The start is `None` only if the centres coincide.
        start.map_or(Outcome::Failed(Why::TooDeep), |n| pair.resolve(&n).in_metres(unit))
    }
}

/// Contact at the minimum of `δ` near a direction that another method has found.
pub(super) fn touch_beside(a: &Posed, b: &Posed, r: &Vec3, normal: &Vec3) -> Option<Touch> {
    let unit = unit_of_length(a.bounding_radius(), b.bounding_radius());
    let pair = SmoothPair::new([a, b], r, unit);
    match pair.minimise(normal) {
        Minimum::At { touch, .. } if touch.overlap > 0.0 => {
            Some(Touch { overlap: touch.overlap * unit, point: touch.point * unit, ..touch })
        }
        _ => None,
    }
}

/// A contact, or apart if the closing correction brought the overlap to zero.
fn settled(touch: Touch) -> Outcome {
    if touch.overlap > 0.0 { Outcome::Touching(touch) } else { Outcome::Apart(0.0) }
}

/// The ellipsoid equal to a shape, if there is one.
fn ellipsoid(shape: &Shape) -> Option<Ellipsoid> {
    match shape {
        Shape::Sphere(s) => Some(Ellipsoid { semi_axes: Vec3::repeat(s.radius) }),
        Shape::Ellipsoid(e) => Some(*e),
        Shape::Superellipsoid(s) => s.as_ellipsoid(),
        _ => None,
    }
}

/// Two bodies and their relative position, in units of the pair's length.
struct SmoothPair<'a> {
    bodies: [&'a Posed<'a>; 2],
    r: Vec3,
    /// Unit of length [m], and its inverse.
    unit: f64,
    per_metre: f64,
    /// Unit and inverse for lengths of each body at a scale of 1.
    own_units: [f64; 2],
    per_own_metre: [f64; 2],
}

/// Support point and curvature of a body along the outward direction `n` or `-n`.
struct Side {
    /// Direction and support point in the body's own frame, at a scale of 1 [m].
    direction: Vec3,
    own: CurvedSupport,
    /// Support point in world axes [units].
    world: CurvedSupport,
}

/// `δ` and its derivatives along one direction.
struct Evaluation {
    normal: Vec3,
    sides: [Side; 2],
    delta: f64,
    /// Gradient of `δ` on the sphere.
    gradient: Vec3,
    /// Sum and product of the two eigenvalues of the Hessian of `h_A + h_B` on the tangent plane.
    trace: f64,
    product: f64,
}

/// Result of Newton's method.
enum Minimum {
    /// Apart, with this clearance.
    Apart(f64),
    /// A minimum, with the sum of the surfaces' smaller radii of curvature there.
    At {
        touch: Touch,
        radius: f64,
    },
    Failed(Why),
}

impl Evaluation {
    /// The four dyads of the Hessian.
    #[inline]
    fn dyads(&self) -> [(f64, Vec3); 4] {
        let [a, b] = [&self.sides[0].world, &self.sides[1].world];
        [
            (a.weight[0], a.along[0]),
            (a.weight[1], a.along[1]),
            (b.weight[0], b.along[0]),
            (b.weight[1], b.along[1]),
        ]
    }

    /// Shift of Newton's method: `δ` wherever its step leads downhill.
    ///
    /// Elsewhere it is a little less than the product over the sum of the eigenvalues, which is below both of them.
    #[inline]
    fn shift(&self) -> f64 {
        let (shift, trace) = (self.delta, self.trace);
        let determinant = (self.product - shift * trace) + shift * shift;
        if determinant > 0.0 && 2.0 * shift < trace { shift } else { 0.9 * (self.product / trace) }
    }

    /// Newton's step `-(H - shift)⁻¹ g` on the tangent plane.
    #[inline]
    fn newton(&self) -> Vec3 {
        -self.solve(&self.gradient, self.shift())
    }

    /// `(H - shift)⁻¹ v` on the tangent plane. The adjugate of a dyad is the dyad of its vector turned by 90° about the normal.
    #[inline]
    fn solve(&self, v: &Vec3, shift: f64) -> Vec3 {
        let determinant = (self.product - shift * self.trace) + shift * shift;
        let mut solution = v * -shift;
        for (weight, along) in self.dyads() {
            let turned = self.normal.cross(&along);
            solution += turned * (weight * turned.dot(v));
        }
        solution / determinant
    }

    /// The smaller eigenvalue of the Hessian on the tangent plane.
    fn smaller_radius(&self) -> f64 {
        let difference = self.trace * self.trace - 4.0 * self.product;
        let root = if difference > 0.0 { difference.sqrt() } else { 0.0 };
        2.0 * self.product / (self.trace + root)
    }
}

impl<'a> SmoothPair<'a> {
    /// A pair of bodies at `r` from each other, in a unit of length [m].
    #[inline]
    fn new(bodies: [&'a Posed<'a>; 2], r: &Vec3, unit: f64) -> Self {
        let per_metre = 1.0 / unit;
        Self {
            bodies,
            r: r / unit,
            unit,
            per_metre,
            own_units: bodies.map(|body| unit / body.scale),
            per_own_metre: bodies.map(|body| per_metre * body.scale),
        }
    }

    /// First direction: `(A + B)⁻¹ r` with `A = R diag(a²) Rᵀ`.
    ///
    /// It is the normal of touching ellipsoids that have the bodies' semi-axes and the same proportions and orientation.
    fn cold_start(&self) -> Option<Vec3> {
        let matrix = |body: &Posed| {
            let axes = body.semi_axes() * self.per_metre;
            let stretched = body.frame * Mat3::from_diagonal(&axes);
            stretched * stretched.transpose()
        };
        let sum = matrix(self.bodies[0]) + matrix(self.bodies[1]);
        let [x, y, z] = [0, 1, 2].map(|i| sum.column(i).into_owned());
        let adjugate = [y.cross(&z), z.cross(&x), x.cross(&y)];
        let along = Vec3::from(adjugate.map(|row| row.dot(&self.r)));
        let squared = along.norm_squared();
        (squared > 0.0).then(|| along / squared.sqrt())
    }

    fn resolve(&self, start: &Vec3) -> Outcome {
        let (touch, radius) = match self.minimise(start) {
            Minimum::Apart(clearance) => return Outcome::Apart(clearance),
            Minimum::Failed(Why::NoConvergence) => return self.resolve_by_epa(),
            Minimum::Failed(why) => return Outcome::Failed(why),
            Minimum::At { touch, radius } => (touch, radius),
        };
        let [a, b] = self.bodies;
        let certain = a.smallest_curvature_radius() + b.smallest_curvature_radius();
        // A flat face has any radius of curvature, and is a minimum from the far side of the body, too. A face of the smaller body is no
        // deeper than that body.
        let inscribed = a.inscribed_radius().min(b.inscribed_radius());
        let radius = radius.min(inscribed * self.per_metre);
        if touch.overlap < certain * self.per_metre || touch.overlap < DOUBTFUL * radius {
            return settled(touch);
        }
        match RIVAL.touch(a, b, &(self.r * self.unit), None) {
            Outcome::Touching(coarse) => match self.minimise(&coarse.normal) {
                Minimum::Apart(clearance) => Outcome::Apart(clearance),
                Minimum::At { touch: rival, .. } if rival.overlap < touch.overlap => settled(rival),
                // A better minimum exists and was not reached.
                Minimum::Failed(why) if coarse.overlap * self.per_metre < touch.overlap => {
                    Outcome::Failed(why)
                }
                _ => settled(touch),
            },
            Outcome::Apart(clearance) => Outcome::Apart(clearance * self.per_metre),
            // No start for a competitor: a minimum is accepted, a saddle is not.
            Outcome::Failed(_) if touch.overlap < radius => settled(touch),
            failed @ Outcome::Failed(_) => failed,
        }
    }

    /// Resolves from the direction of EPA, where Newton's method did not converge from the first one.
    fn resolve_by_epa(&self) -> Outcome {
        let [a, b] = self.bodies;
        let coarse = match START.touch(a, b, &(self.r * self.unit), None) {
            Outcome::Touching(coarse) => coarse,
            Outcome::Apart(clearance) => return Outcome::Apart(clearance * self.per_metre),
            failed @ Outcome::Failed(_) => return failed,
        };
        match self.minimise(&coarse.normal) {
            Minimum::Apart(clearance) => Outcome::Apart(clearance),
            Minimum::At { touch, .. }
                if touch.overlap <= coarse.overlap * self.per_metre + ROUNDING =>
            {
                settled(touch)
            }
            Minimum::At { .. } => Outcome::Failed(Why::NoConvergence),
            Minimum::Failed(why) => Outcome::Failed(why),
        }
    }

    /// Both bodies along their outward directions, or `None` if one has edges.
    #[inline]
    fn sides(&self, normal: &Vec3) -> Option<[Side; 2]> {
        let [a, b] = self.bodies;
        let (to_a, to_b) = (a.frame.tr_mul(normal), b.frame.tr_mul(&-normal));
        let [on_a, on_b] = Shape::curved_supports([a.shape, b.shape], [&to_a, &to_b]);
        Some([self.side(0, to_a, on_a?), self.side(1, to_b, on_b?)])
    }

    #[inline]
    fn side(&self, index: usize, direction: Vec3, own: CurvedSupport) -> Side {
        let (per_metre, unit) = (self.per_own_metre[index], self.own_units[index]);
        let frame = self.bodies[index].frame;
        let world = CurvedSupport {
            point: frame * own.point * per_metre,
            weight: own.weight.map(|w| w * unit),
            along: own.along.map(|v| frame * v * per_metre),
        };
        Side { direction, own, world }
    }

    #[inline]
    fn evaluate(&self, normal: Vec3) -> Option<Evaluation> {
        count_direction();
        let sides = self.sides(&normal)?;
        let between = (sides[0].world.point - sides[1].world.point) - self.r;
        let delta = between.dot(&normal);
        let gradient = between - normal * delta;
        let mut e = Evaluation { normal, sides, delta, gradient, trace: 0.0, product: 0.0 };
        let dyads = e.dyads();
        for (i, (weight, along)) in dyads.iter().enumerate() {
            e.trace += weight * along.norm_squared();
            let turned = normal.cross(along);
            for (other_weight, other) in &dyads[i + 1..] {
                let area = turned.dot(other);
                e.product += (weight * other_weight) * (area * area);
            }
        }
        Some(e)
    }

    /// Minimises from `start`, a unit vector.
    fn minimise(&self, start: &Vec3) -> Minimum {
        let Some(mut here) = self.evaluate(*start) else {
            return Minimum::Failed(Why::NotSmooth);
        };
        let mut evaluations = 1;
        let mut gained = f64::INFINITY;
        loop {
            if here.delta <= 0.0 {
                // Only the certain part.
                return Minimum::Apart((-here.delta - ROUNDING).max(0.0));
            }
            let mut step = here.newton();
            let squared = step.norm_squared();
            if squared > LONGEST_STEP * LONGEST_STEP {
                step *= LONGEST_STEP / squared.sqrt();
            }
            let slope = here.gradient.dot(&step);
            if !(slope <= 0.0 && slope > f64::NEG_INFINITY) {
                return Minimum::Failed(Why::NotFinite);
            }
            // Newton's decrement: the gain of this step. Quadratic convergence leaves its cube over the square of the last gain. A gain that
            // does not decrease is rounding.
            let gain = -0.5 * slope;
            let left = gain * ((gain / gained) * (gain / gained));
            if gain <= NEAR && (gain <= NOTHING || left <= NOTHING || gain >= 0.25 * gained) {
                let touch = self.corrected(&here, &step);
                return Minimum::At { touch, radius: here.smaller_radius() };
            }
            gained = gain;
            if evaluations >= EVALUATIONS {
                return Minimum::Failed(Why::NoConvergence);
            }
            let Some(next) = self.advance(&here, &step, slope, &mut evaluations) else {
                return Minimum::Failed(Why::NoConvergence);
            };
            let changed = (next.delta - here.delta).abs();
            here = next;
            if gain <= BELOW_ROUNDING && changed <= ROUNDING {
                // Where a face is flatter than a Hessian can represent there is no gain, but the point is right.
                let point = self.corrected(&here, &here.newton()).point;
                let touch = Touch { overlap: here.delta, normal: here.normal, point };
                return Minimum::At { touch, radius: here.smaller_radius() };
            }
        }
    }

    /// The evaluation after a step with sufficient decrease, or `None` if there is none within the evaluations allowed.
    #[inline]
    fn advance(
        &self,
        here: &Evaluation,
        step: &Vec3,
        slope: f64,
        evaluations: &mut u32,
    ) -> Option<Evaluation> {
        if let Some(direction) = self.followed(here, step) {
            let there = self.evaluate(direction.normalize())?;
            *evaluations += 1;
            let slack = if slope > -2.0 * BELOW_ROUNDING { ROUNDING } else { 0.0 };
            if there.delta <= (here.delta + WORTHWHILE * slope) + slack {
                return Some(there);
            }
        }
        let mut part = 1.0;
        while *evaluations < EVALUATIONS {
            let there = self.evaluate((here.normal + step * part).normalize())?;
            *evaluations += 1;
            let excess = there.delta - here.delta;
            if excess <= SUFFICIENT * part * slope + ROUNDING {
                return Some(there);
            }
            // Minimum of the parabola through both values and the slope.
            let fraction = -0.5 * part * slope / (excess - part * slope);
            part *= fraction.clamp(0.1, 0.5);
        }
        None
    }

    /// Direction after each body's support point has moved on its surface by the step; `None` if that is no better for either body.
    ///
    /// The two resulting directions are weighted with the Hessians, so the flatter body decides.
    #[inline]
    fn followed(&self, here: &Evaluation, step: &Vec3) -> Option<Vec3> {
        let on_a = self.followed_on(0, here, step);
        let on_b = self.followed_on(1, here, step);
        if on_a.is_none() && on_b.is_none() {
            return None;
        }
        let [a, b] = [&here.sides[0].world, &here.sides[1].world];
        let moved =
            a.hessian_times(&on_a.unwrap_or(*step)) + b.hessian_times(&on_b.unwrap_or(*step));
        Some(here.normal + here.solve(&moved, 0.0))
    }

    /// Turn of the normal when the support point of one body moves on its surface by the step.
    #[inline]
    fn followed_on(&self, index: usize, here: &Evaluation, step: &Vec3) -> Option<Vec3> {
        let sign = if index == 1 { -1.0 } else { 1.0 };
        let (body, side) = (self.bodies[index], &here.sides[index]);
        let step = body.frame.tr_mul(step) * sign;
        let direction = body.shape.follow(&side.own, &side.direction, &step)?;
        let direction = body.frame * direction * sign;
        // Scaled to height 1, like the other body's.
        let height = direction.dot(&here.normal);
        (height > 0.0).then(|| direction / height - here.normal)
    }

    /// Contact after one more step with the last Hessian.
    ///
    /// Support points follow the compliance of their own body, which keeps the contact point steady where a surface is nearly flat.
    fn corrected(&self, e: &Evaluation, step: &Vec3) -> Touch {
        let [a, b] = [&e.sides[0].world, &e.sides[1].world];
        let on_a = a.point + a.hessian_times(step);
        let on_b = b.point - b.hessian_times(step);
        Touch {
            overlap: e.delta + 0.5 * e.gradient.dot(step),
            normal: (e.normal + step).normalize(),
            point: ((on_a + on_b) + self.r) * 0.5,
        }
    }
}
