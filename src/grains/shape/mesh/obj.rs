//! Corners and faces of OBJ files; all other content is ignored.

use super::{Group, MeshError, fan, malformed, three};
use crate::math::Vec3;
use crate::text;
use std::borrow::Cow;

/// Triangles of each object or group.
pub(super) fn groups(bytes: &[u8]) -> Result<Vec<Group>, MeshError> {
    let text = text::lossy(bytes);
    let mut corners: Vec<Vec3> = Vec::new();
    // Indices of corners, which may come later, the line, and the group.
    let mut faces: Vec<(usize, Vec<usize>, usize)> = Vec::new();
    let mut groups: Vec<Group> = vec![(String::new(), Vec::new())];
    let mut lines = (1..).zip(text.lines());
    while let Some((line, text)) = lines.next() {
        let mut text = Cow::Borrowed(text);
        while let Some(begin) = text.strip_suffix('\\') {
            text = Cow::Owned(format!("{begin} {}", lines.next().map_or("", |(_, more)| more)));
        }
        let mut words = text.split_whitespace();
        match words.next() {
            Some("v") => corners.push(three(words, line)?),
            Some("f") => {
                let index = |word| index(word, corners.len(), line);
                let words = words.take_while(|word| !word.starts_with('#'));
                let corners = words.map(index).collect::<Result<_, _>>()?;
                faces.push((line, corners, groups.len() - 1));
            }
            Some("o" | "g") => groups.push((words.collect::<Vec<_>>().join(" "), Vec::new())),
            _ => {}
        }
    }
    for (line, face, group) in faces {
        let corner = |&k: &usize| {
            corners.get(k).copied().ok_or_else(|| {
                malformed(
                    line,
                    format!("this face has the corner {}; the file has {}", k + 1, corners.len()),
                )
            })
        };
        let face: Vec<Vec3> = face.iter().map(corner).collect::<Result<_, _>>()?;
        groups[group].1.extend(fan(&face, line)?);
    }
    Ok(groups)
}

/// Index of a corner, from 0, for a word like `7`, `-1` (the last before this line) or `7/2/5`.
fn index(word: &str, count: usize, line: usize) -> Result<usize, MeshError> {
    let number: Option<i64> = word.split('/').next().and_then(|number| number.parse().ok());
    let index = match number {
        Some(number @ 1..) => usize::try_from(number - 1).ok(),
        Some(number) if number < 0 => {
            usize::try_from(number.unsigned_abs()).ok().and_then(|back| count.checked_sub(back))
        }
        _ => None,
    };
    index.ok_or_else(|| {
        let word = text::shown(word);
        malformed(
            line,
            format!(
                "`{word}` is not a corner of a face; the first is 1, and -1 the last of {count} \
             before this line"
            ),
        )
    })
}
