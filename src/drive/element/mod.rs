//! A periodic cell that is strained as a whole: the element test.
//!
//! Each component of strain has a rate, given or controlled by a stress ([`control`]). The flow carries all particles in
//! the same step ([`crate::motion::affine`]). The stress is the symmetric part of two sums over the volume: force times
//! branch, and mass times the square of the velocity relative to the flow. It is summed once per step, in whole numbers
//! (`whole.rs`), while the particles move: the bits do not depend on the number of ranks.

pub mod control;
mod state;
mod whole;

pub use control::{Control, Goal, Pressed, State};

use super::errors::{Errors, Record, SWINGS};
use super::{
    Drive, DriveError, Kept, Observer, Outcome, Reporter, Restart, SavedColumn, Standing, Steering,
    View,
};
use crate::cell::{AXES, Cell};
use crate::comm::Comm;
use crate::math::{ExactSum, Mat3, Vec3};
use crate::measure::COMPONENTS;
use crate::walls::Wall;
use whole::{Slowly, Whole, components};

/// Number of steps between two sums of the stiffness.
const STIFFNESS_EVERY: u64 = 16;

/// Number of sums of a step: stress times volume by [`COMPONENTS`], then moduli by axis.
const SUMS: usize = COMPONENTS.len() + 3;

/// Control of the cell of a running simulation.
#[derive(Clone, Debug)]
pub struct Element {
    control: Control,
    /// States and records; those of components without a target are unused.
    states: [State; 6],
    records: [Record; 6],
    /// Has the initial stress of the stage been recorded?
    has_begun: bool,
    /// Sums of this rank at the present positions; empty without targets.
    sums: Vec<ExactSum>,
    /// Quantum of the next sums of stress times volume [J], see `whole.rs`; 0 if it is unknown.
    quantum: f64,
    warnings: Vec<String>,
    /// Is a target still ramping?
    ramps: bool,
    /// Has a path of strain not ended?
    on_path: bool,
}

/// Velocity gradient of a flow with these strain rates, compression positive [1/s].
pub fn gradient(rates: &[f64; 6]) -> Mat3 {
    let [xx, yy, zz, xy, xz, yz] = *rates;
    -Mat3::new(xx, xy, xz, 0.0, yy, yz, 0.0, 0.0, zz)
}

/// Name of a component, like `xy`.
pub fn name_of(component: usize) -> String {
    COMPONENTS[component].map(|axis| AXES[axis]).concat()
}

impl Element {
    /// Control at the start.
    pub fn new(control: Control) -> Self {
        let sums = if control.has_target() { SUMS } else { 0 };
        Self {
            ramps: control.ramp > 0.0 && control.has_target(),
            on_path: control.end_of_paths().is_some(),
            control,
            states: Default::default(),
            records: Default::default(),
            has_begun: false,
            sums: vec![ExactSum::default(); sums],
            quantum: 0.0,
            warnings: Vec::new(),
        }
    }

    /// Sets the rates of a cell that do not depend on stress, for the first step of a stage, of `dt` [s].
    pub fn begin(control: &Control, cell: &mut Cell, dt: f64) {
        cell.set_rate(&gradient(&control.rates([dt; 2], |_| 0.0)));
    }

    /// Sets the rate of the cell for the next step.
    fn steer_cell(&mut self, pressed: &Pressed, steering: &mut Steering) {
        let Self { control, states, records, has_begun, warnings, ramps, on_path, .. } = self;
        let moment = steering.moment;
        // The rate belongs to the step after this one.
        let time = moment.stage_time + 2.0 * moment.dt;
        *ramps = control.has_target() && time < control.ramp;
        *on_path = control.end_of_paths().is_some_and(|end| time < end);
        let scale = scale_of(control, states, pressed, *has_begun);
        let goals = &control.goals;
        let rates = control.rates([time, moment.dt], |k| {
            let goal = goals[k].stress().unwrap_or_default();
            let now = pressed.of(&goals[k], k);
            let state = &mut states[k];
            if !*has_begun {
                state.first = now[0];
            }
            let target = control.target_at(goal, state.first, time);
            let aim = control.target_at(goal, state.first, moment.stage_time);
            let size = if goal == 0.0 { scale } else { goal.abs() };
            if records[k].note(moment.step, (now[0] - aim) / size) {
                warnings.push(format!(
                    "the stress {} of the cell oscillates about its target for {SWINGS} steps without decay: the \
                     control is too fast for these particles. Set `cell.gain` = {:.2} or lower",
                    called(&goals[k], k),
                    0.5 * control.gain,
                ));
            }
            control.rate(state, target, now, moment.dt)
        });
        *has_begun = true;
        steering.cell.set_rate(&gradient(&rates));
    }

    /// Errors over the last fifth of the stage for each component with a target, if there were steps: component, goal [Pa],
    /// errors.
    fn in_the_end(&self) -> impl Iterator<Item = (usize, f64, Errors)> {
        let all = self.control.targets();
        let all = all.map(|(k, goal)| (k, goal, self.records[k].course.last_fifth()));
        all.filter(|(.., late)| late.steps > 0.0)
    }

    const fn unfinished(&self) -> Option<&'static str> {
        if self.ramps {
            return Some("the targets of the cell still change");
        }
        if self.on_path { Some("the strain paths of the cell have not ended") } else { None }
    }

    /// Stress by which errors of a component are divided [Pa].
    fn size(&self, goal: f64) -> f64 {
        let nothing = Pressed::default();
        if goal == 0.0 { scale_of(&self.control, &self.states, &nothing, true) } else { goal.abs() }
    }
}

/// Reference stress for the errors of zero targets: the largest target, or the largest initial stress of the stage [Pa].
fn scale_of(control: &Control, states: &[State; 6], pressed: &Pressed, has_begun: bool) -> f64 {
    let largest = control.targets().map(|(_, goal)| goal.abs()).fold(0.0, f64::max);
    if largest > 0.0 {
        return largest;
    }
    let first = |k: usize| {
        if has_begun { states[k].first } else { pressed.of(&control.goals[k], k)[0] }
    };
    let begun = control.targets().map(|(k, _)| first(k).abs()).fold(0.0, f64::max);
    if begun > 0.0 { begun } else { 1.0 }
}

/// Name of a target.
fn called(goal: &Goal, component: usize) -> String {
    if let Goal::MeanStress(_) = goal { "isotropic".to_owned() } else { name_of(component) }
}

impl Drive for Element {
    /// Limbs of the sums that were found with the forces.
    fn sums(&self, _view: &View) -> Vec<i64> {
        self.sums.iter().flat_map(|sum| *sum.limbs()).collect()
    }

    fn steer(&mut self, mut steering: Steering) -> Result<(), DriveError> {
        if !self.control.is_steered() {
            return Ok(());
        }
        let mut pressed = Pressed::default();
        if !self.sums.is_empty() {
            let volume = steering.cell.volume();
            let sums = ExactSum::values(steering.sums);
            let (stress, moduli) = sums.split_at(COMPONENTS.len());
            self.quantum = whole::quantum(stress[..3].iter().map(|x| x.abs()).sum());
            pressed.stress = std::array::from_fn(|k| stress[k] / volume);
            pressed.moduli = Vec3::from_column_slice(moduli) / volume;
        }
        self.steer_cell(&pressed, &mut steering);
        Ok(())
    }
}

impl Observer for Element {
    /// Sums stress and stiffness of this rank at the present positions.
    fn after_forces(&mut self, view: &View) {
        if self.sums.is_empty() {
            return;
        }
        let View { moment, particles, contacts, law, .. } = view;
        // At the start no time has passed, so dashpots add no stiffness.
        let dt = if moment.dt > 0.0 { moment.dt } else { f64::INFINITY };
        let is_unknown = |(k, _): (usize, f64)| self.states[k].modulus == 0.0;
        let with_stiffness =
            moment.step.is_multiple_of(STIFFNESS_EVERY) || self.control.targets().any(is_unknown);
        self.sums.fill(ExactSum::default());
        let (stress, moduli) = self.sums.split_at_mut(COMPONENTS.len());
        let of_motion = |slot: usize| {
            let (mass, velocity): (f64, [f64; 3]) =
                (particles.mass(slot), particles.velocity[slot].into());
            components(velocity.map(|component| mass * component), velocity)
        };
        let mut whole = Whole::of(self.quantum, particles);
        contacts.visit(particles, &mut whole);
        (0..particles.owned).for_each(|slot| whole.add(of_motion(slot)));
        let branch = |pair| particles.bodies().relative(particles.bodies_of(pair));
        if !whole.finish(stress) {
            let mut slowly = Slowly::of(self.quantum);
            for (pair, force) in contacts.forces().filter(|(pair, _)| particles.is_owned(pair.a)) {
                slowly.add(components((*force).into(), branch(pair).into()), stress);
            }
            (0..particles.owned).for_each(|slot| slowly.add(of_motion(slot), stress));
            slowly.finish(stress);
        }
        if with_stiffness {
            for (pair, geometry) in contacts.iter().filter(|(pair, _)| particles.is_owned(pair.a)) {
                let stiffness = law.stiffness(pair, particles, geometry, dt);
                for (sum, along) in moduli.iter_mut().zip(&geometry.normal) {
                    add(sum, stiffness * branch(pair).norm_squared() * along * along);
                }
            }
        }
    }
}

impl Reporter for Element {
    fn name(&self) -> &'static str {
        state::NAME
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// Largest of the mean errors since the last check of `[stop]`.
    fn standing(&self) -> Standing {
        let error = |(k, _): (usize, f64)| {
            let recent = &self.records[k].recent;
            // The error is unknown before the first step.
            if recent.steps > 0.0 { recent.mean_size() } else { f64::INFINITY }
        };
        let largest = self.control.targets().map(error).reduce(f64::max);
        Standing {
            unfinished: self.unfinished(),
            error: largest.map(|error| ("cell", error)),
            ..Standing::default()
        }
    }

    fn outcome(&self, _walls: &[Wall], _has_stopped: bool) -> Outcome {
        let kept = |(k, target, late): (usize, f64, Errors)| Kept {
            drive: "cell".to_owned(),
            of: called(&self.control.goals[k], k),
            unit: "Pa",
            target,
            mean: target + late.of_mean() * self.size(target),
            steps: late.steps as u64,
            mean_error: late.mean_size(),
            largest_error: late.largest,
        };
        let is_off = |(.., late): &(usize, f64, Errors)| {
            let mean = late.mean_size();
            mean > OFF_TARGET || mean.is_nan()
        };
        let warning = |(k, _, late): (usize, f64, Errors)| {
            let advice = if late.of_mean().abs() > 0.5 * late.mean_size() {
                "Give it more steps or a higher `max_rate`"
            } else {
                "The stress fluctuates: increase dissipation (`restitution`, `friction`), strain more slowly, or use \
                 more particles; if it oscillates, lower `gain`"
            };
            format!(
                "the cell has not reached its stress {}: {:.1} % off in the mean of the last fifth of the steps. \
                 {advice}",
                called(&self.control.goals[k], k),
                100.0 * late.mean_size(),
            )
        };
        Outcome {
            kept: self.in_the_end().map(kept).collect(),
            warnings: self.in_the_end().filter(is_off).map(warning).collect(),
        }
    }

    fn save(&self, _walls: &[Wall], comm: &mut dyn Comm) -> Vec<SavedColumn> {
        state::saved(self, comm)
    }

    fn resume(&mut self, restart: &Restart, _walls: &mut [Wall]) -> Result<(), DriveError> {
        state::resume(self, restart)
    }
}

/// Adds a term. A state that is not a number is reported when the list of pairs is rebuilt.
fn add(sum: &mut ExactSum, term: f64) {
    if term.is_finite() {
        sum.add(term);
    }
}

/// Error over the target above which a warning is given.
const OFF_TARGET: f64 = 0.02;
