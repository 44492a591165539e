//! Bodies of several pieces: a cut body has the contact of the whole, and the force is the gradient of the energy for
//! any form.

use super::overlap::{cuboid, derivative, solids};
use crate::shape::unions::{ELL, JACK, cubes, piece};
use crate::support::Frame;
use crate::support::random::Draw;
use benchmarking::solids;
use dem_mpi::contact::{PairOfPieces, Posed, Thickness, thickness, thickness_of_pieces};
use dem_mpi::math::{Mat3, Vec3, rotation_about};
use dem_mpi::random::Random;
use dem_mpi::shape::{Convex as _, HalfSpace, Polyhedron, Shape, Union};

const SEED: u64 = 20_261_128;
const EDGES: Vec3 = Vec3::new(1.0, 0.8, 0.6);

fn solid(corners: &[Vec3]) -> Shape {
    Shape::Polyhedron(Box::new(Polyhedron::new(corners).expect("a body")))
}

/// The box in blocks, with these counts along the axes.
fn in_blocks(counts: [usize; 3]) -> Union {
    let edge = Vec3::from_fn(|i, _| EDGES[i] / counts[i] as f64);
    let block = cuboid(edge);
    let at = |k: usize| {
        let number = [k % counts[0], k / counts[0] % counts[1], k / counts[0] / counts[1]];
        Vec3::from_fn(|i, _| (number[i] as f64 + 0.5) * edge[i] - 0.5 * EDGES[i]).into()
    };
    let pieces = (0..counts.iter().product()).map(|k| piece(&block, at(k))).collect();
    Union::new(pieces).expect("a box")
}

/// The box in two wedges.
fn in_wedges() -> Union {
    let corners = solids::cuboid(EDGES);
    let side = |corner: &Vec3| corner.x / EDGES.x + corner.z / EDGES.z;
    let wedge = |sign: f64| {
        let half: Vec<Vec3> =
            corners.iter().copied().filter(|corner| sign * side(corner) > -1e-9).collect();
        let shape = solid(&half);
        let placement = *shape.placement().expect("axes");
        let mut piece = piece(&shape, placement.centre.into());
        piece.rotation = placement.axes;
        piece
    };
    Union::new(vec![wedge(1.0), wedge(-1.0)]).expect("a box")
}

fn cut_boxes() -> Vec<Union> {
    vec![in_blocks([2, 1, 1]), in_blocks([1, 4, 1]), in_blocks([2, 2, 2]), in_wedges()]
}

/// A body in place, of one piece or several.
#[derive(Clone)]
struct Placed<'a> {
    union: Option<&'a Union>,
    shape: Option<&'a Shape>,
    frame: Mat3,
    scale: f64,
}

impl<'a> Placed<'a> {
    fn of(union: &'a Union, frame: Mat3, scale: f64) -> Self {
        Self { union: Some(union), shape: None, frame, scale }
    }

    fn whole(shape: &'a Shape, frame: Mat3) -> Self {
        Self { union: None, shape: Some(shape), frame, scale: 1.0 }
    }

    /// Shapes, axes and positions of the pieces.
    fn pieces(&self) -> Vec<(&'a Shape, Mat3, Vec3)> {
        let single = self.shape.map(|shape| (shape, self.frame, Vec3::zeros()));
        let several = self.union.into_iter().flat_map(Union::pieces).map(|piece| {
            let frame = self.frame * piece.rotation.to_rotation_matrix().into_inner();
            (&piece.shape, frame, self.frame * piece.centre * self.scale)
        });
        single.into_iter().chain(several).collect()
    }

    fn oneness(&self, one: usize, other: usize) -> f64 {
        self.union.map_or(1.0, |union| union.oneness(one, other))
    }

    fn turned(&self, axis: &Vec3, angle: f64) -> Self {
        let turn = rotation_about(axis, angle).to_rotation_matrix();
        Self { frame: turn * self.frame, ..self.clone() }
    }
}

/// All contacts of two bodies, relative to the centre of the first.
fn contacts(a: &Placed, b: &Placed, r: &Vec3) -> Vec<Thickness> {
    let (of_a, of_b) = (a.pieces(), b.pieces());
    let mut numbers = Vec::new();
    let mut pairs = Vec::new();
    for (i, (shape, frame, from)) in of_a.iter().enumerate() {
        for (j, (other, other_frame, to)) in of_b.iter().enumerate() {
            numbers.push((i, j));
            pairs.push(PairOfPieces {
                a: Posed { scale: a.scale, ..Posed::new(shape, frame) },
                b: Posed { scale: b.scale, ..Posed::new(other, other_frame) },
                r: r + to - from,
                from: *from,
            });
        }
    }
    let oneness = |k: usize, l: usize| {
        let ((i, j), (m, n)) = (numbers[k], numbers[l]);
        a.oneness(i, m) * b.oneness(j, n)
    };
    thickness_of_pieces(&pairs, oneness).into_iter().map(|found| found.thickness).collect()
}

/// Largest relative difference of two contacts in thickness, force, moment and covariance.
fn difference(one: &Thickness, other: &Thickness, size: f64) -> f64 {
    let d = one.thickness;
    let covariance = (one.covariance - other.covariance).norm() / one.covariance.norm();
    [
        (one.thickness - other.thickness).abs() / d,
        (one.force() - other.force()).norm() / d,
        (one.moment() - other.moment()).norm() / (d * size),
        covariance,
    ]
    .into_iter()
    .fold(0.0, f64::max)
}

/// Boxes in two to eight blocks and in wedges, on planes, on other bodies and on each other.
#[test]
fn a_cut_box_has_the_contact_of_the_whole() {
    let whole = cuboid(EDGES);
    let cut = cut_boxes();
    let others = solids();
    let mut random = Random::of(SEED, 0);
    let (mut touching, mut worst) = ([0; 3], [0.0_f64; 3]);
    for round in 0..3000 {
        let (sort, union) = (round % 3, &cut[round / 3 % 4]);
        let own = union.placement().expect("axes").axes.to_rotation_matrix().into_inner();
        let frame = random.frame();
        // The axes of the union are the box's axes in any order.
        let a = Placed::of(union, frame * own, 1.0);
        let direction = random.frame() * Vec3::z();
        let depth = random.between(0.01, 0.1);
        let plane = Shape::HalfSpace(HalfSpace { normal: -direction, offset: 0.0 });
        let other = &others[round / 12 % others.len()];
        let other_cut = &cut[round / 12 % 4];
        let other_frame = random.frame();
        let other_own = other_cut.placement().expect("axes").axes.to_rotation_matrix();
        let (b, whole_b) = match sort {
            0 => (Placed::whole(&plane, Mat3::identity()), Placed::whole(&plane, Mat3::identity())),
            1 => (Placed::whole(other, other_frame), Placed::whole(other, other_frame)),
            _ => (
                Placed::of(other_cut, other_frame * other_own, 1.0),
                Placed::whole(&whole, other_frame),
            ),
        };
        let height = |placed: &Placed, direction: &Vec3| {
            Posed::new(placed.shape.expect("a whole"), &placed.frame).support(direction)
        };
        let whole_a = Placed::whole(&whole, frame);
        let reach = height(&whole_a, &direction).dot(&direction);
        let r = if sort == 0 {
            direction * (reach - depth)
        } else {
            let beside = height(&whole_b, &-direction);
            height(&whole_a, &direction) - beside - direction * depth
        };
        let bodies = [
            Posed::new(&whole, &whole_a.frame),
            Posed::new(whole_b.shape.unwrap(), &whole_b.frame),
        ];
        let of_whole = thickness(&bodies[0], &bodies[1], &r);
        let of_pieces = contacts(&a, &b, &r);
        let Some(of_whole) = of_whole.filter(|found| found.thickness > 1e-3) else { continue };
        assert_eq!(of_pieces.len(), 1, "{round}");
        touching[sort] += 1;
        worst[sort] = worst[sort].max(difference(&of_whole, &of_pieces[0], 1.0));
    }
    println!("poses {touching:?}, largest differences {worst:?}");
    assert!(touching.iter().all(|&count| count > 500), "{touching:?}");
    assert!(worst.iter().all(|&worst| worst < 1e-10), "{worst:?}");
}

/// Force and moment over all contacts of bodies with dents, against differences of their energy.
#[test]
fn forces_of_unions_are_the_gradient_of_their_energy() {
    let bodies = [cubes(&ELL), cubes(&JACK), in_wedges()];
    let mut random = Random::of(SEED, 1);
    let (mut several, mut worst) = (0, 0.0_f64);
    let mut rounds = 0;
    while rounds < 200 {
        let [one, other] = [0, 1].map(|_| &bodies[(random.unit() * 3.0) as usize]);
        let a = Placed::of(one, random.frame(), random.between(0.8, 1.2));
        let b = Placed::of(other, random.frame(), 1.0);
        let r = random.frame() * Vec3::z() * random.between(0.8, 2.5);
        let energy = |a: &Placed, b: &Placed, r: &Vec3| -> f64 {
            contacts(a, b, r).iter().map(Thickness::energy).sum()
        };
        let found = contacts(&a, &b, &r);
        let thinnest = found.iter().map(|found| found.thickness).fold(f64::INFINITY, f64::min);
        let thickest = found.iter().map(|found| found.thickness).fold(0.0, f64::max);
        if found.is_empty() || thinnest < 0.02 || thickest > 0.3 {
            continue;
        }
        rounds += 1;
        several += usize::from(found.len() > 1);
        let force: Vec3 = found.iter().map(Thickness::force).sum();
        let moment: Vec3 = found.iter().map(Thickness::moment).sum();
        let on_b = moment - r.cross(&force);
        let step = 1e-4 * thinnest;
        for k in 0..3 {
            let axis = Vec3::ith(k, 1.0);
            let by_place = derivative(|h| energy(&a, &b, &(r + axis * h)), step);
            let by_a = derivative(|h| energy(&a.turned(&axis, h), &b, &r), step);
            let by_b = derivative(|h| energy(&a, &b.turned(&axis, h), &r), step);
            for error in [by_place + force[k], by_a - moment[k], by_b + on_b[k]] {
                worst = worst.max(error.abs() / thickest);
            }
        }
    }
    println!("{several} of {rounds} in several places, largest error {worst:.1e}");
    assert!(several > 20 && worst < 1e-5, "{several}, {worst:e}");
}
