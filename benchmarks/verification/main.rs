//! Published cases, closed forms and other codes: their numbers beside those of this program, in one table.
//!
//! ```text
//! cargo bench --bench verification                        prints the table; it and the pictures go to target/
//! cargo bench --bench verification -- --quick             what the tests run, too
//! cargo bench --bench verification -- --only arch         one source, or several
//! cargo bench --bench verification -- --record FOLDER     the same into this folder
//! cargo bench --bench verification -- --outside FOLDER    only how every scene below this folder ends
//! ```
//!
//! The benchmark fails if a case does, unless it is known to fall short. If LAMMPS' `lmp` is installed, its
//! orders of convergence are listed beside those of this program.

mod cases;
mod outside;
mod table;

use anyhow::Context;
use benchmarking::lines::{self, Line};
use cases::{Effort, Picture};
use clap::Parser;
use plotters::prelude::IntoLogRange;
use std::path::{Path, PathBuf};
use std::time::Instant;

#[derive(Parser)]
struct Arguments {
    /// The short cases.
    #[arg(long)]
    quick: bool,
    /// Write the table and the pictures into this folder.
    #[arg(long, value_name = "FOLDER", default_value = "target/verification")]
    record: PathBuf,
    /// Only these sources (parts of names of files in `cases`).
    #[arg(long, value_name = "NAME", num_args = 1..)]
    only: Vec<String>,
    /// In place of all sources: run the scenes below this folder, and print how they end.
    #[arg(long, value_name = "FOLDER")]
    outside: Option<PathBuf>,
    /// Cargo passes this.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> anyhow::Result<()> {
    let Arguments { quick, record, only, outside, .. } = Arguments::parse();
    if let Some(folder) = outside {
        return outside::run(&folder.canonicalize()?, &std::path::absolute(record)?);
    }
    let effort = if quick { Effort::Quick } else { Effort::Full };
    std::fs::create_dir_all(&record)?;
    let mut all = Vec::new();
    let (mut pictures, mut drawings, mut notes) = (Vec::new(), Vec::new(), Vec::new());
    for (name, run) in cases::sources() {
        if only.is_empty() || only.iter().any(|part| name.contains(part)) {
            let begin = Instant::now();
            let findings = run(effort);
            println!("{name}: {:.1} s", begin.elapsed().as_secs_f64());
            table::print(&findings.cases);
            all.extend(findings.cases);
            pictures.extend(findings.pictures);
            drawings.extend(findings.drawings);
            findings.notes.iter().for_each(|note| println!("  {note}"));
            notes.extend(findings.notes);
        }
    }
    for picture in &pictures {
        draw(&record, picture)?;
    }
    for drawing in &drawings {
        let path = record.join(drawing.file).with_extension("svg");
        std::fs::write(&path, &drawing.svg)
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    let mut command = "cargo bench --locked --bench verification".to_owned();
    if quick || !only.is_empty() {
        command += " --";
    }
    if quick {
        command += " --quick";
    }
    if !only.is_empty() {
        command = format!("{command} --only {}", only.join(" "));
    }
    let of_curves = pictures.iter().map(|picture| (picture.file, picture.axes[1]));
    let images: Vec<_> =
        of_curves.chain(drawings.iter().map(|drawing| (drawing.file, drawing.title))).collect();
    table::write(&record, &command, &all, &images, &notes)?;
    println!("written to {}", record.display());
    let failed = all.iter().filter(|case| !case.verdict().is_expected()).count();
    anyhow::ensure!(failed == 0, "{failed} of {} cases are not as expected", all.len());
    Ok(())
}

/// Draws a picture as SVG.
fn draw(folder: &Path, picture: &Picture) -> anyhow::Result<()> {
    let path = folder.join(picture.file).with_extension("svg");
    let lines: Vec<Line> = (picture.curves.iter())
        .map(|curve| Line { name: curve.name.clone(), points: curve.points.clone() })
        .collect();
    let points = || picture.curves.iter().flat_map(|curve| &curve.points);
    let range = |of: fn(&(f64, f64)) -> f64| {
        let all = points().map(of).filter(|x| !picture.is_logarithmic || *x > 0.0);
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    };
    let ((left, right), (bottom, top)) = (range(|p| p.0), range(|p| p.1));
    if picture.is_logarithmic {
        let (x, y) = (0.8 * left..1.25 * right, 0.5 * bottom..2.0 * top);
        lines::draw(&path, picture.axes, x.log_scale(), y.log_scale(), &lines)
    } else {
        let margin = 0.05 * (top - bottom);
        lines::draw(&path, picture.axes, left..right, bottom - margin..top + margin, &lines)
    }
}
