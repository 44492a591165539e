//! Pushes on the particles of a group: a force, a torque, and the drag of a fluid.
//!
//! The drag is that of a sphere of the particle's volume, with diameter `d`. The fluid has the viscosity `μ` and the
//! density `ρ`, and `w` is the velocity relative to it:
//!
//! `D = -3π μ d w φ`, with `φ = 1` (Stokes), or `φ = max(1 + 0.15 Re^0.687, 0.44 Re / 24)` and `Re = ρ |w| d / μ` (Schiller
//! and Naumann 1933; the second is Newton's range, from `Re ≈ 1000` on).
//!
//! In both halves of a step it belongs to the velocity at the time of the positions, like global damping
//! ([`crate::motion`]). In the last half this velocity follows from `w (A + ξ(|w|) dt/2) = b`, a monotonic equation for
//! `|w|`. The terminal velocity is exact.

use crate::ids::ShapeId;
use crate::math::{Vec3, Vec3AndNumber};
use crate::motion::Field;
use crate::particles::Particles;
use crate::particles::columns::Quantity;
use crate::population::{Library, of_mass};
use crate::walls::courses::Table;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Pushes on each particle of a group.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Push {
    /// Force [N].
    pub force: Option<Load>,
    /// Torque in world axes [N m].
    pub torque: Option<Load>,
    /// Drag of a fluid.
    pub drag: Option<Drag>,
}

/// A force [N] or torque [N m].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Load {
    /// A constant.
    Constant(Vec3),
    /// Along a unit vector, with a value by the time of the stage.
    By(Vec3, Table),
}

impl Load {
    /// Value at a time of the stage [s].
    pub fn at(&self, time: f64) -> Vec3 {
        match self {
            Self::Constant(load) => *load,
            Self::By(along, table) => along * table.value(time),
        }
    }
}

/// A fluid at rest, or with one velocity everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drag {
    /// Drag as a function of the velocity.
    pub law: DragLaw,
    /// Dynamic viscosity [Pa s].
    pub viscosity: f64,
    /// Density [kg/m³]; 0 if it is not used.
    pub density: f64,
    /// Velocity of the fluid [m/s].
    pub velocity: Vec3,
    /// Buoyancy over volume, density times gravity, upwards, or 0 [N/m³].
    pub lift: Vec3,
}

/// Law of the drag.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum DragLaw {
    /// Creeping flow.
    Stokes,
    /// Schiller and Naumann.
    SchillerNaumann,
}

impl Drag {
    /// Drag over the relative speed [kg/s], for a sphere of a diameter [m] at this speed [m/s].
    pub fn coefficient(&self, diameter: f64, speed: f64) -> f64 {
        let stokes = 3.0 * PI * self.viscosity * diameter;
        match self.law {
            DragLaw::Stokes => stokes,
            DragLaw::SchillerNaumann => {
                let reynolds = self.density * speed * diameter / self.viscosity;
                let beyond = 0.44 / 24.0 * reynolds;
                stokes * f64::max(1.0 + 0.15 * libm::pow(reynolds, 0.687), beyond)
            }
        }
    }

    /// Drag over speed and mass of a particle in the limit of a small relative speed [1/s].
    pub fn rate_at_rest(&self, library: &Library, shape: ShapeId, scale: f64) -> f64 {
        let sphere = Sphere::of(library, shape, scale);
        self.coefficient(sphere.diameter, 0.0) / sphere.mass
    }

    /// Speed `s` with `s (given + half ξ(s)) = size`, where `ξ` is the coefficient over the mass.
    fn speed(&self, sphere: &Sphere, given: f64, half: f64, size: f64) -> f64 {
        // The left side is convex and rises, so secants from above approach the root and never pass it.
        let mut speed = size / given;
        for _ in 0..MOST_SWEEPS {
            let rate = given + half * self.coefficient(sphere.diameter, speed) / sphere.mass;
            let excess = speed * rate - size;
            let above = speed * (1.0 + SECANT);
            let rate = given + half * self.coefficient(sphere.diameter, above) / sphere.mass;
            let slope = (above * rate - size - excess) / (above - speed);
            let next = speed - excess / slope;
            if !(next < speed && next > 0.0) {
                break;
            }
            speed = next;
        }
        speed
    }
}

/// Largest number of steps of the search for a speed; it needs about five.
const MOST_SWEEPS: usize = 50;
/// Width of a secant over the speed.
const SECANT: f64 = 1e-7;

/// Sphere of a particle's volume and mass.
struct Sphere {
    /// Volume [m³].
    volume: f64,
    /// Diameter [m].
    diameter: f64,
    /// Mass [kg].
    mass: f64,
}

impl Sphere {
    fn of(library: &Library, shape: ShapeId, scale: f64) -> Self {
        let volume = library.shapes[shape.index()].volume() * of_mass(scale);
        let mass = library.mass_at(shape, scale);
        Self { volume, diameter: libm::cbrt(6.0 * volume / PI), mass }
    }

    fn in_slot(particles: &Particles, slot: usize) -> Self {
        Self::of(&particles.library, particles.shape[slot], particles.scale_of(slot))
    }
}

/// Forces and torque on a particle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loads {
    /// Force without drag [N].
    force: Vec3,
    /// Torque [N m].
    torque: Vec3,
    /// Drag [N].
    drag: Vec3,
    /// Velocity of the fluid [m/s].
    fluid: Vec3,
}

impl Loads {
    /// Adds them to the sums of the contacts.
    pub(super) fn add_to(&self, particles: &mut Particles, slot: usize) {
        let add = |sum: &mut Vec3AndNumber, more: Vec3| sum.vector += more;
        add(&mut particles.force[slot], self.force + self.drag);
        if let Some(spin) = &mut particles.spin {
            add(&mut spin.torque[slot], self.torque);
        }
    }

    /// Counts their work on a particle at velocities [m/s, rad/s] in a time [s].
    pub(super) fn count_work(
        &self,
        particles: &mut Particles,
        slot: usize,
        (velocity, turning): (Vec3, Vec3),
        time: f64,
    ) {
        let Self { force, torque, drag, fluid } = self;
        let power = force.dot(&velocity) + torque.dot(&turning) + drag.dot(fluid);
        particles.accumulated[Quantity::Received][slot] += time * power;
        let lost = -time * drag.dot(&(velocity - fluid));
        particles.accumulated.damp(slot, lost);
    }
}

impl Push {
    /// Description for the plan.
    pub fn words(&self) -> String {
        let load = |what: &str, load: &Option<Load>, unit: &str| {
            load.as_ref().map(|load| match load {
                Load::Constant(load) => {
                    format!("{what} [{}, {}, {}] {unit} on each", load.x, load.y, load.z)
                }
                Load::By(along, _) => {
                    format!(
                        "{what} by a table along [{}, {}, {}] on each",
                        along.x, along.y, along.z
                    )
                }
            })
        };
        let drag = self.drag.as_ref().map(|drag| match drag.law {
            DragLaw::Stokes => "Stokes drag".to_owned(),
            DragLaw::SchillerNaumann => "Schiller-Naumann drag".to_owned(),
        });
        let all = [load("force", &self.force, "N"), load("torque", &self.torque, "N m"), drag];
        let all: Vec<String> = all.into_iter().flatten().collect();
        if all.is_empty() { "only measured".to_owned() } else { all.join(", ") }
    }

    /// Is there no push?
    pub const fn is_nothing(&self) -> bool {
        self.force.is_none() && self.torque.is_none() && self.drag.is_none()
    }

    /// Force and buoyancy at a time of the stage [s], in N.
    fn load(&self, sphere: &Sphere, time: f64) -> Vec3 {
        let force = self.force.as_ref().map_or_else(Vec3::zeros, |load| load.at(time));
        self.drag.as_ref().map_or(force, |drag| force + drag.lift * sphere.volume)
    }

    /// Forces and torque on a particle with this velocity [m/s] at its position, at a time of the stage [s].
    pub(super) fn on(
        &self,
        particles: &Particles,
        slot: usize,
        velocity: &Vec3,
        time: f64,
    ) -> Loads {
        let sphere = Sphere::in_slot(particles, slot);
        let torque = self.torque.as_ref().map_or_else(Vec3::zeros, |load| load.at(time));
        let none = Vec3::zeros();
        let mut acts = Loads { force: self.load(&sphere, time), torque, drag: none, fluid: none };
        if let Some(drag) = &self.drag {
            let against = velocity - drag.velocity;
            acts.drag = against * -drag.coefficient(sphere.diameter, against.norm());
            acts.fluid = drag.velocity;
        }
        acts
    }

    /// Velocity that the last kick will give to a particle, at the time of the positions [m/s]; the present one if half the
    /// step is 0. `time` is of the stage, and `half` is half the step, both in s.
    pub(super) fn velocity_after(
        &self,
        particles: &Particles,
        slot: usize,
        field: &Field,
        (time, half): (f64, f64),
    ) -> Vec3 {
        let velocity = particles.velocity[slot];
        let Some(drag) = &self.drag else { return velocity };
        let sphere = Sphere::in_slot(particles, slot);
        let force = field.force(particles, slot) + self.load(&sphere, time);
        let given = 1.0 + half * field.damping;
        let against = velocity + force * (half / sphere.mass) - drag.velocity * given;
        let size = against.norm();
        if size == 0.0 {
            return drag.velocity;
        }
        drag.velocity + against * (drag.speed(&sphere, given, half, size) / size)
    }
}

/// Velocities after the first kick, at the time of the particle's positions [m/s, rad/s]; `half` is half a step [s].
pub(super) fn after_first_kick(
    particles: &Particles,
    slot: usize,
    field: &Field,
    half: f64,
) -> (Vec3, Vec3) {
    let slower = 1.0 - half * field.damping;
    let force = field.force(particles, slot);
    let velocity = particles.velocity[slot] * slower + force * (half / particles.mass(slot));
    let turning = particles.spin.as_ref().map_or_else(Vec3::zeros, |spin| {
        let momentum = particles.angular_momentum(slot) * slower;
        particles.angular_velocity_for(slot, &(momentum + spin.torque[slot].vector * half))
    });
    (velocity, turning)
}
