//! Shapes with sharp and rounded edges: mass, inertia, and contacts with each other and with walls, against
//! closed forms and independent answers.

use dem_mpi::contact::{
    AgainstHalfSpace, ContactResolver, Cores, Epa, ErodedGjk, Method, Outcome, Posed, Touch, table,
};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::random::Random;
use dem_mpi::shape::{
    Convex, HalfSpace, Kind, Polyhedron, RoundedPolyhedron, Shape, Sphere, Spherocylinder,
};
use std::f64::consts::PI;
use std::sync::Arc;

/// Rounding of lengths of order 1.
const ROUNDING: f64 = 1e-12;

// --- points ---

fn corners_of_box(half: [f64; 3]) -> Vec<Vec3> {
    let sign = |k: usize, bit: usize| if k >> bit & 1 == 1 { half[bit] } else { -half[bit] };
    (0..8).map(|k| Vec3::new(sign(k, 0), sign(k, 1), sign(k, 2))).collect()
}

fn moved(points: &[Vec3], turn: &Quat, by: &Vec3) -> Vec<Vec3> {
    points.iter().map(|p| turn * p + by).collect()
}

fn direction(random: &mut Random) -> Vec3 {
    random.rotation() * Vec3::x()
}

/// Corners on an ellipsoid: convex, without any symmetry.
fn pebble(random: &mut Random, count: usize) -> Vec<Vec3> {
    let axes = Vec3::new(1.0, 0.8, 0.6);
    (0..count).map(|_| direction(random).component_mul(&axes)).collect()
}

fn rounded(points: &[Vec3], radius: f64) -> Shape {
    Shape::RoundedPolyhedron(Box::new(RoundedPolyhedron::new(points, radius).unwrap()))
}

fn sharp(points: &[Vec3]) -> Shape {
    Shape::Polyhedron(Box::new(Polyhedron::new(points).unwrap()))
}

fn near(found: f64, expected: f64, tolerance: f64) -> bool {
    (found - expected).abs() <= tolerance
}

fn sorted(v: Vec3) -> Vec3 {
    let mut values: [f64; 3] = v.into();
    values.sort_by(f64::total_cmp);
    values.into()
}

// --- mass and inertia ---

#[test]
fn a_box_is_a_box_wherever_it_lies() {
    let half = [0.5, 0.3, 0.2];
    let exact = Vec3::new(0.09 + 0.04, 0.25 + 0.04, 0.25 + 0.09) / 3.0;
    let upright = Polyhedron::new(&corners_of_box(half)).unwrap();
    assert_eq!(upright.placement().axes, Quat::identity(), "principal axes are kept");
    let mut random = Random::of(1, 0);
    for k in 0..100 {
        let (turn, by) = (random.rotation(), direction(&mut random) * 1e3);
        let (turn, by) = if k == 0 { (Quat::identity(), Vec3::zeros()) } else { (turn, by) };
        let solid = Polyhedron::new(&moved(&corners_of_box(half), &turn, &by)).unwrap();
        // Corners a thousand sizes away have lost three digits.
        assert!(near(solid.volume(), 0.24, ROUNDING), "{k}: {}", solid.volume());
        assert!((sorted(solid.gyration()) - exact).norm() < ROUNDING, "{k}: {}", solid.gyration());
        assert!((solid.placement().centre - by).norm() < ROUNDING, "{k}");
        assert_eq!((solid.hull().vertices().len(), solid.hull().planes().len()), (8, 6), "{k}");
        assert!(near(solid.hull().inscribed_radius(), 0.2, ROUNDING), "{k}");
        // Half lengths of the box, in some order, as the frame is the principal one.
        let sides = sorted(solid.hull().half_extents());
        assert!((sides - Vec3::new(0.2, 0.3, 0.5)).norm() < 1e-9, "{k}: {sides}");
        for (own, file) in solid.hull().vertices().iter().zip(corners_of_box(half)) {
            let back = solid.placement().axes * own + solid.placement().centre;
            assert!((back - (turn * file + by)).norm() < ROUNDING, "{k}: the way back to the file");
        }
    }
}

#[test]
fn a_corner_of_a_cube_is_known() {
    // Volume 1/6, centre at a quarter; second moments 1/60 and products 1/120 about the corner.
    let points = [Vec3::zeros(), Vec3::x(), Vec3::y(), Vec3::z()];
    let solid = Polyhedron::new(&points).unwrap();
    assert!(near(solid.volume(), 1.0 / 6.0, 1e-15));
    assert!((solid.placement().centre - Vec3::repeat(0.25)).norm() < 1e-15);
    let (diagonal, product) = (1.0 / 10.0 - 1.0 / 16.0, 1.0 / 20.0 - 1.0 / 16.0);
    let along = diagonal + 2.0 * product; // (1, 1, 1)
    let across = diagonal - product;
    let exact = sorted(Vec3::new(2.0 * across, along + across, along + across));
    assert!((sorted(solid.gyration()) - exact).norm() < 1e-15, "{}", solid.gyration());
}

/// Steiner's formula for a box: faces, quarter cylinders, a ball.
#[test]
fn a_rounded_box_has_steiners_volume() {
    let (half, r) = ([0.5, 0.3, 0.2], 0.1);
    let (a, b, c) = (1.0, 0.6, 0.4);
    let volume = a * b * c
        + 2.0 * (a * b + b * c + c * a) * r
        + PI * (a + b + c) * r * r
        + 4.0 / 3.0 * PI * r * r * r;
    let solid = RoundedPolyhedron::new(&corners_of_box(half), r).unwrap();
    assert!(near(solid.volume(), volume, 1e-15), "{} {volume}", solid.volume());
    // Sum of the second moments of the parts between the planes x = ±a/2 etc.
    let square = |half: f64, others: [f64; 2]| {
        let [p, q] = others;
        let across = p * q + 2.0 * (p + q) * r + PI * r * r; // what lies along the middle part
        let cap = |power: i32| {
            // ∫ (half + s)² A(s) ds over one end, with A(s) the section at s beyond the core.
            let n = 20_000;
            (0..n)
                .map(|k| {
                    let s = r * (f64::from(k) + 0.5) / f64::from(n);
                    let w = (r * r - s * s).sqrt();
                    let section = p * q + 2.0 * (p + q) * w + PI * w * w;
                    (half + s).powi(power) * section * r / f64::from(n)
                })
                .sum::<f64>()
        };
        2.0 * half.powi(3) / 3.0 * across + 2.0 * cap(2)
    };
    let squares = Vec3::new(square(0.5, [b, c]), square(0.3, [a, c]), square(0.2, [a, b])) / volume;
    let exact = Vec3::repeat(squares.sum()) - squares;
    assert!((solid.gyration() - exact).norm() < 1e-8, "{} {exact}", solid.gyration());
}

/// A core without size is a ball, one without thickness a spherocylinder.
#[test]
fn thin_cores_are_round() {
    let dot = rounded(&corners_of_box([1e-7; 3]), 0.5);
    let ball = Shape::Sphere(Sphere { radius: 0.5 });
    let needle = rounded(&corners_of_box([0.5, 1e-5, 1e-5]), 0.3);
    let rod = Shape::Spherocylinder(Spherocylinder { length: 1.0, radius: 0.3 });
    for (solid, limit, tolerance) in [(dot, ball, 1e-6), (needle, rod, 1e-4)] {
        assert!(near(solid.volume(), limit.volume(), tolerance));
        assert!((solid.gyration() - limit.gyration()).norm() < tolerance, "{}", solid.gyration());
        assert!((solid.semi_axes() - limit.semi_axes()).norm() < tolerance);
    }
}

/// A rounded body without symmetry against Monte Carlo sampling of its inside.
#[test]
fn a_rounded_pebble_by_counting() {
    let mut random = Random::of(2, 0);
    let points = pebble(&mut random, 6);
    let by = Vec3::new(3.0, -2.0, 1.0);
    let solid = RoundedPolyhedron::new(&moved(&points, &random.rotation(), &by), 0.3).unwrap();
    let shape = Shape::RoundedPolyhedron(Box::new(solid));
    let dot = Shape::Sphere(Sphere { radius: 1e-9 });
    let upright = Mat3::identity();
    let body = Posed::new(&shape, &upright);
    let cells = 60;
    let half = shape.bounding_radius();
    let (mut count, mut first, mut second) = (0.0, Vec3::zeros(), Mat3::zeros());
    for k in 0..cells * cells * cells {
        let index = [k % cells, k / cells % cells, k / cells / cells];
        let p = Vec3::from(index.map(|i| half * (f64::from(2 * i + 1) / f64::from(cells) - 1.0)));
        let other = Posed::new(&dot, &upright);
        if !matches!(Cores.touch(&body, &other, &p, None), Outcome::Apart(_)) {
            count += 1.0;
            first += p;
            second += p * p.transpose();
        }
    }
    let volume = count * (2.0 * half / f64::from(cells)).powi(3);
    assert!(near(volume / shape.volume(), 1.0, 2e-3), "{volume} {}", shape.volume());
    assert!((first / count).norm() < 2e-3, "the centre of mass is the origin: {}", first / count);
    let squares = second / count;
    let counted = Mat3::identity() * squares.trace() - squares;
    let off = (counted - Mat3::from_diagonal(&shape.gyration())).abs().max();
    assert!(off < 2e-3, "{counted} {}", shape.gyration());
}

// --- reference ---

/// A polyhedron from its corners in world coordinates, as a body in place.
struct Placed {
    shape: Shape,
    frame: Mat3,
    centre: Vec3,
}

impl Placed {
    fn of(shape: Shape) -> Self {
        let placement = *shape.placement().unwrap();
        let frame = placement.axes.to_rotation_matrix().into_inner();
        Self { shape, frame, centre: placement.centre }
    }

    fn posed(&self) -> Posed<'_> {
        Posed::new(&self.shape, &self.frame)
    }

    /// Touch with another body, with the contact point in world coordinates.
    fn touch(&self, other: &Self, resolver: &dyn ContactResolver) -> Outcome {
        let r = other.centre - self.centre;
        match resolver.touch(&self.posed(), &other.posed(), &r, None) {
            Outcome::Touching(t) => Outcome::Touching(Touch { point: t.point + self.centre, ..t }),
            outcome => outcome,
        }
    }
}

struct Row {
    id: String,
    a: Vec<Vec3>,
    b: Vec<Vec3>,
    overlap: f64,
    normal: Vec3,
    point: Vec3,
    normal_unique: bool,
}

fn rows() -> Vec<Row> {
    let parse = |line: &str| {
        let row: serde_json::Value = serde_json::from_str(line).unwrap();
        let points = |name: &str| serde_json::from_value::<Vec<Vec3>>(row[name].clone()).unwrap();
        let vector = |name: &str| serde_json::from_value::<Vec3>(row[name].clone()).unwrap();
        Row {
            id: format!("{} {}", row["id"], row["tag"]),
            a: points("VA"),
            b: points("VB"),
            overlap: row["overlap"].as_f64().unwrap(),
            normal: vector("n"),
            point: vector("C"),
            normal_unique: row["normal_unique"] == true,
        }
    };
    include_str!("../reference/polyhedra_public.jsonl").lines().map(parse).collect()
}

impl Row {
    fn check(&self, touch: &Touch, margins: f64, tolerance: f64) {
        let Self { id, overlap, normal, point, .. } = self;
        let off = touch.overlap - (overlap + margins);
        assert!(off.abs() <= tolerance, "{id}: overlap off by {off:e}");
        if self.normal_unique {
            let off = touch.normal.cross(normal).norm();
            assert!(
                off <= tolerance && touch.normal.dot(normal) > 0.0,
                "{id}: normal off by {off:e}"
            );
            // Middle of unique points, or centroid of the patch.
            let off = (touch.point - point).norm();
            assert!(off <= 10.0 * tolerance, "{id}: point off by {off:e}, {}", touch.point);
        }
    }
}

#[test]
fn epa_of_polyhedra_is_exact() {
    let epa = Epa::new(1e-12);
    let rows = rows();
    assert_eq!(rows.len(), 42);
    for row in rows {
        let (a, b) = (Placed::of(sharp(&row.a)), Placed::of(sharp(&row.b)));
        match a.touch(&b, &epa) {
            Outcome::Touching(touch) => row.check(&touch, 0.0, ROUNDING),
            Outcome::Apart(clearance) => {
                assert!(row.overlap <= ROUNDING, "{}: {} missed", row.id, row.overlap);
                assert!(clearance <= ROUNDING - row.overlap, "{}: {clearance}", row.id);
            }
            Outcome::Failed(why) => panic!("{}: {why:?}", row.id),
        }
    }
}

/// Boxes whose faces overlap by a strip narrower than erosion's 5 %, with which it would find another
/// direction.
#[test]
fn strips_of_faces_are_resolved() {
    let table = table(&Method::Auto, &Kind::ALL);
    let resolver = table.get((Kind::Polyhedron, Kind::Polyhedron)).unwrap();
    let (plate, rod) = ([1.0, 1.0, 0.01], [100.0, 1.0, 1.0]);
    for (a, b, x, depth) in [
        (plate, plate, 1.95, 1e-4),
        (plate, plate, 1.95, -0.04),
        ([1.0; 3], [1.0; 3], 1.95, 1e-3),
        ([10.0; 3], [1.0; 3], 10.6, 1e-3),
        ([1e4; 3], [1.0; 3], 9900.0, 1e-3),
        (rod, rod, 195.0, 1e-3),
    ] {
        let r = Vec3::new(x, 0.0, a[2] + b[2] - depth);
        let [one, other] = [(a, Vec3::zeros()), (b, r)].map(|(half, by)| {
            Placed::of(sharp(&moved(&corners_of_box(half), &Quat::identity(), &by)))
        });
        match one.touch(&other, resolver) {
            Outcome::Touching(touch) => {
                assert!((touch.overlap - depth).abs() < 1e-12 * r.norm(), "{a:?} {b:?}: {touch:?}");
                assert!((touch.normal - Vec3::z()).norm() < 1e-9, "{a:?} {b:?}: {touch:?}");
            }
            Outcome::Apart(clearance) => assert!(depth < 0.0 && clearance <= -depth + 1e-12),
            Outcome::Failed(why) => panic!("{a:?} {b:?}: {why:?}"),
        }
    }
}

/// Pairs that are apart touch when both are rounded: normal and points stay equal, and the whole clearance is
/// known to rounding.
#[test]
fn cores_give_the_distance() {
    let mut apart = 0;
    for row in rows().iter().filter(|row| row.overlap < -1e-6) {
        let radius = -0.6 * row.overlap;
        let body = |points| Placed::of(rounded(points, radius));
        match body(&row.a).touch(&body(&row.b), &Cores) {
            Outcome::Touching(touch) => row.check(&touch, 2.0 * radius, ROUNDING),
            other => panic!("{}: {other:?}", row.id),
        }
        apart += 1;
    }
    assert!(apart >= 20, "{apart}");
}

// --- cores ---

fn body_of(kind: u64, random: &mut Random) -> Shape {
    match kind {
        0 => Shape::Sphere(Sphere { radius: 0.5 }),
        1 => Shape::Spherocylinder(Spherocylinder { length: 1.5, radius: 0.3 }),
        2 => rounded(&corners_of_box([0.5, 0.4, 0.3]), 0.1),
        _ => rounded(&pebble(random, 20), 0.2),
    }
}

/// Cores and EPA are independent of each other, and no direction gives a smaller overlap.
#[test]
fn cores_are_exact() {
    let epa = Epa::new(1e-11);
    let (mut touching, mut apart) = (0, 0);
    for k in 0..1200 {
        let mut random = Random::of(3, k);
        let shapes = [body_of(k % 4, &mut random), body_of(k / 4 % 4, &mut random)];
        let frames = [(); 2].map(|()| random.rotation().to_rotation_matrix().into_inner());
        let a = Posed::new(&shapes[0], &frames[0]);
        let b = Posed::new(&shapes[1], &frames[1]);
        let toward = direction(&mut random);
        let span = a.support(&toward) - b.support(&-toward);
        let r = toward * (span.norm() * (0.7 + 0.4 * random.unit()));
        match (Cores.touch(&a, &b, &r, None), epa.touch(&a, &b, &r, None)) {
            (Outcome::Touching(touch), Outcome::Touching(other)) => {
                touching += 1;
                let off = other.overlap - touch.overlap;
                assert!((-ROUNDING..=1e-11).contains(&off), "pair {k}: {off:e}");
                assert!((touch.normal - other.normal).norm() < 2e-5, "pair {k}");
                for _ in 0..100 {
                    let n = (touch.normal + direction(&mut random) * 0.1).normalize();
                    let bound = (a.support(&n) - b.support(&-n) - r).dot(&n);
                    assert!(bound >= touch.overlap - ROUNDING, "pair {k}: {bound}");
                }
            }
            (Outcome::Apart(clearance), Outcome::Apart(_)) => {
                apart += 1;
                assert!(clearance >= 0.0, "pair {k}");
            }
            (Outcome::Failed(_), Outcome::Touching(deep)) => {
                let margins = shapes[0].margin() + shapes[1].margin();
                assert!(deep.overlap > margins - 1e-6, "pair {k}: {deep:?}");
            }
            other => panic!("pair {k}: {other:?}"),
        }
    }
    assert!(touching > 300 && apart > 300, "{touching} touch, {apart} do not");
}

/// Each answer has a proof of optimality. The contact point, moved back by the overlap and the margins, gives
/// a point of each core. No two points of the cores are nearer than their supports along the normal.
#[test]
fn rounded_boxes_have_no_duality_gap() {
    // Contacts within a thousandth of the overlap from flush have a point between those of both kinds.
    const ALMOST_FLUSH: f64 = 1e-4;
    let (mut touching, mut inexact, mut worst) = (0, 0, 0.0_f64);
    for k in 0..4096 {
        let mut random = Random::of(4, k);
        let half = |random: &mut Random| [(); 3].map(|()| 0.2 + 0.5 * random.unit());
        let shapes = [(); 2].map(|()| rounded(&corners_of_box(half(&mut random)), 0.1));
        let frames = [(); 2].map(|()| random.rotation().to_rotation_matrix().into_inner());
        let [a, b] = [0, 1].map(|k| Posed::new(&shapes[k], &frames[k]));
        let toward = direction(&mut random);
        let r = toward * ((a.support(&toward) - b.support(&-toward)).dot(&toward) * 0.85);
        let Outcome::Touching(touch) = Cores.touch(&a, &b, &r, None) else { continue };
        touching += 1;
        let back = touch.normal * (0.5 * touch.overlap - 0.1);
        let on_a = (&shapes[0], &frames[0], touch.point + back);
        let on_b = (&shapes[1], &frames[1], touch.point - back - r);
        let outside = [on_a, on_b].map(|(shape, frame, point)| {
            let Shape::RoundedPolyhedron(solid) = shape else { unreachable!() };
            -solid.core().depth(&frame.tr_mul(&point))
        });
        let outside = outside[0].max(outside[1]);
        inexact += usize::from(outside > 1e-13);
        worst = worst.max(outside);
        let gap = (a.support(&touch.normal) - b.support(&-touch.normal) - r).dot(&touch.normal);
        assert!(near(gap, touch.overlap, 1e-15), "pair {k}");
    }
    assert!(touching > 500, "{touching}");
    assert!(100 * inexact < touching, "{inexact} of {touching}");
    assert!(worst < ALMOST_FLUSH, "a point is {worst:e} outside its core");
}

fn rod(frame: &Mat3) -> Posed<'_> {
    const ROD: Shape = Shape::Spherocylinder(Spherocylinder { length: 2.0, radius: 0.5 });
    Posed::new(&ROD, frame)
}

fn touch(a: &Posed, b: &Posed, r: Vec3) -> Touch {
    match Cores.touch(a, b, &r, None) {
        Outcome::Touching(touch) => touch,
        other => panic!("{other:?}"),
    }
}

#[test]
fn spherocylinders_have_closed_forms() {
    let along_x = Mat3::identity();
    let along_y = Mat3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let check = |found: Touch, overlap: f64, normal: Vec3, point: Vec3| {
        assert!(near(found.overlap, overlap, 1e-15), "{found:?}");
        assert!((found.normal - normal).norm() < 1e-15, "{found:?}");
        assert!((found.point - point).norm() < 1e-15, "{found:?}");
    };
    let (x, y) = (rod(&along_x), rod(&along_y));
    let z = Vec3::z();
    check(touch(&x, &y, Vec3::new(0.3, 0.2, 0.9)), 0.1, z, Vec3::new(0.3, 0.0, 0.45));
    check(touch(&x, &x, Vec3::new(1.5, 0.0, 0.9)), 0.1, z, Vec3::new(0.75, 0.0, 0.45));
    check(touch(&x, &x, Vec3::new(2.9, 0.0, 0.0)), 0.1, Vec3::x(), Vec3::new(1.45, 0.0, 0.0));
    let ball = Shape::Sphere(Sphere { radius: 0.25 });
    let ball = Posed::new(&ball, &along_x);
    check(touch(&x, &ball, Vec3::new(0.5, 0.0, 0.7)), 0.05, z, Vec3::new(0.5, 0.0, 0.475));
}

// --- the contact point ---

/// A cube on a floor: its centre carries it while it stands, an edge when it is tilted. In between the point
/// moves without a jump.
#[test]
fn the_contact_point_of_a_tilting_cube_does_not_jump() {
    let cube = sharp(&corners_of_box([0.5; 3]));
    let slab = sharp(&corners_of_box([2.0, 2.0, 0.5]));
    let upright = Mat3::identity();
    let floor = Shape::HalfSpace(HalfSpace::at_reference(Vec3::z()));
    let overlap = 0.01;
    let at = |tilt: f64, on_wall: bool| {
        let frame = *nalgebra::Rotation3::from_axis_angle(&Vec3::y_axis(), tilt).matrix();
        let body = Posed::new(&cube, &frame);
        let height = -body.support(&-Vec3::z()).z - overlap;
        let outcome = if on_wall {
            let wall = Posed::new(&floor, &upright);
            AgainstHalfSpace.touch(&body, &wall, &(-Vec3::z() * height), None)
        } else {
            let ground = Posed::new(&slab, &upright);
            let r = -Vec3::z() * (height + 0.5);
            Epa::new(1e-12).touch(&body, &ground, &r, None)
        };
        let Outcome::Touching(touch) = outcome else { panic!("{tilt}: {outcome:?}") };
        touch.point.x
    };
    for on_wall in [true, false] {
        assert!(at(0.0, on_wall).abs() < 1e-12);
        let edge = at(0.01, on_wall);
        assert!(near(edge, 0.5, 0.01), "{edge}");
        // The moment rises without a jump over a tilt of a small part of overlap over width.
        let mut last = 0.0;
        for k in 1..=100 {
            let here = at(2e-7 * f64::from(k), on_wall);
            // The middle of its base moves under the centre.
            assert!(here >= last - 2e-5 && here < last + 0.05, "{k}: from {last} to {here}");
            last = here;
        }
        assert!(near(last, 0.5, 0.01), "{last}");
    }
}

#[test]
fn a_rod_lies_on_its_middle() {
    let upright = Mat3::identity();
    let floor = Shape::HalfSpace(HalfSpace::at_reference(Vec3::z()));
    let wall = Posed::new(&floor, &upright);
    let lying = AgainstHalfSpace.touch(&rod(&upright), &wall, &Vec3::new(9.0, 9.0, -0.49), None);
    let Outcome::Touching(lying) = lying else { panic!("{lying:?}") };
    assert!((lying.point - Vec3::new(0.0, 0.0, -0.495)).norm() < 1e-12, "{lying:?}");
}

#[test]
fn every_pair_of_kinds_has_a_resolver() {
    let table = table(&Method::Auto, &Kind::ALL);
    let name = |a, b| table.get((a, b)).unwrap().name();
    let (rod, sharp, rounded) = (Kind::Spherocylinder, Kind::Polyhedron, Kind::RoundedPolyhedron);
    for (a, b, expected) in [
        (Kind::Sphere, Kind::Ellipsoid, "common-normal"),
        (Kind::Sphere, rod, "cores"),
        (Kind::Sphere, sharp, "cores"),
        (Kind::Ellipsoid, rounded, "cores"),
        (rod, rounded, "cores"),
        (rounded, rounded, "cores"),
        (Kind::Ellipsoid, sharp, "epa"),
        (sharp, sharp, "epa"),
        (sharp, Kind::HalfSpace, "half-space"),
    ] {
        assert_eq!(name(a, b), expected, "{a:?} {b:?}");
    }
}

// --- a user-defined shape ---

/// Common part of two balls of this radius, with their centres `offset` above and below the origin.
#[derive(Debug)]
struct Lens {
    radius: f64,
    offset: f64,
}

impl Lens {
    fn rim(&self) -> f64 {
        (self.radius * self.radius - self.offset * self.offset).sqrt()
    }

    /// Integral over the body of a function of the height and of the squared radius of the slice there.
    fn integral(&self, of: impl Fn(f64, f64) -> f64) -> f64 {
        const SLICES: u32 = 2000;
        let thickness = (self.radius - self.offset) / f64::from(SLICES);
        let slices = (0..SLICES).map(|k| {
            let z = (f64::from(k) + 0.5) * thickness;
            of(z, self.radius * self.radius - (z + self.offset) * (z + self.offset))
        });
        2.0 * PI * thickness * slices.sum::<f64>()
    }
}

impl Convex for Lens {
    fn support(&self, direction: &Vec3) -> Vec3 {
        let up = direction.normalize();
        if up.z.abs() * self.radius > self.offset {
            return up * self.radius - Vec3::z() * self.offset.copysign(up.z);
        }
        Vec3::new(up.x, up.y, 0.0).normalize() * self.rim()
    }

    fn bounding_radius(&self) -> f64 {
        self.rim()
    }

    fn inscribed_radius(&self) -> f64 {
        self.radius - self.offset
    }

    fn volume(&self) -> f64 {
        self.integral(|_, square| square)
    }

    fn gyration(&self) -> Vec3 {
        let about = self.integral(|_, square| 0.5 * square * square);
        let across = self.integral(|z, square| square * (0.25 * square + z * z));
        Vec3::new(across, across, about) / self.volume()
    }

    fn contains(&self, point: &Vec3) -> bool {
        Vec3::new(point.x, point.y, point.z.abs() + self.offset).norm() <= self.radius
    }
}

/// The trait is sufficient for pairs with every other shape and with walls.
#[test]
fn a_shape_of_the_users_own_is_resolved() {
    let (radius, offset) = (2.0, 1.2);
    let lens = Shape::Other(Arc::new(Lens { radius, offset }));
    assert_eq!(lens.kind(), Kind::Other);
    assert!((lens.semi_axes() - Vec3::new(1.6, 1.6, 0.8)).norm() < 1e-15, "{}", lens.semi_axes());
    let cap = PI * 0.8 * 0.8 * (3.0 * radius - 0.8) / 3.0;
    assert!(near(lens.volume(), 2.0 * cap, 1e-6));
    assert!(
        lens.contains(&Vec3::new(1.599, 0.0, 0.0)) && !lens.contains(&Vec3::new(0.0, 0.0, 0.801))
    );
    let compliance = lens.surface_compliance();
    assert!(compliance > 3.5 && compliance < 10.0, "{compliance}");

    let ball = Shape::Sphere(Sphere { radius: 0.5 });
    let cube = sharp(&corners_of_box([0.5; 3]));
    let floor = Shape::HalfSpace(HalfSpace::at_reference(Vec3::z()));
    let (upright, aslant) = (Mat3::identity(), Quat::from_euler_angles(0.3, 0.2, 0.1));
    let aslant = *aslant.to_rotation_matrix().matrix();
    // Normals at which both bodies are balls, or one is a rim, a face or a wall.
    let slope = Vec3::new(0.3, 0.2, 0.9).normalize();
    let cases: [(&Shape, Mat3, Vec3, f64); 7] = [
        (&lens, upright, Vec3::z(), 1e-9),
        (&lens, aslant, slope, 2e-2),
        (&ball, upright, Vec3::x(), 1e-9),
        (&ball, upright, Vec3::new(0.8, 0.6, 0.0), 1e-9),
        (&ball, aslant, slope, 2e-2),
        (&cube, upright, Vec3::z(), 1e-3),
        (&floor, upright, -Vec3::z(), 1e-12),
    ];
    for (k, (other, frame, normal, erosion)) in cases.into_iter().enumerate() {
        for overlap in [0.03, 1e-6, -1e-3] {
            let a = Posed::new(&lens, &upright);
            let b = Posed::new(other, &frame);
            let on_b = if k == 6 { Vec3::zeros() } else { b.support(&-normal) };
            let r = a.support(&normal) - on_b - normal * overlap;
            for (method, tolerance) in [
                (Method::Epa(Epa::new(1e-10)), 1e-9),
                (
                    Method::GjkErosion(ErodedGjk {
                        ratio: 0.05,
                        increment: 0.01,
                        tolerance: 1e-10,
                        ..ErodedGjk::default()
                    }),
                    erosion,
                ),
                (Method::Auto, erosion),
            ] {
                let table = table(&method, &Kind::ALL);
                let resolver = table.get((Kind::Other, other.kind())).unwrap();
                let name = resolver.name();
                match resolver.touch(&a, &b, &r, None) {
                    Outcome::Touching(touch) => {
                        let off = touch.overlap - overlap;
                        // Erosion may report a contact for separate bodies.
                        let least = -1e-9 - if overlap < 0.0 { overlap } else { 0.0 };
                        assert!(
                            (least..=tolerance.max(least)).contains(&off),
                            "{name}, {k}: {off:e}"
                        );
                        let turned = (touch.normal - normal).norm();
                        assert!(turned < 10.0 * tolerance.sqrt(), "{name}, {k}: {turned}");
                    }
                    Outcome::Apart(_) => assert!(overlap < 0.0, "{name}, {k}: {overlap:e} is lost"),
                    Outcome::Failed(why) => panic!("{name}, {k}: {why:?}"),
                }
            }
        }
    }
}
