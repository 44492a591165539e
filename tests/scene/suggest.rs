//! `--suggest`: its proposals against closed forms.

use dem_mpi::scene::suggest::{FIRST, Question, TrialError, Trials, Variant, suggest};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicUsize;

/// Radius [m], density [kg/m³], stiffness [N/m] and gravity [m/s²].
const RADIUS: f64 = 1e-3;
const DENSITY: f64 = 2500.0;
const STIFFNESS: f64 = 1e4;
const GRAVITY: f64 = 9.81;

/// Three balls that just touch the floor oscillate on it without loss, for three periods of the softest.
fn swinging() -> String {
    format!(
        r#"
title = "Balls swing on a floor"
gravity = [0.0, 0.0, -{GRAVITY}]
[domain]
low = [0.0, 0.0, 0.0]
high = [0.02, 0.02, 0.01]
walls = ["-z"]
[[material]]
name = "grain"
density = {DENSITY}
normal_stiffness = {STIFFNESS}
[[shape]]
name = "ball"
kind = "sphere"
radius = {RADIUS}
[[fill.lattice]]
first = [5e-3, 5e-3, {RADIUS}]
spacing = 4e-3
count = [3, 1, 1]
[time]
step = 1e-6
steps = {}
[output]
directory = "out"
history_every = 10
"#,
        (2.4 * std::f64::consts::TAU / frequency() / 1e-6).round()
    )
}

/// Angular frequency of a ball on the spring of its contact with the floor [rad/s].
fn frequency() -> f64 {
    let mass = 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3) * DENSITY;
    (STIFFNESS / mass).sqrt()
}

/// Writes a scene's file into a temporary folder.
fn file(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn asked<'a>(scene: &'a Path, error: f64, signal: &'a AtomicUsize) -> Question<'a> {
    Question { scene, overrides: &[], start: None, error, signal }
}

/// Mean of stress times volume of three balls over the sampled steps of a trial [J]. A ball released at touch has the overlap
/// `(1 - cos ωt) mg/k`.
fn exact(trials: &Trials, steps: u64, dt: f64) -> f64 {
    let mass = STIFFNESS / frequency().powi(2);
    let moments = (1..=steps).filter(|&k| k > steps - steps / 5);
    let force = |k: u64| mass * GRAVITY * (1.0 - (frequency() * k as f64 * dt).cos());
    let mean = moments.clone().map(force).sum::<f64>() / moments.count() as f64;
    assert!((trials.time() / (steps as f64 * dt) - 1.0).abs() < 1e-12);
    3.0 * mean * RADIUS / 3.0
}

#[test]
fn a_proposed_step_keeps_its_error_against_a_closed_form() {
    let ((_folder, file), signal) = (file(&swinging()), AtomicUsize::new(0));
    for error in [0.05, 0.01, 1e-3] {
        let question = asked(&file, error, &signal);
        let trials = Trials::new(&question).unwrap();
        let coarsest = trials.run(&Variant::of(0)).unwrap();
        let exact = exact(&trials, coarsest.steps, coarsest.dt);
        let found = suggest(&question, &mut |_| ()).unwrap();
        assert!(found.is_kept, "{}", found.text);
        let off = (found.run.stress / exact - 1.0).abs();
        // The branch ends at the contact point, within the overlap.
        let branch = 1e-4;
        assert!(off <= found.expected.stress + branch, "{off:e}: {}", found.text);
        assert!(off <= error, "{off:e} of {error}: {}", found.text);
        // The longest step would meet 5 % but not a tenth of a percent.
        let of_coarsest = (coarsest.stress / exact - 1.0).abs();
        assert!((1e-3..0.05).contains(&of_coarsest), "{of_coarsest:e}");
        assert_eq!(found.run.dt == coarsest.dt, 4.0 * of_coarsest < error, "{}", found.text);
    }
}

/// Central differences are of second order, and so are the differences that the estimate uses.
#[test]
fn answers_converge_with_the_square_of_the_step() {
    let ((_folder, file), signal) = (file(&swinging()), AtomicUsize::new(0));
    let question = asked(&file, 0.01, &signal);
    let trials = Trials::new(&question).unwrap();
    let stress: Vec<f64> = (0..5).map(|k| trials.run(&Variant::of(k)).unwrap().stress).collect();
    for three in stress.windows(3) {
        let ratio = (three[0] - three[1]) / (three[1] - three[2]);
        assert!((3.6..4.4).contains(&ratio), "{ratio}: {stress:?}");
    }
    assert!(trials.limit() * FIRST >= trials.run(&Variant::of(0)).unwrap().dt);
}

/// A repeated question has the same answer, except for the time of the trials.
#[test]
fn a_proposal_is_the_same_again() {
    let ((_folder, file), signal) = (file(&swinging()), AtomicUsize::new(0));
    let question = asked(&file, 0.01, &signal);
    let [one, two] = [0, 1].map(|_| suggest(&question, &mut |_| ()).unwrap());
    assert_eq!((one.run.dt, one.expected, one.floor), (two.run.dt, two.expected, two.floor));
    assert_eq!(one.run.stress.to_bits(), two.run.stress.to_bits());
    assert_eq!(one.contact, two.contact);
}

#[test]
fn where_nothing_touches_there_is_nothing_to_compare() {
    let apart = swinging().replace("walls = [\"-z\"]\n", "").replace("-9.81", "0.0");
    let ((_folder, file), signal) = (file(&apart), AtomicUsize::new(0));
    match suggest(&asked(&file, 0.01, &signal), &mut |_| ()) {
        Err(TrialError::Input(why)) => {
            assert!(why.contains("no particle has a contact") && why.contains("--start"), "{why}");
        }
        other => panic!("{other:?}"),
    }
}

/// Ctrl-C ends it between steps.
#[test]
fn a_signal_ends_the_trials() {
    let ((_folder, file), signal) = (file(&swinging()), AtomicUsize::new(15));
    let found = suggest(&asked(&file, 0.01, &signal), &mut |_| ());
    assert_eq!(found, Err(TrialError::Signal(15)));
}
