//! Control law of a cell: strain rate from the stress in the cell.
//!
//! In each step of `dt` a component with a target gets a rate from its deficit `e = target - stress`, and from the modulus
//! of the contacts `C = (1/V) Σ l² n_b² (k + c/dt)`. `l` are their branches, `n` normals, `k` stiffnesses and `c`
//! dashpots; `b` is the last axis of the component:
//!
//! `rate = P e / (C dt) + s`, then `s ← s + I e / (C dt)`, with `P = 0.25 gain` and `I = P²/4`.
//!
//! All particles move with the cell in the same step, so no wave must cross the packing first. True moduli are below those
//! of a uniform motion, so a rate found from `C` does not overshoot. `C` bounds the sum of the moduli by which the
//! components act on each other. The stress of a step sets the rate two steps later, so `P` is smaller than that of walls.
//! The modulus is measured in each step until there are contacts, then every 16 steps.
//! A component without contacts goes at `max_rate` towards its target, or rests if that is zero.

use crate::math::Vec3;
use crate::measure::COMPONENTS;
use crate::walls::courses::TimeFunction;
use serde::{Deserialize, Serialize};

/// Required strain rate or stress of a component; compression positive.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Goal {
    /// Strain rate [1/s].
    Rate(f64),
    /// Strain over the time since the stage began [-].
    Path(TimeFunction),
    /// Stress [Pa].
    Stress(f64),
    /// Mean stress along x, y and z, which have equal rates [Pa].
    MeanStress(f64),
    /// Rate that keeps the volume, shared with other components of this kind.
    Volume,
}

impl Goal {
    /// Stress to reach [Pa].
    pub const fn stress(&self) -> Option<f64> {
        match *self {
            Self::Stress(stress) | Self::MeanStress(stress) => Some(stress),
            Self::Rate(_) | Self::Path(_) | Self::Volume => None,
        }
    }
}

/// Required strain rates and stresses of a cell.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Control {
    /// Goals by [`COMPONENTS`].
    pub goals: [Goal; 6],
    /// Time in which targets move from the initial stress of the stage to the goal [s].
    pub ramp: f64,
    /// Largest rate of a component with a stress [1/s].
    pub max_rate: f64,
    /// Factor on the response of the cell [-].
    pub gain: f64,
}

/// Stress and stiffness of a cell.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pressed {
    /// Stress, compression positive, by [`COMPONENTS`] [Pa].
    pub stress: [f64; 6],
    /// Moduli `C` by axis [Pa]; 0 without contacts.
    pub moduli: Vec3,
}

/// State of the control of a component.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Integral: the rate without a deficit [1/s].
    pub rate: f64,
    /// Modulus of the last contacts [Pa]; 0 before the first.
    pub modulus: f64,
    /// Stress at the start of the stage [Pa].
    pub first: f64,
}

impl Control {
    /// Components that keep a stress: index into [`COMPONENTS`] and goal [Pa]. Components that keep a mean stress are
    /// represented by the first.
    pub fn targets(&self) -> impl Iterator<Item = (usize, f64)> {
        let is_first = |k: usize| k == 0 || !matches!(self.goals[k], Goal::MeanStress(_));
        let all = self.goals.iter().enumerate().filter(move |&(k, _)| is_first(k));
        all.filter_map(|(k, goal)| Some((k, goal.stress()?)))
    }

    /// Does it keep a stress?
    pub fn has_target(&self) -> bool {
        self.targets().next().is_some()
    }

    /// Does a rate change with time or stress?
    pub fn is_steered(&self) -> bool {
        self.has_target() || self.goals.iter().any(|goal| matches!(goal, Goal::Path(_)))
    }

    /// Time since the stage began at which the last path ends [s]; `None` if no path ends.
    pub fn end_of_paths(&self) -> Option<f64> {
        let end = |goal: &Goal| if let Goal::Path(way) = goal { way.end() } else { None };
        self.goals.iter().filter_map(end).reduce(f64::max)
    }

    /// Largest rates of all components at any time [1/s].
    pub fn fastest(&self) -> [f64; 6] {
        let of_path = |way: &TimeFunction| way.fastest();
        self.rates_by(of_path, |_| self.max_rate)
    }

    /// Rates of all components over the step of `dt` that ends at a time since the stage began, from those of components with a stress
    /// [1/s]. Times in s.
    pub fn rates(&self, [end, dt]: [f64; 2], of_stress: impl FnMut(usize) -> f64) -> [f64; 6] {
        self.rates_by(|way| way.mean_rate(end, dt), of_stress)
    }

    fn rates_by(
        &self,
        of_path: impl Fn(&TimeFunction) -> f64,
        mut of_stress: impl FnMut(usize) -> f64,
    ) -> [f64; 6] {
        let mut rates = [0.0; 6];
        for (k, goal) in self.goals.iter().enumerate() {
            rates[k] = match goal {
                Goal::Rate(rate) => *rate,
                Goal::Path(way) => of_path(way),
                Goal::Stress(_) => of_stress(k),
                Goal::MeanStress(_) if k > 0 => rates[0],
                Goal::MeanStress(_) => of_stress(0),
                Goal::Volume => 0.0,
            };
        }
        let keeps = |k: &usize| self.goals[*k] == Goal::Volume;
        let sum = rates[0] + rates[1] + rates[2];
        let share = sum / (0..3).filter(keeps).count().max(1) as f64;
        (0..3).filter(keeps).for_each(|k| rates[k] = -share);
        rates
    }

    /// Target at a time since the stage began [s], between the first stress and the goal [Pa].
    pub fn target_at(&self, goal: f64, first: f64, time: f64) -> f64 {
        let part = if time < self.ramp { time / self.ramp } else { 1.0 };
        first + (goal - first) * part
    }

    /// Rate of a component in the next step of `dt` [s], with a target [Pa].
    pub fn rate(
        &self,
        state: &mut State,
        target: f64,
        [stress, modulus]: [f64; 2],
        dt: f64,
    ) -> f64 {
        if modulus > 0.0 {
            state.modulus = modulus;
        }
        if state.modulus == 0.0 {
            return if target == 0.0 { 0.0 } else { self.max_rate.copysign(target) };
        }
        let at_once = (target - stress) / (state.modulus * dt);
        let proportional = PROPORTIONAL * self.gain;
        let wanted = state.rate + proportional * at_once;
        let rate = wanted.clamp(-self.max_rate, self.max_rate);
        let more = 0.25 * proportional * proportional * at_once;
        // While the rate is limited, the integral may only shrink.
        if rate == wanted || more * wanted < 0.0 {
            state.rate = (state.rate + more).clamp(-self.max_rate, self.max_rate);
        }
        rate
    }
}

impl Pressed {
    /// Stress and modulus of a goal's component [Pa].
    pub fn of(&self, goal: &Goal, component: usize) -> [f64; 2] {
        if let Goal::MeanStress(_) = goal {
            let [x, y, z, ..] = self.stress;
            return [(x + y + z) / 3.0, self.moduli.sum() / 3.0];
        }
        let [_, across] = COMPONENTS[component];
        [self.stress[component], self.moduli[across]]
    }
}

/// Part of the deficit that is removed in a step, with a gain of 1 [-].
const PROPORTIONAL: f64 = 0.25;
