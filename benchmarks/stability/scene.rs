//! Scenes of a few particles, as a user would write them.

pub(crate) use benchmarking::grains::Grain;

use benchmarking::grains::{csv, list};
use dem_mpi::math::Vec3;
use dem_mpi::scene::Scene as Checked;
use std::fmt::Write;

/// Radius of most balls [m].
pub(crate) const RADIUS: f64 = 0.01;
/// Density of most particles [kg/m³].
pub(crate) const DENSITY: f64 = 2500.0;
/// Gravity of scenes with gravity [m/s²].
pub(crate) const G: f64 = 9.81;
/// Mass of a ball of this radius and density [kg].
pub(crate) const MASS: f64 = 4.0 / 3.0 * std::f64::consts::PI * RADIUS * RADIUS * RADIUS * DENSITY;

/// Length of a time step.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Step {
    /// In seconds.
    Seconds(f64),
    /// Relative to the largest stable step.
    OfLimit(f64),
}

/// Length of a stage.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Length {
    /// In steps.
    Steps(u64),
    /// In seconds.
    Seconds(f64),
}

/// Text of a scene, with its file of particles.
#[derive(Clone, Debug)]
pub(crate) struct Scene {
    /// Gravity [m/s²].
    pub(crate) gravity: Vec3,
    /// Corners of the domain [m].
    pub(crate) low: Vec3,
    pub(crate) high: Vec3,
    /// Keys of `[domain]`, such as its walls.
    pub(crate) domain: String,
    /// Keys above all tables.
    pub(crate) keys: String,
    /// Materials, shapes, and all other tables.
    pub(crate) tables: String,
    pub(crate) grains: Vec<Grain>,
    pub(crate) step: Step,
    pub(crate) length: Length,
    /// Keys of `[time]`.
    pub(crate) time: String,
}

impl Scene {
    /// Particles without external forces, in a wide domain without walls.
    pub(crate) fn free(tables: String, grains: Vec<Grain>) -> Self {
        let wide = Vec3::repeat(1e3 * RADIUS);
        Self {
            gravity: Vec3::zeros(),
            low: -wide,
            high: wide,
            domain: String::new(),
            keys: String::new(),
            tables,
            grains,
            step: Step::OfLimit(0.05),
            length: Length::Steps(1000),
            time: String::new(),
        }
    }

    /// Particles above a floor at z = 0.
    pub(crate) fn on_floor(tables: String, grains: Vec<Grain>) -> Self {
        let mut scene = Self::free(tables, grains);
        scene.low.z = 0.0;
        "walls = [\"-z\"]".clone_into(&mut scene.domain);
        scene
    }

    /// The scene under gravity.
    pub(crate) fn heavy(self) -> Self {
        Self { gravity: Vec3::new(0.0, 0.0, -G), ..self }
    }

    /// The scene with this step and length.
    pub(crate) fn lasting(self, step: Step, length: Length) -> Self {
        Self { step, length, ..self }
    }

    /// Text of a stage that begins from the snapshots in `before`, if there are any, and text of the file
    /// `grains.csv`.
    pub(crate) fn texts(&self, before: Option<&str>) -> (String, String) {
        let dt = self.dt();
        let steps = match self.length {
            Length::Steps(steps) => steps,
            Length::Seconds(time) => (time / dt).ceil() as u64,
        };
        let text = self.text(dt, steps, before);
        (text, csv(&self.grains))
    }

    /// Time step [s].
    pub(crate) fn dt(&self) -> f64 {
        match self.step {
            Step::Seconds(dt) => dt,
            // If the rest of the scene is invalid, the program itself shall reject it.
            Step::OfLimit(share) => share * self.limit().unwrap_or(1e-6),
        }
    }

    /// Largest stable step [s], computed by the library of the program.
    fn limit(&self) -> Option<f64> {
        // A scene with any accepted step, and one particle of each shape.
        let mut other = self.clone();
        "allow_unstable = true".clone_into(&mut other.time);
        let text = other.text(1e-300, 1, None);
        let middle = 0.5 * (self.low + self.high);
        let mut grains = "shape,x,y,z\n".to_owned();
        for name in self.tables.split("[[shape]]\nname = \"").skip(1) {
            let name = name.split('"').next()?;
            let _ = writeln!(grains, "{name},{:e},{:e},{:e}", middle.x, middle.y, middle.z);
        }
        let folder = tempfile::tempdir().ok()?;
        std::fs::write(folder.path().join("grains.csv"), grains).ok()?;
        let checked = Checked::parse(&text, "limit", folder.path(), &[]).ok()?;
        Some(checked.time_step_limit()?.dt)
    }

    fn text(&self, dt: f64, steps: u64, before: Option<&str>) -> String {
        let start = before.map_or(String::new(), |folder| format!("start = \"{folder}\"\n"));
        let fill = if before.is_some() { "" } else { "[[fill.file]]\npath = \"grains.csv\"\n" };
        format!(
            "{start}{}\ngravity = {}\n[domain]\nlow = {}\nhigh = {}\n{}\n{}\n{fill}[time]\nstep = {dt:e}\nsteps = {steps}\n{}\n\
             [output]\ndirectory = \"out\"\n",
            self.keys,
            list(&self.gravity),
            list(&self.low),
            list(&self.high),
            self.domain,
            self.tables,
            self.time
        )
    }
}

/// Text of a material.
pub(crate) fn material(name: &str, density: f64, stiffness: f64, keys: &str) -> String {
    format!(
        "[[material]]\nname = \"{name}\"\ndensity = {density:e}\nnormal_stiffness = {stiffness:e}\n{keys}\n"
    )
}

/// Text of a shape of the material of its name.
pub(crate) fn shape(name: &str, kind: &str, keys: &str) -> String {
    format!("[[shape]]\nname = \"{name}\"\nkind = \"{kind}\"\n{keys}\n")
}

/// Text of balls of [`RADIUS`] of one material.
pub(crate) fn balls(stiffness: f64, keys: &str) -> String {
    material("m", DENSITY, stiffness, keys)
        + &shape("ball", "sphere", &format!("radius = {RADIUS}"))
}

/// Corners of a cuboid as text.
pub(crate) fn cuboid(edges: [f64; 3]) -> String {
    let side = |k: u32, i: usize| if k >> i & 1 == 1 { 0.5 * edges[i] } else { -0.5 * edges[i] };
    let corners: Vec<String> = (0..8).map(|k| list(&Vec3::from_fn(|i, _| side(k, i)))).collect();
    format!("vertices = [{}]", corners.join(", "))
}
