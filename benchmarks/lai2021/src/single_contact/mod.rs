//! Section 2 of Lai et al. (2021) regenerated: errors and time of erosion for a single contact.
//!
//! Figures 5, 6, 7 and 8 and table 1, each beside the statements of the paper. The exact results are those
//! of the common-normal method, which agrees with 50-digit references to rounding
//! (`tests/contact/reference.rs`). Erosion is 5 % of each body, and 1 % more until they are apart.
//!
//! | file | content |
//! |---|---|
//! | [`study`] | the cases resolved: tables of errors and times |
//! | [`statistics`] | statistics of the errors of random pairs |
//! | [`figures`] | the tables as drawings |
//! | [`report`] | the paper's statements, numbers of this code, verdicts |

pub mod figures;
pub mod report;
pub mod statistics;
pub mod study;

use crate::record::{machine, store};
use anyhow::Result;
use benchmarking::machine::load;
use clap::Args;
use dem_mpi::contact::Why;
use dem_mpi::post::draw::PlotError;
use dem_mpi::post::report::csv;
use std::path::Path;

/// Extent of the section.
#[derive(Args, Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Random pairs of Case III, touching and apart each; the paper has a million
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    pub count: u32,
    /// Seed of the random pairs: the same seed gives the same pairs on every machine
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Measurements of each time of table 1, of which the median counts
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    pub repeats: u32,
}

/// File that is written last.
const MACHINE: &str = "machine.txt";

impl Plan {
    /// Regenerates the section in this folder, with `machine.txt`, with the checkout as current directory.
    ///
    /// # Errors
    /// See [`StudyError`]; also if a file cannot be written.
    pub fn run(&self, out: &Path) -> Result<()> {
        store(out, &regenerate(self)?)?;
        let text = machine(&self.command(), &format!(", load {}", load(1)));
        print!("{text}");
        store(out, &[(MACHINE.into(), text)])
    }

    /// Whether this folder has the section by this plan, for any commit.
    pub fn is_done(&self, out: &Path) -> bool {
        let text = std::fs::read_to_string(out.join(MACHINE));
        text.is_ok_and(|text| text.lines().any(|line| line.ends_with(&self.command())))
    }

    fn command(&self) -> String {
        let Self { count, seed, repeats } = self;
        format!("run/paper/single-contact/run --count {count} --seed {seed} --repeats {repeats}")
    }
}

/// Errors of the section.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// A pair has no result.
    #[error("{method} gives no answer for {pair}: {why:?}")]
    Unresolved {
        /// The method.
        method: &'static str,
        /// Name of the pair.
        pair: String,
        /// Reason given by the method.
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
