//! Stable limit of laws that stiffen with load, during a run: it falls with the root of the stiffness.

use super::Simulation;
use super::watch::{Fault, over_the_limit};
use crate::comm::Comm;
use crate::law::stability::{limit_of_contacts, own_step, time_step_limit};
use crate::math::larger_number;
use crate::measure::shortest_axis;

/// Part of the stable limit above which a step counts as near to it.
const NEAR: f64 = 0.9;

/// Steps between checks of the limit if the step follows it.
pub(super) const FOLLOWED_EVERY: u64 = 10;

/// Limit for which the step was chosen, and its later values.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stiffening {
    /// Overlap over the radius of the smaller body up to which the limit holds [-].
    meant: f64,
    /// Limit at that overlap [s].
    limit: f64,
    /// Reaction to a step above the limit.
    over: Over,
    /// Has a warning of a step above the limit been given?
    warned: bool,
    /// Lowest limit found for the actual contacts [s], and the overlap over the radius there.
    of_contacts: Option<(f64, f64)>,
}

/// Reaction to a step above the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// The run stops with an error.
    Ends,
    /// The run continues.
    Allowed,
    /// The step is shortened in time: it is an automatic one.
    Followed,
}

impl Stiffening {
    /// `None` for laws whose contacts do not stiffen with load.
    pub(super) fn of(sim: &Simulation, over: Over) -> Option<Self> {
        let meant = sim.law.about().hardest_up_to()?;
        let limit = time_step_limit(&sim.particles.library, &*sim.law)?.dt;
        Some(Self { meant, limit, over, warned: false, of_contacts: None })
    }

    /// Stable limit with contacts at this overlap over the radius [s]: dashpots grow with the root of the stiffness.
    fn limit_at(&self, overlap: f64, sim: &Simulation) -> f64 {
        self.limit / sim.law.about().stiffens(overlap, &sim.particles.library).sqrt()
    }

    /// Sentence about an overlap over the radius, if it exceeds the assumed one and the step is near or above the limit.
    pub(super) fn words(&self, largest: f64, sim: &Simulation) -> Option<String> {
        let (meant, dt) = (self.meant, sim.dt);
        let (limit, overlap) =
            self.of_contacts.unwrap_or_else(|| (self.limit_at(largest, sim), largest));
        if largest <= meant || dt <= NEAR * limit {
            None
        } else if dt <= limit {
            Some(format!(
                "an overlap of {overlap:.3} of the radius exceeds law.largest_overlap = {meant:.3}, the basis of the \
                 time step. The stable limit fell to {limit:.3e} s, still above the step of {dt:.3e} s. Set \
                 law.largest_overlap to the expected overlap"
            ))
        } else {
            Some(over_the_limit(dt, limit, overlap))
        }
    }

    /// Returns a warning the first time that contacts lower the limit below the step. A limit that is only near is reported
    /// at the end. The actual contacts are checked only if a full packing with this overlap would be unstable. Collective.
    ///
    /// # Errors
    /// If the step is above the limit, which is not allowed.
    pub(super) fn check(
        &mut self,
        overlap: f64,
        sim: &Simulation,
        comm: &mut dyn Comm,
    ) -> Result<Option<String>, Fault> {
        let (packed, dt) = (self.limit_at(overlap, sim), sim.dt);
        if overlap <= self.meant || dt <= packed || self.over == Over::Followed {
            return Ok(None);
        }
        let (there, overlap) = limit_of_all_contacts(sim, comm);
        let limit = there.max(packed);
        if self.of_contacts.is_none_or(|(lowest, _)| limit < lowest) {
            self.of_contacts = Some((limit, overlap));
        }
        if dt <= limit || self.warned {
            return Ok(None);
        }
        if self.over == Over::Ends {
            return Err(Fault::Stiff { dt, limit, overlap });
        }
        self.warned = true;
        Ok(Some(over_the_limit(dt, limit, overlap)))
    }

    /// Shortens the step if it is near the fallen limit, and returns a warning. Collective.
    pub(super) fn follow(&self, sim: &mut Simulation, comm: &mut dyn Comm) -> Option<String> {
        if self.over != Over::Followed {
            return None;
        }
        let overlap = 2.0 * largest_overlap(sim, comm);
        let (limit, before) = (self.limit_at(overlap, sim), sim.dt);
        if overlap <= self.meant || before <= NEAR * limit {
            return None;
        }
        sim.change_step(own_step(limit));
        Some(format!(
            "step {}: at an overlap of {overlap:.3} of the radius the stable limit is {limit:.2e} s: steps are {:e} s \
             from here on, not {before:e} s. The length of a stage of `duration` is unchanged, a stage of `steps` is \
             shorter",
            sim.step, sim.dt
        ))
    }
}

/// [`limit_of_contacts`] over all ranks. Collective.
fn limit_of_all_contacts(sim: &Simulation, comm: &mut dyn Comm) -> (f64, f64) {
    let (own, overlap) = limit_of_contacts(&sim.particles, sim.contacts.iter(), &*sim.law);
    let mut fastest = [1.0 / own];
    comm.max(&mut fastest);
    let sets_it = 1.0 / own == fastest[0];
    let mut largest = [if sets_it { overlap } else { 0.0 }];
    comm.max(&mut largest);
    (1.0 / fastest[0], largest[0])
}

/// Largest overlap over the shortest axis of the smaller body [-]. Collective.
fn largest_overlap(sim: &Simulation, comm: &mut dyn Comm) -> f64 {
    let Simulation { particles, contacts, .. } = sim;
    let own = contacts.iter().filter(|(pair, _)| particles.is_owned(pair.a));
    let parts =
        own.map(|(pair, contact)| contact.overlap / shortest_axis(particles, pair.a, pair.b));
    let mut largest = [parts.fold(0.0, larger_number)];
    comm.max(&mut largest);
    largest[0]
}
