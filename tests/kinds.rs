//! Grains of every kind in one packing, and the same bits on any number of ranks.

use crate::support::{MATERIAL, begun, motion, scene};
use dem_mpi::comm::{Comm, threads};
use dem_mpi::measure::Measures;
use dem_mpi::scene::Scene;

/// A bit of everything, thrown into a box.
const MIXTURE: &str = r#"
gravity = [1.0, 0.5, -9.81]
[domain]
low = [0.0, 0.0, 0.0]
high = [0.0186, 0.0186, 0.1]
walls = ["-x", "+x", "-y", "+y", "-z"]
MATERIAL
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.0011
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.0016, 0.0014, 0.0008]
[[shape]]
name = "rod"
kind = "spherocylinder"
length = 0.002
radius = 0.0007
[[shape]]
name = "die"
kind = "rounded-polyhedron"
radius = 0.0002
vertices = [
  [-0.0008, -0.0008, -0.0008], [0.0008, -0.0008, -0.0008],
  [-0.0008, 0.0008, -0.0008], [0.0008, 0.0008, -0.0008],
  [-0.0008, -0.0008, 0.0008], [0.0008, -0.0008, 0.0008],
  [-0.0008, 0.0008, 0.0008], [0.0008, 0.0008, 0.0008],
]
[[shape]]
name = "shard"
kind = "polyhedron"
vertices = [
  [0.0, 0.0, 0.0], [0.0025, 0.0, 0.0], [0.0, 0.0024, 0.0], [0.0004, 0.0006, 0.0022],
  [0.0016, 0.0016, 0.001],
]
[[fill.lattice]]
shapes = ["ball", "egg", "rod", "die", "shard"]
low = [0.0, 0.0, 0.0]
high = [0.0186, 0.0186, 0.026]
spacing = 0.0037
velocity = [0.3, -0.2, -2.0]
[time]
step = 7e-6
steps = 1000
[neighbours]
imbalance = 1.05
[output]
directory = "out"
"#;

fn mixture() -> String {
    // Shards have long levers: with less of dashpots a longer step is stable.
    MIXTURE.replace("MATERIAL", &MATERIAL.replace("restitution = 0.5", "restitution = 0.85"))
}

/// Positions, orientations, velocities, contacts: bit by bit, in the order of ids.
fn state(scene: &Scene, ranks: u32, steps: u64) -> (Vec<(u64, Vec<u64>)>, usize, Measures) {
    let parts = threads::run(ranks, |comm| {
        let mut sim = begun(scene, comm);
        for _ in 0..steps {
            sim.step(comm).unwrap();
        }
        let measures = sim.measure(comm);
        (sim.particle_table(comm.rank()), sim.contact_records(), measures)
    });
    let mut bits = Vec::new();
    let mut contacts = 0;
    for (table, records, measures) in &parts {
        assert_eq!(*measures, parts[0].2, "all ranks measure the same");
        contacts += records.len();
        bits.extend(motion(table));
    }
    bits.sort();
    (bits, contacts, parts[0].2.clone())
}

#[test]
fn a_packing_of_all_kinds_is_the_same_on_any_number_of_ranks() {
    let mixture = mixture();
    for method in ["auto", "epa"] {
        let steps = if method == "auto" { 3000 } else { 500 };
        let scene = scene(&format!("{mixture}[contact]\nmethod = \"{method}\"\n"));
        let (alone, contacts, _) = state(&scene, 1, steps);
        assert!(alone.len() >= 150 && contacts > 20, "{} with {contacts}", alone.len());
        for ranks in [2, 4] {
            let (shared, ..) = state(&scene, ranks, steps);
            let differing: Vec<u64> =
                alone.iter().zip(&shared).filter(|(a, b)| a != b).map(|(a, _)| a.0).collect();
            assert!(differing.is_empty(), "{method}, {ranks} ranks: {differing:?} differ");
        }
    }
}

/// With dashpots, friction and nothing to keep it going, the packing comes to rest: no kind of contact
/// feeds energy in.
#[test]
fn a_packing_of_all_kinds_comes_to_rest() {
    let mut scene = scene(&mixture());
    scene.global_damping = 20.0;
    let (_, _, early) = state(&scene, 2, 100);
    let (_, contacts, end) = state(&scene, 2, 8000);
    assert!(contacts > 150, "a packing, not a gas: {contacts} contacts");
    let missing = end.missing() / end.dissipated;
    println!("missing {missing:e}");
    assert!(missing.abs() < 1e-2, "{missing} of what was dissipated is missing");
    let (early, late) = (early.kinetic(), end.kinetic());
    assert!(late < 2e-3 * early, "{early:e} J, then {late:e} J");
}
