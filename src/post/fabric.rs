//! Anisotropy of contact normals and of contact forces (Guo and Zhao 2013, Comput. Geotech. 47,
//! 1-15; eq. 6 of Lai et al. 2021).
//!
//! The three second-order tensors belong to the densities `E(n) = (1 + a^c:nn) / 4π`,
//! `f_n(n) = f_0 (1 + a^n:nn)` and `f_t(n) = f_0 (a^t n - (a^t:nn) n)`:
//!
//! * `Φ_ij = <n_i n_j>`, `a^c = 15/2 Φ'`,
//! * `χ^n_ij = <f_n n_i n_j / (1 + a^c:nn)>`, `f_0 = χ^n_ii`, `a^n = 15/2 χ^n' / f_0`,
//! * `χ^t_ij = <f_t,i n_j / (1 + a^c:nn)>`, `a^t = 15/3 χ^t' / f_0`.
//!
//! The branches between centres of ellipsoids are not along the normals. Their parts along and across the normal
//! have tensors `a^bn` and `a^bt`, by the same formulas with the branch in place of the force (Ouadfel and
//! Rothenburg 2001, Mech. Mater. 33, 201-221).
//!
//! Averages run over contacts. Each degree is `±√(3/2 a_ij a_ij)` (eq. 6 prints no inner product). Its sign is
//! that of `a_ij σ'_ij`, positive without a stress. For coaxial, weak anisotropies
//! `q/p = 2/5 (a_c + a_n + a_bn + 3/2 (a_t + a_bt))`; for spheres of one size `a_bn` and `a_bt` are zero.
//!
//! Contacts with walls have the normals of the walls, not of the packing, and are left out unless requested. An
//! isotropic packing of `N_c` contacts has an `a_c` of about `7.5/√N_c`.

use super::PostError;
use super::region::{Ends, Members};
use super::stress::{Principal, Stress, principal};
use super::sums::{ExactMat3, deviator, inner, quotient, rows};
use crate::math::{ExactSum, Mat3, Vec3};
use crate::output::tables::ContactTable;
use serde::{Deserialize, Serialize};

/// Contacts over which averages run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Among {
    /// Contacts between particles.
    #[default]
    Particles,
    /// Contacts with walls too.
    ParticlesAndWalls,
}

impl Among {
    /// Weight of a contact, in halves.
    pub const fn halves(self, ends: Ends) -> u64 {
        match self {
            Self::Particles if ends.wall => 0,
            _ => ends.halves(),
        }
    }

    /// Calls `note` with the row and weight, in halves, of each contact that counts. A contact of a particle
    /// that does not exist is an error.
    pub(super) fn each(
        self,
        contacts: &ContactTable,
        members: &Members,
        mut note: impl FnMut(usize, u64),
    ) -> Result<(), PostError> {
        for (row, (&a, &b)) in contacts.a.iter().zip(&contacts.b).enumerate() {
            let halves = self.halves(members.ends(a, b)?);
            if halves > 0 {
                note(row, halves);
            }
        }
        Ok(())
    }
}

/// Sum over contact normals.
#[derive(Clone, Debug, Default)]
pub struct FabricSum {
    among: Among,
    sum: ExactMat3,
    halves: u64,
}

impl FabricSum {
    /// An empty sum.
    pub fn new(among: Among) -> Self {
        Self { among, ..Self::default() }
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
            let normal = &contacts.normal[row];
            self.sum.add_outer(&(normal * (0.5 * halves as f64)), normal);
            self.halves += halves;
        })
    }

    /// The fabric; `None` without contacts.
    pub fn finish(&self) -> Option<Fabric> {
        let contacts = 0.5 * self.halves as f64;
        (contacts > 0.0).then(|| Fabric { contacts, tensor: self.sum.value() / contacts })
    }
}

/// Fabric of contact normals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fabric {
    /// Number of contacts; one across the border of the region counts half.
    pub contacts: f64,
    /// Fabric tensor `Φ_ij = <n_i n_j>`.
    #[serde(with = "rows")]
    pub tensor: Mat3,
}

impl Fabric {
    /// `a^c_ij = 15/2 Φ'_ij`.
    pub fn anisotropy(&self) -> Mat3 {
        deviator(&self.tensor) * 7.5
    }

    /// Principal values and directions of `Φ`, largest first.
    pub fn principal(&self) -> [Principal; 3] {
        principal(&self.tensor)
    }
}

/// `±√(3/2 a_ij a_ij)` with the sign of `a_ij σ'_ij`; positive without a stress.
pub fn degree(anisotropy: &Mat3, stress: Option<&Stress>) -> f64 {
    let size = (1.5 * inner(anisotropy, anisotropy)).sqrt();
    let against = stress.is_some_and(|s| inner(anisotropy, &s.deviator()) < 0.0);
    if against { -size } else { size }
}

/// Sum over contact forces, each over the density of normals in its direction: a second pass, after that of
/// [`FabricSum`].
#[derive(Clone, Debug)]
pub struct ForceFabricSum {
    among: Among,
    anisotropy: Mat3,
    normal: ExactMat3,
    shear: ExactMat3,
    branch_normal: ExactMat3,
    branch_shear: ExactMat3,
    halves: u64,
    smallest_density: f64,
}

impl ForceFabricSum {
    /// An empty sum. `fabric` is that of the same contacts.
    pub fn new(among: Among, fabric: &Fabric) -> Self {
        Self {
            among,
            anisotropy: fabric.anisotropy(),
            normal: ExactMat3::default(),
            shear: ExactMat3::default(),
            branch_normal: ExactMat3::default(),
            branch_shear: ExactMat3::default(),
            halves: 0,
            smallest_density: f64::INFINITY,
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
        self.among.each(contacts, members, |row, halves| {
            let normal = &contacts.normal[row];
            let density = 1.0 + normal.dot(&(self.anisotropy * normal));
            self.smallest_density = self.smallest_density.min(density);
            // With a density of zero or less the result is `None`; its quotient could not be summed.
            if density > 0.0 {
                let weight = 0.5 * halves as f64 / density;
                self.normal.add_outer(&(normal * (contacts.normal_force[row] * weight)), normal);
                self.shear.add_outer(&(contacts.shear_force[row] * weight), normal);
                let branch = &contacts.branch[row];
                let along = normal * branch.dot(normal);
                self.branch_normal.add_outer(&(along * weight), normal);
                self.branch_shear.add_outer(&((branch - along) * weight), normal);
                self.halves += halves;
            }
        })
    }

    /// Anisotropy of forces. `None` without contacts or forces, or if the second-order density of normals is not
    /// positive for a contact, which happens for few, very anisotropic contacts.
    pub fn finish(&self) -> Option<ForceFabric> {
        let contacts = 0.5 * self.halves as f64;
        if self.halves == 0 || self.smallest_density <= 0.0 {
            return None;
        }
        let (normal, shear) = (self.normal.value() / contacts, self.shear.value() / contacts);
        let (along, across) =
            (self.branch_normal.value() / contacts, self.branch_shear.value() / contacts);
        let (mean_force, mean_branch) = (normal.trace(), along.trace());
        (mean_force > 0.0 && mean_branch > 0.0).then(|| ForceFabric {
            mean_force,
            normal_anisotropy: deviator(&normal) * (7.5 / mean_force),
            shear_anisotropy: deviator(&shear) * (5.0 / mean_force),
            branch_normal_anisotropy: deviator(&along) * (7.5 / mean_branch),
            branch_shear_anisotropy: deviator(&across) * (5.0 / mean_branch),
        })
    }
}

/// Anisotropy of contact forces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ForceFabric {
    /// `f_0 = χ^n_ii`, the mean normal force over all directions [N].
    #[serde(rename = "mean_force_n")]
    pub mean_force: f64,
    /// `a^n_ij`.
    #[serde(with = "rows")]
    pub normal_anisotropy: Mat3,
    /// `a^t_ij`.
    #[serde(with = "rows")]
    pub shear_anisotropy: Mat3,
    /// `a^bn_ij`, for the branches along the normals.
    #[serde(with = "rows")]
    pub branch_normal_anisotropy: Mat3,
    /// `a^bt_ij`, for the branches across the normals.
    #[serde(with = "rows")]
    pub branch_shear_anisotropy: Mat3,
}

/// Degrees of anisotropy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Degrees {
    /// Anisotropy of normals.
    pub a_c: f64,
    /// Anisotropy of normal forces.
    pub a_n: f64,
    /// Anisotropy of shear forces.
    pub a_t: f64,
    /// Anisotropy of branches along the normals.
    pub a_bn: f64,
    /// Anisotropy of branches across the normals.
    pub a_bt: f64,
}

impl Degrees {
    /// All degrees, see [`degree`].
    pub fn new(fabric: &Fabric, forces: &ForceFabric, stress: Option<&Stress>) -> Self {
        Self {
            a_c: degree(&fabric.anisotropy(), stress),
            a_n: degree(&forces.normal_anisotropy, stress),
            a_t: degree(&forces.shear_anisotropy, stress),
            a_bn: degree(&forces.branch_normal_anisotropy, stress),
            a_bt: degree(&forces.branch_shear_anisotropy, stress),
        }
    }

    /// `q/p` from the stress-force-fabric relation, `2/5 (a_c + a_n + a_bn + 3/2 (a_t + a_bt))`.
    pub fn stress_ratio(&self) -> f64 {
        0.4 * (self.a_c + self.a_n + self.a_bn + 1.5 * (self.a_t + self.a_bt))
    }
}

/// Normals and forces by their angle to the vertical (z), averaged over the azimuth: the roses of figs. 12 and
/// 14 of Lai et al. 2021.
///
/// Normals have no sign and are turned upwards, so that angles run from 0 (vertical) to π/2 (horizontal).
#[derive(Clone, Debug, Default)]
pub struct RoseSum {
    among: Among,
    bins: [RoseBin; Rose::BINS],
}

#[derive(Clone, Debug, Default)]
struct RoseBin {
    halves: u64,
    normal_force: ExactSum,
    shear_force: ExactSum,
}

impl RoseSum {
    /// An empty sum.
    pub fn new(among: Among) -> Self {
        Self { among, ..Self::default() }
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
            let normal = &contacts.normal[row];
            let up = if normal.z < 0.0 { -1.0 } else { 1.0 };
            let ring = normal.x.hypot(normal.y);
            let bin = &mut self.bins[Rose::bin_of(ring.atan2(up * normal.z))];
            let weight = 0.5 * halves as f64;
            bin.halves += halves;
            bin.normal_force.add(weight * contacts.normal_force[row]);
            if ring > 0.0 {
                // Along the meridian towards the pole; the sign of the force of A on B changes with that of the
                // normal.
                let to_pole =
                    Vec3::new(-normal.x * normal.z / ring, -normal.y * normal.z / ring, ring);
                bin.shear_force.add(weight * up * contacts.shear_force[row].dot(&to_pole));
            }
        })
    }

    /// Roses of the sum.
    pub fn finish(&self) -> Rose {
        let contacts = 0.5 * self.bins.iter().map(|bin| bin.halves).sum::<u64>() as f64;
        let mean = |sum: &ExactSum, bin: &RoseBin| quotient(sum.value(), 0.5 * bin.halves as f64);
        let column = |of: &dyn Fn(usize, &RoseBin) -> Option<f64>| {
            self.bins.iter().enumerate().map(|(k, bin)| of(k, bin)).collect()
        };
        Rose {
            density: column(&|k, bin| {
                quotient(0.5 * bin.halves as f64 / contacts, Rose::share_of_sphere(k))
            }),
            normal_force: column(&|_, bin| mean(&bin.normal_force, bin)),
            shear_force: column(&|_, bin| mean(&bin.shear_force, bin)),
        }
    }
}

/// Normals and forces by their angle to the vertical, in [`Rose::BINS`] equal steps from 0 to π/2; `None` for a
/// bin without contacts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rose {
    /// Density of normals over that of an isotropic packing, `4π E(θ)`.
    pub density: Vec<Option<f64>>,
    /// Mean normal force [N].
    #[serde(rename = "normal_force_n")]
    pub normal_force: Vec<Option<f64>>,
    /// Mean tangential force towards the vertical, of the lower body on the upper [N].
    #[serde(rename = "shear_force_n")]
    pub shear_force: Vec<Option<f64>>,
}

impl Rose {
    /// Number of steps from vertical to horizontal.
    pub const BINS: usize = 9;
    /// Width of a step [rad].
    pub const STEP: f64 = std::f64::consts::FRAC_PI_2 / Self::BINS as f64;

    fn bin_of(angle: f64) -> usize {
        ((angle / Self::STEP) as usize).min(Self::BINS - 1)
    }

    /// Share of the upper half sphere in a bin.
    fn share_of_sphere(bin: usize) -> f64 {
        let edge = |k: usize| (k as f64 * Self::STEP).cos();
        edge(bin) - edge(bin + 1)
    }

    /// Second-order density or normal force by the angle to the vertical, over its mean: `1 + a_zz P_2(cos θ)`,
    /// the average of `1 + a:nn` over the azimuth.
    pub fn normal_fit(anisotropy: &Mat3, angle: f64) -> f64 {
        let (sine, cosine) = angle.sin_cos();
        1.0 + anisotropy.m33 * (cosine * cosine - 0.5 * sine * sine)
    }

    /// Second-order shear force towards the vertical, over `f_0`: `3/2 a^t_zz sin θ cos θ`, the average of
    /// `a^t n` along the meridian over the azimuth.
    pub fn shear_fit(anisotropy: &Mat3, angle: f64) -> f64 {
        let (sine, cosine) = angle.sin_cos();
        1.5 * anisotropy.m33 * sine * cosine
    }
}
