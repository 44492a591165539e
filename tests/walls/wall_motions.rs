//! Force, torque and power of walls; motions by oscillations and tables.

use crate::support::{
    Bench, MATERIAL, State, ball, begun, close, expect_refused, save, scene, schedule,
};
use crate::walls::the_same_on_any_ranks;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::threads;
use dem_mpi::ids::Slot;
use dem_mpi::math::Vec3;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::particles::records::Particle;
use dem_mpi::post::export;
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble::{self, Continuation};
use dem_mpi::scene::doubts::doubts;
use dem_mpi::scene::plan::plan;
use dem_mpi::sim::Simulation;
use dem_mpi::sim::run::{Ending, run};
use dem_mpi::walls::Wall;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const RADIUS: f64 = 0.01;

/// Scene of a ball over a floor, with additional keys of the material.
fn on_floor(wall: &str, law: &str, own: &str) -> String {
    format!(
        r#"
gravity = [0, 0, -9.81]
[law]
{law}
[domain]
low = [-0.2, -0.2, -0.2]
high = [0.2, 0.2, 0.2]
[[wall]]
name = "floor"
point = [0, 0, 0]
normal = [0, 0, 1]
{wall}
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e6
{own}
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS:?}
[[fill.lattice]]
first = [0, 0, 0.05]
count = [1, 1, 1]
[time]
step = 1e-5
steps = 1
[output]
directory = "out"
"#
    )
}

/// A plane lifts a shape with faces, or a ball beside such a shape, by a law without friction and dashpots. The energy gained equals the energy
/// received.
#[test]
fn the_work_of_walls_is_booked_without_friction_and_dashpots() {
    for shape in [
        "kind = \"sphere\"\nradius = 0.01",
        "kind = \"polyhedron\"\nedges = [0.02, 0.02, 0.02]",
        "kind = \"spherocylinder\"\nlength = 0.01\nradius = 0.01",
        "kind = \"rounded-polyhedron\"\nedges = [0.015, 0.015, 0.015]\nradius = 0.003",
        "kind = \"ellipsoid\"\nsemi_axes = [0.01, 0.008, 0.012]",
    ] {
        for other in
            ["", "[[shape]]\nname = \"other\"\nkind = \"polyhedron\"\nedges = [0.02, 0.02, 0.02]\n"]
        {
            for motion in [
                "velocity = [0, 0, 0.3]",
                "rotation = { about = [0.1, 0, 0], axis = [0, 1, 0], rate = 2 }",
            ] {
                let text = on_floor(motion, "", "")
                    .replace(&format!("kind = \"sphere\"\nradius = {RADIUS:?}"), shape)
                    .replace(
                        "[[fill.lattice]]",
                        &format!("{other}[[fill.lattice]]\nshapes = [\"ball\"]"),
                    )
                    .replace("first = [0, 0, 0.05]", "first = [0, 0, 0.017]")
                    .replace("normal_stiffness = 1e6", "normal_stiffness = 1e4")
                    .replace("step = 1e-5", "step = 2e-6");
                let scene = scene(&text);
                let mut comm = Alone::default();
                let mut sim = begun(&scene, &mut comm);
                let before = sim.measure(&mut comm);
                (0..15_000).for_each(|_| sim.step(&mut comm).unwrap());
                let m = sim.measure(&mut comm);
                let received = m.received - before.received;
                println!("{shape:?} {motion:?}: received {received:e}, missing {:e}", m.missing());
                assert!(received > 1e-4, "{text}: {received:e}");
                assert!(
                    (m.missing() - before.missing()).abs() < 2e-3 * received,
                    "{text}: {:e} of {received:e}",
                    m.missing()
                );
            }
        }
    }
}

/// A wall of triangles that leaves the domain gives a warning before the start.
#[test]
fn a_wall_that_leaves_the_domain_is_doubtful() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plate.obj");
    std::fs::write(&path, "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0 0.1 0\nf 1 2 3\n").unwrap();
    let says = |velocity: f64, steps: u64| {
        let wall =
            format!("mesh = {:?}\nvelocity = [0, {velocity:?}, 0]", path.display().to_string());
        let text = on_floor(&wall, "", "")
            .replace("point = [0, 0, 0]\nnormal = [0, 0, 1]\n", "")
            .replace("steps = 1\n", &format!("steps = {steps}\n"));
        let doubts = doubts(&scene(&text));
        doubts
            .iter()
            .any(|doubt| doubt.contains("wall \"floor\" leaves the domain with its `velocity`"))
    };
    // The rear moves by 0.3 m in either direction.
    assert!(says(0.4, 76_000) && says(-0.4, 76_000));
    assert!(!says(0.4, 74_000) && !says(-0.4, 74_000) && !says(0.0, 76_000));
}

/// A ball rubs, twists and rolls on a floor at rest. The torque on the floor equals the ball's loss of angular momentum about the point,
/// without the part of gravity.
#[test]
fn the_torque_on_a_wall_is_what_the_ball_loses() {
    let point = Vec3::new(0.03, -0.02, -0.05);
    let text = on_floor(
        "torque_about = [0.03, -0.02, -0.05]",
        "rolling = \"spring\"\ntwisting = \"spring\"",
        "friction = 0.5\nrolling_friction = 0.05\ntwisting_friction = 0.1\nrestitution = 0.3",
    );
    let scene = scene(&text);
    let mass = scene.library.mass[0];
    let inertia = 0.4 * mass * RADIUS * RADIUS;
    let start = Vec3::new(0.05, 0.01, RADIUS - mass * 9.81 / 1e6);
    let mut bench = Bench::of(
        &scene,
        &[Particle {
            angular_velocity: Vec3::new(3.0, 5.0, 40.0),
            ..ball(0, 0, start, Vec3::new(0.3, -0.1, 0.0))
        }],
    );
    let momentum = |bench: &Bench| {
        let p = &bench.sim.particles;
        let moving = mass * (p.position[0] - point).cross(&p.velocity[0]);
        moving + inertia * p.angular_velocity_of(Slot(0))
    };
    let weight = Vec3::new(0.0, 0.0, -9.81 * mass);
    let of_gravity = |bench: &Bench| (bench.sim.particles.position[0] - point).cross(&weight);
    let torque = |bench: &mut Bench| {
        let m = bench.measure();
        bench.sim.particles.walls[0].torque_of(&m.wall_torques[0], &m.wall_forces[0])
    };
    let (dt, before) = (bench.sim.dt, momentum(&bench));
    let mut given = Vec3::zeros();
    let mut of_weight = Vec3::zeros();
    for _ in 0..500 {
        given += 0.5 * dt * torque(&mut bench);
        of_weight += 0.5 * dt * of_gravity(&bench);
        bench.step();
        given += 0.5 * dt * torque(&mut bench);
        of_weight += 0.5 * dt * of_gravity(&bench);
    }
    let lost = before + of_weight - momentum(&bench);
    println!("lost {lost:?}, given {given:?}: off by {:e}", (given - lost).norm() / lost.norm());
    assert!((given - lost).norm() < 1e-10 * lost.norm());
    // Twisting is a separate moment that no lever arm gives.
    let m = bench.measure();
    let arms = bench.sim.particles.position[0].cross(&m.wall_forces[0]);
    assert!((m.wall_torques[0] - arms).z.abs() > 0.5 * 0.1 * mass * 9.81 * RADIUS);
}

/// A turntable carries a ball off its axis: torque and power have closed forms.
#[test]
fn a_turntable_needs_the_power_that_friction_takes() {
    let rate = 30.0;
    let wall = format!("rotation = {{ about = [0, 0, 0], axis = [0, 0, 1], rate = {rate:?} }}");
    let scene = scene(&on_floor(&wall, "", "friction = 0.2"));
    let mass = scene.library.mass[0];
    let (side, pressed) = (0.1, mass * 9.81 / 1e6);
    // The ball slides for long, so the first moment is that of a table that rubs along y.
    let mut bench =
        Bench::of(&scene, &[ball(0, 0, Vec3::new(side, 0.0, RADIUS - pressed), Vec3::zeros())]);
    let before = bench.measure();
    let (dt, mut given) = (bench.sim.dt, 0.0);
    let mut power = 0.0;
    let steps = 400;
    for step in 0..steps {
        bench.step();
        let m = bench.measure();
        let now = bench.sim.particles.walls[0].power(&m.wall_forces[0], &m.wall_torques[0]);
        given += 0.5 * dt * (power + now);
        power = now;
        if step == 100 {
            close(m.wall_torques[0].z, -0.2 * mass * 9.81 * side, 1e-6, "torque");
            close(power, 0.2 * mass * 9.81 * side * rate, 1e-6, "power");
            assert_eq!(power, -rate * m.wall_torques[0].z);
        }
    }
    let received = bench.measure().received - before.received;
    close(given, received, 1e-10, "work of the table");
}

/// A drum of four planes about y.
fn drum(rows: u64) -> String {
    format!(
        r#"
gravity = [0, 0, -9.81]
[domain]
low = [-0.02, 0, -0.02]
high = [0.02, 0.01, 0.02]
periodic = [false, true, false]
[law]
rolling = "spring"
[[wall]]
name = "drum"
planes = [
    {{ point = [-0.012, 0, 0], normal = [1, 0, 0] }},
    {{ point = [0.012, 0, 0], normal = [-1, 0, 0] }},
    {{ point = [0, 0, -0.012], normal = [0, 0, 1] }},
    {{ point = [0, 0, 0.012], normal = [0, 0, -1] }},
]
rotation = {{ about = [0, 0, 0], axis = [0, 1, 0], rate = 30 }}
torque_about = [0.001, 0, 0.002]
[time]
step = 5e-6
steps = 6000
[output]
directory = "out"
history_every = {rows}
{MATERIAL}
rolling_friction = 0.1
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.001, 0.0008, 0.0009]
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.0009
[[fill.lattice]]
shapes = ["egg", "ball"]
low = [-0.01, 0, -0.01]
high = [0.01, 0.01, 0.005]
spacing = 0.0022
"#
    )
}

/// Column of a history.
fn column(table: &str, name: &str) -> Vec<f64> {
    let mut rows = csv::Reader::from_reader(table.as_bytes());
    let place = rows.headers().unwrap().iter().position(|column| column == name);
    let place = place.unwrap_or_else(|| panic!("no column {name}"));
    rows.records().map(|row| row.unwrap()[place].parse().unwrap()).collect()
}

/// History of a scene on a number of ranks.
fn history(text: &str, ranks: u32, steps: u64) -> String {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(text);
    threads::run(ranks, |comm| {
        let mut sim = assemble::assemble(&scene, comm);
        assemble::fill(&mut sim, &scene, comm);
        run(&mut sim, &schedule(&scene, steps, folder.path()), comm, &mut |_| {}).unwrap();
    });
    std::fs::read_to_string(folder.path().join("history.csv")).unwrap()
}

/// With ellipsoids and balls that resist rolling, the drum's total work equals the energy that its particles received.
#[test]
fn power_adds_up_to_what_grains_receive_on_any_ranks() {
    let (text, steps) = (drum(1), 6000);
    let table = history(&text, 1, steps);
    assert!(table == history(&text, 3, steps), "3 ranks");
    let [power, received] = ["power_drum_W", "received_J"].map(|name| column(&table, name));
    let work: f64 = power.windows(2).map(|two| 0.5 * (two[0] + two[1]) * 5e-6).sum();
    close(work, received[received.len() - 1] - received[0], 1e-3, "work");
    let torque = |axis: &str| column(&table, &format!("torque_drum_{axis}_N_m"));
    let force = |axis: &str| column(&table, &format!("force_drum_{axis}_N"));
    let (torque, x, z) = (torque("y"), force("x"), force("z"));
    for row in (0..power.len()).step_by(50) {
        let about_axis = torque[row] + 0.002 * x[row] - 0.001 * z[row];
        assert!((power[row] + 30.0 * about_axis).abs() < 1e-9 * power[row].abs() + 1e-15);
    }
    let turned = column(&table, "turned_drum_y_rad");
    assert!((turned[6000] - 30.0 * 0.03).abs() < 1e-12);
}

#[test]
fn a_point_for_the_torque_must_be_one() {
    expect_refused(
        &drum(1),
        "torque_about = [0.001, 0, 0.002]",
        "torque_about = 3",
        "torque_about",
    );
}

/// A ball rests on a floor that begins to shake. With base excitation and without dashpots, `z = A (sin ωt - r sin ω₀t) / (1 - r²)` with `r =
/// ω/ω₀`, as long as it stays in contact.
#[test]
fn a_ball_on_a_shaking_floor_moves_as_the_oscillator() {
    let (amplitude, frequency) = (4e-7, 200.0);
    let off = |dt: f64| {
        let shaking = format!(
            "[[motion]]\nwalls = [\"floor\"]\nalong = [0, 0, 2]\namplitude = {amplitude:?}\nfrequency = {frequency:?}\n"
        );
        let text = on_floor("", "", "") + &shaking;
        let scene = scene(&text.replace("step = 1e-5", &format!("step = {dt:?}")));
        let mass = scene.library.mass[0];
        let (omega, own) = (std::f64::consts::TAU * frequency, (1e6 / mass).sqrt());
        let height = RADIUS - mass * 9.81 / 1e6;
        // The floor is at full speed at once, and the ball at rest.
        let mut bench = Bench::of(&scene, &[ball(0, 0, Vec3::z() * height, Vec3::zeros())]);
        let before = bench.measure();
        let ratio = omega / own;
        let mut worst: f64 = 0.0;
        for step in 1..=(0.01 / dt).round() as u64 {
            bench.step();
            let time = step as f64 * dt;
            let expected = amplitude * ((omega * time).sin() - ratio * (own * time).sin())
                / (1.0 - ratio * ratio);
            worst = worst.max((bench.sim.particles.position[0].z - height - expected).abs());
        }
        let after = bench.measure();
        let given = after.received - before.received;
        let missing = (after.missing() - before.missing()).abs();
        println!(
            "step {dt:e}: off by {:.1e} of the amplitude, missing {missing:e} J of {given:e} J",
            worst / amplitude
        );
        assert!(missing < 1e-6 * given.abs().max(after.kinetic()) + 1e-6 * after.stored);
        let floor = bench.sim.particles.walls[0].point.z;
        assert!((floor - amplitude * (omega * 0.01).sin()).abs() < 1e-18);
        worst / amplitude
    };
    let [long, short] = [off(4e-6), off(1e-6)];
    assert!(long < 0.01 && short < long / 12.0, "{long:e} {short:e}");
}

/// A drum that oscillates about its axis and is shaken by a table.
fn shaken(table: &Path, interpolation: &str) -> String {
    let turning = "rotation = { about = [0, 0, 0], axis = [0, 1, 0], rate = 30 }\n";
    drum(100).replace(turning, "")
        + &format!(
            r#"
[[motion]]
walls = ["drum"]
about = [0, 0, 0]
axis = [0, 1, 0]
amplitude = 40
frequency = 12
phase = 30
[[motion]]
walls = ["drum"]
along = [1, 0, 1]
table = "{}"
interpolation = "{interpolation}"
"#,
            table.display()
        )
}

/// Position and rotation depend only on the step, the energy balance closes, and ranks and restarts change no bit.
#[test]
fn a_shaken_drum_has_the_same_bits_on_any_ranks_and_gives_what_its_grains_lose() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("shake.csv");
    std::fs::write(
        &table,
        "# lifted\ntime_s,displacement_m\n0,1\n0.01,1.0005\n0.015,1.0015\n0.02,1.001\n",
    )
    .unwrap();
    for interpolation in ["linear", "smooth"] {
        let scene = scene(&shaken(&table, interpolation));
        let state = the_same_on_any_ranks(&scene, 6000);
        let place = state.numbers("place of drum");
        let point = Vec3::new(place[0], place[1], place[2]);
        let expected = Vec3::new(1.0, 0.0, 1.0).normalize() * 0.001;
        assert!((point - expected).norm() < 1e-15, "{point:?}");
        let angle = 40f64.to_radians()
            * ((std::f64::consts::TAU * 12.0 * 0.03 + std::f64::consts::FRAC_PI_6).sin() - 0.5);
        let turned = 2.0 * f64::atan2(place[4], place[6]);
        assert!((turned - angle).abs() < 1e-14, "{turned} {angle}");
        let [dissipated, received, missing] =
            ["dissipated", "received", "missing"].map(|name| state.number(name));
        println!(
            "{interpolation}: {} grains, received {received:e} J, dissipated {dissipated:e} J, missing {missing:e} J",
            state.bits.len()
        );
        assert!(
            missing.abs() < 1e-5 * dissipated && received > 0.0,
            "{missing:e} of {dissipated:e}"
        );
    }
}

#[test]
fn bad_tables_are_refused_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("shake.csv");
    let good = "time_s,displacement_m\n0,0\n0.01,0.0005\n\n# then\n0.02,0.001\n";
    std::fs::write(&table, good).unwrap();
    let text = shaken(&table, "linear");
    scene(&text);
    for (from, to, said) in [
        ("0.02,0.001", "0.01,0.001", "line 6: time 0.01 is not after 0.01"),
        ("0,0\n", "0.1,0\n", "line 2: the first time must be 0"),
        ("0.001\n", "up\n", "line 6: `up` is not a number"),
        ("0.0005", "0.0005,3", "line 3 has 3 numbers, not 2"),
        (
            "displacement_m",
            "angle_deg",
            "must have the columns time_s,displacement_m; it has time_s,angle_deg",
        ),
        ("0.01,0.0005\n\n# then\n0.02,0.001\n", "", "must have at least two rows"),
    ] {
        std::fs::write(&table, good.replacen(from, to, 1)).unwrap();
        expect_refused(&text, "[[motion]]", "[[motion]]", said);
    }
    std::fs::write(&table, good).unwrap();
    for (from, to, said) in [
        ("frequency = 12", "frequency = 1e5", "reduce motions by a factor"),
        ("walls = [\"drum\"]\nabout", "walls = [\"drums\"]\nabout", "no such wall"),
        ("along = [1, 0, 1]", "amplitude = 2", "`along` is missing"),
        ("along = [1, 0, 1]", "along = [1, 0, 1]\nabout = [0, 0, 0]", "not with `along`"),
        (
            "along = [1, 0, 1]",
            "about = [0, 0, 0]\naxis = [0, 1, 0]",
            "must have the columns time_s,angle_deg",
        ),
        (
            "axis = [0, 1, 0]\namplitude",
            "axis = [1, 1, 0]\namplitude",
            "must lie along y, which is periodic",
        ),
    ] {
        expect_refused(&text, from, to, said);
    }
}

/// An oscillation up and down, and one about a point beside the ball.
const SWINGING: &str = "
[[motion]]
walls = [\"floor\"]
along = [0, 0, 1]
amplitude = 1e-3
frequency = 5
[[motion]]
walls = [\"floor\"]
about = [0.02, 0, 0]
axis = [0, 1, 0]
amplitude = 3
frequency = 10
phase = -90
";

/// Writes a square of 0.2 m in the plane z = 0, of two triangles.
fn square(folder: &Path) -> PathBuf {
    let file = folder.join("square.obj");
    let corners = "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\n";
    std::fs::write(&file, format!("{corners}f 1 2 3\nf 1 3 4\n")).unwrap();
    file
}

/// An oscillating floor of triangles equals an oscillating plane.
#[test]
fn triangles_swing_as_a_plane() {
    let folder = tempfile::tempdir().unwrap();
    let file = square(folder.path());
    let plane = on_floor("", "", "friction = 0.3") + SWINGING;
    let mesh = format!("mesh = \"{}\"", file.display());
    let of_triangles = plane.replace("point = [0, 0, 0]\nnormal = [0, 0, 1]", &mesh);
    assert!(plane != of_triangles);
    let start = ball(0, 0, Vec3::new(0.013, 0.001, RADIUS), Vec3::zeros());
    let mut benches =
        [plane, of_triangles].map(|text| Bench::new(&text, std::slice::from_ref(&start)));
    let (mut touched, mut strongest, mut off) = (0, 0.0_f64, 0.0_f64);
    // Each bounce amplifies rounding: 1e-15 after 500 steps, 2e-11 after 5,000.
    for _ in 0..5000 {
        benches.iter_mut().for_each(Bench::step);
        let [on_plane, on_mesh] = benches.each_ref().map(|bench| bench.sim.particles.position[0]);
        assert!((on_plane - on_mesh).norm() < 1e-10 * RADIUS, "{on_plane:?} {on_mesh:?}");
        if benches[1].sim.contacts.is_empty() {
            continue;
        }
        touched += 1;
        let [power, of_mesh] = benches.each_mut().map(|bench| {
            let m = bench.measure();
            bench.sim.particles.walls[0].power(&m.wall_forces[0], &m.wall_torques[0])
        });
        strongest = strongest.max(power.abs());
        off = off.max((power - of_mesh).abs());
    }
    println!("{touched} touches, power up to {strongest:e}, off by {off:e}");
    assert!(touched > 200 && strongest > 0.0 && off <= 1e-6 * strongest);
    assert!(benches[1].sim.particles.velocity[0].x.abs() > 1e-3);
}

/// A wall of triangles and a cylinder approach a ball at rest from far away: they strike it like a plane.
#[test]
fn what_comes_from_afar_is_felt() {
    let folder = tempfile::tempdir().unwrap();
    let file = square(folder.path());
    let plane = on_floor("velocity = [0, 0, 1.0]", "", "").replace("[0, 0, -9.81]", "[0, 0, 0]");
    let mesh = format!("mesh = {file:?}");
    let stamp = plane.replace("point = [0, 0, 0]\nnormal = [0, 0, 1]", &mesh);
    let cylinder = "cylinder = { from = [-0.1, 0, -0.3], to = [0.1, 0, -0.3], radius = 0.3 }";
    let round = plane.replace("point = [0, 0, 0]\nnormal = [0, 0, 1]", cylinder);
    assert!(plane.contains("gravity = [0, 0, 0]") && stamp != plane && round != plane);
    let start = ball(0, 0, Vec3::new(0.013, 0.001, 5.0 * RADIUS), Vec3::zeros());
    let after = [&plane, &stamp, &round].map(|text| {
        let mut bench = Bench::new(text, std::slice::from_ref(&start));
        let steps = (8.0 * RADIUS / bench.sim.dt) as usize;
        (0..steps).for_each(|_| bench.step());
        bench.sim.particles.velocity[0]
    });
    println!("{after:?}");
    assert!(after[0].z > 1.0, "the plane has struck: {after:?}");
    for velocity in after {
        close(velocity.z, after[0].z, 1e-3, "velocity");
    }
}

/// A plate of triangles that a stage has moved and rotated keeps its position and its contact in the next one. This holds for any new point of
/// rotation.
#[test]
fn triangles_stay_where_a_stage_left_them() {
    let folder = tempfile::tempdir().unwrap();
    let file = square(folder.path());
    let mesh = format!("mesh = {file:?}\nshift = [0.001, 0.002, 0.003]");
    let plate = |wall: &str| {
        scene(
            &on_floor(wall, "", "friction = 0.5")
                .replace("point = [0, 0, 0]\nnormal = [0, 0, 1]", &mesh),
        )
    };
    let turning = |about: &str| {
        plate(&format!("rotation = {{ about = {about}, axis = [0, 0.1, 1], rate = 2 }}"))
    };
    let first = plate(
        "velocity = [0.1, 0.05, 0]\nrotation = { about = [0.02, 0.01, 0], axis = [0, 0, 1], rate = 2 }",
    );
    let start = ball(0, 0, Vec3::new(0.013, 0.001, 0.003 + RADIUS - 1.0273e-7), Vec3::zeros());
    let mut bench = Bench::of(&first, std::slice::from_ref(&start));
    (0..2000).for_each(|_| bench.step());
    let in_place = |wall: &Wall| -> Vec<Vec3> {
        let corners = wall.mesh.as_ref().unwrap().surface.triangles().flatten();
        corners.map(|corner| wall.point + wall.orientation * corner).collect()
    };
    let (left, force) = (in_place(&bench.sim.particles.walls[0]), bench.measure().wall_forces[0]);
    assert!(force.xy().norm() > 1e-3 * force.norm(), "{force:?}");
    let mut comm = Alone::default();
    let saved = folder.path().join("saved");
    save(&bench.sim, &saved, &first, &mut comm);
    for next in [plate(""), turning("[0.02, 0.01, 0]"), turning("[-0.03, 0, 0.01]")] {
        let taken = |path: &Path, how: Continuation, comm: &mut Alone| {
            let mut sim = assemble::assemble(&next, comm);
            let taken = assemble::take_up(&mut sim, &next, path, how, comm).unwrap();
            assert!(taken.other_walls.is_empty());
            (sim, taken)
        };
        let (mut sim, found) = taken(&saved, Continuation::NewStage, &mut comm);
        assert_eq!(found.walls_elsewhere.len(), 1);
        sim.begin(&mut comm).unwrap();
        for (now, before) in in_place(&sim.particles.walls[0]).iter().zip(&left) {
            assert!((now - before).norm() < 1e-15, "{now:?} {before:?}");
        }
        let goes_on = sim.measure(&mut comm).wall_forces[0];
        assert!((goes_on - force).norm() < 1e-9 * force.norm(), "{goes_on:?} {force:?}");
        let here = folder.path().join("again");
        (0..20).for_each(|_| sim.step(&mut comm).unwrap());
        save(&sim, &here, &next, &mut comm);
        let (mut again, _) = taken(&here, Continuation::SameStage, &mut comm);
        for sim in [&mut sim, &mut again] {
            (0..20).for_each(|_| sim.step(&mut comm).unwrap());
        }
        assert!(State::of(&sim, &mut comm) == State::of(&again, &mut comm));
    }
    // Another surface is another wall.
    let half = std::fs::read_to_string(&file).unwrap().replace("f 1 3 4\n", "");
    std::fs::write(&file, half).unwrap();
    let other = plate("");
    let mut sim = assemble::assemble(&other, &comm);
    let taken = assemble::take_up(&mut sim, &other, &saved, Continuation::SameStage, &mut comm);
    assert_eq!(taken.unwrap().other_walls, ["floor"]);
}

/// With another step a motion continues within its stage; in another stage it begins again from the wall's position.
#[test]
fn courses_and_stages() {
    let way = |time: f64| 1e-3 * (std::f64::consts::TAU * 5.0 * time).sin();
    let text = on_floor("", "", "friction = 0.3") + SWINGING;
    let folder = tempfile::tempdir().unwrap();
    let begun_with = scene(&text);
    threads::run(1, |comm| {
        let mut sim = begun(&begun_with, comm);
        (0..100).for_each(|_| sim.step(comm).unwrap());
        save(&sim, folder.path(), &begun_with, comm);
    });
    let shorter = text.replace("step = 1e-5", "step = 5e-6");
    for (text, continuation, expected) in [
        (&text, Continuation::SameStage, way(150e-5)),
        (&shorter, Continuation::SameStage, way(100e-5 + 50.0 * 5e-6)),
        // From its position, about its own point, which has moved with it.
        (&text, Continuation::NewStage, way(100e-5) + way(50e-5)),
    ] {
        let scene = scene(text);
        let place = threads::run(1, |comm| {
            let mut sim = assemble::assemble(&scene, comm);
            assemble::take_up(&mut sim, &scene, folder.path(), continuation, comm).unwrap();
            let (point, normal) = sim.particles.walls[0].surface();
            let height = (Vec3::new(0.02, 0.0, way(100e-5)) - point).dot(&normal);
            assert!(height.abs() < 1e-17, "it stands where it stood: {height:e}");
            if continuation == Continuation::NewStage {
                sim.begin(comm).unwrap();
            }
            (0..50).for_each(|_| sim.step(comm).unwrap());
            sim.particles.walls[0].point.z
        });
        assert!((place[0] - expected).abs() < 1e-17, "{continuation:?}: {place:?} {expected}");
    }
}

/// A wall that travels and rotates continues in the next stage of an unchanged scene without a trace. It rotates about its own axis, which has
/// moved with it. With another point in the scene it rotates about that.
#[test]
fn a_stage_goes_on_with_the_same_turn() {
    let folder = tempfile::tempdir().unwrap();
    let file = square(folder.path());
    let turning = |about: &str| {
        let turn = format!(
            "velocity = [0.1, 0.05, -1]\nrotation = {{ about = {about}, axis = [0, 0.1, 1], rate = 20 }}"
        );
        on_floor(&turn, "", "friction = 0.3")
    };
    let of_triangles = |text: String| {
        text.replace("point = [0, 0, 0]\nnormal = [0, 0, 1]", &format!("mesh = {file:?}"))
    };
    let [here, there] = ["[0.05, 0, 0]", "[0.01, 0.02, 0]"].map(turning);
    for [here, there] in [[here.clone(), there.clone()], [here, there].map(of_triangles)] {
        let ([here, there], mut comm) = ([here, there].map(|text| scene(&text)), Alone::default());
        let mut sim = begun(&here, &mut comm);
        (0..3000).for_each(|_| sim.step(&mut comm).unwrap());
        save(&sim, folder.path(), &here, &mut comm);
        let mut after = |scene: &Scene| {
            let mut sim = assemble::assemble(scene, &comm);
            let new = Continuation::NewStage;
            assemble::take_up(&mut sim, scene, folder.path(), new, &mut comm).unwrap();
            let stands = sim.particles.walls[0].clone();
            sim.begin(&mut comm).unwrap();
            (0..2000).for_each(|_| sim.step(&mut comm).unwrap());
            (stands, sim.particles.walls[0].clone())
        };
        let ((_, next), (stands, other)) = (after(&here), after(&there));
        (0..2000).for_each(|_| sim.step(&mut comm).unwrap());
        let whole = &sim.particles.walls[0];
        let place = Vec3::new(0.05, 0.0, 0.0) + Vec3::new(0.1, 0.05, -1.0) * 0.05;
        let seen = |wall: &Wall| wall.orientation.inverse() * (place - wall.point);
        assert!((seen(&next) - seen(whole)).norm() < 1e-14, "{next:?} {whole:?}");
        assert!(next.orientation.angle_to(&whole.orientation) < 1e-14);
        assert!((next.point - place).norm() < 1e-15, "the axis has come along: {:?}", next.point);
        // The axis passes through the material point that was at the other point when the stage began.
        let axis = Vec3::new(0.01, 0.02, 0.0);
        assert!((stands.point - axis).norm() < 1e-15, "{stands:?}");
        let come = axis + Vec3::new(0.1, 0.05, -1.0) * 0.02;
        assert!((other.point - come).norm() < 1e-15, "{other:?}");
    }
}

/// The reported approach of a long screw that rotates about its axis is that of its thickness, for any reference point on the axis. No point of
/// it moves farther than reported.
#[test]
fn a_screw_is_as_fast_as_it_is_thick() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("screw.obj");
    let mut corners = String::new();
    for k in 0..20 {
        let (place, angle) = (0.01 * f64::from(k), 0.8 * f64::from(k));
        let (y, z) = (5e-3 * angle.cos(), 5e-3 * angle.sin());
        writeln!(corners, "v {place:?} {y:?} {z:?}\nv {place:?} {:?} {:?}", -y, -z).unwrap();
    }
    for k in 0..19 {
        let a = 2 * k + 1;
        writeln!(corners, "f {a} {} {}\nf {} {} {}", a + 1, a + 2, a + 1, a + 3, a + 2).unwrap();
    }
    std::fs::write(&file, corners).unwrap();
    let turn = "rotation = { about = [-0.1, 0, 0], axis = [1, 0, 0], rate = 6 }";
    let screw = on_floor(turn, "", "")
        .replace("point = [0, 0, 0]\nnormal = [0, 0, 1]", &format!("mesh = {file:?}"));
    let mut comm = Alone::default();
    let mut sim = begun(&scene(&screw), &mut comm);
    let room = (Vec3::repeat(-0.2), Vec3::repeat(0.2));
    let before = sim.particles.walls[0].clone();
    let (way, edge) = (before.way(sim.dt, &room), 6.0 * 5e-3 * sim.dt);
    assert!(way >= edge && way < 1.5 * edge, "{way:e} {edge:e}");
    (0..10).for_each(|_| sim.step(&mut comm).unwrap());
    let wall = &sim.particles.walls[0];
    let in_place = |wall: &Wall| -> Vec<Vec3> {
        let corners = wall.mesh.as_ref().unwrap().surface.triangles().flatten();
        corners.map(|corner| wall.point + wall.orientation * corner).collect()
    };
    let ways = in_place(&before).into_iter().zip(in_place(wall)).map(|(a, b)| (a - b).norm());
    let (most, said) = (ways.fold(0.0, f64::max), wall.nearer_since_listed(&room));
    assert!(said >= most && said < 1.5 * most, "{said:e} {most:e}");
}

/// Another motion or velocity within a stage moves the wall from its position, like in a new stage.
#[test]
fn another_course_goes_on_from_where_the_wall_stands() {
    let swinging = on_floor("", "", "friction = 0.3") + SWINGING;
    let pushed =
        swinging.replace("normal = [0, 0, 1]", "normal = [0, 0, 1]\nvelocity = [0.01, 0, 0.02]");
    let folder = tempfile::tempdir().unwrap();
    let mut comm = Alone::default();
    let place = |sim: &Simulation| {
        let Wall { point, orientation, .. } = &sim.particles.walls[0];
        (*point, *orientation)
    };
    for text in [&swinging, &pushed] {
        let before = scene(text);
        let mut sim = begun(&before, &mut comm);
        (0..100).for_each(|_| sim.step(&mut comm).unwrap());
        let (point, orientation) = place(&sim);
        save(&sim, folder.path(), &before, &mut comm);
        for (from, to) in [
            ("amplitude = 1e-3", "amplitude = 2e-3"),
            ("amplitude = 3", "amplitude = 6"),
            ("velocity = [0.01, 0, 0.02]", "velocity = [0.03, 0, -0.05]"),
        ] {
            let after = scene(&text.replace(from, to));
            let mut sim = assemble::assemble(&after, &comm);
            let same = Continuation::SameStage;
            assemble::take_up(&mut sim, &after, folder.path(), same, &mut comm).unwrap();
            sim.step(&mut comm).unwrap();
            let (now, turned) = place(&sim);
            // At most 0.2 m/s and 8 rad/s, in a step of 1e-5 s.
            let off = (now - point).norm() + RADIUS * orientation.angle_to(&turned);
            assert!(off < 1e-5 * (0.2 + 8.0 * RADIUS), "{to}: {off:e} m");
        }
    }
}

/// Another point of rotation within a stage becomes the new centre, from the wall's position. A wall that was only shifted rotates about the
/// scene's point.
#[test]
fn another_point_of_a_turn_moves_no_wall() {
    let folder = tempfile::tempdir().unwrap();
    let file = square(folder.path());
    let swinging = on_floor("", "", "friction = 0.3") + SWINGING;
    let shifted = swinging.split("[[motion]]\nwalls = [\"floor\"]\nabout").next().unwrap();
    let turning = on_floor("rotation = { about = [0, 0, 0], axis = [0, 1, 0], rate = 2 }", "", "");
    let elsewhere = swinging.replace("about = [0.02, 0, 0]", "about = [0.05, 0, 0.01]");
    let mut comm = Alone::default();
    let corners = |wall: &Wall| -> Vec<Vec3> {
        let seen = |place: Vec3| wall.point + wall.orientation * place;
        if let Some(mesh) = &wall.mesh {
            return mesh.surface.triangles().flatten().map(seen).collect();
        }
        let (point, normal) = wall.surface();
        let places = [Vec3::zeros(), Vec3::x() * 0.1, Vec3::y() * 0.1];
        places.map(|place| normal * (place - point).dot(&normal)).to_vec()
    };
    let of_triangles = |text: &str| {
        text.replace("point = [0, 0, 0]\nnormal = [0, 0, 1]", &format!("mesh = {file:?}"))
    };
    for (before, after, how) in [
        (swinging.as_str(), elsewhere.as_str(), Continuation::SameStage),
        (shifted, turning.as_str(), Continuation::NewStage),
    ] {
        for is_mesh in [false, true] {
            let of = |text: &str| if is_mesh { of_triangles(text) } else { text.to_owned() };
            let (before, after) = (scene(&of(before)), scene(&of(after)));
            let mut sim = begun(&before, &mut comm);
            (0..100).for_each(|_| sim.step(&mut comm).unwrap());
            save(&sim, folder.path(), &before, &mut comm);
            let stood = corners(&sim.particles.walls[0]);
            let mut sim = assemble::assemble(&after, &comm);
            assemble::take_up(&mut sim, &after, folder.path(), how, &mut comm).unwrap();
            if how == Continuation::NewStage {
                sim.begin(&mut comm).unwrap();
            }
            sim.step(&mut comm).unwrap();
            let wall = &sim.particles.walls[0];
            // At most 0.2 m/s and 8 rad/s, in a step of 1e-5 s.
            for (now, then) in corners(wall).iter().zip(&stood) {
                assert!((now - then).norm() < 1e-5 * (0.2 + 8.0 * 0.2), "{now:?} {then:?}");
            }
            if how == Continuation::NewStage {
                assert_eq!(wall.point, Vec3::zeros());
            }
        }
    }
}

/// A rotation that begins within a stage is about the scene's point, for triangles, too. A wall that was rotated cannot become free.
#[test]
fn a_turn_may_begin_within_a_stage() {
    let folder = tempfile::tempdir().unwrap();
    let file = square(folder.path());
    let still = on_floor("", "", "friction = 0.3");
    let mesh = still.replace("point = [0, 0, 0]\nnormal = [0, 0, 1]", &format!("mesh = {file:?}"));
    let turn = "rotation = { about = [0.05, 0, 0], axis = [0, 1, 0], rate = 2 }";
    for text in [still, mesh] {
        let (first, mut comm) = (scene(&text), Alone::default());
        let mut sim = begun(&first, &mut comm);
        (0..100).for_each(|_| sim.step(&mut comm).unwrap());
        save(&sim, folder.path(), &first, &mut comm);
        let turning = scene(&text.replace("[[material]]", &format!("{turn}\n[[material]]")));
        let mut sim = assemble::assemble(&turning, &comm);
        let same = Continuation::SameStage;
        assemble::take_up(&mut sim, &turning, folder.path(), same, &mut comm).unwrap();
        (0..500).for_each(|_| sim.step(&mut comm).unwrap());
        let wall = &sim.particles.walls[0];
        // The axis stays in place, and the initial origin has moved up or down.
        let seen = |place: Vec3| wall.orientation.inverse() * (place - wall.point);
        let corner = wall.mesh.as_ref().map(|mesh| mesh.surface.triangles().next().unwrap()[0]);
        let angle = 2.0 * 500.0 * 1e-5;
        assert!((wall.orientation.angle() - angle).abs() < 1e-12);
        match corner {
            None => assert!(seen(Vec3::new(0.05, 0.0, 0.0)).z.abs() < 1e-15, "{wall:?}"),
            Some(corner) => {
                let now = wall.point + wall.orientation * corner;
                let was =
                    first.walls[0].mesh.as_ref().unwrap().surface.triangles().next().unwrap()[0];
                let was = first.walls[0].point + was;
                let about = Vec3::new(0.05, 0.0, 0.0);
                let expected = about + wall.orientation * (was - about);
                assert!((now - expected).norm() < 1e-14, "{now} {expected}");
            }
        }
        save(&sim, folder.path(), &turning, &mut comm);
        let free =
            text.clone() + "[[motion]]\nwalls = [\"floor\"]\nalong = [0, 0, 1]\nmass = 0.1\n";
        let free = scene(&free);
        let mut sim = assemble::assemble(&free, &comm);
        let refused =
            assemble::take_up(&mut sim, &free, folder.path(), Continuation::NewStage, &mut comm);
        let refused = refused.unwrap_err().to_string();
        assert!(refused.contains("wall \"floor\" is turned"), "{refused}");
    }
}

/// A plane with another normal is another wall. A wall left tilted cannot have a servo, nor can one beside it.
#[test]
fn a_wall_that_a_stage_left_otherwise_is_told() {
    let text = |motion: &str, servo: &str, side: &str| {
        format!(
            "[domain]\nlow = [0, 0, 0]\nhigh = [0.2, 0.2, 0.2]\nperiodic = [false, true, false]\nwalls = [\"-x\", \"-z\", \"+z\"]\n\
             [[wall]]\nname = \"side\"\n{side}\n[[material]]\nname = \"glass\"\ndensity = 2500\nnormal_stiffness = 1e6\n\
             [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = {RADIUS:?}\n[[fill.lattice]]\nfirst = [0.1, 0.1, 0.1]\ncount = [1, 1, 1]\n\
             {motion}\n{servo}\n[time]\nstep = 1e-5\nsteps = 1\n[output]\ndirectory = \"out\"\n"
        )
    };
    let upright = "point = [0.2, 0, 0]\nnormal = [-1, 0, 0]";
    let turn = "[[motion]]\nwalls = [\"side\"]\nabout = [0.2, 0, 0]\naxis = [0, 1, 0]\namplitude = 3\nfrequency = 10\n";
    let first = scene(&text(turn, "", upright));
    let mut comm = Alone::default();
    let mut sim = begun(&first, &mut comm);
    (0..100).for_each(|_| sim.step(&mut comm).unwrap());
    let folder = tempfile::tempdir().unwrap();
    save(&sim, folder.path(), &first, &mut comm);
    let taken = |next: &Scene| {
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(next, &comm);
        let taken =
            assemble::take_up(&mut sim, next, folder.path(), Continuation::NewStage, &mut comm);
        (taken, sim.particles.walls.iter().map(Wall::surface).collect::<Vec<_>>())
    };
    for wall in ["side", "+z"] {
        let servo = format!("[[servo]]\nwalls = [\"{wall}\"]\nstress = 1e4\n");
        let error = taken(&scene(&text("", &servo, upright))).0.unwrap_err().to_string();
        assert!(
            error.contains(&format!("wall \"{wall}\", or an adjacent one, is tilted")),
            "{error}"
        );
    }
    // A wall that was upright until then.
    let plain = scene(&text("", "", upright));
    save(&begun(&plain, &mut comm), folder.path(), &plain, &mut comm);
    let hinged = scene(&text("", "", "point = [0.15, 0, 0]\nnormal = [-1, 0, 0.5]"));
    let (found, surfaces) = taken(&hinged);
    assert_eq!(found.unwrap().other_walls, ["side"]);
    assert!(surfaces.contains(&hinged.walls.last().unwrap().surface()), "{surfaces:?}");
}

/// A surface of triangles may be slow enough in its velocity and its rotation alone, but too fast in both together.
#[test]
fn velocity_and_turn_count_together() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plate.obj");
    std::fs::write(&file, "v -0.1 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n").unwrap();
    let text = on_floor(
        "velocity = [0, 0, 60]\nrotation = { about = [0, 0, 0], axis = [0, 0, 1], rate = 600 }",
        "",
        "",
    )
    .replace("point = [0, 0, 0]\nnormal = [0, 0, 1]", &format!("mesh = {file:?}"));
    expect_refused(
        &text,
        "rate = 600 ",
        "rate = 601 ",
        "with `velocity` it moves the wall by up to",
    );
    scene(&text.replace("velocity = [0, 0, 60]\n", ""));
    scene(&text.replace("rate = 600", "rate = 1"));
}

/// An oscillation too fast for the time step gives a warning.
#[test]
fn steps_that_do_not_follow_are_told() {
    let text = on_floor("", "", "") + SWINGING;
    let swinging = scene(&text);
    assert_eq!(doubts(&swinging), Vec::<String>::new());
    // It begins nearly at rest: the cosine of 90 degrees is 6e-17.
    let from_rest = "[[motion]]\nwalls = [\"floor\"]\nalong = [0, 0, 1]\namplitude = 1e-3\nfrequency = 5\nphase = -90\n";
    let at_rest = scene(&(on_floor("", "", "") + from_rest));
    assert!(at_rest.walls[0].velocity != Vec3::zeros());
    assert_eq!(doubts(&at_rest), Vec::<String>::new());
    let page = plan(&swinging, 1);
    let told = "floor: 0.001 m along [0, 0, 1] at 5 1/s, at most 3.142e-2 m/s";
    assert!(page.contains(told), "{page}");
    let fast = text.replace("amplitude = 1e-3\nfrequency = 5", "amplitude = 1e-9\nfrequency = 1e4");
    let doubts = doubts(&scene(&fast));
    assert!(matches!(&doubts[..], [doubt] if doubt.contains("once in 10.0 steps")), "{doubts:?}");
}

/// A ball at rest does not end its stage before the tables of all walls have ended, nor before the time in `[stop]`. The motion of the table
/// begins after 0.05 s.
#[test]
fn a_stage_waits_for_tables_and_its_time() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("late.csv");
    std::fs::write(&table, "time_s,displacement_m\n0,0\n0.05,0\n0.07,0.001\n").unwrap();
    let lid = "[[wall]]\nname = \"lid\"\npoint = [0, 0, 0.1]\nnormal = [0, 0, -1]\n";
    let motion = format!("[[motion]]\nwalls = [\"lid\"]\nalong = [0, 0, 1]\ntable = {table:?}\n");
    let ended = |more: &str, steps: u64| {
        let text = on_floor("", "", "restitution = 0.2")
            .replace("first = [0, 0, 0.05]", "first = [0, 0, 0.01]")
            .replace("steps = 1\n", &format!("steps = {steps}\n"));
        let scene = scene(&format!("{text}{lid}{more}"));
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(&scene, &comm);
        assemble::fill(&mut sim, &scene, &comm);
        let schedule = schedule(&scene, scene.steps, folder.path());
        let finish = run(&mut sim, &schedule, &mut comm, &mut |_| ()).unwrap();
        (finish.ending, finish.steps_done, finish.unmet)
    };
    let stop = "[stop]\nunbalanced = 0.01\n";
    let met = |steps: u64| (Ending::Rest, steps, String::new());
    let (ending, at_rest, _) = ended(stop, 20_000);
    assert!(ending == Ending::Rest && at_rest < 3000, "{at_rest}");
    assert_eq!(ended(&format!("{motion}{stop}"), 20_000), met(7000));
    assert_eq!(ended(&format!("{stop}after = 0.06\n"), 20_000), met(6000));
    let (ending, _, unmet) = ended(&format!("{motion}{stop}after = 0.065\n"), 6000);
    assert_eq!(ending, Ending::LastStep);
    assert_eq!(
        unmet,
        "the stage has lasted 6.000e-2 s, not 0.065 s; wall \"lid\" follows its table until 0.07 s"
    );
    // A stage that ends by remaining particles does not wait for its walls.
    let outlet = "[[outlet]]\nname = \"out\"\npoint = [0, 0, 0.15]\nnormal = [0, 0, -1]\n[stop]\nremaining = 1\n";
    assert_eq!(ended(&format!("{motion}{outlet}"), 20_000), met(100));
}

/// Vectors of an array of doubles in a VTP file.
fn vectors(file: &str, name: &str) -> Vec<Vec3> {
    let (_, rest) =
        file.split_once(&format!("<DataArray type=\"Float64\" Name=\"{name}\"")).unwrap();
    let (_, rest) = rest.split_once('>').unwrap();
    let (text, _) = rest.split_once('<').unwrap();
    // The number of bytes precedes them.
    let bytes = STANDARD.decode(text).unwrap().split_off(8);
    let numbers: Vec<f64> = bytes.as_chunks().0.iter().copied().map(f64::from_le_bytes).collect();
    numbers.as_chunks().0.iter().copied().map(Vec3::from).collect()
}

/// An exported polygon has the velocity of its middle: for a rotating drum, the rate times the distance from its axis. The force is that on the
/// whole wall, and its name says so.
#[test]
fn exported_walls_have_the_velocity_of_each_polygon() {
    let (about, rate) = (Vec3::new(0.02, 0.0, 0.01), 3.0);
    let floor = "velocity = [0, 0, -0.05]\nrotation = { about = [0.01, 0.02, 0], axis = [1, 0, 0], rate = -0.2 }";
    let drum = "[[wall]]\nname = \"drum\"\nrotation = { about = [0.02, 0, 0.01], axis = [0, 1, 0], rate = 3 }\n\
                cylinder = { from = [0.02, -0.05, 0.01], to = [0.02, 0.05, 0.01], radius = 0.1 }\n";
    let scene = scene(&(on_floor(floor, "", "") + drum));
    let start = Vec3::new(0.0, 0.0, 0.998 * RADIUS);
    let mut bench = Bench::of(&scene, &[ball(0, 0, start, Vec3::zeros())]);
    let steps = 5;
    (0..steps).for_each(|_| bench.step());
    let folder = tempfile::tempdir().unwrap();
    save(&bench.sim, folder.path(), &scene, &mut Alone::default());
    let reader = Reader::open(folder.path()).unwrap();
    let walls = export::walls(&reader).unwrap();
    let mut file = Vec::new();
    walls.write(&mut file).unwrap();
    let file = String::from_utf8(file).unwrap();
    let [points, velocities, forces] =
        ["Points", "velocity", "wall_force"].map(|name| vectors(&file, name));
    // A square of the floor, and the triangles of the drum.
    assert!(walls.ends.len() > 100 && velocities.len() == walls.ends.len());
    assert!(reader.header().walls[0].force.z < 0.0, "the ball lies on the floor");
    let begins = std::iter::once(0).chain(walls.ends.iter().copied());
    for (k, (begin, &end)) in begins.zip(&walls.ends).enumerate() {
        let corners = &walls.members[begin as usize..end as usize];
        let sum: Vec3 = corners.iter().map(|&corner| points[corner as usize]).sum();
        let middle = sum / corners.len() as f64;
        assert_eq!(forces[k], reader.header().walls[usize::from(k > 0)].force);
        if k > 0 {
            let arm = middle - about;
            let distance = libm::hypot(arm.x, arm.z);
            assert!((0.09..0.1).contains(&distance), "{distance}");
            assert!((velocities[k].norm() - rate * distance).abs() < 1e-12 * rate * distance);
            assert!(velocities[k].dot(&arm).abs() < 1e-12 && velocities[k].y == 0.0);
            continue;
        }
        let fall = Vec3::new(0.0, 0.0, -0.05);
        let reference = Vec3::new(0.01, 0.02, 0.0) + fall * (f64::from(steps) * 1e-5);
        let expected = fall + Vec3::new(-0.2, 0.0, 0.0).cross(&(middle - reference));
        assert!((velocities[0] - expected).norm() < 1e-12, "{} {expected}", velocities[0]);
        assert!((velocities[0] - fall).norm() > 1e-3);
    }
}
