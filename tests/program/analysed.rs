//! From the snapshots of a run to numbers, plots and a page.

use super::process::{Launch, dem_post};
use super::{HEAP_SNAPSHOTS, HEAP_STEPS, column, fresh_directory, heap, snapshot};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// Report of a heap's newest snapshot.
fn report(launch: Launch) -> Value {
    let run = heap(launch);
    let out = fresh_directory(&format!("post_{launch:?}"));
    let (from, to) = (run.directory.to_str().unwrap(), out.to_str().unwrap());
    dem_post([from, "--out", to]).succeed().said_once(&format!("page: {to}/index.html"));

    let page = fs::read_to_string(out.join("index.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("</html>"));
    let table = fs::read_to_string(out.join("report.csv")).unwrap();
    assert_eq!(table.lines().count(), 2, "{table}");
    let plots = out.read_dir().unwrap().flatten().filter(|e| is_svg(&e.path())).count();
    assert!(plots > 5, "{plots} plots");
    serde_json::from_str(&fs::read_to_string(out.join("report.json")).unwrap()).unwrap()
}

fn is_svg(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "svg")
}

/// Reports agree digit for digit, except for the snapshot's name.
#[test]
fn reports_are_the_same_from_one_rank_and_from_four() {
    let reports = [Launch::Alone, Launch::Ranks(4)].map(|launch| {
        let mut reports = report(launch);
        let name = reports[0]["snapshot"].take();
        assert!(name.as_str().unwrap().ends_with("particles_000003000.vtkhdf"), "{name}");
        reports
    });
    // The snapshot and the history agree.
    let contacts_each = reports[0][0]["summary"]["coordination_with_walls"].as_f64().unwrap();
    let said = column(&heap(Launch::Alone).directory, "coordination")[&HEAP_STEPS];
    assert!((contacts_each - said).abs() < 1e-12, "{contacts_each} {said}");
    let [alone, together] = reports.map(|r| serde_json::to_string_pretty(&r).unwrap());
    if alone != together {
        let differ = alone.lines().zip(together.lines()).find(|(a, b)| a != b);
        panic!("the reports differ: {differ:#?}");
    }
}

/// An empty region gives an error instead of a report.
#[test]
fn an_empty_region_is_an_error() {
    let run = heap(Launch::Alone);
    let directory = run.directory.to_str().unwrap();
    let corner = "--region=0,1e-6,0,1e-6,0,1e-6";
    for arguments in [&[directory, corner][..], &[directory, "--series", corner]] {
        let refused = dem_post(arguments).end();
        assert_eq!(refused.status.code(), Some(2), "{refused}");
        refused.said_once("the region contains no particle centre: make it larger");
    }
}

#[test]
fn a_comparison_names_what_differs() {
    let run = heap(Launch::Alone);
    let [_, earlier, later] = HEAP_SNAPSHOTS.map(|step| snapshot(&run.directory, step));
    let [earlier, later] = [&earlier, &later].map(|path| path.to_str().unwrap());
    let compare = |first, second| dem_post(["--diff", first, second]).end();

    let same = compare(later, later);
    assert_eq!(same.status.code(), Some(0), "{same}");
    same.said_once("equal bit for bit");

    let different = compare(earlier, later);
    assert_eq!(different.status.code(), Some(1), "{different}");
    different.said_once("step: 1000 and 2000");
    // Ids count from 0: the first particle is in both snapshots, the last layer of rain is not.
    different.said_once(" 0 position.x");
    different.said_once("only in the second: 805, 806, ");

    let directory = fresh_directory("unreadable");
    let bytes = fs::read(later).unwrap();
    let half = directory.join("half.vtkhdf");
    fs::write(&half, &bytes[..bytes.len() / 2]).unwrap();
    let unreadable = compare(half.to_str().unwrap(), later);
    assert_eq!(unreadable.status.code(), Some(2), "{unreadable}");
    unreadable.said_once("half.vtkhdf cannot be read as a snapshot");
}
