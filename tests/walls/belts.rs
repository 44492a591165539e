//! Conveyor belts: moving surfaces of walls at rest.

use crate::support::{Bench, OnRanks, ball, close, scene, schedule};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::{Quat, Vec3, rotation_about};
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::assemble;
use dem_mpi::scene::doubts::doubts;
use dem_mpi::scene::plan::plan;
use dem_mpi::sim::run::run;
use std::path::Path;

const RADIUS: f64 = 0.01;
const STIFFNESS: f64 = 1e6;

/// Wall text of a sheet of two triangles in a plane of height z, between two corners [m]; writes its file.
fn sheet(folder: &Path, name: &str, low: [f64; 2], high: [f64; 2], z: f64) -> String {
    let ([x, y], [to_x, to_y]) = (low, high);
    let corners =
        format!("v {x} {y} {z}\nv {to_x} {y} {z}\nv {to_x} {to_y} {z}\nv {x} {to_y} {z}\n");
    let path = folder.join(format!("{name}.obj"));
    std::fs::write(&path, corners + "f 1 2 3\nf 1 3 4\n").unwrap();
    format!("mesh = {:?}", path.display().to_string())
}

/// Scene of particles of five kinds on a wall.
fn on_wall(wall: &str, law: &str, own: &str) -> String {
    format!(
        r#"
gravity = [0, 0, -9.81]
[law]
{law}
[domain]
low = [-0.5, -0.5, -0.2]
high = [0.5, 0.5, 0.2]
[[wall]]
name = "belt"
{wall}
[[material]]
name = "glass"
density = 2500
normal_stiffness = {STIFFNESS:?}
{own}
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS:?}
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.012, 0.009, 0.007]
[[shape]]
name = "box"
kind = "polyhedron"
edges = [0.02, 0.016, 0.012]
[[shape]]
name = "rod"
kind = "spherocylinder"
radius = 0.006
length = 0.02
[[shape]]
name = "smooth"
kind = "rounded-polyhedron"
edges = [0.014, 0.012, 0.01]
radius = 0.002
[[fill.lattice]]
first = [0, 0, 0.05]
count = [1, 1, 1]
shapes = ["ball"]
[time]
step = 3e-6
steps = 10000
[output]
directory = "out"
"#
    )
}

const RUBBING: &str = "friction = 0.5\nrestitution = 0.3\ntangential_damping_ratio = 0.1\n\
                       rolling_friction = 0.02\ntwisting_friction = 0.02";
const TURNING: &str = "rolling = \"spring\"\ntwisting = \"spring\"";

/// One particle of each kind, a little above z = 0, tilted and apart.
fn grains() -> Vec<Particle> {
    let tilted = rotation_about(&Vec3::new(0.6, 0.8, 0.0), 0.3);
    let heights = [RADIUS, 0.0105, 0.0125, 0.0095, 0.0118];
    (0..5_u16)
        .map(|k| {
            let place = Vec3::new(0.05 * f64::from(k) - 0.1, 0.03, heights[usize::from(k)]);
            let quaternion = if k == 0 { Quat::identity() } else { tilted };
            Particle { quaternion, ..ball(u64::from(k), k, place, Vec3::new(0.02, -0.05, -0.1)) }
        })
        .collect()
}

/// A belt equals a plane that moves along itself. With the surface velocity of a plane or of triangles, particles of all kinds have the same
/// paths, losses and received energies.
#[test]
fn a_belt_is_a_plane_that_moves_along_itself() {
    let folder = tempfile::tempdir().unwrap();
    let wide = sheet(folder.path(), "wide", [-0.4, -0.4], [0.4, 0.45], 0.0);
    let plane = "point = [0, 0, 0]\nnormal = [0, 0, 1]";
    let texts = [
        format!("{plane}\nvelocity = [0.3, 0.1, 0]"),
        format!("{plane}\nsurface_velocity = [0.3, 0.1, 0]"),
        // The component out of the plane has no effect.
        format!("{plane}\nsurface_velocity = [0.3, 0.1, 0.7]"),
        format!("{wide}\nsurface_velocity = [0.3, 0.1, -0.2]"),
    ];
    for (law, own) in [(TURNING, RUBBING), ("", RUBBING.split("rolling").next().unwrap())] {
        let own = if law.is_empty() { own.trim_end() } else { own };
        let mut runs = texts.each_ref().map(|wall| {
            let scene = scene(&on_wall(wall, law, own));
            let mut bench = Bench::of(&scene, &grains());
            (0..10000).for_each(|_| bench.step());
            bench
        });
        let [first, others @ ..] = &mut runs;
        let expected = first.measure();
        let wall = &first.sim.particles.walls[0];
        let power = wall.power(&expected.wall_forces[0], &Vec3::zeros());
        assert!(power > 1e-3 && expected.received > 1e-4 && expected.dissipated > 1e-4);
        for (bench, text) in others.iter_mut().zip(&texts[1..]) {
            for id in 0..5 {
                let [a, b] = [&first.sim, &bench.sim].map(|sim| {
                    let slot =
                        (0..sim.particles.owned).find(|&k| sim.particles.id[k].0 == id).unwrap();
                    (sim.particles.position[slot], sim.particles.velocity[slot])
                });
                assert!(a.1.x > 0.05, "{id} is not carried: {}", a.1);
                let off = ((a.0 - b.0).norm() / RADIUS, (a.1 - b.1).norm() / 0.3);
                println!("{id}: {off:?}");
                assert!(off.0 < 1e-9 && off.1 < 1e-9, "{text}: {id} {off:?}");
            }
            let found = bench.measure();
            close(found.belt_powers[0], power, 1e-8, "power");
            close(found.received, expected.received, 1e-9, "received");
            close(found.dissipated, expected.dissipated, 1e-9, "dissipated");
            let missing =
                (found.missing() / found.dissipated, expected.missing() / expected.dissipated);
            println!("missing {missing:?}");
            assert!(missing.0.abs() < 2e-3, "{missing:?}");
        }
    }
}

/// A ball on a belt slips under the friction `μ g` and then rolls with 2/7 of the belt's velocity, from the time `2 v / (7 μ g)` on.
#[test]
fn a_ball_on_a_belt_comes_to_roll() {
    let folder = tempfile::tempdir().unwrap();
    let wide = sheet(folder.path(), "wide", [-0.4, -0.4], [0.4, 0.45], 0.0);
    let (speed, friction) = (0.1, 0.5);
    let wall = format!("{wide}\nsurface_velocity = [0, {speed:?}, 0]");
    let own = "friction = 0.5\ntangential_damping_ratio = 0.5";
    let scene = scene(&on_wall(&wall, "", own));
    let weight = scene.library.mass[0] * 9.81;
    let start = Vec3::new(0.0, 0.0, RADIUS - weight / STIFFNESS);
    let mut bench = Bench::of(&scene, &[ball(0, 0, start, Vec3::zeros())]);
    let slips = 2.0 * speed / (7.0 * friction * 9.81);
    let half = (0.5 * slips / scene.dt) as u64;
    (0..half).for_each(|_| bench.step());
    // The spring stretches until the ball slips.
    let velocity = bench.sim.particles.velocity[0];
    close(velocity.y, friction * 9.81 * half as f64 * scene.dt, 5e-3, "slipping");
    (half..6000).for_each(|_| bench.step());
    let velocity = bench.sim.particles.velocity[0];
    close(velocity.y, speed * 2.0 / 7.0, 3e-5, "rolling");
    assert!(velocity.x.abs() < 1e-15 && velocity.z.abs() < 1e-6, "{velocity}");
    assert_eq!(bench.sim.particles.walls[0].point, Vec3::zeros());
}

/// At the end of a belt the velocity out of a contact's plane has no effect. Without friction a ball bounces off the edge like off a belt at rest.
#[test]
fn a_belt_does_not_push_over_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let short = sheet(folder.path(), "short", [-0.1, -0.4], [0.0, 0.4], 0.0);
    let ends = ["", "surface_velocity = [2, 0.5, 0]"].map(|belt| {
        let scene = scene(&on_wall(&format!("{short}\n{belt}"), "", "restitution = 0.6"));
        let start = Vec3::new(0.006, 0.01, 0.0085);
        let mut bench = Bench::of(&scene, &[ball(0, 0, start, Vec3::new(-0.3, 0.0, -0.5))]);
        (0..5000).for_each(|_| bench.step());
        (bench.sim.particles.position[0], bench.sim.particles.velocity[0])
    });
    assert!(ends[0].1.x > 0.1, "it has not met the edge: {ends:?}");
    assert!((ends[0].0 - ends[1].0).norm() < 1e-14, "{ends:?}");
    assert!((ends[0].1 - ends[1].1).norm() < 1e-13, "{ends:?}");
}

/// A wall holds a box back on a belt. The power of the drive is friction times speed and equals the dissipation, also in the history.
#[test]
fn the_power_of_a_belt_is_friction_times_speed() {
    let folder = tempfile::tempdir().unwrap();
    let wide = sheet(folder.path(), "wide", [-0.4, -0.4], [0.4, 0.45], 0.0);
    let wall = format!(
        "{wide}\nsurface_velocity = [0.2, 0, 0]\n[[wall]]\nname = \"stop\"\npoint = [0.0101, 0, 0]\nnormal = [-1, 0, 0]"
    );
    let own = "friction = 0.3\nrestitution = 0.3\ntangential_damping_ratio = 0.2";
    let text = on_wall(&wall, "", own)
        .replace("first = [0, 0, 0.05]", "first = [0, 0, 0.006]")
        .replace("shapes = [\"ball\"]", "shapes = [\"box\"]\norientation = \"upright\"")
        .replace("steps = 10000", "steps = 60000");
    let scene = scene(&text);
    assert!(plan(&scene, 1).contains("belt: 0.2 m/s"), "{}", plan(&scene, 1));
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    assemble::fill(&mut sim, &scene, &comm);
    run(&mut sim, &schedule(&scene, scene.steps, folder.path()), &mut comm, &mut |_| {}).unwrap();
    let history = std::fs::read_to_string(folder.path().join("history.csv")).unwrap();
    let names: Vec<&str> = history.lines().next().unwrap().split(',').collect();
    let column = |name: &str| -> Vec<f64> {
        let k = names.iter().position(|&known| known == name).unwrap_or_else(|| panic!("{name}"));
        history.lines().skip(1).map(|row| row.split(',').nth(k).unwrap().parse().unwrap()).collect()
    };
    // The box also has friction at its side: the belt carries weight and the load at the side.
    let (down, times) = (column("force_belt_z_N"), column("time_s"));
    let (power, received, dissipated) =
        (column("power_belt_W"), column("received_J"), column("dissipated_J"));
    assert!(!names.contains(&"velocity_belt_x_m_per_s") && !names.contains(&"power_stop_W"));
    let [from, to] = [times.len() / 2, times.len() - 1];
    let expected = 0.3 * -down[to] * 0.2;
    close(power[to], expected, 1e-6, "power");
    let passed = times[to] - times[from];
    close((received[to] - received[from]) / passed, expected, 1e-5, "received");
    close((dissipated[to] - dissipated[from]) / passed, expected, 1e-4, "dissipated");
    close(column("force_belt_x_N")[to], 0.3 * down[to], 1e-6, "friction");
}

/// A belt that rotates with its wall carries in the rotated direction.
#[test]
fn a_belt_turns_with_its_wall() {
    let wall = "point = [0, 0, 0]\nnormal = [0, 0, 1]\nsurface_velocity = [0.3, 0, 0]\n\
                rotation = { about = [0, 0, 0], axis = [0, 0, 1], rate = 2 }";
    let scene = scene(&on_wall(wall, "", "friction = 0.5\nrestitution = 0.3"));
    let mut bench = Bench::of(&scene, &grains());
    (0..10000).for_each(|_| bench.step());
    let angle: f64 = 2.0 * 10000.0 * 3e-6;
    let expected = Vec3::new(0.3 * angle.cos(), 0.3 * angle.sin(), 0.0);
    let belt = bench.sim.particles.facets.belts[0];
    assert!((belt - expected).norm() < 1e-12, "{belt} {expected}");
    let of_belts = bench.measure().belt_powers[0];
    assert!(of_belts.abs() > 1e-4, "{of_belts}");
    assert!(bench.measure().missing().abs() < 2e-3 * bench.measure().dissipated);
}

/// Particles of all kinds fall from one belt on another, across a period: identical bits everywhere.
#[test]
fn belts_carry_with_the_same_bits_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    let upper = sheet(folder.path(), "upper", [-0.1, 0.0], [0.02, 0.1], 0.03);
    let lower = sheet(folder.path(), "lower", [-0.1, 0.0], [0.1, 0.1], -0.03);
    let wall = format!(
        "{upper}\nsurface_velocity = [0.8, 0, 0]\n[[wall]]\nname = \"lower\"\n{lower}\nsurface_velocity = [-0.2, 0.6, 0]\nwear = true"
    );
    let text = on_wall(&wall, TURNING, RUBBING)
        .replace(
            "low = [-0.5, -0.5, -0.2]\nhigh = [0.5, 0.5, 0.2]",
            "low = [-0.1, 0, -0.05]\nhigh = [0.1, 0.1, 0.12]\nperiodic = [false, true, false]\nwalls = [\"-x\", \"+x\"]",
        )
        .replace(
            "[[fill.lattice]]\nfirst = [0, 0, 0.05]\ncount = [1, 1, 1]\nshapes = [\"ball\"]",
            "[[fill.lattice]]\nlow = [-0.09, 0, 0.045]\nhigh = [0.09, 0.1, 0.11]\nspacing = 0.03\nvelocity = [0, 0, -0.6]\nshapes = [\"ball\", \"egg\", \"box\", \"rod\", \"smooth\"]",
        )
        .replace("steps = 10000", "steps = 100000\n[neighbours]\nimbalance = 1.05");
    let scene = scene(&text);
    let alone = OnRanks::of(&scene).the_same_everywhere(40_000, folder.path());
    let touching = alone.number("wall_contacts");
    assert!(touching > 5.0 && alone.number("received").abs() > 1e-4, "{touching}");
    let received = alone.number("received") - OnRanks::of(&scene).run(1, 0).number("received");
    close(alone.work_of_walls(), received, 1e-9, "work");
    let (missing, lost) = (alone.number("missing"), alone.number("dissipated"));
    println!("missing {missing:e} J of {lost:e} J");
    assert!(missing.abs() < 5e-3 * lost, "{missing:e} {lost:e}");
}

/// A belt without friction gives a warning.
#[test]
fn a_belt_without_friction_is_doubtful() {
    let wall = "point = [0, 0, 0]\nnormal = [0, 0, 1]\nsurface_velocity = [0.3, 0, 0]";
    let said = |own: &str| {
        let doubts = doubts(&scene(&on_wall(wall, "", own)));
        doubts.iter().any(|doubt| doubt.contains("wall \"belt\" has a `surface_velocity`"))
    };
    assert!(said("friction = 0") && !said("friction = 0.1"));
}
