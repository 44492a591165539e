//! Contacts with walls of triangles belong to the surface, not to its facets.
//!
//! Where a grain touches facets that have a corner in common, or are near each other, one with the next, with nearly the normal of the deepest contact, it touches
//! one smooth surface: that contact counts. Facets that lie in each other, of one wall or of two, count once, and so do planes. Where a grain that is no sphere touches a face and an edge of that face with other normals, it has the edge in it, and the
//! least overlap counts. Where a contact ends on one facet and one begins on another that has a corner in common with it, in
//! the same step, the contact has gone over an edge: it takes along what is remembered.
//!
//! A grain with faces or a straight side has one contact with all facets that are one surface ([`crate::contact::thickness_on_surface`]), so that
//! there is nothing to leave out. Its contact passes to any facet, if the normal turns by less than half of a right angle.

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

/// The cosine of half of a right angle.
const HALF_OF_RIGHT: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The cosine of an angle that is rounding.
const ALIKE: f64 = 1.0 - 1e-12;

/// Has the grain of a pair faces or a straight side?
fn is_extended(pair: Pair, particles: &Particles) -> bool {
    particles.bodies().shape_of(pair.a).kind().extended()[0] > 0
}

/// Of facets of one wall without a common corner only those with feet nearer than this are one surface, over the radius of the grain.
const NEAR: f64 = 0.5;

/// Is any of these pairs with a mesh? Pairs with walls stand in stretches of their own.
pub(super) fn has_meshes(pairs: &[Pair], particles: &Particles) -> bool {
    !particles.near_facets.is_empty() && are_with_walls(pairs, particles)
}

fn are_with_walls(pairs: &[Pair], particles: &Particles) -> bool {
    pairs.first().is_some_and(|pair| pair.b.index() >= particles.first_facet())
}

/// May any of these pairs be with planes that lie in each other?
pub(super) fn has_equal_planes(pairs: &[Pair], particles: &Particles) -> bool {
    particles.facets.any_parallel && are_with_walls(pairs, particles)
}

/// A contact with a wall.
struct OnWall<'a> {
    grain: Slot,
    row: usize,
    geometry: &'a Geometry,
    /// Where it is nearest to the wall, from the centre of the grain [m].
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

    /// The first that counts stands first.
    fn order(&self, other: &Self) -> Ordering {
        let deeper = || other.geometry.overlap.total_cmp(&self.geometry.overlap);
        self.grain.0.cmp(&other.grain.0).then_with(deeper).then_with(|| self.id.cmp(&other.id))
    }

    /// Does its facet lie in the plane of another, where its foot is?
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

    /// Is it on one surface with a deeper contact, for which one with the normal `counts` counts?
    fn is_one_with(&self, deeper: &Self, counts: &Vec3, of: &Grain) -> bool {
        let normal = &self.geometry.normal;
        let apart = (self.foot - deeper.foot).norm();
        let on = self.mesh.as_ref().zip(deeper.mesh.as_ref());
        match on.filter(|(on, other)| on.wall == other.wall) {
            // There, grains with faces or a straight side have one contact with each surface.
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
        // An edge or a corner in a face of which it is none.
        on.is_some_and(|(on, other)| {
            !of.is_extended
                && self.lies_in(deeper, of)
                && !(on.wall == other.wall && on.mesh.are_face_and_edge(on.facet, other.facet))
                && other.is_on_face(&(of.centre + self.foot), FLAT * of.radius, of.particles)
        })
    }
}

impl OnMesh<'_> {
    /// Is its facet a face, and a place in it [m]?
    fn is_on_face(&self, place: &Vec3, tolerance: f64, particles: &Particles) -> bool {
        let wall = &particles.walls[self.wall];
        let place = wall.frame().tr_mul(&(place - wall.point));
        self.mesh.is_on_face(self.facet, &place, tolerance)
    }

    /// How near the normal of a contact of a grain is to that of one that has ended, as a cosine, if it may go on from it.
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
            // A grain that comes through a period goes on with the image of its facet.
            nearness > ALIKE || nearness > 0.0 && self.mesh.adjoin(self.facet, was.facet)
        };
        is_same.then_some(nearness)
    }

    /// Has a grain the edge in it: is one of two facets a face, and the other an edge of it, felt from outside?
    fn is_sharp_beside(&self, other: &Self, normals: [&Vec3; 2], particles: &Particles) -> bool {
        let frame = particles.walls[self.wall].frame();
        let faces = |on: &Self, normal: &Vec3| on.mesh.is_outside(on.facet, &-frame.tr_mul(normal));
        self.wall == other.wall
            && self.mesh.are_face_and_edge(self.facet, other.facet)
            && faces(self, normals[0])
            && faces(other, normals[1])
    }
}

/// A grain that touches walls.
struct Grain<'a> {
    centre: Vec3,
    radius: f64,
    is_extended: bool,
    particles: &'a Particles,
}

/// Leaves out contacts of a grain with a facet that is one surface with another on which it lies deeper, with nearly the normal of what counts there, and of others than
/// spheres with a face or an edge of it beside one on which they lie less deep, with another normal. Of equally deep ones that with the lower id stays.
pub(super) fn merge(touching: &mut Touching, pairs: &[Pair], particles: &Particles) {
    let grain = |row: usize| pairs[touching.pair[row] as usize].a;
    // Most often no grain touches two facets. What a grain has with walls stands together in the list.
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

/// Leaves out of the contacts of one grain with walls, see [`merge`].
fn merge_of_one(of_one: &[OnWall], stays: &mut [bool], particles: &Particles) {
    let slot = of_one[0].grain;
    let kind = particles.bodies().shape_of(slot).kind();
    let grain = Grain {
        centre: particles.position[slot.index()],
        radius: particles.radius(slot.index()),
        is_extended: kind.extended()[0] > 0,
        particles,
    };
    // A plane has no border, and what lies in it adds nothing.
    let is_in_plane = |on: &OnWall| {
        let mut planes = of_one.iter().filter(|other| other.mesh.is_none());
        on.mesh.is_some() && planes.any(|plane| on.lies_in(plane, &grain))
    };
    for on in of_one {
        stays[on.row] = !is_in_plane(on);
    }
    let rest: Vec<&OnWall> = of_one.iter().filter(|on| stays[on.row]).collect();
    // Of each the contact that counts for it.
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
    // The least deep stand last.
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
