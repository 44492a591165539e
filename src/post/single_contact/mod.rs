//! Section 2 of Lai et al. (2021) regenerated: what erosion costs a single contact, and what it saves.
//!
//! Figures 5, 6, 7 and 8 and table 1, each beside what the paper says of it. The exact answers are those of
//! the common-normal method, which agrees with 50-digit references to rounding
//! (`tests/contact_reference.rs`); the erosion is 5 % of each body, 1 % more until they are apart.
//!
//! | file | what it is |
//! |---|---|
//! | [`study`] | the cases resolved: tables of errors and times |
//! | [`statistics`] | of the errors of random pairs |
//! | [`figures`] | the tables as drawings |
//! | [`report`] | the paper's statements, this code's numbers, verdicts |

pub mod figures;
pub mod report;
pub mod statistics;
pub mod study;

use super::plots::PlotError;
use super::section::csv;
use crate::contact::Why;

/// How much of it to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Random pairs of Case III, touching and apart each. The paper has a million.
    pub count: usize,
    /// Of the random pairs.
    pub seed: u64,
    /// Of each time of table 1, of which the median counts.
    pub repeats: usize,
}

/// Why the section could not be regenerated.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// A pair has no answer.
    #[error("{method} gives no answer for {pair}: {why:?}")]
    Unresolved {
        /// The method.
        method: &'static str,
        /// The pair's name.
        pair: String,
        /// What it says.
        why: Why,
    },
    /// A figure could not be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// A table could not be written.
    #[error("cannot write a table: {0}")]
    Table(#[from] csv::Error),
}

/// All files of the section: names and contents.
///
/// # Errors
/// See [`StudyError`].
pub fn regenerate(plan: &Plan) -> Result<Vec<(String, String)>, StudyError> {
    let study = study::Study::new(plan)?;
    let mut files = vec![
        ("fig5.csv", csv(&study.case_1)?),
        ("fig6.csv", csv(&study.offsets)?),
        ("fig6_deeper.csv", csv(&study.deeper)?),
        ("fig7.csv", csv(&study.case_2)?),
        ("fig8.csv", csv(study.distributions())?),
        ("fig8_summary.csv", csv(study.summaries())?),
        ("table1.csv", csv(&study.times)?),
    ];
    for (name, svg) in figures::all(&study)? {
        files.push((name, svg));
    }
    files.push(("findings.csv", csv(report::rows(&study))?));
    files.push(("report.md", report::report(&study, plan)));
    Ok(files.into_iter().map(|(name, text)| (name.to_string(), text)).collect())
}
