//! How many grains pass a plane or leave through an outlet, and how fast.
//!
//! The rate is the slope of the line of least squares through what has passed by then, over the rows in a window of time. Beside it stand
//! the rates of the two halves of the window, which are the same in steady flow.
//!
//! **A plane** across x, y or z, from snapshots: a grain has passed when its centre was before the plane in one snapshot and is
//! behind it in the next; one that goes back is taken off. A grain that was before the plane and is gone in the next counts as passed: an
//! outlet behind the plane has taken it. One that is new counts as not passed. If an inlet is before the plane, grains that appear and
//! pass it between two snapshots are missed; how many were behind it when first seen is told ([`ThroughPlane::new_behind`]).
//! **An outlet**, from the columns `left_NAME` and `left_NAME_kg` of `history.csv`.

use super::check;
use super::errors::MeasureError;
use super::history::History;
use super::pieces;
use super::slope::line;
use crate::cell::AXES;
use crate::ids::GlobalId;
use crate::output::snapshot::Reader;
use serde::Serialize;
use std::collections::BTreeMap;
use std::str::FromStr;

/// What grains pass.
#[derive(Clone, Debug, PartialEq)]
pub enum Gate {
    /// A plane.
    Plane(Plane),
    /// An outlet of the scene, by its name.
    Outlet(String),
}

/// A plane across x, y or z, and the way through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Across which axis.
    pub axis: usize,
    /// Where [m].
    pub at: f64,
    /// Whether towards higher values.
    pub up: bool,
}

impl FromStr for Gate {
    type Err = String;

    /// `-z=0.05` is the plane z = 0.05 m, passed downwards; `outlet:NAME` an outlet.
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

/// From when to when [s], both included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Begin [s].
    pub from: f64,
    /// End [s].
    pub to: f64,
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

/// What has passed by a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Passed {
    /// When [s].
    pub time_s: f64,
    /// Grains.
    pub grains: f64,
    /// Mass [kg].
    pub mass_kg: f64,
}

/// Rates in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    /// Time of the first and last row [s].
    pub window: Window,
    /// Rows.
    pub rows: usize,
    /// Grains per second.
    pub grains: f64,
    /// [kg/s].
    pub mass: f64,
    /// The mass by halves of the window [kg/s], if each has two rows.
    pub halves: Option<[f64; 2]>,
}

/// What has passed a plane, and what is doubtful about it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ThroughPlane {
    /// What has passed by each snapshot.
    pub rows: Vec<Passed>,
    /// Grains that came between two snapshots and were behind the plane when first seen. They do not count: where they
    /// came is not known.
    pub new_behind: u64,
    /// Grains that were before the plane when last seen and went between two snapshots. They count as passed.
    pub gone_before: u64,
}

/// What has passed a plane in a series of snapshots; the first has nothing.
///
/// # Errors
/// A file that cannot be read or makes no sense, a periodic axis, fewer than two snapshots.
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
        let mut passed = Passed { time_s: header.time, ..last.unwrap_or_default() };
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

/// What has left through an outlet, from the history of a run.
///
/// # Errors
/// No such column.
pub fn through_outlet(history: &History, name: &str) -> Result<Vec<Passed>, MeasureError> {
    let column = |name: &str| history.curves.iter().find(|curve| curve.name == name);
    let (Some(grains), Some(mass)) =
        (column(&format!("left_{name}")), column(&format!("left_{name}_kg")))
    else {
        let names = history.curves.iter().filter_map(|curve| curve.name.strip_prefix("left_"));
        let known = names.filter(|name| !name.ends_with("_kg")).map(str::to_owned).collect();
        return Err(MeasureError::NoSuchOutlet { name: name.to_owned(), known });
    };
    let rows = grains.points.iter().zip(&mass.points);
    Ok(rows.map(|(&(time_s, grains), &(_, mass_kg))| Passed { time_s, grains, mass_kg }).collect())
}

impl Rate {
    /// In a window, or over all rows.
    ///
    /// # Errors
    /// Fewer than two rows in the window.
    pub fn of(rows: &[Passed], window: Option<Window>) -> Result<Self, MeasureError> {
        // Times are multiples of a step, rounded.
        let slack = 1e-9 * rows.last().map_or(0.0, |row| row.time_s.abs());
        let is_in = |row: &&Passed| {
            window.is_none_or(|w| w.from - slack <= row.time_s && row.time_s <= w.to + slack)
        };
        let rows: Vec<Passed> = rows.iter().filter(is_in).copied().collect();
        let [first, .., last] = rows[..] else {
            return Err(MeasureError::FewRows { rows: rows.len() });
        };
        let slope = |rows: &[Passed], of: fn(&Passed) -> f64| {
            line(&rows.iter().map(|row| (row.time_s, of(row))).collect::<Vec<_>>()).0
        };
        let middle = 0.5 * (first.time_s + last.time_s);
        // Both have the row between them, so that together they have all of the time.
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
