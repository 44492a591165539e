//! Mean stress of a region, from contact forces.
//!
//! `σ_ij = (1/V) Σ f_i l_j` (Christoffersen, Mehrabadi and Nemat-Nasser 1981, DOI
//! 10.1115/1.3157619; eq. 5 of Lai et al. 2021, where the branch is misprinted as a second `f`), with
//! `f` the force of A on B and `l` the branch from A to B. Compression is positive.
//!
//! # Part of the packing
//!
//! Per particle, `l = (x_c - x_A) - (x_c - x_B)`: each particle contributes its force on the partner times the arm from its own
//! centre to the contact point. A region takes the particles with centres in it, so that sums over disjoint regions add up to
//! that of the whole.
//!
//! # Walls
//!
//! The branch of a wall contact runs from the centre to the contact point, the middle of the overlap. Other choices are usual for
//! a packing in rigid walls. With the branch to the wall's plane the stress is exactly wall force over wall area; without wall
//! contacts it is too low by about one layer of particles. Example of 3 × 3 × 3 spheres in a box with an overlap of 1 % of the
//! radius: 25,379 Pa here, 25,337 Pa to the plane (and on the wall), 16,919 Pa without. The first two differ by one overlap per
//! box length, half of it at each wall.

use super::PostError;
use super::region::{ACROSS, Bounds, Members, enclosed, walls_across};
use super::sums::{ExactMat3, deviator, inner, quotient, rows};
use crate::math::{Mat3, Vec3};
use crate::output::header::Header;
use crate::output::tables::ContactTable;
use serde::{Deserialize, Serialize};

/// Sum `Σ f_i l_j`.
#[derive(Clone, Debug, Default)]
pub struct StressSum {
    sum: ExactMat3,
}

impl StressSum {
    /// Adds contacts, whole or the half that belongs to a particle of the region.
    ///
    /// # Errors
    /// If a contact refers to a particle that does not exist.
    pub fn add_contacts(
        &mut self,
        contacts: &ContactTable,
        members: &Members,
    ) -> Result<(), PostError> {
        for row in 0..contacts.a.len() {
            let ends = members.ends(contacts.a[row], contacts.b[row])?;
            let force = contacts.force(row);
            let from_a = contacts.point[row] - contacts.centre[row];
            let branch = &contacts.branch[row];
            match (ends.a, ends.b) {
                (true, true) => self.sum.add_outer(&force, branch),
                (true, false) if contacts.b[row].wall_index().is_some() => {
                    self.sum.add_outer(&force, branch);
                }
                (true, false) => self.sum.add_outer(&force, &from_a),
                (false, true) => self.sum.add_outer(&-force, &(from_a - branch)),
                (false, false) => {}
            }
        }
        Ok(())
    }

    /// `Σ f_i l_j` [N m].
    pub fn sum(&self) -> Mat3 {
        self.sum.value()
    }

    /// Mean stress in a region of this volume [m³].
    pub fn finish(&self, volume: f64) -> Stress {
        Stress { tensor: self.sum() / volume }
    }
}

/// Load over area of the walls across each axis [Pa], compression positive: the mean of both sides. `None` if one side has no
/// wall: the stress in between may then differ from the load. `None` also if a side along the wall is open, so that its area is
/// unknown.
pub fn on_walls(header: &Header, packing: &Bounds) -> [Option<f64>; 3] {
    let (lengths, enclosed) = (packing.lengths(), enclosed(header));
    [0, 1, 2].map(|k| {
        if !(enclosed[(k + 1) % 3] && enclosed[(k + 2) % 3]) {
            return None;
        }
        let area = lengths.product() / lengths[k];
        let side = |sign: f64| {
            let walls = header.planes().filter(move |w| sign * w.normal[k] > ACROSS);
            walls.map(|w| -sign * w.force[k]).reduce(|a, b| a + b)
        };
        quotient(0.5 * (side(1.0)? + side(-1.0)?), area)
    })
}

/// Shear stress over normal stress of the two walls that move along each other, the mean of both. `None` without such walls, or
/// without normal load on them.
pub fn shear_over_normal(header: &Header) -> Option<f64> {
    let of_axis = |axis: usize| {
        let [low, high] = walls_across(header, axis)?;
        let along = |mut v: Vec3| {
            v[axis] = 0.0;
            v.norm()
        };
        if along(high.velocity - low.velocity) == 0.0 {
            return None;
        }
        // Both would be halved in a mean.
        quotient(along(high.force - low.force), (high.force - low.force)[axis].abs())
    };
    (0..3).find_map(of_axis)
}

/// A stress tensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Stress {
    /// `σ_ij` [Pa], compression positive.
    #[serde(with = "rows")]
    pub tensor: Mat3,
}

impl Stress {
    /// The symmetric part [Pa], from which the invariants are taken.
    pub fn symmetric(&self) -> Mat3 {
        (self.tensor + self.tensor.transpose()) * 0.5
    }

    /// `|σ - σᵀ| / |σ + σᵀ|`: 0 where the moments on every particle balance. `None` without stress.
    pub fn asymmetry(&self) -> Option<f64> {
        let transpose = self.tensor.transpose();
        quotient((self.tensor - transpose).norm(), (self.tensor + transpose).norm())
    }

    /// Mean stress `p = σ_ii / 3` [Pa] (eq. 4).
    pub fn p(&self) -> f64 {
        self.tensor.trace() / 3.0
    }

    /// Deviatoric stress `q = √(3/2 σ'_ij σ'_ij)` [Pa] (eq. 4).
    pub fn q(&self) -> f64 {
        let deviator = self.deviator();
        (1.5 * inner(&deviator, &deviator)).sqrt()
    }

    /// `q / p`; `None` without stress.
    pub fn ratio(&self) -> Option<f64> {
        quotient(self.q(), self.p())
    }

    /// `σ' = σ - p 1` [Pa], symmetric.
    pub fn deviator(&self) -> Mat3 {
        deviator(&self.symmetric())
    }

    /// Principal stresses, largest first, with their directions.
    pub fn principal(&self) -> [Principal; 3] {
        principal(&self.symmetric())
    }

    /// Largest over smallest principal stress; `None` unless all are compressive.
    pub fn major_over_minor(&self) -> Option<f64> {
        let [largest, _, smallest] = self.principal().map(|p| p.value);
        (smallest > 0.0).then_some(largest / smallest)
    }
}

/// One principal value of a symmetric tensor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Principal {
    /// Value, in the unit of the tensor.
    pub value: f64,
    /// Unit direction; of both signs the upward one.
    pub direction: Vec3,
}

/// Principal values of a symmetric tensor, largest first, with their directions.
pub(super) fn principal(tensor: &Mat3) -> [Principal; 3] {
    let eigen = tensor.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    order.map(|k| {
        let direction = eigen.eigenvectors.column(k).into_owned();
        let up = direction.z < 0.0 || (direction.z == 0.0 && direction.x < 0.0);
        Principal {
            value: eigen.eigenvalues[k],
            direction: if up { -direction } else { direction },
        }
    })
}
