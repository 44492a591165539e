//! Hertz contacts between shapes with faces and straight sides, which act as spheres of their volume: closed forms, energy, bits.

use crate::law::elliptic::{change_in, meeting, text};
use crate::support::{Bench, OnRanks, ball, close, expect_refused, scene};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::scene::plan::plan;
use std::f64::consts::PI;

const CUBE: &str = "kind = \"polyhedron\"\nvertices = [[-0.001, -0.001, -0.001], [0.001, -0.001, -0.001], \
    [-0.001, 0.001, -0.001], [0.001, 0.001, -0.001], [-0.001, -0.001, 0.001], [0.001, -0.001, 0.001], \
    [-0.001, 0.001, 0.001], [0.001, 0.001, 0.001]]";
const ROUNDED: &str = "kind = \"rounded-polyhedron\"\nradius = 0.0003\nvertices = [[-0.001, -0.0007, -0.0005], \
    [0.001, -0.0007, -0.0005], [-0.001, 0.0007, -0.0005], [0.001, 0.0007, -0.0005], [-0.001, -0.0007, 0.0005], \
    [0.001, -0.0007, 0.0005], [-0.001, 0.0007, 0.0005], [0.001, 0.0007, 0.0005]]";
const ROD: &str = "kind = \"spherocylinder\"\nradius = 0.0008\nlength = 0.0016";

/// A cube that lands on its face, and two that meet face to face: contact time, overlap and restitution of spheres of that volume.
#[test]
fn cubes_that_land_flat_have_their_closed_form() {
    let (half, speed) = (0.001_f64, 0.5);
    let radius = (3.0 * 8.0 / (4.0 * PI)).cbrt() * half;
    let mass = 2500.0 * 8.0 * half.powi(3);
    let modulus = 5e9 / (1.0 - 0.25 * 0.25);
    for (restitution, on_floor) in [(1.0, true), (0.5, true), (1.0, false), (0.5, false)] {
        let share = if on_floor { 1.0 } else { 0.5 };
        let (radius, mass, modulus) = (radius * share, mass * share, modulus * share);
        let overlap = (15.0 * mass * speed * speed / (16.0 * modulus * radius.sqrt())).powf(0.4);
        let time = 2.943_275_2 * overlap / speed;
        let dt = time / 4000.0;
        let scene = scene(&text(CUBE, &format!("restitution = {restitution}"), "", dt));
        let bodies = if on_floor {
            vec![ball(0, 0, Vec3::new(0.0, 0.0, half), Vec3::z() * -speed)]
        } else {
            let one = |id, side: f64| {
                ball(
                    id,
                    0,
                    Vec3::new(0.0, 0.0, 0.05 - side * half),
                    Vec3::z() * (0.5 * side * speed),
                )
            };
            vec![one(0, 1.0), one(1, -1.0)]
        };
        let mut bench = Bench::of(&scene, &bodies);
        let (mut steps, mut deepest) = (0, 0.0_f64);
        let mut before = 0.0;
        loop {
            bench.step();
            steps += 1;
            let now = bench.sim.contacts.iter().map(|(_, geometry)| geometry.overlap).next();
            let Some(now) = now else { break };
            deepest = deepest.max(now);
            before = now;
        }
        let what = format!("restitution {restitution}, on the floor {on_floor}");
        let shares = if on_floor { 1.0 } else { 2.0 };
        let rebound = shares * bench.sim.particles.velocity[bench.slot(0)].z.abs() / speed;
        close(rebound, restitution, 1e-3, &what);
        if restitution == 1.0 {
            let last = before / speed;
            close(dt * f64::from(steps - 1) + last, time, 1e-3, &what);
            close(deepest, overlap, 1e-4, &what);
        }
    }
}

/// Oblique impacts of rotating particles without losses conserve their energy, better with shorter steps.
#[test]
fn oblique_impacts_keep_their_energy() {
    for shape in [CUBE, ROUNDED, ROD] {
        // Corners may miss each other.
        let mut met = 0;
        let of_each = [500.0, 2000.0].map(|steps| {
            let text = text(shape, "", "tangential = \"none\"", 5e-5 / steps);
            let change = |k| {
                let mut bench = meeting(k, shape, 0, &Quat::identity(), 0.7, &text);
                change_in(40 * steps as u32, &mut bench)
            };
            let changes: Vec<_> = (0..24).filter_map(change).collect();
            met = changes.len();
            changes.iter().map(|[gained, _]| gained.abs()).fold(0.0, f64::max)
        });
        assert!(met > 8, "{shape}: {met} met");
        println!("{shape}: energy off by {of_each:?} in 500, 2000 steps");
        assert!(of_each[1] < 1e-4 && of_each[1] < 0.4 * of_each[0], "{shape}: {of_each:?}");
    }
}

/// With friction and dashpots no energy is created, and all losses are booked.
#[test]
fn grazing_impacts_make_no_energy() {
    for shape in [CUBE, ROUNDED, ROD] {
        for contact in ["friction = 0.5", "friction = 0.5\nrestitution = 0.6"] {
            let text = text(shape, contact, "", 5e-5 / 2000.0);
            let change = |k| {
                let slanted = [0.3, 0.9, 1.3, 1.5][k as usize % 4];
                let mut bench = meeting(k, shape, 0, &Quat::identity(), slanted, &text);
                change_in(80_000, &mut bench)
            };
            let changes: Vec<_> = (0..24).filter_map(change).collect();
            assert!(changes.len() > 8, "{shape}: {} met", changes.len());
            let most = |of: fn(&[f64; 2]) -> f64| changes.iter().map(of).fold(f64::MIN, f64::max);
            let (most_gained, most_missing) = (most(|c| c[0]), most(|c| c[1].abs()));
            println!("{shape}, {contact}: gained {most_gained:e}, missing {most_missing:e}");
            assert!(most_gained < 1e-4 && most_missing < 1e-4, "{most_gained:e} {most_missing:e}");
        }
    }
}

/// A spinning cube that bounces on its face: friction over the face takes its spin, and no more energy than it has.
#[test]
fn friction_over_a_face_takes_spin_and_books_it() {
    for contact in ["friction = 0.3", "friction = 0.3\nrestitution = 0.7"] {
        let scene = scene(&text(CUBE, contact, "", 2e-8));
        let spin = Vec3::z() * 200.0;
        let mut cube = ball(0, 0, Vec3::new(0.0, 0.0, 0.001), Vec3::z() * -0.5);
        cube.angular_velocity = spin;
        cube.angular_momentum = Mat3::from_diagonal(&scene.library.inertia[0]) * spin;
        let mut bench = Bench::of(&scene, &[cube]);
        let [gained, missing] = change_in(400_000, &mut bench).expect("it bounces");
        let after = bench.sim.particles.spin.as_ref().expect("it turns").angular_velocity[0].z;
        // Coulomb: normal impulse times friction times the mean distance on the face, 0.77 of its half length.
        let mass = scene.library.mass[0];
        let pushed = mass * (0.5 + bench.sim.particles.velocity[0].z);
        let most = 0.3 * pushed * 0.001 * 0.771 / scene.library.inertia[0].z;
        println!(
            "{contact}: spin {after}, at most {most} taken; gained {gained:e}, missing {missing:e}"
        );
        assert!(after < 200.0 && after > 200.0 - 1.01 * most, "{after} {most}");
        assert!(gained < 0.0 && missing.abs() < 1e-4, "{gained:e} {missing:e}");
    }
}

/// Cubes, rods and balls that fall into each other.
fn crowd() -> String {
    format!(
        r#"
seed = 3
gravity = [0.0, 0.0, -98.1]
[law]
normal = "hertz"
rolling = "spring"
[domain]
low = [0, 0, 0]
high = [0.015, 0.015, 0.03]
periodic = [true, false, false]
walls = ["-y", "+y", "-z"]
[[material]]
name = "m"
density = 2500
youngs_modulus = 1e8
poisson_ratio = 0.3
friction = 0.4
rolling_friction = 0.05
restitution = 0.5
[[shape]]
name = "cube"
{CUBE}
size = {{ uniform = [0.7, 1.2] }}
[[shape]]
name = "rod"
{ROD}
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.0011
[[fill.lattice]]
shapes = {{ cube = 1, rod = 1, ball = 1 }}
spacing = 0.0045
velocity = [0.3, 0.2, -1.5]
[time]
step = 1e-6
"#
    )
}

#[test]
fn a_crowd_has_the_same_bits_everywhere() {
    let scene = scene(&crowd());
    let folder = tempfile::tempdir().unwrap();
    let state = OnRanks::of(&scene).the_same_everywhere(6000, folder.path());
    let [contacts, dissipated, missing] =
        ["contacts", "dissipated", "missing"].map(|name| state.number(name));
    println!("{contacts} contacts, dissipated {dissipated:e}, missing {missing:e} J");
    assert!(contacts > 5.0 && dissipated > 0.0, "{contacts}");
    assert!(missing.abs() < 1e-3 * dissipated, "{missing:e} of {dissipated:e} J");
    let page = plan(&scene, 1);
    for words in ["no radius of curvature", "`cube` of 1.241e-3 m", "of half the shortest axis"] {
        assert!(page.contains(words), "{words}: {page}");
    }
}

#[test]
fn bodies_that_go_by_curvature_are_refused_beside_them() {
    let egg = "kind = \"ellipsoid\"\nsemi_axes = [0.001, 0.001, 0.002]";
    let ball = "kind = \"sphere\"\nradius = 0.0011";
    expect_refused(&crowd(), ball, egg, "sides of `cube`");
}
