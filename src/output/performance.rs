//! `performance.csv`: work and cost of a run, one row for each start that came to an end. Rank 0 writes it after
//! all other output.

use super::growing::{TableError, whole_lines};
use super::report::Report;
use crate::files;
use crate::timing::Phase;
use serde::{Deserialize, Serialize};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

/// A row of the table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Performance {
    /// Ranks that shared the work.
    pub ranks: u32,
    /// Number of steps done.
    pub steps: u64,
    /// Particles of all ranks, summed over the steps.
    pub particle_steps: u64,
    /// Wall-clock time [s].
    pub wall_s: f64,
    /// Time of contact resolution, summed over the ranks [s].
    pub contact_resolution_s: f64,
    /// Pairs in the neighbour lists, summed over ranks and steps.
    pub listed_pairs: u64,
    /// Listed pairs that were resolved.
    pub resolved_pairs: u64,
    /// Resolved pairs that touch.
    pub contacts: u64,
}

fn path(directory: &Path) -> PathBuf {
    directory.join("performance.csv")
}

impl Performance {
    /// Row of a report.
    pub fn of(report: &Report) -> Self {
        let Report { run, contacts, .. } = report;
        Self {
            ranks: run.ranks,
            steps: run.steps,
            particle_steps: run.particle_steps,
            wall_s: run.wall_s,
            contact_resolution_s: report.spent(Phase::Contacts).map_or(0.0, |spent| spent.total_s),
            listed_pairs: contacts.listed_pairs,
            resolved_pairs: contacts.resolved_pairs,
            contacts: contacts.contacts,
        }
    }

    /// Writes the row into `directory`: below earlier rows if the run continues a table, otherwise as the first.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn store(&self, directory: &Path, continues: bool) -> Result<(), TableError> {
        let path = path(directory);
        let written = || -> io::Result<()> {
            let is_first = !(continues && path.exists());
            let before = if is_first { Vec::new() } else { files::read(&path)? };
            files::replace(&path, |file| {
                file.write_all(whole_lines(&before))?;
                let mut table = csv::WriterBuilder::new().has_headers(is_first).from_writer(file);
                table.serialize(self).map_err(io::Error::from)?;
                table.flush()
            })
            .map(drop)
        };
        written().map_err(|cause| TableError { path: path.clone(), cause: cause.to_string() })
    }

    /// Rows of the table in `directory`, in the order in which they were written; empty if there is no table.
    ///
    /// # Errors
    /// If the table cannot be read.
    pub fn read(directory: &Path) -> Result<Vec<Self>, csv::Error> {
        let path = path(directory);
        if !path.exists() {
            return Ok(Vec::new());
        }
        csv::Reader::from_reader(files::open(&path)?).deserialize().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Performance;

    #[test]
    fn rows_are_read_as_they_were_written() {
        let row = |steps| Performance {
            ranks: 2,
            steps,
            particle_steps: 64 * steps,
            wall_s: 0.1 * steps as f64,
            contact_resolution_s: 1.0 / 3.0,
            listed_pairs: 7 * steps,
            resolved_pairs: 5 * steps,
            contacts: 3 * steps,
        };
        let folder = tempfile::tempdir().unwrap();
        let rows = || Performance::read(folder.path()).unwrap();
        assert_eq!(rows(), []);
        row(10).store(folder.path(), true).unwrap();
        row(20).store(folder.path(), true).unwrap();
        assert_eq!(rows(), [row(10), row(20)]);
        row(30).store(folder.path(), false).unwrap();
        assert_eq!(rows(), [row(30)]);
        let gone = folder.path().join("gone");
        let error = row(1).store(&gone, false).unwrap_err().to_string();
        assert!(error.contains("cannot write") && error.contains("performance.csv"), "{error}");
        std::fs::write(folder.path().join("performance.csv"), "ranks\ntwo\n").unwrap();
        assert!(Performance::read(folder.path()).is_err());
    }
}
