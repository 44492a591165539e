//! The columns of [`ParticleTable`] one by one, for whoever treats all of them alike.

use super::tables::ParticleTable;
use crate::math::Vec3;

/// A column of a table as numbers.
pub struct NamedColumn<'a> {
    /// The name of its field.
    pub name: &'static str,
    /// What follows the name for each component.
    pub components: &'static [&'static str],
    /// A table may leave it empty.
    pub optional: bool,
    /// How many rows it has.
    pub rows: usize,
    /// The number in a row and component, in the column's unit.
    pub value: Box<dyn Fn(usize, usize) -> f64 + 'a>,
}

const SCALAR: &[&str] = &[""];
const VECTOR: &[&str] = &[".x", ".y", ".z"];
const QUATERNION: &[&str] = &[".w", ".x", ".y", ".z"];

impl ParticleTable {
    /// Every column but the id. The pattern names all fields, so that a new one does not compile
    /// until someone decides here.
    pub fn columns(&self) -> Vec<NamedColumn<'_>> {
        let Self {
            id: _,
            shape,
            position,
            velocity,
            force,
            coordination,
            rank,
            dissipated,
            received,
            image,
            quaternion,
            angular_momentum,
            angular_velocity,
            torque,
        } = self;
        vec![
            scalars("shape", shape, |shape| f64::from(shape.0)),
            vectors("position", position),
            vectors("velocity", velocity),
            vectors("force", force),
            scalars("coordination", coordination, |&count| f64::from(count)),
            scalars("rank", rank, |&rank| f64::from(rank)),
            scalars("dissipated", dissipated, |&energy| energy),
            scalars("received", received, |&energy| energy),
            NamedColumn {
                name: "image",
                components: VECTOR,
                optional: true,
                rows: image.len(),
                value: Box::new(|row, k| f64::from(image[row][k])),
            },
            NamedColumn {
                name: "quaternion",
                components: QUATERNION,
                optional: true,
                rows: quaternion.len(),
                value: Box::new(|row, k| quaternion[row][k]),
            },
            NamedColumn { optional: true, ..vectors("angular_momentum", angular_momentum) },
            NamedColumn { optional: true, ..vectors("angular_velocity", angular_velocity) },
            NamedColumn { optional: true, ..vectors("torque", torque) },
        ]
    }
}

fn scalars<'a, T>(
    name: &'static str,
    column: &'a [T],
    number: impl Fn(&T) -> f64 + 'a,
) -> NamedColumn<'a> {
    NamedColumn {
        name,
        components: SCALAR,
        optional: false,
        rows: column.len(),
        value: Box::new(move |row, _| number(&column[row])),
    }
}

fn vectors<'a>(name: &'static str, column: &'a [Vec3]) -> NamedColumn<'a> {
    NamedColumn {
        name,
        components: VECTOR,
        optional: false,
        rows: column.len(),
        value: Box::new(|row, k| column[row][k]),
    }
}
