//! A rectangular hopper with a flat floor and a slot: Anand et al. (2008), "Predicting discharge dynamics from a rectangular
//! hopper using the discrete element method", DOI 10.1016/j.ces.2008.08.015, in the version of the Lethe examples
//! (`examples/dem/3d-rectangular-hopper`). The discharge rate is compared with that of Lethe.
//!
//! ```text
//! cargo bench --bench hopper                       an hour on one core
//! cargo bench --bench hopper -- --ranks 2          on so many ranks
//! cargo bench --bench hopper -- --record FOLDER    the table and the picture into this folder
//! ```
//!
//! The benchmark fails if the rate is more than 5 % off that of Lethe. An interrupted run continues when it is called again with
//! the same arguments.

use anyhow::ensure;
use benchmarking::lines::{self, Line};
use benchmarking::simulate;
use clap::Parser;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::post::errors::MeasureError;
use dem_mpi::post::flow::{CumulativeFlow, Plane, Rate, Window, through_plane};
use dem_mpi::post::series;
use std::fmt::Write;
use std::path::{Path, PathBuf};

#[derive(Parser)]
struct Arguments {
    #[arg(long, default_value_t = 1)]
    ranks: u32,
    /// Folder of the runs.
    #[arg(long, value_name = "FOLDER", default_value = "target/hopper")]
    out: PathBuf,
    /// Write the table and the picture into this folder.
    #[arg(long, value_name = "FOLDER")]
    record: Option<PathBuf>,
    /// Cargo passes this.
    #[arg(long, hide = true)]
    bench: bool,
}

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/benchmarks/hopper");
/// Rate of Lethe [g/s], for a slice of 5.6 mm, the depth in the paper: a sixth of this hopper.
const LETHE: f64 = 84.94;
const SLICES: f64 = 6.0;
/// Largest accepted relative difference.
const TOLERANCE: f64 = 0.05;
/// A particle has left once it is a radius below the floor, the criterion of Lethe.
const BELOW: Plane = Plane { axis: 2, at: -1.12e-3, up: false };
/// Window of the rate, after the opening, as in Lethe [s].
const WINDOW: Window = Window { from: 0.25, to: 0.75 };

fn main() -> anyhow::Result<()> {
    let Arguments { ranks, out, record, .. } = Arguments::parse();
    let [filled, open] = ["filled", "open"].map(|name| out.join(name));
    std::fs::create_dir_all(&out)?;
    let run = |scene: &str, out: &Path, set: &[&str]| {
        let scene = Path::new(FOLDER).join(scene);
        simulate(env!("CARGO_BIN_EXE_dem-mpi"), &scene, out, ranks, set)
    };
    run("fill.toml", &filled, &[])?;
    let last = series::newest(&filled)?.canonicalize()?;
    run("open.toml", &open, &[&format!("start={:?}", last.display().to_string())])?;

    let open_file = |path: PathBuf| -> Result<_, MeasureError> { Ok(Reader::open(&path)?) };
    let mut rows = through_plane(series::all(&open)?.into_iter().map(open_file), BELOW)?.rows;
    let opened = Reader::open(&last)?.header().time;
    for row in &mut rows {
        row.time_s -= opened;
    }
    let rate = Rate::of(&rows, Some(WINDOW))?;
    let of_slice = 1e3 * rate.mass / SLICES;

    let record = record.unwrap_or(out);
    std::fs::create_dir_all(&record)?;
    std::fs::write(record.join("hopper.csv"), table(&rows)?)?;
    draw(&record.join("hopper.svg"), &rows)?;
    let off = of_slice / LETHE - 1.0;
    println!(
        "{of_slice:.2} g/s of a slice from {} s to {} s, {:.0} grains/s in all; Lethe {LETHE} g/s: {:+.2} %",
        rate.window.from,
        rate.window.to,
        rate.grains,
        100.0 * off
    );
    if let Some([early, late]) = rate.halves {
        println!("by halves {:.2} and {:.2} g/s", 1e3 * early / SLICES, 1e3 * late / SLICES);
    }
    ensure!(off.abs() < TOLERANCE, "off by more than {:.0} %", 100.0 * TOLERANCE);
    Ok(())
}

/// Mass of a slice that has left, by time [s, g].
fn table(rows: &[CumulativeFlow]) -> anyhow::Result<String> {
    let mut text = "time_s,grains,mass_of_a_slice_g\n".to_owned();
    for row in rows {
        writeln!(text, "{:.3},{:.0},{:.4}", row.time_s, row.grains, 1e3 * row.mass_kg / SLICES)?;
    }
    Ok(text)
}

fn draw(path: &Path, rows: &[CumulativeFlow]) -> anyhow::Result<()> {
    let points = rows.iter().map(|row| (row.time_s, 1e3 * row.mass_kg / SLICES)).collect();
    let end = rows.last().map_or(1.0, |row| row.time_s);
    // The line passes through the middle of the window.
    let at = |time: f64| {
        let here =
            rows.iter().min_by(|a, b| (a.time_s - 0.5).abs().total_cmp(&(b.time_s - 0.5).abs()));
        here.map_or(0.0, |row| 1e3 * row.mass_kg / SLICES + LETHE * (time - row.time_s))
    };
    let lethe = [WINDOW.from, WINDOW.to].map(|time| (time, at(time))).to_vec();
    let lines = [
        Line { name: "dem-mpi".to_owned(), points },
        Line { name: format!("{LETHE} g/s, Lethe"), points: lethe },
    ];
    lines::draw(
        path,
        ["time (s)", "mass that has left, of a slice (g)"],
        0.0..end,
        0.0..90.0,
        &lines,
    )
}
