//! Output: snapshots, the table of a run's scalars, and lists of particles that enter and leave.
//!
//! | file | content |
//! |---|---|
//! | [`header`] | data that a snapshot has once: step, time, domain, walls and shapes |
//! | [`tables`] | particles and contacts of a snapshot: each column is declared once, with its place in the files |
//! | [`columns`] | values of a column: numbers of any kind, in memory and in files |
//! | [`order`] | rows by id: from the ranks that have them to the ranks that write them |
//! | [`snapshot`] | [`snapshot::write`] and [`snapshot::Reader`]: tables to files and back |
//! | [`series`] | lists of snapshots with their times, for ParaView |
//! | [`growing`] | files that a run extends by rows, and continues after a restart |
//! | [`table`] | `history.csv`, the scalars of a run by time |
//! | [`lists`] | `entered_NAME.csv`, `left_NAME.csv`: particles that entered through an inlet or left through an outlet |
//! | [`report`] | `report.json`, all figures of a run at its end, and a summary as text |
//! | [`performance`] | `performance.csv`, work and cost of a run |
//! | [`hdf5`] | columns and attributes in HDF5 |
//! | [`foreign`] | HDF5 files of other programs |
//! | [`seal`] | integrity of a file: checksums, and reserved space on the disk |
//!
//! With MPI, all ranks write a large snapshot together, each the rows of a range of ids. A small snapshot, or one
//! without MPI, is gathered and written by rank 0. The files are the same for any number of ranks.
//!
//! A file appears under its own name only when it is complete and on the disk, so a crash leaves the last good snapshot.
//! It ends with a [`seal::checksum`] of all its bytes, and every dataset carries its own checksum. A truncated file or a
//! flipped bit is detected before anything else is read.

pub mod columns;
pub mod foreign;
pub mod growing;
pub mod hdf5;
pub mod header;
pub mod lists;
pub mod order;
pub mod performance;
pub mod report;
pub mod seal;
pub mod series;
pub mod snapshot;
pub mod table;
pub mod tables;

use crate::comm::{Comm, agree};
use crate::files;
use serde::{Deserialize, Serialize};
use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;

/// A snapshot that cannot be written, or cannot be trusted.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
pub enum SnapshotError {
    /// A rank could not write.
    #[error(
        "cannot write {path} (rank {rank}): {cause}. Earlier snapshots are intact: check the disk and the name, then \
         restart from the last"
    )]
    Write {
        /// The file or directory.
        path: String,
        /// The lowest rank that failed.
        rank: u32,
        /// The message of the system or of HDF5.
        cause: String,
    },
    /// The output folder cannot be created or written to.
    #[error(
        "cannot write into {path}: {cause}. Give another folder, by --out or by output.directory"
    )]
    Folder {
        /// The directory.
        path: String,
        /// The message of the system.
        cause: String,
    },
    /// Another run writes to the same directory.
    #[error(
        "another run is writing to {path}. Wait for its end, or give this run its own directory: --out DIR, or \
         output.directory in the scene"
    )]
    Busy {
        /// The directory.
        path: String,
    },
    /// The directory has snapshots of another run, or of this one's future.
    #[error(
        "{path} has snapshots up to step {newest}, but this run begins at step {step}. Continue from the newest with \
         --start {path}, use another directory with --out DIR, or remove later ones with --overwrite"
    )]
    Later {
        /// Path of the directory.
        path: String,
        /// Step at which this run begins.
        step: u64,
        /// Latest step in the directory.
        newest: u64,
    },
    /// The output folder is that of the previous stage.
    #[error(
        "{path} is the folder of the stage in `start`, whose snapshots must be kept. Give this stage its own folder: \
         --out DIR, or output.directory in the scene"
    )]
    StageBefore {
        /// The directory.
        path: String,
    },
    /// A file that no run wrote has the name of an output file.
    #[error(
        "{path} is not from a run, and this run would replace it: move it away, use another folder with --out DIR, or \
         replace it with --overwrite"
    )]
    Foreign {
        /// The file.
        path: String,
    },
    /// A table handed to the writer has columns of different lengths.
    #[error(
        "rank {rank} gave {rows} rows of `{column}` instead of {expected}: a bug of the caller"
    )]
    Uneven {
        /// Rank that passed the table.
        rank: u32,
        /// Name of the column.
        column: String,
        /// Number of rows of the column.
        rows: usize,
        /// Number of rows of the table.
        expected: usize,
    },
    /// The file does not exist.
    #[error(
        "no snapshot at {path} ({cause}). Give a file particles_<step>.vtkhdf, or a directory with such files"
    )]
    Missing {
        /// Path that was searched.
        path: String,
        /// The message of the system.
        cause: String,
    },
    /// The output folder is a file.
    #[error(
        "{path} is a file, but a run writes into a folder: give another --out, or output.directory"
    )]
    NoFolder {
        /// Path of the file.
        path: String,
    },
    /// The file is not a snapshot, is truncated, or has a damaged structure.
    #[error(
        "{path} cannot be read as a snapshot: {cause}. If a run wrote it, the file is incomplete or damaged: use an \
         earlier snapshot"
    )]
    Unreadable {
        /// The file.
        path: String,
        /// Cause of the error.
        cause: String,
    },
    /// The bytes of a dataset differ from those that were written.
    #[error(
        "{path}: the checksum of {dataset} is wrong: its bytes have changed since writing. Use an earlier snapshot, \
         and check the disk"
    )]
    Damaged {
        /// The file.
        path: String,
        /// The dataset.
        dataset: String,
    },
    /// All snapshots of the directory are damaged.
    #[error("{path} has no usable snapshot:\n  {}", .causes.join("\n  "))]
    NoneGood {
        /// The directory.
        path: String,
        /// Cause for each snapshot, the newest first.
        causes: Vec<String>,
    },
    /// The requested rows do not exist.
    #[error("{path}: rows {first}..{end} of {dataset} are out of range: it has {rows}")]
    Beyond {
        /// The file.
        path: String,
        /// The dataset.
        dataset: String,
        /// First requested row.
        first: usize,
        /// One past the last requested row.
        end: usize,
        /// Number of rows.
        rows: usize,
    },
}

impl SnapshotError {
    fn write(path: &Path, comm: &dyn Comm, cause: &impl ToString) -> Self {
        Self::Write { path: name_of(path), rank: comm.rank().0, cause: cause.to_string() }
    }

    /// Converts a write error into an error of the folder, for failures before anything is written.
    fn of_folder(self) -> Self {
        match self {
            Self::Write { path, cause, .. } => Self::Folder { path, cause },
            other => other,
        }
    }

    fn unreadable(path: &Path, cause: &impl ToString) -> Self {
        Self::Unreadable { path: name_of(path), cause: cause.to_string() }
    }

    fn damaged(path: &Path, dataset: &str) -> Self {
        Self::Damaged { path: name_of(path), dataset: dataset.to_owned() }
    }
}

/// Path as text for error messages.
fn name_of(path: &Path) -> String {
    path.display().to_string()
}

/// Creates the output directory if it is missing, and locks it for this run. The lock holds as long as rank 0 keeps the
/// returned file or lives. On file systems without locks, other runs are not kept out. Collective.
///
/// # Errors
/// On all ranks, if rank 0 cannot create the directory, or another run has it.
pub fn claim(path: &Path, comm: &mut dyn Comm) -> Result<Option<File>, SnapshotError> {
    let is_file = comm.is_root() && path.is_file();
    agree(
        comm,
        if is_file { Err(SnapshotError::NoFolder { path: name_of(path) }) } else { Ok(()) },
    )?;
    let mut lock = None;
    on_root(path, comm, || {
        std::fs::create_dir_all(path)?;
        lock = Some(files::hold(&path.join(LOCK))?);
        Ok(())
    })
    .map_err(SnapshotError::of_folder)?;
    let taken = lock.as_ref().map(File::try_lock);
    let busy = matches!(taken, Some(Err(TryLockError::WouldBlock)));
    agree(comm, if busy { Err(SnapshotError::Busy { path: name_of(path) }) } else { Ok(()) })?;
    Ok(lock)
}

/// File in a run's directory that rank 0 locks.
const LOCK: &str = ".lock";

/// Creates the output directory if it is missing. Collective.
///
/// # Errors
/// On all ranks, if rank 0 cannot create it.
pub fn make_directory(path: &Path, comm: &mut dyn Comm) -> Result<(), SnapshotError> {
    on_root(path, comm, || std::fs::create_dir_all(path))
}

/// Calls `act` on rank 0; all ranks fail if it fails.
fn on_root(
    path: &Path,
    comm: &mut dyn Comm,
    act: impl FnOnce() -> io::Result<()>,
) -> Result<(), SnapshotError> {
    let done = if comm.is_root() { act() } else { Ok(()) };
    let done = done.map_err(|e| SnapshotError::write(path, comm, &e));
    agree(comm, done)
}
