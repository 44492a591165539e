//! `history.csv`: the scalars of a run by time. Rank 0 writes; every digit is the same on any number of ranks.
//!
//! Values of a row are those of its step, with one exception: walls with a servo. Their `force_*` is the mean over the steps
//! since the previous row (`history_every`); in the first row of a stage it is the value of the step. Their `stress_*` is the
//! normal part of this mean over the present area. A servo corrects itself within a few steps, so that values sampled at even
//! intervals could be arbitrary. A restart does not change a digit.
//!
//! Every wall has the force of the particles on it. Further columns depend on the wall:
//!
//! - Walls that turn, or have `torque_about`: torque about that point, by default the reference point.
//! - Walls that move: power, the work per time that they do on the particles, from the present forces and the velocities of the
//!   previous step; velocity; and the reference point, unless the place gives it.
//! - Walls that turn: angular velocity, and rotation since the start as axis times angle (at most π).
//!
//! The last columns are the counts of drives ([`crate::drive::Reporter::counted`]): particles that entered through inlets or left
//! through outlets, work of walls and losses at walls ([`crate::drive::ledger`]).
//!
//! A sheared cell has the column of its strain, and a cell carried by a flow those of its strains. Both have the stresses and the
//! solid fraction of [`crate::measure::Bulk`].

use super::growing::{GrowingTable, TableError};
use crate::cell::AXES;
use crate::cell::Cell;
use crate::math::Vec3;
use crate::measure::{COMPONENTS, Measures};
use crate::particles::columns::Quantity;
use crate::walls::{Across, Wall, area};
use std::path::Path;

/// The open table.
#[derive(Debug)]
pub struct History {
    table: GrowingTable,
    columns: Columns,
}

/// The columns of a run.
#[derive(Debug)]
pub struct Columns {
    cell: Cell,
    /// Optional columns of each wall.
    of_walls: Vec<OfWall>,
}

/// Quantities that are written for a wall besides force, place and stress.
#[derive(Clone, Copy, Debug)]
struct OfWall {
    torque: bool,
    point: bool,
    turn: bool,
}

impl OfWall {
    fn of(wall: &Wall) -> Self {
        let turn = wall.moves && wall.may_turn();
        let point = wall.moves && wall.across().is_none();
        Self { torque: wall.torque.is_some() || turn, point, turn }
    }

    /// Name and value of each column, from the force on the wall [N], the torque about its reference point [N m] and the power of
    /// a belt [W].
    fn columns(self, wall: &Wall, force: &Vec3, torque: &Vec3, of_belt: f64) -> Vec<(String, f64)> {
        let name = &wall.name;
        let three = |is_there: bool, what: &str, vector: Vec3, unit: &str| {
            let one = |axis| (format!("{what}_{name}_{}_{unit}", AXES[axis]), vector[axis]);
            (0..3).filter(|_| is_there).map(one).collect::<Vec<_>>()
        };
        let power = || (format!("power_{name}_W"), wall.power(force, torque) + of_belt);
        let turned = wall.orientation.scaled_axis();
        three(self.torque, "torque", wall.torque_of(torque, force), "N_m")
            .into_iter()
            .chain(wall.may_work().then(power))
            .chain(three(wall.moves, "velocity", wall.velocity, "m_per_s"))
            .chain(three(self.point, "point", wall.point, "m"))
            .chain(three(self.turn, "angular_velocity", wall.angular_velocity, "rad_per_s"))
            .chain(three(self.turn, "turned", turned, "rad"))
            .collect()
    }
}

/// Data of a row.
pub struct Row<'a> {
    /// Number of steps since the very first stage began.
    pub step: u64,
    /// Time since the very first stage began [s].
    pub time: f64,
    /// Measures of the whole system.
    pub measures: &'a Measures,
    /// Forces on the walls [N].
    pub forces: &'a [Vec3],
    /// The walls of [`History::open`] in their present positions.
    pub walls: &'a [Wall],
    /// Counts of drives.
    pub own: &'a [f64],
}

/// Name of a column, and its value in a row.
type Column = (&'static str, fn(&Row) -> String);

/// Columns of every table, before those of walls and drives.
const COLUMNS: [Column; 26] = [
    ("step", |row| row.step.to_string()),
    ("time_s", |row| row.time.to_string()),
    ("particles", |row| row.measures.particles.to_string()),
    ("contacts", |row| row.measures.contacts.to_string()),
    ("wall_contacts", |row| row.measures.wall_contacts.to_string()),
    ("coordination", |row| digits(row.measures.coordination())),
    ("kinetic_J", |row| digits(row.measures.kinetic())),
    ("translation_J", |row| digits(row.measures.translation)),
    ("rotation_J", |row| digits(row.measures.rotation)),
    ("gravity_J", |row| digits(row.measures.gravity)),
    ("stored_J", |row| digits(row.measures.stored)),
    ("step_energy_J", |row| digits(row.measures.step_energy)),
    ("dissipated_J", |row| digits(row.measures.dissipated)),
    ("dissipated_by_normal_dashpots_J", |row| digits(row.measures.of_normal_dashpots())),
    ("dissipated_by_tangential_dashpots_J", |row| row.taken_by(Quantity::OfTangentialDashpots)),
    ("dissipated_by_friction_J", |row| row.taken_by(Quantity::OfFriction)),
    ("dissipated_by_turning_J", |row| row.taken_by(Quantity::OfTurning)),
    ("dissipated_by_damping_J", |row| row.taken_by(Quantity::OfDamping)),
    ("dissipated_by_adhesion_J", |row| row.taken_by(Quantity::OfAdhesion)),
    ("received_J", |row| digits(row.measures.received)),
    ("missing_J", |row| digits(row.measures.missing())),
    ("mean_normal_force_N", |row| digits(row.measures.mean_normal_force)),
    ("largest_overlap", |row| digits(row.measures.largest_overlap)),
    ("largest_speed_m_per_s", |row| digits(row.measures.largest_speed)),
    ("top_m", |row| digits(row.measures.top)),
    ("unbalanced", |row| digits(row.measures.unbalanced)),
];

impl Row<'_> {
    fn taken_by(&self, channel: Quantity) -> String {
        digits(self.measures.taken_by(channel))
    }
}

/// Digits enough to distinguish a number from all others.
fn digits(number: f64) -> String {
    format!("{number:e}")
}

/// True if every table has a column of this name.
pub fn has_column(name: &str) -> bool {
    COLUMNS.iter().any(|(column, _)| *column == name)
}

/// Walls whose place and stress are written: all walls across an axis if any wall moves.
fn written(walls: &[Wall]) -> impl Iterator<Item = (usize, &Wall, Across)> {
    let any_moves = walls.iter().any(|wall| wall.moves);
    let walls = walls.iter().enumerate().filter(move |_| any_moves);
    walls.filter_map(|(k, wall)| wall.across().map(|across| (k, wall, across)))
}

/// Walls whose stress is written, with the area that carries it [m²], see [`area`]. Walls that are not planes across an axis do
/// not reduce this area.
pub fn stressed<'a>(walls: &'a [Wall], cell: &'a Cell) -> impl Iterator<Item = (&'a Wall, f64)> {
    written(walls)
        .filter_map(|(_, wall, Across { axis, .. })| Some((wall, area(walls, cell, axis)?)))
}

impl Columns {
    /// Columns for these walls and this cell.
    pub fn of(walls: &[Wall], cell: Cell) -> Self {
        Self { cell, of_walls: walls.iter().map(OfWall::of).collect() }
    }

    /// Names of the columns; those of drives come last.
    pub fn names(&self, walls: &[Wall], own: &[String]) -> Vec<String> {
        let Self { cell, of_walls } = self;
        let mut columns = COLUMNS.map(|(name, _)| name.to_owned()).to_vec();
        for Wall { name, .. } in walls {
            columns.extend(AXES.map(|axis| format!("force_{name}_{axis}_N")));
        }
        for (_, Wall { name, .. }, Across { axis, .. }) in written(walls) {
            columns.push(format!("place_{name}_m"));
            columns.extend(area(walls, cell, axis).map(|_| format!("stress_{name}_Pa")));
        }
        let none = Vec3::zeros();
        let names = |(wall, of): (_, &OfWall)| of.columns(wall, &none, &none, 0.0).into_iter();
        columns.extend(walls.iter().zip(of_walls).flat_map(names).map(|(name, _)| name));
        if cell.moves() {
            let component = |[i, j]: [usize; 2]| format!("strain_{}{}", AXES[i], AXES[j]);
            match cell.strained() {
                Some(_) => columns.extend(COMPONENTS.map(component)),
                None => columns.push("strain".to_owned()),
            }
            for kind in ["contact", "kinetic"] {
                let name = |[i, j]: [usize; 2]| format!("{kind}_stress_{}{}_Pa", AXES[i], AXES[j]);
                columns.extend(COMPONENTS.map(name));
            }
            columns.push("solid_fraction".to_owned());
        }
        columns.extend_from_slice(own);
        columns
    }

    /// Values of the columns in a row, as text.
    pub fn numbers(&self, row: &Row) -> Vec<String> {
        let &Row { measures, forces, walls, own, .. } = row;
        let moved = written(walls).flat_map(|(k, wall, Across { axis, place, .. })| {
            let stress = |area| wall.press(&forces[k]) / area;
            let stress = area(walls, &self.cell, axis).map(stress);
            [Some(place), stress].into_iter().flatten()
        });
        let always = COLUMNS.iter().map(|(_, number)| number(row));
        let of_walls = (forces.iter().flat_map(|force| force.iter().copied()))
            .chain(moved)
            .chain(self.of_walls.iter().enumerate().flat_map(|(k, of)| {
                let (torque, of_belt) = (&measures.wall_torques[k], measures.belt_powers[k]);
                let columns = of.columns(&walls[k], &measures.wall_forces[k], torque, of_belt);
                columns.into_iter().map(|(_, number)| number)
            }))
            .chain(measures.bulk.iter().flat_map(|bulk| {
                let stresses = bulk.of_contacts.into_iter().chain(bulk.of_motion);
                let strains = bulk.strains.map_or_else(|| vec![bulk.strain], Vec::from);
                strains.into_iter().chain(stresses).chain([bulk.solid_fraction])
            }))
            .chain(own.iter().copied())
            .map(digits);
        always.chain(of_walls).collect()
    }
}

impl History {
    /// Opens `history.csv` in `directory` as [`GrowingTable::open`] does, with the `own` columns after all others.
    ///
    /// # Errors
    /// If the file cannot be read or written.
    pub fn open(
        directory: &Path,
        walls: &[Wall],
        cell: Cell,
        own: &[String],
        keep: impl Fn(u64) -> bool,
    ) -> Result<Self, TableError> {
        let columns = Columns::of(walls, cell);
        let names = columns.names(walls, own);
        let table = GrowingTable::open(directory, "history.csv", names, keep)?;
        Ok(Self { table, columns })
    }

    /// Waits until all rows are on the disk, before a snapshot that continues from them.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn sync(&self) -> Result<(), TableError> {
        self.table.sync()
    }

    /// Appends a row.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn push(&mut self, row: &Row) -> Result<(), TableError> {
        self.table.push(self.columns.numbers(row).into_iter())?;
        self.table.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::{COLUMNS, History, Row};
    use crate::cell::Cell;
    use crate::math::Vec3;
    use crate::measure::Measures;
    use crate::walls::Wall;

    /// A name may contain the separator of columns.
    #[test]
    fn any_name_of_a_wall_stays_in_its_column() {
        let (point, normal) = (Vec3::zeros(), Vec3::z());
        let name = "left, \"upper\"".to_owned();
        let wall = Wall::plane(name, point, normal);
        let folder = tempfile::tempdir().unwrap();
        drop(History::open(folder.path(), &[wall], Cell::OPEN, &[], |_| false).unwrap());
        let mut reader = csv::Reader::from_path(folder.path().join("history.csv")).unwrap();
        let header = reader.headers().unwrap();
        assert_eq!(header.len(), COLUMNS.len() + 3);
        assert_eq!(&header[COLUMNS.len()], "force_left, \"upper\"_x_N");
    }

    /// Rows keep their columns when walls are added, removed or reordered.
    #[test]
    fn rows_stay_under_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let walls = |names: &[&str]| -> Vec<Wall> {
            names.iter().map(|name| Wall::plane((*name).into(), Vec3::zeros(), Vec3::z())).collect()
        };
        let write = |names: &[&str], step: u64| {
            let walls = walls(names);
            let mut table =
                History::open(folder.path(), &walls, Cell::OPEN, &[], |old| old < step).unwrap();
            let forces: Vec<Vec3> =
                names.iter().map(|name| Vec3::x() * f64::from(name.as_bytes()[0])).collect();
            let measures = Measures {
                wall_forces: forces.clone(),
                wall_torques: forces.clone(),
                belt_powers: vec![0.0; forces.len()],
                ..Measures::default()
            };
            let (measures, forces, walls) = (&measures, &*forces, &*walls);
            table.push(&Row { step, time: 0.0, measures, forces, walls, own: &[] }).unwrap();
        };
        write(&["a", "b, c"], 1);
        write(&["d", "a"], 2);
        // A row of a run that was stopped, and half of another row.
        let path = folder.path().join("history.csv");
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, format!("{text}3,0\n4,0,")).unwrap();
        write(&["b, c", "d"], 5);
        let mut reader = csv::Reader::from_path(&path).unwrap();
        let names = reader.headers().unwrap().clone();
        let rows: Vec<csv::StringRecord> = reader.records().collect::<Result<_, _>>().unwrap();
        let force = |row: usize, wall: &str| {
            let name = format!("force_{wall}_x_N");
            rows[row][names.iter().position(|n| n == name).unwrap()].to_owned()
        };
        let of = |row| ["a", "b, c", "d"].map(|wall| force(row, wall));
        assert_eq!(of(0), ["9.7e1", "9.8e1", ""]);
        assert_eq!(of(1), ["9.7e1", "", "1e2"]);
        assert_eq!(of(2), ["", "", ""]);
        assert_eq!(of(3), ["", "9.8e1", "1e2"]);
        assert_eq!(
            rows.iter().map(|row| row[0].to_owned()).collect::<Vec<_>>(),
            ["1", "2", "3", "5"]
        );
    }
}
