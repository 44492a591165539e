//! Particles of every kind in one packing, with identical bits on any number of ranks.

use crate::support::{MATERIAL, OnRanks, scene};

/// All kinds of particles, thrown into a box.
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
"#;

fn mixture() -> String {
    // Shards have long lever arms, and weaker dashpots make a longer step stable.
    MIXTURE.replace("MATERIAL", &MATERIAL.replace("restitution = 0.5", "restitution = 0.85"))
}

#[test]
fn a_packing_of_all_kinds_is_the_same_on_any_number_of_ranks() {
    let mixture = mixture();
    for method in ["auto", "epa"] {
        let steps = if method == "auto" { 3000 } else { 500 };
        let scene = scene(&format!("{mixture}[contact]\nmethod = \"{method}\"\n"));
        let alone = OnRanks::of(&scene).the_same_on(steps, &[2, 4], &[]);
        let (grains, contacts) = (alone.bits.len(), alone.records.len());
        assert!(grains >= 150 && contacts > 20, "{method}: {grains} with {contacts}");
    }
}

/// With dashpots, friction and no drive, the packing comes to rest: no kind of contact creates energy.
#[test]
fn a_packing_of_all_kinds_comes_to_rest() {
    let mut scene = scene(&mixture());
    scene.global_damping = 20.0;
    let [early, end] = [100, 8000].map(|steps| OnRanks::of(&scene).run(2, steps));
    let contacts = end.records.len();
    assert!(contacts > 150, "a packing, not a gas: {contacts} contacts");
    let missing = end.number("missing") / end.number("dissipated");
    println!("missing {missing:e}");
    assert!(missing.abs() < 1e-2, "{missing} of the dissipated energy is missing");
    let [early, late] = [early, end].map(|state| state.number("kinetic"));
    assert!(late < 2e-3 * early, "{early:e} J, then {late:e} J");
}
