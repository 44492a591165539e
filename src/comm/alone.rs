//! One rank without MPI: a parcel to oneself returns at once.

use super::{Comm, Parcel, Source};
use crate::ids::Rank;

/// The only rank of a run that was started without mpirun.
#[derive(Debug, Default)]
pub struct Alone {
    under_way: Vec<Parcel>,
    summed: Vec<i64>,
}

impl Comm for Alone {
    fn rank(&self) -> Rank {
        Rank(0)
    }

    fn size(&self) -> u32 {
        1
    }

    fn start(&mut self, outgoing: Vec<Parcel>, _sources: &[Source]) {
        self.under_way = outgoing;
    }

    fn finish(&mut self) -> Vec<Parcel> {
        std::mem::take(&mut self.under_way)
    }

    fn route(&mut self, outgoing: Vec<Parcel>) -> Vec<Parcel> {
        outgoing
    }

    fn sum(&mut self, _values: &mut [i64]) {}

    fn max(&mut self, _values: &mut [f64]) {}

    fn start_sum(&mut self, values: Vec<i64>) {
        self.summed = values;
    }

    fn finish_sum(&mut self) -> Vec<i64> {
        std::mem::take(&mut self.summed)
    }

    fn broadcast(&mut self, _bytes: &mut Vec<u8>) {}

    fn gather(&mut self, bytes: Vec<u8>) -> Option<Vec<Vec<u8>>> {
        Some(vec![bytes])
    }

    fn abort(&self, status: i32) -> ! {
        std::process::exit(status)
    }
}
