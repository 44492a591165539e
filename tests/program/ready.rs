//! The ready scenes of `run/`: the claims of their pages, on shorter runs.

use super::process::{Call, Ended, Launch, dem_mpi, mpirun};
use super::{fresh_directory, report};
use crate::support::{self, save};
use dem_mpi::comm::alone::Alone;
use dem_mpi::scene::doubts::doubts;
use dem_mpi::scene::{Scene, assemble};
use dem_mpi::sim::Simulation;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};

const FOLDERS: [&str; 13] = [
    "heap",
    "mixture",
    "shear",
    "triaxial",
    "element",
    "incline",
    "polyhedra",
    "hopper",
    "drum",
    "silo",
    "groups",
    "jacks",
    "stones",
];

/// Path of the previous stage, which need not have run.
const NOWHERE: &str = "no snapshot";

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("run").join(name)
}

fn read(file: &str, overrides: &[&str]) -> Scene {
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    Scene::read_to_go_on(&folder(file), &overrides, NOWHERE.as_ref())
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Runs a number of steps of a scene.
fn run(scene: &Scene, steps: u64) -> Simulation {
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(scene, &comm);
    assemble::fill(&mut sim, scene, &comm);
    sim.begin(&mut comm).unwrap();
    for _ in 0..steps {
        sim.step(&mut comm).unwrap_or_else(|error| panic!("{error}"));
    }
    sim
}

#[test]
fn each_has_a_page_and_a_picture_and_nothing_doubtful() {
    for name in FOLDERS {
        let files: Vec<PathBuf> =
            fs::read_dir(folder(name)).unwrap().map(|entry| entry.unwrap().path()).collect();
        let with = |ending: &str| {
            files
                .iter()
                .filter(|path| path.extension().is_some_and(|e| e == ending))
                .collect::<Vec<_>>()
        };
        let page = fs::read_to_string(folder(name).join("README.md")).unwrap();
        let pictures = with("svg");
        assert!(!pictures.is_empty() && !with("toml").is_empty(), "{name}: {files:?}");
        for picture in pictures {
            let file = picture.file_name().unwrap().to_str().unwrap();
            assert!(page.contains(file), "{name}: the page does not show {file}");
            assert!(fs::metadata(picture).unwrap().len() < 300_000, "{}", picture.display());
        }
        let mut scenes = with("toml");
        scenes.sort();
        let mut before = PathBuf::from(NOWHERE);
        for (stage, file) in scenes.into_iter().enumerate() {
            let scene =
                Scene::read_to_go_on(file, &[], &before).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(doubts(&scene), Vec::<String>::new(), "{}", scene.title);
            if ["triaxial", "element", "jacks"].contains(&name) {
                // The next stage takes its scene from the snapshot of this one.
                before = fresh_directory(&format!("ready_{name}_{stage}"));
                let comm = &mut Alone::default();
                save(&support::begun(&scene, comm), &before, &scene, comm);
            }
        }
    }
}

/// Runs `run/demo` in a copy of `run` where set-up and build do nothing.
fn demo(copy: &Path, words: &[&str]) -> Ended {
    Call::new(vec![], "cp", [Path::new("-r"), &folder(""), copy]).succeed();
    for nothing in [copy.join("run/setup"), copy.join("cargo")] {
        fs::write(&nothing, "#!/bin/sh\n").unwrap();
        fs::set_permissions(&nothing, fs::Permissions::from_mode(0o755)).unwrap();
    }
    let mpich = mpirun() == "mpirun.mpich";
    let built = copy.join(if mpich { "target/mpich/release" } else { "target/release" });
    fs::create_dir_all(&built).unwrap();
    symlink(env!("CARGO_BIN_EXE_dem-mpi"), built.join("dem-mpi")).unwrap();
    symlink(env!("CARGO_BIN_EXE_dem-post"), built.join("dem-post")).unwrap();
    let path = format!("PATH={}:{}", copy.display(), std::env::var("PATH").unwrap());
    let variables = [&*path, "CARGO_TARGET_DIR=target", "run/demo"];
    let which: &[&str] = if mpich { &["--mpi", "mpich"] } else { &[] };
    Call::new(vec![], "env", [&variables, which, words].concat()).from(copy).end()
}

/// One command runs the drum, and makes the pictures and tables of its page.
#[test]
fn the_demo_of_a_scene_makes_what_its_page_shows() {
    let copy = fresh_directory("demo").canonicalize().unwrap();
    let short = ["--set", "time.duration=0.012", "--set", "output.snapshot_every=500"];
    let ended = demo(&copy, &[&["drum"], &short[..]].concat());
    assert_eq!(ended.status.code(), Some(0), "{ended}");
    let post = copy.join("out/drum/post_series");
    ended.said_once(&format!("Look at the pictures:  {}", post.join("index.html").display()));
    for file in ["index.html", "mixing.csv", "slope.csv"] {
        assert!(post.join(file).exists(), "no {file}: {ended}");
    }
    assert!(copy.join("out/drum/last.vtkhdf").exists());
    // Halves of one snapshot give no information on mixing.
    let post = env!("CARGO_BIN_EXE_dem-post");
    let alone = Call::new(vec![], post, ["out/drum", "--mixing", "half:x"]).from(&copy).end();
    assert_eq!(alone.status.code(), Some(0), "{alone}");
    assert!(alone.output.contains("the halves of a single snapshot are separate"), "{alone}");
}

/// For an unknown scene the demo lists the known ones, and the page of each has its command.
#[test]
fn the_demo_tells_its_scenes() {
    let ended = demo(&fresh_directory("demo_of_nothing"), &["dram"]);
    assert_eq!(ended.status.code(), Some(2), "{ended}");
    let names = ended.errors.strip_prefix("run/demo: dram: the scenes are ").expect("names");
    let names: Vec<&str> = names.split_whitespace().collect();
    for name in ["drum", "hopper", "packing", "silo"] {
        assert!(names.contains(&name), "{names:?}");
    }
    for name in names {
        let page = fs::read_to_string(folder(name).join("README.md")).unwrap();
        let words = if name == "packing" { "" } else { name };
        let command = format!("\n./run/demo {words}").trim_end().to_owned() + " ";
        assert!(page.contains(&command), "run/{name}/README.md does not have{command}");
    }
}

/// After a twentieth of a second, against Coulomb's law and rolling without slip.
#[test]
fn bodies_on_the_incline_move_as_in_the_textbook() {
    let scene = read("incline/scene.toml", &[]);
    let sim = run(&scene, 5000);
    let (down, press) = (scene.gravity.x, -scene.gravity.z);
    assert!((down / press - 0.4).abs() < 1e-4);
    let accelerations = [0.0, down - 0.3 * press, down * 5.0 / 7.0, down - 0.05 * press];
    for (k, acceleration) in accelerations.into_iter().enumerate() {
        let (velocity, expected) = (sim.particles.velocity[k].x, acceleration * sim.time());
        assert!((velocity - expected).abs() < 1e-3, "body {k}: {velocity} m/s, {expected} m/s");
    }
}

/// Angular velocity of the top particle of a stack [rad/s], and the highest speed of a voussoir [m/s].
#[test]
fn stack_and_arch_stand_or_fall() {
    let top = |file: &str| {
        let sim =
            run(&read("polyhedra/stack.toml", &[&format!("fill.file.0.path={file}")]), 10_000);
        sim.particles.spin.as_ref().unwrap().angular_velocity[4].norm()
    };
    let (stands, falls) = (top("stack_stands.csv"), top("stack_falls.csv"));
    assert!(stands < 0.05 && falls > 0.2, "{stands} and {falls} rad/s");
    let keystone = |friction: &str| {
        let sim = run(&read("polyhedra/arch.toml", &[friction]), 10_000);
        sim.particles.velocity[3].norm()
    };
    let (stands, falls) =
        (keystone("material.stone.friction=0.32"), keystone("material.stone.friction=0.28"));
    assert!(stands < 1e-4 && falls > 1e-3, "{stands} and {falls} m/s");
}

#[test]
fn heap_and_mixture_begin_to_rain() {
    for name in ["heap", "mixture"] {
        let scene = read(&format!("{name}/scene.toml"), &["fill.rain.count=60"]);
        let sim = run(&scene, 3000);
        assert!(sim.particles.owned >= 16, "{name}: {} grains", sim.particles.owned);
        let measures = sim.measure(&mut Alone::default());
        assert!(measures.missing().abs() < 1e-3 * measures.kinetic(), "{name}: {measures:?}");
    }
}

/// Particles flow over glued ones, which stay; a stream presses on a post; an intruder moves through its bed.
#[test]
fn held_grains_stay_or_go_their_way() {
    let rough = run(&read("groups/rough.toml", &[]), 6000);
    let owned = 0..rough.particles.owned;
    let (mut speed, mut free) = (0.0, 0);
    for slot in owned {
        let place = rough.particles.position[slot];
        assert!(place.z > 0.0015, "{place}");
        if rough.particles.is_held(slot) {
            assert!((place.z - 0.002).abs() < 2.1e-4, "{place}");
        } else {
            (speed, free) = (speed + rough.particles.velocity[slot].x, free + 1);
        }
    }
    assert!(free == 480 && speed / f64::from(free) > 0.01, "{free} at {speed} m/s");

    let deep =
        ["fill.lattice.1.first=[0.015, 0.015, 0.056]", "fill.lattice.0.high=[0.03, 0.03, 0.05]"];
    let intruder = run(&read("groups/intruder.toml", &deep), 20_000);
    let slot = (0..intruder.particles.owned).find(|&slot| intruder.particles.is_held(slot));
    let place = intruder.particles.position[slot.unwrap()];
    assert!((place.z - (0.056 - 0.2 * intruder.time())).abs() < 1e-12, "{place}");
    let measures = intruder.measure(&mut Alone::default());
    assert!(measures.group_forces[0].z > 0.0, "{measures:?}");

    let stream = ["inlet.top.low=[0.03, 0.002, 0.004]", "inlet.top.high=[0.04, 0.028, 0.02]"];
    let chute = run(&read("groups/obstacle.toml", &stream), 15_000);
    let mut past = 0;
    for slot in (0..chute.particles.owned).filter(|&slot| !chute.particles.is_held(slot)) {
        let place = chute.particles.position[slot];
        assert!((place.x - 0.06).hypot(place.y - 0.015) > 0.0053, "{place}");
        past += u32::from(place.x > 0.065);
    }
    assert!(past > 10, "{past} are past the post");
}

/// Particles fall only through a hopper's opening, rise on the ascending side of a drum, and stay in a silo.
#[test]
fn hopper_drum_and_silo_hold_their_grains() {
    let few = ["fill.lattice.0.high=[0.03, 0.03, 0.068]", "fill.lattice.0.velocity=[0, 0, -1]"];
    let hopper = run(&read("hopper/scene.toml", &few), 8000);
    let (mut under, mut beside) = (0, 0);
    for place in &hopper.particles.position[..hopper.particles.owned] {
        let aside = place.x.abs().max(place.y.abs());
        under += u32::from(place.z < 0.0);
        // Below the funnel's walls, which rise by 40 mm in 18.
        beside += u32::from(place.z < 0.04 && aside > 0.012 + 0.45 * place.z.max(0.0) + 1e-3);
    }
    assert!(under > 10 && beside == 0, "{under} under, {beside} beside the opening");

    let drum = run(&read("drum/scene.toml", &[]), 20_000);
    let mut sum = 0.0;
    for place in &drum.particles.position[..drum.particles.owned] {
        assert!(place.x.hypot(place.z) < 0.04, "{place}");
        sum += place.x;
    }
    assert!(sum < 0.0, "the drum lifts its grains at -x, not {sum}");

    let silo = run(&read("silo/scene.toml", &[]), 20_000);
    let count = silo.particles.owned;
    assert!(count > 500, "{count} grains");
    for place in &silo.particles.position[..count] {
        assert!(place.x.hypot(place.y) < 0.03, "{place}");
    }
}

/// The shear stress has the sign of the flow, and pressure rises with the square of the rate.
#[test]
fn sheared_spheres_press_with_the_square_of_the_rate() {
    let stresses = |rate: f64| {
        let scene = read("shear/scene.toml", &[&format!("domain.shear.rate={rate}")]);
        let strain_of_one = (1.0 / (rate * scene.dt)) as u64;
        let (mut comm, mut sim) = (Alone::default(), run(&scene, strain_of_one));
        let (mut pressure, mut shear, samples) = (0.0, 0.0, 40);
        for _ in 0..samples {
            for _ in 0..strain_of_one / 40 {
                sim.step(&mut comm).unwrap();
            }
            let bulk = sim.measure(&mut comm).bulk.unwrap();
            let sum = |k: usize| bulk.of_contacts[k] + bulk.of_motion[k];
            pressure += (sum(0) + sum(1) + sum(2)) / 3.0 / f64::from(samples);
            shear += sum(3) / f64::from(samples);
        }
        (pressure, shear)
    };
    let ((slow, slow_shear), (fast, _)) = (stresses(400.0), stresses(800.0));
    assert!(slow > 0.0 && (3.0..5.0).contains(&(fast / slow)), "{slow} and {fast} Pa");
    let friction = -slow_shear / slow;
    assert!((0.2..0.9).contains(&friction), "{friction}");
}

/// Each stage continues from the previous one, and its exit status can stop a chain.
#[test]
fn the_three_stages_of_the_triaxial_test_follow_each_other() {
    let out = fresh_directory("triaxial");
    let stage = |name: &str, before: Option<&str>, more: &[&str]| {
        let directory = out.join(name);
        let start = before.map(|before| format!("start={}", out.join(before).display()));
        let mut words = vec![folder("triaxial").join(format!("{name}.toml")).display().to_string()];
        words.extend(["--out".to_owned(), directory.display().to_string()]);
        words.extend(start.into_iter().flat_map(|start| ["--set".to_owned(), start]));
        words.extend(more.iter().map(|&word| word.to_owned()));
        (dem_mpi(Launch::Alone, words).end(), directory)
    };
    let loose = ["--set", "stop.servo=0.9", "--set", "stop.unbalanced=0.9"];
    let (ended, packed) = stage("1-pack", None, &loose);
    assert_eq!(ended.status.code(), Some(0), "{ended}");
    assert_eq!(report(&packed)["run"]["particles"], 1088);
    let (ended, _) = stage("2-compress", Some("1-pack"), &["--set", "time.steps=100"]);
    assert_eq!(ended.status.code(), Some(4), "a stage that was cut short: {ended}");
    let (ended, _) = stage("3-shear", Some("2-compress"), &["--set", "time.steps=200"]);
    assert_eq!(ended.status.code(), Some(0), "{ended}");
}
