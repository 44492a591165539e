//! Figures of the report at the end of a run.

use super::Simulation;
use super::floor::{Floor, Needed};
use super::history::counted;
use super::run::{Ending, Finish};
use super::sizes::sizes;
use super::start::DEEPEST_START;
use super::watch::Watch;
use crate::comm::Comm;
use crate::contact::Tally;
use crate::domain::Traffic;
use crate::drive::Observer;
use crate::law::stability::{highest_frequency, time_step_limit};
use crate::measure::Measures;
use crate::output::report::{
    Contacts, DissipatedBy, Ended, Energy, Least, Memory, Origin, Packing, Ranks, Report,
    Resolution, Run, Share, Spent, number,
};
use crate::particles::columns::Quantity;
use crate::particles::held;
use crate::timing::Phase;
use std::f64::consts::TAU;

/// Report of a finished run. Complete on rank 0: the others lack gathered data. Collective.
pub fn report(sim: &Simulation, finish: &Finish, origin: &Origin, comm: &mut dyn Comm) -> Report {
    let (tally, traffic) = totals(sim, comm);
    let last_warnings = last_warnings(sim, finish);
    let (walls, has_stopped) = (&sim.particles.walls, finish.ending == Ending::Rest);
    let mut warnings = Vec::new();
    for warning in origin.doubts.iter().chain(&finish.warnings).chain(&last_warnings) {
        if !warnings.contains(warning) {
            warnings.push(warning.clone());
        }
    }
    Report {
        origin: origin.clone(),
        run: outcome(sim, finish, comm.size()),
        phases: phases(sim, finish, &tally, comm),
        contacts: contacts(&tally, finish.wall_seconds),
        audit: sim.audit.figures(sim, comm),
        energy: energy(finish),
        packing: packing(&finish.measures),
        sizes: sizes(&sim.particles, &sim.drives, comm),
        counted: counted(sim).collect(),
        resolution: resolution(sim, finish, comm),
        targets: sim
            .all_observers()
            .flat_map(|drive| drive.outcome(walls, has_stopped).kept)
            .collect(),
        ranks: ranks(sim, finish, &traffic, comm),
        memory: memory(sim, comm),
        warnings,
    }
}

/// Warnings that are known only at the end of a run.
fn last_warnings(sim: &Simulation, finish: &Finish) -> Vec<String> {
    let unmet = &finish.unmet;
    let stop = (!unmet.is_empty()).then(|| format!("[stop] was not reached: {unmet}"));
    let has_stopped = finish.ending == Ending::Rest;
    // An error for which `[stop]` waited is as small as required.
    let awaited = |key| finish.stop.drives.iter().any(|(of, _)| of == key);
    let is_kept =
        |drive: &dyn Observer| drive.standing().error.is_some_and(|(key, _)| awaited(key));
    // Drives of an unfinished stage continue later, so they do not warn.
    let of_drives = sim
        .all_observers()
        .filter(|drive| finish.ends_stage && !(has_stopped && is_kept(*drive)))
        .flat_map(|drive| drive.outcome(&sim.particles.walls, has_stopped).warnings);
    let limit = time_step_limit(&sim.particles.library, &*sim.law).map(|limit| limit.dt);
    let balance = finish.measures.poor_balance(finish.most_moving, sim.dt, limit);
    let others = [overlap(finish), hollow(sim, finish), balance, finish.stiffened.clone()];
    stop.into_iter().chain(of_drives).chain(others.into_iter().flatten()).collect()
}

/// Warning about the deepest overlap, if it is deeper than commonly permitted.
fn overlap(finish: &Finish) -> Option<String> {
    let (largest, step) = finish.largest_overlap;
    (largest > DEEPEST_START).then(|| {
        format!(
            "the largest overlap was {:.1} % of the shortest axis of the smaller body, at step {step}; DEM commonly permits \
             {} %",
            100.0 * largest,
            100.0 * DEEPEST_START
        )
    })
}

/// Smallest number of contacts per particle in a packing under pressure: four for spheres with high friction, less
/// because of particles without load.
const BEARING: f64 = 3.0;

/// Warning about a packing in which a few chains of particles carry the stress while the others float.
fn hollow(sim: &Simulation, finish: &Finish) -> Option<String> {
    let is_pressed = sim.all_observers().any(|drive| drive.standing().error.is_some());
    let coordination = finish.measures.coordination();
    (is_pressed && finish.ending == Ending::Rest && coordination < BEARING).then(|| {
        format!(
            "[stop] was reached with {coordination:.2} contacts per particle: force chains of few particles carry the \
             stress. Before compression a lattice needs a `jitter`; a first stage without friction gives a denser \
             packing"
        )
    })
}

/// End and speed of the run.
fn outcome(sim: &Simulation, finish: &Finish, ranks: u32) -> Run {
    let Finish { wall_seconds: wall_s, steps_done: steps, particle_steps, .. } = *finish;
    Run {
        ended: match finish.ending {
            Ending::LastStep => Ended::AllStepsDone,
            Ending::Rest => Ended::ByStop,
            Ending::Signal(_) => Ended::BySignal,
        },
        unmet: finish.unmet.clone(),
        ranks,
        steps,
        last_step: sim.step,
        time_s: sim.time(),
        particles: finish.measures.particles,
        particle_steps,
        wall_s,
        steps_per_s: steps as f64 / wall_s,
        particle_steps_per_s: particle_steps as f64 / wall_s,
        ns_per_particle_step: 1e9 * wall_s * f64::from(ranks) / particle_steps.max(1) as f64,
        snapshot: finish.snapshot.clone(),
    }
}

/// Time by phase, over all ranks. Collective.
fn phases(
    sim: &Simulation,
    finish: &Finish,
    tally: &Tally,
    comm: &mut dyn Comm,
) -> Vec<(Phase, Spent)> {
    let seconds = Phase::ALL.map(|phase| sim.clock.seconds(phase));
    let mut slowest = seconds;
    let mut fastest = seconds.map(|s| -s);
    let mut total = seconds.map(|s| (s * PARTS) as i64);
    comm.max(&mut slowest);
    comm.max(&mut fastest);
    comm.sum(&mut total);
    let total = total.map(|parts| parts as f64 / PARTS);
    let all: f64 = total.iter().sum();
    let steps_of_ranks = f64::from(comm.size()) * finish.steps_done.max(1) as f64;
    let [particles, listed, contacts] =
        [finish.particle_steps, tally.listed, tally.contacts].map(|count| count.max(1) as f64);
    let spent = |(k, phase): (usize, Phase)| {
        let ns = 1e9 * total[k];
        let least = sim.floor(phase).filter(|_| Floor::PHASES.contains(&phase)).map(|floor| {
            let Needed { operations, bytes } = floor.total(particles, listed, contacts);
            Least {
                operations_per_particle_step: operations / particles,
                bytes_per_particle_step: bytes / particles,
                operations_per_ns: operations / ns,
                bytes_per_ns: bytes / ns,
            }
        });
        let spent = Spent {
            total_s: total[k],
            slowest_rank_s: slowest[k],
            fastest_rank_s: -fastest[k],
            share: total[k] / all,
            us_per_step: 1e6 * total[k] / steps_of_ranks,
            ns_per_particle_step: ns / particles,
            ns_per_listed_pair: ns / listed,
            ns_per_contact: ns / contacts,
            least,
        };
        (phase, spent)
    };
    Phase::ALL.into_iter().enumerate().map(spent).collect()
}

/// Numbers of contacts and pairs resolved in `wall` seconds of the clock, by resolver.
fn contacts(tally: &Tally, wall: f64) -> Contacts {
    let passed_on: u64 = tally.fallbacks.iter().sum();
    Contacts {
        listed_pairs: tally.listed,
        resolved_pairs: tally.pairs,
        contacts: tally.contacts,
        contacts_per_s: tally.contacts as f64 / wall,
        fallbacks: tally.fallbacks,
        fallback_share: passed_on as f64 / tally.pairs.max(1) as f64,
    }
}

fn energy(finish: &Finish) -> Energy {
    let m = &finish.measures;
    let over = |whole: f64| (whole > 0.0).then(|| m.missing() / whole).and_then(number);
    Energy {
        received_j: m.received,
        kinetic_j: m.kinetic(),
        gravity_j: m.gravity,
        stored_j: m.stored,
        step_j: m.step_energy,
        dissipated_j: m.dissipated,
        dissipated_by: DissipatedBy {
            normal_dashpots_j: m.of_normal_dashpots(),
            tangential_dashpots_j: m.taken_by(Quantity::OfTangentialDashpots),
            friction_j: m.taken_by(Quantity::OfFriction),
            turning_j: m.taken_by(Quantity::OfTurning),
            damping_j: m.taken_by(Quantity::OfDamping),
            adhesion_j: m.taken_by(Quantity::OfAdhesion),
        },
        missing_j: m.missing(),
        largest_moved_j: finish.most_moving,
        missing_over_dissipated: over(m.dissipated),
        missing_over_moved: over(finish.most_moving),
    }
}

fn packing(m: &Measures) -> Packing {
    Packing {
        contacts: m.contacts,
        wall_contacts: m.wall_contacts,
        coordination: m.coordination(),
        mean_normal_force_n: m.mean_normal_force,
        unbalanced: m.unbalanced,
    }
}

/// Resolution in time of oscillations, overlaps and motions. Collective.
fn resolution(sim: &Simulation, finish: &Finish, comm: &mut dyn Comm) -> Resolution {
    let [moved, turned] = Watch::in_units(sim.largest_motions(comm));
    let library = &sim.particles.library;
    Resolution {
        dt_s: sim.dt,
        dt_limit_s: time_step_limit(library, &*sim.law).and_then(|limit| number(limit.dt)),
        steps_per_oscillation: highest_frequency(library, &*sim.law)
            .map(|frequency| TAU / (frequency * sim.dt)),
        // The measured overlap is over the shortest axis, a diameter.
        largest_overlap_over_radius: 2.0 * finish.largest_overlap.0,
        largest_move_over_radius: moved,
        largest_turn_rad: turned,
    }
}

/// Counts over all ranks. Collective.
fn totals(sim: &Simulation, comm: &mut dyn Comm) -> (Tally, Traffic) {
    let mut tally = sim.found.tally;
    let mut traffic = sim.domain.traffic;
    let mut counts = [
        tally.listed,
        tally.pairs,
        tally.contacts,
        tally.fallbacks[0],
        tally.fallbacks[1],
        tally.fallbacks[2],
        tally.fallbacks[3],
        traffic.bytes,
        traffic.ghosts,
        traffic.offered,
        traffic.migrated,
    ]
    .map(|count| count as i64);
    comm.sum(&mut counts);
    let counts = counts.map(|count| count as u64);
    tally.listed = counts[0];
    tally.pairs = counts[1];
    tally.contacts = counts[2];
    tally.fallbacks.copy_from_slice(&counts[3..7]);
    traffic.bytes = counts[7];
    traffic.ghosts = counts[8];
    traffic.offered = counts[9];
    traffic.migrated = counts[10];
    (tally, traffic)
}

/// Parts of a unit in which numbers are summed over ranks: fine enough, and sums of megabytes or days over a million
/// ranks still fit.
const PARTS: f64 = 1e6;

const MEGABYTE: f64 = 1e6;

/// Mean and largest value over all ranks of each figure. Collective.
fn shares<const N: usize>(here: [f64; N], comm: &mut dyn Comm) -> [Share; N] {
    let mut most = here;
    let mut total = here.map(|value| (value * PARTS) as i64);
    comm.max(&mut most);
    comm.sum(&mut total);
    let ranks = f64::from(comm.size());
    std::array::from_fn(|k| Share { mean: total[k] as f64 / PARTS / ranks, most: most[k] })
}

/// Communication per step, and distribution of the work; `all` is the traffic of all ranks. Collective.
fn ranks(sim: &Simulation, finish: &Finish, all: &Traffic, comm: &mut dyn Comm) -> Ranks {
    let here = &sim.domain.traffic;
    let per_step = |count: u64| count as f64 / finish.steps_done.max(1) as f64;
    let per_owned = |count: u64| count as f64 / here.owned.max(1) as f64;
    let without_core = finish.seconds_without_core;
    let is_known = !comm.any(without_core.is_none());
    let figures = [
        per_step(here.messages),
        per_step(here.bytes),
        per_owned(here.ghosts),
        per_owned(here.offered),
        without_core.unwrap_or_default(),
    ];
    let [
        messages_per_step,
        bytes_per_step,
        ghosts_per_owned,
        within_halo_per_owned,
        without_core_s,
    ] = shares(figures, comm);
    Ranks {
        imbalance: sim.work_imbalance(comm),
        messages_per_step,
        bytes_per_step,
        bytes_per_ghost: all.bytes as f64 / all.ghosts.max(1) as f64,
        ghosts_per_owned,
        within_halo_per_owned,
        rebuilds: here.rebuilds,
        recuts: here.recuts,
        migrated: all.migrated,
        without_core_s: is_known.then_some(without_core_s),
    }
}

/// Memory at the end of the run. Collective.
fn memory(sim: &Simulation, comm: &mut dyn Comm) -> Memory {
    let owned = sim.particles.owned.max(1) as f64;
    let columns = sim.particles.bytes() as f64 / owned;
    let pairs = sim.pairs.bytes() as f64 / owned;
    let found = sim.found.contacts.bytes() + held(&sim.found.apart) + held(&sim.active);
    let contacts = (found + sim.contacts.bytes() + sim.sums.bytes()) as f64 / owned;
    let listed = sim.pairs.pairs.len() as f64 / owned;
    let touching = sim.contacts.len() as f64 / owned;
    let parts = [columns + pairs + contacts, columns, pairs, contacts, listed, touching];
    let [bytes_per_owned, parts @ ..] = shares(parts, comm);
    let [columns, pairs, contacts, listed, touching] = parts.map(|share| share.mean);
    let peak = peak_bytes();
    let is_known = !comm.any(peak.is_none());
    let bytes = peak.unwrap_or_default();
    let [peak, peak_per_owned] = shares([bytes / MEGABYTE, bytes / owned], comm);
    let peak = Share { mean: MEGABYTE * peak.mean, most: MEGABYTE * peak.most };
    Memory {
        bytes_per_owned,
        column_bytes_per_owned: columns,
        pair_bytes_per_owned: pairs,
        contact_bytes_per_owned: contacts,
        pairs_per_owned: listed,
        contacts_per_owned: touching,
        peak_bytes: is_known.then_some(peak),
        peak_bytes_per_owned: is_known.then_some(peak_per_owned),
    }
}

/// Peak memory of this process [bytes], if the system reports it.
fn peak_bytes() -> Option<f64> {
    bytes_in("/proc/self/status", "VmHWM:")
}

/// Total memory of this machine [bytes]; infinite if the system does not report it.
pub fn machine_bytes() -> f64 {
    bytes_in("/proc/meminfo", "MemTotal:").unwrap_or(f64::INFINITY)
}

/// Value of a key that the system gives in kibibytes [bytes].
fn bytes_in(file: &str, key: &str) -> Option<f64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024.0 * kibibytes)
}
