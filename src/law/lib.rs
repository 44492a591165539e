//! Force laws: from the geometry of a contact to the forces and moments of its bodies.
//!
//! The guide of `dem-mpi` walks through a whole one of one's own, `guide::extend`.
//!
//! A library of its own: a kernel is compiled for each law and each kind of processor, which takes longer than all else together.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod dmt;
pub mod hertz;
mod interactions;
pub mod kernel;
pub mod linear;
pub mod rolling;
pub mod stability;

pub use interactions::{Interactions, Mixing};

// Its modules as everywhere in the program.
use crate as law;
use dem_grains::{contact, ids, lanes, math, particles, population, shape};

use crate::contact::curvature::Curvature;
use crate::contact::{Geometry, Pair, Patch, Previous, StateColumn};
use crate::ids::{MaterialId, ShapeId, Slot};
use crate::lanes::{Row, prefetch};
use crate::math::{Vec3, Vec3AndNumber};
use crate::particles::columns::Quantity;
use crate::particles::{Needs, Particles, held};
use crate::population::Library;
use serde::{Deserialize, Serialize};

/// Adds a row to the sum of a body: all of them have one, see [`Sums::begin`].
#[expect(clippy::inline_always, reason = "see `lanes`")]
#[inline(always)]
fn add(sums: &mut [Vec3AndNumber], slot: usize, row: impl Row) {
    row.add_to(bytemuck::cast_mut(&mut sums[slot]));
}

/// Moment on A about its centre of a force of A on B [N] at `point` from that centre [m], in N m.
#[inline]
pub fn torque_on_a(force: &Vec3, point: &Vec3) -> Vec3 {
    -point.cross(force)
}

/// The same on B about its centre, which is at `r` from that of A [m].
#[inline]
pub fn torque_on_b(force: &Vec3, point: &Vec3, r: &Vec3) -> Vec3 {
    (point - r).cross(force)
}

/// What a wall and a particle did to each other since the last step.
#[derive(Clone, Copy, Debug)]
pub struct OnWall {
    /// The particle and the facet.
    pub pair: Pair,
    /// Work of the wall on the particle [J].
    pub work: f64,
    /// What was lost [J].
    pub lost: f64,
    /// The part of that which friction took [J].
    pub rubbed: f64,
}

/// How a particle presses on a wall.
#[derive(Clone, Copy, Debug)]
pub struct PressOnWall {
    /// Where, or where it did at the last step, seen from the centre of the particle [m].
    pub point: Vec3,
    /// Force on the wall at this step [N].
    pub force: Vec3,
}

/// Contacts of this step in the order of their pairs, with what was remembered of them, and room for what a law
/// finds. Columns that a scene does not need are empty.
#[derive(Debug)]
pub struct Work<'a> {
    /// Their bodies.
    pub pairs: &'a [Pair],
    /// Normal and overlap of each, now.
    pub geometry: &'a [Geometry],
    /// Where each acts, seen from the centre of A [m]; empty if all are spheres, where it follows from the overlap.
    pub points: &'a [Vec3],
    /// What else there is of contacts of faces; empty if no body has any.
    pub patches: &'a [Patch],
    /// How curved the bodies of each are; empty if the law does not ask.
    pub curvatures: &'a [Curvature],
    /// The part of the mass of its bodies that each has; empty if all have all of it.
    pub shares: &'a [f64],
    /// Where each stands among those of the last step; empty if these are the same.
    pub from: &'a [Previous],
    /// What was remembered of those.
    pub last: Last<'a>,
    /// Those that have separated since.
    pub separated: &'a [Separated],
    /// Room for what the next step must know: the numbers of each, see [`ForceLaw::state`].
    pub state: &'a mut [f64],
    /// Room for the forces of A on B [N].
    pub forces: &'a mut [Vec3],
}

/// What is remembered of the contacts of the last step.
#[derive(Clone, Copy, Debug)]
pub struct Last<'a> {
    /// Their bodies.
    pub pairs: &'a [Pair],
    /// Normals and overlaps.
    pub geometry: &'a [Geometry],
    /// What the law remembers: the numbers of each, see [`ForceLaw::state`].
    pub state: &'a [f64],
}

/// A contact of the last step that is none now.
#[derive(Clone, Copy, Debug)]
pub struct Separated {
    /// Where it stood.
    pub place: usize,
    /// How many of the contacts of now come before it.
    pub before: usize,
}

/// Sums over the contacts of each owned particle in a step, in the order of its partners in space: the same bits on any
/// number of ranks.
#[derive(Debug, Default)]
pub struct Sums {
    /// Force [N], and energy lost since the last step [J].
    force: Vec<Vec3AndNumber>,
    /// Moment about the centre [N m], and the part of the energy that friction took [J]; none if nothing turns.
    torque: Vec<Vec3AndNumber>,
    /// The parts of the other channels [J], see [`Quantity::OF_CONTACTS`]; none of those that the scene does not have.
    parts: [Vec<f64>; 3],
    /// See [`Sums::on_walls`].
    on_walls: Vec<OnWall>,
    /// See [`Sums::presses_on_walls`].
    presses_on_walls: Option<Vec<PressOnWall>>,
    /// See [`Sums::moments_at_walls`].
    at_walls: Vec<Vec3>,
}

impl Sums {
    /// Begins with nothing, in the room that the columns of the particles have.
    pub fn begin(&mut self, particles: &mut Particles) {
        self.force = std::mem::take(&mut particles.force);
        if let Some(spin) = &mut particles.spin {
            self.torque = std::mem::take(&mut spin.torque);
        }
        // Whoever is summed and not owned is nobody's: no sum has to ask.
        for sum in [&mut self.force, &mut self.torque] {
            if !sum.is_empty() {
                sum.clear();
                sum.reserve_exact(particles.slots());
                sum.resize(particles.slots(), Vec3AndNumber::default());
            }
        }
        for (part, quantity) in self.parts.iter_mut().zip(Quantity::OF_CONTACTS) {
            part.clear();
            if quantity.presence().holds(&particles.needs) {
                part.resize(particles.slots(), 0.0);
            }
        }
        self.on_walls.clear();
        let any_wears = particles.walls.iter().any(|wall| wall.wears);
        let presses = any_wears.then(|| self.presses_on_walls.take().unwrap_or_default());
        self.presses_on_walls = presses;
        self.presses_on_walls.iter_mut().for_each(Vec::clear);
        self.at_walls.clear();
    }

    /// Gives the particles what has been summed.
    pub fn end(&mut self, particles: &mut Particles) {
        self.gather(particles);
        self.force.truncate(particles.owned);
        self.torque.truncate(particles.owned);
        particles.force = std::mem::take(&mut self.force);
        if let Some(spin) = &mut particles.spin {
            spin.torque = std::mem::take(&mut self.torque);
        }
        for (all, sum) in
            particles.accumulated[Quantity::Dissipated].iter_mut().zip(&particles.force)
        {
            *all += sum.number;
        }
        let torques = particles.spin.iter().flat_map(|spin| &spin.torque);
        for (all, sum) in particles.accumulated[Quantity::OfFriction].iter_mut().zip(torques) {
            *all += sum.number;
        }
        for (part, quantity) in self.parts.iter().zip(Quantity::OF_CONTACTS) {
            for (all, sum) in particles.accumulated[quantity].iter_mut().zip(part) {
                *all += sum;
            }
        }
        let body = |on_wall: &OnWall| particles.body_of(on_wall.pair.a);
        let of_bodies: Vec<(Slot, f64)> = self
            .on_walls
            .chunk_by(|one, other| body(one) == body(other))
            .map(|of_one| (body(&of_one[0]), of_one.iter().map(|on_wall| on_wall.work).sum()))
            .collect();
        for (body, received) in of_bodies {
            particles.accumulated[Quantity::Received][body.index()] += received;
        }
    }

    /// Adds what acts on pieces to their bodies, in the order of the pieces.
    fn gather(&mut self, particles: &Particles) {
        for (piece, body, arm) in particles.owned_pieces() {
            let of_piece = self.force[piece];
            add(
                &mut self.force,
                body,
                [of_piece.vector.x, of_piece.vector.y, of_piece.vector.z, of_piece.number],
            );
            if let Some(torque) = self.torque.get(piece).copied() {
                let about = torque.vector + arm.cross(&of_piece.vector);
                add(&mut self.torque, body, [about.x, about.y, about.z, torque.number]);
            }
            for part in self.parts.iter_mut().filter(|part| !part.is_empty()) {
                part[body] += part[piece];
            }
        }
    }

    /// Asks memory for the motion and the sums of one body of each pair: that with the later slot. The others stand side by side.
    pub fn prefetch(&self, pairs: &[Pair], particles: &Particles) {
        for pair in pairs {
            let later = pair.a.max(pair.b).index();
            let later = later..later + 1;
            prefetch(&particles.position[later.clone()]);
            prefetch(&particles.velocity[later.clone()]);
            prefetch(&self.force[later.clone()]);
            if let Some(spin) = &particles.spin {
                prefetch(&spin.angular_velocity[later.clone()]);
                prefetch(&self.torque[later]);
            }
        }
    }

    /// Bytes that it holds between two steps.
    pub fn bytes(&self) -> usize {
        let presses = self.presses_on_walls.iter().map(held).sum::<usize>();
        presses
            + held(&self.on_walls)
            + self.parts.iter().map(held).sum::<usize>()
            + held(&self.at_walls)
    }

    /// The moment of each contact with a wall on its particle, about the particle's centre, in the order of the contacts [N m];
    /// empty if nothing turns or no wall asks for its torque.
    pub fn moments_at_walls(&self) -> &[Vec3] {
        &self.at_walls
    }

    /// Work and losses between walls and owned particles, in the order of the particles in space, then of the walls: all of it of walls that
    /// [wear](crate::walls::Wall::wears), of others where they work.
    pub fn on_walls(&self) -> &[OnWall] {
        &self.on_walls
    }

    /// How each of these particles presses; `None` if no wall wears.
    pub fn presses_on_walls(&self) -> Option<&[PressOnWall]> {
        self.presses_on_walls.as_deref()
    }

    /// Takes note of what a contact with a wall does, if the particle is owned, and the wall works in it or wears.
    #[inline]
    fn note_on_wall(
        &mut self,
        on_wall: OnWall,
        particles: &Particles,
        press: impl FnOnce() -> PressOnWall,
    ) {
        let Pair { a, b } = on_wall.pair;
        let wears = || particles.wall_of(b).is_some_and(|wall| particles.walls[wall].wears);
        let counts = on_wall.work != 0.0 || self.presses_on_walls.is_some() && wears();
        if particles.is_owned(a) && counts {
            self.on_walls.push(on_wall);
            if let Some(presses) = &mut self.presses_on_walls {
                presses.push(press());
            }
        }
    }

    /// Adds what a contact lost that has separated to its particles; a wall has no share.
    fn lose(&mut self, pair: Pair, Lost { all, of_friction, parts }: Lost, first_facet: usize) {
        let share = if pair.b.index() >= first_facet { 1.0 } else { 0.5 };
        for slot in [pair.a.index(), pair.b.index()] {
            add(&mut self.force, slot, [0.0, 0.0, 0.0, share * all]);
            if !self.torque.is_empty() {
                add(&mut self.torque, slot, [0.0, 0.0, 0.0, share * of_friction]);
            }
            self.add_parts(slot, parts.map(|part| share * part));
        }
    }

    /// Adds to the parts of what a particle has lost that the scene has [J].
    #[inline]
    fn add_parts(&mut self, slot: usize, parts: [f64; 3]) {
        for (sums, part) in self.parts.iter_mut().zip(parts) {
            if let Some(sum) = sums.get_mut(slot) {
                *sum += part;
            }
        }
    }
}

/// Energy that a contact has lost, or that eight have [J].
#[derive(Clone, Copy, Debug)]
struct Lost<L = f64> {
    all: L,
    /// The part of friction.
    of_friction: L,
    /// See [`Quantity::OF_CONTACTS`].
    parts: [L; 3],
}

/// A body as a law sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Its shape, at a scale of 1.
    pub shape: ShapeId,
    /// Lengths of the body over those of the shape [-].
    pub scale: f64,
    /// What it is made of.
    pub material: MaterialId,
    /// Mass; infinite of most walls, and of held particles [kg].
    pub mass: f64,
    /// Bounding radius; infinite of a wall [m].
    pub radius: f64,
}

impl Body {
    /// One of a shape of a library, at a scale.
    #[inline]
    pub fn of(library: &Library, shape: ShapeId, scale: f64) -> Self {
        Self {
            shape,
            scale,
            material: library.materials[shape.index()],
            mass: library.mass_in_contacts(shape, scale),
            radius: library.radius[shape.index()] * scale,
        }
    }
}

/// How dashpots along the normal and in the contact plane act.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dashpots {
    /// Normal ones never make a contact attractive.
    pub limited: bool,
    /// They foresee what other contacts and fields make of velocities, see [`kernel`].
    pub foreseen: bool,
}

impl Default for Dashpots {
    fn default() -> Self {
        Self { limited: true, foreseen: false }
    }
}

/// The hardest contact that a body can have with those of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hardest {
    /// Stiffness, normal or tangential [N/m].
    pub stiffness: f64,
    /// Normal and tangential dashpot [N s/m].
    pub dashpots: [f64; 2],
    /// Spring and dashpot against turning, as they act on a sphere at its surface [N/m, N s/m].
    pub turning: [f64; 2],
}

impl Hardest {
    /// Number by number with another.
    fn by(&self, other: &Self, choose: fn(f64, f64) -> f64) -> Self {
        let both = |a: [f64; 2], b: [f64; 2]| [choose(a[0], b[0]), choose(a[1], b[1])];
        Self {
            stiffness: choose(self.stiffness, other.stiffness),
            dashpots: both(self.dashpots, other.dashpots),
            turning: both(self.turning, other.turning),
        }
    }

    /// The softer of this and what the other body of the contact says. Springs against turning go by the body's own moments of inertia.
    fn softer(&self, back: &Self) -> Self {
        Self { turning: self.turning, ..self.by(back, f64::min) }
    }

    /// With stiffnesses so many times as large. Dashpots go with the root.
    fn stiffened(&self, times: f64) -> Self {
        let root = times.sqrt();
        Self {
            stiffness: times * self.stiffness,
            dashpots: self.dashpots.map(|dashpot| root * dashpot),
            turning: [times * self.turning[0], root * self.turning[1]],
        }
    }
}

/// The law that a scene chooses, with its constants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Choice {
    /// Linear springs and dashpots with friction.
    Linear(linear::Settings),
    /// Elastic bodies: Hertz, with Mindlin's friction.
    Hertz(hertz::Settings),
    /// One of these, with more beside it.
    With(Box<Choice>, Beside),
    /// Elastic spheres that stick: Johnson, Kendall and Roberts, with Mindlin's friction. Nothing goes beside it.
    Jkr(hertz::jkr::Settings),
}

impl Choice {
    /// The highest coefficient of friction of two materials.
    pub fn highest_friction(&self) -> f64 {
        match self {
            Self::Linear(law) => law.interactions.iter().map(|c| c.friction).fold(0.0, f64::max),
            Self::Hertz(law) => law.interactions.iter().map(|c| c.friction).fold(0.0, f64::max),
            Self::Jkr(law) => {
                law.elastic.interactions.iter().map(|c| c.friction).fold(0.0, f64::max)
            }
            Self::With(forces, _) => forces.highest_friction(),
        }
    }

    /// Has it springs against rolling and twisting?
    pub const fn resists_turning(&self) -> bool {
        matches!(self, Self::With(_, Beside { turning: Some(_), .. }))
    }
}

/// What a law can have beside its forces.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Beside {
    /// Resistance to rolling and twisting.
    pub turning: Option<rolling::Interactions>,
    /// Attraction.
    pub adhesion: Option<dmt::Interactions>,
}

impl Beside {
    /// The law of a model with all of this.
    fn law<M: kernel::Model + Clone + 'static>(
        self,
        model: M,
        library: &Library,
    ) -> Box<dyn ForceLaw> {
        let Self { turning, adhesion } = self;
        // One model for all of this takes less time to compile than one for each: what is not asked for does nothing.
        let (turning, adhesion) = match (turning, adhesion) {
            (None, None) => return Box::new(kernel::Law::new(model, library)),
            (Some(turning), None) => {
                let adhesion = turning.map(|_| dmt::Constants::default());
                (turning, adhesion)
            }
            (None, Some(adhesion)) => (adhesion.map(|_| rolling::Constants::default()), adhesion),
            (Some(turning), Some(adhesion)) => (turning, adhesion),
        };
        let model = dmt::Dmt::new(rolling::Rolling::new(model, turning, library), adhesion);
        Box::new(kernel::Law::new(model, library))
    }
}

impl Choice {
    /// The law between bodies of a library.
    pub fn law(&self, library: &Library) -> Box<dyn ForceLaw> {
        self.with(Beside::default(), library)
    }

    fn with(&self, beside: Beside, library: &Library) -> Box<dyn ForceLaw> {
        match self {
            Self::Linear(settings) => beside.law(settings.model(), library),
            Self::Hertz(settings) => beside.law(settings.model(library), library),
            Self::With(forces, beside) => forces.with(beside.clone(), library),
            Self::Jkr(settings) => Box::new(kernel::Law::new(settings.model(library), library)),
        }
    }

    /// The law of its forces alone.
    pub fn forces(&self) -> &Self {
        match self {
            Self::With(forces, _) => forces.forces(),
            forces => forces,
        }
    }

    /// The farthest gap over which contacts of spheres up to a radius [m] last, once they are made [m].
    pub fn reach(&self, largest_radius: f64) -> f64 {
        match self.forces() {
            Self::Jkr(settings) => settings.reach(largest_radius),
            _ => 0.0,
        }
    }

    /// The settings of elastic bodies, to change them; `None` of another law.
    pub fn hertz_mut(&mut self) -> Option<&mut hertz::Settings> {
        match self {
            Self::Linear(_) => None,
            Self::Hertz(settings) => Some(settings),
            Self::Jkr(settings) => Some(&mut settings.elastic),
            Self::With(forces, _) => forces.hertz_mut(),
        }
    }

    /// The settings of linear contacts; `None` of another law.
    pub fn linear(&self) -> Option<&linear::Settings> {
        match self.forces() {
            Self::Linear(settings) => Some(settings),
            _ => None,
        }
    }
}

/// Words about a law, and the hardest contact that it makes. A model around another one says the same, unless it has more to say.
pub trait About: Send + Sync {
    /// The model within.
    fn within(&self) -> Option<&dyn About> {
        None
    }

    /// As reports name it.
    fn name(&self) -> &'static str;

    /// The hardest contact of a body with those of a material, with this reduced mass at most [kg].
    fn hardest(&self, body: &Body, other: MaterialId, reduced_mass: f64) -> Hardest;

    /// The overlap over the radius of the smaller body up to which [`About::hardest`] holds; `None` if it holds for all.
    fn hardest_up_to(&self) -> Option<f64> {
        self.within()?.hardest_up_to()
    }

    /// By how much contacts of bodies of a library stiffen from there to another overlap, at most [-]; by default with its root.
    fn stiffens(&self, overlap: f64, library: &Library) -> f64 {
        match self.within() {
            Some(model) => model.stiffens(overlap, library),
            None => self.hardest_up_to().map_or(1.0, |meant| (overlap / meant).sqrt()),
        }
    }

    /// The largest gap at which a contact ends that has once been made, among bodies of a library: so far beyond their surfaces pairs are
    /// listed [m].
    fn reach(&self, library: &Library) -> f64 {
        self.within().map_or(0.0, |model| model.reach(library))
    }

    /// The constants of a contact between two materials in words.
    fn words(&self, a: MaterialId, b: MaterialId) -> String;

    /// Where it departs from its formulas, a sentence each.
    fn limits(&self) -> Vec<String> {
        self.within().map_or_else(Vec::new, About::limits)
    }

    /// What the scene does not need of it, and why.
    fn left_out(&self) -> Vec<&'static str> {
        self.within().map_or_else(Vec::new, About::left_out)
    }
}

/// A law of contact forces, as the rest of the program sees it.
pub trait ForceLaw: Send + Sync {
    /// Words about it.
    fn about(&self) -> &dyn About;

    /// Which columns of particles it reads.
    fn needs(&self) -> Needs;

    /// What it remembers of a touching contact. Whoever carries, saves and compares it follows this list.
    fn state(&self) -> &[StateColumn];

    /// Finds the forces of contacts and what the next step must remember of them, and sums what they do to their bodies. `dt`
    /// [s] is 0 at the start of a stage: springs do not stretch, and nothing is lost.
    fn apply(&self, work: &mut Work, particles: &Particles, dt: f64, sums: &mut Sums);

    /// The normal force of a contact whose force has been found [N].
    fn normal_force(
        &self,
        pair: Pair,
        particles: &Particles,
        geometry: &Geometry,
        state: &[f64],
    ) -> f64;

    /// The normal force that the law makes of normal and overlap alone, without dashpots [N].
    fn elastic(&self, pair: Pair, particles: &Particles, geometry: &Geometry) -> f64;

    /// Elastic energy of a contact [J].
    fn stored(&self, pair: Pair, particles: &Particles, geometry: &Geometry, state: &[f64]) -> f64;

    /// How much the normal force of a contact rises when its bodies come nearer within one step of
    /// `dt` [s], over the way [N/m].
    fn stiffness(&self, pair: Pair, particles: &Particles, geometry: &Geometry, dt: f64) -> f64;

    /// The gap at which a contact ends that has once been made [m].
    fn outlives(&self, _pair: Pair, _particles: &Particles) -> f64 {
        0.0
    }
}
