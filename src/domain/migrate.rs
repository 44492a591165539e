//! Migration of particles with the state of their contacts, when the list of pairs is rebuilt.

use super::{Domain, Neighbour};
use crate::comm::{Comm, Parcel, wire};
use crate::contact::ContactRecords;
use crate::contacts::Contacts;
use crate::ids::{GlobalId, Rank};
use crate::particles::Particles;
use crate::particles::records::Particle;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Data that one rank sends to another.
#[derive(Default, Serialize, Deserialize)]
struct Leaving {
    particles: Vec<Particle>,
    /// Records of their touching contacts.
    records: ContactRecords,
}

impl Domain {
    /// Sends every owned particle to the owner of its place, and drops those that are `taken` out. Returns the records of
    /// all touching contacts of the particles that this rank now owns. Some records may occur twice, and some belong to
    /// particles that are gone. Collective. Afterwards there are neither ghosts nor walls.
    pub fn migrate(
        &mut self,
        particles: &mut Particles,
        contacts: &Contacts,
        taken: &BTreeSet<GlobalId>,
        comm: &mut dyn Comm,
    ) -> ContactRecords {
        let me = comm.rank();
        // All records of this rank, with permanent names because slots are about to change.
        let mut records = ContactRecords::of(contacts.remembered());
        contacts.named(particles).for_each(|(_, named)| records.push(&named));
        particles.strip_to_owned();

        let mut leaving: BTreeMap<Rank, Leaving> = BTreeMap::new();
        let mut new_owner: BTreeMap<GlobalId, Rank> = BTreeMap::new();
        let mut slot = 0;
        while slot < particles.owned {
            let owner = self.owner(&particles.position[slot]);
            if taken.contains(&particles.id[slot]) {
                particles.take_owned(slot);
            } else if owner == me {
                slot += 1;
            } else {
                let particle = particles.take_owned(slot);
                new_owner.insert(particle.id, owner);
                leaving.entry(owner).or_default().particles.push(particle);
            }
        }
        self.traffic.migrated += new_owner.len() as u64;
        if !new_owner.is_empty() {
            for leaving in leaving.values_mut() {
                leaving.records = ContactRecords::of(contacts.remembered());
            }
            for named in records.iter() {
                for owner in [named.a, named.b].iter().filter_map(|id| new_owner.get(&id.body())) {
                    if let Some(leaving) = leaving.get_mut(owner) {
                        leaving.records.push(&named);
                    }
                }
            }
        }

        for parcel in self.hand_over(leaving, comm) {
            let arrived: Leaving = wire::decode(&parcel.bytes);
            for particle in &arrived.particles {
                particles.adopt(particle);
            }
            records.append(&arrived.records);
        }
        records
    }

    /// Sends particles to their new owners, usually neighbours only; returns the received ones.
    fn hand_over(&self, mut leaving: BTreeMap<Rank, Leaving>, comm: &mut dyn Comm) -> Vec<Parcel> {
        let is_near = |rank: &Rank| self.neighbours.iter().any(|n| n.rank == *rank);
        if !self.knows_neighbours || comm.any(!leaving.keys().all(is_near)) {
            let parcel = |(rank, leaving)| Parcel { rank, bytes: wire::encode(&leaving) };
            return comm.route(leaving.into_iter().map(parcel).collect());
        }
        let parcel = |n: &Neighbour| {
            let leaving = leaving.remove(&n.rank).unwrap_or_default();
            Parcel { rank: n.rank, bytes: wire::encode(&leaving) }
        };
        let outgoing = self.neighbours.iter().map(parcel).collect();
        comm.exchange(outgoing, &self.all_neighbours())
    }
}
