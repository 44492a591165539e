//! What is kept of a part of the study: its files, and in `machine.txt` where they come from.

use anyhow::{Context, Result};
use benchmarking::machine::{cores, processor, said};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Writes these files, names and contents, into a folder, which is made.
///
/// # Errors
/// The system's, with the path.
pub fn store(folder: &Path, files: &[(String, String)]) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    for (name, text) in files {
        let path = folder.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// What decides the numbers: a change to it since the commit is said.
const SOURCES: [&str; 6] =
    ["src", "run", "benchmarks/lai2021", ".cargo", "Cargo.toml", "Cargo.lock"];

/// The text of `machine.txt`: the command that made the record, the commit, the day, the machine, `more` about it, the
/// compiler.
pub fn machine(command: &str, more: &str) -> String {
    let is_committed = Command::new("git")
        .args(["diff", "--quiet", "HEAD", "--"])
        .args(SOURCES)
        .status()
        .is_ok_and(|status| status.success());
    let flags = std::env::var("RUSTFLAGS").unwrap_or_else(|_| "no further flags".into());
    let lines = [
        ("command", command.to_owned()),
        (
            "commit",
            output("git", &["rev-parse", "HEAD"]) + if is_committed { "" } else { " and changes" },
        ),
        ("date", output("date", &["--utc", "+%F"])),
        (
            "machine",
            format!("{}, {} cores{more}", processor("model name").unwrap_or_default(), cores()),
        ),
        ("system", format!("{} {}", kernel("ostype"), kernel("osrelease"))),
        ("compiler", format!("{}, {flags}", output("rustc", &["--version"]))),
    ];
    lines.map(|(what, is)| format!("{what:<8} {is}\n")).concat()
}

/// The short hash of the commit that is checked out, if there is one.
pub fn short_commit() -> Option<String> {
    Some(output("git", &["log", "-1", "--format=%h"])).filter(|hash| !hash.is_empty())
}

fn kernel(what: &str) -> String {
    let text = fs::read_to_string(format!("/proc/sys/kernel/{what}")).unwrap_or_default();
    text.trim().to_owned()
}

/// What a program prints; empty if it is not there or fails.
fn output(program: &str, arguments: &[&str]) -> String {
    said(program, arguments).unwrap_or_default()
}
