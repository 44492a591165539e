//! Force laws: from the geometry of a contact to the forces and moments of its bodies.
//!
//! The guide of `dem-mpi` shows a complete law of one's own, `src/guide/extend.md`.
//!
//! This is a separate crate, because a kernel is compiled for each law and each kind of processor, which takes most of the
//! build time.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod dmt;
pub mod hertz;
mod interactions;
pub mod kernel;
pub mod linear;
pub mod rolling;
pub mod stability;

pub use interactions::{Interactions, Mixing};

// Names its modules by the paths that the rest of the program uses.
use crate as law;
use dem_grains::{contact, ids, lanes, math, particles, population, shape};

use crate::contact::curvature::Curvature;
use crate::contact::{Geometry, Pair, Patch, Previous, StateColumn};
use crate::ids::{MaterialId, ShapeId, Slot};
use crate::lanes::{Row, prefetch};
use crate::law::kernel::{Law, Model};
use crate::math::{Vec3, Vec3AndNumber};
use crate::particles::columns::Quantity;
use crate::particles::{Needs, Particles, held};
use crate::population::Library;
use serde::{Deserialize, Serialize};

/// Adds a row to the sum of a body. Every body has a row, see [`Sums::begin`].
#[expect(clippy::inline_always, reason = "see `lanes`")]
#[inline(always)]
fn add(sums: &mut [Vec3AndNumber], slot: usize, row: impl Row) {
    row.add_to(bytemuck::cast_mut(&mut sums[slot]));
}

/// Moment on A about its centre, of a force of A on B [N] at `point` from that centre [m], in N m.
#[inline]
pub fn torque_on_a(force: &Vec3, point: &Vec3) -> Vec3 {
    -point.cross(force)
}

/// Moment on B about its centre [N m], which is at `r` from the centre of A [m].
#[inline]
pub fn torque_on_b(force: &Vec3, point: &Vec3, r: &Vec3) -> Vec3 {
    (point - r).cross(force)
}

/// Work and losses between a wall and a particle since the last step.
#[derive(Clone, Copy, Debug)]
pub struct OnWall {
    /// The particle and the facet.
    pub pair: Pair,
    /// Work of the wall on the particle [J].
    pub work: f64,
    /// Energy lost [J].
    pub lost: f64,
    /// Part of it that friction took [J].
    pub rubbed: f64,
}

/// Point and force with which a particle presses on a wall.
#[derive(Clone, Copy, Debug)]
pub struct PressOnWall {
    /// Contact point, or the last one if they have separated, from the centre of the particle [m].
    pub point: Vec3,
    /// Force on the wall at this step [N].
    pub force: Vec3,
}

/// Contacts of this step in the order of their pairs, with their state of the last step and room for the results. Columns
/// that a scene does not need are empty.
#[derive(Debug)]
pub struct Work<'a> {
    /// Their bodies.
    pub pairs: &'a [Pair],
    /// Normal and overlap of each, now.
    pub geometry: &'a [Geometry],
    /// Point of each force from the centre of A [m]; empty if all particles are spheres, where it follows from the overlap.
    pub points: &'a [Vec3],
    /// Further geometry of contacts of faces; empty if no body has faces.
    pub patches: &'a [Patch],
    /// Curvature of the bodies at each contact; empty if the law does not use it.
    pub curvatures: &'a [Curvature],
    /// Share of the masses of its bodies in each contact; empty if all shares are 1.
    pub shares: &'a [f64],
    /// Place of each among the contacts of the last step; empty if the contacts are unchanged.
    pub from: &'a [Previous],
    /// Contacts of the last step.
    pub last: Last<'a>,
    /// Contacts that have separated since the last step.
    pub separated: &'a [Separated],
    /// Room for the state of the next step: the values of each contact, see [`ForceLaw::state`].
    pub state: &'a mut [f64],
    /// Room for the forces of A on B [N].
    pub forces: &'a mut [Vec3],
}

/// Contacts of the last step and their state.
#[derive(Clone, Copy, Debug)]
pub struct Last<'a> {
    /// Their bodies.
    pub pairs: &'a [Pair],
    /// Normals and overlaps.
    pub geometry: &'a [Geometry],
    /// State values of each contact, see [`ForceLaw::state`].
    pub state: &'a [f64],
}

/// A contact of the last step that has ended.
#[derive(Clone, Copy, Debug)]
pub struct Separated {
    /// Its place among the contacts of the last step.
    pub place: usize,
    /// Number of present contacts that come before it.
    pub before: usize,
}

/// Sums over the contacts of each owned particle in a step, in the spatial order of its partners. The bits do not depend on
/// the number of ranks.
#[derive(Debug, Default)]
pub struct Sums {
    /// Force [N], and energy lost since the last step [J].
    force: Vec<Vec3AndNumber>,
    /// Moment about the centre [N m], and the part of the energy that friction took [J]; empty if nothing turns.
    torque: Vec<Vec3AndNumber>,
    /// Losses of the other channels [J], see [`Quantity::OF_CONTACTS`]; channels that the scene does not have are empty.
    parts: [Vec<f64>; 3],
    /// See [`Sums::on_walls`].
    on_walls: Vec<OnWall>,
    /// See [`Sums::presses_on_walls`].
    presses_on_walls: Option<Vec<PressOnWall>>,
    /// See [`Sums::moments_at_walls`].
    at_walls: Vec<Vec3>,
}

impl Sums {
    /// Sets all sums to zero, in the memory of the particles' columns.
    pub fn begin(&mut self, particles: &mut Particles) {
        self.force = std::mem::take(&mut particles.force);
        if let Some(spin) = &mut particles.spin {
            self.torque = std::mem::take(&mut spin.torque);
        }
        // Rows exist for particles that are not owned, so that adding needs no test.
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

    /// Hands the sums to the particles.
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

    /// Adds the forces and moments on pieces to their bodies, in the order of the pieces.
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

    /// Prefetches the motion and the sums of the body with the later slot of each pair. The other bodies stand side by
    /// side.
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

    /// Moment of each contact with a wall on its particle, about the particle's centre, in the order of the contacts [N m].
    /// Empty if nothing turns or no wall asks for its torque.
    pub fn moments_at_walls(&self) -> &[Vec3] {
        &self.at_walls
    }

    /// Work and losses between walls and owned particles, in the order of the particles in space, then of the walls.
    /// Complete for walls that [wear](crate::walls::Wall::wears); for other walls only entries with work.
    pub fn on_walls(&self) -> &[OnWall] {
        &self.on_walls
    }

    /// Point and force of each entry of [`Sums::on_walls`]; `None` if no wall wears.
    pub fn presses_on_walls(&self) -> Option<&[PressOnWall]> {
        self.presses_on_walls.as_deref()
    }

    /// Records the work and losses of a contact with a wall, if the particle is owned and the wall does work or wears.
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

    /// Adds the losses of a separated contact to its particles; a wall has no share.
    fn lose(&mut self, pair: Pair, Losses { all, of_friction, parts }: Losses, first_facet: usize) {
        let share = if pair.b.index() >= first_facet { 1.0 } else { 0.5 };
        for slot in [pair.a.index(), pair.b.index()] {
            add(&mut self.force, slot, [0.0, 0.0, 0.0, share * all]);
            if !self.torque.is_empty() {
                add(&mut self.torque, slot, [0.0, 0.0, 0.0, share * of_friction]);
            }
            self.add_parts(slot, parts.map(|part| share * part));
        }
    }

    /// Adds to the losses of a particle by channel [J], for the channels that the scene has.
    #[inline]
    fn add_parts(&mut self, slot: usize, parts: [f64; 3]) {
        for (sums, part) in self.parts.iter_mut().zip(parts) {
            if let Some(sum) = sums.get_mut(slot) {
                *sum += part;
            }
        }
    }
}

/// Energy lost by one contact, or by eight [J].
#[derive(Clone, Copy, Debug)]
struct Losses<L = f64> {
    all: L,
    /// Part lost to friction.
    of_friction: L,
    /// See [`Quantity::OF_CONTACTS`].
    parts: [L; 3],
}

/// A body as a law sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// Shape at a scale of 1.
    pub shape: ShapeId,
    /// Lengths of the body over those of the shape [-].
    pub scale: f64,
    /// Material.
    pub material: MaterialId,
    /// Mass [kg]; infinite for most walls and for held particles.
    pub mass: f64,
    /// Bounding radius [m]; infinite for a wall.
    pub radius: f64,
}

impl Body {
    /// A body with a shape of a library, at a scale.
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

/// Options of normal and tangential dashpots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dashpots {
    /// Do normal dashpots never make a contact attractive?
    pub limited: bool,
    /// Do they use velocities predicted for the time of the positions, see [`kernel`]?
    pub foreseen: bool,
}

impl Default for Dashpots {
    fn default() -> Self {
        Self { limited: true, foreseen: false }
    }
}

/// Upper bounds of the stiffness and damping of a body's contacts with a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hardest {
    /// Stiffness, normal or tangential [N/m].
    pub stiffness: f64,
    /// Normal and tangential dashpot [N s/m].
    pub dashpots: [f64; 2],
    /// Spring and dashpot against turning, as they act at the surface of a sphere [N/m, N s/m].
    pub turning: [f64; 2],
}

impl Hardest {
    /// Combines each number with that of another.
    fn by(&self, other: &Self, choose: fn(f64, f64) -> f64) -> Self {
        let both = |a: [f64; 2], b: [f64; 2]| [choose(a[0], b[0]), choose(a[1], b[1])];
        Self {
            stiffness: choose(self.stiffness, other.stiffness),
            dashpots: both(self.dashpots, other.dashpots),
            turning: both(self.turning, other.turning),
        }
    }

    /// Smaller of each number and that of the other body. The springs against turning stay: they depend on the body's own
    /// moments of inertia.
    fn softer(&self, back: &Self) -> Self {
        Self { turning: self.turning, ..self.by(back, f64::min) }
    }

    /// Bounds with stiffnesses multiplied by `times`; dashpots grow with its square root.
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
    /// One of these with additions.
    With(Box<Choice>, Additions),
    /// Elastic spheres that stick: Johnson, Kendall and Roberts, with Mindlin's friction. It takes no additions.
    Jkr(hertz::jkr::Settings),
}

impl Choice {
    /// Highest coefficient of friction of any two materials.
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

    /// Does it have springs against rolling and twisting?
    pub const fn resists_turning(&self) -> bool {
        matches!(self, Self::With(_, Additions { turning: Some(_), .. }))
    }
}

/// Additions to a law of forces.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Additions {
    /// Resistance to rolling and twisting.
    pub turning: Option<rolling::Interactions>,
    /// Attraction.
    pub adhesion: Option<dmt::Interactions>,
}

impl Additions {
    /// The law of a model with these additions.
    fn law<M: Model + Clone + 'static>(self, model: M, library: &Library) -> Box<dyn ForceLaw> {
        let Self { turning, adhesion } = self;
        // One model with both compiles faster than one for each; an addition that is not used has zero constants.
        let (turning, adhesion) = match (turning, adhesion) {
            (None, None) => return Box::new(Law::new(model, library)),
            (Some(turning), None) => {
                let adhesion = turning.map(|_| dmt::Constants::default());
                (turning, adhesion)
            }
            (None, Some(adhesion)) => (adhesion.map(|_| rolling::Constants::default()), adhesion),
            (Some(turning), Some(adhesion)) => (turning, adhesion),
        };
        let model = dmt::Dmt::new(rolling::Rolling::new(model, turning, library), adhesion);
        Box::new(Law::new(model, library))
    }
}

impl Choice {
    /// The law between bodies of a library.
    pub fn law(&self, library: &Library) -> Box<dyn ForceLaw> {
        self.with(Additions::default(), library)
    }

    fn with(&self, beside: Additions, library: &Library) -> Box<dyn ForceLaw> {
        let is_alone = beside == Additions::default();
        match self {
            Self::Linear(settings) if is_alone && !settings.dashpots.foreseen => {
                Box::new(Law::new(settings.model::<false>(), library))
            }
            Self::Hertz(settings) if is_alone && !settings.dashpots.foreseen => {
                Box::new(Law::new(settings.model::<false>(library), library))
            }
            Self::Linear(settings) => beside.law(settings.model::<true>(), library),
            Self::Hertz(settings) => beside.law(settings.model::<true>(library), library),
            Self::With(forces, beside) => forces.with(beside.clone(), library),
            Self::Jkr(settings) => Box::new(Law::new(settings.model(library), library)),
        }
    }

    /// The law of forces without additions.
    pub fn forces(&self) -> &Self {
        match self {
            Self::With(forces, _) => forces.forces(),
            forces => forces,
        }
    }

    /// Largest gap over which existing contacts of spheres up to a radius [m] last [m].
    pub fn reach(&self, largest_radius: f64) -> f64 {
        match self.forces() {
            Self::Jkr(settings) => settings.reach(largest_radius),
            _ => 0.0,
        }
    }

    /// Mutable settings of elastic bodies; `None` for another law.
    pub fn hertz_mut(&mut self) -> Option<&mut hertz::Settings> {
        match self {
            Self::Linear(_) => None,
            Self::Hertz(settings) => Some(settings),
            Self::Jkr(settings) => Some(&mut settings.elastic),
            Self::With(forces, _) => forces.hertz_mut(),
        }
    }

    /// Settings of linear contacts; `None` for another law.
    pub fn linear(&self) -> Option<&linear::Settings> {
        match self.forces() {
            Self::Linear(settings) => Some(settings),
            _ => None,
        }
    }
}

/// Texts about a law, and its hardest contact. A model around another one returns the values of the inner model unless it
/// overrides them.
pub trait About: Send + Sync {
    /// The inner model.
    fn within(&self) -> Option<&dyn About> {
        None
    }

    /// Name in reports.
    fn name(&self) -> &'static str;

    /// Hardest contact of a body with bodies of a material, up to this reduced mass [kg].
    fn hardest(&self, body: &Body, other: MaterialId, reduced_mass: f64) -> Hardest;

    /// Largest overlap, over the radius of the smaller body, for which [`About::hardest`] holds; `None` if it holds for
    /// all.
    fn hardest_up_to(&self) -> Option<f64> {
        self.within()?.hardest_up_to()
    }

    /// Largest factor by which contacts stiffen from there to another overlap [-]; by default with its root.
    fn stiffens(&self, overlap: f64, library: &Library) -> f64 {
        match self.within() {
            Some(model) => model.stiffens(overlap, library),
            None => self.hardest_up_to().map_or(1.0, |meant| (overlap / meant).sqrt()),
        }
    }

    /// Largest gap at which an existing contact between bodies of a library ends [m]. Pairs are listed up to this distance
    /// between surfaces.
    fn reach(&self, library: &Library) -> f64 {
        self.within().map_or(0.0, |model| model.reach(library))
    }

    /// Constants of a contact between two materials, as text.
    fn words(&self, a: MaterialId, b: MaterialId) -> String;

    /// Ranges in which the law departs from its formulas, a sentence each.
    fn limits(&self) -> Vec<String> {
        self.within().map_or_else(Vec::new, About::limits)
    }

    /// Parts of the law that the scene does not need, with reasons.
    fn left_out(&self) -> Vec<&'static str> {
        self.within().map_or_else(Vec::new, About::left_out)
    }
}

/// A law of contact forces, as the rest of the program sees it.
pub trait ForceLaw: Send + Sync {
    /// Texts about the law.
    fn about(&self) -> &dyn About;

    /// Columns of particles that it reads.
    fn needs(&self) -> Needs;

    /// State columns of a touching contact. Migration, snapshots and comparisons follow this list.
    fn state(&self) -> &[StateColumn];

    /// Finds the forces of contacts and their new state, and adds the results to the sums of bodies. `dt` [s] is 0 at the
    /// start of a stage: springs do not stretch, and nothing is lost.
    fn apply(&self, work: &mut Work, particles: &Particles, dt: f64, sums: &mut Sums);

    /// Normal force of a contact whose force has been found [N].
    fn normal_force(
        &self,
        pair: Pair,
        particles: &Particles,
        geometry: &Geometry,
        state: &[f64],
    ) -> f64;

    /// Normal force from normal and overlap alone, without dashpots [N].
    fn elastic(&self, pair: Pair, particles: &Particles, geometry: &Geometry) -> f64;

    /// Elastic energy of a contact [J].
    fn stored(&self, pair: Pair, particles: &Particles, geometry: &Geometry, state: &[f64]) -> f64;

    /// Rise of the normal force of a contact over the way, when its bodies approach within one step of `dt` [s], in N/m.
    fn stiffness(&self, pair: Pair, particles: &Particles, geometry: &Geometry, dt: f64) -> f64;

    /// Gap at which an existing contact ends [m].
    fn outlives(&self, _pair: Pair, _particles: &Particles) -> f64 {
        0.0
    }
}
