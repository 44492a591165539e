//! The stable limit of laws that stiffen with load, while a run goes on: it falls with the root of the stiffness.

use super::Simulation;
use super::watch::{Fault, over_the_limit};
use crate::law::stability::time_step_limit;

/// The part of the stable limit from which on a step that was far from it is told to be near.
const NEAR: f64 = 0.9;

/// The limit that the step was found for, and what has become of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stiffening {
    /// The overlap over the radius of the smaller body up to which the limit holds [-].
    meant: f64,
    /// The limit there [s].
    limit: f64,
    /// The time step [s].
    dt: f64,
    /// May the step be over the limit?
    allowed: bool,
    /// Has been warned of a step over the limit?
    warned: bool,
}

impl Stiffening {
    /// `None` of laws whose contacts are as stiff at any load.
    pub(super) fn of(sim: &Simulation, allowed: bool) -> Option<Self> {
        let meant = sim.law.hardest_up_to()?;
        let limit = time_step_limit(&sim.particles.library, &*sim.law)?.dt;
        Some(Self { meant, limit, dt: sim.dt, allowed, warned: false })
    }

    /// The stable limit with contacts that overlap by this part of the radius [s]: dashpots grow with the root of the stiffness.
    fn limit_at(&self, overlap: f64, sim: &Simulation) -> f64 {
        self.limit / sim.law.stiffens(overlap, &sim.particles.library).sqrt()
    }

    /// A sentence about an overlap over the radius, if it is beyond what was meant and leaves little of the step or nothing.
    pub(super) fn words(&self, overlap: f64, sim: &Simulation) -> Option<String> {
        let Self { meant, dt, .. } = *self;
        let limit = self.limit_at(overlap, sim);
        if overlap <= meant || dt <= NEAR * limit {
            None
        } else if dt <= limit {
            Some(format!(
                "an overlap of {overlap:.3} of the radius is beyond law.largest_overlap = {meant:.3}, for which the time step was found: \
                 the stable limit fell to {limit:.3e} s, and {dt:.3e} s are still below it. Set law.largest_overlap to what will come"
            ))
        } else {
            Some(over_the_limit(dt, limit, overlap))
        }
    }

    /// A warning, the first time that an overlap over the radius leaves the step over the limit. What is below it is told at the end.
    ///
    /// # Errors
    /// If it is over the limit and may not be.
    pub(super) fn check(
        &mut self,
        overlap: f64,
        sim: &Simulation,
    ) -> Result<Option<String>, Fault> {
        let limit = self.limit_at(overlap, sim);
        if overlap <= self.meant || self.dt <= limit || self.warned {
            return Ok(None);
        }
        if !self.allowed {
            return Err(Fault::Stiff { dt: self.dt, limit, overlap });
        }
        self.warned = true;
        Ok(self.words(overlap, sim))
    }
}
