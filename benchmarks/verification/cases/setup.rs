//! Scenes of a few particles and planes as a user would write them: a text and a file of particles, run through the program's
//! library.

pub(crate) use benchmarking::grains::Grain;

use benchmarking::grains::{csv, list};
use dem_mpi::comm::alone::Alone;
use dem_mpi::comm::{Comm, threads};
use dem_mpi::contact::Posed;
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::post::picture::Picture;
use dem_mpi::random::Random;
use dem_mpi::scene::{Scene, assemble};
use dem_mpi::sim::{Simulation, StepError};
use std::fmt::Write;

/// A plane wall at rest.
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    /// A point of the wall [m].
    pub(crate) point: Vec3,
    /// Normal towards the particles.
    pub(crate) normal: Vec3,
    /// Name of the material.
    pub(crate) material: &'static str,
}

impl Plane {
    /// The floor z = 0.
    pub(crate) fn floor(material: &'static str) -> Self {
        Self { point: Vec3::zeros(), normal: Vec3::z(), material }
    }
}

/// A scene of a few particles.
#[derive(Clone, Debug)]
pub(crate) struct Setup {
    /// Gravity [m/s²].
    pub(crate) gravity: Vec3,
    /// Tables `[[material]]`, `[[interaction]]`, `[[shape]]` and `[law]` of the scene, as TOML.
    pub(crate) text: String,
    /// Walls.
    pub(crate) planes: Vec<Plane>,
    /// Particles, in the order of their ids.
    pub(crate) grains: Vec<Grain>,
    /// Time step [s].
    pub(crate) dt: f64,
}

/// State of a particle at one time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Body {
    /// Centre [m].
    pub(crate) position: Vec3,
    /// Velocity [m/s].
    pub(crate) velocity: Vec3,
    /// Orientation, body to world.
    pub(crate) orientation: Quat,
    /// Angular velocity, world axes [rad/s].
    pub(crate) spin: Vec3,
    /// Angular momentum, world axes [kg m²/s].
    pub(crate) angular_momentum: Vec3,
    /// Number of contacts.
    pub(crate) contacts: usize,
    /// Mass [kg].
    pub(crate) mass: f64,
    /// Rank that owned it.
    pub(crate) rank: u32,
}

impl Body {
    /// Kinetic energy of translation and rotation [J].
    pub(crate) fn kinetic(&self) -> f64 {
        0.5 * self.mass * self.velocity.norm_squared() + self.rotational()
    }

    /// Kinetic energy of rotation [J].
    pub(crate) fn rotational(&self) -> f64 {
        0.5 * self.spin.dot(&self.angular_momentum)
    }
}

/// States of all particles at one time.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Frame {
    /// Time since the start [s].
    pub(crate) time: f64,
    /// States, in the order of the setup's particles.
    pub(crate) bodies: Vec<Body>,
}

impl Frame {
    /// Kinetic energy of all [J].
    pub(crate) fn kinetic(&self) -> f64 {
        self.bodies.iter().map(Body::kinetic).sum()
    }

    /// Whether any particles touch.
    pub(crate) fn is_touching(&self) -> bool {
        self.bodies.iter().any(|body| body.contacts > 0)
    }
}

/// Half width of the domain [m].
const WIDE: f64 = 1e3;

impl Setup {
    /// Text of the scene, and of its particle file. For several ranks, the domain is divided in two across the axis along
    /// which the particles are farthest apart, between them; a single particle crosses the boundary soon. The boundary stays
    /// there, and lists are made in every step.
    fn write(&self, ranks: u32) -> (String, String) {
        let soon = |grain: &Grain| grain.position + grain.velocity * (20.5 * self.dt);
        let middle = self.grains.iter().map(soon).sum::<Vec3>() / self.grains.len() as f64;
        let first = self.grains[0].position;
        let apart = self.grains.iter().fold(Vec3::zeros(), |most, grain| {
            most.zip_map(&(grain.position - first), |a, b| if b.abs() > a { b.abs() } else { a })
        });
        let half = Vec3::from_fn(|axis, _| if axis == apart.imax() { 2.0 * WIDE } else { WIDE });
        let mut scene = format!(
            "gravity = {}\n[domain]\nlow = {}\nhigh = {}\n",
            list(&self.gravity),
            list(&(middle - half)),
            list(&(middle + half)),
        );
        for (k, plane) in self.planes.iter().enumerate() {
            let (point, normal, material) =
                (list(&plane.point), list(&plane.normal), plane.material);
            let wall = format!(
                "name = \"{k}\"\npoint = {point}\nnormal = {normal}\nmaterial = \"{material}\""
            );
            writeln!(scene, "[[wall]]\n{wall}").expect("text");
        }
        let step = format!("[time]\nstep = {:e}\nsteps = 1", self.dt);
        let neighbours = if ranks > 1 { "[neighbours]\nskin = 0\nimbalance = 1e9" } else { "" };
        let file = "[[fill.file]]\npath = \"grains.csv\"\n[output]\ndirectory = \"out\"\nhistory_every = 0";
        write!(scene, "{}\n{step}\n{neighbours}\n{file}\n", self.text).expect("text");
        (scene, csv(&self.grains))
    }

    /// The checked scene, for this number of ranks.
    pub(crate) fn scene(&self, ranks: u32) -> Scene {
        let (text, grains) = self.write(ranks);
        parse(&text, &grains)
    }

    /// The scene for one rank, with more keys at its top.
    pub(crate) fn scene_with(&self, keys: &str) -> Scene {
        let (text, grains) = self.write(1);
        parse(&format!("{keys}\n{text}"), &grains)
    }

    /// Runs `steps` steps on one rank. Returns a frame at the start, after each `every` steps, and at the end.
    pub(crate) fn run(&self, steps: u64, every: u64) -> Vec<Frame> {
        run(&self.scene(1), steps, every)
    }

    /// Runs like `run` until the program stops with an error, which is returned as well.
    pub(crate) fn run_until_error(
        &self,
        steps: u64,
        every: u64,
    ) -> (Vec<Frame>, Option<StepError>) {
        let scene = self.scene(1);
        let (parts, error) = follow_until_error(&scene, &mut Alone::default(), steps, every);
        (parts.into_iter().map(in_order).collect(), error)
    }

    /// Runs like `run` on several ranks.
    pub(crate) fn run_on(&self, ranks: u32, steps: u64, every: u64) -> Vec<Frame> {
        let scene = self.scene(ranks);
        let parts = threads::run(ranks, |comm| follow(&scene, comm, steps, every));
        let mut all = parts.into_iter();
        let mut frames = all.next().expect("a rank");
        for part in all {
            for (frame, more) in frames.iter_mut().zip(part) {
                frame.1.extend(more.1);
            }
        }
        frames.into_iter().map(in_order).collect()
    }

    /// State after a time [s], in the nearest number of steps.
    pub(crate) fn after(&self, time: f64) -> Frame {
        let steps = (time / self.dt).round() as u64;
        self.run(steps, steps.max(1)).pop().expect("a last frame")
    }
}

/// A scene of this text and these particles, in `grains.csv`.
pub(crate) fn parse(text: &str, grains: &str) -> Scene {
    let folder = tempfile::tempdir().expect("a folder for the particles");
    std::fs::write(folder.path().join("grains.csv"), grains).expect("the file of particles");
    Scene::parse(text, "verification", folder.path(), &[])
        .unwrap_or_else(|errors| panic!("{errors}\n{text}"))
}

/// A scene of bodies that fall into a box with walls and a floor. They begin at rest in random orientations, in `high` layers
/// of `side` by `side` with this spacing [m]. `tables` has their material, and their shape under the name `shape`. The step
/// is far below the limit.
pub(crate) fn poured(
    tables: &str,
    shape: &'static str,
    spacing: f64,
    [side, high]: [u32; 2],
    random: &mut Random,
) -> Scene {
    let (width, top) = (spacing * f64::from(side), 2.0 * spacing * f64::from(high) + 2.0);
    let text = format!(
        "gravity = [0, 0, -9.81]\n[domain]\nlow = [0, 0, 0]\nhigh = [{width}, {width}, {top}]\n\
         walls = [\"-x\", \"+x\", \"-y\", \"+y\", \"-z\"]\n{tables}[time]\nstep = 1e-12\nsteps = 1\n\
         [[fill.file]]\npath = \"grains.csv\"\n[output]\ndirectory = \"out\"\n"
    );
    let grains = (0..side * side * high).map(|k| {
        let cell = [k % side, k / side % side, k / side / side].map(f64::from);
        let place = (Vec3::from(cell) + Vec3::new(0.5, 0.5, 0.6)) * spacing;
        Grain::at(shape, place).turned(random.rotation())
    });
    parse(&text, &csv(&grains.collect::<Vec<_>>()))
}

/// Runs `steps` steps of a scene on one rank. Returns a frame at the start, after each `every` steps, and at the end.
pub(crate) fn run(scene: &Scene, steps: u64, every: u64) -> Vec<Frame> {
    let frames = follow(scene, &mut Alone::default(), steps, every);
    frames.into_iter().map(in_order).collect()
}

/// Time, and the bodies of a rank with their ids.
type Part = (f64, Vec<(u64, Body)>);

fn in_order((time, mut bodies): Part) -> Frame {
    bodies.sort_unstable_by_key(|(id, _)| *id);
    Frame { time, bodies: bodies.into_iter().map(|(_, body)| body).collect() }
}

/// A simulation of the scene, with its particles, pairs and forces.
pub(crate) fn begun(scene: &Scene, comm: &mut dyn Comm) -> Simulation {
    let mut sim = assemble::assemble(scene, comm);
    assemble::fill(&mut sim, scene, comm);
    sim.begin(comm).unwrap_or_else(|error| panic!("{error}"));
    sim
}

fn follow(scene: &Scene, comm: &mut dyn Comm, steps: u64, every: u64) -> Vec<Part> {
    let (parts, error) = follow_until_error(scene, comm, steps, every);
    if let Some(error) = error {
        panic!("{error}");
    }
    parts
}

fn follow_until_error(
    scene: &Scene,
    comm: &mut dyn Comm,
    steps: u64,
    every: u64,
) -> (Vec<Part>, Option<StepError>) {
    let mut sim = begun(scene, comm);
    let mut parts = vec![part(&sim, comm)];
    for step in 1..=steps {
        if let Err(error) = sim.step(comm) {
            return (parts, Some(error));
        }
        if step % every == 0 || step == steps {
            parts.push(part(&sim, comm));
        }
    }
    (parts, None)
}

fn part(sim: &Simulation, comm: &dyn Comm) -> Part {
    let rank = comm.rank().0;
    let bodies =
        (0..sim.particles.owned).map(|slot| (sim.particles.id[slot].0, body(sim, slot, rank)));
    (sim.time(), bodies.collect())
}

/// State of a particle: the only place that depends on the program's storage.
pub(crate) fn body(sim: &Simulation, slot: usize, rank: u32) -> Body {
    let particles = &sim.particles;
    let angular_momentum = particles.angular_momentum(slot);
    let orientation =
        particles.orientation.as_ref().map(|orientation| orientation.quaternion[slot]);
    Body {
        position: particles.position[slot],
        velocity: particles.velocity[slot],
        orientation: orientation.unwrap_or_default(),
        spin: particles.angular_velocity_for(slot, &angular_momentum),
        angular_momentum,
        contacts: sim.contacts.coordination(particles)[slot] as usize,
        mass: particles.mass(slot),
        rank,
    }
}

/// Picture of the bodies from the side.
pub(crate) fn seen(sim: &Simulation) -> Picture {
    let particles = &sim.particles;
    let contacts = sim.contacts.coordination(particles);
    let mut picture = Picture::default();
    for (slot, &touching) in contacts.iter().enumerate().take(particles.owned) {
        let turn = particles.orientation.as_ref().map(|o| o.quaternion[slot]).unwrap_or_default();
        let frame = turn.to_rotation_matrix().into_inner();
        let shape = &particles.library.shapes[particles.shape[slot].index()];
        let body = Posed { scale: particles.scale_of(slot), ..Posed::new(shape, &frame) };
        picture.push(particles.id[slot], &particles.position[slot], &body, touching);
    }
    picture
}

/// Least-squares line through points: its value at 0, its slope, and the share of the variance that it explains.
pub(crate) fn least_squares(points: &[(f64, f64)]) -> (f64, f64, f64) {
    let n = points.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let (xx, yy) = (mean(&|p| (p.0 - x).powi(2)), mean(&|p| (p.1 - y).powi(2)));
    let xy = mean(&|p| (p.0 - x) * (p.1 - y));
    (y - xy / xx * x, xy / xx, xy * xy / (xx * yy))
}
