//! `report.json`: work, cost and accuracy of a run. Rank 0 writes it at the end of a run and replaces an earlier one. It covers
//! this run alone, not the runs that it continues.
//!
//! **The keys are the names of the fields below.** Units stand in the names: `_s` seconds, `_m` metres, `_n` newtons, `_j`
//! joules, `_rad` radians, `us_per_` microseconds and `ns_per_` nanoseconds per unit. A name without a unit is a count, a
//! fraction, a text or bytes. `null` stands for a figure that does not exist or is not a number.
//! [`text`](Report::summary) presents the same figures to people; programs read the file.

pub mod audit;
pub mod sizes;
mod text;

use super::growing::TableError;
use crate::drive::Kept;
use crate::files;
use crate::timing::Phase;
use audit::Audit;
use serde::{Serialize, Serializer};
use sizes::SizesOf;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// All figures of a run at its end.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Program, scene and settings.
    #[serde(flatten)]
    pub origin: Origin,
    /// Steps and speed.
    pub run: Run,
    /// Time by the name of the phase: `move`, `agree`, `rebuild`, `exchange`, `contacts`, `forces`, `audit`, `output`.
    #[serde(serialize_with = "by_name")]
    pub phases: Vec<(Phase, Spent)>,
    /// Contact resolution.
    pub contacts: Contacts,
    /// Errors of contacts, found by resolving a sample of them again.
    pub audit: Audit,
    /// Energy balance.
    pub energy: Energy,
    /// State of the packing at the end.
    pub packing: Packing,
    /// Sizes at the end of each shape with a `size`, beside the requested distribution.
    pub sizes: Vec<SizesOf>,
    /// Quantities counted by drives in this stage, the last columns of `history.csv`: through inlets and outlets, and at walls.
    #[serde(serialize_with = "as_map")]
    pub counted: Vec<(String, f64)>,
    /// Resolution of the motion by the time step.
    pub resolution: Resolution,
    /// Target and achieved value of each servo's stress.
    pub targets: Vec<Kept>,
    /// Communication and balance of work.
    pub ranks: Ranks,
    /// Memory at the end.
    pub memory: Memory,
    /// Every warning of the run, each once.
    pub warnings: Vec<String>,
}

/// Commit from which this program was built, if `DEM_MPI_COMMIT` was set at build time.
pub fn commit() -> Option<&'static str> {
    option_env!("DEM_MPI_COMMIT").filter(|commit| !commit.is_empty())
}

/// Version of this program, with the commit if it is known: `0.2.0 (f8ca4e2)`.
pub fn version() -> &'static str {
    static VERSION: LazyLock<String> = LazyLock::new(|| {
        let commit = commit().map_or_else(String::new, |commit| format!(" ({commit})"));
        format!("{}{commit}", env!("CARGO_PKG_VERSION"))
    });
    &VERSION
}

/// Program, scene and settings of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Origin {
    /// Name and version of the program.
    pub program: String,
    /// Commit from which the program was built, if `DEM_MPI_COMMIT` was set at build time.
    pub commit: Option<String>,
    /// Title of the scene.
    pub title: String,
    /// Contact method of the scene.
    pub method: String,
    /// Warnings from before the run; part of [`Report::warnings`].
    #[serde(skip)]
    pub doubts: Vec<String>,
}

/// Reason for which a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// All steps were done.
    AllStepsDone,
    /// The conditions of `[stop]` hold.
    ByStop,
    /// A signal asked for the end.
    BySignal,
}

/// Steps and speed.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    /// `all_steps_done`, `by_stop` or `by_signal`.
    pub ended: Ended,
    /// Conditions of `[stop]` that do not hold at the end; empty if all hold.
    pub unmet: String,
    /// Ranks that shared the work.
    pub ranks: u32,
    /// Number of steps of this run.
    pub steps: u64,
    /// Number of steps since the first stage began.
    pub last_step: u64,
    /// Simulated time since the first stage began.
    pub time_s: f64,
    /// Number of particles at the end.
    pub particles: u64,
    /// Particles of all ranks, summed over the steps.
    pub particle_steps: u64,
    /// Wall-clock time from the first step to the last snapshot.
    pub wall_s: f64,
    /// Steps over wall-clock time.
    pub steps_per_s: f64,
    /// Particle-steps over wall-clock time.
    pub particle_steps_per_s: f64,
    /// Wall-clock time times ranks over particle-steps.
    pub ns_per_particle_step: f64,
    /// Path of the last snapshot.
    pub snapshot: PathBuf,
}

/// Time of one phase.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spent {
    /// Sum over the ranks.
    pub total_s: f64,
    /// Time of the slowest rank.
    pub slowest_rank_s: f64,
    /// Time of the fastest rank.
    pub fastest_rank_s: f64,
    /// Share of the total of all phases.
    pub share: f64,
    /// Total over steps and ranks.
    pub us_per_step: f64,
    /// Total over particle-steps.
    pub ns_per_particle_step: f64,
    /// Total over listed pairs, summed over the steps.
    pub ns_per_listed_pair: f64,
    /// Total over contacts, summed over the steps.
    pub ns_per_contact: f64,
    /// Lower bound from the formulas of the phase; `null` where it is not known.
    pub least: Option<Least>,
}

/// Lower bound of operations and bytes from the formulas of a phase, see [`crate::sim::floor`].
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Least {
    /// Operations on `f64`.
    pub operations_per_particle_step: f64,
    /// Bytes read and written.
    pub bytes_per_particle_step: f64,
    /// These operations over the time of the phase.
    pub operations_per_ns: f64,
    /// These bytes over the time of the phase.
    pub bytes_per_ns: f64,
}

/// Contact resolution. Counts are summed over steps and ranks; a contact between two ranks counts on both.
#[derive(Clone, Debug, Serialize)]
pub struct Contacts {
    /// Pairs in the neighbour lists.
    pub listed_pairs: u64,
    /// Listed pairs that were resolved.
    pub resolved_pairs: u64,
    /// Resolved pairs that touch.
    pub contacts: u64,
    /// Contacts over wall-clock time.
    pub contacts_per_s: f64,
    /// Pairs that the first method could not resolve, by the stage of the chain that resolved them.
    pub fallbacks: [u64; 4],
    /// Pairs passed on by the first method over resolved pairs.
    pub fallback_share: f64,
}

/// Energy balance since the stage began; `received_j` includes the work of walls and particles that entered or left.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Energy {
    /// Energy received: `kinetic_j` + `gravity_j` + `stored_j` + `step_j` + `dissipated_j` + `missing_j`.
    pub received_j: f64,
    /// Kinetic energy of translation and rotation.
    pub kinetic_j: f64,
    /// Potential energy of gravity, zero at the origin.
    pub gravity_j: f64,
    /// Elastic energy in contacts.
    pub stored_j: f64,
    /// Part of the energy conserved by central differences beyond the kinetic, potential and elastic energy.
    pub step_j: f64,
    /// Energy dissipated by friction, dashpots and damping.
    pub dissipated_j: f64,
    /// Parts of the dissipated energy.
    pub dissipated_by: DissipatedBy,
    /// Energy error: the rest of the balance; negative if the steps have created energy.
    pub missing_j: f64,
    /// Largest sum of kinetic and elastic energy that this run has measured.
    pub largest_moved_j: f64,
    /// `missing_j` over `dissipated_j`; `null` if nothing was dissipated.
    pub missing_over_dissipated: Option<f64>,
    /// `missing_j` over `largest_moved_j`; `null` if nothing has moved.
    pub missing_over_moved: Option<f64>,
}

/// Energy dissipated since the stage began, by cause; 0 for causes that the scene does not have.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DissipatedBy {
    /// Normal dashpots: the whole less the other parts.
    pub normal_dashpots_j: f64,
    /// Tangential dashpots of contacts that stick. Where a contact slides, friction limits the force.
    pub tangential_dashpots_j: f64,
    /// Sliding friction, and torsion of faces.
    pub friction_j: f64,
    /// Resistance to rolling and twisting.
    pub turning_j: f64,
    /// Global damping.
    pub damping_j: f64,
    /// Adhesion, where contacts begin and end.
    pub adhesion_j: f64,
}

/// State of the packing at the end.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Packing {
    /// Contacts between particles.
    pub contacts: u64,
    /// Contacts with walls.
    pub wall_contacts: u64,
    /// Mean number of contacts of a particle, walls included.
    pub coordination: f64,
    /// Mean normal force between particles.
    pub mean_normal_force_n: f64,
    /// Mean resultant force of a particle over the mean contact force.
    pub unbalanced: f64,
}

/// Resolution of the motion by the time step: the largest values measured. Overlaps are measured at the steps of `history.csv`,
/// of snapshots and of checks of `[stop]`; motions in every step.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Resolution {
    /// Time step.
    pub dt_s: f64,
    /// Largest stable step; `null` if nothing bounds it.
    pub dt_limit_s: Option<f64>,
    /// Steps in a period of the fastest oscillation of two bodies on the spring of one contact. It is that of the lightest body
    /// on the stiffest contact of the scene, without dashpots. `null` if there is none.
    pub steps_per_oscillation: Option<f64>,
    /// Largest overlap over the inscribed radius of the smaller body.
    pub largest_overlap_over_radius: f64,
    /// Largest displacement of a particle or wall in a step over the smallest inscribed radius.
    pub largest_move_over_radius: f64,
    /// Largest rotation of a non-spherical particle in a step.
    pub largest_turn_rad: f64,
}

/// Mean and largest value of a figure over the ranks.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Share {
    /// Mean over the ranks.
    pub mean: f64,
    /// Largest value over the ranks.
    pub most: f64,
}

/// Communication and balance of work.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Ranks {
    /// Pairs and particles of the busiest rank over the mean of all ranks.
    pub imbalance: f64,
    /// Halo messages that a rank sends.
    pub messages_per_step: Share,
    /// Bytes of these messages.
    pub bytes_per_step: Share,
    /// Bytes over ghosts.
    pub bytes_per_ghost: f64,
    /// Ghosts over owned particles.
    pub ghosts_per_owned: Share,
    /// Particles of other ranks within the halo width, over owned particles.
    pub within_halo_per_owned: Share,
    /// Number of rebuilds of the neighbour lists.
    pub rebuilds: u64,
    /// Number of times that the domain was divided again.
    pub recuts: u64,
    /// Particles handed to another rank.
    pub migrated: u64,
    /// Time in which a rank was ready but had no core; `null` where the system does not measure it.
    pub without_core_s: Option<Share>,
}

/// Memory at the end, in bytes over owned particles. Ghosts and their data are included.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Memory {
    /// Whole memory.
    pub bytes_per_owned: Share,
    /// Columns of particles.
    pub column_bytes_per_owned: f64,
    /// Neighbour list.
    pub pair_bytes_per_owned: f64,
    /// Contacts.
    pub contact_bytes_per_owned: f64,
    /// Listed pairs over owned particles.
    pub pairs_per_owned: f64,
    /// Contacts over owned particles; a contact of two owned particles counts once.
    pub contacts_per_owned: f64,
    /// Peak memory of a process, everything included; `null` where the system does not measure it. Ranks in threads share one
    /// process.
    pub peak_bytes: Option<Share>,
    /// Peak memory over owned particles.
    pub peak_bytes_per_owned: Option<Share>,
}

fn by_name<S: Serializer>(phases: &[(Phase, Spent)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(phases.iter().map(|(phase, spent)| (phase.name(), spent)))
}

fn as_map<S: Serializer>(counted: &[(String, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(counted.iter().map(|(name, number)| (name, number)))
}

impl Report {
    /// Path of the report of a run.
    pub fn path(directory: &Path) -> PathBuf {
        directory.join("report.json")
    }

    /// Writes the report into `directory`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn store(&self, directory: &Path) -> Result<(), TableError> {
        let path = Self::path(directory);
        let written = serde_json::to_string_pretty(self)
            .map_err(|error| error.to_string())
            .and_then(|text| {
                let written = files::replace(&path, |file| writeln!(file, "{text}"));
                written.map(drop).map_err(|error| error.to_string())
            });
        written.map_err(|cause| TableError { path: path.clone(), cause })
    }

    /// Time spent in a phase.
    pub fn spent(&self, phase: Phase) -> Option<&Spent> {
        self.phases.iter().find(|(of, _)| *of == phase).map(|(_, spent)| spent)
    }
}

/// The figure if it is finite.
pub fn number(figure: f64) -> Option<f64> {
    figure.is_finite().then_some(figure)
}
