//! Curvatures at a contact and Hertz's law with them. References are elliptic integrals by quadrature, second differences of support functions,
//! differences of the energy, and impacts with closed forms.

use crate::sim::verification::cases::elliptic::{ellipse, f2_of};
use dem_mpi::contact::curvature::{
    Curvature, LARGEST_RATIO, flattest, of_pair, stiffening_of_ratio,
};
use dem_mpi::contact::{Method, Outcome, Posed, Touch, ordered, table};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::random::Random;
use dem_mpi::shape::{
    Ellipsoid, HalfSpace, Kind, PolySuperellipsoid, Shape, Sphere, Superellipsoid,
};

use std::f64::consts::TAU;

/// `F2` over the whole range to 1e-12, and its published values.
#[test]
fn the_fit_is_that_of_elliptic_integrals() {
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for k in 0..400 {
        let axes = 0.001_f64.powf(f64::from(k) / 399.0);
        let [ratio, f2] = ellipse(axes);
        if ratio > LARGEST_RATIO {
            break;
        }
        largest = largest.max(ratio);
        for ratio in [ratio, 1.0 / ratio] {
            worst = worst.max((stiffening_of_ratio(ratio) * f2.powf(1.5) - 1.0).abs());
        }
    }
    println!("F2 off by at most {worst:.1e} up to {largest}");
    assert!(worst < 1e-12 && largest > 0.9 * LARGEST_RATIO, "{worst:e} up to {largest}");
    for (ratio, axes, f2) in
        [(2.0, 0.63060, 0.99339), (4.0, 0.39989, 0.97431), (100.0, 0.05498, 0.78600)]
    {
        assert!((ellipse(axes)[0] / ratio - 1.0).abs() < 2e-4, "{ratio}");
        assert!((f2_of(ratio) - f2).abs() < 1e-5, "{ratio}");
    }
}

fn shapes() -> Vec<Shape> {
    let superellipsoid =
        |axes: [f64; 3], e| Shape::Superellipsoid(Superellipsoid::new(Vec3::from(axes), e));
    let octants =
        PolySuperellipsoid::new(Vec3::new(1.0, 0.8, 0.7), Vec3::new(0.6, 0.9, 1.1), [0.9, 1.1]);
    vec![
        Shape::Sphere(Sphere { radius: 0.7 }),
        Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(1.0, 0.5, 0.5) }),
        Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(0.9, 0.7, 0.4) }),
        Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(1.0, 1.0, 0.2) }),
        superellipsoid([0.8, 0.6, 0.5], [1.0, 1.0]),
        superellipsoid([0.8, 0.6, 0.7], [0.8, 1.2]),
        superellipsoid([0.9, 0.8, 0.7], [0.7, 0.7]),
        Shape::PolySuperellipsoid(Box::new(octants)),
    ]
}

fn frame(random: &mut Random) -> Mat3 {
    random.rotation().to_rotation_matrix().into_inner()
}

/// Two unit vectors perpendicular to a normal and to each other.
fn across(normal: &Vec3) -> [Vec3; 2] {
    let first = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize();
    [first, normal.cross(&first)]
}

/// Radii of curvature along a normal. For ellipsoids they are second differences of the support function. For other shapes they are the average over
/// 0.1 rad around the normal, from many support points.
fn radii(body: &Posed, normal: &Vec3) -> [[f64; 2]; 2] {
    const STEP: f64 = 1e-3;
    let axes = across(normal);
    if !body.shape.kind().is_ellipsoidal() {
        let (count, width) = (720, 0.1_f64);
        let mut sum = [[0.0; 2]; 2];
        for k in 0..count {
            let angle = TAU * f64::from(k) / f64::from(count);
            let u = axes[0] * angle.cos() + axes[1] * angle.sin();
            let point = body.support(&(normal * width.cos() + u * width.sin()));
            for (i, row) in sum.iter_mut().enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    let both = point.dot(&axes[i]) * u.dot(&axes[j])
                        + point.dot(&axes[j]) * u.dot(&axes[i]);
                    *entry += both / (f64::from(count) * width.sin());
                }
            }
        }
        return sum;
    }
    let height = |x: f64, y: f64| {
        let v = normal + axes[0] * (STEP * x) + axes[1] * (STEP * y);
        body.support(&v).dot(&v)
    };
    // Fourth-order differences along the axes.
    let second = |at: &dyn Fn(f64) -> f64| {
        (16.0 * (at(1.0) + at(-1.0)) - (at(2.0) + at(-2.0)) - 30.0 * at(0.0)) / (12.0 * STEP * STEP)
    };
    let xx = second(&|t| height(t, 0.0));
    let yy = second(&|t| height(0.0, t));
    let diagonal = second(&|t| height(t, t));
    let xy = 0.5 * (diagonal - xx - yy);
    [[xx, xy], [xy, yy]]
}

fn inverse([[a, b], [_, d]]: [[f64; 2]; 2]) -> [f64; 3] {
    let determinant = a * d - b * b;
    [d / determinant, -b / determinant, a / determinant]
}

/// `√R` from the curvatures 11, 12 and 22.
fn root_of_radius([a, b, c]: [f64; 3]) -> f64 {
    let spread = (0.25 * (a - c) * (a - c) + b * b).sqrt();
    let [large, small] = [0.5 * (a + c) + spread, 0.5 * (a + c) - spread];
    (large * small).powf(-0.25) * f2_of(large / small).powf(-1.5)
}

/// Every shape on a plane and every pair of shapes, in random orientations and sizes.
#[test]
fn curvatures_are_second_derivatives_of_support_functions() {
    let mut random = Random::of(11, 0);
    let plane = Shape::HalfSpace(HalfSpace::at_reference(Vec3::z()));
    let mut worst = [0.0_f64; 2];
    for (k, shape) in shapes().iter().enumerate() {
        for other in shapes().iter().take(k + 1).chain([&plane]) {
            let frames = [frame(&mut random), frame(&mut random)];
            let a = Posed { scale: 1.3, ..Posed::new(shape, &frames[0]) };
            let b = Posed { scale: 0.8, ..Posed::new(other, &frames[1]) };
            let normal = random.rotation() * Vec3::x();
            let mut sum = inverse(radii(&a, &normal));
            if other.kind() != Kind::HalfSpace {
                // From the other side the second perpendicular vector is the opposite.
                let of_b = radii(&b, &-normal);
                let axes = [across(&normal), across(&-normal)];
                let turn =
                    Mat3::from_fn(
                        |i, j| if i < 2 && j < 2 { axes[0][i].dot(&axes[1][j]) } else { 0.0 },
                    );
                let of_b = Mat3::from_fn(|i, j| if i < 2 && j < 2 { of_b[i][j] } else { 0.0 });
                let of_b = turn * of_b * turn.transpose();
                let of_b = inverse([[of_b[(0, 0)], of_b[(0, 1)]], [of_b[(1, 0)], of_b[(1, 1)]]]);
                sum = [sum[0] + of_b[0], sum[1] + of_b[1], sum[2] + of_b[2]];
            }
            let found = of_pair(&a, &b, &normal, 0.0).root_of_radius;
            let off = (found / root_of_radius(sum) - 1.0).abs();
            println!("{} and {}: off by {off:.1e}", shape.kind().name(), other.kind().name());
            let is_averaged = !shape.kind().is_ellipsoidal()
                || other.kind() != Kind::HalfSpace && !other.kind().is_ellipsoidal();
            let worst = &mut worst[usize::from(is_averaged)];
            *worst = worst.max(off);
        }
    }
    // The program averages over eight directions, the reference over 720.
    assert!(worst[0] < 1e-8 && worst[1] < 1e-2, "{worst:?}");
}

/// Closed forms and bounds.
#[test]
fn radii_of_simple_contacts() {
    let (identity, turned) =
        (Mat3::identity(), Mat3::from_columns(&[Vec3::y(), -Vec3::x(), Vec3::z()]));
    let plane = Shape::HalfSpace(HalfSpace::at_reference(Vec3::z()));
    let on_plane = Posed::new(&plane, &identity);
    let ellipsoid = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(2.0, 1.0, 1.0) });
    let lying = Posed::new(&ellipsoid, &identity);
    let down = -Vec3::z();
    // R' = 4, R'' = 1.
    let root = of_pair(&lying, &on_plane, &down, 0.0).root_of_radius;
    assert!((root / (2.0_f64.sqrt() * f2_of(4.0).powf(-1.5)) - 1.0).abs() < 1e-12, "{root}");
    assert!((flattest(&ellipsoid) / root - 1.0).abs() < 1e-15);
    // Both curvatures are 1/4 + 1: a circle.
    let crossed = Posed::new(&ellipsoid, &turned);
    let found = of_pair(&lying, &crossed, &down, 0.01);
    assert!((found.root_of_radius / 0.8_f64.sqrt() - 1.0).abs() < 1e-12);
    // Side by side: 1/2 and 2.
    let aligned = of_pair(&lying, &lying, &down, 0.01).root_of_radius;
    assert!((aligned / (f2_of(4.0).powf(-1.5)) - 1.0).abs() < 1e-12);
    for curvature in [found, of_pair(&lying, &on_plane, &down, 0.01)] {
        assert!(curvature.force.norm() < 1e-15 && curvature.moment.norm() < 1e-15);
    }
    // Spheres as spheres and as ellipsoids.
    for (radius, other) in [(0.3, 0.7), (1.0, 1.0)] {
        let shapes =
            [radius, other].map(|r| Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::repeat(r) }));
        let [a, b] = [0, 1].map(|k| Posed::new(&shapes[k], &turned));
        let expected = (1.0 / (1.0 / radius + 1.0 / other)).sqrt();
        let Curvature { root_of_radius, force, moment, .. } =
            of_pair(&a, &b, &Vec3::new(0.48, 0.6, 0.64), 0.01);
        assert!((root_of_radius / expected - 1.0).abs() < 1e-13);
        assert!(force.norm() < 1e-13 && moment.norm() < 1e-13, "{force:?} {moment:?}");
    }
    // The flattest radius lies between two values. One is where the surface z = 1 - x^5 / 5 has bent by 0.1 rad, the other is that of a cube.
    let blunt = Superellipsoid::new(Vec3::repeat(1.0), [0.4, 0.4]);
    let found = flattest(&Shape::Superellipsoid(blunt)).powi(2);
    println!("{found}");
    assert!(found > 0.1_f64.powf(0.25) / 0.1 && found < 10.0, "{found}");
}

/// Touch and curvature of a pair with B's centre at `r`.
fn touching(shapes: [&Shape; 2], frames: [&Mat3; 2], r: &Vec3) -> (Touch, Curvature) {
    let (a, b) = (Posed::new(shapes[0], frames[0]), Posed::new(shapes[1], frames[1]));
    let kinds = ordered((shapes[0].kind(), shapes[1].kind()));
    let table = table(&Method::Auto, &[kinds.0, kinds.1]);
    let Outcome::Touching(touch) = table.get(kinds).unwrap().touch(&a, &b, r, None) else {
        panic!("{shapes:?} touch")
    };
    let curvature = of_pair(&a, &b, &touch.normal, touch.overlap);
    (touch, curvature)
}

/// Forces and moments are the gradient of the energy along all ways in which two bodies can move and turn. The first body is also touched on or near
/// its equator.
#[test]
fn forces_are_the_gradient_of_the_energy() {
    let plane = Shape::HalfSpace(HalfSpace::at_reference(Vec3::z()));
    let mut random = Random::of(3, 1);
    let mut worst = [[0.0_f64; 2]; 2];
    for shape in shapes() {
        let levels = [None, Some(0.0), Some(1e-5)];
        let all = shapes();
        let others =
            all.iter().chain([&plane]).flat_map(|other| levels.map(|level| (other, level)));
        for (other, level) in others {
            let mut frames = [frame(&mut random), frame(&mut random)];
            let normal = if other.kind() == Kind::HalfSpace {
                -(frames[1] * Vec3::z())
            } else {
                random.rotation() * Vec3::x()
            };
            if let Some(level) = level {
                let own = frames[0].tr_mul(&normal);
                let place = Vec3::new(own.x, own.y, level).normalize();
                let turn = Quat::rotation_between(&place, &own).unwrap_or_else(Quat::identity);
                frames[0] *= turn.to_rotation_matrix();
            }
            let (a, b) = (Posed::new(&shape, &frames[0]), Posed::new(other, &frames[1]));
            let mut r = a.support(&normal) - normal * 0.02;
            if other.kind() != Kind::HalfSpace {
                r -= b.support(&-normal);
            }
            let energy = |turns: [Vec3; 2], shift: Vec3| {
                let frames = [0, 1]
                    .map(|k| Quat::from_scaled_axis(turns[k]).to_rotation_matrix() * frames[k]);
                let (touch, curvature) =
                    touching([&shape, other], [&frames[0], &frames[1]], &(r + shift));
                curvature.root_of_radius * touch.overlap.powf(2.5)
            };
            let (touch, curvature) = touching([&shape, other], [&frames[0], &frames[1]], &r);
            let stored = curvature.root_of_radius * touch.overlap.powf(2.5);
            let force = touch.normal * (2.5 * stored / touch.overlap) + curvature.force * stored;
            let moment = curvature.moment * stored;
            let on_a = -touch.point.cross(&force) - moment;
            let on_b = (touch.point - r).cross(&force) + moment;
            let way = 1e-5;
            for axis in 0..3 {
                let step = Vec3::ith(axis, way);
                let zero = Vec3::zeros();
                for (found, expected, is_moment) in [
                    (force[axis], energy([zero; 2], -step) - energy([zero; 2], step), 0),
                    (on_a[axis], energy([-step, zero], zero) - energy([step, zero], zero), 1),
                    (on_b[axis], energy([zero, -step], zero) - energy([zero, step], zero), 1),
                ] {
                    let expected = expected / (2.0 * way);
                    let off = (found - expected).abs() / force.norm();
                    let worst = &mut worst[usize::from(level.is_some())][is_moment];
                    *worst = worst.max(off);
                    // Radii of curvature at the equator are 0 or infinite, and the differences reach positions beside it.
                    assert!(
                        off < if level.is_none() { 2e-6 } else { 1e-4 },
                        "{} and {}, axis {axis}, at {level:?}: {found:e}, expected {expected:e}",
                        shape.kind().name(),
                        other.kind().name()
                    );
                }
            }
        }
    }
    println!(
        "forces and moments off by these parts of the force, anywhere and at equators: {worst:?}"
    );
}

/// Effect of a cap on the radii of flat sides. The values are those of the guide: forces on a side and on a face over that on a corner.
#[test]
fn a_cap_on_flat_sides_would_make_the_energy_jump() {
    for (cap, on_side, on_face) in
        [(2.0_f64, 1.20, 1.41), (5.0, 1.58, 2.24), (10.0, 1.97, 3.16), (50.0, 3.49, 7.07)]
    {
        // √Re F2^(-3/2), in units of the rounding radius of the edges.
        let side = cap.sqrt().sqrt() * stiffening_of_ratio(cap);
        let face = cap.sqrt() * stiffening_of_ratio(1.0);
        assert!(
            (side - on_side).abs() < 6e-3 && (face - on_face).abs() < 6e-3,
            "{cap}: {side} {face}"
        );
    }
}
