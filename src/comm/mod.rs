//! Communication between ranks: bytes, and a few small reductions.
//!
//! [`Comm`] has three implementations: [`world`] is MPI, [`alone`] is one rank without MPI, and
//! [`threads`] runs ranks as threads of one process, for tests and debugging. Other code does not
//! depend on the implementation, or on the number of ranks.

pub mod alone;
pub mod linked;
pub mod threads;
pub mod wire;
pub mod world;

use crate::ids::Rank;
use serde::{Serialize, de::DeserializeOwned};

/// Bytes to or from a rank.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parcel {
    /// Destination or source.
    pub rank: Rank,
    /// The content.
    pub bytes: Vec<u8>,
}

/// A rank from which one parcel will come, and its size in bytes if that is known beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Source {
    /// Source rank.
    pub rank: Rank,
    /// Number of bytes; `None` to take it from the message.
    pub size: Option<usize>,
}

/// One rank's end of the communication.
///
/// All calls but `start`, `finish` and `abort` are collective: every rank makes them in the same order.
pub trait Comm {
    /// This rank.
    fn rank(&self) -> Rank;

    /// Number of ranks.
    fn size(&self) -> u32;

    /// Starts to send `outgoing` and to receive one parcel from each of `sources`, and returns at once.
    /// A rank sends to exactly those ranks that name it as a source. A parcel to oneself is allowed.
    fn start(&mut self, outgoing: Vec<Parcel>, sources: &[Source]);

    /// Completes [`Comm::start`]. The parcels come in the order of the sources.
    fn finish(&mut self) -> Vec<Parcel>;

    /// Sends parcels to ranks that do not expect them; returns those for this rank, by source. It costs
    /// a reduction over a number per rank, so it is for rare events only.
    fn route(&mut self, outgoing: Vec<Parcel>) -> Vec<Parcel>;

    /// Replaces each value by its sum over all ranks.
    fn sum(&mut self, values: &mut [i64]);

    /// Replaces each value, none of them NaN, by its maximum over all ranks.
    fn max(&mut self, values: &mut [f64]);

    /// Starts to sum each of these values over all ranks, and returns at once. Only one sum may be
    /// under way.
    fn start_sum(&mut self, values: Vec<i64>);

    /// Completes [`Comm::start_sum`] and returns the sums.
    fn finish_sum(&mut self) -> Vec<i64>;

    /// Replaces `bytes` by those of rank 0.
    fn broadcast(&mut self, bytes: &mut Vec<u8>);

    /// The bytes of all ranks, by rank, on rank 0; `None` elsewhere.
    fn gather(&mut self, bytes: Vec<u8>) -> Option<Vec<Vec<u8>>>;

    /// Ends all ranks with this exit status.
    fn abort(&self, status: i32) -> !;

    /// Communicator for HDF5; `None` if there is no MPI.
    fn mpi(&self) -> Option<mpi::ffi::MPI_Comm> {
        None
    }

    /// Is this the rank that prints and writes for all?
    fn is_root(&self) -> bool {
        self.rank() == Rank(0)
    }

    /// Starts a vote whether `here` is true on any rank, and returns at once. No other vote or started
    /// sum may be under way.
    fn start_vote(&mut self, here: bool) {
        self.start_sum(vec![i64::from(here)]);
    }

    /// Completes [`Comm::start_vote`]: is `here` true on any rank?
    fn finish_vote(&mut self) -> bool {
        self.finish_sum().iter().any(|&yes| yes > 0)
    }

    /// Is `here` true on any rank?
    fn any(&mut self, here: bool) -> bool {
        self.start_vote(here);
        self.finish_vote()
    }

    /// Sends `outgoing` and receives from `sources`.
    fn exchange(&mut self, outgoing: Vec<Parcel>, sources: &[Source]) -> Vec<Parcel> {
        self.start(outgoing, sources);
        self.finish()
    }
}

/// The items of all ranks, by rank, on every rank. For rare events only. Collective.
pub fn everywhere<T: Serialize + DeserializeOwned>(comm: &mut dyn Comm, here: &[T]) -> Vec<T> {
    let all = comm.gather(wire::encode(&here)).unwrap_or_default();
    let all: Vec<T> = all.iter().flat_map(|bytes| wire::decode::<Vec<T>>(bytes)).collect();
    let mut bytes = wire::encode(&all);
    comm.broadcast(&mut bytes);
    wire::decode(&bytes)
}

/// Lets all ranks fail if one does, with the error of the lowest rank that failed. It must come before
/// every collective call that a failed rank would not join. Collective.
///
/// # Errors
/// The error of the lowest rank that has one.
pub fn agree<T, E: Serialize + DeserializeOwned>(
    comm: &mut dyn Comm,
    here: Result<T, E>,
) -> Result<T, E> {
    if !comm.any(here.is_err()) {
        return here;
    }
    // A rank without an error sends nothing.
    let mine = here.err().map(|e| wire::encode(&e)).unwrap_or_default();
    let all = comm.gather(mine).unwrap_or_default();
    let mut first = all.into_iter().find(|error| !error.is_empty()).unwrap_or_default();
    comm.broadcast(&mut first);
    Err(wire::decode(&first))
}
