//! Mixing of two groups of particles: the index of Lacey (1954, DOI 10.1002/jctb.5010040502).
//!
//! `M = (σ0² - σ²) / (σ0² - σr²)`, where
//!
//! * `σ² = Σ n_k (p_k - p)² / Σ n_k`: variance of the share `p_k` of the first group over cells with `n_k` particles, weighted by
//!   `n_k`; `p` is the share of all cells together;
//! * `σ0² = p (1 - p)`: variance of separated groups;
//! * `σr² = p (1 - p) (C - 1) / (N - 1)`: mean of `σ²` when `N` particles are shuffled among their places in `C` cells. It
//!   replaces the `p (1 - p) / n` of Lacey for cells that are not equally full.
//!
//! `M` is 0 if no cell has particles of both groups, and 1 in the mean of random mixtures. It counts particles. A finer grid
//! gives a lower `M` for the same unmixed state. A mixture more even than random has more than 1. If a plane across an axis
//! divides the groups in the first snapshot, it is made a face between cells, so that this state has 0.

use super::check;
use super::errors::MeasureError;
use super::grid::Grid;
use super::pieces;
use super::region::{Bounds, Region};
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::output::header::Header;
use crate::output::snapshot::Reader;
use crate::output::tables::ParticleTable;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::str::FromStr;

/// Definition of the first group; all other particles are the second.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Groups {
    /// Particles of the shape with this name.
    Shape(String),
    /// Lower half along this axis in the first snapshot.
    Half(usize),
}

impl FromStr for Groups {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let axis = |name: &str| crate::cell::AXES.iter().position(|&axis| axis == name);
        match text.split_once(':') {
            Some(("shape", name)) if !name.is_empty() => Ok(Self::Shape(name.to_owned())),
            Some(("half", name)) if axis(name).is_some() => {
                Ok(Self::Half(axis(name).unwrap_or_default()))
            }
            _ => Err("write shape:NAME, or half:x, half:y or half:z".to_owned()),
        }
    }
}

/// Mixing of a snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mixing {
    /// Step of the snapshot.
    pub step: u64,
    /// Time of the snapshot [s].
    pub time_s: f64,
    /// Number of particles of a group in the cells.
    pub grains: u64,
    /// Number of cells with such particles.
    pub cells: u64,
    /// Share of the first group.
    pub share: f64,
    /// `σ²`.
    pub variance: f64,
    /// `σ0²`.
    pub variance_apart: f64,
    /// `σr²`.
    pub variance_random: f64,
    /// `M`; `None` if all particles are in one cell or each is alone in its cell.
    pub index: Option<f64>,
    /// Number of particles of no group, which came after the first snapshot.
    pub left_out: u64,
}

/// Groups of the particles, and the plane between both in the first snapshot.
#[derive(Clone, Debug)]
pub struct Members {
    of: Named,
    /// Axis and position [m] of the plane; `None` if no such plane divides the groups.
    plane: Option<(usize, f64)>,
}

#[derive(Clone, Debug)]
enum Named {
    /// By the name of the shape.
    Shape(String),
    /// By the place in the first snapshot: true for a particle of the first group. Later particles are not listed.
    Listed(BTreeMap<GlobalId, bool>),
}

impl Members {
    /// Groups from the first snapshot.
    ///
    /// # Errors
    /// If the file cannot be read, or does not have the shape.
    pub fn of(groups: &Groups, first: &Reader) -> Result<Self, MeasureError> {
        match groups {
            Groups::Shape(name) => {
                let shapes = &first.header().shapes;
                if !shapes.iter().any(|shape| &shape.name == name) {
                    let known = shapes.iter().map(|shape| shape.name.clone()).collect();
                    return Err(MeasureError::NoSuchShape { name: name.clone(), known });
                }
                let mut members = Self { of: Named::Shape(name.clone()), plane: None };
                members.plane = members.plane_in(first)?;
                Ok(members)
            }
            Groups::Half(axis) => {
                let mut places = Vec::new();
                for rows in pieces(first.particle_count()) {
                    let particles = first.particles(rows)?;
                    check::check_particles(first.header(), &particles)?;
                    let along = particles.position.iter().map(|place| place[*axis]);
                    places.extend(along.zip(particles.id));
                }
                places.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                let half = halved(&places);
                let ends = (half > 0).then(|| places.get(half - 1).zip(places.get(half))).flatten();
                let plane = ends.map(|(below, above)| (*axis, 0.5 * (below.0 + above.0)));
                let listed = places.into_iter().enumerate().map(|(k, (_, id))| (id, k < half));
                Ok(Self { of: Named::Listed(listed.collect()), plane })
            }
        }
    }

    /// The plane across an axis that divides both groups in a snapshot with the widest gap, if there is one.
    fn plane_in(&self, first: &Reader) -> Result<Option<(usize, f64)>, MeasureError> {
        let nowhere =
            Bounds { low: Vec3::repeat(f64::INFINITY), high: Vec3::repeat(f64::NEG_INFINITY) };
        let mut reached = [nowhere; 2];
        for rows in pieces(first.particle_count()) {
            let particles = first.particles(rows)?;
            check::check_particles(first.header(), &particles)?;
            for (row, place) in particles.position.iter().enumerate() {
                let Some(group) = self.is_first(first.header(), &particles, row) else { continue };
                let bounds = &mut reached[usize::from(group)];
                bounds.low = bounds.low.inf(place);
                bounds.high = bounds.high.sup(place);
            }
        }
        let [a, b] = reached;
        let gaps = (0..3).flat_map(|k| [(k, a.high[k], b.low[k]), (k, b.high[k], a.low[k])]);
        let gaps = gaps.filter(|(_, from, to)| from < to && (to - from).is_finite());
        let widest = gaps.max_by(|x, y| (x.2 - x.1).total_cmp(&(y.2 - y.1)));
        Ok(widest.map(|(axis, from, to)| (axis, 0.5 * (from + to))))
    }

    /// Whether a row is of the first group; `None` if it is of no group.
    fn is_first(&self, header: &Header, particles: &ParticleTable, row: usize) -> Option<bool> {
        match &self.of {
            Named::Shape(name) => Some(header.shapes[particles.shape[row].index()].name == *name),
            Named::Listed(listed) => listed.get(&particles.id[row]).copied(),
        }
    }

    /// The grid with a face at the plane that divides the groups, if there is one.
    fn divided(&self, grid: Grid) -> Result<Grid, MeasureError> {
        self.plane.map_or(Ok(grid), |(axis, place)| grid.with_face(axis, place))
    }
}

/// Number of places, in ascending order, in the lower half; particles side by side are not divided.
fn halved(places: &[(f64, GlobalId)]) -> usize {
    let half = places.len() / 2;
    let Some((first, last)) = places.first().zip(places.last()) else { return 0 };
    let hair = 1e-9 * (last.0 - first.0);
    let is_gap = |&k: &usize| places[k].0 - places[k - 1].0 > hair;
    let gaps = (1..places.len()).filter(is_gap);
    gaps.min_by_key(|k| k.abs_diff(half)).unwrap_or(half)
}

/// Cells of about this side [m] of the domain, extended by further cells to hold the centres of all particles where walls have
/// moved out of it. They are the same in all snapshots of a domain.
fn cells_of_all(reader: &Reader, members: &Members, side: f64) -> Result<Grid, MeasureError> {
    let header = reader.header();
    let (low, high) = header.cell.corners();
    let mut reached = Bounds { low, high };
    let grid = members.divided(Grid::of(&reached, side)?)?;
    for rows in pieces(reader.particle_count()) {
        let particles = reader.particles(rows)?;
        check::check_particles(header, &particles)?;
        for place in &particles.position {
            for k in header.cell.open_axes() {
                reached.low[k] = reached.low[k].min(place[k]);
                reached.high[k] = reached.high[k].max(place[k]);
            }
        }
    }
    grid.reaching(&reached)
}

impl Mixing {
    /// Mixing of a snapshot, in cells of about this side [m] of the region, or of the domain extended by moving walls.
    ///
    /// # Errors
    /// If a file cannot be read or is invalid, or the region has fewer than two groups.
    pub fn of(
        reader: &Reader,
        members: &Members,
        region: Region,
        side: f64,
    ) -> Result<Self, MeasureError> {
        let header = reader.header();
        region.check(header)?;
        let grid = match region {
            Region::Box(bounds) => members.divided(Grid::of(&bounds, side)?)?,
            Region::Whole => cells_of_all(reader, members, side)?,
        };
        // Numbers of all particles and of those of the first group.
        let mut counts = vec![[0u64; 2]; grid.len()];
        let mut left_out = 0;
        for rows in pieces(reader.particle_count()) {
            let particles = reader.particles(rows)?;
            check::check_particles(header, &particles)?;
            for row in 0..particles.id.len() {
                let place = header.cell.inside(particles.position[row]);
                let group = members.is_first(header, &particles, row);
                let cell = match region {
                    Region::Box(bounds) if !bounds.contains(&place) => None,
                    // All particles lie in the grid, up to rounding.
                    _ => grid.nearest_cell(&place),
                };
                match (cell, group) {
                    (Some(cell), Some(is_first)) => {
                        counts[cell][0] += 1;
                        counts[cell][1] += u64::from(is_first);
                    }
                    (Some(_), None) => left_out += 1,
                    (None, _) => {}
                }
            }
        }
        Ok(Self { left_out, ..Self::of_counts(header.step, header.time, &counts)? })
    }

    /// Mixing from the numbers of all particles and of those of the first group in each cell.
    ///
    /// # Errors
    /// If there are no particles, or all are of one group.
    pub fn of_counts(step: u64, time_s: f64, counts: &[[u64; 2]]) -> Result<Self, MeasureError> {
        let [grains, first] =
            counts.iter().fold([0, 0], |[all, first], [n, k]| [all + n, first + k]);
        if grains == 0 {
            return Err(MeasureError::NobodyThere);
        }
        if first == 0 || first == grains {
            return Err(MeasureError::OneGroup { grains });
        }
        let share = first as f64 / grains as f64;
        let filled = counts.iter().filter(|[n, _]| *n > 0);
        let squares = filled.clone().map(|&[n, k]| {
            let off = k as f64 / n as f64 - share;
            n as f64 * off * off
        });
        let cells = filled.count() as u64;
        let apart = share * (1.0 - share);
        let variance = squares.sum::<f64>() / grains as f64;
        let random = apart * (cells as f64 - 1.0) / (grains as f64 - 1.0);
        let index = (1 < cells && cells < grains).then(|| (apart - variance) / (apart - random));
        Ok(Self {
            step,
            time_s,
            grains,
            cells,
            share,
            variance,
            variance_apart: apart,
            variance_random: random,
            index,
            left_out: 0,
        })
    }
}
