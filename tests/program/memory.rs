//! What a run tells of its memory is what the system sees, and what it holds for a moment is bounded.

use super::process::{Launch, dem_mpi};
use super::{fresh_directory, report, written};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Balls along an edge of the lattice: 50,653 of them, each touching six.
const ALONG: u32 = 37;
/// The most that a process may hold over what it has of its grains at the end, program and libraries apart. Measured: 2.09
/// on one rank and 2.34 on two, where half of a column is on its way to the rank that writes it (1.82 and 1.89 while rows were
/// written where they stood); with whole tables of contacts and histories for a snapshot it was 3.0.
const FACTOR: f64 = 2.5;

/// Balls on a lattice so narrow that neighbours touch: every list is full at once.
fn lattice(along: u32) -> String {
    let (radius, spacing) = (1e-3, 1.995e-3);
    let side = f64::from(along) * 2.0 * radius;
    format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[domain]
low = [0.0, 0.0, 0.0]
high = [{side}, {side}, {side}]
walls = ["-z"]
[[material]]
name = "glass"
density = 2500.0
normal_stiffness = 1e4
friction = 0.3
restitution = 0.5
[[shape]]
name = "ball"
kind = "sphere"
radius = {radius}
[[fill.lattice]]
first = [{radius}, {radius}, {radius}]
spacing = {spacing}
count = [{along}, {along}, {along}]
[time]
step = 1e-6
steps = 20
[output]
snapshot_every = 10
"#
    )
}

/// The report of a run of such a lattice, and the most that the system has seen in its first process [bytes].
fn run(along: u32, launch: Launch, directory: &Path) -> (Value, f64) {
    let (scene, out) = (written(directory, &lattice(along)), directory.join("out"));
    let arguments = [scene.as_ref(), "--out".as_ref(), out.as_os_str(), "--overwrite".as_ref()];
    let running = dem_mpi(launch, arguments).start();
    let status = format!("/proc/{}/status", running.id());
    let mut most = 0.0_f64;
    // A process that has ended has no such line.
    while let Some(held) = fs::read_to_string(&status).ok().and_then(|text| {
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok()
    }) {
        most = most.max(1024.0 * held);
        std::thread::sleep(Duration::from_millis(1));
    }
    let ended = running.end();
    assert_eq!(ended.status.code(), Some(0), "{ended}");
    (report(&out), most)
}

/// The most of a figure of the memory of any rank.
fn most(report: &Value, key: &str) -> f64 {
    report["memory"][key]["most"].as_f64().unwrap_or_else(|| panic!("no {key}: {report:#}"))
}

#[test]
fn the_peak_is_told_and_is_not_much_more_than_what_stays() {
    let directory = fresh_directory("memory");
    for launch in [Launch::Alone, Launch::Ranks(2)] {
        let (little, _) = run(2, launch, &directory);
        let (much, seen) = run(ALONG, launch, &directory);
        let [before, peak] = [&little, &much].map(|report| most(report, "peak_bytes"));
        let ranks = if launch == Launch::Alone { 1.0 } else { 2.0 };
        if launch == Launch::Alone {
            // Looked at from outside until shortly before the end.
            assert!((0.95..=1.02).contains(&(seen / peak)), "{seen} seen, {peak} told");
        }
        let owned = f64::from(ALONG).powi(3) / ranks;
        let per_owned = most(&much, "peak_bytes_per_owned");
        assert!((per_owned / (peak / owned) - 1.0).abs() < 0.05, "{per_owned}, of {much:#}");

        let grains = (peak - before) / owned;
        let stays = most(&much, "bytes_per_owned");
        println!(
            "{launch:?}: {grains:.0} bytes per grain at most, {stays} in the end, {before:.3e} without"
        );
        assert!(stays > 400.0, "no contacts? {much:#}");
        assert!(grains < FACTOR * stays, "{grains} bytes per grain at most, {stays} in the end");
    }
}
