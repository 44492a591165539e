//! Facets of a surface. Data that follow from the corners of triangles are not stored.

use super::{NONE, Rim, Strip};
use crate::math::Vec3;
use crate::shape::facets::Plane;
use serde::{Deserialize, Serialize};

/// A facet of a surface that particles can touch, in the axes of the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MeshFacet {
    /// Triangles in a plane.
    Face {
        /// Unit normal, on either side.
        normal: Vec3,
        /// Offset of the plane along the normal [m].
        offset: f64,
    },
    /// A straight edge.
    Edge {
        /// Begin of the edge [m].
        from: Vec3,
        /// Unit vector along the edge.
        along: Vec3,
        /// Length [m].
        length: f64,
        /// First direction in which it faces: the normal of a face.
        first: Vec3,
        /// Direction a quarter turn on from `first`.
        quarter: Vec3,
        /// Angle from the first direction to the last [rad].
        opening: f64,
    },
    /// A part of a cylinder or a cone.
    Strip(Strip),
    /// The end of such a part.
    Rim(Rim),
    /// A point.
    Corner {
        /// Position [m].
        at: Vec3,
    },
}

/// An edge with directions in which it faces. For a rim only the ends are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Edge {
    /// Vertices, the lower first.
    pub(super) ends: [u32; 2],
    /// 1 / length [1/m].
    pub(super) per_length: f64,
    /// First direction in which it faces.
    pub(super) first: Vec3,
    /// Angle from the first direction to the last [rad].
    pub(super) opening: f64,
}

/// Consecutive lists of numbers, with the begin of each.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Lists {
    numbers: Vec<u32>,
    first: Vec<u32>,
}

impl Default for Lists {
    fn default() -> Self {
        Self { numbers: Vec::new(), first: vec![0] }
    }
}

impl Lists {
    pub(super) fn push(&mut self, list: &[u32]) {
        self.numbers.extend(list);
        self.first.push(self.numbers.len() as u32);
    }

    pub(super) fn get(&self, k: usize) -> &[u32] {
        &self.numbers[self.first[k] as usize..self.first[k + 1] as usize]
    }

    pub(super) const fn len(&self) -> usize {
        self.first.len() - 1
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.numbers) + size_of_val(&*self.first)
    }
}

/// All facets: first faces or strips, then edges, then corners.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Facets {
    /// Planes of faces.
    pub(super) faces: Vec<Plane>,
    pub(super) strips: Vec<Strip>,
    /// Vertices of each face or strip, in rising order.
    of_face: Lists,
    edges: Vec<Edge>,
    /// Vertices of corners.
    corners: Vec<u32>,
    /// Vertices to which edges lead from each corner.
    beyond: Lists,
    /// Corner at each vertex, or [`NONE`].
    corner_of: Vec<u32>,
}

impl Facets {
    /// Adds a face with its vertices.
    pub(super) fn push_face(&mut self, plane: Plane, vertices: &[u32]) {
        self.faces.push(plane);
        self.of_face.push(vertices);
    }

    /// Adds a strip with its vertices.
    pub(super) fn push_strip(&mut self, strip: Strip, vertices: &[u32]) {
        self.strips.push(strip);
        self.of_face.push(vertices);
    }

    /// Adds an edge after all faces, and returns its number.
    pub(super) fn push_edge(&mut self, edge: Edge) -> u32 {
        self.edges.push(edge);
        (self.len() - 1) as u32
    }

    /// Removes all edges of a surface without corners.
    pub(super) fn leave_out_edges(&mut self) {
        self.edges.clear();
    }

    /// Adds a corner at a vertex after all edges.
    pub(super) fn push_corner(&mut self, vertex: u32, beyond: &[u32]) {
        let number = self.len() as u32;
        self.corners.push(vertex);
        self.beyond.push(beyond);
        let index = vertex as usize;
        self.corner_of.resize(self.corner_of.len().max(index + 1), NONE);
        self.corner_of[index] = number;
    }

    /// Corner at a vertex.
    pub(super) fn corner_of(&self, vertex: u32) -> Option<u32> {
        self.corner_of.get(vertex as usize).copied().filter(|&corner| corner != NONE)
    }

    /// Numbers of faces or strips, of edges and of corners.
    pub(super) const fn counts(&self) -> [usize; 3] {
        [self.of_face.len(), self.edges.len(), self.corners.len()]
    }

    pub(super) const fn len(&self) -> usize {
        let [faces, edges, corners] = self.counts();
        faces + edges + corners
    }

    /// Vertices of a facet.
    pub(super) fn vertices_of(&self, facet: u32) -> &[u32] {
        let [faces, edges, _] = self.counts();
        let facet = facet as usize;
        if facet < faces {
            self.of_face.get(facet)
        } else if facet < faces + edges {
            &self.edges[facet - faces].ends
        } else {
            std::slice::from_ref(&self.corners[facet - faces - edges])
        }
    }

    pub(super) const fn is_edge(&self, facet: u32) -> bool {
        let [faces, edges, _] = self.counts();
        faces <= facet as usize && (facet as usize) < faces + edges
    }

    /// The facet of a number.
    pub(super) fn get(&self, facet: u32, vertices: &[Vec3]) -> MeshFacet {
        let [faces, edges, _] = self.counts();
        let facet = facet as usize;
        if let Some(&Plane { normal, offset }) = self.faces.get(facet) {
            MeshFacet::Face { normal, offset }
        } else if let Some(strip) = self.strips.get(facet) {
            MeshFacet::Strip(*strip)
        } else if let Some(edge) = self.edges.get(facet - faces) {
            let Edge { ends, per_length, first, opening } = *edge;
            // The vertices of strips alternate between begin and end, and all rims of one end are consecutive.
            if let Some(&strip) = self.strips.get((facet - faces) % faces) {
                let [height, outwards] =
                    if ends[0] % 2 == 0 { [0.0, -1.0] } else { [strip.length, 1.0] };
                return MeshFacet::Rim(Rim { strip, height, outwards });
            }
            let [from, to] = ends.map(|k| vertices[k as usize]);
            let along = (to - from) * per_length;
            let length = (to - from).dot(&along);
            MeshFacet::Edge { from, along, length, first, quarter: along.cross(&first), opening }
        } else {
            MeshFacet::Corner { at: vertices[self.corners[facet - faces - edges] as usize] }
        }
    }

    /// Unit vectors along all edges from a corner.
    pub(super) fn edges_at(&self, corner: u32, vertices: &[Vec3]) -> impl Iterator<Item = Vec3> {
        let [faces, edges, _] = self.counts();
        let corner = corner as usize - faces - edges;
        let at = vertices[self.corners[corner] as usize];
        self.beyond.get(corner).iter().map(move |&k| (vertices[k as usize] - at).normalize())
    }

    /// Moves the origin of the axes to this place [m].
    pub(super) fn see_from(&mut self, place: &Vec3) {
        for Plane { normal, offset } in &mut self.faces {
            *offset -= normal.dot(place);
        }
        for strip in &mut self.strips {
            strip.from -= place;
        }
    }

    /// Memory that they hold [bytes].
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.faces)
            + size_of_val(&*self.strips)
            + self.of_face.bytes()
            + size_of_val(&*self.edges)
            + size_of_val(&*self.corners)
            + self.beyond.bytes()
            + size_of_val(&*self.corner_of)
    }
}
