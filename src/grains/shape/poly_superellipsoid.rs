//! Poly-superellipsoid: eight octants of superellipsoids with different semi-axes and the same exponents.
//!
//! Zhao and Zhao (2019), DOI 10.1002/nag.2951. Neighbouring octants share the semi-axes between them, so the surface is closed and convex and
//! has a continuous normal. In general its centre of mass is not where the octants meet, and its principal axes of inertia are not theirs.
//! The shape's own frame, as for every shape, is the principal one about the centre of mass.

use super::superellipsoid::Exponents;
use super::{Convex, CurvedSupport};
use crate::math::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

/// A poly-superellipsoid about its centre of mass with its principal axes of inertia along x, y, z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolySuperellipsoid {
    positive: Vec3,
    negative: Vec3,
    exponents: Exponents,
    /// Centre of mass relative to the point where the octants meet, along the octants' axes [m].
    centre: Vec3,
    /// Principal axes as columns, along the octants' axes.
    axes: Mat3,
    volume: f64,
    gyration: Vec3,
    half_lengths: Vec3,
    bounding_radius: f64,
    inscribed_radius: f64,
    smallest_curvature_radius: f64,
}

impl PolySuperellipsoid {
    /// A body with these semi-axes towards positive and negative x, y, z [m] and exponents e₁ (of sections along z) and e₂ (of sections across z).
    ///
    /// # Panics
    /// If an exponent is not in (0, 2], where the body is convex. Scenes are checked before.
    pub fn new(positive: Vec3, negative: Vec3, exponents: [f64; 2]) -> Self {
        let exponents = Exponents::new(exponents);
        let mass = Moments::of(&positive, &negative, exponents);
        let (axes, gyration) = principal(&mass.gyration);
        let mut shape = Self {
            positive,
            negative,
            exponents,
            centre: mass.centre,
            axes,
            volume: mass.volume,
            gyration,
            half_lengths: Vec3::zeros(),
            bounding_radius: 0.0,
            inscribed_radius: 0.0,
            smallest_curvature_radius: smallest_curvature_radius_of_octants(
                &positive, &negative, exponents,
            ),
        };
        shape.half_lengths = Vec3::from_fn(|i, _| {
            let axis = Vec3::ith(i, 1.0);
            shape.support(&axis)[i].max(-shape.support(&-axis)[i])
        });
        (shape.bounding_radius, shape.inscribed_radius) = shape.radii();
        shape
    }

    /// Semi-axes of the octants towards positive and towards negative x, y, z [m].
    pub const fn semi_axes(&self) -> [Vec3; 2] {
        [self.positive, self.negative]
    }

    /// Exponents e₁ and e₂.
    pub const fn exponents(&self) -> [f64; 2] {
        [self.exponents.along, self.exponents.across]
    }

    /// Centre of mass relative to the point where the octants meet, along the octants' axes [m].
    pub const fn centre(&self) -> Vec3 {
        self.centre
    }

    /// Principal axes of inertia as columns, along the octants' axes: the rotation from the shape's own frame to that of the octants.
    pub const fn axes(&self) -> Mat3 {
        self.axes
    }

    /// Semi-axes on the side of a direction or point, along the octants' axes [m].
    #[inline]
    fn around(&self, side: &Vec3) -> Vec3 {
        side.zip_zip_map(&self.positive, &self.negative, |x, p, n| if x < 0.0 { n } else { p })
    }

    /// A point in the shape's own frame, from the octants' frame.
    #[inline]
    fn inwards(&self, point: &Vec3) -> Vec3 {
        self.axes.tr_mul(&(point - self.centre))
    }

    /// A support point in the shape's own frame, from the octants' frame.
    #[inline]
    fn of_octant(&self, octant: CurvedSupport) -> CurvedSupport {
        CurvedSupport {
            point: self.inwards(&octant.point),
            along: octant.along.map(|v| self.axes.tr_mul(&v)),
            ..octant
        }
    }

    /// [`Convex::curved_support`] of two bodies at once.
    #[inline]
    pub(super) fn curved_supports(
        [a, b]: [&Self; 2],
        [to_a, to_b]: [&Vec3; 2],
    ) -> [Option<CurvedSupport>; 2] {
        let (to_a, to_b) = (a.axes * to_a, b.axes * to_b);
        let around = [&a.around(&to_a), &b.around(&to_b)];
        let [on_a, on_b] =
            Exponents::curved_supports([a.exponents, b.exponents], around, [&to_a, &to_b]);
        [on_a.map(|s| a.of_octant(s)), on_b.map(|s| b.of_octant(s))]
    }

    /// Bounding and inscribed radius, from samples of directions.
    ///
    /// If no direction is farther than θ from a sample, the support value of the sample nearest to the farthest point is at least cos θ of its
    /// distance. The support value at an angle θ from a sample is at least `h cos θ - t sin θ`, with t the distance of the support point from the
    /// direction's line. Where that is far below the least support value found, as for flat bodies, directions are sampled more densely.
    fn radii(&self) -> (f64, f64) {
        // Directions through the middles of N x N squares on the faces of a cube: θ is at most √2 / N.
        const N: u32 = 32;
        const GOOD: f64 = 0.95;
        const NARROWEST: f64 = 1e-4;
        const MOST: u32 = 300_000;
        let middle = |i: u32| f64::from(2 * i + 1) / f64::from(N) - 1.0;
        let squares = (0..6).flat_map(|face| {
            (0..N).flat_map(move |i| (0..N).map(move |j| (face, middle(i), middle(j))))
        });
        let support = |(face, x, y): (usize, f64, f64)| {
            let mut direction = Vec3::repeat(if face < 3 { 1.0 } else { -1.0 });
            direction[(face + 1) % 3] = x;
            direction[(face + 2) % 3] = y;
            let direction = direction.normalize();
            let point = self.support(&direction);
            let height = point.dot(&direction);
            (height, (point - direction * height).norm())
        };
        let cosine = |tan: f64| 1.0 / (1.0 + tan * tan).sqrt();
        let tan = std::f64::consts::SQRT_2 / f64::from(N);
        let (mut farthest, mut least) = (0.0_f64, f64::INFINITY);
        for square in squares.clone() {
            let (height, _) = support(square);
            farthest = farthest.max(height / cosine(tan));
            least = least.min(height);
        }
        let mut nearest = f64::INFINITY;
        let mut todo: Vec<_> = squares.map(|square| (square, 1.0 / f64::from(N))).collect();
        let mut taken = 0;
        while let Some(((face, x, y), half)) = todo.pop() {
            taken += 1;
            let tan = std::f64::consts::SQRT_2 * half;
            let (height, aside) = support((face, x, y));
            least = least.min(height);
            let bound = cosine(tan) * (height - tan * aside);
            let good = bound >= GOOD * least || half < NARROWEST;
            if good || taken > MOST || !bound.is_finite() {
                nearest = nearest.min(bound);
                continue;
            }
            let quarter = 0.5 * half;
            let parts = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)];
            todo.extend(parts.map(|(i, j)| ((face, x + i * quarter, y + j * quarter), quarter)));
        }
        (farthest, nearest.max(0.0))
    }
}

impl Convex for PolySuperellipsoid {
    #[inline]
    fn support(&self, direction: &Vec3) -> Vec3 {
        let along = self.axes * direction;
        self.inwards(&self.exponents.support(&self.around(&along), &along).point)
    }

    /// Returns `None` for an exponent below 0.1 or above 1.99: the surface then has edges, or is as sharp as an edge.
    #[inline]
    fn curved_support(&self, direction: &Vec3) -> Option<CurvedSupport> {
        let along = self.axes * direction;
        self.exponents.curved_support(&self.around(&along), &along).map(|s| self.of_octant(s))
    }

    #[inline]
    fn follow(&self, here: &CurvedSupport, direction: &Vec3, step: &Vec3) -> Option<Vec3> {
        let octant = CurvedSupport {
            point: self.axes * here.point + self.centre,
            along: here.along.map(|v| self.axes * v),
            ..*here
        };
        let (direction, step) = (self.axes * direction, self.axes * step);
        self.exponents
            .follow(|point| self.around(point), &octant, &direction, &step)
            .map(|normal| self.axes.tr_mul(&normal))
    }

    /// At most 1.001 times the smallest bounding radius.
    fn bounding_radius(&self) -> f64 {
        self.bounding_radius
    }

    /// At most a twentieth less than the largest inscribed radius, down to a ten thousandth of the size.
    fn inscribed_radius(&self) -> f64 {
        self.inscribed_radius
    }

    /// Sampled, and reduced by 10 %. Zero if an exponent is above 1, because the surface then has crests.
    fn smallest_curvature_radius(&self) -> f64 {
        self.smallest_curvature_radius
    }

    fn half_lengths(&self) -> Vec3 {
        self.half_lengths
    }

    fn contains(&self, point: &Vec3) -> bool {
        let point = self.axes * point + self.centre;
        self.exponents.norm(&self.around(&point), &point) <= 1.0
    }

    fn volume(&self) -> f64 {
        self.volume
    }

    fn gyration(&self) -> Vec3 {
        self.gyration
    }
}

/// Smallest radius of curvature in any octant [m].
fn smallest_curvature_radius_of_octants(
    positive: &Vec3,
    negative: &Vec3,
    exponents: Exponents,
) -> f64 {
    let mut least = f64::INFINITY;
    for octant in 0..8 {
        let side = |i: usize| if octant >> i & 1 == 0 { positive[i] } else { negative[i] };
        let semi_axes = Vec3::new(side(0), side(1), side(2));
        least = least.min(exponents.smallest_curvature_radius(&semi_axes));
    }
    least
}

/// Volume, centre of mass and inertia over mass about it, along the octants' axes.
struct Moments {
    volume: f64,
    centre: Vec3,
    gyration: Mat3,
}

impl Moments {
    /// Moments of all octants.
    ///
    /// The integral of `x^i y^j z^k` over an octant is that over the unit octant times `a^(i+1) b^(j+1) c^(k+1)`. The sum over octants is a product of
    /// sums over the two sides of each axis.
    fn of(positive: &Vec3, negative: &Vec3, exponents: Exponents) -> Self {
        let sides = |axis: usize, power: u32| {
            let (p, n) = (positive[axis], negative[axis]);
            match power {
                0 => p + n,
                1 => (p + n) * (p - n),
                _ => p * p * p + n * n * n,
            }
        };
        let moment = |powers: [u32; 3]| {
            let [x, y, z] = [0, 1, 2].map(|axis| sides(axis, powers[axis]));
            exponents.moment(powers) * (x * y * z)
        };
        let volume = moment([0, 0, 0]);
        let ones = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
        let centre = Vec3::from(ones.map(|powers| moment(powers) / volume));
        let spread = Mat3::from_fn(|i, j| {
            let powers = [0, 1, 2].map(|k| ones[i][k] + ones[j][k]);
            moment(powers) / volume - centre[i] * centre[j]
        });
        Self { volume, centre, gyration: Mat3::identity() * spread.trace() - spread }
    }
}

/// Eigenvectors (columns of a rotation) and eigenvalues of a symmetric matrix by Jacobi's method.
///
/// The method uses only `+ - * / √`, which give the same bits everywhere, and does not change a diagonal matrix.
fn principal(matrix: &Mat3) -> (Mat3, Vec3) {
    const SWEEPS: u32 = 10;
    let (mut m, mut axes) = (*matrix, Mat3::identity());
    for _ in 0..SWEEPS {
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            if m[(i, j)] == 0.0 {
                continue;
            }
            let cotangent = (m[(j, j)] - m[(i, i)]) / (2.0 * m[(i, j)]);
            let root = (1.0 + cotangent * cotangent).sqrt();
            let t = 1.0_f64.copysign(cotangent) / (cotangent.abs() + root);
            let c = 1.0 / (1.0 + t * t).sqrt();
            let mut turn = Mat3::identity();
            (turn[(i, i)], turn[(j, j)]) = (c, c);
            (turn[(i, j)], turn[(j, i)]) = (t * c, -t * c);
            m = turn.transpose() * m * turn;
            (m[(i, j)], m[(j, i)]) = (0.0, 0.0);
            axes *= turn;
        }
    }
    (axes, m.diagonal())
}
