//! Report of a snapshot: a row of numbers for a table, with all tensors and distributions.

use super::coordination::Coordination;
use super::fabric::{Among, Degrees, Fabric, ForceFabric, Rose, degree};
use super::forces::Forces;
use super::measured::Measured;
use super::region::{Bounds, Region, Slide, Strain, doubts, enclosed, slides};
use super::rows::rows;
use super::stress::{Principal, Stress, on_walls, shear_over_normal};
use super::sums::quotient;
use crate::math::Vec3;
use crate::output::header::Header;
use serde::{Deserialize, Serialize};

pub use super::rows::{Group, Row, readable};

/// All results for one snapshot. Values without meaning (a mean over nothing) are null.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of this program.
    pub program_version: String,
    /// File of the snapshot.
    pub snapshot: String,
    /// Box of the whole packing [m].
    pub packing_m: Option<Bounds>,
    /// For x, y and z, true if a period or walls on both sides end the packing; otherwise there is no strain.
    pub enclosed: [bool; 3],
    /// Warnings about the numbers, one sentence each.
    #[serde(default)]
    pub doubts: Vec<String>,
    /// Basis of the shear strain: across each axis, the displacement of one end against the other [m].
    #[serde(default)]
    pub slides: [Option<Slide>; 3],
    /// Box given by the user [m]; null for the whole packing.
    pub region_m: Option<Bounds>,
    /// Whether fabric and forces include contacts with walls.
    pub walls_in_fabric: bool,
    /// Numbers of the table.
    pub summary: Summary,
    /// Box of the whole packing or of the region [m].
    pub bounds_m: Option<Bounds>,
    /// Stress [Pa], compression positive, row by row.
    pub stress_pa: Option<Stress>,
    /// Principal stresses, largest first, with their directions.
    pub principal_stress_pa: Option<[Principal; 3]>,
    /// Coordination, with and without walls.
    pub coordination: Coordination,
    /// Fabric of the contact normals.
    pub fabric: Option<Fabric>,
    /// Principal values of the fabric tensor, largest first, with their directions.
    pub principal_fabric: Option<[Principal; 3]>,
    /// Anisotropy of the contact forces.
    pub force_fabric: Option<ForceFabric>,
    /// Normals and forces by their angle to the vertical.
    pub rose: Rose,
    /// Distributions of forces over the mean normal force.
    pub forces: Option<Forces>,
    /// Results of requested measures, and means over a window.
    #[serde(default)]
    pub measured: Box<Measured>,
}

/// Numbers of a snapshot: one row of the table. Keys end in their unit; those without a unit are counts or ratios.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Number of steps since the first stage began.
    pub step: u64,
    /// Time since the first stage began.
    pub time_s: f64,
    /// Number of particles in the region.
    pub particles: u64,
    /// Number of contacts between particles; one across the border of the region counts half.
    pub contacts_between_particles: f64,
    /// Number of contacts with walls.
    pub contacts_with_walls: u64,
    /// Volume of the region.
    pub volume_m3: Option<f64>,
    /// Height of the region.
    pub height_m: Option<f64>,
    /// Volume of particles over volume of the region.
    pub solid_fraction: Option<f64>,
    /// Volume of voids over volume of particles.
    pub void_ratio: Option<f64>,
    /// `ln(H0/H)` of the whole packing relative to the first snapshot. Null unless a period or walls on both sides end both
    /// packings along z.
    pub axial_strain: Option<f64>,
    /// `ln(V0/V)` of the whole packing relative to the first snapshot; negative for dilation. Null unless periods or walls end
    /// both packings on all sides.
    pub volumetric_strain: Option<f64>,
    /// Shear strain of a sheared cell, or of walls that slide along each other: displacement over distance, relative to the first
    /// snapshot. Null without sliding.
    #[serde(default)]
    pub shear_strain: Option<f64>,
    /// Stress `σ_xx`; compression is positive in all `σ_ij`.
    pub stress_xx_pa: Option<f64>,
    /// `σ_xy`.
    pub stress_xy_pa: Option<f64>,
    /// `σ_xz`.
    pub stress_xz_pa: Option<f64>,
    /// `σ_yx`.
    pub stress_yx_pa: Option<f64>,
    /// `σ_yy`.
    pub stress_yy_pa: Option<f64>,
    /// `σ_yz`.
    pub stress_yz_pa: Option<f64>,
    /// `σ_zx`.
    pub stress_zx_pa: Option<f64>,
    /// `σ_zy`.
    pub stress_zy_pa: Option<f64>,
    /// `σ_zz`.
    pub stress_zz_pa: Option<f64>,
    /// Mean stress.
    pub p_pa: Option<f64>,
    /// Deviatoric stress.
    pub q_pa: Option<f64>,
    /// Stress ratio.
    pub q_over_p: Option<f64>,
    /// `|σ - σᵀ| / |σ + σᵀ|`.
    pub stress_asymmetry: Option<f64>,
    /// Mean load over area of the two walls across x; null without them.
    pub wall_stress_xx_pa: Option<f64>,
    /// Mean load over area of the two walls across y; null without them.
    pub wall_stress_yy_pa: Option<f64>,
    /// Mean load over area of the two walls across z; null without them.
    pub wall_stress_zz_pa: Option<f64>,
    /// Mean shear stress over normal stress of the two walls that slide along each other; null without sliding.
    pub wall_shear_over_normal: Option<f64>,
    /// Largest over smallest principal stress; null unless all are compressive.
    pub major_over_minor_stress: Option<f64>,
    /// `γ̇ d √(ρ/p)`. The rate is that of a sheared cell, of walls that slide along each other, or of walls across z that
    /// approach each other. Null without either.
    pub inertial_number: Option<f64>,
    /// Mean coordination number, contacts between particles only.
    pub coordination: Option<f64>,
    /// Mean coordination number, walls included.
    pub coordination_with_walls: Option<f64>,
    /// Mechanical coordination number, contacts between particles only.
    pub mechanical_coordination: Option<f64>,
    /// Mechanical coordination number, walls included.
    pub mechanical_coordination_with_walls: Option<f64>,
    /// Number of particles with fewer than two contacts with particles.
    pub rattlers: u64,
    /// Number of particles with fewer than two contacts of any kind.
    pub rattlers_with_walls: u64,
    /// Anisotropy of contact normals.
    pub a_c: Option<f64>,
    /// Anisotropy of normal forces.
    pub a_n: Option<f64>,
    /// Anisotropy of shear forces.
    pub a_t: Option<f64>,
    /// Anisotropy of branches along the normals.
    pub a_bn: Option<f64>,
    /// Anisotropy of branches across the normals.
    pub a_bt: Option<f64>,
    /// `2/5 (a_c + a_n + a_bn + 3/2 (a_t + a_bt))`.
    pub q_over_p_from_fabric: Option<f64>,
    /// `q_over_p_from_fabric` over `q/p`, minus one.
    pub fabric_relation_error: Option<f64>,
    /// Mean normal contact force.
    pub mean_normal_force_n: Option<f64>,
    /// Largest normal contact force.
    pub largest_normal_force_n: Option<f64>,
    /// Share of contacts below 0.3 of the mean normal force.
    pub share_below_0_3_mean: Option<f64>,
    /// Share of contacts below the mean normal force.
    pub share_below_mean: Option<f64>,
    /// Mean of `|f_t| / f_n`.
    pub mean_friction_used: Option<f64>,
    /// Largest `|f_t| / f_n`.
    pub largest_friction_used: Option<f64>,
    /// Mean resultant force on a particle over the mean normal force.
    pub unbalanced_force_ratio: Option<f64>,
}

/// Stress ratio below which the relation of stress, force and fabric is not compared.
const NEARLY_ISOTROPIC: f64 = 0.1;

/// Mean of two values that are equal except for moving particles.
fn mean(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    a.zip(b).map(|(a, b)| 0.5 * (a + b))
}

/// Parts of a report.
pub(super) struct Parts<'a> {
    pub(super) header: &'a Header,
    pub(super) region: Region,
    pub(super) among: Among,
    pub(super) packing: Option<Bounds>,
    pub(super) inertial_number_times_root_p: Option<f64>,
    pub(super) bounds: Option<Bounds>,
    pub(super) solid_fraction: Option<f64>,
    pub(super) stress: Option<Stress>,
    pub(super) coordination: Coordination,
    pub(super) fabric: Option<Fabric>,
    pub(super) force_fabric: Option<ForceFabric>,
    pub(super) rose: Rose,
    pub(super) forces: Option<Forces>,
    pub(super) mean_normal_force: Option<f64>,
    pub(super) unbalanced_ratio: Option<f64>,
}

impl Parts<'_> {
    /// Row of numbers, without strains, which need another snapshot.
    fn summary(&self) -> Summary {
        let Self { header, bounds, stress, fabric, force_fabric, .. } = *self;
        let forces = self.forces.as_ref();
        let degrees = fabric
            .zip(force_fabric)
            .map(|(fabric, forces)| Degrees::new(&fabric, &forces, stress.as_ref()));
        let (without, with) = (&self.coordination.without_walls, &self.coordination.with_walls);
        let entry = |i, j| stress.map(|s| s.tensor[(i, j)]);
        let [wall_xx, wall_yy, wall_zz] =
            self.packing.map_or([None; 3], |packing| on_walls(header, &packing));
        let q_over_p = stress.and_then(|s| s.ratio());
        let from_fabric = degrees.map(|degrees| degrees.stress_ratio());
        Summary {
            step: header.step,
            time_s: header.time,
            particles: without.particles(),
            contacts_between_particles: 0.5 * without.contact_ends() as f64,
            contacts_with_walls: with.contact_ends() - without.contact_ends(),
            volume_m3: bounds.map(|b| b.volume()),
            height_m: bounds.map(|b| b.lengths().z),
            solid_fraction: self.solid_fraction,
            void_ratio: self.solid_fraction.filter(|&s| s > 0.0).map(|s| (1.0 - s) / s),
            axial_strain: None,
            volumetric_strain: None,
            shear_strain: None,
            stress_xx_pa: entry(0, 0),
            stress_xy_pa: entry(0, 1),
            stress_xz_pa: entry(0, 2),
            stress_yx_pa: entry(1, 0),
            stress_yy_pa: entry(1, 1),
            stress_yz_pa: entry(1, 2),
            stress_zx_pa: entry(2, 0),
            stress_zy_pa: entry(2, 1),
            stress_zz_pa: entry(2, 2),
            p_pa: stress.map(|s| s.p()),
            q_pa: stress.map(|s| s.q()),
            q_over_p,
            stress_asymmetry: stress.and_then(|s| s.asymmetry()),
            wall_stress_xx_pa: wall_xx,
            wall_stress_yy_pa: wall_yy,
            wall_stress_zz_pa: wall_zz,
            wall_shear_over_normal: shear_over_normal(header),
            major_over_minor_stress: stress.and_then(|s| s.major_over_minor()),
            inertial_number: stress
                .filter(|s| s.p() > 0.0)
                .zip(self.inertial_number_times_root_p)
                .map(|(s, inertia)| inertia / s.p().sqrt()),
            coordination: without.mean(),
            coordination_with_walls: with.mean(),
            mechanical_coordination: without.mechanical(),
            mechanical_coordination_with_walls: with.mechanical(),
            rattlers: without.rattlers(),
            rattlers_with_walls: with.rattlers(),
            a_c: fabric.map(|fabric| degree(&fabric.anisotropy(), stress.as_ref())),
            a_n: degrees.map(|degrees| degrees.a_n),
            a_t: degrees.map(|degrees| degrees.a_t),
            a_bn: degrees.map(|degrees| degrees.a_bn),
            a_bt: degrees.map(|degrees| degrees.a_bt),
            q_over_p_from_fabric: from_fabric,
            fabric_relation_error: from_fabric
                .zip(q_over_p.filter(|&ratio| ratio > NEARLY_ISOTROPIC))
                .and_then(|(from_fabric, direct)| quotient(from_fabric - direct, direct)),
            mean_normal_force_n: self.mean_normal_force,
            largest_normal_force_n: forces.map(|f| f.largest_normal_force),
            share_below_0_3_mean: forces.and_then(|f| f.weak_share),
            share_below_mean: forces.and_then(|f| f.below_mean_share),
            mean_friction_used: forces.and_then(|f| f.mean_friction_used),
            largest_friction_used: forces.map(|f| f.largest_friction_used),
            unbalanced_force_ratio: self.unbalanced_ratio,
        }
    }
}

impl Report {
    pub(super) fn of(parts: Parts, snapshot: &str) -> Self {
        let summary = parts.summary();
        let Parts { header, bounds, stress, coordination, fabric, force_fabric, forces, .. } =
            parts;
        Self {
            program_version: env!("CARGO_PKG_VERSION").to_string(),
            snapshot: snapshot.to_string(),
            packing_m: parts.packing,
            enclosed: enclosed(header),
            doubts: doubts(header, &parts.region, parts.packing.as_ref()),
            slides: slides(header),
            region_m: match parts.region {
                Region::Whole => None,
                Region::Box(bounds) => Some(bounds),
            },
            walls_in_fabric: parts.among == Among::ParticlesAndWalls,
            summary,
            bounds_m: bounds,
            stress_pa: stress,
            principal_stress_pa: stress.map(|s| s.principal()),
            coordination,
            fabric,
            principal_fabric: fabric.map(|f| f.principal()),
            force_fabric,
            rose: parts.rose,
            forces,
            measured: Box::default(),
        }
    }

    /// Sets the strains of the whole packing relative to a first snapshot, as far as both are enclosed.
    pub fn strain_against(&mut self, first: &Self) {
        let boxes = first.packing_m.zip(self.packing_m);
        let strain = boxes.and_then(|(first, now)| Strain::between(&first, &now));
        let both = |k: usize| first.enclosed[k] && self.enclosed[k];
        let (along_z, on_all_sides) = (both(2), (0..3).all(both));
        self.summary.axial_strain = strain.filter(|_| along_z).map(|s| s.axial);
        self.summary.volumetric_strain = strain.filter(|_| on_all_sides).map(|s| s.volumetric);
        let slid = |axis: usize| {
            let (first, now) = (first.slides[axis].as_ref()?, self.slides[axis].as_ref()?);
            // A change of the innermost wall is not sliding.
            if first.between != now.between {
                return None;
            }
            let [first, now] = [first.way, now.way].map(Vec3::from);
            quotient((now - first).norm(), self.packing_m?.lengths()[axis])
        };
        let largest = (0..3).filter_map(slid).reduce(f64::max);
        self.summary.shear_strain = largest.filter(|&strain| strain > 0.0);
    }

    /// The main numbers in groups, for the terminal and the page. Numbers without a value are left out.
    pub fn groups(&self) -> Vec<Group> {
        let s = &self.summary;
        let mean_force = if self.walls_in_fabric {
            "mean normal force, with walls"
        } else {
            "mean normal force between particles"
        };
        let groups = [
            Group {
                title: "Packing".into(),
                rows: rows([
                    Some(Row::count("particles", s.particles as f64)),
                    Some(Row::count("contacts between particles", s.contacts_between_particles)),
                    Some(Row::count("contacts with walls", s.contacts_with_walls as f64)),
                    Row::number("height", s.height_m, "m"),
                    Row::number("volume", s.volume_m3, "m³"),
                    Row::number("solid fraction", s.solid_fraction, ""),
                    Row::number("void ratio e", s.void_ratio, ""),
                    Row::number("axial strain, shorter positive", s.axial_strain, ""),
                    Row::number("volumetric strain, denser positive", s.volumetric_strain, ""),
                    Row::number("shear strain", s.shear_strain, ""),
                ]),
            },
            Group {
                title: "Stress (compression positive)".into(),
                rows: rows([
                    Row::number("mean stress p", s.p_pa, "Pa"),
                    Row::number("deviatoric stress q", s.q_pa, "Pa"),
                    Row::number("q / p", s.q_over_p, ""),
                    Row::number("σ1 / σ3", s.major_over_minor_stress, ""),
                    Row::number("σxx", s.stress_xx_pa, "Pa"),
                    Row::number("σyy", s.stress_yy_pa, "Pa"),
                    Row::number("σzz", s.stress_zz_pa, "Pa"),
                    Row::number("σxy", mean(s.stress_xy_pa, s.stress_yx_pa), "Pa"),
                    Row::number("σxz", mean(s.stress_xz_pa, s.stress_zx_pa), "Pa"),
                    Row::number("σyz", mean(s.stress_yz_pa, s.stress_zy_pa), "Pa"),
                    Row::number("σxx on walls", s.wall_stress_xx_pa, "Pa"),
                    Row::number("σyy on walls", s.wall_stress_yy_pa, "Pa"),
                    Row::number("σzz on walls", s.wall_stress_zz_pa, "Pa"),
                    Row::number("τ / σ on walls that slide", s.wall_shear_over_normal, ""),
                    Row::number("asymmetry of σ", s.stress_asymmetry, ""),
                    Row::number("inertial number", s.inertial_number, ""),
                    Row::number("unbalanced force ratio", s.unbalanced_force_ratio, ""),
                ]),
            },
            Group {
                title: "Coordination".into(),
                rows: rows([
                    Row::number("mean Z, particles", s.coordination, ""),
                    Row::number("mean Z, with walls", s.coordination_with_walls, ""),
                    Row::number("mechanical Z, particles", s.mechanical_coordination, ""),
                    Row::number(
                        "mechanical Z, with walls",
                        s.mechanical_coordination_with_walls,
                        "",
                    ),
                    Some(Row::count("rattlers, particles", s.rattlers as f64)),
                    Some(Row::count("rattlers, with walls", s.rattlers_with_walls as f64)),
                ]),
            },
            Group {
                title: "Anisotropy and forces".into(),
                rows: rows([
                    Row::number("normals a_c", s.a_c, ""),
                    Row::number("normal forces a_n", s.a_n, ""),
                    Row::number("shear forces a_t", s.a_t, ""),
                    Row::number("branches along normals a_bn", s.a_bn, ""),
                    Row::number("branches across a_bt", s.a_bt, ""),
                    Row::number("q / p from these five", s.q_over_p_from_fabric, ""),
                    Row::number("off the q / p of the stress", s.fabric_relation_error, "%"),
                    Row::number(mean_force, s.mean_normal_force_n, "N"),
                    Row::number("contacts below 0.3 mean", s.share_below_0_3_mean, "%"),
                    Row::number("contacts below mean", s.share_below_mean, "%"),
                    Row::number("mean friction used, |f_t| / f_n", s.mean_friction_used, ""),
                ]),
            },
        ];
        groups.into_iter().filter(|group| !group.rows.is_empty()).collect()
    }
}

/// CSV with the names of the fields as header; empty without rows.
///
/// # Errors
/// If the rows are not flat records.
pub fn csv<T: Serialize>(rows: impl IntoIterator<Item = T>) -> Result<String, csv::Error> {
    let mut table = csv::Writer::from_writer(Vec::new());
    for row in rows {
        table.serialize(row)?;
    }
    let bytes = table.into_inner().map_err(|e| csv::Error::from(e.into_error()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}
