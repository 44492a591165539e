//! Extreme speeds, overlaps, places, units and spins.

use crate::cell::{Cell, Deviation};
use crate::scene::{DENSITY, Grain, Length, MASS, RADIUS, Scene, Step, balls, material, shape};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::Vec3;
use dem_mpi::scene::{Scene as Checked, assemble};

pub(super) fn cells() -> Vec<Cell> {
    let mut cells = Vec::new();
    for way in [0.001, 0.01, 0.1, 0.3, 1.0, 3.0, 30.0] {
        cells.push(fast_grains(way));
        cells.push(fast_at_wall(way));
    }
    for depth in [0.001, 0.02, 0.049, 0.051, 0.5, 0.99, 1.0] {
        cells.push(overlapping(depth));
    }
    for exponent in [0, 3, 6, 9, 10, 11, 12, 13, 14] {
        cells.push(far_away(exponent));
    }
    for exponent in [-100, -60, -20, 20, 60] {
        cells.push(units("unit of length [2^n m]", exponent, [1, 0, 0]));
        cells.push(units("unit of mass [2^n kg]", exponent, [0, 1, 0]));
        cells.push(units("unit of time [2^n s]", exponent, [0, 0, 1]));
    }
    for exponent in 0..=6 {
        cells.push(spinning(
            "spin of a ball [rad/s]",
            exponent,
            "sphere",
            &format!("radius = {RADIUS}"),
        ));
        let axes = format!("semi_axes = [{}, {RADIUS}, {}]", 1.5 * RADIUS, 0.8 * RADIUS);
        cells.push(spinning("spin of an ellipsoid [rad/s]", exponent, "ellipsoid", &axes));
    }
    cells
}

/// Two balls collide and exchange their velocities; `way` is the displacement of one in a step, over its radius.
fn fast_grains(way: f64) -> Cell {
    let mut scene = Scene::free(balls(1e4, ""), Vec::new());
    scene.step = Step::OfLimit(0.2);
    let speed = way * RADIUS / scene.dt();
    let gap = 10.3 * way * RADIUS;
    scene.grains = vec![
        Grain::at("ball", [-RADIUS - gap, 0.0, 0.0]).moving([speed, 0.0, 0.0]),
        Grain::at("ball", [RADIUS + gap, 0.0, 0.0]).moving([-speed, 0.0, 0.0]),
    ];
    scene.length = Length::Seconds(gap / speed + 4.0 * (MASS / 1e4).sqrt());
    let cell = Cell::new("way in a step over the radius, two grains", way, scene, move |ran| {
        let [a, b] = [0, 1].map(|k| ran.particles.velocity[k].x);
        vec![
            Deviation::of("velocity of the first", a, -speed, speed, 0.01),
            Deviation::of("momentum", a + b, 0.0, speed, 1e-12),
        ]
    });
    if matches!(way, 0.3 | 3.0) { cell.quick() } else { cell }
}

/// A ball hits the floor; `way` is its displacement in a step, over its radius.
fn fast_at_wall(way: f64) -> Cell {
    let mut scene = Scene::on_floor(balls(1e4, ""), Vec::new());
    scene.step = Step::OfLimit(0.2);
    let speed = way * RADIUS / scene.dt();
    let gap = 10.3 * way * RADIUS;
    scene.grains = vec![Grain::at("ball", [0.0, 0.0, RADIUS + gap]).moving([0.0, 0.0, -speed])];
    scene.length = Length::Seconds(gap / speed + 5.0 * (MASS / 1e4).sqrt());
    let cell =
        Cell::new("way in a step over the radius, a grain and a wall", way, scene, move |ran| {
            vec![Deviation::of("velocity", ran.particles.velocity[0].z, speed, speed, 0.01)]
        });
    if way == 3.0 { cell.quick() } else { cell }
}

/// Two balls begin with an overlap, given over their diameter, and separate with its energy.
fn overlapping(depth: f64) -> Cell {
    let stiffness = 1e5;
    let overlap = depth * 2.0 * RADIUS;
    let half = RADIUS - 0.5 * overlap;
    let grains = vec![Grain::at("ball", [-half, 0.0, 0.0]), Grain::at("ball", [half, 0.0, 0.0])];
    let mut scene = Scene::free(balls(stiffness, ""), grains);
    scene.step = Step::OfLimit(0.1);
    scene.length = Length::Seconds(4.0 * (MASS / stiffness).sqrt());
    let speed = overlap * (0.5 * stiffness / MASS).sqrt();
    let cell = Cell::new("overlap at the start over the diameter", depth, scene, move |ran| {
        vec![Deviation::of("speed", ran.particles.velocity[1].x, speed, speed, 0.01)]
    });
    if matches!(depth, 0.5 | 1.0) { cell.quick() } else { cell }
}

/// A ball falls on a floor `10^exponent` radii from the origin.
fn far_away(exponent: i32) -> Cell {
    let far = if exponent == 0 { 0.0 } else { RADIUS * 10_f64.powi(exponent) };
    let stiffness = 1e4;
    let mut scene = Scene::on_floor(balls(stiffness, "restitution = 0.5"), Vec::new());
    let gap = 20.0 * scene.dt();
    scene.low.z += far;
    scene.high.z += far;
    scene.grains = vec![Grain::at("ball", [0.0, 0.0, far + RADIUS + gap]).moving([0.0, 0.0, -1.0])];
    scene.length = Length::Seconds(gap + 8.0 * (MASS / stiffness).sqrt());
    let cell = Cell::new("radii from the origin", format!("1e{exponent}"), scene, |ran| {
        vec![Deviation::of("speed after the bounce", ran.particles.velocity[0].z, 0.5, 1.0, 0.01)]
    });
    if exponent == 14 { cell.quick() } else { cell }
}

/// Units of length, mass and time: powers of two, which do not change any digit.
type Units = [f64; 3];

/// A ball that falls obliquely and spinning on a floor with friction, in other units.
fn units(row: &'static str, exponent: i32, powers: [i32; 3]) -> Cell {
    let units = powers.map(|power| 2_f64.powi(power * exponent));
    let cell = Cell::new(row, exponent, askew(units), move |ran| {
        let velocity = ran.particles.velocity[0] * (units[2] / units[0]);
        let off = (velocity - last_velocity(&askew([1.0; 3]))).norm();
        vec![Deviation { what: "velocity in other digits", is: off, allowed: 0.0 }]
    });
    if matches!(exponent, -100 | 60) { cell.quick() } else { cell }
}

fn askew([length, mass, time]: Units) -> Scene {
    let radius = 0.007_812_5 * length;
    let speed = length / time;
    let keys = "restitution = 0.5\nfriction = 0.5";
    let density = 2048.0 * mass / (length * length * length);
    let tables = material("m", density, 8192.0 * mass / (time * time), keys)
        + &shape("ball", "sphere", &format!("radius = {radius:e}"));
    let grains = vec![
        Grain::at("ball", [0.0, 0.0, 1.125 * radius])
            .moving([0.5 * speed, 0.25 * speed, -speed])
            .spinning([16.0 / time, 0.0, 8.0 / time]),
    ];
    let wide = 64.0 * radius;
    let scene = Scene {
        gravity: Vec3::new(0.0, 0.0, -8.0 * length / (time * time)),
        low: Vec3::new(-wide, -wide, 0.0),
        high: Vec3::repeat(wide),
        ..Scene::on_floor(tables, grains)
    };
    scene.lasting(Step::Seconds(2_f64.powi(-14) * time), Length::Steps(600))
}

/// Velocity of the first particle at the end, computed by the library of the program [m/s].
fn last_velocity(scene: &Scene) -> Vec3 {
    let (text, grains) = scene.texts(None);
    let folder = tempfile::tempdir().expect("a folder for the particles");
    std::fs::write(folder.path().join("grains.csv"), grains).expect("the file of particles");
    let scene =
        Checked::parse(&text, "units", folder.path(), &[]).unwrap_or_else(|e| panic!("{e}"));
    let comm = &mut Alone::default();
    let mut sim = assemble::assemble(&scene, comm);
    assemble::fill(&mut sim, &scene, comm);
    sim.begin(comm).unwrap_or_else(|error| panic!("{error}"));
    for _ in 0..scene.steps {
        sim.step(comm).unwrap_or_else(|error| panic!("{error}"));
    }
    sim.particles.velocity[0]
}

/// A particle spins freely.
fn spinning(row: &'static str, exponent: i32, kind: &str, keys: &str) -> Cell {
    let spin = 10_f64.powi(exponent);
    let tables = material("m", DENSITY, 1e4, "friction = 0.5") + &shape("grain", kind, keys);
    let axis = Vec3::new(2.0, -1.0, 2.0) / 3.0;
    let grains = vec![Grain::at("grain", [0.0; 3]).spinning(axis * spin)];
    let mut scene = Scene::free(tables, grains);
    scene.step = Step::Seconds(1e-5);
    scene.length = Length::Steps(10_000);
    let cell = Cell::new(row, format!("1e{exponent}"), scene, |ran| {
        let (now, came) = (ran.last("kinetic_J"), ran.last("received_J"));
        vec![Deviation::of("energy", now, came, came, 1e-3)]
    });
    if exponent == 6 { cell.quick() } else { cell }
}
