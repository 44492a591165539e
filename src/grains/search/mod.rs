//! Which pairs may touch: a list with a skin, rebuilt when somebody has moved by half of it.
//!
//! A pair is listed when its bounding spheres are closer than the skin. That depends on positions
//! alone, never on the rank; and since a pair that does not touch leaves no trace, neither the
//! moment nor the order of listing shows in the trajectory.
//!
//! Pairs of particles stand in the [order of space](crate::particles::order), first by that of both which stands first; then come those
//! with walls, in the same order. So whoever goes through the list meets the partners of each body in that order.

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
    /// The kinds of shape.
    pub kinds: (Kind, Kind),
    /// Where they stand in the list's order by kinds.
    range: Range<usize>,
}

/// A part of the list: enough pairs for a call not to count, few enough for what is found to stay in the cache.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Stretch {
    /// Where in the list.
    pub range: Range<usize>,
    /// Its pairs by kinds.
    pub groups: Vec<Group>,
}

/// The pairs that may touch, and when to look at them again.
#[derive(Clone, Debug, Default)]
pub struct PairList {
    /// All pairs: of particles by where both stand, then those with walls.
    pub pairs: Vec<Pair>,
    /// The list in parts.
    pub stretches: Vec<Stretch>,
    /// The pairs of each stretch by kinds; numbers within the stretch.
    order: Vec<u32>,
    /// A pair that does not touch need not be looked at until the travel of both bodies adds up to this [m]. It may
    /// be too low, never too high, so it saves work and changes nothing.
    until: Vec<f32>,
}

/// As many pairs of a group are resolved in one call, about.
const AT_ONCE: usize = 512;
/// The longest stretch.
const LONGEST: usize = 8192;

/// Leaves room for the rounding of the sum of clearance and travels to `f32`, and of travels.
const TO_SINGLE: f64 = 1e-6;
/// Leaves room for the rounding of a clearance, over the radius of a body.
const ROUNDING: f64 = 1e-12;

impl PairList {
    /// Lists the pairs that [`close_pairs`] has found, for the particles where they are, of which these are the places in the order of
    /// space.
    ///
    /// # Panics
    /// If there are more pairs than have numbers, 2^31.
    pub fn rebuild(&mut self, particles: &mut Particles, found: Vec<Pair>, places: &[u32]) {
        assert!(found.len() < 1 << 31, "2^31 pairs on a rank: take more ranks, or a smaller skin");
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

    /// Puts pairs, those with walls last, in order; returns where those with walls begin.
    fn sort(&mut self, particles: &Particles, found: &[Pair], places: &[u32]) -> usize {
        let ends = |pair: &Pair| in_order(*pair, places);
        let with_walls = found.partition_point(|pair| pair.b.index() < particles.first_facet());
        let (among, with_walls) = found.split_at(with_walls);
        // Counted first, then each to its place: sorting with keys would hold all pairs three times.
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

    /// Of which those from `with_walls` on have walls.
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
                // Pairs of a particle with walls stand in one stretch: facets of a wall share them. So do those of a body of
                // pieces with others.
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

    /// Asks memory for the pairs of a stretch; returns them.
    pub fn prefetch(&self, stretch: usize) -> &[Pair] {
        let range = &self.stretches[stretch].range;
        prefetch(&self.until[range.clone()]);
        &self.pairs[range.clone()]
    }

    /// Which pairs of a group must be looked at: numbers within the stretch, in the room of `active`.
    pub fn active<'a>(
        &self,
        stretch: &Stretch,
        group: &Group,
        particles: &Particles,
        active: &'a mut Vec<u32>,
    ) -> &'a [u32] {
        // Every number is written, and the next one over it if the pair rests: no branch to be guessed wrongly.
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

    /// How many pairs were listed for each owned particle; 0 if it came after the last listing.
    pub fn listed_for_each(&self, particles: &Particles) -> Vec<i64> {
        let mut listed = vec![0; particles.owned];
        for slot in self.pairs.iter().flat_map(|pair| [pair.a, pair.b]) {
            if let Some(count) = listed.get_mut(particles.body_of(slot).index()) {
                *count += 1;
            }
        }
        listed
    }

    /// Bytes that the list holds.
    pub fn bytes(&self) -> usize {
        held(&self.pairs) + held(&self.order) + held(&self.until) + held(&self.stretches)
    }
}

/// The places of both bodies of a pair in the order of space, that of the first before that of the other.
pub fn in_order(Pair { a, b }: Pair, places: &[u32]) -> (u32, u32) {
    let [a, b] = [a, b].map(|slot| places[slot.index()]);
    (a.min(b), a.max(b))
}

/// Leaves out pairs of which both are held, or one is and the other belongs to a wall: no force between them moves anything.
pub fn drop_held(found: &mut Vec<Pair>, particles: &Particles) {
    if particles.library.held_shapes == 0 {
        return;
    }
    let moves =
        |slot: Slot| slot.index() < particles.first_facet() && !particles.is_held(slot.index());
    found.retain(|pair| moves(pair.a) || moves(pair.b));
}

/// How far the surfaces of a pair can have come nearer since it was listed [m].
#[inline]
fn travel(pair: Pair, particles: &Particles) -> f64 {
    particles.travel[pair.a.index()] + particles.travel[pair.b.index()]
}

/// Can no owned particle or wall have moved farther than this since the pairs were listed [m]?
pub fn all_within(particles: &Particles, distance: f64) -> bool {
    let room = particles.room_of_turning();
    // A wall of triangles without slots here moves, too.
    particles.travel[..particles.owned].iter().all(|way| *way <= distance)
        && particles.walls.iter().all(|wall| wall.nearer_since_listed(&room) <= distance)
}

/// Square of the largest distance that an owned particle or a wall has moved since the pairs were
/// listed, and half of that by which images have slid [m²]; infinite if a position is not a number.
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
