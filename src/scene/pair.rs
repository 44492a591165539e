//! Forces in a single pair of bodies, by the law of a scene.

use super::{Fill, Listed, Method, Scene, assemble, laws};
use crate::cell::Cell;
use crate::comm::alone::Alone;
use crate::contact::{Geometry, Pair, Previous, StateColumn, Touch};
use crate::contacts::Loaded;
use crate::ids::{GlobalId, MaterialId, Slot};
use crate::law::{Choice, Last, Sums, Work};
use crate::math::Vec3;
use crate::pairs::{Body, Place};
use crate::population::Library;
use crate::sim::{Simulation, audit};
use crate::text::{MOST_NAMED, listed};
use std::path::Path;
use thiserror::Error;

/// Forces in a pair at rest, as if its bodies had just been placed: without history and dashpot forces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Acting {
    /// Force of A on B [N].
    pub force: Vec3,
    /// Its moment about the centre of A [N m].
    pub moment: Vec3,
    /// Elastic energy, less that of adhesion [J].
    pub stored: f64,
}

/// A scene whose contacts have a stiffness of 1 N/m and nothing else.
const OF_UNIT_STIFFNESS: &str = r#"
domain = { low = [-1, -1, -1], high = [1, 1, 1] }
material = [{ name = "m", density = 1, normal_stiffness = 1 }]
shape = [{ name = "ball", kind = "sphere", radius = 1 }]
fill = { lattice = [{ first = [0, 0, 0], count = [1, 1, 1] }] }
time = { step = "auto", steps = 1 }
output = { directory = "out" }
"#;

/// Reason why the law gives no force for a pair.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PairError {
    /// The scene has no such material.
    #[error("the scene has no material `{0}`: there are {1}")]
    NoMaterial(String, String),
    /// The law does not hold for these shapes.
    #[error("{0}")]
    Shape(String),
    /// The contact could not be resolved.
    #[error("the contact cannot be resolved: {0}")]
    Contact(String),
    /// Contacts of this law do not outlive their overlap.
    #[error(
        "contacts of this law end with their overlap: only adhesion = \"jkr\" acts across a gap"
    )]
    NothingHolds,
}

impl Acting {
    /// Force, moment and energy, in this order.
    pub fn numbers(&self) -> [f64; 7] {
        let Self { force, moment, stored } = self;
        [force.x, force.y, force.z, moment.x, moment.y, moment.z, *stored]
    }
}

impl Scene {
    /// Material with this name.
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

    /// Forces in a pair of bodies of these materials. With `touched` they have touched before, and stick across a gap if
    /// the law allows it.
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
        let mut sim = self.with_pair(bodies, materials)?;
        if touched && let Some(acting) = across_gap(&mut sim) {
            return Ok(acting);
        }
        let on_a = sim.particles.force.first().map_or_else(Vec3::zeros, |sum| sum.vector);
        let torque = sim.particles.spin.as_ref().map_or_else(Vec3::zeros, |s| s.torque[0].vector);
        let stored = sim.measure(&mut Alone::default()).stored;
        Ok(Acting { force: -on_a, moment: -torque, stored })
    }

    /// Force and contact point in each place where two bodies touch.
    ///
    /// # Errors
    /// See [`Scene::acting`].
    pub fn places(
        &self,
        bodies: [&Body; 2],
        materials: [MaterialId; 2],
    ) -> Result<Vec<(Touch, Acting)>, PairError> {
        let sim = self.with_pair(bodies, materials)?;
        let particles = &sim.particles;
        let first = Slot(particles.id.iter().position(|id| *id == GlobalId(0)).unwrap_or(0) as u32);
        let place = |contact: Loaded| {
            let Loaded { pair, geometry, state, force, point, patch, .. } = contact;
            // The order of pieces differs from that of the bodies.
            let sign = if particles.body_of(pair.a) == first { 1.0 } else { -1.0 };
            let point =
                particles.position[pair.a.index()] - particles.position[first.index()] + point;
            let (force, normal) = (force * sign, geometry.normal * sign);
            let lever = patch.map_or_else(Vec3::zeros, |patch| patch.lever);
            let couple = lever * (sign * sim.law.elastic(pair, particles, geometry));
            let touch = Touch { overlap: geometry.overlap, normal, point };
            let moment = point.cross(&force) + couple;
            let stored = sim.law.stored(pair, particles, geometry, state);
            (touch, Acting { force, moment, stored })
        };
        Ok(sim.contacts.loaded(&*sim.law, particles).map(place).collect())
    }

    /// Contacts of two bodies, found by a method, with a stiffness of 1 N/m.
    ///
    /// # Errors
    /// A contact that cannot be resolved.
    pub fn places_by(method: &Method, bodies: [&Body; 2]) -> Result<Vec<Place>, PairError> {
        let scene = Self::parse(OF_UNIT_STIFFNESS, "", Path::new(""), &[]);
        let scene = scene.map_err(|errors| PairError::Contact(errors.to_string()))?;
        let scene = Self { method: *method, ..scene };
        let found = scene.places(bodies, [MaterialId(0); 2])?;
        let place = |(touch, acting): (Touch, Acting)| Place {
            touch,
            acting: acting.numbers(),
            by_law: None,
        };
        Ok(found.into_iter().map(place).collect())
    }

    /// A simulation of these two bodies, after its first forces.
    fn with_pair(
        &self,
        bodies: [&Body; 2],
        materials: [MaterialId; 2],
    ) -> Result<Simulation, PairError> {
        let scene = self.of_pair(bodies, materials);
        if let Some((_, message)) = laws::unfit(&scene.law, &scene.library).into_iter().next() {
            return Err(PairError::Shape(message));
        }
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(&scene, &comm);
        assemble::fill(&mut sim, &scene, &comm);
        sim.begin(&mut comm).map_err(|error| PairError::Contact(error.to_string()))?;
        Ok(sim)
    }

    /// The scene with these two bodies and nothing else.
    fn of_pair(&self, bodies: [&Body; 2], materials: [MaterialId; 2]) -> Self {
        let mut library = Library::default();
        let mut grains = Vec::new();
        for ((body, material), name) in bodies.into_iter().zip(materials).zip(["A", "B"]) {
            let density = self.materials[material.index()].density;
            let shape = library.push(name, body.shape.clone(), material, density);
            grains.push(Listed {
                id: grains.len() as u64,
                shape,
                scale: 1.0,
                position: body.centre,
                quaternion: body.rotation,
                velocity: Vec3::zeros(),
                angular_velocity: Vec3::zeros(),
            });
        }
        library.particle_shapes = 2;
        library.add_pieces();
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
            groups: Vec::new(),
            audit: audit::Settings { every: 0, ..self.audit },
            start: None,
            ..self.clone()
        }
    }
}

/// Forces in two spheres that have touched, across a gap over which the law still holds.
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
