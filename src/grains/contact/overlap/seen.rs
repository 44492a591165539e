//! A body beside a surface of triangles, and the volume that both share.

use super::thickness::Thickness;
use crate::contact::Posed;
use crate::math::{Mat3, Vec3};
use crate::shape::Shape;
use crate::shape::facets::Plane;
use crate::shape::triangle_mesh::TriangleMesh;

/// A body in the axes of the wall.
pub(super) struct Seen<'a> {
    pub(super) a: &'a Posed<'a>,
    pub(super) mesh: &'a TriangleMesh,
    /// Frame of the wall.
    pub(super) wall: &'a Mat3,
    /// Frame of the body in the axes of the wall.
    pub(super) frame: Mat3,
    pub(super) centre: Vec3,
}

impl<'a> Seen<'a> {
    /// # Panics
    /// If B is not a surface of triangles, that is, if the table of resolvers is wrong.
    pub(super) fn of(a: &'a Posed, b: &Posed<'a>, r: &Vec3) -> Self {
        let Shape::TriangleMesh(mesh) = b.shape else {
            unreachable!("a facet is the second body of its pairs")
        };
        let (frame, centre) = (b.frame.tr_mul(a.frame), -b.frame.tr_mul(r));
        Self { a, mesh, wall: b.frame, frame, centre }
    }

    /// Height of the lowest point of the body, or of the polyhedron that represents it, above a plane [m].
    pub(super) fn height_over(&self, plane: &Plane) -> f64 {
        let up = self.frame.tr_mul(&plane.normal);
        let lowest = match self.a.shape.facets() {
            Some(facets) if self.a.shape.excess() > 0.0 => {
                facets.vertices().iter().map(|vertex| vertex.dot(&up)).fold(f64::INFINITY, f64::min)
            }
            _ => self.a.shape.support(&-up).dot(&up),
        };
        self.centre.dot(&plane.normal) + lowest * self.a.scale - plane.offset
    }

    /// A plane in the axes and the unit of length of the body.
    pub(super) fn place(&self, plane: &Plane) -> Plane {
        let offset = (plane.offset - plane.normal.dot(&self.centre)) / self.a.scale;
        Plane { normal: self.frame.tr_mul(&plane.normal), offset }
    }
}

/// Volume shared by a body and a part of a surface, in world axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shared {
    /// Lowest number of the facets that are touched.
    pub(super) facet: u32,
    pub(super) thickness: Thickness,
}
