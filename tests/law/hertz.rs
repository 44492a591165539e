//! Hertz and Mindlin between spheres against closed forms: the impacts of Chung and Ooi (2011, DOI 10.1007/s10035-011-0277-0),
//! restitution, gross sliding, and the energy balance.

use crate::support::{Bench, at, begun, close, expect_refused, scene, schedule};
use dem_mpi::comm::alone::Alone;
use dem_mpi::law::stability::time_step_limit;
use dem_mpi::math::Vec3;
use dem_mpi::scene::Scene;
use dem_mpi::sim::run;

/// A sphere and a floor, rigid or of the same material.
struct Case {
    /// Young's modulus [Pa], Poisson's ratio, density [kg/m³].
    material: [f64; 3],
    /// Radius of the sphere [m].
    radius: f64,
    /// Keys of `[[interaction]]` with the floor and between spheres.
    contact: &'static str,
    /// Keys of `[law]`, after `normal`.
    law: &'static str,
}

const GLASS: [f64; 3] = [4.8e10, 0.20, 2800.0];
const LIMESTONE: [f64; 3] = [2.0e10, 0.25, 2500.0];
const ALUMINIUM: [f64; 3] = [7.0e10, 0.30, 2699.0];
const MAGNESIUM: [f64; 3] = [4.0e10, 0.35, 1800.0];
const OXIDE: [f64; 3] = [3.8e11, 0.23, 4000.0];
const IRON: [f64; 3] = [1.0e11, 0.25, 7000.0];

impl Case {
    fn text(&self, step: f64) -> String {
        let [youngs, poisson, density] = self.material;
        let size = 20.0 * self.radius;
        format!(
            r#"
title = "impact"
[law]
normal = "hertz"
{law}
[domain]
low = [{low:e}, {low:e}, 0.0]
high = [{size:e}, {size:e}, {size:e}]
walls = ["-z"]
wall_material = "rigid"
[[material]]
name = "m"
density = {density:e}
youngs_modulus = {youngs:e}
poisson_ratio = {poisson:e}
{contact}
[[material]]
name = "rigid"
density = 1.0
youngs_modulus = 7e20
poisson_ratio = 0.0
{contact}
[[shape]]
name = "ball"
kind = "sphere"
material = "m"
radius = {radius:e}
[time]
step = {step:e}
"#,
            law = self.law,
            contact = self.contact,
            radius = self.radius,
            low = -size,
        )
    }

    /// Text of an impact on the floor at this speed [m/s], with a row of the history at every step.
    fn thrown(&self, step: f64, speed: f64) -> String {
        format!(
            "{}steps = 600\n[[fill.lattice]]\nfirst = [0, 0, {:e}]\ncount = [1, 1, 1]\n\
             velocity = [0, 0, -{speed}]\n[output]\nhistory_every = 1\n",
            self.text(step),
            self.radius
        )
    }

    /// Contact time, largest overlap, largest force of an elastic impact [s, m, N] at a relative speed. The partner is the rigid
    /// floor or another such sphere.
    fn closed_form(&self, speed: f64, on_floor: bool) -> [f64; 3] {
        let [youngs, poisson, density] = self.material;
        let mass = 4.0 / 3.0 * std::f64::consts::PI * self.radius.powi(3) * density;
        let share = if on_floor { 1.0 } else { 0.5 };
        let (mass, radius) = (mass * share, self.radius * share);
        let modulus = youngs / (1.0 - poisson * poisson) * share;
        let overlap = (15.0 * mass * speed * speed / (16.0 * modulus * radius.sqrt())).powf(0.4);
        let force = 4.0 / 3.0 * modulus * radius.sqrt() * overlap.powf(1.5);
        // 2 √π Γ(1.4) / Γ(0.9)
        [2.943_275_2 * overlap / speed, overlap, force]
    }
}

/// A sphere that just touches the floor.
fn on_floor(case: &Case, step: f64, velocity: Vec3) -> Bench {
    Bench::new(&case.text(step), &[at(0, Vec3::new(0.0, 0.0, case.radius), velocity)])
}

/// Number of steps of an impact.
const STEPS: f64 = 2000.0;

/// Tests 1, 2 and 3 (at a restitution of 1): time, overlap and force of normal impacts. Pairs in a slanted direction, too, and with
/// their ids exchanged.
#[test]
fn elastic_impacts_are_those_of_chung_and_ooi() {
    let law = "tangential = \"none\"";
    for (material, radius, speed, on_a_floor, published) in [
        (GLASS, 0.01, 20.0, false, 10_696.89),
        (LIMESTONE, 0.01, 20.0, false, 7_108.24),
        (ALUMINIUM, 0.1, 0.2, true, 11_369.86),
        (MAGNESIUM, 0.1, 0.2, true, 7_232.68),
        (OXIDE, 0.0025, 3.9, true, 615.35),
        (IRON, 0.0025, 3.9, true, 506.76),
    ] {
        let case = Case { material, radius, contact: "", law };
        let expected = case.closed_form(speed, on_a_floor);
        close(expected[2], published, 1e-5, "closed form");
        let step = expected[0] / STEPS;
        let slanted = Vec3::new(0.48, 0.6, 0.64);
        for (along, first) in [(Vec3::z(), 0), (slanted, 0), (slanted, 1)] {
            let mut bench = if on_a_floor {
                on_floor(&case, step, Vec3::new(0.0, 0.0, -speed))
            } else {
                let middle = Vec3::new(0.0, 0.0, 8.0 * radius);
                let ball = |id, side: f64| {
                    at(id, middle + along * (side * radius), along * (-0.5 * side * speed))
                };
                Bench::new(&case.text(step), &[ball(first, -1.0), ball(1 - first, 1.0)])
            };
            let found = impact(&mut bench, &case, on_a_floor);
            for (k, what) in ["contact time", "overlap", "force"].into_iter().enumerate() {
                close(found[k], expected[k], 1e-4, what);
            }
            if on_a_floor {
                break;
            }
        }
    }
}

/// Contact time [s], largest overlap [m] and largest force [N].
fn impact(bench: &mut Bench, case: &Case, on_floor: bool) -> [f64; 3] {
    let overlap_in = |bench: &Bench| {
        let position = &bench.sim.particles.position;
        if on_floor {
            case.radius - position[0].z
        } else {
            2.0 * case.radius - (position[0] - position[1]).norm()
        }
    };
    let (mut overlap, mut largest, mut force) = (0.0, 0.0_f64, 0.0_f64);
    for step in 1..3 * STEPS as u32 {
        bench.step();
        let before = std::mem::replace(&mut overlap, overlap_in(bench));
        if overlap < 0.0 {
            let time = f64::from(step) - overlap / (overlap - before);
            return [time * bench.sim.dt, largest, force];
        }
        largest = largest.max(overlap);
        force = force.max(Vec3::from(bench.sim.particles.force[0].vector).norm());
    }
    panic!("they never part");
}

/// Test 3 and beyond: impacts give the requested restitution, with and without the limit on attraction.
#[test]
fn restitution_is_exact() {
    for limited in ["true", "false"] {
        for (restitution, contact) in [
            (0.05, "restitution = 0.05"),
            (0.2, "restitution = 0.2"),
            (0.4, "restitution = 0.4"),
            (0.6, "restitution = 0.6"),
            (0.8, "restitution = 0.8"),
            (0.98, "restitution = 0.98"),
            (1.0, "restitution = 1"),
        ] {
            let law = if limited == "true" { "" } else { "limit_damping = false" };
            let case = Case { material: OXIDE, radius: 0.0025, contact, law };
            let step = case.closed_form(3.9, true)[0] / 20_000.0;
            let mut bench = on_floor(&case, step, Vec3::new(0.0, 0.0, -3.9));
            for _ in 0..400_000 {
                bench.step();
                if bench.sim.particles.position[0].z > case.radius {
                    break;
                }
            }
            let found = bench.sim.particles.velocity[0].z / 3.9;
            close(found, restitution, 1e-3, &format!("limited {limited}, {restitution}"));
        }
    }
}

/// Test 4 above 32.52 degrees: gross sliding. Grazing impacts create no energy.
#[test]
fn oblique_impacts_slide_and_never_gain_energy() {
    let speed = 3.9;
    for (contact, friction, restitution) in [
        ("friction = 0.092\nrestitution = 0.98", 0.092, 0.98),
        ("friction = 0.5\nrestitution = 1", 0.5, 1.0),
    ] {
        let case = Case { material: OXIDE, radius: 0.0025, contact, law: "" };
        for degrees in [5.0_f64, 20.0, 30.0, 35.0, 40.0, 50.0, 60.0, 70.0, 76.0, 80.0, 85.0] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let step = case.closed_form(speed * cos, true)[0] / STEPS;
            let velocity = Vec3::new(speed * sin, 0.0, -speed * cos);
            let mut bench = on_floor(&case, step, velocity);
            let before = bench.measure().mechanical();
            for _ in 0..2 * STEPS as u32 {
                bench.step();
            }
            let after = bench.measure();
            let what = format!("friction {friction}, {degrees} degrees");
            assert_eq!(after.stored, 0.0, "{what}: it has left");
            let gained = after.mechanical() / before - 1.0;
            println!("{what}: energy {gained:.3e}, missing {:.1e}", after.missing() / before);
            assert!(gained < 1e-6, "{what}: {gained:e} of the energy made");
            // No channel takes the loss of a frictionless normal spring in finite steps.
            assert!(after.missing().abs() < 1e-5 * before, "{what}: {:e}", after.missing());
            if degrees.to_radians().tan() > 1.05 * 3.5 * friction * (1.0 + restitution) {
                let pushed = friction * (1.0 + restitution);
                let velocity = bench.sim.particles.velocity[0].x / (speed * sin);
                close(velocity, 1.0 - pushed / (sin / cos), 1e-3, &what);
                let spin = bench.sim.particles.spin.as_ref().expect("it turns");
                let expected = 2.5 * pushed * speed * cos / case.radius;
                // The lever arm is the radius less up to the overlap.
                let [_, overlap, _] = case.closed_form(speed * cos, true);
                let shorter = overlap / case.radius;
                close(spin.angular_velocity[0].norm(), expected, shorter, &what);
            }
        }
    }
}

/// Keys that the law does not use are rejected, with the name of the law that uses them.
#[test]
fn keys_of_another_law_are_refused() {
    let case = Case { material: GLASS, radius: 0.01, contact: "", law: "" };
    let good = case.text(1e-9);
    scene(&good);
    for (from, to, said) in [
        ("normal = \"hertz\"", "tangential = \"mindlin\"", "need normal = \"hertz\""),
        ("normal = \"hertz\"", "", "normal = \"hertz\""),
        (
            "normal = \"hertz\"",
            "normal = \"hertz\"\ntangential = \"linear\"",
            "normal = \"linear\"",
        ),
        ("normal = \"hertz\"", "largest_overlap = 0.1", "normal = \"hertz\""),
        ("poisson_ratio = 2e-1", "poisson_ratio = 0.6", "a number from 0 to 0.5"),
        (
            "poisson_ratio = 2e-1",
            "poisson_ratio = 0.2\nnormal_stiffness = 1e5",
            "normal = \"linear\"",
        ),
        (
            "normal = \"hertz\"",
            "normal = \"hertz\"\ntangential = \"none\"\n[[interaction]]\nbetween = [\"m\", \"m\"]\nfriction = 0.1",
            "\"mindlin\"",
        ),
        (
            "kind = \"sphere\"\nmaterial = \"m\"\nradius = 1e-2",
            "kind = \"ellipsoid\"\nmaterial = \"m\"\nsemi_axes = [1e-5, 1e-4, 1.1e-3]",
            "longer than 100 times",
        ),
        (
            "kind = \"sphere\"\nmaterial = \"m\"\nradius = 1e-2",
            "kind = \"superellipsoid\"\nmaterial = \"m\"\nexponents = [1, 1]\nsemi_axes = [1e-5, 1e-4, 1.1e-3]",
            "longer than 100 times",
        ),
    ] {
        expect_refused(&good, from, to, said);
    }
}

/// A ball that strikes harder than the scene states has a stiffer contact than the stable step assumes. The report mentions it only
/// if the step is close to the limit.
#[test]
fn an_overlap_beyond_what_the_step_was_found_for_is_told_where_little_is_left() {
    let case = Case {
        material: [1e9, 0.3, 2500.0],
        radius: 0.01,
        contact: "",
        law: "largest_overlap = 0.02",
    };
    for (speed, part, warned) in [(1.0, 0.95, false), (4.0, 0.5, false), (4.0, 0.95, true)] {
        let [_, overlap, _] = case.closed_form(speed, true);
        let made_for = scene(&case.text(1e-9));
        let limit = time_step_limit(&made_for.library, &*made_for.force_law()).unwrap().dt;
        let step = part * limit * (0.02 * case.radius / overlap).powf(0.25).min(1.0);
        let scene = scene(&case.thrown(step, speed));
        assert_eq!(overlap / case.radius > 0.02, speed > 1.0, "{overlap:e}");
        let (mut sim, mut comm) = (begun(&scene, &mut Alone::default()), Alone::default());
        let folder = tempfile::tempdir().unwrap();
        let mut told = Vec::new();
        let schedule = schedule(&scene, scene.steps, folder.path());
        let finish = run::run(&mut sim, &schedule, &mut comm, &mut |progress| {
            told.extend_from_slice(progress.warnings);
        })
        .unwrap();
        assert!(told.iter().all(|text| !text.contains("law.largest_overlap")), "{told:?}");
        assert_eq!(finish.stiffened.is_some(), warned);
        let says = ["an overlap of 0.02", "law.largest_overlap = 0.020", "still above the step"];
        let words = finish.stiffened.iter();
        assert!(words.clone().all(|text| says.iter().all(|part| text.contains(part))), "{words:?}");
    }
}

/// Spheres compressed by servos: the overlap assumed for the step follows from the stress, or from four times the stress where walls
/// are driven. The scene can override it. The result is close to it.
#[test]
fn the_step_of_a_compression_is_found_for_its_stress() {
    let (stress, youngs, poisson) = (5e4, 1e8, 0.25);
    let servo = |axis: &str| {
        format!(
            "[[servo]]\nwalls = [\"-{axis}\", \"+{axis}\"]\nstress = {stress:e}\nmax_speed = 0.05\n"
        )
    };
    let text = format!(
        "[domain]\nlow = [0, 0, 0]\nhigh = [0.018, 0.018, 0.018]\nwalls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"]\n\
         [law]\nnormal = \"hertz\"\n\
         [[material]]\nname = \"sand\"\ndensity = 2650\nyoungs_modulus = {youngs:e}\npoisson_ratio = {poisson}\nfriction = 0.3\nrestitution = 0.3\n\
         [[shape]]\nname = \"grain\"\nkind = \"sphere\"\ndiameter = 2.4e-3\nsize = {{ uniform = [0.8, 1.2] }}\n\
         [[fill.lattice]]\njitter = 1e-5\n{}{}{}\
         [time]\nstep = \"auto\"\nsteps = 100_000\n[stop]\nservo = 0.05\nunbalanced = 0.02\n",
        servo("x"),
        servo("y"),
        servo("z")
    );
    let pressed = scene(&text);
    let driven = text.replace(&servo("z"), "");
    let driven =
        scene(&driven.replace("[law]", "wall_velocity = { \"+z\" = [0, 0, -0.01] }\n[law]"));
    let shaken = format!(
        "{}[[motion]]\nwalls = [\"+z\"]\nalong = [0, 0, 1]\namplitude = 1e-5\nfrequency = 10\n",
        text.replace(&servo("z"), "")
    );
    let loaded = shaken.replace("amplitude = 1e-5\nfrequency = 10", "mass = 0.01");
    let said = scene(&text.replace("[law]", "[law]\nlargest_overlap = 0.03"));
    let up_to = |scene: &Scene| scene.force_law().about().hardest_up_to().unwrap();
    let modulus = youngs / (2.0 * (1.0 - poisson * poisson));
    let expected = |stress: f64| (26.0 * stress / modulus).powf(2.0 / 3.0);
    close(up_to(&pressed), expected(stress), 0.01, "servos");
    close(up_to(&driven), expected(4.0 * stress), 0.01, "a driven wall");
    close(up_to(&scene(&shaken)), expected(4.0 * stress), 0.01, "a wall that moves by time");
    close(up_to(&scene(&loaded)), expected(stress), 0.01, "a wall that forces move");
    assert_eq!(up_to(&said), 0.03);
    // Without servos: lids that weight and a force press, along the normal and held across it, and a lid that they lift.
    let lid = |motion: &str| {
        let bare =
            ["x", "y", "z"].iter().fold(text.clone(), |text, axis| text.replace(&servo(axis), ""));
        let bare = bare.replace("[stop]\nservo = 0.05\n", "[stop]\n");
        let motion = format!("[[motion]]\nwalls = [\"+z\"]\nmass = 0.5\n{motion}\n");
        scene(&format!("gravity = [0, 0, -10]\n{bare}{motion}"))
    };
    let (force, weight) = (stress * 0.018 * 0.018, 0.5 * 10.0);
    let down = lid(&format!("along = [0, 0, 1]\nforce = {:?}", weight - force));
    close(up_to(&down), up_to(&pressed), 1e-12, "a lid");
    let aslant = lid(&format!("along = [0, -3, -4]\nforce = {:?}", 0.8 * (force - weight)));
    close(up_to(&aslant), up_to(&pressed), 1e-12, "a lid aslant");
    let lifted = lid(&format!("along = [0, 0, 1]\nforce = {:?}", weight + force));
    assert_eq!(up_to(&lifted), 0.01);
    assert_eq!(up_to(&lid("along = [1, 0, 0]\nforce = 100")), 0.01);

    let (mut sim, mut comm) = (begun(&pressed, &mut Alone::default()), Alone::default());
    let folder = tempfile::tempdir().unwrap();
    let schedule = schedule(&pressed, pressed.steps, folder.path());
    let finish = run::run(&mut sim, &schedule, &mut comm, &mut |_| {}).unwrap();
    assert!(matches!(finish.ending, run::Ending::Rest), "{:?}", finish.ending);
    let came = 2.0 * finish.largest_overlap.0;
    println!("largest overlap {came} of the radius, found for {}", up_to(&pressed));
    assert!((0.5..1.5).contains(&(came / up_to(&pressed))), "{came}");
}

/// A step within the limit at the start, and beyond the limit after a hard impact: the run ends, or continues if allowed.
#[test]
fn a_step_over_the_limit_that_a_load_leaves_ends_the_run() {
    let law = "largest_overlap = 0.001";
    let case = Case { material: [1e9, 0.3, 2500.0], radius: 0.01, contact: "", law };
    let made_for = scene(&case.text(1e-9));
    let limit = time_step_limit(&made_for.library, &*made_for.force_law()).unwrap().dt;
    let text = case.thrown(0.9 * limit, 4.0);
    let words = ["over the stable limit", "use a step of", "time.allow_unstable"];
    let run_with = |allowed: bool| {
        let scene = scene(&text.replace("[time]", &format!("[time]\nallow_unstable = {allowed}")));
        let (mut sim, mut comm) = (begun(&scene, &mut Alone::default()), Alone::default());
        let folder = tempfile::tempdir().unwrap();
        run::run(&mut sim, &schedule(&scene, 600, folder.path()), &mut comm, &mut |_| {})
    };
    let fault = run_with(false).unwrap_err().to_string();
    assert!(words.iter().all(|part| fault.contains(part)), "{fault}");
    let finish = run_with(true).unwrap();
    let over: Vec<_> = finish.warnings.iter().filter(|text| text.contains(words[0])).collect();
    assert_eq!(over.len(), 1, "{:?}", finish.warnings);
    let last = finish.stiffened.unwrap();
    assert!(last.contains(words[0]) && last != *over[0], "the deepest overlap: {last}");
}
