//! A user-defined law with rolling resistance: a [`Model`] with moments, unknown to the rest of the program.

use crate::support::scene;
use dem_mpi::comm::alone::Alone;
use dem_mpi::contact::StateColumn;
use dem_mpi::ids::MaterialId;
use dem_mpi::lanes::{Lanes, Triple};
use dem_mpi::law::kernel::{Action, Contact, Kept, Law, Model, Spread, carried};
use dem_mpi::law::{About, Body, Hardest};
use dem_mpi::math::Vec3;
use dem_mpi::particles::Needs;
use dem_mpi::scene::assemble;
use dem_mpi::sim::Simulation;

/// Linear springs with Coulomb friction and rolling resistance, without dashpots. `M = k_r θ` with the angle `θ` by which A has
/// rolled on B, limited to `μ_r R N`. It is the elastic-plastic spring (Ai, Chen, Rotter, Ooi 2011, DOI
/// 10.1016/j.powtec.2010.09.030, section 3.3; Luding 2008, DOI 10.1007/s10035-008-0099-x, section 2.6).
#[derive(Clone, Copy, Debug)]
struct Rolling {
    /// Normal and tangential stiffness [N/m].
    stiffness: f64,
    friction: f64,
    /// `k_r` [N m/rad].
    angular_stiffness: f64,
    /// `μ_r`
    resistance: f64,
}

/// Constants of a contact.
#[derive(Clone, Copy, Debug)]
struct Constants<L> {
    /// `μ_r R` with the reduced radius [m].
    lever: L,
}

static REMEMBERED: [StateColumn; 2] =
    [StateColumn::new("spring", 3, "m"), StateColumn::new("rolled", 3, "rad")];

/// A vector, shortened to the limit if it is longer.
#[inline]
fn cut<L: Lanes>(vector: Triple<L>, limit: L) -> Triple<L> {
    let size = vector.dot(vector).sqrt();
    vector.times(limit / size).or(vector, limit.less(size))
}

impl Rolling {
    fn action<L: Lanes>(&self, overlap: L, [spring, rolled]: [Triple<L>; 2]) -> Action<L> {
        let (stiffness, rolling) = (L::all(self.stiffness), L::all(self.angular_stiffness));
        let half = L::all(0.5);
        let elastic = half * stiffness * overlap * overlap;
        let sheared = half * stiffness * spring.dot(spring);
        Action {
            press: stiffness * overlap,
            rub: spring.times(stiffness),
            viscous: Triple::zero(),
            kept: Kept::all(),
            moment: rolled.times(rolling),
            stored: [elastic, sheared + half * rolling * rolled.dot(rolled)],
        }
    }
}

impl About for Rolling {
    fn name(&self) -> &'static str {
        "rolling"
    }

    fn hardest(&self, _: &Body, _: MaterialId, _reduced_mass: f64) -> Hardest {
        Hardest { stiffness: self.stiffness, dashpots: [0.0; 2], turning: [0.0; 2] }
    }

    fn words(&self, _: MaterialId, _: MaterialId) -> String {
        format!("rolling friction {}", self.resistance)
    }
}

impl Model for Rolling {
    type Constants<L: Lanes> = Constants<L>;

    const MOMENTS: bool = true;

    fn needs(&self) -> Needs {
        Needs { velocity: true, spin: true, ..Needs::default() }
    }

    fn state(&self) -> &[StateColumn] {
        &REMEMBERED
    }

    fn constants(&self, a: &Body, b: &Body) -> Constants<f64> {
        Constants { lever: self.resistance / (1.0 / a.radius + 1.0 / b.radius) }
    }

    fn spread<L: Lanes>(of: &impl Spread<Constants<f64>, L>) -> Constants<L> {
        Constants { lever: of.of(|constants| constants.lever) }
    }

    fn dissipates<L: Lanes>(&self, _: &Constants<L>) -> [u8; 2] {
        [0, u8::MAX]
    }

    fn last<L: Lanes>(&self, _: &Constants<L>, overlap: L, state: &[L]) -> Action<L> {
        self.action(overlap, read(state))
    }

    fn act<L: Lanes>(
        &self,
        constants: &Constants<L>,
        contact: &Contact<L>,
        state: &mut [L],
    ) -> Action<L> {
        let Contact { normal, sliding, turning, dt, .. } = *contact;
        let rolling = turning.minus(normal.times(turning.dot(normal)));
        let press = L::all(self.stiffness) * contact.overlap;
        let [spring, rolled] = read(state).map(|vector| carried(vector, contact));
        // At the start of a stage no time has passed, and both stay within their limits.
        let dt = L::all(dt);
        let spring = spring.plus(sliding.times(dt));
        let spring = cut(spring, L::all(self.friction / self.stiffness) * press);
        let rolled = rolled.plus(rolling.times(dt));
        let rolled = cut(rolled, constants.lever * press / L::all(self.angular_stiffness));
        for (number, value) in
            state.iter_mut().zip([spring.x, spring.y, spring.z, rolled.x, rolled.y, rolled.z])
        {
            *number = value;
        }
        self.action(contact.overlap, [spring, rolled])
    }

    fn elastic<L: Lanes>(&self, _: &Constants<L>, overlap: L) -> L {
        L::all(self.stiffness) * overlap
    }

    fn stiffness(&self, _: &Constants<f64>, _overlap: f64, _dt: f64) -> f64 {
        self.stiffness
    }
}

/// Springs of a state: sliding and rolling.
#[inline]
fn read<L: Lanes>(state: &[L]) -> [Triple<L>; 2] {
    [0, 3].map(|k| Triple { x: state[k], y: state[k + 1], z: state[k + 2] })
}

/// Radius of the sphere on the slope [m].
const RADIUS: f64 = 0.01;
/// Density of the sphere [kg/m³].
const DENSITY: f64 = 2500.0;
/// Gravity [m/s²].
const GRAVITY: f64 = 9.81;
const STIFFNESS: f64 = 1e5;
const ROLLING_FRICTION: f64 = 0.2;
/// Time step [s].
const STEP: f64 = 1e-5;

fn mass() -> f64 {
    DENSITY * 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3)
}

/// A law whose rolling stiffness is a thousandth of the sliding stiffness, so that sliding is a thousandth of rolling.
fn rolling() -> Rolling {
    Rolling {
        stiffness: STIFFNESS,
        friction: 0.8,
        angular_stiffness: 1e-3 * STIFFNESS * RADIUS * RADIUS,
        resistance: ROLLING_FRICTION,
    }
}

/// A sphere that rests, pressed in by its weight, on a plane with this tangent of the slope. Gravity is tilted instead of the
/// plane.
fn on_slope(tangent: f64) -> Simulation {
    let cos = 1.0 / (1.0 + tangent * tangent).sqrt();
    let down = GRAVITY * cos;
    let overlap = mass() * down / STIFFNESS;
    let text = format!(
        r#"
gravity = [{along}, 0.0, -{down}]
[domain]
low = [0.0, 0.0, 0.0]
high = [2.0, 0.1, 0.1]
walls = ["-z"]
[[material]]
name = "glass"
density = {DENSITY}
normal_stiffness = {STIFFNESS}
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS}
[[fill.lattice]]
first = [0.05, 0.05, {z:e}]
count = [1, 1, 1]
[time]
step = {STEP:e}
"#,
        along = down * tangent,
        z = RADIUS - overlap,
    );
    begun_with(&text, rolling())
}

fn begun_with(text: &str, model: Rolling) -> Simulation {
    let scene = scene(text);
    let mut comm = Alone::default();
    let law = Law::new(model, &scene.library);
    let mut sim = assemble::assemble_with(&scene, Box::new(law), &comm);
    assemble::fill(&mut sim, &scene, &comm);
    sim.begin(&mut comm).unwrap();
    sim
}

/// Relative error of the closed forms, which neglect sliding (a thousandth) and its oscillation.
const SLIDES: f64 = 2e-3;

/// Up to the limit `θ_m = μ_r R N / k_r` the spring takes the work of gravity along the slope, `F x` with `x = R θ`. Beyond it the
/// moment is constant, and the sphere stops after the distance `d = (F x_m - x_m μ_r N / 2) / (μ_r N - F)`. It then swings back.
/// The only loss is rolling beyond the limit, `μ_r N d`.
#[test]
fn a_sphere_stops_on_a_slope_below_the_rolling_friction() {
    let tangent = 0.8 * ROLLING_FRICTION;
    let mut sim = on_slope(tangent);
    let cos = 1.0 / (1.0 + tangent * tangent).sqrt();
    let press = mass() * GRAVITY * cos;
    let (limit, along) = (ROLLING_FRICTION * press, press * tangent);
    let stretch = limit * RADIUS * RADIUS / rolling().angular_stiffness;
    let beyond = (along * stretch - 0.5 * limit * stretch) / (limit - along);
    let begin = sim.particles.position[0].x;
    let mut farthest: f64 = 0.0;
    for _ in 0..60_000 {
        sim.step(&mut Alone::default()).unwrap();
        farthest = farthest.max(sim.particles.position[0].x - begin);
    }
    let expected = stretch + beyond;
    let off = (farthest / expected - 1.0).abs();
    assert!(off < SLIDES, "{farthest:e} m, expected {expected:e} m, off by {off:.1e}");
    let measures = sim.measure(&mut Alone::default());
    let lost = limit * beyond;
    let off = (measures.dissipated / lost - 1.0).abs();
    assert!(off < SLIDES, "{:e} J, expected {lost:e} J, off by {off:.1e}", measures.dissipated);
    let missing = measures.missing().abs() / lost;
    assert!(missing < BALANCE, "{missing:.1e} of what is lost is missing");
}

/// Relative energy error: the work of linear springs is exact at mean forces, so only rounding remains.
const BALANCE: f64 = 1e-9;

/// `a = 5/7 g (sin - μ_r cos)`, and the moment dissipates `μ_r N x`.
#[test]
fn a_sphere_rolls_down_a_slope_above_the_rolling_friction() {
    for tangent in [1.1 * ROLLING_FRICTION, 2.0 * ROLLING_FRICTION] {
        let mut sim = on_slope(tangent);
        let mut comm = Alone::default();
        let steps = 20_000;
        let mut speeds = Vec::new();
        for step in 0..=2 * steps {
            if step % steps == 0 {
                speeds.push(sim.particles.velocity[0].x);
            }
            sim.step(&mut comm).unwrap();
        }
        let cos = 1.0 / (1.0 + tangent * tangent).sqrt();
        let expected = 5.0 / 7.0 * GRAVITY * cos * (tangent - ROLLING_FRICTION);
        let found = (speeds[2] - speeds[1]) / (f64::from(steps) * STEP);
        let off = (found / expected - 1.0).abs();
        assert!(off < SLIDES, "{found} m/s2, expected {expected} m/s2, off by {off:.1e}");
        let measures = sim.measure(&mut comm);
        let missing = measures.missing().abs() / measures.dissipated;
        assert!(missing < BALANCE, "{missing:.1e} of what is lost is missing");
    }
}

/// Energy error of colliding springs without dashpots over the loss; no channel takes this error.
const CROWD: f64 = 1e-3;

/// Spinning balls that fall on each other and on a floor, without friction and with it: the balance closes. Without friction only
/// moments change the spin and dissipate energy.
#[test]
fn moments_of_a_crowd_are_booked() {
    let text = r#"
gravity = [0.0, 0.0, -9.81]
[domain]
low = [0.0, 0.0, 0.0]
high = [0.06, 0.06, 0.3]
walls = ["-x", "+x", "-y", "+y", "-z"]
[[material]]
name = "glass"
density = 2500.0
normal_stiffness = 1e5
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.005
[[fill.lattice]]
first = [0.0056, 0.006, 0.0055]
count = [5, 5, 6]
spacing = [0.0115, 0.0112, 0.0113]
velocity = [0.4, -0.3, 0.0]
[time]
step = 5e-6
"#;
    let mut comm = Alone::default();
    for friction in [0.0, 0.8] {
        let mut sim = begun_with(text, Rolling { friction, angular_stiffness: 1.0, ..rolling() });
        let count = sim.particles.owned;
        let spin = sim.particles.spin.as_mut().unwrap();
        for (k, velocity) in spin.angular_velocity.iter_mut().take(count).enumerate() {
            *velocity = Vec3::from_fn(|i, _| 50.0 * ((k + i) % 5) as f64 - 100.0);
        }
        let before = sim.measure(&mut comm);
        for _ in 0..20_000 {
            sim.step(&mut comm).unwrap();
        }
        let after = sim.measure(&mut comm);
        let lost = after.dissipated;
        assert!(lost > 0.1 * before.rotation, "{lost:e} J of {:e} J", before.rotation);
        let missing = (after.missing() - before.missing()).abs() / lost;
        assert!(missing < CROWD, "friction {friction}: {missing:.1e} of what is lost is missing");
    }
}
