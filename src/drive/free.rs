//! Walls with a mass that their weight, a given force and the particles move along a line: a lid on a bed, a piston, a tray
//! on particles.
//!
//! The wall is integrated like the particles: `v(t + dt/2) = v(t - dt/2) + F(t) dt / m`, then
//! `x(t + dt) = x(t) + v(t + dt/2) dt`, of second order in `dt`. `F` is the sum of the wall's weight, the given force and
//! the forces of all contacts on the wall, along the line. Across the line, and against turning, the wall is held. Contact
//! forces are summed exactly: the bits do not depend on the number of ranks. Snapshots hold the sum of the last step and
//! the velocity.
//!
//! A light wall on many particles needs shorter steps than the particles do: it oscillates with `√(K/m)`, where `K` is the
//! total stiffness of its contacts. If `dt √(K/m)` exceeds 1 the run warns, above 2 it stops.

use super::clearance::Unloaded;
use super::load::{self, Line};
use super::{Drive, DriveError, Observer, Reporter, Restart, SavedColumn, Steering, View};
use crate::cell::Cell;
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::math::{ExactSum, Vec3};
use crate::walls::{Across, Wall, area};
use serde::{Deserialize, Serialize};

/// A wall that moves freely along a line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FreeWall {
    /// Index of the wall.
    pub wall: usize,
    /// Direction of the line, a unit vector.
    pub along: Vec3,
    /// Mass [kg].
    pub mass: f64,
    /// Weight and given force along the line [N].
    pub load: f64,
}

impl FreeWall {
    /// Stress on the particles under the whole load [Pa]; `None` if the wall does not press, or if its area is not known.
    /// Because it is held across its direction, its normal force is the load over the cosine of the angle between direction
    /// and normal.
    pub fn stress(&self, walls: &[Wall], cell: &Cell) -> Option<f64> {
        let Across { axis, inwards, .. } = walls[self.wall].across()?;
        let cosine = self.along[axis] * inwards;
        let presses = self.load * cosine > 0.0;
        Some(self.load / cosine / area(walls, cell, axis)?).filter(|_| presses)
    }
}

/// A free wall with its state.
#[derive(Clone, Debug)]
struct Running {
    free: FreeWall,
    /// Velocity along the line in the last step [m/s]; `None` before the first.
    speed: Option<f64>,
    /// Velocity along the line at the start, from the scene [m/s].
    first_speed: f64,
    /// Velocity across the line, from the scene [m/s].
    across: Vec3,
    /// Force of this rank's contacts on the wall along the line, at the present positions [N].
    force: ExactSum,
    /// Has a warning been given?
    warned: bool,
}

// Columns in a snapshot: a row for each free wall.
/// The wall's name in the scene.
const WALL: StateColumn = StateColumn::new("wall", 1, "");
/// [`Running::speed`]; NaN before the first step.
const SPEED: StateColumn = StateColumn::new("speed", 1, "m/s");
/// [`FreeWall::along`].
const ALONG: StateColumn = StateColumn::new("along", 3, "");
/// [`Running::force`] over all ranks, exactly.
const FORCE: StateColumn = StateColumn::new("force", ExactSum::LIMBS, "2^(32 k - 1074) N");

/// Value of `dt √(K/m)` above which the run warns.
const COARSE: f64 = 1.0;
/// Value from which the oscillation of the wall grows.
const UNSTABLE: f64 = 2.0;

/// The free walls of a running simulation.
#[derive(Clone, Debug)]
pub struct FreeWalls {
    all: Vec<Running>,
    warnings: Vec<String>,
}

impl FreeWalls {
    /// Free walls at the start, with the velocities of the scene's walls.
    pub fn new(all: Vec<FreeWall>, walls: &[Wall]) -> Self {
        let running = |free: FreeWall| {
            let velocity = walls[free.wall].velocity;
            let first_speed = velocity.dot(&free.along);
            let across = velocity - free.along * first_speed;
            let force = ExactSum::default();
            Running { free, speed: None, first_speed, across, force, warned: false }
        };
        Self { all: all.into_iter().map(running).collect(), warnings: Vec::new() }
    }

    /// Number of each wall among the free ones, and its direction.
    fn lines(&self, walls: usize) -> Vec<Option<Line>> {
        let mut lines = vec![None; walls];
        for (k, Running { free, .. }) in self.all.iter().enumerate() {
            lines[free.wall] = Some((k, free.along));
        }
        lines
    }
}

impl Running {
    /// Checks that a step of `dt` [s] resolves the wall's oscillation on contacts of this stiffness [N/m]. Returns a
    /// warning, once.
    fn check_step(
        &mut self,
        stiffness: f64,
        dt: f64,
        name: &str,
    ) -> Result<Option<String>, DriveError> {
        let mass = self.free.mass;
        let angle = dt * (stiffness / mass).sqrt();
        if angle < COARSE {
            return Ok(None);
        }
        let said = format!(
            "wall \"{name}\" of {mass:e} kg oscillates on its particles by {angle:.2} rad in a step of {dt:.3e} s \
             (total contact stiffness {stiffness:.3e} N/m)"
        );
        let better = format!("use a step of {:.2e} s, or a heavier wall", 0.2 * dt / angle);
        if angle >= UNSTABLE {
            return Err(DriveError(format!("{said}, and its amplitude grows: {better}")));
        }
        let is_known = std::mem::replace(&mut self.warned, true);
        Ok((!is_known).then(|| format!("{said}, which resolves it poorly: {better}")))
    }

    /// Speed along the line in the next step of `dt` [s], under the force of the particles [N].
    fn speed_under(&self, force: f64, dt: f64) -> f64 {
        // The scene's velocity is that of the start, half a step before that of the first step.
        let (speed, dt) = self.speed.map_or((self.first_speed, 0.5 * dt), |speed| (speed, dt));
        speed + dt * (self.free.load + force) / self.free.mass
    }

    /// Velocity of the wall at its speed [m/s].
    fn velocity(&self) -> Vec3 {
        self.across + self.free.along * self.speed.unwrap_or(self.first_speed)
    }
}

impl Drive for FreeWalls {
    /// Limbs of force and stiffness of each wall.
    fn sums(&self, view: &View) -> Vec<i64> {
        let View { moment, particles, law, .. } = view;
        let lines = self.lines(particles.walls.len());
        let mut stiffnesses = vec![ExactSum::default(); self.all.len()];
        for (wall, pair, geometry, _) in load::pressing(view) {
            if let Some((k, _)) = lines[wall] {
                stiffnesses[k].add(law.stiffness(pair, particles, geometry, moment.dt));
            }
        }
        let both = self.all.iter().zip(&stiffnesses);
        let limbs = both.flat_map(|(Running { force, .. }, stiffness)| [force, stiffness]);
        limbs.flat_map(|sum| *sum.limbs()).collect()
    }

    fn steer(&mut self, steering: Steering) -> Result<(), DriveError> {
        let Steering { moment, sums, cell, library, walls } = steering;
        let sums = ExactSum::values(sums);
        for (running, &[force, stiffness]) in self.all.iter_mut().zip(sums.as_chunks().0) {
            let wall = running.free.wall;
            let name = &walls[wall].name;
            self.warnings.extend(running.check_step(stiffness, moment.dt, name)?);
            let speed = running.speed_under(force, moment.dt);
            running.speed = Some(speed);
            walls[wall].velocity = running.velocity();
            let place = match Unloaded::of(&walls[wall], walls, cell, library) {
                None => continue,
                Some(Unloaded::Closed { .. }) => "at the opposite side of",
                Some(Unloaded::Open | Unloaded::Gone) => "far out of",
            };
            return Err(DriveError(format!(
                "wall \"{}\" moves freely and is {place} the domain, at {speed:.3e} m/s along its line: put particles \
                 where they support it, or give it another `force`",
                walls[wall].name
            )));
        }
        Ok(())
    }
}

impl Observer for FreeWalls {
    /// Records the force of this rank's contacts on each wall along its line.
    fn after_forces(&mut self, view: &View) {
        let lines = self.lines(view.particles.walls.len());
        let forces = load::along(self.all.len(), &lines, view);
        for (running, force) in self.all.iter_mut().zip(forces) {
            running.force = force;
        }
    }
}

impl Reporter for FreeWalls {
    fn name(&self) -> &'static str {
        "free walls"
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    /// A wall that no particle supports, and that does not stand still by itself.
    fn under_way(&self, walls: &[Wall], wall_forces: &[Vec3]) -> Option<String> {
        let is_under_way = |free: &&FreeWall| {
            let velocity = walls[free.wall].velocity;
            // It may slide across its line.
            let stands =
                free.load == 0.0 && velocity.dot(&free.along).abs() <= 1e-9 * velocity.norm();
            wall_forces[free.wall] == Vec3::zeros() && !stands
        };
        let free = self.all.iter().map(|running| &running.free).find(is_under_way)?;
        Some(format!("wall \"{}\" moves freely, and no particle touches it", walls[free.wall].name))
    }

    fn save(&self, walls: &[Wall], comm: &mut dyn Comm) -> Vec<SavedColumn> {
        let all = || self.all.iter();
        let forces = load::of_all_ranks(all().map(|running| &running.force), comm);
        vec![
            SavedColumn::texts(WALL, all().map(|running| walls[running.free.wall].name.clone())),
            SavedColumn::reals(SPEED, all().map(|running| running.speed.unwrap_or(f64::NAN))),
            SavedColumn::reals(
                ALONG,
                all().flat_map(|running| <[f64; 3]>::from(running.free.along)),
            ),
            SavedColumn::integers(FORCE, forces.iter().flat_map(|force| *force.limbs())),
        ]
    }

    /// Restores the walls of the same names. A new stage may set another velocity along the line. If it sets another line,
    /// the component of the old velocity along it is kept.
    fn resume(&mut self, restart: &Restart, walls: &mut [Wall]) -> Result<(), DriveError> {
        let saved = restart.saved;
        let (names, speeds) = (saved.texts(&WALL)?, saved.reals(&SPEED)?);
        let lines: &[[f64; 3]] = saved.reals(&ALONG)?.as_chunks().0;
        let forces: &[[i64; ExactSum::LIMBS]] = saved.integers(&FORCE)?.as_chunks().0;
        for running in &mut self.all {
            let FreeWall { wall, along, .. } = running.free;
            let Some(row) = names.iter().position(|name| *name == walls[wall].name) else {
                continue;
            };
            if restart.is_new_stage && running.first_speed != 0.0 {
                continue;
            }
            let before = Vec3::from(lines[row]);
            let part = if before == along { 1.0 } else { before.dot(&along) };
            running.speed = Some(speeds[row] * part).filter(|speed| !speed.is_nan());
            walls[wall].velocity = running.velocity();
            running.force = restart.sum(&forces[row]);
        }
        Ok(())
    }
}
