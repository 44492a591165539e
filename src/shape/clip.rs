//! Cutting a convex polyhedron by planes: exact in its combinatorics, without tolerances.
//!
//! A vertex lies inside a plane or outside; nothing lies on it. Where an edge goes from inside to outside, one new
//! vertex is made for it, from the end with the lower index to the other, and both faces at that edge use it. In each
//! face the edge by which its outline leaves the plane's inside is linked with the one by which it comes back. Each new
//! vertex is such an exit of one of its two faces, and an entry of the other. So these links are a permutation of the
//! new vertices, and its cycles are the polygons of the cut.
//!
//! The surface therefore stays closed whatever the rounding of vertices and planes: for coplanar faces, for shared edges
//! and corners, and where rounding lets an outline cross a plane four times. (Compare Sutherland and Hodgman 1974,
//! DOI 10.1145/360767.360802, who cut one polygon.)

use super::facets::{Facets, Plane};
use crate::math::Vec3;

/// A face of a cut polyhedron.
#[derive(Clone, Copy, Debug)]
pub struct Face<'a> {
    /// Indices of its vertices, counter-clockwise seen from outside; at least three.
    pub corners: &'a [u32],
    /// Its plane.
    pub plane: Plane,
    /// Is it a cut? If not, it is a face of the body that was cut, or what is left of it.
    pub is_cut: bool,
}

/// A face, without its corners.
#[derive(Clone, Copy, Debug)]
struct Outline {
    /// Where it ends among the corners of all faces.
    end: u32,
    plane: Plane,
    is_cut: bool,
}

/// A closed surface.
#[derive(Clone, Debug, Default)]
struct Surface {
    vertices: Vec<Vec3>,
    /// Vertices of all faces, one face after the other.
    corners: Vec<u32>,
    faces: Vec<Outline>,
}

impl Surface {
    fn clear(&mut self) {
        self.vertices.clear();
        self.corners.clear();
        self.faces.clear();
    }
}

/// A convex polyhedron that is cut by one plane after the other. It keeps its memory from one polyhedron to the next.
#[derive(Clone, Debug, Default)]
pub struct Clipped {
    now: Surface,
    /// What is being made of it.
    next: Surface,
    /// How far vertices lie outside the plane [m].
    heights: Vec<f64>,
    /// Where vertices go that stay.
    places: Vec<u32>,
    /// Edges that are cut, by the lower and the higher index of their ends.
    edges: Vec<(u32, u32)>,
    /// The new vertex that follows that of a cut edge in the outline of the cut.
    after: Vec<u32>,
}

/// No vertex.
const NONE: u32 = u32::MAX;

impl Clipped {
    /// Begins with a body.
    pub fn begin(&mut self, body: &Facets) {
        self.now.clear();
        self.now.vertices.extend_from_slice(body.vertices());
        self.now.corners.extend_from_slice(body.corners());
        let faces = body.ends().iter().zip(body.planes());
        self.now.faces.extend(faces.map(|(&end, plane)| Outline {
            end,
            plane: *plane,
            is_cut: false,
        }));
    }

    /// Leaves the part with `p · normal <= offset`. Is there any?
    pub fn cut(&mut self, plane: &Plane) -> bool {
        if !self.measure(plane) {
            return !self.now.faces.is_empty();
        }
        self.next.clear();
        self.keep_inside();
        if self.next.vertices.is_empty() {
            self.now.clear();
            return false;
        }
        self.edges.clear();
        self.after.clear();
        let mut start = 0;
        for face in 0..self.now.faces.len() {
            let outline = self.now.faces[face];
            self.cut_face(start, outline);
            start = outline.end as usize;
        }
        self.close(plane);
        std::mem::swap(&mut self.now, &mut self.next);
        true
    }

    /// Finds how far all vertices lie outside a plane. Does any?
    fn measure(&mut self, plane: &Plane) -> bool {
        self.heights.clear();
        let height = |vertex: &Vec3| vertex.dot(&plane.normal) - plane.offset;
        self.heights.extend(self.now.vertices.iter().map(height));
        !self.heights.iter().all(|&height| height <= 0.0)
    }

    /// Takes over the vertices inside.
    fn keep_inside(&mut self) {
        self.places.clear();
        for (vertex, &height) in self.now.vertices.iter().zip(&self.heights) {
            self.places.push(self.next.vertices.len() as u32);
            if height <= 0.0 {
                self.next.vertices.push(*vertex);
            }
        }
    }

    /// Takes over what is inside of a face.
    fn cut_face(&mut self, start: usize, outline: Outline) {
        let end = outline.end as usize;
        let begin = self.next.corners.len();
        let is_inside = |heights: &[f64], corner: u32| heights[corner as usize] <= 0.0;
        let mut last = self.now.corners[end - 1];
        let mut was_inside = is_inside(&self.heights, last);
        let (mut exit, mut first_entry) = (NONE, NONE);
        for k in start..end {
            let here = self.now.corners[k];
            let inside = is_inside(&self.heights, here);
            if inside != was_inside {
                let vertex = self.on_edge(last, here);
                self.next.corners.push(vertex);
                if was_inside {
                    exit = vertex;
                } else if exit == NONE {
                    first_entry = vertex;
                } else {
                    self.link(vertex, exit);
                    exit = NONE;
                }
            }
            if inside {
                self.next.corners.push(self.places[here as usize]);
            }
            (last, was_inside) = (here, inside);
        }
        if first_entry != NONE {
            self.link(first_entry, exit);
        }
        let end = self.next.corners.len();
        if end > begin {
            self.next.faces.push(Outline { end: end as u32, ..outline });
        }
    }

    /// The new vertex on an edge, which is made once.
    fn on_edge(&mut self, one: u32, other: u32) -> u32 {
        let edge = if one < other { (one, other) } else { (other, one) };
        let first = self.next.vertices.len() - self.edges.len();
        if let Some(known) = self.edges.iter().position(|known| *known == edge) {
            return (first + known) as u32;
        }
        let [from, to] = [edge.0 as usize, edge.1 as usize];
        let part = self.heights[from] / (self.heights[from] - self.heights[to]);
        let [p, q] = [self.now.vertices[from], self.now.vertices[to]];
        self.next.vertices.push(p + (q - p) * part);
        self.edges.push(edge);
        self.after.push(NONE);
        (self.next.vertices.len() - 1) as u32
    }

    /// In the outline of the cut, `exit` follows `entry`.
    fn link(&mut self, entry: u32, exit: u32) {
        let first = self.next.vertices.len() - self.edges.len();
        self.after[entry as usize - first] = exit;
    }

    /// Adds the polygons of the cut. One of two corners has no area, and its two sides are one edge.
    fn close(&mut self, plane: &Plane) {
        let Self { next, after, .. } = self;
        let first = next.vertices.len() - after.len();
        for start in 0..after.len() {
            let begin = next.corners.len();
            let mut here = start;
            while after[here] != NONE {
                next.corners.push((first + here) as u32);
                here = std::mem::replace(&mut after[here], NONE) as usize - first;
            }
            let end = next.corners.len();
            if end - begin > 2 {
                next.faces.push(Outline { end: end as u32, plane: *plane, is_cut: true });
            } else {
                next.corners.truncate(begin);
            }
        }
    }

    /// Its vertices [m].
    pub fn vertices(&self) -> &[Vec3] {
        &self.now.vertices
    }

    /// Its faces: first those of the body, then the cuts in their order.
    pub fn faces(&self) -> impl Iterator<Item = Face<'_>> {
        let mut start = 0;
        self.now.faces.iter().map(move |&Outline { end, plane, is_cut }| {
            let corners = &self.now.corners[start..end as usize];
            start = end as usize;
            Face { corners, plane, is_cut }
        })
    }
}

/// The body inside planes, as far as it lies in the cube about the origin with this half edge [m]. `None` if
/// there is none.
pub fn inside(planes: &[Plane], half_edge: f64) -> Option<Facets> {
    let mut body = Clipped::default();
    body.begin(&cube(half_edge));
    planes.iter().all(|plane| body.cut(plane)).then(|| {
        let mut facets = Facets::without_faces(body.vertices());
        for face in body.faces() {
            facets.push(face.plane, face.corners);
        }
        facets
    })
}

/// A cube about the origin.
fn cube(half_edge: f64) -> Facets {
    let side = |bit: usize, k: usize| if k >> bit & 1 == 1 { half_edge } else { -half_edge };
    let vertices: Vec<Vec3> =
        (0..8).map(|k| Vec3::new(side(0, k), side(1, k), side(2, k))).collect();
    let mut cube = Facets::without_faces(&vertices);
    let polygons =
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    for (k, polygon) in polygons.iter().enumerate() {
        let sign = if k % 2 == 0 { -1.0 } else { 1.0 };
        cube.push(Plane { normal: Vec3::ith(k / 2, sign), offset: half_edge }, polygon);
    }
    cube
}
