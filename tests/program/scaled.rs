//! Strong and weak scaling, measured by `run/scaling`.

use super::fresh_directory;
use super::process::{Call, mpirun};
use std::fs;
use std::path::Path;

fn scaling(mpirun: &str, out: &Path) -> Call {
    let program = concat!("DEM_MPI=", env!("CARGO_BIN_EXE_dem-mpi"));
    let mpirun = format!("MPIRUN={mpirun}");
    let sizes =
        ["--ranks", "2,1", "--each", "150", "--total", "400", "--steps", "20", "--rounds", "2"];
    let words = [program, &mpirun, "run/scaling", "--out", out.to_str().unwrap()];
    Call::new(vec![], "env", [&words[..], &sizes].concat())
}

#[test]
fn scaling_is_measured() {
    let out = fresh_directory("scaling");
    let ended = scaling(mpirun().to_str().unwrap(), &out).succeed();
    let mut table = csv::Reader::from_path(out.join("scaling.csv")).unwrap();
    let names = table.headers().unwrap().clone();
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    let word = |row: &csv::StringRecord, name: &str| {
        row[names.iter().position(|other| other == name).unwrap()].to_owned()
    };
    let number = |row: &csv::StringRecord, name: &str| word(row, name).parse::<f64>().unwrap();
    assert_eq!(rows.len(), 8, "{ended}");
    for pair in rows.chunks(2) {
        let [one, two] = pair else { panic!("one and two ranks") };
        assert_eq!((number(one, "ranks"), number(two, "ranks")), (1.0, 2.0));
        let growth = number(two, "particles") / number(one, "particles");
        if word(one, "kind") == "strong" {
            assert_eq!(growth, 1.0);
        } else {
            assert!((1.7..2.3).contains(&growth), "{growth}");
        }
        // Equal work in equal time on each rank is an efficiency of 1.
        let gain = growth * number(one, "step_s") / number(two, "step_s");
        assert_eq!(number(one, "efficiency"), 1.0);
        assert!((number(two, "efficiency") / (gain / 2.0) - 1.0).abs() < 1e-9);
        assert!(number(two, "contacts_each") > 2.0, "{two:?}");
    }
    let plot = fs::read_to_string(out.join("scaling.svg")).unwrap();
    assert_eq!(plot.matches("<circle").count(), 8);

    // Runs that are there stay.
    fs::remove_file(out.join("scaling.csv")).unwrap();
    scaling("no-such-launcher", &out).succeed();
    assert!(out.join("scaling.csv").is_file());
}

/// A launcher of another MPI starts ranks that do not know each other.
#[test]
fn scaling_knows_its_ranks() {
    let out = fresh_directory("scaling_alone");
    let ended = scaling("sh -c 'shift; exec \"$@\"'", &out).end();
    assert_eq!(ended.status.code(), Some(1), "{ended}");
    ended.said_once("dem-mpi saw 1 ranks, not 2");
}
