//! STL files, text or binary.

use super::{MeshError, malformed, three};
use crate::math::Vec3;
use crate::text;

/// Bytes of a binary file before its triangles: any text, then their number.
const HEADER: usize = 84;
/// Bytes of a triangle: a normal, three corners, a number of two bytes.
const RECORD: usize = 50;

pub(super) fn triangles(bytes: &[u8]) -> Result<Vec<[Vec3; 3]>, MeshError> {
    if is_text(bytes) { of_text(&text::lossy(bytes)) } else { of_bytes(bytes) }
}

/// Number of triangles in the header of a binary file.
fn count(bytes: &[u8]) -> Option<usize> {
    let count = bytes.get(HEADER - 4..HEADER)?.try_into().ok()?;
    Some(u32::from_le_bytes(count) as usize)
}

/// Whether a file is text.
///
/// The header may begin with `solid` in both formats, so the size decides. A text has no NUL, unless each character has two bytes.
pub(super) fn is_text(bytes: &[u8]) -> bool {
    let is_binary = count(bytes).is_some_and(|count| bytes.len() == HEADER + count * RECORD);
    let has_mark = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
    !is_binary && (has_mark || !bytes.contains(&0))
}

fn of_bytes(bytes: &[u8]) -> Result<Vec<[Vec3; 3]>, MeshError> {
    let size = bytes.len();
    let whole = |cause| MeshError::Malformed { place: String::new(), cause };
    let Some(count) = count(bytes) else {
        return Err(whole(format!(
            "a binary STL file has at least {HEADER} bytes, this one {size}: it is incomplete"
        )));
    };
    let records = bytes[HEADER..].chunks_exact(RECORD);
    if records.len() < count {
        return Err(whole(format!(
            "its header gives {count} triangles, but its bytes are for {}: it is incomplete, or not an STL file",
            records.len()
        )));
    }
    if records.len() > count {
        return Err(whole(format!(
            "it has {size} bytes, {} more than its {count} triangles",
            size - HEADER - count * RECORD
        )));
    }
    let number = |four: &[u8]| f64::from(f32::from_le_bytes([four[0], four[1], four[2], four[3]]));
    let triangle = |(k, record): (usize, &[u8])| {
        let corner = |at: usize| Vec3::from_fn(|axis, _| number(&record[12 * at + 4 * axis..]));
        let corners = [1, 2, 3].map(corner);
        if corners.iter().flatten().all(|x| x.is_finite()) {
            return Ok(corners);
        }
        Err(whole(format!("triangle {k} (the first is 0) has a coordinate that is not finite")))
    };
    records.enumerate().map(triangle).collect()
}

/// Nesting level of a line of text.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    Outside,
    Solid,
    Facet,
    Loop,
}

impl Place {
    /// Words with which a line may begin here.
    const fn words(self) -> &'static str {
        match self {
            Self::Outside => "`solid`",
            Self::Solid => "`facet` or `endsolid`",
            Self::Facet => "`outer loop` or `endfacet`",
            Self::Loop => "`vertex` or `endloop`",
        }
    }
}

/// Triangles of one or more solids. Normals are skipped, and so is all content before, between and after solids.
fn of_text(text: &str) -> Result<Vec<[Vec3; 3]>, MeshError> {
    let (mut triangles, mut corners) = (Vec::new(), Vec::new());
    let (mut place, mut last, mut has_solid) = (Place::Outside, 1, false);
    for (line, text) in (1..).zip(text.lines()) {
        let mut words = text.split_whitespace();
        let Some(word) = words.next().filter(|word| !word.starts_with('#')) else { continue };
        last = line;
        place = match (&*word.to_ascii_lowercase(), place) {
            ("solid", Place::Outside) => {
                has_solid = true;
                Place::Solid
            }
            ("outer", Place::Facet) if corners.is_empty() => Place::Loop,
            ("vertex", Place::Loop) => {
                corners.push(three(words, line)?);
                Place::Loop
            }
            ("facet", Place::Solid) | ("endloop", Place::Loop) => Place::Facet,
            ("endfacet", Place::Facet) => {
                let count = corners.len();
                let triangle = std::mem::take(&mut corners).try_into().map_err(|_| {
                    malformed(line, format!("this facet has {count} vertices; STL needs triangles"))
                })?;
                triangles.push(triangle);
                Place::Solid
            }
            ("endsolid", Place::Solid) => Place::Outside,
            (other, Place::Outside) if other != "facet" => Place::Outside,
            _ => {
                let (words, word) = (place.words(), text::shown(word));
                return Err(malformed(line, format!("expected {words}, not `{word}`")));
            }
        };
    }
    if place != Place::Outside {
        return Err(malformed(last, "the file ends before `endsolid`: it is incomplete"));
    }
    if !has_solid {
        return Err(malformed(1, "no line begins with `solid`, as needed in a text STL"));
    }
    Ok(triangles)
}
