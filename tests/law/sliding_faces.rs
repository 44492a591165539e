//! A plate that slides and spins on the floor, against Coulomb friction at each point under even pressure, integrated over the
//! face. Farkas et al. 2003, DOI 10.1103/PhysRevLett.90.248302, give closed forms for discs. Translation and spin share one
//! limit.

use crate::support::{Bench, scene};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::particles::records::Particle;

const FRICTION: f64 = 0.3;
const GRAVITY: f64 = 9.81;
const THICKNESS: f64 = 0.004;
const DENSITY: f64 = 2500.0;

/// Velocity along x and y [m/s], spin [rad/s], and rotation of the plate [rad].
type State = [f64; 4];

/// Rate of change of the state by friction at many points.
fn rate(edges: [f64; 2], [vx, vy, spin, turn]: State) -> State {
    const POINTS: u32 = 40;
    let middle = |k: u32| (f64::from(k) + 0.5) / f64::from(POINTS) - 0.5;
    let (sin, cos) = turn.sin_cos();
    let mut sum = [0.0; 3];
    for (i, j) in (0..POINTS).flat_map(|i| (0..POINTS).map(move |j| (i, j))) {
        let (along, across) = (edges[0] * middle(i), edges[1] * middle(j));
        let (x, y) = (cos * along - sin * across, sin * along + cos * across);
        let (u, v) = (vx - spin * y, vy + spin * x);
        let size = (u * u + v * v).sqrt();
        for (sum, part) in sum.iter_mut().zip([u, v, x * v - y * u]) {
            *sum += part / size;
        }
    }
    let mean = sum.map(|sum| -FRICTION * GRAVITY * sum / f64::from(POINTS * POINTS));
    let gyration = (edges[0] * edges[0] + edges[1] * edges[1]) / 12.0;
    [mean[0], mean[1], mean[2] / gyration, spin]
}

fn by_points(edges: [f64; 2], speed: f64, spin: f64, time: f64) -> (f64, f64) {
    let mut state = [speed, 0.0, spin, 0.0];
    let dt = time / 200.0;
    for _ in 0..200 {
        let first = rate(edges, state);
        let half = std::array::from_fn(|k| state[k] + 0.5 * dt * first[k]);
        let second = rate(edges, half);
        state = std::array::from_fn(|k| state[k] + dt * second[k]);
    }
    (state[0].hypot(state[1]), state[2])
}

fn by_the_program(edges: [f64; 2], speed: f64, spin: f64, time: f64) -> (f64, f64) {
    let dt = 9e-6;
    let text = format!(
        r#"
gravity = [0, 0, -{GRAVITY}]
[domain]
low = [-2, -2, 0]
high = [2, 2, 1]
walls = ["-z"]
[[material]]
name = "m"
density = {DENSITY}
normal_stiffness = 1e5
friction = {FRICTION}
restitution = 0.3
[[shape]]
name = "plate"
kind = "polyhedron"
edges = [{}, {}, {THICKNESS}]
[time]
step = {dt:e}
"#,
        edges[0], edges[1]
    );
    let mass = DENSITY * edges[0] * edges[1] * THICKNESS;
    let inertia = mass * (edges[0] * edges[0] + edges[1] * edges[1]) / 12.0;
    let height = 0.5 * THICKNESS - mass * GRAVITY / 1e5;
    let plate = Particle {
        velocity: Vec3::x() * speed,
        angular_velocity: Vec3::z() * spin,
        angular_momentum: Vec3::z() * (spin * inertia),
        ..Particle::at_rest(GlobalId(0), ShapeId(0), Vec3::new(0.0, 0.0, height))
    };
    let mut bench = Bench::of(&scene(&text), &[plate]);
    for _ in 0..(time / dt).round() as u32 {
        bench.step();
    }
    let particles = &bench.sim.particles;
    let spins = particles.spin.as_ref().expect("plates turn");
    (particles.velocity[0].xy().norm(), spins.angular_velocity[0].z)
}

#[test]
fn a_plate_slides_and_spins_as_even_pressure_says() {
    let square = [0.04, 0.04];
    for (edges, speed, spin, time) in [
        (square, 0.3, 20.0, 0.05),
        (square, 0.1, 20.0, 0.02),
        (square, 0.2, 15.0, 0.04),
        (square, 0.3, 0.0, 0.05),
        (square, 0.0, 20.0, 0.05),
        ([0.08, 0.02], 0.0, 20.0, 0.05),
        ([0.12, 0.012], 0.0, 20.0, 0.05),
    ] {
        let right = by_points(edges, speed, spin, time);
        let found = by_the_program(edges, speed, spin, time);
        eprintln!("{edges:?}, {speed} m/s, {spin} rad/s: {found:.4?}, right {right:.4?}");
        assert!((found.0 - right.0).abs() <= 0.03 * speed.max(1e-3), "{found:?}, right {right:?}");
        assert!((found.1 - right.1).abs() <= 0.03 * spin.max(1e-3), "{found:?}, right {right:?}");
    }
}
