//! Contacts with walls of triangles belong to the surface, not to its facets.
//!
//! Where a grain touches facets that have a corner in common, one with the next, with nearly the normal of the deepest contact, it touches one smooth
//! surface: that contact counts. Where a grain that is no sphere touches a face and an edge of that face with other normals, it has the edge in it, and the
//! least overlap counts. Where a contact ends on one facet and one begins on another that has a corner in common with it, in
//! the same step, the contact has gone over an edge: it takes along what is remembered.
//!
//! A grain with faces or a straight side has one contact with all facets that are one surface ([`crate::contact::thickness_on_surface`]), so that
//! there is nothing to leave out. Its contact passes to any facet, if the normal turns by less than half of a right angle.

use crate::contact::{Geometry, Pair, Previous, Touching};
use crate::ids::GlobalId;
use crate::law::Separated;
use crate::particles::Particles;
use crate::shape::{Kind, TriangleMesh};

/// A facet of a mesh that is the second body of a pair.
struct OnMesh<'a> {
    wall: usize,
    facet: u32,
    mesh: &'a TriangleMesh,
}

impl<'a> OnMesh<'a> {
    fn of(pair: Pair, particles: &'a Particles) -> Option<Self> {
        let wall = particles.wall_of(pair.b)?;
        let mesh = &*particles.walls[wall].mesh.as_ref()?.surface;
        let (_, facet) = particles.id[pair.b.index()].wall_and_facet()?;
        Some(Self { wall, facet: facet as u32, mesh })
    }
}

/// The cosine of half of a right angle.
const HALF_OF_RIGHT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The cosine of an angle that is rounding.
const ALIKE: f64 = 1.0 - 1e-12;

/// Has the grain of a pair faces or a straight side?
fn is_extended(pair: Pair, particles: &Particles) -> bool {
    particles.bodies().shape_of(pair.a).kind().extended()[0] > 0
}

/// Is any of these pairs with a mesh? Pairs with walls stand in stretches of their own.
pub(super) fn has_meshes(pairs: &[Pair], particles: &Particles) -> bool {
    !particles.near_facets.is_empty()
        && pairs.first().is_some_and(|pair| pair.b.index() >= particles.first_facet())
}

/// Leaves out contacts of a grain with a facet that adjoins another on which it lies deeper, with nearly the normal of what counts there, and of others than
/// spheres with a face or an edge of it beside one on which they lie less deep, with another normal. Of equally deep ones that with the lower id stays.
pub(super) fn merge(touching: &mut Touching, pairs: &[Pair], particles: &Particles) {
    let ids = |row: usize| {
        let Pair { a, b } = pairs[touching.pair[row] as usize];
        [a, b].map(|slot| particles.id[slot.index()])
    };
    // Most often no grain touches two facets, and the pairs stand in the order of the grains.
    if (1..touching.len()).all(|row| ids(row - 1)[0] < ids(row)[0]) {
        return;
    }
    let id = |row: usize| ids(row)[1];
    let mut on_meshes: Vec<(u32, OnMesh, usize)> = (0..touching.len())
        .filter_map(|row| {
            let pair = pairs[touching.pair[row] as usize];
            let on = OnMesh::of(pair, particles).filter(|_| !is_extended(pair, particles))?;
            Some((pair.a.0, on, row))
        })
        .collect();
    let key = |(a, on, _): &(u32, OnMesh, usize)| (*a, on.wall);
    on_meshes.sort_by(|one, other| {
        let overlap = |(_, _, row): &(u32, OnMesh, usize)| touching.geometry[*row].overlap;
        let deeper = || overlap(other).total_cmp(&overlap(one));
        key(one).cmp(&key(other)).then_with(deeper).then_with(|| id(one.2).cmp(&id(other.2)))
    });
    let mut stays = vec![true; touching.len()];
    // Of each the contact that counts for it.
    let mut for_it: Vec<usize> = (0..touching.len()).collect();
    for of_one in on_meshes.chunk_by(|one, other| key(one) == key(other)) {
        for (k, (_, on, row)) in of_one.iter().enumerate() {
            let normal = &touching.geometry[*row].normal;
            let deeper = of_one[..k].iter().find(|(_, deeper, other)| {
                on.mesh.are_one(normal, &touching.geometry[for_it[*other]].normal)
                    && on.mesh.adjoin(on.facet, deeper.facet)
            });
            if let Some((_, _, other)) = deeper {
                for_it[*row] = for_it[*other];
                stays[*row] = false;
            }
        }
        // A sphere that touches a face and an edge of it touches both, as across a slit.
        let grain = pairs[touching.pair[of_one[0].2] as usize].a;
        if particles.bodies().shape_of(grain).kind() == Kind::Sphere {
            continue;
        }
        // The least deep stand last.
        for (k, (_, on, row)) in of_one.iter().enumerate() {
            let is_least = of_one[k + 1..].iter().all(|(_, other, row)| {
                !stays[*row] || !on.mesh.are_face_and_edge(on.facet, other.facet)
            });
            stays[*row] &= is_least;
        }
    }
    if stays.contains(&false) {
        touching.keep(&stays);
    }
}

/// Lets new contacts on meshes go on from those that have ended on facets beside theirs: of several, from that with the nearest normal.
pub(super) fn pass_on(
    (now, geometry): (&[Pair], &[Geometry]),
    (before, geometry_before): (&[Pair], &[Geometry]),
    from: &mut [Previous],
    separated: &mut Vec<Separated>,
    particles: &Particles,
) {
    for row in 0..from.len() {
        if from[row] != Previous::NONE || separated.is_empty() {
            continue;
        }
        let Some(on) = OnMesh::of(now[row], particles) else { continue };
        let nearness = |ended: &Separated| {
            let pair = before[ended.place];
            let was = OnMesh::of(pair, particles)?;
            if pair.a != now[row].a || was.wall != on.wall {
                return None;
            }
            let nearness = geometry_before[ended.place].normal.dot(&geometry[row].normal);
            let is_same = if is_extended(pair, particles) {
                nearness > HALF_OF_RIGHT
            } else {
                // A grain that comes through a period goes on with the image of its facet.
                nearness > ALIKE || nearness > 0.0 && on.mesh.adjoin(on.facet, was.facet)
            };
            is_same.then_some(nearness)
        };
        let mut best: Option<(f64, GlobalId, usize)> = None;
        for (k, ended) in separated.iter().enumerate() {
            let Some(nearness) = nearness(ended) else { continue };
            let id = particles.id[before[ended.place].b.index()];
            let is_better = best.is_none_or(|(nearest, of, _)| {
                nearness > nearest || nearness == nearest && id < of
            });
            if is_better {
                best = Some((nearness, id, k));
            }
        }
        if let Some((_, _, k)) = best {
            from[row] = Previous::at(separated.remove(k).place);
        }
    }
}
