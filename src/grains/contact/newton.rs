//! Newton's method for the common normal of two ellipsoids, in any number of lanes.
//!
//! With `A = R diag(a²) Rᵀ`, an ellipsoid has the support function `h = √(n·A n)`, the support point `s = A n / h` and the Hessian
//! `(A - s sᵀ) / h`. The step of Newton's method on the unit sphere solves `(H - δ) d = -g` on the tangent plane (Absil, Mahony and
//! Sepulchre 2008, *Optimization Algorithms on Matrix Manifolds*, chapters 5 and 6). No basis of that plane is needed, because there
//! `W⁻¹ = (tr W - W) / det W`.
//!
//! [`Ellipsoids::descend`] is the search. A shift keeps the Hessian positive definite; the step length is limited, and a line search
//! shortens it. Each lane proceeds on its own and rests when it has converged.
//!
//! Closures are not used here or in `lanes`. Unlike functions, they cannot be marked for inlining and would be compiled without vector
//! registers.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::count_direction;
use crate::lanes::{Lanes, Symmetric, Triple};

/// Longest step [rad].
const LONGEST_STEP: f64 = 0.5;
/// Step length below which a step is the last [rad]: quadratic convergence leaves 1e-12, and the closing correction nothing.
const LAST_STEP: f64 = 1e-6;
/// Part of the predicted decrease that a step must bring (Armijo).
const SUFFICIENT: f64 = 1e-4;
/// Rounding of the Hessian's determinant at a flat minimum, relative to the square of its trace.
const FLAT: f64 = 1e-12;
/// Rounding of `δ`, in units of the pair's length.
const ROUNDING: f64 = 4e-15;

/// Two ellipsoids and their relative position `r`.
#[derive(Clone, Copy)]
pub(super) struct Ellipsoids<L> {
    pub(super) a: Symmetric<L>,
    pub(super) b: Symmetric<L>,
    pub(super) r: Triple<L>,
}

/// `δ(n)` and its derivatives along one direction.
#[derive(Clone, Copy)]
pub(super) struct Evaluation<L> {
    pub(super) normal: Triple<L>,
    /// Support points of A, and of the mirror image of B at its centre (which is B).
    on_a: Triple<L>,
    on_b: Triple<L>,
    /// `1 / h_A`, `1 / h_B`.
    inverse_a: L,
    inverse_b: L,
    /// `δ`
    pub(super) delta: L,
    /// Gradient of `δ` on the sphere.
    pub(super) gradient: Triple<L>,
}

/// Hessian of `h_A + h_B`, which has no part along the normal.
#[derive(Clone, Copy)]
pub(super) struct Hessian<L> {
    entries: Symmetric<L>,
    /// Sum and product of the two eigenvalues on the tangent plane.
    pub(super) trace: L,
    pub(super) product: L,
}

/// Results of a search by lane. Each lane is in exactly one of the three masks, or in none if it did not converge.
#[derive(Clone, Copy)]
pub(super) struct Ends<L> {
    /// Lanes that are apart: a direction with `δ <= 0` was found.
    pub(super) apart: u8,
    /// Lanes at a minimum.
    pub(super) minimum: u8,
    /// Lanes at a saddle or a maximum: the bodies are too deep in each other for this start.
    pub(super) saddle: u8,
    /// `δ` of lanes that are apart; overlap of lanes at a minimum.
    pub(super) overlap: L,
    pub(super) normal: Triple<L>,
    pub(super) point: Triple<L>,
}

impl<L: Lanes> Ellipsoids<L> {
    /// Copy with lengths multiplied by a factor.
    #[inline(always)]
    pub(super) fn scaled(&self, factor: L) -> Self {
        let square = factor * factor;
        Self { a: self.a.scaled(square), b: self.b.scaled(square), r: self.r.times(factor) }
    }

    /// First direction: `adj(A + B) r`, parallel to `(A + B)⁻¹ r`, of any length.
    ///
    /// It is the normal of two spheres, and of touching ellipsoids with the same proportions and orientation.
    #[inline(always)]
    pub(super) fn cold_start(&self) -> Triple<L> {
        self.a.plus(&self.b).adjugate().times(self.r)
    }

    /// `δ` along a normal.
    #[inline(always)]
    pub(super) fn delta(&self, normal: Triple<L>) -> L {
        count_direction();
        let (qa, qb) = (normal.dot(self.a.times(normal)), normal.dot(self.b.times(normal)));
        (qa.sqrt() + qb.sqrt()) - normal.dot(self.r)
    }

    #[inline(always)]
    pub(super) fn evaluate(&self, normal: Triple<L>) -> Evaluation<L> {
        count_direction();
        let (a, b) = (self.a.times(normal), self.b.times(normal));
        let (qa, qb) = (normal.dot(a), normal.dot(b));
        let inverse = L::all(1.0) / (qa * qb);
        let (ha, hb) = (qa.sqrt(), qb.sqrt());
        let (inverse_a, inverse_b) = (ha * (qb * inverse), hb * (qa * inverse));
        let (on_a, on_b) = (a.times(inverse_a), b.times(inverse_b));
        let delta = (ha + hb) - normal.dot(self.r);
        let gradient = on_a.plus(on_b).minus(self.r).minus(normal.times(delta));
        Evaluation { normal, on_a, on_b, inverse_a, inverse_b, delta, gradient }
    }

    #[inline(always)]
    pub(super) fn hessian(&self, e: &Evaluation<L>) -> Hessian<L> {
        let (a, b, p, q) = (&self.a, &self.b, &e.on_a, &e.on_b);
        let (fa, fb) = (e.inverse_a, e.inverse_b);
        let h = Symmetric {
            xx: (a.xx - p.x * p.x) * fa + (b.xx - q.x * q.x) * fb,
            yy: (a.yy - p.y * p.y) * fa + (b.yy - q.y * q.y) * fb,
            zz: (a.zz - p.z * p.z) * fa + (b.zz - q.z * q.z) * fb,
            xy: (a.xy - p.x * p.y) * fa + (b.xy - q.x * q.y) * fb,
            xz: (a.xz - p.x * p.z) * fa + (b.xz - q.x * q.z) * fb,
            yz: (a.yz - p.y * p.z) * fa + (b.yz - q.y * q.z) * fb,
        };
        let product = ((h.xx * h.yy - h.xy * h.xy) + (h.xx * h.zz - h.xz * h.xz))
            + (h.yy * h.zz - h.yz * h.yz);
        Hessian { entries: h, trace: (h.xx + h.yy) + h.zz, product }
    }

    /// Minimises `δ` from `start`, unit vectors, in the lanes whose bits are set; lengths are in units of the pair's length.
    ///
    /// A lane that has not converged after this number of `evaluations`, or that gets a NaN, is in none of the masks of `Ends`.
    #[inline(always)]
    pub(super) fn descend(&self, start: Triple<L>, lanes: u8, evaluations: u32) -> Ends<L> {
        let zero = L::all(0.0);
        let mut here = self.evaluate(start);
        let apart = lanes & here.delta.at_most(zero);
        let mut ends =
            Ends { apart, minimum: 0, saddle: 0, overlap: here.delta, normal: start, point: start };
        let mut going = lanes & zero.less(here.delta);
        // Remaining part of a step after the line search.
        let mut fraction = L::all(1.0);
        for _ in 1..evaluations {
            if going == 0 {
                break;
            }
            let hessian = self.hessian(&here);
            let step = hessian.safe_step(&here, going).times(fraction);
            let slope = here.gradient.dot(step);
            let there = self.evaluate(here.normal.plus(step).unit());
            let apart = going & there.delta.at_most(zero);
            let enough = (here.delta + L::all(SUFFICIENT) * slope) + L::all(ROUNDING);
            let taken = going & !apart & there.delta.at_most(enough);
            let last = taken & step.dot(step).less(L::all(LAST_STEP * LAST_STEP));
            if apart != 0 {
                ends.apart |= apart;
                ends.overlap = there.delta.or(ends.overlap, apart);
            }
            if last != 0 {
                let minimum = hessian.exceeds(there.delta, FLAT);
                ends.minimum |= last & minimum;
                ends.saddle |= last & !minimum;
                self.correct(&there, &hessian, last, &mut ends);
            }
            going &= !(apart | last);
            here = there.or(&here, taken);
            fraction = L::all(1.0).or(fraction * L::all(0.5), taken);
        }
        ends
    }

    /// Takes one more step with the last Hessian in the lanes of `last`.
    #[inline(always)]
    fn correct(&self, e: &Evaluation<L>, hessian: &Hessian<L>, last: u8, ends: &mut Ends<L>) {
        let zero = L::all(0.0);
        let newton = hessian.step(e.gradient, e.delta);
        // A minimum that is flat to rounding has no better point.
        let small = newton.dot(newton).less(L::all(LAST_STEP * LAST_STEP));
        let step = newton.or(Triple { x: zero, y: zero, z: zero }, small);
        let overlap = e.delta + L::all(0.5) * e.gradient.dot(step);
        ends.overlap = overlap.or(ends.overlap, last);
        ends.normal = e.normal.plus(step).unit().or(ends.normal, last);
        ends.point = self.point_after(e, step).or(ends.point, last);
    }

    /// Contact point after the normal has turned by `step`, relative to the centre of A: the middle of the support points.
    ///
    /// Each support point follows the compliance of its own body. This keeps the contact point steady where a surface is nearly flat.
    #[inline(always)]
    pub(super) fn point_after(&self, e: &Evaluation<L>, step: Triple<L>) -> Triple<L> {
        let on_a = follow(&self.a, e.on_a, e.inverse_a, step);
        let on_b = follow(&self.b, e.on_b, e.inverse_b, step);
        on_a.minus(on_b).plus(self.r).times(L::all(0.5))
    }
}

/// Support point after its direction has turned by `step`; `inverse` is `1 / h`.
#[inline(always)]
fn follow<L: Lanes>(
    shape: &Symmetric<L>,
    point: Triple<L>,
    inverse: L,
    step: Triple<L>,
) -> Triple<L> {
    let along = shape.times(step).minus(point.times(point.dot(step)));
    point.plus(along.times(inverse))
}

impl<L: Lanes> Evaluation<L> {
    /// This evaluation in the lanes of `mask`, the other one elsewhere.
    #[inline(always)]
    fn or(&self, other: &Self, mask: u8) -> Self {
        Self {
            normal: self.normal.or(other.normal, mask),
            on_a: self.on_a.or(other.on_a, mask),
            on_b: self.on_b.or(other.on_b, mask),
            inverse_a: self.inverse_a.or(other.inverse_a, mask),
            inverse_b: self.inverse_b.or(other.inverse_b, mask),
            delta: self.delta.or(other.delta, mask),
            gradient: self.gradient.or(other.gradient, mask),
        }
    }
}

impl<L: Lanes> Hessian<L> {
    /// `det (H - shift)` on the tangent plane.
    #[inline(always)]
    pub(super) fn determinant(&self, shift: L) -> L {
        (self.product - shift * self.trace) + shift * shift
    }

    /// `-(H - shift)⁻¹ g` on the tangent plane, times the determinant.
    #[inline(always)]
    pub(super) fn scaled_step(&self, gradient: Triple<L>, shift: L) -> Triple<L> {
        self.entries.times(gradient).minus(gradient.times(self.trace - shift))
    }

    /// Newton's step `-(H - shift)⁻¹ g` on the tangent plane.
    #[inline(always)]
    fn step(&self, gradient: Triple<L>, shift: L) -> Triple<L> {
        self.scaled_step(gradient, shift).times(L::all(1.0) / self.determinant(shift))
    }

    /// Newton's step where it leads downhill, else a step with a shift that does, limited to the longest step.
    ///
    /// Lanes outside `going` may have any value.
    #[inline(always)]
    fn safe_step(&self, here: &Evaluation<L>, going: u8) -> Triple<L> {
        let mut shift = here.delta;
        let downhill = self.exceeds(here.delta, 0.0);
        if going & !downhill != 0 {
            // A little less than the product over the sum of the eigenvalues, which is below both of them.
            let below = L::all(0.9) * (self.product / self.trace);
            shift = shift.or(below, downhill);
        }
        let step = self.step(here.gradient, shift);
        let squared = step.dot(step);
        let long = L::all(LONGEST_STEP * LONGEST_STEP).less(squared);
        if going & long == 0 {
            return step;
        }
        step.times((L::all(LONGEST_STEP) / squared.sqrt()).or(L::all(1.0), long))
    }

    /// Lanes in which both eigenvalues of `H - shift` on the tangent plane are positive.
    ///
    /// The product may be below zero by `slack` times the square of the sum.
    #[inline(always)]
    fn exceeds(&self, shift: L, slack: f64) -> u8 {
        let least = L::all(-slack) * (self.trace * self.trace);
        least.less(self.determinant(shift)) & (shift + shift).less(self.trace)
    }
}
