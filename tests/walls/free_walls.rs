//! Walls with a mass that forces move: an impact, an oscillation, a lid at rest, identical bits.

use crate::support::{
    Bench, MATERIAL, OnRanks, ball, close, expect_refused, save, scene, schedule,
};
use dem_mpi::cell::Cell;
use dem_mpi::comm::alone::Alone;
use dem_mpi::drive::free::FreeWall;
use dem_mpi::math::Vec3;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::scene::assemble::{self, Continuation};
use dem_mpi::scene::plan::plan;
use dem_mpi::sim::run::{Ending, run};
use dem_mpi::walls::Wall;

const RADIUS: f64 = 0.01;
const STIFFNESS: f64 = 1e5;

/// Scene of a ball, optionally on a floor, and a lid above.
fn below_a_lid(
    mass: f64,
    restitution: f64,
    gravity: f64,
    floor: bool,
    lid: &str,
    dt: f64,
) -> String {
    let floor = if floor {
        "[[wall]]\nname = \"floor\"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n"
    } else {
        ""
    };
    format!(
        r#"
gravity = [0, 0, {gravity:?}]
[domain]
low = [-0.2, -0.2, -0.2]
high = [0.2, 0.2, 0.2]
{floor}[[wall]]
name = "lid"
normal = [0, 0, -1]
{lid}
[[motion]]
walls = ["lid"]
along = [0, 0, 2]
mass = {mass:?}
[law]
limit_damping = false
[[material]]
name = "m"
density = 2500
normal_stiffness = {STIFFNESS:?}
restitution = {restitution:?}
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS:?}
[[fill.lattice]]
first = [0, 0, {RADIUS:?}]
count = [1, 1, 1]
[time]
step = {dt:?}
steps = 1
[output]
directory = "out"
"#
    )
}

/// A lid strikes a floating ball: both separate like two bodies.
#[test]
fn a_lid_strikes_a_ball_as_a_body_of_its_mass() {
    let (mass, speed) = (0.03, 0.5);
    for restitution in [1.0, 0.4] {
        let lid = "point = [0, 0, 0.02001]\nvelocity = [0, 0, -0.5]";
        let scene = scene(&below_a_lid(mass, restitution, 0.0, false, lid, 2e-7));
        let own = scene.library.mass[0];
        let mut bench =
            Bench::of(&scene, &[ball(0, 0, Vec3::new(0.0, 0.0, RADIUS), Vec3::zeros())]);
        (0..10_000).for_each(|_| bench.step());
        let given = own * bench.sim.particles.velocity[0].z;
        close(given, -(1.0 + restitution) * speed / (1.0 / mass + 1.0 / own), 1e-5, "momentum");
        let after = bench.sim.particles.walls[0].velocity;
        close(after.z, -speed - given / mass, 1e-12, "velocity of the lid");
        assert!((after - Vec3::z() * after.z).norm() == 0.0);
    }
}

/// A lid guided along a slanted direction has a larger effective mass along its normal. The impact has the requested `restitution` at any
/// angle.
#[test]
fn a_lid_that_slides_bounces_as_its_angle_says() {
    let mass = 0.005;
    for restitution in [0.5, 0.2] {
        for along in ["[1, 0, 0]", "[3, 0, 1]", "[1, 0, 1]"] {
            let lid = "point = [0, 0, 0.02001]\nvelocity = [0, 0, -0.5]";
            let text = below_a_lid(mass, restitution, 0.0, false, lid, 2e-7);
            let scene = scene(&text.replace("along = [0, 0, 2]", &format!("along = {along}")));
            let start = ball(0, 0, Vec3::new(0.0, 0.0, RADIUS), Vec3::zeros());
            let mut bench = Bench::of(&scene, &[start]);
            (0..10_000).for_each(|_| bench.step());
            let [ball, lid] =
                [bench.sim.particles.velocity[0].z, bench.sim.particles.walls[0].velocity.z];
            assert!(ball < -0.5 * restitution, "{along}: {ball}");
            close((lid - ball) / 0.5, restitution, 1e-3, along);
        }
    }
}

/// A wall that moves at the end of a stage keeps its velocity component along the next stage's direction. A velocity in that stage
/// replaces it.
#[test]
fn a_free_wall_goes_on_in_another_stage() {
    let text = |along: &str, velocity: &str| {
        below_a_lid(0.03, 1.0, 0.0, false, &format!("point = [0, 0, 0.1]\n{velocity}"), 1e-5)
            .replace("along = [0, 0, 2]", &format!("along = {along}"))
    };
    let first = scene(&text("[2, 0, 0]", "velocity = [0.3, 0.1, 0]"));
    let mut bench = Bench::of(&first, &[ball(0, 0, Vec3::zeros(), Vec3::zeros())]);
    // A snapshot before the first step has no contacts.
    let (begin, mut alone) = (tempfile::tempdir().unwrap(), Alone::default());
    save(&bench.sim, begin.path(), &first, &mut alone);
    let reader = Reader::open(&begin.path().join("last.vtkhdf")).unwrap();
    assert_eq!(reader.contact_count().unwrap(), 0);
    (0..100).for_each(|_| bench.step());
    let folder = tempfile::tempdir().unwrap();
    let mut comm = Alone::default();
    save(&bench.sim, folder.path(), &first, &mut comm);
    for (along, velocity, expected) in [
        ("[1, 0, 0]", "", Vec3::new(0.3, 0.0, 0.0)),
        ("[-1, 0, 0]", "", Vec3::new(0.3, 0.0, 0.0)),
        ("[0, 0, 1]", "", Vec3::zeros()),
        ("[1, 0, 1]", "", Vec3::new(0.15, 0.0, 0.15)),
        ("[1, 0, 0]", "velocity = [-0.2, 0, 0]", Vec3::new(-0.2, 0.0, 0.0)),
        ("[1, 0, 0]", "velocity = [0, 0.2, 0]", Vec3::new(0.3, 0.2, 0.0)),
    ] {
        let next = scene(&text(along, velocity));
        let mut sim = assemble::assemble(&next, &comm);
        let new = Continuation::NewStage;
        assemble::take_up(&mut sim, &next, folder.path(), new, &mut comm).unwrap();
        sim.begin(&mut comm).unwrap();
        // The velocity is also right before the first step, when the first forces are computed.
        let off = (sim.particles.walls[0].velocity - expected).norm();
        assert!(off < 1e-12, "{along} {velocity}: {:?}", sim.particles.walls[0].velocity);
        sim.step(&mut comm).unwrap();
        let off = (sim.particles.walls[0].velocity - expected).norm();
        assert!(off < 1e-12, "{along} {velocity}: {:?}", sim.particles.walls[0].velocity);
    }
}

/// A lid oscillates on a ball on a floor: the slow mode of two masses and two springs, of second order in the step.
#[test]
fn a_lid_swings_on_a_ball() {
    let mass = 0.03;
    let off = |dt: f64| {
        // The load keeps the springs in compression.
        let (low, load) = (RADIUS, 40.0);
        let lid = "point = [0, 0, 0.0196]\n";
        let text = below_a_lid(mass, 1.0, 0.0, true, lid, dt)
            .replace("mass = 0.03", &format!("mass = 0.03\nforce = {:?}", -load));
        let scene = scene(&text);
        let own = scene.library.mass[0];
        // Eigenvalues of x'' = -[[2, -1], [-1, 1]] k x over the masses of ball and lid.
        let (a, b, c) = (2.0 * STIFFNESS / own, STIFFNESS / own, STIFFNESS / mass);
        let square = 0.5 * (a + c) - (0.25 * (a - c) * (a - c) + b * c).sqrt();
        let ratio = b / (a - square);
        let rest = [low - load / STIFFNESS, 2.0 * low - 2.0 * load / STIFFNESS];
        let swing = 0.0196 - rest[1];
        let place = Vec3::new(0.0, 0.0, rest[0] + ratio * swing);
        let mut bench = Bench::of(&scene, &[ball(0, 0, place, Vec3::zeros())]);
        let (mut worst, before) = (0.0_f64, bench.measure());
        for step in 1..=(0.01 / dt).round() as u64 {
            bench.step();
            let now = bench.sim.particles.walls[1].point.z - rest[1];
            worst = worst.max((now / swing - (square.sqrt() * dt * step as f64).cos()).abs());
        }
        let after = bench.measure();
        let (given, missing) =
            (after.received - before.received, after.missing() - before.missing());
        let most = 0.5 * STIFFNESS * swing * swing;
        assert!(
            missing.abs() < 1e-9 * most && given.abs() > 1e-3 * most,
            "{missing:e} {given:e} of {most:e}"
        );
        worst
    };
    let all = [4e-6, 2e-6, 1e-6].map(off);
    println!("off by {all:?} of the swing");
    assert!(all[2] < 1e-3, "{all:?}");
    for pair in all.windows(2) {
        assert!((pair[0] / pair[1] - 4.0).abs() < 0.1, "{all:?}");
    }
}

/// A lid comes to rest on a ball: the floor carries both.
#[test]
fn a_lid_comes_to_rest_with_its_weight() {
    let mass = 0.05;
    let lid = "point = [0, 0, 0.021]\n";
    let scene = scene(&below_a_lid(mass, 0.2, -9.81, true, lid, 2e-6));
    let own = scene.library.mass[0];
    let start = [ball(0, 0, Vec3::new(0.0, 0.0, RADIUS), Vec3::zeros())];
    let mut bench = Bench::of(&scene, &start);
    (0..100_000).for_each(|_| bench.step());
    let m = bench.measure();
    close(m.wall_forces[1].z, mass * 9.81, 1e-6, "on the lid");
    close(-m.wall_forces[0].z, (mass + own) * 9.81, 1e-6, "on the floor");
    assert!(bench.sim.particles.walls[1].velocity.norm() < 1e-9);
}

/// A ball at rest does not end its stage before the lid above it has landed, 10 mm lower, after 45 ms. Without the lid's mass it does.
#[test]
fn a_stage_goes_on_until_the_lid_has_landed() {
    let (mass, dt) = (0.05, 5e-6);
    let stop = "steps = 40000\n[stop]\nunbalanced = 0.01\n";
    let falls = below_a_lid(mass, 0.2, -9.81, true, "point = [0, 0, 0.03]\n", dt)
        .replace("steps = 1\n", stop);
    let hangs =
        falls.replace("[[motion]]\nwalls = [\"lid\"]\nalong = [0, 0, 2]\nmass = 0.05\n", "");
    assert!(hangs.len() < falls.len() && falls.contains(stop));
    let ended = |text: &str| {
        let (scene, mut comm) = (scene(text), Alone::default());
        let mut sim = assemble::assemble(&scene, &comm);
        assemble::fill(&mut sim, &scene, &comm);
        let folder = tempfile::tempdir().unwrap();
        run(&mut sim, &schedule(&scene, scene.steps, folder.path()), &mut comm, &mut |_| ())
            .unwrap()
    };
    let without = ended(&hangs);
    assert_eq!(without.ending, Ending::Rest, "{}", without.unmet);
    let falling = ((2.0 * 0.01 / 9.81_f64).sqrt() / dt) as u64;
    assert!(2 * without.steps_done < falling, "{} of {falling}", without.steps_done);
    let with = ended(&falls);
    assert_eq!(with.ending, Ending::Rest, "{}", with.unmet);
    assert!(with.steps_done > falling, "{} of {falling}", with.steps_done);
    assert!(with.measures.wall_forces[1].z > 0.0, "{:?}", with.measures);
    // A stage that is too short reports the unmet condition.
    let short = ended(&falls.replace("steps = 40000", "steps = 5000"));
    assert_eq!(short.ending, Ending::LastStep);
    assert_eq!(short.unmet, "wall \"lid\" moves freely, and no particle touches it");
    let motion = "[[motion]]\nwalls = [\"lid\"]\nalong = [0, 0, 2]\nmass = 0.05\n";
    let with_servo = falls
        .replace(motion, "[[servo]]\nwalls = [\"lid\"]\nforce = 1.0\n")
        .replace("steps = 40000", "steps = 200");
    let short = ended(&with_servo);
    assert!(
        short.unmet.contains("wall lid has a servo, and no particle touches it"),
        "{}",
        short.unmet
    );
}

/// A crowd under a moving lid with its weight and a force.
fn crowd() -> String {
    format!(
        r#"
seed = 2
gravity = [0.3, 0.2, -9.81]
[domain]
low = [0, 0, 0]
high = [0.02, 0.02, 0.04]
walls = ["-x", "+x", "-y", "+y", "-z"]
[[wall]]
name = "lid"
point = [0, 0, 0.021]
normal = [0, 0, -1]
velocity = [0.01, 0, -0.8]
[[motion]]
walls = ["lid"]
along = [0, 0, 1]
mass = 0.5
force = -20
{MATERIAL}
[[shape]]
name = "long"
kind = "ellipsoid"
diameter = 0.002
aspect_ratio = 2
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.001
[[fill.lattice]]
shapes = {{ long = 1, ball = 1 }}
low = [0, 0, 0]
high = [0.02, 0.02, 0.0205]
[time]
step = 2e-6
steps = 1
[output]
directory = "out"
"#
    )
}

/// A lid that particles carry from the start continues from the first snapshot, too.
#[test]
fn a_lid_that_is_borne_at_the_start_has_the_same_bits_everywhere() {
    let text = below_a_lid(0.05, 0.5, -9.81, true, "point = [0, 0, 0.0196]\n", 2e-6);
    for along in ["[0, 0, 2]", "[1, 2, 3]"] {
        let text = text.replace("along = [0, 0, 2]", &format!("along = {along}"));
        let folder = tempfile::tempdir().unwrap();
        let state = OnRanks::of(&scene(&text)).the_same_everywhere(400, folder.path());
        assert!(state.numbers("place of lid")[2] > 0.0196 && state.number("wall_contacts") > 0.0);
    }
}

#[test]
fn a_crowd_under_a_lid_has_the_same_bits_everywhere() {
    let scene = scene(&crowd());
    let folder = tempfile::tempdir().unwrap();
    let state = OnRanks::of(&scene).the_same_everywhere(6000, folder.path());
    let [contacts, received, dissipated, missing] =
        ["contacts", "received", "dissipated", "missing"].map(|name| state.number(name));
    let place = state.numbers("place of lid");
    println!(
        "{contacts} contacts, lid at {place:?}; received {received:e}, dissipated {dissipated:e}, missing {missing:e} J"
    );
    assert!(contacts > 20.0 && received > 0.0 && place[2] < 0.0205, "{contacts} {place:?}");
    assert!((place[0] - 0.01 * 6000.0 * 2e-6).abs() < 1e-15, "it slides as the scene says");
    assert!(missing.abs() < 1e-3 * dissipated, "{missing:e} of {dissipated:e} J");
    assert!(plan(&scene, 1).contains("motion          lid: freely, 0.5 kg"));
}

#[test]
fn what_cannot_be_free_is_refused() {
    let good = crowd();
    for (from, to, said) in [
        ("mass = 0.5", "mass = 0", "a number greater than 0"),
        ("walls = [\"lid\"]", "walls = [\"lid\", \"lid\"]", "occurs twice"),
        (
            "mass = 0.5\nforce = -20",
            "amplitude = 1\nfrequency = 1\nforce = -20",
            "needs a wall with a `mass`",
        ),
        ("mass = 0.5", "mass = 0.5\nfrequency = 1", "not with `mass`"),
        (
            "along = [0, 0, 1]",
            "about = [0, 0, 0]\naxis = [0, 0, 1]",
            "needs a motion `along` a direction",
        ),
        (
            "force = -20\n",
            "[[motion]]\nwalls = [\"lid\"]\nalong = [1, 0, 0]\namplitude = 1e-6\nfrequency = 10\n",
            "moves freely",
        ),
        (
            "velocity = [0.01, 0, -0.8]",
            "rotation = { about = [0, 0, 0.021], axis = [0, 0, 1], rate = 1 }",
            "has a `rotation`",
        ),
        ("force = -20\n", "[[servo]]\nwalls = [\"lid\"]\nstress = 100\n", "has a `[[motion]]`"),
    ] {
        expect_refused(&good, from, to, said);
    }
}

/// A lid too light for its particles, and one without support.
#[test]
fn a_free_wall_says_what_is_wrong() {
    let step_until_error = |text: &str, steps: u64| {
        let scene = scene(text);
        let mut comm = Alone::default();
        let mut sim = crate::support::begun(&scene, &mut comm);
        let mut warnings = Vec::new();
        for _ in 0..steps {
            let stepped = sim.step(&mut comm);
            warnings.extend(sim.drives.iter_mut().flat_map(|drive| drive.warnings()));
            if let Err(error) = stepped {
                return (warnings, error.to_string());
            }
        }
        (warnings, String::new())
    };
    let (warnings, error) = step_until_error(&crowd().replace("mass = 0.5", "mass = 1e-6"), 4000);
    assert!(error.contains("\"lid\" of 1e-6 kg oscillates"), "{error} {warnings:?}");
    let light = below_a_lid(
        2.5e-7,
        1.0,
        0.0,
        true,
        "point = [0, 0, 0.0201]\nvelocity = [0, 0, -0.2]",
        2e-6,
    );
    let (warnings, error) = step_until_error(&light, 1000);
    assert!(error.is_empty() && warnings.len() == 1, "{error} {warnings:?}");
    assert!(
        warnings[0].contains("by 1.2") && warnings[0].contains("use a step of"),
        "{warnings:?}"
    );
    let empty = crowd()
        .replace("high = [0.02, 0.02, 0.0205]", "high = [0.02, 0.02, 0.004]")
        .replace("[0.01, 0, -0.8]", "[0, 0, 0.0]");
    let pulled = empty.replace("force = -20", "force = 200");
    for text in [pulled.replace("normal = [0, 0, -1]", "normal = [0, 0.6, -0.8]"), pulled] {
        let (_, error) = step_until_error(&text, 30_000);
        assert!(error.contains("\"lid\" moves freely and is far out of the domain"), "{error}");
    }
}

/// A lid presses with its load over its area, an oblique line with the load over the cosine; a lid that is pulled away does not press.
#[test]
fn a_lid_has_the_stress_of_its_load() {
    let cell = Cell::new(Vec3::zeros(), Vec3::new(2.0, 3.0, 1.0), [true, true, false]);
    let planes = [(Vec3::z(), -Vec3::z())];
    let walls = [Wall::of_planes("lid".to_owned(), Vec3::z(), &planes)];
    let stress =
        |along: Vec3, load: f64| FreeWall { wall: 0, along, mass: 1.0, load }.stress(&walls, &cell);
    assert_eq!(stress(-Vec3::z(), 12.0), Some(2.0));
    assert_eq!(stress(Vec3::z(), -12.0), Some(2.0));
    assert_eq!(stress(Vec3::z(), 12.0), None);
    assert_eq!(stress(-Vec3::z(), -12.0), None);
    let oblique = stress(Vec3::new(0.6, 0.0, -0.8), 12.0).expect("it presses");
    close(oblique, 2.5, 1e-15, "oblique");
}
