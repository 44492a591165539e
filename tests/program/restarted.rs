//! A stopped and continued run ends with the result of an uninterrupted run.

use super::process::{Ended, Launch, dem_mpi};
use super::{
    HEAP_STEPS, OVER_AT_ONCE, assert_same_result, column, finished, fresh_directory, heap, history,
    scene, snapshot, written,
};
use dem_mpi::contact::StateColumn;
use dem_mpi::math::Vec3;
use dem_mpi::output::snapshot::Reader;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Call of the heap in this directory, with more arguments.
fn heap_in(directory: &Path, launch: Launch, more: &[&str]) -> super::process::Call {
    let out = directory.to_str().expect("a path in UTF-8");
    dem_mpi(launch, [&[&*scene("heap"), "--out", out], more].concat())
}

/// Three parts of a run, on two ranks, three ranks and alone. The first ends in the middle of the rain, and between two rows of the history.
#[test]
fn legs_on_different_numbers_of_ranks_make_one_run() {
    let whole = heap(Launch::Alone);
    let directory = fresh_directory("legs");
    let start = ["--start", directory.to_str().unwrap()];

    heap_in(&directory, Launch::Ranks(2), &["--steps", "610"]).succeed();
    let particles = column(&directory, "particles");
    assert_eq!(particles.last_key_value().unwrap().0, &610);
    let all = column(&whole.directory, "particles")[&HEAP_STEPS];
    assert!(particles[&610] < all, "the rain is over: {particles:?}");

    heap_in(&directory, Launch::Ranks(3), &[&start[..], &["--steps", "890"]].concat()).succeed();
    assert!(snapshot(&directory, 1500).exists());
    heap_in(&directory, Launch::Alone, &start).succeed();
    assert_same_result(&whole.directory, &directory);
}

/// A check and a plan report a state that does not fit the scene, too.
#[test]
fn a_plan_sees_whether_a_snapshot_fits() {
    let whole = heap(Launch::Alone);
    let start = whole.directory.to_str().unwrap();
    let other = ["--set", "domain.periodic=[true, false, false]", "--set", "domain.walls=['-z']"];
    for word in ["--plan", "--check"] {
        let words = [&*scene("heap"), word, "--start", start];
        dem_mpi(Launch::Alone, words).succeed();
        let ended = dem_mpi(Launch::Alone, [&words[..], &other].concat()).end();
        assert_eq!(ended.status.code(), Some(2), "{ended}");
        ended.said_once("differ from the scene's [domain]");
    }
}

/// A restart from an earlier snapshot of a longer run writes all later output again.
#[test]
fn an_earlier_snapshot_continues_on_any_number_of_ranks() {
    let whole = heap(Launch::Alone);
    let directory = fresh_directory("earlier");
    heap_in(&directory, Launch::Ranks(2), &["--steps", "2200"]).succeed();
    for launch in [Launch::Ranks(3), Launch::Ranks(1), Launch::Alone] {
        let middle = snapshot(&directory, 1000);
        let start = ["--start", middle.to_str().unwrap()];
        let refused = heap_in(&directory, launch, &start).end();
        assert_eq!(refused.status.code(), Some(2), "{refused}");
        refused.said_once("but this run begins at step 1000");
        let ended = heap_in(&directory, launch, &[&start[..], &["--overwrite"]].concat()).succeed();
        ended.said_once("steps 1000 to 3000");
        assert_same_result(&whole.directory, &directory);
        fs::remove_file(snapshot(&directory, HEAP_STEPS)).unwrap();
    }
}

/// A used directory holds one run, and nothing of it is lost without an explicit request.
#[test]
fn a_used_directory_is_refused() {
    let directory = fresh_directory("used");
    let fresh = ["--set", "output.snapshot_every=100", "--steps"];
    heap_in(&directory, Launch::Alone, &[&fresh[..], &["300"]].concat()).succeed();
    let before = history(&directory);
    let again = [&fresh[..], &["150"]].concat();
    let refused = heap_in(&directory, Launch::Ranks(2), &again).end();
    assert_eq!(refused.status.code(), Some(2), "{refused}");
    refused.said_once("has snapshots up to step 300, but this run begins at step 0");
    assert_eq!(history(&directory), before);
    assert!(snapshot(&directory, 300).exists());

    heap_in(&directory, Launch::Ranks(2), &[&again[..], &["--overwrite"]].concat()).succeed();
    let there = [0, 100, 150, 200, 300].map(|step| snapshot(&directory, step).exists());
    assert_eq!(there, [true, true, true, false, false]);

    // Without intermediate snapshots the start and the end stay.
    let only_the_last = ["--set", "output.snapshot_every=0", "--steps", "150", "--overwrite"];
    heap_in(&directory, Launch::Alone, &only_the_last).succeed();
    let there = [0, 100, 150].map(|step| snapshot(&directory, step).exists());
    assert_eq!(there, [true, false, true]);
}

/// Written rows of the history stay, even if fewer are requested later.
#[test]
fn a_coarser_history_loses_nothing() {
    let directory = fresh_directory("coarser");
    let start = ["--start", directory.to_str().unwrap(), "--steps", "30", "--set"];
    heap_in(&directory, Launch::Alone, &["--steps", "30", "--set", "output.history_every=10"])
        .succeed();
    heap_in(&directory, Launch::Alone, &[&start[..], &["output.history_every=1000"]].concat())
        .succeed();
    let steps: Vec<u64> = column(&directory, "particles").into_keys().collect();
    assert_eq!(steps, [0, 10, 20, 60]);
}

/// A directory with an earlier stage keeps the table of that stage.
#[test]
fn a_stage_does_not_write_over_the_one_before() {
    let directory = fresh_directory("over");
    dem_mpi(Launch::Alone, [&scene("heap"), "--steps", "1500"]).from(&directory).succeed();
    let before = history(&directory.join("heap"));
    let refused =
        dem_mpi(Launch::Alone, [&scene("tilted"), "--out", "heap"]).from(&directory).end();
    assert_eq!(refused.status.code(), Some(2), "{refused}");
    refused.said_once("heap is the folder of the stage in `start`");
    assert_eq!(history(&directory.join("heap")), before);

    // The stage may not overwrite its own start, even with permission.
    let over = ["--out", "heap", "--overwrite", "--steps", "100"];
    let tilted = scene("tilted");
    let words = [&[&*tilted], &over[..]].concat();
    dem_mpi(Launch::Alone, words).from(&directory).succeed();
    let there = [1000, 1500, 1600].map(|step| snapshot(&directory.join("heap"), step).exists());
    assert_eq!(there, [true, true, true]);
}

/// Identical periods with another origin of the domain: particles are wrapped into the new domain.
#[test]
fn a_periodic_domain_may_begin_elsewhere() {
    let whole = finished("periodic", Launch::Alone);
    let start = ["--start", whole.directory.to_str().unwrap(), "--steps", "200"];
    let set = ["--set", "domain.low=[-0.019, -0.0225, -0.0215]", "--set"];
    let [alone, together] = [Launch::Alone, Launch::Ranks(3)].map(|launch| {
        let directory = fresh_directory(&format!("elsewhere_{launch:?}"));
        let out = ["--out", directory.to_str().unwrap()];
        let high = ["domain.high=[0.021, 0.0175, 0.0185]"];
        let periodic = [&*scene("periodic")];
        dem_mpi(launch, [&periodic[..], &start, &set, &high, &out].concat()).succeed();
        directory
    });
    assert_same_result(&alone, &together);
}

/// Walls are identified by their names, so another order keeps their contacts. A stage can continue without the previous one.
#[test]
fn walls_keep_their_contacts_in_any_order() {
    let directory = fresh_directory("reordered");
    let run = |arguments: &[&str]| {
        dem_mpi(Launch::Alone, arguments).from(&directory).succeed();
    };
    run(&[&scene("heap"), "--steps", "1500"]);
    let turned = "domain.walls=['+z', '-z', '+y', '-y', '+x', '-x']";
    let tilted = &*scene("tilted");
    let set = ["--set", turned, "--set", "output.snapshot_every=400"];
    run(&[&[tilted, "--steps", "400"], &set[..]].concat());

    let [before, after] = ["heap", "tilted"].map(|stage| {
        let reader = Reader::open(&snapshot(&directory.join(stage), 1500)).unwrap();
        let walls = &reader.header().walls;
        let histories = reader.contact_records(0..reader.contact_record_count()).unwrap();
        let (_, spring) = StateColumn::ranges(histories.columns())
            .find(|(column, _)| column.name == "spring")
            .unwrap();
        let of_walls = histories.iter().filter_map(|named| {
            let wall = named.b.wall_index()?;
            let spring = Vec3::from_column_slice(&named.state[spring.clone()]);
            Some(((named.a, walls[wall].name.clone()), spring))
        });
        of_walls.collect::<BTreeMap<_, _>>()
    });
    assert!(before.len() > 20 && before.values().any(|spring| spring.norm() > 1e-7), "{before:?}");
    assert!(before.keys().eq(after.keys()));
    for (name, spring) in &before {
        assert!((spring - after[name]).norm() <= 1e-9 * spring.norm(), "{name:?}");
    }

    fs::remove_dir_all(directory.join("heap")).unwrap();
    run(&[&[tilted, "--start", "tilted"], &set[..]].concat());
}

/// Particles of another density keep their velocity and angular velocity.
#[test]
fn a_stage_may_change_the_density() {
    let directory = fresh_directory("denser");
    let run = |arguments: &[&str]| {
        dem_mpi(Launch::Alone, arguments).from(&directory).succeed();
    };
    run(&[&scene("heap"), "--steps", "1500"]);
    run(&[&scene("tilted"), "--steps", "0", "--set", "material.stone.density=250_000"]);
    let [before, after] = ["heap", "tilted"].map(|stage| {
        let reader = Reader::open(&snapshot(&directory.join(stage), 1500)).unwrap();
        let table = reader.particles(0..reader.particle_count()).unwrap();
        let state = table.velocity.into_iter().zip(table.angular_velocity);
        table.id.into_iter().zip(state).collect::<BTreeMap<_, _>>()
    });
    assert!(before.keys().eq(after.keys()));
    assert!(before.values().any(|(_, turning)| turning.norm() > 1e-3), "{before:?}");
    for (id, (velocity, turning)) in &before {
        assert_eq!(*velocity, after[id].0, "{id}");
        assert!((turning - after[id].1).norm() <= 1e-12 * turning.norm(), "{id}");
    }
}

/// Friction that a scene adds within a stage is rejected for lack of springs; a new stage begins with none.
#[test]
fn what_a_law_remembers_must_be_there_to_go_on() {
    for (name, launch) in [("forgotten", Launch::Alone), ("forgotten_together", Launch::Ranks(2))] {
        let directory = fresh_directory(name);
        let run = |arguments: &[&str]| dem_mpi(launch, arguments).from(&directory).end();
        let heap = &*scene("heap");
        let smooth = "material.stone.friction=0";
        let ended = run(&[heap, "--steps", "900", "--set", smooth]);
        assert!(ended.status.success(), "{ended}");
        let ended = run(&[heap, "--start", "heap"]);
        assert_eq!(ended.status.code(), Some(2), "{ended}");
        ended.said_once("it has no `spring` of contacts, a state variable of the scene's law");
        let ended = run(&[&scene("tilted"), "--steps", "10"]);
        assert!(ended.status.success(), "{ended}");
        let ended = run(&[heap, "--start", "heap", "--set", smooth, "--steps", "10"]);
        assert!(ended.status.success(), "{ended}");
    }
}

/// A stage that starts from the end of another; the second is stopped and continued, too.
#[test]
fn stages_follow_each_other() {
    let chains = [
        ("stages_alone", Launch::Alone, Launch::Alone),
        ("stages_together", Launch::Ranks(2), Launch::Ranks(3)),
    ];
    let [alone, together] = chains.map(|(name, first, second)| {
        let directory = fresh_directory(name);
        // Scenes give output and `start` relative to the working directory.
        let run = |launch, arguments: &[&str]| {
            dem_mpi(launch, arguments).from(&directory).succeed();
        };
        run(first, &[&scene("heap"), "--steps", "1500"]);
        let tilted = &*scene("tilted");
        if second == Launch::Alone {
            run(second, &[tilted]);
        } else {
            run(second, &[tilted, "--steps", "300"]);
            run(first, &[tilted, "--start", "tilted"]);
        }
        directory
    });
    for stage in ["heap", "tilted"] {
        assert_same_result(&alone.join(stage), &together.join(stage));
    }
    let steps = column(&together.join("tilted"), "time_s");
    let (begin, end) = (steps.first_key_value().unwrap(), steps.last_key_value().unwrap());
    assert_eq!((begin.0, end.0), (&1500, &2300), "steps count on from stage to stage");
    assert!((end.1 - 0.023).abs() < 1e-12, "and so does time: {end:?}");
}

/// A scene's walls and its `start` are checked against the snapshot, also by --check. A stage cannot be restarted from the snapshot of the
/// previous stage.
#[test]
fn the_stage_before_is_told_from_this_one() {
    for launch in [Launch::Alone, Launch::Ranks(2)] {
        let directory = fresh_directory("before");
        let run = |arguments: &[&str]| dem_mpi(launch, arguments).from(&directory).end();
        let succeeds = |ended: &Ended| assert!(ended.status.success(), "{ended}");
        succeeds(&run(&[&scene("heap"), "--steps", "100"]));
        let tilted = &*scene("tilted");
        for start in ["heap", "heap/last.vtkhdf", "./heap/"] {
            let ended = run(&[tilted, "--start", start]);
            assert_eq!(ended.status.code(), Some(2), "{ended}");
            ended.said_once(&format!("--start {start}: this is the stage before"));
        }
        let narrower = ["--set", "domain.high=[0.055, 0.06, 0.06]"];
        let ended = run(&[&[tilted, "--steps", "1"], &narrower[..]].concat());
        succeeds(&ended);
        ended.said_once("walls are where the stage before ended");
        ended.said_once("+x by 5.0000e-3 m");
        ended.said_once("of the stable limit");

        succeeds(&run(&[tilted, "--check"]));
        std::fs::remove_file(directory.join("heap/last.vtkhdf")).unwrap();
        std::fs::write(directory.join("heap/last.vtkhdf"), "no snapshot").unwrap();
        let ended = run(&[tilted, "--check"]);
        assert_eq!(ended.status.code(), Some(2), "{ended}");
        ended.said_once("cannot be read as a snapshot");
    }
}

/// A finished run does not run again, and its message explains how to get more steps. Its status is success, because a job may be queued
/// again. A snapshot beyond the end of the stage is an error.
#[test]
fn nothing_is_left_to_do() {
    for launch in [Launch::Alone, Launch::Ranks(2)] {
        let whole = heap(launch);
        let start = ["--start", whole.directory.to_str().unwrap()];
        let elsewhere = fresh_directory("nothing_left");
        for (more, status) in [(&[][..], 0), (&["--set", "time.steps=2999"], 2)] {
            let ended = heap_in(&elsewhere, launch, &[&start[..], more].concat()).end();
            assert_eq!(ended.status.code(), Some(status), "{ended}");
            ended.said_once("nothing left to do: the snapshot is at step 3000");
            ended.said_once("--steps N");
            assert!(!elsewhere.join("history.csv").exists());
        }
    }
}

/// Exit status of a stage that has done its steps while its `[stop]` does not hold.
const UNMET: i32 = 4;

/// A stage that its `[stop]` has ended is complete at any number of steps, unless more are requested.
#[test]
fn a_stage_ended_by_stop_is_over() {
    for launch in [Launch::Alone, Launch::Ranks(2)] {
        let directory = fresh_directory("ended");
        let start = ["--start", directory.to_str().unwrap(), "--set"];
        // Every heap is below this limit once all rain has fallen; the check is every 100 steps.
        heap_in(&directory, launch, &["--set", "stop.rest=0.99"])
            .succeed()
            .said_once("[stop] reached");
        let (end, _) = column(&directory, "particles").pop_last().unwrap();
        assert!(end < HEAP_STEPS && end.is_multiple_of(100), "{end}");

        let again = heap_in(&directory, launch, &[&start[..], &["stop.rest=0.99"]].concat());
        again
            .succeed()
            .said_once(&format!("the stage ended at step {end} by its [stop]: rest = 0.99"));
        assert_eq!(column(&directory, "particles").pop_last().unwrap().0, end);
        let lower = heap_in(&directory, launch, &[&start[..], &["stop.rest=1e-15"]].concat());
        let ended = lower.end();
        assert_eq!(ended.status.code(), Some(UNMET), "{ended}");
        ended.said_once("all steps done");
        ended.said_once("[stop] was not reached: rest is");
        assert_eq!(column(&directory, "particles").pop_last().unwrap().0, HEAP_STEPS);
    }
}

/// A `[stop]` may hold only at the last step, which is between the regular checks. The stage is then complete for a job that is queued
/// again, too.
#[test]
fn a_stop_that_holds_at_the_last_step_ends_the_stage() {
    let directory = fresh_directory("ended_last");
    let scene = written(&directory, OVER_AT_ONCE);
    let run = |more: &[&str]| {
        dem_mpi(Launch::Alone, [&[&*scene], more].concat()).from(&directory).succeed()
    };
    run(&["--steps", "20"]).said_once("all steps done: 20 steps");
    run(&["--start", "out"]).said_once("[stop] reached: 30 steps");
    run(&["--start", "out"]).said_once("nothing left to do");
}

/// A stage with the previous scene by `like`, and one with a copy of it: on one rank, and on two.
#[test]
fn a_stage_that_is_like_the_one_before_has_the_bits_of_a_copy() {
    let whole = heap(Launch::Alone);
    let directory = fresh_directory("like");
    let before: toml::Table = fs::read_to_string(scene("heap")).unwrap().parse().unwrap();
    let step = &before["time"]["step"];
    let own = format!("[time]\nstep = {step}\nsteps = 300\n[output]\ndirectory = \"out\"");
    let mut like: toml::Table = own.parse().unwrap();
    like.insert("start".to_owned(), whole.directory.to_str().unwrap().into());
    let mut copied = like.clone();
    copied.extend(before.into_iter().filter(|(key, _)| {
        ["domain", "gravity", "material", "interaction", "shape", "wall", "contact", "law"]
            .contains(&key.as_str())
    }));
    like.insert("like".to_owned(), "start".into());
    let run = |name: &str, text: &toml::Table, launch: Launch| {
        let (file, out) = (directory.join(format!("{name}.toml")), directory.join(name));
        fs::write(&file, text.to_string()).unwrap();
        dem_mpi(launch, [file.as_os_str(), "--out".as_ref(), out.as_os_str()]).succeed();
        out
    };
    let copied = run("copied", &copied, Launch::Alone);
    assert!(column(&copied, "contacts").values().any(|&count| count > 500.0));
    assert_same_result(&copied, &run("alone", &like, Launch::Alone));
    assert_same_result(&copied, &run("two", &like, Launch::Ranks(2)));
}
