//! Inlets: regions in which grains appear at a rate.
//!
//! What is due is a function of the clock of the stage alone: the rate times the time since the inlet began. How grains find their places is
//! in [`feed`].

pub mod feed;

pub use feed::{Inlets, MOST_AT_ONCE};

use super::DriveError;
use super::region::Region;
use crate::math::Vec3;
use crate::population::Library;
use crate::population::mix::Mix;
use crate::population::orientations::Orientations;
use serde::{Deserialize, Serialize};

/// A rate, or an amount.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Amount {
    /// Grains.
    Count(f64),
    /// Mass [kg].
    Mass(f64),
}

/// Where grains appear, and how many.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inlet {
    /// Its name in the scene.
    pub name: String,
    /// Which shapes, and their share of the grains by number.
    pub mix: Mix,
    /// Where centres of grains appear; it has an end.
    pub region: Region,
    /// Per second.
    pub rate: Amount,
    /// It begins so long after the beginning of the stage [s].
    pub begin: f64,
    /// After so many it ends; `None`: never.
    pub until: Option<Amount>,
    /// Steps between times at which grains appear.
    pub every: u64,
    /// Mean velocity at the start [m/s].
    pub velocity: Vec3,
    /// Each component of the velocity differs from its mean by up to this, at random [m/s].
    pub spread: f64,
    /// Each component of the angular velocity differs from 0 by up to this, at random [rad/s].
    pub spin: f64,
    /// Orientations.
    pub orientations: Orientations,
    /// Does it keep a list of its grains?
    pub list: bool,
    /// Number of the group of its grains, from 1; 0 if none names it.
    pub group: u16,
}

impl Inlet {
    /// Has what was asked for come, with so many grains and so much mass [kg]? Never, if it feeds without an end.
    fn is_over(&self, count: u64, mass: f64) -> bool {
        match self.until {
            Some(Amount::Count(most)) => count as f64 >= most,
            Some(Amount::Mass(most)) => mass >= most,
            None => false,
        }
    }

    /// By number [1/s] and by mass [kg/s]; the one that is not given is 0.
    const fn rates(&self) -> [f64; 2] {
        match self.rate {
            Amount::Count(rate) => [rate, 0.0],
            Amount::Mass(rate) => [0.0, rate],
        }
    }

    /// Why it cannot go on in a stage that began with something else.
    fn unknown(&self, what: &str) -> DriveError {
        DriveError(format!(
            "inlet `{}` {what} when the stage began, and what is due is counted from then. Begin a new stage with the snapshot, \
             `start` in the scene",
            self.name
        ))
    }

    /// For how long it has fed at this time of the stage, both in s; less than 0 before it begins.
    fn fed_for(&self, stage_time: f64) -> f64 {
        // Rounding is forgiven: of the clock, which may be far ahead of the beginning of the inlet.
        stage_time * (1.0 + 1e-12) - self.begin
    }

    /// How many grains appear in a stage of so many seconds, about.
    pub fn expected(&self, seconds: f64, library: &Library) -> u64 {
        self.due_within(seconds - self.begin, library)
    }

    /// How many grains are due in so many seconds of those in which it feeds, about; no more than until its end.
    pub fn due_within(&self, seconds: f64, library: &Library) -> u64 {
        let mean = library.mean_over(&self.mix, |shape| library.mass[shape.index()]);
        let count = |amount: Amount| match amount {
            Amount::Count(count) => count,
            Amount::Mass(mass) => mass / mean,
        };
        let all = count(self.rate) * seconds.max(0.0);
        let all = self.until.map_or(all, |until| all.min(count(until)));
        // A whole number may come out a little above.
        (all * (1.0 - 1e-12)).ceil() as u64
    }

    /// In words, for `--plan`.
    pub fn words(&self) -> String {
        let amount = |amount: Amount, per: &str| match amount {
            Amount::Count(count) => format!("{count} particles{per}"),
            Amount::Mass(mass) => format!("{mass} kg{per}"),
        };
        let until =
            self.until.map_or_else(String::new, |until| format!(" until {}", amount(until, "")));
        let begin = if self.begin > 0.0 {
            format!(" from {:?} s of the stage on", self.begin)
        } else {
            String::new()
        };
        format!(
            "{}{begin}{until}, every {} steps, {}",
            amount(self.rate, " per second"),
            self.every,
            self.region.words()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::{Amount, Inlet};
    use crate::drive::region::Region;
    use crate::ids::ShapeId;
    use crate::math::Vec3;
    use crate::population::mix::Mix;
    use crate::population::orientations::Orientations;

    /// Grain by grain at the times at which they are due, when the clock is far ahead of the time between two.
    #[test]
    fn the_clock_is_rounded_and_no_grain_late() {
        let (rate, dt) = (1e5, 1e-5);
        for begin in [0.0, 0.1, 1.0, 7.3] {
            let inlet = Inlet {
                name: "tap".to_owned(),
                mix: Mix::new(&[(ShapeId(0), 1.0)]),
                region: Region::Box { low: Vec3::zeros(), high: Vec3::repeat(1.0) },
                rate: Amount::Count(rate),
                begin,
                until: None,
                every: 1,
                velocity: Vec3::zeros(),
                spread: 0.0,
                spin: 0.0,
                orientations: Orientations::Random,
                list: false,
                group: 0,
            };
            let first = (begin / dt).round() as u64;
            for step in first..first + 1000 {
                let due = rate * inlet.fed_for(step as f64 * dt);
                assert_eq!(due.floor() as u64, step - first, "{begin}: {due}");
            }
            assert!(begin == 0.0 || inlet.fed_for(begin - dt) < 0.0);
        }
    }
}
