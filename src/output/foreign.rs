//! HDF5 files of other programs, which have no checksums and may have any types of numbers.

use hdf5_metno::types::VarLenUnicode;
use hdf5_metno::{File, H5Type};
use std::path::Path;

/// A file of another program, for reading.
///
/// HDF5 itself reads its structures, so a damaged file may end the program.
pub struct ForeignFile(File);

/// Numbers of a dataset, row by row, and how many a row has.
pub type Table<T> = (usize, Vec<T>);

impl ForeignFile {
    /// Opens a file.
    ///
    /// # Errors
    /// The message of the system or of HDF5.
    pub fn open(path: &Path) -> Result<Self, String> {
        std::fs::metadata(path).map_err(|e| e.to_string())?;
        File::open(path).map(Self).map_err(|e| e.to_string())
    }

    /// Reads a dataset as numbers of this type, or `None` if there is no such dataset.
    ///
    /// # Errors
    /// If it has no numbers.
    pub fn table<T: H5Type>(&self, place: &str) -> Result<Option<Table<T>>, String> {
        let Ok(dataset) = self.0.dataset(place) else { return Ok(None) };
        let width = dataset.shape().iter().skip(1).product();
        let values = dataset.read_raw().map_err(|e| format!("{place}: {e}"))?;
        Ok(Some((width, values)))
    }

    /// Reads a dataset that is one text of any length, or `None` if there is no such dataset.
    pub fn word(&self, place: &str) -> Option<String> {
        let word = self.0.dataset(place).ok()?.read_scalar::<VarLenUnicode>();
        word.ok().map(|word| word.to_string())
    }
}
