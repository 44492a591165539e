//! Plots as SVG text, drawn with plotters. The colours are those of Okabe and Ito, which colour-blind
//! readers can tell apart; every plot can be read alone and stands in the page as well.

use super::coordination::{Coordination, CoordinationNumbers};
use super::forces::Histogram;
use super::report::{Report, readable};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;
use std::ops::Range;

/// A plot, ready to be shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plot {
    /// Name of its file, without the ending.
    pub name: String,
    /// What it shows, in a few words.
    pub title: String,
    /// What it shows, in one sentence.
    pub caption: String,
    /// Takes the whole width of the page.
    pub wide: bool,
    /// The drawing.
    pub svg: String,
}

/// Why a plot could not be drawn.
#[derive(Clone, Debug, thiserror::Error)]
#[error("cannot draw a plot: {0}")]
pub struct PlotError(String);

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for PlotError {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Self(error.to_string())
    }
}

pub(super) const INK: RGBColor = RGBColor(0x1F, 0x29, 0x33);
pub(super) const MUTED: RGBColor = RGBColor(0x5B, 0x66, 0x72);
pub(super) const GRID: RGBColor = RGBColor(0xE3, 0xE7, 0xEB);
pub(super) const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xB2);
pub(super) const ORANGE: RGBColor = RGBColor(0xE6, 0x9F, 0x00);
pub(super) const VERMILION: RGBColor = RGBColor(0xD5, 0x5E, 0x00);
pub(super) const GREEN: RGBColor = RGBColor(0x00, 0x9E, 0x73);
pub(super) const PURPLE: RGBColor = RGBColor(0xCC, 0x79, 0xA7);

/// plotters places everything at whole units: this many to a pixel keep curves smooth.
pub(super) const FINE: i32 = 8;

/// Pixels in the units of the drawing.
pub(super) const fn px(pixels: i32) -> i32 {
    pixels * FINE
}

pub(super) type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A text style of this size in pixels.
fn text(pixels: i32, colour: RGBColor) -> TextStyle<'static> {
    // plotters' SVG divides sizes by 1.24.
    ("sans-serif", f64::from(px(pixels)) * 1.24).into_font().color(&colour)
}

/// A drawing of this size in pixels.
pub(super) fn drawing(
    width: u32,
    height: u32,
    paint: impl FnOnce(&Canvas) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    let (fine_width, fine_height) = (width * FINE as u32, height * FINE as u32);
    let mut svg = String::new();
    {
        let canvas =
            SVGBackend::with_string(&mut svg, (fine_width, fine_height)).into_drawing_area();
        canvas.fill(&WHITE)?;
        paint(&canvas)?;
        canvas.present()?;
    }
    // The view box keeps the fine units; the size is in pixels.
    let fine = format!(r#"width="{fine_width}" height="{fine_height}" viewBox"#);
    Ok(svg.replacen(&fine, &format!(r#"width="{width}" height="{height}" viewBox"#), 1))
}

/// Panels of this size in rows of `columns`, each under its title.
pub(super) fn grid(
    columns: usize,
    (width, height): (u32, u32),
    titles: &[String],
    paint: impl Fn(usize, &Canvas) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    const HEAD: i32 = 30;
    let rows = titles.len().div_ceil(columns);
    let size = (columns as u32 * width, rows as u32 * (height + HEAD as u32));
    drawing(size.0, size.1, |canvas| {
        for (k, (cell, title)) in
            canvas.split_evenly((rows, columns)).iter().zip(titles).enumerate()
        {
            let (head, body) = cell.split_vertically(px(HEAD));
            label(&head, title, (px(72), px(18)), 14, INK, Anchor::Left)?;
            paint(k, &body)?;
        }
        Ok(())
    })
}

/// How a series is drawn.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Mark {
    Line,
    Dots,
    /// Bars of this width in units of x, from zero, their middles shifted by the second.
    Bars(f64, f64),
    /// A vertical line at the x of each point.
    Rule,
}

/// Points drawn alike.
pub(super) struct Series {
    /// In the legend; empty: not there.
    pub(super) name: String,
    pub(super) colour: RGBColor,
    pub(super) mark: Mark,
    pub(super) points: Vec<(f64, f64)>,
}

/// Both axes of a chart.
pub(super) struct Axes {
    pub(super) x_label: String,
    pub(super) y_label: String,
    pub(super) x: Range<f64>,
    pub(super) y: Range<f64>,
    pub(super) log_x: bool,
    pub(super) log_y: bool,
}

/// Both axes linear.
pub(super) fn linear(x_label: &str, y_label: &str, x: Range<f64>, y: Range<f64>) -> Axes {
    let (x_label, y_label) = (x_label.into(), y_label.into());
    Axes { x_label, y_label, x, y, log_x: false, log_y: false }
}

/// A chart with a legend above it.
pub(super) fn chart(size: (u32, u32), axes: &Axes, series: &[Series]) -> Result<String, PlotError> {
    drawing(size.0, size.1, |canvas| panel(canvas, axes, series))
}

/// Left of a legend [px].
const LEGEND_LEFT: i32 = 72;
/// Height of a row of a legend [px].
const LEGEND_ROW: i32 = 18;
/// Right of a chart and its legend [px].
const RIGHT: i32 = 18;

/// A chart with a legend above it, as a part of a drawing.
pub(super) fn panel(canvas: &Canvas, axes: &Axes, series: &[Series]) -> Result<(), PlotError> {
    let named: Vec<&Series> = series.iter().filter(|s| !s.name.is_empty()).collect();
    let rows = legend(canvas, &named)?;
    let top = if rows == 0 { 14 } else { 18 + LEGEND_ROW * rows };
    let mut builder = ChartBuilder::on(canvas);
    builder
        .margin_top(px(top))
        .margin_right(px(RIGHT))
        .margin_left(px(4))
        .margin_bottom(px(4))
        .x_label_area_size(px(46))
        .y_label_area_size(px(66));
    let (x, y) = (axes.x.clone(), axes.y.clone());
    match (axes.log_x, axes.log_y) {
        (false, false) => fill(&mut builder.build_cartesian_2d(x, y)?, axes, series),
        (false, true) => fill(&mut builder.build_cartesian_2d(x, y.log_scale())?, axes, series),
        (true, false) => fill(&mut builder.build_cartesian_2d(x.log_scale(), y)?, axes, series),
        (true, true) => {
            fill(&mut builder.build_cartesian_2d(x.log_scale(), y.log_scale())?, axes, series)
        }
    }
}

/// Grid, labels and series of a chart.
fn fill<X, Y>(
    chart: &mut ChartContext<SVGBackend, Cartesian2d<X, Y>>,
    axes: &Axes,
    series: &[Series],
) -> Result<(), PlotError>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let x_tick = |x: &f64| if axes.log_x { power(*x) } else { tick(*x) };
    let y_tick = |y: &f64| if axes.log_y { power(*y) } else { tick(*y) };
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(GRID.stroke_width(FINE as u32))
        .axis_style(MUTED.stroke_width(FINE as u32))
        .set_all_tick_mark_size(px(4))
        .label_style(text(12, MUTED))
        .axis_desc_style(text(13, INK))
        .x_labels(8)
        .y_labels(6)
        .x_label_formatter(&x_tick)
        .y_label_formatter(&y_tick)
        .x_desc(axes.x_label.as_str())
        .y_desc(axes.y_label.as_str())
        .draw()?;
    for s in series {
        let inside = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
        let points = s.points.iter().filter(inside).copied();
        let line = s.colour.stroke_width((px(3) / 2) as u32);
        match s.mark {
            Mark::Line => {
                chart.draw_series(std::iter::once(PathElement::new(
                    points.collect::<Vec<_>>(),
                    line,
                )))?;
            }
            Mark::Dots => {
                chart.draw_series(points.map(|p| Circle::new(p, px(3), s.colour.filled())))?;
            }
            Mark::Bars(width, shift) => {
                chart.draw_series(points.map(|(x, y)| {
                    let (left, right) = (x + shift - 0.5 * width, x + shift + 0.5 * width);
                    Rectangle::new([(left, 0.0), (right, y)], s.colour.filled())
                }))?;
            }
            Mark::Rule => {
                let (low, high) = (axes.y.start, axes.y.end);
                chart.draw_series(
                    points.map(|(x, _)| PathElement::new(vec![(x, low), (x, high)], line)),
                )?;
            }
        }
    }
    Ok(())
}

/// Swatches and names in as many rows as they need, which are counted.
fn legend(canvas: &Canvas, series: &[&Series]) -> Result<i32, PlotError> {
    let end = canvas.dim_in_pixel().0 as i32 - px(RIGHT);
    let (mut x, mut rows) = (end, 0);
    for s in series {
        // About the width of a letter; text is measured by whoever shows the drawing.
        let width = px(15) + s.name.chars().count() as i32 * px(13) / 2;
        if rows == 0 || x + width > end {
            (x, rows) = (px(LEGEND_LEFT), rows + 1);
        }
        let y = px(LEGEND_ROW * rows - 1);
        let swatch = [(x, y - px(5)), (x + px(10), y + px(5))];
        let rule = [(x, y - px(1)), (x + px(10), y + px(1))];
        let area = if matches!(s.mark, Mark::Line | Mark::Rule) { rule } else { swatch };
        canvas.draw(&Rectangle::new(area, s.colour.filled()))?;
        label(canvas, &s.name, (x + px(15), y), 12, MUTED, Anchor::Left)?;
        x += width + px(22);
    }
    Ok(rows)
}

#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Left,
    Middle,
}

pub(super) fn label(
    canvas: &Canvas,
    words: &str,
    at: (i32, i32),
    size: i32,
    colour: RGBColor,
    anchor: Anchor,
) -> Result<(), PlotError> {
    use plotters::style::text_anchor::{HPos, Pos, VPos};
    let h = match anchor {
        Anchor::Left => HPos::Left,
        Anchor::Middle => HPos::Center,
    };
    let style = text(size, colour).pos(Pos::new(h, VPos::Center));
    Ok(canvas.draw(&Text::new(words.to_string(), at, style))?)
}

/// A label of a linear axis: no more digits than it needs.
pub(super) fn tick(value: f64) -> String {
    let size = value.abs();
    if size < 1e-300 {
        return "0".into();
    }
    if !(1e-3..1e5).contains(&size) {
        let (mantissa, exponent) = scientific(value);
        let mantissa = format!("{mantissa:.2}");
        return format!(
            "{}·10{}",
            mantissa.trim_end_matches('0').trim_end_matches('.'),
            superscript(exponent)
        );
    }
    let fixed = format!("{value:.6}");
    fixed.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// A label of a logarithmic axis.
fn power(value: f64) -> String {
    format!("10{}", superscript(value.log10().round() as i32))
}

pub(super) fn scientific(value: f64) -> (f64, i32) {
    let exponent = value.abs().log10().floor() as i32;
    (value / 10f64.powi(exponent), exponent)
}

fn superscript(number: i32) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raise = |c: char| c.to_digit(10).map_or('⁻', |digit| RAISED[digit as usize]);
    number.to_string().chars().map(raise).collect()
}

/// The span of these values with a little room; 0 to 1 without any.
pub(super) fn span(values: impl Iterator<Item = f64>) -> Range<f64> {
    let finite = values.filter(|v| v.is_finite());
    let (low, high) =
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return 0.0..1.0;
    }
    let room = 0.05 * (high - low);
    // A constant needs a span too, wide enough that its ends are different numbers.
    let room = if room > 1e-12 * high.abs() { room } else { 0.1 * high.abs().max(1e-9) };
    low - room..high + room
}

/// Whole decades around these values; 0.1 to 10 without any above zero.
pub(super) fn decades(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values
        .filter(|v| v.is_finite() && *v > 0.0)
        .fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return 0.1..10.0;
    }
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    // A hair wider, or rounding would take the outer labels away.
    10f64.powi(first) * (1.0 - 1e-9)..10f64.powi(last.max(first + 1)) * (1.0 + 1e-9)
}

/// Of a plot that takes half the page's width [px].
pub(super) const SIZE: (u32, u32) = (560, 360);

/// How many particles have how many contacts (fig. 11 of Lai et al. 2021).
///
/// # Errors
/// See [`PlotError`].
pub fn coordination(coordination: &Coordination) -> Result<Plot, PlotError> {
    let (all, pairs) = (&coordination.with_walls, &coordination.without_walls);
    let mut counted = vec![("between particles", BLUE, pairs)];
    if all != pairs {
        counted.push(("with walls", ORANGE, all));
    }
    let (axes, mut series) = bars(&counted);
    if let Some(mean) = pairs.mean() {
        series.push(Series { name: format!("mean {}", readable(mean)), ..rule(INK, mean) });
    }
    Ok(Plot {
        name: "coordination".into(),
        title: "Coordination number".into(),
        caption:
            "Share of particles by number of contacts; the line is the mean between particles."
                .into(),
        wide: false,
        svg: chart(SIZE, &axes, &series)?,
    })
}

/// Shares of particles by number of contacts, several counts beside each other.
pub(super) fn bars(counted: &[(&str, RGBColor, &CoordinationNumbers)]) -> (Axes, Vec<Series>) {
    let width = 0.84 / counted.len().max(1) as f64;
    let left = -0.5 * (counted.len() as f64 - 1.0);
    let of_one =
        |(k, &(name, colour, numbers)): (usize, &(&str, RGBColor, &CoordinationNumbers))| {
            let shares =
                (0i32..).zip(numbers.shares()).map(|(n, share)| (f64::from(n), 100.0 * share));
            let mark = Mark::Bars(width, (left + k as f64) * width);
            Series { name: name.into(), colour, mark, points: shares.collect() }
        };
    let series: Vec<Series> = counted.iter().enumerate().map(of_one).collect();
    let highest = series.iter().flat_map(|s| &s.points).map(|p| p.1).fold(1.0, f64::max);
    let most = counted.iter().map(|c| c.2.histogram.len()).fold(2, usize::max) as f64;
    (
        linear("contacts of a particle", "particles (%)", -0.6..most - 0.4, 0.0..1.08 * highest),
        series,
    )
}

/// A vertical line that the legend does not name.
pub(super) fn rule(colour: RGBColor, x: f64) -> Series {
    Series { name: String::new(), colour, mark: Mark::Rule, points: vec![(x, 0.0)] }
}

/// Probability density of forces over the mean normal force, semi-logarithmic.
///
/// # Errors
/// See [`PlotError`].
pub fn force_distribution(normal: &Histogram, shear: &Histogram) -> Result<Plot, PlotError> {
    let (axes, series) = densities(&both(normal, shear), Mark::Dots);
    let caption = "Probability density of normal and tangential contact forces, both over the mean \
                   normal force; a straight tail is an exponential distribution of strong forces.";
    let left_out =
        beyond(&[("normal forces", normal), ("tangential forces", shear)], " times the mean");
    Ok(Plot {
        name: "force_distribution".into(),
        title: "Contact forces".into(),
        caption: format!("{caption}{left_out}"),
        wide: false,
        svg: chart(SIZE, &axes, &series)?,
    })
}

/// A sentence on what is above the last bin of histograms with the same edges; none if nothing is.
fn beyond(histograms: &[(&str, &Histogram)], unit: &str) -> String {
    let share = |&(what, histogram): &(&str, &Histogram)| {
        Some(format!("{} % of the {what}", readable(100.0 * histogram.share_above()?)))
    };
    let shares: Vec<String> = histograms.iter().filter_map(share).collect();
    let edge = histograms.first().and_then(|(_, histogram)| histogram.edges.last());
    match edge {
        Some(edge) if !shares.is_empty() => {
            format!(" Beyond the plot, at {edge}{unit} and above: {}.", shares.join(", "))
        }
        _ => String::new(),
    }
}

/// The same by logarithm of the force, which shows the weak contacts (fig. 13 of Lai et al. 2021).
///
/// # Errors
/// See [`PlotError`].
pub fn weak_forces(normal: &Histogram, shear: &Histogram) -> Result<Plot, PlotError> {
    let (axes, series) = shares_per_decade(&both(normal, shear), Mark::Dots);
    Ok(Plot {
        name: "weak_forces".into(),
        title: "Weak and strong contacts".into(),
        caption: "The same forces by decade: how many contacts are weak, and how weak.".into(),
        wide: false,
        svg: chart(SIZE, &axes, &series)?,
    })
}

/// A histogram with its name and colour.
pub(super) type Named<'a> = (&'a str, RGBColor, &'a Histogram);

fn both<'a>(normal: &'a Histogram, shear: &'a Histogram) -> [Named<'a>; 2] {
    [("normal", BLUE, normal), ("tangential", ORANGE, shear)]
}

/// Densities of forces over the mean, semi-logarithmic.
pub(super) fn densities(histograms: &[Named], mark: Mark) -> (Axes, Vec<Series>) {
    let series = force_series(histograms, mark, |_, density| density);
    let values = || series.iter().flat_map(|s| &s.points);
    let farthest = values().map(|p| p.0).fold(3.0, f64::max);
    let y = decades(values().map(|p| p.1));
    let axes = linear("force / mean normal force", "probability density", 0.0..1.03 * farthest, y);
    (Axes { log_y: true, ..axes }, series)
}

/// Shares of forces by decade.
pub(super) fn shares_per_decade(histograms: &[Named], mark: Mark) -> (Axes, Vec<Series>) {
    // Density by decade: dP/d(log10 f) = f ln(10) dP/df.
    let per_decade = |force: f64, density: f64| force * std::f64::consts::LN_10 * density;
    let series = force_series(histograms, mark, per_decade);
    let values = || series.iter().flat_map(|s| &s.points);
    let (x, y) = (decades(values().map(|p| p.0)), 0.0..span(values().map(|p| p.1)).end);
    let axes = linear("force / mean normal force", "share of contacts per decade", x, y);
    (Axes { log_x: true, ..axes }, series)
}

fn force_series(histograms: &[Named], mark: Mark, height: impl Fn(f64, f64) -> f64) -> Vec<Series> {
    let points = |histogram: &Histogram| {
        let filled = histogram.density().filter(|&(_, density)| density > 0.0);
        filled.map(|(force, density)| (force, height(force, density))).collect()
    };
    let of_one = |&(name, colour, histogram): &Named| Series {
        name: name.into(),
        colour,
        mark,
        points: points(histogram),
    };
    histograms.iter().map(of_one).collect()
}

/// How much of their friction contacts use.
///
/// # Errors
/// See [`PlotError`].
pub fn friction(used: &Histogram) -> Result<Plot, PlotError> {
    let total = used.total_halves().max(1) as f64;
    let width = used.edges.get(1).copied().unwrap_or(1.0);
    let points: Vec<(f64, f64)> = (used.halves.iter().zip(&used.edges))
        .map(|(&halves, edge)| (edge + 0.5 * width, 100.0 * halves as f64 / total))
        .collect();
    let filled = points.iter().filter(|p| p.1 > 0.0);
    let (end, highest) = filled.fold((0.1, 1.0), |(end, high), p| (p.0.max(end), p.1.max(high)));
    let (x, y) = (0.0..end + 2.0 * width, 0.0..1.08 * highest);
    let axes = linear("tangential / normal force of a contact", "contacts (%)", x, y);
    let bars =
        Series { name: String::new(), colour: BLUE, mark: Mark::Bars(0.85 * width, 0.0), points };
    let caption = "Ratio of tangential to normal force; sliding contacts pile up at the \
                   coefficient of friction.";
    Ok(Plot {
        name: "friction".into(),
        title: "Friction used".into(),
        caption: format!("{caption}{}", beyond(&[("contacts", used)], "")),
        wide: false,
        svg: chart(SIZE, &axes, &[bars])?,
    })
}

/// A number of a summary.
type Pick = fn(&super::Summary) -> Option<f64>;

/// A plot over a series: name, title, label, and the curves with their names.
type Wanted<'a> = (&'a str, &'a str, &'a str, &'a [(&'a str, Pick)]);

const OVER_A_SERIES: [Wanted; 6] = [
    ("stress_ratio", "Stress ratio", "q / p", &[("", |s| s.q_over_p)]),
    (
        "volumetric_strain",
        "Volumetric strain",
        "volumetric strain (%)",
        &[("", |s| s.volumetric_strain.map(|e| 100.0 * e))],
    ),
    ("mean_stress", "Stress", "stress (Pa)", &[("p", |s| s.p_pa), ("q", |s| s.q_pa)]),
    ("solid_fraction", "Solid fraction", "solid fraction", &[("", |s| s.solid_fraction)]),
    (
        "mean_coordination",
        "Coordination number",
        "contacts per particle",
        &[("mean", |s| s.coordination), ("mechanical", |s| s.mechanical_coordination)],
    ),
    (
        "anisotropy",
        "Anisotropy of normals, normal and shear forces",
        "degree of anisotropy",
        &[("a_c", |s| s.a_c), ("a_n", |s| s.a_n), ("a_t", |s| s.a_t)],
    ),
];

/// Stress, strain, density, coordination and anisotropy over a series of snapshots (fig. 10 of Lai et
/// al. 2021): against axial strain if the packing is strained, else against time.
///
/// # Errors
/// See [`PlotError`].
pub fn series(reports: &[Report]) -> Result<Vec<Plot>, PlotError> {
    let strained = reports.iter().any(|r| r.summary.axial_strain.is_some_and(|e| e.abs() > 1e-9));
    let (x_label, against) =
        if strained { ("axial strain (%)", "axial strain") } else { ("time (s)", "time") };
    let mut plots = Vec::new();
    for (name, title, y_label, picks) in OVER_A_SERIES {
        let mut curves = Vec::new();
        for (&(curve, pick), colour) in picks.iter().zip([BLUE, ORANGE, VERMILION]) {
            let points: Vec<(f64, f64)> = reports
                .iter()
                .filter_map(|r| {
                    let strain = r.summary.axial_strain.map(|e| 100.0 * e);
                    let x = if strained { strain } else { Some(r.summary.time_s) };
                    x.zip(pick(&r.summary))
                })
                .collect();
            let line = Series { name: curve.into(), colour, mark: Mark::Line, points };
            let dots = Series {
                name: String::new(),
                mark: Mark::Dots,
                points: line.points.clone(),
                ..line
            };
            curves.extend([line, dots]);
        }
        let points = || curves.iter().flat_map(|s| &s.points);
        if points().count() == 0 {
            continue;
        }
        let (x, y) = (span(points().map(|p| p.0)), span(points().map(|p| p.1)));
        let axes = linear(x_label, y_label, x, y);
        plots.push(Plot {
            name: name.into(),
            title: title.into(),
            caption: format!("{title} of each snapshot against {against}."),
            wide: false,
            svg: chart(SIZE, &axes, &curves)?,
        });
    }
    Ok(plots)
}
