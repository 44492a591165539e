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
//! Of a packing without friction and dashpots only the walls take energy: it knocks on them for long (125 balls: 6 % off in the
//! mean after 50,000 steps at a third of the stable one, 0.3 % after 200,000), and the report at the end says so. Coupled walls
//! keep the mean of their stresses; each may be off it by what friction and inertia bear between them.
//!
//! Forces and stiffnesses are summed exactly and once per step, while the particles move: the same bits on
//! any number of ranks. They come from what contacts remember; integral, stiffness, and the sums over steps from which
//! means are made, are saved in snapshots.

use crate::comm::Comm;
use crate::contacts::Contacts;
use crate::law::ForceLaw;
use crate::math::{ExactSum, Vec3};
use crate::particles::walls::{Wall, area, ends};
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
    /// Sum of the areas of its walls [m²].
    fn area(&self, particles: &Particles) -> f64 {
        let of_wall = |&k: &usize| {
            let (axis, _) = particles.walls[k].across()?;
            area(&particles.walls, &particles.cell, axis)
        };
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
pub struct Errors {
    /// How many steps, a whole number.
    pub steps: f64,
    /// Sum of the errors.
    pub sum: f64,
    /// Sum of their magnitudes.
    pub sizes: f64,
    /// The largest magnitude.
    pub largest: f64,
}

impl Errors {
    fn and(self, other: Self) -> Self {
        Self {
            steps: self.steps + other.steps,
            sum: self.sum + other.sum,
            sizes: self.sizes + other.sizes,
            largest: self.largest.max(other.largest),
        }
    }

    /// Mean magnitude of the errors.
    pub fn mean_size(&self) -> f64 {
        self.sizes / self.steps
    }

    /// The error of the mean stress.
    pub fn of_mean(&self) -> f64 {
        self.sum / self.steps
    }
}

/// The most parts of a stage that are told apart.
pub const PARTS: usize = 40;

/// The errors of a stage in equal parts, of which the last may still grow: when there are [`PARTS`], two become one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course(pub Vec<Errors>);

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
    pub fn last_fifth(&self) -> Errors {
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

/// Steps over which a stage's `[stop]` takes the mean error of a servo.
pub const RECENT: u64 = 100;

/// All that a servo remembers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory {
    /// Of its law.
    pub state: State,
    /// Its errors since the stage began.
    pub course: Course,
    /// Its errors since the last step that [`RECENT`] divides.
    pub recent: Errors,
}

/// The sum of the forces of the particles on a wall over steps, of the contacts of one rank.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ForceSum {
    /// Sums along x, y, z [N].
    pub axes: [ExactSum; 3],
    /// Over how many steps.
    pub steps: u64,
}

/// A servo cannot reach its target, or loses it. Known on all ranks.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ServoError {
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

/// Steps on end in which the stress must jump from one side of its target to the other, and jump no less,
/// before a servo is said to swing.
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
    told: bool,
}

impl Watch {
    /// Notes the error of a step; true when it is time to speak, once.
    fn swings(&mut self, error: f64) -> bool {
        let swings = error * self.error < 0.0 && error.abs() > QUIET;
        if !swings {
            (self.swings, self.first) = (0, error.abs());
        }
        self.swings += 1;
        self.error = error;
        let speak = !self.told && self.swings > SWINGS && error.abs() >= self.first;
        self.told |= speak;
        speak
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
    /// What is to be said, once, of servos that swing.
    pub warnings: Vec<String>,
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

    /// Each servo and what it remembers.
    pub fn iter(&self) -> impl Iterator<Item = (&Servo, &Memory)> {
        self.all.iter().zip(&self.memories)
    }

    /// The servo of a wall, and what it remembers.
    pub fn of_wall(&self, wall: usize) -> Option<(&Servo, &Memory)> {
        self.iter().find(|(servo, _)| servo.walls.contains(&wall))
    }

    /// The servo that begins with this wall goes on with that memory.
    pub fn resume(&mut self, wall: usize, memory: Memory) {
        let servo = self.all.iter().position(|servo| servo.walls.first() == Some(&wall));
        if let Some(servo) = servo {
            self.memories[servo] = memory;
        }
    }

    /// The forces on a wall that were summed before, of all ranks: one rank takes them.
    pub fn resume_forces(&mut self, wall: usize, sum: ForceSum, is_root: bool) {
        if let Some(forces) = self.forces.get_mut(&wall) {
            forces.steps = sum.steps;
            if is_root {
                forces.axes = sum.axes;
            }
        }
    }

    /// Adds the forces of this moment on walls with servos to their sums.
    pub fn note_forces(&mut self, contacts: &Contacts, particles: &Particles) {
        if self.all.is_empty() {
            return;
        }
        let mut terms = 0;
        for (pair, force) in contacts.forces_on_walls(particles) {
            let wall = pair.b.index() - particles.first_wall();
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

    /// The sums of the forces since [`Servos::forget_forces`], of all ranks, by wall. Collective, if there are servos.
    pub fn force_sums(&self, comm: &mut dyn Comm) -> BTreeMap<usize, ForceSum> {
        let mut all = self.forces.clone();
        if all.is_empty() {
            return all;
        }
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

    /// Begins the sums of forces anew.
    pub fn forget_forces(&mut self) {
        self.forces.values_mut().for_each(|sum| *sum = ForceSum::default());
        self.terms = 0;
    }

    /// Begins to sum what presses on the walls now. Collective, if there are servos.
    pub fn start_sums(
        &self,
        contacts: &Contacts,
        particles: &Particles,
        law: &dyn ForceLaw,
        dt: f64,
        comm: &mut dyn Comm,
    ) {
        if self.all.is_empty() {
            return;
        }
        let servo_of = |wall| self.all.iter().position(|servo| servo.walls.contains(&wall));
        let servo_of: Vec<Option<usize>> = (0..particles.walls.len()).map(servo_of).collect();
        let mut sums = vec![[ExactSum::default(), ExactSum::default()]; self.all.len()];
        for (pair, geometry, force) in contacts.pressing_on_walls(law, particles) {
            let wall = pair.b.index() - particles.first_wall();
            let Some(servo) = servo_of[wall] else { continue };
            // A state that is not a number is told when the list of pairs is made anew.
            if force.is_finite() {
                sums[servo][0].add(force);
                sums[servo][1].add(law.stiffness(pair, particles, geometry, dt));
            }
        }
        comm.start_sum(sums.iter().flatten().flat_map(|sum| *sum.limbs()).collect());
    }

    /// Gives the walls their velocities for the step after `step`, from the sums that [`Servos::start_sums`] began. The
    /// domain reaches from `low` to `high` [m]. Collective, if there are servos.
    ///
    /// # Errors
    /// If a wall has gone where it cannot keep its stress.
    pub fn steer(
        &mut self,
        particles: &mut Particles,
        [low, high]: [&Vec3; 2],
        step: u64,
        dt: f64,
        comm: &mut dyn Comm,
    ) -> Result<(), ServoError> {
        if self.all.is_empty() {
            return Ok(());
        }
        let limbs = comm.finish_sum();
        let mut sums =
            limbs.chunks_exact(ExactSum::LIMBS).map(|limbs| ExactSum::from_limbs(limbs).value());
        let mut sum = || sums.next().unwrap_or_default();
        let mut velocities = Vec::new();
        let memories = self.watches.iter_mut().zip(&mut self.memories);
        for (servo, (watch, memory)) in self.all.iter().zip(memories) {
            let area = servo.area(particles);
            let pressed = Pressed { area, force: sum(), stiffness: sum() };
            let velocity = servo.velocity(&mut memory.state, &pressed, dt);
            for &k in &servo.walls {
                let wall = &particles.walls[k];
                let Room { gap, outside, width } = Room::of(wall, &particles.walls, low, high);
                let (stress, target) = (pressed.force / area, servo.stress);
                let name = || wall.name.clone();
                if gap < self.least_gap {
                    return Err(ServoError::Closed { wall: name(), gap, stress, target });
                }
                if outside > width {
                    return Err(ServoError::Open { wall: name(), stress, target });
                }
                // Along the wall it goes on as the scene says.
                let along = wall.velocity - wall.normal * wall.normal.dot(&wall.velocity);
                velocities.push((k, wall.normal * velocity + along));
            }
            let error = pressed.force / (servo.stress * area) - 1.0;
            let now = Errors { steps: 1.0, sum: error, sizes: error.abs(), largest: error.abs() };
            memory.course.add(now);
            let before =
                if step.is_multiple_of(RECENT) { Errors::default() } else { memory.recent };
            memory.recent = before.and(now);
            if watch.swings(error) {
                let walls = servo.walls.iter().map(|&k| &*particles.walls[k].name);
                self.warnings.push(format!(
                    "the stress on wall {} has jumped from one side of its target to the other for {SWINGS} steps, \
                     and jumps no less: the servo is too quick for these grains. Set its `gain` = {:.2} or lower",
                    walls.collect::<Vec<_>>().join(", "),
                    0.5 * servo.gain,
                ));
            }
        }
        for (k, velocity) in velocities {
            particles.walls[k].velocity = velocity;
        }
        Ok(())
    }

    /// Of each servo the mean difference of its stress from the target over the last [`RECENT`] steps, or those since the
    /// last that [`RECENT`] divides; the largest of all, over the target. 0 without servos.
    pub fn largest_error(&self) -> f64 {
        // Before the first step nothing is known.
        let error = |memory: &Memory| {
            if memory.recent.steps > 0.0 { memory.recent.mean_size() } else { f64::INFINITY }
        };
        self.memories.iter().map(error).fold(0.0, f64::max)
    }
}

/// Where a wall stands along the axis that it crosses [m].
struct Room {
    /// From it to the wall, or the domain's side, that it faces.
    gap: f64,
    /// How far it is out of the domain.
    outside: f64,
    /// Of the domain.
    width: f64,
}

impl Room {
    fn of(wall: &Wall, walls: &[Wall], low: &Vec3, high: &Vec3) -> Self {
        let (axis, inwards) = wall.across().expect("the scene has checked that it is not tilted");
        let [lowest, highest] = ends(walls, axis);
        let (place, own, facing) = if inwards > 0.0 {
            (wall.point[axis], low[axis], highest.unwrap_or(high[axis]))
        } else {
            (-wall.point[axis], -high[axis], -lowest.unwrap_or(low[axis]))
        };
        Self { gap: facing - place, outside: own - place, width: high[axis] - low[axis] }
    }
}
