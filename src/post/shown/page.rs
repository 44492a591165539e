//! One HTML page with the numbers and the plots of a post-processing. It is self-contained (plots and style inside, no
//! scripts), and follows the reader's light or dark setting.

use super::draw::PlotError;
use super::panels::panels;
use super::plots::{self, Plot, Width};
use super::rose::roses;
use super::views::Views;
use crate::drive::servo::Target;
use crate::output::header::WallRow;
use crate::post::forces::Forces;
use crate::post::history::History;
use crate::post::region::Bounds;
use crate::post::report::{Report, readable};
use std::fmt::Write;

/// All plots of a series, in the order of the page: plots over the series, plots and views of its last snapshot, and
/// the history of the run with these walls and targets of their stresses.
///
/// # Errors
/// See [`PlotError`].
pub fn plots(
    reports: &[Report],
    picture: String,
    views: Option<&Views>,
    history: &History,
    walls: &[WallRow],
    targets: &[Target],
) -> Result<Vec<Plot>, PlotError> {
    let mut drawn = Vec::new();
    if reports.len() > 1 {
        drawn.extend(plots::series(reports)?);
    }
    if let Some(report) = reports.last() {
        drawn.push(Plot {
            name: "packing".into(),
            title: "Packing".into(),
            caption:
                "Side view along y (x to the right, z up): exact outlines of the nearest particles, darker with more \
                 contacts; particles with fewer than two contacts are yellow."
                    .into(),
            width: Width::Full,
            svg: picture,
        });
        if let Some(views) = views {
            drawn.extend(views.plots()?);
        }
        drawn.extend(roses(report)?);
        drawn.push(plots::coordination(&report.coordination)?);
        if let Some(forces) = &report.forces {
            if forces.weak_share.is_some() {
                let Forces { normal, shear, normal_logarithmic, shear_logarithmic, .. } = forces;
                drawn.push(plots::force_distribution(normal, shear)?);
                drawn.push(plots::weak_forces(normal_logarithmic, shear_logarithmic)?);
            }
            drawn.push(plots::friction(&forces.friction_used)?);
        }
    }
    drawn.extend(panels(history, walls, targets)?);
    Ok(drawn)
}

/// The page. `reports` are those of a series, in order; the numbers on top are those of the last.
pub fn page(title: &str, reports: &[Report], plots: &[Plot]) -> String {
    let mut out = String::new();
    let _ = write!(
        out,
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n",
        title = escaped(title)
    );
    if let Some(report) = reports.last() {
        head(&mut out, title, report);
        numbers(&mut out, report);
    }
    if reports.len() > 1 {
        series(&mut out, reports);
    }
    out.push_str("<section class=\"plots\">\n");
    for plot in plots {
        let class = match plot.width {
            Width::Third => " class=\"third\"",
            Width::Half => "",
            Width::Full => " class=\"wide\"",
        };
        let _ = write!(
            out,
            "<figure id=\"{}\"{class}>\n<h2>{}</h2>\n{}<figcaption>{}</figcaption>\n</figure>\n",
            plot.name,
            escaped(&plot.title),
            plot.svg,
            escaped(&plot.caption)
        );
    }
    out.push_str("</section>\n");
    if let Some(report) = reports.last() {
        let _ = writeln!(
            out,
            "<footer>dem-post {} · {} · step {} · t = {} s</footer>",
            escaped(&report.program_version),
            escaped(&report.snapshot),
            report.summary.step,
            readable(report.summary.time_s)
        );
    }
    out.push_str("</main>\n</body>\n</html>\n");
    out
}

fn head(out: &mut String, title: &str, report: &Report) {
    let place = match report.region_m {
        None => "the whole packing".to_string(),
        Some(region) => format!("region {}", sides(&region)),
    };
    let walls = if report.walls_in_fabric { "; fabric and forces with wall contacts" } else { "" };
    let _ = write!(
        out,
        "<header>\n<h1>{}</h1>\n<p>Step {} at t = {} s, {place}{walls}.</p>\n",
        escaped(title),
        report.summary.step,
        readable(report.summary.time_s)
    );
    for doubt in &report.doubts {
        let _ = writeln!(out, "<p>Warning: {}.</p>", escaped(doubt));
    }
    out.push_str("</header>\n");
}

/// Text with the sides of a box [m].
pub fn sides(bounds: &Bounds) -> String {
    let side = |k: usize| format!("{}…{}", readable(bounds.low[k]), readable(bounds.high[k]));
    format!("x {}, y {}, z {} m", side(0), side(1), side(2))
}

fn numbers(out: &mut String, report: &Report) {
    out.push_str("<section class=\"numbers\">\n");
    for group in report.groups() {
        let _ = write!(out, "<table>\n<caption>{}</caption>\n", escaped(group.title));
        for row in group.rows {
            let _ = writeln!(
                out,
                "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td></tr>",
                escaped(row.label),
                escaped(&row.value),
                escaped(&row.unit)
            );
        }
        out.push_str("</table>\n");
    }
    out.push_str("</section>\n");
}

fn series(out: &mut String, reports: &[Report]) {
    out.push_str(
        "<section class=\"series\">\n<table>\n<caption>All snapshots</caption>\n\
         <tr><th>step</th><th>time (s)</th><th>particles</th><th>p (Pa)</th><th>q / p</th>\
         <th>axial strain</th><th>volumetric strain</th><th>shear strain</th>\
         <th>solid fraction</th><th>Z</th><th>a<sub>c</sub></th><th>a<sub>n</sub></th><th>a<sub>t</sub></th>\
         <th>0.4 (a<sub>c</sub> + a<sub>n</sub> + a<sub>bn</sub> + 1.5 (a<sub>t</sub> + a<sub>bt</sub>)) / (q / p) − 1</th></tr>\n",
    );
    for report in reports {
        let s = &report.summary;
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{}</td><td>{}</td>",
            s.step,
            readable(s.time_s),
            s.particles
        );
        for value in [
            s.p_pa,
            s.q_over_p,
            s.axial_strain,
            s.volumetric_strain,
            s.shear_strain,
            s.solid_fraction,
            s.coordination,
            s.a_c,
            s.a_n,
            s.a_t,
            s.fabric_relation_error,
        ] {
            let _ = write!(out, "<td>{}</td>", value.map_or("–".to_string(), readable));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</table>\n</section>\n");
}

/// Text with the special characters of HTML replaced.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Plots are drawn in the light colours; the style sheet replaces their ink, grid and paper in the dark.
const STYLE: &str = include_str!("page.css");
