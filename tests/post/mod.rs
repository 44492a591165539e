//! Results computed from a snapshot, against closed forms and the independent reference.

mod drawings;
mod fabric;
mod files;
mod forms;
mod means;
mod measures;
mod pieces;
mod plots;
mod program;
mod region;
mod stress;

use crate::support::packings::Snapshot;
use crate::support::{json, number};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use dem_mpi::math::Mat3;
use dem_mpi::post::region::{Members, Region};
use serde_json::Value;

/// Relative tolerance: sums are exact, so only the rounding of each term and of the reference
/// remains.
const ROUNDING: f64 = 1e-12;

fn close(value: f64, expected: f64, tolerance: f64, what: &str) {
    let scale = expected.abs().max(1.0);
    assert!((value - expected).abs() <= tolerance * scale, "{what}: {value} but {expected}");
}

fn close_matrix(value: &Mat3, expected: &Mat3, tolerance: f64, what: &str) {
    let scale = expected.amax().max(1.0);
    assert!((value - expected).amax() <= tolerance * scale, "{what}: {value} but {expected}");
}

/// Access to the arrays of a VTK XML file by name; all have numbers of one type.
fn arrays<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(file: &[u8]) -> impl Fn(&str) -> Vec<T> {
    let text = String::from_utf8(file.to_vec()).unwrap();
    move |name: &str| {
        let (_, array) = text.split_once(&format!("Name=\"{name}\"")).unwrap();
        let (_, numbers) = array.split_once('>').unwrap();
        let bytes = STANDARD.decode(numbers.split('<').next().unwrap()).unwrap();
        // The array begins with its length.
        bytemuck::pod_collect_to_vec(&bytes[8..])
    }
}

fn matrix(value: &Value) -> Mat3 {
    Mat3::from_fn(|i, j| number(&value[i][j]))
}

fn members(snapshot: &Snapshot) -> Members {
    let mut members = Members::new(Region::Whole);
    members.add(&snapshot.header, &snapshot.particles).expect("sound ids");
    members
}
