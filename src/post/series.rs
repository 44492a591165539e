//! The snapshots of a run, one after the other.

use super::picture::Picture;
use super::region::{Margin, Region, doubts};
use super::report::Report;
use super::{Analysis, PostError, Settings, analyse, inside};
use crate::output::header::{Header, ShapeRow};
use crate::output::snapshot::{Reader, step_of};
use std::fmt::Display;
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
/// A file that is none, two of one step, or two that no one run can have written.
pub fn open(files: &[PathBuf]) -> Result<Vec<Snapshot>, PostError> {
    let mut files = files.to_vec();
    files.sort();
    files.dedup();
    let opened = files.into_iter().map(|path| {
        let header = Reader::open(&path)?.header().clone();
        Ok((Snapshot { path, step: header.step }, header))
    });
    let mut snapshots = opened.collect::<Result<Vec<_>, PostError>>()?;
    snapshots.sort_by_key(|(snapshot, _)| snapshot.step);
    for two in snapshots.windows(2) {
        let [(before, earlier), (after, later)] = two else { continue };
        let [first, second] = [before, after].map(|snapshot| snapshot.path.clone());
        if before.step == after.step {
            return Err(PostError::SameStep { step: before.step, first, second });
        }
        if let Some(because) = why_not_one_run(earlier, later) {
            return Err(PostError::OtherRun { first, second, because });
        }
    }
    Ok(snapshots.into_iter().map(|(snapshot, _)| snapshot).collect())
}

/// What a run, with all its stages, cannot have done between two snapshots of rising step.
fn why_not_one_run(earlier: &Header, later: &Header) -> Option<String> {
    if later.time <= earlier.time {
        return Some(format!(
            "step {} is at {:e} s, and step {} at {:e} s",
            earlier.step, earlier.time, later.step, later.time
        ));
    }
    if later.next_id < earlier.next_id {
        return Some(format!(
            "by step {} there have been {} particles, by step {} only {}",
            earlier.step, earlier.next_id, later.step, later.next_id
        ));
    }
    let same_name = |shape: &ShapeRow| later.shapes.iter().find(|other| other.name == shape.name);
    let mut common = earlier.shapes.iter().filter_map(|shape| Some((shape, same_name(shape)?)));
    if let Some((shape, other)) = common
        .clone()
        .find(|(shape, other)| shape.kind != other.kind || shape.volume != other.volume)
    {
        return Some(format!(
            "shape `{}` is a {} of {:e} m3 in one and a {} of {:e} m3 in the other",
            shape.name, shape.kind, shape.volume, other.kind, other.volume
        ));
    }
    (common.next().is_none() && !earlier.shapes.is_empty())
        .then(|| "they have no shape in common".to_owned())
}

/// Where to measure in each snapshot of a series, and which contacts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choice {
    /// The same for all.
    pub settings: Settings,
    /// Instead of the region: leave out a layer along the sides, which move with the walls.
    pub margin: Option<Margin>,
}

/// What was found of the snapshots of a series.
#[derive(Debug, Default)]
pub struct Analysed {
    /// Of each.
    pub reports: Vec<Report>,
    /// Of the last.
    pub picture: Picture,
    /// How many are left out and why, as a line; empty if none is.
    pub left_out: String,
}

/// A line that says how many snapshots a measure leaves out, and for what.
pub(super) fn left_out(name: &str, errors: &[impl Display], count: usize) -> String {
    errors.last().map_or_else(String::new, |last| {
        let left = errors.len();
        format!("{name}: {left} of {count} snapshots are left out, the last for this: {last}\n")
    })
}

/// Analyses each snapshot. Strains are taken against the first; a single one has none. Snapshots of which a margin leaves nothing are
/// left out, but not the last.
///
/// # Errors
/// See [`PostError`], with the file.
pub fn reports(snapshots: &[Snapshot], choice: &Choice) -> Result<Analysed, PostError> {
    let mut reports: Vec<Report> = Vec::new();
    let mut picture = Picture::default();
    let mut is_anybody_there = false;
    let mut left = Vec::new();
    let last = snapshots.last().map(|snapshot| &snapshot.path);
    for Snapshot { path, .. } in snapshots {
        let reader = &Reader::open(path)?;
        is_anybody_there = reader.particle_count() > 0;
        let name = path.display().to_string();
        let analysed = || -> Result<Analysis, PostError> {
            let mut settings = choice.settings;
            if let Some(margin) = choice.margin {
                settings.region = inside(reader, margin)?;
            }
            let mut analysis = analyse(reader, &name, settings)?;
            if choice.margin.is_some() {
                // The layer is taken off the box of the whole packing.
                let packing = analysis.report.packing_m.as_ref();
                analysis.report.doubts = doubts(reader.header(), &Region::Whole, packing);
            }
            Ok(analysis)
        };
        match analysed() {
            Ok(analysis) => {
                reports.push(analysis.report);
                picture = analysis.picture;
            }
            Err(error) => {
                let is_passed_over = choice.margin.is_some() && error.is_of_margin();
                let error = PostError::In { file: name.clone(), error: Box::new(error) };
                if !is_passed_over || Some(path) == last {
                    return Err(error);
                }
                left.push(error);
            }
        }
    }
    // The newest is what is shown first.
    let is_last_empty = reports.last().is_some_and(|report| report.summary.particles == 0);
    if is_anybody_there && is_last_empty {
        return Err(PostError::NobodyThere);
    }
    if let [first, _, ..] = &reports[..] {
        let first = first.clone();
        for report in &mut reports {
            report.strain_against(&first);
        }
    }
    let left_out = left_out("reports", &left, snapshots.len());
    Ok(Analysed { reports, picture, left_out })
}
