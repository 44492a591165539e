//! Adhesion after Johnson, Kendall and Roberts against closed forms: pull-off, separation, loss of a cycle, friction.

use crate::support::{Bench, ball, close, expect_refused, scene, schedule, slides_beyond};
use dem_mpi::comm::alone::Alone;
use dem_mpi::law::hertz::jkr::{END, Sticking};
use dem_mpi::law::stability::time_step_limit;
use dem_mpi::math::Vec3;
use dem_mpi::particles::columns::Quantity;
use dem_mpi::scene::plan::plan;
use dem_mpi::sim::audit::{Auditor, Settings};
use dem_mpi::sim::run::run;
use std::f64::consts::PI;

const RADIUS: f64 = 1e-4;
const SMALL: f64 = 6e-5;
const DENSITY: f64 = 2500.0;
/// Work of adhesion [J/m²].
const WORK: f64 = 0.1;
/// `E*` of two of the spheres [Pa].
const MODULUS: f64 = 0.5 * 1e8 / (1.0 - 0.09);

/// Balls of both sizes over the floor z = 0.
fn text(own: &str, density: f64, step: f64) -> String {
    format!(
        r#"
[law]
normal = "hertz"
adhesion = "jkr"
largest_overlap = 0.1
[[material]]
name = "m"
density = {density}
surface_energy = 0.05
youngs_modulus = 1e8
poisson_ratio = 0.3
{own}
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS}
[[shape]]
name = "small"
kind = "sphere"
radius = {SMALL}
[time]
step = {step:e}
"#
    )
}

fn mass(radius: f64, density: f64) -> f64 {
    density * 4.0 / 3.0 * PI * radius.powi(3)
}

/// `a_0²/R*`, the unit of overlaps [m].
fn depth(reduced: f64) -> f64 {
    (2.0 * PI * WORK / MODULUS).powf(2.0 / 3.0) * reduced.cbrt()
}

/// Energy lost between touch and separation without dashpots [J] (Thornton and Ning 1998).
fn lost(reduced: f64) -> f64 {
    let parts = 0.6 * (2.0 * PI).powf(2.0 / 3.0) + 0.4 * (PI / 8.0).powf(2.0 / 3.0);
    PI * parts * (WORK.powi(5) * reduced.powi(4) / MODULUS.powi(2)).cbrt()
}

/// A ball that moves onto the floor, or two balls of different size that approach with a relative speed, just before touch. Returns the
/// simulation, the reduced radius and the reduced mass.
fn thrown(with_floor: bool, own: &str, density: f64, speed: f64, step: f64) -> (Bench, f64, f64) {
    thrown_from(1e-12, with_floor, own, density, speed, step)
}

/// The bodies of `thrown`, with a gap [m] between their surfaces.
fn thrown_from(
    gap: f64,
    with_floor: bool,
    own: &str,
    density: f64,
    speed: f64,
    step: f64,
) -> (Bench, f64, f64) {
    let scene = text(own, density, step);
    if with_floor {
        let start = Vec3::new(0.0, 0.0, RADIUS + gap);
        let one = ball(0, 0, start, Vec3::new(0.0, 0.0, -speed));
        return (Bench::new(&scene, &[one]), RADIUS, mass(RADIUS, density));
    }
    let (m1, m2) = (mass(RADIUS, density), mass(SMALL, density));
    let reduced_mass = m1 * m2 / (m1 + m2);
    let apart = RADIUS + SMALL + gap;
    let at = |x: f64| Vec3::new(x, 0.02, 0.5);
    let pair = [
        ball(0, 0, at(0.0), Vec3::x() * (speed * reduced_mass / m1)),
        ball(1, 1, at(apart), -Vec3::x() * (speed * reduced_mass / m2)),
    ];
    let reduced = 1.0 / (1.0 / RADIUS + 1.0 / SMALL);
    (Bench::new(&scene, &pair), reduced, reduced_mass)
}

/// Overlap of the only contact [m].
fn overlap(bench: &Bench) -> Option<f64> {
    bench.sim.contacts.iter().next().map(|(_, geometry)| geometry.overlap)
}

/// Runs through an impact. Returns the last overlap, and whether the contact has ended.
fn through(bench: &mut Bench, steps: u32) -> (f64, bool) {
    let mut last = 0.0;
    let mut touched = false;
    for _ in 0..steps {
        bench.step();
        match overlap(bench) {
            Some(now) => (last, touched) = (now, true),
            None if touched => return (last, true),
            None => {}
        }
    }
    (last, false)
}

/// The contact ends at the gap of the theory, and the loss is `7.09 (w⁵ R*⁴/E*²)^(1/3)` at any speed. All of it is booked.
#[test]
fn a_loop_loses_what_the_theory_says_and_ends_at_its_gap() {
    for with_floor in [true, false] {
        let reduced = if with_floor { RADIUS } else { 1.0 / (1.0 / RADIUS + 1.0 / SMALL) };
        for energies in [1.5, 6.0] {
            let of = |speed, step| thrown(with_floor, "", DENSITY, speed, step);
            let (_, _, reduced_mass) = of(1.0, 1e-9);
            let speed = (2.0 * energies * lost(reduced) / reduced_mass).sqrt();
            let step = 2e-4 * depth(reduced) / speed;
            let (mut bench, _, _) = of(speed, step);
            let before = bench.measure();
            let (last, ended) = through(&mut bench, 400_000);
            assert!(ended, "it leaves");
            bench.step();
            let after = bench.measure();
            let gap = 0.75 * (PI * PI * WORK * WORK * reduced / (MODULUS * MODULUS)).cbrt();
            close(-last, gap, 1e-3, "gap at the end");
            let kinetic = before.kinetic() - after.kinetic();
            close(kinetic, lost(reduced), 1e-3, "kinetic energy lost");
            close(after.dissipated, lost(reduced), 1e-3, "booked");
            close(after.taken_by(Quantity::OfAdhesion), lost(reduced), 1e-12, "to adhesion");
            assert!(
                after.of_normal_dashpots().abs() < 1e-3 * lost(reduced),
                "{} J",
                after.of_normal_dashpots()
            );
            assert!(after.stored == 0.0, "{} J", after.stored);
        }
    }
}

/// A contact across a gap is no error of the audit, and attractive forces count like repulsive ones.
#[test]
fn an_audit_knows_contacts_across_a_gap() {
    for with_floor in [true, false] {
        let reduced = if with_floor { RADIUS } else { 1.0 / (1.0 / RADIUS + 1.0 / SMALL) };
        let (_, _, reduced_mass) = thrown(with_floor, "", DENSITY, 1.0, 1e-9);
        let speed = (2.0 * 1.5 * lost(reduced) / reduced_mass).sqrt();
        let step = 2e-3 * depth(reduced) / speed;
        let (mut bench, _, _) = thrown(with_floor, "", DENSITY, speed, step);
        bench.sim.audit = Auditor::new(Settings { every: 1, contacts: Some(100), seed: 1 });
        let (mut steps, mut across, mut sizes) = (0, 0, 0.0);
        loop {
            bench.step();
            let Some(overlap) = overlap(&bench) else { break };
            bench.sim.audit(&mut Alone::default());
            (steps, across) = (steps + 1, across + u64::from(overlap < 0.0));
            let sim = &bench.sim;
            let mut pairs = sim.contacts.iter();
            sizes += pairs.next().map_or(0.0, |(pair, geometry)| {
                sim.law.elastic(pair, &sim.particles, geometry).abs()
            });
        }
        assert!(across > 100, "{across} of {steps} steps across a gap");
        let figures = bench.sim.audit.figures(&bench.sim, &mut Alone::default());
        let [found] = &figures.of_kinds[..] else { panic!("{figures:?}") };
        assert_eq!((found.contacts, found.spurious, found.unresolved), (steps, 0, 0));
        close(found.mean_force_n, sizes / steps as f64, 1e-9, "mean size of the force");
        assert!(found.overlap.max < 1e-12 && found.force.max < 1e-8, "{found:?}");
    }
}

/// Losses of dashpots and of adhesion are separate channels, and a bounce with both has both losses.
#[test]
fn what_adhesion_takes_is_told_from_what_dashpots_take() {
    let speed = (2.0 * 30.0 * lost(RADIUS) / mass(RADIUS, DENSITY)).sqrt();
    let step = 2e-3 * depth(RADIUS) / speed;
    let (mut bench, _, mass) = thrown(true, "restitution = 0.9", DENSITY, speed, step);
    let before = bench.measure();
    let (_, ended) = through(&mut bench, 400_000);
    assert!(ended, "it leaves");
    bench.step();
    let after = bench.measure();
    close(after.taken_by(Quantity::OfAdhesion), lost(RADIUS), 1e-12, "to adhesion");
    // Factor from an independent integration of the equations: adhesion widens the contacts, which increases the force of dashpots.
    let without_adhesion = 0.5 * mass * speed * speed * (1.0 - 0.81);
    close(after.of_normal_dashpots(), 1.41 * without_adhesion, 0.03, "to dashpots");
    close(before.kinetic() - after.kinetic(), after.dissipated, 1e-3, "all of it");
}

/// The error of finite steps depends on the position of touch and separation within a step. Over all positions it is of first order, and its
/// mean is much smaller.
#[test]
fn a_loop_loses_what_it_should_to_first_order_in_the_step() {
    let speed = (2.0 * 6.0 * lost(RADIUS) / mass(RADIUS, DENSITY)).sqrt();
    let of_steps = |steps: f64| {
        let step = depth(RADIUS) / (speed * steps);
        let places = 24;
        let off = (0..places).map(|place| {
            let gap = (f64::from(place) + 0.5) / f64::from(places) * speed * step;
            let (mut bench, _, _) = thrown_from(gap, true, "", DENSITY, speed, step);
            let before = bench.measure().kinetic();
            let (_, ended) = through(&mut bench, 100_000);
            assert!(ended, "it leaves");
            bench.step();
            (before - bench.measure().kinetic()) / lost(RADIUS) - 1.0
        });
        let off: Vec<f64> = off.collect();
        let mean =
            |of: &dyn Fn(f64) -> f64| off.iter().map(|&x| of(x)).sum::<f64>() / f64::from(places);
        (mean(&|x| x), mean(&|x| x * x).sqrt())
    };
    let ((coarse_mean, coarse), (fine_mean, fine)) = (of_steps(50.0), of_steps(200.0));
    let order = (coarse / fine).log2() / 2.0;
    assert!((0.8..1.2).contains(&order), "{order}: {coarse:e}, {fine:e}");
    assert!(coarse < 0.03, "{coarse}");
    for (mean, spread) in [(coarse_mean, coarse), (fine_mean, fine)] {
        assert!(mean.abs() < 0.4 * spread, "{mean:e}, {spread:e}");
    }
}

/// With two per cent less than the energy of the cycle the ball sticks, with two per cent more it leaves.
#[test]
fn whether_a_ball_sticks_is_a_matter_of_that_energy() {
    for (part, leaves) in [(0.98, false), (1.02, true)] {
        let speed = (2.0 * part * lost(RADIUS) / mass(RADIUS, DENSITY)).sqrt();
        let step = 2e-3 * depth(RADIUS) / speed;
        let (mut bench, _, _) = thrown(true, "", DENSITY, speed, step);
        let (_, ended) = through(&mut bench, 60_000);
        assert_eq!(ended, leaves, "{part} of the energy");
    }
}

/// A slow pull of a thousandth less than `3/2 π w R*` holds, and of a thousandth more separates.
#[test]
fn the_pull_off_force_is_that_of_the_theory() {
    let holds = 1.5 * PI * WORK * RADIUS;
    for (part, stays) in [(0.999, true), (1.001, false)] {
        let start = ball(0, 0, Vec3::new(0.0, 0.0, RADIUS * (1.0 - 1e-9)), Vec3::zeros());
        let mut bench = Bench::new(&text("restitution = 0.1", DENSITY, 2e-8), &[start]);
        let steps = 200_000;
        for step in 0..2 * steps {
            let ramp = f64::from(step).min(f64::from(steps)) / f64::from(steps);
            // The contact softens near the limit, so the ramp is slower there.
            let ramp = 1.0 - (1.0 - ramp).powi(3);
            bench.sim.field.gravity.z = part * ramp * holds / mass(RADIUS, DENSITY);
            bench.step();
            if overlap(&bench).is_none() {
                break;
            }
        }
        assert_eq!(overlap(&bench).is_some(), stays, "{part} of the force");
        if let Some(overlap) = overlap(&bench) {
            assert!(overlap < 0.0, "surfaces are apart: {overlap:e} m");
        }
    }
}

/// Only adhesion presses the ball on: it slides beyond `μ 3 π w R*`, slowed by that force.
#[test]
fn friction_counts_what_adhesion_presses() {
    let friction = 0.4;
    let limit = friction * 3.0 * PI * WORK * RADIUS / mass(RADIUS, DENSITY);
    // Without load `a³ = 9 π w R²/(2 E*)`.
    let part: f64 = 1.5_f64.cbrt();
    let rest = depth(RADIUS) * (part.powi(2) - part.sqrt());
    for part in [0.9, 1.5] {
        let own = format!("friction = {friction}\nrestitution = 0.5");
        let start = ball(0, 0, Vec3::new(0.0, 0.0, RADIUS - rest), Vec3::zeros());
        let mut bench = Bench::heavy_to_turn(&scene(&text(&own, DENSITY, 2e-8)), &[start]);
        bench.sim.field.gravity.x = part * limit;
        slides_beyond(bench, part, limit, 30_000);
    }
}

/// Soft adhesive particles exceed the overlap assumed for the step even without load. Their contacts are hardly stiffer, because stiffness
/// follows the contact radius.
#[test]
fn the_stable_step_goes_with_the_contact_radius() {
    let (youngs, step) = (9.1e5, 1e-9);
    let modulus = 0.5 * youngs / (1.0 - 0.09);
    let overlap_of = |a: f64| a * a / RADIUS - (2.0 * PI * WORK * a / modulus).sqrt();
    let of = |up_to: f64, step: f64| {
        let text = text("restitution = 0.1", DENSITY, step)
            .replace("youngs_modulus = 1e8", &format!("youngs_modulus = {youngs:e}"))
            .replace("largest_overlap = 0.1", &format!("largest_overlap = {up_to:e}"))
            + "steps = 400\n[output]\nhistory_every = 1\n";
        scene(&text)
    };
    // Contact radius without load.
    let rest = (4.5 * PI * WORK * RADIUS * RADIUS / modulus).cbrt();
    for part in [1.1, 1.5, 3.0] {
        let meant = overlap_of(rest) / RADIUS;
        let scene = of(meant, step);
        let law = scene.force_law();
        let found = law.about().stiffens(overlap_of(part * rest) / RADIUS, &scene.library);
        close(found, part, 1e-6, "contact radius");
    }
    let scene = of(0.01, step);
    let limit = time_step_limit(&scene.library, &*scene.force_law()).unwrap().dt;
    let scene = of(0.01, 0.9 * limit);
    let overlap = overlap_of(rest);
    assert!(overlap > 0.02 * RADIUS, "{overlap:e}");
    let start = ball(0, 0, Vec3::new(0.0, 0.0, RADIUS - overlap), Vec3::zeros());
    let mut bench = Bench::of(&scene, &[start]);
    let folder = tempfile::tempdir().unwrap();
    let schedule = schedule(&scene, 400, folder.path());
    let finish = run(&mut bench.sim, &schedule, &mut Alone::default(), &mut |_| {}).unwrap();
    assert_eq!(finish.steps_done, 400);
    let spring = bench.sim.contacts.iter().next().unwrap().1.overlap;
    close(spring, overlap, 1e-3, "it rests");
}

/// Without surface energy the impact is that of Hertz to rounding.
#[test]
fn without_surface_energy_it_is_hertz() {
    let run = |text: &str| {
        let start = ball(0, 0, Vec3::new(0.0, 0.0, RADIUS), Vec3::new(0.05, 0.0, -0.1));
        let mut bench = Bench::new(text, &[start]);
        for _ in 0..5000 {
            bench.step();
        }
        bench.sim.particles.velocity[0]
    };
    let own = "friction = 0.3\nrestitution = 0.7";
    let sticking =
        text(own, DENSITY, 2e-9).replace("surface_energy = 0.05", "surface_energy = 0.0");
    let elastic = sticking
        .replace("adhesion = \"jkr\"", "limit_damping = false")
        .replace("surface_energy = 0.0\n", "");
    let (sticking, elastic) = (run(&sticking), run(&elastic));
    assert!(elastic.z > 0.0, "it has bounced: {elastic}");
    assert!((sticking - elastic).norm() < 1e-10 * elastic.norm(), "{sticking} {elastic}");
}

/// Incompatible keys are rejected.
#[test]
fn what_does_not_go_with_it_is_refused() {
    let good = text("", DENSITY, 1e-9);
    scene(&good);
    let ball = "kind = \"sphere\"\nradius = 0.0001";
    for (from, to, said) in [
        ("normal = \"hertz\"\n", "normal = \"linear\"\n", "needs normal = \"hertz\""),
        ("adhesion = \"jkr\"", "adhesion = \"jkr\"\nrolling = \"spring\"", "not with"),
        ("adhesion = \"jkr\"", "adhesion = \"jkr\"\nlimit_damping = true", "is not used with"),
        (ball, "kind = \"ellipsoid\"\nsemi_axes = [1e-4, 1e-4, 2e-4]", "`ball` is not a sphere"),
    ] {
        expect_refused(&good, from, to, said);
    }
}

/// The plan states the gap at which a contact ends, `3/4 (π² w² R*/E*²)^(1/3)`, for the largest sphere on a plane.
#[test]
fn the_plan_names_the_gap_at_which_contacts_end() {
    let page = plan(&scene(&text("", DENSITY, 1e-9)), 1);
    let words = "contacts act beyond the overlap, up to a gap of ";
    let (_, rest) = page.split_once(words).expect("the plan says it");
    let gap: f64 = rest.split(' ').next().unwrap().parse().unwrap();
    let expected = 0.75 * (PI * PI * WORK * WORK * RADIUS / (MODULUS * MODULUS)).cbrt();
    close(gap, expected, 1e-3, "gap of the plan, on a plane");
}

/// The contact radius reproduces its overlap, from the last gap to where Hertz takes over.
#[test]
fn the_radius_is_that_of_the_overlap() {
    let (modulus, radius, surface_energy) = (5e8, 1e-4, 0.05);
    let sticking = Sticking::of(modulus, radius, surface_energy);
    for k in 0..8000 {
        let part = END + 1e-9 * 1.007_f64.powi(k);
        let overlap = part * sticking.depth;
        let a = sticking.contact_radius(overlap);
        let back = a * a / radius - (2.0 * std::f64::consts::PI * 0.1 * a / modulus).sqrt();
        let scale = overlap.abs().max(sticking.depth);
        assert!((back - overlap).abs() < 1e-14 * scale, "{part}: {back:e}, {overlap:e}");
        let press = sticking.press(4.0 / 3.0 * modulus, a);
        if part > 1e8 {
            let of_hertz = 4.0 / 3.0 * modulus * (radius * overlap).sqrt() * overlap;
            assert!((press / of_hertz - 1.0).abs() < 1e-5, "{press:e} N, {of_hertz:e} N");
        }
    }
}

/// The force is the derivative of the energy.
#[test]
fn the_energy_is_the_integral_of_the_force() {
    let (modulus, radius) = (5e8, 1e-4);
    let sticking = Sticking::of(modulus, radius, 0.05);
    let normal = 4.0 / 3.0 * modulus;
    let energy =
        |part: f64| sticking.stored(normal, sticking.contact_radius(part * sticking.depth));
    for part in [-0.4_f64, -0.2, 0.1, 1.0, 10.0, 1000.0] {
        let step = 1e-4 * f64::max(part.abs(), 0.1);
        let slope = (energy(part + step) - energy(part - step)) / (2.0 * step * sticking.depth);
        let press = sticking.press(normal, sticking.contact_radius(part * sticking.depth));
        assert!((slope / press - 1.0).abs() < 1e-5, "{part}: {slope:e} N, {press:e} N");
    }
    // The constant of Thornton and Ning.
    let lost = energy(END) - energy(0.0);
    let scale = (0.1_f64.powi(5) * radius.powi(4) / modulus.powi(2)).cbrt();
    assert!((lost / scale - 7.09).abs() < 0.005, "{}", lost / scale);
}
