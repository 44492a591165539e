//! Particles that leave the domain or reach an outlet, for drives to take.

use super::Simulation;
use crate::comm::{Comm, everywhere};
use crate::drive::Takes;
use crate::ids::GlobalId;
use crate::measure;
use crate::motion;
use crate::particles::columns::Quantity;
use crate::particles::records::Particle;
use std::collections::BTreeSet;

impl Simulation {
    /// Is there a particle that a drive may take?
    pub(super) fn has_leaver(&self) -> bool {
        self.is_open() && self.leavers().next().is_some()
    }

    /// Does any drive take particles out?
    fn is_open(&self) -> bool {
        let moment = self.moment();
        self.drives.iter().any(|drive| drive.takes(&moment) != Takes::Nothing)
    }

    /// Slots of the owned particles that have left the domain, or that have reached an outlet and are not held. They do not
    /// depend on when the pairs were listed.
    fn leavers(&self) -> impl Iterator<Item = usize> {
        let Self { particles, drives, .. } = self;
        let moment = self.moment();
        let looks_inside = drives.iter().filter(|drive| drive.takes(&moment) == Takes::Inside);
        let looking: Vec<_> = looks_inside.collect();
        let owned = if looking.is_empty() { 0 } else { particles.owned };
        let reached = move |slot: &usize| {
            let position = &particles.position[*slot];
            !particles.is_held(*slot)
                && looking.iter().any(|drive| drive.reaches(&moment, position, &particles.cell))
        };
        let inside = (0..owned).filter(reached);
        self.domain.leavers(particles).chain(inside)
    }

    /// Offers particles that have left the domain or reached an outlet to the drives, and records the energies of those
    /// taken. Returns their ids, the same on all ranks. `dt` [s] is 0 at the start of a stage. Collective, if a drive may
    /// take any.
    pub(super) fn take_leavers(&mut self, dt: f64, comm: &mut dyn Comm) -> BTreeSet<GlobalId> {
        let mut taken = BTreeSet::new();
        if !self.is_open() || !comm.any(self.has_leaver()) {
            return taken;
        }
        // A particle may be both outside and in an outlet.
        let slots: BTreeSet<usize> = self.leavers().collect();
        let moment = self.moment();
        let Self { particles, drives, field, .. } = self;
        let here = slots.into_iter().map(|slot| {
            let leaver = particles.owned_particle(slot);
            let shape = particles.library.free(leaver.shape);
            // The state at removal, without contacts in the last half of the step.
            Particle { shape, velocity: field.after_last_kick(&leaver.velocity, dt), ..leaver }
        });
        let mut leavers = everywhere(comm, &here.collect::<Vec<_>>());
        leavers.sort_unstable_by_key(|leaver| leaver.id);
        for leaver in leavers.iter().filter(|leaver| leaver.position.norm().is_finite()) {
            if drives.iter_mut().any(|drive| drive.take(&moment, leaver, particles)) {
                taken.insert(leaver.id);
            }
        }
        self.book_out(&taken, dt, comm);
        taken
    }

    /// Records the energies of these particles. They end their step as if nothing touched them any more. The energy stored
    /// in their contacts leaves with them. The work of such a contact on its other body in this step is not recorded. `dt`
    /// [s] is 0 at the start of a stage. Collective.
    fn book_out(&mut self, taken: &BTreeSet<GlobalId>, dt: f64, comm: &mut dyn Comm) {
        let Self { particles, contacts, law, field, departed, .. } = self;
        // By bodies: received, dissipated and its parts.
        let mut entries: Vec<(GlobalId, GlobalId, f64, f64, [f64; Quantity::CHANNELS.len()])> =
            Vec::new();
        for slot in 0..particles.owned {
            let id = particles.id[slot];
            if taken.contains(&id) {
                let energy = if particles.is_held(slot) {
                    0.0
                } else {
                    motion::last_work(particles, slot, field, dt)
                        + measure::free_energy(particles, slot, field)
                };
                let accumulated = particles.accumulated.row(slot);
                let [received, dissipated] = [Quantity::Received, Quantity::Dissipated]
                    .map(|quantity| accumulated[quantity]);
                let channels = Quantity::CHANNELS.map(|quantity| accumulated[quantity]);
                entries.push((id, id, received - energy, dissipated, channels));
            }
        }
        // At the start of a stage the energy stored in contacts has not been counted yet.
        for (pair, contact) in contacts.named(particles).filter(|_| dt > 0.0) {
            let is_here = particles.is_owned(pair.a);
            if is_here && [contact.a, contact.b].iter().any(|id| taken.contains(&id.body())) {
                let stored = law.stored(pair, particles, &contact.geometry, contact.state);
                entries.push((contact.a, contact.b, -stored, 0.0, [0.0; Quantity::CHANNELS.len()]));
            }
        }
        let mut entries = everywhere(comm, &entries);
        entries.sort_unstable_by_key(|&(a, b, ..)| (a, b));
        for (_, _, received, dissipated, channels) in entries {
            departed.received += received;
            departed.dissipated += dissipated;
            for (all, one) in departed.channels.iter_mut().zip(channels) {
                *all += one;
            }
        }
    }
}
