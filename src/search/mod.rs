//! Which pairs may touch: a list with a skin, rebuilt when somebody has moved by half of it.
//!
//! A pair is listed when its bounding spheres are closer than the skin. That depends on positions
//! alone, never on the rank; and since a pair that does not touch leaves no trace, neither the
//! moment nor the order of listing shows in the trajectory.

mod cells;

pub use cells::close_pairs;

use crate::contact::{Batch, Contact, History, NamedHistory, Pair, ordered};
use crate::ids::Slot;
use crate::law::{Load, Memory};
use crate::math::Vec3;
use crate::particles::{Needs, Particles, held, trim};
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
    /// Runs of pairs of the same kinds.
    pub blocks: Vec<Block>,
    /// Until the travel of both bodies adds up to this [m], a pair need not be looked at. It may be
    /// too low, never too high, so it saves work and changes nothing.
    rests_until: Vec<f32>,
    /// Where each pair stands among those that touch, or `NOWHERE`.
    place: Vec<u32>,
    /// The pairs that touched at the last step, or were carried over a rebuild.
    touching: Vec<u32>,
    /// What is remembered of each of them.
    history: Vec<History>,
    /// Their tangential springs [m]; none without friction.
    springs: Vec<Vec3>,
    /// The load of each: those of the contacts come first, then those of `parted`.
    load_of: Vec<u32>,
    /// Of owned particle `s`, `incident[first[s]..first[s + 1]]` are its pairs by rising id of the partner.
    first: Vec<u32>,
    incident: Vec<Incidence>,
    /// The pairs that touched at the last step and have come apart. Until they are forgotten, what is
    /// remembered of them is still there.
    parted: Vec<u32>,
}

/// A contact of this step.
#[derive(Clone, Copy, Debug)]
pub struct Loaded<'a> {
    /// Its bodies.
    pub pair: Pair,
    /// Normal, overlap and normal force.
    pub history: &'a History,
    /// Tangential spring [m]; zero without friction.
    pub spring: Vec3,
    /// Force and contact point.
    pub load: &'a Load,
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

const NOWHERE: u32 = u32::MAX;

/// This many pairs are resolved in one call: enough for its cost not to count, few enough for what it finds to
/// take no memory worth mentioning.
const AT_ONCE: usize = 4096;

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
        self.rests_until.clear();
        self.rests_until.resize(self.pairs.len(), 0.0);
        self.place.clear();
        self.place.resize(self.pairs.len(), NOWHERE);
        self.touching.clear();
        self.history.clear();
        self.springs.clear();
        self.load_of.clear();
        self.parted.clear();

        carried.sort_unstable_by_key(|c| (c.a, c.b));
        for (index, pair) in self.pairs.iter().enumerate() {
            let key = (particles.id[pair.a.index()], particles.id[pair.b.index()]);
            if let Ok(at) = carried.binary_search_by_key(&key, |c| (c.a, c.b)) {
                self.place[index] = self.touching.len() as u32;
                self.touching.push(index as u32);
                self.history.push(carried[at].history);
                if particles.needs.springs {
                    self.springs.push(carried[at].spring);
                }
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

    /// The blocks with or without ghosts, in pieces to be resolved in one call each.
    pub fn pieces(&self, border: bool) -> Vec<Block> {
        let blocks = self.blocks.iter().filter(|block| block.border == border);
        let pieces = blocks.flat_map(|Block { kinds, range, .. }| {
            let piece = |start| start..range.end.min(start + AT_ONCE);
            range.clone().step_by(AT_ONCE).map(move |start| Block {
                kinds: *kinds,
                border,
                range: piece(start),
            })
        });
        pieces.collect()
    }

    /// Which of these pairs must be looked at.
    pub fn active(&self, range: Range<usize>, particles: &Particles) -> Vec<u32> {
        // Every index is written, and the next one over it if the pair rests: no branch to be guessed wrongly.
        let mut active = vec![0; range.len() + 1];
        let mut count = 0;
        let pairs = &self.pairs[range.clone()];
        let rests_until = &self.rests_until[range.clone()];
        for ((pair, rests_until), index) in pairs.iter().zip(rests_until).zip(range.start..) {
            let travel = particles.travel[pair.a.index()] + particles.travel[pair.b.index()];
            active[count] = index as u32;
            count += usize::from(travel >= f64::from(*rests_until));
        }
        active.truncate(count);
        active
    }

    /// These pairs as resolvers see them.
    pub fn batch<'a>(&'a self, active: &'a [u32], particles: &'a Particles) -> Batch<'a> {
        Batch {
            pairs: &self.pairs,
            place: &self.place,
            history: &self.history,
            active,
            bodies: particles.bodies(),
        }
    }

    /// Lets pairs that are apart rest until their surfaces can have come nearer by so much [m].
    pub fn let_rest(&mut self, apart: &[(u32, f64)], particles: &Particles) {
        for &(index, clearance) in apart {
            let Pair { a, b } = self.pairs[index as usize];
            let travel = particles.travel[a.index()] + particles.travel[b.index()];
            self.rests_until[index as usize] = ((travel + clearance) * ROUNDING) as f32;
        }
    }

    /// Takes note of which pairs touch now, and which have come apart.
    pub fn note(&mut self, contacts: &[Contact], needs: Needs) {
        self.load_of.clear();
        self.load_of.resize(self.touching.len(), NOWHERE);
        for (load, contact) in (0..).zip(contacts) {
            let place = &mut self.place[contact.pair as usize];
            if *place == NOWHERE {
                *place = self.touching.len() as u32;
                self.touching.push(contact.pair);
                self.load_of.push(load);
            } else {
                self.load_of[*place as usize] = load;
            }
        }
        self.history.resize(self.touching.len(), History::default());
        if needs.springs {
            self.springs.resize(self.touching.len(), Vec3::zeros());
        }
        self.parted.clear();
        for (load, &pair) in self.load_of.iter_mut().zip(&self.touching) {
            if *load == NOWHERE {
                *load = (contacts.len() + self.parted.len()) as u32;
                self.parted.push(pair);
            }
        }
        trim(&mut self.load_of);
        trim(&mut self.touching);
        trim(&mut self.history);
        trim(&mut self.springs);
    }

    /// All pairs, those that have come apart, and what laws remember.
    pub fn memory(&mut self) -> (&[Pair], &[u32], Memory<'_>) {
        let Self { pairs, parted, place, history, springs, .. } = self;
        (pairs, parted, Memory { place, history, springs })
    }

    /// Forgets the pairs that have come apart; the last that touch move to their places.
    pub fn forget_parted(&mut self) {
        for &pair in &self.parted {
            let place = std::mem::replace(&mut self.place[pair as usize], NOWHERE) as usize;
            self.touching.swap_remove(place);
            self.history.swap_remove(place);
            self.load_of.swap_remove(place);
            if !self.springs.is_empty() {
                self.springs.swap_remove(place);
            }
            if let Some(&moved) = self.touching.get(place) {
                self.place[moved as usize] = place as u32;
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
                let place = self.place[incidence.pair() as usize];
                if place == NOWHERE {
                    continue;
                }
                let pair = self.pairs[incidence.pair() as usize];
                let load = &loads[self.load_of[place as usize] as usize];
                if incidence.is_a() {
                    force -= load.force;
                    torque += load.torque_a();
                    received += load.received;
                } else {
                    force += load.force;
                    torque += load.torque_b(&particles.bodies().relative(pair));
                }
                let with_wall = pair.b.index() >= particles.first_wall();
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

    /// The contacts of this step, in any order. `loads` are those of the step.
    pub fn contacts<'a>(&'a self, loads: &'a [Load]) -> impl Iterator<Item = Loaded<'a>> {
        self.touching.iter().zip(&self.history).zip(&self.load_of).map(
            |((&pair, history), &load)| Loaded {
                pair: self.pairs[pair as usize],
                history,
                spring: self.spring(pair),
                load: &loads[load as usize],
            },
        )
    }

    /// How many contacts an owned particle has in this step, with particles and walls.
    pub fn coordination(&self, slot: usize) -> usize {
        self.incident_to(slot).iter().filter(|i| self.place[i.pair() as usize] != NOWHERE).count()
    }

    /// The pairs that touched at the last step, or were carried over a rebuild.
    pub fn touching(&self) -> &[u32] {
        &self.touching
    }

    /// What is remembered of one pair that touches.
    #[inline]
    pub fn history(&self, pair: u32) -> &History {
        &self.history[self.place[pair as usize] as usize]
    }

    /// The tangential spring of one pair that touches [m]; zero without friction.
    #[inline]
    pub fn spring(&self, pair: u32) -> Vec3 {
        self.springs.get(self.place[pair as usize] as usize).copied().unwrap_or_default()
    }

    /// Gives back room that longer lists have needed.
    fn trim(&mut self) {
        self.pairs.shrink_to_fit();
        self.rests_until.shrink_to_fit();
        self.place.shrink_to_fit();
        self.first.shrink_to_fit();
        self.incident.shrink_to_fit();
    }

    /// Bytes that the list holds.
    pub fn bytes(&self) -> usize {
        held(&self.pairs)
            + held(&self.rests_until)
            + held(&self.place)
            + held(&self.first)
            + held(&self.incident)
    }

    /// Bytes that all that is remembered of touching pairs holds.
    pub fn memory_bytes(&self) -> usize {
        held(&self.touching)
            + held(&self.history)
            + held(&self.springs)
            + held(&self.load_of)
            + held(&self.parted)
    }

    /// What is remembered of one pair, under its lasting name.
    pub fn named(&self, pair: u32, particles: &Particles) -> NamedHistory {
        let Pair { a, b } = self.pairs[pair as usize];
        NamedHistory {
            a: particles.id[a.index()],
            b: particles.id[b.index()],
            history: *self.history(pair),
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
