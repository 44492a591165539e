//! Error against run time of whole simulations: cost and gain of a smaller step, another contact method, softer particles or
//! another skin.
//!
//! ```text
//! cargo bench --bench work_precision                       prints; table, plots and advice go to target/
//! cargo bench --bench work_precision -- --record FOLDER    the same into this folder
//! cargo bench --bench work_precision -- --quick            a few small packings
//! cargo bench --bench work_precision -- --only boxes       one kind of grains
//! cargo bench --bench work_precision -- --again FOLDER     table, plots and advice anew from the runs that are there
//! cargo bench --bench work_precision -- --suggest          does what `dem-mpi --suggest` proposes keep its error?
//! ```
//!
//! Packings of spheres, ellipsoids 2:1 and 5:1, superellipsoids and boxes come to rest under the same stress on all sides.
//! They are then compressed by 6 % along z while the other sides keep their stress. Every run of a packing begins from the
//! same snapshot. Softer particles have packings of their own, so that means over the seeds are compared. The converged result
//! is the run with the smallest step (a fiftieth of the limit, for superellipsoids and boxes a twentieth) and the method
//! `auto`. The difference between the converged results of several seeds shows which errors matter: a smaller error is lost in
//! the choice of the packing.
//!
//! Each run takes one core; as many run at once as there are cores. Run time is the core time of a run, so that other work on
//! the machine affects it only through the caches.

mod advice;
mod runs;
mod suggested;

use anyhow::Context;
use benchmarking::lines::{self, Line};
use benchmarking::{in_parallel, median};
use clap::Parser;
use plotters::prelude::IntoLogRange;
use runs::{Kind, Outcome, Packing, Setting};
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(Parser)]
struct Arguments {
    /// Small packings, few settings.
    #[arg(long)]
    quick: bool,
    /// Only kinds whose name contains this.
    #[arg(long, value_name = "TEXT", default_value = "")]
    only: String,
    /// Write table, plots and advice into this folder.
    #[arg(long, value_name = "FOLDER", default_value = "target/work_precision")]
    record: PathBuf,
    /// Write table, plots and advice again from the runs of an existing record.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["quick", "only"])]
    again: Option<PathBuf>,
    /// Try the proposals of `dem-mpi --suggest`, on 10 seeds of three scenes; fails if fewer than 9 keep their error.
    #[arg(long, conflicts_with = "again")]
    suggest: bool,
    /// Cargo passes this.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Extent of a study.
struct Plan {
    /// Number of particles along each axis.
    along: u32,
    seeds: u64,
    /// Step of the converged result over the limit.
    converged: f64,
    steps: &'static [f64],
    quick: bool,
}

const FULL: Plan = Plan {
    along: 6,
    seeds: 5,
    converged: 0.02,
    steps: &[1.0, 0.8, 0.5, 0.3, 0.1, 0.05],
    quick: false,
};
/// Plan for superellipsoids, whose contacts take five times as long as those of ellipsoids.
const FULL_OF_DEAR: Plan = Plan { converged: 0.05, steps: &[1.0, 0.8, 0.5, 0.3, 0.1], ..FULL };
/// Plan for boxes, whose contacts take ten times as long as those of superellipsoids.
const FULL_OF_BOXES: Plan = Plan { along: 5, ..FULL_OF_DEAR };
const QUICK: Plan = Plan { along: 4, seeds: 2, converged: 0.1, steps: &[1.0, 0.5], quick: true };

/// Step over the limit at which methods, stiffnesses and skins are compared.
const COMPARED_AT: f64 = 0.5;

/// Changed setting, with its value.
#[derive(Clone, Debug, PartialEq)]
struct Variant {
    what: &'static str,
    value: String,
    setting: Setting,
}

impl Plan {
    const fn of(kind: Kind, quick: bool) -> Self {
        match kind {
            _ if quick => QUICK,
            Kind::Boxes => FULL_OF_BOXES,
            Kind::Superellipsoids => FULL_OF_DEAR,
            _ => FULL,
        }
    }

    fn variants(&self, kind: Kind) -> Vec<Variant> {
        let plain = Setting { step: COMPARED_AT, contact: "", stiffness: 1.0, skin: 1.0 };
        let mut all: Vec<Variant> = Vec::new();
        let mut add = |what, value: String, setting| all.push(Variant { what, value, setting });
        for &step in self.steps {
            add("step", step.to_string(), Setting { step, ..plain.clone() });
        }
        let methods = if self.quick { &[] } else { kind.methods() };
        for (name, contact) in methods {
            add("method", (*name).to_owned(), Setting { contact, ..plain.clone() });
        }
        for stiffness in if self.quick { &[0.1][..] } else { &[0.1, 0.01] } {
            let setting = Setting { stiffness: *stiffness, ..plain.clone() };
            add("stiffness", stiffness.to_string(), setting);
        }
        for skin in [0.5, 2.0] {
            add("skin", skin.to_string(), Setting { skin, ..plain.clone() });
        }
        all
    }
}

/// Converged result of a packing, and the results of its variants.
struct Studied {
    kind: Kind,
    seed: u64,
    converged: Outcome,
    variants: Vec<(Variant, Outcome)>,
}

/// Differences of a run from the converged result.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    /// Relative error of the axial stress.
    stress: f64,
    /// Relative error of the mean coordination number.
    coordination: f64,
    /// Error of the anisotropy of normals.
    a_c: f64,
    /// Energy error over the dissipated energy.
    missing: f64,
}

impl Errors {
    fn between(run: &Outcome, converged: &Outcome) -> Self {
        Self {
            stress: (run.axial / converged.axial - 1.0).abs(),
            coordination: (run.coordination / converged.coordination - 1.0).abs(),
            a_c: (run.a_c - converged.a_c).abs(),
            missing: run.missing.abs(),
        }
    }
}

/// A setting over all seeds of a kind.
struct Row {
    variant: Variant,
    /// Median time [s].
    seconds: f64,
    /// Median over the seeds. For softer particles it is the error of the mean over the seeds, except for the energy.
    median: Errors,
    largest: Errors,
}

fn main() -> anyhow::Result<()> {
    let Arguments { quick, only, mut record, again, suggest, .. } = Arguments::parse();
    if let Some(folder) = &again {
        record.clone_from(folder);
    }
    std::fs::create_dir_all(&record)?;
    if suggest {
        let scratch = tempfile::tempdir()?;
        return suggested::hold(&only, quick, &record, scratch.path());
    }
    let kinds: Vec<Kind> = Kind::ALL.into_iter().filter(|k| k.name().contains(&only)).collect();
    let studied = if let Some(folder) = again {
        read_runs(&std::fs::read_to_string(folder.join(RUNS))?)?
    } else {
        // The most expensive kinds first.
        let seeds = |kind| 1..=Plan::of(kind, quick).seeds;
        let tasks = kinds.iter().rev().flat_map(|&kind| seeds(kind).map(move |seed| (kind, seed)));
        let scratch = tempfile::tempdir()?;
        let studied = run_all(quick, &tasks.collect::<Vec<_>>(), scratch.path())?;
        std::fs::write(record.join(RUNS), runs_table(&studied)?)?;
        studied
    };

    let (mut table, mut advice) = (TABLE.to_owned(), String::new());
    for kind in kinds {
        let of_kind: Vec<&Studied> = studied.iter().filter(|s| s.kind == kind).collect();
        let (rows, spread) = (rows(&Plan::of(kind, quick), kind, &of_kind), spread(&of_kind));
        print(kind, &rows, &spread, &mut table)?;
        draw(&record.join(kind.file()).with_extension("svg"), &rows, &spread)?;
        writeln!(advice, "{}\n", advice::of(kind, &rows, &spread))?;
    }
    println!("\n{advice}written to {}", record.display());
    std::fs::write(record.join("settings.csv"), table)?;
    std::fs::write(record.join("advice.md"), advice)?;
    Ok(())
}

/// Runs all packings, as many at once as there are cores.
fn run_all(quick: bool, tasks: &[(Kind, u64)], folder: &Path) -> anyhow::Result<Vec<Studied>> {
    let study = |_, &(kind, seed): &(Kind, u64)| {
        let studied = study(&Plan::of(kind, quick), kind, seed, folder);
        studied.with_context(|| format!("{}, seed {seed}", kind.name()))
    };
    in_parallel(tasks, study).into_iter().collect()
}

fn study(plan: &Plan, kind: Kind, seed: u64, folder: &Path) -> anyhow::Result<Studied> {
    let folder = folder.join(format!("{}_{seed}", kind.file()));
    std::fs::create_dir_all(&folder)?;
    let packing = Packing { kind, seed, along: plan.along, folder };
    let rested = packing.rest(1.0)?;
    let converged = Setting { step: plan.converged, contact: "", stiffness: 1.0, skin: 1.0 };
    let converged = packing.shear(&rested, &converged)?;
    let mut variants = Vec::new();
    for variant in plan.variants(kind) {
        let setting = &variant.setting;
        let outcome = if setting.stiffness == 1.0 {
            packing.shear(&rested, setting)?
        } else {
            packing.shear(&packing.rest(setting.stiffness)?, setting)?
        };
        variants.push((variant, outcome));
    }
    println!("{}, seed {seed}: {} steps to convergence", kind.name(), converged.steps);
    Ok(Studied { kind, seed, converged, variants })
}

/// Standard deviations of the converged results over the seeds, relative except for `a_c`.
fn spread(studied: &[&Studied]) -> Errors {
    let deviation = |of: fn(&Outcome) -> f64| {
        let values: Vec<f64> = studied.iter().map(|s| of(&s.converged)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        (mean, (squares / (values.len() - 1).max(1) as f64).sqrt())
    };
    let relative = |(mean, deviation): (f64, f64)| deviation / mean;
    Errors {
        stress: relative(deviation(|outcome| outcome.axial)),
        coordination: relative(deviation(|outcome| outcome.coordination)),
        a_c: deviation(|outcome| outcome.a_c).1,
        missing: 0.0,
    }
}

fn rows(plan: &Plan, kind: Kind, studied: &[&Studied]) -> Vec<Row> {
    let of_variant = |k: usize, variant: Variant| {
        let runs = studied.iter().map(|s| (&s.variants[k].1, &s.converged));
        let seconds = median(&mut runs.clone().map(|(run, _)| run.seconds).collect::<Vec<_>>());
        let errors: Vec<Errors> = runs.map(|(run, best)| Errors::between(run, best)).collect();
        let over_all = |of: fn(&mut [f64]) -> f64| {
            let of =
                |column: fn(&Errors) -> f64| of(&mut errors.iter().map(column).collect::<Vec<_>>());
            Errors {
                stress: of(|e| e.stress),
                coordination: of(|e| e.coordination),
                a_c: of(|e| e.a_c),
                missing: of(|e| e.missing),
            }
        };
        let largest = over_all(|values| values.iter().copied().fold(0.0, f64::max));
        let is_another_packing = variant.setting.stiffness != 1.0;
        let median = if is_another_packing {
            let missing = over_all(median).missing;
            let means = Errors::between(
                &mean(studied, |s| &s.variants[k].1),
                &mean(studied, |s| &s.converged),
            );
            Errors { missing, ..means }
        } else {
            over_all(median)
        };
        Row { variant, seconds, median, largest }
    };
    plan.variants(kind).into_iter().enumerate().map(|(k, v)| of_variant(k, v)).collect()
}

/// Mean of the outcomes of all seeds; steps and time are those of the first.
fn mean(studied: &[&Studied], of: impl Fn(&Studied) -> &Outcome) -> Outcome {
    let over_all = |column: fn(&Outcome) -> f64| {
        studied.iter().map(|s| column(of(s))).sum::<f64>() / studied.len() as f64
    };
    Outcome {
        axial: over_all(|outcome| outcome.axial),
        mean: over_all(|outcome| outcome.mean),
        coordination: over_all(|outcome| outcome.coordination),
        a_c: over_all(|outcome| outcome.a_c),
        missing: over_all(|outcome| outcome.missing),
        ..of(studied[0]).clone()
    }
}

const TABLE: &str = "kind,what,value,seconds,pareto,stress_median,stress_largest,coordination_median,\
                     coordination_largest,a_c_median,a_c_largest,missing_median,missing_largest\n";

/// True if no other setting is both as fast and nearer to the converged stress.
fn is_pareto(row: &Row, rows: &[Row]) -> bool {
    let better = |other: &Row| {
        other.seconds <= row.seconds
            && other.median.stress < row.median.stress
            && other.variant != row.variant
    };
    !rows.iter().any(better)
}

fn print(kind: Kind, rows: &[Row], spread: &Errors, table: &mut String) -> anyhow::Result<()> {
    let name = kind.name();
    println!(
        "\n{name}: errors against the converged answer, median (largest) of the seeds, of softer grains that of the means; * no other is faster and nearer"
    );
    println!(
        "{:<28} {:>8}   {:>20} {:>20} {:>20} {:>20}",
        "", "s", "axial stress", "contacts", "a_c", "energy missing"
    );
    for row in rows {
        let Row { variant: Variant { what, value, .. }, seconds, median, largest } = row;
        let two = |of: fn(&Errors) -> f64| format!("{:.1e} ({:.1e})", of(median), of(largest));
        let front = is_pareto(row, rows);
        println!(
            "{:<28} {seconds:>8.3} {} {:>20} {:>20} {:>20} {:>20}",
            format!("{what} {value}"),
            if front { '*' } else { ' ' },
            two(|e| e.stress),
            two(|e| e.coordination),
            two(|e| e.a_c),
            two(|e| e.missing)
        );
        write!(table, "{name},{what},\"{value}\",{seconds:.4},{front}")?;
        let columns: [fn(&Errors) -> f64; 4] =
            [|e| e.stress, |e| e.coordination, |e| e.a_c, |e| e.missing];
        for of in columns {
            write!(table, ",{:.3e},{:.3e}", of(median), of(largest))?;
        }
        table.push('\n');
    }
    println!(
        "{:<28} {:>8}   {:>20.1e} {:>20.1e} {:>20.1e}",
        "spread of the seeds", "", spread.stress, spread.coordination, spread.a_c
    );
    writeln!(
        table,
        "{name},spread of the seeds,,,,{:.3e},,{:.3e},,{:.3e},,,",
        spread.stress, spread.coordination, spread.a_c
    )?;
    Ok(())
}

/// Name of the table of all runs.
const RUNS: &str = "runs.csv";

/// Runs of a table written by [`runs_table`].
fn read_runs(text: &str) -> anyhow::Result<Vec<Studied>> {
    let mut studied: Vec<Studied> = Vec::new();
    for row in csv::Reader::from_reader(text.as_bytes()).into_records() {
        let row = row?;
        let number = |column: usize| row[column].parse::<f64>().context("a number");
        let kind = Kind::ALL.into_iter().find(|kind| *kind.name() == row[0]);
        let (kind, seed) = (kind.context("a kind of grains")?, row[1].parse()?);
        let outcome = Outcome {
            steps: row[4].parse()?,
            seconds: number(5)?,
            axial: number(6)?,
            mean: number(7)?,
            coordination: number(8)?,
            a_c: number(9)?,
            missing: number(10)?,
        };
        if row[2] == *"converged" {
            studied.push(Studied { kind, seed, converged: outcome, variants: Vec::new() });
            continue;
        }
        let variants = Plan::of(kind, false).variants(kind);
        let variant = variants.into_iter().find(|v| *v.what == row[2] && v.value == row[3]);
        let variant =
            variant.with_context(|| format!("{} {} is not in the study", &row[2], &row[3]))?;
        let of_packing = studied.last_mut().context("the converged run comes first")?;
        of_packing.variants.push((variant, outcome));
    }
    Ok(studied)
}

/// Table of all runs.
fn runs_table(studied: &[Studied]) -> anyhow::Result<String> {
    let mut table =
        "kind,seed,what,value,steps,seconds,axial_stress_pa,mean_stress_pa,coordination,a_c,missing\n"
            .to_owned();
    for Studied { kind, seed, converged, variants } in studied {
        let plain = ("converged", "", converged);
        let changed = variants.iter().map(|(v, outcome)| (v.what, &*v.value, outcome));
        for (what, value, outcome) in std::iter::once(plain).chain(changed) {
            let Outcome { steps, seconds, axial, mean, coordination, a_c, missing } = outcome;
            writeln!(
                table,
                "{},{seed},{what},\"{value}\",{steps},{seconds:.4},{axial:.6e},{mean:.6e},{coordination:.6},{a_c:.6},{missing:.3e}",
                kind.name()
            )?;
        }
    }
    Ok(table)
}

/// Smallest error drawn: a result may equal the converged one to the last bit.
const LEAST: f64 = 1e-6;

fn draw(path: &Path, rows: &[Row], spread: &Errors) -> anyhow::Result<()> {
    let mut lines: Vec<Line> = Vec::new();
    for what in ["step", "method", "stiffness", "skin"] {
        let of_it = rows.iter().filter(|row| row.variant.what == what);
        let points: Vec<(f64, f64)> =
            of_it.map(|row| (row.seconds, row.median.stress.max(LEAST))).collect();
        if what == "step" {
            lines.push(Line { name: "step, from the limit down".to_owned(), points });
            continue;
        }
        let named = rows.iter().filter(|row| row.variant.what == what);
        lines.extend(named.zip(points).map(|(row, point)| Line {
            name: format!("{what} {}", row.variant.value),
            points: vec![point],
        }));
    }
    let times = rows.iter().map(|row| row.seconds);
    let (least, most) = times.fold((f64::INFINITY, 0.0_f64), |(a, b), s| (a.min(s), b.max(s)));
    let level = [0.8 * least, 1.25 * most].map(|seconds| (seconds, spread.stress));
    lines.push(Line { name: "spread of the seeds".to_owned(), points: level.to_vec() });
    lines::draw(
        path,
        ["seconds of a core", "relative error of the axial stress, median"],
        (0.7 * least..1.4 * most).log_scale(),
        (0.5 * LEAST..1.0).log_scale(),
        &lines,
    )
}
