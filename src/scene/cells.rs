//! Tables of text: the names of columns, and the cells of each row with their line.
//!
//! Cells are separated by commas ([`csv`]) or blanks ([`blanks`]). Files of LAMMPS are read into the same form. Names are in the first line, or
//! in a comment above it. Lines that begin with `#` are comments.

use crate::cell::Cell;
use crate::math::{Mat3, Vec3};
use crate::text::{self, Lines, shown};
use csv::StringRecord;
use std::path::Path;

/// Number of errors of a file that are listed; the others are counted.
const SHOWN: usize = 5;

/// Line and cells of a row, or its error.
pub(super) type Row = Result<(usize, StringRecord), String>;

/// A table.
pub(super) struct Cells<'a> {
    pub(super) names: Vec<String>,
    pub(super) rows: Box<dyn Iterator<Item = Row> + 'a>,
    /// Whether columns of other names are skipped, and several may have the same quantity.
    pub(super) is_rich: bool,
    /// Box of the particles, with its periodic axes.
    pub(super) bounds: Option<Bounds>,
    /// Warnings.
    pub(super) doubts: Vec<String>,
}

/// A box [m].
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) low: Vec3,
    /// Edges as columns; upper triangular.
    pub(super) edges: Mat3,
    pub(super) periodic: [bool; 3],
}

impl Bounds {
    /// Error if the edges lean and are not those of the domain.
    pub(super) fn check(&self, domain: Option<&Cell>) -> Result<(), String> {
        let Self { low, edges, .. } = self;
        let cell = Cell::of_edges(*low, *edges).filter(Cell::is_tilted);
        let (Some(cell), Some(domain)) = (cell, domain) else {
            return Ok(());
        };
        if domain.strained().is_some()
            && (domain.edges() - cell.edges()).amax() <= 1e-9 * edges.amax()
        {
            return Ok(());
        }
        let rows: Vec<String> = edges
            .column_iter()
            .map(|edge| format!("[{:?}, {:?}, {:?}]", edge.x, edge.y, edge.z))
            .collect();
        Err(format!(
            "the box is tilted, and the domain is not so: with a [cell], write `low = [{:?}, {:?}, {:?}]` and `edges = [{}]` in [domain], \
             or write the file after `change_box all ortho`",
            low.x,
            low.y,
            low.z,
            rows.join(", ")
        ))
    }
}

/// The text of a table.
pub(super) fn text(path: &Path) -> Result<String, Vec<String>> {
    text::read(path).map_err(|error| vec![format!("{} {error}", shown(path.display()))])
}

/// Cells separated by commas, with comments, below a line of names if it `has_names`.
pub(super) fn reader(text: &str, has_names: bool) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .flexible(true)
        .has_headers(has_names)
        .from_reader(text.as_bytes())
}

/// The names of columns.
pub(super) fn header(reader: &mut csv::Reader<&[u8]>) -> Result<StringRecord, Vec<String>> {
    let header = reader.headers().map_err(|error| vec![error.to_string()])?.clone();
    let other = header.iter().next().and_then(|first| first.chars().find(|c| ";\t".contains(*c)));
    if let (1, Some(other)) = (header.len(), other) {
        return Err(vec![format!(
            "columns are separated by {other:?} here; write commas, and decimals with a point"
        )]);
    }
    Ok(header)
}

/// First errors, and the number of further ones.
pub(super) fn few(mut mistakes: Vec<String>) -> Vec<String> {
    if mistakes.len() > SHOWN {
        let more = mistakes.len() - SHOWN;
        mistakes.truncate(SHOWN);
        mistakes.push(format!("{more} more mistakes like these"));
    }
    mistakes
}

/// Line of a record. Its position may be before blank lines and comments.
pub(super) fn line_of(record: &StringRecord, text: &str, lines: &Lines) -> usize {
    let begin = record.position().map_or(0, |position| position.byte() as usize);
    let is_skipped = |line: &&str| line.trim().is_empty() || line.starts_with('#');
    lines.at(begin) + text[begin..].lines().take_while(is_skipped).count()
}

/// A table with commas. `is_name` tells whether a column exists.
pub(super) fn csv<'a>(
    text: &'a str,
    is_name: &dyn Fn(&str) -> bool,
) -> Result<Cells<'a>, Vec<String>> {
    let above = names_above(text, is_name, |line| line.split(',').map(str::trim).collect());
    let mut reader = reader(text, above.is_none());
    let names = match above {
        Some(names) => names,
        None => header(&mut reader)?.iter().map(str::to_owned).collect(),
    };
    let lines = Lines::of(text);
    let rows = reader.into_records().map(move |record| {
        let record = record.map_err(|error| error.to_string())?;
        Ok((line_of(&record, text, &lines), record))
    });
    Ok(Cells::plain(names, rows))
}

/// A table with blanks: `x y z` and a radius, or columns with names.
pub(super) fn blanks<'a>(
    text: &'a str,
    is_name: &dyn Fn(&str) -> bool,
) -> Result<Cells<'a>, Vec<String>> {
    let mut lines = lines(text).peekable();
    let Some(&(line, first)) = lines.peek() else {
        return Ok(Cells::plain(Vec::new(), std::iter::empty()));
    };
    let first: Vec<&str> = first.split_whitespace().collect();
    let has_names = first.iter().any(|cell| is_name(cell));
    let above = names_above(text, is_name, |line| line.split_whitespace().collect());
    let names = match above {
        Some(names) => names,
        None if has_names => {
            lines.next();
            first.into_iter().map(str::to_owned).collect()
        }
        None if matches!(first.len(), 3 | 4) => {
            ["x", "y", "z", "radius"][..first.len()].iter().map(|&name| name.to_owned()).collect()
        }
        None => {
            return Err(vec![format!(
                "line {line}: without names of columns a line is `x y z r`, four numbers; it has {}: write the names above, as in \
                 `# x y z radius vx vy vz`",
                first.len()
            )]);
        }
    };
    let rows = lines.map(|(line, cells)| Ok((line, cells.split_whitespace().collect())));
    Ok(Cells::plain(names, rows))
}

impl<'a> Cells<'a> {
    fn plain(names: Vec<String>, rows: impl Iterator<Item = Row> + 'a) -> Self {
        let rows = Box::new(rows);
        Self { names, rows, is_rich: false, bounds: None, doubts: Vec::new() }
    }
}

/// Lines that are not empty, numbered from 1, without comments.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    (1..)
        .zip(text.lines())
        .map(|(line, cells)| (line, cells.split('#').next().unwrap_or_default().trim()))
        .filter(|(_, cells)| !cells.is_empty())
}

/// Names of columns in a comment above the first row: as many as the row has cells, three of them known. Yade writes them as
/// `#format x_y_z_r` (`yade.export.textExt`).
fn names_above(
    text: &str,
    is_name: &dyn Fn(&str) -> bool,
    split: impl Fn(&str) -> Vec<&str>,
) -> Option<Vec<String>> {
    let (_, first) = lines(text).next()?;
    let row = split(first);
    if row.iter().any(|cell| is_name(cell)) {
        return None;
    }
    let above = text.lines().map(str::trim).take_while(|line| !line.starts_with(first));
    let above: Vec<&str> = above.filter_map(|line| line.strip_prefix('#')).collect();
    above.into_iter().rev().find_map(|comment| {
        let comment = comment.trim_start_matches('#').trim();
        let names = match comment.strip_prefix("format ") {
            Some(format) => format.trim().split('_').collect(),
            None => split(comment),
        };
        let known = names.iter().filter(|name| is_name(name)).count();
        let is_header = names.len() == row.len() && known >= 3;
        is_header.then(|| names.into_iter().map(str::to_owned).collect())
    })
}

/// A finite number.
pub(super) fn number(cell: &str) -> Result<f64, String> {
    let number = cell.parse().ok().filter(|x: &f64| x.is_finite());
    number.ok_or_else(|| format!("`{}` is not a number", shown(cell)))
}
