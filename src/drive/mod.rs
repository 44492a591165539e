//! Drives: influences on the particles from outside.
//!
//! Three traits share the work:
//!
//! * a [`Drive`] acts: it moves walls, inserts and takes out particles, holds and pushes them;
//! * an [`Observer`] reads: the forces of each step, rows of the history, particles that come and go;
//! * a [`Reporter`] has a name, warnings, figures for the report, and a state in snapshots.
//!
//! Every drive is an observer, and every observer a reporter. A simulation holds a list of drives and a list of observers
//! that are not drives ([`ledger`]), and knows none of them by name. In each step every drive may, in the order of the
//! list,
//!
//! 1. ask for sums over all ranks, which are found while the particles move ([`Drive::sums`]);
//! 2. hold particles on prescribed courses while the others move ([`Drive::lead`], [`Drive::place`]);
//! 3. give walls their velocities and angular velocities, and the cell its rate ([`Drive::steer`]);
//! 4. insert particles, before the list of pairs is made ([`Drive::insert`], [`Drive::admit`]);
//! 5. take out particles that have left the domain or have reached an outlet ([`Drive::reaches`], [`Drive::take`]);
//! 6. read the forces, followed by the observers that are not drives ([`Observer::after_forces`]);
//! 7. push particles, and hold others, in the last half of the step ([`Drive::push`], [`Drive::settle`]).
//!
//! Drives are called for 2 and 7 only in scenes with [`groups`] ([`crate::particles::Needs::group`]).
//!
//! After the step a run writes the particles that drives have listed ([`Observer::lists`]).
//!
//! The state of a drive is the same on all ranks, except for sums that are not yet added up. It is saved in snapshots under
//! the drive's name ([`Reporter::save`], [`Reporter::resume`]).
//!
//! # A drive of one's own
//!
//! This complete example shakes a wall.
//!
//! ```
//! use dem_mpi::comm::alone::Alone;
//! use dem_mpi::drive::{Drive, DriveError, Moment, Observer, Reporter, Steering};
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
//!     fn height(&self, time: f64) -> f64 {
//!         self.amplitude * (TAU * self.frequency * time).sin()
//!     }
//! }
//!
//! impl Reporter for Shaker {
//!     fn name(&self) -> &str {
//!         "shaker"
//!     }
//! }
//!
//! impl Observer for Shaker {}
//!
//! impl Drive for Shaker {
//!     fn steer(&mut self, Steering { moment, walls, .. }: Steering) -> Result<(), DriveError> {
//!         let Moment { time, dt, .. } = moment;
//!         let speed = (self.height(time + dt) - self.height(time)) / dt;
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
//! // The energy that the wall has given is that of the bead.
//! let measures = sim.measure(&mut comm);
//! assert!(measures.received > 0.0 && measures.missing().abs() < 1e-3 * measures.received);
//! ```

mod clearance;
pub mod element;
mod errors;
pub mod free;
pub mod groups;
pub mod inlet;
pub mod ledger;
pub mod lists;
mod load;
pub mod outlet;
pub mod rain;
pub mod region;
mod saved;
pub mod servo;

pub use saved::{Restart, SavedColumn, SavedState, Values};

use crate::cell::Cell;
use crate::comm::Comm;
use crate::contacts::Contacts;
use crate::ids::ShapeId;
use crate::law::{ForceLaw, Sums};
use crate::math::Vec3;
use crate::motion::{Farthest, Field};
use crate::particles::Particles;
use crate::particles::records::Particle;
use crate::population::Library;
use crate::population::census::Census;
use crate::walls::Wall;
use lists::Lists;
use serde::{Deserialize, Serialize};

/// Steps between checks of a stage's `[stop]`. The errors of drives are means over this number of steps.
pub const CHECK_EVERY: u64 = 100;

/// Time and step of a simulation when a drive acts.
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

/// New particles: their number, and a function that makes each by its index, so that no rank must hold all of them.
pub struct Newcomers {
    /// Number of particles.
    pub count: u64,
    /// Makes each particle.
    pub make: Box<Maker>,
}

/// Makes the particle with an index from 0, with a shape of a library.
pub type Maker = dyn Fn(u64, &Library) -> Particle;

impl Newcomers {
    /// The particles of a list.
    pub fn of(list: Vec<Particle>) -> Self {
        Self { count: list.len() as u64, make: Box::new(move |k, _| list[k as usize].clone()) }
    }
}

/// This rank's part of a simulation, for drives and observers to read.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// Time and step.
    pub moment: Moment,
    /// Particles and walls.
    pub particles: &'a Particles,
    /// Contacts.
    pub contacts: &'a Contacts,
    /// Force law.
    pub law: &'a dyn ForceLaw,
    /// Sums of forces and losses of the last step.
    pub sums: &'a Sums,
}

/// Walls and cell for drives to steer, with the data they need.
pub struct Steering<'a> {
    /// Time and step.
    pub moment: Moment,
    /// Sums over all ranks that [`Drive::sums`] asked for.
    pub sums: &'a [i64],
    /// The domain and its periods; a drive may set the rate of its flow.
    pub cell: &'a mut Cell,
    /// Shapes of the particles.
    pub library: &'a Library,
    /// All walls of the simulation.
    pub walls: &'a mut [Wall],
}

/// The particles on which a drive acts, and the time.
pub struct Acting<'a> {
    /// Time and step. [`Moment::dt`] is 0 where forces were found at the start of a stage.
    pub moment: Moment,
    /// Gravity and global damping.
    pub field: &'a Field,
    /// Particles and walls.
    pub particles: &'a mut Particles,
}

/// Region from which a drive may take out particles at a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takes {
    /// None.
    Nothing,
    /// Outside the domain.
    Outside,
    /// Outside, and inside the domain where it [reaches](Drive::reaches) them.
    Inside,
}

/// Acts on the particles from outside. Every method has a default that does nothing.
pub trait Drive: Observer {
    /// Numbers to add up over all ranks while the particles move, as many on every rank. Called at the start of a step,
    /// when forces belong to the positions.
    fn sums(&self, _view: &View) -> Vec<i64> {
        Vec::new()
    }

    /// Sets the velocities of walls for the step that begins at this moment, and their angular velocities, if those have
    /// columns ([`crate::particles::Needs::spin`]). All ranks must do the same. `history.csv` has the position of a wall if
    /// [`Wall::moves`] is set.
    ///
    /// # Errors
    /// If the run cannot go on; the text gives the reason.
    fn steer(&mut self, _steering: Steering) -> Result<(), DriveError> {
        Ok(())
    }

    /// Acts before the first kick of a step, when forces and velocities belong to the positions.
    fn lead(&mut self, _acting: Acting) {}

    /// Acts once particles have moved, and records in `farthest` how far it moves particles itself. The moment is that of
    /// the start of the step.
    fn place(&mut self, _acting: Acting, _farthest: &mut Farthest) {}

    /// Acts once forces are found, before the last kick of a step. It may add to forces and torques.
    fn push(&mut self, _acting: Acting) {}

    /// Acts after the last kick of a step.
    fn settle(&mut self, _acting: Acting) {}

    /// Sets the group of a new particle, if it belongs to one.
    fn admit(&self, _newcomer: &mut Particle) {}

    /// New particles at this moment, the end of a step, if any. They touch nothing, and are the same on all ranks. Their
    /// ids count from `first_id`. `particles` are at their new places. Collective.
    fn insert(
        &mut self,
        _moment: &Moment,
        _first_id: u64,
        _particles: &Particles,
        _comm: &mut dyn Comm,
    ) -> Option<Newcomers> {
        None
    }

    /// Region from which it may take out particles at this moment. If no drive takes any, particles are not checked for
    /// leaving the domain in every step.
    fn takes(&self, _moment: &Moment) -> Takes {
        Takes::Nothing
    }

    /// Has a particle inside the domain reached a place where it leaves at this moment? Called if the drive takes particles
    /// [inside](Takes::Inside).
    fn reaches(&self, _moment: &Moment, _position: &Vec3, _cell: &Cell) -> bool {
        false
    }

    /// Decides whether a particle that has left the domain, or that it [reaches](Drive::reaches), is taken out of the
    /// simulation. A particle outside the domain that no drive takes stops the run with an error. Called on all ranks, in
    /// the order of the ids, unless an earlier drive has taken the particle. The velocity belongs to the positions, as if
    /// nothing touched the particle in the last half of the step. The force belongs to the positions of the step before.
    fn take(&mut self, _moment: &Moment, _leaver: &Particle, _particles: &Particles) -> bool {
        false
    }
}

/// Reads particles and walls without changing them. Every method has a default that does nothing.
pub trait Observer: Reporter {
    /// Reads the forces at the end of a step, and the work of walls in it. The first forces of a stage come before its
    /// first step, with a [`Moment::dt`] of 0. A run that continues within a stage has no such call.
    fn after_forces(&mut self, _view: &View) {}

    /// Reads a row of `history.csv` before it is written. It may replace its forces on walls by their means since the
    /// previous row. Collective.
    fn row(&mut self, _row: &mut Row, _comm: &mut dyn Comm) {}

    /// Its lists of particles that come or go, under names that no other observer uses. Each is a file of the run,
    /// `NAME.csv` ([`crate::output::lists`]).
    fn lists(&mut self) -> Option<&mut Lists> {
        None
    }
}

/// A row of `history.csv`, as observers see it.
#[derive(Clone, Debug)]
pub struct Row {
    /// Force of the particles on each wall at its moment [N].
    pub wall_forces: Vec<Vec3>,
    /// The largest speed of a particle [m/s].
    pub fastest: f64,
    /// Time step [s].
    pub dt: f64,
    /// Is the row on schedule? Only then does it count as the previous row of a later one.
    pub scheduled: bool,
}

/// Has a name, warnings, report figures and a state in snapshots. Every other method has an empty default.
pub trait Reporter: Send + Sync {
    /// Name among the drives and observers of a simulation, and of the snapshot group with its state.
    fn name(&self) -> &str;

    /// Counts in this stage, the same on all ranks: names of columns of `history.csv`, always the same ones, and numbers.
    fn counted(&self) -> Vec<(String, f64)> {
        Vec::new()
    }

    /// Warnings for the user, each returned once; the same on all ranks.
    fn warnings(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// Progress in this stage.
    fn standing(&self) -> Standing {
        Standing::default()
    }

    /// A sentence that names the wall which it will move whatever the particles do; `None` if there is none. `wall_forces`
    /// are the forces of the particles on each wall at this moment, over all ranks [N].
    fn under_way(&self, _walls: &[Wall], _wall_forces: &[Vec3]) -> Option<String> {
        None
    }

    /// Sizes of the particles of a shape that it has taken out in this stage, in parts; empty if the shape has no law of
    /// sizes.
    fn sizes_left(&self, _shape: ShapeId) -> Vec<&Census> {
        Vec::new()
    }

    /// Results for the report at the end of a run. If the stage `has_stopped` by its `[stop]`, unfinished work is not a
    /// warning.
    fn outcome(&self, _walls: &[Wall], _has_stopped: bool) -> Outcome {
        Outcome::default()
    }

    /// State as columns of equal numbers of rows, the same on all ranks. Collective.
    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        Vec::new()
    }

    /// Continues from its saved state, and restores the velocities of walls. In a new stage only the state that outlives a
    /// stage counts.
    ///
    /// # Errors
    /// If the state is not one that it could have saved.
    fn resume(&mut self, _restart: &Restart, _walls: &mut [Wall]) -> Result<(), DriveError> {
        Ok(())
    }

    /// Checks that it may act in a stage that continues from a snapshot without its state.
    ///
    /// # Errors
    /// If it would have had to act before.
    fn joins(&mut self) -> Result<(), DriveError> {
        Ok(())
    }
}

/// All observers: drives first, then those that are not drives.
pub fn all_observers<'a>(
    drives: &'a mut [Box<dyn Drive>],
    observers: &'a mut [Box<dyn Observer>],
) -> impl Iterator<Item = &'a mut dyn Observer> {
    let of_drives = drives.iter_mut().map(|drive| -> &mut dyn Observer { &mut **drive });
    of_drives.chain(observers.iter_mut().map(|observer| -> &mut dyn Observer { &mut **observer }))
}

/// Progress of a drive in a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Standing {
    /// Work left before the stage may end; `None` if none.
    pub unfinished: Option<&'static str>,
    /// Key by which `[stop]` limits its error, and the error: distance from the target over the target, in the mean of the
    /// last [`CHECK_EVERY`] steps. `None` if it has no target.
    pub error: Option<(&'static str, f64)>,
    /// Number of particles taken out.
    pub gone: u64,
}

/// Results of a drive for the report at the end of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Targets and achieved values.
    pub kept: Vec<Kept>,
    /// Warnings, a sentence each.
    pub warnings: Vec<String>,
}

/// Target and achieved value over the last fifth of the stage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Kept {
    /// Name of the drive, in one word.
    pub drive: String,
    /// Names of the walls.
    pub of: String,
    /// Unit of `target` and `mean`.
    pub unit: &'static str,
    /// Target value.
    pub target: f64,
    /// Mean value over these steps.
    pub mean: f64,
    /// Number of steps.
    pub steps: u64,
    /// Mean distance from the target, over the target.
    pub mean_error: f64,
    /// Largest distance from the target, over the target.
    pub largest_error: f64,
}

/// Reason why a drive cannot go on; known on all ranks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
#[error("{0}")]
pub struct DriveError(pub String);
