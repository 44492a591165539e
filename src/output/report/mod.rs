//! `report.json`: what a run did, what it took, and how far its numbers can be trusted. Rank 0 writes it at the end of a run,
//! over that of an earlier one: it is about this run alone, not about those that it continues.
//!
//! **The keys are the names of the fields below.** Units stand in the names: `_s` seconds, `_m` metres, `_n` newtons, `_j`
//! joules, `_rad` radians, `us_per_` microseconds and `ns_per_` nanoseconds for each of something; what has none is a count, a
//! fraction, a text or bytes. `null` stands for a figure that does not exist, and for one that is not a number.
//! [`text`](Report::summary) shows the same to people; programs read the file.

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

/// Everything that is known of a run when it has ended.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Which program, scene and settings.
    #[serde(flatten)]
    pub origin: Origin,
    /// Steps, and how fast they were.
    pub run: Run,
    /// Where the time went, by the name of the phase: `move`, `agree`, `rebuild`, `exchange`, `contacts`, `forces`, `audit`,
    /// `output`.
    #[serde(serialize_with = "by_name")]
    pub phases: Vec<(Phase, Spent)>,
    /// Contact resolution.
    pub contacts: Contacts,
    /// Errors of contacts of this run, found by resolving a sample of them again.
    pub audit: Audit,
    /// The balance of energies.
    pub energy: Energy,
    /// The packing at the end.
    pub packing: Packing,
    /// Sizes at the end, of each shape with a `size`, beside what was asked for.
    pub sizes: Vec<SizesOf>,
    /// What drives have counted in this stage, as the last columns of `history.csv`: through inlets and outlets, and at walls.
    #[serde(serialize_with = "as_map")]
    pub counted: Vec<(String, f64)>,
    /// How well the time step resolves what happens.
    pub resolution: Resolution,
    /// What drives were to keep, and how near they came: of each servo, its stress.
    pub targets: Vec<Kept>,
    /// Communication and the balance of work.
    pub ranks: Ranks,
    /// Memory at the end.
    pub memory: Memory,
    /// Every warning of the run, each once.
    pub warnings: Vec<String>,
}

/// The commit from which this program was built, if `DEM_MPI_COMMIT` told it when it was.
pub fn commit() -> Option<&'static str> {
    option_env!("DEM_MPI_COMMIT").filter(|commit| !commit.is_empty())
}

/// Version of this program, and the commit if it is known: `0.1.0 (f8ca4e2)`.
pub fn version() -> &'static str {
    static VERSION: LazyLock<String> = LazyLock::new(|| {
        let commit = commit().map_or_else(String::new, |commit| format!(" ({commit})"));
        format!("{}{commit}", env!("CARGO_PKG_VERSION"))
    });
    &VERSION
}

/// Which program, scene and settings a run had.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Origin {
    /// Name and version.
    pub program: String,
    /// The commit from which the program was built, if `DEM_MPI_COMMIT` told it when it was.
    pub commit: Option<String>,
    /// The scene's title.
    pub title: String,
    /// The scene's contact method.
    pub method: String,
    /// What was doubtful before the run; part of [`Report::warnings`].
    #[serde(skip)]
    pub doubts: Vec<String>,
}

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Ended {
    /// All steps were done.
    AllStepsDone,
    /// What `[stop]` asks for holds.
    ByStop,
    /// A signal asked for it.
    BySignal,
}

/// Steps, and how fast they were.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    /// `all_steps_done`, `by_stop` or `by_signal`.
    pub ended: Ended,
    /// What `[stop]` still asks for, where the run is over all the same; empty if nothing.
    pub unmet: String,
    /// Ranks that shared the work.
    pub ranks: u32,
    /// Steps of this run.
    pub steps: u64,
    /// Steps since the first stage began.
    pub last_step: u64,
    /// Simulated time since then.
    pub time_s: f64,
    /// Particles at the end.
    pub particles: u64,
    /// Particles of all ranks, summed over the steps.
    pub particle_steps: u64,
    /// Wall clock from the first step to the last snapshot.
    pub wall_s: f64,
    /// Steps over the wall clock.
    pub steps_per_s: f64,
    /// Particle-steps over the wall clock.
    pub particle_steps_per_s: f64,
    /// Wall clock times ranks over particle-steps.
    pub ns_per_particle_step: f64,
    /// The last snapshot.
    pub snapshot: PathBuf,
}

/// Time of one phase.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spent {
    /// Sum over the ranks.
    pub total_s: f64,
    /// Of the rank that took the longest.
    pub slowest_rank_s: f64,
    /// Of the rank that took the shortest.
    pub fastest_rank_s: f64,
    /// Part of the total of all phases.
    pub share: f64,
    /// Total over steps and ranks.
    pub us_per_step: f64,
    /// Total over particle-steps.
    pub ns_per_particle_step: f64,
    /// Total over listed pairs, summed over the steps.
    pub ns_per_listed_pair: f64,
    /// Total over contacts, summed over the steps.
    pub ns_per_contact: f64,
    /// What its formulas need at least; `null` where that is not known.
    pub least: Option<Least>,
}

/// What the formulas of a phase need at least, see [`crate::sim::floor`].
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Least {
    /// Operations on `f64`.
    pub operations_per_particle_step: f64,
    /// Bytes read and written.
    pub bytes_per_particle_step: f64,
    /// These operations over the time that the phase took.
    pub operations_per_ns: f64,
    /// These bytes over it.
    pub bytes_per_ns: f64,
}

/// Contact resolution; counts are summed over steps and ranks, where a contact of two ranks counts for both.
#[derive(Clone, Debug, Serialize)]
pub struct Contacts {
    /// Pairs on the neighbour lists.
    pub listed_pairs: u64,
    /// Those of them that were resolved.
    pub resolved_pairs: u64,
    /// Those of them that touch.
    pub contacts: u64,
    /// Contacts over the wall clock.
    pub contacts_per_s: f64,
    /// Pairs that the first method could not tell, by the stage of the chain that answered.
    pub fallbacks: [u64; 4],
    /// Pairs passed on by the first method over resolved pairs.
    pub fallback_share: f64,
}

/// The balance of energies since the stage began; work of walls and particles that came in or went out are in `received_j`.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Energy {
    /// What came in: `kinetic_j` + `gravity_j` + `stored_j` + `step_j` + `dissipated_j` + `missing_j`.
    pub received_j: f64,
    /// Of translation and rotation.
    pub kinetic_j: f64,
    /// Zero at the origin.
    pub gravity_j: f64,
    /// Elastic, in contacts.
    pub stored_j: f64,
    /// What central differences conserve beyond these energies.
    pub step_j: f64,
    /// Lost to friction and dashpots.
    pub dissipated_j: f64,
    /// The parts of that.
    pub dissipated_by: DissipatedBy,
    /// What the balance is short of; negative if the steps have made energy.
    pub missing_j: f64,
    /// The largest kinetic and elastic energy together that this run has measured.
    pub largest_moved_j: f64,
    /// `missing_j` over `dissipated_j`; `null` if nothing was dissipated.
    pub missing_over_dissipated: Option<f64>,
    /// `missing_j` over `largest_moved_j`; `null` if nothing has moved.
    pub missing_over_moved: Option<f64>,
}

/// What has dissipated energy since the stage began; parts that the scene does not have are 0.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DissipatedBy {
    /// What is left of the whole.
    pub normal_dashpots_j: f64,
    /// In contacts that stick. Where one slides the force is that of friction.
    pub tangential_dashpots_j: f64,
    /// Sliding, and torsion of faces.
    pub friction_j: f64,
    /// Resistance to rolling and twisting.
    pub turning_j: f64,
    /// Global damping.
    pub damping_j: f64,
    /// Adhesion, where contacts begin and end.
    pub adhesion_j: f64,
}

/// The packing at the end.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Packing {
    /// Contacts between particles.
    pub contacts: u64,
    /// Contacts with walls.
    pub wall_contacts: u64,
    /// Mean number of contacts of a particle, with walls.
    pub coordination: f64,
    /// Mean normal force between particles.
    pub mean_normal_force_n: f64,
    /// Mean resultant force of a particle over the mean contact force.
    pub unbalanced: f64,
}

/// How well the time step resolves what happens. The largest of what was measured, at the steps of `history.csv`, of snapshots
/// and of looks at `[stop]` (overlaps), or in every step (motions).
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Resolution {
    /// Time step.
    pub dt_s: f64,
    /// Largest stable step; `null` if nothing bounds it.
    pub dt_limit_s: Option<f64>,
    /// Steps in a period of the fastest oscillation of two bodies on the spring of one contact: that of the lightest on the
    /// hardest that the scene has, without dashpots. `null` if there is none.
    pub steps_per_oscillation: Option<f64>,
    /// Overlap over the inscribed radius of the smaller body: the largest measured.
    pub largest_overlap_over_radius: f64,
    /// Way of a particle or wall in a step over the smallest inscribed radius: the largest.
    pub largest_move_over_radius: f64,
    /// Angle by which a particle that is no sphere has turned in a step: the largest.
    pub largest_turn_rad: f64,
}

/// A figure of each rank.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Share {
    /// Mean over the ranks.
    pub mean: f64,
    /// The largest.
    pub most: f64,
}

/// Communication and the balance of work.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Ranks {
    /// Pairs and particles of the busiest rank over the mean of all.
    pub imbalance: f64,
    /// Messages of the halo that a rank sends.
    pub messages_per_step: Share,
    /// Bytes of these messages.
    pub bytes_per_step: Share,
    /// Bytes over ghosts.
    pub bytes_per_ghost: f64,
    /// Ghosts over owned particles.
    pub ghosts_per_owned: Share,
    /// Particles of others within the halo width, over owned particles.
    pub within_halo_per_owned: Share,
    /// Neighbour lists rebuilt.
    pub rebuilds: u64,
    /// How often the domain was cut again.
    pub recuts: u64,
    /// Particles handed to another rank.
    pub migrated: u64,
    /// Time in which a rank could have gone on, but other programs or ranks had its core; `null` where the system does not say.
    pub without_core_s: Option<Share>,
}

/// Memory at the end, in bytes over owned particles; ghosts count with those that they touch.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Memory {
    /// All of it.
    pub bytes_per_owned: Share,
    /// In columns of particles.
    pub column_bytes_per_owned: f64,
    /// In the neighbour list.
    pub pair_bytes_per_owned: f64,
    /// In contacts.
    pub contact_bytes_per_owned: f64,
    /// Listed pairs.
    pub pairs_per_owned: f64,
    /// Contacts; one of two owned particles counts once.
    pub contacts_per_owned: f64,
    /// The most that a process has held, with all that is in it; `null` where the system does not say. Ranks in threads have
    /// one process together.
    pub peak_bytes: Option<Share>,
    /// The same over its owned particles.
    pub peak_bytes_per_owned: Option<Share>,
}

/// Entries of a map, in their order.
fn by_name<S: Serializer>(phases: &[(Phase, Spent)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(phases.iter().map(|(phase, spent)| (phase.name(), spent)))
}

fn as_map<S: Serializer>(counted: &[(String, f64)], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(counted.iter().map(|(name, number)| (name, number)))
}

impl Report {
    /// Where the report of a run is.
    pub fn path(directory: &Path) -> PathBuf {
        directory.join("report.json")
    }

    /// Writes it into `directory`.
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

    /// Time of a phase.
    pub fn spent(&self, phase: Phase) -> Option<&Spent> {
        self.phases.iter().find(|(of, _)| *of == phase).map(|(_, spent)| spent)
    }
}

/// A figure, if it is a number.
pub fn number(figure: f64) -> Option<f64> {
    figure.is_finite().then_some(figure)
}
