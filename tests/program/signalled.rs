//! A signal ends a run with a snapshot for an identical continuation.

use super::process::{Launch, dem_mpi, kill, mpirun, signal};
use super::{assert_same_result, fresh_directory, heap_beyond, scene, snapshot};
use crate::support::below;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::random::Random;
use std::fmt::Write;
use std::os::unix::process::ExitStatusExt;
use std::time::{Duration, Instant};

/// Exit status of a run that can continue.
const STOPPED: i32 = 3;
/// Steps between snapshots, which set the times of the signals.
const EVERY: u64 = 50;

/// Receiver of the signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum To {
    /// The started program or mpirun.
    Started,
    Rank(u32),
}

#[test]
fn a_signal_ends_a_run_that_can_go_on() {
    const CASES: [(Launch, To, &str, Launch); 7] = [
        (Launch::Alone, To::Started, "TERM", Launch::Ranks(2)),
        (Launch::Alone, To::Started, "INT", Launch::Ranks(2)),
        (Launch::Ranks(1), To::Rank(0), "USR1", Launch::Alone),
        (Launch::Ranks(2), To::Started, "USR1", Launch::Alone),
        (Launch::Ranks(2), To::Rank(1), "TERM", Launch::Ranks(3)),
        (Launch::Ranks(4), To::Started, "TERM", Launch::Alone),
        (Launch::Ranks(4), To::Rank(3), "USR1", Launch::Ranks(4)),
    ];
    for (seed, (launch, to, name, again)) in (0..).zip(CASES) {
        stop(seed, launch, to, name, again);
    }
}

fn stop(seed: u64, launch: Launch, to: To, name: &str, again: Launch) {
    let case = format!("seed {seed}: SIG{name} to {to:?} of {launch:?}");
    let mut random = Random::of(seed, 0);
    let from = EVERY * (1 + below(&mut random, 25));
    let pause = Duration::from_micros(below(&mut random, 100_000));
    let directory = fresh_directory(&format!("signalled_{seed}"));
    let out = directory.to_str().unwrap();
    let heap_scene = &*scene("heap");
    let every = format!("output.snapshot_every={EVERY}");
    // Too long to end by itself.
    let endless = [heap_scene, "--out", out, "--set", "time.steps=1_000_000_000", "--set", &every];
    let mut running = dem_mpi(launch, endless).start();
    let first = snapshot(&directory, from);
    running.until("a snapshot", || first.exists());
    std::thread::sleep(pause);
    let process = match to {
        To::Started => running.id(),
        To::Rank(rank) => running.rank(rank).expect("the rank runs"),
    };
    signal(process, name);
    let ended = running.end();
    let newest = Reader::open(&directory).unwrap().header().step;
    // mpirun passes the signal on. Open MPI's mpirun then ends in its own way after SIGTERM, and MPICH's after any
    // signal.
    let is_mpich = mpirun().to_string_lossy().contains("mpich");
    let in_its_own_way =
        to == To::Started && launch != Launch::Alone && (is_mpich || name == "TERM");
    if in_its_own_way {
        assert!(is_mpich || ended.status.code() != Some(0), "{case}: {ended}");
    } else {
        assert_eq!(ended.status.code(), Some(STOPPED), "{case}: {ended}");
        ended.said_once(&format!("stopped by SIG{name} at step {newest}; to continue: dem-mpi "));
        ended.said_once(&format!("{EVERY} --out {out} --start {out}/particles_{newest:09}.vtkhdf"));
    }
    assert!(newest >= from, "{case}: {ended}");
    let (steps, whole) = heap_beyond(newest);
    let to_the_end = format!("time.steps={steps}");
    dem_mpi(again, [heap_scene, "--out", out, "--start", out, "--set", &to_the_end]).succeed();
    assert_same_result(&whole.directory, &directory);
}

/// A second run into the same directory is rejected while the first one lives, however the first ends.
#[test]
fn two_runs_do_not_share_a_directory() {
    let directory = fresh_directory("shared");
    let out = directory.to_str().unwrap();
    let heap_scene = &*scene("heap");
    let every = format!("output.snapshot_every={EVERY}");
    let endless = [heap_scene, "--out", out, "--set", "time.steps=1_000_000_000", "--set", &every];
    let mut first = dem_mpi(Launch::Alone, endless).start();
    let written = snapshot(&directory, EVERY);
    first.until("a snapshot", || written.exists());

    let second = dem_mpi(Launch::Ranks(2), endless).end();
    assert_eq!(second.status.code(), Some(2), "{second}");
    second.said_once(&format!("another run is writing to {out}"));

    kill(first.id());
    first.end();
    let go_on = [heap_scene, "--out", out, "--start", out, "--steps", "10"];
    dem_mpi(Launch::Ranks(2), go_on).succeed();
}

/// The search for cells behind many triangles takes seconds before the first step. A signal ends it, and nothing is
/// written.
#[test]
fn a_signal_ends_the_preparation_at_once() {
    let directory = fresh_directory("signalled_before");
    std::fs::create_dir_all(&directory).unwrap();
    let squares = 300;
    let mut mesh = String::new();
    for k in 0..=squares {
        for l in 0..=squares {
            let height = 1e-4 * f64::from((7 * k * k + 3 * l + k * l) % 11);
            writeln!(mesh, "v {} {} {height}", 2e-3 * f64::from(k), 2e-3 * f64::from(l)).unwrap();
        }
    }
    for k in 0..squares {
        for l in 1..=squares {
            let (a, b) = (k * (squares + 1) + l, (k + 1) * (squares + 1) + l);
            writeln!(mesh, "f {a} {b} {}\nf {a} {} {}", b + 1, b + 1, a + 1).unwrap();
        }
    }
    std::fs::write(directory.join("terrain.obj"), mesh).unwrap();
    let scene = directory.join("scene.toml");
    std::fs::write(&scene, TERRAIN).unwrap();
    let out = directory.join("out");
    let [scene, out] = [&scene, &out].map(|path| path.to_str().unwrap());
    let cases: [(&[&str], _, _); 4] = [
        (&[scene, "--check"], "TERM", 15),
        (&[scene, "--plan"], "INT", 2),
        (&[scene, "--out", out], "USR1", 10),
        (&[scene, "--out", out], "TERM", 15),
    ];
    for (arguments, name, number) in cases {
        let running = dem_mpi(Launch::Alone, arguments.iter().copied()).start();
        std::thread::sleep(Duration::from_millis(300));
        let sent = Instant::now();
        signal(running.id(), name);
        let ended = running.end();
        assert_eq!(ended.status.signal(), Some(number), "{arguments:?} {name}: {ended}");
        assert!(sent.elapsed() < Duration::from_secs(2), "{arguments:?} {name}");
    }
    assert!(Reader::open(&directory.join("out")).is_err());
}

const TERRAIN: &str = "\
gravity = [0, 0, -9.81]
[domain]
low = [-0.1, -0.1, -0.1]
high = [0.7, 0.7, 0.3]
[[wall]]
name = 'terrain'
mesh = 'terrain.obj'
[[material]]
name = 'stone'
density = 2500.0
normal_stiffness = 1e5
[[shape]]
name = 'box'
kind = 'polyhedron'
edges = [0.06, 0.06, 0.06]
[[fill.lattice]]
first = [0.1, 0.1, 0.1]
count = [3, 3, 1]
[time]
step = 'auto'
steps = 10
";
