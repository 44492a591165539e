//! Coordination numbers of particles.
//!
//! Numbers are counted per particle of the region: `Z = (1/N) Σ contacts of the particle`. For the whole packing, with
//! `N_pp` contacts between particles and `N_pw` with walls,
//!
//! * without walls `Z = 2 N_pp / N`,
//! * with walls `Z = (2 N_pp + N_pw) / N`: a wall contact has only one particle.
//!
//! Bodies that touch in several places, for example unions, count once.
//!
//! Held particles count as walls: they are not among the `N`, and contacts with them are not contacts between
//! particles.
//!
//! The mechanical coordination number (Thornton 2000, DOI 10.1680/geot.2000.50.1.43) leaves out rattlers, which carry
//! no load: `Z_m = (2 N_c - N_1) / (N - N_0 - N_1)` with `N_0`, `N_1` the particles with no and with one contact.
//! Rattlers are removed once, not repeatedly.

use super::region::Members;
use super::sums::quotient;
use crate::ids::GlobalId;
use crate::output::tables::ContactTable;
use serde::{Deserialize, Serialize};

/// Contact counts of each particle: eight bytes per id ever given.
#[derive(Clone, Debug, Default)]
pub struct CoordinationCount {
    /// Contacts with particles, and with walls and held particles, by id.
    contacts: Vec<[u32; 2]>,
    /// Bodies of the last contact: several contacts of two bodies are consecutive.
    last: Option<(GlobalId, GlobalId)>,
}

impl CoordinationCount {
    /// Adds contacts.
    pub fn add_contacts(&mut self, contacts: &ContactTable, members: &Members) {
        for (&a, &b) in contacts.a.iter().zip(&contacts.b) {
            if self.last.replace((a, b)) == Some((a, b)) {
                continue;
            }
            if b.wall_index().is_some() || members.is_held(b) {
                self.of(a.0)[1] += 1;
            } else if members.is_held(a) {
                self.of(b.0)[1] += 1;
            } else {
                self.of(a.0)[0] += 1;
                self.of(b.0)[0] += 1;
            }
        }
    }

    fn of(&mut self, id: u64) -> &mut [u32; 2] {
        let id = id as usize;
        if id >= self.contacts.len() {
            self.contacts.resize(id + 1, [0; 2]);
        }
        &mut self.contacts[id]
    }

    /// Coordination numbers of the region.
    pub fn finish(&self, members: &Members) -> Coordination {
        let counts = || members.ids().map(|id| self.contacts.get(id).copied().unwrap_or([0; 2]));
        Coordination {
            without_walls: CoordinationNumbers::of(counts().map(|[pairs, _]| pairs)),
            with_walls: CoordinationNumbers::of(counts().map(|[pairs, walls]| pairs + walls)),
        }
    }
}

/// Coordination numbers of a region, with and without walls.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Coordination {
    /// Contacts between particles only.
    pub without_walls: CoordinationNumbers,
    /// Contacts with walls included.
    pub with_walls: CoordinationNumbers,
}

/// Distribution of the number of contacts per particle.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CoordinationNumbers {
    /// Entry `k`: number of particles with `k` contacts.
    pub histogram: Vec<u64>,
}

impl CoordinationNumbers {
    fn of(counts: impl Iterator<Item = u32>) -> Self {
        let mut histogram = Vec::new();
        for count in counts {
            let count = count as usize;
            if count >= histogram.len() {
                histogram.resize(count + 1, 0);
            }
            histogram[count] += 1;
        }
        Self { histogram }
    }

    /// Number of particles.
    pub fn particles(&self) -> u64 {
        self.histogram.iter().sum()
    }

    /// Number of contacts, each counted once per particle of the region.
    pub fn contact_ends(&self) -> u64 {
        self.histogram.iter().zip(0..).map(|(particles, k)| particles * k).sum()
    }

    /// Share of the particles that have 0, 1, 2.. contacts.
    pub fn shares(&self) -> impl Iterator<Item = f64> + '_ {
        let all = self.particles().max(1) as f64;
        self.histogram.iter().map(move |&particles| particles as f64 / all)
    }

    /// Number of particles with exactly this many contacts.
    pub fn having(&self, contacts: usize) -> u64 {
        self.histogram.get(contacts).copied().unwrap_or(0)
    }

    /// Number of particles with fewer than two contacts.
    pub fn rattlers(&self) -> u64 {
        self.having(0) + self.having(1)
    }

    /// Mean coordination number `Z`; `None` without particles.
    pub fn mean(&self) -> Option<f64> {
        quotient(self.contact_ends() as f64, self.particles() as f64)
    }

    /// Mechanical coordination number `Z_m`; `None` if all are rattlers.
    pub fn mechanical(&self) -> Option<f64> {
        let carried = self.contact_ends() - self.having(1);
        quotient(carried as f64, (self.particles() - self.rattlers()) as f64)
    }
}
