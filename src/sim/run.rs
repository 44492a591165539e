//! A run: steps with scheduled outputs until the stage or the run ends.

use super::history::own_columns;
use super::start::{DEEPEST_START, check_overlaps};
pub use super::stiffening::Over;
use super::stiffening::{FOLLOWED_EVERY, Stiffening};
use super::stop::Stop;
use super::watch::{DEEPEST_ON_SURFACE, Fault};
use super::{Simulation, StepError, steps_of};
use crate::comm::{Comm, agree, wire};
use crate::domain::DomainError;
use crate::drive::lists::Lists;
use crate::drive::{CHECK_EVERY, Reporter, Row, all_observers};
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::measure::Measures;
use crate::output::growing::TableError;
use crate::output::lists::List;
use crate::output::table::{self, History};
use crate::output::{SnapshotError, snapshot};
use crate::particles::columns::Quantity;
use crate::timing::{Clock, Phase};
use std::array::IntoIter;
use std::collections::BTreeSet;
use std::iter::Peekable;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Length, outputs and end of a run.
#[derive(Clone, Debug)]
pub struct Schedule {
    /// Last step.
    pub last_step: u64,
    /// Does the stage end there? Otherwise only the run ends.
    pub ends_stage: bool,
    /// Steps between snapshots; 0: only at the start of a stage and at the end.
    pub snapshot_every: u64,
    /// Wall clock between snapshots, at most [min]; `None`: by steps alone.
    pub snapshot_every_minutes: Option<f64>,
    /// Steps between rows of the history; 0: only at the end.
    pub history_every: u64,
    /// Conditions for an earlier end.
    pub stop: Stop,
    /// Output folder.
    pub out: PathBuf,
    /// Text of the scene, for the snapshots.
    pub scene: String,
    /// Does the run continue from a snapshot of the same stage?
    pub resumed: bool,
    /// Number of the signal that asked this rank to stop; 0 for none.
    pub signal: Arc<AtomicUsize>,
    /// Particles whose state and contacts are printed at every step.
    pub traced: Vec<GlobalId>,
    /// Duration of the stage [s], if it is not given by a number of steps.
    pub duration: Option<f64>,
    /// Reaction when contacts that stiffen with load make the stable limit fall below the step.
    pub over: Over,
}

/// Reason for a normal end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The last step was done.
    LastStep,
    /// All conditions of [`Stop`] hold.
    Rest,
    /// A signal of this number was received on any rank.
    Signal(usize),
}

/// Result of a run.
#[derive(Clone, Debug)]
pub struct Finish {
    /// Reason for the end.
    pub ending: Ending,
    /// Is the stage over?
    pub ends_stage: bool,
    /// Conditions for an earlier end.
    pub stop: Stop,
    /// Steps of this run.
    pub steps_done: u64,
    /// Number of particles over all ranks, summed over the steps.
    pub particle_steps: u64,
    /// Wall clock [s].
    pub wall_seconds: f64,
    /// Part of it in which this rank was ready but had no core [s]; `None` if the system does not report it.
    pub seconds_without_core: Option<f64>,
    /// Last scalar measures.
    pub measures: Measures,
    /// Largest sum of kinetic and elastic energy that the run has measured [J].
    pub most_moving: f64,
    /// Largest overlap over the shortest axis of the smaller body that the run has measured [-], and its step.
    pub largest_overlap: (f64, u64),
    /// Text about the stable limit of a law that stiffens with load, if contacts were stiffer than assumed.
    pub stiffened: Option<String>,
    /// Conditions of the stage's [`Stop`] that do not hold at the end of the stage; empty if none.
    pub unmet: String,
    /// Warnings of the run.
    pub warnings: Vec<String>,
    /// Last snapshot.
    pub snapshot: PathBuf,
}

/// Progress of a run, for a progress bar.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Steps of this run done.
    pub done: u64,
    /// Steps of this run, at most.
    pub of: u64,
    /// Scalar measures, at steps of the history.
    pub measures: Option<&'a Measures>,
    /// Lines about the traced particles, on rank 0.
    pub trace: &'a str,
    /// New warnings, the same on all ranks.
    pub warnings: &'a [String],
}

/// Reason why a run could not go on.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// Error in a step. Unless [`StepError::is_agreed`], known on one rank only: abort the others.
    #[error(transparent)]
    Step(#[from] StepError),
    /// A particle is at an invalid position, or its state is not finite. Known on all ranks.
    #[error("step {step}: {error}\n{particle}")]
    Particle {
        /// Steps done.
        step: u64,
        /// Particle and reason.
        error: DomainError,
        /// Its state, and the bodies that it touched.
        particle: String,
    },
    /// A snapshot could not be written. Known on all ranks.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// The history or a list could not be written. Known on rank 0 only: abort the others.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Bodies overlap too deeply, or are too fast, at the start of a stage. Known on all ranks.
    #[error("{0}")]
    Start(String),
}

/// Runs to the end of the schedule. Collective.
///
/// The steps of `dem-mpi`, and its output:
///
/// ```
/// use dem_mpi::comm::alone::Alone;
/// use dem_mpi::output::snapshot::Reader;
/// use dem_mpi::scene::{Scene, assemble};
/// use dem_mpi::sim::run::{Schedule, run};
/// use std::path::Path;
/// use std::sync::Arc;
///
/// let scene = Scene::read(Path::new("run/first/scene.toml"), &[]).unwrap();
/// let mut comm = Alone::default();
/// let mut sim = assemble::assemble(&scene, &comm);
/// assemble::fill(&mut sim, &scene, &comm);
/// let folder = tempfile::tempdir().unwrap();
/// let schedule = Schedule {
///     last_step: 100,
///     ends_stage: false,
///     snapshot_every: 50,
///     snapshot_every_minutes: None,
///     history_every: 10,
///     stop: scene.stop.clone(),
///     out: folder.path().into(),
///     scene: scene.text.clone(),
///     resumed: false,
///     signal: Arc::default(),
///     traced: Vec::new(),
///     duration: scene.duration,
///     over: scene.over_the_limit(),
/// };
/// run(&mut sim, &schedule, &mut comm, &mut |_| ()).unwrap();
///
/// let snapshot = Reader::open(folder.path()).unwrap();
/// assert_eq!(snapshot.header().step, 100);
/// let particles = snapshot.particles(0..snapshot.particle_count()).unwrap();
/// // The file has particles in the order of their ids, a rank in that of space.
/// let slot = |id| sim.particles.id.iter().position(|&other| other == id).unwrap();
/// let places = particles.id.iter().map(|&id| sim.particles.position[slot(id)]);
/// assert!(places.eq(particles.position));
/// ```
///
/// # Errors
/// See [`RunError`].
pub fn run(
    sim: &mut Simulation,
    schedule: &Schedule,
    comm: &mut dyn Comm,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Finish, RunError> {
    if !schedule.resumed {
        begin(sim, comm)?;
    }
    // Time before this point belongs to no phase of the run.
    sim.clock = Clock::new();
    let started = Instant::now();
    let first_step = sim.step;
    let mut records = Records::open(sim, schedule, comm)?;
    let mut warned = Vec::new();
    if !schedule.resumed {
        records.first(sim, &mut warned, comm)?;
        let of = records.last_step - first_step;
        progress(&Progress { done: 0, of, measures: None, trace: "", warnings: &warned });
    }
    sim.clock.lap(Phase::Output);
    let mut particle_steps = 0;
    let mut ending = Ending::LastStep;
    let mut check = Check::new(sim.step);
    while sim.step < records.last_step {
        let stepped = sim.step(comm);
        stepped.map_err(|error| explain(error, sim, comm))?;
        particle_steps += sim.particles.owned as u64;
        sim.audit(comm);

        let (signal, is_late) = check.look(sim.step, schedule, records.saved, comm);
        let mut warnings: Vec<String> =
            sim.all_observers_mut().flat_map(Reporter::warnings).collect();
        ending = records.after_step(sim, &mut warnings, comm)?;
        let is_last = sim.step == records.last_step;
        if let Some(signal) = signal.filter(|_| !is_last && ending == Ending::LastStep) {
            ending = Ending::Signal(signal);
        }
        if is_late && !is_last && ending == Ending::LastStep {
            records.save_off_schedule(sim, comm)?;
        }
        let trace: String = schedule.traced.iter().map(|&id| sim.trace(id, comm)).collect();
        progress(&Progress {
            done: sim.step - first_step,
            of: records.last_step - first_step,
            measures: records.measures.as_ref(),
            trace: &trace,
            warnings: &warnings,
        });
        warned.append(&mut warnings);
        sim.clock.lap(Phase::Output);
        if ending != Ending::LastStep {
            break;
        }
    }

    let (measures, snapshot) = records.last(sim, ending, comm)?;
    sim.clock.lap(Phase::Output);
    let mut total = [particle_steps as i64];
    comm.sum(&mut total);
    let has_ended = ending == Ending::LastStep && schedule.ends_stage;
    let most_moving = most_moving(sim, &measures);
    Ok(Finish {
        ending,
        stop: schedule.stop.clone(),
        ends_stage: has_ended || ending == Ending::Rest,
        unmet: if has_ended { schedule.stop.unmet(sim, &measures) } else { String::new() },
        steps_done: sim.step - first_step,
        particle_steps: total[0] as u64,
        wall_seconds: started.elapsed().as_secs_f64(),
        seconds_without_core: sim.clock.seconds_without_core(),
        measures,
        most_moving,
        largest_overlap: records.largest_overlap,
        stiffened: (records.stiffening.as_ref())
            .and_then(|stiffening| stiffening.words(2.0 * records.largest_overlap.0, sim)),
        warnings: warned,
        snapshot,
    })
}

/// Lists pairs, rejects overlaps that are too deep, and finds the initial forces. Collective.
///
/// # Errors
/// See [`RunError`].
pub fn begin(sim: &mut Simulation, comm: &mut dyn Comm) -> Result<(), RunError> {
    sim.list_first(comm).map_err(|error| match error {
        StepError::Fault { .. } => RunError::Start(error.to_string()),
        error => explain(error, sim, comm),
    })?;
    check_overlaps(sim, comm).map_err(RunError::Start)?;
    sim.find_first_forces().map_err(RunError::Step)
}

/// First steps of a run and their time.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Steps.
    pub steps: u64,
    /// Particles over all ranks, summed over the steps.
    pub particle_steps: f64,
    /// Contacts over particles after the last step.
    pub coordination: f64,
    /// Wall clock of rank 0 [s].
    pub seconds: f64,
}

/// Most steps in which the pace is measured, and the time after which this ends [s].
const PACED: (u64, f64) = (500, 2.0);

/// Runs a few steps without output to measure their time. Collective.
///
/// # Errors
/// See [`RunError`].
pub fn pace(sim: &mut Simulation, most: u64, comm: &mut dyn Comm) -> Result<Pace, RunError> {
    let begin = Instant::now();
    let mut pace = Pace { steps: 0, particle_steps: 0.0, coordination: 0.0, seconds: 0.0 };
    let mut is_over = false;
    while pace.steps < most.min(PACED.0) && !is_over {
        let stepped = sim.step(comm);
        stepped.map_err(|error| explain(error, sim, comm))?;
        let seconds = begin.elapsed().as_secs_f64();
        let is_late = comm.is_root() && seconds > PACED.1;
        let mut sums = [sim.particles.owned as i64, i64::from(is_late)];
        comm.sum(&mut sums);
        pace.steps += 1;
        pace.particle_steps += sums[0] as f64;
        pace.seconds = seconds;
        is_over = sums[1] > 0;
    }
    pace.coordination = sim.measure(comm).coordination();
    Ok(pace)
}

/// Shortens the step at the start of a stage if pressed contacts have lowered the stable limit, and returns a warning.
/// Collective.
pub fn follow_limit(sim: &mut Simulation, over: Over, comm: &mut dyn Comm) -> Option<String> {
    Stiffening::of(sim, over)?.follow(sim, comm)
}

/// Scheduled outputs and measurements of a run.
struct Records<'a> {
    schedule: &'a Schedule,
    /// Last step, with the present time step.
    last_step: u64,
    /// History, on rank 0.
    history: Option<History>,
    /// Lists of all observers of particles that come and go, on rank 0.
    lists: Vec<List>,
    /// Overlaps for which a warning is still to come.
    depths: Peekable<IntoIter<f64, 2>>,
    /// Stable limit, for laws that stiffen with load.
    stiffening: Option<Stiffening>,
    /// Most energy that friction had taken at any time in this run [J]; `None` once a warning has reported that some was
    /// given back.
    taken_by_friction: Option<f64>,
    /// Energy errors for which a warning is still to come.
    missing: Peekable<IntoIter<f64, 3>>,
    /// Largest measured overlap over the shortest axis [-], and its step.
    largest_overlap: (f64, u64),
    /// Scalar measures, if they were taken after the last step.
    measures: Option<Measures>,
    /// Snapshot, if one was written after the last step.
    snapshot: Option<PathBuf>,
    /// Time of the last snapshot, or of the begin.
    saved: Instant,
}

impl<'a> Records<'a> {
    fn open(
        sim: &mut Simulation,
        schedule: &'a Schedule,
        comm: &dyn Comm,
    ) -> Result<Self, RunError> {
        let (history, lists) = if comm.is_root() {
            // The last row of a run that was stopped off its schedule is dropped: an uninterrupted run would not have it.
            let (stage_begin, first_step) = (sim.stage_begin.0, sim.step);
            let keep = |step: u64| {
                let scheduled = step == stage_begin || due(step, schedule.history_every);
                schedule.resumed && (step < first_step || (step == first_step && scheduled))
            };
            let own = own_columns(sim, &Measures::default()).into_iter().map(|(name, _)| name);
            let own = own.collect::<Vec<_>>();
            let walls = &sim.particles.walls;
            let history = History::open(&schedule.out, walls, sim.particles.cell, &own, keep)?;
            (Some(history), lists(sim, schedule)?)
        } else {
            (None, Vec::new())
        };
        let depths = DEPTHS.into_iter().peekable();
        Ok(Self {
            schedule,
            last_step: schedule.last_step,
            history,
            lists,
            depths,
            taken_by_friction: Some(f64::NEG_INFINITY),
            stiffening: Stiffening::of(sim, schedule.over),
            missing: MISSING.into_iter().peekable(),
            largest_overlap: (0.0, sim.step),
            measures: None,
            snapshot: None,
            saved: Instant::now(),
        })
    }

    /// Adds a row to the history.
    fn push(
        &mut self,
        sim: &Simulation,
        measures: &Measures,
        forces: &[Vec3],
    ) -> Result<(), TableError> {
        let Some(history) = &mut self.history else { return Ok(()) };
        let own: Vec<f64> =
            own_columns(sim, measures).into_iter().map(|(_, number)| number).collect();
        let (step, time, walls) = (sim.step, sim.time(), &*sim.particles.walls);
        history.push(&table::Row { step, time, measures, forces, walls, own: &own })
    }

    /// Adds the particles that came and went at this step to the lists.
    fn list(&mut self, sim: &mut Simulation) -> Result<(), TableError> {
        let moment = (sim.step, sim.time());
        let Simulation { drives, observers, particles, .. } = sim;
        let lists = all_observers(drives, observers).filter_map(|observer| observer.lists());
        for (file, passed) in self.lists.iter_mut().zip(lists.flat_map(Lists::take)) {
            if !passed.is_empty() {
                file.push(moment, passed.iter(), &particles.library)?;
            }
        }
        Ok(())
    }

    /// Waits until all rows are on the disk, before a snapshot that continues from them.
    fn sync(&self) -> Result<(), TableError> {
        self.history.as_ref().map_or(Ok(()), History::sync)?;
        self.lists.iter().try_for_each(List::sync)
    }

    /// Writes a snapshot, after the rows before it. Collective.
    fn save(
        &mut self,
        sim: &Simulation,
        ending: Ending,
        measures: &Measures,
        comm: &mut dyn Comm,
    ) -> Result<PathBuf, RunError> {
        let synced = self.sync();
        // The state is saved even if a table could not be written.
        let saved = save(sim, self.schedule, ending, measures, comm)?;
        self.saved = Instant::now();
        synced.map_err(RunError::from).map(|()| saved)
    }

    /// Writes a snapshot that only the wall clock asks for, unless this step has one. Collective.
    fn save_off_schedule(&mut self, sim: &Simulation, comm: &mut dyn Comm) -> Result<(), RunError> {
        if self.snapshot.is_none() {
            self.snapshot = Some(self.save(sim, Ending::LastStep, &sim.measure(comm), comm)?);
        }
        Ok(())
    }

    /// Records the state before the first step of a stage. Collective.
    fn first(
        &mut self,
        sim: &mut Simulation,
        warnings: &mut Vec<String>,
        comm: &mut dyn Comm,
    ) -> Result<(), RunError> {
        self.list(sim)?;
        warnings.extend(self.follow(sim, comm));
        let measures = sim.measure(comm);
        sim.most_moving = most_moving(sim, &measures);
        self.note(sim.step, &measures);
        self.push(sim, &measures, &measures.wall_forces)?;
        // Written even without scheduled snapshots, so that a failed run leaves its initial state.
        self.snapshot = Some(self.save(sim, Ending::LastStep, &measures, comm)?);
        self.measures = Some(measures);
        Ok(())
    }

    /// Adjusts the step to the stable limit. Collective.
    fn follow(&mut self, sim: &mut Simulation, comm: &mut dyn Comm) -> Option<String> {
        let followed = self.stiffening?.follow(sim, comm);
        if let (Some(_), Some(duration), true) =
            (&followed, self.schedule.duration, self.schedule.ends_stage)
        {
            let steps = steps_of(duration - sim.stage_shift, sim.dt);
            self.last_step = sim.stage_begin.0.saturating_add(steps);
        }
        followed
    }

    /// Records the largest measured overlap.
    fn note(&mut self, step: u64, measures: &Measures) {
        if measures.largest_overlap > self.largest_overlap.0 {
            self.largest_overlap = (measures.largest_overlap, step);
        }
    }

    /// Writes the lists, and measures, adds a row and writes a snapshot when they are due. Returns whether the packing has
    /// come to rest. Collective.
    fn after_step(
        &mut self,
        sim: &mut Simulation,
        warnings: &mut Vec<String>,
        comm: &mut dyn Comm,
    ) -> Result<Ending, RunError> {
        self.list(sim)?;
        if due(sim.step, FOLLOWED_EVERY) {
            warnings.extend(self.follow(sim, comm));
        }
        let schedule = self.schedule;
        let is_last = sim.step == self.last_step;
        let row_due = is_last || due(sim.step, schedule.history_every);
        let snapshot_due = due(sim.step, schedule.snapshot_every);
        let asks = schedule.stop != Stop::default();
        let rest_due = asks && due(sim.step, CHECK_EVERY);
        let ends_stage = asks && schedule.ends_stage && is_last;
        (self.measures, self.snapshot) = (None, None);
        if !(row_due || snapshot_due || rest_due) {
            return Ok(Ending::LastStep);
        }
        let measures = sim.measure(comm);
        warnings.extend(sim.warn_of_motions(comm));
        if due(sim.step, schedule.history_every) || snapshot_due || rest_due {
            sim.most_moving = most_moving(sim, &measures);
        }
        self.note(sim.step, &measures);
        if measures.largest_overlap > DEEPEST_ON_SURFACE {
            sim.agree_on_fault(comm).map_err(|error| explain(error, sim, comm))?;
        }
        let is_at_rest = (rest_due || ends_stage) && schedule.stop.unmet(sim, &measures).is_empty();
        let ending = if is_at_rest { Ending::Rest } else { Ending::LastStep };
        let stiff = self.warn(sim, &measures, warnings, comm).err();
        if row_due || is_at_rest {
            // An uninterrupted run would not have a row off the schedule.
            let scheduled = due(sim.step, schedule.history_every);
            let row = sim.show_row(&measures, scheduled, comm);
            self.push(sim, &measures, &row.wall_forces)?;
        }
        if snapshot_due {
            self.snapshot = Some(self.save(sim, ending, &measures, comm)?);
        }
        self.measures = Some(measures);
        // The row is written before the error is returned.
        stiff.map_or(Ok(ending), |fault| Err(StepError::Fault { step: sim.step, fault }.into()))
    }

    /// Adds warnings about overlaps, energy error, stiffness and motions. Collective.
    ///
    /// # Errors
    /// If contacts have become too stiff for the step.
    fn warn(
        &mut self,
        sim: &Simulation,
        measures: &Measures,
        warnings: &mut Vec<String>,
        comm: &mut dyn Comm,
    ) -> Result<(), Fault> {
        while self.depths.next_if(|&depth| measures.largest_overlap > depth).is_some() {
            warnings.push(too_deep(sim.step, measures.largest_overlap));
        }
        let most_moving = most_moving(sim, measures);
        let missing = measures.part_missing(most_moving).abs();
        let passed = std::iter::from_fn(|| self.missing.next_if(|&part| missing > part)).count();
        if passed > 0 {
            let what = measures.what_is_missing(most_moving);
            warnings.push(format!("step {}: {what}", sim.step));
        }
        warnings.extend(self.friction_that_gives(sim, measures, most_moving));
        if let Some(stiffening) = &mut self.stiffening {
            warnings.extend(stiffening.check(2.0 * measures.largest_overlap, sim, comm)?);
        }
        Ok(())
    }

    /// A warning, once, if friction has given energy back. With tangential dashpots this is allowed, because friction
    /// charges their springs.
    fn friction_that_gives(
        &mut self,
        sim: &Simulation,
        measures: &Measures,
        most_moving: f64,
    ) -> Option<String> {
        let highest = self.taken_by_friction?;
        let taken = measures.taken_by(Quantity::OfFriction);
        let given = highest - taken;
        self.taken_by_friction = Some(f64::max(highest, taken));
        let most = MAY_GIVE * f64::max(most_moving, measures.dissipated);
        if given <= most || sim.law.needs().tangential_dashpots {
            return None;
        }
        self.taken_by_friction = None;
        Some(format!(
            "step {}: friction has produced {given:.1e} J, although it can only dissipate. Use a shorter step",
            sim.step
        ))
    }

    /// Scalar measures and snapshot of the last step. Collective.
    fn last(
        &mut self,
        sim: &mut Simulation,
        ending: Ending,
        comm: &mut dyn Comm,
    ) -> Result<(Measures, PathBuf), RunError> {
        let measures = match self.measures.take() {
            Some(measures) => measures,
            None => sim.measure(comm),
        };
        self.note(sim.step, &measures);
        // A run that is stopped between two rows reports its counts since the last one.
        sim.show_row(&measures, false, comm);
        let snapshot = match self.snapshot.take() {
            Some(snapshot) => snapshot,
            None => self.save(sim, ending, &measures, comm)?,
        };
        Ok((measures, snapshot))
    }
}

impl Simulation {
    /// Passes a row of the history to all observers, and returns it with their changes. Collective.
    fn show_row(&mut self, measures: &Measures, scheduled: bool, comm: &mut dyn Comm) -> Row {
        let (wall_forces, fastest) = (measures.wall_forces.clone(), measures.largest_speed);
        let mut row = Row { wall_forces, fastest, dt: self.dt, scheduled };
        self.all_observers_mut().for_each(|observer| observer.row(&mut row, comm));
        row
    }

    /// Warnings about the motion of bodies in a step. Collective.
    fn warn_of_motions(&mut self, comm: &mut dyn Comm) -> Vec<String> {
        let largest = self.largest_motions(comm);
        self.watch.warnings(largest, self.dt)
    }

    /// Largest motions over all ranks, as fractions of the limits. Collective.
    pub(super) fn largest_motions(&self, comm: &mut dyn Comm) -> [f64; 2] {
        let mut largest = self.watch.largest();
        comm.max(&mut largest);
        largest
    }
}

/// Lists of all observers, with the rows of the run that this one continues.
fn lists(sim: &mut Simulation, schedule: &Schedule) -> Result<Vec<List>, TableError> {
    let last = sim.step;
    let keep = |step: u64| schedule.resumed && step <= last;
    let all = sim.all_observers_mut().filter_map(|observer| observer.lists());
    all.flat_map(|lists| lists.names()).map(|name| List::open(&schedule.out, name, keep)).collect()
}

/// Largest kinetic and elastic energy of the stage, including the present one [J].
fn most_moving(sim: &Simulation, now: &Measures) -> f64 {
    f64::max(sim.most_moving, now.moving())
}

const fn due(step: u64, every: u64) -> bool {
    every > 0 && step.is_multiple_of(every)
}

/// Energy errors above which a run warns at once; smaller ones are reported at its end.
const MISSING: [f64; 3] = [0.01, 0.1, 1.0];

/// Largest energy that friction may give back by rounding and by steps of finite length, over the larger of motion and
/// dissipation.
const MAY_GIVE: f64 = 1e-4;

/// Largest overlaps, over the shortest axis, above which a run warns.
const DEPTHS: [f64; 2] = [DEEPEST_START, 4.0 * DEEPEST_START];

fn too_deep(step: u64, overlap: f64) -> String {
    format!(
        "step {step}: an overlap is {:.1} % of the shortest axis of the smaller body; DEM commonly permits {} %. Use \
         stiffer contacts, or reduce speed or pressure",
        100.0 * overlap,
        100.0 * DEEPEST_START
    )
}

/// Adds to an error known on all ranks the particle's state, which only one of them has. Collective for such errors.
fn explain(error: StepError, sim: &Simulation, comm: &mut dyn Comm) -> RunError {
    match error {
        StepError::Domain { step, error } => lost(step, error, sim, comm),
        error @ (StepError::Contact { .. } | StepError::Fault { .. } | StepError::Drive { .. }) => {
            error.into()
        }
    }
}

/// Error for a particle at an invalid position, with its state and the bodies that it touched. Collective.
fn lost(step: u64, error: DomainError, sim: &Simulation, comm: &mut dyn Comm) -> RunError {
    let (DomainError::Outside { id, .. } | DomainError::NotFinite { id }) = error;
    let particles = &sim.particles;
    let slot = particles.id[..particles.owned].iter().position(|&other| other == id);
    let state = slot.map_or_else(String::new, |slot| {
        let vector = |v: Vec3| format!("({:e}, {:e}, {:e})", v.x, v.y, v.z);
        format!(
            "particle {id}: position {} m, velocity {} m/s, force of its contacts {} N",
            vector(particles.position[slot]),
            vector(particles.velocity[slot]),
            vector(particles.force[slot].vector),
        )
    });
    let states = comm.gather(wire::encode(&state)).unwrap_or_default();
    let mut bytes =
        wire::encode(&states.iter().map(|b| wire::decode::<String>(b)).collect::<String>());
    comm.broadcast(&mut bytes);
    let state: String = wire::decode(&bytes);
    let touched = sim.touched_by(id, comm);
    let names: Vec<String> = touched.iter().map(|&id| particles.body_name(id)).collect();
    let touched_walls = touched.iter().any(|id| id.wall_index().is_some());
    let touched = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let advice = match error {
        DomainError::NotFinite { .. } => "",
        DomainError::Outside { .. } if touched_walls => {
            "\nThe wall did not stop it: use stiffer contacts, a shorter time step, or lower loads and speeds"
        }
        DomainError::Outside { .. } => {
            "\nPut a wall on that side, or an [[outlet]] if particles may leave, enlarge the domain, or reduce the \
             time step"
        }
    };
    let particle = format!("{state}; its last contacts: {touched}{advice}");
    RunError::Particle { step, error, particle }
}

/// Regular check for signals on any rank and of the wall clock: a reduction every [`Check::SECONDS`], not every step.
struct Check {
    next: u64,
    last: u64,
    looked: Instant,
}

impl Check {
    /// Longest delay of a signal, beyond the present step [s].
    const SECONDS: f64 = 0.2;

    fn new(step: u64) -> Self {
        Self { next: step + 1, last: step, looked: Instant::now() }
    }

    /// Number of the signal, and whether a snapshot is due by the wall clock, after the last one at `saved`. Collective at
    /// steps on which all ranks agree.
    fn look(
        &mut self,
        step: u64,
        schedule: &Schedule,
        saved: Instant,
        comm: &mut dyn Comm,
    ) -> (Option<usize>, bool) {
        if step < self.next {
            return (None, false);
        }
        let steps = step - self.last;
        let seconds_per_step = self.looked.elapsed().as_secs_f64() / steps as f64;
        let signal = schedule.signal.load(Ordering::Relaxed) as f64;
        let minutes = saved.elapsed().as_secs_f64() / 60.0;
        let is_late = schedule.snapshot_every_minutes.is_some_and(|most| minutes >= most);
        let mut common = [signal, seconds_per_step, f64::from(is_late)];
        comm.max(&mut common);
        let [signal, slowest, late] = common;
        // At most twice as many steps as before, because they may become slower.
        let steps = ((Self::SECONDS / slowest) as u64).clamp(1, 2 * steps);
        *self = Self { next: step + steps, last: step, looked: Instant::now() };
        ((signal > 0.0).then_some(signal as usize), late > 0.0)
    }
}

/// Writes a snapshot of this moment, if its state is valid. Collective.
fn save(
    sim: &Simulation,
    schedule: &Schedule,
    ending: Ending,
    measures: &Measures,
    comm: &mut dyn Comm,
) -> Result<PathBuf, RunError> {
    let checked = sim.domain.check(&sim.particles, &BTreeSet::new()).and_then(|()| {
        let forces = sim.particles.id.iter().zip(&sim.particles.force);
        match forces
            .into_iter()
            .find(|(_, force)| !(force.vector.norm() + force.number).is_finite())
        {
            Some((&id, _)) => Err(DomainError::NotFinite { id }),
            None => Ok(()),
        }
    });
    agree(comm, checked).map_err(|error| lost(sim.step, error, sim, comm))?;
    let mut header = sim.header(&schedule.scene, &measures.wall_forces, comm);
    if ending == Ending::Rest {
        header.stop = schedule.stop.to_string();
    }
    Ok(snapshot::write_rows(
        &schedule.out,
        &header,
        &sim.particle_table(comm.rank()),
        &sim.contact_rows(),
        &sim.contact_record_rows(),
        comm,
    )?)
}
