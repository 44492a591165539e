//! Pairs of pieces from pairs of bodies.

use crate::contact::Pair;
use crate::ids::Slot;
use crate::particles::Particles;
use crate::shape::Shape;
use std::ops::Range;

/// Replaces pairs of unions by pairs of their pieces, in the order of the pairs of bodies.
///
/// The pieces are those whose bounding spheres are closer than `skin` [m].
pub fn with_pieces(particles: &Particles, found: Vec<Pair>, skin: f64) -> Vec<Pair> {
    if particles.pieces() == 0 {
        return found;
    }
    let mut first = vec![0; particles.first_piece()];
    for (piece, slot) in (particles.first_piece()..particles.first_facet()).enumerate().rev() {
        first[particles.body_of(Slot(slot as u32)).index()] = piece + 1;
    }
    let pieces = |body: Slot| -> Range<usize> {
        let index = body.index();
        let one = index..index + 1;
        let Some(piece) = first.get(index).copied().filter(|&piece| piece > 0) else { return one };
        let start = particles.first_piece() + piece - 1;
        match &particles.library.shapes[particles.shape[index].index()] {
            Shape::Union(union) => start..start + union.pieces().len(),
            _ => one,
        }
    };
    let mut all = Vec::with_capacity(found.len());
    for Pair { a, b } in found {
        for one in pieces(a) {
            for other in pieces(b) {
                if are_near(particles, one, other, skin) {
                    let pair = |a: usize, b: usize| Pair { a: Slot(a as u32), b: Slot(b as u32) };
                    let rises = particles.id[one] < particles.id[other];
                    all.push(if rises { pair(one, other) } else { pair(other, one) });
                }
            }
        }
    }
    all
}

/// Whether two bounding spheres, or one and a plane, are nearer than `skin` [m].
///
/// A facet of a mesh near the body counts as near all its pieces.
fn are_near(particles: &Particles, one: usize, other: usize, skin: f64) -> bool {
    let (place, reach) = (particles.position[one], particles.radius(one) + skin);
    if other < particles.first_facet() {
        let way = particles.cell.nearest(particles.position[other] - place);
        return way.norm() < reach + particles.radius(other);
    }
    let facet = particles.facets.place[other - particles.first_facet()];
    match &particles.library.shapes[particles.shape[other].index()] {
        Shape::HalfSpace(plane) => {
            let height = (place - particles.position[other]).dot(&(facet.frame * plane.normal));
            height - plane.offset < reach
        }
        _ => true,
    }
}
