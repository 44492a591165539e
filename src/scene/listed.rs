//! Particles of a CSV file: a header, then one row for each.
//!
//! Columns in any order: `x,y,z` [m]. Optional, each group complete or absent: `qw,qx,qy,qz` (body to world, of any
//! length), `vx,vy,vz` [m/s], `wx,wy,wz` [rad/s, world axes]. `shape` (a name) is optional if there is only one; `scale`,
//! lengths over those of the shape, is 1 by default. Lines that begin with `#` are comments.

use super::Listed;
use super::mistakes::suggestion;
use crate::ids::ShapeId;
use crate::math::{Quat, Vec3};
use crate::text::{self, Lines, shown};
use csv::StringRecord;
use nalgebra::Quaternion;
use std::path::Path;

/// Number of errors of a file that are listed; the others are counted.
const SHOWN: usize = 5;

const COLUMNS: [&str; 15] =
    ["x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz", "shape", "scale"];

/// Particles of a file, or its errors. `wrong` returns the reason why a particle is not allowed; messages count ids from
/// `first_id`.
pub(super) fn read(
    path: &Path,
    shapes: &[&str],
    first_id: u64,
    wrong: &dyn Fn(&Listed) -> Option<String>,
) -> Result<Vec<Listed>, Vec<String>> {
    let text = text(path)?;
    let lines = Lines::of(&text);
    let mut reader = reader(&text);
    let header = header(&mut reader)?;
    let columns = Columns::find(&header, shapes).map_err(few)?;

    let mut rows = Vec::new();
    let mut mistakes = Vec::new();
    for (k, record) in reader.records().enumerate() {
        let line = |record: &StringRecord| line_of(record, &text, &lines);
        match record {
            Err(error) => mistakes.push(error.to_string()),
            Ok(record) => match columns.row(&record, shapes) {
                Err(what) => mistakes.push(format!("line {}, {what}", line(&record))),
                Ok(row) => {
                    if let Some(why) = wrong(&row) {
                        let [x, y, z]: [f64; 3] = row.position.into();
                        let id = first_id + k as u64;
                        mistakes.push(format!(
                            "line {}, particle {id} at [{x:?}, {y:?}, {z:?}] m is {why}",
                            line(&record)
                        ));
                    }
                    rows.push(row);
                }
            },
        }
    }
    if mistakes.is_empty() && rows.is_empty() {
        mistakes.push("the file lists no particles".to_owned());
    }
    if mistakes.is_empty() {
        return Ok(rows);
    }
    Err(few(mistakes))
}

/// The text of a table.
pub(super) fn text(path: &Path) -> Result<String, Vec<String>> {
    text::read(path).map_err(|error| vec![format!("{} {error}", path.display())])
}

/// Cells separated by commas, with comments.
pub(super) fn reader(text: &str) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .flexible(true)
        .from_reader(text.as_bytes())
}

/// The names of columns.
pub(super) fn header(reader: &mut csv::Reader<&[u8]>) -> Result<StringRecord, Vec<String>> {
    let header = reader.headers().map_err(|error| vec![error.to_string()])?.clone();
    let other = header.iter().next().and_then(|first| first.chars().find(|c| ";\t".contains(*c)));
    if let (1, Some(other)) = (header.len(), other) {
        return Err(vec![format!(
            "columns are separated by {other:?} here; write commas, and decimals with a point"
        )]);
    }
    Ok(header)
}

/// First errors, and the number of further ones.
pub(super) fn few(mut mistakes: Vec<String>) -> Vec<String> {
    if mistakes.len() > SHOWN {
        let more = mistakes.len() - SHOWN;
        mistakes.truncate(SHOWN);
        mistakes.push(format!("{more} more mistakes like these"));
    }
    mistakes
}

/// Line of a record. Its position may be before blank lines and comments.
pub(super) fn line_of(record: &StringRecord, text: &str, lines: &Lines) -> usize {
    let begin = record.position().map_or(0, |position| position.byte() as usize);
    let is_skipped = |line: &&str| line.trim().is_empty() || line.starts_with('#');
    lines.at(begin) + text[begin..].lines().take_while(is_skipped).count()
}

/// Position of each group of columns.
struct Columns {
    header: StringRecord,
    position: [usize; 3],
    quaternion: Option<[usize; 4]>,
    velocity: Option<[usize; 3]>,
    angular_velocity: Option<[usize; 3]>,
    shape: Option<usize>,
    scale: Option<usize>,
}

impl Columns {
    fn find(header: &StringRecord, shapes: &[&str]) -> Result<Self, Vec<String>> {
        let mut mistakes = Vec::new();
        let mut known: Vec<&str> = Vec::new();
        for name in header {
            if !COLUMNS.contains(&name) {
                let hint = suggestion(name, COLUMNS, "allowed");
                mistakes.push(format!("no such column as `{}`{hint}", shown(name)));
            } else if known.contains(&name) {
                mistakes.push(format!("there are two columns `{name}`"));
            } else {
                known.push(name);
            }
        }
        let at = |name: &str| header.iter().position(|column| column == name);
        let mut group = |names: &[&str], needed: bool| {
            let missing: Vec<&str> =
                names.iter().copied().filter(|name| at(name).is_none()).collect();
            if !missing.is_empty() && (needed || missing.len() < names.len()) {
                mistakes.push(format!("column {} is missing", missing.join(", ")));
            }
            names.iter().map(|name| at(name)).collect::<Option<Vec<_>>>()
        };
        let position = group(&["x", "y", "z"], true);
        let quaternion = group(&["qw", "qx", "qy", "qz"], false);
        let velocity = group(&["vx", "vy", "vz"], false);
        let angular_velocity = group(&["wx", "wy", "wz"], false);
        let shape = group(&["shape"], shapes.len() > 1);
        let scale = group(&["scale"], false);
        let three = |columns: Vec<usize>| [columns[0], columns[1], columns[2]];
        match position {
            Some(position) if mistakes.is_empty() => Ok(Self {
                header: header.clone(),
                position: three(position),
                quaternion: quaternion.map(|c| [c[0], c[1], c[2], c[3]]),
                velocity: velocity.map(three),
                angular_velocity: angular_velocity.map(three),
                shape: shape.map(|c| c[0]),
                scale: scale.map(|c| c[0]),
            }),
            _ => Err(mistakes),
        }
    }

    fn row(&self, record: &StringRecord, shapes: &[&str]) -> Result<Listed, String> {
        if record.iter().skip(self.header.len()).any(|cell| !cell.is_empty()) {
            return Err(format!(
                "it has {} cells, but there are {} columns; decimals are written with a point",
                record.len(),
                self.header.len()
            ));
        }
        let cell = |column: usize| record.get(column).unwrap_or_default();
        let number = |column: usize| match cell(column).parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            _ => Err(format!(
                "column {}: `{}` is not a number",
                &self.header[column],
                shown(cell(column))
            )),
        };
        let vector = |columns: [usize; 3]| -> Result<Vec3, String> {
            let [x, y, z] = columns.map(number);
            Ok(Vec3::new(x?, y?, z?))
        };
        let position = vector(self.position)?;
        let quaternion = match self.quaternion {
            None => Quat::identity(),
            Some(columns) => {
                let [w, x, y, z] = columns.map(number);
                let quaternion = Quaternion::new(w?, x?, y?, z?);
                let largest = quaternion.coords.amax();
                if largest == 0.0 {
                    return Err("the quaternion is 0; it needs a length".to_owned());
                }
                Quat::new_normalize(quaternion / largest)
            }
        };
        let shape = match self.shape.map(cell) {
            None => 0,
            Some(name) => shapes.iter().position(|shape| *shape == name).ok_or_else(|| {
                let hint = suggestion(name, shapes.iter().copied(), "there are");
                format!("column shape: no such shape as `{}`{hint}", shown(name))
            })?,
        };
        let scale = self.scale.map_or(Ok(1.0), number)?;
        if scale <= 0.0 {
            return Err(format!("column scale: {scale:?} must be greater than 0"));
        }
        Ok(Listed {
            shape: ShapeId(shape as u16),
            scale,
            position,
            quaternion,
            velocity: self.velocity.map_or_else(|| Ok(Vec3::zeros()), vector)?,
            angular_velocity: self.angular_velocity.map_or_else(|| Ok(Vec3::zeros()), vector)?,
        })
    }
}
