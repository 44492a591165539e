//! Contacts with walls of triangles: they belong to the surface, not to its facets.
//!
//! A particle may touch facets that have a common corner or are near each other, one after the next. If their normals
//! nearly agree with that of the deepest contact, they are one smooth surface, and only the deepest contact counts.
//! Coincident facets, of one wall or of two, count once, and so do coincident planes. A particle that is not a sphere may
//! touch a face and an edge of that face with different normals. Then the edge is inside the particle, and only the least
//! overlap counts. A contact may end on one facet while one begins on another with a common corner. Then it has passed an
//! edge, and keeps its state.
//!
//! A particle with faces or a straight side has one contact with all facets of a surface
//! ([`crate::contact::thickness_on_surface`]), so none is left out. Its contact passes to any facet, if the normal turns by
//! less than half a right angle.

use crate::contact::{Geometry, Pair, Touching, touch_of_sphere};
use crate::ids::{GlobalId, Slot};
use crate::math::Vec3;
use crate::particles::Particles;
use crate::shape::triangle_mesh::FLAT;
use crate::shape::{Kind, TriangleMesh};
use crate::walls::PARALLEL;
use std::cmp::Ordering;

/// A facet of a mesh that is the second body of a pair.
pub(super) struct OnMesh<'a> {
    wall: usize,
    facet: u32,
    mesh: &'a TriangleMesh,
}

impl<'a> OnMesh<'a> {
    pub(super) fn of(pair: Pair, particles: &'a Particles) -> Option<Self> {
        let wall = particles.wall_of(pair.b)?;
        let mesh = &*particles.walls[wall].mesh.as_ref()?.surface;
        let (_, facet) = particles.id[pair.b.index()].wall_and_facet()?;
        Some(Self { wall, facet: facet as u32, mesh })
    }
}

/// Cosine of half a right angle.
const HALF_OF_RIGHT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Cosine of an angle within rounding.
const ALIKE: f64 = 1.0 - 1e-12;

/// Does the particle of a pair have faces or a straight side?
fn is_extended(pair: Pair, particles: &Particles) -> bool {
    particles.bodies().shape_of(pair.a).kind().extended()[0] > 0
}

/// Largest distance of the nearest points on facets of one surface, over the radius of the particle, for facets of one wall
/// without a common corner.
const NEAR: f64 = 0.5;

/// Is any of these pairs with a mesh? Pairs with walls are in separate stretches.
pub(super) fn has_meshes(pairs: &[Pair], particles: &Particles) -> bool {
    !particles.near_facets.is_empty() && are_with_walls(pairs, particles)
}

fn are_with_walls(pairs: &[Pair], particles: &Particles) -> bool {
    pairs.first().is_some_and(|pair| pair.b.index() >= particles.first_facet())
}

/// May any of these pairs be with coincident planes?
pub(super) fn has_equal_planes(pairs: &[Pair], particles: &Particles) -> bool {
    particles.facets.any_parallel && are_with_walls(pairs, particles)
}

/// A contact with a wall.
struct OnWall<'a> {
    grain: Slot,
    row: usize,
    geometry: &'a Geometry,
    /// Nearest point on the wall, from the centre of the particle [m].
    foot: Vec3,
    id: GlobalId,
    mesh: Option<OnMesh<'a>>,
}

impl<'a> OnWall<'a> {
    fn of(row: usize, touching: &'a Touching, pairs: &[Pair], particles: &'a Particles) -> Self {
        let pair = pairs[touching.pair[row] as usize];
        let geometry = &touching.geometry[row];
        let Geometry { normal, overlap } = geometry;
        let of_sphere = || touch_of_sphere(particles.radius(pair.a.index()), normal, *overlap);
        let point = touching.point.get(row).copied().unwrap_or_else(of_sphere);
        Self {
            grain: pair.a,
            row,
            geometry,
            foot: point - normal * (0.5 * overlap),
            id: particles.id[pair.b.index()],
            mesh: OnMesh::of(pair, particles),
        }
    }

    /// Orders contacts by particle, then by decreasing overlap.
    fn order(&self, other: &Self) -> Ordering {
        let deeper = || other.geometry.overlap.total_cmp(&self.geometry.overlap);
        self.grain.0.cmp(&other.grain.0).then_with(deeper).then_with(|| self.id.cmp(&other.id))
    }

    /// Does its facet lie in the plane of another, at its nearest point?
    fn lies_in(&self, other: &Self, of: &Grain) -> bool {
        let normal = &other.geometry.normal;
        (self.foot - other.foot).dot(normal).abs() <= FLAT * of.radius
            && self.mesh.as_ref().is_some_and(|on| {
                let wall = &of.particles.walls[on.wall];
                let frame = wall.frame();
                let place = frame.tr_mul(&(of.centre + self.foot - wall.point));
                on.mesh.is_along(on.facet, &place, &frame.tr_mul(normal))
            })
    }

    /// Does it lie on one surface with a deeper contact, which is represented by one with the normal `counts`?
    fn is_one_with(&self, deeper: &Self, counts: &Vec3, of: &Grain) -> bool {
        let normal = &self.geometry.normal;
        let apart = (self.foot - deeper.foot).norm();
        let on = self.mesh.as_ref().zip(deeper.mesh.as_ref());
        match on.filter(|(on, other)| on.wall == other.wall) {
            // On one wall, particles with faces or a straight side have one contact with each surface.
            Some(_) if of.is_extended => return false,
            Some((OnMesh { mesh, facet, .. }, other)) => {
                let is_near = || mesh.adjoin(*facet, other.facet) || apart < NEAR * of.radius;
                if mesh.are_one(normal, counts) && is_near() {
                    return true;
                }
            }
            None => {
                let near = if of.is_extended { FLAT } else { NEAR };
                if normal.dot(&deeper.geometry.normal) > PARALLEL && apart < near * of.radius {
                    return true;
                }
            }
        }
        // An edge or a corner in a face to which it does not belong.
        on.is_some_and(|(on, other)| {
            !of.is_extended
                && self.lies_in(deeper, of)
                && !(on.wall == other.wall && on.mesh.are_face_and_edge(on.facet, other.facet))
                && other.is_on_face(&(of.centre + self.foot), FLAT * of.radius, of.particles)
        })
    }
}

impl OnMesh<'_> {
    /// Is its facet a face that contains a place [m]?
    fn is_on_face(&self, place: &Vec3, tolerance: f64, particles: &Particles) -> bool {
        let wall = &particles.walls[self.wall];
        let place = wall.frame().tr_mul(&(place - wall.point));
        self.mesh.is_on_face(self.facet, &place, tolerance)
    }

    /// Cosine between the normals of a contact and an ended one of the same particle, if it may continue the ended one.
    pub(super) fn nearness(
        &self,
        (now, normal): (Pair, &Vec3),
        (before, last): (Pair, &Vec3),
        particles: &Particles,
    ) -> Option<f64> {
        let was = OnMesh::of(before, particles)?;
        if before.a != now.a || was.wall != self.wall {
            return None;
        }
        let nearness = last.dot(normal);
        let is_same = if is_extended(before, particles) {
            nearness > HALF_OF_RIGHT
        } else {
            // A particle that crosses a period continues on the image of its facet.
            nearness > ALIKE || nearness > 0.0 && self.mesh.adjoin(self.facet, was.facet)
        };
        is_same.then_some(nearness)
    }

    /// Is one of two facets a face, and the other an edge of it, touched from outside? Then the edge is inside the
    /// particle.
    fn is_sharp_beside(&self, other: &Self, normals: [&Vec3; 2], particles: &Particles) -> bool {
        let frame = particles.walls[self.wall].frame();
        let faces = |on: &Self, normal: &Vec3| on.mesh.is_outside(on.facet, &-frame.tr_mul(normal));
        self.wall == other.wall
            && self.mesh.are_face_and_edge(self.facet, other.facet)
            && faces(self, normals[0])
            && faces(other, normals[1])
    }
}

/// A particle that touches walls.
struct Grain<'a> {
    centre: Vec3,
    radius: f64,
    is_extended: bool,
    particles: &'a Particles,
}

/// Leaves out contacts of a particle with facets on one surface with a deeper contact, if their normals nearly agree. For
/// shapes other than spheres it also leaves out contacts with a face or its edge beside a less deep one with another
/// normal. Of equally deep contacts the one with the lower id stays.
pub(super) fn merge(touching: &mut Touching, pairs: &[Pair], particles: &Particles) {
    let grain = |row: usize| pairs[touching.pair[row] as usize].a;
    // Usually no particle touches two facets. The contacts of a particle with walls are consecutive in the list.
    let is_next =
        |row: usize| touching.pair[row - 1] < touching.pair[row] && grain(row - 1) != grain(row);
    if (1..touching.len()).all(is_next) {
        return;
    }
    let mut on_walls: Vec<OnWall> =
        (0..touching.len()).map(|row| OnWall::of(row, touching, pairs, particles)).collect();
    on_walls.sort_by(OnWall::order);
    let mut stays = vec![true; touching.len()];
    for of_one in on_walls.chunk_by(|one, other| one.grain == other.grain) {
        if of_one.len() > 1 {
            merge_of_one(of_one, &mut stays, particles);
        }
    }
    if stays.contains(&false) {
        touching.keep(&stays);
    }
}

/// Leaves out contacts of one particle with walls, see [`merge`].
fn merge_of_one(of_one: &[OnWall], stays: &mut [bool], particles: &Particles) {
    let slot = of_one[0].grain;
    let kind = particles.bodies().shape_of(slot).kind();
    let grain = Grain {
        centre: particles.position[slot.index()],
        radius: particles.radius(slot.index()),
        is_extended: kind.extended()[0] > 0,
        particles,
    };
    // A plane has no border, and coincident facets add nothing.
    let is_in_plane = |on: &OnWall| {
        let mut planes = of_one.iter().filter(|other| other.mesh.is_none());
        on.mesh.is_some() && planes.any(|plane| on.lies_in(plane, &grain))
    };
    for on in of_one {
        stays[on.row] = !is_in_plane(on);
    }
    let rest: Vec<&OnWall> = of_one.iter().filter(|on| stays[on.row]).collect();
    // For each, the contact that counts in its place.
    let mut for_it: Vec<usize> = (0..rest.len()).collect();
    for k in 1..rest.len() {
        let is_one = |&other: &usize| {
            let counts = &rest[for_it[other]].geometry.normal;
            rest[k].is_one_with(rest[other], counts, &grain)
        };
        if let Some(other) = (0..k).find(is_one) {
            for_it[k] = for_it[other];
            stays[rest[k].row] = false;
        }
    }
    // A sphere that touches a face and an edge of it touches both, as across a slit.
    if kind == Kind::Sphere || grain.is_extended {
        return;
    }
    // The least deep contacts come last.
    for (k, on) in rest.iter().enumerate() {
        let has_it_in = |other: &&OnWall| {
            let pair = on.mesh.as_ref().zip(other.mesh.as_ref());
            stays[other.row]
                && pair.is_some_and(|(one, two)| {
                    let normals = [on, other].map(|on| &on.geometry.normal);
                    one.is_sharp_beside(two, normals, particles)
                })
        };
        let is_least = !rest[k + 1..].iter().any(has_it_in);
        stays[on.row] &= is_least;
    }
}
