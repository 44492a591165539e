//! Record of a part of the study: its files, with their origin in `machine.txt`.

use anyhow::{Context, Result};
use benchmarking::machine::{cores, processor, said};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Writes these files, given by names and contents, into a folder, which is created.
///
/// # Errors
/// If a file cannot be written, with its path.
pub fn store(folder: &Path, files: &[(String, String)]) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    for (name, text) in files {
        let path = folder.join(name);
        fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// Sources that determine the numbers: changes since the commit are reported.
const SOURCES: [&str; 6] =
    ["src", "run", "benchmarks/lai2021", ".cargo", "Cargo.toml", "Cargo.lock"];

/// Text of `machine.txt`: command, commit, date, machine, `more` on the machine, and compiler.
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

/// Short hash of the commit that is checked out, if there is one.
pub fn short_commit() -> Option<String> {
    Some(output("git", &["log", "-1", "--format=%h"])).filter(|hash| !hash.is_empty())
}

fn kernel(what: &str) -> String {
    let text = fs::read_to_string(format!("/proc/sys/kernel/{what}")).unwrap_or_default();
    text.trim().to_owned()
}

/// Output of a program; empty if it is missing or fails.
fn output(program: &str, arguments: &[&str]) -> String {
    said(program, arguments).unwrap_or_default()
}
