//! Which sizes of grains come with a snapshot. A scene makes room for them when it is read, so that all that follows from sizes,
//! from the time step to what is said of it, is of the grains that there will be.
//!
//! A stage that begins looks at the grains of the snapshot. One that goes on takes the sizes for which it had made room before:
//! grains that have left since count in its step and skin as in the stage that was not interrupted.

use crate::comm::alone::Alone;
use crate::ids::ShapeId;
use crate::output::SnapshotError;
use crate::output::header::{Header, ShapeRow};
use crate::output::snapshot::Reader;
use crate::population::Library;
use crate::shape::{Shape, Union};
use std::path::Path;

/// The library's shape that is this one of a snapshot.
pub(super) fn known_as(library: &Library, row: &ShapeRow) -> Option<ShapeId> {
    // No two solids of one name have one box and one volume by accident.
    let is_it = |k: &usize| {
        let shape = &library.shapes[*k];
        library.names[*k] == row.name
            && shape.kind().name() == row.kind
            && shape.semi_axes() == row.semi_axes
            && shape.volume() == row.volume
    };
    (0..library.particle_shapes).find(is_it).map(|k| ShapeId(k as u16))
}

/// Makes room for the grains of the snapshot with which a stage begins, or of the newest good one of a directory. Returns its scene.
/// One that cannot be read has none: that is told when it is taken up.
pub(super) fn admit(library: &mut Library, path: &Path) -> Option<String> {
    let reader = opened(path).ok()?;
    let _ = admit_present(library, &reader);
    Some(reader.header().scene.clone())
}

/// The same for a stage that goes on from a snapshot of its own.
pub(super) fn admit_to_go_on(library: &mut Library, path: &Path) -> Option<String> {
    let reader = opened(path).ok()?;
    admit_saved(library, reader.header());
    Some(reader.header().scene.clone())
}

/// Makes room for the sizes and numbers for which the stage that wrote a snapshot had made room.
pub(super) fn admit_saved(library: &mut Library, header: &Header) {
    for row in &header.shapes {
        if let Some(shape) = admit_of(library, row, row.scales) {
            library.admit_number(shape, row.most);
        }
    }
}

/// The union of this name in a snapshot, or in the newest good one of a directory.
pub(super) fn union(path: &Path, name: &str) -> Option<Union> {
    let reader = opened(path).ok()?;
    let row = reader.header().shapes.iter().find(|row| row.name == name)?;
    match &row.geometry {
        Some(Shape::Union(body)) => Some((**body).clone()),
        _ => None,
    }
}

/// The scene of a snapshot, or of the newest good one of a directory.
pub(super) fn scene(path: &Path) -> Result<String, SnapshotError> {
    opened(path).map(|reader| reader.header().scene.clone())
}

/// Chosen and checked as it is when it is taken up.
fn opened(path: &Path) -> Result<Reader, SnapshotError> {
    Reader::open_together(path, &mut Alone::default())
}

fn admit_present(library: &mut Library, reader: &Reader) -> Result<(), SnapshotError> {
    for (row, sizes) in reader.header().shapes.iter().zip(reader.sizes()?) {
        if let Some((scales, count)) = sizes
            && let Some(shape) = admit_of(library, row, scales)
        {
            library.most[shape.index()] += count as f64;
        }
    }
    Ok(())
}

/// Makes room for these scales of a snapshot's shape. What is none of the library's, or no scale, is told when it is taken up.
fn admit_of(library: &mut Library, row: &ShapeRow, scales: [f64; 2]) -> Option<ShapeId> {
    let shape = known_as(library, row)?;
    if scales.iter().all(|scale| scale.is_finite() && *scale > 0.0) {
        for scale in scales {
            library.admit(shape, scale);
        }
    }
    Some(shape)
}
