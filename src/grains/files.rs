//! Files by their names: a file that is written follows no link, and only a regular file is read.
//!
//! A folder may be one that others write to, and a file one that somebody has sent. Opened like any file, a link under the name
//! of a new one leads the writer elsewhere, and a named pipe makes the reader wait for ever.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Read as _, Write as _};
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::{Path, PathBuf};

/// Opens a regular file to be read.
///
/// # Errors
/// What the system says, or that it is a pipe, a device or a folder.
pub fn open(path: &Path) -> io::Result<File> {
    // Without waiting for whoever writes to a pipe.
    regular(File::options().read(true).custom_flags(libc::O_NONBLOCK).open(path)?)
}

/// All bytes of a regular file.
///
/// # Errors
/// As [`open`].
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The text of a regular file.
///
/// # Errors
/// As [`open`], or it is not UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    io::read_to_string(open(path)?)
}

/// Opens a file to hold it, made if it is missing, and changes nothing in it.
///
/// # Errors
/// What the system says, or that it is a link, a pipe, a device or a folder.
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

/// Creates a file in place of what has its name; of a link, the link goes.
///
/// # Errors
/// What the system says.
pub fn create(path: &Path) -> io::Result<File> {
    remove_if_there(path)?;
    File::options().write(true).create_new(true).open(path)
}

/// Removes a file; one that is not there is gone already.
///
/// # Errors
/// What the system says.
pub fn remove_if_there(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
        _ => Ok(()),
    }
}

/// The name under which a file is written until it is whole: `.NAME.partial`.
pub fn partial(path: &Path) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".partial");
    path.with_file_name(name)
}

/// Replaces a file at once by a new one, which is on the disk by then. What fails leaves the old one.
///
/// # Errors
/// What the system says, or `write`.
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
        // Room for others; the first error is the one to report.
        let _ = fs::remove_file(&partial);
    }
    written
}

/// Does an open file still stand under its name?
///
/// # Errors
/// What the system says of the open file.
pub fn is_there(path: &Path, file: &File) -> io::Result<bool> {
    let open = file.metadata()?;
    let same = |named: fs::Metadata| (named.dev(), named.ino()) == (open.dev(), open.ino());
    Ok(fs::symlink_metadata(path).is_ok_and(same))
}
