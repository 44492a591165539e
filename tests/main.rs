//! All tests that need no mpirun, in one binary.

mod comm;
mod comm_cases;
mod made_up;
mod snapshot;
