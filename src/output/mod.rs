//! What is written: snapshots and the table of a run's scalars.

pub mod snapshot;
pub mod table;
pub mod tables;
