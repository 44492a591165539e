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
    /// Where it starts and ends among the corners of all faces.
    start: u32,
    end: u32,
    plane: Plane,
    is_cut: bool,
}

/// A convex polyhedron that is cut by one plane after the other. It keeps its memory from one polyhedron to the next.
///
/// A cut appends what it makes and leaves the rest in its place: most faces are cut by few planes.
#[derive(Clone, Debug, Default)]
pub struct Clipped {
    /// All that were made.
    vertices: Vec<Vec3>,
    /// Those that are not cut off, in rising order.
    left: Vec<u32>,
    /// Vertices of faces, also of those that are no more.
    corners: Vec<u32>,
    faces: Vec<Outline>,
    /// How far vertices that were left lie outside the plane [m].
    heights: Vec<f64>,
    /// Edges that are cut, by the lower and the higher index of their ends.
    edges: Vec<(u32, u32)>,
    /// The new vertex that follows that of a cut edge in the outline of the cut.
    after: Vec<u32>,
    /// Room for [`Clipped::pack`].
    packed: (Vec<Vec3>, Vec<u32>),
    /// Where vertices go in it.
    places: Vec<u32>,
}

/// No vertex.
const NONE: u32 = u32::MAX;

impl Clipped {
    /// Begins with a body.
    pub fn begin(&mut self, body: &Facets) {
        self.clear();
        self.vertices.extend_from_slice(body.vertices());
        self.left.extend(0..body.vertices().len() as u32);
        self.corners.extend_from_slice(body.corners());
        let mut start = 0;
        self.faces.extend(body.ends().iter().zip(body.planes()).map(|(&end, &plane)| {
            let start = std::mem::replace(&mut start, end);
            Outline { start, end, plane, is_cut: false }
        }));
    }

    fn clear(&mut self) {
        self.vertices.clear();
        self.left.clear();
        self.corners.clear();
        self.faces.clear();
    }

    /// Leaves the part with `p · normal <= offset`. Is there any?
    pub fn cut(&mut self, plane: &Plane) -> bool {
        if !self.measure(plane) {
            return !self.faces.is_empty();
        }
        let heights = &self.heights;
        self.left.retain(|&vertex| heights[vertex as usize] <= 0.0);
        if self.left.is_empty() {
            self.clear();
            return false;
        }
        self.edges.clear();
        self.after.clear();
        let first = self.vertices.len() as u32;
        let mut kept = 0;
        for face in 0..self.faces.len() {
            let outline = self.faces[face];
            let corners = &self.corners[outline.start as usize..outline.end as usize];
            let inside = corners.iter().filter(|&&c| self.heights[c as usize] <= 0.0).count();
            if inside > 0 {
                let is_whole = inside == corners.len();
                self.faces[kept] = if is_whole { outline } else { self.cut_face(outline) };
                kept += 1;
            }
        }
        self.faces.truncate(kept);
        self.close(plane);
        self.left.extend(first..self.vertices.len() as u32);
        true
    }

    /// Finds how far the vertices lie outside a plane. Does any?
    fn measure(&mut self, plane: &Plane) -> bool {
        self.heights.resize(self.vertices.len(), 0.0);
        let mut all_inside = true;
        for &vertex in &self.left {
            let height = self.vertices[vertex as usize].dot(&plane.normal) - plane.offset;
            self.heights[vertex as usize] = height;
            all_inside &= height <= 0.0;
        }
        !all_inside
    }

    /// What is inside of a face.
    fn cut_face(&mut self, outline: Outline) -> Outline {
        let start = self.corners.len() as u32;
        let mut last = self.corners[outline.end as usize - 1];
        let mut was_inside = self.heights[last as usize] <= 0.0;
        let (mut exit, mut first_entry) = (NONE, NONE);
        for k in outline.start..outline.end {
            let here = self.corners[k as usize];
            let inside = self.heights[here as usize] <= 0.0;
            if inside != was_inside {
                let vertex = self.on_edge(last, here);
                self.corners.push(vertex);
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
                self.corners.push(here);
            }
            (last, was_inside) = (here, inside);
        }
        if first_entry != NONE {
            self.link(first_entry, exit);
        }
        Outline { start, end: self.corners.len() as u32, ..outline }
    }

    /// The new vertex on an edge, which is made once.
    fn on_edge(&mut self, one: u32, other: u32) -> u32 {
        let edge = if one < other { (one, other) } else { (other, one) };
        let first = self.vertices.len() - self.edges.len();
        if let Some(known) = self.edges.iter().position(|known| *known == edge) {
            return (first + known) as u32;
        }
        let [from, to] = [edge.0 as usize, edge.1 as usize];
        let part = self.heights[from] / (self.heights[from] - self.heights[to]);
        let [p, q] = [self.vertices[from], self.vertices[to]];
        self.vertices.push(p + (q - p) * part);
        self.edges.push(edge);
        self.after.push(NONE);
        (self.vertices.len() - 1) as u32
    }

    /// In the outline of the cut, `exit` follows `entry`.
    fn link(&mut self, entry: u32, exit: u32) {
        let first = self.vertices.len() - self.edges.len();
        self.after[entry as usize - first] = exit;
    }

    /// Adds the polygons of the cut. One of two corners has no area, and its two sides are one edge.
    fn close(&mut self, plane: &Plane) {
        let Self { vertices, corners, faces, after, .. } = self;
        let first = vertices.len() - after.len();
        for begin in 0..after.len() {
            let start = corners.len();
            let mut here = begin;
            while after[here] != NONE {
                corners.push((first + here) as u32);
                here = std::mem::replace(&mut after[here], NONE) as usize - first;
            }
            let end = corners.len();
            if end - start > 2 {
                let (start, end) = (start as u32, end as u32);
                faces.push(Outline { start, end, plane: *plane, is_cut: true });
            } else {
                corners.truncate(start);
            }
        }
    }

    /// Forgets what was cut off: from now on there are no other vertices than those that are left.
    pub fn pack(&mut self) {
        let Self { vertices, left, corners, faces, packed, places, .. } = self;
        let (packed_vertices, packed_corners) = packed;
        packed_vertices.clear();
        packed_corners.clear();
        places.resize(vertices.len(), NONE);
        for vertex in left.iter_mut() {
            let place = packed_vertices.len() as u32;
            places[*vertex as usize] = place;
            packed_vertices.push(vertices[*vertex as usize]);
            *vertex = place;
        }
        for face in faces {
            let start = packed_corners.len() as u32;
            let range = face.start as usize..face.end as usize;
            packed_corners.extend(corners[range].iter().map(|&corner| places[corner as usize]));
            (face.start, face.end) = (start, packed_corners.len() as u32);
        }
        std::mem::swap(vertices, packed_vertices);
        std::mem::swap(corners, packed_corners);
    }

    /// The vertices that are left [m], in the order of their making.
    pub fn left(&self) -> impl ExactSizeIterator<Item = &Vec3> + Clone {
        self.left.iter().map(|&vertex| &self.vertices[vertex as usize])
    }

    /// All vertices that were made since it was packed [m]: the corners of faces are indices of these.
    pub fn vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// Its faces: first those of the body, then the cuts in their order.
    pub fn faces(&self) -> impl Iterator<Item = Face<'_>> {
        self.faces.iter().map(|&Outline { start, end, plane, is_cut }| {
            let corners = &self.corners[start as usize..end as usize];
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
        body.pack();
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
