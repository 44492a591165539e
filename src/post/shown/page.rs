//! One HTML page with the numbers and the plots of a post-processing. It is self-contained (plots and style inside, no
//! scripts), and follows the reader's light or dark setting.

use super::draw::PlotError;
use super::panels::panels;
use super::plots::{self, Pick, Plot, Width};
use super::rose::roses;
use super::views::Views;
use crate::drive::servo::Target;
use crate::output::header::WallRow;
use crate::post::forces::Forces;
use crate::post::history::History;
use crate::post::region::Bounds;
use crate::post::report::{Group, Report, readable};
use std::fmt::Write;

/// Plots under a common heading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// Heading of the section.
    pub title: &'static str,
    /// Plots of the section.
    pub plots: Vec<Plot>,
}

/// Plots of a series in sections: plots over the series, plots and views of its last snapshot, and the history of the run with
/// these walls and targets of their stresses. `earlier` is a picture of several snapshots.
///
/// # Errors
/// See [`PlotError`].
pub fn sections(
    reports: &[Report],
    earlier: Option<String>,
    picture: String,
    views: Option<&Views>,
    history: &History,
    walls: &[WallRow],
    targets: &[Target],
) -> Result<Vec<Section>, PlotError> {
    let mut over_time = Vec::new();
    if reports.len() > 1 {
        over_time.extend(earlier.map(|svg| Plot {
            name: "snapshots".into(),
            title: "First, middle and last snapshot".into(),
            caption: "Side views along y at one scale.".into(),
            width: Width::Full,
            svg,
        }));
        over_time.extend(plots::series(reports)?);
    }
    let of_last = reports.last().map(|report| of_snapshot(report, picture, views)).transpose()?;
    Ok(vec![
        Section { title: "Series", plots: over_time },
        Section { title: "Last snapshot", plots: of_last.unwrap_or_default() },
        Section { title: "History of the run", plots: panels(history, walls, targets)? },
    ])
}

fn of_snapshot(
    report: &Report,
    picture: String,
    views: Option<&Views>,
) -> Result<Vec<Plot>, PlotError> {
    let mut drawn = vec![Plot {
        name: "packing".into(),
        title: "Packing".into(),
        caption:
            "Side view along y (x to the right, z up): exact outlines of the nearest particles, darker with more \
             contacts; particles with fewer than two contacts are yellow. Grey lines are walls."
                .into(),
        width: Width::Full,
        svg: picture,
    }];
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
    Ok(drawn)
}

/// Contents of a page.
#[derive(Clone, Copy, Debug)]
pub struct Page<'a> {
    /// Title of the scene.
    pub title: &'a str,
    /// Command that makes the page.
    pub command: &'a str,
    /// Warnings of the run and of this program.
    pub warnings: &'a [String],
    /// Reports of a series, in order.
    pub reports: &'a [Report],
    /// Plots of the requested measures.
    pub requested: &'a [Plot],
    /// All other plots.
    pub sections: &'a [Section],
}

impl<'a> Page<'a> {
    /// All plots, in the order of the page.
    pub fn plots(&self) -> impl Iterator<Item = &'a Plot> {
        self.requested.iter().chain(self.sections.iter().flat_map(|section| &section.plots))
    }

    /// The page: results of the requested measures, then plots, then tables. Sections without content are left out.
    pub fn html(&self) -> String {
        let parts: Vec<(&str, String)> =
            [("Results", self.results()), ("Warnings", listed(self.warnings))]
                .into_iter()
                .chain(self.sections.iter().map(|section| (section.title, figures(&section.plots))))
                .chain([("Numbers", self.numbers()), ("All snapshots", series(self.reports))])
                .filter(|(_, content)| !content.is_empty())
                .collect();
        let plots: Vec<&Plot> = self.plots().collect();
        let footer = self.reports.last().map(|report| {
            let (version, file) = (&report.program_version, &report.snapshot);
            format!("dem-post {version} · {file}")
        });
        document(self.title, &self.head(), &parts, &plots, footer.as_deref())
    }

    /// Lines below the title.
    fn head(&self) -> String {
        let mut out = String::new();
        if let Some(report) = self.reports.last() {
            let place = match report.region_m {
                None => "the whole packing".to_string(),
                Some(region) => format!("region {}", sides(&region)),
            };
            let walls =
                if report.walls_in_fabric { "; fabric and forces with wall contacts" } else { "" };
            let (step, time) = (report.summary.step, readable(report.summary.time_s));
            let _ = writeln!(out, "<p>Step {step} at t = {time} s, {place}{walls}.</p>");
        }
        out + &command(self.command)
    }

    /// Numbers, notes and plots of the requested measures.
    fn results(&self) -> String {
        let mut out = String::new();
        if let Some(Report { measured, .. }) = self.reports.last() {
            tables(&measured.groups(), &mut out);
            for note in &measured.notes {
                let _ = writeln!(out, "<p>{}.</p>", escaped(note));
            }
        }
        out + &figures(self.requested)
    }

    /// Tables of the last snapshot, below doubts about them.
    fn numbers(&self) -> String {
        let mut out = String::new();
        if let Some(report) = self.reports.last() {
            for doubt in &report.doubts {
                let _ = writeln!(out, "<p>Warning: {}.</p>", escaped(doubt));
            }
            tables(&report.groups(), &mut out);
        }
        out
    }
}

/// A page of sections, with links to them and, folded up, to the plots. `head` stands below the title.
pub(super) fn document(
    title: &str,
    head: &str,
    parts: &[(&str, String)],
    plots: &[&Plot],
    footer: Option<&str>,
) -> String {
    let title = escaped(title);
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<main>\n\
         <header>\n<h1>{title}</h1>\n{head}</header>\n<nav>\n",
    );
    for (title, _) in parts {
        let _ = writeln!(out, "<a href=\"#{}\">{title}</a>", anchor(title));
    }
    let _ = writeln!(out, "<details><summary>{} plots</summary>", plots.len());
    for Plot { name, title, .. } in plots {
        let _ = writeln!(out, "<a href=\"#{name}\">{}</a>", escaped(title));
    }
    out.push_str("</details>\n</nav>\n");
    for (title, content) in parts {
        let id = anchor(title);
        let _ = write!(out, "<section id=\"{id}\">\n<h2>{title}</h2>\n{content}</section>\n");
    }
    if let Some(footer) = footer {
        let _ = writeln!(out, "<footer>{}</footer>", escaped(footer));
    }
    out + "</main>\n</body>\n</html>\n"
}

/// The command that makes a page.
pub(super) fn command(line: &str) -> String {
    format!("<p><code>{}</code></p>\n", escaped(line))
}

/// List of texts; empty without any.
pub(super) fn listed(texts: &[String]) -> String {
    let items = texts.iter().map(|text| format!("<li>{}</li>\n", escaped(text)));
    let items: String = items.collect();
    if items.is_empty() { items } else { format!("<ul>\n{items}</ul>\n") }
}

/// Table with a row of names; the first cell of each row is its name. Empty without rows.
pub(super) fn table(names: &[String], rows: &[Vec<String>]) -> String {
    let mut out = String::new();
    if rows.is_empty() {
        return out;
    }
    let head = names.iter().map(|name| format!("<th>{}</th>", escaped(name)));
    let head: String = head.collect();
    let _ = write!(out, "<div class=\"series\">\n<table>\n<tr>{head}</tr>\n");
    for row in rows {
        let cells = row.iter().enumerate().map(|(k, cell)| {
            let (begin, end) = if k == 0 { ("th scope=\"row\"", "th") } else { ("td", "td") };
            format!("<{begin}>{}</{end}>", escaped(cell))
        });
        let _ = writeln!(out, "<tr>{}</tr>", cells.collect::<String>());
    }
    out + "</table>\n</div>\n"
}

/// Text with the sides of a box [m].
pub fn sides(bounds: &Bounds) -> String {
    let side = |k: usize| format!("{}…{}", readable(bounds.low[k]), readable(bounds.high[k]));
    format!("x {}, y {}, z {} m", side(0), side(1), side(2))
}

/// Name of a section in links.
fn anchor(title: &str) -> String {
    format!("section-{}", title.to_lowercase().replace(' ', "-"))
}

/// Plots beside each other; empty without plots.
pub(super) fn figures(plots: &[Plot]) -> String {
    let mut out = String::new();
    if plots.is_empty() {
        return out;
    }
    out.push_str("<div class=\"plots\">\n");
    for plot in plots {
        let class = match plot.width {
            Width::Third => " class=\"third\"",
            Width::Half => "",
            Width::Full => " class=\"wide\"",
        };
        let (title, caption) = (escaped(&plot.title), escaped(&plot.caption));
        let _ = write!(
            out,
            "<figure id=\"{}\"{class}>\n<h3>{title}</h3>\n{}<figcaption>{caption}</figcaption>\n</figure>\n",
            plot.name, plot.svg,
        );
    }
    out.push_str("</div>\n");
    out
}

fn tables(groups: &[Group], out: &mut String) {
    if groups.is_empty() {
        return;
    }
    out.push_str("<div class=\"numbers\">\n");
    for group in groups {
        let _ = write!(out, "<table>\n<caption>{}</caption>\n", escaped(&group.title));
        for row in &group.rows {
            let [label, value, unit] =
                [&row.label, &row.value, &row.unit].map(|text| escaped(text));
            let _ = writeln!(
                out,
                "<tr><th scope=\"row\">{label}</th><td>{value}</td><td>{unit}</td></tr>"
            );
        }
        out.push_str("</table>\n");
    }
    out.push_str("</div>\n");
}

/// Columns of the table of a series.
const COLUMNS: [(&str, Pick); 11] = [
    ("p (Pa)", |s| s.p_pa),
    ("q / p", |s| s.q_over_p),
    ("axial strain", |s| s.axial_strain),
    ("volumetric strain", |s| s.volumetric_strain),
    ("shear strain", |s| s.shear_strain),
    ("solid fraction", |s| s.solid_fraction),
    ("Z", |s| s.coordination),
    ("a<sub>c</sub>", |s| s.a_c),
    ("a<sub>n</sub>", |s| s.a_n),
    ("a<sub>t</sub>", |s| s.a_t),
    (
        "0.4 (a<sub>c</sub> + a<sub>n</sub> + a<sub>bn</sub> + 1.5 (a<sub>t</sub> + a<sub>bt</sub>)) / (q / p) − 1",
        |s| s.fabric_relation_error,
    ),
];

/// Table of a series, without columns that have no value; empty for a single snapshot.
fn series(reports: &[Report]) -> String {
    let mut out = String::new();
    if reports.len() < 2 {
        return out;
    }
    let has_values =
        |(_, of): &&(_, Pick)| reports.iter().any(|report| of(&report.summary).is_some());
    let columns: Vec<_> = COLUMNS.iter().filter(has_values).collect();
    out.push_str(
        "<div class=\"series\">\n<table>\n<tr><th>step</th><th>time (s)</th><th>particles</th>",
    );
    for (name, _) in &columns {
        let _ = write!(out, "<th>{name}</th>");
    }
    out.push_str("</tr>\n");
    for report in reports {
        let s = &report.summary;
        let (step, time, particles) = (s.step, readable(s.time_s), s.particles);
        let _ = write!(out, "<tr><td>{step}</td><td>{time}</td><td>{particles}</td>");
        for (_, of) in &columns {
            let _ = write!(out, "<td>{}</td>", of(s).map_or("–".to_string(), readable));
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</table>\n</div>\n");
    out
}

/// Text with the special characters of HTML replaced.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Plots are drawn in the light colours; the style sheet replaces their ink, grid and paper in the dark.
const STYLE: &str = include_str!("page.css");
