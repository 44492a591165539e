//! Means of the history, and their places: terminal, page, report.json.

use crate::support::packings::{ellipsoids, plane_row, store};
use dem_mpi::math::Vec3;
use dem_mpi::output::header::WallRow;
use dem_mpi::post::flow::Window;
use dem_mpi::post::history::History;
use dem_mpi::post::means::{Mean, means, stress_path};
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::path::Path;
use std::process::Command;

/// History of a drum over 2 s. It turns by `rate` about an axis. The torque is `-3 + 0.5 sin(2π 5 t)` about the axis, and 7
/// across it.
fn turning(axis: Vec3, rate: f64) -> String {
    let mut table = "time_s,work_drum_J".to_owned();
    let names = ["torque_drum_{}_N_m", "angular_velocity_drum_{}_rad_per_s"];
    for (name, axis) in names.iter().flat_map(|name| ["x", "y", "z"].map(|axis| (name, axis))) {
        write!(table, ",{}", name.replace("{}", axis)).unwrap();
    }
    let side = axis.cross(&Vec3::new(0.3, 0.1, -0.9)).normalize();
    for row in 0..=200 {
        let time = 0.01 * f64::from(row);
        let torque = axis * (-3.0 + 0.5 * (TAU * 5.0 * time).sin()) + side * 7.0;
        // The work of a power of 2 W in the first second, then of 6 W.
        let work = 2.0 * time + 4.0 * (time - 1.0).max(0.0);
        write!(table, "\n{time},{work}").unwrap();
        for number in torque.iter().chain((axis * rate).iter()) {
            write!(table, ",{number}").unwrap();
        }
    }
    table + "\n"
}

fn found(table: &str, walls: &[WallRow], window: Option<Window>) -> Vec<Mean> {
    means(&History::read(table.as_bytes()).unwrap(), walls, window).unwrap()
}

fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() < tolerance, "{found} {expected}");
}

/// The mean torque is about the axis of rotation, whichever way the drum turns.
#[test]
fn a_drum_has_a_mean_torque_and_power() {
    let slanted = Vec3::new(0.6, 0.0, 0.8);
    for (axis, rate, quantity) in [
        (Vec3::y(), 3.0, "torque on drum about y"),
        (Vec3::y(), -3.0, "torque on drum about y"),
        (slanted, 3.0, "torque on drum about its axis"),
    ] {
        let table = turning(axis, rate);
        let [torque, power] = &found(&table, &[], None)[..] else { panic!("two means") };
        assert_eq!((torque.quantity.as_str(), torque.unit.as_str()), (quantity, "N m"));
        assert_eq!((power.quantity.as_str(), power.unit.as_str()), ("power of drum", "W"));
        // The last half has five periods: the scatter of a sine is its amplitude over √2.
        assert_eq!((torque.window, torque.rows), (Window { from: 1.0, to: 2.0 }, 101));
        close(torque.mean, -3.0, 1e-12);
        close(torque.scatter, 0.5 / 2.0_f64.sqrt(), 1e-9);
        close(power.mean, 6.0, 1e-9);
        close(power.scatter, 0.0, 1e-6);
        let window = Window { from: 0.5, to: 1.5 };
        let [torque, power] = &found(&table, &[], Some(window))[..] else { panic!("two means") };
        assert_eq!((torque.window, torque.rows, power.rows), (window, 101, 100));
        close(torque.mean, -3.0, 1e-12);
        close(power.mean, 4.0, 1e-9);
        close(power.scatter, 2.0 * (100.0_f64 / 99.0).sqrt(), 1e-9);
    }
    // A wall that stands has none, and no history has none.
    assert!(found(&turning(Vec3::y(), 0.0), &[], None).iter().all(|mean| mean.unit == "W"));
    assert!(found("time_s,work_drum_J\n", &[], None).is_empty());
    let empty = History::read("time_s,kinetic_J\n0,1\n1,2\n".as_bytes()).unwrap();
    let window = Some(Window { from: 0.0, to: 1.0 });
    let refused = means(&empty, &[], window).unwrap_err().to_string();
    assert!(refused.contains("nothing to average"), "{refused}");
    let drum = History::read(turning(Vec3::y(), 3.0).as_bytes()).unwrap();
    let window = Some(Window { from: 5.0, to: 6.0 });
    let refused = means(&drum, &[], window).unwrap_err().to_string();
    assert!(refused.contains("0 rows in the window"), "{refused}");
}

fn wall(name: &str, normal: Vec3) -> WallRow {
    plane_row(name, Vec3::zeros(), normal)
}

/// K0 and the stress path: from walls that stand across the axes, and from the tensor of a cell.
#[test]
fn stresses_give_a_ratio_and_a_path() {
    let walls = [
        wall("-x", Vec3::x()),
        wall("+x", -Vec3::x()),
        wall("-y", Vec3::y()),
        wall("lid", -Vec3::z()),
        wall("slanted", Vec3::new(0.6, 0.0, 0.8)),
    ];
    let table = "time_s,stress_-x_Pa,stress_+x_Pa,stress_-y_Pa,stress_lid_Pa,stress_slanted_Pa\n\
                 0,0,0,0,0,9\n1,30,50,60,100,9\n1.5,90,90,90,1,9\n2,100,100,100,200,9\n";
    let [ratio] = &found(table, &walls, None)[..] else { panic!("one mean") };
    assert_eq!((ratio.quantity.as_str(), ratio.rows), ("horizontal over vertical stress, K0", 2));
    close(ratio.mean, 0.5, 1e-12);
    close(ratio.scatter, 0.0, 1e-12);
    let history = History::read(table.as_bytes()).unwrap();
    let path = stress_path(&history, &walls);
    assert_eq!(path.len(), 4);
    let q = (0.5 * (20.0_f64.powi(2) + 40.0_f64.powi(2) + 60.0_f64.powi(2))).sqrt();
    close(path[1].0, 200.0 / 3.0, 1e-12);
    close(path[1].1, q, 1e-12);
    assert!(
        stress_path(&history, &walls[..3]).is_empty() && found(table, &walls[..3], None).is_empty()
    );
    // In pure shear p is 0, and q is √3 times the shear stress.
    let table = "time_s,contact_stress_xx_Pa,contact_stress_yy_Pa,contact_stress_zz_Pa,\
                 contact_stress_xy_Pa,contact_stress_xz_Pa,contact_stress_yz_Pa\n0,0,0,0,0,5,0\n1,1,3,4,0,0,0\n";
    let path = stress_path(&History::read(table.as_bytes()).unwrap(), &[]);
    close(path[0].0, 0.0, 1e-12);
    close(path[0].1, 5.0 * 3.0_f64.sqrt(), 1e-12);
    assert!(found(table, &[], None).is_empty(), "one row of the last half presses");
}

/// Runs dem-post, and returns its output, the page and the last report.
fn post(folder: &Path, arguments: &[&str]) -> (String, String, Value) {
    let mut dem_post = Command::new(env!("CARGO_BIN_EXE_dem-post"));
    let out = folder.join("page");
    let made = dem_post.arg(folder).args(arguments).arg("--out").arg(&out).output().unwrap();
    assert!(made.status.success(), "{made:?}");
    let read = |file: &str| std::fs::read_to_string(out.join(file)).unwrap();
    let reports: Vec<Value> = serde_json::from_str(&read("report.json")).unwrap();
    let said = String::from_utf8(made.stdout).unwrap();
    (said, read("index.html"), reports.last().unwrap().clone())
}

/// Numbers of the terminal are on the page, before all plots, and in report.json.
#[test]
fn means_and_slopes_are_told_alike_everywhere() {
    let folder = tempfile::tempdir().unwrap();
    store(folder.path(), &ellipsoids(6, 8));
    std::fs::write(folder.path().join("history.csv"), turning(Vec3::y(), 3.0)).unwrap();
    let (said, page, report) = post(folder.path(), &["--window", "0.5,1.5", "--mixing", "half:x"]);
    let of = "from 0.5000 s to 1.500 s (101 rows)";
    let line = format!("torque on drum about y: -3.000 ± 0.3536 N m, mean and scatter {of}\n");
    assert!(said.contains(&line), "{said}");
    let row = "<th scope=\"row\">torque on drum about y</th><td>-3.000 ± 0.3536</td><td>N m</td>";
    let at = page.find(row).unwrap_or_else(|| panic!("no row in {page}"));
    assert!(page[..at].contains("<h2>Results</h2>") && !page[..at].contains("<svg"));
    assert!(page.contains(&format!("Mean ± scatter, {of}")));
    let means = &report["measured"]["means"];
    let number = |key: &str| means[0][key].as_f64().unwrap();
    close(number("mean"), -3.0, 1e-12);
    close(number("scatter"), 0.3536, 1e-4);
    assert_eq!((number("from_s"), number("to_s"), number("rows")), (0.5, 1.5, 101.0));
    assert!(said.contains("the halves of a single snapshot"));
    let note = report["measured"]["notes"][0].as_str().unwrap();
    assert!(page.contains(note) && said.contains(note));
    let index = report["measured"]["mixing"]["index"].as_f64().unwrap();
    assert!(page.contains(&format!("Lacey's index</th><td>{index:.3}</td>")));
}

/// The page names its command, the title of the scene and the warnings of the run, after the results.
#[test]
fn a_page_has_its_command_and_the_warnings_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let mut snapshot = ellipsoids(3, 8);
    snapshot.header.scene = "title = \"Balls & more\"".into();
    store(folder.path(), &snapshot);
    let run = r#"{"warnings": ["the largest overlap is 9 % > 5 %", "a servo is off"]}"#;
    std::fs::write(folder.path().join("report.json"), run).unwrap();
    std::fs::write(folder.path().join("history.csv"), turning(Vec3::y(), 3.0)).unwrap();
    let (_, page, _) = post(folder.path(), &["--region", "0,1,0,1,0,1"]);
    let place = |text: &str| page.find(text).unwrap_or_else(|| panic!("no {text} in {page}"));
    let command = format!("<code>dem-post {} --region 0,1,0,1,0,1 --out ", folder.path().display());
    assert!(place("<h1>Balls &amp; more</h1>") < place(&command));
    assert!(place(&command) < place("<h2>Results</h2>"));
    let warnings = "<h2>Warnings</h2>\n<ul>\n<li>the largest overlap is 9 % &gt; 5 %</li>\n<li>a servo is off</li>";
    assert!(place("<h2>Results</h2>") < place(warnings) && place(warnings) < place("<svg"));
    assert!(page.contains("<a href=\"#section-warnings\">"));
}
