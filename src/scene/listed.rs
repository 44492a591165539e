//! Particles of a file, one row each: a table with commas or blanks, a file of LAMMPS ([`lammps`]), or one of the ON-DEM action ([`ondem`]).
//!
//! Columns in any order: `x,y,z` [m]; and, each group whole or not at all, `qw,qx,qy,qz` (body to
//! world, of any length), `vx,vy,vz` [m/s], `wx,wy,wz` [rad/s, world axes]; and `shape` (a name),
//! which may be missing if there is only one, or `type`, which `types` maps to a name; `id`; and the size:
//!
//! | columns | lengths of the particle over those of its shape |
//! |---|---|
//! | `scale` | this number |
//! | `radius`, `diameter` [m] | of the sphere of equal volume, over that of the shape |
//! | `shapex,shapey,shapez` [m] | full lengths along its own axes, over those of the shape, which must be in the same proportion |
//! | none | 1 |
//!
//! Columns may have their names in LAMMPS and Yade ([`ALIASES`]), or names that the scene maps by `columns`. Particles keep the ids of the file and are
//! sorted by them: the order of rows, which differs from dump to dump, has no effect.

use super::Listed;
use super::cells::{self, Bounds, Cells, few, lines, number};
use super::lammps;
use super::mistakes::suggestion;
use super::ondem;
use crate::cell::Cell;
use crate::ids::{GlobalId, ShapeId};
use crate::math::{Quat, Vec3};
use crate::population::Library;
use crate::shape::{Kind, Shape};
use crate::text::shown;
use csv::StringRecord;
use nalgebra::Quaternion;
use std::collections::BTreeMap;
use std::path::Path;

const COLUMNS: [&str; 19] = [
    "x", "y", "z", "qw", "qx", "qy", "qz", "vx", "vy", "vz", "wx", "wy", "wz", "shape", "scale",
    "id", "radius", "diameter", "type",
];

/// Names of the columns in LAMMPS and Yade.
const ALIASES: [(&str, &str); 9] = [
    ("quatw", "qw"),
    ("quati", "qx"),
    ("quatj", "qy"),
    ("quatk", "qz"),
    ("omegax", "wx"),
    ("omegay", "wy"),
    ("omegaz", "wz"),
    ("r", "radius"),
    ("matId", "type"),
];

/// Columns that only LAMMPS has.
const OF_LAMMPS: [&str; 19] = [
    "shapex",
    "shapey",
    "shapez",
    "angmomx",
    "angmomy",
    "angmomz",
    "mass",
    "density",
    "xu",
    "yu",
    "zu",
    "xs",
    "ys",
    "zs",
    "xsu",
    "ysu",
    "zsu",
    "ellipsoidflag",
    "element",
];

/// Largest relative difference between the proportions of an ellipsoid and of its shape: dumps have six digits.
const SAME_FORM: f64 = 1e-4;
/// Largest relative difference between the density of a file and of the material without a warning.
const SAME_DENSITY: f64 = 1e-3;

/// Largest difference of a quaternion's squared length from 1 with which its bits are kept.
const UNIT: f64 = 8.0 * f64::EPSILON;

/// Is this a column, under any of its names?
pub(super) fn is_column(name: &str) -> bool {
    COLUMNS.contains(&name)
        || OF_LAMMPS.contains(&name)
        || ALIASES.iter().any(|(other, _)| *other == name)
}

/// Text behind "no such column".
pub(super) fn like(name: &str) -> String {
    suggestion(name, COLUMNS, "allowed")
}

/// Format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Commas,
    Blanks,
    LammpsData,
    LammpsDump,
    OnDem,
}

/// Settings of a file and of its particles.
pub(super) struct Source<'a> {
    pub(super) format: Option<Format>,
    /// Frame of a dump.
    pub(super) frame: Option<u64>,
    /// Indices of shapes by types of the file.
    pub(super) types: BTreeMap<&'a str, usize>,
    /// Names of columns by those of the file.
    pub(super) columns: BTreeMap<&'a str, &'a str>,
    /// Names of shapes.
    pub(super) shapes: Vec<&'a str>,
    /// `None` if a shape has an error.
    pub(super) library: Option<&'a Library>,
    /// `None` if it has an error.
    pub(super) domain: Option<&'a Cell>,
    /// Lower ids belong to other fills.
    pub(super) first_id: u64,
}

impl Source<'_> {
    /// The name of a column in this program.
    fn own<'a>(&'a self, name: &'a str) -> &'a str {
        let name = self.columns.get(name).copied().unwrap_or(name);
        ALIASES.iter().find(|(other, _)| *other == name).map_or(name, |(_, own)| own)
    }

    /// Particles of a file in the order of their ids, with warnings; or errors. `wrong` gives the reason why a particle is rejected.
    pub(super) fn read(
        &self,
        path: &Path,
        wrong: &dyn Fn(&Listed) -> Option<String>,
    ) -> Result<(Vec<Listed>, Vec<String>), Vec<String>> {
        let named = self.format.or_else(|| ondem::is_one(path).then_some(Format::OnDem));
        let text = if named == Some(Format::OnDem) { String::new() } else { cells::text(path)? };
        let is_name = |name: &str| is_column(self.own(name));
        let format = named.unwrap_or_else(|| format_of(path, &text));
        if self.frame.is_some() && format != Format::LammpsDump {
            return Err(vec!["`frame` is of dumps of LAMMPS, and this file is none".to_owned()]);
        }
        let cells = match format {
            Format::Commas => cells::csv(&text, &is_name),
            Format::Blanks => cells::blanks(&text, &is_name),
            Format::LammpsData => lammps::data(&text),
            Format::LammpsDump => lammps::dump(&text, self.frame),
            Format::OnDem => {
                let fits = |shape: &str, geometry: &Shape| self.has_shape(shape, geometry);
                ondem::read(path, &fits).map_err(|what| vec![what])
            }
        }?;
        self.rows(cells, wrong)
    }

    /// The index of the shape for a type of the file.
    fn of_type(&self, kind: &str) -> Option<usize> {
        let only = (self.shapes.len() == 1 && self.types.is_empty()).then_some(0);
        let named = || self.shapes.iter().position(|shape| *shape == kind);
        self.types.get(kind).copied().or(only).or_else(named)
    }

    /// Whether the shape for a type of the file has this geometry.
    fn has_shape(&self, kind: &str, geometry: &Shape) -> bool {
        let of_scene = self.of_type(kind).zip(self.library);
        of_scene.is_none_or(|(shape, library)| library.shapes[shape] == *geometry)
    }

    fn rows(
        &self,
        cells: Cells,
        wrong: &dyn Fn(&Listed) -> Option<String>,
    ) -> Result<(Vec<Listed>, Vec<String>), Vec<String>> {
        if cells.names.is_empty() {
            return Err(vec!["the file lists no particles".to_owned()]);
        }
        if let Some(bounds) = cells.bounds {
            bounds.check(self.domain).map_err(|what| vec![what])?;
        }
        let columns = Columns::find(self, &cells).map_err(few)?;
        let mut doubts = cells.doubts;
        doubts.extend(columns.unread());
        let mut rows: Vec<(usize, Listed)> = Vec::new();
        let mut mistakes = Vec::new();
        let mut dense = None;
        for (id, row) in (self.first_id..).zip(cells.rows) {
            let (line, record) = match row {
                Ok(row) => row,
                Err(what) => {
                    mistakes.push(what);
                    continue;
                }
            };
            match columns.row(&record, id) {
                Err(what) => mistakes.push(format!("line {line}, {what}")),
                Ok(row) => {
                    if let Some(why) = wrong(&row) {
                        let ([x, y, z], id): ([f64; 3], _) = (row.position.into(), row.id);
                        mistakes.push(format!(
                            "line {line}, particle {id} at [{x:?}, {y:?}, {z:?}] m is {why}"
                        ));
                    }
                    dense =
                        dense.or_else(|| columns.density(&record, &row).map(|what| (line, what)));
                    rows.push((line, row));
                }
            }
        }
        doubts.extend(dense.map(|(line, what)| format!("line {line}, {what}")));
        if columns.id.is_some() && mistakes.is_empty() {
            rows.sort_by_key(|(_, row)| row.id);
            let twice = rows.windows(2).filter(|two| two[0].1.id == two[1].1.id);
            mistakes.extend(twice.map(|two| {
                format!(
                    "line {}, column id: particle {} stands in line {}, too",
                    two[1].0, two[1].1.id, two[0].0
                )
            }));
            doubts.extend(self.renumbered(&mut rows));
        }
        if mistakes.is_empty() && rows.is_empty() {
            mistakes.push("the file lists no particles".to_owned());
        }
        if mistakes.is_empty() {
            return Ok((rows.into_iter().map(|(_, row)| row).collect(), doubts));
        }
        Err(few(mistakes))
    }

    /// Gives particles new ids where those of the file belong to others or are too large.
    fn renumbered(&self, rows: &mut [(usize, Listed)]) -> Option<String> {
        let (first, last) = (rows.first()?.1.id, rows.last()?.1.id);
        let why = if first < self.first_id {
            format!("ids below {} belong to fills before", self.first_id)
        } else if last >= GlobalId::MOST_OF_PIECES {
            format!("{last} is too large for an id")
        } else {
            return None;
        };
        for (id, (_, row)) in (self.first_id..).zip(rows) {
            row.id = id;
        }
        Some(format!(
            "{why}, so the particles are numbered from {} in the order of their ids in the file",
            self.first_id
        ))
    }
}

/// Format by the first line and the extension of the name.
fn format_of(path: &Path, text: &str) -> Format {
    let begin = text.lines().map(str::trim).find(|line| !line.is_empty()).unwrap_or_default();
    let first = lines(text).next().map_or("", |(_, cells)| cells);
    if begin.starts_with("ITEM:") {
        Format::LammpsDump
    } else if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv")) {
        Format::Commas
    } else if lammps::is_data(text) {
        Format::LammpsData
    } else if first.contains([',', ';']) || first.split_whitespace().count() < 2 {
        Format::Commas
    } else {
        Format::Blanks
    }
}

/// Columns of the size of a particle.
enum Size {
    One,
    Scale(usize),
    /// Column, and factor to the radius.
    Radius(usize, f64),
    Lengths([usize; 3]),
}

/// Column of the shape of a particle.
enum Form {
    Only,
    Shape(usize),
    Type(usize),
}

/// Positions of all groups of columns.
struct Columns<'a> {
    source: &'a Source<'a>,
    names: Vec<String>,
    position: [usize; 3],
    /// Positions count from 0 to 1 in the box.
    is_scaled: bool,
    bounds: Option<Bounds>,
    quaternion: Option<[usize; 4]>,
    velocity: Option<[usize; 3]>,
    angular_velocity: Option<[usize; 3]>,
    angular_momentum: Option<[usize; 3]>,
    form: Form,
    size: Size,
    id: Option<usize>,
    mass: Option<usize>,
    density: Option<usize>,
}

fn cell(record: &StringRecord, column: usize) -> &str {
    record.get(column).unwrap_or_default()
}

fn id_in(cell: &str) -> Result<u64, String> {
    cell.parse()
        .map_err(|_| format!("column id: `{}` is not a whole number, 0 or greater", shown(cell)))
}

fn three(columns: &[usize]) -> [usize; 3] {
    [columns[0], columns[1], columns[2]]
}

/// Names of the columns in this program, and their errors.
fn named<'b>(source: &'b Source, cells: &'b Cells) -> (Vec<&'b str>, Vec<String>) {
    let mut mistakes = Vec::new();
    let names: Vec<&str> = cells.names.iter().map(|name| source.own(name)).collect();
    for (k, (name, written)) in names.iter().zip(&cells.names).enumerate() {
        let is_known = is_column(name);
        if !is_known && !cells.is_rich {
            mistakes.push(format!("no such column as `{}`{}", shown(written), like(written)));
        } else if is_known && names[..k].contains(name) {
            mistakes.push(format!("there are two columns `{name}`"));
        }
    }
    let has = |name: &&str| cells.names.iter().any(|written| written == *name);
    let absent = source.columns.keys().copied().find(|name| !has(name));
    if let Some(absent) = absent {
        mistakes.push(format!("`columns` names `{}`, which the file has not", shown(absent)));
    }
    (names, mistakes)
}

impl<'a> Columns<'a> {
    fn find(source: &'a Source<'a>, cells: &Cells) -> Result<Self, Vec<String>> {
        let (names, mut mistakes) = named(source, cells);
        let at = |name: &str| names.iter().position(|column| *column == name);
        let mut group = |wanted: &[&str], needed: bool| {
            let missing: Vec<&str> =
                wanted.iter().copied().filter(|name| at(name).is_none()).collect();
            if !missing.is_empty() && (needed || missing.len() < wanted.len()) {
                mistakes.push(format!("column {} is missing", missing.join(", ")));
            }
            wanted.iter().map(|name| at(name)).collect::<Option<Vec<_>>>()
        };
        let scaled = [["xs", "ys", "zs"], ["xsu", "ysu", "zsu"]];
        let places = [["xu", "yu", "zu"], scaled[0], scaled[1]];
        let all_there = |names: &&[&str; 3]| names.iter().all(|name| at(name).is_some());
        let other = places.iter().find(all_there).filter(|_| at("x").is_none());
        let place = other.unwrap_or(&["x", "y", "z"]);
        let is_scaled = scaled.contains(place);
        let position = group(place, true);
        let quaternion = group(&["qw", "qx", "qy", "qz"], false);
        let velocity = group(&["vx", "vy", "vz"], false);
        let angular_velocity = group(&["wx", "wy", "wz"], false);
        let angular_momentum = group(&["angmomx", "angmomy", "angmomz"], false);
        let lengths = group(&["shapex", "shapey", "shapez"], false);
        let form = match (at("shape"), at("type")) {
            (Some(shape), _) => Form::Shape(shape),
            (_, Some(kind)) => Form::Type(kind),
            _ => {
                group(&["shape"], source.shapes.len() > 1);
                Form::Only
            }
        };
        let sizes = ["scale", "radius", "diameter"].map(at);
        let size = match (lengths, sizes) {
            (Some(lengths), _) => Size::Lengths(three(&lengths)),
            (_, [Some(scale), ..]) => Size::Scale(scale),
            (_, [_, Some(radius), _]) => Size::Radius(radius, 1.0),
            (_, [.., Some(diameter)]) => Size::Radius(diameter, 0.5),
            _ => Size::One,
        };
        if !cells.is_rich && sizes.iter().flatten().count() > 1 {
            mistakes.push("columns scale, radius and diameter are one of them".to_owned());
        }
        if is_scaled && cells.bounds.is_none() {
            mistakes.push(format!(
                "columns {} need the box of a dump, `ITEM: BOX BOUNDS`",
                place.join(", ")
            ));
        }
        match position {
            Some(position) if mistakes.is_empty() => Ok(Self {
                source,
                position: three(&position),
                is_scaled,
                bounds: cells.bounds,
                quaternion: quaternion.map(|c| [c[0], c[1], c[2], c[3]]),
                velocity: velocity.map(|c| three(&c)),
                angular_velocity: angular_velocity.map(|c| three(&c)),
                angular_momentum: angular_momentum.map(|c| three(&c)),
                form,
                size,
                id: at("id"),
                mass: at("mass"),
                density: at("density"),
                names: cells.names.clone(),
            }),
            _ => Err(mistakes),
        }
    }

    /// Warning about skipped columns of a dump without orientations, which may be these.
    fn unread(&self) -> Option<String> {
        let unread = self
            .names
            .iter()
            .filter(|name| name.contains('[') && !self.source.columns.contains_key(&***name));
        let unread: Vec<String> = unread.map(shown).collect();
        (self.quaternion.is_none() && unread.len() >= 4).then(|| {
            format!(
                "the particles have no orientation, and columns {} are not read: is it there? `columns` says so, as in {{ \"{}\" = \"quatw\" }}",
                unread.join(", "),
                unread[0]
            )
        })
    }

    fn row(&self, record: &StringRecord, id: u64) -> Result<Listed, String> {
        let count = self.names.len();
        if record.iter().skip(count).any(|cell| !cell.is_empty()) {
            let cells = record.len();
            return Err(format!(
                "it has {cells} cells, but there are {count} columns; decimals are written with a point"
            ));
        }
        let id = self.id.map_or(Ok(id), |column| id_in(cell(record, column)))?;
        let place = self.vector(record, self.position)?;
        let quaternion = self
            .quaternion
            .map_or_else(|| Ok(Quat::identity()), |columns| self.turn(record, columns))?;
        let shape = self.shape(record)?;
        let scale = self.scale(record, shape)?;
        let vector = |columns: Option<[usize; 3]>| {
            columns.map_or_else(|| Ok(Vec3::zeros()), |columns| self.vector(record, columns))
        };
        let mut row = Listed {
            id,
            shape: ShapeId(shape as u16),
            scale,
            position: self.in_the_box(place),
            quaternion,
            velocity: vector(self.velocity)?,
            angular_velocity: vector(self.angular_velocity)?,
        };
        if let (Some(columns), None) = (self.angular_momentum, self.angular_velocity) {
            row.angular_velocity =
                self.of_momentum(record, &row, &self.vector(record, columns)?)?;
        }
        Ok(row)
    }

    fn number(&self, record: &StringRecord, column: usize) -> Result<f64, String> {
        number(cell(record, column))
            .map_err(|what| format!("column {}: {what}", shown(&self.names[column])))
    }

    fn vector(&self, record: &StringRecord, columns: [usize; 3]) -> Result<Vec3, String> {
        let [x, y, z] = columns.map(|column| self.number(record, column));
        Ok(Vec3::new(x?, y?, z?))
    }

    fn turn(&self, record: &StringRecord, columns: [usize; 4]) -> Result<Quat, String> {
        let [w, x, y, z] = columns.map(|column| self.number(record, column));
        let quaternion = Quaternion::new(w?, x?, y?, z?);
        if (quaternion.norm_squared() - 1.0).abs() < UNIT {
            return Ok(Quat::new_unchecked(quaternion));
        }
        let largest = quaternion.coords.amax();
        if largest == 0.0 {
            return Err("the quaternion is 0; it needs a length".to_owned());
        }
        Ok(Quat::new_normalize(quaternion / largest))
    }

    /// The index of the shape.
    fn shape(&self, record: &StringRecord) -> Result<usize, String> {
        let shapes = &self.source.shapes;
        match self.form {
            Form::Only => Ok(0),
            Form::Shape(column) => {
                let name = cell(record, column);
                shapes.iter().position(|shape| *shape == name).ok_or_else(|| {
                    let hint = suggestion(name, shapes.iter().copied(), "there are");
                    format!("column shape: no such shape as `{}`{hint}", shown(name))
                })
            }
            Form::Type(column) => {
                let kind = cell(record, column);
                self.source.of_type(kind).ok_or_else(|| {
                    let (kind, shape) = (shown(kind), shown(shapes[0]));
                    format!("column type: which shape has type {kind}? `types` says so, as in {{ \"{kind}\" = \"{shape}\" }}")
                })
            }
        }
    }

    fn scale(&self, record: &StringRecord, shape: usize) -> Result<f64, String> {
        let positive = |column: usize| {
            let x = self.number(record, column)?;
            if x > 0.0 {
                Ok(x)
            } else {
                Err(format!("column {}: {x:?} must be greater than 0", self.names[column]))
            }
        };
        let body =
            self.source.library.map(|library| (&library.shapes[shape], &*library.names[shape]));
        let scale = match (&self.size, body) {
            (Size::One, _) => 1.0,
            (Size::Scale(column), _) => positive(*column)?,
            (Size::Radius(column, factor), body) => {
                let radius = positive(*column)? * factor;
                body.map_or(Ok(1.0), |(body, name)| of_radius(body, name, radius))?
            }
            (Size::Lengths(columns), body) => {
                let [x, y, z] = columns.map(positive);
                let lengths = Vec3::new(x?, y?, z?);
                body.map_or(Ok(1.0), |(body, name)| of_lengths(body, name, &lengths))?
            }
        };
        Ok(scale)
    }

    /// Place of a particle, moved into a periodic box, or into a tilted domain.
    fn in_the_box(&self, mut place: Vec3) -> Vec3 {
        if let Some(Bounds { low, edges, .. }) = self.bounds.filter(|_| self.is_scaled) {
            place = low + edges * place;
        }
        if let Some(domain) = self.source.domain.filter(|domain| domain.is_tilted()) {
            domain.wrap(&mut place, &mut Vec3::zeros(), &mut [0; 3]);
            return place;
        }
        let Some(Bounds { low, edges, periodic }) = self.bounds else { return place };
        let size = edges.diagonal();
        Vec3::from_fn(|axis, _| {
            let (x, low) = (place[axis], low[axis]);
            if periodic[axis] { x - size[axis] * ((x - low) / size[axis]).floor() } else { x }
        })
    }

    /// The angular velocity of an angular momentum [kg m²/s], both in the axes of the world.
    fn of_momentum(
        &self,
        record: &StringRecord,
        row: &Listed,
        momentum: &Vec3,
    ) -> Result<Vec3, String> {
        let Some(library) = self.source.library else { return Ok(Vec3::zeros()) };
        let (body, scale) = (&library.shapes[row.shape.index()], row.scale);
        let mass = match (self.mass, self.density) {
            (Some(column), _) => self.number(record, column)?,
            (_, Some(column)) => self.number(record, column)? * body.volume() * scale.powi(3),
            _ => library.mass_at(row.shape, scale),
        };
        let inertia = body.gyration() * (mass * scale * scale);
        let spin = row.quaternion
            * row.quaternion.inverse_transform_vector(momentum).component_div(&inertia);
        if spin.iter().all(|x| x.is_finite()) {
            Ok(spin)
        } else {
            Err(format!("an angular momentum of a mass of {mass:?} kg is no angular velocity"))
        }
    }

    /// Warning about a density of the file that is not that of the material.
    fn density(&self, record: &StringRecord, row: &Listed) -> Option<String> {
        let library = self.source.library?;
        let given = self.number(record, self.density?).ok()?;
        let shape = row.shape.index();
        let own = library.mass[shape] / library.shapes[shape].volume();
        ((given / own - 1.0).abs() > SAME_DENSITY).then(|| {
            format!("column density: {given:?} is not used; the material has {own:?} kg/m3")
        })
    }
}

/// The scale of a particle by the radius of the sphere of its volume.
fn of_radius(body: &Shape, name: &str, radius: f64) -> Result<f64, String> {
    if let kind @ (Kind::Spherocylinder | Kind::RoundedPolyhedron) = body.kind() {
        return Err(format!(
            "shape {name} is a {}, whose `radius` is that of its edges, not of its size: give a column scale in place of the radius",
            kind.name()
        ));
    }
    Ok(radius / body.equal_radius())
}

/// The scale of a particle by its lengths along its own axes.
fn of_lengths(body: &Shape, name: &str, lengths: &Vec3) -> Result<f64, String> {
    let own = body.semi_axes() * 2.0;
    let ratios = lengths.component_div(&own);
    if ratios.min() == ratios.max() {
        return Ok(ratios.x);
    }
    if ratios.max() > ratios.min() * (1.0 + SAME_FORM) {
        let [[a, b, c], [x, y, z]] =
            [lengths, &own].map(|lengths| [lengths.x, lengths.y, lengths.z]);
        return Err(format!(
            "lengths {a:?}, {b:?}, {c:?} m are not in the proportion of shape {name}, {x:?}, {y:?}, {z:?} m: give a [[shape]] for each form, and \
             `types` for each type"
        ));
    }
    Ok(libm::cbrt(ratios.product()))
}
