//! dem-post on the files of a run.

use super::{ROUNDING, close, close_matrix, number};
use crate::support::packings::{ellipsoids, store};
use crate::support::{begun, scene};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::{Comm, threads};
use dem_mpi::drive::servo;
use dem_mpi::math::Mat3;
use dem_mpi::output::header::Header;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::output::{snapshot, table};
use dem_mpi::post::history::History;
use dem_mpi::post::page::{self, Page};
use dem_mpi::post::views::Views;
use dem_mpi::post::{Report, Settings, analyse};
use serde_json::Value;
use std::fs::File;
use std::path::Path;
use std::process::Command;

/// Ellipsoids thrown onto the floor of a closed box.
const FALLING: &str = r#"
title = "falling"
gravity = [0.0, 0.0, -9.81]
[domain]
low = [0.0, 0.0, 0.0]
high = [0.02, 0.02, 0.02]
walls = ["-x", "+x", "-y", "+y", "-z", "+z"]
[[material]]
name = "grain"
density = 265000.0
normal_stiffness = 1.5e5
friction = 0.3
restitution = 0.5
[[shape]]
name = "long"
kind = "ellipsoid"
diameter = 0.003
aspect_ratio = 2.0
[[fill.lattice]]
shapes = ["long"]
low = [0.0, 0.0, 0.0]
high = [0.02, 0.02, 0.02]
spacing = 0.0049
velocity = [0.5, 0.3, -3.0]
[time]
step = 1e-5
steps = 300
"#;

/// Runs [`FALLING`], and leaves a snapshot of its end and its history in `directory`.
fn fall(directory: &Path, comm: &mut dyn Comm) {
    let scene = scene(FALLING);
    let mut sim = begun(&scene, comm);
    let (walls, cell) = (sim.particles.walls.clone(), sim.particles.cell);
    let mut history = comm.is_root().then(|| {
        table::History::open(directory, &walls, cell, &[], |_| false).expect("a new table")
    });
    for _ in 0..scene.steps {
        sim.step(comm).expect("the step is done");
        let measures = sim.measure(comm);
        if let Some(history) = &mut history {
            let (step, time) = (sim.step, sim.time());
            let (measures, forces) = (&measures, &*measures.wall_forces);
            let walls = &*sim.particles.walls;
            let row = table::Row { step, time, measures, forces, walls, own: &[] };
            history.push(&row).expect("a row");
        }
    }
    let header = sim.header("", &sim.measure(comm).wall_forces, comm);
    let (particles, contacts) = (sim.particle_table(comm.rank()), sim.contact_table());
    snapshot::write(directory, &header, &particles, &contacts, &sim.contact_records(), comm)
        .expect("a snapshot");
}

#[test]
fn a_run_s_files_give_its_numbers_and_its_page_whoever_wrote_them() {
    let (one, three) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    fall(one.path(), &mut Alone::default());
    threads::run(3, |comm| fall(three.path(), comm));
    let reader = Reader::open(one.path()).unwrap();
    let analysis = analyse(&reader, "falling", Settings::default()).unwrap();
    let report = analysis.report;
    let s = &report.summary;

    let header = reader.header();
    let particles = reader.particles(0..reader.particle_count()).unwrap();
    let contacts = reader.contacts(0..reader.contact_count().unwrap()).unwrap();
    assert_eq!((s.step, s.particles), (300, 64));
    let with_walls = contacts.b.iter().filter(|b| b.wall_index().is_some()).count();
    let between = contacts.b.len() - with_walls;
    assert!(between > 20 && with_walls > 10, "{between} contacts, {with_walls} with walls");
    assert_eq!(s.contacts_between_particles, between as f64);
    assert_eq!(s.contacts_with_walls, with_walls as u64);
    assert_eq!(s.coordination, Some(2.0 * between as f64 / 64.0));
    let ends: i32 = particles.coordination.iter().sum();
    assert_eq!(s.coordination_with_walls, Some(f64::from(ends) / 64.0));

    let volume = (header.cell.corners().1 - header.cell.corners().0).product();
    close(s.volume_m3.unwrap() / volume, 1.0, ROUNDING, "volume");
    let solid = 64.0 * header.shapes[0].volume / volume;
    close(s.solid_fraction.unwrap(), solid, ROUNDING, "solid fraction");
    let rows = 0..contacts.a.len();
    let products = rows.map(|row| contacts.force(row) * contacts.branch[row].transpose());
    let stress = products.fold(Mat3::zeros(), |sum, product| sum + product) / volume;
    close_matrix(&report.stress_pa.unwrap().tensor, &stress, ROUNDING, "stress");
    let forces = contacts.normal_force.iter().zip(&contacts.b);
    let pair_forces = forces.filter(|(_, b)| b.wall_index().is_none()).map(|(force, _)| force);
    let mean_force = pair_forces.sum::<f64>() / between as f64;
    close(s.mean_normal_force_n.unwrap() / mean_force, 1.0, ROUNDING, "mean normal force");

    let of_three = Reader::open(three.path()).unwrap();
    let other = analyse(&of_three, "falling", Settings::default()).unwrap();
    let text = |report: &Report| serde_json::to_string(report).unwrap();
    assert_eq!(text(&report), text(&other.report));
    let picture = analysis.picture.svg(report.bounds_m.as_ref());
    assert_eq!(picture, other.picture.svg(report.bounds_m.as_ref()));

    let history = |place: &Path| History::read(File::open(place.join("history.csv")).unwrap());
    let run = history(one.path()).unwrap();
    assert_eq!(run, history(three.path()).unwrap());
    let targets = servo::targets(&header.drives);
    let views = |reader: &Reader| Views::of(reader, &report.bounds_m.unwrap()).unwrap();
    let (views, of_three) = (views(&reader), views(&of_three));
    assert_eq!(views.plots().unwrap(), of_three.plots().unwrap());
    let (walls, views) = (&header.walls, Some(&views));
    let sections = page::sections(&[report], None, picture, views, &run, walls, &targets).unwrap();
    let reports = [other.report];
    let page = Page {
        title: "falling",
        command: "",
        warnings: &[],
        reports: &reports,
        requested: &[],
        sections: &sections,
    };
    let names: Vec<&str> = page.plots().map(|plot| plot.name.as_str()).collect();
    let of_snapshot = [
        "packing",
        "force_chains",
        "velocity_field",
        "profile_density",
        "profile_stress",
        "rose_normals",
        "rose_normal_forces",
        "rose_shear_forces",
        "coordination",
        "force_distribution",
        "weak_forces",
        "friction",
    ];
    let of_run = [
        "counts",
        "coordination",
        "energy",
        "losses",
        "largest_overlap",
        "mean_normal_force",
        "largest_speed",
        "top",
        "unbalanced",
        "wall_loads",
    ]
    .map(|name| format!("history_{name}"));
    let expected = of_snapshot.into_iter().chain(of_run.iter().map(String::as_str));
    assert_eq!(names, expected.collect::<Vec<_>>());
    let html = page.html();
    for plot in page.plots() {
        assert!(html.contains(&format!("<h3>{}</h3>", plot.title)), "{}", plot.name);
    }
    assert!(page.plots().last().unwrap().svg.contains("+z"), "walls stand in the legend");
}

#[test]
fn the_table_has_one_row_per_snapshot_and_names_units() {
    let report = ellipsoids(3, 9).report();
    let mut table = csv::Writer::from_writer(Vec::new());
    table.serialize(&report.summary).unwrap();
    table.serialize(&report.summary).unwrap();
    let text = String::from_utf8(table.into_inner().unwrap()).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 3);
    for key in ["time_s", "p_pa", "q_over_p", "height_m", "mean_normal_force_n", "a_c"] {
        assert!(lines[0].split(',').any(|k| k == key), "{key}");
    }
    // The number has enough digits to give back its bits.
    let text = serde_json::to_string(&report).unwrap();
    let p = text.split("\"p_pa\":").nth(1).and_then(|t| t.split(',').next()).unwrap();
    assert_eq!(p.parse::<f64>().ok(), report.summary.p_pa);
    // Tensors by rows.
    let rows = &serde_json::from_str::<Value>(&text).unwrap()["stress_pa"];
    close(number(&rows[0][2]), report.summary.stress_xz_pa.unwrap(), ROUNDING, "σ_xz");
}

#[test]
fn wrong_arguments_end_in_one_message_and_status_2() {
    let directory = tempfile::tempdir().unwrap();
    let empty = directory.path().to_str().unwrap();
    for (arguments, expected) in [
        (vec!["no/such/file.vtkhdf"], "no snapshot no/such/file.vtkhdf"),
        (vec![empty], "contains no snapshot"),
        (vec!["out/contacts_000000001.vtkhdf"], "only contact files"),
        (vec!["--diff", "Cargo.toml"], "--diff takes two snapshots, not 1"),
        (vec!["Cargo.toml", "--region", "0,1,0"], "six numbers"),
        (vec!["Cargo.toml", "--region", "0,1,0,1,0,high"], "'high'"),
        (vec![], "<SNAPSHOT>"),
        (vec![empty, "--series"], "contains no snapshot"),
        (vec!["Cargo.toml", "--margin", "wide"], "particle diameters"),
    ] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_dem-post"))
            .args(&arguments)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(expected), "{arguments:?}: {message}");
        assert!(!message.contains("panicked"), "{message}");
    }
}

fn ended(command: &mut Command) -> (Option<i32>, String) {
    let output = command.output().expect("the program can be started");
    (output.status.code(), String::from_utf8(output.stderr).expect("text"))
}

type Change<'a> = &'a dyn Fn(&mut Header);

/// Snapshots of different runs are no series: strains and rates would refer to another run's packing.
#[test]
fn snapshots_of_different_runs_are_no_series() {
    let run = ellipsoids(2, 7);
    let earlier = |change: Change| {
        let mut other = run.clone();
        other.header.step = 500;
        other.header.time *= 0.5;
        change(&mut other.header);
        other
    };
    let others: [(Change, Option<&str>); 5] = [
        (&|_| (), None),
        (&|header| header.time *= 4.0, Some("step 500 is at")),
        (&|header| header.next_id += 1, Some("by step 500 there have been")),
        (&|header| header.shapes[0].volume *= 2.0, Some("in one and a")),
        (
            &|header| header.shapes.iter_mut().for_each(|s| s.name.push('2')),
            Some("no shape in common"),
        ),
    ];
    for (change, says) in others {
        let folder = tempfile::tempdir().unwrap();
        let runs = ["one", "two"].map(|name| folder.path().join(name));
        store(&runs[0], &earlier(change));
        store(&runs[1], &run);
        let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
        let (status, message) = ended(dem_post.args(&runs).arg("--series"));
        assert_eq!(status, Some(if says.is_some() { 2 } else { 0 }), "{message}");
        let Some(says) = says else { continue };
        assert_eq!(message.lines().count(), 1, "{message}");
        for text in
            ["one/particles_000000500", "two/particles_000001000", "are of different runs", says]
        {
            assert!(message.contains(text), "no {text} in {message}");
        }
    }
}

/// Warnings appear in the terminal, on the page and in the report.
#[test]
fn the_program_tells_what_is_doubtful() {
    let folder = tempfile::tempdir().unwrap();
    store(folder.path(), &ellipsoids(2, 7));
    for (margin, out) in [(&[][..], "post"), (&["--margin", "0.0005", "--out"], "inner")] {
        let out = folder.path().join(out);
        let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
        dem_post.arg(folder.path()).args(margin);
        let made = if margin.is_empty() { &mut dem_post } else { dem_post.arg(&out) };
        let said = String::from_utf8(made.output().unwrap().stdout).unwrap();
        let doubt =
            "towards +z the box of the packing ends at the outermost particle, even in flight";
        assert!(said.contains(&format!("\nwarning: {doubt}")), "{said}");
        let read = |file: &str| std::fs::read_to_string(out.join(file)).unwrap();
        assert!(read("index.html").contains(&format!("Warning: {doubt}")));
        let reports: Vec<Report> = serde_json::from_str(&read("report.json")).unwrap();
        assert!(matches!(&reports[0].doubts[..], [one] if one.starts_with(doubt)));
    }
}

#[test]
fn two_snapshots_of_one_step_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let runs = ["one", "two"].map(|name| folder.path().join(name));
    for run in &runs {
        store(run, &ellipsoids(2, 7));
    }
    let dem_post = || Command::new(env!("CARGO_BIN_EXE_dem-post"));
    let (status, message) = ended(dem_post().args(&runs));
    assert_eq!(status, Some(2), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    for text in ["one/particles_000001000", "two/particles_000001000", "of step 1000", "--diff"] {
        assert!(message.contains(text), "{message}");
    }
    assert!(!runs[1].join("post").exists(), "nothing is written");
    // One file named twice is one snapshot.
    let (status, message) = ended(dem_post().args([&runs[0], &runs[0]]));
    assert_eq!(status, Some(0), "{message}");
}

#[test]
fn a_series_may_be_longer_than_a_process_may_open_files() {
    let folder = tempfile::tempdir().unwrap();
    let mut snapshot = ellipsoids(2, 7);
    for step in 0..30 {
        snapshot.header.step = step;
        snapshot.header.time = step as f64;
        store(folder.path(), &snapshot);
    }
    let limited = ["-c", r#"ulimit -n 28; exec "$0" "$@""#, env!("CARGO_BIN_EXE_dem-post")];
    let mut dem_post = Command::new("sh");
    dem_post.args(limited).arg(folder.path()).args(["--series", "--lammps"]);
    let (status, message) = ended(&mut dem_post);
    assert_eq!(status, Some(0), "{message}");
    let written = folder.path().join("post_series");
    let table = std::fs::read_to_string(written.join("report.csv")).unwrap();
    assert_eq!(table.lines().count(), 31);
    // Snapshots are at 0, 1, ... 29 s.
    let pictures = std::fs::read_to_string(written.join("snapshots.svg")).unwrap();
    let place = |time: &str| pictures.find(&format!(">{time} s</text>")).expect("a title");
    assert!(place("0") < place("15.00") && place("15.00") < place("29.00"));
    assert_eq!(pictures.matches("font-size=\"14\"").count(), 3);
    let dumps = written
        .read_dir()
        .unwrap()
        .flatten()
        .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "dump"));
    assert_eq!(dumps.count(), 30);
}

/// One list for a viewer: surfaces of particles, walls and contacts of each snapshot with its time.
#[test]
fn surfaces_of_a_series_stand_in_one_list() {
    let folder = tempfile::tempdir().unwrap();
    let mut snapshot = ellipsoids(2, 7);
    for step in [500, 1000] {
        snapshot.header.step = step;
        snapshot.header.time = 1e-3 * step as f64;
        store(folder.path(), &snapshot);
    }
    let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
    dem_post.arg(folder.path()).args(["--series", "--surfaces", "--detail", "0"]);
    let (status, message) = ended(&mut dem_post);
    assert_eq!(status, Some(0), "{message}");
    let written = folder.path().join("post_series");
    let rows = |list: &str| -> Vec<(String, String, String)> {
        let text = std::fs::read_to_string(written.join(list)).unwrap();
        let value = |line: &str, key: &str| {
            let rest = line.split_once(&format!("{key}=\"")).unwrap_or_else(|| panic!("{line}")).1;
            rest.split('"').next().unwrap().to_owned()
        };
        let sets = text.lines().filter(|line| line.starts_with("<DataSet "));
        sets.map(|line| (value(line, "timestep"), value(line, "part"), value(line, "file")))
            .collect()
    };
    let mut expected = Vec::new();
    for (time, step) in [("5e-1", 500), ("1e0", 1000)] {
        for (part, name) in ["grains", "walls", "contacts"].iter().enumerate() {
            let file = format!("{name}_{step:09}.vtp");
            assert!(written.join(&file).is_file(), "{file}");
            expected.push((time.to_owned(), part.to_string(), file));
        }
    }
    assert_eq!(rows("all.pvd"), expected);
    // Each kind has its own list, too.
    for (part, list) in ["grains.pvd", "walls.pvd", "contacts.pvd"].iter().enumerate() {
        let of_part = expected.iter().filter(|row| row.1 == part.to_string());
        let own: Vec<_> =
            of_part.map(|row| (row.0.clone(), "0".to_owned(), row.2.clone())).collect();
        assert_eq!(rows(list), own);
    }
}
