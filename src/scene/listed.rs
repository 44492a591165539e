//! Particles of a CSV file: a header, then one row each.
//!
//! Columns in any order: `x,y,z` [m]; and, each group whole or not at all, `qw,qx,qy,qz` (body to
//! world, of any length), `vx,vy,vz` [m/s], `wx,wy,wz` [rad/s, world axes]; and `shape` (a name),
//! which may be missing if there is only one; and `scale`, lengths over those of the shape, 1 where it is missing. Lines that begin with `#` are comments.

use super::Listed;
use super::mistakes::suggestion;
use crate::ids::ShapeId;
use crate::math::{Quat, Vec3};
use csv::StringRecord;
use nalgebra::Quaternion;
use std::path::Path;

/// So many mistakes of a file are listed, the others counted.
const SHOWN: usize = 5;

const COLUMNS: [&str; 15] =
    ["x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz", "shape", "scale"];

/// The particles of a file, or what is wrong with it. `wrong` says of a particle why it may not be there;
/// messages count ids from `first_id`.
pub(super) fn read(
    path: &Path,
    shapes: &[&str],
    first_id: u64,
    wrong: &dyn Fn(&Listed) -> Option<String>,
) -> Result<Vec<Listed>, Vec<String>> {
    let text = crate::files::read_to_string(path)
        .map_err(|error| vec![format!("{} cannot be read: {error}", path.display())])?;
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .flexible(true)
        .from_reader(text.as_bytes());
    let header = reader.headers().map_err(|error| vec![error.to_string()])?.clone();
    let columns = Columns::find(&header, shapes)?;

    let mut rows = Vec::new();
    let mut mistakes = Vec::new();
    for (k, record) in reader.records().enumerate() {
        let line = |record: &StringRecord| line_of(record, &text);
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
    if mistakes.len() > SHOWN {
        let more = mistakes.len() - SHOWN;
        mistakes.truncate(SHOWN);
        mistakes.push(format!("{more} more lines have mistakes"));
    }
    Err(mistakes)
}

/// The line in which a record stands. Its position may be before blank lines and comments.
pub(super) fn line_of(record: &StringRecord, text: &str) -> usize {
    let begin = record.position().map_or(0, |position| position.byte() as usize);
    let (before, after) = text.split_at(begin);
    let is_skipped = |line: &&str| line.trim().is_empty() || line.starts_with('#');
    1 + before.matches('\n').count() + after.lines().take_while(is_skipped).count()
}

/// Where each group of columns stands.
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
        for (k, name) in header.iter().enumerate() {
            if !COLUMNS.contains(&name) {
                let hint = suggestion(name, COLUMNS, "allowed");
                mistakes.push(format!("no such column as `{name}`{hint}"));
            } else if header.iter().take(k).any(|other| other == name) {
                mistakes.push(format!("there are two columns `{name}`"));
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
            _ => {
                Err(format!("column {}: `{}` is not a number", &self.header[column], cell(column)))
            }
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
                format!("column shape: no such shape as `{name}`{hint}")
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
