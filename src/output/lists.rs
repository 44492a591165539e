//! `entered_NAME.csv` and `left_NAME.csv`: particles that entered through an inlet or left through an outlet with a list
//! ([`crate::drive::Observer::lists`]). They have one row for each particle, by step, then by id. Rank 0 writes; every digit is
//! the same on any number of ranks.
//!
//! A row holds the state at the end of the step at which a particle is present for the first time, or is gone. The velocity of a
//! particle that is gone is that at the end of the step, if no contact acted in its last half.

use super::growing::{GrowingTable, TableError};
use crate::particles::records::Particle;
use crate::population::Library;
use std::path::Path;

const COLUMNS: [&str; 12] = [
    "step",
    "time_s",
    "id",
    "shape",
    "scale",
    "mass_kg",
    "x_m",
    "y_m",
    "z_m",
    "vx_m_per_s",
    "vy_m_per_s",
    "vz_m_per_s",
];

/// An open list.
#[derive(Debug)]
pub struct List {
    table: GrowingTable,
}

impl List {
    /// Opens `NAME.csv` in `directory`, see [`GrowingTable::open`].
    ///
    /// # Errors
    /// If the file cannot be read or written.
    pub fn open(
        directory: &Path,
        name: &str,
        keep: impl Fn(u64) -> bool,
    ) -> Result<Self, TableError> {
        let columns = COLUMNS.map(str::to_owned).to_vec();
        Ok(Self { table: GrowingTable::open(directory, &format!("{name}.csv"), columns, keep)? })
    }

    /// Appends the particles that have passed at a step and time [s], in the order of their ids.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn push<'a>(
        &mut self,
        (step, time): (u64, f64),
        grains: impl Iterator<Item = &'a Particle>,
        library: &Library,
    ) -> Result<(), TableError> {
        for grain in grains {
            let Particle { id, shape, scale, position, velocity, .. } = grain;
            let names = [
                step.to_string(),
                time.to_string(),
                id.0.to_string(),
                library.names[shape.index()].clone(),
            ];
            let numbers = [*scale, library.mass_at(*shape, *scale)]
                .into_iter()
                .chain(position.iter().chain(velocity.iter()).copied())
                .map(|number| format!("{number:e}"));
            self.table.push(names.into_iter().chain(numbers))?;
        }
        self.table.flush()
    }

    /// Waits until all rows are on the disk, before a snapshot that continues from them.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn sync(&self) -> Result<(), TableError> {
        self.table.sync()
    }
}
