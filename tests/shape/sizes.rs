//! A scaled particle behaves like another shape of that size: in contacts, in motion, on any number of ranks, in files and in results.

use crate::support::{Bench, Frame, OnRanks, all_bits, begun, motion, save, scaled, scene};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::{Comm, threads};
use dem_mpi::contact::{Epa, ErodedGjk, Method, Outcome, Posed, clearance, table};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::output::report::sizes::SizesOf;
use dem_mpi::output::snapshot;
use dem_mpi::output::tables::ParticleTable;
use dem_mpi::particles::records::Particle;
use dem_mpi::post::lammps;
use dem_mpi::post::region::SolidVolume;
use dem_mpi::random::Random;
use dem_mpi::scene::assemble::{self, Continuation, StartError};
use dem_mpi::scene::packing::initial;
use dem_mpi::scene::plan::plan;
use dem_mpi::scene::{Scene, SceneErrors};
use dem_mpi::shape::{HalfSpace, Kind, Shape};
use dem_mpi::sim::Simulation;
use std::fmt::Write;
use std::path::{Path, PathBuf};

// --- contacts ---

/// Text of a particle of each kind that a scene can have, with lengths times `factor`.
fn shape_text(kind: &str, name: &str, factor: f64) -> String {
    let list = |numbers: &[f64]| {
        let scaled: Vec<String> = numbers.iter().map(|x| format!("{:?}", x * factor)).collect();
        format!("[{}]", scaled.join(", "))
    };
    let corners = |points: &[[f64; 3]]| {
        let all: Vec<String> = points.iter().map(|point| list(point)).collect();
        format!("vertices = [{}]", all.join(", "))
    };
    let size = match kind {
        "sphere" => format!("radius = {:?}", 0.0011 * factor),
        "ellipsoid" => format!("semi_axes = {}", list(&[0.0016, 0.0014, 0.0008])),
        "superellipsoid" => {
            format!("semi_axes = {}\nexponents = [0.6, 0.8]", list(&[0.0013, 0.0011, 0.0009]))
        }
        "poly-superellipsoid" => format!(
            "semi_axes_positive = {}\nsemi_axes_negative = {}\nexponents = [0.8, 1.2]",
            list(&[0.0014, 0.0011, 0.0009]),
            list(&[0.0009, 0.0012, 0.0010])
        ),
        "spherocylinder" => {
            format!("length = {:?}\nradius = {:?}", 0.002 * factor, 0.0007 * factor)
        }
        "polyhedron" => corners(&[
            [0.0, 0.0, 0.0],
            [0.0025, 0.0, 0.0],
            [0.0, 0.0024, 0.0],
            [0.0004, 0.0006, 0.0022],
            [0.0016, 0.0016, 0.001],
        ]),
        "rounded-polyhedron" => {
            let (half, sides) = (0.0008, [-1.0, 1.0]);
            let cube: Vec<[f64; 3]> = sides
                .into_iter()
                .flat_map(|x| sides.into_iter().flat_map(move |y| sides.map(move |z| [x, y, z])))
                .map(|corner| corner.map(|side| side * half))
                .collect();
            format!("radius = {:?}\n{}", 0.0002 * factor, corners(&cube))
        }
        _ => panic!("{kind}"),
    };
    format!("[[shape]]\nname = \"{name}\"\nkind = \"{kind}\"\n{size}\n")
}

const KINDS: [&str; 7] = [
    "sphere",
    "ellipsoid",
    "superellipsoid",
    "poly-superellipsoid",
    "spherocylinder",
    "polyhedron",
    "rounded-polyhedron",
];

/// A scene with these shapes; its own particles are not used.
fn with_shapes(shapes: &str, more: &str) -> String {
    format!(
        r#"
gravity = [1.0, 0.5, -9.81]
{more}
[[material]]
name = "stone"
density = 2500.0
normal_stiffness = 1e4
friction = 0.3
restitution = 0.6
tangential_damping_ratio = 0.05
{shapes}
[time]
step = 2e-7
steps = 1000
[output]
directory = "out"
"#
    )
}

const BOX: &str = r#"[domain]
low = [0.0, 0.0, 0.0]
high = [0.03, 0.03, 0.05]
walls = ["-x", "+x", "-y", "+y", "-z"]"#;

const ONE: &str = "[[fill.lattice]]\nfirst = [0.015, 0.015, 0.015]\ncount = [1, 1, 1]\n";

fn grains() -> Vec<Shape> {
    let text: String = KINDS.iter().map(|kind| shape_text(kind, kind, 1.0)).collect();
    let one = ONE.replace("first", "shapes = [\"sphere\"]\nfirst");
    let scene = scene(&with_shapes(&format!("{text}{one}"), BOX));
    scene.library.shapes[..scene.library.particle_shapes].to_vec()
}

fn methods() -> [(Method, f64); 3] {
    let erosion = ErodedGjk { tolerance: 1e-14, ..ErodedGjk::default() };
    [
        (Method::Auto, 1e-12),
        (Method::Epa(Epa::new(1e-10)), 1e-9),
        (Method::GjkErosion(erosion), 1e-7),
    ]
}

/// A pair of bodies, as shapes of their sizes and as scales of other shapes.
struct Twice {
    shapes: [Shape; 2],
    scales: [f64; 2],
    written: [Shape; 2],
    frames: [Mat3; 2],
}

impl Twice {
    fn new(shapes: [&Shape; 2], scales: [f64; 2], random: &mut Random) -> Self {
        let written = [0, 1].map(|k| scaled(shapes[k], scales[k]));
        // The unscaled shapes are rebuilt, too, as their last bits change.
        let shapes = shapes.map(|shape| scaled(shape, 1.0));
        Self { shapes, scales, written, frames: [random.frame(), random.frame()] }
    }

    fn by_scale(&self) -> [Posed<'_>; 2] {
        let posed = |k: usize| Posed {
            scale: self.scales[k],
            ..Posed::new(&self.shapes[k], &self.frames[k])
        };
        [posed(0), posed(1)]
    }

    fn by_shape(&self) -> [Posed<'_>; 2] {
        [0, 1].map(|k| Posed::new(&self.written[k], &self.frames[k]))
    }

    /// Vector from A to B at which the bodies overlap by this along a random direction, or are at least this far apart.
    fn apart(&self, overlap: f64, random: &mut Random) -> Vec3 {
        let normal = random.frame() * Vec3::x();
        let [a, b] = self.by_shape();
        a.support(&normal) - b.support(&-normal) - normal * overlap
    }
}

fn bits(outcome: &Outcome) -> Vec<u64> {
    let numbers = match outcome {
        Outcome::Touching(t) => {
            let vectors = t.normal.iter().chain(t.point.iter());
            vectors.copied().chain([t.overlap]).collect()
        }
        Outcome::Apart(clearance) => vec![*clearance],
        Outcome::Failed(why) => panic!("{why:?}"),
    };
    numbers.into_iter().map(f64::to_bits).collect()
}

/// Scales of powers of two give the bits of shapes written with these sizes, by every method and for every pair of kinds. The pairs touch or
/// are apart, with a warm start and without.
#[test]
fn scales_of_powers_of_two_have_the_bits_of_shapes_of_that_size() {
    let grains = grains();
    for (method, _) in methods() {
        let table = table(&method, &Kind::ALL);
        let (mut touching, mut clear) = (0, 0);
        for (i, a) in grains.iter().enumerate() {
            for b in &grains {
                for (case, scales) in [[2.0, 1.0], [0.5, 4.0], [0.25, 0.25]].into_iter().enumerate()
                {
                    for overlap in [2e-5, -1e-6, -1e-4] {
                        let mut random = Random::of(5, (i * 100 + case) as u64);
                        let twice = Twice::new([a, b], scales, &mut random);
                        let smaller = scales[0].min(scales[1]);
                        let r = twice.apart(overlap * smaller, &mut random);
                        let resolver = table.get((a.kind(), b.kind())).unwrap();
                        let warm = r.normalize();
                        for warm in [None, Some(&warm)] {
                            let [by_scale, by_shape] = [twice.by_scale(), twice.by_shape()]
                                .map(|[a, b]| resolver.touch(&a, &b, &r, warm));
                            let what = format!("{}, {a:?}, {b:?}, {scales:?}", method.name());
                            assert_eq!(bits(&by_scale), bits(&by_shape), "{what}");
                            match by_scale {
                                Outcome::Touching(_) => touching += 1,
                                _ => clear += 1,
                            }
                        }
                        if overlap < 0.0 {
                            let gaps = [twice.by_scale(), twice.by_shape()]
                                .map(|[a, b]| clearance(&a, &b, &r).map(|t| t.overlap.to_bits()));
                            assert_eq!(gaps[0], gaps[1], "clearance of {a:?}, {b:?}");
                        }
                    }
                }
            }
        }
        assert!(touching > 200 && clear > 200, "{touching} and {clear} are a poor test");
    }
}

/// Any scales agree to the accuracy of the method.
#[test]
fn scales_resolve_as_shapes_of_that_size() {
    let grains = grains();
    for (method, tolerance) in methods() {
        let table = table(&method, &Kind::ALL);
        let mut touching = 0;
        for (i, a) in grains.iter().enumerate() {
            for (j, b) in grains.iter().enumerate() {
                for case in 0..8 {
                    let mut random = Random::of(6, (i * 1000 + j * 100 + case) as u64);
                    let scales = [0.5 + random.unit(), 0.5 + random.unit()];
                    let twice = Twice::new([a, b], scales, &mut random);
                    let r = twice.apart(1e-5, &mut random);
                    let resolver = table.get((a.kind(), b.kind())).unwrap();
                    let [by_scale, by_shape] = [twice.by_scale(), twice.by_shape()]
                        .map(|[a, b]| resolver.touch(&a, &b, &r, None));
                    let [Outcome::Touching(s), Outcome::Touching(t)] = [by_scale, by_shape] else {
                        assert!(
                            matches!((by_scale, by_shape), (Outcome::Apart(_), Outcome::Apart(_))),
                            "{by_scale:?}, {by_shape:?}"
                        );
                        continue;
                    };
                    touching += 1;
                    let size = a.bounding_radius().max(b.bounding_radius());
                    let off = (s.overlap - t.overlap).abs() / size;
                    assert!(off < tolerance, "{}, {a:?}, {b:?}: {off:e}", method.name());
                }
            }
        }
        assert!(touching > 300, "{touching} are a poor test");
    }
}

#[test]
fn a_scaled_body_on_a_wall() {
    let wall = Shape::HalfSpace(HalfSpace::at_reference(Vec3::z()));
    let table = table(&Method::Auto, &Kind::ALL);
    for grain in &grains() {
        let small = scaled(grain, 1.0);
        for case in 0..50 {
            let mut random = Random::of(8, case);
            // The first case is upright, on a face.
            let frame = if case == 0 { Mat3::identity() } else { random.frame() };
            let (large, level) = (scaled(grain, 2.0), Mat3::identity());
            let ground = Posed::new(&wall, &level);
            let by_shape = Posed::new(&large, &frame);
            let by_scale = Posed { scale: 2.0, ..Posed::new(&small, &frame) };
            let r = by_shape.support(&-Vec3::z()) + Vec3::z() * 1e-5;
            let resolver = table.get((grain.kind(), Kind::HalfSpace)).unwrap();
            let [s, t] = [by_scale, by_shape].map(|body| resolver.touch(&body, &ground, &r, None));
            assert!(matches!(s, Outcome::Touching(_)));
            assert_eq!(bits(&s), bits(&t), "{grain:?}");
        }
    }
}

// --- motion ---

/// Particles of all kinds and these scales on a narrow lattice, thrown into a corner. Sizes are given by scale, or by a shape for each size.
fn thrown(kinds: &[&str], scales: &[f64], by_scale: bool, method: &str) -> Bench {
    let mut text = String::new();
    let sizes = if by_scale { &[1.0][..] } else { scales };
    for kind in kinds {
        for (k, size) in sizes.iter().enumerate() {
            text += &shape_text(kind, &format!("{kind} {k}"), *size);
        }
    }
    let first = format!("{} 0", kinds[0]);
    text += &ONE.replace("first", &format!("shapes = [\"{first}\"]\nfirst"));
    let _ = write!(text, "[contact]\nmethod = \"{method}\"\n");
    let mut scene = scene(&with_shapes(&text, BOX));
    let mut particles = Vec::new();
    for id in 0..216_u64 {
        let mut random = Random::of(4, id);
        let (kind, size) = (id as usize % kinds.len(), id as usize / 7 % scales.len());
        let shape = if by_scale { kind } else { kind * scales.len() + size };
        let scale = if by_scale { scales[size] } else { 1.0 };
        let shape = ShapeId(shape as u16);
        scene.library.admit(shape, scale);
        let place = [id % 6, id / 6 % 6, id / 36].map(|k| 0.003 + 0.0045 * k as f64);
        particles.push(Particle {
            scale,
            velocity: Vec3::from_fn(|_, _| 2.0 * random.signed()) - Vec3::z(),
            quaternion: random.rotation(),
            ..Particle::at_rest(GlobalId(id), shape, Vec3::from(place))
        });
    }
    Bench::of(&scene, &particles)
}

fn state(bench: &Bench) -> Vec<(u64, Vec<u64>)> {
    let mut table = bench.sim.particle_table(Alone::default().rank());
    fill_up(&mut table);
    let mut state: Vec<_> = motion(&table).collect();
    state.sort();
    state
}

/// Adds columns that a scene of spheres lacks.
fn fill_up(table: &mut ParticleTable) {
    let count = table.id.len();
    table.quaternion.resize(count, [1.0, 0.0, 0.0, 0.0]);
    for column in [&mut table.angular_momentum, &mut table.angular_velocity, &mut table.torque] {
        column.resize(count, Vec3::zeros());
    }
}

/// A packing with sizes by scale equals the packing with a shape for each size, to the last bit where scales are powers of two. This covers
/// geometry, masses, moments of inertia, dashpots and friction.
#[test]
fn sizes_by_column_move_as_shapes_of_these_sizes() {
    let cases: [(&[&str], &str); 5] = [
        (&["sphere"], "auto"),
        (&["sphere", "ellipsoid"], "auto"),
        (&KINDS, "auto"),
        (&KINDS, "epa"),
        (&["sphere", "ellipsoid", "superellipsoid"], "gjk-erosion"),
    ];
    for (kinds, method) in cases {
        let mut benches =
            [true, false].map(|by_scale| thrown(kinds, &[1.0, 0.5, 2.0], by_scale, method));
        let mut most = 0;
        for _ in 0..1200 {
            benches.iter_mut().for_each(Bench::step);
            most = most.max(benches[0].sim.contacts.len());
        }
        let [by_scale, by_shape] = benches.each_ref().map(state);
        let differing: Vec<u64> =
            by_scale.iter().zip(&by_shape).filter(|(a, b)| a != b).map(|(a, _)| a.0).collect();
        assert!(differing.is_empty(), "{kinds:?} by {method}: {differing:?} differ");
        assert!(most > 20, "{most} contacts are a poor test");
    }
}

/// Other scales agree up to rounding, which collisions amplify.
#[test]
fn other_sizes_move_alike_to_rounding() {
    let mut benches =
        [true, false].map(|by_scale| thrown(&KINDS, &[1.0, 0.7, 1.4], by_scale, "auto"));
    for _ in 0..3000 {
        benches.iter_mut().for_each(Bench::step);
    }
    let measures = benches.each_mut().map(Bench::measure);
    assert!(measures[0].dissipated > 1e-3 * measures[0].kinetic(), "{:?}", measures[0]);
    let tables = benches.each_ref().map(|bench| bench.sim.particle_table(Alone::default().rank()));
    for (a, b) in tables[0].position.iter().zip(&tables[1].position) {
        assert!((a - b).norm() < 1e-9 * 0.0011, "{a} {b}");
    }
    for (a, b) in tables[0].velocity.iter().zip(&tables[1].velocity) {
        assert!((a - b).norm() < 1e-6, "{a} {b}");
    }
}

#[test]
fn mass_goes_with_the_cube_and_inertia_with_the_fifth_power() {
    for kind in KINDS {
        let text = format!("{}{ONE}", shape_text(kind, "grain", 1.0));
        let mut scene = scene(&with_shapes(&text, BOX));
        let shape = ShapeId(0);
        scene.library.admit(shape, 0.3);
        let particle =
            Particle { scale: 0.3, ..Particle::at_rest(GlobalId(0), shape, Vec3::repeat(0.015)) };
        let bench = Bench::of(&scene, &[particle]);
        let particles = &bench.sim.particles;
        let small = scaled(&scene.library.shapes[0], 0.3);
        let mass = 2500.0 * small.volume();
        assert!((particles.mass(0) / mass - 1.0).abs() < 1e-12, "{kind}");
        let inertia = (small.gyration() * mass).component_div(&particles.inertia(0));
        assert!((inertia - Vec3::repeat(1.0)).amax() < 1e-11, "{kind}: {inertia}");
        assert!((particles.radius(0) / small.bounding_radius() - 1.0).abs() < 1e-12, "{kind}");
    }
}

/// Two sizes meet head-on: the dashpot uses the reduced mass of both, and the energy error vanishes. Extrapolation removes the first-order
/// error of the step in which the bodies touch.
#[test]
fn a_collision_of_two_sizes_has_the_restitution_of_the_scene() {
    for (small, restitution) in [(0.4, 0.6), (0.8, 0.9)] {
        let text =
            format!("{}{ONE}", shape_text("sphere", "ball", 1.0)) + "[neighbours]\nskin = 1e-4\n";
        let text = with_shapes(&text, BOX)
            .replace("gravity = [1.0, 0.5, -9.81]", "")
            .replace("restitution = 0.6", &format!("restitution = {restitution}"))
            .replace("friction = 0.3", "")
            .replace("tangential_damping_ratio = 0.05", "");
        let mut scene = scene(&text);
        scene.library.admit(ShapeId(0), small);
        scene.library.admit(ShapeId(0), 1.5);
        let rebound = |dt: f64| {
            let scene = Scene { dt, ..scene.clone() };
            let ball = |id, scale, x: f64, speed: f64| Particle {
                scale,
                velocity: Vec3::x() * speed,
                ..Particle::at_rest(GlobalId(id), ShapeId(0), Vec3::new(x, 0.015, 0.015))
            };
            let between = 0.0011 * (small + 1.5);
            let balls = [ball(0, small, 0.01, 0.1), ball(1, 1.5, 0.01 + between, 0.0)];
            let mut bench = Bench::of(&scene, &balls);
            bench.step();
            assert_eq!(bench.sim.contacts.len(), 1, "they touch");
            while !bench.sim.contacts.is_empty() {
                bench.step();
            }
            bench.step();
            let energies = bench.measure();
            let missing = energies.missing() / energies.dissipated;
            assert!(missing.abs() < 1e-3, "{missing:e} of the energy is missing");
            let v = &bench.sim.particles.velocity;
            (v[bench.slot(1)] - v[bench.slot(0)]).x / 0.1
        };
        let dt = 2e-9;
        let found = 2.0 * rebound(0.5 * dt) - rebound(dt);
        assert!((found - restitution).abs() < 1e-6, "{found} of {restitution}");
    }
}

/// The smallest particle limits the time step.
#[test]
fn the_stable_step_is_that_of_the_smallest() {
    let limit = |shapes: &str| {
        let one = ONE.replace("first", "shapes = [\"a\"]\nfirst");
        let limit = scene(&with_shapes(&format!("{shapes}{one}"), BOX)).time_step_limit();
        limit.expect("grains have a limit").dt
    };
    for kind in KINDS {
        let sized = shape_text(kind, "a", 1.0) + "size = { uniform = [0.5, 1.25] }\n";
        let both = shape_text(kind, "a", 0.5) + &shape_text(kind, "b", 1.25);
        let (found, expected) = (limit(&sized), limit(&both));
        assert!((found / expected - 1.0).abs() < 1e-9, "{kind}: {found:e}, {expected:e}");
        assert!(found < 0.9 * limit(&shape_text(kind, "a", 1.0)), "{kind}");
    }
}

// --- ranks, restarts, stages ---

/// All kinds, sizes of 1:2, on a lattice and as rain.
fn mixture() -> Scene {
    let mut text = String::new();
    for kind in KINDS {
        text += &shape_text(kind, kind, 0.8);
        text += "size = { uniform = [0.6, 1.2] }\n";
    }
    let names: Vec<String> = KINDS.iter().map(|kind| format!("\"{kind}\"")).collect();
    let _ = write!(
        text,
        r"
[[fill.lattice]]
shapes = [{0}]
low = [0.0, 0.0, 0.0]
high = [0.02, 0.02, 0.017]
spacing = 0.0037
velocity = [0.3, -0.2, -2.0]
[fill.rain]
shapes = [{0}]
count = 30
every = 300
low = [0.0, 0.0, 0.03]
high = [0.02, 0.02, 0.036]
velocity = [0.0, 0.0, -2.0]
[neighbours]
imbalance = 1.05
",
        names.join(", ")
    );
    let domain = BOX
        .replace(
            "high = [0.03, 0.03, 0.05]",
            "high = [0.02, 0.02, 0.05]\nperiodic = [true, false, false]",
        )
        .replace("\"-x\", \"+x\", ", "");
    let text = with_shapes(&text, &domain).replace("density = 2500.0", "density = 265000.0");
    scene(&text.replace("step = 2e-7", "step = 2e-6"))
}

/// Bits of each particle, in the order of ids.
fn sorted_bits(tables: &[ParticleTable]) -> Vec<(u64, Vec<u64>)> {
    let mut all: Vec<_> = tables.iter().flat_map(all_bits).collect();
    all.sort();
    all
}

#[test]
fn sizes_are_the_same_on_any_number_of_ranks_and_after_a_restart() {
    let scene = mixture();
    assert!(scene.needs().scale);
    let alone = OnRanks::of(&scene).the_same_on(2400, &[2, 3], &[[3, 2]]);
    let (grains, contacts) = (alone.bits.len(), alone.records.len());
    assert!(grains > 120 && contacts > 30, "{grains} with {contacts}");
}

/// Sizes from a list of the first stage are known in the next one: mass, search and stable step follow them.
#[test]
fn a_stage_takes_up_sizes_that_its_scene_does_not_list() {
    let folder = tempfile::tempdir().unwrap();
    let csv = "x,y,z,scale\n0.005,0.015,0.01,0.4\n0.015,0.015,0.01,3\n0.025,0.015,0.01,1\n";
    std::fs::write(folder.path().join("grains.csv"), csv).unwrap();
    let text =
        |fill: &str| with_shapes(&format!("{}{fill}", shape_text("ellipsoid", "egg", 1.0)), BOX);
    let listed = text("[[fill.file]]\npath = \"grains.csv\"\n");
    let first = Scene::parse(&listed, "first", folder.path(), &[]).unwrap();
    let snapshots = folder.path().join("out");
    threads::run(2, |comm| {
        let sim = begun(&first, comm);
        save(&sim, &snapshots, &first, comm);
    });

    let second = Scene { initial: Vec::new(), ..scene(&text(ONE)) };
    assert!(!second.needs().scale);
    let take_up = |scene: &Scene| {
        threads::run(3, |comm| {
            let mut sim = assemble::assemble(scene, comm);
            assemble::take_up(&mut sim, scene, &snapshots, Continuation::NewStage, comm)?;
            sim.begin(comm).unwrap();
            for _ in 0..20 {
                sim.step(comm).unwrap();
            }
            let owned = 0..sim.particles.owned;
            Ok(owned.map(|slot| (sim.particles.id[slot], sim.particles.mass(slot))).collect())
        })
    };
    let parts: Result<Vec<Vec<_>>, StartError> = take_up(&second).into_iter().collect();
    let mut masses: Vec<(GlobalId, f64)> = parts.unwrap().into_iter().flatten().collect();
    masses.sort_by_key(|&(id, _)| id);
    let mass = second.library.mass[0];
    let expected = [0.4_f64, 3.0, 1.0].map(|scale| mass * (scale * scale * scale));
    assert_eq!(masses.iter().map(|&(_, mass)| mass).collect::<Vec<_>>(), expected);

    let long = Scene { dt: 0.9 * second.time_step_limit().unwrap().dt, ..second };
    for part in take_up(&long) {
        let told = part.map(|_| ()).unwrap_err().to_string();
        assert!(
            told.contains(
                "scales 0.4 to 3.0 of shape \"egg\": time.step is over their stable limit"
            ),
            "{told}"
        );
    }
}

const CUBE: &str =
    "[[shape]]\nname = \"cube\"\nkind = \"polyhedron\"\nedges = [0.001, 0.001, 0.001]\n";
const SHEET: &str = "v 0.001 0.001 0.02\nv 0.015 0.001 0.02\nv 0.015 0.029 0.02\nv 0.001 0.029 0.02\nf 1 2 3\nf 1 3 4\n";
const SHEET_WALL: &str = "[[wall]]\nname = \"sheet\"\nmesh = \"sheet.obj\"\n";

/// Cells behind triangles are as deep as the largest particles of the previous stage need. A cube presses on the rim of a sheet with its side.
#[test]
fn walls_of_triangles_are_deep_enough_for_sizes_of_the_stage_before() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sheet.obj"), SHEET).unwrap();
    std::fs::write(folder.path().join("grains.csv"), "x,y,z,scale\n0.0179,0.015,0.0201,6\n")
        .unwrap();
    let text = |fill: &str| with_shapes(&format!("{CUBE}{fill}{SHEET_WALL}"), BOX);
    let parsed = |fill| Scene::parse(&text(fill), "stage", folder.path(), &[]).unwrap();
    let first = parsed("[[fill.file]]\npath = \"grains.csv\"\n");
    let snapshots = folder.path().join("out");
    threads::run(1, |comm| {
        let sim = begun(&first, comm);
        save(&sim, &snapshots, &first, comm);
    });
    let after = |scene: Scene| {
        let scene = Scene { initial: Vec::new(), ..scene };
        let tables = threads::run(2, |comm| {
            let mut sim = assemble::assemble(&scene, comm);
            assemble::take_up(&mut sim, &scene, &snapshots, Continuation::NewStage, comm).unwrap();
            sim.begin(comm).unwrap();
            for _ in 0..50 {
                sim.step(comm).unwrap();
            }
            (sim.particle_table(comm.rank()), sim.contacts.len())
        });
        assert!(tables.iter().any(|&(_, contacts)| contacts > 0), "they touch");
        sorted_bits(&tables.into_iter().map(|(table, _)| table).collect::<Vec<_>>())
    };
    assert_eq!(after(parsed(ONE)), after(first));
}

/// Location of the first line with this beginning, in a text that messages call `stage`.
fn place(text: &str, line: &str) -> String {
    let found = text.lines().position(|known| known.starts_with(line));
    format!("stage:{}: ", found.unwrap_or_else(|| panic!("no {line}")) + 1)
}

/// Small particles of the previous stage count wherever a scene uses sizes, and conflicts are reported with their location. Twelve springs `k`
/// around a rotating sphere have the frequency `√(40 k / m)`, and the limit is 2 over it.
#[test]
fn sizes_of_a_start_count_as_those_of_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let csv = "x,y,z,scale\n0.005,0.015,0.01,0.4\n0.015,0.015,0.01,1\n";
    std::fs::write(folder.path().join("grains.csv"), csv).unwrap();
    let snapshots = folder.path().join("first");
    let start = format!("start = {snapshots:?}");
    let text = |head: &str, fill: &str, step: &str, speed: f64| {
        let lid = format!(
            "[[wall]]\nname = \"lid\"\npoint = [0, 0, 0.05]\nnormal = [0, 0, -1]\nvelocity = [0, 0, {speed:?}]\n"
        );
        let shapes = format!("{}{fill}{lid}", shape_text("sphere", "ball", 1.0));
        let text = with_shapes(&shapes, BOX)
            .replace("step = 2e-7", &format!("step = {step}"))
            .replace("restitution = 0.6", "")
            .replace("friction = 0.3", "")
            .replace("tangential_damping_ratio = 0.05", "");
        format!("{head}\n{text}")
    };
    let parsed = |text: &str| Scene::parse(text, "stage", folder.path(), &[]);
    let listed = "[[fill.file]]\npath = \"grains.csv\"\n";
    let first = parsed(&text("", listed, "2e-7", 0.0)).unwrap();
    threads::run(2, |comm| save(&begun(&first, comm), &snapshots, &first, comm));
    let reader = snapshot::Reader::open(&snapshots).unwrap();
    assert_eq!(reader.sizes().unwrap()[0].unwrap().0, [0.4, 1.0]);
    assert_eq!(reader.header().shapes[0].scales, [0.4, 1.0]);

    let limit = |radius: f64| {
        let mass = 2500.0 * 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        2.0 * (mass / (40.0 * 1e4)).sqrt()
    };
    // Limit of the scene with its own list, between one and three times that of the smaller particle.
    let small = first.time_step_limit().unwrap().dt;
    assert!(small > limit(0.4 * 0.0011) && small < 3.0 * limit(0.4 * 0.0011));
    let second = parsed(&text(&start, "", "\"auto\"", 0.0)).unwrap();
    assert!((second.time_step_limit().unwrap().dt / small - 1.0).abs() < 1e-12);
    assert_eq!(second.dt, format!("{:.1e}", 0.8 * small).parse::<f64>().unwrap());
    let words = plan(&second, 1);
    assert!(words.contains("lengths from 0.4 to 1.0 times these"), "{words}");

    let long = 1.05 * small;
    let fast = 0.06 * 2.0 * 0.4 * 0.0011 / 2e-6;
    let over = format!("time.step = {long:?}: over the stable limit of {:.2e} s", 0.995 * small);
    for (step, speed, line, said) in [
        (format!("{long:?}"), 0.0, "step = ", over.as_str()),
        ("2e-6".to_owned(), -fast, "velocity = ", "of the shortest particle axis"),
    ] {
        // Particles of the shape's own size are accepted.
        parsed(&text("", ONE, &step, speed)).unwrap();
        let text = text(&start, "", &step, speed);
        let told = parsed(&text).unwrap_err().to_string();
        let place = place(&text, line);
        let found = told.lines().find(|told| told.contains(said));
        assert!(found.is_some_and(|found| found.starts_with(&place)), "{place}{said}: {told}");
    }
}

/// Cubes on a sheet of triangles and at its rim; the next stage lets the largest and the smallest leave. Returns the snapshots of the first
/// stage, and the file of the next.
fn cubes_on_a_sheet(folder: &Path) -> [PathBuf; 2] {
    let list = "x,y,z,scale\n0.0179,0.015,0.0201,6\n0.025,0.015,0.02,0.4\n0.01595,0.005,0.0201,2\n0.008,0.015,0.02099,2\n\
                0.008,0.015,0.02298,2\n";
    std::fs::write(folder.join("sheet.obj"), SHEET).unwrap();
    std::fs::write(folder.join("grains.csv"), list).unwrap();
    let listed = "[[fill.file]]\npath = \"grains.csv\"\n";
    let text = with_shapes(&format!("{CUBE}{listed}{SHEET_WALL}"), BOX);
    let first = Scene::parse(&text, "first", folder, &[]).unwrap();
    let snapshots = folder.join("first");
    threads::run(2, |comm| save(&begun(&first, comm), &snapshots, &first, comm));
    let outlet =
        "[[outlet]]\nname = \"hatch\"\nlow = [0.016, 0.012, 0.015]\nhigh = [0.03, 0.02, 0.025]\n";
    let text = with_shapes(&format!("{CUBE}{SHEET_WALL}{outlet}"), BOX)
        .replace("step = 2e-7", "step = \"auto\"");
    let file = folder.join("next.toml");
    std::fs::write(&file, format!("start = \"{}\"\n{text}", snapshots.display())).unwrap();
    [snapshots, file]
}

/// State of a stage that continues from a snapshot, at this step.
fn at_step(
    step: u64,
    scene: &Scene,
    path: &Path,
    how: Continuation,
    comm: &mut dyn Comm,
) -> Simulation {
    let mut sim = assemble::assemble(scene, comm);
    assemble::take_up(&mut sim, scene, path, how, comm).unwrap();
    if how == Continuation::NewStage {
        sim.begin(comm).unwrap();
    }
    while sim.step < step {
        sim.step(comm).unwrap();
    }
    sim
}

/// After the largest and the smallest particle have left, a continued stage keeps its step, skin and cells behind triangles. A new stage uses
/// those of the remaining particles.
#[test]
fn a_stage_goes_on_with_the_sizes_of_grains_that_have_left() {
    let folder = tempfile::tempdir().unwrap();
    let [first, file] = cubes_on_a_sheet(folder.path());
    let stage = Scene::read(&file, &[]).unwrap();
    assert_eq!(stage.library.scales[0], [0.4, 6.0]);
    let own = folder.path().join("own");
    let parts = threads::run(2, |comm| {
        let mut sim = at_step(60, &stage, &first, Continuation::NewStage, comm);
        save(&sim, &own, &stage, comm);
        let contacts = sim.contacts.len();
        while sim.step < 160 {
            sim.step(comm).unwrap();
        }
        (sim.particle_table(comm.rank()), contacts)
    });
    assert!(parts.iter().any(|&(_, contacts)| contacts > 0), "they touch");
    let whole = sorted_bits(&parts.into_iter().map(|(table, _)| table).collect::<Vec<_>>());
    assert_eq!(whole.iter().map(|(id, _)| *id).collect::<Vec<_>>(), [2, 3, 4], "two have left");
    for ranks in [1, 2, 3] {
        let again = Scene::read_to_go_on(&file, &[], &own).unwrap();
        assert_eq!((again.dt, again.skin), (stage.dt, stage.skin));
        assert!(again.library == stage.library, "sizes or cells differ");
        let tables = threads::run(ranks, |comm| {
            let sim = at_step(160, &again, &own, Continuation::SameStage, comm);
            sim.particle_table(comm.rank())
        });
        assert_eq!(sorted_bits(&tables), whole, "{ranks} ranks");
    }
    let next = Scene::read(&file, &[format!("start={}", own.display())]).unwrap();
    assert_eq!(next.library.scales[0], [1.0, 2.0]);
    assert!(next.dt > stage.dt && next.skin < stage.skin, "{} {}", next.dt, next.skin);
}

// --- the scene ---

fn parsed(csv: &str, shape: &str) -> Result<Scene, SceneErrors> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("grains.csv"), csv).unwrap();
    let shape = format!(
        "{}{shape}[[fill.file]]\npath = \"grains.csv\"\n",
        shape_text("sphere", "ball", 1.0)
    );
    Scene::parse(&with_shapes(&shape, BOX), "scene", folder.path(), &[])
}

#[test]
fn a_list_gives_sizes() {
    let scene = parsed("scale,x,y,z\n0.5,0.01,0.01,0.01\n1.5,0.02,0.01,0.01\n", "").unwrap();
    let scales: Vec<f64> = initial(&scene).map(|particle| particle.scale).collect();
    assert_eq!(scales, [0.5, 1.5]);
    assert_eq!(scene.library.scales[0], [0.5, 1.5]);
    let plain = parsed("x,y,z,scale\n0.01,0.01,0.01,1\n", "").unwrap();
    assert!(!plain.needs().scale, "no column if all are 1");
    assert!((scene.library.largest_radius() / plain.library.largest_radius() - 1.5).abs() < 1e-15);
    let text = plan(&scene, 2);
    assert!(text.contains("lengths from 0.5 to 1.5 times these"), "{text}");
    assert!(text.contains("; scales"), "{text}");
    assert!(plan(&plain, 2).contains("no scales: all particles are as large as their shapes"));
}

#[test]
fn wrong_sizes_are_said_with_their_place() {
    let row = |scale: &str| format!("x,y,z,scale\n0.01,0.01,0.01,{scale}\n");
    for (csv, shape, message) in [
        (row("0"), "", "line 2, column scale: 0.0 must be greater than 0"),
        (row("-1"), "", "line 2, column scale: -1.0 must be greater than 0"),
        (row("inf"), "", "line 2, column scale: `inf` is not a number"),
        (
            row("1e-90"),
            "",
            "is of scale 1e-90: its mass or moment of inertia leave the range of numbers",
        ),
        (row("0.001"), "", "over the stable limit"),
        (row("1"), "size = 2\n", "shape.ball.size"),
        (row("1"), "size = { uniform = [1.2, 0.8] }\n", "1.2 is more than 0.8"),
        (row("1"), "size = { uniform = [0, 1] }\n", "must be a number greater than 0"),
        (
            row("1"),
            "size = { uniform = [1] }\n",
            "has 1 items; must be a list of two: [smallest, largest]",
        ),
        (row("1"), "size = { gauss = [1, 2] }\n", "gauss"),
        (row("1"), "size = { uniform = [1e-90, 1] }\n", "outside the range of numbers"),
    ] {
        let told = parsed(&csv, shape).unwrap_err().to_string();
        assert!(told.contains(message), "{message}:\n{told}");
    }
}

/// Mean and mean square within four standard errors, and each size depends on the id.
#[test]
fn sizes_are_drawn_as_the_scene_says() {
    let lattice = "[[fill.lattice]]\nlow = [0, 0, 0]\nhigh = [0.3, 0.3, 0.2]\nspacing = 0.006\n";
    let sized = shape_text("sphere", "ball", 1.0) + "size = { uniform = [0.5, 2.0] }\n";
    let domain = BOX.replace("high = [0.03, 0.03, 0.05]", "high = [0.3, 0.3, 0.3]");
    let text = with_shapes(&format!("{sized}{lattice}"), &domain);
    let scene = scene(&text);
    let particles: Vec<Particle> = initial(&scene).collect();
    let count = particles.len() as f64;
    assert!(count > 70_000.0);
    let scales = || particles.iter().map(|particle| particle.scale);
    assert!(scales().all(|scale| (0.5..2.0).contains(&scale)));
    let (mean, square) =
        (scales().sum::<f64>() / count, scales().map(|s| s * s).sum::<f64>() / count);
    let deviation = 1.5 / 12_f64.sqrt();
    assert!((mean - 1.25).abs() < 4.0 * deviation / count.sqrt(), "{mean}");
    // Mean of s⁴ less the squared mean of s²: 6.2 - 1.75².
    assert!(
        (square - 1.75).abs() < 4.0 * (6.2 - 1.75_f64.powi(2)).sqrt() / count.sqrt(),
        "{square}"
    );
    let other = Scene { seed: scene.seed + 1, ..scene };
    assert_ne!(initial(&other).next().map(|p| p.scale), Some(particles[0].scale));
}

/// Largest distance of the cumulative curve of `scales`, which it sorts, from a closed form.
fn kolmogorov_smirnov(scales: &mut [f64], below: impl Fn(f64) -> f64) -> f64 {
    scales.sort_by(f64::total_cmp);
    let count = scales.len() as f64;
    let off = |(k, &s): (usize, &f64)| {
        let [low, high] = [k, k + 1].map(|k| k as f64 / count);
        (below(s) - low).abs().max((high - below(s)).abs())
    };
    scales.iter().enumerate().map(off).fold(0.0, f64::max)
}

/// A lattice of 70,000 spheres with these sizes.
fn of_sizes(size: &str) -> Scene {
    let lattice = "[[fill.lattice]]\nlow = [0, 0, 0]\nhigh = [0.3, 0.3, 0.2]\nspacing = 0.006\n";
    let sized = shape_text("sphere", "ball", 1.0) + &format!("size = {{ {size} }}\n");
    let domain = BOX.replace("high = [0.03, 0.03, 0.05]", "high = [0.3, 0.3, 0.3]");
    scene(&with_shapes(&format!("{sized}{lattice}"), &domain))
}

/// Distributions by number against their closed forms between the limits, with the bound that one sample in a thousand exceeds.
#[test]
fn laws_of_sizes_are_met_by_number() {
    let normal = |x: f64| 0.5 * libm::erfc(-x / 2_f64.sqrt());
    let cases: [(&str, &dyn Fn(f64) -> f64); 4] = [
        ("lognormal = { median = 1.0, sigma = 0.3 }, limits = [0.5, 2.0]", &|s| {
            normal(s.ln() / 0.3)
        }),
        ("normal = { mean = 1.0, deviation = 0.4 }, limits = [0.5, 2.0]", &|s| {
            normal((s - 1.0) / 0.4)
        }),
        ("weibull = { scale = 1.1, shape = 2.0 }, limits = [0.5, 2.0]", &|s| {
            1.0 - (-(s / 1.1).powi(2)).exp()
        }),
        ("uniform = [0.5, 2.0], by = \"mass\"", &|s| -s.powi(-2)),
    ];
    for (size, below) in cases {
        let mut scales: Vec<f64> = initial(&of_sizes(size)).map(|grain| grain.scale).collect();
        let [first, last] = [0.5, 2.0].map(below);
        let largest = kolmogorov_smirnov(&mut scales, |s| (below(s) - first) / (last - first));
        let limit = 1.95 / (scales.len() as f64).sqrt();
        println!("{size}: {largest:.2e} of {limit:.2e}");
        assert!(scales.len() > 70_000 && largest < limit, "{size}: {largest}, {limit}");
    }
}

/// A lognormal distribution by mass is one by number with the median of Hatch and Choate, `ln m = ln m_mass - 3 sigma^2`. Summed masses follow
/// the requested distribution, too.
#[test]
fn a_law_by_mass_is_met_by_number_and_by_mass() {
    let normal = |x: f64| 0.5 * libm::erfc(-x / 2_f64.sqrt());
    let sigma = 0.2;
    let scene =
        of_sizes("lognormal = { median = 1.0, sigma = 0.2 }, limits = [0.4, 2.0], by = \"mass\"");
    let mut scales: Vec<f64> = initial(&scene).map(|grain| grain.scale).collect();
    let below = |s: f64| normal(s.ln() / sigma + 3.0 * sigma);
    let [first, last] = [0.4, 2.0].map(below);
    let largest = kolmogorov_smirnov(&mut scales, |s| (below(s) - first) / (last - first));
    assert!(largest < 1.95 / (scales.len() as f64).sqrt(), "{largest}");
    let all: f64 = scales.iter().map(|s| s.powi(3)).sum();
    let [first, last] = [0.4, 2.0].map(|s: f64| normal(s.ln() / sigma));
    let (mut sum, mut off) = (0.0, 0.0_f64);
    for s in &scales {
        sum += s.powi(3);
        let asked = (normal(s.ln() / sigma) - first) / (last - first);
        off = off.max((sum / all - asked).abs());
    }
    assert!(off < 3.0 * 1.95 / (scales.len() as f64).sqrt(), "{off}");
}

/// Size statistics in the report: identical on one rank and on three, and as accurate as the number of draws allows.
#[test]
fn the_report_holds_sizes_against_what_was_asked_for() {
    let size = "lognormal = { median = 1.0, sigma = 0.3 }, limits = [0.5, 2.0], by = \"mass\"";
    let scene = of_sizes(size);
    let words = plan(&scene, 1);
    assert!(
        words.contains("lognormal of median 1.0 and sigma 0.3 by mass, from 0.5 to 2.0"),
        "{words}"
    );
    let reported = |ranks: u32| {
        let mut all = threads::run(ranks, |comm| {
            let mut sim = assemble::assemble(&scene, comm);
            assemble::fill(&mut sim, &scene, comm);
            dem_mpi::sim::sizes::sizes(&sim.particles, &sim.drives, comm)
        });
        all.swap_remove(0)
    };
    let sizes = reported(1);
    assert_eq!(sizes, reported(3));
    let [one] = &sizes[..] else { panic!("{sizes:?}") };
    let limit = 1.95 / (one.particles as f64).sqrt();
    assert!(one.particles > 70_000 && one.largest_difference_by_number < limit, "{one:?}");
    assert!(one.largest_difference_by_mass < 3.0 * limit);
    let [asked, found] = [&one.asked, &one.found];
    for (a, b) in [(asked.mean, found.mean), (asked.sauter_mean, found.sauter_mean)] {
        assert!((a / b - 1.0).abs() < 5e-3, "{a} {b}");
    }
    // Half of the mass is below the median for limits at the symmetric quantiles -2.31 and 2.31.
    assert!((asked.by_mass_d10_d50_d90[1] - 1.0).abs() < 1e-4, "{asked:?}");
    assert!((found.by_mass_d10_d50_d90[1] - 1.0).abs() < 1e-2, "{found:?}");
    let plots = dem_mpi::post::sizes::plots(&sizes).unwrap();
    assert!(plots.len() == 1 && plots[0].svg.contains("by mass, requested"));
}

/// A size distribution gives a warning if all its particles are listed without scales. Listed scales beyond the distribution are reported
/// unchanged.
#[test]
fn sizes_of_lists_are_their_own() {
    let says = |csv: &str, shape: &str| {
        let doubts = dem_mpi::scene::doubts::doubts(&parsed(csv, shape).unwrap());
        doubts.iter().any(|doubt| doubt.contains("Give the file a column `scale`"))
    };
    let law = "size = { uniform = [0.9, 1.1] }\n";
    assert!(says("x,y,z\n0.01,0.01,0.01\n", law));
    assert!(
        !says("x,y,z,scale\n0.01,0.01,0.01,0.95\n", law) && !says("x,y,z\n0.01,0.01,0.01\n", "")
    );
    let scene = parsed("x,y,z,scale\n0.02,0.02,0.02,2.0\n0.01,0.01,0.01,0.5\n", law).unwrap();
    let sizes = threads::run(1, |comm| {
        let mut sim = assemble::assemble(&scene, comm);
        assemble::fill(&mut sim, &scene, comm);
        dem_mpi::sim::sizes::sizes(&sim.particles, &sim.drives, comm)
    });
    let found = &sizes[0][0].found;
    assert!((found.mean - 1.25).abs() < 1e-9, "{found:?}");
    let [low, .., high] = found.by_number_d10_d50_d90;
    assert!((low / 0.5 - 1.0).abs() < 1e-3 && (high / 2.0 - 1.0).abs() < 1e-3, "{found:?}");
}

/// Particles that have left still count: the statistics are those of the whole lattice, on any number of ranks and across a restart.
#[test]
fn the_report_counts_sizes_that_have_left() {
    let size = "lognormal = { median = 1.0, sigma = 0.3 }, limits = [0.5, 2.0], by = \"mass\"";
    let whole = of_sizes(size);
    let outlet =
        "[[outlet]]\nname = \"half\"\npoint = [0.05, 0, 0]\nnormal = [1, 0, 0]\nevery = 10\n[time]";
    let text = whole.text.replace("[time]", outlet);
    assert_ne!(text, whole.text);
    let scene = Scene::parse(&text, "test", Path::new(""), &[]).unwrap();
    let all_there = threads::run(1, |comm| {
        let mut sim = assemble::assemble(&whole, comm);
        assemble::fill(&mut sim, &whole, comm);
        dem_mpi::sim::sizes::sizes(&sim.particles, &sim.drives, comm)
    });
    let [expected] = &all_there[0][..] else { panic!("{all_there:?}") };
    let folder = tempfile::tempdir().unwrap();
    let reported = |ranks: u32, again: bool| {
        let mut all = threads::run(ranks, |comm| {
            let mut sim = assemble::assemble(&scene, comm);
            if again {
                let (path, stage) = (folder.path(), assemble::Continuation::SameStage);
                assemble::take_up(&mut sim, &scene, path, stage, comm).unwrap();
            } else {
                assemble::fill(&mut sim, &scene, comm);
                sim.begin(comm).unwrap();
                if ranks == 3 {
                    save(&sim, folder.path(), &scene, comm);
                }
            }
            dem_mpi::sim::sizes::sizes(&sim.particles, &sim.drives, comm)
        });
        all.swap_remove(0)
    };
    let sizes = reported(1, false);
    let [found] = &sizes[..] else { panic!("{sizes:?}") };
    assert_eq!(&SizesOf { left: 0, ..found.clone() }, expected);
    println!("{} of {} have left", found.left, found.particles);
    assert!(found.left > found.particles / 8 && found.left < found.particles, "{found:?}");
    assert_eq!(sizes, reported(3, false));
    assert_eq!(sizes, reported(2, true));
}

// --- files and results from them ---

#[test]
fn volumes_and_axes_of_a_snapshot_are_those_of_the_sizes() {
    let scene = parsed("x,y,z,scale\n0.01,0.01,0.01,0.5\n0.02,0.01,0.01,1.5\n", "").unwrap();
    let mut comm = Alone::default();
    let sim = begun(&scene, &mut comm);
    let folder = tempfile::tempdir().unwrap();
    save(&sim, folder.path(), &scene, &mut comm);
    let reader = snapshot::Reader::open(folder.path()).unwrap();
    let table = reader.particles(0..2).unwrap();
    assert_eq!(table.scale, [0.5, 1.5]);
    let mut solid = SolidVolume::default();
    solid.add(reader.header(), &table);
    let expected = (0.125 + 3.375) * scene.library.shapes[0].volume();
    assert!((solid.finish() / expected - 1.0).abs() < 1e-14);
    let mut dump = Vec::new();
    lammps::write_particles(&mut dump, reader.header(), &table).unwrap();
    let dump = String::from_utf8(dump).unwrap();
    let axes: Vec<f64> =
        dump.lines().map(|line| line.split(' ').nth(9).unwrap().parse().unwrap()).collect();
    assert_eq!(axes, [0.0011, 0.0033]);
}
