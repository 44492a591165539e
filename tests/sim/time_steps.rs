//! The stable limit as a bound, and an automatic step that follows it.

use crate::support::{State, begun, close, save, scene, schedule};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::threads;
use dem_mpi::law::stability::limit_of_contacts;
use dem_mpi::output::snapshot::{Reader, particles_name};
use dem_mpi::random::Random;
use dem_mpi::scene::assemble::{self, Continuation};
use dem_mpi::scene::{Scene, doubts, plan};
use dem_mpi::sim::run::{Finish, Schedule, run};
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Stiffness of contacts of each material with itself [N/m].
const STEEL: f64 = 3e8;
const SOFT: f64 = 1e5;
/// Overlap at which two balls, or two particles of the shape `grain`, stick to each other [m].
const STUCK: f64 = 1e-6;

/// Elastic spheres of two materials that stick and never slide, in a box of the harder one. `ball` has a radius of 10 mm, `grain` of 1 mm.
fn spheres(walls: &str, fill: &str) -> String {
    let material = |name: &str, density: f64, stiffness: f64, radius: f64| {
        // The attraction of two of them is 2π w R*, with the work w of twice this energy.
        let energy = stiffness * STUCK / (2.0 * PI * radius);
        format!(
            "[[material]]\nname = \"{name}\"\ndensity = {density:?}\nnormal_stiffness = {stiffness:e}\nfriction = 1e6\nsurface_energy = {energy:e}\n"
        )
    };
    format!(
        "[domain]\nlow = [0, 0, 0]\nhigh = [0.1, 0.1, 0.1]\n{walls}\n[law]\nadhesion = \"dmt\"\n{}{}\
         [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nmaterial = \"steel\"\nradius = 0.01\n\
         [[shape]]\nname = \"grain\"\nkind = \"sphere\"\nmaterial = \"soft\"\nradius = 0.001\n{fill}\
         [time]\nstep = 1e-12\nallow_unstable = true\n",
        material("steel", 7200.0, STEEL, 0.01),
        material("soft", 2500.0, SOFT, 0.001),
    )
}

/// Layers of the shape `grain` at the distance at which they stick to each other.
fn layers(count: [u32; 3]) -> String {
    format!(
        "[[fill.lattice]]\nshapes = [\"grain\"]\nfirst = [0.000999, 0.000999, 0.000999]\nspacing = {:e}\ncount = {count:?}\n",
        0.002 - STUCK
    )
}

fn ball(place: [f64; 3]) -> String {
    format!("[[fill.lattice]]\nshapes = [\"ball\"]\nfirst = {place:?}\ncount = [1, 1, 1]\n")
}

/// Ratio of the highest kinetic energies after a random perturbation, with a step of a part of the limit and of a fourth of it.
fn growth(text: &str, part: f64) -> f64 {
    const LIMITS: f64 = 600.0;
    let highest = |part: f64| {
        let mut scene = scene(text);
        scene.dt = part * scene.time_step_limit().unwrap().dt;
        let mut comm = Alone::default();
        let mut sim = begun(&scene, &mut comm);
        let mut random = Random::of(7, 0);
        for velocity in &mut sim.particles.velocity[..] {
            velocity.iter_mut().for_each(|v| *v += 1e-3 * random.signed());
        }
        let mut highest: f64 = 0.0;
        for step in 0..(LIMITS / part) as u64 {
            // Particles thrown out of the domain are unstable, too.
            if sim.step(&mut comm).is_err() {
                return f64::INFINITY;
            }
            if step % 7 == 0 {
                highest = highest.max(sim.measure(&mut comm).kinetic());
            }
        }
        highest
    };
    highest(part) / highest(0.25)
}

/// Steps of the whole limit are stable for all contacts. Cases are one hard ball on a wall, in a corner and on soft particles, two balls, and soft
/// particles in a corner. For two balls the limit is exact, and 2 % more are unstable.
#[test]
fn steps_of_the_whole_limit_are_stable() {
    let walls = |sides: &str| format!("walls = {sides}\nwall_material = \"steel\"");
    let all = walls(r#"["-x", "+x", "-y", "+y", "-z", "+z"]"#);
    let floor = walls(r#"["-z"]"#);
    // On a plane the radius R* is twice that of two balls.
    let low = 0.01 - 2.0 * STUCK;
    let on_grains = format!("{}{}", layers([21, 21, 1]), ball([0.02, 0.02, 0.01199]));
    let pair = format!("{}{}", ball([0.05; 3]), ball([0.05, 0.05, 0.07 - STUCK]));
    let far = ball([0.08, 0.08, low]);
    let cases = [
        ("two balls", spheres("", &pair)),
        ("balls on a wall", spheres(&floor, &format!("{}{far}", ball([0.05, 0.05, low])))),
        ("a ball in a corner", spheres(&all, &format!("{}{far}", ball([low; 3])))),
        ("a ball on grains", spheres(&floor, &on_grains)),
        ("grains in a corner", spheres(&all, &layers([5, 5, 5]))),
    ];
    for (name, text) in &cases {
        let found = growth(text, 1.0);
        println!("{name}: {found}");
        assert!(found < 2.0, "{name}: the energy grows {found:e} times");
    }
    // ω² = 7 k / m for two spheres that rotate against each other on a spring of equal stiffness along and across.
    let mass = 7200.0 * 4.0 / 3.0 * PI * 1e-6;
    let limit = |case: usize| scene(&cases[case].1).time_step_limit().unwrap().dt;
    close(limit(0), 2.0 / (7.0 * STEEL / mass).sqrt(), 1e-12, "two balls");
    let found = growth(&cases[0].1, 1.02);
    assert!(found > 100.0, "two balls, 2 % over the limit: {found:e}");
    // (4 + √8.5) k / m in the corner.
    let exact = 2.0 / ((4.0 + 8.5_f64.sqrt()) * STEEL / mass).sqrt();
    assert!((0.5..=1.0).contains(&(limit(2) / exact)), "{:e} s of {exact:e} s", limit(2));
}

/// Only steel on steel is stiff, and only a ball and a wall are of steel: the soft particles set the limit.
#[test]
fn one_hard_ball_leaves_the_step_of_soft_grains() {
    let floor = "walls = [\"-z\"]\nwall_material = \"steel\"";
    let grains = layers([10, 10, 2]);
    let limit = |fill: &str| {
        let scene = scene(&spheres(floor, fill));
        let limit = scene.time_step_limit().unwrap();
        (limit.dt, scene.library.names[limit.shape.index()].clone())
    };
    let (alone, _) = limit(&grains);
    let (with_ball, set_by) = limit(&format!("{grains}{}", ball([0.05; 3])));
    assert_eq!(set_by, "grain");
    assert!((0.8..=1.0).contains(&(with_ball / alone)), "{with_ball:e} s, {alone:e} s");
    // Many balls meet each other.
    let many = ball([0.02; 3]).replace("count = [1, 1, 1]", "spacing = 0.02\ncount = [3, 3, 3]");
    let (with_many, set_by) = limit(&format!("{grains}{many}"));
    assert_eq!(set_by, "ball");
    let mass = 7200.0 * 4.0 / 3.0 * PI * 1e-6;
    close(with_many, 2.0 / (40.0 * STEEL / mass).sqrt(), 1e-12, "balls on balls");
}

/// Beads that fall on a shaking floor, so soft that the first step is too long for the later contacts.
const FALLING: &str = r#"
gravity = [0, 0, -9.81]
[domain]
low = [0, 0, 0]
high = [0.05, 0.05, 0.15]
walls = ["-x", "+x", "-y", "+y", "-z"]
[law]
normal = "hertz"
[[material]]
name = "gel"
density = 2500
youngs_modulus = 5e6
poisson_ratio = 0.3
friction = 0.4
restitution = 0.5
[[shape]]
name = "bead"
kind = "sphere"
radius = 0.004
[[motion]]
walls = ["-z"]
along = [0, 0, 1]
amplitude = 1e-3
frequency = 20
[[fill.lattice]]
first = [0.006, 0.006, 0.006]
spacing = 0.0094
count = [5, 5, 6]
jitter = 5e-4
velocity = [0, 0, -1]
[time]
step = "auto"
duration = 0.05
[output]
history_every = 20
"#;

/// Result of a part of a stage: state, then step, time and time shift of the stage [s], then the end.
type Left = (State, [f64; 3], Finish);

/// Runs a part of a stage on a number of ranks, from a snapshot in the folder or from the beginning.
fn leg(scene: &Scene, folder: &Path, ranks: u32, from: Option<u64>, stops: Option<u64>) -> Left {
    let all = threads::run(ranks, |comm| {
        let mut sim = assemble::assemble(scene, comm);
        match (from, &scene.start) {
            (Some(step), _) => {
                let start = folder.join(particles_name(step));
                assemble::take_up(&mut sim, scene, &start, Continuation::SameStage, comm).unwrap();
            }
            (None, Some(start)) => {
                assemble::take_up(&mut sim, scene, start, Continuation::NewStage, comm).unwrap();
            }
            (None, None) => assemble::fill(&mut sim, scene, comm),
        }
        let last = sim.stage_begin.0 + scene.steps_of(&sim);
        let schedule = Schedule {
            resumed: from.is_some(),
            ends_stage: stops.is_none(),
            snapshot_every: 500,
            ..schedule(scene, stops.unwrap_or(last), folder)
        };
        let finish = run(&mut sim, &schedule, comm, &mut |_| ()).unwrap();
        let times = [sim.dt, sim.stage_time(), sim.stage_shift];
        (State::of(&sim, comm), times, finish)
    });
    let (_, times, finish) = all[0].clone();
    (State::joined(all.into_iter().map(|(state, ..)| state).collect()), times, finish)
}

/// The step becomes shorter when beads strike, the duration of the stage stays, and the shaking floor follows its motion. Bits are identical on 1, 2
/// and 3 ranks, and over restarts before and after the change.
#[test]
fn a_step_of_its_own_follows_the_limit() {
    let scene = scene(FALLING);
    let [whole, legs] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let (state, times, finish) = leg(&scene, whole.path(), 1, None, None);
    let changes =
        |finish: &Finish| finish.warnings.iter().filter(|text| text.contains("steps are")).count();
    println!("{:e} s, then {times:?}; {:#?}", scene.dt, finish.warnings);
    assert!(changes(&finish) >= 2 && times[0] < 0.7 * scene.dt, "{:?}", finish.warnings);
    assert!(times[1] >= 0.05 * (1.0 - 1e-9) && times[1] < 0.05 + times[0], "{times:?}");
    let floor = state.numbers("place of -z")[2];
    assert!((floor - 1e-3 * (TAU * 20.0 * times[1]).sin()).abs() < 1e-12, "{floor:e} m");
    let missing = state.number("missing").abs() / state.number("dissipated");
    assert!(missing < 2e-3, "{missing:e} of the energy is missing");
    for ranks in [2, 3] {
        let other = tempfile::tempdir().unwrap();
        let (same, same_times, _) = leg(&scene, other.path(), ranks, None, None);
        assert!(same == state && same_times == times, "{ranks} ranks: {same_times:?}");
    }
    // Snapshots from before the first change, and from between two.
    let step_at =
        |step: u64| Reader::open(&legs.path().join(particles_name(step))).unwrap().header().dt;
    leg(&scene, legs.path(), 2, None, Some(20));
    leg(&scene, legs.path(), 3, Some(20), Some(60));
    assert!(step_at(20) == scene.dt && scene.dt > step_at(60) && step_at(60) > times[0]);
    let (again, again_times, _) = leg(&scene, legs.path(), 1, Some(60), None);
    assert!(again == state && again_times == times, "over restarts: {again_times:?}");
}

/// An initial compression shortens the step from the first one on.
#[test]
fn a_stage_that_begins_pressed_has_the_step_for_it() {
    let box_of = |walls: f64, more: &str| {
        format!(
            "[domain]\nlow = [0, 0, 0]\nhigh = [0.04, 0.04, 0.04]\nwalls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"]\n\
             [law]\nnormal = \"hertz\"\n{more}\n\
             [[material]]\nname = \"gel\"\ndensity = 2500\nyoungs_modulus = 1e6\npoisson_ratio = 0.3\nfriction = 0.2\nrestitution = 0.3\n\
             [[shape]]\nname = \"bead\"\nkind = \"sphere\"\nradius = 0.005\n\
             [[servo]]\nwalls = [\"+z\"]\nstress = {walls:e}\nmax_speed = 0.5\n"
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let pressed = scene(&format!(
        "{}[[fill.lattice]]\nfirst = [0.005, 0.005, 0.005]\nspacing = 0.01\ncount = [4, 4, 4]\n\
         [time]\nstep = \"auto\"\nsteps = 3000\n",
        box_of(5e4, "largest_overlap = 0.4")
    ));
    leg(&pressed, folder.path(), 1, None, None);
    let unloading = scene(&format!(
        "start = {:?}\n{}[time]\nstep = \"auto\"\nduration = 0.01\n",
        folder.path(),
        box_of(1e3, "")
    ));
    let [one, two] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let (state, times, finish) = leg(&unloading, one.path(), 1, None, None);
    println!("{:e} s, then {times:?}; {:?}", unloading.dt, finish.warnings);
    assert!(finish.warnings[0].contains("steps are"), "{:?}", finish.warnings);
    assert!(times[0] < 0.75 * unloading.dt);
    let (same, same_times, _) = leg(&unloading, two.path(), 2, None, None);
    assert!(same == state && same_times == times);
}

/// A ball that falls on a particle causes a larger overlap than the step allows in a packing. The particle has only two contacts, so the run
/// continues; a step over the limit of these contacts ends it. Closed form: `2 / √(2 c (k_1 + k_2) / m)` with `k = 2 E* √(R δ)` for a particle on a
/// plane and the compliance 7/2 of a sphere.
#[test]
fn a_run_ends_for_the_contacts_that_are_there() {
    let (youngs, poisson, small, large): (f64, f64, f64, f64) = (1e9, 0.3, 0.001, 0.01);
    let text = |ball: f64, grain: f64, speed: f64, dt: f64| {
        format!(
            "[domain]\nlow = [0, 0, 0]\nhigh = [0.1, 0.1, 0.1]\nwalls = [\"-z\"]\n[law]\nnormal = \"hertz\"\n\
             [[material]]\nname = \"m\"\ndensity = 2500\nyoungs_modulus = {youngs:e}\npoisson_ratio = {poisson}\n\
             [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = {large}\n[[shape]]\nname = \"grain\"\nkind = \"sphere\"\nradius = {small}\n\
             [[fill.lattice]]\nshapes = [\"grain\"]\nfirst = [0.05, 0.05, {grain:e}]\ncount = [1, 1, 1]\n\
             [[fill.lattice]]\nshapes = [\"ball\"]\nfirst = [0.05, 0.05, {ball:e}]\ncount = [1, 1, 1]\nvelocity = [0, 0, {speed}]\n\
             [time]\nstep = {dt:e}\nduration = 2e-4\n[output]\nhistory_every = 1\n"
        )
    };
    let modulus = youngs / (1.0 - poisson * poisson);
    let overlaps = [4e-5, 3e-5];
    let height = 2.0 * small + large - overlaps[0] - overlaps[1];
    let pressed = scene(&text(height, small - overlaps[0], 0.0, 1e-9));
    let sim = begun(&pressed, &mut Alone::default());
    // The floor has the modulus of the particles.
    let stiffness: f64 = overlaps.iter().map(|overlap| modulus * (small * overlap).sqrt()).sum();
    let mass = 2500.0 * 4.0 / 3.0 * PI * small.powi(3);
    let right = 2.0 / (2.0 * 3.5 * stiffness / mass).sqrt();
    let (limit, overlap) = limit_of_contacts(&sim.particles, sim.contacts.iter(), &*sim.law);
    close(limit, right, 1e-9, "limit");
    close(overlap, overlaps[0] / small, 1e-9, "overlap");

    let falls = |dt: f64| scene(&text(2.0 * small + large, small, -1.0, dt));
    let outcome = |scene: &Scene, ranks: u32| {
        let folder = tempfile::tempdir().unwrap();
        threads::run(ranks, |comm| {
            let mut sim = assemble::assemble(scene, comm);
            assemble::fill(&mut sim, scene, comm);
            let schedule = schedule(scene, scene.steps_of(&sim), folder.path());
            run(&mut sim, &schedule, comm, &mut |_| ())
        })
        .swap_remove(0)
    };
    let fine = outcome(&falls(1e-9), 1).unwrap();
    let deepest = 2.0 * fine.largest_overlap.0;
    let made_for = falls(1e-9);
    let meant = made_for.force_law().about().hardest_up_to().unwrap();
    let packed = made_for.time_step_limit().unwrap().dt / (deepest / meant).powf(0.25);
    for ranks in [1, 2] {
        let finish = outcome(&falls(1.1 * packed), ranks).unwrap();
        let missing = finish.measures.missing().abs() / finish.measures.kinetic();
        println!("{deepest:.3} of the radius, {:e} s: {missing:e}", 1.1 * packed);
        assert!(finish.stiffened.is_none_or(|words| words.contains("still above the step")));
        assert!(missing < 1e-3, "{missing:e} of the energy is missing");
        let fault = outcome(&falls(1.5 * packed), ranks).unwrap_err().to_string();
        assert!(fault.contains("over the stable limit"), "{fault}");
    }
}

/// Overlaps persist into a stage with stiffer contacts: all forces are five times larger, with a warning.
#[test]
fn contacts_that_jump_between_stages_are_warned_of() {
    let text = |law: &str, material: &str, rest: &str| {
        format!(
            "gravity = [0, 0, -10]\n{rest}\n[domain]\nlow = [0, 0, 0]\nhigh = [0.1, 0.1, 0.1]\nwalls = [\"-z\"]\n{law}\n\
             [[material]]\nname = \"m\"\ndensity = 2500\n{material}\n[[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.01\n\
             [time]\nstep = 1e-6\nsteps = 10\n"
        )
    };
    let at_rest = "[[fill.lattice]]\nfirst = [0.05, 0.05, 0.0099]\ncount = [1, 1, 1]\n";
    let hertz = "[law]\nnormal = \"hertz\"";
    let soft = "youngs_modulus = 2e6\npoisson_ratio = 0.3\nrestitution = 0.5";
    let springs =
        "normal_stiffness = 1e3\nfriction = 0.5\nrestitution = 0.5\ntangential_damping_ratio = 0.1";
    let cases = [
        (hertz, soft, hertz, soft.replace("2e6", "1e7"), "contacts are 5 times as stiff", 5.0),
        (hertz, soft, hertz, soft.replace("0.5", "0.05"), "normal dashpots are", 1.0),
        (
            "",
            springs,
            "",
            springs.replace("1e3", "2.5e2"),
            "contacts are 0.25 times as stiff",
            0.25,
        ),
        (
            "",
            springs,
            "",
            springs.replace("_ratio = 0.1", "_ratio = 0.2"),
            "tangential dashpots are 2 times",
            1.0,
        ),
        ("", springs, hertz, soft.to_owned(), "another law", f64::NAN),
        (hertz, soft, hertz, format!("{soft}\nfriction = 0.1"), "", 1.0),
        ("", springs, "", springs.to_owned(), "", 1.0),
    ];
    for (law, material, law_now, material_now, said, times) in cases {
        let folder = tempfile::tempdir().unwrap();
        let text_before = text(law, material, "") + at_rest;
        let before = scene(&text_before);
        let mut comm = Alone::default();
        let mut sim = begun(&before, &mut comm);
        let force = sim.measure(&mut comm).wall_forces[0].norm();
        sim.step = 7;
        save(&sim, folder.path(), &before, &mut comm);
        let next = scene(&text(law_now, &material_now, &format!("start = {:?}", folder.path())));
        let warned: Vec<String> = doubts::doubts(&next);
        let is_said = |text: &&String| text.contains("differ from those of the snapshot");
        match said {
            "" => assert_eq!(warned.iter().find(is_said), None),
            said => {
                let warning = warned.iter().find(is_said).unwrap_or_else(|| panic!("{said}"));
                assert!(warning.contains(said), "{warning}");
                assert!(plan::plan(&next, 1).contains(said), "{said}");
            }
        }
        let mut sim = assemble::assemble(&next, &comm);
        assemble::take_up(&mut sim, &next, folder.path(), Continuation::NewStage, &mut comm)
            .unwrap();
        sim.begin(&mut comm).unwrap();
        let now = sim.measure(&mut comm).wall_forces[0].norm();
        if times.is_finite() {
            close(now / force, times, 1e-12, said);
        }
    }
}

/// The warning for a servo depends on its stress and not on the overlap that the step assumes.
#[test]
fn a_servo_is_warned_of_by_its_own_stress() {
    let (youngs, poisson) = (1e9_f64, 0.2_f64);
    let warned = |stress: f64| {
        let scene = scene(&format!(
            "[domain]\nlow = [0, 0, 0]\nhigh = [0.1, 0.1, 0.1]\nwalls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"]\n\
             [law]\nnormal = \"hertz\"\nlargest_overlap = 0.133\n\
             [[material]]\nname = \"m\"\ndensity = 2500\nyoungs_modulus = {youngs:e}\npoisson_ratio = {poisson}\n\
             [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.01\n[[servo]]\nwalls = [\"+z\"]\nstress = {stress:e}\nmax_speed = 0.01\n\
             [[fill.lattice]]\nfirst = [0.02, 0.02, 0.02]\nspacing = 0.02\ncount = [2, 2, 2]\n\
             [time]\nstep = \"auto\"\nsteps = 10\n"
        ));
        doubts::doubts(&scene).into_iter().find(|text| text.contains("causes overlaps"))
    };
    assert_eq!(warned(1e4), None);
    let percent = 50.0 * (26.0 * 1e7 / (0.5 * youngs / (1.0 - poisson * poisson))).powf(2.0 / 3.0);
    let words = format!("1e7 Pa causes overlaps of up to {percent:.0} %");
    let warning = warned(1e7).expect("it presses");
    assert!(warning.contains(&words), "{warning}, not {words}");
}

/// Likely mistakes that only a warning can report.
#[test]
fn what_is_most_often_a_mistake_is_warned_of() {
    let text = |walls: &str, velocity: f64, every: u64, outlet: &str| {
        format!(
            "gravity = [0, 0, -9.81]\n[domain]\nlow = [0, 0, 0]\nhigh = [0.1, 0.1, 0.1]\nwalls = [{walls}]\n\
             [[material]]\nname = \"m\"\ndensity = 2500\nnormal_stiffness = 1e4\n\
             [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.004\n\
             [fill.rain]\ncount = 20\nvelocity = [0, 0, {velocity}]\n{outlet}\
             [time]\nstep = 1e-5\nsteps = 60_000\n[output]\nsnapshot_every = {every}\n"
        )
    };
    let drain = "[[outlet]]\nname = \"drain\"\npoint = [0, 0, 0.01]\nnormal = [0, 0, 1]\n";
    let told = |text: &str, part: &str| {
        doubts::doubts(&scene(text)).iter().any(|warning| warning.contains(part))
    };
    let good = text("\"-z\"", -1.0, 1000, "");
    for (text, part) in [
        (text("\"-z\"", 1.0, 1000, ""), "rise first"),
        (text("\"-z\"", -1.0, 1, ""), "snapshot_every = 1 writes some 60000 snapshots"),
        (text("\"+z\"", -1.0, 1000, ""), "through the side -z"),
    ] {
        assert!(told(&text, part), "{part}");
        assert!(!told(&good, part), "{part}");
    }
    assert!(!told(&text("", -1.0, 1000, drain), "through the side"));
}
