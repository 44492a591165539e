//! Roses: contact normals and forces by their angle to the vertical.

use super::draw::{
    Anchor, BLUE, Canvas, FINE, GRID, INK, MUTED, ORANGE, PlotError, VERMILION, drawing, label, px,
    scientific, tick,
};
use super::plots::{Plot, Width};
use crate::math::Mat3;
use crate::post::fabric::Rose;
use crate::post::report::{Report, readable};
use plotters::prelude::*;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// The three roses of figs. 12 and 14 of Lai et al. 2021: contact normals, normal forces and shear forces by
/// their angle to the vertical.
///
/// # Errors
/// See [`PlotError`].
pub fn roses(report: &Report) -> Result<Vec<Plot>, PlotError> {
    const CAPTIONS: [(&str, &str); 3] = [
        (
            "rose_normals",
            "Density of contact normals by angle to the vertical, averaged around it, over its mean (dark ring).",
        ),
        ("rose_normal_forces", "Mean normal force by the same angle, over its mean (dark ring)."),
        (
            "rose_shear_forces",
            "Mean shear force over the mean normal force (orange: towards the horizontal).",
        ),
    ];
    let plot = |((name, caption), petals): ((&str, &str), &Petals)| {
        let largest = petals.largest();
        let centre = (px(SIDE / 2), px(SIDE / 2 - 26));
        let title = petals.title;
        Ok(Plot {
            name: name.into(),
            title: title[..1].to_uppercase() + &title[1..],
            caption: format!("{caption} Red: the second-order tensor."),
            width: Width::Third,
            svg: drawing(SIDE as u32, SIDE as u32 - 10, |canvas| {
                petals.draw(canvas, centre, largest)?;
                let at = (px(SIDE / 2), px(SIDE - 24));
                label(canvas, &petals.degree, at, 14, INK, Anchor::Middle)
            })?,
        })
    };
    CAPTIONS.into_iter().zip(&petals(report)).map(plot).collect()
}

/// Width of a rose [px].
const SIDE: i32 = 344;

/// Roses of several packings, a row for each, with its name if it has one. Roses in one column have one scale.
///
/// # Errors
/// See [`PlotError`].
pub fn rose_rows(packings: &[(&str, &Report)]) -> Result<String, PlotError> {
    const HEIGHT: i32 = 400;
    let rows: Vec<[Petals; 3]> = packings.iter().map(|(_, report)| petals(report)).collect();
    let named = packings.iter().any(|(name, _)| !name.is_empty());
    let inset = if named { 110 } else { 0 };
    let height = HEIGHT as u32 * packings.len().max(1) as u32;
    drawing(1080 + inset as u32, height, |canvas| {
        for (row, (petals, (name, _))) in (0..).zip(rows.iter().zip(packings)) {
            let top = px(HEIGHT * row);
            label(canvas, name, (px(18), top + px(206)), 14, INK, Anchor::Left)?;
            for (k, petals) in petals.iter().enumerate() {
                let largest = rows.iter().map(|row| row[k].largest()).fold(0.0, f64::max);
                let centre = (px(inset + 180 + 360 * k as i32), top + px(206));
                petals.draw(canvas, centre, largest)?;
                petals.head(canvas, centre)?;
            }
        }
        Ok(())
    })
}

fn petals(report: &Report) -> [Petals; 3] {
    let summary = &report.summary;
    let mean = report.force_fabric.map(|f| f.mean_force);
    let over_mean = |column: &[Option<f64>]| -> Vec<f64> {
        column.iter().map(|v| v.zip(mean).map_or(0.0, |(v, mean)| v / mean)).collect()
    };
    let anisotropy = report.fabric.map_or_else(Mat3::zeros, |f| f.anisotropy());
    let (normal, shear) = report
        .force_fabric
        .map_or((Mat3::zeros(), Mat3::zeros()), |f| (f.normal_anisotropy, f.shear_anisotropy));
    let degree = |name: &str, a: Option<f64>| {
        a.map_or_else(|| format!("{name}: undefined"), |a| format!("{name} = {}", readable(a)))
    };
    let has_contacts = report.fabric.is_some();
    let has_forces = report.force_fabric.is_some();
    [
        Petals {
            title: "contact normals",
            degree: degree("a_c", summary.a_c),
            mean: Some(1.0),
            bins: report.rose.density.iter().map(|v| v.unwrap_or(0.0)).collect(),
            fit: has_contacts.then(|| curve(|angle| Rose::normal_fit(&anisotropy, angle))),
        },
        Petals {
            title: "normal forces",
            degree: degree("a_n", summary.a_n),
            mean: Some(1.0),
            bins: over_mean(&report.rose.normal_force),
            fit: has_forces.then(|| curve(|angle| Rose::normal_fit(&normal, angle))),
        },
        Petals {
            title: "shear forces",
            degree: degree("a_t", summary.a_t),
            mean: None,
            bins: over_mean(&report.rose.shear_force),
            fit: has_forces.then(|| curve(|angle| Rose::shear_fit(&shear, angle))),
        },
    ]
}

/// Values of the fit at angles from 0 to π/2.
fn curve(fit: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
    (0..=45).map(|k| f64::from(k) / 45.0 * FRAC_PI_2).map(|angle| (angle, fit(angle))).collect()
}

/// One rose: bins from vertical to horizontal, mirrored into four quadrants.
struct Petals {
    title: &'static str,
    degree: String,
    /// Mean over all directions, drawn as a darker ring.
    mean: Option<f64>,
    bins: Vec<f64>,
    fit: Option<Vec<(f64, f64)>>,
}

impl Petals {
    const RADIUS: i32 = 132;
    const QUADRANTS: [(f64, f64); 4] = [(1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (-1.0, 1.0)];

    /// Largest radius.
    fn largest(&self) -> f64 {
        let fit = self.fit.iter().flatten().map(|p| p.1.abs());
        self.bins.iter().map(|b| b.abs()).chain(fit).chain(self.mean).fold(0.0, f64::max)
    }

    /// Draws the rose; `largest` is the radius that the rings must hold.
    fn draw(&self, canvas: &Canvas, centre: (i32, i32), largest: f64) -> Result<(), PlotError> {
        let step = nice_step(largest);
        let rings = ((largest / step).ceil() as i32).max(1);
        let scale = f64::from(px(Self::RADIUS)) / (f64::from(rings) * step);
        let at = |angle: f64, radius: f64, (right, up): (f64, f64)| {
            let (x, y) = (right * radius * angle.sin(), up * radius * angle.cos());
            (centre.0 + (x * scale).round() as i32, centre.1 - (y * scale).round() as i32)
        };
        for ring in 1..=rings {
            let radius = (f64::from(ring) * step * scale).round() as i32;
            canvas.draw(&Circle::new(centre, radius, GRID.stroke_width(FINE as u32)))?;
        }
        if let Some(mean) = self.mean {
            let radius = (mean * scale).round() as i32;
            canvas.draw(&Circle::new(centre, radius, MUTED.stroke_width(FINE as u32)))?;
        }
        for (right, up) in Self::QUADRANTS {
            for (k, &bin) in self.bins.iter().enumerate() {
                let from = k as f64 * Rose::STEP;
                let arc = (0..=8).map(|i| from + Rose::STEP * f64::from(i) / 8.0);
                let mut wedge = vec![centre];
                wedge.extend(arc.map(|angle| at(angle, bin.abs(), (right, up))));
                // Shear forces towards the horizontal are negative and have another colour.
                let colour = if bin < 0.0 { ORANGE } else { BLUE };
                canvas.draw(&Polygon::new(wedge.clone(), colour.mix(0.35)))?;
                wedge.push(centre);
                canvas.draw(&PathElement::new(wedge, colour.stroke_width(FINE as u32)))?;
            }
        }
        if let Some(fit) = &self.fit {
            let fit_style = VERMILION.stroke_width(px(2) as u32);
            for quadrant in Self::QUADRANTS {
                let path: Vec<_> = fit.iter().map(|&(a, r)| at(a, r.abs(), quadrant)).collect();
                canvas.draw(&PathElement::new(path, fit_style))?;
            }
        }
        for ring in 1..=rings {
            let value = f64::from(ring) * step;
            let place = at(FRAC_PI_4, value, (1.0, -1.0));
            label(
                canvas,
                &tick(value),
                (place.0 + px(3), place.1 + px(8)),
                12,
                MUTED,
                Anchor::Left,
            )?;
        }
        let foot = (centre.0, centre.1 + px(Self::RADIUS + 16));
        label(canvas, "vertical ↑, horizontal →", (foot.0, foot.1), 12, MUTED, Anchor::Middle)
    }

    /// Draws title and degree above the rose.
    fn head(&self, canvas: &Canvas, centre: (i32, i32)) -> Result<(), PlotError> {
        label(canvas, self.title, (centre.0, centre.1 - px(188)), 14, INK, Anchor::Middle)?;
        label(canvas, &self.degree, (centre.0, centre.1 - px(166)), 13, MUTED, Anchor::Middle)
    }
}

/// Steps of the rings: 1, 2 or 5 times a power of ten, with at most four rings.
fn nice_step(largest: f64) -> f64 {
    if !(largest.is_finite() && largest > 1e-12) {
        return 1.0;
    }
    let (mantissa, exponent) = scientific(largest / 4.0);
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().find(|s| *s >= mantissa).unwrap_or(10.0);
    step * 10f64.powi(exponent)
}
