//! Superellipsoids and poly-superellipsoids. Geometry is checked against closed forms, differences and sampling, and the
//! common normal against answers of 50 digits and against EPA. A packing of them follows.

use crate::support::placed::Case;
use crate::support::random::Draw;
use crate::support::{Bench, Frame, OnRanks, begun, save, scene};
use dem_mpi::comm::threads;
use dem_mpi::contact::{
    CommonNormal, ContactResolver, Epa, ErodedGjk, Method, Outcome, Posed, SmoothCommonNormal,
    Touch, table,
};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::particles::records::Particle;
use dem_mpi::random::Random;
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble::{self, Continuation, StartError};
use dem_mpi::shape::{
    Convex, Ellipsoid, Kind, PolySuperellipsoid, Polyhedron, RoundedPolyhedron, Shape, Sphere,
    Spherocylinder, Superellipsoid,
};
use std::f64::consts::PI;

const EXPONENTS: [f64; 6] = [0.3, 0.5, 0.8, 1.0, 1.5, 2.0];

/// Equal numbers of superellipsoids and poly-superellipsoids.
fn shapes(random: &mut Random, exponents: [f64; 2]) -> Vec<Shape> {
    let both = |_| {
        let axes = [0, 1, 2].map(|_| random.vector(0.5, 1.5));
        [superellipsoid(axes[0], exponents), octants(axes[1], axes[2], exponents)]
    };
    (0..8).flat_map(both).collect()
}

fn superellipsoid(axes: Vec3, exponents: [f64; 2]) -> Shape {
    Shape::Superellipsoid(Superellipsoid::new(axes, exponents))
}

fn octants(positive: Vec3, negative: Vec3, exponents: [f64; 2]) -> Shape {
    Shape::PolySuperellipsoid(Box::new(PolySuperellipsoid::new(positive, negative, exponents)))
}

fn every_pair_of_exponents() -> impl Iterator<Item = [f64; 2]> {
    EXPONENTS.into_iter().flat_map(|e1| EXPONENTS.map(|e2| [e1, e2]))
}

// --- geometry ---

/// Left side of the surface's equation `F = 1`; `point` is relative to the point where the octants meet.
fn implicit([positive, negative]: [Vec3; 2], [e1, e2]: [f64; 2], point: &Vec3) -> f64 {
    let x = Vec3::from_fn(|i, _| {
        let axis = if point[i] < 0.0 { negative[i] } else { positive[i] };
        point[i].abs() / axis
    });
    (x.x.powf(2.0 / e2) + x.y.powf(2.0 / e2)).powf(e2 / e1) + x.z.powf(2.0 / e1)
}

/// `F` of a shape at a point in its own frame.
fn implicit_of(shape: &Shape, point: &Vec3) -> f64 {
    match shape {
        Shape::Superellipsoid(s) => implicit([s.semi_axes(); 2], s.exponents(), point),
        Shape::PolySuperellipsoid(p) => {
            implicit(p.semi_axes(), p.exponents(), &(p.axes() * point + p.centre()))
        }
        _ => unreachable!("only superellipsoids here"),
    }
}

#[test]
fn support_points_are_the_farthest_of_the_surface() {
    for (i, exponents) in every_pair_of_exponents().enumerate() {
        let mut random = Random::of(i as u64, 0);
        for shape in shapes(&mut random, exponents) {
            let direction = random.direction();
            let point = shape.support(&direction);
            let off = (implicit_of(&shape, &point) - 1.0).abs();
            // F has powers up to 2 / 0.3 of coordinates that are exact to rounding.
            assert!(off < 1e-13, "{exponents:?}: F is off by {off:e}");
            for _ in 0..50 {
                // Point of the surface along a ray from the centre of mass, by bisection.
                let ray = random.direction();
                let (mut inside, mut outside) = (0.0, 4.0);
                while outside - inside > 1e-12 {
                    let middle = 0.5 * (inside + outside);
                    if implicit_of(&shape, &(ray * middle)) < 1.0 {
                        inside = middle;
                    } else {
                        outside = middle;
                    }
                }
                let excess = (ray * inside - point).dot(&direction);
                assert!(excess < 1e-12, "{exponents:?}: {excess:e} farther");
                let radius = shape.inscribed_radius();
                assert!(outside >= radius - 1e-12, "{exponents:?}: {outside} inside {radius}");
                let radius = shape.bounding_radius();
                assert!(inside <= radius + 1e-12, "{exponents:?}: {inside} outside {radius}");
            }
        }
    }
}

/// The gradient of the support function is the support point, and its Hessian is that point's derivative.
#[test]
fn derivatives_agree_with_differences() {
    const STEP: f64 = 1e-6;
    for (i, exponents) in every_pair_of_exponents().enumerate() {
        let mut random = Random::of(i as u64, 0);
        let shapes = shapes(&mut random, exponents);
        for k in 0..200 {
            let (shape, u) = (&shapes[k % shapes.len()], random.direction());
            let Some(curved) = shape.curved_support(&u) else {
                assert!(exponents.contains(&2.0), "{exponents:?}");
                continue;
            };
            let v = random.direction();
            let (ahead, behind) = (u + v * STEP, u - v * STEP);
            let (there, back) = (shape.support(&ahead), shape.support(&behind));
            let value = (there.dot(&ahead) - back.dot(&behind)) / (2.0 * STEP);
            let slope = curved.point.dot(&v);
            assert!((value - slope).abs() < 1e-7, "{exponents:?} {u:?}: {value} is not {slope}");
            let change = (there - back) / (2.0 * STEP);
            let expected = curved.hessian_times(&v);
            // Curvature changes within the step like the inverse of the least component.
            let least = u.abs().min();
            let bound = 1e-8 + 1e-9 / (least * least) * (1.0 + expected.norm());
            let off = (change - expected).norm();
            assert!(off < bound, "{exponents:?} {u:?}: {expected:?} is off by {off:e}");
            assert!(curved.hessian_times(&u).norm() <= 1e-12 * (1.0 + expected.norm()) / least);
        }
    }
}

/// Bounding and inscribed radius equal those of the sampled surface.
#[test]
fn radii_are_tight() {
    for (i, exponents) in every_pair_of_exponents().enumerate() {
        let mut random = Random::of(100 + i as u64, 0);
        let shape = octants(random.vector(0.5, 1.5), random.vector(0.5, 1.5), exponents);
        let mut farthest: f64 = 0.0;
        for _ in 0..100 {
            // Ascent on the distance.
            let mut up = random.direction();
            for _ in 0..60 {
                up = shape.support(&up).normalize();
            }
            farthest = farthest.max(shape.support(&up).norm());
        }
        // Random descent on the height.
        let height = |u: &Vec3| shape.support(u).dot(u);
        let mut down = random.direction();
        for i in 0..3000 {
            let reach = if i < 1000 { 2.0 } else { 0.05 };
            let other = (down + random.direction() * reach).normalize();
            if height(&other) < height(&down) {
                down = other;
            }
        }
        let nearest = height(&down);
        let (bounding, inscribed) = (shape.bounding_radius(), shape.inscribed_radius());
        assert!(bounding <= 1.001 * farthest, "{exponents:?}: {bounding} for {farthest}");
        assert!(inscribed >= 0.88 * nearest, "{exponents:?}: {inscribed} for {nearest}");
    }
}

#[test]
fn smallest_radius_of_curvature() {
    for exponents in every_pair_of_exponents() {
        let mut random = Random::of(3, 0);
        let shape = octants(random.vector(0.5, 1.5), random.vector(0.5, 1.5), exponents);
        let radius = shape.smallest_curvature_radius();
        if exponents.iter().any(|&e| e > 1.0) {
            assert_eq!(radius, 0.0, "{exponents:?}");
            continue;
        }
        // A ball of this radius rolls inside the surface: no support plane cuts it.
        for _ in 0..2000 {
            let (u, v) = (random.direction(), random.direction());
            let centre = shape.support(&u) - u * radius;
            let room = shape.support(&v).dot(&v) - centre.dot(&v) - radius;
            assert!(room > -1e-12, "{exponents:?}: {room:e}");
        }
    }
}

fn close(found: f64, expected: f64, relative: f64) -> bool {
    (found - expected).abs() <= relative * expected.abs()
}

#[test]
fn moments_of_known_solids() {
    let axes = Vec3::new(1.3, 0.7, 0.4);
    let squares = axes.component_mul(&axes);
    let sums = Vec3::new(squares.y + squares.z, squares.x + squares.z, squares.x + squares.y);
    // Box, elliptic cylinder, ellipsoid, double cone, octahedron. The values are the volume over a b c, and the mean square
    // over the square of the semi-axis, across and along z.
    let solids = [
        ([1e-9, 1e-9], 8.0, 1.0 / 3.0, 1.0 / 3.0),
        ([1e-9, 1.0], 2.0 * PI, 0.25, 1.0 / 3.0),
        ([1.0, 1.0], 4.0 / 3.0 * PI, 0.2, 0.2),
        ([2.0, 1.0], 2.0 / 3.0 * PI, 0.15, 0.1),
        ([2.0, 2.0], 4.0 / 3.0, 0.1, 0.1),
    ];
    for (exponents, volume, across, along) in solids {
        let mean = Vec3::new(squares.x * across, squares.y * across, squares.z * along);
        let gyration = Vec3::new(mean.y + mean.z, mean.x + mean.z, mean.x + mean.y);
        for shape in [superellipsoid(axes, exponents), octants(axes, axes, exponents)] {
            assert!(close(shape.volume(), volume * axes.product(), 1e-8), "{exponents:?}");
            for i in 0..3 {
                let (found, expected) = (shape.gyration()[i], gyration[i]);
                assert!(close(found, expected, 1e-8), "{exponents:?}: {found} is not {expected}");
            }
        }
    }
    // The moments increase towards the box.
    let mut last = 0.0;
    for e in [1.5, 1.0, 0.7, 0.4, 0.2, 0.05] {
        let now = superellipsoid(axes, [e, e]).gyration().x;
        assert!(now > last && now < sums.x / 3.0, "{e}: {now} after {last}");
        last = now;
    }
}

/// Volume, centre of mass and inertia of octants by counting points.
#[test]
fn moments_of_octants_by_sampling() {
    const POINTS: usize = 100;
    let (positive, negative) = (Vec3::new(1.2, 0.8, 0.6), Vec3::new(0.6, 0.9, 0.3));
    for exponents in [[0.5, 0.8], [1.0, 1.0], [1.4, 0.6]] {
        let octants = PolySuperellipsoid::new(positive, negative, exponents);
        let cell = (positive + negative) / POINTS as f64;
        let (mut count, mut first, mut second) = (0.0, Vec3::zeros(), Mat3::zeros());
        for n in 0..POINTS * POINTS * POINTS {
            let index = [n % POINTS, n / POINTS % POINTS, n / POINTS / POINTS];
            let point = Vec3::from_fn(|i, _| (index[i] as f64 + 0.5) * cell[i] - negative[i]);
            if implicit([positive, negative], exponents, &point) <= 1.0 {
                let own = octants.axes().tr_mul(&(point - octants.centre()));
                count += 1.0;
                first += own;
                second += own * own.transpose();
            }
        }
        let volume = count * cell.product();
        assert!(close(octants.volume(), volume, 1e-3), "{exponents:?}: {volume}");
        assert!((first / count).norm() < 1e-3, "{exponents:?}: {first}");
        let spread = second / count;
        let gyration = Mat3::identity() * spread.trace() - spread;
        let off = gyration - Mat3::from_diagonal(&octants.gyration());
        assert!(off.abs().max() < 1e-3, "{exponents:?}: {off}");
        assert!((octants.axes().determinant() - 1.0).abs() < 1e-14);
    }
}

// --- contact ---

/// Backward error relative to the longest semi-axis; for its amplification by curvature see `tests/reference/README.md`. The
/// overlap is exact to rounding. The error of the normal is a rounding of the gradient over the least eigenvalue κ of the
/// Hessian. The error of the contact point is the normal's error times the largest radius of curvature ϱ, which has no bound
/// across flat faces.
const BACKWARD: f64 = 1e-13;

#[test]
fn reference_answers() {
    let body = |row: &serde_json::Value| {
        let vector = |name: &str| serde_json::from_value::<Vec3>(row[name].clone()).unwrap();
        let exponent = |name: &str| row[name].as_f64().unwrap();
        let [w, x, y, z]: [f64; 4] = serde_json::from_value(row["q"].clone()).unwrap();
        let frame = Quat::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        let shape = superellipsoid(vector("abc"), [exponent("e1"), exponent("e2")]);
        (shape, frame.to_rotation_matrix().into_inner(), vector("c"))
    };
    let mut rows = 0;
    for line in include_str!("../reference/superellipsoids_public.jsonl").lines() {
        let row: serde_json::Value = serde_json::from_str(line).unwrap();
        let vector = |name: &str| serde_json::from_value::<Vec3>(row[name].clone()).unwrap();
        let ((shape_a, frame_a, at), (shape_b, frame_b, b_at)) = (body(&row["A"]), body(&row["B"]));
        let a = Posed::new(&shape_a, &frame_a);
        let b = Posed::new(&shape_b, &frame_b);
        let (id, overlap) = (&row["id"], row["overlap"].as_f64().unwrap());
        let table = table(&Method::Auto, &[Kind::Superellipsoid]);
        let resolver = table.get((Kind::Superellipsoid, Kind::Superellipsoid)).unwrap();
        rows += 1;
        let touch = match resolver.touch(&a, &b, &(b_at - at), None) {
            Outcome::Touching(touch) => touch,
            Outcome::Apart(clearance) => {
                assert!(overlap <= 0.0 && clearance <= BACKWARD - overlap, "{id}: {clearance}");
                continue;
            }
            Outcome::Failed(why) => panic!("{id}: {why:?}"),
        };
        let size = shape_a.semi_axes().max().max(shape_b.semi_axes().max());
        let error = BACKWARD * size;
        assert!((touch.overlap - overlap).abs() <= error, "{id}: {touch:?} but {overlap}");
        let (normal, point) = (vector("n"), vector("C") - at);
        let (kappa, rho) = condition(&a, &b, &normal, overlap);
        let off = (touch.normal - normal).norm();
        assert!(off <= error / kappa + 1e-15, "{id}: normal off by {off:e}, κ is {kappa:e}");
        let off = (touch.point - point).norm();
        assert!(off <= error * (1.0 + rho / kappa), "{id}: point off by {off:e}, ϱ is {rho:e}");
    }
    assert_eq!(rows, 40);
}

/// Least eigenvalue of the Hessian of the overlap at the minimum, and largest radius of curvature.
fn condition(a: &Posed, b: &Posed, normal: &Vec3, overlap: f64) -> (f64, f64) {
    let hessian = |body: &Posed, outward: Vec3| {
        let curved = body.shape.curved_support(&body.frame.tr_mul(&outward)).unwrap();
        let column =
            |i: usize| body.frame * curved.hessian_times(&body.frame.tr_mul(&Vec3::ith(i, 1.0)));
        Mat3::from_columns(&[column(0), column(1), column(2)])
    };
    let (of_a, of_b) = (hessian(a, *normal), hessian(b, -normal));
    let radii = of_a.symmetric_eigenvalues().max().max(of_b.symmetric_eigenvalues().max());
    // The eigenvalue along the normal is zero, so it is shifted upwards.
    let lifted = of_a + of_b + normal * normal.transpose() * 1e3;
    (lifted.symmetric_eigenvalues().min() - overlap, radii)
}

/// A pair of these shapes in random orientations, with this overlap along a random normal; the least overlap may be less.
fn turned(random: &mut Random, a: &Shape, b: &Shape, overlap: f64) -> Case {
    let (a, b) = ((a.clone(), random.frame()), (b.clone(), random.frame()));
    Case::of(a, b, random, overlap)
}

/// Every pair is answered, nearly all by Newton's method, and the answer is the least overlap. The tolerance is EPA's, or
/// that of the search for rivals where several minima nearly tie.
#[test]
fn as_deep_as_epa_says() {
    const PAIRS: usize = 2000;
    let method = table(&Method::Auto, &Kind::ALL);
    let chain = method.get((Kind::Superellipsoid, Kind::PolySuperellipsoid)).unwrap();
    let kinds = [
        ([0.3, 0.3], [0.3, 0.3]),
        ([0.5, 0.5], [0.5, 0.5]),
        ([0.8, 0.8], [0.8, 0.8]),
        ([1.5, 1.5], [1.5, 1.5]),
        ([0.3, 1.0], [1.0, 0.3]),
        ([1.5, 0.5], [0.5, 1.5]),
        ([0.3, 0.8], [1.5, 1.0]),
        ([1.0, 1.0], [0.5, 0.3]),
    ];
    for (of_a, of_b) in kinds {
        let mut random = Random::of(5, 0);
        let (shapes_a, shapes_b) = (shapes(&mut random, of_a), shapes(&mut random, of_b));
        let (mut passed_on, mut tied) = (0, 0);
        for i in 0..PAIRS {
            let mut random = Random::of(i as u64, 0);
            let overlap = random.between(1e-9, 0.05);
            let (a, b) = (&shapes_a[i % shapes_a.len()], &shapes_b[i / 3 % shapes_b.len()]);
            let case = turned(&mut random, a, b, overlap);
            passed_on +=
                usize::from(matches!(case.resolve(&SmoothCommonNormal, None), Outcome::Failed(_)));
            let exact = match case.resolve(&Epa::new(1e-11), None) {
                Outcome::Touching(touch) => touch.overlap,
                Outcome::Apart(_) => 0.0,
                Outcome::Failed(_) => continue,
            };
            let found = match case.resolve(chain, None) {
                Outcome::Touching(touch) => touch.overlap,
                Outcome::Apart(_) => 0.0,
                Outcome::Failed(why) => panic!("{of_a:?} {of_b:?}, {i}: {why:?}"),
            };
            let excess = found - exact;
            assert!((-4e-11..4e-7).contains(&excess), "{of_a:?} {of_b:?}, {i}: {excess:e}");
            tied += usize::from(excess > 1e-10);
        }
        assert!(passed_on <= PAIRS / 200, "{of_a:?} {of_b:?}: {passed_on} passed on");
        assert!(tied <= PAIRS / 500, "{of_a:?} {of_b:?}: {tied} ties");
    }
}

/// No direction gives a smaller overlap, also beside a body with edges. Newton's method refines the result beside a corner or
/// an edge and must not leave for another side.
#[test]
fn no_deeper_than_along_any_direction() {
    const PAIRS: u64 = 4000;
    let corners = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]];
    let corners = corners.map(|corner| Vec3::from(corner.map(f64::from)));
    let rounded = RoundedPolyhedron::new(&corners, 0.3).unwrap();
    let partners = [
        Shape::Spherocylinder(Spherocylinder { length: 3.0, radius: 0.5 }),
        Shape::Spherocylinder(Spherocylinder { length: 0.5, radius: 0.1 }),
        Shape::Polyhedron(Box::new(Polyhedron::new(&corners).unwrap())),
        Shape::RoundedPolyhedron(Box::new(rounded)),
    ];
    let method = table(&Method::Auto, &Kind::ALL);
    for exponents in [[0.2, 0.2], [0.25, 0.25], [0.25, 1.5], [0.5, 0.5], [1.5, 0.3]] {
        let blunt = superellipsoid(Vec3::new(1.0, 1.0, 1.0), exponents);
        for (k, partner) in partners.iter().enumerate() {
            let (a, b) =
                if blunt.kind() < partner.kind() { (&blunt, partner) } else { (partner, &blunt) };
            let chain = method.get((a.kind(), b.kind())).unwrap();
            for i in 0..PAIRS {
                let mut random = Random::of(i, k as u64);
                let overlap = random.between(1e-6, 0.05);
                let case = turned(&mut random, a, b, overlap);
                if let Outcome::Touching(touch) = case.resolve(chain, None) {
                    assert!(
                        touch.overlap <= overlap + 1e-7,
                        "{exponents:?} and partner {k}, {i}: {} of {overlap}",
                        touch.overlap
                    );
                }
            }
        }
    }
}

/// A die and a rod from a mixture. Newton's method once left their contact for the other side of the die. The overlap there
/// was three times the rod's diameter, and the run created energy.
#[test]
fn the_last_digits_do_not_leave_the_contact() {
    let frame = |w, x, y, z| {
        let rotation = Quat::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        *rotation.to_rotation_matrix().matrix()
    };
    let die = superellipsoid(Vec3::repeat(2.0), [0.25, 0.25]);
    let rod = Shape::Spherocylinder(Spherocylinder { length: 6.0, radius: 1.0 });
    let case = Case {
        a: (
            die,
            frame(
                -0.406_881_789_194_404_6,
                0.148_518_470_609_361_85,
                -0.891_160_318_964_929_8,
                -0.134_991_701_271_377_6,
            ),
        ),
        b: (
            rod,
            frame(
                0.117_888_273_853_587_27,
                0.344_300_820_012_512_7,
                -0.773_203_603_005_635_6,
                0.519_341_398_817_421_8,
            ),
        ),
        r: Vec3::new(0.996_213_696_944_446, 3.941_283_993_738_536, -1.176_671_264_273_846),
    };
    let method = table(&Method::Auto, &Kind::ALL);
    let chain = method.get((Kind::Superellipsoid, Kind::Spherocylinder)).unwrap();
    let overlap = |resolver: &dyn ContactResolver| match case.resolve(resolver, None) {
        Outcome::Touching(touch) => touch.overlap,
        other => panic!("{other:?}"),
    };
    assert!((overlap(chain) - overlap(&Epa::new(1e-10))).abs() < 1e-9);
}

/// A small thin body beside a crest of a large one. From the line of centres, Newton's method reaches a minimum on the
/// crest's other side, deeper than the thickness of the small body.
#[test]
fn crests_are_not_passed_through() {
    let method = table(&Method::Auto, &Kind::ALL);
    let chain = method.get((Kind::Superellipsoid, Kind::Superellipsoid)).unwrap();
    for (a, turn_a, b, turn_b, r, expected) in [
        (
            superellipsoid(
                Vec3::new(1.0, 0.096_690_343_683_729_89, 0.030_337_109_217_934_487),
                [1.5, 0.1],
            ),
            [
                -0.216_478_484_579_031_13,
                0.697_232_320_607_606_3,
                0.646_662_598_021_077,
                0.220_978_825_083_149_92,
            ],
            superellipsoid(
                Vec3::new(
                    0.098_105_498_244_597_48,
                    0.013_973_124_947_149_803,
                    0.001_532_540_635_334_200_6,
                ),
                [1.2, 1.5],
            ),
            [
                0.027_733_467_517_411_604,
                0.518_665_726_149_124_4,
                -0.826_390_230_101_478_9,
                -0.217_476_221_436_934_76,
            ],
            Vec3::new(0.039_920_526_226_880_18, 0.895_704_711_511_589_1, 0.606_891_548_472_281_7),
            9.1e-8,
        ),
        (
            superellipsoid(
                Vec3::new(
                    0.063_790_017_680_494_14,
                    0.001_416_496_288_900_762_4,
                    0.004_157_965_025_468_463,
                ),
                [1.6, 1.6],
            ),
            [
                0.076_081_189_504_573_33,
                0.872_433_245_934_246_8,
                0.292_366_801_627_306_9,
                -0.384_179_043_283_756_57,
            ],
            superellipsoid(
                Vec3::new(1.0, 0.050_226_443_545_561_154, 0.033_742_640_016_315_06),
                [1.5, 0.8],
            ),
            [
                -0.127_948_899_506_955_26,
                0.321_223_555_637_558_94,
                -0.614_733_651_295_523_5,
                -0.708_905_525_710_864_3,
            ],
            Vec3::new(0.795_296_874_448_892_5, 0.242_497_644_354_008_95, 0.556_824_031_451_811_8),
            8.8e-9,
        ),
        (
            superellipsoid(
                Vec3::new(1.0, 0.013_647_928_008_470_053, 0.613_383_064_758_524_1),
                [0.8, 1.6],
            ),
            [
                0.233_311_179_095_747_86,
                -0.117_379_017_647_618_8,
                -0.444_602_734_338_414_1,
                0.856_805_969_017_395_1,
            ],
            superellipsoid(
                Vec3::new(
                    0.002_126_541_712_665_119,
                    0.000_113_799_874_039_238_26,
                    0.000_179_078_876_727_363_23,
                ),
                [1.2, 1.5],
            ),
            [
                0.693_667_608_297_575_7,
                -0.563_311_853_320_049_3,
                -0.291_557_046_254_680_1,
                0.341_320_221_913_525_96,
            ],
            Vec3::new(0.248_020_784_467_585_7, -0.670_838_621_155_384_1, 0.316_183_268_217_530_9),
            3.3e-10,
        ),
    ] {
        let frame = |[w, x, y, z]: [f64; 4]| {
            *Quat::from_quaternion(nalgebra::Quaternion::new(w, x, y, z))
                .to_rotation_matrix()
                .matrix()
        };
        let case = Case { a: (a, frame(turn_a)), b: (b, frame(turn_b)), r };
        let overlap = |resolver: &dyn ContactResolver| match case.resolve(resolver, None) {
            Outcome::Touching(touch) => touch.overlap,
            Outcome::Apart(_) => 0.0,
            Outcome::Failed(why) => panic!("{expected:e}: {why:?}"),
        };
        let (found, exact) = (overlap(chain), overlap(&Epa::new(1e-11)));
        println!("{found:e} {exact:e} {expected:e}");
        assert!((found - exact).abs() < 1e-9, "{found:e}, by EPA {exact:e}");
    }
}

/// Results have identical bits on every machine and with every compiler. The sum is over results as they were when the test
/// was written.
#[test]
fn bits_are_pinned() {
    let mut hash: u64 = 0;
    let mut add = |x: f64| hash = hash.rotate_left(1) ^ x.to_bits();
    for (i, exponents) in every_pair_of_exponents().enumerate() {
        let mut random = Random::of(i as u64, 0);
        let other = octants(random.vector(0.5, 1.5), random.vector(0.5, 1.5), [0.7, 1.2]);
        for shape in shapes(&mut random, exponents) {
            let case = turned(&mut random, &shape, &other, 0.03);
            if let Outcome::Touching(Touch { overlap, normal, point }) =
                case.resolve(&SmoothCommonNormal, None)
            {
                [overlap].iter().chain(&normal).chain(&point).for_each(|&x| add(x));
            }
            case.a.0.gyration().iter().for_each(|&x| add(x));
        }
    }
    assert_eq!(hash, 0x6951_e4a9_1353_1293, "{hash:#x}");
}

/// With exponents of 1 the answer is the ellipsoid's, bit for bit.
#[test]
fn exponents_of_one_are_ellipsoids() {
    for i in 0..200 {
        let mut random = Random::of(i, 0);
        let axes = [random.vector(0.5, 1.5), random.vector(0.5, 1.5)];
        let [a, b] = axes.map(|axes| (superellipsoid(axes, [1.0, 1.0]), random.frame()));
        let r = random.direction() * random.between(0.5, 3.0);
        let case = Case { a, b, r };
        let [a, b] = axes.map(|semi_axes| Shape::Ellipsoid(Ellipsoid { semi_axes }));
        let same = Case { a: (a, case.a.1), b: (b, case.b.1), r };
        assert_eq!(
            case.resolve(&SmoothCommonNormal, None),
            same.resolve(&CommonNormal, None),
            "{i}"
        );
        assert_eq!(case.a.0.smallest_curvature_radius(), same.a.0.smallest_curvature_radius());
    }
}

/// Face on face, edge on edge, tip on tip, aligned: the Hessian is infinite or zero there.
#[test]
fn aligned_bodies() {
    let axes = Vec3::new(1.0, 0.8, 0.5);
    let method = table(&Method::Auto, &Kind::ALL);
    let chain = method.get((Kind::Superellipsoid, Kind::Superellipsoid)).unwrap();
    for exponents in every_pair_of_exponents() {
        // These exponents are left to EPA.
        let sharp = exponents.contains(&2.0);
        for shape in [superellipsoid(axes, exponents), octants(axes, axes, exponents)] {
            for way in [Vec3::x(), Vec3::y(), Vec3::z(), Vec3::new(1.0, 1.0, 0.0)] {
                for overlap in [-0.01, 1e-9, 0.001, 0.03] {
                    let top = shape.support(&way);
                    let r = top * 2.0 - way.normalize() * overlap;
                    let frame = Mat3::identity();
                    let body = (shape.clone(), frame);
                    let case = Case { a: body.clone(), b: body, r };
                    let found = case.resolve(chain, None);
                    let good = match &found {
                        Outcome::Touching(t) => {
                            t.overlap > 0.0
                                && t.overlap <= overlap + if sharp { 2e-10 } else { 1e-13 }
                                && (t.normal.norm() - 1.0).abs() < 1e-14
                                && t.point.iter().all(|x| x.is_finite())
                        }
                        Outcome::Apart(_) => overlap < 0.0 || sharp,
                        Outcome::Failed(_) => false,
                    };
                    assert!(good, "{exponents:?} {way:?} {overlap}: {found:?}");
                    let flat = exponents.iter().all(|&e| e <= 1.0) && way.sum() == 1.0;
                    if let (true, Outcome::Touching(t)) = (flat && overlap < 0.01, found) {
                        assert_eq!(t.normal, way, "{exponents:?}");
                        assert!((t.point - r * 0.5).norm() < 1e-15, "{exponents:?}: {t:?}");
                    }
                }
            }
        }
    }
}

// --- whole collisions ---

/// A superellipsoid that meets another body in free space, without friction or loss.
fn meeting(shape: &str, partner: &str, method: Method) -> Scene {
    let text = format!(
        r#"
[domain]
low = [-1e3, -1e3, -1e3]
high = [1e3, 1e3, 1e3]
[[material]]
name = "m"
density = 1.0
normal_stiffness = 1.0
[[shape]]
name = "a"
{shape}
[[shape]]
name = "b"
{partner}
[[fill.lattice]]
shapes = ["a", "b"]
first = [0, 0, 0]
spacing = 10.0
count = [2, 1, 1]
[time]
step = 1.0
allow_unstable = true
"#
    );
    let mut scene = scene(&text);
    scene.method = method;
    scene.dt = 0.02 * scene.time_step_limit().expect("there are grains").dt;
    scene
}

/// Ratio of the energies after and before a random collision, with an overlap of about a hundredth of the size. `gap` is the
/// initial gap over the size.
fn energy_kept(scene: &Scene, gap: f64, seed: u64) -> Option<f64> {
    let mut random = Random::of(seed, 0);
    let library = &scene.library;
    let shapes = [&library.shapes[0], &library.shapes[1]];
    let [m, n] = [library.mass[0], library.mass[1]];
    let size =
        0.6 * shapes.map(|shape| shape.volume().cbrt()).into_iter().fold(f64::INFINITY, f64::min);
    let speed = 0.01 * size * (1.0 / m + 1.0 / n).sqrt();
    let frames = [random.frame(), random.frame()];
    let toward = random.direction();
    // Slightly apart along the normal, with an offset sideways.
    let support = |k: usize, n: &Vec3| frames[k] * shapes[k].support(&frames[k].tr_mul(n));
    let r = support(0, &toward) - support(1, &-toward) + toward * (gap * size);
    let aside = random.direction() * (0.4 * speed);
    let approach = aside - toward * (speed + aside.dot(&toward));
    let spins = [0, 1].map(|_| random.direction() * (0.7 * random.unit() * speed / size));
    let particle = |k: usize, position: Vec3, velocity: Vec3| {
        let inertia = frames[k] * Mat3::from_diagonal(&library.inertia[k]) * frames[k].transpose();
        Particle {
            velocity,
            quaternion: Quat::from_matrix(&frames[k]),
            angular_velocity: spins[k],
            angular_momentum: inertia * spins[k],
            ..Particle::at_rest(GlobalId(k as u64), ShapeId(k as u16), position)
        }
    };
    let bodies = [
        particle(0, Vec3::zeros(), approach * (-n / (m + n))),
        particle(1, r, approach * (m / (m + n))),
    ];
    let mut bench = Bench::of(scene, &bodies);
    let energy = |bench: &mut Bench| {
        let m = bench.measure();
        (m.translation + m.rotation, m.contacts)
    };
    let (before, touching) = energy(&mut bench);
    assert_eq!(touching, 0, "{seed}: apart at the start");
    let (mut touched, mut free) = (false, 0);
    for _ in 0..9000 {
        bench.step();
        let touching = !bench.sim.contacts.is_empty();
        touched |= touching;
        free = if touching { 0 } else { free + 1 };
        if free > if touched { 60 } else { 4000 } {
            break;
        }
    }
    assert!(free > 0, "{seed}: they stick");
    touched.then(|| energy(&mut bench).0 / before)
}

/// Relative energy errors of a number of collisions in ascending order.
fn errors_of(shape: &str, partner: &str, method: Method, collisions: u64) -> Vec<f64> {
    let scene = meeting(shape, partner, method);
    // Erosion reports contacts of bodies that are still apart.
    let gap = if matches!(method, Method::GjkErosion(_)) { 0.03 } else { 0.002 };
    let kept = (0..collisions).filter_map(|seed| energy_kept(&scene, gap, seed));
    let mut errors: Vec<f64> = kept.map(|e| (e - 1.0).abs()).collect();
    assert!(2 * errors.len() as u64 > collisions, "{shape}: {} of {collisions} met", errors.len());
    errors.sort_by(f64::total_cmp);
    errors
}

/// Largest relative energy error of a number of collisions.
fn worst_of(shape: &str, partner: &str, method: Method, collisions: u64) -> f64 {
    errors_of(shape, partner, method, collisions).pop().expect("some have met")
}

fn body([e1, e2]: [f64; 2]) -> String {
    format!("kind = \"superellipsoid\"\nsemi_axes = [1.0, 0.8, 0.6]\nexponents = [{e1}, {e2}]")
}

/// All exponents that a scene accepts, to its limits: with itself, a ball and an ellipsoid. Only the time step causes errors:
/// the overlap is the least, and the contact point that of the common normal.
#[test]
fn collisions_keep_their_energy() {
    let partners =
        ["kind = \"sphere\"\nradius = 0.8", "kind = \"ellipsoid\"\nsemi_axes = [1.0, 0.5, 0.4]"];
    for e1 in [0.1, 0.2, 0.5, 1.0, 1.8] {
        for e2 in [0.1, 0.3, 1.0, 1.5, 1.8] {
            let shape = body([e1, e2]);
            for (partner, collisions) in [(shape.as_str(), 16), (partners[0], 8), (partners[1], 8)]
            {
                let worst = worst_of(&shape, partner, Method::Auto, collisions);
                assert!(worst < 2e-4, "{e1}, {e2} and {partner}: {worst:e}");
            }
        }
    }
}

/// With bodies that have edges, the normal is found first and then the point from the corner or the edge.
#[test]
fn collisions_with_edges_keep_their_energy() {
    let block = "kind = \"polyhedron\"\nvertices = [[0.8, 0.7, 0.6], [-0.8, 0.7, 0.6], [0.8, -0.7, 0.6], \
                 [-0.8, -0.7, 0.6], [0.8, 0.7, -0.6], [-0.8, 0.7, -0.6], [0.8, -0.7, -0.6], [-0.8, -0.7, -0.6]]";
    let octahedron = "kind = \"polyhedron\"\nvertices = [[1, 0, 0], [-1, 0, 0], [0, 0.8, 0], [0, -0.8, 0], \
                      [0, 0, 0.7], [0, 0, -0.7]]";
    let rod = "kind = \"spherocylinder\"\nlength = 1.0\nradius = 0.4";
    let rounded = block.replace("polyhedron", "rounded-polyhedron") + "\nradius = 0.2";
    for exponents in [[0.1, 0.1], [0.2, 1.8], [0.3, 0.3], [1.8, 0.1], [1.8, 1.8]] {
        for partner in [block, octahedron, rod, &rounded] {
            let worst = worst_of(&body(exponents), partner, Method::Auto, 16);
            assert!(worst < 1e-3, "{exponents:?} and {partner}: {worst:e}");
        }
    }
}

/// EPA alone would find the overlap, but not the point at which flat faces touch.
#[test]
fn collisions_by_epa_keep_their_energy() {
    let ball = "kind = \"sphere\"\nradius = 0.8";
    for exponents in [[0.1, 0.1], [0.3, 0.3], [1.8, 1.8]] {
        for partner in [&body(exponents), ball] {
            let worst = worst_of(&body(exponents), partner, Method::Epa(Epa::default()), 12);
            assert!(worst < 2e-4, "{exponents:?} and {partner}: {worst:e}");
        }
    }
}

/// The normal of erosion is not that of the least overlap; the warning of a run states these figures.
#[test]
fn collisions_by_erosion_do_not_keep_their_energy() {
    let ellipsoid = "kind = \"ellipsoid\"\nsemi_axes = [2.0, 1.0, 1.0]";
    for (shape, from, to) in [
        (ellipsoid, 0.01, 0.1),
        (&body([0.1, 0.1]), 0.1, 0.5),
        (&body([1.0, 1.0]), 0.01, 0.1),
        (&body([1.8, 1.8]), 0.1, 0.5),
    ] {
        let worst = worst_of(shape, shape, Method::GjkErosion(ErodedGjk::default()), 50);
        assert!((from..to).contains(&worst), "{shape}: {worst:e}");
    }
}

/// EPA as in the paper, without secants at its end. Its normal is off by the square root of the tolerance, which costs little
/// energy and gives no warning. The figures are the worst of a hundred.
#[test]
fn collisions_by_epa_without_secants_nearly_keep_their_energy() {
    let epa = Method::Epa(Epa { polish: false, ..Epa::default() });
    let ellipsoid = "kind = \"ellipsoid\"\nsemi_axes = [2.0, 1.0, 1.0]";
    for (shape, median, worst) in [
        (ellipsoid, 1e-5, 5e-5),
        (&body([0.1, 0.1]), 1e-5, 5e-5),
        (&body([1.0, 1.0]), 1e-5, 5e-5),
        (&body([1.8, 1.8]), 1e-5, 1.5e-3),
    ] {
        let errors = errors_of(shape, shape, epa, 100);
        let found = [errors[errors.len() / 2], errors[errors.len() - 1]];
        assert!(found[0] < median && found[1] < worst, "{shape}: {:e}, {:e}", found[0], found[1]);
    }
}

/// Collisions of octants conserve their energy, too.
#[test]
fn collisions_of_octants_keep_their_energy() {
    for exponents in [[0.1, 0.1], [0.1, 1.8], [1.8, 0.1], [0.7, 1.2], [1.8, 1.8]] {
        let [e1, e2] = exponents;
        let shape = format!(
            "kind = \"poly-superellipsoid\"\nsemi_axes_positive = [1.0, 0.8, 0.6]\n\
             semi_axes_negative = [0.7, 0.9, 0.8]\nexponents = [{e1}, {e2}]"
        );
        for partner in [shape.clone(), body([0.3, 0.3])] {
            let worst = worst_of(&shape, &partner, Method::Auto, 16);
            assert!(worst < 2e-4, "{exponents:?} and {partner}: {worst:e}");
        }
    }
}

/// A ball that presses on a face off its centre acts at that place. The ball determines the point, because in double
/// precision the normal of so flat a face does not.
#[test]
fn a_ball_touches_a_flat_face_where_it_is() {
    let method = table(&Method::Auto, &Kind::ALL);
    let chain = method.get((Kind::Sphere, Kind::Superellipsoid)).unwrap();
    let ball = Shape::Sphere(Sphere { radius: 0.5 });
    let frame = Mat3::identity();
    for (exponents, depth) in [([0.1, 0.1], 1e-12), ([0.2, 0.2], 1e-6), ([0.1, 1.0], 1e-11)] {
        let plate = superellipsoid(Vec3::new(1.0, 1.0, 0.5), exponents);
        let [a, b] = [&ball, &plate].map(|shape| Posed::new(shape, &frame));
        for (x, y) in [(0.2, 0.1), (0.05, -0.1), (0.0, 0.3), (-0.15, 0.2)] {
            let r = Vec3::new(-x, -y, -0.99);
            let Outcome::Touching(touch) = chain.touch(&a, &b, &r, None) else { panic!("apart") };
            assert!((touch.overlap - 0.01).abs() < depth, "{exponents:?}: {touch:?}");
            // The middle of the overlap, straight below the ball.
            let off = touch.point - Vec3::new(0.0, 0.0, -0.495);
            assert!(off.norm() < 1e-5, "{exponents:?} at {x}, {y}: {off}");
        }
    }
}

// --- packing ---

const PACKING: &str = r#"
gravity = [5.0, 2.0, -98.1]
global_damping = 20.0
[domain]
low = [0.0, 0.0, 0.0]
high = [0.024, 0.024, 0.1]
walls = ["-x", "+x", "-y", "+y", "-z"]
[[material]]
name = "grain"
density = 265000.0
normal_stiffness = 1.5e5
friction = 0.3
restitution = 0.3
[[shape]]
name = "brick"
kind = "superellipsoid"
semi_axes = [0.0018, 0.0014, 0.0012]
exponents = [0.5, 0.5]
[[shape]]
name = "gem"
kind = "superellipsoid"
semi_axes = [0.0016, 0.0016, 0.0016]
exponents = [1.4, 0.8]
[[shape]]
name = "pebble"
kind = "poly-superellipsoid"
semi_axes_positive = [0.0018, 0.0012, 0.0014]
semi_axes_negative = [0.0012, 0.0014, 0.001]
exponents = [0.7, 1.1]
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.0018, 0.0012, 0.0012]
[[fill.lattice]]
shapes = { brick = 2, gem = 1, pebble = 2, egg = 1 }
first = [0.003, 0.003, 0.003]
count = [5, 5, 4]
spacing = 0.0045
velocity = [0.3, -0.2, -1.5]
"#;

#[test]
fn a_packing_is_the_same_on_any_number_of_ranks() {
    let scene = scene(PACKING);
    let alone = OnRanks::of(&scene).the_same_on(3000, &[2, 4], &[]);
    let contacts = alone.number("contacts") + alone.number("wall_contacts");
    assert!(contacts > 150.0, "{contacts} contacts are no packing");
    assert_eq!(alone.bits.len(), 100);
}

/// A snapshot with other exponents has another shape.
#[test]
fn a_restart_compares_shapes() {
    let folder = tempfile::tempdir().unwrap();
    let saved = scene(PACKING);
    threads::run(1, |comm| {
        save(&begun(&saved, comm), folder.path(), &saved, comm);
    });
    let take_up = |text: &str| {
        let scene = scene(text);
        threads::run(1, |comm| {
            let mut sim = assemble::assemble(&scene, comm);
            assemble::take_up(&mut sim, &scene, folder.path(), Continuation::SameStage, comm)
        })
        .remove(0)
    };
    assert!(take_up(PACKING).is_ok());
    let error = take_up(&PACKING.replace("[0.7, 1.1]", "[0.7, 1.0]")).unwrap_err();
    assert!(matches!(&error, StartError::Shape { shape, .. } if shape == "pebble"), "{error}");
}
