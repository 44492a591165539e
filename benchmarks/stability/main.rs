//! Map of stability: the program in cells from ordinary to extreme parameters, started as a user would start it.
//!
//! ```text
//! cargo bench --bench stability                        runs all cells; table and picture go to target/stability
//! cargo bench --bench stability -- --record FOLDER     the same into this folder
//! cargo bench --bench stability -- --quick             some cells in a minute, held against the record
//! cargo bench --bench stability -- --only TEXT         the rows whose name contains this text
//! ```
//!
//! Each cell is run on one rank and on two (some on eight), which must agree in every bit. It must end with the theoretical
//! result, be rejected, be stopped with a message, or deviate with a warning. A cell fails if it deviates without a warning,
//! has values that are not numbers, hangs or panics. Each row defines its expected results from closed forms and conserved
//! quantities. In every cell no particle may be lost, and the energy error may be at most 1 % of the dissipated energy. The
//! first method must resolve 99 of 100 pairs.

mod cell;
mod picture;
mod rows;
mod scene;

use anyhow::Context;
use benchmarking::in_parallel;
use cell::{Cell, Finding, Outcome};
use clap::Parser;
use std::path::{Path, PathBuf};

#[derive(Parser)]
struct Arguments {
    /// Some cells, compared with the record.
    #[arg(long)]
    quick: bool,
    /// Only rows whose name contains this.
    #[arg(long, value_name = "TEXT", default_value = "")]
    only: String,
    /// Write table and picture into this folder.
    #[arg(long, value_name = "FOLDER", default_value = "target/stability")]
    record: PathBuf,
    /// Keep the scenes and their output in this folder.
    #[arg(long, value_name = "FOLDER")]
    keep: Option<PathBuf>,
    /// Cargo passes this.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Table of the committed record.
const RECORD: &str =
    concat!(env!("CARGO_MANIFEST_DIR"), "/benchmarks/records/2026-11-stability/map.csv");

fn main() -> anyhow::Result<()> {
    let Arguments { quick, only, record, keep, .. } = Arguments::parse();
    let mut cells = rows::all();
    cells.retain(|cell| cell.row.contains(&only) && (!quick || cell.is_quick));
    let scratch = tempfile::tempdir()?;
    let findings = run(&cells, keep.as_deref().unwrap_or(scratch.path()))?;
    print(&cells, &findings);
    std::fs::create_dir_all(&record)?;
    write(&record.join("map.csv"), &cells, &findings)?;
    picture::draw(&record.join("map.svg"), &cells, &findings)?;
    println!("written to {}", record.display());
    let wrong = findings.iter().filter(|finding| finding.outcome == Outcome::Wrong).count();
    anyhow::ensure!(wrong == 0, "{wrong} of {} cells are wrong without a word", cells.len());
    if quick {
        compare(&cells, &findings)?;
    }
    Ok(())
}

/// Runs all cells, as many at once as there are cores.
fn run(cells: &[Cell], folder: &Path) -> anyhow::Result<Vec<Finding>> {
    let found = in_parallel(cells, |k, cell| {
        let finding = cell::find(cell, &folder.join(k.to_string()));
        if let Ok(Finding { outcome, seconds, .. }) = &finding {
            eprintln!("{}, {}: {}, {seconds:.2} s", cell.row, cell.value, outcome.name());
        }
        finding
    });
    found.into_iter().collect()
}

fn print(cells: &[Cell], findings: &[Finding]) {
    let mut row = "";
    for (cell, Finding { outcome, why, seconds }) in cells.iter().zip(findings) {
        if cell.row != row {
            row = cell.row;
            println!("\n{row}");
        }
        println!("  {:<22} {:<14} {seconds:7.2} s  {why}", cell.value, outcome.name());
    }
    println!();
    for outcome in Outcome::ALL {
        let count = findings.iter().filter(|finding| finding.outcome == outcome).count();
        println!("{count:>4} {}", outcome.name());
    }
}

fn write(path: &Path, cells: &[Cell], findings: &[Finding]) -> anyhow::Result<()> {
    let mut table = csv::Writer::from_path(path)?;
    table.write_record(["row", "value", "outcome", "seconds", "why"])?;
    for (cell, Finding { outcome, why, seconds }) in cells.iter().zip(findings) {
        table.write_record([
            cell.row,
            &cell.value,
            outcome.name(),
            &format!("{seconds:.2}"),
            why,
        ])?;
    }
    Ok(table.flush()?)
}

/// Compares the outcomes with those of the record.
fn compare(cells: &[Cell], findings: &[Finding]) -> anyhow::Result<()> {
    let mut recorded = Vec::new();
    let mut record = csv::Reader::from_path(RECORD)
        .with_context(|| format!("{RECORD}: write it with --record and its folder"))?;
    for row in record.records() {
        let row = row?;
        recorded.push(((row[0].to_owned(), row[1].to_owned()), row[2].to_owned()));
    }
    let mut others = Vec::new();
    for (cell, finding) in cells.iter().zip(findings) {
        let key = (cell.row.to_owned(), cell.value.clone());
        let before = recorded.iter().find(|(of, _)| *of == key).map(|(_, outcome)| &**outcome);
        if before != Some(finding.outcome.name()) {
            let before = before.unwrap_or("not there");
            others.push(format!(
                "{}, {}: {} (record: {before})",
                cell.row,
                cell.value,
                finding.outcome.name()
            ));
        }
    }
    anyhow::ensure!(others.is_empty(), "not as recorded:\n{}", others.join("\n"));
    Ok(())
}
