//! Pairs from text: CSV for ellipsoids, JSON Lines for every kind.
//!
//! | kind | form | columns |
//! |---|---|---|
//! | ellipsoid | CSV | `id`, semi-axes `aA bA cA aB bB cB`, centres `xA yA zA xB yB zB`, quaternions `qwA qxA qyA qzA qwB qxB qyB qzB` |
//! | sphere | JSON | `id`, `rA`, `rB`, `cA`, `cB` |
//! | superellipsoid | JSON | `id`, `A` and `B` with `abc`, `e1`, `e2`, `c`, `q` |
//! | polyhedron | JSON | `id`, `VA`, `FA`, `VB`, `FB` |
//! | union | JSON | `id`, `UA` and `UB`, lists of pieces, each a ball `r`, `c`, a superellipsoid `abc`, `e1`, `e2`, `c`, `q`, or a polyhedron `V` |
//!
//! Lengths are in metres; quaternions (w, x, y, z) rotate from the body to the world and have any length but zero. Other columns are ignored.
//! A single piece is a body by itself: a union may meet any other body. Superellipsoids with `e1 = e2 = 1` are ellipsoids. A polyhedron is the
//! hull of its corners.
//!
//! A new kind needs a branch for its rows in `json_row`.

use super::{Body, Pairs};
use crate::math::{Quat, Vec3};
use crate::shape::moments::Placement;
use crate::shape::polyhedron::corners_only;
use crate::shape::union::Piece;
use crate::shape::{
    Convex as _, Ellipsoid, LENGTHS, Polyhedron, Shape, Sphere, Superellipsoid, Union,
};
use crate::text::shown;
use nalgebra::Quaternion;
use serde_json::Value;
use std::collections::BTreeMap;

/// Reason why a file could not be read: its first error.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// There is no row.
    #[error("{0}: has no pairs")]
    Empty(String),
    /// An error in a line.
    #[error("{file}:{line}: {problem}")]
    Line {
        /// Name of the file, as given by the caller.
        file: String,
        /// Line number, from 1.
        line: u64,
        /// Description with the column and the value.
        problem: String,
    },
}

/// A pair and its name.
type Row = (String, [Body; 2]);

/// Reads JSON Lines if the text begins with a brace, else CSV. Errors name the text `file`.
///
/// # Errors
/// See [`ReadError`].
pub fn read(file: &str, text: &str) -> Result<Pairs, ReadError> {
    let mut pairs = Pairs::default();
    let mut take = |(name, [a, b]): Row| pairs.push(name, a, b).map_err(|error| error.to_string());
    let at = |line| move |problem| ReadError::Line { file: file.into(), line, problem };
    if text.trim_start().starts_with('{') {
        for (line, text) in (1..).zip(text.lines()).filter(|(_, text)| !text.trim().is_empty()) {
            json_row(text).and_then(&mut take).map_err(at(line))?;
        }
    } else {
        let mut table = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
        let header = table.headers().map_err(|error| at(1)(error.to_string()))?.clone();
        let columns: BTreeMap<&str, usize> = header.iter().zip(0..).collect();
        for row in table.records() {
            let row = row.map_err(|error| {
                at(error.position().map_or(1, csv::Position::line))(error.to_string())
            })?;
            let line = row.position().map_or(1, csv::Position::line);
            csv_row(&columns, &row).and_then(&mut take).map_err(at(line))?;
        }
    }
    if pairs.is_empty() {
        return Err(ReadError::Empty(file.into()));
    }
    Ok(pairs)
}

// --- CSV ---

fn csv_row(columns: &BTreeMap<&str, usize>, row: &csv::StringRecord) -> Result<Row, String> {
    let text = |column: &str| {
        let index = columns.get(column).ok_or_else(|| format!("there is no column `{column}`"))?;
        row.get(*index).ok_or_else(|| format!("{column} is missing"))
    };
    let number = |column: &str| {
        let text = text(column)?;
        text.parse::<f64>().map_err(|_| format!("{column} = `{}` is not a number", shown(text)))
    };
    let body = |which: &str| -> Result<Body, String> {
        let named = |stem: &str| {
            let column = format!("{stem}{which}");
            number(&column).map(|value| (column, value))
        };
        let axes = [named("a")?, named("b")?, named("c")?];
        let centre = [named("x")?, named("y")?, named("z")?];
        let quaternion = [named("qw")?, named("qx")?, named("qy")?, named("qz")?];
        for (column, length) in &axes {
            length_check(column, *length)?;
        }
        for (column, value) in centre.iter().chain(&quaternion) {
            finite_check(column, *value)?;
        }
        Ok(Body {
            shape: ellipsoid(axes.map(|(_, length)| length)),
            centre: Vec3::from(centre.map(|(_, value)| value)),
            rotation: rotation(&quaternion[0].0, quaternion.each_ref().map(|(_, value)| *value))?,
        })
    };
    Ok((name(text("id")?)?, [body("A")?, body("B")?]))
}

// --- JSON Lines ---

fn json_row(text: &str) -> Result<Row, String> {
    let row: Value = serde_json::from_str(text).map_err(|error| format!("not JSON: {error}"))?;
    let id = match &row["id"] {
        Value::String(text) => name(text)?,
        Value::Null => return Err("there is no `id`".into()),
        other => other.to_string(),
    };
    let pair = |body: fn(&Value, &str) -> Result<Body, String>| {
        Ok((id.clone(), [body(&row, "A")?, body(&row, "B")?]))
    };
    if row.get("rA").is_some() {
        pair(sphere_of)
    } else if row.get("A").is_some() {
        pair(superellipsoid_of)
    } else if row.get("VA").is_some() {
        pair(polyhedron_of)
    } else if row.get("UA").is_some() {
        pair(union_of)
    } else {
        Err("of unknown kind: the keys are `rA` (sphere), `A` (superellipsoid), `VA` (polyhedron), `UA` (union)".into())
    }
}

fn sphere_of(row: &Value, which: &str) -> Result<Body, String> {
    let columns = [format!("r{which}"), format!("c{which}")];
    sphere(columns.each_ref().map(|column| &row[column]), &columns)
}

/// A sphere from radius and centre, with the names of their columns.
fn sphere(values: [&Value; 2], columns: &[String; 2]) -> Result<Body, String> {
    let radius = one_number(values[0], &columns[0])?;
    length_check(&columns[0], radius)?;
    Ok(Body {
        shape: Shape::Sphere(Sphere { radius }),
        centre: Vec3::from(numbers(values[1], &columns[1])?),
        rotation: Quat::identity(),
    })
}

fn superellipsoid_of(row: &Value, which: &str) -> Result<Body, String> {
    superellipsoid(&row[which], which)
}

fn superellipsoid(body: &Value, which: &str) -> Result<Body, String> {
    let column = |name: &str| format!("{which}.{name}");
    let axes: [f64; 3] = numbers(&body["abc"], &column("abc"))?;
    for length in axes {
        length_check(&column("abc"), length)?;
    }
    let exponents =
        [one_number(&body["e1"], &column("e1"))?, one_number(&body["e2"], &column("e2"))?];
    let allowed = Superellipsoid::EXPONENTS;
    if let Some(e) = exponents.into_iter().find(|e| !allowed.contains(e)) {
        let (least, most) = (allowed.start(), allowed.end());
        return Err(format!(
            "{which} has the exponent {e}, which is not from {least} to {most}: give a sharper body as a polyhedron"
        ));
    }
    let shape = if exponents == [1.0, 1.0] {
        ellipsoid(axes)
    } else {
        Shape::Superellipsoid(Superellipsoid::new(Vec3::from(axes), exponents))
    };
    Ok(Body {
        shape,
        centre: Vec3::from(numbers(&body["c"], &column("c"))?),
        rotation: rotation(&column("q"), numbers(&body["q"], &column("q"))?)?,
    })
}

/// A polyhedron, whose corners are given in the world: the body is placed at its centre of mass and principal axes.
fn polyhedron_of(row: &Value, which: &str) -> Result<Body, String> {
    let column = format!("V{which}");
    polyhedron(&row[&column], &column)
}

fn polyhedron(corners: &Value, column: &str) -> Result<Body, String> {
    let corners = corners.as_array().ok_or_else(|| format!("{column} is not a list"))?;
    let corners: Vec<Vec3> = corners
        .iter()
        .map(|corner| numbers(corner, column).map(Vec3::from))
        .collect::<Result<_, _>>()?;
    let solid = corners_only(&corners).and_then(|()| Polyhedron::new(&corners));
    let solid = solid.map_err(|error| format!("{column}: {error}"))?;
    let (centre, rotation) = (solid.placement().centre, solid.placement().axes);
    Ok(Body { shape: Shape::Polyhedron(Box::new(solid)), centre, rotation })
}

/// A union, whose pieces are given in the world, like corners of polyhedra.
fn union_of(row: &Value, which: &str) -> Result<Body, String> {
    let column = format!("U{which}");
    let pieces = row[&column].as_array().ok_or_else(|| format!("{column} is not a list"))?;
    let piece = |(number, piece): (usize, &Value)| {
        let name = format!("{column}[{number}]");
        let own = |key: &str| format!("{name}.{key}");
        if piece.get("r").is_some() {
            sphere([&piece["r"], &piece["c"]], &[own("r"), own("c")])
        } else if piece.get("abc").is_some() {
            superellipsoid(piece, &name)
        } else if piece.get("V").is_some() {
            polyhedron(&piece["V"], &own("V"))
        } else {
            Err(format!(
                "{name} is not a piece: the keys are `r` (ball), `abc` (superellipsoid), `V` (polyhedron)"
            ))
        }
    };
    let mut bodies = pieces.iter().enumerate().map(piece).collect::<Result<Vec<_>, _>>()?;
    if bodies.len() == 1 {
        return Ok(bodies.remove(0));
    }
    let pieces = bodies.into_iter().map(|Body { shape, centre, rotation }| Piece {
        shape,
        centre,
        rotation,
    });
    let union = Union::new(pieces.collect()).map_err(|error| format!("{column}: {error}"))?;
    let Placement { centre, axes } = *union.placement().expect("a union has axes");
    Ok(Body { shape: Shape::Union(Box::new(union)), centre, rotation: axes })
}

fn numbers<const N: usize>(value: &Value, column: &str) -> Result<[f64; N], String> {
    let list = value.as_array().filter(|list| list.len() == N);
    let list =
        list.ok_or_else(|| format!("{column} = {} is not a list of {N} numbers", shown(value)))?;
    let mut all = [0.0; N];
    for (number, value) in all.iter_mut().zip(list) {
        *number = one_number(value, column)?;
    }
    Ok(all)
}

/// A number, which is finite because JSON has no infinities.
fn one_number(value: &Value, column: &str) -> Result<f64, String> {
    value.as_f64().ok_or_else(|| format!("{column} = {} is not a number", shown(value)))
}

// --- common to both ---

/// Name of a pair, checked because answers may go to a terminal.
fn name(text: &str) -> Result<String, String> {
    if text.contains(char::is_control) {
        return Err(format!("id = `{}` has control characters", shown(text)));
    }
    Ok(text.to_owned())
}

fn ellipsoid(semi_axes: [f64; 3]) -> Shape {
    Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::from(semi_axes) })
}

/// Rotation of a quaternion of any length but zero.
///
/// Huge and tiny quaternions are scaled so that no square overflows or vanishes.
fn rotation(column: &str, wxyz: [f64; 4]) -> Result<Quat, String> {
    let [w, x, y, z] = wxyz;
    let largest = wxyz.iter().fold(0.0_f64, |largest, q| largest.max(q.abs()));
    if largest == 0.0 {
        return Err(format!("{column}: the quaternion is zero, so it is not a rotation"));
    }
    // Ordinary quaternions keep their bits.
    let scale = if (1e-100..1e100).contains(&largest) { 1.0 } else { 1.0 / largest };
    Ok(Quat::from_quaternion(Quaternion::new(w, x, y, z) * scale))
}

fn finite_check(column: &str, value: f64) -> Result<(), String> {
    if value.is_finite() { Ok(()) } else { Err(format!("{column} = {value} is not finite")) }
}

/// Checks that the powers of a length do not overflow or underflow.
fn length_check(column: &str, length: f64) -> Result<(), String> {
    finite_check(column, length)?;
    let (least, most) = (LENGTHS.start(), LENGTHS.end());
    if length <= 0.0 {
        return Err(format!("{column} = {length} is not positive"));
    }
    if !LENGTHS.contains(&length) {
        return Err(format!("{column} = {length:e}: must be from {least:e} to {most:e} m"));
    }
    Ok(())
}
