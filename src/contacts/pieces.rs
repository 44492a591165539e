//! Two bodies have one contact in each place, however many pieces meet there.
//!
//! What pieces with faces share is put together ([`thickness_of_pieces`]). Of others that are one to more than [`ONE`] the deepest counts.
//! The contact belongs to the first pair of pieces of its place. Where another comes to be the first, it takes along what is remembered.
//!
//! Contacts of two bodies in several places share the mass of these: as many as press the same way have as many times the stiffness, and would else
//! have too much damping ([`shares`]).

use crate::contact::{Geometry, Pair, PairOfPieces, Touching, contact_of, thickness_of_pieces};
use crate::ids::Slot;
use crate::math::{Mat3, Vec3};
use crate::particles::Particles;
use crate::shape::Shape;
use std::collections::BTreeMap;

/// Smooth pieces that are one to this part have one contact.
const ONE: f64 = 0.9;

/// Has any pair of a stretch a piece?
pub(super) fn are_there(pairs: &[Pair], particles: &Particles) -> bool {
    particles.pieces() > 0 && pairs.iter().any(|&pair| has_piece(pair, particles))
}

fn has_piece(Pair { a, b }: Pair, particles: &Particles) -> bool {
    [a, b].into_iter().any(|slot| particles.body_of(slot) != slot)
}

/// Two bodies, or one and a wall or a facet of its own.
type Bodies = (Slot, Slot);

/// Rows of pairs with pieces, by their bodies: those of which there are several.
fn by_bodies(
    rows: impl Iterator<Item = (usize, Pair)>,
    particles: &Particles,
    of_wall: impl Fn(Slot) -> Slot,
) -> Vec<Vec<usize>> {
    let mut all: BTreeMap<Bodies, Vec<usize>> = BTreeMap::new();
    for (row, pair) in rows.filter(|&(_, pair)| has_piece(pair, particles)) {
        let Pair { a, b } = pair;
        let bodies = (particles.body_of(a), of_wall(particles.body_of(b)));
        all.entry(bodies).or_default().push(row);
    }
    all.into_values().filter(|rows| rows.len() > 1).collect()
}

/// Lets what is one place have one contact.
pub(super) fn merge(touching: &mut Touching, pairs: &[Pair], particles: &Particles) {
    let pair = |row: usize| pairs[touching.pair[row] as usize];
    let rows = (0..touching.len()).map(|row| (row, pair(row)));
    let mut stays = vec![true; touching.len()];
    for mut rows in by_bodies(rows, particles, |slot| slot) {
        rows.sort_unstable_by_key(|&row| touching.pair[row]);
        let (with_faces, others): (Vec<usize>, Vec<usize>) = rows
            .into_iter()
            .partition(|&row| have_faces(pairs[touching.pair[row] as usize], particles));
        if with_faces.len() > 1 {
            put_together(&with_faces, touching, pairs, &mut stays, particles);
        }
        keep_deepest(others, touching, pairs, &mut stays, particles);
    }
    if stays.contains(&false) {
        touching.keep(&stays);
    }
}

/// Have both faces, or one has and the other is a plane?
fn have_faces(Pair { a, b }: Pair, particles: &Particles) -> bool {
    let bodies = particles.bodies();
    let [a, b] = [a, b].map(|slot| bodies.shape_of(slot));
    a.kind().has_faces() && (b.kind().has_faces() || matches!(b, Shape::HalfSpace(_)))
}

/// How far pieces of both bodies are one.
fn oneness(one: Pair, other: Pair, particles: &Particles) -> f64 {
    let of = |one: Slot, other: Slot| {
        let number = |slot: Slot| particles.library.piece(particles.shape[slot.index()]);
        match (number(one), number(other)) {
            (Some((body, one)), Some((_, other))) => body.oneness(one, other),
            _ => 1.0,
        }
    };
    of(one.a, other.a) * of(one.b, other.b)
}

/// What pieces with faces of two bodies share, in as many contacts as there are places.
fn put_together(
    rows: &[usize],
    touching: &mut Touching,
    pairs: &[Pair],
    stays: &mut [bool],
    particles: &Particles,
) {
    let bodies = particles.bodies();
    let pairs: Vec<Pair> = rows.iter().map(|&row| pairs[touching.pair[row] as usize]).collect();
    let frames: Vec<[Mat3; 2]> = pairs.iter().map(|&pair| bodies.frames(pair)).collect();
    let origin = particles.position[particles.body_of(pairs[0].a).index()];
    let from: Vec<Vec3> =
        pairs.iter().map(|pair| particles.position[pair.a.index()] - origin).collect();
    let posed: Vec<PairOfPieces> = pairs
        .iter()
        .zip(&frames)
        .zip(&from)
        .map(|((&pair, frames), &from)| {
            let (a, b) = bodies.posed(pair, frames);
            PairOfPieces { a, b, r: bodies.relative(pair), from }
        })
        .collect();
    let found = thickness_of_pieces(&posed, |i, j| oneness(pairs[i], pairs[j], particles));
    for &row in rows {
        stays[row] = false;
    }
    for (first, thickness) in found {
        let row = rows[first];
        stays[row] = true;
        let (touch, patch) = contact_of(&thickness);
        touching.geometry[row] = Geometry { normal: touch.normal, overlap: touch.overlap };
        touching.point[row] = touch.point - from[first];
        if let Some(of_row) = touching.patch.get_mut(row) {
            *of_row = patch;
        }
    }
}

/// Of contacts that are nearly one place, the deepest; of equally deep ones the first.
fn keep_deepest(
    mut rows: Vec<usize>,
    touching: &Touching,
    pairs: &[Pair],
    stays: &mut [bool],
    particles: &Particles,
) {
    rows.sort_by(|&one, &other| {
        touching.geometry[other].overlap.total_cmp(&touching.geometry[one].overlap)
    });
    let pair = |row: usize| pairs[touching.pair[row] as usize];
    for k in 1..rows.len() {
        let is_one = |&deeper: &usize| {
            stays[deeper] && oneness(pair(deeper), pair(rows[k]), particles) >= ONE
        };
        stays[rows[k]] = !rows[..k].iter().any(is_one);
    }
}

/// How like a contact of two bodies is one of them that has ended, as the cosine between their normals; `None` if they are of others, or
/// turned by half a right angle.
pub(super) fn likeness(
    (now, normal): (Pair, &Vec3),
    (before, last): (Pair, &Vec3),
    particles: &Particles,
) -> Option<f64> {
    let likeness = normal.dot(last);
    let is_of_both = has_piece(now, particles) && particles.have_same_bodies(now, before);
    (is_of_both && likeness > super::surfaces::HALF_OF_RIGHT).then_some(likeness)
}

/// The part of the mass of its bodies that each contact of a stretch has, 1 of bodies that touch in one place: one over
/// `Σ min(1, δ_j / δ) max(0, n_j·n)²` over the contacts of both bodies. Nothing if there are no pieces.
pub(super) fn shares(
    pairs: &[Pair],
    geometry: &[Geometry],
    particles: &Particles,
    shares: &mut Vec<f64>,
) {
    shares.clear();
    if !are_there(pairs, particles) {
        return;
    }
    shares.resize(pairs.len(), 1.0);
    let of_wall = |slot: Slot| {
        let wall = particles.wall_of(slot);
        wall.map_or(slot, |wall| Slot(u32::MAX - wall as u32))
    };
    for rows in by_bodies(pairs.iter().copied().enumerate(), particles, of_wall) {
        for &row in &rows {
            let own = &geometry[row];
            let like = |&other: &usize| {
                let Geometry { normal, overlap } = &geometry[other];
                let cosine = normal.dot(&own.normal).max(0.0);
                (overlap / own.overlap).clamp(0.0, 1.0) * cosine * cosine
            };
            shares[row] = 1.0 / rows.iter().map(like).sum::<f64>().max(1.0);
        }
    }
}
