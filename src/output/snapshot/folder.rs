//! Folder of a run's snapshots: file names, lists, the link to the newest, and protection against other runs.

use super::{LAST, Reader, contacts_name, particles_name};
use crate::comm::{Comm, agree};
use crate::files;
use crate::output::header::Header;
use crate::output::{SnapshotError, name_of, on_root, series};
use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

/// List of the particles files of a directory with their times, for ParaView.
pub const PARTICLES_LIST: &str = "particles.vtkhdf.series";

/// List of the contacts files of a directory with their times, for ParaView.
pub const CONTACTS_LIST: &str = "contacts.vtkhdf.series";

/// Lists all snapshots of the directory for ParaView, including the one of this header.
pub(super) fn list_with_times(directory: &Path, header: &Header) -> io::Result<()> {
    let known = series::times(&directory.join(PARTICLES_LIST));
    let time_of = |step: u64, path: &Path| match known.get(&particles_name(step)) {
        _ if step == header.step => Some(header.time),
        Some(time) => Some(*time),
        // The list was lost. A damaged snapshot is not listed.
        None => Reader::open(path).ok().map(|reader| reader.header().time),
    };
    let mut steps = steps_in(directory);
    steps.sort();
    let timed: Vec<(u64, f64)> =
        steps.iter().filter_map(|(step, path)| Some((*step, time_of(*step, path)?))).collect();
    for (list, name) in
        [(PARTICLES_LIST, particles_name as fn(u64) -> String), (CONTACTS_LIST, contacts_name)]
    {
        let files = timed.iter().map(|&(step, time)| (name(step), time)).collect();
        series::write(directory, list, files)?;
    }
    Ok(())
}

/// Reserves a directory for one run. No snapshot in it may be later than the step at which the run begins. Earlier ones are
/// allowed only if the run continues from one of them. Files that no run wrote are not replaced. Collective.
///
/// - `remove`: later snapshots are removed, and so are other outputs of an earlier run.
/// - `start`: snapshot or directory from which the same stage continues. If it is the directory itself, later snapshots were
///   skipped as damaged, and stay.
/// - `before`: the previous stage, if this stage begins from it.
///
/// # Errors
/// On all ranks: [`SnapshotError::Later`], [`SnapshotError::StageBefore`], [`SnapshotError::Foreign`], or rank 0 cannot remove
/// files.
pub fn none_later(
    directory: &Path,
    step: u64,
    remove: bool,
    start: Option<&Path>,
    before: Option<&Path>,
    comm: &mut dyn Comm,
) -> Result<(), SnapshotError> {
    let [here, start, before] =
        [Some(directory), start, before].map(|path| path?.canonicalize().ok());
    let is_in_here =
        |path: &Option<PathBuf>| path.as_deref().and_then(Path::parent) == here.as_deref();
    let is_one_of_them = is_in_here(&start);
    // Snapshots of the previous stage are kept, so that this stage can be run again.
    let follows_them = before == here || is_in_here(&before);
    let mut later = Vec::new();
    // Only rank 0 reads the directory: other ranks may see changes late.
    if comm.is_root() && start != here {
        later = steps_in(directory);
        let is_strange = !is_one_of_them && if remove { !follows_them } else { step > 0 };
        later.retain(|(of, _)| *of > step || is_strange);
    }
    if remove {
        return on_root(directory, comm, || {
            for (step, path) in &later {
                fs::remove_file(path)?;
                files::remove_if_there(&directory.join(contacts_name(*step)))?;
            }
            if !later.is_empty() {
                files::remove_if_there(&directory.join(LAST))?;
            }
            if start.is_none() { remove_lists(directory) } else { Ok(()) }
        });
    }
    let path = name_of(directory);
    let found = later.iter().map(|(step, _)| *step).max().map(|newest| {
        if follows_them && newest <= step {
            SnapshotError::StageBefore { path }
        } else {
            SnapshotError::Later { path, step, newest }
        }
    });
    agree(comm, found.map_or(Ok(()), Err))?;
    let goes_on_here = is_one_of_them || start == here;
    let foreign = if comm.is_root() && !goes_on_here { foreign(directory) } else { None };
    let error = |path: PathBuf| Err(SnapshotError::Foreign { path: name_of(&path) });
    agree(comm, foreign.map_or(Ok(()), error))
}

/// A file of the directory that no run wrote, although it has the name of an output file.
fn foreign(directory: &Path) -> Option<PathBuf> {
    const BEGINNINGS: [(&str, &str); 5] = [
        ("history.csv", "step,"),
        ("performance.csv", "ranks,"),
        ("report.json", "{\n  \"program\": \"dem-mpi"),
        (PARTICLES_LIST, "{\n  \"file-series-version\""),
        (CONTACTS_LIST, "{\n  \"file-series-version\""),
    ];
    let strange = BEGINNINGS.iter().find(|(name, beginning)| {
        let path = directory.join(name);
        path.symlink_metadata().is_ok() && !begins_with(&path, beginning)
    });
    let last = directory.join(LAST);
    // In a copy of a folder, a copy of the newest snapshot replaces the link.
    let is_kept = last.symlink_metadata().is_ok_and(|last| !last.is_symlink());
    strange.map(|(name, _)| directory.join(name)).or_else(|| is_kept.then_some(last))
}

/// True if a file is empty or begins with this text.
fn begins_with(path: &Path, text: &str) -> bool {
    let mut beginning = Vec::new();
    let file = files::open(path);
    let read = file.and_then(|file| file.take(text.len() as u64).read_to_end(&mut beginning));
    read.is_ok() && (beginning.is_empty() || beginning == text.as_bytes())
}

/// Removes the lists, tables and reports of an earlier run, which would be mistaken for those of this one.
fn remove_lists(directory: &Path) -> io::Result<()> {
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let is_list = (name.starts_with("entered_") || name.starts_with("left_"))
            && path.extension().is_some_and(|ending| ending == "csv")
            && begins_with(&path, "step,time_s,id,");
        if is_list || ["report.json", "performance.csv", "history.csv"].contains(&name) {
            files::remove_if_there(&path)?;
        }
    }
    Ok(())
}

/// Points [`LAST`] to a file of the same directory.
pub(super) fn link_last(directory: &Path, name: &str) -> io::Result<()> {
    let new = files::partial(&directory.join(LAST));
    files::remove_if_there(&new)?;
    std::os::unix::fs::symlink(name, &new)?;
    fs::rename(&new, directory.join(LAST))?;
    File::open(directory)?.sync_all()
}

/// Particles files of a directory from which a run may continue, the newest first: that of [`LAST`], then those of earlier steps.
/// Files of later steps, left by a run that went back to an earlier snapshot, are not included.
pub(super) fn candidates(directory: &Path) -> Vec<PathBuf> {
    let last = directory.join(LAST);
    let linked = fs::read_link(&last).ok();
    let newest = linked.as_deref().and_then(step_of).unwrap_or(u64::MAX);
    let mut steps = steps_in(directory);
    steps.retain(|(step, _)| *step < newest);
    steps.sort_unstable_by(|x, y| y.cmp(x));
    // The link may be missing, dangling, or replaced by a copy of the file.
    let first = last.symlink_metadata().is_ok().then_some(last);
    first.into_iter().chain(steps.into_iter().map(|(_, path)| path)).collect()
}

/// Particles files of a directory and their steps, in any order.
fn steps_in(directory: &Path) -> Vec<(u64, PathBuf)> {
    let entries = fs::read_dir(directory).into_iter().flatten();
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let steps = paths.filter_map(|path| step_of(&path).map(|step| (step, path)));
    steps.filter(|(_, path)| !path.is_dir()).collect()
}

/// Step of a particles file from its name, if a run gives such names.
pub fn step_of(path: &Path) -> Option<u64> {
    let name = path.file_name()?.to_str()?;
    let step = name.strip_prefix("particles_")?.strip_suffix(".vtkhdf")?.parse().ok()?;
    (particles_name(step) == name).then_some(step)
}
