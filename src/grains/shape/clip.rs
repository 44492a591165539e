//! Clipping of a convex polyhedron by planes, with exact topology and without tolerances.
//!
//! A vertex lies inside a plane or outside, never on it. An edge has two sides, one for each of its faces, in opposite directions. A side from
//! inside to outside is an exit, and its twin is an entry. The edge gets one new vertex, at which both its sides end and begin. In each face an
//! exit is linked with the next entry by a new side, whose twin is a side of the cut. Each new vertex belongs to one exit and one entry. The
//! sides of the cut are therefore a permutation of the new vertices, and its cycles are the polygons of the cut.
//!
//! The surface thus stays closed whatever the rounding of vertices and planes. This includes coplanar faces, shared edges and corners, and
//! outlines that cross a plane four times by rounding. (Compare Sutherland and Hodgman 1974, DOI 10.1145/360767.360802, who clip one polygon.)

use super::facets::{Edge, Facets, Plane};
use crate::math::Vec3;

/// A face of a cut polyhedron.
#[derive(Clone, Copy, Debug)]
pub struct Face<'a> {
    /// Indices of its vertices, counter-clockwise seen from outside; at least three.
    pub corners: &'a [u32],
    /// Its plane.
    pub plane: Plane,
    /// Whether it is a cut. Otherwise it is a face of the original body, or what is left of it.
    pub is_cut: bool,
}

/// A face, without its corners.
#[derive(Clone, Copy, Debug)]
struct Outline {
    /// End among the corners of all faces; it starts at the end of the previous one.
    end: u32,
    /// Index of its plane.
    plane: u32,
}

/// A convex polyhedron that is cut by one plane after the other. It keeps its memory from one polyhedron to the next.
///
/// A cut appends new elements and leaves the others in place, as most faces are cut by few planes.
#[derive(Clone, Debug, Default)]
pub struct Clipped {
    /// All vertices, also those that were cut off.
    vertices: Vec<Vec3>,
    /// Vertices that are left, in rising order.
    left: Vec<u32>,
    /// Height of vertices above the last plane [m].
    heights: Vec<f64>,
    /// All edges, also those that were cut off.
    edges: Vec<Edge>,
    /// Edges that are left, in rising order.
    edges_left: Vec<u32>,
    /// Sides from inside to outside.
    exits: Vec<u32>,
    /// Side of the cut that begins at each new vertex.
    of_cut: Vec<u32>,
    /// Planes of the body's faces, then those of the cuts.
    planes: Vec<Plane>,
    /// Number of planes of the body.
    of_body: usize,
    /// Corners of all faces, see [`Clipped::end`].
    corners: Vec<u32>,
    faces: Vec<Outline>,
}

/// Mark instead of the face of a side that is among the corners.
const DONE: u32 = u32::MAX;

impl Clipped {
    /// Starts with a body.
    pub fn begin(&mut self, body: &Facets) {
        self.clear();
        self.vertices.extend_from_slice(body.vertices());
        self.left.extend(0..body.vertices().len() as u32);
        self.edges.extend_from_slice(body.edges());
        self.edges_left.extend(0..body.edges().len() as u32);
        self.planes.extend_from_slice(body.planes());
        self.of_body = body.planes().len();
    }

    fn clear(&mut self) {
        self.vertices.clear();
        self.left.clear();
        self.edges.clear();
        self.edges_left.clear();
        self.planes.clear();
        self.corners.clear();
        self.faces.clear();
    }

    /// Keeps the part with `p · normal <= offset`. Returns whether anything is left.
    pub fn cut(&mut self, plane: &Plane) -> bool {
        if !self.measure(plane) {
            return !self.left.is_empty();
        }
        let heights = &self.heights;
        self.left.retain(|&vertex| heights[vertex as usize] <= 0.0);
        if self.left.is_empty() {
            self.clear();
            return false;
        }
        self.find_exits();
        let first = self.vertices.len() as u32;
        self.make_vertices();
        self.left.extend(first..self.vertices.len() as u32);
        self.link(first, plane);
        true
    }

    /// Computes the heights of the vertices above a plane. Returns whether any is positive.
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

    /// Keeps the edges with an end inside, and finds the exits.
    ///
    /// The loop has no branches, as they could not be predicted.
    fn find_exits(&mut self) {
        let Self { heights, edges, edges_left, exits, .. } = self;
        exits.resize(edges_left.len(), 0);
        let (mut left, mut out) = (0, 0);
        for k in 0..edges_left.len() {
            let edge = edges_left[k];
            let [from, to] = edges[edge as usize].from;
            let (one, other) = (heights[from as usize] <= 0.0, heights[to as usize] <= 0.0);
            edges_left[left] = edge;
            left += usize::from(one | other);
            exits[out] = 2 * edge + u32::from(other);
            out += usize::from(one != other);
        }
        edges_left.truncate(left);
        exits.truncate(out);
    }

    /// Makes a vertex on each edge that is cut, where its entry begins.
    fn make_vertices(&mut self) {
        let Self { vertices, heights, edges, exits, .. } = self;
        for &exit in exits.iter() {
            let (edge, side) = place(exit);
            let from = &mut edges[edge].from;
            let [inside, outside] = [from[side], from[1 - side]];
            from[1 - side] = vertices.len() as u32;
            let (below, above) = (heights[inside as usize], heights[outside as usize]);
            let (p, q) = (vertices[inside as usize], vertices[outside as usize]);
            vertices.push(p + (q - p) * (below / (below - above)));
        }
    }

    /// Links exits with entries, and makes the sides of the cut. New vertices start at `first`.
    fn link(&mut self, first: u32, plane: &Plane) {
        let Self { edges, exits, of_cut, planes, .. } = self;
        let cut = planes.len() as u32;
        planes.push(*plane);
        of_cut.resize(exits.len(), 0);
        let new = edges.len() as u32;
        for (number, &exit) in (0..).zip(exits.iter()) {
            let (edge, side) = place(exit);
            let mut next = edges[edge].next[side];
            let entry = loop {
                let (edge, side) = place(next);
                let from = edges[edge].from[side];
                if from >= first {
                    break from;
                }
                next = edges[edge].next[side];
            };
            let here = 2 * (new + number);
            edges[edge].next[side] = here;
            of_cut[(entry - first) as usize] = here + 1;
            let face = [edges[edge].face[side], cut];
            edges.push(Edge { from: [first + number, entry], next: [next, 0], face });
        }
        self.close(new);
    }

    /// Links the sides of the cut with each other. Edges of the cut start at `new`.
    fn close(&mut self, new: u32) {
        for number in 0..self.of_cut.len() as u32 {
            let next = self.of_cut[number as usize];
            self.edges[(new + number) as usize].next[1] = next;
            let after = next / 2 - new;
            let is_pair = self.of_cut[after as usize] / 2 - new == number;
            if !is_pair || number < after {
                self.edges_left.push(new + number);
            } else {
                self.join(new, [after, number]);
            }
        }
    }

    /// Merges the two sides beyond a cut polygon of two corners, which has no area, into one edge.
    fn join(&mut self, new: u32, [one, other]: [u32; 2]) {
        let Edge { from, next, face } = self.edges[(new + other) as usize];
        let joined = &mut self.edges[(new + one) as usize];
        (joined.from[1], joined.next[1], joined.face[1]) = (from[0], next[0], face[0]);
        let (edge, side) = place(self.exits[other as usize]);
        self.edges[edge].next[side] = 2 * (new + one) + 1;
    }

    /// Ends the cutting: finds the faces by their circuits.
    pub fn end(&mut self) {
        let Self { edges, edges_left, corners, faces, .. } = self;
        corners.clear();
        faces.clear();
        for &edge in edges_left.iter() {
            for side in 0..2 {
                let plane = edges[edge as usize].face[side];
                if plane == DONE {
                    continue;
                }
                let first = 2 * edge + side as u32;
                let mut here = first;
                loop {
                    let (edge, side) = place(here);
                    let edge = &mut edges[edge];
                    edge.face[side] = DONE;
                    corners.push(edge.from[side]);
                    here = edge.next[side];
                    if here == first {
                        break;
                    }
                }
                faces.push(Outline { end: corners.len() as u32, plane });
            }
        }
        edges_left.clear();
    }

    /// Drops the vertices that were cut off, after [`Clipped::end`].
    pub fn pack(&mut self) {
        let mut places = vec![0; self.vertices.len()];
        for (place, vertex) in (0..).zip(&mut self.left) {
            self.vertices[place as usize] = self.vertices[*vertex as usize];
            places[*vertex as usize] = place;
            *vertex = place;
        }
        self.vertices.truncate(self.left.len());
        for corner in &mut self.corners {
            *corner = places[*corner as usize];
        }
    }

    /// Indices of the vertices that are left, in the order of their creation.
    pub fn left(&self) -> &[u32] {
        &self.left
    }

    /// All vertices [m], also those that were cut off.
    pub fn vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// Faces, after [`Clipped::end`].
    pub fn faces(&self) -> impl Iterator<Item = Face<'_>> {
        let mut start = 0;
        self.faces.iter().map(move |&Outline { end, plane }| {
            let corners = &self.corners[start..end as usize];
            start = end as usize;
            let plane = plane as usize;
            Face { corners, plane: self.planes[plane], is_cut: plane >= self.of_body }
        })
    }
}

/// Edge of a side, and index of the side in it.
const fn place(side: u32) -> (usize, usize) {
    ((side / 2) as usize, (side % 2) as usize)
}

/// Body inside planes, within the cube about the origin with this half edge [m]; `None` if there is none.
pub fn inside(planes: &[Plane], half_edge: f64) -> Option<Facets> {
    let mut body = Clipped::default();
    body.begin(&cube(half_edge));
    planes.iter().all(|plane| body.cut(plane)).then(|| {
        body.end();
        body.pack();
        let mut facets = Facets::without_faces(body.vertices());
        for face in body.faces() {
            facets.push(face.plane, face.corners);
        }
        facets.closed()
    })
}

/// A cube about the origin.
pub(super) fn cube(half_edge: f64) -> Facets {
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
    cube.closed()
}
