//! Instructions of a step by phase, beside the lower bound from its formulas.

use super::{ALONG, RUNGS, instructions};
use anyhow::ensure;
use dem_mpi::sim::floor::Floor;
use dem_mpi::timing::Phase;
use std::fmt::Write;
use std::path::Path;

/// The whole step.
const STEP: &str = "dem_mpi::sim::Simulation::step";
/// The part of a step that finds contacts and forces.
const CONTACTS_AND_FORCES: &str = "dem_mpi::sim::Simulation::find_forces";
/// The part of these that is the contact law.
const FORCES: &str = "dem_mpi::contacts::Contacts::compute_forces";

/// Number of `f64` in a register, and its bytes.
const LANES: f64 = 4.0;
const REGISTER: f64 = 32.0;

/// Counts, prints and writes the instructions per particle and step.
pub(super) fn count(record: Option<&Path>) -> anyhow::Result<()> {
    let bodies = f64::from(ALONG.pow(3));
    let mut table =
        "rung,phase,instructions,operations,bytes,floor_instructions,over_the_floor\n".to_owned();
    println!("\ninstructions by phase, per particle and step; floor: operations / 4 + bytes / 32");
    println!(
        "{:<34} {:<9} {:>12} {:>10} {:>7} {:>7} {:>10}",
        "", "phase", "instructions", "operations", "bytes", "floor", "over floor"
    );
    for (number, rung) in RUNGS.iter().enumerate() {
        let sim = rung.begun(ALONG)?;
        let [listed, contacts] =
            [sim.pairs.pairs.len(), sim.contacts.len()].map(|count| count as f64 / bodies);
        let Some(by_phase) = by_phase(number + 1)? else { continue };
        for (phase, counted) in by_phase {
            let counted = counted / bodies;
            let Some(floor) = sim.floor(phase) else { continue };
            let needed = floor.total(1.0, listed, contacts);
            let least = needed.operations / LANES + needed.bytes / REGISTER;
            let over = counted / least;
            let (name, phase) = (rung.name, phase.name());
            println!(
                "{name:<34} {phase:<9} {counted:>12.0} {:>10.0} {:>7.0} {least:>7.1} {over:>10.2}",
                needed.operations, needed.bytes
            );
            writeln!(
                table,
                "{name:?},{phase},{counted:.1},{:.1},{:.1},{least:.2},{over:.3}",
                needed.operations, needed.bytes
            )?;
        }
    }
    if let Some(record) = record {
        std::fs::write(record.join("phases.csv"), table)?;
    }
    Ok(())
}

/// Instructions of a step in the phases that have a floor. Everything other than contacts and forces counts as motion: on one
/// rank, also the halo across periods and the check of the pair list.
fn by_phase(number: usize) -> anyhow::Result<Option<[(Phase, f64); 3]>> {
    let mut counted = [0.0; 3];
    for (function, counted) in [STEP, CONTACTS_AND_FORCES, FORCES].into_iter().zip(&mut counted) {
        let Some(of_it) = instructions(number, 1, Some(function), "avx")? else {
            return Ok(None);
        };
        ensure!(of_it > 0.0, "{function} is not to be found in the program: was it renamed?");
        *counted = of_it;
    }
    let [step, both, forces] = counted;
    let counted = [step - both, both - forces, forces];
    Ok(Some(std::array::from_fn(|k| (Floor::PHASES[k], counted[k]))))
}
