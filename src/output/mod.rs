//! What is written: snapshots and the table of a run's scalars.

pub mod snapshot;
pub mod tables;
