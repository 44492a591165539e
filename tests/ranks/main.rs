//! Tests that need MPI. Started without mpirun, this program starts `mpirun -n N` on itself for every
//! case and N, and prints a line for each. At the end it prints `N passed, N failed`. An argument
//! selects the cases whose names contain it. The variable `MPIRUN` names another mpirun, such as
//! `mpirun.mpich`.
//!
//! A case is a function that every rank calls with its end of the communication. It fails by a panic,
//! which ends all ranks. A new case is one function and one line of [`CASES`].

#[path = "../comm/cases.rs"]
mod comm;
#[path = "../support/made_up.rs"]
mod made_up;
mod snapshot;

use dem_mpi::comm::Comm;
use dem_mpi::comm::world::{self, World};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

/// A test case and its numbers of ranks.
struct Case {
    name: &'static str,
    ranks: &'static [u32],
    run: fn(&mut dyn Comm),
}

const CASES: &[Case] = &[
    Case { name: "exchange", ranks: &[1, 2, 4], run: comm::exchange },
    Case { name: "route", ranks: &[1, 2, 4], run: comm::route },
    Case { name: "reductions", ranks: &[1, 2, 4], run: comm::reductions },
    Case { name: "votes", ranks: &[1, 2, 4], run: comm::votes },
    Case { name: "started sums", ranks: &[1, 2, 4], run: comm::started_sums },
    Case { name: "broadcast_and_gather", ranks: &[1, 2, 4], run: comm::broadcast_and_gather },
    Case { name: "snapshot_round_trip", ranks: &[1, 2, 4], run: snapshot::round_trip },
    Case { name: "snapshot_is_collective", ranks: &[1, 2, 4], run: snapshot::is_collective },
    Case { name: "snapshot_rows_by_id", ranks: &[1, 2, 3, 4, 8], run: snapshot::rows_by_id },
    Case { name: "snapshot_errors_agree", ranks: &[1, 2, 4], run: snapshot::errors_agree },
    Case { name: "snapshot_same_as_threads", ranks: &[2, 4], run: snapshot::same_as_threads },
];

/// Time after which a case counts as hanging.
const TIME_LIMIT: Duration = Duration::from_secs(60);

/// Variable with the name of the case, for the ranks that mpirun starts.
const CASE: &str = "DEM_MPI_TEST_CASE";
/// Variable with the number of ranks that mpirun gets.
const RANKS: &str = "DEM_MPI_TEST_RANKS";

fn main() -> ExitCode {
    if world::launched()
        && let Ok(name) = std::env::var(CASE)
    {
        let case = CASES.iter().find(|c| c.name == name).expect("a case of the list");
        let mut world = World::new();
        let asked = std::env::var(RANKS).expect("set with the case");
        // Each rank would pass alone if mpirun belonged to another MPI than this program.
        assert_eq!(world.size().to_string(), asked, "ranks that know of each other");
        (case.run)(&mut world);
        return ExitCode::SUCCESS;
    }
    let wanted = std::env::args().skip(1).find(|a| !a.starts_with('-')).unwrap_or_default();
    let (mut passed, mut failed) = (0, 0);
    for case in CASES.iter().filter(|c| c.name.contains(&wanted)) {
        for &ranks in case.ranks {
            let begin = Instant::now();
            let outcome = start(case, ranks);
            let seconds = begin.elapsed().as_secs_f64();
            let verdict = if outcome.is_ok() { "ok" } else { "FAILED" };
            println!("{} on {ranks} ranks ... {verdict} ({seconds:.1} s)", case.name);
            match outcome {
                Ok(()) => passed += 1,
                Err(why) => {
                    failed += 1;
                    println!("    {why}");
                }
            }
        }
    }
    println!("{passed} passed, {failed} failed");
    if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs a case under mpirun, for any user and number of cores.
fn start(case: &Case, ranks: u32) -> Result<(), String> {
    let this = std::env::current_exe().map_err(|e| format!("who am I? {e}"))?;
    let name = std::env::var("MPIRUN").unwrap_or("mpirun".to_owned());
    let mut mpirun = Command::new(&name)
        .args(["-n", &ranks.to_string()])
        .arg(this)
        .env(CASE, case.name)
        .env(RANKS, ranks.to_string())
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .env("OMPI_MCA_rmaps_base_oversubscribe", "1")
        .env("OMPI_MCA_mpi_yield_when_idle", "1")
        .stdin(Stdio::null())
        .spawn()
        .map_err(|e| format!("{name} cannot be started: {e}"))?;
    let begin = Instant::now();
    loop {
        match mpirun.try_wait() {
            Ok(Some(status)) if status.success() => return Ok(()),
            Ok(Some(status)) => return Err(format!("mpirun: {status}")),
            Ok(None) if begin.elapsed() < TIME_LIMIT => {
                std::thread::sleep(Duration::from_millis(20));
            }
            Ok(None) => {
                // The ranks notice the end of their mpirun and end, too.
                let _ = mpirun.kill();
                let _ = mpirun.wait();
                return Err(format!("hangs: ended after {} s", TIME_LIMIT.as_secs()));
            }
            Err(e) => return Err(format!("mpirun is lost: {e}")),
        }
    }
}
