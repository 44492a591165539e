//! Stages that end when columns of the history are within limits.

use super::process::{Launch, dem_mpi};
use super::{fresh_directory, written};
use dem_mpi::output::snapshot::Reader;
use std::path::Path;

/// Scene of a ball in free fall from a height of 1 m.
fn falling(directory: &Path, stop: &str) -> String {
    let text = format!(
        r#"
gravity = [0.0, 0.0, -9.81]
[domain]
low = [0.0, 0.0, 0.0]
high = [1.0, 1.0, 2.0]
[[material]]
name = "glass"
density = 2500.0
normal_stiffness = 1e4
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.01
[[fill.lattice]]
first = [0.5, 0.5, 1.0]
count = [1, 1, 1]
shapes = ["ball"]
[time]
step = 1e-5
steps = 20000
[output]
directory = "out"
{stop}
"#
    );
    written(directory, &text)
}

#[test]
fn a_fall_ends_where_its_column_crosses_the_limit() {
    // Top at 1.01 m - g t²/2, and speed g t, checked every 100 steps of 1e-5 s.
    let first_look = |time: f64| (time / 1e-3).ceil() as u64 * 100;
    let by_place = first_look((2.0 * 0.11 / 9.81_f64).sqrt());
    let by_speed = first_look(1.6 / 9.81);
    let place = "{ column = \"top_m\", below = 0.9 }";
    let speed = "{ column = \"largest_speed_m_per_s\", above = 1.6, below = 100 }";
    assert!(by_speed > by_place);
    for (stop, step) in [
        (format!("[stop]\nwhen = [{place}]"), by_place),
        (format!("[stop]\nwhen = [{place}, {speed}]"), by_speed),
        ("[[stop.when]]\ncolumn = \"step\"\nabove = 1234".to_owned(), 1300),
    ] {
        for launch in [Launch::Alone, Launch::Ranks(2)] {
            let directory = fresh_directory(&format!("fallen_{step}_{launch:?}"));
            let ended = dem_mpi(launch, [&*falling(&directory, &stop)]).from(&directory).succeed();
            ended.said_once("[stop] reached");
            let reader = Reader::open(&directory.join("out")).unwrap();
            assert_eq!(reader.header().step, step, "{stop}");
        }
    }
}

#[test]
fn an_end_that_does_not_come_is_said_with_where_it_stands() {
    let directory = fresh_directory("not_fallen");
    let stop = "[stop]\nwhen = [{ column = \"top_m\", below = 0.5 }]";
    let ended = dem_mpi(Launch::Alone, [&*falling(&directory, stop)]).from(&directory).end();
    assert_eq!(ended.status.code(), Some(4), "{ended}");
    ended.said_once("top_m is 8.1380e-1, not below 0.5");
}

#[test]
fn a_column_that_is_not_there_is_refused_with_those_that_are() {
    for arguments in [vec![], vec!["--check"]] {
        let directory = fresh_directory("no_column");
        let stop = "[stop]\nwhen = [{ column = \"stress_lid_Pa\", above = 1e3 }]";
        let scene = falling(&directory, stop);
        let arguments = [vec![&*scene], arguments].concat();
        let ended = dem_mpi(Launch::Ranks(2), arguments).from(&directory).end();
        assert_eq!(ended.status.code(), Some(2), "{ended}");
        ended
            .said_once("stop.when: history.csv has no column `stress_lid_Pa`; it has step, time_s");
    }
}
