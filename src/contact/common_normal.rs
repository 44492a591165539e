//! The common normal of two ellipsoids (or spheres) by Newton's method on the unit sphere.
//!
//! Minimises `δ(n) = h_A(n) + h_B(-n) - n·r` over unit vectors `n` with the exact Riemannian Hessian,
//! made safe by a shift that keeps it positive definite and by a line search. The first choice for smooth
//! shapes: a few evaluations, rounding accuracy, a small part of the time of erosion. It needs curvature: shapes with edges go to GJK-erosion or EPA.
//!
//! With `A = R diag(a²) Rᵀ`, an ellipsoid has `h = √(n·A n)`, support point `A n / h` and Hessian
//! `(A - s sᵀ) / h`; see Absil, Mahony and Sepulchre (2008), *Optimization Algorithms on Matrix
//! Manifolds*, chapters 5 and 6, for Newton's method on the sphere.
//!
//! *When a minimum is the global one.* Let ϱ be the least radius of curvature of a body's surface. A
//! ball of radius ϱ_A + ϱ_B tangent to the difference A − B at a critical point lies inside it
//! (Blaschke's rolling theorem), so that no other point of the boundary is nearer to the origin if
//! `δ < ϱ_A + ϱ_B`. Deeper contacts compete with starts from all principal axes.
//!
//! Only `+ - * / √` are used, and every parenthesis is meant: lanes of a vector unit give the same bits.

use super::eroded_gjk::ErodedGjk;
use super::{ContactResolver, Outcome, Posed, Touch, Why, unit_of_length};
use crate::math::Vec3;
use crate::shape::Shape;

/// Directions tried before giving up: ellipsoids of 1:2 take 5 at most, of 1:10 10, needles of 1:100 up to 60.
const EVALUATIONS: u32 = 100;
/// Longest step [rad].
const LONGEST_STEP: f64 = 0.5;
/// A step shorter than this [rad] is the last: quadratic convergence leaves 1e-12, the closing correction
/// nothing.
const LAST_STEP: f64 = 1e-6;
/// Part of the predicted decrease that a step must bring (Armijo).
const SUFFICIENT: f64 = 1e-4;
/// Rounding of the Hessian's determinant at a flat minimum, relative to the square of its trace.
const FLAT: f64 = 1e-12;
/// Rounding of `δ`, in units of the pair's length.
const ROUNDING: f64 = 4e-15;

/// Resolves ellipsoids and spheres by their common normal.
#[derive(Clone, Copy, Debug, Default)]
pub struct CommonNormal;

impl ContactResolver for CommonNormal {
    fn name(&self) -> &'static str {
        "common-normal"
    }

    /// # Panics
    /// If a body is neither an ellipsoid nor a sphere: the table of resolvers was filled wrongly.
    #[inline]
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        let (radius_a, radius_b) = (a.shape.bounding_radius(), b.shape.bounding_radius());
        let reach = radius_a + radius_b;
        let squared = r.norm_squared();
        if squared > reach * reach {
            return Outcome::Apart(squared.sqrt() - reach);
        }
        let unit = unit_of_length(radius_a, radius_b);
        let pair = Ellipsoids::new(a, b, r, 1.0 / unit);
        let start = warm.copied().or_else(|| pair.cold_start());
        // Without a start the centres coincide.
        start.map_or(Outcome::Failed(Why::TooDeep), |n| pair.resolve(&n).in_metres(unit))
    }
}

/// The common normal started from the direction of GJK-erosion: dearer, but started within a few
/// degrees of the answer. For pairs at which [`CommonNormal`] gives up.
#[derive(Clone, Copy, Debug, Default)]
pub struct SeededCommonNormal {
    /// Gives the start.
    pub seed: ErodedGjk,
}

impl ContactResolver for SeededCommonNormal {
    fn name(&self) -> &'static str {
        "common-normal from gjk-erosion"
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        match self.seed.touch(a, b, r, warm) {
            Outcome::Touching(seed) => CommonNormal.touch(a, b, r, Some(&seed.normal)),
            // Erosion misses no contact: apart is apart.
            other => other,
        }
    }
}

impl Outcome {
    /// The outcome of a pair whose lengths were divided by `unit`.
    pub(super) fn in_metres(self, unit: f64) -> Self {
        match self {
            Self::Apart(clearance) => Self::Apart(clearance * unit),
            Self::Touching(t) => {
                Self::Touching(Touch { overlap: t.overlap * unit, point: t.point * unit, ..t })
            }
            Self::Failed(why) => Self::Failed(why),
        }
    }
}

/// A symmetric matrix.
#[derive(Clone, Copy)]
struct Symmetric {
    xx: f64,
    yy: f64,
    zz: f64,
    xy: f64,
    xz: f64,
    yz: f64,
}

impl Symmetric {
    /// `R diag(a²) Rᵀ` of a body, lengths times `per_metre`.
    fn of(body: &Posed, per_metre: f64) -> Self {
        let axes = match body.shape {
            Shape::Sphere(sphere) => {
                let radius = sphere.radius * per_metre;
                let square = radius * radius;
                return Self { xx: square, yy: square, zz: square, xy: 0.0, xz: 0.0, yz: 0.0 };
            }
            Shape::Ellipsoid(ellipsoid) => ellipsoid.semi_axes * per_metre,
            _ => unreachable!("the table gives this resolver ellipsoids and spheres"),
        };
        let (x, y, z) = (
            body.frame.column(0) * axes.x,
            body.frame.column(1) * axes.y,
            body.frame.column(2) * axes.z,
        );
        let entry = |i: usize, j: usize| (x[i] * x[j] + y[i] * y[j]) + z[i] * z[j];
        Self {
            xx: entry(0, 0),
            yy: entry(1, 1),
            zz: entry(2, 2),
            xy: entry(0, 1),
            xz: entry(0, 2),
            yz: entry(1, 2),
        }
    }

    #[inline]
    fn times(&self, v: &Vec3) -> Vec3 {
        Vec3::new(
            (self.xx * v.x + self.xy * v.y) + self.xz * v.z,
            (self.xy * v.x + self.yy * v.y) + self.yz * v.z,
            (self.xz * v.x + self.yz * v.y) + self.zz * v.z,
        )
    }

    /// The adjugate times `v`: the inverse but for its length.
    fn adjugate_times(&self, v: &Vec3) -> Vec3 {
        let adjugate = Self {
            xx: self.yy * self.zz - self.yz * self.yz,
            yy: self.xx * self.zz - self.xz * self.xz,
            zz: self.xx * self.yy - self.xy * self.xy,
            xy: self.xz * self.yz - self.xy * self.zz,
            xz: self.xy * self.yz - self.xz * self.yy,
            yz: self.xy * self.xz - self.yz * self.xx,
        };
        adjugate.times(v)
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            xx: self.xx + other.xx,
            yy: self.yy + other.yy,
            zz: self.zz + other.zz,
            xy: self.xy + other.xy,
            xz: self.xz + other.xz,
            yz: self.yz + other.yz,
        }
    }
}

/// Two ellipsoids and their relative position, in units of the pair's length.
struct Ellipsoids<'a> {
    bodies: [&'a Posed<'a>; 2],
    a: Symmetric,
    b: Symmetric,
    r: Vec3,
    /// `ϱ_A + ϱ_B`: a minimum below this is the global one.
    certain: f64,
}

/// `δ` and its derivatives along one direction.
#[derive(Clone, Copy)]
struct Evaluation {
    normal: Vec3,
    /// Support point of A, and of B's mirror image at its centre (which is B).
    on_a: Vec3,
    on_b: Vec3,
    /// `1 / h_A`, `1 / h_B`.
    inverse_a: f64,
    inverse_b: f64,
    /// `δ`
    delta: f64,
    /// Gradient of `δ` on the sphere.
    gradient: Vec3,
}

/// The Hessian of `h_A + h_B`, which has no part along the normal.
struct Hessian {
    entries: Symmetric,
    /// Sum and product of its two eigenvalues on the tangent plane.
    trace: f64,
    product: f64,
}

impl Hessian {
    /// Newton's step `-(H - shift)⁻¹ g` on the tangent plane, by `W⁻¹ = (tr W - W) / det W` there.
    #[inline]
    fn step(&self, gradient: &Vec3, shift: f64) -> Vec3 {
        let determinant = (self.product - shift * self.trace) + shift * shift;
        (self.entries.times(gradient) - gradient * (self.trace - shift)) / determinant
    }

    /// Newton's own shift is `δ`, wherever its step leads downhill. Elsewhere a little less than the product
    /// over the sum of the eigenvalues, which is below both of them.
    #[inline]
    fn shift(&self, delta: f64) -> f64 {
        if self.exceeds(delta, 0.0) { delta } else { 0.9 * (self.product / self.trace) }
    }

    /// Are both eigenvalues of `H - shift` on the tangent plane positive? `slack`, a small number, lets
    /// the product be that much below zero relative to the square of the sum.
    #[inline]
    fn exceeds(&self, shift: f64, slack: f64) -> bool {
        let determinant = (self.product - shift * self.trace) + shift * shift;
        determinant > -slack * (self.trace * self.trace) && 2.0 * shift < self.trace
    }
}

/// Where Newton's method ended.
enum Minimum {
    /// With this clearance.
    Apart(f64),
    At(Touch),
    Failed(Why),
}

impl<'a> Ellipsoids<'a> {
    fn new(a: &'a Posed<'a>, b: &'a Posed<'a>, r: &Vec3, per_metre: f64) -> Self {
        Self {
            bodies: [a, b],
            a: Symmetric::of(a, per_metre),
            b: Symmetric::of(b, per_metre),
            r: r * per_metre,
            certain: (least_curvature_radius(a.shape) + least_curvature_radius(b.shape))
                * per_metre,
        }
    }

    /// `(A + B)⁻¹ r`: the normal of two spheres, and of ellipsoids of one form and orientation that touch.
    fn cold_start(&self) -> Option<Vec3> {
        let along = self.a.plus(&self.b).adjugate_times(&self.r);
        let squared = along.norm_squared();
        (squared > 0.0).then(|| along / squared.sqrt())
    }

    fn resolve(&self, start: &Vec3) -> Outcome {
        let mut best = match self.minimise(start) {
            Minimum::Apart(clearance) => return Outcome::Apart(clearance),
            Minimum::At(touch) if touch.overlap < self.certain => return touch.outcome(),
            Minimum::At(touch) => Ok(touch),
            Minimum::Failed(why) => Err(why),
        };
        for body in self.bodies {
            for axis in body.frame.column_iter() {
                for start in [axis.into_owned(), -axis] {
                    match self.minimise(&start) {
                        Minimum::Apart(clearance) => return Outcome::Apart(clearance),
                        Minimum::At(touch) if best.is_ok_and(|b| b.overlap <= touch.overlap) => {}
                        Minimum::At(touch) => best = Ok(touch),
                        Minimum::Failed(_) => {}
                    }
                }
            }
        }
        best.map_or_else(Outcome::Failed, Touch::outcome)
    }

    #[inline]
    fn evaluate(&self, normal: Vec3) -> Evaluation {
        let (a, b) = (self.a.times(&normal), self.b.times(&normal));
        let (qa, qb) = (normal.dot(&a), normal.dot(&b));
        let inverse = 1.0 / (qa * qb);
        let (ha, hb) = (qa.sqrt(), qb.sqrt());
        let (inverse_a, inverse_b) = (ha * (qb * inverse), hb * (qa * inverse));
        let (on_a, on_b) = (a * inverse_a, b * inverse_b);
        let delta = (ha + hb) - normal.dot(&self.r);
        let gradient = ((on_a + on_b) - self.r) - normal * delta;
        Evaluation { normal, on_a, on_b, inverse_a, inverse_b, delta, gradient }
    }

    #[inline]
    fn hessian(&self, e: &Evaluation) -> Hessian {
        let (a, b, p, q) = (&self.a, &self.b, &e.on_a, &e.on_b);
        let entry = |a: f64, b: f64, i: usize, j: usize| {
            (a - p[i] * p[j]) * e.inverse_a + (b - q[i] * q[j]) * e.inverse_b
        };
        let h = Symmetric {
            xx: entry(a.xx, b.xx, 0, 0),
            yy: entry(a.yy, b.yy, 1, 1),
            zz: entry(a.zz, b.zz, 2, 2),
            xy: entry(a.xy, b.xy, 0, 1),
            xz: entry(a.xz, b.xz, 0, 2),
            yz: entry(a.yz, b.yz, 1, 2),
        };
        let product = ((h.xx * h.yy - h.xy * h.xy) + (h.xx * h.zz - h.xz * h.xz))
            + (h.yy * h.zz - h.yz * h.yz);
        Hessian { entries: h, trace: (h.xx + h.yy) + h.zz, product }
    }

    /// Goes downhill from `start`, a unit vector.
    fn minimise(&self, start: &Vec3) -> Minimum {
        let mut here = self.evaluate(*start);
        let mut evaluations = 1;
        if here.delta <= 0.0 {
            return Minimum::Apart(-here.delta);
        }
        if !here.delta.is_finite() {
            return Minimum::Failed(Why::NotFinite);
        }
        loop {
            let hessian = self.hessian(&here);
            let shift = hessian.shift(here.delta);
            let mut step = hessian.step(&here.gradient, shift);
            let squared = step.norm_squared();
            if squared > LONGEST_STEP * LONGEST_STEP {
                step *= LONGEST_STEP / squared.sqrt();
            }
            let mut slope = here.gradient.dot(&step);
            here = loop {
                if evaluations == EVALUATIONS {
                    return Minimum::Failed(Why::NoConvergence);
                }
                let there = self.evaluate((here.normal + step).normalize());
                evaluations += 1;
                if there.delta <= 0.0 {
                    return Minimum::Apart(-there.delta);
                }
                if there.delta <= (here.delta + SUFFICIENT * slope) + ROUNDING {
                    break there;
                }
                step *= 0.5;
                slope *= 0.5;
            };
            if step.norm_squared() < LAST_STEP * LAST_STEP {
                return if hessian.exceeds(here.delta, FLAT) {
                    Minimum::At(self.corrected(&here, &hessian))
                } else {
                    // A saddle or a maximum: the bodies are too deep in each other for this start.
                    Minimum::Failed(Why::TooDeep)
                };
            }
        }
    }

    /// The touch after one more step with the last Hessian. Support points follow their own
    /// body's compliance, which keeps the contact point quiet where a surface is nearly flat.
    fn corrected(&self, e: &Evaluation, hessian: &Hessian) -> Touch {
        let newton = hessian.step(&e.gradient, e.delta);
        // A minimum that is flat to rounding has no better point.
        let small = newton.norm_squared() < LAST_STEP * LAST_STEP;
        let step = if small { newton } else { Vec3::zeros() };
        let follow = |shape: &Symmetric, point: &Vec3, inverse: f64| {
            point + (shape.times(&step) - point * point.dot(&step)) * inverse
        };
        let on_a = follow(&self.a, &e.on_a, e.inverse_a);
        let on_b = follow(&self.b, &e.on_b, e.inverse_b);
        Touch {
            overlap: e.delta + 0.5 * e.gradient.dot(&step),
            normal: (e.normal + step).normalize(),
            point: ((on_a - on_b) + self.r) * 0.5,
        }
    }
}

/// Smallest radius of curvature anywhere on an ellipsoid or sphere [m]: shortest² / longest.
fn least_curvature_radius(shape: &Shape) -> f64 {
    let shortest = shape.inscribed_radius();
    shortest * shortest / shape.bounding_radius()
}
