//! Bodies at rest stay at rest: stacks, piles, long runs.

use crate::cell::{Cell, Deviation};
use crate::scene::{
    DENSITY, G, Grain, Length, MASS, RADIUS, Scene, Step, balls, cuboid, material, shape,
};
use dem_mpi::math::Vec3;
use dem_mpi::random::Random;

/// Name, kind and keys of a shape.
type Grains = (&'static str, &'static str, fn() -> String);

const KINDS: [Grains; 7] = [
    ("balls", "sphere", || format!("radius = {RADIUS}")),
    ("ellipsoids", "ellipsoid", || {
        format!("semi_axes = [{:e}, {RADIUS:e}, {:e}]", 1.3 * RADIUS, 0.8 * RADIUS)
    }),
    ("superellipsoids", "superellipsoid", || {
        format!("semi_axes = [{RADIUS:e}, {RADIUS:e}, {:e}]\nexponents = [0.7, 0.8]", 0.8 * RADIUS)
    }),
    ("rods", "spherocylinder", || format!("radius = {:e}\nlength = {RADIUS:e}", 0.7 * RADIUS)),
    ("bricks", "polyhedron", || cuboid([2.0 * RADIUS, 1.6 * RADIUS, 1.2 * RADIUS])),
    ("rounded bricks", "rounded-polyhedron", || {
        format!(
            "radius = {:e}\n{}",
            0.3 * RADIUS,
            cuboid([1.4 * RADIUS, 1.0 * RADIUS, 0.6 * RADIUS])
        )
    }),
    ("tetrahedra", "polyhedron", || {
        let r = RADIUS;
        let corners = [[r, r, r], [r, -r, -r], [-r, r, -r], [-r, -r, r]];
        format!("vertices = {corners:?}")
    }),
];

pub(super) fn cells() -> Vec<Cell> {
    let mut cells = vec![bricks(10), tower(100)];
    for (name, kind, keys) in KINDS {
        for steps in [10_000, 1_000_000] {
            cells.push(pile(name, kind, &keys(), steps));
        }
    }
    cells.push(resting(10_000_000));
    cells
}

/// Largest speed, at most 1e-6 m/s at rest.
fn at_rest(ran: &crate::cell::Ran) -> Deviation {
    let fastest = ran.particles.velocity.iter().map(Vec3::norm).fold(0.0, f64::max);
    Deviation { what: "speed [m/s]", is: fastest, allowed: 1e-6 }
}

/// A stack of bricks, each on the one below.
fn bricks(count: u32) -> Cell {
    let tables = material("m", DENSITY, 1e5, "friction = 0.5\nrestitution = 0.2")
        + &shape("brick", "polyhedron", &cuboid([0.02, 0.016, 0.012]));
    let grains =
        (0..count).map(|k| Grain::at("brick", [0.0, 0.0, 0.012 * (f64::from(k) + 0.5)])).collect();
    let weight = f64::from(count) * 0.02 * 0.016 * 0.012 * DENSITY * G;
    stack("stack", format!("{count} bricks"), tables, grains, weight).quick()
}

/// Balls in a tube as wide as one ball.
fn tower(count: u32) -> Cell {
    let grains =
        (0..count).map(|k| Grain::at("ball", [0.0, 0.0, RADIUS * f64::from(2 * k + 1)])).collect();
    let tables = balls(1e6, "friction = 0.5\nrestitution = 0.2");
    stack("stack", format!("{count} balls"), tables, grains, f64::from(count) * MASS * G)
}

fn stack(
    row: &'static str,
    value: String,
    tables: String,
    grains: Vec<Grain>,
    weight: f64,
) -> Cell {
    let count = grains.len();
    let mut scene = Scene::on_floor(tables, grains).heavy();
    "global_damping = 20.0".clone_into(&mut scene.keys);
    scene.step = Step::OfLimit(0.5);
    scene.length = Length::Seconds(if count > 50 { 8.0 } else { 1.5 });
    Cell::new(row, value, scene, move |ran| {
        vec![
            at_rest(ran),
            Deviation::of("force on the floor", -ran.last("force_-z_z_N"), weight, weight, 1e-6),
        ]
    })
}

/// Eight particles fall into a box, come to rest under damping, and stay at rest for `steps` steps
/// without it.
fn pile(name: &str, kind: &str, keys: &str, steps: u64) -> Cell {
    let tables = material("m", DENSITY, 1e5, "friction = 0.5\nrestitution = 0.2")
        + &shape("grain", kind, keys);
    let mut random = Random::of(11, 0);
    let place = |k: u32| {
        Vec3::new(f64::from(k % 2), f64::from(k / 2 % 2), f64::from(k / 4)).add_scalar(0.5)
            * (3.6 * RADIUS)
    };
    let grains = (0..8).map(|k| Grain::at("grain", place(k)).turned(random.rotation())).collect();
    let mut scene = Scene::free(tables, grains).heavy();
    (scene.low, scene.high) = (Vec3::zeros(), Vec3::repeat(7.2 * RADIUS));
    "walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\"]".clone_into(&mut scene.domain);
    "global_damping = 10.0".clone_into(&mut scene.keys);
    scene.step = Step::OfLimit(0.5);
    scene.length = Length::Seconds(4.0);
    let mut resting = scene.clone();
    resting.keys.clear();
    resting.length = Length::Steps(steps);
    let value = format!("{name}, {steps} steps");
    let mut cell = Cell::new("pile at rest", value, scene, |ran| vec![at_rest(ran)]);
    cell.stages.push(resting);
    cell
}

/// A ball lies on the floor for many steps.
fn resting(steps: u64) -> Cell {
    let sunk = MASS * G / 1e4;
    let grains = vec![Grain::at("ball", [0.0, 0.0, RADIUS - sunk])];
    let mut scene = Scene::on_floor(balls(1e4, "friction = 0.5"), grains).heavy();
    scene.step = Step::OfLimit(0.9);
    scene.length = Length::Steps(steps);
    Cell::new("ball at rest without damping", format!("{steps} steps"), scene, |ran| {
        vec![at_rest(ran)]
    })
}
