//! Random numbers that belong to an id, not to a rank or a moment.
//!
//! A counter-based generator (ChaCha with 8 rounds) is set to the stream of an id. The random numbers of particle 17 are thus the same on any
//! rank and in any order. Only `+ - * /` and square roots follow, so the bits are the same on every machine.

use crate::math::Quat;
use nalgebra::Quaternion;
use rand_chacha::ChaCha8Rng;
use rand_core::{RngCore, SeedableRng};

/// Hash of several numbers, for random numbers: the same on any rank, in a few nanoseconds.
///
/// Each number is added to the state of SplitMix64 (Steele, Lea and Flood 2014, DOI 10.1145/2660193.2660195) and mixed as there.
pub fn mixed(numbers: &[u64]) -> u64 {
    numbers.iter().fold(0, |state, number| {
        let state = (state ^ number).wrapping_add(0x9e37_79b9_7f4a_7c15);
        let state = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let state = (state ^ (state >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        state ^ (state >> 31)
    })
}

/// Random numbers of one particle.
#[derive(Clone, Debug)]
pub struct Random(ChaCha8Rng);

impl Random {
    /// Random numbers of the particle `id` in a scene with this seed.
    pub fn of(seed: u64, id: u64) -> Self {
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        generator.set_stream(id);
        Self(generator)
    }

    /// Uniform in [0, 1), with 53 bits.
    pub fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [-1, 1).
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// A point of the unit circle, uniform over it: a uniform point of the disk by rejection, then normalised.
    pub fn on_circle(&mut self) -> [f64; 2] {
        loop {
            let (x, y) = (self.signed(), self.signed());
            let square = x * x + y * y;
            // Very near the centre the direction would have few bits.
            if (1e-6..=1.0).contains(&square) {
                let length = square.sqrt();
                return [x / length, y / length];
            }
        }
    }

    /// A rotation, uniform over all rotations: a uniform point of the unit ball in four dimensions by rejection, then normalised.
    pub fn rotation(&mut self) -> Quat {
        loop {
            let point = Quaternion::new(self.signed(), self.signed(), self.signed(), self.signed());
            let square = point.norm_squared();
            // Very near the centre the direction would have few bits.
            if (1e-6..=1.0).contains(&square) {
                return Quat::new_unchecked(point / square.sqrt());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Random, mixed};
    use crate::math::{Mat3, Vec3};

    #[test]
    fn numbers_belong_to_the_seed_and_the_id() {
        let first = |seed, id| Random::of(seed, id).unit();
        assert_eq!(first(1, 7), first(1, 7));
        assert_ne!(first(1, 7), first(1, 8));
        assert_ne!(first(1, 7), first(2, 7));
    }

    #[test]
    fn the_bits_are_the_same_on_every_machine() {
        assert_eq!(Random::of(1, 7).rotation().w.to_bits(), 0xbfb2_3c3e_c702_c7ea);
    }

    /// The first number of SplitMix64 for the seed 0, and the shares of a million ids in a hundred equal parts.
    #[test]
    fn what_is_mixed_is_even() {
        assert_eq!(mixed(&[0]), 0xe220_a839_7b1d_cdaf);
        assert_ne!(mixed(&[1, 2]), mixed(&[2, 1]));
        let mut parts = [0_u32; 100];
        for a in 0..1000 {
            for b in 0..1000 {
                parts[((mixed(&[1, 1000, a, b]) >> 32) as usize * 100) >> 32] += 1;
            }
        }
        // Six standard deviations of 10,000.
        assert!(parts.iter().all(|part| part.abs_diff(10_000) < 600), "{parts:?}");
    }

    /// Mean and second moment of a rotated axis over 20,000 particles, within five standard errors.
    #[test]
    fn rotations_are_uniform() {
        let count = 20_000;
        let axes: Vec<Vec3> =
            (0..count).map(|id| Random::of(3, id).rotation() * Vec3::x()).collect();
        let mean = axes.iter().sum::<Vec3>() / count as f64;
        let second = axes.iter().map(|a| a * a.transpose()).sum::<Mat3>() / count as f64;
        let error = 5.0 / (count as f64).sqrt();
        assert!(mean.amax() < error, "{mean}");
        assert!((second - Mat3::identity() / 3.0).amax() < error, "{second}");
    }
}
