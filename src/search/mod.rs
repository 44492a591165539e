//! Which pairs may touch: a list with a skin, rebuilt when somebody has moved by half of it.
//!
//! A pair is listed when its bounding spheres are closer than the skin. That depends on positions
//! alone, never on the rank; and since a pair that does not touch leaves no trace, neither the
//! moment nor the order of listing shows in the trajectory.

mod cells;

pub use cells::close_pairs;

use crate::contact::{
    Batch, Contact, Found, History, NamedHistory, Pair, Place, Touch, ordered, touch_of_ball,
};
use crate::ids::Slot;
use crate::law::{ForceLaw, Load, Memory, WallWork, torque_on_a, torque_on_b};
use crate::math::Vec3;
use crate::particles::{Needs, Particles, held, trim};
use crate::shape::Kind;
use std::collections::BTreeMap;
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
    /// Where each pair stands among those that touch; of those that do not, until when they rest.
    place: Vec<Place>,
    /// The pairs that touched at the last step, or were carried over a rebuild; then those found touching since.
    touching: Vec<u32>,
    /// What is remembered of each of them. Those found since are not there before [`PairList::note`].
    history: Vec<History>,
    /// Their tangential springs [m]; none without friction.
    springs: Vec<Vec3>,
    /// Their normal forces [N]; none without dashpots.
    normal_forces: Vec<f64>,
    /// What each does to its bodies; in the course of a step, what resolvers say of it.
    loads: Vec<Load>,
    /// Where each acts, seen from the centre of A [m]; none if all are balls.
    points: Vec<Vec3>,
    /// The pairs that have come apart since the last step. From [`PairList::note`] on they stand last among those
    /// that touch, until they are forgotten.
    parted: Vec<u32>,
    /// Of owned particle `s`, `incident[first[s]..first[s + 1]]` are its pairs by rising id of the partner.
    first: Vec<u32>,
    incident: Vec<Incidence>,
}

/// A contact of this step.
#[derive(Clone, Copy, Debug)]
pub struct Loaded<'a> {
    /// Its bodies.
    pub pair: Pair,
    /// Normal and overlap.
    pub history: &'a History,
    /// Tangential spring [m]; zero without friction.
    pub spring: Vec3,
    /// Normal force [N].
    pub normal_force: f64,
    /// Force of A on B [N]; A feels the opposite.
    pub force: Vec3,
    /// Where it acts, seen from the centre of A [m].
    pub point: Vec3,
}

/// A pair as one of its particles sees it: twice the pair's number, and one more for the first body.
#[derive(Clone, Copy, Debug)]
struct Incidence(u32);

impl Incidence {
    /// As many pairs as have numbers.
    const MOST: usize = 1 << (u32::BITS - 1);

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

/// This many pairs are resolved in one call: enough for its cost not to count, few enough for what it finds to
/// take no memory worth mentioning.
const AT_ONCE: usize = 512;

/// Leaves room for the rounding of the sum of clearance and travels to `f32`, and of travels.
const TO_SINGLE: f64 = 1e-6;
/// Leaves room for the rounding of a clearance, over the radius of a body.
const ROUNDING: f64 = 1e-12;

impl PairList {
    /// Lists the pairs that [`close_pairs`] has found. `carried` has the histories of all touching contacts of owned
    /// particles, in any order; a contact may stand there twice.
    ///
    /// # Panics
    /// If there are more pairs than have numbers, 2^31.
    pub fn rebuild(
        &mut self,
        particles: &mut Particles,
        found: Vec<Pair>,
        carried: &mut [NamedHistory],
    ) {
        assert!(
            found.len() <= Incidence::MOST,
            "2^31 pairs on a rank: take more ranks, or a smaller skin"
        );
        self.sort_into_blocks(particles, &found);
        drop(found);
        self.place.clear();
        self.place.resize(self.pairs.len(), Place::DUE);
        self.touching.clear();
        self.history.clear();
        self.springs.clear();
        self.normal_forces.clear();

        carried.sort_unstable_by_key(|c| (c.a, c.b));
        for (index, pair) in self.pairs.iter().enumerate() {
            let key = (particles.id[pair.a.index()], particles.id[pair.b.index()]);
            if let Ok(at) = carried.binary_search_by_key(&key, |c| (c.a, c.b)) {
                self.place[index] = Place::among(self.touching.len());
                self.touching.push(index as u32);
                self.history.push(carried[at].history);
                if particles.needs.springs {
                    self.springs.push(carried[at].spring);
                }
                if particles.needs.dashpots {
                    self.normal_forces.push(carried[at].normal_force);
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

    fn sort_into_blocks(&mut self, particles: &Particles, found: &[Pair]) {
        let kind =
            |slot: Slot| particles.library.shapes[particles.shape[slot.index()].index()].kind();
        let block_of = |pair: &Pair| {
            let ghosts = particles.owned..particles.first_wall();
            let border = ghosts.contains(&pair.a.index()) || ghosts.contains(&pair.b.index());
            (border, ordered((kind(pair.a), kind(pair.b))))
        };
        // Counted first, then each to its place: sorting with keys would hold all pairs three times.
        let mut next: BTreeMap<_, usize> = BTreeMap::new();
        for pair in found {
            *next.entry(block_of(pair)).or_default() += 1;
        }
        self.blocks.clear();
        let mut start = 0;
        for (&(border, kinds), place) in &mut next {
            let count = std::mem::replace(place, start);
            self.blocks.push(Block { kinds, border, range: start..start + count });
            start += count;
        }
        self.pairs.clear();
        self.pairs.resize(found.len(), Pair { a: Slot(0), b: Slot(0) });
        // Within a block the pairs stay in the order of the cells, neighbours close in memory.
        for pair in found {
            if let Some(place) = next.get_mut(&block_of(pair)) {
                self.pairs[*place] = *pair;
                *place += 1;
            }
        }
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
        let places = &self.place[range.clone()];
        for ((pair, place), index) in pairs.iter().zip(places).zip(range.start..) {
            active[count] = index as u32;
            count += usize::from(place.is_due(travel(*pair, particles)));
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

    /// Forgets what resolvers have said since the last [`PairList::note`].
    pub fn forget_taken(&mut self) {
        let known = self.history.len();
        for pair in self.touching.drain(known..) {
            self.place[pair as usize] = Place::DUE;
        }
        self.loads.resize(known, Load::default());
        self.points.truncate(known);
        self.parted.clear();
    }

    /// Takes what a resolver has found: pairs that touch, and pairs that rest until their surfaces can have come
    /// near enough.
    pub fn take(&mut self, found: &mut Found, particles: &Particles) {
        let has_points = particles.needs.attitude;
        if has_points {
            self.points.resize(self.loads.len(), Vec3::zeros());
        }
        for Contact { pair, touch } in &found.contacts {
            let place = &mut self.place[*pair as usize];
            if let Some(load) = self.loads.get_mut(place.index()) {
                load.stand_for(touch);
                if has_points {
                    self.points[place.index()] = touch.point;
                }
            } else {
                *place = Place::among(self.touching.len());
                self.touching.push(*pair);
                self.loads.push(Load::of(touch));
                if has_points {
                    self.points.push(touch.point);
                }
            }
        }
        found.contacts.clear();
        let rounding = particles.rounding_of_images();
        for (pair, clearance) in found.apart.drain(..) {
            let place = &mut self.place[pair as usize];
            if place.touches() {
                self.parted.push(pair);
            } else {
                let pair = self.pairs[pair as usize];
                let margin = rounding + ROUNDING * particles.radius(pair.a.index());
                let until = travel(pair, particles) + (clearance - margin);
                *place = Place::resting((until * (1.0 - TO_SINGLE)) as f32);
            }
        }
    }

    /// Takes note of which pairs touch now, when all have been looked at: those that have come apart move to the end.
    pub fn note(&mut self, needs: Needs) {
        self.history.resize(self.touching.len(), History::default());
        if needs.springs {
            self.springs.resize(self.touching.len(), Vec3::zeros());
        }
        if needs.dashpots {
            self.normal_forces.resize(self.touching.len(), 0.0);
        }
        for index in 0..self.parted.len() {
            let (place, last) =
                (self.place[self.parted[index] as usize].index(), self.touching.len() - 1 - index);
            self.touching.swap(place, last);
            self.history.swap(place, last);
            self.loads.swap(place, last);
            if needs.springs {
                self.springs.swap(place, last);
            }
            if needs.dashpots {
                self.normal_forces.swap(place, last);
            }
            if needs.attitude {
                self.points.swap(place, last);
            }
            for place in [place, last] {
                self.place[self.touching[place] as usize] = Place::among(place);
            }
        }
        trim(&mut self.touching);
        trim(&mut self.history);
        trim(&mut self.springs);
        trim(&mut self.normal_forces);
        trim(&mut self.loads);
        trim(&mut self.points);
    }

    /// Turns what resolvers have said into loads by `law`, and those into forces on the owned particles. Then the
    /// pairs that have come apart are forgotten.
    pub fn load(&mut self, law: &dyn ForceLaw, particles: &mut Particles, dt: f64) {
        let Self {
            pairs, touching, history, springs, normal_forces, loads, points, parted, ..
        } = self;
        let still = touching.len() - parted.len();
        let mut memory =
            Memory { listed: pairs, pairs: touching, history, springs, normal_forces, points };
        let mut wall_work = Vec::new();
        law.apply(&mut loads[..still], &mut memory, particles, dt, &mut wall_work);
        law.part(&mut loads[still..], &memory, particles, dt, &mut wall_work);
        self.gather(particles);
        add_wall_work(wall_work, particles);

        for pair in self.parted.drain(..) {
            self.place[pair as usize] = Place::DUE;
        }
        self.touching.truncate(still);
        self.history.truncate(still);
        self.springs.truncate(still);
        self.normal_forces.truncate(still);
        self.loads.truncate(still);
        self.points.truncate(still);
    }

    /// Sums the loads of this step into the owned particles, each in the order of its partners' ids: the
    /// same bits on any number of ranks.
    fn gather(&self, particles: &mut Particles) {
        let mut room = Vec::new();
        for slot in 0..particles.owned {
            let mut force = Vec3::zeros();
            let mut torque = Vec3::zeros();
            let mut dissipated = 0.0;
            for (incidence, place) in self.touching_of(slot, &mut room) {
                let load = &self.loads[place.index()];
                let pair = self.pairs[incidence.pair() as usize];
                if incidence.is_a() {
                    force -= load.force;
                } else {
                    force += load.force;
                }
                if particles.needs.spin {
                    let point = self.point(*place, pair, particles);
                    torque += if incidence.is_a() {
                        torque_on_a(&load.force, &point)
                    } else {
                        torque_on_b(&load.force, &point, &particles.bodies().relative(pair))
                    };
                }
                let with_wall = pair.b.index() >= particles.first_wall();
                dissipated += if with_wall { load.dissipated } else { 0.5 * load.dissipated };
            }
            particles.force[slot] = force;
            particles.dissipated[slot] += dissipated;
            if let Some(spin) = &mut particles.spin {
                spin.torque[slot] = torque;
            }
        }
    }

    /// The incidences of pairs that touch, and their places.
    #[inline]
    fn touching_of<'a>(
        &self,
        slot: usize,
        room: &'a mut Vec<(Incidence, Place)>,
    ) -> &'a [(Incidence, Place)] {
        let incident = self.incident_to(slot);
        if room.len() <= incident.len() {
            room.resize(incident.len() + 1, (Incidence(0), Place::DUE));
        }
        // As in `active`: no branch to be guessed wrongly.
        let mut count = 0;
        for incidence in incident {
            let place = self.place[incidence.pair() as usize];
            room[count] = (*incidence, place);
            count += usize::from(place.touches());
        }
        &room[..count]
    }

    fn incident_to(&self, slot: usize) -> &[Incidence] {
        &self.incident[self.first[slot] as usize..self.first[slot + 1] as usize]
    }

    /// How many pairs were listed for an owned particle; 0 if it came after the last listing.
    pub fn listed_for(&self, slot: usize) -> i64 {
        if slot + 1 < self.first.len() { self.incident_to(slot).len() as i64 } else { 0 }
    }

    /// The contacts of this step, in any order.
    pub fn contacts<'a>(
        &'a self,
        law: &dyn ForceLaw,
        particles: &Particles,
    ) -> impl Iterator<Item = Loaded<'a>> {
        self.touching.iter().zip(&self.history).zip(&self.loads).enumerate().map(
            move |(place, ((&index, history), load))| {
                let pair = self.pairs[index as usize];
                Loaded {
                    pair,
                    history,
                    spring: self.spring(index),
                    normal_force: self.normal_force(index, law, particles),
                    force: load.force,
                    point: self.point(Place::among(place), pair, particles),
                }
            },
        )
    }

    /// The contacts of this step and the force of A on B [N], in any order.
    pub fn forces(&self) -> impl Iterator<Item = (Pair, &Vec3)> {
        let loads = self.touching.iter().zip(&self.loads);
        loads.map(|(&index, load)| (self.pairs[index as usize], &load.force))
    }

    /// Pairs that did not touch at the last step and do now, as long as no law has found their loads.
    pub fn new_touches(&self, particles: &Particles) -> impl Iterator<Item = (Pair, Touch)> {
        let all = self.touching.iter().zip(&self.history).zip(&self.loads).enumerate();
        let new = all.filter(|(_, ((_, history), _))| !history.touched());
        new.map(|(place, ((&pair, _), load))| {
            let pair = self.pairs[pair as usize];
            let (&normal, overlap) = load.touch();
            let of_ball = || touch_of_ball(particles.radius(pair.a.index()), &normal, overlap);
            let point = self.points.get(place).copied().unwrap_or_else(of_ball);
            (pair, Touch { overlap, normal, point })
        })
    }

    /// Where a contact of this step acts, seen from the centre of A [m].
    #[inline]
    fn point(&self, place: Place, pair: Pair, particles: &Particles) -> Vec3 {
        let History { normal, overlap } = &self.history[place.index()];
        let of_ball = || touch_of_ball(particles.radius(pair.a.index()), normal, *overlap);
        self.points.get(place.index()).copied().unwrap_or_else(of_ball)
    }

    /// How many contacts an owned particle has in this step, with particles and walls.
    pub fn coordination(&self, slot: usize) -> usize {
        self.incident_to(slot).iter().filter(|i| self.place[i.pair() as usize].touches()).count()
    }

    /// The pairs that touched at the last step, or were carried over a rebuild.
    pub fn touching(&self) -> &[u32] {
        &self.touching[..self.history.len()]
    }

    /// What is remembered of one pair that touches.
    #[inline]
    pub fn history(&self, pair: u32) -> &History {
        &self.history[self.place[pair as usize].index()]
    }

    /// The tangential spring of one pair that touches [m]; zero without friction.
    #[inline]
    pub fn spring(&self, pair: u32) -> Vec3 {
        self.springs.get(self.place[pair as usize].index()).copied().unwrap_or_default()
    }

    /// The normal force of one pair that touches [N].
    #[inline]
    pub fn normal_force(&self, pair: u32, law: &dyn ForceLaw, particles: &Particles) -> f64 {
        let place = self.place[pair as usize].index();
        let elastic =
            || law.elastic(self.pairs[pair as usize], particles, self.history[place].overlap);
        self.normal_forces.get(place).copied().unwrap_or_else(elastic)
    }

    /// Gives back room that longer lists have needed.
    fn trim(&mut self) {
        self.pairs.shrink_to_fit();
        self.place.shrink_to_fit();
        self.first.shrink_to_fit();
        self.incident.shrink_to_fit();
    }

    /// Bytes that the list holds.
    pub fn bytes(&self) -> usize {
        held(&self.pairs) + held(&self.place) + held(&self.first) + held(&self.incident)
    }

    /// Bytes that all that is remembered of touching pairs holds.
    pub fn memory_bytes(&self) -> usize {
        held(&self.touching)
            + held(&self.history)
            + held(&self.springs)
            + held(&self.normal_forces)
            + held(&self.loads)
            + held(&self.points)
            + held(&self.parted)
    }

    /// What is remembered of one pair, under its lasting name.
    pub fn named(&self, pair: u32, particles: &Particles) -> NamedHistory {
        let Pair { a, b } = self.pairs[pair as usize];
        let place = self.place[pair as usize].index();
        NamedHistory {
            a: particles.id[a.index()],
            b: particles.id[b.index()],
            history: *self.history(pair),
            spring: self.spring(pair),
            normal_force: self.normal_forces.get(place).copied().unwrap_or_default(),
        }
    }
}

/// How far the surfaces of a pair can have come nearer since it was listed [m].
#[inline]
fn travel(pair: Pair, particles: &Particles) -> f64 {
    particles.travel[pair.a.index()] + particles.travel[pair.b.index()]
}

/// Adds the work of moving walls on each particle, in the order of the walls.
fn add_wall_work(mut wall_work: Vec<WallWork>, particles: &mut Particles) {
    wall_work.sort_unstable_by_key(|work| (work.pair.a, work.pair.b));
    for of_one in wall_work.chunk_by(|one, other| one.pair.a == other.pair.a) {
        let Some(received) = particles.received.get_mut(of_one[0].pair.a.index()) else { continue };
        *received += of_one.iter().map(|work| work.energy).sum::<f64>();
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
        // Along itself a wall may slide as far as it likes.
        let moved = (wall.point - wall.listed_at).dot(&wall.normal).powi(2);
        if moved > largest {
            largest = moved;
        }
    }
    if sound { largest } else { f64::INFINITY }
}
