//! Loads on walls: their work, the losses at them, and the mean force on their triangles.

use crate::sim::symmetries::SHAPES;
use crate::support::{Bench, ball, begun, close, save, scene, schedule};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dem_mpi::comm::alone::Alone;
use dem_mpi::contact::StateColumn;
use dem_mpi::drive::Reporter;
use dem_mpi::drive::ledger::{Worn, worn};
use dem_mpi::math::{Vec3, rotation_about};
use dem_mpi::output::report::Origin;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::particles::records::Particle;
use dem_mpi::post::export;
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble::{self, Continuation};
use dem_mpi::sim::Simulation;
use dem_mpi::sim::report::report;
use dem_mpi::sim::run::{Ending, Schedule, run};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;

const RADIUS: f64 = 0.01;
const STIFFNESS: f64 = 1e6;
const FRICTION: f64 = 0.3;

/// Wall text of a floor from 0 to a length along x, in strips of two triangles from -0.1 to 0.1 along y [m].
fn floor(folder: &Path, length: f64, strips: usize) -> String {
    let corners = (0..=strips).map(|k| {
        let x = length * k as f64 / strips as f64;
        format!("v {x} -0.1 0\nv {x} 0.1 0\n")
    });
    // The order of corners varies.
    let triangles = (0..strips).map(|k| {
        let [a, b, c, d] = [2 * k + 1, 2 * k + 2, 2 * k + 3, 2 * k + 4];
        format!("f {a} {c} {b}\nf {b} {c} {d}\n")
    });
    let text: String = corners.chain(triangles).collect();
    let path = folder.join("floor.obj");
    std::fs::write(&path, text).unwrap();
    format!("mesh = {:?}", path.display().to_string())
}

fn on_floor(wall: &str, domain: &str, own: &str) -> String {
    format!(
        r#"
gravity = [0, 0, -9.81]
[domain]
{domain}
[[wall]]
name = "floor"
{wall}
wear = true
[[material]]
name = "glass"
density = 2500
normal_stiffness = {STIFFNESS:?}
friction = {FRICTION:?}
{own}
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS:?}
[[fill.lattice]]
first = [0.1, 0.1, 0.05]
count = [1, 1, 1]
[time]
step = 2e-6
steps = 100
[output]
directory = "out"
"#
    )
}

const DOMAIN: &str = "low = [-0.1, -0.2, -0.1]\nhigh = [1, 0.2, 0.2]";

/// Height of a ball at rest on the floor.
fn resting(scene: &Scene) -> f64 {
    RADIUS - scene.library.mass[0] * 9.81 / STIFFNESS
}

/// Loads on the triangles of the floor.
fn triangles(bench: &Bench) -> Vec<Worn> {
    let header = bench.sim.header("", &[Vec3::zeros()], &mut Alone::default());
    let worn = worn(&header.drives).unwrap();
    let mut all: Vec<_> = worn.into_iter().collect();
    all.sort_by_key(|((_, triangle), _)| *triangle);
    all.into_iter()
        .map(|((name, _), worn)| {
            assert_eq!(name, "floor");
            worn
        })
        .collect()
}

/// A ball that slides, until just before it rolls: the friction `μ m g` times the slip `v0 - 7/2 μ g t`, strip by strip.
#[test]
fn a_sliding_ball_wears_each_strip_as_the_closed_form_says() {
    let folder = tempfile::tempdir().unwrap();
    let (speed, strips, length) = (1.0, 20, 0.1);
    let text = on_floor(&floor(folder.path(), length, strips), DOMAIN, "");
    let scene = scene(&text);
    let mass = scene.library.mass[0];
    let start = Vec3::new(0.0025, 0.03, resting(&scene));
    let mut bench = Bench::of(&scene, &[ball(0, 0, start, Vec3::x() * speed)]);
    let rolls = 2.0 * speed / (7.0 * FRICTION * 9.81);
    let steps = (0.98 * rolls / scene.dt) as u64;
    (0..steps).for_each(|_| bench.step());
    let acceleration = FRICTION * 9.81;
    // Friction loss until the ball reaches a position.
    let taken = |x: f64| {
        let way = (x - start.x).max(0.0);
        let time =
            (speed - (speed * speed - 2.0 * acceleration * way).max(0.0).sqrt()) / acceleration;
        let time = time.min(rolls);
        mass * acceleration * (speed * time - 1.75 * acceleration * time * time)
    };
    let worn = triangles(&bench);
    assert_eq!(worn.len(), 2 * strips);
    let end = bench.sim.particles.position[0].x;
    assert!(end > 0.08 && end < length, "{end}");
    let all = taken(end);
    let mut worst: f64 = 0.0;
    for (strip, pair) in worn.chunks(2).enumerate() {
        let border = |k: usize| (length * k as f64 / strips as f64).min(end);
        let [from, to] = [strip, strip + 1].map(border);
        let found = pair[0].rubbed + pair[1].rubbed;
        worst = worst.max((found - (taken(to) - taken(from))).abs() / all);
    }
    println!("worst strip off by {worst:.1e} of all");
    // A step is a 2,500th of a strip.
    assert!(worst < 1e-4, "{worst}");
    close(worn.iter().map(|worn| worn.rubbed).sum(), all, 2e-4, "rubbed");
    let time = steps as f64 * scene.dt;
    let impulse: Vec3 = worn.iter().map(|worn| worn.impulse).sum();
    close(impulse.z, -mass * 9.81 * time, 1e-6, "weight");
    // Half of one step of 46,000 is missing.
    close(impulse.x, mass * (speed - bench.sim.particles.velocity[0].x), 2e-5, "friction");
    // A wall at rest does no work.
    assert!(worn.iter().all(|worn| (worn.time / time - 1.0).abs() < 1e-9));
}

/// A ball on a rotating table: in the axes of the table its force on one triangle has a normal and an outward part.
#[test]
fn sums_are_in_the_axes_of_a_wall_that_turns() {
    let folder = tempfile::tempdir().unwrap();
    let wall = format!(
        "{}\nrotation = {{ about = [0, 0, 0], axis = [0, 0, 1], rate = 2 }}",
        floor(folder.path(), 0.1, 10)
    );
    let scene = scene(&on_floor(
        &wall,
        DOMAIN.replace("high = [1,", "high = [0.3,").as_str(),
        "restitution = 0.5",
    ));
    let mass = scene.library.mass[0];
    let place = Vec3::new(0.055, 0.05, resting(&scene));
    let spin = Vec3::z() * 2.0;
    let mut stuck = ball(0, 0, place, spin.cross(&place));
    stuck.angular_momentum = spin * scene.library.inertia[0].z;
    let mut bench = Bench::of(&scene, &[stuck]);
    // Half a turn.
    let steps = (1.57 / scene.dt) as u64;
    (0..steps / 50).for_each(|_| bench.step());
    let worn = triangles(&bench);
    let pressed: Vec<usize> = (0..worn.len()).filter(|&k| worn[k].impulse.norm() > 0.0).collect();
    assert_eq!(pressed.len(), 1, "{pressed:?}");
    let worn = worn[pressed[0]];
    close(worn.impulse.z, -mass * 9.81 * worn.time, 1e-3, "weight");
    // The ball begins to roll: friction holds it on a circle of 2/7 of the curvature.
    let outwards = Vec3::new(place.x, place.y, 0.0);
    let along = worn.impulse.dot(&outwards) / outwards.norm_squared();
    close(along, 2.0 / 7.0 * mass * 4.0 * worn.time, 5e-3, "outwards");
    let across = (worn.impulse - outwards * along).xy().norm();
    // In the axes of the table it rotates by 5/7 of the table's angle.
    let turned = across / (along * outwards.norm());
    close(turned, 0.5 * 5.0 / 7.0 * 2.0 * worn.time, 1e-2, "turned");
}

/// The image of a triangle beyond a period counts for the triangle.
#[test]
fn an_image_of_a_triangle_is_the_triangle() {
    let folder = tempfile::tempdir().unwrap();
    let domain = "low = [0, -0.2, -0.1]\nhigh = [0.1, 0.2, 0.2]\nperiodic = [true, false, false]";
    let text = on_floor(&floor(folder.path(), 0.1, 10), domain, "")
        .replace("first = [0.1, 0.1, 0.05]", "first = [0.05, 0.1, 0.05]");
    let scene = scene(&text);
    let start = Vec3::new(0.0999, 0.05, resting(&scene));
    let mut bench = Bench::of(&scene, &[ball(0, 0, start, Vec3::x() * 0.5)]);
    (0..2000).for_each(|_| bench.step());
    let worn = triangles(&bench);
    let rubbed = |strips: std::ops::Range<usize>| {
        worn[2 * strips.start..2 * strips.end].iter().map(|worn| worn.rubbed).sum::<f64>()
    };
    let all = bench.measure().dissipated;
    // From 0.0999 to 0.1019 m.
    close(rubbed(9..10) + rubbed(0..1), all, 1e-6, "all");
    close(rubbed(0..1) / all, 0.95, 2e-2, "beyond the period");
}

/// A particle before a period touches triangles beyond it.
#[test]
fn a_point_beyond_a_period_is_on_the_first_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let domain = "low = [0, -0.2, -0.1]\nhigh = [0.1, 0.2, 0.2]\nperiodic = [true, false, false]";
    let text = on_floor(&floor(folder.path(), 0.1, 10), domain, "restitution = 0.5")
        .replace("first = [0.1, 0.1, 0.05]", "first = [0.05, 0.1, 0.05]")
        .replace(
            "kind = \"sphere\"\nradius = 0.01",
            "kind = \"ellipsoid\"\nsemi_axes = [0.012, 0.006, 0.006]",
        );
    let scene = scene(&text);
    let quaternion = rotation_about(&Vec3::y(), 0.5);
    let down = quaternion.inverse_transform_vector(&-Vec3::z());
    let lowest = quaternion.transform_vector(&scene.library.shapes[0].support(&down));
    assert!(lowest.x > 0.003, "{lowest}");
    let place = Vec3::new(0.0995, 0.05, 1e-6 - lowest.z);
    let egg = Particle { quaternion, ..ball(0, 0, place, -Vec3::z() * 0.1) };
    let mut bench = Bench::of(&scene, &[egg]);
    (0..300).for_each(|_| bench.step());
    let worn = triangles(&bench);
    let pressed: Vec<usize> = (0..worn.len()).filter(|&k| worn[k].impulse.z < 0.0).collect();
    assert!(!pressed.is_empty() && pressed.iter().all(|&k| k < 2), "{pressed:?}");
}

/// A piston lifts a ball: its work is the energy that the ball has gained, also in `history.csv`.
#[test]
fn the_work_of_a_piston_is_what_grains_receive() {
    let folder = tempfile::tempdir().unwrap();
    let wall = format!("{}\nvelocity = [0, 0, 0.2]", floor(folder.path(), 0.1, 4));
    let text = on_floor(&wall, DOMAIN, "restitution = 0.5")
        .replace("first = [0.1, 0.1, 0.05]", "first = [0.05, 0.05, 0.0101]")
        .replace("steps = 100", "steps = 100000")
        + "history_every = 2500\nsnapshot_every = 0\n";
    let scene = scene(&text);
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    assemble::fill(&mut sim, &scene, &comm);
    run(&mut sim, &schedule(&scene, scene.steps, folder.path()), &mut comm, &mut |_| {}).unwrap();
    let mut reader = csv::Reader::from_path(folder.path().join("history.csv")).unwrap();
    let names = reader.headers().unwrap().clone();
    let place = |name: &str| {
        names.iter().position(|known| known == name).unwrap_or_else(|| panic!("{name}"))
    };
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let number = |row: usize, name: &str| rows[row][place(name)].parse::<f64>().unwrap();
    let last = rows.len() - 1;
    let mass = scene.library.mass[0];
    for row in 1..=last {
        let received = number(row, "received_J") - number(0, "received_J");
        close(number(row, "work_floor_J"), received, 1e-9, "received");
    }
    assert_eq!(number(0, "work_floor_J"), 0.0);
    let gained = mass * 9.81 * (0.2 * 0.2 + RADIUS - 0.0101) + 0.5 * mass * 0.2 * 0.2;
    let lost = number(last, "lost_at_floor_J");
    close(number(last, "work_floor_J"), gained + lost, 1e-3, "work");
    close(lost, number(last, "dissipated_J"), 1e-12, "lost");
    assert_eq!(number(last, "rubbed_at_floor_J"), number(last, "dissipated_by_friction_J"));
    // The sums in the export for ParaView agree.
    let reader = Reader::open(folder.path()).unwrap();
    let walls = export::walls(&reader).unwrap();
    let mut file = Vec::new();
    walls.write(&mut file).unwrap();
    let file = String::from_utf8(file).unwrap();
    let total = |name: &str, which: usize, width: usize| {
        let start = file.find(&format!("Name=\"{name}\"")).unwrap_or_else(|| panic!("{name}"));
        let text = file[start..].split(['>', '<']).nth(1).unwrap();
        // The length of eight bytes precedes the numbers.
        let bytes = STANDARD.decode(text).unwrap();
        let numbers = bytes.as_chunks::<8>().0.iter().skip(1).map(|x| f64::from_le_bytes(*x));
        let area = 0.1 / 4.0 * 0.2 / 2.0;
        numbers.skip(which).step_by(width).map(|x| x * area).sum::<f64>()
    };
    close(total("lost", 0, 1), lost, 1e-12, "lost");
    close(total("rubbed", 0, 1) + 1.0, 1.0 + number(last, "rubbed_at_floor_J"), 1e-12, "rubbed");
    let worn = worn(&reader.header().drives).unwrap();
    let (time, impulse) =
        worn.values().fold((0.0, 0.0), |(_, sum), worn| (worn.time, sum + worn.impulse.z));
    close(time, 0.2, 1e-9, "time");
    close(total("mean_traction", 2, 3), impulse / time, 1e-12, "traction");
    close(total("mean_pressure", 0, 1), -impulse / time, 1e-12, "pressure");
    close(-impulse, mass * (9.81 * time + 0.2), 2e-2, "weight and start");
}

/// Particles of all kinds tumble on a rising floor: the energy that they receive is the work booked for the wall.
#[test]
fn the_work_of_a_piston_is_what_bodies_of_all_kinds_receive() {
    for shape in SHAPES {
        let folder = tempfile::tempdir().unwrap();
        let wall = format!("{}\nvelocity = [0.1, 0.05, 0.2]", floor(folder.path(), 0.1, 1));
        let ball = format!("kind = \"sphere\"\nradius = {RADIUS:?}");
        let text = on_floor(&wall, DOMAIN, "restitution = 0.5\ntangential_damping_ratio = 0.1")
            .replace(&ball, shape)
            .replace(
                "first = [0.1, 0.1, 0.05]",
                "first = [0.05, 0.05, 0.016]\nvelocity = [0.2, 0, -0.5]",
            )
            .replace("step = 2e-6\nsteps = 100", "step = 2e-6\nsteps = 30000")
            + "history_every = 5000\nsnapshot_every = 0\n";
        let scene = scene(&text);
        let mut comm = Alone::default();
        let mut sim = begun(&scene, &mut comm);
        run(&mut sim, &schedule(&scene, scene.steps, folder.path()), &mut comm, &mut |_| {})
            .unwrap();
        let mut reader = csv::Reader::from_path(folder.path().join("history.csv")).unwrap();
        let rows: Vec<HashMap<String, f64>> = reader.deserialize().map(Result::unwrap).collect();
        for row in &rows[1..] {
            let received = row["received_J"] - rows[0]["received_J"];
            let off = (row["work_floor_J"] - received).abs();
            assert!(off <= 1e-9 * received.abs(), "{shape}: {off:e} of {received:e} J");
        }
        assert!(rows[rows.len() - 1]["work_floor_J"] > 1e-5, "{shape}");
    }
}

/// A run that a signal stops between two rows reports the work until then.
#[test]
fn a_stopped_run_reports_all_work() {
    let folder = tempfile::tempdir().unwrap();
    let wall = format!("{}\nvelocity = [0, 0, 0.01]", floor(folder.path(), 0.1, 4));
    let text = on_floor(&wall, DOMAIN, "restitution = 0.5")
        .replace("first = [0.1, 0.1, 0.05]", "first = [0.05, 0.05, 0.01]")
        .replace("steps = 100", "steps = 100000000");
    let scene = scene(&text);
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    assemble::fill(&mut sim, &scene, &comm);
    let signal = Arc::new(AtomicUsize::new(15));
    let usual = schedule(&scene, scene.steps, folder.path());
    let schedule = Schedule { history_every: 0, signal, ..usual };
    let finish = run(&mut sim, &schedule, &mut comm, &mut |_| {}).unwrap();
    assert_eq!(finish.ending, Ending::Signal(15));
    let report = report(&sim, &finish, &Origin::default(), &mut comm);
    let work = report.counted.iter().find(|(name, _)| name == "work_floor_J").unwrap().1;
    assert!(work > 0.0);
    // The first row of the history has the energy received at the start.
    let mut history = csv::Reader::from_path(folder.path().join("history.csv")).unwrap();
    let row: HashMap<String, f64> = history.deserialize().next().unwrap().unwrap();
    let before = row["received_J"];
    close(work, finish.measures.received - before, 1e-9, "received");
}

/// Wear that begins at a restart: the wall's work continues, the losses at it begin, and the run reports it. Without a change there is no message.
#[test]
fn wear_that_begins_within_a_stage_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let wall = format!("{}\nvelocity = [0, 0, 0.2]", floor(folder.path(), 0.1, 4));
    let with = on_floor(&wall, DOMAIN, "restitution = 0.5")
        .replace("first = [0.1, 0.1, 0.05]", "first = [0.05, 0.05, 0.0101]");
    let without = with.replace("wear = true\n", "");
    assert_ne!(with, without);
    let work = |sim: &Simulation| {
        let header = sim.header("", &[Vec3::zeros()], &mut Alone::default());
        let ledger = header.drives.iter().find(|saved| saved.drive == "ledger").unwrap();
        ledger.reals(&StateColumn::new("work", 1, "J")).unwrap().iter().sum::<f64>()
    };
    let at_rest = without.replace("velocity = [0, 0, 0.2]\n", "");
    assert_ne!(at_rest, without);
    let longer = floor(folder.path(), 0.1, 4).replace("floor.obj", "longer.obj");
    let corners = std::fs::read_to_string(folder.path().join("floor.obj")).unwrap();
    std::fs::write(folder.path().join("longer.obj"), corners.replace("v 0.1 ", "v 0.11 ")).unwrap();
    // An equal number of triangles at other positions.
    let another = with.replace(&floor(folder.path(), 0.1, 4), &longer);
    assert_ne!(another, with);
    let scenes = [&without, &with, &at_rest, &another].map(|text| scene(text));
    let same = [(1, 1), (1, 0), (0, 0)].map(|scenes| (scenes, ""));
    let others = [
        ((1, 3), "wall \"floor\" had no wear before this restart, or other triangles"),
        ((0, 1), "wall \"floor\" had no wear before this restart"),
        ((2, 1), "the snapshot has no sums for wall \"floor\""),
    ];
    for ((first, then), told) in same.into_iter().chain(others) {
        let mut comm = Alone::default();
        let mut before = begun(&scenes[first], &mut comm);
        for _ in 0..1000 {
            before.step(&mut comm).unwrap();
        }
        // A wall at rest without wear has no work.
        let done = if first == 2 { 0.0 } else { work(&before) };
        assert!(first == 2 || done > 0.0);
        save(&before, folder.path(), &scenes[first], &mut comm);
        let mut after = assemble::assemble(&scenes[then], &comm);
        assemble::take_up(
            &mut after,
            &scenes[then],
            folder.path(),
            Continuation::SameStage,
            &mut comm,
        )
        .unwrap();
        assert_eq!(work(&after).to_bits(), done.to_bits());
        let said: Vec<String> = after.all_observers_mut().flat_map(Reporter::warnings).collect();
        let is_told = |told: &str| said.iter().any(|said| said.starts_with(told));
        assert!(
            if told.is_empty() { said.is_empty() } else { is_told(told) },
            "{first} {then}: {said:?}"
        );
    }
}
