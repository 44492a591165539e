//! Faces of a convex polyhedron: planes, and polygons of vertices.
//!
//! For clipping by planes ([`super::clip`]), a face is one polygon, however many triangles it was given by.

use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// Plane of a face: points `p` of the body have `p · normal <= offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// Outward unit normal.
    pub normal: Vec3,
    /// Distance from the origin along the normal [m].
    pub offset: f64,
}

/// An edge: a side of each of its two faces, in opposite directions.
///
/// Edge `e` has the sides `2 e` and `2 e + 1`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Edge {
    /// Vertices where the sides begin.
    pub(super) from: [u32; 2],
    /// Next side in the face of each side.
    pub(super) next: [u32; 2],
    /// Face of each side.
    pub(super) face: [u32; 2],
}

/// A convex polyhedron by its faces.
///
/// The polygons close the surface: each side of one is a side of exactly one other, in the opposite direction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facets {
    vertices: Vec<Vec3>,
    planes: Vec<Plane>,
    /// Vertices of all faces, one face after the other.
    corners: Vec<u32>,
    /// The corners of face `k` are `corners[first[k]..first[k + 1]]`.
    first: Vec<u32>,
    edges: Vec<Edge>,
    bounding_radius: f64,
}

impl Facets {
    /// Faces of a closed surface of triangles, each with the index of its plane.
    pub(super) fn of_triangles(
        vertices: &[Vec3],
        triangles: impl Iterator<Item = ([u32; 3], u32)>,
        planes: &[Plane],
    ) -> Self {
        let mut of_plane = vec![Vec::new(); planes.len()];
        for (corners, plane) in triangles {
            of_plane[plane as usize].push(corners);
        }
        let mut facets = Self::without_faces(vertices);
        for (plane, triangles) in planes.iter().zip(&of_plane) {
            match outline(triangles) {
                Some(polygon) => facets.push(*plane, &polygon),
                // The outline meets itself, which occurs only with slivers.
                None => triangles.iter().for_each(|corners| facets.push(*plane, corners)),
            }
        }
        facets.closed()
    }

    /// A body to which faces are added until it is [`Facets::closed`].
    pub(super) fn without_faces(vertices: &[Vec3]) -> Self {
        let bounding_radius = vertices.iter().map(Vec3::norm).fold(0.0, f64::max);
        Self { vertices: vertices.to_vec(), first: vec![0], bounding_radius, ..Self::default() }
    }

    /// Adds a face.
    pub(super) fn push(&mut self, plane: Plane, polygon: &[u32]) {
        self.planes.push(plane);
        self.corners.extend_from_slice(polygon);
        self.first.push(self.corners.len() as u32);
    }

    /// Completes the body after all faces: finds the edges, in the order of their first sides among the corners.
    pub(super) fn closed(mut self) -> Self {
        let mut sides = Vec::with_capacity(self.corners.len());
        for (face, ends) in (0..).zip(self.first.windows(2)) {
            let corners = &self.corners[ends[0] as usize..ends[1] as usize];
            for (k, &from) in corners.iter().enumerate() {
                let last = k + 1 == corners.len();
                let (to, next) = if last {
                    (corners[0], ends[0])
                } else {
                    (corners[k + 1], ends[0] + k as u32 + 1)
                };
                sides.push((from, to, next, face));
            }
        }
        let mut forth: Vec<usize> = (0..sides.len()).collect();
        let mut back = forth.clone();
        forth.sort_by_key(|&side| (sides[side].0, sides[side].1));
        back.sort_by_key(|&side| (sides[side].1, sides[side].0));
        let mut twin = vec![0; sides.len()];
        for (side, beyond) in forth.into_iter().zip(back) {
            twin[side] = beyond;
        }
        let mut number = vec![0; sides.len()];
        let firsts: Vec<usize> = (0..sides.len()).filter(|&side| side < twin[side]).collect();
        for (edge, &side) in (0..).zip(&firsts) {
            number[side] = 2 * edge;
            number[twin[side]] = 2 * edge + 1;
        }
        self.edges = firsts
            .iter()
            .map(|&side| {
                let both = [sides[side], sides[twin[side]]];
                Edge {
                    from: both.map(|(from, ..)| from),
                    next: both.map(|(_, _, next, _)| number[next as usize]),
                    face: both.map(|(.., face)| face),
                }
            })
            .collect();
        self
    }

    /// The edges.
    pub(super) fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Corners of the body [m].
    pub fn vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// Planes of the faces.
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// Vertices of all faces, one face after the other, counter-clockwise seen from outside.
    pub fn corners(&self) -> &[u32] {
        &self.corners
    }

    /// End of each face among the [`Facets::corners`].
    pub fn ends(&self) -> &[u32] {
        &self.first[1..]
    }

    /// Radius of the smallest sphere about the origin that contains the body [m].
    pub const fn bounding_radius(&self) -> f64 {
        self.bounding_radius
    }
}

/// Outline of triangles in one plane: the sides that only one of them has, in their order; `None` if it is not one circuit.
fn outline(triangles: &[[u32; 3]]) -> Option<Vec<u32>> {
    let sides = || triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
    let outer: Vec<(u32, u32)> =
        sides().filter(|&(from, to)| !sides().any(|side| side == (to, from))).collect();
    let mut polygon = Vec::with_capacity(outer.len());
    let (mut here, start) = (outer.first()?.0, outer.first()?.0);
    loop {
        let mut next = outer.iter().filter(|side| side.0 == here);
        let (Some(side), None) = (next.next(), next.next()) else { return None };
        polygon.push(here);
        here = side.1;
        if here == start || polygon.len() > outer.len() {
            break;
        }
    }
    (polygon.len() == outer.len()).then_some(polygon)
}
