//! Pushes on the particles of a group: a force, a torque, and the drag of a fluid.
//!
//! Drag is that of a sphere of the particle's volume, of diameter `d`, in a fluid of viscosity `μ` and density `ρ`, at its velocity
//! `w` against the fluid:
//!
//! `D = -3π μ d w φ`, with `φ = 1` (Stokes), or `φ = max(1 + 0.15 Re^0.687, 0.44 Re / 24)` and `Re = ρ |w| d / μ`
//! (Schiller and Naumann 1933; the second is Newton's range, from `Re ≈ 1000` on).
//!
//! In both halves of a step it belongs to the velocity at the time of the positions, as global damping does ([`crate::motion`]): in the
//! last half that velocity is found from `w (A + ξ(|w|) dt/2) = b`, a monotonous equation for `|w|`. The terminal velocity is exact.

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
    /// [N]
    pub force: Option<Load>,
    /// World axes [N m].
    pub torque: Option<Load>,
    /// Drag of a fluid.
    pub drag: Option<Drag>,
}

/// A force [N] or torque [N m].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Load {
    /// A constant.
    Constant(Vec3),
    /// Along a unit vector, by the time of the stage.
    By(Vec3, Table),
}

impl Load {
    /// At a time of the stage [s].
    pub fn at(&self, time: f64) -> Vec3 {
        match self {
            Self::Constant(load) => *load,
            Self::By(along, table) => along * table.value(time),
        }
    }
}

/// A fluid that is at rest, or flows with one velocity everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Drag {
    /// How the drag goes with the velocity.
    pub law: DragLaw,
    /// Dynamic viscosity [Pa s].
    pub viscosity: f64,
    /// Density; 0 if it does not count [kg/m³].
    pub density: f64,
    /// Velocity of the fluid [m/s].
    pub velocity: Vec3,
    /// Lift over volume: density times gravity, upwards, or 0 [N/m³].
    pub lift: Vec3,
}

/// How drag goes with the velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum DragLaw {
    /// Creeping flow.
    Stokes,
    /// Schiller and Naumann.
    SchillerNaumann,
}

impl Drag {
    /// Drag over the speed against the fluid [kg/s], of a sphere of a diameter [m] at such a speed [m/s].
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

    /// Drag over speed and mass of a particle that is hardly faster than the fluid [1/s].
    pub fn rate_at_rest(&self, library: &Library, shape: ShapeId, scale: f64) -> f64 {
        let sphere = Sphere::of(library, shape, scale);
        self.coefficient(sphere.diameter, 0.0) / sphere.mass
    }

    /// The speed `s` with `s (given + half ξ(s)) = size`, where `ξ` is the coefficient over the mass.
    fn speed(&self, sphere: &Sphere, given: f64, half: f64, size: f64) -> f64 {
        // The left side is convex and rises: secants from above come down to it and never pass.
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

/// Steps of the search for a speed at most; it needs some five.
const MOST_SWEEPS: usize = 50;
/// Width of a secant, over the speed.
const SECANT: f64 = 1e-7;

/// The sphere of a particle's volume and mass.
struct Sphere {
    /// [m³]
    volume: f64,
    /// [m]
    diameter: f64,
    /// [kg]
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
pub(super) struct Acts {
    /// Without drag [N].
    force: Vec3,
    /// [N m]
    torque: Vec3,
    /// [N]
    drag: Vec3,
    /// Velocity of the fluid [m/s].
    fluid: Vec3,
}

impl Acts {
    /// Adds it to what contacts do.
    pub(super) fn add_to(&self, particles: &mut Particles, slot: usize) {
        let add = |sum: &mut Vec3AndNumber, more: Vec3| sum.vector += more;
        add(&mut particles.force[slot], self.force + self.drag);
        if let Some(spin) = &mut particles.spin {
            add(&mut spin.torque[slot], self.torque);
        }
    }

    /// Counts its work on a particle at velocities [m/s, rad/s] in a time [s].
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
    /// In words, as a plan tells it.
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
            DragLaw::Stokes => "drag of Stokes".to_owned(),
            DragLaw::SchillerNaumann => "drag of Schiller and Naumann".to_owned(),
        });
        let all = [load("force", &self.force, "N"), load("torque", &self.torque, "N m"), drag];
        let all: Vec<String> = all.into_iter().flatten().collect();
        if all.is_empty() { "only measured".to_owned() } else { all.join(", ") }
    }

    /// Does nothing push?
    pub const fn is_nothing(&self) -> bool {
        self.force.is_none() && self.torque.is_none() && self.drag.is_none()
    }

    /// Force and lift at a time of the stage [s], in N.
    fn load(&self, sphere: &Sphere, time: f64) -> Vec3 {
        let force = self.force.as_ref().map_or_else(Vec3::zeros, |load| load.at(time));
        self.drag.as_ref().map_or(force, |drag| force + drag.lift * sphere.volume)
    }

    /// Forces and torque on a particle that has this velocity [m/s] where it is, at a time of the stage [s].
    pub(super) fn on(
        &self,
        particles: &Particles,
        slot: usize,
        velocity: &Vec3,
        time: f64,
    ) -> Acts {
        let sphere = Sphere::in_slot(particles, slot);
        let torque = self.torque.as_ref().map_or_else(Vec3::zeros, |load| load.at(time));
        let none = Vec3::zeros();
        let mut acts = Acts { force: self.load(&sphere, time), torque, drag: none, fluid: none };
        if let Some(drag) = &self.drag {
            let against = velocity - drag.velocity;
            acts.drag = against * -drag.coefficient(sphere.diameter, against.norm());
            acts.fluid = drag.velocity;
        }
        acts
    }

    /// The velocity that the last kick will give to a particle [m/s]: that at the time of the positions, which is now, if half the step is
    /// 0. `time` is of the stage, and half the step, both in s.
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

/// The velocities that the first kick gives to a particle [m/s, rad/s], at the time of its positions, in half a step [s].
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
