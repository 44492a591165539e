//! `report.json`: its keys and the consistency of its figures, and the lines in the terminal.

use super::process::{Call, Launch, dem_mpi};
use super::{
    HEAP_STEPS, assert_same_result, column, fresh_directory, heap, report, scene, written,
};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// Keys of each table of the file. They are documented in `output::report` and read by programs, so a change must not go unnoticed.
const KEYS: [(&str, &str); 13] = [
    (
        "",
        "audit commit contacts counted energy memory method packing phases program ranks resolution run sizes targets title warnings",
    ),
    (
        "/run",
        "ended last_step ns_per_particle_step particle_steps particle_steps_per_s particles ranks snapshot steps steps_per_s \
         time_s unmet wall_s",
    ),
    ("/phases", "agree audit contacts exchange forces move output rebuild"),
    (
        "/phases/contacts",
        "fastest_rank_s least ns_per_contact ns_per_listed_pair ns_per_particle_step share slowest_rank_s total_s us_per_step",
    ),
    (
        "/phases/move/least",
        "bytes_per_ns bytes_per_particle_step operations_per_ns operations_per_particle_step",
    ),
    ("/contacts", "contacts contacts_per_s fallback_share fallbacks listed_pairs resolved_pairs"),
    ("/audit", "audits contacts every of_kinds seed without_unions"),
    (
        "/audit/of_kinds/0",
        "against contacts force kinds mean_force_n method normal_rad overlap point relative_overlap spurious unresolved",
    ),
    ("/audit/of_kinds/0/force", "max median p99"),
    (
        "/energy",
        "dissipated_by dissipated_j gravity_j kinetic_j largest_moved_j missing_j missing_over_dissipated missing_over_moved received_j \
         step_j stored_j",
    ),
    ("/packing", "contacts coordination mean_normal_force_n unbalanced wall_contacts"),
    (
        "/resolution",
        "dt_limit_s dt_s largest_move_over_radius largest_overlap_over_radius largest_turn_rad steps_per_oscillation",
    ),
    (
        "/ranks",
        "bytes_per_ghost bytes_per_step ghosts_per_owned imbalance messages_per_step migrated rebuilds recuts \
         within_halo_per_owned without_core_s",
    ),
];

fn number(report: &Value, place: &str) -> f64 {
    let value = report.pointer(place).unwrap_or_else(|| panic!("no {place}: {report:#}"));
    value.as_f64().unwrap_or_else(|| panic!("{place} is {value}"))
}

#[test]
fn figures_hold_together() {
    for launch in [Launch::Alone, Launch::Ranks(3)] {
        let run = heap(launch);
        let report = report(&run.directory);
        for (place, keys) in KEYS {
            let table = report.pointer(place).and_then(Value::as_object);
            let table = table.unwrap_or_else(|| panic!("no table {place}: {report:#}"));
            let found: BTreeSet<&str> = table.keys().map(String::as_str).collect();
            assert_eq!(found, keys.split(' ').collect(), "{place}");
        }
        let number = |place: &str| number(&report, place);
        assert_eq!(report["run"]["ended"], "all_steps_done");
        assert_eq!(number("/run/steps"), HEAP_STEPS as f64);
        let ranks = if launch == Launch::Alone { 1.0 } else { 3.0 };
        assert_eq!(number("/run/ranks"), ranks);
        let particles = column(&run.directory, "particles")[&HEAP_STEPS];
        assert_eq!(number("/run/particles"), particles);
        let phases = report["phases"].as_object().unwrap().values();
        let sum = |key: &str| phases.clone().map(|of| of[key].as_f64().unwrap()).sum::<f64>();
        assert!((sum("share") - 1.0).abs() < 1e-12);
        let per = |key: &str, whole: f64| {
            for (name, of) in report["phases"].as_object().unwrap() {
                let expected = of["total_s"].as_f64().unwrap() / whole;
                let found = of[key].as_f64().unwrap();
                assert!((found - expected).abs() <= 1e-9 * expected, "{name}: {found} {key}");
            }
        };
        per("ns_per_contact", 1e-9 * number("/contacts/contacts"));
        per("ns_per_listed_pair", 1e-9 * number("/contacts/listed_pairs"));
        per("ns_per_particle_step", 1e-9 * number("/run/particle_steps"));
        per("us_per_step", 1e-6 * ranks * HEAP_STEPS as f64);
        assert!(number("/contacts/contacts") < 0.9 * number("/contacts/listed_pairs"));
        // The first snapshot belongs to a phase, too.
        let spent = sum("total_s") / (ranks * number("/run/wall_s"));
        assert!((0.95..=1.001).contains(&spent), "{spent}: {report:#}");
        let energy = |key: &str| number(&format!("/energy/{key}"));
        let parts = ["kinetic_j", "gravity_j", "stored_j", "step_j", "dissipated_j", "missing_j"];
        let whole: f64 = parts.map(energy).iter().sum();
        assert!((whole - energy("received_j")).abs() < 1e-10 * energy("dissipated_j"), "{whole}");
        let dissipated = column(&run.directory, "dissipated_J")[&HEAP_STEPS];
        assert_eq!(energy("dissipated_j"), dissipated);
        // A ball of stone on another, 1000 N/m: 2 pi sqrt(m / 2 k).
        let mass = 2500.0 * 4.0 / 3.0 * std::f64::consts::PI * 0.002_f64.powi(3);
        let egg = mass * (2.5 * 2.0 * 1.5) / 8.0;
        let period = std::f64::consts::TAU * (egg / 2.0 / 1e3).sqrt();
        let steps = number("/resolution/steps_per_oscillation");
        assert!((steps / (period / 1e-5) - 1.0).abs() < 1e-9, "{steps}, {}", period / 1e-5);
        let overlap = number("/resolution/largest_overlap_over_radius");
        assert!(overlap > 1e-3 && overlap < 0.5, "{overlap}");
        let motion = number("/resolution/largest_move_over_radius");
        // Lattice and rain begin at 0.6 to 1 m/s, and the fastest particle exceeds that.
        assert!((1e-5 / 0.0015..1e-4 / 0.0015).contains(&motion), "{motion}");
        assert!(number("/resolution/largest_turn_rad") > 0.0);
    }
}

#[test]
fn a_person_gets_four_lines_and_more_when_asked() {
    let directory = fresh_directory("lines");
    let out = directory.to_str().unwrap();
    let call = |more: &[&str]| {
        let set = ["--set", "time.steps=50"];
        let arguments = [&[&*scene("heap"), "--out", out, "--overwrite"], &set[..], more];
        dem_mpi(Launch::Ranks(2), arguments.concat()).succeed()
    };
    let lines = |text: &str| -> Vec<String> {
        let first = |line: &str| line.split(' ').next().unwrap_or_default().to_owned();
        text.trim_start().lines().map(first).collect()
    };
    let short = call(&[]);
    let labels = lines(&short.output);
    assert_eq!(labels[..4], ["steps", "contacts", "energy", "snapshot"], "{short}");
    // The rain has not ended, so warnings remain.
    assert!(!labels[4..].is_empty() && labels[4..].iter().all(|l| l == "warning"), "{short}");
    short.said_once("of 250 particles of rain have fallen");
    let long = call(&["--verbose"]);
    let labels = lines(&long.output);
    assert_eq!(labels[..4], ["steps", "contacts", "energy", "snapshot"], "{long}");
    for label in ["phase", "audit", "halo", "memory", "packing", "balance", "step"] {
        assert!(labels[4..].iter().any(|other| other == label), "no {label}: {long}");
    }
}

/// Two runs on one core: each waits while the other has it.
#[test]
fn what_other_programs_cost_is_told() {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let cores = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap();
    let core = cores.trim().split([',', '-']).next().unwrap();
    let begun = ["one_of_two", "other_of_two"].map(|name| {
        let directory = fresh_directory(name);
        let out = directory.to_str().unwrap();
        let bound = ["taskset", "-c", core].map(Into::into).to_vec();
        let scene = scene("heap");
        let arguments = [&*scene, "--out", out, "--set", "time.steps=10000"];
        (Call::new(bound, env!("CARGO_BIN_EXE_dem-mpi"), arguments).start(), directory)
    });
    let parts = begun.map(|(run, directory)| {
        let ended = run.end();
        assert_eq!(ended.status.code(), Some(0), "{ended}");
        let report = report(&directory);
        number(&report, "/ranks/without_core_s/most") / number(&report, "/run/wall_s")
    });
    // Each gets half of the core if nothing else runs.
    assert!(parts.iter().all(|part| *part > 0.25), "{parts:?}");
}

/// All kinds of particles, each contact resolved again, by every method.
#[test]
fn audits_are_the_same_on_any_number_of_ranks_and_leave_no_trace() {
    let run = |name: &str, launch, method: &str, audit: &str| {
        let directory = fresh_directory(name);
        let (scene, out) = (scene("kinds"), directory.to_str().unwrap());
        let method = format!("contact.method={method}");
        let arguments =
            [&*scene, "--out", out, "--steps", "1000", "--set", &method, "--set", audit];
        dem_mpi(launch, arguments).succeed();
        directory
    };
    for method in ["auto", "gjk-erosion", "epa"] {
        let named = |what: &str| format!("audit_{method}_{what}");
        let audit = "audit={every = 100, contacts = 200, seed = 7}";
        let alone = run(&named("alone"), Launch::Alone, method, audit);
        let figures = report(&alone)["audit"].take();
        for ranks in [2, 3, 4] {
            let directory = run(&named(&ranks.to_string()), Launch::Ranks(ranks), method, audit);
            assert_eq!(report(&directory)["audit"], figures, "{method} on {ranks} ranks");
        }
        let without = run(&named("without"), Launch::Ranks(2), method, "audit={every = 0}");
        assert_same_result(&alone, &without);
        assert_eq!(report(&without)["audit"]["contacts"], 0);
        assert_errors(&figures, method);
    }
}

/// Checks the largest error of every method.
fn assert_errors(figures: &Value, method: &str) {
    assert_eq!(figures["audits"], 10);
    let kinds = figures["of_kinds"].as_array().unwrap();
    assert!(kinds.len() > 20, "{} pairs of kinds: {figures:#}", kinds.len());
    let all: u64 = kinds.iter().map(|of| of["contacts"].as_u64().unwrap()).sum();
    assert_eq!(figures["contacts"], all);
    let mut rough = 0;
    for of in kinds {
        println!("{method} {of}");
        assert_eq!(of["unresolved"], 0, "{of:#}");
        let is_exact = of["method"] != "gjk-erosion";
        let Some(error) = of["overlap"]["max"].as_f64() else { continue };
        assert!(error < if is_exact { 1e-7 } else { 0.5 }, "{method}: {of:#}");
        rough += u32::from(error > 1e-6);
        assert!(of["spurious"] == 0 || !is_exact, "{method}: {of:#}");
    }
    assert_eq!(rough > 0, method == "gjk-erosion", "{figures:#}");
}

/// A row of 16 balls on two ranks, cut in the middle: each has 8 of them and as many ghosts. Total bytes over total ghosts equal the bytes of a
/// rank and step over its ghosts.
#[test]
fn bytes_of_ghosts_are_those_of_messages() {
    let directory = fresh_directory("row");
    let row = "[domain]\nlow = [0, -1, -1]\nhigh = [16, 1, 1]\n[[material]]\nname = \"m\"\ndensity = 1\nnormal_stiffness = 1\n\
               [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.5\n[[fill.lattice]]\nfirst = [0.5, 0, 0]\ncount = [16, 1, 1]\n\
               spacing = 1\n[time]\nstep = 1e-3\nsteps = 500\n";
    dem_mpi(Launch::Ranks(2), [written(&directory, row)]).from(&directory).succeed();
    let report = report(&directory.join("out"));
    let number = |key: &str| number(&report, &format!("/ranks/{key}"));
    assert!((number("imbalance") - 1.0).abs() < 0.2, "{report:#}");
    let ghosts = 8.0 * number("ghosts_per_owned/mean");
    let expected = number("bytes_per_step/mean") / ghosts;
    // The start sends a message, too.
    let off = number("bytes_per_ghost") / expected - 1.0;
    assert!(ghosts > 0.4 && off.abs() < 0.01, "{ghosts}, {off}: {report:#}");
}

/// The report of a continued run covers only that run.
#[test]
fn figures_are_of_this_run() {
    let directory = fresh_directory("second_leg");
    let out = directory.to_str().unwrap();
    let audit = ["--set", "audit.every=200"];
    let heap = scene("heap");
    let leg = |launch, more: &[&str]| {
        let arguments = [&[&*heap, "--out", out][..], &audit, more].concat();
        dem_mpi(launch, arguments).succeed();
        report(Path::new(out))
    };
    let first = leg(Launch::Alone, &["--steps", "700"]);
    assert_eq!((&first["run"]["steps"], &first["audit"]["audits"]), (&700.into(), &3.into()));
    let second = leg(Launch::Ranks(2), &["--start", out, "--steps", "500"]);
    assert_eq!(second["run"]["steps"], 500);
    assert_eq!(second["run"]["last_step"], 1200);
    assert_eq!(second["audit"]["audits"], 3);
    assert!(second["audit"]["contacts"].as_u64().unwrap() > 0, "{second:#}");
}
