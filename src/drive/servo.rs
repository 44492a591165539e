//! Walls that keep a stress or a force: the servo of numerical triaxial tests (the paper, section 3.1).
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
//! A servo of force moves any wall along a direction `a`: `e = target + F·a`, with the force `F` of all contacts on the wall,
//! friction included. The same law has no area then. A contact of normal `n` counts in `K` with `(n·a)²`, for so much
//! nearer it comes. Where there is friction all of it counts: what sticks resists sliding, too, about as much, and more `K` only
//! makes the wall slower. With `a` along the normal of a plane both servos are one.
//!
//! Forces and stiffnesses are summed exactly and once per step, while the particles move: the same bits on
//! any number of ranks. Normal forces and stiffnesses come from what contacts remember; whole forces along directions, integral,
//! stiffness, and the sums over steps from which means are made, are saved in snapshots.

use super::{
    CHECK_EVERY, Drive, DriveError, Kept, Moment, SavedColumn, SavedState, Values, pressing,
};
use crate::cell::Cell;
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::contacts::Contacts;
use crate::law::{ForceLaw, Sums};
use crate::math::{ExactSum, Vec3};
use crate::particles::walls::{Across, Wall, area, ends};
use crate::particles::{Library, Particles};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::{Display, Formatter};

/// What a servo keeps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Goal {
    /// A stress on planes, each across an axis; compression positive [Pa].
    Stress(f64),
    /// The force with which each wall presses on the particles along a direction.
    Force {
        /// How much, in the mean of coupled walls [N].
        newtons: f64,
        /// The direction, a unit vector; `None`: the normal of a wall of one plane, where it stands.
        along: Option<Vec3>,
    },
}

impl Goal {
    /// What it is in a word, the key of a scene, with its unit and how much of it.
    pub const fn target(&self) -> (&'static str, &'static str, f64) {
        match *self {
            Self::Stress(pascals) => ("stress", "Pa", pascals),
            Self::Force { newtons, .. } => ("force", "N", newtons),
        }
    }

    /// The direction in which a wall presses, a unit vector.
    pub fn along(&self, wall: &Wall) -> Vec3 {
        match *self {
            Self::Force { along: Some(along), .. } => along,
            _ => wall.surface().1,
        }
    }

    /// The velocity of a wall that goes with `speed` in that direction and across it as its `own` velocity says [m/s].
    pub fn velocity(&self, wall: &Wall, own: &Vec3, speed: f64) -> Vec3 {
        match self {
            Self::Stress(_) => wall.velocity_inwards(speed),
            Self::Force { .. } => {
                let along = self.along(wall);
                own - along * own.dot(&along) + along * speed
            }
        }
    }

    const fn is_force(&self) -> bool {
        matches!(self, Self::Force { .. })
    }
}

/// Walls that move with one velocity so as to keep a stress or a force.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Servo {
    /// Indices of walls; of coupled walls more than one.
    pub walls: Vec<usize>,
    /// What they keep.
    pub goal: Goal,
    /// The fastest that the walls move [m/s].
    pub max_speed: f64,
    /// Factor on how quickly the walls answer: less is slower and softer [-].
    pub gain: f64,
}

/// What presses on the walls of a servo.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pressed {
    /// Sum of the areas [m²]; of no account to a servo of force.
    pub area: f64,
    /// Sum of the normal forces, or of the forces against the directions of the walls [N].
    pub force: f64,
    /// Sum of the stiffness of the contacts [N/m]; 0 where nothing touches.
    pub stiffness: f64,
}

impl Servo {
    /// The names of its walls.
    pub fn names(&self, walls: &[Wall]) -> String {
        self.walls.iter().map(|&k| &*walls[k].name).collect::<Vec<_>>().join(", ")
    }

    /// Sum of the areas of its walls [m²], if it keeps a stress.
    pub fn area(&self, walls: &[Wall], cell: &Cell) -> f64 {
        let of_wall = |&k: &usize| area(walls, cell, walls[k].across()?.axis);
        // The scene has checked that every wall has one.
        self.walls.iter().filter_map(of_wall).sum()
    }

    /// What the sum of the forces on its walls is divided by to be what it keeps: their area [m²], or how many they are.
    fn divisor(&self, area: f64) -> f64 {
        match self.goal {
            Goal::Stress(_) => area,
            Goal::Force { .. } => self.walls.len() as f64,
        }
    }

    /// The sum of the forces that it is to keep [N].
    fn load(&self, area: f64) -> f64 {
        let (.., target) = self.goal.target();
        target * self.divisor(area)
    }

    /// How fast the walls move towards the particles in a step of `dt` [s], in m/s.
    pub fn velocity(&self, state: &mut State, pressed: &Pressed, dt: f64) -> f64 {
        if pressed.stiffness > 0.0 {
            state.stiffness = pressed.stiffness;
        }
        if state.stiffness == 0.0 {
            return self.max_speed;
        }
        let missing = self.load(pressed.area) - pressed.force;
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

/// How a servo kept its target over steps on end; errors are (stress - target) / target, or the same of forces.
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
/// Target stress, compression positive; 0 of a servo of force.
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
// Where there is a servo of force, besides:
/// Target force; 0 of a servo of stress.
const TARGET_FORCE: StateColumn = StateColumn::new("target_force", 1, "N");
/// [`Goal::along`].
const ALONG: StateColumn = StateColumn::new("along", 3, "");
/// [`Servos::pressing`] of all ranks, exactly.
const PRESSING: StateColumn = StateColumn::new("pressing", ExactSum::LIMBS, "2^(32 k - 1074) N");

/// The stress that a wall is to keep.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The wall's name.
    pub wall: String,
    /// Compression positive [Pa].
    pub stress: f64,
}

/// The targets of all walls with a servo of stress, from what the drives of a simulation have saved.
pub fn targets(saved: &[SavedState]) -> Vec<Target> {
    let read = || {
        let saved = saved.iter().find(|saved| saved.drive == NAME)?;
        let (walls, stresses) = (saved.texts(&WALL).ok()?, saved.reals(&TARGET).ok()?);
        let target = |(wall, &stress): (&String, &f64)| Target { wall: wall.clone(), stress };
        let of_stress = |target: &Target| target.stress > 0.0;
        Some(walls.iter().zip(stresses).map(target).filter(of_stress).collect())
    };
    read().unwrap_or_default()
}

/// Names [`Servos`] among the drives.
const NAME: &str = "servos";

/// What a servo has and what it is to have.
#[derive(Clone, Copy, Debug)]
struct Reached {
    goal: Goal,
    now: f64,
}

impl Reached {
    /// The key of what it keeps.
    const fn key(&self) -> &'static str {
        self.goal.target().0
    }
}

impl Display for Reached {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        let (what, unit, target) = self.goal.target();
        write!(f, "its {what} is {:e} {unit} of {target:e} {unit}", self.now)
    }
}

/// A servo cannot reach its target, or loses it.
#[derive(Debug, thiserror::Error)]
enum Lost {
    /// The wall has come so near to the opposite side that nothing fits between.
    #[error(
        "servo: wall \"{wall}\" is {gap:e} m from the opposite side, less than half the thickness of the thinnest \
         grain, and {reached}. There are too few grains between its walls to reach \
         the target, they have escaped, or they are too soft for it: put more in, lower `{}`, or raise \
         `normal_stiffness`",
        .reached.key()
    )]
    Closed {
        /// Its name.
        wall: String,
        /// Distance of the opposite wall, or of the domain's side [m].
        gap: f64,
        reached: Reached,
    },
    /// The wall has been pushed far out of the domain.
    #[error(
        "servo: wall \"{wall}\" has moved out of the domain by more than its width, and {reached}. Something pushes harder \
         than the target, such as the grains' weight: raise `{}`, or let the wall stand",
        .reached.key()
    )]
    Open {
        /// Its name.
        wall: String,
        reached: Reached,
    },
    /// A surface has gone far out of the domain, on whatever side.
    #[error(
        "servo: wall \"{wall}\" is out of the domain by more than its width, and {reached}. It has passed where it met too few \
         grains, or they have pushed it out: put grains where they bear it, or change `along` or `force`"
    )]
    Gone {
        /// Its name.
        wall: String,
        reached: Reached,
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
    /// Of servos of force the sum of the forces of this rank's contacts against the directions of their walls, at the positions of
    /// now [N].
    pressing: Vec<ExactSum>,
    /// Has it been noted? A servo that is new within a stage, or has another direction, has normal forces for it in its first step.
    has_noted: Vec<bool>,
    /// By their indices, the velocities that the scene gives to walls with a servo [m/s].
    own: BTreeMap<usize, Vec3>,
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
    /// At the start, with the velocities that the walls of the scene have.
    pub fn new(all: Vec<Servo>, walls: &[Wall], library: &Library) -> Self {
        let watches = vec![Watch::default(); all.len()];
        let memories = vec![Memory::default(); all.len()];
        let pressing = vec![ExactSum::default(); all.len()];
        let has_noted = vec![false; all.len()];
        let steered = || all.iter().flat_map(|servo| &servo.walls);
        let own = steered().map(|&wall| (wall, walls[wall].velocity)).collect();
        let forces = steered().map(|&wall| (wall, ForceSum::default())).collect();
        let least_gap = library.least_inscribed_radius();
        let warnings = Vec::new();
        Self {
            all,
            watches,
            memories,
            pressing,
            has_noted,
            own,
            forces,
            terms: 0,
            least_gap,
            warnings,
        }
    }

    /// The number of the servo of a wall.
    fn of_wall(&self, wall: usize) -> Option<usize> {
        self.all.iter().position(|servo| servo.walls.contains(&wall))
    }

    /// Is there one of force?
    fn has_force(&self) -> bool {
        self.all.iter().any(|servo| servo.goal.is_force())
    }

    /// Of each wall with a servo of force the number of the servo, and the wall's direction.
    fn lines(&self, walls: &[Wall]) -> Vec<Option<(usize, Vec3)>> {
        let line = |(k, wall): (usize, &Wall)| {
            let servo = self.of_wall(k)?;
            let goal = &self.all[servo].goal;
            goal.is_force().then(|| (servo, goal.along(wall)))
        };
        walls.iter().enumerate().map(line).collect()
    }

    /// Takes note of the forces of this rank's contacts against the directions of walls.
    fn note_pressing(&mut self, contacts: &Contacts, particles: &Particles) {
        if !self.has_force() {
            return;
        }
        let lines = self.lines(&particles.walls);
        self.pressing.fill(ExactSum::default());
        self.has_noted.fill(true);
        for (pair, force) in contacts.forces_on_walls(particles) {
            let Some((servo, along)) = particles.wall_of(pair.b).and_then(|wall| lines[wall])
            else {
                continue;
            };
            let against = -force.dot(&along);
            // A state that is not a number is reported when the list of pairs is rebuilt.
            if against.is_finite() {
                self.pressing[servo].add(against);
            }
        }
    }

    /// The same of all ranks, limbs after limbs. Collective.
    fn pressing_of_all(&self, comm: &mut dyn Comm) -> Vec<i64> {
        let carried = |sum: &ExactSum| {
            let mut sum = sum.clone();
            sum.carry();
            *sum.limbs()
        };
        let mut limbs: Vec<i64> = self.pressing.iter().flat_map(carried).collect();
        comm.sum(&mut limbs);
        limbs
            .chunks_exact(ExactSum::LIMBS)
            .flat_map(|row| carried(&ExactSum::from_limbs(row)))
            .collect()
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
            let reached = Reached { goal: servo.goal, now: force / servo.divisor(area) };
            for &k in &servo.walls {
                let wall = &walls[k];
                check_place(wall, (walls, cell), self.least_gap, reached)?;
                // Across its direction it goes on as the scene says.
                velocities.push((k, servo.goal.velocity(wall, &self.own[&k], velocity)));
            }
            let error = force / servo.load(area) - 1.0;
            let now = Errors { steps: 1.0, sum: error, sizes: error.abs(), largest: error.abs() };
            memory.course.add(now);
            let before =
                if step.is_multiple_of(CHECK_EVERY) { Errors::default() } else { memory.recent };
            memory.recent = before.and(now);
            if watch.swings(error) {
                let (what, ..) = servo.goal.target();
                self.warnings.push(format!(
                    "the {what} on wall {} has jumped from one side of its target to the other for {SWINGS} steps, \
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
        let lines = self.lines(&particles.walls);
        let needs = law.needs();
        let sticks = needs.friction || needs.tangential_dashpots;
        let part = |wall: usize, normal: &Vec3| match lines[wall] {
            Some((_, along)) if !sticks => normal.dot(&along).powi(2),
            _ => 1.0,
        };
        let groups = (self.all.len(), |wall| self.of_wall(wall));
        let mut sums = pressing(groups, moment.dt, particles, contacts, law, part);
        for (k, [force, _]) in sums.iter_mut().enumerate() {
            if self.all[k].goal.is_force() && self.has_noted[k] {
                *force = self.pressing[k].clone();
            }
        }
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

    fn first_forces(&mut self, contacts: &Contacts, particles: &Particles) {
        self.note_pressing(contacts, particles);
    }

    /// One that comes towards grains, of which none touches it yet.
    fn under_way(&self, walls: &[Wall], wall_forces: &[Vec3]) -> Option<String> {
        let is_free = |servo: &&Servo| servo.walls.iter().all(|&k| wall_forces[k] == Vec3::zeros());
        let servo = self.all.iter().find(is_free)?;
        Some(format!("wall {} has a servo, and no grain touches it", servo.names(walls)))
    }

    /// Adds the forces of this moment on walls with servos to their sums.
    fn after_forces(&mut self, contacts: &Contacts, particles: &Particles, _sums: &Sums) {
        self.note_pressing(contacts, particles);
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

    /// Of each servo the mean difference of its stress or force from the target since the last step that [`CHECK_EVERY`] divides; the
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
        self.in_the_end().map(kept).collect()
    }

    fn last_warnings(&self, walls: &[Wall], _has_stopped: bool) -> Vec<String> {
        let is_off = |(_, late): &(&Servo, Errors)| {
            let mean = late.mean_size();
            mean > OFF_TARGET || mean.is_nan()
        };
        let warning = |(servo, late): (&Servo, Errors)| {
            let (what, ..) = servo.goal.target();
            let advice = if late.of_mean().abs() > 0.5 * late.mean_size() {
                format!(
                    "Give it more steps, a higher `max_speed`, or grains that can bear the {what}"
                )
            } else {
                "The grains knock on it: let them lose energy (`restitution`, `friction`, `global_damping`), strain \
                 them more slowly, or take a shorter time step; if it swings, a lower `gain`"
                    .to_owned()
            };
            format!(
                "wall {} has not kept its {what}: {:.1} % off in the mean of the last fifth of the steps. {advice}",
                servo.names(walls),
                100.0 * late.mean_size(),
            )
        };
        self.in_the_end().filter(is_off).map(warning).collect()
    }

    fn save(&self, walls: &[Wall], comm: &mut dyn Comm) -> Vec<SavedColumn> {
        let (mut names, mut force_sums, mut force_steps) = (Vec::new(), Vec::new(), Vec::new());
        let (mut targets, mut speeds, mut stiffnesses) = (Vec::new(), Vec::new(), Vec::new());
        let (mut recents, mut courses) = (Vec::new(), Vec::new());
        let (mut target_forces, mut lines, mut pressing) = (Vec::new(), Vec::new(), Vec::new());
        let pressing_of_all =
            if self.has_force() { self.pressing_of_all(comm) } else { Vec::new() };
        for (wall, forces) in self.force_sums(comm) {
            let Some(k) = self.of_wall(wall) else { continue };
            let (goal, Memory { state, course, recent }) = (&self.all[k].goal, &self.memories[k]);
            names.push(walls[wall].name.clone());
            let [stress, force] = match *goal {
                Goal::Stress(stress) => [stress, 0.0],
                Goal::Force { newtons, .. } => [0.0, newtons],
            };
            targets.push(stress);
            if self.has_force() {
                target_forces.push(force);
                lines.extend(goal.along(&walls[wall]).iter().copied());
                pressing.extend(&pressing_of_all[PRESSING.width * k..][..PRESSING.width]);
            }
            speeds.push(state.speed);
            stiffnesses.push(state.stiffness);
            recents.extend(recent.numbers());
            let mut parts: Vec<_> = course.0.iter().map(Errors::numbers).collect();
            parts.resize(PARTS, [0.0; 4]);
            courses.extend(parts.into_flattened());
            force_sums.extend(forces.axes.iter().flat_map(|axis| *axis.limbs()));
            force_steps.push(forces.steps);
        }
        let mut columns = vec![
            SavedColumn::new(WALL, Values::Texts(names)),
            SavedColumn::new(TARGET, Values::Reals(targets)),
            SavedColumn::new(SPEED, Values::Reals(speeds)),
            SavedColumn::new(STIFFNESS, Values::Reals(stiffnesses)),
            SavedColumn::new(RECENT, Values::Reals(recents)),
            SavedColumn::new(COURSE, Values::Reals(courses)),
            SavedColumn::new(FORCE_SUM, Values::Integers(force_sums)),
            SavedColumn::new(FORCE_STEPS, Values::Counts(force_steps)),
        ];
        if self.has_force() {
            columns.extend([
                SavedColumn::new(TARGET_FORCE, Values::Reals(target_forces)),
                SavedColumn::new(ALONG, Values::Reals(lines)),
                SavedColumn::new(PRESSING, Values::Integers(pressing)),
            ]);
        }
        columns
    }

    /// Servos go on as the walls of the same names did; in a new stage with what their law remembers only, and along another direction
    /// with what they had along that.
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
        // Servos of stress alone have none: they went along normals.
        let lines = saved.reals(&ALONG).ok();
        let pressing_of_all = saved.integers(&PRESSING).ok().zip(saved.reals(&TARGET_FORCE).ok());
        let row_of = |wall: usize| names.iter().position(|name| *name == walls[wall].name);
        for (k, (servo, memory)) in self.all.iter().zip(&mut self.memories).enumerate() {
            let Some(&wall) = servo.walls.first() else { continue };
            let Some(row) = row_of(wall) else { continue };
            let along = servo.goal.along(&walls[wall]);
            let before = lines.map(|lines| &lines[ALONG.width * row..][..ALONG.width]);
            let before = before.map_or_else(|| walls[wall].surface().1, Vec3::from_column_slice);
            let part = if before == along { 1.0 } else { before.dot(&along) };
            let state = State { speed: speeds[row] * part, stiffness: stiffnesses[row] };
            *memory = Memory { state, ..Memory::default() };
            if !is_new_stage {
                if let Some((pressing, targets)) = pressing_of_all
                    && servo.goal.is_force()
                    && targets[row] != 0.0
                    && before == along
                {
                    self.has_noted[k] = true;
                    if is_root {
                        let limbs = &pressing[PRESSING.width * row..][..PRESSING.width];
                        self.pressing[k] = ExactSum::from_limbs(limbs);
                    }
                }
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

/// Is a wall with a servo where it can press on something?
fn check_place(
    wall: &Wall,
    (walls, cell): (&[Wall], &Cell),
    least_gap: f64,
    reached: Reached,
) -> Result<(), Lost> {
    let name = || wall.name.clone();
    if wall.is_far_out_of(cell) {
        return Err(Lost::Gone { wall: name(), reached });
    }
    let room = Room::of(wall, walls, cell).or_else(|| Room::before(wall, cell));
    let Some(Room { gap, outside, width }) = room else { return Ok(()) };
    if gap < least_gap {
        return Err(Lost::Closed { wall: name(), gap, reached });
    }
    if outside > width {
        return Err(Lost::Open { wall: name(), reached });
    }
    Ok(())
}

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

    /// Of planes that stand across no axis: what they leave of the domain. `None` of triangles.
    fn before(wall: &Wall, cell: &Cell) -> Option<Self> {
        let domain = (cell.low(), cell.high());
        let gap = wall.room_before(&domain)?;
        Some(Self { gap, outside: -wall.depth(&domain), width: (domain.1 - domain.0).norm() })
    }
}
