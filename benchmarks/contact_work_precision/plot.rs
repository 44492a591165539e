//! Error against time on logarithmic axes, one drawing per grain. Joined and named is the Pareto front: the
//! methods that no other beats in both.

use crate::measure::{Contacts, Spread, Start};
use crate::methods::Family;
use crate::record;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

const INK: RGBColor = RGBColor(0x1F, 0x29, 0x33);
const MUTED: RGBColor = RGBColor(0x5B, 0x66, 0x72);
const GRID: RGBColor = RGBColor(0xE3, 0xE7, 0xEB);
/// One panel [px].
const PANEL: (u32, u32) = (420, 320);
const LEGEND: u32 = 34;
/// Errors below are drawn here.
const LEAST: f64 = 1e-17;

/// Okabe and Ito's colours.
const fn colour(family: Family) -> RGBColor {
    match family {
        Family::CommonNormal => RGBColor(0x00, 0x9E, 0x73),
        Family::Erosion => RGBColor(0x00, 0x72, 0xB2),
        Family::Epa => RGBColor(0xE6, 0x9F, 0x00),
        Family::Parry => RGBColor(0xD5, 0x5E, 0x00),
    }
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
        legend(&top, &contacts[0].entry.grain)?;
        let panels = panels.split_evenly((Start::BOTH.len(), ERRORS.len()));
        let wanted = Start::BOTH.iter().flat_map(|start| ERRORS.map(|error| (start, error)));
        for (area, (start, (name, pick))) in panels.iter().zip(wanted) {
            let dots = contacts.iter().filter(|c| c.entry.start == *start).map(|contacts| Dot {
                contacts,
                nanoseconds: contacts.time.median,
                error: pick(contacts).p99.max(LEAST),
            });
            panel(area, &format!("{}: {name}", start.name()), &dots.collect::<Vec<_>>())?;
        }
        canvas.present()?;
    }
    Ok(svg)
}

fn text(pixels: i32, colour: RGBColor) -> TextStyle<'static> {
    ("sans-serif", pixels).into_font().color(&colour)
}

fn legend(area: &Canvas, grain: &str) -> Result<(), Box<dyn Error>> {
    area.draw(&Text::new(
        format!("{grain}: 99th percentile of the error"),
        (14, 10),
        text(16, INK),
    ))?;
    let mut x = 420;
    for family in Family::ALL {
        area.draw(&Circle::new((x, 17), 4, colour(family).filled()))?;
        area.draw(&Text::new(family.name(), (x + 10, 11), text(14, MUTED)))?;
        x += 130;
    }
    Ok(())
}

fn panel(area: &Canvas, title: &str, dots: &[Dot]) -> Result<(), Box<dyn Error>> {
    let mut chart = ChartBuilder::on(area)
        .caption(title, text(14, INK))
        .margin(8)
        .x_label_area_size(36)
        .y_label_area_size(52)
        .build_cartesian_2d((1e1..1e5).log_scale(), (LEAST..1.0).log_scale())?;
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(GRID)
        .axis_style(MUTED)
        .label_style(text(12, MUTED))
        .x_labels(5)
        .y_labels(6)
        .x_label_formatter(&|x| format!("{x:e}"))
        .y_label_formatter(&|y| format!("{y:.0e}"))
        .x_desc("ns per contact")
        .axis_desc_style(text(12, INK))
        .draw()?;
    let front = front(dots);
    let steps = front.iter().map(|dot| (dot.nanoseconds, dot.error));
    chart.draw_series(LineSeries::new(steps, MUTED))?;
    chart.draw_series(dots.iter().map(|dot| {
        let colour = colour(dot.contacts.entry.family);
        Circle::new((dot.nanoseconds, dot.error), 4, colour.filled())
    }))?;
    chart.draw_series(front.iter().map(|dot| {
        let offset = EmptyElement::at((dot.nanoseconds, dot.error));
        offset + Text::new(dot.contacts.entry.method.clone(), (7, -5), text(11, INK))
    }))?;
    Ok(())
}

/// By time; each is more accurate than all that are faster.
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
