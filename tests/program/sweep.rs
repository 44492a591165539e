//! Sweeps: all combinations run, one table comes out, and an interrupted one goes on.

use super::process::{Call, Launch, dem_mpi, signal};
use super::{fresh_directory, written};
use dem_mpi::sweep::FIGURES;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// A ball that falls from about 1 m; the domain is open below.
fn falling(directory: &Path, more: &str) -> String {
    let text = format!(
        "gravity = [0, 0, -9.81]\n{more}
[domain]
low = [0, 0, 0]
high = [1, 1, 2]
[[fill.lattice]]
first = [0.5, 0.5, 1.0]
count = [1, 1, 1]
jitter = 0.1
[time]
step = 1e-5
steps = 2000
"
    );
    written(directory, &text)
}

/// A sweep of this scene into `swept` beside it.
fn sweep(directory: &Path, arguments: &[&str]) -> Call {
    let scene = directory.join("scene.toml");
    let words = ["sweep", scene.to_str().unwrap(), "--out", "swept"];
    dem_mpi(Launch::Alone, [&words[..], arguments].concat()).from(directory)
}

/// The rows of `sweep.csv`, by the names of the columns.
fn table(directory: &Path) -> Vec<BTreeMap<String, String>> {
    let mut table = csv::Reader::from_path(directory.join("swept/sweep.csv")).unwrap();
    let names = table.headers().unwrap().clone();
    let row = |record: csv::StringRecord| {
        names.iter().zip(&record).map(|(name, cell)| (name.to_owned(), cell.to_owned())).collect()
    };
    table.records().map(|record| row(record.unwrap())).collect()
}

fn number(row: &BTreeMap<String, String>, name: &str) -> f64 {
    row[name].parse().unwrap_or_else(|_| panic!("{name}: {row:?}"))
}

const TWO_BY_TWO: [&str; 6] = [
    "--vary",
    "gravity=[0, 0, -9.81],[0, 0, -1.62]",
    "--vary",
    "seed=1..2",
    "--measure",
    "top_m,packing.contacts,step",
];

#[test]
fn all_combinations_run_and_their_table_is_exact() {
    let directory = fresh_directory("sweep");
    falling(&directory, "");
    let ended = sweep(&directory, &[&TWO_BY_TWO[..], &["--jobs", "2"]].concat()).succeed();
    ended.said_once("4 of 4: ");
    // All figures that can be measured are in a report.
    let report = fs::read_to_string(directory.join("swept/gravity=0,0,-9.81_seed=1/report.json"));
    let report: serde_json::Value = serde_json::from_str(&report.unwrap()).unwrap();
    for name in FIGURES {
        let figure = report.pointer(&format!("/{}", name.replace('.', "/")));
        assert!(figure.is_some_and(|figure| figure.is_number() || figure.is_null()), "{name}");
    }
    let rows = table(&directory);
    let text = fs::read_to_string(directory.join("swept/sweep.csv")).unwrap();
    assert!(
        text.starts_with("gravity,seed,folder,status,wall_s,top_m,packing.contacts,step\n"),
        "{text}"
    );
    let [one, two, three, four] = &rows[..] else { panic!("four rows: {text}") };
    // The seed decides where the ball begins, gravity how far it has fallen in 0.02 s.
    let way = (9.81 - 1.62) * 0.02_f64.powi(2) / 2.0;
    for (earth, moon) in [(one, three), (two, four)] {
        assert_eq!((&*earth["gravity"], &*moon["gravity"]), ("[0, 0, -9.81]", "[0, 0, -1.62]"));
        assert_eq!(earth["seed"], moon["seed"]);
        let off = number(moon, "top_m") - number(earth, "top_m") - way;
        assert!(off.abs() < 1e-12, "{off:e}");
    }
    assert!((number(one, "top_m") - number(two, "top_m")).abs() > 1e-3);
    for row in &rows {
        assert_eq!((&*row["status"], number(row, "step")), ("done", 2000.0));
        assert_eq!(number(row, "packing.contacts"), 0.0);
        assert!(number(row, "wall_s") > 0.0);
        let folder = directory.join("swept").join(&row["folder"]);
        for file in ["scene.toml", "log.txt", "history.csv", "report.json"] {
            assert!(folder.join(file).exists(), "{file}");
        }
        // The scene of the folder is the run.
        let alone = dem_mpi(Launch::Alone, ["scene.toml", "--out", "again"]).from(&folder);
        alone.succeed();
        let [history, again] =
            ["history.csv", "again/history.csv"].map(|f| fs::read(folder.join(f)).unwrap());
        assert!(history == again);
    }
    assert!(fs::read_to_string(directory.join("swept/sweep.svg")).unwrap().starts_with("<svg"));
    // Once more there is nothing to do, and the table stays.
    let ended = sweep(&directory, &TWO_BY_TWO).succeed();
    ended.said_once("4 of 4 runs are done already");
    assert_eq!(fs::read_to_string(directory.join("swept/sweep.csv")).unwrap(), text);
    // A value more is a run more; another scene is refused.
    let more = TWO_BY_TWO.map(|word| if word == "seed=1..2" { "seed=1..3" } else { word });
    sweep(&directory, &more).succeed().said_once("4 of 6 runs are done already");
    falling(&directory, "global_damping = 1\n");
    let ended = sweep(&directory, &TWO_BY_TWO).end();
    assert_eq!(ended.status.code(), Some(2), "{ended}");
    ended.said_once("has a run of another scene: give another --out, or move it away");
}

#[test]
fn failed_runs_are_listed() {
    let directory = fresh_directory("sweep_failed");
    falling(&directory, "");
    let vary = ["--vary", "fill.lattice.0.velocity=[0,0,0],[0,0,-100]", "--measure", "top_m"];
    for times in 1..=2 {
        let ended = sweep(&directory, &vary).end();
        assert_eq!(ended.status.code(), Some(1), "{ended}");
        ended.said_once("1 of 2 runs failed (see log.txt in their folders): velocity=0,0,-100");
        let rows = table(&directory);
        assert_eq!([&*rows[0]["status"], &*rows[1]["status"]], ["done", "failed"], "{times}");
        assert!(!rows[0]["top_m"].is_empty() && rows[1]["top_m"].is_empty());
    }
}

#[test]
fn mistakes_are_found_before_the_first_run() {
    let directory = fresh_directory("sweep_wrong");
    falling(&directory, "");
    let friction = ["--vary", "material.glass.friction=0.1,0.2"];
    for (arguments, said) in [
        (vec!["--vary", "material.glass.friction=0.1,-1"], "friction=-1: 1 error in the scene"),
        (vec!["--vary", "material.glas.friction=0.1"], "did you mean `glass`?"),
        (
            vec!["--vary", "seed=1", "--set", "stop.when=[{ column = \"z\", above = 1 }]"],
            "seed=1: stop.when: history.csv has no column `z`",
        ),
        (vec!["--vary", "seed"], "give a key and its values, as in"),
        (vec!["--vary", "seed=1,,2"], "a value is empty"),
        (vec!["--vary", "seed=3..1"], "the range 3..1 is empty"),
        (vec!["--vary", "seed=1..1000000000000"], "has more than 10000 values"),
        (vec!["--vary", "seed=1,1"], "a value stands there twice"),
        (
            vec!["--vary", "seed=1..2", "--vary", "seed=3"],
            "--vary seed: the key stands there twice",
        ),
        (
            vec!["--vary", "seed=1..2000", "--vary", "title=a,b,c,d,e,f"],
            "more than 10000 combinations",
        ),
        (
            vec!["--vary", "output.directory=a,b"],
            "each run has a folder of its own in that of --out",
        ),
        (
            [&friction[..], &["--measure", "top_m,z"]].concat(),
            "--measure z: run friction=0.1 has no such column in history.csv and no such figure",
        ),
        ([&friction[..], &["--jobs", "0"]].concat(), "invalid value '0' for '--jobs <N>'"),
        (vec![], "--vary <KEY=VALUES>"),
    ] {
        let ended = sweep(&directory, &arguments).end();
        assert_eq!(ended.status.code(), Some(2), "{ended}");
        assert!(ended.errors.contains(said), "{said}: {ended}");
        assert!(!directory.join("swept").exists(), "{said}");
    }
    // The names that there are stand in the message.
    let ended = sweep(&directory, &["--vary", "seed=1", "--measure", "z"]).end();
    assert!(
        ended.errors.contains("Columns are step, time_s, particles")
            && ended.errors.contains("packing.coordination"),
        "{ended}"
    );
    // A folder of somebody else stays.
    let folder = directory.join("swept/seed=1");
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join("mine"), "mine").unwrap();
    let ended = sweep(&directory, &["--vary", "seed=1"]).end();
    assert_eq!(ended.status.code(), Some(2), "{ended}");
    ended.said_once("was not made by a sweep");
}

/// Stopped by a signal half-way, the sweep goes on from the snapshots, on another number of ranks, and comes to the same bits.
#[test]
fn a_stopped_sweep_goes_on() {
    let directory = fresh_directory("sweep_stopped");
    let more = "[[outlet]]\nname = \"below\"\npoint = [0, 0, 0.1]\nnormal = [0, 0, 1]\n";
    falling(&directory, more);
    let vary = [
        "--vary",
        "seed=1..2",
        "--set",
        "time.step=1e-7",
        "--set",
        "time.steps=400000",
        "--measure",
        "top_m",
    ];
    let mut running = sweep(&directory, &[&vary[..], &["--jobs", "1"]].concat()).start();
    let history = directory.join("swept/seed=1/history.csv");
    running.until("the first run has rows", || {
        fs::read_to_string(&history).is_ok_and(|text| text.lines().count() > 20)
    });
    signal(running.id(), "INT");
    let ended = running.end();
    assert_eq!(ended.status.code(), Some(3), "{ended}");
    let status = || table(&directory).iter().map(|row| row["status"].clone()).collect::<Vec<_>>();
    assert_eq!(status(), ["stopped", "open"], "{ended}");
    let ended = sweep(&directory, &[&vary[..], &["--ranks", "2"]].concat()).succeed();
    assert_eq!(status(), ["done", "done"], "{ended}");
    let log = fs::read_to_string(directory.join("swept/seed=1/log.txt")).unwrap();
    assert!(log.contains("2 ranks, steps ") && !log.contains("2 ranks, steps 0 to"), "{log}");
    let folder = directory.join("swept/seed=1");
    dem_mpi(Launch::Alone, ["scene.toml", "--out", "again"]).from(&folder).succeed();
    let [history, again] =
        ["history.csv", "again/history.csv"].map(|f| fs::read(folder.join(f)).unwrap());
    assert!(history == again, "another history");
}

/// Figures of dem-post stand in the table, by its options. An option that is wrong is told, and its cell stays empty.
#[test]
fn figures_of_dem_post_stand_in_the_table() {
    let directory = fresh_directory("sweep_post");
    falling(&directory, "");
    let names = "post.summary.volume_m3,post.summary.particles,post.summary.nothing,top_m";
    let region = |bounds: &str| {
        let options = format!("--region {bounds}");
        let more = ["--vary", "seed=1..2", "--measure", names, "--post", &options];
        (sweep(&directory, &more).end(), table(&directory))
    };
    let (ended, rows) = region("0,1,0.25,0.75,0,1.5");
    ended.said_once("seed=2: there is no number `post.summary.nothing`");
    for row in &rows {
        assert_eq!(number(row, "post.summary.volume_m3"), 0.75, "{row:?}");
        assert_eq!(number(row, "post.summary.particles"), 1.0, "{row:?}");
        assert!(row["post.summary.nothing"].is_empty() && number(row, "top_m") > 0.5, "{row:?}");
    }
    // Runs that are done are measured again.
    let (_, rows) = region("0,1,0,1,0,1.25");
    assert!(rows.iter().all(|row| number(row, "post.summary.volume_m3") == 1.25), "{rows:?}");
    let (ended, rows) = region("0,1");
    assert!(ended.said().contains("--region"), "{}", ended.said());
    assert!(rows.iter().all(|row| row["post.summary.volume_m3"].is_empty()), "{rows:?}");
}
