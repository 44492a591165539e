//! Sums that do not depend on the order of their terms: terms are rounded to multiples of a quantum, and these are counted.
//!
//! The quantum follows from the sum of the normal stresses in the step before, which is the same on every rank. A rounding error
//! is at most 2^-46 of that sum. Terms that are too large for the quantum are added to an [`ExactSum`].

use crate::math::ExactSum;
use crate::measure::COMPONENTS;

/// Quanta in that sum, at least.
const QUANTA: f64 = (1_u64 << 45) as f64;
/// Terms of fewer quanta are counted.
const MOST: f64 = (1_u64 << 51) as f64;
/// Added to a number below [`MOST`], it leaves the nearest whole number in the last bits.
const TO_WHOLE: f64 = 1.5 * (1_u64 << 52) as f64;

/// Numbers of quanta in the components of a stress.
#[derive(Clone, Debug)]
pub(super) struct Whole {
    quantum: f64,
    /// One over the quantum; infinite without one.
    per_quantum: f64,
    counts: [i128; COMPONENTS.len()],
}

impl Whole {
    /// The quantum for sums of this size; 0 if there is none.
    pub(super) fn quantum(size: f64) -> f64 {
        const EXPONENT: u64 = 0x7ff << 52;
        let quantum = f64::from_bits(size.to_bits() & EXPONENT) / QUANTA;
        if quantum.is_normal() && (1.0 / quantum).is_normal() { quantum } else { 0.0 }
    }

    /// Empty sums with this quantum.
    pub(super) fn of(quantum: f64) -> Self {
        Self { quantum, per_quantum: 1.0 / quantum, counts: [0; COMPONENTS.len()] }
    }

    /// Adds a term to each component.
    #[inline]
    pub(super) fn add(&mut self, terms: [f64; COMPONENTS.len()], exact: &mut [ExactSum]) {
        let quanta = terms.map(|term| term * self.per_quantum);
        let sum: f64 = quanta.iter().map(|quanta| quanta.abs()).sum();
        // The comparison is false for what is not a number.
        if sum < MOST {
            for (count, quanta) in self.counts.iter_mut().zip(quanta) {
                let whole = (quanta + TO_WHOLE).to_bits() as i64 - TO_WHOLE.to_bits() as i64;
                *count += i128::from(whole);
            }
        } else {
            exact.iter_mut().zip(terms).for_each(|(sum, term)| super::add(sum, term));
        }
    }

    /// Adds what was counted to exact sums.
    pub(super) fn finish(&self, exact: &mut [ExactSum]) {
        const HALF: u32 = 40;
        for (sum, count) in exact.iter_mut().zip(self.counts) {
            let low = count & ((1 << HALF) - 1);
            let high = (count >> HALF) as f64 * (1_u64 << HALF) as f64;
            super::add(sum, high * self.quantum);
            super::add(sum, low as f64 * self.quantum);
        }
    }
}
