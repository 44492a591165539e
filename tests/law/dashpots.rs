//! Dashpots with `foresee` are of second order in the step. Tests compare rebounds with closed forms at 25 to 200 steps a contact. They use the mean
//! and the worst of 16 phases of the first touch within its step.

use super::touch_and_end::{Impact, RADIUS, SPEED, STIFFNESS, mass, text};
use crate::support::{Bench, OnRanks, scene};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::particles::records::Particle;
use std::f64::consts::PI;

/// A law with a material, and the duration of an elastic contact [s].
struct Balls {
    law: String,
    material: String,
    duration: f64,
}

impl Balls {
    fn linear() -> Self {
        Self {
            law: "[law]\nforesee = true\n".to_owned(),
            material: format!("normal_stiffness = {STIFFNESS}\nfriction = 0.1"),
            duration: PI * (mass() / STIFFNESS).sqrt(),
        }
    }

    fn hertz() -> Self {
        let (youngs, poisson) = (1e8, 0.3);
        // The floor is of the same material.
        let modulus = 0.5 * youngs / (1.0 - poisson * poisson);
        let stiffness = 4.0 / 3.0 * modulus * RADIUS.sqrt();
        let largest = (1.25 * mass() * SPEED * SPEED / stiffness).powf(0.4);
        Self {
            law: "[law]\nnormal = \"hertz\"\nlargest_overlap = 0.1\nforesee = true\n".to_owned(),
            material: format!(
                "youngs_modulus = {youngs}\npoisson_ratio = {poisson}\nfriction = 0.1"
            ),
            duration: 2.943_275 * largest / SPEED,
        }
    }

    /// A ball that falls on the floor, with more lines of law and material.
    fn falls(&self, law: &str, material: &str) -> Impact {
        let shape = format!("kind = \"sphere\"\nradius = {RADIUS}");
        let (law, material) =
            (format!("{}{law}", self.law), format!("{}\n{material}", self.material));
        Impact {
            text: text(&law, &shape, &material),
            height: RADIUS,
            velocity: Vec3::z() * -SPEED,
            spin: Vec3::zeros(),
            inertia: 0.4 * mass() * RADIUS * RADIUS,
            duration: self.duration,
        }
    }
}

/// Mean errors at 25 to 200 steps a contact, and their order in the step.
fn errors(impact: &Impact, right: f64, read: impl Fn(&Vec3, &Vec3) -> f64) -> ([f64; 4], f64) {
    let errors = [25.0, 50.0, 100.0, 200.0].map(|steps| impact.mean(steps, &read) - right);
    (errors, (errors[0] / errors[3]).abs().log2() / 3.0)
}

/// Contacts end where the force falls to zero, or with `limit_damping = false` where the overlap does. In both cases the restitution is the requested
/// one.
#[test]
fn a_ball_leaves_with_its_restitution() {
    for (balls, name) in [(Balls::linear(), "linear"), (Balls::hertz(), "hertz")] {
        for (restitution, most) in [(0.2, 2e-3), (0.5, 1e-3), (0.9, 3e-4)] {
            let material = format!("restitution = {restitution}");
            let of_speed = |v: &Vec3, _: &Vec3| v.z / SPEED;
            let falls = balls.falls("", &material);
            let (found, order) = errors(&falls, restitution, of_speed);
            println!("{name} e = {restitution}: {found:?}, order {order:.2}");
            let worst = [25.0, 100.0].map(|steps| {
                let off = falls.of_phases(steps, of_speed).into_iter();
                off.map(|speed| (speed - restitution).abs()).fold(0.0, f64::max)
            });
            println!("{name} e = {restitution}, worst phase: {worst:?}");
            if name == "hertz" {
                // Hertz's dashpot rises with the fourth root of the time where a contact begins, so the order is below two.
                assert!(worst[0] < 3e-3 && worst[1] < worst[0] / 2.0, "{name}: {worst:?}");
                assert!(found[0].abs() < 1e-3 && found[3].abs() < 2e-4, "{name}: {found:?}");
                continue;
            }
            assert!(worst[0] < 4e-3 && worst[1] < worst[0] / 10.0, "{name}: {worst:?}");
            assert!(found[0].abs() < most && found[3].abs() < most / 40.0, "{name}: {found:?}");
            assert!(order > 1.8, "{name}: order {order}");
            let attracts = balls.falls("limit_damping = false", &material);
            let (found, _) = errors(&attracts, restitution, of_speed);
            println!("{name} e = {restitution}, attracting: {found:?}");
            // The attraction of the dashpot ends abruptly, anywhere within a step.
            assert!(found[0].abs() < 3e-3 && found[3].abs() < 3e-4, "{name}: {found:?}");
        }
    }
}

/// `u' = u e^(-γt) (cos Ωt - γ/Ω sin Ωt)` with `γ = 7/4 c_t/m` and `Ω² = 7/2 k_t/m - γ²`, at the end of an elastic contact.
#[test]
fn what_sticks_leaves_with_what_its_dashpot_has_left() {
    let (ratio, damping) = (2.0_f64 / 7.0, 0.3);
    let balls = Balls::linear();
    let dashpot = 2.0 * damping * (ratio * STIFFNESS * mass()).sqrt();
    let rate = 1.75 * dashpot / mass();
    let frequency = (3.5 * ratio * STIFFNESS / mass() - rate * rate).sqrt();
    let (sin, cos) = (frequency * balls.duration).sin_cos();
    let right = (-rate * balls.duration).exp() * (cos - rate / frequency * sin);
    let material = format!(
        "normal_stiffness = {STIFFNESS}\ntangential_stiffness = {}\ntangential_damping_ratio = {damping}\nfriction = 1e6",
        ratio * STIFFNESS
    );
    let slip = 0.3 * SPEED;
    let mut impact = Balls { material, ..balls }.falls("", "restitution = 1");
    impact.velocity += Vec3::x() * slip;
    let left = |velocity: &Vec3, spin: &Vec3| (velocity.x - spin.y * RADIUS) / slip;
    let (found, order) = errors(&impact, right, left);
    println!("{found:?}, order {order:.2}");
    assert!(found[0].abs() < 2e-3, "{found:?}");
    assert!(order > 1.8, "{found:?}: order {order}");
}

/// Five balls between two plates, the middle one pushed up and aside: each force changes the velocities at all dashpots. The reference has a fortieth
/// of the step. With `foresee` the error is of second order.
#[test]
fn a_pressed_stack_swings_with_second_order_if_that_is_foreseen() {
    for (balls, of_dashpots) in [
        (Balls::linear(), "restitution = 0.5\ntangential_damping_ratio = 0.2"),
        (Balls::hertz(), "restitution = 0.5"),
    ] {
        let apart = 1.98 * RADIUS;
        let height = 5.0 * apart;
        let material = format!("{}\n{of_dashpots}", balls.material).replace("= 0.1", "= 10");
        let shape = format!("kind = \"sphere\"\nradius = {RADIUS}");
        let domain = format!(
            "[domain]\nlow = [-1, -1, 0]\nhigh = [1, 1, {height}]\nwalls = [\"-z\", \"+z\"]\n"
        );
        let stack: Vec<_> = (0..5)
            .map(|k| Particle {
                velocity: if k == 2 { Vec3::new(0.3, 0.0, 1.0) * SPEED } else { Vec3::zeros() },
                ..Particle::at_rest(GlobalId(k), ShapeId(0), Vec3::z() * (apart * (k as f64 + 0.5)))
            })
            .collect();
        // Under an overlap of 0.02 radii, Hertzian contacts are stiffer than in an impact.
        let time = if of_dashpots.contains("ratio") { 1.0 } else { 0.1 } * balls.duration;
        let order = |foresee: bool| {
            let law = balls.law.replace("foresee = true", &format!("foresee = {foresee}"));
            let text = format!("{domain}{}", text(&law, &shape, &material));
            let end = |steps: u32| {
                let mut scene = scene(&text);
                scene.dt = time / f64::from(steps);
                let mut bench = Bench::of(&scene, &stack);
                for _ in 0..steps {
                    bench.step();
                }
                [0, 1, 2, 3, 4].map(|id| bench.sim.particles.position[bench.slot(id)])
            };
            let right = end(4000);
            let errors = [50, 100, 200].map(|steps| {
                let off =
                    end(steps).into_iter().zip(right).map(|(found, right)| (found - right).norm());
                off.fold(0.0, f64::max) / (SPEED * time)
            });
            let order = (errors[0] / errors[2]).log2() / 2.0;
            println!("foresee = {foresee}: {errors:?}, order {order:.2}");
            (order, errors[0])
        };
        let [(order, off), (late, late_off)] = [true, false].map(order);
        assert!(order > 1.8 && off < 0.2 * late_off, "order {order}, {off:e} and {late_off:e}");
        assert!((late - 1.0).abs() < 0.2, "order {late}");
    }
}

/// A ball slides over a floor while gravity pulls it aside, so that the direction in which it slides turns. The reference has an eighth of
/// the least step. With `foresee` the error is of second order.
#[test]
fn what_slides_turns_with_second_order_if_that_is_foreseen() {
    const TIME: f64 = 0.05;
    const SIZE: f64 = 0.01;
    let order = |foresee: bool| {
        let scene = format!(
            "gravity = [0, 4, -10]\n[domain]\nlow = [-1, -1, 0]\nhigh = [1, 1, 1]\nwalls = [\"-z\"]\n[law]\nforesee = {foresee}\n\
             [[material]]\nname = \"wood\"\ndensity = 1000\nnormal_stiffness = 1e3\ntangential_stiffness = 5e2\nfriction = 0.4\n\
             restitution = 0.99\n[[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = {SIZE}\n[time]\nstep = 1e-5\n"
        );
        let weight = 4.0 / 3.0 * PI * SIZE.powi(3) * 1000.0 * 10.0;
        let ball = Particle {
            velocity: Vec3::x() * 0.1,
            ..Particle::at_rest(GlobalId(0), ShapeId(0), Vec3::z() * (SIZE - weight / 1e3))
        };
        let end = |steps: u32| {
            let mut scene = self::scene(&scene);
            scene.dt = TIME / f64::from(steps);
            let mut bench = Bench::of(&scene, std::slice::from_ref(&ball));
            for _ in 0..steps {
                bench.step();
            }
            bench.sim.particles.position[bench.slot(0)].xy()
        };
        let right = end(16_000);
        let errors = [250, 500, 1000, 2000].map(|steps| (end(steps) - right).amax());
        let order = (errors[0] / errors[3]).log2() / 3.0;
        println!("foresee = {foresee}: {errors:?}, order {order:.2}");
        (order, errors[2])
    };
    let [(order, off), (late, late_off)] = [true, false].map(order);
    assert!(order > 1.7 && off < 0.3 * late_off, "order {order}, {off:e} and {late_off:e}");
    assert!(late < 1.3, "order {late}");
}

const PAIR: &str = r#"
[[shape]]
name = "pair"
kind = "union"
pieces = [{ shape = "half", at = [-0.0006, 0, 0] }, { shape = "half", at = [0.0006, 0, 0] }]
[[shape]]
name = "half"
kind = "sphere"
radius = 0.001
"#;

/// Ellipsoids of many sizes, balls and pairs of balls fall across a periodic border onto each other and the floor.
#[test]
fn what_is_foreseen_has_the_same_bits_everywhere() {
    for law in
        ["[law]\nforesee = true", "[law]\nnormal = \"hertz\"\nrolling = \"spring\"\nforesee = true"]
    {
        let material = if law.contains("hertz") {
            "youngs_modulus = 1e7\npoisson_ratio = 0.3"
        } else {
            "normal_stiffness = 1e4\ntangential_damping_ratio = 0.2"
        };
        // Contacts by curvature exclude unions.
        let (union, more) = if law.contains("hertz") { ("", "") } else { (PAIR, ", pair = 1") };
        let scene = scene(&format!(
            r#"
gravity = [0, 0, -9.81]
{law}
[domain]
low = [0, 0, 0]
high = [0.018, 0.018, 0.03]
periodic = [true, false, false]
walls = ["-y", "+y", "-z"]
[[material]]
name = "m"
density = 2500
{material}
friction = 0.4
restitution = 0.5
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.0011, 0.0013, 0.002]
size = {{ uniform = [0.7, 1.0] }}
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.0015
{union}[[fill.lattice]]
shapes = {{ egg = 1, ball = 1{more} }}
spacing = 0.0045
velocity = [0.3, 0.2, -1.5]
[time]
step = 1e-6
allow_unstable = true
"#
        ));
        let folder = tempfile::tempdir().unwrap();
        let state = OnRanks::of(&scene).the_same_everywhere(5000, folder.path());
        let [contacts, dissipated] = ["contacts", "dissipated"].map(|name| state.number(name));
        assert!(contacts > 5.0 && dissipated > 0.0, "{contacts}");
    }
}
