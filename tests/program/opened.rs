//! Snapshots of a real run, opened by others.

use super::process::{Call, Launch, dem_post};
use super::{HEAP_STEPS, finished, fresh_directory, heap, snapshot};
use std::ffi::OsStr;
use std::fs;
use std::time::Duration;

/// The first time, the script fetches VTK: 100 MB.
const WITH_DOWNLOAD: Duration = Duration::from_secs(600);
/// The script's exit status if it could not.
const NO_VTK: i32 = 3;

/// VTK and h5py show what the run wrote, from one rank and from several. On a machine that cannot reach
/// a package index, `DEM_MPI_SKIP_VTK=1` lets the test pass.
#[test]
fn vtk_opens_the_snapshots_of_a_run() {
    let runs = [Launch::Alone, Launch::Ranks(3)].map(heap);
    let files = runs.each_ref().map(|run| snapshot(&run.directory, HEAP_STEPS));
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/open_in_vtk.sh");
    let ended = Call::new(vec![], script, &files).within(WITH_DOWNLOAD).end();
    if ended.status.code() == Some(NO_VTK) && std::env::var_os("DEM_MPI_SKIP_VTK").is_some() {
        println!("skipped: VTK cannot be fetched, and DEM_MPI_SKIP_VTK is set\n{}", ended.errors);
        return;
    }
    assert_eq!(ended.status.code(), Some(0), "{ended}");
    assert_eq!(ended.output.matches("good: vtk").count(), files.len(), "{ended}");

    // Grains of all kinds as dem-post gives them to others: surfaces, points, lines, a reader for Python.
    let kinds = finished("kinds", Launch::Ranks(2)).directory;
    let folder = fresh_directory("exports");
    let out = ["--out".as_ref(), folder.as_os_str()];
    let exports = ["--surfaces", "--vtp", "--fields", "0.5d"].map(OsStr::new);
    dem_post([&[kinds.as_os_str()][..], &out, &exports].concat()).succeed();
    fs::write(folder.join("dem.py"), dem_post(["--python"]).succeed().output).unwrap();
    let last = kinds.join("last.vtkhdf").canonicalize().unwrap();
    let arguments = ["--exports".as_ref(), last.as_os_str(), folder.as_os_str()];
    let ended = Call::new(vec![], script, arguments).within(WITH_DOWNLOAD).end();
    assert_eq!(ended.status.code(), Some(0), "{ended}");
    ended.said_once("good: 288 grains");
}
