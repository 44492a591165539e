//! Files in folders that other users can write to.

use dem_mpi::files::{create, hold, is_there, open, read_to_string, replace};
use std::fs;
use std::io::Write as _;
use std::os::unix::fs::symlink;

/// In a folder that other users can write to, the name of an output file may be a link to anything.
#[test]
fn what_a_link_leads_to_stays_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let [target, name, partial] =
        ["target", "report.json", ".report.json.partial"].map(|name| folder.path().join(name));
    let reset = || {
        fs::write(&target, "of somebody else").unwrap();
        for link in [&name, &partial] {
            let _ = fs::remove_file(link);
            symlink(&target, link).unwrap();
        }
    };
    reset();
    replace(&name, |file| file.write_all(b"new")).unwrap();
    assert_eq!(read_to_string(&name).unwrap(), "new");
    reset();
    create(&name).unwrap().write_all(b"new").unwrap();
    assert_eq!(read_to_string(&name).unwrap(), "new");
    reset();
    assert!(hold(&name).is_err());
    assert_eq!(read_to_string(&target).unwrap(), "of somebody else");
    assert!(hold(&target).is_ok(), "held as it is");
    assert_eq!(read_to_string(&target).unwrap(), "of somebody else");
}

#[test]
fn what_fails_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.csv");
    let file = replace(&path, |file| file.write_all(b"old")).unwrap();
    assert!(is_there(&path, &file).unwrap());
    replace(&path, |_| Err(std::io::Error::other("full"))).unwrap_err();
    assert_eq!(read_to_string(&path).unwrap(), "old");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    fs::remove_file(&path).unwrap();
    assert!(!is_there(&path, &file).unwrap());
    fs::write(&path, "another").unwrap();
    assert!(!is_there(&path, &file).unwrap());
}

#[test]
fn a_pipe_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    assert!(made.success());
    for error in [open(&pipe).unwrap_err(), hold(&pipe).unwrap_err()] {
        assert!(!error.to_string().is_empty());
    }
    assert!(open(folder.path()).unwrap_err().to_string().contains("not a regular file"));
}
