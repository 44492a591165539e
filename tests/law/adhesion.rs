//! Attraction after Derjaguin, Muller and Toporov against closed forms: pull-off, impacts without losses, friction.

use crate::support::{Bench, ball, close, expect_refused, scene, schedule, slides_beyond};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::Vec3;
use dem_mpi::scene::assemble;
use dem_mpi::sim::run::{Ending, run};
use std::f64::consts::PI;

const RADIUS: f64 = 1e-4;
const SMALL: f64 = 6e-5;
const DENSITY: f64 = 2500.0;
const SURFACE_ENERGY: f64 = 0.05;
/// Stiffness of the linear springs [N/m].
const STIFFNESS: f64 = 1e4;
/// `E*` of the elastic spheres [Pa].
const MODULUS: f64 = 0.5 * 1e9 / (1.0 - 0.09);

const LINEAR: [&str; 2] = ["", "normal_stiffness = 1e4"];
const HERTZ: [&str; 2] =
    ["normal = \"hertz\"\nlargest_overlap = 0.1", "youngs_modulus = 1e9\npoisson_ratio = 0.3"];

/// Balls of both sizes over the floor z = 0.
fn text(law: [&str; 2], own: &str, down: Vec3, step: f64) -> String {
    format!(
        r#"
gravity = [{:e}, {:e}, {:e}]
[law]
{}
adhesion = "dmt"
[[material]]
name = "m"
density = {DENSITY}
surface_energy = {SURFACE_ENERGY}
{}
{own}
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS}
[[shape]]
name = "small"
kind = "sphere"
radius = {SMALL}
[time]
step = {step:e}
"#,
        down.x, down.y, down.z, law[0], law[1]
    )
}

fn mass(radius: f64) -> f64 {
    DENSITY * 4.0 / 3.0 * PI * radius.powi(3)
}

fn attraction(reduced_radius: f64) -> f64 {
    4.0 * PI * SURFACE_ENERGY * reduced_radius
}

/// Overlap at a given elastic force [m].
fn overlap(law: [&str; 2], force: f64, reduced_radius: f64) -> f64 {
    if law == LINEAR {
        return force / STIFFNESS;
    }
    (0.75 * force / (MODULUS * reduced_radius.sqrt())).powf(2.0 / 3.0)
}

/// A pull of a thousandth less than `2π w R*` holds and of a thousandth more separates, on a floor and at a ball of another
/// size.
#[test]
fn the_pull_off_force_is_that_of_the_theory() {
    for law in [LINEAR, HERTZ] {
        for with_floor in [true, false] {
            let reduced = if with_floor { RADIUS } else { 1.0 / (1.0 / RADIUS + 1.0 / SMALL) };
            let holds = attraction(reduced);
            for (part, stays) in [(0.999, true), (1.001, false)] {
                let pull = part * holds;
                let step = 2e-8;
                let (mut bench, apart) = if with_floor {
                    let down = Vec3::new(0.0, 0.0, pull / mass(RADIUS));
                    let rest = overlap(law, (holds - pull).max(1e-6 * holds), RADIUS);
                    let one = ball(0, 0, Vec3::new(0.0, 0.0, RADIUS - rest), Vec3::zeros());
                    (Bench::new(&text(law, "", down, step), &[one]), None)
                } else {
                    // Both balls turn about their common centre of mass, and their inertia pulls.
                    let rest = overlap(law, (holds - pull).max(1e-6 * holds), reduced);
                    let distance = RADIUS + SMALL - rest;
                    let (m1, m2) = (mass(RADIUS), mass(SMALL));
                    let rate = (pull * (m1 + m2) / (m1 * m2 * distance)).sqrt();
                    let at = |share: f64| Vec3::new(share * distance, 0.0, 0.5);
                    let along = |share: f64| Vec3::y() * (share * distance * rate);
                    let (first, second) = (-m2 / (m1 + m2), m1 / (m1 + m2));
                    let pair = [
                        ball(0, 0, at(first), along(first)),
                        ball(1, 1, at(second), along(second)),
                    ];
                    (Bench::new(&text(law, "", Vec3::zeros(), step), &pair), Some(()))
                };
                for _ in 0..40_000 {
                    bench.step();
                }
                let measures = bench.measure();
                let touching =
                    if apart.is_some() { measures.contacts } else { measures.wall_contacts };
                let what = format!("{} floor {with_floor}, {part} of the force", law[0]);
                assert_eq!(touching == 1, stays, "{what}");
            }
        }
    }
}

/// `1/2 m v² = ∫ N dδ - F_a δ` gives the largest overlap, and the ball rebounds with its speed.
#[test]
fn an_impact_gives_back_what_it_took() {
    let speed = 0.05;
    for law in [LINEAR, HERTZ] {
        let (attraction, kinetic) = (attraction(RADIUS), 0.5 * mass(RADIUS) * speed * speed);
        let surplus = |overlap: f64| {
            let elastic = if law == LINEAR {
                0.5 * STIFFNESS * overlap * overlap
            } else {
                8.0 / 15.0 * MODULUS * RADIUS.sqrt() * overlap.powf(2.5)
            };
            elastic - attraction * overlap - kinetic
        };
        let (mut low, mut high) = (overlap(law, attraction, RADIUS), 0.1 * RADIUS);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if surplus(middle) < 0.0 { low = middle } else { high = middle }
        }
        let start = ball(0, 0, Vec3::new(0.0, 0.0, RADIUS), Vec3::new(0.0, 0.0, -speed));
        let mut bench = Bench::new(&text(law, "", Vec3::zeros(), 5e-10), &[start]);
        let before = bench.measure();
        let mut deepest: f64 = 0.0;
        for _ in 0..400_000 {
            bench.step();
            let height = bench.sim.particles.position[0].z;
            deepest = deepest.max(RADIUS - height);
            if height > RADIUS {
                break;
            }
        }
        close(deepest, low, 1e-4, "largest overlap");
        bench.step();
        let after = bench.measure();
        assert_eq!(after.wall_contacts, 0, "it has left");
        close(after.kinetic(), before.kinetic(), 1e-3, "energy after");
        close(bench.sim.particles.velocity[0].z, speed, 1e-3, "velocity after");
    }
}

/// A slow ball with a dashpot stays in the minimum of the energy. Its kinetic energy and the depth of the minimum are
/// dissipated.
#[test]
fn a_slow_ball_sticks() {
    for law in [LINEAR, HERTZ] {
        let speed = 0.01;
        let start = ball(0, 0, Vec3::new(0.0, 0.0, RADIUS), Vec3::new(0.0, 0.0, -speed));
        let scene = text(law, "restitution = 0.3", Vec3::zeros(), 1e-8);
        let mut bench = Bench::new(&scene, &[start]);
        for _ in 0..100_000 {
            bench.step();
        }
        let rest = RADIUS - bench.sim.particles.position[0].z;
        let expected = overlap(law, attraction(RADIUS), RADIUS);
        close(rest, expected, 1e-6, "overlap at rest");
        let measures = bench.measure();
        assert!(measures.stored < 0.0, "{} J", measures.stored);
        let kinetic = 0.5 * mass(RADIUS) * speed * speed;
        close(measures.dissipated, kinetic - measures.stored, 1e-3, "lost");
        close(measures.of_normal_dashpots(), measures.dissipated, 1e-12, "to dashpots");
    }
}

/// Only adhesion presses the ball on: it slides beyond `μ F_a`, slowed by that force.
#[test]
fn friction_counts_what_adhesion_presses() {
    let friction = 0.4;
    for law in [LINEAR, HERTZ] {
        let limit = friction * attraction(RADIUS) / mass(RADIUS);
        for part in [0.9, 1.5] {
            let along = Vec3::new(part * limit, 0.0, 0.0);
            let own = format!("friction = {friction}\nrestitution = 0.5");
            let rest = overlap(law, attraction(RADIUS), RADIUS);
            let start = ball(0, 0, Vec3::new(0.0, 0.0, RADIUS - rest), Vec3::zeros());
            let scene = scene(&text(law, &own, along, 1e-8));
            slides_beyond(Bench::heavy_to_turn(&scene, &[start]), part, limit, 50_000);
        }
    }
}

/// Keys that the law does not use are rejected, and so are shapes that it does not support.
#[test]
fn keys_and_shapes_of_another_law_are_refused() {
    let good = text(LINEAR, "", Vec3::zeros(), 1e-9);
    scene(&good);
    for (from, to, said) in [
        ("adhesion = \"dmt\"", "", "adhesion = \"dmt\""),
        ("adhesion = \"dmt\"", "adhesion = \"jkr\"", "\"dmt\""),
        (
            "kind = \"sphere\"\nradius = 0.0001",
            "kind = \"ellipsoid\"\nsemi_axes = [1e-4, 1e-4, 2e-4]",
            "`ball` is not a sphere",
        ),
        ("surface_energy = 0.05", "surface_energy = -1", "J/m²"),
    ] {
        expect_refused(&good, from, to, said);
    }
}

/// A chain of balls across a period under tension comes to rest, like one under pressure.
#[test]
fn a_chain_under_tension_can_rest() {
    let (count, overlap) = (4, 1e-9);
    let spacing = 2.0 * RADIUS - overlap;
    assert!(STIFFNESS * overlap < attraction(0.5 * RADIUS));
    let text = format!(
        r#"
[domain]
low = [0, -1e-3, -1e-3]
high = [{period:e}, 1e-3, 1e-3]
periodic = [true, false, false]
[[material]]
name = "dust"
density = {DENSITY:?}
normal_stiffness = {STIFFNESS:?}
restitution = 0.5
surface_energy = {SURFACE_ENERGY:?}
[law]
adhesion = "dmt"
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS:?}
[[fill.lattice]]
first = [{first:e}, 0, 0]
count = [{count}, 1, 1]
spacing = [{spacing:e}, 1, 1]
orientation = "upright"
[time]
step = 1e-8
steps = 1000
[stop]
unbalanced = 0.1
"#,
        period = f64::from(count) * spacing,
        first = 0.5 * spacing,
    );
    let scene = scene(&text);
    let folder = tempfile::tempdir().unwrap();
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    assemble::fill(&mut sim, &scene, &comm);
    let schedule = schedule(&scene, scene.steps, folder.path());
    let finish = run(&mut sim, &schedule, &mut comm, &mut |_| ()).unwrap();
    assert!(finish.measures.mean_normal_force < 0.0, "{:?}", finish.measures);
    assert_eq!((finish.ending, finish.steps_done), (Ending::Rest, 100));
}
