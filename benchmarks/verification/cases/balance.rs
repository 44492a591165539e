//! Poured solids: their energy balance, and their approach to equilibrium as requested by
//! `[stop] unbalanced = 1e-3`.

use super::faces::{ENERGY, boxes, pouring, rods, solids, stack, step, steps};
use super::setup::seen;
use super::{Case, Drawing, Effort, Findings};
use dem_mpi::comm::alone::Alone;
use dem_mpi::sim::Simulation;

/// Cases whose final states are drawn.
const PILE: &str = "54 boxes poured into a box";
const STACK: &str = "stack of 10 boxes dropped from 1 mm";

/// Longest simulated time [s].
const AT_MOST: f64 = 30.0;

/// Runs all cases.
pub(crate) fn run(effort: Effort) -> Findings {
    let mut case = Case::new(
        ENERGY,
        "solids that fall, friction 0.3, restitution 0.3, with contact damping alone and with global damping of 1/s",
        "time until the unbalanced force is 1e-3 of the mean contact force (s), over 30 s",
        1.0,
        "asked for is that it is reached",
    );
    let mut drawings = Vec::new();
    for damping in effort.pick(vec![0.0], vec![0.0, 1.0]) {
        let mut scenes = vec![
            ("27 boxes poured into a box", pouring(&boxes(), 3, 3, 0.8)),
            ("27 rods poured into a box", pouring(&rods(), 3, 3, 0.8)),
        ];
        if effort == Effort::Full {
            let rounded = solids().pop().expect("a rounded box");
            scenes.push((PILE, pouring(&boxes(), 3, 6, 0.8)));
            scenes.push(("27 rounded boxes poured into a box", pouring(&rounded, 3, 3, 0.8)));
            scenes.push((STACK, stack(10)));
        }
        for (what, mut sim) in scenes {
            sim.field.damping = damping;
            let time = balanced(&mut sim);
            case.over(AT_MOST, format!("{what}, global damping {damping}"), 0.0, time);
            if damping == 0.0 && [PILE, STACK].contains(&what) {
                let file = if what == PILE { "pile" } else { "stack" };
                drawings.push(Drawing { file, title: what, svg: seen(&sim).svg(None) });
            }
        }
    }
    Findings { cases: vec![packing(effort), case], drawings, ..Findings::default() }
}

/// Energy that solids lose in a box, and its energy error.
fn packing(effort: Effort) -> Case {
    let mut case = Case::new(
        ENERGY,
        format!("{} solids poured into a box, friction 0.3, restitution 0.3", effort.pick(27, 108)),
        "energy missing, over what is dissipated, over what is asked for (0.5 % at the limit, 0.1 % at 40 % of it)",
        1.0,
        "the leapfrog at a few steps of a contact; of second order",
    );
    let icosahedra = || solids().swap_remove(3);
    let solids = effort.pick(vec![boxes(), rods()], vec![boxes(), icosahedra(), rods()]);
    for solid in &solids {
        for (share, allowed) in effort.pick(vec![(1.0, 5e-3)], vec![(1.0, 5e-3), (0.4, 1e-3)]) {
            let mut sim = pouring(solid, 3, effort.pick(3, 12), share);
            steps(&mut sim, effort.pick(2.0, 6.0));
            let measures = sim.measure(&mut Alone::default());
            let missing = measures.missing() / measures.dissipated / allowed;
            case.absolute(format!("{}, {share} of the limit", solid.name), 0.0, missing);
        }
    }
    case
}

/// Time at which the balance is reached [s]; infinity if it never is.
fn balanced(sim: &mut Simulation) -> f64 {
    while sim.time() < AT_MOST {
        // At the interval of checks in a run.
        (0..100).for_each(|_| step(sim));
        let measures = sim.measure(&mut Alone::default());
        if measures.mean_normal_force > 0.0 && measures.unbalanced < 1e-3 {
            return sim.time();
        }
    }
    f64::INFINITY
}
