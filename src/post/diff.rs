//! Comparison of two snapshots of the same state: equal bit for bit, or the differences.
//!
//! Rows are matched by id, so that snapshots from different numbers of ranks compare equal; the owning rank is not
//! compared. Springs and other states of touching contacts are matched by the ids of both bodies, and so are the rows of
//! the contacts files. Both states are held in memory.

use crate::contact::{ContactRecord, ContactRecords, StateColumn};
use crate::drive::{SavedColumn, SavedState};
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::measure::Departed;
use crate::output::columns::Numbers;
use crate::output::header::{Header, ShapeRow, WallRow};
use crate::output::tables::{
    CONTACT_COLUMNS, ContactTable, PARTICLE_COLUMNS, ParticleColumn, ParticleTable,
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::slice;

/// Largest number of differences that are listed one by one.
pub const NAMED: usize = 10;

/// State from which a restart continues.
#[derive(Clone, Debug)]
pub struct State {
    /// Header with step, time, walls and drives.
    pub header: Header,
    /// Particles, in any order.
    pub particles: ParticleTable,
    /// States of touching contacts, in any order.
    pub records: ContactRecords,
    /// Rows of the contacts file, in any order.
    pub contacts: ContactTable,
}

/// Key of a contact: its lower id and its higher id.
type Ends = (GlobalId, GlobalId);

/// Differences of two snapshots.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Difference {
    /// Differences of step, time, walls and drives, in words.
    pub header: Vec<String>,
    /// Ids of particles that only the first has.
    pub only_first: Vec<GlobalId>,
    /// Ids of particles that only the second has.
    pub only_second: Vec<GlobalId>,
    /// Columns that only one snapshot has.
    pub only_one_column: Vec<String>,
    /// Number of particles in both.
    pub compared: u64,
    /// Number of particles in both that differ in any column.
    pub differing: u64,
    /// By column: number of particles that differ, and the largest difference.
    pub columns: BTreeMap<String, ColumnDifference>,
    /// First differences by id, at most [`NAMED`].
    pub first: Vec<ValueDifference>,
    /// Differences of the touching contacts.
    pub contacts: ContactDifference,
}

/// Differences of the touching contacts.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContactDifference {
    /// Contacts that only the first has.
    pub only_first: Vec<(GlobalId, GlobalId)>,
    /// Contacts that only the second has.
    pub only_second: Vec<(GlobalId, GlobalId)>,
    /// State columns that only one snapshot has.
    pub only_one_column: Vec<String>,
    /// Number of contacts in both.
    pub compared: u64,
    /// Number of contacts in both that differ in any column.
    pub differing: u64,
    /// By column: number of contacts that differ, and the largest difference.
    pub columns: BTreeMap<String, ColumnDifference>,
    /// First contacts that differ, at most [`NAMED`].
    pub first: Vec<(GlobalId, GlobalId)>,
}

/// Differences of a column.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColumnDifference {
    /// Number of particles or contacts that differ in it.
    pub rows: u64,
    /// Largest absolute difference of a component, in the column's unit; infinite if one is not a number.
    pub largest: f64,
}

/// A number that differs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ValueDifference {
    /// Id of the particle.
    pub id: GlobalId,
    /// Column and component.
    pub column: String,
    /// Value in the first snapshot.
    pub first: f64,
    /// Value in the second snapshot.
    pub second: f64,
}

impl Difference {
    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        self.header.is_empty()
            && self.only_first.is_empty()
            && self.only_second.is_empty()
            && self.only_one_column.is_empty()
            && self.differing == 0
            && self.contacts.is_empty()
    }

    /// Compares two snapshots.
    pub fn between(first: &State, second: &State) -> Self {
        let mut found = Self {
            header: header_differences(&first.header, &second.header),
            contacts: ContactDifference::between(first, second),
            ..Self::default()
        };
        let (first, second) = (&first.particles, &second.particles);
        // An optional column may be absent from one snapshot and then cannot be compared.
        let mut shared = Vec::new();
        // The key of the match and the owning rank are not compared.
        let compared = PARTICLE_COLUMNS.iter().filter(|c| !["id", "rank"].contains(&c.name));
        for column in compared {
            let (a, b) = (column.of(first), column.of(second));
            // In a table without rows every column counts as present.
            match (a.rows() == first.id.len(), b.rows() == second.id.len()) {
                (true, true) => shared.push((column, a, b)),
                (false, false) => {}
                _ => found.only_one_column.push(column.name.to_string()),
            }
        }
        for (id, pair) in matched(first.id.iter().copied(), second.id.iter().copied()) {
            match pair {
                [Some(i), Some(j)] => found.compare_rows(id, &shared, i, j),
                [Some(_), None] => found.only_first.push(id),
                _ => found.only_second.push(id),
            }
        }
        found
    }

    fn compare_rows(
        &mut self,
        id: GlobalId,
        shared: &[(&ParticleColumn, &dyn Numbers, &dyn Numbers)],
        first_row: usize,
        second_row: usize,
    ) {
        self.compared += 1;
        let mut any = false;
        for (column, a, b) in shared {
            let name = column.name;
            let mut differs = false;
            for (component, label) in a.labels().iter().enumerate() {
                let (x, y) = (a.number(first_row, component), b.number(second_row, component));
                if x.to_bits() == y.to_bits() {
                    continue;
                }
                differs = true;
                let distance = distance(x, y);
                let entry = self.columns.entry(name.to_string()).or_default();
                entry.largest = entry.largest.max(distance);
                if self.first.len() < NAMED {
                    let column = format!("{name}{label}");
                    self.first.push(ValueDifference { id, column, first: x, second: y });
                }
            }
            if differs {
                self.columns.entry(name.to_string()).or_default().rows += 1;
                any = true;
            }
        }
        self.differing += u64::from(any);
    }
}

impl ContactDifference {
    /// Whether nothing differs.
    pub fn is_empty(&self) -> bool {
        self.only_first.is_empty()
            && self.only_second.is_empty()
            && self.only_one_column.is_empty()
            && self.differing == 0
    }

    fn between(first: &State, second: &State) -> Self {
        let mut found = Self::default();
        let tables = [&first.contacts, &second.contacts];
        let (first, second) = (&first.records, &second.records);
        // A column that only one snapshot has cannot be compared.
        let mut shared = vec![];
        for (column, place) in StateColumn::ranges(first.columns()) {
            match StateColumn::ranges(second.columns()).find(|(other, _)| other.name == column.name)
            {
                Some((_, other)) => shared.push((&*column.name, place, other)),
                None => found.only_one_column.push(column.name.to_string()),
            }
        }
        for column in second.columns() {
            if first.columns().iter().all(|other| other.name != column.name) {
                found.only_one_column.push(column.name.to_string());
            }
        }
        let ends = |named: ContactRecord| (named.a, named.b);
        let [rows, of_second] =
            tables.map(|table| table.a.iter().copied().zip(table.b.iter().copied()));
        let mut rows = matched(rows, of_second);
        for (ends, pair) in matched(first.iter().map(ends), second.iter().map(ends)) {
            let row = rows.remove(&ends).unwrap_or_default();
            match pair {
                [Some(i), Some(j)] => {
                    let in_files = in_files(tables, row);
                    found.compare(ends, &shared, first.get(i), second.get(j), &in_files);
                }
                [Some(_), None] => found.only_first.push(ends),
                _ => found.only_second.push(ends),
            }
        }
        // Contacts without a state are compared by their rows in the contacts files.
        for (ends, row) in rows {
            match row {
                [Some(_), Some(_)] => found.note(ends, columns_of(&in_files(tables, row))),
                [Some(_), None] => found.only_first.push(ends),
                _ => found.only_second.push(ends),
            }
        }
        found
    }

    fn compare(
        &mut self,
        ends: Ends,
        shared: &[SharedState],
        first: ContactRecord,
        second: ContactRecord,
        in_files: &[InFiles],
    ) {
        let (mine, theirs) = (&first.geometry, &second.geometry);
        let geometry = [
            ("normal", mine.normal.as_slice(), theirs.normal.as_slice()),
            ("overlap", slice::from_ref(&mine.overlap), slice::from_ref(&theirs.overlap)),
        ];
        let state = shared.iter().map(|(name, here, there)| {
            (*name, &first.state[here.clone()], &second.state[there.clone()])
        });
        self.note(ends, geometry.into_iter().chain(state).chain(columns_of(in_files)));
    }

    /// Compares the numbers of a contact, by column.
    fn note<'a>(
        &mut self,
        ends: Ends,
        columns: impl Iterator<Item = (&'a str, &'a [f64], &'a [f64])>,
    ) {
        self.compared += 1;
        let mut any = false;
        for (name, x, y) in columns {
            let pairs = || x.iter().zip(y);
            if x.len() == y.len() && pairs().all(|(x, y)| x.to_bits() == y.to_bits()) {
                continue;
            }
            any = true;
            let entry = self.columns.entry(name.to_owned()).or_default();
            entry.rows += 1;
            if x.len() != y.len() {
                entry.largest = f64::INFINITY;
            }
            for (x, y) in pairs() {
                entry.largest = entry.largest.max(distance(*x, *y));
            }
        }
        if any {
            self.differing += 1;
            if self.first.len() < NAMED {
                self.first.push(ends);
            }
        }
    }
}

/// Column of the contacts files, with the numbers of a contact in both.
type InFiles = (String, [Vec<f64>; 2]);

fn columns_of(in_files: &[InFiles]) -> impl Iterator<Item = (&str, &[f64], &[f64])> {
    in_files.iter().map(|(name, [x, y])| (&**name, &**x, &**y))
}

/// Numbers of a contact in the contacts files, by column; empty for a file without a row of it.
fn in_files(tables: [&ContactTable; 2], rows: [Option<usize>; 2]) -> Vec<InFiles> {
    let of_column = |name: &str, of: &dyn Fn(&ContactTable, usize) -> Vec<f64>| {
        let numbers = [0, 1].map(|k| rows[k].map_or_else(Vec::new, |row| of(tables[k], row)));
        (format!("{name} in contacts file"), numbers)
    };
    let columns = CONTACT_COLUMNS.iter().map(|column| {
        of_column(column.name, &|table, row| {
            let numbers = column.of(table);
            (0..numbers.labels().len()).map(|k| numbers.number(row, k)).collect()
        })
    });
    let centre = of_column("centre", &|table, row| table.centre[row].as_slice().to_vec());
    columns.chain([centre]).collect()
}

/// Name of a state column of both laws, and its range in each state.
type SharedState<'a> = (&'a str, Range<usize>, Range<usize>);

/// Rows of two tables, matched by key.
fn matched<T: Ord>(
    first: impl Iterator<Item = T>,
    second: impl Iterator<Item = T>,
) -> BTreeMap<T, [Option<usize>; 2]> {
    let mut rows: BTreeMap<T, [Option<usize>; 2]> = BTreeMap::new();
    for (row, name) in first.enumerate() {
        rows.entry(name).or_default()[0] = Some(row);
    }
    for (row, name) in second.enumerate() {
        rows.entry(name).or_default()[1] = Some(row);
    }
    rows
}

/// Absolute difference of two numbers; infinite if one is not a number.
fn distance(x: f64, y: f64) -> f64 {
    let distance = (x - y).abs();
    if distance.is_nan() { f64::INFINITY } else { distance }
}

fn header_differences(first: &Header, second: &Header) -> Vec<String> {
    let others: BTreeMap<String, String> = facts(second).into_iter().collect();
    // Walls and shapes that one header lacks show as a difference of the lists of names.
    let differs = |(what, a): (String, String)| {
        let b = others.get(&what).filter(|b| **b != a)?;
        Some(format!("{what}: {} and {}", shortened(&a), shortened(b)))
    };
    let mut found: Vec<String> = facts(first).into_iter().filter_map(differs).collect();
    let (mine, theirs) = (states_of_drives(first), states_of_drives(second));
    for what in mine.keys().chain(theirs.keys().filter(|what| !mine.contains_key(*what))) {
        let [a, b] = [&mine, &theirs].map(|states| states.get(what).map_or("nothing", |s| &**s));
        if a != b {
            found.push(format!("{what}: {} and {}", shortened(a), shortened(b)));
        }
    }
    found
}

/// All facts of the state in a header, by name, with enough digits to distinguish each number from all others.
fn facts(header: &Header) -> Vec<(String, String)> {
    let Header {
        step,
        time,
        dt,
        stage_begin,
        stage_shift,
        next_id,
        departed,
        // The reason of the end, the time of measurement and the text of the scene are not part of the state.
        most_moving: _,
        stop: _,
        scene: _,
        cell,
        gravity,
        walls,
        // Compared by the checksums of the walls.
        triangles: _,
        drives: _,
        shapes,
    } = header;
    let names = |names: Vec<&String>| format!("{names:?}");
    let (low, high) = cell.corners();
    let all = [
        ("step", step.to_string()),
        ("time", format!("{time:e} s")),
        ("time step", format!("{dt:e} s")),
        ("begin of the stage", format!("step {}, {:e} s", stage_begin.0, stage_begin.1)),
        ("steps of another length before", format!("{stage_shift:e} s more")),
        ("next id", next_id.to_string()),
        ("left behind by particles that are gone", left_behind(*departed)),
        ("domain", format!("{:?} to {:?} m", low.as_slice(), high.as_slice())),
        ("periodic", format!("{:?}", cell.periodic())),
        ("shear", cell.shear().map_or_else(|| "none".to_owned(), |shear| format!("{shear:?}"))),
        ("flow", cell.strained().map_or_else(|| "none".to_owned(), |flow| format!("{flow:?}"))),
        ("gravity", format!("{:?} m/s2", gravity.as_slice())),
        ("names of walls", names(walls.iter().map(|wall| &wall.name).collect())),
        ("names of shapes", names(shapes.iter().map(|shape| &shape.name).collect())),
    ];
    let of_wall = |WallRow { name, point, normal, velocity, force, body }: &WallRow| {
        let vector = |vector: &Vec3| format!("{:?}", vector.as_slice());
        [
            ("point", vector(point)),
            ("normal", vector(normal)),
            ("velocity", vector(velocity)),
            ("force", vector(force)),
            ("body", format!("{body:?}")),
        ]
        .map(|(what, value)| (format!("wall {name:?}, {what}"), value))
    };
    let of_shape = |shape: &ShapeRow| {
        let ShapeRow { name, scales, most, .. } = shape;
        let body = ShapeRow { scales: [1.0; 2], most: 0.0, ..shape.clone() };
        [
            (format!("scales of shape {name:?}"), format!("{scales:?}")),
            (format!("most particles of shape {name:?}"), most.to_string()),
            (format!("shape {name:?}"), format!("{body:?}")),
        ]
    };
    let all = all.into_iter().map(|(what, value)| (what.to_owned(), value));
    all.chain(shapes.iter().flat_map(of_shape)).chain(walls.iter().flat_map(of_wall)).collect()
}

/// Beginning of a long text.
pub(super) fn shortened(text: &str) -> String {
    const MOST: usize = 160;
    match text.char_indices().nth(MOST) {
        Some((end, _)) => format!("{} ... ({} characters)", &text[..end], text.chars().count()),
        None => text.to_owned(),
    }
}

fn left_behind(Departed { received, dissipated, channels }: Departed) -> String {
    format!("received {received:e} J, dissipated {dissipated:e} J, of that {channels:?} J")
}

/// Saved state of each drive, by the names of drive and column.
fn states_of_drives(header: &Header) -> BTreeMap<String, String> {
    let of_drive = |saved: &SavedState| {
        let named = |SavedColumn { column, values }: &SavedColumn| {
            (format!("{}, {}", saved.drive, column.name), values.words())
        };
        saved.columns.iter().map(named).collect::<Vec<_>>()
    };
    header.drives.iter().flat_map(of_drive).collect()
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            let (particles, contacts) = (self.compared, self.contacts.compared);
            return writeln!(f, "equal bit for bit: {particles} particles, {contacts} contacts");
        }
        for line in &self.header {
            writeln!(f, "{line}")?;
        }
        for (which, ids) in [("first", &self.only_first), ("second", &self.only_second)] {
            if !ids.is_empty() {
                let named: Vec<String> = ids.iter().take(NAMED).map(GlobalId::to_string).collect();
                let more = if ids.len() > NAMED { ", ..." } else { "" };
                let (count, named) = (ids.len(), named.join(", "));
                writeln!(f, "{count} particles only in the {which}: {named}{more}")?;
            }
        }
        for column in &self.only_one_column {
            writeln!(f, "column {column} is in only one of the two")?;
        }
        writeln!(f, "{} of {} particles differ", self.differing, self.compared)?;
        if self.differing > 0 {
            writeln!(f, "\n{:<18} {:>12} {:>24}", "column", "particles", "largest difference")?;
            for (name, column) in &self.columns {
                writeln!(f, "{name:<18} {:>12} {:>24e}", column.rows, column.largest)?;
            }
            writeln!(f, "\nthe first differences:")?;
            writeln!(
                f,
                "{:>10} {:<20} {:>24} {:>24} {:>12}",
                "id", "column", "first", "second", "difference"
            )?;
            for d in &self.first {
                let gap = d.second - d.first;
                let (id, column) = (d.id.to_string(), &d.column);
                writeln!(
                    f,
                    "{id:>10} {column:<20} {:>24e} {:>24e} {gap:>12.3e}",
                    d.first, d.second
                )?;
            }
        }
        self.contacts.fmt(f)
    }
}

impl fmt::Display for ContactDifference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = |contacts: &[Ends]| {
            let named: Vec<_> =
                contacts.iter().take(NAMED).map(|(a, b)| format!("{a}-{b}")).collect();
            named.join(", ") + if contacts.len() > NAMED { ", ..." } else { "" }
        };
        for (which, contacts) in [("first", &self.only_first), ("second", &self.only_second)] {
            if !contacts.is_empty() {
                let (count, named) = (contacts.len(), named(contacts));
                writeln!(f, "{count} contacts only in the {which}: {named}")?;
            }
        }
        for column in &self.only_one_column {
            writeln!(f, "column {column} of contacts is in only one of the two")?;
        }
        writeln!(f, "{} of {} common contacts differ", self.differing, self.compared)?;
        for (name, column) in &self.columns {
            writeln!(f, "{name:<18} {:>12} {:>24e}", column.rows, column.largest)?;
        }
        if !self.first.is_empty() {
            writeln!(f, "the first: {}", named(&self.first))?;
        }
        Ok(())
    }
}
