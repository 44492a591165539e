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
    /// Lowest corner, from which the edges go [m].
    origin: Vec3,
    /// The corner opposite to it where the edges are along the axes [m].
    high: Vec3,
    periodic: [bool; 3],
    /// Length of the period along each axis, infinite where there is none [m].
    period: Vec3,
    /// Are the images where the edges are?
    images: Images,
}

/// Where the images of a cell are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum Images {
    /// Along its edges, which are along the axes.
    Square,
    /// They slide along each other. Both axes repeat.
    Slide(Sliding),
}

/// A box that reaches out of the cell along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// Which axis.
    pub axis: &'static str,
    /// From where to where the box is along it [m].
    pub place: [f64; 2],
    /// From where to where the cell is [m].
    pub ends: [f64; 2],
}

impl Beyond {
    /// Does it reach out at the upper end?
    pub fn is_above(&self) -> bool {
        self.place[1] > self.ends[1]
    }
}

/// A face of the box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// As a scene calls it: `-x`.
    pub name: &'static str,
    /// The axis across which it stands.
    pub axis: usize,
    /// A point on it [m].
    pub point: Vec3,
    /// Unit normal inwards.
    pub normal: Vec3,
    /// Is there an image behind it?
    pub repeats: bool,
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
        origin: Vec3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
        high: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        periodic: [false; 3],
        period: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        images: Images::Square,
    };

    /// Between two corners [m].
    pub fn new(low: Vec3, high: Vec3, periodic: [bool; 3]) -> Self {
        let length =
            |axis: usize| if periodic[axis] { high[axis] - low[axis] } else { f64::INFINITY };
        let period = Vec3::new(length(0), length(1), length(2));
        Self { origin: low, high, periodic, period, images: Images::Square }
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
        let mut cell = Self { images: Images::Slide(sliding), ..self };
        cell.place_images();
        Some(cell)
    }

    /// Volume between the corners [m³].
    pub fn volume(&self) -> f64 {
        self.sides().product()
    }

    /// The lowest and the highest corner [m].
    pub const fn corners(&self) -> (Vec3, Vec3) {
        (self.origin, self.high)
    }

    /// The middle between the corners [m].
    pub fn middle(&self) -> Vec3 {
        (self.origin + self.high) * 0.5
    }

    /// How long it is along each axis [m].
    pub fn sides(&self) -> Vec3 {
        self.high - self.origin
    }

    /// Distances of opposite faces [m].
    pub fn widths(&self) -> Vec3 {
        self.sides()
    }

    /// Pairs of faces with images behind them that are nearer to each other than this [m]: their axis and distance [m].
    pub fn thin(&self, least: f64) -> impl Iterator<Item = (&'static str, f64)> {
        let widths = self.widths();
        let all = self.repeating_axes().map(move |axis| (AXES[axis], widths[axis]));
        all.filter(move |&(_, width)| width < least)
    }

    /// The axes along which it repeats.
    pub fn repeating_axes(&self) -> impl Iterator<Item = usize> + use<> {
        let periodic = self.periodic;
        (0..3).filter(move |&axis| periodic[axis])
    }

    /// The axes along which it ends.
    pub fn open_axes(&self) -> impl Iterator<Item = usize> + use<> {
        let periodic = self.periodic;
        (0..3).filter(move |&axis| !periodic[axis])
    }

    /// The first axis along which it repeats and a direction has a part.
    pub fn repeats_along(&self, direction: &Vec3) -> Option<usize> {
        self.repeating_axes().find(|&axis| direction[axis] != 0.0)
    }

    /// The faces of the box.
    pub fn faces(&self) -> [Face; 6] {
        SIDES.map(|(name, axis, inwards)| Face {
            name,
            axis,
            point: if inwards > 0.0 { self.origin } else { self.high },
            normal: Vec3::ith(axis, inwards),
            repeats: self.periodic[axis],
        })
    }

    /// Along which axis a box of these corners [m] reaches out of this one first.
    pub fn beyond(&self, low: &Vec3, high: &Vec3) -> Option<Beyond> {
        self.beyond_along(0..3, low, high)
    }

    /// The same along the axes along which it repeats.
    pub fn beyond_period(&self, low: &Vec3, high: &Vec3) -> Option<Beyond> {
        self.beyond_along(self.repeating_axes(), low, high)
    }

    fn beyond_along(
        &self,
        mut axes: impl Iterator<Item = usize>,
        low: &Vec3,
        high: &Vec3,
    ) -> Option<Beyond> {
        let is_inside =
            |axis: usize| low[axis] >= self.origin[axis] && high[axis] <= self.high[axis];
        let axis = axes.find(|&axis| !is_inside(axis))?;
        Some(Beyond {
            axis: AXES[axis],
            place: [low[axis], high[axis]],
            ends: [self.origin[axis], self.high[axis]],
        })
    }

    /// A box [m] with the ends of this one where it repeats.
    pub fn with_periods(&self, mut low: Vec3, mut high: Vec3) -> (Vec3, Vec3) {
        for axis in self.repeating_axes() {
            (low[axis], high[axis]) = (self.origin[axis], self.high[axis]);
        }
        (low, high)
    }

    /// The images of a ball beside itself that come into the box [m].
    pub fn images_of_ball(&self, centre: &Vec3, radius: f64) -> Vec<Vec3> {
        let mut all = vec![*centre];
        for axis in self.repeating_axes() {
            let period = self.period[axis];
            let at_low = centre[axis] - radius < self.origin[axis];
            let at_high = centre[axis] + radius > self.high[axis];
            let shifts = [at_low.then_some(period), at_high.then_some(-period)];
            for shift in shifts.into_iter().flatten() {
                for k in 0..all.len() {
                    let mut image = all[k];
                    image[axis] = centre[axis] + shift;
                    all.push(image);
                }
            }
        }
        all.remove(0);
        all
    }

    /// How it is sheared, if it is.
    pub fn shear(&self) -> Option<Shear> {
        self.sliding().map(|sliding| sliding.shear)
    }

    /// Do its images move against it?
    #[inline]
    pub const fn moves(&self) -> bool {
        !matches!(self.images, Images::Square)
    }

    const fn sliding(&self) -> Option<&Sliding> {
        if let Images::Slide(sliding) = &self.images { Some(sliding) } else { None }
    }

    /// Shears it on for a step of `dt` [s].
    pub fn advance(&mut self, dt: f64) {
        if let Images::Slide(Sliding { shear, .. }) = &mut self.images {
            shear.strain += shear.rate * dt;
            self.place_images();
        }
    }

    /// Finds where the images are.
    fn place_images(&mut self) {
        let Self { period, images: Images::Slide(sliding), .. } = self else { return };
        let Shear { along, across, strain, .. } = sliding.shear;
        let displaced = strain * period[across];
        let turns = (displaced / period[along]).round();
        (sliding.offset, sliding.turns) = (displaced - turns * period[along], turns as i32);
    }

    /// Displacement of the image above, without whole periods: at most half of one [m].
    pub fn slid(&self) -> f64 {
        self.sliding().map_or(0.0, |sliding| sliding.offset)
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
                (place[axis] - self.origin[axis] <= way, self.period[axis]),
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
        if let Images::Slide(Sliding { shear, listed, .. }) = &mut self.images {
            *listed = shear.strain;
        }
    }

    /// How far the images have slid since the pairs were listed [m].
    pub fn slid_since_listed(&self) -> f64 {
        self.sliding().map_or(0.0, |Sliding { shear, listed, .. }| {
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

    /// Velocity of the image at this shift from a body against it [m/s].
    pub fn velocity_of_image(&self, shift: &Vec3) -> Vec3 {
        let periods =
            self.shear().map_or(0.0, |Shear { across, .. }| shift[across] / self.period[across]);
        self.velocity_above() * periods
    }

    /// How far the image above has slid so far [m]; zero if none slides.
    pub fn way_above(&self) -> Vec3 {
        let mut way = Vec3::zeros();
        if let Some(Shear { along, across, strain, .. }) = self.shear() {
            way[along] = strain * self.period[across];
        }
        way
    }

    /// The velocity of the flow at a place [m/s]: zero in the middle of the cell, and where nothing slides.
    pub fn flow_at(&self, place: &Vec3) -> Vec3 {
        let mut velocity = Vec3::zeros();
        if let Some(Shear { along, across, rate, .. }) = self.shear() {
            velocity[along] =
                rate * (place[across] - 0.5 * (self.origin[across] + self.high[across]));
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
    pub fn velocity_of_nearest_in_lanes<L: Eight>(&self, difference: Triple<L>) -> Triple<L> {
        let Some(Shear { across, .. }) = self.shear() else { return Triple::zero() };
        let Triple { x, y, z } = difference;
        let height = [x, y, z][across];
        let (zero, half) = (L::all(0.0), L::all(0.5 * self.period[across]));
        let (above, below) = (half.less(height), height.less(zero - half));
        let [x, y, z]: [f64; 3] = self.velocity_above().into();
        let upwards = Triple { x: L::all(x), y: L::all(y), z: L::all(z) };
        let downwards = Triple::zero().minus(upwards);
        downwards.or(upwards.or(Triple::zero(), below), above)
    }

    /// Which axes repeat.
    pub const fn periodic(&self) -> [bool; 3] {
        self.periodic
    }

    /// Does it repeat along any axis?
    pub fn repeats(&self) -> bool {
        self.periodic.contains(&true)
    }

    /// Lengths of the periods [m]; infinite along axes along which it does not repeat.
    pub const fn periods(&self) -> Vec3 {
        self.period
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
        if let Images::Slide(Sliding { shear: Shear { along, across, .. }, offset, .. }) =
            self.images
        {
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
        if let Images::Slide(Sliding { shear: Shear { along, across, .. }, offset, .. }) =
            self.images
        {
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
            Vec3::from_fn(|axis, _| end(axis, self.origin[axis], f64::NEG_INFINITY)),
            Vec3::from_fn(|axis, _| {
                end(axis, self.origin[axis] + self.period[axis], f64::INFINITY)
            }),
        ]
    }

    /// Brings a place [m] back in that has gone out through a periodic face by less than a period, where it is at another
    /// velocity if images slide [m/s]. Returns through how many faces it went, and whether it is out still. `image` counts
    /// whole periods.
    #[inline]
    pub fn wrap(&self, place: &mut Vec3, velocity: &mut Vec3, image: &mut [i32; 3]) -> (u32, bool) {
        let (mut faces, mut is_far) = (0, false);
        if let Images::Slide(Sliding { shear: Shear { across, .. }, .. }) = self.images {
            let (low, period) = (self.origin[across], self.period[across]);
            let x = place[across];
            let up = i32::from(x >= low + period) - i32::from(x < low);
            if up != 0 {
                self.slide(up, place, velocity, image);
            }
        }
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            let (low, period) = (self.origin[axis], self.period[axis]);
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
        let Images::Slide(Sliding { shear, offset, turns, .. }) = self.images else { return };
        place[shear.along] -= f64::from(up) * offset;
        image[shear.along] -= up * turns;
        *velocity -= self.velocity_above() * f64::from(up);
    }

    /// The same from any distance. The high faces are left alone, where rounding may have put a body until the next step.
    pub fn bring_back(&self, place: &mut Vec3, velocity: &mut Vec3, image: &mut [i32; 3]) {
        if let Images::Slide(Sliding { shear: Shear { across, .. }, .. }) = self.images {
            let (low, period) = (self.origin[across], self.period[across]);
            let x = place[across];
            if x.is_finite() && !(low..=low + period).contains(&x) {
                let up = ((x - low) / period).floor() as i32;
                self.slide(up, place, velocity, image);
            }
        }
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            let (low, period) = (self.origin[axis], self.period[axis]);
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
            ((place[axis] - self.origin[axis]) / self.period[axis]).floor()
        };
        if let Images::Slide(Sliding { shear: Shear { along, across, .. }, offset, .. }) =
            self.images
        {
            place[along] -= turns_of(&place, across) * offset;
        }
        for axis in (0..3).filter(|&axis| self.periodic[axis]) {
            place[axis] -= self.period[axis] * turns_of(&place, axis);
        }
        place
    }

    /// From a body to its images a period away at most, itself among them [m].
    pub fn shifts(&self) -> Vec<Vec3> {
        let along = |axis: usize| {
            let period = self.period[axis];
            if self.periodic[axis] { vec![-period, 0.0, period] } else { vec![0.0] }
        };
        let [x, y, z] = [along(0), along(1), along(2)];
        let mut shifts = Vec::new();
        for &i in &x {
            for &j in &y {
                shifts.extend(z.iter().map(|&k| Vec3::new(i, j, k)));
            }
        }
        if let Images::Slide(Sliding { shear: Shear { along, across, .. }, offset, .. }) =
            self.images
        {
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
        let lowest = if self.origin.amax().is_finite() { self.origin.amax() } else { 0.0 };
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
            if !self.periodic[axis] {
                return between(axis, 0.0);
            }
            let image = |k: f64| between(axis, slid + k * self.period[axis]);
            image(0.0).min(image(1.0)).min(image(-1.0))
        };
        let Images::Slide(Sliding { shear: Shear { along: flow, across, .. }, offset, .. }) =
            self.images
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
