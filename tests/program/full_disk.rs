//! A full disk ends the run with a clear error, and the last good snapshot stays.

use super::process::{Call, Launch, dem_mpi};
use super::{assert_same_result, fresh_directory, heap, scene};
use dem_mpi::output::snapshot::Reader;
use std::fs;
use std::path::{Path, PathBuf};

/// Exit status of a failed run.
const FAILED: i32 = 1;

/// Size of the disk, enough for some snapshots of the heap but not for all.
const ROOM: &str = "5m";

/// Environment variable for machines or users that cannot mount a file system.
const SKIP: &str = "DEM_MPI_SKIP_FULL_DISK";

/// A small file system, unmounted when dropped.
struct Disk(PathBuf);

impl Disk {
    /// `None` where mounting fails and [`SKIP`] is set.
    fn mount(kind: &str, launch: Launch) -> Option<Self> {
        let directory = fresh_directory(&format!("disk_{kind}_{launch:?}"));
        let place = directory.to_str().unwrap();
        let image = format!("{place}.image");
        let command = match kind {
            "tmpfs" => format!("mount -t tmpfs -o size={ROOM} tmpfs '{place}'"),
            _ => format!(
                "rm -f '{image}' && truncate -s {ROOM} '{image}' && mkfs.ext2 -q -m 0 '{image}' && \
                 mount -o loop '{image}' '{place}'"
            ),
        };
        let ended = Call::new(vec![], "sh", ["-c", &command]).end();
        if ended.status.success() {
            return Some(Self(directory));
        }
        assert!(
            std::env::var_os(SKIP).is_some(),
            "no {kind} can be mounted here, which takes root and loop devices: {SKIP}=1 skips this test. {ended}"
        );
        println!(
            "skipped on {kind}: {SKIP} is set, and none can be mounted here: {}",
            ended.errors
        );
        None
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        // Lazy unmounting, because programs of concurrent tests may hold files that HDF5 had open here.
        let _ = std::process::Command::new("umount").arg("-l").arg(&self.0).status();
    }
}

/// `tmpfs` reserves blocks. `ext2` cannot, and would let a collective write hang. Where neither can be mounted,
/// `DEM_MPI_SKIP_FULL_DISK=1` lets the test pass.
#[test]
fn a_full_disk_ends_the_run_and_keeps_the_last_snapshot() {
    for kind in ["tmpfs", "ext2"] {
        for launch in [Launch::Alone, Launch::Ranks(3)] {
            if let Some(disk) = Disk::mount(kind, launch) {
                fill(&disk.0, launch);
            }
        }
    }
}

fn fill(disk: &Path, launch: Launch) {
    let out = disk.join("out");
    let out = out.to_str().unwrap();
    let heap_scene = &*scene("heap");
    let every = "output.snapshot_every=50";
    let ended = dem_mpi(launch, [heap_scene, "--out", out, "--set", every]).end();
    assert_eq!(ended.status.code(), Some(FAILED), "{ended}");
    ended.said_once("cannot write ");
    ended.said_once("No space left on device");
    ended.said_once("Earlier snapshots are intact");
    for text in ["panicked", "met a bug", "HDF5-DIAG"] {
        assert!(!ended.said().contains(text), "{text}: {ended}");
    }
    let names = fs::read_dir(out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    let partial: Vec<_> = names.filter(|name| name.ends_with(".partial")).collect();
    assert!(partial.is_empty(), "{partial:?} takes room: {ended}");
    let last = Reader::open(Path::new(out)).unwrap();
    last.verify().unwrap();
    assert!(last.header().step > 0 && last.passed_over().is_empty(), "{ended}");

    // The run continues on a disk with room.
    let elsewhere = fresh_directory("disk_elsewhere");
    for entry in fs::read_dir(out).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), elsewhere.join(entry.file_name())).unwrap();
    }
    let to = elsewhere.to_str().unwrap();
    dem_mpi(Launch::Alone, [heap_scene, "--out", to, "--start", to]).succeed();
    assert_same_result(&heap(Launch::Alone).directory, &elsewhere);
}
