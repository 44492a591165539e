//! A run: steps, with outputs on schedule, until all is done.

use super::{Simulation, StepError};
use crate::comm::Comm;
use crate::drive::rain::RainGauge;
use crate::measure::{Measures, shortest_axis};
use crate::output::table::{History, TableError};
use crate::output::{SnapshotError, snapshot};
use crate::timing::Phase;
use std::path::PathBuf;
use std::time::Instant;

/// What to do when.
#[derive(Clone, Debug)]
pub struct Schedule {
    /// The last step.
    pub last_step: u64,
    /// Steps between snapshots; 0: only at the end.
    pub snapshot_every: u64,
    /// Steps between rows of the history; 0: only at the end.
    pub history_every: u64,
    /// End when the kinetic energy is below this fraction of the energy dissipated.
    pub rest: Option<f64>,
    /// Where output goes.
    pub out: PathBuf,
    /// The scene's text, for the snapshots.
    pub scene: String,
    /// Does the run go on from a snapshot of the same stage?
    pub resumed: bool,
}

/// Why a run ended well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The last step was done.
    LastStep,
    /// Everything has come to rest.
    Rest,
}

/// How a run ended.
#[derive(Clone, Debug)]
pub struct Finish {
    /// Why.
    pub ending: Ending,
    /// Steps of this run.
    pub steps_done: u64,
    /// Particles of all ranks, summed over the steps.
    pub particle_steps: u64,
    /// Wall clock [s].
    pub wall_seconds: f64,
    /// The last scalars.
    pub measures: Measures,
    /// The last snapshot.
    pub snapshot: PathBuf,
}

/// Where a run stands, for a progress bar.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Steps of this run done.
    pub done: u64,
    /// Steps of this run, at most.
    pub of: u64,
    /// The scalars, at steps of the history.
    pub measures: Option<&'a Measures>,
}

/// A run could not go on.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// In a step. Unless [`StepError::is_agreed`], known on one rank only: abort the others.
    #[error(transparent)]
    Step(#[from] StepError),
    /// A snapshot could not be written. Known on all ranks.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    /// The history could not be written. Known on rank 0 only: abort the others.
    #[error(transparent)]
    History(#[from] TableError),
    /// Particles are too deep in each other at the start. Known on all ranks.
    #[error("{0}")]
    Overlap(String),
}

/// The deepest overlap that a run may begin with, over the shortest axis of the smaller body: the
/// largest that DEM commonly permits (the paper, section 2.1).
pub const DEEPEST_START: f64 = 0.05;

/// Runs until the schedule says that all is done. Collective.
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
        sim.begin(comm)?;
        // Particles of an earlier stage are where the forces put them.
        if sim.step == 0 {
            check_overlaps(sim, comm)?;
        }
    }
    let started = Instant::now();
    let first_step = sim.step;
    let names: Vec<String> = sim.particles.walls.iter().map(|w| w.name.clone()).collect();
    let mut history = if comm.is_root() {
        // The last row of a run that was stopped off its schedule would not be there had it gone on.
        let stage_begin = sim.stage_begin.0;
        let keep = |step: u64| {
            let scheduled = step == stage_begin || due(step, schedule.history_every);
            schedule.resumed && step <= first_step && scheduled
        };
        Some(History::open(&schedule.out, &names, keep)?)
    } else {
        None
    };
    let mut particle_steps = 0;
    let mut ending = Ending::LastStep;
    let mut last: Option<Measures> = None;
    if !schedule.resumed {
        let measures = sim.measure(comm);
        if let Some(history) = &mut history {
            history.push(sim.step, sim.time(), &measures)?;
        }
        if schedule.snapshot_every > 0 {
            save(sim, schedule, &measures, comm)?;
        }
        last = Some(measures);
    }

    while sim.step < schedule.last_step {
        sim.step(comm)?;
        particle_steps += sim.particles.owned as u64;

        let is_last = sim.step == schedule.last_step;
        let row_due = is_last || due(sim.step, schedule.history_every);
        let snapshot_due = due(sim.step, schedule.snapshot_every);
        let rest_due = schedule.rest.is_some() && due(sim.step, REST_CHECK);
        last = None;
        if row_due || snapshot_due || rest_due {
            let measures = sim.measure(comm);
            let at_rest = rest_due && is_at_rest(sim, schedule, &measures);
            if let Some(history) = history.as_mut().filter(|_| row_due || at_rest) {
                history.push(sim.step, sim.time(), &measures)?;
            }
            if snapshot_due {
                save(sim, schedule, &measures, comm)?;
            }
            last = Some(measures);
            if at_rest {
                ending = Ending::Rest;
            }
        }
        progress(&Progress {
            done: sim.step - first_step,
            of: schedule.last_step - first_step,
            measures: last.as_ref(),
        });
        sim.clock.lap(Phase::Output);
        if ending == Ending::Rest {
            break;
        }
    }

    let measures = match last {
        Some(measures) => measures,
        None => sim.measure(comm),
    };
    let snapshot = save(sim, schedule, &measures, comm)?;
    sim.clock.lap(Phase::Output);
    let mut total = [particle_steps as i64];
    comm.sum(&mut total);
    Ok(Finish {
        ending,
        steps_done: sim.step - first_step,
        particle_steps: total[0] as u64,
        wall_seconds: started.elapsed().as_secs_f64(),
        measures,
        snapshot,
    })
}

/// Steps between looks at whether everything is at rest.
const REST_CHECK: u64 = 100;

const fn due(step: u64, every: u64) -> bool {
    every > 0 && step.is_multiple_of(every)
}

fn is_at_rest(sim: &Simulation, schedule: &Schedule, measures: &Measures) -> bool {
    let all_there = sim.rain.as_ref().is_none_or(RainGauge::is_over);
    let limit = schedule.rest.unwrap_or(0.0) * measures.dissipated;
    all_there && measures.contacts + measures.wall_contacts > 0 && measures.kinetic() < limit
}

/// Writes a snapshot of this moment. Collective.
fn save(
    sim: &Simulation,
    schedule: &Schedule,
    measures: &Measures,
    comm: &mut dyn Comm,
) -> Result<PathBuf, SnapshotError> {
    snapshot::write(
        &schedule.out,
        &sim.header(&schedule.scene, &measures.wall_forces),
        &sim.particle_table(comm.rank()),
        &sim.contact_table(),
        &sim.histories(),
        comm,
    )
}

/// Refuses particles that start too deep in each other, and names the worst of them.
fn check_overlaps(sim: &Simulation, comm: &mut dyn Comm) -> Result<(), RunError> {
    let mut found: Vec<(f64, u64, i64, [f64; 3])> = Vec::new();
    for contact in &sim.found.contacts {
        let pair = sim.pairs.pairs[contact.pair as usize];
        let depth = contact.touch.overlap / shortest_axis(&sim.particles, pair.a, pair.b);
        if depth > DEEPEST_START && pair.a.index() < sim.particles.owned {
            let (a, b) = (sim.particles.id[pair.a.index()], sim.particles.id[pair.b.index()]);
            let at = sim.particles.position[pair.a.index()] + contact.touch.point;
            found.push((depth, a.0, b.to_file(), at.into()));
        }
    }
    if !comm.any(!found.is_empty()) {
        return Ok(());
    }
    let gathered = comm.gather(crate::comm::wire::encode(&found));
    let mut bytes = Vec::new();
    if let Some(all) = gathered {
        let mut found: Vec<(f64, u64, i64, [f64; 3])> =
            all.iter().flat_map(|bytes| crate::comm::wire::decode::<Vec<_>>(bytes)).collect();
        found.sort_by(|x, y| y.0.total_cmp(&x.0));
        bytes = overlap_message(&found, &sim.particles.walls).into_bytes();
    }
    comm.broadcast(&mut bytes);
    Err(RunError::Overlap(String::from_utf8_lossy(&bytes).into_owned()))
}

fn overlap_message(
    found: &[(f64, u64, i64, [f64; 3])],
    walls: &[crate::particles::walls::Wall],
) -> String {
    use std::fmt::Write;
    let mut text = format!(
        "{} pair{} overlap by more than {} % of the shortest axis at the start:",
        found.len(),
        if found.len() == 1 { "" } else { "s" },
        100.0 * DEEPEST_START
    );
    for (depth, a, b, at) in found.iter().take(5) {
        let partner = match crate::ids::GlobalId::from_file(*b).wall_index() {
            Some(k) => format!("wall \"{}\"", walls[k].name),
            None => format!("particle {b}"),
        };
        let _ = write!(
            text,
            "\n  particle {a} and {partner}: {:.1} % at ({:.4e}, {:.4e}, {:.4e}) m",
            100.0 * depth,
            at[0],
            at[1],
            at[2]
        );
    }
    if found.len() > 5 {
        text.push_str("\n  ...");
    }
    text.push_str("\nMove them apart, or use a larger spacing");
    text
}
