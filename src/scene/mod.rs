//! The user's file: read (`input`), checked (`check`) and turned into a simulation ([`assemble`]).
//!
//! A [`Scene`] is what the file means: SI units, names resolved, nothing missing, nothing
//! inconsistent. It is made on rank 0 and sent to all.
//!
//! # The file
//!
//! TOML. The column *kind* says what a value may be: `number > 0`; `[x, y, z]`, a list of as many items; `{ a = number [m], b? = text }`, a table, in which
//! keys with a question mark may be left out; `or` stands between alternatives. Unit and kind are those of all keys of a row, or one of each; `-` is no unit.
//! Keys marked `required` must be there. Paths of output, `start` and `folder` are relative to the
//! working directory, paths of particle files, tables and meshes to the folder of the scene, or of the file that it includes and that names them.
//! A polyhedron is moved to its centre of mass and turned into its principal axes; positions and
//! quaternions of particles are those of its centre and these axes, and `--plan` says where they lie in the file.
//!
#![doc = include_str!("keys.md")]

pub mod assemble;
mod bed;
mod before;
mod cells;
mod check;
pub mod doubts;
mod element;
mod fills;
mod flows;
mod form;
mod geometry;
mod groups;
mod input;
mod jumps;
pub mod keys;
mod kind;
mod lammps;
mod laws;
mod listed;
mod matter;
mod mistakes;
mod motions;
pub mod one_shape;
mod orientations;
pub mod packing;
pub mod pair;
mod parts;
mod pieces;
pub mod plan;
mod reader;
mod regions;
mod room;
mod scattered;
pub mod schema;
mod sizes;
pub mod suggest;
mod walls;

use crate::cell::Cell;
pub use crate::contact::Method;
pub use crate::drive::element::Control;
pub use crate::drive::free::FreeWall;
pub use crate::drive::groups::Group;
pub use crate::drive::inlet::Inlet;
pub use crate::drive::outlet::Outlet;
pub use crate::drive::rain::Rain;
pub use crate::drive::servo::{Goal, Servo};
use crate::ids::ShapeId;
use crate::law::stability::{self, TimeStepLimit};
use crate::law::{self, ForceLaw};
use crate::math::{Quat, Vec3};
use crate::output::report::Origin;
use crate::particles::Needs;
use crate::population::Library;
pub use crate::population::mix::Mix;
pub use crate::population::orientations::Orientations;
use crate::shape::Kind;
use crate::sim::audit;
use crate::sim::run::Over;
pub use crate::sim::stop::Stop;
use crate::sim::{Simulation, steps_of};
use crate::text::{self, Unreadable};
use crate::walls::Wall;
pub use matter::Material;
use mistakes::Mistakes;
pub use mistakes::{Location, Problem, SceneErrors};
use parts::Need;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::path::{Path, PathBuf};

/// A checked scene: one stage of a run.
///
/// ```
/// use dem_mpi::scene::Scene;
/// use std::path::Path;
///
/// let path = Path::new("run/first/scene.toml");
/// let scene = Scene::read(path, &["material.glass.friction=0.6".to_owned()]).unwrap();
/// assert_eq!(scene.particle_count(), 64);
/// assert!(scene.dt < scene.time_step_limit().unwrap().dt);
///
/// let mistakes = Scene::read(path, &["material.glass.fricton=0.6".to_owned()]).unwrap_err();
/// assert!(mistakes.to_string().contains("no such key, did you mean `friction`?"));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self")]
pub struct Scene {
    /// One line for the log.
    pub title: String,
    /// Seed of all that is random.
    pub seed: u64,
    /// Where particles may be.
    pub domain: Cell,
    /// How it is strained, if it is.
    pub cell: Option<Control>,
    /// Materials, by `MaterialId`.
    pub materials: Vec<Material>,
    /// The law of contacts, with the constants of every pair of materials.
    pub law: law::Choice,
    /// What one of two materials does not say.
    pub left_out: Vec<String>,
    /// What becomes of the forces where the snapshot with which it begins, or goes on, was made with other constants.
    pub jumps: Option<String>,
    /// What is doubtful in the files that it names, a sentence each.
    pub doubtful: Vec<String>,
    /// Shapes of particles, then of walls, by `ShapeId`.
    pub library: Library,
    /// Walls, in the order of their ids.
    pub walls: Vec<Wall>,
    /// Which of them keep a stress.
    pub servos: Vec<Servo>,
    /// Walls that move freely under load.
    pub free_walls: Vec<FreeWall>,
    /// How contacts are resolved.
    pub method: Method,
    /// Gravity [m/s²].
    pub gravity: Vec3,
    /// Global damping ξ: every particle feels `-ξ m v` and `-ξ I ω` [1/s].
    pub global_damping: f64,
    /// Particles that are there at the start.
    pub initial: Vec<Fill>,
    /// Particles that fall in during the run.
    pub rain: Option<Rain>,
    /// Where particles appear at a rate.
    pub inlets: Vec<Inlet>,
    /// Where particles leave.
    pub outlets: Vec<Outlet>,
    /// Particles that are held or pushed.
    pub groups: Vec<Group>,
    /// Time step [s].
    pub dt: f64,
    /// Is it the program's own, that a stage may shorten?
    pub own_step: bool,
    /// Steps of this stage, at most.
    pub steps: u64,
    /// How long it lasts, if the scene says that in place of steps [s].
    pub duration: Option<f64>,
    /// Run although the time step is over the stable limit.
    pub allow_unstable: bool,
    /// When the stage ends before.
    pub stop: Stop,
    /// A pair is listed when its bounding spheres come this close [m].
    pub skin: f64,
    /// Subdomains are cut again when the busiest rank has this many times the mean work.
    pub imbalance: f64,
    /// Steps after which the order of space is renewed.
    pub order_every: u64,
    /// Steps between snapshots; 0: only at the start and the end.
    pub snapshot_every: u64,
    /// Steps between rows of `history.csv`; 0: only at the end.
    pub history_every: u64,
    /// How contacts are audited.
    pub audit: audit::Settings,
    /// Where output goes; the command line may override.
    pub out: PathBuf,
    /// The snapshot with which this stage begins.
    pub start: Option<PathBuf>,
    /// The file with what it takes from others and the overrides of the command line, as TOML that needs no other scene.
    pub text: String,
}

impl Serialize for Scene {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

/// Surfaces of walls come in the library alone.
impl<'a> Deserialize<'a> for Scene {
    fn deserialize<D: Deserializer<'a>>(deserializer: D) -> Result<Self, D::Error> {
        let mut scene = Self::deserialize(deserializer)?;
        for wall in &mut scene.walls {
            wall.take_surface(&scene.library);
        }
        Ok(scene)
    }
}

impl Scene {
    /// Reads and checks a file. An override is `path.to.key=value`, as in `time.steps=1000` or
    /// `material.glass.friction=0.4`; items of a list go by name or index, and a value that is not
    /// TOML is a string.
    ///
    /// # Errors
    /// All mistakes of the file and the overrides, each with its place.
    pub fn read(path: &Path, overrides: &[String]) -> Result<Self, SceneErrors> {
        Self::read_for(path, overrides, Need::AllFiles)
    }

    /// The same of a stage that goes on from a snapshot of its own, or from the newest good one of a directory: that from which
    /// it began may be gone. All that follows from sizes of grains is as in the stage that was not interrupted.
    ///
    /// # Errors
    /// As [`Scene::read`]. A snapshot that cannot be read is none: that is told when it is taken up ([`assemble::take_up`]).
    pub fn read_to_go_on(
        path: &Path,
        overrides: &[String],
        snapshot: &Path,
    ) -> Result<Self, SceneErrors> {
        Self::read_for(path, overrides, Need::Snapshot(snapshot))
    }

    fn read_for(path: &Path, overrides: &[String], need: Need) -> Result<Self, SceneErrors> {
        let name = path.display().to_string();
        let bytes = std::fs::read(path).map_err(Unreadable::File);
        match bytes.and_then(text::decode) {
            Ok(text) => {
                let folder = path.parent().unwrap_or(Path::new(""));
                Self::parse_for(&text, &name, folder, overrides, need)
            }
            Err(error) => {
                let problems =
                    vec![Problem { location: Location::File, message: error.to_string() }];
                Err(SceneErrors { file: name, problems })
            }
        }
    }

    /// Checks a text. `file` is its name in messages; paths of particle files are relative to
    /// `folder`.
    ///
    /// # Errors
    /// As [`Scene::read`].
    pub fn parse(
        text: &str,
        file: &str,
        folder: &Path,
        overrides: &[String],
    ) -> Result<Self, SceneErrors> {
        Self::parse_for(text, file, folder, overrides, Need::AllFiles)
    }

    fn parse_for(
        text: &str,
        file: &str,
        folder: &Path,
        overrides: &[String],
        need: Need,
    ) -> Result<Self, SceneErrors> {
        let mistakes = Mistakes::default();
        let scene = parts::read(text, (file, folder), overrides, need, &mistakes)
            .and_then(|whole| check::scene(whole, &mistakes, file, need));
        match scene {
            Some(scene) if mistakes.is_empty() => Ok(scene),
            _ => Err(mistakes.into_errors(file)),
        }
    }

    /// The force law of the scene.
    pub fn force_law(&self) -> Box<dyn ForceLaw> {
        self.law.law(&self.library)
    }

    /// What a report says of it; a commit is for the program to add.
    pub fn origin(&self) -> Origin {
        Origin {
            program: concat!("dem-mpi ", env!("CARGO_PKG_VERSION")).to_owned(),
            commit: None,
            title: self.title.clone(),
            method: self.method.name().to_owned(),
            doubts: doubts::doubts(self),
        }
    }

    /// The kinds of shape that particles touch with: those of pieces in place of unions.
    pub fn particle_kinds(&self) -> Vec<Kind> {
        let shapes = &self.library.shapes[self.library.grains()];
        let touches = |&kind: &Kind| kind != Kind::Union && shapes.iter().any(|s| s.kind() == kind);
        Kind::ALL.into_iter().filter(touches).collect()
    }

    /// The kinds of facet that walls have.
    pub fn facet_kinds(&self) -> Vec<Kind> {
        let shapes = &self.library.shapes[self.library.facets()];
        Kind::ALL.into_iter().filter(|&k| shapes.iter().any(|s| s.kind() == k)).collect()
    }

    /// Which columns the scene needs.
    pub fn needs(&self) -> Needs {
        self.needs_with(&*self.force_law())
    }

    /// The same with another law.
    pub fn needs_with(&self, law: &dyn ForceLaw) -> Needs {
        let law = law.needs();
        let library = &self.library;
        let orientation =
            library.shapes[library.grains()].iter().any(|shape| shape.kind() != Kind::Sphere);
        let pushes = || self.groups.iter().filter_map(Group::push);
        Needs {
            spin: law.spin
                || orientation
                || self.walls.iter().any(Wall::turns)
                || self.groups.iter().any(Group::turns)
                || pushes().any(|push| push.torque.is_some()),
            orientation,
            form: crate::contact::needs_form(&self.method, &self.particle_kinds()),
            image: self.domain.repeats(),
            scale: self.library.has_sizes(),
            damping: self.global_damping > 0.0 || pushes().any(|push| push.drag.is_some()),
            group: !self.groups.is_empty(),
            ..law
        }
    }

    /// The largest stable time step; `None` if nothing pushes.
    pub fn time_step_limit(&self) -> Option<TimeStepLimit> {
        stability::time_step_limit(&self.library, &*self.force_law())
    }

    /// What becomes of the step where contacts that stiffen with load make the stable limit fall below it.
    pub const fn over_the_limit(&self) -> Over {
        match (self.own_step, self.allow_unstable) {
            (true, _) => Over::Followed,
            (false, true) => Over::Allowed,
            (false, false) => Over::Ends,
        }
    }

    /// Steps of this stage, at most, where its simulation stands: steps of another length before, and the one that it takes now, count.
    pub fn steps_of(&self, sim: &Simulation) -> u64 {
        self.duration.map_or(self.steps, |duration| steps_of(duration - sim.stage_shift, sim.dt))
    }

    /// Particles in all, those of a start snapshot left out.
    pub fn particle_count(&self) -> u64 {
        let initial: u64 = self.initial.iter().map(Fill::count).sum();
        initial + self.to_come().map(|(_, count)| count).sum::<u64>()
    }

    /// Mixes of particles that come during the stage, and how many of each.
    pub(crate) fn to_come(&self) -> impl Iterator<Item = (&Mix, u64)> {
        let seconds = self.steps as f64 * self.dt;
        let rain = self.rain.iter().map(|rain| (&rain.mix, rain.count));
        rain.chain(
            self.inlets
                .iter()
                .map(move |inlet| (&inlet.mix, inlet.expected(seconds, &self.library))),
        )
    }
}

/// Particles that are there at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Fill {
    /// On a simple cubic lattice.
    Lattice(Lattice),
    /// One by one, as a file lists them, in the order of their ids.
    Listed(Vec<Listed>),
}

impl Fill {
    /// How many particles.
    pub fn count(&self) -> u64 {
        match self {
            Self::Lattice(lattice) => lattice.count.iter().map(|&n| u64::from(n)).product(),
            Self::Listed(list) => list.len() as u64,
        }
    }

    /// The id after those of its particles, the first of which on a lattice is `first`.
    fn end(&self, first: u64) -> u64 {
        match self {
            Self::Lattice(_) => first + self.count(),
            Self::Listed(list) => list.last().map_or(first, |row| row.id + 1),
        }
    }

    /// The particles of a list; none of a lattice.
    fn listed(&self) -> &[Listed] {
        match self {
            Self::Lattice(_) => &[],
            Self::Listed(list) => list,
        }
    }
}

/// Particles on a lattice, x fastest, then y, then z.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lattice {
    /// Which shapes, and their share of the particles.
    pub mix: Mix,
    /// Centre of the first [m].
    pub first: Vec3,
    /// Distance of neighbours along each axis [m].
    pub spacing: Vec3,
    /// How many along each axis.
    pub count: [u32; 3],
    /// Orientations, of the scene's seed and the particle's id.
    pub orientations: Orientations,
    /// How far from its place a particle may be along each axis, at random (of the scene's seed and the particle's id) [m].
    pub jitter: f64,
    /// Velocity of all [m/s].
    pub velocity: Vec3,
}

/// A particle of a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Listed {
    /// That of the file, or the number of the particle.
    pub id: u64,
    /// Shape.
    pub shape: ShapeId,
    /// Lengths over those of the shape [-].
    pub scale: f64,
    /// Centre [m].
    pub position: Vec3,
    /// Body to world.
    pub quaternion: Quat,
    /// Velocity [m/s].
    pub velocity: Vec3,
    /// Angular velocity, world axes [rad/s].
    pub angular_velocity: Vec3,
}
