//! Flow of particles through a plane or an outlet, and its rate.
//!
//! The rate is the slope of a least-squares line through the cumulative flow, over the rows in a window of time. The rates of the
//! two halves of the window are given as well; they agree in steady flow.
//!
//! **A plane** across x, y or z, from snapshots: a particle has passed if its centre was before the plane in one snapshot and is
//! behind it in the next; a return is subtracted. A particle that was before the plane and is gone in the next snapshot counts as
//! passed, as an outlet behind the plane has taken it. A new particle does not count. With an inlet before the plane, particles
//! that appear and pass between two snapshots are missed; [`ThroughPlane::new_behind`] counts those that were behind it when
//! first seen.
//!
//! **An outlet**, from the columns `left_NAME` and `left_NAME_kg` of `history.csv`.

use super::check;
use super::errors::MeasureError;
use super::history::History;
use super::pieces;
use super::rows::readable;
use super::slope::line;
use crate::cell::AXES;
use crate::ids::GlobalId;
use crate::output::snapshot::Reader;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::str::FromStr;

/// Place where the flow is measured.
#[derive(Clone, Debug, PartialEq)]
pub enum Gate {
    /// A plane.
    Plane(Plane),
    /// An outlet of the scene, by name.
    Outlet(String),
}

/// A plane across x, y or z, with the direction of passage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Axis across which the plane lies.
    pub axis: usize,
    /// Position of the plane [m].
    pub at: f64,
    /// Whether passage is towards higher values.
    pub up: bool,
}

impl FromStr for Gate {
    type Err = String;

    /// Parses `-z=0.05`, the plane z = 0.05 m passed downwards, or `outlet:NAME`, an outlet.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "write -z=0.05, +x=0 or outlet:NAME".to_owned();
        if let Some(name) = text.strip_prefix("outlet:").filter(|name| !name.is_empty()) {
            return Ok(Self::Outlet(name.to_owned()));
        }
        let (up, rest) = match text.split_at_checked(1) {
            Some(("+", rest)) => (true, rest),
            Some(("-", rest)) => (false, rest),
            _ => return Err(wrong()),
        };
        let (axis, at) = rest.split_once('=').ok_or_else(wrong)?;
        let axis = AXES.iter().position(|&name| name == axis).ok_or_else(wrong)?;
        let at = at.parse().ok().filter(|at: &f64| at.is_finite()).ok_or_else(wrong)?;
        Ok(Self::Plane(Plane { axis, at, up }))
    }
}

/// Window of time [s], both ends included.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Window {
    /// Begin [s].
    #[serde(rename = "from_s")]
    pub from: f64,
    /// End [s].
    #[serde(rename = "to_s")]
    pub to: f64,
}

impl Window {
    /// True if a time is in the window; times are rounded multiples of a step.
    pub(super) fn holds(&self, time: f64) -> bool {
        let slack = 1e-9 * self.to.abs();
        (self.from - slack..=self.to + slack).contains(&time)
    }

    /// The window in words, with its number of rows.
    pub(super) fn words(&self, rows: usize) -> String {
        format!("from {} s to {} s ({rows} rows)", readable(self.from), readable(self.to))
    }
}

impl FromStr for Window {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers =
            text.split_once(',').and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
        numbers
            .filter(|(from, to)| from < to)
            .map(|(from, to)| Self { from, to })
            .ok_or_else(|| "write two times in seconds, the earlier first: 0.25,0.75".to_owned())
    }
}

/// Cumulative flow at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CumulativeFlow {
    /// Time [s].
    pub time_s: f64,
    /// Number of particles.
    pub grains: f64,
    /// Mass [kg].
    pub mass_kg: f64,
}

/// Rates in a window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// Time of the first and last row [s].
    #[serde(flatten)]
    pub window: Window,
    /// Number of rows.
    pub rows: usize,
    /// Number rate [1/s].
    #[serde(rename = "grains_per_s")]
    pub grains: f64,
    /// Mass rate [kg/s].
    #[serde(rename = "kg_per_s")]
    pub mass: f64,
    /// Mass rates in the halves of the window [kg/s], if each has two rows.
    #[serde(rename = "kg_per_s_by_half")]
    pub halves: Option<[f64; 2]>,
}

/// Rates, with the numbers of particles whose passage is uncertain: see [`ThroughPlane`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Flow {
    /// The rates.
    #[serde(flatten)]
    pub rate: Rate,
    /// Number of particles first seen behind a plane.
    pub new_behind: u64,
    /// Number of particles last seen before a plane.
    pub gone_before: u64,
}

/// Flow through a plane, with the numbers of particles whose passage is uncertain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ThroughPlane {
    /// Cumulative flow at each snapshot.
    pub rows: Vec<CumulativeFlow>,
    /// Number of particles that appeared between two snapshots and were behind the plane when first seen. They do not count:
    /// their origin is unknown.
    pub new_behind: u64,
    /// Number of particles that were before the plane when last seen and disappeared between two snapshots. They count as passed.
    pub gone_before: u64,
}

/// Flow through a plane in a series of snapshots; it is zero at the first.
///
/// # Errors
/// If a file cannot be read or is invalid, the axis is periodic, or there are fewer than two snapshots.
pub fn through_plane(
    readers: impl Iterator<Item = Result<Reader, MeasureError>>,
    Plane { axis, at, up }: Plane,
) -> Result<ThroughPlane, MeasureError> {
    let mut through = ThroughPlane::default();
    let mut before: BTreeMap<GlobalId, (bool, f64)> = BTreeMap::new();
    for reader in readers {
        let reader = reader?;
        let header = reader.header();
        if header.cell.periodic()[axis] {
            return Err(MeasureError::AcrossPeriod { axis: AXES[axis] });
        }
        let mut now = BTreeMap::new();
        for piece in pieces(reader.particle_count()) {
            let particles = reader.particles(piece)?;
            check::check_particles(header, &particles)?;
            for row in 0..particles.id.len() {
                let mass =
                    header.shapes[particles.shape[row].index()].mass * particles.volume_ratio(row);
                let place = particles.position[row][axis];
                let is_before = if up { place < at } else { place > at };
                now.insert(particles.id[row], (is_before, mass));
            }
        }
        let last = through.rows.last().copied();
        let mut passed = CumulativeFlow { time_s: header.time, ..last.unwrap_or_default() };
        for (id, &(was_before, mass)) in &before {
            let place_now = now.get(id).map(|&(is_before, _)| is_before);
            through.gone_before += u64::from(was_before && place_now.is_none());
            let is_before = place_now.unwrap_or(false);
            let went = match (was_before, is_before) {
                (true, false) => 1.0,
                (false, true) => -1.0,
                _ => 0.0,
            };
            passed.grains += went;
            passed.mass_kg += went * mass;
        }
        if last.is_some() {
            let behind = now.iter().filter(|(_, (is_before, _))| !is_before);
            through.new_behind += behind.filter(|(id, _)| !before.contains_key(id)).count() as u64;
        }
        through.rows.push(passed);
        before = now;
    }
    Ok(through)
}

/// Flow through an outlet, from the history of a run.
///
/// # Errors
/// If there is no such column.
pub fn through_outlet(history: &History, name: &str) -> Result<Vec<CumulativeFlow>, MeasureError> {
    let (Some(grains), Some(mass)) =
        (history.curve(&format!("left_{name}")), history.curve(&format!("left_{name}_kg")))
    else {
        let names = history.curves.iter().filter_map(|curve| curve.name.strip_prefix("left_"));
        let known = names.filter(|name| !name.ends_with("_kg")).map(str::to_owned).collect();
        return Err(MeasureError::NoSuchOutlet { name: name.to_owned(), known });
    };
    let rows = grains.points.iter().zip(&mass.points);
    Ok(rows
        .map(|(&(time_s, grains), &(_, mass_kg))| CumulativeFlow { time_s, grains, mass_kg })
        .collect())
}

impl Rate {
    /// Rate in a window, or over all rows.
    ///
    /// # Errors
    /// If there are fewer than two rows in the window.
    pub fn of(rows: &[CumulativeFlow], window: Option<Window>) -> Result<Self, MeasureError> {
        let is_in = |row: &&CumulativeFlow| window.is_none_or(|w| w.holds(row.time_s));
        let rows: Vec<CumulativeFlow> = rows.iter().filter(is_in).copied().collect();
        let [first, .., last] = rows[..] else {
            return Err(MeasureError::FewRows { rows: rows.len() });
        };
        let slope = |rows: &[CumulativeFlow], of: fn(&CumulativeFlow) -> f64| {
            line(&rows.iter().map(|row| (row.time_s, of(row))).collect::<Vec<_>>()).0
        };
        let middle = 0.5 * (first.time_s + last.time_s);
        // The row between the halves belongs to both, so that together they cover the whole time.
        // Snapshots of others may go back in time.
        let between = rows.partition_point(|row| row.time_s < middle).min(rows.len() - 1);
        let (early, late) = (&rows[..=between], &rows[between..]);
        let halves = (early.len() > 1 && late.len() > 1)
            .then(|| [early, late].map(|half| slope(half, |row| row.mass_kg)));
        Ok(Self {
            window: Window { from: first.time_s, to: last.time_s },
            rows: rows.len(),
            grains: slope(&rows, |row| row.grains),
            mass: slope(&rows, |row| row.mass_kg),
            halves,
        })
    }
}
