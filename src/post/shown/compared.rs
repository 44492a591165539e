//! The page of a comparison: a plot for each quantity of several runs, with a curve for each run.

use super::draw::{BLUE, GREEN, INK, ORANGE, PURPLE, PlotError, VERMILION};
use super::page::{Section, command, document, figures, listed, table};
use super::panels::{Quantity, quantities, tell_apart};
use super::plots::{ALONG, OVER_A_SERIES, Plot, SeriesPlot, Width, of_snapshots};
use crate::output::header::WallRow;
use crate::post::compare::{CompareError, Comparison, Run};
use crate::post::history::{Curve, History};
use crate::post::region::ACROSS;
use crate::post::report::{Report, readable};
use plotters::style::{RGBColor, WHITE};

/// Values by time [s], or by strain.
type Points = Vec<(f64, f64)>;

/// Colours of runs that do not continue each other, in order.
const COLOURS: [RGBColor; 6] = [BLUE, ORANGE, VERMILION, GREEN, PURPLE, INK];

/// Plots of a snapshot's numbers beyond those of a series.
const MORE: [SeriesPlot; 5] = [
    ("void_ratio", "Void ratio", "void ratio", &[("", |s| s.void_ratio)]),
    (
        "stress_on_walls",
        "Stress on walls",
        "stress (Pa)",
        &[
            ("xx", |s| s.wall_stress_xx_pa),
            ("yy", |s| s.wall_stress_yy_pa),
            ("zz", |s| s.wall_stress_zz_pa),
        ],
    ),
    ("wall_shear", "τ / σ on walls that slide", "τ / σ", &[("", |s| s.wall_shear_over_normal)]),
    ("inertial_number", "Inertial number", "inertial number", &[("", |s| s.inertial_number)]),
    (
        "unbalanced_force",
        "Unbalanced force",
        "resultant / contact force",
        &[("", |s| s.unbalanced_force_ratio)],
    ),
];

/// Plots in sections: history against strain, snapshots, history against time.
///
/// # Errors
/// If no quantity can be compared, or a plot cannot be drawn.
pub fn sections(all: &Comparison) -> Result<Vec<Section>, CompareError> {
    let colours = colours(all);
    let histories: Vec<History> = (0..all.runs.len()).map(|k| all.joined(k)).collect();
    let common = common(all, &histories)?;
    let from_zero = (0..all.runs.len()).all(|k| all.begin(k) == 0.0);
    let time = if from_zero { "time (s)" } else { "time since the first stage began (s)" };
    let elapsed = |k: usize, points: &Points| -> Points {
        points.iter().map(|&(time, value)| (time - all.begin(k), value)).collect()
    };
    let mut over_time = drawn(all, &common, &colours, time, elapsed)?;
    let mut over_strain = Vec::new();
    if let Some((label, strains)) = strains(all, &histories) {
        let is_state = |quantity: &Quantity| {
            quantity.y_label.ends_with("(Pa)")
                || ["coordination", "solid_fraction"].contains(&&*quantity.name)
        };
        let of_state: Vec<_> = common.into_iter().filter(|(first, _)| is_state(first)).collect();
        let by_strain = |k: usize, points: &Points| by_strain(points, &strains[k]);
        over_strain = drawn(all, &of_state, &colours, &label, by_strain)?;
        for plot in &mut over_strain {
            plot.name = plot.name.replacen("history_", "strain_", 1);
        }
    }
    let snapshots = over_snapshots(all, &colours, time)?;
    for plots in [&mut over_time, &mut over_strain] {
        tell_apart(plots);
    }
    if over_time.is_empty() && over_strain.is_empty() && snapshots.is_empty() {
        return Err(CompareError::NothingInCommon);
    }
    Ok(vec![
        Section { title: "History against strain", plots: over_strain },
        Section { title: "Snapshots", plots: snapshots },
        Section { title: "History", plots: over_time },
    ])
}

/// Colour of each run. A run has another shade of the colour of the run that it continues; where several continue one run, only
/// the first has.
fn colours(all: &Comparison) -> Vec<RGBColor> {
    let mut order: Vec<usize> = (0..all.runs.len()).collect();
    order.sort_by_key(|&k| all.stages(k).len());
    let mut of: Vec<Option<(usize, usize)>> = vec![None; all.runs.len()];
    let (mut families, mut continued) = (0, Vec::new());
    for k in order {
        let before = all.runs[k].before.filter(|before| !continued.contains(before));
        continued.extend(before);
        of[k] = before.and_then(|before| of[before]).map(|(family, shade)| (family, shade + 1));
        if of[k].is_none() {
            of[k] = Some((families, families / COLOURS.len()));
            families += 1;
        }
    }
    let shade = |(family, shade): (usize, usize)| {
        let colour = COLOURS[family % COLOURS.len()];
        match shade % 3 {
            0 => colour,
            1 => mixed(colour, WHITE),
            _ => mixed(colour, INK),
        }
    };
    of.into_iter().flatten().map(shade).collect()
}

/// A colour with some of another.
fn mixed(colour: RGBColor, with: RGBColor) -> RGBColor {
    let mix = |a: u8, b: u8| ((3 * u16::from(a) + 2 * u16::from(b)) / 5) as u8;
    RGBColor(mix(colour.0, with.0), mix(colour.1, with.1), mix(colour.2, with.2))
}

/// A quantity with its own rows in each run that has it.
type Common = (Quantity, Vec<(usize, Points)>);

/// Quantities of the histories of several runs.
fn common(all: &Comparison, histories: &[History]) -> Result<Vec<Common>, CompareError> {
    let mut found: Vec<Common> = Vec::new();
    for (k, (run, history)) in all.runs.iter().zip(histories).enumerate() {
        let begin = run.header.stage_begin.1;
        for quantity in quantities(history, &run.header.walls) {
            let own: Points = quantity.points.iter().copied().filter(|p| p.0 >= begin).collect();
            match found.iter_mut().find(|(first, _)| first.is_like(&quantity)) {
                Some((first, runs)) => {
                    first.is_logarithmic &= quantity.is_logarithmic;
                    runs.push((k, own));
                }
                None => found.push((quantity, vec![(k, own)])),
            }
        }
    }
    for (place, (first, runs)) in found.iter().enumerate() {
        let is_other = |(second, others): &&Common| {
            second.title == first.title
                && others.iter().all(|(k, _)| runs.iter().all(|r| r.0 != *k))
        };
        if let Some((second, others)) = found[place + 1..].iter().find(is_other) {
            let name = |runs: &[(usize, Points)]| all.runs[runs[0].0].name.clone();
            return Err(CompareError::OtherUnit {
                quantity: first.title.clone(),
                first: first.y_label.clone(),
                of_first: name(runs),
                second: second.y_label.clone(),
                of_second: name(others),
            });
        }
    }
    found.retain(|(_, runs)| runs.len() > 1);
    Ok(found)
}

/// Plots of quantities; `on_axis` gives the points of a run on the horizontal axis.
fn drawn(
    all: &Comparison,
    common: &[Common],
    colours: &[RGBColor],
    x_label: &str,
    on_axis: impl Fn(usize, &Points) -> Points,
) -> Result<Vec<Plot>, PlotError> {
    let one = |(quantity, runs): &Common| {
        let curve = |&(k, ref points): &(usize, Points)| {
            (Curve { name: all.runs[k].name.clone(), points: on_axis(k, points) }, colours[k])
        };
        let curves = runs.iter().map(curve).filter(|(curve, _)| !curve.points.is_empty());
        let (curves, colours): (Vec<_>, Vec<_>) = curves.unzip();
        if curves.len() < 2 {
            return Ok(None);
        }
        quantity.drawn(&curves, &colours, x_label)
    };
    common.iter().filter_map(|quantity| one(quantity).transpose()).collect()
}

/// Label and values by time of the strain of each run: of the component of a cell, or between walls across z, that changes most.
/// `None` unless two runs have it.
fn strains(all: &Comparison, histories: &[History]) -> Option<(String, Vec<Points>)> {
    let of_run = |(run, history): (&Run, &History)| {
        let of_cell = history.curves.iter().filter_map(|Curve { name, points }| {
            let rest = name.strip_prefix("strain")?;
            let is_cell = rest.is_empty() || (rest.len() == 3 && rest.starts_with('_'));
            is_cell.then(|| (name.replace('_', " "), points.clone()))
        });
        of_cell.chain(of_walls(history, &run.header.walls)).collect::<Vec<_>>()
    };
    let by_run: Vec<Vec<(String, Points)>> = all.runs.iter().zip(histories).map(of_run).collect();
    let of = |name: &str| -> Vec<Points> {
        let points = |strains: &Vec<(String, Points)>| {
            strains.iter().find(|(own, _)| own == name).map_or_else(Vec::new, |s| s.1.clone())
        };
        by_run.iter().map(points).collect()
    };
    let range = |points: &Points| {
        let values = points.iter().map(|point| point.1);
        let ends = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = values.fold(ends, |(low, high), v| (low.min(v), high.max(v)));
        if high > low { high - low } else { 0.0 }
    };
    let names = by_run.iter().flatten().map(|(name, _)| (name.clone(), of(name)));
    let changing = |all: &[Points]| all.iter().filter(|points| range(points) > 1e-9).count();
    let names = names.filter(|(_, all)| changing(all) > 1);
    let total = |all: &[Points]| all.iter().map(range).sum::<f64>();
    names.max_by(|a, b| total(&a.1).total_cmp(&total(&b.1)))
}

/// Strain `ln(H0/H)` between two walls across z.
fn of_walls(history: &History, walls: &[WallRow]) -> Option<(String, Points)> {
    let at = |sign: f64| {
        let mut all = walls.iter().filter(|w| w.is_one_plane() && sign * w.normal.z > ACROSS);
        let wall = all.next().filter(|_| all.next().is_none())?;
        history.curve(&format!("place_{}_m", wall.name))
    };
    let (low, high) = (at(1.0)?, at(-1.0)?);
    let heights = low.points.iter().zip(&high.points).map(|(low, high)| (low.0, high.1 - low.1));
    let heights: Points = heights.filter(|(_, height)| *height > 0.0).collect();
    let (_, first) = *heights.first()?;
    let strain = heights.iter().map(|&(time, height)| (time, (first / height).ln()));
    Some(("axial strain".to_owned(), strain.collect()))
}

/// The values at times at which the strain is known, by the strain.
fn by_strain(points: &Points, strain: &Points) -> Points {
    let at = |time: f64| strain.binary_search_by(|point| point.0.total_cmp(&time)).ok();
    points.iter().filter_map(|&(time, value)| Some((strain[at(time)?].1, value))).collect()
}

/// Plots of the numbers of snapshots, along the first axis that two runs have.
fn over_snapshots(
    all: &Comparison,
    colours: &[RGBColor],
    time: &str,
) -> Result<Vec<Plot>, PlotError> {
    let fitting = |along: &&super::plots::Along| {
        all.runs.iter().filter(|run| along.fits(&run.reports)).count() > 1
    };
    let Some(along) = ALONG.iter().find(fitting) else { return Ok(Vec::new()) };
    let is_time = along.words == "time";
    let label = if is_time { time } else { along.label };
    let mut plots = Vec::new();
    for (name, title, y_label, picks) in OVER_A_SERIES.iter().chain(&MORE) {
        for (curve, pick) in *picks {
            let of_run = |(k, run): (usize, &Run)| {
                let begin = if is_time { all.begin(k) } else { 0.0 };
                let rows = run.reports.iter().map(|report| &report.summary);
                let points = rows.filter_map(|s| Some(((along.x)(s)? - begin, pick(s)?)));
                (run.name.clone(), colours[k], points.collect::<Points>())
            };
            let runs = all.runs.iter().enumerate().filter(|(_, run)| along.fits(&run.reports));
            let mut curves: Vec<_> = runs.map(of_run).collect();
            curves.retain(|(.., points)| !points.is_empty());
            if curves.len() < 2 || curves.iter().all(|(.., points)| points.len() < 2) {
                continue;
            }
            let [of_name, of_title] = match *curve {
                "" => [String::new(), String::new()],
                curve => [format!("_{curve}"), format!(": {curve}")],
            };
            let title = format!("{title}{of_title}");
            plots.extend(of_snapshots(label, y_label, curves)?.map(|svg| Plot {
                name: format!("{name}{of_name}"),
                caption: format!("{title} of each snapshot against {}.", along.words),
                title,
                width: Width::Half,
                svg,
            }));
        }
    }
    Ok(plots)
}

/// The page: the runs, differences of their scenes, plots, and the last values of each run.
pub fn html(all: &Comparison, sections: &[Section], line: &str) -> String {
    let names: Vec<String> = all.runs.iter().map(|run| run.name.clone()).collect();
    let named = |first: &str| -> Vec<String> {
        [first.to_owned()].into_iter().chain(names.iter().cloned()).collect()
    };
    let plots = sections.iter().map(|section| (section.title, figures(&section.plots)));
    let scenes = table(&named("key"), &all.differences());
    let parts: Vec<(&str, String)> = [
        ("Runs", runs(all)),
        ("Warnings", listed(&all.notes)),
        ("Differences of the scenes", scenes),
    ]
    .into_iter()
    .chain(plots)
    .chain([("Last values", table(&named("quantity"), &last_values(all)))])
    .filter(|(_, content)| !content.is_empty())
    .collect();
    let plots: Vec<&Plot> = sections.iter().flat_map(|section| &section.plots).collect();
    let title = format!("Comparison of {}", names.join(", "));
    let version = concat!("dem-post ", env!("CARGO_PKG_VERSION"));
    document(&title, &command(line), &parts, &plots, Some(version))
}

/// Table of the runs, with their times and origins.
fn runs(all: &Comparison) -> String {
    let names =
        ["run", "title", "continues", "from step", "to step", "from (s)", "to (s)", "folder"];
    let row = |run: &Run| {
        let header = &run.header;
        let before = run.before.map_or("–", |before| &all.runs[before].name);
        let (first, begin) = header.stage_begin;
        vec![
            run.name.clone(),
            header.title().unwrap_or_default(),
            before.to_owned(),
            first.to_string(),
            header.step.to_string(),
            readable(begin),
            readable(header.time),
            run.folder.display().to_string(),
        ]
    };
    let rows: Vec<_> = all.runs.iter().map(row).collect();
    table(&names.map(str::to_owned), &rows)
}

/// Values of the last snapshot of each run, then of the last row of its history.
fn last_values(all: &Comparison) -> Vec<Vec<String>> {
    let mut rows: Vec<(String, Vec<String>)> = Vec::new();
    let mut put = |label: String, k: usize, cell: String| {
        let place = rows.iter().position(|(known, _)| *known == label).unwrap_or(rows.len());
        if place == rows.len() {
            rows.push((label, vec!["–".to_owned(); all.runs.len()]));
        }
        rows[place].1[k] = cell;
    };
    for (k, run) in all.runs.iter().enumerate() {
        let groups = run.reports.last().map(Report::groups).unwrap_or_default();
        for row in groups.into_iter().flat_map(|group| group.rows) {
            put(row.label, k, format!("{} {}", row.value, row.unit).trim_end().to_owned());
        }
    }
    for (k, run) in all.runs.iter().enumerate() {
        for Curve { name, points } in &run.history.curves {
            let last = points.last().map_or_else(String::new, |point| readable(point.1));
            put(format!("history.csv: {name}"), k, last);
        }
    }
    rows.into_iter().map(|(label, cells)| [vec![label], cells].concat()).collect()
}
