//! The user's file: read (`input`), checked (`check`) and turned into a simulation ([`assemble`]).
//!
//! A [`Scene`] is what the file means: SI units, names resolved, nothing missing, nothing
//! inconsistent. It is made on rank 0 and sent to all.
//!
//! # The file
//!
//! TOML; a key without "default" must be there. Paths of output and `start` are relative to the
//! working directory, paths of particle files and meshes to the scene's folder.
//! A polyhedron is moved to its centre of mass and turned into its principal axes; positions and
//! quaternions of particles are those of its centre and these axes, and `--plan` says where they lie in the file.
//!
//! | key | unit | meaning |
//! |---|---|---|
//! | `title` | | one line for the log; default: the file's name |
//! | `seed` | | of all that is random; default 1 |
//! | `gravity` | m/s² | [x, y, z]; default 0 |
//! | `global_damping` | 1/s | every particle feels `-ξ m v` and `-ξ I ω`; default 0 |
//! | `start` | | the snapshot with which this stage begins, or a directory: its newest good one; default: none |
//! | **`[domain]`** | | |
//! | `low`, `high` | m | corners of the box in which particles may be |
//! | `periodic` | | [x, y, z], true or false; default false |
//! | `shear` | | `{ along, across, rate }`: simple shear without walls (Lees and Edwards). Images slide along one axis, faster the farther up another (both periodic): velocity over height `rate` [1/s]. Particles begin with the flow's velocity, of which another stage gets what it lacks; default: none |
//! | `walls` | | sides of the box that are fixed walls: `"-x"` `"+x"` `"-y"` `"+y"` `"-z"` `"+z"`; default none |
//! | `wall_material` | | of these walls; default: the scene's only material |
//! | `wall_velocity` | m/s | of those that move, as in `{ "+z" = [0, 0, -0.001] }` |
//! | **`[[wall]]`** | | any other plane; walls have no edges |
//! | `name` | | |
//! | `point`, `normal` | m | a point of the plane; a direction of any length, towards the particles; or: |
//! | `planes` | m | of a wall of several planes, which move as one body: a list of `{ point, normal }`. Particles are in front of all |
//! | `velocity` | m/s | default 0 |
//! | `rotation` | | `{ about, axis, rate }`: a point of the axis [m], which moves with the velocity, its direction, of any length, and the angular velocity [rad/s], anticlockwise where the axis points to the eye; default: none. Along a periodic axis only, if there is one |
//! | `material` | | default: the scene's only material |
//! | **`[[servo]]`** | | walls that keep a stress, by a proportional and integral law on their velocity ([`crate::drive::servo`]); over 2 % off the target in the mean of the last fifth of a stage is warned at its end |
//! | `walls` | | names of walls across x, y or z, which may have a velocity along themselves; along the two other axes there must be walls on both sides, or a period |
//! | `stress` | Pa | target, compression positive: normal force over the area between the other walls |
//! | `max_speed` | m/s | of these walls, and their speed while nothing touches them; default 1 |
//! | `coupled` | | all move by one displacement for the mean stress of all, so a pair closes symmetrically; default false: each on its own |
//! | `gain` | | factor on how quickly the walls answer, for all time steps and grains alike; less is slower and softer, more than about 1.7 may swing; default 1 |
//! | **`[[material]]`** | | |
//! | `name` | | |
//! | `density` | kg/m³ | |
//! | `normal_stiffness` | N/m | of a contact between two bodies of this material |
//! | `tangential_stiffness` | N/m | default: the normal stiffness; friction needs more than 0 |
//! | `friction` | | coefficient of friction; default 0 |
//! | `restitution` | | rebound over approach velocity, in (0, 1]; default 1 |
//! | `tangential_damping_ratio` | | fraction of critical damping; default 0 |
//! | `youngs_modulus` | Pa | with `normal = "hertz"`, in place of both stiffnesses and `tangential_damping_ratio` |
//! | `poisson_ratio` | | from 0 to 0.5, with `normal = "hertz"` |
//! | **`[[interaction]]`** | | constants of two materials; what it leaves out, and two materials without one, are mixed: stiffnesses a, b give 2ab/(a + b), friction is the smaller, damping ratios (of which the restitution makes the normal one) are averaged. `--plan` says what comes out |
//! | `between` | | names of the two materials |
//! | | | any key of `[[material]]` from `normal_stiffness` to `tangential_damping_ratio` |
//! | **`[[shape]]`** | | |
//! | `name` | | |
//! | `material` | | default: the scene's only material |
//! | `kind` | | `"sphere"`, `"ellipsoid"`, `"superellipsoid"`, `"poly-superellipsoid"`, `"spherocylinder"`, `"polyhedron"` or `"rounded-polyhedron"` |
//! | `radius` or `diameter` | m | of a sphere |
//! | `semi_axes` | m | of an ellipsoid, along its own x, y, z; or: |
//! | `diameter`, `aspect_ratio` | m | of the sphere of equal volume; first semi-axis over the other two |
//! | `semi_axes` | m | of a superellipsoid, along its own x, y, z |
//! | `semi_axes_positive`, `semi_axes_negative` | m | of a poly-superellipsoid, from where its octants meet towards positive and negative x, y, z; particles are placed by their centres of mass and principal axes |
//! | `exponents` | | of both: [e1, e2], each from 0.1 to 1.8, of sections along z and across; towards 0 a box, 1 an ellipsoid, towards 2 an octahedron. Sharper ones are polyhedra |
//! | `length`, `radius` | m | of a spherocylinder: of its axis, from centre to centre of the spheres at its ends (along its own x); of its round |
//! | `vertices` | m | of a polyhedron or the core of a rounded one: [[x, y, z], ...], in any axes and order; or: |
//! | `file`, `scale` | m | a closed and convex mesh, `.stl` or `.obj`; metres per unit of its lengths, default 1 |
//! | `radius` | m | of the sphere that rolls around a rounded polyhedron's core |
//! | `size` | | how sizes of the particles of lattices and rain are distributed, by number: `{ uniform = [0.8, 1.2] }` is any scale of the lengths above between these two; default: all are as above |
//! | **`[contact]`** | | how contacts are resolved; may be left out |
//! | `method` | | `"auto"` (default: the best for each pair of kinds, and for polyhedra the thickness of what they share), `"common-normal"` (smooth shapes only), `"gjk-erosion"` or `"epa"` |
//! | `erosion_ratio` | | of `gjk-erosion`: first erosion, in (0, 1); default 0.05 |
//! | `erosion_increment` | | of `gjk-erosion`: added until the bodies are apart; from 1e-4, default 0.01 |
//! | `tolerance` | | of `gjk-erosion` (default 1e-6) and `epa` (default 1e-8), relative |
//! | `spurious` | | of `gjk-erosion`: bodies within the error of the overlap touch, though they are apart; default true. False, as the paper seems to have it, makes forces jump at touch |
//! | `polish` | | of `epa`: secants at the end bring the normals of smooth bodies to rounding; default true, false is EPA as in the paper |
//! | **`[law]`** | | from overlap to force ([`crate::law`]); may be left out |
//! | `kind` | | `"linear"`, as `normal = "linear"` |
//! | `normal` | | `"linear"`: linear springs and dashpots, the default ([`crate::law::linear`]); `"hertz"`: elastic spheres ([`crate::law::hertz`]), not for other shapes |
//! | `tangential` | | `"linear"` with linear springs; `"mindlin"`, the default, or `"none"` with `"hertz"` |
//! | `largest_overlap` | | `"hertz"`: the overlap over the radius that the stable time step is found for, in (0, 1); default 0.01. Steps are too long for what is pressed further |
//! | `limit_damping` | | normal dashpots never make a contact attractive; default true. The restitution asked for is met either way. It may stand in `[contact]` instead |
//! | **`[time]`** | | |
//! | `step` | s | at most the stable limit |
//! | `steps` | | at most so many |
//! | `allow_unstable` | | take a step over the limit; default false |
//! | **`[stop]`** | | may be left out; ends the stage when all that is asked for holds, looked at every 100 steps; where it does not hold after the last step, the program ends with status 4 |
//! | `rest` | | the kinetic energy is below this fraction of the energy dissipated |
//! | `unbalanced` | | the mean resultant force of a particle is below this fraction of the mean contact force (of as many contacts as particles at least) |
//! | `servo` | | the stress of every servo has been this near to its target in the mean over the last 100 steps, as a fraction of it |
//! | **`[neighbours]`** | | may be left out; changes the speed, never the result |
//! | `skin` | m | a pair is listed when its bounding spheres come this close; default: a tenth of the largest bounding radius, at most the smallest one |
//! | `imbalance` | | subdomains are cut again when the busiest rank has so many times the mean work; default 1.1 |
//! | **`[audit]`** | | may be left out; a sample of the contacts that touch is resolved again, to convergence, and the report has the errors ([`crate::sim::audit`]). Changes no result |
//! | `every` | | steps between samples; default 1000; 0: none |
//! | `contacts` | | how many at each, in the mean; default: one of 50, at most 1000 |
//! | `seed` | | of the samples; default: the scene's |
//! | **`[output]`** | | |
//! | `directory` | | |
//! | `snapshot_every` | | steps between snapshots; default 0: only at the start and the end |
//! | `history_every` | | steps between rows of `history.csv`; default 100; 0: only at the end; forces and stresses on walls with a servo are means since the row before |
//! | **`[fill.rain]`** | | layers of particles that fall in; may join a `start` |
//! | `shapes` | | names, or `{ name = share, ... }` by number; default: the scene's only shape |
//! | `count` | | how many particles in all |
//! | `every` | | steps between layers, a layer waits until its place is free; default 100 |
//! | `spacing` | m | width of a particle's cell; default 1.1 largest bounding diameters |
//! | `low`, `high` | m | the slab of a layer; default: one cell thick, across the domain's top (from where gravity pulls) |
//! | `velocity` | m/s | default 0 |
//! | **`[[fill.lattice]]`** | | particles on a lattice |
//! | `shapes`, `velocity` | | as in rain |
//! | `orientation` | | `"random"` (default) or `"upright"`: own axes along x, y, z |
//! | `spacing` | m | one number or [x, y, z]; default 1.1 largest bounding diameters |
//! | `low`, `high` | m | as many as fit into this box; default: the domain; or: |
//! | `first`, `count` | m | centre of the first, how many along [x, y, z] |
//! | `jitter` | m | how far from its place a particle may be along each axis, at random; default 0 |
//! | **`[[fill.file]]`** | | particles one by one |
//! | `path` | | CSV with a header: `x,y,z` and, if wanted, `qw,qx,qy,qz`, `vx,vy,vz`, `wx,wy,wz`, `shape`, `scale` (of the shape's lengths; default 1, whatever its `size`) |

pub mod assemble;
mod check;
pub mod doubts;
mod fills;
mod geometry;
mod input;
mod laws;
mod listed;
mod matter;
mod mistakes;
pub mod packing;
pub mod plan;
mod reader;
pub mod suggest;
mod walls;

use crate::cell::Cell;
pub use crate::contact::Method;
pub use crate::drive::rain::Rain;
pub use crate::drive::servo::Servo;
use crate::ids::ShapeId;
use crate::law::stability::{self, TimeStepLimit};
use crate::law::{self, ForceLaw};
use crate::math::{Quat, Vec3};
use crate::output::report::Origin;
pub use crate::particles::mix::Mix;
use crate::particles::walls::Wall;
use crate::particles::{Library, Needs};
use crate::shape::Kind;
use crate::sim::audit;
pub use crate::sim::run::Stop;
use check::Need;
pub use matter::Material;
use mistakes::Mistakes;
pub use mistakes::{Location, Problem, SceneErrors};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A checked scene: one stage of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// One line for the log.
    pub title: String,
    /// Seed of all that is random.
    pub seed: u64,
    /// Where particles may be.
    pub domain: Cell,
    /// Materials, by `MaterialId`.
    pub materials: Vec<Material>,
    /// The law of contacts, with the constants of every pair of materials.
    pub law: law::Choice,
    /// Shapes of particles, then of walls, by `ShapeId`.
    pub library: Library,
    /// Walls, in the order of their ids.
    pub walls: Vec<Wall>,
    /// Which of them keep a stress.
    pub servos: Vec<Servo>,
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
    /// Time step [s].
    pub dt: f64,
    /// Steps of this stage, at most.
    pub steps: u64,
    /// Run although the time step is over the stable limit.
    pub allow_unstable: bool,
    /// When the stage ends before.
    pub stop: Stop,
    /// A pair is listed when its bounding spheres come this close [m].
    pub skin: f64,
    /// Subdomains are cut again when the busiest rank has this many times the mean work.
    pub imbalance: f64,
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
    /// The file with the overrides of the command line, as TOML.
    pub text: String,
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

    /// The same of a stage that goes on from a snapshot of its own: that from which it began may be gone.
    ///
    /// # Errors
    /// As [`Scene::read`].
    pub fn read_to_go_on(path: &Path, overrides: &[String]) -> Result<Self, SceneErrors> {
        Self::read_for(path, overrides, Need::NoStart)
    }

    fn read_for(path: &Path, overrides: &[String], need: Need) -> Result<Self, SceneErrors> {
        let name = path.display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => {
                let folder = path.parent().unwrap_or(Path::new(""));
                Self::parse_for(&text, &name, folder, overrides, need)
            }
            Err(error) => {
                let message = format!("cannot be read: {error}");
                let problems = vec![Problem { location: Location::File, message }];
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
        let scene = input::read(text, overrides, &mistakes).and_then(|root| {
            let effective =
                if overrides.is_empty() { text.to_owned() } else { input::to_text(&root) };
            check::scene(&root, &mistakes, file, folder, effective, need)
        });
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

    /// The kinds of shape that particles have.
    pub fn particle_kinds(&self) -> Vec<Kind> {
        let shapes = &self.library.shapes[..self.library.particle_shapes];
        Kind::ALL.into_iter().filter(|&k| shapes.iter().any(|s| s.kind() == k)).collect()
    }

    /// The kinds of facet that walls have.
    pub fn facet_kinds(&self) -> Vec<Kind> {
        let shapes = &self.library.shapes[self.library.particle_shapes..];
        Kind::ALL.into_iter().filter(|&k| shapes.iter().any(|s| s.kind() == k)).collect()
    }

    /// Which columns the scene needs.
    pub fn needs(&self) -> Needs {
        self.needs_with(&*self.force_law())
    }

    /// The same with another law.
    pub fn needs_with(&self, law: &dyn ForceLaw) -> Needs {
        let law = law.needs();
        let orientation = self.particle_kinds().iter().any(|&kind| kind != Kind::Sphere);
        Needs {
            spin: law.spin || orientation || self.walls.iter().any(Wall::turns),
            orientation,
            form: crate::contact::needs_form(&self.method, &self.particle_kinds()),
            image: self.domain.repeats(),
            scale: self.library.has_sizes(),
            ..law
        }
    }

    /// The largest stable time step; `None` if nothing pushes.
    pub fn time_step_limit(&self) -> Option<TimeStepLimit> {
        stability::time_step_limit(&self.library, &*self.force_law())
    }

    /// Particles in all, those of a start snapshot left out.
    pub fn particle_count(&self) -> u64 {
        let initial: u64 = self.initial.iter().map(Fill::count).sum();
        initial + self.rain.as_ref().map_or(0, |rain| rain.count)
    }
}

/// Particles that are there at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Fill {
    /// On a simple cubic lattice.
    Lattice(Lattice),
    /// One by one, as a CSV file lists them.
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
    /// Random orientations (of the scene's seed and the particle's id), or upright.
    pub random_orientation: bool,
    /// How far from its place a particle may be along each axis, at random (of the scene's seed and the particle's id) [m].
    pub jitter: f64,
    /// Velocity of all [m/s].
    pub velocity: Vec3,
}

/// A particle of a CSV file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Listed {
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
