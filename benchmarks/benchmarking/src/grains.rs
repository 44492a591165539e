//! Particles at the start of a scene, and their file.

use dem_grains::math::{Quat, Vec3};
use std::fmt::Write;

/// A particle at the start.
#[derive(Clone, Debug)]
pub struct Grain {
    /// Name of its shape.
    pub shape: &'static str,
    /// Centre [m].
    pub position: Vec3,
    /// Velocity [m/s].
    pub velocity: Vec3,
    /// Orientation, body to world.
    pub orientation: Quat,
    /// Angular velocity, world axes [rad/s].
    pub spin: Vec3,
}

impl Grain {
    /// A particle at rest and upright.
    pub fn at(shape: &'static str, position: impl Into<Vec3>) -> Self {
        let (velocity, spin) = (Vec3::zeros(), Vec3::zeros());
        Self { shape, position: position.into(), velocity, orientation: Quat::identity(), spin }
    }

    /// The particle with this velocity [m/s].
    #[must_use]
    pub fn moving(self, velocity: impl Into<Vec3>) -> Self {
        Self { velocity: velocity.into(), ..self }
    }

    /// The particle with this angular velocity in world axes [rad/s].
    #[must_use]
    pub fn spinning(self, spin: impl Into<Vec3>) -> Self {
        Self { spin: spin.into(), ..self }
    }

    /// The particle with this orientation.
    #[must_use]
    pub fn turned(self, orientation: Quat) -> Self {
        Self { orientation, ..self }
    }
}

/// Text of a file of particles, in the order of their ids.
pub fn csv(grains: &[Grain]) -> String {
    let mut text = "shape,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz\n".to_owned();
    for grain in grains {
        let q = grain.orientation.coords;
        let numbers = grain.position.iter().chain([&q.w, &q.x, &q.y, &q.z]);
        let numbers = numbers.chain(&grain.velocity).chain(&grain.spin);
        let cells: Vec<String> = numbers.map(|x| format!("{x:e}")).collect();
        writeln!(text, "{},{}", grain.shape, cells.join(",")).expect("text");
    }
    text
}

/// A vector in TOML.
pub fn list(v: &Vec3) -> String {
    format!("[{:e}, {:e}, {:e}]", v.x, v.y, v.z)
}
