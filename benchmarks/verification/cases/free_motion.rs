//! Bodies in free motion, with or without gravity: closed forms, and an independent reference (2026-11).

use super::{Body, Case, Effort, Findings, Frame, Grain, Setup, parse_reference};
use dem_mpi::math::{Quat, Vec3};
use nalgebra::Quaternion;
use serde_json::Value;

const MECHANICS: &str = "closed form (Galilei, Euler; Goldstein ch. 5)";
const REFERENCE: &str = "independent reference, Jacobi functions (dem_euler_top.json)";

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut cases = Vec::from(projectile());
    cases.extend(euler_top(effort));
    cases.extend(long_spins(effort));
    cases.push(flips(effort));
    Findings { cases, ..Findings::default() }
}

/// One body of this shape, in TOML.
fn alone(kind: &str, dt: f64, grain: Grain) -> Setup {
    Setup {
        gravity: Vec3::zeros(),
        text: format!(
            "[[material]]\nname = \"m\"\ndensity = 1.0\nnormal_stiffness = 1e-9\n[[shape]]\nname = \"body\"\n{kind}"
        ),
        planes: Vec::new(),
        grains: vec![grain],
        dt,
    }
}

fn ellipsoid(axes: [f64; 3]) -> String {
    format!("kind = \"ellipsoid\"\nsemi_axes = {axes:?}")
}

fn projectile() -> [Case; 2] {
    let why = "exact but for rounding: a step of the closed form is the closed form; 1,000 steps";
    let mut place = Case::new(
        MECHANICS,
        "projectile",
        "position after 1,000 steps, over the way moved",
        1e-12,
        why,
    );
    let mut speed =
        Case::new(MECHANICS, "projectile", "velocity, over that at the start", 1e-12, why);
    let (gravity, thrown) = (Vec3::new(0.3, -0.2, -9.81), Vec3::new(1.0, 2.0, 3.0));
    for (name, kind) in [
        ("sphere", "kind = \"sphere\"\nradius = 0.1".to_owned()),
        ("ellipsoid", ellipsoid([0.1, 0.07, 0.05])),
    ] {
        for dt in [1e-3, 1e-4] {
            let grain =
                Grain::at("body", Vec3::zeros()).moving(thrown).spinning(Vec3::new(0.1, 0.2, 0.3));
            let setup = Setup { gravity, ..alone(&kind, dt, grain) };
            let end = setup.run(1000, 1000).pop().expect("an end");
            let t = 1000.0 * dt;
            let (x, v) = (thrown * t + gravity * (0.5 * t * t), thrown + gravity * t);
            let what = format!("{name}, step {dt:e} s");
            place.absolute(&what, 0.0, (end.bodies[0].position - x).norm() / x.norm());
            speed.absolute(what, 0.0, (end.bodies[0].velocity - v).norm() / thrown.norm());
        }
    }
    [place, speed]
}

fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().expect("a list");
    list.iter().map(|x| x.as_f64().expect("a number")).collect()
}

/// A top of the reference: initial state, and states at later times.
pub(crate) struct Top {
    /// Name in the reference.
    pub(crate) name: String,
    /// Scene of the body.
    pub(crate) setup: Setup,
    /// Time [s], angular velocity in body axes [rad/s], orientation.
    pub(crate) rows: Vec<(f64, Vec3, Quat)>,
}

impl Top {
    /// All tops of the reference.
    pub(crate) fn all(dt: f64) -> Vec<Self> {
        let reference = parse_reference("dem_euler_top.json");
        let axes = numbers(&reference["semi_axes"]);
        let of = |case: &Value| {
            let unit = |q: &[f64]| Quat::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
            let omega = Vec3::from_column_slice(&numbers(&case["omega0_body"]));
            let orientation = unit(&numbers(&case["quaternion0"]));
            let grain =
                Grain::at("body", Vec3::zeros()).turned(orientation).spinning(orientation * omega);
            let lists = |key: &str| {
                case[key].as_array().expect("a list").iter().map(numbers).collect::<Vec<_>>()
            };
            let (omegas, turns) = (lists("omega_body"), lists("quaternion_wxyz_body_to_world"));
            let times = numbers(&case["t"]);
            let row = |k: usize| (times[k], Vec3::from_column_slice(&omegas[k]), unit(&turns[k]));
            Self {
                name: case["name"].as_str().expect("a name").to_owned(),
                setup: alone(&ellipsoid([axes[0], axes[1], axes[2]]), dt, grain),
                rows: (0..times.len()).map(row).collect(),
            }
        };
        reference["cases"].as_array().expect("cases").iter().map(of).collect()
    }

    /// Distance of the body from a row of the reference: the larger of the angle between orientations [rad] and the
    /// difference of angular velocities [rad/s].
    pub(crate) fn error(body: &Body, row: &(f64, Vec3, Quat)) -> f64 {
        let angle = body.orientation.angle_to(&row.2);
        let omega = body.orientation.inverse() * body.spin;
        angle.max((omega - row.1).norm())
    }
}

fn euler_top(effort: Effort) -> [Case; 3] {
    let dt = effort.pick(1e-3, 2e-4);
    let mut follows = Case::new(
        REFERENCE,
        "Euler top, semi-axes 3, 2, 1, until 20 s",
        "orientation (rad) and angular velocity (rad/s), largest difference",
        effort.pick(2e-4, 1e-5),
        "second order in the step",
    );
    let mut unstable = Case::new(
        REFERENCE,
        "Euler top on the separatrix, until 5 s",
        "orientation (rad) and angular velocity (rad/s), largest difference",
        effort.pick(2e-4, 1e-5),
        "second order in the step; any error doubles in each second or so",
    );
    let mut keeps = Case::new(
        MECHANICS,
        "the same: what is conserved",
        "energy and angular momentum, largest change (relative)",
        1e-13,
        "rounding over the steps",
    );
    for top in Top::all(dt) {
        let is_unstable = top.name.contains("separatrix");
        let last = if is_unstable { 5.0 } else { 20.0 };
        let every = (0.5 / dt).round() as u64;
        let frames = top.setup.run((last / dt).round() as u64, every);
        let error = |row: &&(f64, Vec3, Quat)| {
            let frame = frames.iter().find(|f| (f.time - row.0).abs() < 0.5 * dt);
            Top::error(&frame.expect("a frame").bodies[0], row)
        };
        let worst =
            top.rows.iter().filter(|row| row.0 <= last).map(|row| error(&row)).fold(0.0, f64::max);
        if is_unstable { &mut unstable } else { &mut follows }.absolute(&top.name, 0.0, worst);
        let [energy, momentum] = changes(&frames);
        keeps.absolute(format!("{}: energy", top.name), 0.0, energy);
        keeps.absolute(format!("{}: angular momentum", top.name), 0.0, momentum);
    }
    [follows, unstable, keeps]
}

/// Largest relative changes of rotational energy and angular momentum in a run.
fn changes(frames: &[Frame]) -> [f64; 2] {
    let (energy, momentum) =
        (frames[0].bodies[0].rotational(), frames[0].bodies[0].angular_momentum);
    let worst = |of: &dyn Fn(&Body) -> f64| {
        let larger = |a: f64, b: f64| if b > a || b.is_nan() { b } else { a };
        frames.iter().map(|frame| of(&frame.bodies[0])).fold(0.0, larger)
    };
    [
        worst(&|body| (body.rotational() / energy - 1.0).abs()),
        worst(&|body| (body.angular_momentum - momentum).norm() / momentum.norm()),
    ]
}

/// Long and flat bodies that spin for a long time about various axes.
fn long_spins(effort: Effort) -> [Case; 2] {
    let steps = effort.pick(20_000, 100_000);
    let mut energy = Case::new(
        MECHANICS,
        format!("needles, disks and tops that spin freely, {steps} steps"),
        "energy, largest change (relative)",
        1e-6,
        "what is asked for; a converged step of the midpoint rule conserves it to rounding",
    );
    let mut momentum = Case::new(
        MECHANICS,
        "the same",
        "angular momentum, largest change (relative)",
        1e-12,
        "rounding over the steps",
    );
    let bodies = [
        ("needle 100:1", [1.0, 0.01, 0.01]),
        ("needle 30:1", [1.0, 1.0 / 30.0, 1.0 / 30.0]),
        ("disk 1:100", [1.0, 1.0, 0.01]),
        ("3:2:1", [0.3, 0.2, 0.1]),
    ];
    let axes = [
        ("first axis, nearly", Vec3::new(1.0, 0.01, 0.002)),
        ("second axis, nearly", Vec3::new(1e-3, 1.0, 1e-3)),
        ("all axes", Vec3::new(0.6, 0.5, 0.62)),
    ];
    for (name, semi_axes) in bodies {
        for (about, axis) in axes {
            for turn in [0.003, 0.03, 0.1] {
                // The angular velocity is 1 rad/s.
                let grain = Grain::at("body", Vec3::zeros()).spinning(axis.normalize());
                let setup = alone(&ellipsoid(semi_axes), turn, grain);
                let [e, l] = changes(&setup.run(steps, 10));
                let what = format!("{name}, about {about}, omega dt = {turn}");
                energy.absolute(&what, 0.0, e);
                momentum.absolute(what, 0.0, l);
            }
        }
    }
    [energy, momentum]
}

/// Dzhanibekov's effect: a body that spins about its middle axis flips repeatedly.
fn flips(effort: Effort) -> Case {
    let mut case = Case::new(
        MECHANICS,
        "Dzhanibekov: a body 3:2:1 spins about its middle axis and flips",
        "time between flips: 2K(k)/rate by elliptic functions (relative)",
        effort.pick(1e-4, 1e-5),
        "second order in the step",
    );
    let dt = effort.pick(1e-2, 2.5e-3);
    for tilt in [1e-1, 1e-2, 1e-3] {
        // Moments of inertia of semi-axes 3, 2, 1, over mass/5: about x 5, y 10, z 13.
        let inertia = Vec3::new(5.0, 10.0, 13.0);
        let omega = Vec3::new(tilt, 1.0, 0.0);
        let grain = Grain::at("body", Vec3::zeros()).spinning(omega);
        let setup = alone(&ellipsoid([3.0, 2.0, 1.0]), dt, grain);
        let published = half_period(&inertia, &omega);
        let frames = setup.run((4.7 * published / dt) as u64, 1);
        let middle = |f: &Frame| (f.bodies[0].orientation.inverse() * f.bodies[0].spin).y;
        let mut crossings = Vec::new();
        for pair in frames.windows(2) {
            let (a, b) = (middle(&pair[0]), middle(&pair[1]));
            if a * b < 0.0 {
                crossings.push(pair[0].time + dt * a / (a - b));
            }
        }
        assert!(crossings.len() >= 3, "it flips");
        let flips = crossings.len() - 1;
        let own = (crossings[flips] - crossings[0]) / flips as f64;
        case.relative(format!("tilt {tilt:e}"), published, own);
    }
    case
}

/// Half the period of the angular velocity of a free body with moments a < b < c (Landau and Lifshitz 1, section 37).
pub(crate) fn half_period(inertia: &Vec3, omega: &Vec3) -> f64 {
    let [mut a, b, mut c] = [inertia.x, inertia.y, inertia.z];
    let twice_energy = inertia.component_mul(omega).dot(omega);
    let momentum_squared = inertia.component_mul(omega).norm_squared();
    if momentum_squared < twice_energy * b {
        std::mem::swap(&mut a, &mut c);
    }
    let (e, m) = (twice_energy, momentum_squared);
    let k_squared = (b - a) * (e * c - m) / ((c - b) * (m - e * a));
    let rate = ((c - b) * (m - e * a) / (a * b * c)).sqrt();
    2.0 * complete_elliptic(k_squared) / rate
}

/// The complete elliptic integral of the first kind K, of k², by the arithmetic-geometric mean.
fn complete_elliptic(k_squared: f64) -> f64 {
    let (mut a, mut g) = (1.0, (1.0 - k_squared).sqrt());
    for _ in 0..60 {
        (a, g) = (0.5 * (a + g), (a * g).sqrt());
    }
    std::f64::consts::FRAC_PI_2 / a
}
