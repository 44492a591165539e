//! The report at the end of a run.

use super::Simulation;
use super::floor::{Floor, Needed};
use super::run::{Ending, Finish};
use crate::comm::Comm;
use crate::contact::Tally;
use crate::domain::Traffic;
use crate::measure::Measures;
use crate::output::performance::Performance;
use crate::particles::held;
use crate::timing::Phase;
use std::fmt::{Display, Formatter, Write};

/// The row of a finished run in `performance.csv`. Collective.
pub fn performance(sim: &Simulation, finish: &Finish, comm: &mut dyn Comm) -> Performance {
    let (tally, _) = totals(sim, comm);
    let spent = spent(sim, comm);
    Performance {
        ranks: comm.size(),
        steps: finish.steps_done,
        particle_steps: finish.particle_steps,
        wall_s: finish.wall_seconds,
        contact_resolution_s: resolving(&spent),
        listed_pairs: tally.listed,
        resolved_pairs: tally.pairs,
        contacts: tally.contacts,
    }
}

/// Contact resolution, the sum over the ranks [s].
fn resolving(phases: &[(Phase, Spent)]) -> f64 {
    phases.iter().find(|(phase, _)| *phase == Phase::Contacts).map_or(0.0, |(_, s)| s.total)
}

/// Where the time of one phase went, over all ranks [s].
#[derive(Clone, Copy, Debug)]
struct Spent {
    slowest: f64,
    fastest: f64,
    total: f64,
}

/// Lines of the report.
#[derive(Default)]
struct Page(String);

impl Page {
    fn line(&mut self, line: impl Display) {
        let _ = writeln!(self.0, "{line}");
    }
}

/// The report of a finished run, as text; empty on all ranks but 0. Collective.
pub fn report(sim: &Simulation, finish: &Finish, comm: &mut dyn Comm) -> String {
    let phases = spent(sim, comm);
    let (tally, traffic) = totals(sim, comm);
    let halo = Halo::of(sim, finish.steps_done, comm);
    let imbalance = sim.work_imbalance(comm);
    let memory = Memory::of(sim, comm);
    if !comm.is_root() {
        return String::new();
    }
    let mut page = Page::default();
    outcome(&mut page, sim, finish, comm.size());
    page.line("");
    let steps_of_ranks = f64::from(comm.size()) * finish.steps_done.max(1) as f64;
    times(&mut page, &phases, steps_of_ranks);
    page.line("");
    costs(&mut page, &phases, finish.particle_steps, &tally, |phase| sim.floor(phase));
    page.line("");
    contacts(&mut page, &tally, resolving(&phases), finish.wall_seconds);
    halo.write(&mut page, &traffic, &sim.domain.traffic);
    page.line(format_args!("balance    the busiest rank has {imbalance:.3} times the mean work"));
    memory.write(&mut page);
    for text in sim.drives.iter().flat_map(|drive| drive.report(&sim.particles.walls)) {
        page.line(text);
    }
    state(&mut page, &finish.measures);
    if let Some(warning) = finish.measures.poor_balance(finish.most_moving, sim.dt) {
        page.line(format_args!("warning    {warning}"));
    }
    page.0
}

/// How the run ended, and how fast it was.
fn outcome(page: &mut Page, sim: &Simulation, finish: &Finish, ranks: u32) {
    let wall = finish.wall_seconds;
    let how = match finish.ending {
        Ending::Rest => "at rest",
        Ending::LastStep => "all steps done",
        Ending::Signal(_) => "stopped by a signal",
    };
    page.line(format_args!(
        "{how}: step {}, time {:.6} s; {} steps of {} particles in {wall:.1} s on {ranks} rank{}",
        sim.step,
        sim.time(),
        finish.steps_done,
        finish.measures.particles,
        if ranks == 1 { "" } else { "s" },
    ));
    if !finish.unmet.is_empty() {
        page.line(format_args!("[stop] was not reached: {}", finish.unmet));
    }
    page.line(format_args!(
        "{:.3e} particle-steps per second ({:.3} µs per particle-step and rank)",
        finish.particle_steps as f64 / wall,
        1e6 * wall * f64::from(ranks) / finish.particle_steps.max(1) as f64,
    ));
}

/// Time by phase; `steps` are those of all ranks.
fn times(page: &mut Page, phases: &[(Phase, Spent)], steps: f64) {
    page.line(format_args!(
        "{:<10} {:>7} {:>10} {:>14} {:>14}",
        "phase", "share", "µs/step", "slowest rank", "fastest rank"
    ));
    let all: f64 = phases.iter().map(|(_, s)| s.total).sum();
    for (phase, spent) in phases {
        page.line(format_args!(
            "{:<10} {:>6.1}% {:>10.2} {:>12.2} s {:>12.2} s",
            phase.name(),
            100.0 * spent.total / all,
            1e6 * spent.total / steps,
            spent.slowest,
            spent.fastest,
        ));
    }
}

/// Time of a rank in each phase that has a floor, beside what its formulas need at least: see [`super::floor`]. Particles
/// are summed over steps, as the tally is.
fn costs(
    page: &mut Page,
    phases: &[(Phase, Spent)],
    particles: u64,
    tally: &Tally,
    floor: impl Fn(Phase) -> Option<Floor>,
) {
    let [particles, listed, contacts] =
        [particles, tally.listed, tally.contacts].map(|count| count.max(1) as f64);
    page.line(format_args!(
        "{:<10} {:>11} {:>12} {:>11} {:>14} {:>9} {:>17} {:>12}",
        "ns",
        "a particle",
        "listed pair",
        "contact",
        "at least: ops",
        "bytes",
        "reached: ops/ns",
        "bytes/ns"
    ));
    for (phase, spent) in phases.iter().filter(|(phase, _)| Floor::PHASES.contains(phase)) {
        let ns = 1e9 * spent.total;
        let measured = format!(
            "{:<10} {:>11.2} {:>12.2} {:>11.2}",
            phase.name(),
            ns / particles,
            ns / listed,
            ns / contacts,
        );
        let Some(floor) = floor(*phase) else {
            page.line(format_args!("{measured}   no floor is known for these shapes"));
            continue;
        };
        let Needed { operations, bytes } = floor.total(particles, listed, contacts);
        page.line(format_args!(
            "{measured} {:>14.1} {:>9.1} {:>17.3} {:>12.3}",
            operations / particles,
            bytes / particles,
            operations / ns,
            bytes / ns,
        ));
    }
    page.line(
        "at least: what the formulas need per particle and step; reached: that over the time",
    );
}

/// How many contacts were resolved, in `resolving` seconds of all ranks and `wall` seconds of the clock, and by what.
fn contacts(page: &mut Page, tally: &Tally, resolving: f64, wall: f64) {
    page.line(format_args!(
        "contacts   {:.3e} resolved, {:.3e} per second; {:.1} ns per contact, {:.1} ns per listed pair; {:.1} % of listed pairs were looked at",
        tally.contacts as f64,
        tally.contacts as f64 / wall,
        1e9 * resolving / tally.contacts.max(1) as f64,
        1e9 * resolving / tally.listed.max(1) as f64,
        100.0 * tally.pairs as f64 / tally.listed.max(1) as f64,
    ));
    let passed_on: u64 = tally.fallbacks.iter().sum();
    if passed_on == 0 {
        page.line("fallbacks  none: the first method answered every pair");
    } else {
        page.line(format_args!(
            "fallbacks  {passed_on} pairs ({:.2} per million) went past the first method; by stage of the chain: {:?}",
            1e6 * passed_on as f64 / tally.pairs.max(1) as f64,
            tally.fallbacks,
        ));
    }
}

/// The packing at the end, and the balance of energies.
fn state(page: &mut Page, m: &Measures) {
    page.line(format_args!(
        "packing    {:.3} contacts per particle with walls, mean normal force {:.3e} N, largest overlap {:.2e} of the shortest axis",
        m.coordination(),
        m.mean_normal_force,
        m.largest_overlap,
    ));
    page.line(format_args!(
        "energy     received {:.6e} J = kinetic {:.3e} + gravity {:.6e} + stored {:.3e} + of the steps {:.1e} + dissipated {:.6e} + missing {:.1e} ({:.4} % of the dissipated)",
        m.received,
        m.kinetic(),
        m.gravity,
        m.stored,
        m.step_energy,
        m.dissipated,
        m.missing(),
        if m.dissipated > 0.0 { 100.0 * m.missing() / m.dissipated } else { 0.0 },
    ));
}

fn spent(sim: &Simulation, comm: &mut dyn Comm) -> Vec<(Phase, Spent)> {
    let seconds = Phase::ALL.map(|phase| sim.clock.seconds(phase));
    let mut slowest = seconds;
    let mut fastest = seconds.map(|s| -s);
    let mut total = seconds.map(|s| (s * PARTS) as i64);
    comm.max(&mut slowest);
    comm.max(&mut fastest);
    comm.sum(&mut total);
    Phase::ALL
        .into_iter()
        .enumerate()
        .map(|(k, phase)| {
            let total = total[k] as f64 / PARTS;
            (phase, Spent { slowest: slowest[k], fastest: -fastest[k], total })
        })
        .collect()
}

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

/// Numbers are summed over ranks in so many parts of their units: fine enough, and a sum of megabytes of a million
/// ranks, or of their days, still fits.
const PARTS: f64 = 1e6;

/// A number of each rank: the mean, and the most.
#[derive(Clone, Copy, Debug)]
struct Share {
    mean: f64,
    most: f64,
}

impl Share {
    /// Collective.
    fn of<const N: usize>(here: [f64; N], comm: &mut dyn Comm) -> [Self; N] {
        let mut most = here;
        let mut total = here.map(|value| (value * PARTS) as i64);
        comm.max(&mut most);
        comm.sum(&mut total);
        let ranks = f64::from(comm.size());
        std::array::from_fn(|k| Self { mean: total[k] as f64 / PARTS / ranks, most: most[k] })
    }
}

impl Display for Share {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        let digits = if self.most < 100.0 { 2 } else { 0 };
        write!(f, "{:.digits$} (most {:.digits$})", self.mean, self.most)
    }
}

/// What the halo costs in a step.
struct Halo {
    messages: Share,
    bytes: Share,
    /// Per owned particle.
    ghosts: Share,
    /// Particles of others within the halo width, per owned particle.
    minimum: Share,
}

impl Halo {
    fn of(sim: &Simulation, steps: u64, comm: &mut dyn Comm) -> Self {
        let traffic = &sim.domain.traffic;
        let per_step = |count: u64| count as f64 / steps.max(1) as f64;
        let per_owned = |count: u64| count as f64 / traffic.owned.max(1) as f64;
        let [messages, bytes, ghosts, minimum] = Share::of(
            [
                per_step(traffic.messages),
                per_step(traffic.bytes),
                per_owned(traffic.ghosts),
                per_owned(traffic.offered),
            ],
            comm,
        );
        Self { messages, bytes, ghosts, minimum }
    }

    /// `traffic` is that of all ranks, `here` that of this one.
    fn write(&self, page: &mut Page, traffic: &Traffic, here: &Traffic) {
        page.line(format_args!(
            "halo       per step and rank {} messages, one per neighbour, and {} bytes, {:.0} per ghost; list rebuilt {} times, domain cut {} times, {} particles migrated",
            self.messages,
            self.bytes,
            traffic.bytes as f64 / traffic.ghosts.max(1) as f64,
            here.rebuilds,
            here.recuts,
            traffic.migrated,
        ));
        page.line(format_args!(
            "ghosts     {} per owned particle, of {} within the halo width (largest bounding diameter and skin) around its subdomain: {:.2} of this geometric minimum",
            self.ghosts,
            self.minimum,
            traffic.ghosts as f64 / traffic.offered.max(1) as f64,
        ));
    }
}

/// Bytes held for each owned particle, as the end of the run finds them; ghosts count with those that they
/// touch.
struct Memory {
    all: Share,
    columns: f64,
    pairs: f64,
    contacts: f64,
    /// Pairs per owned particle.
    listed: f64,
    /// Contacts per owned particle: a contact of two of them counts once.
    touching: f64,
    /// The most that a process has held so far, with all that is in it [MB], and by owned particle [bytes]; `None` where
    /// any system does not say. Ranks in threads of one process have it together.
    peak: Option<[Share; 2]>,
}

impl Memory {
    fn of(sim: &Simulation, comm: &mut dyn Comm) -> Self {
        let owned = sim.particles.owned.max(1) as f64;
        let columns = sim.particles.bytes() as f64 / owned;
        let pairs = sim.pairs.bytes() as f64 / owned;
        let found = sim.found.contacts.bytes() + held(&sim.found.apart) + held(&sim.active);
        let contacts = (found + sim.contacts.bytes() + sim.sums.bytes()) as f64 / owned;
        let listed = sim.pairs.pairs.len() as f64 / owned;
        let touching = sim.contacts.len() as f64 / owned;
        let parts = [columns + pairs + contacts, columns, pairs, contacts, listed, touching];
        let [all, parts @ ..] = Share::of(parts, comm);
        let [columns, pairs, contacts, listed, touching] = parts.map(|share| share.mean);
        let peak = peak_bytes();
        let is_known = !comm.any(peak.is_none());
        let bytes = peak.unwrap_or_default();
        let shares = Share::of([bytes / 1e6, bytes / owned], comm);
        let peak = is_known.then_some(shares);
        Self { all, columns, pairs, contacts, listed, touching, peak }
    }

    fn write(&self, page: &mut Page) {
        page.line(format_args!(
            "memory     {} bytes per owned particle: {:.0} in columns, {:.0} in {:.2} listed pairs, {:.0} in {:.2} contacts",
            self.all, self.columns, self.pairs, self.listed, self.contacts, self.touching,
        ));
        if let Some([megabytes, per_owned]) = self.peak {
            page.line(format_args!(
                "peak       {megabytes} MB in a process, {per_owned} bytes per owned particle: with the program, its libraries, and what was held for a moment",
            ));
        }
    }
}

/// The most memory that this process has held so far [bytes], if the system says.
fn peak_bytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024.0 * kibibytes)
}
