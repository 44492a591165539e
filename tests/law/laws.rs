//! The physics against closed forms and the independent reference, in addition to `benchmarks/verification`. Its short cases cover restitution, free
//! tops, spheres that slide and roll, and small rocking.

use crate::support::random::Draw;
use crate::support::{Bench, at, json, number, scene};
use dem_mpi::ids::ShapeId;
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::particles::columns::Quantity;
use dem_mpi::random::Random;
use nalgebra::Quaternion;
use serde_json::Value;
use std::f64::consts::PI;

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn vector(value: &Value) -> Vec3 {
    Vec3::from_column_slice(&numbers(value))
}

/// Checks a number against the expected one, to a relative tolerance.
fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    let scale = expected.abs().max(1e-300);
    assert!(
        (found - expected).abs() <= tolerance * scale,
        "{what}: {found:e}, expected {expected:e}, off by {:.2e}",
        (found - expected).abs() / scale
    );
}

/// A scene in a wide box; the lattice particle is not used.
fn text(shape: &str, material: &str, more: &str, dt: f64) -> String {
    format!(
        r#"
{more}
[[material]]
name = "m"
{material}
[[shape]]
name = "grain"
{shape}
[time]
step = {dt:e}
allow_unstable = true
"#
    )
}

const OPEN_BOX: &str = "[domain]\nlow = [-1e9, -1e9, -1e9]\nhigh = [1e9, 1e9, 1e9]";

/// Three balls in a row on a floor, at rest except for an upward push: forces are `k` times overlaps. The history's unbalanced force is the mean
/// resultant over the mean contact force. The mean force is over all five contacts. Without a floor the sum over two contacts is divided by three,
/// the number of balls.
#[test]
fn the_history_has_the_mean_force_and_the_unbalanced_one() {
    let (radius, stiffness) = (0.01, 1e5);
    let (left, right, down) = (3e-6, 7e-6, 2e-6);
    for (wall, pressed) in [("\nwalls = [\"-z\"]", down), ("", 0.0)] {
        let domain = "[domain]\nlow = [-1, -1, 0]\nhigh = [1, 1, 1]";
        let text = text(
            &format!("kind = \"sphere\"\nradius = {radius}"),
            &format!("density = 2500\nnormal_stiffness = {stiffness}"),
            &format!("{domain}{wall}"),
            1e-6,
        );
        let place = |x: f64| Vec3::new(x, 0.0, radius - down);
        let mut bench = Bench::new(
            &text,
            &[
                at(0, place(left - 2.0 * radius), Vec3::new(0.01, 0.02, 0.04)),
                at(1, place(0.0), Vec3::new(-0.03, 0.0, 0.0)),
                at(2, place(2.0 * radius - right), Vec3::zeros()),
            ],
        );
        let found = bench.measure();
        let contacts = if pressed > 0.0 { 5.0 } else { 3.0 };
        let mean = stiffness * (left + right + 3.0 * pressed) / contacts;
        let resultants = [left, right - left, right].map(|x: f64| stiffness * x.hypot(pressed));
        let unbalanced = resultants.iter().sum::<f64>() / 3.0 / mean;
        close(found.unbalanced, unbalanced, 1e-9, "unbalanced force");
        close(found.mean_normal_force, 0.5 * stiffness * (left + right), 1e-9, "mean force");
        close(found.largest_speed, 0.01 * 21.0_f64.sqrt(), 1e-14, "largest speed");
        close(found.largest_overlap, right / (2.0 * radius), 1e-9, "largest overlap");
    }
}

#[test]
fn free_motion_is_damped_as_the_discrete_formula_says() {
    for case in json("dem_collision_damping.json")["free_motion"]["cases"].as_array().unwrap() {
        let inputs = &case["inputs"];
        let (xi, dt, g) = (number(&inputs["xi"]), number(&inputs["dt"]), number(&inputs["g"]));
        let sphere = "kind = \"sphere\"\nradius = 10";
        let material = "density = 2650\nnormal_stiffness = 1e5";
        let mut bench = Bench::new(
            &text(
                sphere,
                material,
                &format!("global_damping = {xi}\ngravity = [0, {}, 0]\n{OPEN_BOX}", -g),
                dt,
            ),
            &[at(0, Vec3::zeros(), Vec3::new(1.0, 0.0, 0.0))],
        )
        .with_middle_velocities();
        let mut done = 0;
        for row in case["rows"].as_array().unwrap() {
            let n = row["n"].as_u64().unwrap();
            while done < n {
                bench.step();
                done += 1;
            }
            let particles = &bench.sim.particles;
            // Rounding accumulates over n steps.
            let tolerance = 1e-15 * (n as f64 + 10.0);
            let velocity = bench.middle_velocity(0);
            close(velocity.x, number(&row["v_over_v0"]), tolerance, "v");
            close(particles.position[0].x, number(&row["x_over_v0"]), tolerance, "x");
            close(-velocity.y, number(&row["freefall_v"]), tolerance, "fall v");
            close(-particles.position[0].y, number(&row["freefall_drop"]), tolerance, "drop");
        }
    }
}

#[test]
fn collisions_follow_the_discrete_and_the_continuous_solution() {
    for case in json("dem_collision_damping.json")["collisions"].as_array().unwrap() {
        let inputs = &case["inputs"];
        let get = |key: &str| number(&inputs[key]);
        let (r1, r2) = (get("R1"), get("R2"));
        let shapes = format!(
            "kind = \"sphere\"\nradius = {r1}\n[[shape]]\nname = \"other\"\nkind = \"sphere\"\nradius = {r2}"
        );
        let collide = |dt: f64, xi: f64, restitution: f64| {
            let (density, k) = (get("density"), get("k"));
            let material = format!(
                "density = {density}\nnormal_stiffness = {k}\nrestitution = {restitution:e}"
            );
            let more = format!("global_damping = {xi:e}\n{OPEN_BOX}\n[law]\nlimit_damping = false");
            let mut second = at(1, Vec3::new(r1 + r2, 0.0, 0.0), Vec3::new(get("v2"), 0.0, 0.0));
            second.shape = ShapeId(1);
            Bench::new(
                &text(&shapes, &material, &more, dt),
                &[at(0, Vec3::zeros(), Vec3::new(get("v1"), 0.0, 0.0)), second],
            )
            .with_middle_velocities()
        };
        let overlap = |bench: &Bench| {
            let x = &bench.sim.particles.position;
            let difference = x[bench.slot(1)] - x[bench.slot(0)];
            r1 + r2 - difference.x
        };
        let relative = |bench: &Bench| {
            (bench.middle_velocity(bench.slot(0)) - bench.middle_velocity(bench.slot(1))).x
        };

        for row in case["discrete"].as_array().unwrap() {
            let (dt, xi) = (number(&row["dt"]), number(&row["xi"]));
            let mut bench = collide(dt, xi, 1.0);
            let listed: Vec<Vec<f64>> = row["first_steps_n_overlap_vhalf"]
                .as_array()
                .unwrap()
                .iter()
                .map(numbers)
                .collect();
            let last = row["steps_until_overlap_not_positive"].as_u64().unwrap();
            for n in 1..=last {
                bench.step();
                if let Some(row) = listed.iter().find(|row| row[0] == n as f64) {
                    let largest = number(&case["max_overlap"]);
                    assert!((overlap(&bench) - row[1]).abs() < 1e-9 * largest, "overlap at {n}");
                    close(relative(&bench), row[2], 1e-9, "velocity");
                }
            }
            assert!(overlap(&bench) <= 0.0, "the contact has ended");
            close(-relative(&bench), number(&row["v_rel_after"]), 1e-9, "velocity after");
        }

        // Fine steps approach the continuous solution.
        let dt = number(&case["duration"]) / 4000.0;
        for (list, parameter, expected) in [
            ("damped", "global_xi", "relative_restitution"),
            ("viscous", "restitution", "restitution"),
        ] {
            for row in case[list].as_array().unwrap() {
                let value = number(&row[parameter]);
                let (xi, restitution) = if list == "damped" { (value, 1.0) } else { (0.0, value) };
                let mut bench = collide(dt, xi, restitution);
                let before = relative(&bench);
                loop {
                    bench.step();
                    if overlap(&bench) <= 0.0 {
                        break;
                    }
                }
                let found = -relative(&bench) / before;
                close(found, number(&row[expected]), 2e-3, list);
                let duration = bench.sim.time();
                close(duration, number(&row["duration"]), 2e-3, "duration");
            }
        }
    }
}

#[test]
fn a_free_top_keeps_its_angular_momentum_to_the_last_bit() {
    let reference = json("dem_euler_top.json");
    let axes = vector(&reference["semi_axes"]);
    let shape = format!("kind = \"ellipsoid\"\nsemi_axes = [{}, {}, {}]", axes.x, axes.y, axes.z);
    let inertia = vector(&reference["inertia"]);
    for case in reference["cases"].as_array().unwrap() {
        let q = numbers(&case["quaternion0"]);
        let orientation = Quat::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
        let omega = vector(&case["omega0_body"]);
        let momentum = orientation * inertia.component_mul(&omega);
        let material = "density = 1\nnormal_stiffness = 1";
        let mut top = at(0, Vec3::zeros(), Vec3::zeros());
        top.quaternion = orientation;
        top.angular_momentum = momentum;
        let mut bench = Bench::new(&text(&shape, material, OPEN_BOX, 1e-3), &[top]);
        for _ in 0..5000 {
            bench.step();
        }
        let particles = &bench.sim.particles;
        assert_eq!(particles.spin.as_ref().unwrap().angular_momentum[0], momentum);
        let q = particles.orientation.as_ref().unwrap().quaternion[0];
        assert!((q.norm() - 1.0).abs() < 1e-15, "quaternions stay unit");
        assert!(orientation.angle_to(&q) > 0.1, "it turns");
    }
}

#[test]
fn damped_spin_follows_the_discrete_formula() {
    let (xi, dt) = (3.0, 1e-3);
    let material = "density = 1\nnormal_stiffness = 1";
    let mut top = at(0, Vec3::zeros(), Vec3::zeros());
    top.angular_momentum = Vec3::new(1.0, 2.0, 3.0);
    let mut bench = Bench::new(
        &text(
            "kind = \"ellipsoid\"\nsemi_axes = [1, 1, 1]",
            material,
            &format!("global_damping = {xi}\n{OPEN_BOX}"),
            dt,
        ),
        &[top],
    );
    let before = bench.sim.particles.angular_velocity(0).norm();
    for _ in 0..1000 {
        bench.step();
    }
    let after = bench.sim.particles.angular_velocity(0).norm();
    let factor = ((1.0 - 0.5 * xi * dt) / (1.0 + 0.5 * xi * dt)).powi(1000);
    close(after, before * factor, 1e-12, "spin");
}

/// A floor under gravity that is tilted by `slope` [rad] about y; +x points down the slope.
fn slope(shape: &str, material: &str, slope: f64, dt: f64) -> String {
    let g = 9.81;
    let more = format!(
        "gravity = [{:e}, 0, {:e}]\n{OPEN_BOX}\n[[wall]]\nname = \"floor\"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\nmaterial = \"m\"",
        g * slope.sin(),
        -g * slope.cos()
    );
    text(shape, material, &more, dt)
}

#[test]
fn a_block_on_a_slope_slides_and_stops_as_coulomb_says() {
    // A block does not roll: it is a sphere with an enormous moment of inertia.
    for case in json("dem_sliding_rolling.json")["block_on_plane"].as_array().unwrap() {
        let get = |key: &str| case[key].as_f64();
        let angle = get("slope_deg").unwrap().to_radians();
        let material = format!(
            "density = 2650\nnormal_stiffness = 1e5\ntangential_stiffness = 1e5\nfriction = {}",
            get("mu").unwrap()
        );
        let mass = 2650.0 * 4.0 / 3.0 * PI * 1e-6;
        let z = 0.01 - mass * 9.81 * angle.cos() / 1e5;
        let v0 = get("v0").unwrap();
        let text = slope("kind = \"sphere\"\nradius = 0.01", &material, angle, 1e-5);
        let scene = crate::support::scene(&text);
        let mut bench =
            Bench::heavy_to_turn(&scene, &[at(0, Vec3::new(0.0, 0.0, z), Vec3::new(v0, 0.0, 0.0))]);
        let mut at_tenth = None;
        while bench.sim.time() < 0.9 {
            bench.step();
            if at_tenth.is_none() && bench.sim.time() >= 0.1 {
                at_tenth = Some(bench.sim.particles.velocity[0].x);
            }
        }
        let stays = case["stays_at_rest"].as_bool().unwrap();
        let velocity = bench.sim.particles.velocity[0].x;
        if v0 > 0.0 || !stays {
            let expected = get("v_at_0.1s_if_sliding").unwrap();
            // Until the tangential spring is stretched, for 0.4 ms, friction is less than Coulomb's.
            close(at_tenth.unwrap(), expected, 3e-3, "velocity at 0.1 s");
        }
        if let Some(distance) = get("stop_distance") {
            // It stops, and then oscillates on its spring.
            close(bench.sim.particles.position[0].x, distance, 1e-3, "distance");
        } else if stays {
            assert!(bench.sim.particles.position[0].x.abs() < 1e-5, "it stays");
        } else {
            close(velocity / 0.9, get("initial_acceleration").unwrap(), 1e-3, "acceleration");
        }
    }
}

/// A body slides until its dashpot carries the friction force: at `v = c a / k` with the deceleration `a` of its surface. The remaining energy of
/// that motion and of the spring goes to the dashpot, as does a part before sliding begins. All else goes to friction. The effective mass at the
/// surface of a sphere is 2/7 of its mass, slightly more under an overlap.
#[test]
fn friction_and_tangential_dashpots_take_what_closed_forms_say() {
    let (density, friction, g, radius) = (2500.0, 0.3_f64, 9.81, 0.01_f64);
    let sphere = "kind = \"sphere\"\nradius = 0.01";
    let plate = "kind = \"polyhedron\"\nedges = [0.04, 0.04, 0.01]";
    let springs = "restitution = 0.3\nnormal_stiffness = 1e4\ntangential_stiffness = 1e3\ntangential_damping_ratio = 0.3";
    let (youngs, poisson) = (1e5, 0.3);
    let restitution = 0.95_f64;
    let ratio_of_hertz = 2.0 * -restitution.ln() / restitution.ln().hypot(PI);
    let hertz = format!(
        "restitution = {restitution}\nyoungs_modulus = {youngs}\npoisson_ratio = {poisson}"
    );
    let with_plate = format!("\n[[shape]]\nname = \"plate\"\n{plate}");
    for (what, shapes, law, constants) in [
        ("sphere", &[sphere][..], "", springs),
        ("plate", &[plate], "", springs),
        ("sphere in a scene with plates", &[sphere, &with_plate], "", springs),
        (
            "sphere after Hertz and Mindlin",
            &[sphere],
            "normal = \"hertz\"\nlargest_overlap = 0.1",
            &hertz,
        ),
    ] {
        let material = format!("density = {density}\nfriction = {friction}\n{constants}");
        let rolls = shapes[0] == sphere;
        let volume = if rolls { 4.0 / 3.0 * PI * 1e-6 } else { 0.04 * 0.04 * 0.01 };
        let weight = density * volume * g;
        let (overlap, stiffness) = if law.is_empty() {
            (weight / 1e4, 1e3)
        } else {
            let modulus = 0.5 * youngs / (1.0 - poisson * poisson);
            let overlap = (0.75 * weight / (modulus * radius.sqrt())).powf(2.0 / 3.0);
            let shear = 0.25 * youngs / ((2.0 - poisson) * (1.0 + poisson));
            (overlap, 8.0 * shear * (radius * overlap).sqrt())
        };
        let more = format!(
            "gravity = [0, 0, {:e}]\n{OPEN_BOX}\n[law]\n{law}\n[[wall]]\nname = \"floor\"\npoint = [0, 0, 0]\n\
             normal = [0, 0, 1]\nmaterial = \"m\"",
            -g
        );
        let height = if rolls { radius } else { 0.005 };
        let speed = 0.1;
        let start = at(0, Vec3::new(0.0, 0.0, height - overlap), Vec3::new(speed, 0.0, 0.0));
        let mut bench = Bench::new(&text(&shapes.concat(), &material, &more, 2e-6), &[start]);
        let mut taken = |time: f64| {
            while bench.sim.time() < time {
                bench.step();
            }
            let measures = bench.measure();
            [Quantity::OfTangentialDashpots, Quantity::OfFriction].map(|by| measures.taken_by(by))
        };
        let ([until_it_slides, _], [of_dashpots, of_friction]) = (taken(0.005), taken(0.8));
        let mass = weight / g;
        let lever = 1.0 - 0.5 * overlap / radius;
        let of_surface = if rolls { mass / (1.0 + 2.5 * lever * lever) } else { mass };
        let energy = 0.5 * of_surface * speed * speed;
        let limit = friction * weight;
        let ratio = if law.is_empty() { 0.6 } else { ratio_of_hertz * (5.0_f64 / 6.0).sqrt() };
        let dashpot = ratio * (mass * stiffness).sqrt();
        let last = dashpot * limit / of_surface / stiffness;
        let left =
            0.5 * of_surface * last * last + (limit - dashpot * last).powi(2) / (2.0 * stiffness);
        assert!(left > 0.02 * energy && left < 0.5 * energy, "{what}: {left:e} of {energy:e} J");
        let later = of_dashpots - until_it_slides;
        // A plate tilts a little while it slides.
        let tolerance = if rolls { 1e-3 } else { 1e-2 };
        println!(
            "{what}: to dashpots {:.1e}, to friction {:.1e}",
            later / left - 1.0,
            of_friction / (energy - left - until_it_slides) - 1.0,
        );
        close(later, left, tolerance, &format!("{what}, to tangential dashpots"));
        let rest = energy - left - until_it_slides;
        close(of_friction, rest, tolerance, &format!("{what}, to friction"));
    }
}

#[test]
fn an_ellipsoid_rocks_far_as_the_reference_does() {
    for case in json("dem_rocking.json")["cases"].as_array().unwrap() {
        let inputs = &case["inputs"];
        let axes = vector(&inputs["semi_axes"]);
        let far = &case["large_amplitude_frictionless"];
        let shape =
            format!("kind = \"ellipsoid\"\nsemi_axes = [{}, {}, {}]", axes.x, axes.y, axes.z);
        let material = format!(
            "density = {}\nnormal_stiffness = {}",
            number(&inputs["density"]),
            number(&inputs["kn"])
        );
        let mut body = at(0, Vec3::new(0.0, 0.0, number(&far["z0"])), Vec3::zeros());
        body.quaternion = Quat::new(Vec3::y() * number(&far["theta0"]));
        let (times, angles, heights) =
            (numbers(&far["t"]), numbers(&far["theta"]), numbers(&far["z"]));
        let dt = times[1] / 5000.0;
        let mut bench = Bench::new(&slope(&shape, &material, 0.0, dt), &[body]);
        for ((time, angle), height) in times.iter().zip(angles).zip(heights) {
            while bench.sim.time() < time - 0.5 * dt {
                bench.step();
            }
            let q = bench.sim.particles.orientation.as_ref().unwrap().quaternion[0];
            let found = 2.0 * q.imag().y.asin();
            assert!((found - angle).abs() < 2e-4, "angle {found} at {time} s, expected {angle}");
            close(bench.sim.particles.position[0].z, height, 2e-5, "height");
        }
    }
}

/// Oblique impacts with friction, dashpots and spin: the energy loss equals the dissipation, with short steps and with 40 steps a contact.
#[test]
fn energy_is_accounted_for_in_a_collision_with_everything_in_it() {
    let ball = "kind = \"sphere\"\nradius = 0.01";
    let egg = "kind = \"ellipsoid\"\nsemi_axes = [0.012, 0.01, 0.008]";
    let springs =
        "normal_stiffness = 1e5\ntangential_stiffness = 8e4\ntangential_damping_ratio = 0.1";
    let elastic = "youngs_modulus = 1e7\npoisson_ratio = 0.25";
    for (shape, law, constants, may_miss) in [
        (ball, "", springs, [1e-12; 2]),
        (ball, "[law]\nnormal = \"hertz\"\n", elastic, [1e-12; 2]),
        (egg, "", springs, [1e-7, 5e-6]),
        (egg, "[law]\nnormal = \"hertz\"\n", elastic, [1e-6, 2e-4]),
    ] {
        for (dt, may_miss) in [5e-7, 2e-5].into_iter().zip(may_miss) {
            let material =
                format!("density = 2650\n{constants}\nfriction = 0.3\nrestitution = 0.6");
            let mut first = at(0, Vec3::zeros(), Vec3::new(1.0, 0.2, 0.0));
            first.angular_momentum = Vec3::new(1e-5, -2e-5, 3e-5);
            let mut second = at(1, Vec3::new(0.0245, 0.002, 0.001), Vec3::new(-0.5, -0.3, 0.1));
            second.quaternion = Quat::new_normalize(Quaternion::new(0.9, 0.1, -0.3, 0.2));
            let scene = text(shape, &material, &(law.to_owned() + OPEN_BOX), dt);
            let mut bench = Bench::new(&scene, &[first, second]);
            let mut touched = false;
            while bench.sim.time() < 0.01 {
                bench.step();
                touched |= !bench.sim.contacts.is_empty();
            }
            let m = bench.measure();
            assert!(touched && m.contacts == 0, "they met and parted");
            assert!(m.dissipated > 0.02 * m.received, "something was lost: {m:?}");
            let missing = m.missing().abs() / m.dissipated;
            println!("{shape:?} {law:?} {dt:e}: missing {missing:e}");
            assert!(
                missing < may_miss,
                "{shape:?} {law:?}, steps of {dt:e} s: missing {missing:e}"
            );
        }
    }
}

/// Growth of the kinetic energy of a crystal in a thousand steps of this fraction of the stable limit. Each ball has twelve neighbours, and in the
/// fastest mode all rotate alike.
fn growth_in_a_crystal(law: &str, damping: &str, part: f64) -> f64 {
    const CELLS: i32 = 3;
    let (radius, overlap) = (0.01, 1e-5);
    let edge = 2f64.sqrt() * (2.0 * radius - overlap);
    let width = f64::from(CELLS) * edge;
    let material = format!("density = 2650\nnormal_stiffness = 1e5\nfriction = 1e3\n{damping}");
    let domain = format!(
        "{law}\n[domain]\nlow = [0, 0, 0]\nhigh = [{width}, {width}, {width}]\nperiodic = [true, true, true]"
    );
    let text = text("kind = \"sphere\"\nradius = 0.01", &material, &domain, 1.0);
    let mut scene = crate::support::scene(&text);
    scene.dt = part * scene.time_step_limit().expect("balls have a limit").dt;

    let mut random = Random::of(1, 0);
    let mut balls = Vec::new();
    for cell in 0..CELLS.pow(3) {
        let corner = [cell % CELLS, cell / CELLS % CELLS, cell / CELLS.pow(2)].map(f64::from);
        for place in [[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]] {
            let position = (Vec3::from(corner) + Vec3::from(place)) * edge;
            let mut ball = at(balls.len() as u64, position, random.vector(-1e-8, 1e-8));
            ball.angular_velocity = random.vector(-2e-6, 2e-6);
            balls.push(ball);
        }
    }
    let mut bench = Bench::of(&scene, &balls);
    let before = bench.measure();
    assert_eq!(before.contacts, 6 * before.particles);
    for _ in 0..1000 {
        if bench.try_step().is_err() {
            return f64::INFINITY;
        }
    }
    bench.measure().kinetic() / before.kinetic()
}

#[test]
fn the_stable_step_is_stable_in_a_crystal_and_nearly_the_longest() {
    // Largest final energy below the limit, and a step that is too long.
    let dashpots = [
        ("", 10.0, 1.05),
        ("tangential_damping_ratio = 0.1", 0.1, 1.05),
        ("tangential_damping_ratio = 0.5", 0.1, 1.2),
        ("restitution = 0.5\ntangential_damping_ratio = 0.5", 0.1, 1.5),
        ("restitution = 0.1", 1.0, 2.0),
    ];
    for (damping, most, too_long) in dashpots {
        let growth = growth_in_a_crystal("", damping, 0.99);
        assert!(growth < most, "{damping}: {growth:e}");
        let growth = growth_in_a_crystal("", damping, too_long);
        assert!(growth > 1e3, "{damping}, {too_long} times the limit: {growth:e}");
        let growth = growth_in_a_crystal("[law]\nforesee = true", damping, 0.99);
        assert!(growth < most, "{damping}, foreseen: {growth:e}");
    }
}

/// Two balls, too soft, whose centres pass each other within a step, so that the normal reverses.
#[test]
fn a_contact_that_turns_right_round_stays_a_number() {
    let material = "density = 2650\nnormal_stiffness = 1e5\nfriction = 0.3";
    let shape = "kind = \"sphere\"\nradius = 0.01";
    let velocity = Vec3::new(99.0, 0.0, 0.0);
    let balls = [at(0, Vec3::zeros(), velocity), at(1, Vec3::new(0.012, 0.0, 0.0), -velocity)];
    let mut bench = Bench::new(&text(shape, material, OPEN_BOX, 1e-4), &balls);
    bench.step();
    let (first, second) = (bench.slot(0), bench.slot(1));
    let particles = &bench.sim.particles;
    assert!(particles.position[first].x > particles.position[second].x, "they have passed");
    let force = particles.force[first].vector;
    assert!(force.norm().is_finite(), "{force}");
    assert!(force.x > 0.0, "and part");
}

/// A servo relies on the derivative of the force by the overlap, checked by central differences. It also uses the dashpot's force over the
/// displacement of a step. Closed form of the dashpots: critical damping of the stiffness at this overlap, `2 β √(m* k)`, times the root of 5/6 for
/// elastic spheres.
#[test]
fn the_stiffness_of_a_contact_is_that_of_its_force() {
    let elastic = "density = 2500\nyoungs_modulus = 2e6\npoisson_ratio = 0.3\nrestitution = 0.5";
    let cases = [
        (
            "limit_damping = false\n",
            "density = 2500\nnormal_stiffness = 1e4\nrestitution = 0.5".to_owned(),
            1.0,
        ),
        ("limit_damping = false\nnormal = \"hertz\"\n", elastic.to_owned(), (5.0_f64 / 6.0).sqrt()),
        (
            "limit_damping = false\nnormal = \"hertz\"\nadhesion = \"dmt\"\n",
            format!("{elastic}\nsurface_energy = 0.1"),
            (5.0_f64 / 6.0).sqrt(),
        ),
        (
            "normal = \"hertz\"\nadhesion = \"jkr\"\n",
            format!("{elastic}\nsurface_energy = 1e-9"),
            (5.0_f64 / 6.0).sqrt(),
        ),
    ];
    for (law, material, factor) in cases {
        let more = format!("[law]\n{law}{OPEN_BOX}");
        let scene = scene(&text("kind = \"sphere\"\nradius = 0.01", &material, &more, 1e-6));
        let stiff_and_force = |overlap: f64, dt: f64| {
            let other = at(1, Vec3::new(0.0, 0.0, 0.02 - overlap), Vec3::zeros());
            let bench = Bench::of(&scene, &[at(0, Vec3::zeros(), Vec3::zeros()), other]);
            let (law, particles) = (&bench.sim.law, &bench.sim.particles);
            let (pair, geometry) = bench.sim.contacts.iter().next().expect("they touch");
            [law.stiffness(pair, particles, geometry, dt), law.elastic(pair, particles, geometry)]
        };
        let (overlap, small) = (1e-4, 1e-8);
        let [low, high] = [overlap - small, overlap + small];
        let slope = (stiff_and_force(high, 1.0)[1] - stiff_and_force(low, 1.0)[1]) / (2.0 * small);
        let [spring, _] = stiff_and_force(overlap, f64::INFINITY);
        close(spring, slope, 1e-4, law);
        let [both, _] = stiff_and_force(overlap, 1e-6);
        let mass = 0.5 * 2500.0 * 4.0 / 3.0 * PI * 0.01_f64.powi(3);
        let damping = 0.5_f64.ln().abs() / 0.5_f64.ln().hypot(PI);
        close((both - spring) * 1e-6, factor * 2.0 * damping * (mass * slope).sqrt(), 1e-4, law);
    }
}
