//! Search for a fault of a run on many ranks: steps are repeated on one rank, and a particle is
//! traced.

use super::process::{Launch, dem_mpi};
use super::{fresh_directory, heap, scene, snapshot};
use std::collections::BTreeMap;

const STEPS: usize = 40;

/// From a snapshot of a run on four ranks, one rank, three ranks and threads give identical traces.
/// The forces of the contacts add up to that of the particle, bit for bit.
#[test]
fn a_trace_is_the_same_on_any_number_of_ranks() {
    let whole = heap(Launch::Ranks(4));
    let start = snapshot(&whole.directory, 2000);
    let directory = fresh_directory("traced");
    let (out, start, steps) =
        (directory.to_str().unwrap(), start.to_str().unwrap(), STEPS.to_string());
    let trace = |launch, more: &[&str]| -> Vec<String> {
        let heap_scene = &*scene("heap");
        let arguments = [
            heap_scene,
            "--out",
            out,
            "--start",
            start,
            "--steps",
            &steps,
            "--trace-particle",
            "17",
            "--overwrite",
        ];
        let ended = dem_mpi(launch, [&arguments[..], more].concat()).succeed();
        let lines = ended.output.lines().filter(|line| line.starts_with("trace "));
        lines.map(str::to_owned).collect()
    };
    let alone = trace(Launch::Alone, &[]);
    assert_eq!(trace(Launch::Ranks(3), &[]), alone);
    assert_eq!(trace(Launch::Alone, &["--threads", "3"]), alone);

    let vector = |record: &BTreeMap<&str, &str>, name: &str| -> Vec<f64> {
        record[name].split(',').map(|number| number.parse().unwrap()).collect()
    };
    let mut expected = Vec::new();
    let mut contacts = 0;
    let (mut particles, mut left) = (0, 0);
    let mut sum = vec![0.0; 3];
    for line in &alone {
        let record: BTreeMap<_, _> =
            line.split(' ').skip(1).map(|field| field.split_once('=').unwrap()).collect();
        if let Some(count) = record.get("contacts") {
            assert_eq!((&sum, left), (&vec_or_zeros(&expected), 0), "{line}");
            expected = vector(&record, "force");
            left = count.parse().unwrap();
            sum = vec![0.0; 3];
            particles += 1;
        } else {
            for (total, force) in sum.iter_mut().zip(vector(&record, "force")) {
                *total += force;
            }
            contacts += 1;
            left -= 1;
        }
    }
    assert_eq!((sum, left), (expected, 0));
    assert_eq!(particles, STEPS);
    assert!(contacts > STEPS, "{contacts} contacts: too few to tell anything");
}

fn vec_or_zeros(vector: &[f64]) -> Vec<f64> {
    if vector.is_empty() { vec![0.0; 3] } else { vector.to_vec() }
}
