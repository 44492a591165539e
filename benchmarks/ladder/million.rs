//! Time per contact of a million touching spheres beside that of 20,000: the cost of data that do not stay in the cache.

use super::{RUNGS, median};
use dem_mpi::comm::alone::Alone;
use dem_mpi::timing::{Clock, Phase};
use std::fmt::Write;
use std::path::Path;

/// Spheres along each axis: 19,683 and a million.
const ALONG: [u32; 2] = [27, 100];
/// Index of the rung of spheres with friction and dashpots.
const RUNG: usize = 2;
/// Approximate number of contacts of a round, so that few spheres take as long as many.
const CONTACTS: usize = 9_000_000;
const ROUNDS: usize = 5;
const PHASES: [Phase; 3] = [Phase::Move, Phase::Contacts, Phase::Forces];

/// Times both sizes in turns, prints and writes the results.
pub(super) fn time(record: Option<&Path>) -> anyhow::Result<()> {
    let mut sims = Vec::new();
    for along in ALONG {
        let mut sim = RUNGS[RUNG].begun(along)?;
        sim.step(&mut Alone::default())?;
        sims.push((sim, Vec::new()));
    }
    for _ in 0..ROUNDS {
        for (sim, times) in &mut sims {
            let steps = (CONTACTS / sim.contacts.len()).max(1);
            sim.clock = Clock::new();
            for _ in 0..steps {
                sim.step(&mut Alone::default())?;
            }
            let contacts = (steps * sim.contacts.len()) as f64;
            let all: f64 = Phase::ALL.iter().map(|&phase| sim.clock.seconds(phase)).sum();
            let phases = PHASES.map(|phase| sim.clock.seconds(phase));
            times.push([all, phases[0], phases[1], phases[2]].map(|time| 1e9 * time / contacts));
        }
    }

    let mut table = "spheres,contacts,step_ns,move_ns,contacts_ns,forces_ns\n".to_owned();
    println!("ns per contact of spheres with friction and dashpots: medians of {ROUNDS} rounds");
    println!(
        "{:>9} {:>10} {:>8} {:>8} {:>9} {:>8}",
        "spheres", "contacts", "step", "move", "contacts", "forces"
    );
    let mut whole = Vec::new();
    for (sim, times) in &sims {
        let [step, moving, contacts, forces] = [0, 1, 2, 3]
            .map(|k| median(&mut times.iter().map(|round| round[k]).collect::<Vec<f64>>()));
        let (spheres, count) = (sim.particles.owned, sim.contacts.len());
        println!(
            "{spheres:>9} {count:>10} {step:>8.1} {moving:>8.1} {contacts:>9.1} {forces:>8.1}"
        );
        writeln!(table, "{spheres},{count},{step:.2},{moving:.2},{contacts:.2},{forces:.2}")?;
        whole.push(times.iter().map(|round| round[0]));
    }
    let [few, many] = [whole[0].clone(), whole[1].clone()];
    let ratio = median(&mut many.zip(few).map(|(many, few)| many / few).collect::<Vec<f64>>());
    println!("a million over 20,000, per contact: {ratio:.3} (median over rounds)");
    if let Some(record) = record {
        std::fs::write(record.join("million.csv"), table)?;
    }
    Ok(())
}
