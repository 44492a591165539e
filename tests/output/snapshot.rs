//! Snapshots: data are read back bit for bit, and damage is found.

use crate::support::below;
use crate::support::made_up::{self, Tables, header};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::{Comm, threads};
use dem_mpi::contact::StateColumn;
use dem_mpi::drive::{SavedColumn, SavedState, Values};
use dem_mpi::ids::GlobalId;
use dem_mpi::math::Vec3;
use dem_mpi::output::SnapshotError;
use dem_mpi::output::header::{Header, ShapeRow};
use dem_mpi::output::order::{Order, Shares};
use dem_mpi::output::seal::checksum;
use dem_mpi::output::snapshot::{self, Reader, WriteMethod};
use dem_mpi::particles::columns::Quantity;
use dem_mpi::random::Random;
use dem_mpi::shape::{
    Ellipsoid, PolySuperellipsoid, Polyhedron, RoundedPolyhedron, Shape, Sphere, Spherocylinder,
    Superellipsoid,
};
use std::fs;
use std::path::{Path, PathBuf};

fn write(directory: &Path, header: &Header, tables: &Tables, comm: &mut dyn Comm) -> PathBuf {
    let Tables { particles, contacts, records } = tables;
    snapshot::write(directory, header, particles, contacts, records, comm).unwrap()
}

fn read(path: &Path) -> Result<(Header, Tables), SnapshotError> {
    let reader = Reader::open(path)?;
    let tables = Tables {
        particles: reader.particles(0..reader.particle_count())?,
        contacts: reader.contacts(0..reader.contact_count()?)?,
        records: reader.contact_records(0..reader.contact_record_count())?,
    };
    reader.verify()?;
    Ok((reader.header().clone(), tables))
}

#[test]
fn alone_round_trip() {
    let directory = tempfile::tempdir().unwrap();
    for spinning in [true, false] {
        let tables = made_up::of_rank(0, 1, spinning);
        let path = write(directory.path(), &header(42), &tables, &mut Alone::default());
        assert_eq!(path, directory.path().join("particles_000000042.vtkhdf"));
        assert_eq!(read(&path).unwrap(), (header(42), tables));
    }
}

#[test]
fn threads_round_trip_with_an_empty_rank() {
    for size in [1, 3, 4] {
        for spinning in [true, false] {
            let directory = tempfile::tempdir().unwrap();
            threads::run(size, |comm| {
                let tables = made_up::of_rank(comm.rank().0, size, spinning);
                write(directory.path(), &header(9), &tables, comm);
            });
            let (found, tables) = read(directory.path()).unwrap();
            assert_eq!(found, header(9));
            assert_eq!(tables, made_up::of_all(size, spinning), "{size} ranks");
        }
    }
}

/// All ranks write equal numbers of particles for any distribution of ids, and rows are in the order of
/// their keys.
#[test]
fn every_rank_writes_its_share_of_the_rows() {
    for size in [1, 2, 3, 7] {
        // Nearly all of the first particles have left.
        let ids: Vec<u64> = (0..10).chain(1_000_000..1_000_090).collect();
        let parts = threads::run(size, |comm| {
            let rank = u64::from(comm.rank().0);
            let is_mine = |id: &&u64| **id * **id % 11 % u64::from(size) == rank;
            let keys: Vec<_> = ids.iter().rev().filter(is_mine).map(|&id| GlobalId(id)).collect();
            let shares = Shares::of(&keys, comm);
            let keys: Vec<_> = keys.iter().map(|&id| (id, id)).collect();
            let order = Order::of(&keys, &shares, comm);
            let ids: Vec<[u64; 2]> = keys.iter().map(|(id, _)| [id.0, id.0 + 1]).collect();
            order.moved(ids.as_flattened(), 2, comm).into_owned()
        });
        let even = 2 * ids.len() / size as usize;
        assert!(parts.iter().all(|part| part.len().abs_diff(even) <= 2), "{size} ranks");
        let expected: Vec<u64> = ids.iter().flat_map(|id| [*id, id + 1]).collect();
        assert_eq!(parts.concat(), expected, "{size} ranks");
    }
}

/// Rows dealt out to any number of ranks give the same files as one rank, byte for byte.
#[test]
fn files_do_not_tell_how_many_ranks_wrote_them() {
    let files = |size: u32, way: WriteMethod| {
        let directory = tempfile::tempdir().unwrap();
        let place = directory.path();
        threads::run(size, |comm| {
            let Tables { particles, contacts, records } = &made_up::dealt(comm.rank().0, size);
            snapshot::write_in(way, place, &header(7), particles, contacts, records, comm).unwrap()
        });
        [snapshot::particles_name(7), snapshot::contacts_name(7)]
            .map(|name| fs::read(place.join(name)).unwrap())
    };
    let alone = files(1, WriteMethod::Together);
    for size in [2, 3, 4, 8] {
        for way in [WriteMethod::Together, WriteMethod::ThroughRoot] {
            assert!(files(size, way) == alone, "{size} ranks, {way:?}");
        }
    }
}

/// A drive may save NaN, and a wall may have more triangles than there are rows.
#[test]
fn drives_and_walls_round_trip() {
    let directory = tempfile::tempdir().unwrap();
    let mut header = header(7);
    header.drives = vec![SavedState {
        drive: "none".into(),
        columns: vec![SavedColumn::new(
            StateColumn::new("speed", 1, "m/s"),
            Values::Reals(vec![f64::NAN, -0.0]),
        )],
    }];
    header.triangles = vec![[0.5; 9]; 30_000];
    let tables = made_up::of_rank(0, 1, true);
    let path = write(directory.path(), &header, &tables, &mut Alone::default());
    let (found, rows) = read(&path).unwrap();
    assert_eq!(rows, tables);
    assert_eq!(found.triangles, header.triangles);
    let Values::Reals(numbers) = &found.drives[0].columns[0].values else { panic!("{found:?}") };
    assert_eq!(
        numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>(),
        [f64::NAN, -0.0].map(f64::to_bits)
    );
}

#[test]
fn nothing_at_all_round_trip() {
    let directory = tempfile::tempdir().unwrap();
    let empty = Header { walls: vec![], shapes: vec![], scene: String::new(), ..header(0) };
    threads::run(2, |comm| write(directory.path(), &empty, &Tables::default(), comm));
    assert_eq!(read(directory.path()).unwrap(), (empty, Tables::default()));
}

/// Files in a list for `ParaView`, with their times.
fn listed(directory: &Path, list: &str) -> Vec<(String, f64)> {
    let text = fs::read_to_string(directory.join(list)).unwrap();
    let series: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(series["file-series-version"], "1.0");
    let files = series["files"].as_array().unwrap().iter();
    files.map(|f| (f["name"].as_str().unwrap().to_owned(), f["time"].as_f64().unwrap())).collect()
}

/// Lists stay correct when a list is lost, a snapshot is removed or damaged, or a step is written again
/// with another time.
#[test]
fn lists_give_the_time_of_every_snapshot() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let lists = [("particles", "particles.vtkhdf.series"), ("contacts", "contacts.vtkhdf.series")];
    let store = |header: &Header| {
        threads::run(2, |comm| write(here, header, &Tables::default(), comm));
    };
    let expect = |steps: &[(u64, f64)]| {
        for (what, list) in lists {
            let files: Vec<(String, f64)> =
                steps.iter().map(|(k, t)| (format!("{what}_{k:09}.vtkhdf"), *t)).collect();
            assert_eq!(listed(here, list), files);
        }
    };
    let time = |step: u64| header(step).time;
    for step in [20, 3, 100] {
        store(&header(step));
    }
    expect(&[(3, time(3)), (20, time(20)), (100, time(100))]);
    fs::remove_file(here.join(lists[0].1)).unwrap();
    fs::remove_file(here.join("particles_000000020.vtkhdf")).unwrap();
    store(&header(200));
    expect(&[(3, time(3)), (100, time(100)), (200, time(200))]);
    fs::write(here.join(lists[0].1), "no list").unwrap();
    fs::write(here.join("particles_000000003.vtkhdf"), "no snapshot").unwrap();
    store(&Header { time: 7.5, ..header(100) });
    expect(&[(100, 7.5), (200, time(200))]);
}

#[test]
fn geometries_keep_their_bits() {
    let directory = tempfile::tempdir().unwrap();
    let mut random = Random::of(3, 0);
    let mut next = || random.unit() * 1e-3;
    for round in 0..20 {
        let mut vector = || Vec3::new(next(), next(), next());
        let points: Vec<Vec3> = (0..4).map(|_| vector()).collect();
        let (axes, exponents) = ([vector(), vector()], [0.3 + 1e3 * vector().x, 1.1]);
        let radius = vector().x;
        let shapes = [
            Some(Shape::Sphere(Sphere { radius })),
            Some(Shape::Ellipsoid(Ellipsoid { semi_axes: axes[0] })),
            Some(Shape::Superellipsoid(Superellipsoid::new(axes[0], exponents))),
            Some(Shape::PolySuperellipsoid(Box::new(PolySuperellipsoid::new(
                axes[0], axes[1], exponents,
            )))),
            Some(Shape::Spherocylinder(Spherocylinder { length: axes[0].y, radius })),
            Some(Shape::Polyhedron(Box::new(Polyhedron::new(&points).unwrap()))),
            Some(Shape::RoundedPolyhedron(Box::new(
                RoundedPolyhedron::new(&points, radius).unwrap(),
            ))),
            None,
        ];
        let mut header = header(round);
        let row = header.shapes[0].clone();
        header.shapes =
            shapes.map(|geometry| ShapeRow { geometry, ..row.clone() }).into_iter().collect();
        write(directory.path(), &header, &Tables::default(), &mut Alone::default());
        let found = Reader::open(directory.path()).unwrap().header().clone();
        // The debug output has the shortest digits that identify a number.
        assert_eq!(format!("{:?}", found.shapes), format!("{:?}", header.shapes));
    }
}

#[test]
fn extreme_numbers_keep_their_bits() {
    let directory = tempfile::tempdir().unwrap();
    let mut tables = made_up::of_rank(0, 1, false);
    let odd = [
        -0.0,
        f64::MIN_POSITIVE / 8.0,
        f64::INFINITY,
        f64::MAX,
        f64::from_bits(0x7ff8_dead_beef_0001),
    ];
    tables.particles.accumulated[Quantity::Dissipated][..5].copy_from_slice(&odd);
    write(directory.path(), &header(1), &tables, &mut Alone::default());
    let reader = Reader::open(directory.path()).unwrap();
    let found = reader.particles(0..5).unwrap().accumulated;
    let found = &found[Quantity::Dissipated];
    assert_eq!(found.iter().map(|x| x.to_bits()).collect::<Vec<_>>(), odd.map(f64::to_bits));
}

#[test]
fn pieces_are_pieces_of_the_whole() {
    let directory = tempfile::tempdir().unwrap();
    let tables = made_up::of_rank(0, 1, true);
    write(directory.path(), &header(1), &tables, &mut Alone::default());
    let reader = Reader::open(directory.path()).unwrap();
    let piece = reader.particles(3..7).unwrap();
    assert_eq!(piece.id, tables.particles.id[3..7]);
    assert_eq!(piece.position, tables.particles.position[3..7]);
    assert_eq!(piece.quaternion, tables.particles.quaternion[3..7]);
    let piece = reader.contacts(5..6).unwrap();
    assert_eq!(piece.centre, tables.contacts.centre[5..6]);
    assert_eq!(piece.b, tables.contacts.b[5..6]);
    let piece = reader.contact_records(2..4).unwrap();
    assert_eq!(piece.columns(), tables.records.columns());
    assert!(piece.iter().eq(tables.records.iter().skip(2).take(2)));
    assert_eq!(reader.particles(4..4).unwrap().id, []);
    let rows = reader.particle_count();
    assert!(matches!(reader.particles(0..rows + 1), Err(SnapshotError::Beyond { .. })));
    #[expect(clippy::reversed_empty_ranges, reason = "what a careless caller may ask for")]
    let backwards = reader.contacts(3..1);
    assert!(matches!(backwards, Err(SnapshotError::Beyond { .. })));
}

#[test]
fn ranks_that_restart_check_together() {
    let directory = tempfile::tempdir().unwrap();
    let tables = made_up::of_rank(0, 1, true);
    let path = write(directory.path(), &header(1), &tables, &mut Alone::default());
    let verify = || threads::run(3, |comm| Reader::open_together(&path, comm).map(drop));
    assert_eq!(verify(), [Ok(()), Ok(()), Ok(())]);
    // Only the last rank reads the last row.
    let last = tables.particles.torque.last().unwrap().z.to_le_bytes();
    let mut bytes = fs::read(&path).unwrap();
    let at = bytes.windows(8).position(|w| w == last).unwrap();
    bytes[at] ^= 1;
    fs::write(&path, bytes).unwrap();
    let expected = SnapshotError::Damaged {
        path: path.canonicalize().unwrap().display().to_string(),
        dataset: "the whole file".to_owned(),
    };
    for found in verify() {
        assert_eq!(found, Err(expected.clone()));
    }
}

#[test]
fn a_new_snapshot_leaves_the_old_one_until_it_is_complete() {
    let directory = tempfile::tempdir().unwrap();
    let place = directory.path();
    let first = made_up::of_rank(0, 1, true);
    write(place, &header(1), &first, &mut Alone::default());
    // A crash leaves partial files, and the contacts of a step without its particles.
    fs::write(place.join(".particles_000000002.vtkhdf.partial"), "half").unwrap();
    fs::write(place.join(".last.vtkhdf.partial"), "half").unwrap();
    fs::write(place.join("contacts_000000002.vtkhdf"), "whole").unwrap();
    assert_eq!(read(place).unwrap(), (header(1), first.clone()));
    // The write fails because a directory has its partial name.
    let taken = place.join(".particles_000000003.vtkhdf.partial");
    fs::create_dir(&taken).unwrap();
    let Tables { particles, contacts, records } = &first;
    let mut comm = Alone::default();
    let failed = snapshot::write(place, &header(3), particles, contacts, records, &mut comm);
    assert!(matches!(failed, Err(SnapshotError::Write { rank: 0, .. })), "{failed:?}");
    assert_eq!(read(place).unwrap(), (header(1), first));
    // The next valid snapshot.
    let second = made_up::of_rank(2, 3, false);
    write(place, &header(2), &second, &mut Alone::default());
    assert_eq!(read(place).unwrap(), (header(2), second));
    assert_eq!(
        fs::read_link(place.join("last.vtkhdf")).unwrap(),
        Path::new("particles_000000002.vtkhdf")
    );
    let left = fs::read_dir(place).unwrap().map(|e| e.unwrap().file_name());
    assert!(!left.into_iter().any(|name| name == ".particles_000000002.vtkhdf.partial"));
}

#[test]
fn one_rank_that_fails_fails_all_alike() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("a file");
    fs::write(&file, "").unwrap();
    let fail = |place: &Path, break_rank_two: fn(&mut Tables)| {
        let errors = threads::run(3, |comm| {
            let mut tables = made_up::of_rank(comm.rank().0, 3, true);
            if comm.rank().0 == 2 {
                break_rank_two(&mut tables);
            }
            let Tables { particles, contacts, records } = &tables;
            snapshot::write(place, &header(1), particles, contacts, records, comm).unwrap_err()
        });
        assert!(errors.iter().all(|e| *e == errors[0]), "{errors:?}");
        errors[0].clone()
    };
    let through_a_file = fail(&file.join("snapshots"), |_| {});
    assert!(matches!(through_a_file, SnapshotError::Write { rank: 0, .. }), "{through_a_file}");
    let uneven = fail(directory.path(), |t| t.particles.force.truncate(2));
    let expected = SnapshotError::Uneven { rank: 2, column: "force".into(), rows: 2, expected: 17 };
    assert_eq!(uneven, expected);
    let unknown = fail(directory.path(), |t| t.particles.shape[1].0 = 2);
    assert!(unknown.to_string().contains("has shape 2"), "{unknown}");
}

#[test]
fn what_is_not_a_snapshot_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let place = directory.path();
    assert!(matches!(Reader::open(place), Err(SnapshotError::Missing { .. })));
    assert!(matches!(Reader::open(&place.join("no")), Err(SnapshotError::Missing { .. })));
    for content in ["", "a text that is not HDF5"] {
        let path = place.join("particles_000000001.vtkhdf");
        fs::write(&path, content).unwrap();
        assert!(matches!(Reader::open(&path), Err(SnapshotError::Unreadable { .. })));
    }
    let tables = made_up::of_rank(0, 1, true);
    let path = write(place, &header(5), &tables, &mut Alone::default());
    let error = Reader::open(&place.join("contacts_000000005.vtkhdf")).err().unwrap();
    assert!(error.to_string().contains("has no particles"), "{error}");
    // With missing contacts, or contacts of another snapshot, the particles can still be read.
    write(place, &header(6), &tables, &mut Alone::default());
    let contacts = place.join("contacts_000000005.vtkhdf");
    fs::copy(place.join("contacts_000000006.vtkhdf"), &contacts).unwrap();
    let reader = Reader::open(&path).unwrap();
    assert!(matches!(reader.contact_count(), Err(SnapshotError::Unreadable { .. })));
    fs::remove_file(&contacts).unwrap();
    let reader = Reader::open(&path).unwrap();
    assert!(matches!(reader.verify(), Err(SnapshotError::Missing { .. })));
    assert_eq!(reader.particles(0..reader.particle_count()).unwrap(), tables.particles);
}

#[test]
fn a_file_cut_short_is_recognised() {
    let directory = tempfile::tempdir().unwrap();
    let tables = made_up::of_rank(0, 1, true);
    let path = write(directory.path(), &header(1), &tables, &mut Alone::default());
    for file in [path.clone(), directory.path().join(snapshot::contacts_name(1))] {
        let whole = fs::read(&file).unwrap();
        for length in (0..whole.len()).step_by(211).chain(whole.len() - 9..whole.len()) {
            fs::write(&file, &whole[..length]).unwrap();
            let error = read(&path).unwrap_err();
            assert!(matches!(error, SnapshotError::Unreadable { .. }), "{length}: {error}");
        }
        fs::write(&file, &whole).unwrap();
    }
    assert_eq!(read(&path).unwrap(), (header(1), tables));
}

/// One snapshot, damaged a thousand times: truncated, with a few bits flipped, or with a range overwritten
/// by zeros or other data. HDF5 never reads any of it.
#[test]
fn a_thousand_damaged_snapshots_are_refused() {
    const SEED: u64 = 20;
    const DAMAGES: usize = 1000;
    let directory = tempfile::tempdir().unwrap();
    let tables = made_up::of_rank(0, 1, true);
    let path = write(directory.path(), &header(1), &tables, &mut Alone::default());
    let original = (header(1), tables);
    let files = [path.clone(), directory.path().join(snapshot::contacts_name(1))];
    let whole = files.each_ref().map(|file| fs::read(file).unwrap());
    let mut random = Random::of(SEED, 0);
    let mut below = |limit: usize| below(&mut random, limit as u64) as usize;
    let mut refused = [0; 4];
    for damage in 0..DAMAGES {
        let (file, whole) = (&files[damage % 2], &whole[damage % 2]);
        let mut bytes = whole.clone();
        let kind = damage / 2 % 4;
        match kind {
            0 => bytes.truncate(below(whole.len())),
            1 => {
                for _ in 0..=below(4) {
                    let bit = below(bytes.len() * 8);
                    bytes[bit / 8] ^= 1 << (bit % 8);
                }
            }
            // Structures are smaller than rows, so this range gets its own flips.
            2 => {
                let bit = below(2048 * 8);
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
            _ => {
                let length = 1 + below(512);
                let [from, to] = [0; 2].map(|_| below(whole.len() - length));
                let zero = below(2) == 0;
                bytes[to..to + length].copy_from_slice(&whole[from..from + length]);
                if zero {
                    bytes[to..to + length].fill(0);
                }
            }
        }
        fs::write(file, &bytes).unwrap();
        match read(&path) {
            Ok(read) => {
                // Zeros over zeros change nothing.
                assert!(read == original && bytes == *whole, "seed {SEED}, damage {damage}");
            }
            Err(error) => {
                assert!(
                    matches!(
                        error,
                        SnapshotError::Unreadable { .. } | SnapshotError::Damaged { .. }
                    ),
                    "seed {SEED}, damage {damage}: {error}"
                );
                let name = file.file_name().unwrap().to_str().unwrap();
                assert!(error.to_string().contains(name), "seed {SEED}, damage {damage}: {error}");
                refused[kind] += 1;
            }
        }
        fs::write(file, whole).unwrap();
    }
    println!(
        "of {DAMAGES}: cut {}, bits {}, early bits {}, stretches {} refused",
        refused[0], refused[1], refused[2], refused[3]
    );
    assert_eq!(refused[0] + refused[2], DAMAGES / 2);
    assert!(refused.iter().sum::<usize>() > DAMAGES * 9 / 10, "{refused:?}");
    assert_eq!(read(&path).unwrap(), original);
}

/// The newest complete snapshot of a directory is opened on any number of ranks, and the damaged ones are
/// reported.
#[test]
fn damaged_snapshots_of_a_directory_are_passed_over() {
    let directory = tempfile::tempdir().unwrap();
    let place = directory.path();
    let tables = made_up::of_rank(0, 1, true);
    let paths =
        [10, 20, 30, 40].map(|step| write(place, &header(step), &tables, &mut Alone::default()));
    let opened = |expected: u64, passed_over: &[&str]| {
        let readers = threads::run(3, |comm| {
            let reader = Reader::open_together(place, comm).unwrap();
            (reader.header().step, reader.passed_over().iter().map(ToString::to_string).collect())
        });
        for (step, errors) in readers {
            let errors: Vec<String> = errors;
            assert_eq!((step, errors.len()), (expected, passed_over.len()), "{errors:?}");
            for (error, text) in errors.iter().zip(passed_over) {
                assert!(error.contains(text), "{error}");
            }
        }
    };
    opened(40, &[]);
    // Without a link the file name gives the newest.
    let last = place.join("last.vtkhdf");
    fs::remove_file(&last).unwrap();
    opened(40, &[]);
    // After a run that went back to an earlier snapshot, later ones do not count.
    std::os::unix::fs::symlink("particles_000000030.vtkhdf", &last).unwrap();
    opened(30, &[]);
    let whole = fs::read(&paths[2]).unwrap();
    fs::write(&paths[2], &whole[..whole.len() / 2]).unwrap();
    opened(20, &["particles_000000030.vtkhdf cannot be read"]);
    let mut flipped = fs::read(&paths[1]).unwrap();
    flipped[5000] ^= 4;
    fs::write(&paths[1], flipped).unwrap();
    opened(10, &["particles_000000030.vtkhdf cannot be read", "the checksum of the whole file"]);
    fs::remove_file(&paths[2]).unwrap();
    opened(10, &["no snapshot at", "the checksum of the whole file"]);
    fs::write(&paths[0], "").unwrap();
    let errors = threads::run(2, |comm| Reader::open_together(place, comm).err().unwrap());
    assert_eq!(errors[0], errors[1]);
    let SnapshotError::NoneGood { causes, .. } = &errors[0] else { panic!("{}", errors[0]) };
    assert_eq!(causes.len(), 3);
}

#[test]
fn the_checksum_adds_up_and_sees_order() {
    let rows: Vec<u8> = (0..240).map(|i| (i * 7) as u8).collect();
    let whole = checksum(0, 24, &rows);
    let (first, second) = rows.split_at(72);
    assert_eq!(checksum(3, 24, second).wrapping_add(checksum(0, 24, first)), whole);
    let swapped = [&rows[24..48], &rows[..24], &rows[48..]].concat();
    assert_ne!(checksum(0, 24, &swapped), whole);
    for bit in 0..rows.len() * 8 {
        let mut flipped = rows.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert_ne!(checksum(0, 24, &flipped), whole);
    }
    // The rows are not whole words.
    assert_ne!(checksum(0, 3, &[1, 2, 3]), checksum(0, 3, &[1, 2, 4]));
}
