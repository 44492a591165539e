//! What acts on the particles from outside: drives.
//!
//! A simulation holds a list of drives and knows none of them by name. In each step every drive of the list may, in the
//! order of the list,
//!
//! 1. ask for sums over all ranks, which are found while the particles move ([`Drive::sums`]);
//! 2. give walls their velocities and angular velocities ([`Drive::steer`]);
//! 3. insert particles, before the list of pairs is made ([`Drive::insert`]);
//! 4. take out particles that have left the domain or have reached where they leave ([`Drive::reaches`], [`Drive::take`]);
//! 5. look at the forces ([`Drive::after_forces`], at the start of a stage [`Drive::first_forces`]).
//!
//! After the step a run writes down the grains that drives have listed ([`Drive::lists`], [`Drive::listed`]).
//!
//! The state of a drive is the same on all ranks, but for sums that are not yet added up. It is saved in snapshots under the
//! drive's name ([`Drive::save`], [`Drive::resume`]).
//!
//! # A drive of one's own
//!
//! This one is whole: it shakes a wall.
//!
//! ```
//! use dem_mpi::cell::Cell;
//! use dem_mpi::comm::alone::Alone;
//! use dem_mpi::drive::{Drive, DriveError, Moment};
//! use dem_mpi::particles::walls::Wall;
//! use dem_mpi::scene::{Scene, assemble};
//! use std::f64::consts::TAU;
//! use std::path::Path;
//!
//! /// Moves a wall along its normal by `amplitude sin(2π frequency t)`.
//! struct Shaker {
//!     wall: String,
//!     /// [m]
//!     amplitude: f64,
//!     /// [1/s]
//!     frequency: f64,
//! }
//!
//! impl Shaker {
//!     fn place(&self, time: f64) -> f64 {
//!         self.amplitude * (TAU * self.frequency * time).sin()
//!     }
//! }
//!
//! impl Drive for Shaker {
//!     fn name(&self) -> &str {
//!         "shaker"
//!     }
//!
//!     fn steer(
//!         &mut self,
//!         moment: &Moment,
//!         _sums: &[i64],
//!         _cell: &Cell,
//!         walls: &mut [Wall],
//!     ) -> Result<(), DriveError> {
//!         let Moment { time, dt, .. } = *moment;
//!         let speed = (self.place(time + dt) - self.place(time)) / dt;
//!         for wall in walls.iter_mut().filter(|wall| wall.name == self.wall) {
//!             wall.velocity = wall.velocity_inwards(speed);
//!         }
//!         Ok(())
//!     }
//! }
//!
//! let text = r#"
//!     domain = { low = [0, 0, 0], high = [0.01, 0.01, 0.01], walls = ["-z"] }
//!     material = [{ name = "glass", density = 2500, normal_stiffness = 1e4 }]
//!     shape = [{ name = "bead", kind = "sphere", radius = 1e-3 }]
//!     time = { step = 1e-6, steps = 2500 }
//!     output = { directory = "out" }
//!     [[fill.lattice]]
//!     first = [5e-3, 5e-3, 1.1e-3]
//!     count = [1, 1, 1]
//! "#;
//! let scene = Scene::parse(text, "bead.toml", Path::new("."), &[]).unwrap();
//! let mut comm = Alone::default();
//! let mut sim = assemble::assemble(&scene, &comm);
//! sim.drives.push(Box::new(Shaker { wall: "-z".into(), amplitude: 2e-4, frequency: 100.0 }));
//! assemble::fill(&mut sim, &scene, &comm);
//! sim.begin(&mut comm).unwrap();
//! for _ in 0..scene.steps {
//!     sim.step(&mut comm).unwrap();
//! }
//!
//! // After a quarter of the period the wall is at its highest, and the bead, which it has struck, above it.
//! assert!((sim.particles.walls[0].point.z - 2e-4).abs() < 1e-15);
//! assert!(sim.particles.position[0].z > 1.2e-3);
//! // What the wall has given to the bead is what it has.
//! let measures = sim.measure(&mut comm);
//! assert!(measures.received > 0.0 && measures.missing().abs() < 1e-3 * measures.received);
//! ```

pub mod free;
pub mod inlet;
pub mod ledger;
pub mod listed;
pub mod outlet;
pub mod rain;
pub mod region;
pub mod servo;

use crate::cell::Cell;
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::contacts::Contacts;
use crate::ids::ShapeId;
use crate::law::{ForceLaw, Sums};
use crate::math::{ExactSum, Vec3};
use crate::particles::census::Census;
use crate::particles::records::Particle;
use crate::particles::walls::Wall;
use crate::particles::{Library, Particles};
use serde::{Deserialize, Serialize};

/// Steps between looks at a stage's `[stop]`. The errors of drives are means over so many steps.
pub const CHECK_EVERY: u64 = 100;

/// Where a simulation stands when a drive acts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Steps since the first stage began.
    pub step: u64,
    /// Steps since this stage began.
    pub stage_step: u64,
    /// Time since the first stage began [s].
    pub time: f64,
    /// Time since this stage began [s].
    pub stage_time: f64,
    /// Time step [s].
    pub dt: f64,
}

/// Particles that appear: how many, and each by its number when it is asked for, so that no rank must hold all of them.
pub struct Newcomers {
    /// How many.
    pub count: u64,
    /// What makes each.
    pub make: Box<Maker>,
}

/// Makes the particle of a number from 0, with a shape of a library.
pub type Maker = dyn Fn(u64, &Library) -> Particle;

impl Newcomers {
    /// Those of a list.
    pub fn of(list: Vec<Particle>) -> Self {
        Self { count: list.len() as u64, make: Box::new(move |k, _| list[k as usize].clone()) }
    }
}

/// Something that acts on the particles from outside. What a method does by default: nothing.
pub trait Drive: Send + Sync {
    /// Names it among the drives of a simulation, and the group of snapshots that holds its state.
    fn name(&self) -> &str;

    /// Takes the sizes of particles that the scene did not know of, before the first step.
    fn admit(&mut self, _library: &Library) {}

    /// Numbers that are to be added up over all ranks while the particles move, as many on every rank. At the start of a
    /// step: forces belong to the positions.
    fn sums(
        &self,
        _moment: &Moment,
        _particles: &Particles,
        _contacts: &Contacts,
        _law: &dyn ForceLaw,
    ) -> Vec<i64> {
        Vec::new()
    }

    /// Gives walls their velocities for the step that begins at this moment, and their angular velocities, if there are columns
    /// for those ([`crate::particles::Needs::spin`]). `sums` is what [`Drive::sums`] asked for, of
    /// all ranks. All ranks must do the same. A wall has its place in `history.csv` if [`Wall::moves`] is set.
    ///
    /// # Errors
    /// Why the run cannot go on.
    fn steer(
        &mut self,
        _moment: &Moment,
        _sums: &[i64],
        _cell: &Cell,
        _walls: &mut [Wall],
    ) -> Result<(), DriveError> {
        Ok(())
    }

    /// Particles that appear at this moment, the end of a step, and touch nothing, if any: the same on all ranks. Their ids count
    /// from `first_id`. `particles` are at their new places. Collective.
    fn insert(
        &mut self,
        _moment: &Moment,
        _first_id: u64,
        _particles: &Particles,
        _comm: &mut dyn Comm,
    ) -> Option<Newcomers> {
        None
    }

    /// May it take particles out? If no drive may, nothing looks in every step at whether a particle has left the domain.
    fn is_outlet(&self) -> bool {
        false
    }

    /// Does it look at this moment for particles inside the domain that leave?
    fn looks(&self, _moment: &Moment) -> bool {
        false
    }

    /// Has a particle inside the domain reached a place where it leaves at this moment? Asked when the drive [looks](Drive::looks).
    fn reaches(&self, _moment: &Moment, _position: &Vec3, _cell: &Cell) -> bool {
        false
    }

    /// Takes a particle of a mass [kg] that has left the domain of `cell`, or that it [reaches](Drive::reaches) at this moment, out of the
    /// simulation, or not; an error if no drive does. Asked on all ranks, in the order of the ids; not asked of what a drive before it
    /// has taken. The velocity is that of the positions, as if nothing touched the particle in the last half of the step; the force is
    /// that of the positions before.
    fn take(&mut self, _moment: &Moment, _leaver: &Particle, _mass: f64, _cell: &Cell) -> bool {
        false
    }

    /// What it has counted in this stage, the same on all ranks: names of columns of `history.csv`, always the same ones, and
    /// numbers.
    fn counted(&self) -> Vec<(String, f64)> {
        Vec::new()
    }

    /// Names of the lists that it keeps of particles that come or go, always the same ones and of no other drive. Each is a file of the
    /// run, `NAME.csv` ([`crate::output::lists`]).
    fn lists(&self) -> Vec<String> {
        Vec::new()
    }

    /// The particles that came or went at the step that was just done, or as the stage began, each with the number of its list, in the
    /// order of ids within each list; the same on all ranks. Asked on rank 0 alone: what is not asked for must be gone with the next.
    fn listed(&mut self) -> Vec<(usize, Particle)> {
        Vec::new()
    }

    /// Sizes of the particles of a shape that it has taken out in this stage, in parts; nothing if the shape has no law of sizes.
    fn sizes_left(&self, _shape: ShapeId) -> Vec<&Census> {
        Vec::new()
    }

    /// How many particles it has taken out in this stage.
    fn gone(&self) -> u64 {
        0
    }

    /// Looks at the forces with which a stage begins, before its first step. A run that goes on within a stage has none.
    fn first_forces(&mut self, _contacts: &Contacts, _particles: &Particles) {}

    /// Looks at the forces at the end of a step, and at what walls did in it.
    fn after_forces(&mut self, _contacts: &Contacts, _particles: &Particles, _sums: &Sums) {}

    /// What it has still to do before the stage may end; `None` if nothing.
    fn unfinished(&self) -> Option<&'static str> {
        None
    }

    /// The wall that it will move whatever the grains do, in a sentence; `None` if there is none. `wall_forces` are those of the grains on each
    /// wall at this moment [N], of all ranks.
    fn under_way(&self, _walls: &[Wall], _wall_forces: &[Vec3]) -> Option<String> {
        None
    }

    /// How far off its target it was, over the target, in the mean of the last [`CHECK_EVERY`] steps. With it the key by
    /// which `[stop]` sets a limit. `None` if it keeps no target.
    fn error(&self) -> Option<(&'static str, f64)> {
        None
    }

    /// Changes the forces on walls [N] of a row of `history.csv`, which are those of its moment, to what the drive has found
    /// since the row before. Only a row that is `scheduled` counts as one before. Collective.
    fn row(&mut self, _wall_forces: &mut [Vec3], _scheduled: bool, _comm: &mut dyn Comm) {}

    /// Takes note of the largest speed of a particle [m/s] at a row of `history.csv`, and of the time step [s].
    fn note_speed(&mut self, _fastest: f64, _dt: f64) {}

    /// What the user should know now, once; the same on all ranks.
    fn warnings(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// How it has kept what it was to keep, at the end of a run.
    fn kept(&self, _walls: &[Wall]) -> Vec<Kept> {
        Vec::new()
    }

    /// What the user should know at the end of a run, a sentence each. If the stage `has_stopped` because its `[stop]` holds, it
    /// is no fault that something is unfinished.
    fn last_warnings(&self, _walls: &[Wall], _has_stopped: bool) -> Vec<String> {
        Vec::new()
    }

    /// Its state as columns of equal numbers of rows, the same on all ranks. Collective.
    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        Vec::new()
    }

    /// Goes on from what it has saved, and gives walls the velocities that they had, of all ranks; sums that are not yet added up belong to rank 0, `is_root`. In a new
    /// stage only what outlives a stage counts.
    ///
    /// # Errors
    /// If the state is not one that it could have saved.
    fn resume(
        &mut self,
        _saved: &SavedState,
        _is_new_stage: bool,
        _walls: &mut [Wall],
        _is_root: bool,
    ) -> Result<(), DriveError> {
        Ok(())
    }

    /// May it act in a stage that goes on from a snapshot without its state?
    ///
    /// # Errors
    /// If it would have had to act before.
    fn joins(&mut self) -> Result<(), DriveError> {
        Ok(())
    }
}

/// What presses on walls, of this rank's contacts: exact sums of the normal forces [N] and of the normal stiffness [N/m] of each of `count`
/// groups of walls. `group` tells to which a wall belongs, `part` what part of the stiffness counts of a contact with a wall and with a normal.
fn pressing(
    (count, group): (usize, impl Fn(usize) -> Option<usize>),
    dt: f64,
    particles: &Particles,
    contacts: &Contacts,
    law: &dyn ForceLaw,
    part: impl Fn(usize, &Vec3) -> f64,
) -> Vec<[ExactSum; 2]> {
    let group_of: Vec<Option<usize>> = (0..particles.walls.len()).map(group).collect();
    let mut sums = vec![[ExactSum::default(), ExactSum::default()]; count];
    for (pair, geometry, force) in contacts.pressing_on_walls(law, particles) {
        let Some(wall) = particles.wall_of(pair.b) else { continue };
        let Some(group) = group_of[wall] else { continue };
        // A state that is not a number is reported when the list of pairs is rebuilt.
        if force.is_finite() {
            sums[group][0].add(force);
            let stiffness = law.stiffness(pair, particles, geometry, dt);
            sums[group][1].add(stiffness * part(wall, &geometry.normal));
        }
    }
    sums
}

/// How a target was kept over the last fifth of the stage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Kept {
    /// What kept it, in a word.
    pub drive: String,
    /// On what: the names of walls.
    pub of: String,
    /// The unit of `target` and `mean`.
    pub unit: &'static str,
    /// What was to be kept.
    pub target: f64,
    /// What was, in the mean over these steps.
    pub mean: f64,
    /// How many steps.
    pub steps: u64,
    /// Mean distance from the target, over the target.
    pub mean_error: f64,
    /// Largest distance from the target, over the target.
    pub largest_error: f64,
}

/// A drive cannot go on. Known on all ranks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
#[error("{0}")]
pub struct DriveError(pub String);

/// The state of a drive in a snapshot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedState {
    /// The drive's name.
    pub drive: String,
    /// Its columns.
    pub columns: Vec<SavedColumn>,
}

/// A column of a [`SavedState`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SavedColumn {
    /// Name, unit, and how many numbers a row has; texts have one.
    pub column: StateColumn,
    /// Row by row.
    pub values: Values,
}

/// What a column of a [`SavedState`] holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Values {
    /// Texts.
    Texts(Vec<String>),
    /// Real numbers.
    Reals(Vec<f64>),
    /// Integers.
    Integers(Vec<i64>),
    /// Integers that are never negative.
    Counts(Vec<u64>),
}

impl Values {
    /// How many numbers or texts there are.
    pub fn len(&self) -> usize {
        match self {
            Self::Texts(values) => values.len(),
            Self::Reals(values) => values.len(),
            Self::Integers(values) => values.len(),
            Self::Counts(values) => values.len(),
        }
    }

    /// As a list in words.
    pub fn words(&self) -> String {
        match self {
            Self::Texts(values) => format!("{values:?}"),
            Self::Reals(values) => format!("{values:?}"),
            Self::Integers(values) => format!("{values:?}"),
            Self::Counts(values) => format!("{values:?}"),
        }
    }

    /// What they take in a file, where all texts are as long as the longest [bytes].
    pub fn bytes(&self) -> usize {
        let element = match self {
            Self::Texts(values) => values.iter().map(String::len).max().unwrap_or(0),
            Self::Reals(_) | Self::Integers(_) | Self::Counts(_) => size_of::<f64>(),
        };
        self.len() * element
    }

    /// Is there nothing in it?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl SavedColumn {
    /// A column with these rows.
    pub const fn new(column: StateColumn, values: Values) -> Self {
        Self { column, values }
    }

    /// How many rows it has.
    pub fn rows(&self) -> usize {
        self.values.len() / self.column.width.max(1)
    }
}

impl SavedState {
    /// A column of texts.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn texts(&self, column: &StateColumn) -> Result<&[String], DriveError> {
        self.find(column, |values| if let Values::Texts(them) = values { Some(them) } else { None })
    }

    /// A column of real numbers.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn reals(&self, column: &StateColumn) -> Result<&[f64], DriveError> {
        self.find(column, |values| if let Values::Reals(them) = values { Some(them) } else { None })
    }

    /// A column of integers.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn integers(&self, column: &StateColumn) -> Result<&[i64], DriveError> {
        self.find(
            column,
            |values| if let Values::Integers(them) = values { Some(them) } else { None },
        )
    }

    /// A column of integers that are never negative.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn counts(&self, column: &StateColumn) -> Result<&[u64], DriveError> {
        self.find(
            column,
            |values| if let Values::Counts(them) = values { Some(them) } else { None },
        )
    }

    fn find<'a, T>(
        &'a self,
        wanted: &StateColumn,
        of_type: impl FnOnce(&'a Values) -> Option<&'a Vec<T>>,
    ) -> Result<&'a [T], DriveError> {
        let found = self.columns.iter().find(|saved| saved.column == *wanted);
        found.and_then(|saved| of_type(&saved.values)).map(Vec::as_slice).ok_or_else(|| {
            let (drive, StateColumn { name, unit, width }) = (&self.drive, wanted);
            DriveError(format!(
                "the state of `{drive}` has no column `{name}` of {width} numbers in \"{unit}\" of the type that is saved \
                 today: another version of `{drive}` wrote it. Go on with that version, or run the scene again"
            ))
        })
    }
}
