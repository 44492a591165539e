//! Rain into containers: particles appear wholly within a region and clear of walls, with identical bits on any number of ranks.

use crate::support::{OnRanks, begun, scene};
use dem_mpi::comm::alone::Alone;
use dem_mpi::drive::rain::of_layer;
use dem_mpi::math::Vec3;
use dem_mpi::scene::Scene;
use dem_mpi::scene::doubts::doubts;
use dem_mpi::scene::plan::{plan, run_time};
use dem_mpi::scene::workload::Workload;
use dem_mpi::sim::Simulation;
use dem_mpi::sim::run::Pace;

/// A pipe on a plane, and balls of many sizes that rain into it.
const PIPE: &str = r#"
gravity = [0, 0, -9.81]
[domain]
low = [0, 0, 0]
high = [0.02, 0.02, 0.05]
[[material]]
name = "stone"
density = 2500
normal_stiffness = 400
friction = 0.4
restitution = 0.5
tangential_damping_ratio = 0.1
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.001
size = { lognormal = { median = 1, sigma = 0.2 }, limits = [0.6, 1.3], by = "number" }
[[wall]]
name = "floor"
point = [0, 0, 0.02]
normal = [0, 0, 1]
[[wall]]
name = "pipe"
cylinder = { from = [0.01, 0.01, 0], to = [0.01, 0.01, 0.05], radius = 0.008 }
[fill.rain]
count = 100
every = 50
axis = [[0.01, 0.01, 0.042], [0.01, 0.01, 0.049]]
radius = 0.008
velocity = [0, 0, -1]
[time]
step = 5e-6
steps = 20000
[neighbours]
imbalance = 1.05
[output]
directory = "out"
"#;

/// Largest distance by which a particle may reach out of its region: a millionth of a cell [m].
const ROUNDING: f64 = 3e-9;

/// Slots of the owned particles with ids from `before` on.
fn born(sim: &Simulation, before: u64) -> Vec<usize> {
    (0..sim.particles.owned).filter(|&slot| sim.particles.id[slot].0 >= before).collect()
}

/// Runs until all have fallen. Calls `look` for each particle when it appears, and checks that it overlaps no other.
fn rained(scene: &Scene, look: &dyn Fn(&Simulation, usize)) -> (Simulation, Vec<u64>) {
    let mut comm = Alone::default();
    let mut sim = begun(scene, &mut comm);
    let mut layers = Vec::new();
    let count = scene.rain.as_ref().unwrap().count;
    while sim.next_id < count {
        let before = sim.next_id;
        sim.step(&mut comm).unwrap();
        assert!(sim.step < scene.steps, "{} have fallen", sim.next_id);
        let new = born(&sim, before);
        assert_eq!(new.len() as u64, sim.next_id - before);
        if !new.is_empty() {
            layers.push(new.len() as u64);
        }
        for slot in new {
            let (place, radius) = (sim.particles.position[slot], sim.particles.radius(slot));
            for other in (0..sim.particles.owned).filter(|&other| other != slot) {
                let apart = (sim.particles.position[other] - place).norm();
                let reach = radius + sim.particles.radius(other);
                assert!(apart >= reach - ROUNDING, "{slot} {other}");
            }
            look(&sim, slot);
        }
    }
    (sim, layers)
}

/// All particles appear wholly in the region, with the sizes of their ids, and lie in the pipe at the end.
#[test]
fn rain_fills_a_pipe() {
    let scene = scene(PIPE);
    let rain = scene.rain.clone().unwrap();
    let axis = |place: &Vec3| (place.x - 0.01).hypot(place.y - 0.01);
    let (mut sim, layers) = rained(&scene, &|sim, slot| {
        let (place, radius) = (sim.particles.position[slot], sim.particles.radius(slot));
        let reach = radius - ROUNDING;
        assert!(axis(&place) + reach <= 0.008, "{place}");
        assert!(place.z - reach >= 0.042 && place.z + reach <= 0.049, "{place}");
        let id = sim.particles.id[slot].0;
        let grain = of_layer(&rain, scene.seed, id, 0, &scene.library);
        assert_eq!(sim.particles.scale_of(slot).to_bits(), grain.scale.to_bits());
    });
    let within = rain.within.as_ref().unwrap();
    println!("layers of {layers:?} of {within:?}");
    // A layer has fifty cells, and those at the corners are outside.
    assert!(layers.len() >= 3 && layers[0] > 20 && layers[0] < 50, "{layers:?}");
    assert!((20..50).contains(&within.places) && within.free == within.places, "{within:?}");
    assert_eq!(doubts(&scene), Vec::<String>::new());
    let words = plan(&scene, 1);
    assert!(
        words.contains(&format!("about {0} of {0} places are clear of walls", within.places)),
        "{words}"
    );
    let mut comm = Alone::default();
    (0..6000).for_each(|_| sim.step(&mut comm).unwrap());
    assert_eq!(sim.particles.owned, 100);
    for slot in 0..sim.particles.owned {
        let (place, radius) = (sim.particles.position[slot], sim.particles.radius(slot));
        assert!(axis(&place) < 0.008 - 0.6 * radius && place.z > 0.02 + 0.6 * radius, "{place}");
    }
    assert!(sim.drives[0].standing().unfinished.is_none() && sim.drives[0].warnings().is_empty());
}

/// Grains of a single layer count from the first step on, so that the plan tells a time, and half of the steps are half of it.
#[test]
fn one_layer_of_rain_takes_time() {
    let scene = scene(&PIPE.replace("count = 100", "count = 10"));
    let workload = Workload::new(&scene, 0, 0, scene.steps);
    assert_eq!(workload.all(), (10 * scene.steps) as f64);
    assert_eq!(workload.left(0.5), 1.0);
    let pace = Pace { steps: 9, particle_steps: 90.0, coordination: 0.0, seconds: 0.9 };
    assert!(run_time(&scene, &workload, &pace, 1).contains("run time"));
    // Nothing has fallen yet: the time of a grain is unknown.
    let pace = Pace { particle_steps: 0.0, ..pace };
    assert_eq!(run_time(&scene, &workload, &pace, 1), "\n");
}

/// Rain falls into a cup of triangles, with 24 sides and a bottom, and stays in it.
#[test]
fn rain_fills_a_cup_of_triangles() {
    use std::fmt::Write;
    let folder = tempfile::tempdir().unwrap();
    let (sides, radius) = (24_u32, 0.0085);
    let mut text = "v 0.01 0.01 0.02\n".to_owned();
    for k in 0..sides {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(sides)).sin_cos();
        for z in [0.02, 0.05] {
            writeln!(text, "v {} {} {z}", 0.01 + radius * cos, 0.01 + radius * sin).unwrap();
        }
    }
    for k in 0..sides {
        let [a, b] = [k, (k + 1) % sides].map(|k| 2 + 2 * k);
        writeln!(text, "f 1 {a} {b}\nf {a} {b} {}\nf {a} {} {}", b + 1, b + 1, a + 1).unwrap();
    }
    let path = folder.path().join("cup.obj");
    std::fs::write(&path, text).unwrap();
    let cylinder = "[[wall]]\nname = \"pipe\"\ncylinder = { from = [0.01, 0.01, 0], to = [0.01, 0.01, 0.05], radius = 0.008 }\n";
    let floor = "[[wall]]\nname = \"floor\"\npoint = [0, 0, 0.02]\nnormal = [0, 0, 1]\n";
    let cup =
        format!("[[wall]]\nname = \"cup\"\nmesh = {:?}\nsmooth = 20\n", path.display().to_string());
    let text = PIPE.replace(cylinder, &cup).replace(floor, "");
    assert!(!text.contains("floor") && text.contains("cup"));
    let scene = scene(&text);
    let (mut sim, layers) = rained(&scene, &|_, _| {});
    assert!(layers.len() >= 3, "{layers:?}");
    let mut comm = Alone::default();
    (0..6000).for_each(|_| sim.step(&mut comm).unwrap());
    assert_eq!(sim.particles.owned, 100);
    for slot in 0..sim.particles.owned {
        let (place, own) = (sim.particles.position[slot], sim.particles.radius(slot));
        let from_axis = (place.x - 0.01).hypot(place.y - 0.01);
        assert!(from_axis < radius - 0.6 * own && place.z > 0.02 + 0.6 * own, "{place}");
    }
    let alone = OnRanks::of(&scene).the_same_everywhere(5000, folder.path());
    assert!(alone.number("wall_contacts") > 3.0, "{}", alone.number("wall_contacts"));
}

#[test]
fn rain_into_a_pipe_is_the_same_on_any_number_of_ranks() {
    let scene = scene(PIPE);
    let folder = tempfile::tempdir().unwrap();
    let alone = OnRanks::of(&scene).the_same_everywhere(7000, folder.path());
    let contacts = alone.number("contacts") + alone.number("wall_contacts");
    assert!(alone.bits.len() == 100 && contacts > 10.0, "{} {contacts}", alone.bits.len());
}

/// In a box, places where a particle would meet a wall stay empty, and the plan reports it.
#[test]
fn rain_keeps_clear_of_a_chute_and_a_tube_in_its_box() {
    let text = PIPE
        .replace(
            "axis = [[0.01, 0.01, 0.042], [0.01, 0.01, 0.049]]\nradius = 0.008\n",
            "low = [0, 0, 0.04]\nhigh = [0.02, 0.02, 0.049]\n",
        )
        .replace(
            "point = [0, 0, 0.02]\nnormal = [0, 0, 1]",
            "point = [0.008, 0, 0.045]\nnormal = [1, 0, 0.5]",
        )
        .replace(
            "from = [0.01, 0.01, 0], to = [0.01, 0.01, 0.05], radius = 0.008",
            "from = [0.015, 0.01, 0], to = [0.015, 0.01, 0.05], radius = 0.002",
        )
        .replace("count = 100", "count = 20");
    let scene = scene(&text);
    let normal = Vec3::new(1.0, 0.0, 0.5).normalize();
    let (_, layers) = rained(&scene, &|sim, slot| {
        let (place, radius) = (sim.particles.position[slot], sim.particles.radius(slot));
        assert!(normal.dot(&(place - Vec3::new(0.008, 0.0, 0.045))) >= radius, "{place}");
        assert!(((place.x - 0.015).hypot(place.y - 0.01) - 0.002).abs() >= radius, "{place}");
    });
    println!("layers of {layers:?}");
    let within = scene.rain.as_ref().unwrap().within.as_ref().unwrap();
    assert!(within.free > 5 && within.free < within.places, "{within:?}");
    let told = format!("only some {} of {} places", within.free, within.places);
    assert!(doubts(&scene).iter().any(|doubt| doubt.contains(&told)), "{:?}", doubts(&scene));
}

/// A wall that closes the region stops the rain, with one warning.
#[test]
fn rain_without_a_place_waits_and_says_so() {
    // The wall is above the region at the first check for places, after 12 ms.
    let text = PIPE
        .replace(
            "point = [0, 0, 0.02]\nnormal = [0, 0, 1]",
            "point = [0, 0, 0.038]\nnormal = [0, 0, 1]\nvelocity = [0, 0, 1]",
        )
        .replace("every = 50", "every = 2400");
    let scene = scene(&text);
    let mut comm = Alone::default();
    let mut sim = begun(&scene, &mut comm);
    let mut warnings = Vec::new();
    for _ in 0..5000 {
        sim.step(&mut comm).unwrap();
        warnings.extend(sim.drives.iter_mut().flat_map(|drive| drive.warnings()));
    }
    assert_eq!(sim.next_id, 0);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    let said = "rain: at step 2400 no place of a layer is clear of the walls";
    assert!(warnings[0].contains(said), "{warnings:?}");
    let last = sim.drives[0].outcome(&[], false).warnings;
    assert!(last[0].contains("only 0 of 100 particles of rain have fallen"), "{last:?}");
}

/// Rain with a moving piston, a plate of triangles across the period and particles across it. New particles are clear of all of them at
/// their current positions. The bits are identical on other ranks and across a restart between two layers.
#[test]
fn rain_keeps_clear_of_what_moves_and_of_images() {
    let folder = tempfile::tempdir().unwrap();
    let plate = folder.path().join("plate.obj");
    // The plate is across y near the border, so particles that reach through the border meet it.
    let corners =
        "v 0.005 0.0004 0.02\nv 0.02 0.0004 0.02\nv 0.02 0.0004 0.05\nv 0.005 0.0004 0.05\n";
    std::fs::write(&plate, format!("{corners}f 1 2 3\nf 1 3 4\n")).unwrap();
    let text = PIPE
        .replace(
            "high = [0.02, 0.02, 0.05]",
            "high = [0.02, 0.02, 0.05]\nperiodic = [false, true, false]\nwalls = [\"-z\"]",
        )
        .replace(
            "axis = [[0.01, 0.01, 0.042], [0.01, 0.01, 0.049]]\nradius = 0.008\n",
            "low = [0, 0, 0.042]\nhigh = [0.02, 0.02, 0.049]\n",
        )
        .replace(
            "name = \"floor\"\npoint = [0, 0, 0.02]\nnormal = [0, 0, 1]",
            "name = \"piston\"\npoint = [0.001, 0, 0]\nnormal = [1, 0, 0]\nvelocity = [0.2, 0, 0]",
        )
        .replace(
            "cylinder = { from = [0.01, 0.01, 0], to = [0.01, 0.01, 0.05], radius = 0.008 }",
            &format!("mesh = {:?}", plate.display().to_string()),
        )
        .replace("count = 100", "count = 200");
    let scene = scene(&text);
    let (sim, layers) = rained(&scene, &|sim, slot| {
        let (place, radius) = (sim.particles.position[slot], sim.particles.radius(slot));
        let piston = 0.001 + 0.2 * sim.step as f64 * sim.dt;
        assert!(place.x - piston >= radius - ROUNDING, "{place} {piston}");
        let to_plate = Vec3::new((0.005 - place.x).max(0.0), 0.0, 0.0);
        for y in [0.0004, 0.0204] {
            assert!(to_plate.x.hypot(place.y - y) >= radius, "{place}");
        }
        for other in (0..sim.particles.owned).filter(|&other| other != slot) {
            let apart = sim.particles.cell.nearest(sim.particles.position[other] - place).norm();
            let reach = radius + sim.particles.radius(other);
            assert!(apart >= reach - ROUNDING, "{slot} {other}");
        }
    });
    println!("layers of {layers:?} until step {}", sim.step);
    // The piston leaves less and less space.
    assert!(layers.len() >= 4 && layers[layers.len() - 2] < layers[0], "{layers:?}");
    let steps = 2 * (sim.step / 2);
    let alone = OnRanks::of(&scene).the_same_everywhere(steps, folder.path());
    assert_eq!(alone.bits.len() as u64, sim.next_id);
}
