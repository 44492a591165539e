//! The box in which particles may be, and how it repeats: images, wrapping, distances across periods.
//!
//! A cell that is sheared (Lees and Edwards 1972, DOI 10.1088/0022-3719/5/15/006) keeps its edges: the images above and below
//! slide past it. They are displaced by the strain times the period, and move with the rate times the period; whoever leaves
//! through such a face comes back elsewhere and with another velocity.
//!
//! A cell may also be carried by a homogeneous flow: its edges `H` follow `dH/dt = L H`. `H` and the velocity gradient `L` are upper
//! triangular: the first edge stays along x, the second in the plane of x and y. Velocities of bodies are then those against the flow
//! (peculiar velocities; Evans and Morriss 1984, DOI 10.1103/PhysRevA.30.1528): a body at `x` goes with `v + L x`. The bodies stand in the
//! upright box of the sides `H_xx`, `H_yy`, `H_zz`, which holds one image of each. Edges are chosen anew in each step so that their tilts
//! are at most half of a side: by whole edges, from `H` alone, so the same on every rank.

use crate::lanes::{Eight, Triple};
use crate::math::{Mat3, Vec3};
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
#[expect(clippy::large_enum_variant, reason = "a run has one")]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum Images {
    /// Along its edges, which are along the axes.
    Square,
    /// They slide along each other. Both axes repeat.
    Slide(Sliding),
    /// A flow carries the edges. All axes repeat.
    Carried(Carried),
}

/// How a flow has carried a cell.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strained {
    /// The edges, as columns; upper triangular, as carried, not chosen anew [m].
    pub edges: Mat3,
    /// Velocity gradient in the step to come; upper triangular [1/s].
    pub rate: Mat3,
    /// Sum of the velocity gradient over time so far; upper triangular [-].
    pub strain: Mat3,
}

/// A cell whose edges follow a flow, with what follows from it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Carried {
    strained: Strained,
    /// Velocity gradient in the last step [1/s].
    last_rate: Mat3,
    /// Half of the last step [s].
    half: f64,
    /// Edges of the same images with the least tilts, as columns [m].
    chosen: Mat3,
    /// How many of the first edge each of them has less than the carried one, and the third of the second: xy, xz, yz.
    turns: [i32; 3],
    /// How much nearer two bodies within reach can have come by the flow since the pairs were listed [m].
    neared: f64,
}

impl Carried {
    /// How much faster the flow was half a step ago between two bodies that now part at `parting` beside it, from how much faster it is
    /// `now` between them [m/s]. In that time they went half of their way.
    fn midway(&self, now: &Vec3, parting: &Vec3) -> Vec3 {
        now - upper(&self.last_rate, &(now + parting)) * self.half
    }

    /// The nearest images of differences between two places [m].
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    fn nearest_of<L: Eight>(&self, mut r: Triple<L>) -> Triple<L> {
        // Parts of the other edges along the first may add up to a whole one.
        for axis in [2, 1, 0, 0] {
            let edge = self.chosen.column(axis);
            let half = 0.5 * edge[axis];
            let along = [r.x, r.y, r.z][axis];
            let (above, below) = (L::all(half).less(along), along.less(L::all(-half)));
            for (x, edge) in [&mut r.x, &mut r.y, &mut r.z].into_iter().zip(edge.iter()) {
                let edge = L::all(*edge);
                *x = (*x - edge).or((*x + edge).or(*x, below), above);
            }
        }
        r
    }

    /// How much faster the flow was half a step ago over these differences in place [m], between bodies that part beside it [m/s].
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    fn faster_midway<L: Eight>(&self, r: Triple<L>, parting: Triple<L>) -> Triple<L> {
        let now = upper_of(&self.last_rate, r);
        now.minus(upper_of(&self.last_rate, now.plus(parting)).times(L::all(self.half)))
    }
}

/// Change of places in a step of a flow.
#[derive(Clone, Copy, Debug)]
pub struct Stretch {
    /// Moves places against the lowest corner; upper triangular.
    pub places: Mat3,
    /// Velocity gradient [1/s].
    pub rate: Mat3,
}

/// `r` times a matrix of which the lower triangle is zero.
#[inline]
fn upper(m: &Mat3, r: &Vec3) -> Vec3 {
    Vec3::new(m.m11 * r.x + m.m12 * r.y + m.m13 * r.z, m.m22 * r.y + m.m23 * r.z, m.m33 * r.z)
}

/// [`upper`] in lanes.
#[expect(clippy::inline_always, reason = "see `lanes`")]
#[inline(always)]
fn upper_of<L: Eight>(m: &Mat3, r: Triple<L>) -> Triple<L> {
    Triple {
        x: L::all(m.m11) * r.x + L::all(m.m12) * r.y + L::all(m.m13) * r.z,
        y: L::all(m.m22) * r.y + L::all(m.m23) * r.z,
        z: L::all(m.m33) * r.z,
    }
}

/// The inverse of an upper triangular matrix.
pub fn upper_inverse(m: &Mat3) -> Mat3 {
    let (x, y, z) = (1.0 / m.m11, 1.0 / m.m22, 1.0 / m.m33);
    let (xy, yz) = (-m.m12 * x * y, -m.m23 * y * z);
    let xz = (m.m12 * m.m23 * y - m.m13) * x * z;
    Mat3::new(x, xy, xz, 0.0, y, yz, 0.0, 0.0, z)
}

/// A box that reaches out of the cell along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// Name of the axis.
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

    /// This cell with edges that a flow carries; `None` if an axis does not repeat, or the edges are none of an upper triangular matrix with
    /// a diagonal above 0.
    #[must_use]
    pub fn with_strain(self, strained: Strained) -> Option<Self> {
        let Strained { edges, rate, strain } = strained;
        let is_upper = |m: &Mat3| m.m21 == 0.0 && m.m31 == 0.0 && m.m32 == 0.0;
        let is_sound = |m: &Mat3| is_upper(m) && m.iter().all(|x| x.is_finite());
        let is_box = edges.diagonal().iter().all(|side| *side > 0.0);
        if self.periodic != [true; 3] || ![edges, rate, strain].iter().all(is_sound) || !is_box {
            return None;
        }
        let carried = Carried {
            strained,
            last_rate: rate,
            chosen: edges,
            turns: [0; 3],
            half: 0.0,
            neared: 0.0,
        };
        let mut cell = Self { images: Images::Carried(carried), ..self };
        cell.choose_edges();
        Some(cell)
    }

    /// A cell along the axes that a flow may carry from now on; `None` if an axis does not repeat, or images slide.
    #[must_use]
    pub fn at_rest(self) -> Option<Self> {
        let (edges, zero) = (Mat3::from_diagonal(&self.period), Mat3::zeros());
        let is_square = self.images == Images::Square;
        let still = Strained { edges, rate: zero, strain: zero };
        if is_square { self.with_strain(still) } else { None }
    }

    /// How a flow has carried it, if one may.
    pub const fn strained(&self) -> Option<&Strained> {
        match &self.images {
            Images::Carried(carried) => Some(&carried.strained),
            _ => None,
        }
    }

    /// Velocity gradient of the flow in the last step, if one may carry it [1/s].
    pub const fn rate(&self) -> Option<Mat3> {
        match &self.images {
            Images::Carried(carried) => Some(carried.last_rate),
            _ => None,
        }
    }

    /// Gives the flow another velocity gradient [1/s] for the step to come.
    pub fn set_rate(&mut self, rate: &Mat3) {
        if let Images::Carried(carried) = &mut self.images {
            carried.strained.rate = *rate;
        }
    }

    /// Carries the edges on for a step of `dt` [s] in which two bodies that may touch are no farther apart than `reach` [m]. Returns what
    /// the step does to bodies, if anything. The step is that of the implicit midpoint rule.
    pub fn carry(&mut self, dt: f64, reach: f64) -> Option<Stretch> {
        let rounding = self.rounding_of_images();
        let Images::Carried(carried) = &mut self.images else { return None };
        let Carried { strained: Strained { edges, rate, strain }, last_rate, neared, .. } = carried;
        *last_rate = *rate;
        carried.half = 0.5 * dt;
        if *rate == Mat3::zeros() {
            return None;
        }
        let (half, one) = (*rate * (0.5 * dt), Mat3::identity());
        let places = upper_inverse(&(one - half)) * (one + half);
        *edges = places * *edges;
        *strain += *rate * dt;
        *neared += (places - one).norm() * reach * (1.0 + 1e-9) + 2.0 * rounding;
        let stretch = Stretch { places, rate: *rate };
        self.choose_edges();
        Some(stretch)
    }

    /// Finds the edges with the least tilts, and the box of their sides.
    fn choose_edges(&mut self) {
        let Images::Carried(Carried { strained, chosen, turns, .. }) = &mut self.images else {
            return;
        };
        let h = &strained.edges;
        let yz = (h.m23 / h.m22).round();
        let xy = (h.m12 / h.m11).round();
        let xz = ((h.m13 - yz * h.m12) / h.m11).round();
        *turns = [xy as i32, xz as i32, yz as i32];
        *chosen = *h;
        chosen.m12 = h.m12 - xy * h.m11;
        chosen.m23 = h.m23 - yz * h.m22;
        chosen.m13 = (h.m13 - yz * h.m12) - xz * h.m11;
        self.period = h.diagonal();
        self.high = self.origin + self.period;
    }

    /// The edge with a direction along this axis that is chosen among those with the same images [m].
    fn edge(&self, axis: usize) -> Vec3 {
        match &self.images {
            Images::Carried(carried) => carried.chosen.column(axis).into(),
            _ => Vec3::ith(axis, self.period[axis]),
        }
    }

    /// The edges, as columns, which are chosen so that they lean least against the axes [m].
    pub fn edges(&self) -> Mat3 {
        Mat3::from_columns(&[self.edge(0), self.edge(1), self.edge(2)])
    }

    /// An upright cell of the same sides, if the edges of this one lean.
    pub fn upright(&self) -> Option<Self> {
        matches!(self.images, Images::Carried(_))
            .then_some(Self { images: Images::Square, ..*self })
    }

    /// The place in [the upright cell](Self::upright) that has the same part of each side as a place has of each edge [m].
    pub fn in_upright(&self, place: &Vec3) -> Vec3 {
        let (edges, from) = (self.edges(), place - self.origin);
        let z = from.z / edges.m33;
        let y = (from.y - z * edges.m23) / edges.m22;
        let x = (from.x - z * edges.m13 - y * edges.m12) / edges.m11;
        let turned = Vec3::new(x - x.floor(), y - y.floor(), z - z.floor());
        self.origin + turned.component_mul(&self.period)
    }

    /// No two places are farther apart in the upright cell than this many times their distance.
    pub fn upright_over_distance(&self) -> f64 {
        let to_upright = Mat3::from_diagonal(&self.period) * upper_inverse(&self.edges());
        let sizes = to_upright.abs();
        (sizes.row_sum().max() * sizes.column_sum().max()).sqrt()
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
        let Images::Carried(carried) = &self.images else { return self.sides() };
        let to_parts = upper_inverse(&carried.chosen);
        Vec3::from_fn(|axis, _| 1.0 / to_parts.row(axis).norm())
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

    /// As [`Self::beyond`], but along the axes along which it repeats.
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

    /// May its images move against it?
    #[inline]
    pub const fn moves(&self) -> bool {
        !matches!(self.images, Images::Square)
    }

    /// Do they, in the last step or in the one to come?
    pub fn moves_now(&self) -> bool {
        match &self.images {
            Images::Square => false,
            Images::Slide(_) => self.velocity_above() != Vec3::zeros(),
            Images::Carried(Carried { strained, last_rate, .. }) => {
                strained.rate != Mat3::zeros() || *last_rate != Mat3::zeros()
            }
        }
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
        match &mut self.images {
            Images::Square => {}
            Images::Slide(Sliding { shear, listed, .. }) => *listed = shear.strain,
            Images::Carried(carried) => carried.neared = 0.0,
        }
    }

    /// How far the images have slid since the pairs were listed, or bodies that may touch have come nearer by the flow [m].
    pub fn slid_since_listed(&self) -> f64 {
        match &self.images {
            Images::Square => 0.0,
            Images::Slide(Sliding { shear, listed, .. }) => {
                (shear.strain - listed).abs() * self.period[shear.across]
            }
            Images::Carried(carried) => carried.neared,
        }
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
        if let Images::Carried(carried) = &self.images {
            return upper(&carried.last_rate, shift);
        }
        let periods =
            self.shear().map_or(0.0, |Shear { across, .. }| shift[across] / self.period[across]);
        self.velocity_above() * periods
    }

    /// How fast it is sheared: of a flow `sqrt(2 D:D)` with the deviator `D` of its rate of strain [1/s].
    pub fn shear_rate(&self) -> f64 {
        let Images::Carried(Carried { strained, .. }) = &self.images else {
            return self.shear().map_or(0.0, |shear| shear.rate.abs());
        };
        let strain = (strained.rate + strained.rate.transpose()) * 0.5;
        let deviator = strain - Mat3::identity() * (strain.trace() / 3.0);
        2.0_f64.sqrt() * deviator.norm()
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
    /// bodies [m/s]: in a flow how much faster it is where the other place is.
    #[inline]
    pub fn velocity_of_nearest(&self, difference: &Vec3) -> Vec3 {
        match &self.images {
            Images::Square => Vec3::zeros(),
            Images::Slide(Sliding { shear: Shear { across, .. }, .. }) => {
                self.velocity_above() * -self.faces_between(difference[*across], *across)
            }
            Images::Carried(carried) => upper(&carried.last_rate, &self.nearest(*difference)),
        }
    }

    /// [`Self::velocity_of_nearest`] half a step ago, where velocities are those that carry bodies through the step. `parting` is how fast the
    /// other body leaves the one, the flow left out [m/s].
    #[inline]
    pub fn velocity_of_nearest_midway(&self, difference: &Vec3, parting: &Vec3) -> Vec3 {
        let now = self.velocity_of_nearest(difference);
        match &self.images {
            Images::Carried(carried) => carried.midway(&now, parting),
            _ => now,
        }
    }

    /// As [`Self::velocity_of_nearest`], in the step to come.
    pub fn velocity_of_nearest_ahead(&self, difference: &Vec3) -> Vec3 {
        match &self.images {
            Images::Carried(carried) => upper(&carried.strained.rate, &self.nearest(*difference)),
            _ => self.velocity_of_nearest(difference),
        }
    }

    /// [`Self::velocity_of_nearest_midway`] in lanes, of a difference in position [m] and in velocity [m/s].
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    pub fn velocity_of_nearest_in_lanes<L: Eight>(
        &self,
        difference: Triple<L>,
        parting: Triple<L>,
    ) -> Triple<L> {
        let across = match &self.images {
            Images::Square => return Triple::zero(),
            Images::Slide(sliding) => sliding.shear.across,
            Images::Carried(carried) => {
                return carried.faster_midway(carried.nearest_of(difference), parting);
            }
        };
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
        if let [Images::Carried(_), Images::Carried(_)] = [self.images, other.images] {
            return false;
        }
        let differs = |(a, b): (&f64, &f64)| (a - b).abs() > 1e-12 * a.min(*b);
        self.period.iter().zip(&other.period).any(differs)
    }

    /// The shortest of all images of a difference of two places [m]. Depends on positions alone, so a pair has the same
    /// bits on every rank. Periods are longer than twice the largest reach.
    #[inline]
    pub fn nearest(&self, mut difference: Vec3) -> Vec3 {
        if let Images::Carried(Carried { chosen, .. }) = &self.images {
            // Parts of the other edges along the first may add up to a whole one.
            for axis in [2, 1, 0, 0] {
                let faces = self.faces_between(difference[axis], axis);
                difference -= chosen.column(axis) * faces;
            }
            return difference;
        }
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
        if let Images::Carried(carried) = &self.images {
            return carried.nearest_of(r);
        }
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
        if let Images::Carried(_) = &self.images {
            let (faces, is_far) = self.carry_back(place, image);
            return (faces, is_far);
        }
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

    /// As [`Self::wrap`] where a flow carries the edges: from any distance, and with one velocity everywhere.
    #[cold]
    fn carry_back(&self, place: &mut Vec3, image: &mut [i32; 3]) -> (u32, bool) {
        let Images::Carried(Carried { turns: [xy, xz, yz], .. }) = self.images else {
            return (0, false);
        };
        let mut faces = 0;
        for (axis, of_images) in [(2, [-xz, -yz, 1]), (1, [-xy, 1, 0]), (0, [1, 0, 0])] {
            let (low, high) = (self.origin[axis], self.high[axis]);
            if !place[axis].is_finite() || (low..high).contains(&place[axis]) {
                continue;
            }
            let up = ((place[axis] - low) / self.period[axis]).floor();
            *place -= self.edge(axis) * up;
            for (count, of_image) in image.iter_mut().zip(of_images) {
                *count = count.saturating_add((up as i32).saturating_mul(of_image));
            }
            faces += 1;
        }
        (faces, false)
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
        if let Images::Carried(_) = self.images {
            self.carry_back(place, image);
            return;
        }
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
        if let Images::Carried(_) = self.images {
            self.carry_back(&mut place, &mut [0; 3]);
            return place;
        }
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
        if let Images::Carried(Carried { chosen, .. }) = &self.images {
            for shift in &mut shifts {
                let [i, j, k]: [f64; 3] = shift.component_div(&self.period).into();
                let beside = j * chosen.m12 + k * chosen.m13;
                // Nearest along the first edge, as the others are.
                let turns = (beside / chosen.m11).round();
                *shift = upper(chosen, &Vec3::new(i - turns, j, k));
            }
        }
        shifts
    }

    /// Where a body would be without periods [m].
    pub fn unwrapped(&self, mut place: Vec3, image: &[i32; 3]) -> Vec3 {
        if let Images::Carried(Carried { strained, .. }) = &self.images {
            return place + upper(&strained.edges, &Vec3::from(image.map(f64::from)));
        }
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
        // A place that a flow carries is rounded a few times more.
        let times = if self.upright().is_some() { 16.0 } else { 4.0 };
        times * f64::EPSILON * longest.fold(lowest, f64::max)
    }

    /// Distance of two boxes from their corners, low and high, the nearest of their images [m].
    pub fn gap(&self, one: [&Vec3; 2], other: [&Vec3; 2]) -> f64 {
        let between = |axis: usize, shift: f64| {
            let below = one[0][axis] - (other[1][axis] + shift);
            let above = other[0][axis] + shift - one[1][axis];
            below.max(above).max(0.0)
        };
        if let Images::Carried(Carried { chosen, .. }) = &self.images {
            return Self::gap_of_carried(chosen, between);
        }
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

    /// As [`Self::gap`] where a flow carries the edges; `between` tells how far apart the boxes are along an axis, the other one shifted [m].
    fn gap_of_carried(chosen: &Mat3, between: impl Fn(usize, f64) -> f64) -> f64 {
        let mut least = f64::INFINITY;
        for k in [-1.0, 0.0, 1.0] {
            for j in [-1.0, 0.0, 1.0] {
                let beside = j * chosen.m12 + k * chosen.m13;
                let beside = beside - (beside / chosen.m11).round() * chosen.m11;
                let along = |i: f64| between(0, beside + i * chosen.m11);
                let x = along(0.0).min(along(1.0)).min(along(-1.0));
                let y = between(1, j * chosen.m22 + k * chosen.m23);
                least = least.min(Vec3::new(x, y, between(2, k * chosen.m33)).norm());
            }
        }
        least
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
