//! The machine on which something is measured.

use std::fs;
use std::process::Command;

/// Processors that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The load averages of 1, 5 and 15 minutes, the first so many of them.
pub fn load(count: usize) -> String {
    let text = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').take(count).collect::<Vec<_>>().join(" ")
}

/// What the system says of the first processor, such as its `model name`.
pub fn processor(field: &str) -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with(field))?;
    Some(line.split(':').nth(1)?.trim().to_owned())
}

/// What a program prints, if it is there and succeeds.
pub fn said(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}
