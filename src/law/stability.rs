//! The largest stable time step.
//!
//! The leapfrog of [`crate::motion`] is stable up to `Δt = 2 / ω` for the highest frequency `ω` of
//! the assembly. By Gershgorin's circles, `ω² <= 2 k C / m` for a body with `C` contacts of stiffness
//! `k`; a contact far from the centre also turns the body, which makes its surface
//! [`Shape::surface_compliance`](crate::shape::Shape::surface_compliance) times as compliant as its
//! centre, 3.5 for a sphere. No motion moves all contacts around a body like its most compliant: where spheres turn against
//! all their neighbours it is 5/3 in the mean, and that part is taken of every shape's.
//!
//! A dashpot `c` feels the velocity of half a step before: with `γ <= 2 c C / m`, found like `ω²`, the step is stable
//! while `ω² Δt² + 2 γ Δt < 4`. The faster a mode, the more of critical damping it has: tangential dashpots of half of it
//! for a pair take four fifths of the step of a packed bed. Those along the normals do less: a motion feels a third of
//! them, and they turn a body by no more than its flatness lets them. Partners are taken as heavy as the heaviest grain;
//! walls are few.
//!
//! Of particles of many sizes the smallest and the largest of each shape are looked at, each among the heaviest and the
//! smallest of all.
//!
//! A grain among smaller ones has more than [`CONTACTS`], as many more as their caps fit on its surface. More contacts
//! than that at full stiffness would need a shorter step; fewer is the rule, and the bound is then on the safe side.

use super::{Body, ForceLaw, Hardest};
use crate::ids::ShapeId;
use crate::particles::Library;

/// Contacts per particle in the estimate: those of the densest packing of spheres.
pub const CONTACTS: f64 = 12.0;

/// Compliance of a sphere's surface in the motion that strains all contacts most, over that at a single one.
const TOGETHER: f64 = (5.0 / 3.0) / 3.5;

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
pub fn time_step_limit(library: &Library, law: &dyn ForceLaw) -> Option<TimeStepLimit> {
    let mass_of = |(shape, scale): (ShapeId, f64)| library.mass_at(shape, scale);
    let heaviest = library.extremes().map(mass_of).fold(0.0, f64::max);
    let radius =
        |(shape, scale): (ShapeId, f64)| library.shapes[shape.index()].volume().cbrt() * scale;
    let smallest = library.extremes().map(radius).fold(f64::INFINITY, f64::min);
    library
        .extremes()
        .map(|(id, scale)| {
            let body = Body::of(library, id, scale);
            let mass = body.mass;
            let reduced_mass = mass * heaviest / (mass + heaviest);
            let Hardest { stiffness, dashpots: [normal, tangential] } =
                law.hardest(&body, reduced_mass);
            let shape = &library.shapes[id.index()];
            let compliance = shape.surface_compliance();
            let flatness = shape.inscribed_radius() / shape.bounding_radius();
            let across = 1.0 + (compliance - 1.0) * (1.0 - flatness * flatness);
            let among_the_smallest = (0.5 * (1.0 + radius((id, scale)) / smallest)).powi(2);
            let contacts = 2.0 * CONTACTS * among_the_smallest / mass;
            let frequency_squared = contacts * TOGETHER * compliance * stiffness;
            let rate = contacts * (TOGETHER * compliance * tangential + across / 3.0 * normal);
            let dt = 4.0 / (rate + (rate * rate + 4.0 * frequency_squared).sqrt());
            TimeStepLimit { dt, shape: id, mass, stiffness }
        })
        .min_by(|a, b| a.dt.total_cmp(&b.dt))
}

/// The highest frequency at which two bodies oscillate on the spring of one contact, without dashpots [rad/s]: `√(k / m)` with
/// the largest stiffness that a body can have and the reduced mass of it and the lightest of all. `None` if nothing pushes.
pub fn highest_frequency(library: &Library, law: &dyn ForceLaw) -> Option<f64> {
    let bodies: Vec<Body> =
        library.extremes().map(|(shape, scale)| Body::of(library, shape, scale)).collect();
    let lightest = bodies.iter().map(|body| body.mass).fold(f64::INFINITY, f64::min);
    let squared = bodies.iter().map(|body| {
        let reduced_mass = body.mass * lightest / (body.mass + lightest);
        law.hardest(body, reduced_mass).stiffness / reduced_mass
    });
    let highest = squared.fold(0.0, f64::max);
    (highest > 0.0).then(|| highest.sqrt())
}
