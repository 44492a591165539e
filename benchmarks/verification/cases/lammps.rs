//! Analytic models of the tests of LAMMPS' granular styles (`unittest/granular`, since 4Jul2026), with the springs of
//! this program. The formulas are those of LAMMPS; balls and speeds are chosen here.

use super::mfix::{Slip, Stack, apexes};
use super::{Ball, Case, Effort, Findings, Throw, Ways};
use dem_mpi::math::Vec3;

const SOURCE: &str = "LAMMPS unittest/granular (pull requests 5007, 5008, 5110, 5113)";
const G: f64 = 9.81;

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut ways = Ways::new(SOURCE);
    let mut cases = vec![bounce_height(effort), stack_energy(effort)];
    cases.push(slip_cessation());
    cases.extend(impacts(effort, &mut ways));
    cases.push(energy_guard(effort, &mut ways));
    cases.push(restitution(effort, &mut ways));
    cases.extend(ways.into_cases());
    Findings { cases, ..Findings::default() }
}

/// A glass bead, so stiff that its overlap is negligible.
fn bead() -> Ball {
    Ball {
        radius: 5e-3,
        density: 2500.0,
        normal: 1e9,
        tangential: 8e8,
        friction: 0.3,
        restitution: 1.0,
        pulls: false,
    }
}

fn bounce_height(effort: Effort) -> Case {
    let mut case = Case::new(
        SOURCE,
        "bounce_height",
        "height of the first bounce: r + e^2 (h0 - r) (relative)",
        8e-3,
        "of hard spheres; dashpot of first order, 400 steps per contact",
    );
    for restitution in effort.pick(vec![0.5, 1.0], vec![0.3, 0.5, 0.7, 0.9, 1.0]) {
        let ball = Ball { restitution, normal: 1e7, ..bead() };
        let (fall, dt) = (0.05, ball.contact_time() / 400.0);
        let mut setup = ball.over_floor(fall, Vec3::zeros(), Vec3::zeros(), dt);
        setup.gravity = Vec3::new(0.0, 0.0, -G);
        let found = apexes(&setup, (2.0 * fall / G).sqrt() + 3.0 * ball.contact_time());
        let published = ball.radius + restitution * restitution * fall;
        case.relative(format!("e = {restitution}"), published, found[0]);
    }
    case
}

fn stack_energy(effort: Effort) -> Case {
    let mut case = Case::new(
        SOURCE,
        "stack_energy",
        "energy of two compressed balls, largest change over the elastic energy at first",
        1e-3,
        "of order two: 200 steps per contact time",
    );
    let stack = Stack::new(1.0, 200.0);
    let frames = stack.setup().run(effort.pick(2000, 200_000), 7);
    let elastic = 0.5 * 1e3 * (2.0 * 5e-5f64.powi(2) + 1e-4f64.powi(2));
    let begin = stack.energy(&frames[0]);
    let change = frames.iter().map(|f| (stack.energy(f) - begin).abs() / elastic);
    case.absolute(format!("{} steps", effort.pick(2000, 200_000)), 0.0, change.fold(0.0, f64::max));
    case
}

fn slip_cessation() -> Case {
    let mut case = Case::new(
        SOURCE,
        "slip_cessation",
        "velocity when sliding ends: 5/7 of the first (relative)",
        1e-3,
        "mean over oscillations of the tangential spring",
    );
    for friction in [0.1, 0.5] {
        let ball = Ball { friction, normal: 1e6, tangential: 1e6, ..bead() };
        let dt = ball.contact_time() / 60.0;
        let slip = Slip::of(&ball, 0.1, dt);
        case.relative(format!("friction {friction}"), 5.0 / 7.0, slip.velocity / 0.1);
    }
    case
}

fn impacts(effort: Effort, ways: &mut Ways) -> [Case; 3] {
    let reason = "400 steps per contact; the lever arm is shorter by half the overlap (1e-4)";
    let mut oblique = Case::new(
        SOURCE,
        "oblique_impact",
        "v_x' = v_x - mu (1+e) v_z, omega = 5/2 mu (1+e) v_z/r (relative)",
        1e-3,
        reason,
    );
    let mut spin = Case::new(
        SOURCE,
        "spin_impact",
        "v_x' = mu (1+e) v_n, omega' = omega0 - 5/2 mu (1+e) v_n/r (relative)",
        1e-3,
        reason,
    );
    let mut none = Case::new(
        SOURCE,
        "spin_no_friction",
        "omega' = omega0 (relative)",
        1e-15,
        "nothing turns it: rounding of the moment of inertia",
    );
    // The force of a dashpot acts at touch, but the tangential spring must first be stretched: a stiff one is
    // stretched soon.
    let rough = |restitution| Ball { restitution, tangential: 1e10, ..bead() };
    for restitution in effort.pick(vec![0.6, 1.0], vec![0.4, 0.6, 0.8, 1.0]) {
        let ball = rough(restitution);
        let (mu, r) = (ball.friction, ball.radius);
        // All angles are beyond the critical angle, atan(7/2 mu (1+e)).
        for degrees in [67.0, 75.0, 85.0] {
            let throw = Throw::oblique(2.0, degrees, 400.0);
            let (v_x, v_z) = (throw.velocity.x, -throw.velocity.z);
            let what = format!("e = {restitution}, {degrees} degrees");
            let found = ball.impact(&throw, ways, &format!("oblique_impact, {what}"));
            let kick = mu * (1.0 + restitution) * v_z;
            oblique.relative(format!("{what}: velocity"), v_x - kick, found.velocity.x);
            oblique.relative(format!("{what}: spin"), 2.5 * kick / r, found.spin.y);
        }
        let (v, omega) = (1.0, 2000.0);
        let throw = Throw {
            velocity: Vec3::new(0.0, 0.0, -v),
            spin: Vec3::y() * omega,
            steps_per_contact: 400.0,
        };
        let what = format!("e = {restitution}");
        let found = ball.impact(&throw, ways, &format!("spin_impact, {what}"));
        let kick = mu * (1.0 + restitution) * v;
        // With spin about +y the lowest point moves to -x: friction drives the ball to +x.
        spin.relative(format!("{what}: velocity"), kick, found.velocity.x);
        spin.relative(format!("{what}: spin"), omega - 2.5 * kick / r, found.spin.y);
        // Without friction spheres keep no spin; an ellipsoid of equal axes does.
        let ellipsoid = spinning_ellipsoid(restitution, omega);
        none.relative(what, omega, ellipsoid);
    }
    [oblique, spin, none]
}

/// Spin after an impact without friction of a ball that is defined as an ellipsoid.
fn spinning_ellipsoid(restitution: f64, omega: f64) -> f64 {
    let ball = Ball { restitution, friction: 0.0, ..bead() };
    let dt = ball.contact_time() / 400.0;
    let mut setup = ball.over_floor(0.4 * dt, -Vec3::z(), Vec3::y() * omega, dt);
    let r = ball.radius;
    let sphere = format!("kind = \"sphere\"\nradius = {r:e}");
    setup.text = setup
        .text
        .replace(&sphere, &format!("kind = \"ellipsoid\"\nsemi_axes = [{r:e}, {r:e}, {r:e}]"));
    let end = setup.after(1.2 * ball.contact_time());
    end.bodies[0].spin.y
}

/// A grazing impact with strong friction, in which LAMMPS had gained up to 34 % of energy at a wall (pull request
/// 5007).
fn energy_guard(effort: Effort, ways: &mut Ways) -> Case {
    let mut case = Case::new(
        SOURCE,
        "energy guard at grazing angles, friction 0.5",
        "kinetic energy gained, at most on the way (relative)",
        1e-6,
        "nothing may be gained but the error of a step when the contact ends (order two)",
    );
    for degrees in effort.pick(vec![76.0], vec![60.0, 70.0, 74.0, 76.0, 78.0, 85.0, 89.0]) {
        for restitution in [0.5, 1.0] {
            let ball = Ball { friction: 0.5, restitution, ..bead() };
            let throw = Throw::oblique(2.0, degrees, 400.0);
            let what = format!("{degrees} degrees, e = {restitution}");
            let found = ball.impact(&throw, ways, &format!("energy guard, {what}"));
            let gained = found.energy.max(found.most_energy) - 1.0;
            case.absolute(what, 0.0, gained.max(0.0));
        }
    }
    case
}

fn restitution(effort: Effort, ways: &mut Ways) -> Case {
    let mut case = Case::new(
        SOURCE,
        "collision_restitution",
        "coefficient of restitution of a normal impact (relative)",
        1e-2,
        "dashpot of first order, 400 steps per contact",
    );
    for restitution in effort.pick(vec![0.2, 0.9], vec![0.2, 0.5, 0.8, 0.9, 1.0]) {
        for pulls in [false, true] {
            let ball = Ball { restitution, pulls, ..bead() };
            let throw = Throw::oblique(1.0, 0.0, 400.0);
            let how = if pulls { "dashpot pulls" } else { "dashpot does not pull" };
            let what = format!("e = {restitution}, {how}");
            let found = ball.impact(&throw, ways, &format!("restitution, {what}"));
            case.relative(what, restitution, found.velocity.z);
        }
    }
    case
}
