//! Rotating walls: balls on turntables and on rods, a drum of four planes, energy, identical bits.

use crate::support::{Bench, MATERIAL, OnRanks, State, begun, save, scene};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::threads;
use dem_mpi::ids::{GlobalId, MaterialId, ShapeId};
use dem_mpi::law::Body;
use dem_mpi::law::kernel::reduced_mass;
use dem_mpi::math::{Vec3, rotation_about};
use dem_mpi::measure::Measures;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::particles::records::Particle;
use dem_mpi::population::Library;
use dem_mpi::scene::assemble::{self, Continuation};
use dem_mpi::scene::{Scene, plan::plan};
use dem_mpi::shape::{Shape, Sphere};
use dem_mpi::walls::Wall;
use std::f64::consts::TAU;

const RADIUS: f64 = 0.01;
const STIFFNESS: f64 = 1e6;

/// Scene of one ball above a wall.
fn ball(gravity: f64, friction: f64, wall: &str, dt: f64) -> String {
    format!(
        r#"
gravity = [0, 0, {gravity:?}]
[domain]
low = [-0.2, -0.2, -0.2]
high = [0.2, 0.2, 0.2]
[[wall]]
name = "table"
{wall}
[[material]]
name = "glass"
density = 2500
normal_stiffness = {STIFFNESS:?}
friction = {friction:?}
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS:?}
[time]
step = {dt:?}
"#
    )
}

fn at(position: Vec3, velocity: Vec3, angular_velocity: Vec3) -> Particle {
    let at_rest = Particle::at_rest(GlobalId(0), ShapeId(0), position);
    Particle { velocity, angular_velocity, ..at_rest }
}

/// A ball that rolls on a turntable moves on a circle at 2/7 of its rate, about any centre (Weltner 1979, DOI
/// 10.1119/1.11602). The rate of the table enters only through the velocity at the contact.
#[test]
fn a_ball_on_a_turntable_goes_round_at_two_sevenths_of_its_rate() {
    let (table, dt) = (20.0, 1e-5);
    let about = Vec3::new(0.03, -0.02, 0.0);
    let wall = format!(
        "point = [0.1, 0.1, 0]\nnormal = [0, 0, 1]\nrotation = {{ about = [{}, {}, 0], axis = [0, 0, 2], rate = {table} }}",
        about.x, about.y
    );
    let scene = scene(&ball(-9.81, 1.0, &wall, dt));
    let pressed = scene.library.mass[0] * 9.81 / STIFFNESS;
    let rate = 2.0 / 7.0 * table;
    let centre = Vec3::new(0.05, 0.02, RADIUS - pressed);
    let arm = Vec3::new(-0.03, 0.01, 0.0);
    let velocity = (Vec3::z() * rate).cross(&arm);
    let start = centre + arm;
    // Rolling: v - ω × (a z) = Ω × r.
    let slip = (velocity - (Vec3::z() * table).cross(&(start - about))) / (RADIUS - 0.5 * pressed);
    let mut bench = Bench::of(&scene, &[at(start, velocity, Vec3::z().cross(&slip))]);
    let steps = (TAU / rate / dt).round() as u64;
    let mut worst: f64 = 0.0;
    for step in 1..=steps {
        bench.step();
        let angle = rate * step as f64 * dt;
        let expected = centre + rotation_about(&Vec3::z(), angle) * arm;
        worst = worst.max((bench.sim.particles.position[0] - expected).norm() / arm.norm());
    }
    println!("off the circle by {worst:e} of its radius in a turn");
    assert!(worst < 1e-4, "{worst}");
}

/// A ball that leaves the axis along a rotating rod as `r = L e^Ωt`, without friction: the work of the rod is its kinetic
/// energy.
fn on_a_rod(dt: f64) -> (Vec3, Vec3, f64, Measures) {
    let (rate, length) = (5.0, 0.04);
    let wall = format!(
        "point = [0.02, 0, 0]\nnormal = [0, 0, 1]\nrotation = {{ about = [0, 0, 0], axis = [0, -1, 0], rate = {rate} }}"
    );
    let scene = scene(&ball(0.0, 0.0, &wall, dt));
    let mass = scene.library.mass[0];
    // The force N = m Ω² (2r - h) is compressive and grows with the distance.
    let height = RADIUS - mass * rate * rate * (2.0 * length - RADIUS) / STIFFNESS;
    let velocity = |r: f64| Vec3::new(rate * (r - height), 0.0, rate * r);
    let start = at(Vec3::new(length, 0.0, height), velocity(length), Vec3::zeros());
    let mut bench = Bench::of(&scene, &[start]);
    let steps = (1.0 / rate / dt).round() as u64;
    for _ in 0..steps {
        bench.step();
    }
    let r = length * 1f64.exp();
    let to_world = rotation_about(&-Vec3::y(), 1.0);
    let position = to_world * Vec3::new(r, 0.0, height);
    let given = 0.5 * mass * (velocity(r).norm_squared() - velocity(length).norm_squared());
    let measures = bench.measure();
    let started = 0.5 * mass * velocity(length).norm_squared();
    let off = bench.sim.particles.position[0] - position;
    (off, position, (measures.received - started) / given - 1.0, measures)
}

#[test]
fn a_turning_rod_gives_a_ball_its_energy() {
    let (off, position, energy, measures) = on_a_rod(1e-5);
    println!("off its place by {:e}, energy given off by {energy:e}", off.norm() / position.norm());
    assert!(off.norm() < 2e-4 * position.norm(), "{off:?}");
    assert!(energy.abs() < 5e-4, "{energy}");
    assert!(measures.dissipated == 0.0 && measures.contacts + measures.wall_contacts == 1);
    // The balance closes to second order in the step.
    let missing = |dt: f64| {
        let (.., measures) = on_a_rod(dt);
        measures.missing() / measures.kinetic()
    };
    let [long, short] = [missing(2e-5), missing(5e-6)];
    println!("missing {long:e} and {short:e} of the kinetic energy");
    assert!(long.abs() < 1e-6 && short.abs() < 0.2 * long.abs(), "{long:e} {short:e}");
}

/// Without friction, a wall that rotates in its own plane equals one at rest to the last bit.
#[test]
fn what_turns_in_its_own_plane_does_not_show_without_friction() {
    let path = |rotation: &str| {
        let wall = format!("point = [0, 0, 0]\nnormal = [0, 0, 1]{rotation}");
        let start = at(Vec3::new(0.03, 0.02, 0.012), Vec3::new(0.1, 0.0, -0.2), Vec3::zeros());
        let mut bench = Bench::new(&ball(-9.81, 0.0, &wall, 1e-5), &[start]);
        (0..4000).for_each(|_| bench.step());
        assert!(bench.sim.particles.velocity[0].z.abs() > 0.01);
        let bits = bench.sim.particles.position[0].map(f64::to_bits);
        (bits, bench.measure().received, bench.sim.domain.traffic.rebuilds)
    };
    let turning = "\nrotation = { about = [0.1, 0, 0], axis = [0, 0, 1], rate = 50 }";
    assert_eq!(path(turning), path(""));
}

/// Four planes that rotate about y.
const DRUM: &str = r#"
gravity = [0, 0, -9.81]
[domain]
low = [-0.02, 0, -0.02]
high = [0.02, 0.01, 0.02]
periodic = [false, true, false]
[[wall]]
name = "drum"
planes = [
    { point = [-0.012, 0, 0], normal = [1, 0, 0] },
    { point = [0.012, 0, 0], normal = [-1, 0, 0] },
    { point = [0, 0, -0.012], normal = [0, 0, 1] },
    { point = [0, 0, 0.012], normal = [0, 0, -1] },
]
rotation = { about = [0, 0, 0], axis = [0, 1, 0], rate = 30 }
[time]
step = 1e-5
steps = 6000
[neighbours]
imbalance = 1.05
"#;

/// Ellipsoids and spheres of one size each.
const EQUAL: &str = r#"
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
"#;

/// Particles of three kinds, whose sizes are distributed uniformly from 0.7 to 1.3 of their mean.
const SIZED: &str = r#"
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.0008
size = { uniform = [0.7, 1.3] }
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.0012, 0.0006, 0.0006]
size = { uniform = [0.7, 1.3] }
[[shape]]
name = "brick"
kind = "superellipsoid"
semi_axes = [0.0009, 0.0008, 0.0007]
exponents = [0.6, 0.8]
size = { uniform = [0.7, 1.3] }
[[fill.lattice]]
shapes = ["ball", "egg", "brick"]
first = [-0.0104, 0.0016, -0.0104]
count = [7, 3, 7]
spacing = 0.0032
"#;

fn drum_text(grains: &str) -> String {
    format!("{DRUM}{MATERIAL}{grains}")
}

fn drum() -> Scene {
    scene(&drum_text(EQUAL))
}

/// State after these steps on one rank. Checks that it is identical on others and after a restart, whose snapshot has the
/// wall.
pub(crate) fn the_same_on_any_ranks(scene: &Scene, steps: u64) -> State {
    let folder = tempfile::tempdir().unwrap();
    let alone = OnRanks::of(scene).the_same_everywhere(steps, folder.path());
    let header = Reader::open(folder.path()).unwrap().header().clone();
    assert_eq!(header.walls.len(), 1);
    assert!(header.walls[0].body.is_some());
    alone
}

#[test]
fn a_drum_has_the_same_bits_on_any_number_of_ranks_and_across_a_restart() {
    let state = the_same_on_any_ranks(&drum(), 4000);
    assert!(state.bits.len() > 200, "{}", state.bits.len());
}

/// Sizes by column with rotating walls: identical bits, and the energy balance of all contacts.
#[test]
fn a_drum_of_sizes_has_the_same_bits_on_any_number_of_ranks_and_loses_no_energy() {
    // Softer material, as the smallest particles limit the stable step.
    let text = drum_text(SIZED).replace("normal_stiffness = 1.5e5", "normal_stiffness = 1.5e4");
    let scene =
        scene(&text.replace("rate = 30", "rate = 20").replace("step = 1e-5", "step = 5e-6"));
    assert!(scene.needs().scale);
    let state = the_same_on_any_ranks(&scene, 16_000);
    assert_eq!(state.bits.len(), 147);
    let [contacts, on_walls] = ["contacts", "wall_contacts"].map(|name| state.number(name));
    let [dissipated, received, missing] =
        ["dissipated", "received", "missing"].map(|name| state.number(name));
    println!("{contacts} contacts, {on_walls} on walls; received {received:e} J");
    println!("dissipated {dissipated:e} J, missing {missing:e} J");
    assert!(contacts > 20.0 && on_walls > 20.0 && received > 0.0);
    assert!(missing.abs() < 2e-3 * dissipated, "{missing:e} of {dissipated:e}");
}

/// The motion of a facet towards particles counts everywhere, so the skin does not change the results.
#[test]
fn the_skin_does_not_show_in_a_drum() {
    let scene = drum();
    let usual = OnRanks::of(&scene).run(1, 3000);
    for factor in [0.3, 4.0] {
        let other = Scene { skin: factor * scene.skin, ..scene.clone() };
        assert!(usual == OnRanks::of(&other).run(1, 3000), "{factor} skins");
    }
}

/// The drum lifts particles and dissipates energy in them; its work supplies that energy.
#[test]
fn a_drum_gives_what_its_grains_lose() {
    let text = drum_text(EQUAL);
    let missing = |dt: f64| {
        let scene = scene(&text.replace("step = 1e-5", &format!("step = {dt:?}")));
        let mut comm = Alone::default();
        let mut sim = begun(&scene, &mut comm);
        let before = sim.measure(&mut comm);
        (0..(0.05 / dt).round() as u64).for_each(|_| sim.step(&mut comm).unwrap());
        let after = sim.measure(&mut comm);
        let given = after.received - before.received;
        println!(
            "given {given:e} J, dissipated {:e} J, kinetic {:e} J, missing {:e} J, on walls {}",
            after.dissipated,
            after.kinetic(),
            after.missing(),
            after.wall_contacts
        );
        assert!(after.dissipated > 0.0 && given > 0.2 * after.kinetic());
        assert!(after.wall_contacts > 10);
        after.missing().abs() / given
    };
    let [long, short] = [missing(1e-5), missing(2.5e-6)];
    println!("missing of what is given: {long:e}, {short:e}");
    assert!(long < 1e-2 && short < 0.5 * long, "{long:e} {short:e}");
}

/// A new stage continues from the wall's position, and rotates it about the point of its scene.
#[test]
fn a_wall_keeps_its_place_from_stage_to_stage() {
    let first = drum();
    let folder = tempfile::tempdir().unwrap();
    let text = drum_text(EQUAL);
    let still = scene(&text.replace("rate = 30", "rate = 0"));
    let other = scene(&text.replace("about = [0, 0, 0]", "about = [0.002, 0, 0.001]"));
    threads::run(1, |comm| {
        let mut sim = begun(&first, comm);
        (0..500).for_each(|_| sim.step(comm).unwrap());
        save(&sim, folder.path(), &first, comm);
        let turned = sim.particles.walls[0].clone();
        let expected = rotation_about(&Vec3::y(), 30.0 * (500.0 * 1e-5));
        assert_eq!(turned.orientation, expected, "of the number of steps");
        for (scene, about) in [(&still, Vec3::zeros()), (&other, Vec3::new(0.002, 0.0, 0.001))] {
            let mut sim = assemble::assemble(scene, comm);
            let taken =
                assemble::take_up(&mut sim, scene, folder.path(), Continuation::NewStage, comm)
                    .unwrap();
            let (name, off) = &taken.walls_elsewhere[0];
            assert!(name == "drum" && *off > 1e-3 && *off < 1e-2, "{off}");
            sim.begin(comm).unwrap();
            let wall = &sim.particles.walls[0];
            assert_eq!((wall.point, wall.orientation), (about, expected));
            let (there, normal) = turned.surface();
            let (point, now) = wall.surface();
            assert_eq!(normal, now);
            assert!((there - point).dot(&normal).abs() < 1e-15);
            (0..500).for_each(|_| sim.step(comm).unwrap());
            let turn = if about == Vec3::zeros() { 0.0 } else { 30.0 * (500.0 * 1e-5) };
            let expected = rotation_about(&Vec3::y(), turn) * expected;
            assert_eq!(sim.particles.walls[0].orientation, expected);
        }
    });
}

/// A ball held by friction moves with the table, and so does its spring: relative to the table, it stays.
#[test]
fn what_friction_holds_stays_where_it_is_on_a_turntable() {
    let (table, dt) = (10.0, 2e-5);
    let wall = format!(
        "point = [0, 0, 0]\nnormal = [0, 0, 1]\nrotation = {{ about = [0, 0, 0], axis = [0, 0, 1], rate = {table} }}"
    );
    // Soft, so that the spring is long.
    let text = ball(-9.81, 1.0, &wall, dt);
    let soft = "tangential_stiffness = 1e3\ntangential_damping_ratio = 0.5\n[[shape]]";
    let scene = scene(&text.replace("[[shape]]", soft));
    let mass = scene.library.mass[0];
    let (radius, stretch) = (0.03, mass * table * table * 0.03 / 1e3);
    let turn = Vec3::z() * table;
    let start = Vec3::new(radius, 0.0, RADIUS - mass * 9.81 / STIFFNESS);
    let mut bench = Bench::heavy_to_turn(&scene, &[at(start, turn.cross(&start), turn)]);
    let mut on_table = || {
        let steps = (TAU / table / dt).round() as u64;
        (0..steps).for_each(|_| bench.step());
        let angle = table * bench.sim.step as f64 * dt;
        rotation_about(&Vec3::z(), -angle) * bench.sim.particles.position[0]
    };
    let [first, second, third] = [(); 3].map(|()| on_table());
    let [early, late] = [second - first, third - second].map(|way| way.norm() / stretch);
    println!(
        "the spring is {stretch:e} m long, and the ball slides by {early:e} and {late:e} of that in a turn"
    );
    assert!(((second.xy().norm() - radius) / stretch - 1.0).abs() < 0.01, "{second}");
    assert!(late < 1e-4, "{early} {late}");
}

#[test]
fn a_wall_of_finite_mass_is_one_that_says_so() {
    let mut library = Library { particle_shapes: 1, ..Library::default() };
    let ball = Shape::Sphere(Sphere { radius: 0.01 });
    library.push("ball", ball, MaterialId(0), 2500.0);
    let mut heavy = Wall::plane("heavy".to_owned(), Vec3::zeros(), Vec3::z());
    let mut light = heavy.clone();
    (light.mass, light.free_along) = (3.0 * library.mass[0], -Vec3::z());
    // With a guided direction at 60 degrees from its normal it has four times the effective mass.
    let mut tilted = light.clone();
    tilted.free_along = Vec3::new(0.75_f64.sqrt(), 0.0, 0.5);
    let mut along_itself = light.clone();
    along_itself.free_along = Vec3::y();
    for wall in [&mut heavy, &mut light, &mut tilted, &mut along_itself] {
        wall.enter(&mut library, MaterialId(0));
    }
    let [ball, heavy, light, tilted, along_itself] =
        [0, 1, 2, 3, 4].map(|shape| Body::of(&library, ShapeId(shape), 1.0));
    assert_eq!(reduced_mass(&ball, &heavy), ball.mass);
    assert!((reduced_mass(&ball, &light) / ball.mass - 0.75).abs() < 1e-15);
    assert!((reduced_mass(&ball, &tilted) / ball.mass - 12.0 / 13.0).abs() < 1e-15);
    assert_eq!(reduced_mass(&ball, &along_itself), ball.mass);
}

#[test]
fn a_plan_knows_walls_that_turn() {
    let page = plan(&drum(), 1);
    assert!(page.contains("moving walls    drum"), "{page}");
    assert!(page.contains("motion          drum: rotates at ["), "{page}");
    // Spheres without friction have no moments, but the wall has an angular velocity.
    let wall = "point = [0, 0, 0]\nnormal = [0, 0, 1]\nrotation = { about = [0, 0, 0], axis = [1, 0, 0], rate = 1 }";
    let needs = scene(&ball(0.0, 0.0, wall, 1e-5)).needs();
    assert!(needs.spin && !needs.orientation && !needs.velocity, "{needs:?}");
}
