//! Resistance to rolling and twisting (Ai, Chen, Rotter, Ooi 2011, DOI 10.1016/j.powtec.2010.09.030, type C). Adhesion after
//! Derjaguin, Muller and Toporov (1975, DOI 10.1016/0021-9797(75)90018-1) and after Johnson, Kendall and Roberts (1971, DOI
//! 10.1098/rspa.1971.0141). All are closed forms of a ball on a plane and of two balls.

use super::{Case, Effort, Findings, Grain, Plane, Setup, Ways};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::Vec3;
use dem_mpi::scene::assemble;
use std::f64::consts::PI;

const ROLLING: &str = "Ai et al. 2011, 10.1016/j.powtec.2010.09.030, type C";
const DMT: &str = "Derjaguin, Muller, Toporov 1975, 10.1016/0021-9797(75)90018-1";
const JKR: &str = "Johnson, Kendall, Roberts 1971, 10.1098/rspa.1971.0141";

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut ways = Ways::new("rolling, twisting, adhesion");
    let mut cases = rolling(effort, &mut ways);
    cases.push(incline());
    cases.push(twisting(effort));
    cases.extend(adhesion(effort, &mut ways));
    cases.extend(ways.into_cases());
    Findings { cases, ..Findings::default() }
}

/// Radius [m] and density [kg/m³] of the rolling ball, and gravity [m/s²].
const RADIUS: f64 = 0.01;
const DENSITY: f64 = 2500.0;
const GRAVITY: f64 = 9.81;
/// Normal stiffness [N/m].
const STIFFNESS: f64 = 1e6;

/// A ball on a floor, pressed in by its weight.
fn on_floor(own: &str, gravity: Vec3, [velocity, spin]: [Vec3; 2]) -> Setup {
    let weight = -gravity.z * DENSITY * 4.0 / 3.0 * PI * RADIUS.powi(3);
    let text = format!(
        "[law]\nrolling = \"spring\"\ntwisting = \"spring\"\n[[material]]\nname = \"m\"\ndensity = {DENSITY}\nrestitution = 0.5\n\
         normal_stiffness = {STIFFNESS:e}\n{own}\n[[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = {RADIUS}\n"
    );
    let place = Vec3::new(0.0, 0.0, RADIUS - weight / STIFFNESS);
    let ball = Grain::at("ball", place).moving(velocity).spinning(spin);
    Setup { gravity, text, planes: vec![Plane::floor("m")], grains: vec![ball], dt: 5e-6 }
}

/// `a = -5/7 μ_r g`. The ball stops after `7 v² / (10 μ_r g)` and half of the distance on which the spring is stretched,
/// `δ / (2.25 μ_r)`.
fn rolling(effort: Effort, ways: &mut Ways) -> Vec<Case> {
    let mut slowing = Case::new(
        ROLLING,
        "ball that rolls on a floor",
        "deceleration, 5/7 μ_r g (m/s²)",
        1e-3,
        "the overlap shortens the lever arm by 1e-5 of it; the spring swings",
    );
    let mut way = Case::new(
        ROLLING,
        "ball that rolls on a floor",
        "way until it rests (m)",
        1e-3,
        "half of the way of the spring",
    );
    let speed = 0.1;
    for friction in effort.pick(&[0.05][..], &[0.02, 0.05, 0.1][..]) {
        let own = format!("friction = 0.5\nrolling_friction = {friction}");
        let down = Vec3::new(0.0, 0.0, -GRAVITY);
        let setup = on_floor(&own, down, [Vec3::x() * speed, Vec3::y() * (speed / RADIUS)]);
        let name = format!("μ_r = {friction}");
        ways.run(&format!("rolls, {name}"), &setup, 400, 20);
        let expected = 5.0 / 7.0 * friction * GRAVITY;
        let time = speed / expected;
        let steps = (1.2 * time / setup.dt) as u64;
        let frames = setup.run(steps, steps / 120);
        let (first, second) = (&frames[20], &frames[80]);
        let slowed = first.bodies[0].velocity.x - second.bodies[0].velocity.x;
        slowing.relative(&name, expected, slowed / (second.time - first.time));
        let weight = GRAVITY * DENSITY * 4.0 / 3.0 * PI * RADIUS.powi(3);
        let stretch = weight / STIFFNESS / (2.25 * friction);
        let expected = 0.7 * speed * speed / (friction * GRAVITY) + 0.5 * stretch;
        way.relative(&name, expected, frames[frames.len() - 1].bodies[0].position.x);
    }
    vec![slowing, way]
}

/// The ball rests where `tan < μ_r`, and otherwise rolls with `5/7 g (sin - μ_r cos)`.
fn incline() -> Case {
    let mut case = Case::new(
        ROLLING,
        "ball on a slope",
        "acceleration over that of gravity",
        1e-3,
        "the spring has to come to rest",
    );
    let friction = 0.1;
    for part in [0.5, 0.9, 0.99, 1.1, 1.5] {
        let angle = f64::atan(part * friction);
        let (along, down) = (GRAVITY * angle.sin(), GRAVITY * angle.cos());
        let own = format!("friction = 0.5\nrolling_friction = {friction}");
        let gravity = Vec3::new(along, 0.0, -down);
        let setup = on_floor(&own, gravity, [Vec3::zeros(), Vec3::zeros()]);
        let frames = setup.run(40_000, 20_000);
        let gained = frames[2].bodies[0].velocity.x - frames[1].bodies[0].velocity.x;
        let expected = f64::max(0.0, 5.0 / 7.0 * (along - friction * down) / GRAVITY);
        let own = gained / (frames[2].time - frames[1].time) / GRAVITY;
        case.absolute(format!("tan = {part} μ_r"), expected, own);
    }
    case
}

/// `dω/dt = -5/2 μ_tw g / R`.
fn twisting(effort: Effort) -> Case {
    let mut case = Case::new(
        "closed form, 10.1016/j.powtec.2010.09.030",
        "ball that spins on the spot",
        "angular deceleration, 5/2 μ_tw g/R (rad/s²)",
        1e-3,
        "the spring swings",
    );
    for friction in effort.pick(&[0.05][..], &[0.02, 0.05, 0.1][..]) {
        let own = format!("twisting_friction = {friction}");
        let down = Vec3::new(0.0, 0.0, -GRAVITY);
        let setup = on_floor(&own, down, [Vec3::zeros(), Vec3::z() * 30.0]);
        let expected = 2.5 * friction * GRAVITY / RADIUS;
        let steps = (30.0 / expected / setup.dt) as u64;
        let frames = setup.run(steps, steps / 100);
        let (first, second) = (&frames[20], &frames[80]);
        let slowed = first.bodies[0].spin.z - second.bodies[0].spin.z;
        case.relative(format!("μ_tw = {friction}"), expected, slowed / (second.time - first.time));
    }
    case
}

/// Radii of the sticking balls [m], their work of adhesion [J/m²], and `E*` of two of them [Pa].
const RADII: [f64; 2] = [1e-4, 6e-5];
const WORK: f64 = 0.1;
const MODULUS: f64 = 0.5 * 1e8 / (1.0 - 0.09);

/// A ball at a floor, or two balls; JKR or DMT.
#[derive(Clone, Copy)]
struct Blow {
    jkr: bool,
    with_floor: bool,
    /// Energy of the relative motion over the loss in JKR.
    energy: f64,
}

/// Results of an impact.
#[derive(Default)]
struct Seen {
    /// Largest pull [N].
    pull: f64,
    /// Last gap [m].
    gap: f64,
    /// Lost kinetic energy and booked dissipation, over the loss in JKR.
    lost: f64,
    booked: f64,
}

impl Blow {
    fn reduced(self) -> f64 {
        if self.with_floor { RADII[0] } else { 1.0 / (1.0 / RADII[0] + 1.0 / RADII[1]) }
    }

    fn masses(self) -> [f64; 2] {
        let of = |radius: f64| DENSITY * 4.0 / 3.0 * PI * f64::powi(radius, 3);
        [of(RADII[0]), if self.with_floor { f64::INFINITY } else { of(RADII[1]) }]
    }

    fn reduced_mass(self) -> f64 {
        1.0 / self.masses().iter().map(|mass| 1.0 / mass).sum::<f64>()
    }

    /// Loss in JKR from the touch to the end [J]: `7.09 (w⁵ R*⁴/E*²)^(1/3)`.
    fn takes(self) -> f64 {
        let parts = 0.6 * (2.0 * PI).powf(2.0 / 3.0) + 0.4 * (PI / 8.0).powf(2.0 / 3.0);
        PI * parts * (WORK.powi(5) * self.reduced().powi(4) / MODULUS.powi(2)).cbrt()
    }

    /// Gap at which a JKR contact ends [m].
    fn end(self) -> f64 {
        0.75 * (PI * PI * WORK * WORK * self.reduced() / (MODULUS * MODULUS)).cbrt()
    }

    fn speed(self) -> f64 {
        (2.0 * self.energy * self.takes() / self.reduced_mass()).sqrt()
    }

    /// Setup with `steps` steps over the gap at which JKR ends.
    fn setup(self, steps: f64) -> Setup {
        let adhesion = if self.jkr { "jkr" } else { "dmt" };
        let text = format!(
            "[law]\nnormal = \"hertz\"\nadhesion = \"{adhesion}\"\nlargest_overlap = 0.1\n[[material]]\nname = \"m\"\ndensity = {DENSITY}\n\
             youngs_modulus = 1e8\npoisson_ratio = 0.3\nsurface_energy = {}\n[[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = {:e}\n\
             [[shape]]\nname = \"small\"\nkind = \"sphere\"\nradius = {:e}\n",
            0.5 * WORK,
            RADII[0],
            RADII[1],
        );
        let (speed, reduced_mass) = (self.speed(), self.reduced_mass());
        let dt = self.end() / speed / steps;
        let before = 20.37 * dt * speed;
        let grains = if self.with_floor {
            let ball = Grain::at("ball", Vec3::new(0.0, 0.0, RADII[0] + before));
            vec![ball.moving(Vec3::new(0.0, 0.0, -speed))]
        } else {
            let [a, b] = self.masses();
            let apart = RADII[0] + RADII[1] + before;
            vec![
                Grain::at("ball", Vec3::zeros()).moving(Vec3::x() * (speed * reduced_mass / a)),
                Grain::at("small", Vec3::x() * apart)
                    .moving(Vec3::x() * (-speed * reduced_mass / b)),
            ]
        };
        let planes = if self.with_floor { vec![Plane::floor("m")] } else { Vec::new() };
        Setup { gravity: Vec3::zeros(), text, planes, grains, dt }
    }

    fn see(self, steps: f64) -> Seen {
        let setup = self.setup(steps);
        let scene = setup.scene(1);
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(&scene, &comm);
        assemble::fill(&mut sim, &scene, &comm);
        sim.begin(&mut comm).expect("it begins");
        let before = sim.measure(&mut comm);
        let out = if self.with_floor { Vec3::z() } else { -Vec3::x() };
        let (mut seen, mut touched) = (Seen::default(), false);
        for _ in 0..(400.0 * steps) as u64 {
            sim.step(&mut comm).expect("the step is done");
            let Some((_, geometry)) = sim.contacts.iter().next() else {
                if touched {
                    break;
                }
                continue;
            };
            touched = true;
            seen.gap = -geometry.overlap;
            seen.pull = seen.pull.max(-sim.particles.force[0].vector.dot(&out));
        }
        assert!(touched && sim.contacts.is_empty(), "it has come and gone");
        let after = sim.measure(&mut comm);
        seen.lost = (before.kinetic() - after.kinetic()) / self.takes();
        seen.booked = after.dissipated / self.takes();
        seen
    }
}

fn adhesion(effort: Effort, ways: &mut Ways) -> Vec<Case> {
    let first_order = "the force jumps at the touch: first order in the step";
    let mut pull =
        Case::new(DMT, "balls that stick", "pull-off force, 2π w R* (N)", 1e-3, first_order);
    let mut keeps = Case::new(
        DMT,
        "balls that stick",
        "energy lost over that which JKR takes",
        1e-3,
        first_order,
    );
    let of_jkr =
        |quantity: &str, why: &str| Case::new(JKR, "balls that stick", quantity, 1e-3, why);
    let mut pull_off = of_jkr("pull-off force, 3/2 π w R* (N)", "the step over the gap");
    let mut gap = of_jkr("gap at the end, 3/4 (π² w² R*/E*²)^(1/3) (m)", "the step over the gap");
    let mut lost = of_jkr("kinetic energy lost over 7.09 (w⁵ R*⁴/E*²)^(1/3)", first_order);
    let mut booked = of_jkr("energy booked as lost over the same", first_order);
    let steps = effort.pick(2000.0, 4000.0);
    for with_floor in [true, false] {
        for energy in effort.pick(&[2.0][..], &[1.2, 2.0, 6.0][..]).iter().copied() {
            let name = format!(
                "{}, {energy} times that energy",
                if with_floor { "ball and floor" } else { "two balls of 5:3" }
            );
            let blow = Blow { jkr: false, with_floor, energy };
            let seen = blow.see(steps);
            pull.relative(&name, 2.0 * PI * WORK * blow.reduced(), seen.pull);
            keeps.absolute(&name, 0.0, seen.lost);
            ways.run(&format!("DMT, {name}"), &blow.setup(20.0), 400, 20);
            let blow = Blow { jkr: true, ..blow };
            let seen = blow.see(steps);
            pull_off.relative(&name, 1.5 * PI * WORK * blow.reduced(), seen.pull);
            gap.relative(&name, blow.end(), seen.gap);
            lost.absolute(&name, 1.0, seen.lost);
            booked.absolute(&name, 1.0, seen.booked);
            ways.run(&format!("JKR, {name}"), &blow.setup(20.0), 400, 20);
        }
    }
    vec![pull, keeps, pull_off, gap, lost, booked]
}
