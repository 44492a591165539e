//! Which pairs may touch: a list with a skin, rebuilt when somebody has moved by half of it.
//!
//! A pair is listed when its bounding spheres are closer than the skin. That depends on positions
//! alone, never on the rank; and since a pair that does not touch leaves no trace, neither the
//! moment nor the order of listing shows in the trajectory.

mod cells;

pub use cells::close_pairs;

use crate::contact::{Found, History, NamedHistory, Pair, ordered};
use crate::ids::Slot;
use crate::law::Load;
use crate::math::Vec3;
use crate::particles::{Particles, trim};
use crate::shape::Kind;
use std::ops::Range;

/// A run of pairs of the same kinds in the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// The kinds of shape.
    pub kinds: (Kind, Kind),
    /// Does each pair have a ghost? Such pairs wait for the exchange.
    pub border: bool,
    /// Where in the list.
    pub range: Range<usize>,
}

/// The pairs that may touch, what is remembered of those that do, and who takes part in which.
#[derive(Clone, Debug, Default)]
pub struct PairList {
    /// All pairs; those of one block stand together.
    pub pairs: Vec<Pair>,
    /// What is remembered of each.
    pub history: Vec<History>,
    /// Tangential spring of each [m]; none without friction.
    pub springs: Vec<Vec3>,
    /// Runs of pairs to be resolved in one call.
    pub blocks: Vec<Block>,
    /// Until the travel of both bodies adds up to this [m], a pair need not be looked at. It may be
    /// too low, never too high, so it saves work and changes nothing.
    rests_until: Vec<f32>,
    /// The pairs that touched at the last step.
    touching: Vec<u32>,
    /// Of owned particle `s`, `incident[first[s]..first[s + 1]]` are its pairs by rising id of the partner.
    first: Vec<u32>,
    incident: Vec<Incidence>,
    /// The pairs that touched at the last step and have come apart. Until they are forgotten, what is
    /// remembered of them is still there.
    pub parted: Vec<u32>,
    /// Which load belongs to each pair: those of the contacts come first, then those of `parted`.
    load_of: Vec<u32>,
    /// How many contacts there are.
    contacts: u32,
}

/// A pair as one of its particles sees it: twice the pair's number, and one more for the first body.
#[derive(Clone, Copy, Debug)]
struct Incidence(u32);

impl Incidence {
    const fn new(pair: usize, is_a: bool) -> Self {
        Self((pair as u32) << 1 | is_a as u32)
    }

    const fn pair(self) -> u32 {
        self.0 >> 1
    }

    const fn is_a(self) -> bool {
        self.0 & 1 == 1
    }
}

const NO_LOAD: u32 = u32::MAX;

/// Leaves room for the rounding of clearances and travels, and of their sum to `f32`.
const ROUNDING: f64 = 1.0 - 1e-6;

impl PairList {
    /// Lists the pairs that [`close_pairs`] has found. `carried` has the histories of all touching contacts of owned particles, in any order; a
    /// contact may stand there twice.
    pub fn rebuild(
        &mut self,
        particles: &mut Particles,
        found: Vec<Pair>,
        carried: &mut [NamedHistory],
    ) {
        self.sort_into_blocks(particles, found);
        self.history.clear();
        self.history.resize(self.pairs.len(), History::default());
        self.springs.clear();
        if particles.needs.springs {
            self.springs.resize(self.pairs.len(), Vec3::zeros());
        }
        self.rests_until.clear();
        self.rests_until.resize(self.pairs.len(), 0.0);
        self.load_of.clear();
        self.load_of.resize(self.pairs.len(), NO_LOAD);
        self.touching.clear();
        self.parted.clear();

        carried.sort_unstable_by_key(|c| (c.a, c.b));
        for (index, pair) in self.pairs.iter().enumerate() {
            let key = (particles.id[pair.a.index()], particles.id[pair.b.index()]);
            if let Ok(at) = carried.binary_search_by_key(&key, |c| (c.a, c.b)) {
                self.history[index] = carried[at].history;
                if let Some(spring) = self.springs.get_mut(index) {
                    *spring = carried[at].spring;
                }
                self.touching.push(index as u32);
            }
        }
        self.collect_incidences(particles);
        self.trim();

        let owned = particles.owned;
        particles.listed_at.copy_from_slice(&particles.position[..owned]);
        particles.travel.clear();
        particles.travel.resize(particles.slots(), 0.0);
        for wall in &mut particles.walls {
            wall.listed_at = wall.point;
        }
    }

    fn sort_into_blocks(&mut self, particles: &Particles, found: Vec<Pair>) {
        let kind =
            |slot: Slot| particles.library.shapes[particles.shape[slot.index()].index()].kind();
        let block_of = |pair: &Pair| {
            let ghosts = particles.owned..particles.first_wall();
            let border = ghosts.contains(&pair.a.index()) || ghosts.contains(&pair.b.index());
            (border, ordered((kind(pair.a), kind(pair.b))))
        };
        let mut keyed: Vec<_> = found.into_iter().map(|pair| (block_of(&pair), pair)).collect();
        // Stable: within a block the pairs stay in the order of the cells, neighbours close in memory.
        keyed.sort_by_key(|(block, _)| *block);
        self.blocks.clear();
        for run in keyed.chunk_by(|(x, _), (y, _)| x == y) {
            let (border, kinds) = run[0].0;
            let start = self.blocks.last().map_or(0, |b| b.range.end);
            self.blocks.push(Block { kinds, border, range: start..start + run.len() });
        }
        self.pairs.clear();
        self.pairs.extend(keyed.into_iter().map(|(_, pair)| pair));
    }

    fn collect_incidences(&mut self, particles: &Particles) {
        let owned = particles.owned;
        let mine = |index: usize, pair: &Pair| {
            [(pair.a, true), (pair.b, false)]
                .into_iter()
                .filter(move |(slot, _)| slot.index() < owned)
                .map(move |(slot, is_a)| (slot.index(), Incidence::new(index, is_a)))
        };
        self.first.clear();
        self.first.resize(owned + 1, 0);
        for (index, pair) in self.pairs.iter().enumerate() {
            mine(index, pair).for_each(|(slot, _)| self.first[slot + 1] += 1);
        }
        for slot in 0..owned {
            self.first[slot + 1] += self.first[slot];
        }
        self.incident.clear();
        self.incident.resize(self.first[owned] as usize, Incidence(0));
        let mut next = self.first.clone();
        for (index, pair) in self.pairs.iter().enumerate() {
            for (slot, incidence) in mine(index, pair) {
                self.incident[next[slot] as usize] = incidence;
                next[slot] += 1;
            }
        }
        let Self { pairs, first, incident, .. } = self;
        for slot in 0..owned {
            incident[first[slot] as usize..first[slot + 1] as usize].sort_unstable_by_key(|i| {
                let Pair { a, b } = pairs[i.pair() as usize];
                particles.id[if i.is_a() { b } else { a }.index()]
            });
        }
    }

    /// The pairs of a block that must be looked at.
    pub fn active(&self, block: &Block, particles: &Particles) -> Vec<u32> {
        // Every index is written, and the next one over it if the pair rests: no branch to be guessed wrongly.
        let mut active = vec![0; block.range.len() + 1];
        let mut count = 0;
        let pairs = &self.pairs[block.range.clone()];
        let rests_until = &self.rests_until[block.range.clone()];
        for ((pair, rests_until), index) in pairs.iter().zip(rests_until).zip(block.range.start..) {
            let travel = particles.travel[pair.a.index()] + particles.travel[pair.b.index()];
            active[count] = index as u32;
            count += usize::from(travel >= f64::from(*rests_until));
        }
        active.truncate(count);
        active
    }

    /// After resolution: takes note of which pairs touch now, which have come apart, and how long those
    /// that are apart can rest.
    pub fn note(&mut self, found: &Found, particles: &Particles) {
        for &(index, clearance) in &found.apart {
            let Pair { a, b } = self.pairs[index as usize];
            let travel = particles.travel[a.index()] + particles.travel[b.index()];
            self.rests_until[index as usize] = ((travel + clearance) * ROUNDING) as f32;
        }
        self.load_of.fill(NO_LOAD);
        for (index, contact) in found.contacts.iter().enumerate() {
            self.load_of[contact.pair as usize] = index as u32;
            self.rests_until[contact.pair as usize] = 0.0;
        }
        self.contacts = found.contacts.len() as u32;
        self.parted.clear();
        for &pair in &self.touching {
            if self.load_of[pair as usize] == NO_LOAD {
                self.load_of[pair as usize] = self.contacts + self.parted.len() as u32;
                self.parted.push(pair);
            }
        }
        self.touching.clear();
        self.touching.extend(found.contacts.iter().map(|c| c.pair));
    }

    /// Forgets the histories of pairs that have come apart.
    pub fn forget_parted(&mut self) {
        for &pair in &self.parted {
            self.history[pair as usize] = History::default();
            if let Some(spring) = self.springs.get_mut(pair as usize) {
                *spring = Vec3::zeros();
            }
        }
    }

    /// Sums the loads of this step into the owned particles, each in the order of its partners' ids: the
    /// same bits on any number of ranks. `loads` are those of the contacts, then those of the parted pairs.
    pub fn gather(&self, loads: &[Load], particles: &mut Particles) {
        for slot in 0..particles.owned {
            let mut force = Vec3::zeros();
            let mut torque = Vec3::zeros();
            let (mut dissipated, mut received) = (0.0, 0.0);
            for incidence in self.incident_to(slot) {
                let load = self.load_of[incidence.pair() as usize];
                if load == NO_LOAD {
                    continue;
                }
                let load = &loads[load as usize];
                if incidence.is_a() {
                    force -= load.force;
                    torque += load.torque_a;
                    received += load.received;
                } else {
                    force += load.force;
                    torque += load.torque_b;
                }
                let with_wall =
                    self.pairs[incidence.pair() as usize].b.index() >= particles.first_wall();
                dissipated += if with_wall { load.dissipated } else { 0.5 * load.dissipated };
            }
            particles.force[slot] = force;
            particles.dissipated[slot] += dissipated;
            particles.received[slot] += received;
            if let Some(spin) = &mut particles.spin {
                spin.torque[slot] = torque;
            }
        }
    }

    fn incident_to(&self, slot: usize) -> &[Incidence] {
        &self.incident[self.first[slot] as usize..self.first[slot + 1] as usize]
    }

    /// How many pairs were listed for an owned particle; 0 if it came after the last listing.
    pub fn listed_for(&self, slot: usize) -> i64 {
        if slot + 1 < self.first.len() { self.incident_to(slot).len() as i64 } else { 0 }
    }

    /// How many contacts an owned particle has in this step, with particles and walls.
    pub fn coordination(&self, slot: usize) -> usize {
        self.incident_to(slot)
            .iter()
            .filter(|i| self.load_of[i.pair() as usize] < self.contacts)
            .count()
    }

    /// The pairs that touched at the last step, or were carried over a rebuild.
    pub fn touching(&self) -> &[u32] {
        &self.touching
    }

    /// The tangential spring of one pair [m]; zero without friction.
    #[inline]
    pub fn spring(&self, pair: u32) -> Vec3 {
        self.springs.get(pair as usize).copied().unwrap_or_default()
    }

    /// Gives back room that longer lists have needed.
    fn trim(&mut self) {
        trim(&mut self.pairs);
        trim(&mut self.history);
        trim(&mut self.springs);
        trim(&mut self.rests_until);
        trim(&mut self.incident);
        trim(&mut self.load_of);
    }

    /// Bytes that the list and all that is remembered hold.
    pub fn bytes(&self) -> usize {
        fn held<T>(column: &Vec<T>) -> usize {
            column.capacity() * size_of::<T>()
        }
        held(&self.pairs)
            + held(&self.history)
            + held(&self.springs)
            + held(&self.rests_until)
            + held(&self.touching)
            + held(&self.first)
            + held(&self.incident)
            + held(&self.parted)
            + held(&self.load_of)
    }

    /// What is remembered of one pair, under its lasting name.
    pub fn named(&self, pair: u32, particles: &Particles) -> NamedHistory {
        let Pair { a, b } = self.pairs[pair as usize];
        NamedHistory {
            a: particles.id[a.index()],
            b: particles.id[b.index()],
            history: self.history[pair as usize],
            spring: self.spring(pair),
        }
    }
}

/// Square of the largest distance that an owned particle or a wall has moved since the pairs were
/// listed [m²]; infinite if a position is not a number.
pub fn moved_squared(particles: &Particles) -> f64 {
    let mut largest = 0.0;
    let mut sound = true;
    for (now, then) in particles.position.iter().zip(&particles.listed_at) {
        let moved = crate::contact::nearest_image(now - then, &particles.period).norm_squared();
        if moved > largest {
            largest = moved;
        }
        sound &= moved.is_finite();
    }
    for wall in &particles.walls {
        let moved = (wall.point - wall.listed_at).norm_squared();
        if moved > largest {
            largest = moved;
        }
    }
    if sound { largest } else { f64::INFINITY }
}
