//! Snapshots that all ranks write together.

use crate::made_up::{self, Tables, header};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::{Comm, threads};
use dem_mpi::output::SnapshotError;
use dem_mpi::output::hdf5::{Column, SnapshotFile, StoredFile};
use dem_mpi::output::snapshot::{self, Reader, WriteMethod};
use std::fs;
use std::path::{Path, PathBuf};

/// A directory that rank 0 makes and all ranks know; rank 0 keeps the guard that deletes it.
fn shared_directory(comm: &mut dyn Comm) -> (PathBuf, Option<tempfile::TempDir>) {
    let made = comm.is_root().then(|| tempfile::tempdir().unwrap());
    let mut name = made.as_ref().map_or(vec![], |d| d.path().to_str().unwrap().as_bytes().to_vec());
    comm.broadcast(&mut name);
    (PathBuf::from(String::from_utf8(name).unwrap()), made)
}

fn write(
    directory: &Path,
    step: u64,
    spinning: bool,
    comm: &mut dyn Comm,
) -> Result<PathBuf, SnapshotError> {
    write_in(WriteMethod::Together, directory, step, spinning, comm)
}

fn write_in(
    way: WriteMethod,
    directory: &Path,
    step: u64,
    spinning: bool,
    comm: &mut dyn Comm,
) -> Result<PathBuf, SnapshotError> {
    let Tables { particles, contacts, records } =
        &made_up::of_rank(comm.rank().0, comm.size(), spinning);
    snapshot::write_in(way, directory, &header(step), particles, contacts, records, comm)
}

fn read_all(path: &Path) -> Tables {
    let reader = Reader::open(path).unwrap();
    reader.verify().unwrap();
    Tables {
        particles: reader.particles(0..reader.particle_count()).unwrap(),
        contacts: reader.contacts(0..reader.contact_count().unwrap()).unwrap(),
        records: reader.contact_records(0..reader.contact_record_count()).unwrap(),
    }
}

/// Snapshots are read back bit for bit, with an empty rank, and twice for one step like after a restart. All ranks then check
/// them. `DEM_MPI_KEEP_SNAPSHOTS` names a folder that keeps the files for another test.
pub(crate) fn round_trip(comm: &mut dyn Comm) {
    let (directory, _kept) = shared_directory(comm);
    let nested = match std::env::var_os("DEM_MPI_KEEP_SNAPSHOTS") {
        Some(kept) => PathBuf::from(kept).join(comm.size().to_string()),
        None => directory.join("out/packing"),
    };
    let [together, through_root] = [WriteMethod::Together, WriteMethod::ThroughRoot];
    for (way, step, spinning) in
        [(together, 3, true), (through_root, 4, false), (together, 4, false), (together, 4, true)]
    {
        let path = write_in(way, &nested, step, spinning, comm).unwrap();
        if comm.is_root() {
            let expected = made_up::of_all(comm.size(), spinning);
            assert_eq!(read_all(&path), expected);
            assert_eq!(read_all(&nested), expected);
            assert_eq!(*Reader::open(&path).unwrap().header(), header(step));
        }
        comm.any(false);
        Reader::open_together(&path, comm).unwrap();
    }
}

/// Rows dealt out to any number of ranks give the files of one rank. They agree byte for byte if rank 0 writes, and dataset
/// for dataset if all write. Parallel HDF5 orders its structures differently.
pub(crate) fn rows_by_id(comm: &mut dyn Comm) {
    let (directory, _kept) = shared_directory(comm);
    let store = |folder: &str, way, tables: &Tables, comm: &mut dyn Comm| {
        let Tables { particles, contacts, records } = tables;
        let place = directory.join(folder);
        snapshot::write_in(way, &place, &header(7), particles, contacts, records, comm).unwrap()
    };
    let mine = made_up::dealt(comm.rank().0, comm.size());
    let together = store("together", WriteMethod::Together, &mine, comm);
    let through_root = store("through root", WriteMethod::ThroughRoot, &mine, comm);
    if comm.is_root() {
        let all = Tables {
            particles: made_up::particles(0, 0..67, true),
            contacts: made_up::contacts(0..67),
            records: made_up::records(0..67),
        };
        let alone = store("alone", WriteMethod::Together, &all, &mut Alone::default());
        assert_eq!(read_all(&together), all);
        let beside = |path: &Path| path.with_file_name(snapshot::contacts_name(7));
        for (mine, other) in [(&together, &alone), (&beside(&together), &beside(&alone))] {
            let checksums = |path| StoredFile::open(path, &mut Alone::default())?.checksums();
            let [mine, other] = [mine, other].map(|path| checksums(path).unwrap());
            assert!(mine.len() > 30 && mine == other, "{mine:?} {other:?}");
        }
        let bytes =
            |particles: &Path| [particles, &beside(particles)].map(|path| fs::read(path).unwrap());
        assert!(bytes(&through_root) == bytes(&alone), "through rank 0");
    }
    comm.any(false);
}

/// HDF5 reports a collective write, even if only one rank has rows.
pub(crate) fn is_collective(comm: &mut dyn Comm) {
    let (directory, _kept) = shared_directory(comm);
    let path = directory.join("file.vtkhdf");
    let column = Column { place: "/numbers", width: 3, unit: "m" };
    let last = comm.size() - 1;
    let rows = if comm.rank().0 == last { vec![0.1; 3000] } else { vec![] };
    let mut file = SnapshotFile::create(&path, 24_000, comm).unwrap();
    file.rows(&column, &rows).unwrap();
    assert_eq!(file.collective_writes(), 1);
    file.rows(&Column { place: "/nothing", ..column }, &rows[..0]).unwrap();
    file.table(&Column { place: "/table", ..column }, &[7i32, 8, 9]).unwrap();
    file.texts(&Column { place: "/texts", width: 1, unit: "" }, &["a", "µ", ""]).unwrap();
    assert_eq!(file.collective_writes(), 3);
    file.close().unwrap();
    let stored = StoredFile::open(&path, comm).unwrap();
    assert_eq!(stored.rows::<f64>(&column, 0..1000).unwrap(), vec![0.1; 3000]);
    assert_eq!(stored.count("/nothing").unwrap(), 0);
    stored.verify(comm).unwrap();
}

/// All ranks get the same error if the directory or the file cannot be created, the disk is too small, or a table is wrong.
pub(crate) fn errors_agree(comm: &mut dyn Comm) {
    let (directory, _kept) = shared_directory(comm);
    let file = directory.join("a file");
    if comm.is_root() {
        fs::write(&file, "").unwrap();
        fs::create_dir(directory.join(".contacts_000000002.vtkhdf.partial")).unwrap();
    }
    comm.any(false);
    let no_directory = write(&file.join("snapshots"), 1, true, comm).unwrap_err();
    let no_file = write(&directory, 2, true, comm).unwrap_err();
    let too_large = SnapshotFile::create(&directory.join("large"), 1 << 58, comm).err().unwrap();
    let mut tables = made_up::of_rank(comm.rank().0, comm.size(), true);
    if comm.rank().0 == comm.size() - 1 {
        tables.contacts.overlap.push(0.0);
    }
    let Tables { particles, contacts, records } = &tables;
    let uneven =
        snapshot::write(&directory, &header(3), particles, contacts, records, comm).unwrap_err();
    for (error, of) in
        [(&no_directory, "a file/snap"), (&no_file, ".contacts"), (&too_large, "large")]
    {
        let SnapshotError::Write { rank: 0, path, .. } = error else { panic!("{error}") };
        assert!(path.contains(of), "{error}");
    }
    assert!(matches!(&uneven, SnapshotError::Uneven { column, .. } if column == "overlap"));
    let mine = [no_directory, no_file, too_large, uneven].map(|e| e.to_string()).join("\n");
    if let Some(all) = comm.gather(mine.clone().into_bytes()) {
        assert!(all.iter().all(|theirs| *theirs == mine.as_bytes()));
    }
    // Rank 0 alone fails.
    let alone = write_in(WriteMethod::ThroughRoot, &directory, 2, true, comm).unwrap_err();
    assert!(matches!(&alone, SnapshotError::Write { rank: 0, path, .. } if path.contains(".cont")));
    // The ranks are still in step.
    write(&directory, 4, true, comm).unwrap();
}

/// Ranks of MPI and ranks as threads write the same snapshot.
pub(crate) fn same_as_threads(comm: &mut dyn Comm) {
    let (directory, _kept) = shared_directory(comm);
    let together = write(&directory.join("mpi"), 1, true, comm).unwrap();
    if comm.is_root() {
        let gathered = threads::run(comm.size(), |comm| {
            write(&directory.join("threads"), 1, true, comm).unwrap()
        });
        assert_eq!(read_all(&together), read_all(&gathered[0]));
    }
    comm.any(false);
}
