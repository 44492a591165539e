//! Walls that move, close or cross, and opposed servos.

use crate::cell::{Cell, Deviation};
use crate::scene::{DENSITY, Grain, Length, MASS, RADIUS, Scene, Step, balls, material, shape};
use dem_mpi::math::Vec3;

pub(super) fn cells() -> Vec<Cell> {
    let mut cells = Vec::new();
    for speed in [0.01, 1.0, 10.0, 100.0, 1e4] {
        cells.push(hit(speed));
        cells.push(closing(speed));
    }
    for speed in [0.01, 0.1, 1.0, 100.0] {
        cells.push(crossing(speed));
    }
    for (packing, spacing) in [("loose", 2.6), ("dense", 2.02)] {
        for (softness, stiffness) in [("soft", 1e3), ("hard", 1e6)] {
            for gain in [0.01, 0.1, 1.0, 10.0, 100.0] {
                cells.push(servo(&format!("{packing}, {softness}"), spacing, stiffness, gain));
            }
        }
    }
    cells.push(fighting());
    cells
}

/// A wall hits a ball at rest: it leaves at twice the speed of the wall.
fn hit(speed: f64) -> Cell {
    let mut scene =
        Scene::on_floor(balls(1e4, ""), vec![Grain::at("ball", [0.0, 0.0, 1.01 * RADIUS])]);
    scene.step = Step::OfLimit(0.05);
    scene.domain = format!("walls = [\"-z\"]\nwall_velocity = {{ \"-z\" = [0, 0, {speed:e}] }}");
    scene.length = Length::Seconds(0.01 * RADIUS / speed + 5.0 * (MASS / 1e4).sqrt());
    let cell = Cell::new("speed of a wall that hits a ball [m/s]", speed, scene, move |ran| {
        vec![Deviation::of("velocity", ran.particles.velocity[0].z, 2.0 * speed, speed, 0.01)]
    });
    if matches!(speed, 1.0 | 1e4) { cell.quick() } else { cell }
}

/// Two walls close on a ball until there is no space for it.
fn closing(speed: f64) -> Cell {
    let mut scene =
        between(1.5, &format!("{{ \"-z\" = [0, 0, {speed:e}], \"+z\" = [0, 0, {:e}] }}", -speed));
    scene.step = Step::OfLimit(0.05);
    // The stage ends when the gap is a tenth of the diameter.
    scene.length = Length::Seconds(1.4 * RADIUS / speed);
    // There is no correct result here except a warning or error.
    let cell = Cell::new("speed of walls that close on a ball [m/s]", speed, scene, |ran| {
        let depth = ran.figure("/resolution/largest_overlap_over_radius");
        vec![Deviation { what: "overlap over the radius", is: depth, allowed: 0.1 }]
    });
    if speed == 1.0 { cell.quick() } else { cell }
}

/// A floor rises through another, and lifts the ball that lies there.
fn crossing(speed: f64) -> Cell {
    let tables = balls(1e4, "restitution = 0.3")
        + "[[wall]]\nname = \"still\"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n"
        + &format!(
            "[[wall]]\nname = \"rising\"\npoint = [0, 0, {:e}]\nnormal = [0, 0, 1]\nvelocity = [0, 0, {speed:e}]\n",
            -0.5 * RADIUS
        );
    let mut scene = Scene::free(tables, vec![Grain::at("ball", [0.0, 0.0, RADIUS])]).heavy();
    scene.step = Step::OfLimit(0.1);
    scene.length = Length::Seconds(5.0 * RADIUS / speed);
    Cell::new("speed of a floor that passes another [m/s]", speed, scene, |ran| {
        let above = ran.particles.position[0].z - 4.5 * RADIUS;
        vec![Deviation {
            what: "depth below the floor over the radius",
            is: 1.0 - above / RADIUS,
            allowed: 0.05,
        }]
    })
}

/// A ball between two walls, each `half` radii from the middle.
fn between(half: f64, velocities: &str) -> Scene {
    let mut scene = Scene::free(balls(1e4, "restitution = 0.5"), vec![Grain::at("ball", [0.0; 3])]);
    (scene.low.z, scene.high.z) = (-half * RADIUS, half * RADIUS);
    scene.domain = format!("walls = [\"-z\", \"+z\"]\nwall_velocity = {velocities}");
    scene
}

/// A servo presses 64 balls together.
fn servo(packing: &str, spacing: f64, stiffness: f64, gain: f64) -> Cell {
    let stress = 1e-3 * stiffness / RADIUS;
    let wide = 4.0 * spacing * RADIUS;
    let place = |k: u32| {
        let at = [k % 4, k / 4 % 4, k / 16].map(|i| (f64::from(i) + 0.5) * spacing * RADIUS);
        // No ball is exactly above another.
        let aside = if spacing > 2.3 { 0.2 * f64::from(k % 3) - 0.2 } else { 0.0 };
        Vec3::from(at) + Vec3::repeat(aside * RADIUS)
    };
    let grains = (0..64).map(|k| Grain::at("ball", place(k))).collect();
    let tables = format!(
        "{}[[servo]]\nwalls = [\"+z\"]\nstress = {stress:e}\ngain = {gain:e}\nmax_speed = 0.5\n[stop]\nservo = 1e-2\nunbalanced = 1e-2\n",
        balls(stiffness, "friction = 0.3\nrestitution = 0.3")
    );
    let mut scene = Scene::free(tables, grains);
    "global_damping = 5.0".clone_into(&mut scene.keys);
    (scene.low, scene.high) = (Vec3::zeros(), Vec3::repeat(wide));
    "walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"]".clone_into(&mut scene.domain);
    scene.step = Step::OfLimit(0.3);
    scene.length = Length::Steps(40_000);
    let area = wide * wide;
    let row = "gain of a servo";
    let cell = Cell::new(row, format!("{packing}, {gain}"), scene, move |ran| {
        vec![Deviation::of("stress", ran.last("force_+z_z_N") / area, stress, stress, 0.03)]
    });
    if gain == 100.0 && packing == "loose, hard" { cell.quick() } else { cell }
}

/// Two servos require different stresses on opposite sides of a stack of balls.
fn fighting() -> Cell {
    let tables = material("m", DENSITY, 1e5, "restitution = 0.3")
        + &shape("ball", "sphere", &format!("radius = {RADIUS}"))
        + "[[servo]]\nwalls = [\"-z\"]\nstress = 1e5\nmax_speed = 0.2\n[[servo]]\nwalls = [\"+z\"]\nstress = 3e5\nmax_speed = 0.2\n";
    let grains =
        (0..8).map(|k| Grain::at("ball", [0.0, 0.0, RADIUS * f64::from(2 * k + 1)])).collect();
    let mut scene = Scene::free(tables, grains);
    (scene.low, scene.high) =
        (Vec3::new(-1.0, -1.0, 0.0) * (1.5 * RADIUS), Vec3::new(1.5, 1.5, 16.0) * RADIUS);
    "walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"]".clone_into(&mut scene.domain);
    scene.step = Step::OfLimit(0.3);
    scene.length = Length::Steps(40_000);
    Cell::new("servos that fight", "1e5, 3e5 Pa", scene, |ran| {
        let error = ran.report["targets"].as_array().map_or(0.0, |targets| {
            targets.iter().filter_map(|t| t["error"].as_f64()).fold(0.0, f64::max)
        });
        vec![Deviation { what: "error of a servo", is: error, allowed: 0.05 }]
    })
}
