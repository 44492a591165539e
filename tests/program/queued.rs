//! A run in jobs of limited time: `run/slurm`, with a minimal substitute for Slurm.

use super::process::{Call, Launch, dem_mpi, signal};
use super::{assert_same_result, fresh_directory, heap_beyond, scene, snapshot};
use dem_mpi::output::snapshot::Reader;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// Slurm's status after it killed a rank because another rank had ended with a non-zero status.
const KILLED: i32 = 137;
/// Steps between snapshots.
const EVERY: u64 = 20;

/// Directory with an `srun` that starts two ranks, and an `scontrol` that records its arguments.
fn slurm(name: &str, ranks_seen: u32) -> PathBuf {
    let directory = fresh_directory(name);
    let srun = format!(
        "#!/bin/sh\n[ \"$1\" != --kill-on-bad-exit=1 ] || shift\n\
         \"${{MPIRUN:-mpirun}}\" -n {ranks_seen} \"$@\"\ns=$?; [ $s -ne 3 ] || s={KILLED}; exit $s\n"
    );
    let scontrol = "#!/bin/sh\necho \"$@\" >> \"$(dirname \"$0\")/asked\"\n";
    for (name, text) in [("srun", &*srun), ("scontrol", scontrol)] {
        let path = directory.join(name);
        fs::write(&path, text).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    }
    directory
}

/// The job that `sbatch` queues.
fn job(slurm: &Path, stage: &str, out: &Path, more: &[&str]) -> Call {
    let path = format!("PATH={}:{}", slurm.display(), std::env::var("PATH").unwrap());
    let program = concat!("DEM_MPI=", env!("CARGO_BIN_EXE_dem-mpi"));
    let variables = ["SLURM_NTASKS=2", "SLURM_JOB_ID=4711", program, &path, "run/slurm"];
    let scene = scene(stage);
    let words = [&variables[..], &[&scene, out.to_str().unwrap()], more].concat();
    Call::new(vec![], "env", words)
}

fn asked(slurm: &Path) -> String {
    fs::read_to_string(slurm.join("asked")).unwrap_or_default()
}

#[test]
fn a_job_is_queued_again_until_all_is_done() {
    let (slurm, out) = (slurm("slurm", 2), fresh_directory("queued"));
    let mut step = 0;
    for jobs in 1..=2 {
        let every = format!("output.snapshot_every={EVERY}");
        // Too long to end by itself.
        let more = ["--set", "time.steps=1_000_000_000", "--set", &every];
        let mut running = job(&slurm, "heap", &out, &more).start();
        let reached = snapshot(&out, (step / EVERY + 5) * EVERY);
        running.until("a snapshot", || reached.exists());
        // Slurm signals all ranks.
        for rank in 0..2 {
            signal(running.rank(rank).expect("the rank runs"), "USR1");
        }
        let ended = running.end();
        assert_eq!(ended.status.code(), Some(KILLED), "{ended}");
        assert_eq!(asked(&slurm), "requeue 4711\n".repeat(jobs), "{ended}");
        step = Reader::open(&out).unwrap().header().step;
    }
    let (steps, whole) = heap_beyond(step);
    let to_the_end = format!("time.steps={steps}");
    let ended = job(&slurm, "heap", &out, &["--set", &to_the_end]).succeed();
    ended.said_once(&format!("steps {step} to {steps}"));
    assert_eq!(asked(&slurm).lines().count(), 2, "{ended}");
    assert_same_result(&whole.directory, &out);
}

/// A stage that follows another can be queued again after the earlier stage's folder is gone. A stage that has
/// ended, or makes no progress, is not queued again.
#[test]
fn a_stage_that_follows_another_is_queued() {
    let (slurm, out) = (slurm("slurm_stage", 2), fresh_directory("queued_stage"));
    let before = fresh_directory("queued_before");
    let to_before = before.to_str().unwrap();
    dem_mpi(Launch::Alone, [&*scene("heap"), "--out", to_before, "--steps", "1500"]).succeed();
    let start = format!("start={to_before}");
    let tilted = |more: &[&str]| {
        let words = [&["--set", &*start], more].concat();
        job(&slurm, "tilted", &out, &words)
    };
    tilted(&["--steps", "100"]).succeed();
    fs::remove_dir_all(&before).unwrap();
    tilted(&[]).succeed().said_once("steps 1600 to 2300");
    tilted(&[]).succeed().said_once("nothing left to do");
    let failed = tilted(&["--set", "shape.ball.radius=0.003"]).end();
    assert_ne!(failed.status.code(), Some(0), "{failed}");
    failed.said_once("no new snapshot, so it is not queued again");
    assert_eq!(asked(&slurm), "");
}

/// A stage that has done its steps without reaching its target ends the chain with its status.
#[test]
fn a_stage_that_falls_short_is_not_queued_again() {
    let (slurm, out) = (slurm("slurm_short", 2), fresh_directory("queued_short"));
    let more = ["--set", "time.steps=50", "--set", "stop.rest=1e-30"];
    for said in ["warning    [stop] was not reached", "nothing left to do"] {
        let ended = job(&slurm, "heap", &out, &more).end();
        assert_eq!(ended.status.code(), Some(4), "{ended}");
        ended.said_once(said);
        ended.said_once("[stop] was not reached, so it is not queued again");
    }
    assert_eq!(asked(&slurm), "");
}

/// Ranks that do not see each other, like under an `srun` of another MPI.
#[test]
fn ranks_that_do_not_see_each_other_do_not_run() {
    let (slurm, out) = (slurm("slurm_apart", 1), fresh_directory("queued_apart"));
    let ended = job(&slurm, "heap", &out, &[]).end();
    assert_eq!(ended.status.code(), Some(2), "{ended}");
    ended.said_once("does not see 2 ranks");
    assert_eq!(out.read_dir().unwrap().count(), 0, "{ended}");
}
