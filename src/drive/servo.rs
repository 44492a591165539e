//! Walls that keep a stress: the servo of numerical triaxial tests (the paper, section 3.1).
//!
//! In each step a wall moves towards the particles by `gain · (target - stress) · area / Σk`, where `Σk` is
//! the sum of the normal stiffness over the contacts of that wall, and by no more than `max_speed · dt`. Where
//! nothing touches, it comes in at `max_speed`. Walls that are coupled move by one displacement, found from
//! the sums over all of them. With a gain of 1 one contact that does not give way is at its target after one
//! step; since grains behind it do, the stress comes near from one side (as `(1 - K/Σk)ⁿ`, `K` the stiffness
//! of the packing). Twice as much and more may swing. A dashpot resists the wall's own motion, so its share,
//! coefficient over `dt`, is part of the stiffness.
//!
//! Forces and stiffnesses are summed exactly and once per step, while the particles move: the same bits on
//! any number of ranks. They come from what contacts remember, so a restart needs nothing more.

use crate::comm::Comm;
use crate::law::ForceLaw;
use crate::math::{ExactSum, Vec3};
use crate::particles::walls::{Wall, area, ends};
use crate::particles::{Library, Particles};
use crate::search::PairList;
use serde::{Deserialize, Serialize};

/// Walls that move by one displacement so as to keep a stress.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Servo {
    /// Indices of walls, each across an axis; of coupled walls more than one.
    pub walls: Vec<usize>,
    /// Target stress, compression positive [Pa].
    pub stress: f64,
    /// The fastest that the walls move [m/s].
    pub max_speed: f64,
    /// Part of the displacement by which a contact that does not give way would be at the target [-].
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
            area(&particles.walls, &particles.period, axis)
        };
        // The scene has checked that every wall has one.
        self.walls.iter().filter_map(of_wall).sum()
    }

    /// How far the walls move towards the particles in a step of `dt` [s], in m.
    pub fn displacement(&self, pressed: &Pressed, dt: f64) -> f64 {
        let most = self.max_speed * dt;
        if pressed.stiffness == 0.0 {
            return most;
        }
        let missing = self.stress * pressed.area - pressed.force;
        (self.gain * missing / pressed.stiffness).clamp(-most, most)
    }
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
    /// Half the thickness of the thinnest grain: no wall comes nearer to the other side [m].
    least_gap: f64,
    /// What is to be said, once, of servos that swing.
    pub warnings: Vec<String>,
}

impl Servos {
    /// At the start.
    pub fn new(all: Vec<Servo>, library: &Library) -> Self {
        let watches = vec![Watch::default(); all.len()];
        let least_gap = library.least_inscribed_radius();
        Self { all, watches, least_gap, warnings: Vec::new() }
    }

    /// Begins to sum what presses on the walls now. Collective, if there are servos.
    pub fn start_sums(
        &self,
        pairs: &PairList,
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
        for &index in pairs.touching() {
            let pair = pairs.pairs[index as usize];
            let Some(wall) = pair.b.index().checked_sub(particles.first_wall()) else { continue };
            let Some(servo) = servo_of[wall] else { continue };
            let force = pairs.normal_force(index, law, particles);
            // A state that is not a number is told when the list of pairs is made anew.
            if force.is_finite() {
                sums[servo][0].add(force);
                sums[servo][1].add(law.stiffness(pair, particles, dt));
            }
        }
        comm.start_sum(sums.iter().flatten().flat_map(|sum| *sum.limbs()).collect());
    }

    /// Gives the walls their velocities for this step, from the sums that [`Servos::start_sums`] began. The domain
    /// reaches from `low` to `high` [m]. Collective, if there are servos.
    ///
    /// # Errors
    /// If a wall has gone where it cannot keep its stress.
    pub fn steer(
        &mut self,
        particles: &mut Particles,
        [low, high]: [&Vec3; 2],
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
        for (servo, watch) in self.all.iter().zip(&mut self.watches) {
            let area = servo.area(particles);
            let pressed = Pressed { area, force: sum(), stiffness: sum() };
            let displacement = servo.displacement(&pressed, dt);
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
                velocities.push((k, wall.normal * (displacement / dt) + along));
            }
            if watch.swings(1.0 - pressed.force / (servo.stress * area)) {
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

    /// The largest difference of a stress from its target, over the target; `forces` are those on all walls [N].
    /// 0 without servos.
    pub fn largest_error(&self, particles: &Particles, forces: &[Vec3]) -> f64 {
        let error = |servo: &Servo| {
            let pressing = |&k: &usize| -forces[k].dot(&particles.walls[k].normal);
            let force: f64 = servo.walls.iter().map(pressing).sum();
            (1.0 - force / (servo.stress * servo.area(particles))).abs()
        };
        self.all.iter().map(error).fold(0.0, f64::max)
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
