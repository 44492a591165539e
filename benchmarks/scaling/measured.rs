//! Measurements under mpirun, started by this program on itself: the wall time of steps, and of a
//! snapshot beside a plain write of the same size.

use crate::packing::{CELL, Packing, settled};
use anyhow::{Context, ensure};
use benchmarking::median;
use clap::ValueEnum;
use dem_mpi::comm::Comm;
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::world::World;
use dem_mpi::output::snapshot;
use dem_mpi::timing::Phase;
use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

/// Tasks of the ranks of mpirun.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Task {
    /// Steps of 5,120 settled ellipsoids.
    Settled,
    /// Steps of 10,000 packed ellipsoids.
    Packed10,
    /// Steps of 20,000 packed ellipsoids.
    Packed20,
    /// Steps of 10,000 packed ellipsoids on each rank; the ranks share only the machine.
    Apart,
    /// Snapshots of 1,000,000 packed ellipsoids, and plain writes.
    Snapshot,
}

impl Task {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Settled => "settled",
            Self::Packed10 | Self::Packed20 => "packed",
            Self::Apart => "apart",
            Self::Snapshot => "snapshot",
        }
    }

    /// Number of cells along the axes.
    const fn cells(self) -> [u32; 3] {
        match self {
            Self::Settled => [0; 3],
            Self::Packed10 | Self::Apart => [5, 2, 1],
            Self::Packed20 => [5, 2, 2],
            Self::Snapshot => [10; 3],
        }
    }
}

/// Number of timed rounds, of which the fastest counts: other processes may use the machine.
const ROUNDS: u32 = 8;
/// Particles times steps of a round.
const ROUND: usize = 2_000_000;
const SNAPSHOTS: u32 = 5;
/// Bytes per call of a plain write.
const CHUNK: usize = 8 << 20;

/// Times of steps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Timed {
    pub(crate) particles: f64,
    /// Wall time of a step [s].
    pub(crate) step: f64,
    /// Time of motion and pair list per particle in the fastest round, on rank 0 [s].
    pub(crate) particle: f64,
    /// Time of resolution and force per contact in the fastest round, on rank 0 [s].
    pub(crate) contact: f64,
    /// Time of each of [`PHASES`] per step in the fastest round, mean over the ranks [s].
    pub(crate) phases: [f64; PHASES.len()],
}

/// Phases of a step.
pub(crate) const PHASES: [Phase; 6] =
    [Phase::Move, Phase::Agree, Phase::Rebuild, Phase::Exchange, Phase::Contacts, Phase::Forces];

/// Median times of a snapshot and of a plain write.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Written {
    pub(crate) bytes: f64,
    /// Time from the simulation to files on the disk under their final names [s].
    pub(crate) snapshot: f64,
    /// Time of writing the same bytes by as many processes, each to a new file of its own [s].
    pub(crate) plain: f64,
}

/// Starts mpirun and returns the numbers printed by rank 0.
fn start<const N: usize>(task: Task, ranks: u32) -> anyhow::Result<[f64; N]> {
    let name = task.to_possible_value().expect("a task has a name");
    let output = Command::new("timeout")
        .args(["600", "mpirun", "-n", &ranks.to_string()])
        .arg(std::env::current_exe()?)
        .args(["--task", name.get_name()])
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .context("mpirun cannot be started")?;
    let text = String::from_utf8_lossy(&output.stdout);
    ensure!(output.status.success(), "mpirun -n {ranks}: {}\n{text}", output.status);
    let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    let numbers = numbers.with_context(|| format!("mpirun -n {ranks} printed: {text}"))?;
    ensure!(numbers.len() == N, "mpirun -n {ranks} printed: {text}");
    Ok(std::array::from_fn(|k| numbers[k]))
}

/// Times steps on this number of ranks.
pub(crate) fn steps(task: Task, ranks: u32) -> anyhow::Result<Timed> {
    let [particles, step, particle, contact, phases @ ..] =
        start::<{ 4 + PHASES.len() }>(task, ranks)?;
    Ok(Timed { particles, step, particle, contact, phases })
}

/// Times snapshots on this number of ranks.
pub(crate) fn snapshots(ranks: u32) -> anyhow::Result<Written> {
    let [bytes, snapshot, plain] = start(Task::Snapshot, ranks)?;
    Ok(Written { bytes, snapshot, plain })
}

/// Runs the task on each rank of mpirun. Rank 0 prints.
pub(crate) fn work(task: Task) -> anyhow::Result<()> {
    let mut comm = World::new();
    let numbers = match task {
        Task::Snapshot => time_snapshots(task, &mut comm)?.to_vec(),
        Task::Apart => time_steps(task, &mut Alone::default(), Some(&mut comm))?.to_vec(),
        _ => time_steps(task, &mut comm, None)?.to_vec(),
    };
    if comm.is_root() {
        println!("{}", numbers.iter().map(|x| format!("{x:e}")).collect::<Vec<_>>().join(" "));
    }
    Ok(())
}

/// Times steps on the ranks of `comm`, each round at the same time as `others`.
fn time_steps(
    task: Task,
    comm: &mut dyn Comm,
    mut others: Option<&mut World>,
) -> anyhow::Result<[f64; 4 + PHASES.len()]> {
    let meet = |comm: &mut dyn Comm, others: &mut Option<&mut World>| match others {
        Some(others) => others.any(false),
        None => comm.any(false),
    };
    let mut sim = match task {
        Task::Settled => settled(comm),
        _ => Packing::new()?.begun(task.cells(), comm),
    };
    let mut total = [sim.particles.owned as i64];
    comm.sum(&mut total);
    let particles = total[0] as usize;
    let steps = ROUND / particles;
    let mut best = [0.0; 4 + PHASES.len()];
    best[..2].copy_from_slice(&[particles as f64, f64::INFINITY]);
    for _ in 0..ROUNDS {
        let contacts = sim.found.tally.contacts;
        let clock = sim.clock.clone();
        meet(comm, &mut others);
        let begin = Instant::now();
        for _ in 0..steps {
            sim.step(comm)?;
        }
        meet(comm, &mut others);
        let step = begin.elapsed().as_secs_f64() / steps as f64;
        let since = |phase: Phase| sim.clock.seconds(phase) - clock.seconds(phase);
        let mut nanoseconds = PHASES.map(|phase| (1e9 * since(phase)) as i64);
        let ranks = if let Some(others) = &mut others {
            others.sum(&mut nanoseconds);
            others.size()
        } else {
            comm.sum(&mut nanoseconds);
            comm.size()
        };
        if step < best[1] {
            let spent = |phases: &[Phase]| phases.iter().map(|&phase| since(phase)).sum::<f64>();
            let contacts = sim.found.tally.contacts - contacts;
            let slots = (sim.particles.owned + sim.particles.ghosts) * steps;
            let of_particle = [Phase::Move, Phase::Rebuild, Phase::Exchange, Phase::Agree];
            best[1..4].copy_from_slice(&[
                step,
                spent(&of_particle) / slots as f64,
                spent(&[Phase::Contacts, Phase::Forces]) / contacts as f64,
            ]);
            best[4..].copy_from_slice(
                &nanoseconds.map(|ns| 1e-9 * ns as f64 / (steps as f64 * f64::from(ranks))),
            );
        }
    }
    Ok(best)
}

fn time_snapshots(task: Task, comm: &mut dyn Comm) -> anyhow::Result<[f64; 3]> {
    let sim = Packing::new()?.begun(task.cells(), comm);
    ensure!(sim.next_id == 1000 * u64::from(CELL), "a million");
    let folder = Path::new("target/scaling/snapshots");
    let mut share = Vec::new();
    let mut times = [Vec::new(), Vec::new()];
    for round in 0..=SNAPSHOTS {
        comm.any(false);
        let begin = Instant::now();
        let header = sim.header("", &[], comm);
        let (particles, contacts) = (sim.particle_table(comm.rank()), sim.contact_table());
        let histories = sim.contact_records();
        let path = snapshot::write(folder, &header, &particles, &contacts, &histories, comm)?;
        comm.any(false);
        let spent = begin.elapsed().as_secs_f64();
        if round == 0 {
            // An extra snapshot, not timed: its bytes are read now.
            for path in [&path, &folder.join(snapshot::contacts_name(header.step))] {
                share.extend(part_of(path, comm)?);
            }
        } else {
            times[0].push(spent);
        }
        comm.any(false);
        if comm.is_root() {
            fs::remove_dir_all(folder)?;
            fs::create_dir(folder)?;
        }
        if round < SNAPSHOTS {
            times[1].push(time_plain(
                &folder.join(format!("plain_{}", comm.rank().0)),
                &share,
                comm,
            )?);
        }
    }
    comm.any(false);
    if comm.is_root() {
        fs::remove_dir_all(folder)?;
    }
    let mut bytes = [share.len() as i64];
    comm.sum(&mut bytes);
    let bytes = bytes[0] as f64;
    let [snapshot, plain] =
        times.map(|mut times| if times.is_empty() { 0.0 } else { median(&mut times) });
    Ok([bytes, snapshot, plain])
}

/// This rank's share of the bytes of a file.
fn part_of(path: &Path, comm: &dyn Comm) -> anyhow::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    let end = |rank: u64| length * rank / u64::from(comm.size());
    let (from, to) = (end(u64::from(comm.rank().0)), end(u64::from(comm.rank().0) + 1));
    file.seek(SeekFrom::Start(from))?;
    let mut bytes = Vec::new();
    file.take(to - from).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Time in which all ranks write their shares, each into a file of its own [s].
fn time_plain(path: &Path, share: &[u8], comm: &mut dyn Comm) -> anyhow::Result<f64> {
    comm.any(false);
    let begin = Instant::now();
    let mut file = File::create(path)?;
    for chunk in share.chunks(CHUNK) {
        file.write_all(chunk)?;
    }
    file.sync_all()?;
    comm.any(false);
    let spent = begin.elapsed().as_secs_f64();
    fs::remove_file(path)?;
    Ok(spent)
}
