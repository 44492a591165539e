//! Rows in the order of their ids: files of any number of ranks have the same rows in the same places.
//!
//! Before rows are written, each goes to the rank that writes it. A rank writes the rows of a range of ids ([`Shares`]), and
//! all ranks about as many particles; a contact is written where the lower of its ids is. No rank holds more than its share,
//! and one column of it at a time.

use crate::comm::{Comm, Parcel, Source, wire};
use crate::ids::{GlobalId, Rank};
use std::borrow::Cow;

/// By what rows are ordered: particles by their id, contacts by both of theirs.
pub type Key = (GlobalId, GlobalId);

/// Which ids each rank writes.
pub struct Shares {
    /// The lowest id of each rank but the first.
    firsts: Vec<u64>,
}

impl Shares {
    /// As many particles for each rank, of which this rank has these. Collective.
    pub fn of(ids: &[GlobalId], comm: &mut dyn Comm) -> Self {
        let ranks = u64::from(comm.size());
        let mut firsts = vec![0; ranks as usize - 1];
        let mut sorted: Vec<u64> = ids.iter().map(|id| id.0).collect();
        sorted.sort_unstable();
        let mut count = [sorted.len() as i64];
        comm.sum(&mut count);
        let highest = sorted.last().copied().unwrap_or(0);
        let mut bits = [f64::from(u64::BITS - highest.leading_zeros())];
        comm.max(&mut bits);
        // The ids below the first of a rank are those of all ranks before it: found bit by bit, the highest first.
        for bit in (0..bits[0] as u32).rev() {
            let tried: Vec<u64> = firsts.iter().map(|first| first | (1 << bit)).collect();
            let below = |&id: &u64| sorted.partition_point(|&other| other < id) as i64;
            let mut before: Vec<i64> = tried.iter().map(below).collect();
            comm.sum(&mut before);
            for (rank, (first, tried)) in (1..).zip(firsts.iter_mut().zip(tried)) {
                let wanted = (count[0] as u64 * rank / ranks) as i64;
                if before[rank as usize - 1] <= wanted {
                    *first = tried;
                }
            }
        }
        Self { firsts }
    }

    /// Who writes the rows of this id.
    fn writer(&self, id: GlobalId) -> Rank {
        Rank(self.firsts.partition_point(|&first| first <= id.0) as u32)
    }
}

/// Where the rows of a table go, from each rank that has some to each that writes some.
pub struct Order {
    /// To whom, and which rows of this rank.
    outgoing: Vec<(Rank, Vec<u32>)>,
    /// From whom, and how many.
    sources: Vec<(Rank, usize)>,
    /// Of each row that this rank writes, its place among those that come.
    places: Vec<u32>,
    /// Does this rank write its own rows as they stand, and no others?
    stays: bool,
}

impl Order {
    /// Of a table of which this rank has rows with these keys. Rows of the same key keep their order. Collective.
    pub fn of(keys: &[Key], shares: &Shares, comm: &mut dyn Comm) -> Self {
        let mut rows: Vec<u32> = (0..keys.len() as u32).collect();
        rows.sort_by_key(|&row| keys[row as usize]);
        let writer = |row: &u32| shares.writer(keys[*row as usize].0);
        let outgoing: Vec<(Rank, Vec<u32>)> = rows
            .chunk_by(|one, next| writer(one) == writer(next))
            .map(|rows| (writer(&rows[0]), rows.to_vec()))
            .collect();
        let stand = rows.iter().zip(0..).all(|(&row, place)| row == place);
        drop(rows);
        let parcels = outgoing.iter().map(|(rank, rows)| {
            let keys: Vec<Key> = rows.iter().map(|&row| keys[row as usize]).collect();
            Parcel { rank: *rank, bytes: wire::encode(&keys) }
        });
        let mut incoming: Vec<Key> = Vec::new();
        let mut sources = Vec::new();
        for Parcel { rank, bytes } in comm.route(parcels.collect()) {
            let keys: Vec<Key> = wire::decode(&bytes);
            sources.push((rank, keys.len()));
            incoming.extend(keys);
        }
        let mut places: Vec<u32> = (0..incoming.len() as u32).collect();
        places.sort_by_key(|&place| incoming[place as usize]);
        let here = comm.rank();
        let stays = stand
            && outgoing.iter().all(|(rank, _)| *rank == here)
            && sources.iter().all(|(rank, _)| *rank == here);
        Self { outgoing, sources, places, stays }
    }

    /// How many rows this rank writes.
    pub fn rows(&self) -> usize {
        self.places.len()
    }

    /// A column of the rows that this rank writes, of the column of those that it has, `width` numbers a row. Collective.
    pub fn moved<'a, T: bytemuck::Pod>(
        &self,
        values: &'a [T],
        width: usize,
        comm: &mut dyn Comm,
    ) -> Cow<'a, [T]> {
        // Then no other rank waits for this one.
        if self.stays {
            return Cow::Borrowed(values);
        }
        let of_row = |row: u32| row as usize * width..(row as usize + 1) * width;
        let outgoing = self.outgoing.iter().map(|(rank, rows)| {
            let mut bytes = Vec::with_capacity(rows.len() * width * size_of::<T>());
            for &row in rows {
                bytes.extend_from_slice(bytemuck::cast_slice(&values[of_row(row)]));
            }
            Parcel { rank: *rank, bytes }
        });
        let size = |rows: usize| Some(rows * width * size_of::<T>());
        let sources: Vec<Source> =
            self.sources.iter().map(|&(rank, rows)| Source { rank, size: size(rows) }).collect();
        let mut come: Vec<T> = Vec::with_capacity(self.rows() * width);
        for parcel in comm.exchange(outgoing.collect(), &sources) {
            come.extend(bytemuck::pod_collect_to_vec::<u8, T>(&parcel.bytes));
        }
        let mut moved = Vec::with_capacity(come.len());
        for &place in &self.places {
            moved.extend_from_slice(&come[of_row(place)]);
        }
        Cow::Owned(moved)
    }
}
