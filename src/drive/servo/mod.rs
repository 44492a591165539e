//! Walls that keep a stress or a force: the servo of numerical triaxial tests (the paper, section 3.1).
//!
//! In each step a servo finds the velocity of its walls from the load on them ([`Servo::velocity`], [`law`]).
//!
//! Forces and stiffnesses are summed exactly and once per step, while the particles move: the bits do not depend on the
//! number of ranks. Normal forces and stiffnesses come from the state of contacts. Snapshots hold the forces along
//! directions, integral, stiffness, and the sums over steps for means.

pub mod law;
mod means;
mod state;

pub use law::{Goal, Pressed, Servo, State};
pub use state::{Target, targets};

use super::clearance::Unloaded;
use super::errors::{Errors, Record, SWINGS};
use super::load::{self, Line};
use super::{
    Drive, DriveError, Kept, Observer, Outcome, Reporter, Restart, Row, SavedColumn, Standing,
    Steering, View,
};
use crate::comm::Comm;
use crate::math::{ExactSum, Vec3};
use crate::walls::Wall;
use means::Means;
use std::collections::BTreeMap;

/// A servo with its state.
#[derive(Clone, Debug)]
struct Running {
    servo: Servo,
    state: State,
    record: Record,
    /// Sum of the forces of this rank's contacts against the directions of the walls, at the present positions [N], for a
    /// servo of force. `None` in the first step of a servo that is new within a stage, or has another direction: normal
    /// forces are used instead.
    pressing: Option<ExactSum>,
}

/// The servos of a running simulation.
#[derive(Clone, Debug)]
pub struct Servos {
    all: Vec<Running>,
    /// Velocities that the scene gives to walls with a servo, by index [m/s].
    own: BTreeMap<usize, Vec3>,
    /// Forces on walls with a servo.
    means: Means,
    warnings: Vec<String>,
}

impl Servos {
    /// Servos at the start, with the velocities of the scene's walls.
    pub fn new(all: Vec<Servo>, walls: &[Wall]) -> Self {
        let steered = || all.iter().flat_map(|servo| servo.walls.iter().copied());
        let own = steered().map(|wall| (wall, walls[wall].velocity)).collect();
        let means = Means::of(steered());
        let (state, record) = (State::default(), Record::default());
        let running = |servo| Running { servo, state, record: record.clone(), pressing: None };
        Self { all: all.into_iter().map(running).collect(), own, means, warnings: Vec::new() }
    }

    /// Number of the servo of a wall.
    fn of_wall(&self, wall: usize) -> Option<usize> {
        self.all.iter().position(|running| running.servo.walls.contains(&wall))
    }

    /// Is there a servo of force?
    fn has_force(&self) -> bool {
        self.all.iter().any(|running| running.servo.goal.is_force())
    }

    /// Number of the servo of each wall, and the direction against which the particles press.
    fn lines(&self, walls: &[Wall]) -> Vec<Option<Line>> {
        let line = |(k, wall): (usize, &Wall)| {
            let servo = self.of_wall(k)?;
            Some((servo, -self.all[servo].servo.goal.along(wall)))
        };
        walls.iter().enumerate().map(line).collect()
    }

    /// Each servo with its errors over the last fifth of the stage, if there were any steps.
    fn in_the_end(&self) -> impl Iterator<Item = (&Servo, Errors)> {
        let late = |running: &Running| running.record.course.last_fifth();
        let all = self.all.iter().map(move |running| (&running.servo, late(running)));
        all.filter(|(_, late)| late.steps > 0.0)
    }

    /// Steers the walls of one servo, given the force [N] on them and the stiffness [N/m] of their contacts.
    fn steer_one(
        &mut self,
        number: usize,
        [force, stiffness]: [f64; 2],
        steering: &mut Steering,
    ) -> Result<(), DriveError> {
        let Steering { moment, cell, library, walls, .. } = steering;
        let Running { servo, state, record, .. } = &mut self.all[number];
        let area = servo.area(walls, cell);
        let velocity = servo.velocity(state, &Pressed { area, force, stiffness }, moment.dt);
        for &k in &servo.walls {
            if let Some(astray) = Unloaded::of(&walls[k], walls, cell, library) {
                let now = force / servo.divisor(area);
                return Err(lost(&walls[k].name, astray, &servo.goal, now));
            }
            // Across its direction the wall keeps the velocity of the scene.
            walls[k].velocity = servo.goal.velocity(&walls[k], &self.own[&k], velocity);
        }
        if record.note(moment.step, force / servo.load(area) - 1.0) {
            let (what, ..) = servo.goal.target();
            self.warnings.push(format!(
                "the {what} on wall {} oscillates about its target for {SWINGS} steps without decay: the servo is too \
                 fast for these particles. Set its `gain` = {:.2} or lower",
                servo.names(walls),
                0.5 * servo.gain,
            ));
        }
        Ok(())
    }
}

/// Error for a servo whose wall, of this name, can press on no particle. `now` is its present stress or force [Pa, N].
fn lost(wall: &str, astray: Unloaded, goal: &Goal, now: f64) -> DriveError {
    let (what, unit, target) = goal.target();
    let reached = format!("its {what} is {now:e} {unit} of {target:e} {unit}");
    DriveError(match astray {
        Unloaded::Closed { gap } => format!(
            "servo: wall \"{wall}\" is {gap:e} m from the opposite side, less than half the thickness of the thinnest \
             particle, and {reached}. Between its walls are too few particles, they have escaped, or they are too \
             soft: add particles, lower `{what}`, or raise `normal_stiffness`"
        ),
        Unloaded::Open => format!(
            "servo: wall \"{wall}\" has moved out of the domain by more than its width, and {reached}. A load, such \
             as the weight of the particles, exceeds the target: raise `{what}`, or fix the wall"
        ),
        Unloaded::Gone => format!(
            "servo: wall \"{wall}\" is out of the domain by more than its width, and {reached}. It met too few \
             particles, or they pushed it out: put particles where they support it, or change `along` or `force`"
        ),
    })
}

impl Drive for Servos {
    /// Load on the walls: the limbs of force and stiffness of each servo.
    fn sums(&self, view: &View) -> Vec<i64> {
        let View { moment, particles, law, .. } = view;
        let needs = law.needs();
        let sticks = needs.friction || needs.tangential_dashpots;
        let lines = self.lines(&particles.walls);
        let mut sums = vec![<[ExactSum; 2]>::default(); self.all.len()];
        for (wall, pair, geometry, force) in load::pressing(view) {
            let Some((k, against)) = lines[wall] else { continue };
            let is_along = self.all[k].servo.goal.is_force() && !sticks;
            let part = if is_along { geometry.normal.dot(&against).powi(2) } else { 1.0 };
            sums[k][0].add(force);
            sums[k][1].add(law.stiffness(pair, particles, geometry, moment.dt) * part);
        }
        for ([force, _], running) in sums.iter_mut().zip(&self.all) {
            if let Some(pressing) = &running.pressing {
                *force = pressing.clone();
            }
        }
        sums.iter().flatten().flat_map(|sum| *sum.limbs()).collect()
    }

    fn steer(&mut self, mut steering: Steering) -> Result<(), DriveError> {
        let sums = ExactSum::values(steering.sums);
        let mut all = sums.as_chunks().0.iter().enumerate();
        all.try_for_each(|(k, &pressed)| self.steer_one(k, pressed, &mut steering))
    }
}

impl Observer for Servos {
    /// Records the present forces on walls with servos.
    fn after_forces(&mut self, view: &View) {
        if self.has_force() {
            let lines = self.lines(&view.particles.walls);
            let pressing = load::along(self.all.len(), &lines, view);
            for (running, pressing) in self.all.iter_mut().zip(pressing) {
                running.pressing = running.servo.goal.is_force().then_some(pressing);
            }
        }
        if view.moment.dt > 0.0 {
            self.means.add(view);
        }
    }

    /// Mean force on each wall with a servo over the steps since the previous row.
    fn row(&mut self, row: &mut Row, comm: &mut dyn Comm) {
        self.means.fill(row, comm);
    }
}

impl Reporter for Servos {
    fn name(&self) -> &'static str {
        state::NAME
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Largest error of all servos, over the target: the mean difference of stress or force from it since the last check of
    /// `[stop]`.
    fn standing(&self) -> Standing {
        // The error is unknown before the first step.
        let error = |Running { record, .. }: &Running| {
            if record.recent.steps > 0.0 { record.recent.mean_size() } else { f64::INFINITY }
        };
        let largest = self.all.iter().map(error).fold(0.0, f64::max);
        Standing { error: Some(("servo", largest)), ..Standing::default() }
    }

    /// A servo that approaches particles and does not touch any yet.
    fn under_way(&self, walls: &[Wall], wall_forces: &[Vec3]) -> Option<String> {
        let is_free = |servo: &&Servo| servo.walls.iter().all(|&k| wall_forces[k] == Vec3::zeros());
        let servo = self.all.iter().map(|running| &running.servo).find(is_free)?;
        Some(format!("wall {} has a servo, and no particle touches it", servo.names(walls)))
    }

    fn outcome(&self, walls: &[Wall], _has_stopped: bool) -> Outcome {
        let kept = |(servo, late): (&Servo, Errors)| {
            let (_, unit, target) = servo.goal.target();
            Kept {
                drive: "servo".to_owned(),
                of: servo.names(walls),
                unit,
                target,
                mean: (1.0 + late.of_mean()) * target,
                steps: late.steps as u64,
                mean_error: late.mean_size(),
                largest_error: late.largest,
            }
        };
        let is_off = |(_, late): &(&Servo, Errors)| {
            let mean = late.mean_size();
            mean > OFF_TARGET || mean.is_nan()
        };
        let warning = |(servo, late): (&Servo, Errors)| {
            let (what, ..) = servo.goal.target();
            let advice = if late.of_mean().abs() > 0.5 * late.mean_size() {
                format!(
                    "Give it more steps, a higher `max_speed`, or particles that can carry the {what}"
                )
            } else {
                "Particles strike it: increase dissipation (`restitution`, `friction`, `global_damping`), strain more \
                 slowly, or use a shorter time step; if it oscillates, lower `gain`"
                    .to_owned()
            };
            format!(
                "wall {} has not reached its {what}: {:.1} % off in the mean of the last fifth of the steps. {advice}",
                servo.names(walls),
                100.0 * late.mean_size(),
            )
        };
        Outcome {
            kept: self.in_the_end().map(kept).collect(),
            warnings: self.in_the_end().filter(is_off).map(warning).collect(),
        }
    }

    fn save(&self, walls: &[Wall], comm: &mut dyn Comm) -> Vec<SavedColumn> {
        state::saved(self, walls, comm)
    }

    fn resume(&mut self, restart: &Restart, walls: &mut [Wall]) -> Result<(), DriveError> {
        state::resume(self, restart, walls)
    }
}

/// Error over the target above which a warning is given.
const OFF_TARGET: f64 = 0.02;
