//! A rank that dies ends the run, and the run goes on from its newest snapshot.

use super::process::{Launch, dem_mpi, dem_post, kill};
use super::{HEAP_SNAPSHOTS, assert_same_result, fresh_directory, heap, scene, snapshot};
use std::time::{Duration, Instant};

/// A run that is not ended by now, when a rank was killed, waits for the dead.
const AT_MOST: Duration = Duration::from_secs(10);

#[test]
fn a_killed_rank_of_two_ends_the_run() {
    kill_a_rank(2, 0);
}

#[test]
fn a_killed_rank_of_four_ends_the_run() {
    kill_a_rank(4, 3);
}

fn kill_a_rank(ranks: u32, victim: u32) {
    let whole = heap(Launch::Alone);
    let directory = fresh_directory(&format!("killed_{ranks}"));
    let out = directory.to_str().unwrap();
    let heap_scene = &*scene("heap");

    // Too long to end by itself.
    let endless = [heap_scene, "--out", out, "--set", "time.steps=1_000_000_000"];
    let mut running = dem_mpi(Launch::Ranks(ranks), endless).start();
    let first = snapshot(&directory, HEAP_SNAPSHOTS[1]);
    running.until("its first snapshot", || first.exists());
    kill(running.rank(victim).expect("the rank runs"));
    let killed = Instant::now();
    let ended = running.end();
    assert!(killed.elapsed() < AT_MOST, "{ended}");
    assert_ne!(ended.status.code(), Some(0), "{ended}");

    // The newest snapshot is whole, and leads to where the undisturbed run came.
    dem_post([out]).succeed().said_once("page: ");
    dem_mpi(Launch::Ranks(ranks + 1), [heap_scene, "--out", out, "--start", out]).succeed();
    assert_same_result(&whole.directory, &directory);
}
