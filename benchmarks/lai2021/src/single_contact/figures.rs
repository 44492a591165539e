//! Figures 5 to 8 as drawings.

use super::StudyError;
use super::study::{
    AtOffset, CENTRE_LINE, EPA, EROSION, FINE_EROSION, InCase1, InCase2, SKETCHED_OVERLAP, Study,
    normals,
};
use crate::cases::OFFSET;
use crate::single_contact::statistics::{Summary, per_decade};
use dem_mpi::math::Vec3;
use dem_mpi::post::draw::{
    Anchor, Axes, BLUE, Canvas, FINE, GREEN, INK, MUTED, Mark, ORANGE, PlotError, Series,
    VERMILION, decades, grid, label, linear, panel, px, tick,
};
use plotters::prelude::*;
use std::f64::consts::TAU;

/// Size of one of three panels [px].
const PANEL: (u32, u32) = (380, 340);

/// All figures: names of their files and the drawings.
///
/// # Errors
/// See [`StudyError`].
pub fn all(study: &Study) -> Result<Vec<(&'static str, String)>, StudyError> {
    Ok(vec![
        ("fig5.svg", case_1(study)?),
        ("fig6.svg", reason(study)?),
        ("fig7.svg", case_2(&study.case_2)?),
        ("fig8.svg", case_3(study)?),
    ])
}

/// Three panels in a row, each under its title.
fn three(
    titles: [&str; 3],
    paint: impl Fn(usize, &Canvas) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    grid(3, PANEL, &titles.map(str::to_string), paint)
}

fn line(name: impl Into<String>, colour: RGBColor, points: Vec<(f64, f64)>) -> Series {
    Series { name: name.into(), colour, mark: Mark::Line, points }
}

fn highest(series: &[Series]) -> f64 {
    let values = series.iter().flat_map(|s| &s.points).map(|p| p.1);
    1.1 * values.filter(|y| y.is_finite()).fold(0.0, f64::max)
}

/// Overlap over the short axis, which is 1 m, in percent.
const OVERLAP: &str = "overlap / short axis (%)";

/// Fig. 5: the errors of Case I over the overlap.
fn case_1(study: &Study) -> Result<String, PlotError> {
    let curves = |pick: &dyn Fn(&InCase1) -> f64| -> Vec<Series> {
        let ratios = Study::RATIOS.iter().zip([BLUE, ORANGE, GREEN]);
        ratios
            .map(|(&ratio, colour)| {
                let rows = study.case_1.iter().filter(|row| row.erosion_ratio == ratio);
                let points = rows.map(|row| (100.0 * row.overlap_m, pick(row))).collect();
                line(format!("{} %", 100.0 * ratio), colour, points)
            })
            .collect()
    };
    let titles = ["(a) overlap", "(b) contact normal", "(c) contact point"];
    three(titles, |k, canvas| match k {
        0 => {
            let mut series = curves(&|row| 100.0 * row.relative_overlap_error);
            for s in &mut series {
                s.points.retain(|p| p.1 <= 120.0);
            }
            let axes = linear(OVERLAP, "relative error (%)", 0.0..5.0, 0.0..120.0);
            panel(canvas, &axes, &series)
        }
        1 => {
            let series = curves(&|row| row.normal_error_deg);
            let axes = linear(OVERLAP, "error (°)", 0.0..5.0, 0.0..highest(&series));
            panel(canvas, &axes, &series)
        }
        _ => {
            // Rounding only, shown on the scale of the errors of the other cases.
            let series = curves(&|row| 100.0 * row.point_error_m);
            let axes = linear(OVERLAP, "error / short axis (%)", 0.0..5.0, 0.0..1.0);
            panel(canvas, &axes, &series)
        }
    })
}

/// Fig. 6: the two configurations, and the error of the normal over the overlap.
fn reason(study: &Study) -> Result<String, StudyError> {
    let colours = [BLUE, ORANGE, GREEN, VERMILION, INK];
    let by_offset: Vec<Series> = [0.2, OFFSET, 0.44, 0.5, 0.7]
        .iter()
        .zip(colours)
        .map(|(&y, colour)| {
            let rows: Vec<&AtOffset> =
                study.offsets.iter().filter(|row| (row.y_m - y).abs() < 1e-9).collect();
            let at_touch = rows.first().map_or(f64::NAN, |row| row.normal_error_deg);
            let points = rows
                .iter()
                .map(|row| (100.0 * row.overlap_m, row.normal_error_deg / at_touch))
                .collect();
            line(format!("{y}"), colour, points)
        })
        .collect();
    let deeper = study.deeper.iter().map(|row| (100.0 * row.overlap_m, row.normal_error_deg));
    let deeper = line("y = 0.35 m, 5 % + 1 %", BLUE, deeper.collect());
    let sketched = normals(OFFSET, SKETCHED_OVERLAP)?;
    let titles = [
        "(a) beside and on top",
        "(b) error over error at touch, by y (m)",
        "(c) towards A's centre",
    ];
    Ok(three(titles, |k, canvas| match k {
        0 => sketch(canvas, sketched),
        1 => panel(canvas, &linear(OVERLAP, "relative to touch", 0.0..5.0, 0.85..1.2), &by_offset),
        _ => {
            let axes = linear(
                OVERLAP,
                "error (°)",
                0.0..30.0,
                0.0..highest(std::slice::from_ref(&deeper)),
            );
            panel(canvas, &axes, std::slice::from_ref(&deeper))
        }
    })?)
}

/// The ellipsoids of fig. 6 in the plane, with their cores, the true normal and the eroded normal.
fn sketch(canvas: &Canvas, sketched: (Vec3, Vec3, Vec3)) -> Result<(), PlotError> {
    const SCALE: f64 = 74.0;
    let outline = |centre: (i32, i32), at: Vec3, size: f64| -> Vec<(i32, i32)> {
        let point = |k: i32| {
            let angle = TAU * f64::from(k) / 120.0;
            project(centre, SCALE, at + size * Vec3::new(angle.cos(), 0.5 * angle.sin(), 0.0))
        };
        (0..=120).map(point).collect()
    };
    // For bodies above each other both normals are the axis of symmetry.
    let on_top = (Vec3::new(0.0, 1.0 - SKETCHED_OVERLAP, 0.0), Vec3::y(), Vec3::y());
    let places = [(px(120), px(110)), (px(190), px(285))];
    for ((r, exact, eroded), centre) in [sketched, on_top].into_iter().zip(places) {
        for at in [Vec3::zeros(), r] {
            canvas.draw(&Polygon::new(outline(centre, at, 1.0), BLUE.mix(0.12)))?;
            let edge = PathElement::new(outline(centre, at, 1.0), BLUE.stroke_width(px(1) as u32));
            canvas.draw(&edge)?;
            let core =
                PathElement::new(outline(centre, at, 0.95), MUTED.stroke_width(FINE as u32 / 2));
            canvas.draw(&core)?;
        }
        for (normal, colour) in [(eroded, VERMILION), (exact, INK)] {
            let (from, to) = (0.5 * r - 0.45 * normal, 0.5 * r + 0.9 * normal);
            let ends = vec![project(centre, SCALE, from), project(centre, SCALE, to)];
            canvas.draw(&PathElement::new(ends, colour.stroke_width(px(2) as u32)))?;
        }
    }
    label(canvas, "common normal", (px(16), px(20)), 12, INK, Anchor::Left)?;
    label(canvas, "normal of the cores", (px(120), px(20)), 12, VERMILION, Anchor::Left)
}

/// Converts metres in the plane to units of the drawing, with y up.
fn project(centre: (i32, i32), scale: f64, at: Vec3) -> (i32, i32) {
    let unit = scale * f64::from(FINE);
    (centre.0 + (unit * at.x).round() as i32, centre.1 - (unit * at.y).round() as i32)
}

/// Fig. 7: error maps over angle and elongation.
fn case_2(rows: &[InCase2]) -> Result<String, PlotError> {
    type Pick = fn(&InCase2) -> f64;
    let maps: [(&str, Pick); 3] = [
        ("(a) overlap, relative error (%)", |row| 100.0 * row.relative_overlap_error),
        ("(b) contact normal, error (°)", |row| row.normal_error_deg),
        ("(c) contact point, error / short axis (%)", |row| 100.0 * row.point_error_m),
    ];
    three(maps.map(|(title, _)| title), |k, canvas| map(canvas, rows, maps[k].1))
}

/// A map with its scale of colours. Every row of the table is the centre of a field.
fn map(canvas: &Canvas, rows: &[InCase2], pick: fn(&InCase2) -> f64) -> Result<(), PlotError> {
    const STEPS: usize = 48;
    let (left, right, top, bottom) = (72, 312, 14, 290);
    let axes: Vec<f64> = distinct(rows.iter().map(|row| row.long_axis_m));
    let angles: Vec<f64> = distinct(rows.iter().map(|row| row.angle_deg));
    let most = rows.iter().map(pick).fold(0.0, f64::max);
    let edge = |from: i32, to: i32, k: usize, count: usize| {
        px(from) + (f64::from(px(to - from)) * k as f64 / count as f64).round() as i32
    };
    for (k, row) in rows.iter().enumerate() {
        let (i, j) = (k % angles.len(), k / angles.len());
        let corners = [
            (edge(left, right, i, angles.len()), edge(bottom, top, j, axes.len())),
            (edge(left, right, i + 1, angles.len()), edge(bottom, top, j + 1, axes.len())),
        ];
        canvas.draw(&Rectangle::new(corners, shade(pick(row) / most).filled()))?;
    }
    let frame = [(px(left), px(top)), (px(right), px(bottom))];
    canvas.draw(&Rectangle::new(frame, MUTED.stroke_width(FINE as u32)))?;
    for (k, angle) in angles.iter().enumerate().filter(|(_, a)| **a % 45.0 == 0.0) {
        let x = i32::midpoint(
            edge(left, right, k, angles.len()),
            edge(left, right, k + 1, angles.len()),
        );
        label(canvas, &tick(*angle), (x, px(bottom + 12)), 12, MUTED, Anchor::Middle)?;
    }
    for (k, axis) in axes.iter().enumerate().filter(|(_, a)| a.fract() == 0.0) {
        let y =
            i32::midpoint(edge(bottom, top, k, axes.len()), edge(bottom, top, k + 1, axes.len()));
        label(canvas, &tick(*axis), (px(left - 14), y), 12, MUTED, Anchor::Middle)?;
    }
    let foot = (px(i32::midpoint(left, right)), px(bottom + 34));
    label(canvas, "angle between the long axes (°)", foot, 13, INK, Anchor::Middle)?;
    label(canvas, "long /", (px(24), px(130)), 13, INK, Anchor::Middle)?;
    label(canvas, "short", (px(24), px(146)), 13, INK, Anchor::Middle)?;
    label(canvas, "axis", (px(24), px(162)), 13, INK, Anchor::Middle)?;
    for k in 0..STEPS {
        let bar = [
            (px(right + 12), edge(bottom, top, k, STEPS)),
            (px(right + 24), edge(bottom, top, k + 1, STEPS)),
        ];
        canvas.draw(&Rectangle::new(bar, shade(k as f64 / (STEPS - 1) as f64).filled()))?;
    }
    for (k, part) in [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().enumerate() {
        let at = (px(right + 28), edge(bottom, top, k, 4));
        label(canvas, &format!("{:.1}", part * most), at, 11, MUTED, Anchor::Left)?;
    }
    Ok(())
}

/// Colour from white through blue to ink for `part` from 0 to 1.
fn shade(part: f64) -> RGBColor {
    let mix = |from: RGBColor, to: RGBColor, part: f64| {
        let channel =
            |f: u8, t: u8| (f64::from(f) + part * (f64::from(t) - f64::from(f))).round() as u8;
        RGBColor(channel(from.0, to.0), channel(from.1, to.1), channel(from.2, to.2))
    };
    if part < 0.6 { mix(WHITE, BLUE, part / 0.6) } else { mix(BLUE, INK, (part - 0.6) / 0.4) }
}

/// Distinct values in the order of first appearance.
fn distinct(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut seen = Vec::new();
    for value in values {
        if !seen.contains(&value) {
            seen.push(value);
        }
    }
    seen
}

/// Fig. 8: distributions of the errors of random pairs.
fn case_3(study: &Study) -> Result<String, PlotError> {
    let shown = [("5 %", EROSION, BLUE), ("1 %", FINE_EROSION, GREEN), ("EPA", EPA, ORANGE)];
    let titles = ["(a) overlap", "(b) contact normal", "(c) contact point"];
    let labels = ["relative error", "error (°)", "error (m)"];
    three(titles, |k, canvas| {
        let mut series = Vec::new();
        for (name, method, colour) in shown {
            let cases = study.case_3.iter();
            for case in cases.filter(|c| c.sampling == CENTRE_LINE && c.method == method) {
                let (_, errors) = case.quantities()[k];
                series.push(line(name, colour, per_decade(errors)));
                if method == EROSION {
                    let summary = Summary::of(case.sampling, method, "", errors);
                    let points = vec![(summary.log_mean, 0.0)];
                    series.push(Series {
                        mark: Mark::Rule,
                        ..line("log-mean of 5 %", VERMILION, points)
                    });
                }
            }
        }
        let errors = series.iter().filter(|s| s.mark == Mark::Line).flat_map(|s| &s.points);
        let x = decades(errors.map(|p| p.0));
        let y = 0.0..highest(&series);
        let axes = Axes { log_x: true, ..linear(labels[k], "share of pairs per decade", x, y) };
        panel(canvas, &axes, &series)
    })
}
