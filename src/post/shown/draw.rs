//! Charts as SVG text, drawn with plotters. The colours are those of Okabe and Ito, which colour-blind readers can
//! distinguish.

use crate::post::report::readable;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;
use std::fmt::Write as _;
use std::ops::Range;

/// Error of drawing a plot.
#[derive(Clone, Debug, thiserror::Error)]
#[error("cannot draw a plot: {0}")]
pub struct PlotError(String);

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for PlotError {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Self(error.to_string())
    }
}

/// Colour of text, and of the first curve.
pub const INK: RGBColor = RGBColor(0x1F, 0x29, 0x33);
/// Colour of axes and labels.
pub const MUTED: RGBColor = RGBColor(0x5B, 0x66, 0x72);
/// Colour of grid lines.
pub const GRID: RGBColor = RGBColor(0xE3, 0xE7, 0xEB);
/// Colour of Okabe and Ito, like the following ones.
pub const BLUE: RGBColor = RGBColor(0x00, 0x72, 0xB2);
/// See [`BLUE`].
pub const ORANGE: RGBColor = RGBColor(0xE6, 0x9F, 0x00);
/// See [`BLUE`].
pub const VERMILION: RGBColor = RGBColor(0xD5, 0x5E, 0x00);
/// See [`BLUE`].
pub const GREEN: RGBColor = RGBColor(0x00, 0x9E, 0x73);
/// See [`BLUE`].
pub const PURPLE: RGBColor = RGBColor(0xCC, 0x79, 0xA7);

/// Drawing units per pixel: plotters places everything at whole units, and this many keep curves smooth.
pub const FINE: i32 = 8;

/// Converts pixels to drawing units.
pub const fn px(pixels: i32) -> i32 {
    pixels * FINE
}

/// A part of a drawing.
pub type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Text style of this size in pixels.
fn text(pixels: i32, colour: RGBColor) -> TextStyle<'static> {
    // plotters' SVG divides sizes by 1.24.
    ("sans-serif", f64::from(px(pixels)) * 1.24).into_font().color(&colour)
}

/// A drawing of this size in pixels.
///
/// # Errors
/// See [`PlotError`].
pub fn drawing(
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
    // The view box keeps the drawing units; the size is in pixels.
    let fine = format!(r#"width="{fine_width}" height="{fine_height}" viewBox"#);
    Ok(svg.replacen(&fine, &format!(r#"width="{width}" height="{height}" viewBox"#), 1))
}

/// Panels of this size [px] in rows of `columns`, each under its title.
///
/// # Errors
/// See [`PlotError`].
pub fn grid(
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

/// Mark of a series.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mark {
    /// A line through the points.
    Line,
    /// A dot at each point.
    Dots,
    /// Bars of a width in units of x, from zero; the second number shifts their middles.
    Bars(f64, f64),
    /// A vertical line at the x of each point.
    Rule,
}

/// Points with the same mark.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the legend; empty for none.
    pub name: String,
    /// Colour of all marks.
    pub colour: RGBColor,
    /// Mark of each point.
    pub mark: Mark,
    /// x and y; points that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

/// Both axes of a chart.
#[derive(Clone, Debug)]
pub struct Axes {
    /// Label below the chart.
    pub x_label: String,
    /// Label on the left.
    pub y_label: String,
    /// Range from left to right.
    pub x: Range<f64>,
    /// Range from bottom to top.
    pub y: Range<f64>,
    /// True if x is logarithmic.
    pub log_x: bool,
    /// True if y is logarithmic.
    pub log_y: bool,
}

/// Axes that are both linear.
pub fn linear(x_label: &str, y_label: &str, x: Range<f64>, y: Range<f64>) -> Axes {
    let (x_label, y_label) = (x_label.into(), y_label.into());
    Axes { x_label, y_label, x, y, log_x: false, log_y: false }
}

/// Largest number of points that show their values under the pointer.
const MOST_WITH_VALUES: usize = 500;

/// A point that shows its values: place in drawing units, and words.
type Titled = ((i32, i32), String);

/// A chart of this size [px] with a legend above it. Points show their values under the pointer, unless there are very many.
///
/// # Errors
/// See [`PlotError`].
pub fn chart(size: (u32, u32), axes: &Axes, series: &[Series]) -> Result<String, PlotError> {
    let mut titled = Vec::new();
    let mut svg = drawing(size.0, size.1, |canvas| {
        titled = titled_panel(canvas, axes, series)?;
        Ok(())
    })?;
    if titled.is_empty() || titled.len() > MOST_WITH_VALUES {
        return Ok(svg);
    }
    let mut circles = "<g fill=\"none\" pointer-events=\"all\">\n".to_owned();
    for ((x, y), words) in titled {
        let words = words.replace('&', "&amp;").replace('<', "&lt;");
        let radius = px(4);
        let _ = writeln!(
            circles,
            r#"<circle cx="{x}" cy="{y}" r="{radius}"><title>{words}</title></circle>"#
        );
    }
    circles.push_str("</g>\n");
    if let Some(end) = svg.rfind("</svg>") {
        svg.insert_str(end, &circles);
    }
    Ok(svg)
}

/// Space on the left of a legend [px].
const LEGEND_LEFT: i32 = 72;
/// Height of a row of a legend [px].
const LEGEND_ROW: i32 = 18;
/// Space on the right of a chart and its legend [px].
const RIGHT: i32 = 18;

/// Draws a chart with a legend above it into a part of a drawing.
///
/// # Errors
/// See [`PlotError`].
pub fn panel(canvas: &Canvas, axes: &Axes, series: &[Series]) -> Result<(), PlotError> {
    titled_panel(canvas, axes, series).map(drop)
}

/// Draws a chart, and returns its points with their values.
fn titled_panel(canvas: &Canvas, axes: &Axes, series: &[Series]) -> Result<Vec<Titled>, PlotError> {
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

/// Draws grid, labels and series of a chart, and returns its points with their values.
fn fill<X, Y>(
    chart: &mut ChartContext<SVGBackend, Cartesian2d<X, Y>>,
    axes: &Axes,
    series: &[Series],
) -> Result<Vec<Titled>, PlotError>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let x_tick = |x: &f64| if axes.log_x { power(*x) } else { tick_on(*x, &axes.x) };
    let y_tick = |y: &f64| if axes.log_y { power(*y) } else { tick_on(*y, &axes.y) };
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
    let of_values = series.iter().filter(|s| s.mark != Mark::Rule);
    let points = of_values.flat_map(|s| s.points.iter().map(move |p| (s, p)));
    let titled = points.filter(|(_, p)| p.0.is_finite() && p.1.is_finite()).map(|(s, p)| {
        let name = if s.name.is_empty() { String::new() } else { format!("{}: ", s.name) };
        let [x, y] = [(&axes.x_label, p.0), (&axes.y_label, p.1)]
            .map(|(label, value)| format!("{label} {}", readable(value)));
        (chart.backend_coord(p), format!("{name}{x}, {y}"))
    });
    Ok(titled.collect())
}

/// Draws swatches and names in as many rows as they need; returns the number of rows.
fn legend(canvas: &Canvas, series: &[&Series]) -> Result<i32, PlotError> {
    let end = canvas.dim_in_pixel().0 as i32 - px(RIGHT);
    let (mut x, mut rows) = (end, 0);
    for s in series {
        // About the width of a letter; the exact width depends on the viewer.
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

/// Position of a text relative to its point.
#[derive(Clone, Copy, Debug)]
pub enum Anchor {
    /// The text begins at the point.
    Left,
    /// The middle of the text is at the point.
    Middle,
}

/// Writes a line of text of this size [px] at a point of the drawing.
///
/// # Errors
/// See [`PlotError`].
pub fn label(
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

/// A number with no more digits than needed.
pub fn tick(value: f64) -> String {
    written(value, [6, 2])
}

/// Label of a linear axis of this range. Ticks are rounded far below their distance: sums of steps leave an error where 0
/// should be. Neighbours have different labels.
fn tick_on(value: f64, range: &Range<f64>) -> String {
    let length = (range.end - range.start).abs().max(1e-290);
    let last = length.log10().floor() as i32 - 3;
    let grain = 10f64.powi(last);
    let value = (value / grain).round() * grain;
    let digits = |exponent: i32| exponent.saturating_sub(last).clamp(0, 15) as usize;
    written(value, [digits(0), digits(value.abs().log10().floor() as i32)])
}

/// A number with at most these digits after the point: of the number itself, and of a mantissa.
fn written(value: f64, [plain, of_mantissa]: [usize; 2]) -> String {
    let trimmed = |number: f64, digits: usize| {
        let text = format!("{number:.digits$}");
        if digits == 0 {
            return text;
        }
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    };
    let size = value.abs();
    if size < 1e-300 {
        return "0".into();
    }
    if (1e-3..1e5).contains(&size) {
        return trimmed(value, plain);
    }
    let (mantissa, exponent) = scientific(value);
    format!("{}·10{}", trimmed(mantissa, of_mantissa), superscript(exponent))
}

/// Label of a logarithmic axis.
fn power(value: f64) -> String {
    format!("10{}", superscript(value.log10().round() as i32))
}

/// Mantissa and exponent: `mantissa * 10^exponent`.
pub fn scientific(value: f64) -> (f64, i32) {
    let exponent = value.abs().log10().floor() as i32;
    (value / 10f64.powi(exponent), exponent)
}

fn superscript(number: i32) -> String {
    const RAISED: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raise = |c: char| c.to_digit(10).map_or('⁻', |digit| RAISED[digit as usize]);
    number.to_string().chars().map(raise).collect()
}

/// Span of these values with a little room; 0 to 1 without values.
pub fn span(values: impl Iterator<Item = f64>) -> Range<f64> {
    let finite = values.filter(|v| v.is_finite());
    let (low, high) =
        finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return 0.0..1.0;
    }
    let room = 0.05 * (high - low);
    // A constant also needs a span, wide enough for two different ends.
    let room = if room > 1e-12 * high.abs() { room } else { 0.1 * high.abs().max(1e-9) };
    low - room..high + room
}

/// Whole decades around these values; 0.1 to 10 without positive values.
pub fn decades(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values
        .filter(|v| v.is_finite() && *v > 0.0)
        .fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return 0.1..10.0;
    }
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    // Slightly wider: rounding would otherwise drop the outer labels.
    10f64.powi(first) * (1.0 - 1e-9)..10f64.powi(last.max(first + 1)) * (1.0 + 1e-9)
}

/// Size of a plot over half the width of the page [px].
pub const SIZE: (u32, u32) = (560, 360);

/// A vertical line without a name in the legend.
pub fn rule(colour: RGBColor, x: f64) -> Series {
    Series { name: String::new(), colour, mark: Mark::Rule, points: vec![(x, 0.0)] }
}
