//! The short cases of `benchmarks/verification`: published numbers, closed forms and other codes.

#[path = "../../benchmarks/verification/cases/mod.rs"]
#[allow(dead_code, reason = "pictures and LAMMPS are for the command")]
pub(crate) mod cases;

use cases::{Effort, Verdict};

/// Runs the cases of a source, and names those with an unexpected result: failures, and known
/// deviations that no longer occur.
fn check(source: &str) {
    let run = cases::sources().into_iter().find(|(name, _)| *name == source).expect("a source").1;
    let findings = run(Effort::Quick);
    assert!(!findings.cases.is_empty(), "{source} has cases");
    let mut failed = Vec::new();
    for case in findings.cases.iter().filter(|case| !case.verdict().is_expected()) {
        let worst = case.worst();
        let verdict = match case.verdict() {
            Verdict::HoldsNow => "holds now: it need no longer be said to fall short",
            _ => "fails",
        };
        failed.push(format!(
            "{}, {}: {verdict}; {}: {:e}, published {:e}, off by {:.2e}, allowed {:.0e}",
            case.name,
            case.quantity,
            worst.what,
            worst.own,
            worst.published,
            worst.deviation(),
            case.tolerance
        ));
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

#[test]
fn mfix() {
    check("mfix");
}

#[test]
fn lammps() {
    check("lammps");
}

#[test]
fn chung_and_ooi() {
    check("chung_ooi");
}

#[test]
fn elliptic_contacts() {
    check("elliptic");
}

#[test]
fn walls_that_turn_and_walls_of_triangles() {
    check("moving_walls");
}

#[test]
fn what_rolls_and_what_sticks() {
    check("sticking");
}

#[test]
fn oblique_impacts_of_elastic_balls() {
    check("elastic");
}

#[test]
fn free_motion() {
    check("free_motion");
}

#[test]
fn bodies_on_a_plane() {
    check("incline");
}

#[test]
fn bodies_with_faces() {
    check("faces");
}

#[test]
fn solids_come_to_balance() {
    check("balance");
}

#[test]
fn an_arch_stands_and_falls() {
    check("arch");
}

#[test]
fn dominoes() {
    check("dominoes");
}

#[test]
fn bodies_of_several_pieces() {
    check("unions");
}

#[test]
fn boxes_of_unequal_size() {
    check("unequal");
}

#[test]
fn haff_and_jamming() {
    check("packing");
}

#[test]
fn a_sheared_gas() {
    check("shear");
}

#[test]
fn largest_steps_of_smooth_bodies() {
    check("steps");
}

#[test]
fn orders_of_convergence() {
    check("convergence");
}

#[test]
fn other_codes() {
    check("other_codes");
}
