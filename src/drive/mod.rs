//! What acts on the particles from outside: drives.
//!
//! Three traits share the work:
//!
//! * a [`Drive`] acts: it moves walls, inserts particles and takes them out, holds and pushes them;
//! * an [`Observer`] looks on: at the forces of each step, at rows of the history, at particles that come and go;
//! * a [`Reporter`] has a name, warnings, figures for the report, and a state in snapshots.
//!
//! Every drive is an observer, and every observer a reporter. A simulation holds a list of drives and a list of observers that act on
//! nothing ([`ledger`]), and knows none of them by name. In each step every drive may, in the order of the list,
//!
//! 1. ask for sums over all ranks, which are found while the particles move ([`Drive::sums`]);
//! 2. hold particles on courses of their own while the others move ([`Drive::lead`], [`Drive::place`]);
//! 3. give walls their velocities and angular velocities, and the cell its rate ([`Drive::steer`]);
//! 4. insert particles, before the list of pairs is made ([`Drive::insert`], [`Drive::admit`]);
//! 5. take out particles that have left the domain or have reached where they leave ([`Drive::reaches`], [`Drive::take`]);
//! 6. look at the forces, as observers that act on nothing do after it ([`Observer::after_forces`]);
//! 7. push particles, and hold others, in the last half of the step ([`Drive::push`], [`Drive::settle`]).
//!
//! Drives are asked for 2 and 7 in scenes with [`groups`] alone ([`crate::particles::Needs::group`]).
//!
//! After the step a run writes down the particles that drives have listed ([`Observer::lists`]).
//!
//! The state of a drive is the same on all ranks, but for sums that are not yet added up. It is saved in snapshots under the
//! drive's name ([`Reporter::save`], [`Reporter::resume`]).
//!
//! # A drive of one's own
//!
//! This one is whole: it shakes a wall.
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
//! // What the wall has given to the bead is what it has.
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

/// What drives and observers see of this rank's part of a simulation.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// When.
    pub moment: Moment,
    /// Particles and walls.
    pub particles: &'a Particles,
    /// What touches.
    pub contacts: &'a Contacts,
    /// From geometry to force.
    pub law: &'a dyn ForceLaw,
    /// What forces did in the last step.
    pub sums: &'a Sums,
}

/// By what drives steer walls, and the walls.
pub struct Steering<'a> {
    /// When.
    pub moment: Moment,
    /// What [`Drive::sums`] asked for, of all ranks.
    pub sums: &'a [i64],
    /// The domain and its periods; the rate of the flow that carries it may be set.
    pub cell: &'a mut Cell,
    /// Shapes of the particles.
    pub library: &'a Library,
    /// All walls of the simulation.
    pub walls: &'a mut [Wall],
}

/// The particles on which a drive acts, and when.
pub struct Acting<'a> {
    /// When. [`Moment::dt`] is 0 where forces were found at the start of a stage.
    pub moment: Moment,
    /// Gravity and global damping.
    pub field: &'a Field,
    /// Particles and walls.
    pub particles: &'a mut Particles,
}

/// From where a drive takes particles out at a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takes {
    /// Nowhere, at no moment.
    Nothing,
    /// Out of the domain.
    Outside,
    /// Also inside the domain, where it [reaches](Drive::reaches) them.
    Inside,
}

/// Acts on the particles from outside. By default a method does nothing.
pub trait Drive: Observer {
    /// Numbers that are to be added up over all ranks while the particles move, as many on every rank. At the start of a
    /// step: forces belong to the positions.
    fn sums(&self, _view: &View) -> Vec<i64> {
        Vec::new()
    }

    /// Gives walls their velocities for the step that begins at this moment, and their angular velocities, if there are columns
    /// for those ([`crate::particles::Needs::spin`]). All ranks must do the same. A wall has its place in `history.csv` if [`Wall::moves`] is
    /// set.
    ///
    /// # Errors
    /// Why the run cannot go on.
    fn steer(&mut self, _steering: Steering) -> Result<(), DriveError> {
        Ok(())
    }

    /// Acts before the first kick of a step: forces and velocities belong to the positions.
    fn lead(&mut self, _acting: Acting) {}

    /// Acts once particles have moved, and takes note of how far it moves some itself. The moment is that of the start of the step.
    fn place(&mut self, _acting: Acting, _farthest: &mut Farthest) {}

    /// Acts once forces are found, before the last kick of a step. It may add to forces and torques.
    fn push(&mut self, _acting: Acting) {}

    /// Acts after the last kick of a step.
    fn settle(&mut self, _acting: Acting) {}

    /// Says to which group a particle belongs that appears, if to any.
    fn admit(&self, _newcomer: &mut Particle) {}

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

    /// From where it may take particles out at this moment. If no drive takes any, nothing looks in every step at whether a particle has
    /// left the domain.
    fn takes(&self, _moment: &Moment) -> Takes {
        Takes::Nothing
    }

    /// Has a particle inside the domain reached a place where it leaves at this moment? Asked when the drive takes particles
    /// [inside](Takes::Inside).
    fn reaches(&self, _moment: &Moment, _position: &Vec3, _cell: &Cell) -> bool {
        false
    }

    /// Takes a particle that has left the domain, or that it [reaches](Drive::reaches) at this moment, out of the simulation, or not; an
    /// error if no drive does. Asked on all ranks, in the order of the ids; not asked of what a drive before it has taken. The velocity is
    /// that of the positions, as if nothing touched the particle in the last half of the step; the force is that of the positions before.
    fn take(&mut self, _moment: &Moment, _leaver: &Particle, _particles: &Particles) -> bool {
        false
    }
}

/// Looks on, and changes nothing of the particles and walls. By default a method does nothing.
pub trait Observer: Reporter {
    /// Looks at the forces at the end of a step, and at what walls did in it. The forces with which a stage begins come before its first
    /// step, with a [`Moment::dt`] of 0: no time has passed. A run that goes on within a stage has none of those.
    fn after_forces(&mut self, _view: &View) {}

    /// Looks at a row of `history.csv` before it is written, and may change its forces on walls to what was found since the row before.
    /// Collective.
    fn row(&mut self, _row: &mut Row, _comm: &mut dyn Comm) {}

    /// The lists that it keeps of particles that come or go, under names of no other observer. Each is a file of the run, `NAME.csv`
    /// ([`crate::output::lists`]).
    fn lists(&mut self) -> Option<&mut Lists> {
        None
    }
}

/// A row of `history.csv`, as observers see it.
#[derive(Clone, Debug)]
pub struct Row {
    /// The force of the particles on each wall [N], of its moment.
    pub wall_forces: Vec<Vec3>,
    /// The largest speed of a particle [m/s].
    pub fastest: f64,
    /// Time step [s].
    pub dt: f64,
    /// Is it on schedule? Only then does it count as one before.
    pub scheduled: bool,
}

/// Has a name, and what the user, the report and snapshots have of it. By default nothing.
pub trait Reporter: Send + Sync {
    /// Names it among the drives and observers of a simulation, and the group of snapshots that holds its state.
    fn name(&self) -> &str;

    /// What it has counted in this stage, the same on all ranks: names of columns of `history.csv`, always the same ones, and
    /// numbers.
    fn counted(&self) -> Vec<(String, f64)> {
        Vec::new()
    }

    /// What the user should know now, once; the same on all ranks.
    fn warnings(&mut self) -> Vec<String> {
        Vec::new()
    }

    /// How far it has come in this stage.
    fn standing(&self) -> Standing {
        Standing::default()
    }

    /// The wall that it will move whatever the grains do, in a sentence; `None` if there is none. `wall_forces` are those of the grains on each
    /// wall at this moment [N], of all ranks.
    fn under_way(&self, _walls: &[Wall], _wall_forces: &[Vec3]) -> Option<String> {
        None
    }

    /// Sizes of the particles of a shape that it has taken out in this stage, in parts; nothing if the shape has no law of sizes.
    fn sizes_left(&self, _shape: ShapeId) -> Vec<&Census> {
        Vec::new()
    }

    /// What there is to report of it at the end of a run. If the stage `has_stopped` because its `[stop]` holds, it is no fault that
    /// something is unfinished.
    fn outcome(&self, _walls: &[Wall], _has_stopped: bool) -> Outcome {
        Outcome::default()
    }

    /// Its state as columns of equal numbers of rows, the same on all ranks. Collective.
    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        Vec::new()
    }

    /// Goes on from what it has saved, and gives walls the velocities that they had. In a new stage only what outlives a stage counts.
    ///
    /// # Errors
    /// If the state is not one that it could have saved.
    fn resume(&mut self, _restart: &Restart, _walls: &mut [Wall]) -> Result<(), DriveError> {
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

/// All that looks on: drives, and after them observers that act on nothing.
pub fn all_observers<'a>(
    drives: &'a mut [Box<dyn Drive>],
    observers: &'a mut [Box<dyn Observer>],
) -> impl Iterator<Item = &'a mut dyn Observer> {
    let of_drives = drives.iter_mut().map(|drive| -> &mut dyn Observer { &mut **drive });
    of_drives.chain(observers.iter_mut().map(|observer| -> &mut dyn Observer { &mut **observer }))
}

/// How far a drive has come in a stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Standing {
    /// What it has still to do before the stage may end; `None` if nothing.
    pub unfinished: Option<&'static str>,
    /// How far off its target it was, over the target, in the mean of the last [`CHECK_EVERY`] steps. With it the key by
    /// which `[stop]` sets a limit. `None` if it keeps no target.
    pub error: Option<(&'static str, f64)>,
    /// How many particles it has taken out.
    pub gone: u64,
}

/// What there is to report of a drive at the end of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// How it has kept its targets.
    pub kept: Vec<Kept>,
    /// What the user should know, a sentence each.
    pub warnings: Vec<String>,
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
