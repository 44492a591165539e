//! A rank that dies ends the run, which can continue from its newest snapshot.

use super::process::{Launch, dem_mpi, dem_post, kill};
use super::{assert_same_result, fresh_directory, heap_beyond, scene, snapshot};
use crate::support::below;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::random::Random;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// Time limit after the death of a rank; a run that takes longer waits for the dead rank.
const AT_MOST: Duration = Duration::from_secs(10);
/// Default number of kills; `DEM_MPI_KILLS=50` sets another.
const KILLS: u64 = 4;
/// Default seed of the first kill; `DEM_MPI_KILL_SEED` sets another.
const SEED: u64 = 100;
/// Steps between snapshots, few enough that many kills hit the writing of one.
const EVERY: u64 = 20;

#[test]
fn killed_at_any_moment_a_run_goes_on_from_its_newest_snapshot() {
    let number = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |text| text.parse().expect("a number"))
    };
    let (kills, first) = (number("DEM_MPI_KILLS", KILLS), number("DEM_MPI_KILL_SEED", SEED));
    let (mut while_writing, mut partial, mut slowest) = (0, 0, Duration::ZERO);
    for seed in first..first + kills {
        println!("kill of seed {seed}");
        let killed = kill_a_rank(seed);
        while_writing += u64::from(killed.while_writing);
        partial += u64::from(killed.left_partial);
        slowest = slowest.max(killed.ended_after);
    }
    println!(
        "{kills} kills, {while_writing} aimed at the writing of a snapshot, {partial} left half of one; \
         0 lost, 0 hung, slowest end {slowest:?}"
    );
}

/// Snapshots by the wall clock, in a run that has no others; a killed run goes on from one of them with equal bits.
#[test]
fn snapshots_by_the_clock() {
    let directory = fresh_directory("clocked");
    let out = directory.to_str().unwrap();
    let heap_scene = &*scene("heap");
    let [endless, every, minutes] = [
        "time.steps=1_000_000_000",
        "output.snapshot_every=0",
        "output.snapshot_every_minutes=0.004",
    ];
    let set = ["--out", out, "--set", endless, "--set", every, "--set", minutes];
    let mut running = dem_mpi(Launch::Ranks(2), [&[heap_scene], &set[..]].concat()).start();
    let newest = || Reader::open(&directory).ok().map(|reader| reader.header().step);
    running.until("a snapshot after the first", || newest() > Some(0));
    let first = newest();
    running.until("the next one", || newest() > first);
    kill(running.rank(1).expect("the rank runs"));
    running.end();
    let (steps, whole) = heap_beyond(newest().unwrap());
    let to_the_end = format!("time.steps={steps}");
    let go_on = [heap_scene, "--out", out, "--start", out, "--set", &to_the_end];
    dem_mpi(Launch::Alone, go_on).succeed();
    assert_same_result(&whole.directory, &directory);
}

struct Killed {
    while_writing: bool,
    left_partial: bool,
    ended_after: Duration,
}

fn kill_a_rank(seed: u64) -> Killed {
    let mut random = Random::of(seed, 0);
    let mut below = |limit| below(&mut random, limit);
    let ranks = 2 + below(3) as u32;
    let victim = below(u64::from(ranks)) as u32;
    let from = EVERY * (1 + below(60));
    let pause = Duration::from_micros(below(40_000));
    let while_writing = below(2) == 0;
    let damaged = below(3) == 0;
    let again = [Launch::Alone, Launch::Ranks(1), Launch::Ranks(3)][below(3) as usize];

    let directory = fresh_directory(&format!("killed_{seed}"));
    let out = directory.to_str().unwrap();
    let heap_scene = &*scene("heap");
    let every = format!("output.snapshot_every={EVERY}");
    // Too long to end by itself.
    let running = [heap_scene, "--out", out, "--set", "time.steps=1_000_000_000", "--set", &every];
    let mut running = dem_mpi(Launch::Ranks(ranks), running).start();
    let newest = snapshot(&directory, from);
    running.until("its snapshot", || newest.exists());
    let process = running.rank(victim).expect("the rank runs");
    if while_writing {
        // Waits for the beginning of a write, then for a random time within it.
        let begin = Instant::now();
        while partial_files(&directory) == 0 && begin.elapsed() < AT_MOST {}
        std::thread::sleep(pause / 8);
    } else {
        std::thread::sleep(pause);
    }
    kill(process);
    let killed = Instant::now();
    let ended = running.end();
    let ended_after = killed.elapsed();
    assert!(ended_after < AT_MOST, "seed {seed}: {ended}");
    assert_ne!(ended.status.code(), Some(0), "seed {seed}: {ended}");
    let left_partial = partial_files(&directory) > 0;

    // The newest snapshot is complete and leads to the result of the undisturbed run, and so does the
    // previous one.
    dem_post([out]).succeed().said_once("page: ");
    let newest = Reader::open(&directory).unwrap();
    newest.verify().unwrap();
    assert_eq!(newest.passed_over(), [], "seed {seed}");
    let step = newest.header().step;
    assert!(step >= from, "seed {seed}");
    if damaged {
        let bytes = fs::read(newest.path()).unwrap();
        fs::write(newest.path(), &bytes[..bytes.len() / 3]).unwrap();
    }
    let (steps, whole) = heap_beyond(step);
    let to_the_end = format!("time.steps={steps}");
    let ended =
        dem_mpi(again, [heap_scene, "--out", out, "--start", out, "--set", &to_the_end]).succeed();
    let passed_over = ended.said().matches("skipped: ").count();
    assert_eq!(passed_over, usize::from(damaged), "seed {seed}: {ended}");
    assert_same_result(&whole.directory, &directory);
    fs::remove_dir_all(&directory).unwrap();
    Killed { while_writing, left_partial, ended_after }
}

/// Number of unfinished snapshot files.
fn partial_files(directory: &Path) -> usize {
    let names = fs::read_dir(directory)
        .unwrap()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    names.filter(|name| name.ends_with(".vtkhdf.partial")).count()
}
