//! Fields on a grid by coarse graining (Goldhirsch 2010, DOI 10.1007/s10035-010-0181-z).
//!
//! With a weight `φ(r)` whose integral is 1,
//!
//! | field | unit | |
//! |---|---|---|
//! | density | kg/m³ | `ρ = Σ m_i φ(r - x_i)` |
//! | solid fraction | | `Σ V_i φ(r - x_i)` |
//! | velocity | m/s | `V = Σ m_i v_i φ(r - x_i) / ρ`, 0 where no particle is near |
//! | stress of contacts | Pa | `Σ f_i l_j ∫₀¹ φ(r - x_A - s l) ds`, over contacts |
//! | stress of the motion | Pa | `Σ m_i v'_i v'_j φ(r - x_i)` with `v' = v - V(r)` |
//!
//! `f` is the force of A on B. `l` is the branch from the centre of A to that of B, or to the contact point with a wall (Weinhart
//! et al. 2012, DOI 10.1007/s10035-012-0317-4). Compression is positive. With `w` the width, `φ` is
//!
//! * Lucy's polynomial: `(1 + 3q) (1 - q)³` with `q = r / 2w` below 1, otherwise 0; or
//! * a Gaussian: `exp(-r² / 2w²)` up to `r = 3w`.
//!
//! The weights of one particle, or of one point of a branch, at the centres of all cells around it are scaled to add up to 1. In
//! a sheared cell the images have slid relative to each other; there the weights of a particle and its images add up to 1
//! together. Therefore the integral of a field over the grid (sum over cells times their volume) equals the sum over the
//! particles up to rounding, for any width. This holds for mass, momentum and `Σ f_i l_j`, which is volume times stress of the
//! report. The integral along a branch uses Gauss-Legendre quadrature with four points on each of its parts, which are at most as
//! long as the width.
//!
//! Without a region the grid extends to the range of the weights. In a region, particles outside count if their weights reach
//! into it.

use super::check;
use super::errors::MeasureError;
use super::grid::Grid;
use super::pieces;
use super::region::{Bounds, Region};
use crate::comm::alone::Alone;
use crate::math::{Mat3, Vec3};
use crate::output::SnapshotError;
use crate::output::hdf5::{Column, SnapshotFile};
use crate::output::header::Header;
use crate::output::snapshot::Reader;
use crate::post::vtp::{Array, ImageData};
use serde::Serialize;
use std::io;
use std::path::Path;

/// Weight function that spreads a particle over its neighbourhood.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Weight {
    /// Lucy's polynomial, 0 beyond twice the width.
    #[default]
    Lucy,
    /// A Gaussian, cut off at three times the width.
    Gauss,
}

impl Weight {
    /// Range of the weight [m].
    pub fn range(self, width: f64) -> f64 {
        match self {
            Self::Lucy => 2.0 * width,
            Self::Gauss => 3.0 * width,
        }
    }

    /// Weight at a distance [m], up to a constant factor.
    fn at(self, distance: f64, width: f64) -> f64 {
        if distance >= self.range(width) {
            return 0.0;
        }
        match self {
            Self::Lucy => {
                let q = distance / self.range(width);
                (1.0 + 3.0 * q) * (1.0 - q).powi(3)
            }
            Self::Gauss => (-0.5 * (distance / width).powi(2)).exp(),
        }
    }
}

/// Settings of coarse graining, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothing {
    /// Weight function.
    pub weight: Weight,
    /// Width of the weight [m].
    pub width: f64,
    /// Largest side of a cell [m]; no larger than the width.
    pub side: f64,
}

/// Fields of a snapshot. All lists are by cell.
#[derive(Clone, Debug)]
pub struct Fields {
    /// Grid of the fields.
    pub grid: Grid,
    /// Time [s].
    pub time: f64,
    /// Density [kg/m³].
    pub density: Vec<f64>,
    /// Solid fraction [-].
    pub solid_fraction: Vec<f64>,
    /// Velocity [m/s].
    pub velocity: Vec<Vec3>,
    /// Stress of contacts [Pa].
    pub contact_stress: Vec<Mat3>,
    /// Stress of the motion [Pa].
    pub kinetic_stress: Vec<Mat3>,
}

/// Points and weights of the integral from 0 to 1 along a branch of this length [m], for a weight of this width [m].
fn along(length: f64, width: f64) -> impl Iterator<Item = (f64, f64)> {
    let parts = (length / width).ceil().max(1.0);
    let points = move |k: usize| FOUR.map(|(s, share)| ((k as f64 + s) / parts, share / parts));
    (0..parts as usize).flat_map(points)
}

/// Points and weights of Gauss-Legendre quadrature from 0 to 1.
const FOUR: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

impl Fields {
    /// Fields of a snapshot. Sums are taken in the order of the rows, that of the ids.
    ///
    /// # Errors
    /// If a file cannot be read or is invalid, the region has no particles, or the width does not fit.
    pub fn of(reader: &Reader, region: Region, how: Smoothing) -> Result<Self, MeasureError> {
        let header = reader.header();
        region.check(header)?;
        let range = how.weight.range(how.width);
        check_width(header, how)?;
        let bounds = match region {
            Region::Box(bounds) => bounds,
            Region::Whole => reached(reader, range)?,
        };
        let grid = Grid::of_at_most(&bounds, how.side)?;
        let mut spread = Spread::new(header, grid, how);
        let mut fields = Self::empty(grid, header.time);
        let mut reached_by = 0u64;
        for rows in pieces(reader.particle_count()) {
            let particles = reader.particles(rows)?;
            check::check_particles(header, &particles)?;
            for row in 0..particles.id.len() {
                let shape = &header.shapes[particles.shape[row].index()];
                let ratio = particles.volume_ratio(row);
                let (mass, volume) = (shape.mass * ratio, shape.volume * ratio);
                let velocity = particles.velocity[row];
                let mut is_near = false;
                spread.point(&particles.position[row], |cell, share, image| {
                    let velocity = velocity + image;
                    let mass = mass * share;
                    fields.density[cell] += mass;
                    fields.solid_fraction[cell] += volume * share;
                    fields.velocity[cell] += velocity * mass;
                    fields.kinetic_stress[cell] += velocity * velocity.transpose() * mass;
                    is_near = true;
                });
                reached_by += u64::from(is_near);
            }
        }
        for rows in pieces(reader.contact_count()?) {
            let contacts = reader.contacts(rows)?;
            check::check_contacts(&contacts)?;
            for row in 0..contacts.a.len() {
                let branch = contacts.branch[row];
                let stress = contacts.force(row) * branch.transpose();
                let mut is_near = false;
                for (s, part) in along(branch.norm(), how.width) {
                    spread.point(&(contacts.centre[row] + branch * s), |cell, share, _| {
                        fields.contact_stress[cell] += stress * (part * share);
                        is_near = true;
                    });
                }
                reached_by += u64::from(is_near);
            }
        }
        if reached_by == 0 {
            return Err(MeasureError::NobodyThere);
        }
        fields.finish();
        Ok(fields)
    }

    fn empty(grid: Grid, time: f64) -> Self {
        let cells = grid.len();
        Self {
            grid,
            time,
            density: vec![0.0; cells],
            solid_fraction: vec![0.0; cells],
            velocity: vec![Vec3::zeros(); cells],
            contact_stress: vec![Mat3::zeros(); cells],
            kinetic_stress: vec![Mat3::zeros(); cells],
        }
    }

    /// Converts sums to fields.
    fn finish(&mut self) {
        let per_volume = 1.0 / self.grid.volume();
        for cell in 0..self.grid.len() {
            let mass = self.density[cell];
            let momentum = self.velocity[cell];
            self.velocity[cell] = if mass > 0.0 { momentum / mass } else { Vec3::zeros() };
            self.kinetic_stress[cell] -= momentum * self.velocity[cell].transpose();
            self.kinetic_stress[cell] *= per_volume;
            self.contact_stress[cell] *= per_volume;
            self.density[cell] *= per_volume;
            self.solid_fraction[cell] *= per_volume;
        }
    }

    /// Mean stress of contacts and motion [Pa].
    fn pressure(&self, cell: usize) -> f64 {
        (self.contact_stress[cell] + self.kinetic_stress[cell]).trace() / 3.0
    }

    /// Integral of the density [kg].
    pub fn mass(&self) -> f64 {
        self.density.iter().sum::<f64>() * self.grid.volume()
    }

    /// Columns: name, numbers in a row, unit, numbers.
    fn columns(&self) -> [(&'static str, usize, &'static str, Vec<f64>); 6] {
        let rows = |tensors: &[Mat3]| {
            tensors.iter().flat_map(|t| t.transpose().as_slice().to_vec()).collect()
        };
        let velocity = self.velocity.iter().flat_map(|v| v.as_slice().to_vec()).collect();
        let pressure = (0..self.grid.len()).map(|cell| self.pressure(cell)).collect();
        [
            ("density", 1, "kg/m3", self.density.clone()),
            ("solid_fraction", 1, "1", self.solid_fraction.clone()),
            ("velocity", 3, "m/s", velocity),
            ("pressure", 1, "Pa", pressure),
            ("contact_stress", 9, "Pa", rows(&self.contact_stress)),
            ("kinetic_stress", 9, "Pa", rows(&self.kinetic_stress)),
        ]
    }

    /// Writes the fields as the cells of an image in VTKHDF, for ParaView.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_vtkhdf(&self, path: &Path) -> Result<(), SnapshotError> {
        let mut alone = Alone::default();
        let bytes = (self.grid.len() * 24 * size_of::<f64>()) as u64;
        let mut file = SnapshotFile::create(path, bytes, &mut alone)?;
        let (root, data) = ("/VTKHDF", "/VTKHDF/CellData");
        file.group(root)?;
        file.numbers(root, "Version", &[1_i64, 0])?;
        file.text(root, "Type", "ImageData")?;
        let [x, y, z] = self.grid.cells.map(|cells| cells as i64);
        file.numbers(root, "WholeExtent", &[0, x, 0, y, 0, z])?;
        file.numbers(root, "Origin", self.grid.low.as_slice())?;
        file.numbers(root, "Spacing", self.grid.sides.as_slice())?;
        file.numbers(root, "Direction", Mat3::identity().as_slice())?;
        file.group(data)?;
        for (name, width, unit, values) in self.columns() {
            let place = format!("{data}/{name}");
            file.image(&Column { place: &place, width, unit }, self.grid.cells, &values)?;
        }
        file.close()
    }

    /// The fields for the XML files of VTK.
    pub fn image_data(&self) -> ImageData {
        ImageData {
            time: self.time,
            cells: self.grid.cells,
            origin: self.grid.low.into(),
            spacing: self.grid.sides.into(),
            of_cells: self
                .columns()
                .iter()
                .map(|(name, width, _, values)| Array::new(name, *width, values))
                .collect(),
        }
    }

    /// Writes the cells that a particle or branch reaches, one per row.
    ///
    /// # Errors
    /// If the writer fails.
    pub fn write_csv(&self, out: impl io::Write) -> csv::Result<()> {
        let mut table = csv::Writer::from_writer(out);
        let is_reached =
            |cell: &usize| self.density[*cell] > 0.0 || self.contact_stress[*cell] != Mat3::zeros();
        for cell in (0..self.grid.len()).filter(is_reached) {
            let (centre, velocity) = (self.grid.centre(cell), self.velocity[cell]);
            let [contacts, motion] = [&self.contact_stress, &self.kinetic_stress].map(|t| t[cell]);
            table.serialize(Row {
                x_m: centre.x,
                y_m: centre.y,
                z_m: centre.z,
                density_kg_per_m3: self.density[cell],
                solid_fraction: self.solid_fraction[cell],
                vx_m_per_s: velocity.x,
                vy_m_per_s: velocity.y,
                vz_m_per_s: velocity.z,
                pressure_pa: self.pressure(cell),
                contact_xx_pa: contacts.m11,
                contact_yy_pa: contacts.m22,
                contact_zz_pa: contacts.m33,
                contact_xy_pa: 0.5 * (contacts.m12 + contacts.m21),
                contact_xz_pa: 0.5 * (contacts.m13 + contacts.m31),
                contact_yz_pa: 0.5 * (contacts.m23 + contacts.m32),
                kinetic_xx_pa: motion.m11,
                kinetic_yy_pa: motion.m22,
                kinetic_zz_pa: motion.m33,
                kinetic_xy_pa: motion.m12,
                kinetic_xz_pa: motion.m13,
                kinetic_yz_pa: motion.m23,
            })?;
        }
        Ok(table.flush()?)
    }
}

/// A cell in `fields_STEP.csv`, with the symmetric part of the stress of contacts.
#[derive(Serialize)]
struct Row {
    x_m: f64,
    y_m: f64,
    z_m: f64,
    density_kg_per_m3: f64,
    solid_fraction: f64,
    vx_m_per_s: f64,
    vy_m_per_s: f64,
    vz_m_per_s: f64,
    pressure_pa: f64,
    contact_xx_pa: f64,
    contact_yy_pa: f64,
    contact_zz_pa: f64,
    contact_xy_pa: f64,
    contact_xz_pa: f64,
    contact_yz_pa: f64,
    kinetic_xx_pa: f64,
    kinetic_yy_pa: f64,
    kinetic_zz_pa: f64,
    kinetic_xy_pa: f64,
    kinetic_xz_pa: f64,
    kinetic_yz_pa: f64,
}

/// Checks that the cells resolve the weight, and that at most one image of a particle is near any place.
fn check_width(header: &Header, how: Smoothing) -> Result<(), MeasureError> {
    let Smoothing { weight, width, side } = how;
    if !(width > 0.0 && width.is_finite()) {
        return Err(MeasureError::NoSide { side: width });
    }
    if side > width {
        return Err(MeasureError::CoarserThanWeight { side, width });
    }
    let range = weight.range(width);
    if header.cell.is_tilted() {
        return Err(MeasureError::Leaning);
    }
    match header.cell.thin(2.0 * range).next() {
        Some((axis, period)) => Err(MeasureError::WiderThanPeriod { axis, period, range }),
        None => Ok(()),
    }
}

/// Box within the range of the weights of all particles and branches; along a periodic axis the period.
fn reached(reader: &Reader, range: f64) -> Result<Bounds, MeasureError> {
    let header = reader.header();
    let (mut low, mut high) = (Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY));
    let mut add = |point: &Vec3| {
        low = low.inf(point);
        high = high.sup(point);
    };
    for rows in pieces(reader.particle_count()) {
        reader.particles(rows)?.position.iter().for_each(&mut add);
    }
    for rows in pieces(reader.contact_count()?) {
        let contacts = reader.contacts(rows)?;
        contacts.centre.iter().zip(&contacts.branch).for_each(|(a, l)| add(&(a + l)));
    }
    if low.x > high.x {
        return Err(MeasureError::NobodyThere);
    }
    let range = Vec3::repeat(range);
    let (low, high) = header.cell.with_periods(low - range, high + range);
    Ok(Bounds { low, high })
}

/// Distributes points over cells.
struct Spread {
    grid: Grid,
    how: Smoothing,
    /// Shift to each image [m], and its velocity relative to the body [m/s].
    images: Vec<(Vec3, Vec3)>,
    /// Seam of a sheared cell.
    seam: Option<Seam>,
    /// Weights of the cells around a point; `None` for cells beyond the grid.
    near: Vec<(Option<usize>, f64)>,
}

/// Boundary of a sheared cell at which images have slid along each other. Cells on either side belong to different images, whose
/// weights do not add up to 1 separately.
struct Seam {
    across: usize,
    /// Ends of the period [m].
    ends: [f64; 2],
    /// Shift to one image on each side, and to the body [m].
    shifts: Vec<Vec3>,
}

impl Seam {
    fn of(header: &Header) -> Option<Self> {
        let cell = &header.cell;
        let shear = cell.shear()?;
        let across = shear.across;
        // Images that are also shifted along the seam lie alike relative to the centres of cells.
        let is_first =
            |shift: &Vec3| (0..3).all(|k| k == across || k == shear.along || shift[k] == 0.0);
        let mut shifts: Vec<Vec3> = cell.shifts().into_iter().filter(is_first).collect();
        shifts.sort_by(|a, b| a[across].total_cmp(&b[across]));
        shifts.dedup_by(|a, b| a[across] == b[across]);
        let (low, high) = cell.corners();
        Some(Self { across, ends: [low[across], high[across]], shifts })
    }

    /// Sum of the weights of a point and its images at the centres of all cells in the period.
    fn sum(&self, grid: &Grid, how: Smoothing, point: &Vec3) -> f64 {
        let mut sum = 0.0;
        let range = how.weight.range(how.width);
        let [low, high] = self.ends;
        for place in self.shifts.iter().map(|shift| point + shift) {
            if place[self.across] < low - range || place[self.across] > high + range {
                continue;
            }
            around(grid, how, &(place - grid.low), |cell, weight| {
                let middle = (cell[self.across] as f64 + 0.5) * grid.sides[self.across];
                if (low..high).contains(&(grid.low[self.across] + middle)) {
                    sum += weight;
                }
            });
        }
        sum
    }
}

/// Calls `tell` for the cells around a place, given from the corner of the grid [m]. Arguments are the indices, also beyond the
/// grid, and the weight at the centre of the cell.
fn around(grid: &Grid, how: Smoothing, place: &Vec3, mut tell: impl FnMut([i64; 3], f64)) {
    let (sides, range) = (grid.sides, how.weight.range(how.width));
    let first: [i64; 3] = [0, 1, 2].map(|k| ((place[k] - range) / sides[k] - 0.5).ceil() as i64);
    let last: [i64; 3] = [0, 1, 2].map(|k| ((place[k] + range) / sides[k] - 0.5).floor() as i64);
    let off = |k: usize, index: i64| (index as f64 + 0.5) * sides[k] - place[k];
    for z in first[2]..=last[2] {
        for y in first[1]..=last[1] {
            let square = off(2, z).powi(2) + off(1, y).powi(2);
            for x in first[0]..=last[0] {
                let distance = (square + off(0, x).powi(2)).sqrt();
                tell([x, y, z], how.weight.at(distance, how.width));
            }
        }
    }
}

impl Spread {
    fn new(header: &Header, grid: Grid, how: Smoothing) -> Self {
        let cell = &header.cell;
        let images = cell.shifts().into_iter();
        let images = images.map(|shift| (shift, cell.velocity_of_image(&shift))).collect();
        Self { grid, how, images, seam: Seam::of(header), near: Vec::new() }
    }

    /// Calls `tell` for every cell near a point or an image of it. Arguments are the cell, its share, and the velocity of the
    /// image relative to the body.
    fn point(&mut self, point: &Vec3, mut tell: impl FnMut(usize, f64, Vec3)) {
        let range = self.how.weight.range(self.how.width);
        let Self { grid, how, images, seam, near } = self;
        // Computed only for a point near the grid.
        let mut of_all = None;
        for (shift, velocity) in images {
            let place = point + *shift - grid.low;
            let is_far = (0..3).any(|k| {
                place[k] < -range || place[k] > grid.cells[k] as f64 * grid.sides[k] + range
            });
            if is_far {
                continue;
            }
            near.clear();
            let mut of_image = 0.0;
            around(grid, *how, &place, |cell, weight| {
                of_image += weight;
                near.push((grid.cell(cell), weight));
            });
            let sum = match seam {
                Some(seam) => *of_all.get_or_insert_with(|| seam.sum(grid, *how, point)),
                None => of_image,
            };
            for &(cell, weight) in near.iter() {
                if let (Some(cell), true) = (cell, weight > 0.0) {
                    tell(cell, weight / sum, *velocity);
                }
            }
        }
    }
}
