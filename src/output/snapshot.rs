//! Snapshots: tables to files and back. What stands where: [`super::tables`].
//!
//! Two columns are there for pictures alone: `semi_axes` of each particle, with which and `quaternion`
//! ParaView's 3D Glyphs draw it, and `force` of each contact, the magnitude of the whole force [N].

use super::columns::Value as _;
use super::hdf5::{Column, Piece, SnapshotFile, StoredFile};
use super::header::{Header, ShapeRow, WallRow};
use super::order::{Key, Order, Shares};
use super::tables::{
    self, CONTACT_COLUMNS, ContactRecordRows, ContactRow, ContactTable, PARTICLE_COLUMNS,
    ParticleColumn, ParticleTable, QUATERNION, Rows,
};
use super::{SnapshotError, make_directory, on_root, series};
use crate::cell::{Cell, Shear};
use crate::comm::alone::Alone;
use crate::comm::{Comm, agree, wire};
use crate::contact::{ContactRecord, ContactRecords, Geometry, StateColumn};
use crate::drive::{SavedState, rain};
use crate::files;
use crate::ids::{GlobalId, ShapeId};
use crate::math::Vec3;
use crate::measure::Departed;
use crate::particles::Needs;
use crate::particles::walls::Saved;
use crate::shape::Shape;
use serde::de::DeserializeOwned;
use std::cell::OnceCell;
use std::fs::{self, File};
use std::io::{self, Read as _};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The link in a snapshot directory to the newest particles file.
pub const LAST: &str = "last.vtkhdf";

/// The particles files of a directory with their times, for ParaView.
pub const PARTICLES_LIST: &str = "particles.vtkhdf.series";
/// The contacts files likewise.
pub const CONTACTS_LIST: &str = "contacts.vtkhdf.series";

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

// What VTK asks for, with one entry per part, of which there is one.
const POINT_COUNTS: Column = column("/VTKHDF/NumberOfPoints", 1, "");
const POINTS: Column = column("/VTKHDF/Points", 3, "m");

/// The axes with which pictures draw a particle.
const GLYPH_SEMI_AXES: Column = column("/VTKHDF/PointData/semi_axes", 3, "m");

// What a restart needs of contacts.
const RECORD_A: Column = column("/restart/contacts/a", 1, "1");
const RECORD_B: Column = column("/restart/contacts/b", 1, "1");
const RECORD_NORMAL: Column = column("/restart/contacts/normal", 3, "1");
const RECORD_OVERLAP: Column = column("/restart/contacts/overlap", 1, "m");
/// Where what the law remembers stands beside them, a dataset for each column.
const RECORDS: &str = "/restart/contacts";

/// The magnitude of the whole force, for pictures.
const FORCE_MAGNITUDE: Column = column("/VTKHDF/CellData/force", 1, "N");

/// No element of a column takes more [bytes].
const ELEMENT: usize = size_of::<f64>();

/// Bytes of a contact in both files, its record included, of which a law remembers these columns.
pub fn contact_bytes(remembered: &[StateColumn]) -> usize {
    ELEMENT * (elements_of_contact() + of_record(remembered))
}

/// Elements at most of a particle: all columns, the axes, one vertex and its end.
fn elements_of_particle() -> usize {
    tables::particle_elements() + GLYPH_SEMI_AXES.width + 2
}

/// Bytes of a particle in a snapshot of a scene with these needs, what is remembered of its contacts left out.
pub fn particle_bytes(needs: &Needs) -> usize {
    tables::particle_bytes(needs) + ELEMENT * (GLYPH_SEMI_AXES.width + 2)
}

/// Elements of a record.
fn of_record(remembered: &[StateColumn]) -> usize {
    let geometry = RECORD_A.width + RECORD_B.width + RECORD_NORMAL.width + RECORD_OVERLAP.width;
    geometry + StateColumn::total_width(remembered)
}

/// Elements of a contact: all columns, the force, two points, one line of two ids and its end.
fn elements_of_contact() -> usize {
    tables::contact_elements() + FORCE_MAGNITUDE.width + 2 * POINTS.width + 3
}

/// Of so many particles at a time the scales are looked at.
const PARTICLES_AT_ONCE: usize = 1 << 20;

/// Elements of a part: its counts, and the first offset of each category.
const OF_PART: usize = 13;

/// How the ranks of a run write a snapshot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// All together, each its share of the rows: nothing grows with the whole on any rank.
    Together,
    /// Rank 0 gathers all rows and writes alone: of little data it is faster, because ranks that write together wait for each
    /// other some hundred times.
    ThroughRoot,
}

impl Way {
    /// A snapshot of fewer bytes in all goes through rank 0.
    pub const SMALL: u64 = 16 << 20;

    /// The faster one for so many bytes in all.
    pub const fn for_bytes(bytes: u64) -> Self {
        if bytes < Self::SMALL { Self::ThroughRoot } else { Self::Together }
    }
}

// The header.
const SCENE: Column = column("/run/scene", 1, "");
const STOP: Column = column("/run/stop", 1, "");
const WALL_NAME: Column = column("/walls/name", 1, "");
const WALL_POINT: Column = column("/walls/point", 3, "m");
const WALL_NORMAL: Column = column("/walls/normal", 3, "1");
const WALL_VELOCITY: Column = column("/walls/velocity", 3, "m/s");
const WALL_FORCE: Column = column("/walls/force", 3, "N");
/// Null of a wall that is no more than one plane; not there if all are.
const WALL_BODY: Column = column("/walls/body", 1, "");
/// The corners of all triangles, in the axes of their walls; not there without triangles.
const WALL_TRIANGLES: Column = column("/walls/triangles", 9, "m");
const SHAPE_NAME: Column = column("/shapes/name", 1, "");
const SHAPE_KIND: Column = column("/shapes/kind", 1, "");
const SHAPE_SEMI_AXES: Column = column("/shapes/semi_axes", 3, "m");
const SHAPE_VOLUME: Column = column("/shapes/volume", 1, "m^3");
const SHAPE_MASS: Column = column("/shapes/mass", 1, "kg");
const SHAPE_INERTIA: Column = column("/shapes/inertia", 3, "kg m^2");
/// Not there in files of older versions, like the next.
const SHAPE_SCALES: Column = column("/shapes/scales", 2, "1");
const SHAPE_MOST: Column = column("/shapes/most", 1, "1");
const SHAPE_GEOMETRY: Column = column("/shapes/geometry", 1, "");

/// Writes a snapshot: the contacts file, the particles file and, when both are on the disk under their
/// own names, the link [`LAST`]. Creates `directory` if it is missing. Collective; the header of rank 0
/// is taken. Returns the path of the particles file.
///
/// A crash at any moment leaves the last good snapshot; files named `.*.partial` are what it leaves
/// besides, and harmless.
///
/// # Errors
/// The same on every rank: [`SnapshotError::Write`], or [`SnapshotError::Uneven`] for a table whose
/// columns differ in length.
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

/// As [`write`], of contacts and records that need not all be there at once.
///
/// # Errors
/// As [`write`].
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
    let way = Way::for_bytes(all[0] as u64 * ELEMENT as u64);
    write_in(way, directory, header, particles, contacts, records, comm)
}

/// As [`write_rows`], in this way, however large the snapshot is. The files are the same.
///
/// # Errors
/// As [`write`].
pub fn write_in(
    way: Way,
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
    if way == Way::Together {
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

/// The rows of all ranks, on rank 0; `None` elsewhere. Collective.
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

/// Writes both files and lets them appear under their names. Collective.
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
        // Room for others; if it cannot be made, the first error is still the one to report.
        let _ = partial.each_ref().map(fs::remove_file);
    }
    written?;
    on_root(directory, comm, || {
        for (path, name) in partial.iter().zip(&names) {
            let renamed = fs::rename(path, directory.join(name));
            renamed.map_err(|e| io::Error::other(format!("{name}: {e}")))?;
        }
        // The names are on the disk before the link speaks of them.
        File::open(directory)?.sync_all()?;
        link_last(directory, &names[1])?;
        list_with_times(directory, header)
    })
}

/// Lists all snapshots of the directory, the one of this header among them, for ParaView.
fn list_with_times(directory: &Path, header: &Header) -> io::Result<()> {
    let known = series::times(&directory.join(PARTICLES_LIST));
    let time_of = |step: u64, path: &Path| match known.get(&particles_name(step)) {
        _ if step == header.step => Some(header.time),
        Some(time) => Some(*time),
        // Of a time before there were lists. One that is damaged is not listed.
        None => Reader::open(path).ok().map(|reader| reader.header().time),
    };
    let mut steps = steps_in(directory);
    steps.sort();
    let timed: Vec<(u64, f64)> =
        steps.iter().filter_map(|(step, path)| Some((*step, time_of(*step, path)?))).collect();
    for (list, name) in
        [(PARTICLES_LIST, particles_name as fn(u64) -> String), (CONTACTS_LIST, contacts_name)]
    {
        let files = timed.iter().map(|&(step, time)| (name(step), time)).collect();
        series::write(directory, list, files)?;
    }
    Ok(())
}

/// Keeps a directory to one run: none of its snapshots may be later than the step at which a run begins, and there are
/// earlier ones only if it goes on from one of them. Files of others are not replaced. If `remove`, those that are later go, and what
/// a run before left besides. Where the run goes on from the
/// directory as a whole, they were passed over as damaged, and stay. `start` is what the same stage goes on from, `before`
/// the stage before, if this one begins with it. Collective.
///
/// # Errors
/// On all ranks: [`SnapshotError::Later`], [`SnapshotError::StageBefore`], [`SnapshotError::Foreign`], or rank 0 cannot remove
/// them.
pub fn none_later(
    directory: &Path,
    step: u64,
    remove: bool,
    start: Option<&Path>,
    before: Option<&Path>,
    comm: &mut dyn Comm,
) -> Result<(), SnapshotError> {
    let [here, start, before] =
        [Some(directory), start, before].map(|path| path?.canonicalize().ok());
    let is_in_here =
        |path: &Option<PathBuf>| path.as_deref().and_then(Path::parent) == here.as_deref();
    let is_one_of_them = is_in_here(&start);
    // The stage before is kept, so that the run can be done once more.
    let follows_them = before == here || is_in_here(&before);
    let mut later = Vec::new();
    // As rank 0 sees the directory: others may see it late.
    if comm.is_root() && start != here {
        later = steps_in(directory);
        let is_strange = !is_one_of_them && if remove { !follows_them } else { step > 0 };
        later.retain(|(of, _)| *of > step || is_strange);
    }
    if remove {
        return on_root(directory, comm, || {
            for (step, path) in &later {
                fs::remove_file(path)?;
                files::remove_if_there(&directory.join(contacts_name(*step)))?;
            }
            if !later.is_empty() {
                files::remove_if_there(&directory.join(LAST))?;
            }
            if start.is_none() { remove_lists(directory) } else { Ok(()) }
        });
    }
    let path = super::name_of(directory);
    let found = later.iter().map(|(step, _)| *step).max().map(|newest| {
        if follows_them && newest <= step {
            SnapshotError::StageBefore { path }
        } else {
            SnapshotError::Later { path, step, newest }
        }
    });
    agree(comm, found.map_or(Ok(()), Err))?;
    let goes_on_here = is_one_of_them || start == here;
    let foreign = if comm.is_root() && !goes_on_here { foreign(directory) } else { None };
    let error = |path: PathBuf| Err(SnapshotError::Foreign { path: super::name_of(&path) });
    agree(comm, foreign.map_or(Ok(()), error))
}

/// A file of the directory that no run wrote, although it has the name of one that each writes.
fn foreign(directory: &Path) -> Option<PathBuf> {
    const BEGINNINGS: [(&str, &str); 5] = [
        ("history.csv", "step,"),
        ("performance.csv", "ranks,"),
        ("report.json", "{\n  \"program\": \"dem-mpi"),
        (PARTICLES_LIST, "{\n  \"file-series-version\""),
        (CONTACTS_LIST, "{\n  \"file-series-version\""),
    ];
    let strange = BEGINNINGS.iter().find(|(name, beginning)| {
        let path = directory.join(name);
        path.symlink_metadata().is_ok() && !begins_with(&path, beginning)
    });
    let last = directory.join(LAST);
    // A copy of a folder has a copy of the newest snapshot in place of the link.
    let is_kept = last.symlink_metadata().is_ok_and(|last| !last.is_symlink());
    strange.map(|(name, _)| directory.join(name)).or_else(|| is_kept.then_some(last))
}

/// Is a file empty, or does it begin with this text?
fn begins_with(path: &Path, text: &str) -> bool {
    let mut beginning = Vec::new();
    let file = files::open(path);
    let read = file.and_then(|file| file.take(text.len() as u64).read_to_end(&mut beginning));
    read.is_ok() && (beginning.is_empty() || beginning == text.as_bytes())
}

/// Removes the lists of grains that came or left in a run before, which would pass for those of this one, and its reports.
fn remove_lists(directory: &Path) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let is_list = (name.starts_with("entered_") || name.starts_with("left_"))
            && path.extension().is_some_and(|ending| ending == "csv")
            && begins_with(&path, "step,time_s,id,");
        if is_list || ["report.json", "performance.csv", "history.csv"].contains(&name) {
            files::remove_if_there(&path)?;
        }
    }
    Ok(())
}

/// Lets [`LAST`] point to a file of the same directory.
fn link_last(directory: &Path, name: &str) -> io::Result<()> {
    let new = files::partial(&directory.join(LAST));
    files::remove_if_there(&new)?;
    std::os::unix::fs::symlink(name, &new)?;
    fs::rename(&new, directory.join(LAST))?;
    File::open(directory)?.sync_all()
}

/// The header of rank 0.
fn of_root(header: &Header, comm: &mut dyn Comm) -> Header {
    let mut bytes = wire::encode(header);
    comm.broadcast(&mut bytes);
    wire::decode(&bytes)
}

/// Are all columns of the tables of the length of their first?
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

/// Is every particle's shape one of the header's?
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
    // A rank without particles cannot tell by itself which columns the scene needs.
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

/// Half lengths of each particle along its axes, with which pictures draw it [m].
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

/// One column, for as long as it is written.
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

/// Creates a file with room for so many elements of this rank, and for the scene, the shapes, the walls and the drives.
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

/// The room that texts take in a table: that of the longest for each.
fn as_long_as_the_longest(texts: &[String]) -> usize {
    texts.len() * texts.iter().map(String::len).max().unwrap_or(0)
}

/// The body of each wall as JSON.
fn bodies(header: &Header) -> Vec<String> {
    let json = |row: &WallRow| serde_json::to_string(&row.body);
    header.walls.iter().map(json).collect::<Result<_, _>>().expect("a body can be stored")
}

/// The geometry of each shape as JSON.
fn geometries(header: &Header) -> Vec<String> {
    let json = |row: &ShapeRow| serde_json::to_string(&row.geometry);
    header.shapes.iter().map(json).collect::<Result<_, _>>().expect("a geometry can be stored")
}

/// Writes how many points all cells have, of which this rank writes `count` of `points` points each.
fn points_of_cells(
    file: &mut SnapshotFile,
    count: usize,
    points: usize,
) -> Result<(), SnapshotError> {
    let (_, total) = file.share(count);
    file.table(&POINT_COUNTS, &[(total * points) as i64])
}

/// Writes one of the four categories of cells that `PolyData` has: `count` cells of this rank after those of the ranks
/// before, each of the next `points` points. Without any cell there is still one offset.
fn cells(
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

fn vtk_version(file: &mut SnapshotFile) -> Result<(), SnapshotError> {
    file.numbers("/VTKHDF", "Version", &[2i64, 0])?;
    file.text("/VTKHDF", "Type", "PolyData")
}

fn write_header(file: &mut SnapshotFile, header: &Header) -> Result<(), SnapshotError> {
    let Header {
        step,
        time,
        dt,
        stage_begin,
        stage_shift,
        next_id,
        departed,
        most_moving,
        stop,
        cell,
        gravity,
        walls,
        triangles,
        drives,
        shapes,
        scene,
    } = header;
    file.group("/run")?;
    file.text("/run", "program", concat!("dem-mpi ", env!("CARGO_PKG_VERSION")))?;
    file.text("/run", "units", "time, dt, stage_begin_time: s; gravity: m/s^2")?;
    file.text("/run", VELOCITIES.0, VELOCITIES.1)?;
    file.numbers("/run", "step", &[*step])?;
    file.numbers("/run", "time", &[*time])?;
    file.numbers("/run", "dt", &[*dt])?;
    file.numbers("/run", "stage_begin_step", &[stage_begin.0])?;
    file.numbers("/run", "stage_begin_time", &[stage_begin.1])?;
    if *stage_shift != 0.0 {
        file.numbers("/run", STAGE_SHIFT, &[*stage_shift])?;
    }
    file.numbers("/run", "next_id", &[*next_id])?;
    file.numbers("/run", "gravity", gravity.as_slice())?;
    if *departed != Departed::default() {
        file.numbers("/run", DEPARTED, &[departed.received, departed.dissipated])?;
        file.numbers("/run", DEPARTED_CHANNELS, &departed.channels)?;
    }
    if *most_moving > 0.0 {
        file.numbers("/run", MOST_MOVING, &[*most_moving])?;
    }
    file.texts(&SCENE, &[scene])?;
    if !stop.is_empty() {
        file.texts(&STOP, &[stop])?;
    }

    file.group("/domain")?;
    file.text("/domain", "units", "low, high: m")?;
    file.numbers("/domain", "low", cell.low().as_slice())?;
    file.numbers("/domain", "high", cell.high().as_slice())?;
    file.numbers("/domain", "periodic", &cell.periodic().map(u8::from))?;
    if let Some(Shear { along, across, rate, strain }) = cell.shear() {
        file.text(
            "/domain",
            "shear",
            "axes along and across, 0 to 2; rate [1/s] and strain of images",
        )?;
        file.numbers("/domain", SHEAR_AXES, &[along as u64, across as u64])?;
        file.numbers("/domain", SHEAR, &[rate, strain])?;
    }

    file.group("/walls")?;
    let vectors = |get: fn(&WallRow) -> Vec3| walls.iter().map(get).collect::<Vec<_>>();
    file.texts(&WALL_NAME, &walls.iter().map(|w| &*w.name).collect::<Vec<_>>())?;
    file.table(&WALL_POINT, numbers(&vectors(|w| w.point)))?;
    file.table(&WALL_NORMAL, numbers(&vectors(|w| w.normal)))?;
    file.table(&WALL_VELOCITY, numbers(&vectors(|w| w.velocity)))?;
    file.table(&WALL_FORCE, numbers(&vectors(|w| w.force)))?;
    if walls.iter().any(|wall| wall.body.is_some()) {
        file.texts(&WALL_BODY, &bodies(header).iter().map(|body| &**body).collect::<Vec<_>>())?;
    }
    if !triangles.is_empty() {
        file.table(&WALL_TRIANGLES, triangles.as_flattened())?;
    }

    for SavedState { drive, columns } in drives {
        let group = format!("/{drive}");
        file.group(&group)?;
        columns.iter().try_for_each(|column| file.saved(&group, column))?;
    }

    file.group("/shapes")?;
    let vectors = |get: fn(&ShapeRow) -> Vec3| shapes.iter().map(get).collect::<Vec<_>>();
    file.texts(&SHAPE_NAME, &shapes.iter().map(|s| &*s.name).collect::<Vec<_>>())?;
    file.texts(&SHAPE_KIND, &shapes.iter().map(|s| &*s.kind).collect::<Vec<_>>())?;
    file.table(&SHAPE_SEMI_AXES, numbers(&vectors(|s| s.semi_axes)))?;
    file.table(&SHAPE_VOLUME, &shapes.iter().map(|s| s.volume).collect::<Vec<_>>())?;
    file.table(&SHAPE_MASS, &shapes.iter().map(|s| s.mass).collect::<Vec<_>>())?;
    file.table(&SHAPE_INERTIA, numbers(&vectors(|s| s.inertia)))?;
    if let Some(scales) = shapes.iter().map(|s| s.scales).collect::<Option<Vec<_>>>() {
        file.table(&SHAPE_SCALES, scales.as_flattened())?;
    }
    if let Some(most) = shapes.iter().map(|s| s.most).collect::<Option<Vec<_>>>() {
        file.table(&SHAPE_MOST, &most)?;
    }
    let geometries = geometries(header);
    file.texts(&SHAPE_GEOMETRY, &geometries.iter().map(|g| &**g).collect::<Vec<_>>())
}

const SHEAR_AXES: &str = "shear_along_across";
const SHEAR: &str = "shear_rate_strain";
/// What particles that were taken out have left behind [J]: received, dissipated. Not there before one was.
const DEPARTED: &str = "departed_received_dissipated_J";
/// [`Header::stage_shift`], if it is not 0 [s].
const STAGE_SHIFT: &str = "stage_shift";
/// Parts of what they had dissipated [J]: tangential dashpots, friction, turning, damping, adhesion.
const DEPARTED_CHANNELS: &str = "departed_dissipated_by_channel_J";
const MOST_MOVING: &str = "largest_kinetic_and_elastic_J";

/// Says to which time velocities belong. Files without it have those of half a step before.
const VELOCITIES: (&str, &str) = ("velocities", "at the time of the positions");

/// The groups of both files that hold no state of a drive.
const GROUPS: [&str; 6] = ["VTKHDF", "restart", "run", "domain", "walls", "shapes"];

/// What drives have saved.
fn read_drives(file: &StoredFile) -> Result<Vec<SavedState>, SnapshotError> {
    let mut drives = Vec::new();
    for drive in file.members("/")? {
        if GROUPS.contains(&&*drive) {
            continue;
        }
        let saved = SavedState { columns: file.saved(&format!("/{drive}"))?, drive };
        if let Some(column) = saved.columns.iter().find(|c| c.rows() != saved.columns[0].rows()) {
            let cause = format!("/{}/{} has another length", saved.drive, column.column.name);
            return Err(SnapshotError::unreadable(file.path(), &cause));
        }
        drives.push(saved);
    }
    drives.extend(rain_of_run(file)?);
    Ok(drives)
}

/// What rain has saved in a file of an older version, where it stands beside the step.
fn rain_of_run(file: &StoredFile) -> Result<Option<SavedState>, SnapshotError> {
    let (fallen, layers) = ("particles_fallen", "layers_fallen");
    let whole = |name| file.numbers::<u64, 1>("/run", name).map(|[n]| n);
    if file.has_attribute("/run", fallen) {
        return Ok(Some(rain::saved(whole(fallen)?)));
    }
    if file.has_attribute("/run", layers) && whole(layers)? > 0 {
        let (path, lacks) = (super::name_of(file.path()), format!("/run/{fallen}"));
        return Err(SnapshotError::Older { path, lacks });
    }
    Ok(None)
}

fn read_header(file: &StoredFile) -> Result<Header, SnapshotError> {
    if !file.has_attribute("/run", VELOCITIES.0) {
        let (path, lacks) = (super::name_of(file.path()), "/run/velocities".to_owned());
        return Err(SnapshotError::Older { path, lacks });
    }
    let walls = Tabulated { file, rows: file.count(WALL_NAME.place)? };
    let (points, normals) = (walls.vectors(&WALL_POINT)?, walls.vectors(&WALL_NORMAL)?);
    let (velocities, forces) = (walls.vectors(&WALL_VELOCITY)?, walls.vectors(&WALL_FORCE)?);
    let bodies = walls.bodies()?;
    let walls = file.texts(&WALL_NAME)?.into_iter().enumerate().map(|(k, name)| WallRow {
        name,
        point: points[k],
        normal: normals[k],
        velocity: velocities[k],
        force: forces[k],
        body: bodies[k].clone(),
    });

    let shapes = Tabulated { file, rows: file.count(SHAPE_NAME.place)? };
    let geometries = shapes.geometries()?;
    let kinds = shapes.texts(&SHAPE_KIND)?;
    let (axes, inertias) = (shapes.vectors(&SHAPE_SEMI_AXES)?, shapes.vectors(&SHAPE_INERTIA)?);
    let (volumes, masses) = (shapes.numbers(&SHAPE_VOLUME)?, shapes.numbers(&SHAPE_MASS)?);
    let (scales, most) = (shapes.scales()?, shapes.most()?);
    let shapes = file.texts(&SHAPE_NAME)?.into_iter().enumerate().map(|(k, name)| ShapeRow {
        name,
        kind: kinds[k].clone(),
        semi_axes: axes[k],
        volume: volumes[k],
        mass: masses[k],
        inertia: inertias[k],
        scales: scales[k],
        most: most[k],
        geometry: geometries[k].clone(),
    });

    let number = |name| file.numbers::<f64, 1>("/run", name).map(|[n]| n);
    let whole = |name| file.numbers::<u64, 1>("/run", name).map(|[n]| n);
    let vector = |group, name| file.numbers::<f64, 3>(group, name).map(Vec3::from);
    let mut departed = Departed::default();
    if file.has_attribute("/run", DEPARTED) {
        [departed.received, departed.dissipated] = file.numbers("/run", DEPARTED)?;
        departed.channels = file.numbers("/run", DEPARTED_CHANNELS)?;
    }
    let periodic = file.numbers::<u8, 3>("/domain", "periodic")?.map(|p| p != 0);
    let (low, high) = (vector("/domain", "low")?, vector("/domain", "high")?);
    if (0..3).any(|axis| periodic[axis] && !((high - low)[axis] > 0.0 && low[axis].is_finite())) {
        return Err(file.damaged("/domain"));
    }
    let mut cell = Cell::new(low, high, periodic);
    if file.has_attribute("/domain", SHEAR) {
        let [along, across] =
            file.numbers::<u64, 2>("/domain", SHEAR_AXES)?.map(|axis| axis as usize);
        let [rate, strain] = file.numbers("/domain", SHEAR)?;
        let sheared = cell.with_shear(Shear { along, across, rate, strain });
        cell = sheared.ok_or_else(|| file.damaged("/domain"))?;
    }
    let (step, stage_begin_step) = (whole("step")?, whole("stage_begin_step")?);
    if step < stage_begin_step {
        return Err(file.damaged("/run"));
    }
    Ok(Header {
        step,
        time: number("time")?,
        dt: number("dt")?,
        stage_begin: (stage_begin_step, number("stage_begin_time")?),
        stage_shift: if file.has_attribute("/run", STAGE_SHIFT) {
            number(STAGE_SHIFT)?
        } else {
            0.0
        },
        next_id: whole("next_id")?,
        departed,
        most_moving: if file.has_attribute("/run", MOST_MOVING) {
            number(MOST_MOVING)?
        } else {
            0.0
        },
        stop: if file.has(STOP.place) { file.texts(&STOP)?.concat() } else { String::new() },
        cell,
        gravity: vector("/run", "gravity")?,
        walls: walls.collect(),
        triangles: if file.has(WALL_TRIANGLES.place) {
            let rows = file.count(WALL_TRIANGLES.place)?;
            file.rows::<f64>(&WALL_TRIANGLES, 0..rows)?.as_chunks().0.to_vec()
        } else {
            Vec::new()
        },
        drives: read_drives(file)?,
        shapes: shapes.collect(),
        scene: file.texts(&SCENE)?.concat(),
    })
}

/// The small tables of the header: columns that must have `rows` rows.
struct Tabulated<'a> {
    file: &'a StoredFile,
    rows: usize,
}

impl Tabulated<'_> {
    fn vectors(&self, column: &Column) -> Result<Vec<Vec3>, SnapshotError> {
        self.file.rows(column, 0..self.rows).map(|numbers| vectors(&numbers))
    }

    fn numbers(&self, column: &Column) -> Result<Vec<f64>, SnapshotError> {
        self.file.rows(column, 0..self.rows)
    }

    fn texts(&self, column: &Column) -> Result<Vec<String>, SnapshotError> {
        let texts = self.file.texts(column)?;
        if texts.len() == self.rows { Ok(texts) } else { Err(self.file.uneven(column)) }
    }

    fn geometries(&self) -> Result<Vec<Option<Shape>>, SnapshotError> {
        let place = SHAPE_GEOMETRY.place;
        if !self.file.has(place) {
            return Err(SnapshotError::Older {
                path: super::name_of(self.file.path()),
                lacks: place.to_owned(),
            });
        }
        let geometries = self.json(&SHAPE_GEOMETRY)?;
        let is_wall = |shape: &Shape| matches!(shape, Shape::HalfSpace(_) | Shape::TriangleMesh(_));
        if geometries.iter().flatten().any(is_wall) {
            return Err(self.file.damaged(place));
        }
        Ok(geometries)
    }

    fn scales(&self) -> Result<Vec<Option<[f64; 2]>>, SnapshotError> {
        if !self.file.has(SHAPE_SCALES.place) {
            return Ok(vec![None; self.rows]);
        }
        let numbers = self.numbers(&SHAPE_SCALES)?;
        Ok(numbers.as_chunks::<2>().0.iter().copied().map(Some).collect())
    }

    fn most(&self) -> Result<Vec<Option<f64>>, SnapshotError> {
        if !self.file.has(SHAPE_MOST.place) {
            return Ok(vec![None; self.rows]);
        }
        Ok(self.numbers(&SHAPE_MOST)?.into_iter().map(Some).collect())
    }

    fn bodies(&self) -> Result<Vec<Option<Saved>>, SnapshotError> {
        if self.file.has(WALL_BODY.place) {
            self.json(&WALL_BODY)
        } else {
            Ok(vec![None; self.rows])
        }
    }

    fn json<T: DeserializeOwned>(&self, column: &Column) -> Result<Vec<T>, SnapshotError> {
        let unreadable = |error: serde_json::Error| {
            SnapshotError::unreadable(self.file.path(), &format!("{}: {error}", column.place))
        };
        let texts = self.texts(column)?;
        texts.iter().map(|text| serde_json::from_str(text).map_err(unreadable)).collect()
    }
}

/// An opened snapshot, read serially: any rank, or a program without MPI, opens it for itself.
///
/// Opening checks all bytes of a file against the checksum at its end; a read of all rows of a dataset
/// checks them once more, by the checksum that was made before they were written. Ranks that restart
/// use [`Reader::open_together`].
pub struct Reader {
    particles: StoredFile,
    /// Opened when it is first asked for: a damaged contacts file does not stand in the way of a restart.
    contacts: OnceCell<Result<StoredFile, SnapshotError>>,
    header: Header,
    particle_count: usize,
    contact_record_count: usize,
    passed_over: Vec<SnapshotError>,
}

/// The least and the largest scale of particles [-], and their number.
pub type Sizes = ([f64; 2], u64);

impl Reader {
    /// Opens a particles file, or the newest snapshot of a directory that can be used: the one to which
    /// [`LAST`] points, or else the next before it.
    ///
    /// # Errors
    /// [`SnapshotError::Missing`], [`SnapshotError::Unreadable`], [`SnapshotError::Damaged`],
    /// [`SnapshotError::NoneGood`].
    pub fn open(path: &Path) -> Result<Self, SnapshotError> {
        Self::open_among(path, &mut Alone::default(), |_, _| Ok(()))
    }

    /// As [`Reader::open`] on all ranks, for a restart: each rank checks a share of the particles file,
    /// which has all that a restart reads. Collective.
    ///
    /// # Errors
    /// As [`Reader::open`], the same on every rank.
    pub fn open_together(path: &Path, comm: &mut dyn Comm) -> Result<Self, SnapshotError> {
        Self::open_among(path, comm, |file, comm| file.verify(comm))
    }

    fn open_among(
        path: &Path,
        comm: &mut dyn Comm,
        check: impl Fn(&StoredFile, &mut dyn Comm) -> Result<(), SnapshotError>,
    ) -> Result<Self, SnapshotError> {
        // As rank 0 sees the directory: others may see it late.
        let mut listed = wire::encode(&path.is_dir().then(|| candidates(path)));
        comm.broadcast(&mut listed);
        let mut open = |file: &Path| {
            let opened = Self::open_file(file, comm)?;
            check(&opened.particles, comm).map(|()| opened)
        };
        let Some(candidates) = wire::decode::<Option<Vec<PathBuf>>>(&listed) else {
            return open(path);
        };
        let mut passed_over = Vec::new();
        for file in candidates {
            match open(&file) {
                Ok(reader) => return Ok(Self { passed_over, ..reader }),
                Err(error) => passed_over.push(error),
            }
        }
        if passed_over.is_empty() {
            return open(&path.join(LAST));
        }
        let causes = passed_over.iter().map(SnapshotError::to_string).collect();
        Err(SnapshotError::NoneGood { path: super::name_of(path), causes })
    }

    fn open_file(path: &Path, comm: &mut dyn Comm) -> Result<Self, SnapshotError> {
        // Through the link, so that the other file is found beside the real one.
        let real = path.canonicalize().map_err(|e| SnapshotError::Missing {
            path: super::name_of(path),
            cause: e.to_string(),
        });
        let real = agree(comm, real)?;
        let particles = StoredFile::open(&real, comm)?;
        let read = || {
            if !particles.has("/VTKHDF/PointData/id") {
                let cause =
                    "it has no particles; of a snapshot's two files, name particles_<step>.vtkhdf";
                return Err(SnapshotError::unreadable(&real, &cause));
            }
            let counts = (particles.count(POINTS.place)?, particles.count(RECORD_A.place)?);
            Ok((read_header(&particles)?, counts))
        };
        let read = read();
        let (header, (particle_count, contact_record_count)) = agree(comm, read)?;
        let (contacts, passed_over) = (OnceCell::new(), Vec::new());
        Ok(Self { particles, contacts, header, particle_count, contact_record_count, passed_over })
    }

    /// The particles file.
    pub fn path(&self) -> &Path {
        self.particles.path()
    }

    /// What is wrong with newer snapshots of the directory, the newest first.
    pub fn passed_over(&self) -> &[SnapshotError] {
        &self.passed_over
    }

    /// What the snapshot says once.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// How many particles it has.
    pub fn particle_count(&self) -> usize {
        self.particle_count
    }

    /// Particles, in the order of their ids; of an older version, in that of the ranks that wrote them.
    ///
    /// # Errors
    /// [`SnapshotError::Beyond`], [`SnapshotError::Unreadable`], [`SnapshotError::Damaged`].
    pub fn particles(&self, rows: Range<usize>) -> Result<ParticleTable, SnapshotError> {
        self.columns(rows, |_| true)
    }

    /// The same of some columns, by name; the others stay empty.
    fn columns(
        &self,
        rows: Range<usize>,
        is_wanted: impl Fn(&str) -> bool,
    ) -> Result<ParticleTable, SnapshotError> {
        let table = Piece { file: &self.particles, total: self.particle_count, rows };
        let mut particles = ParticleTable::default();
        for column in PARTICLE_COLUMNS.iter().filter(|column| is_wanted(column.name)) {
            column.read(&mut particles, &table)?;
        }
        self.check_names(&particles)?;
        Ok(particles)
    }

    /// Is every shape one of the header's, and every id one that a particle was given?
    fn check_names(&self, particles: &ParticleTable) -> Result<(), SnapshotError> {
        let (shapes, next_id) = (self.header.shapes.len(), self.header.next_id);
        let unlisted = particles.shape.iter().find(|shape| shape.index() >= shapes);
        let strange = particles.id.iter().find(|id| id.wall_index().is_some() || id.0 >= next_id);
        let cause = match (unlisted, strange) {
            (Some(shape), _) => {
                format!("a particle has shape {}, of {shapes} that it lists", shape.0)
            }
            (None, Some(id)) => format!("particle {id} has an id that was never given"),
            (None, None) => return Ok(()),
        };
        Err(SnapshotError::unreadable(self.path(), &cause))
    }

    /// The least and the largest scale of the particles of each shape [-], and how many there are; `None` of a shape that none of
    /// them has. Only some of the particles are in memory at a time.
    ///
    /// # Errors
    /// As [`Reader::particles`].
    pub fn sizes(&self) -> Result<Vec<Option<Sizes>>, SnapshotError> {
        let mut sizes: Vec<Option<Sizes>> = vec![None; self.header.shapes.len()];
        for first in (0..self.particle_count).step_by(PARTICLES_AT_ONCE) {
            let rows = first..(first + PARTICLES_AT_ONCE).min(self.particle_count);
            let table = self.columns(rows, |name| ["shape", "scale"].contains(&name))?;
            for (row, shape) in table.shape.iter().enumerate() {
                let scale = table.scale_of(row);
                // A number of no shape is told when the particles are read.
                let Some(known) = sizes.get_mut(shape.index()) else { continue };
                let ([least, largest], count) = known.unwrap_or(([scale; 2], 0));
                *known = Some(([least.min(scale), largest.max(scale)], count + 1));
            }
        }
        Ok(sizes)
    }

    /// How many contacts it has.
    ///
    /// # Errors
    /// What stood against opening the contacts file.
    pub fn contact_count(&self) -> Result<usize, SnapshotError> {
        self.contacts_file()?.count(CONTACT_COLUMNS[0].place)
    }

    /// Contacts, in the order of the ids of A, then of B; of an older version, in that of the ranks.
    ///
    /// # Errors
    /// As [`Reader::particles`], or what stood against opening the contacts file.
    pub fn contacts(&self, rows: Range<usize>) -> Result<ContactTable, SnapshotError> {
        let file = self.contacts_file()?;
        let total = file.count(CONTACT_COLUMNS[0].place)?;
        let twice = |r: &Range<usize>| r.start.saturating_mul(2)..r.end.saturating_mul(2);
        let ends = Piece { file, total: 2 * total, rows: twice(&rows) };
        let table = Piece { file, total, rows };
        let mut contacts = ContactTable {
            centre: read_vectors(&ends, &POINTS)?.into_iter().step_by(2).collect(),
            ..ContactTable::default()
        };
        for column in &CONTACT_COLUMNS {
            column.read(&mut contacts, &table)?;
        }
        Ok(contacts)
    }

    /// How many records of touching contacts it has.
    pub fn contact_record_count(&self) -> usize {
        self.contact_record_count
    }

    /// Records of touching contacts, as [`Reader::contacts`].
    ///
    /// # Errors
    /// As [`Reader::particles`].
    pub fn contact_records(&self, rows: Range<usize>) -> Result<ContactRecords, SnapshotError> {
        let table = Piece { file: &self.particles, total: self.contact_record_count, rows };
        let (a, b) = (ids(&table, &RECORD_A)?, ids(&table, &RECORD_B)?);
        let normal = read_vectors(&table, &RECORD_NORMAL)?;
        let overlap: Vec<f64> = table.read(&RECORD_OVERLAP)?;
        let remembered = self.remembered()?;
        let mut states: Vec<Vec<f64>> = Vec::new();
        for StateColumn { name, unit, width } in &remembered {
            states.push(table.read(&column(&format!("{RECORDS}/{name}"), *width, unit))?);
        }
        let mut records = ContactRecords::of(&remembered);
        let mut state = Vec::new();
        for k in 0..a.len() {
            state.clear();
            for (StateColumn { width, .. }, numbers) in remembered.iter().zip(&states) {
                state.extend_from_slice(&numbers[k * width..][..*width]);
            }
            let geometry = Geometry { normal: normal[k], overlap: overlap[k] };
            records.push(&ContactRecord { a: a[k], b: b[k], geometry, state: &state });
        }
        Ok(records)
    }

    /// What the law remembered of touching contacts.
    ///
    /// # Errors
    /// [`SnapshotError::Unreadable`].
    pub fn remembered(&self) -> Result<Vec<StateColumn>, SnapshotError> {
        let geometry = [RECORD_A, RECORD_B, RECORD_NORMAL, RECORD_OVERLAP];
        let mut remembered = Vec::new();
        for name in self.particles.members(RECORDS)? {
            let place = format!("{RECORDS}/{name}");
            if geometry.iter().all(|column| column.place != place) {
                let (width, unit) = self.particles.width_and_unit(&place)?;
                remembered.push(StateColumn { name: name.into(), unit: unit.into(), width });
            }
        }
        Ok(remembered)
    }

    /// Checks every dataset of both files against its checksum.
    ///
    /// # Errors
    /// [`SnapshotError::Damaged`] with the first dataset that has changed, or what stood against
    /// reading.
    pub fn verify(&self) -> Result<(), SnapshotError> {
        self.particles.verify(&mut Alone::default())?;
        self.contacts_file()?.verify(&mut Alone::default())
    }

    fn contacts_file(&self) -> Result<&StoredFile, SnapshotError> {
        let open = || open_contacts(self.particles.path(), &self.header);
        self.contacts.get_or_init(open).as_ref().map_err(Clone::clone)
    }
}

/// The particles files of a directory by which a run may go on, the newest first: that of [`LAST`], then
/// those of the steps before it. What a run left of later steps before it went back to an earlier
/// snapshot is none of them.
fn candidates(directory: &Path) -> Vec<PathBuf> {
    let last = directory.join(LAST);
    let linked = fs::read_link(&last).ok();
    let newest = linked.as_deref().and_then(step_of).unwrap_or(u64::MAX);
    let mut steps = steps_in(directory);
    steps.retain(|(step, _)| *step < newest);
    steps.sort_unstable_by(|x, y| y.cmp(x));
    // The link may be missing, point to nothing, or be a file: a copy.
    let first = last.symlink_metadata().is_ok().then_some(last);
    first.into_iter().chain(steps.into_iter().map(|(_, path)| path)).collect()
}

/// The particles files of a directory and their steps, in any order.
fn steps_in(directory: &Path) -> Vec<(u64, PathBuf)> {
    let entries = fs::read_dir(directory).into_iter().flatten();
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let steps = paths.filter_map(|path| step_of(&path).map(|step| (step, path)));
    steps.filter(|(_, path)| !path.is_dir()).collect()
}

/// The step of a particles file, by its name, if a run gives such names.
pub fn step_of(path: &Path) -> Option<u64> {
    let name = path.file_name()?.to_str()?;
    let step = name.strip_prefix("particles_")?.strip_suffix(".vtkhdf")?.parse().ok()?;
    (particles_name(step) == name).then_some(step)
}

/// Opens the contacts file beside a particles file, and checks that they are of one snapshot.
fn open_contacts(particles: &Path, header: &Header) -> Result<StoredFile, SnapshotError> {
    let name = particles.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    let Some(rest) = name.strip_prefix("particles_") else {
        let cause = "its name does not begin with particles_, so its contacts file is unknown";
        return Err(SnapshotError::unreadable(particles, &cause));
    };
    let path = particles.with_file_name(format!("contacts_{rest}"));
    let file = StoredFile::open(&path, &mut Alone::default())?;
    // Bits: a number that is none equals nothing, and drives may save one.
    if wire::encode(&read_header(&file)?) == wire::encode(header) {
        Ok(file)
    } else {
        Err(SnapshotError::unreadable(&path, &"it belongs to another snapshot than the particles"))
    }
}

fn ids(piece: &Piece, column: &Column) -> Result<Vec<GlobalId>, SnapshotError> {
    Ok(GlobalId::from_elements(piece.read(column)?))
}

fn read_vectors(piece: &Piece, column: &Column) -> Result<Vec<Vec3>, SnapshotError> {
    Ok(vectors(&piece.read(column)?))
}

fn numbers(vectors: &[Vec3]) -> &[f64] {
    bytemuck::cast_slice(vectors)
}

fn vectors(numbers: &[f64]) -> Vec<Vec3> {
    numbers.as_chunks().0.iter().copied().map(Vec3::from).collect()
}
