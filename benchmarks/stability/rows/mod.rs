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
    let cells = [
        materials::cells(),
        shapes::cells(),
        extremes::cells(),
        walls::cells(),
        rest::cells(),
        ranks::cells(),
    ];
    let mut rows: Vec<Vec<Cell>> = Vec::new();
    for cell in cells.into_iter().flatten() {
        match rows.iter_mut().find(|row| row[0].row == cell.row) {
            Some(row) => row.push(cell),
            None => rows.push(vec![cell]),
        }
    }
    rows.into_iter().flatten().collect()
}
