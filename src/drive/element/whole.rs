//! Sums that do not depend on the order of their terms: terms are rounded to multiples of a quantum, and these are counted.
//!
//! The quantum follows from the sum of the normal stresses in the step before, which is the same on every rank. A rounding error
//! is at most 2^-46 of that sum. Terms that are too large for the quantum are added to an [`ExactSum`].

#![expect(clippy::inline_always, reason = "see `lanes`")]

use crate::contacts::{Visited, Visitor};
use crate::lanes::{Eight, Lanes, WIDTH};
use crate::math::ExactSum;
use crate::measure::COMPONENTS;
use crate::particles::Particles;

/// Quanta in that sum, at least.
const QUANTA: f64 = (1_u64 << 45) as f64;
/// Terms of fewer quanta are counted.
const MOST: f64 = (1_u64 << 51) as f64;
/// Added to a number below [`MOST`], it leaves the nearest whole number in the last bits.
const TO_WHOLE: f64 = 1.5 * (1_u64 << 52) as f64;

/// Number of components of a stress.
const COUNT: usize = COMPONENTS.len();

/// The quantum for sums of this size; 0 if there is none.
pub(super) fn quantum(size: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    let quantum = f64::from_bits(size.to_bits() & EXPONENT) / QUANTA;
    if quantum.is_normal() && (1.0 / quantum).is_normal() { quantum } else { 0.0 }
}

/// Components of a stress times a volume from a force and a branch, or from a momentum and a velocity.
#[inline(always)]
pub(super) fn components<L: Lanes>([x, y, z]: [L; 3], [u, v, w]: [L; 3]) -> [L; COUNT] {
    let half = L::all(0.5);
    let shear = [half * (x * v + y * u), half * (x * w + z * u), half * (y * w + z * v)];
    [x * u, y * v, z * w, shear[0], shear[1], shear[2]]
}

/// Whole numbers of quanta in the components of a stress, in columns of eight sums.
pub(super) struct Whole<'a> {
    particles: &'a Particles,
    quantum: f64,
    /// One over the quantum; infinite without one.
    per_quantum: f64,
    counts: [[f64; WIDTH]; COUNT],
    /// Sum of the squares of the terms, and number of terms.
    squares: [f64; WIDTH],
    terms: usize,
}

impl<'a> Whole<'a> {
    /// Empty sums with this quantum.
    pub(super) const fn of(quantum: f64, particles: &'a Particles) -> Self {
        Self {
            particles,
            quantum,
            per_quantum: 1.0 / quantum,
            counts: [[0.0; WIDTH]; COUNT],
            squares: [0.0; WIDTH],
            terms: 0,
        }
    }

    /// Adds a term to each component.
    #[inline]
    pub(super) fn add(&mut self, terms: [f64; COUNT]) {
        for (counts, term) in self.counts.iter_mut().zip(terms) {
            let quanta = term * self.per_quantum;
            counts[0] += (quanta + TO_WHOLE) - TO_WHOLE;
            self.squares[0] += quanta * quanta;
        }
        self.terms += 1;
    }

    /// Adds what was counted to exact sums. Returns false if the terms may be too large to be counted in this way: sums of whole
    /// numbers are exact up to 2^53.
    pub(super) fn finish(&self, exact: &mut [ExactSum]) -> bool {
        let squares: f64 = self.squares.iter().sum();
        // The comparison is false for what is not a number.
        let are_few = (squares * (COUNT * self.terms) as f64).sqrt() < 0.5 * MOST;
        if are_few {
            for (sum, counts) in exact.iter_mut().zip(&self.counts) {
                super::add(sum, counts.iter().sum::<f64>() * self.quantum);
            }
        }
        are_few
    }
}

impl Visitor for Whole<'_> {
    #[inline(always)]
    fn visit<L: Eight>(&mut self, contacts: &Visited<L>) {
        let Self { particles, per_quantum, counts, squares, terms, .. } = self;
        let Visited { bodies: [a, _], count, way, force } = *contacts;
        let mut own = 0;
        for lane in 0..count {
            own |= u8::from(a.at(lane) < particles.owned) << lane;
        }
        let branch = particles.cell.nearest_of(way);
        let of_each = components([force.x, force.y, force.z], [branch.x, branch.y, branch.z]);
        let (zero, to_whole, per_quantum) = (L::all(0.0), L::all(TO_WHOLE), L::all(*per_quantum));
        let mut square = L::load(squares);
        for (counts, term) in counts.iter_mut().zip(of_each) {
            let quanta = (term * per_quantum).or(zero, own);
            *counts = (L::load(counts) + ((quanta + to_whole) - to_whole)).store();
            square = square + quanta * quanta;
        }
        *squares = square.store();
        *terms += count;
    }
}

/// Numbers of quanta of any terms: those that are too large are added to exact sums.
pub(super) struct Slowly {
    quantum: f64,
    counts: [i128; COUNT],
}

impl Slowly {
    /// Empty sums with this quantum.
    pub(super) const fn of(quantum: f64) -> Self {
        Self { quantum, counts: [0; COUNT] }
    }

    /// Adds a term to each component.
    pub(super) fn add(&mut self, terms: [f64; COUNT], exact: &mut [ExactSum]) {
        let quanta = terms.map(|term| term * (1.0 / self.quantum));
        let sum: f64 = quanta.iter().map(|quanta| quanta.abs()).sum();
        // The comparison is false for what is not a number.
        if sum < MOST {
            for (count, quanta) in self.counts.iter_mut().zip(quanta) {
                *count += ((quanta + TO_WHOLE) - TO_WHOLE) as i128;
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
