//! The largest stable time step.
//!
//! The leapfrog of [`crate::motion`] is stable up to `Δt = 2 / ω` for the highest frequency `ω` of
//! the assembly. By Gershgorin's circles, `ω² <= 2 k C / m` for a body with `C` contacts of stiffness
//! `k`; a contact far from the centre also turns the body, which makes its surface
//! [`Shape::surface_compliance`](crate::shape::Shape::surface_compliance) times as compliant as its
//! centre (3.5 for a sphere). Dashpots with ratio `ζ` lower the limit by `√(1 + ζ²) - ζ`.
//! More contacts than [`CONTACTS`] at full stiffness on one grain would need a shorter step; fewer is
//! the rule, and the bound is then on the safe side.

use super::{Constants, Interactions};
use crate::ids::ShapeId;
use crate::particles::Library;

/// Contacts per particle in the estimate: those of the densest packing of balls.
pub const CONTACTS: f64 = 12.0;

/// A bound of the time step, and what sets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeStepLimit {
    /// The largest stable step [s].
    pub dt: f64,
    /// The shape with the highest frequency.
    pub shape: ShapeId,
    /// Its mass [kg].
    pub mass: f64,
    /// The largest stiffness of its contacts [N/m].
    pub stiffness: f64,
}

/// The limit over all shapes of particles; `None` if there are none.
pub fn time_step_limit(library: &Library, interactions: &Interactions) -> Option<TimeStepLimit> {
    (0..library.particle_shapes)
        .map(|index| {
            let constants = interactions.of_material(library.materials[index]);
            let largest = |of: fn(&Constants) -> f64| constants.iter().map(of).fold(0.0, f64::max);
            let stiffness = largest(|c| {
                if c.is_frictional() {
                    c.normal_stiffness.max(c.tangential_stiffness)
                } else {
                    c.normal_stiffness
                }
            });
            let ratio = largest(|c| {
                if c.is_frictional() {
                    c.normal_damping_ratio.max(c.tangential_damping_ratio)
                } else {
                    c.normal_damping_ratio
                }
            });
            let mass = library.mass[index];
            let compliance = library.shapes[index].surface_compliance();
            let frequency = (2.0 * CONTACTS * stiffness * compliance / mass).sqrt();
            let damped = (1.0 + ratio * ratio).sqrt() - ratio;
            let dt = 2.0 / frequency * damped;
            TimeStepLimit { dt, shape: ShapeId(index as u16), mass, stiffness }
        })
        .min_by(|a, b| a.dt.total_cmp(&b.dt))
}
