//! Header of a snapshot, to both files and back.

use super::{column, numbers, vectors};
use crate::cell::{Cell, Shear, Strained};
use crate::drive::SavedState;
use crate::math::{Mat3, Vec3};
use crate::measure::Departed;
use crate::output::SnapshotError;
use crate::output::hdf5::{Column, SnapshotFile, StoredFile};
use crate::output::header::{Header, ShapeRow, WallRow};
use crate::shape::Shape;
use crate::walls::Saved;
use serde::de::DeserializeOwned;

/// Groups of both files that do not hold the state of a drive.
const GROUPS: [&str; 6] = ["VTKHDF", "restart", "run", "domain", "walls", "shapes"];

pub(super) fn write_header(file: &mut SnapshotFile, header: &Header) -> Result<(), SnapshotError> {
    write_run(file, header)?;
    write_domain(file, &header.cell)?;
    write_walls(file, header)?;
    for SavedState { drive, columns } in &header.drives {
        let group = format!("/{drive}");
        file.group(&group)?;
        columns.iter().try_for_each(|column| file.saved(&group, column))?;
    }
    write_shapes(file, header)
}

pub(super) fn read_header(file: &StoredFile) -> Result<Header, SnapshotError> {
    let mut header = Header {
        step: 0,
        time: 0.0,
        dt: 0.0,
        stage_begin: (0, 0.0),
        stage_shift: 0.0,
        next_id: 0,
        departed: Departed::default(),
        most_moving: 0.0,
        stop: String::new(),
        cell: read_domain(file)?,
        gravity: Vec3::zeros(),
        walls: read_walls(file)?,
        triangles: read_triangles(file)?,
        drives: read_drives(file)?,
        shapes: read_shapes(file)?,
        scene: String::new(),
    };
    read_run(file, &mut header)?;
    Ok(header)
}

// --- /run ---

const SCENE: Column = column("/run/scene", 1, "");
const STOP: Column = column("/run/stop", 1, "");

/// A number of the header in `/run`.
type Number<T> = (&'static str, fn(&mut Header) -> &mut T);

const COUNTS: [Number<u64>; 3] = [
    ("step", |header| &mut header.step),
    ("stage_begin_step", |header| &mut header.stage_begin.0),
    ("next_id", |header| &mut header.next_id),
];

/// `stage_shift`, `largest_kinetic_and_elastic_J` and `departed_*` are fields of [`Header`].
const NUMBERS: [Number<f64>; 7] = [
    ("time", |header| &mut header.time),
    ("dt", |header| &mut header.dt),
    ("stage_begin_time", |header| &mut header.stage_begin.1),
    ("stage_shift", |header| &mut header.stage_shift),
    ("largest_kinetic_and_elastic_J", |header| &mut header.most_moving),
    ("departed_received_J", |header| &mut header.departed.received),
    ("departed_dissipated_J", |header| &mut header.departed.dissipated),
];

/// Parts of the energy dissipated by removed particles [J], in the order of
/// [`crate::particles::columns::Quantity::CHANNELS`].
const DEPARTED_CHANNELS: &str = "departed_dissipated_by_channel_J";

fn write_run(file: &mut SnapshotFile, header: &Header) -> Result<(), SnapshotError> {
    file.group("/run")?;
    file.text("/run", "program", concat!("dem-mpi ", env!("CARGO_PKG_VERSION")))?;
    file.text("/run", "units", "time, dt, stage_begin_time, stage_shift: s; gravity: m/s^2")?;
    file.text("/run", "velocities", "at the time of the positions")?;
    let mut copy = header.clone();
    for (name, number) in COUNTS {
        file.numbers("/run", name, &[*number(&mut copy)])?;
    }
    for (name, number) in NUMBERS {
        file.numbers("/run", name, &[*number(&mut copy)])?;
    }
    file.numbers("/run", "gravity", header.gravity.as_slice())?;
    file.numbers("/run", DEPARTED_CHANNELS, &header.departed.channels)?;
    file.texts(&SCENE, &[&header.scene])?;
    if header.stop.is_empty() { Ok(()) } else { file.texts(&STOP, &[&header.stop]) }
}

fn read_run(file: &StoredFile, header: &mut Header) -> Result<(), SnapshotError> {
    for (name, number) in COUNTS {
        [*number(header)] = file.numbers("/run", name)?;
    }
    for (name, number) in NUMBERS {
        [*number(header)] = file.numbers("/run", name)?;
    }
    header.gravity = file.numbers::<f64, 3>("/run", "gravity")?.into();
    header.departed.channels = file.numbers("/run", DEPARTED_CHANNELS)?;
    header.scene = file.texts(&SCENE)?.concat();
    if file.has(STOP.place) {
        header.stop = file.texts(&STOP)?.concat();
    }
    if header.step < header.stage_begin.0 {
        return Err(file.damaged("/run"));
    }
    Ok(())
}

// --- /domain ---

const SHEAR_AXES: &str = "shear_along_across";
const SHEAR: &str = "shear_rate_strain";
/// Edges of a cell carried by a flow ([`Strained`]), the columns of a matrix, stored by rows.
const EDGES: &str = "edges";
const RATE: &str = "velocity_gradient";
const STRAIN: &str = "strain";

fn write_domain(file: &mut SnapshotFile, cell: &Cell) -> Result<(), SnapshotError> {
    file.group("/domain")?;
    file.text("/domain", "units", "low, high: m")?;
    let (low, high) = cell.corners();
    file.numbers("/domain", "low", low.as_slice())?;
    file.numbers("/domain", "high", high.as_slice())?;
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
    if let Some(Strained { edges, rate, strain }) = cell.strained() {
        file.text(
            "/domain",
            "flow",
            "matrices by rows: edges as columns [m], velocity gradient of the next step [1/s], its sum over time; velocities of particles \
             are against this flow about the corner `low`",
        )?;
        for (name, matrix) in [(EDGES, edges), (RATE, rate), (STRAIN, strain)] {
            file.numbers("/domain", name, matrix.transpose().as_slice())?;
        }
    }
    Ok(())
}

fn read_domain(file: &StoredFile) -> Result<Cell, SnapshotError> {
    let corner = |name| file.numbers::<f64, 3>("/domain", name).map(Vec3::from);
    let periodic = file.numbers::<u8, 3>("/domain", "periodic")?.map(|p| p != 0);
    let (low, high) = (corner("low")?, corner("high")?);
    if (0..3).any(|axis| periodic[axis] && !((high - low)[axis] > 0.0 && low[axis].is_finite())) {
        return Err(file.damaged("/domain"));
    }
    let cell = Cell::new(low, high, periodic);
    if file.has_attribute("/domain", EDGES) {
        let matrix =
            |name| file.numbers::<f64, 9>("/domain", name).map(|m| Mat3::from_row_slice(&m));
        let (edges, rate, strain) = (matrix(EDGES)?, matrix(RATE)?, matrix(STRAIN)?);
        let strained = cell.with_strain(Strained { edges, rate, strain });
        return strained.ok_or_else(|| file.damaged("/domain"));
    }
    if !file.has_attribute("/domain", SHEAR) {
        return Ok(cell);
    }
    let axes: [u64; 2] = file.numbers("/domain", SHEAR_AXES)?;
    let [along, across] = axes.map(|axis| axis as usize);
    let [rate, strain] = file.numbers("/domain", SHEAR)?;
    let sheared = cell.with_shear(Shear { along, across, rate, strain });
    sheared.ok_or_else(|| file.damaged("/domain"))
}

// --- /walls ---

const WALL_NAME: Column = column("/walls/name", 1, "");
/// Body of each wall as JSON, null for a wall of one plane; absent if all are.
const WALL_BODY: Column = column("/walls/body", 1, "");
/// Corners of all triangles, in the axes of their walls; absent without triangles.
const WALL_TRIANGLES: Column = column("/walls/triangles", 9, "m");

/// Column of a table of the header, with its field.
type Field<Row, T> = (Column<'static>, fn(&mut Row) -> &mut T);

const OF_WALLS: [Field<WallRow, Vec3>; 4] = [
    (column("/walls/point", 3, "m"), |wall| &mut wall.point),
    (column("/walls/normal", 3, "1"), |wall| &mut wall.normal),
    (column("/walls/velocity", 3, "m/s"), |wall| &mut wall.velocity),
    (column("/walls/force", 3, "N"), |wall| &mut wall.force),
];

fn write_walls(file: &mut SnapshotFile, header: &Header) -> Result<(), SnapshotError> {
    let mut walls = header.walls.clone();
    file.group("/walls")?;
    file.texts(&WALL_NAME, &walls.iter().map(|w| &*w.name).collect::<Vec<_>>())?;
    for (column, field) in OF_WALLS {
        let vectors: Vec<Vec3> = walls.iter_mut().map(|wall| *field(wall)).collect();
        file.table(&column, numbers(&vectors))?;
    }
    if walls.iter().any(|wall| wall.body.is_some()) {
        file.texts(&WALL_BODY, &bodies(header).iter().map(|body| &**body).collect::<Vec<_>>())?;
    }
    if !header.triangles.is_empty() {
        file.table(&WALL_TRIANGLES, header.triangles.as_flattened())?;
    }
    Ok(())
}

fn read_walls(file: &StoredFile) -> Result<Vec<WallRow>, SnapshotError> {
    let table = Tabulated { file, rows: file.count(WALL_NAME.place)? };
    let named = |name| WallRow {
        name,
        point: Vec3::zeros(),
        normal: Vec3::zeros(),
        velocity: Vec3::zeros(),
        force: Vec3::zeros(),
        body: None,
    };
    let mut walls: Vec<WallRow> = table.texts(&WALL_NAME)?.into_iter().map(named).collect();
    for (column, field) in OF_WALLS {
        let found = vectors(&table.numbers(&column)?);
        walls.iter_mut().zip(found).for_each(|(wall, vector)| *field(wall) = vector);
    }
    if file.has(WALL_BODY.place) {
        let bodies: Vec<Option<Saved>> = table.json(&WALL_BODY)?;
        walls.iter_mut().zip(bodies).for_each(|(wall, body)| wall.body = body);
    }
    Ok(walls)
}

fn read_triangles(file: &StoredFile) -> Result<Vec<[f64; 9]>, SnapshotError> {
    if !file.has(WALL_TRIANGLES.place) {
        return Ok(Vec::new());
    }
    let rows = file.count(WALL_TRIANGLES.place)?;
    Ok(file.rows::<f64>(&WALL_TRIANGLES, 0..rows)?.as_chunks().0.to_vec())
}

/// Body of each wall as JSON.
pub(super) fn bodies(header: &Header) -> Vec<String> {
    let json = |row: &WallRow| serde_json::to_string(&row.body);
    header.walls.iter().map(json).collect::<Result<_, _>>().expect("a body can be stored")
}

// --- /shapes ---

const SHAPE_NAME: Column = column("/shapes/name", 1, "");
const SHAPE_KIND: Column = column("/shapes/kind", 1, "");
const SHAPE_SCALES: Column = column("/shapes/scales", 2, "1");
const SHAPE_GEOMETRY: Column = column("/shapes/geometry", 1, "");

const VECTORS_OF_SHAPES: [Field<ShapeRow, Vec3>; 2] = [
    (column("/shapes/semi_axes", 3, "m"), |shape| &mut shape.semi_axes),
    (column("/shapes/inertia", 3, "kg m^2"), |shape| &mut shape.inertia),
];

const NUMBERS_OF_SHAPES: [Field<ShapeRow, f64>; 3] = [
    (column("/shapes/volume", 1, "m^3"), |shape| &mut shape.volume),
    (column("/shapes/mass", 1, "kg"), |shape| &mut shape.mass),
    (column("/shapes/most", 1, "1"), |shape| &mut shape.most),
];

fn write_shapes(file: &mut SnapshotFile, header: &Header) -> Result<(), SnapshotError> {
    let mut shapes = header.shapes.clone();
    file.group("/shapes")?;
    file.texts(&SHAPE_NAME, &shapes.iter().map(|s| &*s.name).collect::<Vec<_>>())?;
    file.texts(&SHAPE_KIND, &shapes.iter().map(|s| &*s.kind).collect::<Vec<_>>())?;
    for (column, field) in VECTORS_OF_SHAPES {
        let vectors: Vec<Vec3> = shapes.iter_mut().map(|shape| *field(shape)).collect();
        file.table(&column, numbers(&vectors))?;
    }
    for (column, field) in NUMBERS_OF_SHAPES {
        let numbers: Vec<f64> = shapes.iter_mut().map(|shape| *field(shape)).collect();
        file.table(&column, &numbers)?;
    }
    let scales: Vec<[f64; 2]> = shapes.iter().map(|shape| shape.scales).collect();
    file.table(&SHAPE_SCALES, scales.as_flattened())?;
    let geometries = geometries(header);
    file.texts(&SHAPE_GEOMETRY, &geometries.iter().map(|g| &**g).collect::<Vec<_>>())
}

fn read_shapes(file: &StoredFile) -> Result<Vec<ShapeRow>, SnapshotError> {
    let table = Tabulated { file, rows: file.count(SHAPE_NAME.place)? };
    let (names, kinds) = (table.texts(&SHAPE_NAME)?, table.texts(&SHAPE_KIND)?);
    let scales = table.numbers(&SHAPE_SCALES)?;
    let geometries: Vec<Option<Shape>> = table.json(&SHAPE_GEOMETRY)?;
    let is_wall = |shape: &Shape| matches!(shape, Shape::HalfSpace(_) | Shape::TriangleMesh(_));
    if geometries.iter().flatten().any(is_wall) {
        return Err(file.damaged(SHAPE_GEOMETRY.place));
    }
    let rows = names.into_iter().zip(kinds).zip(geometries).zip(scales.as_chunks().0);
    let row = |(((name, kind), geometry), &scales): (((_, _), _), &[f64; 2])| ShapeRow {
        name,
        kind,
        geometry,
        scales,
        semi_axes: Vec3::zeros(),
        volume: 0.0,
        mass: 0.0,
        inertia: Vec3::zeros(),
        most: 0.0,
    };
    let mut shapes: Vec<ShapeRow> = rows.map(row).collect();
    for (column, field) in VECTORS_OF_SHAPES {
        let found = vectors(&table.numbers(&column)?);
        shapes.iter_mut().zip(found).for_each(|(shape, vector)| *field(shape) = vector);
    }
    for (column, field) in NUMBERS_OF_SHAPES {
        let found = table.numbers(&column)?;
        shapes.iter_mut().zip(found).for_each(|(shape, number)| *field(shape) = number);
    }
    Ok(shapes)
}

/// Geometry of each shape as JSON.
pub(super) fn geometries(header: &Header) -> Vec<String> {
    let json = |row: &ShapeRow| serde_json::to_string(&row.geometry);
    header.shapes.iter().map(json).collect::<Result<_, _>>().expect("a geometry can be stored")
}

// --- drives ---

/// Saved states of drives.
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
    Ok(drives)
}

/// Small tables of the header, whose columns must have `rows` rows.
struct Tabulated<'a> {
    file: &'a StoredFile,
    rows: usize,
}

impl Tabulated<'_> {
    fn numbers(&self, column: &Column) -> Result<Vec<f64>, SnapshotError> {
        self.file.rows(column, 0..self.rows)
    }

    fn texts(&self, column: &Column) -> Result<Vec<String>, SnapshotError> {
        let texts = self.file.texts(column)?;
        if texts.len() == self.rows { Ok(texts) } else { Err(self.file.uneven(column)) }
    }

    fn json<T: DeserializeOwned>(&self, column: &Column) -> Result<Vec<T>, SnapshotError> {
        let unreadable = |error: serde_json::Error| {
            SnapshotError::unreadable(self.file.path(), &format!("{}: {error}", column.place))
        };
        let texts = self.texts(column)?;
        texts.iter().map(|text| serde_json::from_str(text).map_err(unreadable)).collect()
    }
}
