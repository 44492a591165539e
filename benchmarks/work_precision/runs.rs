//! Runs of the study: a packing under pressure, compressed by walls, with one setting changed.

use anyhow::{Context, anyhow, ensure};
use dem_mpi::comm::alone::Alone;
use dem_mpi::output::make_directory;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::post::report::Summary;
use dem_mpi::post::{Settings, analyse};
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble::{self, Continuation};
use dem_mpi::sim::run::{self, Schedule};
use dem_mpi::timing::Phase;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A kind of particles, all about as large as a ball of `DIAMETER`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Spheres,
    Ellipsoids2,
    Ellipsoids5,
    Superellipsoids,
    Boxes,
}

/// Diameter of the ball of equal volume [m].
const DIAMETER: f64 = 2e-3;
/// Density [kg/m³].
const DENSITY: f64 = 2600.0;
/// Default normal stiffness [N/m].
const STIFFNESS: f64 = 1e4;
/// Confining stress [Pa]: overlaps are about a thousandth of the diameter.
const STRESS: f64 = 5e3;
/// Axial strain of the compression.
const STRAIN: f64 = 0.06;
/// Initial lattice spacing over the bounding radius: room for any orientation.
const ROOMY: f64 = 3.0;
/// Largest initial displacement along each axis, over the bounding radius: the packing at rest is not a
/// lattice.
const JITTER: f64 = 0.45;
/// Rate of the axial strain over `√(p/ρ)/d`.
const INERTIAL: f64 = 6e-3;

impl Kind {
    pub(crate) const ALL: [Self; 5] =
        [Self::Spheres, Self::Ellipsoids2, Self::Ellipsoids5, Self::Superellipsoids, Self::Boxes];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Spheres => "spheres",
            Self::Ellipsoids2 => "ellipsoids 2:1",
            Self::Ellipsoids5 => "ellipsoids 5:1",
            Self::Superellipsoids => "superellipsoids",
            Self::Boxes => "boxes",
        }
    }

    /// Name in a file name.
    pub(crate) fn file(self) -> String {
        self.name().replace([' ', ':'], "_")
    }

    /// Keys in a scene. Balls of one size would come to rest as a crystal.
    fn keys(self) -> String {
        format!("{}size = {{ uniform = [0.75, 1.25] }}\n", self.shape())
    }

    fn shape(self) -> String {
        let ellipsoid = |ratio: f64| {
            format!("kind = \"ellipsoid\"\ndiameter = {DIAMETER:e}\naspect_ratio = {ratio}\n")
        };
        match self {
            Self::Spheres => format!("kind = \"sphere\"\ndiameter = {DIAMETER:e}\n"),
            Self::Ellipsoids2 => ellipsoid(2.0),
            Self::Ellipsoids5 => ellipsoid(5.0),
            Self::Superellipsoids => {
                "kind = \"superellipsoid\"\nsemi_axes = [1.05e-3, 0.9e-3, 0.75e-3]\n\
                 exponents = [0.6, 0.6]\n"
                    .to_owned()
            }
            Self::Boxes => {
                let half = [0.95e-3, 0.8e-3, 0.69e-3];
                let corners: Vec<[f64; 3]> = (0..8)
                    .map(|k| {
                        std::array::from_fn(|i| if k >> i & 1 == 1 { half[i] } else { -half[i] })
                    })
                    .collect();
                format!("kind = \"polyhedron\"\nvertices = {corners:?}\n")
            }
        }
    }

    /// Methods to compare with `auto`, as names and keys of `[contact]`.
    pub(crate) const fn methods(self) -> &'static [(&'static str, &'static str)] {
        const EPA: (&str, &str) = ("epa", "method = \"epa\"");
        const EROSION: (&str, &str) = ("gjk-erosion", "method = \"gjk-erosion\"");
        const FINE: (&str, &str) =
            ("gjk-erosion, 1 %", "method = \"gjk-erosion\"\nerosion_ratio = 0.01");
        match self {
            Self::Spheres => &[],
            Self::Boxes => &[EPA],
            _ => &[EPA, EROSION, FINE],
        }
    }
}

/// Settings in which runs differ.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Setting {
    /// Step over the stable limit.
    pub(crate) step: f64,
    /// Keys of `[contact]`.
    pub(crate) contact: &'static str,
    /// Normal stiffness over the default.
    pub(crate) stiffness: f64,
    /// Skin over the default.
    pub(crate) skin: f64,
}

/// Results of a run.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    pub(crate) steps: u64,
    /// Core time without reading and writing snapshots [s].
    pub(crate) seconds: f64,
    /// Axial stress [Pa].
    pub(crate) axial: f64,
    /// Mean stress [Pa].
    pub(crate) mean: f64,
    /// Mean coordination number.
    pub(crate) coordination: f64,
    /// Anisotropy of contact normals.
    pub(crate) a_c: f64,
    /// Energy error over the dissipated energy.
    pub(crate) missing: f64,
}

/// Particles of one kind and seed, in a folder of their own.
pub(crate) struct Packing {
    pub(crate) kind: Kind,
    pub(crate) seed: u64,
    /// Number of particles along each axis.
    pub(crate) along: u32,
    pub(crate) folder: PathBuf,
}

/// A packing at rest under pressure: its snapshot, and its height [m].
#[derive(Clone, Debug)]
pub(crate) struct Rested {
    snapshot: PathBuf,
    height: f64,
}

impl Packing {
    /// Text of the scene without time, stage and output.
    fn text(&self, setting: &Setting) -> anyhow::Result<String> {
        let Self { kind, seed, along, .. } = self;
        let shape = format!("[[shape]]\nname = \"grain\"\nmaterial = \"grain\"\n{}", kind.keys());
        let radius = self.bounding_radius()?;
        let side = ROOMY * radius * f64::from(*along);
        let skin = setting.skin * (0.1 * radius);
        let stiffness = setting.stiffness * STIFFNESS;
        let material = |name: &str, friction: f64| {
            format!(
                "[[material]]\nname = \"{name}\"\ndensity = {DENSITY}\nnormal_stiffness = {stiffness:e}\n\
                 friction = {friction}\nrestitution = 0.4\n"
            )
        };
        let (grain, wall) = (material("grain", 0.3), material("wall", 0.0));
        Ok(format!(
            "title = \"work and precision\"\nseed = {seed}\n[domain]\nlow = [0, 0, 0]\nhigh = [{side:e}, {side:e}, {side:e}]\n\
             walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\", \"+z\"]\nwall_material = \"wall\"\n{grain}{wall}{shape}\
             [contact]\n{}\n[neighbours]\nskin = {skin:e}\n[audit]\nevery = 0\n",
            setting.contact
        ))
    }

    /// Bounding radius of the particle [m].
    fn bounding_radius(&self) -> anyhow::Result<f64> {
        let text = format!(
            "[domain]\nlow = [0, 0, 0]\nhigh = [1, 1, 1]\n[[material]]\nname = \"grain\"\ndensity = {DENSITY}\n\
             normal_stiffness = {STIFFNESS:e}\n[[shape]]\nname = \"grain\"\n{}[[fill.lattice]]\nfirst = [0.5, 0.5, 0.5]\ncount = [1, 1, 1]\n\
             [time]\nstep = 1e-9\nsteps = 1\n[output]\ndirectory = \"none\"\n",
            self.kind.keys()
        );
        Ok(parsed(&text, &self.folder)?.library.largest_radius())
    }

    /// Servos along these axes.
    fn servos(axes: &[&str]) -> String {
        let servo = |axis: &&str| {
            format!(
                "[[servo]]\nwalls = [\"-{axis}\", \"+{axis}\"]\ncoupled = true\nstress = {STRESS:e}\nmax_speed = 0.5\n"
            )
        };
        axes.iter().map(servo).collect()
    }

    /// Stable limit of the time step [s].
    fn limit(&self, text: &str) -> anyhow::Result<f64> {
        let rest = "[[fill.lattice]]\ncount = [1, 1, 1]\nfirst = [1e-3, 1e-3, 1e-3]\n\
                    [time]\nstep = 1e-9\nsteps = 1\n[output]\ndirectory = \"none\"\n";
        let scene = parsed(&format!("{text}{rest}"), &self.folder)?;
        Ok(scene.time_step_limit().context("grains that push each other have a limit")?.dt)
    }

    /// Simulates from a lattice to rest under the same stress on all sides.
    pub(crate) fn rest(&self, stiffness: f64) -> anyhow::Result<Rested> {
        let setting = Setting { step: 0.5, contact: "", stiffness, skin: 1.0 };
        let text = self.text(&setting)?;
        let dt = setting.step * self.limit(&text)?;
        let (count, radius) = (self.along, self.bounding_radius()?);
        let text = format!(
            "{text}{}[[fill.lattice]]\nfirst = [{first:e}, {first:e}, {first:e}]\ncount = [{count}, {count}, {count}]\n\
             spacing = {:e}\njitter = {:e}\n[time]\nstep = {dt:e}\nsteps = 200_000\n\
             [stop]\nunbalanced = 2e-3\nservo = 5e-3\n[output]\ndirectory = \"none\"\n",
            Self::servos(&["x", "y", "z"]),
            ROOMY * radius,
            JITTER * radius,
            first = 0.5 * ROOMY * radius,
        );
        let out = self.folder.join(format!("rest_{stiffness:e}"));
        let (finish, sim) = ran(&text, &self.folder, None, &out)?;
        let there = sim.particles.owned;
        ensure!(there == count.pow(3) as usize, "{there} grains instead of {count} cubed");
        ensure!(finish.unmet.is_empty(), "{}: no rest: {}", self.kind.name(), finish.unmet);
        let height = summary(&finish.snapshot)?.height_m.context("walls on both sides")?;
        Ok(Rested { snapshot: finish.snapshot, height })
    }

    /// Compresses a packing along z, while the other sides keep their stress.
    pub(crate) fn shear(&self, rested: &Rested, setting: &Setting) -> anyhow::Result<Outcome> {
        let text = self.text(setting)?;
        let rate = INERTIAL * (STRESS / DENSITY).sqrt() / DIAMETER;
        let steps = (STRAIN / rate / (setting.step * self.limit(&text)?)).ceil();
        let (dt, speed) = (STRAIN / rate / steps, 0.5 * rate * rested.height);
        // Wall velocities belong to the table of the domain, which is the first.
        let moving = format!(
            "wall_velocity = {{ \"-z\" = [0, 0, {speed:e}], \"+z\" = [0, 0, {:e}] }}\n[[material]]",
            -speed
        );
        let text = text.replacen("[[material]]", &moving, 1);
        let text = format!(
            "start = '{}'\n{text}{}[time]\nstep = {dt:e}\nsteps = {steps}\n[output]\ndirectory = \"none\"\n",
            rested.snapshot.display(),
            Self::servos(&["x", "y"])
        );
        let Setting { step, stiffness, skin, contact } = setting;
        let method = contact.replace(|c: char| !c.is_ascii_alphanumeric(), "");
        let out = self.folder.join(format!("shear_{step}_{stiffness:e}_{skin}_{method}"));
        let before = seconds_of_this_thread()?;
        let (finish, sim) = ran(&text, &self.folder, Some(&rested.snapshot), &out)?;
        let of_core = seconds_of_this_thread()? - before;
        let found = summary(&finish.snapshot)?;
        let known = |value: Option<f64>| value.with_context(|| anyhow!("a packing under stress"));
        Ok(Outcome {
            steps: finish.steps_done,
            seconds: of_core - sim.clock.seconds(Phase::Output),
            axial: known(found.stress_zz_pa)?,
            mean: known(found.p_pa)?,
            coordination: known(found.coordination)?,
            a_c: known(found.a_c)?,
            missing: finish.measures.missing() / finish.measures.dissipated,
        })
    }
}

/// Core time of this thread since it began [s]: the first number of Linux's `schedstat`, in ns.
fn seconds_of_this_thread() -> anyhow::Result<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat")?;
    let ns = text.split_whitespace().next().context("an empty schedstat")?;
    Ok(1e-9 * ns.parse::<f64>()?)
}

pub(crate) fn parsed(text: &str, folder: &Path) -> anyhow::Result<Scene> {
    Scene::parse(text, "scene", folder, &[]).map_err(|errors| anyhow!("{errors}\n{text}"))
}

/// Runs a stage on one rank.
pub(crate) fn ran(
    text: &str,
    folder: &Path,
    start: Option<&Path>,
    out: &Path,
) -> anyhow::Result<(run::Finish, dem_mpi::sim::Simulation)> {
    let scene = parsed(text, folder)?;
    let mut comm = Alone::default();
    let mut sim = assemble::assemble(&scene, &comm);
    match start {
        None => assemble::fill(&mut sim, &scene, &comm),
        Some(start) => {
            assemble::take_up(&mut sim, &scene, start, Continuation::NewStage, &mut comm)?;
        }
    }
    make_directory(out, &mut comm)?;
    let schedule = Schedule {
        last_step: sim.step + scene.steps,
        ends_stage: true,
        snapshot_every: 0,
        snapshot_every_minutes: None,
        history_every: 0,
        stop: scene.stop.clone(),
        out: out.to_owned(),
        scene: scene.text.clone(),
        resumed: false,
        signal: Arc::default(),
        traced: Vec::new(),
        duration: scene.duration,
        over: scene.over_the_limit(),
    };
    let finish = run::run(&mut sim, &schedule, &mut comm, &mut |_| ())?;
    Ok((finish, sim))
}

fn summary(snapshot: &Path) -> anyhow::Result<Summary> {
    let reader = Reader::open(snapshot)?;
    Ok(analyse(&reader, "packing", Settings::default())?.report.summary)
}
