//! The table of a run's scalars by time, `history.csv`: every numeric column of any scene.

use crate::output::growing::whole_lines;
use std::io::Read;

/// Errors of reading a history.
#[derive(Debug, thiserror::Error)]
pub enum HistoryError {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[from] std::io::Error),
    /// The file is not a table.
    #[error("not a table of comma-separated values: {0}")]
    NotATable(#[from] csv::Error),
    /// No column holds the time.
    #[error("no column named \"time\" or starting with \"time_\"; it has: {columns}")]
    NoTime {
        /// Names of the columns.
        columns: String,
    },
}

/// Scalars by time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// Curves, in the order of the columns.
    pub curves: Vec<Curve>,
}

/// One column over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// Name of the column, which ends in its unit.
    pub name: String,
    /// Time [s] and value, ascending in time as in the file.
    pub points: Vec<(f64, f64)>,
}

impl History {
    /// Reads a table with names in its first row. The step is left out, and so are columns in which a cell is
    /// neither empty nor a number. A last line without an end, cut by a full disk or a crash, is not read.
    ///
    /// # Errors
    /// See [`HistoryError`].
    pub fn read(mut source: impl Read) -> Result<Self, HistoryError> {
        let mut text = Vec::new();
        source.read_to_end(&mut text)?;
        let mut table =
            csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(whole_lines(&text));
        let names: Vec<String> = table.headers()?.iter().map(str::to_string).collect();
        let is_time = |name: &String| {
            let name = name.to_lowercase();
            name == "time" || name.starts_with("time_") || name.starts_with("time [")
        };
        let Some(time_column) = names.iter().position(is_time) else {
            return Err(HistoryError::NoTime { columns: names.join(", ") });
        };
        let mut points: Vec<Option<Vec<(f64, f64)>>> = vec![Some(Vec::new()); names.len()];
        for record in table.records() {
            let record = record?;
            let number = |k: usize| record.get(k).map(str::parse::<f64>);
            let Some(Ok(time)) = number(time_column) else { continue };
            for (k, column) in points.iter_mut().enumerate() {
                match (number(k), record.get(k)) {
                    (Some(Ok(value)), _) => {
                        if let Some(column) = column {
                            column.push((time, value));
                        }
                    }
                    (_, None | Some("")) => {}
                    _ => *column = None,
                }
            }
        }
        let curves = names.into_iter().zip(points).enumerate().filter_map(|(k, (name, points))| {
            let skipped = k == time_column || name.eq_ignore_ascii_case("step");
            points.filter(|p| !skipped && !p.is_empty()).map(|points| Curve { name, points })
        });
        Ok(Self { curves: curves.collect() })
    }

    /// Curve of a column, if there is one.
    pub fn curve(&self, name: &str) -> Option<&Curve> {
        self.curves.iter().find(|curve| curve.name == name)
    }

    /// Last value of a column, if there is one.
    pub fn last(&self, name: &str) -> Option<f64> {
        Some(self.curve(name)?.points.last()?.1)
    }
}

impl Curve {
    /// Whether the curve is not constant.
    pub fn changes(&self) -> bool {
        self.points.windows(2).any(|w| w[0].1 != w[1].1)
    }

    /// At most about `limit` points that keep every peak: the first, lowest and highest point of each run of rows.
    pub fn thinned(&self, limit: usize) -> Vec<(f64, f64)> {
        let run = (3 * self.points.len()).div_ceil(limit.max(3)).max(1);
        if self.points.len() <= limit {
            return self.points.clone();
        }
        let mut kept = Vec::new();
        for run in self.points.chunks(run) {
            let by_value = |i: &usize, j: &usize| run[*i].1.total_cmp(&run[*j].1);
            let mut rows = vec![0];
            rows.extend((0..run.len()).min_by(by_value));
            rows.extend((0..run.len()).max_by(by_value));
            rows.sort_unstable();
            rows.dedup();
            kept.extend(rows.into_iter().map(|i| run[i]));
        }
        kept.extend(self.points.last());
        kept.dedup();
        kept
    }
}
