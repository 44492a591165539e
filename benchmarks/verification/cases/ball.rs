//! Balls, and a ball thrown at a floor, for several sources.

use super::{Grain, Plane, Setup, Ways};
use dem_mpi::math::Vec3;
use std::f64::consts::PI;

/// A ball and its material, which is also that of the floor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    /// Radius [m].
    pub(crate) radius: f64,
    /// Density [kg/m³].
    pub(crate) density: f64,
    /// Normal stiffness [N/m].
    pub(crate) normal: f64,
    /// Tangential stiffness [N/m].
    pub(crate) tangential: f64,
    /// Coefficient of friction.
    pub(crate) friction: f64,
    /// Coefficient of restitution.
    pub(crate) restitution: f64,
    /// Whether the dashpot may pull at the end of a contact.
    pub(crate) pulls: bool,
}

impl Ball {
    /// Mass [kg].
    pub(crate) fn mass(&self) -> f64 {
        4.0 / 3.0 * PI * self.radius.powi(3) * self.density
    }

    /// Fraction of critical damping of a dashpot that may pull.
    pub(crate) fn damping_ratio(&self) -> f64 {
        let log = self.restitution.ln();
        -log / PI.hypot(log)
    }

    /// Duration of a contact with a wall, without gravity and friction [s]; for two equal balls shorter by √2.
    pub(crate) fn contact_time(&self) -> f64 {
        let z = self.damping_ratio();
        PI / ((self.normal / self.mass()).sqrt() * (1.0 - z * z).sqrt())
    }

    /// Text in a scene: material `m`, shape `ball`.
    pub(crate) fn text(&self) -> String {
        let Self { radius, density, normal, tangential, friction, restitution, pulls } = self;
        format!(
            r#"[law]
limit_damping = {}
[[material]]
name = "m"
density = {density:e}
normal_stiffness = {normal:e}
tangential_stiffness = {tangential:e}
friction = {friction:e}
restitution = {restitution:e}
[[shape]]
name = "ball"
kind = "sphere"
radius = {radius:e}"#,
            !pulls
        )
    }

    /// The ball alone over the floor z = 0, with its lowest point at `height` [m] and these velocities.
    pub(crate) fn over_floor(&self, height: f64, velocity: Vec3, spin: Vec3, dt: f64) -> Setup {
        let place = Vec3::new(0.0, 0.0, self.radius + height);
        Setup {
            gravity: Vec3::zeros(),
            text: self.text(),
            planes: vec![Plane::floor("m")],
            grains: vec![Grain::at("ball", place).moving(velocity).spinning(spin)],
            dt,
        }
    }

    /// Throws the ball at the floor without gravity, in all `Ways`. The z component of the velocity must be
    /// negative.
    pub(crate) fn impact(&self, throw: &Throw, ways: &mut Ways, name: &str) -> Rebound {
        let dt = self.contact_time() / throw.steps_per_contact;
        // Touch occurs within the first step, at an arbitrary time.
        let height = -throw.velocity.z * dt * 0.37;
        let setup = self.over_floor(height, throw.velocity, throw.spin, dt);
        let steps = (1.2 * throw.steps_per_contact) as u64 + 5;
        let frames = ways.run(name, &setup, steps, 1);
        let end = &frames[frames.len() - 1];
        assert!(frames.iter().any(super::Frame::is_touching) && !end.is_touching(), "{name}");
        let most = frames.iter().map(super::Frame::kinetic).fold(0.0, f64::max);
        Rebound {
            velocity: end.bodies[0].velocity,
            spin: end.bodies[0].spin,
            energy: end.kinetic() / frames[0].kinetic(),
            most_energy: most / frames[0].kinetic(),
        }
    }
}

/// Initial motion of a ball thrown at a floor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Throw {
    /// Velocity [m/s].
    pub(crate) velocity: Vec3,
    /// Angular velocity [rad/s].
    pub(crate) spin: Vec3,
    /// Number of steps per contact.
    pub(crate) steps_per_contact: f64,
}

impl Throw {
    /// Throw with this speed [m/s] at an angle [degrees] from the normal, towards +x.
    pub(crate) fn oblique(speed: f64, degrees: f64, steps_per_contact: f64) -> Self {
        let angle = degrees.to_radians();
        let velocity = Vec3::new(speed * angle.sin(), 0.0, -speed * angle.cos());
        Self { velocity, spin: Vec3::zeros(), steps_per_contact }
    }
}

/// Rebound of a ball.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rebound {
    /// Velocity [m/s].
    pub(crate) velocity: Vec3,
    /// Angular velocity [rad/s].
    pub(crate) spin: Vec3,
    /// Kinetic energy over that before the impact.
    pub(crate) energy: f64,
    /// Largest kinetic energy on the way over that before the impact.
    pub(crate) most_energy: f64,
}
