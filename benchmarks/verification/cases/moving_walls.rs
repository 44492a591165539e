//! Rotating walls and walls of triangles against closed forms: a ball on a turntable, a ball held by two tables that rotate
//! together, a ball in a cylinder.

use super::{Ball, Case, Effort, Findings, Frame, Grain, Setup, least_squares};
use dem_mpi::math::Vec3;
use std::f64::consts::TAU;
use std::fmt::Write;

const GRAVITY: f64 = 9.81;

const BALL: Ball = Ball {
    radius: 0.01,
    density: 2500.0,
    normal: 1e5,
    tangential: 5e4,
    friction: 0.8,
    restitution: 0.3,
    pulls: true,
};

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let cases = vec![turntable(effort), held(effort), cylinder(effort)];
    Findings { cases, ..Findings::default() }
}

/// A plane that rotates about z.
fn table(name: &str, height: f64, up: f64, rate: f64) -> String {
    format!(
        "[[wall]]\nname = \"{name}\"\npoint = [0, 0, {height:e}]\nnormal = [0, 0, {up}]\nmaterial = \"m\"\n\
         rotation = {{ about = [0, 0, 0], axis = [0, 0, 1], rate = {rate:e} }}\n"
    )
}

/// A ball that rolls on a turntable moves in a circle at two sevenths of the table's rate, from any initial state (Weltner
/// 1979, American Journal of Physics 47, 984): `I / (I + m a²)`, with `a` the height of its centre above the middle of the
/// overlap.
fn turntable(effort: Effort) -> Case {
    let mut case = Case::new(
        "closed form",
        "ball rolling on a turntable",
        "angular velocity of its way, over that of the table",
        1e-6,
        "springs stretch a little",
    );
    let rate = 5.0;
    let pressed = BALL.mass() * GRAVITY / BALL.normal;
    let arm = BALL.radius - 0.5 * pressed;
    let expected = 0.4 / (0.4 + (arm / BALL.radius).powi(2));
    let dt = effort.pick(2e-5, 5e-6);
    for speed in [0.05, 0.2] {
        let place = Vec3::new(0.1, 0.0, BALL.radius - pressed);
        let velocity = Vec3::new(0.0, speed, 0.0);
        let below = Vec3::z().cross(&place) * rate;
        let spin = Vec3::z().cross(&(velocity - below)) / arm;
        let setup = Setup {
            gravity: -Vec3::z() * GRAVITY,
            text: format!("{}\n{}", BALL.text(), table("table", 0.0, 1.0, rate)),
            planes: Vec::new(),
            grains: vec![Grain::at("ball", place).moving(velocity).spinning(spin)],
            dt,
        };
        let steps = (2.0 / dt) as u64;
        let mut angle = 0.0;
        let mut last = 0.0;
        let angles = setup.run(steps, steps / 400).into_iter().map(|frame| {
            let v = frame.bodies[0].velocity;
            let now = v.y.atan2(v.x);
            angle += (now - last + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
            last = now;
            (frame.time, angle)
        });
        let (_, slope, _) = least_squares(&angles.collect::<Vec<_>>());
        case.relative(format!("thrown with {speed} m/s"), expected, slope / rate);
    }
    case
}

/// A ball held between two tables that rotate together moves with them. Friction provides the force towards the axis, and
/// there is no force along the path. A spring that did not rotate with its wall would exert one.
fn held(effort: Effort) -> Case {
    let mut case = Case::new(
        "closed form",
        "ball held between two tables that turn",
        "friction towards the axis, and angle behind the tables, over that force and 1 rad",
        1e-6,
        "what is left of the beginning after the dashpots",
    );
    let (side, rate, gap) = (0.05, 20.0, 1e-4);
    let dt = effort.pick(1e-5, 2e-6);
    let spread = BALL.radius - gap;
    let text = BALL.text().replace("restitution", "tangential_damping_ratio = 0.2\nrestitution");
    // Elongation with both springs acting.
    let hold = BALL.mass() * rate * rate / (2.0 * BALL.tangential);
    let setup = Setup {
        gravity: Vec3::zeros(),
        text: format!(
            "{text}\n{}{}",
            table("low", -spread, 1.0, rate),
            table("high", spread, -1.0, rate)
        ),
        planes: Vec::new(),
        grains: vec![
            Grain::at("ball", Vec3::x() * side)
                .moving(Vec3::y() * rate * side)
                .spinning(Vec3::z() * rate),
        ],
        dt,
    };
    let steps = (0.5 / dt) as u64;
    let frame: Frame = setup.run(steps, steps).pop().expect("an end");
    let position = frame.bodies[0].position;
    let (x, y) = (position.x, position.y);
    let out = x.hypot(y);
    let stretch = side / (1.0 - hold) - side;
    case.relative("force", 2.0 * BALL.tangential * stretch, 2.0 * BALL.tangential * (out - side));
    let ahead = (y.atan2(x) - rate * frame.time + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
    case.absolute("angle", 0.0, ahead);
    case
}

/// A ball that oscillates in a cylinder of triangles, with and without friction.
fn cylinder(effort: Effort) -> Case {
    let strips = effort.pick(1152, 2304);
    let mut case = Case::new(
        "closed form",
        "ball that swings in a cylinder of triangles",
        "period [s]",
        3e-4,
        format!("the cylinder has {strips} flat strips"),
    );
    let radius = 0.05;
    let folder = tempfile::tempdir().expect("a folder for the surface");
    let file = folder.path().join("cylinder.obj");
    std::fs::write(&file, cylinder_of(strips, radius)).expect("the surface");
    let (apart, swing) = (radius - BALL.radius, 0.2_f64);
    let pendulum = TAU
        * (apart / GRAVITY).sqrt()
        * (1.0 + swing.powi(2) / 16.0 + 11.0 * swing.powi(4) / 3072.0);
    for (what, friction, inertia) in [("slides", 0.0, 1.0), ("rolls", 0.8, 1.4)] {
        let ball = Ball { friction, restitution: 1.0, ..BALL };
        let wall = format!(
            "[[wall]]\nname = \"cylinder\"\nmesh = \"{}\"\nmaterial = \"m\"\n",
            file.display()
        );
        let dt = effort.pick(1e-5, 5e-6);
        let place = Vec3::new(swing.sin(), 0.0, -swing.cos()) * apart;
        let setup = Setup {
            gravity: -Vec3::z() * GRAVITY,
            text: format!("{}\n{wall}", ball.text()),
            planes: Vec::new(),
            grains: vec![Grain::at("ball", place)],
            dt,
        };
        let expected = pendulum * f64::sqrt(inertia);
        let frames = setup.run((2.2 * expected / dt) as u64, 1);
        let passes: Vec<f64> = (frames.windows(2))
            .filter_map(|pair| {
                let [a, b] = [0, 1].map(|k| (pair[k].time, pair[k].bodies[0].position.x));
                (a.1 > 0.0 && b.1 <= 0.0).then(|| a.0 + (b.0 - a.0) * a.1 / (a.1 - b.1))
            })
            .collect();
        case.relative(what, expected, passes[1] - passes[0]);
    }
    case
}

/// A cylinder about y as OBJ; its section has the area of the circle.
fn cylinder_of(strips: u32, radius: f64) -> String {
    let turn = TAU / f64::from(strips);
    let wide = radius * (turn / turn.sin()).sqrt();
    let mut text = String::new();
    for k in 0..strips {
        let (s, c) = (f64::from(k) * turn).sin_cos();
        for y in [-0.02, 0.02] {
            writeln!(text, "v {} {y} {}", wide * s, -wide * c).expect("text");
        }
    }
    for k in 0..strips {
        let [a, b] = [2 * k + 1, 2 * ((k + 1) % strips) + 1];
        writeln!(text, "f {a} {b} {}\nf {a} {} {}", b + 1, b + 1, a + 1).expect("text");
    }
    text
}
