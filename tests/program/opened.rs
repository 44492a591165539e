//! Snapshots of a real run in other programs.

use super::process::{Call, Ended, Launch, dem_mpi, dem_post};
use super::{HEAP_STEPS, finished, fresh_directory, heap, scene, snapshot};
use std::ffi::OsStr;
use std::fs;
use std::time::Duration;

/// Time limit with the first download of VTK (100 MB).
const WITH_DOWNLOAD: Duration = Duration::from_secs(600);
/// The script's exit status if VTK cannot be fetched.
const NO_VTK: i32 = 3;
const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/open_in_vtk.sh");

/// Whether VTK could not be fetched on a machine where that is expected.
fn may_skip(ended: &Ended) -> bool {
    let skips =
        ended.status.code() == Some(NO_VTK) && std::env::var_os("DEM_MPI_SKIP_VTK").is_some();
    if skips {
        println!("skipped: VTK cannot be fetched, and DEM_MPI_SKIP_VTK is set\n{}", ended.errors);
    }
    skips
}

/// VTK and h5py show the data of the run, from one rank and from several. On a machine that cannot reach
/// a package index, `DEM_MPI_SKIP_VTK=1` lets the test pass.
#[test]
fn vtk_opens_the_snapshots_of_a_run() {
    let runs = [Launch::Alone, Launch::Ranks(3)].map(heap);
    let files = runs.each_ref().map(|run| snapshot(&run.directory, HEAP_STEPS));
    let ended = Call::new(vec![], SCRIPT, &files).within(WITH_DOWNLOAD).end();
    if may_skip(&ended) {
        return;
    }
    assert_eq!(ended.status.code(), Some(0), "{ended}");
    assert_eq!(ended.output.matches("good: vtk").count(), files.len(), "{ended}");

    // Exports of dem-post for particles of all kinds: surfaces, points, lines, and a reader for Python.
    let kinds = finished("kinds", Launch::Ranks(2)).directory;
    let folder = fresh_directory("exports");
    let out = ["--out".as_ref(), folder.as_os_str()];
    let exports = ["--surfaces", "--vtp", "--fields", "0.5d"].map(OsStr::new);
    dem_post([&[kinds.as_os_str()][..], &out, &exports].concat()).succeed();
    fs::write(folder.join("dem.py"), dem_post(["--python"]).succeed().output).unwrap();
    let last = kinds.join("last.vtkhdf").canonicalize().unwrap();
    let arguments = ["--exports".as_ref(), last.as_os_str(), folder.as_os_str()];
    let ended = Call::new(vec![], SCRIPT, arguments).within(WITH_DOWNLOAD).end();
    assert_eq!(ended.status.code(), Some(0), "{ended}");
    ended.said_once("good: 288 grains");
    turning_walls_are_played_where_they_stand();
}

/// The file of ON-DEM, and the dump and meshes for OVITO, of particles of all kinds.
#[test]
fn other_codes_open_what_is_written_for_them() {
    for (name, steps, said) in [
        ("unions", "4000", "good: 50 particles and 87 pieces"),
        ("kinds", "800", "good: 288 particles and 0 pieces"),
    ] {
        let (run, folder) = (fresh_directory("exchanged"), fresh_directory("exchange"));
        let words = [&*scene(name), "--out", run.to_str().unwrap(), "--steps", steps];
        dem_mpi(Launch::Ranks(2), words).succeed();
        let particles = snapshot(&run, steps.parse().unwrap());
        let out = ["--out".as_ref(), folder.as_os_str()];
        let exports = ["--ondem", "--lammps", "--surfaces", "--detail", "3"].map(OsStr::new);
        dem_post([&[particles.as_os_str()][..], &out, &exports].concat()).succeed();
        fs::write(folder.join("dem.py"), dem_post(["--python"]).succeed().output).unwrap();
        let arguments = ["--exchange".as_ref(), particles.as_os_str(), folder.as_os_str()];
        let ended = Call::new(vec![], SCRIPT, arguments).within(WITH_DOWNLOAD).end();
        if may_skip(&ended) {
            return;
        }
        assert_eq!(ended.status.code(), Some(0), "{ended}");
        ended.said_once(said);
        println!("{}", ended.output);
    }
}

/// A rotating wall of triangles at several times, and particles, walls and contacts in one list.
fn turning_walls_are_played_where_they_stand() {
    let run = fresh_directory("played");
    let (scene, out) = (scene("chute"), run.to_str().unwrap());
    dem_mpi(Launch::Alone, [&*scene, "--out", out, "--steps", "6000"]).succeed();
    let files = [2000, 4000, 6000].map(|step| snapshot(&run, step));
    let folder = fresh_directory("played_exports");
    let out = ["--surfaces".as_ref(), "--out".as_ref(), folder.as_os_str()];
    let files = files.each_ref().map(|file| file.as_os_str());
    dem_post([&files[..], &out[..]].concat()).succeed();
    fs::write(folder.join("dem.py"), dem_post(["--python"]).succeed().output).unwrap();
    let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/program/chute.obj");
    let words = ["--played".as_ref(), mesh.as_ref(), folder.as_os_str()];
    let ended = Call::new(vec![], SCRIPT, [&words[..], &files[..]].concat())
        .within(WITH_DOWNLOAD)
        .succeed();
    ended.said_once("good: 3 times, 5 triangles that turn");
}
