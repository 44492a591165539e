//! A simulation from a scene's text, on one rank, for tests that look inside.

use dem_mpi::comm::Comm;
use dem_mpi::comm::alone::Alone;
use dem_mpi::ids::GlobalId;
use dem_mpi::particles::records::Particle;
use dem_mpi::scene::{Scene, assemble};
use dem_mpi::sim::Simulation;
use std::path::Path;

/// The scene that a text means.
pub(crate) fn scene(text: &str) -> Scene {
    Scene::parse(text, "test", Path::new(""), &[]).unwrap_or_else(|errors| panic!("{errors}"))
}

/// The scene's simulation on the ranks of `comm`, with all particles, pairs listed and forces known.
pub(crate) fn begun(scene: &Scene, comm: &mut dyn Comm) -> Simulation {
    let mut sim = assemble::assemble(scene, comm);
    assemble::fill(&mut sim, scene, comm);
    sim.begin(comm).expect("the scene begins well");
    sim
}

/// One rank with just these particles in a scene (whose own are left out).
pub(crate) struct Bench {
    pub(crate) sim: Simulation,
    comm: Alone,
}

impl Bench {
    pub(crate) fn new(text: &str, particles: &[Particle]) -> Self {
        Self::of(&scene(text), particles)
    }

    fn of(scene: &Scene, particles: &[Particle]) -> Self {
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(scene, &comm);
        sim.particles.strip_to_owned();
        for particle in particles {
            sim.insert(particle);
        }
        sim.begin(&mut comm).expect("the scene begins well");
        Self { sim, comm }
    }

    /// The same, with moments of inertia so large that nothing turns.
    pub(crate) fn heavy_to_turn(scene: &Scene, particles: &[Particle]) -> Self {
        let mut scene = scene.clone();
        for inertia in &mut scene.library.inertia {
            *inertia *= 1e9;
        }
        Self::of(&scene, particles)
    }

    pub(crate) fn step(&mut self) {
        self.sim.step(&mut self.comm).expect("the step is done");
    }

    pub(crate) fn measure(&mut self) -> dem_mpi::measure::Measures {
        self.sim.measure(&mut self.comm)
    }

    /// The slot of a particle now.
    pub(crate) fn slot(&self, id: u64) -> usize {
        let ids = &self.sim.particles.id[..self.sim.particles.owned];
        ids.iter().position(|&other| other == GlobalId(id)).expect("the particle is there")
    }
}
