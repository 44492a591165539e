//! Pairs and answers as CSV. Numbers have as many digits as needed to read the same bits back.

use super::{Answer, Pairs, Place};
use crate::contact::thickness;
use crate::math::Vec3;
use std::io::Write;

/// Columns of [`pairs`], as in the reference files.
pub const PAIR_COLUMNS: [&str; 21] = [
    "id", "aA", "bA", "cA", "aB", "bB", "cB", "xA", "yA", "zA", "qwA", "qxA", "qyA", "qzA", "xB",
    "yB", "zB", "qwB", "qxB", "qyB", "qzB",
];

/// Columns of [`answers`]: those of the reference files, the stage that answered, and the thickness of bodies with faces or straight sides.
pub const ANSWER_COLUMNS: [&str; 24] = [
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
    "thickness",
    "Fx",
    "Fy",
    "Fz",
    "Mx",
    "My",
    "Mz",
    "energy",
];

/// Additional columns of [`answers`] for the law of a scene: force of A on B [N], moment about the centre of A [N m], stored energy [J].
pub const LAW_COLUMNS: [&str; 7] =
    ["law_Fx", "law_Fy", "law_Fz", "law_Mx", "law_My", "law_Mz", "law_energy"];

/// Writes pairs in the format of [`super::read`]. Spheres are written as ellipsoids.
///
/// # Errors
/// If writing fails.
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

/// Writes one row per pair.
///
/// Points are in the world; they are the support points of the bodies themselves along the normal. Numbers that no method could determine are
/// empty. The columns of [`thickness`] are empty for bodies without faces and straight sides, and for those that do not touch. They contain, for
/// a stiffness of 1 N/m, force [N] and moment [N m] of A on B about the centre of A, and energy [J]. `by_law` has the numbers of [`LAW_COLUMNS`]
/// of each pair.
///
/// A pair with a union has a row for each place where its bodies touch ([`Answer::places`]). Its overlap is also in `thickness`, and PA and PB
/// are half of it before and behind C. The solver is `pieces`, and the iterations are those of the deepest pieces.
///
/// # Errors
/// If writing fails.
pub fn answers(
    pairs: &Pairs,
    answers: &[Answer],
    by_law: Option<&[[f64; 7]]>,
    to: impl Write,
) -> Result<(), csv::Error> {
    let mut table = csv::Writer::from_writer(to);
    let of_law = if by_law.is_some() { &LAW_COLUMNS[..] } else { &[] };
    table.write_record(ANSWER_COLUMNS.iter().chain(of_law))?;
    for (index, answer) in answers.iter().enumerate() {
        for place in &answer.places {
            table.write_record(of_place(pairs, index, answer, place))?;
        }
        if !answer.places.is_empty() {
            continue;
        }
        let numbers = match &answer.touch {
            Err(_) => vec![String::new(); 13],
            Ok(touch) => {
                let (a, b, r) = pairs.posed(index);
                let centre = pairs.centre_of_a(index);
                let [on_a, on_b] = if pairs.has_union(index) {
                    let half = touch.normal * (0.5 * touch.overlap);
                    [centre + touch.point + half, centre + touch.point - half]
                } else {
                    let on_b = centre + (b.support(&-touch.normal) + r);
                    [centre + a.support(&touch.normal), on_b]
                };
                let vectors: [Vec3; 4] = [touch.normal, on_a, on_b, centre + touch.point];
                let numbers = vectors.iter().flatten();
                std::iter::once(&touch.overlap).chain(numbers).map(|x| format!("{x:?}")).collect()
            }
        };
        let head = std::iter::once(pairs.name(index));
        let iterations = answer.iterations.to_string();
        let tail = [answer.stage, &iterations];
        let on_faces = on_faces(pairs, index);
        let texts = numbers.iter().map(String::as_str).chain(tail);
        let of_law: Vec<String> =
            by_law.iter().flat_map(|rows| rows[index]).map(|x| format!("{x:?}")).collect();
        let behind = on_faces.iter().chain(&of_law).map(String::as_str);
        table.write_record(head.chain(texts).chain(behind))?;
    }
    Ok(table.flush()?)
}

/// Row of one of the places where two bodies touch.
fn of_place(pairs: &Pairs, index: usize, answer: &Answer, place: &Place) -> Vec<String> {
    let Place { touch, acting, by_law } = place;
    let (point, half) = (pairs.centre_of_a(index) + touch.point, 0.5 * touch.overlap);
    let vectors = [touch.normal, point + touch.normal * half, point - touch.normal * half, point];
    let text = |x: &f64| format!("{x:?}");
    let mut row = vec![pairs.name(index).to_owned(), text(&touch.overlap)];
    row.extend(vectors.iter().flatten().map(text));
    row.extend(["pieces".to_owned(), answer.iterations.to_string(), text(&touch.overlap)]);
    row.extend(acting.iter().chain(by_law.iter().flatten()).map(text));
    row
}

/// Thickness columns of a pair with faces or straight sides.
fn on_faces(pairs: &Pairs, index: usize) -> Vec<String> {
    if pairs.has_union(index) {
        return vec![String::new(); 8];
    }
    let (a, b, r) = pairs.posed(index);
    let Some(found) = thickness(&a, &b, &r) else { return vec![String::new(); 8] };
    let (force, moment) = (found.force(), found.moment());
    let vectors = force.iter().chain(&moment).copied();
    let numbers = std::iter::once(found.thickness).chain(vectors).chain([found.energy()]);
    numbers.map(|x| format!("{x:?}")).collect()
}
