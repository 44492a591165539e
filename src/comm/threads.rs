//! Ranks as threads of one process, for tests and debugging, without MPI.
//!
//! Every pair of ranks has a mailbox that keeps the order of its parcels. A reduction is a gather to
//! rank 0 and a broadcast. A rank that panics or aborts makes every waiting rank panic too, so that
//! a test ends instead of hanging.

use super::{Comm, Parcel, Source};
use crate::ids::Rank;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

type Mailboxes = BTreeMap<(Rank, Rank), VecDeque<Vec<u8>>>;

/// A started sum, with the numbers of ranks that have added to it and read it.
#[derive(Default)]
struct Running {
    added: u32,
    read: u32,
    values: Vec<i64>,
}

#[derive(Default)]
struct State {
    mailboxes: Mailboxes,
    /// Sums by their number.
    sums: BTreeMap<u64, Running>,
    ended: bool,
}

struct Exchange {
    state: Mutex<State>,
    /// One condition variable per rank: a common one would wake all ranks for each parcel.
    changed: Vec<Condvar>,
}

impl Exchange {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for a change for this rank.
    fn wait<'a>(&self, state: MutexGuard<'a, State>, rank: Rank) -> MutexGuard<'a, State> {
        self.changed[rank.0 as usize].wait(state).unwrap_or_else(PoisonError::into_inner)
    }

    fn wake_all(&self) {
        self.changed.iter().for_each(Condvar::notify_one);
    }
}

/// A rank in a thread.
pub struct ThreadRank {
    rank: Rank,
    size: u32,
    hub: Arc<Exchange>,
    sources: Vec<Source>,
    /// Number of sums that this rank has started.
    sums: u64,
}

/// Runs `body` on `size` ranks, each a thread, and returns their results by rank.
///
/// # Panics
/// If any rank panics or aborts.
pub fn run<T: Send>(size: u32, body: impl Fn(&mut ThreadRank) -> T + Sync) -> Vec<T> {
    let changed = (0..size).map(|_| Condvar::new()).collect();
    let hub = Arc::new(Exchange { state: Mutex::default(), changed });
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..size)
            .map(|rank| {
                let hub = Arc::clone(&hub);
                let body = &body;
                scope.spawn(move || {
                    let (rank, sources) = (Rank(rank), Vec::new());
                    body(&mut ThreadRank { rank, size, hub, sources, sums: 0 })
                })
            })
            .collect();
        threads
            .into_iter()
            .map(|t| t.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    })
}

impl ThreadRank {
    fn send(&self, to: Rank, bytes: Vec<u8>) {
        self.hub.lock().mailboxes.entry((self.rank, to)).or_default().push_back(bytes);
        self.hub.changed[to.0 as usize].notify_one();
    }

    fn receive(&self, from: Rank) -> Vec<u8> {
        let mut state = self.hub.lock();
        loop {
            let mailbox = state.mailboxes.entry((from, self.rank)).or_default();
            if let Some(bytes) = mailbox.pop_front() {
                return bytes;
            }
            assert!(!state.ended, "another rank ended while rank {} waited", self.rank.0);
            state = self.hub.wait(state, self.rank);
        }
    }

    /// Gathers a value of each rank at rank 0, combines them there and sends the result to all.
    fn reduce<T: bytemuck::Pod>(&mut self, values: &mut [T], combine: impl Fn(&mut T, T)) {
        let gathered = self.gather(bytemuck::cast_slice(values).to_vec());
        let mut result = Vec::new();
        if let Some(all) = gathered {
            for theirs in &all[1..] {
                for (mine, theirs) in values.iter_mut().zip(theirs.chunks_exact(size_of::<T>())) {
                    combine(mine, bytemuck::pod_read_unaligned(theirs));
                }
            }
            result = bytemuck::cast_slice(values).to_vec();
        }
        self.broadcast(&mut result);
        for (value, bytes) in values.iter_mut().zip(result.chunks_exact(size_of::<T>())) {
            *value = bytemuck::pod_read_unaligned(bytes);
        }
    }

    fn others(&self) -> impl Iterator<Item = Rank> + use<> {
        let me = self.rank;
        (0..self.size).map(Rank).filter(move |&r| r != me)
    }
}

impl Drop for ThreadRank {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.hub.lock().ended = true;
            self.hub.wake_all();
        }
    }
}

impl Comm for ThreadRank {
    fn rank(&self) -> Rank {
        self.rank
    }

    fn size(&self) -> u32 {
        self.size
    }

    fn start(&mut self, outgoing: Vec<Parcel>, sources: &[Source]) {
        for parcel in outgoing {
            self.send(parcel.rank, parcel.bytes);
        }
        self.sources = sources.to_vec();
    }

    fn finish(&mut self) -> Vec<Parcel> {
        let sources = std::mem::take(&mut self.sources);
        sources.iter().map(|s| Parcel { rank: s.rank, bytes: self.receive(s.rank) }).collect()
    }

    fn route(&mut self, outgoing: Vec<Parcel>) -> Vec<Parcel> {
        let mut incoming = vec![0i64; (self.size * self.size) as usize];
        for parcel in &outgoing {
            incoming[(parcel.rank.0 * self.size + self.rank.0) as usize] += 1;
        }
        self.sum(&mut incoming);
        let sources: Vec<_> = (0..self.size)
            .flat_map(|from| {
                let count = incoming[(self.rank.0 * self.size + from) as usize];
                (0..count).map(move |_| Source { rank: Rank(from), size: None })
            })
            .collect();
        self.exchange(outgoing, &sources)
    }

    fn sum(&mut self, values: &mut [i64]) {
        self.reduce(values, |mine, theirs| *mine += theirs);
    }

    fn max(&mut self, values: &mut [f64]) {
        self.reduce(values, |mine, theirs| {
            if theirs > *mine {
                *mine = theirs;
            }
        });
    }

    fn start_sum(&mut self, values: Vec<i64>) {
        self.sums += 1;
        let mut state = self.hub.lock();
        let sum = state.sums.entry(self.sums).or_default();
        sum.added += 1;
        sum.values.resize(values.len(), 0);
        sum.values.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        let is_whole = sum.added == self.size;
        drop(state);
        if is_whole {
            self.hub.wake_all();
        }
    }

    fn finish_sum(&mut self) -> Vec<i64> {
        let mut state = self.hub.lock();
        loop {
            let sum = state.sums.entry(self.sums).or_default();
            if sum.added == self.size {
                sum.read += 1;
                if sum.read < self.size {
                    return sum.values.clone();
                }
                return state.sums.remove(&self.sums).unwrap_or_default().values;
            }
            assert!(!state.ended, "another rank ended while rank {} waited", self.rank.0);
            state = self.hub.wait(state, self.rank);
        }
    }

    fn broadcast(&mut self, bytes: &mut Vec<u8>) {
        if self.is_root() {
            self.others().for_each(|rank| self.send(rank, bytes.clone()));
        } else {
            *bytes = self.receive(Rank(0));
        }
    }

    fn gather(&mut self, bytes: Vec<u8>) -> Option<Vec<Vec<u8>>> {
        if !self.is_root() {
            self.send(Rank(0), bytes);
            return None;
        }
        let mut all = vec![bytes];
        all.extend(self.others().map(|rank| self.receive(rank)));
        Some(all)
    }

    fn abort(&self, status: i32) -> ! {
        panic!("rank {} ended the run with status {status}", self.rank.0)
    }
}
