//! Powers with the same bits on every machine.
//!
//! `f64::powf` calls the mathematics library of the machine, and libraries round differently. This function uses `+ - * /` and the bits of a
//! number alone, and has no branch and no table. It costs a fraction of a correctly rounded power. The powers of a superellipsoid are factors
//! of lengths, so the relevant error is relative to 1, not to the power itself.
//!
//! Two powers at once take hardly longer than one. They share vector registers, which every processor has; separately, each operation would
//! wait for the previous one. Closures are not used, because not all of them would be inlined.

#![expect(clippy::inline_always, reason = "a vector stays in registers only if nothing is called")]

use std::ops::{Add, Div, Mul, Sub};

/// Smallest mantissa: `√½`, rounded. A lower one belongs to the next lower power of two.
const FIRST_MANTISSA: u64 = 0x3fe6_a09e_667f_3bcd;
/// Adding and subtracting this number rounds to whole numbers: 1.5 · 2⁵².
const ROUNDER: f64 = 6_755_399_441_055_744.0;
/// 2⁵²: the lowest bits of its sum with a whole number are that number.
const WHOLE: f64 = 4_503_599_627_370_496.0;
/// Offset of exponents that makes them positive.
const RAISED: u64 = 1024;

/// Numbers that are computed alike, each by itself: their number does not change the bits.
#[derive(Clone, Copy)]
pub(super) struct Lanes<const N: usize>(pub(super) [f64; N]);

macro_rules! lanewise {
    ($trait:ident, $method:ident, $operator:tt) => {
        impl<const N: usize> $trait for Lanes<N> {
            type Output = Self;

            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for (x, y) in self.0.iter_mut().zip(other.0) {
                    *x $operator y;
                }
                self
            }
        }
    };
}
lanewise!(Add, add, +=);
lanewise!(Sub, sub, -=);
lanewise!(Mul, mul, *=);
lanewise!(Div, div, /=);

impl<const N: usize> Lanes<N> {
    /// The given number in every lane.
    #[inline(always)]
    pub(super) const fn all(number: f64) -> Self {
        Self([number; N])
    }

    /// This value in lanes where `x` is at most `y`, that of `other` elsewhere.
    #[inline(always)]
    pub(super) fn where_at_most(mut self, x: Self, y: Self, other: Self) -> Self {
        let sides = x.0.into_iter().zip(y.0);
        for ((this, other), (x, y)) in self.0.iter_mut().zip(other.0).zip(sides) {
            *this = if x <= y { *this } else { other };
        }
        self
    }
}

/// `base ^ exponent` for a normal `base` in (0, 2] and a result of at most 2.
///
/// It is zero if the result were below 2⁻¹⁰²², `base` is zero or `exponent` infinite.
///
/// Relative error at most `2 (1 + |log₂ result|) 2⁻⁵³`: a unit in the last place near 1.
#[inline(always)]
pub(super) fn pow<const N: usize>(base: Lanes<N>, exponent: Lanes<N>) -> Lanes<N> {
    let exponential = exp2(exponent * log2(base));
    exponential.where_at_most(Lanes::all(f64::MIN_POSITIVE), base, Lanes::all(0.0))
}

/// Binary logarithm of a normal positive number: that of the mantissa, plus the exponent.
///
/// With the mantissa m in √½..√2 it is `2 atanh((m - 1) / (m + 1)) / ln 2`, by its series.
#[inline(always)]
fn log2<const N: usize>(x: Lanes<N>) -> Lanes<N> {
    const SCALE: f64 = 2.0 * std::f64::consts::LOG2_E;
    let (mut mantissa, mut exponent) = (x, x);
    for (mantissa, exponent) in mantissa.0.iter_mut().zip(&mut exponent.0) {
        let bits = mantissa.to_bits();
        let raised = bits.wrapping_sub(FIRST_MANTISSA).wrapping_add(RAISED << 52) >> 52;
        *mantissa = f64::from_bits(bits.wrapping_add(RAISED.wrapping_sub(raised) << 52));
        *exponent = f64::from_bits(WHOLE.to_bits() | raised);
    }
    let exponent = exponent - Lanes::all(WHOLE + RAISED as f64);
    let one = Lanes::all(1.0);
    let s = (mantissa - one) / (mantissa + one);
    // s² is at most 0.0295, so the first omitted term is 2⁻⁵⁵ of the sum.
    let z = s * s;
    let z4 = (z * z) * (z * z);
    let low = polynomial(INVERSE_ODD, z);
    let high = Lanes::all(1.0 / 19.0) + z * Lanes::all(1.0 / 21.0);
    let series = s + (s * z) * (low + (z4 * z4) * high);
    exponent + series * Lanes::all(SCALE)
}

/// Two to the `x`, for `x` up to 1: the series of `e^(f ln 2)` for the fraction f in -½..½, times a power of two.
#[inline(always)]
fn exp2<const N: usize>(x: Lanes<N>) -> Lanes<N> {
    const LOWEST: f64 = -1022.0;
    let rounder = Lanes::all(ROUNDER);
    let shifted = x + rounder;
    let f = (x - (shifted - rounder)) * Lanes::all(std::f64::consts::LN_2);
    // |f| is at most 0.347, so the first omitted term is 2⁻⁶⁸.
    let ff = f * f;
    let odd = f * polynomial(INVERSE_ODD_FACTORIALS, ff);
    let even = ff * polynomial(INVERSE_EVEN_FACTORIALS, ff);
    let mut power = shifted;
    for power in &mut power.0 {
        *power = f64::from_bits((power.to_bits() << 52).wrapping_add(1.0_f64.to_bits()));
    }
    let result = (Lanes::all(1.0) + (odd + even)) * power;
    result.where_at_most(Lanes::all(LOWEST), x, Lanes::all(0.0))
}

/// 1/3, 1/5, ... 1/17.
const INVERSE_ODD: [f64; 8] =
    [1.0 / 3.0, 1.0 / 5.0, 1.0 / 7.0, 1.0 / 9.0, 1.0 / 11.0, 1.0 / 13.0, 1.0 / 15.0, 1.0 / 17.0];
/// 1/2!, 1/4!, ... 1/16!.
const INVERSE_EVEN_FACTORIALS: [f64; 8] = [
    1.0 / 2.0,
    1.0 / 24.0,
    1.0 / 720.0,
    1.0 / 40_320.0,
    1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    1.0 / 87_178_291_200.0,
    1.0 / 20_922_789_888_000.0,
];
/// 1/1!, 1/3!, ... 1/15!.
const INVERSE_ODD_FACTORIALS: [f64; 8] = [
    1.0,
    1.0 / 6.0,
    1.0 / 120.0,
    1.0 / 5040.0,
    1.0 / 362_880.0,
    1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    1.0 / 1_307_674_368_000.0,
];

/// Polynomial with these coefficients, lowest first, in Estrin's order, which is the shortest chain of operations.
#[inline(always)]
fn polynomial<const N: usize>(coefficients: [f64; 8], x: Lanes<N>) -> Lanes<N> {
    let c = coefficients.map(Lanes::all);
    let xx = x * x;
    let low = (c[0] + c[1] * x) + (c[2] + c[3] * x) * xx;
    let high = (c[4] + c[5] * x) + (c[6] + c[7] * x) * xx;
    low + high * (xx * xx)
}

#[cfg(test)]
mod tests {
    use super::Lanes;

    /// The power, checked to be the same next to any other.
    fn pow(base: f64, exponent: f64) -> f64 {
        let [alone] = super::pow(Lanes([base]), Lanes([exponent])).0;
        let [beside, _] = super::pow(Lanes([base, 0.7]), Lanes([exponent, 1.3])).0;
        assert_eq!(alone.to_bits(), beside.to_bits());
        alone
    }

    /// Comparison with the `libm` crate, to a unit in the last place, and bit for bit with a stored hash of all results.
    #[test]
    fn powers() {
        let mut hash: u64 = 0;
        for i in 1..20_000 {
            let fraction = f64::from(i) * 0.618_033_988_749_895 % 1.0;
            let base = 2.0 * fraction * libm::exp2(-f64::from(i % 50));
            for e in [0.1, 0.3, 0.5, 0.8, 1.2, 1.5, 1.9] {
                let exponents = [e / (2.0 - e), if base < 1.0 { e } else { -0.5 * e }];
                for exponent in exponents {
                    let (found, expected) = (pow(base, exponent), libm::pow(base, exponent));
                    if expected < f64::MIN_POSITIVE {
                        assert!(found <= f64::MIN_POSITIVE);
                        continue;
                    }
                    let bound = (1.5 + libm::log2(expected).abs()) * f64::EPSILON;
                    let error = (found / expected - 1.0).abs();
                    assert!(error <= bound, "{base:e} ^ {exponent}: {error:e} of {bound:e}");
                    hash = hash.rotate_left(1) ^ found.to_bits();
                }
            }
        }
        assert_eq!(hash, 0x61bf_cca8_9d49_f85b, "{hash:#x}");
    }

    #[test]
    fn limits() {
        assert_eq!(pow(0.0, 0.5), 0.0);
        assert_eq!(pow(1.0, 1e300), 1.0);
        // Edges of an octahedron: a superellipsoid's exponent of 2.
        assert_eq!([pow(0.0, f64::INFINITY), pow(1.0, f64::INFINITY)], [0.0; 2]);
        assert_eq!(pow(0.5, 2000.0), 0.0, "below the normal numbers");
        assert_eq!(pow(0.5, 3.0), 0.125);
        assert_eq!(pow(2.0, 1.0), 2.0);
        assert!((pow(2.0, -0.5) - 0.5_f64.sqrt()).abs() <= 0.5 * f64::EPSILON);
    }
}
