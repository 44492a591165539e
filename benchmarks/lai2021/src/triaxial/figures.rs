//! Figures 10 to 14 as drawings, and all figures as tables.

use super::run::{Pick, Run};
use dem_mpi::post::coordination::CoordinationNumbers;
use dem_mpi::post::draw::{Mark, PlotError, Series, grid, linear, panel, rule, span};
use dem_mpi::post::fabric::Rose;
use dem_mpi::post::forces::{Forces, Histogram};
use dem_mpi::post::plots::{Named, bars, densities, shares_per_decade};
use dem_mpi::post::report::{Report, Summary, csv};
use dem_mpi::post::rose::rose_rows;
use serde::Serialize;

/// Size of one of two panels [px].
const PANEL: (u32, u32) = (560, 360);

/// Selects a state of a run.
type State = fn(&Run) -> Option<&Report>;
const PACKING: State = |run| run.packing.as_ref();
const PEAK: State = |run| run.peak();

/// Figures 10 to 14 as far as there are data: names of their files and the drawings.
///
/// # Errors
/// See [`PlotError`].
pub fn all(runs: &[Run]) -> Result<Vec<(&'static str, String)>, PlotError> {
    let has = |state: State| runs.iter().any(|run| state(run).is_some());
    let mut figures = Vec::new();
    if runs.iter().any(|run| !run.shear.is_empty()) {
        figures.push(("fig10.svg", response(runs)?));
    }
    if has(PACKING) || has(PEAK) {
        figures.push(("fig11.svg", coordination(runs)?));
    }
    if has(PACKING) {
        figures.push(("fig12.svg", roses(runs, PACKING)?));
        figures.push(("fig13.svg", forces(runs)?));
    }
    if has(PEAK) {
        figures.push(("fig14.svg", roses(runs, PEAK)?));
    }
    Ok(figures)
}

/// Fig. 10: stress ratio and volumetric strain over axial strain.
fn response(runs: &[Run]) -> Result<String, PlotError> {
    let shown: [(&str, &str, Pick); 2] = [
        ("(a) deviatoric stress ratio", "q / p", |s| s.q_over_p),
        ("(b) volumetric strain", "volumetric strain (%)", |s| {
            s.volumetric_strain.map(|e| 100.0 * e)
        }),
    ];
    grid(2, PANEL, &shown.map(|(title, _, _)| title.to_string()), |k, canvas| {
        let (_, y_label, pick) = shown[k];
        let curve = |run: &Run| Series {
            name: run.method.name().into(),
            colour: run.method.colour(),
            mark: Mark::Line,
            points: run.curve(pick).into_iter().map(|(e, value)| (100.0 * e, value)).collect(),
        };
        let curves: Vec<Series> = runs.iter().map(curve).filter(|c| !c.points.is_empty()).collect();
        let points = || curves.iter().flat_map(|c| &c.points);
        let (x, y) = (span(points().map(|p| p.0)), span(points().map(|p| p.1)));
        panel(canvas, &linear("axial strain (%)", y_label, x, y), &curves)
    })
}

/// Fig. 11: particles by number of contacts; lines are means.
fn coordination(runs: &[Run]) -> Result<String, PlotError> {
    let states: [(&str, State); 2] =
        [("(a) after random packing", PACKING), ("(b) at peak q / p", PEAK)];
    grid(2, PANEL, &states.map(|(title, _)| title.to_string()), |k, canvas| {
        let state = states[k].1;
        let numbers = |run| Some(&state(run)?.coordination.without_walls);
        let counted: Vec<_> = runs
            .iter()
            .filter_map(|run| Some((run.method.name(), run.method.colour(), numbers(run)?)))
            .collect();
        let (axes, mut series) = bars(&counted);
        let means = counted.iter().filter_map(|(_, colour, n)| Some(rule(*colour, n.mean()?)));
        series.extend(means);
        for (series, (name, _, numbers)) in series.iter_mut().zip(&counted) {
            let mean = numbers.mean().map_or(String::new(), |mean| format!(", mean {mean:.2}"));
            series.name = format!("{name}{mean}");
        }
        panel(canvas, &axes, &series)
    })
}

/// Figs. 12 and 14: a row for each method.
fn roses(runs: &[Run], state: State) -> Result<String, PlotError> {
    let rows = runs.iter().filter_map(|run| Some((run.method.name(), state(run)?)));
    rose_rows(&rows.collect::<Vec<_>>())
}

/// Fig. 13: normal and shear forces after random packing, by force and by decade.
fn forces(runs: &[Run]) -> Result<String, PlotError> {
    type Of = fn(&Forces) -> &Histogram;
    let shown: [(&str, Of); 4] = [
        ("(a) contact normal forces", |f| &f.normal),
        ("(b) contact shear forces", |f| &f.shear),
        ("(c) normal forces by decade", |f| &f.normal_logarithmic),
        ("(d) shear forces by decade", |f| &f.shear_logarithmic),
    ];
    grid(2, PANEL, &shown.map(|(title, _)| title.to_string()), |k, canvas| {
        let of_run = |run| PACKING(run)?.forces.as_ref().map(shown[k].1);
        let histograms: Vec<Named> = runs
            .iter()
            .filter_map(|run| Some((run.method.name(), run.method.colour(), of_run(run)?)))
            .collect();
        let draw = if k < 2 { densities } else { shares_per_decade };
        let (axes, series) = draw(&histograms, Mark::Line);
        panel(canvas, &axes, &series)
    })
}

#[derive(Clone, Copy, Serialize)]
struct Of {
    method: &'static str,
    state: &'static str,
}

#[derive(Serialize)]
struct Numbers {
    contacts: usize,
    particles: u64,
    share: f64,
    share_with_walls: f64,
}

#[derive(Serialize)]
struct Direction {
    angle_to_vertical_deg: f64,
    density_over_isotropic: Option<f64>,
    normal_force_n: Option<f64>,
    shear_force_n: Option<f64>,
}

#[derive(Serialize)]
struct Bin {
    force: &'static str,
    bins: &'static str,
    force_over_mean: f64,
    density: f64,
}

/// All tables: names of their files and CSV.
///
/// # Errors
/// No error is known.
pub fn tables(runs: &[Run]) -> Result<Vec<(&'static str, String)>, csv::Error> {
    let states = || {
        runs.iter().flat_map(|run| {
            let of = |state| Of { method: run.method.name(), state };
            run.states().map(move |(state, report)| (of(state), report))
        })
    };
    let shear = runs.iter().flat_map(|run| {
        let of = || Of { method: run.method.name(), state: "shear" };
        run.shear.iter().map(move |report| (of(), &report.summary))
    });
    let in_state = |wanted: &'static str| states().filter(move |(of, _)| of.state == wanted);
    let rows = in_state("packing").chain(in_state("peak"));
    let fig11 = rows.flat_map(|(of, report)| {
        let c = &report.coordination;
        coordination_rows(&c.without_walls, &c.with_walls).map(move |row| (of, row))
    });
    let roses =
        |wanted| in_state(wanted).flat_map(|(of, r)| rose(&r.rose).map(move |row| (of, row)));
    let rows = in_state("packing").chain(in_state("peak"));
    let fig13 = rows.flat_map(|(of, report)| {
        let forces = report.forces.iter().flat_map(force_rows);
        forces.map(move |row| (of, row)).collect::<Vec<_>>()
    });
    Ok(vec![
        ("summary.csv", csv(states().map(|(of, report)| (of, &report.summary)))?),
        ("fig10.csv", csv(shear.collect::<Vec<(Of, &Summary)>>())?),
        ("fig11.csv", csv(fig11)?),
        ("fig12.csv", csv(roses("packing"))?),
        ("fig13.csv", csv(fig13)?),
        ("fig14.csv", csv(roses("peak"))?),
    ])
}

fn coordination_rows<'a>(
    pairs: &'a CoordinationNumbers,
    all: &'a CoordinationNumbers,
) -> impl Iterator<Item = Numbers> + 'a {
    let share = |of: &CoordinationNumbers, k| of.shares().nth(k).unwrap_or(0.0);
    (0..pairs.histogram.len().max(all.histogram.len())).map(move |contacts| Numbers {
        contacts,
        particles: pairs.having(contacts),
        share: share(pairs, contacts),
        share_with_walls: share(all, contacts),
    })
}

fn rose(rose: &Rose) -> impl Iterator<Item = Direction> + '_ {
    (0..Rose::BINS).map(|k| Direction {
        angle_to_vertical_deg: ((k as f64 + 0.5) * Rose::STEP).to_degrees(),
        density_over_isotropic: rose.density[k],
        normal_force_n: rose.normal_force[k],
        shear_force_n: rose.shear_force[k],
    })
}

fn force_rows(forces: &Forces) -> impl Iterator<Item = Bin> + '_ {
    let histograms = [
        ("normal", "linear", &forces.normal),
        ("normal", "logarithmic", &forces.normal_logarithmic),
        ("shear", "linear", &forces.shear),
        ("shear", "logarithmic", &forces.shear_logarithmic),
    ];
    histograms.into_iter().flat_map(|(force, bins, histogram)| {
        histogram.density().map(move |(force_over_mean, density)| Bin {
            force,
            bins,
            force_over_mean,
            density,
        })
    })
}
