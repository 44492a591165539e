//! The box in which particles may be, and how it repeats: images, wrapping, distances across periods.
//!
//! A cell that is sheared (Lees and Edwards 1972, DOI 10.1088/0022-3719/5/15/006) keeps its edges: the images above and below
//! slide past it. They are displaced by the strain times the period, and move with the rate times the period; whoever leaves
//! through such a face comes back elsewhere and with another velocity.

use crate::lanes::{Eight, Triple};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// Names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// The sides of the box: name, axis, and the component along it of the normal inwards.
pub const SIDES: [(&str, usize, f64); 6] = [
    ("-x", 0, 1.0),
    ("+x", 0, -1.0),
    ("-y", 1, 1.0),
    ("+y", 1, -1.0),
    ("-z", 2, 1.0),
    ("+z", 2, -1.0),
];

/// A simple shear: the velocity along one axis grows along another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shear {
    /// The axis along which images slide.
    pub along: usize,
    /// The axis across which they do.
    pub across: usize,
    /// Velocity over height [1/s].
    pub rate: f64,
    /// Displacement over height so far [-].
    pub strain: f64,
}

/// A box, and which of its axes repeat.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    low: Vec3,
    high: Vec3,
    periodic: [bool; 3],
    /// Length of the period along each axis, infinite where there is none [m].
    period: Vec3,
    /// Do the images slide? Both axes repeat then.
    sheared: Option<Sliding>,
}

/// A shear, with what follows from it for the image above.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Sliding {
    shear: Shear,
    /// Displacement, without whole periods: at most half of one [m].
    offset: f64,
    /// Whole periods that were left out.
    turns: i32,
    /// The strain when the pairs were listed [-].
    listed: f64,
}

impl Cell {
    /// One without an end.
    pub const OPEN: Self = Self {
        low: Vec3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
        high: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        periodic: [false; 3],
        period: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        sheared: None,
    };

    /// Between two corners [m].
    pub fn new(low: Vec3, high: Vec3, periodic: [bool; 3]) -> Self {
        let length =
            |axis: usize| if periodic[axis] { high[axis] - low[axis] } else { f64::INFINITY };
        let period = Vec3::new(length(0), length(1), length(2));
        Self { low, high, periodic, period, sheared: None }
    }

    /// The same, sheared; `None` if both axes are one, or one of them does not repeat.
    #[must_use]
    pub fn with_shear(self, shear: Shear) -> Option<Self> {
        let Shear { along, across, strain, .. } = shear;
        let repeats = |axis: usize| self.periodic.get(axis) == Some(&true);
        if along == across || !repeats(along) || !repeats(across) {
            return None;
        }
        let sliding = Sliding { shear, offset: 0.0, turns: 0, listed: strain };
        let mut cell = Self { sheared: Some(sliding), ..self };
        cell.place_images();
        Some(cell)
    }

    /// Volume between the corners [m³].
    pub fn volume(&self) -> f64 {
        (self.high - self.low).product()
    }

    /// How it is sheared, if it is.
    pub fn shear(&self) -> Option<Shear> {
        self.sheared.map(|sliding| sliding.shear)
    }

    /// Shears it on for a step of `dt` [s].
    pub fn advance(&mut self, dt: f64) {
        if let Some(Sliding { shear, .. }) = &mut self.sheared {
            shear.strain += shear.rate * dt;
            self.place_images();
        }
    }

    /// Finds where the images are.
    fn place_images(&mut self) {
        let Self { period, sheared: Some(sliding), .. } = self else { return };
        let Shear { along, across, strain, .. } = sliding.shear;
        let displaced = strain * period[across];
        let turns = (displaced / period[along]).round();
        (sliding.offset, sliding.turns) = (displaced - turns * period[along], turns as i32);
    }

    /// Displacement of the image above, without whole periods: at most half of one [m].
    pub fn slid(&self) -> f64 {
        self.sheared.map_or(0.0, |sliding| sliding.offset)
    }

    /// The image of a place along a periodic axis that is nearest to another [m].
    pub fn image_along(&self, axis: usize, place: f64, other: f64) -> f64 {
        place - ((place - other) / self.period[axis]).round() * self.period[axis]
    }

    /// A place in the box, and where it is after a way of at most so much [m] through periods, in the same order on every rank.
    pub fn places_within(&self, place: &Vec3, way: f64) -> Vec<Vec3> {
        let mut places = vec![*place];
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            for (is_near, shift) in [
                (place[axis] - self.low[axis] <= way, self.period[axis]),
                (self.high[axis] - place[axis] <= way, -self.period[axis]),
            ] {
                let shifted = |place: &Vec3| place + Vec3::ith(axis, shift);
                if is_near {
                    let beyond: Vec<Vec3> = places.iter().map(shifted).collect();
                    places.extend(beyond);
                }
            }
        }
        places
    }

    /// Takes note that the pairs are listed now.
    pub fn note_listing(&mut self) {
        if let Some(Sliding { shear, listed, .. }) = &mut self.sheared {
            *listed = shear.strain;
        }
    }

    /// How far the images have slid since the pairs were listed [m].
    pub fn slid_since_listed(&self) -> f64 {
        self.sheared.map_or(0.0, |Sliding { shear, listed, .. }| {
            (shear.strain - listed).abs() * self.period[shear.across]
        })
    }

    /// Velocity of the image above [m/s]; zero if none slides.
    pub fn velocity_above(&self) -> Vec3 {
        let mut velocity = Vec3::zeros();
        if let Some(Shear { along, across, rate, .. }) = self.shear() {
            velocity[along] = rate * self.period[across];
        }
        velocity
    }

    /// The velocity of the flow at a place [m/s]: zero in the middle of the cell, and where nothing slides.
    pub fn flow_at(&self, place: &Vec3) -> Vec3 {
        let mut velocity = Vec3::zeros();
        if let Some(Shear { along, across, rate, .. }) = self.shear() {
            velocity[along] = rate * (place[across] - 0.5 * (self.low[across] + self.high[across]));
        }
        velocity
    }

    /// How many faces between images lie on the shortest way of a difference of two places [m], along an axis: 1 if the
    /// nearest image is the one below, -1 if it is the one above.
    #[inline]
    fn faces_between(&self, difference: f64, axis: usize) -> f64 {
        let half = 0.5 * self.period[axis];
        f64::from(i8::from(difference > half) - i8::from(difference < -half))
    }

    /// The velocity of the image that [`Cell::nearest`] takes for a difference of two places [m], against the cell's own
    /// bodies [m/s].
    #[inline]
    pub fn velocity_of_nearest(&self, difference: &Vec3) -> Vec3 {
        let Some(Shear { across, .. }) = self.shear() else { return Vec3::zeros() };
        self.velocity_above() * -self.faces_between(difference[across], across)
    }

    /// [`Self::velocity_of_nearest`] in lanes, of a difference in position [m].
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    pub fn velocity_of_nearest_in_lanes<L: Eight>(
        &self,
        shear: &Shear,
        difference: Triple<L>,
    ) -> Triple<L> {
        let across = shear.across;
        let Triple { x, y, z } = difference;
        let height = [x, y, z][across];
        let (zero, half) = (L::all(0.0), L::all(0.5 * self.period[across]));
        let (above, below) = (half.less(height), height.less(zero - half));
        let [x, y, z]: [f64; 3] = self.velocity_above().into();
        let upwards = Triple { x: L::all(x), y: L::all(y), z: L::all(z) };
        let downwards = Triple::zero().minus(upwards);
        downwards.or(upwards.or(Triple::zero(), below), above)
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
        if let Some(Sliding { shear: Shear { along, across, .. }, offset, .. }) = self.sheared {
            difference[along] -= self.faces_between(difference[across], across) * offset;
        }
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
    pub fn nearest_of<L: Eight>(&self, mut r: Triple<L>) -> Triple<L> {
        if let Some(Sliding { shear: Shear { along, across, .. }, offset, .. }) = self.sheared {
            let height = [r.x, r.y, r.z][across];
            let (half, offset) = (L::all(0.5 * self.period[across]), L::all(offset));
            let (above, below) = (half.less(height), height.less(L::all(0.0) - half));
            let slid = [&mut r.x, &mut r.y, &mut r.z];
            for (axis, x) in slid.into_iter().enumerate() {
                if axis == along {
                    *x = (*x - offset).or((*x + offset).or(*x, below), above);
                }
            }
        }
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

    /// The corners between which no place is wrapped; infinite along axes that do not repeat [m].
    pub fn wraps_outside(&self) -> [Vec3; 2] {
        let end = |axis: usize, at: f64, open: f64| if self.periodic[axis] { at } else { open };
        [
            Vec3::from_fn(|axis, _| end(axis, self.low[axis], f64::NEG_INFINITY)),
            Vec3::from_fn(|axis, _| end(axis, self.low[axis] + self.period[axis], f64::INFINITY)),
        ]
    }

    /// Brings a place [m] back in that has gone out through a periodic face by less than a period, where it is at another
    /// velocity if images slide [m/s]. Returns through how many faces it went, and whether it is out still. `image` counts
    /// whole periods.
    #[inline]
    pub fn wrap(&self, place: &mut Vec3, velocity: &mut Vec3, image: &mut [i32; 3]) -> (u32, bool) {
        let (mut faces, mut is_far) = (0, false);
        if let Some(Sliding { shear: Shear { across, .. }, .. }) = self.sheared {
            let (low, period) = (self.low[across], self.period[across]);
            let x = place[across];
            let up = i32::from(x >= low + period) - i32::from(x < low);
            if up != 0 {
                self.slide(up, place, velocity, image);
            }
        }
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

    /// What going up through faces changes beside the height, so many of them.
    #[cold]
    fn slide(&self, up: i32, place: &mut Vec3, velocity: &mut Vec3, image: &mut [i32; 3]) {
        let Some(Sliding { shear, offset, turns, .. }) = self.sheared else { return };
        place[shear.along] -= f64::from(up) * offset;
        image[shear.along] -= up * turns;
        *velocity -= self.velocity_above() * f64::from(up);
    }

    /// The same from any distance. The high faces are left alone, where rounding may have put a body until the next step.
    pub fn bring_back(&self, place: &mut Vec3, velocity: &mut Vec3, image: &mut [i32; 3]) {
        if let Some(Sliding { shear: Shear { across, .. }, .. }) = self.sheared {
            let (low, period) = (self.low[across], self.period[across]);
            let x = place[across];
            if x.is_finite() && !(low..=low + period).contains(&x) {
                let up = ((x - low) / period).floor() as i32;
                self.slide(up, place, velocity, image);
            }
        }
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
        let turns_of = |place: &Vec3, axis: usize| {
            ((place[axis] - self.low[axis]) / self.period[axis]).floor()
        };
        if let Some(Sliding { shear: Shear { along, across, .. }, offset, .. }) = self.sheared {
            place[along] -= turns_of(&place, across) * offset;
        }
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            place[axis] -= self.period[axis] * turns_of(&place, axis);
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
        if let Some(Sliding { shear: Shear { along, across, .. }, offset, .. }) = self.sheared {
            for shift in &mut shifts {
                shift[along] += shift[across] / self.period[across] * offset;
            }
        }
        shifts
    }

    /// Where a body would be without periods [m].
    pub fn unwrapped(&self, mut place: Vec3, image: &[i32; 3]) -> Vec3 {
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            place[axis] += f64::from(image[axis]) * self.period[axis];
        }
        if let Some(Shear { along, across, strain, .. }) = self.shear() {
            place[along] += f64::from(image[across]) * (strain * self.period[across]);
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
        let between = |axis: usize, shift: f64| {
            let below = one[0][axis] - (other[1][axis] + shift);
            let above = other[0][axis] + shift - one[1][axis];
            below.max(above).max(0.0)
        };
        // Of the images along an axis; where they have slid, two of them may be as near as the box itself.
        let along = |axis: usize, slid: f64| {
            self.period(axis).map_or_else(
                || between(axis, 0.0),
                |length| {
                    let image = |k: f64| between(axis, slid + k * length);
                    image(0.0).min(image(1.0)).min(image(-1.0))
                },
            )
        };
        let Some(Sliding { shear: Shear { along: flow, across, .. }, offset, .. }) = self.sheared
        else {
            return Vec3::new(along(0, 0.0), along(1, 0.0), along(2, 0.0)).norm();
        };
        let rest = along(3 - flow - across, 0.0);
        let image = |k: f64| {
            Vec3::new(along(flow, k * offset), between(across, k * self.period[across]), rest)
                .norm()
        };
        image(0.0).min(image(1.0)).min(image(-1.0))
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
            let mut velocity = Vec3::zeros();
            assert_eq!(cell.wrap(&mut place, &mut velocity, &mut image), (faces, false));
            assert_eq!(image, turns);
            assert!((place.x + 1.0).min(1.0 - place.x).min(place.z - 2.0) >= 0.0, "{place}");
            assert!((cell.unwrapped(place, &image) - out).norm() < 1e-15);
            assert_eq!(cell.nearest(place - out).norm(), 0.0);
        }
        // Far out: one face at a time is not enough.
        let (mut place, mut image) = (Vec3::new(6.5, 0.0, 3.0), [0; 3]);
        let mut velocity = Vec3::zeros();
        assert_eq!(cell.wrap(&mut place, &mut velocity, &mut image), (1, true));
        cell.bring_back(&mut place, &mut velocity, &mut image);
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
