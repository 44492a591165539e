//! `--suggest` from the command line.

use super::process::{Launch, dem_mpi};
use super::{fresh_directory, written};
use crate::support::completed;
use std::fs;

/// A scene of two balls and a floor, at rest soon enough for a short trial.
const SCENE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[domain]
low = [0.0, 0.0, 0.0]
high = [0.01, 0.01, 0.01]
walls = ["-z"]
[[material]]
name = "grain"
density = 2500.0
normal_stiffness = 1e4
restitution = 0.5
[[shape]]
name = "ball"
kind = "sphere"
radius = 1e-3
[[fill.lattice]]
first = [3e-3, 3e-3, 1e-3]
spacing = 3e-3
count = [2, 1, 1]
[time]
step = 1e-6
steps = 2000
[output]
snapshot_every = 500
"#;

#[test]
fn what_it_prints_can_be_put_into_the_scene() {
    let directory = fresh_directory("suggested");
    let scene = &*written(&directory, SCENE);
    let ended =
        dem_mpi(Launch::Alone, [scene, "--suggest", "--error", "1%"]).from(&directory).succeed();
    for text in
        ["[time]\n", "[contact]\nmethod = \"auto\"\n", "\nfloor ", "\nhow sure ", "\nsofter "]
    {
        ended.said_once(text);
    }
    let files: Vec<_> = directory.read_dir().unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(files, ["scene.toml"], "it writes nothing");

    let key = |name: &str| {
        let line = ended.output.lines().find(|line| line.starts_with(&format!("{name} = ")));
        line.unwrap_or_else(|| panic!("no {name}: {ended}")).replace(" = ", "=")
    };
    let sets = [
        format!("time.{}", key("step")),
        format!("time.{}", key("steps")),
        format!("output.{}", key("snapshot_every")),
    ];
    let mut again = vec![scene, "--check"];
    again.extend(sets.iter().flat_map(|set| ["--set", set]));
    dem_mpi(Launch::Alone, again).from(&directory).succeed();
    let number = |set: &str| set.split_once('=').unwrap().1.parse::<f64>().unwrap();
    let span = number(&sets[0]) * number(&sets[1]);
    assert!((2e-3..2e-3 + number(&sets[0])).contains(&span), "the stage lasts as long: {span}");
}

/// The energy balance of a trial from a snapshot covers only the trial: balls at rest have no energy error.
#[test]
fn trials_go_on_from_a_snapshot() {
    let directory = fresh_directory("suggested_from");
    let scene = &*written(&directory, SCENE);
    dem_mpi(Launch::Alone, [scene, "--out", "before", "--steps", "1500"])
        .from(&directory)
        .succeed();
    let from = [scene, "--suggest", "--start", "before"];
    let ended = dem_mpi(Launch::Alone, from).from(&directory).succeed();
    let error = ended.output.lines().find(|line| line.starts_with("error ")).unwrap();
    let energy = error.split("energy ").nth(1).unwrap().split(' ').next().unwrap();
    assert!(energy.parse::<f64>().unwrap() < 0.1, "{ended}");
    // Earlier steps count in the stage, with any time step.
    let number = |name: &str| {
        let line = ended.output.lines().find(|line| line.starts_with(name)).unwrap();
        line.split(" = ").nth(1).unwrap().parse::<f64>().unwrap()
    };
    let left = (number("steps") - 1500.0) * number("step ");
    assert!((5e-4..5e-4 + number("step ")).contains(&left), "{ended}");
    assert_eq!(directory.read_dir().unwrap().count(), 2, "{ended}");
}

/// A scene with a duration keeps it.
#[test]
fn a_duration_stays() {
    let directory = fresh_directory("suggested_duration");
    let scene = &*written(&directory, &SCENE.replace("steps = 2000", "duration = 1e-3"));
    let ended = dem_mpi(Launch::Alone, [scene, "--suggest"]).from(&directory).end();
    let lines = || ended.output.lines();
    assert!(lines().any(|line| line.starts_with("step = ")), "{ended}");
    assert!(!lines().any(|line| line.starts_with("steps = ")), "{ended}");
}

#[test]
fn wrong_questions_are_refused_with_one_message() {
    let directory = fresh_directory("suggested_wrongly");
    let scene = &*written(&directory, SCENE);
    let between = "must be more than 0 and less than 1, such as 1% or 0.01";
    let silo = "[[inlet]]\nname = \"tap\"\nlow = [0, 0, 0.006]\nhigh = [0.01, 0.01, 0.008]\nrate = 100\nvelocity = [0, 0, -1]\n[time]";
    let fed = directory.join("fed.toml");
    fs::write(&fed, completed(&SCENE.replace("[time]", silo))).unwrap();
    let ended = dem_mpi(Launch::Alone, [fed.to_str().unwrap(), "--suggest"]).from(&directory).end();
    assert_eq!(ended.status.code(), Some(2), "{ended}");
    ended.said_once("inlet `tap` inserts particles in different places with every step");
    fs::remove_file(&fed).unwrap();
    let wrong: [(Launch, &[&str], &str); 8] = [
        (Launch::Alone, &["--suggest", "--error", "0"], between),
        (Launch::Alone, &["--suggest", "--error=-1%"], between),
        (Launch::Alone, &["--suggest", "--error", "150%"], between),
        (Launch::Alone, &["--suggest", "--error", "NaN"], between),
        (Launch::Alone, &["--suggest", "--error", "little"], between),
        (Launch::Alone, &["--error", "1%"], "--suggest"),
        (Launch::Alone, &["--suggest", "--plan"], "cannot be used with"),
        (Launch::Ranks(2), &["--suggest"], "--suggest uses one rank"),
    ];
    for (launch, arguments, message) in wrong {
        let mut all = vec![scene];
        all.extend(arguments);
        let ended = dem_mpi(launch, all).from(&directory).end();
        assert_eq!(ended.status.code(), Some(2), "{ended}");
        assert_eq!(ended.output, "", "{ended}");
        assert!(ended.errors.contains(message), "{ended}");
    }
    assert_eq!(directory.read_dir().unwrap().count(), 1, "a question leaves no files");
}
