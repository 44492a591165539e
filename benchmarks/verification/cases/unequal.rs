//! Boxes of unequal size: collisions, one at rest on the other, and a box that overhangs an edge.

use super::faces::{ENERGY, G, Pair, Solid, at_share, cuboid, places, rough_with, step, steps};
use super::setup::begun;
use super::{Case, Effort, Findings, Grain, Plane, Setup};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::Vec3;
use dem_mpi::sim::Simulation;

/// Edges of the small boxes [m]; that of the large one is 1 m.
const EDGES: [f64; 2] = [0.5, 0.1];

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut cases = vec![rest(effort), overhang(effort)];
    if effort == Effort::Full {
        cases.push(collisions());
    }
    Findings { cases, ..Findings::default() }
}

fn cube(edge: f64) -> Solid {
    Solid { name: "cube", corners: cuboid(Vec3::repeat(edge)), radius: 0.0 }
}

fn collisions() -> Case {
    let mut case = Case::new(
        ENERGY,
        "30 random collisions of a box with one of half and of a tenth of its size, a tenth of the stable step",
        "largest change of the kinetic energy (relative)",
        2e-4,
        "the leapfrog at 30 to 50 steps of a contact",
    );
    for edge in EDGES {
        let scaled = |k: f64| Solid {
            name: "box",
            corners: cuboid(Vec3::new(1.0, 0.8, 0.6) * k),
            radius: 0.0,
        };
        let pair = Pair::of_two(&scaled(1.0), &scaled(edge));
        case.absolute(format!("1 : {edge}"), 0.0, pair.changes(30, 0.1)[0]);
    }
    case
}

/// A small and a large cube, one on the other, the upper one off the middle by `off` [m].
fn on_top(edge: f64, small_is_on_top: bool, off: f64, stiffness: f64) -> Simulation {
    let (lower, upper) = if small_is_on_top { (1.0, edge) } else { (edge, 1.0) };
    let (below, above) = if small_is_on_top { ("one", "other") } else { ("other", "one") };
    let setup = Setup {
        gravity: Vec3::z() * -G,
        text: rough_with(stiffness, 0.3, 0.5)
            + &cube(1.0).text_as("one")
            + &cube(edge).text_as("other"),
        planes: vec![Plane::floor("m")],
        grains: vec![
            Grain::at(below, Vec3::z() * (0.5 * lower)),
            Grain::at(above, Vec3::new(off, 0.0, lower + 0.5 * upper)),
        ],
        dt: 0.0,
    };
    begun(&at_share(&setup, 0.8), &mut Alone::default())
}

/// Displacement of the upper cube [m] in this time, or until it has moved by `far`. It follows two seconds with damping.
fn moves(sim: &mut Simulation, time: f64, far: f64) -> f64 {
    sim.field.damping = 20.0;
    steps(sim, 2.0);
    sim.field.damping = 0.0;
    let before = places(sim)[1].1;
    let end = sim.time() + time;
    let way = |sim: &Simulation| (places(sim)[1].1 - before).norm();
    while sim.time() < end && way(sim) < far {
        step(sim);
    }
    way(sim).min(far)
}

fn rest(effort: Effort) -> Case {
    let mut case = Case::new(
        ENERGY,
        "a cube on one of another size, brought to rest and then left without damping",
        "way of the upper one in 2 s (edges of the small one)",
        1e-6,
        "at rest",
    );
    for &edge in effort.pick(&EDGES[..1], &EDGES) {
        for (small_is_on_top, what) in [(true, "small on large"), (false, "large on small")] {
            let mut sim = on_top(edge, small_is_on_top, 0.1 * edge, 1e8);
            let way = moves(&mut sim, effort.pick(0.2, 2.0), edge);
            case.absolute(format!("1 : {edge}, {what}"), 0.0, way / edge);
        }
    }
    case
}

/// A cube with its middle inside the edge stays; with its middle beyond the edge it falls.
fn overhang(effort: Effort) -> Case {
    let mut case = Case::new(
        "closed form (statics)",
        "a cube that overhangs the edge of another, its middle 2 % of the small one's size this side of the edge or beyond",
        "way of the upper one in 3 s, at most a tenth of its edge (tenths of its edge)",
        1e-5,
        "one that stays is at rest; one that falls is watched until it has gone a tenth",
    );
    for &edge in effort.pick(&EDGES[..1], &EDGES) {
        for (small_is_on_top, what) in [(true, "small on large"), (false, "large on small")] {
            let (lower, upper) = if small_is_on_top { (1.0, edge) } else { (edge, 1.0) };
            // On a small face, a softer contact would let the large cube lean out by more than that.
            let stiffness = if small_is_on_top { 1e8 } else { 1e9 };
            for (side, name, falls) in [(-0.02, "this side", 0.0), (0.02, "beyond", 1.0)] {
                let off = 0.5 * lower + side * edge;
                let mut sim = on_top(edge, small_is_on_top, off, stiffness);
                let far = 0.1 * upper;
                let way = moves(&mut sim, effort.pick(1.0, 3.0), far) / far;
                case.absolute(format!("1 : {edge}, {what}, {name}"), falls, way);
            }
        }
    }
    case
}
