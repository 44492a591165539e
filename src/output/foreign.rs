//! HDF5 files of other programs, which have no checksums and may have any types of numbers.

use hdf5_metno::types::VarLenUnicode;
use hdf5_metno::{File, H5Type};
use std::path::Path;

/// Largest ratio of bytes in memory to bytes in a file: `deflate` reaches 1,032, and narrow numbers become eight times as wide.
const MOST_PACKED: u64 = 8 * 1032;

/// A file of another program, for reading.
///
/// HDF5 itself reads its structures, so a damaged file may end the program.
pub struct ForeignFile {
    file: File,
    /// Length [bytes].
    length: u64,
}

/// Numbers of a dataset, row by row, and how many a row has.
pub type Table<T> = (usize, Vec<T>);

impl ForeignFile {
    /// Opens a file.
    ///
    /// # Errors
    /// The message of the system or of HDF5.
    pub fn open(path: &Path) -> Result<Self, String> {
        let length = std::fs::metadata(path).map_err(|e| e.to_string())?.len();
        let file = File::open(path).map_err(|e| e.to_string())?;
        Ok(Self { file, length })
    }

    /// Reads a dataset as numbers of this type, or `None` if there is no such dataset.
    ///
    /// # Errors
    /// If it has no numbers.
    pub fn table<T: H5Type>(&self, place: &str) -> Result<Option<Table<T>>, String> {
        let Ok(dataset) = self.file.dataset(place) else { return Ok(None) };
        let width = dataset.shape().iter().skip(1).product();
        // A file may declare any number of values.
        let declared = dataset.size().saturating_mul(size_of::<T>()) as u64;
        if declared > dataset.storage_size().min(self.length).saturating_mul(MOST_PACKED) {
            return Err(format!("{place}: it has more values than the file can hold"));
        }
        let values = dataset.read_raw().map_err(|e| format!("{place}: {e}"))?;
        Ok(Some((width, values)))
    }

    /// Reads a dataset that is one text of any length, or `None` if there is no such dataset.
    pub fn word(&self, place: &str) -> Option<String> {
        let word = self.file.dataset(place).ok()?.read_scalar::<VarLenUnicode>();
        word.ok().map(|word| word.to_string())
    }
}
