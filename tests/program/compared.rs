//! Several runs on one page: curves that are known, stages that continue each other, and what cannot be compared.

use super::process::{Call, Launch, dem_mpi, dem_post};
use super::{fresh_directory, written};
use crate::support::packings::{boxed, store};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Rows of `compare.csv`: column to cell.
type Rows = Vec<BTreeMap<String, String>>;

fn rows(folder: &Path) -> Rows {
    let mut table = csv::Reader::from_path(folder.join("compare.csv")).unwrap();
    let names = table.headers().unwrap().clone();
    assert_eq!([&names[0], &names[1], &names[2]], ["run", "source", "elapsed_s"]);
    let row = |record: csv::StringRecord| {
        names.iter().zip(&record).map(|(name, cell)| (name.to_owned(), cell.to_owned())).collect()
    };
    table.records().map(|record| row(record.unwrap())).collect()
}

/// Rows of a run from one source.
fn of<'a>(rows: &'a Rows, run: &str, source: &str) -> Vec<&'a BTreeMap<String, String>> {
    let own: Vec<_> = rows.iter().filter(|r| r["run"] == run && r["source"] == source).collect();
    assert!(!own.is_empty(), "no {source} of {run}");
    own
}

fn number(row: &BTreeMap<String, String>, name: &str) -> f64 {
    row[name].parse().unwrap_or_else(|_| panic!("{name}: {row:?}"))
}

/// Points of the curve in this colour, in units of the drawing.
fn curve(svg: &str, colour: &str) -> Vec<(f64, f64)> {
    let mut lines = svg.split("<polyline").filter(|text| {
        text.split("/>").next().is_some_and(|own| own.contains(&format!("stroke=\"{colour}\"")))
    });
    let line = lines.next().unwrap_or_else(|| panic!("no curve in {colour}"));
    assert!(lines.next().is_none(), "several curves in {colour}");
    let (_, points) = line.split_once("points=\"").unwrap();
    let ends = points.split('"').next().unwrap().split_whitespace();
    let number = |text: &str| text.parse::<f64>().unwrap();
    ends.filter_map(|end| end.split_once(',')).map(|(x, y)| (number(x), number(y))).collect()
}

/// Colours of the first and the second run, and the other shade of the first.
const FIRST: &str = "#0072B2";
const SECOND: &str = "#E69F00";
const CONTINUED: &str = "#66AAD0";

/// Checks a number to within an absolute tolerance.
fn close(found: f64, expected: f64, tolerance: f64, what: &str) {
    assert!((found - expected).abs() <= tolerance, "{what}: {found:e}, expected {expected:e}");
}

fn compare(folder: &Path, runs: &[&str], more: &[&str]) -> Call {
    dem_post([runs, &["--compare", "--out", "all"], more].concat()).from(folder)
}

/// Balls fall on the earth and on the moon: heights and energies are those of free fall, in the table and in the drawing.
#[test]
fn two_runs_keep_their_known_curves() {
    let folder = fresh_directory("compared");
    let text = "
[domain]
low = [0, 0, 0]
high = [1, 1, 2]
[[fill.lattice]]
first = [0.5, 0.5, 1.0]
count = [1, 1, 1]
[time]
step = 1e-4
steps = 200
[output]
history_every = 10
";
    let scene = written(&folder, &format!("gravity = [0, 0, -9.81]\n{text}"));
    let runs = [("earth", 9.81), ("moon", 1.62)];
    for (name, g) in runs {
        let gravity = format!("gravity=[0, 0, -{g}]");
        dem_mpi(Launch::Alone, [&*scene, "--out", name, "--set", &gravity]).from(&folder).succeed();
    }
    compare(&folder, &["earth", "moon"], &[]).succeed().said_once("page: all/compare.html");
    let out = folder.join("all");
    let rows = rows(&out);
    for (name, g) in runs {
        let history = of(&rows, name, "history");
        assert_eq!(history.len(), 21);
        let top = number(history[0], "top_m");
        for row in history {
            let time = number(row, "time_s");
            close(number(row, "elapsed_s"), time, 0.0, "elapsed");
            close(top - number(row, "top_m"), g * time * time / 2.0, 1e-9, "way of the fall");
        }
        let last = of(&rows, name, "snapshots").pop().unwrap().clone();
        assert_eq!((&*last["step"], &*last["particles"]), ("200", "1"));
    }
    // Drawn ways of the fall are as the gravities.
    let svg = fs::read_to_string(out.join("history_top.svg")).unwrap();
    let fall = |colour| {
        let points = curve(&svg, colour);
        points.last().unwrap().1 - points[0].1
    };
    close(fall(FIRST) / fall(SECOND), 9.81 / 1.62, 0.02, "drawn");
    assert!(svg.contains("\nearth\n") && svg.contains("\nmoon\n"), "{svg}");

    let page = fs::read_to_string(out.join("compare.html")).unwrap();
    assert!(page.contains("<h1>Comparison of earth, moon</h1>"));
    let scenes = page.split("<h2>Differences of the scenes</h2>").nth(1).unwrap();
    let scenes = scenes.split("</section>").next().unwrap();
    assert_eq!(scenes.matches("<tr>").count(), 2, "the names and one key: {scenes}");
    assert!(scenes.contains("<tr><th scope=\"row\">gravity</th><td>[0"), "{scenes}");
    assert!(page.contains("<th scope=\"row\">history.csv: top_m</th>") && page.contains("</html>"));
    assert!(!page.contains("<script") && !page.contains("href=\"http"), "self-contained");
}

/// Layers of balls under a lid that comes down; in the second stage it goes up again.
#[test]
fn strain_and_time_go_on_in_the_next_stage() {
    let (speed, full) = (0.02, 4e-3);
    let folder = fresh_directory("compared_stages");
    let text = "
title = \"loading\"
[domain]
low = [0, 0, 0]
high = [0.004, 0.004, 0.004]
walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"]
wall_velocity = { \"+z\" = [0, 0, -0.02] }
[[material]]
name = \"stone\"
density = 2500.0
normal_stiffness = 1e3
restitution = 0.5
[[shape]]
name = \"ball\"
kind = \"sphere\"
radius = 0.001
[[fill.lattice]]
first = [0.001, 0.001, 0.001]
count = [2, 2, 2]
spacing = 0.002
[time]
step = 1e-5
steps = 300
[output]
history_every = 20
snapshot_every = 100
directory = \"load\"
";
    let scene = written(&folder, text);
    dem_mpi(Launch::Alone, [&*scene]).from(&folder).succeed();
    let next = "
title = \"unloading\"
start = \"load\"
like = \"start\"
[domain]
wall_velocity = { \"+z\" = [0, 0, 0.02] }
[time]
step = 1e-5
steps = 200
[output]
history_every = 20
snapshot_every = 100
directory = \"unload\"
";
    fs::write(folder.join("next.toml"), next).unwrap();
    let plan = dem_mpi(Launch::Alone, ["next.toml", "--plan"]).from(&folder).succeed();
    plan.said_once("8 particles of load, step 300, 0.003000 s");
    plan.said_once("8 in all (1 rank)");
    plan.said_once("of contacts; 3 in all");
    dem_mpi(Launch::Alone, ["next.toml"]).from(&folder).succeed();
    // The order of the arguments does not matter for the origin.
    compare(&folder, &["unload", "load"], &[]).succeed();
    let out = folder.join("all");
    let all = rows(&out);
    let height = |time: f64| full - speed * if time <= 3e-3 { time } else { 6e-3 - time };
    for (run, steps) in [("load", 0..=300), ("unload", 300..=500)] {
        for source in ["history", "snapshots"] {
            for row in of(&all, run, source) {
                let time = number(row, "time_s");
                assert!(steps.contains(&number(row, "step").round().to_string().parse().unwrap()));
                close(number(row, "elapsed_s"), time, 0.0, "elapsed");
                if source == "history" {
                    close(number(row, "place_+z_m"), height(time), 1e-12, "lid");
                } else {
                    let strain = (full / height(time)).ln();
                    close(number(row, "axial_strain"), strain, 1e-9, "strain");
                }
            }
        }
    }
    // Both curves meet where the lid turns, at the largest strain, and have shades of one colour.
    let svg = fs::read_to_string(out.join("strain_wall_stresses_plus_z.svg")).unwrap();
    let (load, unload) = (curve(&svg, FIRST), curve(&svg, CONTINUED));
    let (turn, first) = (load.last().unwrap(), unload[0]);
    assert!((turn.0 - first.0).abs() <= 2.0, "{turn:?} {first:?}");
    assert!(load.iter().chain(&unload).all(|point| point.0 <= turn.0), "{load:?} {unload:?}");
    assert!(unload.last().unwrap().0 < turn.0);

    let page = fs::read_to_string(out.join("compare.html")).unwrap();
    let row =
        "<tr><th scope=\"row\">unload</th><td>unloading</td><td>load</td><td>300</td><td>500</td>";
    assert!(page.contains(row), "{page}");
    // Alone, the stage has its own strain, time and colours.
    fs::rename(folder.join("load"), folder.join("other")).unwrap();
    compare(&folder, &["unload", "other"], &[]).succeed();
    let alone = rows(&out);
    let first = of(&alone, "unload", "snapshots")[0].clone();
    close(number(&first, "elapsed_s"), number(&first, "time_s") - 3e-3, 1e-15, "elapsed");
    close(number(&first, "axial_strain"), 0.0, 0.0, "strain");
    assert!(
        fs::read_to_string(out.join("compare.html"))
            .unwrap()
            .contains("<td>unloading</td><td>–</td>")
    );
}

/// Two tests from one packing: the first of them continues its colour, the second has its own.
#[test]
fn branches_of_one_packing_have_different_colours() {
    let folder = fresh_directory("compared_branches");
    for (name, steps, start) in [
        ("packing", [0, 1000], None),
        ("a", [1000, 2000], Some("packing")),
        ("b", [1000, 2000], Some("packing")),
    ] {
        for (k, step) in steps.into_iter().enumerate() {
            let mut snapshot = boxed(0.02 - 1e-6 * step as f64, step);
            let header = &mut snapshot.header;
            if let Some(start) = start {
                header.stage_begin = (1000, 1000.0 * header.dt);
                header.scene = format!(
                    "start = \"{start}\"\n[law]\nkind = \"{name}\"\n[[servo]]\nstress = {k}"
                );
            }
            store(&folder.join(name), &snapshot);
        }
    }
    compare(&folder, &["packing", "a", "b"], &[]).succeed();
    let svg = fs::read_to_string(folder.join("all/solid_fraction.svg")).unwrap();
    for colour in [FIRST, CONTINUED, SECOND] {
        assert_eq!(curve(&svg, colour).len(), 2);
    }
    let page = fs::read_to_string(folder.join("all/compare.html")).unwrap();
    for row in [
        "<th scope=\"row\">law.kind</th><td>–</td><td>&quot;a&quot;</td><td>&quot;b&quot;</td>",
        "<th scope=\"row\">servo.0.stress</th><td>–</td><td>1</td><td>1</td>",
    ] {
        assert!(page.contains(row), "{row} is not in {page}");
    }
    let rows = rows(&folder.join("all"));
    for (run, step, height) in [("a", 2000.0, 0.018), ("packing", 1000.0, 0.019)] {
        let last = of(&rows, run, "snapshots").pop().unwrap();
        close(number(last, "step"), step, 0.0, "step");
        close(
            number(last, "axial_strain"),
            (0.02_f64 / height).ln(),
            1e-12,
            "strain since the packing",
        );
    }
}

/// Runs with equal names of folders are told apart by the folders above.
#[test]
fn what_cannot_be_compared_is_refused() {
    let folder = fresh_directory("not_compared");
    for run in ["x/out", "y/out"] {
        store(&folder.join(run), &boxed(0.02, 1000));
    }
    fs::create_dir(folder.join("empty")).unwrap();
    let refused = |runs: &[&str], more: &[&str], said: &str| {
        let ended = compare(&folder, runs, more).end();
        assert_eq!(ended.status.code(), Some(2), "{ended}");
        assert!(ended.errors.contains(said), "{ended}");
        assert!(!folder.join("all").exists(), "something was written");
    };
    let both = ["x/out", "y/out"];
    refused(&both[..1], &[], "--compare takes two runs or more, not 1");
    refused(&["x/out", "x/out/last.vtkhdf"], &[], "--compare takes two runs or more, not 1");
    refused(&["x/out", "empty"], &[], "empty contains no snapshot");
    refused(&both, &["--diff"], "cannot be used with");
    refused(&both, &["--lammps"], "cannot be used with");
    refused(&both, &["--slope", "x"], "cannot be used with");
    refused(&both, &[], "the runs have no quantity in common that changes");
    let histories = |units: [&str; 2]| {
        for (run, unit) in both.iter().zip(units) {
            let table = format!("step,time_s,press_{unit}\n0,0,1\n1,1,2\n");
            fs::write(folder.join(run).join("history.csv"), table).unwrap();
        }
    };
    histories(["Pa", "N"]);
    refused(&both, &[], "Press is in press (Pa) in run x/out and in press (N) in run y/out");
    histories(["N", "N"]);
    compare(&folder, &both, &[]).succeed();
    let page = fs::read_to_string(folder.join("all/compare.html")).unwrap();
    assert!(
        page.contains("<h1>Comparison of x/out, y/out</h1>") && page.contains("<h3>Press</h3>")
    );
}
