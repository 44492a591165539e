//! Superellipsoid `(|x/a|^(2/e₂) + |y/b|^(2/e₂))^(e₂/e₁) + |z/c|^(2/e₁) = 1`.
//!
//! Barr (1981), DOI 10.1109/MCG.1981.1673799. Exponents towards 0 give boxes and cylinders with round edges, 1 gives an ellipsoid, and
//! exponents towards 2 give octahedra and double cones.
//!
//! The body is the unit ball of two nested p-norms, stretched. Its support function is therefore the dual norm, stretched, and contact
//! resolution has closed forms. The support point is the gradient of the dual norm, and the surface normal at a point is that of the norm
//! itself. The second derivatives need no other powers than the first.

#![expect(clippy::inline_always, reason = "a vector stays in registers only if nothing is called")]

use super::power::{Lanes, pow};
use super::{Convex, Ellipsoid};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;

/// A superellipsoid about the origin with its axes along x, y, z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Superellipsoid {
    semi_axes: Vec3,
    exponents: Exponents,
    bounding_radius: f64,
    inscribed_radius: f64,
    smallest_curvature_radius: f64,
}

impl Superellipsoid {
    /// Range of exponents for particles.
    ///
    /// Within it, lossless collisions conserve energy to 5e-4 at a tenth of the stable step (4e-3 in the rarest case), and better with the square
    /// of the step. Outside it, some collisions change the energy by a tenth to its double at any step: faces are flat to rounding, and edges sharp
    /// beside the overlap. `benchmarks/verification/cases/steps.rs` has the values of all pairs. A polyhedron is exact. A warning is given for bodies
    /// that rock on the flat sides of blunt shapes, see [`crate::law::stability::lost_levers`].
    pub const EXPONENTS: RangeInclusive<f64> = 0.1..=1.8;

    /// A body with these semi-axes [m] and exponents e₁ (of sections along z) and e₂ (of sections across z).
    ///
    /// # Panics
    /// If an exponent is not in (0, 2], where the body is convex. Scenes are checked before.
    pub fn new(semi_axes: Vec3, exponents: [f64; 2]) -> Self {
        let exponents = Exponents::new(exponents);
        let (bounding_radius, inscribed_radius) = exponents.radii(&semi_axes);
        let smallest_curvature_radius = if exponents.are_one() {
            Ellipsoid { semi_axes }.smallest_curvature_radius()
        } else {
            exponents.smallest_curvature_radius(&semi_axes)
        };
        Self { semi_axes, exponents, bounding_radius, inscribed_radius, smallest_curvature_radius }
    }

    /// Half the length along each local axis [m].
    pub const fn semi_axes(&self) -> Vec3 {
        self.semi_axes
    }

    /// Exponents e₁ and e₂.
    pub const fn exponents(&self) -> [f64; 2] {
        [self.exponents.along, self.exponents.across]
    }

    /// [`Convex::curved_support`] of two bodies that are not ellipsoids, at once.
    #[inline]
    pub(super) fn curved_supports(
        bodies: [&Self; 2],
        directions: [&Vec3; 2],
    ) -> [Option<CurvedSupport>; 2] {
        let (exponents, axes) = (bodies.map(|b| b.exponents), bodies.map(|b| &b.semi_axes));
        Exponents::curved_supports(exponents, axes, directions)
    }

    /// The equal ellipsoid if both exponents are 1.
    pub fn as_ellipsoid(&self) -> Option<Ellipsoid> {
        self.exponents.are_one().then_some(Ellipsoid { semi_axes: self.semi_axes })
    }
}

impl Convex for Superellipsoid {
    #[inline]
    fn support(&self, direction: &Vec3) -> Vec3 {
        match self.as_ellipsoid() {
            Some(ellipsoid) => ellipsoid.support(direction),
            None => self.exponents.support(&self.semi_axes, direction).point,
        }
    }

    /// Returns `None` for an exponent below 0.1 or above 1.99: the surface then has edges, or is as sharp as an edge.
    #[inline]
    fn curved_support(&self, direction: &Vec3) -> Option<CurvedSupport> {
        match self.as_ellipsoid() {
            Some(ellipsoid) => ellipsoid.curved_support(direction),
            None => self.exponents.curved_support(&self.semi_axes, direction),
        }
    }

    /// Returns `None` where this brings nothing: the step is short, or the exponents are not below 1.
    #[inline]
    fn follow(&self, here: &CurvedSupport, direction: &Vec3, step: &Vec3) -> Option<Vec3> {
        self.exponents.follow(|_| self.semi_axes, here, direction, step)
    }

    /// Exact.
    fn bounding_radius(&self) -> f64 {
        self.bounding_radius
    }

    /// Exact.
    fn inscribed_radius(&self) -> f64 {
        self.inscribed_radius
    }

    /// A lower bound, except for sampling, for which it is reduced by 10 %. Zero if an exponent is above 1: the surface then has crests.
    fn smallest_curvature_radius(&self) -> f64 {
        self.smallest_curvature_radius
    }

    fn volume(&self) -> f64 {
        8.0 * self.exponents.moment([0, 0, 0]) * self.semi_axes.product()
    }

    fn gyration(&self) -> Vec3 {
        let unit = self.exponents.moment([0, 0, 0]);
        let squares = [[2, 0, 0], [0, 2, 0], [0, 0, 2]];
        let mean_square = Vec3::from(squares.map(|powers| self.exponents.moment(powers) / unit))
            .component_mul(&self.semi_axes.component_mul(&self.semi_axes));
        let [x, y, z]: [f64; 3] = mean_square.into();
        Vec3::new(y + z, x + z, x + y)
    }

    fn half_lengths(&self) -> Vec3 {
        self.semi_axes
    }

    fn contains(&self, point: &Vec3) -> bool {
        self.exponents.norm(&self.semi_axes, point) <= 1.0
    }
}

/// A support point and the Hessian of the support function there.
///
/// The Hessian is given as two dyads, `Σ weight · along ⊗ along`, with both vectors across the direction. Its eigenvalues on the tangent plane
/// are the surface's radii of curvature.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurvedSupport {
    /// Support point [m].
    pub point: Vec3,
    /// Weights of the dyads [1/m], never negative.
    pub weight: [f64; 2],
    /// Vectors of the dyads [m].
    pub along: [Vec3; 2],
}

impl CurvedSupport {
    /// Curved support of a superellipsoid, from the norms of `x`, the direction times the semi-axes.
    #[inline]
    fn of(semi_axes: &Vec3, x: &Vec3, inner: &Norm, outer: &Norm) -> Self {
        let signed = Vec3::from_fn(|i, _| if x[i] < 0.0 { -semi_axes[i] } else { semi_axes[i] });
        let stretch = |v: Vec3| v.component_mul(&signed);
        let [over, up] = outer.gradient;
        let [p, q] = inner.gradient;
        let [down, out] = outer.across;
        Self {
            point: stretch(Vec3::new(over * p, over * q, up)),
            weight: [outer.bend, over * inner.bend],
            along: [
                stretch(Vec3::new(down * p, down * q, out)),
                stretch(Vec3::new(inner.across[0], inner.across[1], 0.0)),
            ],
        }
    }

    /// Product of the Hessian and a vector [m].
    #[inline]
    pub fn hessian_times(&self, v: &Vec3) -> Vec3 {
        let [p, q] = self.along;
        p * (self.weight[0] * p.dot(v)) + q * (self.weight[1] * q.dot(v))
    }

    /// The smaller of the two radii of curvature of the surface [m].
    fn smaller_curvature_radius(&self) -> f64 {
        let ([p, q], [k, l]) = (self.along, self.weight);
        let sum = k * p.norm_squared() + l * q.norm_squared();
        let product = k * l * p.cross(&q).norm_squared();
        let difference = (sum * sum - 4.0 * product).max(0.0).sqrt();
        2.0 * product / (sum + difference)
    }
}

/// Exponents of the nested norms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Exponents {
    /// Exponent e₁.
    pub(super) along: f64,
    /// Exponent e₂.
    pub(super) across: f64,
}

/// Least component of a direction in the Hessian, which is infinite across flat faces.
const FLATTEST: f64 = 1e-12;
/// Exponents of surfaces without edges and faces.
///
/// Outside this range a direction in double precision no longer determines the position of its support point.
const ROUND: RangeInclusive<f64> = 0.1..=1.99;
/// Relative change of a component of a direction over which a Hessian is no longer constant.
const BENT: f64 = 0.3;

impl Exponents {
    /// # Panics
    /// If an exponent is not in (0, 2].
    pub(super) fn new([along, across]: [f64; 2]) -> Self {
        let allowed = |e: f64| e > 0.0 && e <= 2.0;
        assert!(allowed(along) && allowed(across), "exponents {along}, {across} are not in (0, 2]");
        Self { along, across }
    }

    pub(super) fn are_one(self) -> bool {
        self.along == 1.0 && self.across == 1.0
    }

    /// Whether the body has no edges, and is nowhere as sharp as an edge.
    fn is_round(self) -> bool {
        ROUND.contains(&self.along) && ROUND.contains(&self.across)
    }

    /// Exponents of the unit ball of the dual norm: with 2/e the norm's power, `2/e' = 1/(1 - e/2)`.
    fn dual(self) -> Self {
        Self { along: 2.0 - self.along, across: 2.0 - self.across }
    }

    /// Support point of the body with these semi-axes, and its curvature.
    #[inline]
    pub(super) fn support(self, semi_axes: &Vec3, direction: &Vec3) -> CurvedSupport {
        let [support] = Self::supports([self], [semi_axes], [direction]);
        support
    }

    /// Support points of several bodies, each along its own direction.
    #[inline(always)]
    fn supports<const N: usize>(
        exponents: [Self; N],
        semi_axes: [&Vec3; N],
        directions: [&Vec3; N],
    ) -> [CurvedSupport; N] {
        let mut x = [Vec3::zeros(); N];
        let [mut x0, mut x1, mut x2, mut inner_value] = [[0.0; N]; 4];
        for k in 0..N {
            x[k] = semi_axes[k].component_mul(directions[k]);
            [x0[k], x1[k], x2[k]] = x[k].abs().into();
        }
        let inner = Norm::of(x0, x1, exponents.map(|e| e.across));
        for k in 0..N {
            inner_value[k] = inner[k].value;
        }
        let outer = Norm::of(inner_value, x2, exponents.map(|e| e.along));
        let mut supports = [CurvedSupport::default(); N];
        for k in 0..N {
            supports[k] = CurvedSupport::of(semi_axes[k], &x[k], &inner[k], &outer[k]);
        }
        supports
    }

    /// `Self::support` for a unit vector, with a finite Hessian; `None` for a body that is not round.
    #[inline]
    pub(super) fn curved_support(
        self,
        semi_axes: &Vec3,
        direction: &Vec3,
    ) -> Option<CurvedSupport> {
        if !self.is_round() {
            return None;
        }
        let here = self.support(semi_axes, direction);
        if direction.iter().all(|x| x.abs() >= FLATTEST) {
            return Some(here);
        }
        let lift = |x: f64| match x {
            x if x.abs() >= FLATTEST => x,
            x if x < 0.0 => -FLATTEST,
            _ => FLATTEST,
        };
        let beside = self.support(semi_axes, &direction.map(lift));
        Some(CurvedSupport { point: here.point, ..beside })
    }

    /// `Self::curved_support` of two bodies, which takes little longer than one.
    #[inline]
    pub(super) fn curved_supports(
        exponents: [Self; 2],
        semi_axes: [&Vec3; 2],
        directions: [&Vec3; 2],
    ) -> [Option<CurvedSupport>; 2] {
        let slanted = |direction: &Vec3| direction.iter().all(|x| x.abs() >= FLATTEST);
        if exponents.into_iter().all(Self::is_round) && directions.into_iter().all(slanted) {
            return Self::supports(exponents, semi_axes, directions).map(Some);
        }
        [0, 1].map(|k| exponents[k].curved_support(semi_axes[k], directions[k]))
    }

    /// See [`Convex::follow`]. `semi_axes` gives those around a point.
    #[inline]
    pub(super) fn follow(
        self,
        semi_axes: impl Fn(&Vec3) -> Vec3,
        here: &CurvedSupport,
        direction: &Vec3,
        step: &Vec3,
    ) -> Option<Vec3> {
        let bent = |step: f64, component: f64, e: f64| e < 1.0 && step > BENT * component;
        let (size, by) = (direction.abs(), step.abs());
        // A cap across z is flat with e₁, whatever e₂.
        let (across, by_across) = (size.x + size.y, by.x + by.y);
        if !(bent(by.x, size.x, self.across)
            || bent(by.y, size.y, self.across)
            || bent(by.z, size.z, self.along)
            || bent(by_across, across, self.along))
        {
            return None;
        }
        let point = here.point + here.hessian_times(step);
        Some(self.normal_at(&semi_axes(&point), &point))
    }

    /// Vector along the normal where the ray to `point` leaves the body with these semi-axes.
    ///
    /// It is the gradient of the norm, which is the support point of the polar body.
    #[inline]
    pub(super) fn normal_at(self, semi_axes: &Vec3, point: &Vec3) -> Vec3 {
        self.dual().support(&semi_axes.map(|a| 1.0 / a), point).point
    }

    /// Norm whose unit ball is the body with these semi-axes: the distance of `point` over that of the surface in its direction.
    pub(super) fn norm(self, semi_axes: &Vec3, point: &Vec3) -> f64 {
        let x = point.component_div(semi_axes).abs();
        let dual = self.dual();
        let [inner] = Norm::of([x.x], [x.y], [dual.across]);
        let [outer] = Norm::of([inner.value], [x.z], [dual.along]);
        outer.value
    }

    /// Farthest and least distance of the surface from the centre [m].
    ///
    /// The squared distance is linear in the squared coordinates, so both are found one norm after the other.
    pub(super) fn radii(self, semi_axes: &Vec3) -> (f64, f64) {
        let [x, y, z]: [f64; 3] = semi_axes.component_mul(semi_axes).into();
        let farthest = farthest_square(farthest_square(x, y, self.across), z, self.along);
        let nearest = nearest_square(nearest_square(x, y, self.across), z, self.along);
        (farthest.sqrt(), nearest.sqrt())
    }

    /// See [`Superellipsoid::smallest_curvature_radius`]: over one octant of a body that is not an ellipsoid.
    ///
    /// A sphere that rolls in the body with semi-axes 1 becomes an ellipsoid, in which a smaller sphere rolls. This gives a lower bound.
    pub(super) fn smallest_curvature_radius(self, semi_axes: &Vec3) -> f64 {
        const SAMPLES: u32 = 24;
        const SAFETY: f64 = 0.9;
        if self.along > 1.0 || self.across > 1.0 {
            return 0.0;
        }
        let mut least = f64::INFINITY;
        for i in 0..SAMPLES {
            for j in 0..SAMPLES - i {
                let part = Vec3::from([i, j, SAMPLES - 1 - i - j].map(|n| f64::from(n) + 0.5));
                let unit = Vec3::repeat(1.0);
                let radius = self.support(&unit, &part.normalize()).smaller_curvature_radius();
                if radius < least {
                    least = radius;
                }
            }
        }
        SAFETY * least * semi_axes.min() * (semi_axes.min() / semi_axes.max())
    }

    /// Integral of `x^i y^j z^k` over an octant of the body with semi-axes 1.
    ///
    /// Dirichlet's integrals, in Gamma functions: Jaklič, Leonardis and Solina (2000), *Segmentation and Recovery of Superquadrics*,
    /// DOI 10.1007/978-94-015-9456-1, chapter 2. Written with `Γ(1 + x)` they have no pole where the body becomes a box.
    pub(super) fn moment(self, powers: [u32; 3]) -> f64 {
        let [i, j, k] = powers.map(|power| f64::from(power) + 1.0);
        let gamma = |times: f64, e: f64| libm::tgamma(1.0 + times * (0.5 * e));
        let across = gamma(i, self.across) * gamma(j, self.across) / gamma(i + j, self.across);
        let along = gamma(i + j, self.along) * gamma(k, self.along) / gamma(i + j + k, self.along);
        across * along / (i * j * k)
    }
}

/// Norm of two non-negative numbers with power `2 / (2 - e)`, and its derivatives.
#[derive(Clone, Copy, Default)]
struct Norm {
    value: f64,
    gradient: [f64; 2],
    /// The Hessian is `bend · across ⊗ across`.
    bend: f64,
    across: [f64; 2],
}

impl Norm {
    /// Norms of several pairs.
    #[inline(always)]
    fn of<const N: usize>(x: [f64; N], y: [f64; N], e: [f64; N]) -> [Self; N] {
        let mut norms = [Self::default(); N];
        if e != [1.0; N] {
            norms = Self::with_powers(Lanes(x), Lanes(y), Lanes(e));
        }
        for k in 0..N {
            if e[k] == 1.0 {
                norms[k] = Self::euclidean(x[k], y[k]);
            }
        }
        norms
    }

    #[inline]
    fn euclidean(x: f64, y: f64) -> Self {
        let value = (x * x + y * y).sqrt();
        let bend = if value > 0.0 { 1.0 / value } else { 0.0 };
        let gradient = [x * bend, y * bend];
        Self { value, gradient, bend, across: [-gradient[1], gradient[0]] }
    }

    #[inline(always)]
    fn with_powers<const N: usize>(x: Lanes<N>, y: Lanes<N>, e: Lanes<N>) -> [Self; N] {
        let (zero, one) = (Lanes::all(0.0), Lanes::all(1.0));
        let long = y.where_at_most(x, y, x);
        let short = x.where_at_most(x, y, y);
        let ratio = zero.where_at_most(long, zero, short / long);
        // With p = ratio^(q - 1) and q the norm's power.
        let power = e / (Lanes::all(2.0) - e);
        let p = pow(ratio, power);
        let sum = one + ratio * p;
        let g = pow(sum, Lanes::all(-0.5) * e);
        let value = long * (sum * g);
        let gp = g * p;
        let bend = (power * (g * gp)) / (ratio * value);
        let gradient = [gp.where_at_most(x, y, g), g.where_at_most(x, y, gp)];
        let across = [Lanes::all(-1.0), ratio];
        let turned = [Lanes::all(-1.0) * ratio, one];
        let across = [0, 1].map(|i| across[i].where_at_most(x, y, turned[i]));
        let mut norms = [Self::default(); N];
        for (k, norm) in norms.iter_mut().enumerate() {
            *norm = Self {
                value: value.0[k],
                gradient: gradient.map(|g| g.0[k]),
                bend: bend.0[k],
                across: across.map(|a| a.0[k]),
            };
        }
        norms
    }
}

/// Largest `x² + y²` where the norm of `x / a` and `y / b` with power 2/e is 1, from `a²` and `b²`.
fn farthest_square(a: f64, b: f64, e: f64) -> f64 {
    let (large, small) = if a < b { (b, a) } else { (a, b) };
    if e < 1.0 { large * between_axes(small / large, e) } else { large }
}

/// Smallest `x² + y²` on the same curve.
fn nearest_square(a: f64, b: f64, e: f64) -> f64 {
    let (large, small) = if a < b { (b, a) } else { (a, b) };
    if e > 1.0 { small * between_axes(small / large, e) } else { small }
}

/// Extreme of `ξ^e + ratio (1 - ξ)^e` between its ends, relative to the end that it exceeds.
fn between_axes(ratio: f64, e: f64) -> f64 {
    libm::pow(1.0 + libm::pow(ratio, 1.0 / (1.0 - e).abs()), 1.0 - e)
}

#[cfg(test)]
mod tests {
    use super::Superellipsoid;
    use crate::math::Vec3;
    use crate::shape::Convex;

    /// Along curves that reach the rims of thin bodies, no curvature exceeds the bound.
    #[test]
    fn no_place_is_more_curved_than_the_bound() {
        let flat = |thickness| Vec3::new(1.0, 1.0, thickness);
        let bodies = [
            (flat(0.02), [0.9, 0.9]),
            (flat(0.01), [0.9, 0.9]),
            (flat(0.01), [1.0, 0.5]),
            (flat(0.001), [1.0, 0.3]),
            (Vec3::new(1.0, 0.1, 0.01), [1.0, 0.3]),
            (Vec3::new(2.0, 1.0, 1.0), [0.5, 0.7]),
        ];
        for (semi_axes, exponents) in bodies {
            let body = Superellipsoid::new(semi_axes, exponents);
            let mut least = f64::INFINITY;
            for i in 1..60 {
                for j in 1..60 {
                    let [a, b] = [i, j].map(|k| 10f64.powf(f64::from(k) / 10.0 - 3.0));
                    let direction = Vec3::new(1.0, a, b).component_div(&semi_axes).normalize();
                    let support = body.exponents.support(&semi_axes, &direction);
                    least = least.min(support.smaller_curvature_radius());
                }
            }
            let bound = body.smallest_curvature_radius();
            assert!(bound > 0.0 && bound <= least, "{body:?}: {bound:e} > {least:e}");
        }
    }
}
