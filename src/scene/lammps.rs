//! Files of LAMMPS as tables: data files ([`data`]) and text dumps ([`dump`]).
//!
//! | file | content that is read | source |
//! |---|---|---|
//! | data file | `Atoms` of `atom_style sphere` (LIGGGHTS: `granular`) and `ellipsoid`, `Ellipsoids`, `Velocities` | <https://docs.lammps.org/read_data.html> |
//! | dump | `ITEM: ATOMS` with any columns, in the box of `ITEM: BOX BOUNDS` | <https://docs.lammps.org/dump.html> |
//!
//! In both, `shapex shapey shapez` are full lengths, in dumps since LAMMPS of July 2020
//! (<https://gitlab.com/stuko/ovito/-/issues/213>); quaternions of data files begin with w. Edges of any direction are rejected.

use super::cells::{Bounds, Cells, lines, number};
use crate::math::{Mat3, Vec3};
use crate::text::shown;
use csv::StringRecord;
use std::collections::BTreeMap;

type Found<T> = Result<T, Vec<String>>;

fn wrong<T>(line: usize, what: impl std::fmt::Display) -> Found<T> {
    Err(vec![format!("line {line}: {what}")])
}

/// Advice about a general triclinic box.
const GENERAL: &str =
    "the edges of the box have any direction: write it without `triclinic/general`";

// --- data files ---

/// A section of a data file.
struct Section<'a> {
    line: usize,
    title: &'a str,
    /// Comment behind the title.
    style: &'a str,
    lines: Vec<(usize, &'a str)>,
}

/// Is a text a data file? After a first line of any kind it has the number of atoms, before any section.
pub(super) fn is_data(text: &str) -> bool {
    let head = lines_below_the_first(text).take_while(|(_, line)| !is_title(line));
    head.take(100).any(|(_, line)| atoms(line).is_some())
}

fn lines_below_the_first(text: &str) -> impl Iterator<Item = (usize, &str)> {
    lines(text).skip_while(|(line, _)| *line == 1)
}

/// `12 atoms`
fn atoms(line: &str) -> Option<usize> {
    line.strip_suffix("atoms")?.trim().parse().ok()
}

/// Titles are words; other lines have a number.
fn is_title(line: &str) -> bool {
    line.split_whitespace().all(|word| word.starts_with(|c: char| c.is_ascii_alphabetic()))
}

/// The number of atoms, the sections, and the box if it is tilted.
fn sections(text: &str) -> Found<(Option<usize>, Vec<Section<'_>>, Option<Bounds>)> {
    let (mut count, mut sides) = (None, Sides::default());
    let mut sections: Vec<Section> = Vec::new();
    for (line, whole) in (1..).zip(text.lines()).skip(1) {
        let (cells, style) = whole.split_once('#').unwrap_or((whole, ""));
        let (cells, style) = (cells.trim(), style.trim());
        if cells.is_empty() {
            // A blank line or a comment.
        } else if is_title(cells) {
            sections.push(Section { line, title: cells, style, lines: Vec::new() });
        } else if let Some(section) = sections.last_mut() {
            section.lines.push((line, cells));
        } else if let Some(atoms) = atoms(cells) {
            count = Some(atoms);
        } else if cells.ends_with("vec") {
            return wrong(line, GENERAL);
        } else {
            sides.note(line, cells)?;
        }
    }
    Ok((count, sections, sides.bounds()?))
}

/// Sides of the box of a data file [m].
#[derive(Default)]
struct Sides {
    ends: [Option<[f64; 2]>; 3],
    /// Tilts xy, xz and yz, which are not all 0, and their line.
    tilts: Option<(usize, [f64; 3])>,
}

/// Names of the ends of a side.
const ENDS: [[&str; 2]; 3] = [["xlo", "xhi"], ["ylo", "yhi"], ["zlo", "zhi"]];

impl Sides {
    /// `-1 1 xlo xhi` or `0.1 0 0 xy xz yz`; other lines mean nothing here.
    fn note(&mut self, line: usize, cells: &str) -> Found<()> {
        let words: Vec<&str> = cells.split_whitespace().collect();
        let numbers = |words: &[&str]| -> Found<Vec<f64>> {
            let all: Result<_, _> = words.iter().copied().map(number).collect();
            all.or_else(|what| wrong(line, what))
        };
        if let Some(tilts) = words.strip_suffix(&["xy", "xz", "yz"]) {
            let Ok(tilts) = numbers(tilts)?.try_into() else {
                return wrong(line, "the tilts of a box are three numbers");
            };
            self.tilts = (tilts != [0.0; 3]).then_some((line, tilts));
        }
        for (ends, names) in self.ends.iter_mut().zip(ENDS) {
            let Some(words) = words.strip_suffix(&names) else { continue };
            if let [low, high] = numbers(words)?[..]
                && low < high
            {
                *ends = Some([low, high]);
            } else {
                let [low, high] = names;
                let what = format!(
                    "`{}` is not a side of the box: write `low high {low} {high}` with low below high",
                    shown(cells)
                );
                return wrong(line, what);
            }
        }
        Ok(())
    }

    /// A tilted box; positions in others are taken as they are.
    fn bounds(&self) -> Found<Option<Bounds>> {
        let Some((line, [xy, xz, yz])) = self.tilts else { return Ok(None) };
        let [Some([x, right]), Some([y, back]), Some([z, top])] = self.ends else {
            let what = format!(
                "the box has the tilts {xy}, {xz}, {yz} and not all of its sides: write `low high xlo xhi`, and so for \
                 y and z, above it"
            );
            return wrong(line, what);
        };
        let edges = Mat3::new(right - x, xy, xz, 0.0, back - y, yz, 0.0, 0.0, top - z);
        Ok(Some(Bounds { low: Vec3::new(x, y, z), edges, periodic: [true; 3] }))
    }
}

type ById<'a> = BTreeMap<u64, Vec<&'a str>>;

/// Numbers of each particle in a section, by its id; `count` numbers follow the id.
fn by_id<'a>(section: &Section<'a>, count: usize) -> Found<ById<'a>> {
    let mut all = BTreeMap::new();
    for &(line, cells) in &section.lines {
        let mut cells = cells.split_whitespace();
        let id = cells.next().and_then(|id| id.parse().ok());
        let cells: Vec<&str> = cells.collect();
        let (Some(id), true) = (id, cells.len() == count) else {
            let title = section.title;
            return wrong(
                line,
                format!("section {title} has an id and {count} numbers in each line"),
            );
        };
        if let Some(what) = cells.iter().find_map(|cell| number(cell).err()) {
            return wrong(line, what);
        }
        if all.insert(id, cells).is_some() {
            return wrong(line, format!("section {} has particle {id} twice", section.title));
        }
    }
    Ok(all)
}

/// A data file.
pub(super) fn data(text: &str) -> Found<Cells<'_>> {
    const OTHERS: [&str; 3] = ["Lines", "Triangles", "Bodies"];
    let (count, mut sections, bounds) = sections(text)?;
    if let Some(Section { line, title, .. }) = sections.iter().find(|s| OTHERS.contains(&s.title)) {
        let what = format!("particles of section {title} are not read: spheres and ellipsoids are");
        return wrong(*line, what);
    }
    let Some(atoms) = sections.iter().position(|section| section.title == "Atoms") else {
        return Err(vec!["the data file has no section Atoms: was it cut off?".to_owned()]);
    };
    let Section { line, style, lines, .. } = sections.swap_remove(atoms);
    let find = |title| sections.iter().find(|section| section.title == title);
    let is_ellipsoid = match style {
        "ellipsoid" => true,
        "sphere" | "granular" => false,
        "" => find("Ellipsoids").is_some(),
        other => {
            let what = format!(
                "atom_style {} is not read: write_data with `sphere` or `ellipsoid`, or a dump with id type x y z diameter",
                shown(other)
            );
            return wrong(line, what);
        }
    };
    if let Some(count) = count.filter(|&count| count != lines.len()) {
        let found = lines.len();
        let what =
            format!("{found} atoms follow, and the header says {count}: was the file cut off?");
        return wrong(line, what);
    }
    let velocities = find("Velocities").map(|section| by_id(section, 6)).transpose()?;
    let ellipsoids = find("Ellipsoids").map(|section| by_id(section, 7)).transpose()?;
    let ellipsoids = is_ellipsoid.then_some(ellipsoids.unwrap_or_default());
    let atoms = Atoms { ellipsoids, velocities };
    let names = atoms.names().into_iter().map(str::to_owned).collect();
    let rows = lines.into_iter().map(move |(line, cells)| {
        let record = atoms.row(cells).map_err(|what| format!("line {line}: {what}"))?;
        Ok((line, record))
    });
    Ok(Cells { names, rows: Box::new(rows), is_rich: true, bounds, doubts: Vec::new() })
}

/// Data of atoms from other sections of a data file.
struct Atoms<'a> {
    /// Sizes and quaternions of `atom_style ellipsoid`.
    ellipsoids: Option<ById<'a>>,
    velocities: Option<ById<'a>>,
}

impl Atoms<'_> {
    fn names(&self) -> Vec<&'static str> {
        let (third, spin) = match self.ellipsoids {
            Some(_) => ("ellipsoidflag", ["angmomx", "angmomy", "angmomz"]),
            None => ("diameter", ["wx", "wy", "wz"]),
        };
        let mut names = vec!["id", "type", third, "density", "x", "y", "z"];
        if self.ellipsoids.is_some() {
            names.extend(["shapex", "shapey", "shapez", "quatw", "quati", "quatj", "quatk"]);
        }
        if self.velocities.is_some() {
            names.extend(["vx", "vy", "vz"].into_iter().chain(spin));
        }
        names
    }

    /// Row of an atom, with its data from other sections.
    fn row(&self, cells: &str) -> Result<StringRecord, String> {
        let mut cells: Vec<&str> = cells.split_whitespace().collect();
        if !matches!(cells.len(), 7 | 10) {
            return Err(format!(
                "an atom has {} numbers; of this atom_style it has 7, {}, or 10 with image flags",
                cells.len(),
                self.names()[..7].join(" ")
            ));
        }
        cells.truncate(7);
        let id: u64 = cells[0].parse().map_err(|_| format!("`{}` is no id", shown(cells[0])))?;
        let flag = cells[2];
        for (title, all) in [("Ellipsoids", &self.ellipsoids), ("Velocities", &self.velocities)] {
            let Some(all) = all else { continue };
            if title == "Ellipsoids" && flag != "1" {
                return Err(format!(
                    "atom {id} is a point (its ellipsoidflag is not 1); give it a `shape` in LAMMPS"
                ));
            }
            let more = all.get(&id);
            cells.extend(more.ok_or_else(|| format!("section {title} has no atom {id}"))?);
        }
        Ok(StringRecord::from(cells))
    }
}

// --- dumps ---

/// Lines of a text, from 1, as they are.
type Numbered<'a> = std::iter::Peekable<Box<dyn Iterator<Item = (usize, &'a str)> + 'a>>;

/// One frame of a text dump, by its place in the file from 0, or the last one.
pub(super) fn dump(text: &str, frame: Option<u64>) -> Found<Cells<'_>> {
    let numbered = || (1..).zip(text.lines().map(str::trim));
    let begins = numbered().filter(|(_, line)| line.starts_with("ITEM: TIMESTEP"));
    let begins: Vec<usize> = begins.map(|(line, _)| line).collect();
    let Some(last) = begins.len().checked_sub(1) else {
        return Err(vec![
            "the dump has no `ITEM: TIMESTEP`; is it a text dump of the styles atom or custom?"
                .to_owned(),
        ]);
    };
    let frame = frame.map_or(Some(last), |frame| usize::try_from(frame).ok());
    let Some(&begin) = frame.and_then(|frame| begins.get(frame)) else {
        let step = |line: usize| shown(text.lines().nth(line).unwrap_or_default().trim());
        let (first, end) = (step(begins[0]), step(begins[last]));
        return Err(vec![format!(
            "the dump has frames 0 to {last}, from time step {first} to {end}; `frame` is one of them"
        )]);
    };
    let chosen: Box<dyn Iterator<Item = _>> = Box::new(numbered().skip(begin - 1));
    let mut cells = atoms_of_frame(&mut chosen.peekable(), last)?;
    let mut units = numbered().take(begin).skip_while(|(_, line)| *line != "ITEM: UNITS");
    if let Some((_, units)) = units.nth(1).filter(|(_, units)| *units != "si") {
        cells.doubts.push(format!(
            "the dump is in units `{}`: its numbers are taken as m, m/s and rad/s",
            shown(units)
        ));
    }
    Ok(cells)
}

/// The rows of a frame that begins here; `last` is that of the file.
fn atoms_of_frame<'a>(lines: &mut Numbered<'a>, last: usize) -> Found<Cells<'a>> {
    const CUT_OFF: &str = "the file ends within a frame";
    let (mut count, mut bounds, mut is_first) = (None, None, true);
    let cure = if last > 0 { "; an earlier frame is `frame = 0` and following" } else { "" };
    loop {
        let Some((line, item)) =
            lines.next().map(|(n, text)| (n, text.strip_prefix("ITEM:").map(str::trim)))
        else {
            return Err(vec![format!("{CUT_OFF}{cure}")]);
        };
        match item {
            Some("TIMESTEP") if !is_first => {
                return wrong(line, format!("the frame before has no `ITEM: ATOMS`{cure}"));
            }
            Some("NUMBER OF ATOMS") => {
                let number = lines.next().map_or("", |(_, number)| number);
                let Ok(number) = number.parse::<usize>() else {
                    return wrong(line + 1, format!("`{}` is no number of atoms", shown(number)));
                };
                count = Some(number);
            }
            Some(item) if item.starts_with("BOX BOUNDS") => {
                bounds = Some(bounds_of(line, item, lines)?);
            }
            Some(item) if item.starts_with("ATOMS") => {
                let names: Vec<String> =
                    item.split_whitespace().skip(1).map(str::to_owned).collect();
                let rows = rows_of(lines);
                if let Some(count) = count.filter(|&count| count != rows.len()) {
                    return wrong(
                        line,
                        format!(
                            "{} atoms follow, and the frame has {count}: was the file cut off?{cure}",
                            rows.len()
                        ),
                    );
                }
                let rows = rows
                    .into_iter()
                    .map(|(line, cells)| Ok((line, cells.split_whitespace().collect())));
                return Ok(Cells {
                    names,
                    rows: Box::new(rows),
                    is_rich: true,
                    bounds,
                    doubts: Vec::new(),
                });
            }
            _ => {}
        }
        is_first = false;
    }
}

/// Lines up to the next item.
fn rows_of<'a>(lines: &mut Numbered<'a>) -> Vec<(usize, &'a str)> {
    let mut rows = Vec::new();
    while let Some(row) = lines.next_if(|(_, line)| !line.starts_with("ITEM:")) {
        rows.push(row);
    }
    rows.retain(|(_, line)| !line.is_empty());
    rows
}

/// `BOX BOUNDS pp pp ff` with lines `low high`, or `BOX BOUNDS xy xz yz pp pp ff` with lines `low high tilt`.
fn bounds_of(line: usize, item: &str, lines: &mut Numbered) -> Found<Bounds> {
    let words: Vec<&str> = item.split_whitespace().skip(2).collect();
    if words.contains(&"abc") {
        return wrong(line, GENERAL);
    }
    let (mut ends, mut tilts, mut periodic) = ([[0.0; 2]; 3], [0.0; 3], [false; 3]);
    for axis in 0..3 {
        let (line, cells) = lines.next().unwrap_or((line, ""));
        let numbers: Result<Vec<f64>, String> = cells.split_whitespace().map(number).collect();
        match numbers.as_deref() {
            Ok([low, high, tilt @ ..]) if low < high && tilt.len() < 2 => {
                ends[axis] = [*low, *high];
                tilts[axis] = tilt.first().copied().unwrap_or_default();
            }
            _ => return wrong(line, format!("`{}` is not `low high` of the box", shown(cells))),
        }
        let sides = words.len().checked_sub(3).and_then(|first| words.get(first + axis));
        periodic[axis] = sides.is_some_and(|sides| *sides == "pp");
    }
    // The ends are those of the upright box around the tilted one.
    let [xy, xz, yz] = tilts;
    let around = [[xy, xz, xy + xz], [yz, 0.0, 0.0], [0.0; 3]];
    for (ends, tilts) in ends.iter_mut().zip(around) {
        ends[0] -= tilts.into_iter().fold(0.0, f64::min);
        ends[1] -= tilts.into_iter().fold(0.0, f64::max);
    }
    let [x, y, z] = ends.map(|[low, high]| high - low);
    let low = Vec3::from(ends.map(|[low, _]| low));
    Ok(Bounds { low, edges: Mat3::new(x, xy, xz, 0.0, y, yz, 0.0, 0.0, z), periodic })
}
