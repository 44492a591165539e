//! Error against time on logarithmic axes, one drawing per shape. The Pareto front, methods that no other
//! method beats in both, is joined by a line and labelled with settings.

use crate::measure::{Contacts, Spread, Start};
use crate::methods::Family;
use crate::record;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;
use std::ops::Range;
use std::path::Path;

const INK: RGBColor = RGBColor(0x1F, 0x29, 0x33);
const MUTED: RGBColor = RGBColor(0x5B, 0x66, 0x72);
const GRID: RGBColor = RGBColor(0xE3, 0xE7, 0xEB);
/// One panel [px].
const PANEL: (u32, u32) = (480, 380);
const LEGEND: u32 = 64;
/// Height of a line and width of a letter of the labels [px].
const LETTER: (i32, i32) = (12, 6);
/// Smallest error drawn: those below are rounding.
const LEAST: f64 = 1e-15;

/// Colours of Okabe and Ito.
const fn colour(family: Family) -> RGBColor {
    match family {
        Family::CommonNormal => RGBColor(0x00, 0x9E, 0x73),
        Family::Erosion => RGBColor(0x00, 0x72, 0xB2),
        Family::Epa => RGBColor(0xE6, 0x9F, 0x00),
        Family::ParryErosion => RGBColor(0xCC, 0x79, 0xA7),
        Family::Parry => RGBColor(0xD5, 0x5E, 0x00),
        Family::Thickness => RGBColor(0x56, 0xB4, 0xE9),
    }
}

/// A disc for methods of this program, a ring for others.
fn mark(family: Family) -> ShapeStyle {
    let is_other = matches!(family, Family::ParryErosion | Family::Parry);
    if is_other { colour(family).stroke_width(2) } else { colour(family).filled() }
}

type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Pick = fn(&Contacts) -> &Spread;

const ERRORS: [(&str, Pick); 3] = [
    ("overlap / short axis", |c| &c.overlap),
    ("normal (rad)", |c| &c.normal),
    ("contact point / short axis", |c| &c.point),
];

/// A method in a panel.
struct Dot<'a> {
    contacts: &'a Contacts,
    nanoseconds: f64,
    error: f64,
}

/// Draws `<grain>.svg` for every grain.
pub(crate) fn write(folder: &Path, contacts: &[Contacts]) -> anyhow::Result<()> {
    let mut rest = contacts;
    while let Some(first) = rest.first() {
        let grain = &first.entry.grain;
        let count = rest.iter().take_while(|c| c.entry.grain == *grain).count();
        let svg = drawing(&rest[..count]).map_err(|error| anyhow::anyhow!("{error}"))?;
        record::write_file(folder, &format!("{}.svg", grain.replace(' ', "_")), &svg)?;
        rest = &rest[count..];
    }
    Ok(())
}

fn drawing(contacts: &[Contacts]) -> Result<String, Box<dyn Error>> {
    let mut svg = String::new();
    {
        let size = (PANEL.0 * ERRORS.len() as u32, PANEL.1 * Start::BOTH.len() as u32 + LEGEND);
        let canvas = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        canvas.fill(&WHITE)?;
        let (top, panels) = canvas.split_vertically(LEGEND);
        legend(&top, contacts)?;
        // Axes that are common to all panels.
        let times = || contacts.iter().map(|contacts| contacts.time.median);
        let range = 0.7 * times().fold(f64::INFINITY, f64::min)..1.4 * times().fold(0.0, f64::max);
        let panels = panels.split_evenly((Start::BOTH.len(), ERRORS.len()));
        let wanted = Start::BOTH.iter().flat_map(|start| ERRORS.map(|error| (start, error)));
        for (area, (start, (name, pick))) in panels.iter().zip(wanted) {
            let dots = contacts.iter().filter(|c| c.entry.start == *start).map(|contacts| Dot {
                contacts,
                nanoseconds: contacts.time.median,
                error: pick(contacts).p99.max(LEAST),
            });
            panel(area, &format!("{}: {name}", start.name()), &dots.collect::<Vec<_>>(), &range)?;
        }
        canvas.present()?;
    }
    Ok(svg)
}

fn text(pixels: i32, colour: RGBColor) -> TextStyle<'static> {
    ("sans-serif", pixels).into_font().color(&colour)
}

fn legend(area: &Canvas, contacts: &[Contacts]) -> Result<(), Box<dyn Error>> {
    let grain = &contacts[0].entry.grain;
    let title =
        format!("{grain}: error, 99th percentile, against time; line and settings: Pareto front");
    area.draw(&Text::new(title, (14, 10), text(18, INK)))?;
    let takes_part = |family: &Family| contacts.iter().any(|c| c.entry.family == *family);
    for (k, family) in (0..).zip(Family::ALL.into_iter().filter(takes_part)) {
        let x = 20 + 190 * k;
        area.draw(&Circle::new((x, 46), 5, mark(family)))?;
        area.draw(&Text::new(family.name(), (x + 12, 38), text(15, MUTED)))?;
    }
    Ok(())
}

fn panel(
    area: &Canvas,
    title: &str,
    dots: &[Dot],
    range: &Range<f64>,
) -> Result<(), Box<dyn Error>> {
    let mut chart = ChartBuilder::on(area)
        .caption(title, text(15, INK))
        .margin(10)
        .x_label_area_size(40)
        .y_label_area_size(60)
        .build_cartesian_2d(range.clone().log_scale(), (0.1 * LEAST..10.0).log_scale())?;
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(GRID)
        .axis_style(MUTED)
        .label_style(text(13, MUTED))
        .x_labels(6)
        .y_labels(8)
        .x_label_formatter(&|x| format!("{x:e}"))
        .y_label_formatter(&|y| format!("{y:.0e}"))
        .x_desc("time per contact (ns)")
        .axis_desc_style(text(13, INK))
        .draw()?;
    let front = front(dots);
    let steps = front.iter().map(|dot| (dot.nanoseconds, dot.error));
    chart.draw_series(LineSeries::new(steps, MUTED))?;
    let drawn = dots.iter().filter(|dot| dot.error.is_finite());
    chart.draw_series(drawn.clone().map(|dot| {
        Circle::new((dot.nanoseconds, dot.error), 4, mark(dot.contacts.entry.family))
    }))?;
    let plane = chart.plotting_area();
    let (base_x, base_y) = area.get_base_pixel();
    let pixel = |dot: &Dot| {
        let (x, y) = plane.map_coordinate(&(dot.nanoseconds, dot.error));
        (x - base_x, y - base_y)
    };
    let mut taken: Vec<[i32; 4]> =
        drawn.map(pixel).map(|(x, y)| [x - 4, y - 4, x + 4, y + 4]).collect();
    let (across, down) = (plane.get_x_axis_pixel_range(), plane.get_y_axis_pixel_range());
    let (left, right) = (across.start - base_x, across.end - base_x);
    let (top, bottom) = (down.start.min(down.end) - base_y, down.start.max(down.end) - base_y);
    for dot in front {
        let (x, y) = pixel(dot);
        let name = &dot.contacts.entry.settings;
        let (width, height) = (LETTER.1 * name.len() as i32, LETTER.0);
        // The nearest free place around the point.
        let places = (0..6).flat_map(|k| {
            let (up, down) = (y - height - 3 - 13 * k, y + 3 + 13 * k);
            let (after, before, middle) = (x + 7, x - 7 - width, x - width / 2);
            [(after, up), (after, down), (before, up), (before, down), (middle, up), (middle, down)]
        });
        let mut boxes = places.map(|(x, y)| [x, y, x + width, y + height]);
        let is_free = |place: &[i32; 4]| {
            let [x0, y0, x1, y1] = *place;
            let inside = x0 > left && x1 < right && y0 > top && y1 < bottom;
            inside && taken.iter().all(|t| x1 < t[0] || t[2] < x0 || y1 < t[1] || t[3] < y0)
        };
        let Some(place) = boxes.find(is_free) else { continue };
        taken.push(place);
        area.draw(&Text::new(name.clone(), (place[0], place[1]), text(11, INK)))?;
    }
    Ok(())
}

/// The Pareto front by time: each method is more accurate than all faster ones.
fn front<'a>(dots: &'a [Dot<'a>]) -> Vec<&'a Dot<'a>> {
    let mut by_time: Vec<&Dot> = dots.iter().filter(|dot| dot.error.is_finite()).collect();
    by_time.sort_by(|a, b| a.nanoseconds.total_cmp(&b.nanoseconds));
    let mut least = f64::INFINITY;
    by_time.retain(|dot| {
        let better = dot.error < least;
        least = least.min(dot.error);
        better
    });
    by_time
}
