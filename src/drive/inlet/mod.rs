//! Inlets: regions in which particles appear at a rate.
//!
//! The due amount depends only on the time of the stage: it is the rate times the time since the inlet began. [`feed`]
//! places the particles.

pub mod feed;

pub use feed::{Inlets, MOST_AT_ONCE};

use super::DriveError;
use super::region::Region;
use crate::math::Vec3;
use crate::population::Library;
use crate::population::mix::Mix;
use crate::population::orientations::Orientations;
use serde::{Deserialize, Serialize};

/// Rate or amount.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Amount {
    /// Number of particles.
    Count(f64),
    /// Mass [kg].
    Mass(f64),
}

/// Region and rate at which particles appear.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inlet {
    /// Its name in the scene.
    pub name: String,
    /// Shapes, and their shares of the particles by number.
    pub mix: Mix,
    /// Region of the centres of new particles; it is bounded.
    pub region: Region,
    /// Rate per second.
    pub rate: Amount,
    /// Start, in time after the beginning of the stage [s].
    pub begin: f64,
    /// Amount after which it ends; `None` for never.
    pub until: Option<Amount>,
    /// Steps between insertions.
    pub every: u64,
    /// Mean initial velocity [m/s].
    pub velocity: Vec3,
    /// Largest random deviation of each velocity component from its mean [m/s].
    pub spread: f64,
    /// Largest random value of each component of the angular velocity [rad/s].
    pub spin: f64,
    /// Orientations.
    pub orientations: Orientations,
    /// Does it keep a list of its particles?
    pub list: bool,
    /// Number of the group of its particles, from 1; 0 if no group names it.
    pub group: u16,
}

impl Inlet {
    /// Has it ended, with this number and mass [kg] of particles? Never true without an end.
    fn is_over(&self, count: u64, mass: f64) -> bool {
        match self.until {
            Some(Amount::Count(most)) => count as f64 >= most,
            Some(Amount::Mass(most)) => mass >= most,
            None => false,
        }
    }

    /// Rate by number [1/s] and by mass [kg/s]; the one that is not set is 0.
    const fn rates(&self) -> [f64; 2] {
        match self.rate {
            Amount::Count(rate) => [rate, 0.0],
            Amount::Mass(rate) => [0.0, rate],
        }
    }

    /// Error for a stage that began with another inlet.
    fn unknown(&self, what: &str) -> DriveError {
        DriveError(format!(
            "inlet `{}` {what} when the stage began, and its particles are counted from then. Begin a new stage with \
             the snapshot, `start` in the scene",
            self.name
        ))
    }

    /// Time for which it has fed, at a time of the stage, both [s]; negative before it begins.
    fn fed_for(&self, stage_time: f64) -> f64 {
        // Tolerates rounding of the stage time, which may be far beyond the start of the inlet.
        stage_time * (1.0 + 1e-12) - self.begin
    }

    /// Approximate number of particles in a stage of this duration [s].
    pub fn expected(&self, seconds: f64, library: &Library) -> u64 {
        self.due_within(seconds - self.begin, library)
    }

    /// Approximate number of particles due in this time of feeding [s], up to the end of the inlet.
    pub fn due_within(&self, seconds: f64, library: &Library) -> u64 {
        let mean = library.mean_over(&self.mix, |shape| library.mass[shape.index()]);
        let count = |amount: Amount| match amount {
            Amount::Count(count) => count,
            Amount::Mass(mass) => mass / mean,
        };
        let all = count(self.rate) * seconds.max(0.0);
        let all = self.until.map_or(all, |until| all.min(count(until)));
        // Rounding may put a whole number slightly above it.
        (all * (1.0 - 1e-12)).ceil() as u64
    }

    /// Description for `--plan`.
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

    /// Particles appear one by one when they are due, even if the time is far larger than the interval between two.
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
