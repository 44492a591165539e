//! Spherocylinders side by side or on a plane: force and moment are the gradient of the energy, and they come to rest.

use crate::contact::overlap::Pose;
use crate::support::Frame;
use crate::support::random::Draw;
use dem_mpi::contact::{Posed, Thickness};
use dem_mpi::math::{Mat3, Vec3, rotation_about};
use dem_mpi::random::Random;
use dem_mpi::shape::{HalfSpace, Shape, Spherocylinder};

const SEED: u64 = 20_261_124;

pub(crate) fn rod(length: f64, radius: f64) -> Shape {
    Shape::Spherocylinder(Spherocylinder { length, radius })
}

/// Approximate angles between the axes of a random pose [rad].
const ANGLES: [f64; 4] = [1e-4, 1e-2, 0.1, 1.0];

/// Two spherocylinders, or one and a plane, with an overlap of 0.01 to 10 % of a radius at a given angle.
fn random_pose<'a>(random: &mut Random, shapes: &'a [Shape], plane: bool, angle: f64) -> Pose<'a> {
    let shapes = [&shapes[0], if plane { &shapes[2] } else { &shapes[1] }];
    let frame = random.frame();
    let axis = random.direction();
    let turn = rotation_about(&axis, angle * random.signed()).to_rotation_matrix().into_inner();
    let frames = [frame, turn * frame];
    let overlap = 0.3 * 10.0_f64.powf(random.between(-4.0, -1.0));
    let mut pose = Pose { shapes, frames, scales: [1.0; 2], r: Vec3::zeros() };
    if plane {
        let normal = -(frames[1] * Vec3::z());
        let [a, _] = pose.bodies();
        pose.r = normal * (a.support(&normal).dot(&normal) - overlap);
        return pose;
    }
    // A point along the first, in a direction across both axes.
    let [u, v] = frames.map(|frame| frame.column(0).into_owned());
    let across = u.cross(&if angle > 0.5 { v } else { random.direction() }).normalize();
    let along = u * random.between(-1.5, 1.5);
    let [a, b] = pose.bodies();
    let reach = a.margin() + b.margin();
    let is_apart = |h: f64| Pose { r: along + across * h, ..pose.clone() }.thickness().is_none();
    // Outwards until they are apart, then back by bisection.
    let (mut near, mut far) = (0.05 * reach, 3.0 * reach + 3.0);
    for _ in 0..60 {
        let middle = 0.5 * (near + far);
        if is_apart(middle) { far = middle } else { near = middle }
    }
    pose.r = along + across * (far - overlap);
    pose
}

#[test]
fn force_and_moment_are_the_gradient() {
    let shapes = [rod(2.0, 0.3), rod(1.2, 0.5), plane()];
    let mut random = Random::of(SEED, 1);
    let mut touching = [0; 2];
    for case in 0..4000 {
        let (on_plane, angle) = (case % 2 == 1, ANGLES[case / 2 % 4]);
        let pose = random_pose(&mut random, &shapes, on_plane, angle);
        let Some(found) = pose.thickness() else { continue };
        touching[usize::from(on_plane)] += 1;
        let worst = pose.error_of_gradient(&found);
        assert!(worst < 1e-6, "case {case}: {worst:e} {found:?} {pose:?}", pose = pose.r);
        assert!((0.49..1.0 + 1e-9).contains(&found.gain), "case {case}: {found:?}");
    }
    assert!(touching.iter().all(|&count| count > 1500), "{touching:?}");
}

fn plane() -> Shape {
    Shape::HalfSpace(HalfSpace::at_reference(Vec3::z()))
}

/// A spherocylinder along x, tilted about y, whose lower end overlaps a plane by `depth`.
fn on_plane(shape: &Shape, tilt: f64, depth: f64) -> Thickness {
    let plane = plane();
    let frame = rotation_about(&Vec3::y(), tilt).to_rotation_matrix().into_inner();
    let height = -Posed::new(shape, &frame).support(&-Vec3::z()).z - depth;
    let r = Vec3::new(0.3, -0.2, -height);
    Pose { shapes: [shape, &plane], frames: [frame, Mat3::identity()], scales: [1.0; 2], r }
        .thickness()
        .unwrap()
}

#[test]
fn planes_have_a_spring_under_each_end() {
    let (shape, depth) = (rod(2.0, 0.3), 1e-3);
    for part in [0.0, 0.3, 0.9, 1.0, 1.5, 100.0, 1000.0] {
        // Height difference of the two ends.
        let rise: f64 = part * depth;
        let tilt = (0.5 * rise).asin();
        let other = (depth - rise).max(0.0);
        let found = on_plane(&shape, tilt, depth);
        let squared = 0.5 * (depth * depth + other * other);
        assert!((found.thickness.powi(2) / squared - 1.0).abs() < 1e-12, "{part}: {found:?}");
        let force = 0.5 * (depth + other);
        assert!((found.force() + Vec3::z() * force).norm() < 1e-12 * depth, "{part}: {found:?}");
        let lever = tilt.cos() * 0.5 * (depth - other);
        assert!((found.moment() - Vec3::y() * lever).norm() < 1e-12 * depth, "{part}: {found:?}");
    }
    // Friction resists twisting with a quarter of the length: √3/2 of the radius of gyration.
    let flat = on_plane(&shape, 0.0, depth);
    let radius = flat.covariance.trace().sqrt();
    assert!((radius * 0.75_f64.sqrt() - 0.5).abs() < 1e-12, "{radius}");
}

/// Two spherocylinders at an angle, one above the other, with the given overlap.
fn crossed(shapes: [&Shape; 2], angle: f64, along: f64, depth: f64) -> Thickness {
    let turn = rotation_about(&Vec3::z(), angle).to_rotation_matrix().into_inner();
    let frames = [Mat3::identity(), turn];
    let reach: f64 = shapes.map(Shape::margin).iter().sum();
    Pose { shapes, frames, scales: [1.0; 2], r: Vec3::new(along, 0.0, reach - depth) }
        .thickness()
        .unwrap()
}

#[test]
fn sides_have_their_closed_forms() {
    let (long, short) = (rod(4.0, 0.5), rod(1.0, 0.3));
    let depth = 1e-4;
    // Side by side the thickness is the depth, over a term of the round ends.
    let flat = crossed([&long, &long], 0.0, 0.0, depth);
    assert!((flat.thickness / depth - 1.0).abs() < 1e-12, "{flat:?}");
    assert!((flat.force() - Vec3::z() * depth).norm() < 1e-12 * depth, "{flat:?}");
    // Over half of their lengths the centre of force is in the middle of the common part.
    let half = crossed([&long, &long], 0.0, 2.0, depth);
    assert!((half.point.x - 1.0).abs() < 1e-12 && (half.gain - 1.0).abs() < 0.02, "{half:?}");
    // A parabola, at any angle of crossing.
    for angle in [0.3, 1.0, std::f64::consts::FRAC_PI_2] {
        let found = crossed([&long, &short], angle, 0.0, depth);
        let squared = 24.0 / 35.0 * depth * depth;
        assert!((found.thickness.powi(2) / squared - 1.0).abs() < 2e-3, "{angle}: {found:?}");
        let force = 24.0 / 35.0 * depth;
        assert!((found.force() - Vec3::z() * force).norm() < 2e-3 * depth, "{angle}: {found:?}");
    }
    // Two ends in line have half of the stiffness.
    let frames = [Mat3::identity(); 2];
    let r = Vec3::new(2.5 + 0.8 - depth, 0.0, 0.0);
    let found = Pose { shapes: [&long, &short], frames, scales: [1.0; 2], r }.thickness().unwrap();
    assert!((found.thickness.powi(2) / (0.5 * depth * depth) - 1.0).abs() < 1e-9, "{found:?}");
    // Without length they are balls.
    let balls = [&rod(0.0, 0.5), &rod(0.0, 0.3)];
    let found = crossed(balls, 0.0, 0.0, depth);
    assert!((found.thickness / depth - 1.0).abs() < 1e-11 && (found.gain - 1.0).abs() < 1e-12);
    assert_eq!(found.covariance, Mat3::zeros());
}

/// Neither the order of a pair nor the frame of reference matters, and action equals reaction.
#[test]
fn order_and_frame_do_not_matter() {
    let shapes = [rod(2.0, 0.3), rod(1.2, 0.5), plane()];
    let mut random = Random::of(SEED, 2);
    let mut touching = 0;
    for case in 0..2000 {
        let pose = random_pose(&mut random, &shapes, false, ANGLES[case % 4]);
        let turn = random.frame();
        let Some(one) = pose.thickness() else { continue };
        touching += 1;
        let swapped = pose.swapped();
        let other = swapped.thickness().unwrap();
        assert_eq!(one.thickness.to_bits(), other.thickness.to_bits(), "case {case}");
        assert_eq!(one.force(), -other.force(), "case {case}");
        let about_b = other.moment() + other.force().cross(&-pose.r);
        let tolerance = 1e-10 * one.thickness;
        assert!((one.moment() + about_b).norm() < tolerance, "case {case}: {one:?}");
        let turned =
            Pose { frames: pose.frames.map(|frame| turn * frame), r: turn * pose.r, ..pose };
        let turned = turned.thickness().unwrap();
        assert!((one.thickness - turned.thickness).abs() < tolerance, "case {case}");
        assert!((turn * one.force() - turned.force()).norm() < tolerance, "case {case}");
        assert!((turn * one.moment() - turned.moment()).norm() < tolerance, "case {case}");
        assert!((turn * one.point - turned.point).norm() < 1e-8, "case {case}: {one:?}");
    }
    assert!(touching > 1500, "{touching}");
}
