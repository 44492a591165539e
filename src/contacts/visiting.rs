//! Passes over the forces in contacts, eight at a time in lanes.

#![expect(clippy::inline_always, reason = "see `lanes`")]

use crate::contact::{Pair, triple, vectors};
use crate::lanes::{self, Eight, Gather, Kernel, RowPairs, Triple, WIDTH};
use crate::math::Vec3;
use crate::particles::Particles;

/// Up to eight contacts between bodies; pieces count as their bodies.
#[derive(Clone, Copy)]
pub struct Visited<'a, L> {
    /// Slots of A and B. Lanes beyond the last contact repeat it.
    pub bodies: [Gather<'a>; 2],
    /// Number of contacts.
    pub count: usize,
    /// Way from the place of A to that of B, not by the nearest image [m].
    pub way: Triple<L>,
    /// Force of A on B [N].
    pub force: Triple<L>,
}

/// Code that sees all contacts. Its method is to be inlined always.
pub trait Visitor {
    /// Sees the next contacts.
    fn visit<L: Eight>(&mut self, contacts: &Visited<L>);
}

/// Lets a visitor see contacts with these forces of A on B [N].
pub(super) fn visit(
    (pairs, forces): (&[Pair], &[Vec3]),
    particles: &Particles,
    visitor: &mut impl Visitor,
) {
    let of_bodies: Vec<Pair>;
    let pairs = if particles.pieces() > 0 {
        of_bodies = pairs.iter().map(|&pair| particles.bodies_of(pair)).collect();
        &of_bodies
    } else {
        pairs
    };
    if !pairs.is_empty() {
        lanes::dispatch(Visit { pairs, forces, particles, visitor });
    }
}

struct Visit<'a, V> {
    pairs: &'a [Pair],
    forces: &'a [Vec3],
    particles: &'a Particles,
    visitor: &'a mut V,
}

impl<V: Visitor> Kernel for Visit<'_, V> {
    type Home = V;

    #[inline(always)]
    fn run<L: Eight>(self) {
        let Self { pairs, forces, particles: Particles { position, .. }, visitor } = self;
        let rows = RowPairs::new(bytemuck::cast_slice(pairs), position.len());
        let last = forces.len() - 1;
        for first in (0..pairs.len()).step_by(WIDTH) {
            let mut room = [[0; 2]; WIDTH];
            let [a, b] = rows.eight(first, &mut room);
            let of_lanes = std::array::from_fn(|lane| &forces[last.min(first + lane)]);
            visitor.visit(&Visited {
                bodies: [a, b],
                count: WIDTH.min(pairs.len() - first),
                way: vectors::<L>(position, b).minus(vectors(position, a)),
                force: triple(&of_lanes),
            });
        }
    }
}
