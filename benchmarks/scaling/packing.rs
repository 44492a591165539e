//! Simulated packings: a periodic cell of packed ellipsoids, repeated side by side, and a settled box.

use anyhow::anyhow;
use dem_mpi::cell::Cell;
use dem_mpi::comm::Comm;
use dem_mpi::comm::alone::Alone;
use dem_mpi::ids::{GlobalId, Rank};
use dem_mpi::math::Vec3;
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::{Scene, assemble, packing};
use dem_mpi::sim::{Simulation, capture};
use std::path::Path;

/// Number of particles in a cell.
pub(crate) const CELL: u32 = 1000;
/// The ellipsoids of `benchmarks/settled`, far from each other.
const DILUTE: &str = r#"
title = "Packed ellipsoids, periodic along all axes"
domain = { low = [0.0, 0.0, 0.0], high = [0.055, 0.055, 0.055], periodic = [true, true, true] }
time = { step = 1e-5, steps = 1 }
output = { directory = "target/scaling", history_every = 0 }
[[material]]
name = "grain"
density = 265000.0
normal_stiffness = 1.5e5
friction = 0.3
[[shape]]
name = "grain"
kind = "ellipsoid"
diameter = 0.003
aspect_ratio = 2.0
[[fill.lattice]]
first = [0.00275, 0.00275, 0.00275]
count = [10, 10, 10]
spacing = 0.0055
"#;
/// Volume of the particles over that of the cell.
const SOLID: f64 = 0.64;
/// Number of stages in which the cell shrinks, and steps of each.
const STAGES: (u32, u32) = (60, 150);
/// Damping that removes the energy of the compression [1/s].
const DAMPING: f64 = 1000.0;
/// Common velocity of all particles [m/s]. With it the pair list is stale every 14 steps, as in `run/packing`,
/// where particles rain into a box, and particles change ranks. Contacts are not affected.
const DRIFT: Vec3 = Vec3::new(0.5, 0.5, 0.5);

/// A cube of packed particles that repeats along all axes.
pub(crate) struct Packing {
    /// Scene of one cell.
    scene: Scene,
    particles: Vec<Particle>,
}

/// A box from the origin that repeats along all axes [m].
fn cube(edges: Vec3) -> Cell {
    Cell::new(Vec3::zeros(), edges, [true; 3])
}

impl Packing {
    /// Compresses a lattice of randomly oriented ellipsoids to a packing at rest.
    pub(crate) fn new() -> anyhow::Result<Self> {
        let mut scene =
            Scene::parse(DILUTE, "packing", Path::new(""), &[]).map_err(|e| anyhow!("{e}"))?;
        let mut particles: Vec<Particle> = packing::initial(&scene).collect();
        let grains = f64::from(CELL) * scene.library.shapes[0].volume();
        let (first, last) = (scene.domain.corners().1.x, (grains / SOLID).cbrt());
        let (stages, steps) = STAGES;
        for stage in 1..=stages + 10 {
            let side =
                first * (last / first).powf(f64::from(stage.min(stages)) / f64::from(stages));
            let shrink = side / scene.domain.corners().1.x;
            scene.domain = cube(Vec3::repeat(side));
            let mut comm = Alone::default();
            let mut sim = assemble::assemble(&scene, &comm);
            sim.field.damping = DAMPING;
            sim.particles.strip_to_owned();
            for particle in &mut particles {
                particle.position *= shrink;
                sim.insert(particle);
            }
            sim.begin(&mut comm)?;
            for _ in 0..steps {
                sim.step(&mut comm)?;
            }
            particles = capture::particles_of(&sim.particle_table(Rank(0)), |shape| shape);
        }
        particles.sort_by_key(|particle| particle.id);
        for particle in &mut particles {
            let Particle { id, shape, position, quaternion, .. } = *particle;
            let still = Particle::at_rest(id, shape, position);
            *particle = Particle { velocity: DRIFT, quaternion, ..still };
        }
        Ok(Self { scene, particles })
    }

    /// A simulation of this number of cells along each axis, with this rank's particles.
    pub(crate) fn begun(&self, cells: [u32; 3], comm: &mut dyn Comm) -> Simulation {
        let side = self.scene.domain.corners().1.x;
        let mut scene = self.scene.clone();
        scene.domain = cube(Vec3::from(cells.map(|count| f64::from(count) * side)));
        let mut sim = assemble::assemble(&scene, comm);
        sim.particles.strip_to_owned();
        for x in 0..cells[0] {
            for y in 0..cells[1] {
                for z in 0..cells[2] {
                    let corner = Vec3::new(f64::from(x), f64::from(y), f64::from(z)) * side;
                    for particle in &self.particles {
                        let position = particle.position + corner;
                        let id = GlobalId(sim.next_id);
                        sim.next_id += 1;
                        if sim.domain.owner(&position) == comm.rank() {
                            sim.insert(&Particle { id, position, ..particle.clone() });
                        }
                    }
                }
            }
        }
        sim.begin(comm).expect("the packing begins well");
        sim
    }
}

/// Powers of two along the axes, as equal as possible, with product `cells`.
pub(crate) fn arranged(cells: u32) -> [u32; 3] {
    let twos = cells.ilog2();
    assert!(cells == 1 << twos, "a power of two");
    [0, 1, 2].map(|axis| 1 << ((twos + 2 - axis) / 3))
}

/// 5,120 ellipsoids at rest in a box.
pub(crate) fn settled(comm: &mut dyn Comm) -> Simulation {
    let scene = Scene::read(Path::new("benchmarks/settled/scene.toml"), &[]);
    let scene = scene.unwrap_or_else(|errors| panic!("{errors}"));
    let mut sim = assemble::assemble(&scene, comm);
    assemble::fill(&mut sim, &scene, comm);
    sim.begin(comm).expect("the settled box begins well");
    sim
}
