//! Exchange files of the ON-DEM action as tables ([`crate::post::ondem`]).
//!
//! Bodies are those of `/VTKHDF/PointData`, pieces of clumps left out. Files of other programs have spheres there, with the id of the material as
//! their type.

use super::cells::{Cells, Row};
use crate::output::foreign::ForeignFile;
use crate::post::ondem::POINT_DATA;
use crate::shape::Shape;
use csv::StringRecord;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

/// Columns of numbers: dataset, names.
const COLUMNS: [(&str, &[&str]); 6] = [
    ("position", &["x", "y", "z"]),
    ("orientation", &["qx", "qy", "qz", "qw"]),
    ("velocity", &["vx", "vy", "vz"]),
    ("angular_velocity", &["wx", "wy", "wz"]),
    ("scale", &["scale"]),
    ("radius", &["radius"]),
];

/// Is it such a file, by its name?
pub(super) fn is_one(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("vtkhdf"))
}

/// Integers of a column, one for each of so many bodies.
fn integers(file: &ForeignFile, name: &str, count: usize) -> Result<Option<Vec<i64>>, String> {
    match file.table(&format!("{POINT_DATA}/{name}"))? {
        Some((_, values)) if values.len() != count => Err(uneven(name)),
        values => Ok(values.map(|(_, values)| values)),
    }
}

fn uneven(name: &str) -> String {
    format!("{POINT_DATA}/{name} has another number of bodies")
}

/// The bodies of a file. `fits` tells whether the scene has this shape in the place of a shape of the file.
pub(super) fn read(
    path: &Path,
    fits: &dyn Fn(&str, &Shape) -> bool,
) -> Result<Cells<'static>, String> {
    let file = ForeignFile::open(path)?;
    let ids = file.table::<i64>(&format!("{POINT_DATA}/body_id"))?;
    let (_, ids) = ids.ok_or_else(|| {
        format!(
            "it is no file of ON-DEM, as it has no {POINT_DATA}/body_id: `dem-post --ondem` makes one of a snapshot"
        )
    })?;
    let mut columns = Vec::new();
    for (name, names) in COLUMNS {
        if names == ["radius"] && columns.iter().any(|(names, _)| *names == ["scale"]) {
            continue;
        }
        if let Some((width, values)) = file.table::<f64>(&format!("{POINT_DATA}/{name}"))? {
            if width != names.len() || values.len() != width * ids.len() {
                return Err(uneven(name));
            }
            columns.push((names, values));
        }
    }
    let clumps = integers(&file, "clump_id", ids.len())?;
    let shapes = integers(&file, "shape", ids.len())?;
    let (labels, doubts) = labels(&file, shapes.as_deref().unwrap_or_default(), fits)?;
    let materials = integers(&file, "material_id", ids.len())?;

    let mut names = vec!["id".to_owned()];
    names.extend(columns.iter().flat_map(|(names, _)| *names).map(|&name| name.to_owned()));
    let has_types = shapes.is_some() || materials.is_some();
    names.extend(has_types.then(|| "type".to_owned()));
    let known: BTreeSet<i64> = ids.iter().copied().collect();
    let clump_of = |row: usize| clumps.as_ref().map_or(-1, |of| of[row]);
    let is_piece = |row: usize| clump_of(row) >= 0 && clump_of(row) != ids[row];
    if let Some(row) = (0..ids.len()).find(|&row| is_piece(row) && !known.contains(&clump_of(row)))
    {
        let (body, clump) = (ids[row], clump_of(row));
        return Err(format!(
            "body {body} is a piece of clump {clump}, which the file does not have"
        ));
    }
    let record = |row: usize| -> Row {
        let mut record = StringRecord::new();
        let mut text = ids[row].to_string();
        record.push_field(&text);
        for (names, values) in &columns {
            for value in &values[row * names.len()..][..names.len()] {
                text.clear();
                let _ = write!(text, "{value:e}");
                record.push_field(&text);
            }
        }
        match (&shapes, &materials) {
            (Some(shapes), _) => record.push_field(&labels[shapes[row] as usize]),
            (None, Some(materials)) => record.push_field(&materials[row].to_string()),
            (None, None) => {}
        }
        Ok((row + 1, record))
    };
    let rows: Vec<Row> = (0..ids.len()).filter(|row| !is_piece(*row)).map(record).collect();
    Ok(Cells { names, rows: Box::new(rows.into_iter()), is_rich: true, bounds: None, doubts })
}

/// Names of the shapes of a file, and warnings about those that differ in the scene.
fn labels(
    file: &ForeignFile,
    shapes: &[i64],
    fits: &dyn Fn(&str, &Shape) -> bool,
) -> Result<(Vec<String>, Vec<String>), String> {
    let (mut labels, mut doubts) = (Vec::new(), Vec::new());
    let last = shapes.iter().copied().max().unwrap_or(-1);
    if shapes.iter().any(|&shape| shape < 0) {
        return Err("a shape has a number below 0".to_owned());
    }
    for k in 0..=last {
        let group = format!("/ONDEM/Shapes/{k}");
        let label = file.word(&format!("{group}/label"));
        let label =
            label.ok_or_else(|| format!("{group} has no label, and bodies have this shape"))?;
        let geometry = file.word(&format!("{group}/geometry"));
        let geometry: Option<Shape> = geometry.and_then(|text| serde_json::from_str(&text).ok());
        if geometry.is_some_and(|geometry| !fits(&label, &geometry)) {
            doubts.push(format!("shape {label} of the file differs from that of the scene"));
        }
        labels.push(label);
    }
    Ok((labels, doubts))
}
