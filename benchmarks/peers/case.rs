//! Common input of all codes, and the differences of their results.

use anyhow::{Context, bail, ensure};
use dem_mpi::math::Vec3;
use dem_mpi::scene::{Fill, Scene};
use dem_mpi::shape::Shape;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// Equal spheres at rest in a box with its low corner at the origin, with a wall on each side but the
/// top.
pub(crate) struct Case {
    pub(crate) file: PathBuf,
    /// Initial centres [m].
    pub(crate) start: Vec<Vec3>,
    /// Radius [m].
    pub(crate) radius: f64,
    /// Density [kg/m³].
    pub(crate) density: f64,
    /// High corner of the box, which is as long as wide [m].
    pub(crate) high: Vec3,
    /// Downward gravity [m/s²].
    pub(crate) gravity: f64,
    /// Normal and tangential stiffness [N/m].
    pub(crate) stiffness: [f64; 2],
    /// Coefficient of friction [-].
    pub(crate) friction: f64,
    /// Normal and tangential dashpots of two spheres over their reduced mass [1/s].
    pub(crate) damping: [f64; 2],
    /// Normal and tangential dashpots of a sphere and a wall over the mass [1/s].
    pub(crate) wall_damping: [f64; 2],
    /// Time step [s].
    pub(crate) step: f64,
    /// Distance of the surfaces at which a pair is listed [m].
    pub(crate) skin: f64,
}

impl Case {
    pub(crate) fn read(file: &Path) -> anyhow::Result<Self> {
        let scene = Scene::read(file, &[]).map_err(|errors| anyhow::anyhow!("{errors}"))?;
        let (library, domain) = (&scene.library, &scene.domain);
        let [Shape::Sphere(sphere)] = library.shapes[..library.particle_shapes] else {
            bail!("{}: one shape, a sphere, is what all codes know", file.display());
        };
        let [Fill::Listed(list)] = &scene.initial[..] else {
            bail!("{}: the spheres of one file are what all codes can be given", file.display());
        };
        ensure!(scene.materials.len() == 1, "{}: one material is needed", file.display());
        ensure!(
            scene.walls.len() == 5
                && domain.corners().0 == Vec3::zeros()
                && domain.corners().1.x == domain.corners().1.y,
            "{}: a box from the origin, as long as wide, with all walls but +z is needed",
            file.display()
        );
        let law = scene.law.linear().context("a linear law is needed")?;
        ensure!(
            scene.gravity.xy().norm() == 0.0 && law.dashpots.limited && scene.global_damping == 0.0,
            "{}: gravity along z, limited dashpots and no global damping are needed",
            file.display()
        );
        let at_rest = list.iter().all(|p| p.velocity.norm() + p.angular_velocity.norm() == 0.0);
        ensure!(at_rest, "{}: spheres at rest are needed", file.display());

        let constants = law.interactions.iter().next().context("a material has constants")?;
        let stiffness = [constants.normal_stiffness, constants.tangential_stiffness];
        let ratios = [constants.normal_damping_ratio, constants.tangential_damping_ratio];
        let mass = library.mass[0];
        let over = |mass: f64| [0, 1].map(|k| 2.0 * ratios[k] * (stiffness[k] / mass).sqrt());
        Ok(Self {
            file: file.to_owned(),
            start: list.iter().map(|p| p.position).collect(),
            radius: sphere.radius,
            density: mass / (4.0 / 3.0 * PI * sphere.radius.powi(3)),
            high: domain.corners().1,
            gravity: -scene.gravity.z,
            stiffness,
            friction: constants.friction,
            damping: over(0.5 * mass),
            wall_damping: over(mass),
            step: scene.dt,
            skin: scene.skin,
        })
    }

    /// Places `copies` copies side by side along x and along y, without the walls between them.
    pub(crate) fn tile(&mut self, copies: u32) {
        let of_one = std::mem::take(&mut self.start);
        let side = self.high.x;
        for (i, j) in (0..copies).flat_map(|i| (0..copies).map(move |j| (i, j))) {
            let shift = Vec3::new(f64::from(i), f64::from(j), 0.0) * side;
            self.start.extend(of_one.iter().map(|centre| centre + shift));
        }
        (self.high.x, self.high.y) = (side * f64::from(copies), side * f64::from(copies));
    }

    /// Keeps the `count` spheres in the smallest cube about the origin, in their order.
    pub(crate) fn cut(&mut self, count: usize) {
        let mut sides: Vec<f64> = self.start.iter().map(Vec3::max).collect();
        sides.sort_by(f64::total_cmp);
        if let Some(&side) = sides.get(count) {
            self.start.retain(|centre| centre.max() < side);
        }
    }
}

/// Distances between the same spheres in two states [m].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Apart {
    pub(crate) median: f64,
    /// One sphere in a hundred is farther.
    pub(crate) percentile_99: f64,
    pub(crate) largest: f64,
}

impl Apart {
    pub(crate) fn of(a: &[Vec3], b: &[Vec3]) -> Self {
        assert_eq!(a.len(), b.len());
        let mut distances: Vec<f64> = a.iter().zip(b).map(|(a, b)| (a - b).norm()).collect();
        distances.sort_by(f64::total_cmp);
        let last = distances.len() - 1;
        Self {
            median: distances[last / 2],
            percentile_99: distances[last * 99 / 100],
            largest: distances[last],
        }
    }
}
