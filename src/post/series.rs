//! The snapshots of a run, one after the other.

use super::picture::Picture;
use super::region::Margin;
use super::report::Report;
use super::{PostError, Settings, analyse, inside};
use crate::output::snapshot::{Reader, step_of};
use std::path::{Path, PathBuf};

/// The newest snapshot of a folder: the one that `last.vtkhdf` points to, else that of the latest step.
///
/// # Errors
/// A folder that cannot be listed or holds no snapshot.
pub fn newest(folder: &Path) -> Result<PathBuf, PostError> {
    let last = folder.join("last.vtkhdf");
    if last.exists() {
        return Ok(last);
    }
    all(folder)?.pop().ok_or_else(|| PostError::NoSnapshot { folder: folder.to_path_buf() })
}

/// All snapshots of a folder by step, at least one.
///
/// # Errors
/// As [`newest`].
pub fn all(folder: &Path) -> Result<Vec<PathBuf>, PostError> {
    let unlisted = |cause| PostError::Unlisted { folder: folder.to_path_buf(), cause };
    let entries = std::fs::read_dir(folder).map_err(unlisted)?;
    let paths = entries.filter_map(|entry| entry.ok().map(|e| e.path()));
    let mut files: Vec<PathBuf> = paths.filter(|path| step_of(path).is_some()).collect();
    files.sort_by_key(|path| step_of(path));
    if files.is_empty() {
        return Err(PostError::NoSnapshot { folder: folder.to_path_buf() });
    }
    Ok(files)
}

/// A snapshot of a series, closed: an open one holds two files, and a process may have a thousand at once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// Its particles file.
    pub path: PathBuf,
    /// Its step.
    pub step: u64,
}

/// Opens snapshots, each once and one after the other, and lists them by step.
///
/// # Errors
/// A file that is none, or two of one step.
pub fn open(files: &[PathBuf]) -> Result<Vec<Snapshot>, PostError> {
    let mut files = files.to_vec();
    files.sort();
    files.dedup();
    let opened = files.into_iter().map(|path| {
        let step = Reader::open(&path)?.header().step;
        Ok(Snapshot { path, step })
    });
    let mut snapshots = opened.collect::<Result<Vec<_>, PostError>>()?;
    snapshots.sort_by_key(|snapshot| snapshot.step);
    if let Some(same) = snapshots.windows(2).find(|two| two[0].step == two[1].step) {
        let [first, second] = [0, 1].map(|k| same[k].path.clone());
        return Err(PostError::SameStep { step: same[0].step, first, second });
    }
    Ok(snapshots)
}

/// Where to measure in each snapshot of a series, and which contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choice {
    /// The same for all.
    pub settings: Settings,
    /// Instead of the region: leave out a layer along the sides, which move with the walls.
    pub margin: Option<Margin>,
}

/// Analyses each snapshot. Strains are taken against the first; a single one has none.
///
/// # Errors
/// See [`PostError`], with the file.
pub fn reports(
    snapshots: &[Snapshot],
    choice: &Choice,
) -> Result<(Vec<Report>, Picture), PostError> {
    let mut reports: Vec<Report> = Vec::new();
    let mut picture = Picture::default();
    let mut is_anybody_there = false;
    for Snapshot { path, .. } in snapshots {
        let reader = &Reader::open(path)?;
        is_anybody_there |= reader.particle_count() > 0;
        let name = path.display().to_string();
        let analysed = || {
            let mut settings = choice.settings;
            if let Some(margin) = choice.margin {
                settings.region = inside(reader, margin)?;
            }
            analyse(reader, &name, settings)
        };
        let analysis = analysed()
            .map_err(|error| PostError::In { file: name.clone(), error: Box::new(error) })?;
        reports.push(analysis.report);
        picture = analysis.picture;
    }
    if is_anybody_there && reports.iter().all(|report| report.summary.particles == 0) {
        return Err(PostError::NobodyThere);
    }
    if let [first, _, ..] = &reports[..] {
        let first = first.clone();
        for report in &mut reports {
            report.strain_against(&first);
        }
    }
    Ok((reports, picture))
}
