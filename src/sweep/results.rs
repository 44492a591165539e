//! Results of a sweep: a table with a row for each run, and plots.

use super::varied::Varied;
use crate::files;
use crate::output::growing::whole_lines;
use crate::output::report::Report;
use crate::post::shown::draw::{
    BLUE, GREEN, INK, Mark, ORANGE, PURPLE, PlotError, SIZE, Series, VERMILION, grid, linear,
    panel, span,
};
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

/// Figures of `report.json` that a sweep can measure, by the names of the keys that lead to them.
pub const FIGURES: [&str; 33] = [
    "run.steps",
    "run.last_step",
    "run.time_s",
    "run.particles",
    "run.wall_s",
    "run.steps_per_s",
    "run.particle_steps_per_s",
    "run.ns_per_particle_step",
    "contacts.contacts_per_s",
    "contacts.fallback_share",
    "energy.received_j",
    "energy.kinetic_j",
    "energy.gravity_j",
    "energy.stored_j",
    "energy.step_j",
    "energy.dissipated_j",
    "energy.missing_j",
    "energy.largest_moved_j",
    "energy.missing_over_dissipated",
    "energy.missing_over_moved",
    "packing.contacts",
    "packing.wall_contacts",
    "packing.coordination",
    "packing.mean_normal_force_n",
    "packing.unbalanced",
    "resolution.dt_s",
    "resolution.dt_limit_s",
    "resolution.steps_per_oscillation",
    "resolution.largest_overlap_over_radius",
    "resolution.largest_move_over_radius",
    "resolution.largest_turn_rad",
    "ranks.imbalance",
    "ranks.rebuilds",
];

/// A run of the table.
pub(super) struct Row<'a> {
    pub(super) values: &'a [String],
    pub(super) folder: &'a str,
    pub(super) status: &'a str,
    pub(super) wall_s: f64,
    /// Values in the order of the names; empty if the run is not done.
    pub(super) measured: &'a [Option<f64>],
}

/// Beginning of the names of figures of dem-post.
pub(super) const OF_POST: &str = "post.";

/// Whether a measure is a figure of dem-post.
pub(super) fn is_of_post(name: &str) -> bool {
    name.starts_with(OF_POST)
}

/// Report of dem-post on a run.
pub(super) fn of_post(folder: &Path) -> PathBuf {
    folder.join("post").join("report.json")
}

/// The last values of these columns of `history.csv`, or these figures of `report.json` or of that of dem-post.
pub(super) fn measured(folder: &Path, names: &[String]) -> Vec<Option<f64>> {
    let last = last_row(&folder.join("history.csv")).unwrap_or_default();
    let read = |path: &Path| -> Value {
        let text = files::read_to_string(path).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    };
    let of_run = read(&Report::path(folder));
    let of_post = read(&of_post(folder));
    let one = |name: &String| {
        let (report, keys) = match name.strip_prefix(OF_POST) {
            Some(keys) => (of_post.get(0)?, keys),
            None => (&of_run, &**name),
        };
        let figure = || keys.split('.').try_fold(report, |value, key| value.get(key))?.as_f64();
        last.get(name).copied().or_else(figure)
    };
    names.iter().map(one).collect()
}

/// Columns and numbers of the last row of a table.
fn last_row(path: &Path) -> Option<BTreeMap<String, f64>> {
    let text = files::read(path).ok()?;
    let mut table = csv::Reader::from_reader(whole_lines(&text));
    let names = table.headers().ok()?.clone();
    let last = table.records().filter_map(Result::ok).last()?;
    let numbers = names.iter().zip(&last);
    Some(numbers.filter_map(|(name, cell)| Some((name.to_owned(), cell.parse().ok()?))).collect())
}

/// Writes the table.
pub(super) fn write_table(
    path: &Path,
    varied: &[Varied],
    names: &[String],
    rows: &[Row],
) -> io::Result<()> {
    let mut table = csv::Writer::from_writer(Vec::new());
    let keys = varied.iter().map(|varied| &*varied.key);
    let of_names = names.iter().map(String::as_str);
    table.write_record(keys.chain(["folder", "status", "wall_s"]).chain(of_names))?;
    for row in rows {
        let wall = format!("{:.3}", row.wall_s);
        // A run that is not done has none.
        let number = |k: usize| row.measured.get(k).copied().flatten();
        let cell = |k: usize| number(k).map_or_else(String::new, |x| format!("{x:?}"));
        let measured: Vec<String> = (0..names.len()).map(cell).collect();
        let known = row.values.iter().map(String::as_str).chain([row.folder, row.status, &wall]);
        table.write_record(known.chain(measured.iter().map(String::as_str)))?;
    }
    let bytes = table.into_inner().map_err(csv::IntoInnerError::into_error)?;
    files::replace(path, |file| file.write_all(&bytes)).map(drop)
}

/// A panel for each name: dots against the first key with several numbers, and a line through their means over the seeds; a
/// colour for each combination of the other keys. `None` where no key has several numbers.
pub(super) fn plot(
    varied: &[Varied],
    names: &[String],
    rows: &[Row],
) -> Option<Result<String, PlotError>> {
    const COLUMNS: usize = 2;
    const COLOURS: [plotters::style::RGBColor; 6] = [BLUE, ORANGE, VERMILION, GREEN, PURPLE, INK];
    let numbers = |varied: &Varied| varied.values.iter().all(|value| value.parse::<f64>().is_ok());
    let is_axis = |varied: &&Varied| varied.values.len() > 1 && numbers(varied);
    let axis = varied.iter().find(|one| is_axis(one) && !one.is_seed());
    let axis = axis.or_else(|| varied.iter().find(is_axis))?;
    let others = |row: &Row| {
        let rest = varied.iter().zip(row.values).filter(|(one, _)| *one != axis && !one.is_seed());
        rest.map(|(one, value)| format!("{}={value}", one.key)).collect::<Vec<_>>().join(", ")
    };
    let x_of = |row: &Row| {
        let at = varied.iter().position(|one| one == axis)?;
        row.values[at].parse::<f64>().ok()
    };
    let paint = |k: usize, canvas: &crate::post::shown::draw::Canvas| {
        let mut groups: BTreeMap<String, Vec<(f64, f64)>> = BTreeMap::new();
        for row in rows {
            if let Some(point) = x_of(row).zip(row.measured.get(k).copied().flatten()) {
                groups.entry(others(row)).or_default().push(point);
            }
        }
        let points: Vec<(f64, f64)> = groups.values().flatten().copied().collect();
        let mut series = Vec::new();
        for ((name, points), colour) in groups.into_iter().zip(COLOURS.iter().cycle()) {
            let line = means(&points);
            let dots = Series { name: String::new(), colour: *colour, mark: Mark::Dots, points };
            series.extend([Series { name, mark: Mark::Line, points: line, ..dots.clone() }, dots]);
        }
        let [x, y] = [0, 1].map(|k| span(points.iter().map(|p| if k == 0 { p.0 } else { p.1 })));
        panel(canvas, &linear(&axis.key, &names[k], x, y), &series)
    };
    Some(grid(COLUMNS.min(names.len()), SIZE, names, paint))
}

/// The mean of the values at each place, in rising order.
fn means(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut points = points.to_vec();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mean = |at: &[(f64, f64)]| (at[0].0, at.iter().map(|p| p.1).sum::<f64>() / at.len() as f64);
    points.chunk_by(|a, b| a.0 == b.0).map(mean).collect()
}
