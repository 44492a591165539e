//! A body beside a surface of triangles, and what both share.

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
    /// Of the wall.
    pub(super) wall: &'a Mat3,
    /// Of the body in the axes of the wall.
    pub(super) frame: Mat3,
    pub(super) centre: Vec3,
}

impl<'a> Seen<'a> {
    /// # Panics
    /// If B is no surface of triangles: the table of resolvers was filled wrongly.
    pub(super) fn of(a: &'a Posed, b: &Posed<'a>, r: &Vec3) -> Self {
        let Shape::TriangleMesh(mesh) = b.shape else {
            unreachable!("a facet is the second body of its pairs")
        };
        let (frame, centre) = (b.frame.tr_mul(a.frame), -b.frame.tr_mul(r));
        Self { a, mesh, wall: b.frame, frame, centre }
    }

    /// How far the body, or the polyhedron that stands for it, stays in front of a plane, along its normal [m].
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

/// What a body shares with a part of a surface, in world axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shared {
    /// The lowest of the facets that are there.
    pub(super) facet: u32,
    pub(super) thickness: Thickness,
}
