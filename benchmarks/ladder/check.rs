//! Instructions and bytes of each rung against those on record, which `.ci/run` looks at. Two numbers of one commit differ by 0.2 % where packages are
//! optimised across each other, as in a release, or not.

use super::{ALONG, RUNGS, Rung, Runner, bytes, instructions};
use anyhow::{Context, bail};
use dem_mpi::comm::threads;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The record, from the root of the project.
const RECORD: &str = "benchmarks/records/2026-11-ladder";
const FILE: &str = "guard.csv";
/// A number may be off so far [-]. Counts on one rank repeat to the last digit.
const TOLERANCE: f64 = 0.01;

/// A line of the record; per particle, and per step.
#[derive(Debug, Serialize, Deserialize)]
struct Line {
    rung: String,
    ranks: u32,
    bytes: f64,
    /// None where callgrind does not know an instruction.
    instructions: Option<f64>,
}

/// Counts and compares, or takes the record anew.
pub(super) fn check(anew: Option<&Path>) -> anyhow::Result<()> {
    let servo = RUNGS.iter().position(|rung| rung.name.contains("servo"));
    let on_two = servo.context("a rung has a servo")?;
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
        let Some(known) =
            record.iter().find(|known| known.rung == line.rung && known.ranks == line.ranks)
        else {
            off.push(format!("\"{}\" on {} is not on record", line.rung, line.ranks));
            continue;
        };
        let numbers = [
            ("bytes", Some(line.bytes), Some(known.bytes)),
            ("instructions", line.instructions, known.instructions),
        ];
        for (what, now, known) in numbers {
            let ratio = now.zip(known).map(|(now, known)| now / known);
            if now.is_some() != known.is_some()
                || ratio.is_some_and(|ratio| (ratio - 1.0).abs() > TOLERANCE)
            {
                let [now, known] =
                    [now, known].map(|n| n.map_or("none".to_owned(), |n| format!("{n:.0}")));
                off.push(format!(
                    "\"{}\" on {}: {now} {what}, on record {known}",
                    line.rung, line.ranks
                ));
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

fn counted(rung: usize, ranks: u32) -> anyhow::Result<Line> {
    let bodies = f64::from(ALONG.pow(3));
    let name = RUNGS[rung].name;
    let bytes = if ranks == 1 {
        Runner::of(rung + 1)?.size()[0]
    } else {
        let all = threads::run(ranks, |comm| Ok(bytes(&RUNGS[rung].begun_on(ALONG, comm)?)));
        all.into_iter().sum::<anyhow::Result<usize>>()?
    };
    let instructions = instructions(rung + 1, ranks, None)?.map(|count| (count / bodies).round());
    let line =
        Line { rung: name.to_owned(), ranks, bytes: (bytes as f64 / bodies).round(), instructions };
    println!(
        "{name:<40} {ranks} {:>6} bytes {:>8} instructions",
        line.bytes,
        instructions.map_or("-".to_owned(), |count| count.to_string())
    );
    Ok(line)
}

/// Steps of a rung on several ranks.
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
