//! Bodies with faces of several pieces: what their pieces share is put together, so that a body cut in pieces has the contact of the whole.

use super::faces::shared;
use super::thickness::Thickness;
use super::together::{Lump, thickness_of};
use crate::contact::Posed;
use crate::math::Vec3;
use crate::shape::clip::Clipped;

/// A piece of a body and one of another, or a half-space.
#[derive(Clone, Copy, Debug)]
pub struct PairOfPieces<'a> {
    /// That of the first body.
    pub a: Posed<'a>,
    /// The other.
    pub b: Posed<'a>,
    /// From the centre of the one to that of the other, or to the reference point of its wall [m].
    pub r: Vec3,
    /// Where the centre of the first is, seen from an origin that all pairs of the bodies share [m].
    pub from: Vec3,
}

/// The contacts of two bodies, each with the number of the first of its pairs, and seen from the common origin. Two pairs are one to the part that
/// `oneness` says; those that are one to any part, directly or by way of others, make one contact.
pub fn thickness_of_pieces(
    pairs: &[PairOfPieces],
    oneness: impl Fn(usize, usize) -> f64,
) -> Vec<(usize, Thickness)> {
    let cut: Vec<(usize, Clipped)> = pairs
        .iter()
        .enumerate()
        .filter_map(|(k, pair)| Some((k, shared(&pair.a, &pair.b, &pair.r)?)))
        .collect();
    let mut group: Vec<usize> = (0..cut.len()).collect();
    for i in 0..cut.len() {
        for j in 0..i {
            if oneness(cut[i].0, cut[j].0) > 0.0 {
                let (low, high) = (group[i].min(group[j]), group[i].max(group[j]));
                group.iter_mut().filter(|of| **of == high).for_each(|of| *of = low);
            }
        }
    }
    let mut found = Vec::new();
    for first in (0..cut.len()).filter(|&k| group[k] == k) {
        let of_group: Vec<usize> = (first..cut.len()).filter(|&k| group[k] == first).collect();
        let lump = |&k: &usize| {
            let (number, shared) = &cut[k];
            let PairOfPieces { a, from, .. } = &pairs[*number];
            vec![Lump::placed(shared, a.frame * a.scale, *from)]
        };
        let lumps: Vec<Vec<Lump>> = of_group.iter().map(lump).collect();
        let area: Vec3 = lumps.iter().flatten().map(Lump::area).sum();
        let upright = area.try_normalize(0.0).unwrap_or_else(Vec3::z);
        let weight = |i: usize, j: usize| oneness(cut[of_group[i]].0, cut[of_group[j]].0);
        let size = pairs[cut[first].0].a.bounding_radius();
        let together = thickness_of(&lumps, weight, &upright, size);
        found.extend(together.map(|(thickness, _)| (cut[first].0, thickness)));
    }
    found
}
