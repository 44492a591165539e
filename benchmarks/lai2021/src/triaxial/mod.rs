//! Section 3 of Lai et al. (2021) regenerated: effect of the method of contact resolution on a packing and on its
//! triaxial compression.
//!
//! Figures 9 to 14, each beside the statements of the paper, from the snapshots of runs: `ROOT/METHOD/STAGE/`,
//! with the method `common-normal`, `epa`, `gjk-erosion` or `gjk-gjk-erosion` and the stage `packing`,
//! `consolidation` or `shear`. Missing runs are left out, and the report lists them.
//!
//! The paper compares erosion with EPA as the reference. Where EPA has no number, because its runs are missing or
//! unfinished, the common normal replaces it; for these bodies it is exact.
//!
//! | file | content |
//! |---|---|
//! | [`run`] | runs of a method: their data, peak, plateau, curves |
//! | [`figures`] | figures and their tables |
//! | [`report`] | the paper's statements, this code's numbers, verdicts |
//! | [`stages`] | packing, consolidation and compression by dem-mpi |
//! | [`cost`] | cost of contacts in the compression, and alone |

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

/// Errors of the section.
#[derive(Debug, thiserror::Error)]
pub enum TriaxialError {
    /// There are no runs.
    #[error(
        "{root} holds no run: none of common-normal, epa, gjk-gjk-erosion and gjk-erosion has a folder packing, \
         consolidation or shear with particles_STEP.vtkhdf in it",
        root = root.display()
    )]
    NoRun {
        /// Path of the folder.
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

/// All files of the section: names and contents. Whole packings are measured as in the paper, unless `choice`
/// differs, which the report then mentions.
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
