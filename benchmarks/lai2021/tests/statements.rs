//! The table of all statements: the conclusions follow from the findings, and the counts are those of the
//! rows.

use lai2021::findings::{Kind, Reading, Row, Verdict};
use lai2021::statements::predictions::{self, Packing, Response};
use lai2021::statements::{conclusions, regenerate};
use std::path::Path;
use std::process::Command;

fn row(part: &str, name: &str, reading: Reading, verdict: Verdict) -> Row {
    Row {
        part: part.into(),
        name: name.into(),
        kind: Kind::Statement,
        figure: "1".into(),
        statement: name.into(),
        reading,
        here: "a, number".into(),
        verdict,
    }
}

fn of(rows: &[Row], name: &str, reading: Reading) -> Verdict {
    rows.iter().find(|row| row.name == name && row.reading == reading).expect(name).verdict
}

#[test]
fn a_conclusion_has_the_worst_verdict_of_what_it_rests_on() {
    use Verdict::{Nearly, No, Untold, Yes};
    for (packing, peak, expected) in [
        (Some(Yes), Some(Yes), Yes),
        (Some(Nearly), Some(Yes), Nearly),
        (Some(No), Some(Yes), No),
        // One finding is unknown.
        (None, Some(Yes), Untold),
        (Some(Untold), Some(Yes), Untold),
        (Some(No), None, No),
        (None, None, Untold),
    ] {
        let reading = Reading::Checked;
        let given = [("fabric_packing", packing), ("fabric_peak", peak)];
        let found = given.into_iter().filter_map(|(name, v)| Some(row("3.4", name, reading, v?)));
        let rows = conclusions::rows(&found.collect::<Vec<_>>());
        assert_eq!(of(&rows, "fabric", reading), expected, "{packing:?} {peak:?}");
        // The other reading has no findings.
        assert_eq!(of(&rows, "fabric", Reading::Alone), Untold);
    }
}

/// Means of three packings each, with the values of the record of 2026-11.
#[test]
fn a_loss_of_contacts_that_softer_grains_do_not_have_is_a_prediction_come_true() {
    let packing = |method: &str, erosion_ratio, stiffness_n_per_m, coordination| Packing {
        method: method.into(),
        erosion_ratio,
        stiffness_n_per_m,
        packings: 3,
        coordination,
        coordination_deviation: 0.06,
    };
    let mut packings = vec![
        packing("common-normal", 0.0, 1.5e5, 7.76),
        packing("gjk-gjk-erosion", 0.05, 1.5e5, 6.85),
        packing("gjk-erosion", 0.05, 1.5e5, 7.80),
        packing("common-normal", 0.0, 1.5e4, 8.47),
        packing("gjk-gjk-erosion", 0.05, 1.5e4, 8.29),
        packing("gjk-erosion", 0.05, 1.5e4, 8.45),
        packing("gjk-erosion", 0.01, 1.5e4, 1.0),
    ];
    let verdict = |packings: &[Packing], reading| {
        of(&predictions::rows(packings, &[]), "softer_coordination", reading)
    };
    assert_eq!(verdict(&packings, Reading::Checked), Verdict::Yes);
    // There is no loss that could become smaller.
    assert_eq!(verdict(&packings, Reading::Alone), Verdict::No);
    packings[4].coordination = 7.8;
    assert_eq!(verdict(&packings, Reading::Checked), Verdict::Nearly);
    packings[4].coordination = 7.2;
    assert_eq!(verdict(&packings, Reading::Checked), Verdict::No);
    assert_eq!(verdict(&packings[..3], Reading::Checked), Verdict::Untold);
    let here = &predictions::rows(&packings, &[])[0].here;
    // The standard error of a difference of two means of three: 0.06 √(2/3).
    assert!(here.contains("by 0.91 ± 0.05 at 1.5e5 N/m"), "{here}");
}

#[test]
fn the_response_of_softer_grains_is_held_against_that_of_the_common_normal() {
    let response = |method: &str, erosion_ratio, stiffness_n_per_m, factor: f64| Response {
        method: method.into(),
        erosion_ratio,
        stiffness_n_per_m,
        peak_q_over_p: 1.2 * factor,
        plateau_q_over_p: 1.0,
        plateau_volumetric_strain: -0.05,
        peak_a_c: 1.5,
    };
    for (factor, expected) in [(1.02, Verdict::Yes), (0.93, Verdict::Nearly), (1.2, Verdict::No)] {
        let responses = [
            // Only the softest particles count.
            response("common-normal", 0.0, 1.5e5, 5.0),
            response("gjk-erosion", 0.05, 1.5e5, 1.0),
            response("common-normal", 0.0, 1.5e4, 1.0),
            response("gjk-erosion", 0.05, 1.5e4, factor),
        ];
        let rows = predictions::rows(&[], &responses);
        assert_eq!(of(&rows, "softer_response", Reading::Alone), expected, "{factor}");
        assert_eq!(of(&rows, "softer_response", Reading::Checked), Verdict::Untold);
    }
    // A volumetric strain near zero: 0.3 % off, a third of it, but 6 % of a strain of 5 %.
    let mut responses = vec![
        response("common-normal", 0.0, 1.5e5, 1.0),
        response("common-normal", 0.0, 1.5e4, 1.0),
        response("gjk-erosion", 0.05, 1.5e4, 1.0),
    ];
    for (strain, expected) in
        [(-0.012, Verdict::Yes), (-0.016, Verdict::Nearly), (-0.03, Verdict::No)]
    {
        responses[1].plateau_volumetric_strain = -0.009;
        responses[2].plateau_volumetric_strain = strain;
        let rows = predictions::rows(&[], &responses);
        assert_eq!(of(&rows, "softer_response", Reading::Alone), expected, "{strain}");
    }
}

fn run(arguments: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_lai2021")).args(arguments).output().unwrap();
    (output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// From the single contacts to the page.
#[test]
fn all_statements_are_counted() {
    let root = tempfile::tempdir().unwrap();
    let path = |name: &str| root.path().join(name);
    let (single, out) = (path("single"), path("out"));
    let (single_s, out_s) = (single.to_str().unwrap(), out.to_str().unwrap());
    let words = ["section-2", "--out", single_s, "--count", "1000", "--repeats", "1"];
    let (well, said) = run(&words);
    assert!(well, "{said}");

    let words = ["statements", single_s, "--out", out_s];
    let (well, said) = run(&words);
    assert!(well, "{said}");
    let text = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
    let rows: Vec<Row> = csv::Reader::from_reader(text("statements.csv").as_bytes())
        .deserialize()
        .collect::<Result<_, _>>()
        .unwrap();
    // Fig. 3 holds with one reading only: GJK before erosion finds no contact between separate bodies.
    assert_eq!(of(&rows, "spurious", Reading::Checked), Verdict::No);
    assert_eq!(of(&rows, "spurious", Reading::Alone), Verdict::Yes);
    // Statements that the independent reference refutes or confirms.
    for reading in Reading::ALL {
        assert_eq!(of(&rows, "normal_decreases", reading), Verdict::No);
        assert_eq!(of(&rows, "overlap_mean", reading), Verdict::No);
        assert_eq!(of(&rows, "touch", reading), Verdict::Yes);
        assert_eq!(of(&rows, "overestimates", reading), Verdict::Yes);
        assert_eq!(of(&rows, "small_overlaps", reading), Verdict::Yes);
        // There are no runs of section 3.
        assert_eq!(of(&rows, "stress_strain", reading), Verdict::Untold);
    }

    // The counts on the page are those of the rows, and the page has all statements.
    let page = text("statements.md");
    for (section, name) in [("2", "section 2"), ("4", "section 4, conclusions")] {
        for (reading, words) in [(Reading::Checked, "GJK + erosion"), (Reading::Alone, "alone")] {
            let count = |verdict: Verdict| {
                let is = |r: &&Row| {
                    r.kind == Kind::Statement
                        && r.part.starts_with(section)
                        && r.reading == reading
                        && r.verdict == verdict
                };
                rows.iter().filter(is).count()
            };
            let [yes, nearly, no, untold] =
                [Verdict::Yes, Verdict::Nearly, Verdict::No, Verdict::Untold].map(count);
            assert!(yes + nearly + no + untold > 10);
            let line = format!("| {name} | {words} | {yes} | {nearly} | {no} | {untold} |");
            assert!(page.contains(&line), "no {line} in\n{page}");
        }
    }
    for row in rows.iter().filter(|row| row.kind != Kind::Check) {
        assert!(page.contains(&format!("| {} |", row.statement)), "{}", row.statement);
    }
    assert!(rows.iter().any(|row| row.kind == Kind::Check), "for conclusions");
}

#[test]
fn without_findings_there_is_no_table() {
    let root = tempfile::tempdir().unwrap();
    let folder = root.path().to_path_buf();
    let why = |folder: &Path| regenerate(&[folder.to_path_buf()]).unwrap_err().to_string();
    assert!(why(&folder).contains("no findings.csv in"), "{}", why(&folder));
    std::fs::write(folder.join("findings.csv"), "part,name\n2,touch\n").unwrap();
    assert!(why(&folder).contains("findings.csv: CSV deserialize error"), "{}", why(&folder));
}

/// The committed table is that of the committed findings, and README has its counts.
#[test]
fn the_record_and_the_page_of_benchmarks_have_the_counts_of_the_findings() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let records = root.join("benchmarks/records");
    let folder = |name: &str| records.join(format!("2026-11-{name}"));
    let folders = ["single-contact", "triaxial", "sensitivity"].map(folder);
    let files = regenerate(&folders).unwrap();
    for (name, text) in &files {
        let committed = std::fs::read_to_string(folder("triaxial").join(name)).unwrap();
        assert!(committed == *text, "{name} is not what lai2021 statements writes");
    }
    let measured = std::fs::read_to_string(root.join("benchmarks/README.md")).unwrap();
    let page = &files.iter().find(|(name, _)| name == "statements.md").expect("a page").1;
    let counts: Vec<&str> = page
        .lines()
        .filter(|line| line.contains("| GJK + erosion |") || line.contains("| alone |"))
        .collect();
    assert_eq!(counts.len(), 8);
    for line in counts {
        assert!(measured.contains(line), "benchmarks/README.md has not {line}");
    }
}
