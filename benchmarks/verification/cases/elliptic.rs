//! Hertz' law of elliptic contacts (Johnson 1985, *Contact Mechanics*, DOI 10.1017/CBO9781139171731, equations 4.26 to 4.32):
//! impacts of ellipsoids, compared with elliptic integrals by quadrature.

use super::{Case, Effort, Findings, Frame, Grain, Plane, Setup, Ways};
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::random::Random;
use std::f64::consts::{FRAC_PI_2, PI};

const SOURCE: &str = "Hertz 1882, elliptic contacts: Johnson 1985, 10.1017/CBO9781139171731";

const YOUNGS: f64 = 5e9;
const POISSON: f64 = 0.25;
const DENSITY: f64 = 2500.0;
/// Semi-axes of the ellipsoid are 2, 1 and 1 times this [m].
const SIZE: f64 = 1e-3;
/// Relative velocity [m/s].
const SPEED: f64 = 0.5;

/// `R'/R''` and `F2` of a contact ellipse with this ratio of the shorter to the longer axis. Integrals use the trapezoidal rule,
/// which converges geometrically for periodic functions.
pub(crate) fn ellipse(axes: f64) -> [f64; 2] {
    const COUNT: u32 = 20_000;
    let (mut of_cos, mut of_sin) = (0.0, 0.0);
    for k in 0..=COUNT {
        let (sin, cos) = (FRAC_PI_2 * f64::from(k) / f64::from(COUNT)).sin_cos();
        let weight = if k == 0 || k == COUNT { 0.5 } else { 1.0 };
        let root = (cos * cos + axes * axes * sin * sin).sqrt();
        of_cos += weight * cos * cos / root;
        of_sin += weight * sin * sin / root;
    }
    let step = FRAC_PI_2 / f64::from(COUNT);
    (of_cos, of_sin) = (of_cos * step, of_sin * step);
    // With e² = 1 - (b/a)²: ∫ cos²/Δ = (E - (b/a)² K) / e², ∫ sin²/Δ = (K - E) / e², and K is their sum.
    let ratio = of_cos / of_sin / (axes * axes);
    let f1 = (4.0 / PI * axes.sqrt() * (of_cos * of_sin).sqrt()).cbrt();
    let f2 = 2.0 / PI * axes.sqrt() * (of_cos + of_sin) / f1;
    [ratio, f2]
}

/// `F2` for a ratio of radii of at least 1, by bisection.
pub(crate) fn f2_of(ratio: f64) -> f64 {
    let (mut low, mut high) = (1e-4_f64, 1.0);
    for _ in 0..60 {
        let middle = (low * high).sqrt();
        if ellipse(middle)[0] > ratio { low = middle } else { high = middle }
    }
    ellipse(high)[1]
}

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut ways = Ways::new(SOURCE);
    let steps = effort.pick(1000.0, 4000.0);
    let mut cases = vec![
        on_a_plane(steps, &mut ways),
        crossed(steps, &mut ways),
        restitution(effort, &mut ways),
        oblique(effort, &mut ways),
    ];
    cases.extend(ways.into_cases());
    Findings { cases, notes: others(), ..Findings::default() }
}

/// Tables of the scene.
fn text(restitution: f64) -> String {
    format!(
        "[law]\nnormal = \"hertz\"\n\
         [[material]]\nname = \"grain\"\ndensity = {DENSITY}\nyoungs_modulus = {YOUNGS:e}\npoisson_ratio = {POISSON}\n\
         restitution = {restitution}\n\
         [[material]]\nname = \"rigid\"\ndensity = 1.0\nyoungs_modulus = 7e20\npoisson_ratio = 0\nrestitution = {restitution}\n\
         [[shape]]\nname = \"long\"\nkind = \"ellipsoid\"\nmaterial = \"grain\"\nsemi_axes = [{:e}, {SIZE:e}, {SIZE:e}]\n",
        2.0 * SIZE
    )
}

fn mass() -> f64 {
    4.0 / 3.0 * PI * 2.0 * SIZE.powi(3) * DENSITY
}

/// `N / δ^(3/2)` of a particle and a rigid body for this radius [m].
fn stiffness(radius: f64) -> f64 {
    4.0 / 3.0 * YOUNGS / (1.0 - POISSON * POISSON) * radius.sqrt()
}

/// Contact time [s] and largest force [N] of an impact with `N = k δ^(3/2)`.
fn closed_form(k: f64, mass: f64) -> [f64; 2] {
    let overlap = (1.25 * mass * SPEED * SPEED / k).powf(0.4);
    // 2 √π Γ(1.4) / Γ(0.9)
    [2.943_275_2 * overlap / SPEED, k * overlap.powf(1.5)]
}

/// Contact time [s] and largest force [N] from frames after each step, with `gap` the distance of the surfaces [m].
fn measured(frames: &[Frame], gap: impl Fn(&Frame) -> f64) -> [f64; 2] {
    let gaps: Vec<f64> = frames.iter().map(gap).collect();
    let dt = frames[1].time - frames[0].time;
    let crossings =
        gaps.windows(2).enumerate().filter(|(_, gaps)| (gaps[0] > 0.0) != (gaps[1] > 0.0));
    let times: Vec<f64> =
        crossings.map(|(k, gaps)| (k as f64 + gaps[0] / (gaps[0] - gaps[1])) * dt).collect();
    let [first, last] = times[..] else { panic!("it touches once: {times:?}") };
    let speed = |frame: &Frame| frame.bodies[0].velocity.z;
    let force =
        frames.windows(3).map(|f| (speed(&f[2]) - speed(&f[0])).abs() / (2.0 * dt) * mass());
    [last - first, force.fold(0.0, f64::max)]
}

fn impact(case: &mut Case, what: &str, expected: [f64; 2], found: [f64; 2]) {
    for (k, quantity) in ["contact time [s]", "largest force [N]"].into_iter().enumerate() {
        case.relative(format!("{what}: {quantity}"), expected[k], found[k]);
    }
}

/// An ellipsoid on its side, where the radii of curvature are 4 and 1 times the size.
fn on_a_plane(steps: f64, ways: &mut Ways) -> Case {
    let mut case = Case::new(
        SOURCE,
        "an ellipsoid of 1:2 drops on its side on a rigid plane, R'/R'' = 4",
        "contact time and largest force (relative)",
        1e-4,
        "second order of the step; the force is a difference of velocities",
    );
    let expected = closed_form(stiffness(2.0 * SIZE) * f2_of(4.0).powf(-1.5), mass());
    for angle in [0.0, 0.7] {
        let dt = expected[0] / steps;
        let place = Vec3::z() * (SIZE + SPEED * dt * 10.37);
        let setup = Setup {
            gravity: Vec3::zeros(),
            text: text(1.0),
            planes: vec![Plane::floor("rigid")],
            grains: vec![
                Grain::at("long", place)
                    .moving(Vec3::z() * -SPEED)
                    .turned(Quat::from_axis_angle(&Vec3::z_axis(), angle)),
            ],
            dt,
        };
        let what = format!("{angle} rad about the normal");
        let frames = ways.run(&what, &setup, (1.1 * steps) as u64, 1);
        impact(&mut case, &what, expected, measured(&frames, |f| f.bodies[0].position.z - SIZE));
    }
    case
}

/// Two ellipsoids. Crossed at a right angle, both radii of relative curvature are 4/5 of the size; side by side they are 2 and
/// 1/2 of it.
fn crossed(steps: f64, ways: &mut Ways) -> Case {
    let mut case = Case::new(
        SOURCE,
        "two ellipsoids of 1:2 meet with their sides, crossed and side by side",
        "contact time and largest force (relative)",
        1e-4,
        "as before",
    );
    for (what, angle, root) in [
        ("crossed", FRAC_PI_2, stiffness(0.8 * SIZE)),
        ("side by side", 0.0, stiffness(SIZE) * f2_of(4.0).powf(-1.5)),
    ] {
        // Half of E*, and half of the mass.
        let expected = closed_form(0.5 * root, 0.5 * mass());
        let dt = expected[0] / steps;
        let place = Vec3::z() * (SIZE + 0.5 * SPEED * dt * 10.37);
        let setup = Setup {
            gravity: Vec3::zeros(),
            text: text(1.0),
            planes: Vec::new(),
            grains: vec![
                Grain::at("long", place).moving(Vec3::z() * (-0.5 * SPEED)),
                Grain::at("long", -place)
                    .moving(Vec3::z() * (0.5 * SPEED))
                    .turned(Quat::from_axis_angle(&Vec3::z_axis(), angle)),
            ],
            dt,
        };
        let frames = ways.run(what, &setup, (1.1 * steps) as u64, 1);
        let gap = |f: &Frame| f.bodies[0].position.z - f.bodies[1].position.z - 2.0 * SIZE;
        impact(&mut case, what, expected, measured(&frames, gap));
    }
    case
}

fn restitution(effort: Effort, ways: &mut Ways) -> Case {
    let mut case = Case::new(
        SOURCE,
        "the same drop with dashpots",
        "coefficient of restitution recovered (relative)",
        1e-3,
        "dashpot of first order",
    );
    let [time, _] = closed_form(stiffness(2.0 * SIZE), mass());
    let steps = effort.pick(4000.0, 20_000.0);
    for e in effort.pick(vec![0.2, 0.8], vec![0.1, 0.2, 0.4, 0.5, 0.6, 0.8, 0.98]) {
        let dt = time / steps;
        let setup = Setup {
            gravity: Vec3::zeros(),
            text: text(e),
            planes: vec![Plane::floor("rigid")],
            grains: vec![
                Grain::at("long", Vec3::z() * (SIZE + SPEED * dt * 0.37))
                    .moving(Vec3::z() * -SPEED),
            ],
            dt,
        };
        let (name, all) = (format!("e = {e}"), (3.0 * steps) as u64);
        let frames = ways.run(&name, &setup, all, all);
        case.relative(name, e, frames[1].bodies[0].velocity.z / SPEED);
    }
    case
}

/// Elastic impacts in any orientation: the energy depends on the position of the contact.
fn oblique(effort: Effort, ways: &mut Ways) -> Case {
    let mut case = Case::new(
        SOURCE,
        "two ellipsoids of 1:2 meet in any way without losses",
        "change of the kinetic energy (relative)",
        1e-6,
        "second order of the step and less; at any step 4e-4 without the forces that go with the change of curvature",
    );
    let steps = effort.pick(2000.0, 4000.0);
    let dt = 5e-5 / steps;
    for k in 0..effort.pick(3, 12) {
        let mut random = Random::of(17, k);
        let turns = [random.rotation(), random.rotation()];
        let normal = random.rotation() * Vec3::x();
        let side = normal.cross(&(random.rotation() * Vec3::x())).normalize();
        let velocity = (normal * 0.764 + side * 0.645) * (0.5 * SPEED);
        let axes = Vec3::new(2.0, 1.0, 1.0) * SIZE;
        let support = |turn: &Quat, way: &Vec3| {
            let scaled = axes.component_mul(&turn.inverse_transform_vector(way));
            turn * (axes.component_mul(&scaled) / scaled.norm())
        };
        let r = support(&turns[0], &normal) - support(&turns[1], &-normal)
            + normal * (SPEED * dt * 3.37);
        let mut grain = |k: usize, sign: f64| {
            Grain::at("long", r * (-0.5 * sign))
                .moving(velocity * sign)
                .spinning(random.rotation() * Vec3::x() * 8.0)
                .turned(turns[k])
        };
        let grains = vec![grain(0, 1.0), grain(1, -1.0)];
        let setup =
            Setup { gravity: Vec3::zeros(), text: text(1.0), planes: Vec::new(), grains, dt };
        let all = (3.0 * steps) as u64;
        let what = format!("way {k}");
        let frames = ways.run(&what, &setup, all, all / 50);
        let (first, last) = (&frames[0], &frames[frames.len() - 1]);
        assert!(frames.iter().any(Frame::is_touching) && !last.is_touching(), "they meet");
        case.absolute(what, 0.0, last.kinetic() / first.kinetic() - 1.0);
    }
    case
}

/// Results of the drop on the side with a radius that depends on one body alone.
fn others() -> Vec<String> {
    let exact = closed_form(stiffness(2.0 * SIZE) * f2_of(4.0).powf(-1.5), mass());
    let all = [
        ("the radius of the sphere of the same volume", 2.0_f64.cbrt()),
        ("the mean of both curvatures", 1.6),
        ("their geometric mean", 2.0),
    ];
    let note = |(name, radius): (&str, f64)| {
        let [time, force] = closed_form(stiffness(radius * SIZE), mass());
        format!(
            "on its side on a plane, {name} in place of the ellipse: contact time {:+.1} %, largest force {:+.1} %",
            100.0 * (time / exact[0] - 1.0),
            100.0 * (force / exact[1] - 1.0)
        )
    };
    all.into_iter().map(note).collect()
}
