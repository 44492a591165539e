//! Particles change hands, with all that is remembered of their contacts. Only when the list of
//! pairs is rebuilt.

use super::{Domain, Neighbour};
use crate::comm::{Comm, Parcel, wire};
use crate::contact::NamedHistory;
use crate::contacts::Contacts;
use crate::ids::{GlobalId, Rank};
use crate::particles::Particles;
use crate::particles::records::Particle;
use std::collections::BTreeMap;

impl Domain {
    /// Hands every owned particle to the owner of its place and returns the histories of all touching
    /// contacts of the particles that this rank now owns (some of them twice). Collective. After
    /// it there are neither ghosts nor walls.
    pub fn migrate(
        &mut self,
        particles: &mut Particles,
        contacts: &Contacts,
        comm: &mut dyn Comm,
    ) -> Vec<NamedHistory> {
        let me = comm.rank();
        // All histories known here, under lasting names: slots are about to change.
        let known: Vec<NamedHistory> = contacts.named(particles).map(|(_, named)| named).collect();
        particles.strip_to_owned();

        let mut leaving: BTreeMap<_, Vec<Particle>> = BTreeMap::new();
        let mut slot = 0;
        while slot < particles.owned {
            let owner = self.owner(&particles.position[slot]);
            if owner == me {
                slot += 1;
            } else {
                leaving.entry(owner).or_default().push(particles.take_owned(slot));
            }
        }
        let gone: usize = leaving.values().map(Vec::len).sum();
        self.traffic.migrated += gone as u64;
        if gone > 0 {
            let mut of_particle: BTreeMap<GlobalId, &mut Vec<NamedHistory>> = leaving
                .values_mut()
                .flatten()
                .map(|particle| (particle.id, &mut particle.histories))
                .collect();
            for named in &known {
                for id in [named.a, named.b] {
                    if let Some(histories) = of_particle.get_mut(&id) {
                        histories.push(*named);
                    }
                }
            }
        }

        let mut histories = known;
        for parcel in self.hand_over(leaving, comm) {
            for particle in wire::decode::<Vec<Particle>>(&parcel.bytes) {
                particles.push_owned(&particle);
                histories.extend(particle.histories);
            }
        }
        histories
    }

    /// Sends particles to their new owners, as a rule to neighbours only; returns what comes here.
    fn hand_over(
        &self,
        mut leaving: BTreeMap<Rank, Vec<Particle>>,
        comm: &mut dyn Comm,
    ) -> Vec<Parcel> {
        let is_near = |rank: &Rank| self.neighbours.iter().any(|n| n.rank == *rank);
        if !self.knows_neighbours || comm.any(!leaving.keys().all(is_near)) {
            let parcel = |(rank, particles)| Parcel { rank, bytes: wire::encode(&particles) };
            return comm.route(leaving.into_iter().map(parcel).collect());
        }
        let parcel = |n: &Neighbour| {
            let particles = leaving.remove(&n.rank).unwrap_or_default();
            Parcel { rank: n.rank, bytes: wire::encode(&particles) }
        };
        let outgoing = self.neighbours.iter().map(parcel).collect();
        comm.exchange(outgoing, &self.all_neighbours())
    }
}
