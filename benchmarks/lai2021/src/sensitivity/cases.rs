//! Packings and tests, `jobs` at a time, on one core each. Finished ones are not run again; interrupted ones
//! continue.

use crate::record::store;
use crate::simulation::{Signals, program, run};
use crate::triaxial::Method;
use crate::triaxial::stages::Words;
use anyhow::{Result, bail, ensure};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::Mutex;

/// A packing or a test; its name is used for its folder and in tables.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// Method of contact resolution.
    pub method: Method,
    /// First erosion ratio; 0 without erosion.
    pub ratio: &'static str,
    /// Stiffness of contacts [N/m].
    pub stiffness: &'static str,
    /// Seed of the packing.
    pub seed: u64,
}

impl Case {
    /// Name, with `between` between its parts.
    pub fn name(&self, between: &str) -> String {
        let Self { method, ratio, stiffness, seed } = self;
        [method.folder(), ratio, stiffness, &seed.to_string()].join(between)
    }
}

/// Calls `act` for each item, as soon as one of `jobs` threads is free. The first failure ends the others.
///
/// # Errors
/// The first error of `act`.
pub fn each<T: Sync>(
    jobs: u32,
    all: &[T],
    signals: &Signals,
    act: impl Fn(&T) -> Result<()> + Sync,
) -> Result<()> {
    let next = Mutex::new(all.iter());
    let first = Mutex::new(None);
    let work = || {
        loop {
            let Some(one) = next.lock().ok().and_then(|mut next| next.next()) else { return };
            if let Err(error) = act(one) {
                // No item is begun any more, and active runs write a snapshot.
                if let (Ok(mut next), Ok(mut first)) = (next.lock(), first.lock()) {
                    *next = [].iter();
                    first.get_or_insert(error);
                }
                signals.stop();
                return;
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(work);
        }
    });
    match first.into_inner() {
        Ok(None) => Ok(()),
        Ok(Some(error)) => Err(error),
        Err(_) => bail!("a thread has failed"),
    }
}

/// Simulates the rain of particles until they are at rest, in this folder.
///
/// # Errors
/// If the folder has a run with other arguments, or a run fails or is stopped.
pub fn settle(folder: &Path, words: &Words, signals: &Signals) -> Result<()> {
    let known = fs::read_to_string(folder.join("words")).ok();
    ensure!(
        known.is_none_or(|known| known.trim_end() == words.line()),
        "{} is of a run with other words: give --out another folder, or remove it",
        folder.display()
    );
    if folder.join("done").exists() {
        return Ok(());
    }
    store(folder, &[("words".into(), words.line() + "\n")])?;
    println!("{}", folder.display());
    let mut command = Command::new(program("dem-mpi")?);
    command.arg("run/paper/triaxial/packing.toml").arg("--out").arg(folder);
    command.args(words.arguments());
    if folder.join("last.vtkhdf").exists() {
        command.arg("--start").arg(folder);
    }
    run(command, &folder.display().to_string(), &folder.join("run.log"), false, signals)?;
    store(folder, &[("done".into(), String::new())])
}
