//! The rows of the map.

mod extremes;
mod materials;
mod ranks;
mod rest;
mod shapes;
mod walls;

use crate::cell::Cell;

/// All cells, row by row.
pub(crate) fn all() -> Vec<Cell> {
    [
        materials::cells(),
        shapes::cells(),
        extremes::cells(),
        walls::cells(),
        rest::cells(),
        ranks::cells(),
    ]
    .into_iter()
    .flatten()
    .collect()
}
