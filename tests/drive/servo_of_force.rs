//! Walls that keep a force: tilted planes, triangles, coupled sides, and features common with walls that keep a stress.

use crate::support::{
    Bench, MATERIAL, OnRanks, ball, begun, close, expect_refused, of_servos, save, scene, schedule,
};
use dem_mpi::comm::alone::Alone;
use dem_mpi::contact::StateColumn;
use dem_mpi::drive::servo;
use dem_mpi::math::Vec3;
use dem_mpi::output::report::{Origin, Report};
use dem_mpi::output::snapshot::Reader;
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::assemble::{self, Continuation};
use dem_mpi::scene::doubts::doubts;
use dem_mpi::scene::plan::plan;
use dem_mpi::sim::report::report;
use dem_mpi::sim::{StepError, run};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

const RADIUS: f64 = 0.005;
const STIFFNESS: f64 = 1.5e5;
/// Index of the last wall; five others are sides of the box.
const LAST: usize = 5;

/// Writes a square of two triangles in the plane z = 0, with the given half edge [m]. Its diagonal runs from the low to the high corner.
fn square(folder: &Path, half: f64) -> PathBuf {
    let file = folder.join("square.obj");
    let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
    let corner = |[x, y]: [f64; 2]| format!("v {x} {y} 0\n");
    let text = corners.map(corner).concat() + "f 1 2 3\nf 1 3 4\n";
    std::fs::write(&file, text).unwrap();
    file
}

/// Scene of a box of 0.5 m by 0.5 m, open above, with one more wall, its servo and a damped ball [kg].
fn in_box(mass: f64, friction: f64, damping: f64, wall: &str, servo: &str) -> String {
    let density = mass / (4.0 / 3.0 * PI * RADIUS.powi(3));
    format!(
        r#"
global_damping = {damping:?}
[domain]
low = [-0.25, -0.25, 0]
high = [0.25, 0.25, 0.05]
walls = ["-x", "+x", "-y", "+y", "-z"]
[[wall]]
name = "lid"
{wall}
[[servo]]
{servo}
[[material]]
name = "m"
density = {density:?}
normal_stiffness = {STIFFNESS:?}
friction = {friction:?}
[[shape]]
name = "grain"
kind = "sphere"
radius = {RADIUS:?}
[[fill.lattice]]
first = [0, 0, {RADIUS:?}]
count = [1, 1, 1]
[time]
step = 1e-5
steps = 1500
allow_unstable = true
[output]
directory = "out"
history_every = 50
"#
    )
}

/// A light and damped ball on the floor, away from the diagonal of a square.
fn on_floor() -> Particle {
    ball(0, 0, Vec3::new(0.003, -0.006, RADIUS), Vec3::zeros())
}

const PLANE: &str = "point = [0, 0, 0.01]\nnormal = [0, 0, -1]";
const LID: &str = "walls = [\"lid\"]\n";

/// Force on the last wall [N].
fn on_last(bench: &mut Bench) -> Vec3 {
    bench.measure().wall_forces[LAST]
}

/// Two springs in series under the force. Over the area of 0.25 m² it is a stress of 400 Pa, and a plane under this stress gives identical
/// bits.
#[test]
fn a_lid_of_triangles_presses_as_a_plane_under_stress() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = format!("mesh = {:?}\nshift = [0, 0, 0.01]", square(folder.path(), 0.02));
    let under = |wall: &str, servo: &str| {
        let text = in_box(6e-5, 0.0, 6e4, wall, &(LID.to_owned() + servo));
        Bench::new(&text, &[on_floor()])
    };
    let mut stressed = under(PLANE, "stress = 400");
    let mut pushed = under(PLANE, "force = 100");
    let mut triangles = under(&mesh, "force = 100\nalong = [0, 0, -3]");
    let place = |bench: &Bench| bench.sim.particles.walls[LAST].point.z;
    let mut most = 0.0_f64;
    for step in 0..1500 {
        for bench in [&mut stressed, &mut pushed, &mut triangles] {
            bench.step();
        }
        let [expected, same, near] = [&mut stressed, &mut pushed, &mut triangles]
            .map(|bench| (on_last(bench).z, place(bench)));
        assert_eq!(expected, same, "step {step}");
        assert!((near.0 - expected.0).abs() < 1e-9 * 100.0, "step {step}: {near:?} {expected:?}");
        assert!((near.1 - expected.1).abs() < 1e-9 * RADIUS, "step {step}: {near:?} {expected:?}");
        most = most.max(near.0);
    }
    assert!(most > 1.0);
    let (force, height) = (on_last(&mut triangles), place(&triangles));
    close(force.z, 100.0, 1e-9, "force");
    close(2.0 * RADIUS - height, 2.0 * 100.0 / STIFFNESS, 1e-9, "way");
}

/// A tilted plane presses a ball into a corner: along its normal by default, or along another direction. Without friction its force is along
/// its normal, and floor and side carry the rest.
#[test]
fn a_tilted_plane_presses_a_ball_into_a_corner() {
    let normal = Vec3::new(-0.6, 0.0, -0.8);
    let centre = Vec3::new(-0.25 + RADIUS, 0.0, RADIUS);
    let touches = centre - normal * (1.001 * RADIUS);
    let wall = format!(
        "point = [{:?}, 0, {:?}]\nnormal = [-3, 0, -4]\nvelocity = [0, 0.5, 0]",
        touches.x, touches.z
    );
    for (along, direction) in [("", normal), ("\nalong = [0, 0, -2]", -Vec3::z())] {
        let servo = format!("{LID}force = 20{along}\nmax_speed = 0.5");
        let text = in_box(6e-5, 0.0, 6e4, &wall, &servo);
        let mut bench = Bench::new(&text, &[ball(0, 0, centre, Vec3::zeros())]);
        (0..1500).for_each(|_| bench.step());
        let forces = bench.measure().wall_forces;
        close(-forces[LAST].dot(&direction), 20.0, 1e-9, along);
        let press = 20.0 / normal.dot(&direction);
        for (found, expected) in [
            (forces[LAST], -normal * press),
            (forces[0], Vec3::x() * (press * normal.x)),
            (forces[4], Vec3::z() * (press * normal.z)),
        ] {
            assert!((found - expected).norm() < 1e-8, "{along}: {found} {expected}");
        }
        // The wall has moved along its direction, and sideways with the velocity of the scene.
        let lid = &bench.sim.particles.walls[LAST];
        assert_eq!(lid.velocity.y, 0.5);
        let way = lid.point - touches;
        assert!((way.y - 0.5 * 1500.0 * 1e-5).abs() < 1e-12, "{way}");
        let across = way - Vec3::y() * way.y - direction * way.dot(&direction);
        assert!(across.norm() < 1e-12 && way.dot(&direction) > 1e-5, "{along}: {way}");
    }
}

/// Against a ball too heavy to move, the deviation falls with the double root 1 - P/2, P = 0.7. The law uses the stiffness along the
/// direction. A sticking contact with equal normal and tangential stiffness has it in any direction.
#[test]
fn an_oblique_wall_has_the_stiffness_along_its_way() {
    let along = Vec3::new(-1.0, 0.0, 0.0);
    let normal = Vec3::new(-0.6, 0.0, -0.8);
    let centre = Vec3::new(0.0, 0.0, 2.0 * RADIUS);
    let at = centre - normal * (RADIUS - 1e-9);
    let wall = format!("point = [{:?}, 0, {:?}]\nnormal = [-3, 0, -4]", at.x, at.z);
    let servo = format!("{LID}force = 10\nalong = [-1, 0, 0]\nmax_speed = 40");
    for friction in [0.0, 10.0] {
        let text = in_box(1e12, friction, 0.0, &wall, &servo);
        let mut bench = Bench::new(&text, &[ball(0, 0, centre, Vec3::zeros())]);
        let missing = |bench: &mut Bench| 1.0 + on_last(bench).dot(&along) / 10.0;
        let first = missing(&mut bench);
        assert!((first - 1.0).abs() < 1e-4 && first < 1.0, "{first}");
        for n in 1..40 {
            bench.step();
            let root = 0.65_f64;
            let expected = root.powi(n) * (1.0 - 0.35 / root * f64::from(n));
            let found = missing(&mut bench) / first;
            assert!((found - expected).abs() < 1e-9, "{friction}, {n}: {found:e} {expected:e}");
        }
    }
}

/// Coupled sides move by the same distance, and have the force on average.
#[test]
fn coupled_sides_close_on_the_middle() {
    let servo = "walls = [\"-x\", \"+x\"]\nforce = 10\ncoupled = true\nmax_speed = 0.5";
    let text = in_box(6e-5, 0.0, 6e4, PLANE, servo)
        .replace("low = [-0.25,", "low = [-0.0051,")
        .replace("high = [0.25,", "high = [0.0051,")
        .replace("[0, 0, 0.01]", "[0, 0, 0.04]");
    let start = ball(0, 0, Vec3::new(0.0, 0.0, 0.02), Vec3::zeros());
    let mut bench = Bench::new(&text, &[start]);
    (0..1500).for_each(|_| bench.step());
    let forces = bench.measure().wall_forces;
    close(-forces[0].x, 10.0, 1e-9, "-x");
    close(forces[1].x, 10.0, 1e-9, "+x");
    let [low, high] = [0, 1].map(|k| bench.sim.particles.walls[k].point.x);
    assert_eq!(low, -high);
    close(RADIUS - high, 10.0 / STIFFNESS, 1e-9, "way");
}

/// Runs the scene and returns its report and the states of its drives.
fn ran(text: &str) -> (Report, Vec<dem_mpi::drive::SavedState>) {
    let scene = scene(text);
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    assemble::fill(&mut sim, &scene, &comm);
    let folder = tempfile::tempdir().unwrap();
    let schedule = schedule(&scene, scene.steps, folder.path());
    let finish = run::run(&mut sim, &schedule, &mut comm, &mut |_| {}).unwrap();
    let drives = Reader::open(folder.path()).unwrap().header().drives.clone();
    (report(&sim, &finish, &Origin::default(), &mut comm), drives)
}

/// The report of a force has the same entries as for a stress, but it is not listed among the stress targets.
#[test]
fn how_a_force_was_kept_is_told() {
    for (speed, is_off) in [("0.5", false), ("1e-9", true)] {
        let servo = format!("{LID}force = 100\nmax_speed = {speed}");
        let text = in_box(6e-5, 0.0, 6e4, PLANE, &servo);
        let (report, drives) = ran(&text);
        let [target] = &report.targets[..] else { panic!("{:?}", report.targets) };
        assert_eq!((target.unit, target.target, &*target.of), ("N", 100.0, "lid"));
        assert_eq!(target.mean_error > 0.02, is_off, "{target:?}");
        let said = report.warnings.join("\n");
        assert_eq!(
            said.contains("wall lid has not reached its force: 100.0 % off"),
            is_off,
            "{said}"
        );
        assert_eq!(servo::targets(&drives), []);
        let page = plan(&scene(&text), 1);
        assert!(page.contains("lid: 1e2 N along the normal, at most"), "{page}");
    }
}

/// Forces without support: each ends the run with its name.
#[test]
fn a_force_out_of_reach_ends_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = format!("mesh = {:?}\nshift = [0, 0, 0.01]", square(folder.path(), 0.02));
    for (wall, along, said) in [
        (PLANE, "", "from the opposite side"),
        ("point = [0, 0, 0.04]\nnormal = [3, 0, -4]", "", "from the opposite side"),
        (&*mesh, "along = [0, 0, -1]", "is out of the domain by more than its width"),
    ] {
        let servo = format!("{LID}force = 100\nmax_speed = 20\n{along}");
        let mut bench = Bench::new(&in_box(6e-5, 0.0, 6e4, wall, &servo), &[]);
        let error = loop {
            if let Err(error) = bench.try_step() {
                break error;
            }
            assert!(bench.sim.step < 10_000, "{wall}: it goes on");
        };
        assert!(error.is_agreed() && matches!(error, StepError::Drive { .. }), "{error}");
        let text = error.to_string();
        let all = ["servo: wall \"lid\"", said, "its force is 0e0 N of 1e2 N"];
        assert!(all.iter().all(|part| text.contains(part)), "{text}");
    }
}

/// Particles with friction and dashpots under a square of triangles and a slope, between coupled sides: identical bits everywhere.
#[test]
fn forces_are_kept_with_the_same_bits_everywhere() {
    let files = tempfile::tempdir().unwrap();
    let mesh = square(files.path(), 0.04);
    let text = format!(
        r#"
gravity = [0, 0, -9.81]
[domain]
low = [0, 0, 0]
high = [0.06, 0.06, 0.06]
walls = ["-x", "+x", "-y", "+y", "-z"]
[[wall]]
name = "lid"
mesh = {mesh:?}
shift = [0.03, 0.03, 0.036]
velocity = [0.02, 0, 0]
[[wall]]
name = "slope"
point = [0.054, 0, 0.032]
normal = [-3, 0, -4]
[[servo]]
walls = ["lid"]
force = 200
along = [0, 0.1, -1]
max_speed = 0.5
[[servo]]
walls = ["slope"]
force = 20
max_speed = 0.5
[[servo]]
walls = ["-y", "+y"]
force = 30
coupled = true
max_speed = 0.2
{MATERIAL}
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.005
[[fill.lattice]]
first = [0.006, 0.006, 0.006]
spacing = 0.0105
count = [5, 5, 3]
jitter = 0.0002
[time]
step = 1e-5
steps = 1
[output]
directory = "out"
"#
    );
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(&text);
    let state = OnRanks::of(&scene).the_same_everywhere(4000, folder.path());
    let saved = of_servos(&state.drives);
    let speeds = saved.reals(&StateColumn::new("speed", 1, "m/s")).unwrap();
    assert!(speeds.len() == 4 && speeds.iter().all(|&speed| speed != 0.0), "{speeds:?}");
    // Some wall presses half-way, where the run stopped.
    let reader = Reader::open(folder.path()).unwrap();
    let saved = of_servos(&reader.header().drives).clone();
    let pressing = saved.integers(&StateColumn::new("pressing", 67, "2^(32 k - 1074) N")).unwrap();
    assert_eq!(pressing.len(), 4 * 67);
    assert!(pressing.iter().any(|&limb| limb != 0));
}

/// A plane that a stage left rotated presses along its normal, or along `along` if that still points to the particles.
#[test]
fn a_turned_plane_goes_on_with_a_force() {
    let text = |more: &str| {
        format!(
            "[domain]\nlow = [0, 0, 0]\nhigh = [0.2, 0.2, 0.2]\nperiodic = [false, true, false]\nwalls = [\"-x\", \"-z\", \"+z\"]\n\
             [[wall]]\nname = \"side\"\npoint = [0.2, 0, 0]\nnormal = [-1, 0, 0]\n[[material]]\nname = \"glass\"\ndensity = 2500\n\
             normal_stiffness = 1e6\n[[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.01\n[[fill.lattice]]\n\
             first = [0.1, 0.1, 0.1]\ncount = [1, 1, 1]\n{more}\n[time]\nstep = 1e-5\nsteps = 1\n[output]\ndirectory = \"out\"\n"
        )
    };
    // A rotation of 100 degrees, away from the ball.
    let turn = "[[motion]]\nwalls = [\"side\"]\nabout = [0.2, 0, 0]\naxis = [0, 1, 0]\namplitude = 100\nfrequency = 25\n";
    let first = scene(&text(turn));
    let mut comm = Alone::default();
    let mut sim = begun(&first, &mut comm);
    (0..1000).for_each(|_| sim.step(&mut comm).unwrap());
    let normal = sim.particles.walls[3].surface().1;
    let angle = 100_f64.to_radians();
    assert!((normal - Vec3::new(-angle.cos(), 0.0, angle.sin())).norm() < 1e-9, "{normal}");
    let folder = tempfile::tempdir().unwrap();
    save(&sim, folder.path(), &first, &mut comm);
    let taken = |servo: &str| {
        let next = scene(&text(&format!("[[servo]]\nwalls = [\"side\"]\n{servo}\n")));
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(&next, &comm);
        let from = folder.path();
        assemble::take_up(&mut sim, &next, from, Continuation::NewStage, &mut comm)
            .map_err(|error| error.to_string())?;
        sim.begin(&mut comm).unwrap();
        sim.step(&mut comm).unwrap();
        Ok::<_, String>(sim.particles.walls[3].velocity)
    };
    let along_normal = taken("force = 1\nmax_speed = 0.5").unwrap();
    assert!((along_normal - normal * 0.5).norm() < 1e-15, "{along_normal}");
    let aslant = taken("force = 1\nmax_speed = 0.5\nalong = [-7, 0, 7]").unwrap();
    assert!((aslant - Vec3::new(-1.0, 0.0, 1.0).normalize() * 0.5).norm() < 1e-15, "{aslant}");
    // Along z the plane would move along itself.
    expect_refused(
        &text("[[servo]]\nwalls = [\"side\"]\nforce = 1\nalong = [-1, 0, 1]\n"),
        "along = [-1, 0, 1]",
        "along = [0, 0, 1]",
        "`along` is in the plane of this wall",
    );
    let astray = taken("force = 1\nalong = [-1, 0, 0]").unwrap_err();
    assert!(astray.contains("wall \"side\" is turned: `along`"), "{astray}");
    let tilted = taken("stress = 1").unwrap_err();
    assert!(tilted.contains("wall \"side\", or an adjacent one, is tilted"), "{tilted}");
}

/// A surface may be slow enough in its rotation alone, but too fast together with its servo.
#[test]
fn a_turn_and_a_servo_count_together() {
    let folder = tempfile::tempdir().unwrap();
    // With a reach of 0.05 m and 600 rad/s the corners move at 30 m/s, and 50 m/s are allowed.
    let half = 0.05 / 2_f64.sqrt();
    let wall = format!(
        "mesh = {:?}\nshift = [0, 0, 0.01]\nrotation = {{ about = [0, 0, 0.01], axis = [0, 0, 1], rate = 600 }}",
        square(folder.path(), half)
    );
    let servo = format!("{LID}force = 1\nalong = [0, 0, -1]\nmax_speed = 19");
    let text = in_box(6e-5, 0.0, 6e4, &wall, &servo);
    scene(&text);
    expect_refused(
        &text,
        "max_speed = 19",
        "max_speed = 21",
        "with the other motion moves wall \"lid\"",
    );
    expect_refused(
        &text,
        "max_speed = 19",
        "max_speed = 51",
        "`max_speed` (51.0 m/s) moves a wall",
    );
}

/// The step of Hertzian contacts, and the warning about large overlaps, use the force over the smallest side of the domain.
#[test]
fn a_force_counts_over_the_smallest_side() {
    // The smallest side is 0.5 m by 0.05 m.
    let text = in_box(6e-5, 0.0, 0.0, PLANE, &format!("{LID}TARGET"));
    let said = |target: &str| doubts(&scene(&text.replace("TARGET", target))).join("\n");
    // Overlap over the diameter of 0.01 m: p d / k.
    let flat = STIFFNESS / 0.01;
    let force = 0.2 * flat * 0.025;
    let doubt = said(&format!("force = {force:?}"));
    assert!(
        doubt.contains("on the smallest side of the domain a stress of 3e6 Pa causes"),
        "{doubt}"
    );
    let doubt = said(&format!("force = {:?}", 0.01 * force));
    assert!(!doubt.contains("causes overlaps"), "{doubt}");

    let hertz = text
        .replace(
            &format!("normal_stiffness = {STIFFNESS:?}"),
            "youngs_modulus = 1e7\npoisson_ratio = 0.3",
        )
        .replace("[time]", "[law]\nnormal = \"hertz\"\n[time]");
    let up_to = |target: &str| {
        let scene = scene(&hertz.replace("TARGET", target));
        scene.force_law().about().hardest_up_to().expect("it stiffens")
    };
    let (force, stress) = (up_to("force = 250"), up_to("stress = 1e4"));
    close(force, stress, 1e-12, "largest overlap");
    assert!(stress > 0.011, "{stress}");
}
