//! Particle sizes from a snapshot. A scene is extended to them when it is read, so that the time step and all texts account
//! for these particles.
//!
//! A stage that begins uses the particles of the snapshot. One that continues uses the sizes to which it was extended
//! before. So particles that have left since then still count in its step and skin, as in an uninterrupted stage.

use crate::comm::alone::Alone;
use crate::ids::ShapeId;
use crate::output::SnapshotError;
use crate::output::header::{Header, ShapeRow};
use crate::output::snapshot::Reader;
use crate::population::Library;
use crate::shape::{Shape, Union};
use std::path::Path;

/// The library's shape that matches one of a snapshot.
pub(super) fn known_as(library: &Library, row: &ShapeRow) -> Option<ShapeId> {
    // Two different solids of one name do not have the same box and volume by chance.
    let is_it = |k: &usize| {
        let shape = &library.shapes[*k];
        library.names[*k] == row.name
            && shape.kind().name() == row.kind
            && shape.semi_axes() == row.semi_axes
            && shape.volume() == row.volume
    };
    (0..library.particle_shapes).find(is_it).map(|k| ShapeId(k as u16))
}

/// Extends the library to the particles of the snapshot with which a stage begins, or of the newest good one of a
/// directory. Returns its scene. `None` for an unreadable one, which is reported when it is restored.
pub(super) fn admit(library: &mut Library, path: &Path) -> Option<String> {
    let reader = opened(path).ok()?;
    let _ = admit_present(library, &reader);
    Some(reader.header().scene.clone())
}

/// Extends the library for a stage that continues from one of its own snapshots.
pub(super) fn admit_to_go_on(library: &mut Library, path: &Path) -> Option<String> {
    let reader = opened(path).ok()?;
    admit_saved(library, reader.header());
    Some(reader.header().scene.clone())
}

/// Extends the library to the sizes and numbers of the stage that wrote a snapshot.
pub(super) fn admit_saved(library: &mut Library, header: &Header) {
    for row in &header.shapes {
        if let Some(shape) = admit_of(library, row, row.scales) {
            library.admit_number(shape, row.most);
        }
    }
}

/// Union of this name in a snapshot, or in the newest good one of a directory.
pub(super) fn union(path: &Path, name: &str) -> Option<Union> {
    let reader = opened(path).ok()?;
    let row = reader.header().shapes.iter().find(|row| row.name == name)?;
    match &row.geometry {
        Some(Shape::Union(body)) => Some((**body).clone()),
        _ => None,
    }
}

/// Scene of a snapshot, or of the newest good one of a directory.
pub(super) fn scene(path: &Path) -> Result<String, SnapshotError> {
    opened(path).map(|reader| reader.header().scene.clone())
}

/// Opens a snapshot, chosen and checked as for its restoration.
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

/// Extends a shape of a snapshot to these scales. Unknown shapes and invalid scales are reported when the snapshot is
/// restored.
fn admit_of(library: &mut Library, row: &ShapeRow, scales: [f64; 2]) -> Option<ShapeId> {
    let shape = known_as(library, row)?;
    if scales.iter().all(|scale| scale.is_finite() && *scale > 0.0) {
        for scale in scales {
            library.admit(shape, scale);
        }
    }
    Some(shape)
}
