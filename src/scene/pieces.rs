//! Unions: convex pieces from the parsed file.
//!
//! | given | pieces |
//! |---|---|
//! | `pieces = [{ shape, at, turn }, ...]` | other shapes of the scene |
//! | `file` in `.obj` with several groups, or `files` | each group or file, closed and convex |
//! | `file` in `.obj` or `.stl` and a number of `pieces` | a closed mesh of any form, cut by V-HACD (Mamou 2016, as in `parry3d`) |
//! | any other `file` | balls, a line `x y z r` each |

use super::reader::{Given, Section};
use crate::math::{Quat, Vec3, rotation_about};
use crate::shape::hull::HullError;
use crate::shape::mesh::{self, MeshError};
use crate::shape::moments::{Moments, Placement, Principal};
use crate::shape::union::Piece;
use crate::shape::{Convex as _, Polyhedron, Shape, Sphere, Union};
use crate::text;
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::vhacd::{VHACD, VHACDParameters};
use std::collections::BTreeMap;
use std::path::Path;

/// Default distance of the pieces of a mesh from it, over its size.
const TOLERANCE: f64 = 0.05;

/// Rotation by an angle about an axis through the origin.
pub(super) fn turn(given: &Given) -> Option<Quat> {
    let section = given.section()?;
    let axis = section.require("axis").and_then(|given| given.direction());
    let angle = section.number("angle");
    Some(rotation_about(&axis?, angle?.to_radians()))
}

/// The union of a section. `find` returns shapes by their names; paths are relative to the folder. `kept` returns the union
/// of this name in an earlier snapshot.
pub(super) fn union(
    section: &Section,
    find: impl Fn(&Given) -> Option<Shape>,
    folder: &Path,
    kept: impl Fn(&str) -> Option<Union>,
) -> Option<Shape> {
    let scale = section.number_or("scale", 1.0);
    let tolerance = section.number_or("tolerance", TOLERANCE);
    let pieces = match ["pieces", "file", "files"].map(|key| section.get(key)) {
        [Some(pieces), None, None] if pieces.as_number().is_none() => {
            for of_files in ["scale", "tolerance"] {
                section.refuse(of_files, "needs a `file`");
            }
            let all: Vec<_> = pieces.list()?.iter().map(|given| piece(given, &find)).collect();
            all.into_iter().collect::<Option<Vec<Piece>>>()?
        }
        [Some(count), Some(file), None] => {
            let wanted = CutSettings { count: count.whole()? as u32, tolerance: tolerance? };
            let name = section.get("name");
            let kept = || name.as_ref().and_then(Given::text).and_then(&kept);
            return cut(&file, &folder.join(file.text()?), scale?, &wanted, kept);
        }
        [None, Some(file), None] => of_files(&[file], section, folder, scale?)?,
        [None, None, Some(files)] => of_files(&files.list()?, section, folder, scale?)?,
        _ => {
            section.fail(
                "give `pieces` = [{ shape = \"...\", at = [x, y, z] }, ...], or `file`, or `files`. A file is an OBJ \
                 of convex groups, a list of balls (x y z r), or, with a number of `pieces`, a closed mesh to \
                 decompose",
            );
            return None;
        }
    };
    let body = Union::new(pieces).map_err(|error| section.fail(error)).ok()?;
    Some(Shape::Union(Box::new(body)))
}

/// A shape of the scene, placed in its axes of definition.
fn piece(given: &Given, find: impl Fn(&Given) -> Option<Shape>) -> Option<Piece> {
    let section = given.section()?;
    let shape = section.require("shape").and_then(|given| find(&given));
    let at = section.vector_or("at", Vec3::zeros());
    let turn = section.read_or("turn", Quat::identity(), turn);
    let (shape, at, turn) = (shape?, at?, turn?);
    Some(placed(shape, &at, &turn))
}

/// A shape with its axes of definition at this place and rotation.
fn placed(shape: Shape, at: &Vec3, turn: &Quat) -> Piece {
    let upright = Placement { centre: Vec3::zeros(), axes: Quat::identity() };
    let own = shape.placement().copied().unwrap_or(upright);
    Piece { shape, centre: at + turn * own.centre, rotation: turn * own.axes }
}

/// Pieces from files.
fn of_files(all: &[Given], section: &Section, folder: &Path, scale: f64) -> Option<Vec<Piece>> {
    section.refuse("tolerance", "needs a mesh with a number of `pieces`");
    let mut pieces = Vec::new();
    for given in all {
        let path = folder.join(given.text()?);
        let is_mesh = ["stl", "obj"].iter().any(|ending| mesh::has_ending(&path, ending));
        let of_file = if is_mesh { groups(&path, scale) } else { balls(&path, scale) };
        pieces.extend(of_file.map_err(|error| given.fail(error)).ok()?);
    }
    Some(pieces)
}

/// Each group of a mesh.
fn groups(path: &Path, scale: f64) -> Result<Vec<Piece>, String> {
    let groups = mesh::groups(path).map_err(|error| error.to_string())?;
    let count = groups.len();
    let piece = |(name, triangles): (String, Vec<[Vec3; 3]>)| {
        let body = mesh::convex(triangles, scale)
            .and_then(|corners| Polyhedron::new(&corners).map_err(MeshError::from));
        let told = |error: MeshError| match (count, error) {
            (1, error @ (MeshError::Dented { .. } | MeshError::Open { .. })) => {
                format!("{error}; or decompose it with a number of `pieces`, as pieces = 16")
            }
            (1, error) => error.to_string(),
            (_, error) => format!("group {}: {error}", text::shown(&name)),
        };
        let body = body.map_err(told)?;
        Ok(placed(Shape::Polyhedron(Box::new(body)), &Vec3::zeros(), &Quat::identity()))
    };
    groups.into_iter().map(piece).collect()
}

/// Balls, one per line: centre and radius, separated by blanks or commas. Empty lines, text after `#` and a first line of
/// words are skipped.
fn balls(path: &Path, scale: f64) -> Result<Vec<Piece>, String> {
    let text = text::read(path).map_err(|error| error.to_string())?;
    let mut pieces = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.split('#').next().unwrap_or_default();
        let words: Vec<&str> =
            line.split(|c: char| c == ',' || c.is_whitespace()).filter(|w| !w.is_empty()).collect();
        let numbers: Vec<Option<f64>> =
            words.iter().map(|word| word.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        match numbers[..] {
            [] => {}
            [Some(x), Some(y), Some(z), Some(r), ..] if r > 0.0 => {
                let ball = Shape::Sphere(Sphere { radius: r * scale });
                pieces.push(placed(ball, &(Vec3::new(x, y, z) * scale), &Quat::identity()));
            }
            [None, ..] if pieces.is_empty() => {}
            _ => {
                return Err(format!(
                    "line {number}: `{}` is not a ball: write centre and radius, x y z r, with r greater than 0",
                    text::shown(line.trim())
                ));
            }
        }
    }
    Ok(pieces)
}

/// Number of cells along the longest side of a mesh when it is cut.
const RESOLUTION: u32 = 64;
/// Largest volume that a part may lack to its hull before it is cut again, over its volume.
const CONCAVITY: f64 = 0.001;

/// Library and settings of the cut, for `--plan`.
pub(super) fn cut_by() -> String {
    format!(
        "V-HACD of parry3d-f64 0.31, {RESOLUTION} cells along its longest side, concavity {CONCAVITY}"
    )
}

/// Settings of the cut of a mesh.
struct CutSettings {
    /// Largest number of pieces.
    count: u32,
    /// Largest distance of the pieces from the mesh, over the radius of the body.
    tolerance: f64,
}

impl CutSettings {
    fn is_near(&self, body: &Union) -> bool {
        body.far() <= self.tolerance * body.bounding_radius()
    }

    /// Was a union cut from a mesh with these moments and settings? Then it is kept, even if the library would now cut
    /// differently.
    fn is_it(&self, body: &Union, mesh: &Principal) -> bool {
        let is_same = body.volume() == mesh.volume && body.gyration() == mesh.gyration;
        is_same && body.asked() == self.count && self.is_near(body)
    }
}

/// A closed mesh of any form cut into pieces, or its earlier pieces. Volume, centre and moments of inertia are the mesh's.
fn cut(
    given: &Given,
    path: &Path,
    scale: f64,
    wanted: &CutSettings,
    kept: impl Fn() -> Option<Union>,
) -> Option<Shape> {
    let mut triangles = mesh::triangles(path).map_err(|error| given.fail(error)).ok()?;
    triangles.iter_mut().flatten().for_each(|corner| *corner *= scale);
    let (corners, faces) = mesh::welded(&triangles);
    if let Some(open) = mesh::open_edge(&faces) {
        let at = corners[open as usize];
        given.fail(format!(
            "is not closed: an edge at ({:e}, {:e}, {:e}) m has only one triangle; close its holes, and orient all \
             triangles outwards",
            at.x, at.y, at.z
        ));
        return None;
    }
    let moments = Moments::of_surface(&triangles);
    if moments.volume() <= 0.0 {
        given.fail("has no positive volume: orient its triangles outwards");
        return None;
    }
    let principal = moments.principal();
    if let Some(body) = kept().filter(|body| wanted.is_it(body, &principal)) {
        return Some(Shape::Union(Box::new(body)));
    }
    let pieces = hulls(&corners, &faces, wanted.count).map_err(|error| given.fail(error)).ok()?;
    let body = Union::in_surface(pieces, &triangles).map_err(|error| given.fail(error)).ok()?;
    if !wanted.is_near(&body) {
        let (size, far) = (body.bounding_radius(), body.far());
        given.fail(format!(
            "{} pieces are up to {far:.3e} m ({:.1} % of its radius) from the mesh, more than `tolerance` = {}: use \
             more `pieces`, or another tolerance",
            body.pieces().len(),
            100.0 * far / size,
            wanted.tolerance
        ));
        return None;
    }
    Some(Shape::Union(Box::new(body.of_at_most(wanted.count))))
}

/// Convex hulls of the parts into which a surface is cut, at most `count`.
///
/// # Errors
/// The reason why a part is invalid.
fn hulls(corners: &[Vec3], faces: &[[u32; 3]], count: u32) -> Result<Vec<Piece>, String> {
    let parameters = VHACDParameters {
        resolution: RESOLUTION,
        concavity: CONCAVITY,
        max_convex_hulls: count,
        ..VHACDParameters::default()
    };
    let points: Vec<Vector> = corners.iter().map(|at| Vector::new(at.x, at.y, at.z)).collect();
    let parts = VHACD::decompose(&parameters, &points, faces, true);
    let mut bodies = Vec::new();
    for (hull, _) in parts.compute_exact_convex_hulls(&points, faces) {
        let corners: Vec<Vec3> = hull.iter().map(|at| Vec3::new(at.x, at.y, at.z)).collect();
        bodies.extend(around(corners)?);
    }
    let place = |body: Polyhedron| {
        placed(Shape::Polyhedron(Box::new(body)), &Vec3::zeros(), &Quat::identity())
    };
    Ok(joined(bodies, count as usize)?.into_iter().map(place).collect())
}

/// The hull of points, which may contain duplicates; `None` if it has no volume.
fn around(mut points: Vec<Vec3>) -> Result<Option<Polyhedron>, String> {
    loop {
        match Polyhedron::around(&points) {
            Ok(body) => return Ok(Some(body)),
            Err(HullError::Same { second, .. }) => drop(points.swap_remove(second)),
            // A part without volume adds nothing.
            Err(HullError::Flat | HullError::TooFew { .. }) => return Ok(None),
            Err(error) => return Err(format!("cannot be cut: {error}")),
        }
    }
}

/// Joins pieces until there are at most `count`, because cutting by halves may leave twice as many. The two whose common
/// hull adds the least volume are joined first.
fn joined(bodies: Vec<Polyhedron>, count: usize) -> Result<Vec<Polyhedron>, String> {
    let mut left = bodies.len();
    let mut bodies: Vec<Option<Polyhedron>> = bodies.into_iter().map(Some).collect();
    let mut common: BTreeMap<[usize; 2], (f64, Polyhedron)> = BTreeMap::new();
    let mut known = 0;
    while left > count {
        for other in known..bodies.len() {
            for one in 0..other {
                let [Some(a), Some(b)] = [&bodies[one], &bodies[other]] else { continue };
                if are_near(a, b)
                    && let Some(hull) = around([a, b].map(corners_of).concat())?
                {
                    common.insert([one, other], (hull.volume() - a.volume() - b.volume(), hull));
                }
            }
        }
        known = bodies.len();
        let least = common.iter().min_by(|(_, (a, _)), (_, (b, _))| a.total_cmp(b));
        let Some((&pair, _)) = least else {
            return Err(format!("{left} of its parts do not touch: use as many `pieces`"));
        };
        bodies.push(common.remove(&pair).map(|(_, hull)| hull));
        for k in pair {
            bodies[k] = None;
        }
        common.retain(|of, _| !of.iter().any(|k| pair.contains(k)));
        left -= 1;
    }
    Ok(bodies.into_iter().flatten().collect())
}

/// Corners in the axes of the file.
fn corners_of(body: &Polyhedron) -> Vec<Vec3> {
    let Placement { centre, axes } = body.placement();
    body.hull().vertices().iter().map(|corner| centre + axes * corner).collect()
}

/// Do balls around two bodies overlap?
fn are_near(one: &Polyhedron, other: &Polyhedron) -> bool {
    let apart = (one.placement().centre - other.placement().centre).norm();
    apart < one.bounding_radius() + other.bounding_radius()
}
