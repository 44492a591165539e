//! Where the measures are taken: the whole packing or a box in it, its volume, the particles that
//! belong to it, and how much of it is solid.

use super::check::check_particles;
use super::sums::quotient;
use super::{PostError, pieces};
use crate::cell::{AXES, Beyond, Face, Shear};
use crate::contact::Posed;
use crate::drive::groups;
use crate::ids::GlobalId;
use crate::math::{ExactSum, Mat3, Quat, Vec3};
use crate::output::header::{Header, WallRow};
use crate::output::snapshot::Reader;
use crate::output::tables::ParticleTable;
use crate::shape::Shape;
use crate::text::{MOST_NAMED, listed};
use nalgebra::Quaternion;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::f64::consts::PI;
use std::str::FromStr;

/// A box with its sides along the axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Lowest corner [m].
    pub low: Vec3,
    /// Highest corner [m].
    pub high: Vec3,
}

impl FromStr for Bounds {
    type Err = String;

    /// `x0,x1,y0,y1,z0,z1` in metres.
    fn from_str(text: &str) -> Result<Self, String> {
        let number = |word: &str| word.trim().parse().map_err(|_| format!("'{word}' is no number"));
        let numbers = text.split(',').map(number).collect::<Result<Vec<f64>, String>>()?;
        let [x0, x1, y0, y1, z0, z1] = numbers[..] else {
            let given = numbers.len();
            return Err(format!("six numbers x0,x1,y0,y1,z0,z1 in metres are needed, not {given}"));
        };
        Ok(Self { low: Vec3::new(x0, y0, z0), high: Vec3::new(x1, y1, z1) })
    }
}

impl Bounds {
    /// Length of the sides [m].
    pub fn lengths(&self) -> Vec3 {
        self.high - self.low
    }

    /// Volume [m³].
    pub fn volume(&self) -> f64 {
        self.lengths().product()
    }

    /// Without a layer of a thickness [m] along the sides; a periodic axis has none.
    #[must_use]
    pub fn shrunk(mut self, header: &Header, thickness: f64) -> Self {
        for k in header.cell.open_axes() {
            self.low[k] += thickness;
            self.high[k] -= thickness;
        }
        self
    }

    /// Whether `low <= point < high` on every axis: boxes that share a side share no point.
    pub fn contains(&self, point: &Vec3) -> bool {
        (0..3).all(|k| self.low[k] <= point[k] && point[k] < self.high[k])
    }
}

/// Where the measures are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Region {
    /// All particles, in the box that [`Extent`] finds.
    #[default]
    Whole,
    /// The particles whose centres lie in this box.
    Box(Bounds),
}

impl Region {
    /// Whether the region can be used with this snapshot.
    ///
    /// # Errors
    /// A box without volume, or one that reaches beyond a periodic side, where each particle
    /// would have to count several times.
    pub fn check(&self, header: &Header) -> Result<(), PostError> {
        let Self::Box(bounds) = self else { return Ok(()) };
        for (k, axis) in AXES.into_iter().enumerate() {
            let (low, high) = (bounds.low[k], bounds.high[k]);
            if !(low < high && low.is_finite() && high.is_finite()) {
                return Err(PostError::EmptyRegion { axis, low, high });
            }
        }
        if let Some(Beyond { axis, place, ends }) =
            header.cell.beyond_period(&bounds.low, &bounds.high)
        {
            let ([low, high], [period_low, period_high]) = (place, ends);
            return Err(PostError::RegionBeyondPeriod { axis, low, high, period_low, period_high });
        }
        Ok(())
    }
}

/// A length: the thickness of a layer along the sides, the side of a cell, a width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Margin {
    /// In metres.
    Metres(f64),
    /// In diameters of the sphere that has the mean volume of the grains of that shape of which it is the largest.
    Diameters(f64),
}

impl Margin {
    /// In metres, for the grains of a snapshot.
    ///
    /// # Errors
    /// A file that cannot be read or makes no sense.
    pub fn metres(self, reader: &Reader) -> Result<f64, PostError> {
        let count = match self {
            Self::Metres(length) => return Ok(length),
            Self::Diameters(count) => count,
        };
        let header = reader.header();
        // By shapes: how many grains, and their volumes over that of the shape.
        let mut sums = vec![(0.0, 0.0); header.shapes.len()];
        for rows in pieces(reader.particle_count()) {
            let particles = reader.particles(rows)?;
            check_particles(header, &particles)?;
            for (row, shape) in particles.shape.iter().enumerate() {
                let (grains, ratio) = &mut sums[shape.index()];
                *grains += 1.0;
                *ratio += particles.volume_ratio(row);
            }
        }
        let mean = |&(grains, ratio): &(f64, f64)| if grains > 0.0 { ratio / grains } else { 0.0 };
        let volumes = header.shapes.iter().zip(&sums).map(|(shape, sum)| shape.volume * mean(sum));
        Ok(count * diameter_of(volumes.fold(0.0, f64::max)))
    }
}

impl FromStr for Margin {
    type Err = String;

    /// `0.004` are metres, `1.5d` diameters.
    fn from_str(text: &str) -> Result<Self, String> {
        let (number, unit): (_, fn(f64) -> Self) = match text.strip_suffix('d') {
            Some(number) => (number, Self::Diameters),
            None => (text, Self::Metres),
        };
        let value = number.parse::<f64>().ok().filter(|v| *v >= 0.0 && v.is_finite());
        value.map(unit).ok_or_else(|| "write metres, 0.004, or grain diameters, 1.5d".to_string())
    }
}

/// Diameter of the sphere of this volume [m].
fn diameter_of(volume: f64) -> f64 {
    (6.0 / PI * volume).cbrt()
}

/// The body of a row about its centre, turned as it lies in the world.
pub(super) struct Turned<'a> {
    pub(super) shape: Cow<'a, Shape>,
    /// Columns are the body's axes in the world.
    pub(super) frame: Mat3,
    /// Lengths over those of the shape [-].
    pub(super) scale: f64,
}

impl<'a> Turned<'a> {
    pub(super) fn of(header: &'a Header, particles: &ParticleTable, row: usize) -> Self {
        let frame = particles.quaternion.get(row).map_or_else(Mat3::identity, |&[w, x, y, z]| {
            Quat::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix().into_inner()
        });
        let shape = header.shapes[particles.shape[row].index()].body();
        Self { shape, frame, scale: particles.scale_of(row) }
    }

    /// As contacts see it.
    pub(super) fn posed(&self) -> Posed<'_> {
        Posed { scale: self.scale, ..Posed::new(&self.shape, &self.frame) }
    }

    /// The farthest point along `direction` [m].
    pub(super) fn support(&self, direction: &Vec3) -> Vec3 {
        self.posed().support(direction)
    }

    /// Whether a point is in the body.
    fn contains(&self, point: &Vec3) -> bool {
        self.posed().contains(point)
    }

    /// The box around the body.
    fn bounds(&self) -> Bounds {
        let end = |k: usize, sign: f64| self.support(&Vec3::ith(k, sign))[k];
        Bounds { low: Vec3::from_fn(|k, _| end(k, -1.0)), high: Vec3::from_fn(|k, _| end(k, 1.0)) }
    }
}

/// The box of the whole packing. On each side it ends
/// * at the end of the period, if the axis is periodic;
/// * else at a wall across that axis, if there is one, touched or not (of several, the innermost);
/// * else at the outermost particle surface, be the particle in flight.
///
/// Slanted walls, those of several planes, and those of triangles, cylinders and cones bound nothing here. Reports say
/// where the box is doubtful for that; a region within the packing is not.
#[derive(Clone, Debug)]
pub struct Extent {
    low: Vec3,
    high: Vec3,
}

impl Default for Extent {
    fn default() -> Self {
        Self { low: Vec3::repeat(f64::INFINITY), high: Vec3::repeat(f64::NEG_INFINITY) }
    }
}

impl Extent {
    /// Adds the surfaces of these particles.
    pub fn add(&mut self, header: &Header, particles: &ParticleTable) {
        for (row, centre) in particles.position.iter().enumerate() {
            let around = Turned::of(header, particles, row).bounds();
            self.low = self.low.inf(&(centre + around.low));
            self.high = self.high.sup(&(centre + around.high));
        }
    }

    /// The box; `None` if it has no volume, as without particles and walls.
    pub fn finish(&self, header: &Header) -> Option<Bounds> {
        let (low, high) = header.cell.with_periods(self.low, self.high);
        let mut bounds = Bounds { low, high };
        for k in header.cell.open_axes() {
            let across = |sign: f64| {
                let faces = header.planes().filter(move |w| sign * w.normal[k] > ACROSS);
                faces.map(|w| w.point[k])
            };
            bounds.low[k] = across(1.0).reduce(f64::max).unwrap_or(bounds.low[k]);
            bounds.high[k] = across(-1.0).reduce(f64::min).unwrap_or(bounds.high[k]);
        }
        let usable = bounds.lengths().iter().all(|&l| l > 0.0 && l.is_finite());
        usable.then_some(bounds)
    }
}

/// What makes the box in which is measured another room than that of the grains: of the whole packing sides that no period and no
/// plane ends, and walls that are no planes across an axis. A sentence each.
pub(super) fn doubts(header: &Header, region: &Region, packing: Option<&Bounds>) -> Vec<String> {
    let (bounds, open) = match (region, packing) {
        (Region::Box(bounds), _) => (bounds, Vec::new()),
        (Region::Whole, Some(packing)) => (packing, open_sides(header)),
        (Region::Whole, None) => return Vec::new(),
    };
    let mut doubts = Vec::new();
    if !open.is_empty() {
        doubts.push(format!(
            "the box of the packing ends at the outermost grain towards {}, be it in flight: no period and no plane across the axis \
             ends it there. Volume, solid fraction, stress and profiles are of that box; a --region within the packing gives those \
             that hold",
            open.join(", ")
        ));
    }
    let triangles = header.triangles_in_place();
    // Where a side is open, a wall that does not reach into the box of the grains may be what was taken to end it.
    let counts = |k: usize| !open.is_empty() || comes_into(&header.walls[k], k, &triangles, bounds);
    let others = (0..header.walls.len()).filter(|&k| !is_across(&header.walls[k]) && counts(k));
    let names: Vec<String> = others.map(|k| format!("\"{}\"", header.walls[k].name)).collect();
    if !names.is_empty() {
        let (walls, are) = match names[..] {
            [_] => ("wall", "is no plane across an axis and ends"),
            _ => ("walls", "are no planes across an axis and end"),
        };
        doubts.push(format!(
            "{walls} {} {are} nothing: what is behind counts as room of the grains, in volumes and in the \
             areas of other walls; a --region in front gives densities and stresses that hold",
            listed(names, MOST_NAMED)
        ));
    }
    doubts
}

/// The sides on which neither a period nor a plane across the axis ends the packing, as -x.
fn open_sides(header: &Header) -> Vec<String> {
    let is_open = |face: &Face| {
        let closes = |plane: &WallRow| face.normal.dot(&plane.normal) > ACROSS;
        !face.repeats && !header.planes().any(closes)
    };
    let faces = header.cell.faces().into_iter().filter(is_open);
    faces.map(|face| face.name.to_owned()).collect()
}

/// Is it one plane across an axis?
fn is_across(wall: &WallRow) -> bool {
    wall.is_one_plane() && wall.normal.amax() > ACROSS
}

/// Is a part of a wall in a box, or behind a plane of it a part of the box? `triangles` are those of all walls in place. A triangle is
/// in it if the box around it and its plane are.
fn comes_into(
    wall: &WallRow,
    index: usize,
    triangles: &[(usize, [Vec3; 3])],
    bounds: &Bounds,
) -> bool {
    let half = bounds.lengths() * 0.5;
    let middle = bounds.low + half;
    // What touches from outside is not in it.
    let slack = 1e-9 * half.amax();
    let is_cut = |(point, normal): (Vec3, Vec3)| {
        half.dot(&normal.abs()) - (middle - point).dot(&normal) > slack
    };
    let is_in = |corners: &[Vec3; 3]| {
        let [a, b, c] = corners;
        let (low, high) = (a.inf(b).inf(c), a.sup(b).sup(c));
        let normal = (b - a).cross(&(c - a));
        let reach = half.dot(&normal.abs()) - slack * normal.norm();
        (middle - a).dot(&normal).abs() < reach
            && (0..3).all(|k| high[k] > bounds.low[k] + slack && low[k] < bounds.high[k] - slack)
    };
    let mut own = triangles.iter().filter(|(of, _)| *of == index);
    wall.planes().into_iter().any(is_cut) || own.any(|(_, corners)| is_in(corners))
}

/// Along which axes a period or walls on both sides end the packing. Along the others the box of an [`Extent`] ends at
/// the outermost particle, so that one grain that bounces would be a strain.
pub fn enclosed(header: &Header) -> [bool; 3] {
    let mut enclosed = header.cell.periodic();
    for k in header.cell.open_axes() {
        let wall = |sign: f64| header.planes().any(|w| sign * w.normal[k] > ACROSS);
        enclosed[k] = wall(1.0) && wall(-1.0);
    }
    enclosed
}

/// The innermost walls at both ends of an axis, which bound the packing.
pub(super) fn walls_across(header: &Header, axis: usize) -> Option<[&WallRow; 2]> {
    let innermost = |sign: f64| {
        let walls = header.planes().filter(|w| sign * w.normal[axis] > ACROSS);
        walls.max_by(|a, b| (sign * a.point[axis]).total_cmp(&(sign * b.point[axis])))
    };
    Some([innermost(1.0)?, innermost(-1.0)?])
}

/// Where the wall at the end of an axis stands along itself, seen from that at its beginning, or how far a sheared cell has slid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slide {
    /// Names of the walls; empty of a sheared cell.
    pub between: [String; 2],
    /// How far [m]; what differs from another snapshot has slid since.
    pub way: [f64; 3],
}

/// Across each axis, if there are walls at both ends or if the cell is sheared across it.
pub fn slides(header: &Header) -> [Option<Slide>; 3] {
    [0, 1, 2].map(|axis| {
        if let Some(Shear { across, .. }) = header.cell.shear() {
            let way = header.cell.way_above().into();
            return (across == axis).then_some(Slide { between: Default::default(), way });
        }
        let [low, high] = walls_across(header, axis)?;
        let mut way = high.point - low.point;
        way[axis] = 0.0;
        Some(Slide { between: [low.name.clone(), high.name.clone()], way: way.into() })
    })
}

/// A wall stands across an axis if its normal has at least this cosine with it: tilted by less than
/// 0.1 mrad.
pub(super) const ACROSS: f64 = 1.0 - 5e-9;

/// Whether a particle belongs to the region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Membership {
    /// No particle has this id.
    Unknown,
    /// Out of the region.
    Outside,
    /// In the region.
    Inside,
    /// Held on a course of its own: like a wall it belongs to no region.
    Held,
}

/// For each group of a snapshot 1 if its particles are held.
fn held_groups(header: &Header) -> &[u64] {
    let groups = header.drives.iter().find(|saved| saved.drive == groups::NAME);
    groups.and_then(|saved| saved.counts(&groups::HELD).ok()).unwrap_or_default()
}

/// Which particles belong to the region, by id: one byte per id ever given.
#[derive(Clone, Debug)]
pub struct Members {
    region: Region,
    memberships: Vec<Membership>,
    inside: u64,
}

impl Members {
    /// No particles yet.
    pub const fn new(region: Region) -> Self {
        Self { region, memberships: Vec::new(), inside: 0 }
    }

    /// Adds these particles, each by its centre, which a periodic axis brings back into the domain.
    ///
    /// # Errors
    /// An id that the header does not know, or one that stands twice.
    pub fn add(&mut self, header: &Header, particles: &ParticleTable) -> Result<(), PostError> {
        let held = held_groups(header);
        for (row, (&id, position)) in particles.id.iter().zip(&particles.position).enumerate() {
            if id.0 >= header.next_id {
                return Err(PostError::UnknownId { id, next_id: header.next_id });
            }
            let slot = id.0 as usize;
            if slot >= self.memberships.len() {
                self.memberships.resize(slot + 1, Membership::Unknown);
            }
            if self.memberships[slot] != Membership::Unknown {
                return Err(PostError::TwiceTheSameId { id });
            }
            let inside = match &self.region {
                Region::Whole => true,
                Region::Box(bounds) => bounds.contains(&header.cell.inside(*position)),
            };
            let group = particles.group.get(row).map_or(0, |&group| usize::from(group));
            self.memberships[slot] = match inside {
                _ if group > 0 && held.get(group - 1) == Some(&1) => Membership::Held,
                true => Membership::Inside,
                false => Membership::Outside,
            };
            self.inside += u64::from(self.memberships[slot] == Membership::Inside);
        }
        Ok(())
    }

    /// How many particles the region holds.
    pub const fn count(&self) -> u64 {
        self.inside
    }

    /// Whether a particle belongs to the region.
    ///
    /// # Errors
    /// If no particle has this id: the contacts are not those of these particles.
    pub fn holds(&self, id: GlobalId) -> Result<bool, PostError> {
        match self.memberships.get(id.0 as usize).copied().unwrap_or(Membership::Unknown) {
            Membership::Unknown => Err(PostError::ContactOfNobody { id }),
            membership => Ok(membership == Membership::Inside),
        }
    }

    /// Which ends of a contact belong to the region. A wall never does.
    ///
    /// # Errors
    /// As [`Members::holds`].
    pub fn ends(&self, a: GlobalId, b: GlobalId) -> Result<Ends, PostError> {
        let b_is_wall = b.wall_index().is_some();
        let wall = b_is_wall || self.is_held(a) || self.is_held(b);
        Ok(Ends { a: self.holds(a)?, b: !b_is_wall && self.holds(b)?, wall })
    }

    /// Is it a particle that is held?
    pub(super) fn is_held(&self, id: GlobalId) -> bool {
        self.memberships.get(id.0 as usize) == Some(&Membership::Held)
    }

    /// The ids of the particles in the region, ascending.
    pub(super) fn ids(&self) -> impl Iterator<Item = usize> + '_ {
        let inside = self
            .memberships
            .iter()
            .enumerate()
            .filter(|(_, membership)| **membership == Membership::Inside);
        inside.map(|(id, _)| id)
    }
}

/// Which ends of a contact belong to the region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ends {
    /// Particle A does.
    pub a: bool,
    /// Particle B does; never a wall.
    pub b: bool,
    /// B is a wall, or one of both is held.
    pub wall: bool,
}

impl Ends {
    /// What the contact weighs in an average over contacts, in halves: one for each of its particles in
    /// the region; a wall contact of a particle in the region is whole. So in the whole packing
    /// every contact weighs the same, and the sums of disjoint regions add up.
    pub const fn halves(self) -> u64 {
        match (self.a, self.b, self.wall) {
            (true, _, true) | (_, true, true) => 2,
            (a, b, _) => a as u64 + b as u64,
        }
    }
}

/// The volume of all particles over the volume of the whole: the exact sum, in which an
/// overlap counts twice and what a particle pushes into a wall counts too.
#[derive(Clone, Debug, Default)]
pub struct SolidVolume {
    sum: ExactSum,
    mass: ExactSum,
    particles: u64,
}

impl SolidVolume {
    /// Adds these particles.
    pub fn add(&mut self, header: &Header, particles: &ParticleTable) {
        for (row, shape) in particles.shape.iter().enumerate() {
            let shape = &header.shapes[shape.index()];
            let ratio = particles.volume_ratio(row);
            self.sum.add(shape.volume * ratio);
            self.mass.add(shape.mass * ratio);
            self.particles += 1;
        }
    }

    /// `γ̇ d √ρ` [√Pa]: over `√p` the inertial number, with `d` the diameter of the mean volume and `ρ` the density of the
    /// solid. `γ̇` is the rate of a sheared cell, or the largest of those at which walls at both ends of an axis slide along
    /// each other, or come together along z. `None` without such.
    pub fn inertia_of_strain(&self, header: &Header, packing: &Bounds) -> Option<f64> {
        let between_walls = |axis: usize| {
            let [low, high] = walls_across(header, axis)?;
            let mut velocity = high.velocity - low.velocity;
            if axis != 2 {
                velocity[axis] = 0.0;
            }
            if velocity == Vec3::zeros() {
                return None;
            }
            quotient(velocity.norm(), packing.lengths()[axis])
        };
        let of_cell = Some(header.cell.shear_rate()).filter(|_| header.cell.moves());
        let rate = (0..3).filter_map(between_walls).chain(of_cell).reduce(f64::max)?;
        let diameter = diameter_of(quotient(self.sum.value(), self.particles as f64)?);
        let density = quotient(self.mass.value(), self.sum.value())?;
        Some(rate * diameter * density.sqrt())
    }

    /// Their volume [m³].
    pub fn finish(&self) -> f64 {
        self.sum.value()
    }
}

/// The solid fraction of a box that cuts particles, on a lattice of sample points: the share of
/// points that lie in any particle (an overlap counts once). The points are the centres of
/// 256³ equal cells, so the same snapshot always gives the same number; for a box of
/// some ten particles' width the error is about 10⁻⁴. A flat face that lies along a side of the box adds up to half
/// a cell times its area.
#[derive(Clone, Debug)]
pub struct SampledSolid {
    bounds: Bounds,
    covered: Vec<u64>,
}

impl SampledSolid {
    /// Sample points along each side; a multiple of the 64 bits of a word.
    const POINTS: usize = 256;

    /// No particles yet.
    pub fn new(bounds: Bounds) -> Self {
        Self { bounds, covered: vec![0; Self::POINTS.pow(3) / 64] }
    }

    /// Marks the points that these particles, and their periodic images, cover.
    pub fn add(&mut self, header: &Header, particles: &ParticleTable) {
        let shifts = header.cell.shifts();
        for (row, position) in particles.position.iter().enumerate() {
            let body = Turned::of(header, particles, row);
            let around = body.bounds();
            let centre = header.cell.inside(*position);
            for shift in &shifts {
                self.mark(&(centre + shift), &body, &around);
            }
        }
    }

    /// Marks the points in one body, which has this box around it.
    fn mark(&mut self, centre: &Vec3, body: &Turned, around: &Bounds) {
        let cell = self.bounds.lengths() / Self::POINTS as f64;
        let range = |axis: usize| {
            let at = |x: f64| ((x - self.bounds.low[axis]) / cell[axis] - 0.5).ceil();
            let first = at(centre[axis] + around.low[axis]).max(0.0) as usize;
            let end = at(centre[axis] + around.high[axis]).max(0.0) as usize + 1;
            first..end.min(Self::POINTS)
        };
        let (xs, ys, zs) = (range(0), range(1), range(2));
        for k in zs {
            for j in ys.clone() {
                let low = self.bounds.low;
                let is_covered = |i: &usize| {
                    let index = Vec3::new(*i as f64, j as f64, k as f64).add_scalar(0.5);
                    body.contains(&(low + index.component_mul(&cell) - centre))
                };
                // What a convex body covers of a row has no gap.
                let Some(first) = xs.clone().find(is_covered) else { continue };
                let last = xs.clone().rfind(is_covered).unwrap_or(first);
                for i in first..=last {
                    let bit = (k * Self::POINTS + j) * Self::POINTS + i;
                    self.covered[bit / 64] |= 1 << (bit % 64);
                }
            }
        }
    }

    /// The share of points covered.
    pub fn finish(&self) -> f64 {
        let covered: u64 = self.covered.iter().map(|word| u64::from(word.count_ones())).sum();
        covered as f64 / (self.covered.len() * 64) as f64
    }
}

/// Strains of the whole against a first snapshot, compression positive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strain {
    /// `ln(H0/H)` with `H` the height, along z.
    pub axial: f64,
    /// `ln(V0/V)`; negative: the packing dilates.
    pub volumetric: f64,
}

impl Strain {
    /// Logarithmic strains as in section 3.2 of Lai et al. 2021; `None` without a height.
    pub fn between(first: &Bounds, now: &Bounds) -> Option<Self> {
        Some(Self {
            axial: quotient(first.lengths().z, now.lengths().z)?.ln(),
            volumetric: quotient(first.volume(), now.volume())?.ln(),
        })
    }
}
