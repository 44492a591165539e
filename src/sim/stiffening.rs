//! The stable limit of laws that stiffen with load, while a run goes on: it falls with the root of the stiffness.

use super::Simulation;
use super::watch::{Fault, over_the_limit};
use crate::comm::Comm;
use crate::law::stability::{limit_of_contacts, own_step, time_step_limit};
use crate::math::larger_number;
use crate::measure::shortest_axis;

/// The part of the stable limit from which on a step that was far from it is told to be near.
const NEAR: f64 = 0.9;

/// Steps between looks at the limit where the step follows it.
pub(super) const FOLLOWED_EVERY: u64 = 10;

/// The limit that the step was found for, and what has become of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stiffening {
    /// The overlap over the radius of the smaller body up to which the limit holds [-].
    meant: f64,
    /// The limit there [s].
    limit: f64,
    /// What becomes of a step over the limit.
    over: Over,
    /// Has been warned of a step over the limit?
    warned: bool,
    /// The lowest limit that contacts left when they were looked at [s], and the overlap over the radius there.
    of_contacts: Option<(f64, f64)>,
}

/// What becomes of a step over the limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// The run ends.
    Ends,
    /// It goes on.
    Allowed,
    /// The step becomes shorter before: it is the program's own.
    Followed,
}

impl Stiffening {
    /// `None` of laws whose contacts are as stiff at any load.
    pub(super) fn of(sim: &Simulation, over: Over) -> Option<Self> {
        let meant = sim.law.about().hardest_up_to()?;
        let limit = time_step_limit(&sim.particles.library, &*sim.law)?.dt;
        Some(Self { meant, limit, over, warned: false, of_contacts: None })
    }

    /// The stable limit with contacts that overlap by this part of the radius [s]: dashpots grow with the root of the stiffness.
    fn limit_at(&self, overlap: f64, sim: &Simulation) -> f64 {
        self.limit / sim.law.about().stiffens(overlap, &sim.particles.library).sqrt()
    }

    /// A sentence about an overlap over the radius, if it is beyond what was meant and leaves little of the step or nothing.
    pub(super) fn words(&self, largest: f64, sim: &Simulation) -> Option<String> {
        let (meant, dt) = (self.meant, sim.dt);
        let (limit, overlap) =
            self.of_contacts.unwrap_or_else(|| (self.limit_at(largest, sim), largest));
        if largest <= meant || dt <= NEAR * limit {
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

    /// A warning, the first time that contacts leave the step over the limit. A limit that is only near is told at the end. The contacts of this step
    /// are looked at only where a full packing with this overlap would be unstable. Collective.
    ///
    /// # Errors
    /// If it is over the limit and may not be.
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

    /// Makes the step shorter where the limit has fallen so far that little of it is left, and says so. Collective.
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
            "step {}: where an overlap is {overlap:.3} of the radius contacts are so stiff that the stable limit is {limit:.2e} s: \
             steps take {:e} s from here on, not {before:e} s. A stage of a `duration` lasts as long as before, one of `steps` less long",
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

/// The largest overlap over the shortest axis of the smaller body [-]. Collective.
fn largest_overlap(sim: &Simulation, comm: &mut dyn Comm) -> f64 {
    let Simulation { particles, contacts, .. } = sim;
    let own = contacts.iter().filter(|(pair, _)| particles.is_owned(pair.a));
    let parts =
        own.map(|(pair, contact)| contact.overlap / shortest_axis(particles, pair.a, pair.b));
    let mut largest = [parts.fold(0.0, larger_number)];
    comm.max(&mut largest);
    largest[0]
}
