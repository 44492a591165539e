//! A program whose HDF5 belongs to another MPI says so, and does not begin.

use super::process::{Call, Launch, dem_mpi, mpirun};
use super::{fresh_directory, scene};
use std::fs;
use std::path::Path;

/// The run failed.
const FAILED: i32 = 1;

/// An empty library with the name of an MPI that is neither Debian's Open MPI nor its MPICH, loaded into `dem-mpi` as that
/// of another HDF5 would be.
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
    // LD_PRELOAD ends at a space, which the path of the checkout may have.
    let elsewhere = tempfile::tempdir().unwrap();
    let library = another_mpi(elsewhere.path());
    let out = directory.join("out");
    let (scene, out) = (scene("heap"), out.to_str().unwrap());
    for launch in [Launch::Alone, Launch::Ranks(3)] {
        // Loaded into dem-mpi alone, not into its launcher.
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
    // Without it, the same call is good.
    dem_mpi(Launch::Alone, [&*scene, "--out", out, "--steps", "1"]).succeed();
}
