//! The tables of the sensitivity study against those of the record, and its triaxial tests.

use crate::machine::Machine;
use lai2021::sensitivity::plot::Plot;
use lai2021::sensitivity::table::Table;
use std::path::{Path, PathBuf};

fn recorded(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    root.join("benchmarks/records/2026-11-sensitivity").join(name)
}

fn table(name: &str) -> Table {
    Table::read(&recorded(name)).unwrap()
}

fn same(text: &str, name: &str) {
    let known = std::fs::read_to_string(recorded(name)).unwrap();
    assert!(text == known, "{name}:\n{text}");
}

#[test]
fn means_are_those_of_the_record() {
    let states = ["axial_strain", "volumetric_strain", "p_pa", "q_over_p", "coordination"];
    let of_gravity = table("gravity.csv").means(&["gravity", "state"], &states).unwrap();
    same(&of_gravity.text(), "gravity_means.csv");
    let values = ["solid_fraction", "coordination", "mechanical_coordination"];
    let of_shape = table("aspect.csv").means(&["aspect_ratio", "friction"], &values).unwrap();
    same(&of_shape.text(), "aspect_means.csv");
    let responses = table("response.csv");
    let values: Vec<&str> = responses.names().skip(4).collect();
    let of_responses = responses.means(&["method", "erosion_ratio", "stiffness_n_per_m"], &values);
    same(&of_responses.unwrap().text(), "response_means.csv");
}

#[test]
fn a_mean_of_a_row_without_a_value_is_none() {
    let mut table = Table::new("kind,x");
    table.push("a,1", []);
    table.push("b,", []);
    table.push("a,2", []);
    let means = table.means(&["kind"], &["x"]).unwrap().text();
    assert_eq!(means, "kind,packings,x,x_deviation\na,2,1.5,0.71\nb,1,,\n");
    assert!(table.means(&["kind"], &["y"]).unwrap_err().to_string().contains("no column y"));
}

#[test]
fn drawings_are_those_of_the_record() {
    let draw = |name: &str, x, y, by, range, curve| {
        Plot { x, y, by, range, curve }.svg(&table(name)).unwrap()
    };
    let by_shape = |y, range| draw("aspect_means.csv", "aspect_ratio", y, "friction", range, None);
    same(&by_shape("solid_fraction", [0.55, 0.75]), "solid_fraction.svg");
    same(&by_shape("coordination", [4.0, 10.0]), "coordination.svg");
    let by_rate =
        |y, range| draw("rate_curves.csv", "axial_strain", y, "rate_mm_per_s", range, Some(0.05));
    same(&by_rate("q_over_p", [0.0, 1.5]), "rate.svg");
    same(&by_rate("volumetric_strain", [-0.1, 0.05]), "rate_volume.svg");
}

#[test]
fn tests_with_and_without_gravity_are_set_beside_each_other() {
    let machine = Machine::new("");
    let words = ["--only", "gravity", "--seeds", "1"];
    let (status, said) = machine.run("sensitivity", &words);
    assert_eq!(status, Some(0), "{said}");
    let calls = machine.calls();
    let with_gravity = |call: &&String| call.contains("gravity=[0.0, 0.0, -9.81]");
    assert_eq!((calls.len(), calls.iter().filter(with_gravity).count()), (6, 2));
    let rows = Table::read(&machine.path("out/report/gravity.csv")).unwrap();
    let states: Vec<&str> = rows.column("state").unwrap().collect();
    assert_eq!(states, ["packing", "consolidation", "peak", "end", "plateau"].repeat(2));
    // The mean of ln(20/15.5) and ln(20/14.5).
    let strains: Vec<&str> = rows.column("axial_strain").unwrap().collect();
    assert_eq!((strains[3], strains[4]), ("0.3216", "0.2882"));
    let record = machine.text("out/report/machine_gravity.txt");
    let command = "command  run/paper/sensitivity/run --only gravity --seeds 1 --grains 600 --lid 5 --jobs 2\n";
    assert!(record.starts_with(command), "{record}");
}

#[test]
fn responses_come_from_tests_of_their_own() {
    let machine = Machine::new("");
    let (status, said) = machine.run("sensitivity", &["--only", "response", "--seeds", "1"]);
    assert_eq!(status, Some(0), "{said}");
    let rows = Table::read(&machine.path("out/report/response.csv")).unwrap();
    let ratios: Vec<&str> = rows.column("erosion_ratio").unwrap().collect();
    assert_eq!(ratios, ["0", "0.05", "0.01", "0.05"].repeat(2));
    let calls = machine.calls();
    assert_eq!(calls.len(), 24);
    assert!(calls.iter().all(|call| call.starts_with("-n 1 ")), "{calls:?}");
    let fine = calls.iter().filter(|call| call.contains("contact.erosion_ratio=0.01"));
    assert_eq!(fine.count(), 6);
    // Finished tests are not run again.
    assert_eq!(machine.run("sensitivity", &["--only", "response", "--seeds", "1"]).0, Some(0));
    assert_eq!(machine.calls().len(), 24);
}

/// Both rates start from one consolidated packing.
#[test]
fn rates_are_compared_by_their_curves() {
    let machine = Machine::new("");
    for _ in 0..2 {
        let (status, said) = machine.run("sensitivity", &["--only", "rate"]);
        assert_eq!(status, Some(0), "{said}");
        assert_eq!(machine.calls().len(), 4);
    }
    let apart = machine.text("out/report/rate_apart.csv");
    assert_eq!(apart, "curve,rms_difference,share\nq_over_p,0,0\nvolumetric_strain,0,0\n");
    let curves = Table::read(&machine.path("out/report/rate_curves.csv")).unwrap();
    let rates: Vec<&str> = curves.column("rate_mm_per_s").unwrap().collect();
    assert_eq!(rates, ["1", "1", "1", "1", "10", "10", "10", "10"]);
}

#[test]
fn a_run_that_fails_ends_the_others() {
    let machine = Machine::new("exit 9");
    let (status, said) = machine.run("sensitivity", &["--only", "response", "--seeds", "1"]);
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("has not ended well"), "{said}");
    assert!(machine.calls().len() <= 2, "{:?}", machine.calls());
    assert_eq!(machine.run("sensitivity", &["--only", "shape"]).0, Some(2));
}
