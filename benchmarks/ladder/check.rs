//! Comparison of instructions and bytes of each rung with the record. The record is of builds with `lto = false`, as in
//! `.ci/run`; a release has 0.2 % fewer instructions.

use super::{ALONG, RUNGS, Rung, Runner, bytes, instructions};
use anyhow::{Context, bail};
use dem_mpi::comm::threads;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Folder of the record, from the root of the project.
const RECORD: &str = "benchmarks/records/2026-11-ladder";
const FILE: &str = "guard.csv";
/// Largest accepted relative deviation [-]. Counts on one rank repeat to the last digit.
const TOLERANCE: f64 = 0.01;

/// A line of the record, per particle and per step.
#[derive(Debug, Serialize, Deserialize)]
struct Line {
    rung: String,
    ranks: u32,
    bytes: u64,
    /// Counted without AVX if its code has an instruction that callgrind does not know; `None` if that has one, too.
    instructions: Option<u64>,
}

/// Counts and compares, or writes a new record.
pub(super) fn check(anew: Option<&Path>) -> anyhow::Result<()> {
    let on_two = RUNGS.iter().position(|rung| rung.servo).context("a rung has a servo")?;
    let cases = (0..RUNGS.len()).map(|k| (k, 1)).chain([(on_two, 2)]);
    let lines = cases.map(|(k, ranks)| counted(k, ranks)).collect::<anyhow::Result<Vec<Line>>>()?;
    if let Some(folder) = anew {
        let mut writer = csv::Writer::from_path(folder.join(FILE))?;
        lines.iter().try_for_each(|line| writer.serialize(line))?;
        writer.flush()?;
        return Ok(());
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(RECORD).join(FILE);
    let record: Vec<Line> =
        csv::Reader::from_path(&path)?.into_deserialize().collect::<Result<_, _>>()?;
    let mut off = Vec::new();
    for line in &lines {
        let is_same = |known: &&Line| known.rung == line.rung && known.ranks == line.ranks;
        let case = format!("\"{}\", {} rank(s)", line.rung, line.ranks);
        let Some(known) = record.iter().find(is_same) else {
            off.push(format!("{case}: not on record"));
            continue;
        };
        for (what, now, known) in [
            ("bytes", Some(line.bytes), Some(known.bytes)),
            ("instructions", line.instructions, known.instructions),
        ] {
            let holds = match (now, known) {
                (Some(now), Some(known)) => (now as f64 / known as f64 - 1.0).abs() <= TOLERANCE,
                (now, known) => now == known,
            };
            if !holds {
                let [now, known] = [now, known].map(number);
                off.push(format!("{case}: {now} {what}, on record {known}"));
            }
        }
    }
    if !off.is_empty() {
        bail!(
            "{}\nWhat costs less or has to cost more is put on record in the commit that changes it, with the reason in its message: \
             CARGO_PROFILE_RELEASE_LTO=false cargo bench --bench ladder -- --check --record {RECORD}",
            off.join("\n")
        );
    }
    println!("all within {:.0} % of {}", 100.0 * TOLERANCE, path.display());
    Ok(())
}

fn number(count: Option<u64>) -> String {
    count.map_or_else(|| "-".to_owned(), |count| count.to_string())
}

fn counted(rung: usize, ranks: u32) -> anyhow::Result<Line> {
    let per_body = |count: f64| (count / f64::from(ALONG.pow(3))).round() as u64;
    let name = RUNGS[rung].name;
    let bytes = if ranks == 1 {
        Runner::of(rung + 1)?.size()[0]
    } else {
        let all = threads::run(ranks, |comm| Ok(bytes(&RUNGS[rung].begun_on(ALONG, comm)?)));
        all.into_iter().sum::<anyhow::Result<usize>>()?
    };
    let counted = |registers| instructions(rung + 1, ranks, None, registers);
    let instructions = match counted("avx")? {
        None => counted("any")?,
        known => known,
    };
    let (bytes, instructions) = (per_body(bytes as f64), instructions.map(per_body));
    println!("{name:<40} {ranks} {bytes:>6} bytes {:>8} instructions", number(instructions));
    Ok(Line { rung: name.to_owned(), ranks, bytes, instructions })
}

/// Runs steps of a rung on several ranks.
pub(super) fn steps_of(rung: &Rung, steps: u32, ranks: u32) -> anyhow::Result<()> {
    let all = threads::run(ranks, |comm| {
        let mut sim = rung.begun_on(ALONG, comm)?;
        for _ in 0..steps {
            sim.step(comm)?;
        }
        Ok(())
    });
    all.into_iter().collect()
}
