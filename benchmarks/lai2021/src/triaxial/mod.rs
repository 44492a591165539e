//! Section 3 of Lai et al. (2021) regenerated: what the method of contact resolution does to a packing and
//! to its triaxial compression.
//!
//! Figures 9 to 14, each beside what the paper says of it, from the snapshots of runs:
//! `ROOT/METHOD/STAGE/`, with the method `common-normal`, `epa`, `gjk-erosion` or `gjk-gjk-erosion` and the stage
//! `packing`, `consolidation` or `shear`. What is not there is left out, and the report says so.
//!
//! The paper compares erosion with EPA, which it takes as the truth. Where EPA has no number, for its runs are not
//! there or not over, the common normal stands in: the truth itself for these bodies.
//!
//! | file | what it is |
//! |---|---|
//! | [`run`] | the runs of a method: what was read, peak, plateau, curves |
//! | [`figures`] | figures and their tables |
//! | [`report`] | the paper's statements, this code's numbers, verdicts |
//! | [`stages`] | packing, consolidation and compression by dem-mpi |
//! | [`cost`] | what contacts cost in the compression, and by themselves |

pub mod cost;
pub mod figures;
pub mod report;
pub mod run;
pub mod stages;

pub use run::{Method, Run};

use dem_mpi::post::PostError;
use dem_mpi::post::draw::PlotError;
use dem_mpi::post::report::csv;
use dem_mpi::post::series::Choice;
use std::path::{Path, PathBuf};

/// Why the section could not be regenerated.
#[derive(Debug, thiserror::Error)]
pub enum TriaxialError {
    /// No run at all.
    #[error(
        "{root} holds no run: none of common-normal, epa, gjk-gjk-erosion and gjk-erosion has a folder packing, \
         consolidation or shear with particles_STEP.vtkhdf in it",
        root = root.display()
    )]
    NoRun {
        /// The folder.
        root: PathBuf,
    },
    /// A snapshot could not be analysed.
    #[error(transparent)]
    Post(#[from] PostError),
    /// A figure could not be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// A table could not be written.
    #[error("cannot write a table: {0}")]
    Table(#[from] csv::Error),
}

/// All files of the section: names and contents. Whole packings as in the paper, unless `choice` says
/// otherwise; then the report does, too.
///
/// # Errors
/// See [`TriaxialError`].
pub fn regenerate(root: &Path, choice: &Choice) -> Result<Vec<(String, String)>, TriaxialError> {
    let mut runs = Vec::new();
    let mut picture = None;
    for method in Method::ALL {
        let (run, pictures) = Run::read(root, method, choice)?;
        if run.is_empty() {
            continue;
        }
        picture = picture.or_else(|| pictures.map(|pictures| pictures.drawn(&run)));
        runs.push(run);
    }
    if runs.is_empty() {
        return Err(TriaxialError::NoRun { root: root.to_path_buf() });
    }
    let mut files: Vec<(&str, String)> = figures::tables(&runs)?;
    files.extend(picture.map(|svg| ("fig9.svg", svg)));
    files.extend(figures::all(&runs)?);
    files.push(("findings.csv", csv(report::rows(&runs))?));
    files.push(("report.md", report::report(&runs)));
    Ok(files.into_iter().map(|(name, text)| (name.to_string(), text)).collect())
}
