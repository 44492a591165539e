//! Means of a run's history over a window of time: torque and power of walls that turn, and the stress of a cell or of walls.
//!
//! A mean is that of the rows in the window, which have equal distances in time. The scatter is the standard deviation of the
//! rows. The power is that between neighbouring rows, from the work of the wall; its mean is exact.

use super::errors::MeasureError;
use super::flow::Window;
use super::history::History;
use super::region::ACROSS;
use super::stress::Stress;
use crate::cell::AXES;
use crate::math::{Mat3, Vec3};
use crate::output::header::WallRow;
use serde::{Deserialize, Serialize};

/// Values by time [s].
type Points = Vec<(f64, f64)>;

/// Mean of a quantity over a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mean {
    /// Name of the quantity.
    pub quantity: String,
    /// Its unit; empty for a ratio.
    pub unit: String,
    /// Mean of the rows.
    pub mean: f64,
    /// Standard deviation of the rows.
    pub scatter: f64,
    /// Time of the first and last row of the history in the window [s].
    #[serde(flatten)]
    pub window: Window,
    /// Number of rows with a value.
    pub rows: usize,
}

impl Mean {
    fn of(quantity: String, unit: &str, points: &[(f64, f64)], window: Window) -> Option<Self> {
        let [_, _, ..] = points else { return None };
        let count = points.len() as f64;
        let mean = points.iter().map(|point| point.1).sum::<f64>() / count;
        let squares = points.iter().map(|point| (point.1 - mean).powi(2)).sum::<f64>();
        Some(Self {
            quantity,
            unit: unit.into(),
            mean,
            scatter: (squares / (count - 1.0)).sqrt(),
            window,
            rows: points.len(),
        })
    }
}

/// All means of a history over a window, by default its last half. `walls` give the axes of stresses on them.
///
/// # Errors
/// If a window is given, and there is nothing to average in it.
pub fn means(
    history: &History,
    walls: &[WallRow],
    window: Option<Window>,
) -> Result<Vec<Mean>, MeasureError> {
    let rows = history.curves.first().map_or(&[][..], |curve| &curve.points);
    let last_half = || {
        let (first, last) = rows.first().zip(rows.last())?;
        Some(Window { from: 0.5 * (first.0 + last.0), to: last.0 })
    };
    let Some(over) = window.or_else(last_half) else {
        return window.map_or(Ok(Vec::new()), |_| Err(MeasureError::NothingToAverage));
    };
    let turning = history.curves.iter().filter_map(|curve| {
        curve.name.strip_prefix("angular_velocity_")?.strip_suffix("_x_rad_per_s")
    });
    let mut curves: Vec<(String, &str, Points)> = Vec::new();
    for wall in turning {
        curves.extend(torque(history, wall, over));
        curves.extend(power(history, wall, over));
    }
    curves.extend(stress_ratio(history, walls));
    let found = !curves.is_empty();
    let in_window = |points: &[(f64, f64)]| -> Points {
        points.iter().copied().filter(|&(time, _)| over.holds(time)).collect()
    };
    let rows = in_window(rows);
    let ends = rows.first().zip(rows.last());
    let ends = ends.map_or(over, |(first, last)| Window { from: first.0, to: last.0 });
    let means: Vec<Mean> = curves
        .into_iter()
        .filter_map(|(name, unit, points)| Mean::of(name, unit, &in_window(&points), ends))
        .collect();
    match window {
        Some(_) if !found => Err(MeasureError::NothingToAverage),
        Some(_) if means.is_empty() => Err(MeasureError::FewRows { rows: rows.len() }),
        _ => Ok(means),
    }
}

/// Three columns as a vector by time: `column` gives the name of each.
fn vectors(history: &History, column: impl Fn(&str) -> String) -> Option<Vec<(f64, Vec3)>> {
    let columns = AXES.map(|axis| history.curve(&column(axis)));
    let [x, y, z] = [columns[0]?, columns[1]?, columns[2]?].map(|curve| &curve.points);
    let rows = x.iter().zip(y).zip(z);
    Some(rows.map(|((x, y), z)| (x.0, Vec3::new(x.1, y.1, z.1))).collect())
}

/// Torque of the particles on a wall, about the axis of its fastest rotation in the window. The axis points along the positive
/// side of x, y or z.
fn torque(history: &History, wall: &str, over: Window) -> Option<(String, &'static str, Points)> {
    let torques = vectors(history, |axis| format!("torque_{wall}_{axis}_N_m"))?;
    let rates = vectors(history, |axis| format!("angular_velocity_{wall}_{axis}_rad_per_s"))?;
    let rates = rates.into_iter().filter(|(time, _)| over.holds(*time)).map(|(_, rate)| rate);
    let fastest = rates.max_by(|a, b| a.norm().total_cmp(&b.norm()))?.try_normalize(0.0)?;
    let main = fastest.iamax();
    let axis = fastest * fastest[main].signum();
    let about = if axis[main] > 1.0 - 1e-9 { AXES[main] } else { "its axis" };
    let points = torques.into_iter().map(|(time, torque)| (time, torque.dot(&axis)));
    Some((format!("torque on {wall} about {about}"), "N m", points.collect()))
}

/// Power of a wall on the particles between neighbouring rows of the window.
fn power(history: &History, wall: &str, over: Window) -> Option<(String, &'static str, Points)> {
    let work = &history.curve(&format!("work_{wall}_J"))?.points;
    let rows: Points = work.iter().copied().filter(|row| over.holds(row.0)).collect();
    let rates =
        rows.windows(2).map(|two| (two[1].0, (two[1].1 - two[0].1) / (two[1].0 - two[0].0)));
    Some((format!("power of {wall}"), "W", rates.collect()))
}

/// Stress across each axis by time [Pa]: of the contacts in a cell, or the mean of the walls across the axis.
fn across(history: &History, walls: &[WallRow]) -> [Option<Points>; 3] {
    [0, 1, 2].map(|k| {
        let axis = AXES[k];
        if let Some(curve) = history.curve(&format!("contact_stress_{axis}{axis}_Pa")) {
            return Some(curve.points.clone());
        }
        let stands = |wall: &&WallRow| wall.is_one_plane() && wall.normal[k].abs() > ACROSS;
        let of_walls: Vec<&Points> = walls
            .iter()
            .filter(stands)
            .filter_map(|wall| Some(&history.curve(&format!("stress_{}_Pa", wall.name))?.points))
            .collect();
        let first = of_walls.first()?;
        let mean = |row: usize| {
            let values = of_walls.iter().filter_map(|points| Some(points.get(row)?.1));
            values.sum::<f64>() / of_walls.len() as f64
        };
        Some(first.iter().enumerate().map(|(row, point)| (point.0, mean(row))).collect())
    })
}

/// Mean horizontal stress over vertical stress, where the latter is at least a tenth of its largest value: ratios of stresses
/// near zero would hide all others.
fn stress_ratio(history: &History, walls: &[WallRow]) -> Option<(String, &'static str, Points)> {
    let [x, y, z] = across(history, walls);
    let horizontal: Vec<Points> = [x, y].into_iter().flatten().collect();
    let first = horizontal.first()?;
    let z = z?;
    let least = 0.1 * z.iter().map(|point| point.1).fold(0.0, f64::max);
    let ratio = |(row, &(time, vertical)): (usize, &(f64, f64))| {
        let values = horizontal.iter().filter_map(|points| Some(points.get(row)?.1));
        let mean = values.sum::<f64>() / horizontal.len() as f64;
        (vertical > 0.0 && vertical >= least).then_some((time, mean / vertical))
    };
    let points: Points = z.iter().enumerate().take(first.len()).filter_map(ratio).collect();
    Some(("horizontal over vertical stress, K0".into(), "", points))
}

/// Mean and deviatoric stress of each row [Pa], where the stresses across all axes are known: the stress path.
pub fn stress_path(history: &History, walls: &[WallRow]) -> Vec<(f64, f64)> {
    let [Some(x), Some(y), Some(z)] = across(history, walls) else { return Vec::new() };
    let shear = ["xy", "xz", "yz"].map(|pair| history.curve(&format!("contact_stress_{pair}_Pa")));
    let in_row = |row: usize| {
        let normal = Vec3::new(x[row].1, y.get(row)?.1, z.get(row)?.1);
        let mut tensor = Mat3::from_diagonal(&normal);
        for (curve, (i, j)) in shear.iter().zip([(0, 1), (0, 2), (1, 2)]) {
            let value = curve.and_then(|curve| curve.points.get(row)).map_or(0.0, |point| point.1);
            (tensor[(i, j)], tensor[(j, i)]) = (value, value);
        }
        let stress = Stress { tensor };
        Some((stress.p(), stress.q()))
    };
    (0..x.len()).filter_map(in_row).collect()
}
