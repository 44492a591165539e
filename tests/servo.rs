//! Walls that keep a stress or move at a given velocity.

use crate::support::{Bench, begun, scene};
use dem_mpi::comm::alone::Alone;
use dem_mpi::drive::servo::{Pressed, Servo};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::particles::records::Particle;
use dem_mpi::post::history::History;
use dem_mpi::post::{Settings, analyse};
use dem_mpi::scene::assemble::{self, From};
use dem_mpi::sim::StepError;
use dem_mpi::sim::run::{self, Ending, Schedule};
use serde_json::Value;
use std::f64::consts::PI;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

fn reference() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/dem_servo.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("a number, not {value}"))
}

/// The rows of a list of lists.
fn rows(value: &Value) -> Vec<Vec<f64>> {
    let row = |row: &Value| row.as_array().unwrap().iter().map(number).collect();
    value.as_array().unwrap().iter().map(row).collect()
}

/// Columns of spheres, by name, of which the reference has the quasi-static solution.
fn columns() -> Vec<(String, Value)> {
    let cases = reference()["cases"].as_array().unwrap().clone();
    let named = |case: Value| (case["name"].as_str().unwrap().to_owned(), case);
    cases.into_iter().map(named).filter(|(_, case)| case["columns"].is_u64()).collect()
}

/// The reference takes the stiffness of one contact for that of the wall: a gain of the number of columns.
fn servo(case: &Value) -> Servo {
    Servo {
        walls: vec![0],
        stress: number(&case["target"]),
        max_speed: number(&case["v_max"]),
        gain: number(&case["columns"]),
    }
}

#[test]
fn the_displacement_is_that_of_the_reference() {
    let mut seen = 0;
    for (name, case) in columns() {
        let servo = servo(&case);
        let (area, dt) = (number(&case["area"]), number(&case["dt"]));
        let stiffness = number(&case["contact_stiffness"]) * number(&case["columns"]);
        let sample = number(&case["sample_stiffness"]);
        let mut moved = 0.0;
        let mut done = 0.0;
        for row in rows(&case["steps_n_stress_displacement"]) {
            while done < row[0] {
                let pressed = Pressed { area, force: sample * moved, stiffness };
                moved += servo.displacement(&pressed, dt);
                done += 1.0;
            }
            assert!((moved - row[2]).abs() <= 1e-12 * row[2], "{name} at {done}: {moved:e}");
            let stress = sample * moved / area;
            assert!((stress - row[1]).abs() <= 1e-12 * row[1], "{name} at {done}: {stress:e}");
        }
        seen += 1;
    }
    assert_eq!(seen, 5);
    // Uncapped, as the closed form says: one part of the error is left after each step.
    let servo = Servo { walls: vec![0], stress: 1e5, max_speed: 1e9, gain: 1.0 };
    let (area, stiffness, sample) = (0.02, 3e5, 1e5);
    let mut moved = 0.0;
    for n in 1..40 {
        moved += servo.displacement(&Pressed { area, force: sample * moved, stiffness }, 1e-5);
        let expected = 1e5 * (1.0 - (1.0 - sample / stiffness).powi(n));
        assert!((sample * moved / area / expected - 1.0).abs() < 1e-13);
    }
    // Nothing touches: it comes in.
    let nothing = Pressed { area, ..Pressed::default() };
    assert_eq!(Servo { max_speed: 0.5, ..servo }.displacement(&nothing, 1e-5), 5e-6);
}

/// A box across x from 0 to `length`, 0.04 m by 0.04 m, with a servo on +x, and spheres along x.
fn column_scene(
    length: f64,
    radius: f64,
    mass: f64,
    stiffness: f64,
    damping: f64,
    servo: &Servo,
) -> String {
    let density = mass / (4.0 / 3.0 * PI * radius.powi(3));
    format!(
        r#"
title = "column"
global_damping = {damping:e}
[domain]
low = [0, -0.02, -0.02]
high = [{length:e}, 0.02, 0.02]
walls = ["-x", "+x", "-y", "+y", "-z", "+z"]
[[servo]]
walls = ["+x"]
stress = {:e}
max_speed = {:e}
gain = {:e}
[[material]]
name = "m"
density = {density:e}
normal_stiffness = {stiffness:e}
[[shape]]
name = "grain"
kind = "sphere"
radius = {radius:e}
[[fill.lattice]]
first = [0, 0, 0]
spacing = 1
count = [1, 1, 1]
[time]
step = 1e-5
steps = 1
allow_unstable = true
[output]
directory = "out"
"#,
        servo.stress, servo.max_speed, servo.gain
    )
}

fn sphere(id: u64, position: Vec3) -> Particle {
    Particle::at_rest(GlobalId(id), ShapeId(0), position)
}

/// Stress on the wall across x that looks to -x [Pa], and where it stands [m].
fn on_top(bench: &mut Bench) -> (f64, f64) {
    (bench.measure().wall_forces[1].x / 0.0016, bench.sim.particles.walls[1].point.x)
}

/// The real simulation of light and damped spheres stays near the quasi-static solution, behind it by some
/// steps, and ends in it.
#[test]
fn columns_of_spheres_follow_the_reference() {
    for (name, case) in columns() {
        let get = |key: &str| number(&case[key]);
        if !case["stable"].as_bool().unwrap() {
            continue;
        }
        let (count, radius) = (get("spheres_per_column"), 0.005);
        let length = 2.0 * radius * count;
        let stiffness = get("contact_stiffness");
        // A contact swings in 12 steps, and is damped in 3. The whole stiffness of the wall, so that inertia is borne.
        let text = column_scene(
            length,
            radius,
            stiffness * 4e-10,
            stiffness,
            6e4,
            &Servo { gain: 1.0, ..servo(&case) },
        );
        let places = [[0.0, 0.0], [-0.01, 0.01], [0.01, -0.01]];
        let mut spheres = Vec::new();
        for place in &places[..get("columns") as usize] {
            for k in 0..count as usize {
                let x = radius * (2 * k + 1) as f64;
                spheres.push(sphere(spheres.len() as u64, Vec3::new(x, place[0], place[1])));
            }
        }
        let mut bench = Bench::new(&text, &spheres);
        let step = get("v_max") * get("dt") * get("sample_stiffness") / get("area");
        for row in rows(&case["steps_n_stress_displacement"]) {
            while (bench.sim.step as f64) < row[0] {
                bench.step();
            }
            let (stress, place) = on_top(&mut bench);
            let behind = (row[1] - stress).abs() / step;
            assert!(behind < 20.0, "{name} at {}: {stress} Pa, {behind} steps behind", row[0]);
            assert!((length - place - row[2]).abs() < 30.0 * get("v_max") * get("dt"), "{name}");
        }
        let (stress, place) = on_top(&mut bench);
        let moved = (length - place) / get("wall_displacement_at_target");
        assert!((stress / get("target") - 1.0).abs() < 1e-9, "{name}: {stress}");
        assert!((moved - 1.0).abs() < 1e-9, "{name}: {moved}");
        assert!(bench.sim.servos.warnings.is_empty(), "{name}: {:?}", bench.sim.servos.warnings);
    }
}

#[test]
fn a_sphere_with_inertia_follows_the_reference() {
    let cases = reference();
    let case = cases["cases"].as_array().unwrap().last().unwrap();
    let get = |key: &str| number(&case[key]);
    let radius = get("R");
    let servo = Servo { walls: vec![1], stress: get("target"), max_speed: get("v_max"), gain: 1.0 };
    let text = column_scene(2.0 * radius, radius, get("mass"), get("k"), get("global_xi"), &servo);
    let sphere = sphere(0, Vec3::new(radius, 0.0, 0.0));
    let mut bench = Bench::new(&text, &[sphere]).with_middle_velocities();
    let mut seen = 0;
    for row in rows(&case["trajectory_n_sigmatop_sigmabottom_x_v_H"]) {
        while (bench.sim.step as f64) < row[0] {
            bench.step();
        }
        let (top, height) = on_top(&mut bench);
        let bottom = -bench.measure().wall_forces[0].x / 0.0016;
        let (x, v) = (bench.sim.particles.position[0].x, bench.middle_velocity(0).x);
        // An ulp of a position, some hundred of which add up, is 1e-10 of the overlap.
        for (found, expected, scale) in [
            (top, row[1], 1e5),
            (bottom, row[2], 1e5),
            (x, row[3], 0.01),
            (v, row[4], 1.0),
            (height, row[5], 0.02),
        ] {
            assert!(
                (found - expected).abs() < 1e-9 * scale,
                "{}: {found:e}, not {expected:e}",
                row[0]
            );
        }
        seen += 1;
    }
    assert!(seen > 10);
}

/// Too high a gain makes the stress jump from side to side, as in the reference, and is told once.
#[test]
fn a_servo_that_swings_is_told_once() {
    let servo = |gain| Servo { walls: vec![1], stress: 1e5, max_speed: 1.0, gain };
    for (gain, warnings) in [(1.0, 0), (8.0, 1)] {
        let text = column_scene(0.01, 0.005, 6e-5, 1.5e5, 6e4, &servo(gain));
        let mut bench = Bench::new(&text, &[sphere(0, Vec3::new(0.005, 0.0, 0.0))]);
        for _ in 0..3000 {
            bench.step();
        }
        assert_eq!(bench.sim.servos.warnings.len(), warnings, "{:?}", bench.sim.servos.warnings);
        for warning in &bench.sim.servos.warnings {
            assert!(warning.contains("+x") && warning.contains("`gain` = 4.00"), "{warning}");
        }
    }
}

/// A wall with a servo may slide along itself: shear under a normal stress.
#[test]
fn a_wall_under_stress_slides_as_the_scene_says() {
    let servo = Servo { walls: vec![1], stress: 1e5, max_speed: 1.0, gain: 1.0 };
    for friction in [0.0, 0.5] {
        let text = column_scene(0.01, 0.005, 6e-5, 1.5e5, 6e4, &servo)
            .replace("[[servo]]", "wall_velocity = { \"+x\" = [0, 0.1, -0.2] }\n[[servo]]")
            .replace("normal_stiffness", &format!("friction = {friction}\nnormal_stiffness"));
        let mut bench = Bench::new(&text, &[sphere(0, Vec3::new(0.005, 0.0, 0.0))]);
        for _ in 0..3000 {
            bench.step();
        }
        let wall = bench.sim.particles.walls[1].clone();
        assert_eq!((wall.velocity.y, wall.velocity.z), (0.1, -0.2));
        let moved = 3000.0 * 1e-5;
        assert!((wall.point.y - (0.02 + 0.1 * moved)).abs() < 1e-12, "{:?}", wall.point);
        let (stress, _) = on_top(&mut bench);
        assert!((stress / 1e5 - 1.0).abs() < 1e-3, "{stress}");
        let velocity = bench.sim.particles.velocity[0];
        if friction > 0.0 {
            assert!(velocity.y > 1e-3 && velocity.z < -2e-3, "{velocity:?}");
        } else {
            // The wall has slid by 13 skins, and no pair had to be listed anew for that: only because it came nearer.
            let rebuilds = bench.sim.domain.traffic.rebuilds;
            assert!(velocity.y == 0.0 && rebuilds < 13, "{velocity:?}, {rebuilds}");
        }
    }
}

/// Of a hundred balls that fall, one hits the floor hard: nothing is at rest, and nothing says so. That it goes deep
/// into the floor is told once.
#[test]
fn a_blow_among_falling_grains_is_no_rest() {
    let text = r#"
gravity = [0, 0, -9.81]
[domain]
low = [0, 0, 0]
high = [0.02, 0.02, 0.06]
walls = ["-x", "+x", "-y", "+y", "-z"]
[[material]]
name = "soft"
density = 2500.0
normal_stiffness = 200
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.001
[[fill.lattice]]
low = [0, 0, 0.03]
high = [0.02, 0.02, 0.05]
[[fill.lattice]]
first = [0.01, 0.01, 0.0015]
count = [1, 1, 1]
velocity = [0, 0, -1]
[time]
step = 1e-5
steps = 200
[stop]
unbalanced = 0.05
[output]
directory = "out"
history_every = 10
"#;
    let scene = scene(text);
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    assemble::fill(&mut sim, &scene, &comm);
    let folder = tempfile::tempdir().unwrap();
    let (mut told, mut touched) = (Vec::new(), false);
    let finish = run::run(
        &mut sim,
        &schedule(&scene, scene.steps, folder.path()),
        &mut comm,
        &mut |progress| {
            told.extend_from_slice(progress.warnings);
            touched |=
                progress.done == 100 && progress.measures.is_some_and(|m| m.wall_contacts == 1);
        },
    );
    let finish = finish.unwrap();
    assert!(touched, "it is on the floor when that is looked at");
    assert_eq!((finish.ending, finish.steps_done), (Ending::LastStep, 200));
    assert!(finish.unmet.contains("carries"), "{}", finish.unmet);
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("the largest overlap is") && told[0].contains("5 %"), "{told:?}");
}

/// A stress that one sphere cannot bear, and a wall with nothing before it.
#[test]
fn a_target_out_of_reach_ends_the_run() {
    let servo = Servo { walls: vec![1], stress: 1e9, max_speed: 1.0, gain: 1.0 };
    let text = column_scene(0.01, 0.005, 6e-5, 1.5e5, 6e4, &servo);
    for spheres in [vec![sphere(0, Vec3::new(0.005, 0.0, 0.0))], vec![]] {
        let mut bench = Bench::new(&text, &spheres);
        let mut comm = Alone::default();
        let error = loop {
            if let Err(error) = bench.sim.step(&mut comm) {
                break error;
            }
            assert!(bench.sim.step < 2000, "it goes on");
        };
        assert!(error.is_agreed() && matches!(error, StepError::Servo { .. }), "{error}");
        let text = error.to_string();
        assert!(
            text.contains(&format!("step {}: servo: wall \"+x\" is", bench.sim.step)),
            "{text}"
        );
    }
}

/// Spheres of two sizes in a box whose walls all move.
const CUBE: &str = r#"
title = "cube"
global_damping = 300
[domain]
low = [0, 0, 0]
high = [0.02, 0.02, 0.02]
walls = ["-x", "+x", "-y", "+y", "-z", "+z"]
wall_material = "smooth"
WALLS
[[material]]
name = "grain"
density = 265000
normal_stiffness = 1.5e5
friction = 0.3
RESTITUTION
[[material]]
name = "smooth"
density = 1
normal_stiffness = 1.5e5
[[interaction]]
between = ["grain", "smooth"]
normal_stiffness = 1.5e5
friction = FRICTION
[[shape]]
name = "large"
material = "grain"
kind = "sphere"
radius = 0.0015
[[shape]]
name = "small"
material = "grain"
kind = "sphere"
radius = 0.0012
[[fill.lattice]]
shapes = { large = 1, small = 1 }
low = [0, 0, 0]
high = [0.02, 0.02, 0.02]
spacing = 0.0032
velocity = [0.02, -0.01, 0.03]
[time]
step = 1e-5
steps = 20000
[stop]
unbalanced = 1e-3
servo = 1e-3
[output]
directory = "out"
history_every = 20
"#;

const ISOTROPIC: &str = r#"
[[servo]]
walls = ["-x", "+x", "-y", "+y"]
stress = 1e5
[[servo]]
walls = ["-z", "+z"]
stress = 1e5
coupled = true"#;

/// The lid comes down while the sides keep their stress.
const SHEAR: &str = r#"
wall_velocity = { "+z" = [0, 0, -0.02] }
[[servo]]
walls = ["-x", "+x", "-y", "+y"]
stress = 1e5"#;

fn cube(walls: &str, wall_friction: f64, restitution: &str) -> String {
    CUBE.replace("WALLS", walls)
        .replace("RESTITUTION", restitution)
        .replace("FRICTION", &wall_friction.to_string())
}

fn schedule(scene: &dem_mpi::scene::Scene, last_step: u64, out: &Path) -> Schedule {
    Schedule {
        last_step,
        snapshot_every: 0,
        history_every: scene.history_every,
        stop: scene.stop,
        out: out.to_owned(),
        scene: scene.text.clone(),
        resumed: false,
        signal: Arc::default(),
        traced: Vec::new(),
    }
}

/// Compression until the walls are at their targets, then shear from where the walls stand: a triaxial test.
#[test]
fn stages_of_a_triaxial_test() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (folder.path().join("isotropic"), folder.path().join("shear"));
    std::fs::create_dir(&first).unwrap();
    std::fs::create_dir(&second).unwrap();
    let mut comm = Alone::default();
    let isotropic = scene(&cube(ISOTROPIC, 0.0, ""));
    let mut sim = assemble::assemble(&isotropic, &comm);
    assemble::fill(&mut sim, &isotropic, &comm);
    let schedule_of_first = schedule(&isotropic, isotropic.steps, &first);
    let finish = run::run(&mut sim, &schedule_of_first, &mut comm, &mut |_| {}).unwrap();
    println!("isotropic: step {}, {:?}", sim.step, finish.measures);
    assert_eq!(finish.ending, Ending::Rest, "step {}", sim.step);
    assert!(finish.measures.unbalanced < 1e-3);

    // Coupled walls are as far from where they stood.
    let walls = &sim.particles.walls;
    assert!((walls[4].point.z - (0.02 - walls[5].point.z)).abs() < 1e-15);

    // The stress of the contacts is that on the walls.
    let reader = Reader::open(&first).unwrap();
    let analysis = analyse(&reader, "isotropic", Settings::default()).unwrap();
    let tensor = analysis.report.stress_pa.unwrap().tensor;
    println!("{tensor}");
    for axis in 0..3 {
        assert!((tensor[(axis, axis)] / 1e5 - 1.0).abs() < 0.01, "{tensor}");
    }

    let shear =
        scene(&cube(SHEAR, 0.0, "").replace("[stop]\nunbalanced = 1e-3\nservo = 1e-3\n", ""));
    let mut sim = assemble::assemble(&shear, &comm);
    assemble::take_up(&mut sim, &shear, &first, From::Beginning, &mut comm).unwrap();
    for (wall, row) in sim.particles.walls.iter().zip(&reader.header().walls) {
        assert_eq!((&wall.name, wall.point), (&row.name, row.point), "walls stay where they stood");
    }
    let begin = sim.step;
    let schedule_of_second = schedule(&shear, begin + 4000, &second);
    run::run(&mut sim, &schedule_of_second, &mut comm, &mut |_| {}).unwrap();
    let history = History::read(File::open(second.join("history.csv")).unwrap()).unwrap();
    let curve = |name: &str| {
        let curve = history.curves.iter().find(|curve| curve.name == name);
        &curve.unwrap_or_else(|| panic!("no column {name}")).points
    };
    let (lid, top, side) = (curve("place_+z_m"), curve("stress_+z_Pa"), curve("stress_-x_Pa"));
    let at = |curve: &[(f64, f64)], row: usize| curve[row].1;
    let moved = at(lid, 0) - at(lid, lid.len() - 1);
    assert!((moved / (4000.0 * 0.02 * 1e-5) - 1.0).abs() < 1e-9, "{moved}");
    println!("top {} to {}, side {}", at(top, 0), at(top, top.len() - 1), at(side, side.len() - 1));
    assert!(at(top, top.len() - 1) > 1.5e5, "the lid presses harder");
    let late = &side[side.len() / 2..];
    let mean = late.iter().map(|(_, stress)| stress).sum::<f64>() / late.len() as f64;
    assert!((mean / 1e5 - 1.0).abs() < 0.02, "the sides keep their stress: {mean}");
    let unbalanced = curve("unbalanced");
    println!("unbalanced {:?}", unbalanced.iter().map(|row| row.1).fold(0.0, f64::max));
    assert!(unbalanced.iter().all(|&(_, ratio)| ratio > 0.0 && ratio < 1.0), "{unbalanced:?}");
}

/// What walls put in is counted: nothing is missing from the balance.
#[test]
fn the_work_of_walls_is_counted() {
    for restitution in ["", "restitution = 0.5\ntangential_damping_ratio = 0.1"] {
        for walls in [ISOTROPIC, SHEAR] {
            let scene = scene(&cube(walls, 0.3, restitution));
            let mut comm = Alone::default();
            let mut sim = begun(&scene, &mut comm);
            let begin = sim.measure(&mut comm);
            let mut largest = 0.0_f64;
            for _ in 0..3000 {
                sim.step(&mut comm).unwrap();
                if sim.step.is_multiple_of(100) {
                    largest = largest.max(sim.measure(&mut comm).missing().abs());
                }
            }
            let end = sim.measure(&mut comm);
            let work = end.received - begin.received;
            println!("work {work:e}, begin {:e}, missing at most {largest:e}", begin.received);
            assert!(work > 10.0 * begin.received, "walls do the work: {work:e}");
            assert!(largest < 1e-3 * work, "{largest:e} of {work:e} is missing");
            assert!(sim.servos.warnings.is_empty(), "{:?}", sim.servos.warnings);
        }
    }
}
