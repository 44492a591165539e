//! The programs from the command line: with and without mpirun, stopped, killed, with wrong input.

mod analysed;
mod compared;
mod folders;
mod full_disk;
mod killed;
mod linked;
mod memory;
mod misled;
mod opened;
mod other_machines;
mod process;
mod queued;
mod ready;
mod reported;
mod restarted;
mod results;
mod same_bits;
mod scaled;
mod signalled;
mod stopped;
mod suggested;
mod sweep;
mod told;
mod traced;
mod watched;

use crate::support::completed;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::output::tables::{ContactTable, ParticleTable};
use process::{Ended, Launch, dem_mpi, dem_post};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Path of a scene of these tests, by name.
fn scene(name: &str) -> String {
    format!("{}/tests/program/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

/// Scene of one ball that ends at the first step.
const OVER_AT_ONCE: &str = r#"
[domain]
low = [0, 0, 0]
high = [1, 1, 1]
[[fill.lattice]]
first = [0.5, 0.5, 0.5]
count = [1, 1, 1]
[[outlet]]
name = "below"
point = [0, 0, 0.1]
normal = [0, 0, 1]
[stop]
remaining = 5
[time]
step = 1e-5
steps = 50
"#;

/// Writes a scene file into a folder, completed with the required tables, and returns its path.
fn written(folder: &Path, text: &str) -> String {
    let path = folder.join("scene.toml");
    fs::write(&path, completed(text)).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Number of steps of the heap, and the steps of its earlier snapshots.
const HEAP_STEPS: u64 = 3000;
const HEAP_SNAPSHOTS: [u64; 3] = [0, 1000, 2000];

/// An empty directory, kept after the test for inspection of a failure.
fn fresh_directory(name: &str) -> PathBuf {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("program").join(name);
    if directory.exists() {
        fs::remove_dir_all(&directory).expect("what an earlier run left can be removed");
    }
    fs::create_dir_all(&directory).expect("a directory can be made");
    directory
}

fn snapshot(directory: &Path, step: u64) -> PathBuf {
    directory.join(dem_mpi::output::snapshot::particles_name(step))
}

/// A run from beginning to end.
struct Finished {
    directory: PathBuf,
    ended: Ended,
}

/// The whole heap, run once in all tests for each way to start it.
fn heap(launch: Launch) -> Arc<Finished> {
    static RUNS: Mutex<BTreeMap<Launch, Arc<Finished>>> = Mutex::new(BTreeMap::new());
    let mut runs = RUNS.lock().unwrap_or_else(PoisonError::into_inner);
    let run = || Arc::new(finished("heap", launch));
    Arc::clone(runs.entry(launch).or_insert_with(run))
}

/// Number of steps and result of a heap that ends after the given step. It is the usual heap, or one with 100 steps
/// more than `step`.
fn heap_beyond(step: u64) -> (u64, Arc<Finished>) {
    if step < HEAP_STEPS {
        return (HEAP_STEPS, heap(Launch::Alone));
    }
    let steps = step + 100;
    let directory = fresh_directory(&format!("heap_{steps}"));
    let (scene, out) = (scene("heap"), directory.to_str().unwrap());
    let to_the_end = format!("time.steps={steps}");
    let ended = dem_mpi(Launch::Alone, [&*scene, "--out", out, "--set", &to_the_end]).succeed();
    (steps, Arc::new(Finished { directory, ended }))
}

/// Runs a scene from its beginning to its end.
fn finished(name: &str, launch: Launch) -> Finished {
    let directory = fresh_directory(&format!("{name}_{launch:?}"));
    let arguments = [scene(name).into(), "--out".into(), directory.clone().into_os_string()];
    let ended = dem_mpi(launch, arguments).succeed();
    Finished { directory, ended }
}

/// Checks that the newest snapshots of two directories are equal bit for bit, and the tables byte for byte.
fn assert_same_result(directory: &Path, other: &Path) {
    dem_post(["--diff".as_ref(), directory.as_os_str(), other.as_os_str()])
        .succeed()
        .said_once("equal bit for bit");
    assert!(tables(directory) == tables(other), "rows stand in other places");
    let [table, of_other] = [directory, other].map(history);
    if table != of_other {
        let differ = table.lines().zip(of_other.lines()).find(|(a, b)| a != b);
        let (rows, of_other) = (table.lines().count(), of_other.lines().count());
        panic!("history.csv: {rows} and {of_other} lines, first difference {differ:#?}");
    }
}

/// Particles and contacts of the newest snapshot in the row order of its files, without the rank numbers.
fn tables(directory: &Path) -> (ParticleTable, ContactTable) {
    let reader = Reader::open(directory).unwrap();
    let particles = reader.particles(0..reader.particle_count()).unwrap();
    let contacts = reader.contacts(0..reader.contact_count().unwrap()).unwrap();
    (ParticleTable { rank: Vec::new(), ..particles }, contacts)
}

/// The text of a run's table.
fn history(directory: &Path) -> String {
    let path = directory.join("history.csv");
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The report of a run.
fn report(directory: &Path) -> serde_json::Value {
    let path = directory.join("report.json");
    let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A column of a run's table, by step.
fn column(directory: &Path, name: &str) -> BTreeMap<u64, f64> {
    let text = history(directory);
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = rows.next().expect("a header");
    let index = names.iter().position(|&n| n == name).unwrap_or_else(|| panic!("no {name}"));
    rows.map(|row| (row[0].parse().unwrap(), row[index].parse().unwrap())).collect()
}
