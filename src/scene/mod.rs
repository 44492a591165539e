//! The user's file: read (`input`), checked (`check`) and turned into a simulation (`assemble`).
//!
//! A [`Scene`] is what the file means: SI units, names resolved, nothing missing, nothing
//! inconsistent. It is made on rank 0 and sent to all.

use crate::ids::ShapeId;
use crate::law::{Interactions, Material};
use crate::math::{Quat, Vec3};
use crate::particles::Library;
use crate::particles::walls::Wall;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A checked scene: one stage of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// One line for the log.
    pub title: String,
    /// Seed of all that is random.
    pub seed: u64,
    /// Where particles may be.
    pub domain: DomainSpec,
    /// Materials, by `MaterialId`.
    pub materials: Vec<Material>,
    /// Contact constants of every pair of materials.
    pub interactions: Interactions,
    /// Shapes of particles, then of walls, by `ShapeId`.
    pub library: Library,
    /// Walls, in the order of their ids.
    pub walls: Vec<Wall>,
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
    /// The stage ends when the kinetic energy is below this fraction of the energy dissipated.
    pub rest: Option<f64>,
    /// A pair is listed when its bounding spheres come this close [m].
    pub skin: f64,
    /// Subdomains are cut anew when the busiest rank has this many times the mean work.
    pub imbalance: f64,
    /// Steps between snapshots; 0: only at the end.
    pub snapshot_every: u64,
    /// Steps between rows of `history.csv`; 0: only at the end.
    pub history_every: u64,
    /// Where output goes; the command line may override.
    pub out: PathBuf,
    /// The snapshot with which this stage begins.
    pub start: Option<PathBuf>,
    /// The file with the overrides of the command line, as TOML.
    pub text: String,
}

/// A box, and which of its axes repeat.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DomainSpec {
    /// Lowest corner [m].
    pub low: Vec3,
    /// Highest corner [m].
    pub high: Vec3,
    /// Which axes are periodic.
    pub periodic: [bool; 3],
}

/// How contacts of other than closed-form pairs are resolved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Method {
    /// `CommonNormal` for smooth pairs, `GjkErosion` with EPA behind it for all others.
    Auto,
    /// Newton on the common normal.
    CommonNormal,
    /// The paper's method.
    GjkErosion {
        /// First erosion ratio [-].
        ratio: f64,
        /// Added until the eroded bodies are apart [-].
        increment: f64,
        /// Relative duality gap at which GJK stops [-].
        tolerance: f64,
    },
    /// Expanding polytope.
    Epa {
        /// Relative to the size of the bodies [-].
        tolerance: f64,
    },
}

/// Particles that are there at the start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Fill {
    /// On a simple cubic lattice.
    Lattice(Lattice),
    /// One by one, as a CSV file lists them.
    Listed(Vec<Listed>),
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
    /// Random attitudes (of the scene's seed and the particle's id), or upright.
    pub random_orientation: bool,
    /// Velocity of all [m/s].
    pub velocity: Vec3,
}

/// Layers of particles that fall in at intervals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rain {
    /// Which shapes, and their share of the particles.
    pub mix: Mix,
    /// How many particles in all.
    pub count: u64,
    /// Steps between layers; a layer waits until its place is free.
    pub every: u64,
    /// Corners of the slab in which a layer appears [m].
    pub low: Vec3,
    /// Highest corner of the slab [m].
    pub high: Vec3,
    /// Distance of the layer's lattice points, which no two particles can bridge [m].
    pub spacing: f64,
    /// Velocity at the start [m/s].
    pub velocity: Vec3,
}

/// Shapes by share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mix {
    /// Shape and cumulative share, the last one 1.
    pub cumulative: Vec<(ShapeId, f64)>,
}

/// A particle of a CSV file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Listed {
    /// Shape.
    pub shape: ShapeId,
    /// Centre [m].
    pub position: Vec3,
    /// Body to world.
    pub quaternion: Quat,
    /// Velocity [m/s].
    pub velocity: Vec3,
    /// Angular velocity, world axes [rad/s].
    pub angular_velocity: Vec3,
}
