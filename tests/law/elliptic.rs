//! Impacts of ellipsoids by Hertz's law: restitution, energy and invariances. The exact elliptic solution is in
//! `benchmarks/verification/cases/elliptic.rs`.

use crate::support::{Bench, at, close};
use dem_mpi::math::{Mat3, Quat, Vec3};
use dem_mpi::particles::records::Particle;
use dem_mpi::random::Random;

const YOUNGS: f64 = 5e9;
const POISSON: f64 = 0.25;
const DENSITY: f64 = 2500.0;
/// Unit of length [m].
const MM: f64 = 1e-3;

/// Scene for a few particles of a shape above a rigid floor.
pub(crate) fn text(shape: &str, contact: &str, law: &str, step: f64) -> String {
    format!(
        r#"
[law]
normal = "hertz"
{law}
[domain]
low = [-0.05, -0.05, 0.0]
high = [0.05, 0.05, 0.1]
walls = ["-z"]
wall_material = "rigid"
[[material]]
name = "m"
density = {DENSITY:e}
youngs_modulus = {YOUNGS:e}
poisson_ratio = {POISSON}
{contact}
[[material]]
name = "rigid"
density = 1.0
youngs_modulus = 7e20
poisson_ratio = 0.0
{contact}
[[shape]]
name = "grain"
material = "m"
{shape}
[time]
step = {step:e}
"#
    )
}

const LONG: &str = "kind = \"ellipsoid\"\nsemi_axes = [0.002, 0.001, 0.001]";

/// Impacts give the requested restitution, with and without the limit on attraction.
#[test]
fn restitution_of_ellipsoids_is_exact() {
    let step = 2e-9;
    for limited in [true, false] {
        for restitution in [0.2, 0.5, 0.8, 0.98] {
            let contact = format!("restitution = {restitution}");
            let law = format!("limit_damping = {limited}");
            let text = text(LONG, &contact, &law, step);
            let mut bench = Bench::new(&text, &[at(0, Vec3::new(0.0, 0.0, MM), Vec3::z() * -0.5)]);
            for _ in 0..100_000 {
                bench.step();
                if bench.sim.particles.position[0].z > MM {
                    break;
                }
            }
            let found = bench.sim.particles.velocity[0].z / 0.5;
            close(found, restitution, 1e-3, &format!("limited {limited}"));
        }
    }
}

/// Two particles on a random collision course, with the first one's id given, all rotated by `turn`.
pub(crate) fn meeting(
    k: u64,
    shape: &str,
    first: u64,
    turn: &Quat,
    slanted: f64,
    text: &str,
) -> Bench {
    let mut random = Random::of(17, k);
    let mut bodies = [0, 1].map(|id| {
        let mut body = at(if id == 0 { first } else { 1 - first }, Vec3::zeros(), Vec3::zeros());
        body.quaternion = random.rotation();
        body
    });
    let scene = crate::support::scene(text);
    assert!(text.contains(shape));
    let shape = &scene.library.shapes[0];
    let normal = random.rotation() * Vec3::x();
    let side = normal.cross(&(random.rotation() * Vec3::x())).normalize();
    let velocity = (normal * slanted.cos() + side * slanted.sin()) * 0.5;
    let support = |body: &Particle, way: &Vec3| {
        body.quaternion * shape.support(&body.quaternion.inverse_transform_vector(way))
    };
    // A small gap, as exact touch would leave the beginning to rounding.
    let r = support(&bodies[0], &normal) - support(&bodies[1], &-normal) + normal * 1.3e-7;
    let inertia = scene.library.inertia[0];
    for (body, sign) in bodies.iter_mut().zip([1.0, -1.0]) {
        body.position = r * (-0.5 * sign);
        body.velocity = velocity * (0.5 * sign);
        body.angular_velocity = (random.rotation() * Vec3::x()) * 8.0;
        let frame = body.quaternion.to_rotation_matrix().into_inner();
        body.angular_momentum =
            frame * Mat3::from_diagonal(&inertia) * frame.transpose() * body.angular_velocity;
    }
    for body in &mut bodies {
        body.position = turn * body.position + Vec3::new(0.0, 0.0, 0.05);
        body.velocity = turn * body.velocity;
        body.quaternion = turn * body.quaternion;
        body.angular_velocity = turn * body.angular_velocity;
        body.angular_momentum = turn * body.angular_momentum;
    }
    bodies.sort_by_key(|body| body.id);
    Bench::of(&scene, &bodies)
}

/// Runs until the particles have separated. Returns the relative change of the energy and the relative energy error.
fn change_of_energy(bench: &mut Bench) -> [f64; 2] {
    change_in(400_000, bench).expect("they meet and part")
}

/// Change of energy and energy error, or `None` if they do not meet and separate in `steps` steps.
pub(crate) fn change_in(steps: u32, bench: &mut Bench) -> Option<[f64; 2]> {
    let before = bench.measure();
    let total = before.mechanical();
    let mut touched = false;
    for _ in 0..steps {
        bench.step();
        let touches = !bench.sim.contacts.is_empty();
        if touched && !touches {
            let after = bench.measure();
            return Some([after.mechanical() / total - 1.0, after.missing() / total]);
        }
        touched |= touches;
    }
    None
}

/// Approximate contact time of the long ellipsoids at 0.5 m/s [s].
const TIME: f64 = 5e-5;

/// Oblique impacts without losses conserve their energy, to second order in the step or better, also over the crests of
/// superellipsoids.
#[test]
fn oblique_impacts_keep_their_energy() {
    let triaxial = "kind = \"ellipsoid\"\nsemi_axes = [0.0015, 0.001, 0.0006]";
    let blunt =
        "kind = \"superellipsoid\"\nsemi_axes = [0.0015, 0.001, 0.001]\nexponents = [0.8, 0.8]";
    let pointed =
        "kind = \"superellipsoid\"\nsemi_axes = [0.0015, 0.001, 0.001]\nexponents = [1.2, 1.3]";
    let edged =
        "kind = \"superellipsoid\"\nsemi_axes = [0.0015, 0.001, 0.001]\nexponents = [0.6, 1.3]";
    for shape in [LONG, triaxial, blunt, pointed, edged] {
        let worst = |steps: f64| {
            let text = text(shape, "", "tangential = \"none\"", TIME / steps);
            let changes = (0..12).map(|k| {
                let mut bench = meeting(k, shape, 0, &Quat::identity(), 0.7, &text);
                change_of_energy(&mut bench)[0].abs()
            });
            changes.fold(0.0, f64::max)
        };
        let found = [250.0, 500.0, 1000.0, 2000.0].map(worst);
        println!("{shape}: energy off by {found:?} in 250, 500, 1000, 2000 steps");
        assert!(found[3] < 1e-6 && found[3] < 0.2 * found[1], "{found:?}");
    }
}

/// Grazing impacts with friction of 0.5 create no energy, and all losses are booked.
#[test]
fn grazing_impacts_make_no_energy() {
    for contact in ["friction = 0.5", "friction = 0.5\nrestitution = 0.6"] {
        for degrees in [20.0_f64, 50.0, 76.0, 85.0] {
            let text = text(LONG, contact, "", TIME / 2000.0);
            for k in 0..6 {
                let slanted = degrees.to_radians();
                let mut bench = meeting(k, LONG, 0, &Quat::identity(), slanted, &text);
                let [gained, missing] = change_of_energy(&mut bench);
                println!("{contact}, {degrees} degrees, {k}: {gained:.2e}, missing {missing:.1e}");
                assert!(gained < 1e-6, "{contact}, {degrees} degrees, {k}: {gained:e}");
                assert!(missing.abs() < 1e-5, "{contact}, {degrees} degrees, {k}: {missing:e}");
            }
        }
    }
}

/// Position, velocity, and angular velocity of both particles, beginning with the first.
fn state(bench: &Bench, first: u64) -> Vec<Vec3> {
    let particles = &bench.sim.particles;
    let spin = particles.spin.as_ref().expect("they turn");
    [first, 1 - first]
        .into_iter()
        .flat_map(|id| {
            let slot = bench.slot(id);
            [particles.position[slot], particles.velocity[slot], spin.angular_velocity[slot]]
        })
        .collect()
}

/// Neither the ids of the particles nor the orientation in space matters.
#[test]
fn names_and_axes_do_not_matter() {
    let text = text(LONG, "friction = 0.5\nrestitution = 0.6", "", TIME / 500.0);
    let turn = Quat::from_scaled_axis(Vec3::new(0.3, -0.8, 1.1));
    for k in 0..4 {
        let run = |first: u64, turn: &Quat| {
            let mut bench = meeting(k, LONG, first, turn, 0.9, &text);
            change_of_energy(&mut bench);
            state(&bench, first)
        };
        let expected = run(0, &Quat::identity());
        let swapped = run(1, &Quat::identity());
        let middle = Vec3::new(0.0, 0.0, 0.05);
        let turned = run(0, &turn);
        for (k, expected) in expected.iter().enumerate() {
            let size = if k % 3 == 0 { 1e-3 } else { expected.norm() };
            assert!((swapped[k] - expected).norm() < 1e-9 * size, "{k}: {} {expected}", swapped[k]);
            let expected =
                if k % 3 == 0 { turn * (expected - middle) + middle } else { turn * expected };
            assert!((turned[k] - expected).norm() < 1e-9 * size, "{k}: {} {expected}", turned[k]);
        }
    }
}

/// Ellipsoids with equal axes have the forces of spheres.
#[test]
fn spheres_are_spheres_under_any_name() {
    let shapes = [
        "kind = \"sphere\"\nradius = 0.001",
        "kind = \"ellipsoid\"\nsemi_axes = [0.001, 0.001, 0.001]",
    ];
    let [spheres, ellipsoids] = shapes.map(|shape| {
        let text = text(shape, "friction = 0.3\nrestitution = 0.7", "", 1e-7);
        let mut bench = meeting(2, shape, 0, &Quat::identity(), 0.6, &text);
        (0..300)
            .map(|_| {
                bench.step();
                Vec3::from(bench.sim.particles.force[0].vector)
            })
            .collect::<Vec<_>>()
    });
    let largest = spheres.iter().map(Vec3::norm).fold(0.0, f64::max);
    assert!(largest > 0.0 && spheres.last() == Some(&Vec3::zeros()), "they meet and part");
    for (step, (one, other)) in spheres.iter().zip(&ellipsoids).enumerate() {
        assert!((one - other).norm() < 1e-11 * largest, "step {step}: {one} {other}");
    }
}
