//! When a stage ends before its last step.

use super::Simulation;
use crate::drive::{Reporter, Standing};
use crate::math::Vec3;
use crate::measure::Measures;
use crate::walls::Wall;
use serde::{Deserialize, Serialize};
use std::fmt::{Display, Formatter};

/// When a stage has done its work: when all that is asked for holds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    /// The kinetic energy is below this fraction of the energy dissipated.
    pub rest: Option<f64>,
    /// The mean resultant force of a particle is below this fraction of the mean contact force: [`Measures::unbalanced`].
    pub unbalanced: Option<f64>,
    /// So many particles have left through outlets in this stage.
    pub left: Option<u64>,
    /// No more than so many particles are there, and none are still to come.
    pub remaining: Option<u64>,
    /// The error of a drive is below this, by the drive's key: [`crate::drive::Standing::error`].
    pub drives: Vec<(String, f64)>,
    /// Not before the stage has lasted so long [s].
    pub after: f64,
}

/// As the scene has it.
impl Display for Stop {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        let Self { rest, unbalanced, drives, left, remaining, after } = self;
        let own = [("rest", *rest), ("unbalanced", *unbalanced)];
        let own = own.into_iter().filter_map(|(key, limit)| Some((key, limit?)));
        let given = own.chain(drives.iter().map(|(key, limit)| (&**key, *limit)));
        let given = given.map(|(key, limit)| format!("{key} = {limit}"));
        let counts = [("left", *left), ("remaining", *remaining)].into_iter();
        let counts = counts.filter_map(|(key, count)| Some(format!("{key} = {}", count?)));
        let after = (*after > 0.0).then(|| format!("after = {after}"));
        f.write_str(&given.chain(counts).chain(after).collect::<Vec<_>>().join(", "))
    }
}

impl Stop {
    /// What is asked for and does not hold now; empty if all does.
    pub(super) fn unmet(&self, sim: &Simulation, measures: &Measures) -> String {
        let mut unmet: Vec<String> = Vec::new();
        // A time that is a whole number of steps may come out a little above it.
        if sim.stage_time() + 0.5 * sim.dt < self.after {
            unmet.push(format!(
                "the stage has lasted {:.3e} s, not {} s",
                sim.stage_time(),
                self.after
            ));
        }
        let of_contacts =
            self.rest.is_some() || self.unbalanced.is_some() || !self.drives.is_empty();
        let standings: Vec<Standing> = sim.all_observers().map(Reporter::standing).collect();
        if of_contacts || self.remaining.is_some() {
            unmet.extend(standings.iter().filter_map(|one| one.unfinished).map(str::to_owned));
        }
        if of_contacts {
            unmet.extend(walls_under_way(sim, measures));
        }
        let gone: u64 = standings.iter().map(|one| one.gone).sum();
        if let Some(left) = self.left.filter(|&left| gone < left) {
            unmet.push(format!("{gone} of {left} particles have left"));
        }
        if let Some(most) = self.remaining.filter(|&most| measures.particles > most) {
            unmet.push(format!("{} particles remain, more than {most}", measures.particles));
        }
        // In the moments at the end of a rebound when a dashpot has taken all the force, grains touch but carry nothing.
        let carries = measures.mean_normal_force != 0.0
            || measures.wall_forces.iter().any(|f| *f != Vec3::zeros())
            || measures.group_forces.iter().any(|f| *f != Vec3::zeros());
        if of_contacts && !carries {
            unmet.push("no contact carries a force".to_owned());
        }
        let own = [
            ("rest", measures.kinetic() / measures.dissipated, self.rest),
            ("unbalanced", measures.unbalanced, self.unbalanced),
        ];
        let of_drives = standings.iter().filter_map(|one| {
            let (key, error) = one.error?;
            let limit = self.drives.iter().find(|(of, _)| of == key);
            Some((key, error, limit.map(|(_, limit)| *limit)))
        });
        for (name, is, limit) in own.into_iter().chain(of_drives) {
            // What is not a number is below no limit.
            if limit.is_some() && !is.is_finite() {
                unmet.push(format!("{name} is not known, for no energy was dissipated"));
            } else if let Some(limit) = limit.filter(|&limit| is >= limit) {
                unmet.push(format!("{name} is {is:.2e}, not below {limit}"));
            }
        }
        unmet.join("; ")
    }
}

/// Walls that will move whatever the grains do: grains that are at rest now will not stay so.
fn walls_under_way<'a>(
    sim: &'a Simulation,
    measures: &'a Measures,
) -> impl Iterator<Item = String> + 'a {
    let walls = &sim.particles.walls;
    let time = sim.stage_time() + 0.5 * sim.dt;
    let follows = move |wall: &Wall| {
        let end = wall.course.as_ref()?.end().filter(|&end| time < end)?;
        Some(format!("wall \"{}\" follows its table until {end} s", wall.name))
    };
    let forces = &measures.wall_forces;
    let by_drives = sim.all_observers().filter_map(|drive| drive.under_way(walls, forces));
    walls.iter().filter_map(follows).chain(by_drives)
}
