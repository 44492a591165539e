//! Section 2 of the paper against the independent reference, see `tests/reference/README.md`.

use dem_mpi::contact::Method;
use dem_mpi::pairs::read::read;
use dem_mpi::pairs::resolve;
use lai2021::cases::{self, Meeting, OFFSET, Sampling};
use lai2021::single_contact::statistics::Summary;
use lai2021::single_contact::study::{InCase3, at_offset, case_1, case_2, erosion, errors};
use std::collections::BTreeMap;
use std::process::{Command, Output};

/// GJK at a relative duality gap of 1e-14 finds the direction to the square root of the rounding error [rad]. This
/// limits the overlap [m] and the contact point [m] on surfaces with radii of curvature up to 8 m.
const DIRECTION: f64 = 1.5e-7;
const OVERLAP: f64 = 5e-8;
const POINT: f64 = 1e-6;

fn lai2021(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_lai2021")).args(arguments).output().unwrap()
}

type Row = BTreeMap<String, String>;

fn rows(csv: &[u8]) -> Vec<Row> {
    csv::Reader::from_reader(csv).deserialize().collect::<Result<_, _>>().unwrap()
}

fn reference(name: &str) -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/reference/").to_string() + name;
    std::fs::read_to_string(path).unwrap()
}

fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column} = {}", row[column]))
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Cases I and II have the positions of the reference.
#[test]
fn generated_cases_stand_where_the_reference_does() {
    for (case, file) in [("case-i", "caseI.csv"), ("case-ii", "caseII.csv")] {
        let made = rows(&lai2021(&["generate", case]).stdout);
        let known = rows(reference(file).as_bytes());
        assert_eq!(made.len(), known.len());
        for (made, known) in made.iter().zip(&known) {
            for column in ["aA", "bA", "cB", "xB", "yB", "zB"] {
                let off = (number(made, column) - number(known, column)).abs();
                assert!(off < 1e-14, "{} {column}: off by {off:e}", known["id"]);
            }
            // A rotation by 180° or more may have either sign.
            let q = |row| ["qwB", "qxB", "qyB", "qzB"].map(|c| number(row, c));
            let cosine: f64 = q(made).iter().zip(q(known)).map(|(a, b)| a * b).sum();
            assert!((cosine.abs() - 1.0).abs() < 1e-15, "{}", known["id"]);
        }
    }
    // Random pairs that were written and read again have the requested overlaps.
    let overlaps = |arguments: &[&str]| -> Vec<f64> {
        let made = String::from_utf8(lai2021(arguments).stdout).unwrap();
        let answers = resolve(&read("made", &made).unwrap(), &Method::Auto);
        answers.iter().map(|answer| answer.touch.unwrap().overlap).collect()
    };
    let touching = overlaps(&["generate", "case-iii", "--count", "200", "--seed", "3"]);
    assert_eq!(touching.len(), 200);
    assert!(touching.iter().all(|overlap| (1e-9..=0.05 + 1e-14).contains(overlap)));
    let apart = overlaps(&["generate", "case-iii-apart", "--count", "200"]);
    assert!(apart.iter().all(|overlap| (-1.0 - 1e-14..0.0).contains(overlap)));
}

#[test]
fn errors_of_case_1() {
    let known = rows(reference("paper_caseI.csv").as_bytes());
    for rows in known.chunk_by(|a, b| a["ratio_start"] == b["ratio_start"]) {
        let overlaps: Vec<f64> = rows.iter().map(|row| number(row, "overlap_target")).collect();
        let found = case_1(number(&rows[0], "ratio_start"), &overlaps).unwrap();
        for (found, row) in found.iter().zip(rows) {
            let off = (found.overlap_found_m - number(row, "overlap_erosion")).abs();
            assert!(off <= OVERLAP, "{row:?}: overlap off by {off:e}");
            let off = (found.normal_error_deg - number(row, "normal_err_deg")).abs();
            assert!(off <= DIRECTION.to_degrees(), "{row:?}: normal off by {off:e}");
            assert!(found.point_error_m < 1e-14, "{found:?}");
        }
    }
    // B at other offsets, and at larger overlaps.
    for row in rows(reference("paper_caseI_vs_y.csv").as_bytes()) {
        let found = at_offset(number(&row, "y"), &[0.0, 0.025, 0.05]).unwrap();
        for (found, column) in found.iter().zip(["normal_err_deg_at_0", "at_0.025", "at_0.05"]) {
            let off = (found.normal_error_deg - number(&row, column)).abs();
            assert!(off <= DIRECTION.to_degrees(), "{row:?} {column}: off by {off:e}");
        }
    }
    let known = rows(reference("paper_caseI_extended.csv").as_bytes());
    let overlaps: Vec<f64> = known.iter().map(|row| number(row, "overlap")).collect();
    for (found, row) in at_offset(OFFSET, &overlaps).unwrap().iter().zip(&known) {
        let off = (found.normal_error_deg - number(row, "normal_err_deg_start5pct")).abs();
        assert!(off <= DIRECTION.to_degrees(), "{row:?}: off by {off:e}");
    }
    // Clearances on both sides of the limit of spurious contacts.
    for row in rows(reference("paper_caseI_thresholds.csv").as_bytes()) {
        let limit = number(&row, "spurious_contact_below_clearance");
        let pairs = cases::case_1(OFFSET, &[OVERLAP - limit, -OVERLAP - limit]);
        let answers = resolve(&pairs, &erosion(number(&row, "ratio")));
        assert!(answers[0].touching && !answers[1].touching, "{row:?}");
    }
}

#[test]
fn errors_of_case_2() {
    let known = rows(reference("paper_caseII_map.csv").as_bytes());
    for rows in known.chunk_by(|a, b| a["ratio_start"] == b["ratio_start"]) {
        let (axes, angles) = (cases::steps(1.0, 4.0, 6), cases::steps(0.0, 180.0, 36));
        let found = case_2(number(&rows[0], "ratio_start"), &axes, &angles).unwrap();
        assert_eq!(found.len(), rows.len());
        for (found, row) in found.iter().zip(rows) {
            assert_eq!(found.long_axis_m, number(row, "long_axis"));
            assert_eq!(found.angle_deg, number(row, "theta_deg"));
            let off = (found.relative_overlap_error - number(row, "rel_err")).abs();
            assert!(off <= OVERLAP / 0.02, "{row:?}: overlap off by {off:e}");
            let off = (found.normal_error_deg - number(row, "normal_err_deg")).abs();
            assert!(off <= DIRECTION.to_degrees(), "{row:?}: normal off by {off:e}");
            let off = (found.point_error_m - number(row, "contact_point_err")).abs();
            assert!(off <= POINT, "{row:?}: point off by {off:e}");
        }
    }
}

fn check_summary(found: &Summary, known: &Row, tolerances: &[(&str, f64, f64)]) {
    for (column, value, tolerance) in tolerances {
        let expected = number(known, column);
        assert!(
            (value - expected).abs() <= tolerance * expected,
            "{} {column}: {value:e}, not {expected:e}",
            found.quantity
        );
    }
}

/// Names in `paper_caseIII_summary.csv`.
const QUANTITIES: [&str; 3] = ["overlap_rel", "normal_deg", "contact_point"];

/// Statistics of the same thousand pairs, and of other random pairs within their scatter.
#[test]
fn errors_of_case_3() {
    let known = rows(reference("paper_caseIII_summary.csv").as_bytes());
    let row = |set: &str, ratio: &str, sampling: &str, quantity: &str| -> Row {
        let wanted =
            [("set", set), ("ratio_start", ratio), ("sampling", sampling), ("quantity", quantity)];
        let is_it = |row: &&Row| wanted.iter().all(|(column, value)| row[*column] == *value);
        known.iter().find(is_it).unwrap_or_else(|| panic!("{wanted:?}")).clone()
    };
    let all = read("", &reference("caseIII_public.csv")).unwrap();
    for ratio in ["0.01", "0.02", "0.05", "0.1"] {
        let errors = errors(&all, &erosion(ratio.parse().unwrap())).unwrap();
        let contacts = &errors[..1000];
        assert!(contacts.iter().all(|e| e.overlap_m > 0.0) && errors[1000].overlap_m < 0.0);
        let columns: [Vec<f64>; 3] = [
            contacts.iter().map(|e| e.relative_overlap_error).collect(),
            contacts.iter().map(|e| e.normal_error_deg).collect(),
            contacts.iter().map(|e| e.point_error_m).collect(),
        ];
        for (errors, quantity) in columns.iter().zip(QUANTITIES) {
            let s = Summary::of("", "", quantity, errors);
            let tight = [
                ("log_mean", s.log_mean),
                ("p1", s.p1),
                ("p50", s.p50),
                ("p99", s.p99),
                ("max", s.max),
            ];
            let tight = tight.map(|(column, value)| (column, value, 2e-3));
            check_summary(&s, &row("public", ratio, "centreline-uniform", quantity), &tight);
        }
    }
    for (sampling, name) in
        [(Sampling::CentreLine, "centreline-uniform"), (Sampling::Normal, "normal-uniform")]
    {
        let pairs = cases::case_3(Meeting::Contact, sampling, 3000, 5);
        let found = InCase3::new("", "", &pairs, &erosion(0.05)).unwrap();
        for (s, quantity) in found.summaries().iter().zip(QUANTITIES) {
            let loose = [("log_mean", s.log_mean, 0.1), ("p50", s.p50, 0.1), ("p99", s.p99, 0.35)];
            check_summary(s, &row("population", "0.05", name, quantity), &loose);
        }
    }
}

#[test]
fn section_2_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    let output = lai2021(&["section-2", "--out", path, "--count", "1000", "--repeats", "1"]);
    assert!(output.status.success(), "{}", said(&output));
    let text = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    for name in ["fig5.svg", "fig6.svg", "fig7.svg", "fig8.svg"] {
        let svg = text(name);
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{name}");
        for bad in ["NaN", "inf", "2147483647", "-2147483648"] {
            assert!(!svg.contains(bad), "{name} holds {bad}");
        }
    }
    let table = rows(text("table1.csv").as_bytes());
    assert_eq!(table.len(), 12);
    assert!(table.iter().all(|row| number(row, "contact_ns") > 0.0));
    assert_eq!(rows(text("fig7.csv").as_bytes()).len(), 25 * 37);
    let report = text("report.md");
    assert!(!report.contains("NaN"), "{report}");
    // The two statements of the paper that do not hold according to the reference.
    for statement in
        ["the normal's error decreases with the overlap", "its logarithmic mean is about 1e-3"]
    {
        let line = report.lines().find(|line| line.contains(statement)).unwrap();
        assert!(line.ends_with("| **does not** |"), "{line}");
    }
}
