//! Tables of packings: erosion ratio and stiffness, rest, shape.

use super::cases::{Case, each, settle};
use super::plot::Plot;
use super::table::{Table, general};
use super::{Files, Plan};
use crate::packed::Packed;
use crate::simulation::Signals;
use crate::spread::Spread;
use crate::triaxial::Method;
use crate::triaxial::run::Pick;
use crate::triaxial::stages::Words;
use anyhow::{Context, Result, ensure};
use dem_mpi::contact::{self, ErodedGjk};
use dem_mpi::math::Vec3;
use dem_mpi::pairs::resolve;
use dem_mpi::post::Settings;
use dem_mpi::post::region::{Bounds, Region};
use dem_mpi::post::report::Summary;
use dem_mpi::post::series::{self, Choice};
use std::path::Path;

const CASE: &str = "method,erosion_ratio,stiffness_n_per_m,seed";
const CASE_KEYS: [&str; 3] = ["method", "erosion_ratio", "stiffness_n_per_m"];

/// Settings of a box that repeats along x and y.
fn periodic() -> Words {
    let mut words = Words::default();
    words.set("domain.periodic", "[true, true, false]");
    words.set("domain.walls", r#"["-z"]"#);
    words
}

/// Settings with twice the gravity of the paper's packing, for half as many layers: the same stress at the floor, which
/// determines the overlaps.
fn half() -> Words {
    let mut words = periodic();
    words.set("fill.rain.count", GRAINS);
    words.set("stop.unbalanced", 0.03);
    words.set("domain.high", "[0.02, 0.02, 0.09]");
    words.set("gravity", "[0.0, 0.0, -19.62]");
    words.set("fill.rain.low", "[0.0, 0.0, 0.07]");
    words.set("fill.rain.high", "[0.02, 0.02, 0.09]");
    words
}

/// Number of particles of [`half`].
const GRAINS: u32 = 600;

/// Runs packings in separate folders to their rest. With GJK before erosion, forces jump at touch, and a packing never comes
/// to rest: it has `restless` steps. A packing with erosion alone does not quite rest either: it stops at the unbalanced
/// force `shaking`, if given.
fn settle_all(
    plan: &Plan,
    folder: &Path,
    cases: &[Case],
    scene: &Words,
    restless: &str,
    shaking: Option<f64>,
    signals: &Signals,
) -> Result<()> {
    each(plan.jobs, cases, signals, |case| {
        let mut words = scene.clone();
        words.set("seed", case.seed);
        let method = if case.method.is_erosion() { "gjk-erosion" } else { case.method.folder() };
        words.set("contact.method", method);
        if case.method.is_erosion() {
            words.set("contact.erosion_ratio", case.ratio);
            words.set("contact.tolerance", "1e-8");
        }
        if case.method == Method::CheckedErosion {
            words.set("contact.spurious", false);
            words.set("time.steps", restless);
        }
        if let Some(shaking) = shaking.filter(|_| case.method == Method::Erosion) {
            words.set("stop.unbalanced", shaking);
        }
        words.set_stiffness(case.stiffness);
        settle(&folder.join(case.name("_")), &words, signals)
    })
}

/// Numbers of a snapshot as cells.
fn measured(folder: &Path, choice: &Choice, picks: &[Pick]) -> Result<Vec<String>> {
    let newest = series::newest(folder)?;
    let newest = series::reports(&series::open(&[newest])?, choice)?;
    let summary = &newest.reports.last().context("a report")?.summary;
    let cell = |pick: &Pick| pick(summary).map_or_else(String::new, |value| general(value, 5));
    Ok(picks.iter().map(cell).collect())
}

/// Packings by erosion ratio and stiffness.
pub(super) fn erosion(plan: &Plan, out: &Path, signals: &Signals) -> Result<Files> {
    const PICKS: [Pick; 6] = [
        |s| s.coordination,
        |s| s.share_below_0_3_mean,
        |s| s.solid_fraction,
        |s| s.mean_normal_force_n,
        |s| s.a_c,
        |s| s.unbalanced_force_ratio,
    ];
    let mut cases = Vec::new();
    for seed in 1..=plan.seeds {
        for stiffness in ["1.5e5", "1.5e4"] {
            let case = |method, ratio| Case { method, ratio, stiffness, seed };
            cases.push(case(Method::CommonNormal, "0"));
            cases.push(case(Method::CheckedErosion, "0.05"));
            cases.extend(["0.01", "0.02", "0.05", "0.1"].map(|ratio| case(Method::Erosion, ratio)));
        }
    }
    let folder = out.join("erosion");
    settle_all(plan, &folder, &cases, &half(), "70_000", None, signals)?;
    let mut table = Table::new(&format!(
        "{CASE},coordination,share_below_0_3_mean,solid_fraction,mean_normal_force_n,a_c,unbalanced_force_ratio,\
         true_contacts,eroded_contacts,lost,spurious,coordination_of_true,excess_over_mean_overlap"
    ));
    let mut overlaps = Table::new(&format!("{CASE},true_overlap_over_mean_from,eroded_contacts"));
    let mut spurious = Table::new("erosion_ratio,stiffness,spurious_share");
    for case in &cases {
        let here = folder.join(case.name("_"));
        let both = BothWays::of(&Packed::read(&series::newest(&here)?)?, case)?;
        let cells = measured(&here, &Choice::default(), &PICKS)?;
        table.push(&case.name(","), cells.into_iter().chain(both.cells()));
        for (from, count) in both.histogram() {
            overlaps.push(&case.name(","), [format!("{from:.1}"), count.to_string()]);
        }
        if case.method == Method::Erosion {
            let share = both.spurious as f64 / both.eroded.len() as f64;
            let name = format!("{},{}", case.ratio, case.stiffness);
            spurious.push(&name, [general(share, 6)]);
        }
    }
    let values = [
        "coordination",
        "share_below_0_3_mean",
        "solid_fraction",
        "unbalanced_force_ratio",
        "coordination_of_true",
    ];
    let means = table.means(&CASE_KEYS, &values)?;
    let spurious = spurious.means(&["erosion_ratio", "stiffness"], &["spurious_share"])?;
    let plot = Plot {
        x: "erosion_ratio",
        y: "spurious_share",
        by: "stiffness",
        range: [0.0, 0.5],
        curve: None,
    };
    Ok(vec![
        ("erosion.csv".into(), table.text()),
        ("overlaps.csv".into(), overlaps.text()),
        ("erosion_means.csv".into(), means.text()),
        ("spurious.svg".into(), plot.svg(&spurious)?),
        ("spurious.csv".into(), spurious.text()),
    ])
}

/// Results of the common normal, which is exact, and of erosion for the same pairs.
struct BothWays {
    /// Number of contacts by the common normal.
    touching: usize,
    /// Number of these that erosion does not find.
    lost: usize,
    /// True overlap of each contact found by erosion [m].
    eroded: Vec<f64>,
    /// Number of contacts by erosion that are not contacts.
    spurious: usize,
    /// Sum of the overlaps by erosion [m].
    sum: f64,
    /// Sum of the excess of these overlaps [m].
    excess: f64,
}

impl BothWays {
    fn of(packed: &Packed, case: &Case) -> Result<Self> {
        let ratio = if case.method == Method::Erosion { case.ratio.parse()? } else { 0.05 };
        let erosion = ErodedGjk { ratio, tolerance: 1e-8, ..ErodedGjk::default() };
        let pairs = packed.pairs()?;
        let overlaps = |method: &contact::Method| -> Vec<f64> {
            let answers = resolve(&pairs, method).into_iter();
            answers.map(|answer| answer.touch.map_or(0.0, |touch| touch.overlap)).collect()
        };
        let truth = overlaps(&contact::Method::CommonNormal);
        let eroded = overlaps(&contact::Method::GjkErosion(erosion));
        let mut both = Self {
            touching: truth.iter().filter(|&&overlap| overlap > 0.0).count(),
            lost: 0,
            eroded: Vec::new(),
            spurious: 0,
            sum: 0.0,
            excess: 0.0,
        };
        for (&truth, eroded) in truth.iter().zip(eroded) {
            if eroded > 0.0 {
                both.eroded.push(truth);
                both.spurious += usize::from(truth <= 0.0);
                both.sum += eroded;
                both.excess += eroded - truth;
            } else {
                both.lost += usize::from(truth > 0.0);
            }
        }
        Ok(both)
    }

    fn cells(&self) -> [String; 6] {
        let counts = [self.touching, self.eroded.len(), self.lost, self.spurious];
        let [touching, eroded, lost, spurious] = counts.map(|count| count.to_string());
        let each = 2.0 * self.touching as f64 / f64::from(GRAINS);
        [touching, eroded, lost, spurious, general(each, 5), general(self.excess / self.sum, 5)]
    }

    /// Number of contacts by erosion in each bin of the true overlap over the mean overlap by erosion: lower edge and count,
    /// bins of a fifth.
    fn histogram(&self) -> impl Iterator<Item = (f64, usize)> {
        let mean = self.sum / self.eroded.len() as f64;
        (-10..20).map(move |bin| {
            let is_in = |truth: &&f64| (5.0 * **truth / mean).floor() == f64::from(bin);
            (f64::from(bin) / 5.0, self.eroded.iter().filter(is_in).count())
        })
    }
}

/// Approach to rest of a packing, and its Z: with 600 particles as in [`erosion`], but twice as long; with 5,120 as in the
/// paper.
pub(super) fn rest(plan: &Plan, out: &Path, signals: &Signals) -> Result<Files> {
    let (scene, shaking) =
        if plan.grains == GRAINS { (half(), None) } else { (Words::default(), Some(0.05)) };
    let mut cases = Vec::new();
    for seed in 1..=plan.seeds {
        let kinds = [
            (Method::CommonNormal, "0"),
            (Method::Erosion, "0.05"),
            (Method::CheckedErosion, "0.05"),
        ];
        let case = |(method, ratio)| Case { method, ratio, stiffness: "1.5e5", seed };
        cases.extend(kinds.map(case));
    }
    let folder = out.join(format!("rest-{}", plan.grains));
    settle_all(plan, &folder, &cases, &scene, "150_000", shaking, signals)?;
    let mut curves = Table::new(&format!("{CASE},step,time_s,coordination,unbalanced"));
    let mut ends = Table::new(&format!(
        "{CASE},steps,coordination_at_the_end,mean,deviation_in_time,least,most,unbalanced_at_the_end,unbalanced_mean"
    ));
    for case in &cases {
        let path = folder.join(case.name("_")).join("history.csv");
        settling(&Table::read(&path)?, plan.grains, &case.name(","), &mut curves, &mut ends)
            .with_context(|| path.display().to_string())?;
    }
    let values = [
        "coordination_at_the_end",
        "mean",
        "deviation_in_time",
        "unbalanced_at_the_end",
        "unbalanced_mean",
    ];
    let means = ends.means(&CASE_KEYS, &values)?;
    // One packing of each kind, so that a curve has one colour.
    let one = curves.with("seed", "1")?;
    let plot =
        |y, high| Plot { x: "time_s", y, by: "method", range: [0.0, high], curve: Some(0.2) };
    let name = |rest: &str| format!("rest_{}{rest}", plan.grains);
    Ok(vec![
        (name(".csv"), curves.text()),
        (name("_ends.csv"), ends.text()),
        (name("_means.csv"), means.text()),
        (name(".svg"), plot("coordination", 10.0).svg(&one)?),
        (name("_unbalanced.svg"), plot("unbalanced", 2.0).svg(&one)?),
    ])
}

/// Rows from the history of a packing. `curves` gets Z of contacts between particles and the mean resultant force over the
/// mean contact force, at every tenth row of the history. `ends` gets their values over the last quarter of the steps since
/// all particles are present.
fn settling(
    history: &Table,
    grains: u32,
    name: &str,
    curves: &mut Table,
    ends: &mut Table,
) -> Result<()> {
    let column = |name: &str| -> Result<Vec<f64>> {
        let cells = history.numbers(name)?.into_iter();
        cells.collect::<Option<_>>().with_context(|| format!("{name}: a cell without a number"))
    };
    let (step, time, force) = (column("step")?, column("time_s")?, column("unbalanced")?);
    let (particles, contacts) = (column("particles")?, column("contacts")?);
    let rows: Vec<usize> = (0..step.len()).filter(|&row| particles[row] > 0.0).collect();
    let z = |row: usize| 2.0 * contacts[row] / particles[row];
    for &row in rows.iter().step_by(10) {
        let cells = [general(time[row], 5), general(z(row), 5), general(force[row], 4)];
        curves.push(&format!("{name},{}", step[row]), cells);
    }
    let full = rows.iter().find(|&&row| particles[row] == f64::from(grains));
    let (&full, &last) = full.zip(rows.last()).context("not all grains have fallen")?;
    let begin = step[full] + 0.75 * (step[last] - step[full]);
    let late: Vec<usize> =
        rows.iter().copied().rev().take_while(|&row| step[row] >= begin).collect();
    let values: Vec<f64> = late.iter().map(|&row| z(row)).collect();
    let Spread { mean, deviation, .. } = Spread::of(&values);
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let most = values.iter().copied().fold(0.0, f64::max);
    let forces = late.iter().map(|&row| force[row]).sum::<f64>() / late.len() as f64;
    let cells = [
        general(z(last), 5),
        general(mean, 5),
        general(deviation, 2),
        general(least, 5),
        general(most, 5),
        general(force[last], 4),
        general(forces, 4),
    ];
    ends.push(&format!("{name},{}", step[last]), cells);
    ensure!(!late.is_empty(), "no rows");
    Ok(())
}

/// Packings of spheroids of one volume by shape. The density is less than half the paper's: overlaps of some 1e-4 of the
/// diameter do not affect the solid fraction. Measured from three diameters above the floor to as far below the top of the
/// densest packing.
pub(super) fn aspect(plan: &Plan, out: &Path, signals: &Signals) -> Result<Files> {
    const RATIOS: [&str; 10] = ["0.4", "0.5", "0.6", "0.8", "1", "1.25", "1.5", "1.8", "2.2", "3"];
    const FRICTIONS: [&str; 2] = ["0", "0.3"];
    const PICKS: [Pick; 6] = [
        |s| s.solid_fraction,
        |s| s.coordination,
        |s| s.mechanical_coordination,
        |s: &Summary| Some(s.rattlers as f64),
        |s: &Summary| Some(s.particles as f64),
        |s| s.unbalanced_force_ratio,
    ];
    let mut scene = periodic();
    scene.set("fill.rain.count", 800);
    scene.set("stop.unbalanced", 0.02);
    scene.set("time.steps", "150_000");
    scene.set("domain.high", "[0.021, 0.021, 0.1]");
    scene.set("fill.rain.low", "[0.0, 0.0, 0.07]");
    scene.set("fill.rain.high", "[0.021, 0.021, 0.1]");
    scene.set("fill.rain.velocity", "[0.0, 0.0, -1.5]");
    scene.set("material.grain.density", "1e5");
    scene.set("material.grain.restitution", 0.5);
    scene.set("output.snapshot_every", 0);
    let folder = |ratio: &str, friction: &str, seed: u64| {
        out.join("aspect").join(format!("{ratio}_{friction}_{seed}"))
    };
    let mut cases = Vec::new();
    for seed in 1..=plan.seeds {
        for friction in FRICTIONS {
            cases.extend(RATIOS.map(|ratio| (ratio, friction, seed)));
        }
    }
    each(plan.jobs, &cases, signals, |&(ratio, friction, seed)| {
        let mut words = scene.clone();
        words.set("seed", seed);
        words.set("shape.grain.aspect_ratio", ratio);
        words.set("material.grain.friction", friction);
        settle(&folder(ratio, friction, seed), &words, signals)
    })?;
    let mut table = Table::new(
        "aspect_ratio,friction,seed,solid_fraction,coordination,mechanical_coordination,rattlers,particles,\
         unbalanced_force_ratio",
    );
    let middle = Bounds { low: Vec3::new(0.0, 0.0, 0.009), high: Vec3::new(0.021, 0.021, 0.027) };
    let settings = Settings { region: Region::Box(middle), ..Settings::default() };
    let choice = Choice { settings, margin: None };
    for friction in FRICTIONS {
        for ratio in RATIOS {
            for seed in 1..=plan.seeds {
                let cells = measured(&folder(ratio, friction, seed), &choice, &PICKS)?;
                table.push(&format!("{ratio},{friction},{seed}"), cells);
            }
        }
    }
    let values = ["solid_fraction", "coordination", "mechanical_coordination"];
    let means = table.means(&["aspect_ratio", "friction"], &values)?;
    let plot = |y, range| Plot { x: "aspect_ratio", y, by: "friction", range, curve: None };
    Ok(vec![
        ("aspect.csv".into(), table.text()),
        ("aspect_means.csv".into(), means.text()),
        ("solid_fraction.svg".into(), plot("solid_fraction", [0.55, 0.75]).svg(&means)?),
        ("coordination.svg".into(), plot("coordination", [4.0, 10.0]).svg(&means)?),
    ])
}
