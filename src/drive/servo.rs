//! Walls that keep a stress: the servo of numerical triaxial tests (the paper, section 3.1).
//!
//! In each step of `dt` a wall gets a velocity towards the particles from what is missing to its target,
//! `e = (target - stress) · area`, and from the stiffness of its contacts, `K = Σ(k + c/dt)`: a dashpot `c` resists the
//! wall's own motion. It is a proportional and integral law,
//!
//! `w = P e / (K dt) + s`, then `s ← s + I e / (K dt)`, with `P = 0.7 gain` and `I = P²/4`:
//!
//! to the grains the wall is a plate of mass `K dt² / I` under the target stress, with a dashpot of `K dt / P` in series. It
//! takes energy from them, and never gives any of its own. The integral `s` is the speed with which the target moves away:
//! under a packing that strains steadily the mean error is zero, where a proportional law alone, on displacements, stays off
//! by that speed. Contacts that do not give way are at their target with the double root `1 - P/2` per step; where dashpots
//! take nearly all, the roots are 0.92 and -0.62, where a law that makes up all that is missing has -1 and swings
//! for ever. From about 1.7 times the default `gain` on it swings with such contacts.
//!
//! A wall goes no faster than `max_speed`, and its integral does not grow while it is held back. It comes in
//! at `max_speed` until it has touched a grain; later, where nothing touches, `K` is that of the last contacts. Walls that
//! are coupled move with one velocity, found from the sums over all of them.
//!
//! Of a packing without friction and dashpots only the walls take energy: it knocks on them for long (125 spheres: 6 % off in the
//! mean after 50,000 steps at a third of the stable one, 0.3 % after 200,000), and the report at the end says so. Coupled walls
//! keep the mean of their stresses; each may be off it by what friction and inertia bear between them.
//!
//! Forces and stiffnesses are summed exactly and once per step, while the particles move: the same bits on
//! any number of ranks. They come from what contacts remember; integral, stiffness, and the sums over steps from which
//! means are made, are saved in snapshots.

use super::{
    CHECK_EVERY, Drive, DriveError, Kept, Moment, SavedColumn, SavedState, Values, pressing,
};
use crate::cell::Cell;
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::contacts::Contacts;
use crate::law::ForceLaw;
use crate::math::{ExactSum, Vec3};
use crate::particles::walls::{Across, Wall, area, ends};
use crate::particles::{Library, Particles};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Walls that move with one velocity so as to keep a stress.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Servo {
    /// Indices of walls, each across an axis; of coupled walls more than one.
    pub walls: Vec<usize>,
    /// Target stress, compression positive [Pa].
    pub stress: f64,
    /// The fastest that the walls move [m/s].
    pub max_speed: f64,
    /// Factor on how quickly the walls answer: less is slower and softer [-].
    pub gain: f64,
}

/// What presses on the walls of a servo.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pressed {
    /// Sum of the areas [m²].
    pub area: f64,
    /// Sum of the normal forces [N].
    pub force: f64,
    /// Sum of the normal stiffness of the contacts [N/m]; 0 where nothing touches.
    pub stiffness: f64,
}

impl Servo {
    /// The names of its walls.
    pub fn names(&self, walls: &[Wall]) -> String {
        self.walls.iter().map(|&k| &*walls[k].name).collect::<Vec<_>>().join(", ")
    }

    /// Sum of the areas of its walls [m²].
    pub fn area(&self, walls: &[Wall], cell: &Cell) -> f64 {
        let of_wall = |&k: &usize| area(walls, cell, walls[k].across()?.axis);
        // The scene has checked that every wall has one.
        self.walls.iter().filter_map(of_wall).sum()
    }

    /// How fast the walls move towards the particles in a step of `dt` [s], in m/s.
    pub fn velocity(&self, state: &mut State, pressed: &Pressed, dt: f64) -> f64 {
        if pressed.stiffness > 0.0 {
            state.stiffness = pressed.stiffness;
        }
        if state.stiffness == 0.0 {
            return self.max_speed;
        }
        let missing = self.stress * pressed.area - pressed.force;
        let at_once = missing / (state.stiffness * dt);
        let proportional = PROPORTIONAL * self.gain;
        let wanted = state.speed + proportional * at_once;
        let velocity = wanted.clamp(-self.max_speed, self.max_speed);
        let more = 0.25 * proportional * proportional * at_once;
        // While the wall is held back, the integral may only become less.
        if velocity == wanted || more * wanted < 0.0 {
            state.speed = (state.speed + more).clamp(-self.max_speed, self.max_speed);
        }
        velocity
    }
}

/// Part of what is missing that is made up in a step, with a gain of 1 [-].
const PROPORTIONAL: f64 = 0.7;

/// What a servo goes on with from step to step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// The integral: the speed towards the particles at which nothing is missing [m/s].
    pub speed: f64,
    /// Stiffness of the contacts when it last had any; 0 before that [N/m].
    pub stiffness: f64,
}

/// How a servo kept its target over steps on end; errors are (stress - target) / target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Errors {
    /// How many steps, a whole number.
    steps: f64,
    /// Sum of the errors.
    sum: f64,
    /// Sum of their magnitudes.
    sizes: f64,
    /// The largest magnitude.
    largest: f64,
}

impl Errors {
    /// As a snapshot has them.
    const fn numbers(&self) -> [f64; 4] {
        let Self { steps, sum, sizes, largest } = *self;
        [steps, sum, sizes, largest]
    }

    /// From what a snapshot has.
    const fn of(numbers: &[f64; 4]) -> Self {
        let [steps, sum, sizes, largest] = *numbers;
        Self { steps, sum, sizes, largest }
    }

    fn and(self, other: Self) -> Self {
        Self {
            steps: self.steps + other.steps,
            sum: self.sum + other.sum,
            sizes: self.sizes + other.sizes,
            largest: self.largest.max(other.largest),
        }
    }

    /// Mean magnitude of the errors.
    fn mean_size(&self) -> f64 {
        self.sizes / self.steps
    }

    /// The error of the mean stress.
    fn of_mean(&self) -> f64 {
        self.sum / self.steps
    }
}

/// The largest number of intervals of a stage with errors of their own.
const PARTS: usize = 40;

/// The errors of a stage in equal parts, of which the last may still grow: when there are [`PARTS`], two become one.
#[derive(Clone, Debug, Default, PartialEq)]
struct Course(Vec<Errors>);

impl Course {
    fn add(&mut self, step: Errors) {
        let Self(parts) = self;
        let full = parts.first().map_or(0.0, |part| part.steps);
        if let Some(last) = parts.last_mut().filter(|part| part.steps < full) {
            *last = last.and(step);
            return;
        }
        if parts.len() == PARTS {
            *parts = parts.chunks(2).map(|two| two[0].and(two[1])).collect();
        }
        parts.push(step);
    }

    /// Over the last fifth of the stage so far, or a little more, as parts end.
    fn last_fifth(&self) -> Errors {
        let steps: f64 = self.0.iter().map(|part| part.steps).sum();
        let mut late = Errors::default();
        for part in self.0.iter().rev() {
            if 5.0 * late.steps >= steps {
                break;
            }
            late = part.and(late);
        }
        late
    }
}

/// All that a servo remembers.
#[derive(Clone, Debug, Default, PartialEq)]
struct Memory {
    /// Of its law.
    state: State,
    /// Its errors since the stage began.
    course: Course,
    /// Its errors since the last step that [`CHECK_EVERY`] divides.
    recent: Errors,
}

/// The sum of the forces of the particles on a wall over steps, of the contacts of one rank.
#[derive(Clone, Debug, Default, PartialEq)]
struct ForceSum {
    /// Sums along x, y, z [N].
    axes: [ExactSum; 3],
    /// Over how many steps.
    steps: u64,
}

// What a snapshot holds: a row for each wall with a servo. What coupled walls have in common stands with each of them.
/// The wall's name in the scene.
const WALL: StateColumn = StateColumn::new("wall", 1, "");
/// Target stress, compression positive.
const TARGET: StateColumn = StateColumn::new("target", 1, "Pa");
/// [`State::speed`].
const SPEED: StateColumn = StateColumn::new("speed", 1, "m/s");
/// [`State::stiffness`].
const STIFFNESS: StateColumn = StateColumn::new("stiffness", 1, "N/m");
/// [`Memory::recent`].
const RECENT: StateColumn = StateColumn::new("recent", 4, "1");
/// [`Memory::course`]; parts without steps are not there.
const COURSE: StateColumn = StateColumn::new("course", 4 * PARTS, "1");
/// Sum of the forces on the wall since the last row of the history, exactly: limbs along x, y, z.
const FORCE_SUM: StateColumn =
    StateColumn::new("force_sum", 3 * ExactSum::LIMBS, "2^(32 k - 1074) N");
/// Over how many steps.
const FORCE_STEPS: StateColumn = StateColumn::new("force_steps", 1, "1");

/// The stress that a wall is to keep.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The wall's name.
    pub wall: String,
    /// Compression positive [Pa].
    pub stress: f64,
}

/// The targets of all walls with a servo, from what the drives of a simulation have saved.
pub fn targets(saved: &[SavedState]) -> Vec<Target> {
    let read = || {
        let saved = saved.iter().find(|saved| saved.drive == NAME)?;
        let (walls, stresses) = (saved.texts(&WALL).ok()?, saved.reals(&TARGET).ok()?);
        let target = |(wall, &stress): (&String, &f64)| Target { wall: wall.clone(), stress };
        Some(walls.iter().zip(stresses).map(target).collect())
    };
    read().unwrap_or_default()
}

/// Names [`Servos`] among the drives.
const NAME: &str = "servos";

/// A servo cannot reach its target, or loses it.
#[derive(Debug, thiserror::Error)]
enum Lost {
    /// The wall has come so near to the opposite side that nothing fits between.
    #[error(
        "servo: wall \"{wall}\" is {gap:e} m from the opposite side, less than half the thickness of the thinnest \
         grain, and its stress is {stress:e} Pa of {target:e} Pa. There are too few grains between its walls to reach \
         the target, they have escaped, or they are too soft for it: put more in, lower `stress`, or raise \
         `normal_stiffness`"
    )]
    Closed {
        /// Its name.
        wall: String,
        /// Distance of the opposite wall, or of the domain's side [m].
        gap: f64,
        /// Stress [Pa].
        stress: f64,
        /// Target stress [Pa].
        target: f64,
    },
    /// The wall has been pushed far out of the domain.
    #[error(
        "servo: wall \"{wall}\" has moved out of the domain by more than its width, and its stress is {stress:e} Pa of \
         {target:e} Pa. Something pushes harder than the target, such as the grains' weight: raise `stress`, or let \
         the wall stand"
    )]
    Open {
        /// Its name.
        wall: String,
        /// Stress [Pa].
        stress: f64,
        /// Target stress [Pa].
        target: f64,
    },
}

impl From<Lost> for DriveError {
    fn from(lost: Lost) -> Self {
        Self(lost.to_string())
    }
}

/// Steps on end in which the stress must jump from one side of its target to the other, and jump no less,
/// before a warning that the servo oscillates.
const SWINGS: u32 = 100;
/// Smaller errors than this are no swings, over the target.
const QUIET: f64 = 1e-3;

/// Looks whether the stress swings about its target.
#[derive(Clone, Copy, Debug, Default)]
struct Watch {
    /// What was missing at the last step, over the target.
    error: f64,
    swings: u32,
    /// The error with which the swings began.
    first: f64,
    /// Has the warning been given?
    warned: bool,
}

impl Watch {
    /// Records the error of a step; true when it is time to warn, once.
    fn swings(&mut self, error: f64) -> bool {
        let swings = error * self.error < 0.0 && error.abs() > QUIET;
        if !swings {
            (self.swings, self.first) = (0, error.abs());
        }
        self.swings += 1;
        self.error = error;
        let warn = !self.warned && self.swings > SWINGS && error.abs() >= self.first;
        self.warned |= warn;
        warn
    }
}

/// The servos of a running simulation.
#[derive(Clone, Debug)]
pub struct Servos {
    all: Vec<Servo>,
    watches: Vec<Watch>,
    memories: Vec<Memory>,
    /// By the indices of walls with a servo: forces since the last row of the history.
    forces: BTreeMap<usize, ForceSum>,
    /// Terms in any of `forces` since their digits were carried, at most.
    terms: u64,
    /// Half the thickness of the thinnest grain: no wall comes nearer to the other side [m].
    least_gap: f64,
    /// Warnings about servos that oscillate, one each.
    warnings: Vec<String>,
}

/// So many terms are summed before digits are carried: few of what an [`ExactSum`] holds.
const TERMS: u64 = 1 << 24;

impl Servos {
    /// At the start.
    pub fn new(all: Vec<Servo>, library: &Library) -> Self {
        let watches = vec![Watch::default(); all.len()];
        let memories = vec![Memory::default(); all.len()];
        let walls = all.iter().flat_map(|servo| &servo.walls);
        let forces = walls.map(|&wall| (wall, ForceSum::default())).collect();
        let least_gap = library.least_inscribed_radius();
        Self { all, watches, memories, forces, terms: 0, least_gap, warnings: Vec::new() }
    }

    /// The servo of a wall, and what it remembers.
    fn of_wall(&self, wall: usize) -> Option<(&Servo, &Memory)> {
        let mut all = self.all.iter().zip(&self.memories);
        all.find(|(servo, _)| servo.walls.contains(&wall))
    }

    /// Each servo with its errors over the last fifth of the stage, if there were any steps.
    fn in_the_end(&self) -> impl Iterator<Item = (&Servo, Errors)> {
        let late = self.memories.iter().map(|memory| memory.course.last_fifth());
        self.all.iter().zip(late).filter(|(_, late)| late.steps > 0.0)
    }

    /// The sums of the forces since the last row of the history, of all ranks, by wall. Collective.
    fn force_sums(&self, comm: &mut dyn Comm) -> BTreeMap<usize, ForceSum> {
        let mut all = self.forces.clone();
        let axes = all.values_mut().flat_map(|sum| &mut sum.axes);
        let mut limbs: Vec<i64> = axes
            .flat_map(|axis| {
                axis.carry();
                *axis.limbs()
            })
            .collect();
        comm.sum(&mut limbs);
        let axes = all.values_mut().flat_map(|sum| &mut sum.axes);
        for (axis, limbs) in axes.zip(limbs.chunks_exact(ExactSum::LIMBS)) {
            *axis = ExactSum::from_limbs(limbs);
            axis.carry();
        }
        all
    }

    /// The velocity of each wall [m/s] under the force [N] and the stiffness [N/m] that press on each servo.
    fn velocities(
        &mut self,
        Moment { step, dt, .. }: &Moment,
        pressed: &[[f64; 2]],
        cell: &Cell,
        walls: &[Wall],
    ) -> Result<Vec<(usize, Vec3)>, Lost> {
        let mut velocities = Vec::new();
        let memories = self.watches.iter_mut().zip(&mut self.memories);
        for ((servo, (watch, memory)), &[force, stiffness]) in
            self.all.iter().zip(memories).zip(pressed)
        {
            let area = servo.area(walls, cell);
            let pressed = Pressed { area, force, stiffness };
            let velocity = servo.velocity(&mut memory.state, &pressed, *dt);
            for &k in &servo.walls {
                let wall = &walls[k];
                let Room { gap, outside, width } = Room::of(wall, walls, cell)
                    .expect("the scene has checked that it is not tilted");
                let (stress, target) = (pressed.force / area, servo.stress);
                let name = || wall.name.clone();
                if gap < self.least_gap {
                    return Err(Lost::Closed { wall: name(), gap, stress, target });
                }
                if outside > width {
                    return Err(Lost::Open { wall: name(), stress, target });
                }
                // Along the wall it goes on as the scene says.
                velocities.push((k, wall.velocity_inwards(velocity)));
            }
            let error = pressed.force / (servo.stress * area) - 1.0;
            let now = Errors { steps: 1.0, sum: error, sizes: error.abs(), largest: error.abs() };
            memory.course.add(now);
            let before =
                if step.is_multiple_of(CHECK_EVERY) { Errors::default() } else { memory.recent };
            memory.recent = before.and(now);
            if watch.swings(error) {
                self.warnings.push(format!(
                    "the stress on wall {} has jumped from one side of its target to the other for {SWINGS} steps, \
                     and jumps no less: the servo is too quick for these grains. Set its `gain` = {:.2} or lower",
                    servo.names(walls),
                    0.5 * servo.gain,
                ));
            }
        }
        Ok(velocities)
    }
}

impl Drive for Servos {
    fn name(&self) -> &'static str {
        NAME
    }

    fn admit(&mut self, library: &Library) {
        self.least_gap = library.least_inscribed_radius();
    }

    /// What presses on the walls: the limbs of force and stiffness of each servo.
    fn sums(
        &self,
        moment: &Moment,
        particles: &Particles,
        contacts: &Contacts,
        law: &dyn ForceLaw,
    ) -> Vec<i64> {
        let servo_of = |wall| self.all.iter().position(|servo| servo.walls.contains(&wall));
        let sums = pressing((self.all.len(), servo_of), moment.dt, particles, contacts, law);
        sums.iter().flatten().flat_map(|sum| *sum.limbs()).collect()
    }

    fn steer(
        &mut self,
        moment: &Moment,
        sums: &[i64],
        cell: &Cell,
        walls: &mut [Wall],
    ) -> Result<(), DriveError> {
        let sums = ExactSum::values(sums);
        for (k, velocity) in self.velocities(moment, sums.as_chunks().0, cell, walls)? {
            walls[k].velocity = velocity;
        }
        Ok(())
    }

    /// Adds the forces of this moment on walls with servos to their sums.
    fn after_forces(&mut self, contacts: &Contacts, particles: &Particles) {
        let mut terms = 0;
        for (pair, force) in contacts.forces_on_walls(particles) {
            let Some(wall) = particles.wall_of(pair.b) else { continue };
            let Some(sum) = self.forces.get_mut(&wall) else { continue };
            if force.iter().all(|component| component.is_finite()) {
                for (axis, &component) in sum.axes.iter_mut().zip(force) {
                    axis.add(component);
                }
                terms += 1;
            }
        }
        self.terms += terms;
        let carries = self.terms > TERMS;
        for sum in self.forces.values_mut() {
            sum.steps += 1;
            if carries {
                sum.axes.iter_mut().for_each(ExactSum::carry);
            }
        }
        if carries {
            self.terms = 0;
        }
    }

    /// Of each servo the mean difference of its stress from the target since the last step that [`CHECK_EVERY`] divides; the
    /// largest of all, over the target.
    fn error(&self) -> Option<(&'static str, f64)> {
        // Before the first step nothing is known.
        let error = |memory: &Memory| {
            if memory.recent.steps > 0.0 { memory.recent.mean_size() } else { f64::INFINITY }
        };
        Some(("servo", self.memories.iter().map(error).fold(0.0, f64::max)))
    }

    /// The mean force on each wall with a servo over the steps since the row before.
    fn row(&mut self, wall_forces: &mut [Vec3], scheduled: bool, comm: &mut dyn Comm) {
        for (wall, sum) in self.force_sums(comm) {
            if sum.steps > 0 {
                let force = Vec3::from(sum.axes.each_ref().map(ExactSum::value));
                wall_forces[wall] = force / sum.steps as f64;
            }
        }
        if scheduled {
            self.forces.values_mut().for_each(|sum| *sum = ForceSum::default());
            self.terms = 0;
        }
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn kept(&self, walls: &[Wall]) -> Vec<Kept> {
        let kept = |(servo, late): (&Servo, Errors)| Kept {
            drive: "servo".to_owned(),
            of: servo.names(walls),
            unit: "Pa",
            target: servo.stress,
            mean: (1.0 + late.of_mean()) * servo.stress,
            steps: late.steps as u64,
            mean_error: late.mean_size(),
            largest_error: late.largest,
        };
        self.in_the_end().map(kept).collect()
    }

    fn last_warnings(&self, walls: &[Wall], _has_stopped: bool) -> Vec<String> {
        let is_off = |(_, late): &(&Servo, Errors)| {
            let mean = late.mean_size();
            mean > OFF_TARGET || mean.is_nan()
        };
        let warning = |(servo, late): (&Servo, Errors)| {
            format!(
                "wall {} has not kept its stress: {:.1} % off in the mean of the last fifth of the steps. {}",
                servo.names(walls),
                100.0 * late.mean_size(),
                if late.of_mean().abs() > 0.5 * late.mean_size() {
                    "Give it more steps, a higher `max_speed`, or grains that can bear the stress"
                } else {
                    "The grains knock on it: let them lose energy (`restitution`, `friction`, `global_damping`), strain \
                     them more slowly, or take a shorter time step; if it swings, a lower `gain`"
                },
            )
        };
        self.in_the_end().filter(is_off).map(warning).collect()
    }

    fn save(&self, walls: &[Wall], comm: &mut dyn Comm) -> Vec<SavedColumn> {
        let (mut names, mut force_sums, mut force_steps) = (Vec::new(), Vec::new(), Vec::new());
        let (mut targets, mut speeds, mut stiffnesses) = (Vec::new(), Vec::new(), Vec::new());
        let (mut recents, mut courses) = (Vec::new(), Vec::new());
        for (wall, forces) in self.force_sums(comm) {
            let Some((servo, Memory { state, course, recent })) = self.of_wall(wall) else {
                continue;
            };
            names.push(walls[wall].name.clone());
            targets.push(servo.stress);
            speeds.push(state.speed);
            stiffnesses.push(state.stiffness);
            recents.extend(recent.numbers());
            let mut parts: Vec<_> = course.0.iter().map(Errors::numbers).collect();
            parts.resize(PARTS, [0.0; 4]);
            courses.extend(parts.into_flattened());
            force_sums.extend(forces.axes.iter().flat_map(|axis| *axis.limbs()));
            force_steps.push(forces.steps);
        }
        vec![
            SavedColumn::new(WALL, Values::Texts(names)),
            SavedColumn::new(TARGET, Values::Reals(targets)),
            SavedColumn::new(SPEED, Values::Reals(speeds)),
            SavedColumn::new(STIFFNESS, Values::Reals(stiffnesses)),
            SavedColumn::new(RECENT, Values::Reals(recents)),
            SavedColumn::new(COURSE, Values::Reals(courses)),
            SavedColumn::new(FORCE_SUM, Values::Integers(force_sums)),
            SavedColumn::new(FORCE_STEPS, Values::Counts(force_steps)),
        ]
    }

    /// Servos go on as the walls of the same names did; in a new stage with what their law remembers only.
    fn resume(
        &mut self,
        saved: &SavedState,
        is_new_stage: bool,
        walls: &mut [Wall],
        is_root: bool,
    ) -> Result<(), DriveError> {
        let names = saved.texts(&WALL)?;
        let (speeds, stiffnesses) = (saved.reals(&SPEED)?, saved.reals(&STIFFNESS)?);
        let (recents, courses) = (saved.reals(&RECENT)?, saved.reals(&COURSE)?);
        let (force_sums, force_steps) = (saved.integers(&FORCE_SUM)?, saved.counts(&FORCE_STEPS)?);
        let row_of = |wall: usize| names.iter().position(|name| *name == walls[wall].name);
        for (servo, memory) in self.all.iter().zip(&mut self.memories) {
            let Some(row) = servo.walls.first().and_then(|&wall| row_of(wall)) else { continue };
            let state = State { speed: speeds[row], stiffness: stiffnesses[row] };
            *memory = Memory { state, ..Memory::default() };
            if !is_new_stage {
                let errors = |numbers: &[f64]| -> Vec<Errors> {
                    numbers.as_chunks().0.iter().map(Errors::of).collect()
                };
                memory.recent = errors(&recents[RECENT.width * row..][..RECENT.width])[0];
                let mut course = errors(&courses[COURSE.width * row..][..COURSE.width]);
                course.retain(|part| part.steps > 0.0);
                memory.course = Course(course);
            }
        }
        if is_new_stage {
            return Ok(());
        }
        for (&wall, forces) in &mut self.forces {
            let Some(row) = row_of(wall) else { continue };
            forces.steps = force_steps[row];
            if is_root {
                let limbs = &force_sums[FORCE_SUM.width * row..][..FORCE_SUM.width];
                let mut axes = limbs.chunks_exact(ExactSum::LIMBS).map(ExactSum::from_limbs);
                forces.axes = std::array::from_fn(|_| axes.next().unwrap_or_default());
            }
        }
        Ok(())
    }
}

/// A servo whose error is larger, over its target, is warned of.
const OFF_TARGET: f64 = 0.02;

/// Where a wall stands along the axis that it crosses [m].
pub(super) struct Room {
    /// From it to the wall, or the domain's side, that it faces.
    pub(super) gap: f64,
    /// How far it is out of the domain.
    pub(super) outside: f64,
    /// Of the domain.
    pub(super) width: f64,
}

impl Room {
    /// `None` of a wall that is no plane across an axis.
    pub(super) fn of(wall: &Wall, walls: &[Wall], cell: &Cell) -> Option<Self> {
        let (low, high) = (cell.low(), cell.high());
        let Across { axis, inwards, place } = wall.across()?;
        let [lowest, highest] = ends(walls, axis);
        let (place, own, facing) = if inwards > 0.0 {
            (place, low[axis], highest.unwrap_or(high[axis]))
        } else {
            (-place, -high[axis], -lowest.unwrap_or(low[axis]))
        };
        Some(Self { gap: facing - place, outside: own - place, width: high[axis] - low[axis] })
    }
}
