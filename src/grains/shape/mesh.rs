//! Files of triangles, STL (text or binary) and OBJ, and particles from them.
//!
//! The mesh of a particle must be closed and convex; its triangles are only used to check that. Binary STL keeps seven digits, which sets the
//! tolerance.

mod obj;
mod stl;

use super::hull::{Hull, HullError, size};
use super::polyhedron::deepest;
use crate::math::{Vec3, bounds};
use crate::text::{self, Unreadable};
use std::collections::BTreeMap;
use std::path::Path;

/// Largest deviation of a mesh from convexity, relative to its size.
const CONVEX: f64 = 1e-5;
/// Half of the last of six digits, over the largest number, with a margin.
const SIX_DIGITS: f64 = 1e-6;
/// Corners nearer to each other than this part of the size are one, however they were rounded.
const SAME: f64 = 1e-8;
/// Distance from the origin, over its size, beyond which a mesh loses significant digits.
const FAR: f64 = 100.0;
/// Largest deviation of the volume from that of the hull, relative.
const CLOSED: f64 = 1e-3;

/// Reason why a file gives no particle.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// The file cannot be read.
    #[error(transparent)]
    Unreadable(#[from] Unreadable),
    /// The file has no triangles.
    #[error("{what}; an {format} file of triangles is needed")]
    NoTriangles {
        /// STL or OBJ.
        format: &'static str,
        /// Actual content.
        what: &'static str,
    },
    /// The content does not match the format.
    #[error("{place}{cause}; correct it, or export it again")]
    Malformed {
        /// Line of a text, or empty.
        place: String,
        /// Description of the error.
        cause: String,
    },
    /// A polygon that is not convex.
    #[error(
        "line {line}: has a face of {corners} corners that is not convex, from the corner ({:e}, {:e}, {:e}): divide \
         it into triangles",
        .corner.x, .corner.y, .corner.z
    )]
    Concave {
        /// Line number, from 1.
        line: usize,
        /// First corner, in units of the file.
        corner: Vec3,
        /// Number of corners.
        corners: usize,
    },
    /// The name ends neither in `.stl` nor in `.obj`.
    #[error("must end in .stl or .obj")]
    Ending,
    /// The convex hull cannot be built.
    #[error(transparent)]
    Hull(#[from] HullError),
    /// The mesh is not convex.
    #[error(
        "the mesh is not convex: its surface is up to {depth:.4e} m ({:.2} % of its size) inside its convex hull; \
         only convex particles are supported, as the hull itself",
        100.0 * depth / size
    )]
    Dented {
        /// Largest distance from the hull [m].
        depth: f64,
        /// Half the diagonal of the box around the mesh [m].
        size: f64,
    },
    /// The mesh has holes, or triangles facing inwards.
    #[error(
        "the mesh is not closed: its volume is {volume:.4e} m3, that of its convex hull {hull:.4e} m3; close its \
         holes, and orient all triangles outwards"
    )]
    Open {
        /// Volume of the mesh [m³].
        volume: f64,
        /// Volume of its convex hull [m³].
        hull: f64,
    },
}

/// Corners of the convex particle of these triangles [m], with lengths times `scale` (metres per unit of the file).
///
/// # Errors
/// If the mesh is not closed or not convex.
pub fn convex(mut triangles: Vec<[Vec3; 3]>, scale: f64) -> Result<Vec<Vec3>, MeshError> {
    triangles.iter_mut().flatten().for_each(|corner| *corner *= scale);
    corners(&triangles)
}

/// Corners of all triangles in a file, in its units.
///
/// # Errors
/// If the file cannot be read.
pub fn triangles(path: &Path) -> Result<Vec<[Vec3; 3]>, MeshError> {
    Ok(groups(path)?.into_iter().flat_map(|(_, triangles)| triangles).collect())
}

/// Triangles of a part of a file, with its name.
pub type Group = (String, Vec<[Vec3; 3]>);

/// Triangles of each object or group of an OBJ file, with its name; other files have one group.
///
/// # Errors
/// If the file cannot be read.
pub fn groups(path: &Path) -> Result<Vec<Group>, MeshError> {
    let (format, read): (_, fn(&[u8]) -> _) = if has_ending(path, "stl") {
        let all = |bytes: &[u8]| stl::triangles(bytes).map(|all| vec![(String::new(), all)]);
        ("STL", all)
    } else if has_ending(path, "obj") {
        ("OBJ", obj::groups)
    } else {
        return Err(MeshError::Ending);
    };
    let bytes = text::bytes(path)?;
    if bytes.is_empty() {
        return Err(MeshError::NoTriangles { format, what: "is empty" });
    }
    let mut groups: Vec<Group> = read(&bytes)?;
    groups.retain(|(_, triangles)| !triangles.is_empty());
    if groups.is_empty() {
        return Err(MeshError::NoTriangles { format, what: "has no triangles" });
    }
    Ok(groups)
}

/// Distinct corners of triangles, and the triangles by their indices.
///
/// Corners equal within rounding are merged. Triangles without an area are left out.
pub fn welded(triangles: &[[Vec3; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let corners = distinct(triangles);
    let near = SAME * size(&corners);
    let number = |corner: &Vec3| {
        let first = corners.partition_point(|known| known.x < corner.x - near);
        let is_it = |k: &usize| (corners[*k] - corner).norm() <= near;
        (first..corners.len()).find(is_it).map_or(0, |k| k as u32)
    };
    let numbers = triangles.iter().map(|triangle| [0, 1, 2].map(|k| number(&triangle[k])));
    let faces = numbers.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    (corners, faces)
}

/// A corner at an edge without a triangle of opposite direction on its other side; `None` for a closed surface.
pub fn open_edge(faces: &[[u32; 3]]) -> Option<u32> {
    let sides = |[a, b, c]: &[u32; 3]| [(*a, *b), (*b, *c), (*c, *a)];
    let mut open: BTreeMap<(u32, u32), i32> = BTreeMap::new();
    for (from, to) in faces.iter().flat_map(sides) {
        *open.entry((from, to)).or_default() += 1;
        *open.entry((to, from)).or_default() -= 1;
    }
    open.into_iter().find(|(_, count)| *count != 0).map(|((from, _), _)| from)
}

/// Warning about the seven digits of binary STL, for a mesh that is small and far from the origin of its file.
pub fn lost_digits(path: &Path, triangles: &[[Vec3; 3]]) -> Option<String> {
    let is_single = |x: &f64| f64::from(*x as f32) == *x;
    let mut coordinates = triangles.iter().flatten().flatten();
    if !has_ending(path, "stl") || !coordinates.all(is_single) {
        return None;
    }
    let (low, high) = bounds(triangles.as_flattened());
    let (offset, size) = (low.amax().max(high.amax()), 0.5 * (high - low).norm());
    (offset > FAR * size).then(|| {
        let lost = 0.5 * f64::from(f32::EPSILON) * offset / size;
        format!(
            "its distance from the origin of its file is {:.0} times its size, and binary STL has seven digits: \
             corners are off by up to {lost:.1e} of its size. Write it as OBJ, or near the origin",
            offset / size
        )
    })
}

/// Whether the name of a file has this ending, in lower or upper case.
pub fn has_ending(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(ending))
}

/// Error at a line of a text.
fn malformed(line: usize, cause: impl Into<String>) -> MeshError {
    MeshError::Malformed { place: format!("line {line}: "), cause: cause.into() }
}

/// The next three numbers of a line.
fn three<'a>(words: impl Iterator<Item = &'a str>, line: usize) -> Result<Vec3, MeshError> {
    let mut numbers = [f64::NAN; 3];
    let mut count = 0;
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = word.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| {
            let word = text::shown(word);
            malformed(
                line,
                format!("`{word}` is not a finite number; decimals are written with a point"),
            )
        })?;
        count += 1;
    }
    if count < 3 {
        return Err(malformed(line, format!("a corner needs three coordinates, not {count}")));
    }
    Ok(Vec3::from(numbers))
}

/// A polygon as triangles around its first corner, or by halves if it has many corners.
///
/// A polygon that is dented, or bent so much that it turns over, is an error, because the triangles do not cover it.
fn fan(corners: &[Vec3], line: usize) -> Result<Vec<[Vec3; 3]>, MeshError> {
    let [first, others @ ..] = corners else { return Ok(Vec::new()) };
    let triangles: Vec<[Vec3; 3]> = others.windows(2).map(|two| [*first, two[0], two[1]]).collect();
    let area = |[a, b, c]: &[Vec3; 3]| (b - a).cross(&(c - a));
    let upright: Vec3 = triangles.iter().map(area).sum();
    let (count, upright) = (corners.len(), upright.normalize());
    let (low, high) = bounds(corners);
    // Tolerance for a corner within a side, in a text of six digits.
    let rounding = CONVEX * (high - low).norm() + SIX_DIGITS * low.amax().max(high.amax());
    let is_dented = |corners: &[Vec3; 3]| {
        let chord = (corners[2] - corners[0]).norm();
        area(corners).dot(&upright) < -rounding * chord.max(rounding)
    };
    let three = |k: usize| [0, 1, 2].map(|next| corners[(k + next) % count]);
    // The corners of a star have no dent, but its triangles are turned over.
    if count > 3 && ((0..count).any(|k| is_dented(&three(k))) || triangles.iter().any(is_dented)) {
        return Err(MeshError::Concave { line, corner: *first, corners: count });
    }
    if count > LARGEST_FAN {
        let mut triangles = Vec::new();
        halve(corners, &mut triangles);
        return Ok(triangles);
    }
    Ok(triangles)
}

/// More triangles around one corner would be slivers next to each other.
const LARGEST_FAN: usize = 12;

/// Cuts a convex polygon into a triangle and two halves, and these recursively.
fn halve(corners: &[Vec3], into: &mut Vec<[Vec3; 3]>) {
    let [first, .., last] = corners else { return };
    let middle = corners.len() / 2;
    if corners.len() > 2 {
        into.push([*first, corners[middle], *last]);
        halve(&corners[..=middle], into);
        halve(&corners[middle..], into);
    }
}

/// Distinct corners of all triangles.
fn distinct(triangles: &[[Vec3; 3]]) -> Vec<Vec3> {
    let mut points: Vec<Vec3> = triangles.iter().flatten().copied().collect();
    if points.is_empty() {
        return points;
    }
    let near = SAME * size(&points);
    points.sort_by(|a, b| a.x.total_cmp(&b.x));
    let mut kept: Vec<Vec3> = Vec::new();
    for point in points {
        let mut close = kept.iter().rev().take_while(|k| point.x - k.x <= near);
        if !close.any(|k| (point - k).norm() <= near) {
            kept.push(point);
        }
    }
    kept
}

/// Corners of the hull of a closed and convex mesh.
fn corners(triangles: &[[Vec3; 3]]) -> Result<Vec<Vec3>, MeshError> {
    let mut points = distinct(triangles);
    let hull = Hull::of(&points)?;
    let size = size(&points);
    // A dent need not have a corner at its bottom.
    points.extend(
        triangles
            .iter()
            .flat_map(|[a, b, c]| [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5, (a + b + c) / 3.0]),
    );
    let (_, depth) = deepest(&hull, &points);
    if depth > CONVEX * size {
        return Err(MeshError::Dented { depth, size });
    }
    // Seen from inside: a hole whose plane contains the origin would not show.
    let origin = hull.vertices().iter().sum::<Vec3>() / hull.vertices().len() as f64;
    let volume = |[a, b, c]: [Vec3; 3]| (a - origin).dot(&(b - origin).cross(&(c - origin))) / 6.0;
    let mesh_volume: f64 = triangles.iter().map(|&t| volume(t)).sum();
    let corner = |k: u32| hull.vertices()[k as usize];
    let hull_volume: f64 = hull.triangles().iter().map(|t| volume(t.corners.map(corner))).sum();
    // Some programs let all triangles face inwards.
    if (mesh_volume.abs() - hull_volume).abs() > CLOSED * hull_volume {
        return Err(MeshError::Open { volume: mesh_volume.abs(), hull: hull_volume });
    }
    Ok(hull.vertices().to_vec())
}

#[cfg(test)]
mod tests {
    use super::{MeshError, corners, stl};
    use crate::math::Vec3;
    use std::fmt::Write;

    /// A cube, two triangles for each side.
    fn cube() -> Vec<[Vec3; 3]> {
        let mut triangles = Vec::new();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let at = |u: f64, v: f64| {
                    let mut corner = Vec3::zeros();
                    corner[axis] = side;
                    corner[(axis + 1) % 3] = u * side;
                    corner[(axis + 2) % 3] = v;
                    corner
                };
                let [a, b, c, d] = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        triangles
    }

    #[test]
    fn a_hole_on_any_side_is_found() {
        assert_eq!(corners(&cube()).unwrap().len(), 8);
        for side in 0..6 {
            let mut open = cube();
            open.drain(2 * side..2 * side + 2);
            assert!(matches!(corners(&open), Err(MeshError::Open { .. })), "{side}");
        }
    }

    #[test]
    fn all_patches_of_a_text_are_read() {
        let mut text = String::new();
        for patch in cube().chunks(5) {
            text += "solid\n";
            for triangle in patch {
                text += " facet normal 0 0 0\n  outer loop\n";
                for corner in triangle {
                    writeln!(text, "   vertex {} {} {}", corner.x, corner.y, corner.z).unwrap();
                }
                text += "  endloop\n endfacet\n";
            }
            text += "endsolid\n";
        }
        assert_eq!(stl::triangles(text.as_bytes()).unwrap(), cube());
    }
}
