//! Test of an installed program: `dem-mpi --self-test`.
//!
//! Three closed forms and a small run that is written, read again and compared with the bits of the developers' machine.

use super::assemble::{self, StartError};
use super::{Scene, SceneErrors};
use crate::comm::Comm;
use crate::contact::Method;
use crate::math::Vec3;
use crate::output::SnapshotError;
use crate::output::snapshot::Reader;
use crate::pairs;
use crate::random::mixed;
use crate::sim::run::{RunError, Schedule, run};
use crate::sim::{Simulation, StepError};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

/// Grains of every kind.
const CROWD: &str = include_str!("self_test.toml");
const STEPS: u64 = 1500;
/// Hash of the crowd after its steps.
const BITS: u64 = 0x0058_87c7_f0e2_9647;

/// Two balls that may meet.
const BALLS: &str = r#"
gravity = GRAVITY
[domain]
low = [-1, -1, -20]
high = [1, 1, 1]
[[material]]
name = "steel"
density = 7800
normal_stiffness = 1e6
friction = 0.5
restitution = 1
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.1
[[fill.lattice]]
shapes = ["ball"]
first = [-0.3, 0, 0]
count = [1, 1, 1]
velocity = [2, 0, 0]
[[fill.lattice]]
shapes = ["ball"]
first = [0.3, 0, 0]
count = [1, 1, 1]
velocity = [-1, 0, 0]
[time]
step = 1e-4
steps = 2000
[output]
directory = "out"
"#;

/// Reason why the tests could not be done.
#[derive(Debug, thiserror::Error)]
pub enum SelfTestError {
    /// A scene of the tests is rejected.
    #[error(transparent)]
    Scene(#[from] SceneErrors),
    /// The particles cannot be placed.
    #[error(transparent)]
    Start(#[from] StartError),
    /// A step failed.
    #[error(transparent)]
    Step(#[from] StepError),
    /// The run failed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The snapshot cannot be read.
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
}

/// Results of the tests.
#[derive(Debug, Default)]
pub struct Results {
    /// One line for each test.
    pub text: String,
    /// Have all passed?
    pub passed: bool,
}

impl Results {
    fn add(&mut self, name: &str, error: f64, limit: f64) {
        let passes = error <= limit;
        self.passed &= passes;
        let verdict = if passes { "ok" } else { "WRONG" };
        let _ = writeln!(self.text, "  {name:<54}{error:.1e}, at most {limit:.0e}: {verdict}");
    }

    fn add_bits(&mut self, name: &str, bits: u64, wanted: u64) {
        self.passed &= bits == wanted;
        let verdict = if bits == wanted { "equal: ok" } else { "DIFFERENT" };
        let _ = writeln!(self.text, "  {name:<54}{bits:012x}, {verdict}");
    }
}

/// Runs the tests on all ranks; files go into a folder that all ranks see. Collective, and the results are equal on all ranks.
///
/// # Errors
/// See [`SelfTestError`].
pub fn self_test(folder: &Path, comm: &mut dyn Comm) -> Result<Results, SelfTestError> {
    let mut results = Results { passed: true, ..Results::default() };
    results.add("an ellipsoid and a ball: overlap", overlap(), 1e-13);
    results.add("free fall: height over its closed form", fall(comm)?, 1e-12);
    results.add("elastic balls exchange velocities", exchange(comm)?, 1e-5);
    crowd(folder, &mut results, comm)?;
    Ok(results)
}

/// Error of the overlap of an ellipsoid with a ball whose centre is on the ellipsoid's normal, over the overlap.
fn overlap() -> f64 {
    let (axes, radius, wanted) = (Vec3::new(1.0, 2.0, 3.0), 0.5, 0.01);
    let outwards = Vec3::new(0.36, 0.48, 0.8);
    let scaled = outwards.component_mul(&axes);
    let centre = scaled.component_mul(&axes) / scaled.norm() + outwards * (radius - wanted);
    let text = format!(
        "id,aA,bA,cA,aB,bB,cB,xA,yA,zA,xB,yB,zB,qwA,qxA,qyA,qzA,qwB,qxB,qyB,qzB\n\
         1,1,2,3,{radius},{radius},{radius},0,0,0,{:?},{:?},{:?},1,0,0,0,1,0,0,0\n",
        centre.x, centre.y, centre.z
    );
    let Ok(pairs) = pairs::read::read("self-test", &text) else { return f64::INFINITY };
    let answer = pairs::resolve(&pairs, &Method::Auto).into_iter().next();
    let touch = answer.and_then(|answer| answer.touch.ok());
    touch.map_or(f64::INFINITY, |touch| (touch.overlap / wanted - 1.0).abs())
}

/// Simulation of the two balls after their steps.
fn balls(gravity: &str, comm: &mut dyn Comm) -> Result<Simulation, SelfTestError> {
    let text = BALLS.replace("GRAVITY", gravity);
    let scene = Scene::parse(&text, "self-test", Path::new("."), &[])?;
    let (mut sim, _) = assemble::started(&scene, None, comm)?;
    sim.begin(comm)?;
    for _ in 0..scene.steps {
        sim.step(comm)?;
    }
    Ok(sim)
}

/// Largest value of all ranks of a number of each owned particle; infinite if one is no number.
fn largest(sim: &Simulation, comm: &mut dyn Comm, of: impl Fn(usize) -> f64) -> f64 {
    let known = |number: f64| if number.is_nan() { f64::INFINITY } else { number };
    let mut most = [(0..sim.particles.owned).map(of).map(known).fold(0.0, f64::max)];
    comm.max(&mut most);
    most[0]
}

fn fall(comm: &mut dyn Comm) -> Result<f64, SelfTestError> {
    let sim = balls("[0, 0, -9.81]", comm)?;
    let height = -0.5 * 9.81 * (sim.step as f64 * sim.dt).powi(2);
    let particles = &sim.particles;
    Ok(largest(&sim, comm, |slot| (particles.position[slot].z / height - 1.0).abs()))
}

fn exchange(comm: &mut dyn Comm) -> Result<f64, SelfTestError> {
    let sim = balls("[0, 0, 0]", comm)?;
    let particles = &sim.particles;
    Ok(largest(&sim, comm, |slot| {
        let wanted = if particles.id[slot].0 == 0 { -1.0 } else { 2.0 };
        (particles.velocity[slot] - Vec3::new(wanted, 0.0, 0.0)).norm()
    }))
}

/// Energy, bits and snapshot of a run of all kinds of grains.
fn crowd(folder: &Path, results: &mut Results, comm: &mut dyn Comm) -> Result<(), SelfTestError> {
    let scene = Scene::parse(CROWD, "self-test", Path::new("."), &[])?;
    let (mut sim, _) = assemble::started(&scene, None, comm)?;
    let schedule = Schedule {
        last_step: STEPS,
        ends_stage: true,
        snapshot_every: 0,
        snapshot_every_minutes: None,
        history_every: 100,
        stop: scene.stop.clone(),
        out: folder.to_owned(),
        scene: scene.text.clone(),
        resumed: false,
        signal: Arc::default(),
        traced: Vec::new(),
        duration: None,
        over: scene.over_the_limit(),
    };
    let finish = run(&mut sim, &schedule, comm, &mut |_| ())?;
    let measures = &finish.measures;
    results.add(
        "all kinds of grains: energy missing over dissipated",
        (measures.missing() / measures.dissipated).abs(),
        1e-3,
    );
    let hash = |id: u64, place: &Vec3, velocity: &Vec3| {
        let [x, y, z] = (*place).into();
        let [u, v, w] = (*velocity).into();
        // Sums of all particles do not overflow.
        mixed(&[id, x.to_bits(), y.to_bits(), z.to_bits(), u.to_bits(), v.to_bits(), w.to_bits()])
            >> 16
    };
    let particles = &sim.particles;
    let hashes = (0..particles.owned).map(|slot| {
        hash(particles.id[slot].0, &particles.position[slot], &particles.velocity[slot])
    });
    let mut bits = [hashes.sum::<u64>() as i64];
    comm.sum(&mut bits);
    let reader = Reader::open(folder)?;
    let saved = reader.particles(0..reader.particle_count())?;
    let saved: u64 = (0..saved.id.len())
        .map(|row| hash(saved.id[row].0, &saved.position[row], &saved.velocity[row]))
        .sum();
    results.add_bits("a snapshot, read again", saved, bits[0] as u64);
    results.add_bits("all kinds of grains on the developers' machine", bits[0] as u64, BITS);
    Ok(())
}
