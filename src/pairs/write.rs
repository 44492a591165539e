//! Pairs and answers as CSV. Numbers have as many digits as it takes to read the same bits back.

use super::{Answer, Pairs};
use crate::math::Vec3;
use std::io::Write;

/// Columns of [`pairs`], those of the reference files.
pub const PAIR_COLUMNS: [&str; 21] = [
    "id", "aA", "bA", "cA", "aB", "bB", "cB", "xA", "yA", "zA", "qwA", "qxA", "qyA", "qzA", "xB",
    "yB", "zB", "qwB", "qxB", "qyB", "qzB",
];

/// Columns of [`answers`], those of the reference files, and who answered.
pub const ANSWER_COLUMNS: [&str; 16] = [
    "id",
    "overlap",
    "nx",
    "ny",
    "nz",
    "PAx",
    "PAy",
    "PAz",
    "PBx",
    "PBy",
    "PBz",
    "Cx",
    "Cy",
    "Cz",
    "solver",
    "iterations",
];

/// Writes pairs as [`super::read`] reads them. Balls are written as ellipsoids.
///
/// # Errors
/// If it cannot be written.
pub fn pairs(pairs: &Pairs, to: impl Write) -> Result<(), csv::Error> {
    let mut table = csv::Writer::from_writer(to);
    table.write_record(PAIR_COLUMNS)?;
    for (index, name) in pairs.names.iter().enumerate() {
        let (a, b, _) = pairs.posed(index);
        let mut numbers: Vec<f64> = Vec::with_capacity(PAIR_COLUMNS.len());
        numbers.extend(a.shape.semi_axes().iter().chain(&b.shape.semi_axes()));
        for slot in [2 * index, 2 * index + 1] {
            let q = pairs.rotation[slot].quaternion();
            numbers.extend(&pairs.position[slot]);
            numbers.extend([q.w, q.i, q.j, q.k]);
        }
        let row = numbers.iter().map(|x| format!("{x:?}"));
        table.write_record(std::iter::once(name.clone()).chain(row))?;
    }
    Ok(table.flush()?)
}

/// Writes one row per pair. Points are in the world; they are the support points along the normal, of the
/// bodies themselves. Numbers that no method could determine are empty.
///
/// # Errors
/// If it cannot be written.
pub fn answers(pairs: &Pairs, answers: &[Answer], to: impl Write) -> Result<(), csv::Error> {
    let mut table = csv::Writer::from_writer(to);
    table.write_record(ANSWER_COLUMNS)?;
    for (index, answer) in answers.iter().enumerate() {
        let numbers = match &answer.touch {
            Err(_) => vec![String::new(); 13],
            Ok(touch) => {
                let (a, b, r) = pairs.posed(index);
                let centre = pairs.centre_of_a(index);
                let on_a = centre + a.support(&touch.normal);
                let on_b = centre + (b.support(&-touch.normal) + r);
                let vectors: [Vec3; 4] = [touch.normal, on_a, on_b, centre + touch.point];
                let numbers = vectors.iter().flatten();
                std::iter::once(&touch.overlap).chain(numbers).map(|x| format!("{x:?}")).collect()
            }
        };
        let head = std::iter::once(pairs.name(index));
        let iterations = answer.iterations.to_string();
        let tail = [answer.stage, &iterations];
        table.write_record(head.chain(numbers.iter().map(String::as_str)).chain(tail))?;
    }
    Ok(table.flush()?)
}
