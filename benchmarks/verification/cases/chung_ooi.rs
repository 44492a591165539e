//! Chung and Ooi 2011, DOI 10.1007/s10035-011-0277-0: the tests that do not depend on the normal law. Numbers read off
//! the paper's curves are those of Kratos (`applications/DEMApplication/tests`).
//!
//! The springs are linear; their stiffness gives the largest overlap of test 3 that Hertz' law has.

use super::{Ball, Case, Effort, Findings, Grain, Setup, Throw, Ways};
use dem_mpi::math::Vec3;

const SOURCE: &str = "Chung and Ooi 2011, 10.1007/s10035-011-0277-0";

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut ways = Ways::new(SOURCE);
    let mut cases = vec![restitution(effort, &mut ways)];
    cases.extend(oblique(effort, &mut ways));
    cases.extend(opposite_spins(effort, &mut ways));
    cases.push(unequal(effort, &mut ways));
    cases.extend(ways.into_cases());
    Findings { cases, ..Findings::default() }
}

/// The ball of test 3, with a linear spring that has the overlap of Hertz [m] at 3.9 m/s.
fn ball_of_test_3(density: f64, overlap: f64) -> Ball {
    let ball = Ball {
        radius: 2.5e-3,
        density,
        normal: 1.0,
        tangential: 1.0,
        friction: 0.0,
        restitution: 1.0,
        pulls: false,
    };
    let normal = ball.mass() * (3.9 / overlap).powi(2);
    Ball { normal, tangential: normal, ..ball }
}

fn restitution(effort: Effort, ways: &mut Ways) -> Case {
    let mut case = Case::new(
        SOURCE,
        "test 3: normal impact on a rigid plane at 3.9 m/s",
        "coefficient of restitution recovered (relative)",
        1e-2,
        "dashpot of first order, 400 steps per contact",
    );
    for (name, density, overlap) in
        [("aluminium oxide", 4000.0, 8.089e-6), ("cast iron", 7000.0, 17.189e-6)]
    {
        for e in effort.pick(vec![0.2, 1.0], vec![0.2, 0.4, 0.6, 0.8, 1.0]) {
            let ball = Ball { restitution: e, ..ball_of_test_3(density, overlap) };
            let throw = Throw::oblique(3.9, 0.0, 400.0);
            let what = format!("{name}, e = {e}");
            let found = ball.impact(&throw, ways, &format!("test 3, {what}"));
            case.relative(what, e, found.velocity.z / 3.9);
        }
    }
    case
}

/// Angle [degrees]; ratio of the tangential velocities after and before, angular velocity [rad/s] and rebound of the
/// contact point [degrees] of the paper, read off its curves for aluminium oxide.
const TEST_4: [[f64; 4]; 6] = [
    [35.0, 0.737, 582.3, 3.43],
    [40.0, 0.781, 544.8, 11.57],
    [50.0, 0.845, 457.0, 29.35],
    [60.0, 0.893, 357.5, 47.79],
    [70.0, 0.932, 246.2, 64.58],
    [80.0, 0.966, 126.3, 78.70],
];

fn oblique(effort: Effort, ways: &mut Ways) -> [Case; 2] {
    let (mu, e, v) = (0.092, 0.98, 3.9);
    let mut exact = Case::new(
        SOURCE,
        "test 4: oblique impact beyond the critical angle, 32.5 degrees",
        "tangential velocity, spin, rebound of the contact point, exact for rigid bodies (relative to the most)",
        3e-3,
        "the lever arm is shorter by half the overlap (0.14 % of the spin), dashpot of first order",
    );
    let mut paper = Case::new(
        SOURCE,
        "test 4: the same, read off the paper",
        "mean difference over mean, as Kratos takes it (tangential velocity, spin, rebound)",
        2.5e-2,
        "what Kratos allows for reading off curves: 1.6, 2.2 and 2.5 %",
    );
    let ball = Ball { friction: mu, restitution: e, ..ball_of_test_3(4000.0, 8.089e-6) };
    let mut off = [0.0; 3];
    let mut of = [0.0; 3];
    for row in TEST_4 {
        let degrees = row[0];
        let angle = f64::to_radians(degrees);
        let throw = Throw::oblique(v, degrees, effort.pick(400.0, 1000.0));
        let found = ball.impact(&throw, ways, &format!("test 4, {degrees} degrees"));
        let point = found.velocity.x - found.spin.y * ball.radius;
        let found = [
            found.velocity.x / throw.velocity.x,
            found.spin.y,
            (point / found.velocity.z).atan().to_degrees(),
        ];
        let published = [
            1.0 - mu * (1.0 + e) / angle.tan(),
            2.5 * mu * (1.0 + e) * v * angle.cos() / ball.radius,
            ((angle.tan() - 3.5 * mu * (1.0 + e)) / e).atan().to_degrees(),
        ];
        let names = ["tangential velocity", "spin", "rebound"];
        let scales = [1.0, 581.95, 78.98];
        for k in 0..3 {
            let what = format!("{degrees} degrees: {}", names[k]);
            exact.over(scales[k], what, published[k], found[k]);
            off[k] += (row[k + 1] - found[k]).abs();
            of[k] += row[k + 1];
        }
    }
    for (k, name) in ["tangential velocity", "spin", "rebound"].into_iter().enumerate() {
        paper.absolute(name, 0.0, off[k] / of[k]);
    }
    [exact, paper]
}

fn opposite_spins(effort: Effort, ways: &mut Ways) -> [Case; 2] {
    let mut moves = Case::new(
        SOURCE,
        "test 7: two equal balls with opposite spins meet head-on",
        "tangential velocity after, over that of the surface before",
        1e-12,
        "nothing slides where they touch: zero but for rounding",
    );
    let mut turns = Case::new(
        SOURCE,
        "test 7: the same",
        "spin after (relative)",
        1e-12,
        "as before, but for rounding",
    );
    let ball = Ball {
        radius: 0.1,
        density: 2700.0,
        normal: 2e8,
        tangential: 1.6e8,
        friction: 0.4,
        restitution: 0.5,
        pulls: false,
    };
    for spin in effort.pick(vec![1.0, 20.0], vec![0.175, 1.0, 5.0, 10.0, 20.0]) {
        let dt = ball.contact_time() / 400.0;
        let place = Vec3::x() * (ball.radius + 0.2 * dt * 0.37);
        let setup = Setup {
            gravity: Vec3::zeros(),
            text: ball.text(),
            planes: Vec::new(),
            grains: vec![
                Grain::at("ball", -place).moving(Vec3::x() * 0.2).spinning(Vec3::z() * spin),
                Grain::at("ball", place).moving(-Vec3::x() * 0.2).spinning(-Vec3::z() * spin),
            ],
            dt,
        };
        let frames = ways.run(&format!("test 7, {spin} rad/s"), &setup, 450, 1);
        assert!(frames.iter().any(super::Frame::is_touching), "they meet");
        let end = &frames[frames.len() - 1];
        for (k, sign) in [1.0, -1.0].into_iter().enumerate() {
            let body = &end.bodies[k];
            let what = format!("{spin} rad/s, ball {k}");
            let surface = spin * ball.radius;
            moves.over(surface, &what, 0.0, body.velocity.y.hypot(body.velocity.z));
            turns.relative(what, sign * spin, body.spin.z);
        }
    }
    [moves, turns]
}

/// The sizes of test 8, in gross sliding: the impulse along the normal is m* (1+e) v, that of friction mu times as
/// large.
fn unequal(effort: Effort, ways: &mut Ways) -> Case {
    let mut case = Case::new(
        SOURCE,
        "two balls of different size meet obliquely and slide (sizes of test 8)",
        "velocities and spins after, exact for rigid bodies (over their greatest change)",
        1e-3,
        "the normal turns during the contact, and the overlap is not nothing",
    );
    let (mu, v) = (0.1, 0.2);
    for e in effort.pick(vec![1.0], vec![0.9, 1.0]) {
        let ball = Ball {
            radius: 0.1,
            density: 2700.0,
            normal: 1e12,
            tangential: 1e12,
            friction: mu,
            restitution: e,
            pulls: false,
        };
        let large = 0.5;
        let (m, big) = (ball.mass(), ball.mass() * f64::powi(large / ball.radius, 3));
        let reduced = m * big / (m + big);
        let dt = ball.contact_time() / 400.0;
        let along = Vec3::new(v, 2.0 * v, 0.0);
        let place = Vec3::x() * -(ball.radius + large + v * dt * 0.37);
        let shape = format!("\n[[shape]]\nname = \"large\"\nkind = \"sphere\"\nradius = {large}");
        let setup = Setup {
            gravity: Vec3::zeros(),
            text: ball.text() + &shape,
            planes: Vec::new(),
            grains: vec![Grain::at("ball", place).moving(along), Grain::at("large", Vec3::zeros())],
            dt,
        };
        let frames = ways.run(&format!("unequal balls, e = {e}"), &setup, 500, 1);
        let end = &frames[frames.len() - 1].bodies;
        assert!(frames.iter().any(super::Frame::is_touching) && end[0].contacts == 0, "they meet");
        let impulse = Vec3::new(1.0, mu, 0.0) * (reduced * (1.0 + e) * v);
        let velocities = [along - impulse / m, impulse / big];
        for k in 0..2 {
            let (mass, radius) = [(m, ball.radius), (big, large)][k];
            let spin = -Vec3::z() * (mu * impulse.x * radius / (0.4 * mass * radius * radius));
            let (what, speed) = (format!("e = {e}, ball {k}"), impulse.norm() / mass);
            case.over(
                speed,
                format!("{what}: velocity"),
                0.0,
                (end[k].velocity - velocities[k]).norm(),
            );
            case.over(spin.norm(), format!("{what}: spin"), 0.0, (end[k].spin - spin).norm());
        }
    }
    case
}
