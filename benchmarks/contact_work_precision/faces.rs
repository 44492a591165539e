//! Cost of contacts of faces: of each touching pair, by the thickness of the common part and by EPA, and of a step of a
//! packing.
//!
//! Random poses are uniform in both rotations and in the direction to the other body. In flush poses a face of one body lies
//! on a face of the other. It is shifted by at most a quarter of the size and turned about the normal.

use crate::measure::{self, Effort};
use crate::methods::{Contestant, Family};
use crate::pairs::{
    Pairs, Truth, corners_of_box, corners_of_icosahedron, direction, frames, polyhedron,
};
use crate::record;
use anyhow::Context;
use benchmarking::machine::load;
use benchmarking::median;
use dem_mpi::comm::alone::Alone;
use dem_mpi::contact::{ContactResolver, Epa, Outcome, Overlap, Posed};
use dem_mpi::ids::ShapeId;
use dem_mpi::math::{Quat, Vec3, rotation_about};
use dem_mpi::random::Random;
use dem_mpi::scene::{Scene, assemble};
use dem_mpi::shape::facets::Facets;
use dem_mpi::shape::{RoundedPolyhedron, Shape};
use dem_mpi::sim::Simulation;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

/// Overlap of the pairs [short axes].
const OVERLAP: f64 = 0.02;

/// Measures and prints everything, and writes `faces.csv`, `packings.csv` and `machine.txt`.
pub(crate) fn run(effort: &Effort, folder: &Path) -> anyhow::Result<()> {
    let before = load(3);
    let mut table = "solids,poses,method,ns_median,ns_quartile_1,ns_quartile_3\n".to_owned();
    println!("{:<16} {:<8} {:<12} {:>8} {:>17}", "solids", "poses", "method", "ns", "quartiles");
    for (name, shape) in solids() {
        for (poses, pairs) in [("random", random(&shape, effort)), ("flush", flush(&shape, effort))]
        {
            pair_costs(name, poses, &pairs, effort, &mut table)?;
        }
    }
    record::write_file(folder, "faces.csv", &table)?;
    record::write_file(folder, "packings.csv", &packings(effort)?)?;
    let machine = record::machine();
    record::write_file(folder, "machine.txt", &format!("{machine}load before: {before}\n"))
}

/// Costs of one kind of pairs.
fn pair_costs(
    name: &str,
    poses: &str,
    pairs: &Pairs,
    effort: &Effort,
    table: &mut String,
) -> anyhow::Result<()> {
    let contestants = [
        Contestant::new(Family::Thickness, String::new(), Overlap),
        Contestant::new(Family::Epa, "1e-8".into(), Epa::default()),
    ];
    let warm: Vec<_> =
        contestants.iter().map(|contestant| measure::warm(contestant, pairs)).collect();
    let shared = measure::resolve(&contestants[0], pairs, &warm[0]).contacts.len();
    assert_eq!(shared, pairs.truth.len(), "all of {name}, {poses}, share something");
    let times = measure::times(&contestants, pairs, &warm, effort);
    for (contestant, time) in contestants.iter().zip(times) {
        let method = contestant.family.name();
        let [low, high] = time.quartiles;
        println!("{name:<16} {poses:<8} {method:<12} {:8.0} {low:>8.0} {high:>8.0}", time.median);
        writeln!(table, "{name},{poses},{method},{:.1},{low:.1},{high:.1}", time.median)?;
    }
    Ok(())
}

/// Solids with a short axis of 1.
fn solids() -> Vec<(&'static str, Shape)> {
    let inner: Vec<Vec3> = (corners_of_box().iter())
        .map(|corner| corner - corner.map(f64::signum) * ROUNDING)
        .collect();
    let rounded = RoundedPolyhedron::new(&inner, ROUNDING).expect("a rounded box");
    vec![
        ("boxes", polyhedron(("boxes", corners_of_box())).shape),
        ("icosahedra", polyhedron(("icosahedra", corners_of_icosahedron())).shape),
        ("rounded boxes", Shape::RoundedPolyhedron(Box::new(rounded))),
    ]
}

/// Rounding radius of the rounded boxes.
const ROUNDING: f64 = 0.1;

fn random(shape: &Shape, effort: &Effort) -> Pairs {
    let mut pairs = Pairs::of(vec![shape.clone()]);
    for id in 0..effort.pairs {
        let mut random = Random::of(17, id);
        let quaternions = [(); 2].map(|()| random.rotation());
        push(&mut pairs, shape, quaternions, &direction(&mut random), &Vec3::zeros());
    }
    pairs
}

fn flush(shape: &Shape, effort: &Effort) -> Pairs {
    let faces = match shape {
        Shape::Polyhedron(body) => body.hull().facets(),
        Shape::RoundedPolyhedron(body) => body.core().facets(),
        _ => panic!("no faces"),
    };
    let mut pairs = Pairs::of(vec![shape.clone()]);
    for id in 0..effort.pairs {
        let mut random = Random::of(18, id);
        let turn = random.rotation();
        let [on_a, on_b] = [face(faces, &mut random), face(faces, &mut random)];
        let facing = Quat::rotation_between(&on_b, &-on_a).unwrap_or_else(|| opposite(&on_a));
        let about = rotation_about(&on_a, TAU * random.unit());
        let aside = direction(&mut random).cross(&on_a) * 0.25;
        push(&mut pairs, shape, [turn, turn * about * facing], &(turn * on_a), &(turn * aside));
    }
    pairs
}

/// Normal of a random face.
fn face(faces: &Facets, random: &mut Random) -> Vec3 {
    let count = faces.planes().len();
    faces.planes()[((random.unit() * count as f64) as usize).min(count - 1)].normal
}

/// Half a turn about a perpendicular axis.
fn opposite(axis: &Vec3) -> Quat {
    let across = axis.cross(&Vec3::ith(axis.iamin(), 1.0)).normalize();
    rotation_about(&across, 0.5 * TAU)
}

/// Places B in this direction, seen from a point aside, [`OVERLAP`] nearer than the distance of first contact.
fn push(pairs: &mut Pairs, shape: &Shape, quaternions: [Quat; 2], towards: &Vec3, aside: &Vec3) {
    let axes = frames(quaternions);
    let [a, b] = axes.each_ref().map(|frame| Posed::new(shape, frame));
    let at = |distance: f64| towards * distance + aside;
    let (mut near, mut far) = (0.5 * shape.inscribed_radius(), 2.0 * shape.bounding_radius());
    for _ in 0..40 {
        let middle = 0.5 * (near + far);
        let touches = matches!(Overlap.touch(&a, &b, &at(middle), None), Outcome::Touching(_));
        if touches { near = middle } else { far = middle }
    }
    let r = at(near - OVERLAP);
    let truth = Truth { overlap: OVERLAP, normal: *towards, point: r * 0.5 };
    pairs.push_known([ShapeId(0); 2], quaternions, r, truth);
}

/// Contact methods of a scene.
const METHODS: [&str; 2] = ["auto", "epa"];
/// Number of steps timed together.
const STEPS: u32 = 500;

/// Time of a step of packings, by either method in turn, from the same state.
fn packings(effort: &Effort) -> anyhow::Result<String> {
    let mut table = "solids,contacts_auto,contacts_epa,us_per_step_auto,us_per_step_epa,ratio_median,ratio_least,ratio_largest\n".to_owned();
    println!(
        "{:<16} contacts   us per step: thickness, EPA   ratio: median, least, largest",
        "108 in a box"
    );
    for (name, shape) in shapes() {
        let settled = settled(&shape, effort)?;
        let (mut times, mut contacts) = ([Vec::new(), Vec::new()], [0, 0]);
        for _ in 0..effort.rounds {
            for (k, method) in METHODS.iter().enumerate() {
                let mut sim = packing(&shape, method, &settled)?;
                let begin = Instant::now();
                steps(&mut sim, STEPS)?;
                times[k].push(1e6 * begin.elapsed().as_secs_f64() / f64::from(STEPS));
                contacts[k] = sim.contacts.len();
            }
        }
        let mut ratios: Vec<f64> = times[0].iter().zip(&times[1]).map(|(a, b)| a / b).collect();
        let ratio = median(&mut ratios);
        let [by_thickness, by_epa] = times.each_mut().map(|times| median(times));
        let (least, largest) = (ratios[0], ratios[ratios.len() - 1]);
        let [on, off] = contacts;
        println!(
            "{name:<16} {on} {off}   {by_thickness:.1} {by_epa:.1}   {ratio:.2} {least:.2} {largest:.2}"
        );
        writeln!(
            table,
            "{name},{on},{off},{by_thickness:.2},{by_epa:.2},{ratio:.3},{least:.3},{largest:.3}"
        )?;
    }
    Ok(table)
}

/// Lines of the shapes of packings, with sizes of 1 m.
fn shapes() -> [(&'static str, String); 3] {
    let vertices = |corners: Vec<Vec3>| {
        let corners: Vec<String> =
            corners.iter().map(|c| format!("[{:e}, {:e}, {:e}]", c.x, c.y, c.z)).collect();
        format!("vertices = [{}]", corners.join(", "))
    };
    let cuboid = |x: f64, y: f64, z: f64| {
        let edges = Vec3::new(x, y, z);
        let corner = |c: &Vec3| c.map(|x| 0.5 * x.signum()).component_mul(&edges);
        vertices(corners_of_box().iter().map(corner).collect())
    };
    [
        ("boxes", format!("kind = \"polyhedron\"\n{}", cuboid(1.0, 0.8, 0.6))),
        ("icosahedra", format!("kind = \"polyhedron\"\n{}", vertices(corners_of_icosahedron()))),
        (
            "rounded boxes",
            format!("kind = \"rounded-polyhedron\"\nradius = 0.1\n{}", cuboid(0.8, 0.6, 0.4)),
        ),
    ]
}

/// A scene of 108 solids in a box, from a lattice or from a file, with its step at 0.8 of the stable limit.
fn scene(shape: &str, method: &str, fill: &str) -> anyhow::Result<Scene> {
    let text = format!(
        "gravity = [0, 0, -9.81]\n[domain]\nlow = [0, 0, 0]\nhigh = [4.05, 4.05, 40]\n\
         walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\"]\n\
         [[material]]\nname = \"m\"\ndensity = 1000.0\nnormal_stiffness = 1e7\nfriction = 0.3\n\
         restitution = 0.3\ntangential_damping_ratio = 0.1\n[[shape]]\nname = \"solid\"\n{shape}\n\
         [contact]\nmethod = \"{method}\"\n{fill}\n\
         [time]\nstep = 1e-12\nsteps = 1\n[output]\ndirectory = \"none\"\n"
    );
    let mut scene = Scene::parse(&text, "a packing", Path::new(""), &[])
        .map_err(|error| anyhow::anyhow!("{error}"))?;
    scene.dt = 0.8 * scene.time_step_limit().context("nothing pushes")?.dt;
    Ok(scene)
}

fn begun(scene: &Scene) -> anyhow::Result<Simulation> {
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(scene, &comm);
    assemble::fill(&mut sim, scene, &comm);
    sim.begin(&mut comm)?;
    Ok(sim)
}

fn steps(sim: &mut Simulation, count: u32) -> anyhow::Result<()> {
    for _ in 0..count {
        sim.step(&mut Alone::default())?;
    }
    Ok(())
}

/// Positions of solids that have fallen into a box, as a file of particles.
fn settled(shape: &str, effort: &Effort) -> anyhow::Result<String> {
    let fill = "[[fill.lattice]]\nfirst = [0.675, 0.675, 0.8]\ncount = [3, 3, 12]\nspacing = 1.35";
    let mut sim = begun(&scene(shape, "auto", fill)?)?;
    let count = (effort.settling / sim.dt) as u32;
    steps(&mut sim, count)?;
    let particles = &sim.particles;
    let turns = particles.orientation.as_ref().context("solids have no orientation")?;
    let mut file = "x,y,z,qw,qx,qy,qz\n".to_owned();
    for slot in 0..particles.owned {
        let (p, q) = (particles.position[slot], turns.quaternion[slot]);
        let cells = [p.x, p.y, p.z, q.w, q.i, q.j, q.k].map(|x| format!("{x:e}"));
        writeln!(file, "{}", cells.join(","))?;
    }
    Ok(file)
}

/// A packing of these solids with the given contact method.
fn packing(shape: &str, method: &str, settled: &str) -> anyhow::Result<Simulation> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("grains.csv");
    std::fs::write(&path, settled)?;
    begun(&scene(shape, method, &format!("[[fill.file]]\npath = {:?}", path.to_string_lossy()))?)
}
