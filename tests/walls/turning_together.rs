//! Particles that rotate with walls as one body do not slide, for any shape and any contact point. In six turns nothing creeps,
//! and friction creates no energy.

use crate::support::{Bench, scene};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::particles::columns::Quantity;
use dem_mpi::particles::records::Particle;
use nalgebra::{Unit, UnitQuaternion};
use std::f64::consts::TAU;

const RATE: f64 = 20.0;
const STEP: f64 = 5e-6;
const TURNS: u32 = 6;
/// Half the height of a particle on its side [m].
const HALF: f64 = 0.005;

const BALL: &str = "kind = \"sphere\"\nradius = 0.005";
const LENTIL: &str = "kind = \"ellipsoid\"\nsemi_axes = [0.008, 0.008, 0.005]";
const BOX: &str = "kind = \"polyhedron\"\nedges = [0.02, 0.02, 0.01]";
const ROD: &str = "kind = \"spherocylinder\"\nlength = 0.01\nradius = 0.005";

/// Scene of two planes that rotate about the z axis, with particles held between them along their normal, on a line beside the
/// axis.
fn text(shapes: &[&str], normal: Vec3, apart: f64) -> String {
    let shapes: Vec<_> = (0..)
        .zip(shapes)
        .map(|(k, shape)| format!("[[shape]]\nname = \"s{k}\"\n{shape}\n"))
        .collect();
    let shapes = shapes.concat();
    let wall = |name: &str, point: Vec3, normal: Vec3| {
        let [point, normal] = [point, normal].map(|v| format!("[{:e}, {:e}, {:e}]", v.x, v.y, v.z));
        format!(
            "[[wall]]\nname = \"{name}\"\npoint = {point}\nnormal = {normal}\n\
             rotation = {{ about = [0, 0, 0], axis = [0, 0, 1], rate = {RATE} }}\n"
        )
    };
    format!(
        r#"
[law]
rolling = "spring"
[domain]
low = [-1, -1, -1]
high = [1, 1, 1]
{}{}
[[material]]
name = "m"
density = 2500
normal_stiffness = 1e4
friction = 0.8
restitution = 0.3
tangential_damping_ratio = 0.3
rolling_friction = 0.5
{shapes}
[time]
step = {:e}
"#,
        wall("low", Vec3::zeros(), normal),
        wall("high", normal * apart, -normal),
        STEP
    )
}

/// A particle of this shape at a position, rotating about the z axis with the walls, its own z axis along `normal`.
fn turning(bench: &Bench, id: u64, shape: u16, place: Vec3, normal: &Vec3) -> Particle {
    let rate = Vec3::z() * RATE;
    let upright = UnitQuaternion::rotation_between(&Vec3::z(), normal).expect("not opposite");
    let inertia = &bench.sim.particles.library.inertia[usize::from(shape)];
    let own = upright.inverse() * rate;
    Particle {
        velocity: rate.cross(&place),
        angular_velocity: rate,
        angular_momentum: upright * inertia.component_mul(&own),
        quaternion: upright,
        ..Particle::at_rest(GlobalId(id), ShapeId(shape), place)
    }
}

/// Creep of particles against the walls between the first and the sixth turn [m], and decrease of the booked friction loss over
/// the kinetic energy.
fn creep(shapes: &[&str], normal: Vec3, places: &[Vec3], apart: f64) -> (f64, f64) {
    let normal = normal.normalize();
    let scene = scene(&text(shapes, normal, apart));
    let empty = Bench::of(&scene, &[]);
    let grains: Vec<_> = places
        .iter()
        .enumerate()
        .map(|(k, place)| turning(&empty, k as u64, (k % shapes.len()) as u16, *place, &normal))
        .collect();
    let mut bench = Bench::of(&scene, &grains);
    let turn = (TAU / RATE / STEP).round() as u32;
    let mut seen = Vec::new();
    let mut lowest: f64 = 0.0;
    let mut highest = f64::NEG_INFINITY;
    for step in 1..=TURNS * turn {
        bench.step();
        if step % (turn / 4) != 0 || step < turn {
            continue;
        }
        let angle = RATE * STEP * f64::from(step);
        let back = UnitQuaternion::from_axis_angle(&Unit::new_normalize(Vec3::z()), -angle);
        seen.push(
            bench.sim.particles.position[..places.len()]
                .iter()
                .map(|p| back * p)
                .collect::<Vec<_>>(),
        );
        let measured = bench.measure();
        let rubbed = measured.taken_by(Quantity::OfFriction) / measured.kinetic();
        highest = highest.max(rubbed);
        lowest = lowest.min(rubbed - highest);
    }
    let ways = seen[0].iter().zip(seen.last().expect("six turns")).map(|(a, b)| (a - b).norm());
    (ways.fold(0.0, f64::max), -lowest)
}

/// The fall of friction's energy is of first order in the step, and passes to turning: 1.9e-7 of the kinetic energy of two lentils, 9.3e-8
/// at half the step.
fn holds(what: &str, most: f64, (way, fall): (f64, f64)) {
    eprintln!("{what}: {way:.1e} m, {fall:.1e}");
    assert!(way < most, "{what}: creeps by {way:e} m");
    assert!(fall < 3e-7, "{what}: friction has given {fall:e} of the kinetic energy");
}

/// Overlap of each contact under 1 N [m].
const PRESSED: f64 = 1e-4;

#[test]
fn nothing_creeps_on_walls_that_turn() {
    for (name, shapes) in [
        ("ball", &[BALL][..]),
        ("lentil", &[LENTIL]),
        ("box", &[BOX]),
        ("rod", &[ROD]),
        ("ball in a scene with boxes", &[BALL, BOX]),
    ] {
        let at = Vec3::new(0.0, 0.03, HALF - PRESSED);
        holds(name, 1e-8, creep(shapes, Vec3::z(), &[at], 2.0 * (HALF - PRESSED)));
    }
}

/// One particle upon the other beside the axis, with an oblique branch, and boxes shifted against each other.
#[test]
fn nothing_creeps_in_a_bed_that_turns() {
    let normal = Vec3::new(0.3, 0.4, 1.0).normalize();
    let aside = normal.cross(&Vec3::x()).normalize();
    let height = HALF - PRESSED;
    for (name, shapes, shift, most) in [
        ("balls", &[BALL][..], 0.0, 1e-8),
        ("lentils", &[LENTIL], 0.0, 1e-8),
        // Creep of second order: the angular velocity after the rotation, in place of that during it, would give 2e-7 and 6e-7 m.
        ("boxes", &[BOX], 0.0, 1e-9),
        ("boxes aside", &[BOX], 0.008, 1e-9),
        // The ball rolls this far at any step.
        ("a ball on a box", &[BOX, BALL], 0.004, 1e-7),
    ] {
        let low = normal * height + aside * 0.01;
        let high = normal * (3.0 * height) + aside * (0.01 + shift);
        holds(name, most, creep(shapes, normal, &[low, high], 4.0 * height));
    }
}
