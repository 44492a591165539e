//! Common parts of the reports on both sections: statements of the paper beside findings, verdicts,
//! tables.

use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// A statement of the paper, with the finding on it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Name by which other findings refer to it, unique within a section.
    pub name: &'static str,
    /// Figure, table or section of the paper.
    pub figure: &'static str,
    /// Statement of the paper.
    pub statement: &'static str,
    /// Finding of this code, with numbers.
    pub here: String,
    /// Verdict on the statement.
    pub verdict: Verdict,
}

/// Verdicts on whether a statement is reproduced, from the best to the worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Verdict {
    /// The statement is reproduced.
    #[serde(rename = "reproduces")]
    Yes,
    /// The statement is reproduced with a restriction that the numbers show.
    #[serde(rename = "nearly")]
    Nearly,
    /// The statement is not reproduced.
    #[serde(rename = "does not")]
    No,
    /// There are no numbers.
    #[serde(rename = "no data")]
    Untold,
}

/// Subject of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Kind {
    /// A statement of the paper on what it found.
    #[serde(rename = "statement")]
    Statement,
    /// A condition of the paper, fulfilled by the setup of the runs.
    #[serde(rename = "setting")]
    Setting,
    /// A check of the runs of this code, without a statement of the paper.
    #[serde(rename = "check")]
    Check,
}

/// The two possible readings of erosion in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reading {
    /// Erosion of bodies found touching by GJK ("GJK + GJK-erosion", table 1).
    #[serde(rename = "GJK + erosion")]
    Checked,
    /// Erosion of all bodies near each other; it also finds pairs with a small clearance (fig. 3).
    #[serde(rename = "erosion")]
    Alone,
}

impl Reading {
    /// Both readings.
    pub const ALL: [Self; 2] = [Self::Checked, Self::Alone];
}

/// A finding as a row of `findings.csv`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Row {
    /// Part of the paper.
    pub part: String,
    /// See [`Finding::name`].
    pub name: String,
    /// Subject of the finding.
    pub kind: Kind,
    /// See [`Finding::figure`].
    pub figure: String,
    /// See [`Finding::statement`].
    pub statement: String,
    /// Reading of erosion.
    pub reading: Reading,
    /// See [`Finding::here`].
    pub here: String,
    /// See [`Finding::verdict`].
    pub verdict: Verdict,
}

impl Row {
    /// A finding on this part of the paper, with this reading of erosion.
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
    /// Verdict on a statement that holds or does not.
    pub const fn of(holds: bool) -> Self {
        if holds { Self::Yes } else { Self::No }
    }

    /// Verdict on a number that should be small: at most `yes`, or at most `nearly`.
    pub fn small(size: f64, yes: f64, nearly: f64) -> Self {
        match size.abs() {
            size if size <= yes => Self::Yes,
            size if size <= nearly => Self::Nearly,
            _ => Self::No,
        }
    }

    /// The worst of the verdicts with data.
    pub fn worst(verdicts: impl IntoIterator<Item = Self>) -> Self {
        let told = verdicts.into_iter().filter(|v| *v != Self::Untold);
        told.max().unwrap_or(Self::Untold)
    }

    /// Words for tables.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Yes => "reproduces",
            Self::Nearly => "nearly",
            Self::No => "**does not**",
            Self::Untold => "no data",
        }
    }
}

/// Findings as a Markdown table; `whose` is the head of the column of statements.
pub fn table(whose: &str, findings: &[Finding]) -> String {
    let mut table = format!("| | {whose} | here | verdict |\n|---|---|---|---|\n");
    for f in findings {
        let words = f.verdict.words();
        let _ = writeln!(table, "| {} | {} | {} | {words} |", f.figure, f.statement, f.here);
    }
    table
}
