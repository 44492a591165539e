//! Rows in the order of their ids: files written by any number of ranks have the same rows in the same places.
//!
//! Before rows are written, each moves to the rank that writes it. A rank writes the rows of a range of ids ([`Shares`]),
//! and all ranks write about the same number of particles. A contact is written by the rank of its lower id. A rank holds no
//! more than its share, one column at a time.

use crate::comm::{Comm, Parcel, Source, wire};
use crate::ids::{GlobalId, Rank};
use std::borrow::Cow;

/// Sort key of a row: the id of a particle, or both ids of a contact.
pub type Key = (GlobalId, GlobalId);

/// Ranges of ids that each rank writes.
pub struct Shares {
    /// Lowest id of each rank but the first.
    firsts: Vec<u64>,
}

impl Shares {
    /// Shares with about as many particles for each rank; `ids` are the particles of this rank. Collective.
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
        // The first id of a rank is found bit by bit, the highest first, so that the ranks before it write its share of
        // lower ids.
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

    /// Rank that writes the rows of this id.
    fn writer(&self, id: GlobalId) -> Rank {
        Rank(self.firsts.partition_point(|&first| first <= id.0) as u32)
    }
}

/// Routes of the rows of a table from the ranks that have them to the ranks that write them.
pub struct Order {
    /// Other ranks that receive rows, and the rows of this rank that they receive.
    outgoing: Vec<(Rank, Vec<u32>)>,
    /// Other ranks that send rows, and how many.
    sources: Vec<(Rank, usize)>,
    /// For each row that this rank writes, its index among the incoming rows; with [`OWN`], among the rows of this rank.
    places: Vec<u32>,
    /// Number of rows that this rank writes.
    rows: usize,
    /// True if all ranks write their own rows in their present order.
    stays: bool,
}

/// Bit that marks an index into the rows of this rank.
const OWN: u32 = 1 << 31;

impl Order {
    /// Order of a table; `keys` are the keys of the rows of this rank. Collective.
    pub fn of(keys: &[Key], shares: &Shares, comm: &mut dyn Comm) -> Self {
        let here = comm.rank();
        let writer = |row: u32| shares.writer(keys[row as usize].0);
        let count = keys.len() as u32;
        let stays = keys.is_sorted() && (0..count).all(|row| writer(row) == here);
        let mut order = Self {
            outgoing: Vec::new(),
            sources: Vec::new(),
            places: Vec::new(),
            rows: keys.len(),
            stays: !comm.any(!stays),
        };
        if order.stays {
            return order;
        }
        let mut leaving: Vec<u32> = (0..count).filter(|&row| writer(row) != here).collect();
        leaving.sort_by_key(|&row| keys[row as usize]);
        for rows in leaving.chunk_by(|&one, &next| writer(one) == writer(next)) {
            order.outgoing.push((writer(rows[0]), rows.to_vec()));
        }
        let parcels = order.outgoing.iter().map(|(rank, rows)| {
            let keys: Vec<Key> = rows.iter().map(|&row| keys[row as usize]).collect();
            Parcel { rank: *rank, bytes: wire::encode(&keys) }
        });
        let mut incoming: Vec<Key> = Vec::new();
        for Parcel { rank, bytes } in comm.route(parcels.collect()) {
            let keys: Vec<Key> = wire::decode(&bytes);
            order.sources.push((rank, keys.len()));
            incoming.extend(keys);
        }
        let own = (0..count).filter(|&row| writer(row) == here).map(|row| row | OWN);
        order.places = own.chain(0..incoming.len() as u32).collect();
        // A stable sort: rows of one key are contacts of two bodies in several places, and keep their order.
        order.places.sort_by_key(|&place| match place & OWN {
            0 => incoming[place as usize],
            _ => keys[(place & !OWN) as usize],
        });
        order.rows = order.places.len();
        order
    }

    /// Number of rows that this rank writes.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// Column of the rows that this rank writes, from the column of the rows that it has, `width` numbers per row.
    /// Collective.
    pub fn moved<'a, T: bytemuck::Pod>(
        &self,
        values: &'a [T],
        width: usize,
        comm: &mut dyn Comm,
    ) -> Cow<'a, [T]> {
        // True on all ranks or on none.
        if self.stays {
            return Cow::Borrowed(values);
        }
        let values: &[u8] = bytemuck::cast_slice(values);
        let width = width * size_of::<T>();
        let of_row = |row: usize| row * width..(row + 1) * width;
        let outgoing = self.outgoing.iter().map(|(rank, rows)| {
            let mut bytes = Vec::with_capacity(rows.len() * width);
            for &row in rows {
                bytes.extend_from_slice(&values[of_row(row as usize)]);
            }
            Parcel { rank: *rank, bytes }
        });
        let size = |rows: usize| Some(rows * width);
        let sources: Vec<Source> =
            self.sources.iter().map(|&(rank, rows)| Source { rank, size: size(rows) }).collect();
        let parcels = comm.exchange(outgoing.collect(), &sources);
        // Index of the first row of each parcel among all incoming rows.
        let mut firsts = Vec::new();
        let mut before = 0;
        for (_, rows) in &self.sources {
            firsts.push(before);
            before += rows;
        }
        let come = |row: usize| {
            let parcel = firsts.partition_point(|&first| first <= row) - 1;
            &parcels[parcel].bytes[of_row(row - firsts[parcel])]
        };
        let mut moved: Vec<T> = vec![T::zeroed(); self.rows * width / size_of::<T>()];
        let rows = bytemuck::cast_slice_mut::<T, u8>(&mut moved).chunks_exact_mut(width.max(1));
        for (row, &place) in rows.zip(&self.places) {
            row.copy_from_slice(match place & OWN {
                0 => come(place as usize),
                _ => &values[of_row((place & !OWN) as usize)],
            });
        }
        Cow::Owned(moved)
    }
}
