//! Tables of README.md and benchmarks/README.md from records: text and record agree digit by digit.
//!
//! `DEM_TABLES=write cargo test --test main -- tables` writes the tables again.

use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;

const RECORDS: &str = "benchmarks/records/2026-11-peers";

/// A run in a table of times.
#[derive(Deserialize)]
struct Run {
    ranks: u32,
    code: String,
    steps: f64,
    wall_s: f64,
}

/// Medians over the rounds of a table of times [µs per particle-step], by code and ranks.
fn medians(file: &str, particles: f64) -> BTreeMap<(String, u32), f64> {
    let path = format!("{RECORDS}/{file}");
    let rows = csv::Reader::from_path(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let mut all: BTreeMap<(String, u32), Vec<f64>> = BTreeMap::new();
    for run in rows.into_deserialize() {
        let Run { ranks, code, steps, wall_s } = run.unwrap_or_else(|e| panic!("{path}: {e}"));
        all.entry((code, ranks)).or_default().push(1e6 * wall_s / (steps * particles));
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let middle = values.len() / 2;
        0.5 * (values[middle] + values[(values.len() - 1) / 2])
    };
    all.into_iter().map(|(key, values)| (key, median(values))).collect()
}

/// Cases with the files of their times and their numbers of particles.
const CASES: [(&str, &str, f64); 4] = [
    ("20,000 settled spheres with friction", "time.csv", 20_000.0),
    ("980,000 of them", "tiles_7.csv", 980_000.0),
    ("5,120 settled ellipsoids", "settled.csv", 5_120.0),
    ("19,800 spheres with Hertz and Mindlin in a drum of 1,200 triangles", "drum.csv", 19_800.0),
];

/// Table of million particle-steps per second, for this program and others.
fn rates() -> String {
    let codes = ["dem-mpi", "lammps", "liggghts"];
    let mut table = "| | dem-mpi, one core | two | LAMMPS, one | two | LIGGGHTS, one | two |\n|---|---|---|---|---|---|---|\n".to_owned();
    for (what, file, particles) in CASES {
        let medians = medians(file, particles);
        let cells = codes.iter().flat_map(|code| [1, 2].map(|ranks| (code, ranks)));
        let cells = cells.map(|(code, ranks)| {
            let time = medians.get(&((*code).to_owned(), ranks));
            time.map_or_else(|| "–".to_owned(), |time| format!("{:.1}", 1.0 / time))
        });
        writeln!(table, "| {what} | {} |", cells.collect::<Vec<_>>().join(" | ")).unwrap();
    }
    table
}

/// Table of the time of a step, for this program and others.
fn speed() -> String {
    let codes = [
        ("dem-mpi", "dem-mpi"),
        ("dem-mpi shuffled", "the same, ids at random"),
        ("dem-mpi avx", "the same without AVX-512"),
        ("dem-mpi any", "the same without AVX (SSE2)"),
        ("lammps", "LAMMPS (2021)"),
        ("liggghts", "LIGGGHTS 3.8"),
    ];
    let mut table = "| | | one rank | two ranks |\n|---|---|---|---|\n".to_owned();
    for (what, file, particles) in CASES {
        let medians = medians(file, particles);
        let mut what = what;
        for (code, name) in codes {
            let cell = |ranks| {
                let time = medians.get(&(code.to_owned(), ranks));
                time.map_or_else(String::new, |time| format!(" {time:.3}"))
            };
            let cells = [cell(1), cell(2)];
            if cells.iter().any(|cell| !cell.is_empty()) {
                writeln!(table, "| {what} | {name} |{} |{} |", cells[0], cells[1]).unwrap();
                what = "";
            }
        }
    }
    table
}

#[test]
fn tables_are_those_of_the_records() {
    let (begin, end) = ("<!-- speed -->\n", "<!-- end of speed -->");
    for (file, table) in [("README.md", rates()), ("benchmarks/README.md", speed())] {
        let text = fs::read_to_string(file).unwrap();
        let (before, rest) = text.split_once(begin).expect("where the table begins");
        let (now, after) = rest.split_once(end).expect("where it ends");
        if std::env::var("DEM_TABLES").is_ok_and(|what| what == "write") {
            fs::write(file, format!("{before}{begin}{table}{end}{after}")).unwrap();
            continue;
        }
        assert_eq!(now, table, "{file}: DEM_TABLES=write cargo test --test main -- tables");
    }
}
