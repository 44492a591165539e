//! Positions of the spheres after a millisecond by all codes, with decreasing steps; the error against the run time.

use crate::case::{Apart, Case};
use crate::codes::{Code, Run, Steps, run};
use anyhow::ensure;
use benchmarking::lines::{self, Line};
use dem_mpi::math::Vec3;
use plotters::prelude::IntoLogRange;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Simulated time [s].
const TIME: f64 = 1e-3;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Time steps [s], the finest last.
    #[arg(long, value_delimiter = ',', default_values_t = [1e-5, 5e-6, 2e-6, 1e-6, 1e-7])]
    steps: Vec<f64>,
}

/// Writes `converge.csv` and `converge.svg`, and prints the table.
pub(crate) fn converge(case: &Case, options: &Options, record: &Path) -> anyhow::Result<()> {
    let mut csv = String::from(
        "code,step_s,seconds,against,against_step_s,median_m,percentile_99_m,largest_m,median_over_way\n",
    );
    println!(
        "| code | step | seconds | against | step | median | 99 of 100 | largest | median over way |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut lammps: Option<(f64, Vec<Vec3>)> = None;
    let mut lines = Vec::new();
    for code in [Code::Lammps, Code::Own, Code::OwnForesees, Code::LammpsGranular, Code::Liggghts] {
        if !code.is_installed() {
            eprintln!("{} is not installed: left out", code.name());
            ensure!(code != Code::Lammps, "it is what the others are compared with");
            continue;
        }
        let ends = options
            .steps
            .iter()
            .map(|&step| Ok((step, run(code, case, Steps::until(TIME, step))?)))
            .collect::<anyhow::Result<Vec<_>>>()?;
        let Some(((finest, fine), coarser)) = ends.split_last() else { continue };
        let end = &fine.end;
        let way = Apart::of(&case.start, lammps.as_ref().map_or(end, |(_, end)| end)).median;
        let mut row = |step: f64,
                       Run { end, seconds, .. }: &Run,
                       other: Code,
                       (other_step, other_end): (f64, &[Vec3])| {
            let Apart { median, percentile_99, largest } = Apart::of(end, other_end);
            let (name, other) = (code.name(), other.name());
            writeln!(
                csv,
                "{name},{step:e},{seconds:.4},{other},{other_step:e},{median:e},{percentile_99:e},{largest:e},{}",
                median / way
            )?;
            println!(
                "| {name} | {step:e} | {seconds:.3} | {other} | {other_step:e} | {median:.2e} | {percentile_99:.2e} | {largest:.2e} | {:.3} % |",
                100.0 * median / way
            );
            anyhow::Ok((*seconds, median / way))
        };
        let mut points = Vec::new();
        for (step, coarse) in coarser {
            points.push(row(*step, coarse, code, (*finest, end))?);
        }
        lines.push(Line { name: code.name().to_owned(), points });
        if let Some((step, answer)) = &lammps {
            row(*finest, fine, Code::Lammps, (*step, answer))?;
        } else {
            lammps = Some((*finest, end.clone()));
        }
    }
    if let Some((_, end)) = &lammps {
        let way = Apart::of(&case.start, end);
        println!("\nway in {TIME} s: median {:.3e} m, largest {:.3e} m", way.median, way.largest);
    }
    fs::write(record.join("converge.csv"), csv)?;
    let all: Vec<(f64, f64)> = lines.iter().flat_map(|line| line.points.clone()).collect();
    let ends = |of: fn(&(f64, f64)) -> f64| {
        let values = all.iter().map(of);
        let least = values.clone().fold(f64::INFINITY, f64::min);
        (0.7 * least..1.4 * values.fold(0.0, f64::max)).log_scale()
    };
    let labels = ["run time of a millisecond [s]", "median error over the way"];
    lines::draw(&record.join("converge.svg"), labels, ends(|p| p.0), ends(|p| p.1), &lines)?;
    Ok(())
}

/// Writes the position of each sphere by LAMMPS.
pub(crate) fn answer(case: &Case, finest: f64, file: &Path) -> anyhow::Result<()> {
    let [coarse, fine] = [10.0 * finest, finest].map(|step| Steps::until(TIME, step));
    let fine = run(Code::Lammps, case, fine)?.end;
    let mut csv = String::from("x,y,z,end_x,end_y,end_z\n");
    for (start, end) in case.start.iter().zip(&fine) {
        let [a, b, c] = (*start).into();
        let [x, y, z] = (*end).into();
        writeln!(csv, "{a},{b},{c},{x},{y},{z}")?;
    }
    fs::write(file, csv)?;
    let moved = Apart::of(&case.start, &fine);
    let error = Apart::of(&run(Code::Lammps, case, coarse)?.end, &fine);
    println!("way in {TIME} s: {moved:?}; ten times the step moves it by {error:?}");
    Ok(())
}
