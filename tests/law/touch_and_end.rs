//! Contacts begin and end between two steps. Their memory then covers the part of the step with contact. Rebounds have closed
//! forms and are averaged over 16 phases of the first touch, at 12.5 to 100 steps a contact. This is 80 to 10 % of the stable
//! limit.

use crate::support::{Bench, scene};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::particles::records::Particle;
use std::f64::consts::PI;

pub(super) const RADIUS: f64 = 1e-3;
pub(super) const DENSITY: f64 = 2500.0;
pub(super) const STIFFNESS: f64 = 1e4;
/// Speed low enough that overlaps are negligible beside a radius [m/s].
pub(super) const SPEED: f64 = 1e-3;
const PHASES: u32 = 16;

pub(super) fn text(law: &str, shape: &str, material: &str) -> String {
    format!(
        r#"
{law}
[[material]]
name = "m"
density = {DENSITY}
{material}
[[shape]]
name = "grain"
{shape}
[time]
step = 1e-7
"#
    )
}

/// A particle that strikes the floor.
pub(super) struct Impact {
    pub(super) text: String,
    /// Height of the centre over the lowest point [m].
    pub(super) height: f64,
    pub(super) velocity: Vec3,
    /// Spin about a principal axis [rad/s], with its moment of inertia [kg m²].
    pub(super) spin: Vec3,
    pub(super) inertia: f64,
    /// Contact time [s].
    pub(super) duration: f64,
}

impl Impact {
    fn of_ball(material: &str, velocity: Vec3, spin: Vec3) -> Self {
        let shape = format!("kind = \"sphere\"\nradius = {RADIUS}");
        let law = "[law]\nrolling = \"spring\"\ntwisting = \"spring\"";
        let law = if material.contains("ing_friction") { law } else { "" };
        let material = format!("normal_stiffness = {STIFFNESS}\n{material}");
        Self {
            text: text(law, &shape, &material),
            height: RADIUS,
            velocity: velocity - Vec3::z() * SPEED,
            spin,
            inertia: 0.4 * mass() * RADIUS * RADIUS,
            duration: PI * (mass() / STIFFNESS).sqrt(),
        }
    }

    /// Mean over the phases of `read` after the impact, for this number of steps a contact.
    pub(super) fn mean(&self, steps: f64, read: impl Fn(&Vec3, &Vec3) -> f64) -> f64 {
        self.of_phases(steps, read).iter().sum::<f64>() / f64::from(PHASES)
    }

    /// Values of `read` after the impact, for each phase of the first touch within its step.
    pub(super) fn of_phases(&self, steps: f64, read: impl Fn(&Vec3, &Vec3) -> f64) -> Vec<f64> {
        let dt = self.duration / steps;
        let mut scene = scene(&self.text);
        scene.dt = dt;
        let apart = 10.0 * RADIUS;
        let grains: Vec<_> = (0..PHASES)
            .map(|k| {
                let ahead = SPEED * dt * (f64::from(k) + 0.5) / f64::from(PHASES);
                Particle {
                    velocity: self.velocity,
                    angular_velocity: self.spin,
                    angular_momentum: self.spin * self.inertia,
                    ..Particle::at_rest(
                        GlobalId(u64::from(k)),
                        ShapeId(0),
                        Vec3::new(apart * f64::from(k), 0.0, self.height + ahead),
                    )
                }
            })
            .collect();
        let mut bench = Bench::of(&scene, &grains);
        let begin = bench.measure();
        for _ in 0..(4.0 * steps) as u32 + 4 {
            bench.step();
            let missing = (bench.measure().missing() - begin.missing()).abs() / begin.kinetic();
            // Also while springs of the surface hold energy, with second order.
            assert!(missing < 3.0 / (steps * steps), "{missing:.1e} of the energy is missing");
        }
        assert_eq!(bench.measure().contacts, 0, "all have left the floor");
        let particles = &bench.sim.particles;
        let spin = particles.spin.as_ref().expect("friction turns grains");
        let of_phase = |slot: usize| read(&particles.velocity[slot], &spin.angular_velocity[slot]);
        (0..PHASES as usize).map(of_phase).collect()
    }

    /// Checks that the error is at most `most` at 12.5 steps and falls with second order.
    fn holds(&self, what: &str, right: f64, most: f64, read: impl Fn(&Vec3, &Vec3) -> f64) {
        let errors = [12.5, 25.0, 50.0, 100.0].map(|steps| (self.mean(steps, &read) - right).abs());
        eprintln!("{what}: {errors:?}");
        assert!(errors[0] < most, "{what}: {errors:?}");
        // Where two errors cancel, the smaller one need not fall.
        let order = (errors[1] / errors[3]).log2() / 2.0;
        assert!(order > 1.6 || errors[3] < 1e-5, "{what}: order {order:.2}, {errors:?}");
    }
}

pub(super) fn mass() -> f64 {
    DENSITY * 4.0 / 3.0 * PI * RADIUS.powi(3)
}

/// `u' = u cos(√(7/2 k_t/m) t_c)`: for `k_t = 2/7 k_n` the spring is empty at the end, otherwise it is as loaded as possible.
#[test]
fn what_sticks_leaves_with_the_phase_of_its_spring() {
    for (ratio, most) in [(2.0_f64 / 7.0, 0.01), (0.5, 0.01), (0.8, 0.03), (1.0, 0.05)] {
        let right = (PI * (3.5 * ratio).sqrt()).cos();
        let material = format!("tangential_stiffness = {}\nfriction = 1e6", ratio * STIFFNESS);
        let speed = 0.3 * SPEED;
        let impact = Impact::of_ball(&material, Vec3::x() * speed, Vec3::zeros());
        let slip = |velocity: &Vec3, spin: &Vec3| (velocity.x - spin.y * RADIUS) / speed;
        impact.holds(&format!("k_t/k_n = {ratio:.3}"), right, most, slip);
    }
}

/// The contact sticks until the falling limit reaches the tangential force, at a time found by bisection.
#[test]
fn what_slides_in_the_end_leaves_as_coulomb_says() {
    let (ratio, friction, speed) = (0.8_f64, 0.5, 0.3 * SPEED);
    // Times are phases of the contact, forces are relative to a compression of 1 m, lengths to the largest overlap.
    let rate = (3.5 * ratio).sqrt();
    let over =
        |phase: f64| ratio * 0.3 * (rate * phase).sin().abs() / rate - friction * phase.sin();
    let (mut sticks, mut slides) = (0.6 * PI, PI - 1e-9);
    assert!(over(sticks) < 0.0 && over(slides) > 0.0);
    for _ in 0..60 {
        let middle = 0.5 * (sticks + slides);
        *(if over(middle) < 0.0 { &mut sticks } else { &mut slides }) = middle;
    }
    let right = (rate * sticks).cos() + 3.5 * friction * (1.0 + sticks.cos()) / 0.3;
    let material = format!("tangential_stiffness = {}\nfriction = {friction}", ratio * STIFFNESS);
    let impact = Impact::of_ball(&material, Vec3::x() * speed, Vec3::zeros());
    let slip = |velocity: &Vec3, spin: &Vec3| (velocity.x - spin.y * RADIUS) / speed;
    impact.holds("sliding in the end", right, 0.01, slip);
}

/// With `5.625 μ² = 1` the springs against rolling and twisting have the period of the contact: the spin is reversed without
/// loss.
#[test]
fn what_rolls_or_twists_leaves_with_its_spin_turned_round() {
    let friction = 1.0 / 5.625_f64.sqrt();
    for (which, axis) in [("rolling", Vec3::y()), ("twisting", Vec3::z())] {
        let material =
            format!("{which}_friction = {friction}\nfriction = 0\nturning_damping_ratio = 0");
        let spin = 0.02 * SPEED / RADIUS;
        let impact = Impact::of_ball(&material, Vec3::zeros(), axis * spin);
        let left = |_: &Vec3, after: &Vec3| after.dot(&axis) / spin;
        impact.holds(which, -1.0, 0.01, left);
    }
}

/// A cube that falls on a face and spins about the normal. The moment of friction has the period of the contact where `a² k_t
/// / I = k_n / m` with the mean distance `a`. A sliding cube has it with `k_t = k_n`, as far as it does not tip.
#[test]
fn a_face_that_twists_leaves_with_its_spin_turned_round() {
    let edge = 2.0 * RADIUS;
    let mass = DENSITY * edge.powi(3);
    // The program uses the mean distance of a disc, which is 0.6 % more than that of a square.
    let distance = 8.0 / 9.0 * edge * edge / 6.0;
    let stiffness = STIFFNESS * edge * edge / 6.0 / distance;
    let material = format!(
        "normal_stiffness = {STIFFNESS}\ntangential_stiffness = {stiffness}\nfriction = 0.5"
    );
    let shape = format!("kind = \"polyhedron\"\nedges = [{edge}, {edge}, {edge}]");
    let spin = 0.1 * SPEED / RADIUS;
    let impact = Impact {
        text: text("", &shape, &material),
        height: 0.5 * edge,
        velocity: Vec3::z() * -SPEED,
        spin: Vec3::z() * spin,
        inertia: mass * edge * edge / 6.0,
        duration: PI * (mass / STIFFNESS).sqrt(),
    };
    let left = |_: &Vec3, after: &Vec3| after.z / spin;
    impact.holds("a face that twists", -1.0, 0.01, left);
}

/// Motion of a ball of Hertz and Mindlin that strikes and sticks, by the classical Runge-Kutta method. While the contact
/// grows the force is kept, and while it shrinks the stretch is kept. Returns the final slip velocity over the initial one.
fn hertz_and_mindlin(modulus: f64, shear_modulus: f64, slip: f64, duration: f64) -> f64 {
    // Overlap, its rate, slip, and the tangential force or the stretch.
    type State = [f64; 4];
    let rate = |[overlap, approach, slip, memory]: State, grows: bool| -> State {
        let root = (RADIUS * overlap.max(0.0)).sqrt();
        let normal = 4.0 / 3.0 * modulus * root * overlap.max(0.0);
        let stiffness = 8.0 * shear_modulus * root;
        let tangential = if grows { memory } else { stiffness * memory };
        let of_memory = if grows { stiffness * slip } else { slip };
        [approach, -normal / mass(), -3.5 * tangential / mass(), of_memory]
    };
    let mut state = [0.0, SPEED, slip, 0.0];
    let dt = duration / 1e5;
    while state[0] >= 0.0 {
        let next =
            |k: State, part: f64| -> State { std::array::from_fn(|i| state[i] + part * dt * k[i]) };
        let grows = state[1] > 0.0;
        let a = rate(state, grows);
        let b = rate(next(a, 0.5), grows);
        let c = rate(next(b, 0.5), grows);
        let d = rate(next(c, 1.0), grows);
        state =
            std::array::from_fn(|i| state[i] + dt / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        if grows && state[1] <= 0.0 {
            state[3] /= 8.0 * shear_modulus * (RADIUS * state[0]).sqrt();
        }
    }
    state[2] / slip
}

#[test]
fn mindlins_spring_is_of_second_order() {
    let (youngs, poisson) = (1e8, 0.3);
    let modulus = 0.5 * youngs / (1.0 - poisson * poisson);
    let shear_modulus = youngs / (4.0 * (2.0 - poisson) * (1.0 + poisson));
    let slip = 0.3 * SPEED;
    let largest = (1.25 * mass() * SPEED * SPEED / (4.0 / 3.0 * modulus * RADIUS.sqrt())).powf(0.4);
    let duration = 2.943_275 * largest / SPEED;
    let right = hertz_and_mindlin(modulus, shear_modulus, slip, duration);
    let material = format!("youngs_modulus = {youngs}\npoisson_ratio = {poisson}\nfriction = 1e6");
    let law = "[law]\nnormal = \"hertz\"\nlargest_overlap = 0.1";
    let shape = format!("kind = \"sphere\"\nradius = {RADIUS}");
    let impact = Impact {
        text: text(law, &shape, &material),
        height: RADIUS,
        velocity: Vec3::new(slip, 0.0, -SPEED),
        spin: Vec3::zeros(),
        inertia: 0.4 * mass() * RADIUS * RADIUS,
        duration,
    };
    let left = |velocity: &Vec3, spin: &Vec3| (velocity.x - spin.y * RADIUS) / slip;
    impact.holds("Mindlin", right, 0.04, left);
}
