//! Snapshots: tables to files and back. The layout of the files: [`super::tables`].
//!
//! Two columns serve pictures alone. `semi_axes` of each particle and its `quaternion` are drawn by ParaView's 3D Glyphs;
//! `force` of each contact is the magnitude of the total force [N].

mod folder;
mod header;
mod reader;

pub use folder::{CONTACTS_LIST, PARTICLES_LIST, none_later, step_of};
pub use reader::{Reader, Sizes};

use super::hdf5::{Column, SnapshotFile};
use super::header::Header;
use super::order::{Key, Order, Shares};
use super::tables::{
    self, CONTACT_COLUMNS, ContactRecordRows, ContactRow, ContactTable, PARTICLE_COLUMNS,
    ParticleColumn, ParticleTable, QUATERNION, Rows,
};
use super::{SnapshotError, make_directory, on_root};
use crate::comm::alone::Alone;
use crate::comm::{Comm, agree, wire};
use crate::contact::{ContactRecord, ContactRecords, StateColumn};
use crate::drive::SavedState;
use crate::files;
use crate::ids::ShapeId;
use crate::math::Vec3;
use crate::particles::Needs;
use folder::{link_last, list_with_times};
use header::{bodies, geometries, write_header};
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Link in a snapshot directory to the newest particles file.
pub const LAST: &str = "last.vtkhdf";

/// Name of the particles file of a step.
pub fn particles_name(step: u64) -> String {
    format!("particles_{step:09}.vtkhdf")
}

/// Name of the contacts file of a step.
pub fn contacts_name(step: u64) -> String {
    format!("contacts_{step:09}.vtkhdf")
}

const fn column<'a>(place: &'a str, width: usize, unit: &'a str) -> Column<'a> {
    Column { place, width, unit }
}

// Counts that VTK requires, with one entry per part; there is one part.
const POINT_COUNTS: Column = column("/VTKHDF/NumberOfPoints", 1, "");

const POINTS: Column = column("/VTKHDF/Points", 3, "m");

/// Axes of the particles for pictures.
const GLYPH_SEMI_AXES: Column = column("/VTKHDF/PointData/semi_axes", 3, "m");

// Contact columns for a restart.
const RECORD_A: Column = column("/restart/contacts/a", 1, "1");

const RECORD_B: Column = column("/restart/contacts/b", 1, "1");

const RECORD_NORMAL: Column = column("/restart/contacts/normal", 3, "1");

const RECORD_OVERLAP: Column = column("/restart/contacts/overlap", 1, "m");

/// Group of the columns of the contact law's state, a dataset for each column.
const RECORDS: &str = "/restart/contacts";

/// Magnitude of the total force, for pictures.
const FORCE_MAGNITUDE: Column = column("/VTKHDF/CellData/force", 1, "N");

/// Largest size of an element of a column [bytes].
const ELEMENT: usize = size_of::<f64>();

/// Bytes of a contact in both files, with its record; `remembered` are the columns of the contact law's state.
pub fn contact_bytes(remembered: &[StateColumn]) -> usize {
    ELEMENT * (elements_of_contact() + of_record(remembered))
}

/// Largest number of elements of a particle: all columns, the axes, one vertex and its end.
fn elements_of_particle() -> usize {
    tables::particle_elements() + GLYPH_SEMI_AXES.width + 2
}

/// Bytes of a particle in a snapshot of a scene with these needs, without the state of its contacts.
pub fn particle_bytes(needs: &Needs) -> usize {
    tables::particle_bytes(needs) + ELEMENT * (GLYPH_SEMI_AXES.width + 2)
}

/// Number of elements of a record.
fn of_record(remembered: &[StateColumn]) -> usize {
    let geometry = RECORD_A.width + RECORD_B.width + RECORD_NORMAL.width + RECORD_OVERLAP.width;
    geometry + StateColumn::total_width(remembered)
}

/// Number of elements of a contact: all columns, the force, two points, one line of two ids and its end.
fn elements_of_contact() -> usize {
    tables::contact_elements() + FORCE_MAGNITUDE.width + 2 * POINTS.width + 3
}

/// Number of elements of a part: its counts, and the first offset of each category.
const OF_PART: usize = 13;

/// Method by which the ranks of a run write a snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteMethod {
    /// All ranks write together, each its share of the rows. Memory per rank does not grow with the whole snapshot.
    Together,
    /// Rank 0 gathers all rows and writes alone. This is faster for small snapshots, because ranks that write together wait
    /// for each other some hundred times.
    ThroughRoot,
}

impl WriteMethod {
    /// Total size below which a snapshot is written through rank 0 [bytes].
    pub const SMALL: u64 = 16 << 20;

    /// The faster method for this total size.
    pub const fn for_bytes(bytes: u64) -> Self {
        if bytes < Self::SMALL { Self::ThroughRoot } else { Self::Together }
    }
}

/// Writes a snapshot: the contacts file, the particles file and, when both are on the disk under their own names, the link
/// [`LAST`]. Creates `directory` if it is missing. The header of rank 0 is taken. Returns the path of the particles file.
/// Collective.
///
/// A crash at any moment leaves the last good snapshot. It may also leave files named `.*.partial`, which are harmless.
///
/// # Errors
/// On every rank alike: [`SnapshotError::Write`], or [`SnapshotError::Uneven`] for a table whose columns differ in length.
pub fn write(
    directory: &Path,
    header: &Header,
    particles: &ParticleTable,
    contacts: &ContactTable,
    records: &ContactRecords,
    comm: &mut dyn Comm,
) -> Result<PathBuf, SnapshotError> {
    write_rows(directory, header, particles, contacts, records, comm)
}

/// Writes a snapshot like [`write`]; contacts and records need not all be in memory at once.
///
/// # Errors
/// See [`write`].
pub fn write_rows(
    directory: &Path,
    header: &Header,
    particles: &ParticleTable,
    contacts: &dyn Rows<ContactRow>,
    records: &dyn ContactRecordRows,
    comm: &mut dyn Comm,
) -> Result<PathBuf, SnapshotError> {
    let here = particles.id.len() * elements_of_particle()
        + contacts.count() * elements_of_contact()
        + records.count() * of_record(records.columns());
    let mut all = [here as i64];
    comm.sum(&mut all);
    let way = WriteMethod::for_bytes(all[0] as u64 * ELEMENT as u64);
    write_in(way, directory, header, particles, contacts, records, comm)
}

/// Writes a snapshot like [`write_rows`], by the given method for any size. The files are the same.
///
/// # Errors
/// See [`write`].
pub fn write_in(
    way: WriteMethod,
    directory: &Path,
    header: &Header,
    particles: &ParticleTable,
    contacts: &dyn Rows<ContactRow>,
    records: &dyn ContactRecordRows,
    comm: &mut dyn Comm,
) -> Result<PathBuf, SnapshotError> {
    let header = &of_root(header, comm);
    let checked = check_lengths(header, particles, contacts, comm);
    agree(comm, checked)?;
    let shapes = check_shapes(directory, header, particles, comm);
    agree(comm, shapes)?;
    if way == WriteMethod::Together {
        write_files(directory, header, particles, contacts, records, comm)?;
    } else if comm.size() == 1 {
        write_files(directory, header, particles, contacts, records, &mut Alone::default())?;
    } else {
        let mut written = Ok(());
        if let Some((particles, contacts, records)) = gather(particles, contacts, records, comm) {
            let alone = &mut Alone::default();
            written = write_files(directory, header, &particles, &contacts, &records, alone);
        }
        agree(comm, written)?;
    }
    Ok(directory.join(particles_name(header.step)))
}

/// Rows of all ranks on rank 0; `None` elsewhere. Collective.
fn gather(
    particles: &ParticleTable,
    contacts: &dyn Rows<ContactRow>,
    records: &dyn ContactRecordRows,
    comm: &mut dyn Comm,
) -> Option<(ParticleTable, ContactTable, ContactRecords)> {
    type Columns = Vec<Vec<u8>>;
    let mut mine = ContactRecords::of(records.columns());
    records.each(&mut |named| mine.push(named));
    let here = (particles.bytes(), ContactTable::bytes(contacts), mine);
    let parcels = comm.gather(wire::encode(&here))?;
    let mut all =
        (ParticleTable::default(), ContactTable::default(), ContactRecords::of(records.columns()));
    for parcel in parcels {
        let (particles, contacts, records): (Columns, Columns, ContactRecords) =
            wire::decode(&parcel);
        all.0.append(&particles);
        all.1.append(&contacts);
        all.2.append(&records);
    }
    Some(all)
}

/// Writes both files under temporary names and then renames them. Collective.
fn write_files(
    directory: &Path,
    header: &Header,
    particles: &ParticleTable,
    contacts: &dyn Rows<ContactRow>,
    records: &dyn ContactRecordRows,
    comm: &mut dyn Comm,
) -> Result<(), SnapshotError> {
    make_directory(directory, comm)?;
    let names = [contacts_name(header.step), particles_name(header.step)];
    let partial = names.each_ref().map(|name| files::partial(&directory.join(name)));
    let shares = &Shares::of(&particles.id, comm);
    let written = write_contacts(&partial[0], header, contacts, shares, comm)
        .and_then(|()| write_particles(&partial[1], header, particles, records, shares, comm));
    if written.is_err() && comm.is_root() {
        // Frees disk space; if removal fails, the first error is still the one to report.
        let _ = partial.each_ref().map(fs::remove_file);
    }
    written?;
    on_root(directory, comm, || {
        for (path, name) in partial.iter().zip(&names) {
            let renamed = fs::rename(path, directory.join(name));
            renamed.map_err(|e| io::Error::other(format!("{name}: {e}")))?;
        }
        // The names must be on the disk before the link refers to them.
        File::open(directory)?.sync_all()?;
        link_last(directory, &names[1])?;
        list_with_times(directory, header)
    })
}

/// Header of rank 0 on all ranks. Collective.
fn of_root(header: &Header, comm: &mut dyn Comm) -> Header {
    let mut bytes = wire::encode(header);
    comm.broadcast(&mut bytes);
    wire::decode(&bytes)
}

/// Checks that all columns of a table have the length of its first.
fn check_lengths(
    header: &Header,
    particles: &ParticleTable,
    contacts: &dyn Rows<ContactRow>,
    comm: &dyn Comm,
) -> Result<(), SnapshotError> {
    let rows = |column: &ParticleColumn| column.of(particles).rows();
    let given = PARTICLE_COLUMNS.iter().filter(|c| !c.is_optional() || rows(c) > 0);
    let particles = given.map(|column| ((column.name, rows(column)), particles.id.len()));
    let contacts = contacts.uneven().map(|column| (column, contacts.count()));
    let drives = header.drives.iter().flat_map(|SavedState { columns, .. }| {
        columns.iter().map(|saved| ((&*saved.column.name, saved.rows()), columns[0].rows()))
    });
    match particles.chain(contacts).chain(drives).find(|((_, rows), expected)| rows != expected) {
        None => Ok(()),
        Some(((column, rows), expected)) => Err(SnapshotError::Uneven {
            rank: comm.rank().0,
            column: column.to_owned(),
            rows,
            expected,
        }),
    }
}

/// Checks that the shape of every particle is in the header.
fn check_shapes(
    directory: &Path,
    header: &Header,
    particles: &ParticleTable,
    comm: &dyn Comm,
) -> Result<(), SnapshotError> {
    match particles.shape.iter().position(|shape| shape.index() >= header.shapes.len()) {
        None => Ok(()),
        Some(row) => {
            let (id, shape) = (particles.id[row], particles.shape[row].0);
            let cause = format!("particle {id} has shape {shape}, which the header does not list");
            Err(SnapshotError::write(directory, comm, &cause))
        }
    }
}

fn write_particles(
    path: &Path,
    header: &Header,
    particles: &ParticleTable,
    records: &dyn ContactRecordRows,
    shares: &Shares,
    comm: &mut dyn Comm,
) -> Result<(), SnapshotError> {
    let keys: Vec<Key> = particles.id.iter().map(|&id| (id, id)).collect();
    let order = Order::of(&keys, shares, comm);
    drop(keys);
    // A rank without particles cannot know from its own rows which columns the scene needs.
    let mut rows = PARTICLE_COLUMNS
        .iter()
        .map(|column| column.of(particles).rows() as i64)
        .collect::<Vec<_>>();
    comm.sum(&mut rows);
    let is_there = |column: &ParticleColumn, rows: i64| rows > 0 || !column.is_optional();
    let of_record = of_record(records.columns());
    let elements =
        particles.id.len() * elements_of_particle() + records.count() * of_record + OF_PART;
    let mut file = create(path, elements, header, comm)?;

    file.group("/VTKHDF")?;
    vtk_version(&mut file)?;
    points_of_cells(&mut file, order.rows(), 1)?;
    cells(&mut file, "Vertices", order.rows(), 1)?;
    for category in ["Lines", "Polygons", "Strips"] {
        cells(&mut file, category, 0, 1)?;
    }
    file.group("/restart")?;
    for group in ["/VTKHDF/PointData", "/restart/particles"] {
        file.group(group)?;
    }
    for (column, rows) in PARTICLE_COLUMNS.iter().zip(rows) {
        if is_there(column, rows) {
            column.write(particles, &order, &mut file)?;
        }
        if is_there(column, rows) && column.name == QUATERNION {
            file.note(&column.place, "order", "w, x, y, z")?;
        }
    }
    file.rows_in(&order, &GLYPH_SEMI_AXES, numbers(&semi_axes(header, particles)))?;
    drop(order);

    write_records(&mut file, records, shares)?;
    write_header(&mut file, header)?;
    file.close()
}

/// Half lengths of each particle along its axes, for pictures [m].
pub fn semi_axes(header: &Header, particles: &ParticleTable) -> Vec<Vec3> {
    let of_row = |(row, shape): (usize, &ShapeId)| {
        header.shapes[shape.index()].semi_axes * particles.scale_of(row)
    };
    particles.shape.iter().enumerate().map(of_row).collect()
}

fn write_records(
    file: &mut SnapshotFile,
    records: &dyn ContactRecordRows,
    shares: &Shares,
) -> Result<(), SnapshotError> {
    fn of_all<T>(records: &dyn ContactRecordRows, get: impl Fn(&ContactRecord) -> T) -> Vec<T> {
        let mut column = Vec::with_capacity(records.count());
        records.each(&mut |named| column.push(get(named)));
        column
    }
    file.group(RECORDS)?;
    let order = &Order::of(&of_all(records, |h| (h.a, h.b)), shares, file.comm());
    file.rows_in(order, &RECORD_A, &of_all(records, |h| h.a.to_file()))?;
    file.rows_in(order, &RECORD_B, &of_all(records, |h| h.b.to_file()))?;
    let normals = of_all(records, |h| h.geometry.normal);
    file.rows_in(order, &RECORD_NORMAL, numbers(&normals))?;
    drop(normals);
    file.rows_in(order, &RECORD_OVERLAP, &of_all(records, |h| h.geometry.overlap))?;
    for (StateColumn { name, unit, width }, numbers) in StateColumn::ranges(records.columns()) {
        let mut values = Vec::with_capacity(records.count() * width);
        records.each(&mut |h| values.extend_from_slice(&h.state[numbers.clone()]));
        file.rows_in(order, &column(&format!("{RECORDS}/{name}"), *width, unit), &values)?;
    }
    Ok(())
}

/// Copies one column, in memory only while it is written.
fn column_of<Row, T>(rows: &dyn Rows<Row>, get: impl Fn(&Row) -> T) -> Vec<T> {
    let mut column = Vec::with_capacity(rows.count());
    rows.each(&mut |row| column.push(get(row)));
    column
}

fn write_contacts(
    path: &Path,
    header: &Header,
    contacts: &dyn Rows<ContactRow>,
    shares: &Shares,
    comm: &mut dyn Comm,
) -> Result<(), SnapshotError> {
    let order = &Order::of(&column_of(contacts, |c| (c.a, c.b)), shares, comm);
    let elements = contacts.count() * elements_of_contact() + OF_PART;
    let mut file = create(path, elements, header, comm)?;

    file.group("/VTKHDF")?;
    vtk_version(&mut file)?;
    points_of_cells(&mut file, order.rows(), 2)?;
    let ends = column_of(contacts, |c| [c.centre, c.centre + c.branch]);
    let moved = order.moved(numbers(ends.as_flattened()), 2 * POINTS.width, file.comm());
    file.rows(&POINTS, &moved)?;
    drop(moved);
    drop(ends);
    cells(&mut file, "Lines", order.rows(), 2)?;
    for category in ["Vertices", "Polygons", "Strips"] {
        cells(&mut file, category, 0, 1)?;
    }

    file.group("/VTKHDF/CellData")?;
    for column in &CONTACT_COLUMNS {
        column.write(contacts, order, &mut file)?;
    }
    file.rows_in(order, &FORCE_MAGNITUDE, &column_of(contacts, |c| c.force().norm()))?;

    write_header(&mut file, header)?;
    file.close()
}

/// Creates a file with space for this number of elements of this rank, and for the scene, shapes, walls and drives.
fn create<'a>(
    path: &Path,
    elements: usize,
    header: &Header,
    comm: &'a mut dyn Comm,
) -> Result<SnapshotFile<'a>, SnapshotError> {
    let texts = if comm.is_root() {
        let saved = header.drives.iter().flat_map(|drive| &drive.columns);
        let drives: usize = saved.map(|column| column.values.bytes()).sum();
        let walls = size_of_val(&*header.triangles) + as_long_as_the_longest(&bodies(header));
        header.scene.len() + as_long_as_the_longest(&geometries(header)) + walls + drives
    } else {
        0
    };
    SnapshotFile::create(path, (elements * ELEMENT + texts) as u64, comm)
}

/// Space of texts in a table: each takes that of the longest [bytes].
fn as_long_as_the_longest(texts: &[String]) -> usize {
    texts.len() * texts.iter().map(String::len).max().unwrap_or(0)
}

/// Writes the number of points of all cells; this rank writes `count` cells of `points` points each.
///
/// # Errors
/// See [`SnapshotFile::rows`].
pub fn points_of_cells(
    file: &mut SnapshotFile,
    count: usize,
    points: usize,
) -> Result<(), SnapshotError> {
    let (_, total) = file.share(count);
    file.table(&POINT_COUNTS, &[(total * points) as i64])
}

/// Writes one of the four categories of cells of `PolyData`: `count` cells of this rank after those of the earlier ranks,
/// each of the next `points` points. Without any cell there is still one offset.
///
/// # Errors
/// See [`SnapshotFile::rows`].
pub fn cells(
    file: &mut SnapshotFile,
    category: &str,
    count: usize,
    points: usize,
) -> Result<(), SnapshotError> {
    let (before, total) = file.share(count);
    let ids = |cells: usize| (cells * points) as i64;
    let first = file.comm().is_root().then_some(0);
    let ends = (before + 1..=before + count).map(ids);
    let offsets: Vec<i64> = first.into_iter().chain(ends).collect();
    let members: Vec<i64> = (ids(before)..ids(before + count)).collect();
    let group = format!("/VTKHDF/{category}");
    file.group(&group)?;
    let name = |name| format!("{group}/{name}");
    file.table(&column(&name("NumberOfCells"), 1, ""), &[total as i64])?;
    file.table(&column(&name("NumberOfConnectivityIds"), 1, ""), &[ids(total)])?;
    file.rows(&column(&name("Offsets"), 1, ""), &offsets)?;
    file.rows(&column(&name("Connectivity"), 1, ""), &members)
}

/// Begins a `PolyData` in its group.
///
/// # Errors
/// See [`SnapshotFile::rows`].
pub fn vtk_version(file: &mut SnapshotFile) -> Result<(), SnapshotError> {
    file.numbers("/VTKHDF", "Version", &[2i64, 0])?;
    file.text("/VTKHDF", "Type", "PolyData")
}

fn numbers(vectors: &[Vec3]) -> &[f64] {
    bytemuck::cast_slice(vectors)
}

fn vectors(numbers: &[f64]) -> Vec<Vec3> {
    numbers.as_chunks().0.iter().copied().map(Vec3::from).collect()
}
