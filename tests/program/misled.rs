//! Wrong input ends soon, in one clear message and an exit status that names the kind of fault.

use super::process::{Launch, dem_mpi};
use super::{HEAP_SNAPSHOTS, fresh_directory, heap, scene, snapshot};
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Exit status for wrong input.
const WRONG_INPUT: i32 = 2;
/// Exit status of a failed run.
const FAILED: i32 = 1;

/// Time limit of an error message. It takes half a second on idle cores, and has taken 12 s beside four other programs.
const SECONDS: Duration = Duration::from_secs(60);

struct Mistake<'a> {
    scene: &'a Path,
    arguments: &'a [&'a str],
    status: i32,
    /// Expected parts of the message: place, fault and advice.
    message: &'a [&'a str],
}

#[test]
fn a_mistake_ends_in_one_message() {
    let good = heap(Launch::Alone);
    let directory = fresh_directory("misled");
    let named = |name: &str| directory.join(name);
    let heap_scene = Path::new(&scene("heap")).to_owned();

    let text = fs::read_to_string(&heap_scene).unwrap();
    let misspelt = named("misspelt.toml");
    fs::write(&misspelt, text.replace("friction =", "frictoin =")).unwrap();

    // Half of a snapshot, like after a full disk or a broken copy.
    let whole = fs::read(snapshot(&good.directory, HEAP_SNAPSHOTS[1])).unwrap();
    let half = named("half.vtkhdf");
    fs::write(&half, &whole[..whole.len() / 2]).unwrap();

    let contacts = format!("contacts_{:09}.vtkhdf", HEAP_SNAPSHOTS[1]);
    let contacts = good.directory.join(contacts);

    // One particle on each of two ranks leaves in one step.
    let burst = Path::new(&scene("burst")).to_owned();

    let coincident = scene("coincident");
    let contacts_file = contacts.to_str().unwrap();
    let (half, misspelt_name) = (half.to_str().unwrap(), misspelt.to_str().unwrap());
    let below_a_file = format!("{misspelt_name}/out");
    let missing = named("missing.toml");
    let mistakes = [
        Mistake {
            scene: &misspelt,
            arguments: &[],
            status: WRONG_INPUT,
            message: &["misspelt.toml:16: material.stone.frictoin", "did you mean `friction`?"],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &["--set", "shape.ball.radius=-0.002"],
            status: WRONG_INPUT,
            message: &["shape.ball.radius = -0.002: must be a number greater than 0 [m]"],
        },
        Mistake {
            scene: &missing,
            arguments: &[],
            status: WRONG_INPUT,
            message: &["missing.toml: cannot be read: No such file or directory"],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &["--start", "nowhere.vtkhdf"],
            status: WRONG_INPUT,
            message: &["no snapshot at nowhere.vtkhdf", "Give a file particles_<step>"],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &["--strat", "nowhere.vtkhdf"],
            status: WRONG_INPUT,
            message: &["unexpected argument '--strat'", "'--start'"],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &["--set", "fill.lattice.0.spacing=0.0038"],
            status: WRONG_INPUT,
            message: &["pairs overlap by more than 5 %", "larger spacing"],
        },
        // Pairs that no method can resolve are listed with excessive overlaps.
        Mistake {
            scene: Path::new(&coincident),
            arguments: &[],
            status: WRONG_INPUT,
            message: &[
                "8 pairs overlap by more than 5 %",
                "particle 0 and particle 1: too deep for any contact method, at (5.0000e-3, 5.0000e-3, 5.0000e-3) m",
                "Move them apart",
            ],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &["--set", "time.step=1e-3"],
            status: WRONG_INPUT,
            message: &["time.step = 0.001: over the stable limit of 4.81e-5 s", "`egg`"],
        },
        // The largest number of particles of a scene.
        Mistake {
            scene: &heap_scene,
            arguments: &[
                "--set",
                "domain.high=[60,60,60]",
                "--set",
                "fill.lattice.0.count=[10_000,10_000,10_000]",
            ],
            status: WRONG_INPUT,
            message: &[
                "fill: 1000000000000 particles need at least",
                "use fewer particles, a wider `spacing`",
            ],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &["--start", half],
            status: WRONG_INPUT,
            message: &["half.vtkhdf cannot be read as a snapshot", "use an earlier snapshot"],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &[
                "--start",
                good.directory.to_str().unwrap(),
                "--set",
                "shape.ball.radius=0.0019",
            ],
            status: WRONG_INPUT,
            message: &["the scene has no shape \"ball\" of this form and size"],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &["--out", &below_a_file],
            status: WRONG_INPUT,
            message: &["misspelt.toml/out", "Not a directory"],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &["--out", misspelt_name],
            status: WRONG_INPUT,
            message: &["misspelt.toml is a file, but a run writes into a folder", "another --out"],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &["--steps", "1.5e0"],
            status: WRONG_INPUT,
            message: &["--steps", "must be a whole number, such as 20000, 20_000 or 2e4"],
        },
        Mistake {
            scene: &heap_scene,
            arguments: &["--start", contacts_file],
            status: WRONG_INPUT,
            message: &["name particles_<step>.vtkhdf, not the contacts file"],
        },
        // There is no wall in the direction of gravity.
        Mistake {
            scene: &heap_scene,
            arguments: &["--set", "domain.walls=['-x', '-y', '-z']"],
            status: FAILED,
            message: &[
                "has left the domain",
                "Put a wall on that side",
                "m/s, force of its contacts",
            ],
        },
        Mistake {
            scene: &burst,
            arguments: &[],
            status: FAILED,
            message: &["has left the domain", "particle 0: position (", "its last contacts: none"],
        },
    ];
    for mistake in &mistakes {
        for launch in [Launch::Alone, Launch::Ranks(2)] {
            check(mistake, launch, &named("out"));
        }
    }
}

fn check(mistake: &Mistake, launch: Launch, out: &Path) {
    let mut arguments = vec![mistake.scene.to_str().unwrap()];
    arguments.extend(mistake.arguments);
    if !arguments.contains(&"--out") {
        arguments.extend(["--out", out.to_str().unwrap(), "--overwrite"]);
    }
    let ended = dem_mpi(launch, arguments).end();
    assert_eq!(ended.status.code(), Some(mistake.status), "{ended}");
    assert!(ended.took < SECONDS, "{ended}");
    assert_eq!(ended.output, "", "{ended}");
    for text in mistake.message {
        ended.said_once(text);
    }
    for text in ["panicked", "RUST_BACKTRACE", "met a bug", "HDF5-DIAG"] {
        assert!(!ended.said().contains(text), "{text}: {ended}");
    }
}
