//! What the pages share that regenerate a section of the paper: statements beside findings, verdicts,
//! tables.

use serde::Serialize;
use std::fmt::Write;

/// A statement of the paper, and what came of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The figure or table of the paper, or its section.
    pub figure: &'static str,
    /// What the paper says.
    pub statement: &'static str,
    /// What was found here, with numbers.
    pub here: String,
    /// What follows from them.
    pub verdict: Verdict,
}

/// Does a statement reproduce? From the best to the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// It does.
    Yes,
    /// With a restriction that the numbers show.
    Nearly,
    /// It does not.
    No,
    /// Numbers are missing.
    Untold,
}

impl Verdict {
    /// Of a statement that holds or does not.
    pub const fn of(holds: bool) -> Self {
        if holds { Self::Yes } else { Self::No }
    }

    /// Of a number that is to be small: at most `yes`, or at most `nearly`.
    pub fn small(size: f64, yes: f64, nearly: f64) -> Self {
        match size.abs() {
            size if size <= yes => Self::Yes,
            size if size <= nearly => Self::Nearly,
            _ => Self::No,
        }
    }

    /// The worst of those that can be told.
    pub fn worst(verdicts: impl IntoIterator<Item = Self>) -> Self {
        let told = verdicts.into_iter().filter(|v| *v != Self::Untold);
        told.max().unwrap_or(Self::Untold)
    }

    const fn words(self) -> &'static str {
        match self {
            Self::Yes => "reproduces",
            Self::Nearly => "nearly",
            Self::No => "**does not**",
            Self::Untold => "no data",
        }
    }
}

/// Findings as a Markdown table; `whose` heads the column of statements.
pub fn table(whose: &str, findings: &[Finding]) -> String {
    let mut table = format!("| | {whose} | here | verdict |\n|---|---|---|---|\n");
    for f in findings {
        let words = f.verdict.words();
        let _ = writeln!(table, "| {} | {} | {} | {words} |", f.figure, f.statement, f.here);
    }
    table
}

/// CSV with the names of the fields as header; empty without rows.
///
/// # Errors
/// Rows that are no flat records.
pub fn csv<T: Serialize>(rows: impl IntoIterator<Item = T>) -> Result<String, csv::Error> {
    let mut table = csv::Writer::from_writer(Vec::new());
    for row in rows {
        table.serialize(row)?;
    }
    let bytes = table.into_inner().map_err(|e| csv::Error::from(e.into_error()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
