//! Sizes of the particles of a run beside the distribution requested by its scene, and its warnings, from the run's report.

use super::draw::{Axes, BLUE, Mark, ORANGE, PlotError, SIZE, Series, chart, linear};
use super::plots::{Plot, Width};
use crate::files;
use crate::output::report::Report;
use crate::output::report::sizes::{Below, SizesOf};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::path::Path;

/// Sizes and warnings in the report of a run's directory; empty without a readable report.
pub fn beside(directory: &Path) -> (Vec<SizesOf>, Vec<String>) {
    let text = files::read_to_string(&Report::path(directory)).unwrap_or_default();
    let report: Value = serde_json::from_str(&text).unwrap_or_default();
    (read(&report["sizes"]), read(&report["warnings"]))
}

fn read<T: DeserializeOwned>(values: &Value) -> Vec<T> {
    Vec::<T>::deserialize(values).unwrap_or_default()
}

/// Cumulative curves of each shape.
///
/// # Errors
/// See [`PlotError`].
pub fn plots(all: &[SizesOf]) -> Result<Vec<Plot>, PlotError> {
    all.iter().enumerate().map(|(k, sizes)| plot(k, sizes)).collect()
}

/// A share of a row of the curve.
type Share = fn(&Below) -> f64;

fn plot(k: usize, sizes: &SizesOf) -> Result<Plot, PlotError> {
    let curves: [(&str, _, Share, Share); 2] = [
        ("number", BLUE, |row| row.asked_by_number, |row| row.found_by_number),
        ("mass", ORANGE, |row| row.asked_by_mass, |row| row.found_by_mass),
    ];
    let points = |share: Share| sizes.curve.iter().map(move |row| (row.scale, 100.0 * share(row)));
    let mut series = Vec::new();
    for (by, colour, asked, found) in curves {
        let asked = points(asked).collect();
        series.push(Series {
            name: format!("by {by}, requested"),
            colour,
            mark: Mark::Line,
            points: asked,
        });
        let found = points(found).collect();
        series.push(Series { name: format!("by {by}"), colour, mark: Mark::Dots, points: found });
    }
    let ends = sizes.curve.first().zip(sizes.curve.last());
    let (least, largest) = ends.map_or((0.5, 2.0), |(a, b)| (a.scale, b.scale));
    let axes = linear("scale of the shape's lengths", "smaller (%)", least..largest, 0.0..104.0);
    let axes = Axes { log_x: largest > 5.0 * least, ..axes };
    Ok(Plot {
        name: format!("sizes_{k}"),
        title: format!("Sizes of {}", sizes.shape),
        caption: format!(
            "Share of the {} particles at the end of the run that are smaller. Requested: {}. Largest difference \
             {:.2} % by number, {:.2} % by mass.",
            sizes.particles,
            sizes.law,
            100.0 * sizes.largest_difference_by_number,
            100.0 * sizes.largest_difference_by_mass,
        ),
        width: Width::Half,
        svg: chart(SIZE, &axes, &series)?,
    })
}
