//! List of pairs that may touch, with a skin. It is rebuilt when a body has moved by half of the skin.
//!
//! A pair is listed when its bounding spheres are closer than the skin. That depends on positions alone, never on the rank. A pair that does not
//! touch has no effect, so neither the moment nor the order of listing influences the trajectory.
//!
//! Pairs of particles are in the [order of space](crate::particles::order), by the body that comes first in it. They are followed by pairs with
//! walls, in the same order. A pass through the list thus meets the partners of each body in that order.

mod cells;
mod pieces;

pub use cells::{close_pairs, note_near_facets};
pub use pieces::with_pieces;

use crate::contact::{Pair, ordered};
use crate::ids::Slot;
use crate::lanes::prefetch;
use crate::particles::{Particles, held};
use crate::shape::Kind;
use std::ops::Range;

/// Pairs of the same kinds in a stretch of the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Kinds of shape.
    pub kinds: (Kind, Kind),
    /// Range in the list's order by kinds.
    range: Range<usize>,
}

/// A part of the list. It has enough pairs that the cost of a call is negligible, and few enough that the results stay in the cache.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stretch {
    /// Range in the list.
    pub range: Range<usize>,
    /// Pairs of the stretch by kinds.
    pub groups: Vec<Group>,
}

/// Pairs that may touch, and when to examine them again.
#[derive(Clone, Debug, Default)]
pub struct PairList {
    /// All pairs: those of particles in the order of space, then those with walls.
    pub pairs: Vec<Pair>,
    /// Parts of the list.
    pub stretches: Vec<Stretch>,
    /// Pairs of each stretch by kinds, as indices within the stretch.
    order: Vec<u32>,
    /// Sum of the travel of both bodies up to which a pair that does not touch need not be examined [m].
    ///
    /// It may be too low, never too high, so it saves work and changes nothing.
    until: Vec<f32>,
}

/// Approximate number of pairs of a group that are resolved in one call.
const AT_ONCE: usize = 512;
/// Largest number of pairs of a stretch.
const LONGEST: usize = 8192;

/// Margin for the rounding of the sum of clearance and travels to `f32`, and of travels.
const TO_SINGLE: f64 = 1e-6;
/// Margin for the rounding of a clearance, over the radius of a body.
const ROUNDING: f64 = 1e-12;

impl PairList {
    /// Lists the pairs found by [`close_pairs`], at the present positions of the particles.
    ///
    /// `places` are the places of the slots in the order of space.
    ///
    /// # Panics
    /// If there are more pairs than have numbers, 2^31.
    pub fn rebuild(&mut self, particles: &mut Particles, found: Vec<Pair>, places: &[u32]) {
        assert!(found.len() < 1 << 31, "2^31 pairs on a rank: use more ranks, or a smaller skin");
        let with_walls = self.sort(particles, &found, places);
        drop(found);
        self.until.clear();
        self.until.resize(self.pairs.len(), 0.0);
        self.cut_into_stretches(particles, with_walls, places);
        self.pairs.shrink_to_fit();
        self.until.shrink_to_fit();
        self.order.shrink_to_fit();

        let owned = particles.owned;
        particles.listed_at.copy_from_slice(&particles.position[..owned]);
        particles.travel.clear();
        particles.travel.resize(particles.slots(), 0.0);
        particles.cell.note_listing();
        for wall in &mut particles.walls {
            wall.note_listing();
        }
    }

    /// Sorts the pairs, with those with walls last; returns the index of the first pair with a wall.
    fn sort(&mut self, particles: &Particles, found: &[Pair], places: &[u32]) -> usize {
        let ends = |pair: &Pair| in_order(*pair, places);
        let with_walls = found.partition_point(|pair| pair.b.index() < particles.first_facet());
        let (among, with_walls) = found.split_at(with_walls);
        // Counting sort: sorting with keys would hold all pairs three times.
        let mut next = vec![0; particles.first_facet()];
        for pair in among {
            next[ends(pair).0 as usize] += 1;
        }
        let mut start = 0;
        for next in &mut next {
            start += std::mem::replace(next, start);
        }
        self.pairs.clear();
        self.pairs.reserve_exact(found.len());
        self.pairs.resize(among.len(), Pair { a: Slot(0), b: Slot(0) });
        for pair in among {
            let place = &mut next[ends(pair).0 as usize];
            self.pairs[*place] = *pair;
            *place += 1;
        }
        for of_one in self.pairs.chunk_by_mut(|one, other| ends(one).0 == ends(other).0) {
            of_one.sort_unstable_by_key(ends);
        }
        self.pairs.extend_from_slice(with_walls);
        self.pairs[among.len()..].sort_unstable_by_key(ends);
        among.len()
    }

    /// Divides the list into stretches. Pairs from `with_walls` on are with walls.
    fn cut_into_stretches(&mut self, particles: &Particles, with_walls: usize, places: &[u32]) {
        let first_body = |Pair { a, b }: Pair| {
            let is_first = places[a.index()] < places[b.index()];
            particles.body_of(if is_first { a } else { b })
        };
        let has_pieces = particles.pieces() > 0;
        let kind =
            |slot: Slot| particles.library.shapes[particles.shape[slot.index()].index()].kind();
        let kinds_of = |pair: &Pair| ordered((kind(pair.a), kind(pair.b)));
        self.stretches.clear();
        self.order.clear();
        for part in [0..with_walls, with_walls..self.pairs.len()] {
            let mut all: Vec<_> = self.pairs[part.clone()].iter().map(kinds_of).collect();
            all.sort_unstable();
            all.dedup();
            let length = LONGEST.min(AT_ONCE * all.len().max(1));
            let mut keyed: Vec<((Kind, Kind), u32)> = Vec::new();
            let mut start = part.start;
            while start < part.end {
                let mut end = part.end.min(start + length);
                // Pairs of a particle with walls are in one stretch, because facets of a wall share them. So are those of a body of pieces
                // with others.
                while (start >= with_walls || has_pieces)
                    && end < part.end
                    && first_body(self.pairs[end]) == first_body(self.pairs[end - 1])
                {
                    end += 1;
                }
                let range = start..end;
                start = end;
                keyed.clear();
                keyed.extend(self.pairs[range.clone()].iter().map(kinds_of).zip(0..));
                keyed.sort_unstable();
                let mut groups = Vec::new();
                for group in keyed.chunk_by(|one, other| one.0 == other.0) {
                    let from = self.order.len();
                    self.order.extend(group.iter().map(|&(_, pair)| pair));
                    groups.push(Group { kinds: group[0].0, range: from..self.order.len() });
                }
                self.stretches.push(Stretch { range, groups });
            }
        }
    }

    /// Prefetches the data of the pairs of a stretch; returns the pairs.
    pub fn prefetch(&self, stretch: usize) -> &[Pair] {
        let range = &self.stretches[stretch].range;
        prefetch(&self.until[range.clone()]);
        &self.pairs[range.clone()]
    }

    /// Pairs of a group that must be examined, as indices within the stretch, in the memory of `active`.
    pub fn active<'a>(
        &self,
        stretch: &Stretch,
        group: &Group,
        particles: &Particles,
        active: &'a mut Vec<u32>,
    ) -> &'a [u32] {
        // Every index is written, and overwritten by the next one if the pair rests: there is no branch to mispredict.
        if active.len() <= group.range.len() {
            active.resize(group.range.len() + 1, 0);
        }
        let mut count = 0;
        let pairs = &self.pairs[stretch.range.clone()];
        let until = &self.until[stretch.range.clone()];
        for &pair in &self.order[group.range.clone()] {
            active[count] = pair;
            let travel = travel(pairs[pair as usize], particles);
            count += usize::from(travel >= f64::from(until[pair as usize]));
        }
        &active[..count]
    }

    /// Lets pairs of a stretch that do not touch rest until their surfaces can have come nearer by a clearance [m].
    pub fn rest(&mut self, stretch: usize, apart: &[(u32, f64)], particles: &Particles) {
        let first = self.stretches[stretch].range.start;
        let rounding = particles.cell.rounding_of_images();
        for &(pair, clearance) in apart {
            let index = first + pair as usize;
            let pair = self.pairs[index];
            let margin = rounding + ROUNDING * particles.radius(pair.a.index());
            let until = travel(pair, particles) + (clearance - margin);
            self.until[index] = ((until * (1.0 - TO_SINGLE)) as f32).max(0.0);
        }
    }

    /// Number of pairs listed for each owned particle; 0 for one added after the last listing.
    pub fn listed_for_each(&self, particles: &Particles) -> Vec<i64> {
        let mut listed = vec![0; particles.owned];
        for slot in self.pairs.iter().flat_map(|pair| [pair.a, pair.b]) {
            if let Some(count) = listed.get_mut(particles.body_of(slot).index()) {
                *count += 1;
            }
        }
        listed
    }

    /// Memory that the list holds [bytes].
    pub fn bytes(&self) -> usize {
        held(&self.pairs) + held(&self.order) + held(&self.until) + held(&self.stretches)
    }
}

/// Places of both bodies of a pair in the order of space, the lower first.
pub fn in_order(Pair { a, b }: Pair, places: &[u32]) -> (u32, u32) {
    let [a, b] = [a, b].map(|slot| places[slot.index()]);
    (a.min(b), a.max(b))
}

/// Removes pairs of held particles with each other or with walls: no force between them moves anything.
pub fn drop_held(found: &mut Vec<Pair>, particles: &Particles) {
    if particles.library.held_shapes == 0 {
        return;
    }
    let moves =
        |slot: Slot| slot.index() < particles.first_facet() && !particles.is_held(slot.index());
    found.retain(|pair| moves(pair.a) || moves(pair.b));
}

/// Upper bound of the distance by which the surfaces of a pair have come nearer since it was listed [m].
#[inline]
fn travel(pair: Pair, particles: &Particles) -> f64 {
    particles.travel[pair.a.index()] + particles.travel[pair.b.index()]
}

/// Whether no owned particle or wall can have moved farther than this since the pairs were listed [m].
pub fn all_within(particles: &Particles, distance: f64) -> bool {
    let room = particles.room_of_turning();
    // A wall of triangles without slots on this rank also counts.
    particles.travel[..particles.owned].iter().all(|way| *way <= distance)
        && particles.walls.iter().all(|wall| wall.nearer_since_listed(&room) <= distance)
}

/// Square of the largest displacement since the pairs were listed [m²]; infinite if a position is not a number.
///
/// It is that of owned particles and walls, plus half of the distance by which images have slid.
pub fn moved_squared(particles: &Particles) -> f64 {
    let mut largest = 0.0;
    let mut sound = true;
    for (now, then) in particles.position.iter().zip(&particles.listed_at) {
        let moved = particles.cell.moved(then, now).norm_squared();
        if moved > largest {
            largest = moved;
        }
        sound &= moved.is_finite();
    }
    let room = particles.room_of_turning();
    for wall in &particles.walls {
        let moved = wall.nearer_since_listed(&room).powi(2);
        if moved > largest {
            largest = moved;
        }
        sound &= moved.is_finite();
    }
    let slid = 0.5 * particles.cell.slid_since_listed();
    if slid > 0.0 {
        largest = (largest.sqrt() + slid).powi(2);
    }
    if sound { largest } else { f64::INFINITY }
}
