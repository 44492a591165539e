//! What is written: snapshots, the table of a run's scalars, and lists of what comes and goes.
//!
//! | file | what it is |
//! |---|---|
//! | [`header`] | what a snapshot says once: when, where, with what walls and shapes |
//! | [`tables`] | what a snapshot holds of particles and contacts: each column is declared once, with its place in the files |
//! | [`columns`] | what a column holds: numbers of any kind, in memory and in files |
//! | [`order`] | rows by id: from the ranks that have them to the ranks that write them |
//! | [`snapshot`] | [`snapshot::write`] and [`snapshot::Reader`]: tables to files and back |
//! | [`series`] | the lists by which ParaView knows the times of snapshots |
//! | [`growing`] | files of rows that grow as a run goes on, and go on with it |
//! | [`table`] | `history.csv`, the scalars of a run by time |
//! | [`lists`] | `entered_NAME.csv`, `left_NAME.csv`: grains that came through an inlet or left through an outlet |
//! | [`report`] | `report.json`, all figures of a run at its end, and the same as text |
//! | [`performance`] | `performance.csv`, what a run did and what it took |
//! | [`hdf5`] | the only file that calls HDF5: columns and attributes |
//! | [`seal`] | that a file is whole: checksums, and room on the disk |
//!
//! With MPI all ranks write a large snapshot together, each the rows of a range of ids; a small one, or one without MPI,
//! rank 0 gathers and writes. The files are the same, whatever the number of ranks.
//!
//! A file appears under its own name only when it is complete and on the disk, so a crash leaves
//! the last good snapshot. It ends with a [`seal::checksum`] of all its bytes, and every dataset carries
//! one of its own: a file cut short and a flipped bit are found before anything else looks at it.

pub mod columns;
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
        "cannot write {path} (rank {rank}): {cause}. \
         Snapshots written before are untouched; check the disk and the name, then restart from the last"
    )]
    Write {
        /// The file or directory.
        path: String,
        /// The lowest rank that failed.
        rank: u32,
        /// The message of the system or of HDF5.
        cause: String,
    },
    /// The folder of output cannot be made, or takes no files.
    #[error(
        "no run can write into {path}: {cause}. Give another folder, by --out or by output.directory"
    )]
    Folder {
        /// The directory.
        path: String,
        /// The message of the system.
        cause: String,
    },
    /// Another run writes to the same directory.
    #[error(
        "another run is writing to {path}. Wait for its end, or give this one a directory of its own: \
         --out DIR, or output.directory in the scene"
    )]
    Busy {
        /// The directory.
        path: String,
    },
    /// The directory has snapshots of another run, or of this one's future.
    #[error(
        "{path} has snapshots up to step {newest}, and this run begins at step {step}. \
         Go on from the newest with --start {path}, give this run a directory of its own with --out DIR, \
         or have the later ones removed with --overwrite"
    )]
    Later {
        /// The directory.
        path: String,
        /// Where this run begins.
        step: u64,
        /// The latest step there.
        newest: u64,
    },
    /// A stage should go into the folder of the stage before.
    #[error(
        "{path} is the folder of the stage that `start` goes on from, and a stage keeps the snapshots of the one before. \
         Give it a folder of its own: --out DIR, or output.directory in the scene"
    )]
    StageBefore {
        /// The directory.
        path: String,
    },
    /// A file of somebody else has the name of one that a run writes.
    #[error(
        "no run wrote {path}, and this one would replace it: move it away, give this run a folder of its own with --out DIR, \
         or have it replaced with --overwrite"
    )]
    Foreign {
        /// The file.
        path: String,
    },
    /// A table handed to the writer has columns of different lengths.
    #[error(
        "rank {rank} gave {rows} rows of `{column}` where {expected} belong: a bug of the caller"
    )]
    Uneven {
        /// The rank whose table it is.
        rank: u32,
        /// The column.
        column: String,
        /// How many rows it has.
        rows: usize,
        /// How many rows the table has.
        expected: usize,
    },
    /// No such file.
    #[error(
        "there is no snapshot at {path} ({cause}). \
         Give a file particles_<step>.vtkhdf, or a directory with such files"
    )]
    Missing {
        /// Where it was looked for.
        path: String,
        /// The message of the system.
        cause: String,
    },
    /// Output should go where a file is.
    #[error(
        "{path} is a file, and a run writes into a folder: give another --out, or output.directory"
    )]
    NoFolder {
        /// Its name.
        path: String,
    },
    /// Not a snapshot, cut short, or damaged in its structure.
    #[error(
        "{path} cannot be read as a snapshot: {cause}. \
         If a run wrote it, the file is cut short or damaged: use an earlier snapshot"
    )]
    Unreadable {
        /// The file.
        path: String,
        /// What is wrong.
        cause: String,
    },
    /// The bytes of a dataset are not those that were written.
    #[error(
        "{path}: the checksum of {dataset} is wrong: its bytes changed after they were written. \
         Use an earlier snapshot, and check the disk"
    )]
    Damaged {
        /// The file.
        path: String,
        /// The dataset.
        dataset: String,
    },
    /// A directory whose snapshots are all damaged.
    #[error("{path} has no snapshot that can be used:\n  {}", .causes.join("\n  "))]
    NoneGood {
        /// The directory.
        path: String,
        /// What is wrong with each, the newest first.
        causes: Vec<String>,
    },
    /// Rows were asked for that are not there.
    #[error("{path}: rows {first}..{end} of {dataset} were asked for, but it has {rows}")]
    Beyond {
        /// The file.
        path: String,
        /// The dataset.
        dataset: String,
        /// First row asked for.
        first: usize,
        /// One past the last row asked for.
        end: usize,
        /// Rows there are.
        rows: usize,
    },
}

impl SnapshotError {
    fn write(path: &Path, comm: &dyn Comm, cause: &impl ToString) -> Self {
        Self::Write { path: name_of(path), rank: comm.rank().0, cause: cause.to_string() }
    }

    /// Before anything is written, a folder is at fault.
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

/// A path as errors show it.
fn name_of(path: &Path) -> String {
    path.display().to_string()
}

/// Creates the directory of a run's output, if it is missing, and keeps other runs out of it for as long as rank 0
/// holds what it gets, or lives. Where the file system has no locks, nobody is kept out. Collective.
///
/// # Errors
/// On all ranks, if rank 0 cannot create it, or another run has it.
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

/// The file in a run's directory that rank 0 has locked.
const LOCK: &str = ".lock";

/// Creates the directory of a run's output, if it is missing. Collective.
///
/// # Errors
/// On all ranks, if rank 0 cannot.
pub fn make_directory(path: &Path, comm: &mut dyn Comm) -> Result<(), SnapshotError> {
    on_root(path, comm, || std::fs::create_dir_all(path))
}

/// Does something to a file on rank 0; all ranks fail if it fails.
fn on_root(
    path: &Path,
    comm: &mut dyn Comm,
    act: impl FnOnce() -> io::Result<()>,
) -> Result<(), SnapshotError> {
    let done = if comm.is_root() { act() } else { Ok(()) };
    let done = done.map_err(|e| SnapshotError::write(path, comm, &e));
    agree(comm, done)
}
