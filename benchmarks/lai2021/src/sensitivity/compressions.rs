//! Tables of triaxial tests: erosion ratio and stiffness, gravity, rate.

use super::cases::{Case, each};
use super::plot::Plot;
use super::table::{Table, general};
use super::{Files, Plan};
use crate::simulation::Signals;
use crate::triaxial::{Method, stages};
use anyhow::{Context, Result};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;

/// Axial strains of the plateau.
const PLATEAU: std::ops::RangeInclusive<f64> = 0.25..=0.36;

/// Report of a triaxial test: its states, and its curve.
pub struct Test {
    summary: Table,
    curve: Table,
}

impl Test {
    /// Test of a folder with `summary.csv` and `fig10.csv`.
    ///
    /// # Errors
    /// If the tables cannot be read.
    pub fn read(report: &Path) -> Result<Self> {
        let table = |name: &str| Table::read(&report.join(name));
        Ok(Self { summary: table("summary.csv")?, curve: table("fig10.csv")? })
    }

    /// A number of a state.
    fn at(&self, state: &str, name: &str) -> Result<f64> {
        let cells = self.summary.with("state", state)?.numbers(name)?;
        let last = cells.last().copied().flatten();
        last.with_context(|| format!("no {name} of the state {state}"))
    }

    /// Mean of a column of the curve over the plateau.
    fn on_plateau(&self, name: &str) -> Result<f64> {
        let strains = self.curve.numbers("axial_strain")?;
        let values = strains.into_iter().zip(self.curve.numbers(name)?);
        let values = values.filter(|(strain, _)| strain.is_some_and(|s| PLATEAU.contains(&s)));
        let values: Vec<f64> = values.map(|(_, value)| value.unwrap_or(0.0)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (!values.is_empty()).then_some(mean).context("not compressed to 25 %")
    }
}

const OF_STATES: &str =
    "axial_strain,volumetric_strain,p_pa,q_over_p,coordination,share_below_0_3_mean,solid_fraction";

/// Adds the states of a test and its plateau as rows.
///
/// # Errors
/// If columns are missing, or the test is not compressed to 25 %.
pub fn states(test: &Test, name: &str, table: &mut Table) -> Result<()> {
    let columns = || OF_STATES.split(',');
    let numbers = columns().map(|c| test.summary.numbers(c)).collect::<Result<Vec<_>>>()?;
    for (row, state) in test.summary.column("state")?.enumerate() {
        let cell =
            |column: &Vec<Option<f64>>| column[row].map_or_else(String::new, |x| general(x, 4));
        table.push(&format!("{name},{state}"), numbers.iter().map(cell));
    }
    let plateau =
        columns().map(|c| Ok(general(test.on_plateau(c)?, 4))).collect::<Result<Vec<_>>>()?;
    table.push(&format!("{name},plateau"), plateau);
    Ok(())
}

const AT_PEAK: [&str; 7] =
    ["axial_strain", "q_over_p", "volumetric_strain", "a_c", "a_n", "a_t", "coordination"];
const ON_PLATEAU: [&str; 4] = ["q_over_p", "volumetric_strain", "a_c", "coordination"];

/// A table of responses, without rows.
pub fn responses() -> Table {
    let peak = AT_PEAK.map(|name| format!(",peak_{name}")).concat();
    let plateau = ON_PLATEAU.map(|name| format!(",plateau_{name}")).concat();
    Table::new(&format!(
        "method,erosion_ratio,stiffness_n_per_m,seed,packing_coordination,packing_unbalanced,\
         start_solid_fraction{peak}{plateau}"
    ))
}

/// A test as a row of [`responses`]: Z after packing, solid fraction at the start, the peak, and the plateau.
///
/// # Errors
/// See [`states`].
pub fn push_response(test: &Test, name: &str, table: &mut Table) -> Result<()> {
    let mut cells = vec![
        general(test.at("packing", "coordination")?, 5),
        general(test.at("packing", "unbalanced_force_ratio")?, 3),
        general(test.at("consolidation", "solid_fraction")?, 5),
    ];
    for column in AT_PEAK {
        cells.push(general(test.at("peak", column)?, 5));
    }
    for column in ON_PLATEAU {
        cells.push(general(test.on_plateau(column)?, 5));
    }
    table.push(name, cells);
    Ok(())
}

/// The triaxial test with stiffer and softer contacts and two erosion ratios, each from its own packing.
pub(super) fn response(plan: &Plan, out: &Path, signals: &Signals) -> Result<Files> {
    let mut cases = Vec::new();
    for seed in 1..=plan.seeds {
        for stiffness in ["1.5e5", "1.5e4"] {
            let kinds = [
                (Method::CommonNormal, "0"),
                (Method::Erosion, "0.05"),
                (Method::Erosion, "0.01"),
                (Method::CheckedErosion, "0.05"),
            ];
            cases.extend(kinds.map(|(method, ratio)| Case { method, ratio, stiffness, seed }));
        }
    }
    let folder = out.join(format!("response-{}", plan.grains));
    each(plan.jobs, &cases, signals, |case| {
        let here = folder.join(case.name("_"));
        if here.join("report/machine.txt").exists() {
            return Ok(());
        }
        println!("{}", here.display());
        let test = stages::Plan {
            quick: plan.grains == 600,
            rate: Some(plan.lid()),
            seed: Some(case.seed),
            stiffness: Some(case.stiffness.into()),
            erosion_ratio: (case.ratio != "0").then(|| case.ratio.into()),
            ranks: 1,
            out: Some(here),
            aloud: false,
            ..stages::Plan::new(vec![case.method])
        };
        test.run(signals).map(|_| ())
    })?;
    let mut table = responses();
    for case in &cases {
        let report = folder.join(case.name("_")).join("report");
        push_response(&Test::read(&report)?, &case.name(","), &mut table)
            .with_context(|| report.display().to_string())?;
    }
    let values: Vec<&str> = table.names().skip(4).collect();
    let means = table.means(&["method", "erosion_ratio", "stiffness_n_per_m"], &values)?;
    Ok(vec![("response.csv".into(), table.text()), ("response_means.csv".into(), means.text())])
}

/// The quick triaxial test without and with gravity, from the same packings.
pub(super) fn gravity(plan: &Plan, out: &Path, signals: &Signals) -> Result<Files> {
    const STATES: [(&str, bool); 2] = [("off", false), ("on", true)];
    let folder = |state: &str, seed: u64| out.join("gravity").join(format!("{state}_{seed}"));
    for seed in 1..=plan.seeds {
        for (state, gravity) in STATES {
            let test = stages::Plan {
                quick: true,
                gravity,
                seed: Some(seed),
                ranks: plan.jobs,
                out: Some(folder(state, seed)),
                ..stages::Plan::new(vec![Method::CommonNormal])
            };
            test.run(signals)?;
        }
    }
    let mut table = Table::new(&format!("gravity,seed,state,{OF_STATES}"));
    for (state, _) in STATES {
        for seed in 1..=plan.seeds {
            let test = Test::read(&folder(state, seed).join("report"))?;
            states(&test, &format!("{state},{seed}"), &mut table)?;
        }
    }
    let values = ["axial_strain", "volumetric_strain", "p_pa", "q_over_p", "coordination"];
    let means = table.means(&["gravity", "state"], &values)?;
    Ok(vec![("gravity.csv".into(), table.text()), ("gravity_means.csv".into(), means.text())])
}

/// The triaxial test of 5,120 particles at the paper's rate and at ten times this rate, from one consolidated
/// packing.
pub(super) fn rate(out: &Path, signals: &Signals) -> Result<Files> {
    let folder = |rate: u32| out.join("rate").join(rate.to_string());
    let run = |rate| {
        let out = Some(folder(rate));
        let method = vec![Method::CommonNormal];
        stages::Plan { rate: Some(rate), out, ..stages::Plan::new(method) }.run(signals)
    };
    run(10)?;
    let here = folder(1).join(Method::CommonNormal.folder());
    fs::create_dir_all(&here)?;
    for stage in ["packing", "consolidation"] {
        let link = here.join(stage);
        if !link.exists() {
            symlink(format!("../../10/common-normal/{stage}"), link)?;
        }
    }
    run(1)?;
    let tests = [1, 10].map(|rate| Test::read(&folder(rate).join("report")));
    let [slow, fast] = tests;
    let (slow, fast) = (slow?, fast?);
    let mut table = Table::new(&format!("rate_mm_per_s,state,{OF_STATES}"));
    states(&slow, "1", &mut table)?;
    states(&fast, "10", &mut table)?;
    let apart = apart(&fast, &slow)?;
    let curves = curves(&[("1", &slow), ("10", &fast)])?;
    let plot =
        |y, range| Plot { x: "axial_strain", y, by: "rate_mm_per_s", range, curve: Some(0.05) };
    Ok(vec![
        ("rate.csv".into(), table.text()),
        ("rate_apart.csv".into(), apart.text()),
        ("rate_curves.csv".into(), curves.text()),
        ("rate.svg".into(), plot("q_over_p", [0.0, 1.5]).svg(&curves)?),
        ("rate_volume.svg".into(), plot("volumetric_strain", [-0.1, 0.05]).svg(&curves)?),
    ])
}

/// Strains and stress ratio of tests, by rate.
///
/// # Errors
/// If columns are missing.
pub fn curves(tests: &[(&str, &Test)]) -> Result<Table> {
    const COLUMNS: [&str; 3] = ["axial_strain", "q_over_p", "volumetric_strain"];
    let mut table = Table::new(&format!("rate_mm_per_s,{}", COLUMNS.join(",")));
    for (rate, test) in tests {
        let columns = COLUMNS.map(|name| test.curve.column(name).map(Iterator::collect::<Vec<_>>));
        let [strain, ratio, volume] = columns;
        for ((strain, ratio), volume) in strain?.into_iter().zip(ratio?).zip(volume?) {
            table.push(rate, [strain, ratio, volume].map(str::to_owned));
        }
    }
    Ok(table)
}

/// Difference of the curves of two tests: root mean square at the strains of the first, by linear interpolation in
/// the second. It is also given over the largest value (q/p) or the range (volumetric strain) of the second.
///
/// # Errors
/// If columns are missing, or a cell has no number.
pub fn apart(one: &Test, other: &Test) -> Result<Table> {
    let mut table = Table::new("curve,rms_difference,share");
    for (name, from_zero) in [("q_over_p", true), ("volumetric_strain", false)] {
        let points = |test: &Test| -> Result<Vec<(f64, f64)>> {
            let strains = test.curve.numbers("axial_strain")?;
            let points = strains.into_iter().zip(test.curve.numbers(name)?);
            let points = points.map(|(strain, value)| strain.zip(value)).collect::<Option<_>>();
            points.with_context(|| format!("{name}: a cell without a number"))
        };
        let (one, other) = (points(one)?, points(other)?);
        let (first, last) = other.first().zip(other.last()).context("a curve without points")?;
        let values = || other.iter().map(|point| point.1);
        let low = values().fold(if from_zero { 0.0 } else { first.1 }, f64::min);
        let high = values().fold(first.1, f64::max);
        let squares: Vec<f64> = one
            .iter()
            .filter(|(strain, _)| (first.0..=last.0).contains(strain))
            .map(|&(strain, value)| {
                let next = other.partition_point(|point| point.0 < strain);
                let next = next.clamp(1, other.len() - 1);
                let ((x0, y0), (x1, y1)) = (other[next - 1], other[next]);
                (value - (y0 + (y1 - y0) * (strain - x0) / (x1 - x0))).powi(2)
            })
            .collect();
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        table.push(name, [general(rms, 4), general(rms / (high - low), 4)]);
    }
    Ok(table)
}
