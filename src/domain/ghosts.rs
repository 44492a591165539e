//! The halo: copies of the particles of neighbouring ranks that this rank's particles may touch.
//!
//! When the pairs are listed, each rank offers its neighbours all particles whose own reach comes as far
//! as theirs can. Once the pairs are known, only ghosts in a pair are kept. Both ranks list the same
//! pairs, so each knows the ghosts that the other keeps, without a message. A small particle is thus a
//! ghost only near a partner, for any size of the largest particle.
//!
//! One message per neighbour and step, plain packed `f64`, sent before and received after the contacts
//! among owned particles are resolved.

use super::{Domain, Neighbour};
use crate::comm::{Comm, Parcel, Source, wire};
use crate::contact::Pair;
use crate::ids::{GlobalId, ShapeId, Slot, Standing};
use crate::math::Vec3;
use crate::particles::Particles;
use serde::{Deserialize, Serialize};

/// Data to make ghosts.
#[derive(Default, Serialize, Deserialize)]
struct Offers {
    names: Vec<(GlobalId, ShapeId, Standing)>,
    /// One for each, or empty if all particles have the size of their shapes.
    scale: Vec<f64>,
    position: Vec<Vec3>,
}

impl Offers {
    /// Particles in these slots.
    fn of(particles: &Particles, slots: impl Iterator<Item = usize>) -> Self {
        let mut offers = Self::default();
        for slot in slots {
            let Particles { id, shape, standing, .. } = particles;
            offers.names.push((id[slot], shape[slot], standing[slot]));
            offers.position.push(particles.position[slot]);
            if particles.needs.scale {
                offers.scale.push(particles.scale[slot]);
            }
        }
        offers
    }
}

/// Factor on the distance of offered particles, for the rounding of positions: the other rank must see
/// what one rank lists.
const LEEWAY: f64 = 1.0 + 1e-9;

impl Domain {
    /// Receives from the neighbours all particles that may be in a pair with an owned one, with their
    /// names, shapes and places only. Collective. Before: owned particles only, each with the owner of
    /// its place. After: ghosts, but no walls.
    pub fn offer_ghosts(&mut self, particles: &mut Particles, comm: &mut dyn Comm) {
        let is_mine = |place: &Vec3| self.owner(place) == comm.rank();
        debug_assert!(particles.position[..particles.owned].iter().all(is_mine));
        let largest = particles.library.largest_radius();
        let near = self.cuts.ranks_near(comm.rank(), &particles.cell, self.halo * LEEWAY);
        // A particle may be slightly outside at a soft wall, but its owner is inside.
        let inside: Vec<Vec3> = particles.position[..particles.owned]
            .iter()
            .map(|p| self.clamped(p, &particles.cell))
            .collect();
        self.neighbours = near
            .into_iter()
            .map(|rank| {
                let there = self.cuts.subdomain(rank);
                let sent = (0..particles.owned as u32)
                    .filter(|&slot| {
                        let reach = self.halo - (largest - particles.radius(slot as usize));
                        there.distance(&inside[slot as usize], &particles.cell) < reach * LEEWAY
                    })
                    .collect();
                Neighbour { rank, sent, received: 0..0 }
            })
            .collect();
        self.knows_neighbours = true;

        let outgoing = self
            .neighbours
            .iter()
            .map(|n| {
                let offers = Offers::of(particles, n.sent.iter().map(|&slot| slot as usize));
                Parcel { rank: n.rank, bytes: wire::encode(&offers) }
            })
            .collect();
        let incoming = comm.exchange(outgoing, &self.all_neighbours());
        let offers = incoming.iter().map(|parcel| wire::decode::<Offers>(&parcel.bytes));
        self.take_ghosts(particles, offers);
        self.offered = particles.ghosts;
    }

    /// Drops the ghosts that are in none of `pairs`, renumbers the slots in these, and appends pieces
    /// and walls. Pairs are still of bodies, not of pieces.
    pub fn keep_paired_ghosts(&mut self, particles: &mut Particles, pairs: &mut [Pair]) {
        let owned = particles.owned;
        let ghosts = owned..particles.first_facet();
        let mut kept = vec![false; ghosts.len()];
        let mut needed: Vec<Vec<bool>> =
            self.neighbours.iter().map(|n| vec![false; n.sent.len()]).collect();
        for Pair { a, b } in pairs.iter() {
            for (mine, ghost) in [(a, b), (b, a)] {
                if mine.index() < owned && ghosts.contains(&ghost.index()) {
                    kept[ghost.index() - owned] = true;
                    let whose =
                        self.neighbours.partition_point(|n| n.received.end <= ghost.index());
                    if let Ok(at) = self.neighbours[whose].sent.binary_search(&mine.0) {
                        needed[whose][at] = true;
                    }
                }
            }
        }

        let mut number = Vec::with_capacity(kept.len());
        let mut count = 0;
        for &kept in &kept {
            number.push(owned + count);
            count += usize::from(kept);
        }
        for slot in pairs.iter_mut().flat_map(|pair| [&mut pair.a, &mut pair.b]) {
            if ghosts.contains(&slot.index()) {
                *slot = Slot(number[slot.index() - owned] as u32);
            } else if slot.index() >= ghosts.end {
                slot.0 -= (kept.len() - count) as u32;
            }
        }

        let offers: Vec<Offers> = self
            .neighbours
            .iter()
            .map(|n| {
                let stay = n.received.clone().filter(|&slot| kept[slot - owned]);
                Offers::of(particles, stay)
            })
            .collect();
        for (neighbour, needed) in self.neighbours.iter_mut().zip(needed) {
            let mut needed = needed.into_iter();
            neighbour.sent.retain(|_| needed.next() == Some(true));
            neighbour.sent.shrink_to_fit();
        }
        particles.strip_to_owned();
        self.take_ghosts(particles, offers);
        particles.append_pieces_and_walls();
        let (facets, pieces) = (particles.first_piece(), particles.pieces());
        for slot in pairs.iter_mut().map(|pair| &mut pair.b) {
            if slot.index() >= facets {
                slot.0 += pieces as u32;
            }
        }
    }

    /// Appends the ghosts of one neighbour after the other.
    fn take_ghosts(&mut self, particles: &mut Particles, offers: impl IntoIterator<Item = Offers>) {
        for (neighbour, offers) in self.neighbours.iter_mut().zip(offers) {
            let received = particles.first_facet()..particles.first_facet() + offers.names.len();
            particles.push_ghosts(&offers.names, &offers.scale);
            particles.position[received.clone()].copy_from_slice(&offers.position);
            neighbour.received = received;
        }
    }

    /// One message of unknown size from each neighbour.
    pub(super) fn all_neighbours(&self) -> Vec<Source> {
        self.neighbours.iter().map(|n| Source { rank: n.rank, size: None }).collect()
    }

    /// Starts to send the state of the owned particles that are ghosts elsewhere.
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
        self.traffic.offered += self.offered as u64;
        self.traffic.owned += particles.owned as u64;
        comm.start(outgoing, &sources);
    }

    /// Waits for the neighbours' messages and updates the ghosts.
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
