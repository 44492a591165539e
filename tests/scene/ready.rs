//! The ready scenes with surfaces at a reduced size. Bits are identical on any number of ranks and across a restart while
//! particles touch the surfaces and each other.

use crate::support::{OnRanks, State};
use dem_mpi::scene::Scene;
use std::path::Path;

/// Final state of a scene of `run` with these keys changed, after a number of steps.
fn small(name: &str, keys: &[&str], steps: u64) -> State {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("run").join(name).join("scene.toml");
    let keys: Vec<String> = keys.iter().map(|&key| key.to_owned()).collect();
    let scene = Scene::read(&path, &keys).unwrap_or_else(|errors| panic!("{errors}"));
    let folder = tempfile::tempdir().unwrap();
    let state = OnRanks::of(&scene).the_same_everywhere(steps, folder.path());
    let [all, on_walls] = ["contacts", "wall_contacts"].map(|name| state.number(name));
    println!("{name}: {} grains, {all} contacts and {on_walls} with walls", state.bits.len());
    let [missing, dissipated] = ["missing", "dissipated"].map(|name| state.number(name));
    println!("{missing:e} J of {dissipated:e} J is missing");
    assert!(on_walls > 5.0 && all > 40.0, "{name}: {all}, {on_walls}");
    state
}

#[test]
fn the_silo_has_the_same_bits_everywhere() {
    let keys = [
        "inlet.above.axis=[[0, 0, 0.012], [0, 0, 0.05]]",
        "inlet.above.radius=0.018",
        "inlet.above.rate=200_000",
        "inlet.above.count=600",
        "inlet.above.velocity=[0, 0, -0.8]",
        "outlet.below.point=[0, 0, -0.003]",
    ];
    let state = small("silo", &keys, 7000);
    let [came, left] = ["entered_above", "left_below"].map(|name| state.number(name));
    assert!(came == 600.0 && left > 5.0, "{came} came, {left} left");
}

#[test]
fn the_drum_has_the_same_bits_everywhere() {
    let keys = [
        "fill.lattice.0.high=[0, 0.01, -0.012]",
        "fill.lattice.1.high=[0.029, 0.01, -0.012]",
        "wall.drum.rotation.rate=20",
    ];
    small("drum", &keys, 4500);
}

#[test]
fn the_hopper_has_the_same_bits_everywhere() {
    let keys = ["fill.lattice.0.high=[0.03, 0.03, 0.064]", "fill.lattice.0.velocity=[0, 0, -2]"];
    small("hopper", &keys, 3500);
}
