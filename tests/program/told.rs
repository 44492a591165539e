//! Queries before a run, and messages of a run: printed once on any number of ranks.

use super::process::{Launch, dem_mpi};
use super::{column, fresh_directory, scene};

const LAUNCHES: [Launch; 2] = [Launch::Alone, Launch::Ranks(2)];

#[test]
fn questions_are_answered_once() {
    let heap = &*scene("heap");
    let version = concat!("dem-mpi ", env!("CARGO_PKG_VERSION"));
    let answers: [(&[&str], &[&str]); 9] = [
        (&[heap, "--check"], &["heap.toml: no errors found"]),
        (
            &[heap, "--plan"],
            &[
                "A heap in a corner",
                "ellipsoid of stone",
                "Left out",
                "no period counts",
                "run time",
            ],
        ),
        (&["--self-test"], &["developers' machine", "all tests passed"]),
        (&["--help"], &["Usage: dem-mpi", "--start <SNAPSHOT>", "Exit status: 0"]),
        (&["--version"], &[version]),
        (&["--keys", "stop"], &["[stop]\n", "  unbalanced  "]),
        (&["--schema"], &["http://json-schema.org/draft-07/schema#"]),
        (&["--completion", "bash"], &["_dem__mpi() {"]),
        (&["--man"], &[".TH dem-mpi 1"]),
    ];
    for launch in LAUNCHES {
        let directory = fresh_directory("questions");
        for (arguments, texts) in &answers {
            let ended = dem_mpi(launch, *arguments).from(&directory).succeed();
            for text in *texts {
                ended.said_once(text);
            }
            assert_eq!(ended.errors, "", "{ended}");
        }
        assert_eq!(directory.read_dir().unwrap().count(), 0, "a question leaves no files");
    }
}

/// The plan is for the actual number of ranks.
#[test]
fn the_plan_knows_the_ranks() {
    dem_mpi(Launch::Ranks(2), [&*scene("heap"), "--plan"]).succeed().said_once("(2 ranks)");
}

/// Number of steps until particles touch walls and each other.
const STEPS: u64 = 700;

#[test]
fn every_contact_method_runs() {
    for method in ["common-normal", "gjk-erosion", "epa"] {
        let directory = fresh_directory(method);
        let set = format!("contact.method={method}");
        let (out, steps) = (directory.to_str().unwrap(), STEPS.to_string());
        let arguments = [&*scene("heap"), "--set", &set, "--out", out, "--steps", &steps];
        let ended = dem_mpi(Launch::Ranks(2), arguments).succeed();
        ended.said_once(&format!(
            "A heap in a corner: contact method {method}, 2 ranks, steps 0 to {STEPS}"
        ));
        ended.said_once("all steps done");
        assert_eq!(
            ended.errors.contains("collisions gain or lose energy"),
            method == "gjk-erosion",
            "{ended}"
        );
        ended.said_once(&format!("particles_{STEPS:09}.vtkhdf"));
        assert!(column(&directory, "contacts")[&STEPS] > 50.0, "{ended}");
    }
}
