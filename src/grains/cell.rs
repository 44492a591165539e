//! The box of the particles and its periodicity: images, wrapping, distances across periods.
//!
//! A sheared cell (Lees and Edwards 1972, DOI 10.1088/0022-3719/5/15/006) keeps its edges, and the images above and below slide past it.
//! They are displaced by the strain times the period, and move with the rate times the period. A body that leaves through such a face
//! returns at another place and with another velocity.
//!
//! A cell may also be carried by a homogeneous flow: its edges `H` follow `dH/dt = L H`. `H` and the velocity gradient `L` are upper
//! triangular: the first edge stays along x, the second in the plane of x and y. Velocities of bodies are then relative to the flow
//! (peculiar velocities; Evans and Morriss 1984, DOI 10.1103/PhysRevA.30.1528): a body at `x` moves with `v + L x`. The bodies are in the
//! upright box of the sides `H_xx`, `H_yy`, `H_zz`, which holds one image of each. In each step, whole edges are added or subtracted so that
//! the tilts of the edges are at most half of a side. This choice follows from `H` alone and is therefore the same on every rank.

use crate::lanes::{Eight, Lanes, Triple};
use crate::math::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

/// Names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// Sides of the box: name, axis, and the component of the inward normal along it.
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
    /// Axis along which images slide.
    pub along: usize,
    /// Axis across which images slide.
    pub across: usize,
    /// Velocity over height [1/s].
    pub rate: f64,
    /// Displacement over height so far [-].
    pub strain: f64,
}

/// A box with its periodic axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Lowest corner, from which the edges start [m].
    origin: Vec3,
    /// Highest corner of the box, whose edges are along the axes [m].
    high: Vec3,
    periodic: [bool; 3],
    /// Length of the period along each axis, infinite without one [m].
    period: Vec3,
    /// Position of the images relative to the edges.
    images: Images,
}

/// Positions of the images of a cell.
#[expect(clippy::large_enum_variant, reason = "a run has one")]
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
enum Images {
    /// At the edges, which are along the axes.
    Square,
    /// Images that slide along each other. Both axes are periodic.
    Slide(Sliding),
    /// Edges carried by a flow. All axes are periodic.
    Carried(Carried),
}

/// State of a cell carried by a flow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strained {
    /// Edges, as columns; upper triangular, as carried and without whole edges removed [m].
    pub edges: Mat3,
    /// Velocity gradient in the next step; upper triangular [1/s].
    pub rate: Mat3,
    /// Integral of the velocity gradient over time so far; upper triangular [-].
    pub strain: Mat3,
}

/// A cell whose edges follow a flow, with derived values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Carried {
    strained: Strained,
    /// Velocity gradient in the last step [1/s].
    last_rate: Mat3,
    /// Half of the last step [s].
    half: f64,
    /// Edges with the same images and the least tilts, as columns [m].
    chosen: Mat3,
    /// Numbers of whole edges that `chosen` has less than the carried edges: xy and xz of the first, yz of the second.
    turns: [i32; 3],
    /// Largest distance by which the flow has brought two bodies within reach nearer since the pairs were listed [m].
    neared: f64,
}

impl Carried {
    /// Difference of the flow velocity between two bodies half a step ago [m/s].
    ///
    /// `now` is the present difference, and `parting` is the velocity difference of the bodies relative to the flow. In half a step they
    /// moved half of their way.
    fn midway(&self, now: &Vec3, parting: &Vec3) -> Vec3 {
        now - upper(&self.last_rate, &(now + parting)) * self.half
    }

    /// Nearest images of differences between two places [m].
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    fn nearest_of<L: Lanes>(&self, mut r: Triple<L>) -> Triple<L> {
        // The parts of the other edges along the first may add up to a whole one.
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

    /// Difference of the flow velocity half a step ago [m/s], for differences in place [m] and `parting` velocities relative to the flow [m/s].
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    fn faster_midway<L: Lanes>(&self, r: Triple<L>, parting: Triple<L>) -> Triple<L> {
        let now = upper_of(&self.last_rate, r);
        now.minus(upper_of(&self.last_rate, now.plus(parting)).times(L::all(self.half)))
    }
}

/// Change of places in a step of a flow.
#[derive(Clone, Copy, Debug)]
pub struct Stretch {
    /// Deformation of places relative to the lowest corner; upper triangular [-].
    pub places: Mat3,
    /// Velocity gradient [1/s].
    pub rate: Mat3,
}

/// Product of an upper triangular matrix and `r`.
#[inline]
fn upper(m: &Mat3, r: &Vec3) -> Vec3 {
    Vec3::new(m.m11 * r.x + m.m12 * r.y + m.m13 * r.z, m.m22 * r.y + m.m23 * r.z, m.m33 * r.z)
}

/// [`upper`] in lanes.
#[expect(clippy::inline_always, reason = "see `lanes`")]
#[inline(always)]
fn upper_of<L: Lanes>(m: &Mat3, r: Triple<L>) -> Triple<L> {
    Triple {
        x: L::all(m.m11) * r.x + L::all(m.m12) * r.y + L::all(m.m13) * r.z,
        y: L::all(m.m22) * r.y + L::all(m.m23) * r.z,
        z: L::all(m.m33) * r.z,
    }
}

/// Inverse of an upper triangular matrix.
pub fn upper_inverse(m: &Mat3) -> Mat3 {
    let (x, y, z) = (1.0 / m.m11, 1.0 / m.m22, 1.0 / m.m33);
    let (xy, yz) = (-m.m12 * x * y, -m.m23 * y * z);
    let xz = (m.m12 * m.m23 * y - m.m13) * x * z;
    Mat3::new(x, xy, xz, 0.0, y, yz, 0.0, 0.0, z)
}

/// A box that extends out of the cell along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// Name of the axis.
    pub axis: &'static str,
    /// Lower and upper end of the box along the axis [m].
    pub place: [f64; 2],
    /// Lower and upper end of the cell [m].
    pub ends: [f64; 2],
}

impl Beyond {
    /// Whether the box extends out at the upper end.
    pub fn is_above(&self) -> bool {
        self.place[1] > self.ends[1]
    }
}

/// A face of the box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Name in a scene: `-x`.
    pub name: &'static str,
    /// Axis across which the face lies.
    pub axis: usize,
    /// A point on it [m].
    pub point: Vec3,
    /// Unit normal inwards.
    pub normal: Vec3,
    /// Whether there is an image behind the face.
    pub repeats: bool,
}

/// A shear, with derived values for the image above.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Sliding {
    shear: Shear,
    /// Displacement without whole periods: at most half of one [m].
    offset: f64,
    /// Number of whole periods left out of the displacement.
    turns: i32,
    /// Strain when the pairs were listed [-].
    listed: f64,
}

impl Cell {
    /// A cell without bounds.
    pub const OPEN: Self = Self {
        origin: Vec3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
        high: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        periodic: [false; 3],
        period: Vec3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        images: Images::Square,
    };

    /// A cell between two corners [m].
    pub fn new(low: Vec3, high: Vec3, periodic: [bool; 3]) -> Self {
        let length =
            |axis: usize| if periodic[axis] { high[axis] - low[axis] } else { f64::INFINITY };
        let period = Vec3::new(length(0), length(1), length(2));
        Self { origin: low, high, periodic, period, images: Images::Square }
    }

    /// Copy with a shear; `None` if both axes are the same, or one of them is not periodic.
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

    /// Copy with edges that a flow carries.
    ///
    /// Returns `None` if an axis is not periodic, or if the edges are not an upper triangular matrix with a positive diagonal.
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

    /// A cell with these edges as columns [m], at rest, which a flow may carry; `None` if they are not an upper triangular matrix
    /// with a positive diagonal.
    pub fn of_edges(low: Vec3, edges: Mat3) -> Option<Self> {
        let still = Strained { edges, rate: Mat3::zeros(), strain: Mat3::zeros() };
        Self::new(low, low + edges.diagonal(), [true; 3]).with_strain(still)
    }

    /// Copy that a flow may carry from now on, with edges along the axes; `None` if an axis is not periodic, or images slide.
    #[must_use]
    pub fn at_rest(self) -> Option<Self> {
        let is_square = self.images == Images::Square;
        if is_square {
            Self::of_edges(self.origin, Mat3::from_diagonal(&self.period))
        } else {
            None
        }
    }

    /// State of a cell carried by a flow; `None` for other cells.
    pub const fn strained(&self) -> Option<&Strained> {
        match &self.images {
            Images::Carried(carried) => Some(&carried.strained),
            _ => None,
        }
    }

    /// Velocity gradient of the flow in the last step [1/s]; `None` if no flow carries the cell.
    pub const fn rate(&self) -> Option<Mat3> {
        match &self.images {
            Images::Carried(carried) => Some(carried.last_rate),
            _ => None,
        }
    }

    /// Sets the velocity gradient of the flow for the next step [1/s].
    pub fn set_rate(&mut self, rate: &Mat3) {
        if let Images::Carried(carried) = &mut self.images {
            carried.strained.rate = *rate;
        }
    }

    /// Moves the edges through a step of `dt` [s] by the implicit midpoint rule, and returns the change of places, if any.
    ///
    /// `reach` is the largest distance of two bodies that may touch [m].
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

    /// The edge along this axis with the least tilt [m].
    fn edge(&self, axis: usize) -> Vec3 {
        match &self.images {
            Images::Carried(carried) => carried.chosen.column(axis).into(),
            _ => Vec3::ith(axis, self.period[axis]),
        }
    }

    /// Edges with the least tilts, as columns [m].
    pub fn edges(&self) -> Mat3 {
        Mat3::from_columns(&[self.edge(0), self.edge(1), self.edge(2)])
    }

    /// Whether an edge leans from its axis.
    pub fn is_tilted(&self) -> bool {
        let edges = self.edges();
        [edges.m12, edges.m13, edges.m23] != [0.0; 3]
    }

    /// An upright cell of the same sides, if the edges of this one may be tilted.
    pub fn upright(&self) -> Option<Self> {
        matches!(self.images, Images::Carried(_))
            .then_some(Self { images: Images::Square, ..*self })
    }

    /// The place in [the upright cell](Self::upright) with the same fractions of the sides as `place` has of the edges [m].
    pub fn in_upright(&self, place: &Vec3) -> Vec3 {
        let (edges, from) = (self.edges(), place - self.origin);
        let z = from.z / edges.m33;
        let y = (from.y - z * edges.m23) / edges.m22;
        let x = (from.x - z * edges.m13 - y * edges.m12) / edges.m11;
        let turned = Vec3::new(x - x.floor(), y - y.floor(), z - z.floor());
        self.origin + turned.component_mul(&self.period)
    }

    /// Upper bound of the distance of two places in the upright cell over their distance here [-].
    pub fn upright_over_distance(&self) -> f64 {
        let to_upright = Mat3::from_diagonal(&self.period) * upper_inverse(&self.edges());
        let sizes = to_upright.abs();
        (sizes.row_sum().max() * sizes.column_sum().max()).sqrt()
    }

    /// Volume between the corners [m³].
    pub fn volume(&self) -> f64 {
        self.sides().product()
    }

    /// Lowest and highest corner [m].
    pub const fn corners(&self) -> (Vec3, Vec3) {
        (self.origin, self.high)
    }

    /// Middle between the corners [m].
    pub fn middle(&self) -> Vec3 {
        (self.origin + self.high) * 0.5
    }

    /// Lengths along the axes [m].
    pub fn sides(&self) -> Vec3 {
        self.high - self.origin
    }

    /// Distances of opposite faces [m].
    pub fn widths(&self) -> Vec3 {
        let Images::Carried(carried) = &self.images else { return self.sides() };
        let to_parts = upper_inverse(&carried.chosen);
        Vec3::from_fn(|axis, _| 1.0 / to_parts.row(axis).norm())
    }

    /// Axis and distance of periodic faces that are nearer to each other than `least` [m].
    pub fn thin(&self, least: f64) -> impl Iterator<Item = (&'static str, f64)> {
        let widths = self.widths();
        let all = self.repeating_axes().map(move |axis| (AXES[axis], widths[axis]));
        all.filter(move |&(_, width)| width < least)
    }

    /// Periodic axes.
    pub fn repeating_axes(&self) -> impl Iterator<Item = usize> + use<> {
        let periodic = self.periodic;
        (0..3).filter(move |&axis| periodic[axis])
    }

    /// Axes that are not periodic.
    pub fn open_axes(&self) -> impl Iterator<Item = usize> + use<> {
        let periodic = self.periodic;
        (0..3).filter(move |&axis| !periodic[axis])
    }

    /// First periodic axis along which a direction has a component.
    pub fn repeats_along(&self, direction: &Vec3) -> Option<usize> {
        self.repeating_axes().find(|&axis| direction[axis] != 0.0)
    }

    /// Faces of the box.
    pub fn faces(&self) -> [Face; 6] {
        SIDES.map(|(name, axis, inwards)| Face {
            name,
            axis,
            point: if inwards > 0.0 { self.origin } else { self.high },
            normal: Vec3::ith(axis, inwards),
            repeats: self.periodic[axis],
        })
    }

    /// First axis along which a box with these corners [m] extends out of this one.
    pub fn beyond(&self, low: &Vec3, high: &Vec3) -> Option<Beyond> {
        self.beyond_along(0..3, low, high)
    }

    /// Same as [`Self::beyond`], along periodic axes only.
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

    /// A box [m] with the ends of this one along periodic axes.
    pub fn with_periods(&self, mut low: Vec3, mut high: Vec3) -> (Vec3, Vec3) {
        for axis in self.repeating_axes() {
            (low[axis], high[axis]) = (self.origin[axis], self.high[axis]);
        }
        (low, high)
    }

    /// Centres of a ball and of its images that extend into the box [m].
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

    /// Shear of the cell, if it has one.
    pub fn shear(&self) -> Option<Shear> {
        self.sliding().map(|sliding| sliding.shear)
    }

    /// Whether the images can move relative to the cell.
    #[inline]
    pub const fn moves(&self) -> bool {
        !matches!(self.images, Images::Square)
    }

    /// Whether the images move in the last or in the next step.
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

    /// Advances the shear by a step of `dt` [s].
    pub fn advance(&mut self, dt: f64) {
        if let Images::Slide(Sliding { shear, .. }) = &mut self.images {
            shear.strain += shear.rate * dt;
            self.place_images();
        }
    }

    /// Updates the positions of the images.
    fn place_images(&mut self) {
        let Self { period, images: Images::Slide(sliding), .. } = self else { return };
        let Shear { along, across, strain, .. } = sliding.shear;
        let displaced = strain * period[across];
        let turns = (displaced / period[along]).round();
        (sliding.offset, sliding.turns) = (displaced - turns * period[along], turns as i32);
    }

    /// Displacement of the image above without whole periods: at most half of one [m].
    pub fn slid(&self) -> f64 {
        self.sliding().map_or(0.0, |sliding| sliding.offset)
    }

    /// Image of a place along a periodic axis that is nearest to another place [m].
    pub fn image_along(&self, axis: usize, place: f64, other: f64) -> f64 {
        place - ((place - other) / self.period[axis]).round() * self.period[axis]
    }

    /// A place in the box and its images after a way of at most this length through periods [m], in the same order on every rank.
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

    /// Records that the pairs are listed now.
    pub fn note_listing(&mut self) {
        match &mut self.images {
            Images::Square => {}
            Images::Slide(Sliding { shear, listed, .. }) => *listed = shear.strain,
            Images::Carried(carried) => carried.neared = 0.0,
        }
    }

    /// Distance by which images have slid, or the flow has brought bodies that may touch nearer, since the pairs were listed [m].
    pub fn slid_since_listed(&self) -> f64 {
        match &self.images {
            Images::Square => 0.0,
            Images::Slide(Sliding { shear, listed, .. }) => {
                (shear.strain - listed).abs() * self.period[shear.across]
            }
            Images::Carried(carried) => carried.neared,
        }
    }

    /// Velocity of the image above [m/s]; zero if no image slides.
    pub fn velocity_above(&self) -> Vec3 {
        let mut velocity = Vec3::zeros();
        if let Some(Shear { along, across, rate, .. }) = self.shear() {
            velocity[along] = rate * self.period[across];
        }
        velocity
    }

    /// Velocity of the image at this shift relative to a body [m/s].
    pub fn velocity_of_image(&self, shift: &Vec3) -> Vec3 {
        if let Images::Carried(carried) = &self.images {
            return upper(&carried.last_rate, shift);
        }
        let periods =
            self.shear().map_or(0.0, |Shear { across, .. }| shift[across] / self.period[across]);
        self.velocity_above() * periods
    }

    /// Shear rate [1/s]. For a flow it is `sqrt(2 D:D)` with the deviator `D` of its rate of strain.
    pub fn shear_rate(&self) -> f64 {
        let Images::Carried(Carried { strained, .. }) = &self.images else {
            return self.shear().map_or(0.0, |shear| shear.rate.abs());
        };
        let strain = (strained.rate + strained.rate.transpose()) * 0.5;
        let deviator = strain - Mat3::identity() * (strain.trace() / 3.0);
        2.0_f64.sqrt() * deviator.norm()
    }

    /// Displacement of the image above so far [m]; zero if no image slides.
    pub fn way_above(&self) -> Vec3 {
        let mut way = Vec3::zeros();
        if let Some(Shear { along, across, strain, .. }) = self.shear() {
            way[along] = strain * self.period[across];
        }
        way
    }

    /// Velocity of the shear flow at a place [m/s]: zero in the middle of the cell, and without a shear.
    pub fn flow_at(&self, place: &Vec3) -> Vec3 {
        let mut velocity = Vec3::zeros();
        if let Some(Shear { along, across, rate, .. }) = self.shear() {
            velocity[along] =
                rate * (place[across] - 0.5 * (self.origin[across] + self.high[across]));
        }
        velocity
    }

    /// Number of faces between images on the shortest way of a difference of two places [m], along an axis.
    ///
    /// It is 1 if the nearest image is the one below, and -1 if it is the one above.
    #[inline]
    fn faces_between(&self, difference: f64, axis: usize) -> f64 {
        let half = 0.5 * self.period[axis];
        f64::from(i8::from(difference > half) - i8::from(difference < -half))
    }

    /// Velocity of the image that [`Cell::nearest`] takes for a difference of two places [m], relative to the cell's own bodies [m/s].
    ///
    /// In a flow it is the difference of the flow velocity between the places.
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

    /// [`Self::velocity_of_nearest`] half a step ago, where the velocities are those that carry bodies through the step.
    ///
    /// `parting` is the velocity of the other body relative to the first, without the flow [m/s].
    #[inline]
    pub fn velocity_of_nearest_midway(&self, difference: &Vec3, parting: &Vec3) -> Vec3 {
        let now = self.velocity_of_nearest(difference);
        match &self.images {
            Images::Carried(carried) => carried.midway(&now, parting),
            _ => now,
        }
    }

    /// Work of a force [N] on the image that [`Cell::nearest`] takes for a difference of two places [m], in the last step and
    /// ahead, for these times [s].
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    pub fn work_on_nearest<L: Lanes>(
        &self,
        difference: Triple<L>,
        force: Triple<L>,
        [before, ahead]: [f64; 2],
    ) -> L {
        let [before, ahead] = [L::all(before), L::all(ahead)];
        if let Images::Carried(carried) = &self.images {
            let nearest = carried.nearest_of(difference);
            let then = upper_of(&carried.last_rate, nearest);
            let soon = upper_of(&carried.strained.rate, nearest);
            return before * force.dot(then) + ahead * force.dot(soon);
        }
        let power = force.dot(self.velocity_of_nearest_in_lanes(difference, Triple::zero()));
        before * power + ahead * power
    }

    /// [`Self::velocity_of_nearest_midway`] in lanes, for differences in position [m] and velocity [m/s].
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    pub fn velocity_of_nearest_in_lanes<L: Lanes>(
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

    /// Whether each axis is periodic.
    pub const fn periodic(&self) -> [bool; 3] {
        self.periodic
    }

    /// Whether any axis is periodic.
    pub fn repeats(&self) -> bool {
        self.periodic.contains(&true)
    }

    /// Lengths of the periods [m]; infinite along axes that are not periodic.
    pub const fn periods(&self) -> Vec3 {
        self.period
    }

    /// Whether another cell has different periods. A cell with another origin has the same lengths within rounding.
    pub fn repeats_otherwise(&self, other: &Self) -> bool {
        if let [Images::Carried(_), Images::Carried(_)] = [self.images, other.images] {
            return false;
        }
        let differs = |(a, b): (&f64, &f64)| (a - b).abs() > 1e-12 * a.min(*b);
        self.period.iter().zip(&other.period).any(differs)
    }

    /// The shortest of all images of a difference of two places [m].
    ///
    /// It depends on positions alone, so a pair has the same bits on every rank. Periods are longer than twice the largest reach.
    #[inline]
    pub fn nearest(&self, mut difference: Vec3) -> Vec3 {
        if let Images::Carried(Carried { chosen, .. }) = &self.images {
            // Most pairs have no image between them.
            if (0..3).all(|axis| difference[axis].abs() <= 0.5 * self.period[axis]) {
                return difference;
            }
            // The parts of the other edges along the first may add up to a whole one.
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

    /// `Self::nearest` in lanes.
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

    /// Displacement of a body from one place to another, through a periodic face or not [m].
    #[inline]
    pub fn moved(&self, from: &Vec3, to: &Vec3) -> Vec3 {
        self.nearest(to - from)
    }

    /// Image of a place that is nearest to another place along periodic axes [m].
    pub fn image_near(&self, place: &Vec3, other: &Vec3) -> Vec3 {
        let image = other + self.nearest(place - other);
        Vec3::from_fn(|axis, _| if self.periodic[axis] { image[axis] } else { place[axis] })
    }

    /// Corners of the region in which no place is wrapped; infinite along axes that are not periodic [m].
    pub fn wraps_outside(&self) -> [Vec3; 2] {
        let end = |axis: usize, at: f64, open: f64| if self.periodic[axis] { at } else { open };
        [
            Vec3::from_fn(|axis, _| end(axis, self.origin[axis], f64::NEG_INFINITY)),
            Vec3::from_fn(|axis, _| {
                end(axis, self.origin[axis] + self.period[axis], f64::INFINITY)
            }),
        ]
    }

    /// Moves a place [m] back that left through a periodic face by less than a period, and adapts its velocity if images slide [m/s].
    ///
    /// Returns the number of faces crossed, and whether the place is still outside. `image` counts whole periods.
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

    /// Same as [`Self::wrap`] where a flow carries the edges: from any distance, and without a change of velocity.
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

    /// Changes of place, velocity and image on the way up through this number of faces, except for the height.
    #[cold]
    fn slide(&self, up: i32, place: &mut Vec3, velocity: &mut Vec3, image: &mut [i32; 3]) {
        let Images::Slide(Sliding { shear, offset, turns, .. }) = self.images else { return };
        place[shear.along] -= f64::from(up) * offset;
        image[shear.along] -= up * turns;
        *velocity -= self.velocity_above() * f64::from(up);
    }

    /// Same as [`Self::wrap`], from any distance.
    ///
    /// A body on a high face, where rounding may have put it, stays there until the next step.
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

    /// Image of a place [m] between the periodic faces, from any distance.
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

    /// Shifts from a body to its images at most a period away, including zero [m].
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
                // The image nearest along the first edge, as for the others.
                let turns = (beside / chosen.m11).round();
                *shift = upper(chosen, &Vec3::new(i - turns, j, k));
            }
        }
        shifts
    }

    /// Position of a body without periods [m].
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

    /// Bound of the rounding by which the distance of two images may differ from that of their bodies [m].
    pub fn rounding_of_images(&self) -> f64 {
        let longest = self.period.iter().copied().filter(|length| length.is_finite());
        let lowest = if self.origin.amax().is_finite() { self.origin.amax() } else { 0.0 };
        // A place that a flow carries is rounded a few more times.
        let times = if self.upright().is_some() { 16.0 } else { 4.0 };
        times * f64::EPSILON * longest.fold(lowest, f64::max)
    }

    /// Distance of two boxes from their low and high corners, for the nearest of their images [m].
    pub fn gap(&self, one: [&Vec3; 2], other: [&Vec3; 2]) -> f64 {
        let between = |axis: usize, shift: f64| {
            let below = one[0][axis] - (other[1][axis] + shift);
            let above = other[0][axis] + shift - one[1][axis];
            below.max(above).max(0.0)
        };
        if let Images::Carried(Carried { chosen, .. }) = &self.images {
            return Self::gap_of_carried(chosen, between);
        }
        // Least distance of the images along an axis. Where they have slid, two of them may be as near as the box itself.
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

    /// [`Self::gap`] where a flow carries the edges; `between` gives the distance of the boxes along an axis for a shift of the other one [m].
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

    /// Nearest place between two corners; along a periodic axis every place is inside [m].
    pub fn clamped(&self, place: &Vec3, low: &Vec3, high: &Vec3) -> Vec3 {
        Vec3::from_fn(|axis, _| {
            let x = place[axis];
            if self.periodic[axis] { x } else { x.max(low[axis]).min(high[axis]) }
        })
    }

    /// Whether a place is between two corners, with a tolerance `slack` [m]. Along a periodic axis every place is inside.
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
        // Far outside: one face at a time is not enough.
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
