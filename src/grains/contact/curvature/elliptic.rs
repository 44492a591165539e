//! Stiffness of an elliptic contact relative to the circular one of the same `Re = √(R' R'')`.
//!
//! `N = 4/3 E* √Re (δ / F2)^(3/2)` (Johnson 1985, *Contact Mechanics*, DOI 10.1017/CBO9781139171731, equations 4.26 to 4.32;
//! Antoine, Visa, Sauvey and Abba 2006, DOI 10.1115/1.2345413). `F2^(-3/2)` follows from complete elliptic integrals of the axis
//! ratio of the contact ellipse. That ratio follows from `R'/R''` by an equation without a closed solution.
//!
//! `F2^(-3/2)` is a smooth function of `m = (1/R' + 1/R'') / (2 √(1/R' 1/R''))`, as `R'` and `R''` may be exchanged. In
//! `z = 2 / (1 + m)`, a quotient of two polynomials of degree 10 approximates it to 5e-14 up to `R'/R''` = 10⁴ ([`LARGEST_RATIO`]).
//! The error is 1e-9 at 2·10⁴. The quotient is exact at 21 points and was computed with 60 digits.
//! `tests/contact/curvature.rs` compares it with integrals.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use crate::lanes::Lanes;

/// Largest `R'/R''` for which the fit holds.
pub const LARGEST_RATIO: f64 = 1e4;

/// Coefficients of the numerator, lowest power first.
const ABOVE: [f64; 11] = [
    1.109_566_866_990_783e-8,
    4.530_289_133_430_25e-6,
    0.000_399_209_233_921_342_67,
    0.011_756_963_018_249_06,
    0.134_800_731_430_526_32,
    0.620_472_263_908_129_9,
    1.043_750_582_574_448_2,
    0.367_280_549_270_852_6,
    -0.202_544_783_755_939_82,
    -0.032_758_332_326_077_055,
    0.005_518_034_044_896_735,
];

/// Coefficients of the denominator, lowest power first.
const BELOW: [f64; 11] = [
    6.150_149_801_472_2e-10,
    6.676_344_860_823_275e-7,
    9.814_205_665_648_976e-5,
    0.004_222_420_283_179_65,
    0.067_000_337_929_020_52,
    0.420_771_730_852_975_15,
    1.0,
    0.666_700_750_531_739_4,
    -0.133_600_940_732_022_44,
    -0.082_973_979_888_914_3,
    0.006_460_629_501_620_211,
];

/// A polynomial and its derivative, by Horner's rule.
#[inline(always)]
fn polynomial<L: Lanes>(coefficients: &[f64; 11], z: L) -> [L; 2] {
    let mut value = L::all(coefficients[10]);
    let mut derivative = value;
    for k in (1..10).rev() {
        value = value * z + L::all(coefficients[k]);
        derivative = derivative * z + value;
    }
    [value * z + L::all(coefficients[0]), derivative]
}

/// `F2^(-3/2)`, and the derivative of its logarithm with respect to `m`, from `z`.
#[inline(always)]
pub(super) fn stiffening<L: Lanes>(z: L) -> [L; 2] {
    let [above, above_by_z] = polynomial(&ABOVE, z);
    let [below, below_by_z] = polynomial(&BELOW, z);
    let inverse = L::all(1.0) / (above * below);
    let by_z = (above_by_z * below - above * below_by_z) * inverse;
    [above * above * inverse, L::all(-0.5) * (z * z) * by_z]
}

/// `F2^(-3/2)` for a ratio `R'/R''` of the principal radii of relative curvature, in either order.
pub fn stiffening_of_ratio(ratio: f64) -> f64 {
    let root = ratio.sqrt();
    // m = (root + 1 / root) / 2
    let z = 4.0 * root / ((1.0 + root) * (1.0 + root));
    stiffening(z)[0]
}
