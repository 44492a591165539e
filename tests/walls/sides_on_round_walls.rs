//! Spherocylinders on cylinders and cones: the definition by dense sums, fine triangles, force and moment as the gradient of an energy, planes.

use crate::contact::sides::rod;
use crate::support::Frame;
use crate::walls::faces_on_meshes::{Lying, drum};
use dem_mpi::contact::{Posed, Thickness};
use dem_mpi::math::{Mat3, Vec3, rotation_about};
use dem_mpi::random::Random;
use dem_mpi::shape::{HalfSpace, Shape, Spherocylinder, TriangleMesh};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::Arc;

/// A cylinder or a cone about y, from -4 to 4, and the side of the rod.
struct Round {
    /// Radius at y = 0.
    radius: f64,
    slope: f64,
    /// 1 inside, -1 outside.
    side: f64,
}

impl Round {
    fn shape(&self) -> Shape {
        let [from, to] = [-4.0, 4.0].map(|y| (Vec3::y() * y, self.radius + self.slope * y));
        let surface = TriangleMesh::of_revolution(&from.0, &to.0, [from.1, to.1]);
        Shape::TriangleMesh(Arc::new(surface))
    }

    /// Depth of the sphere about a point of the axis.
    fn depth(&self, lying: &Lying, s: f64) -> f64 {
        let Shape::Spherocylinder(Spherocylinder { length, radius }) = lying.body else {
            panic!("{:?}", lying.body)
        };
        let place = lying.centre + lying.frame * Vec3::x() * (0.5 * length * s);
        let across = self.radius + self.slope * place.y - libm::hypot(place.x, place.z);
        radius - self.side * across / libm::hypot(1.0, self.slope)
    }

    /// Depths at the middles of `count` parts of the axis.
    fn depths(&self, lying: &Lying, count: usize) -> Vec<f64> {
        let place = |k: usize| -1.0 + (2 * k + 1) as f64 / count as f64;
        (0..count).map(|k| self.depth(lying, place(k))).collect()
    }

    /// A rod in a given orientation, pressed onto the surface to a depth.
    fn pressed<'a>(&self, body: &'a Shape, frame: Mat3, depth: f64, y: f64) -> Option<Lying<'a>> {
        let at = |x: f64| Lying {
            body,
            frame,
            wall: Mat3::identity(),
            scale: 1.0,
            centre: Vec3::new(x, y, 0.0),
        };
        let deepest =
            |x: f64| self.depths(&at(x), 200).into_iter().fold(f64::NEG_INFINITY, f64::max);
        let (mut free, mut pressed) =
            if self.side > 0.0 { (0.0, self.radius + 3.0) } else { (self.radius + 8.0, 0.0) };
        if deepest(free) >= depth {
            return None;
        }
        for _ in 0..60 {
            let middle = 0.5 * (free + pressed);
            if deepest(middle) < depth { free = middle } else { pressed = middle }
        }
        Some(at(free))
    }

    /// `D²` of all chains by its definition.
    fn defined(&self, lying: &Lying) -> f64 {
        const COUNT: usize = 40_000;
        let depths = self.depths(lying, COUNT);
        let mut squares = 0.0;
        for chain in depths.split(|depth| *depth <= 0.0).filter(|chain| !chain.is_empty()) {
            let dips = dips(chain);
            let borders: Vec<usize> =
                [0].into_iter().chain(dips.iter().copied()).chain([chain.len()]).collect();
            let lobes: Vec<[f64; 2]> = borders
                .windows(2)
                .map(|range| {
                    let of = &chain[range[0]..range[1]];
                    [of.iter().sum(), of.iter().map(|depth| depth.powi(3)).sum()]
                })
                .collect();
            for (i, [depth, cube]) in lobes.iter().enumerate() {
                let mut weight = 0.0;
                for (j, [other, other_cube]) in lobes.iter().enumerate() {
                    let between = dips[i.min(j)..i.max(j)].iter().map(|&k| chain[k]);
                    let lowest = between.fold(f64::INFINITY, f64::min);
                    let u = |square: f64| {
                        let x = (lowest * lowest / square).min(1.0);
                        x * (2.0 - x)
                    };
                    let apart = (1.0 - u(cube / depth)) * (1.0 - u(other_cube / other));
                    weight += (1.0 - apart) * other;
                }
                squares += cube / weight;
            }
        }
        squares
    }
}

/// Indices of the inner minima of a sequence that are deeper than rounding.
fn dips(numbers: &[f64]) -> Vec<usize> {
    let (mut dips, mut falls, mut extreme) = (Vec::new(), false, 0);
    for (k, number) in numbers.iter().enumerate() {
        let rise = number - numbers[extreme];
        if falls && rise > 1e-13 {
            dips.push(extreme);
        }
        let turns = if falls { rise > 1e-13 } else { rise < -1e-13 };
        falls ^= turns;
        if turns || (rise < 0.0) == falls {
            extreme = k;
        }
    }
    dips
}

/// Rods from nearly a ball to a needle.
fn rods() -> [Shape; 4] {
    [rod(0.1, 0.3), rod(0.8, 0.2), rod(1.4, 0.06), rod(1.6, 0.02)]
}

/// A wide and a narrow wall of each kind, from both sides.
fn walls() -> Vec<Round> {
    let all = [(1.0, 0.0), (1.2, 0.15), (1.5, -0.3), (0.3, 0.0), (0.6, 0.1), (30.0, 0.0)];
    let of = |(radius, slope)| [1.0, -1.0].map(|side| Round { radius, slope, side });
    all.into_iter().flat_map(of).collect()
}

/// Poses of all rods on all walls: random, nearly along the axis, and across it.
fn poses(mut visit: impl FnMut(&Round, &Shape, Lying)) {
    let mut random = Random::of(20_261_126, 4);
    for round in walls() {
        let shape = round.shape();
        for body in &rods() {
            let size = Posed::new(body, &Mat3::identity()).inscribed_radius();
            for k in 0..45 {
                let tilt = libm::pow(10.0, -8.0 * random.unit());
                let about = |axis: &Vec3, angle: f64| {
                    rotation_about(axis, angle).to_rotation_matrix().into_inner()
                };
                let cone = about(&Vec3::z(), FRAC_PI_2 - libm::atan(round.slope));
                let frame = match k % 3 {
                    0 => random.frame(),
                    1 => about(&Vec3::x(), tilt) * cone,
                    _ => about(&Vec3::y(), FRAC_PI_2 + tilt),
                };
                let depth = size * libm::pow(10.0, -2.0 * random.unit()) * 0.2;
                let y = 0.3 * random.signed();
                let Some(lying) = round.pressed(body, frame, depth, y) else { continue };
                visit(&round, &shape, lying);
            }
        }
    }
}

#[test]
fn the_thickness_is_that_of_the_definition() {
    let (mut worst, mut met, mut dipping) = (0.0_f64, 0, 0);
    poses(|round, shape, lying| {
        let expected = round.defined(&lying);
        let found = 2.0 * lying.energy(shape);
        let error = (found / expected - 1.0).abs();
        worst = worst.max(error);
        assert!(
            error < 1e-4,
            "radius {}, slope {}, side {}, {:?} at {}, {}: {found:e}, {expected:e}",
            round.radius,
            round.slope,
            round.side,
            lying.body,
            lying.centre,
            lying.frame
        );
        met += 1;
        dipping += usize::from(
            lying.on(shape).len() > 1 || {
                let depths = round.depths(&lying, 100);
                round.side > 0.0 && depths[50] < depths[0].min(depths[99])
            },
        );
    });
    println!("{met} poses, {dipping} with two ends that are deepest, worst {worst:.1e}");
    assert!(met > 1200 && dipping > 200, "{met}, {dipping}");
}

#[test]
fn force_and_moment_are_the_gradient_of_the_energy() {
    let (mut worst, mut met) = (0.0_f64, 0);
    poses(|_, shape, lying| {
        worst = worst.max(lying.error_of_gradient(shape));
        met += 1;
    });
    println!("{met} poses, worst {worst:.1e}");
    assert!(met > 1200);
    assert!(worst < 1e-6, "{worst:e}");
}

/// A cylinder of flat strips converges to the exact one with the square of their width.
#[test]
fn strips_of_triangles_come_to_the_cylinder() {
    let round = Round { radius: 1.0, slope: 0.0, side: 1.0 };
    let exact = round.shape();
    let fine = [256, 512, 1024].map(|strips| {
        let surface = TriangleMesh::new(&drum(1.0, 4.0, strips), 0.1).expect("a surface");
        Shape::TriangleMesh(Arc::new(surface))
    });
    let mut random = Random::of(20_261_126, 5);
    let mut worst = [0.0_f64; 3];
    for body in &rods() {
        for _ in 0..30 {
            let Some(lying) = round.pressed(body, random.frame(), 4e-3, 0.1) else { continue };
            let expected = lying.energy(&exact);
            for (worst, surface) in worst.iter_mut().zip(&fine) {
                *worst = worst.max((lying.energy(surface) / expected - 1.0).abs());
            }
        }
    }
    println!("{worst:?}");
    assert!(worst[2] < 0.3 * worst[1] && worst[1] < 0.3 * worst[0] && worst[2] < 0.01, "{worst:?}");
}

/// On a very wide cylinder a rod has the force of the plane at any position.
#[test]
fn a_wide_cylinder_is_a_plane() {
    let wide = 1e7;
    let plane = Shape::HalfSpace(HalfSpace { normal: -Vec3::x(), offset: -wide });
    let round = Round { radius: wide, slope: 0.0, side: 1.0 };
    let shape = round.shape();
    let mut random = Random::of(20_261_126, 6);
    let mut worst = 0.0_f64;
    for body in &rods() {
        for _ in 0..40 {
            let frame = random.frame();
            let Some(lying) = round.pressed(body, frame, 2e-3, 0.0) else { continue };
            let (found, expected) = (lying.on(&shape), lying.on_plane(&plane).expect("a contact"));
            let total = |pick: fn(&Thickness) -> Vec3| -> Vec3 {
                found.iter().map(|(_, found)| pick(found)).sum()
            };
            let off = (total(Thickness::force) - expected.force()).norm()
                + (total(Thickness::moment) - expected.moment()).norm();
            worst = worst.max(off / expected.thickness);
        }
    }
    println!("{worst:.1e}");
    // Positions are rounded to 2e-9, depths are 2e-3, and the surface deviates from a plane by 3e-8.
    assert!(worst < 5e-5, "{worst:e}");
}

/// Below, beside and over the end of a cylinder, its rim acts on rods like that of fine strips, and energies have no jump there.
#[test]
fn rods_feel_rims() {
    let round = Round { radius: 1.0, slope: 0.0, side: 1.0 };
    let exact = round.shape();
    let surface = TriangleMesh::new(&drum(1.0, 4.0, 1024), 0.1).expect("a surface");
    let fine = Shape::TriangleMesh(Arc::new(surface));
    let mut random = Random::of(20_261_127, 1);
    let (mut worst, mut met) = (0.0_f64, 0);
    for body in &rods() {
        let Shape::Spherocylinder(Spherocylinder { length, radius }) = body else { unreachable!() };
        for _ in 0..60 {
            let frame = random.frame();
            // One point of the axis is at this distance from a point of the rim, on its outer side.
            let (turn, around) = (TAU * random.unit(), PI * random.unit());
            let across = Vec3::new(turn.cos(), 0.0, turn.sin());
            let rim = across + Vec3::y() * 4.0;
            let out = across * around.cos() + Vec3::y() * around.sin();
            let along = frame * Vec3::x() * (0.5 * length * random.signed());
            let place = |depth: f64| rim + out * (radius - depth) - along;
            let lying = |depth: f64| Lying {
                body,
                frame,
                wall: Mat3::identity(),
                scale: 1.0,
                centre: place(depth),
            };
            let depth = 0.2 * radius;
            // Another point of the axis may be deeper, or on the other side.
            let nearest = (-100..=100)
                .map(|k| place(depth) + frame * Vec3::x() * (0.005 * length * f64::from(k)))
                .map(|place| {
                    libm::hypot(libm::hypot(place.x, place.z) - 1.0, (place.y - 4.0).max(0.0))
                })
                .fold(f64::INFINITY, f64::min);
            if nearest < 0.7 * radius {
                continue;
            }
            let (found, expected) = (lying(depth).energy(&exact), lying(depth).energy(&fine));
            // Energy of a sphere of this depth.
            let scale = depth * depth;
            let error = (found - expected).abs() / expected.max(scale);
            assert!(error < 5e-3, "{body:?} {frame} {}: {found:e}, {expected:e}", place(depth));
            worst = worst.max(error);
            met += usize::from(expected > 0.1 * scale);
            let way = random.rotation() * Vec3::x() * (0.002 * radius);
            let jump = |surface: &Shape| {
                let at =
                    |k: i32| Lying { centre: place(depth) + way * f64::from(k), ..lying(depth) };
                let energies: Vec<f64> = (-40..40).map(|k| at(k).energy(surface)).collect();
                let jumps = energies.windows(2).map(|pair| (pair[1] - pair[0]).abs());
                jumps.fold(0.0, f64::max)
            };
            let (jump, of_fine) = (jump(&exact), jump(&fine));
            assert!(
                jump < 2.0 * of_fine + 0.01 * scale,
                "{body:?} {frame} {}: {jump:e}, {expected:e}",
                place(depth)
            );
        }
    }
    println!("{met} rods, worst {worst:.1e}");
    assert!(met > 90, "{met}");
}
