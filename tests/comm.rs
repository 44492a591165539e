//! Ranks without MPI: alone and as threads.

use crate::comm_cases;
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
    run(comm_cases::exchange);
}

#[test]
fn route() {
    run(comm_cases::route);
}

#[test]
fn reductions() {
    run(comm_cases::reductions);
}

#[test]
fn votes() {
    run(comm_cases::votes);
}

#[test]
fn started_sums() {
    run(comm_cases::started_sums);
}

#[test]
fn broadcast_and_gather() {
    run(comm_cases::broadcast_and_gather);
}
