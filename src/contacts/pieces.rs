//! Contacts of unions: two bodies have one contact in each place, for any number of pieces that meet there.
//!
//! Volumes that pieces with faces share are joined ([`thickness_of_pieces`]). The resulting contact belongs to the first
//! pair of pieces of its place. If another pair becomes the first, it takes over the state. Other pieces that coincide by
//! more than [`ONE`] press as one ([`share_depth`]).
//!
//! Contacts of two bodies in several places share the masses of the bodies: contacts that press in the same direction add
//! their stiffnesses, and would otherwise have too much damping ([`shares`]).

use crate::contact::{
    Geometry, OfPieces, Pair, PairOfPieces, Patch, Touching, contact_of, thickness_of_pieces,
    thickness_of_pieces_on_surface,
};
use crate::ids::Slot;
use crate::math::{Mat3, Vec3};
use crate::particles::Particles;
use crate::shape::Shape;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_1_SQRT_2;

/// Coincident part of round pieces above which they press as one.
const ONE: f64 = 0.9;

/// Does any pair of a stretch have a piece?
pub(super) fn are_there(pairs: &[Pair], particles: &Particles) -> bool {
    particles.pieces() > 0 && pairs.iter().any(|&pair| has_piece(pair, particles))
}

fn has_piece(Pair { a, b }: Pair, particles: &Particles) -> bool {
    [a, b].into_iter().any(|slot| particles.body_of(slot) != slot)
}

/// Two bodies, or one and a wall ([`wall_or`]).
type Bodies = (Slot, Slot);

/// Pairs with pieces, with their rows, in the order of their bodies.
fn by_bodies(pairs: impl Iterator<Item = Pair>, particles: &Particles) -> Vec<(Bodies, usize)> {
    let of_row = |(row, pair): (usize, Pair)| {
        let Pair { a, b } = particles.bodies_of(pair);
        ((a, wall_or(b, particles)), row)
    };
    let with_pieces = pairs.enumerate().filter(|&(_, pair)| has_piece(pair, particles));
    let mut all: Vec<(Bodies, usize)> = with_pieces.map(of_row).collect();
    all.sort_unstable();
    all
}

/// Rows of each two bodies with several rows.
fn several(all: &[(Bodies, usize)]) -> impl Iterator<Item = &[(Bodies, usize)]> {
    all.chunk_by(|(one, _), (other, _)| one == other).filter(|rows| rows.len() > 1)
}

/// Merges the contacts of each place into one.
pub(super) fn merge(touching: &mut Touching, pairs: &[Pair], particles: &Particles) {
    let of_rows: Vec<Pair> = touching.pair.iter().map(|&pair| pairs[pair as usize]).collect();
    let all = by_bodies(of_rows.iter().copied(), particles);
    let mut stays = vec![true; touching.len()];
    for rows in several(&all) {
        let mut rows: Vec<usize> = rows.iter().map(|&(_, row)| row).collect();
        rows.sort_unstable_by_key(|&row| touching.pair[row]);
        let is_on_plane =
            |pair: Pair| matches!(particles.bodies().shape_of(pair.b), Shape::HalfSpace(_));
        // Planes of one wall are separate bodies.
        let mut of_planes: BTreeMap<Slot, Vec<usize>> = BTreeMap::new();
        let (mut with_faces, mut others) = (Vec::new(), Vec::new());
        for row in rows {
            let pair = of_rows[row];
            if !have_faces(pair, particles) {
                others.push(row);
            } else if is_on_plane(pair) {
                of_planes.entry(pair.b).or_default().push(row);
            } else {
                with_faces.push(row);
            }
        }
        for rows in of_planes.into_values().chain([with_faces]).filter(|rows| rows.len() > 1) {
            put_together(&rows, touching, &of_rows, &mut stays, particles);
        }
        if others.len() > 1 {
            share_depth(&others, touching, &of_rows, particles);
        }
    }
    if stays.contains(&false) {
        touching.keep(&stays);
    }
}

/// Do both have faces, or does one have faces while the other is a plane or a surface with cells?
fn have_faces(Pair { a, b }: Pair, particles: &Particles) -> bool {
    let bodies = particles.bodies();
    let [a, b] = [a, b].map(|slot| bodies.shape_of(slot));
    a.kind().has_faces()
        && match b {
            Shape::HalfSpace(_) => true,
            Shape::TriangleMesh(mesh) => mesh.has_cells(),
            _ => b.kind().has_faces(),
        }
}

/// Slot of a body; for walls a common value for all facets of a wall.
fn wall_or(slot: Slot, particles: &Particles) -> Slot {
    particles.wall_of(slot).map_or(slot, |wall| Slot(u32::MAX - wall as u32))
}

/// Part to which the pieces of both bodies coincide.
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

/// Joins the contacts of two bodies by pieces with faces, for each place where they meet.
fn put_together(
    rows: &[usize],
    touching: &mut Touching,
    of_rows: &[Pair],
    stays: &mut [bool],
    particles: &Particles,
) {
    let bodies = particles.bodies();
    let of_rows: Vec<Pair> = rows.iter().map(|&row| of_rows[row]).collect();
    let is_on_mesh = matches!(bodies.shape_of(of_rows[0].b), Shape::TriangleMesh(_));
    // On a wall of triangles each piece counts once, for any number of facets.
    let mut firsts: Vec<usize> = (0..rows.len()).collect();
    if is_on_mesh {
        firsts.dedup_by_key(|k| of_rows[*k].a);
        if firsts.len() < 2 {
            return;
        }
    }
    let pairs: Vec<Pair> = firsts.iter().map(|&k| of_rows[k]).collect();
    let frames: Vec<[Mat3; 2]> = pairs.iter().map(|&pair| bodies.frames(pair)).collect();
    let origin = particles.position[particles.body_of(pairs[0].a).index()];
    let posed: Vec<PairOfPieces> = pairs
        .iter()
        .zip(&frames)
        .map(|(&pair, frames)| {
            let (a, b) = bodies.posed(pair, frames);
            let from = particles.position[pair.a.index()] - origin;
            PairOfPieces { a, b, r: bodies.relative(pair), from }
        })
        .collect();
    let oneness = |i: usize, j: usize| oneness(pairs[i], pairs[j], particles);
    let found = if is_on_mesh {
        thickness_of_pieces_on_surface(&posed, oneness)
    } else {
        thickness_of_pieces(&posed, oneness)
    };
    for &row in rows {
        stays[row] = false;
    }
    for OfPieces { pairs, thickness } in found {
        // Several contacts of one piece with a surface take as many of its rows.
        let is_of = |&k: &usize| pairs.iter().any(|&of| posed_of(&firsts, k) == of);
        let Some(k) = (0..rows.len()).filter(is_of).find(|&k| !stays[rows[k]]) else { continue };
        let row = rows[k];
        stays[row] = true;
        let (touch, patch) = contact_of(&thickness);
        let from = particles.position[of_rows[k].a.index()] - origin;
        touching.geometry[row] = Geometry { normal: touch.normal, overlap: touch.overlap };
        touching.point[row] = touch.point - from;
        if let Some(of_row) = touching.patch.get_mut(row) {
            *of_row = patch;
        }
    }
}

/// Number of the piece of a row, given the first rows of pieces.
fn posed_of(firsts: &[usize], row: usize) -> usize {
    firsts.partition_point(|&first| first <= row) - 1
}

/// Lets contacts of coincident round pieces press as one, nearly like the deepest. With `W_i = Σ_j δ_j⁸` over those that
/// coincide with contact `i`, the energy of a stiffness `k` is `½ k Σ_i δ_i⁸ W_i^(-3/4)`, and forces are its gradient. For
/// one contact it is `½ k δ²`, for two equally deep ones 1.19 of that.
fn share_depth(rows: &[usize], touching: &mut Touching, of_rows: &[Pair], particles: &Particles) {
    let count = rows.len();
    let deepest = rows.iter().map(|&row| touching.geometry[row].overlap).fold(0.0, f64::max);
    let parts: Vec<f64> =
        rows.iter().map(|&row| touching.geometry[row].overlap / deepest).collect();
    let are_one =
        |i: usize, j: usize| oneness(of_rows[rows[i]], of_rows[rows[j]], particles) >= ONE;
    let with = |i: usize| (0..count).filter(move |&j| are_one(i, j));
    let eighth = |i: usize| parts[i].powi(8);
    let sums: Vec<f64> = (0..count).map(|i| with(i).map(eighth).sum()).collect();
    let root = |i: usize| (sums[i] * sums[i] * sums[i]).sqrt().sqrt();
    for i in (0..count).filter(|&i| with(i).nth(1).is_some()) {
        let thickness = parts[i].powi(4) / root(i).sqrt();
        let others: f64 = with(i).map(|j| eighth(j) / (sums[j] * root(j))).sum();
        let force = 4.0 * parts[i].powi(7) * (1.0 / root(i) - 0.75 * others);
        touching.geometry[rows[i]].overlap = thickness * deepest;
        if let Some(patch) = touching.patch.get_mut(rows[i]) {
            patch.gain *= force / thickness;
            patch.lever *= force / thickness;
        }
    }
}

/// Cosine between the normals of a contact of two bodies and one that has ended; `None` if the bodies differ, or the
/// normals by more than half a right angle.
pub(super) fn likeness(
    (now, normal): (Pair, &Vec3),
    (before, last): (Pair, &Vec3),
    particles: &Particles,
) -> Option<f64> {
    let likeness = normal.dot(last);
    let is_of_both = has_piece(now, particles) && particles.have_same_bodies(now, before);
    (is_of_both && likeness > FRAC_1_SQRT_2).then_some(likeness)
}

/// Share of the masses of its bodies for each contact of a stretch; 1 if the bodies touch in one place. It is `g²` over
/// `Σ g_j² min(1, δ_j / δ) max(0, n_j·n)²` over the contacts of both bodies, with the gains `g` of round ones: among
/// coincident ones the stiffness of each is `g²` of that of a single one ([`share_depth`]), and its dashpot `g`. Empty without
/// pieces.
pub(super) fn shares(
    (pairs, geometry, patches): (&[Pair], &[Geometry], &[Patch]),
    particles: &Particles,
    shares: &mut Vec<f64>,
) {
    shares.clear();
    if !are_there(pairs, particles) {
        return;
    }
    shares.resize(pairs.len(), 1.0);
    let part = |row: usize| {
        let is_faced = have_faces(pairs[row], particles);
        if is_faced { 1.0 } else { patches[row].gain * patches[row].gain }
    };
    for rows in several(&by_bodies(pairs.iter().copied(), particles)) {
        for &(_, row) in rows {
            let own = &geometry[row];
            let like = |&(_, other): &(Bodies, usize)| {
                let Geometry { normal, overlap } = &geometry[other];
                let cosine = normal.dot(&own.normal).max(0.0);
                part(other) * (overlap / own.overlap).clamp(0.0, 1.0) * cosine * cosine
            };
            shares[row] = part(row) / rows.iter().map(like).sum::<f64>().max(1.0);
        }
    }
}
