//! Stiffness of a periodic cell: `dem-mpi --probe`.
//!
//! The cell is strained by each of its six components, both ways, from one state. The strain comes uniformly over
//! four times in which a wave crosses the cell, and the particles then come to rest under a global damping that is
//! critical for the longest wave. With `σ±` for the stress at rest, `C_ij = (σ_i⁺ - σ_i⁻) / 2ε_j`.

use super::assemble::{self, Continuation, StartError};
use super::{Control, Scene};
use crate::comm::Comm;
use crate::drive::element::{Goal, gradient, name_of};
use crate::measure::COMPONENTS;
use crate::sim::{Simulation, StepError};
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

/// Times in which the strain grows, in times in which a wave crosses the cell.
const STRAINING: u64 = 4;
/// Most of these times in which the particles come to rest.
const RESTING: u64 = 60;
/// Largest change of the stress in such a time, over that by the strain, at which the particles rest.
const REST: f64 = 1e-5;

/// Reason for a missing result.
#[derive(Debug, thiserror::Error)]
pub enum ProbeError {
    /// The cell is not periodic along each axis, or no contact has a stiffness.
    #[error("--probe: {0}")]
    Scene(String),
    /// The snapshot does not fit the scene.
    #[error(transparent)]
    Start(#[from] StartError),
    /// A step failed.
    #[error(transparent)]
    Step(#[from] StepError),
}

/// Stiffness of a cell.
#[derive(Clone, Debug, PartialEq)]
pub struct Probe {
    /// Strain of each component [-].
    pub strain: f64,
    /// Stress in the state, by [`COMPONENTS`], compression positive [Pa].
    pub stress: [f64; 6],
    /// Stress by row over strain by column [Pa]; shear strains are angles.
    pub stiffness: [[f64; 6]; 6],
    /// Largest difference between responses to both ways of a strain, over the largest response [-].
    pub uneven: f64,
    /// Largest change of a stress in the last time of a wave, over that by the strain [-].
    pub unrest: f64,
}

/// Strains a cell and measures its stiffness. The state is that of a snapshot, or of the scene's start. Collective.
///
/// # Errors
/// See [`ProbeError`].
pub fn probe(
    scene: &Scene,
    start: Option<&Path>,
    strain: f64,
    comm: &mut dyn Comm,
) -> Result<Probe, ProbeError> {
    let is_strained = scene.domain.strained().is_some();
    let domain = if is_strained { Some(scene.domain) } else { scene.domain.at_rest() };
    let Some(domain) = domain else {
        let why = "the domain must be periodic along x, y and z, without `shear`";
        return Err(ProbeError::Scene(why.to_owned()));
    };
    let Some(limit) = scene.time_step_limit() else {
        return Err(ProbeError::Scene("no contact has a stiffness".to_owned()));
    };
    let goals = std::array::from_fn(|_| Goal::Rate(0.0));
    let control = Control { goals, ramp: 0.0, max_rate: 0.0, gain: 1.0 };
    let scene = &Scene { cell: Some(control), domain, ..scene.clone() };
    let mut all =
        Probe { strain, stress: [0.0; 6], stiffness: [[0.0; 6]; 6], uneven: 0.0, unrest: 0.0 };
    let from = start.map(|path| (path, Continuation::NewStage));
    let (mut most, mut uneven) = (0.0_f64, 0.0_f64);
    for along in 0..6 {
        let [more, less] = [strain, -strain].map(|strain| {
            let (mut sim, _) = assemble::started(scene, from, comm)?;
            sim.begin(comm)?;
            all.stress = stress(&sim, comm);
            let (after, unrest) = strained(&mut sim, all.stress, (along, strain), limit.dt, comm)?;
            all.unrest = all.unrest.max(unrest);
            Ok::<_, ProbeError>(after)
        });
        let (more, less) = (more?, less?);
        for (k, row) in all.stiffness.iter_mut().enumerate() {
            row[along] = (more[k] - less[k]) / (2.0 * strain);
            most = most.max(0.5 * (more[k] - less[k]).abs());
            uneven = uneven.max((more[k] + less[k] - 2.0 * all.stress[k]).abs());
        }
    }
    if most == 0.0 {
        return Err(ProbeError::Scene("no particles touch".to_owned()));
    }
    all.uneven = uneven / most;
    Ok(all)
}

/// Stress, compression positive [Pa].
fn stress(sim: &Simulation, comm: &mut dyn Comm) -> [f64; 6] {
    sim.measure(comm).bulk.map_or([0.0; 6], |bulk| bulk.stress())
}

/// Stress after a strain of a component, when the particles have come to rest, and its last change over that since `before`.
/// The stable limit [s] is about the time in which a wave goes one particle further.
fn strained(
    sim: &mut Simulation,
    before: [f64; 6],
    (component, strain): (usize, f64),
    limit: f64,
    comm: &mut dyn Comm,
) -> Result<([f64; 6], f64), ProbeError> {
    let diameter = 2.0 * sim.particles.library.largest_radius();
    let crossing = limit * (sim.particles.cell.sides().max() / diameter).max(1.0);
    let steps = (crossing / sim.dt).ceil().max(1.0) as u64;
    sim.field.damping = 4.0 * PI / (steps as f64 * sim.dt);
    let mut rates = [0.0; 6];
    rates[component] = strain / ((STRAINING * steps) as f64 * sim.dt);
    sim.particles.cell.set_rate(&gradient(&rates));
    for _ in 0..STRAINING * steps {
        sim.step(comm)?;
    }
    sim.particles.cell.set_rate(&gradient(&[0.0; 6]));
    let largest = |one: &[f64; 6], other: &[f64; 6]| {
        one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let (mut last, mut unrest) = (stress(sim, comm), f64::INFINITY);
    for _ in 0..RESTING {
        for _ in 0..steps {
            sim.step(comm)?;
        }
        let now = stress(sim, comm);
        unrest = largest(&now, &last) / largest(&now, &before).max(f64::MIN_POSITIVE);
        last = now;
        if unrest < REST {
            break;
        }
    }
    Ok((last, unrest))
}

impl Probe {
    /// Bulk and shear modulus of the isotropic body with the same mean stiffness (Voigt) [Pa].
    pub fn isotropic(&self) -> [f64; 2] {
        let c = |i: usize, j: usize| 0.5 * (self.stiffness[i][j] + self.stiffness[j][i]);
        let [along, across] = [c(0, 0) + c(1, 1) + c(2, 2), c(0, 1) + c(0, 2) + c(1, 2)];
        let shear = c(3, 3) + c(4, 4) + c(5, 5);
        [(along + 2.0 * across) / 9.0, (along - across + 3.0 * shear) / 15.0]
    }

    /// Page with the matrix and its errors.
    pub fn words(&self) -> String {
        let names: Vec<String> = (0..COMPONENTS.len()).map(name_of).collect();
        let mut text =
            format!("Stiffness at strains of {:e} [Pa], compression positive\n      ", self.strain);
        for name in &names {
            let _ = write!(text, "{name:>13}");
        }
        for (name, row) in names.iter().zip(&self.stiffness) {
            let _ = write!(text, "\n  {name:<4}");
            for value in row {
                let _ = write!(text, "{value:>13.4e}");
            }
        }
        let most =
            self.stiffness.iter().flatten().fold(0.0_f64, |most, value| most.max(value.abs()));
        let lopsided = (0..6).flat_map(|i| (0..i).map(move |j| (i, j)));
        let lopsided = lopsided
            .map(|(i, j)| (self.stiffness[i][j] - self.stiffness[j][i]).abs())
            .fold(0.0, f64::max);
        let [bulk, shear] = self.isotropic();
        let _ = write!(
            text,
            "\n\nisotropic  bulk modulus {bulk:.4e} Pa, shear modulus {shear:.4e} Pa, Poisson's ratio {:.4} (means of Voigt)\n\
             stress     {} Pa\n\
             symmetry   {:.1e}: largest difference across the diagonal over the largest entry\n\
             linearity  {:.1e}: largest difference between compression and extension over the largest response\n\
             rest       {:.1e}: last change of a stress over that by the strain\n",
            (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear),
            self.stress.map(|value| format!("{value:.4e}")).join(" "),
            lopsided / most,
            self.uneven,
            self.unrest,
        );
        text
    }
}
