//! Geometry of a shape, from the parsed file.

use super::reader::{Given, Section};
use super::rockable;
use crate::math::Vec3;
use crate::shape::hull::HullError;
use crate::shape::polyhedron::corners_only;
use crate::shape::{
    Ellipsoid, Kind, PolySuperellipsoid, Polyhedron, RoundedPolyhedron, Shape, Sphere,
    Spherocylinder, Superellipsoid, mesh,
};
use std::path::Path;

/// Keys of a kind of shape, and their reader. Paths of meshes are relative to the folder.
#[derive(Clone, Copy)]
struct Reader {
    keys: &'static [&'static str],
    read: fn(&Section, &Path) -> Option<Shape>,
}

/// `None` for kinds that particles cannot have.
fn reader(kind: Kind) -> Option<Reader> {
    let (keys, read): (&[_], fn(&Section, &Path) -> _) = match kind {
        Kind::Sphere => (&["radius", "diameter"], sphere),
        Kind::Ellipsoid => (&["semi_axes", "diameter", "aspect_ratio"], ellipsoid),
        Kind::Superellipsoid => (&["semi_axes", "exponents"], superellipsoid),
        Kind::PolySuperellipsoid => {
            (&["semi_axes_positive", "semi_axes_negative", "exponents"], poly_superellipsoid)
        }
        Kind::Spherocylinder => (&["length", "radius"], spherocylinder),
        Kind::Polyhedron => (&["vertices", "edges", "file", "scale"], polyhedron),
        Kind::RoundedPolyhedron => {
            (&["vertices", "edges", "file", "scale", "radius"], rounded_polyhedron)
        }
        // Read by `pieces::union`, which has access to the other shapes.
        Kind::Union => (&["pieces", "file", "files", "scale", "tolerance"], |_, _| None),
        Kind::Other | Kind::HalfSpace | Kind::TriangleMesh => return None,
    };
    Some(Reader { keys, read })
}

/// Keys of a kind, some of which are alternatives; `None` for kinds that particles cannot have.
pub(super) fn keys(kind: Kind) -> Option<&'static [&'static str]> {
    reader(kind).map(|reader| reader.keys)
}

/// May a shape of this kind have a key? One of an unknown kind may have all keys.
pub(super) fn has(kind: Option<Kind>, key: &str) -> bool {
    let own = kind.and_then(keys);
    let is_of_kinds = || Kind::ALL.into_iter().filter_map(keys).any(|keys| keys.contains(&key));
    own.is_none_or(|own| own.contains(&key)) || !is_of_kinds()
}

/// May the shape of a section have a key?
pub(super) fn has_key(section: &Section, key: &str) -> bool {
    let kind = section.get("kind");
    let word = kind.as_ref().and_then(Given::text);
    has(Kind::ALL.into_iter().find(|kind| Some(kind.name()) == word), key)
}

/// Shape of a section.
pub(super) fn geometry(section: &Section, folder: &Path) -> Option<Shape> {
    let readers: Vec<(&str, Reader)> =
        Kind::ALL.into_iter().filter_map(|kind| Some((kind.name(), reader(kind)?))).collect();
    let reader = section.require("kind").and_then(|given| given.one_of(&readers))?;
    (reader.read)(section, folder)
}

/// Is the shape of a section a union of others?
pub(super) fn is_union(section: &Section) -> bool {
    section.get("kind").as_ref().and_then(Given::text) == Some(Kind::Union.name())
}

fn sphere(section: &Section, _: &Path) -> Option<Shape> {
    let size = |given: Given| given.number();
    let radius = match (section.get("radius"), section.get("diameter")) {
        (Some(radius), None) => size(radius),
        (None, Some(diameter)) => size(diameter).map(|d| 0.5 * d),
        (Some(_), Some(_)) => {
            section.fail("give either `radius` or `diameter`, not both");
            None
        }
        (None, None) => {
            section.fail("`radius` is missing: a number greater than 0 [m]; or `diameter`");
            None
        }
    }?;
    Some(Shape::Sphere(Sphere { radius }))
}

fn ellipsoid(section: &Section, _: &Path) -> Option<Shape> {
    let axes = section.get("semi_axes");
    let (diameter, ratio) = (section.get("diameter"), section.get("aspect_ratio"));
    let semi_axes = match (axes, diameter, ratio) {
        (Some(axes), None, None) => axes.vector(),
        (None, Some(diameter), Some(ratio)) => {
            let diameter = diameter.number();
            let ratio = ratio.number();
            let (diameter, ratio) = (diameter?, ratio?);
            // (d/2)³ = a b b with a = ratio · b
            let short = 0.5 * diameter / libm::cbrt(ratio);
            Some(Vec3::new(ratio * short, short, short))
        }
        _ => {
            section.fail(
                "give either `semi_axes` = [a, b, c] [m], or `diameter` (of the sphere of \
                 equal volume) [m] and `aspect_ratio`",
            );
            None
        }
    }?;
    Some(Shape::Ellipsoid(Ellipsoid { semi_axes }))
}

fn superellipsoid(section: &Section, _: &Path) -> Option<Shape> {
    let semi_axes = section.vector("semi_axes");
    let exponents = exponents(section);
    Some(Shape::Superellipsoid(Superellipsoid::new(semi_axes?, exponents?)))
}

fn poly_superellipsoid(section: &Section, _: &Path) -> Option<Shape> {
    let positive = section.vector("semi_axes_positive");
    let negative = section.vector("semi_axes_negative");
    let exponents = exponents(section);
    let shape = PolySuperellipsoid::new(positive?, negative?, exponents?);
    Some(Shape::PolySuperellipsoid(Box::new(shape)))
}

fn exponents(section: &Section) -> Option<[f64; 2]> {
    section.require("exponents")?.list_of(Given::number)
}

fn spherocylinder(section: &Section, _: &Path) -> Option<Shape> {
    let length = section.number("length");
    let radius = section.number("radius");
    Some(Shape::Spherocylinder(Spherocylinder { length: length?, radius: radius? }))
}

fn polyhedron(section: &Section, folder: &Path) -> Option<Shape> {
    let solid = solid(section, folder, Polyhedron::new)?;
    Some(Shape::Polyhedron(Box::new(solid)))
}

fn rounded_polyhedron(section: &Section, folder: &Path) -> Option<Shape> {
    let of_rockable =
        |file: &Given| file.text().is_some_and(|f| mesh::has_ending(f.as_ref(), "shp"));
    if let Some(file) = section.get("file").filter(of_rockable) {
        return with_its_radius(section, &file, folder);
    }
    let radius = section.number("radius");
    // Corners are checked for any radius.
    let rounded = |points: &[Vec3]| RoundedPolyhedron::new(points, radius.unwrap_or_default());
    let solid = solid(section, folder, rounded)?;
    radius.map(|_| Shape::RoundedPolyhedron(Box::new(solid)))
}

/// A rounded polyhedron from a file that has its radius.
fn with_its_radius(section: &Section, file: &Given, folder: &Path) -> Option<Shape> {
    for other in ["vertices", "edges", "radius"] {
        section.refuse(other, "is in the `file`");
    }
    let scale = section.number_or("scale", 1.0)?;
    let name = section.get("name").as_ref().and_then(Given::text).unwrap_or_default();
    let body = rockable::body(&folder.join(file.text()?), name).and_then(|(radius, corners)| {
        let corners: Vec<Vec3> = corners.into_iter().map(|corner| corner * scale).collect();
        RoundedPolyhedron::new(&corners, radius * scale).map_err(|error| error.to_string())
    });
    let body = body.map_err(|error| file.fail(error)).ok()?;
    Some(Shape::RoundedPolyhedron(Box::new(body)))
}

/// Corners of a box with edges of these lengths along x, y and z, about the origin [m].
fn corners_of_box(edges: &Vec3) -> Vec<Vec3> {
    let side = |corner: usize, axis: usize| if corner >> axis & 1 == 0 { -0.5 } else { 0.5 };
    (0..8).map(|corner| Vec3::from_fn(|axis, _| side(corner, axis) * edges[axis])).collect()
}

/// Result of `build` for corners given one by one, by a box or as a mesh.
fn solid<T>(
    section: &Section,
    folder: &Path,
    build: impl Fn(&[Vec3]) -> Result<T, HullError>,
) -> Option<T> {
    let scale = section.number_or("scale", 1.0);
    let ways = ["vertices", "edges", "file"].map(|key| section.get(key));
    if let ([Some(_), _, None] | [_, Some(_), None], Some(scale)) = (&ways, section.get("scale")) {
        scale.fail("only for a `file`; `vertices` and `edges` are in metres");
    }
    let (given, points) = match ways {
        [Some(vertices), None, None] => {
            let points: Option<Vec<Vec3>> = vertices.list()?.iter().map(Given::vector).collect();
            let points = points?;
            if let Err(error @ HullError::WithinFace { .. }) = corners_only(&points) {
                vertices.fail(error);
                return None;
            }
            (vertices, points)
        }
        [None, Some(edges), None] => {
            let lengths = edges.vector()?;
            (edges, corners_of_box(&lengths))
        }
        [None, None, Some(file)] => {
            let path = folder.join(file.text()?);
            let triangles = mesh::triangles(&path);
            if let Some(lost) =
                triangles.as_ref().ok().and_then(|all| mesh::lost_digits(&path, all))
            {
                file.warn(lost);
            }
            let scale = scale?;
            match triangles.and_then(|triangles| mesh::convex(triangles, scale)) {
                Ok(points) => (file, points),
                Err(error) => {
                    file.fail(error);
                    return None;
                }
            }
        }
        _ => {
            section.fail(
                "give one of `vertices` = [[x, y, z], ...] [m], `edges` = [x, y, z] of a box [m], or `file` with `scale`",
            );
            return None;
        }
    };
    build(&points).map_err(|error| given.fail(error)).ok()
}
