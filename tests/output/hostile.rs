//! Malicious snapshots: sealed and with valid checksums, but rejected.

use crate::support::below;
use crate::support::made_up::{self, Tables, header};
use dem_mpi::comm::alone::Alone;
use dem_mpi::output::SnapshotError;
use dem_mpi::output::header::Header;
use dem_mpi::output::seal::checksum;
use dem_mpi::output::snapshot::{self, Reader};
use dem_mpi::output::tables::PARTICLE_COLUMNS;
use dem_mpi::particles::columns::Quantity;
use dem_mpi::post::{Settings, analyse};
use dem_mpi::random::Random;
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble::{self, Continuation};
use dem_mpi::sim::run::{Schedule, run};
use hdf5_metno::types::{FixedAscii, FixedUnicode, VarLenUnicode};
use hdf5_metno::{File, H5Type, Location, Result};
use std::fs;
use std::os::unix::fs::FileTypeExt as _;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// End mark of a complete file, and the length of the seal [bytes].
const END: &[u8] = b"\ndem-mpi: whole\n";
const SEAL: usize = 32;

/// Changes the HDF5 file of a snapshot, and seals it again as anyone can who knows the format.
fn forged(path: &Path, change: impl FnOnce(&File) -> Result<()>) {
    let whole = fs::read(path).unwrap();
    fs::write(path, &whole[..whole.len() - SEAL]).unwrap();
    let file = File::open_rw(path).unwrap();
    change(&file).unwrap();
    file.close().unwrap();
    let bytes = fs::read(path).unwrap();
    let (blocks, rest) = bytes.split_at(bytes.len() / 64 * 64);
    let last =
        if rest.is_empty() { 0 } else { checksum(blocks.len() as u64 / 64, rest.len(), rest) };
    let sum = checksum(0, 64, blocks).wrapping_add(last);
    let length = bytes.len() as u64;
    fs::write(path, [&bytes[..], &length.to_le_bytes(), &sum.to_le_bytes(), END].concat()).unwrap();
}

/// A dataset or a group.
fn located(file: &File, place: &str) -> Result<Location> {
    match file.dataset(place) {
        Ok(dataset) => Ok(Location::clone(&dataset)),
        Err(_) => file.group(place).map(|group| Location::clone(&group)),
    }
}

/// Replaces an attribute.
fn attribute<T: H5Type>(file: &File, of: &str, name: &str, values: &[T]) -> Result<()> {
    let of = located(file, of)?;
    of.delete_attr(name)?;
    of.new_attr::<T>().shape(values.len()).create(name)?.write_raw(values)
}

fn scalar<T: H5Type>(file: &File, of: &str, name: &str, value: &T) -> Result<()> {
    let of = located(file, of)?;
    of.delete_attr(name)?;
    of.new_attr::<T>().create(name)?.write_scalar(value)
}

/// Replaces a dataset, with an arbitrary checksum.
fn dataset<T: H5Type>(file: &File, place: &str, values: &[T]) -> Result<()> {
    file.unlink(place)?;
    let new = file.new_dataset::<T>().shape(values.len()).create(place)?;
    new.write_raw(values)?;
    new.new_attr::<u64>().create("checksum")?.write_scalar(&0)?;
    new.new_attr::<FixedAscii<1>>()
        .create("unit")?
        .write_scalar(&FixedAscii::<1>::from_ascii("m").unwrap())
}

fn pipe(folder: &Path) -> PathBuf {
    let pipe = folder.join("pipe");
    if !pipe.exists() {
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    }
    assert!(fs::metadata(&pipe).unwrap().file_type().is_fifo());
    pipe
}

/// Writes a snapshot of invented tables into a folder.
fn stored(folder: &Path) -> PathBuf {
    let Tables { particles, contacts, records } = made_up::of_rank(0, 1, true);
    snapshot::write(folder, &header(1), &particles, &contacts, &records, &mut Alone::default())
        .unwrap()
}

/// Reads all parts of a snapshot.
fn read(path: &Path) -> std::result::Result<(), SnapshotError> {
    let reader = Reader::open_together(path, &mut Alone::default())?;
    reader.particles(0..reader.particle_count())?;
    reader.contact_records(0..reader.contact_record_count())?;
    reader.contacts(0..reader.contact_count()?)?;
    reader.verify()
}

const LIMIT: Duration = Duration::from_secs(20);

/// Each forged structure is dangerous to a reader that trusts the file. The reader would write beyond its memory, read
/// missing data, wait for ever, or follow a link out of the file.
#[test]
fn forged_structures_are_refused() {
    const SPRING: &str = "/restart/contacts/spring";
    type Change = (&'static str, fn(&File, &Path) -> Result<()>);
    let changes: [Change; 23] = [
        ("a unit of many texts", |file, _| {
            let metres = "metres, and more".parse::<FixedUnicode<16>>().unwrap();
            attribute(file, SPRING, "unit", &[metres; 64])
        }),
        ("a unit of variable length", |file, _| {
            scalar(file, SPRING, "unit", &"m".parse::<VarLenUnicode>().unwrap())
        }),
        ("a unit that is a number", |file, _| scalar(file, SPRING, "unit", &1.0)),
        ("a unit of numbers", |file, _| attribute(file, SPRING, "unit", &[1_u8; 4096])),
        ("a step of many numbers", |file, _| attribute(file, "run", "step", &vec![1_u64; 4096])),
        ("a step that is a real number", |file, _| scalar(file, "run", "step", &1.0)),
        ("gravity of one number", |file, _| scalar(file, "run", "gravity", &1.0)),
        ("gravity of many numbers", |file, _| attribute(file, "run", "gravity", &vec![1.0; 4000])),
        ("a checksum of many numbers", |file, _| {
            attribute(file, SPRING, "checksum", &vec![1_u64; 4096])
        }),
        ("a checksum of a byte", |file, _| scalar(file, SPRING, "checksum", &1_u8)),
        ("groups in a circle", |file, _| file.link_hard("/", "/restart/again")),
        ("groups in each other", |file, _| {
            file.create_group("/restart/contacts/a1")?.create_group("b").map(drop)
        }),
        ("a soft link", |file, _| file.link_soft("/run", "/restart/again")),
        ("a link to another file", |file, folder| {
            let pipe = pipe(folder);
            file.unlink("/VTKHDF/Points")?;
            file.group("VTKHDF")?.link_external(pipe.to_str().unwrap(), "/Points", "Points")
        }),
        ("rows in another file", |file, folder| {
            let pipe = pipe(folder);
            file.unlink(SPRING)?;
            let new = file.new_dataset::<f64>().external(pipe.to_str().unwrap(), 0, 8 << 10);
            let new = new.shape([3, 3]).create(SPRING)?;
            new.new_attr::<u64>().create("checksum")?.write_scalar(&0)
        }),
        ("rows in chunks", |file, _| {
            file.unlink(SPRING)?;
            let new =
                file.new_dataset::<f64>().chunk(1_usize << 10).deflate(9).shape(1_usize << 40);
            new.create(SPRING)?.new_attr::<u64>().create("checksum")?.write_scalar(&0)
        }),
        ("more rows than bytes", |file, _| {
            file.unlink(SPRING)?;
            let new = file.new_dataset::<f64>().no_chunk().shape([1_usize << 40, 3]);
            new.create(SPRING)?.new_attr::<u64>().create("checksum")?.write_scalar(&0)
        }),
        ("texts of variable length", |file, _| {
            dataset(file, SPRING, &vec!["metre".parse::<VarLenUnicode>().unwrap(); 30])
        }),
        ("texts in place of numbers", |file, _| {
            dataset(file, SPRING, &[FixedAscii::<8>::from_ascii("eight").unwrap(); 30])
        }),
        ("pairs in place of numbers", |file, _| dataset(file, SPRING, &[[1.0, 2.0]; 30])),
        ("numbers in place of texts", |file, _| dataset(file, "/run/scene", &[1.0; 30])),
        ("numbers in place of ids", |file, _| dataset(file, "/VTKHDF/PointData/id", &[1.0; 17])),
        ("flags in place of numbers", |file, _| dataset(file, SPRING, &[true; 30])),
    ];
    for (name, change) in changes {
        let folder = tempfile::tempdir().unwrap();
        let path = stored(folder.path());
        read(&path).unwrap();
        forged(&path, |file| change(file, folder.path()));
        let begin = Instant::now();
        let error = read(&path).expect_err(name);
        assert!(begin.elapsed() < LIMIT, "{name}");
        let is_told =
            matches!(error, SnapshotError::Unreadable { .. } | SnapshotError::Damaged { .. });
        assert!(is_told, "{name}: {error}");
    }
}

/// A pipe or a folder under the name of a snapshot is rejected without waiting.
#[test]
fn what_is_no_regular_file_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = stored(folder.path());
    let contacts = folder.path().join(snapshot::contacts_name(1));
    for file in [&contacts, &path] {
        fs::remove_file(file).unwrap();
        assert!(Command::new("mkfifo").arg(file).status().unwrap().success());
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("it is not a regular file"), "{error}");
    }
    let error = read(folder.path()).unwrap_err().to_string();
    assert!(error.contains("it is not a regular file"), "{error}");
    fs::remove_file(&path).unwrap();
    fs::create_dir(&path).unwrap();
    assert!(read(&path).is_err());
}

/// Invalid shapes, ids and boxes in an otherwise complete file.
#[test]
fn numbers_that_name_nothing_are_refused() {
    let write = |folder: &Path, header: &Header, tables: &Tables| {
        let Tables { particles, contacts, records } = tables;
        snapshot::write(folder, header, particles, contacts, records, &mut Alone::default())
            .unwrap()
    };
    let whole = made_up::of_rank(0, 1, true);
    let refused = |header: &Header, tables: &Tables, forge: &dyn Fn(&Path)| {
        let folder = tempfile::tempdir().unwrap();
        let path = write(folder.path(), header, tables);
        forge(&path);
        read(&path).unwrap_err().to_string()
    };
    let shape = |path: &Path| {
        forged(path, |file| {
            let shapes = file.dataset("/VTKHDF/PointData/shape")?;
            let rows = shapes.size();
            let bytes: Vec<u8> = (0..rows).flat_map(|_| 9_u16.to_le_bytes()).collect();
            shapes.write_raw(&vec![9_u16; rows])?;
            scalar(file, "/VTKHDF/PointData/shape", "checksum", &checksum(0, 2, &bytes))
        });
    };
    let told = refused(&header(1), &whole, &shape);
    assert!(told.contains("has shape 9, but only 2 are listed"), "{told}");
    let short = Header { next_id: 1, ..header(1) };
    let told = refused(&short, &whole, &|_| ());
    assert!(told.contains("was never assigned"), "{told}");
    let late = Header { stage_begin: (2, 0.0), ..header(1) };
    assert!(refused(&late, &whole, &|_| ()).contains("/run"));
}

/// Writes a heap of all kinds of particles after some steps.
fn heap(folder: &Path) -> (Scene, PathBuf) {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/program/kinds.toml");
    let scene = Scene::read(Path::new(file), &[]).unwrap();
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    assemble::fill(&mut sim, &scene, &comm);
    let schedule = Schedule {
        last_step: 400,
        ends_stage: false,
        snapshot_every: 0,
        snapshot_every_minutes: None,
        history_every: 0,
        stop: scene.stop.clone(),
        out: folder.into(),
        scene: scene.text.clone(),
        resumed: false,
        signal: Arc::default(),
        traced: Vec::new(),
        duration: scene.duration,
        over: scene.over_the_limit(),
    };
    let finish = run(&mut sim, &schedule, &mut comm, &mut |_| ()).unwrap();
    (scene, finish.snapshot)
}

/// Numbers of particles and contacts that no run writes end in a message or are accepted, never in a panic.
#[test]
fn strange_numbers_end_in_a_message() {
    const SEED: u64 = 7;
    const ROUNDS: u64 = 120;
    let folder = tempfile::tempdir().unwrap();
    let (scene, path) = heap(folder.path());
    let reader = Reader::open(&path).unwrap();
    let (whole, header) = (
        Tables {
            particles: reader.particles(0..reader.particle_count()).unwrap(),
            contacts: reader.contacts(0..reader.contact_count().unwrap()).unwrap(),
            records: reader.contact_records(0..reader.contact_record_count()).unwrap(),
        },
        reader.header().clone(),
    );
    let strange = [f64::NAN, f64::INFINITY, -1e300, 1e300, 0.0, -1.0, 1e-320];
    let mut random = Random::of(SEED, 0);
    let mut told = 0;
    for round in 0..ROUNDS {
        let mut tables = whole.clone();
        let number = strange[below(&mut random, strange.len() as u64) as usize];
        let row = below(&mut random, tables.particles.id.len() as u64) as usize;
        let contact = below(&mut random, tables.contacts.a.len() as u64) as usize;
        let (particles, contacts) = (&mut tables.particles, &mut tables.contacts);
        let mut header = header.clone();
        match round % 17 {
            0 => particles.position[row].x = number,
            1 => particles.velocity[row].y = number,
            2 => particles.force[row].z = number,
            3 => particles.quaternion[row] = [number; 4],
            4 => particles.angular_momentum[row].x = number,
            5 => particles.angular_velocity[row].x = number,
            6 => particles.accumulated[Quantity::Dissipated][row] = number,
            7 => particles.id[row] = particles.id[0],
            8 => particles.scale = vec![number; particles.id.len()],
            9 => particles.position.iter_mut().for_each(|place| *place *= number),
            10 => contacts.normal[contact].x = number,
            11 => contacts.branch[contact].y = number,
            12 => contacts.b[contact].0 = 5_000_000,
            13 => header.time = number,
            14 => header.dt = number,
            15 => header.shapes[0].mass = number,
            _ => header.walls[0].point.x = number,
        }
        let folder = tempfile::tempdir().unwrap();
        let Tables { particles, contacts, records } = &tables;
        let mut comm = Alone::default();
        let path = snapshot::write(folder.path(), &header, particles, contacts, records, &mut comm);
        let path = path.unwrap();
        let case = format!("seed {SEED}, round {round}: {number}");
        let begin = Instant::now();
        let taken = catch_unwind(AssertUnwindSafe(|| {
            let mut comm = Alone::default();
            let mut sim = assemble::assemble(&scene, &comm);
            assemble::take_up(&mut sim, &scene, &path, Continuation::SameStage, &mut comm)
                .map(drop)
                .map_err(|error| error.to_string())
        }));
        let measured = catch_unwind(AssertUnwindSafe(|| {
            let reader = Reader::open(&path).map_err(|error| error.to_string())?;
            analyse(&reader, "forged", Settings::default()).map(drop).map_err(|e| e.to_string())
        }));
        let (taken, measured) = (taken.expect(&case), measured.expect(&case));
        told += usize::from(taken.is_err()) + usize::from(measured.is_err());
        assert!(begin.elapsed() < LIMIT, "{case}");
    }
    println!("{told} messages of {ROUNDS} files, {} columns", PARTICLE_COLUMNS.len());
    assert!(told > 0);
}
