//! Section 3 of the paper from artificial runs: verdicts follow from the numbers, and missing data are reported.

use crate::packings::{Snapshot, boxed, closed, ellipsoids, store};
use dem_mpi::math::Vec3;
use dem_mpi::output::performance::Performance;
use dem_mpi::post::fabric::Among;
use dem_mpi::post::region::{Bounds, Region};
use dem_mpi::post::report::readable;
use dem_mpi::post::series::Choice;
use dem_mpi::post::{Report, Settings};
use lai2021::findings::{Reading, Verdict};
use lai2021::triaxial::run::{Cost, rms_difference};
use lai2021::triaxial::{Method, Run, figures, regenerate, report};
use std::collections::BTreeSet;
use std::process::Command;

/// `q/p` rises to 1 at 5 % and falls to 0.7; the volume decreases by 0.4 % and then grows.
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
        other_packings: Vec::new(),
        consolidation: None,
        shear: (0..=70).map(at).collect(),
        unfinished: Vec::new(),
        missing_energy: vec![("packing", 1e-3), ("shear", 0.02)],
        costs: Vec::new(),
    }
}

/// Verdict on the first statement that begins with this text.
fn verdict(runs: &[Run], statement: &str) -> Verdict {
    let topics = report::topics(runs);
    let mut findings = topics.iter().flat_map(|topic| &topic.findings);
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
    // Equal peak and plateau, at other strains.
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
    // An unfinished compression has no verdict, until it has dilated.
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
    // A tenth of the difference at the peak.
    assert_eq!(verdict(&runs(7.5, 6.9), "the difference in Z is smaller"), Verdict::Yes);
    assert_eq!(verdict(&runs(7.5, 7.53), "the difference in Z is smaller"), Verdict::No);
    let shift = "erosion's histogram is shifted";
    // Equal histograms: the claim of a smaller mean is not enough.
    assert_eq!(verdict(&runs(7.5, 7.5), shift), Verdict::No);
    let mut shifted = runs(7.5, 6.8);
    let numbers = shifted[0].packing.as_mut().map(|p| &mut p.coordination.without_walls);
    numbers.expect("made up").histogram.insert(0, 0);
    assert_eq!(verdict(&shifted, shift), Verdict::Yes);
    let numbers = shifted[1].packing.as_mut().map(|p| &mut p.coordination.without_walls);
    numbers.expect("made up").histogram.splice(0..0, [0, 0, 0]);
    assert_eq!(verdict(&shifted, shift), Verdict::Nearly);
}

/// The verdict follows from all packings, even if one packing alone would reverse it.
#[test]
fn several_packings_say_what_is_chance() {
    let with = |method, first: f64, others: [f64; 2]| {
        let run = made_up(method, first, usual);
        let packing = run.packing.clone().expect("made up");
        let other = |z: f64| {
            let mut report = packing.clone();
            report.summary.coordination = Some(z);
            report
        };
        Run { other_packings: others.map(other).to_vec(), ..run }
    };
    let runs = [
        with(Method::Epa, 7.5, [7.5, 7.5]),
        with(Method::Erosion, 7.5, [6.4, 6.5]),
        with(Method::CommonNormal, 7.5, [7.5, 7.5]),
    ];
    let (here, verdict) = found(&runs, "and about 6.8");
    assert!(here.starts_with("erosion: 6.80 (") && here.contains("± 0.61 in 3 packings"), "{here}");
    assert_eq!(verdict, Verdict::Yes);
    let (here, _) = found(&runs, "erosion's histogram is shifted");
    assert!(here.starts_with("mean 6.800 ± 0.6083 and 7.500 ± 0: -9.3 %;"), "{here}");
    assert!(!here.contains("by chance"), "{here}");
    // One packing alone would show no loss.
    let alone = runs.map(|run| Run { other_packings: Vec::new(), ..run });
    assert_eq!(found(&alone, "and about 6.8").1, Verdict::Nearly);
}

#[test]
fn weak_contacts_that_go_missing_are_seen() {
    let mut runs = [made_up(Method::Epa, 7.0, usual), made_up(Method::Erosion, 7.0, usual)];
    let statement = "erosion dismisses a considerable number";
    assert_eq!(verdict(&runs, statement), Verdict::No);
    assert_eq!(verdict(&runs, "the difference is mainly among weak"), Verdict::No);
    let packing = runs[1].packing.as_mut().expect("made up");
    let forces = packing.forces.as_mut().expect("forces");
    // Half of the weak contacts are removed, and nothing else.
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

/// Erosion after GJK, if it was run, is compared with the paper.
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

/// Erosion has both readings if both were run: after GJK, and alone.
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
    // A reading without runs is not judged by the other.
    let without = [exact.clone(), checked];
    assert_eq!(verdict(&without, "z_erosion", Reading::Checked), Verdict::Yes);
    for name in ["z_erosion", "same_curve", "pushing_away"] {
        assert_eq!(verdict(&without, name, Reading::Alone), Verdict::Untold, "{name}");
    }
    let losing = [exact, made_up(Method::Erosion, 6.8, usual)];
    assert_eq!(verdict(&losing, "pushing_away", Reading::Alone), Verdict::Yes);
    // Every finding has a unique name.
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
fn the_rows_of_its_runs_tell_what_a_stage_took() {
    let last = Performance {
        ranks: 2,
        steps: 500,
        particle_steps: 32_000,
        wall_s: 1.5,
        contact_resolution_s: 0.401,
        listed_pairs: 40_000_000,
        resolved_pairs: 20_000_000,
        contacts: 10_000_000,
    };
    let expected = Cost {
        stage: "shear",
        steps: 500,
        seconds: 1.5,
        ranks: 2,
        core_hours: Some(3.0 / 3600.0),
        contact_ns: Some(40.1),
    };
    assert_eq!(Cost::of("shear", &[last]), Some(expected.clone()));
    assert_eq!(Cost::of("shear", &[]), None);

    let earlier =
        Performance { ranks: 4, steps: 250, wall_s: 4.5, contact_resolution_s: 9.0, ..last };
    let both = Cost { steps: 750, seconds: 6.0, core_hours: Some(21.0 / 3600.0), ..expected };
    assert_eq!(Cost::of("shear", &[earlier, last]), Some(both));
    let nothing = Performance { contacts: 0, contact_resolution_s: 0.0, ..last };
    assert_eq!(Cost::of("shear", &[nothing]).unwrap().contact_ns, None);
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
    // Every figure on the page exists.
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

    // The next stage begins from a finished packing.
    store(&run.join("consolidation"), &boxed(0.02, 100));
    let consolidating = page();
    assert!(consolidating.contains("EPA: consolidation is not over, no shear"), "{consolidating}");
    assert!(consolidating.contains("| packing |") && !consolidating.contains("| consolidation |"));

    // A stage is finished if its header says so, or if the script that ran it does.
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

/// Runs of a method: a packing, and optionally a compression to 35 % with its peak at 5 %.
fn run_of(method: Method, sheared: bool, settings: impl Fn(&Snapshot) -> Settings) -> Run {
    let report = |strain: f64| {
        let mut snapshot = closed(0.02 * (-strain).exp());
        for wall in &mut snapshot.header.walls {
            wall.force = -wall.normal;
        }
        let mut report = snapshot.analyse(settings(&snapshot)).unwrap().report;
        report.summary.axial_strain = Some(strain);
        report.summary.q_over_p = Some(if strain == 0.05 { 1.0 } else { 0.7 });
        report
    };
    Run {
        method,
        packing: Some(report(0.0)),
        other_packings: Vec::new(),
        consolidation: None,
        shear: (0..=7).filter(|_| sheared).map(|k| report(f64::from(k) * 0.05)).collect(),
        unfinished: Vec::new(),
        missing_energy: Vec::new(),
        costs: Vec::new(),
    }
}

/// Finding and verdict for the statement that begins with this text.
fn found(runs: &[Run], statement: &str) -> (String, Verdict) {
    let topics = report::topics(runs);
    let mut findings = topics.into_iter().flat_map(|topic| topic.findings);
    let finding = findings.find(|f| f.statement.starts_with(statement)).expect(statement);
    (finding.here, finding.verdict)
}

#[test]
fn a_part_of_a_packing_is_not_taken_for_the_whole() {
    const COUNT: &str = "5,120 particles";
    const STRESS: &str = "stress from contacts is load over area";
    const NOT_IN_FABRIC: &str = "in the stress but not in the fabric";
    let runs = |settings: &dyn Fn(&Snapshot) -> Settings| [run_of(Method::Epa, true, settings)];
    let whole = runs(&|_| Settings::default());
    assert_eq!(found(&whole, COUNT).1, Verdict::No);
    assert_ne!(found(&whole, STRESS).1, Verdict::Untold);
    let page = report::report(&whole);
    assert!(!page.contains("Measured") && page.contains(NOT_IN_FABRIC), "{page}");

    let region = Region::Box(Bounds { low: Vec3::repeat(1e-3), high: Vec3::repeat(6e-3) });
    let fixed = runs(&|_| Settings { region, ..Settings::default() });
    let following = runs(&|snapshot| {
        let packing = snapshot.report().bounds_m.unwrap();
        let region = Region::Box(packing.shrunk(&snapshot.header, 1e-3));
        Settings { region, ..Settings::default() }
    });
    for (runs, place) in [
        (&fixed, "in x 0.001000…0.006000, y 0.001000…0.006000, z 0.001000…0.006000 m"),
        (&following, "without a layer of 0.001000 m along the sides of each packing"),
    ] {
        assert_eq!(found(runs, COUNT), ("–".into(), Verdict::Untold));
        assert_eq!(found(runs, STRESS), ("–".into(), Verdict::Untold));
        let page = report::report(runs);
        assert!(page.contains(&format!("**Measured {place}.**")), "{page}");
    }

    let with_walls = runs(&|_| Settings { among: Among::ParticlesAndWalls, ..Settings::default() });
    assert_eq!(found(&with_walls, COUNT).1, Verdict::No);
    let page = report::report(&with_walls);
    assert!(page.contains("**Measured with walls.**") && !page.contains(NOT_IN_FABRIC), "{page}");
}

/// The force distributions count contacts with walls, so the contacts per particle that weigh them must do so,
/// too.
#[test]
fn contacts_per_particle_are_those_of_the_distributions() {
    let statement = "erosion dismisses a considerable number";
    let weak_each = |among| {
        let of = |method| run_of(method, false, |_| Settings { among, ..Settings::default() });
        let runs = [of(Method::Epa), of(Method::Erosion)];
        let s = &runs[0].packing.as_ref().unwrap().summary;
        let counted = match among {
            Among::Particles => s.contacts_between_particles,
            Among::ParticlesAndWalls => s.contacts_between_particles + s.contacts_with_walls as f64,
        };
        let each = s.share_below_0_3_mean.unwrap() * counted / s.particles as f64;
        (found(&runs, statement).0, format!("per particle {}", readable(each)))
    };
    for among in [Among::Particles, Among::ParticlesAndWalls] {
        let (here, expected) = weak_each(among);
        assert!(here.contains(&expected), "{here}, not {expected}");
    }
}

/// With unfinished runs of EPA, the common normal is the reference for the compression.
#[test]
fn the_common_normal_stands_in_for_what_epa_has_not_told() {
    let of = |method, sheared| run_of(method, sheared, |_| Settings::default());
    let erosion = of(Method::Erosion, true);
    let partial = [of(Method::CommonNormal, true), of(Method::Epa, false), erosion.clone()];
    let whole = [of(Method::CommonNormal, true), of(Method::Epa, true), erosion];
    let compression = [
        "erosion and EPA: the same peak",
        "the same plateau",
        "the whole curve fairly identical",
        "the difference in Z is smaller",
        "at the peak they are consistent",
    ];
    let packing = ["erosion's histogram is shifted", "erosion dismisses a considerable number"];
    let stand_in = "benchmark here: the common normal";
    for statement in compression {
        let (here, verdict) = found(&partial, statement);
        assert_ne!(verdict, Verdict::Untold, "{statement}");
        assert!(here.contains(stand_in), "{statement}: {here}");
        assert_eq!(found(&partial, statement).1, found(&whole, statement).1, "{statement}");
    }
    for (runs, statement) in packing
        .map(|statement| (&partial, statement))
        .into_iter()
        .chain(compression.map(|statement| (&whole, statement)))
    {
        assert!(!found(runs, statement).0.contains(stand_in), "{statement}");
    }
    let page = report::report(&partial);
    assert!(page.contains("EPA, as in the paper, and where EPA has no number with the common"));
}

/// Names in the legends of fig. 11 end within their panel.
#[test]
fn legends_stay_in_the_picture() {
    let runs = Method::ALL.map(|method| run_of(method, true, |_| Settings::default()));
    let figures = figures::all(&runs).unwrap();
    let (_, svg) = figures.iter().find(|(name, _)| *name == "fig11.svg").expect("the figure");
    // Drawing units per pixel; widths in pixels.
    let (fine, panel, letter) = (8.0, 560.0, 6.5);
    let mut places = Vec::new();
    for text in svg.split("<text ").skip(1) {
        let (attributes, rest) = text.split_once(">\n").unwrap();
        let name = rest.split('\n').next().unwrap();
        if name.contains(", mean") {
            let at = |key: &str| -> f64 {
                let (_, rest) = attributes.split_once(&format!("{key}=\"")).unwrap();
                rest.split('"').next().unwrap().parse::<f64>().unwrap() / fine
            };
            let (x, y) = (at("x"), at("y"));
            let end = x % panel + letter * name.chars().count() as f64;
            assert!(end < panel, "{name} at {x} ends at {end}");
            places.push((x >= panel, y));
        }
    }
    let of_panel = |right| places.iter().filter(move |place| place.0 == right);
    assert_eq!((of_panel(false).count(), of_panel(true).count()), (4, 4), "{places:?}");
    let rows: BTreeSet<u64> = places.iter().map(|place| place.1.to_bits()).collect();
    assert_eq!(rows.len(), 2, "{places:?}");
}

#[test]
fn wrong_arguments_end_in_one_message_and_status_2() {
    let directory = tempfile::tempdir().unwrap();
    let empty = directory.path().to_str().unwrap();
    for (arguments, expected) in [
        (vec!["section-3", empty], "holds no run"),
        (vec!["section-3", "no/such/folder"], "holds no run"),
        (vec!["section-3", empty, "Cargo.toml"], "unexpected argument"),
        (vec!["section-3", empty, "--region", "0,1,0"], "six numbers"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_lai2021")).args(&arguments).output().unwrap();
        let message = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(expected), "{arguments:?}: {message}");
        assert!(!message.contains("panicked"), "{message}");
    }
}
