//! Control law of servos: wall velocity from the load on the walls.
//!
//! In each step of `dt` a wall gets a velocity towards the particles from its deficit `e = (target - stress) · area`, and
//! from the stiffness of its contacts, `K = Σ(k + c/dt)`: a dashpot `c` resists the wall's motion too. It is a proportional
//! and integral law,
//!
//! `w = P e / (K dt) + s`, then `s ← s + I e / (K dt)`, with `P = 0.7 gain` and `I = P²/4`.
//!
//! For the particles the wall is a plate of mass `K dt² / I` under the target stress, with a dashpot of `K dt / P` in
//! series. It only takes energy from them. The integral `s` is the speed with which the target moves away: under a packing
//! that strains steadily the mean error is zero. A proportional law alone keeps an error from that speed. Contacts that do
//! not yield reach their target with the double root `1 - P/2` per step. Where dashpots carry nearly all, the roots are
//! 0.92 and -0.62; a law that removes the whole deficit in one step has -1 there and oscillates for ever. From about 1.7
//! times the default `gain` on this law oscillates with such contacts.
//!
//! A wall goes no faster than `max_speed`, and its integral does not grow while the speed is limited. It approaches at
//! `max_speed` until it has touched a particle. Later, without contacts, `K` is that of the last contacts. Coupled walls
//! move with one velocity, found from the sums over all of them.
//!
//! In a packing without friction and dashpots only the walls take energy, and they oscillate for long. With 125 spheres the
//! mean error is 6 % after 50,000 steps at a third of the stable one, and 0.3 % after 200,000; the final report warns of
//! it. Coupled walls keep the mean of their stresses. A single one may be off by the friction and inertia between them.
//!
//! A servo of force moves any wall along a direction `a`: `e = target + F·a`, with the force `F` of all contacts on the
//! wall, friction included. The law is then used without an area. A contact of normal `n` counts in `K` with `(n·a)²`, its
//! approach per motion along `a`. With friction it counts fully, because sticking contacts resist sliding about as much,
//! and a larger `K` only makes the wall slower. With `a` along the normal of a plane both servos are the same.

use crate::cell::Cell;
use crate::math::Vec3;
use crate::walls::{Wall, area};
use serde::{Deserialize, Serialize};

/// Target of a servo.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Goal {
    /// Stress on planes, each across an axis; compression positive [Pa].
    Stress(f64),
    /// Force with which each wall presses on the particles along a direction.
    Force {
        /// Force, in the mean of coupled walls [N].
        newtons: f64,
        /// Direction, a unit vector; `None` for the present normal of a wall of one plane.
        along: Option<Vec3>,
    },
}

impl Goal {
    /// Key of the target in a scene, its unit and its value.
    pub const fn target(&self) -> (&'static str, &'static str, f64) {
        match *self {
            Self::Stress(pascals) => ("stress", "Pa", pascals),
            Self::Force { newtons, .. } => ("force", "N", newtons),
        }
    }

    /// Direction in which a wall presses, a unit vector.
    pub fn along(&self, wall: &Wall) -> Vec3 {
        match *self {
            Self::Force { along: Some(along), .. } => along,
            _ => wall.surface().1,
        }
    }

    /// Velocity of a wall that moves with `speed` in that direction, and with its `own` velocity across it [m/s].
    pub fn velocity(&self, wall: &Wall, own: &Vec3, speed: f64) -> Vec3 {
        match self {
            Self::Stress(_) => wall.velocity_inwards(speed),
            Self::Force { .. } => {
                let along = self.along(wall);
                own - along * own.dot(&along) + along * speed
            }
        }
    }

    /// Does it keep a force?
    pub(super) const fn is_force(&self) -> bool {
        matches!(self, Self::Force { .. })
    }
}

/// Walls that move with one velocity to keep a stress or a force.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Servo {
    /// Indices of the walls; more than one if they are coupled.
    pub walls: Vec<usize>,
    /// Their target.
    pub goal: Goal,
    /// Largest speed of the walls [m/s].
    pub max_speed: f64,
    /// Factor on the response of the walls: smaller is slower and softer [-].
    pub gain: f64,
}

/// Load on the walls of a servo.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pressed {
    /// Sum of the areas [m²]; not used by a servo of force.
    pub area: f64,
    /// Sum of the normal forces, or of the forces against the directions of the walls [N].
    pub force: f64,
    /// Sum of the stiffnesses of the contacts [N/m]; 0 without contacts.
    pub stiffness: f64,
}

impl Servo {
    /// Names of its walls.
    pub fn names(&self, walls: &[Wall]) -> String {
        self.walls.iter().map(|&k| &*walls[k].name).collect::<Vec<_>>().join(", ")
    }

    /// Sum of the areas of its walls [m²], if it keeps a stress.
    pub fn area(&self, walls: &[Wall], cell: &Cell) -> f64 {
        let of_wall = |&k: &usize| area(walls, cell, walls[k].across()?.axis);
        // Every wall has an area: the scene has checked it.
        self.walls.iter().filter_map(of_wall).sum()
    }

    /// Divisor from the sum of the forces on its walls to its target's unit: their area [m²], or their number.
    pub(super) fn divisor(&self, area: f64) -> f64 {
        match self.goal {
            Goal::Stress(_) => area,
            Goal::Force { .. } => self.walls.len() as f64,
        }
    }

    /// Target of the sum of the forces [N].
    pub(super) fn load(&self, area: f64) -> f64 {
        let (.., target) = self.goal.target();
        target * self.divisor(area)
    }

    /// Velocity of the walls towards the particles in a step of `dt` [s], in m/s.
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
        // While the speed is limited, the integral may only shrink.
        if velocity == wanted || more * wanted < 0.0 {
            state.speed = (state.speed + more).clamp(-self.max_speed, self.max_speed);
        }
        velocity
    }
}

/// Part of the deficit that is removed in a step, with a gain of 1 [-].
const PROPORTIONAL: f64 = 0.7;

/// State of a servo from step to step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Integral: the speed towards the particles without a deficit [m/s].
    pub speed: f64,
    /// Stiffness of the last contacts [N/m]; 0 before the first.
    pub stiffness: f64,
}
