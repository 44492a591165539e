//! Shapes with edges, sharp and rounded: from the file as written to the geometry.

use super::reader::{Range, Section};
use crate::math::Vec3;
use crate::shape::{Polyhedron, RoundedPolyhedron, Shape, Spherocylinder, hull::HullError, mesh};
use std::path::Path;

/// The keys of these shapes, but for those that spheres have.
pub(super) const KEYS: [&str; 4] = ["length", "vertices", "file", "scale"];

pub(super) fn spherocylinder(section: &Section) -> Option<Shape> {
    let length = section.number("length", Range::Positive, "m");
    let radius = section.number("radius", Range::Positive, "m");
    Some(Shape::Spherocylinder(Spherocylinder { length: length?, radius: radius? }))
}

pub(super) fn polyhedron(section: &Section, folder: &Path) -> Option<Shape> {
    let solid = solid(section, folder, Polyhedron::new)?;
    Some(Shape::Polyhedron(Box::new(solid)))
}

pub(super) fn rounded_polyhedron(section: &Section, folder: &Path) -> Option<Shape> {
    let radius = section.number("radius", Range::Positive, "m");
    // Corners are checked whatever the radius.
    let rounded = |points: &[Vec3]| RoundedPolyhedron::new(points, radius.unwrap_or_default());
    let solid = solid(section, folder, rounded)?;
    radius.map(|_| Shape::RoundedPolyhedron(Box::new(solid)))
}

/// What `build` makes of the corners that the file gives one by one or as a mesh.
fn solid<T>(
    section: &Section,
    folder: &Path,
    build: impl Fn(&[Vec3]) -> Result<T, HullError>,
) -> Option<T> {
    let scale = section.number_or("scale", 1.0, Range::Positive, "");
    let (given, points) = match (section.get("vertices"), section.get("file")) {
        (Some(vertices), None) => {
            if let Some(scale) = section.get("scale") {
                scale.fail("only for a `file`; `vertices` are in metres");
            }
            let points = vertices.points("m")?;
            (vertices, points)
        }
        (None, Some(file)) => {
            let path = folder.join(file.text()?);
            match mesh::read(&path, scale?) {
                Ok(points) => (file, points),
                Err(error) => {
                    file.fail(error);
                    return None;
                }
            }
        }
        _ => {
            section.fail("give either `vertices` = [[x, y, z], ...] [m], or `file` and `scale`");
            return None;
        }
    };
    build(&points).map_err(|error| given.fail(error)).ok()
}
