//! Check of the loaded MPI: HDF5 must have been built for the same one.

use std::collections::BTreeSet;
use std::fmt::{Display, Formatter};

/// Error for two loaded MPI libraries, one of HDF5 and one of the program. Their communicators are incompatible: runs
/// would fail somewhere in HDF5, or hang.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TwoMpis {
    /// Files of the libraries.
    pub libraries: Vec<String>,
}

impl Display for TwoMpis {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        write!(
            f,
            "this program has loaded {} MPI libraries, {}: its HDF5 was built for another MPI. Set HDF5_DIR to the \
             HDF5 of the MPI in use (on Debian `source run/environment`, or with `--mpi mpich`). Check that \
             LD_LIBRARY_PATH and LD_PRELOAD name no other, and build again",
            self.libraries.len(),
            self.libraries.join(" and ")
        )
    }
}

impl std::error::Error for TwoMpis {}

/// Checks that at most one MPI library is loaded; to be called before MPI is initialised.
///
/// # Errors
/// If more than one MPI library is loaded. It is not detected if the system does not list loaded files (without
/// `/proc`), or if MPI is linked statically.
pub fn one_mpi() -> Result<(), TwoMpis> {
    let maps = std::fs::read("/proc/self/maps").unwrap_or_default();
    let libraries = mpi_libraries(&String::from_utf8_lossy(&maps));
    if libraries.len() > 1 { Err(TwoMpis { libraries }) } else { Ok(()) }
}

/// MPI libraries in a process's memory map, each once. Parts of one, such as `libmpi_cxx`, are not counted.
fn mpi_libraries(maps: &str) -> Vec<String> {
    // address permissions offset device inode path
    let path = |line: &str| line.find('/').map(|at| line[at..].to_owned());
    let is_mpi = |path: &String| {
        let name = path.rsplit('/').next().unwrap_or_default();
        ["libmpi.so", "libmpich.so"].iter().any(|library| name.starts_with(library))
    };
    let all: BTreeSet<String> = maps.lines().filter_map(path).filter(is_mpi).collect();
    all.into_iter().collect()
}

/// Is this the rank that prints, as far as that is known before MPI is initialised? A rank without a launcher is.
pub fn speaks() -> bool {
    let ranks = ["OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK", "SLURM_PROCID"];
    ranks.iter().find_map(|name| std::env::var(name).ok()).is_none_or(|rank| rank == "0")
}

#[cfg(test)]
mod tests {
    use super::{mpi_libraries, one_mpi};

    #[test]
    fn each_mpi_counts_once_and_its_parts_do_not() {
        let maps = "\
55d0-55d1 r-xp 00000000 fe:00 1 /home/a b/dem-mpi
7f00-7f01 r--p 00000000 fe:00 2 /usr/lib/x86_64-linux-gnu/openmpi/lib/libmpi.so.40.30.4
7f01-7f02 r-xp 00001000 fe:00 2 /usr/lib/x86_64-linux-gnu/openmpi/lib/libmpi.so.40.30.4
7f02-7f03 r-xp 00000000 fe:00 3 /usr/lib/x86_64-linux-gnu/openmpi/lib/libmpi_cxx.so.40.30.1
7f03-7f04 r-xp 00000000 fe:00 4 /usr/lib/x86_64-linux-gnu/libhdf5_openmpi.so.103.3.0
7f04-7f05 rw-p 00000000 00:00 0
7fff-8000 rw-p 00000000 00:00 0 [stack]
";
        assert_eq!(mpi_libraries(maps).len(), 1);
        let both = format!(
            "{maps}7f05-7f06 r-xp 0 fe:00 5 /usr/lib/x86_64-linux-gnu/libmpich.so.12.2.1\n"
        );
        let found = mpi_libraries(&both);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].ends_with("libmpich.so.12.2.1"), "{found:?}");
    }

    /// The programs themselves are checked by `tests/program/linked.rs`.
    #[test]
    fn this_test_has_no_two() {
        assert_eq!(one_mpi(), Ok(()));
    }
}
