//! Requirements on every contact resolver, on random pairs: add new resolvers to [`resolvers`]. A seed and a
//! number, both in the message of a failure, define each case.

use crate::support::placed::Case;
use crate::support::random::Draw;
use crate::support::{Frame, scaled};
use dem_mpi::contact::{
    AgainstHalfSpace, CommonNormal, ContactResolver, Cores, Epa, ErodedGjk, Method, Outcome, Posed,
    SeededCommonNormal, SmoothCommonNormal, SphereSphere, Table, Touch, table,
};
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::random::Random;
use dem_mpi::shape::{
    Ellipsoid, HalfSpace, Kind, PolySuperellipsoid, RoundedPolyhedron, Shape, Sphere,
    Spherocylinder, Superellipsoid,
};

const SEED: u64 = 20_261_121;
/// Random pairs per check.
const CASES: usize = 300;
/// Rounding of an overlap relative to the size: a few hundred units in the last place at 1:4.
const ROUNDING: f64 = 1e-13;

/// A resolver with the tolerances of its answers about its own limit.
struct Subject {
    resolver: Box<dyn ContactResolver>,
    /// Tolerance of the overlap, relative to the size.
    overlap: f64,
    /// Tolerance of the normal [rad] and of the contact point, relative to the size.
    normal: f64,
    /// Whether the limit is the common normal.
    exact: bool,
    /// Family of shapes that it resolves.
    family: Family,
}

impl Subject {
    fn case(&self, random: &mut Random, overlap: f64) -> Case {
        Case::with_overlap(self.family, random, overlap)
    }
}

/// Family of random shapes.
#[derive(Clone, Copy, PartialEq)]
enum Family {
    /// Spheres and ellipsoids.
    Ellipsoids,
    /// Spheres, ellipsoids and superellipsoids, whole or of octants.
    Superellipsoids,
    /// Spheres, spherocylinders and rounded polyhedra, with a margin that exceeds any overlap.
    Rounded,
}

/// The chain of a method, from the table as in a simulation.
struct Chained(Table);

impl Chained {
    fn by(method: &Method) -> Self {
        Self(table(method, &Kind::ALL))
    }
}

impl ContactResolver for Chained {
    fn name(&self) -> &'static str {
        self.0.get((Kind::Ellipsoid, Kind::Ellipsoid)).unwrap().name()
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome {
        self.0.get((a.shape.kind(), b.shape.kind())).unwrap().touch(a, b, r, warm)
    }
}

/// All resolvers of pairs of ellipsoids and spheres, of superellipsoids, and of pairs with margins.
///
/// A search to a gap `e` leaves the normal uncertain by `√(2 e / κ)`, with κ above 0.1 here. Erosion's
/// direction is not at a minimum of the overlap, so the direction's error enters the overlap at first order.
fn resolvers() -> Vec<Subject> {
    let subject = |resolver: Box<dyn ContactResolver>, overlap, normal, exact| Subject {
        resolver,
        overlap,
        normal,
        exact,
        family: Family::Ellipsoids,
    };
    let of_superellipsoids =
        |subject: Subject| Subject { family: Family::Superellipsoids, ..subject };
    let rounded = |resolver, overlap, normal| Subject {
        family: Family::Rounded,
        ..subject(resolver, overlap, normal, true)
    };
    let erosion = |tolerance| ErodedGjk { tolerance, ..ErodedGjk::default() };
    vec![
        subject(Box::new(CommonNormal), ROUNDING, 1e-12, true),
        subject(Box::<SeededCommonNormal>::default(), ROUNDING, 1e-12, true),
        subject(Box::new(Chained::by(&Method::Auto)), ROUNDING, 1e-12, true),
        subject(Box::new(Epa::new(1e-8)), 1e-8, 5e-4, true),
        subject(Box::new(Chained::by(&Method::Epa(Epa::new(1e-5)))), 1e-5, 1.5e-2, true),
        subject(Box::new(erosion(1e-14)), 1e-7, 1e-6, false),
        subject(Box::new(erosion(1e-4)), 1e-3, 2e-2, false),
        of_superellipsoids(subject(Box::new(SmoothCommonNormal), ROUNDING, 1e-7, true)),
        of_superellipsoids(subject(Box::new(Chained::by(&Method::Auto)), ROUNDING, 1e-7, true)),
        of_superellipsoids(subject(Box::new(Epa::new(1e-8)), 1e-8, 5e-3, true)),
        rounded(Box::new(Cores), ROUNDING, 1e-12),
        rounded(Box::new(Chained::by(&Method::Auto)), ROUNDING, 1e-12),
        rounded(Box::new(Epa::new(1e-8)), 1e-8, 5e-4),
    ]
}

/// Resolvers of ellipsoids.
fn ellipsoid_resolvers() -> impl Iterator<Item = Subject> {
    resolvers().into_iter().filter(|subject| subject.family == Family::Ellipsoids)
}

/// Ellipsoid with semi-axes from 0.5 to 2.
fn ellipsoid(random: &mut Random) -> Shape {
    Shape::Ellipsoid(Ellipsoid { semi_axes: random.vector(0.5, 2.0) })
}

/// Superellipsoid from nearly a box to nearly an octahedron, half of them of eight octants.
fn superellipsoid(random: &mut Random) -> Shape {
    let exponents = [random.between(0.4, 1.4), random.between(0.4, 1.4)];
    let (positive, negative) = (random.vector(0.5, 1.5), random.vector(0.5, 1.5));
    if random.unit() < 0.5 {
        Shape::Superellipsoid(Superellipsoid::new(positive, exponents))
    } else {
        Shape::PolySuperellipsoid(Box::new(PolySuperellipsoid::new(positive, negative, exponents)))
    }
}

fn spherocylinder(random: &mut Random) -> Shape {
    let (length, radius) = (random.between(0.5, 2.0), random.between(0.2, 0.5));
    Shape::Spherocylinder(Spherocylinder { length, radius })
}

/// Rounded polyhedron with 4 to 40 corners on an ellipsoid.
fn rounded_polyhedron(random: &mut Random) -> Shape {
    let count = 4 + (37.0 * random.unit()) as usize;
    let axes = random.vector(0.5, 1.5);
    let points: Vec<Vec3> = (0..count).map(|_| random.direction().component_mul(&axes)).collect();
    let solid = RoundedPolyhedron::new(&points, random.between(0.2, 0.5));
    Shape::RoundedPolyhedron(Box::new(solid.unwrap()))
}

impl Family {
    fn shape(self, random: &mut Random) -> Shape {
        match (random.unit(), self) {
            (share, _) if share < 0.2 => Shape::Sphere(Sphere { radius: random.between(0.5, 2.0) }),
            (_, Self::Ellipsoids) => ellipsoid(random),
            (share, Self::Superellipsoids) if share < 0.4 => ellipsoid(random),
            (_, Self::Superellipsoids) => superellipsoid(random),
            (share, Self::Rounded) if share < 0.5 => spherocylinder(random),
            (_, Self::Rounded) => rounded_polyhedron(random),
        }
    }
}

impl Case {
    /// Random bodies with this overlap, or clearance if negative, along a random common normal.
    fn with_overlap(family: Family, random: &mut Random, overlap: f64) -> Self {
        let a = (family.shape(random), random.frame());
        let b = (family.shape(random), random.frame());
        Self::of(a, b, random, overlap)
    }

    fn touch(&self, resolver: &dyn ContactResolver) -> Touch {
        self.warm_touch(resolver, None)
    }

    fn warm_touch(&self, resolver: &dyn ContactResolver, warm: Option<&Vec3>) -> Touch {
        match self.resolve(resolver, warm) {
            Outcome::Touching(touch) => touch,
            other => panic!("{}: {other:?}", resolver.name()),
        }
    }

    /// The longer bounding radius.
    fn size(&self) -> f64 {
        let (a, b) = (self.a.0.bounding_radius(), self.b.0.bounding_radius());
        if a < b { b } else { a }
    }
}

/// Checks that two answers agree to the resolver's tolerances.
fn assert_same(case: usize, subject: &Subject, size: f64, found: &Touch, expected: &Touch) {
    let good = (found.overlap - expected.overlap).abs() <= 2.0 * subject.overlap * size
        && (found.normal - expected.normal).norm() <= subject.normal
        && (found.point - expected.point).norm() <= 2.0 * subject.normal * size;
    let name = subject.resolver.name();
    assert!(good, "{name}, seed {SEED} + {case}: {found:?} is not {expected:?}");
}

/// Runs a check on every resolver with random touching pairs.
fn for_touching(check: impl Fn(usize, &Subject, &Case, &mut Random)) {
    for subject in resolvers() {
        for i in 0..CASES {
            let mut random = Random::of(SEED + i as u64, 0);
            let overlap = random.between(0.002, 0.05);
            let case = subject.case(&mut random, overlap);
            check(i, &subject, &case, &mut random);
        }
    }
}

#[test]
fn swapping_the_bodies_turns_the_normal() {
    for_touching(|i, subject, case, _| {
        let touch = case.touch(&*subject.resolver);
        let swapped = Case { a: case.b.clone(), b: case.a.clone(), r: -case.r };
        let back = swapped.touch(&*subject.resolver);
        let seen = Touch { normal: -back.normal, point: back.point + case.r, ..back };
        assert_same(i, subject, case.size(), &seen, &touch);
    });
}

#[test]
fn a_rigid_motion_moves_the_answer() {
    for_touching(|i, subject, case, random| {
        let touch = case.touch(&*subject.resolver);
        let turn = random.frame();
        let moved = Case {
            a: (case.a.0.clone(), turn * case.a.1),
            b: (case.b.0.clone(), turn * case.b.1),
            r: turn * case.r,
        };
        let there = moved.touch(&*subject.resolver);
        let back = turn.transpose();
        let seen = Touch { normal: back * there.normal, point: back * there.point, ..there };
        assert_same(i, subject, case.size(), &seen, &touch);
    });
}

/// Erosion is exact for spheres, too: the direction is the line of centres.
#[test]
fn ellipsoids_with_equal_axes_are_spheres() {
    for subject in ellipsoid_resolvers() {
        for i in 0..CASES {
            let mut random = Random::of(SEED + i as u64, 0);
            let radii = [random.between(0.1, 1.0), random.between(0.1, 1.0)];
            let [a, b] = radii.map(|radius| (Shape::Sphere(Sphere { radius }), random.frame()));
            let [round_a, round_b] = radii.map(|radius| {
                let semi_axes = Vec3::repeat(radius);
                (Shape::Ellipsoid(Ellipsoid { semi_axes }), random.frame())
            });
            let r = random.direction() * (radii[0] + radii[1] - random.between(1e-3, 0.02));
            let closed = Case { a: a.clone(), b: b.clone(), r }.touch(&SphereSphere);
            for (a, b) in [(&round_a, &round_b), (&a, &round_b), (&round_a, &b)] {
                let case = Case { a: a.clone(), b: b.clone(), r };
                assert_same(i, &subject, 1.0, &case.touch(&*subject.resolver), &closed);
            }
        }
    }
}

#[test]
fn the_overlap_goes_smoothly_through_touch() {
    const OVERLAPS: [f64; 15] = [
        1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-15, 0.0, -1e-15, -1e-12, -1e-8, -1e-4,
        -1e-3, -1e-2,
    ];
    // Largest growth of erosion's overlap over the approach of the bodies; it exceeds 1 because the direction
    // turns.
    const RATE: f64 = 3.0;
    for subject in resolvers() {
        let name = subject.resolver.name();
        for i in 0..CASES / 3 {
            let mut last: Option<(f64, f64)> = None;
            for overlap in OVERLAPS {
                let case = subject.case(&mut Random::of(SEED + i as u64, 0), overlap);
                let tolerance = 2.0 * subject.overlap * case.size();
                let found = match case.resolve(&*subject.resolver, None) {
                    Outcome::Touching(touch) => touch.overlap,
                    Outcome::Apart(_) => 0.0,
                    Outcome::Failed(why) => panic!("{name}, {SEED} + {i}, {overlap:e}: {why:?}"),
                };
                if subject.exact {
                    let expected = if overlap > 0.0 { overlap } else { 0.0 };
                    assert!(
                        (found - expected).abs() <= tolerance,
                        "{name}, {SEED} + {i}: {found:e} is not {expected:e}"
                    );
                }
                if let Some((before, deeper)) = last {
                    assert!(
                        (deeper - found).abs() <= RATE * (before - overlap) + 2.0 * tolerance,
                        "{name}, {SEED} + {i}: from {deeper:e} to {found:e} at {overlap:e}"
                    );
                }
                last = Some((overlap, found));
            }
        }
    }
}

/// Nanometres and kilometres: a change of unit by a power of two changes no bit.
#[test]
fn the_unit_of_length_does_not_matter() {
    for_touching(|i, subject, case, _| {
        // Solids are rebuilt from their corners, also for the comparison.
        let in_unit = |unit: f64| Case {
            a: (scaled(&case.a.0, unit), case.a.1),
            b: (scaled(&case.b.0, unit), case.b.1),
            r: case.r * unit,
        };
        let touch = in_unit(1.0).touch(&*subject.resolver);
        for unit in [2f64.powi(-30), 2f64.powi(30)] {
            let found = in_unit(unit).touch(&*subject.resolver);
            let expected =
                Touch { overlap: touch.overlap * unit, point: touch.point * unit, ..touch };
            assert_eq!(found, expected, "{}, seed {SEED} + {i}", subject.resolver.name());
        }
    });
}

/// The overlap is the least over all directions, so a method can only find too much of it.
#[test]
fn resolvers_agree_and_none_finds_too_little() {
    for_touching(|i, subject, case, _| {
        let exact = match subject.family {
            Family::Ellipsoids => case.touch(&CommonNormal),
            Family::Superellipsoids => case.touch(&SmoothCommonNormal),
            Family::Rounded => case.touch(&Cores),
        };
        let touch = case.touch(&*subject.resolver);
        let name = subject.resolver.name();
        let excess = (touch.overlap - exact.overlap) / case.size();
        assert!(excess >= -ROUNDING, "{name}, seed {SEED} + {i}: {excess:e}");
        if subject.exact {
            assert_same(i, subject, case.size(), &touch, &exact);
        }
    });
}

#[test]
fn bodies_that_are_apart_do_not_touch() {
    for subject in resolvers().iter().filter(|subject| subject.exact) {
        for i in 0..CASES {
            let mut random = Random::of(SEED + i as u64, 0);
            let clearance = random.between(1e-4, 1.0);
            let case = subject.case(&mut random, -clearance);
            let name = subject.resolver.name();
            let Outcome::Apart(promised) = case.resolve(&*subject.resolver, None) else {
                panic!("{name}, seed {SEED} + {i}: not apart")
            };
            let limit = clearance + ROUNDING * case.size();
            assert!((0.0..=limit).contains(&promised), "{name}, {SEED} + {i}: {promised:e}");
        }
    }
}

/// A pair that is apart stays apart after any motion shorter than its reported clearance.
#[test]
fn a_pair_that_rests_misses_nothing() {
    for subject in &resolvers() {
        let mut promises = 0;
        for i in 0..CASES {
            let mut random = Random::of(SEED + i as u64, 0);
            let mut case = subject.case(&mut random, -0.3 * random_square(i));
            let Outcome::Apart(promised) = case.resolve(&*subject.resolver, None) else {
                continue; // spurious contacts of erosion
            };
            promises += usize::from(promised > 0.0);
            // The direct approach is the worst case; two other directions are checked, too.
            let towards = -case.r.normalize();
            let sideways = Vec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), 0.3);
            for way in [towards, (towards + sideways * 0.5).normalize(), sideways.normalize()] {
                let before = case.r;
                // The pair list leaves as much room for rounding.
                let room = 1e-12 * case.a.0.bounding_radius();
                case.r += way * (promised * 0.999_999 - room).max(0.0);
                let outcome = case.resolve(&*subject.resolver, None);
                let name = subject.resolver.name();
                assert!(matches!(outcome, Outcome::Apart(_)), "{name}, {SEED} + {i}: {outcome:?}");
                case.r = before;
            }
        }
        assert!(promises > CASES / 2, "{}: {promises}", subject.resolver.name());
    }
}

/// Between 0 and 1, crowded at 0.
fn random_square(i: usize) -> f64 {
    let unit = (i as f64 * 0.618_033_988_75).fract();
    unit * unit
}

/// The normal of the last step saves time but does not change the answer.
#[test]
fn a_warm_start_agrees_with_a_cold_one() {
    for_touching(|i, subject, case, random| {
        let cold = case.touch(&*subject.resolver);
        for change in [0.0, 1e-4, 1e-2, 0.3] {
            let warm = (cold.normal + random.direction() * change).normalize();
            let touch = case.warm_touch(&*subject.resolver, Some(&warm));
            assert_same(i, subject, case.size(), &touch, &cold);
        }
    });
}

/// Aligned, coaxial, very flat and nearly coincident bodies: an answer is finite, or the method reports a
/// failure.
#[test]
fn no_answer_is_not_a_number() {
    let upright = Mat3::identity();
    let shapes =
        [[1.0, 1.0, 1.0], [1.0, 0.5, 0.5], [1.0, 1.0, 0.01], [0.01, 0.01, 1.0], [3.0, 2.0, 1.0]]
            .map(|axes| Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::from(axes) }));
    let steps =
        [Vec3::x(), Vec3::y(), Vec3::z(), Vec3::new(1.0, 1.0, 0.0), Vec3::new(1e-9, 1.0, 0.0)];
    let lengths = [0.0, 1e-300, 1e-20, 1e-9, 1e-3, 0.02, 0.1, 0.5, 1.0, 1.5, 2.0, 4.0];
    for subject in ellipsoid_resolvers() {
        for a in &shapes {
            for b in &shapes {
                for r in steps.iter().flat_map(|step| lengths.map(|length| step * length)) {
                    let case = Case { a: (a.clone(), upright), b: (b.clone(), upright), r };
                    if let Outcome::Touching(touch) = case.resolve(&*subject.resolver, None) {
                        let good = touch.overlap > 0.0
                            && touch.overlap.is_finite()
                            && (touch.normal.norm() - 1.0).abs() < 1e-14
                            && touch.point.iter().all(|x| x.is_finite());
                        assert!(good, "{}: {a:?} {b:?} {r}: {touch:?}", subject.resolver.name());
                    }
                }
            }
        }
        let lost = Case {
            r: Vec3::new(0.1, f64::NAN, 0.1),
            ..subject.case(&mut Random::of(SEED, 0), 0.1)
        };
        let outcome = lost.resolve(&*subject.resolver, None);
        assert!(matches!(outcome, Outcome::Failed(_)), "{}: {outcome:?}", subject.resolver.name());
    }
}

/// A wall: the height of an ellipsoid's centre is `√(n·A n)`.
#[test]
fn walls_have_closed_forms() {
    for i in 0..CASES {
        let mut random = Random::of(SEED + i as u64, 0);
        let (shape, frame) = (ellipsoid(&mut random), random.frame());
        // A plane of a rotated wall, away from the wall's reference point.
        let (of_wall, offset) = (random.frame(), random.between(-2.0, 2.0));
        let own = random.direction();
        let (wall, normal) = (Shape::HalfSpace(HalfSpace { normal: own, offset }), of_wall * own);
        let axes = frame.tr_mul(&normal).component_mul(&shape.semi_axes());
        let overlap = random.between(-0.1, 0.1);
        // Any point of the plane serves.
        let aside = normal.cross(&random.direction()) * 10.0;
        let r = aside - normal * (axes.norm() - overlap);
        let (a, b) = (Posed::new(&shape, &frame), Posed::new(&wall, &of_wall));
        match AgainstHalfSpace.touch(&a, &b, &(r - normal * offset), None) {
            Outcome::Apart(_) => assert!(overlap <= ROUNDING, "seed {SEED} + {i}"),
            Outcome::Failed(why) => panic!("seed {SEED} + {i}: {why:?}"),
            Outcome::Touching(touch) => {
                assert!(
                    (touch.overlap - overlap).abs() <= ROUNDING,
                    "seed {SEED} + {i}: {touch:?}"
                );
                assert_eq!(touch.normal, -normal);
                // Half-way between the deepest point and the plane.
                let depth = (touch.point - r).dot(&normal);
                assert!((depth + 0.5 * overlap).abs() <= ROUNDING, "seed {SEED} + {i}: {depth}");
            }
        }
    }
}

/// Closed forms are chosen by the pair and not by the method.
#[test]
fn the_table_serves_every_pair() {
    let methods = [Method::Auto, Method::CommonNormal, Method::Epa(Epa::new(1e-6))];
    for (method, name) in methods.iter().zip(["common-normal", "common-normal", "epa"]) {
        let table = table(method, &Kind::ALL);
        let serving = |a, b| table.get((a, b)).map(ContactResolver::name);
        assert_eq!(serving(Kind::Ellipsoid, Kind::Ellipsoid), Some(name));
        assert_eq!(serving(Kind::Ellipsoid, Kind::Sphere), Some(name));
        assert_eq!(serving(Kind::Sphere, Kind::Sphere), Some("sphere-sphere"));
        assert_eq!(serving(Kind::HalfSpace, Kind::Sphere), Some("half-space"));
        assert_eq!(serving(Kind::Ellipsoid, Kind::HalfSpace), Some("half-space"));
        assert_eq!(serving(Kind::HalfSpace, Kind::HalfSpace), None);
    }
    assert!(table(&Method::Auto, &[Kind::Sphere]).get((Kind::Sphere, Kind::Ellipsoid)).is_none());
}
