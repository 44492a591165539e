//! Resistance to rolling and twisting from a scene: closed forms of a sphere on a plane, invariances, particles of all kinds, and the energy
//! balance. (`rolling.rs` has a user-defined law.)

use crate::support::{Bench, Frame, close, expect_refused, scene};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::law::stability::time_step_limit;
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::particles::columns::Quantity;
use dem_mpi::particles::records::Particle;
use dem_mpi::random::Random;

const RADIUS: f64 = 0.01;
const DENSITY: f64 = 2500.0;
const GRAVITY: f64 = 9.81;

/// Stiff contacts of each law: the overlap of a resting ball is a hundred-thousandth of its radius, or less.
const LAWS: [(&str, &str); 2] = [
    ("", "normal_stiffness = 1e6"),
    ("normal = \"hertz\"\nlargest_overlap = 0.001", "youngs_modulus = 7e10\npoisson_ratio = 0.3"),
];

/// A ball above the floor z = 0, gravity along `down` [m/s²]; `own` are keys of the material.
fn text(law: (&str, &str), own: &str, down: Vec3, step: f64) -> String {
    format!(
        r#"
gravity = [{:e}, {:e}, {:e}]
[law]
{}
rolling = "spring"
twisting = "spring"
[domain]
low = [-10, -10, 0]
high = [10, 10, 10]
walls = ["-z"]
[[material]]
name = "m"
density = {DENSITY}
restitution = 0.5
{}
{own}
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS}
[time]
step = {step:e}
"#,
        down.x, down.y, down.z, law.0, law.1
    )
}

/// Table of a second ball.
const SMALL: &str = "[[shape]]\nname = \"small\"\nkind = \"sphere\"\nradius = 0.004\n";

fn mass() -> f64 {
    DENSITY * 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3)
}

/// Overlap of a ball under a weight along z [m].
fn overlap(law: (&str, &str), weight: f64) -> f64 {
    if law.0.is_empty() {
        return weight / 1e6;
    }
    let modulus = 0.5 * 7e10 / (1.0 - 0.09);
    (0.75 * weight / (modulus * RADIUS.sqrt())).powf(2.0 / 3.0)
}

fn resting(law: (&str, &str), own: &str, down: Vec3, velocity: Vec3, spin: Vec3) -> Bench {
    let step = if law.0.is_empty() { 5e-6 } else { 1e-6 };
    let height = RADIUS - overlap(law, -mass() * down.z);
    let ball = Particle {
        velocity,
        angular_velocity: spin,
        ..Particle::at_rest(GlobalId(0), ShapeId(0), Vec3::new(0.0, 0.0, height))
    };
    Bench::new(&text(law, own, down, step), &[ball])
}

/// `a = -5/7 μ_r g`. The ball stops after `7 v² / (10 μ_r g)` and half of the distance on which the spring is stretched, `δ / (2.25 μ_r)`. All
/// of the energy is dissipated by rolling.
#[test]
fn a_rolling_sphere_slows_down_and_stops() {
    let (friction, speed) = (0.05, 0.1);
    for law in LAWS {
        let own = format!("friction = 0.5\nrolling_friction = {friction}");
        let down = Vec3::new(0.0, 0.0, -GRAVITY);
        let (along, spin) = (Vec3::x() * speed, Vec3::y() * (speed / RADIUS));
        let mut bench = resting(law, &own, down, along, spin);
        let before = bench.measure();
        let after = |bench: &mut Bench, time: f64| {
            for _ in 0..(time / bench.sim.dt) as u64 {
                bench.step();
            }
            (bench.sim.particles.position[0].x, bench.sim.particles.velocity[0].x)
        };
        let time = speed / (5.0 / 7.0 * friction * GRAVITY);
        let (_, first) = after(&mut bench, 0.2 * time);
        let (_, second) = after(&mut bench, 0.6 * time);
        let slowed = (first - second) / (0.6 * time);
        close(slowed, 5.0 / 7.0 * friction * GRAVITY, 1e-3, "deceleration");
        let (way, rest) = after(&mut bench, 1.2 * time);
        let stretch = overlap(law, mass() * GRAVITY) / (2.25 * friction);
        let expected = 0.7 * speed * speed / (friction * GRAVITY) + 0.5 * stretch;
        close(way, expected, 2e-3, "way");
        assert!(rest.abs() < 1e-6 * speed, "{rest:e} m/s");
        let end = bench.measure();
        close(end.dissipated, before.kinetic(), 1e-3, "lost");
        close(end.taken_by(Quantity::OfTurning), before.kinetic(), 1e-2, "to rolling");
        let missing = (end.missing() - before.missing()).abs() / before.kinetic();
        assert!(missing < 1e-6, "{missing:.1e} of the energy is missing");
    }
}

/// Gravity is tilted: below `tan = μ_r` the sphere stays, above it rolls with `5/7 g (sin - μ_r cos)`.
#[test]
fn a_sphere_rests_on_a_slope_below_the_rolling_friction_and_rolls_above() {
    let friction = 0.1_f64;
    for law in LAWS {
        for tangent in [0.5 * friction, 0.98 * friction, 1.05 * friction, 2.0 * friction] {
            let cos = 1.0 / (1.0 + tangent * tangent).sqrt();
            let down = Vec3::new(tangent, 0.0, -1.0) * (GRAVITY * cos);
            let own = format!("friction = 0.8\nrolling_friction = {friction}");
            let mut bench = resting(law, &own, down, Vec3::zeros(), Vec3::zeros());
            let steps = (0.2 / bench.sim.dt) as u64;
            let mut speeds = Vec::new();
            for step in 0..=2 * steps {
                if step % steps == 0 {
                    speeds.push(bench.sim.particles.velocity[0].x);
                }
                bench.step();
            }
            let what = format!("{} slope {tangent}", law.0);
            if tangent < friction {
                let way = bench.sim.particles.position[0].x;
                // Under a sudden load it overshoots the stretch of the spring, by this much without damping, see `rolling.rs`.
                let part = tangent / friction;
                let stretch = overlap(law, mass() * GRAVITY * cos) / (2.25 * friction);
                let most = stretch * (1.0 + (part - 0.5) / (1.0 - part));
                assert!((0.0..most).contains(&way), "{what}: {way:e} m of {most:e} m");
                assert!(speeds[2].abs() < 1e-8, "{what}: {:e} m/s", speeds[2]);
            } else {
                let found = (speeds[2] - speeds[1]) / (steps as f64 * bench.sim.dt);
                let expected = 5.0 / 7.0 * GRAVITY * cos * (tangent - friction);
                close(found, expected, 2e-3, &what);
            }
        }
    }
}

/// `dω/dt = -5/2 μ_tw g / R`, and the ball stops.
#[test]
fn a_spinning_sphere_slows_down_and_stops() {
    let (friction, spin) = (0.02, 40.0);
    for law in LAWS {
        let own = format!("friction = 0.5\ntwisting_friction = {friction}");
        let down = Vec3::new(0.0, 0.0, -GRAVITY);
        let mut bench = resting(law, &own, down, Vec3::zeros(), Vec3::z() * spin);
        let expected = 2.5 * friction * GRAVITY / RADIUS;
        let spin_of =
            |bench: &Bench| bench.sim.particles.angular_velocity_of(dem_mpi::ids::Slot(0));
        let steps = (0.5 * spin / expected / bench.sim.dt) as u64;
        for _ in 0..steps {
            bench.step();
        }
        let slowed = (spin - spin_of(&bench).z) / (steps as f64 * bench.sim.dt);
        close(slowed, expected, 1e-3, "it spins slower");
        for _ in 0..2 * steps {
            bench.step();
        }
        assert!(spin_of(&bench).norm() < 1e-5 * spin, "{}", spin_of(&bench));
        let end = bench.measure();
        close(end.dissipated, 0.2 * mass() * RADIUS * RADIUS * spin * spin, 1e-3, "lost");
    }
}

/// Two balls of unequal size that meet off centre and spin.
fn pair(swapped: bool, turn: &Mat3, drift: Vec3) -> [(Vec3, Vec3); 2] {
    let text = text(
        LAWS[0],
        "friction = 0.4\nrolling_friction = 0.2\ntwisting_friction = 0.1\ntangential_damping_ratio = 0.2",
        Vec3::zeros(),
        1e-6,
    )
    .replace("walls = [\"-z\"]", "")
    .replace("low = [-10, -10, 0]", "low = [-10, -10, -10]")
        + SMALL;
    let scene = scene(&text);
    let ids = if swapped { [1, 0] } else { [0, 1] };
    let ball = |k: usize, position: Vec3, velocity: Vec3, spin: Vec3| Particle {
        velocity: turn * velocity + drift,
        angular_velocity: turn * spin,
        ..Particle::at_rest(GlobalId(ids[k]), ShapeId(k as u16), turn * position)
    };
    let along = Vec3::new(0.8, 0.6, 0.0) * 0.0139;
    let mut bench = Bench::of(
        &scene,
        &[
            ball(0, Vec3::zeros(), Vec3::new(0.3, 0.0, 0.1), Vec3::new(20.0, -30.0, 10.0)),
            ball(1, along, Vec3::new(-0.2, 0.1, 0.0), Vec3::new(-50.0, 20.0, 80.0)),
        ],
    );
    for _ in 0..1000 {
        bench.step();
    }
    let back = turn.transpose();
    [0, 1].map(|k| {
        let slot = bench.slot(ids[k]);
        let particles = &bench.sim.particles;
        let spin = particles.angular_velocity_of(dem_mpi::ids::Slot(slot as u32));
        (back * (particles.velocity[slot] - drift), back * spin)
    })
}

/// Exchanged ids, a rotated frame and another inertial frame change only the rounding.
#[test]
fn observers_see_the_same() {
    let usual = pair(false, &Mat3::identity(), Vec3::zeros());
    let mut random = Random::of(7, 0);
    for (swapped, turn, drift) in [
        (true, Mat3::identity(), Vec3::zeros()),
        (false, random.frame(), Vec3::zeros()),
        (true, random.frame(), Vec3::new(30.0, -20.0, 10.0)),
    ] {
        let other = pair(swapped, &turn, drift);
        for (a, b) in usual.iter().zip(&other) {
            let off = ((a.0 - b.0).norm() / a.0.norm()).max((a.1 - b.1).norm() / a.1.norm());
            assert!(off < 1e-7, "off by {off:.1e}");
        }
    }
}

/// Two balls that rotate as one body neither roll nor twist: no moment acts, and the springs stay as they are.
#[test]
fn what_turns_as_one_body_feels_no_moment() {
    let text =
        text(LAWS[0], "rolling_friction = 0.5\ntwisting_friction = 0.5", Vec3::zeros(), 1e-6)
            .replace("walls = [\"-z\"]", "")
            .replace("low = [-10, -10, 0]", "low = [-10, -10, -10]");
    let scene = scene(&text);
    let spin = Vec3::new(3.0, -5.0, 8.0);
    let ball = |id: u64, position: Vec3| Particle {
        velocity: spin.cross(&position),
        angular_velocity: spin,
        ..Particle::at_rest(GlobalId(id), ShapeId(0), position)
    };
    let half = Vec3::new(0.6, 0.0, 0.8) * (RADIUS - 1e-6);
    let mut bench = Bench::of(&scene, &[ball(0, half), ball(1, -half)]);
    for _ in 0..50 {
        bench.step();
        for torque in &bench.sim.particles.spin.as_ref().expect("they turn").torque[..2] {
            assert!(Vec3::from(torque.vector).norm() < 1e-17, "{torque:?}");
        }
    }
}

/// Particles of all kinds fall into a box, with both laws for spheres alone. The energy balance closes.
#[test]
fn the_balance_of_a_crowd_closes() {
    let balls = "kind = \"sphere\"\nradius = 0.006\nsize = { uniform = [0.5, 1.0] }";
    let eggs = "kind = \"ellipsoid\"\nsemi_axes = [0.006, 0.004, 0.003]";
    let boxes = "kind = \"polyhedron\"\nvertices = [[-4e-3, -3e-3, -3e-3], [4e-3, -3e-3, -3e-3], [-4e-3, 3e-3, -3e-3], \
                 [4e-3, 3e-3, -3e-3], [-4e-3, -3e-3, 3e-3], [4e-3, -3e-3, 3e-3], [-4e-3, 3e-3, 3e-3], [4e-3, 3e-3, 3e-3]]";
    let linear = ("", "normal_stiffness = 1e5\ntangential_damping_ratio = 0.2");
    let hertz =
        ("normal = \"hertz\"\nlargest_overlap = 0.1", "youngs_modulus = 2e7\npoisson_ratio = 0.3");
    let springs = ("", "normal_stiffness = 1e5");
    for (law, shape, most) in
        [(springs, balls, 1e-9), (hertz, balls, 1e-9), (linear, eggs, 1e-5), (linear, boxes, 1e-3)]
    {
        let own = "friction = 0.4\nrolling_friction = 0.3\ntwisting_friction = 0.2";
        let text = text(law, own, Vec3::new(0.0, 0.0, -GRAVITY), 2.4e-6)
            .replace(
                "low = [-10, -10, 0]\nhigh = [10, 10, 10]",
                "low = [0, 0, 0]\nhigh = [0.06, 0.06, 0.2]",
            )
            .replace("walls = [\"-z\"]", "walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\"]")
            .replace("kind = \"sphere\"\nradius = 0.01", shape)
            + "[[fill.lattice]]\nlow = [0, 0, 0]\nhigh = [0.06, 0.06, 0.06]\nvelocity = [0.5, -0.3, -1.5]\n";
        let scene = scene(&text);
        let mut comm = dem_mpi::comm::alone::Alone::default();
        let mut sim = crate::support::begun(&scene, &mut comm);
        let before = sim.measure(&mut comm);
        for _ in 0..20_000 {
            sim.step(&mut comm).unwrap();
        }
        let after = sim.measure(&mut comm);
        let missing = (after.missing() - before.missing()).abs() / after.dissipated;
        println!("{shape}: {missing:.1e} of {:e} J, stored {:e} J", after.dissipated, after.stored);
        let contacts = after.contacts + after.wall_contacts;
        assert!(contacts > 20, "{shape}: {contacts} contacts");
        let by = |channel| after.taken_by(channel);
        let parts = [after.of_normal_dashpots(), by(Quantity::OfFriction), by(Quantity::OfTurning)];
        println!("normal dashpots, friction, turning: {parts:?}");
        assert!(parts.iter().all(|part| *part > 0.01 * after.dissipated), "{parts:?}");
        assert_eq!(after.taken_by(Quantity::OfDamping), 0.0, "no global damping");
        assert!(missing < most, "{shape}: {missing:.1e} of what is lost is missing");
    }
}

/// A box that spins on its face: friction has the moment of the face's extent, and the twisting spring adds none.
#[test]
fn twisting_is_not_counted_twice_where_faces_touch() {
    let turned = |twisting: &str| {
        let shape = "kind = \"polyhedron\"\nvertices = [[-0.01, -0.01, -0.01], [0.01, -0.01, -0.01], [-0.01, 0.01, -0.01], \
                     [0.01, 0.01, -0.01], [-0.01, -0.01, 0.01], [0.01, -0.01, 0.01], [-0.01, 0.01, 0.01], [0.01, 0.01, 0.01]]";
        let own = format!("friction = 0.3\n{twisting}");
        let text = text(LAWS[0], &own, Vec3::new(0.0, 0.0, -GRAVITY), 2e-6)
            .replace("kind = \"sphere\"\nradius = 0.01", shape);
        let scene = scene(&text);
        let weight = scene.library.mass[0] * GRAVITY;
        let die = Particle {
            angular_momentum: Vec3::z() * (10.0 * scene.library.inertia[0].z),
            ..Particle::at_rest(GlobalId(0), ShapeId(0), Vec3::new(0.0, 0.0, 0.01 - weight / 1e6))
        };
        let mut bench = Bench::of(&scene, &[die]);
        for _ in 0..2000 {
            bench.step();
        }
        bench.sim.particles.angular_velocity_of(dem_mpi::ids::Slot(0)).z
    };
    let without = turned("");
    assert!(without > 0.0 && without < 9.9, "friction slows it down: {without}");
    assert_eq!(without.to_bits(), turned("twisting_friction = 0.5").to_bits());
}

/// Keys that the law does not use are rejected, with the name of the law that uses them.
#[test]
fn keys_of_springs_that_are_not_there_are_refused() {
    let good = text(LAWS[0], "rolling_friction = 0.1", Vec3::zeros(), 1e-6);
    scene(&good);
    for (from, to, said) in [
        ("rolling = \"spring\"", "", "rolling = \"spring\""),
        ("rolling = \"spring\"", "rolling = \"sprong\"", "\"spring\""),
        ("twisting = \"spring\"\n", "", "twisting = \"spring\""),
        ("rolling = \"spring\"\ntwisting = \"spring\"", "", "or twisting = \"spring\""),
        ("rolling_friction = 0.1", "rolling_friction = -0.1", "0 or greater"),
    ] {
        let good = good.replace(
            "rolling_friction = 0.1",
            "rolling_friction = 0.1\ntwisting_friction = 0.1\nturning_damping_ratio = 0.1",
        );
        expect_refused(&good, from, to, said);
    }
}

/// Long and flat particles rotate more easily than spheres of their size. With the longest step that the law allows, one that spins about its
/// axis comes to rest.
#[test]
fn what_turns_easily_comes_to_rest() {
    for (semi_axes, axis) in [
        ([1.0, 1.0, 1.0], 0),
        ([1.0, 0.3, 0.3], 0),
        ([1.0, 0.1, 0.1], 0),
        ([1.0, 1.0, 0.2], 0),
        ([1.0, 0.5, 0.1], 0),
    ] {
        for rolling in [0.1, 0.3, 0.5] {
            let [a, b, c] = semi_axes.map(|half: f64| half * RADIUS);
            let shape = format!("kind = \"ellipsoid\"\nsemi_axes = [{a:?}, {b:?}, {c:?}]");
            let own = format!("rolling_friction = {rolling}\nturning_damping_ratio = 0.3");
            let of_step = |step: f64| {
                let text = text(LAWS[0], &own, Vec3::new(0.0, 0.0, -GRAVITY), step)
                    .replace("twisting = \"spring\"\n", "")
                    .replace("restitution = 0.5", "restitution = 1")
                    .replace("kind = \"sphere\"\nradius = 0.01", &shape);
                scene(&text)
            };
            let made_for = of_step(1e-9);
            let limit = time_step_limit(&made_for.library, &*made_for.force_law()).unwrap().dt;
            let scene = of_step(0.99 * limit);
            let weight = scene.library.mass[0] * GRAVITY;
            // Slow enough that the spring reverses the spin before the particle has turned over.
            let spin = 0.02 * (GRAVITY / RADIUS).sqrt();
            let grain = Particle {
                angular_momentum: Vec3::ith(axis, spin * scene.library.inertia[0][axis]),
                ..Particle::at_rest(GlobalId(0), ShapeId(0), Vec3::new(0.0, 0.0, c - weight / 1e6))
            };
            let mut bench = Bench::of(&scene, &[grain]);
            let mut largest = [0.0_f64; 2];
            for half in &mut largest {
                for _ in 0..20_000 {
                    bench.step();
                    let spin = bench.sim.particles.spin.as_ref().expect("it turns");
                    *half = half.max(spin.angular_velocity[0].norm());
                }
            }
            let what = format!("{semi_axes:?}, rolling friction {rolling}");
            assert!(largest[1] < 1e-3 * spin, "{what}: {largest:?} of {spin} rad/s");
        }
    }
}

/// Two balls of 10 and 4 mm that rotate against each other. Slow rotation gives `c ω` at once, with `c = 2 η √(I k)`, `k = 2.25 k_n (μ R_r)²`
/// and `I` of both about the contact or the centre. Fast rotation gives `μ R_r N`.
#[test]
fn moments_of_unequal_balls_have_their_closed_forms() {
    let (friction, damping, stiffness, overlap) = (0.2, 0.3, 1e6, 1e-5);
    let text = text(
        LAWS[0],
        &format!("rolling_friction = {friction}\ntwisting_friction = {friction}\nturning_damping_ratio = {damping}"),
        Vec3::zeros(),
        1e-7,
    )
    .replace("restitution = 0.5", "restitution = 1")
    .replace("walls = [\"-z\"]", "")
    .replace("low = [-10, -10, 0]", "low = [-10, -10, -10]")
        + SMALL;
    let scene = scene(&text);
    let radii = [RADIUS, 0.004];
    let reduced = radii[0] * radii[1] / (radii[0] + radii[1]);
    let spring = 2.25 * stiffness * (friction * reduced).powi(2);
    for (axis, part) in [(Vec3::y(), 1.4), (Vec3::x(), 0.4)] {
        let moment = |spin: f64| {
            let turning = |id: u64, x: f64, spin: f64| Particle {
                angular_velocity: axis * spin,
                ..Particle::at_rest(GlobalId(id), ShapeId(id as u16), Vec3::x() * x)
            };
            let apart = radii[0] + radii[1] - overlap;
            let balls = [turning(0, 0.0, spin), turning(1, apart, -0.5 * spin)];
            let bench = Bench::of(&scene, &balls);
            let spins = bench.sim.particles.spin.as_ref().expect("they turn");
            let [first, second] = [0, 1].map(|slot| Vec3::from(spins.torque[slot].vector));
            assert!((first + second).norm() < 1e-12 * first.norm(), "{first} {second}");
            -first.dot(&axis)
        };
        let inertia = radii
            .map(|radius: f64| part * DENSITY * 4.0 / 3.0 * std::f64::consts::PI * radius.powi(5));
        let inertia = inertia[0] * inertia[1] / (inertia[0] + inertia[1]);
        let slow = 1e-3;
        let viscous = 2.0 * damping * (inertia * spring).sqrt() * 1.5 * slow;
        close(moment(slow), viscous, 1e-9, "dashpot");
        close(moment(1e4), friction * reduced * stiffness * overlap, 1e-9, "limit");
    }
}
