//! Counted cost of a step on each rank: the same on threads of one process as under MPI.

use dem_mpi::comm::{Comm, Parcel, Source};
use dem_mpi::ids::Rank;
use dem_mpi::sim::Simulation;

/// A wrapper of a rank's communication that counts messages, bytes and reductions.
struct Counted<'a> {
    comm: &'a mut dyn Comm,
    messages: u64,
    bytes: u64,
    reductions: u64,
}

impl Counted<'_> {
    fn count(&mut self, outgoing: &[Parcel]) {
        self.messages += outgoing.len() as u64;
        self.bytes += outgoing.iter().map(|parcel| parcel.bytes.len() as u64).sum::<u64>();
    }
}

impl Comm for Counted<'_> {
    fn rank(&self) -> Rank {
        self.comm.rank()
    }

    fn size(&self) -> u32 {
        self.comm.size()
    }

    fn start(&mut self, outgoing: Vec<Parcel>, sources: &[Source]) {
        self.count(&outgoing);
        self.comm.start(outgoing, sources);
    }

    fn finish(&mut self) -> Vec<Parcel> {
        self.comm.finish()
    }

    fn route(&mut self, outgoing: Vec<Parcel>) -> Vec<Parcel> {
        self.count(&outgoing);
        self.reductions += 1;
        self.comm.route(outgoing)
    }

    fn sum(&mut self, values: &mut [i64]) {
        self.reductions += 1;
        self.comm.sum(values);
    }

    fn max(&mut self, values: &mut [f64]) {
        self.reductions += 1;
        self.comm.max(values);
    }

    fn start_sum(&mut self, values: Vec<i64>) {
        self.reductions += 1;
        self.comm.start_sum(values);
    }

    fn finish_sum(&mut self) -> Vec<i64> {
        self.comm.finish_sum()
    }

    fn broadcast(&mut self, bytes: &mut Vec<u8>) {
        self.reductions += 1;
        self.comm.broadcast(bytes);
    }

    fn gather(&mut self, bytes: Vec<u8>) -> Option<Vec<Vec<u8>>> {
        self.reductions += 1;
        self.comm.gather(bytes)
    }

    fn abort(&self, status: i32) -> ! {
        self.comm.abort(status)
    }
}

/// Names of the counts, in the order of [`Counts`].
pub(crate) const NAMES: [&str; 11] = [
    "particles",
    "ghosts",
    "contacts",
    "listed_pairs",
    "halo_messages",
    "halo_bytes",
    "messages",
    "bytes",
    "reductions",
    "migrated",
    "lists",
];
pub(crate) const PARTICLES: usize = 0;
pub(crate) const GHOSTS: usize = 1;
pub(crate) const CONTACTS: usize = 2;
pub(crate) const MESSAGES: usize = 6;
pub(crate) const BYTES: usize = 7;
pub(crate) const REDUCTIONS: usize = 8;
pub(crate) const MIGRATED: usize = 9;

/// Counts of one rank, per step. Messages and bytes are those sent: halo, offers of ghosts,
/// hand-over.
pub(crate) type Counts = [f64; NAMES.len()];

/// Counts this number of steps on this rank. Collective.
pub(crate) fn count(sim: &mut Simulation, steps: u32, comm: &mut dyn Comm) -> Counts {
    let mut comm = Counted { comm, messages: 0, bytes: 0, reductions: 0 };
    let (traffic, tally) = (sim.domain.traffic, sim.found.tally);
    let (mut particles, mut ghosts) = (0, 0);
    for _ in 0..steps {
        sim.step(&mut comm).expect("the step is done");
        particles += sim.particles.owned;
        ghosts += sim.particles.ghosts;
    }
    let now = (sim.domain.traffic, sim.found.tally);
    [
        particles as u64,
        ghosts as u64,
        now.1.contacts - tally.contacts,
        now.1.listed - tally.listed,
        now.0.messages - traffic.messages,
        now.0.bytes - traffic.bytes,
        comm.messages,
        comm.bytes,
        comm.reductions,
        now.0.migrated - traffic.migrated,
        now.0.rebuilds - traffic.rebuilds,
    ]
    .map(|count| count as f64 / f64::from(steps))
}

/// Counts of all ranks of a run.
pub(crate) struct Run {
    pub(crate) scene: &'static str,
    pub(crate) ranks: Vec<Counts>,
}

impl Run {
    pub(crate) fn total(&self, which: usize) -> f64 {
        self.ranks.iter().map(|counts| counts[which]).sum()
    }

    pub(crate) fn mean(&self, which: usize) -> f64 {
        self.total(which) / self.ranks.len() as f64
    }

    pub(crate) fn most(&self, which: usize) -> f64 {
        self.ranks.iter().map(|counts| counts[which]).fold(0.0, f64::max)
    }
}
