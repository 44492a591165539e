//! Motion that the time step does not resolve gives a warning, or stops the run with advice.

use super::process::{Launch, dem_mpi};
use super::{fresh_directory, report, written};
use crate::support::completed;
use std::path::Path;

/// Scene of particles of radius 0.01 m from a CSV text, with a wall at the bottom.
fn grains(directory: &Path, material: &str, dt: f64, rows: &str) -> String {
    let text = format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[domain]
low = [-2.0, -2.0, 0.0]
high = [2.0, 2.0, 2.0]
walls = ["-x", "+x", "-z"]
[[material]]
name = "glass"
density = 2500.0
normal_stiffness = 1e4
{material}
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.01
[[fill.file]]
path = "rows.csv"
[time]
step = {dt:e}
steps = 2000
"#
    );
    std::fs::write(directory.join("rows.csv"), rows).unwrap();
    written(directory, &text)
}

#[test]
fn a_ball_that_would_jump_over_another_does_not_start() {
    for launch in [Launch::Alone, Launch::Ranks(2)] {
        let directory = fresh_directory(&format!("jump_{launch:?}"));
        // 5 radii in a step: over the other at 0.05 m.
        let rows = "x,y,z,vx,vy,vz\n0,0,1,500,0,0\n0.05,0,1,0,0,0\n";
        let scene = grains(&directory, "", 1e-4, rows);
        let ended = dem_mpi(launch, [&*scene]).from(&directory).end();
        assert_eq!(ended.status.code(), Some(2), "{ended}");
        ended.said_once(
            "step 0: particle 0 moves by 5.000e-2 m in a step, 5.000 times the smallest radius",
        );
        ended.said_once("With a time step of 2.00e-6 s");
    }
}

/// Straight columns of a lattice carry the stress and meet all conditions; with a jitter the particles form a packing.
#[test]
fn columns_that_bear_a_stress_are_no_packing() {
    let directory = fresh_directory("hollow");
    let text = r#"
[domain]
low = [0.0, 0.0, 0.0]
high = [0.01, 0.01, 0.01]
walls = ["-x", "+x", "-y", "+y", "-z", "+z"]
[[material]]
name = "glass"
density = 2500.0
normal_stiffness = 1e4
restitution = 0.3
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.001
[[fill.lattice]]
first = [0.00125, 0.00125, 0.00125]
count = [4, 4, 4]
spacing = 0.0025
[[servo]]
walls = ["-z", "+z"]
stress = 1e3
max_speed = 0.1
[time]
step = "auto"
duration = 0.2
[stop]
servo = 0.02
unbalanced = 0.01
"#;
    let ended = dem_mpi(Launch::Alone, [written(&directory, text)]).from(&directory).succeed();
    ended.said_once("[stop] reached");
    ended.said_once("[stop] was reached with 2.00 contacts per particle");
}

/// A check and a plan find overlaps that a run rejects.
#[test]
fn overlaps_of_the_start_are_found_by_a_check_and_a_plan() {
    for launch in [Launch::Alone, Launch::Ranks(2)] {
        let directory = fresh_directory(&format!("overlapping_{launch:?}"));
        let rows = "x,y,z,vx,vy,vz\n0,0,1,0,0,0\n0.015,0,1,0,0,0\n";
        let scene = grains(&directory, "", 1e-4, rows);
        for words in [&["--check"][..], &["--plan"], &[]] {
            let ended = dem_mpi(launch, [&[&*scene], words].concat()).from(&directory).end();
            assert_eq!(ended.status.code(), Some(2), "{ended}");
            ended.said_once("1 pair overlap by more than 5 % of the shortest axis at the start");
        }
        let rows = "x,y,z,vx,vy,vz\n0,0,1,0,0,0\n0.0199,0,1,0,0,0\n";
        let scene = grains(&directory, "", 1e-4, rows);
        for word in ["--check", "--plan"] {
            dem_mpi(launch, [&*scene, word]).from(&directory).succeed();
        }
        // A wall of a stage that begins with a snapshot may overlap particles.
        dem_mpi(launch, [&*scene, "--steps", "1"]).from(&directory).succeed();
        let text = std::fs::read_to_string(&scene).unwrap();
        let fill = "[[fill.file]]\npath = \"rows.csv\"";
        let plate = "[[wall]]\nname = \"plate\"\npoint = [0, 0, 1]\nnormal = [0, 0, 1]";
        let text = format!("start = \"out\"\n{}", text.replace(fill, plate));
        let next = directory.join("next.toml");
        std::fs::write(&next, text).unwrap();
        for word in ["--check", "--plan"] {
            let words = [next.to_str().unwrap(), word, "--out", "next"];
            let ended = dem_mpi(launch, words).from(&directory).end();
            assert_eq!(ended.status.code(), Some(2), "{ended}");
            ended.said_once("at the start");
        }
    }
}

#[test]
fn speed_that_comes_in_the_run_is_warned_of_and_stops_it() {
    for launch in [Launch::Alone, Launch::Ranks(2)] {
        let directory = fresh_directory(&format!("faster_{launch:?}"));
        let rows = "x,y,z,vx,vy,vz\n-1,0,1.9,0,0,-2\n1,0,1.9,0,0,-1\n";
        let scene = grains(&directory, "", 3e-4, rows);
        let pull = ["--set", "gravity=[0, 0, -150000]"];
        let words = [&*scene, pull[0], pull[1]];
        let ended = dem_mpi(launch, words).from(&directory).end();
        assert_eq!(ended.status.code(), Some(1), "{ended}");
        ended.said_once("times the smallest radius (1.000e-2 m), so contacts may be missed");
        ended.said_once("particle 0 moves by");
    }
    let directory = fresh_directory("fast");
    let scene = grains(&directory, "", 3e-4, "x,y,z,vx,vy,vz\n0,0,1,4,0,0\n");
    let ended = dem_mpi(Launch::Alone, [&*scene, "--steps", "300"]).from(&directory).succeed();
    ended.said_once("the fastest body has moved by 0.1");
    ended.said_once("more than a tenth");
}

/// A ball without losses bounces at a coarse step: the report has the energy error of the step.
#[test]
fn energy_lost_by_the_step_is_warned_of() {
    let directory = fresh_directory("bouncing");
    let rows = "x,y,z,vx,vy,vz\n0,0,0.5,0.7,0,-1\n";
    for (material, part, warns) in
        [("", 0.9, true), ("friction = 0.3", 0.9, true), ("", 0.01, false)]
    {
        let limit = 3.2e-4;
        let scene = grains(&directory, material, part * limit, rows);
        let steps = format!("{}", (8.0 / (part * limit)) as u64);
        let words = [&*scene, "--overwrite", "--steps", &steps];
        let ended = dem_mpi(Launch::Alone, words).from(&directory).succeed();
        let report = report(&directory.join("out"));
        let warnings = report["warnings"].as_array().unwrap();
        let of_energy = |text: &str| text.contains("the energy error is");
        let says = warnings.iter().any(|warning| of_energy(warning.as_str().unwrap()));
        assert_eq!(says, warns, "{material} {part}: {ended}");
        // It is printed even without --verbose.
        assert_eq!(of_energy(&ended.output), warns, "{ended}");
        // During the run the warning appears from 1 % on.
        if material.is_empty() {
            assert_eq!(of_energy(&ended.errors), warns, "{ended}");
        }
        let missing = &report["energy"]["missing_over_moved"];
        assert_eq!(missing.as_f64().unwrap().abs() > 2e-3, warns, "{report:#}");
    }
}

/// At 1e6 m from the origin a millimetre per hour is below the resolution of positions.
#[test]
fn motion_that_rounding_swallows_is_warned_of() {
    let directory = fresh_directory("far");
    let rows = "x,y,z,vx,vy,vz\n1048576,0,1,3e-7,0,0\n";
    let scene = grains(&directory, "", 1e-4, rows);
    let far = ["--set", "domain.low=[1048575, -2, 0]", "--set", "domain.high=[1048577, 2, 2]"];
    let words = [&*scene, far[0], far[1], far[2], far[3], "--steps", "10"];
    let ended = dem_mpi(Launch::Ranks(2), words).from(&directory).succeed();
    ended.said_once(
        "up to 100.00 % of a step of a particle of a file at 3e-7 m/s is lost in rounding",
    );
    // There is no warning near the origin.
    let scene = grains(&directory, "", 1e-4, "x,y,z,vx,vy,vz\n0,0,1,3e-7,0,0\n");
    let words = [&*scene, "--steps", "10", "--overwrite"];
    let ended = dem_mpi(Launch::Alone, words).from(&directory).succeed();
    assert!(!ended.errors.contains("lost in rounding"), "{ended}");
}

/// A soft surface does not stop a heavy ball or cube, and would push it out on the other side once its centre is through. The run ends before
/// that, at any interval of pair lists. A hard surface stops the ball.
#[test]
fn what_a_mesh_cannot_stop_ends_the_run() {
    let directory = fresh_directory("through");
    let corners = "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\n";
    std::fs::write(directory.join("sheet.obj"), format!("{corners}f 1 2 3\nf 1 3 4\n")).unwrap();
    let text = r#"
[domain]
low = [-0.2, -0.2, -0.2]
high = [0.2, 0.2, 0.2]
[[wall]]
name = "sheet"
mesh = "sheet.obj"
[[material]]
name = "steel"
density = 7800
normal_stiffness = 1e4
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.0125
[[fill.lattice]]
first = [0.01, 0.02, 0.03]
count = [1, 1, 1]
orientation = "upright"
velocity = [0, 0, -5]
[neighbours]
skin = 1e-3
[time]
step = 1e-5
steps = 2000
[output]
history_every = 0
"#;
    let cube = text.replace(
        "kind = \"sphere\"\nradius = 0.0125",
        "kind = \"polyhedron\"\nedges = [0.02, 0.02, 0.02]",
    );
    for (name, text) in [("ball.toml", text), ("cube.toml", &cube)] {
        std::fs::write(directory.join(name), completed(text)).unwrap();
        for (launch, skin) in
            [(Launch::Alone, 0.05), (Launch::Alone, 1e-3), (Launch::Ranks(2), 0.05)]
        {
            let skin = format!("neighbours.skin={skin:?}");
            let ended = dem_mpi(launch, [name, "--set", &skin]).from(&directory).end();
            assert_eq!(ended.status.code(), Some(1), "{ended}");
            ended.said_once("of wall \"sheet\" overlap by 35.");
            ended.said_once("more than 35 %: once its centre is through, the surface pushes it");
        }
    }
    let hard = ["ball.toml", "--set", "material.steel.normal_stiffness=1e6"];
    dem_mpi(Launch::Alone, hard).from(&directory).succeed();
}
