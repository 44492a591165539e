//! The law of control: from what presses on walls to their velocity.
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

use crate::cell::Cell;
use crate::math::Vec3;
use crate::walls::{Wall, area};
use serde::{Deserialize, Serialize};

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

    /// Does it keep a force?
    pub(super) const fn is_force(&self) -> bool {
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
    pub(super) fn divisor(&self, area: f64) -> f64 {
        match self.goal {
            Goal::Stress(_) => area,
            Goal::Force { .. } => self.walls.len() as f64,
        }
    }

    /// The sum of the forces that it is to keep [N].
    pub(super) fn load(&self, area: f64) -> f64 {
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
