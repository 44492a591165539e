//! Parts that all force laws share: gathering eight contacts, the motion of their surfaces, the state of the last step,
//! work and energy, and the sums over bodies.
//!
//! With the central differences of [`dem_grains::motion`], the work between two steps is the mean of the old and the new force
//! times the displacement. Each force counts at the point where it acted. For bodies other than spheres that point runs over the
//! surface, so it is remembered. With the present point for both forces, the error for discs of 5:1 would be 2 % of the
//! energy that they dissipate.
//!
//! A contact dissipates this work minus the change of its elastic energy, from the step before the first touch to the step
//! after the last. Only channels that can dissipate count. The error of a long time step in the other channels appears in
//! the energy error of the report. Where nothing depends on velocities, the velocities of ghosts need not be known.
//!
//! If a law depends on the curvature of bodies, its normal channel dissipates only the work of dashpots: the normal force
//! minus the derivative of the energy. The elastic force beside the normal and its moment belong to no channel and
//! dissipate nothing.

#![expect(clippy::inline_always, reason = "see `lanes`")]

mod balance;
mod dashpots;
mod patches;
mod rows;

pub use dashpots::InPlane;
pub use patches::Turning;

use super::{
    About, Body, Dashpots, ForceLaw, Hardest, Last, Losses, OnWall, PressOnWall, Separated, Sums,
    Work, add,
};
use crate::contact::curvature::{self, Curvatures};
use crate::contact::{Geometry, Pair, StateColumn, touch_of_sphere, triple, vectors};
use crate::ids::{ShapeId, Slot};
use crate::lanes::{self, Eight, Gather, Kernel, Lanes, Row, RowPairs, Triple, WIDTH, row};
use crate::math::Vec3;
use crate::particles::{Ahead, Needs, Particles};
use crate::population::Library;
use crate::shape::Kind;
use balance::{Powers, Stored};
use rows::{
    eight_from_rows, eight_rows, geometries_at, pieces, places_before, read_state,
    read_states_in_a_row, rows_at, stood_in_a_row, write_state, write_threes,
};

/// Largest number of state values per contact.
pub const MOST_STATE: usize = 8;
/// Largest number of state values per contact of a model with moments.
pub const MOST_STATE_OF_MOMENTS: usize = 16;

/// Point where the force acted, from the centre of A [m]. The work of a step is computed there. On bodies other than
/// spheres it runs over the surface, the faster the flatter the surface is, and cannot be recovered from the normal.
pub const CONTACT_POINT: StateColumn = StateColumn::new("contact_point", 3, "m");
/// Viscous part of the tangential force at the previous step [N], which [`Model::last`] does not return.
const VISCOUS_FORCE: StateColumn = StateColumn::new("viscous_force", 3, "N");
/// Values of both columns together.
const MOST_ACTED: usize = 6;

/// Remembered data of the last force beside the state of the model.
#[derive(Clone, Copy, Debug)]
struct LastForce<L> {
    /// Contact point [m]; `None` for spheres, where it follows from the overlap.
    point: Option<Triple<L>>,
    /// Viscous tangential force [N]; `None` if [`Model::last`] returns the whole force.
    viscous: Option<Triple<L>>,
}

impl<L: Copy> LastForce<L> {
    /// Reads the columns; the point stands first if bodies are not spheres. `None` without values.
    #[inline(always)]
    fn read(numbers: &[L], has_point: bool) -> Option<Self> {
        let first = |numbers: &[L]| match *numbers {
            [x, y, z, ..] => Some(Triple { x, y, z }),
            _ => None,
        };
        let (point, viscous) = numbers.split_at(if has_point { 3 } else { 0 });
        first(numbers).map(|_| Self { point: first(point), viscous: first(viscous) })
    }

    /// Writes the columns, as far as `numbers` has room; the inverse of `read`.
    #[inline(always)]
    fn write(point: Triple<L>, viscous: Triple<L>, numbers: &mut [L], has_point: bool) {
        let (of_point, of_viscous) = numbers.split_at_mut(if has_point { 3 } else { 0 });
        for (places, Triple { x, y, z }) in [(of_point, point), (of_viscous, viscous)] {
            if let [a, b, c] = places {
                [*a, *b, *c] = [x, y, z];
            }
        }
    }
}

/// Contacts as a law sees them, one in each lane.
#[derive(Clone, Copy, Debug)]
pub struct Contact<L> {
    /// Unit normal, A to B.
    pub normal: Triple<L>,
    /// Normal at the last touch; zero if there was none.
    pub last_normal: Triple<L>,
    /// Overlap [m].
    pub overlap: L,
    /// Overlap at the last touch [m]; 0 if there was none.
    pub last_overlap: L,
    /// Normal force over the derivative of the energy by the overlap [-]; 1 except for contacts of faces and straight
    /// sides.
    pub gain: L,
    /// Velocity of approach along the normal [m/s].
    pub approach: L,
    /// Velocity of A's surface against B's in the contact plane [m/s].
    pub sliding: Triple<L>,
    /// Velocity of A's surface against B's [m/s], predicted for the time of the positions.
    pub foreseen: Triple<L>,
    /// Viscous part of the last tangential force [N]; zero without tangential dashpots.
    pub last_viscous: Triple<L>,
    /// Rotation of the pair about the normal since the last step [rad].
    pub twist: L,
    /// Angular velocity of A against B [rad/s].
    pub turning: Triple<L>,
    /// Contacts that touched at the last step, as bits of lanes.
    pub touched: u8,
    /// Do the bodies touch with faces or straight sides? Then friction also resists torsion.
    pub extended: bool,
    /// Force of torsion before any limit [N], for extended contacts. The moment is this force times the mean distance.
    pub torsion: L,
    /// Time since the last step [s]; 0 at the start of a stage.
    pub dt: f64,
    /// Contacts that have begun since the last step, as bits of lanes.
    pub begun: u8,
    /// Time in contact since the last step [s]: `dt`, or less where contacts have begun since then.
    pub lasted: L,
    /// Contacts that end within the next step, as bits of lanes.
    pub ends: u8,
    /// Part of the next step after which they end [-].
    pub left: L,
}

impl<L: Lanes> Contact<L> {
    /// Finds the contacts that have begun since the last step or end within the next, and when. The times follow from the
    /// present velocity of approach. Contacts end at a gap of `gap` [m].
    #[inline(always)]
    fn timed(mut self, gap: L) -> Self {
        let (zero, one) = (L::all(0.0), L::all(1.0));
        let way = self.approach * self.gain * L::all(self.dt);
        let to_end = self.overlap + gap;
        let begins = zero.less(self.overlap) & !self.touched;
        // A branch that is hardly ever taken costs less than a division.
        if begins | to_end.less(zero - way) == 0 {
            return self;
        }
        let part = self.overlap / way;
        let begins = begins & zero.less(part) & part.less(one);
        self.begun = begins;
        self.lasted = (self.lasted * part).or(self.lasted, begins);
        self.left = zero - to_end / way;
        self.ends = zero.less(self.left) & self.left.less(one);
        self
    }

    /// Time for which the tangential force acts, from the middle of the last step on, over the time step [-]. It is 1
    /// unless the contact ends within the next step. Then the force acts until Coulomb's limit, which falls to zero, has
    /// come down to it. `part` returns the present force over its limit [-].
    #[inline(always)]
    pub fn remains(&self, part: impl Fn() -> L) -> L {
        let one = L::all(1.0);
        if self.ends == 0 {
            return one;
        }
        let (part, half) = (part(), L::all(0.5));
        let part = part.or(one, part.less(one));
        (half + self.left * (one - half * part)).or(one, self.ends)
    }
}

/// Forces and moments in contacts.
#[derive(Clone, Copy, Debug)]
pub struct Action<L> {
    /// Normal force, positive if it pushes [N].
    pub press: L,
    /// Tangential force of A on B [N].
    pub rub: Triple<L>,
    /// Viscous part of the tangential force [N]; zero in the result of [`Model::last`].
    pub viscous: Triple<L>,
    /// Parts of the tangential force and torsion that Coulomb's limit leaves; not set by [`Model::last`].
    pub kept: Kept<L>,
    /// Moment of A on B about the contact point [N m], if the model has [`Model::MOMENTS`]. All of it must follow from the
    /// state, the part of dashpots included.
    pub moment: Triple<L>,
    /// Elastic energy of the normal and of the tangential direction [J]; the latter includes that of moments.
    pub stored: [L; 2],
}

/// Friction with Coulomb's limit over friction without it [-].
#[derive(Clone, Copy, Debug)]
pub struct Kept<L> {
    /// Tangential force; 1 where friction sticks.
    pub force: L,
    /// Torsion.
    pub torsion: L,
    /// See [`Contact::remains`]. The force of an action contains this factor.
    pub remains: L,
}

impl<L: Lanes> Kept<L> {
    /// Values where friction sticks.
    #[inline(always)]
    pub fn all() -> Self {
        let one = L::all(1.0);
        Self { force: one, torsion: one, remains: one }
    }
}

/// Constants of contacts, from one set for all lanes or from one set per lane.
pub trait Spread<C, L> {
    /// One constant in all lanes.
    fn of(&self, get: impl Fn(&C) -> f64) -> L;
}

/// Formulas of one law; [`super`] walks through an example. Constants of contacts stand in a type that is generic over one
/// contact or eight.
pub trait Model: About + std::fmt::Debug {
    /// Constants of contacts.
    type Constants<L: Lanes>: Copy + std::fmt::Debug + Send + Sync;

    /// Does the model add moments to those of its forces? By default it does not, and none are computed. A model with
    /// moments needs `velocity` and `spin`.
    const MOMENTS: bool = false;

    /// May its [`Needs`] ask for the curvature of bodies at contacts? Then [`Model::curved`] gives the constants of a
    /// contact. The normal elastic energy must be a constant times [`Curvature::root_of_radius`] and `δ^(5/2)`, as in
    /// Hertz's law: the kernel adds the rest of its gradient. By default no curvature is computed.
    ///
    /// [`Curvature::root_of_radius`]: crate::contact::curvature::Curvature::root_of_radius
    const BY_CURVATURE: bool = false;

    /// Does it lose energy where contacts begin and end, see [`Model::torn`]? By default it does not, and no loss is
    /// computed.
    const TEARS: bool = false;

    /// May its [`Needs`] ask for predicted velocities? Such a model needs `velocity`, too. By default it may not, and none are
    /// computed.
    const FORESEES: bool = false;

    /// Does it handle contacts of faces and straight sides? By default it does; a model without them compiles faster.
    const FACES: bool = true;

    /// Columns of particles that it reads.
    fn needs(&self) -> Needs;

    /// State columns of a touching contact, at most [`MOST_STATE`] values, or [`MOST_STATE_OF_MOMENTS`] with moments.
    fn state(&self) -> &[StateColumn] {
        &[]
    }

    /// Constants of contacts between two bodies; the second may be a wall.
    fn constants(&self, a: &Body, b: &Body) -> Self::Constants<f64>;

    /// Constants in lanes.
    fn spread<L: Lanes>(of: &impl Spread<Self::Constants<f64>, L>) -> Self::Constants<L>;

    /// Constants of contacts with this root of the radius [√m], for models by curvature. [`Model::last`] gets the constants
    /// of the previous step.
    fn curved<L: Lanes>(
        &self,
        constants: &Self::Constants<L>,
        _root_of_radius: L,
    ) -> Self::Constants<L> {
        *constants
    }

    /// Forces at the last step as far as the state gives them, for an overlap [m].
    fn last<L: Lanes>(&self, constants: &Self::Constants<L>, overlap: L, state: &[L]) -> Action<L>;

    /// Forces at this step. `state` holds the values of the last step on entry and those for the next step on return.
    fn act<L: Lanes>(
        &self,
        constants: &Self::Constants<L>,
        contact: &Contact<L>,
        state: &mut [L],
    ) -> Action<L>;

    /// Contacts that can dissipate energy in the normal and in the tangential direction, as bits of lanes; by default none.
    fn dissipates<L: Lanes>(&self, _constants: &Self::Constants<L>) -> [u8; 2] {
        [0, 0]
    }

    /// Part of the stored tangential energy that belongs to moments [J], for an overlap [m]; by default none.
    fn turned<L: Lanes>(&self, _: &Self::Constants<L>, _overlap: L, _state: &[L]) -> L {
        L::all(0.0)
    }

    /// Energy that a contact loses at once where it begins, and where it ends [J]; by default none.
    fn torn<L: Lanes>(&self, _constants: &Self::Constants<L>) -> [L; 2] {
        [L::all(0.0); 2]
    }

    /// Normal force at an overlap [m] without dashpots [N]: the derivative of the energy.
    fn elastic<L: Lanes>(&self, constants: &Self::Constants<L>, overlap: L) -> L;

    /// Resistance to turning of bodies that touch with faces or straight sides, at an overlap [m]; by default none.
    fn turning(&self, _constants: &Self::Constants<f64>, _overlap: f64) -> Turning {
        Turning::default()
    }

    /// Rise of the normal force at an overlap [m] over the way, when bodies approach within one step of `dt` [s], in N/m.
    fn stiffness(&self, constants: &Self::Constants<f64>, overlap: f64, dt: f64) -> f64;

    /// Gap at which an existing contact ends [m]; by default it ends where the overlap does. Only for spheres, with each
    /// other and with planes.
    fn outlives<L: Lanes>(&self, _constants: &Self::Constants<L>) -> L {
        L::all(0.0)
    }
}

/// A law for the bodies of a library.
#[derive(Debug)]
pub struct Law<M: Model> {
    model: M,
    /// Constants of every pair of shapes, walls included; empty if there are more than `MOST_SHAPES`. They do not hold for
    /// bodies of other sizes than their shapes.
    table: Vec<OfPair<M>>,
    /// Number of shapes in the table.
    shapes: usize,
    /// State values of the model per contact.
    width: usize,
    /// State columns per contact: those of the model, and those for contacts with faces or straight sides or for bodies
    /// other than spheres.
    state: Vec<StateColumn>,
    /// Values in these columns.
    stride: usize,
    /// Is the point where the force acted among the columns?
    has_points: bool,
    /// Extended contacts that each shape can be the first and the second body of, as bits.
    extended: Vec<[u8; 2]>,
    needs: Needs,
}

/// Constants over all steps of the contacts of two bodies, or of eight pairs.
#[derive(Clone, Copy, Debug)]
struct PairConstants<C, L> {
    /// Constants of the law.
    of_law: C,
    /// Bounding radii of both bodies [m]; 0 for a facet.
    radii: [L; 2],
}

/// Constants of one pair.
type OfPair<M> = PairConstants<<M as Model>::Constants<f64>, f64>;

/// Constants of eight pairs.
type OfEight<M, L> = PairConstants<<M as Model>::Constants<L>, L>;

/// Eight equal pairs.
#[inline(always)]
fn same<M: Model, L: Eight>(one: &OfPair<M>) -> OfEight<M, L> {
    OfEight::<M, L> {
        of_law: M::spread(&Same(one)),
        radii: [L::all(one.radii[0]), L::all(one.radii[1])],
    }
}

/// A pair for each lane.
#[inline(always)]
fn each<M: Model, L: Eight>(each: &[OfPair<M>; WIDTH]) -> OfEight<M, L> {
    let mut radii = [[0.0; WIDTH]; 2];
    for (lane, one) in each.iter().enumerate() {
        [radii[0][lane], radii[1][lane]] = one.radii;
    }
    let radii = [L::load(&radii[0]), L::load(&radii[1])];
    OfEight::<M, L> { of_law: M::spread(&Each(each)), radii }
}

/// The table of more shapes would not stay in the cache.
const MOST_SHAPES: usize = 128;

impl<M: Model> Law<M> {
    /// The law between bodies of a library.
    ///
    /// # Panics
    /// If the model has more state values per contact than allowed, or does not handle the contacts of these shapes.
    pub fn new(model: M, library: &Library) -> Self {
        let width = StateColumn::total_width(model.state());
        let most = if M::MOMENTS { MOST_STATE_OF_MOMENTS } else { MOST_STATE };
        assert!(width <= most, "{} has more than {most} state variables", model.name());
        let mut needs = model.needs();
        assert!(M::BY_CURVATURE || !needs.curvature, "{} does not say so", model.name());
        assert!(!M::MOMENTS || needs.velocity && needs.spin, "{} turns nothing", model.name());
        assert!(M::FORESEES || !needs.ahead, "{} does not foresee", model.name());
        assert!(!M::FORESEES || needs.velocity, "{} foresees nothing", model.name());
        let mut state = model.state().to_vec();
        let grains = &library.shapes[library.grains()];
        let mut has_points = false;
        let extended = extended(library);
        if extended.iter().any(|[first, _]| *first > 0) {
            state.extend(patches::REMEMBERED);
            assert!(M::FACES, "{} does not know faces", model.name());
            (needs.patches, needs.spin) = (true, true);
        } else if needs.velocity {
            has_points = grains.iter().any(|shape| shape.kind() != Kind::Sphere);
            state.extend(has_points.then_some(CONTACT_POINT));
            state.extend(needs.tangential_dashpots.then_some(VISCOUS_FORCE));
            needs.spin |= state.len() > model.state().len();
        }
        let stride = StateColumn::total_width(&state);
        let mut law = Self {
            model,
            table: Vec::new(),
            shapes: 0,
            width,
            state,
            stride,
            has_points,
            extended,
            needs,
        };
        let shapes = library.shapes.len();
        if shapes <= MOST_SHAPES {
            let all = (0..shapes).flat_map(|a| (0..shapes).map(move |b| (a, b)));
            law.table = all.map(|pair| law.of_new_shapes(pair, library)).collect();
            law.shapes = shapes;
        }
        law
    }

    /// Constants of two shapes, from the table if it holds them.
    #[inline(always)]
    fn of_shapes(&self, (a, b): (usize, usize), particles: &Particles) -> OfPair<M> {
        match self.table.get(a * self.shapes + b) {
            Some(row) => *row,
            None => self.of_new_shapes((a, b), &particles.library),
        }
    }

    #[inline(never)]
    fn of_new_shapes(&self, (a, b): (usize, usize), library: &Library) -> OfPair<M> {
        let [a, b] = [a, b].map(|shape| Body::of(library, ShapeId(shape as u16), 1.0));
        self.of_pair(&a, &b)
    }

    /// Constants of two bodies at their sizes.
    #[inline(never)]
    fn of_bodies(&self, a: Slot, b: Slot, particles: &Particles) -> OfPair<M> {
        self.of_shares(Pair { a, b }, particles, 1.0)
    }

    /// Constants of two bodies, each with this share of its mass.
    #[inline]
    fn of_shares(&self, Pair { a, b }: Pair, particles: &Particles, share: f64) -> OfPair<M> {
        let [a, b] = [a, b].map(|slot| {
            let scale = particles.scale_of(slot.index());
            let whole = Body::of(&particles.library, particles.shape[slot.index()], scale);
            Body { mass: whole.mass * share, ..whole }
        });
        self.of_pair(&a, &b)
    }

    #[inline]
    fn of_pair(&self, a: &Body, b: &Body) -> OfPair<M> {
        let radius = |body: &Body| if body.radius.is_finite() { body.radius } else { 0.0 };
        PairConstants { of_law: self.model.constants(a, b), radii: [radius(a), radius(b)] }
    }

    /// Constants of a touching pair with its present curvature.
    fn constants_now(
        &self,
        pair: Pair,
        particles: &Particles,
        geometry: &Geometry,
    ) -> M::Constants<f64> {
        let constants = self.constants(pair, particles);
        if !(M::BY_CURVATURE && self.needs.curvature) {
            return constants;
        }
        let bodies = particles.bodies();
        let frames = bodies.frames(pair);
        let (a, b) = bodies.posed(pair, &frames);
        let curvature = curvature::of_pair(&a, &b, &geometry.normal, geometry.overlap);
        self.model.curved(&constants, curvature.root_of_radius)
    }

    /// Do two bodies touch with faces or straight sides? Other pairs in scenes with such bodies never have a patch.
    #[inline(always)]
    fn has_patch(&self, pair: Pair, particles: &Particles) -> bool {
        let [a, b] = [pair.a, pair.b].map(|slot| particles.shape[slot.index()].index());
        self.extended[a][0] & self.extended[b][1] != 0
    }

    /// Does a pair have a [patch](Self::has_patch) by its shapes, and not only because one of them is a piece?
    fn is_extended(&self, pair: Pair, particles: &Particles) -> bool {
        let [a, b] = [pair.a, pair.b].map(|slot| particles.shape[slot.index()].index());
        self.extended[a][0] & self.extended[b][1] & !(OF_FIRST | OF_SECOND) != 0
    }

    /// Constants of a pair.
    fn constants(&self, pair: Pair, particles: &Particles) -> M::Constants<f64> {
        if particles.needs.scale {
            return self.of_bodies(pair.a, pair.b, particles).of_law;
        }
        let [a, b] = [pair.a, pair.b].map(|slot| particles.shape[slot.index()].index());
        self.of_shapes((a, b), particles).of_law
    }
}

/// Bit of the extended contacts of pieces as first bodies, and of all second ones.
const OF_FIRST: u8 = 1 << 6;
/// Bit of the extended contacts of pieces as second bodies, and of all first ones.
const OF_SECOND: u8 = 1 << 7;

/// Sorts of extended contact that each shape can be the first and the second body of, as bits, see [`Kind::extended`]. A
/// pair with a piece counts as extended with any other shape, so that it can have a share of the masses of its bodies.
fn extended(library: &Library) -> Vec<[u8; 2]> {
    let own = library.shapes.iter().map(|shape| shape.kind().extended());
    if library.pieces.is_empty() {
        return own.collect();
    }
    let is_piece = |shape: usize| u8::from(library.piece(ShapeId(shape as u16)).is_some());
    let with = |(shape, [first, second]): (usize, [u8; 2])| {
        let piece = is_piece(shape);
        [first | OF_SECOND | (OF_FIRST * piece), second | OF_FIRST | (OF_SECOND * piece)]
    };
    own.enumerate().map(with).collect()
}

impl<M: Model> ForceLaw for Law<M> {
    fn about(&self) -> &dyn About {
        &self.model
    }

    fn needs(&self) -> Needs {
        self.needs
    }

    fn state(&self) -> &[StateColumn] {
        &self.state
    }

    fn apply(&self, work: &mut Work, particles: &Particles, dt: f64, sums: &mut Sums) {
        let contacts = Contacts { law: self, work, particles, dt, sums, summed: 0 };
        if M::FACES && self.needs.patches {
            lanes::dispatch(patches::WithPatches(contacts));
        } else {
            lanes::dispatch(contacts);
        }
    }

    fn normal_force(
        &self,
        pair: Pair,
        particles: &Particles,
        geometry: &Geometry,
        state: &[f64],
    ) -> f64 {
        if self.needs.patches {
            return patches::Memory::read(&state[self.width..]).press;
        }
        let constants = self.constants(pair, particles);
        self.model.last(&constants, geometry.overlap, &state[..self.width]).press
    }

    fn elastic(&self, pair: Pair, particles: &Particles, geometry: &Geometry) -> f64 {
        self.model.elastic(&self.constants_now(pair, particles, geometry), geometry.overlap)
    }

    fn stored(&self, pair: Pair, particles: &Particles, geometry: &Geometry, state: &[f64]) -> f64 {
        let constants = self.constants(pair, particles);
        let [of_model, of_patch] = state.split_at(self.width).into();
        let of_torsion = if self.needs.patches {
            patches::Memory::read(of_patch)
                .stored(&self.model.turning(&constants, geometry.overlap))
        } else {
            0.0
        };
        let stored = self.model.last(&constants, geometry.overlap, of_model).stored;
        stored.iter().sum::<f64>() + of_torsion
    }

    fn stiffness(&self, pair: Pair, particles: &Particles, geometry: &Geometry, dt: f64) -> f64 {
        self.model.stiffness(&self.constants_now(pair, particles, geometry), geometry.overlap, dt)
    }

    fn outlives(&self, pair: Pair, particles: &Particles) -> f64 {
        self.model.outlives(&self.constants(pair, particles))
    }
}

/// One constant for all lanes.
struct Same<'a, C>(&'a PairConstants<C, f64>);

/// One constant for each lane.
struct Each<'a, C>(&'a [PairConstants<C, f64>; WIDTH]);

impl<C, L: Eight> Spread<C, L> for Same<'_, C> {
    #[inline(always)]
    fn of(&self, get: impl Fn(&C) -> f64) -> L {
        L::all(get(&self.0.of_law))
    }
}

impl<C, L: Eight> Spread<C, L> for Each<'_, C> {
    #[inline(always)]
    fn of(&self, get: impl Fn(&C) -> f64) -> L {
        let mut numbers = [0.0; WIDTH];
        for (number, of_pair) in numbers.iter_mut().zip(self.0) {
            *number = get(&of_pair.of_law);
        }
        L::load(&numbers)
    }
}

/// Contacts whose forces are to be found.
struct Contacts<'a, 'b, M: Model> {
    law: &'a Law<M>,
    work: &'a mut Work<'b>,
    particles: &'a Particles,
    dt: f64,
    sums: &'a mut Sums,
    /// Separated contacts summed so far.
    summed: usize,
}

impl<M: Model> Kernel for Contacts<'_, '_, M> {
    type Home = M;

    #[inline(always)]
    fn run<L: Eight>(mut self) {
        // Parts that the law does not use are left out at compile time, without a branch.
        let points = self.law.stride > self.law.width;
        let velocity = self.law.needs.velocity;
        if M::BY_CURVATURE && self.law.needs.curvature {
            // These bodies turn and have points.
            if M::MOMENTS || M::FORESEES || velocity {
                self.all::<L, true, true, true, true>();
            } else {
                self.all::<L, false, true, false, true>();
            }
        } else if M::MOMENTS {
            // Moments need velocities and turning.
            if points {
                self.all::<L, true, true, true, false>();
            } else {
                self.all::<L, true, true, false, false>();
            }
        } else {
            match (M::FORESEES || velocity, self.particles.spin.is_some()) {
                (true, true) if points => self.all::<L, true, true, true, false>(),
                (true, true) => self.all::<L, true, true, false, false>(),
                (true, false) => self.all::<L, true, false, false, false>(),
                (false, true) => self.all::<L, false, true, false, false>(),
                (false, false) => self.all::<L, false, false, false, false>(),
            }
        }
        self.add_separated_before(usize::MAX);
    }
}

impl<M: Model> Contacts<'_, '_, M> {
    #[inline(always)]
    fn all<
        L: Eight,
        const MOVES: bool,
        const TURNS: bool,
        const POINTS: bool,
        const CURVED: bool,
    >(
        &mut self,
    ) {
        let pairs = bytemuck::cast_slice(self.work.pairs);
        let pairs = RowPairs::new(pairs, self.particles.slots());
        let alike = self.alike::<L>();
        // Each block of eight contacts overwrites the state of the one before.
        let (mut room, mut wide) =
            ([L::all(0.0); MOST_STATE], [L::all(0.0); MOST_STATE + MOST_ACTED]);
        let mut widest = [L::all(0.0); MOST_STATE_OF_MOMENTS + MOST_ACTED];
        let width = if POINTS { self.law.stride } else { self.law.width };
        let state = match (M::MOMENTS, POINTS) {
            (true, _) => &mut widest[..width],
            (false, true) => &mut wide[..width],
            (false, false) => &mut room[..width],
        };
        for first in (0..self.work.pairs.len()).step_by(WIDTH) {
            let mut room = [[0; 2]; WIDTH];
            let bodies = pairs.eight(first, &mut room);
            let own;
            let constants = if let Some(alike) = &alike {
                alike
            } else {
                own = self.constants::<L>(bodies);
                &own
            };
            self.eight::<L, MOVES, TURNS, POINTS, CURVED>(first, bodies, constants, state);
        }
    }

    /// Constants of all contacts, if all particles have one shape and size and the contacts touch no wall.
    #[inline(always)]
    fn alike<L: Eight>(&self) -> Option<OfEight<M, L>> {
        let pair = self.work.pairs.first()?;
        let with_walls = pair.b.index() >= self.particles.first_facet();
        let Particles { library, needs, .. } = self.particles;
        if with_walls || library.grains().len() > 1 || needs.scale {
            return None;
        }
        Some(same::<M, L>(&self.law.of_shapes((0, 0), self.particles)))
    }

    /// Constants of eight contacts.
    #[inline(always)]
    fn constants<L: Eight>(&self, [a, b]: [Gather; 2]) -> OfEight<M, L> {
        let Self { law, particles, .. } = *self;
        if particles.needs.scale {
            let [first, other] = [a, b].map(|bodies| Slot(bodies.at(0) as u32));
            let mut pairs = [law.of_bodies(first, other, particles); WIDTH];
            for (lane, of_pair) in pairs.iter_mut().enumerate().skip(1) {
                let (first, other) = (Slot(a.at(lane) as u32), Slot(b.at(lane) as u32));
                *of_pair = law.of_bodies(first, other, particles);
            }
            return each::<M, L>(&pairs);
        }
        let (of_a, of_b) = (a.rows(&particles.shape), b.rows(&particles.shape));
        let mut shapes = [(0, 0); WIDTH];
        let mut alike = true;
        for lane in 0..WIDTH {
            shapes[lane] = (of_a[lane].index(), of_b[lane].index());
            alike &= of_a[lane] == of_a[0] && of_b[lane] == of_b[0];
        }
        // In most blocks all eight pairs are alike.
        let one = law.of_shapes(shapes[0], particles);
        if alike {
            return same::<M, L>(&one);
        }
        let mut pairs = [one; WIDTH];
        for (of_pair, shapes) in pairs.iter_mut().zip(&shapes) {
            *of_pair = law.of_shapes(*shapes, particles);
        }
        each::<M, L>(&pairs)
    }

    /// Finds the forces of up to eight contacts; the other lanes repeat the last. `MOVES`: the law needs the motion of
    /// surfaces. `TURNS`: bodies have moments. `POINTS`: [`LastForce`] is remembered. `CURVED`: the law depends on the curvature
    /// of bodies.
    #[inline(always)]
    fn eight<
        L: Eight,
        const MOVES: bool,
        const TURNS: bool,
        const POINTS: bool,
        const CURVED: bool,
    >(
        &mut self,
        first: usize,
        bodies: [Gather; 2],
        constants: &OfEight<M, L>,
        state: &mut [L],
    ) {
        let Self { law, particles, dt, .. } = *self;
        let count = (self.work.pairs.len() - first).min(WIDTH);
        // A block never mixes pairs with walls and pairs of particles.
        let with_walls = bodies[1].at(0) >= particles.first_facet();
        let turning_walls = TURNS && with_walls && particles.facets.any_turns;
        let block = Block { first, count, bodies, turning_walls };

        let last = read_last::<L>(self.work, &block, state);
        let acted =
            if POINTS { LastForce::read(&state[law.width..], law.has_points) } else { None };
        let now = GeometryInLanes::of(&eight_from_rows(self.work.geometry, first, count));
        let arms = self.arms::<L, MOVES, TURNS>(&block, &constants.radii, [&last, &now], acted);
        let mut motion = if MOVES {
            Motion::of::<M>(particles, bodies, arms.now, arms.last, dt)
        } else {
            Motion::none()
        };
        let belts = if MOVES && with_walls { belts::<L>(particles, bodies[1]) } else { None };
        let belts = motion.carried_by(belts, [&now, &last]);

        let curvatures = if CURVED {
            Some(Curvatures::of(&eight_from_rows(self.work.curvatures, first, count)))
        } else {
            None
        };
        let of_model = &mut state[..law.width];
        let done =
            self.act::<L, MOVES>(constants, [&last, &now], &motion, of_model, acted, curvatures);
        if POINTS {
            LastForce::write(arms.now[0], done.viscous, &mut state[law.width..], law.has_points);
        }
        write_state(self.work.state, state.len(), first, count, state);
        let torques = done.torques::<M, CURVED>(&arms);
        let next_separated = self.work.separated.get(self.summed).map_or(usize::MAX, |p| p.before);
        if count == WIDTH && !with_walls && first + count <= next_separated {
            self.sum_at_once::<L, TURNS>(&block, &done, torques);
            return;
        }

        let shares = L::all(shares(with_walls));
        let share = shares * done.lost.all;
        let of_friction = (shares * done.lost.of_friction).store();
        let [of_dashpots, of_turning, of_adhesion] = done.lost.parts;
        let parts = [
            (shares * of_dashpots).store(),
            (shares * of_turning).store(),
            (shares * of_adhesion).store(),
        ];
        let impulse = if with_walls {
            let on_arms = if turning_walls { Some(&arms) } else { None };
            Some(done.impulse::<M, CURVED>(on_arms, belts, L::all(0.5 * dt)))
        } else {
            None
        };
        let (force, torques) = (done.force.store(), [torques[0].store(), torques[1].store()]);
        self.sum_in_turn::<TURNS>(
            &block,
            &Summands { force, torques, share: share.store(), of_friction, parts, impulse },
        );
    }

    /// Points where forces act, from the centres of the bodies.
    #[inline(always)]
    fn arms<L: Eight, const MOVES: bool, const TURNS: bool>(
        &self,
        block: &Block,
        radii: &[L; 2],
        [last, now]: [&GeometryInLanes<L>; 2],
        acted: Option<LastForce<L>>,
    ) -> Arms<L> {
        let Self { work, particles, dt, .. } = self;
        let Block { first, count, bodies: [a, b], turning_walls } = *block;
        let half = L::all(0.5);
        let has_points = !work.points.is_empty();
        let point = if has_points {
            triple::<L>(&eight_from_rows(work.points, first, count))
        } else {
            now.normal.times(radii[0] - half * now.overlap)
        };
        if !MOVES && !TURNS {
            return Arms { now: [point; 2], last: [point; 2] };
        }
        let position = &particles.position;
        let to_b = vectors::<L>(position, b).minus(vectors(position, a));
        let arm_b = point.minus(particles.cell.nearest_of(to_b));
        let (of_acted, is_seen_from_b) = match acted {
            Some(LastForce { point: Some(on_a), .. }) => (on_a, true),
            _ if has_points => (point, false),
            _ => (last.normal.times(radii[0] - half * last.overlap), turning_walls),
        };
        let on_b = if is_seen_from_b {
            // From where the centre of B was at the last step.
            let parted = parting::<L>(particles, [a, b]).times(L::all(*dt));
            of_acted.plus(arm_b.minus(point)).plus(parted)
        } else if has_points {
            arm_b
        } else {
            last.normal.times(half * last.overlap - radii[1])
        };
        Arms { now: [point, arm_b], last: [of_acted, on_b] }
    }

    /// Forces and losses. `state` holds the values of the last step on entry and those for the next step on return.
    #[inline(always)]
    fn act<L: Eight, const MOVES: bool>(
        &self,
        constants: &OfEight<M, L>,
        [last, now]: [&GeometryInLanes<L>; 2],
        motion: &Motion<L>,
        state: &mut [L],
        acted: Option<LastForce<L>>,
        curvatures: Option<Curvatures<L>>,
    ) -> LaneResults<L> {
        let Self { law, dt, .. } = *self;
        let of_last = &constants.of_law;
        let curved;
        let constants = if let Some(Curvatures { root_of_radius, .. }) = curvatures {
            curved = law.model.curved(of_last, root_of_radius);
            &curved
        } else {
            of_last
        };
        let zero = L::all(0.0);
        let Motion { velocity, last_velocity, turning, .. } = *motion;
        let GeometryInLanes { normal, .. } = *now;
        let mut contact = motion.contact(last, now, dt).timed(law.model.outlives(constants));
        if let Some(LastForce { viscous: Some(last), .. }) = acted {
            contact.last_viscous = last;
        }
        let mut before = law.model.last(of_last, last.overlap, state);
        let last_press = last.normal.times(before.press);
        let turned_before =
            if M::MOMENTS { law.model.turned(constants, last.overlap, state) } else { zero };
        let acting = law.model.act(constants, &contact, state);
        let press = normal.times(acting.press);

        let mut damping = None;
        if let Some(LastForce { viscous: Some(last), .. }) = acted {
            before.rub = before.rub.plus(last);
            // At Coulomb's limit the whole force is friction.
            let power = last.dot(last_velocity) + acting.viscous.dot(velocity);
            damping = Some(power.or(zero, L::all(1.0).at_most(acting.kept.force)));
        }
        let mut lost = Losses::none();
        if MOVES && dt > 0.0 {
            let (mut last_stored, mut stored) = (before.stored, acting.stored);
            let pressing = if curvatures.is_some() {
                // The work of dashpots alone: the turning of bodies changes the energy at constant overlap.
                let last_beyond = before.press - of_curved(last_stored[0], last.overlap);
                let beyond = acting.press - of_curved(stored[0], now.overlap);
                (last_stored[0], stored[0]) = (zero, zero);
                let last_approach = last.normal.dot(last_velocity);
                last_beyond * last_approach + beyond * normal.dot(velocity)
            } else {
                last_press.dot(last_velocity) + press.dot(velocity)
            };
            let (turning, turned) = if M::MOMENTS {
                let power = before.moment.plus(acting.moment).dot(turning);
                (Some(power), law.model.turned(constants, now.overlap, state))
            } else {
                (None, zero)
            };
            let stored = [Stored::of(last_stored, turned_before), Stored::of(stored, turned)];
            let rubbing = before.rub.dot(last_velocity) + acting.rub.dot(velocity);
            let powers = Powers { pressing, rubbing, turning, damping };
            let dissipates = law.model.dissipates(constants);
            lost = powers.balance(stored, L::all(0.5 * dt), dissipates);
            if M::TEARS {
                lost.parts[2] = zero.or(law.model.torn(constants)[0], contact.touched);
            }
        }
        let last_force = last_press.plus(before.rub);
        let (mut force, mut moment) = (press.plus(acting.rub), acting.moment);
        let mut last_moment = before.moment;
        if let Some(curvatures) = curvatures {
            let stored = acting.stored[0];
            let elastic = curvatures.moment.times(stored);
            force = force.plus(curvatures.force.times(stored));
            // The elastic moment of the last touch is not remembered: the present one is used.
            last_moment = last_moment.plus(elastic.or(Triple::zero(), contact.touched));
            moment = moment.plus(elastic);
        }
        LaneResults { force, last_force, viscous: acting.viscous, last_moment, moment, lost }
    }

    /// Adds forces, moments and losses of eight contacts to their bodies, if no separated contact comes in between. Each
    /// row is added as soon as it is made, so that none waits in memory.
    #[inline(always)]
    fn sum_at_once<L: Eight, const TURNS: bool>(
        &mut self,
        block: &Block,
        done: &LaneResults<L>,
        torques: [Triple<L>; 2],
    ) {
        let Block { first, bodies: [a, b], .. } = *block;
        let rows = done.force.rows(L::all(0.5) * done.lost.all);
        write_threes(&mut self.work.forces[first..], &rows);
        let mut opposite = rows;
        for row in &mut opposite {
            *row = row.opposite();
        }
        let sums = bytemuck::cast_slice_mut(&mut self.sums.force);
        Gather::add([b, a], [&rows, &opposite], sums);
        if TURNS {
            let share = L::all(0.5) * done.lost.of_friction;
            let sums = bytemuck::cast_slice_mut(&mut self.sums.torque);
            let rows = [&torques[0].rows(share), &torques[1].rows(share)];
            Gather::add([b, a], rows, sums);
        }
        // Written out for each part, so that laws without it do not carry it.
        let [of_dashpots, of_turning, of_adhesion] = &mut self.sums.parts;
        if !of_dashpots.is_empty() {
            let share = (L::all(0.5) * done.lost.parts[0]).store();
            Gather::add_numbers([b, a], &share, of_dashpots);
        }
        if M::MOMENTS && !of_turning.is_empty() {
            let share = (L::all(0.5) * done.lost.parts[1]).store();
            Gather::add_numbers([b, a], &share, of_turning);
        }
        if M::TEARS {
            let share = (L::all(0.5) * done.lost.parts[2]).store();
            Gather::add_numbers([b, a], &share, of_adhesion);
        }
    }

    /// Adds forces, moments and losses of contacts to their bodies one after the other, with the losses of contacts that
    /// have separated in between.
    #[inline(never)]
    fn sum_in_turn<const TURNS: bool>(&mut self, block: &Block, summands: &Summands) {
        let Summands { force, torques, share, of_friction, parts, impulse } = summands;
        for lane in 0..block.count {
            let place = block.first + lane;
            let pair = self.work.pairs[place];
            self.add_separated_before(place);
            let [x, y, z] = row(force, lane);
            let share = share[lane];
            self.work.forces[place] = Vec3::new(x, y, z);
            let forces = [[x, y, z, share], [x, y, z, share].opposite()];
            for (k, slot) in [pair.b, pair.a].into_iter().enumerate() {
                add(&mut self.sums.force, slot.index(), forces[k]);
                if TURNS {
                    let [x, y, z] = row(&torques[k], lane);
                    add(&mut self.sums.torque, slot.index(), [x, y, z, of_friction[lane]]);
                }
                self.sums.add_parts(slot.index(), row(parts, lane));
            }
            if TURNS && impulse.is_some() && self.particles.facets.any_torque {
                self.sums.at_walls.push(row(&torques[1], lane).into());
            }
            if let Some(Impulse { straight, turning, of_belts }) = impulse {
                let impulse = Vec3::from(row(straight, lane));
                let of_wall = &self.particles.velocity[pair.b.index()];
                let mut energy = -impulse.dot(of_wall);
                if let (Some(turning), Some(spin)) = (turning, &self.particles.spin) {
                    let impulse = Vec3::from(row(turning, lane));
                    energy -= impulse.dot(&spin.angular_velocity[pair.b.index()]);
                }
                if let Some(of_belts) = of_belts {
                    energy -= of_belts[lane];
                }
                self.note_on_wall(place, energy, share, of_friction[lane]);
            }
        }
    }

    /// Records the work and losses [J] of a contact with a wall.
    #[inline]
    fn note_on_wall(&mut self, place: usize, work: f64, lost: f64, rubbed: f64) {
        let Self { particles, sums, work: all, .. } = self;
        let pair = all.pairs[place];
        sums.note_on_wall(OnWall { pair, work, lost, rubbed }, particles, || {
            let Geometry { normal, overlap } = &all.geometry[place];
            let of_sphere = || touch_of_sphere(particles.radius(pair.a.index()), normal, *overlap);
            let point = all.points.get(place).copied().unwrap_or_else(of_sphere);
            PressOnWall { point, force: all.forces[place] }
        });
    }

    /// Records the work and losses of a contact with a wall that has separated and acted in a point.
    fn note_parting(&mut self, pair: Pair, point: Vec3, work: f64, lost: &Losses) {
        let &Losses { all: lost, of_friction: rubbed, .. } = lost;
        let press = || PressOnWall { point, force: Vec3::zeros() };
        self.sums.note_on_wall(OnWall { pair, work, lost, rubbed }, self.particles, press);
    }

    /// Adds the losses of separated contacts that come before this place.
    #[inline(always)]
    fn add_separated_before(&mut self, place: usize) {
        while let Some(separated) = self.work.separated.get(self.summed)
            && separated.before <= place
        {
            self.add_separated(*separated);
            self.summed += 1;
        }
    }

    /// Adds the loss of one separated contact. Its force is zero now; its stored energy counts as dissipated.
    #[cold]
    fn add_separated(&mut self, separated: Separated) {
        let Self { law, particles, dt, .. } = *self;
        let last = &self.work.last;
        let bodies = particles.bodies();
        let (pair, geometry) = (last.pairs[separated.place], &last.geometry[separated.place]);
        if law.needs.patches {
            self.add_separated_with_patches(separated);
            return;
        }
        let width = law.stride;
        let (state, acted) = last.state[separated.place * width..][..width].split_at(law.width);
        let acted = LastForce::read(acted, law.has_points);
        let with_wall = pair.b.index() >= particles.first_facet();
        let of_a = particles.velocity[pair.a.index()];
        let slides = particles.sliding_of_image(pair);
        let of_b = particles.velocity[pair.b.index()] + slides;
        let from_b = |arm: Vec3| arm - bodies.relative(pair) + (of_b - of_a) * dt;
        let into = geometry.normal * (0.5 * geometry.overlap);
        let on_a = acted.and_then(|acted| acted.point);
        let (arm_a, arm_b) = if let Some(Triple { x, y, z }) = on_a {
            let arm_a = Vec3::new(x, y, z);
            (arm_a, from_b(arm_a))
        } else {
            // For spheres: the middle of the overlap between the farthest points along the last normal.
            let frames = bodies.frames(pair);
            let (body, other) = bodies.posed(pair, &frames);
            let arm_a = body.support(&geometry.normal) - into;
            (arm_a, if with_wall { from_b(arm_a) } else { other.support(&-geometry.normal) + into })
        };
        let belt = particles.belt_at(pair.b, &geometry.normal);
        let of_b = particles.velocity_at(pair.b, &arm_b) + slides + belt;
        let velocity = particles.velocity_at(pair.a, &arm_a) - of_b;
        let constants = law.constants(pair, particles);
        let before = law.model.last(&constants, geometry.overlap, state);
        let viscous = acted.and_then(|acted| acted.viscous).unwrap_or_else(Triple::zero);
        let press = geometry.normal * before.press;
        let rub = vector(before.rub.plus(viscous));
        let moment = if M::MOMENTS { vector(before.moment) } else { Vec3::zeros() };
        let [spin_a, spin_b] = [pair.a, pair.b].map(|slot| particles.angular_velocity_of(slot));
        // The force has fallen to zero: only the half of the last step counts.
        let work = |force: &Vec3, velocity: &Vec3| 0.5 * dt * force.dot(velocity);
        let mut lost = Losses::none();
        if law.needs.velocity && dt > 0.0 {
            let [mut stored, rubbing] = before.stored;
            let mut pressing = press.dot(&velocity);
            if law.needs.curvature {
                let elastic = geometry.normal * of_curved(stored, geometry.overlap);
                (pressing, stored) = ((press - elastic).dot(&velocity), 0.0);
            }
            let turning = law.model.turned(&constants, geometry.overlap, state);
            let powers = Powers {
                pressing,
                rubbing: rub.dot(&velocity),
                turning: Some(moment.dot(&(spin_a - spin_b))),
                // The normal force falls to zero, so friction is at its limit.
                damping: None,
            };
            let stored = [Stored::of([stored, rubbing], turning), Stored::none()];
            let dissipates = law.model.dissipates(&constants);
            lost = powers.balance(stored, 0.5 * dt, dissipates);
            if dissipates[0] & 1 == 1 {
                lost.parts[2] = law.model.torn(&constants)[1];
            }
        }
        if with_wall {
            let on_wall = work(&(press + rub), &of_b) + work(&moment, &spin_b);
            self.note_parting(pair, arm_a, -on_wall, &lost);
        }
        self.sums.lose(pair, lost, particles.first_facet());
    }
}

/// Block of up to eight contacts.
#[derive(Clone, Copy)]
struct Block<'a> {
    /// Place of the first.
    first: usize,
    /// Number of contacts.
    count: usize,
    /// Their bodies A and B.
    bodies: [Gather<'a>; 2],
    /// Is there a wall that turns among the bodies?
    turning_walls: bool,
}

/// Normals and overlaps [m] of eight contacts.
struct GeometryInLanes<L> {
    normal: Triple<L>,
    overlap: L,
}

impl<L: Eight> GeometryInLanes<L> {
    #[inline(always)]
    fn of(rows: &[&Geometry; WIDTH]) -> Self {
        let [a, b, c, d, e, f, g, h] = rows;
        let [x, y, z, overlap] = L::columns_of_4(&[
            bytemuck::cast_ref(*a),
            bytemuck::cast_ref(*b),
            bytemuck::cast_ref(*c),
            bytemuck::cast_ref(*d),
            bytemuck::cast_ref(*e),
            bytemuck::cast_ref(*f),
            bytemuck::cast_ref(*g),
            bytemuck::cast_ref(*h),
        ]);
        Self { normal: Triple { x, y, z }, overlap }
    }
}

/// Vectors from the centres of A and of B to the points where forces act [m].
struct Arms<L> {
    now: [Triple<L>; 2],
    /// At the last step.
    last: [Triple<L>; 2],
}

/// Results of eight contacts.
struct LaneResults<L> {
    /// Force on B [N].
    force: Triple<L>,
    /// Force on B at the last step [N].
    last_force: Triple<L>,
    /// Viscous part of the present force [N].
    viscous: Triple<L>,
    /// Moments on B about the contact point at the last step and now [N m], of models with moments.
    last_moment: Triple<L>,
    moment: Triple<L>,
    /// Losses since the last step.
    lost: Losses<L>,
}

impl<L: Eight> LaneResults<L> {
    /// Moments on B and A about their centres [N m].
    #[inline(always)]
    fn torques<M: Model, const CURVED: bool>(&self, arms: &Arms<L>) -> [Triple<L>; 2] {
        let [on_b, on_a] = [arms.now[1].cross(self.force), self.force.cross(arms.now[0])];
        if M::MOMENTS || CURVED {
            return [on_b.plus(self.moment), on_a.minus(self.moment)];
        }
        [on_b, on_a]
    }

    /// Impulse on walls over two half steps [s], with `arms` of walls that turn and velocities of `belts` now and at the last step [m/s].
    #[inline(always)]
    fn impulse<M: Model, const CURVED: bool>(
        &self,
        arms: Option<&Arms<L>>,
        belts: Option<[Triple<L>; 2]>,
        half_step: L,
    ) -> Impulse {
        let straight = self.last_force.plus(self.force).times(half_step);
        let turning = match arms {
            Some(arms) => {
                let now = arms.now[1].cross(self.force);
                let mut sum = arms.last[1].cross(self.last_force).plus(now);
                if M::MOMENTS || CURVED {
                    sum = sum.plus(self.last_moment.plus(self.moment));
                }
                Some(sum.times(half_step).store())
            }
            None => None,
        };
        let of_belts = match belts {
            Some([now, last]) => {
                let power = self.force.dot(now) + self.last_force.dot(last);
                Some((half_step * power).store())
            }
            None => None,
        };
        Impulse { straight: straight.store(), turning, of_belts }
    }
}

/// Forces, moments and losses of up to eight contacts, in columns.
struct Summands {
    /// Force on B [N].
    force: [[f64; WIDTH]; 3],
    /// Moments on B and A [N m].
    torques: [[[f64; WIDTH]; 3]; 2],
    /// Energy that each body loses, and its part lost to friction [J].
    share: [f64; WIDTH],
    of_friction: [f64; WIDTH],
    /// See [`Losses`].
    parts: [[f64; WIDTH]; 3],
    /// Impulse on walls since the last step.
    impulse: Option<Impulse>,
}

/// Geometry of eight contacts at the last step; their state values go to `state`.
#[inline(always)]
fn read_last<L: Eight>(work: &Work, block: &Block, state: &mut [L]) -> GeometryInLanes<L> {
    let Last { geometry, state: all, .. } = work.last;
    // Usually all of them touched at the last step and stand there in the same order.
    if let Some(start) = stood_in_a_row(work.from, block.first, block.count) {
        read_states_in_a_row(all, start, state);
        return GeometryInLanes::of(&eight_rows(geometry, start));
    }
    let from = places_before(work.from, block.first, block.count);
    read_state(&rows_at(all, state.len(), &from), state);
    GeometryInLanes::of(&geometries_at(geometry, &from))
}

/// Impulses of particles on walls since the last step, in eight contacts.
struct Impulse {
    /// Impulse [N s].
    straight: [[f64; WIDTH]; 3],
    /// Angular impulse about the reference points of walls that turn [N m s].
    turning: Option<[[f64; WIDTH]; 3]>,
    /// Work against the moving surfaces of belts [J].
    of_belts: Option<[f64; WIDTH]>,
}

/// Motion of A's surface against B's.
struct Motion<L> {
    /// Velocity at the contact point [m/s]: positive along the normal is approach.
    velocity: Triple<L>,
    /// Velocity where the last force acted [m/s].
    last_velocity: Triple<L>,
    /// Sum of both angular velocities [rad/s].
    spin: Triple<L>,
    /// Angular velocity of A minus that of B [rad/s].
    turning: Triple<L>,
    /// Correction of `velocity` to the places half a step ago, see [`Motion::midway`] [m/s].
    midway: Triple<L>,
    /// Predicted gain of `velocity` until the time of the positions [m/s]; zero for laws without prediction, and at the start
    /// of a stage.
    ahead: Triple<L>,
}

impl<L: Eight> Motion<L> {
    /// No motion, for laws that do not need it.
    #[inline(always)]
    fn none() -> Self {
        let zero = Triple::zero();
        Self {
            velocity: zero,
            last_velocity: zero,
            spin: zero,
            turning: zero,
            midway: zero,
            ahead: zero,
        }
    }

    /// Motion of bodies A and B, at the present and the last arms from their centres [m].
    #[inline(always)]
    fn of<M: Model>(
        particles: &Particles,
        [a, b]: [Gather; 2],
        [arm_a, arm_b]: [Triple<L>; 2],
        [last_a, last_b]: [Triple<L>; 2],
        dt: f64,
    ) -> Self {
        let (of_a, spin_a) = velocities::<L>(particles, a);
        let (mut of_b, spin_b) = velocities::<L>(particles, b);
        if let Some(slides) = sliding_of_images(particles, [a, b]) {
            of_b = of_b.plus(slides);
        }
        let centres = of_a.minus(of_b);
        let velocity = centres.plus(spin_a.cross(arm_a)).minus(spin_b.cross(arm_b));
        let last_velocity = centres.plus(spin_a.cross(last_a)).minus(spin_b.cross(last_b));
        let (spin, turning) = (spin_a.plus(spin_b), spin_a.minus(spin_b));
        let with_wall = b.at(0) >= particles.first_facet();
        let midway = if particles.spin.is_none() || with_wall && !particles.facets.any_turns {
            Triple::zero()
        } else {
            Self::midway(spin, turning, centres, with_wall, dt)
        };
        let ahead = if M::FORESEES && particles.needs.ahead && dt > 0.0 {
            let (of_a, spin_a) = gains::<L>(particles, a);
            let (of_b, spin_b) = gains::<L>(particles, b);
            of_a.minus(of_b).plus(spin_a.cross(arm_a)).minus(spin_b.cross(arm_b))
        } else {
            Triple::zero()
        };
        Self { velocity, last_velocity, spin, turning, midway, ahead }
    }

    /// Correction of the velocity of A's surface against B's to the places half a step ago [m/s]. Velocities belong to that
    /// time: with this correction, two bodies that turn as one do not slide. A wall turns with its own spin, two particles
    /// with the mean of theirs. `centres` is the velocity of A's centre against B's [m/s].
    #[inline(always)]
    fn midway(
        spin: Triple<L>,
        turning: Triple<L>,
        centres: Triple<L>,
        with_wall: bool,
        dt: f64,
    ) -> Triple<L> {
        let of_both = if with_wall { spin.minus(turning) } else { spin };
        of_both.cross(centres).times(L::all(0.25 * dt))
    }

    /// Subtracts the motion of belts, walls whose surfaces move against them. Returns the surface velocities in the contact
    /// planes, now and at the last step [m/s].
    #[inline(always)]
    fn carried_by(
        &mut self,
        belts: Option<Triple<L>>,
        [now, last]: [&GeometryInLanes<L>; 2],
    ) -> Option<[Triple<L>; 2]> {
        let belts = belts?;
        let now = belts.minus(now.normal.times(belts.dot(now.normal)));
        let last = belts.minus(last.normal.times(belts.dot(last.normal)));
        self.velocity = self.velocity.minus(now);
        self.last_velocity = self.last_velocity.minus(last);
        Some([now, last])
    }
}

impl<L: Eight> Motion<L> {
    /// Contacts in one point, as a law sees them.
    #[inline(always)]
    fn contact(&self, last: &GeometryInLanes<L>, now: &GeometryInLanes<L>, dt: f64) -> Contact<L> {
        let GeometryInLanes { normal, overlap } = *now;
        let velocity = self.velocity.plus(self.midway);
        let approach = velocity.dot(normal);
        Contact {
            normal,
            last_normal: last.normal,
            overlap,
            last_overlap: last.overlap,
            gain: L::all(1.0),
            approach,
            sliding: velocity.minus(normal.times(approach)),
            foreseen: self.velocity.plus(self.ahead),
            last_viscous: Triple::zero(),
            twist: L::all(0.5 * dt) * self.spin.dot(normal),
            turning: self.turning,
            touched: L::all(0.0).less(last.normal.dot(last.normal)),
            extended: false,
            torsion: L::all(0.0),
            dt,
            begun: 0,
            lasted: L::all(dt),
            ends: 0,
            left: L::all(1.0),
        }
    }
}

/// Share of an energy for each body: half, or all for a particle at a wall.
#[inline(always)]
const fn shares(with_walls: bool) -> f64 {
    if with_walls { 1.0 } else { 0.5 }
}

/// Velocities of the surfaces of walls against the walls [m/s]; `None` if no wall is a belt.
#[inline(always)]
fn belts<L: Eight>(particles: &Particles, walls: Gather) -> Option<Triple<L>> {
    let belts = &particles.facets.belts;
    if belts.is_empty() {
        return None;
    }
    let mut columns = [[0.0; WIDTH]; 3];
    for lane in 0..WIDTH {
        let belt = belts[walls.at(lane) - particles.first_facet()];
        for (column, component) in columns.iter_mut().zip(belt.iter()) {
            column[lane] = *component;
        }
    }
    let [x, y, z] = &columns;
    Some(Triple { x: L::load(x), y: L::load(y), z: L::load(z) })
}

/// Velocities of the images of B next to A against B itself [m/s]; `None` if no image slides.
#[inline(always)]
fn sliding_of_images<L: Eight>(particles: &Particles, [a, b]: [Gather; 2]) -> Option<Triple<L>> {
    let Particles { position, velocity, cell, .. } = particles;
    if !cell.moves() {
        return None;
    }
    let apart = vectors::<L>(position, b).minus(vectors(position, a));
    let parting = vectors::<L>(velocity, b).minus(vectors(velocity, a));
    Some(cell.velocity_of_nearest_in_lanes(apart, parting))
}

/// Velocities of the centres of B against those of A [m/s].
#[inline(always)]
fn parting<L: Eight>(particles: &Particles, [a, b]: [Gather; 2]) -> Triple<L> {
    let of_a = vectors::<L>(&particles.velocity, a);
    let parting = vectors::<L>(&particles.velocity, b).minus(of_a);
    match sliding_of_images(particles, [a, b]) {
        Some(slides) => parting.plus(slides),
        None => parting,
    }
}

/// Velocities of the centres of bodies [m/s], and angular velocities [rad/s].
#[inline(always)]
fn velocities<L: Eight>(particles: &Particles, bodies: Gather) -> (Triple<L>, Triple<L>) {
    let velocity = vectors::<L>(&particles.velocity, bodies);
    let Some(spin) = &particles.spin else { return (velocity, Triple::zero()) };
    (velocity, vectors::<L>(&spin.angular_velocity, bodies))
}

/// Predicted gains of the velocities of the centres of bodies [m/s] and of their angular velocities [rad/s].
#[inline(always)]
fn gains<L: Eight>(particles: &Particles, bodies: Gather) -> (Triple<L>, Triple<L>) {
    let Ahead { velocity, angular_velocity } = &particles.ahead;
    let turning = if angular_velocity.is_empty() {
        Triple::zero()
    } else {
        vectors::<L>(angular_velocity, bodies)
    };
    (vectors::<L>(velocity, bodies), turning)
}

/// Turns a vector from the last contact plane into the present one: by the shortest rotation (Rodrigues' formula without
/// angles), and by the twist about the normal. Zero if there was no contact, and where the normal reverses because centres
/// have passed each other.
#[inline(always)]
pub fn carried<L: Lanes>(vector: Triple<L>, contact: &Contact<L>) -> Triple<L> {
    let Contact { normal: new, last_normal: old, twist, touched, .. } = *contact;
    let one = L::all(1.0);
    let carried = vector.minus(old.plus(new).times(vector.dot(new) / (one + old.dot(new))));
    let turned = carried.plus(new.cross(carried).times(twist));
    let turned = turned.over((one + twist * twist).sqrt());
    let kept = L::all(-1.0 + 1e-8).less(old.dot(new));
    turned.or(Triple::zero(), kept & touched)
}

/// Parts of a tangential force [N] and of torsion that Coulomb's limit [N] leaves.
#[inline(always)]
pub fn within_limit<L: Lanes>(force: Triple<L>, limit: L, contact: &Contact<L>) -> Kept<L> {
    let one = L::all(1.0);
    let square = force.dot(force);
    if contact.extended {
        return within_common_limit(square, limit, contact);
    }
    let size = square.sqrt();
    let part = (limit / size).or(one, limit.less(size));
    Kept { force: part, torsion: part, remains: contact.remains(|| size / limit) }
}

/// Parts of force and torsion within their common limit, for bodies that touch with an extent. The limit is nearly an
/// ellipse, up to 6 % lower where both are alike. Where they slip, the springs yield across it: `f : t = v : s a ω`, with
/// `s` from 1.5 for torsion alone to 9/16 for none. On discs under even pressure this matches Coulomb's friction in each
/// point within 1 % of the limit, on squares within 2 % (Farkas et al. 2003, DOI 10.1103/PhysRevLett.90.248302). Rectangles
/// are treated like squares, in any direction of the force.
#[inline(always)]
fn within_common_limit<L: Lanes>(square: L, limit: L, contact: &Contact<L>) -> Kept<L> {
    let (zero, one) = (L::all(0.0), L::all(1.0));
    let of_torsion = contact.torsion * contact.torsion;
    // Size of force and torsion, and their limit in this direction.
    let sized = |square: L, of_torsion: L| {
        let both = square + of_torsion;
        let alike = square * of_torsion / (both * both);
        let alike = alike.or(zero, zero.less(both));
        (both.sqrt(), limit * (one - L::all(0.25) * alike))
    };
    let (size, most) = sized(square, of_torsion);
    let slides = most.less(size);
    let both = square + of_torsion;
    let way = (L::all(1.5) * of_torsion + L::all(0.5625) * square) / both;
    let force = most / size;
    let torsion = way / (way + (one / force - one));
    let (size_left, most_left) = sized(square * force * force, of_torsion * torsion * torsion);
    let scale = most_left / size_left;
    // Without pressure the limit is zero, and nothing is left.
    let left = |part: L| (part * scale).or(zero, zero.less(limit)).or(one, slides);
    Kept { force: left(force), torsion: left(torsion), remains: contact.remains(|| size / most) }
}

/// Derivative of an energy proportional to `δ^(5/2)`; 0 where there is no overlap.
#[inline(always)]
fn of_curved<L: Lanes>(energy: L, overlap: L) -> L {
    let zero = L::all(0.0);
    (L::all(2.5) * energy / overlap).or(zero, zero.less(overlap))
}

/// Coefficient of a dashpot with this part of critical damping [N s/m].
#[inline]
pub fn dashpot(ratio: f64, mass: f64, stiffness: f64) -> f64 {
    2.0 * ratio * (mass * stiffness).sqrt()
}

fn vector(v: Triple<f64>) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

/// Reduced mass `m_A m_B / (m_A + m_B)` [kg]. If one mass is infinite, as for most walls and held particles, it is the
/// other.
#[inline]
pub fn reduced_mass(a: &Body, b: &Body) -> f64 {
    if b.mass.is_infinite() {
        return a.mass;
    }
    if a.mass.is_infinite() {
        return b.mass;
    }
    a.mass * b.mass / (a.mass + b.mass)
}
