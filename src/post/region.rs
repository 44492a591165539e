//! Measured region: the whole packing or a box in it, its volume, its particles, and its solid fraction.

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

/// A box with sides along the axes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Lowest corner [m].
    pub low: Vec3,
    /// Highest corner [m].
    pub high: Vec3,
}

impl FromStr for Bounds {
    type Err = String;

    /// Parses `x0,x1,y0,y1,z0,z1` in metres.
    fn from_str(text: &str) -> Result<Self, String> {
        let number =
            |word: &str| word.trim().parse().map_err(|_| format!("'{word}' is not a number"));
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

    /// The box without a layer of this thickness [m] along its sides; a periodic axis has no sides.
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

/// Measured region.
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
    /// If the box has no volume, or extends beyond a periodic side, where particles would have to count several times.
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

/// A length: thickness of a layer along the sides, side of a cell, or width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Margin {
    /// Length in metres.
    Metres(f64),
    /// Length in diameters of a sphere. It has the mean volume of the particles of one shape: the shape for which this volume is
    /// largest.
    Diameters(f64),
}

impl Margin {
    /// The length for the particles of a snapshot [m].
    ///
    /// # Errors
    /// If the file cannot be read or is invalid.
    pub fn metres(self, reader: &Reader) -> Result<f64, PostError> {
        let count = match self {
            Self::Metres(length) => return Ok(length),
            Self::Diameters(count) => count,
        };
        let header = reader.header();
        // For each shape the number of particles, and the sum of their volumes over that of the shape.
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

    /// Parses `0.004` as metres and `1.5d` as diameters.
    fn from_str(text: &str) -> Result<Self, String> {
        let (number, unit): (_, fn(f64) -> Self) = match text.strip_suffix('d') {
            Some(number) => (number, Self::Diameters),
            None => (text, Self::Metres),
        };
        let value = number.parse::<f64>().ok().filter(|v| *v >= 0.0 && v.is_finite());
        value
            .map(unit)
            .ok_or_else(|| "write metres, 0.004, or particle diameters, 1.5d".to_string())
    }
}

/// Diameter of the sphere of this volume [m].
fn diameter_of(volume: f64) -> f64 {
    (6.0 / PI * volume).cbrt()
}

/// Body of a row about its centre, with its orientation in the world.
pub(super) struct Turned<'a> {
    pub(super) shape: Cow<'a, Shape>,
    /// Columns are the axes of the body in the world.
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

    /// The body in the form of contact detection.
    pub(super) fn posed(&self) -> Posed<'_> {
        Posed { scale: self.scale, ..Posed::new(&self.shape, &self.frame) }
    }

    /// Farthest point along `direction` [m].
    pub(super) fn support(&self, direction: &Vec3) -> Vec3 {
        self.posed().support(direction)
    }

    /// Whether a point is in the body.
    fn contains(&self, point: &Vec3) -> bool {
        self.posed().contains(point)
    }

    /// Box around the body.
    fn bounds(&self) -> Bounds {
        let end = |k: usize, sign: f64| self.support(&Vec3::ith(k, sign))[k];
        Bounds { low: Vec3::from_fn(|k, _| end(k, -1.0)), high: Vec3::from_fn(|k, _| end(k, 1.0)) }
    }
}

/// Box of the whole packing. On each side it ends
/// * at the end of the period, if the axis is periodic;
/// * otherwise at a wall across that axis, if there is one, touched or not (the innermost of several);
/// * otherwise at the outermost particle surface, even of a particle in flight.
///
/// Slanted walls, walls of several planes, and walls of triangles, cylinders and cones do not bound the box. Reports warn where
/// the box is unreliable for that reason; a region within the packing is reliable.
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
    /// Adds the surfaces of particles.
    pub fn add(&mut self, header: &Header, particles: &ParticleTable) {
        for (row, centre) in particles.position.iter().enumerate() {
            let around = Turned::of(header, particles, row).bounds();
            self.low = self.low.inf(&(centre + around.low));
            self.high = self.high.sup(&(centre + around.high));
        }
    }

    /// The box; `None` if it has no volume, for example without particles and walls.
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

/// Warnings, one sentence each, if the measured box is not the space of the particles. Causes are sides of the whole packing that
/// neither a period nor a plane ends, and walls that are not planes across an axis.
pub(super) fn doubts(header: &Header, region: &Region, packing: Option<&Bounds>) -> Vec<String> {
    let (bounds, open) = match (region, packing) {
        (Region::Box(bounds), _) => (bounds, Vec::new()),
        (Region::Whole, Some(packing)) => (packing, open_sides(header)),
        (Region::Whole, None) => return Vec::new(),
    };
    let mut doubts = Vec::new();
    if !open.is_empty() {
        doubts.push(format!(
            "towards {} the box of the packing ends at the outermost particle, even in flight, as no period and no \
             plane limits it. Volume, solid fraction, stress and profiles refer to that box; use a --region within \
             the packing",
            open.join(", ")
        ));
    }
    let triangles = header.triangles_in_place();
    // Where a side is open, a wall outside the box of the particles may be the one that was meant to end it.
    let counts = |k: usize| !open.is_empty() || comes_into(&header.walls[k], k, &triangles, bounds);
    let others = (0..header.walls.len()).filter(|&k| !is_across(&header.walls[k]) && counts(k));
    let names: Vec<String> = others.map(|k| format!("\"{}\"", header.walls[k].name)).collect();
    if !names.is_empty() {
        let (walls, are) = match names[..] {
            [_] => ("wall", "is not a plane across an axis and limits"),
            _ => ("walls", "are not planes across an axis and limit"),
        };
        doubts.push(format!(
            "{walls} {} {are} no region: the space behind is counted in volumes and areas of other walls; use a \
             --region in front of it",
            listed(names, MOST_NAMED)
        ));
    }
    doubts
}

/// Sides on which neither a period nor a plane across the axis ends the packing, as -x.
fn open_sides(header: &Header) -> Vec<String> {
    let is_open = |face: &Face| {
        let closes = |plane: &WallRow| face.normal.dot(&plane.normal) > ACROSS;
        !face.repeats && !header.planes().any(closes)
    };
    let faces = header.cell.faces().into_iter().filter(is_open);
    faces.map(|face| face.name.to_owned()).collect()
}

/// True for a wall of one plane across an axis.
fn is_across(wall: &WallRow) -> bool {
    wall.is_one_plane() && wall.normal.amax() > ACROSS
}

/// True if the wall passes through the box or cuts off a part of it. `triangles` are those of all walls in place. A triangle
/// counts if the box around it and its plane pass through the box.
fn comes_into(
    wall: &WallRow,
    index: usize,
    triangles: &[(usize, [Vec3; 3])],
    bounds: &Bounds,
) -> bool {
    let half = bounds.lengths() * 0.5;
    let middle = bounds.low + half;
    // Contact with the box from outside does not count.
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

/// For each axis, true if a period or walls on both sides end the packing. Along the other axes the box of an [`Extent`] ends at
/// the outermost particle, where a single particle that bounces would appear as a strain.
pub fn enclosed(header: &Header) -> [bool; 3] {
    let mut enclosed = header.cell.periodic();
    for k in header.cell.open_axes() {
        let wall = |sign: f64| header.planes().any(|w| sign * w.normal[k] > ACROSS);
        enclosed[k] = wall(1.0) && wall(-1.0);
    }
    enclosed
}

/// Innermost walls at both ends of an axis, which bound the packing.
pub(super) fn walls_across(header: &Header, axis: usize) -> Option<[&WallRow; 2]> {
    let innermost = |sign: f64| {
        let walls = header.planes().filter(|w| sign * w.normal[axis] > ACROSS);
        walls.max_by(|a, b| (sign * a.point[axis]).total_cmp(&(sign * b.point[axis])))
    };
    Some([innermost(1.0)?, innermost(-1.0)?])
}

/// Tangential displacement of the wall at the end of an axis against the wall at its beginning, or of the images of a sheared
/// cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Slide {
    /// Names of the walls; empty for a sheared cell.
    pub between: [String; 2],
    /// Displacement [m]; its change between two snapshots is the sliding between them.
    pub way: [f64; 3],
}

/// Displacement across each axis, if there are walls at both ends or the cell is sheared across it.
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

/// Smallest cosine between an axis and the normal of a wall that counts as a plane across it: tilted by less than 0.1 mrad.
pub(super) const ACROSS: f64 = 1.0 - 5e-9;

/// Relation of a particle to the region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Membership {
    /// No particle has this id.
    Unknown,
    /// Outside the region.
    Outside,
    /// Inside the region.
    Inside,
    /// Held on a prescribed motion: like a wall it belongs to no region.
    Held,
}

/// For each group of a snapshot, 1 if its particles are held.
fn held_groups(header: &Header) -> &[u64] {
    let groups = header.drives.iter().find(|saved| saved.drive == groups::NAME);
    groups.and_then(|saved| saved.counts(&groups::HELD).ok()).unwrap_or_default()
}

/// Particles of the region, by id: one byte per id ever given.
#[derive(Clone, Debug)]
pub struct Members {
    region: Region,
    memberships: Vec<Membership>,
    inside: u64,
}

impl Members {
    /// An empty set.
    pub const fn new(region: Region) -> Self {
        Self { region, memberships: Vec::new(), inside: 0 }
    }

    /// Adds particles by their centres, which are mapped into a periodic domain.
    ///
    /// # Errors
    /// If an id was never given, or occurs twice.
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

    /// Number of particles in the region.
    pub const fn count(&self) -> u64 {
        self.inside
    }

    /// Whether a particle belongs to the region.
    ///
    /// # Errors
    /// If no particle has this id: the contacts do not belong to these particles.
    pub fn holds(&self, id: GlobalId) -> Result<bool, PostError> {
        match self.memberships.get(id.0 as usize).copied().unwrap_or(Membership::Unknown) {
            Membership::Unknown => Err(PostError::ContactOfNobody { id }),
            membership => Ok(membership == Membership::Inside),
        }
    }

    /// Ends of a contact that belong to the region. A wall never does.
    ///
    /// # Errors
    /// See [`Members::holds`].
    pub fn ends(&self, a: GlobalId, b: GlobalId) -> Result<Ends, PostError> {
        let b_is_wall = b.wall_index().is_some();
        let wall = b_is_wall || self.is_held(a) || self.is_held(b);
        Ok(Ends { a: self.holds(a)?, b: !b_is_wall && self.holds(b)?, wall })
    }

    /// True for a held particle.
    pub(super) fn is_held(&self, id: GlobalId) -> bool {
        self.memberships.get(id.0 as usize) == Some(&Membership::Held)
    }

    /// Ids of the particles in the region, ascending.
    pub(super) fn ids(&self) -> impl Iterator<Item = usize> + '_ {
        let inside = self
            .memberships
            .iter()
            .enumerate()
            .filter(|(_, membership)| **membership == Membership::Inside);
        inside.map(|(id, _)| id)
    }
}

/// Ends of a contact that belong to the region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ends {
    /// Particle A belongs to it.
    pub a: bool,
    /// Particle B belongs to it; false for a wall.
    pub b: bool,
    /// B is a wall, or one of the particles is held.
    pub wall: bool,
}

impl Ends {
    /// Weight of the contact in averages over contacts, in halves: one half for each of its particles in the region. A wall
    /// contact of a particle in the region counts whole. In the whole packing every contact has the same weight, and sums over
    /// disjoint regions add up.
    pub const fn halves(self) -> u64 {
        match (self.a, self.b, self.wall) {
            (true, _, true) | (_, true, true) => 2,
            (a, b, _) => a as u64 + b as u64,
        }
    }
}

/// Exact sum of the volumes of all particles. An overlap counts twice, and the part of a particle within a wall counts too.
#[derive(Clone, Debug, Default)]
pub struct SolidVolume {
    sum: ExactSum,
    mass: ExactSum,
    particles: u64,
}

impl SolidVolume {
    /// Adds particles.
    pub fn add(&mut self, header: &Header, particles: &ParticleTable) {
        for (row, shape) in particles.shape.iter().enumerate() {
            let shape = &header.shapes[shape.index()];
            let ratio = particles.volume_ratio(row);
            self.sum.add(shape.volume * ratio);
            self.mass.add(shape.mass * ratio);
            self.particles += 1;
        }
    }

    /// `γ̇ d √ρ` [√Pa]: over `√p` it is the inertial number, with `d` the diameter of the mean volume and `ρ` the density of the
    /// solid. `γ̇` is the rate of a sheared cell. Otherwise it is the largest rate of walls at both ends of an axis that slide
    /// along each other, or approach each other along z. `None` without either.
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

    /// Volume of all particles [m³].
    pub fn finish(&self) -> f64 {
        self.sum.value()
    }
}

/// Solid fraction of a box that cuts particles: the share of sample points that lie in any particle (an overlap counts once). The
/// points are the centres of 256³ equal cells, so that a snapshot always gives the same number. For a box of some ten particles'
/// width the error is about 10⁻⁴. A flat face along a side of the box adds up to half a cell times its area.
#[derive(Clone, Debug)]
pub struct SampledSolid {
    bounds: Bounds,
    covered: Vec<u64>,
}

impl SampledSolid {
    /// Number of sample points along each side; a multiple of the 64 bits of a word.
    const POINTS: usize = 256;

    /// A box without particles.
    pub fn new(bounds: Bounds) -> Self {
        Self { bounds, covered: vec![0; Self::POINTS.pow(3) / 64] }
    }

    /// Marks the points covered by these particles and their periodic images.
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

    /// Marks the points in one body; `around` is its bounding box about the centre.
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
                // The part of a row in a convex body has no gap.
                let Some(first) = xs.clone().find(is_covered) else { continue };
                let last = xs.clone().rfind(is_covered).unwrap_or(first);
                for i in first..=last {
                    let bit = (k * Self::POINTS + j) * Self::POINTS + i;
                    self.covered[bit / 64] |= 1 << (bit % 64);
                }
            }
        }
    }

    /// Share of points covered.
    pub fn finish(&self) -> f64 {
        let covered: u64 = self.covered.iter().map(|word| u64::from(word.count_ones())).sum();
        covered as f64 / (self.covered.len() * 64) as f64
    }
}

/// Strains of the whole packing relative to a first snapshot, compression positive.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strain {
    /// `ln(H0/H)` with `H` the height, along z.
    pub axial: f64,
    /// `ln(V0/V)`; negative if the packing dilates.
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
