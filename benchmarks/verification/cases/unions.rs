//! Bodies of several pieces: elastic collisions, and dimers that jam.

use super::faces::{ENERGY, Pair};
use super::packing::{apart, vanishing};
use super::setup::{begun, parse};
use super::{Case, Curve, Effort, Findings, Grain, Picture};
use benchmarking::grains::csv;
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::Quat;
use dem_mpi::random::Random;
use dem_mpi::sim::Simulation;
use std::f64::consts::PI;
use std::fmt::Write;

const BAULE: &str = "Baule et al. 2013, 10.1038/ncomms3194";

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut findings = Findings::default();
    collisions(effort, &mut findings);
    if effort == Effort::Full {
        dimers(&mut findings);
    }
    findings
}

/// The last two represent round pieces that form one body, and a body cut from a mesh.
const NAMES: [&str; 5] = ["L", "T", "jack", "dimer", "stone"];

/// Bodies about 1 m long.
fn shapes() -> String {
    let mut text = "[[shape]]\nname = \"cube\"\nkind = \"polyhedron\"\nedges = [0.4, 0.4, 0.4]\n\
                    [[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.4\n"
        .to_owned();
    let cubes = |places: &[[i32; 3]]| {
        let place = |at: &[i32; 3]| {
            let at = at.map(|x| 0.4 * f64::from(x));
            format!("{{ shape = \"cube\", at = {at:?} }}")
        };
        places.iter().map(place).collect::<Vec<_>>().join(", ")
    };
    let ell = cubes(&[[0, 0, 0], [1, 0, 0], [0, 1, 0]]);
    let tee = cubes(&[[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0]]);
    let arms = [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
    let dimer = "{ shape = \"ball\" }, { shape = \"ball\", at = [0.3, 0, 0] }".to_owned();
    for (name, pieces) in NAMES.into_iter().zip([ell, tee, cubes(&arms), dimer]) {
        write!(text, "[[shape]]\nname = \"{name}\"\nkind = \"union\"\npieces = [{pieces}]\n")
            .expect("text");
    }
    let stone = concat!(env!("CARGO_MANIFEST_DIR"), "/run/stones/stone.obj");
    write!(
        text,
        "[[shape]]\nname = \"stone\"\nkind = \"union\"\nfile = {stone:?}\nscale = 0.12\npieces = 8\n"
    )
    .expect("text");
    text
}

/// Twelve collisions of each pair of kinds.
fn collisions(effort: Effort, findings: &mut Findings) {
    let each = effort.pick(1, 12);
    let mut cases = [(0.1, 2e-4, "a tenth"), (0.025, 1e-5, "a fortieth")].map(|(share, allowed, words)| {
        let what = format!("{} random collisions of L, T, jacks, dimers and stones, e = 1, {words} of the stable step", 15 * each);
        let why = "the leapfrog; it falls with the square of the step";
        (share, Case::new(ENERGY, what, "largest change of the kinetic energy (relative)", allowed, why))
    });
    for (k, one) in NAMES.into_iter().enumerate() {
        for other in &NAMES[k..] {
            let pair = Pair::with(&shapes(), [one, other]);
            for (share, case) in &mut cases {
                case.absolute(format!("{one} and {other}"), 0.0, pair.changes(each, *share)[0]);
            }
        }
    }
    // The tolerance is the requested accuracy; the record lists the deviation of each pair.
    let short = "in dents and at seams contacts begin and end on shorter ways than those of convex bodies, and need shorter steps";
    let told = cases.map(|(_, case)| Case { short_until: Some(short), ..case });
    findings.cases.extend(told);
}

/// Length of dimers over their thickness at which they are densest.
const LONG: f64 = 1.3;
const COUNT: usize = 300;
/// Initial solid fraction.
const LOOSE: f64 = 0.12;

/// Frictionless dimers that grow from random places, and shrink again until the pressure vanishes.
fn dimers(findings: &mut Findings) {
    let mut fraction = Case::new(
        BAULE,
        format!(
            "{COUNT} dimers {LONG} long without friction, grown in a periodic box from random places"
        ),
        "solid fraction where the pressure vanishes",
        0.01,
        "0.707 is of a theory, and packings depend on how they were made",
    );
    let mut curves = Vec::new();
    for seed in 1..=2 {
        let mut random = Random::of(seed, 0);
        let places = apart(COUNT, 1.0, 2.0 * LONG * radius(LOOSE), &mut random);
        let turned = |at| Grain::at("dimer", at).turned(random.rotation());
        let mut grains: Vec<Grain> = places.into_iter().map(turned).collect();
        for solid in [LOOSE, 0.3, 0.45, 0.55, 0.62, 0.66, 0.69] {
            grains = relaxed(solid, 1.0, &grains, 2000).0;
        }
        let (mut points, mut solid) = (Vec::new(), 0.73);
        // Towards the point of zero pressure, each time half of the remaining distance.
        for _ in 0..5 {
            let (after, pressure) = relaxed(solid, 0.1, &grains, 8000);
            grains = after;
            if pressure < 1e-9 {
                break;
            }
            points.push((solid, pressure));
            solid -= 0.5 * (solid - vanishing(&points).unwrap_or(solid - 0.02));
        }
        let found = vanishing(&points).expect("it presses twice at least");
        fraction.absolute(format!("seed {seed}"), 0.707, found);
        curves.push(Curve::new(format!("seed {seed}"), points));
    }
    findings.cases.push(fraction);
    findings.pictures.push(Picture {
        file: "dimers",
        axes: ["solid fraction", "pressure (stiffness/length)"],
        is_logarithmic: false,
        curves,
    });
}

/// Radius of each of the two balls of a dimer, when dimers fill this part of the box [m]. Their centres are `2 (LONG - 1)` radii
/// apart; the lens that they share counts once.
fn radius(solid: f64) -> f64 {
    let apart = 2.0 * (LONG - 1.0);
    let lens = PI * (4.0 + apart) * (2.0 - apart).powi(2) / 12.0;
    (solid / COUNT as f64 / (8.0 / 3.0 * PI - lens)).cbrt()
}

/// Dimers of unit mass and stiffness that fill this part of a periodic box of 1 m, after this number of steps, and their
/// pressure.
fn relaxed(solid: f64, damping: f64, grains: &[Grain], steps: usize) -> (Vec<Grain>, f64) {
    let (volume, radius) = (solid / COUNT as f64, radius(solid));
    let half = (LONG - 1.0) * radius;
    let text = format!(
        r#"global_damping = {damping:e}
[domain]
low = [0, 0, 0]
high = [1, 1, 1]
periodic = [true, true, true]
[[material]]
name = "m"
density = {:e}
normal_stiffness = 1.0
[[shape]]
name = "ball"
kind = "sphere"
radius = {radius:e}
[[shape]]
name = "dimer"
kind = "union"
pieces = [{{ shape = "ball", at = [{:e}, 0, 0] }}, {{ shape = "ball", at = [{half:e}, 0, 0] }}]
[[fill.file]]
path = "grains.csv"
[time]
step = 0.1
steps = 1
[output]
directory = "out"
"#,
        1.0 / volume,
        -half
    );
    let mut sim = begun(&parse(&text, &csv(grains)), &mut Alone::default());
    for _ in 0..steps {
        sim.step(&mut Alone::default()).unwrap_or_else(|error| panic!("{error}"));
    }
    (grains_of(&sim), pressure(&sim))
}

fn grains_of(sim: &Simulation) -> Vec<Grain> {
    let particles = &sim.particles;
    let turns: &[Quat] = particles.orientation.as_ref().map_or(&[], |all| &all.quaternion);
    let mut slots: Vec<usize> = (0..particles.owned).collect();
    slots.sort_by_key(|&slot| particles.id[slot]);
    let grain = |slot: usize| Grain::at("dimer", particles.position[slot]).turned(turns[slot]);
    slots.into_iter().map(grain).collect()
}

/// A third of the sum of force times branch over the volume, 1 m³.
fn pressure(sim: &Simulation) -> f64 {
    let table = sim.contact_table();
    let force = |k: usize| table.normal[k] * table.normal_force[k] + table.shear_force[k];
    (0..table.a.len()).map(|k| table.branch[k].dot(&force(k))).sum::<f64>() / 3.0
}
