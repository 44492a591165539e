//! Library of the benchmarks: particles of a scene, solids, line plots, medians, tasks on all cores, the machine, runs of the
//! program.

pub mod grains;
pub mod lines;
pub mod machine;
pub mod solids;

use anyhow::ensure;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Sorts at least one value and returns the median; for an even count the upper one.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Quartiles and median between them, interpolated. There must be at least one value.
pub fn quartiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_unstable_by(f64::total_cmp);
    let last = (values.len() - 1) as f64;
    [0.25, 0.5, 0.75].map(|part| {
        let at = part * last;
        let (low, high) = (values[at.floor() as usize], values[at.ceil() as usize]);
        low + (high - low) * at.fract()
    })
}

/// Runs `task` on each item with its index, on as many threads as there are cores. Results are in the order of the items.
pub fn in_parallel<T: Sync, R: Send>(items: &[T], task: impl Fn(usize, &T) -> R + Sync) -> Vec<R> {
    let (next, found) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..machine::cores() {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(k) else { break };
                    let answer = task(k, item);
                    found.lock().unwrap_or_else(PoisonError::into_inner).push((k, answer));
                }
            });
        }
    });
    let mut found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
    found.sort_by_key(|(k, _)| *k);
    found.into_iter().map(|(_, answer)| answer).collect()
}

/// Runs a scene on this number of ranks, with keys set to other values; continues an interrupted run.
///
/// # Errors
/// If the program does not start, or fails.
pub fn simulate(
    program: &str,
    scene: &Path,
    out: &Path,
    ranks: u32,
    set: &[&str],
) -> anyhow::Result<()> {
    let mut command = Command::new(program);
    if ranks > 1 {
        command = Command::new(std::env::var("MPIRUN").unwrap_or_else(|_| "mpirun".to_owned()));
        command.args(["-n", &ranks.to_string(), program]);
    }
    command.arg(scene).arg("--out").arg(out);
    if out.join("last.vtkhdf").exists() {
        command.arg("--start").arg(out);
    }
    for value in set {
        command.args(["--set", value]);
    }
    let status = command.status()?;
    ensure!(status.success(), "the run ended with {status}");
    Ok(())
}
