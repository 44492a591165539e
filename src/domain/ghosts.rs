//! The halo: copies of the particles that neighbours own and this rank's particles may touch.
//!
//! One message per neighbour and step, plain packed `f64`, sent before and received after the
//! contacts among owned particles are resolved.

use super::{Domain, Neighbour};
use crate::comm::{Comm, Parcel, Source, wire};
use crate::ids::{GlobalId, ShapeId};
use crate::particles::Particles;

impl Domain {
    /// Finds out who needs which of the owned particles and creates the ghosts and then the walls.
    /// Collective. Before: owned particles only, each with the owner of its place.
    pub fn create_ghosts(&mut self, particles: &mut Particles, comm: &mut dyn Comm) {
        let me = comm.rank();
        let period = self.period();
        let here = self.cuts.subdomain(me);
        let near = self.cuts.ranks_near(&here, &period, self.halo);
        self.neighbours = near
            .into_iter()
            .filter(|&rank| rank != me)
            .map(|rank| {
                let there = self.cuts.subdomain(rank);
                let sent = (0..particles.owned as u32)
                    .filter(|&slot| {
                        there.distance(&particles.position[slot as usize], &period) < self.halo
                    })
                    .collect();
                Neighbour { rank, sent, received: 0..0 }
            })
            .collect();

        let outgoing = self
            .neighbours
            .iter()
            .map(|n| {
                let names: Vec<(GlobalId, ShapeId)> = n
                    .sent
                    .iter()
                    .map(|&s| (particles.id[s as usize], particles.shape[s as usize]))
                    .collect();
                Parcel { rank: n.rank, bytes: wire::encode(&names) }
            })
            .collect();
        let sources: Vec<_> =
            self.neighbours.iter().map(|n| Source { rank: n.rank, size: None }).collect();
        let incoming = comm.exchange(outgoing, &sources);
        for (neighbour, parcel) in self.neighbours.iter_mut().zip(incoming) {
            let names: Vec<(GlobalId, ShapeId)> = wire::decode(&parcel.bytes);
            let first = particles.first_wall();
            particles.push_ghosts(&names);
            neighbour.received = first..first + names.len();
        }
        particles.append_walls();
    }

    /// Begins to send the state of the owned particles that are ghosts elsewhere.
    pub fn start_halo(&mut self, particles: &Particles, comm: &mut dyn Comm) {
        let ghost_bytes = particles.needs.halo_values() * size_of::<f64>();
        let outgoing: Vec<_> = self
            .neighbours
            .iter()
            .filter(|n| !n.sent.is_empty())
            .map(|n| Parcel { rank: n.rank, bytes: particles.pack_halo(&n.sent) })
            .collect();
        let sources: Vec<_> = self
            .with_ghosts()
            .map(|n| Source { rank: n.rank, size: Some(n.received.len() * ghost_bytes) })
            .collect();
        self.traffic.messages += outgoing.len() as u64;
        self.traffic.bytes += outgoing.iter().map(|p| p.bytes.len() as u64).sum::<u64>();
        self.traffic.ghosts += particles.ghosts as u64;
        comm.start(outgoing, &sources);
    }

    /// Waits for the neighbours' messages and brings the ghosts up to date.
    pub fn finish_halo(&mut self, particles: &mut Particles, comm: &mut dyn Comm) {
        let incoming = comm.finish();
        for (neighbour, parcel) in self.with_ghosts().zip(incoming) {
            particles.unpack_halo(neighbour.received.start, &parcel.bytes);
        }
    }

    fn with_ghosts(&self) -> impl Iterator<Item = &Neighbour> {
        self.neighbours.iter().filter(|n| !n.received.is_empty())
    }
}
