//! Columns and numbers of the history at a moment.

use super::Simulation;
use crate::cell::AXES;
use crate::drive::Reporter;
use crate::math::Vec3;
use crate::measure::Measures;
use crate::output::table::{Columns, Row};

/// Columns that only some scenes have, with their numbers: forces on groups, and counts of drives.
pub(super) fn own_columns(sim: &Simulation, measures: &Measures) -> Vec<(String, f64)> {
    let of_groups = sim.particles.groups.iter().enumerate().flat_map(|(k, group)| {
        let three = |what: &str, all: &[Vec3], unit: &str| {
            let vector = all.get(k).copied().unwrap_or_default();
            AXES.iter()
                .zip(vector.iter())
                .map(|(axis, number)| (format!("{what}_{}_{axis}_{unit}", group.name), *number))
                .collect::<Vec<_>>()
        };
        let torque = group.about.map(|_| three("torque", &measures.group_torques, "N_m"));
        let force = three("force", &measures.group_forces, "N");
        force.into_iter().chain(torque.into_iter().flatten())
    });
    of_groups.chain(counted(sim)).collect()
}

/// Counts of drives: columns of the history and numbers.
pub(super) fn counted(sim: &Simulation) -> impl Iterator<Item = (String, f64)> {
    sim.all_observers().flat_map(Reporter::counted)
}

impl Simulation {
    /// Names of the columns of `history.csv`.
    pub fn columns(&self) -> Vec<String> {
        names(self)
    }
}

/// Names of all columns.
pub(super) fn names(sim: &Simulation) -> Vec<String> {
    let own = own_columns(sim, &Measures::default()).into_iter().map(|(name, _)| name);
    let (walls, cell) = (&sim.particles.walls, sim.particles.cell);
    Columns::of(walls, cell).names(walls, &own.collect::<Vec<_>>())
}

/// Present numbers of all columns, with the present forces on all walls.
pub(super) fn numbers(sim: &Simulation, measures: &Measures) -> Vec<String> {
    let own: Vec<f64> = own_columns(sim, measures).into_iter().map(|(_, number)| number).collect();
    let (walls, forces) = (&*sim.particles.walls, &*measures.wall_forces);
    let row = Row { step: sim.step, time: sim.time(), measures, forces, walls, own: &own };
    Columns::of(walls, sim.particles.cell).numbers(&row)
}
