//! Spherocylinders that oscillate in and on a cylinder, with the periods of rigid-body mechanics.

use crate::support::{Bench, close, scene};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::Scene;
use dem_mpi::shape::{Convex, Spherocylinder};
use std::f64::consts::FRAC_PI_2;

const GRAVITY: f64 = 9.81;
/// Radius of the wall, a cylinder about y [m].
const WALL: f64 = 0.05;
/// Radius of the rod [m].
const RADIUS: f64 = 0.005;
/// Length of the rod's axis [m].
const LENGTH: f64 = 0.03;
/// Distance from the axis of the wall to a rod that lies along it inside [m].
const APART: f64 = WALL - RADIUS;

/// An oscillation of one coordinate `q` [rad] about 0.
struct Swing<'a> {
    what: &'a str,
    friction: f64,
    stiffness: f64,
    dt: f64,
    /// Largest `q`.
    most: f64,
    /// Initial direction of the rod's axis and position of its centre, from the mass over the stiffness.
    start: &'a dyn Fn(f64) -> (Vec3, Vec3),
    /// `q` from the direction of the axis and the position of the centre.
    now: &'a dyn Fn(&Vec3, &Vec3) -> f64,
    /// Twice the kinetic energy over mass and `q'²` [m²], and the height of the centre [m].
    inertia_and_height: &'a dyn Fn(f64) -> [f64; 2],
    tolerance: f64,
}

impl Swing<'_> {
    fn scene(&self) -> Scene {
        scene(&format!(
            r#"
gravity = [0, 0, {:?}]
[domain]
low = [-0.1, -0.1, -0.1]
high = [0.1, 0.1, 0.1]
[[wall]]
name = "round"
cylinder = {{ from = [0, -0.1, 0], to = [0, 0.1, 0], radius = {WALL:?} }}
[[material]]
name = "m"
density = 2500
normal_stiffness = {:?}
friction = {:?}
[[shape]]
name = "rod"
kind = "spherocylinder"
length = {LENGTH:?}
radius = {RADIUS:?}
[time]
step = {:?}
"#,
            -GRAVITY, self.stiffness, self.friction, self.dt
        ))
    }

    /// Period `4 ∫ dq / q'` from 0 to the largest `q`, by the energy, with the substitution `q = sin t` times the largest.
    fn period(&self) -> f64 {
        let count = 1000;
        let slice = FRAC_PI_2 / f64::from(count);
        let [_, top] = (self.inertia_and_height)(self.most);
        let of_slice = |k: i32| {
            let (sin, cos) = ((f64::from(k) + 0.5) * slice).sin_cos();
            let [inertia, height] = (self.inertia_and_height)(self.most * sin);
            self.most * cos * (inertia / (2.0 * GRAVITY * (top - height))).sqrt()
        };
        4.0 * slice * (0..count).map(of_slice).sum::<f64>()
    }

    fn measured(&self) -> f64 {
        let scene = self.scene();
        let (axis, position) = (self.start)(scene.library.mass[0] / self.stiffness);
        let rod = Particle {
            quaternion: Quat::rotation_between(&Vec3::x(), &axis).expect("not opposite"),
            ..Particle::at_rest(GlobalId(0), ShapeId(0), position)
        };
        let mut bench = Bench::of(&scene, &[rod]);
        let (mut before, mut passes) = (self.most, Vec::new());
        for step in 1..(2.6 * self.period() / self.dt) as u32 {
            bench.step();
            let particles = &bench.sim.particles;
            let turn = particles.orientation.as_ref().expect("rods turn").quaternion[0];
            let now = (self.now)(&(turn * Vec3::x()), &particles.position[0]);
            if before > 0.0 && now <= 0.0 {
                passes.push(self.dt * (f64::from(step) - now / (now - before)));
            }
            before = now;
        }
        (passes[passes.len() - 1] - passes[0]) / (passes.len() - 1) as f64
    }

    fn check(&self) {
        close(self.measured(), self.period(), self.tolerance, self.what);
    }
}

/// Squares of the radii of gyration [m²], about the axis of the rod and across it.
fn gyration() -> [f64; 2] {
    let of = Spherocylinder { length: LENGTH, radius: RADIUS }.gyration();
    [of.x, of.y]
}

/// A rod along the cylinder moves inside it like a point, and slower if it rolls.
#[test]
fn a_rod_along_the_cylinder_slides_or_rolls() {
    let [about, _] = gyration();
    let start = |pressed: f64| {
        let (sin, cos) = 0.2_f64.sin_cos();
        (Vec3::y(), Vec3::new(sin, 0.0, -cos) * (APART + pressed))
    };
    for (what, friction, extra) in [("slides", 0.0, 0.0), ("rolls", 0.8, about / RADIUS.powi(2))] {
        Swing {
            what,
            friction,
            stiffness: 1e6,
            dt: 5e-6,
            most: 0.2,
            start: &start,
            now: &|_, place| place.x.atan2(-place.z),
            inertia_and_height: &|q| [APART * APART * (1.0 + extra), -APART * q.cos()],
            tolerance: 1e-5,
        }
        .check();
    }
}

/// A rod across the cylinder touches it with both ends, and is a pendulum about the axis.
#[test]
fn a_rod_across_the_cylinder_is_a_pendulum() {
    let [_, across] = gyration();
    let arm = (APART.powi(2) - (0.5 * LENGTH).powi(2)).sqrt();
    Swing {
        what: "across",
        friction: 0.0,
        stiffness: 1e6,
        dt: 5e-6,
        most: 0.2,
        start: &|_| {
            let (sin, cos) = 0.2_f64.sin_cos();
            (Vec3::new(cos, 0.0, sin), Vec3::new(sin, 0.0, -cos) * arm)
        },
        now: &|_, place| place.x.atan2(-place.z),
        inertia_and_height: &|q| [arm * arm + across, -arm * q.cos()],
        tolerance: 1e-5,
    }
    .check();
}

/// A rod at the bottom, rotated about the vertical, stands on its ends. With a soft material and a small angle it lies on its whole
/// length like on an elastic foundation. It then rises by a third as much.
#[test]
fn a_turned_rod_swings_back() {
    let [_, across] = gyration();
    let end = 0.5 * LENGTH;
    let now = |axis: &Vec3, _: &Vec3| axis.x.atan2(axis.y);
    let hard = 0.1_f64;
    // Height of the rotated rod relative to the axis of the cylinder.
    let low = |q: f64| -(APART.powi(2) - (end * q.sin()).powi(2)).sqrt();
    Swing {
        what: "turned, hard",
        friction: 0.0,
        stiffness: 1e7,
        dt: 2e-6,
        most: hard,
        start: &|_| (Vec3::new(hard.sin(), hard.cos(), 0.0), Vec3::z() * low(hard)),
        now: &now,
        inertia_and_height: &|q| {
            let climbs = end * end * q.sin() * q.cos() / -low(q);
            [across + climbs * climbs, low(q)]
        },
        tolerance: 1e-5,
    }
    .check();
    let (soft, stiffness) = (5e-4_f64, 1e4);
    Swing {
        what: "turned, soft",
        friction: 0.0,
        stiffness,
        dt: 5e-6,
        most: soft,
        start: &|pressed| (Vec3::new(soft.sin(), soft.cos(), 0.0), -Vec3::z() * (APART + pressed)),
        now: &now,
        inertia_and_height: &|q| [across, (LENGTH * q).powi(2) / (24.0 * APART)],
        // Its effective depth includes the overlap, which is 1.5e-4 of the distance to the axis.
        tolerance: 1e-4,
    }
    .check();
}

/// A rod across the top of the cylinder rocks like a plank of half its thickness.
#[test]
fn a_rod_rocks_on_a_cylinder() {
    let [_, across] = gyration();
    let most = 0.05_f64;
    let place = |q: f64| {
        let (sin, cos) = q.sin_cos();
        let along = Vec3::new(cos, 0.0, -sin);
        (along, Vec3::new(sin, 0.0, cos) * (WALL + RADIUS) - along * (WALL * q))
    };
    Swing {
        what: "rocks",
        friction: 0.8,
        stiffness: 1e6,
        dt: 5e-6,
        most,
        start: &|pressed| {
            let (along, at) = place(most);
            (along, at * (1.0 - pressed / WALL))
        },
        now: &|axis, _| -axis.z.asin(),
        inertia_and_height: &|q| [across + RADIUS * RADIUS + (WALL * q).powi(2), place(q).1.z],
        tolerance: 1e-5,
    }
    .check();
}
