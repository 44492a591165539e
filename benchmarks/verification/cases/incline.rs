//! Bodies on a plane: rolling and sliding after Coulomb, a block, and an ellipsoid that rocks (independent reference
//! of 2026-11).

use super::{Ball, Case, Effort, Findings, Frame, Grain, Plane, Setup, parse_reference};
use dem_mpi::math::{Quat, Vec3};
use serde_json::Value;
use std::f64::consts::PI;

const COULOMB: &str = "closed form (Coulomb; Landau and Lifshitz 1)";
const ROCKING: &str = "independent reference, closed form (dem_rocking.json)";
const G: f64 = 9.81;

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut cases = vec![rolling(effort), critical_angle(effort)];
    cases.extend(block(effort));
    cases.push(rocking());
    Findings { cases, ..Findings::default() }
}

/// Gravity relative to a floor with this tilt [rad]: +x is down the slope.
fn tilted(angle: f64) -> Vec3 {
    Vec3::new(G * angle.sin(), 0.0, -G * angle.cos())
}

/// The acceleration of a ball from rest [m/s²], from x = a t²/2.
fn acceleration(ball: &Ball, degrees: f64, time: f64) -> f64 {
    let angle = degrees.to_radians();
    let overlap = ball.mass() * G * angle.cos() / ball.normal;
    let dt = ball.contact_time() / 60.0;
    let mut setup = ball.over_floor(-overlap, Vec3::zeros(), Vec3::zeros(), dt);
    setup.gravity = tilted(angle);
    let end = setup.after(time);
    2.0 * end.bodies[0].position.x / (end.time * end.time)
}

fn small_ball(friction: f64) -> Ball {
    Ball {
        radius: 0.01,
        density: 2650.0,
        normal: 1e5,
        tangential: 1e5,
        friction,
        restitution: 1.0,
        pulls: false,
    }
}

fn rolling(effort: Effort) -> Case {
    let mut case = Case::new(
        COULOMB,
        "ball from rest on an incline",
        "acceleration: 5/7 g sin where it rolls, g (sin - mu cos) where it slides (relative)",
        1e-3,
        "the tangential spring is stretched first, and rings",
    );
    let time = effort.pick(0.2, 0.5);
    for (degrees, friction) in
        [(5.0, 0.3), (20.0, 0.3), (30.0, 0.5), (40.0, 0.1), (30.0, 0.1), (20.0, 0.05)]
    {
        let angle: f64 = f64::to_radians(degrees);
        let slides = angle.tan() > 3.5 * friction;
        let published = if slides {
            G * (angle.sin() - friction * angle.cos())
        } else {
            5.0 / 7.0 * G * angle.sin()
        };
        let what = format!(
            "{degrees} degrees, friction {friction}: {}",
            if slides { "slides" } else { "rolls" }
        );
        case.relative(what, published, acceleration(&small_ball(friction), degrees, time));
    }
    case
}

fn critical_angle(effort: Effort) -> Case {
    let mut case = Case::new(
        COULOMB,
        "ball on an incline: where rolling turns to sliding",
        "tangent of the angle over friction: 7/2 (relative)",
        effort.pick(2e-2, 5e-3),
        "bisected to this; the angle at which it accelerates by 0.05 % more than a rolling ball",
    );
    let friction = 0.2;
    let ball = small_ball(friction);
    let (mut low, mut high): (f64, f64) = (0.6, 0.8);
    while high - low > effort.pick(1e-2, 2e-3) {
        let tangent = 0.5 * (low + high);
        let angle = tangent.atan();
        let found = acceleration(&ball, angle.to_degrees(), 0.1);
        if found > 1.0005 * 5.0 / 7.0 * G * angle.sin() { high = tangent } else { low = tangent }
    }
    case.relative("friction 0.2", 3.5, 0.5 * (low + high) / friction);
    case
}

/// A block of 2 cm by 2 cm on a floor.
struct Block {
    /// Height over width.
    slender: f64,
    friction: f64,
    degrees: f64,
    /// Angular velocity about the normal of the floor [rad/s].
    spin: f64,
}

impl Block {
    /// Half the width [m].
    const HALF: f64 = 0.01;
    /// Normal stiffness [N/m].
    const STIFFNESS: f64 = 1e6;

    fn run(&self, time: f64) -> Vec<Frame> {
        let (half, density, stiffness) = (Self::HALF, 2650.0, Self::STIFFNESS);
        let tall = half * self.slender;
        let angle = self.degrees.to_radians();
        let mass = density * 8.0 * half * half * tall;
        let overlap = mass * G * angle.cos() / stiffness;
        let corner = |k: i32| {
            let side = |bit: i32, half: f64| if k >> bit & 1 == 1 { half } else { -half };
            format!("[{:e}, {:e}, {:e}]", side(0, half), side(1, half), side(2, tall))
        };
        let corners: Vec<String> = (0..8).map(corner).collect();
        // The program rotates a polyhedron into its principal axes; those of a block are not exchanged.
        let setup = Setup {
            gravity: tilted(angle),
            text: format!(
                "[[material]]\nname = \"m\"\ndensity = {density}\nnormal_stiffness = {stiffness:e}\nfriction = {}\n\
                 restitution = 0.5\ntangential_damping_ratio = 0.2\n\
                 [[shape]]\nname = \"block\"\nkind = \"polyhedron\"\nvertices = [{}]",
                self.friction,
                corners.join(", ")
            ),
            planes: vec![Plane::floor("m")],
            grains: vec![
                Grain::at("block", Vec3::z() * (tall - overlap)).spinning(Vec3::z() * self.spin),
            ],
            dt: 5e-6,
        };
        setup.run((time / setup.dt) as u64, 200)
    }
}

fn block(effort: Effort) -> [Case; 4] {
    let time = effort.pick(0.2, 0.5);
    let mut rests = Case::new(
        COULOMB,
        "block on an incline below atan mu: it rests",
        "velocity in the second half of the time (m/s); turned (rad), against the elastic tilt of its face",
        1e-6,
        "it comes to rest: rounding",
    );
    for (degrees, friction) in [(0.0, 0.5), (10.0, 0.5), (20.0, 0.5), (26.0, 0.5), (15.0, 0.3)] {
        let frames = Block { slender: 1.0, friction, degrees, spin: 0.0 }.run(time);
        let (half, last) = (&frames[frames.len() / 2], &frames[frames.len() - 1]);
        let moved = (last.bodies[0].position - half.bodies[0].position).norm();
        let what = format!("{degrees} degrees, friction {friction}");
        rests.absolute(format!("{what}: velocity"), 0.0, moved / (last.time - half.time));
        // The moment of the weight about the face tilts the block elastically: a face of width L has the tilting
        // stiffness k L²/4.
        let weight = last.bodies[0].mass * G * f64::to_radians(degrees).sin();
        let tilt = weight * Block::HALF / (Block::STIFFNESS * Block::HALF * Block::HALF);
        rests.absolute(format!("{what}: turned"), tilt, last.bodies[0].orientation.angle());
    }

    let mut slides = Case::new(
        COULOMB,
        "block on an incline beyond atan mu: it slides",
        "acceleration: g (sin - mu cos) (m/s2, over mu g cos)",
        1e-3,
        "mean over the second half of the time: it rings at first",
    );
    for (degrees, friction) in [(27.0, 0.5), (30.0, 0.5), (30.0, 0.3), (20.0, 0.1)] {
        let frames = Block { slender: 1.0, friction, degrees, spin: 0.0 }.run(time);
        let (half, last) = (&frames[frames.len() / 2], &frames[frames.len() - 1]);
        let gained = last.bodies[0].velocity.x - half.bodies[0].velocity.x;
        let angle: f64 = f64::to_radians(degrees);
        let published = G * (angle.sin() - friction * angle.cos());
        let what = format!("{degrees} degrees, friction {friction}");
        let own = gained / (last.time - half.time);
        slides.over(friction * G * angle.cos(), what, published, own);
    }

    let mut topples = Case::new(
        COULOMB,
        "slender block on a rough incline: it topples beyond atan(width/height)",
        "tangent of the angle over width/height: does it topple? (0 no, 1 yes)",
        0.0,
        "well below and beyond",
    );
    for (slender, part, published) in
        [(2.0, 0.5, 0.0), (2.0, 0.9, 0.0), (2.0, 1.1, 1.0), (3.0, 0.9, 0.0), (3.0, 1.1, 1.0)]
    {
        let degrees = f64::to_degrees(f64::atan(part / slender));
        let frames =
            Block { slender, friction: 1.0, degrees, spin: 0.0 }.run(effort.pick(0.3, 0.5));
        let turned = frames[frames.len() - 1].bodies[0].orientation.angle();
        let what = format!("height {slender}, {part} of the angle's tangent");
        topples.absolute(what, published, f64::from(turned > 0.1));
    }

    let mut spins = Case::new(
        COULOMB,
        "block that spins on its face",
        "spin when friction has stopped it, over that at the start",
        1e-2,
        "even pressure: it stops after width * omega/(6 * 0.3826 mu g)",
    );
    for friction in [0.1, 0.5] {
        let spin = 5.0;
        let stop = 0.02 * spin / (6.0 * 0.3826 * friction * G);
        let frames = Block { slender: 1.0, friction, degrees: 0.0, spin }.run(1.05 * stop);
        spins.over(
            spin,
            format!("friction {friction}"),
            0.0,
            frames[frames.len() - 1].bodies[0].spin.norm(),
        );
    }
    [rests, slides, topples, spins]
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("a number, not {value}"))
}

fn rocking() -> Case {
    let mut case = Case::new(
        ROCKING,
        "ellipsoid rocking on a plane, smooth and rough",
        "period of small rocking (relative)",
        1e-3,
        "tilt of 1e-3 rad; the reference is of small angles",
    );
    let reference = parse_reference("dem_rocking.json");
    let all = reference["cases"].as_array().expect("cases");
    for body in all {
        let inputs = &body["inputs"];
        let axis = |k: usize| number(&inputs["semi_axes"][k]);
        let [a, b, c] = [axis(0), axis(1), axis(2)];
        for (key, about, swing) in
            [("about_y_(axis_a_swings)", Vec3::y(), a), ("about_x_(axis_b_swings)", Vec3::x(), b)]
        {
            let expected = &body[key];
            let smooth = number(&expected["smooth_omega"]);
            if smooth == 0.0 {
                continue; // a circular section: nothing drives it back
            }
            let rough = &expected["tangential_spring_omegas_arm_c_minus_half_overlap"][0];
            for (friction, omega) in [(0.0, smooth), (1e6, number(rough))] {
                let tilt: f64 = 1e-3;
                let height = (swing * tilt.sin()).hypot(c * tilt.cos());
                let place = Vec3::new(0.0, 0.0, height - number(&body["static_overlap"]));
                let setup = Setup {
                    gravity: tilted(0.0),
                    text: format!(
                        "[[material]]\nname = \"m\"\ndensity = {:e}\nnormal_stiffness = {:e}\ntangential_stiffness = {:e}\nfriction = {friction}\n\
                         [[shape]]\nname = \"egg\"\nkind = \"ellipsoid\"\nsemi_axes = [{a:e}, {b:e}, {c:e}]",
                        number(&inputs["density"]),
                        number(&inputs["kn"]),
                        number(&inputs["kt"])
                    ),
                    planes: vec![Plane::floor("m")],
                    grains: vec![Grain::at("egg", place).turned(Quat::new(about * tilt))],
                    dt: 1e-5,
                };
                let published = 2.0 * PI / omega;
                let steps = (3.5 * published / setup.dt) as u64;
                let angle = |f: &Frame| 2.0 * f.bodies[0].orientation.imag().dot(&about);
                let frames = setup.run(steps, 1);
                let mut crossings = Vec::new();
                for pair in frames.windows(2) {
                    let (before, now) = (angle(&pair[0]), angle(&pair[1]));
                    if before < 0.0 && now >= 0.0 {
                        crossings.push(pair[0].time + setup.dt * before / (before - now));
                    }
                }
                let periods = crossings.len() - 1;
                let own = (crossings[periods] - crossings[0]) / periods as f64;
                let how = if friction == 0.0 { "smooth" } else { "rough" };
                case.relative(
                    format!("semi-axes {a}, {b}, {c} m, {how}, about {}", &key[6..7]),
                    published,
                    own,
                );
            }
        }
    }
    case
}
