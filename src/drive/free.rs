//! Walls with a mass that their weight, a stated force and the grains move along a line: a lid on a bed, a piston, a tray on grains.
//!
//! The way of the wall is found as that of grains is: `v(t + dt/2) = v(t - dt/2) + F(t) dt / m`, then `x(t + dt) = x(t) + v(t + dt/2) dt`,
//! of second order in `dt`. `F` is the sum of the wall's weight, the stated force and the forces of all contacts on the wall, along the line;
//! across it, and against turning, the wall is held. Contact forces are summed exactly: the same bits on any number of ranks. The
//! sum of the last step and the velocity are saved in snapshots.
//!
//! A light wall on many grains takes shorter steps than the grains do: it swings with `√(K/m)`, `K` being the stiffness of all its
//! contacts together. Where `dt √(K/m)` comes over 1 the run warns, over 2 it stops.

use super::servo::Room;
use super::{Drive, DriveError, Moment, SavedColumn, SavedState, Values, pressing};
use crate::cell::Cell;
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::contacts::Contacts;
use crate::law::{ForceLaw, Sums};
use crate::math::{ExactSum, Vec3};
use crate::particles::walls::{Across, Wall, area};
use crate::particles::{Library, Particles};
use serde::{Deserialize, Serialize};

/// A wall that moves freely along a line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FreeWall {
    /// Its index.
    pub wall: usize,
    /// The direction of the line, a unit vector.
    pub along: Vec3,
    /// Mass [kg].
    pub mass: f64,
    /// Weight and stated force along the line [N].
    pub load: f64,
}

impl FreeWall {
    /// What it presses on the grains with where all of its load lies on them [Pa]; `None` if it does not press, or if its area is not known. Held
    /// across its direction, it presses with its load over the cosine of the angle between that and its normal.
    pub fn stress(&self, walls: &[Wall], cell: &Cell) -> Option<f64> {
        let Across { axis, inwards, .. } = walls[self.wall].across()?;
        let cosine = self.along[axis] * inwards;
        let presses = self.load * cosine > 0.0;
        Some(self.load / cosine / area(walls, cell, axis)?).filter(|_| presses)
    }
}

/// What it goes on with from step to step.
#[derive(Clone, Debug, Default, PartialEq)]
struct State {
    /// Velocity along the line in the last step [m/s]; `None` before the first.
    speed: Option<f64>,
    /// That of the scene, with which it begins [m/s].
    first_speed: f64,
    /// Velocity across the line, as the scene says [m/s].
    across: Vec3,
    /// The force of this rank's contacts on the wall along the line, at the positions of now [N].
    force: ExactSum,
    /// Has it been warned of?
    warned: bool,
}

// What a snapshot holds: a row for each free wall.
/// The wall's name in the scene.
const WALL: StateColumn = StateColumn::new("wall", 1, "");
/// [`State::speed`]; not a number before the first step.
const SPEED: StateColumn = StateColumn::new("speed", 1, "m/s");
/// [`FreeWall::along`].
const ALONG: StateColumn = StateColumn::new("along", 3, "");
/// [`State::force`] of all ranks, exactly.
const FORCE: StateColumn = StateColumn::new("force", ExactSum::LIMBS, "2^(32 k - 1074) N");

/// Over this `dt √(K/m)` the run warns.
const COARSE: f64 = 1.0;
/// From here on the wall's swinging grows.
const UNSTABLE: f64 = 2.0;

/// The free walls of a running simulation.
#[derive(Clone, Debug)]
pub struct FreeWalls {
    all: Vec<FreeWall>,
    states: Vec<State>,
    /// Half the thickness of the thinnest grain: no wall comes nearer to the other side [m].
    least_gap: f64,
    warnings: Vec<String>,
}

impl FreeWalls {
    /// At the start, with the velocities that the walls of the scene have.
    pub fn new(all: Vec<FreeWall>, walls: &[Wall], library: &Library) -> Self {
        let state = |&FreeWall { wall, along, .. }: &FreeWall| {
            let velocity = walls[wall].velocity;
            let first_speed = velocity.dot(&along);
            State { first_speed, across: velocity - along * first_speed, ..State::default() }
        };
        let states = all.iter().map(state).collect();
        Self { all, states, least_gap: library.least_inscribed_radius(), warnings: Vec::new() }
    }

    /// Takes note of the force of this rank's contacts on each wall along its line.
    fn note_forces(&mut self, contacts: &Contacts, particles: &Particles) {
        let Self { all, states, .. } = self;
        for state in &mut *states {
            state.force = ExactSum::default();
        }
        for (pair, force) in contacts.forces_on_walls(particles) {
            let Some(wall) = particles.wall_of(pair.b) else { continue };
            for (free, state) in all.iter().zip(&mut *states).filter(|(free, _)| free.wall == wall)
            {
                let along = force.dot(&free.along);
                // A state that is not a number is reported when the list of pairs is rebuilt.
                if along.is_finite() {
                    state.force.add(along);
                }
            }
        }
    }

    /// Looks whether a step can follow a wall on contacts of this stiffness [N/m].
    fn check_step(
        &mut self,
        k: usize,
        stiffness: f64,
        dt: f64,
        name: &str,
    ) -> Result<(), DriveError> {
        let mass = self.all[k].mass;
        let angle = dt * (stiffness / mass).sqrt();
        if angle < COARSE {
            return Ok(());
        }
        let said = format!(
            "wall \"{name}\" of {mass:e} kg swings on the grains that it touches by {angle:.2} rad in a step of {dt:.3e} s (their stiffness is \
             {stiffness:.3e} N/m in all)"
        );
        let better = format!("take a step of {:.2e} s, or a heavier wall", 0.2 * dt / angle);
        if angle >= UNSTABLE {
            return Err(DriveError(format!(
                "{said}, which makes it go farther each time: {better}"
            )));
        }
        if !std::mem::replace(&mut self.states[k].warned, true) {
            self.warnings.push(format!("{said}, which is coarse: {better}"));
        }
        Ok(())
    }
}

/// Names [`FreeWalls`] among the drives.
const NAME: &str = "free walls";

impl Drive for FreeWalls {
    fn name(&self) -> &'static str {
        NAME
    }

    fn admit(&mut self, library: &Library) {
        self.least_gap = library.least_inscribed_radius();
    }

    /// The limbs of force and stiffness of each wall.
    fn sums(
        &self,
        moment: &Moment,
        particles: &Particles,
        contacts: &Contacts,
        law: &dyn ForceLaw,
    ) -> Vec<i64> {
        let group = |wall| self.all.iter().position(|free| free.wall == wall);
        let groups = (self.all.len(), group);
        let pressed = pressing(groups, moment.dt, particles, contacts, law, |_, _| 1.0);
        let both = self.states.iter().zip(&pressed);
        both.flat_map(|(State { force, .. }, [_, stiffness])| {
            [*force.limbs(), *stiffness.limbs()].concat()
        })
        .collect()
    }

    fn steer(
        &mut self,
        moment: &Moment,
        sums: &[i64],
        cell: &Cell,
        walls: &mut [Wall],
    ) -> Result<(), DriveError> {
        let sums = ExactSum::values(sums);
        for (k, &[force, stiffness]) in sums.as_chunks().0.iter().enumerate() {
            let FreeWall { wall, along, mass, load } = self.all[k];
            self.check_step(k, stiffness, moment.dt, &walls[wall].name)?;
            let state = &mut self.states[k];
            // The velocity of the scene is that of the start, half a step before that of the first step.
            let (speed, dt) = match state.speed {
                Some(speed) => (speed, moment.dt),
                None => (state.first_speed, 0.5 * moment.dt),
            };
            let speed = speed + dt * (load + force) / mass;
            state.speed = Some(speed);
            walls[wall].velocity = state.across + along * speed;
            let place = match Room::of(&walls[wall], walls, cell) {
                Some(Room { gap, .. }) if gap < self.least_gap => "at the opposite side of",
                Some(Room { outside, width, .. }) if outside > width => "far out of",
                None if walls[wall].is_far_out_of(cell) => "far out of",
                _ => continue,
            };
            return Err(DriveError(format!(
                "wall \"{}\" moves freely and is {place} the domain, at {speed:.3e} m/s along its line: put grains where they \
                 bear it, or give it another `force`",
                walls[wall].name
            )));
        }
        Ok(())
    }

    fn first_forces(&mut self, contacts: &Contacts, particles: &Particles) {
        self.note_forces(contacts, particles);
    }

    fn after_forces(&mut self, contacts: &Contacts, particles: &Particles, _sums: &Sums) {
        self.note_forces(contacts, particles);
    }

    /// A wall that nothing bears, and that does not stand by itself.
    fn under_way(&self, walls: &[Wall], wall_forces: &[Vec3]) -> Option<String> {
        let is_under_way = |free: &&FreeWall| {
            let velocity = walls[free.wall].velocity;
            // Across its line it may slide.
            let stands =
                free.load == 0.0 && velocity.dot(&free.along).abs() <= 1e-9 * velocity.norm();
            wall_forces[free.wall] == Vec3::zeros() && !stands
        };
        let free = self.all.iter().find(is_under_way)?;
        Some(format!("wall \"{}\" moves freely, and no grain touches it", walls[free.wall].name))
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn save(&self, walls: &[Wall], comm: &mut dyn Comm) -> Vec<SavedColumn> {
        let (mut names, mut speeds, mut limbs) = (Vec::new(), Vec::new(), Vec::new());
        let lines = self.all.iter().flat_map(|free| free.along.iter().copied()).collect();
        for (free, state) in self.all.iter().zip(&self.states) {
            let mut force = state.force.clone();
            force.carry();
            names.push(walls[free.wall].name.clone());
            speeds.push(state.speed.unwrap_or(f64::NAN));
            limbs.extend(*force.limbs());
        }
        comm.sum(&mut limbs);
        for row in limbs.chunks_exact_mut(ExactSum::LIMBS) {
            let mut sum = ExactSum::from_limbs(row);
            sum.carry();
            row.copy_from_slice(sum.limbs());
        }
        vec![
            SavedColumn::new(WALL, Values::Texts(names)),
            SavedColumn::new(SPEED, Values::Reals(speeds)),
            SavedColumn::new(ALONG, Values::Reals(lines)),
            SavedColumn::new(FORCE, Values::Integers(limbs)),
        ]
    }

    /// Walls go on as those of the same names did. A stage that begins may give one another velocity along its line, or another line, of
    /// which it has what it had of the old one.
    fn resume(
        &mut self,
        saved: &SavedState,
        is_new_stage: bool,
        walls: &mut [Wall],
        is_root: bool,
    ) -> Result<(), DriveError> {
        let (names, speeds) = (saved.texts(&WALL)?, saved.reals(&SPEED)?);
        let lines = saved.reals(&ALONG)?;
        let forces = saved.integers(&FORCE)?;
        for (free, state) in self.all.iter().zip(&mut self.states) {
            let Some(row) = names.iter().position(|name| *name == walls[free.wall].name) else {
                continue;
            };
            if is_new_stage && state.first_speed != 0.0 {
                continue;
            }
            let along = Vec3::from_column_slice(&lines[ALONG.width * row..][..ALONG.width]);
            let part = if along == free.along { 1.0 } else { along.dot(&free.along) };
            state.speed = Some(speeds[row] * part).filter(|speed| !speed.is_nan());
            let speed = state.speed.unwrap_or(state.first_speed);
            walls[free.wall].velocity = state.across + free.along * speed;
            let limbs = &forces[FORCE.width * row..][..FORCE.width];
            state.force = if is_root { ExactSum::from_limbs(limbs) } else { ExactSum::default() };
        }
        Ok(())
    }
}
