//! All tests that need no mpirun, in one binary.

mod made_up;
mod snapshot;
