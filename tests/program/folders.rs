//! Folders and files of runs: files of other origin stay, losses are reported, and printed commands work.

use super::process::{Call, Ended, Launch, dem_mpi, dem_post, signal};
use super::{OVER_AT_ONCE, fresh_directory, scene, snapshot, written};
use dem_mpi::output::snapshot::Reader;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::time::Duration;

const FAILED: i32 = 1;
const WRONG: i32 = 2;
const STOPPED: i32 = 3;

const MPI: &str = env!("CARGO_BIN_EXE_dem-mpi");
const POST: &str = env!("CARGO_BIN_EXE_dem-post");
const CONTACT: &str = env!("CARGO_BIN_EXE_dem-contact");

/// Runs a few steps of the heap into a folder, with more arguments.
fn few_steps(out: &Path, arguments: &[&str]) -> Ended {
    let words = [&*scene("heap"), "--steps", "20", "--out", out.to_str().unwrap()];
    dem_mpi(Launch::Alone, [&words[..], arguments].concat()).end()
}

fn sh(script: &str) -> Call {
    Call::new(vec![], "sh", ["-c", script])
}

fn status(ended: &Ended, expected: i32) {
    assert_eq!(ended.status.code(), Some(expected), "{ended}");
}

#[test]
fn files_of_others_stay() {
    let folder = fresh_directory("foreign");
    let names = [
        "history.csv",
        "performance.csv",
        "report.json",
        "particles.vtkhdf.series",
        "contacts.vtkhdf.series",
        "last.vtkhdf",
    ];
    for name in names {
        let out = folder.join(name);
        fs::create_dir(&out).unwrap();
        let file = out.join(name);
        let mine = "a table,of,somebody else\n1,2,3\n";
        fs::write(&file, mine).unwrap();
        fs::write(out.join(".lock"), mine).unwrap();
        let refused = few_steps(&out, &[]);
        status(&refused, WRONG);
        refused.said_once(&format!("{} is not from a run", file.display()));
        assert_eq!(fs::read_to_string(&file).unwrap(), mine, "{name}");
        status(&few_steps(&out, &["--overwrite"]), 0);
        assert_ne!(fs::read(&file).unwrap(), mine.as_bytes(), "{name}");
        assert_eq!(fs::read_to_string(out.join(".lock")).unwrap(), mine);
    }
    // Files of an earlier run are replaced.
    let out = folder.join("again");
    status(&few_steps(&out, &[]), 0);
    fs::remove_file(out.join("last.vtkhdf")).unwrap();
    for step in [0, 20] {
        fs::remove_file(snapshot(&out, step)).unwrap();
    }
    status(&few_steps(&out, &[]), 0);
}

#[test]
fn links_are_not_followed() {
    let out = fresh_directory("linked_names");
    let names = [
        ".history.csv.partial",
        ".particles_000000000.vtkhdf.partial",
        ".contacts_000000020.vtkhdf.partial",
        ".particles.vtkhdf.series.partial",
        ".report.json.partial",
        ".performance.csv.partial",
    ];
    let target = out.join("target");
    fs::write(&target, "of somebody else").unwrap();
    for name in names {
        symlink(&target, out.join(name)).unwrap();
    }
    status(&few_steps(&out, &[]), 0);
    assert_eq!(fs::read_to_string(&target).unwrap(), "of somebody else");
    Reader::open(&snapshot(&out, 0)).unwrap().verify().unwrap();
    fs::create_dir(out.join("post")).unwrap();
    for name in ["index.html", "report.json", "report.csv"] {
        symlink(&target, out.join("post").join(name)).unwrap();
    }
    dem_post([&out]).succeed();
    assert_eq!(fs::read_to_string(&target).unwrap(), "of somebody else");
    // The lock file of a run must not be a link, either.
    let other = fresh_directory("linked_lock");
    symlink(&target, other.join(".lock")).unwrap();
    assert_ne!(few_steps(&other, &[]).status.code(), Some(0));
    assert_eq!(fs::read_to_string(&target).unwrap(), "of somebody else");
}

#[test]
fn overwrite_removes_what_a_run_wrote_and_nothing_else() {
    let out = fresh_directory("overwritten");
    status(&few_steps(&out, &[]), 0);
    let theirs =
        ["particles_1.vtkhdf", "particles_+1.vtkhdf", "contacts_7.vtkhdf", "left_over.csv"];
    for name in theirs {
        fs::write(out.join(name), "of somebody else").unwrap();
    }
    fs::create_dir(out.join("particles_000000009.vtkhdf")).unwrap();
    fs::write(out.join("left_below.csv"), "step,time_s,id,shape\n1,1,1,ball\n").unwrap();
    dem_post([&out]).succeed();
    let again = few_steps(&out, &["--overwrite"]);
    status(&again, 0);
    again.said_once("post is of the run before");
    for name in theirs {
        assert_eq!(fs::read_to_string(out.join(name)).unwrap(), "of somebody else", "{name}");
    }
    assert!(!out.join("left_below.csv").exists());
}

/// A run whose table was removed ends with an error.
#[test]
fn a_folder_that_is_removed_is_told() {
    let out = fresh_directory("removed");
    let every = ["time.steps=1_000_000_000", "output.snapshot_every=1000"];
    let words =
        [&*scene("heap"), "--out", out.to_str().unwrap(), "--set", every[0], "--set", every[1]];
    let mut running = dem_mpi(Launch::Alone, words).start();
    let first = snapshot(&out, 1000);
    running.until("a snapshot", || first.exists());
    // The folder is removed between two writes.
    std::thread::sleep(Duration::from_millis(60));
    fs::remove_dir_all(&out).or_else(|_| fs::remove_dir_all(&out)).unwrap();
    let ended = running.end();
    status(&ended, FAILED);
    ended.said_once("history.csv: it was removed or replaced during the run");
    // The state survives in a last snapshot.
    Reader::open(&out).unwrap().verify().unwrap();
}

#[test]
fn a_page_does_not_replace_what_a_run_wrote() {
    let out = fresh_directory("page");
    status(&few_steps(&out, &[]), 0);
    let before = fs::read(out.join("report.json")).unwrap();
    let refused = dem_post(["--out".as_ref(), out.as_os_str(), out.as_os_str()]).end();
    status(&refused, WRONG);
    refused.said_once("is the folder of a run");
    assert_eq!(fs::read(out.join("report.json")).unwrap(), before);
    dem_post([&out, &out]).succeed().said_once("is named twice, and counts once");
}

#[test]
fn a_diff_knows_both_files() {
    let [a, b] = ["diff_a", "diff_b"].map(fresh_directory);
    for out in [&a, &b] {
        let words = [&*scene("heap"), "--steps", "700", "--out", out.to_str().unwrap()];
        dem_mpi(Launch::Alone, words).succeed();
    }
    let compare = || dem_post(["--diff".as_ref(), a.as_os_str(), b.as_os_str()]).end();
    let equal = compare();
    status(&equal, 0);
    equal.said_once("equal bit for bit");
    let contacts = b.join("contacts_000000700.vtkhdf");
    let whole = fs::read(&contacts).unwrap();
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 1;
    let of_another = fs::read(b.join("contacts_000000000.vtkhdf")).unwrap();
    for other in [&whole[..whole.len() / 2], &flipped, &of_another, &[]] {
        fs::write(&contacts, other).unwrap();
        let unknown = compare();
        status(&unknown, WRONG);
        unknown.said_once("contacts files were not compared");
        assert!(!unknown.output.contains("equal bit for bit"), "{unknown}");
    }
    fs::remove_file(&contacts).unwrap();
    status(&compare(), WRONG);
}

/// The command printed after "to continue:" is quoted for any name of the scene.
#[test]
fn a_command_to_go_on_is_quoted() {
    let folder = fresh_directory("quoted");
    let heap = fs::read_to_string(scene("heap")).unwrap();
    for (k, name) in
        ["a b;touch HACK.toml", "-x.toml", "it's $(touch HACK).toml"].iter().enumerate()
    {
        fs::write(folder.join(name), &heap).unwrap();
        let given = if name.starts_with('-') { format!("./{name}") } else { (*name).to_owned() };
        let out = format!("out {k}");
        let words = [&*given, "--out", &out, "--set", "time.steps=1_000_000_000"];
        let mut running = dem_mpi(Launch::Alone, words).from(&folder).start();
        let first = folder.join(&out).join("particles_000000000.vtkhdf");
        running.until("a snapshot", || first.exists());
        signal(running.id(), "TERM");
        let ended = running.end();
        status(&ended, STOPPED);
        let command =
            ended.errors.lines().find_map(|line| line.split_once("to continue: dem-mpi "));
        let (_, command) = command.unwrap_or_else(|| panic!("{ended}"));
        let said = sh(&format!("printf '%s\\n' {command}")).from(&folder).succeed();
        assert_eq!(said.output.lines().next(), Some(&*given), "{ended}");
        let go_on = sh(&format!("'{MPI}' {command} --check")).from(&folder).end();
        status(&go_on, 0);
    }
    assert!(!folder.join("HACK").exists() && !folder.join("HACK.toml").exists());
}

#[test]
fn who_cannot_print_says_so() {
    let out = fresh_directory("unprinted");
    status(&few_steps(&out, &[]), 0);
    let (out, heap) = (out.display(), scene("heap"));
    let other = fresh_directory("unprinted_run");
    let other = other.display();
    for command in [
        format!("{MPI} --schema"),
        format!("{MPI} --keys"),
        format!("{MPI} --help"),
        format!("{MPI} --version"),
        format!("{MPI} --man"),
        format!("{MPI} --completion bash"),
        format!("{MPI} {heap} --plan"),
        format!("{MPI} {heap} --check"),
        format!("{MPI} {heap} --steps 5 --out {other}"),
        format!("{MPI} {heap} --steps 5 --out {other}/traced --trace-particle 3"),
        format!("{POST} --python"),
        format!("{POST} --help"),
        format!("{POST} --man"),
        format!("{POST} {out}"),
        format!("{POST} --diff {out} {out}"),
        format!("{CONTACT} --help"),
        format!("{CONTACT} --version"),
        format!("{CONTACT} --man"),
    ] {
        let ended = sh(&format!("{command} > /dev/full")).end();
        assert!(ended.status.code().is_some_and(|code| code > 0), "{ended}");
        ended.said_once("No space left on device");
    }
}

/// A file beyond the size limit raises a signal that would end the program without a message.
#[test]
fn a_file_beyond_the_limit_is_told() {
    let out = fresh_directory("limited");
    let (heap, place) = (scene("heap"), out.display());
    let command =
        format!("ulimit -f 100; '{MPI}' '{heap}' --out '{place}' --set output.snapshot_every=10");
    let ended = sh(&command).end();
    status(&ended, FAILED);
    ended.said_once("cannot write ");
    assert!(ended.errors.contains("File too large"), "{ended}");
    let left = fs::read_dir(&out).unwrap().map(|entry| entry.unwrap().file_name());
    let partial = left.filter(|name| name.to_string_lossy().ends_with(".partial")).count();
    assert_eq!(partial, 0, "{ended}");
}

#[test]
fn a_terminal_that_closes_leaves_a_snapshot() {
    let endless = "time.steps=1_000_000_000";
    for name in ["HUP", "USR2"] {
        let out = fresh_directory(&format!("signalled_{name}"));
        let words = [&*scene("heap"), "--out", out.to_str().unwrap(), "--set", endless];
        let mut running = dem_mpi(Launch::Alone, words).start();
        let first = snapshot(&out, 0);
        running.until("a snapshot", || first.exists());
        signal(running.id(), name);
        let ended = running.end();
        status(&ended, STOPPED);
        ended.said_once(&format!("stopped by SIG{name}"));
    }
    // Under nohup a run continues after its terminal closes.
    let out = fresh_directory("signalled_nohup");
    let (heap, place) = (scene("heap"), out.display());
    let command = format!("trap '' HUP; exec '{MPI}' '{heap}' --out '{place}' --set {endless}");
    let mut running = sh(&command).start();
    let first = snapshot(&out, 0);
    running.until("a snapshot", || first.exists());
    signal(running.id(), "HUP");
    std::thread::sleep(Duration::from_millis(600));
    signal(running.id(), "TERM");
    running.end().said_once("stopped by SIGTERM");
}

/// A stage that its `[stop]` has ended continues for the requested number of steps.
#[test]
fn steps_beyond_a_stop_are_done() {
    let folder = fresh_directory("beyond_stop");
    written(&folder, OVER_AT_ONCE);
    let run = |more: &[&str]| {
        let words = [&["scene.toml"], more].concat();
        dem_mpi(Launch::Alone, words).from(&folder).succeed()
    };
    run(&[]).said_once("[stop] reached: 50 steps");
    run(&["--start", "out"]).said_once("nothing left to do");
    run(&["--start", "out", "--steps", "250"]).said_once("all steps done: 250 steps");
    assert_eq!(Reader::open(&folder.join("out")).unwrap().header().step, 300);
}

#[test]
fn a_run_goes_on_where_it_is_told_to() {
    let folder = fresh_directory("elsewhere");
    let words = [&*scene("heap"), "--out", "kept", "--steps", "20"];
    dem_mpi(Launch::Alone, words).from(&folder).succeed();
    let set = "output.directory=of_scene";
    let text = fs::read_to_string(scene("heap")).unwrap();
    assert!(text.contains("[output]"), "the heap has a folder of its own");
    let go_on = [&*scene("heap"), "--start", "kept", "--steps", "20"];
    let refused = dem_mpi(Launch::Alone, go_on).from(&folder).end();
    status(&refused, WRONG);
    refused.said_once("Add --out kept to continue in the folder of the snapshot");
    let made = fs::read_dir(&folder).unwrap().count();
    assert_eq!(made, 1, "nothing was written");
    for named in [["--out", "kept"], ["--set", set]] {
        let words = [&go_on[..], &named].concat();
        dem_mpi(Launch::Alone, words).from(&folder).succeed();
    }
    assert!(folder.join("of_scene/history.csv").exists());
}
