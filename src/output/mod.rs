//! What is written: snapshots and the table of a run's scalars.

pub mod snapshot;
pub mod tables;

use std::path::PathBuf;

/// Why a snapshot could not be read.
#[derive(Debug, thiserror::Error)]
pub enum SnapshotError {
    /// This build has no reader.
    #[error("{}: this build cannot read snapshots", path.display())]
    NoReader {
        /// The file.
        path: PathBuf,
    },
}
