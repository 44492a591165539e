//! The box in which particles may be, and how it repeats: images, wrapping, distances across periods.

use crate::lanes::{Eight, Triple};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// Names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// A box, and which of its axes repeat.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    low: Vec3,
    high: Vec3,
    periodic: [bool; 3],
    /// Length of the period along each axis, infinite where there is none [m].
    period: Vec3,
}

impl Cell {
    /// One without an end.
    pub const OPEN: Self = Self {
        low: Vec3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
        high: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        periodic: [false; 3],
        period: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
    };

    /// Between two corners [m].
    pub fn new(low: Vec3, high: Vec3, periodic: [bool; 3]) -> Self {
        let length =
            |axis: usize| if periodic[axis] { high[axis] - low[axis] } else { f64::INFINITY };
        Self { low, high, periodic, period: Vec3::new(length(0), length(1), length(2)) }
    }

    /// Lowest corner [m].
    pub const fn low(&self) -> Vec3 {
        self.low
    }

    /// Highest corner [m].
    pub const fn high(&self) -> Vec3 {
        self.high
    }

    /// Which axes repeat.
    pub const fn periodic(&self) -> [bool; 3] {
        self.periodic
    }

    /// Does it repeat along any axis?
    pub fn repeats(&self) -> bool {
        self.periodic.contains(&true)
    }

    /// Length of the period along an axis [m]; `None` if it does not repeat.
    pub fn period(&self, axis: usize) -> Option<f64> {
        self.periodic[axis].then_some(self.period[axis])
    }

    /// Has another cell other periods? One that begins elsewhere has the same lengths but for rounding.
    pub fn repeats_otherwise(&self, other: &Self) -> bool {
        let differs = |(a, b): (&f64, &f64)| (a - b).abs() > 1e-12 * a.min(*b);
        self.period.iter().zip(&other.period).any(differs)
    }

    /// The shortest of all images of a difference of two places [m]. Depends on positions alone, so a pair has the same
    /// bits on every rank. Periods are longer than twice the largest reach.
    #[inline]
    pub fn nearest(&self, mut difference: Vec3) -> Vec3 {
        for axis in 0..3 {
            let half = 0.5 * self.period[axis];
            if difference[axis] > half {
                difference[axis] -= self.period[axis];
            } else if difference[axis] < -half {
                difference[axis] += self.period[axis];
            }
        }
        difference
    }

    /// The same in lanes.
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    pub(crate) fn nearest_of<L: Eight>(&self, mut r: Triple<L>) -> Triple<L> {
        for (along, period) in [&mut r.x, &mut r.y, &mut r.z].into_iter().zip(&self.period) {
            if period.is_finite() {
                let (whole, half) = (L::all(*period), L::all(0.5 * period));
                let (above, below) = (half.less(*along), along.less(L::all(0.0) - half));
                *along = (*along - whole).or((*along + whole).or(*along, below), above);
            }
        }
        r
    }

    /// The way of a body from one place to another, through a periodic face or not [m].
    #[inline]
    pub fn moved(&self, from: &Vec3, to: &Vec3) -> Vec3 {
        self.nearest(to - from)
    }

    /// The image of a place [m] that is nearest to another along periodic axes.
    pub fn image_near(&self, place: &Vec3, other: &Vec3) -> Vec3 {
        let image = other + self.nearest(place - other);
        Vec3::from_fn(|axis, _| if self.periodic[axis] { image[axis] } else { place[axis] })
    }

    /// Brings a place [m] back in that has gone out through a periodic face by less than a period. Returns through how many
    /// faces it went, and whether it is out still. `image` counts whole periods.
    #[inline]
    pub fn wrap(&self, place: &mut Vec3, image: &mut [i32; 3]) -> (u32, bool) {
        let (mut faces, mut is_far) = (0, false);
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            let (low, period) = (self.low[axis], self.period[axis]);
            let x = &mut place[axis];
            if *x >= low + period {
                *x -= period;
                image[axis] += 1;
                is_far |= *x > low + period;
            } else if *x < low {
                *x += period;
                image[axis] -= 1;
                is_far |= *x < low;
            } else {
                continue;
            }
            faces += 1;
        }
        (faces, is_far)
    }

    /// The same from any distance. The high faces are left alone, where rounding may have put a body until the next step.
    pub fn bring_back(&self, place: &mut Vec3, image: &mut [i32; 3]) {
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            let (low, period) = (self.low[axis], self.period[axis]);
            let x = &mut place[axis];
            if !x.is_finite() || (low..=low + period).contains(x) {
                continue;
            }
            let turns = ((*x - low) / period).floor();
            *x = (*x - turns * period).clamp(low, low + period);
            image[axis] = image[axis].saturating_add(turns as i32);
        }
    }

    /// The image of a place [m] between the periodic faces, from any distance.
    #[must_use]
    pub fn inside(&self, mut place: Vec3) -> Vec3 {
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            let (low, period) = (self.low[axis], self.period[axis]);
            place[axis] -= period * ((place[axis] - low) / period).floor();
        }
        place
    }

    /// From a body to its images a period away at most, itself among them [m].
    pub fn shifts(&self) -> Vec<Vec3> {
        let along = |axis: usize| match self.period(axis) {
            Some(period) => vec![-period, 0.0, period],
            None => vec![0.0],
        };
        let [x, y, z] = [along(0), along(1), along(2)];
        let mut shifts = Vec::new();
        for &i in &x {
            for &j in &y {
                shifts.extend(z.iter().map(|&k| Vec3::new(i, j, k)));
            }
        }
        shifts
    }

    /// Where a body would be without periods [m].
    pub fn unwrapped(&self, mut place: Vec3, image: &[i32; 3]) -> Vec3 {
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            place[axis] += f64::from(image[axis]) * self.period[axis];
        }
        place
    }

    /// By how much the distance of two images may be rounded otherwise than that of their bodies [m].
    pub fn rounding_of_images(&self) -> f64 {
        let longest = self.period.iter().copied().filter(|length| length.is_finite());
        let lowest = if self.low.amax().is_finite() { self.low.amax() } else { 0.0 };
        4.0 * f64::EPSILON * longest.fold(lowest, f64::max)
    }

    /// Distance of two boxes from their corners, low and high, the nearest of their images [m].
    pub fn gap(&self, one: [&Vec3; 2], other: [&Vec3; 2]) -> f64 {
        let along = |axis: usize| {
            let gap = |shift: f64| {
                let below = one[0][axis] - (other[1][axis] + shift);
                let above = other[0][axis] + shift - one[1][axis];
                below.max(above).max(0.0)
            };
            let images = |length| gap(0.0).min(gap(length)).min(gap(-length));
            self.period(axis).map_or_else(|| gap(0.0), images)
        };
        Vec3::new(along(0), along(1), along(2)).norm()
    }

    /// The nearest place between two corners; along a periodic axis everything is inside [m].
    pub fn clamped(&self, place: &Vec3, low: &Vec3, high: &Vec3) -> Vec3 {
        Vec3::from_fn(|axis, _| {
            let x = place[axis];
            if self.periodic[axis] { x } else { x.max(low[axis]).min(high[axis]) }
        })
    }

    /// Is a place between two corners, but for so much slack [m]? Along a periodic axis everything is inside.
    pub fn has_within(&self, place: &Vec3, low: &Vec3, high: &Vec3, slack: f64) -> bool {
        (0..3).all(|axis| {
            let x = place[axis];
            self.periodic[axis] || (x >= low[axis] - slack && x <= high[axis] + slack)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Cell;
    use crate::math::Vec3;

    #[test]
    fn what_goes_out_comes_in_and_is_known_to_have_gone() {
        let cell =
            Cell::new(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(1.0, 0.5, 5.0), [true, false, true]);
        for (out, turns) in [
            (Vec3::new(1.25, 0.75, 3.0), [1, 0, 0]),
            (Vec3::new(-1.25, -0.75, 5.0), [-1, 0, 1]),
            (Vec3::new(0.0, 9.0, 1.5), [0, 0, -1]),
        ] {
            let (mut place, mut image) = (out, [0; 3]);
            let faces = turns.iter().filter(|&&turn: &&i32| turn != 0).count() as u32;
            assert_eq!(cell.wrap(&mut place, &mut image), (faces, false));
            assert_eq!(image, turns);
            assert!((place.x + 1.0).min(1.0 - place.x).min(place.z - 2.0) >= 0.0, "{place}");
            assert!((cell.unwrapped(place, &image) - out).norm() < 1e-15);
            assert_eq!(cell.nearest(place - out).norm(), 0.0);
        }
        // Far out: one face at a time is not enough.
        let (mut place, mut image) = (Vec3::new(6.5, 0.0, 3.0), [0; 3]);
        assert_eq!(cell.wrap(&mut place, &mut image), (1, true));
        cell.bring_back(&mut place, &mut image);
        assert_eq!((place, image), (Vec3::new(0.5, 0.0, 3.0), [3, 0, 0]));
    }

    #[test]
    fn boxes_are_near_across_a_period() {
        let cell = Cell::new(Vec3::zeros(), Vec3::repeat(4.0), [true, false, false]);
        let corners = |x: f64, y: f64| [Vec3::new(x, y, 0.0), Vec3::new(x + 0.5, y + 0.5, 1.0)];
        let (one, other) = (corners(0.0, 0.0), corners(3.0, 2.5));
        let gap = cell.gap([&one[0], &one[1]], [&other[0], &other[1]]);
        assert!((gap - 0.5_f64.hypot(2.0)).abs() < 1e-15, "{gap}");
        assert!(cell.repeats_otherwise(&Cell::OPEN) && !cell.repeats_otherwise(&cell));
    }
}
