//! Vectors, and sums that do not depend on the order of their terms.

/// A vector of three.
pub type Vec3 = nalgebra::Vector3<f64>;
/// A three-by-three matrix.
pub type Mat3 = nalgebra::Matrix3<f64>;
/// A rotation from a body's own axes to the world.
pub type Quat = nalgebra::UnitQuaternion<f64>;

/// An upper limit in messages, with three digits: rounded down, so that the printed number is allowed.
pub const fn printed_limit(limit: f64) -> f64 {
    0.995 * limit
}

/// The larger of two numbers; the first if the second is NaN.
pub fn larger_number(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// The larger of two numbers; infinite if the second is NaN.
pub fn larger_or_infinite(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}

/// Lowest and highest corner of the box around points, of which there is at least one.
pub fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    points.iter().fold((points[0], points[0]), |(low, high), p| (low.inf(p), high.sup(p)))
}

/// Rotation about a unit vector by an angle [rad], with the same bits on every machine, unlike the sine of the platform.
pub fn rotation_about(axis: &Vec3, angle: f64) -> Quat {
    let (sine, cosine) = libm::sincos(0.5 * angle);
    Quat::new_unchecked(nalgebra::Quaternion::from_parts(cosine, axis * sine))
}

/// 1,026 unit vectors that cover the sphere evenly: spherical Fibonacci points.
pub fn directions() -> impl Iterator<Item = Vec3> {
    const COUNT: u32 = 1026;
    (0..COUNT).map(|i| {
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(COUNT);
        let (sine, cosine) = libm::sincos(2.399_963_229_728_653 * f64::from(i));
        let ring = (1.0 - z * z).sqrt();
        Vec3::new(ring * cosine, ring * sine, z)
    })
}

/// A vector of three and a number, in one cache line: four numbers are added at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub struct Vec3AndNumber {
    /// Vector.
    pub vector: Vec3,
    /// Number after the vector.
    pub number: f64,
}

impl From<Vec3> for Vec3AndNumber {
    fn from(vector: Vec3) -> Self {
        Self { vector, number: 0.0 }
    }
}

/// Exact sum of any number of finite `f64`: a fixed-point number wide enough for all of them.
///
/// Terms may be added in any order and on any rank, and partial sums merged by addition of their limbs. The rounded [`ExactSum::value`] is
/// always the same. (A superaccumulator: Kulisch 2013, DOI 10.1515/9783110301793, with 32-bit digits in 64-bit limbs. Maintained crates for
/// this have no partial sums that MPI can add.)
///
/// It holds up to 2³⁰ terms between merges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExactSum {
    /// Digit `k` counts units of 2^(32 k - 1074).
    limbs: [i64; ExactSum::LIMBS],
}

impl Default for ExactSum {
    fn default() -> Self {
        Self { limbs: [0; Self::LIMBS] }
    }
}

impl ExactSum {
    /// Number of 64-bit limbs of a sum.
    pub const LIMBS: usize = 67;

    /// Adds a term.
    ///
    /// # Panics
    /// If `term` is not finite. States are checked before they are summed.
    pub fn add(&mut self, term: f64) {
        assert!(term.is_finite(), "a sum was given {term}");
        let bits = term.to_bits();
        let exponent = (bits >> 52) & 0x7ff;
        let fraction = bits & ((1 << 52) - 1);
        // Subnormal numbers have no hidden bit and the exponent of the smallest normal ones.
        let (mantissa, shift) =
            if exponent == 0 { (fraction, 0) } else { (fraction | (1 << 52), exponent - 1) };
        let first = (shift / 32) as usize;
        let mut wide = u128::from(mantissa) << (shift % 32);
        let sign = if term < 0.0 { -1 } else { 1 };
        for limb in &mut self.limbs[first..(first + 3).min(Self::LIMBS)] {
            *limb += sign * (wide & 0xffff_ffff) as i64;
            wide >>= 32;
        }
    }

    /// Limbs, which are added across ranks as integers.
    pub const fn limbs(&self) -> &[i64; Self::LIMBS] {
        &self.limbs
    }

    /// Sum with these limbs.
    ///
    /// # Panics
    /// If there are not [`ExactSum::LIMBS`] of them.
    pub fn from_limbs(limbs: &[i64]) -> Self {
        Self { limbs: limbs.try_into().expect("an exact sum has a fixed number of limbs") }
    }

    /// Values of consecutive sums, given by their limbs.
    ///
    /// # Panics
    /// If the last one is incomplete.
    pub fn values(limbs: &[i64]) -> Vec<f64> {
        limbs.chunks(Self::LIMBS).map(|limbs| Self::from_limbs(limbs).value()).collect()
    }

    /// Carries, so that every digit but the highest is in 0..2³². This makes room for more terms, and gives equal sums equal limbs.
    pub fn carry(&mut self) {
        let digits = &mut self.limbs;
        for k in 0..Self::LIMBS - 1 {
            let carry = digits[k] >> 32;
            digits[k] -= carry << 32;
            digits[k + 1] += carry;
        }
    }

    /// The sum rounded once, to the nearest `f64`, ties to even.
    pub fn value(&self) -> f64 {
        let mut carried = self.clone();
        carried.carry();
        let mut digits = carried.limbs;
        let negative = digits[Self::LIMBS - 1] < 0;
        if negative {
            for d in &mut digits {
                *d = -*d;
            }
            for k in 0..Self::LIMBS - 1 {
                let carry = digits[k] >> 32;
                digits[k] -= carry << 32;
                digits[k + 1] += carry;
            }
        }
        let Some(top) = digits.iter().rposition(|&d| d != 0) else { return 0.0 };
        // The leading 128 bits contain every bit for the rounding except one: whether any bit below is set.
        let mut wide: u128 = 0;
        let mut lowest = 0;
        for k in (0..=top).rev() {
            if (digits[k] as u128) >> 32 != 0 && k != top {
                unreachable!("digits are carried");
            }
            if wide.leading_zeros() < 32 + 8 {
                lowest = k + 1;
                break;
            }
            wide = (wide << 32) | digits[k] as u128;
            lowest = k;
        }
        let sticky = digits[..lowest].iter().any(|&d| d != 0);
        let magnitude = round_to_f64(wide, sticky, 32 * lowest as i32 - 1074);
        if negative { -magnitude } else { magnitude }
    }
}

/// Sum of `f64` rounded to 2⁻¹⁴⁰ (7e-43), in 24 bytes, for large numbers of sums.
///
/// It is the same in any order and on any rank, like an [`ExactSum`]. Sums and terms must be below 2⁵¹ (2.2e15); larger terms are left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RoundedSum {
    /// Words of the sum in units of 2⁻¹⁴⁰, the lowest first, in two's complement.
    words: [u64; RoundedSum::WORDS],
}

impl RoundedSum {
    /// Number of words of a sum.
    pub const WORDS: usize = 3;
    /// Number of 32-bit digits of a sum.
    pub const LIMBS: usize = 2 * Self::WORDS;
    /// The unit is 2 to the power of minus this number.
    const DIGITS: i32 = 140;

    /// Adds a term.
    pub fn add(&mut self, term: f64) {
        let bits = term.to_bits();
        let exponent = ((bits >> 52) & 0x7ff) as i32;
        let mantissa = bits & ((1 << 52) - 1) | 1 << 52;
        let (mantissa, shift) = match exponent - 1075 + Self::DIGITS {
            // Halves are rounded up.
            down @ -53..0 => ((mantissa + (1 << (-down - 1))) >> -down, 0),
            up @ 0..=138 => (mantissa, up),
            // Less than half of the unit, too large, or not a number.
            _ => return,
        };
        let wide = u128::from(mantissa) << (shift % 64);
        let mut size = [0; Self::WORDS];
        let first = (shift / 64) as usize;
        size[first] = wide as u64;
        if let Some(next) = size.get_mut(first + 1) {
            *next = (wide >> 64) as u64;
        }
        *self += Self { words: if term < 0.0 { negative(size) } else { size } };
    }

    /// 32-bit digits, the lowest first, the last with the sign. They are added across ranks as integers.
    pub fn limbs(&self) -> [i64; Self::LIMBS] {
        let mut limbs = [0; Self::LIMBS];
        for (digits, word) in limbs.as_chunks_mut().0.iter_mut().zip(self.words) {
            *digits = [(word & 0xffff_ffff) as i64, (word >> 32) as i64];
        }
        limbs[Self::LIMBS - 1] = self.words[Self::WORDS - 1] as i64 >> 32;
        limbs
    }

    /// Sum with these limbs.
    pub fn from_limbs(limbs: &[i64; Self::LIMBS]) -> Self {
        let (mut words, mut carry) = ([0; Self::WORDS], 0_i64);
        for (word, digits) in words.iter_mut().zip(limbs.as_chunks().0) {
            let [low, high] = digits.map(|digit: i64| {
                carry += digit;
                let kept = carry & 0xffff_ffff;
                carry >>= 32;
                kept as u64
            });
            *word = high << 32 | low;
        }
        Self { words }
    }

    /// Words of the sum, for a file.
    pub fn words(&self) -> [i64; Self::WORDS] {
        self.words.map(u64::cast_signed)
    }

    /// Sum with these words.
    pub fn from_words(words: &[i64; Self::WORDS]) -> Self {
        Self { words: words.map(i64::cast_unsigned) }
    }

    /// Value of the sum, to sixteen digits.
    pub fn value(&self) -> f64 {
        let is_negative = (self.words[Self::WORDS - 1] as i64) < 0;
        let size = if is_negative { negative(self.words) } else { self.words };
        let digits = size.iter().rev().fold(0.0, |sum, &word| sum * 2f64.powi(64) + word as f64);
        let size = digits * 2f64.powi(-Self::DIGITS);
        if is_negative { -size } else { size }
    }
}

impl std::ops::AddAssign for RoundedSum {
    fn add_assign(&mut self, other: Self) {
        let mut carries = false;
        for (word, other) in self.words.iter_mut().zip(other.words) {
            let (sum, first) = word.overflowing_add(other);
            let (sum, second) = sum.overflowing_add(u64::from(carries));
            (*word, carries) = (sum, first || second);
        }
    }
}

/// Negative in two's complement.
fn negative<const N: usize>(words: [u64; N]) -> [u64; N] {
    let mut carries = true;
    words.map(|word| {
        let (negative, carry) = (!word).overflowing_add(u64::from(carries));
        carries = carry;
        negative
    })
}

/// Nearest `f64` to `wide · 2^exponent` (plus a little more if `sticky`), ties to even.
fn round_to_f64(wide: u128, sticky: bool, exponent: i32) -> f64 {
    let bits = 128 - wide.leading_zeros() as i32;
    // Number of bits to drop: down to 53, or to the last place of the subnormal numbers.
    let drop = (bits - 53).max(-1074 - exponent);
    let (mantissa, exponent) = if drop <= 0 {
        (wide, exponent)
    } else {
        let kept = wide >> drop;
        let rest = wide & ((1u128 << drop) - 1);
        let half = 1u128 << (drop - 1);
        let up = rest > half || (rest == half && (sticky || kept & 1 == 1));
        (kept + u128::from(up), exponent + drop)
    };
    // Two exact powers of two, because one alone may leave the range of normal numbers.
    let first = exponent / 2;
    mantissa as f64 * 2f64.powi(first) * 2f64.powi(exponent - first)
}

#[cfg(test)]
mod tests {
    use super::{ExactSum, RoundedSum};

    fn sum(terms: &[f64]) -> f64 {
        let mut s = ExactSum::default();
        for &term in terms {
            s.add(term);
        }
        s.value()
    }

    #[test]
    fn single_terms_come_back() {
        for x in [0.0, 1.0, -1.0, 0.1, -1e300, f64::MAX, f64::MIN_POSITIVE, 5e-324, -3e-310, 1.5e-8]
        {
            assert_eq!(sum(&[x]), x, "{x:e}");
        }
    }

    #[test]
    fn what_cancels_cancels_exactly() {
        assert_eq!(sum(&[1e300, 1.0, -1e300]), 1.0);
        assert_eq!(sum(&[1e300, 1e-300, -1e300, -1e-300]), 0.0);
        assert_eq!(sum(&[0.1; 10]), 1.0);
        assert_eq!(sum(&[1.0, f64::EPSILON / 2.0]), 1.0, "ties go to even");
        assert_eq!(sum(&[1.0, f64::EPSILON / 2.0, 5e-324]), 1.0 + f64::EPSILON);
    }

    #[test]
    fn order_and_merging_do_not_matter() {
        let terms: Vec<f64> =
            (0..1000).map(|i| (f64::from(i) * 0.7).sin() * 10f64.powi(i % 40 - 20)).collect();
        let forward = sum(&terms);
        let backward = sum(&terms.iter().rev().copied().collect::<Vec<_>>());
        let mut halves = [ExactSum::default(), ExactSum::default()];
        terms.iter().enumerate().for_each(|(i, &t)| halves[i % 2].add(t));
        let limbs: Vec<i64> =
            halves[0].limbs().iter().zip(halves[1].limbs()).map(|(a, b)| a + b).collect();
        assert_eq!(forward.to_bits(), backward.to_bits());
        assert_eq!(forward.to_bits(), ExactSum::from_limbs(&limbs).value().to_bits());
    }

    /// In any order, in parts, and for any signs.
    #[test]
    fn rounded_sums_do_not_depend_on_order() {
        let terms: Vec<f64> =
            (0..1000).map(|k| (f64::from(k) * 0.7).sin() * 10f64.powi(k % 24 - 18)).collect();
        let rounded = |terms: &mut dyn Iterator<Item = &f64>| {
            let mut sum = RoundedSum::default();
            terms.for_each(|term| sum.add(*term));
            sum
        };
        let all = rounded(&mut terms.iter());
        assert_eq!(all, rounded(&mut terms.iter().rev()));
        let off = all.value() - sum(&terms);
        assert!(off.abs() < 1e-15 * all.value().abs(), "{off}");
        // Summation by limbs, as across ranks.
        let parts = [0, 1, 2].map(|k| rounded(&mut terms.iter().skip(k).step_by(3)).limbs());
        let limbs = std::array::from_fn(|k| parts.iter().map(|part| part[k]).sum());
        assert_eq!(RoundedSum::from_limbs(&limbs), all);
        let mut added = RoundedSum::default();
        for part in &parts {
            added += RoundedSum::from_limbs(part);
        }
        assert_eq!(added, all);
    }

    /// From half of the unit to the limit; NaN and infinite terms have no effect.
    #[test]
    fn rounded_sums_hold_large_and_small_terms() {
        let of = |terms: &[f64]| {
            let mut sum = RoundedSum::default();
            for term in terms {
                sum.add(*term);
            }
            assert_eq!(RoundedSum::from_limbs(&sum.limbs()), sum);
            assert_eq!(RoundedSum::from_words(&sum.words()), sum);
            sum.value()
        };
        let unit = 2f64.powi(-140);
        for exponent in (-140..51).step_by(7) {
            let term = 2f64.powi(exponent) * 1.234_567_890_123;
            let rounded = (term / unit).round() * unit;
            assert_eq!(of(&[term]), rounded);
            assert_eq!(of(&[-term]), -rounded);
            assert_eq!(of(&[term, -term, -term, term, -term]), -rounded);
        }
        assert_eq!(of(&[0.5 * unit, 0.49 * unit, -0.3 * unit, 0.0, 5e-324]), unit);
        assert_eq!(of(&[1e15, 3.5, -1e15]), 3.5);
        assert_eq!(of(&[2.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -3e15]), 2.0);
    }
}
