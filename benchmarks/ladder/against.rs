//! Times of each rung beside those of the build of another commit, in turns. Code with instructions unknown to valgrind has no
//! other guard.

use super::{ALONG, RUNGS, median};
use anyhow::{Context, ensure};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::Command;

const FILE: &str = "against.csv";
const ROUNDS: usize = 9;

/// A line of the record.
#[derive(Serialize)]
struct Line<'a> {
    commit: &'a str,
    rung: &'static str,
    /// Medians per particle and step [ns].
    now: f64,
    then: f64,
    /// Median, least and largest of the ratios of rounds [-].
    ratio: f64,
    least: f64,
    largest: f64,
}

/// Builds the present ladder with the library of the commit, and times both in turns.
pub(super) fn time(commit: &str, record: Option<&Path>) -> anyhow::Result<()> {
    // The hash is needed: a branch or HEAD may later be another commit.
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let commit = run(root, "git", &["rev-parse", "--short", &format!("{commit}^{{commit}}")])?;
    let commit = commit.trim();
    let then = built(commit)?;
    let now = std::env::current_exe()?;
    let mut lines = Vec::new();
    println!("ns per particle and step, in turns: median over {ROUNDS} rounds");
    println!("{:<40} {:>8} {:>10} {:>6}", "", "now", commit, "ratio");
    for (k, rung) in RUNGS.iter().enumerate() {
        let (mut times, mut ratios) = ([Vec::new(), Vec::new()], Vec::new());
        for _ in 0..ROUNDS {
            let [now, then] = [timed(&now, k + 1)?, timed(&then, k + 1)?];
            times[0].push(now);
            times[1].push(then);
            ratios.push(now / then);
        }
        let per_body = 1e9 / f64::from(ALONG.pow(3));
        let [now, then] = times.map(|mut times| per_body * median(&mut times));
        let ratio = median(&mut ratios);
        println!("{:<40} {now:>8.1} {then:>10.1} {ratio:>6.3}", rung.name);
        // Sorted since their median was taken.
        let [least, largest] = [ratios[0], ratios[ROUNDS - 1]];
        lines.push(Line { commit, rung: rung.name, now, then, ratio, least, largest });
    }
    if let Some(folder) = record {
        let mut writer = csv::Writer::from_path(folder.join(FILE))?;
        lines.iter().try_for_each(|line| writer.serialize(line))?;
        writer.flush()?;
    }
    Ok(())
}

fn timed(program: &Path, rung: usize) -> anyhow::Result<f64> {
    let output = Command::new(program).args(["--round", &rung.to_string()]).output()?;
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    told.trim().parse().with_context(|| {
        format!("{}: {}", program.display(), String::from_utf8_lossy(&output.stderr))
    })
}

/// Builds the ladder with the library of a commit, in a separate tree.
fn built(commit: &str) -> anyhow::Result<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let tree = root.join("target/ladder").join(commit);
    if !tree.exists() {
        let from = root.to_string_lossy();
        let to = tree.to_string_lossy();
        run(root, "git", &["clone", "--quiet", "--shared", "--no-checkout", &from, &to])?;
    }
    run(&tree, "git", &["checkout", "--quiet", "--force", "--detach", commit])?;
    for file in std::fs::read_dir(root.join("benchmarks/ladder"))? {
        let file = file?;
        std::fs::copy(file.path(), tree.join("benchmarks/ladder").join(file.file_name()))?;
    }
    let told = run(
        &tree,
        "cargo",
        &["bench", "--locked", "--bench", "ladder", "--no-run", "--message-format=json"],
    )?;
    let program = told
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter(|message| message.pointer("/target/name").is_some_and(|name| name == "ladder"))
        .find_map(|message| Some(message.get("executable")?.as_str()?.to_owned()));
    Ok(program.context("cargo built no ladder")?.into())
}

/// Output of a program; its errors go to those of this process.
fn run(folder: &Path, program: &str, arguments: &[&str]) -> anyhow::Result<String> {
    let output = Command::new(program)
        .args(arguments)
        .current_dir(folder)
        .stderr(std::process::Stdio::inherit())
        .output()
        .with_context(|| format!("{program} does not start"))?;
    ensure!(output.status.success(), "{program} {} fails", arguments.join(" "));
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
