//! The user's file: read (`input`), checked (`check`) and turned into a simulation ([`assemble`]).
//!
//! A [`Scene`] is the meaning of the file: SI units, names resolved, complete and consistent. It is made on rank 0 and sent
//! to all.
//!
//! # The file
//!
//! TOML. The column *kind* gives the allowed values: `number > 0`; `[x, y, z]`, a list of as many items;
//! `{ a = number [m], b? = text }`, a table, in which keys with a question mark are optional; `or` stands between
//! alternatives. Unit and kind hold for all keys of a row, or there is one for each; `-` is no unit. Keys marked `required`
//! must be given. Paths of output, `start` and `folder` are relative to the working directory. Paths of particle files,
//! tables and meshes are relative to the folder of the file that names them, the scene or an included file. A polyhedron is
//! moved to its centre of mass and turned into its principal axes. Positions and quaternions of particles are those of its
//! centre and these axes, and `--plan` prints where they lie in the file.
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
mod ondem;
pub mod one_shape;
mod orientations;
pub mod packing;
pub mod pair;
mod parts;
mod pieces;
pub mod plan;
pub mod probe;
mod reader;
mod regions;
mod rockable;
mod room;
mod scattered;
pub mod schema;
pub mod self_test;
mod sizes;
pub mod suggest;
mod walls;
pub mod workload;

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
    /// Title, one line for the log.
    pub title: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Domain of the particles.
    pub domain: Cell,
    /// Control of its strain, if it is strained.
    pub cell: Option<Control>,
    /// Materials, by `MaterialId`.
    pub materials: Vec<Material>,
    /// Contact law, with the constants of every pair of materials.
    pub law: law::Choice,
    /// Warnings about constants that only one of two materials gives.
    pub left_out: Vec<String>,
    /// Warning about changed forces, if the snapshot from which it starts was made with other constants.
    pub jumps: Option<String>,
    /// Warnings about the files that it names, a sentence each.
    pub doubtful: Vec<String>,
    /// Shapes of particles, then of walls, by `ShapeId`.
    pub library: Library,
    /// Walls, in the order of their ids.
    pub walls: Vec<Wall>,
    /// Walls that keep a stress or a force.
    pub servos: Vec<Servo>,
    /// Walls that move freely under load.
    pub free_walls: Vec<FreeWall>,
    /// Contact method.
    pub method: Method,
    /// Gravity [m/s²].
    pub gravity: Vec3,
    /// Global damping ξ: every particle feels `-ξ m v` and `-ξ I ω` [1/s].
    pub global_damping: f64,
    /// Particles at the start.
    pub initial: Vec<Fill>,
    /// Particles that fall in during the run.
    pub rain: Option<Rain>,
    /// Regions in which particles appear at a rate.
    pub inlets: Vec<Inlet>,
    /// Regions in which particles leave.
    pub outlets: Vec<Outlet>,
    /// Particles that are held or pushed.
    pub groups: Vec<Group>,
    /// Time step [s].
    pub dt: f64,
    /// Is the step automatic? Then a stage may shorten it.
    pub own_step: bool,
    /// Largest number of steps of this stage.
    pub steps: u64,
    /// Duration of the stage [s], if the scene gives it in place of steps.
    pub duration: Option<f64>,
    /// Does the scene run although the time step is above the stable limit?
    pub allow_unstable: bool,
    /// Conditions for an earlier end of the stage.
    pub stop: Stop,
    /// Distance between bounding spheres within which a pair is listed [m].
    pub skin: f64,
    /// Work of the busiest rank over the mean, above which subdomains are cut again.
    pub imbalance: f64,
    /// Steps after which the spatial order is renewed.
    pub order_every: u64,
    /// Steps between snapshots; 0: only at the start and the end.
    pub snapshot_every: u64,
    /// Wall clock between snapshots, at most [min]; `None`: by steps alone.
    pub snapshot_every_minutes: Option<f64>,
    /// Steps between rows of `history.csv`; 0: only at the end.
    pub history_every: u64,
    /// Settings of the audit of contacts.
    pub audit: audit::Settings,
    /// Output folder; the command line may override it.
    pub out: PathBuf,
    /// Snapshot with which this stage begins.
    pub start: Option<PathBuf>,
    /// The file with its included parts and the overrides of the command line, as TOML that needs no other scene.
    pub text: String,
}

impl Serialize for Scene {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

/// The surfaces of walls are only stored in the library.
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
    /// All errors of the file and the overrides, each with its location.
    pub fn read(path: &Path, overrides: &[String]) -> Result<Self, SceneErrors> {
        Self::read_for(path, overrides, Need::AllFiles)
    }

    /// Reads and checks a file for a stage that continues from one of its snapshots, or from the newest good one of a
    /// directory. The snapshot from which the stage began may be missing. Everything that follows from the sizes of
    /// particles is as in an uninterrupted stage.
    ///
    /// # Errors
    /// See [`Scene::read`]. An unreadable snapshot is ignored here; [`assemble::take_up`] reports it.
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
    /// See [`Scene::read`].
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

    /// Part of a report about the scene; the program adds its commit.
    pub fn origin(&self) -> Origin {
        Origin {
            program: concat!("dem-mpi ", env!("CARGO_PKG_VERSION")).to_owned(),
            commit: None,
            title: self.title.clone(),
            method: self.method.name().to_owned(),
            doubts: doubts::doubts(self),
        }
    }

    /// Kinds of shape with which particles touch: those of pieces in place of unions.
    pub fn particle_kinds(&self) -> Vec<Kind> {
        let shapes = &self.library.shapes[self.library.grains()];
        let touches = |&kind: &Kind| kind != Kind::Union && shapes.iter().any(|s| s.kind() == kind);
        Kind::ALL.into_iter().filter(touches).collect()
    }

    /// Kinds of facets of walls.
    pub fn facet_kinds(&self) -> Vec<Kind> {
        let shapes = &self.library.shapes[self.library.facets()];
        Kind::ALL.into_iter().filter(|&k| shapes.iter().any(|s| s.kind() == k)).collect()
    }

    /// Columns that the scene needs.
    pub fn needs(&self) -> Needs {
        self.needs_with(&*self.force_law())
    }

    /// Columns that the scene needs with another law.
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

    /// Largest stable time step; `None` if no contact can push.
    pub fn time_step_limit(&self) -> Option<TimeStepLimit> {
        stability::time_step_limit(&self.library, &*self.force_law())
    }

    /// Reaction when contacts that stiffen with load make the stable limit fall below the step.
    pub const fn over_the_limit(&self) -> Over {
        match (self.own_step, self.allow_unstable) {
            (true, _) => Over::Followed,
            (false, true) => Over::Allowed,
            (false, false) => Over::Ends,
        }
    }

    /// Largest number of steps of this stage in the state of its simulation, with its earlier and present time steps.
    pub fn steps_of(&self, sim: &Simulation) -> u64 {
        self.duration.map_or(self.steps, |duration| steps_of(duration - sim.stage_shift, sim.dt))
    }

    /// Total number of particles, without those of a start snapshot.
    pub fn particle_count(&self) -> u64 {
        let initial: u64 = self.initial.iter().map(Fill::count).sum();
        initial + self.to_come().map(|(_, count)| count).sum::<u64>()
    }

    /// Mixes of particles that come during the stage, with their numbers.
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

/// Particles at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Fill {
    /// On a simple cubic lattice.
    Lattice(Lattice),
    /// Individually, as a file lists them, in the order of their ids.
    Listed(Vec<Listed>),
}

impl Fill {
    /// Number of particles.
    pub fn count(&self) -> u64 {
        match self {
            Self::Lattice(lattice) => lattice.count.iter().map(|&n| u64::from(n)).product(),
            Self::Listed(list) => list.len() as u64,
        }
    }

    /// Id after the last particle; the first one of a lattice is `first`.
    fn end(&self, first: u64) -> u64 {
        match self {
            Self::Lattice(_) => first + self.count(),
            Self::Listed(list) => list.last().map_or(first, |row| row.id + 1),
        }
    }

    /// Particles of a list; none for a lattice.
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
    /// Shapes, and their shares of the particles.
    pub mix: Mix,
    /// Centre of the first [m].
    pub first: Vec3,
    /// Distance of neighbours along each axis [m].
    pub spacing: Vec3,
    /// Number along each axis.
    pub count: [u32; 3],
    /// Orientations, from the scene's seed and the particle's id.
    pub orientations: Orientations,
    /// Largest random displacement along each axis, from the scene's seed and the particle's id [m].
    pub jitter: f64,
    /// Velocity of all [m/s].
    pub velocity: Vec3,
}

/// A particle of a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Listed {
    /// Id in the file, or the number of the particle.
    pub id: u64,
    /// Shape.
    pub shape: ShapeId,
    /// Lengths over those of the shape [-].
    pub scale: f64,
    /// Centre [m].
    pub position: Vec3,
    /// Rotation from body to world.
    pub quaternion: Quat,
    /// Velocity [m/s].
    pub velocity: Vec3,
    /// Angular velocity, world axes [rad/s].
    pub angular_velocity: Vec3,
}
