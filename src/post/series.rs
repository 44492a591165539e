//! Series of snapshots of a run.

use super::picture::Picture;
use super::region::{Bounds, Margin, Region, doubts};
use super::report::{Report, readable};
use super::{Analysis, PostError, Settings, analyse, inside};
use crate::output::header::{Header, ShapeRow};
use crate::output::snapshot::{Reader, step_of};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Newest snapshot of a folder: the target of `last.vtkhdf`, otherwise that of the latest step.
///
/// # Errors
/// If the folder cannot be listed or has no snapshot.
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
/// See [`newest`].
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

/// A snapshot of a series, closed: an open one holds two files, and a process may have only a thousand open.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Snapshot {
    /// Path of the particles file.
    pub path: PathBuf,
    /// Step of the snapshot.
    pub step: u64,
}

/// Opens snapshots one after the other, each once, and lists them by step.
///
/// # Errors
/// If a file is not a snapshot, two are of one step, or two cannot come from one run.
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

/// Reason for which two snapshots of rising step cannot come from one run with all its stages.
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

/// Region and contacts for each snapshot of a series.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Choice {
    /// Settings for all snapshots.
    pub settings: Settings,
    /// Thickness of a layer along the sides to leave out, instead of a region; it moves with the walls.
    pub margin: Option<Margin>,
}

/// Results for the snapshots of a series.
#[derive(Debug, Default)]
pub struct Analysed {
    /// Report of each snapshot.
    pub reports: Vec<Report>,
    /// Picture of the last snapshot.
    pub picture: Picture,
    /// Pictures of the first snapshot and the middle one, each with its time in words and its box.
    pub earlier: Vec<(String, Picture, Option<Bounds>)>,
    /// A line with the number of skipped snapshots and the reason, if any is skipped.
    pub left_out: Option<String>,
}

/// A line with the number of snapshots that a measure skips, and the reason.
pub(super) fn left_out(name: &str, errors: &[impl Display], count: usize) -> Option<String> {
    errors.last().map(|last| {
        let left = errors.len();
        format!("{name}: {left} of {count} snapshots are left out; reason for the last: {last}\n")
    })
}

/// Analyses each snapshot. Strains are relative to the first; a single snapshot has none. Snapshots of which a margin leaves
/// nothing are skipped, except the last.
///
/// # Errors
/// See [`PostError`]; with the file.
pub fn reports(snapshots: &[Snapshot], choice: &Choice) -> Result<Analysed, PostError> {
    let mut reports: Vec<Report> = Vec::new();
    let (mut picture, mut earlier) = (Picture::default(), Vec::new());
    let mut is_anybody_there = false;
    let mut left = Vec::new();
    let last = snapshots.last().map(|snapshot| &snapshot.path);
    for (number, Snapshot { path, .. }) in snapshots.iter().enumerate() {
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
                // The layer was taken off the box of the whole packing, so its warnings are those of the whole.
                let packing = analysis.report.packing_m.as_ref();
                analysis.report.doubts = doubts(reader.header(), &Region::Whole, packing);
            }
            Ok(analysis)
        };
        match analysed() {
            Ok(analysis) => {
                picture = analysis.picture;
                // The first, and the first from the middle on.
                let is_due = number >= earlier.len() * snapshots.len() / 2;
                if is_due && earlier.len() < 2 && Some(path) != last {
                    let Report { summary, bounds_m, .. } = &analysis.report;
                    let time = format!("{} s", readable(summary.time_s));
                    earlier.push((time, picture.clone(), *bounds_m));
                }
                reports.push(analysis.report);
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
    // The newest snapshot is shown first, so it must not be empty.
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
    Ok(Analysed { reports, picture, earlier, left_out })
}
