//! The surface of a wall, from triangles.
//!
//! What a grain can touch are its *facets*, each once however the surface is cut into triangles:
//!
//! | facet | what it is | directions in which it faces |
//! |---|---|---|
//! | face | coplanar triangles that hang together | both normals |
//! | edge | a side of triangles that are not coplanar, or of one only | those between the normals of its faces, on the convex side |
//! | corner | where edges meet | those at right angles or more to all edges from it |
//!
//! These directions are the Voronoi regions of the surface: a contact whose normal lies in none belongs to another facet. An edge
//! that is concave on a side faces nowhere there. Whether triangles agree on what is in front does not matter.
//!
//! A cylinder or a cone has *strips* and no other facets. Each lies between two straight lines of the surface, and faces in all
//! directions between the normals there. Strips are exact: their triangles only say where to look, and are what pictures have.
//!
//! Grains with faces ask for what lies behind the triangles ([`TriangleMesh::with_cells`]) and have no contacts with edges and corners.
//!
//! Facets are numbered: first faces, then edges, then corners. They are found through a grid of cells in the axes of the wall.

mod solid;

pub use solid::{Front, Near, NoSolid};

use super::Convex;
use crate::math::Vec3;
use serde::{Deserialize, Serialize};
use solid::Solid;

/// Points this near to a plane, over the size of the surface, lie in it.
const COPLANAR: f64 = 1e-11;
/// A triangle is degenerate if it is flatter than this.
const SLIVER: f64 = 1e-9;
/// An edge that faces less than this faces nowhere [rad].
const LEAST_OPENING: f64 = 1e-10;
/// What is found twice on a border is one contact, whatever the user says [rad].
const LEAST_SMOOTH: f64 = 1e-6;
/// Parts of a cylinder or a cone.
const STRIPS: u32 = 64;
/// No facet.
const NONE: u32 = u32::MAX;

/// What a grain can touch, in the axes of the wall.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum MeshFacet {
    /// Triangles in a plane.
    Face {
        /// Unit normal; which of the two means nothing.
        normal: Vec3,
        /// Of the plane along the normal [m].
        offset: f64,
    },
    /// A straight edge.
    Edge {
        /// Where it begins [m].
        from: Vec3,
        /// Unit vector along it.
        along: Vec3,
        /// Its length [m].
        length: f64,
        /// The first direction in which it faces: the normal of a face.
        first: Vec3,
        /// The direction a quarter turn on from that.
        quarter: Vec3,
        /// Angle from the first to the last [rad].
        opening: f64,
    },
    /// A part of a cylinder or a cone.
    Strip(Strip),
    /// A point.
    Corner {
        /// Where it is [m].
        at: Vec3,
        /// Unit vectors along all edges from it.
        edges: Vec<Vec3>,
    },
}

/// A part of a cylinder or a cone, between two straight lines on it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strip {
    /// Where its axis begins [m].
    pub from: Vec3,
    /// Unit vector along the axis.
    pub axis: Vec3,
    /// Length of the axis [m].
    pub length: f64,
    /// Radius where the axis begins [m].
    pub radius: f64,
    /// How much the radius grows along the axis [-].
    pub slope: f64,
    /// Unit vector across the axis, towards the first line.
    pub first: Vec3,
    /// The direction a quarter turn on from that.
    pub quarter: Vec3,
    /// Angle from the first line to the last [rad].
    pub opening: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Triangle {
    corners: [u32; 3],
    /// Its face, its edges (from the corner of that number to the next) and its corners, or [`NONE`].
    facets: [u32; 7],
}

/// What was found of the triangles of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Findings {
    /// Triangles of a file that have no area, or stand there twice; they are left out.
    pub left_out: usize,
    /// Edges of one triangle only: where the surface ends, or has a hole.
    pub open_edges: usize,
    /// Edges of three triangles or more.
    pub crowded_edges: usize,
    /// Edges whose two triangles do not agree on what is in front.
    pub turned_edges: usize,
}

/// Why triangles are no surface.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum SurfaceError {
    /// All are degenerate.
    #[error("the mesh has no triangle with an area")]
    Empty,
    /// Not a number.
    #[error("triangle {0} (from 0) has a coordinate that is not a number")]
    NotFinite(usize),
    /// A corner on an edge.
    #[error(
        "the corner ({:e}, {:e}, {:e}) m lies within an edge of another triangle, from ({:e}, {:e}, {:e}) to ({:e}, {:e}, {:e}) m: \
         a grain would touch both. Triangles must share whole edges; split that triangle there",
        .corner.x, .corner.y, .corner.z, .from.x, .from.y, .from.z, .to.x, .to.y, .to.z
    )]
    CornerOnEdge {
        /// The corner [m].
        corner: Vec3,
        /// Where the edge begins [m].
        from: Vec3,
        /// Where it ends [m].
        to: Vec3,
    },
}

/// The surface of a wall, in its axes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TriangleMesh {
    vertices: Vec<Vec3>,
    /// First its own, then images of them.
    triangles: Vec<Triangle>,
    own: usize,
    facets: Vec<MeshFacet>,
    /// Vertices of each facet by number, and where those of each begin.
    vertices_of: Vec<u32>,
    first_vertex: Vec<u32>,
    grid: Grid,
    /// What is behind the triangles, if grains with faces are there.
    solid: Option<Solid>,
    /// How far its facets are from its triangles at most [m].
    bulge: f64,
    /// Of two touching facets with normals this near, as a cosine, only one counts.
    smooth: f64,
    reach: f64,
    findings: Findings,
    checksum: u64,
}

/// A surface that wall and library have in common, on its way to another rank.
pub mod shared {
    use super::TriangleMesh;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use std::sync::Arc;

    pub(crate) fn serialize<S: Serializer>(
        surface: &Arc<TriangleMesh>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        surface.as_ref().serialize(serializer)
    }

    pub(crate) fn deserialize<'a, D: Deserializer<'a>>(
        deserializer: D,
    ) -> Result<Arc<TriangleMesh>, D::Error> {
        TriangleMesh::deserialize(deserializer).map(Arc::new)
    }
}

impl TriangleMesh {
    /// From corners [m] in the axes of the wall. Contacts of one grain with facets that have a corner in common, and whose normals
    /// differ by less than `smooth` [rad], count once.
    ///
    /// # Errors
    /// If they are no surface.
    pub fn new(corners: &[[Vec3; 3]], smooth: f64) -> Result<Self, SurfaceError> {
        Self::with_images(corners, corners.len(), smooth)
    }

    /// The same of triangles of which only the first `own` are its own. The others are images beyond the periods of a domain, which pictures
    /// and counts leave out.
    ///
    /// # Errors
    /// If they are no surface.
    pub fn with_images(
        corners: &[[Vec3; 3]],
        own: usize,
        smooth: f64,
    ) -> Result<Self, SurfaceError> {
        if let Some(k) =
            corners.iter().position(|t| !t.iter().all(|c| c.iter().all(|x| x.is_finite())))
        {
            return Err(SurfaceError::NotFinite(k));
        }
        let mut findings = Findings::default();
        let (vertices, triangles, own) = welded(corners, own, &mut findings);
        if own == 0 {
            return Err(SurfaceError::Empty);
        }
        let mut building = Building::of(vertices, triangles, own);
        building.find_sides(&mut findings);
        building.find_faces();
        building.find_edges();
        building.find_corners();
        let Building { vertices, corners, of_triangle, facets, vertices_of, sides, .. } = building;
        let triangles: Vec<_> = corners
            .iter()
            .zip(of_triangle)
            .map(|(&corners, facets)| Triangle { corners, facets })
            .collect();
        let grid = Grid::of(&vertices, &corners);
        let reach = vertices.iter().map(Vec3::norm).fold(0.0, f64::max);
        let checksum = checksum(&vertices, &corners);
        let mut first_vertex = vec![0];
        first_vertex.extend(vertices_of.iter().scan(0, |end, of| {
            *end += of.len() as u32;
            Some(*end)
        }));
        let vertices_of = vertices_of.concat();
        let mesh = Self {
            vertices,
            triangles,
            own,
            facets,
            vertices_of,
            first_vertex,
            grid,
            solid: None,
            bulge: 0.0,
            smooth: libm::cos(smooth.max(LEAST_SMOOTH)),
            reach,
            findings,
            checksum,
        };
        mesh.check_edges(&sides)?;
        Ok(mesh)
    }

    /// The cylinder or cone about an axis between two points, with these radii there, of which one may be 0 [m].
    pub fn of_revolution(from: &Vec3, to: &Vec3, [begin, end]: [f64; 2]) -> Self {
        let length = (to - from).norm();
        let axis = (to - from) / length;
        let across = Vec3::ith(axis.iamin(), 1.0).cross(&axis).normalize();
        let third = axis.cross(&across);
        let turn = std::f64::consts::TAU / f64::from(STRIPS);
        let lines = (0..STRIPS).map(|k| {
            let (sine, cosine) = libm::sincos(turn * f64::from(k));
            (across * cosine + third * sine, third * cosine - across * sine)
        });
        let (mut vertices, mut corners) = (Vec::new(), Vec::new());
        let (mut facets, mut triangles) = (Vec::new(), Vec::new());
        let (mut vertices_of, mut first_vertex) = (Vec::new(), vec![0]);
        for ((first, quarter), k) in lines.zip(0..) {
            vertices.extend([from + first * begin, to + first * end]);
            let next = (k + 1) % STRIPS;
            let ends = [2 * k, 2 * k + 1, 2 * next, 2 * next + 1];
            let [a, b, c, d] = ends;
            // One of them has no area where the cone comes to its tip.
            let pair = [(end > 0.0, [a, b, d]), (begin > 0.0, [a, d, c])];
            for (_, corners_of) in pair.into_iter().filter(|(is_there, _)| *is_there) {
                corners.push(corners_of);
                triangles.push(Triangle {
                    corners: corners_of,
                    facets: [k, NONE, NONE, NONE, NONE, NONE, NONE],
                });
            }
            let mut ends = ends;
            ends.sort_unstable();
            vertices_of.extend(ends);
            first_vertex.push(vertices_of.len() as u32);
            facets.push(MeshFacet::Strip(Strip {
                from: *from,
                axis,
                length,
                radius: begin,
                slope: (end - begin) / length,
                first,
                quarter,
                opening: turn,
            }));
        }
        let grid = Grid::of(&vertices, &corners);
        let reach = vertices.iter().map(Vec3::norm).fold(0.0, f64::max);
        let bulge = 1.01 * begin.max(end) * (1.0 - libm::cos(0.5 * turn));
        let checksum = checksum(&vertices, &corners);
        Self {
            vertices,
            own: triangles.len(),
            triangles,
            facets,
            vertices_of,
            first_vertex,
            grid,
            solid: None,
            bulge,
            smooth: libm::cos(LEAST_SMOOTH),
            reach: reach + bulge,
            findings: Findings::default(),
            checksum,
        }
    }

    /// A cylinder that goes on beyond both of its ends by so much [m], of which pictures show nothing.
    #[must_use]
    pub fn going_on(mut self, beyond: f64) -> Self {
        for facet in &mut self.facets {
            if let MeshFacet::Strip(Strip { from, axis, length, .. }) = facet {
                *from -= *axis * beyond;
                *length += 2.0 * beyond;
            }
        }
        self
    }

    /// What was found of the triangles.
    pub const fn findings(&self) -> Findings {
        self.findings
    }

    /// Triangles, facets, what is to be known of them, and memory, in a line.
    pub fn summary(&self) -> String {
        if let Some(MeshFacet::Strip(strip)) = self.facets.first() {
            let Strip { radius, slope, length, .. } = strip;
            let what = if *slope == 0.0 { "cylinder" } else { "cone" };
            let end = radius + slope * length;
            return format!(
                "a {what}, radius {radius:.3e} to {end:.3e} m, length {length:.3e} m, exact; {} triangles in pictures",
                self.len()
            );
        }
        let count = |is: fn(&MeshFacet) -> bool| self.facets.iter().filter(|f| is(f)).count();
        let faces = count(|facet| matches!(facet, MeshFacet::Face { .. }));
        let edges = count(|facet| matches!(facet, MeshFacet::Edge { .. }));
        let mut text = format!(
            "{} with {faces} faces, {edges} edges and {} corners that grains can touch; {} bytes of each on every rank",
            self.len(),
            self.facets.len() - faces - edges,
            self.bytes() / self.len()
        );
        let Findings { left_out, open_edges, crowded_edges, turned_edges } = self.findings;
        let images = self.triangles.len() - self.own;
        for (count, what) in [
            (images, "images of them beyond the periods"),
            (open_edges, "edges of one triangle only, where the surface ends or has a hole"),
            (crowded_edges, "edges of three triangles or more"),
            (
                turned_edges,
                "edges whose triangles do not agree on what is in front, which changes nothing",
            ),
            (left_out, "triangles left out that have no area or are there twice"),
        ] {
            if count > 0 {
                text.extend(["; ", &count.to_string(), " ", what]);
            }
        }
        text
    }

    /// How many triangles it has, without images.
    pub const fn len(&self) -> usize {
        self.own
    }

    /// Are there none?
    pub const fn is_empty(&self) -> bool {
        self.own == 0
    }

    /// What a grain can touch.
    pub fn facets(&self) -> &[MeshFacet] {
        &self.facets
    }

    /// Its triangles, without images [m].
    pub fn triangles(&self) -> impl Iterator<Item = [Vec3; 3]> {
        self.triangles[..self.own].iter().map(|t| self.corners(t))
    }

    /// Does it bring images along, so that a grain comes from one to the other when it goes through a period? Then no distance from it says
    /// how far the grain may go.
    pub const fn has_images(&self) -> bool {
        self.own < self.triangles.len()
    }

    /// Distance of the farthest corner from the reference point [m].
    pub const fn reach(&self) -> f64 {
        self.reach
    }

    /// The same for the same triangles only, as good as.
    pub const fn checksum(&self) -> u64 {
        self.checksum
    }

    /// Bytes that it holds.
    pub fn bytes(&self) -> usize {
        let edges = |facet: &MeshFacet| match facet {
            MeshFacet::Corner { edges, .. } => size_of_val(&**edges),
            _ => 0,
        };
        size_of_val(&*self.vertices)
            + size_of_val(&*self.triangles)
            + size_of_val(&*self.facets)
            + self.facets.iter().map(edges).sum::<usize>()
            + size_of_val(&*self.vertices_of)
            + size_of_val(&*self.first_vertex)
            + size_of_val(&*self.grid.first)
            + size_of_val(&*self.grid.triangles)
    }

    /// Have two facets a corner in common?
    pub fn adjoin(&self, one: u32, other: u32) -> bool {
        let of = |facet: u32| {
            let facet = facet as usize;
            &self.vertices_of
                [self.first_vertex[facet] as usize..self.first_vertex[facet + 1] as usize]
        };
        let (one, other) = (of(one), of(other));
        let (few, many) = if one.len() < other.len() { (one, other) } else { (other, one) };
        few.iter().any(|vertex| many.binary_search(vertex).is_ok())
    }

    /// Are contacts with these unit normals, on facets that adjoin, one?
    pub fn are_one(&self, one: &Vec3, other: &Vec3) -> bool {
        one.dot(other) > self.smooth
    }

    fn corners(&self, triangle: &Triangle) -> [Vec3; 3] {
        triangle.corners.map(|k| self.vertices[k as usize])
    }

    /// The numbers of all facets within a distance of a point [m], in rising order.
    pub fn near(&self, point: &Vec3, distance: f64) -> Vec<u32> {
        let distance = distance + self.bulge;
        let square = distance * distance;
        let mut near = Vec::new();
        let reach = Vec3::repeat(distance);
        self.grid.for_each_in(&(point - reach), &(point + reach), |triangle| {
            let triangle = &self.triangles[triangle as usize];
            let corners = self.corners(triangle);
            if (nearest_on(&corners, point) - point).norm_squared() >= square {
                return;
            }
            let [face, edges @ .., _, _, _] = triangle.facets;
            near.push(face);
            for (k, &edge) in edges.iter().enumerate().filter(|&(_, &edge)| edge != NONE) {
                let nearest = nearest_on_segment(&corners[k], &corners[(k + 1) % 3], point);
                if (nearest - point).norm_squared() < square {
                    near.push(edge);
                }
            }
            for (k, &corner) in triangle.facets[4..].iter().enumerate() {
                if corner != NONE && (corners[k] - point).norm_squared() < square {
                    near.push(corner);
                }
            }
        });
        near.sort_unstable();
        near.dedup();
        near
    }

    /// Is a point of a face's plane in one of its triangles, or nearer to one than `tolerance` [m]?
    pub fn is_on_face(&self, face: u32, point: &Vec3, tolerance: f64) -> bool {
        let mut found = false;
        let reach = Vec3::repeat(tolerance);
        self.grid.for_each_in(&(point - reach), &(point + reach), |triangle| {
            let triangle = &self.triangles[triangle as usize];
            if !found && triangle.facets[0] == face {
                found = is_over(&self.corners(triangle), point, tolerance);
            }
        });
        found
    }

    /// Does no triangle but those of a face stand between two points, the second of which is on the face? What comes within
    /// `tolerance` [m] of the second does not.
    pub fn is_seen(&self, face: u32, from: &Vec3, to: &Vec3, tolerance: f64) -> bool {
        let mut seen = true;
        self.grid.for_each_in(&from.inf(to), &from.sup(to), |triangle| {
            let triangle = &self.triangles[triangle as usize];
            if !seen || triangle.facets[0] == face {
                return;
            }
            let corners = self.corners(triangle);
            let [a, b, c] = &corners;
            let normal = (b - a).cross(&(c - a)).normalize();
            let (start, end) = ((from - a).dot(&normal), (to - a).dot(&normal));
            if start * end < 0.0 && end.abs() > tolerance {
                let crossing = from + (to - from) * (start / (start - end));
                seen = !is_over(&corners, &crossing, 0.0);
            }
        });
        seen
    }

    /// Does a box from `low` to `high` [m], in the axes of the wall, hold a part of a triangle?
    pub fn comes_into(&self, low: &Vec3, high: &Vec3) -> bool {
        let mut found = false;
        self.grid.for_each_in(low, high, |triangle| {
            let corners = self.corners(&self.triangles[triangle as usize]);
            found = found || comes_into(&corners, &((low + high) * 0.5), &((high - low) * 0.5));
        });
        found
    }

    /// Looks for corners within open edges.
    fn check_edges(&self, sides: &[Side]) -> Result<(), SurfaceError> {
        let open = sides.chunk_by(Side::is_same).filter(|of| of.len() == 1).flatten();
        let ends: Vec<u32> = open.flat_map(|side| side.ends).collect();
        let size = self.reach;
        for &end in &ends {
            let corner = self.vertices[end as usize];
            let mut found = None;
            let near = Vec3::repeat(COPLANAR * size);
            self.grid.for_each_in(&(corner - near), &(corner + near), |triangle| {
                let triangle = &self.triangles[triangle as usize];
                for k in 0..3 {
                    let ends = [triangle.corners[k], triangle.corners[(k + 1) % 3]];
                    let [from, to] = ends.map(|k| self.vertices[k as usize]);
                    let nearest = nearest_on_segment(&from, &to, &corner);
                    if !ends.contains(&end) && (nearest - corner).norm() < COPLANAR * size {
                        found = Some(SurfaceError::CornerOnEdge { corner, from, to });
                    }
                }
            });
            if let Some(error) = found {
                return Err(error);
            }
        }
        Ok(())
    }
}

/// It has no volume and no support point, and is never asked for them.
impl Convex for TriangleMesh {
    fn support(&self, _: &Vec3) -> Vec3 {
        Vec3::repeat(f64::NAN)
    }

    fn bounding_radius(&self) -> f64 {
        f64::INFINITY
    }

    fn inscribed_radius(&self) -> f64 {
        f64::INFINITY
    }

    fn volume(&self) -> f64 {
        f64::INFINITY
    }

    fn gyration(&self) -> Vec3 {
        Vec3::repeat(f64::INFINITY)
    }

    fn half_lengths(&self) -> Vec3 {
        Vec3::repeat(f64::INFINITY)
    }

    fn contains(&self, _: &Vec3) -> bool {
        false
    }

    fn smallest_curvature_radius(&self) -> f64 {
        f64::INFINITY
    }
}

/// A side of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    /// Vertices, the lower first.
    ends: [u32; 2],
    triangle: u32,
    /// Which of its sides.
    number: u32,
    /// Does the triangle have the lower vertex first?
    rises: bool,
}

impl Side {
    fn is_same(&self, other: &Self) -> bool {
        self.ends == other.ends
    }
}

/// A surface in the making.
struct Building {
    vertices: Vec<Vec3>,
    corners: Vec<[u32; 3]>,
    /// Sorted: sides with the same ends stand together.
    sides: Vec<Side>,
    of_triangle: Vec<[u32; 7]>,
    facets: Vec<MeshFacet>,
    vertices_of: Vec<Vec<u32>>,
    size: f64,
    /// How many triangles are no images.
    own: usize,
}

impl Building {
    fn of(vertices: Vec<Vec3>, corners: Vec<[u32; 3]>, own: usize) -> Self {
        let (low, high) = bounds(&vertices);
        let of_triangle = vec![[NONE; 7]; corners.len()];
        let size = (high - low).norm();
        let (sides, facets, vertices_of) = (Vec::new(), Vec::new(), Vec::new());
        Self { vertices, corners, sides, of_triangle, facets, vertices_of, size, own }
    }

    fn vertex(&self, k: u32) -> Vec3 {
        self.vertices[k as usize]
    }

    /// Twice the area, along the normal.
    fn area(&self, triangle: usize) -> Vec3 {
        let [a, b, c] = self.corners[triangle].map(|k| self.vertex(k));
        (b - a).cross(&(c - a))
    }

    fn push(&mut self, facet: MeshFacet, mut vertices: Vec<u32>) -> u32 {
        vertices.sort_unstable();
        vertices.dedup();
        self.facets.push(facet);
        self.vertices_of.push(vertices);
        (self.facets.len() - 1) as u32
    }

    fn find_sides(&mut self, findings: &mut Findings) {
        for (corners, triangle) in self.corners.iter().zip(0..) {
            for number in 0..3 {
                let (from, to) = (corners[number], corners[(number + 1) % 3]);
                let ends = [from.min(to), from.max(to)];
                self.sides.push(Side { ends, triangle, number: number as u32, rises: from < to });
            }
        }
        self.sides.sort_unstable();
        let is_own = |of: &&[Side]| of.iter().any(|side| (side.triangle as usize) < self.own);
        for of in self.sides.chunk_by(Side::is_same).filter(is_own) {
            match of {
                [_] => findings.open_edges += 1,
                [one, other] => findings.turned_edges += usize::from(one.rises == other.rises),
                _ => findings.crowded_edges += 1,
            }
        }
    }

    /// From large triangles to their neighbours in the same plane.
    fn find_faces(&mut self) {
        let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); self.corners.len()];
        for of in self.sides.chunk_by(Side::is_same) {
            for one in of {
                let others = of.iter().filter(|other| other.triangle != one.triangle);
                neighbours[one.triangle as usize].extend(others.map(|other| other.triangle));
            }
        }
        let mut order: Vec<usize> = (0..self.corners.len()).collect();
        let areas: Vec<f64> = order.iter().map(|&k| self.area(k).norm_squared()).collect();
        order.sort_by(|&a, &b| areas[b].total_cmp(&areas[a]));
        for seed in order {
            if self.of_triangle[seed][0] != NONE {
                continue;
            }
            let face = self.facets.len() as u32;
            let normal = self.area(seed).normalize();
            let offset = self.vertex(self.corners[seed][0]).dot(&normal);
            let (mut area, mut vertices, mut next) = (Vec3::zeros(), Vec::new(), vec![seed as u32]);
            self.of_triangle[seed][0] = face;
            while let Some(triangle) = next.pop() {
                let own = self.area(triangle as usize);
                area += own * own.dot(&normal).signum();
                vertices.extend(self.corners[triangle as usize]);
                for &neighbour in &neighbours[triangle as usize] {
                    let corners = self.corners[neighbour as usize].map(|k| self.vertex(k));
                    let off = |corner: &Vec3| (corner.dot(&normal) - offset).abs();
                    let of = &mut self.of_triangle[neighbour as usize][0];
                    if *of == NONE && corners.iter().all(|c| off(c) <= COPLANAR * self.size) {
                        *of = face;
                        next.push(neighbour);
                    }
                }
            }
            // Of all its triangles: exact where one of them is narrow.
            let normal = snapped(&area);
            vertices.sort_unstable();
            vertices.dedup();
            let heights = vertices.iter().map(|&k| self.vertex(k).dot(&normal));
            let (low, high) =
                heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            self.push(MeshFacet::Face { normal, offset: 0.5 * (low + high) }, vertices);
        }
    }

    fn find_edges(&mut self) {
        let sides = std::mem::take(&mut self.sides);
        for of in sides.chunk_by(Side::is_same) {
            let ends = of[0].ends;
            let [from, to] = ends.map(|k| self.vertex(k));
            let length = (to - from).norm();
            let along = (to - from) / length;
            let Some((first, quarter, opening)) = self.directions(of, &from, &along) else {
                continue;
            };
            let edge = MeshFacet::Edge { from, along, length, first, quarter, opening };
            let number = self.push(edge, ends.to_vec());
            for side in of {
                self.of_triangle[side.triangle as usize][1 + side.number as usize] = number;
            }
        }
        self.sides = sides;
    }

    /// Where an edge faces: between the two of its triangles that have the largest angle between them. The first direction, that
    /// a quarter turn on, and the angle to the last.
    fn directions(&self, of: &[Side], from: &Vec3, along: &Vec3) -> Option<(Vec3, Vec3, f64)> {
        let mut faces: Vec<u32> =
            of.iter().map(|side| self.of_triangle[side.triangle as usize][0]).collect();
        faces.dedup();
        if of.len() == 2 && faces.len() == 1 && !self.is_folded(of) {
            return None;
        }
        // From the edge into each triangle.
        let into = |side: &Side| {
            let corner = self.corners[side.triangle as usize][(side.number as usize + 2) % 3];
            let MeshFacet::Face { normal, .. } =
                &self.facets[self.of_triangle[side.triangle as usize][0] as usize]
            else {
                unreachable!("a triangle has a face")
            };
            let across = normal.cross(along).normalize();
            across * (self.vertex(corner) - from).dot(&across).signum()
        };
        let into: Vec<Vec3> = of.iter().map(into).collect();
        let (x, y) = (into[0], along.cross(&into[0]));
        let turn = std::f64::consts::TAU;
        let mut angles: Vec<(f64, Vec3)> =
            into.iter().map(|d| (libm::atan2(d.dot(&y), d.dot(&x)).rem_euclid(turn), *d)).collect();
        angles.sort_by(|a, b| a.0.total_cmp(&b.0));
        let gap = |k: usize| {
            let next = angles.get(k + 1).map_or(angles[0].0 + turn, |next| next.0);
            next - angles[k].0
        };
        let widest = (0..angles.len()).max_by(|&a, &b| gap(a).total_cmp(&gap(b)))?;
        let opening = gap(widest) - std::f64::consts::PI;
        let inwards = angles[widest].1;
        (opening > LEAST_OPENING).then(|| (along.cross(&inwards), -inwards, opening))
    }

    /// Do two triangles in a plane lie on each other?
    fn is_folded(&self, of: &[Side]) -> bool {
        let [one, other] = [of[0], of[1]].map(|side| {
            let corner = self.corners[side.triangle as usize][(side.number as usize + 2) % 3];
            let [from, to] = side.ends.map(|k| self.vertex(k));
            (to - from).cross(&(self.vertex(corner) - from))
        });
        one.dot(&other) > 0.0
    }

    /// Where edges that face somewhere end.
    fn find_corners(&mut self) {
        let mut has_edge = vec![false; self.vertices.len()];
        for facet in self.of_triangle.iter().flat_map(|of| &of[1..4]).filter(|&&e| e != NONE) {
            for &vertex in &self.vertices_of[*facet as usize] {
                has_edge[vertex as usize] = true;
            }
        }
        let mut edges: Vec<Vec<Vec3>> = vec![Vec::new(); self.vertices.len()];
        for of in self.sides.chunk_by(Side::is_same) {
            let [from, to] = of[0].ends;
            let along = (self.vertex(to) - self.vertex(from)).normalize();
            edges[from as usize].push(along);
            edges[to as usize].push(-along);
        }
        let mut number = vec![NONE; self.vertices.len()];
        for triangle in 0..self.corners.len() {
            for k in 0..3 {
                let vertex = self.corners[triangle][k];
                let index = vertex as usize;
                if !has_edge[index] {
                    continue;
                }
                if number[index] == NONE {
                    let edges = std::mem::take(&mut edges[index]);
                    let corner = MeshFacet::Corner { at: self.vertex(vertex), edges };
                    number[index] = self.push(corner, vec![vertex]);
                }
                self.of_triangle[triangle][4 + k] = number[index];
            }
        }
    }
}

/// A unit vector; along an axis, if it is by rounding.
fn snapped(vector: &Vec3) -> Vec3 {
    let unit = vector.normalize();
    let main = unit.iamax();
    let mut axis = Vec3::zeros();
    axis[main] = unit[main].signum();
    if (unit - axis).amax() < 1e-15 { axis } else { unit }
}

/// Vertices that are the same to the last bit are one; triangles without area, or twice there, are left out.
fn welded(
    corners: &[[Vec3; 3]],
    own: usize,
    findings: &mut Findings,
) -> (Vec<Vec3>, Vec<[u32; 3]>, usize) {
    let points: Vec<Vec3> = corners.iter().flatten().map(|c| c.map(|x| x + 0.0)).collect();
    let compare = |a: &Vec3, b: &Vec3| {
        a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
    };
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| compare(&points[a], &points[b]));
    let (mut vertices, mut number) = (Vec::new(), vec![0; points.len()]);
    for k in order {
        if vertices.last() != Some(&points[k]) {
            vertices.push(points[k]);
        }
        number[k] = (vertices.len() - 1) as u32;
    }
    let (numbers, _) = number.as_chunks::<3>();
    let mut seen = std::collections::BTreeSet::new();
    let mut is_sound = |triangle: &&[u32; 3]| {
        let [a, b, c] = triangle.map(|k| vertices[k as usize]);
        let longest =
            (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
        let mut key = **triangle;
        key.sort_unstable();
        (b - a).cross(&(c - a)).norm() > SLIVER * longest && seen.insert(key)
    };
    let (of_own, of_images) = numbers.split_at(own);
    let mut triangles: Vec<[u32; 3]> = of_own.iter().filter(|of| is_sound(of)).copied().collect();
    let sound = triangles.len();
    findings.left_out = own - sound;
    triangles.extend(of_images.iter().filter(|of| is_sound(of)));
    (vertices, triangles, sound)
}

/// FNV-1a of all numbers.
fn checksum(vertices: &[Vec3], corners: &[[u32; 3]]) -> u64 {
    let numbers = vertices.iter().flat_map(|v| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>());
    let corners = corners.iter().flatten().map(|&k| u64::from(k));
    numbers.chain(corners).fold(0xcbf2_9ce4_8422_2325, |hash, number| {
        number
            .to_le_bytes()
            .iter()
            .fold(hash, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
    })
}

fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    points.iter().fold((points[0], points[0]), |(low, high), p| (low.inf(p), high.sup(p)))
}

fn nearest_on_segment(from: &Vec3, to: &Vec3, point: &Vec3) -> Vec3 {
    let along = to - from;
    from + along * ((point - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0)
}

fn nearest_on(corners: &[Vec3; 3], point: &Vec3) -> Vec3 {
    let [a, b, c] = corners;
    if is_over(corners, point, 0.0) {
        let normal = (b - a).cross(&(c - a)).normalize();
        return point - normal * (point - a).dot(&normal);
    }
    let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| nearest_on_segment(from, to, point));
    let nearer = |one: &&Vec3, other: &&Vec3| {
        (*one - point).norm_squared().total_cmp(&(*other - point).norm_squared())
    };
    sides.iter().min_by(nearer).copied().unwrap_or(*a)
}

/// Is the foot of a point on the plane of a triangle in it, or nearer to it than a tolerance [m], about?
fn is_over(corners: &[Vec3; 3], point: &Vec3, tolerance: f64) -> bool {
    let [a, b, c] = corners;
    let normal = (b - a).cross(&(c - a));
    [(a, b), (b, c), (c, a)].iter().all(|(from, to)| {
        let inwards = normal.cross(&(*to - *from));
        (point - *from).dot(&inwards) >= -tolerance * inwards.norm()
    })
}

/// Does a triangle come into a box of this middle and these half sides [m]? It does not if an axis separates them: one of the box, the
/// normal of the triangle, or one at right angles to a side of both (Akenine-Möller 2001, DOI 10.1080/10867651.2001.10487535).
fn comes_into(corners: &[Vec3; 3], middle: &Vec3, half: &Vec3) -> bool {
    let [a, b, c] = corners.map(|corner| corner - middle);
    let sides = [b - a, c - b, a - c];
    let of_box = [0, 1, 2].map(|k| Vec3::ith(k, 1.0));
    let crossed = sides.iter().flat_map(|side| of_box.iter().map(move |axis| side.cross(axis)));
    let mut axes = of_box.iter().copied().chain([sides[0].cross(&sides[1])]).chain(crossed);
    axes.all(|axis| {
        let reach = half.dot(&axis.abs());
        let places = [a, b, c].map(|corner| corner.dot(&axis));
        let (least, most) =
            (places[0].min(places[1]).min(places[2]), places[0].max(places[1]).max(places[2]));
        // Along an axis of no length nothing is apart.
        axis == Vec3::zeros() || least < reach && most > -reach
    })
}

/// Cells with the triangles that come into them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Grid {
    low: Vec3,
    width: Vec3,
    count: [usize; 3],
    first: Vec<u32>,
    triangles: Vec<u32>,
}

impl Grid {
    fn of(vertices: &[Vec3], corners: &[[u32; 3]]) -> Self {
        let (low, high) = bounds(vertices);
        let extent = high - low;
        // At most so many cells, about four for each triangle.
        let most = 4.0 * corners.len() as f64 + 64.0;
        let mut side = extent.max() / most.sqrt().max(4.0);
        let cells = |side: f64| extent.map(|along| (along / side).floor().clamp(1.0, 1e6));
        while cells(side).product() > most {
            side *= 1.1;
        }
        let count = [0, 1, 2].map(|axis| cells(side)[axis] as usize);
        let width =
            Vec3::from_fn(|axis, _| (extent[axis] / count[axis] as f64).max(f64::MIN_POSITIVE));
        let mut grid = Self { low, width, count, first: Vec::new(), triangles: Vec::new() };
        let mut filled: Vec<(u32, u32)> = Vec::new();
        for (corners, triangle) in corners.iter().zip(0..) {
            let corners = corners.map(|k| vertices[k as usize]);
            let (low, high) = bounds(&corners);
            let [a, b, c] = &corners;
            let normal = (b - a).cross(&(c - a)).normalize();
            let reach = |along: &Vec3| 0.5 * width.dot(&along.abs()) + 1e-9 * extent.norm();
            let outwards = [(a, b), (b, c), (c, a)].map(|(from, to)| {
                let along = (to - from).cross(&normal).normalize();
                (from, along, reach(&along))
            });
            let thickness = reach(&normal);
            // Cells overlap a little: what is looked up by a point that is rounded must be there.
            let leeway = Vec3::repeat(1e-9 * extent.norm());
            grid.for_each_cell(&(low - leeway), &(high + leeway), |cell, middle| {
                // A long thin triangle stays out of most cells of the box around it.
                let beside =
                    outwards.iter().any(|(on, along, reach)| (middle - *on).dot(along) > *reach);
                if (middle - a).dot(&normal).abs() <= thickness && !beside {
                    filled.push((cell as u32, triangle));
                }
            });
        }
        filled.sort_unstable();
        grid.first = vec![0; count.iter().product::<usize>() + 1];
        for &(cell, _) in &filled {
            grid.first[cell as usize + 1] += 1;
        }
        for cell in 1..grid.first.len() {
            grid.first[cell] += grid.first[cell - 1];
        }
        grid.triangles = filled.into_iter().map(|(_, triangle)| triangle).collect();
        grid
    }

    /// Every cell that a box touches, with its middle; none if the box is outside.
    fn for_each_cell(&self, low: &Vec3, high: &Vec3, mut visit: impl FnMut(usize, Vec3)) {
        let mut ranges = [(0, 0); 3];
        for axis in 0..3 {
            let cell = |place: f64| ((place - self.low[axis]) / self.width[axis]).floor();
            let (from, to, last) =
                (cell(low[axis]), cell(high[axis]), self.count[axis] as f64 - 1.0);
            // A surface in a plane has no width of its own.
            let flat = self.width[axis] == f64::MIN_POSITIVE;
            if !flat && (to < -1.0 || from > last + 1.0) {
                return;
            }
            ranges[axis] = if flat {
                (0, 0)
            } else {
                (from.clamp(0.0, last) as usize, to.clamp(0.0, last) as usize)
            };
        }
        let [xs, ys, zs] = ranges;
        for z in zs.0..=zs.1 {
            for y in ys.0..=ys.1 {
                for x in xs.0..=xs.1 {
                    let at = Vec3::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5);
                    let middle = self.low + at.component_mul(&self.width);
                    visit((z * self.count[1] + y) * self.count[0] + x, middle);
                }
            }
        }
    }

    /// Every triangle in the cells that a box touches, some of them several times.
    fn for_each_in(&self, low: &Vec3, high: &Vec3, mut visit: impl FnMut(u32)) {
        self.for_each_cell(low, high, |cell, _| {
            let range = self.first[cell] as usize..self.first[cell + 1] as usize;
            self.triangles[range].iter().for_each(|&triangle| visit(triangle));
        });
    }
}
