//! How ranks talk: bytes between ranks and a few small reductions, nothing else.
//!
//! [`Comm`] has three homes: [`world`] is MPI, [`alone`] is one rank without MPI, and [`threads`] runs
//! ranks as threads of one process, for tests and for a debugger. The code above is one; nothing
//! asks how many ranks there are in order to do something different.

pub mod alone;
pub mod linked;
pub mod threads;
pub mod wire;
pub mod world;

use crate::ids::Rank;
use serde::{Serialize, de::DeserializeOwned};

/// Bytes for, or from, a rank.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parcel {
    /// Where to, or where from.
    pub rank: Rank,
    /// The content.
    pub bytes: Vec<u8>,
}

/// A rank from which one parcel will come, and its size in bytes if that is known beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Source {
    /// Where from.
    pub rank: Rank,
    /// How many bytes; `None`: ask the message.
    pub size: Option<usize>,
}

/// One rank's end of the communication.
///
/// All calls but `start`, `finish` and `abort` are collective: every rank makes them in the same order.
pub trait Comm {
    /// Which rank this is.
    fn rank(&self) -> Rank;

    /// How many ranks there are.
    fn size(&self) -> u32;

    /// Begins to send `outgoing` and to receive one parcel from each of `sources`, and returns at once.
    /// A rank sends to those, and only those, that name it as a source. A parcel to oneself is allowed.
    fn start(&mut self, outgoing: Vec<Parcel>, sources: &[Source]);

    /// Completes what [`Comm::start`] began. The parcels come in the order of the sources.
    fn finish(&mut self) -> Vec<Parcel>;

    /// Sends parcels to ranks that do not expect them; returns those for this rank, by source.
    /// Costs a reduction over a number per rank: for rare events only.
    fn route(&mut self, outgoing: Vec<Parcel>) -> Vec<Parcel>;

    /// Replaces each value by its sum over all ranks.
    fn sum(&mut self, values: &mut [i64]);

    /// Replaces each value, none of them NaN, by its maximum over all ranks.
    fn max(&mut self, values: &mut [f64]);

    /// Begins to sum each of these values over all ranks, and returns at once. One at a time.
    fn start_sum(&mut self, values: Vec<i64>);

    /// Completes what [`Comm::start_sum`] began: the sums.
    fn finish_sum(&mut self) -> Vec<i64>;

    /// Replaces `bytes` by those of rank 0.
    fn broadcast(&mut self, bytes: &mut Vec<u8>);

    /// The bytes of all ranks, by rank, on rank 0; `None` elsewhere.
    fn gather(&mut self, bytes: Vec<u8>) -> Option<Vec<Vec<u8>>>;

    /// Ends all ranks with this exit status.
    fn abort(&self, status: i32) -> !;

    /// The communicator that HDF5 writes with; `None` if there is no MPI.
    fn mpi(&self) -> Option<mpi::ffi::MPI_Comm> {
        None
    }

    /// Is this the rank that speaks for all?
    fn is_root(&self) -> bool {
        self.rank() == Rank(0)
    }

    /// Begins to ask all ranks whether it is so on any of them, and returns at once. No other vote or
    /// started sum may be under way.
    fn start_vote(&mut self, here: bool) {
        self.start_sum(vec![i64::from(here)]);
    }

    /// Completes what [`Comm::start_vote`] began: is it so on any rank?
    fn finish_vote(&mut self) -> bool {
        self.finish_sum().iter().any(|&yes| yes > 0)
    }

    /// Is it so on any rank?
    fn any(&mut self, here: bool) -> bool {
        self.start_vote(here);
        self.finish_vote()
    }

    /// Sends `outgoing` and receives from `sources`, in one go.
    fn exchange(&mut self, outgoing: Vec<Parcel>, sources: &[Source]) -> Vec<Parcel> {
        self.start(outgoing, sources);
        self.finish()
    }
}

/// What all ranks have, by rank, on every rank. For rare events only. Collective.
pub fn everywhere<T: Serialize + DeserializeOwned>(comm: &mut dyn Comm, here: &[T]) -> Vec<T> {
    let all = comm.gather(wire::encode(&here)).unwrap_or_default();
    let all: Vec<T> = all.iter().flat_map(|bytes| wire::decode::<Vec<T>>(bytes)).collect();
    let mut bytes = wire::encode(&all);
    comm.broadcast(&mut bytes);
    wire::decode(&bytes)
}

/// Lets all ranks fail if one does, each with the error of the lowest rank that failed; stands before
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
    // A rank without an error of its own sends nothing.
    let mine = here.err().map(|e| wire::encode(&e)).unwrap_or_default();
    let all = comm.gather(mine).unwrap_or_default();
    let mut first = all.into_iter().find(|error| !error.is_empty()).unwrap_or_default();
    comm.broadcast(&mut first);
    Err(wire::decode(&first))
}
