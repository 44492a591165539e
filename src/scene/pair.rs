//! What acts in a pair that stands by itself, by the law of a scene.

use super::{Fill, Listed, Scene, assemble, laws};
use crate::cell::Cell;
use crate::comm::alone::Alone;
use crate::contact::{Geometry, Pair, Previous, StateColumn};
use crate::ids::{MaterialId, Slot};
use crate::law::{Choice, Last, Sums, Work};
use crate::math::Vec3;
use crate::pairs::Body;
use crate::population::Library;
use crate::sim::{Simulation, audit};
use crate::text::{MOST_NAMED, listed};
use thiserror::Error;

/// What acts in a pair at rest, as if its bodies had just been put there: nothing is remembered, and dashpots do nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acting {
    /// Force of A on B [N].
    pub force: Vec3,
    /// Its moment about the centre of A [N m].
    pub moment: Vec3,
    /// Elastic energy, less that of adhesion [J].
    pub stored: f64,
}

/// Why the law says nothing of a pair.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PairError {
    /// The scene has no such material.
    #[error("the scene has no material `{0}`: there are {1}")]
    NoMaterial(String, String),
    /// The law is not for these shapes.
    #[error("{0}")]
    Shape(String),
    /// The contact could not be resolved.
    #[error("the contact cannot be resolved: {0}")]
    Contact(String),
    /// No contact outlives its overlap.
    #[error(
        "contacts of this law end where their overlap does: only those of adhesion = \"jkr\" hold on across a gap"
    )]
    NothingHolds,
}

impl Scene {
    /// The material of this name.
    ///
    /// # Errors
    /// If there is none.
    pub fn material(&self, name: &str) -> Result<MaterialId, PairError> {
        let names = || self.materials.iter().map(|material| &*material.name);
        let found = names().position(|other| other == name);
        let none = || {
            let all = listed(names(), MOST_NAMED);
            PairError::NoMaterial(name.to_owned(), all)
        };
        found.map(|index| MaterialId(index as u16)).ok_or_else(none)
    }

    /// What acts in a pair of bodies of these materials. With `touched` they have touched before, and hold on across a gap if
    /// the law does.
    ///
    /// # Errors
    /// If the law is not for such bodies, their contact cannot be resolved, or no contact of it can be `touched` across a gap.
    pub fn acting(
        &self,
        bodies: [&Body; 2],
        materials: [MaterialId; 2],
        touched: bool,
    ) -> Result<Acting, PairError> {
        if touched && !matches!(self.law, Choice::Jkr(_)) {
            return Err(PairError::NothingHolds);
        }
        let scene = self.of_pair(bodies, materials);
        if let Some((_, message)) = laws::unfit(&scene.law, &scene.library).into_iter().next() {
            return Err(PairError::Shape(message));
        }
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(&scene, &comm);
        assemble::fill(&mut sim, &scene, &comm);
        sim.begin(&mut comm).map_err(|error| PairError::Contact(error.to_string()))?;
        if touched && let Some(acting) = across_gap(&mut sim) {
            return Ok(acting);
        }
        let on_a = sim.particles.force.first().map_or_else(Vec3::zeros, |sum| sum.vector);
        let torque = sim.particles.spin.as_ref().map_or_else(Vec3::zeros, |s| s.torque[0].vector);
        let stored = sim.measure(&mut comm).stored;
        Ok(Acting { force: -on_a, moment: -torque, stored })
    }

    /// The scene with these two bodies and nothing else.
    fn of_pair(&self, bodies: [&Body; 2], materials: [MaterialId; 2]) -> Self {
        let mut library = Library::default();
        let mut grains = Vec::new();
        for ((body, material), name) in bodies.into_iter().zip(materials).zip(["A", "B"]) {
            let density = self.materials[material.index()].density;
            let shape = library.push(name, body.shape.clone(), material, density);
            grains.push(Listed {
                shape,
                scale: 1.0,
                position: body.centre,
                quaternion: body.rotation,
                velocity: Vec3::zeros(),
                angular_velocity: Vec3::zeros(),
            });
        }
        library.particle_shapes = 2;
        let [a, b] = bodies.map(|body| body.centre);
        let room = Vec3::repeat((b - a).norm() + 4.0 * library.largest_radius());
        let middle = (a + b) * 0.5;
        Self {
            domain: Cell::new(middle - room, middle + room, [false; 3]),
            skin: 0.1 * library.largest_radius(),
            library,
            walls: Vec::new(),
            servos: Vec::new(),
            free_walls: Vec::new(),
            gravity: Vec3::zeros(),
            initial: vec![Fill::Listed(grains)],
            rain: None,
            inlets: Vec::new(),
            outlets: Vec::new(),
            audit: audit::Settings { every: 0, ..self.audit },
            start: None,
            ..self.clone()
        }
    }
}

/// What acts in two spheres that have touched and are apart by no more than the law holds on.
fn across_gap(sim: &mut Simulation) -> Option<Acting> {
    let pair = Pair { a: Slot(0), b: Slot(1) };
    let particles = &sim.particles;
    let apart = particles.position[1] - particles.position[0];
    let gap = apart.norm() - particles.radius(0) - particles.radius(1);
    if !(0.0..=sim.law.outlives(pair, particles)).contains(&gap) {
        return None;
    }
    let geometry = Geometry { normal: apart.normalize(), overlap: -gap };
    let mut state = vec![0.0; StateColumn::total_width(sim.law.state())];
    let mut forces = [Vec3::zeros()];
    let mut sums = Sums::default();
    sums.begin(&mut sim.particles);
    let mut work = Work {
        pairs: &[pair],
        geometry: &[geometry],
        points: &[],
        patches: &[],
        curvatures: &[],
        shares: &[],
        from: &[Previous::NONE],
        last: Last { pairs: &[], geometry: &[], state: &[] },
        separated: &[],
        state: &mut state,
        forces: &mut forces,
    };
    sim.law.apply(&mut work, &sim.particles, 0.0, &mut sums);
    sums.end(&mut sim.particles);
    let stored = sim.law.stored(pair, &sim.particles, &geometry, &state);
    Some(Acting { force: forces[0], moment: Vec3::zeros(), stored })
}
