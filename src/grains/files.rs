//! Opening of files: writing follows no link, and only regular files are read.
//!
//! Others may write to a folder, and a file may come from somebody else. With an ordinary open, a link under the name of a new file would
//! redirect the writer, and a named pipe would block the reader for ever.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Read as _, Write as _};
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

/// Opens a regular file for reading.
///
/// # Errors
/// If the system reports one, or for a pipe, a device or a folder.
pub fn open(path: &Path) -> io::Result<File> {
    // Non-blocking, so that it does not wait for the writer of a pipe.
    regular(File::options().read(true).custom_flags(libc::O_NONBLOCK).open(path)?)
}

/// Reads all bytes of a regular file.
///
/// # Errors
/// See [`open`].
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads the text of a regular file.
///
/// # Errors
/// See [`open`]; also if the text is not UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    io::read_to_string(open(path)?)
}

/// Opens a file to hold it, and creates it if it is missing, without changing its content.
///
/// # Errors
/// If the system reports one, or for a link, a pipe, a device or a folder.
pub fn hold(path: &Path) -> io::Result<File> {
    let flags = libc::O_NOFOLLOW | libc::O_NONBLOCK;
    let mut how = File::options();
    regular(how.write(true).create(true).truncate(false).custom_flags(flags).open(path)?)
}

fn regular(file: File) -> io::Result<File> {
    if file.metadata()?.is_file() {
        Ok(file)
    } else {
        Err(io::Error::other("it is not a regular file"))
    }
}

/// Creates a file in place of an existing one; an existing link is itself removed.
///
/// # Errors
/// If the system reports one.
pub fn create(path: &Path) -> io::Result<File> {
    remove_if_there(path)?;
    File::options().write(true).create_new(true).open(path)
}

/// Removes a file, if it exists.
///
/// # Errors
/// If the system reports one.
pub fn remove_if_there(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}

/// Name of a file until it is complete: `.NAME.partial`.
pub fn partial(path: &Path) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".partial");
    path.with_file_name(name)
}

/// Replaces a file atomically by a new one that is already on the disk. After an error the old file is unchanged.
///
/// # Errors
/// If the system or `write` reports one.
pub fn replace(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<File> {
    let partial = partial(path);
    let written = create(&partial).and_then(|file| {
        let mut file = BufWriter::new(file);
        write(&mut file)?;
        file.flush()?;
        let file = file.into_inner()?;
        file.sync_all()?;
        fs::rename(&partial, path)?;
        Ok(file)
    });
    if written.is_err() {
        // Frees disk space; the first error is the one to report.
        let _ = fs::remove_file(&partial);
    }
    written
}

/// Whether an open file still exists under its name.
///
/// # Errors
/// If the system reports one for the open file.
pub fn is_there(path: &Path, file: &File) -> io::Result<bool> {
    let open = file.metadata()?;
    let same = |named: fs::Metadata| (named.dev(), named.ino()) == (open.dev(), open.ino());
    Ok(fs::symlink_metadata(path).is_ok_and(same))
}
