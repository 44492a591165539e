//! Contacts of bodies with faces that consist of several pieces. The volumes that their pieces share are joined, so a body cut into pieces has
//! the contact of the whole.

use super::faces::shared;
use super::seen::Seen;
use super::surface::cells_of;
use super::thickness::Thickness;
use super::together::{SharedVolume, thickness_of};
use crate::contact::Posed;
use crate::math::Vec3;
use crate::shape::clip::Clipped;

/// A piece of a body and another body, or a piece of it, or a wall.
#[derive(Clone, Copy, Debug)]
pub struct PairOfPieces<'a> {
    /// The piece of the first body.
    pub a: Posed<'a>,
    /// The other body, piece or wall.
    pub b: Posed<'a>,
    /// Vector from the centre of `a` to that of `b`, or to the reference point of its wall [m].
    pub r: Vec3,
    /// Position of the centre of `a` relative to an origin that all pairs of the bodies share [m].
    pub from: Vec3,
}

/// A contact of bodies of several pieces.
#[derive(Clone, Debug)]
pub struct OfPieces {
    /// Indices of the pairs in the contact, in rising order.
    pub pairs: Vec<usize>,
    /// Thickness relative to the common origin.
    pub thickness: Thickness,
}

/// A volume that a pair shares.
struct Cut {
    pair: usize,
    shared: Clipped,
}

/// Contacts of two bodies. `oneness` is the degree to which two pairs are joined.
///
/// Pairs joined to any degree, directly or through others, make one contact.
pub fn thickness_of_pieces(
    pairs: &[PairOfPieces],
    oneness: impl Fn(usize, usize) -> f64,
) -> Vec<OfPieces> {
    let cut = |(pair, of): (usize, &PairOfPieces)| {
        Some(Cut { pair, shared: shared(&of.a, &of.b, &of.r)? })
    };
    let all: Vec<Cut> = pairs.iter().enumerate().filter_map(cut).collect();
    contacts(pairs, &all, |i, j| oneness(all[i].pair, all[j].pair))
}

/// Contacts of a body with a wall of triangles that has cells: one pair for each piece, whatever the facet.
pub fn thickness_of_pieces_on_surface(
    pairs: &[PairOfPieces],
    oneness: impl Fn(usize, usize) -> f64,
) -> Vec<OfPieces> {
    let (mut all, mut cells) = (Vec::new(), Vec::new());
    for (pair, PairOfPieces { a, b, r, .. }) in pairs.iter().enumerate() {
        for (cell, shared) in cells_of(&Seen::of(a, b, r)) {
            all.push(Cut { pair, shared });
            cells.push(cell);
        }
    }
    let Some(PairOfPieces { a, b, r, .. }) = pairs.first() else { return Vec::new() };
    let mesh = Seen::of(a, b, r).mesh;
    contacts(pairs, &all, |i, j| {
        mesh.together(cells[i], cells[j]) * oneness(all[i].pair, all[j].pair)
    })
}

/// Groups volumes that are joined to any degree.
fn contacts(
    pairs: &[PairOfPieces],
    all: &[Cut],
    oneness: impl Fn(usize, usize) -> f64,
) -> Vec<OfPieces> {
    let mut group: Vec<usize> = (0..all.len()).collect();
    for i in 0..all.len() {
        for j in 0..i {
            if oneness(i, j) > 0.0 {
                let (low, high) = (group[i].min(group[j]), group[i].max(group[j]));
                group.iter_mut().filter(|of| **of == high).for_each(|of| *of = low);
            }
        }
    }
    let lump = |&k: &usize| {
        let Cut { pair, shared } = &all[k];
        let PairOfPieces { a, from, .. } = &pairs[*pair];
        vec![SharedVolume::placed(shared, a.frame * a.scale, *from)]
    };
    let mut found = Vec::new();
    for first in (0..all.len()).filter(|&k| group[k] == k) {
        let members: Vec<usize> = (first..all.len()).filter(|&k| group[k] == first).collect();
        let lumps: Vec<Vec<SharedVolume>> = members.iter().map(lump).collect();
        let area: Vec3 = lumps.iter().flatten().map(SharedVolume::area).sum();
        let upright = area.try_normalize(0.0).unwrap_or_else(Vec3::z);
        let size = pairs[all[first].pair].a.bounding_radius();
        let weight = |i: usize, j: usize| oneness(members[i], members[j]);
        if let Some((thickness, _)) = thickness_of(&lumps, weight, &upright, size) {
            let mut pairs: Vec<usize> = members.iter().map(|&k| all[k].pair).collect();
            pairs.dedup();
            found.push(OfPieces { pairs, thickness });
        }
    }
    found
}
