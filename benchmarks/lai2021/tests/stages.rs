//! The stages of section 3, run as by a user.

use crate::machine::Machine;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const WORDS: [&str; 8] =
    ["--quick", "--gravity", "--seed", "7", "--stiffness", "1.5e4", "--method", "gjk-gjk-erosion"];

#[test]
fn stages_are_run_once_one_from_the_other() {
    let machine = Machine::new("");
    let (status, said) = machine.run("triaxial", &WORDS);
    assert_eq!(status, Some(0), "{said}");
    let stiffness = "--set material.grain.normal_stiffness=1.5e4 --set material.grain.tangential_stiffness=1.5e4 \
                     --set material.wall.normal_stiffness=1.5e4 --set material.wall.tangential_stiffness=1.5e4";
    let gravity = "--set gravity=[0.0, 0.0, -9.81]";
    let method = "--set contact.method=gjk-erosion --set contact.spurious=false";
    let folder = "HERE/out/gjk-gjk-erosion";
    let packing = format!(
        "--set fill.rain.count=600 --set domain.high=[0.02, 0.02, 0.09] --set fill.rain.low=[0.0, 0.0, 0.07] \
         --set fill.rain.high=[0.02, 0.02, 0.09] --set seed=7 {stiffness}"
    );
    let shear = format!(
        "--set domain.high=[0.02, 0.02, 0.038] --set domain.wall_velocity={{ \"+z\" = [0.0, 0.0, -0.005] }} \
         --set time.steps=216000 --set output.snapshot_every=2057 --set output.history_every=200 {stiffness} {gravity}"
    );
    let expected = [
        format!(
            "-n 2 run/paper/triaxial/packing.toml {method} --set time.steps=150_000 --out {folder}/packing {packing}"
        ),
        format!(
            "-n 2 run/paper/triaxial/consolidation.toml {method} --set time.steps=75_000 --out {folder}/consolidation \
             --set domain.high=[0.02, 0.02, 0.038] {stiffness} {gravity} --set start={folder}/packing"
        ),
        format!(
            "-n 2 run/paper/triaxial/shear.toml {method} --out {folder}/shear {shear} --set start={folder}/consolidation"
        ),
    ];
    assert_eq!(machine.calls(), expected);
    let here = "out/gjk-gjk-erosion/shear";
    assert_eq!(machine.text(&format!("{here}/words")), format!("{shear}\n{method}\n"));
    assert_eq!(machine.text(&format!("{here}/run.log")), "said\n");
    let record = machine.text("out/report/machine.txt");
    let command = "command  run/paper/triaxial/run --quick --rate 5 --gravity --seed 7 --stiffness 1.5e4 \
                   --method gjk-gjk-erosion --ranks 2\n";
    assert!(record.starts_with(command), "{record}");
    assert!(machine.text("out/report/report.md").starts_with("# Section 3 of Lai et al. (2021)"));

    // A finished stage is not run again; an interrupted one continues from its snapshots.
    assert_eq!(machine.run("triaxial", &WORDS).0, Some(0));
    assert_eq!(machine.calls().len(), 3);
    fs::remove_file(machine.path(&format!("{here}/done"))).unwrap();
    assert_eq!(machine.run("triaxial", &WORDS).0, Some(0));
    assert_eq!(machine.calls()[3], format!("{} --start {folder}/shear", expected[2]));
    assert_eq!(machine.text(&format!("{here}/run.log")), "said\nsaid\n");

    // Other arguments need another folder, for any method.
    for words in [&WORDS[..4], &["--quick"]] {
        let (status, said) = machine.run("triaxial", words);
        assert_eq!(status, Some(2), "{said}");
        assert!(said.contains("is of a run with other words"), "{said}");
    }
    assert_eq!(machine.calls().len(), 4);
}

#[test]
fn other_packings_are_of_the_seeds_after_the_first() {
    let machine = Machine::new("");
    let words = ["--quick", "--seed", "4", "--packings", "3"];
    let (status, said) = machine.run("triaxial", &words);
    assert_eq!(status, Some(0), "{said}");
    let calls = machine.calls();
    assert_eq!(calls.len(), 5);
    for (call, number) in [(0, 4), (3, 5), (4, 6)] {
        let call = &calls[call];
        assert!(call.starts_with("-n 2 run/paper/triaxial/packing.toml"), "{call}");
        assert!(call.ends_with(&format!(" --set seed={number}")), "{call}");
    }
    assert!(calls[4].contains("common-normal/packing-3 "), "{}", calls[4]);
    assert!(machine.text("out/report/machine.txt").contains(" --seed 4 --packings 3 "));
    // A smaller number of packings is a subset of them.
    assert_eq!(machine.run("triaxial", &words[..3]).0, Some(0));
    assert_eq!(machine.calls().len(), 5);
}

#[test]
fn a_run_that_fails_ends_the_stages() {
    let machine = Machine::new("exit 9");
    let (status, said) = machine.run("triaxial", &["--quick"]);
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("packing has not ended well") && said.contains("run.log"), "{said}");
    assert_eq!(machine.calls().len(), 1);
    assert!(!machine.path("out/common-normal/packing/done").exists());
    for words in [["--rate", "0"], ["--erosion-ratio", "2"], ["--method", "gjk"]] {
        assert_eq!(machine.run("triaxial", &words).0, Some(2), "{words:?}");
    }
}

#[test]
fn a_signal_reaches_the_run_and_ends_the_stages() {
    let machine = Machine::new("trap 'echo snapshot; exit 3' TERM; while :; do sleep 0.05; done");
    let mut child =
        machine.command("triaxial", &["--quick"]).stdout(Stdio::null()).spawn().unwrap();
    let log = machine.path("out/common-normal/packing/run.log");
    let begun = Instant::now();
    let is_waiting = |log: &Path| fs::read_to_string(log).is_ok_and(|text| text.contains("said"));
    while !is_waiting(&log) && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(20));
    }
    // The trap is set right after the output.
    std::thread::sleep(Duration::from_millis(200));
    let told = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(told.success());
    assert_eq!(child.wait().unwrap().code(), Some(143));
    assert_eq!(fs::read_to_string(&log).unwrap(), "said\nsnapshot\n");
    assert!(!machine.path("out/common-normal/packing/done").exists());
}
