//! Reading a snapshot's files. Stands in for the reader of the files until that is merged: it can only
//! say that it cannot.

use super::SnapshotError;
use super::tables::{ContactTable, Header, ParticleTable};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A snapshot, open for reading.
#[derive(Debug)]
pub struct Reader {
    path: PathBuf,
    header: Header,
}

impl Reader {
    /// Opens a particles file and the contacts file beside it.
    ///
    /// # Errors
    /// A file that is not there or is no snapshot.
    pub fn open(path: &Path) -> Result<Self, SnapshotError> {
        Err(SnapshotError::NoReader { path: path.to_path_buf() })
    }

    /// What the snapshot says once.
    pub const fn header(&self) -> &Header {
        &self.header
    }

    /// How many particles.
    pub const fn particle_count(&self) -> usize {
        0
    }

    /// A piece of the particles.
    ///
    /// # Errors
    /// A file that ends early.
    pub fn particles(&self, _rows: Range<usize>) -> Result<ParticleTable, SnapshotError> {
        Err(SnapshotError::NoReader { path: self.path.clone() })
    }

    /// How many contacts.
    ///
    /// # Errors
    /// No contacts file beside the particles.
    pub fn contact_count(&self) -> Result<usize, SnapshotError> {
        Err(SnapshotError::NoReader { path: self.path.clone() })
    }

    /// A piece of the contacts.
    ///
    /// # Errors
    /// A file that ends early.
    pub fn contacts(&self, _rows: Range<usize>) -> Result<ContactTable, SnapshotError> {
        Err(SnapshotError::NoReader { path: self.path.clone() })
    }
}
