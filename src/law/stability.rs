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
//! Where a side is flat the contact point runs over it when the body turns: with the radius of curvature `ρ` there, a
//! force `F` turns it back with the stiffness `F ρ`. Overlaps are some thousandths of a size, so that for bodies as flat as
//! discs of 5:1 this is hundredths of `k` and changes nothing. Sides of blunt superellipsoids are flat to rounding in
//! their middle, and no step is short enough there: see [`lost_levers`].
//!
//! Of particles of many sizes the smallest and the largest of each shape are looked at, each among the heaviest and the
//! smallest of all.
//!
//! A grain among smaller ones has more than [`CONTACTS`], as many more as their caps fit on its surface. More contacts
//! than that at full stiffness would need a shorter step; fewer is the rule, and the bound is then on the safe side.

use super::{Body, ForceLaw, Hardest};
use crate::ids::ShapeId;
use crate::math::{Mat3, Vec3};
use crate::particles::Library;
use crate::shape::Shape;

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
    /// The overlap over the radius of the smaller body at which they have it [-]; `None` if they have it at any.
    pub overlap: Option<f64>,
}

impl TimeStepLimit {
    /// What sets it, but for the name of the shape.
    #[must_use]
    pub fn words(&self) -> String {
        let overlap = self.overlap.map_or_else(String::new, |overlap| {
            format!(" at an overlap of {overlap:.3} of the radius, law.largest_overlap")
        });
        format!("{:.3e} kg, stiffness {:.3e} N/m{overlap}", self.mass, self.stiffness)
    }
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
            let Hardest { stiffness, dashpots: [normal, tangential], turning: [spring, dashpot] } =
                law.hardest(&body, reduced_mass);
            let (stiffness, tangential) = (stiffness + spring, tangential + dashpot);
            let shape = &library.shapes[id.index()];
            let compliance = shape.surface_compliance();
            let flatness = shape.inscribed_radius() / shape.bounding_radius();
            let across = 1.0 + (compliance - 1.0) * (1.0 - flatness * flatness);
            let among_the_smallest = (0.5 * (1.0 + radius((id, scale)) / smallest)).powi(2);
            let contacts = 2.0 * CONTACTS * among_the_smallest / mass;
            let frequency_squared = contacts * TOGETHER * compliance * stiffness;
            let rate = contacts * (TOGETHER * compliance * tangential + across / 3.0 * normal);
            let dt = 4.0 / (rate + (rate * rate + 4.0 * frequency_squared).sqrt());
            TimeStepLimit { dt, shape: id, mass, stiffness, overlap: law.hardest_up_to() }
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

/// How far from the middle of a side, over the half length of the body, a contact rocks it faster than steps of `dt` [s] can
/// follow; 0 where they always can. `acceleration` is that of the load, as gravity is [m/s²]; `scale` is the size of the body
/// over that of its shape.
///
/// A body on a plane that is tilted by `θ` from a flat side is turned back by its load `N` with the lever `x(θ)`, about the
/// contact, where its moment of inertia is `I`. The leapfrog follows that while `N x dt² / (I θ) < 4`. Towards the middle
/// `x / θ` grows to the radius of curvature, which is infinite in the middle of any side of a superellipsoid with an exponent
/// below 1: there the body is heated, which amounts to little where the part is small.
pub fn lost_levers(shape: &Shape, scale: f64, acceleration: f64, dt: f64) -> f64 {
    let sides = (0..3).flat_map(|axis| {
        let [side, along, across] = [0, 1, 2].map(|k| Vec3::ith((axis + k) % 3, 1.0));
        [(side, along), (-side, along), (side, across), (-side, across)]
    });
    let rate = acceleration * dt * dt / scale;
    sides.map(|(side, along)| lost_lever(shape, &side, &along, rate)).fold(0.0, f64::max)
}

/// The same of one side, in one direction along it. `rate` has the square of the step in it [m].
fn lost_lever(shape: &Shape, side: &Vec3, along: &Vec3, rate: f64) -> f64 {
    let axis = side.cross(along);
    let inertia = axis.dot(&(Mat3::from_diagonal(&shape.gyration()) * axis));
    let lever = |tilt: f64| {
        let ends = [tilt, -tilt].map(|tilt| shape.support(&(side + along * tilt).normalize()));
        (0.5 * (ends[0] - ends[1]).dot(along), 0.5 * (ends[0] + ends[1]).dot(side))
    };
    let is_lost = |tilt: f64| {
        let (lever, height) = lever(tilt);
        rate * lever > 4.0 * tilt * (inertia + height * height + lever * lever)
    };
    let [mut lost, mut followed] = [1e-9, 1.0];
    if !is_lost(lost) || is_lost(followed) {
        return 0.0;
    }
    for _ in 0..60 {
        let middle = f64::sqrt(lost * followed);
        if is_lost(middle) { lost = middle } else { followed = middle }
    }
    let half_length = 0.5 * (shape.support(along) - shape.support(&-along)).dot(along);
    lever(lost).0 / half_length
}
