//! Inlets and outlets: particles are counted and booked, with identical bits on any number of ranks.

use crate::support::{OnRanks, State, begun, expect_refused, save, scene, schedule};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::threads;
use dem_mpi::drive::{Reporter, Restart};
use dem_mpi::math::Vec3;
use dem_mpi::output::snapshot::{Reader, particles_name};
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble;
use dem_mpi::scene::plan::plan;
use dem_mpi::sim::run::{Ending, Schedule, run};
use std::collections::BTreeSet;
use std::path::Path;

/// A shaft that balls and ellipsoids enter, and that they leave through its bottom and a hatch.
const SHAFT: &str = r#"
gravity = [0.5, 0.2, -9.81]
[domain]
low = [0, 0, 0]
high = [0.02, 0.02, 0.06]
walls = ["-x", "+x", "-y", "+y"]
[[material]]
name = "stone"
density = 2500
normal_stiffness = 120
friction = 0.4
restitution = 0.5
tangential_damping_ratio = 0.1
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.001, 0.0008, 0.0009]
size = { lognormal = { median = 1, sigma = 0.2 }, limits = [0.6, 1.5], by = "mass" }
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.001
[[fill.lattice]]
low = [0, 0, 0.004]
high = [0.02, 0.02, 0.03]
spacing = 0.0033
velocity = [0.4, -0.3, -0.5]
shapes = ["egg"]
[[inlet]]
name = "eggs"
shapes = { egg = 3, ball = 1 }
low = [0.002, 0.002, 0.045]
high = [0.018, 0.018, 0.055]
mass_rate = 0.02
velocity = [0, 0, -1]
spread = 0.3
every = 10
[[inlet]]
name = "balls"
shapes = ["ball"]
axis = [[0.01, 0.01, 0.04], [0.011, 0.012, 0.045]]
radius = 0.004
rate = 4000
count = 60
velocity = [0, 0, -1]
every = 15
[[outlet]]
name = "bottom"
point = [0, 0, 0.002]
normal = [0, 0, 1]
[[outlet]]
name = "hatch"
low = [0, 0, 0.002]
high = [0.01, 0.02, 0.006]
every = 7
[time]
step = 1e-5
steps = 4000
[neighbours]
imbalance = 1.05
[output]
directory = "out"
history_every = 500
"#;

const STEPS: u64 = 3000;

/// Identical particles enter and leave on 1, 2, 3, 4 and 8 ranks and across a restart; none is lost, and the energy balance closes.
#[test]
fn what_comes_and_goes_is_the_same_on_any_number_of_ranks() {
    let scene = scene(SHAFT);
    let folder = tempfile::tempdir().unwrap();
    let alone = OnRanks::of(&scene).the_same_everywhere(STEPS, folder.path());
    let [missing, dissipated] = ["missing", "dissipated"].map(|name| alone.number(name));
    let all = ["entered_eggs", "entered_balls", "left_bottom", "left_hatch"];
    let [eggs, balls, bottom, hatch] = all.map(|name| alone.number(name));
    let first: f64 = 6.0 * 6.0 * 7.0;
    println!("{eggs} {balls} came, {bottom} {hatch} left, {} are there", alone.bits.len());
    println!("{missing:e} J of {dissipated:e} J is missing");
    assert!(eggs > 50.0 && balls == 60.0 && bottom > 50.0 && hatch > 30.0);
    assert!((first + eggs + balls - bottom - hatch - alone.bits.len() as f64).abs() < 0.5);
    // The entered mass follows the due mass to less than one particle.
    let due = 0.02 * STEPS as f64 * scene.dt;
    let largest = 1.5_f64.powi(3) * scene.library.mass[0];
    let came = alone.number("entered_eggs_kg");
    assert!(came <= due && came > due - largest.max(scene.library.mass[1]), "{came} of {due}");
    assert!(missing.abs() < 2e-4 * dissipated, "{missing:e} J of {dissipated:e} J");
    let header = Reader::open(folder.path()).unwrap().header().clone();
    let names: Vec<&str> = header.drives.iter().map(|saved| &*saved.drive).collect();
    assert_eq!(names, ["inlets", "outlets"]);
    // The time of rebuilding the pair list does not matter.
    let wide = Scene { skin: 2.0 * scene.skin, ..scene };
    assert!(OnRanks::of(&wide).run(2, STEPS) == alone, "another skin");
}

/// A particle is removed at the first check at which its centre is in the region: a free fall in closed form.
#[test]
fn a_grain_is_gone_when_its_centre_is_through_the_plane() {
    let text = SHAFT.split("[[inlet]]").next().unwrap().replace("0.5, 0.2, -9.81", "0, 0, -9.81");
    let text = text.replace(
        "low = [0, 0, 0.004]\nhigh = [0.02, 0.02, 0.03]\nspacing = 0.0033\n",
        "first = [0.01, 0.01, 0.03]\ncount = [1, 1, 1]\n",
    ) + "[[outlet]]\nname = \"bottom\"\npoint = [0, 0, 0.002]\nnormal = [0, 0, 1]\nevery = 1\n[time]\nstep = 1e-5\nsteps = 4000\n[output]\ndirectory = \"out\"\n";
    let scene = scene(&text.replace("velocity = [0.4, -0.3, -0.5]\n", ""));
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    let mut before = sim.measure(&mut comm);
    while sim.particles.owned > 0 {
        before = sim.measure(&mut comm);
        sim.step(&mut comm).unwrap();
    }
    let expected = (2.0 * 0.028_f64 / 9.81).sqrt() / scene.dt;
    assert!((sim.step as f64 - expected).abs() <= 1.0, "{} {expected}", sim.step);
    let after = sim.measure(&mut comm);
    assert_eq!((after.particles, after.kinetic()), (0, 0.0));
    assert!((after.missing() - before.missing()).abs() < 1e-12 * before.kinetic());
}

/// No particle appears inside another or in a wall, even at rates that the region cannot carry. The shortfall is reported, and the size distribution
/// stays as requested, including the large particles.
#[test]
fn an_inlet_never_overlaps_and_reports_what_is_short() {
    let text =
        SHAFT.split("[[fill.lattice]]").next().unwrap().replace("[0.5, 0.2, -9.81]", "[0, 0, -1]")
            + r#"
[[inlet]]
name = "tap"
shapes = ["egg"]
low = [0, 0, 0.05]
high = [0.02, 0.02, 0.059]
rate = 1e6
count = 4000
every = 50
[time]
step = 1e-5
steps = 4000
[output]
directory = "out"
"#;
    let scene = scene(&text);
    let words = plan(&scene, 1);
    assert!(words.contains("tap: 1000000 particles per second until 4000 particles"), "{words}");
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    let (mut warnings, mut entered, mut scales) = (Vec::new(), 0, Vec::new());
    for _ in 0..1000 {
        let before = sim.next_id;
        sim.step(&mut comm).unwrap();
        warnings.extend(sim.drives.iter_mut().flat_map(|drive| drive.warnings()));
        let owned = 0..sim.particles.owned;
        for slot in owned.clone().filter(|&slot| sim.particles.id[slot].0 >= before) {
            let (place, radius) = (sim.particles.position[slot], sim.particles.radius(slot));
            for other in owned.clone().filter(|&other| other != slot) {
                let apart = (sim.particles.position[other] - place).norm();
                assert!(apart > radius + sim.particles.radius(other), "{slot} {other}");
            }
            let side = Vec3::new(0.02, 0.02, 1.0) - place;
            assert!(place.x.min(place.y).min(side.x).min(side.y) >= radius);
            entered += 1;
            scales.push(sim.particles.scale_of(slot));
        }
    }
    assert!(entered > 60 && entered == sim.next_id, "{entered}");
    let counted = sim.drives[0].counted();
    assert_eq!(counted[0], ("entered_tap".to_owned(), entered as f64));
    assert_eq!(counted[2], ("missing_tap".to_owned(), 4000.0 - entered as f64));
    assert_eq!(warnings.len(), 1);
    assert!(warnings[0].contains("inlet `tap`: at step 50 "), "{warnings:?}");
    let last = sim.drives[0].outcome(&[], false).warnings;
    assert!(last.len() == 2 && last[1].contains("of 4000 particles inserted"), "{last:?}");
    let stopped = sim.drives[0].outcome(&[], true).warnings;
    assert!(stopped.len() == 1 && stopped[0].contains("due were not inserted"), "{stopped:?}");
    let asked = scene.library.sizes[0].distribution().unwrap();
    let by = dem_mpi::population::sizes::By::Number;
    scales.sort_by(f64::total_cmp);
    let count = scales.len() as f64;
    let off =
        scales.iter().enumerate().map(|(k, &s)| (asked.below(by, s) - k as f64 / count).abs());
    let off = off.fold(0.0, f64::max);
    assert!(off < 1.95 / count.sqrt(), "{off} of {count}");
}

/// An inlet with more due particles than can enter gives a warning, before the start and during the run.
#[test]
fn more_than_come_at_a_time_are_missed() {
    let shaft = SHAFT.split("[[fill.lattice]]").next().unwrap();
    let tap = "[[inlet]]\nname = \"tap\"\nshapes = [\"ball\"]\nlow = [0.005, 0.005, 0.05]\nhigh = [0.015, 0.015, 0.059]\n\
               rate = 1e6\nevery = 500\nvelocity = [0, 0, -1]\n[time]\nstep = 1e-5\nsteps = 1000\nallow_unstable = true\n[output]\ndirectory = \"out\"\n";
    let small = shaft.replace("radius = 0.001", "radius = 0.00005");
    let begins = |begin: &str| {
        scene(&format!("{small}{tap}").replace("every = 500", &format!("every = 500\n{begin}")))
    };
    let told = |scene: &Scene, what: &str| {
        dem_mpi::scene::doubts::doubts(scene).iter().any(|doubt| doubt.contains(what))
    };
    let scene = begins("");
    assert!(told(&scene, "some 5000 particles are due"));
    assert_eq!(scene.particle_count(), 10_000);
    // An inlet that begins later has less time: two checks, or half of the time between checks.
    assert!(told(&begins("begin = 0.003"), "some 5000 particles are due"));
    let late = begins("begin = 0.0075");
    assert!(told(&late, "some 2500 particles are due"));
    assert_eq!(late.particle_count(), 2500);
    let later = begins("begin = 0.0095");
    assert!(!told(&later, "particles are due") && later.particle_count() == 500);
    assert_eq!(begins("begin = 3").particle_count(), 0);
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    (0..500).for_each(|_| sim.step(&mut comm).unwrap());
    let counted = sim.drives[0].counted();
    assert_eq!(counted[0].1, 1000.0);
    assert_eq!(counted[2], ("missing_tap".to_owned(), 4000.0));
    let warnings = sim.drives[0].warnings();
    assert!(warnings[0].contains("more than 1000 of its particles are due"), "{warnings:?}");
}

/// No particle appears in the wall of a cylinder of any size.
#[test]
fn no_grain_appears_in_a_round_wall() {
    let text = SHAFT.split("[[fill.lattice]]").next().unwrap().to_owned()
        + "[[wall]]\nname = \"pipe\"\ncylinder = { from = [-0.49, 0.01, -0.1], to = [-0.49, 0.01, 0.2], radius = 0.5 }\n\
           [[inlet]]\nname = \"tap\"\nshapes = [\"ball\"]\nlow = [0.002, 0.002, 0.045]\nhigh = [0.018, 0.018, 0.055]\n\
           rate = 1e6\nvelocity = [0, 0, -1]\n[time]\nstep = 1e-5\nsteps = 100\nallow_unstable = true\n[output]\ndirectory = \"out\"\n";
    let scene = scene(&text.replace("radius = 0.001\n", "radius = 0.0002\n"));
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    (0..100).for_each(|_| sim.step(&mut comm).unwrap());
    let places = &sim.particles.position[..sim.particles.owned];
    let from_wall = |p: &Vec3| ((p.x + 0.49).hypot(p.y - 0.01) - 0.5).abs();
    let nearest = places.iter().map(from_wall).fold(f64::INFINITY, f64::min);
    println!("{} grains, {nearest:e} m from the wall", places.len());
    assert!(places.len() > 500 && (0.0002..0.0004).contains(&nearest), "{nearest:e}");
}

/// A stage that continues with another time step keeps the time of its clock, and its inlets the matching number of particles.
#[test]
fn another_step_leaves_the_time_of_a_stage() {
    let shaft = SHAFT.split("[[fill.lattice]]").next().unwrap();
    let with = |step: f64| {
        scene(&format!(
            "{shaft}[[inlet]]\nname = \"tap\"\nshapes = [\"ball\"]\nlow = [0.002, 0.002, 0.045]\nhigh = [0.018, 0.018, 0.055]\n\
             rate = 4000\nvelocity = [0, 0, -1]\nevery = 10\n[time]\nstep = {step:?}\nduration = 0.02\nallow_unstable = true\n[output]\ndirectory = \"out\"\n"
        ))
    };
    let first = with(1e-5);
    assert_eq!(first.steps, 2000);
    let mut comm = Alone::default();
    let mut sim = begun(&first, &mut comm);
    (0..1000).for_each(|_| sim.step(&mut comm).unwrap());
    let folder = tempfile::tempdir().unwrap();
    for step in [5e-6, 2e-5] {
        save(&sim, folder.path(), &first, &mut comm);
        let next = with(step);
        let mut sim = assemble::assemble(&next, &comm);
        let same = assemble::Continuation::SameStage;
        assemble::take_up(&mut sim, &next, folder.path(), same, &mut comm).unwrap();
        let last = sim.stage_begin.0 + next.steps_of(&sim);
        assert_eq!(last, 1000 + (0.01 / step).round() as u64);
        while sim.step < last {
            sim.step(&mut comm).unwrap();
        }
        assert!((sim.time() - 0.02).abs() < 1e-12 && (sim.stage_time() - 0.02).abs() < 1e-12);
        let entered = sim.drives[0].counted()[0].1;
        assert!((entered - 80.0).abs() <= 1.0, "{step}: {entered}");
        // The shift survives another restart.
        let again = folder.path().join("again");
        save(&sim, &again, &next, &mut comm);
        let reader = Reader::open(&again).unwrap();
        assert_eq!(reader.header().stage_shift, sim.stage_shift);
        assert!(sim.stage_shift != 0.0);
    }
}

/// Text of the shaft with only these inlets, each with balls or ellipsoids in one box.
fn shaft_with(inlets: &[(&str, &str, &str)]) -> String {
    let head = SHAFT.split("[[fill.lattice]]").next().unwrap();
    let inlets = inlets.iter().map(|(name, shape, more)| {
        format!(
            "[[inlet]]\nname = \"{name}\"\nshapes = [\"{shape}\"]\nlow = [0.002, 0.002, 0.045]\nhigh = [0.018, 0.018, 0.055]\n\
             velocity = [0, 0, -1]\nevery = 10\n{more}\n"
        )
    });
    format!(
        "{head}{}{}",
        inlets.collect::<Vec<_>>().concat(),
        &SHAFT[SHAFT.find("[[outlet]]").unwrap()..]
    )
}

/// Balls from 0.0123 s on, one in 50 steps, and ellipsoids from 0.02 s on.
const LATE: [(&str, &str, &str); 2] = [
    ("balls", "ball", "rate = 2000\nbegin = 0.0123"),
    ("eggs", "egg", "mass_rate = 0.01\nbegin = 0.02"),
];

/// The due amount counts from the beginning of the inlet. No particle enters earlier, and the first one enters when due. Each check gives the due
/// number, or one less that waits for a place.
#[test]
fn an_inlet_begins_when_it_says() {
    let scene = scene(&shaft_with(&LATE));
    let words = plan(&scene, 1);
    assert!(
        words.contains("balls: 2000 particles per second from 0.0123 s of the stage on, every")
    );
    let largest = 1.5_f64.powi(3) * scene.library.mass[0];
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    let mut first = None;
    for step in 1..=3000_u64 {
        sim.step(&mut comm).unwrap();
        let counted = sim.drives[0].counted();
        let (balls, eggs) = (counted[0].1, counted[4].1);
        if balls > 0.0 {
            first.get_or_insert(step);
        }
        if step % 10 > 0 {
            continue;
        }
        let due = (step.saturating_sub(1230) / 50) as f64;
        assert!(balls <= due && balls >= due - 1.0, "step {step}: {balls} of {due}");
        let due = (0.01 * (step as f64 - 2000.0) * scene.dt).max(0.0);
        assert!(eggs <= due * (1.0 + 1e-9), "step {step}: {eggs:e} of {due:e} kg");
        assert!(eggs > due - 2.0 * largest, "step {step}: {eggs:e} of {due:e} kg");
    }
    assert_eq!(first, Some(1280));
    let counted = sim.drives[0].counted();
    assert!((counted[0].1 - 2000.0 * (0.03 - 0.0123)).abs() <= 1.0 && counted[3].1 > 5.0);
}

/// Identical bits on any number of ranks, and across restarts before, between and after the beginnings of the inlets.
#[test]
fn inlets_that_begin_later_are_the_same_on_any_number_of_ranks() {
    let scene = scene(&shaft_with(&LATE));
    let folder = tempfile::tempdir().unwrap();
    let ranks = OnRanks::of(&scene);
    let alone = ranks.the_same_everywhere(3000, folder.path());
    assert!(alone.number("entered_balls") > 33.0 && alone.number("entered_eggs") > 5.0);
    for saved in [1000, 1279, 1280, 2500] {
        let again = ranks.restarted([2, 3], [saved, 3000], folder.path());
        assert!(again == alone, "from step {saved}");
    }
}

/// A stage that continues with another time step starts its inlets by its clock.
#[test]
fn another_step_leaves_the_begin_of_an_inlet() {
    let with =
        |step: &str| scene(&shaft_with(&LATE[..1]).replace("step = 1e-5\nsteps = 4000", step));
    let first = with("step = 1e-5\nduration = 0.03");
    let mut comm = Alone::default();
    let mut sim = begun(&first, &mut comm);
    (0..1000).for_each(|_| sim.step(&mut comm).unwrap());
    let folder = tempfile::tempdir().unwrap();
    save(&sim, folder.path(), &first, &mut comm);
    for step in ["5e-6", "2e-5"] {
        let next = with(&format!("step = {step}\nduration = 0.03\nallow_unstable = true"));
        let mut sim = assemble::assemble(&next, &comm);
        let same = assemble::Continuation::SameStage;
        assemble::take_up(&mut sim, &next, folder.path(), same, &mut comm).unwrap();
        assert!(sim.stage_shift != 0.0);
        let last = sim.stage_begin.0 + next.steps_of(&sim);
        while sim.step < last {
            sim.step(&mut comm).unwrap();
            let came = sim.drives[0].counted()[0].1;
            assert!(came == 0.0 || sim.stage_time() > 0.0128 - 1e-12, "{step}: {came}");
        }
        let came = sim.drives[0].counted()[0].1;
        assert!((came - 2000.0 * (0.03 - 0.0123)).abs() <= 1.0, "{step}: {came}");
    }
}

/// Two batches with an empty pause between them: a stage that ends when no particle remains waits for the second.
#[test]
fn batches_follow_each_other() {
    let text = shaft_with(&[
        ("first", "ball", "rate = 2000\ncount = 5"),
        ("second", "egg", "rate = 2000\ncount = 7\nbegin = 0.08"),
    ]);
    let text = format!("{text}[stop]\nremaining = 0\n").replace("steps = 4000", "steps = 20000");
    let scene = scene(&text);
    let folder = tempfile::tempdir().unwrap();
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    let mut moments = Vec::new();
    while sim.drives[0].standing().unfinished.is_some() {
        let before = sim.next_id;
        sim.step(&mut comm).unwrap();
        moments.extend((before..sim.next_id).map(|_| sim.step));
        if sim.step == 8000 {
            assert_eq!(sim.particles.owned, 0, "the first batch has left");
        }
    }
    let due = |begin: u64, count: u64| (1..=count).map(move |k| begin + 50 * k);
    let due: Vec<u64> = due(0, 5).chain(due(8000, 7)).collect();
    assert_eq!(moments, due);
    let mut sim = begun(&scene, &mut comm);
    let schedule = schedule(&scene, scene.steps, folder.path());
    let finish = run(&mut sim, &schedule, &mut comm, &mut |_| ()).unwrap();
    assert_eq!(finish.ending, Ending::Rest, "{}", finish.unmet);
    assert!(sim.step > 8350 && sim.step < 20_000, "{}", sim.step);
    let counted = sim.drives[0].counted();
    assert_eq!((counted[0].1, counted[3].1), (5.0, 7.0));
    // A stage that ends earlier reports the particles that did not enter.
    let mut sim = begun(&scene, &mut comm);
    (0..400).for_each(|_| sim.step(&mut comm).unwrap());
    let last = sim.drives[0].outcome(&[], false).warnings;
    assert!(
        last.len() == 1 && last[0].contains("`second`: only 0 of 7 particles inserted"),
        "{last:?}"
    );
}

/// A state saved before inlets had a `begin` continues only where they begin with the stage.
#[test]
fn an_inlet_without_a_begin_began_with_its_stage() {
    let (scene, mut comm) = (scene(SHAFT), Alone::default());
    let mut sim = begun(&scene, &mut comm);
    (0..200).for_each(|_| sim.step(&mut comm).unwrap());
    let counted = sim.drives[0].counted();
    let mut saved = State::of(&sim, &mut comm).drives.swap_remove(0);
    let columns = saved.columns.len();
    saved.columns.retain(|saved| saved.column.name != "begin");
    assert_eq!(saved.columns.len(), columns - 1);
    let mut again = begun(&scene, &mut comm);
    let restart =
        Restart { saved: &saved, is_new_stage: false, library: &scene.library, is_root: true };
    again.drives[0].resume(&restart, &mut []).unwrap();
    assert_eq!(again.drives[0].counted(), counted);
    let late = crate::support::scene(&SHAFT.replace("every = 15", "every = 15\nbegin = 0.01"));
    let error = begun(&late, &mut comm).drives[0].resume(&restart, &mut []);
    assert!(error.unwrap_err().0.contains("inlet `balls` had a begin of 0.0"));
}

/// Particles fast enough to pass an outlet between two checks give a warning.
#[test]
fn an_outlet_that_grains_may_pass_unseen_is_warned_of() {
    let text = SHAFT.replace("every = 7", "every = 700");
    let scene = scene(&text);
    let folder = tempfile::tempdir().unwrap();
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    assemble::fill(&mut sim, &scene, &comm);
    let mut warnings = Vec::new();
    run(&mut sim, &schedule(&scene, 600, folder.path()), &mut comm, &mut |progress| {
        warnings.extend_from_slice(progress.warnings);
    })
    .unwrap();
    let told: Vec<_> =
        warnings.iter().filter(|w| w.contains("outlet `hatch` checks every 700")).collect();
    assert_eq!(told.len(), 1, "{warnings:?}");
}

/// A stage ends at a given number of removed or of remaining particles. The last columns of the history have the counts.
#[test]
fn a_stage_ends_when_enough_have_left() {
    for (stop, holds) in [("left = 40", 40.0), ("remaining = 0", 312.0)] {
        let text = SHAFT.replace("mass_rate = 0.02", "mass_rate = 0.02\nmass = 1e-9");
        let text = format!("{text}[stop]\n{stop}\n").replace("steps = 4000", "steps = 20000");
        let scene = scene(&text);
        let folder = tempfile::tempdir().unwrap();
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(&scene, &comm);
        assemble::fill(&mut sim, &scene, &comm);
        let finish =
            run(&mut sim, &schedule(&scene, scene.steps, folder.path()), &mut comm, &mut |_| ())
                .unwrap();
        assert_eq!(finish.ending, Ending::Rest, "{stop}: {}", finish.unmet);
        assert_eq!(Reader::open(folder.path()).unwrap().header().stop, stop);
        let mut table = csv::Reader::from_path(folder.path().join("history.csv")).unwrap();
        let columns: Vec<String> = table.headers().unwrap().iter().map(str::to_owned).collect();
        let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
        let last = |name: &str| -> f64 {
            let column = columns.iter().position(|column| column == name).unwrap();
            rows[rows.len() - 1][column].parse().unwrap()
        };
        let left = last("left_bottom") + last("left_hatch");
        let came = 252.0 + last("entered_balls") + last("entered_eggs");
        assert!(left >= holds, "{stop}: {left}");
        assert!((last("particles") - (came - left)).abs() < 0.5, "{stop}");
        assert!(last("left_bottom_kg") > 0.0 && sim.step < 20_000);
    }
}

/// A particle without a place blocks all behind it, so an inlet too narrow for its largest particle is rejected. Column names are unique.
#[test]
fn inlets_that_would_stop_and_names_of_other_columns_are_refused() {
    let good = SHAFT
        .split("[[fill.lattice]]")
        .next()
        .unwrap()
        .replace("radius = 0.001\n", "radius = 1.0\nsize = { table = [[0.001, 0], [0.002, 1]] }\n")
        + "[[inlet]]\nname = \"tap\"\nshapes = [\"ball\"]\nlow = [0.002, 0.002, 0.05]\nhigh = [0.018, 0.018, 0.05]\nrate = 10\n\
           [time]\nstep = 1e-6\nsteps = 400\n[output]\ndirectory = \"out\"\n";
    scene(&good);
    expect_refused(
        &good,
        "[0.002, 1]",
        "[0.002, 0.99], [0.011, 1]",
        "places is free for the largest particle",
    );
    expect_refused(
        &good,
        "\"tap\"",
        "\"J\"",
        "history.csv has a column missing_J already: use another name",
    );
    // In a wide enough shaft the large particle is accepted.
    scene(&good.replace("[0.002, 1]", "[0.002, 0.99], [0.007, 1]"));
}

/// An outlet around an inlet is rejected, as it would remove particles at once.
#[test]
fn an_outlet_around_an_inlet_is_refused() {
    let around = "point = [0, 0, 0.05]\nnormal = [0, 0, 1]\n[[outlet]]\nname = \"hatch\"";
    expect_refused(
        SHAFT,
        "point = [0, 0, 0.002]\nnormal = [0, 0, 1]\n[[outlet]]\nname = \"hatch\"",
        around,
        "inlet.eggs: overlaps outlet `bottom`",
    );
}

#[test]
fn amounts_that_cannot_be_are_refused() {
    expect_refused(SHAFT, "count = 60", "count = 60.5", "must be a whole number");
    for (begin, said) in [
        ("-0.1", "inlet.balls.begin = -0.1: must be a number, 0 or greater [s]"),
        ("inf", "inlet.balls.begin = inf: must be a number, 0 or greater [s]"),
        ("\"0.1\"", "must be a number, 0 or greater [s], not a string"),
    ] {
        expect_refused(SHAFT, "count = 60", &format!("count = 60\nbegin = {begin}"), said);
    }
    let stop = "[stop]\nremaining = 3\n[output]";
    expect_refused(SHAFT, "[output]", stop, "is never reached: an [[inlet]] without");
}

/// Inlets and outlets that act less often than the stage has steps, or lie where no particle is, give a warning.
#[test]
fn inlets_and_outlets_that_never_act_are_doubtful() {
    for (from, to, doubt) in [
        (
            "every = 15",
            "every = 4001",
            "inlet `balls` acts every 4001 steps, and the stage has 4000",
        ),
        ("every = 7", "every = 5000", "outlet `hatch` acts every 5000 steps"),
        (
            "every = 15",
            "every = 15\nbegin = 0.04",
            "inlet `balls` begins after 0.04 s of the stage, but can insert particles only until 3.990e-2 s: it \
             inserts none",
        ),
        (
            "high = [0.01, 0.02, 0.006]",
            "high = [0.01, 0.02, -0.7]",
            "outlet `hatch` is outside the domain",
        ),
        ("high = [0.01, 0.02, 0.006]", "high = [0.01, 0.02, -0.002]", "outlet `hatch` is outside"),
        ("point = [0, 0, 0.002]", "point = [0, 0, -0.002]", "outlet `bottom` is outside"),
    ] {
        let text = SHAFT.replace(from, to).replace("low = [0, 0, 0.002]", "low = [0, 0, -0.8]");
        let doubts = dem_mpi::scene::doubts::doubts(&scene(&text));
        assert!(doubts.iter().any(|told| told.contains(doubt)), "{doubts:?}");
    }
    let below = SHAFT.replace(
        "low = [0, 0, 0.002]\nhigh = [0.01, 0.02, 0.006]",
        "low = [0, 0, -0.01]\nhigh = [0.01, 0.02, -0.001]",
    );
    let plane = SHAFT.replace("point = [0, 0, 0.002]", "point = [0, 0, -0.001]");
    let late = SHAFT.replace("every = 15", "every = 15\nbegin = 0.0398");
    for fine in [SHAFT, &below, &plane, &late] {
        assert_eq!(dem_mpi::scene::doubts::doubts(&scene(fine)), Vec::<String>::new());
    }
}

/// The due amount counts from the beginning of the stage, and within it an inlet keeps its rate.
#[test]
fn an_inlet_keeps_its_rate_within_a_stage() {
    let (first, mut comm) = (scene(SHAFT), Alone::default());
    let mut sim = begun(&first, &mut comm);
    (0..200).for_each(|_| sim.step(&mut comm).unwrap());
    let folder = tempfile::tempdir().unwrap();
    save(&sim, folder.path(), &first, &mut comm);
    let mut taken = |text: &str, how| {
        let next = scene(text);
        let mut sim = assemble::assemble(&next, &comm);
        let taken = assemble::take_up(&mut sim, &next, folder.path(), how, &mut comm);
        taken.map(drop).map_err(|error| error.to_string())
    };
    for (from, to, problem) in [
        ("rate = 4000", "rate = 8000", "inlet `balls` had a rate of 4000.0 when the stage began"),
        (
            "mass_rate = 0.02",
            "rate = 900",
            "inlet `eggs` had a mass_rate of 0.02 when the stage began",
        ),
        (
            "every = 15",
            "every = 15\nbegin = 0.01",
            "inlet `balls` had a begin of 0.0 when the stage began",
        ),
        (
            "name = \"balls\"",
            "name = \"marbles\"",
            "inlet `marbles` did not exist when the stage began",
        ),
    ] {
        let text = SHAFT.replace(from, to);
        let error = taken(&text, assemble::Continuation::SameStage).unwrap_err();
        assert!(error.contains(problem), "{error}");
        assert_eq!(taken(&text, assemble::Continuation::NewStage), Ok(()));
    }
    assert_eq!(
        taken(&SHAFT.replace("count = 60", "count = 80"), assemble::Continuation::SameStage),
        Ok(())
    );
    // A continued stage without inlets cannot gain one.
    let (begin, end) = (SHAFT.find("[[inlet]]").unwrap(), SHAFT.find("[[outlet]]").unwrap());
    let without = scene(&(SHAFT[..begin].to_owned() + &SHAFT[end..]));
    save(&begun(&without, &mut comm), folder.path(), &without, &mut comm);
    let mut sim = assemble::assemble(&first, &comm);
    let same = assemble::Continuation::SameStage;
    let error = assemble::take_up(&mut sim, &first, folder.path(), same, &mut comm).unwrap_err();
    assert!(error.to_string().contains("inlet `eggs` did not exist"), "{error}");
}

/// Under damping, particles of an inlet bring their energy; another gravity gives them another potential energy.
#[test]
fn damping_and_another_gravity_leave_the_balance_closed() {
    let (begin, end) = (SHAFT.find("[[fill").unwrap(), SHAFT.find("[[inlet").unwrap());
    let text = format!("global_damping = 30\n{}{}", &SHAFT[..begin], &SHAFT[end..])
        .replace("low = [0, 0, 0]\n", "low = [0, 0, -100]\n")
        .replace("point = [0, 0, 0.002]", "point = [0, 0, -99]")
        .replace(
            "low = [0, 0, 0.002]\nhigh = [0.01, 0.02, 0.006]",
            "low = [0, 0, -90]\nhigh = [0.01, 0.02, -89]",
        );
    let (first, mut comm) = (scene(&text), Alone::default());
    let mut sim = begun(&first, &mut comm);
    // No contact has begun.
    (0..300).for_each(|_| sim.step(&mut comm).unwrap());
    let closed = |sim: &dem_mpi::sim::Simulation, what: &str| {
        let measures = sim.measure(&mut Alone::default());
        assert!(sim.particles.owned > 3 && measures.contacts == 0, "{what}");
        let of = measures.kinetic() + measures.dissipated;
        assert!(
            measures.missing().abs() < 1e-11 * of,
            "{what}: {:e} of {of:e} J",
            measures.missing()
        );
    };
    closed(&sim, "as they come");
    let folder = tempfile::tempdir().unwrap();
    save(&sim, folder.path(), &first, &mut comm);
    for (from, to) in [
        ("gravity = [0.5, 0.2, -9.81]", "gravity = [0, 0.1, -1.62]"),
        ("step = 1e-5", "step = 7e-6"),
    ] {
        let next = scene(&text.replace(from, to));
        let mut sim = assemble::assemble(&next, &comm);
        let same = assemble::Continuation::SameStage;
        assemble::take_up(&mut sim, &next, folder.path(), same, &mut comm).unwrap();
        closed(&sim, to);
        (0..100).for_each(|_| sim.step(&mut comm).unwrap());
        closed(&sim, to);
    }
}

/// Particles that appear at rest have only potential energy, and the rounding of its balance gives no warning.
#[test]
fn the_first_grains_of_an_inlet_raise_no_alarm() {
    let text = SHAFT
        .replace("velocity = [0, 0, -1]\nspread = 0.3\n", "")
        .replace("history_every = 500", "history_every = 10");
    let text =
        text[..text.find("[[fill").unwrap()].to_owned() + &text[text.find("[[inlet").unwrap()..];
    let scene = scene(&text);
    let (mut sim, mut comm) = (begun(&scene, &mut Alone::default()), Alone::default());
    let folder = tempfile::tempdir().unwrap();
    let schedule = schedule(&scene, 60, folder.path());
    let finish = run(&mut sim, &schedule, &mut comm, &mut |_| {}).unwrap();
    assert!(sim.particles.owned > 0, "grains came");
    assert!(finish.warnings.is_empty(), "{:?}", finish.warnings);
}

/// A particle leaves through the outlet that checks first while it is inside, even if another outlet covers the place. If both check in one step, the
/// first one of the scene takes it.
#[test]
fn a_grain_leaves_through_the_outlet_that_looks() {
    let shaft =
        SHAFT.split("[[fill.lattice]]").next().unwrap().replace("0.5, 0.2, -9.81", "0, 0, -9.81");
    let with = |every: [u32; 2]| {
        let outlet = |name: &str, every: u32| {
            format!(
                "[[outlet]]\nname = \"{name}\"\npoint = [0, 0, 0.002]\nnormal = [0, 0, 1]\nevery = {every}\n"
            )
        };
        let text = format!(
            "{shaft}[[fill.lattice]]\nshapes = [\"ball\"]\nfirst = [0.01, 0.01, 0.01]\ncount = [1, 1, 1]\n{}{}\
             [time]\nstep = 1e-5\nsteps = 10000\n[output]\ndirectory = \"out\"\n",
            outlet("first", every[0]),
            outlet("second", every[1])
        );
        let mut comm = Alone::default();
        let mut sim = begun(&scene(&text), &mut comm);
        while sim.particles.owned > 0 {
            sim.step(&mut comm).unwrap();
        }
        let counted: Vec<f64> = sim.drives[0].counted().iter().map(|(_, number)| *number).collect();
        let mass = sim.particles.library.mass[1];
        assert_eq!((counted[1], counted[3]), (counted[0] * mass, counted[2] * mass));
        (sim.step, [counted[0], counted[2]])
    };
    // The particle passes the plane after 4038.6 steps.
    assert_eq!(with([1000, 1]), (4039, [0.0, 1.0]));
    assert_eq!(with([1, 1000]), (4039, [1.0, 0.0]));
    assert_eq!(with([1000, 700]), (4200, [0.0, 1.0]));
    assert_eq!(with([700, 1400]), (4200, [1.0, 0.0]));
}

/// The shortfall has the unit of the rate and ends where the inlet ends, even if that end has the other unit.
#[test]
fn what_is_missing_ends_where_the_inlet_ends() {
    // Particles of 1 g, one place, and two checks of it: two enter, because the first has moved away at the second check.
    let density = 1e-3 / (4.0 / 3.0 * std::f64::consts::PI * 1e-9);
    let with = |amounts: &str| {
        let text = format!(
            "[domain]\nlow = [0, 0, 0]\nhigh = [0.1, 0.1, 0.1]\n[[material]]\nname = \"lead\"\ndensity = {density:?}\n\
             normal_stiffness = 10\n[[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.001\n[[inlet]]\nname = \"tap\"\n\
             low = [0.05, 0.05, 0.05]\nhigh = [0.05, 0.05, 0.05]\nvelocity = [0.02, 0, 0]\nevery = 500\n{amounts}\n\
             [time]\nstep = 1e-3\nsteps = 2000\n[output]\ndirectory = \"out\"\n"
        );
        let mut comm = Alone::default();
        let mut sim = begun(&scene(&text), &mut comm);
        (0..1000).for_each(|_| sim.step(&mut comm).unwrap());
        assert_eq!(sim.particles.owned, 2, "{amounts}");
        let counted = sim.drives[0].counted();
        (counted[2].1, sim.drives[0].outcome(&[], false).warnings[0].clone())
    };
    for (amounts, missing, told) in [
        ("mass_rate = 1\ncount = 10", 0.008, "8.0000e-3 kg"),
        ("mass_rate = 1\nmass = 0.01", 0.008, "8.0000e-3 kg"),
        ("mass_rate = 0.005\ncount = 10", 0.003, "3.0000e-3 kg"),
        ("mass_rate = 1", 0.998, "9.9800e-1 kg"),
        ("rate = 1000\nmass = 0.00999", 8.0, "8 particles"),
        ("rate = 1000\ncount = 10", 8.0, "8 particles"),
        ("rate = 5\nmass = 0.01", 3.0, "3 particles"),
        // More than can enter at a check: the end is known only on average.
        ("mass_rate = 3\ncount = 2000", 1.998, "1.9980e0 kg"),
        ("rate = 3000\nmass = 1.9999", 1998.0, "1998 particles"),
    ] {
        let (found, warning) = with(amounts);
        assert!((found - missing).abs() < 1e-12 * missing.max(1.0), "{amounts}: {found:e}");
        let told = format!(
            "inlet `tap`: {told} due were not inserted; inserted: 2 particles, 2.0000e-3 kg"
        );
        assert_eq!(warning, told, "{amounts}");
    }
}

/// Orientation and spin of ellipsoids from an inlet. They point along a direction with a tilt of up to s = 30 degrees. Its cosine has the mean (1 +
/// cos s)/2 and the variance (1 - cos s)²/12. Each component of the spin is within 5 rad/s. Its mean square is 25/3, and the variance of the square
/// is 625 · 4/45. The tolerance is five standard errors.
#[test]
fn grains_of_an_inlet_point_along_an_axis_and_spin() {
    let text = "[domain]\nlow = [0, 0, 0]\nhigh = [0.2, 0.2, 0.2]\n[[material]]\nname = \"stone\"\ndensity = 2500\nnormal_stiffness = 100\n\
                [[shape]]\nname = \"egg\"\nkind = \"ellipsoid\"\nsemi_axes = [0.002, 0.001, 0.0015]\n[[inlet]]\nname = \"tap\"\n\
                low = [0.02, 0.02, 0.02]\nhigh = [0.18, 0.18, 0.18]\nrate = 1e9\nevery = 1\nvelocity = [0, 0, -1]\nspin = 5\n\
                orientation = { axis = [1, -2, 2], spread = 30, own = \"x\" }\n\
                [time]\nstep = 1e-5\nsteps = 100\n[output]\ndirectory = \"out\"\n";
    let (scene, mut comm) = (scene(text), Alone::default());
    let mut sim = begun(&scene, &mut comm);
    let (axis, least) = (Vec3::new(1.0, -2.0, 2.0) / 3.0, 30.0_f64.to_radians().cos());
    let (mut count, mut cosines, mut squares, mut spins) = (0.0, 0.0, Vec3::zeros(), Vec3::zeros());
    for _ in 0..3 {
        let before = sim.next_id;
        sim.step(&mut comm).unwrap();
        for slot in 0..sim.particles.owned {
            let grain = sim.particles.owned_particle(slot);
            if grain.id.0 < before {
                continue;
            }
            let cosine = (grain.quaternion * Vec3::x()).dot(&axis);
            assert!(cosine > least - 1e-12, "{cosine}");
            // L = R I Rᵀ ω
            let local = grain.quaternion.inverse_transform_vector(&grain.angular_momentum);
            let spin = grain.quaternion * local.component_div(&sim.particles.inertia(slot));
            assert!(spin.amax() <= 5.0 + 1e-9, "{spin}");
            (count, cosines) = (count + 1.0, cosines + cosine);
            (squares, spins) = (squares + spin.component_mul(&spin), spins + spin);
        }
    }
    assert!(count > 2500.0, "{count}");
    let error = 5.0 / f64::sqrt(count);
    let off = cosines / count - 0.5 * (1.0 + least);
    assert!(off.abs() < error * (1.0 - least) / 12.0_f64.sqrt(), "{off:e}");
    assert!((spins / count).amax() < error * 5.0 / 3.0_f64.sqrt(), "{spins}");
    let off = squares / count - Vec3::repeat(25.0 / 3.0);
    assert!(off.amax() < error * (625.0 * 4.0 / 45.0_f64).sqrt(), "{off}");
    // The rotational energy of entering particles is booked.
    let measures = sim.measure(&mut comm);
    assert!(measures.rotation > 0.0);
    assert!(measures.missing().abs() < 1e-11 * measures.kinetic(), "{:e}", measures.missing());
}

/// Each component of the velocity is uniform within `spread` of the inlet's velocity. In units of the spread, the mean square is 1/3 and the variance
/// of the square 4/45. The tolerance is five standard errors.
#[test]
fn velocities_of_an_inlet_are_spread_evenly() {
    let text = "[domain]\nlow = [0, 0, 0]\nhigh = [0.2, 0.2, 0.2]\n[[material]]\nname = \"stone\"\ndensity = 2500\nnormal_stiffness = 100\n\
                [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.002\n[[inlet]]\nname = \"tap\"\n\
                low = [0.02, 0.02, 0.02]\nhigh = [0.18, 0.18, 0.18]\nrate = 1e9\nevery = 1\nvelocity = [0.5, 0, -1]\nspread = 0.3\n\
                [time]\nstep = 1e-5\nsteps = 100\n[output]\ndirectory = \"out\"\n";
    let (scene, mut comm) = (scene(text), Alone::default());
    let mut sim = begun(&scene, &mut comm);
    sim.step(&mut comm).unwrap();
    let count = sim.particles.owned;
    assert!(count > 500, "{count}");
    let (mut sum, mut squares, mut farthest) = (Vec3::zeros(), Vec3::zeros(), Vec3::zeros());
    for velocity in &sim.particles.velocity[..count] {
        let off = (velocity - Vec3::new(0.5, 0.0, -1.0)) / 0.3;
        (sum, squares) = (sum + off, squares + off.component_mul(&off));
        farthest = farthest.sup(&off.abs());
    }
    // Among 500 values some are in the last fiftieth: 0.98⁵⁰⁰ is 4e-5.
    assert!(farthest.max() < 1.0 + 1e-12 && farthest.min() > 0.98, "{farthest}");
    let error = 5.0 / f64::sqrt(count as f64);
    assert!((sum / count as f64).amax() < error / 3.0_f64.sqrt(), "{sum}");
    let off = squares / count as f64 - Vec3::repeat(1.0 / 3.0);
    assert!(off.amax() < error * (4.0 / 45.0_f64).sqrt(), "{off}");
}

/// Particles that appear at a periodic border keep clear of images beyond it: of particles, and of a plate of triangles.
#[test]
fn an_inlet_keeps_clear_of_images() {
    let folder = tempfile::tempdir().unwrap();
    let plate = folder.path().join("plate.obj");
    let corners = "v 0.004 0.0004 0\nv 0.02 0.0004 0\nv 0.02 0.0004 0.06\nv 0.004 0.0004 0.06\n";
    std::fs::write(&plate, format!("{corners}f 1 2 3\nf 1 3 4\n")).unwrap();
    let text = SHAFT.split("[[fill.lattice]]").next().unwrap().replace(
        "walls = [\"-x\", \"+x\", \"-y\", \"+y\"]",
        "walls = [\"-x\", \"+x\"]\nperiodic = [false, true, false]",
    ) + &format!(
        "[[wall]]\nname = \"plate\"\nmesh = {:?}\n[[inlet]]\nname = \"tap\"\nshapes = [\"ball\"]\nlow = [0, 0, 0.04]\n\
             high = [0.02, 0.02, 0.055]\nrate = 1e6\nevery = 10\nvelocity = [0, 0, -1]\n[time]\nstep = 1e-5\nsteps = 400\n[output]\ndirectory = \"out\"\n",
        plate.display().to_string()
    );
    let scene = scene(&text);
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    let (mut entered, mut at_border) = (0, 0);
    for _ in 0..400 {
        let before = sim.next_id;
        sim.step(&mut comm).unwrap();
        let owned = 0..sim.particles.owned;
        for slot in owned.clone().filter(|&slot| sim.particles.id[slot].0 >= before) {
            let (place, radius) = (sim.particles.position[slot], sim.particles.radius(slot));
            for other in owned.clone().filter(|&other| other != slot) {
                let apart = sim.particles.cell.nearest(sim.particles.position[other] - place);
                assert!(apart.norm() > radius + sim.particles.radius(other), "{slot} {other}");
            }
            let beside = (0.004 - place.x).max(0.0);
            for y in [0.0004, 0.0204] {
                assert!(beside.hypot(place.y - y) >= radius, "{place}");
            }
            entered += 1;
            at_border += usize::from(place.y < radius || place.y > 0.02 - radius);
        }
    }
    println!("{entered} have come, {at_border} of them across the border");
    assert!(entered > 60 && at_border > 0, "{entered} {at_border}");
    let alone = OnRanks::of(&scene).the_same_everywhere(400, folder.path());
    assert_eq!(alone.bits.len(), entered);
}

/// The shaft with lists of all particles that enter and leave.
fn listing() -> String {
    let text = SHAFT.replace("[[inlet]]\n", "[[inlet]]\nlist = true\n");
    text.replace("[[outlet]]\n", "[[outlet]]\nlist = true\n")
}

const LISTS: [&str; 4] = ["entered_eggs", "entered_balls", "left_bottom", "left_hatch"];

/// A row of a list.
#[derive(Clone, Debug)]
struct Row {
    step: u64,
    time: f64,
    id: u64,
    shape: String,
    scale: f64,
    mass: f64,
    position: Vec3,
    velocity: Vec3,
}

/// Rows of a list in their order: by step, then by id.
fn rows(folder: &Path, list: &str) -> Vec<Row> {
    let mut table = csv::Reader::from_path(folder.join(format!("{list}.csv"))).unwrap();
    let columns = "step,time_s,id,shape,scale,mass_kg,x_m,y_m,z_m,vx_m_per_s,vy_m_per_s,vz_m_per_s";
    assert_eq!(table.headers().unwrap().iter().collect::<Vec<_>>().join(","), columns);
    let row = |record: Result<csv::StringRecord, csv::Error>| {
        let record = record.unwrap();
        let number = |column: usize| record[column].parse::<f64>().unwrap();
        let vector = |first: usize| Vec3::from_fn(|axis, _| number(first + axis));
        Row {
            step: record[0].parse().unwrap(),
            time: number(1),
            id: record[2].parse().unwrap(),
            shape: record[3].to_owned(),
            scale: number(4),
            mass: number(5),
            position: vector(6),
            velocity: vector(9),
        }
    };
    let rows: Vec<Row> = table.records().map(row).collect();
    let is_after = |pair: &[Row]| (pair[0].step, pair[0].id) < (pair[1].step, pair[1].id);
    assert!(rows.windows(2).all(is_after), "{list}");
    rows
}

/// Runs a scene on ranks to a step, from its start or from the folder's snapshot of a step. Returns the counts.
fn leg(
    scene: &Scene,
    folder: &Path,
    ranks: u32,
    (from, last_step): (Option<u64>, u64),
) -> Vec<(String, f64)> {
    let counted = threads::run(ranks, |comm| {
        let mut sim = assemble::assemble(scene, comm);
        if let Some(step) = from {
            let (start, same) =
                (folder.join(particles_name(step)), assemble::Continuation::SameStage);
            assemble::take_up(&mut sim, scene, &start, same, comm).unwrap();
        } else {
            assemble::fill(&mut sim, scene, comm);
        }
        let schedule = Schedule {
            snapshot_every: 300,
            resumed: from.is_some(),
            ..schedule(scene, last_step, folder)
        };
        run(&mut sim, &schedule, comm, &mut |_| {}).unwrap();
        sim.all_observers().flat_map(Reporter::counted).collect()
    });
    counted.into_iter().next().unwrap()
}

/// A list has every counted particle once, with values that agree with the snapshots.
#[test]
fn lists_have_all_that_came_and_left() {
    let (scene, folder) = (scene(&listing()), tempfile::tempdir().unwrap());
    let counted = leg(&scene, folder.path(), 1, (None, 1500));
    let number = |name: &str| counted.iter().find(|(of, _)| of == name).unwrap().1;
    let mut there: BTreeSet<u64> = (0..252).collect();
    let mut seen = 0;
    for list in LISTS {
        let rows = rows(folder.path(), list);
        println!("{list}: {} rows", rows.len());
        assert!(rows.len() > 10, "{list}: {}", rows.len());
        assert_eq!(rows.len() as f64, number(list));
        // The sum has the order of counting.
        let mass = rows.iter().fold(0.0, |sum, row| sum + row.mass);
        assert_eq!(mass, number(&format!("{list}_kg")));
        for row in &rows {
            let is_new = list.starts_with("entered");
            assert!(if is_new { there.insert(row.id) } else { there.remove(&row.id) }, "{row:?}");
            let shape = scene.library.names.iter().position(|name| *name == row.shape).unwrap();
            assert!(
                (row.mass / (scene.library.mass[shape] * row.scale.powi(3)) - 1.0).abs() < 1e-14
            );
            assert!((row.time - row.step as f64 * scene.dt).abs() < 1e-14);
            let (x, z) = (row.position.x, row.position.z);
            match list {
                "left_bottom" => assert!(z < 0.002 && row.step % 10 == 0, "{row:?}"),
                "left_hatch" => {
                    assert!(x <= 0.01 && (0.002..=0.006).contains(&z) && row.step % 7 == 0);
                }
                _ => {}
            }
            if is_new && row.step % 300 == 0 {
                let snapshot = folder.path().join(particles_name(row.step));
                let snapshot = Reader::open(&snapshot).unwrap();
                let table = snapshot.particles(0..snapshot.particle_count()).unwrap();
                let k = table.id.iter().position(|id| id.0 == row.id).unwrap();
                assert_eq!(table.position[k], row.position);
                assert_eq!(table.scale[k], row.scale);
                assert_eq!(table.shape[k].index(), shape);
                assert!((table.velocity[k] - row.velocity).norm() < 1e-14);
                seen += 1;
            }
        }
    }
    assert!(seen > 0, "no snapshot is of a step at which a grain came");
    let last = Reader::open(folder.path()).unwrap();
    let table = last.particles(0..last.particle_count()).unwrap();
    assert_eq!(there, table.id.iter().map(|id| id.0).collect());
}

/// Identical bytes on 1, 2, 3 and 8 ranks, over a restart, and after a run that was killed after a snapshot within a line.
#[test]
fn lists_are_the_same_on_any_number_of_ranks_and_over_restarts() {
    let (scene, folder) = (scene(&listing()), tempfile::tempdir().unwrap());
    let folder = folder.path();
    let path = |list: &str| folder.join(format!("{list}.csv"));
    let bytes = || LISTS.map(|list| std::fs::read_to_string(path(list)).unwrap());
    leg(&scene, folder, 1, (None, 1500));
    let alone = bytes();
    for ranks in [2, 3, 8] {
        leg(&scene, folder, ranks, (None, 1500));
        assert!(bytes() == alone, "{ranks} ranks");
    }
    // The stop is off the schedule of rows and snapshots, just after particles have left.
    let step = rows(folder, "left_hatch").iter().find(|row| row.step > 700).unwrap().step;
    leg(&scene, folder, 3, (None, step));
    let before = bytes();
    assert!(before != alone && before.iter().zip(&alone).all(|(some, all)| all.starts_with(some)));
    assert_eq!(rows(folder, "left_hatch").last().unwrap().step, step);
    leg(&scene, folder, 2, (Some(step), 1500));
    assert!(bytes() == alone, "over a restart at step {step}");
    // The run is killed after step 1490: rows since the snapshot are written again.
    leg(&scene, folder, 1, (None, 1490));
    for list in LISTS {
        let killed = std::fs::read_to_string(path(list)).unwrap();
        assert!(rows(folder, list).last().unwrap().step > 900, "{list}");
        std::fs::write(path(list), killed + "1491,0.0149").unwrap();
    }
    leg(&scene, folder, 2, (Some(900), 1500));
    assert!(bytes() == alone, "after a run that was killed");
    // A run from the start begins new lists.
    leg(&scene, folder, 1, (None, 0));
    for list in LISTS {
        assert!(rows(folder, list).iter().all(|row| row.step == 0), "{list}");
        std::fs::remove_file(path(list)).unwrap();
    }
    // Lists exist only on request.
    leg(&self::scene(SHAFT), folder, 1, (None, 100));
    assert!(LISTS.iter().all(|list| !path(list).exists()));
}

/// Residence of balls that appear at rest and leave below. Between the two rows they fall freely, z = z0 - g t²/2 and v = -g t, to rounding with
/// velocity Verlet. They leave at the first check below the plane.
#[test]
fn lists_tell_how_long_a_grain_stays() {
    const EVERY: u64 = 7;
    let shaft = SHAFT.split("[[fill.lattice]]").next().unwrap();
    let text = shaft.replace("0.5, 0.2, -9.81", "0, 0, -9.81")
        + &format!(
            "[[inlet]]\nname = \"tap\"\nshapes = [\"ball\"]\nlow = [0.01, 0.01, 0.05]\nhigh = [0.01, 0.01, 0.05]\nrate = 40\ncount = 3\nlist = true\n\
             [[outlet]]\nname = \"drain\"\npoint = [0, 0, 0.002]\nnormal = [0, 0, 1]\nevery = {EVERY}\nlist = true\n\
             [time]\nstep = 1e-5\nsteps = 20000\n[output]\ndirectory = \"out\"\n"
        );
    let (scene, folder) = (scene(&text), tempfile::tempdir().unwrap());
    leg(&scene, folder.path(), 1, (None, 20_000));
    let [entered, left] = ["entered_tap", "left_drain"].map(|list| rows(folder.path(), list));
    assert_eq!((entered.len(), left.len()), (3, 3));
    let fall = (2.0 * 0.048_f64 / 9.81).sqrt();
    for (entered, left) in entered.iter().zip(&left) {
        assert_eq!((entered.id, &*entered.shape), (left.id, "ball"));
        assert_eq!(
            (entered.position, entered.velocity),
            (Vec3::new(0.01, 0.01, 0.05), Vec3::zeros())
        );
        let time = left.time - entered.time;
        let late = time - fall;
        println!("id {}: {time} s, {late:e} s after it was through", left.id);
        assert!(late >= 0.0 && late <= EVERY as f64 * scene.dt, "{late:e}");
        let z = 0.05 - 0.5 * 9.81 * time * time;
        assert!((left.position - Vec3::new(0.01, 0.01, z)).norm() < 1e-12, "{left:?}");
        assert!((left.velocity + Vec3::z() * (9.81 * time)).norm() < 1e-11, "{left:?}");
    }
}

/// Particles inside an outlet at the beginning of a stage are listed with the values of the snapshot.
#[test]
fn a_stage_lists_what_is_gone_as_it_begins() {
    let (first, mut comm) = (scene(SHAFT), Alone::default());
    let mut sim = begun(&first, &mut comm);
    (0..207).for_each(|_| sim.step(&mut comm).unwrap());
    let [before, after] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    save(&sim, before.path(), &first, &mut comm);
    let next = scene(&listing().replace("point = [0, 0, 0.002]", "point = [0, 0, 0.012]"));
    let mut sim = assemble::assemble(&next, &comm);
    let new = assemble::Continuation::NewStage;
    assemble::take_up(&mut sim, &next, before.path(), new, &mut comm).unwrap();
    run(&mut sim, &schedule(&next, 900, after.path()), &mut comm, &mut |_| {}).unwrap();
    let left = rows(after.path(), "left_bottom");
    let counted = sim.drives[1].counted();
    assert_eq!(counted[0], ("left_bottom".to_owned(), left.len() as f64));
    let at_once: Vec<&Row> = left.iter().filter(|row| row.step == 207).collect();
    assert!(at_once.len() > 20 && left.len() > at_once.len(), "{} {}", at_once.len(), left.len());
    let snapshot = Reader::open(before.path()).unwrap();
    let table = snapshot.particles(0..snapshot.particle_count()).unwrap();
    for row in at_once {
        let k = table.id.iter().position(|id| id.0 == row.id).unwrap();
        assert_eq!((table.position[k], table.velocity[k]), (row.position, row.velocity));
        assert!((row.time - 207.0 * first.dt).abs() < 1e-15);
    }
}

/// A list needs a name that is valid in a file name.
#[test]
fn a_list_under_a_name_that_is_none_for_a_file_is_refused() {
    let named = |name: &str| format!("name = '{name}'\nlist = true\n");
    for name in ["left/hatch", "..\\hatch", "hatch?", "a:b"] {
        let said =
            format!("outlet.\"{name}\".list = true: the name is used for the file of the list");
        expect_refused(SHAFT, "name = \"hatch\"\n", &named(name), &said);
        // Such names are valid for columns.
        scene(&SHAFT.replace("name = \"hatch\"", &format!("name = '{name}'")));
    }
    let long = "n".repeat(201);
    expect_refused(SHAFT, "name = \"balls\"\n", &named(&long), "at most 200 bytes");
    scene(&SHAFT.replace("name = \"balls\"\n", &named(&long[1..])));
    scene(&SHAFT.replace("name = \"balls\"\n", &named("klappe, süd (oben)")));
}
