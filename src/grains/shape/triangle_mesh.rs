//! The surface of a wall, from triangles.
//!
//! Particles touch its *facets*, each of which exists once however the surface is cut into triangles:
//!
//! | facet | definition | directions in which it faces |
//! |---|---|---|
//! | face | connected coplanar triangles | both normals |
//! | edge | a side of triangles that are not coplanar, or of one only | those between the normals of its faces, on the convex side |
//! | corner | a point where edges meet | those at right angles or more to all edges from it |
//!
//! These directions are the Voronoi regions of the surface: a contact whose normal lies in none of a facet belongs to another one. An edge
//! that is concave on a side faces nowhere there. The orientation of triangles has no influence.
//!
//! A cylinder or a cone has *strips*, and *rims* at its ends. A strip lies between two straight lines of the surface, and faces in all
//! directions between the normals there. A rim is the arc at the end of a strip: a bent edge of one triangle. Both are exact: their triangles
//! only serve the search and the pictures.
//!
//! For particles with a straight side, [`TriangleMesh::stretches`] gives the facets below the points of the side, on strips too. Particles
//! with faces use the volume behind the triangles ([`TriangleMesh::with_cells`]) and have no contacts with edges and corners.
//!
//! Facets are numbered: first faces, then edges, then corners. They are found through a grid of cells in the axes of the wall.

mod along;
mod building;
mod cells;
mod cutting;
mod facets;
mod grid;
mod nearest;
mod solid;

pub use along::{Over, Round, Stretch};
pub use cells::Front;
pub use facets::MeshFacet;
pub use solid::{Near, NoSolid};

use super::Convex;
use crate::math::{Vec3, bounds};
use building::{Building, welded};
use facets::Facets;
use grid::Grid;
pub use nearest::is_over;
use nearest::{comes_into, lie_in_each_other, nearest_on, nearest_on_segment};
use serde::{Deserialize, Serialize};
use solid::Solid;

/// Points this near to a plane, a side or each other count as in it or as one, over the size of the surface.
const COPLANAR: f64 = 1e-11;
/// Least `smooth` angle [rad]: it merges contacts that are found twice on a border.
const LEAST_SMOOTH: f64 = 1e-6;
/// Number of strips of a cylinder or a cone.
const STRIPS: u32 = 64;
/// No facet.
const NONE: u32 = u32::MAX;

/// A part of a cylinder or a cone, between two straight lines on it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strip {
    /// Begin of its axis [m].
    pub from: Vec3,
    /// Unit vector along the axis.
    pub axis: Vec3,
    /// Length of the axis [m].
    pub length: f64,
    /// Radius at the begin of the axis [m].
    pub radius: f64,
    /// Growth of the radius along the axis [-].
    pub slope: f64,
    /// Unit vector across the axis, towards the first line.
    pub first: Vec3,
    /// Direction a quarter turn on from `first`.
    pub quarter: Vec3,
    /// Angle from the first line to the last [rad].
    pub opening: f64,
    /// Whether it is the first strip of its surface.
    pub is_first: bool,
}

/// A place nearer to a face than this counts as in it, over the radius of the particle.
pub const FLAT: f64 = 1e-5;

/// The arc at an end of a [`Strip`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rim {
    /// The strip.
    pub strip: Strip,
    /// Height on the axis of the strip [m].
    pub height: f64,
    /// Direction along the axis out of the surface: 1 or -1.
    pub outwards: f64,
}

/// The tangent of a rim at an angle, with the directions in which an edge there faces.
pub struct Tangent {
    /// Point of contact with the rim [m].
    pub at: Vec3,
    /// Unit vector along the tangent.
    pub along: Vec3,
    /// First direction in which it faces: the normal of the surface, away from the axis.
    pub first: Vec3,
    /// Direction a quarter turn on from `first`: out of the surface, along it.
    pub quarter: Vec3,
}

impl Rim {
    /// Centre of the circle [m].
    pub fn centre(&self) -> Vec3 {
        self.strip.from + self.strip.axis * self.height
    }

    /// Radius of the circle [m].
    pub fn radius(&self) -> f64 {
        self.strip.radius + self.strip.slope * self.height
    }

    /// Tangent at an angle from the first line of the strip [rad].
    pub fn tangent(&self, angle: f64) -> Tangent {
        let Strip { axis, slope, first, quarter, .. } = self.strip;
        let steep = (1.0 + slope * slope).sqrt();
        let (sine, cosine) = libm::sincos(angle);
        let across = first * cosine + quarter * sine;
        Tangent {
            at: self.centre() + across * self.radius(),
            along: quarter * cosine - first * sine,
            first: (across - axis * slope) / steep,
            quarter: (axis + across * slope) * (self.outwards / steep),
        }
    }
}

impl Strip {
    /// Normal away from the axis where the surface is nearest to a point [-]; zero on the axis.
    fn normal_at(&self, point: &Vec3) -> Vec3 {
        let way = point - self.from;
        let across = way - self.axis * way.dot(&self.axis);
        let across = across.try_normalize(0.0).unwrap_or_default();
        (across - self.axis * self.slope) / (1.0 + self.slope * self.slope).sqrt()
    }

    /// Distance of a point from the surface of the strip, continued beyond its borders [m].
    pub fn distance(&self, point: &Vec3) -> f64 {
        let way = point - self.from;
        let along = way.dot(&self.axis);
        let across = (way - self.axis * along).norm();
        (self.radius + self.slope * along - across).abs() / (1.0 + self.slope * self.slope).sqrt()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Triangle {
    corners: [u32; 3],
    /// Its face or strip, and its edges (from the corner of that number to the next), or [`NONE`].
    facets: [u32; 4],
}

/// Defects and counts found in the triangles of a file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Findings {
    /// Triangles without area, or duplicates; they are left out.
    pub left_out: usize,
    /// Cuts of triangles, or of their pieces, at corners of others within their sides.
    pub cut: usize,
    /// Edges of one triangle only, where the surface ends or has a hole.
    pub open_edges: usize,
    /// Edges of three triangles or more.
    pub crowded_edges: usize,
    /// Edges whose two triangles have opposite orientations.
    pub turned_edges: usize,
}

/// Reason why triangles are no surface.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum SurfaceError {
    /// All are degenerate.
    #[error("the mesh has no triangle with an area")]
    Empty,
    /// A coordinate is not a number.
    #[error("triangle {0} (from 0) has a coordinate that is not a number")]
    NotFinite(usize),
    /// Pieces of triangles keep corners within their sides.
    #[error(
        "triangles near ({:e}, {:e}, {:e}) m are too close to be divided into triangles with common sides; a smaller \
         `weld` may help",
        .corner.x, .corner.y, .corner.z
    )]
    Tangled {
        /// One of these corners [m].
        corner: Vec3,
    },
}

/// The surface of a wall, in the wall's axes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriangleMesh {
    vertices: Vec<Vec3>,
    /// Its own triangles, then images of them.
    triangles: Vec<Triangle>,
    own: usize,
    facets: Facets,
    grid: Grid,
    /// Volume behind the triangles, for particles with faces.
    solid: Option<Solid>,
    /// Largest distance of facets from their triangles [m].
    bulge: f64,
    /// Cosine of the angle between normals below which contacts on two adjoining facets count as one.
    smooth: f64,
    reach: f64,
    /// Lowest and highest corner of the bounding box [m].
    bounds: [Vec3; 2],
    findings: Findings,
    checksum: u64,
}

/// Serialisation of a surface sent to another rank.
pub(super) mod shared {
    use super::TriangleMesh;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use std::sync::Arc;

    pub(in crate::shape) fn serialize<S: Serializer>(
        surface: &Arc<TriangleMesh>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        surface.as_ref().serialize(serializer)
    }

    pub(in crate::shape) fn deserialize<'a, D: Deserializer<'a>>(
        deserializer: D,
    ) -> Result<Arc<TriangleMesh>, D::Error> {
        TriangleMesh::deserialize(deserializer).map(Arc::new)
    }
}

impl TriangleMesh {
    /// A surface from corners [m] in the axes of the wall.
    ///
    /// Contacts of one particle count once if their facets have a corner in common and their normals differ by less than `smooth` [rad].
    ///
    /// # Errors
    /// If the triangles are no surface.
    pub fn new(corners: &[[Vec3; 3]], smooth: f64) -> Result<Self, SurfaceError> {
        Self::with_images(corners, corners.len(), 0.0, smooth)
    }

    /// A surface of triangles of which only the first `own` are its own; the others are images beyond the periods of a domain.
    ///
    /// Pictures and counts leave the images out. Corners nearer to each other than `weld`, or than rounding, are merged. Triangles are cut where
    /// corners of others are that near to their sides [m].
    ///
    /// # Errors
    /// If the triangles are no surface.
    pub fn with_images(
        corners: &[[Vec3; 3]],
        own: usize,
        weld: f64,
        smooth: f64,
    ) -> Result<Self, SurfaceError> {
        if let Some(k) =
            corners.iter().position(|t| !t.iter().all(|c| c.iter().all(|x| x.is_finite())))
        {
            return Err(SurfaceError::NotFinite(k));
        }
        if corners.is_empty() {
            return Err(SurfaceError::Empty);
        }
        let mut findings = Findings::default();
        let mut building = welded(corners, own, weld, &mut findings);
        if building.own == 0 {
            return Err(SurfaceError::Empty);
        }
        building.share_sides(&mut findings)?;
        building.find_sides(&mut findings);
        building.find_faces();
        building.find_edges();
        building.find_corners();
        Ok(Self { findings, ..building.finished(smooth.max(LEAST_SMOOTH)) })
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
        let mut building = Building::default();
        // At the tip of a cone a triangle has no area, and there is no rim.
        let is_there = [end > 0.0, begin > 0.0];
        for ((first, quarter), k) in lines.zip(0..) {
            building.vertices.extend([from + first * begin, to + first * end]);
            let next = (k + 1) % STRIPS;
            let ends = [2 * k, 2 * k + 1, 2 * next, 2 * next + 1];
            let strip = Strip {
                from: *from,
                axis,
                length,
                radius: begin,
                slope: (end - begin) / length,
                first,
                quarter,
                opening: turn,
                is_first: k == 0,
            };
            building.push_strip(strip, ends, is_there);
        }
        building.find_rims();
        building.own = building.corners.len();
        let mesh = building.finished(LEAST_SMOOTH);
        let bulge = 1.01 * begin.max(end) * (1.0 - libm::cos(0.5 * turn));
        Self { bulge, reach: mesh.reach + bulge, ..mesh }
    }

    /// Copy of a cylinder that continues beyond both ends by this length [m]; without rims, if the length is positive.
    ///
    /// Pictures do not show the continuation.
    #[must_use]
    pub fn going_on(mut self, beyond: f64) -> Self {
        if beyond > 0.0 {
            self.facets.leave_out_edges();
            self.triangles.iter_mut().for_each(|of| of.facets[1..].fill(NONE));
        }
        for Strip { from, axis, length, .. } in &mut self.facets.strips {
            *from -= *axis * beyond;
            *length += 2.0 * beyond;
        }
        self
    }

    /// Moves the origin of the axes to this place [m].
    pub fn see_from(&mut self, place: &Vec3) {
        for vertex in &mut self.vertices {
            *vertex -= place;
        }
        self.facets.see_from(place);
        self.grid.see_from(place);
        if let Some(solid) = &mut self.solid {
            solid.see_from(place);
        }
        self.bounds = self.bounds.map(|corner| corner - place);
        self.reach = self.vertices.iter().map(Vec3::norm).fold(0.0, f64::max) + self.bulge;
    }

    /// Defects and counts found in the triangles.
    pub const fn findings(&self) -> Findings {
        self.findings
    }

    /// Whether it is an exact cylinder or cone, whose triangles are only for pictures.
    pub const fn is_exact(&self) -> bool {
        !self.facets.strips.is_empty()
    }

    /// Description in a line: triangles, facets, findings and memory.
    pub fn summary(&self) -> String {
        if let Some(strip) = self.facets.strips.first() {
            let Strip { radius, slope, length, .. } = strip;
            let what = if *slope == 0.0 { "cylinder" } else { "cone" };
            let end = radius + slope * length;
            let to_end = if *slope == 0.0 { String::new() } else { format!(" to {end:.3e}") };
            return format!(
                "a {what}, radius {radius:.3e}{to_end} m, length {length:.3e} m, exact; pictures draw it with {} \
                 triangles",
                self.len()
            );
        }
        let [faces, edges, corners] = self.facets.counts();
        let mut text = format!(
            "{} with {faces} faces, {edges} edges and {corners} corners that particles can touch; {} bytes of each on \
             every rank",
            self.len(),
            self.bytes() / self.len()
        );
        let Findings { left_out, cut, open_edges, crowded_edges, turned_edges } = self.findings;
        let images = self.triangles.len() - self.own;
        for (count, what) in [
            (images, "images beyond the periods"),
            (open_edges, "edges of one triangle only, where the surface ends or has a hole"),
            (crowded_edges, "edges of three or more triangles"),
            (turned_edges, "edges with triangles of opposite orientation (without effect)"),
            (left_out, "triangles left out, without area or duplicate"),
            (cut, "divisions of triangles at corners of others in their sides"),
        ] {
            if count > 0 {
                text.extend(["; ", &count.to_string(), " ", what]);
            }
        }
        text
    }

    /// Largest component of the normals along a unit vector.
    pub fn most_along(&self, along: &Vec3) -> f64 {
        // Normals of edges and corners lie between those of faces.
        let of_faces = self.facets.faces.iter().map(|face| face.normal.dot(along).abs());
        let of_strips = self.facets.strips.iter().map(|Strip { axis, slope, .. }| {
            let by_axis = axis.dot(along);
            let across = (1.0 - by_axis * by_axis).max(0.0).sqrt();
            (across + (slope * by_axis).abs()) / (1.0 + slope * slope).sqrt()
        });
        of_faces.chain(of_strips).fold(0.0, f64::max)
    }

    /// Whether it is a cylinder or a cone.
    pub const fn is_round(&self) -> bool {
        !self.facets.strips.is_empty()
    }

    /// Number of triangles, without images.
    pub const fn len(&self) -> usize {
        self.own
    }

    /// Whether there are no triangles.
    pub const fn is_empty(&self) -> bool {
        self.own == 0
    }

    /// Number of facets.
    pub const fn facet_count(&self) -> usize {
        self.facets.len()
    }

    /// The facet of a number.
    ///
    /// # Panics
    /// If there is no such facet.
    pub fn facet(&self, number: u32) -> MeshFacet {
        self.facets.get(number, &self.vertices)
    }

    /// All facets.
    pub fn facets(&self) -> impl Iterator<Item = MeshFacet> {
        (0..self.facet_count() as u32).map(|number| self.facet(number))
    }

    /// Unit vectors along all edges from a corner.
    ///
    /// # Panics
    /// If the facet of this number is not a corner.
    pub fn edges_at(&self, corner: u32) -> impl Iterator<Item = Vec3> {
        self.facets.edges_at(corner, &self.vertices)
    }

    /// Own triangles, without images [m].
    pub fn triangles(&self) -> impl Iterator<Item = [Vec3; 3]> {
        self.triangles[..self.own].iter().map(|t| self.corners(t))
    }

    /// Whether the surface has images, from one to another of which a particle can pass through a period.
    ///
    /// If so, distances from the surface do not bound the way of the particle.
    pub const fn has_images(&self) -> bool {
        self.own < self.triangles.len()
    }

    /// Distance of the farthest corner from the reference point [m].
    pub const fn reach(&self) -> f64 {
        self.reach
    }

    /// Upper bound of the distances of its points from an axis through the reference point, of any length [m].
    pub fn reach_about(&self, axis: &Vec3) -> f64 {
        let Some(axis) = axis.try_normalize(0.0) else { return self.reach };
        let corners = (0..8).map(|k| Vec3::from_fn(|i, _| self.bounds[k >> i & 1][i]));
        let from_axis = corners.map(|corner| corner.cross(&axis).norm()).fold(0.0, f64::max);
        self.reach.min(from_axis + self.bulge)
    }

    /// Hash of the triangles, independent of the origin of the axes.
    pub const fn checksum(&self) -> u64 {
        self.checksum
    }

    /// Memory that the surface holds [bytes].
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.vertices)
            + size_of_val(&*self.triangles)
            + self.facets.bytes()
            + self.grid.bytes()
            + self.solid.as_ref().map_or(0, Solid::bytes)
    }

    /// Whether two facets have a corner in common.
    pub fn adjoin(&self, one: u32, other: u32) -> bool {
        let [one, other] = [one, other].map(|facet| self.facets.vertices_of(facet));
        let (few, many) = if one.len() < other.len() { (one, other) } else { (other, one) };
        few.iter().any(|vertex| many.binary_search(vertex).is_ok())
    }

    /// Whether an edge whose opening has this cosine is a fold, with faces whose contacts are not merged.
    pub fn is_fold(&self, cosine: f64) -> bool {
        cosine < self.smooth
    }

    /// Whether a facet at a place of the surface has this unit normal, or borders on a part that has.
    pub fn is_along(&self, facet: u32, place: &Vec3, normal: &Vec3) -> bool {
        let is_one = |own: Vec3| self.are_one(&own, normal) || self.are_one(&-own, normal);
        match self.facet(facet) {
            MeshFacet::Face { normal, .. } => is_one(normal),
            MeshFacet::Edge { first, quarter, opening, .. } => {
                let (sine, cosine) = libm::sincos(opening);
                is_one(first) || is_one(first * cosine + quarter * sine)
            }
            MeshFacet::Strip(strip) | MeshFacet::Rim(Rim { strip, .. }) => {
                is_one(strip.normal_at(place))
            }
            MeshFacet::Corner { .. } => true,
        }
    }

    /// Whether a direction points to the convex side of an edge, and not into its fold.
    pub fn is_outside(&self, edge: u32, out: &Vec3) -> bool {
        match self.facet(edge) {
            MeshFacet::Edge { first, quarter, opening, .. } => {
                let (sine, cosine) = libm::sincos(0.5 * opening);
                (first * cosine + quarter * sine).dot(out) > 0.0
            }
            _ => true,
        }
    }

    /// Whether a triangle coincides with a part of a face within `tolerance` [m].
    ///
    /// The face must have another number than `but`, and the common part an area.
    pub fn lies_in(&self, corners: &[Vec3; 3], but: Option<u32>, tolerance: f64) -> bool {
        if self.is_round() {
            return false;
        }
        let (low, high) = bounds(corners);
        let mut found = false;
        self.grid.for_each_in(&low, &high, |triangle| {
            let triangle = &self.triangles[triangle as usize];
            found = found
                || Some(triangle.facets[0]) != but
                    && lie_in_each_other(corners, &self.corners(triangle), tolerance);
        });
        found
    }

    /// Whether one of the triangles coincides with another face within `tolerance` [m].
    pub fn lies_in_itself(&self, tolerance: f64) -> bool {
        let mut own = self.triangles[..self.own].iter();
        own.any(|t| self.lies_in(&self.corners(t), Some(t.facets[0]), tolerance))
    }

    /// Calls `visit` for each triangle within a distance of a point [m], with its face, in rising order.
    pub fn for_each_triangle_near(
        &self,
        point: &Vec3,
        distance: f64,
        mut visit: impl FnMut(u32, &[Vec3; 3]),
    ) {
        let reach = Vec3::repeat(distance);
        let mut near = Vec::new();
        self.grid.for_each_in(&(point - reach), &(point + reach), |triangle| near.push(triangle));
        near.sort_unstable();
        near.dedup();
        for triangle in near {
            let triangle = &self.triangles[triangle as usize];
            let corners = self.corners(triangle);
            if (nearest_on(&corners, point) - point).norm() < distance {
                visit(triangle.facets[0], &corners);
            }
        }
    }

    /// Whether one of two facets is a face and the other an edge of it. Strips within a quarter turn of a rim count as its face.
    pub fn are_face_and_edge(&self, one: u32, other: u32) -> bool {
        // Faces have the lowest numbers.
        let (face, edge) = (one.min(other), one.max(other));
        let [of_face, of_edge] = [face, edge].map(|facet| self.facets.vertices_of(facet));
        let is_on = || of_edge.iter().all(|k| of_face.binary_search(k).is_ok());
        let is_beside = || {
            let apart = (edge - face) % STRIPS;
            apart.min(STRIPS - apart) <= STRIPS / 4
        };
        !self.facets.is_edge(face)
            && self.facets.is_edge(edge)
            && if self.is_round() { is_beside() } else { is_on() }
    }

    /// Whether contacts with these unit normals, on adjoining facets, count as one.
    pub fn are_one(&self, one: &Vec3, other: &Vec3) -> bool {
        one.dot(other) > self.smooth
    }

    fn corners(&self, triangle: &Triangle) -> [Vec3; 3] {
        triangle.corners.map(|k| self.vertices[k as usize])
    }

    /// Numbers of all facets within a distance of a point [m], in rising order.
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
            let [face, edges @ ..] = triangle.facets;
            near.push(face);
            for (k, &edge) in edges.iter().enumerate().filter(|&(_, &edge)| edge != NONE) {
                let nearest = nearest_on_segment(&corners[k], &corners[(k + 1) % 3], point);
                if (nearest - point).norm_squared() < square {
                    near.push(edge);
                }
            }
            for (&vertex, corner) in triangle.corners.iter().zip(&corners) {
                if (corner - point).norm_squared() < square {
                    near.extend(self.facets.corner_of(vertex));
                }
            }
        });
        near.sort_unstable();
        near.dedup();
        near
    }

    /// Number of the own triangle nearest to a point, among those within a distance [m]; the lowest of several.
    pub fn nearest_triangle(&self, point: &Vec3, distance: f64) -> Option<usize> {
        let far = distance + self.bulge;
        let reach = Vec3::repeat(far);
        let mut nearest = (far * far, usize::MAX);
        self.grid.for_each_in(&(point - reach), &(point + reach), |number| {
            let number = number as usize;
            if number >= self.own {
                return;
            }
            let corners = self.corners(&self.triangles[number]);
            // Most bounding boxes are farther away, and are faster to check.
            let (low, high) = bounds(&corners);
            if (point.sup(&low).inf(&high) - point).norm_squared() <= nearest.0 {
                let found = ((nearest_on(&corners, point) - point).norm_squared(), number);
                if found < nearest {
                    nearest = found;
                }
            }
        });
        Some(nearest.1).filter(|&number| number < self.own)
    }

    /// Whether a point of a face's plane is in one of its triangles, within `tolerance` [m].
    pub fn is_on_face(&self, face: u32, point: &Vec3, tolerance: f64) -> bool {
        let mut found = false;
        let reach = Vec3::repeat(tolerance + self.bulge);
        self.grid.for_each_in(&(point - reach), &(point + reach), |triangle| {
            let triangle = &self.triangles[triangle as usize];
            if !found && triangle.facets[0] == face {
                found = is_over(&self.corners(triangle), point, tolerance);
            }
        });
        found
    }

    /// First point where the way from one point to another passes through a triangle, except for those of the face `but`.
    ///
    /// A point within `tolerance` [m] of the second point is not between them.
    pub fn between(
        &self,
        but: Option<u32>,
        from: &Vec3,
        to: &Vec3,
        tolerance: f64,
    ) -> Option<Vec3> {
        let mut first: Option<f64> = None;
        self.grid.for_each_in(&from.inf(to), &from.sup(to), |triangle| {
            let triangle = &self.triangles[triangle as usize];
            if Some(triangle.facets[0]) == but {
                return;
            }
            let corners = self.corners(triangle);
            let [a, b, c] = &corners;
            let normal = (b - a).cross(&(c - a)).normalize();
            let (start, end) = ((from - a).dot(&normal), (to - a).dot(&normal));
            if start * end < 0.0 && end.abs() > tolerance {
                let part = start / (start - end);
                if first.is_none_or(|first| part < first)
                    && is_over(&corners, &(from + (to - from) * part), 0.0)
                {
                    first = Some(part);
                }
            }
        });
        first.map(|part| from + (to - from) * part)
    }

    /// Whether a part of the surface is nearer to a point than this [m]. Strips count as continued beyond their ends.
    pub fn meets_ball(&self, centre: &Vec3, radius: f64) -> bool {
        let mut found = false;
        let reach = Vec3::repeat(radius + self.bulge);
        self.grid.for_each_in(&(centre - reach), &(centre + reach), |triangle| {
            let triangle = &self.triangles[triangle as usize];
            found = found
                || match self.facets.strips.get(triangle.facets[0] as usize) {
                    Some(strip) => strip.distance(centre) < radius,
                    None => (nearest_on(&self.corners(triangle), centre) - centre).norm() < radius,
                };
        });
        found
    }

    /// Whether a box from `low` to `high` [m], in the axes of the wall, contains a part of a triangle.
    pub fn comes_into(&self, low: &Vec3, high: &Vec3) -> bool {
        let mut found = false;
        self.grid.for_each_in(low, high, |triangle| {
            let corners = self.corners(&self.triangles[triangle as usize]);
            found = found || comes_into(&corners, &((low + high) * 0.5), &((high - low) * 0.5));
        });
        found
    }
}

/// It has neither volume nor support point, and resolvers never ask for them.
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
