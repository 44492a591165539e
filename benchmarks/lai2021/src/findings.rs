//! What the reports on both sections share: statements of the paper beside findings, verdicts, tables.

use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// A statement of the paper, and what came of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// By which other findings refer to it; of one section no two are equal.
    pub name: &'static str,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Verdict {
    /// It does.
    #[serde(rename = "reproduces")]
    Yes,
    /// With a restriction that the numbers show.
    #[serde(rename = "nearly")]
    Nearly,
    /// It does not.
    #[serde(rename = "does not")]
    No,
    /// Numbers are missing.
    #[serde(rename = "no data")]
    Untold,
}

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// A statement of the paper on what it found.
    #[serde(rename = "statement")]
    Statement,
    /// A condition that the paper sets: it holds because the runs were set up so.
    #[serde(rename = "setting")]
    Setting,
    /// A check of this code's runs, which the paper does not state.
    #[serde(rename = "check")]
    Check,
}

/// How the paper's erosion is read; it can be read both ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reading {
    /// Erosion of bodies that GJK finds touching ("GJK + GJK-erosion", table 1).
    #[serde(rename = "GJK + erosion")]
    Checked,
    /// Erosion of all bodies that come near; it also finds pairs of small clearance (fig. 3).
    #[serde(rename = "erosion")]
    Alone,
}

impl Reading {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Checked, Self::Alone];
}

/// A finding as a row of `findings.csv`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Row {
    /// The part of the paper.
    pub part: String,
    /// See [`Finding::name`].
    pub name: String,
    /// What it is about.
    pub kind: Kind,
    /// See [`Finding::figure`].
    pub figure: String,
    /// See [`Finding::statement`].
    pub statement: String,
    /// How erosion was read.
    pub reading: Reading,
    /// See [`Finding::here`].
    pub here: String,
    /// See [`Finding::verdict`].
    pub verdict: Verdict,
}

impl Row {
    /// A finding of this part of the paper, with erosion read so.
    pub fn new(part: &str, kind: Kind, reading: Reading, finding: Finding) -> Self {
        let Finding { name, figure, statement, here, verdict } = finding;
        Self {
            part: part.into(),
            name: name.into(),
            kind,
            figure: figure.into(),
            statement: statement.into(),
            reading,
            here,
            verdict,
        }
    }
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

    /// In tables to read.
    pub const fn words(self) -> &'static str {
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
