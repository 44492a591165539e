//! Ranks without MPI: alone and as threads.

use crate::comm::cases;
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::{Comm, threads};

fn run(case: fn(&mut dyn Comm)) {
    case(&mut Alone::default());
    for size in [1, 2, 3, 8] {
        threads::run(size, |comm| case(comm));
    }
}

#[test]
fn exchange() {
    run(cases::exchange);
}

#[test]
fn route() {
    run(cases::route);
}

#[test]
fn reductions() {
    run(cases::reductions);
}

#[test]
fn votes() {
    run(cases::votes);
}

#[test]
fn started_sums() {
    run(cases::started_sums);
}

#[test]
fn broadcast_and_gather() {
    run(cases::broadcast_and_gather);
}
