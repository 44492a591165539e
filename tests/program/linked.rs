//! A program whose HDF5 belongs to another MPI reports it and does not start.

use super::process::{Call, Launch, dem_mpi, mpirun};
use super::{fresh_directory, scene};
use std::fs;
use std::path::Path;

/// Exit status of a failed run.
const FAILED: i32 = 1;

/// Builds an empty library with the name of an MPI that is neither Debian's Open MPI nor its MPICH. It is loaded into
/// `dem-mpi` like the MPI of another HDF5.
fn another_mpi(directory: &Path) -> String {
    let (source, library) = (directory.join("empty.c"), directory.join("libmpi.so.12"));
    fs::write(&source, "").unwrap();
    let words = ["-shared", "-o", library.to_str().unwrap(), source.to_str().unwrap()];
    Call::new(vec![], "cc", words).succeed();
    library.to_str().unwrap().to_owned()
}

#[test]
fn two_mpis_in_one_program_end_it_with_one_message() {
    let directory = fresh_directory("linked");
    // LD_PRELOAD ends at a space, and the path of the checkout may have one.
    let elsewhere = tempfile::tempdir().unwrap();
    let library = another_mpi(elsewhere.path());
    let out = directory.join("out");
    let (scene, out) = (scene("heap"), out.to_str().unwrap());
    for launch in [Launch::Alone, Launch::Ranks(3)] {
        // The library is loaded into dem-mpi but not into its launcher.
        let mut words = vec!["env".into(), format!("LD_PRELOAD={library}").into()];
        if let Launch::Ranks(ranks) = launch {
            words.splice(0..0, [mpirun(), "-n".into(), ranks.to_string().into()]);
        }
        let ended = Call::new(words, env!("CARGO_BIN_EXE_dem-mpi"), [&*scene, "--out", out]).end();
        assert_eq!(ended.status.code(), Some(FAILED), "{ended}");
        ended.said_once("this program has loaded 2 MPI libraries");
        ended.said_once(&library);
        ended.said_once("HDF5_DIR");
        assert!(!Path::new(out).exists(), "it began: {ended}");
    }
    // Without the library the call succeeds.
    dem_mpi(Launch::Alone, [&*scene, "--out", out, "--steps", "1"]).succeed();
}
