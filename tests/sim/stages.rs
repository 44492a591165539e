//! State that a stage takes from a snapshot, and snapshots that it rejects.

use crate::support::{MATERIAL, begun, save, scene};
use dem_mpi::comm::alone::Alone;
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble::{self, Continuation, RestartInfo};
use dem_mpi::sim::Simulation;
use std::path::Path;

/// Balls that fall on a floor, with these parts of the scene.
fn text(head: &str, law: &str, shapes: &str, fill: &str) -> String {
    format!(
        "{head}\ngravity = [0, 0, -9.81]\n[domain]\nlow = [0, 0, 0]\nhigh = [0.04, 0.04, 0.04]\nwalls = [\"-z\"]\n{law}\n{shapes}\n{fill}\n\
         [time]\nstep = 1e-5\n"
    )
}

const BALL: &str = "[[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.002\n";
const SPACER: &str = "[[shape]]\nname = \"spacer\"\nkind = \"sphere\"\nradius = 0.001\n";
const FILL: &str = "[[fill.lattice]]\nshapes = [\"ball\"]\nfirst = [0.01, 0.01, 0.0019999]\nspacing = 0.01\ncount = [2, 2, 1]\nvelocity = [0.1, 0, 0]\n";

fn taken(
    scene: &Scene,
    folder: &Path,
    how: Continuation,
) -> (Simulation, Result<RestartInfo, String>) {
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(scene, &comm);
    let taken = assemble::take_up(&mut sim, scene, folder, how, &mut comm);
    (sim, taken.map_err(|error| error.to_string()))
}

/// Writes a snapshot after a number of steps.
fn saved(scene: &Scene, steps: u32, folder: &Path) {
    let mut comm = Alone::default();
    let mut sim = begun(scene, &mut comm);
    (0..steps).for_each(|_| sim.step(&mut comm).unwrap());
    save(&sim, folder, scene, &mut comm);
}

/// A job that is queued again may find the previous stage in a shared folder: it is not this stage.
#[test]
fn the_stage_before_is_not_this_one() {
    let folder = tempfile::tempdir().unwrap();
    let before = scene(&text("", MATERIAL, BALL, FILL));
    saved(&before, 10, folder.path());
    let start = format!("start = {:?}", folder.path());
    let next = scene(&text(&start, MATERIAL, BALL, ""));
    let refused = taken(&next, folder.path(), Continuation::SameStage).1.unwrap_err();
    assert!(
        refused.contains("it belongs to another stage: its scene's `start` is none"),
        "{refused}"
    );
    let (mut sim, found) = taken(&next, folder.path(), Continuation::NewStage);
    found.unwrap();
    // After its start the stage's own snapshots can be continued.
    sim.begin(&mut Alone::default()).unwrap();
    save(&sim, folder.path(), &next, &mut Alone::default());
    taken(&next, folder.path(), Continuation::SameStage).1.unwrap();
    let refused = taken(&before, folder.path(), Continuation::SameStage).1.unwrap_err();
    assert!(refused.contains("it belongs to another stage"), "{refused}");
}

/// A shape without remaining particles may be missing from the scene.
#[test]
fn a_shape_that_nobody_has_may_be_gone() {
    let folder = tempfile::tempdir().unwrap();
    let both = format!("{BALL}{SPACER}");
    let next = scene(&text("", MATERIAL, BALL, FILL));
    for (fill, is_there) in
        [(FILL.to_owned(), false), (FILL.replace("\"ball\"", "\"ball\", \"spacer\""), true)]
    {
        saved(&scene(&text("", MATERIAL, &both, &fill)), 5, folder.path());
        let found = taken(&next, folder.path(), Continuation::NewStage).1;
        let refused = found.as_ref().err().is_some_and(|e| e.contains("no shape \"spacer\""));
        assert_eq!(refused, is_there, "{found:?}");
    }
}

/// Contact memory of one law that the next stage's law cannot use is reported.
#[test]
fn what_another_law_forgets_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let linear =
        "[[material]]\nname = \"m\"\ndensity = 2500\nnormal_stiffness = 1e4\nfriction = 0.4\n";
    let hertz = "[law]\nnormal = \"hertz\"\n[[material]]\nname = \"m\"\ndensity = 2500\nyoungs_modulus = 1e7\npoisson_ratio = 0.3\nfriction = 0.4\n";
    saved(&scene(&text("", linear, BALL, FILL)), 20, folder.path());
    let told = |law: &str| {
        let next = scene(&text("", law, BALL, FILL).replace("step = 1e-5", "step = 5e-6"));
        taken(&next, folder.path(), Continuation::NewStage).1.unwrap().forgotten
    };
    assert_eq!(told(linear), Vec::<String>::new());
    assert_eq!(told(hertz), ["spring"]);
}

/// A new stage moves the origin of a sheared box, which shifts particles through the sliding face. They get the velocity
/// there, once.
#[test]
fn a_sheared_box_that_begins_elsewhere_has_a_closed_balance() {
    let folder = tempfile::tempdir().unwrap();
    let sheared = |low: f64| {
        let fill = "[[fill.lattice]]\nshapes = [\"ball\"]\nfirst = [0.005, 0.0, 0.005]\nspacing = 0.01\ncount = [4, 4, 4]\n";
        let fill = fill.replace("0.005, 0.0,", &format!("0.005, {},", low + 0.005));
        scene(
            &text("", MATERIAL, BALL, &fill)
                .replace("gravity = [0, 0, -9.81]\n", "")
                .replace("low = [0, 0, 0]\nhigh = [0.04, 0.04, 0.04]\nwalls = [\"-z\"]", &format!(
                    "low = [0, {low:?}, 0]\nhigh = [0.04, {:?}, 0.04]\nperiodic = [true, true, true]\nshear = {{ along = \"x\", across = \"y\", rate = 20 }}",
                    low + 0.04
                )),
        )
    };
    saved(&sheared(0.0), 50, folder.path());
    let (mut sim, found) = taken(&sheared(-0.01), folder.path(), Continuation::NewStage);
    found.unwrap();
    sim.begin(&mut Alone::default()).unwrap();
    let measures = sim.measure(&mut Alone::default());
    assert!(measures.kinetic() > 0.0, "the cell flows");
    assert!(
        measures.missing().abs() < 1e-12 * measures.kinetic(),
        "{:e} of {:e} J",
        measures.missing(),
        measures.kinetic()
    );
}
