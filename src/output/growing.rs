//! A CSV file that a run extends by rows, with the step in the first column. Rank 0 writes.
//!
//! A run that continues from a snapshot continues the file. Rows that it will write again are dropped, and so is an incomplete
//! line left by a crash.

use crate::files;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The table could not be written.
#[derive(Clone, Debug, thiserror::Error, Serialize, Deserialize)]
#[error("cannot write {path}: {cause}. Check that the directory exists, is writable and has space")]
pub struct TableError {
    /// Path of the file.
    pub path: PathBuf,
    /// Cause of the error.
    pub cause: String,
}

/// The open file.
#[derive(Debug)]
pub struct GrowingTable {
    path: PathBuf,
    writer: csv::Writer<File>,
    /// Number of last columns that belong to earlier runs only.
    former: usize,
}

impl GrowingTable {
    /// Opens the file `name` in `directory` with these columns. Existing rows of the steps that `keep` accepts stay, so that a
    /// run that continues from a snapshot continues its table. A column that only the old or the new rows have is empty in the
    /// others.
    ///
    /// # Errors
    /// If the file cannot be read or written.
    pub fn open(
        directory: &Path,
        name: &str,
        mut columns: Vec<String>,
        keep: impl Fn(u64) -> bool,
    ) -> Result<Self, TableError> {
        let path = directory.join(name);
        let failed =
            |e: &dyn std::fmt::Display| TableError { path: path.clone(), cause: e.to_string() };
        let before = if path.exists() { files::read(&path) } else { Ok(Vec::new()) };
        let (names, rows) = kept(&before.map_err(|e| failed(&e))?, keep).map_err(|e| failed(&e))?;
        if names.get(0).is_some_and(|first| first != columns[0]) {
            return Err(failed(&format!(
                "its first column is not `{}`, so no run wrote it: move it away",
                columns[0]
            )));
        }
        let known = columns.len();
        let is_former = |name: &&str| !rows.is_empty() && !columns.iter().any(|new| new == name);
        let former: Vec<String> = names.iter().filter(is_former).map(str::to_owned).collect();
        columns.extend(former);
        let place = |name| names.iter().position(|old| old == name);
        let places: Vec<Option<usize>> = columns.iter().map(place).collect();
        let mut table = csv::Writer::from_writer(Vec::new());
        table.write_record(&columns).map_err(|e| failed(&e))?;
        for row in &rows {
            let cells = places.iter().map(|place| place.and_then(|k| row.get(k)).unwrap_or(""));
            table.write_record(cells).map_err(|e| failed(&e))?;
        }
        let text = table.into_inner().map_err(|e| failed(&e))?;
        // A complete file replaces the old one, so that earlier rows exist at any moment.
        let file = files::replace(&path, |file| file.write_all(&text)).map_err(|e| failed(&e))?;
        let writer = csv::WriterBuilder::new().has_headers(false).from_writer(file);
        Ok(Self { path, writer, former: columns.len() - known })
    }

    /// Appends a row of all columns given to `open`. It is in the file after [`GrowingTable::flush`].
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn push(&mut self, cells: impl Iterator<Item = String>) -> Result<(), TableError> {
        let cells = cells.chain(std::iter::repeat_n(String::new(), self.former));
        self.writer.write_record(cells).map_err(|e| self.failed(&e))
    }

    /// Hands all rows to the operating system.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn flush(&mut self) -> Result<(), TableError> {
        self.writer.flush().map_err(|e| self.failed(&e))
    }

    /// Waits until all flushed rows are on the disk, before a snapshot that continues from them.
    ///
    /// # Errors
    /// If they cannot be written, or the file has been removed or replaced since it was opened.
    pub fn sync(&self) -> Result<(), TableError> {
        let file = self.writer.get_ref();
        let synced = file.sync_data().and_then(|()| files::is_there(&self.path, file));
        match synced {
            Ok(true) => Ok(()),
            Ok(false) => {
                Err(self
                    .failed(&"it was removed or replaced during the run, and its rows are lost"))
            }
            Err(error) => Err(self.failed(&error)),
        }
    }

    fn failed(&self, cause: &dyn std::fmt::Display) -> TableError {
        TableError { path: self.path.clone(), cause: cause.to_string() }
    }
}

/// Text up to the end of its last complete line: a crash or a full disk may leave an incomplete one.
pub fn whole_lines(text: &[u8]) -> &[u8] {
    let end = text.iter().rposition(|&byte| byte == b'\n');
    &text[..end.map_or(0, |end| end + 1)]
}

/// Names of the columns, and the rows of the steps that `keep` accepts.
fn kept(
    text: &[u8],
    keep: impl Fn(u64) -> bool,
) -> csv::Result<(csv::StringRecord, Vec<csv::StringRecord>)> {
    let mut table = csv::ReaderBuilder::new().flexible(true).from_reader(whole_lines(text));
    let names = table.headers()?.clone();
    let mut rows = table.records().collect::<csv::Result<Vec<_>>>()?;
    rows.retain(|row| row.get(0).and_then(|step| step.parse().ok()).is_some_and(&keep));
    Ok((names, rows))
}
