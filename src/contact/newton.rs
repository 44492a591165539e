//! The formulas of Newton's method for the common normal of two ellipsoids, in any number of lanes.
//!
//! With `A = R diag(a²) Rᵀ`, an ellipsoid has the support function `h = √(n·A n)`, the support point
//! `s = A n / h` and the Hessian `(A - s sᵀ) / h`. The step of Newton's method on the unit sphere solves
//! `(H - δ) d = -g` on the tangent plane (Absil, Mahony and Sepulchre 2008, *Optimization Algorithms on
//! Matrix Manifolds*, chapters 5 and 6); no basis of that plane is needed, because there
//! `W⁻¹ = (tr W - W) / det W`.
//!
//! No closures here or in `lanes`: unlike functions, they cannot be told to be inlined, and would be compiled
//! without vector registers.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::lanes::{Lanes, Symmetric, Triple};

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
    /// Support point of A, and of B's mirror image at its centre (which is B).
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

/// The Hessian of `h_A + h_B`, which has no part along the normal.
#[derive(Clone, Copy)]
pub(super) struct Hessian<L> {
    entries: Symmetric<L>,
    /// Sum and product of its two eigenvalues on the tangent plane.
    pub(super) trace: L,
    pub(super) product: L,
}

impl<L: Lanes> Ellipsoids<L> {
    /// `adj(A + B) r`, parallel to `(A + B)⁻¹ r`: the normal of two spheres, and of ellipsoids of one form
    /// and orientation that touch. Of any length.
    #[inline(always)]
    pub(super) fn cold_start(&self) -> Triple<L> {
        self.a.plus(&self.b).adjugate().times(self.r)
    }

    #[inline(always)]
    pub(super) fn evaluate(&self, normal: Triple<L>) -> Evaluation<L> {
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

    /// Where the support points go when the normal turns by `step`: each follows its own body's
    /// compliance, which keeps the contact point quiet where a surface is nearly flat. Their middle,
    /// seen from the centre of A, is the contact point.
    #[inline(always)]
    pub(super) fn point_after(&self, e: &Evaluation<L>, step: Triple<L>) -> Triple<L> {
        let on_a = follow(&self.a, e.on_a, e.inverse_a, step);
        let on_b = follow(&self.b, e.on_b, e.inverse_b, step);
        on_a.minus(on_b).plus(self.r).times(L::all(0.5))
    }
}

/// A support point after its direction has turned by `step`; `inverse` is `1 / h`.
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
}
