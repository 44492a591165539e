//! Distribution of contact forces (fig. 13 of Lai et al. 2021), and mobilised friction.
//!
//! Contacts between particles only, unless requested otherwise. Normal and tangential forces are divided by the mean normal force
//! `<f_n>`, which takes a first pass.

use super::PostError;
use super::fabric::Among;
use super::region::Members;
use super::sums::quotient;
use crate::math::ExactSum;
use crate::output::header::Header;
use crate::output::tables::{ContactTable, ParticleTable};
use serde::{Deserialize, Serialize};

/// Sums of normal and resultant forces: the first pass.
#[derive(Clone, Debug, Default)]
pub struct MeanForceSum {
    among: Among,
    halves: u64,
    normal: ExactSum,
    resultant: ExactSum,
    particles: u64,
}

impl MeanForceSum {
    /// An empty sum.
    pub fn new(among: Among) -> Self {
        Self { among, ..Self::default() }
    }

    /// Adds the resultant of contacts and gravity on these particles.
    ///
    /// # Errors
    /// If `members` does not have the particle.
    pub fn add(
        &mut self,
        header: &Header,
        particles: &ParticleTable,
        members: &Members,
    ) -> Result<(), PostError> {
        for (row, &id) in particles.id.iter().enumerate() {
            if members.holds(id)? {
                let shape = &header.shapes[particles.shape[row].index()];
                let mass = shape.mass * particles.volume_ratio(row);
                self.resultant.add((particles.force[row] + header.gravity * mass).norm());
                self.particles += 1;
            }
        }
        Ok(())
    }

    /// Adds contacts.
    ///
    /// # Errors
    /// If a contact refers to a particle that does not exist.
    pub fn add_contacts(
        &mut self,
        contacts: &ContactTable,
        members: &Members,
    ) -> Result<(), PostError> {
        self.among.each(contacts, members, |row, halves| {
            self.halves += halves;
            self.normal.add(0.5 * halves as f64 * contacts.normal_force[row]);
        })
    }

    /// Mean normal force `<f_n>` [N]; `None` without contacts.
    pub fn mean_normal_force(&self) -> Option<f64> {
        quotient(self.normal.value(), 0.5 * self.halves as f64)
    }

    /// Mean resultant force on a particle, gravity included, over the mean normal force: a distance from equilibrium. `None` if
    /// the mean normal force is not compressive.
    pub fn unbalanced_ratio(&self) -> Option<f64> {
        let resultant = quotient(self.resultant.value(), self.particles as f64)?;
        quotient(resultant, self.mean_normal_force().filter(|&mean| mean > 0.0)?)
    }
}

/// Counts in bins. A contact across the border of the region counts half.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Histogram {
    /// Edges of the bins, ascending, one more than bins.
    pub edges: Vec<f64>,
    /// Half contacts in each bin, `edges[k] <= value < edges[k + 1]`.
    pub halves: Vec<u64>,
    /// Half contacts below the first edge.
    pub halves_below: u64,
    /// Half contacts at the last edge and above.
    pub halves_above: u64,
}

impl Histogram {
    /// `bins` bins of one width from 0 to `end`.
    pub fn linear(bins: u32, end: f64) -> Self {
        Self::with_edges((0..=bins).map(|k| end * f64::from(k) / f64::from(bins)).collect())
    }

    /// `per_decade` bins per factor of ten from `10^first` to `10^last`.
    pub fn logarithmic(per_decade: i32, first: i32, last: i32) -> Self {
        let exponents = first * per_decade..=last * per_decade;
        Self::with_edges(
            exponents.map(|k| 10f64.powf(f64::from(k) / f64::from(per_decade))).collect(),
        )
    }

    fn with_edges(edges: Vec<f64>) -> Self {
        Self { halves: vec![0; edges.len() - 1], edges, halves_below: 0, halves_above: 0 }
    }

    fn add(&mut self, value: f64, halves: u64) {
        let edges_reached = self.edges.partition_point(|&edge| edge <= value);
        match edges_reached.checked_sub(1) {
            None => self.halves_below += halves,
            Some(bin) if bin < self.halves.len() => self.halves[bin] += halves,
            Some(_) => self.halves_above += halves,
        }
    }

    /// Number of all half contacts, in and out of the bins.
    pub fn total_halves(&self) -> u64 {
        self.halves.iter().sum::<u64>() + self.halves_below + self.halves_above
    }

    /// Share at the last edge and above, not in the bins; `None` if it is zero.
    pub fn share_above(&self) -> Option<f64> {
        quotient(self.halves_above as f64, self.total_halves() as f64).filter(|&share| share > 0.0)
    }

    /// Geometric middle of each bin and its share per factor of ten. For logarithmic bins the integral over the decimal logarithm
    /// of all values is 1.
    pub fn share_per_decade(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let total = self.total_halves() as f64;
        self.halves.iter().zip(self.edges.windows(2)).map(move |(&halves, edge)| {
            let decades = libm::log10(edge[1] / edge[0]);
            let share = quotient(halves as f64, total * decades).unwrap_or(0.0);
            ((edge[0] * edge[1]).sqrt(), share)
        })
    }

    /// Middle of each bin and its probability density: the integral over all values is 1.
    pub fn density(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let total = self.total_halves() as f64;
        self.halves.iter().zip(self.edges.windows(2)).map(move |(&halves, edge)| {
            let density = quotient(halves as f64, total * (edge[1] - edge[0])).unwrap_or(0.0);
            (0.5 * (edge[0] + edge[1]), density)
        })
    }
}

/// A contact is weak if its normal force is below this share of the mean (Lai et al. 2021, section 3.4).
pub const WEAK: f64 = 0.3;

/// Counts of contacts by force: the second pass.
#[derive(Clone, Debug)]
pub struct ForceCount {
    among: Among,
    mean: f64,
    forces: Forces,
    halves: u64,
    weak: u64,
    below_mean: u64,
    ratio_sum: ExactSum,
    ratio_halves: u64,
}

impl ForceCount {
    /// An empty count. `mean` is `<f_n>` of the same contacts [N].
    pub fn new(among: Among, mean: f64) -> Self {
        Self {
            among,
            mean,
            forces: Forces::default(),
            halves: 0,
            weak: 0,
            below_mean: 0,
            ratio_sum: ExactSum::default(),
            ratio_halves: 0,
        }
    }

    /// Adds contacts.
    ///
    /// # Errors
    /// If a contact refers to a particle that does not exist.
    pub fn add_contacts(
        &mut self,
        contacts: &ContactTable,
        members: &Members,
    ) -> Result<(), PostError> {
        let forces = &mut self.forces;
        self.among.each(contacts, members, |row, halves| {
            let normal = contacts.normal_force[row];
            let shear = contacts.shear_force[row].norm();
            // With a tensile mean, weak contacts would be counted as strong.
            let presses = self.mean > 0.0;
            let over_mean = |force| quotient(force, self.mean).filter(|_| presses);
            if let (Some(n), Some(t)) = (over_mean(normal), over_mean(shear)) {
                self.halves += halves;
                self.weak += if normal < WEAK * self.mean { halves } else { 0 };
                self.below_mean += if normal < self.mean { halves } else { 0 };
                forces.normal.add(n, halves);
                forces.normal_logarithmic.add(n, halves);
                forces.shear.add(t, halves);
                forces.shear_logarithmic.add(t, halves);
            }
            forces.largest_normal_force = forces.largest_normal_force.max(normal);
            if let Some(ratio) = quotient(shear, normal).filter(|_| normal > 0.0) {
                // For a sliding contact the ratio is the friction coefficient up to rounding, and can lie on an edge of a bin.
                forces.friction_used.add(ratio * (1.0 + 1e-9), halves);
                forces.largest_friction_used = forces.largest_friction_used.max(ratio);
                self.ratio_sum.add(0.5 * halves as f64 * ratio);
                self.ratio_halves += halves;
            }
        })
    }

    /// Distributions of the counted contacts.
    pub fn finish(self) -> Forces {
        let share = |halves: u64| quotient(halves as f64, self.halves as f64);
        Forces {
            weak_share: share(self.weak),
            below_mean_share: share(self.below_mean),
            mean_friction_used: quotient(self.ratio_sum.value(), 0.5 * self.ratio_halves as f64),
            ..self.forces
        }
    }
}

/// Distributions of contact forces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Forces {
    /// `f_n / <f_n>`, linear bins. This and the next three are empty if the mean normal force is not compressive.
    pub normal: Histogram,
    /// `f_n / <f_n>`, logarithmic bins.
    pub normal_logarithmic: Histogram,
    /// `|f_t| / <f_n>`, linear bins.
    pub shear: Histogram,
    /// `|f_t| / <f_n>`, logarithmic bins.
    pub shear_logarithmic: Histogram,
    /// `|f_t| / f_n`, the mobilised friction; a sliding contact has its friction coefficient here. Contacts with `f_n > 0`.
    pub friction_used: Histogram,
    /// Share of contacts with `f_n < 0.3 <f_n>`; `None` without contacts, or if the mean is not compressive.
    pub weak_share: Option<f64>,
    /// Share of contacts with `f_n < <f_n>`; `None` as for `weak_share`.
    pub below_mean_share: Option<f64>,
    /// Mean of `|f_t| / f_n`; `None` without contacts.
    pub mean_friction_used: Option<f64>,
    /// Largest `|f_t| / f_n`.
    pub largest_friction_used: f64,
    /// Largest normal force [N].
    #[serde(rename = "largest_normal_force_n")]
    pub largest_normal_force: f64,
}

impl Default for Forces {
    fn default() -> Self {
        let (linear, logarithmic) = (Histogram::linear(80, 8.0), Histogram::logarithmic(10, -6, 2));
        Self {
            normal: linear.clone(),
            normal_logarithmic: logarithmic.clone(),
            shear: linear,
            shear_logarithmic: logarithmic,
            friction_used: Histogram::linear(100, 1.0),
            weak_share: None,
            below_mean_share: None,
            mean_friction_used: None,
            largest_friction_used: 0.0,
            largest_normal_force: 0.0,
        }
    }
}
