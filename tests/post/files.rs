//! Differences, histories and dumps.

use super::pieces::some_particles;
use crate::support::packings::{Snapshot, ellipsoids};
use dem_mpi::contact::{ContactRecords, StateColumn};
use dem_mpi::drive::{SavedColumn, SavedState, Values};
use dem_mpi::math::Vec3;
use dem_mpi::post::diff::{Difference, State};
use dem_mpi::post::history::{Curve, History};
use dem_mpi::post::lammps;

#[test]
fn a_diff_finds_what_was_planted() {
    let first = ellipsoids(3, 6);
    let rows: Vec<usize> = (0..27).rev().collect();
    let mut second = first.clone();
    second.particles = some_particles(&first.particles, &rows);
    second.particles.rank = vec![3; 27];
    let compare = |a: &Snapshot, b: &Snapshot| {
        let state = |s: &Snapshot| State {
            header: s.header.clone(),
            particles: s.particles.clone(),
            records: ContactRecords::default(),
            contacts: s.contacts.clone(),
        };
        Difference::between(&state(a), &state(b))
    };
    let equal = compare(&first, &second);
    assert!(equal.is_empty(), "order and owner are not state: {equal}");
    assert_eq!(equal.compared, 27);
    assert!(equal.to_string().starts_with("equal bit for bit"));

    let mut rains = [70, 80].map(|fallen| {
        let fallen = Values::Counts(vec![fallen]);
        let columns = vec![SavedColumn::new(StateColumn::new("fallen", 1, "1"), fallen)];
        let mut rains = first.clone();
        rains.header.drives = vec![SavedState { drive: "rain".into(), columns }];
        rains
    });
    assert_eq!(compare(&rains[0], &rains[1]).header, ["rain, fallen: [70] and [80]"]);
    assert_eq!(compare(&first, &rains[1]).header, ["rain, fallen: nothing and [80]"]);
    rains[0].header.drives[0].drive = "snow".into();
    let names = ["rain, fallen: [80] and nothing", "snow, fallen: nothing and [70]"];
    assert_eq!(compare(&rains[1], &rains[0]).header, names);

    let sized = [[0.5, 1.0], [0.5, 2.0]].map(|scales| {
        let mut sized = first.clone();
        sized.header.shapes[0].scales = scales;
        sized
    });
    let shape = format!("{:?}", first.header.shapes[0].name);
    let told = format!("scales of shape {shape}: [0.5, 1.0] and [0.5, 2.0]");
    assert_eq!(compare(&sized[0], &sized[1]).header, [told]);

    // Long values are cut after their beginning.
    let mut wide = rains[0].clone();
    wide.header.drives[0].columns[0].values = Values::Counts((0..500).collect());
    let told = &compare(&first, &wide).header[0];
    assert!(told.starts_with("snow, fallen: nothing and [0, 1, 2, "), "{told}");
    assert!(told.ends_with("... (2390 characters)") && told.len() < 230, "{told}");
    wide.header = first.header.clone();
    wide.header.shapes[0].name = "pebble".to_owned();
    let [theirs, ours] = [&first, &wide].map(|s| format!("[{:?}]", s.header.shapes[0].name));
    assert_eq!(compare(&first, &wide).header, [format!("names of shapes: {theirs} and {ours}")]);

    let z = &mut second.particles.position[0].z; // id 26, in its last place
    *z = f64::from_bits(z.to_bits() + 1);
    second.particles.velocity[0].x = 0.5;
    second.particles.velocity[20].x = -0.25; // id 6
    second.particles.velocity[20].y = -0.0;
    second.header.time = 0.02;
    let found = compare(&first, &second);
    assert!(!found.is_empty());
    assert_eq!((found.differing, found.compared), (2, 27));
    assert_eq!(found.columns["velocity"].rows, 2);
    assert_eq!(found.columns["velocity"].largest, 0.5);
    assert_eq!(found.columns["position"].rows, 1);
    let named: Vec<(u64, &str)> = found.first.iter().map(|d| (d.id.0, d.column.as_str())).collect();
    let expected = [(6, "velocity.x"), (6, "velocity.y"), (26, "position.z"), (26, "velocity.x")];
    assert_eq!(named, expected);
    assert_eq!(found.header.len(), 1);

    let rows: Vec<usize> = (0..20).collect();
    let mut fewer = first.clone();
    fewer.particles = some_particles(&first.particles, &rows);
    fewer.particles.quaternion.clear();
    let found = compare(&first, &fewer);
    assert_eq!(found.only_first.len(), 7);
    assert!(found.only_second.is_empty());
    assert_eq!(found.only_one_column, ["quaternion"]);
    assert!(found.to_string().contains("7 particles only in the first: 20, 21"));
}

#[test]
fn history_columns_are_read_whatever_they_are() {
    let text = "step,time_s,kinetic_energy_j,note,overlap_m\n0,0,1,start,\n10,0.1,0.5,,2e-6\n20,0.2,0.25,,2e-6\n";
    let history = History::read(text.as_bytes()).unwrap();
    let names: Vec<&str> = history.curves.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["kinetic_energy_j", "overlap_m"], "no step, no words");
    assert_eq!(history.curves[0].points, [(0.0, 1.0), (0.1, 0.5), (0.2, 0.25)]);
    let changing: Vec<bool> = history.curves.iter().map(Curve::changes).collect();
    assert_eq!(changing, [true, false], "the overlap is constant");
    let error = History::read("a,b\n1,2\n".as_bytes()).unwrap_err().to_string();
    assert!(error.contains("a, b"), "{error}");

    let mut long = history.curves[0].clone();
    long.points = (0..100_000).map(|i| (f64::from(i), f64::from(i % 7))).collect();
    long.points[54_321].1 = 99.0;
    let thin = long.thinned(1000);
    assert!(thin.len() <= 1100 && thin.contains(&(54_321.0, 99.0)));
    assert_eq!((thin[0], *thin.last().unwrap()), (long.points[0], long.points[99_999]));
}

#[test]
fn lammps_dump_has_diameters_and_the_real_part_last() {
    let mut snapshot = ellipsoids(2, 7);
    snapshot.particles.quaternion[0] = [0.5, -0.5, 0.25, 0.125];
    snapshot.particles.position[0] = Vec3::new(0.1, 0.2, 0.3);
    snapshot.particles.velocity[0] = Vec3::new(0.25, -0.5, 4.0);
    let mut out = Vec::new();
    lammps::write_header(&mut out, &snapshot.header, 8).unwrap();
    lammps::write_particles(&mut out, &snapshot.header, &snapshot.particles).unwrap();
    let text = String::from_utf8(out).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[..5],
        ["ITEM: TIMESTEP", "1000", "ITEM: NUMBER OF ATOMS", "8", "ITEM: BOX BOUNDS ff ff ff"]
    );
    assert_eq!(lines.len(), 9 + 8);
    let first = "0 1 1e-1 2e-1 3e-1 -5e-1 2.5e-1 1.25e-1 5e-1 4.7622e-3 2.3811e-3 2.3811e-3 2.5e-1 -5e-1 4e0 ";
    let rest = lines[9].strip_prefix(first).expect(lines[9]);
    let rest: Vec<f64> = rest.split(' ').map(|cell| cell.parse().unwrap()).collect();
    let names: Vec<&str> = lines[8].split(' ').skip(2).collect();
    assert_eq!(names.len(), 15 + rest.len());
    let value = |name: &str| rest[names.iter().position(|n| *n == name).expect(name) - 15];
    let volume = 4.7622e-3 * 2.3811e-3 * 2.3811e-3 / 8.0;
    assert!((value("radius").powi(3) / volume - 1.0).abs() < 1e-14);
    for name in ["SuperquadricRoundness.Phi", "SuperquadricRoundness.Theta"] {
        assert_eq!(value(name), 1.0);
    }
    for name in ["omegax", "omegaz", "angmomx", "angmomz"] {
        assert_eq!(value(name), 0.0);
    }
}

#[test]
fn half_a_line_at_the_end_of_a_history_is_passed_over() {
    let whole = "step,time_s,top_m,overlap\n0,0,1,0.5\n10,0.1,2,2e-6\n";
    let history = History::read(whole.as_bytes()).unwrap();
    assert_eq!(history.curves.len(), 2);
    // Cuts in the middle of a cell, after the last comma, in half a number.
    for cut in ["20,0.2,1", "20,0.2,", "20,0.2,3,2e", "20,0.2,3,2e-6", "\u{0}\u{0}"] {
        let read = History::read(format!("{whole}{cut}").as_bytes());
        assert_eq!(read.expect(cut), history, "{cut}");
    }
}
