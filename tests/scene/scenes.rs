//! Scene files: all errors are reported at the right place, valid files have the right meaning, and their particles are in
//! the right positions.

use crate::support::{begun, close, save, scene};
use anyhow::{Context, Result};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::wire;
use dem_mpi::contact::{Epa, ErodedGjk};
use dem_mpi::drive::rain::of_layer;
use dem_mpi::ids::MaterialId;
use dem_mpi::ids::ShapeId;
use dem_mpi::law::linear::{Interactions, damping_ratio_of_restitution};
use dem_mpi::math::Vec3;
use dem_mpi::particles::Needs;
use dem_mpi::particles::records::Particle;
use dem_mpi::population::Library;
use dem_mpi::scene::doubts::doubts;
use dem_mpi::scene::packing::initial;
use dem_mpi::scene::plan::plan;
use dem_mpi::scene::{
    Fill, FreeWall, Goal, Location, Method, Mix, Scene, SceneErrors, Servo, Stop,
};
use dem_mpi::shape::Shape;
use dem_mpi::sim::audit::Settings;
use dem_mpi::sim::stop::When;
use dem_mpi::walls::Wall;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Constants of linear contacts.
fn interactions(scene: &Scene) -> &Interactions {
    &scene.law.linear().expect("linear contacts").interactions
}

// --- files ---

/// All files of this ending below a folder, sorted.
fn files_below(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder of scenes") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.to_string_lossy().ends_with(ending) {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// Messages on the `#^` lines of a file, each below the line it is about. Messages at the top are about the whole file.
fn expected(text: &str) -> Vec<(Location, String)> {
    let mut place = Location::File;
    let mut messages = Vec::new();
    for (index, line) in text.lines().enumerate() {
        match line.strip_prefix("#^ ") {
            Some(message) => messages.push((place.clone(), message.to_owned())),
            None => place = Location::Line(index + 1),
        }
    }
    messages
}

#[test]
fn bad_scenes_are_told_all_their_mistakes() -> Result<()> {
    let files = files_below(Path::new("tests/scenes/bad"), ".toml");
    assert!(files.len() >= 25, "{} files", files.len());
    for file in files {
        let expected = expected(&std::fs::read_to_string(&file)?);
        let name = file.display();
        assert!(!expected.is_empty(), "{name} says nothing of its mistakes");
        let errors = Scene::read(&file, &[]).err().with_context(|| format!("{name} passed"))?;
        let found: Vec<(Location, String)> =
            errors.problems.into_iter().map(|p| (p.location, p.message)).collect();
        assert_eq!(found, expected, "{name}");
    }
    Ok(())
}

#[test]
fn good_scenes_pass_and_survive_the_wire() -> Result<()> {
    let mut files = files_below(Path::new("tests/scenes/good"), ".toml");
    files.extend(files_below(Path::new("run"), "scene.toml"));
    for file in files {
        let scene = Scene::read(&file, &[])?;
        assert_eq!(wire::decode::<Scene>(&wire::encode(&scene)), scene, "{}", file.display());
        for ranks in [1, 2, 7] {
            assert!(plan(&scene, ranks).contains("Left out"), "{}", file.display());
        }
    }
    Ok(())
}

/// A surface of triangles is sent once, and wall and library share it on arrival.
#[test]
fn a_surface_is_sent_and_held_once() -> Result<()> {
    let scene = Scene::read(Path::new("tests/scenes/good/mesh_walls.toml"), &[])?;
    let bytes = wire::encode(&scene);
    let received: Scene = wire::decode(&bytes);
    let mut of_surfaces = 0;
    for wall in received.walls.iter().filter(|wall| wall.mesh.is_some()) {
        let mesh = wall.mesh.as_ref().context("a mesh")?;
        let Shape::TriangleMesh(shape) = &received.library.shapes[mesh.shape.index()] else {
            panic!("no surface")
        };
        assert!(Arc::ptr_eq(shape, &mesh.surface), "{}", wall.name);
        of_surfaces += wire::encode(&**shape).len();
    }
    let without = Scene { library: Library::default(), ..scene };
    let rest = wire::encode(&without).len();
    assert!(bytes.len() < rest + of_surfaces * 3 / 2, "{} {of_surfaces} {rest}", bytes.len());
    Ok(())
}

/// Sizes of meshes, and the direction of their axes in the plan.
#[test]
fn solids_are_read() -> Result<()> {
    let scene = Scene::read(Path::new("tests/scenes/good/solids.toml"), &[])?;
    let [rod, wedge, die, brick, octahedron, prism] = &scene.library.shapes[..] else {
        panic!("six shapes: {:?}", scene.library.names)
    };
    let near = |found: f64, exact: f64| (found / exact - 1.0).abs() < 1e-6;
    assert_eq!(rod.semi_axes(), Vec3::new(0.005, 0.002, 0.002));
    assert!(near(wedge.volume(), 0.006_f64.powi(3) / 6.0));
    assert_eq!(die.semi_axes(), Vec3::repeat(0.0025));
    assert!(near(brick.volume(), 192e-9));
    // Chamfered corners extend a little beyond rounded ones.
    assert!((0.0032..0.00326).contains(&octahedron.bounding_radius()));
    assert!(near(prism.volume(), 0.5 * 0.006 * 0.005 * 0.006));
    let page = plan(&scene, 1);
    for line in [
        "spherocylinder-polyhedron: cores",
        "polyhedron-polyhedron: thickness",
        "polyhedron-rounded-polyhedron: thickness",
        "its centre is at [1.0000e-2, 2.0000e-2, 3.0000e-2] m in its file, its axes are rotated by the quaternion \
         [1.000000, 0.000000, 0.000000, 0.000000]",
    ] {
        assert!(page.contains(line), "no \"{line}\" in\n{page}");
    }
    Ok(())
}

/// The most frequent mistakes of units give a warning.
#[test]
fn other_units_are_doubtful() -> Result<()> {
    let doubts_with = |scene: &str, overrides: &[&str]| -> Result<Vec<String>> {
        let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
        let path = Path::new("tests/scenes/good").join(scene);
        Ok(doubts(&Scene::read(&path, &overrides)?))
    };
    let meshes = "mesh_walls.toml";
    assert_eq!(doubts_with(meshes, &[])?, Vec::<String>::new());
    for (changes, words) in [
        (
            &["material.glass.friction=30"][..],
            "if this is an angle in degrees, its coefficient is 0.58",
        ),
        (&["wall.box.shift=[1, 0, 0]"], "is outside the domain: check the `scale` of its mesh"),
        (&["wall.box.scale=1", "wall.box.shift=[7, -21, -30]"], "times as large as the domain"),
    ] {
        let doubts = doubts_with(meshes, changes)?;
        assert!(matches!(&doubts[..], [doubt] if doubt.contains(words)), "{changes:?}: {doubts:?}");
    }
    let pressed = |stress: &str| doubts_with("every_key.toml", &[stress]);
    let is_pressed = |doubts: Vec<String>| doubts.iter().any(|d| d.contains("causes overlaps"));
    assert!(!is_pressed(pressed("servo.0.stress=1")?));
    assert!(is_pressed(pressed("servo.0.stress=1e9")?));
    let lid = doubts_with("every_key.toml", &["servo.0.stress=1", "motion.0.force=-1e9"])?;
    assert!(
        lid.iter().any(|doubt| doubt.starts_with("wall \"piston\" with a load of ")),
        "{lid:?}"
    );
    Ok(())
}

/// The automatic step, and the number of steps of a duration.
#[test]
fn steps_and_duration() -> Result<()> {
    let path = Path::new("tests/scenes/good/solids.toml");
    let scene = Scene::read(path, &[])?;
    let part = scene.dt / scene.time_step_limit().unwrap().dt;
    assert!((0.75..0.85).contains(&part), "{part} of the limit");
    let time = scene.steps as f64 * scene.dt;
    assert!((1e-3 * (1.0 - 1e-9)..1e-3 + scene.dt).contains(&time), "{time} s");

    let read = |overrides: &[&str]| {
        let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
        Scene::read(path, &overrides).map_err(|error| error.to_string())
    };
    // The number of steps is whole, though the quotient of the decimal numbers is not.
    let scene = read(&["time.step=1e-6", "time.duration=7e-6"]).unwrap();
    assert_eq!((scene.dt, scene.steps), (1e-6, 7));
    for (overrides, message) in [
        (&["time.steps=5"][..], "give either `steps` or `duration`, not both"),
        (&["time.step=automatic"], "must be a number greater than 0 [s], or \"auto\""),
        (&["time.duration=1e30"], "is more steps than the maximum"),
        (&["time.step=1e-3"], "step = \"auto\""),
    ] {
        let error = read(overrides).unwrap_err();
        assert!(error.contains(message), "{overrides:?}: {error}");
    }
    Ok(())
}

/// Any value of a key gives a scene or a list of errors, never a panic.
#[test]
fn odd_values_never_panic() -> Result<()> {
    let folder = Path::new("tests/scenes/good");
    let every_key = std::fs::read_to_string(folder.join("every_key.toml"))?;
    let solids = std::fs::read_to_string(folder.join("solids.toml"))?;
    let odd = [
        "0",
        "-1",
        "nan",
        "inf",
        "1e300",
        "1e-300",
        "1e18",
        "true",
        "''",
        "'x'",
        "[]",
        "{}",
        "[1e300, 1e300, 1e300]",
        "[1e-300, 1e-300, 1e-300]",
        "[0, 0, 0]",
        "[[]]",
        "{ x = 1 }",
        "[[0, 0, 0], [1e300, 0, 0], [0, 1e300, 0], [0, 0, 1e300]]",
        "[[0, 0, 0], [1e-300, 0, 0], [0, 1e-300, 0], [0, 0, 1e-300]]",
        "[[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [1e-9, 0, 1e-9]]",
    ];
    let numbered = |text| str::lines(text).enumerate().map(move |(k, line)| (text, k, line));
    for (text, index, line) in numbered(&every_key).chain(numbered(&solids)) {
        let lines: Vec<&str> = text.lines().collect();
        let changed = match line.split_once(" = ") {
            Some((key, _)) => odd.iter().map(|value| format!("{key} = {value}")).collect(),
            None => vec![String::new(), "[odd]".to_owned(), "[[material]]".to_owned()],
        };
        for changed in changed {
            let mut lines = lines.clone();
            lines[index] = &changed;
            if let Ok(scene) = Scene::parse(&lines.join("\n"), "odd", folder, &[]) {
                plan(&scene, 3);
            }
        }
    }
    Ok(())
}

#[test]
fn errors_name_the_file_and_the_line() {
    let error = Scene::read(Path::new("tests/scenes/bad/key_twice.toml"), &[]).unwrap_err();
    let text = error.to_string();
    assert!(
        text.starts_with("1 error in the scene\ntests/scenes/bad/key_twice.toml:23: "),
        "{text}"
    );
    let error = Scene::read(Path::new("no/such.toml"), &[]).unwrap_err();
    assert!(error.to_string().contains("no/such.toml: cannot be read"), "{error}");
}

// --- meaning ---

fn every_key() -> Scene {
    Scene::read(Path::new("tests/scenes/good/every_key.toml"), &[]).expect("a good scene")
}

#[test]
fn every_key_arrives() {
    let scene = every_key();
    assert_eq!(scene.title, "Everything");
    assert_eq!(scene.seed, 18_446_744_073_709);
    assert_eq!(scene.domain.periodic(), [true, false, false]);
    let walls: Vec<(&str, [f64; 3])> =
        scene.walls.iter().map(|w| (w.name.as_str(), w.surface().1.into())).collect();
    let planes = [
        ("-y", [0.0, 1.0, 0.0]),
        ("+y", [0.0, -1.0, 0.0]),
        ("-z", [0.0, 0.0, 1.0]),
        ("lid", [0.0, 0.0, -1.0]),
        ("trough", [0.0, 0.0, 1.0]),
        ("flap", [0.0, 0.0, -1.0]),
        ("piston", [0.0, 0.0, -1.0]),
    ];
    assert_eq!(walls, planes);
    assert_eq!(scene.walls[2].velocity, Vec3::new(0.0, 0.0, 0.002));
    let lid = &scene.walls[3];
    // The oscillation begins at rest.
    assert!((lid.velocity - Vec3::new(0.0, 0.0, -0.01)).norm() < 1e-15);
    assert_eq!(lid.course.as_ref().map(|course| course.shifts.len()), Some(2));
    assert_eq!(scene.walls[6].mass, 0.2);
    let piston = FreeWall { wall: 6, along: Vec3::z(), mass: 0.2, load: -3.0 - 0.2 * 9.81 };
    assert_eq!(scene.free_walls, [piston]);
    let flap = &scene.walls[5];
    assert_eq!(flap.point, Vec3::new(0.0, 0.1, 0.5));
    assert!(flap.may_turn() && flap.across().is_none());
    assert!(scene.walls.iter().all(|wall| wall.moves));
    let trough = &scene.walls[4];
    assert_eq!(trough.point, Vec3::new(0.0, 0.1, -0.2));
    assert_eq!(trough.angular_velocity, Vec3::new(-0.01, 0.0, 0.0));
    let [bottom, side] = [0, 1].map(|k| trough.facets[k].geometry);
    assert_eq!((bottom.normal, side.normal), (Vec3::z(), Vec3::y()));
    assert!((bottom.offset - 0.1).abs() < 1e-15 && (side.offset + 0.2).abs() < 1e-15);
    let servo = Servo { walls: vec![0, 1], goal: Goal::Stress(1e5), max_speed: 0.5, gain: 0.8 };
    assert_eq!(scene.servos, [servo]);

    let library = &scene.library;
    assert_eq!(
        library.names,
        [
            "ball", "bead", "egg", "rice", "brick", "pebble", "ball", "bead", "egg", "rice",
            "brick", "pebble", "-y", "+y", "-z", "lid", "trough", "trough", "flap", "piston"
        ]
    );
    // Held particles have additional shapes in the library.
    assert_eq!((library.particle_shapes, library.own_shapes()), (12, 6));
    assert!(library.mass_felt[12..19].iter().all(|&mass| mass == f64::INFINITY));
    assert_eq!(library.mass_felt[19], 0.2);
    assert!(library.inertia[12..].iter().all(|inertia| inertia.x == f64::INFINITY));
    let rice = library.shapes[3].semi_axes();
    assert!((rice.x / rice.y - 3.0).abs() < 1e-15 && rice.y == rice.z, "{rice}");
    assert!((rice.product() - 0.004_f64.powi(3)).abs() < 1e-22, "{rice}");

    let axes = [Vec3::new(0.006, 0.005, 0.004), Vec3::new(0.004, 0.005, 0.003)];
    let Shape::Superellipsoid(brick) = &library.shapes[4] else { panic!("no superellipsoid") };
    assert_eq!((brick.semi_axes(), brick.exponents()), (axes[0], [0.5, 0.3]));
    let Shape::PolySuperellipsoid(pebble) = &library.shapes[5] else { panic!("no octants") };
    assert_eq!((pebble.semi_axes(), pebble.exponents()), (axes, [0.8, 1.2]));

    let between = interactions(&scene).of(library.materials[0], library.materials[2]);
    assert_eq!(between.normal_stiffness, 2e4);
    assert_eq!(between.friction, 0.2);
    assert_eq!(between.normal_damping_ratio, damping_ratio_of_restitution(0.5, false));
    let glass = interactions(&scene).of(MaterialId(0), MaterialId(0));
    assert_eq!((glass.tangential_stiffness, glass.tangential_damping_ratio), (8e3, 0.1));
    let steel = interactions(&scene).of(MaterialId(1), MaterialId(1));
    assert_eq!((steel.tangential_stiffness, steel.friction), (3e4, 0.0), "defaults");
    assert_eq!(steel.normal_damping_ratio, 0.0, "restitution 1");

    assert_eq!(
        scene.method,
        Method::GjkErosion(ErodedGjk {
            ratio: 0.1,
            increment: 0.02,
            tolerance: 1e-8,
            spurious: false
        })
    );
    assert_eq!((scene.dt, scene.steps), (1e-5, 100_000));
    let drives = vec![("servo".to_owned(), 0.01)];
    let (rest, unbalanced) = (Some(1e-5), Some(1e-3));
    let when = |column: &str, above, below| When { column: column.to_owned(), above, below };
    let when = vec![when("top_m", None, Some(0.1)), when("coordination", Some(4.0), Some(12.0))];
    let stop = Stop { rest, unbalanced, drives, when, after: 0.05, ..Stop::default() };
    assert_eq!(scene.stop, stop);
    assert_eq!((scene.skin, scene.imbalance), (0.001, 1.5));
    assert_eq!((scene.snapshot_every, scene.history_every), (1000, 10));
    assert_eq!(scene.snapshot_every_minutes, Some(30.0));
    assert_eq!(scene.out, Path::new("out/everything"));
    let rain = scene.rain.as_ref().expect("it rains");
    assert_eq!(rain.mix.cumulative, [(ShapeId(0), 0.25), (ShapeId(3), 1.0)]);
    assert_eq!((rain.count, rain.every, rain.cells()), (1000, 50, [10, 10, 5]));
    let counts: Vec<u64> = scene.initial.iter().map(Fill::count).collect();
    assert_eq!(counts, [16 * 16 * 5, 100, 2]);
    assert!(scene.text.contains("# Every key"), "the text is as written");
}

#[test]
fn audits_arrive_and_have_defaults() {
    let scene = every_key();
    let audit = Settings { every: 500, contacts: Some(30), seed: 5 };
    assert_eq!(scene.audit, audit);
    let without = scene.text.replace("[audit]\nevery = 500\ncontacts = 30\nseed = 5\n", "");
    let default = Scene::parse(&without, "test", Path::new("tests/scenes/good"), &[]);
    let usual = Settings { every: Settings::EVERY, contacts: None, seed: scene.seed };
    assert_eq!(default.expect("a good scene").audit, usual);
}

#[test]
fn rain_falls_from_the_side_that_gravity_pulls_away_from() -> Result<()> {
    let scene = Scene::read(Path::new("tests/scenes/good/next_stage.toml"), &[])?;
    let rain = scene.rain.context("it rains")?;
    assert_eq!(rain.low, Vec3::zeros());
    assert_eq!(rain.high, Vec3::new(0.1, rain.spacing, 0.1));
    Ok(())
}

/// `2 / ω` with `ω² = 2 · 7/2 k / m` for two balls without dashpots, as there are no others.
#[test]
fn the_stable_step_of_balls_is_known() -> Result<()> {
    let path = Path::new("tests/scenes/good/two_balls.toml");
    let scene = Scene::read(path, &[])?;
    let limit = scene.time_step_limit().context("balls have a limit")?.dt;
    let exact = 2.0 / (7.0 * 1e4 / scene.library.mass[0]).sqrt();
    assert!((limit / exact - 1.0).abs() < 1e-12, "{limit} {exact}");

    let over = format!("time.step={}", 1.001 * limit);
    assert!(Scene::read(path, &[format!("time.step={limit}")]).is_ok());
    assert!(Scene::read(path, std::slice::from_ref(&over)).is_err());
    assert!(Scene::read(path, &[over, "time.allow_unstable=true".to_owned()]).is_ok());
    Ok(())
}

// --- overrides ---

fn with(overrides: &[&str]) -> Result<Scene, SceneErrors> {
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    Scene::read(Path::new("tests/scenes/good/every_key.toml"), &overrides)
}

#[test]
fn overrides_reach_every_place() -> Result<()> {
    let scene = with(&[
        "time.steps = 7",
        "material.glass.friction=0.4",
        "shape.0.radius=0.004",
        "gravity.2=-1.62",
        "domain.walls=['-y', '-z']",
        "servo.0.walls=['-y']",
        "servo.0.coupled=false",
        "domain.wall_velocity.-z = [0.125, 0, 0]",
        "output.directory=elsewhere/run 2",
        "contact={ method = 'epa' }",
        "fill.rain.shapes.rice=1",
        "start=Cargo.toml",
        "fill.lattice=[]",
        "fill.file=[]",
        "motion=[]",
    ])?;
    assert_eq!(scene.steps, 7);
    let grain = MaterialId(0);
    assert_eq!(interactions(&scene).of(grain, grain).friction, 0.4);
    assert_eq!(scene.library.shapes[0].bounding_radius(), 0.004);
    assert_eq!(scene.gravity, Vec3::new(0.0, 0.0, -1.62));
    assert_eq!(scene.walls.len(), 6);
    let slides = |wall: &Wall| wall.velocity.x == 0.125;
    assert!(scene.walls.iter().any(slides), "a key that TOML wants in quotes");
    assert_eq!(scene.out, Path::new("elsewhere/run 2"));
    assert_eq!(scene.method, Method::Epa(Epa::new(1e-8)));
    assert_eq!(scene.rain.as_ref().context("it rains")?.mix.cumulative[0].1, 0.5);
    assert_eq!(scene.start.as_deref(), Some(Path::new("Cargo.toml")));

    let again = Scene::parse(&scene.text, "again", Path::new(""), &[])?;
    assert_eq!(again, Scene { text: again.text.clone(), ..scene }, "the text is effective");
    Ok(())
}

#[test]
fn wrong_overrides_are_named() {
    let wrong = [
        ("time.steps", "an override is `path.to.key=value`, as in `time.steps=1000`"),
        ("=5", "an override is `path.to.key=value`, as in `time.steps=1000`"),
        ("domain.walls=['-y', -z]", "the value is not TOML: "),
        (
            "material.glas.friction=0.4",
            "there is no `glas` here, did you mean `glass`? (there are: glass, steel)",
        ),
        (
            "shape.6.radius=1",
            "there is no `6` here (there are: ball, bead, egg, rice, brick, pebble)",
        ),
        ("time.step.size=1", "`size` does not exist: its parent is a number"),
        (
            "time.stps=5",
            "time.stps = 5: no such key, did you mean `steps`? (allowed here: step, steps, duration, \
             allow_unstable)",
        ),
        (
            "stopp.rest=1e-6",
            "stopp: no such key, did you mean `stop`? (allowed here: title, seed, gravity, \
             global_damping, start, like, include, folder, domain, cell, wall, motion, servo, material, interaction, shape, contact, law, time, stop, neighbours, audit, output, inlet, outlet, group, fill)",
        ),
        ("shape.ball.radius=-1", "shape.ball.radius = -1: must be a number greater than 0 [m]"),
        (
            "shape.ball.kind=elipsoid",
            "shape.ball.kind = \"elipsoid\": no such choice, did you mean `ellipsoid`? (allowed: \
             sphere, ellipsoid, superellipsoid, poly-superellipsoid, spherocylinder, polyhedron, \
             rounded-polyhedron, union)",
        ),
    ];
    for (text, message) in wrong {
        let errors = with(&[text]).expect_err(text);
        let problem = &errors.problems[0];
        assert!(problem.message.starts_with(message), "{}", problem.message);
        assert_eq!(problem.location, Location::Override(text.to_owned()));
        assert_eq!(errors.problems.len(), 1, "{errors}");
        assert!(errors.to_string().contains(&format!("\n--set {text}: ")), "{errors}");
    }
}

// --- parts of scenes ---

/// A folder with these files.
fn files(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).expect("a file");
    }
    folder
}

/// Places, relative to the folder, and messages of the errors of a scene.
fn mistakes(folder: &Path, scene: &str, overrides: &[&str]) -> Vec<String> {
    let overrides: Vec<String> = overrides.iter().map(|&text| text.to_owned()).collect();
    let errors = Scene::read(&folder.join(scene), &overrides).expect_err(scene).to_string();
    let folder = format!("{}/", folder.display());
    errors.lines().skip(1).map(|line| line.replace(&folder, "")).collect()
}

/// A scene of three files in two folders equals the scene in one file, and so does the text in snapshots.
#[test]
fn included_files_are_merged() -> Result<()> {
    let path = Path::new("tests/scenes/good/parts.toml");
    let scene = Scene::read(path, &[])?;
    let names: Vec<&str> = scene.materials.iter().map(|material| &*material.name).collect();
    assert_eq!(names, ["glass", "steel"], "a new one stands behind");
    assert_eq!(scene.materials[0].density, 2500.0);
    let glass = MaterialId(0);
    assert_eq!(interactions(&scene).of(glass, glass).friction, 0.5);
    let walls: Vec<&str> = scene.walls.iter().map(|wall| &*wall.name).collect();
    assert_eq!(walls, ["-z", "-x", "box"]);
    assert_eq!(scene.gravity, Vec3::new(0.0, 0.0, -9.81));
    assert_eq!(scene.out, Path::new("out/common"));
    assert_eq!(scene.history_every, 5);
    let [Fill::Lattice(lattice)] = &scene.initial[..] else { panic!("one lattice") };
    assert!(lattice.first.z > 0.06, "lists without names are replaced");

    let by_itself = "title = \"Of several files\"\ngravity = [0.0, 0.0, -9.81]\n\
         [domain]\nlow = [0, 0, 0]\nhigh = [0.1, 0.1, 0.1]\nwalls = [\"-z\", \"-x\"]\nwall_material = \"steel\"\n\
         [[material]]\nname = \"glass\"\ndensity = 2500\nnormal_stiffness = 1e4\nfriction = 0.5\nrestitution = 0.8\n\
         [[material]]\nname = \"steel\"\ndensity = 7800\nnormal_stiffness = 4e4\n\
         [[shape]]\nname = \"ball\"\nmaterial = \"glass\"\nkind = \"sphere\"\nradius = 5e-3\n\
         size = { lognormal = { median = 1, sigma = 0.1 }, limits = [0.8, 1.2] }\n\
         [[wall]]\nname = \"box\"\nmaterial = \"steel\"\nmesh = \"../good/box.stl\"\nscale = 1e-3\nshift = [0.05, 0.05, 0.02]\n\
         [[fill.lattice]]\nlow = [0, 0, 0.06]\nhigh = [0.1, 0.1, 0.1]\n\
         [time]\nstep = 1e-5\nsteps = 10\n[output]\ndirectory = \"out/common\"\nhistory_every = 5\n";
    let without = |scene: Scene| Scene { text: String::new(), ..scene };
    let expected = Scene::parse(by_itself, "one", Path::new("tests/scenes/parts"), &[])?;
    let saved = Scene::parse(&scene.text, "saved", Path::new("elsewhere"), &[])?;
    assert!(!scene.text.contains("include"), "{}", scene.text);
    assert_eq!(saved.text, scene.text);
    let scene_text = scene.text.clone();
    assert_eq!(without(saved), without(expected.clone()));
    assert_eq!(without(scene), without(expected));

    // A saved scene may be included, too: its paths are complete.
    let part = files(&[("saved.toml", &scene_text), ("scene.toml", "include = \"saved.toml\"\n")]);
    let of_saved = Scene::read(&part.path().join("scene.toml"), &[])?;
    assert_eq!(of_saved.walls.len(), 3);

    let set =
        Scene::read(path, &["material.glass.friction=0.25".to_owned(), "wall=[]".to_owned()])?;
    assert_eq!(interactions(&set).of(glass, glass).friction, 0.25);
    assert_eq!(set.walls.len(), 2);
    Ok(())
}

/// A scene that includes a part.
const WITH_PART: &str = "include = \"part.toml\"\n[time]\nstep = 1e-5\nsteps = 1\n[output]\ndirectory = \"out\"\n\
    [[fill.lattice]]\nfirst = [0.05, 0.05, 0.05]\ncount = [1, 1, 1]\n";
/// Text of that part.
const PART: &str = "[domain]\nlow = [0, 0, 0]\nhigh = [0.1, 0.1, 0.1]\n\
    [[material]]\nname = \"glass\"\ndensity = 2500\nnormal_stiffness = 1e4\n\
    [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.01\n";

#[test]
fn mistakes_of_included_files_have_their_places() {
    let with = |part: &str| files(&[("scene.toml", WITH_PART), ("part.toml", part)]);
    assert!(Scene::read(&with(PART).path().join("scene.toml"), &[]).is_ok());

    let part = PART.replace("radius = 0.01", "radius = -0.01\nradios = 2");
    assert_eq!(
        mistakes(with(&part).path(), "scene.toml", &["time.steps=-1"]),
        [
            "part.toml:11: shape.ball.radius = -0.01: must be a number greater than 0 [m]",
            "part.toml:12: shape.ball.radios = 2: no such key, did you mean `radius`? (allowed here: name, material, kind, radius, \
             diameter, size)",
            "--set time.steps=-1: time.steps = -1: must be a whole number, 0 or greater",
        ]
    );
    let found = mistakes(with("[domain]\nlow = [0, 0,\n").path(), "scene.toml", &[]);
    assert!(found[0].starts_with("part.toml:2: not valid TOML: "), "{found:?}");

    let alone = files(&[("scene.toml", WITH_PART)]);
    let missing = "scene.toml:1: include = \"part.toml\": part.toml cannot be read: No such file or directory (os error 2)";
    assert_eq!(mistakes(alone.path(), "scene.toml", &[]), [missing]);
    std::fs::create_dir(alone.path().join("part.toml")).unwrap();
    let found = mistakes(alone.path(), "scene.toml", &[]);
    assert!(found[0].ends_with("part.toml cannot be read: it is not a regular file"), "{found:?}");

    let circle = files(&[
        ("scene.toml", WITH_PART),
        ("part.toml", "include = [\"of/other.toml\"]\n"),
        ("of/other.toml", "\ninclude = \"../part.toml\"\n"),
    ]);
    assert_eq!(
        mistakes(circle.path(), "scene.toml", &[]),
        [
            "of/other.toml:2: include = \"../part.toml\": is circular: part.toml includes of/other.toml includes \
             of/../part.toml"
        ]
    );
    let itself = files(&[("scene.toml", "include = \"scene.toml\"\n")]);
    assert_eq!(
        mistakes(itself.path(), "scene.toml", &[]),
        ["scene.toml:1: include = \"scene.toml\": is circular: scene.toml includes scene.toml"]
    );
    for (include, said) in [
        (
            "3",
            "include = 3: must be a string, or a list of one or more, each a string, not a number",
        ),
        ("[]", "include = []: must be a list of one or more, each a string"),
        ("[\"part.toml\", 4]", "include.1 = 4: must be a string, not a number"),
    ] {
        let scene = WITH_PART.replace("\"part.toml\"", include);
        let folder = files(&[("scene.toml", &scene), ("part.toml", PART)]);
        assert_eq!(mistakes(folder.path(), "scene.toml", &[]), [format!("scene.toml:1: {said}")]);
    }
    let set = mistakes(with(PART).path(), "scene.toml", &["include=part.toml"]);
    assert_eq!(
        set,
        ["--set include=part.toml: include = \"part.toml\": must be in a file, not an override"]
    );
    let deep: Vec<(String, String)> =
        (0..20).map(|k| (format!("{k}.toml"), format!("include = \"{}.toml\"\n", k + 1))).collect();
    let deep: Vec<(&str, &str)> = deep.iter().map(|(name, text)| (&**name, &**text)).collect();
    let found = mistakes(files(&deep).path(), "0.toml", &[]);
    assert!(
        found[0].contains("exceeds the limit: a scene has at most 100 files, nested 16"),
        "{found:?}"
    );
}

/// A stage that is `like` the previous one, in another folder, with a mesh.
#[test]
fn a_stage_may_be_like_the_one_before() -> Result<()> {
    let stl = include_str!("../scenes/good/box.stl");
    let walls = "[[wall]]\nname = \"box\"\nmesh = \"box.stl\"\nscale = 1e-3\nshift = [0.05, 0, 0]\n\
        [[wall]]\nname = \"lid\"\npoint = [0, 0, 0.1]\nnormal = [0, 0, -1]\n";
    let first = format!(
        "gravity = [0, 0, -1]\nseed = 4\n{PART}{walls}[time]\nstep = 1e-5\nsteps = 1\n[output]\ndirectory = \"out\"\n\
         [[fill.lattice]]\nfirst = [0.05, 0.05, 0.05]\ncount = [1, 1, 1]\n"
    );
    let folder = files(&[("first/scene.toml", &first), ("first/box.stl", stl)]);
    let before = Scene::read(&folder.path().join("first/scene.toml"), &[])?;
    assert!(before.text.starts_with("folder = \""), "{}", before.text);
    let out = folder.path().join("out");
    let mut comm = Alone::default();
    save(&begun(&before, &mut comm), &out, &before, &mut comm);

    let own = "[time]\nstep = 2e-5\nsteps = 3\n[output]\ndirectory = \"next\"\n";
    let steel = "[[material]]\nname = \"glass\"\nnormal_stiffness = 2e4\n[[wall]]\nname = \"lid\"\nvelocity = [0, 0, -0.01]\n";
    let head = format!("title = \"next\"\nstart = {out:?}\n");
    let like = format!("{head}like = \"start\"\n{steel}{own}");
    let copied = format!(
        "{head}gravity = [0, 0, -1]\n{}{}{own}",
        PART.replace("1e4", "2e4"),
        walls.replace("box.stl", "../first/box.stl") + "velocity = [0, 0, -0.01]\n",
    );
    for (name, text) in [("like.toml", &like), ("copied.toml", &copied)] {
        std::fs::create_dir_all(folder.path().join("second"))?;
        std::fs::write(folder.path().join("second").join(name), text)?;
    }
    let read = |name: &str| Scene::read(&folder.path().join("second").join(name), &[]);
    let without = |scene: Scene| Scene { text: String::new(), ..scene };
    let (like, copied) = (read("like.toml")?, read("copied.toml")?);
    assert!(!like.text.contains("like"), "{}", like.text);
    assert_eq!(without(like.clone()), without(copied));
    // It continues without the previous stage from its own snapshot.
    let own_out = folder.path().join("next");
    save(&begun(&before, &mut comm), &own_out, &like, &mut comm);
    std::fs::remove_dir_all(&out)?;
    let path = folder.path().join("second/like.toml");
    let goes_on = Scene::read_to_go_on(&path, &[], &own_out)?;
    assert_eq!(without(goes_on), without(Scene { jumps: None, ..like }));
    Ok(())
}

#[test]
fn a_stage_that_is_like_none_says_so() -> Result<()> {
    let own = "[time]\nstep = 2e-5\nsteps = 3\n[output]\ndirectory = \"next\"\n";
    let of = |head: &str| files(&[("scene.toml", &format!("{head}\n{own}"))]);
    let without_start = of("like = \"start\"");
    let said = "scene.toml:1: like = \"start\": needs `start`, the snapshot with the scene to use";
    assert_eq!(mistakes(without_start.path(), "scene.toml", &[]), [said]);
    let other = of("like = \"begin\"");
    let said = "scene.toml:1: like = \"begin\": no such choice (allowed: start)";
    assert_eq!(mistakes(other.path(), "scene.toml", &[]), [said]);
    let nowhere = of("start = \"out/nowhere\"\nlike = \"start\"");
    let found = mistakes(nowhere.path(), "scene.toml", &[]);
    assert!(found[0].contains("no snapshot at out/nowhere"), "{found:?}");

    // A snapshot without a scene, and one whose scene has an error.
    let text =
        format!("{PART}{own}[[fill.lattice]]\nfirst = [0.05, 0.05, 0.05]\ncount = [1, 1, 1]\n");
    let before = scene(&text);
    for (text, said) in [
        (String::new(), "has no scene"),
        (text.replace("0.01", "-1"), "shape.ball.radius = -1: must be a number greater than 0 [m]"),
    ] {
        let folder = tempfile::tempdir()?;
        let out = folder.path().join("out");
        let mut comm = Alone::default();
        save(&begun(&before, &mut comm), &out, &Scene { text, ..before.clone() }, &mut comm);
        let path = folder.path().join("scene.toml");
        std::fs::write(path, format!("start = {out:?}\nlike = \"start\"\n{own}"))?;
        let found = mistakes(folder.path(), "scene.toml", &[]);
        assert!(found.len() == 1 && found[0].ends_with(said), "{found:?}");
        assert!(
            found[0].starts_with("the scene in out:11: ") || said == "has no scene",
            "{found:?}"
        );
    }
    Ok(())
}

// --- particles ---

/// Checks that no two bounding spheres overlap, including periodic images.
fn assert_apart(particles: &[Particle], library: &Library, period: &Vec3) {
    let radius = |p: &Particle| library.shapes[p.shape.index()].bounding_radius() * p.scale;
    for (k, a) in particles.iter().enumerate() {
        for b in &particles[k + 1..] {
            let between = (b.position - a.position)
                .zip_map(period, |d, p| if p.is_finite() { d - p * (d / p).round() } else { d });
            let gap = between.norm() - radius(a) - radius(b);
            assert!(gap > -1e-9 * radius(a), "{} and {}: gap {gap}", a.id, b.id);
        }
    }
}

#[test]
fn a_lattice_fills_its_box_and_nothing_overlaps() -> Result<()> {
    let scene = Scene::read(Path::new("tests/scenes/good/periodic.toml"), &[])?;
    let particles: Vec<Particle> = initial(&scene).collect();
    assert_eq!(particles, initial(&scene).collect::<Vec<_>>(), "the same on every rank");
    assert_eq!(particles.len() as u64, scene.particle_count());
    assert!(particles.iter().enumerate().all(|(k, p)| p.id.0 == k as u64));
    assert!(particles.iter().all(|p| p.velocity == Vec3::new(0.1, 0.0, 0.0)));
    assert_apart(&particles, &scene.library, &Vec3::repeat(0.2));
    assert_ne!(particles[0].quaternion, particles[1].quaternion);

    let other = Scene { seed: scene.seed + 1, ..scene };
    assert_ne!(initial(&other).next().map(|p| p.quaternion), Some(particles[0].quaternion));
    Ok(())
}

/// Without corners a lattice fills the domain. A jitter moves each particle within its limit.
#[test]
fn a_lattice_without_corners_takes_the_domain() -> Result<()> {
    const BOX: &str = "[domain]\nlow = [0, 0, 0]\nhigh = [0.1, 0.1, 0.1]\n\
        [[material]]\nname = \"glass\"\ndensity = 2500\nnormal_stiffness = 1e4\n\
        [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.01\n\
        [time]\nstep = 2e-5\nsteps = 1\n[output]\ndirectory = \"out\"\n\
        [[fill.lattice]]\nspacing = 0.025\n";
    let text = |more: &str| format!("{BOX}{more}");
    let parse = |more: &str| Scene::parse(&text(more), "lattice.toml", Path::new("."), &[]);
    let (still, moved) = (parse("")?, parse("jitter = 2e-3\n")?);
    let [still, moved]: [Vec<Particle>; 2] = [&still, &moved].map(|s| initial(s).collect());
    assert_eq!(still.len(), 4 * 4 * 4);
    assert!((still[0].position - Vec3::repeat(0.0125)).norm() < 1e-16);
    let ways: Vec<Vec3> = still.iter().zip(&moved).map(|(a, b)| b.position - a.position).collect();
    assert!(ways.iter().all(|way| way.amax() <= 2e-3 && way.amax() > 0.0), "{ways:?}");
    // A uniform distribution along each axis has a mean square of a third of the squared limit.
    let squares = ways.iter().map(Vec3::norm_squared).sum::<f64>() / (3.0 * ways.len() as f64);
    assert!((squares / (4e-6 / 3.0) - 1.0).abs() < 0.2, "{squares:e}");
    assert!(still.iter().zip(&moved).all(|(a, b)| a.quaternion == b.quaternion));
    Ok(())
}

#[test]
fn fills_follow_each_other() {
    let scene = every_key();
    let particles: Vec<Particle> = initial(&scene).collect();
    assert_eq!(particles.len(), 16 * 16 * 5 + 100 + 2);
    assert!(particles.iter().enumerate().all(|(k, p)| p.id.0 == k as u64));
    assert_eq!(particles[1280].position, Vec3::new(0.01, 0.01, 0.12));
    assert_eq!(particles[1281].shape, ShapeId(2));

    let [egg, rice] = &particles[1380..] else { panic!("two particles are listed") };
    let spin = egg.angular_momentum.component_div(&scene.library.inertia[2]);
    assert_eq!(spin, Vec3::new(0.0, 0.0, 1.0));
    assert_eq!(rice.velocity, Vec3::new(0.0, 0.0, -1.0));
    let turned = rice.quaternion * Vec3::x();
    assert!((turned - Vec3::y()).norm() < 1e-15, "a quarter turn about z: {turned}");
}

/// Shares by number, within four standard errors.
#[test]
fn a_mix_has_its_shares() {
    let scene = every_key();
    let rain = scene.rain.as_ref().expect("it rains");
    let count = 20_000;
    let rain = dem_mpi::scene::Rain { count, ..rain.clone() };
    let mut fallen = 0;
    let mut rice = 0;
    while fallen < count {
        let layer = rain.in_next_layer(fallen);
        let shape = |k| of_layer(&rain, scene.seed, fallen, k, &scene.library).shape;
        rice += (0..layer).filter(|&k| shape(k) == ShapeId(3)).count();
        fallen += layer;
    }
    let error = 4.0 * (0.75 * 0.25 / count as f64).sqrt();
    assert!((rice as f64 / count as f64 - 0.75).abs() < error, "{rice} of {count}");
}

/// Lead balls of 2 mm and glass balls of 1 mm, on a lattice and through an inlet or as rain.
fn two_weights(shapes: &str, size: &str, flow: &str) -> Scene {
    scene(&format!(
        r#"
gravity = [0, 0, -9.81]
[domain]
low = [0, 0, 0]
high = [0.1, 0.1, 0.1]
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e4
[[material]]
name = "lead"
density = 8000
normal_stiffness = 1e4
[[shape]]
name = "glass"
material = "glass"
kind = "sphere"
radius = 0.001
{size}
[[shape]]
name = "lead"
material = "lead"
kind = "sphere"
radius = 0.002
[[fill.lattice]]
high = [0.1, 0.1, 0.05]
{shapes}
{flow}
{shapes}
[time]
step = 1e-6
steps = 10
[output]
directory = "out"
"#
    ))
}

/// Text of an inlet, and of rain.
const FLOWS: [&str; 2] = [
    "[[inlet]]\nname = \"tap\"\nlow = [0, 0, 0.08]\nhigh = [0.1, 0.1, 0.09]\nrate = 10",
    "[fill.rain]\ncount = 20_000",
];

/// A ball of lead has 8000 * 2^3 / 2500 times the mass of a glass ball. A size distribution multiplies the mass of glass by
/// its mean cube. Uniform scales from a to b by number give (a + b)(a^2 + b^2) / 4. By mass they give 2 (a b)^2 / (a + b).
#[test]
fn shares_by_mass_are_shares_by_number_over_mean_masses() {
    let (lead, [a, b]) = (64_000.0 / 2500.0, [0.5, 1.5_f64]);
    let cubes = [
        ("", 1.0),
        ("size = { uniform = [0.5, 1.5] }", 0.25 * (a + b) * (a * a + b * b)),
        ("size = { uniform = [0.5, 1.5], by = \"mass\" }", 2.0 * (a * b).powi(2) / (a + b)),
    ];
    let given = [
        ("shapes = { lead = 3, glass = 1 }", 3.0),
        ("shapes = { glass = 0.2, lead = 0.6 }", 3.0),
        ("shapes = [\"lead\", \"glass\"]", 1.0),
    ];
    for ((size, cube), (shapes, ratio)) in cubes.into_iter().flat_map(|c| given.map(|g| (c, g))) {
        for flow in FLOWS {
            let of = |shares: &str| two_weights(&format!("{shapes}{shares}"), size, flow);
            let mixes = |scene: &Scene| -> Vec<Mix> {
                let [Fill::Lattice(lattice)] = &scene.initial[..] else { panic!("a lattice") };
                let rain = scene.rain.iter().map(|rain| rain.mix.clone());
                let inlets = scene.inlets.iter().map(|inlet| inlet.mix.clone());
                std::iter::once(lattice.mix.clone()).chain(rain).chain(inlets).collect()
            };
            let by_mass = mixes(&of("\nshares = \"mass\""));
            assert_eq!(by_mass.len(), 2);
            for mix in by_mass {
                let shares: Vec<_> = mix.shares().collect();
                let [(ShapeId(0), of_glass), (ShapeId(1), of_lead)] = shares[..] else {
                    panic!("{shares:?}")
                };
                close(of_lead / of_glass, ratio * cube / lead, 1e-12, &format!("{size}, {shapes}"));
            }
            let by_number = mixes(&of("\nshares = \"number\""));
            assert_eq!(by_number, mixes(&of("")));
            let of_lead = by_number[1].shares().nth(1).unwrap().1;
            assert!((of_lead - ratio / (ratio + 1.0)).abs() < 1e-15, "{of_lead}");
        }
    }
}

/// A single shape has the whole share, and a plan has the shares by number and by mass.
#[test]
fn a_plan_has_the_shares_of_a_mix() {
    let of = |shapes: &str| two_weights(shapes, "", FLOWS[0]);
    let three_quarters = plan(&of("shapes = { lead = 3, glass = 1 }\nshares = \"mass\""), 1);
    let line =
        "shares by number: glass 89.51 %, lead 10.49 %; by mass: glass 25.00 %, lead 75.00 %";
    assert_eq!(three_quarters.matches(line).count(), 2, "{three_quarters}");
    let one = "shapes = [\"lead\"]";
    let alone = of(&format!("{one}\nshares = \"mass\""));
    assert_eq!(alone.inlets, of(one).inlets);
    assert!(!plan(&alone, 1).contains("shares by"));
}

/// The mass of lead among 20,000 particles of rain is the requested one, within five standard errors. The standard error of
/// a ratio of sums is sqrt(sum of (m (1 or 0 - R))^2) / sum of m.
#[test]
fn shares_by_mass_are_met_by_what_rains() {
    for by in ["number", "mass"] {
        let size = format!("size = {{ uniform = [0.5, 1.5], by = \"{by}\" }}");
        let shapes = "shapes = { lead = 3, glass = 1 }\nshares = \"mass\"";
        let scene = two_weights(shapes, &size, FLOWS[1]);
        let rain = scene.rain.as_ref().expect("it rains");
        let grains = (0..rain.count).map(|k| of_layer(rain, scene.seed, k, 0, &scene.library));
        let (mut all, mut of_lead, mut squares) = (0.0, 0.0, 0.0);
        for grain in grains {
            let mass = scene.library.mass_at(grain.shape, grain.scale);
            let is_lead = f64::from(grain.shape == ShapeId(1));
            all += mass;
            of_lead += mass * is_lead;
            squares += (mass * (is_lead - 0.75)).powi(2);
        }
        let (found, error) = (of_lead / all, squares.sqrt() / all);
        println!("{by}: {found} of lead, standard error {error:.1e}");
        assert!((found - 0.75).abs() < 5.0 * error && error < 0.01, "{by}: {found}, {error}");
    }
}

#[test]
fn a_layer_of_rain_is_a_pure_function_inside_its_slab() {
    let scene = every_key();
    let rain = scene.rain.as_ref().expect("it rains");
    let library = &scene.library;
    assert_eq!((rain.per_layer(), rain.layers()), (500, 2));

    let layer = |seed, first_id| -> Vec<_> {
        (0..500).map(|k| of_layer(rain, seed, first_id, k, library)).collect()
    };
    let first = layer(1, 100);
    assert_eq!(first, layer(1, 100));
    assert_ne!(first[0].position, layer(2, 100)[0].position, "another seed");
    assert_ne!(first[0].position, layer(1, 600)[0].position, "another layer");
    assert!(first.iter().enumerate().all(|(k, p)| p.id.0 == 100 + k as u64));
    assert!(first.iter().all(|p| p.velocity == rain.velocity));
    for particle in &first {
        let radius = library.shapes[particle.shape.index()].bounding_radius() * particle.scale;
        let room = 1e-12;
        assert!(particle.position.iter().zip(rain.low.iter()).all(|(x, l)| x - radius > l - room));
        assert!(particle.position.iter().zip(rain.high.iter()).all(|(x, h)| x + radius < h + room));
    }
    assert_apart(&first, library, &Vec3::new(0.2, f64::INFINITY, f64::INFINITY));
}

#[test]
fn the_last_layer_of_rain_is_what_is_left() {
    let scene = every_key();
    let rain = dem_mpi::scene::Rain { count: 700, ..scene.rain.expect("it rains") };
    assert_eq!([0, 500, 700].map(|fallen| rain.in_next_layer(fallen)), [500, 200, 0]);
}

// --- plan ---

#[test]
fn a_plan_says_what_is_left_out() -> Result<()> {
    let scene = Scene::read(Path::new("tests/scenes/good/two_balls.toml"), &[])?;
    assert_eq!(scene.needs(), Needs::default());
    let bytes = format!("{} bytes in columns", Needs::default().column_bytes());
    let balls = plan(&scene, 1);
    for line in [
        "sphere-sphere: closed form",
        "no orientation: all shapes are spheres",
        "no rotation: spheres without friction have no moment",
        "no tangential history: friction is 0 everywhere",
        "no gravity",
        "no insertion: no rain, no inlet",
        "no work of walls: no moving walls",
        "not in snapshots: scale, group, quaternion, angular_velocity, torque, dissipated_by_tangential_dashpots, dissipated_by_friction, dissipated_by_turning, \
         dissipated_by_damping, dissipated_by_adhesion, velocity_ahead, angular_velocity_ahead, image, angular_momentum",
        "no walls on these sides of the domain: -x, +x, -y, +y, -z, +z",
        &bytes,
        "24 bytes in the message of each step",
        "audit           every 1000 steps one contact in 50, 1000 at most, resolved again",
        "each: less than 1 % of the time",
        "about 2 owned and 0 ghost particles, 0 neighbours (1 rank)",
    ] {
        assert!(balls.contains(line), "no \"{line}\" in\n{balls}");
    }
    let scene = every_key();
    let needs = Needs {
        velocity: true,
        spin: true,
        orientation: true,
        form: false,
        image: true,
        scale: true,
        patches: false,
        curvature: false,
        friction: true,
        tangential_dashpots: true,
        turning: false,
        damping: true,
        adhesion: false,
        group: true,
        ahead: true,
    };
    assert_eq!(scene.needs(), needs);
    let all = plan(&scene, 4);
    for line in [
        "sphere-ellipsoid: gjk-erosion",
        "ellipsoid-plane: closed form",
        "moving walls    -y, +y, -z, lid, trough",
        "servo           -y, +y: 1e5 Pa, at most 5e-1 m/s, gain 0.8",
        "sums            a sum of 2144 bytes over all ranks in each step",
        "columns         position, velocity, force; angular velocity, torque; orientation, angular momentum; period \
         counts; scales; predicted velocity increments",
        "152 bytes in the message of each step",
        "audit           every 500 steps about 30 contacts resolved again",
        "Left out\n  not in snapshots: dissipated_by_turning, dissipated_by_adhesion\n",
    ] {
        assert!(all.contains(line), "no \"{line}\" in\n{all}");
    }
    let without = plan(&with(&["audit={every = 0}"])?, 4);
    assert!(without.contains("Left out\n  no audit of contacts: audit.every = 0\n  not in snapshots: dissipated_by_turning, dissipated_by_adhesion\n"), "{without}");
    let late = with(&["time.steps=60"])?;
    assert!(plan(&late, 4).contains("the last layers of rain will not fall"));
    let never = with(&["time.steps=20"])?;
    assert!(plan(&never, 4).contains("no rain will fall: the first layer appears at step 50,"));
    Ok(())
}

/// Particles on one lattice would never touch, which gives a warning; two interpenetrating lattices collide.
#[test]
fn a_sheared_lattice_that_never_touches_is_doubtful() -> Result<()> {
    let text = std::fs::read_to_string("run/shear/scene.toml")?;
    let (one, _) = text.rsplit_once("[[fill.lattice]]").context("two lattices")?;
    let (_, rest) = text.rsplit_once("[time]").context("a time")?;
    let doubts_of = |text: &str| -> Result<Vec<String>> {
        Ok(doubts(&Scene::parse(text, "shear", Path::new(""), &[])?))
    };
    assert_eq!(doubts_of(&text)?, Vec::<String>::new());
    let [doubt] = &doubts_of(&format!("{one}[time]{rest}"))?[..] else { panic!("one doubt") };
    assert!(
        doubt.contains("at least 1.280e-3 m apart along y, and particles at most 1.100e-3 m wide"),
        "{doubt}"
    );
    Ok(())
}

/// 48 balls fall from rest in three layers of a slab of 10 mm. Each layer needs 45.15 ms to leave it: 452 steps of 100 µs,
/// which are three times the 200 steps between layers. The first one appears after 200 steps.
#[test]
fn the_plan_counts_the_steps_that_rain_needs() -> Result<()> {
    let with_steps = |set: &str| -> Result<String> {
        let scene = "[domain]\nlow = [0, 0, 0]\nhigh = [0.04, 0.04, 0.2]\nwalls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\"]\n\
                     [[material]]\nname = \"glass\"\ndensity = 2500.0\nnormal_stiffness = 10.0\n\
                     [[shape]]\nname = \"ball\"\nkind = \"sphere\"\ndiameter = 0.01\n\
                     [fill.rain]\nshapes = { ball = 1.0 }\ncount = 48\nevery = 200\nspacing = 0.01\n\
                     [time]\nstep = 1e-4\nsteps = 1200\n[output]\ndirectory = \"none\"\n";
        let overrides = ["gravity=[0, 0, -9.81]".to_owned(), set.to_owned()];
        Ok(plan(&Scene::parse(scene, "rain", Path::new(""), &overrides)?, 1))
    };
    let late = "a layer leaves its slab after 600 steps, so the last of 3 appears at step 1400 or later, but the stage has 1200 steps";
    let short = with_steps("time.steps=1200")?;
    assert!(short.contains(late) && short.contains("one in 600 steps"), "{short}");
    for enough in ["time.steps=1401", "fill.rain.velocity=[0, 0, -0.3]"] {
        let long = with_steps(enough)?;
        assert!(!long.contains("will not fall"), "{long}");
    }
    // 48 balls make a bed of 25 mm, from which the slab is 165 mm away: a fall of 183.6 ms after step 1400.
    let falling = "the last appears at step 1400 or later and needs some 1837 steps, but the stage has 3000 steps";
    let short = with_steps("time.steps=3000")?;
    assert!(short.contains(falling), "{short}");
    assert!(!with_steps("time.steps=3300")?.contains("rain will"));
    Ok(())
}

/// A key of only one of two materials that can touch gives one warning per pair, unless an `[[interaction]]` has the key.
#[test]
fn keys_of_one_material_alone_are_doubtful() -> Result<()> {
    let text = r#"
domain = { low = [0, 0, 0], high = [1, 1, 1], walls = ["-z"], wall_material = "steel" }
law = { rolling = "spring", adhesion = "dmt" }
time = { step = 1e-6, steps = 1 }
output = { directory = "out" }
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e4
friction = 0.5
restitution = 0.6
rolling_friction = 0.1
surface_energy = 0.01
[[material]]
name = "steel"
density = 7800
normal_stiffness = 1e4
[[material]]
name = "gold"
density = 19300
normal_stiffness = 1e4
friction = 0
restitution = 1
rolling_friction = 0
surface_energy = 0
[[shape]]
name = "ball"
material = "glass"
kind = "sphere"
radius = 0.01
[[fill.lattice]]
shapes = ["ball"]
first = [0.5, 0.5, 0.5]
count = [1, 1, 1]
"#;
    let doubts_of = |more: &str| -> Result<Vec<String>> {
        Ok(doubts(&Scene::parse(&(text.to_owned() + more), "pair", Path::new(""), &[])?))
    };
    let [doubt] = &doubts_of("")?[..] else { panic!("{:?}", doubts_of("")?) };
    assert_eq!(
        doubt,
        "between materials \"glass\" and \"steel\" `friction` is 0, because \"steel\" has none; dashpots of \
         `restitution` have half the strength of the other, because \"steel\" has none; `rolling_friction` is 0, \
         because \"steel\" has none; `surface_energy` is 0, because \"steel\" has none: set it there, to 0 \
         (`restitution` to 1) if that is intended, or in an [[interaction]] of both"
    );
    // The interaction names the materials in another order and gives a part of the keys.
    let both = "[[interaction]]\nbetween = [\"steel\", \"glass\"]\nfriction = 0.1\n";
    let [doubt] = &doubts_of(both)?[..] else { panic!("{:?}", doubts_of(both)?) };
    assert!(!doubt.contains("`friction`") && doubt.contains("`rolling_friction` is 0"), "{doubt}");
    let all = "restitution = 0.4\nrolling_friction = 0\nsurface_energy = 0.01\n";
    assert_eq!(doubts_of(&(both.to_owned() + all))?, Vec::<String>::new());
    // Particles of steel also meet the wall of steel, which is one material; particles of gold have all keys.
    let grains = "[[shape]]\nname = \"MATERIAL\"\nmaterial = \"MATERIAL\"\nkind = \"sphere\"\nradius = 0.01\n";
    for material in ["steel", "gold"] {
        assert_eq!(doubts_of(&grains.replace("MATERIAL", material))?.len(), 1, "{material}");
    }
    Ok(())
}

/// Warnings: a condition of rest beside a wall that never stops, and a first check of `[stop]` after the end.
#[test]
fn a_stop_that_may_never_hold_is_doubtful() -> Result<()> {
    let text = r#"
domain = { low = [0, 0, 0], high = [1, 1, 1], walls = ["-z"] }
time = { step = 1e-6, steps = 100 }
output = { directory = "out" }
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e4
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.01
[[fill.lattice]]
first = [0.5, 0.5, 0.5]
count = [1, 1, 1]
[[wall]]
name = "lid"
point = [0, 0, 0.9]
normal = [0, 0, -1]
"#;
    let doubts_of = |more: &str| -> Result<Vec<String>> {
        Ok(doubts(&Scene::parse(
            &(text.to_owned() + more),
            "stop",
            Path::new("tests/scenes/good"),
            &[],
        )?))
    };
    let (stop, motion) =
        ("[stop]\nunbalanced = 0.1\n", "[[motion]]\nwalls = [\"lid\"]\nalong = [0, 0, 1]\n");
    let turning = "rotation = { about = [0.5, 0.5, 0.9], axis = [0, 0, 1], rate = 1 }\n";
    let swinging = format!("{motion}amplitude = 1e-4\nfrequency = 10\n");
    for moving in ["velocity = [0, 0, -0.01]\n", turning, &swinging] {
        assert_eq!(doubts_of(moving)?, Vec::<String>::new());
        let doubts = doubts_of(&(moving.to_owned() + stop))?;
        let told = "[stop] `unbalanced` needs bodies at rest, but wall \"lid\" moves for ever";
        assert!(matches!(&doubts[..], [doubt] if doubt.starts_with(told)), "{moving}: {doubts:?}");
    }
    // Motions that end by themselves, or that the particles stop.
    let flap = "[[motion]]\nwalls = [\"lid\"]\nabout = [0.5, 0.5, 0.9]\naxis = [0, 0, 1]\ntable = \"flap.csv\"\n";
    let free = format!("velocity = [0, 0, -0.01]\n{motion}mass = 0.1\n");
    for good in [String::new(), flap.to_owned(), free] {
        assert_eq!(doubts_of(&(good + stop))?, Vec::<String>::new());
    }
    assert_eq!(doubts_of(&format!("{stop}after = 1e-4\n"))?, Vec::<String>::new());
    let doubts = doubts_of(&format!("{stop}after = 1.1e-4\n"))?;
    let told = "[stop] is checked only after 0.00011 s, but the stage lasts 1.000e-4 s";
    assert!(matches!(&doubts[..], [doubt] if doubt.starts_with(told)), "{doubts:?}");
    Ok(())
}
