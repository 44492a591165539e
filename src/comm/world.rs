//! MPI, through rsmpi: the only file that sends MPI messages.

#![expect(unsafe_code, reason = "non-blocking MPI calls on buffers that this file keeps alive")]

use super::{Comm, Parcel, Source};
use crate::ids::Rank;
use mpi::environment::Universe;
use mpi::ffi;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{AsRaw, Communicator, Root};
use std::ffi::{c_int, c_void};
use std::io::{self, Write};
use std::mem::MaybeUninit;

/// Tags of expected and unexpected parcels.
const EXPECTED: c_int = 1;
const ROUTED: c_int = 2;

/// Number of polls before a rank yields its core between polls; these take some microseconds. Open MPI
/// yields only when asked to, MPICH never: ranks that share a core would then wait for each other's time
/// slices.
const LOOKS: u32 = 50;

/// One rank of an MPI run.
pub struct World {
    comm: SimpleCommunicator,
    under_way: UnderWay,
    sum: Option<StartedSum>,
    // Last, so that MPI is finalised after all other fields are dropped.
    _universe: Universe,
}

/// A started exchange. Its buffers stay here until the requests are complete.
#[derive(Default)]
struct UnderWay {
    sent: Vec<Vec<u8>>,
    received: Vec<Option<Vec<u8>>>,
    requests: Vec<ffi::MPI_Request>,
    sources: Vec<Rank>,
}

/// A started sum. Its buffer stays here until the request is complete.
struct StartedSum {
    /// Values of this rank, then those that MPI sums.
    buffer: Vec<i64>,
    request: ffi::MPI_Request,
}

/// Was this process started by mpirun, srun or another MPI launcher?
pub fn launched() -> bool {
    ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMI_RANK", "PMIX_RANK", "MPI_LOCALNRANKS"]
        .iter()
        .any(|name| std::env::var_os(name).is_some())
}

impl World {
    /// Initialises MPI.
    ///
    /// A panic on one rank would unwind into `MPI_Finalize` and wait there for the others for ever. The
    /// hook set here ends all ranks instead.
    ///
    /// # Panics
    /// If MPI has been initialised before.
    pub fn new() -> Self {
        let universe = mpi::initialize().expect("MPI is initialised once, at the start");
        let comm = universe.world();
        let rank = comm.rank();
        let print = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            // A closed standard error must not make the rank hang.
            let text = format!("rank {rank} met a bug of dem-mpi and ends the run:\n");
            let _ = io::stderr().write_all(text.as_bytes());
            print(info);
            // SAFETY: MPI is initialised, and MPI_Abort may be called at any moment.
            unsafe { ffi::MPI_Abort(ffi::RSMPI_COMM_WORLD, 101) };
        }));
        Self { comm, under_way: UnderWay::default(), sum: None, _universe: universe }
    }

    fn send(&mut self, parcel: Parcel, tag: c_int) {
        let bytes = parcel.bytes;
        let mut request = MaybeUninit::uninit();
        // SAFETY: the heap buffer does not move when its `Vec` is pushed, and is kept until `wait`.
        unsafe {
            ffi::MPI_Isend(
                bytes.as_ptr().cast(),
                length(bytes.len()),
                ffi::RSMPI_UINT8_T,
                parcel.rank.0 as c_int,
                tag,
                self.comm.as_raw(),
                request.as_mut_ptr(),
            );
            self.under_way.requests.push(request.assume_init());
        }
        self.under_way.sent.push(bytes);
    }

    /// Takes the next parcel of any size from `source` (or any rank).
    fn probe_and_receive(&self, source: c_int, tag: c_int) -> Parcel {
        let mut message = MaybeUninit::uninit();
        let mut status = MaybeUninit::uninit();
        let mut count = 0;
        until(|is_there| {
            let comm = self.comm.as_raw();
            // SAFETY: the places are there to be filled.
            unsafe {
                ffi::MPI_Improbe(
                    source,
                    tag,
                    comm,
                    is_there,
                    message.as_mut_ptr(),
                    status.as_mut_ptr(),
                )
            };
        });
        // SAFETY: MPI_Improbe has filled message and status; the buffer has the size that it reports.
        unsafe {
            let status = status.assume_init();
            ffi::MPI_Get_count(&raw const status, ffi::RSMPI_UINT8_T, &raw mut count);
            let mut bytes = vec![0; count as usize];
            ffi::MPI_Mrecv(
                bytes.as_mut_ptr().cast(),
                count,
                ffi::RSMPI_UINT8_T,
                message.as_mut_ptr(),
                ffi::RSMPI_STATUS_IGNORE,
            );
            Parcel { rank: Rank(status.MPI_SOURCE as u32), bytes }
        }
    }

    /// Waits for all requests under way.
    fn wait(&mut self) {
        let requests = &mut self.under_way.requests;
        let (count, first) = (requests.len() as c_int, requests.as_mut_ptr());
        // SAFETY: the requests are live, and their buffers are kept in `under_way`.
        until(|done| unsafe {
            ffi::MPI_Testall(count, first, done, ffi::RSMPI_STATUSES_IGNORE);
        });
        requests.clear();
        self.under_way.sent.clear();
    }

    /// Starts a reduction over the values of all ranks.
    ///
    /// # Safety
    /// Both places must have this many values of this kind, and stay valid until the request is complete.
    unsafe fn start_reduction(
        &self,
        mine: *const c_void,
        of_all: *mut c_void,
        count: usize,
        kind: ffi::MPI_Datatype,
        operation: ffi::MPI_Op,
    ) -> ffi::MPI_Request {
        let mut request = MaybeUninit::uninit();
        // SAFETY: as the caller promises.
        unsafe {
            ffi::MPI_Iallreduce(
                mine,
                of_all,
                length(count),
                kind,
                operation,
                self.comm.as_raw(),
                request.as_mut_ptr(),
            );
            request.assume_init()
        }
    }
}

/// Polls until MPI reports completion.
fn until(mut look: impl FnMut(&mut c_int)) {
    let mut is_so = 0;
    for looks in 0_u32.. {
        look(&mut is_so);
        if is_so != 0 {
            return;
        }
        if looks > LOOKS {
            std::thread::yield_now();
        }
    }
}

/// Waits for one live request with a live buffer.
fn wait_for(mut request: ffi::MPI_Request) {
    // SAFETY: as above.
    until(|done| unsafe {
        ffi::MPI_Test(&raw mut request, done, ffi::RSMPI_STATUS_IGNORE);
    });
}

impl Default for World {
    fn default() -> Self {
        Self::new()
    }
}

/// Length of a message in MPI's type.
fn length(bytes: usize) -> c_int {
    c_int::try_from(bytes).expect("a message to one rank must be under 2 GiB: use more ranks")
}

impl Comm for World {
    fn rank(&self) -> Rank {
        Rank(self.comm.rank() as u32)
    }

    fn size(&self) -> u32 {
        self.comm.size() as u32
    }

    fn start(&mut self, outgoing: Vec<Parcel>, sources: &[Source]) {
        self.under_way.sources = sources.iter().map(|s| s.rank).collect();
        for source in sources {
            let Some(size) = source.size else {
                self.under_way.received.push(None);
                continue;
            };
            let mut bytes = vec![0u8; size];
            let mut request = MaybeUninit::uninit();
            // SAFETY: the heap buffer does not move when its `Vec` is pushed, and is kept until `wait`.
            unsafe {
                ffi::MPI_Irecv(
                    bytes.as_mut_ptr().cast(),
                    length(size),
                    ffi::RSMPI_UINT8_T,
                    source.rank.0 as c_int,
                    EXPECTED,
                    self.comm.as_raw(),
                    request.as_mut_ptr(),
                );
                self.under_way.requests.push(request.assume_init());
            }
            self.under_way.received.push(Some(bytes));
        }
        for parcel in outgoing {
            self.send(parcel, EXPECTED);
        }
    }

    fn finish(&mut self) -> Vec<Parcel> {
        let sources = std::mem::take(&mut self.under_way.sources);
        let mut received = std::mem::take(&mut self.under_way.received);
        for (bytes, rank) in received.iter_mut().zip(&sources) {
            if bytes.is_none() {
                *bytes = Some(self.probe_and_receive(rank.0 as c_int, EXPECTED).bytes);
            }
        }
        self.wait();
        sources
            .into_iter()
            .zip(received)
            .map(|(rank, bytes)| Parcel { rank, bytes: bytes.unwrap_or_default() })
            .collect()
    }

    fn route(&mut self, outgoing: Vec<Parcel>) -> Vec<Parcel> {
        let mut incoming = vec![0i64; self.size() as usize];
        for parcel in &outgoing {
            incoming[parcel.rank.index()] += 1;
        }
        // Also a barrier: no rank routes again before every rank has begun, so rounds cannot mix.
        self.sum(&mut incoming);
        for parcel in outgoing {
            self.send(parcel, ROUTED);
        }
        // SAFETY: a constant of the MPI library.
        let any = unsafe { ffi::RSMPI_ANY_SOURCE };
        let mut received: Vec<_> = (0..incoming[self.rank().index()])
            .map(|_| self.probe_and_receive(any, ROUTED))
            .collect();
        self.wait();
        received.sort_by_key(|p| p.rank);
        received
    }

    fn sum(&mut self, values: &mut [i64]) {
        let mine = values.to_vec();
        let (from, to) = (mine.as_ptr().cast(), values.as_mut_ptr().cast());
        // SAFETY: both buffers live until all is done, two lines below.
        let request = unsafe {
            self.start_reduction(from, to, mine.len(), ffi::RSMPI_INT64_T, ffi::RSMPI_SUM)
        };
        wait_for(request);
    }

    fn max(&mut self, values: &mut [f64]) {
        let mine = values.to_vec();
        let (from, to) = (mine.as_ptr().cast(), values.as_mut_ptr().cast());
        // SAFETY: both buffers live until all is done, two lines below.
        let request = unsafe {
            self.start_reduction(from, to, mine.len(), ffi::RSMPI_DOUBLE, ffi::RSMPI_MAX)
        };
        wait_for(request);
    }

    fn start_sum(&mut self, values: Vec<i64>) {
        let count = values.len();
        let mut buffer = values;
        buffer.resize(2 * count, 0);
        let mine = buffer.as_mut_ptr();
        // SAFETY: the heap buffer does not move with its `Vec`, which `finish_sum` keeps until all is done.
        let request = unsafe {
            let (from, to) = (mine.cast(), mine.add(count).cast());
            self.start_reduction(from, to, count, ffi::RSMPI_INT64_T, ffi::RSMPI_SUM)
        };
        self.sum = Some(StartedSum { buffer, request });
    }

    fn finish_sum(&mut self) -> Vec<i64> {
        let Some(StartedSum { mut buffer, request }) = self.sum.take() else { return Vec::new() };
        wait_for(request);
        buffer.split_off(buffer.len() / 2)
    }

    fn broadcast(&mut self, bytes: &mut Vec<u8>) {
        let root = self.comm.process_at_rank(0);
        let mut size = bytes.len() as u64;
        root.broadcast_into(&mut size);
        bytes.resize(size as usize, 0);
        // The address of an empty `Vec<u8>` is 1, which Open MPI takes for MPI_IN_PLACE.
        if !bytes.is_empty() {
            root.broadcast_into(&mut bytes[..]);
        }
    }

    fn gather(&mut self, bytes: Vec<u8>) -> Option<Vec<Vec<u8>>> {
        let parcels = self.route(vec![Parcel { rank: Rank(0), bytes }]);
        self.is_root().then(|| parcels.into_iter().map(|p| p.bytes).collect())
    }

    fn abort(&self, status: i32) -> ! {
        self.comm.abort(status)
    }

    fn mpi(&self) -> Option<ffi::MPI_Comm> {
        Some(self.comm.as_raw())
    }
}
