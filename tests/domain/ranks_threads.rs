//! Identical bits on any number of ranks, as threads of one process, and after a restart on another
//! number. (`tests/program/mod.rs` covers MPI.)

use crate::support::{MATERIAL, OnRanks, State, begun, scene};
use dem_mpi::comm::threads;
use dem_mpi::scene::{Scene, plan};

/// Ellipsoids of two sizes and balls with friction, dashpots and damping, thrown together.
const CROWD: &str = r#"
gravity = [1.0, 0.5, -9.81]
global_damping = 2.0
[domain]
low = [0.0, 0.0, 0.0]
high = [0.03, 0.03, 0.2]
DOMAIN
MATERIAL
[[shape]]
name = "long"
kind = "ellipsoid"
diameter = 0.003
aspect_ratio = 2.0
[[shape]]
name = "flat"
kind = "ellipsoid"
semi_axes = [0.0016, 0.0014, 0.0008]
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.0011
[contact]
METHOD
[[fill.lattice]]
shapes = { long = 3, flat = 2, ball = 1 }
low = [0.0, 0.0, 0.0]
high = [0.03, 0.03, 0.0735]
spacing = 0.0049
velocity = [0.3, -0.2, -1.5]
[fill.rain]
shapes = ["long"]
count = 60
every = 200
low = [0.0, 0.0, 0.08]
high = [0.03, 0.03, 0.09]
velocity = [0.0, 0.0, -2.0]
[time]
step = 1e-5
steps = 1500
[neighbours]
imbalance = 1.05
order_every = 150
"#;

const WALLED: &str = r#"walls = ["-x", "+x", "-y", "+y", "-z"]"#;
const PERIODIC: &str = r#"periodic = [true, true, false]
walls = ["-z"]"#;

/// A moving lid and sides that keep a stress: one pair controlled by its mean, two walls each on its
/// own.
const SERVOED: &str = r#"walls = ["-x", "+x", "-y", "+y", "-z"]
[[wall]]
name = "lid"
point = [0.0, 0.0, 0.1]
normal = [0.0, 0.0, -1.0]
velocity = [0.0, 0.0, -0.5]
[[servo]]
walls = ["-x", "+x"]
stress = 2e3
max_speed = 0.05
coupled = true
[[servo]]
walls = ["-y", "+y"]
stress = 2e3
max_speed = 0.05"#;

fn crowd(domain: &str, method: &str) -> Scene {
    scene(&CROWD.replace("MATERIAL", MATERIAL).replace("DOMAIN", domain).replace("METHOD", method))
}

/// State on one rank. Checks that other numbers of ranks, between which particles migrate, give
/// identical bits.
#[track_caller]
fn changing_hands(scene: &Scene, steps: u64) -> State {
    let on_ranks = OnRanks::of(scene);
    let alone = on_ranks.run(1, steps);
    alone.is_kept(scene, steps);
    for ranks in [2, 3, 4, 8] {
        let (shared, migrated) =
            on_ranks.run_and_look(ranks, steps, |sim| sim.domain.traffic.migrated);
        alone.expect(&shared, &format!("{ranks} ranks"));
        let migrated: u64 = migrated.iter().sum();
        assert!(migrated > 100, "particles change hands: {migrated}");
    }
    alone
}

/// State on one rank. Checks that other numbers of ranks and restarts half-way give identical bits.
#[track_caller]
fn everywhere(scene: &Scene, steps: u64, restarts: &[[u32; 2]]) -> State {
    OnRanks::of(scene).the_same_on(steps, &[2, 3, 4, 8], restarts)
}

#[test]
fn walled_crowd_is_the_same_on_any_number_of_ranks() {
    let scene = crowd(WALLED, "");
    let alone = changing_hands(&scene, 3000);
    let (particles, contacts) = (alone.bits.len(), alone.records.len());
    assert!(particles >= 500 && contacts > 500, "a crowd: {particles} with {contacts} contacts");
}

#[test]
fn periodic_crowd_is_the_same_on_any_number_of_ranks() {
    let scene = crowd(PERIODIC, "");
    OnRanks::of(&scene).the_same_on(1000, &[2, 3, 5], &[]);
}

#[test]
fn a_crowd_between_servos_is_the_same_on_any_number_of_ranks() {
    let scene = crowd(SERVOED, "");
    let alone = OnRanks::of(&scene).the_same_on(1500, &[2, 3, 4], &[]);
    let place = |wall: &str, axis: usize| alone.numbers(&format!("place of {wall}"))[axis];
    let moved = [place("-x", 0), 0.03 - place("+x", 0), place("-y", 1), 0.03 - place("+y", 1)];
    assert!(moved.iter().all(|d| d.abs() > 1e-5), "{moved:?}");
    assert!(moved[2] != moved[3] && (moved[0] - moved[1]).abs() < 1e-15, "{moved:?}");
}

#[test]
fn every_method_is_the_same_on_any_number_of_ranks() {
    for method in ["gjk-erosion", "epa", "common-normal"] {
        let scene = crowd(WALLED, &format!("method = \"{method}\""));
        OnRanks::of(&scene).the_same_on(400, &[4], &[]);
    }
}

/// Particles with Hertz-Mindlin contacts: `balls` alone, or ellipsoids with them.
fn elastic_crowd(balls: bool) -> Scene {
    let material = "[law]\nnormal = \"hertz\"\nlargest_overlap = 0.05\n[[material]]\nname = \"grain\"\ndensity = 2650.0\n\
        youngs_modulus = 1e6\npoisson_ratio = 0.3\nfriction = 0.3\nrestitution = 0.5";
    let text = CROWD.replace("MATERIAL", material).replace("DOMAIN", WALLED).replace("METHOD", "");
    if !balls {
        return scene(&text);
    }
    let text = text
        .replace(
            "kind = \"ellipsoid\"\ndiameter = 0.003\naspect_ratio = 2.0",
            "kind = \"sphere\"\nradius = 0.002",
        )
        .replace(
            "kind = \"ellipsoid\"\nsemi_axes = [0.0016, 0.0014, 0.0008]",
            "kind = \"sphere\"\nradius = 0.0015",
        );
    scene(&text)
}

#[test]
fn a_hertzian_crowd_is_the_same_on_any_number_of_ranks_and_after_a_restart() {
    for balls in [true, false] {
        let scene = elastic_crowd(balls);
        let alone = everywhere(&scene, 2000, &[[1, 3], [2, 1]]);
        assert!(alone.records.len() > 500, "a crowd: {} contacts", alone.records.len());
    }
}

/// Shapes whose curvature is computed by finite differences, one by one.
#[test]
fn hertzian_superellipsoids_are_the_same_on_any_number_of_ranks_and_after_a_restart() {
    let text = elastic_crowd(false)
        .text
        .replace("largest_overlap = 0.05", "largest_overlap = 0.04")
        .replace(
            "kind = \"ellipsoid\"\ndiameter = 0.003\naspect_ratio = 2.0",
            "kind = \"superellipsoid\"\nsemi_axes = [0.0012, 0.0012, 0.002]\nexponents = [0.6, 0.8]",
        )
        .replace(
            "kind = \"ellipsoid\"\nsemi_axes = [0.0016, 0.0014, 0.0008]",
            "kind = \"superellipsoid\"\nsemi_axes = [0.0016, 0.0014, 0.001]\nexponents = [1.2, 0.7]",
        );
    let scene = scene(&text);
    let words = "radii of curvature of superellipsoids are means over 0.1 rad, and at least 0.01 bounding radii";
    assert!(plan::plan(&scene, 1).contains(words), "{}", plan::plan(&scene, 1));
    let alone = everywhere(&scene, 1000, &[[1, 3], [8, 1]]);
    assert!(alone.records.len() > 200, "a crowd: {} contacts", alone.records.len());
}

/// Spheres with contacts that persist beyond the overlap, in periodic and in bounded domains.
#[test]
fn a_crowd_that_sticks_is_the_same_on_any_number_of_ranks_and_after_a_restart() {
    let text = elastic_crowd(true)
        .text
        .replace("normal = \"hertz\"", "normal = \"hertz\"\nadhesion = \"jkr\"")
        .replace("poisson_ratio = 0.3", "poisson_ratio = 0.3\nsurface_energy = 0.5")
        .replace("step = 1e-5", "step = 6e-6");
    for domain in [WALLED, PERIODIC] {
        let scene = scene(&text.replace(WALLED, domain));
        let alone = everywhere(&scene, 2500, &[[1, 3], [4, 1]]);
        let overlap = |row: &[u64]| row.last().map_or(0.0, |&bits| f64::from_bits(bits));
        let gaps = alone.records.iter().filter(|(_, _, row)| overlap(row) < 0.0).count();
        assert!(
            alone.records.len() > 300 && gaps > 10,
            "{gaps} of {} contacts",
            alone.records.len()
        );
        let other = Scene { skin: 0.3 * scene.skin, ..scene.clone() };
        alone.expect(&OnRanks::of(&other).run(2, 2500), "another skin");
    }
}

/// A scene with added resistance to rolling and twisting.
fn resisting(text: &str, law: &str) -> Scene {
    let material = "friction = 0.3\nrolling_friction = 0.2\ntwisting_friction = 0.1";
    assert!(text.contains("friction = 0.3"));
    let text = text.replace("friction = 0.3", material);
    let springs = format!("[law]\nrolling = \"spring\"\ntwisting = \"spring\"\n{law}");
    scene(&if text.contains("[law]") {
        text.replace("[law]", &springs)
    } else {
        text.replacen("[[material]]", &format!("{springs}\n[[material]]"), 1)
    })
}

#[test]
fn crowds_that_resist_rolling_and_stick_are_the_same_on_any_number_of_ranks_and_after_a_restart() {
    let eggs =
        CROWD.replace("MATERIAL", MATERIAL).replace("DOMAIN", PERIODIC).replace("METHOD", "");
    let boxes = FACES.replace("MATERIAL", MATERIAL).replace("DOMAIN", TURNING);
    let elastic = elastic_crowd(false).text;
    let sticking = elastic_crowd(true)
        .text
        .replace("poisson_ratio = 0.3", "poisson_ratio = 0.3\nsurface_energy = 0.01");
    for (scene, steps) in [
        (resisting(&eggs.replace("step = 1e-5", "step = 4e-6"), ""), 2250),
        (resisting(&boxes.replace("step = 4e-6", "step = 2.2e-6"), ""), 4550),
        (resisting(&elastic.replace("step = 1e-5", "step = 6e-6"), ""), 1500),
        (resisting(&sticking.replace("step = 1e-5", "step = 6e-6"), "adhesion = \"dmt\""), 2000),
    ] {
        let alone = everywhere(&scene, steps, &[[1, 3], [4, 1]]);
        assert!(alone.records.len() > 10, "a crowd: {} contacts", alone.records.len());
    }
}

/// All kinds of particles in a sheared cell.
fn sheared_crowd(neighbours: &str) -> Scene {
    let domain =
        "periodic = [true, true, true]\nshear = { along = \"y\", across = \"x\", rate = 80.0 }";
    let boxes = "kind = \"polyhedron\"\nvertices = [[-0.0012, -0.001, -0.0008], [-0.0012, -0.001, 0.0008], [-0.0012, 0.001, -0.0008], \
        [-0.0012, 0.001, 0.0008], [0.0012, -0.001, -0.0008], [0.0012, -0.001, 0.0008], [0.0012, 0.001, -0.0008], \
        [0.0012, 0.001, 0.0008]]\nsize = { uniform = [0.8, 1.2] }";
    let text = CROWD.replace("MATERIAL", MATERIAL).replace("DOMAIN", domain).replace("METHOD", "");
    let (begin, rest) = text.split_once("[fill.rain]").unwrap();
    let (_, rest) = rest.split_once("[time]").unwrap();
    let text = format!("{begin}[time]{rest}")
        .replace("gravity = [1.0, 0.5, -9.81]\nglobal_damping = 2.0\n", "")
        .replace("high = [0.03, 0.03, 0.2]", "high = [0.03, 0.03, 0.0735]")
        .replace("step = 1e-5", "step = 5e-6")
        .replace("imbalance = 1.05", neighbours)
        .replace("high = [0.03, 0.03, 0.0735]\nspacing", "high = [0.03, 0.03, 0.035]\nspacing")
        .replace(
            "[time]",
            "[[fill.lattice]]\nshapes = { long = 3, flat = 2, ball = 1 }\nlow = [0.0, 0.0, 0.037]\n\
             high = [0.03, 0.03, 0.0735]\nspacing = 0.0049\nvelocity = [-0.2, 0.4, 1.5]\n[time]",
        )
        .replace("kind = \"ellipsoid\"\nsemi_axes = [0.0016, 0.0014, 0.0008]", boxes);
    scene(&text)
}

#[test]
fn a_sheared_crowd_is_the_same_on_any_number_of_ranks_and_after_a_restart() {
    let scene = sheared_crowd("imbalance = 1.05");
    let alone = changing_hands(&scene, 1500);
    let other = sheared_crowd("skin = 0.0007");
    alone.expect(&OnRanks::of(&other).run(2, 1500), "another skin");
    assert!(alone.records.len() > 50, "a crowd: {} contacts", alone.records.len());
    let folder = tempfile::tempdir().unwrap();
    OnRanks::of(&scene).leaves_no_trace(&alone, 1500, &[[1, 3], [3, 1]], folder.path());
}

/// One to four particles that meet in a corner. Most subdomains are empty, including some that write a
/// snapshot and read it again.
#[test]
fn more_ranks_than_particles_work() {
    for particles in 1..=4 {
        let text = CROWD
            .replace("DOMAIN", WALLED)
            .replace("METHOD", "")
            .replace("MATERIAL", MATERIAL)
            .replace("gravity = [1.0, 0.5, -9.81]", "gravity = [-900.0, -900.0, -900.0]")
            .replace("high = [0.03, 0.03, 0.0735]", "high = [0.006, 0.006, 0.006]")
            .replace("count = 60", &format!("count = {}", particles - 1));
        let (lattice, rain) = text.split_once("[fill.rain]").unwrap();
        let (_, rest) = rain.split_once("[time]").unwrap();
        let scene =
            scene(&if particles == 1 { format!("{lattice}[time]{rest}") } else { text.clone() });
        let alone = OnRanks::of(&scene).the_same_on(2500, &[4, 8, 9], &[[4, 8], [8, 4], [9, 3]]);
        assert_eq!(alone.bits.len(), particles);
        assert!(alone.number("dissipated") > 0.0, "they meet the walls");
        assert!(particles == 1 || alone.records.len() > 3, "they meet: {:?}", alone.records);
    }
}

/// The skin of the pair list does not change the results.
#[test]
fn the_skin_does_not_show() {
    let scene = crowd(WALLED, "");
    let usual = OnRanks::of(&scene).run(1, 600);
    for factor in [0.3, 3.0] {
        let other = Scene { skin: factor * scene.skin, ..scene.clone() };
        usual.expect(&OnRanks::of(&other).run(2, 600), &format!("skin times {factor}"));
    }
}

#[test]
fn a_restart_on_another_number_of_ranks_leaves_no_trace() {
    for (domain, steps) in [(WALLED, 900), (PERIODIC, 700), (SERVOED, 800)] {
        let scene = crowd(domain, "");
        OnRanks::of(&scene).the_same_on(steps, &[], &[[1, 3], [3, 1], [2, 4]]);
    }
}

/// Boxes and rounded boxes of many sizes, spheres and ellipsoids, thrown through each other.
const FACES: &str = r#"
gravity = [1.0, 0.5, -9.81]
global_damping = 20.0
[domain]
low = [0.0, 0.0, 0.0]
high = [0.03, 0.03, 0.1]
DOMAIN
MATERIAL
[[shape]]
name = "brick"
kind = "polyhedron"
vertices = [
  [-1.2e-3, -1e-3, -8e-4], [1.2e-3, -1e-3, -8e-4], [-1.2e-3, 1e-3, -8e-4], [1.2e-3, 1e-3, -8e-4],
  [-1.2e-3, -1e-3, 8e-4], [1.2e-3, -1e-3, 8e-4], [-1.2e-3, 1e-3, 8e-4], [1.2e-3, 1e-3, 8e-4],
]
size = { uniform = [0.8, 1.2] }
[[shape]]
name = "die"
kind = "rounded-polyhedron"
radius = 0.0002
vertices = [
  [-8e-4, -8e-4, -8e-4], [8e-4, -8e-4, -8e-4], [-8e-4, 8e-4, -8e-4], [8e-4, 8e-4, -8e-4],
  [-8e-4, -8e-4, 8e-4], [8e-4, -8e-4, 8e-4], [-8e-4, 8e-4, 8e-4], [8e-4, 8e-4, 8e-4],
]
[[shape]]
name = "ball"
kind = "sphere"
radius = 9e-4
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [1.2e-3, 9e-4, 8e-4]
[[fill.lattice]]
shapes = ["brick", "die", "ball", "egg"]
low = [0.0, 0.0, 0.001]
high = [0.03, 0.03, 0.0345]
spacing = 0.0043
velocity = [0.3, -0.2, -2.0]
[time]
step = 4e-6
[neighbours]
imbalance = 1.05
"#;

/// A floor that rotates about its normal.
const TURNING: &str = r#"walls = ["-x", "+x", "-y", "+y"]
[[wall]]
name = "table"
point = [0.015, 0.015, 0.0]
normal = [0.0, 0.0, 1.0]
rotation = { about = [0.015, 0.015, 0.0], axis = [0.0, 0.0, 1.0], rate = 20.0 }"#;

#[test]
fn boxes_are_the_same_on_any_number_of_ranks_and_after_a_restart() {
    for domain in [PERIODIC, TURNING] {
        let scene = scene(&FACES.replace("MATERIAL", MATERIAL).replace("DOMAIN", domain));
        let alone = OnRanks::of(&scene).the_same_on(5000, &[2, 4], &[[1, 3], [4, 1]]);
        let (particles, contacts) = (alone.bits.len(), alone.records.len());
        assert!(particles >= 100 && contacts > 20, "a crowd: {particles} with {contacts} contacts");
    }
}

/// Particles that stream through each other in a fully periodic box. Along two axes the box is hardly
/// wider than two halo widths, so every rank's halo reaches round the period.
const NARROW: &str = r#"
[domain]
low = [0.0, 0.0, 0.0]
high = HIGH
periodic = [true, true, true]
[[material]]
name = "stone"
density = 2500.0
normal_stiffness = 1e3
friction = 0.5
restitution = 0.7
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.001, 0.0008, 0.0008]
[[fill.lattice]]
first = FIRST
spacing = 0.0022
count = [2, 2, 6]
velocity = [2.0, 0.5, 1.0]
[[fill.lattice]]
first = SECOND
spacing = 0.0022
count = [2, 2, 6]
velocity = [-2.0, 0.3, -1.0]
[time]
step = 2e-6
[neighbours]
skin = 0.0002
imbalance = 1.01
"#;

#[test]
fn a_period_hardly_wider_than_two_halos_is_the_same_on_any_number_of_ranks() {
    // Twice the bounding diameter of 2 mm and the skin of 0.2 mm is 4.4 mm.
    let text = NARROW
        .replace("HIGH", "[0.00441, 0.0045, 0.0266]")
        .replace("FIRST", "[0.0011, 0.0011, 0.0011]")
        .replace("SECOND", "[0.0011, 0.0011, 0.0144]");
    let scene = scene(&text);
    let alone = everywhere(&scene, 3000, &[]);
    assert!(alone.number("dissipated") > 0.0, "they meet");
}

/// A long periodic axis, cut by two and by three ranks and just wide enough for two.
#[test]
fn few_ranks_along_a_period_are_the_same() {
    let text = NARROW
        .replace("HIGH", "[0.0045, 0.0045, 0.0048]")
        .replace("FIRST", "[0.0011, 0.0011, 0.0012]")
        .replace("SECOND", "[0.0011, 0.0011, 0.0034]")
        .replace("count = [2, 2, 6]", "count = [2, 2, 1]");
    let scene = scene(&text);
    let alone = everywhere(&scene, 3000, &[]);
    assert!(alone.number("dissipated") > 0.0, "they meet");
}

/// Two sizes, 1:20, that fall together.
const UNEQUAL: &str = r#"
gravity = [0.5, 0.2, -9.81]
[domain]
low = [0.0, 0.0, 0.0]
high = [0.05, 0.05, 0.08]
walls = ["-x", "+x", "-y", "+y", "-z"]
[[material]]
name = "stone"
density = 2500.0
normal_stiffness = 1e3
FRICTION
[[shape]]
name = "boulder"
kind = "sphere"
radius = 0.01
[[shape]]
name = "sand"
kind = "KIND
[[fill.lattice]]
shapes = ["boulder"]
first = [0.0125, 0.0125, 0.018]
spacing = 0.025
count = [2, 2, 2]
velocity = [0.0, 0.0, -0.5]
[[fill.lattice]]
shapes = ["sand"]
first = [0.003, 0.003, 0.0012]
spacing = 0.00125
count = [36, 36, 2]
[[fill.lattice]]
shapes = ["sand"]
first = [0.003, 0.003, 0.056]
spacing = 0.00125
count = [36, 36, 2]
velocity = [0.0, 0.0, -4.0]
[time]
step = 1e-6
allow_unstable = true
[neighbours]
skin = 0.0003
imbalance = 1.05
"#;

const BALL: &str = "sphere\"\nradius = 0.0005";
const EGG: &str = "ellipsoid\"\nsemi_axes = [0.0006, 0.0005, 0.0004]";

fn unequal(friction: &str, sand: &str) -> Scene {
    scene(&UNEQUAL.replace("FRICTION", friction).replace("KIND", sand))
}

#[test]
fn sizes_of_one_to_twenty_are_the_same_on_any_number_of_ranks() {
    let scene = unequal("friction = 0.3\nrestitution = 0.5", BALL);
    let alone = everywhere(&scene, 1500, &[]);
    assert!(alone.number("dissipated") > 0.0, "they meet");
}

/// The halo carries only the data that the scene needs, and only where there is a pair. The plan
/// predicts its size.
#[test]
fn the_halo_is_as_small_as_the_plan_says() {
    for (friction, sand, bytes) in [
        ("", BALL, 24),
        ("restitution = 0.5", BALL, 48),
        ("friction = 0.3", BALL, 72),
        ("", EGG, 56),
        ("friction = 0.3", EGG, 104),
    ] {
        let scene = unequal(friction, sand);
        let told = format!("{bytes} bytes in the message of each step");
        assert!(plan::plan(&scene, 4).contains(&told), "{told}");
        let traffic = threads::run(4, |comm| {
            let mut sim = begun(&scene, comm);
            for _ in 0..200 {
                sim.step(comm).unwrap();
            }
            let ghosts = sim.particles.owned..sim.particles.first_facet();
            for ghost in ghosts {
                let in_pair =
                    |p: &dem_mpi::contact::Pair| p.a.index() == ghost || p.b.index() == ghost;
                assert!(sim.pairs.pairs.iter().any(in_pair), "a ghost without a partner");
            }
            sim.domain.traffic
        });
        let sent: u64 = traffic.iter().map(|t| t.bytes).sum();
        let received: u64 = traffic.iter().map(|t| t.ghosts).sum();
        let within: u64 = traffic.iter().map(|t| t.offered).sum();
        assert_eq!(sent, bytes * received, "{friction} {sand}");
        assert!(received > 0 && 2 * received < within, "{received} of {within}");
    }
}
