//! Concave folds: contacts with a face that a particle leaves end without a jump, so the energy error falls with the step.

use crate::support::{Bench, scene};
use crate::walls::meshes::{alone, at, write_obj};
use dem_mpi::ids::GlobalId;
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::particles::records::Particle;
use dem_mpi::random::Random;
use std::path::Path;

const BALL: &str = "kind = \"sphere\"\nradius = 0.01";
const EGG: &str = "kind = \"ellipsoid\"\nsemi_axes = [0.012, 0.009, 0.007]";

/// Writes two planes that meet along y in a fold, each inclined by `slope` [rad], with a strip between them [m].
fn trough(slope: f64, strip: f64, file: &Path) {
    let place = |side: f64, u: f64, v: f64| {
        Vec3::new(side * (0.5 * strip + u * slope.cos()), v, u * slope.sin())
    };
    let mut triangles = Vec::new();
    let mut square = |[a, b, c, d]: [Vec3; 4]| triangles.extend([[a, b, c], [a, c, d]]);
    for side in [-1.0, 1.0] {
        square(
            [(0.0, -0.1), (0.0, 0.1), (0.15, 0.1), (0.15, -0.1)].map(|(u, v)| place(side, u, v)),
        );
    }
    if strip > 0.0 {
        square([(-1.0, -0.1), (-1.0, 0.1), (1.0, 0.1), (1.0, -0.1)].map(|(s, v)| place(s, 0.0, v)));
    }
    write_obj(&triangles, file);
}

/// Relative energy error of a particle without losses after some passages of a fold.
fn lost(shape: &str, wall: &str, slope: f64, dt: f64) -> f64 {
    let text = alone(shape, wall, Vec3::z() * -9.81, 0.0)
        .replace("step = 1e-5", &format!("step = {dt:?}"))
        .replace("normal_stiffness = 1e5", "normal_stiffness = 400");
    // Overlap of 4 % of its radius, beside the fold.
    let height = if shape == BALL { 0.0096 } else { 0.0067 };
    let down = Vec3::new(-slope.sin(), 0.0, slope.cos());
    let place = Vec3::new(slope.cos(), 0.0, slope.sin()) * 0.004 + down * height;
    let turn = Quat::from_axis_angle(&Vec3::y_axis(), -slope);
    let mut bench =
        Bench::of(&scene(&text), &[Particle { quaternion: turn, ..at(place, Vec3::zeros()) }]);
    let energy = |bench: &mut Bench| {
        let m = bench.measure();
        m.kinetic() + m.gravity + m.stored
    };
    let before = energy(&mut bench);
    let stored = bench.measure().stored;
    let mut worst = 0.0_f64;
    let count = (2.0 / dt) as u32;
    for step in 1..=count {
        bench.step();
        if step % (count / 20) == 0 {
            worst = worst.max((energy(&mut bench) - before).abs() / stored);
        }
    }
    worst
}

#[test]
fn energy_is_kept_in_folds_of_any_angle() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trough.obj");
    for (shape, fold, smooth) in [6.0, 9.9, 12.0, 16.0, 25.0]
        .into_iter()
        .map(|fold| (BALL, fold, 10.0))
        .chain([(BALL, 4.0, 0.0), (EGG, 4.0, 0.0), (EGG, 12.0, 10.0), (EGG, 16.0, 10.0)])
    {
        let slope = 0.5 * f64::to_radians(fold);
        trough(slope, 0.0, &file);
        let wall = format!("mesh = \"{}\"\nsmooth = {smooth:?}", file.display());
        let [long, middle, short] = [2e-4, 1e-4, 5e-5].map(|dt| lost(shape, &wall, slope, dt));
        println!("{shape:?}, {fold} degrees, smooth {smooth}: {long:.1e} {middle:.1e} {short:.1e}");
        assert!(
            long < 2e-2 && short < (0.5 * long).max(2e-4) && middle < 2e-2,
            "{fold}: {long:e} {middle:e} {short:e}"
        );
    }
}

/// Relative energy error of nine balls on rough ground, and the warning of the run. The balls jump and roll over random heights of up to `height`
/// [m] at the corners of squares of a quarter of their size.
fn lost_on_ground(
    height: f64,
    seed: u64,
    smooth: f64,
    stiffness: f64,
    steps: u32,
) -> (f64, Option<String>) {
    let folder = tempfile::tempdir().unwrap();
    let (file, side, count) = (folder.path().join("ground.obj"), 0.005, 40);
    let mut random = Random::of(20_261_127, seed);
    let mut heights = vec![[0.0; 41]; 41];
    heights.iter_mut().flatten().for_each(|at| *at = height * random.signed());
    let at_corner = |i: usize, k: usize| {
        Vec3::new(i as f64 - 20.0, k as f64 - 20.0, heights[i][k] / side) * side
    };
    let square = |n: usize| {
        let (i, k) = (n / count, n % count);
        let [a, b, c, d] =
            [(i, k), (i + 1, k), (i + 1, k + 1), (i, k + 1)].map(|(i, k)| at_corner(i, k));
        [[a, b, c], [a, c, d]]
    };
    write_obj(&(0..count * count).flat_map(square).collect(), &file);
    let wall = format!("mesh = \"{}\"\nsmooth = {smooth:?}", file.display());
    let text = alone(BALL, &wall, Vec3::z() * -9.81, 0.0)
        .replace("normal_stiffness = 1e5", &format!("normal_stiffness = {stiffness:e}"));
    let grains: Vec<Particle> = (0..9)
        .map(|k| Particle {
            id: GlobalId(k),
            ..at(
                Vec3::new(0.04 * ((k % 3) as f64 - 1.0), 0.04 * ((k / 3) as f64 - 1.0), 0.014),
                Vec3::new(0.05, 0.02, 0.0),
            )
        })
        .collect();
    let scene = scene(&text);
    let mut bench = Bench::of(&scene, &grains);
    let before = bench.measure();
    let (mut fastest, mut missing) = (0.0_f64, 0.0_f64);
    let mut said = None;
    let limit = scene.time_step_limit().map(|limit| limit.dt);
    for step in 1..=steps {
        bench.step();
        if step % 1000 == 0 {
            let now = bench.measure();
            fastest = fastest.max(now.kinetic());
            let all = now.kinetic() + now.gravity + now.stored;
            missing = missing.max((all - before.kinetic() - before.gravity - before.stored).abs());
            said = now.poor_balance(fastest, bench.sim.dt, limit);
        }
    }
    (missing / fastest, said)
}

/// The slopes of the ground are at most 7 degrees.
#[test]
fn energy_is_kept_on_rough_ground() {
    for seed in 0..3 {
        let (lost, _) = lost_on_ground(3e-4, seed, 10.0, 2e4, 40_000);
        println!("{seed}: {lost:.1e}");
        assert!(lost < 1e-4, "{seed}: {lost:e}");
    }
}

/// A warning suggests a shorter step only where the step causes the energy error.
#[test]
fn a_shorter_step_is_advised_only_where_it_helps() {
    let (lost, said) = lost_on_ground(6e-4, 0, 0.0, 2e3, 60_000);
    println!("{lost:.1e} {said:?}");
    let said = said.expect("a warning");
    assert!(lost > 2e-3 && !said.contains("a step of"), "{said}");
    assert!(said.contains("a shorter step will not help"), "{said}");

    let text = alone(BALL, "point = [0, 0, 0]\nnormal = [0, 0, 1]", Vec3::z() * -9.81, 0.0);
    let limit = scene(&text).time_step_limit().expect("a ball that touches").dt;
    let text = text.replace("step = 1e-5", &format!("step = {:e}", 0.9 * limit));
    let mut bench = Bench::of(&scene(&text), &[at(Vec3::z() * 0.02, Vec3::zeros())]);
    let told = (0..4000).find_map(|_| {
        bench.step();
        bench.measure().poor_balance(1e-3, bench.sim.dt, Some(limit))
    });
    let told = told.expect("a warning");
    assert!(told.contains("a step of"), "{told}");
}

/// With a narrow strip in a fold that counts as one surface, a ball and an ellipsoid have one contact.
#[test]
fn a_narrow_strip_makes_no_second_contact() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trough.obj");
    for (slope, strip) in [(0.5, 1e-7), (2.0, 1e-6), (4.0, 1e-5), (4.0, 2e-4), (4.5, 2e-4)] {
        trough(f64::to_radians(slope), strip, &file);
        for (shape, radius) in [(BALL, 0.01), (EGG, 0.007)] {
            let text = alone(shape, &format!("mesh = {file:?}"), Vec3::zeros(), 0.0);
            for k in -10..=10 {
                let x = 1e-4 * f64::from(k);
                let bench = Bench::of(
                    &scene(&text),
                    &[at(Vec3::new(x, 0.0, 0.99 * radius), Vec3::zeros())],
                );
                assert_eq!(bench.sim.contacts.len(), 1, "{shape} {slope} {strip} {x}");
            }
        }
    }
}
