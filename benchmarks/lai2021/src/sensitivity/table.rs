//! Tables of numbers by name, and means over rows of one kind.

use crate::spread::Spread;
use anyhow::{Context, Result};
use std::path::Path;

/// A table with names in its first row.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows; names are separated by commas.
    pub fn new(names: &str) -> Self {
        Self { names: names.split(',').map(str::to_owned).collect(), rows: Vec::new() }
    }

    /// Table of a file.
    ///
    /// # Errors
    /// If the file is not a table.
    pub fn read(path: &Path) -> Result<Self> {
        let place = || path.display().to_string();
        let mut reader = csv::Reader::from_path(path).with_context(place)?;
        let names = reader.headers().with_context(place)?.iter().map(str::to_owned).collect();
        let rows = reader.deserialize().collect::<Result<_, _>>().with_context(place)?;
        Ok(Self { names, rows })
    }

    /// Appends a row: its first cells separated by commas, then numbers.
    pub fn push(&mut self, first: &str, numbers: impl IntoIterator<Item = String>) {
        let row: Vec<String> = first.split(',').map(str::to_owned).chain(numbers).collect();
        debug_assert_eq!(row.len(), self.names.len());
        self.rows.push(row);
    }

    /// The table as CSV.
    pub fn text(&self) -> String {
        let lines = std::iter::once(&self.names).chain(&self.rows).map(|row| row.join(",") + "\n");
        lines.collect::<Vec<_>>().concat()
    }

    /// Names of the columns.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(String::as_str)
    }

    /// Index of the column with this name.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn at(&self, name: &str) -> Result<usize> {
        self.names.iter().position(|n| n == name).with_context(|| format!("no column {name}"))
    }

    /// Cells of a column.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn column(&self, name: &str) -> Result<impl Iterator<Item = &str>> {
        let at = self.at(name)?;
        Ok(self.rows.iter().map(move |row| row[at].as_str()))
    }

    /// Numbers of a column; `None` for a cell without a number.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn numbers(&self, name: &str) -> Result<Vec<Option<f64>>> {
        Ok(self.column(name)?.map(|cell| cell.parse().ok()).collect())
    }

    /// Rows with this cell in a column.
    ///
    /// # Errors
    /// If there is no such column.
    pub fn with(&self, name: &str, cell: &str) -> Result<Self> {
        let at = self.at(name)?;
        let rows = self.rows.iter().filter(|row| row[at] == cell).cloned().collect();
        Ok(Self { names: self.names.clone(), rows })
    }

    /// Means and standard deviations of columns over the rows with the same keys, and the number of rows. Kinds are
    /// in the order of their first appearance. Cells are empty if one of the rows has no value.
    ///
    /// # Errors
    /// If a column is missing.
    pub fn means(&self, keys: &[&str], values: &[&str]) -> Result<Self> {
        let key_at = keys.iter().map(|key| self.at(key)).collect::<Result<Vec<_>>>()?;
        let value_at = values.iter().map(|value| self.at(value)).collect::<Result<Vec<_>>>()?;
        let mut kinds: Vec<(Vec<&str>, Vec<&Vec<String>>)> = Vec::new();
        for row in &self.rows {
            let kind: Vec<&str> = key_at.iter().map(|&at| row[at].as_str()).collect();
            match kinds.iter_mut().find(|(known, _)| *known == kind) {
                Some((_, rows)) => rows.push(row),
                None => kinds.push((kind, vec![row])),
            }
        }
        let with_deviations = values.iter().map(|value| format!("{value},{value}_deviation"));
        let names = keys.iter().map(|&key| key.to_owned()).chain(["packings".to_owned()]);
        let names: Vec<String> = names.chain(with_deviations).collect();
        let mut table = Self::new(&names.join(","));
        for (kind, rows) in kinds {
            let numbers = value_at.iter().flat_map(|&at| {
                let cells = rows.iter().map(|row| row[at].parse().ok());
                let spread = cells.collect::<Option<Vec<f64>>>().map(|cells| Spread::of(&cells));
                match spread {
                    Some(Spread { mean, deviation, .. }) => {
                        [general(mean, 5), general(deviation, 2)]
                    }
                    None => [String::new(), String::new()],
                }
            });
            table.push(&format!("{},{}", kind.join(","), rows.len()), numbers);
        }
        Ok(table)
    }
}

/// A number with this many significant digits, in the format `%g` of C.
pub fn general(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let scientific = format!("{value:.*e}", digits - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or_default();
    let short = |text: &str| {
        let zeros: &[char] = if text.contains('.') { &['0'] } else { &[] };
        text.trim_end_matches(zeros).trim_end_matches('.').to_owned()
    };
    if (-4..digits as i32).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent) as usize;
        return short(&format!("{value:.decimals$}"));
    }
    let sign = if exponent < 0 { '-' } else { '+' };
    format!("{}e{sign}{:02}", short(mantissa), exponent.abs())
}

#[cfg(test)]
mod tests {
    use super::general;

    #[test]
    fn numbers_are_as_short_as_their_digits() {
        for (value, digits, expected) in [
            (0.0, 5, "0"),
            (7.5, 5, "7.5"),
            (123_456.0, 5, "1.2346e+05"),
            (99_999.6, 5, "1e+05"),
            (0.000_123_456, 4, "0.0001235"),
            (0.000_012_345_6, 4, "1.235e-05"),
            (-0.25, 2, "-0.25"),
            (100.0, 2, "1e+02"),
            (1500.0, 4, "1500"),
        ] {
            assert_eq!(general(value, digits), expected);
        }
    }
}
