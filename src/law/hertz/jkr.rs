//! Adhesion of soft spheres after Johnson, Kendall and Roberts (1971, DOI 10.1098/rspa.1971.0141), with Mindlin's friction.
//!
//! With the contact radius `a` and the work of adhesion `w = 2 √(γ_A γ_B)` per area [J/m²]
//!
//! `δ = a²/R* - √(2π w a / E*)`, `N = 4/3 E* a³/R* - √(8π w E* a³)`.
//!
//! Where surfaces touch, at `δ = 0`, the contact springs open to `a³ = 2π w R*²/E*` and pulls with `4/3 π w R*`. When
//! bodies part, it outlives the overlap: it ends at the gap `3/4 (π² w² R*/E*²)^(1/3)`, where no solution `a` is left. The
//! pull-off force under a load is `3/2 π w R*`. With `w = 0` the law is Hertz's.
//!
//! The stored energy `∫ N dδ = 8/15 E* a⁵/R*² - 2/3 √(8π w E*) a^(7/2)/R* + π w a²` is 0 without a contact. It drops at the
//! first touch, and is positive at the end. Both jumps are lost, together `7.09 (w⁵ R*⁴/E*²)^(1/3)` (Thornton and Ning
//! 1998, DOI 10.1016/S0032-5910(98)00099-0). Adhesion counts these two losses; their discretization error counts with the
//! normal dashpots.
//!
//! # The radius from the overlap
//!
//! With `y = √(a/a_0)`, `a_0³ = 2π w R*²/E*` and `q = δ R*/a_0²`, the equation is `y⁴ - y = q`. The resolvent
//! `m³ + 4 q m = 1` has a simple root wherever there is a contact, which Newton's method finds. Then `u = √m`,
//! `y = (u + √(2/u - u²))/2`.
//!
//! # Other forces
//!
//! Dashpots and the tangential spring are those of Hertz with this `a`: `γ_n = 2 √(5/6) β √(2 E* a m*)`, `k_t = 8 G* a`.
//! The restitution set is that without adhesion; adhesion dissipates in addition. Friction has its limit from
//! `N + 2 · 3/2 π w R*` (Thornton 1991, DOI 10.1088/0022-3727/24/11/007).

#![expect(clippy::inline_always, reason = "see `lanes`")]

use super::{Before, CONTACT_RADIUS, Elastic, Hertz, NORMAL_FORCE, TANGENTIAL_FORCE};
use crate::contact::StateColumn;
use crate::ids::MaterialId;
use crate::lanes::{Lanes, Triple};
use crate::law::kernel::{Action, Contact, Kept, Model, Spread, carried, reduced_mass};
use crate::law::{About, Body, Hardest, dmt};
use crate::particles::Needs;
use crate::population::Library;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::f64::consts::PI;

/// Settings of this law in a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Elastic constants and dashpots, as without adhesion. The dashpots may attract.
    pub elastic: super::Settings,
    /// Surface energies of every pair of materials.
    pub adhesion: dmt::Interactions,
}

impl Settings {
    /// Largest gap over which spheres up to a radius [m] stick to each other or to a wall [m].
    pub fn reach(&self, radius: f64) -> f64 {
        reach(&self.elastic.interactions, &self.adhesion, radius)
    }

    /// Model for the bodies of a library.
    pub(crate) fn model(&self, library: &Library) -> Jkr {
        Jkr::new(self.clone(), library)
    }
}

/// See [`Settings::reach`].
fn reach(elastic: &super::Interactions, adhesion: &dmt::Interactions, radius: f64) -> f64 {
    let gap = elastic.iter().zip(adhesion.iter()).map(|(elastic, adhesion)| {
        Sticking::of(elastic.modulus, radius, adhesion.surface_energy).gap()
    });
    gap.fold(0.0, f64::max)
}

/// Elastic spheres that stick to each other.
#[derive(Clone, Debug)]
pub(crate) struct Jkr {
    hertz: Hertz<true>,
    adhesion: dmt::Interactions,
    /// Largest gap of a contact between the spheres of the scene [m].
    reach: f64,
    state: Vec<StateColumn>,
}

/// Constants of adhesion in a contact.
#[derive(Clone, Copy, Debug)]
pub struct Sticking<L> {
    /// `R*` [m].
    radius: L,
    /// `√(8π w E*)` [N/m^(3/2)].
    pull: L,
    /// `π w` [N/m].
    work: L,
    /// Contact radius `a_0` where surfaces touch without overlap [m]; 0 without adhesion.
    size: L,
    /// `a_0²/R*` [m]; 1 without adhesion.
    pub depth: L,
}

/// Overlap over [`Sticking::depth`] at which a contact ends: `-3/4 4^(-1/3)`.
pub const END: f64 = -0.472_470_393_710_577_4;
/// Contact radius there over `a_0`: `4^(-2/3)`.
const LAST_RADIUS: f64 = 0.396_850_262_992_049_9;
/// Steps of Newton's method; five reach rounding from the worst start.
const STEPS: u32 = 7;

impl Sticking<f64> {
    /// Constants for a modulus [Pa], a reduced radius [m] and a surface energy [J/m²].
    pub fn of(modulus: f64, radius: f64, surface_energy: f64) -> Self {
        let work = 2.0 * surface_energy;
        let size = libm::cbrt(2.0 * PI * work * radius * radius / modulus);
        let depth = if size > 0.0 { size * size / radius } else { 1.0 };
        Self { radius, pull: (8.0 * PI * work * modulus).sqrt(), work: PI * work, size, depth }
    }
}

impl<L: Lanes> Sticking<L> {
    /// Gap at which a contact ends [m].
    #[inline(always)]
    fn gap(&self) -> L {
        let zero = L::all(0.0);
        (L::all(-END) * self.depth).or(zero, zero.less(self.size))
    }

    /// Contact radius at an overlap [m].
    #[inline(always)]
    pub fn contact_radius(&self, overlap: L) -> L {
        let (zero, one) = (L::all(0.0), L::all(1.0));
        let end = L::all(END);
        let part = overlap / self.depth;
        let part = end.or(part, part.less(end));
        let four = L::all(4.0) * part;
        // Starts Newton's method above the root.
        let shallow = one - L::all(1.25) * part;
        let deep = (one / four).or(one, one.less(four));
        let mut m = deep.or(shallow, zero.less(part));
        for _ in 0..STEPS {
            let square = m * m;
            m = (L::all(2.0) * square * m + one) / (L::all(3.0) * square + four);
        }
        let u = m.sqrt();
        let rest = L::all(2.0) / u - m;
        let rest = zero.or(rest, rest.less(zero));
        let y = L::all(0.5) * (u + rest.sqrt());
        let sticks = self.size * y * y;
        sticks.or(super::root(self.radius * overlap), zero.less(self.size))
    }

    /// Normal force at a contact radius [N]; `normal` is `4/3 E*`.
    #[inline(always)]
    pub fn press(&self, normal: L, radius: L) -> L {
        radius * (normal * radius * radius / self.radius - self.pull * radius.sqrt())
    }

    /// Energy `∫ N dδ` [J].
    #[inline(always)]
    pub fn stored(&self, normal: L, radius: L) -> L {
        let flat = radius * radius / self.radius;
        let pulled = L::all(2.0 / 3.0) * self.pull * radius.sqrt() * radius * flat;
        L::all(0.4) * normal * radius * flat * flat - pulled + self.work * radius * radius
    }
}

/// Constants of a contact.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Constants<L> {
    /// Elastic constants for a root of the radius of 1, so that the contact radius takes the place of the root of the
    /// overlap.
    elastic: Elastic<L>,
    sticking: Sticking<L>,
}

impl<L: Lanes> Constants<L> {
    /// Elastic energy in the normal and the tangential direction [J].
    #[inline(always)]
    fn stored(&self, radius: L, tangential: Triple<L>) -> [L; 2] {
        let zero = L::all(0.0);
        let stiffness = self.elastic.tangential * radius;
        let sheared = L::all(0.5) * tangential.dot(tangential) / stiffness;
        [self.sticking.stored(self.elastic.normal, radius), sheared.or(zero, zero.less(stiffness))]
    }
}

/// Access to the constants without adhesion.
struct OfElastic<'a, S>(&'a S);

impl<L, S: Spread<Constants<f64>, L>> Spread<Elastic<f64>, L> for OfElastic<'_, S> {
    #[inline(always)]
    fn of(&self, get: impl Fn(&Elastic<f64>) -> f64) -> L {
        self.0.of(|constants| get(&constants.elastic))
    }
}

impl Jkr {
    fn new(settings: Settings, library: &Library) -> Self {
        let reach = settings.reach(library.largest_radius());
        let Settings { elastic, adhesion } = settings;
        let hertz = Hertz::new(elastic, library);
        let columns = [
            (hertz.frictional, TANGENTIAL_FORCE),
            (hertz.damped, NORMAL_FORCE),
            (true, CONTACT_RADIUS),
        ];
        let state = columns.into_iter().filter(|(is_in, _)| *is_in).map(|(_, c)| c).collect();
        Self { hertz, adhesion, reach, state }
    }

    /// Constants of adhesion of two bodies.
    fn sticking(&self, a: &Body, b: &Body) -> Sticking<f64> {
        let modulus = self.hertz.settings.interactions.of(a.material, b.material).modulus;
        let energy = self.adhesion.of(a.material, b.material).surface_energy;
        Sticking::of(modulus, 1.0 / (1.0 / a.radius + 1.0 / b.radius), energy)
    }
}

impl Jkr {
    /// Contact radius of a body on a plane of a material [m], at an overlap given over the body's radius.
    fn radius_on_plane(&self, body: &Body, plane: MaterialId, overlap: f64) -> f64 {
        let elastic = self.hertz.settings.interactions.of(body.material, plane);
        let energy = self.adhesion.of(body.material, plane).surface_energy;
        Sticking::of(elastic.modulus, body.radius, energy).contact_radius(overlap * body.radius)
    }
}

impl About for Jkr {
    fn within(&self) -> Option<&dyn About> {
        Some(&self.hertz)
    }

    fn name(&self) -> &'static str {
        if self.hertz.frictional { "jkr-mindlin" } else { "jkr" }
    }

    /// The contact with a plane, at the largest overlap.
    fn hardest(&self, body: &Body, other: MaterialId, reduced_mass: f64) -> Hardest {
        let elastic = self.hertz.settings.interactions.of(body.material, other);
        let radius = self.radius_on_plane(body, other, self.hertz.settings.largest_overlap);
        self.hertz.settings.dashpots.in_packings(super::hardest(&elastic, radius, reduced_mass))
    }

    /// Stiffness grows with the contact radius, which is positive even without overlap.
    fn stiffens(&self, overlap: f64, library: &Library) -> f64 {
        let materials: BTreeSet<MaterialId> = library.materials.iter().copied().collect();
        let growth = library.extremes().flat_map(|(shape, scale)| {
            let body = Body::of(library, shape, scale);
            let radius = move |plane, overlap| self.radius_on_plane(&body, plane, overlap);
            let meant = self.hertz.settings.largest_overlap;
            materials.iter().map(move |&plane| radius(plane, overlap) / radius(plane, meant))
        });
        growth.fold(1.0, f64::max)
    }

    fn reach(&self, library: &Library) -> f64 {
        reach(&self.hertz.settings.interactions, &self.adhesion, library.largest_radius())
    }

    fn words(&self, a: MaterialId, b: MaterialId) -> String {
        let dmt::Constants { surface_energy } = self.adhesion.of(a, b);
        let elastic = self.hertz.words(a, b);
        format!("{elastic}, surface energy {surface_energy} J/m2 (adhesion of JKR)")
    }

    fn limits(&self) -> Vec<String> {
        vec![format!("contacts act beyond the overlap, up to a gap of {:.3e} m", self.reach)]
    }
}

impl Model for Jkr {
    type Constants<L: Lanes> = Constants<L>;

    const FORESEES: bool = true;
    const FACES: bool = false;
    const TEARS: bool = true;

    /// Velocities are needed because energy is lost whenever contacts begin or end.
    fn needs(&self) -> Needs {
        Needs { velocity: true, adhesion: true, ..self.hertz.needs() }
    }

    fn state(&self) -> &[StateColumn] {
        &self.state
    }

    fn constants(&self, a: &Body, b: &Body) -> Constants<f64> {
        let elastic = self.hertz.settings.interactions.of(a.material, b.material);
        Constants {
            elastic: Elastic::of(&elastic, 1.0, reduced_mass(a, b)),
            sticking: self.sticking(a, b),
        }
    }

    #[inline(always)]
    fn spread<L: Lanes>(of: &impl Spread<Constants<f64>, L>) -> Constants<L> {
        Constants {
            elastic: Hertz::<true>::spread(&OfElastic(of)),
            sticking: Sticking {
                radius: of.of(|c| c.sticking.radius),
                pull: of.of(|c| c.sticking.pull),
                work: of.of(|c| c.sticking.work),
                size: of.of(|c| c.sticking.size),
                depth: of.of(|c| c.sticking.depth),
            },
        }
    }

    #[inline(always)]
    fn dissipates<L: Lanes>(&self, constants: &Constants<L>) -> [u8; 2] {
        let [dashed, rubbed] = self.hertz.dissipates(&constants.elastic);
        [dashed | L::all(0.0).less(constants.sticking.size), rubbed]
    }

    #[inline(always)]
    fn last<L: Lanes>(&self, constants: &Constants<L>, _overlap: L, state: &[L]) -> Action<L> {
        let radius = state[state.len() - 1];
        let tangential = self.hertz.tangential(state);
        let press = if self.hertz.damped {
            state[state.len() - 2]
        } else {
            constants.sticking.press(constants.elastic.normal, radius)
        };
        Action {
            press,
            rub: tangential,
            viscous: Triple::zero(),
            kept: Kept::all(),
            moment: Triple::zero(),
            stored: constants.stored(radius, tangential),
        }
    }

    /// A contact that begins at an overlap of 0 has a negative energy, one that ends a positive energy.
    #[inline(always)]
    fn torn<L: Lanes>(&self, constants: &Constants<L>) -> [L; 2] {
        let Constants { elastic, sticking } = constants;
        let zero = L::all(0.0);
        let sticks = zero.less(sticking.size);
        // q = 0 has a = a_0, and q = END has a = 4^(-2/3) a_0.
        let begins = sticking.stored(elastic.normal, sticking.size);
        let ends = sticking.stored(elastic.normal, L::all(LAST_RADIUS) * sticking.size);
        [(zero - begins).or(zero, sticks), ends.or(zero, sticks)]
    }

    #[inline(always)]
    fn act<L: Lanes>(
        &self,
        constants: &Constants<L>,
        contact: &Contact<L>,
        state: &mut [L],
    ) -> Action<L> {
        let zero = Triple::zero();
        let Constants { elastic, sticking } = constants;
        let width = state.len();
        let radius = sticking.contact_radius(contact.overlap);
        let mut press = sticking.press(elastic.normal, radius);
        if self.hertz.damped {
            let dashpot = elastic.dashpots[0] * radius.sqrt();
            let last = self.hertz.settings.dashpots.last::<true, _>(state[width - 2]);
            press = contact.damped(press, (dashpot, 0.0), elastic.inverse_mass, last);
        }
        let (mut spring, mut rub, mut kept) = (zero, zero, Kept::all());
        let frictional = elastic.frictional();
        if frictional != 0 {
            let force = self.hertz.tangential(state);
            let carried = carried(force, contact);
            let limiting = press + L::all(3.0) * sticking.work * sticking.radius;
            // A new contact has the radius `a_0`.
            let last = state[width - 1].or(sticking.size, contact.touched);
            let before = Before { carried, force, radius: Some(last) };
            let (force, stretched, left) =
                self.hertz.rub(elastic, contact, (radius, limiting), before);
            let now = if contact.dt > 0.0 { stretched } else { carried };
            spring = now.or(zero, frictional);
            rub = force.or(zero, frictional);
            kept = left;
        }
        if self.hertz.frictional {
            [state[0], state[1], state[2]] = [spring.x, spring.y, spring.z];
        }
        if self.hertz.damped {
            state[width - 2] = press;
        }
        state[width - 1] = radius;
        Action {
            press,
            rub,
            viscous: rub.minus(spring),
            kept,
            moment: zero,
            stored: constants.stored(radius, spring),
        }
    }

    #[inline(always)]
    fn elastic<L: Lanes>(&self, constants: &Constants<L>, overlap: L) -> L {
        let Constants { elastic, sticking } = constants;
        sticking.press(elastic.normal, sticking.contact_radius(overlap))
    }

    /// `dN/dδ` is at most `2 E* a`, the value of Hertz's law at this radius.
    fn stiffness(&self, constants: &Constants<f64>, overlap: f64, dt: f64) -> f64 {
        let Constants { elastic, sticking } = constants;
        let radius = sticking.contact_radius(overlap);
        1.5 * elastic.normal * radius + elastic.dashpots[0] * radius.sqrt() / dt
    }

    #[inline(always)]
    fn outlives<L: Lanes>(&self, constants: &Constants<L>) -> L {
        constants.sticking.gap()
    }
}
