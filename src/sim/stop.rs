//! Conditions under which a stage ends before its last step.

use super::{Simulation, history};
use crate::drive::{Reporter, Standing};
use crate::math::Vec3;
use crate::measure::Measures;
use crate::walls::Wall;
use serde::{Deserialize, Serialize};
use std::fmt::{Display, Formatter};

/// Conditions that must all hold for a stage to end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    /// Kinetic energy over dissipated energy is below this.
    pub rest: Option<f64>,
    /// The mean resultant force of a particle over the mean contact force is below this: [`Measures::unbalanced`].
    pub unbalanced: Option<f64>,
    /// At least this number of particles has left through outlets in this stage.
    pub left: Option<u64>,
    /// At most this number of particles remains, and none are still to come.
    pub remaining: Option<u64>,
    /// The error of a drive is below this, by the drive's key: [`crate::drive::Standing::error`].
    pub drives: Vec<(String, f64)>,
    /// Columns of the history are within limits.
    pub when: Vec<When>,
    /// The stage has lasted at least this long [s].
    pub after: f64,
}

/// Limits of a column of the history.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct When {
    /// Name of the column.
    pub column: String,
    /// Lower limit of its number.
    pub above: Option<f64>,
    /// Upper limit of its number.
    pub below: Option<f64>,
}

impl When {
    /// Is a number within the limits? NaN is not.
    fn holds(&self, number: f64) -> bool {
        let Self { above, below, .. } = *self;
        let is_above = above.is_none_or(|above| number > above);
        is_above && below.is_none_or(|below| number < below) && !number.is_nan()
    }
}

impl Display for When {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        let limits = [("above", self.above), ("below", self.below)].into_iter();
        let limits = limits.filter_map(|(side, limit)| Some(format!("{side} {}", limit?)));
        f.write_str(&limits.collect::<Vec<_>>().join(" and "))
    }
}

/// Conditions in the form of the scene.
impl Display for Stop {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        let Self { rest, unbalanced, drives, left, remaining, when, after } = self;
        let own = [("rest", *rest), ("unbalanced", *unbalanced)];
        let own = own.into_iter().filter_map(|(key, limit)| Some((key, limit?)));
        let given = own.chain(drives.iter().map(|(key, limit)| (&**key, *limit)));
        let given = given.map(|(key, limit)| format!("{key} = {limit}"));
        let counts = [("left", *left), ("remaining", *remaining)].into_iter();
        let counts = counts.filter_map(|(key, count)| Some(format!("{key} = {}", count?)));
        let when = when.iter().map(|when| format!("{} {when}", when.column));
        let after = (*after > 0.0).then(|| format!("after = {after}"));
        f.write_str(&given.chain(counts).chain(when).chain(after).collect::<Vec<_>>().join(", "))
    }
}

impl Stop {
    /// Checks that the history has the columns that it names.
    ///
    /// # Errors
    /// The first unknown column, with the existing ones.
    pub fn check(&self, sim: &Simulation) -> Result<(), String> {
        if self.when.is_empty() {
            return Ok(());
        }
        let names = history::names(sim);
        let wrong = self.when.iter().find(|when| !names.contains(&when.column));
        wrong.map_or(Ok(()), |When { column, .. }| {
            let names = names.join(", ");
            Err(format!("stop.when: history.csv has no column `{column}`; it has {names}"))
        })
    }

    /// Columns of the history outside their limits.
    fn beyond(&self, sim: &Simulation, measures: &Measures) -> Vec<String> {
        if self.when.is_empty() {
            return Vec::new();
        }
        let (names, numbers) = (history::names(sim), history::numbers(sim, measures));
        let is = |when: &When| {
            let column = names.iter().position(|name| *name == when.column);
            column.and_then(|column| numbers[column].parse().ok()).unwrap_or(f64::NAN)
        };
        let unmet = self.when.iter().filter(|when| !when.holds(is(when)));
        unmet.map(|when| format!("{} is {:.4e}, not {when}", when.column, is(when))).collect()
    }

    /// Conditions that do not hold now, as text; empty if all hold.
    pub(super) fn unmet(&self, sim: &Simulation, measures: &Measures) -> String {
        let mut unmet: Vec<String> = Vec::new();
        // Rounding may put the time of a whole number of steps slightly above it.
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
        // At the end of a rebound a dashpot may cancel the whole force: particles touch but carry nothing.
        let carries = measures.mean_normal_force != 0.0
            || measures.wall_forces.iter().any(|f| *f != Vec3::zeros())
            || measures.group_forces.iter().any(|f| *f != Vec3::zeros());
        if of_contacts && !carries {
            unmet.push("no contact carries a force".to_owned());
        }
        unmet.extend(self.beyond(sim, measures));
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
            // NaN is below no limit.
            if limit.is_some() && !is.is_finite() {
                unmet.push(format!("{name} is unknown, as no energy was dissipated"));
            } else if let Some(limit) = limit.filter(|&limit| is >= limit) {
                unmet.push(format!("{name} is {is:.2e}, not below {limit}"));
            }
        }
        unmet.join("; ")
    }
}

/// Walls that will move whatever the particles do, so that resting particles will not stay at rest.
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
