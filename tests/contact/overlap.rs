//! Common volumes of bodies with faces: cuts stay closed under rounding, and force and moment are the gradient of the
//! energy.

use crate::support::random::Draw;
use crate::support::{Frame, MATERIAL, begun, below, scene};
use benchmarking::solids;
use dem_mpi::comm::alone::Alone;
use dem_mpi::contact::{ContactResolver, Outcome, Overlap, Posed, Thickness, thickness};
use dem_mpi::math::{Mat3, Vec3, rotation_about};
use dem_mpi::random::Random;
use dem_mpi::shape::clip::Clipped;
use dem_mpi::shape::facets::Plane;
use dem_mpi::shape::{HalfSpace, Polyhedron, Shape};
use std::collections::BTreeMap;

const SEED: u64 = 20_261_123;

pub(crate) fn solid(corners: &[Vec3]) -> Shape {
    Shape::Polyhedron(Box::new(Polyhedron::new(corners).expect("a body")))
}

/// A cuboid with these full edges.
pub(crate) fn cuboid(edges: Vec3) -> Shape {
    solid(&solids::cuboid(edges))
}

/// Boxes, a plate, an irregular tetrahedron, an octahedron, an icosahedron.
pub(crate) fn solids() -> Vec<Shape> {
    let octahedron: Vec<Vec3> =
        (0..6).map(|k| Vec3::ith(k / 2, if k % 2 == 0 { 0.7 } else { -0.7 })).collect();
    vec![
        cuboid(Vec3::new(1.0, 0.8, 0.6)),
        cuboid(Vec3::new(1.0, 1.0, 1.0)),
        cuboid(Vec3::new(1.0, 1.0, 0.1)),
        solid(&solids::tetrahedron()),
        solid(&octahedron),
        solid(&solids::icosahedron()),
    ]
}

/// Two bodies in place, the second perhaps a plane.
#[derive(Clone)]
pub(crate) struct Pose<'a> {
    pub(crate) shapes: [&'a Shape; 2],
    pub(crate) frames: [Mat3; 2],
    pub(crate) scales: [f64; 2],
    pub(crate) r: Vec3,
}

impl Pose<'_> {
    pub(crate) fn bodies(&self) -> [Posed<'_>; 2] {
        [0, 1]
            .map(|k| Posed { scale: self.scales[k], ..Posed::new(self.shapes[k], &self.frames[k]) })
    }

    pub(crate) fn thickness(&self) -> Option<Thickness> {
        let [a, b] = self.bodies();
        thickness(&a, &b, &self.r)
    }

    /// `D² / 2`, or 0 if they are apart.
    fn energy(&self) -> f64 {
        self.thickness().map_or(0.0, |found| found.energy())
    }

    /// The pose with B moved.
    fn moved(&self, by: Vec3) -> Self {
        Self { r: self.r + by, ..self.clone() }
    }

    /// The pose with one of the bodies turned about its centre.
    fn turned(&self, body: usize, axis: &Vec3, angle: f64) -> Self {
        let mut turned = self.clone();
        turned.frames[body] =
            rotation_about(axis, angle).to_rotation_matrix() * turned.frames[body];
        turned
    }

    /// Largest difference of force and moment from finite differences of the energy, over the thickness.
    pub(crate) fn error_of_gradient(&self, found: &Thickness) -> f64 {
        let (force, moment) = (found.force(), found.moment());
        let on_b = moment - self.r.cross(&force);
        let step = 1e-4 * found.thickness;
        let mut worst = 0.0_f64;
        for k in 0..3 {
            let axis = Vec3::ith(k, 1.0);
            let by_place = derivative(|h| self.moved(axis * h).energy(), step);
            let by_a = derivative(|h| self.turned(0, &axis, h).energy(), step);
            let by_b = derivative(|h| self.turned(1, &axis, h).energy(), step);
            for error in [by_place + force[k], by_a - moment[k], by_b + on_b[k]] {
                worst = worst.max(error.abs() / found.thickness);
            }
        }
        worst
    }

    /// The pose with the bodies in the other order.
    pub(crate) fn swapped(&self) -> Self {
        let Self { shapes: [a, b], frames, scales, r } = *self;
        Self {
            shapes: [b, a],
            frames: [frames[1], frames[0]],
            scales: [scales[1], scales[0]],
            r: -r,
        }
    }
}

/// Derivative at 0 by central differences of fourth order.
pub(crate) fn derivative(of: impl Fn(f64) -> f64, step: f64) -> f64 {
    let difference = |h: f64| (of(h) - of(-h)) / (2.0 * h);
    (4.0 * difference(step) - difference(2.0 * step)) / 3.0
}

/// Two random bodies with an overlap of 1 to 10 % along a random direction.
fn random_pose<'a>(random: &mut Random, solids: &'a [Shape]) -> Pose<'a> {
    let mut pick = || &solids[below(random, solids.len() as u64) as usize];
    let shapes = [pick(), pick()];
    let frames = [random.frame(), random.frame()];
    let scales = [random.between(0.7, 1.4), random.between(0.7, 1.4)];
    let mut pose = Pose { shapes, frames, scales, r: Vec3::zeros() };
    let direction = random.direction();
    let overlap = random.between(0.01, 0.1);
    let [a, b] = pose.bodies();
    pose.r = a.support(&direction) - b.support(&-direction) - direction * overlap;
    pose
}

/// Tolerance of the gradient by fourth-order differences, over `D`. Steps of 1e-4 `D` leave 1e-10 of rounding. They leave
/// as much where the second derivative jumps, as it does when a vertex passes a plane.
const GRADIENT: f64 = 1e-7;

#[test]
fn force_and_moment_are_the_gradient() {
    let solids = solids();
    let mut random = Random::of(SEED, 1);
    let (mut worst, mut touching) = (0.0_f64, 0);
    for case in 0..2000 {
        let pose = random_pose(&mut random, &solids);
        let Some(found) = pose.thickness() else { continue };
        touching += 1;
        worst = worst.max(pose.error_of_gradient(&found));
        assert!(worst < GRADIENT, "case {case}: {worst:e} {found:?}");
        // The tip of a needle is soft.
        assert!((0.1..1.0 + 1e-9).contains(&found.gain), "case {case}: {found:?}");
    }
    assert!(touching > 1500, "{touching}");
}

/// A body above a plane that it overlaps by `depth`.
fn on_plane(shape: &Shape, frame: Mat3, depth: f64) -> Option<Thickness> {
    let plane = Shape::HalfSpace(HalfSpace::at_reference(Vec3::z()));
    let down = -Vec3::z();
    let height = -Posed::new(shape, &frame).support(&down).z - depth;
    let pose = Pose {
        shapes: [shape, &plane],
        frames: [frame, Mat3::identity()],
        scales: [1.0; 2],
        r: Vec3::new(0.3, -0.2, -height),
    };
    pose.thickness()
}

#[test]
fn faces_edges_and_corners_have_their_closed_forms() {
    let cube = cuboid(Vec3::new(1.0, 1.0, 1.0));
    let depth = 1e-4;
    // A face, tilted about y by θ with this depth in its middle, over terms of the order of (D/L)².
    for part in [0.0, 0.3, 0.9] {
        let angle = part * 2.0 * depth;
        let frame = rotation_about(&Vec3::y(), angle).to_rotation_matrix().into_inner();
        let found = on_plane(&cube, frame, depth + 0.5 * angle.sin()).unwrap();
        let expected = depth * depth + 0.25 * angle * angle;
        assert!((found.thickness.powi(2) / expected - 1.0).abs() < 1e-6, "{part}: {found:?}");
        assert!((found.force() + Vec3::z() * depth).norm() < 2.0 * depth * depth, "{found:?}");
        let moment = found.moment();
        assert!((moment.y - 0.25 * angle).abs() < depth * depth, "{part}: {moment}");
    }
    // An edge with its two faces at 45 degrees has half the stiffness.
    let frame = rotation_about(&Vec3::y(), std::f64::consts::FRAC_PI_4).to_rotation_matrix();
    let found = on_plane(&cube, frame.into_inner(), depth).unwrap();
    assert!((found.gain * found.thickness / (0.5 * depth) - 1.0).abs() < 1e-6, "{found:?}");
    // A corner with its diagonal upright has 0.3 of the stiffness, and the tip of a tetrahedron 0.15.
    let diagonal = Vec3::new(1.0, 1.0, 1.0).normalize();
    let upright = |axis: Vec3| {
        let turn = nalgebra::Rotation3::rotation_between(&axis, &Vec3::z()).expect("not opposite");
        turn.into_inner()
    };
    let found = on_plane(&cube, upright(diagonal), depth).unwrap();
    assert!((found.gain * found.thickness / (0.3 * depth) - 1.0).abs() < 1e-9, "{found:?}");
    assert!(found.couple.norm() < 1e-12 * depth, "{found:?}");
}

/// The 24 rotations under which a cube is invariant.
fn cube_rotations() -> Vec<Mat3> {
    let mut all = Vec::new();
    for first in 0..6 {
        for second in 0..6 {
            let unit = |k: usize| Vec3::ith(k / 2, if k.is_multiple_of(2) { 1.0 } else { -1.0 });
            let (x, y) = (unit(first), unit(second));
            if first / 2 != second / 2 {
                all.push(Mat3::from_columns(&[x, y, x.cross(&y)]));
            }
        }
    }
    all
}

/// Poses in which faces, edges and corners coincide: turned boxes on a lattice of half their edges. A common random
/// rotation lets rounding decide.
fn degenerate_pose<'a>(random: &mut Random, boxes: &'a [Shape], turns: &[Mat3]) -> Pose<'a> {
    let mut pick = || &boxes[below(random, boxes.len() as u64) as usize];
    let shapes = [pick(), pick()];
    let world = if random.unit() < 0.5 { Mat3::identity() } else { random.frame() };
    let mut turn = || world * turns[below(random, 24) as usize];
    let frames = [turn(), turn()];
    let mut step = || 0.25 * (below(random, 9) as f64 - 4.0);
    let r = world * Vec3::new(step(), step(), step());
    Pose { shapes, frames, scales: [1.0; 2], r }
}

fn bits(found: Option<Thickness>) -> Vec<u64> {
    let Some(found) = found else { return Vec::new() };
    let Thickness { thickness, normal, gain, point, couple, centroid, covariance } = found;
    let numbers = [thickness, gain];
    let vectors = [normal, point, couple, centroid];
    let all = numbers.iter().chain(vectors.iter().flatten()).chain(&covariance);
    all.map(|x| x.to_bits()).collect()
}

/// Checks that A's surface is closed after the cuts by B's planes. Each side of a face is a side of another, in the
/// opposite direction.
fn assert_closed(body: &mut Clipped, pose: &Pose) {
    let [a, b] = [0, 1].map(|k| pose.shapes[k].facets().expect("a polyhedron"));
    body.begin(a);
    for plane in b.planes() {
        let normal = pose.frames[0].tr_mul(&(pose.frames[1] * plane.normal));
        let offset = plane.offset + normal.dot(&pose.frames[0].tr_mul(&pose.r));
        body.cut(&Plane { normal, offset });
    }
    body.end();
    body.pack();
    assert_eq!(body.left().len(), body.vertices().len());
    let mut sides: BTreeMap<(u32, u32), i32> = BTreeMap::new();
    let (mut sum, mut area) = (Vec3::zeros(), 0.0);
    for face in body.faces() {
        assert!(face.corners.len() > 2);
        let vertex = |k: u32| body.vertices()[k as usize];
        let start = vertex(face.corners[0]);
        for (k, &here) in face.corners.iter().enumerate() {
            let next = face.corners[(k + 1) % face.corners.len()];
            *sides.entry((here, next)).or_default() += 1;
            *sides.entry((next, here)).or_default() -= 1;
            let part = (vertex(here) - start).cross(&(vertex(next) - start)) * 0.5;
            sum += part;
            area += part.norm();
        }
    }
    assert!(sides.values().all(|&count| count == 0), "{sides:?}");
    assert!(sum.norm() <= 1e-14 * area, "{:e} of {area:e}", sum.norm());
}

#[test]
fn coinciding_faces_edges_and_corners_do_no_harm() {
    let boxes = [
        cuboid(Vec3::new(1.0, 1.0, 1.0)),
        cuboid(Vec3::new(1.0, 0.5, 1.0)),
        cuboid(Vec3::new(0.5, 0.5, 0.5)),
        cuboid(Vec3::new(1.0, 0.75, 0.25)),
    ];
    let turns = cube_rotations();
    assert_eq!(turns.len(), 24);
    let mut random = Random::of(SEED, 2);
    let poses: Vec<_> =
        (0..300_000).map(|_| degenerate_pose(&mut random, &boxes, &turns)).collect();
    let mut clipped = Clipped::default();
    let mut touching = 0;
    for (case, pose) in poses.iter().enumerate() {
        assert_closed(&mut clipped, pose);
        let Some(found) = pose.thickness() else { continue };
        touching += 1;
        let Thickness { thickness, normal, gain, point, .. } = found;
        assert!(thickness > 0.0 && thickness <= 1.0 + 1e-12, "case {case}: {found:?}");
        assert!((normal.norm() - 1.0).abs() < 1e-14 && gain > 0.0, "case {case}: {found:?}");
        assert!(point.norm() < 2.0 && found.moment().norm() < 2.0, "case {case}: {found:?}");
    }
    assert!(touching > 50_000, "{touching}");
    // Earlier contents of the scratch memory do not matter.
    let other = |poses: &[Pose]| -> Vec<_> {
        poses.iter().rev().map(|pose| bits(pose.thickness())).collect()
    };
    let mut again =
        std::thread::scope(|scope| scope.spawn(|| other(&poses)).join().expect("no panic"));
    again.reverse();
    for (case, (pose, again)) in poses.iter().zip(again).enumerate() {
        assert_eq!(bits(pose.thickness()), again, "case {case}");
    }
}

/// Both orders of a pair agree, and action equals reaction.
#[test]
fn the_order_of_a_pair_does_not_matter() {
    let solids = solids();
    let mut random = Random::of(SEED, 3);
    for case in 0..2000 {
        let pose = random_pose(&mut random, &solids);
        let swapped = pose.swapped();
        let (Some(one), Some(other)) = (pose.thickness(), swapped.thickness()) else { continue };
        let about_b = other.moment() + other.force().cross(&-pose.r);
        let tolerance = 1e-10 * one.thickness;
        assert!((one.thickness - other.thickness).abs() < tolerance, "case {case}");
        assert!((one.force() + other.force()).norm() < tolerance, "case {case}");
        assert!((one.moment() + about_b).norm() < tolerance, "case {case}: {one:?}");
    }
}

/// Boxes with friction and dashpots, on a table that turns and rises.
const TABLE: &str = r#"
gravity = [0.0, 0.0, -9.81]
[domain]
low = [0.0, 0.0, -0.01]
high = [0.03, 0.03, 0.1]
walls = ["-x", "+x", "-y", "+y"]
MATERIAL
[[wall]]
name = "table"
point = [0.015, 0.015, 0.0]
normal = [0.0, 0.0, 1.0]
MOTION
[[shape]]
name = "brick"
kind = "polyhedron"
vertices = [
  [-1.2e-3, -1e-3, -8e-4], [1.2e-3, -1e-3, -8e-4], [-1.2e-3, 1e-3, -8e-4], [1.2e-3, 1e-3, -8e-4],
  [-1.2e-3, -1e-3, 8e-4], [1.2e-3, -1e-3, 8e-4], [-1.2e-3, 1e-3, 8e-4], [1.2e-3, 1e-3, 8e-4],
]
size = { uniform = [0.8, 1.2] }
[[fill.lattice]]
shapes = ["brick"]
low = [0.0, 0.0, 0.001]
high = [0.03, 0.03, 0.0173]
spacing = 0.0043
velocity = [0.0, 0.0, -1.0]
[time]
step = 4e-6
"#;

/// The work of the walls equals stored, kinetic and dissipated energy.
#[test]
fn the_energy_of_boxes_on_a_moving_table_adds_up() {
    for motion in [
        "rotation = { about = [0.015, 0.015, 0.0], axis = [0.0, 0.0, 1.0], rate = 50.0 }",
        "velocity = [0.0, 0.0, 0.3]",
    ] {
        let scene = scene(&TABLE.replace("MATERIAL", MATERIAL).replace("MOTION", motion));
        let mut comm = Alone::default();
        let mut sim = begun(&scene, &mut comm);
        for _ in 0..10_000 {
            sim.step(&mut comm).expect("the step is done");
        }
        let measures = sim.measure(&mut comm);
        let missing = measures.missing() / measures.dissipated;
        assert!(measures.contacts + measures.wall_contacts > 30, "{measures:?}");
        assert!(missing.abs() < 1e-3, "{motion}: {missing:e} of {measures:?}");
    }
}

/// A small box on a large one, in either order: the overlap counts from a billionth of the small box on.
#[test]
fn a_small_body_feels_a_large_one_in_any_order() {
    let (large, small) = (cuboid(Vec3::repeat(1.0)), cuboid(Vec3::repeat(1e-3)));
    let upright = Mat3::identity();
    let [large, small] = [&large, &small].map(|shape| Posed::new(shape, &upright));
    for depth in [1e-15, 1e-14, 1e-13, 3e-12, 1e-11, 1e-10, 1e-9, 1e-8, 1e-6] {
        let r = Vec3::new(0.1, -0.2, 0.5005 - depth);
        for (a, b, r) in [(&large, &small, r), (&small, &large, -r)] {
            match Overlap.touch(a, b, &r, None) {
                Outcome::Touching(touch) => {
                    // Closed form of a slab; positions have the rounding of the large box.
                    let thickness = depth / (1.0 + 2.0 * (depth / 1e-3).powi(2)).sqrt();
                    let off = (touch.overlap - thickness).abs();
                    assert!(off < 3e-16, "{depth:e}: {touch:?}");
                    assert!((touch.normal - r.z.signum() * Vec3::z()).norm() < 1e-3, "{touch:?}");
                }
                // Below that another method answers.
                outcome => assert!(depth < 2e-12, "{depth:e}: {outcome:?}"),
            }
        }
    }
}
