//! Motion against closed forms: initial conditions, free bodies, changes of the step, the energy balance.

use crate::support::{Bench, begun};
use dem_mpi::comm::Comm;
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::threads;
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::particles::columns::Accumulated;
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::{Scene, assemble};
use dem_mpi::sim::{StepError, capture, watch::Fault};

const SPHERE: &str = "kind = \"sphere\"\nradius = 0.01";
const ELLIPSOID: &str = "kind = \"ellipsoid\"\nsemi_axes = [0.03, 0.02, 0.01]";
const STIFF: &str = "density = 2500\nnormal_stiffness = 1e4\nfriction = 0.3\nrestitution = 0.5";
const ELASTIC: &str = "density = 2500\nnormal_stiffness = 1e4";

/// Scene with the particles of a CSV text, header and rows.
fn scene(more: &str, material: &str, shape: &str, dt: f64, particles: &str) -> Scene {
    let folder = tempfile::tempdir().expect("a directory for a file");
    std::fs::write(folder.path().join("particles.csv"), particles).expect("a file is written");
    let text = format!(
        "{more}\n[[material]]\nname = \"m\"\n{material}\n[[shape]]\nname = \"grain\"\n{shape}\n[[fill.file]]\npath = \
         \"particles.csv\"\n[time]\nstep = {dt:e}\nsteps = 1\nallow_unstable = true\n[output]\ndirectory = \"out\"\n"
    );
    Scene::parse(&text, "test", folder.path(), &[]).unwrap_or_else(|errors| panic!("{errors}"))
}

const WIDE: &str = "[domain]\nlow = [-1e3, -1e3, -1e3]\nhigh = [1e3, 1e3, 1e3]";
/// Domain with a floor at z = 0 of the same material.
const FLOOR: &str = "[domain]\nlow = [-1, -1, 0]\nhigh = [1, 1, 1]\nwalls = [\"-z\"]";

/// Steps a scene, and calls `look` before the first step and after each.
fn run(scene: &Scene, steps: u64, mut look: impl FnMut(&mut dem_mpi::sim::Simulation, &mut Alone)) {
    let mut comm = Alone::default();
    let mut sim = begun(scene, &mut comm);
    look(&mut sim, &mut comm);
    for _ in 0..steps {
        sim.step(&mut comm).expect("the step is done");
        look(&mut sim, &mut comm);
    }
}

/// `z = z0 + v t - g t²/2`: central differences are exact for it at any step.
#[test]
fn a_projectile_is_exact_to_rounding() {
    let (velocity, gravity) = (Vec3::new(1.5, -0.5, 4.0), Vec3::new(0.0, 1.0, -9.81));
    for shape in [SPHERE, ELLIPSOID].map(|shape| shape.replace("0.0", "")) {
        for (dt, steps) in [(1e-2, 50), (1e-3, 500), (1e-4, 5000)] {
            let more = format!("gravity = [0, 1, -9.81]\n{WIDE}");
            let csv = "x,y,z,vx,vy,vz,wx,wy,wz\n1,2,3,1.5,-0.5,4,0.5,-1,0.7\n";
            run(&scene(&more, STIFF, &shape, dt, csv), steps, |sim, _| {
                let t = sim.step as f64 * dt;
                let fell = gravity * (0.5 * t * t);
                let position = Vec3::new(1.0, 2.0, 3.0) + velocity * t + fell;
                let rounding = 4.0 * f64::EPSILON * (sim.step + 1) as f64;
                let off = (sim.particles.position[0] - position).norm();
                assert!(off <= rounding * 4.0, "{shape}, dt {dt}, step {}: {off:e} m", sim.step);
                let off = (sim.particles.velocity[0] - velocity - gravity * t).norm();
                assert!(off <= rounding * 6.0, "{shape}, dt {dt}, step {}: {off:e} m/s", sim.step);
            });
        }
    }
}

/// Order of the errors from one step to half of it.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect()
}

/// `m z'' = -k (z - R) - m g` from a given position and velocity on a floor, for half a period within the contact.
#[test]
fn an_oscillation_is_of_second_order_from_the_first_step() {
    let mass = 2500.0 * 4.0 / 3.0 * std::f64::consts::PI * 1e-6;
    let omega = (1e4 / mass).sqrt();
    let (depth, speed) = (2e-4, 0.05);
    let end = 1.2 / omega;
    let errors: Vec<f64> = [8_u64, 16, 32, 64]
        .map(|steps| {
            let dt = end / steps as f64;
            let csv = format!("x,y,z,vz\n0,0,{},{}\n", 0.01 - depth, -speed);
            let more = format!("gravity = [0, 0, -9.81]\n{FLOOR}");
            let csv = csv
                .replace("vz", "vx,vy,vz")
                .replace(&format!(",{}\n", -speed), &format!(",0,0,{}\n", -speed));
            let mut error = 0.0;
            run(&scene(&more, ELASTIC, SPHERE, dt, &csv), steps, |sim, _| {
                let t = sim.time();
                let rest = 0.01 - mass * 9.81 / 1e4;
                let (from, v) = (0.01 - depth - rest, -speed);
                let z = rest + from * (omega * t).cos() + v / omega * (omega * t).sin();
                let vz = -from * omega * (omega * t).sin() + v * (omega * t).cos();
                let of_place = (sim.particles.position[0].z - z).abs() * omega;
                let of_velocity = (sim.particles.velocity[0].z - vz).abs();
                error = of_place.max(of_velocity) / speed;
            });
            error
        })
        .to_vec();
    for order in orders(&errors) {
        assert!(order > 1.9, "{errors:?}: order {order:.2}");
    }
}

/// A state from a snapshot continues with another step: nothing else changes.
#[test]
fn another_step_leaves_the_state_and_the_energy() {
    let dashpot = "density = 2500\nnormal_stiffness = 1e4\nfriction = 0.3\nrestitution = 0.8";
    for (material, shape) in [(ELASTIC, SPHERE), (dashpot, SPHERE), (ELASTIC, ELLIPSOID)] {
        let csv = "x,y,z,vx,vy,vz,wx,wy,wz\n0,0,0.0098,0.01,0,-0.05,0,0.5,0\n";
        let make =
            |dt| scene(&format!("gravity = [0, 0, -9.81]\n{FLOOR}"), material, shape, dt, csv);
        let limit = make(1e-6).time_step_limit().expect("there is one").dt;
        let mut comm = Alone::default();
        let (coarse, fine) = (make(0.62 * limit), make(0.0062 * limit));
        let mut sim = begun(&coarse, &mut comm);
        let energy = |sim: &dem_mpi::sim::Simulation, comm: &mut Alone| {
            let m = sim.measure(comm);
            m.kinetic() + m.gravity + m.stored
        };
        let whole = energy(&sim, &mut comm);
        for stage in [&fine, &coarse, &fine] {
            (0..5).for_each(|_| sim.step(&mut comm).expect("the step is done"));
            let before = (sim.particle_table(dem_mpi::ids::Rank(0)), energy(&sim, &mut comm));
            let mut next = assemble::assemble(stage, &comm);
            let mut particles = capture::particles_of(&before.0, |shape| shape);
            for particle in &mut particles {
                particle.accumulated = Accumulated::default();
            }
            next.take_up(&particles, &sim.contact_records(), &mut comm);
            next.count_free_energy();
            next.begin(&mut comm).expect("the stage begins");
            let after = (next.particle_table(dem_mpi::ids::Rank(0)), energy(&next, &mut comm));
            assert_eq!(before.0.position, after.0.position);
            assert_eq!(before.0.velocity, after.0.velocity);
            assert_eq!(before.0.angular_velocity, after.0.angular_velocity);
            assert_eq!(before.1.to_bits(), after.1.to_bits(), "the energy of the state");
            let missing = next.measure(&mut comm).missing().abs();
            assert!(
                missing < 1e-12 * whole.abs(),
                "row 0 of a stage misses {missing:e} J of {whole:e} J"
            );
            sim = next;
        }
    }
}

/// Springs and fields neither take nor create energy: the balance closes to rounding at any step, also coarse ones.
#[test]
fn the_energy_balance_closes_to_rounding() {
    let damped = "global_damping = 2000\n";
    let cases = [
        ("an oscillating sphere", FLOOR, ELASTIC, SPHERE, "0,0,0.0098,0,0,-0.05,0,0,0"),
        (
            "a sphere with a dashpot that slips and spins",
            FLOOR,
            STIFF,
            SPHERE,
            "0,0,0.0099,0.3,0.1,-0.05,9,-5,3",
        ),
        ("a free sphere", WIDE, STIFF, SPHERE, "0,0,0,1,2,3,40,50,60"),
        ("a free ellipsoid", WIDE, STIFF, ELLIPSOID, "0,0,0,1,2,3,4,5,6"),
    ];
    for (name, domain, material, shape, row) in cases {
        for field in ["", "gravity = [1, -2, -9.81]\n", damped] {
            let csv = format!("x,y,z,vx,vy,vz,wx,wy,wz\n{row}\n");
            let make = |dt| scene(&format!("{field}{domain}"), material, shape, dt, &csv);
            let limit = make(1e-6).time_step_limit().expect("there is one").dt;
            // The run ends before the contact does, as a step across the end of a contact is not resolved and has an energy
            // error.
            let dt = if domain == FLOOR { 0.2 * limit } else { 1e-4 };
            let mut received = 0.0;
            run(&make(dt), 12, |sim, comm| {
                let m = sim.measure(comm);
                received = f64::max(received, m.received.abs());
                assert!(
                    m.missing().abs() < 1e-13 * received,
                    "{name}, {field:?}: {:e} J of {received:e} J are missing at step {}",
                    m.missing(),
                    sim.step
                );
                assert!(m.dissipated >= 0.0, "{name}: {m:?}");
            });
        }
    }
}

/// `E = E0 exp(-2 ξ t)` with damping alone: kinetic and dissipated energy are all.
#[test]
fn global_damping_dissipates_what_the_motion_loses() {
    for part in [0.2, 0.02] {
        let csv = "x,y,z,vx,vy,vz,wx,wy,wz\n0,0,0,1,2,3,40,50,60\n";
        let field = format!("global_damping = {}\n{WIDE}", part * 1e4);
        for shape in [SPHERE, ELLIPSOID] {
            let mut start = None;
            run(&scene(&field, STIFF, shape, 1e-4, csv), 100, |sim, comm| {
                let m = sim.measure(comm);
                let whole = *start.get_or_insert(m.kinetic());
                let off = (m.kinetic() + m.dissipated) / whole - 1.0;
                assert!(off.abs() < 1e-13, "ξ dt = {part}, step {}: {off:e}", sim.step);
                assert_eq!(m.step_energy, 0.0);
            });
        }
    }
}

/// Kinetic energy and angular momentum of a free body are constant for any shape and spin.
#[test]
fn free_turns_keep_energy_and_angular_momentum() {
    let bodies = [
        ("needle 100:1", [0.1, 0.001, 0.001]),
        ("needle 30:1", [0.03, 0.001, 0.001]),
        ("flat needle", [0.1, 0.01, 0.001]),
        ("disc 1:50", [0.05, 0.05, 0.001]),
        ("three axes", [0.03, 0.02, 0.01]),
        ("nearly a sphere", [0.0101, 0.01, 0.0099]),
    ];
    // Along and across, and near the middle axis, about which no rotation is stable.
    let spins = [[1.0, 0.01, 0.02], [0.3, 1.0, 0.2], [0.001, 1.0, 0.001], [0.5, 0.5, 0.7]];
    for (name, axes) in bodies {
        for spin in spins {
            for (turn, steps) in
                [(3e-3, 20_000), (0.03, 100_000), (0.1, 20_000), (0.3, 20_000), (1.0, 20_000)]
            {
                let shape = format!("kind = \"ellipsoid\"\nsemi_axes = {axes:?}");
                let dt = 1e-5;
                let omega = Vec3::from(spin).normalize() * (0.999 * turn / dt);
                let csv = format!(
                    "x,y,z,vx,vy,vz,wx,wy,wz\n0,0,0,0,0,0,{:e},{:e},{:e}\n",
                    omega.x, omega.y, omega.z
                );
                let mut comm = Alone::default();
                let mut sim = begun(&scene(WIDE, STIFF, &shape, dt, &csv), &mut comm);
                let energy = sim.measure(&mut comm).rotation;
                let momentum = sim.particles.angular_momentum(0);
                for _ in 0..steps {
                    // A long tumbling body rotates faster than at the start.
                    match sim.step(&mut comm) {
                        Err(StepError::Fault { .. }) if turn > 0.1 => break,
                        done => done.unwrap_or_else(|e| panic!("{name}, {spin:?}, {turn}: {e}")),
                    }
                }
                let off = sim.measure(&mut comm).rotation / energy - 1.0;
                assert!(off.abs() < 1e-9, "{name}, spin {spin:?}, ω dt = {turn}: energy {off:e}");
                assert_eq!(sim.particles.angular_momentum(0), momentum, "{name}");
            }
        }
    }
}

/// A symmetric top rotates about its axis of symmetry, which precesses about the angular momentum: closed form.
#[test]
fn a_symmetric_top_precesses_with_second_order() {
    let (a, b) = (0.03, 0.01);
    let shape = format!("kind = \"ellipsoid\"\nsemi_axes = [{a}, {b}, {b}]");
    let mass = 2500.0 * 4.0 / 3.0 * std::f64::consts::PI * a * b * b;
    let (along, across) = (0.4 * mass * b * b, 0.2 * mass * (a * a + b * b));
    let omega = Vec3::new(300.0, 40.0, 0.0);
    let momentum = Vec3::new(along * omega.x, across * omega.y, 0.0);
    let end = 0.02;
    let errors: Vec<f64> = [100_u64, 200, 400, 800]
        .map(|steps| {
            let csv = "x,y,z,vx,vy,vz,wx,wy,wz\n0,0,0,0,0,0,300,40,0\n";
            let mut turned = Quat::identity();
            run(&scene(WIDE, STIFF, &shape, end / steps as f64, csv), steps, |sim, _| {
                turned = sim.particles.orientation.as_ref().expect("it turns").quaternion[0];
            });
            let precession = Quat::new(momentum / across * end);
            let own = Quat::new(Vec3::x() * (omega.x * (1.0 - along / across) * end));
            turned.angle_to(&(precession * own))
        })
        .to_vec();
    for order in orders(&errors) {
        assert!(order > 1.9, "{errors:?}: order {order:.2}");
    }
}

/// Far from the origin a drift of 0.6 units in the last place is rounded to whole units, nearly twice as fast. The contact
/// is found when the positions touch, on any number of ranks.
#[test]
fn slow_motion_far_from_the_origin_is_not_overlooked() {
    let far = f64::from(1 << 20);
    let unit = far * f64::EPSILON;
    let (radius, dt, gap) = (0.01, 1e-5, 480.0);
    let more = format!("[domain]\nlow = [{}, -1, -1]\nhigh = [{}, 1, 1]", far - 1.0, far + 1.0);
    // Rounded positions for which the gap of the surfaces is `gap` units.
    let left = far - radius;
    let mut right = far + radius;
    while right - left - 2.0 * radius < gap * unit {
        right += unit;
    }
    let csv =
        format!("x,y,z,vx,vy,vz\n{left:e},0,0,{:e},0,0\n{right:e},0,0,0,0,0\n", 0.6 * unit / dt);
    let scene = scene(&more, ELASTIC, SPHERE, dt, &csv);
    let found: Vec<Vec<u64>> = [1, 2, 3]
        .map(|ranks| {
            threads::run(ranks, |comm| {
                let mut sim = begun(&scene, comm);
                for _ in 0..2000 {
                    sim.step(comm).expect("the step is done");
                    let touching = comm.any(!sim.contacts.is_empty());
                    let positions: Vec<f64> =
                        (0..sim.particles.owned).map(|k| sim.particles.position[k].x).collect();
                    let mut ends = [f64::NEG_INFINITY, f64::NEG_INFINITY];
                    for x in positions {
                        ends = [ends[0].max(x), ends[1].max(-x)];
                    }
                    comm.max(&mut ends);
                    let overlaps = ends[0] + ends[1] < 2.0 * radius;
                    assert_eq!(touching, overlaps, "step {} on {ranks} ranks", sim.step);
                    if touching {
                        return sim.step;
                    }
                }
                panic!("they never meet");
            })
        })
        .to_vec();
    let first = found[0][0];
    assert!(found.iter().flatten().all(|&step| step == first), "{found:?}");
}

fn one(velocity: Vec3) -> Particle {
    Particle { velocity, ..Particle::at_rest(GlobalId(7), ShapeId(0), Vec3::new(0.0, 0.0, 0.5)) }
}

fn fault(result: Result<(), StepError>) -> (u64, Fault) {
    match result.expect_err("it is too far") {
        StepError::Fault { step, fault } => (step, fault),
        error => panic!("another error: {error}"),
    }
}

#[test]
fn a_step_of_more_than_a_radius_stops_with_the_particle_and_a_step_that_works() {
    // The particle falls until a step moves it farther than its radius.
    let (dt, g) = (1e-3, 4000.0);
    let csv = "x,y,z\n0,0,900\n";
    let scene = scene(&format!("gravity = [0, 0, -{g}]\n{WIDE}"), ELASTIC, SPHERE, dt, csv);
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    let mut result = Ok(());
    while result.is_ok() {
        result = sim.step(&mut comm);
    }
    let (step, fault) = fault(result);
    // In step n it moves by g dt² (n - 1/2).
    assert_eq!(step, 4, "{fault}");
    let Fault::Moved { body, moved, works, .. } = fault else { panic!("{fault}") };
    assert_eq!(body, "particle 0");
    assert!((moved - g * dt * dt * 3.5).abs() < 1e-12, "{moved}");
    assert!((works - dt * 0.1 * 0.01 / moved).abs() < 1e-12, "{works}");
}

#[test]
fn a_start_that_is_too_fast_does_not_begin() {
    let mut comm = Alone::default();
    for (csv, shape) in [
        ("x,y,z,vx,vy,vz\n0,0,0,0,0,500\n", SPHERE),
        ("x,y,z,wx,wy,wz\n0,0,0,0,0,11000\n", ELLIPSOID),
    ] {
        let csv = if csv.contains("vx") {
            csv.to_owned()
        } else {
            csv.replace("z,wx", "z,vx,vy,vz,wx").replace("0,0,0,0,0,11000", "0,0,0,0,0,0,0,0,11000")
        };
        let scene = scene(WIDE, ELASTIC, shape, 1e-4, &csv);
        let mut sim = assemble::assemble(&scene, &comm);
        assemble::fill(&mut sim, &scene, &comm);
        let (step, fault) = fault(sim.begin(&mut comm));
        assert_eq!(step, 0);
        assert!(fault.to_string().contains("particle 0"), "{fault}");
    }
    // A speed just below the limit is allowed.
    let scene = scene(WIDE, ELASTIC, SPHERE, 1e-4, "x,y,z,vx,vy,vz\n0,0,0,0,0,99\n");
    begun(&scene, &mut comm);
}

#[test]
fn a_grain_between_walls_that_cross_stops_the_run() {
    let more = "[domain]\nlow = [-1, -1, 0]\nhigh = [1, 1, 1]\nwalls = [\"-z\", \"+z\"]\nwall_velocity = { \"-z\" = [0, 0, 5], \"+z\" = [0, 0, -5] }";
    let scene = scene(more, ELASTIC, SPHERE, 1e-4, "x,y,z\n0,0,0.5\n");
    let mut bench = Bench::of(&scene, &[one(Vec3::zeros())]);
    let mut comm = Alone::default();
    let mut result = Ok(());
    while result.is_ok() && bench.sim.step < 2000 {
        result = bench.sim.step(&mut comm);
    }
    let (_, fault) = fault(result);
    let Fault::Deep { depth, .. } = &fault else { panic!("{fault}") };
    assert!((0.75..0.95).contains(depth), "{depth}");
    assert!(fault.to_string().contains("particle 7 and wall"), "{fault}");
}
