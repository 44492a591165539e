//! Checks of tables before computation: a damaged file would otherwise give meaningless numbers.

use super::PostError;
use crate::math::Vec3;
use crate::output::header::Header;
use crate::output::tables::{ContactTable, ParticleTable};

/// Largest accepted magnitude, in SI units; no measured value is larger.
const LARGEST: f64 = 1e30;

/// Checks that every shape is known, and every number small enough for products of it to be finite.
pub(super) fn check_particles(header: &Header, particles: &ParticleTable) -> Result<(), PostError> {
    let is_mass = |mass: f64| mass > 0.0 && mass <= LARGEST * LARGEST;
    if let Some(shape) = header.shapes.iter().find(|shape| !is_mass(shape.mass)) {
        return Err(PostError::NotFinite { what: format!("mass of shape {}", shape.name) });
    }
    for (&id, shape) in particles.id.iter().zip(&particles.shape) {
        if shape.index() >= header.shapes.len() {
            return Err(PostError::UnknownShape {
                id,
                shape: shape.0,
                shapes: header.shapes.len(),
            });
        }
    }
    let broken = |column: &'static str, row: Option<usize>| match row {
        None => Ok(()),
        Some(row) => Err(PostError::NotFinite {
            what: format!("{column} of particle {}", particles.id[row]),
        }),
    };
    broken("position", not_finite(&particles.position))?;
    broken("velocity", not_finite(&particles.velocity))?;
    broken("force", not_finite(&particles.force))?;
    let is_size = |scale: &f64| *scale > 0.0 && *scale <= LARGEST;
    broken("scale", particles.scale.iter().position(|scale| !is_size(scale)))?;
    let orientation =
        |q: &[f64; 4]| q.iter().all(|c| c.abs() <= LARGEST) && q.iter().any(|&c| c != 0.0);
    broken("quaternion", particles.quaternion.iter().position(|q| !orientation(q)))
}

/// Checks every number of the contacts.
pub(super) fn check_contacts(contacts: &ContactTable) -> Result<(), PostError> {
    let broken = |column: &'static str, row: Option<usize>| match row {
        None => Ok(()),
        Some(row) => Err(PostError::NotFinite {
            what: format!(
                "{column} of the contact of {} with {}",
                contacts.a[row], contacts.b[row]
            ),
        }),
    };
    broken("centre", not_finite(&contacts.centre))?;
    broken("branch", not_finite(&contacts.branch))?;
    broken("point", not_finite(&contacts.point))?;
    broken("normal", not_finite(&contacts.normal))?;
    broken("shear force", not_finite(&contacts.shear_force))?;
    broken(
        "normal force",
        contacts.normal_force.iter().position(|f| f.is_nan() || f.abs() > LARGEST),
    )
}

fn not_finite(column: &[Vec3]) -> Option<usize> {
    column.iter().position(|v| !v.iter().all(|x| x.abs() <= LARGEST))
}
