//! Files of triangles: STL (text or binary) and OBJ; and grains from them.
//!
//! The mesh of a grain must be closed and convex; what it says of its surface is only used to check that. STL keeps
//! seven digits, which sets the tolerance.

use super::hull::{Hull, HullError, size};
use super::polyhedron::deepest;
use crate::math::{Vec3, bounds};
use std::io::Cursor;
use std::path::Path;

/// How far a mesh may be from convex, relative to its size.
const CONVEX: f64 = 1e-5;
/// Half of the last of six digits, over the largest number, and a little more.
const SIX_DIGITS: f64 = 1e-6;
/// Corners nearer to each other than this part of the size are one, however they were rounded.
const SAME: f64 = 1e-8;
/// How far its volume may be from that of its hull, relative.
const CLOSED: f64 = 1e-3;

/// Why a file gives no grain.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// No file.
    #[error("cannot be read: {0}")]
    Unreadable(std::io::Error),
    /// Not what its name says.
    #[error("is not a whole {format} file: {cause}; write it anew with the program that made it")]
    Malformed {
        /// STL or OBJ.
        format: &'static str,
        /// What the library says.
        cause: String,
    },
    /// A polygon with a dent.
    #[error(
        "has a face of {corners} corners that is not convex, from the corner ({:e}, {:e}, {:e}): cut it into triangles with the program that made it",
        .corner.x, .corner.y, .corner.z
    )]
    Concave {
        /// Its first corner, in units of the file.
        corner: Vec3,
        /// How many it has.
        corners: usize,
    },
    /// Neither STL nor OBJ.
    #[error("must end in .stl or .obj")]
    Ending,
    /// No hull.
    #[error(transparent)]
    Hull(#[from] HullError),
    /// A dent.
    #[error(
        "the mesh is not convex: its surface lies up to {depth:.4e} m ({:.2} % of its size) inside \
         its convex hull; only convex grains can be simulated, as the hull itself",
        100.0 * depth / size
    )]
    Dented {
        /// Largest distance from the hull [m].
        depth: f64,
        /// Half the diagonal of the box around the mesh [m].
        size: f64,
    },
    /// Holes, or triangles facing inwards.
    #[error(
        "the mesh is not closed: it holds {volume:.4e} m3, its convex hull {hull:.4e} m3; close its \
         holes, and let all triangles face outwards"
    )]
    Open {
        /// Of the mesh [m³].
        volume: f64,
        /// Of its convex hull [m³].
        hull: f64,
    },
}

/// The corners of the convex grain in a file, lengths times `scale` (metres per unit of the file) [m].
///
/// # Errors
/// If the file cannot be read, or its mesh is not closed or not convex.
pub fn read(path: &Path, scale: f64) -> Result<Vec<Vec3>, MeshError> {
    let mut triangles = triangles(path)?;
    triangles.iter_mut().flatten().for_each(|corner| *corner *= scale);
    corners(&triangles)
}

/// The corners of all triangles in a file, in its units.
///
/// # Errors
/// If the file cannot be read.
pub fn triangles(path: &Path) -> Result<Vec<[Vec3; 3]>, MeshError> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("stl" | "STL") => stl(path),
        Some("obj" | "OBJ") => obj(path),
        _ => Err(MeshError::Ending),
    }
}

fn malformed(format: &'static str, cause: &impl ToString) -> MeshError {
    MeshError::Malformed { format, cause: cause.to_string() }
}

fn stl(path: &Path) -> Result<Vec<[Vec3; 3]>, MeshError> {
    let mut bytes = crate::files::read(path).map_err(MeshError::Unreadable)?;
    let malformed = |error: std::io::Error| malformed("STL", &error);
    let mut triangles = Vec::new();
    let size = bytes.len();
    let solids = solids(&bytes);
    let is_binary = solids.is_empty();
    if let Some(first) = bytes.first_mut().filter(|_| is_binary) {
        // The library takes one that calls itself `solid` for a text.
        *first = b' ';
    }
    for solid in if is_binary { vec![bytes] } else { solids } {
        let mut reader = Cursor::new(&solid);
        let corners = |t: stl_io::Triangle| t.vertices.map(|v| Vec3::from(v.0.map(f64::from)));
        for triangle in stl_io::create_stl_reader(&mut reader).map_err(malformed)? {
            triangles.push(triangle.map(corners).map_err(malformed)?);
        }
        // A binary file says how many there are.
        if is_binary && size >= HEADER + (triangles.len() + 1) * RECORD {
            return Err(MeshError::Malformed {
                format: "STL",
                cause: format!(
                    "it has {size} bytes, {} more than its {} triangles",
                    size - HEADER - triangles.len() * RECORD,
                    triangles.len()
                ),
            });
        }
    }
    Ok(triangles)
}

/// Bytes of a binary STL before its triangles.
const HEADER: usize = 84;
/// Bytes of a triangle in it.
const RECORD: usize = 50;

/// Of a text the patches one by one, for the library reads no more than the first, and only if it has a name; none of a
/// binary file.
fn solids(bytes: &[u8]) -> Vec<Vec<u8>> {
    const MARK: &[u8] = "\u{feff}".as_bytes();
    let bytes = bytes.strip_prefix(MARK).unwrap_or(bytes).trim_ascii_start();
    if !bytes.get(..5).is_some_and(|start| start.eq_ignore_ascii_case(b"solid")) {
        return Vec::new();
    }
    let text = String::from_utf8_lossy(bytes).to_lowercase().replace('\r', "\n");
    if !text.contains("facet") {
        return Vec::new();
    }
    let mut solids: Vec<Vec<u8>> = Vec::new();
    for line in text.lines().map(str::trim) {
        if line.starts_with("solid") {
            solids.push(b"solid patch\n".to_vec());
        } else if let Some(solid) = solids.last_mut() {
            // Nobody asks for normals, which may be no numbers.
            let line = if line.starts_with("facet") { "facet normal 0 0 0" } else { line };
            solid.extend(line.bytes().chain([b'\n']));
        }
    }
    solids
}

fn obj(path: &Path) -> Result<Vec<[Vec3; 3]>, MeshError> {
    let bytes = crate::files::read(path).map_err(MeshError::Unreadable)?;
    // The library takes lines for faces.
    let is_line = |line: &&[u8]| matches!(line.trim_ascii_start(), [b'l', next, ..] if next.is_ascii_whitespace());
    let text: Vec<&[u8]> =
        bytes.split(|byte| *byte == b'\n').filter(|line| !is_line(line)).collect();
    let text = text.join(&b'\n');
    // Materials say nothing of a shape.
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let options = tobj::LoadOptions::default();
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(text), &options, no_materials)
        .map_err(|error| malformed("OBJ", &error))?;
    let mut triangles = Vec::new();
    for mesh in models.iter().map(|model| &model.mesh) {
        let corner = |k: u32| Vec3::from_row_slice(&mesh.positions[3 * k as usize..][..3]);
        // None where all are triangles.
        let counts = (!mesh.face_arities.is_empty()).then_some(&mesh.face_arities);
        let counts = counts.into_iter().flatten().map(|&count| count as usize);
        let mut rest = &*mesh.indices;
        for count in counts.chain(std::iter::repeat(3)) {
            let Some((face, others)) = rest.split_at_checked(count).filter(|_| !rest.is_empty())
            else {
                break;
            };
            rest = others;
            let corners: Vec<Vec3> = face.iter().map(|&k| corner(k)).collect();
            triangles.extend(fan(&corners)?);
        }
    }
    Ok(triangles)
}

/// A polygon as triangles around its first corner. Where it is dented, or bent so much that it is turned over, they do not cover it.
fn fan(corners: &[Vec3]) -> Result<Vec<[Vec3; 3]>, MeshError> {
    let [first, others @ ..] = corners else { return Ok(Vec::new()) };
    let triangles: Vec<[Vec3; 3]> = others.windows(2).map(|two| [*first, two[0], two[1]]).collect();
    let area = |[a, b, c]: &[Vec3; 3]| (b - a).cross(&(c - a));
    let upright: Vec3 = triangles.iter().map(area).sum();
    let (count, upright) = (corners.len(), upright.normalize());
    let (low, high) = bounds(corners);
    // A corner within a side, in a text of six digits.
    let rounding = CONVEX * (high - low).norm() + SIX_DIGITS * low.amax().max(high.amax());
    let is_dented = |corners: &[Vec3; 3]| {
        let chord = (corners[2] - corners[0]).norm();
        area(corners).dot(&upright) < -rounding * chord.max(rounding)
    };
    let three = |k: usize| [0, 1, 2].map(|next| corners[(k + next) % count]);
    // A star has no dent; its triangles are turned over.
    if count > 3 && ((0..count).any(|k| is_dented(&three(k))) || triangles.iter().any(is_dented)) {
        return Err(MeshError::Concave { corner: *first, corners: count });
    }
    Ok(triangles)
}

/// The corners of all triangles, each only once.
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

/// The corners of the hull of a closed and convex mesh.
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
    // From inside: a hole whose plane holds the origin would not show.
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
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        assert_eq!(stl(file.path()).unwrap(), cube());
    }
}
