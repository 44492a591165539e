//! Contact resolution against answers with 50 digits: see `tests/reference/README.md`.

use dem_mpi::contact::{
    CommonNormal, ContactResolver, Epa, ErodedGjk, Method, Outcome, Posed, SphereSphere, Touch,
    table,
};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::shape::{Ellipsoid, Kind, Shape, Sphere};
use std::collections::BTreeMap;

/// Backward error of a good method relative to the longest semi-axis: a few hundred roundings.
const BACKWARD: f64 = 1e-13;
/// GJK at a relative duality gap of 1e-14. The error of the direction is the square root of the rounding of the
/// distance. The overlap's error is linear in it, as the direction is off the minimum.
const TIGHT: f64 = 1e-14;
const TIGHT_DIRECTION: f64 = 1.5e-7;
const TIGHT_OVERLAP: f64 = 5e-9;
const TIGHT_POINT: f64 = 1e-7;

/// A pair of ellipsoids and its reference answer.
struct Case {
    id: String,
    tag: String,
    a: (Shape, Mat3),
    b: (Shape, Mat3),
    r: Vec3,
    overlap: f64,
    normal: Vec3,
    point: Vec3,
    kappa: f64,
    rho: f64,
    unique: bool,
    /// Longest semi-axis.
    size: f64,
}

impl Case {
    fn resolve(&self, resolver: &dyn ContactResolver) -> Outcome {
        let a = Posed::new(&self.a.0, &self.a.1);
        let b = Posed::new(&self.b.0, &self.b.1);
        resolver.touch(&a, &b, &self.r, None)
    }

    /// The touch, or `None` if the bodies are apart.
    fn touch(&self, resolver: &dyn ContactResolver) -> Option<Touch> {
        match self.resolve(resolver) {
            Outcome::Touching(touch) => Some(touch),
            Outcome::Apart(_) => None,
            Outcome::Failed(why) => panic!("{} {}: {why:?}", self.id, self.tag),
        }
    }

    /// Checks the overlap to `tolerance` of the longest semi-axis; apart counts as zero or less.
    fn check_overlap(&self, touch: Option<&Touch>, tolerance: f64) {
        let tolerance = tolerance * self.size;
        let good = match touch {
            Some(touch) => (touch.overlap - self.overlap).abs() <= tolerance,
            None => self.overlap <= tolerance,
        };
        assert!(good, "{} {}: {touch:?} but the overlap is {:e}", self.id, self.tag, self.overlap);
    }

    /// Checks all values to rounding error, as far as the condition of the problem allows.
    fn check_exact(&self, touch: Option<&Touch>) {
        self.check_overlap(touch, BACKWARD);
        let Some(touch) = touch.filter(|_| self.unique) else { return };
        let error = BACKWARD * self.size;
        let off = angle(&touch.normal, &self.normal);
        assert!(
            off <= error / self.kappa + 1e-15,
            "{} {}: normal off by {off:e}",
            self.id,
            self.tag
        );
        let off = (touch.point - self.point).norm();
        assert!(
            off <= error * (1.0 + self.rho / self.kappa),
            "{} {}: point off by {off:e}",
            self.id,
            self.tag
        );
    }
}

fn angle(a: &Vec3, b: &Vec3) -> f64 {
    a.cross(b).norm().atan2(a.dot(b))
}

/// The rows of a table as maps from column to text.
fn rows(csv: &str) -> Vec<BTreeMap<String, String>> {
    csv::Reader::from_reader(csv.as_bytes()).deserialize().collect::<Result<_, _>>().unwrap()
}

fn cases(csv: &str) -> Vec<Case> {
    rows(csv).iter().map(case).collect()
}

fn case(row: &BTreeMap<String, String>) -> Case {
    let number = |name: &str| row[name].parse::<f64>().unwrap();
    let vector = |names: [&str; 3]| Vec3::from(names.map(number));
    let body = |semi_axes: [&str; 3], quaternion: [&str; 4]| {
        let [w, x, y, z] = quaternion.map(number);
        let rotation = Quat::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
        let shape = Shape::Ellipsoid(Ellipsoid { semi_axes: vector(semi_axes) });
        (shape, rotation.to_rotation_matrix().into_inner())
    };
    let (centre_a, centre_b) = (vector(["xA", "yA", "zA"]), vector(["xB", "yB", "zB"]));
    let r = centre_b - centre_a;
    let point = if row.contains_key("rAx") {
        (vector(["rAx", "rAy", "rAz"]) + (r + vector(["rBx", "rBy", "rBz"]))) * 0.5
    } else {
        vector(["Cx", "Cy", "Cz"]) - centre_a
    };
    Case {
        id: row["id"].clone(),
        tag: row["tag"].clone(),
        a: body(["aA", "bA", "cA"], ["qwA", "qxA", "qyA", "qzA"]),
        b: body(["aB", "bB", "cB"], ["qwB", "qxB", "qyB", "qzB"]),
        r,
        overlap: number("overlap"),
        normal: vector(["nx", "ny", "nz"]),
        point,
        kappa: number("kappa"),
        rho: number("rho"),
        unique: row["unique"] == "1",
        size: vector(["aA", "bA", "cA"]).max().max(vector(["aB", "bB", "cB"]).max()),
    }
}

fn case_1() -> Vec<Case> {
    cases(include_str!("../reference/caseI.csv"))
}

fn case_2() -> Vec<Case> {
    cases(include_str!("../reference/caseII.csv"))
}

fn case_3() -> Vec<Case> {
    cases(include_str!("../reference/caseIII_public.csv"))
}

/// Aspect ratios to 100, size ratios to 1000, overlaps of 1e-15, deep, far away, other units. Pairs with
/// coincident centres are left out.
fn extreme() -> Vec<Case> {
    let mut all = cases(include_str!("../reference/extreme_public.csv"));
    all.retain(|case| case.r != Vec3::zeros());
    all
}

#[test]
fn common_normal_is_exact() {
    for case in case_1().iter().chain(&case_2()).chain(&case_3()).chain(&extreme()) {
        case.check_exact(case.touch(&CommonNormal).as_ref());
    }
}

#[test]
fn epa_keeps_its_tolerance() {
    for tolerance in [1e-4, 1e-8, 1e-11] {
        let epa = Epa::new(tolerance);
        for case in case_1().iter().chain(&case_2()).chain(&case_3()) {
            let touch = case.touch(&epa);
            case.check_overlap(touch.as_ref(), tolerance + BACKWARD);
            if let Some(touch) = touch {
                assert!(touch.overlap >= case.overlap - BACKWARD, "{}: too little", case.id);
                // An excess e of the overlap is kappa angle^2 / 2.
                let off = angle(&touch.normal, &case.normal);
                let bound = (2.0 * (tolerance + BACKWARD) * case.size / case.kappa).sqrt();
                assert!(off <= 1.1 * bound, "{}: normal off by {off:e} of {bound:e}", case.id);
            }
        }
    }
}

#[test]
fn epa_in_extreme_cases() {
    // A continuum of normals: no polytope gets within 1e-8 with a thousand corners.
    const RINGS: &str = "axial_tip;spheroid;NONUNIQUE";
    let epa = Epa::default();
    for case in extreme().iter().filter(|case| case.tag != RINGS) {
        case.check_overlap(case.touch(&epa).as_ref(), epa.tolerance + BACKWARD);
    }
}

/// The methods with their fallbacks answer every pair, and only erosion overestimates.
#[test]
fn every_method_answers_every_pair() {
    let erosion = ErodedGjk::default();
    let methods = [
        (Method::Auto, BACKWARD),
        (Method::Epa(Epa::new(1e-6)), 1e-6),
        (
            Method::GjkErosion(ErodedGjk {
                ratio: erosion.ratio,
                increment: erosion.increment,
                tolerance: erosion.tolerance,
                ..ErodedGjk::default()
            }),
            f64::INFINITY,
        ),
    ];
    for (method, tolerance) in methods {
        let table = table(&method, &[Kind::Ellipsoid]);
        let resolver = table.get((Kind::Ellipsoid, Kind::Ellipsoid)).unwrap();
        for case in extreme() {
            let touch = case.touch(resolver);
            if !case.tag.ends_with("NONUNIQUE") {
                case.check_overlap(touch.as_ref(), tolerance);
            }
            let overlap = touch.map_or(0.0, |touch| touch.overlap);
            assert!(overlap >= case.overlap - BACKWARD * case.size, "{} {}", case.id, case.tag);
        }
    }
}

/// With coincident centres no normal is unique: a method may fail, but not be wrong.
#[test]
fn coincident_centres() {
    let all = cases(include_str!("../reference/extreme_public.csv"));
    for case in all.iter().filter(|case| case.r == Vec3::zeros()) {
        for resolver in
            [&CommonNormal as &dyn ContactResolver, &Epa::default(), &ErodedGjk::default()]
        {
            match case.resolve(resolver) {
                Outcome::Touching(touch) => case.check_overlap(Some(&touch), 1e-7),
                Outcome::Failed(_) => {}
                Outcome::Apart(_) => panic!("{} {} missed", resolver.name(), case.id),
            }
        }
    }
}

#[test]
fn spheres() {
    for line in include_str!("../reference/spheres_public.jsonl").lines() {
        let row: serde_json::Value = serde_json::from_str(line).unwrap();
        let vector = |name: &str| serde_json::from_value::<Vec3>(row[name].clone()).unwrap();
        let number = |name: &str| row[name].as_f64().unwrap();
        let sphere = |radius| Shape::Sphere(Sphere { radius });
        let (a, b) = (sphere(number("rA")), sphere(number("rB")));
        let frame = Mat3::identity();
        let (a, b) = (Posed::new(&a, &frame), Posed::new(&b, &frame));
        let (centre, r) = (vector("cA"), vector("cB") - vector("cA"));
        let error = BACKWARD * number("rA").max(number("rB"));
        match SphereSphere.touch(&a, &b, &r, None) {
            Outcome::Apart(_) => assert!(number("overlap") <= error, "{}", row["id"]),
            Outcome::Failed(why) => assert!(row["n"].is_null(), "{}: {why:?}", row["id"]),
            Outcome::Touching(touch) => {
                assert!((touch.overlap - number("overlap")).abs() <= error, "{}", row["id"]);
                // The files' points are rounded in place, and the normals come from rounded centres.
                let far = 4.0 * f64::EPSILON * (centre.norm() + r.norm());
                assert!(
                    angle(&touch.normal, &vector("n")) <= 1e-15 + error / r.norm(),
                    "{}",
                    row["id"]
                );
                assert!(
                    (touch.point - (vector("C") - centre)).norm() <= error + far,
                    "{}",
                    row["id"]
                );
            }
        }
    }
}

/// Exact limit of the paper's method, pair by pair.
#[test]
fn erosion_row_by_row() {
    let all: BTreeMap<_, _> = case_3().into_iter().map(|case| (case.id.clone(), case)).collect();
    let erosion = ErodedGjk { tolerance: TIGHT, ..ErodedGjk::default() };
    for row in rows(include_str!("../reference/caseIII_erosion05_public.csv")) {
        let case = &all[&row["id"]];
        let number = |name: &str| row[name].parse::<f64>().unwrap();
        let vector = |names: [&str; 3]| Vec3::from(names.map(number));
        let touch = case.touch(&erosion).unwrap();
        let off = (touch.overlap - number("overlap_erosion")).abs();
        assert!(off <= TIGHT_OVERLAP, "{}: overlap off by {off:e}", case.id);
        let off = angle(&touch.normal, &vector(["nx", "ny", "nz"]));
        assert!(off <= TIGHT_DIRECTION, "{}: direction off by {off:e}", case.id);
        let off = (touch.point - vector(["Cx", "Cy", "Cz"])).norm();
        assert!(off <= TIGHT_POINT, "{}: point off by {off:e}", case.id);
    }
}

fn percentile(values: &mut [f64], percent: usize) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() * percent / 100]
}

fn close(value: f64, expected: f64, relative: f64) -> bool {
    (value - expected).abs() <= relative * expected
}

/// Errors of Case III in the paper, to the digits of the independent reference. At its default tolerance GJK adds
/// little to them.
#[test]
fn erosion_errors_of_case_3() {
    for (tolerance, relative) in [(TIGHT, 0.02), (ErodedGjk::default().tolerance, 0.1)] {
        let erosion = ErodedGjk { tolerance, ..ErodedGjk::default() };
        let (mut overlap, mut degrees, mut point) = (Vec::new(), Vec::new(), Vec::new());
        for case in case_3().iter().filter(|case| case.tag.starts_with("contact")) {
            let touch = case.touch(&erosion).unwrap();
            overlap.push(touch.overlap / case.overlap - 1.0);
            degrees.push(angle(&touch.normal, &case.normal).to_degrees());
            point.push((touch.point - case.point).norm());
        }
        let median = percentile(&mut overlap, 50);
        assert!(close(median, 5.5e-3, relative), "{tolerance:e}: overlap {median:e}");
        let (median, most) = (percentile(&mut degrees, 50), percentile(&mut degrees, 99));
        assert!(close(median, 0.74, relative), "{tolerance:e}: median normal {median}");
        assert!(close(most, 2.21, relative), "{tolerance:e}: 99th percentile of normals {most}");
        let (median, most) = (percentile(&mut point, 50), percentile(&mut point, 99));
        assert!(close(median, 3.6e-3, relative), "{tolerance:e}: median point {median:e}");
        assert!(close(most, 9.9e-3, relative), "{tolerance:e}: 99th percentile of points {most:e}");
    }
}

/// Case I of the paper. Touching ellipsoids get an overlap of 0.1 % of the short axis, a normal about 3 degrees
/// off and, by symmetry, the right contact point.
#[test]
fn erosion_in_case_1() {
    let erosion = ErodedGjk { tolerance: TIGHT, ..ErodedGjk::default() };
    for (i, case) in case_1().iter().enumerate() {
        let touch = case.touch(&erosion).unwrap();
        if i == 0 {
            assert!(close(touch.overlap, 1.0296e-3, 1e-4), "spurious overlap {:e}", touch.overlap);
        }
        let degrees = angle(&touch.normal, &case.normal).to_degrees();
        assert!((2.94..3.09).contains(&degrees), "{}: {degrees}", case.id);
        assert!((touch.point - case.point).norm() < 1e-15, "{}", case.id);
    }
}

/// Scale at which both bodies just touch (Perram and Wertheim 1985), and the final ratio of erosion of 5 % in
/// steps of 1 %.
#[test]
fn touch_scales() {
    // Closer to touch, or to the end of an erosion, rounding decides.
    const TOUCH: f64 = 1e-14;
    const EROSION: f64 = 1e-9;
    let all = case_1().into_iter().chain(case_2()).chain(case_3());
    let all: BTreeMap<_, _> = all.chain(extreme()).map(|case| (case.id.clone(), case)).collect();
    let chain = table(&Method::Auto, &[Kind::Ellipsoid]);
    let chain = chain.get((Kind::Ellipsoid, Kind::Ellipsoid)).unwrap();
    let paper = ErodedGjk { tolerance: 1e-10, ..ErodedGjk::default() };
    for row in rows(include_str!("../reference/touch_scale.csv")) {
        // Pairs with coincident centres are left out.
        let Some(case) = all.get(&row["id"]) else { continue };
        let scale = row["touch_scale"].parse::<f64>().unwrap();
        if (scale - 1.0).abs() > TOUCH {
            let touches = matches!(case.resolve(chain), Outcome::Touching(_));
            assert_eq!(touches, scale < 1.0, "{} {}: {scale}", case.id, case.tag);
        }
        let ends = row["erosion_ratio_5pct_plus_1pct"].as_str();
        let found = case.resolve(&paper);
        let Ok(ratio) = ends.parse::<f64>() else {
            // Pairs that are apart may have a spurious contact; pairs that never separate are reported as
            // failures.
            let failed = matches!(found, Outcome::Failed(_));
            assert_eq!(failed, ends == "never", "{} {}: {found:?}, {ends}", case.id, case.tag);
            continue;
        };
        // Erosion with this ratio alone.
        let alone = |ratio: f64| {
            let increment = 1.98 * (1.0 - ratio);
            case.resolve(&ErodedGjk { ratio, increment, ..paper })
        };
        let [at, before] = [ratio, ratio - paper.increment].map(|ratio| 1.0 - ratio - scale);
        if at.abs() < EROSION || before.abs() < EROSION {
            continue;
        }
        let (Outcome::Touching(at), Outcome::Touching(found)) = (alone(ratio), found) else {
            panic!("{} {}: {found:?} at {ratio}", case.id, case.tag)
        };
        let off = (at.overlap - found.overlap).abs() / case.size;
        assert!(off < 1e-4, "{} {}: ended elsewhere than at {ratio}: {off:e}", case.id, case.tag);
        if ratio > paper.ratio {
            let before = alone(ratio - paper.increment);
            assert!(matches!(before, Outcome::Failed(_)), "{} {}: {before:?}", case.id, case.tag);
        }
    }
}
