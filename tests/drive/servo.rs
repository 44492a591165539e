//! Walls that keep a stress or move at a given velocity.

use crate::support::{Bench, begun, of_servos, scene, schedule};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::threads;
use dem_mpi::contact::StateColumn;
use dem_mpi::drive::servo::{Goal, Pressed, Servo, State};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::output::report::{Origin, Report};
use dem_mpi::output::snapshot::Reader;
use dem_mpi::particles::records::Particle;
use dem_mpi::post::history::History;
use dem_mpi::post::{Settings, analyse};
use dem_mpi::scene::assemble::{self, Continuation};
use dem_mpi::sim::report::report;
use dem_mpi::sim::run::{self, Ending, Schedule};
use dem_mpi::sim::{Simulation, StepError};
use serde_json::Value;
use std::f64::consts::PI;
use std::fs::File;
use std::path::Path;

fn reference() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/dem_servo.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("a number, not {value}"))
}

/// Rows of a list of lists.
fn rows(value: &Value) -> Vec<Vec<f64>> {
    let row = |row: &Value| row.as_array().unwrap().iter().map(number).collect();
    value.as_array().unwrap().iter().map(row).collect()
}

/// Cases with columns of spheres by name, which have a quasi-static solution in the reference.
fn columns() -> Vec<(String, Value)> {
    let cases = reference()["cases"].as_array().unwrap().clone();
    let named = |case: Value| (case["name"].as_str().unwrap().to_owned(), case);
    cases.into_iter().map(named).filter(|(_, case)| case["columns"].is_u64()).collect()
}

/// The reference equates the wall's stiffness with that of one contact, so the gain is the number of columns.
fn servo(case: &Value) -> Servo {
    Servo {
        walls: vec![0],
        goal: Goal::Stress(number(&case["target"])),
        max_speed: number(&case["v_max"]),
        gain: number(&case["columns"]),
    }
}

/// With contacts of constant stiffness, the deviation falls with the double root 1 - P/2, P = 0.7 gain.
#[test]
fn a_spring_is_at_its_target_as_the_double_root_says() {
    let (area, stiffness, dt) = (0.02, 3e5, 1e-5);
    for gain in [0.3, 1.0, 1.5] {
        let servo = Servo { walls: vec![0], goal: Goal::Stress(1e5), max_speed: 1e9, gain };
        let (mut state, mut moved) = (State::default(), 0.0);
        let (part, root) = (0.7 * gain, 1.0 - 0.35 * gain);
        for n in 1..60 {
            let pressed = Pressed { area, force: stiffness * moved, stiffness };
            moved += servo.velocity(&mut state, &pressed, dt) * dt;
            let expected = root.powi(n) * (1.0 - 0.5 * part / root * f64::from(n));
            let missing = 1.0 - stiffness * moved / (1e5 * area);
            assert!((missing - expected).abs() < 1e-13, "{gain}, {n}: {missing:e}, {expected:e}");
        }
    }
}

/// A target that recedes at a steady speed is followed without an error, at any gain.
#[test]
fn a_steady_strain_leaves_no_error() {
    let (area, stiffness, dt, away) = (0.02, 3e5, 1e-5, 0.05);
    for gain in [0.1, 1.0] {
        let servo = Servo { walls: vec![0], goal: Goal::Stress(1e5), max_speed: 1.0, gain };
        let (mut state, mut moved) = (State::default(), 0.0);
        let mut error = f64::NAN;
        for n in 0..4000 {
            let force = (stiffness * (moved - away * dt * f64::from(n))).max(0.0);
            error = force / (1e5 * area) - 1.0;
            moved += servo.velocity(&mut state, &Pressed { area, force, stiffness }, dt) * dt;
        }
        assert!(error.abs() < 1e-9, "{gain}: {error:e}");
        assert!((state.speed / away - 1.0).abs() < 1e-9, "{gain}: {}", state.speed);
    }
}

/// Dashpots that take nearly all of a step's force, and never attract, do not cause oscillations. A law that corrects the whole
/// deviation in one step alternates 0, 2, 0, 2.
#[test]
fn a_wall_on_dashpots_does_not_swing() {
    let (area, spring, dt) = (0.02, 3e5, 1e-5);
    for share in [1.0, 10.0, 1e3] {
        let stiffness = spring * (1.0 + share);
        for gain in [0.5, 1.0, 1.5] {
            let servo = Servo { walls: vec![0], goal: Goal::Stress(1e5), max_speed: 1.0, gain };
            let (mut state, mut moved, mut step) = (State::default(), 0.0, 0.0);
            let mut error = f64::NAN;
            for _ in 0..20_000 {
                let force = f64::max(spring * moved + share * spring * step, 0.0);
                error = force / (1e5 * area) - 1.0;
                step = servo.velocity(&mut state, &Pressed { area, force, stiffness }, dt) * dt;
                moved += step;
            }
            assert!(error.abs() < 1e-6, "{share}, {gain}: {error:e}");
        }
    }
}

/// A run stopped between two rows of the history and two checks of `[stop]`, restarted on more ranks, gives identical digits.
#[test]
fn a_restart_leaves_no_trace_in_means() {
    let text = cube(SHEAR, 0.3, "restitution = 0.5")
        .replace("[stop]\nunbalanced = 1e-3\nservo = 1e-3\n", "[stop]\nservo = 1e-9\n");
    let scene = scene(&text);
    let leg = |folder: &Path, ranks: u32, from: Option<&Path>, last_step: u64| {
        let reports = threads::run(ranks, |comm| {
            let mut sim = assemble::assemble(&scene, comm);
            match from {
                None => assemble::fill(&mut sim, &scene, comm),
                Some(from) => {
                    assemble::take_up(&mut sim, &scene, from, Continuation::SameStage, comm)
                        .unwrap();
                }
            }
            let schedule = Schedule {
                history_every: 80,
                resumed: from.is_some(),
                ..schedule(&scene, last_step, folder)
            };
            let finish = run::run(&mut sim, &schedule, comm, &mut |_| {}).unwrap();
            let report = report(&sim, &finish, &Origin::default(), comm);
            (finish.unmet, report.targets)
        });
        reports.into_iter().next().unwrap()
    };
    let [whole, legs] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let told = leg(whole.path(), 1, None, 1130);
    leg(legs.path(), 2, None, 357);
    leg(legs.path(), 1, Some(legs.path()), 730);
    let told_in_legs = leg(legs.path(), 3, Some(legs.path()), 1130);
    let history = |folder: &Path| std::fs::read_to_string(folder.join("history.csv")).unwrap();
    assert!(history(whole.path()).lines().count() == 17);
    assert!(history(whole.path()) == history(legs.path()), "rows differ");
    let [one, other] =
        [&whole, &legs].map(|folder| Reader::open(folder.path()).unwrap().header().clone());
    let saved = of_servos(&one.drives);
    let force_steps = saved.counts(&StateColumn::new("force_steps", 1, "1")).unwrap();
    let speeds = saved.reals(&StateColumn::new("speed", 1, "m/s")).unwrap();
    assert_eq!(force_steps, [10; 4]);
    assert!(speeds.len() == 4 && speeds.iter().all(|&speed| speed != 0.0), "{speeds:?}");
    assert_eq!(one.drives, other.drives);
    assert_eq!(one.walls, other.walls);
    assert_eq!(told.0, told_in_legs.0);
    assert_eq!(told.1.len(), 4);
    assert_eq!(told.1, told_in_legs.1);
}

/// The wall approaches at its greatest speed until it touches. A wall that has lost its contacts accelerates without a jump of its
/// speed.
#[test]
fn a_wall_rushes_only_before_it_has_touched() {
    let (area, stiffness, dt) = (0.02, 3e5, 1e-4);
    let servo = Servo { walls: vec![0], goal: Goal::Stress(10.0), max_speed: 0.5, gain: 1.0 };
    let nothing = Pressed { area, ..Pressed::default() };
    let mut state = State::default();
    assert_eq!(servo.velocity(&mut state, &nothing, dt), 0.5);
    assert_eq!(state, State::default());
    servo.velocity(&mut state, &Pressed { force: 0.2, stiffness, ..nothing }, dt);
    let speeds: Vec<f64> = (0..2000).map(|_| servo.velocity(&mut state, &nothing, dt)).collect();
    let at_once = 0.2 / (stiffness * dt);
    assert!((speeds[0] / (0.7 * at_once) - 1.0).abs() < 1e-12, "{}", speeds[0]);
    // Mass of a plate that accelerates in this way under its load.
    let mass = stiffness * dt * dt / (0.35 * 0.35);
    let gained = speeds[100] - speeds[0];
    assert!((gained / (0.2 / mass * 100.0 * dt) - 1.0).abs() < 1e-12, "{gained}");
    assert_eq!(speeds[1999], 0.5);
}

/// Scene of a box across x from 0 to `length`, 0.04 m by 0.04 m, with a servo on +x, and spheres along x.
fn column_scene(
    length: f64,
    radius: f64,
    mass: f64,
    stiffness: f64,
    damping: f64,
    servo: &Servo,
) -> String {
    let density = mass / (4.0 / 3.0 * PI * radius.powi(3));
    let (_, _, stress) = servo.goal.target();
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
stress = {stress:e}
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
        servo.max_speed, servo.gain
    )
}

fn sphere(id: u64, position: Vec3) -> Particle {
    Particle::at_rest(GlobalId(id), ShapeId(0), position)
}

/// Warnings of the drives.
fn warnings(sim: &mut Simulation) -> Vec<String> {
    sim.drives.iter_mut().flat_map(|drive| drive.warnings()).collect()
}

/// Stress on the wall +x [Pa], and its position [m].
fn on_top(bench: &mut Bench) -> (f64, f64) {
    (bench.measure().wall_forces[1].x / 0.0016, bench.sim.particles.walls[1].point.x)
}

/// A full simulation of light and damped spheres stays near the quasi-static solution, some steps behind it, and ends in it.
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
        // The contact period is 12 steps and the damping time 3. A gain of 1 uses the whole stiffness of the wall, which tolerates
        // inertia.
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
        let warnings = warnings(&mut bench.sim);
        assert!(warnings.is_empty(), "{name}: {warnings:?}");
    }
}

/// The approach depends on the law of the servo; the final state of rest does not.
#[test]
fn a_sphere_with_inertia_ends_as_in_the_reference() {
    let cases = reference();
    let case = cases["cases"].as_array().unwrap().last().unwrap();
    let get = |key: &str| number(&case[key]);
    let radius = get("R");
    let servo = Servo {
        walls: vec![1],
        goal: Goal::Stress(get("target")),
        max_speed: get("v_max"),
        gain: 1.0,
    };
    let text = column_scene(2.0 * radius, radius, get("mass"), get("k"), get("global_xi"), &servo);
    let mut bench = Bench::new(&text, &[sphere(0, Vec3::new(radius, 0.0, 0.0))]);
    let rows = rows(&case["trajectory_n_sigmatop_sigmabottom_x_v_H"]);
    let row = rows.last().unwrap();
    assert!((row[1] / get("target") - 1.0).abs() < 1e-3, "at rest: {row:?}");
    while (bench.sim.step as f64) < row[0] {
        bench.step();
    }
    let (top, height) = on_top(&mut bench);
    let bottom = -bench.measure().wall_forces[0].x / 0.0016;
    let (x, v) = (bench.sim.particles.position[0].x, bench.sim.particles.velocity[0].x);
    println!("{top} {bottom} {x} {v:e} {height} {row:?}");
    for (found, expected, scale) in [
        (top, row[1], 1e5),
        (bottom, row[2], 1e5),
        (x, row[3], 1e-5),
        (v, row[4], 1e-2),
        (height, row[5], 1e-5),
    ] {
        assert!((found - expected).abs() < 1e-3 * scale, "{found:e}, not {expected:e}");
    }
}

/// Too high a gain makes the stress oscillate, as in the reference, with one warning.
#[test]
fn a_servo_that_swings_is_told_once() {
    let servo = |gain| Servo { walls: vec![1], goal: Goal::Stress(1e5), max_speed: 1.0, gain };
    for (gain, expected) in [(1.0, 0), (8.0, 1)] {
        let text = column_scene(0.01, 0.005, 6e-5, 1.5e5, 6e4, &servo(gain));
        let mut bench = Bench::new(&text, &[sphere(0, Vec3::new(0.005, 0.0, 0.0))]);
        for _ in 0..3000 {
            bench.step();
        }
        let warnings = warnings(&mut bench.sim);
        assert_eq!(warnings.len(), expected, "{warnings:?}");
        for warning in &warnings {
            assert!(warning.contains("+x") && warning.contains("`gain` = 4.00"), "{warning}");
        }
    }
}

/// A wall with a servo may also slide: shear under a normal stress.
#[test]
fn a_wall_under_stress_slides_as_the_scene_says() {
    let servo = Servo { walls: vec![1], goal: Goal::Stress(1e5), max_speed: 1.0, gain: 1.0 };
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
            // The wall has slid by 13 skins. Only its approach made pair lists necessary.
            let rebuilds = bench.sim.domain.traffic.rebuilds;
            assert!(velocity.y == 0.0 && rebuilds < 13, "{velocity:?}, {rebuilds}");
        }
    }
}

/// Among a hundred falling balls, one hits the floor hard. The run does not count as at rest, and the deep overlap gives one
/// warning.
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
    assert!(told[0].contains("an overlap is") && told[0].contains("5 %"), "{told:?}");
}

/// A stress that one sphere cannot support, and a wall without particles before it.
#[test]
fn a_target_out_of_reach_ends_the_run() {
    let servo = Servo { walls: vec![1], goal: Goal::Stress(1e9), max_speed: 1.0, gain: 1.0 };
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
        assert!(error.is_agreed() && matches!(error, StepError::Drive { .. }), "{error}");
        let text = error.to_string();
        assert!(
            text.contains(&format!("step {}: servo: wall \"+x\" is", bench.sim.step)),
            "{text}"
        );
    }
}

/// Spheres of two sizes in a box whose walls can all move.
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

/// A moving lid between sides that keep their stress.
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

/// 125 balls with friction and dashpots, and walls from `WALLS`.
const BALLS: &str = r#"
seed = 3
[domain]
low = [0, 0, 0]
high = [0.055, 0.055, 0.055]
walls = ["-x", "+x", "-y", "+y", "-z", "+z"]
WALLS
stress = 1000
GAIN
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e5
friction = 0.3
restitution = RESTITUTION
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.005
[[shape]]
name = "bead"
kind = "sphere"
radius = 0.0045
[[fill.lattice]]
shapes = { ball = 1, bead = 1 }
first = [0.0055, 0.0055, 0.0055]
spacing = 0.011
count = [5, 5, 5]
velocity = [0.05, -0.03, 0.02]
[time]
step = STEP
steps = STEPS
[output]
directory = "out"
history_every = 37
"#;

const SIX: &str = "[[servo]]\nwalls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"]";
/// Two coupled pairs, and a moving lid.
const LID: &str = r#"wall_velocity = { "+z" = [0, 0, -0.02] }
[[servo]]
walls = ["-x", "+x"]
coupled = true
stress = 1000
GAIN
[[servo]]
walls = ["-y", "+y"]
coupled = true"#;

/// Runs 125 balls. Returns the worst values of all walls with a servo, over the last fifth of the history's rows, and the report.
/// The values are the error of the mean stress, and the mean distance of a step's stress from the target.
fn balls(walls: &str, gain: &str, restitution: f64, dt: f64, steps: u64) -> ([f64; 2], Report) {
    let text = BALLS
        .replace("WALLS", walls)
        .replace("GAIN", gain)
        .replace("RESTITUTION", &restitution.to_string())
        .replace("STEPS", &steps.to_string())
        .replace("STEP", &dt.to_string());
    let scene = scene(&text);
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    assemble::fill(&mut sim, &scene, &comm);
    let folder = tempfile::tempdir().unwrap();
    let schedule = schedule(&scene, scene.steps, folder.path());
    let mut warnings = Vec::new();
    let finish = run::run(&mut sim, &schedule, &mut comm, &mut |progress| {
        warnings.extend_from_slice(progress.warnings);
    })
    .unwrap();
    let swings = warnings.iter().filter(|warning| warning.contains("jumped")).count();
    assert_eq!(swings, 0, "{warnings:?}");
    let history = History::read(File::open(folder.path().join("history.csv")).unwrap()).unwrap();
    let mut worst = [0.0_f64; 2];
    for servo in &scene.servos {
        // Coupled walls keep the mean of their stresses, as their areas are equal.
        let stresses = |&wall: &usize| {
            let name = format!("stress_{}_Pa", scene.walls[wall].name);
            let curve = history.curves.iter().find(|curve| curve.name == name).unwrap();
            curve.points.iter().map(|point| point.1).collect::<Vec<_>>()
        };
        let walls: Vec<Vec<f64>> = servo.walls.iter().map(stresses).collect();
        let rows = 4 * walls[0].len() / 5..walls[0].len();
        let count = rows.len() as f64;
        let error = |row| {
            let stress: f64 = walls.iter().map(|wall| wall[row]).sum();
            stress / (1000.0 * walls.len() as f64) - 1.0
        };
        let errors: Vec<f64> = rows.map(error).collect();
        worst[0] = worst[0].max(errors.iter().sum::<f64>().abs() / count);
        worst[1] = worst[1].max(errors.iter().map(|error| error.abs()).sum::<f64>() / count);
    }
    (worst, report(&sim, &finish, &Origin::default(), &mut comm))
}

/// Mean error of each servo, over its target.
fn told_errors(report: &Report) -> Vec<f64> {
    report.targets.iter().map(|target| target.mean_error).collect()
}

/// Number of servos with a warning at the end.
fn warned(report: &Report) -> usize {
    let of_servos = |warning: &&String| warning.contains("has not reached its stress");
    report.warnings.iter().filter(of_servos).count()
}

/// Dashpots once made the stress on six walls alternate between 0 and 2 times its target for 19,000 steps.
#[test]
fn six_servos_keep_their_stress_on_dashpots() {
    for (restitution, dt, steps) in
        [(0.3, 5e-6, 20_000), (0.1, 5e-6, 40_000), (0.3, 1e-6, 100_000), (0.9, 5e-6, 40_000)]
    {
        let ([mean, rows], report) = balls(SIX, "", restitution, dt, steps);
        println!("{restitution} {dt}: {mean:e} {rows:e} {:?}", told_errors(&report));
        assert!(mean < 5e-3 && rows < 1e-2, "{restitution}, {dt}: {mean:e} {rows:e}\n{report:#?}");
        let told = told_errors(&report);
        assert!(told.len() == 6 && told.iter().all(|&error| error < 0.01), "{report:#?}");
        assert_eq!(warned(&report), 0, "{report:#?}");
    }
}

/// A stage that `[stop]` ends while its servos are off target gives a warning, unless `[stop]` was to wait for them.
#[test]
fn servos_that_a_stop_leaves_off_are_warned_of() {
    for (stop, expected) in [("unbalanced = 0.99", 6), ("servo = 0.99", 0)] {
        let gain = format!("[stop]\n{stop}\n");
        let (_, report) = balls(SIX, &gain, 0.3, 5e-6, 20_000);
        assert!(report.run.steps < 20_000, "{report:#?}");
        assert!(told_errors(&report).iter().any(|&error| error > 0.02), "{report:#?}");
        assert_eq!(warned(&report), expected, "{stop}: {report:#?}");
    }
}

/// A lid in a pipe presses on less than the area between planes, over which its stress is computed.
#[test]
fn a_servo_beside_a_pipe_is_doubtful() {
    let text = BALLS
        .replace("WALLS", "[[servo]]\nwalls = [\"+z\"]")
        .replace("GAIN", "")
        .replace("RESTITUTION", "0.5")
        .replace("STEPS", "10")
        .replace("STEP", "1e-6");
    let pipe = "[[wall]]\nname = \"pipe\"\n\
                cylinder = { from = [0.0275, 0.0275, 0], to = [0.0275, 0.0275, 0.055], radius = 0.04 }\n";
    let doubt = |text: &str| dem_mpi::scene::doubts::doubts(&scene(text)).join("\n");
    assert!(doubt(&(text.clone() + pipe)).contains("the area is not reduced by wall \"pipe\""));
    assert_eq!(doubt(&text), "");
    // Stresses of walls without a servo are written, too, if any wall moves.
    let servo = "[[servo]]\nwalls = [\"+z\"]\nstress = 1000\n";
    assert!(text.contains(servo));
    let moving = text.replace(servo, "wall_velocity = { \"+z\" = [0, 0, -0.02] }\n");
    let told = doubt(&(moving.clone() + pipe));
    assert!(told.contains("_Pa` of history.csv is force over 3.0250e-3 m2"), "{told}");
    assert!(told.contains("the area is not reduced by wall \"pipe\""), "{told}");
    assert_eq!(doubt(&moving), "");
    assert_eq!(doubt(&(text.replace(servo, "") + pipe)), "");
    assert!(dem_mpi::scene::plan::plan(&scene(&text), 1).contains("over 3.0250e-3 m2"));
}

/// Under a moving lid a law without an integral stayed at 1.4 to 2 times its target.
#[test]
fn servos_keep_their_stress_under_a_moving_lid() {
    for (gain, restitution, dt) in
        [("", 0.3, 5e-6), ("gain = 0.1", 0.3, 5e-6), ("", 0.1, 1e-5), ("", 0.9, 2e-5)]
    {
        let steps = (0.4 / dt) as u64;
        let ([mean, rows], report) = balls(LID, gain, restitution, dt, steps);
        println!("{gain} {restitution} {dt}: {mean:e} {rows:e} {:?}", told_errors(&report));
        // A tenth of the gain follows the lid more slowly.
        let most = if gain.is_empty() { 0.02 } else { 0.06 };
        assert!(mean < most, "{gain}, {restitution}, {dt}: {mean:e} {rows:e}\n{report:#?}");
        let told = told_errors(&report);
        assert_eq!(told.len(), 2, "{report:#?}");
        let off = told.iter().filter(|&&error| error > 0.02).count();
        assert_eq!(warned(&report), off, "{report:#?}");
        assert!(!gain.is_empty() || off == 0, "{report:#?}");
    }
}

/// A wall too slow for the lid gives a warning at the end.
#[test]
fn a_servo_off_its_target_is_told_at_the_end() {
    let (worst, report) = balls(LID, "max_speed = 1e-4", 0.3, 5e-6, 20_000);
    assert!(told_errors(&report).iter().all(|&error| error > 0.02), "{worst:?} {report:#?}");
    assert_eq!(warned(&report), 2, "{report:#?}");
}

/// Rows of the history are means over the steps since the previous row.
#[test]
fn rows_are_means_over_their_interval() {
    let rows_every = |every: u64| {
        let text = cube(SHEAR, 0.3, "restitution = 0.5")
            .replace("[stop]\nunbalanced = 1e-3\nservo = 1e-3\n", "");
        let scene = scene(&text);
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(&scene, &comm);
        assemble::fill(&mut sim, &scene, &comm);
        let folder = tempfile::tempdir().unwrap();
        let schedule = Schedule { history_every: every, ..schedule(&scene, 1000, folder.path()) };
        run::run(&mut sim, &schedule, &mut comm, &mut |_| {}).unwrap();
        History::read(File::open(folder.path().join("history.csv")).unwrap()).unwrap()
    };
    let (each, fifty) = (rows_every(1), rows_every(50));
    let points = |history: &History, name: &str| {
        history.curves.iter().find(|curve| curve.name == name).unwrap().points.clone()
    };
    for (name, is_mean) in [
        ("force_-x_x_N", true),
        ("force_-x_z_N", true),
        ("force_+y_x_N", true),
        ("force_+z_z_N", false),
    ] {
        let (each, fifty) = (points(&each, name), points(&fifty, name));
        assert!(each.iter().any(|row| row.1 != 0.0), "{name}");
        for (row, &(time, value)) in fifty.iter().enumerate().skip(1) {
            let steps = &each[50 * (row - 1) + 1..=50 * row];
            assert_eq!(steps[49].0, time);
            let mean = steps.iter().map(|step| step.1).sum::<f64>() / 50.0;
            let expected = if is_mean { mean } else { steps[49].1 };
            let size = steps.iter().map(|step| step.1.abs()).fold(0.0, f64::max);
            assert!(
                (value - expected).abs() <= 1e-13 * size,
                "{name} {time}: {value:e} {expected:e}"
            );
        }
    }
}

/// A triaxial test: compression until the walls reach their targets, then shear from their positions.
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

    // Coupled walls have moved by the same distance.
    let walls = &sim.particles.walls;
    assert!((walls[4].point.z - (0.02 - walls[5].point.z)).abs() < 1e-15);

    // The stress from the contacts equals that on the walls.
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
    assemble::take_up(&mut sim, &shear, &first, Continuation::NewStage, &mut comm).unwrap();
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

/// The work of the walls is counted, so that the energy balance closes.
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
            let warnings = warnings(&mut sim);
            assert!(warnings.is_empty(), "{warnings:?}");
        }
    }
}
