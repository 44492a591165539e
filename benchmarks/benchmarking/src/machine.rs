//! The machine on which a benchmark runs.

use std::fs;
use std::process::Command;

/// Number of processors that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The first `count` of the load averages of 1, 5 and 15 minutes.
pub fn load(count: usize) -> String {
    let text = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').take(count).collect::<Vec<_>>().join(" ")
}

/// A field of the system's description of the first processor, such as its `model name`.
pub fn processor(field: &str) -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with(field))?;
    Some(line.split(':').nth(1)?.trim().to_owned())
}

/// Output of a program, if it exists and succeeds.
pub fn said(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
