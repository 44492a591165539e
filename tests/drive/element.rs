//! Periodic cells under homogeneous strain, against closed forms: lattices, free particles, energies, stress targets.

use crate::support::{OnRanks, begun, close, expect_refused, save, scene};
use dem_mpi::cell::{Cell, Strained};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::threads;
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble::{self, Continuation, StartError};
use dem_mpi::scene::probe::{Probe, probe};
use dem_mpi::sim::Simulation;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;

/// Diameter of the balls of lattices [m].
const DIAMETER: f64 = 1e-3;
/// Normal stiffness of their contacts [N/m].
const NORMAL: f64 = 1e4;
/// Tangential stiffness of their contacts [N/m].
const TANGENTIAL: f64 = 6e3;

/// Edge of the cubic cell of a lattice over the distance of neighbours, and its balls in units of the edge.
type Lattice = (f64, &'static [[f64; 3]]);

const SIMPLE: Lattice = (1.0, &[[0.0; 3]]);
const BODY_CENTRED: Lattice = (1.154_700_538_379_251_5, &[[0.0; 3], [0.5; 3]]);
const FACE_CENTRED: Lattice =
    (std::f64::consts::SQRT_2, &[[0.0; 3], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.5, 0.5, 0.0]]);

/// Balls on a lattice whose neighbours overlap by this fraction of the diameter.
fn lattice(
    (edge, balls): Lattice,
    [nx, ny, nz]: [u32; 3],
    overlap: f64,
    [material, law, cell]: [&str; 3],
    step: f64,
) -> Scene {
    let edge = edge * DIAMETER * (1.0 - overlap);
    let sides = [nx, ny, nz].map(|count| edge * f64::from(count));
    let mut fills = String::new();
    for ball in balls {
        let [x, y, z] = ball.map(|part| (part + 0.25) * edge);
        write!(
            fills,
            "[[fill.lattice]]\nfirst = [{x:?}, {y:?}, {z:?}]\ncount = [{nx}, {ny}, {nz}]\nspacing = {edge:?}\n"
        )
        .unwrap();
    }
    scene(&format!(
        "[domain]\nlow = [0, 0, 0]\nhigh = {sides:?}\nperiodic = [true, true, true]\n[cell]\n{cell}\n\
         [[material]]\nname = \"steel\"\ndensity = 2000.0\n{material}\n{law}\n\
         [[shape]]\nname = \"ball\"\nkind = \"sphere\"\ndiameter = {DIAMETER:?}\n{fills}[time]\nstep = {step:?}\nallow_unstable = true\n\
         [neighbours]\nskin = 1e-5\n"
    ))
}

/// Stress, compression positive: xx, yy, zz, xy, xz, yz [Pa].
fn stress(sim: &Simulation) -> [f64; 6] {
    sim.measure(&mut Alone::default()).bulk.expect("of a strained cell").stress()
}

/// Moduli C11, C12, C44 times the diameter [N/m], from one step of a strain of 1e-7.
fn moduli(of: Lattice, count: u32, overlap: f64) -> [f64; 3] {
    const STRAIN: f64 = 1e-7;
    let step = 1e-6;
    let material = format!(
        "normal_stiffness = {NORMAL:?}\ntangential_stiffness = {TANGENTIAL:?}\nfriction = 100.0"
    );
    let strained = |component: &str| {
        let cell = format!("{component} = {{ rate = {:?} }}", STRAIN / step);
        let mut sim = begun(
            &lattice(of, [count; 3], overlap, [&material, "", &cell], step),
            &mut Alone::default(),
        );
        let before = stress(&sim);
        sim.step(&mut Alone::default()).unwrap();
        let after = stress(&sim);
        move |k: usize| (after[k] - before[k]) / STRAIN * DIAMETER
    };
    let (along, across) = (strained("xx"), strained("xy"));
    [along(0), along(1), across(3)]
}

/// Every ball is a centre of symmetry, so the strain is uniform and the moduli are sums over the bonds of one ball. An initial overlap
/// adds to them in proportion.
#[test]
fn lattices_have_the_moduli_of_their_bonds() {
    let (kn, kt) = (NORMAL, TANGENTIAL);
    let (third, two) = (3.0_f64.sqrt() / 3.0, 2.0_f64.sqrt());
    for (name, of, count, expected) in [
        ("simple", SIMPLE, 4, [kn, 0.0, 0.5 * kt]),
        (
            "body-centred",
            BODY_CENTRED,
            3,
            [third * (kn + 2.0 * kt), third * (kn - kt), third * (kn + 0.5 * kt)],
        ),
        ("face-centred", FACE_CENTRED, 2, [two * (kn + kt), (kn - kt) / two, (kn + kt) / two]),
    ] {
        let at = |overlap: f64| moduli(of, count, overlap);
        let (small, large) = (at(4e-7), at(8e-7));
        for k in 0..3 {
            let errors = [small[k], large[k]].map(|found| (found - expected[k]) / kn);
            println!("{name} {k}: {errors:?}");
            // Extrapolation to zero overlap removes the part of the error that is proportional to the overlap.
            let rest = 2.0 * errors[0] - errors[1];
            assert!(rest.abs() < 1e-6, "{name}, modulus {k}: {rest:e} beside the overlap");
            assert!(errors[0].abs() < 3e-6, "{name}, modulus {k}: {errors:?}");
        }
    }
}

/// `--probe` finds the moduli of lattices, beside a part in proportion to the overlap, on one rank and on two.
#[test]
fn probes_find_the_moduli_of_lattices() {
    let (kn, kt) = (NORMAL, TANGENTIAL);
    let two = 2.0_f64.sqrt();
    let material =
        format!("normal_stiffness = {kn:?}\ntangential_stiffness = {kt:?}\nfriction = 100.0");
    let of = |overlap: f64, ranks: u32| {
        let scene = lattice(FACE_CENTRED, [2; 3], overlap, [&material, "", ""], 2e-6);
        let parts = threads::run(ranks, |comm| probe(&scene, None, 1e-7, comm).unwrap());
        assert!(parts.iter().all(|part| *part == parts[0]));
        parts.into_iter().next().unwrap()
    };
    let (small, large) = (of(2e-5, 1), of(4e-5, 1));
    assert_eq!(small, of(2e-5, 2), "bits on two ranks");
    for i in 0..6 {
        for j in 0..6 {
            let expected = match (i, j) {
                (0..3, 0..3) if i == j => two * (kn + kt),
                (0..3, 0..3) => (kn - kt) / two,
                _ if i == j => (kn + kt) / two,
                _ => 0.0,
            };
            let [one, other] = [&small, &large].map(|probe| probe.stiffness[i][j] * DIAMETER);
            let rest = (2.0 * one - other - expected) / kn;
            assert!(rest.abs() < 1e-6, "{i} {j}: {rest:e} beside the overlap");
        }
    }
    assert!(small.uneven < 1e-3 && small.unrest < 1e-5, "{small:?}");
}

/// In a hexagonal close packing balls are no centres of symmetry: its planes shift as the cell is strained. With central springs
/// between neighbours, `C11 : C12 : C13 : C33 : C44 : C66` are `29 : 11 : 8 : 32 : 8 : 9` where this shift has the least
/// energy, and `30 : 10 : 8 : 32 : 8 : 10` without it; `C33 = (4 sqrt 2 / 3) k / d`.
#[test]
fn a_hexagonal_packing_relaxes_to_its_moduli() {
    let a = DIAMETER * (1.0 - 1e-5);
    let sides = [a, 3.0_f64.sqrt() * a, (8.0_f64 / 3.0).sqrt() * a];
    let counts = [3, 2, 2];
    let box_sides = [0, 1, 2].map(|k| sides[k] * f64::from(counts[k]));
    let mut fills = String::new();
    for [x, y, z] in
        [[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 1.0 / 6.0, 0.5], [0.0, 2.0 / 3.0, 0.5]]
    {
        let first = [(x + 0.2) * sides[0], (y + 0.2) * sides[1], (z + 0.2) * sides[2]];
        write!(
            fills,
            "[[fill.lattice]]\nfirst = {first:?}\ncount = {counts:?}\nspacing = {sides:?}\n"
        )
        .unwrap();
    }
    let scene = scene(&format!(
        "[domain]\nlow = [0, 0, 0]\nhigh = {box_sides:?}\nperiodic = [true, true, true]\n\
         [[material]]\nname = \"steel\"\ndensity = 2000.0\nnormal_stiffness = {NORMAL:?}\n\
         [[shape]]\nname = \"ball\"\nkind = \"sphere\"\ndiameter = {DIAMETER:?}\n{fills}[time]\nstep = 2e-6\n\
         [neighbours]\nskin = 1e-5\n"
    ));
    let probe = probe(&scene, None, 1e-7, &mut Alone::default()).unwrap();
    let rows = [
        (0, 0, 29.0),
        (1, 1, 29.0),
        (0, 1, 11.0),
        (0, 2, 8.0),
        (1, 2, 8.0),
        (2, 0, 8.0),
        (2, 2, 32.0),
        (3, 3, 9.0),
        (4, 4, 8.0),
        (5, 5, 8.0),
        (0, 3, 0.0),
        (3, 5, 0.0),
    ];
    has_stiffness(&probe, &rows);
}

/// Stiffness of a close packing with central springs, over `sqrt 2 / 24` of the springs over the diameter.
fn stiffness(probe: &Probe, i: usize, j: usize) -> f64 {
    probe.stiffness[i][j] * DIAMETER / NORMAL * 24.0 / 2.0_f64.sqrt()
}

/// Checks components of a stiffness.
fn has_stiffness(probe: &Probe, rows: &[(usize, usize, f64)]) {
    println!("{}", probe.words());
    for &(i, j, expected) in rows {
        let found = stiffness(probe, i, j);
        assert!((found - expected).abs() < 3e-3, "{i} {j}: {found} for {expected}");
    }
}

/// A face-centred lattice in a cell of its primitive edges, so that every edge leans. Along z is a space diagonal of the cube. With central
/// springs `C11 : C12 : C13 : C33 : C44 : C66` are `30 : 10 : 8 : 32 : 8 : 10` from the cubic moduli, and `C14` is `2 sqrt 2`.
#[test]
fn a_cell_of_primitive_edges_has_the_moduli_of_its_lattice() {
    const COUNT: u32 = 3;
    let a = DIAMETER * (1.0 - 1e-5);
    let edges = [
        [a, 0.0, 0.0],
        [0.5 * a, 0.75_f64.sqrt() * a, 0.0],
        [0.5 * a, (1.0_f64 / 12.0).sqrt() * a, (2.0_f64 / 3.0).sqrt() * a],
    ];
    let folder = tempfile::tempdir().unwrap();
    let mut rows = "x,y,z\n".to_owned();
    for [i, j, k] in (0..COUNT.pow(3)).map(|n| [n % COUNT, n / COUNT % COUNT, n / COUNT / COUNT]) {
        let place = |axis: usize| {
            let whole = [i, j, k].map(f64::from);
            1e-4 + (0..3).map(|edge| whole[edge] * edges[edge][axis]).sum::<f64>()
        };
        writeln!(rows, "{:e},{:e},{:e}", place(0), place(1), place(2)).unwrap();
    }
    fs::write(folder.path().join("lattice.csv"), rows).unwrap();
    let edges = edges.map(|edge| edge.map(|x| x * f64::from(COUNT)));
    let text = format!(
        "[domain]\nlow = [0, 0, 0]\nedges = {edges:?}\n[cell]\n\
         [[material]]\nname = \"steel\"\ndensity = 2000.0\nnormal_stiffness = {NORMAL:?}\n\
         [[shape]]\nname = \"ball\"\nkind = \"sphere\"\ndiameter = {DIAMETER:?}\n[[fill.file]]\npath = \"lattice.csv\"\n\
         [time]\nstep = 2e-6\nsteps = 1\n[neighbours]\nskin = 1e-5\n[output]\ndirectory = \"out\"\n"
    );
    let scene = Scene::parse(&text, "scene.toml", folder.path(), &[]).unwrap();
    let found = probe(&scene, None, 1e-7, &mut Alone::default()).unwrap();
    let shared = threads::run(2, |comm| probe(&scene, None, 1e-7, comm).unwrap());
    assert!(shared.iter().all(|part| *part == found), "bits on two ranks");
    let beside = stiffness(&found, 0, 5).signum() * 8.0_f64.sqrt();
    let rows = [
        (0, 0, 30.0),
        (1, 1, 30.0),
        (0, 1, 10.0),
        (0, 2, 8.0),
        (2, 1, 8.0),
        (2, 2, 32.0),
        (3, 3, 10.0),
        (4, 4, 8.0),
        (5, 5, 8.0),
        (0, 3, 0.0),
        (0, 4, 0.0),
        (2, 5, 0.0),
        (0, 5, beside),
        (1, 5, -beside),
        (3, 4, beside),
    ];
    has_stiffness(&found, &rows);
    for (from, to, said) in [
        ("[cell]", "", "needs a [cell]; an empty one keeps the edges"),
        ("[cell]", "high = [1, 1, 1]\n[cell]", "is not together with `edges`"),
        ("[cell]", "walls = [\"-z\"]\n[cell]", "is not together with `edges`"),
        ("[cell]", "periodic = [true, true, false]\n[cell]", "must be true for all axes"),
        ("[cell]", "[cell]\nzz = { rate = 1e9 }", "in a step"),
        ("skin = 1e-5", "skin = 1e-3", "a period must be at least"),
        (
            "edges = [[",
            "edges = [[0, 0, 1], [1, 0, 0], [0, 1, 0]] # ",
            "must be [a, 0, 0], [b, c, 0]",
        ),
    ] {
        let text = text.replacen(from, to, 1);
        let mistakes = Scene::parse(&text, "scene.toml", folder.path(), &[]).expect_err(to);
        assert!(mistakes.to_string().contains(said), "{to}: {mistakes}");
    }
}

/// `p = (4 sqrt 2 / 3) E* e^(3/2) / (1 - e)^2` for smooth balls, at every strain.
#[test]
fn a_face_centred_lattice_of_hertz_follows_its_closed_form() {
    let material = "youngs_modulus = 1e9\npoisson_ratio = 0.25";
    let law = "[law]\nnormal = \"hertz\"";
    let cell = "isotropic = { rate = 10.0 }";
    let scene = lattice(FACE_CENTRED, [3; 3], 0.0, [material, law, cell], 1e-6);
    let mut sim = begun(&scene, &mut Alone::default());
    let side = sim.particles.cell.sides().x;
    for look in 0..5 {
        for _ in 0..100 {
            sim.step(&mut Alone::default()).unwrap();
        }
        let strain = 1.0 - sim.particles.cell.sides().x / side;
        let modulus = 1e9 / (2.0 * (1.0 - 0.25 * 0.25));
        let pressure =
            4.0 * 2.0_f64.sqrt() / 3.0 * modulus * strain.powf(1.5) / (1.0 - strain).powi(2);
        let [x, y, z, xy, xz, yz] = stress(&sim);
        for found in [x, y, z] {
            close(found, pressure, 1e-10, &format!("pressure {look}"));
        }
        assert!([xy, xz, yz].iter().all(|stress| stress.abs() < 1e-9 * pressure));
        assert!(sim.particles.velocity.iter().all(|v| v.norm() < 1e-9));
    }
}

/// Balls of a lattice along x, and across [-].
const LONG: u32 = 24;

/// Square of the frequency of a standing wave along x [1/s²], over the mean stiffness `NORMAL` per mass of a ball. The wave displaces balls along
/// the given axis. `tangential` and `friction` are keys of the material.
fn frequency_squared(of: Lattice, axis: usize, overlap: f64, friction: bool) -> f64 {
    let step = 2e-6;
    let mut material = format!("normal_stiffness = {NORMAL:?}");
    if friction {
        write!(material, "\ntangential_stiffness = {TANGENTIAL:?}\nfriction = 100.0").unwrap();
    }
    let scene = lattice(of, [LONG, 3, 3], overlap, [&material, "", ""], step);
    let comm = &mut Alone::default();
    let mut sim = assemble::assemble(&scene, comm);
    assemble::fill(&mut sim, &scene, comm);
    let owned = sim.particles.owned;
    let sides = sim.particles.cell.sides();
    let phase = |x: &Vec3| (std::f64::consts::TAU * x.x / sides.x).sin();
    let first = sim.particles.position[..owned].to_vec();
    for (velocity, place) in sim.particles.velocity[..owned].iter_mut().zip(&first) {
        velocity[axis] = 1e-4 * phase(place);
    }
    let rest: BTreeMap<_, _> =
        sim.particles.id[..owned].iter().copied().zip(first.iter().copied()).collect();
    sim.begin(comm).unwrap();
    let mut displaced = |steps: u32| {
        for _ in 0..steps {
            sim.step(comm).unwrap();
        }
        let particles = &sim.particles;
        let ways = particles.id[..owned].iter().zip(&particles.position).map(|(id, place)| {
            let way = (place - rest[id])[axis];
            (way - sides[axis] * (way / sides[axis]).round()) * phase(&rest[id])
        });
        ways.sum::<f64>()
    };
    // A standing wave is `sin(omega n dt)`; of a step `sin(omega dt/2)` is half the step times the frequency.
    let steps = 25;
    let (once, twice) = (displaced(steps), displaced(steps));
    let angle = (0.5 * twice / once).acos() / f64::from(steps);
    let mass = 2000.0 * std::f64::consts::PI / 6.0 * DIAMETER.powi(3);
    (2.0 / step * (0.5 * angle).sin()).powi(2) * mass / NORMAL
}

/// The dispersion of sums over neighbours: `omega² = 4/m sum k sin²(q x/2)` over half of them. An initial overlap adds in proportion where the wave
/// is transverse. With springs in the plane balls turn in a transverse wave, and its long limit is `C44/rho`.
#[test]
fn waves_in_lattices_have_the_speeds_of_their_moduli() {
    let ratio = TANGENTIAL / NORMAL;
    let q = std::f64::consts::TAU / f64::from(LONG);
    let (whole, half) = (1.0 - q.cos(), 1.0 - (0.5 * q).cos());
    for (name, of, friction, axis, expected, within) in [
        ("simple, along", SIMPLE, true, 0, 2.0 * whole, 1e-7),
        ("body-centred, along", BODY_CENTRED, true, 0, (8.0 + 16.0 * ratio) / 3.0 * half, 1e-7),
        ("face-centred, along", FACE_CENTRED, true, 0, 4.0 * (1.0 + ratio) * half, 1e-7),
        ("body-centred, across", BODY_CENTRED, false, 1, 8.0 / 3.0 * half, 1e-7),
        ("face-centred, across", FACE_CENTRED, false, 1, 2.0 * half, 1e-7),
        // omega² m/kn = C44 q²/rho m/kn, with C44 d of the table of moduli.
        ("simple, with springs, across", SIMPLE, true, 1, 0.5 * ratio * q * q, 1e-2),
        (
            "body-centred, with springs, across",
            BODY_CENTRED,
            true,
            1,
            (2.0 + ratio) / 6.0 * q * q,
            1e-2,
        ),
        (
            "face-centred, with springs, across",
            FACE_CENTRED,
            true,
            1,
            (1.0 + ratio) / 4.0 * q * q,
            1e-2,
        ),
    ] {
        let [small, large] = [4e-5, 8e-5]
            .map(|overlap| frequency_squared(of, axis, overlap, friction) / expected - 1.0);
        let rest = 2.0 * small - large;
        println!("{name}: {small:.2e}, beside the overlap {rest:.2e}");
        assert!(rest.abs() < within, "{name}: {rest:e}");
        assert!(small.abs() < within + 1e-3, "{name}: {small:e}");
    }
}

/// Particles without any contact.
fn cloud(cell: &str, velocity: &str, step: f64) -> Scene {
    scene(&format!(
        "[domain]\nlow = [-0.01, 0.02, 0.03]\nhigh = [0.02, 0.045, 0.055]\nperiodic = [true, true, true]\n[cell]\n{cell}\n\
         [[material]]\nname = \"steel\"\ndensity = 2000.0\nnormal_stiffness = 1e4\n\
         [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 1e-5\n\
         [[fill.lattice]]\nfirst = [-0.0083, 0.0211, 0.0323]\ncount = [5, 4, 4]\nspacing = 0.0057\njitter = 1e-3\nvelocity = {velocity}\n\
         [time]\nstep = {step:?}\nallow_unstable = true\n"
    ))
}

const ALL: &str = "xx = { rate = 0.4 }\nyy = { rate = -0.3 }\nzz = { rate = 0.2 }\nxy = { rate = -3.0 }\nxz = { rate = 2.0 }\nyz = { rate = 1.5 }";

/// Position of a particle in units of the cell's edges, without periods.
fn parts(sim: &Simulation, slot: usize) -> Vec3 {
    let Simulation { particles, .. } = sim;
    let place = particles.cell.unwrapped(particles.position[slot], &particles.image[slot]);
    let edges = particles.cell.strained().expect("a strained cell").edges;
    edges.try_inverse().unwrap() * (place - particles.cell.corners().0)
}

/// Particles at rest relative to the flow move with the edges, through many choices of edges and faces.
#[test]
fn free_grains_keep_their_parts_of_the_edges() {
    let mut sim = begun(&cloud(ALL, "[0.0, 0.0, 0.0]", 1e-4), &mut Alone::default());
    let count = sim.particles.owned;
    let id = |sim: &Simulation, slot: usize| sim.particles.id[slot].0;
    let before: BTreeMap<u64, Vec3> =
        (0..count).map(|slot| (id(&sim, slot), parts(&sim, slot))).collect();
    for _ in 0..10_000 {
        sim.step(&mut Alone::default()).unwrap();
    }
    assert!(sim.particles.velocity.iter().all(|v| *v == Vec3::zeros()));
    for slot in 0..count {
        let error = (parts(&sim, slot) - before[&id(&sim, slot)]).norm();
        assert!(error < 1e-11, "slot {slot}: {error:e}");
    }
    let strained = sim.particles.cell.strained().unwrap();
    assert!((strained.strain.m12 - 3.0).abs() < 1e-9, "{}", strained.strain);
    assert!(sim.particles.image.iter().take(count).any(|image| image[0].abs() > 1));
}

/// `v = exp(-L t) v0` for free particles, and their energy, to second order in the step.
#[test]
fn free_grains_slow_down_as_the_flow_says() {
    let simple = "xy = { rate = -3.0 }\nzz = { rate = 0.5 }";
    let errors = [2e-4, 1e-4].map(|step: f64| {
        let mut sim = begun(&cloud(simple, "[0.01, 0.02, 0.03]", step), &mut Alone::default());
        for _ in 0..(0.2 / step).round() as usize {
            sim.step(&mut Alone::default()).unwrap();
        }
        let expected = Vec3::new(0.01 - 3.0 * 0.2 * 0.02, 0.02, 0.03 * (0.5_f64 * 0.2).exp());
        let measures = sim.measure(&mut Alone::default());
        assert!(measures.missing().abs() < 1e-12 * measures.kinetic(), "{}", measures.missing());
        (sim.particles.velocity[0] - expected).norm() / expected.norm()
    });
    assert!(errors[0] < 1e-6 && (3.5..4.5).contains(&(errors[0] / errors[1])), "{errors:?}");
}

/// Colliding particles of a shape and a material: two interpenetrating lattices, with `count` cells of 3.1 mm along each axis.
fn crowd(domain: &str, shape: &str, material: &str, count: u32, step: f64) -> String {
    let spacing = 3.1e-3;
    let side = spacing * f64::from(count);
    let filled = if shape.contains("[[shape]]") { "shapes = [\"grain\"]\n" } else { "" };
    let half = |first: f64, velocity: f64| {
        format!(
            "[[fill.lattice]]\nfirst = [{first:?}, {first:?}, {first:?}]\ncount = [{count}, {count}, {count}]\nspacing = {spacing:?}\n\
             jitter = 1e-5\nvelocity = [0.0, {:?}, {velocity:?}]\n{filled}",
            0.2 * velocity
        )
    };
    format!(
        "[domain]\nlow = [0, 0, 0]\nhigh = [{side:?}, {side:?}, {side:?}]\nperiodic = [true, true, true]\n{domain}\n\
         [[material]]\nname = \"grain\"\ndensity = 2600.0\nnormal_stiffness = 2e4\ntangential_stiffness = 1.5e4\n{material}\n\
         [[shape]]\nname = \"grain\"\n{shape}\n{}{}[time]\nstep = {step:?}\n",
        half(0.25 * spacing, 0.3),
        half(0.75 * spacing, -0.3)
    )
}

const BALL: &str = "kind = \"sphere\"\nradius = 0.0012\nsize = { uniform = [0.9, 1.1] }";
const EGG: &str = "kind = \"ellipsoid\"\nsemi_axes = [0.00135, 0.0012, 0.0009]";
/// Two joined balls.
const PAIR: &str = "kind = \"union\"\npieces = [{ shape = \"half\", at = [0, 0, 0] }, { shape = \"half\", at = [0.001, 0, 0] }]\n\
                    [[shape]]\nname = \"half\"\nkind = \"sphere\"\nradius = 0.00095";
const ROUGH: &str = "friction = 0.4\nrestitution = 0.4";

/// Simple shear at constant volume equals shear by moving images. The difference falls with the square of the step.
#[test]
fn simple_shear_is_that_of_sliding_images() {
    let differences = [2e-6, 1e-6].map(|step: f64| {
        let [slides, strained] = [
            "shear = { along = \"x\", across = \"y\", rate = 60.0 }",
            "[cell]\nxy = { rate = -60.0 }",
        ]
        .map(|domain| {
            let text = crowd(domain, BALL, "", 4, step);
            let mut sim = begun(&scene(&text), &mut Alone::default());
            for _ in 0..(4e-4 / step).round() as usize {
                sim.step(&mut Alone::default()).unwrap();
            }
            assert!(sim.contacts.iter().count() > 8, "{}", sim.contacts.iter().count());
            stress(&sim)
        });
        let size = slides.iter().fold(0.0_f64, |most, stress| most.max(stress.abs()));
        (0..6).map(|k| (slides[k] - strained[k]).abs()).fold(0.0, f64::max) / size
    });
    println!("{differences:?}");
    assert!(differences[0] < 1e-4 && differences[1] < 0.5 * differences[0], "{differences:?}");
}

/// Two stages: compression to a stress, then shear under that stress, through more than one choice of edges.
fn pressed(shape: &str) -> [String; 2] {
    let compressed = "[cell]\nisotropic = { stress = 2e4 }\nmax_rate = 20.0";
    let sheared = "[cell]\nxx = { rate = 0.0 }\nyy = { stress = 2e4 }\nzz = { rate = 0.0 }\nxy = { rate = -20.0 }\nmax_rate = 20.0";
    [compressed, sheared].map(|cell| crowd(cell, shape, ROUGH, 5, 3e-6))
}

/// The stress reaches its target and stays there. The work of the cell equals stored, kinetic and dissipated energy.
/// Pairs of balls collide with the shortest times: their missing energy is a quarter at half the step.
#[test]
fn a_packing_takes_its_stress_and_loses_no_energy() {
    for (shape, most) in [(BALL, 1e-5), (EGG, 1e-4), (PAIR, 5e-4)] {
        let [first, second] = pressed(shape).map(|text| scene(&text));
        let mut comm = Alone::default();
        let mut sim = begun(&first, &mut comm);
        for _ in 0..30_000 {
            sim.step(&mut comm).unwrap();
        }
        let outcome = |sim: &Simulation| {
            let element = sim.drives.iter().find(|drive| drive.name() == "cell").unwrap();
            element.outcome(&[], false)
        };
        let kept = outcome(&sim).kept;
        println!("{kept:?}");
        assert!(kept[0].mean_error < 1e-3, "{kept:?}");
        let [x, y, z, ..] = stress(&sim);
        close((x + y + z) / 3.0, 2e4, 2e-3, "mean stress");
        let measures = sim.measure(&mut comm);
        let missing = measures.missing() / measures.dissipated;
        println!("compression: {missing:e} of {:e} J is missing", measures.dissipated);
        assert!(missing.abs() < most, "{missing:e}");

        let folder = tempfile::tempdir().unwrap();
        save(&sim, folder.path(), &first, &mut comm);
        let mut sim = assemble::assemble(&second, &comm);
        assemble::take_up(&mut sim, &second, folder.path(), Continuation::NewStage, &mut comm)
            .unwrap();
        sim.begin(&mut comm).unwrap();
        for _ in 0..20_000 {
            sim.step(&mut comm).unwrap();
        }
        let kept = outcome(&sim).kept;
        println!("{kept:?}");
        assert!((kept[0].mean / 2e4 - 1.0).abs() < 0.01, "{kept:?}");
        let measures = sim.measure(&mut comm);
        let strained = sim.particles.cell.strained().unwrap();
        assert!(strained.strain.m12 > 1.15 && strained.edges.m12 / strained.edges.m11 > 0.6);
        let missing = measures.missing() / measures.dissipated;
        println!("shear: {missing:e} of {:e} J is missing", measures.dissipated);
        assert!(missing.abs() < most && measures.dissipated > 0.0, "{missing:e}");
        // Against the flow: positive shear does work.
        assert!(stress(&sim)[3] < -1e3, "{:?}", stress(&sim));
    }
}

/// Targets for all six components at once, one of them zero.
#[test]
fn all_six_stresses_are_reached() {
    let cell = "[cell]\nxx = { stress = 3e4 }\nyy = { stress = 2e4 }\nzz = { stress = 2e4 }\nxy = { stress = 3e3 }\nxz = { stress = 0 }\n\
                yz = { stress = -2e3 }\nmax_rate = 20.0\nramp = 0.02";
    let text = crowd(cell, BALL, ROUGH, 5, 3e-6);
    let mut sim = begun(&scene(&text), &mut Alone::default());
    for _ in 0..30_000 {
        sim.step(&mut Alone::default()).unwrap();
    }
    let element = sim.drives.iter().find(|drive| drive.name() == "cell").unwrap();
    let kept = element.outcome(&[], false).kept;
    println!("{kept:#?}");
    assert_eq!((kept.len(), element.standing().unfinished), (6, None));
    for one in kept {
        assert!(one.mean_error < 1e-3, "{one:?}");
    }
}

/// Identical bits while the cell changes its edges and follows stress targets.
#[test]
fn a_strained_cell_is_the_same_on_any_number_of_ranks_and_over_restarts() {
    let cell = "[cell]\nxx = { stress = 2e4 }\nyy = { stress = 2e4 }\nzz = { stress = 2e4 }\nxy = { rate = -150.0 }\nxz = { stress = 0.0 }\n\
                yz = { rate = 70.0 }\nmax_rate = 50.0";
    // With the second seed balls approach each other against the flow, where a ghost hardly moves.
    for (shape, seed) in [(BALL, 1), (BALL, 8), (EGG, 1)] {
        let text = format!("seed = {seed}\n{}", crowd(cell, shape, ROUGH, 4, 3e-6));
        let scene = scene(&(text + "[neighbours]\nimbalance = 1.02\norder_every = 300\n"));
        let alone = OnRanks::of(&scene).the_same_on(2600, &[2, 3, 4], &[[3, 2], [1, 4]]);
        assert!(alone.number("contacts") > 50.0);
        let mut sim = begun(&scene, &mut Alone::default());
        for _ in 0..2600 {
            sim.step(&mut Alone::default()).unwrap();
        }
        let edges = sim.particles.cell.strained().unwrap().edges;
        assert!(edges.m12 / edges.m11 > 0.6 && edges.m23 / edges.m22 < -0.3, "{edges}");
    }
}

/// Text of a table of strain that rises to 0.02, goes back to 0, and stays.
const THERE_AND_BACK: &str = "time_s,strain\n0,0.5\n1e-3,0.52\n3e-3,0.5\n";

/// A cell whose length along x follows a table, and which is sheared to and fro.
fn cyclic(folder: &std::path::Path, rest: &str) -> Scene {
    let table = folder.join("strain.csv");
    std::fs::write(&table, THERE_AND_BACK).unwrap();
    let cell = format!(
        "[cell]\nxx = {{ table = \"{}\" }}\nconstant_volume = true\nxy = {{ amplitude = 0.01, frequency = 500, phase = 30 }}",
        table.display()
    );
    scene(&(crowd(&cell, BALL, ROUGH, 4, 3e-6) + rest))
}

/// Strains are those of the paths at every step, whatever the pressure; the volume stays.
#[test]
fn strains_follow_their_paths() {
    let folder = tempfile::tempdir().unwrap();
    let mut sim = begun(&cyclic(folder.path(), ""), &mut Alone::default());
    let volume = sim.particles.cell.volume();
    for step in 1..=1500 {
        sim.step(&mut Alone::default()).unwrap();
        let time = f64::from(step) * 3e-6;
        let strain = -sim.particles.cell.strained().unwrap().strain;
        let along = (time / 1e-3).min(1.5 - 0.5 * time / 1e-3).max(0.0) * 0.02;
        let angle = std::f64::consts::TAU * 500.0 * time + std::f64::consts::FRAC_PI_6;
        let across = 0.01 * (angle.sin() - 0.5);
        assert!((strain.m11 - along).abs() < 1e-12, "step {step}: {} for {along}", strain.m11);
        assert!((strain.m12 - across).abs() < 1e-12, "step {step}: {} for {across}", strain.m12);
        close(sim.particles.cell.volume(), volume, 1e-9, "volume");
    }
    let element = sim.drives.iter().find(|drive| drive.name() == "cell").unwrap();
    assert_eq!(element.standing().unfinished, None);
}

/// Identical bits on paths of strain, of which a restart takes up the middle.
#[test]
fn paths_of_strain_are_the_same_on_any_number_of_ranks_and_over_restarts() {
    for seed in [1, 2, 3] {
        let folder = tempfile::tempdir().unwrap();
        let rest = format!("[neighbours]\nimbalance = 1.02\norder_every = {}\n", 100 * seed);
        let scene = cyclic(folder.path(), &rest);
        OnRanks::of(&scene).the_same_on(1200, &[2, 3, 4], &[[3, 2], [1, 4]]);
    }
}

/// Images of a leaning cell follow its edges, and the nearest one is found for any choice of edges.
#[test]
fn images_of_a_leaning_cell_are_nearest() {
    let square = Cell::new(Vec3::new(-1.0, 0.5, 2.0), Vec3::new(3.0, 3.5, 7.0), [true; 3]);
    let mut cell = square.at_rest().expect("all axes repeat");
    let rate = Mat3::new(0.03, 0.9, -0.7, 0.0, -0.02, 0.5, 0.0, 0.0, 0.01);
    cell.set_rate(&rate);
    for step in 0..300 {
        let stretch = cell.carry(0.013, 1.0).expect("a flow");
        let (edges, sides) = (cell.edges(), cell.sides());
        assert!(edges.m12.abs() <= 0.5 * edges.m11 * (1.0 + 1e-12));
        assert!(cell.widths().min() > 2.0 && (stretch.rate - rate).norm() == 0.0);
        let Strained { edges: carried, .. } = *cell.strained().unwrap();
        assert!((edges.determinant() / carried.determinant() - 1.0).abs() < 1e-12);
        let turn = f64::from(step);
        let part = |by: f64| (turn * by).fract();
        let low = cell.corners().0;
        let place = low + Vec3::new(part(0.37), part(0.71), part(0.53)).component_mul(&sides);
        for shift in
            [Vec3::new(0.9, -0.4, 0.1), Vec3::new(-0.6, -0.7, 0.3), Vec3::new(0.2, 0.1, -0.9)]
        {
            let (mut other, mut velocity, mut image) = (place + shift, Vec3::zeros(), [0; 3]);
            let out = other;
            cell.wrap(&mut other, &mut velocity, &mut image);
            let inside = (other - low).component_div(&sides);
            assert!(inside.min() >= -1e-12 && inside.max() <= 1.0 + 1e-12, "{inside}");
            assert!((cell.nearest(other - place) - shift).norm() < 1e-12, "step {step}");
            assert!((cell.unwrapped(other, &image) - out).norm() < 1e-11, "step {step}");
            let images = cell.shifts().into_iter().map(|by| (other + by - place).norm());
            assert!((images.fold(f64::INFINITY, f64::min) - shift.norm()).abs() < 1e-12);
            let gap = cell.gap([&place, &place], [&other, &other]);
            assert!((gap - shift.norm()).abs() < 1e-12, "{gap}");
            let faster = cell.velocity_of_nearest(&(other - place)) - rate * shift;
            assert!(faster.norm() < 1e-12, "{faster}");
            let [one, two] = [place, other].map(|place| cell.in_upright(&place));
            let apart = cell.upright().unwrap().nearest(one - two).norm();
            assert!(apart <= cell.upright_over_distance() * shift.norm() * (1.0 + 1e-12));
        }
    }
}

#[test]
fn what_does_not_go_with_a_cell_is_refused() {
    let good = crowd(
        "[cell]\nxx = { rate = 0.1 }\nyy = { stress = 1e3 }\nmax_rate = 1.0",
        BALL,
        ROUGH,
        4,
        4e-6,
    );
    scene(&good);
    for (from, to, said) in [
        ("[true, true, true]", "[true, true, false]", "periodic along x, y and z"),
        (
            "periodic =",
            "shear = { along = \"x\", across = \"y\", rate = 1.0 }\nperiodic =",
            "without `shear`",
        ),
        ("[domain]", "gravity = [0, 0, -9.81]\n[domain]", "must be 0 with a [cell]"),
        ("max_rate = 1.0", "", "there is no `max_rate`"),
        (
            "max_rate = 1.0",
            "max_rate = 1.0\nisotropic = { stress = 1.0 }",
            "leave out `xx`, `yy` and `zz`",
        ),
        ("max_rate = 1.0", "max_rate = 1.0\nplane_strain = \"x\"", "leave out `xx`"),
        (
            "max_rate = 1.0",
            "max_rate = 1.0\nzz = { rate = 0 }\nconstant_volume = true",
            "needs a free component",
        ),
        ("{ rate = 0.1 }", "{ rate = 0.1, stress = 1.0 }", "one of `rate`, `stress`, `table`"),
        ("{ rate = 0.1 }", "{ rate = 1e3 }", "in a step"),
        (
            "yy = { stress = 1e3 }\nmax_rate = 1.0",
            "max_rate = 1.0",
            "has no effect without a `stress`",
        ),
        ("[time]", "[stop]\nservo = 0.1\n[time]", "there is no [[servo]]"),
        (
            "yy = { stress = 1e3 }\nmax_rate = 1.0",
            "yy = { rate = 100.0 }\n[stop]\ncell = 0.1",
            "no [cell] with a stress",
        ),
        (
            "[time]",
            "[[wall]]\nname = \"w\"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n[time]",
            "not with walls",
        ),
    ] {
        expect_refused(&good, from, to, said);
    }
    // Given rates fix the path in advance.
    let thin = crowd("[cell]\nzz = { rate = 100.0 }", BALL, ROUGH, 4, 4e-6) + "duration = 0.02\n";
    expect_refused(&thin, "[time]", "[time]", "with strains zz = ");
}

/// A cell that becomes too thin under a stress ends the run with an error that states width and strains. A stage without [cell] cannot
/// continue from a strained one.
#[test]
fn a_cell_that_becomes_too_thin_ends_the_run() {
    let cell = "[cell]\nzz = { stress = 1e9 }\nmax_rate = 100.0";
    let text = crowd(cell, "kind = \"sphere\"\nradius = 4e-4", ROUGH, 4, 1e-6)
        + "[neighbours]\nskin = 2e-3\n";
    let first = scene(&text);
    let mut sim = begun(&first, &mut Alone::default());
    let folder = tempfile::tempdir().unwrap();
    save(&sim, folder.path(), &first, &mut Alone::default());
    let plain = scene(&text.replace(cell, ""));
    let mut other = assemble::assemble(&plain, &Alone::default());
    let error = assemble::take_up(
        &mut other,
        &plain,
        folder.path(),
        Continuation::NewStage,
        &mut Alone::default(),
    );
    assert!(matches!(error, Err(StartError::Strained { .. })));
    let error = loop {
        if let Err(error) = sim.step(&mut Alone::default()) {
            break error.to_string();
        }
    };
    assert!(error.contains("m wide across z, at strains"), "{error}");
}
