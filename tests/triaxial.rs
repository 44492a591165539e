//! Section 3 of the paper from made-up runs: verdicts follow from the numbers, and what is missing is said.

use crate::post::{Snapshot, ellipsoids};
use dem_mpi::comm::alone::Alone;
use dem_mpi::contact::Histories;
use dem_mpi::math::Vec3;
use dem_mpi::output::snapshot::{self, Reader};
use dem_mpi::output::tables::WallRow;
use dem_mpi::post::region::{Bounds, Margin, Region};
use dem_mpi::post::section::{Reading, Verdict};
use dem_mpi::post::series::{self, Choice};
use dem_mpi::post::triaxial::run::{Cost, rms_difference};
use dem_mpi::post::triaxial::{Method, Run, regenerate, report};
use dem_mpi::post::{Report, Settings, inside};
use std::f64::consts::PI;
use std::path::Path;

/// `q/p` rises to 1 at 5 % and falls to 0.7; the volume shrinks by 0.4 % and then grows.
fn usual(strain: f64) -> (f64, f64) {
    let ratio =
        if strain < 0.05 { strain / 0.05 } else { 0.7 + 0.3 * (-(strain - 0.05) / 0.05).exp() };
    (ratio, 0.16 * strain * (1.0 - strain / 0.05 * 0.5))
}

fn made_up(method: Method, z: f64, curve: impl Fn(f64) -> (f64, f64)) -> Run {
    let base = ellipsoids(5, 8).report();
    let mut packing = base.clone();
    packing.summary.coordination = Some(z);
    let at = |k: i32| {
        let mut report: Report = base.clone();
        let strain = 0.005 * f64::from(k);
        let (ratio, volume) = curve(strain);
        report.summary.axial_strain = Some(strain);
        report.summary.q_over_p = Some(ratio);
        report.summary.volumetric_strain = Some(volume);
        report.summary.coordination = Some(5.0 + 0.1 * z);
        report
    };
    Run {
        method,
        packing: Some(packing),
        consolidation: None,
        shear: (0..=70).map(at).collect(),
        unfinished: Vec::new(),
        missing_energy: vec![("packing", 1e-3), ("shear", 0.02)],
        costs: Vec::new(),
    }
}

/// The verdict on the first statement that begins like this.
fn verdict(runs: &[Run], statement: &str) -> Verdict {
    let parts = report::parts(runs);
    let mut findings = parts.iter().flat_map(|part| &part.findings);
    findings.find(|f| f.statement.starts_with(statement)).expect(statement).verdict
}

#[test]
fn fairly_identical_curves_are_told_from_others() {
    let truth = made_up(Method::Epa, 7.5, usual);
    let with = |erosion: &dyn Fn(f64) -> (f64, f64)| {
        [truth.clone(), made_up(Method::Erosion, 6.8, erosion)]
    };
    let stronger = |factor: f64| {
        with(&move |strain| {
            let (ratio, volume) = usual(strain);
            (factor * ratio, factor * volume)
        })
    };
    let verdicts =
        [(1.0, Verdict::Yes), (1.03, Verdict::Yes), (1.08, Verdict::Nearly), (0.8, Verdict::No)];
    for (factor, expected) in verdicts {
        let runs = stronger(factor);
        assert_eq!(verdict(&runs, "erosion and EPA: the same peak"), expected);
        assert_eq!(verdict(&runs, "the same plateau"), expected);
    }
    assert_eq!(verdict(&stronger(1.0), "the whole curve"), Verdict::Yes);
    assert_eq!(verdict(&stronger(1.5), "the whole curve"), Verdict::No);
    assert_eq!(verdict(&stronger(1.0), "volumetric strain fairly"), Verdict::Yes);
    assert_eq!(verdict(&stronger(2.0), "volumetric strain fairly"), Verdict::No);
    // The same peak and plateau, but at other strains.
    let late = with(&|strain| usual((strain - 0.1).max(0.0)));
    assert_eq!(verdict(&late, "the whole curve"), Verdict::No);
}

#[test]
fn a_response_without_peak_or_dilation_does_not_reproduce() {
    let peak = "q/p rises rapidly";
    let volume = "the packing first contracts";
    let one = |curve: fn(f64) -> (f64, f64)| [made_up(Method::CommonNormal, 7.5, curve)];
    let (usual, rising) = (one(usual), one(|strain| (strain, 0.01 * strain)));
    assert_eq!((verdict(&usual, peak), verdict(&usual, volume)), (Verdict::Yes, Verdict::Yes));
    assert_eq!((verdict(&rising, peak), verdict(&rising, volume)), (Verdict::No, Verdict::No));
    // One method that does not reproduce is enough.
    let both = [usual[0].clone(), Run { method: Method::Epa, ..rising[0].clone() }];
    assert_eq!(verdict(&both, peak), Verdict::No);
    // A compression that is not over has no verdict, until it has dilated.
    let mut short = usual;
    short[0].shear.truncate(30);
    assert_eq!((verdict(&short, peak), verdict(&short, volume)), (Verdict::Untold, Verdict::Yes));
    assert_eq!(verdict(&short, "compression to an axial strain"), Verdict::Untold);
    assert!(report::report(&short).contains("compressed to 14.50 % only"));
    short[0].shear.truncate(15);
    assert_eq!(verdict(&short, volume), Verdict::Untold);
}

#[test]
fn coordination_is_compared_with_the_paper_s() {
    let runs = |epa: f64, erosion: f64| {
        [made_up(Method::Epa, epa, usual), made_up(Method::Erosion, erosion, usual)]
    };
    let of_epa = "after packing, mean Z is about 7.5";
    let of_erosion = "and about 6.8";
    assert_eq!(verdict(&runs(7.4, 6.9), of_epa), Verdict::Yes);
    assert_eq!(verdict(&runs(7.0, 6.9), of_epa), Verdict::Nearly);
    assert_eq!(verdict(&runs(6.0, 6.9), of_epa), Verdict::No);
    assert_eq!(verdict(&runs(7.5, 6.9), of_erosion), Verdict::Yes);
    assert_eq!(verdict(&runs(7.5, 6.9), "EPA's Z is nearer"), Verdict::Yes);
    assert_eq!(verdict(&runs(6.9, 7.5), "EPA's Z is nearer"), Verdict::No);
    // A tenth of it at the peak.
    assert_eq!(verdict(&runs(7.5, 6.9), "the difference in Z is smaller"), Verdict::Yes);
    assert_eq!(verdict(&runs(7.5, 7.53), "the difference in Z is smaller"), Verdict::No);
    let shift = "erosion's histogram is shifted";
    // The same histogram: a mean that is said to be smaller is not all.
    assert_eq!(verdict(&runs(7.5, 7.5), shift), Verdict::No);
    let mut shifted = runs(7.5, 6.8);
    let numbers = shifted[0].packing.as_mut().map(|p| &mut p.coordination.without_walls);
    numbers.expect("made up").histogram.insert(0, 0);
    assert_eq!(verdict(&shifted, shift), Verdict::Yes);
    let numbers = shifted[1].packing.as_mut().map(|p| &mut p.coordination.without_walls);
    numbers.expect("made up").histogram.splice(0..0, [0, 0, 0]);
    assert_eq!(verdict(&shifted, shift), Verdict::Nearly);
}

#[test]
fn weak_contacts_that_go_missing_are_seen() {
    let mut runs = [made_up(Method::Epa, 7.0, usual), made_up(Method::Erosion, 7.0, usual)];
    let statement = "erosion dismisses a considerable number";
    assert_eq!(verdict(&runs, statement), Verdict::No);
    assert_eq!(verdict(&runs, "the difference is mainly among weak"), Verdict::No);
    let packing = runs[1].packing.as_mut().expect("made up");
    let forces = packing.forces.as_mut().expect("forces");
    // Half of the weak ones are gone, and nothing else.
    let gone = 0.5 * forces.weak_share.expect("contacts");
    let rest = |share: Option<f64>| share.map(|share| (share - gone) / (1.0 - gone));
    forces.weak_share = rest(forces.weak_share);
    forces.below_mean_share = rest(forces.below_mean_share);
    packing.summary.share_below_0_3_mean = forces.weak_share;
    packing.summary.coordination = Some(7.0 * (1.0 - gone));
    assert_eq!(verdict(&runs, statement), Verdict::Yes);
    assert_eq!(verdict(&runs, "the difference is mainly among weak"), Verdict::Yes);
}

#[test]
fn what_is_missing_is_said() {
    let erosion = made_up(Method::Erosion, 6.8, usual);
    let alone = report::report(std::slice::from_ref(&erosion));
    assert!(alone.contains("EPA: no runs") && alone.contains("nothing to compare erosion with"));
    assert_eq!(verdict(std::slice::from_ref(&erosion), "the same plateau"), Verdict::Untold);
    let exact = made_up(Method::CommonNormal, 7.5, usual);
    assert!(report::report(&[exact]).contains("there is no erosion to compare"));
    let exact = made_up(Method::CommonNormal, 7.5, usual);
    let both = [exact, erosion];
    let page = report::report(&both);
    assert!(page.contains("compared with the common normal, for there are no runs of EPA"));
    assert!(page.contains("erosion: no consolidation"));
    assert_eq!(verdict(&both, "the same plateau"), Verdict::Yes);
    assert_eq!(verdict(&both, "the balance of energies"), Verdict::Nearly);
}

/// Where erosion was run as the paper reads, it is that which is held against the paper.
#[test]
fn erosion_is_judged_as_the_paper_reads() {
    let exact = made_up(Method::CommonNormal, 7.5, usual);
    let checked = made_up(Method::CheckedErosion, 6.8, usual);
    let alone = made_up(Method::Erosion, 7.5, usual);
    let both = [exact.clone(), alone.clone()];
    assert_eq!(verdict(&both, "and about 6.8 with erosion"), Verdict::Nearly);
    let all = [exact, checked, alone];
    assert_eq!(verdict(&all, "and about 6.8 with erosion"), Verdict::Yes);
    let page = report::report(&all);
    assert!(page.contains("erosion after GJK has said that bodies touch is compared"));
}

/// Erosion has been read both ways where there are both: after GJK, and alone.
#[test]
fn findings_tell_both_readings_of_erosion() {
    let exact = made_up(Method::CommonNormal, 7.5, usual);
    let checked = made_up(Method::CheckedErosion, 6.8, usual);
    let alone = made_up(Method::Erosion, 7.5, usual);
    let verdict = |runs: &[Run], name: &str, reading: Reading| {
        let rows = report::rows(runs);
        rows.into_iter().find(|row| row.name == name && row.reading == reading).expect(name).verdict
    };
    let all = [exact.clone(), checked.clone(), alone.clone()];
    for (name, with_gjk, by_itself) in [
        ("z_erosion", Verdict::Yes, Verdict::Nearly),
        ("z_at_peak", Verdict::Yes, Verdict::No),
        ("same_curve", Verdict::Yes, Verdict::Yes),
        // Erosion alone pushes as much and loses nothing.
        ("pushing_away", Verdict::No, Verdict::No),
    ] {
        assert_eq!(verdict(&all, name, Reading::Checked), with_gjk, "{name}");
        assert_eq!(verdict(&all, name, Reading::Alone), by_itself, "{name}");
    }
    // What was not run is not judged by the other.
    let without = [exact.clone(), checked];
    assert_eq!(verdict(&without, "z_erosion", Reading::Checked), Verdict::Yes);
    for name in ["z_erosion", "same_curve", "pushing_away"] {
        assert_eq!(verdict(&without, name, Reading::Alone), Verdict::Untold, "{name}");
    }
    let losing = [exact, made_up(Method::Erosion, 6.8, usual)];
    assert_eq!(verdict(&losing, "pushing_away", Reading::Alone), Verdict::Yes);
    // Every finding has a name of its own.
    let mut names: Vec<String> = report::rows(&all).into_iter().map(|row| row.name).collect();
    let count = names.len();
    names.sort();
    names.dedup();
    assert_eq!(2 * names.len(), count);
}

#[test]
fn a_packing_that_does_not_rest_is_told() {
    let mut run = made_up(Method::CheckedErosion, 6.8, usual);
    for (force, expected) in [(0.005, Verdict::Yes), (0.04, Verdict::Nearly), (0.28, Verdict::No)] {
        let packing = run.packing.as_mut().expect("made up");
        packing.summary.unbalanced_force_ratio = Some(force);
        assert_eq!(verdict(std::slice::from_ref(&run), "the packing is at rest"), expected);
    }
    assert!(
        report::report(&[run])
            .contains("), but not at rest: resultant force 0.2800 of a contact's")
    );
}

#[test]
fn curves_differ_by_what_lies_between_them() {
    let a = [(0.0, 0.0), (1.0, 1.0), (3.0, 1.0)];
    let b = [(0.5, 1.0), (2.0, 2.5)];
    // b - a is 1/2 at both ends and 1/2 at x = 1; then it grows to 3/2.
    let same: Vec<(f64, f64)> = a.iter().map(|&(x, y)| (x, y + 0.25)).collect();
    assert!((rms_difference(&a, &same).unwrap() - 0.25).abs() < 1e-15);
    let found = rms_difference(&a, &b).unwrap();
    // ∫ (1/2)² over 0.5..1, ∫ (1/2 + x)² over 0..1, over 1.5.
    let exact = ((0.125 + 13.0 / 12.0) / 1.5_f64).sqrt();
    assert!((found - exact).abs() < 0.01 * exact, "{found} but {exact}");
    assert_eq!(rms_difference(&a, &[(4.0, 0.0), (5.0, 0.0)]), None);
}

#[test]
fn the_end_of_a_log_tells_what_a_run_took() {
    let log = "7046 of 200000 steps, 3.5 %\n\
               at rest: step 103300, time 1.033000 s; 500 steps of 64 particles in 1.5 s on 2 ranks\n\
               contacts   5.1e8 resolved, 1e6 per second; 40.1 ns per contact, 9.0 ns per listed pair\n";
    let expected = Cost {
        stage: "shear",
        steps: 500,
        seconds: 1.5,
        ranks: 2,
        core_hours: Some(3.0 / 3600.0),
        contact_ns: Some(40.1),
    };
    assert_eq!(Cost::of("shear", log), Some(expected.clone()));
    assert_eq!(Cost::of("shear", "7046 of 200000 steps, 3.5 %\n"), None);

    let earlier = "stopped by SIGTERM; 250 steps of 64 particles in 4.5 s on 4 ranks\n\
                   contacts   1.1e8 resolved, 1e6 per second; 99.9 ns per contact\n";
    let both = Cost { steps: 750, seconds: 6.0, core_hours: Some(21.0 / 3600.0), ..expected };
    assert_eq!(Cost::of("shear", &(earlier.to_owned() + log)), Some(both));
}

#[test]
fn core_hours_are_told_for_each_figure() {
    let mut run = made_up(Method::Epa, 7.5, usual);
    for (k, report) in run.shear.iter_mut().enumerate() {
        report.summary.step = 1000 + 10 * k as u64;
    }
    let cost = |stage, core_hours: f64| Cost {
        stage,
        steps: 700,
        seconds: 1800.0 * core_hours,
        ranks: 2,
        core_hours: Some(core_hours),
        contact_ns: None,
    };
    run.costs = vec![cost("packing", 2.0), cost("consolidation", 1.0), cost("shear", 7.0)];
    // The peak is at a strain of 5 %, the tenth of 70 intervals.
    let page = report::report(std::slice::from_ref(&run));
    assert!(page.contains("| EPA | 2.000 | 4.000 | 10.00 |"), "{page}");
    run.costs.remove(1);
    assert!(report::report(&[run]).contains("| EPA | 2.000 | – | – |"));
}

/// A packing between walls on all sides, the lid this high.
fn boxed(height: f64, step: u64) -> Snapshot {
    let mut snapshot = ellipsoids(5, 8);
    snapshot.header.step = step;
    let wall = |name: &str, point: Vec3, normal: Vec3| WallRow {
        name: name.into(),
        point,
        normal,
        velocity: Vec3::zeros(),
        force: Vec3::zeros(),
    };
    snapshot.header.walls.push(wall("+z", Vec3::z() * height, -Vec3::z()));
    snapshot
}

fn store(folder: &Path, snapshot: &Snapshot) {
    std::fs::create_dir_all(folder).unwrap();
    let Snapshot { header, particles, contacts } = snapshot;
    let none = Histories::default();
    snapshot::write(folder, header, particles, contacts, &none, &mut Alone::default()).unwrap();
}

#[test]
fn stored_runs_give_every_figure_and_table() {
    let root = tempfile::tempdir().unwrap();
    let run = root.path().join("gjk-erosion");
    store(&run.join("packing"), &ellipsoids(5, 8));
    let heights = [0.02, 0.019, 0.018];
    for (k, height) in (1..).zip(heights) {
        store(&run.join("shear"), &boxed(height, 100 * k));
    }
    std::fs::write(
        run.join("shear/history.csv"),
        "step,time_s,dissipated_J,missing_J\n0,0,1,1\n9,1,2,-0.02\n",
    )
    .unwrap();
    let files = regenerate(root.path(), &Choice::default()).unwrap();
    let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    for k in 10..=14 {
        assert!(names.contains(&format!("fig{k}.svg").as_str()), "{names:?}");
        assert!(names.contains(&format!("fig{k}.csv").as_str()), "{names:?}");
    }
    let text = |name: &str| &files.iter().find(|f| f.0 == name).expect(name).1;
    assert!(text("fig9.svg").contains("(b) erosion, compressed at a strain of 10.54 %"));
    let mut table = csv::Reader::from_reader(text("fig10.csv").as_bytes());
    let headers = table.headers().unwrap().clone();
    let column = headers.iter().position(|h| h == "axial_strain").unwrap();
    let strains: Vec<f64> =
        table.records().map(|row| row.unwrap()[column].parse().unwrap()).collect();
    let expected = heights.map(|height| (0.02_f64 / height).ln());
    assert!(strains.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{strains:?}");
    let page = text("report.md");
    assert!(page.contains("shear 1.0e-2"), "missing over dissipated");
    assert!(page.contains("common normal: no runs") && page.contains("EPA: no runs"));
    // Every figure that the page shows is there.
    let shown = page.split("](").skip(1).map(|rest| rest.split(')').next().unwrap());
    let shown: Vec<&str> = shown.collect();
    assert_eq!(
        shown,
        ["fig9.svg", "fig10.svg", "fig11.svg", "fig12.svg", "fig13.svg", "fig14.svg"]
    );
    for (name, text) in &files {
        assert!(!text.contains("NaN") && !text.contains("inf\""), "{name}");
    }
}

#[test]
fn a_stage_that_is_not_over_is_compared_with_nothing() {
    let root = tempfile::tempdir().unwrap();
    let run = root.path().join("epa");
    let page = || {
        let files = regenerate(root.path(), &Choice::default()).unwrap();
        files.into_iter().find(|(name, _)| name == "report.md").expect("a report").1
    };
    store(&run.join("packing"), &ellipsoids(5, 8));
    let begun = page();
    assert!(begun.contains("EPA: packing is not over, no consolidation, no shear"), "{begun}");
    assert!(!begun.contains("| packing |"), "{begun}");

    // The next stage begins from a packing that is over.
    store(&run.join("consolidation"), &boxed(0.02, 100));
    let consolidating = page();
    assert!(consolidating.contains("EPA: consolidation is not over, no shear"), "{consolidating}");
    assert!(consolidating.contains("| packing |") && !consolidating.contains("| consolidation |"));

    // It is over if it says so, or if the script that ran it does.
    std::fs::write(run.join("consolidation/done"), "").unwrap();
    assert!(page().contains("EPA: no shear"));
    std::fs::remove_dir_all(run.join("consolidation")).unwrap();
    let mut rested = ellipsoids(5, 8);
    rested.header.step = 200;
    rested.header.stop = "unbalanced = 0.005".into();
    store(&run.join("packing"), &rested);
    assert!(page().contains("EPA: no consolidation, no shear"));
}

#[test]
fn a_compression_is_to_start_from_what_the_paper_says() {
    let statement = "it starts from 100 kPa";
    let mut run = made_up(Method::Epa, 7.5, usual);
    assert_eq!(verdict(std::slice::from_ref(&run), statement), Verdict::Untold);
    for (pressure, expected) in
        [(1.01e5, Verdict::Yes), (1.05e5, Verdict::Nearly), (1.4e5, Verdict::No)]
    {
        let mut consolidated = run.shear[0].clone();
        let s = &mut consolidated.summary;
        (s.wall_stress_xx_pa, s.wall_stress_yy_pa) = (Some(1e5), Some(0.99e5));
        s.wall_stress_zz_pa = Some(pressure);
        run.consolidation = Some(consolidated);
        assert_eq!(verdict(std::slice::from_ref(&run), statement), expected, "{pressure}");
    }
}

#[test]
fn a_margin_follows_the_walls_and_strains_stay_those_of_the_whole() {
    let folder = tempfile::tempdir().unwrap();
    for (step, height) in [(1, 0.02), (2, 0.018)] {
        store(folder.path(), &boxed(height, step));
    }
    let files = series::all(folder.path()).unwrap();
    assert_eq!(files.len(), 2);
    let choice = Choice { margin: Some("0.001".parse().unwrap()), ..Choice::default() };
    let (reports, _) = series::reports(&series::open(&files).unwrap(), &choice).unwrap();
    let side = 5.0 * 2.6e-3;
    for (report, height) in reports.iter().zip([0.02, 0.018]) {
        let Bounds { low, high } = report.bounds_m.unwrap();
        assert!((low - Vec3::repeat(1e-3)).amax() < 1e-15, "{low}");
        let expected = Vec3::new(side - 1e-3, side - 1e-3, height - 1e-3);
        assert!((high - expected).amax() < 1e-15, "{high}");
        assert!(report.summary.particles < 125);
    }
    let strain = reports[1].summary.axial_strain.unwrap();
    assert!((strain - (0.02_f64 / 0.018).ln()).abs() < 1e-12, "{strain}");

    // A diameter is that of the ball of equal volume.
    let reader = Reader::open(&files[0]).unwrap();
    let region = inside(&reader, Margin::Diameters(0.5)).unwrap();
    let Region::Box(bounds) = region else { panic!("{region:?}") };
    let semi_axes = reader.header().shapes[0].semi_axes;
    assert!((bounds.low.x - semi_axes.product().cbrt()).abs() < 1e-12, "{bounds:?}");
    let error = inside(&reader, Margin::Metres(1.0)).unwrap_err().to_string();
    assert!(error.contains("the region has no length along x"), "{error}");
    assert!("1.5d".parse() == Ok(Margin::Diameters(1.5)) && "-1".parse::<Margin>().is_err());
}

#[test]
fn walls_tell_stress_and_inertial_number() {
    let mut snapshot = boxed(0.02, 1);
    for wall in &mut snapshot.header.walls {
        // Twice the load on the floor, as under weight.
        let load = if wall.normal.z > 0.0 { 20.0 } else { 10.0 };
        wall.force = wall.normal * -load;
    }
    snapshot.header.walls.last_mut().unwrap().velocity = Vec3::z() * -0.1;
    let report = snapshot.report();
    let s = &report.summary;
    let side: f64 = 5.0 * 2.6e-3;
    let close = |found: Option<f64>, expected: f64| {
        assert!((found.unwrap() / expected - 1.0).abs() < 1e-12, "{found:?} but {expected}");
    };
    close(s.wall_stress_xx_pa, 10.0 / (side * 0.02));
    close(s.wall_stress_yy_pa, 10.0 / (side * 0.02));
    close(s.wall_stress_zz_pa, 15.0 / (side * side));
    let shape = &snapshot.header.shapes[0];
    let diameter = (6.0 / PI * shape.volume).cbrt();
    let inertia = 0.1 / 0.02 * diameter * (shape.mass / shape.volume / s.p_pa.unwrap()).sqrt();
    close(s.inertial_number, inertia);
    let relation = s.q_over_p_from_fabric.unwrap() / s.q_over_p.unwrap() - 1.0;
    close(s.fabric_relation_error, relation);

    // A wall beyond the lid does not bound the packing.
    let lid = snapshot.header.walls.pop().unwrap();
    let beyond = WallRow { point: Vec3::z() * 0.03, velocity: Vec3::zeros(), ..lid.clone() };
    snapshot.header.walls.extend([beyond, lid]);
    close(snapshot.report().summary.inertial_number, inertia);

    // Without a lid the load on the floor is not the stress in between.
    let open = ellipsoids(5, 8);
    let s = open.analyse(Settings::default()).unwrap().report.summary;
    assert_eq!((s.wall_stress_zz_pa, s.inertial_number), (None, None));
    assert!(s.wall_stress_xx_pa.is_some());
}
