//! Elastic bodies: Hertz along the normal (1882, DOI 10.1515/crll.1882.92.156), Mindlin in the contact plane (1949, DOI
//! 10.1115/1.4009973).
//!
//! Normal: `N = 4/3 E* √R* δ^(3/2) + γ_n δ̇`, by default never attractive, with `γ_n = 2 √(5/6) β √(S m*)` and
//! `S = 2 E* √(R* δ)`. In `y = δ^(5/4)` and the time `∫ δ^(1/4) dt` this is the linear oscillator of damping ratio `β`
//! (Antypov and Elliott 2011, DOI 10.1209/0295-5075/94/50004). Both forces are zero at the same place. So
//! [`super::linear::damping_ratio_of_restitution`] holds unchanged, with the attraction cut off or not.
//!
//! Tangential: the state is the elastic force `T`, which grows by `k_t du` with `k_t = 8 G* √(R* δ)`. Where the contact
//! unloads it shrinks with `k_t`, so that no energy is created (Thornton, Cummins, Cleary 2013, DOI
//! 10.1016/j.powtec.2012.08.012). Beyond Coulomb's limit the force is cut to `μ N`, and `T` to the limit less the dashpot
//! `2 √(5/6) β √(k_t m*)` (Luding 2008, DOI 10.1007/s10035-008-0099-x, section 2.4). Its energy is `T² / (2 k_t)`.
//!
//! # Bodies other than spheres
//!
//! `√R*` of spheres follows from their radii; walls count as planes, their edges and corners too. If a particle is not a
//! sphere, `√R*` is that of the contact in the present pose, from the curvature of both surfaces:
//! `N = 4/3 E* √Re (δ/F2)^(3/2)`. This is exact for elliptical contacts, see [`crate::contact::curvature`]. The rest is
//! unchanged, with `√R = √Re F2^(-3/2)` in place of `√R*`: the dashpots keep their restitution, and the contact radius
//! `a = √(R δ)` is that of `dN/dδ = 2 E* a`.
//!
//! The tangential stiffness is `8 G* a` with this `a` in all directions. Without slip, the compliance of each side under a
//! force along the longer axis of an ellipse is `((1 - ν) K + ν (K - E)/e²) / (2π a' G)`, along the shorter one
//! `(K - ν (K - E)/e²) / (2π a' G)`. `K` and `E` are the complete elliptic integrals of the ellipse's eccentricity `e`, and
//! `a'` is its longer semi-axis (Mindlin 1949). Their mean is that of a circle of radius `π a' / (2 K)`, which is `a`, for
//! any `ν`: the choice is the exact mean over the directions. The axes differ from it by
//! `ν (2 (K - E)/e² - K) / ((2 - ν) K)`: with `ν = 0.3` by 3.9 % at `R'/R''` = 4 and by 6 % at 10. Mindlin's own tangent
//! stiffness, `(1 - T/μN)^(1/3)` of the first, falls by 21 % on the way to half of Coulomb's limit. `8 G* √(a' b')`, which
//! is used elsewhere, is 5 % softer at 4 than this mean and 13 % at 10.
//!
//! The state has `a` beside the force, for the energies and the shrinking of `T`.
//!
//! # Bodies with faces and straight sides
//!
//! They have no usable curvature: along a side it is 0, at a corner infinite. In a scene with such bodies all but spheres
//! count as spheres of their volume, wherever they touch. The overlap is the thickness of the region that two bodies share,
//! whose energy has no jumps ([`crate::contact::thickness`]). This is a choice of stiffness, as with springs, and no
//! solution of elasticity.

#![expect(clippy::inline_always, reason = "see `lanes`")]

mod constants;
pub mod jkr;

pub use constants::Constants;

use super::kernel::{
    Action, Contact, InPlane, Kept, Model, Spread, Turning, carried, reduced_mass, within_limit,
};
use super::{About, Body, Dashpots, Hardest};
use crate::contact::{StateColumn, curvature};
use crate::ids::MaterialId;
use crate::lanes::{Lanes, Triple};
use crate::particles::Needs;
use crate::population::Library;
use crate::shape::{Kind, Shape};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Constants of every pair of materials.
pub type Interactions = super::Interactions<Constants>;

/// Overlap over the radius [-] that a stress [Pa] causes at most in all but few contacts, `(26 p / E*)^(2/3)`.
///
/// With six contacts per particle and a solid fraction of 0.6, equal spheres carry `p` with a mean force of `3.5 p R²`
/// (Rumpf 1958). Forces above seven times the mean are rare, because large forces fall off exponentially. Hertz's law gives
/// the overlap at that force.
#[must_use]
pub fn overlap_under(stress: f64, constants: &Constants) -> f64 {
    let mean_force = 4.0 * PI / (6.0 * 0.6);
    // For two spheres of radius 1.
    let stiffness = 4.0 / 3.0 * constants.modulus * 0.5_f64.sqrt();
    libm::pow(7.0 * mean_force * stress / stiffness, 2.0 / 3.0)
}

/// Settings of this law in a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Constants of every pair of materials.
    pub interactions: Interactions,
    /// Options of dashpots.
    pub dashpots: Dashpots,
    /// Largest overlap that the time step allows for [-], over the radius of the smaller body, or of the largest sphere in
    /// it about its centre.
    pub largest_overlap: f64,
}

impl Settings {
    /// Hertzian contacts between bodies of a library.
    pub(super) fn model<const FORESEES: bool>(&self, library: &Library) -> Hertz<FORESEES> {
        Hertz::new(self.clone(), library)
    }
}

/// Elastic bodies with dashpots and friction. Dashpots use predicted velocities only with `FORESEES`.
#[derive(Clone, Debug)]
pub(super) struct Hertz<const FORESEES: bool> {
    settings: Settings,
    /// Is there any dashpot?
    damped: bool,
    /// Does any contact feel tangential motion?
    frictional: bool,
    /// Does it depend on the curvature of bodies? Not for spheres, and not in a scene of bodies with faces or straight
    /// sides.
    curved: bool,
    /// Radius of each shape where curvature is not used [m]; infinite for walls.
    radii: Vec<f64>,
    /// Ranges in which it departs from its formulas.
    limits: Vec<String>,
    /// Radius of the flattest contact of each shape with a plane [m], at an overlap equal to the radius of the largest
    /// sphere in it about its centre.
    widest: Vec<f64>,
    state: Vec<StateColumn>,
}

/// Elastic tangential force of A on B, if there is friction.
const TANGENTIAL_FORCE: StateColumn = StateColumn::new("tangential_force", 3, "N");
/// Normal force of the last touch, if there are dashpots. Without them it follows from the overlap.
const NORMAL_FORCE: StateColumn = StateColumn::new("normal_force", 1, "N");

/// Radius `a` of the last touch, with `dN/dδ = 2 E* a`, if the law depends on curvature.
const CONTACT_RADIUS: StateColumn = StateColumn::new("contact_radius", 1, "m");

/// Power of the overlap with which dashpots grow.
const RISE: f64 = 0.25;

/// `2 √(5/6)`.
fn dashpot_factor() -> f64 {
    2.0 * (5.0_f64 / 6.0).sqrt()
}

/// Constants of a contact at an overlap of 1 m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elastic<L> {
    /// Normal force, `4/3 E* √R*` [N/m^(3/2)].
    normal: L,
    /// Tangential stiffness, `8 G* √R*` [N/m^(3/2)].
    tangential: L,
    /// Coefficient of friction [-].
    friction: L,
    /// Normal and tangential dashpots [N s/m^(5/4)].
    dashpots: [L; 2],
    /// `√R` of contacts by curvature; 1 until it is known [√m].
    root_of_radius: L,
    /// Inverse reduced mass [1/kg].
    inverse_mass: L,
}

impl Elastic<f64> {
    /// Constants at a root of the radius [√m], for a reduced mass [kg].
    fn of(constants: &Constants, root_of_radius: f64, mass: f64) -> Self {
        let normal = 4.0 / 3.0 * constants.modulus * root_of_radius;
        let tangential = 8.0 * constants.shear_modulus * root_of_radius;
        let dashpot =
            |stiffness: f64| dashpot_factor() * constants.damping_ratio * (mass * stiffness).sqrt();
        Self {
            normal,
            tangential,
            friction: constants.friction,
            dashpots: [dashpot(1.5 * normal), dashpot(tangential)],
            root_of_radius: 1.0,
            inverse_mass: 1.0 / mass,
        }
    }
}

impl<L: Lanes> Elastic<L> {
    /// Contacts that feel tangential motion, as bits of lanes.
    #[inline(always)]
    fn frictional(&self) -> u8 {
        L::all(0.0).less(self.friction)
    }

    /// Elastic energy in the normal and the tangential direction [J]. `root` is the root of the overlap. For constants at a
    /// root of the radius of 1 it is the contact radius, as for contacts by curvature.
    #[inline(always)]
    fn stored(&self, overlap: L, root: L, tangential: Triple<L>) -> [L; 2] {
        let zero = L::all(0.0);
        let stiffness = self.tangential * root;
        let sheared = L::all(0.5) * tangential.dot(tangential) / stiffness;
        [
            L::all(0.4) * self.normal * root * overlap * overlap,
            sheared.or(zero, zero.less(stiffness)),
        ]
    }
}

impl<const FORESEES: bool> Hertz<FORESEES> {
    fn new(settings: Settings, library: &Library) -> Self {
        let damped = settings.interactions.iter().any(|c| c.damping_ratio > 0.0);
        let frictional = settings.interactions.iter().any(|c| c.friction > 0.0);
        let is_sphere = |shape: &Shape| shape.kind() == Kind::Sphere;
        let shapes = &library.shapes[library.grains()];
        let is_smooth = shapes.iter().all(|shape| shape.kind().is_smooth());
        let curved = is_smooth && !shapes.iter().all(is_sphere);
        let bounded = shapes.iter().any(|shape| !shape.kind().is_ellipsoidal());
        let radii: Vec<f64> = library.shapes.iter().zip(&library.radius).map(radius).collect();
        let limit = if is_smooth {
            format!(
                "radii of curvature of superellipsoids are means over {} rad, and at least {} bounding radii",
                curvature::WIDTH_OF_CONTACT,
                curvature::SHARPEST
            )
        } else {
            let one = |((name, shape), radius): ((&String, &Shape), &f64)| {
                (!is_sphere(shape)).then(|| format!("`{name}` of {radius:.3e} m"))
            };
            let all: Vec<_> =
                library.names.iter().zip(shapes).zip(&radii).filter_map(one).collect();
            format!(
                "faces, sides and corners have no radius of curvature: all contacts are as stiff as those of spheres \
                 of the same volume, {}",
                all.join(", ")
            )
        };
        let limits = bounded.then_some(limit).into_iter().collect();
        let columns =
            [(frictional, TANGENTIAL_FORCE), (damped, NORMAL_FORCE), (curved, CONTACT_RADIUS)];
        let state = columns.into_iter().filter(|(is_in, _)| *is_in).map(|(_, c)| c).collect();
        let widest = library.shapes.iter().zip(&radii);
        let widest = widest.map(|(shape, radius)| widest_of(shape, *radius)).collect();
        Self { settings, damped, frictional, curved, radii, limits, widest, state }
    }

    /// Remembered normal force [N].
    #[inline(always)]
    fn pressed<L: Lanes>(&self, state: &[L]) -> L {
        state[state.len() - if self.curved { 2 } else { 1 }]
    }

    /// Remembered elastic tangential force [N].
    #[inline(always)]
    fn tangential<L: Lanes>(&self, state: &[L]) -> Triple<L> {
        if self.frictional {
            Triple { x: state[0], y: state[1], z: state[2] }
        } else {
            Triple::zero()
        }
    }

    /// Normal force [N]; `root` is the root of the overlap, `state` that of the last step.
    #[inline(always)]
    fn press<L: Lanes>(
        &self,
        elastic: &Elastic<L>,
        contact: &Contact<L>,
        root: L,
        state: &[L],
    ) -> L {
        let mut force = elastic.normal * root * contact.overlap * contact.gain;
        if self.damped {
            let dashpot = elastic.dashpots[0] * root.sqrt();
            let last = self.settings.dashpots.last::<FORESEES, _>(self.pressed(state));
            force = contact.damped(force, (dashpot, RISE), elastic.inverse_mass, last);
            if self.settings.dashpots.limited {
                let zero = L::all(0.0);
                force = zero.or(force, force.less(zero));
            }
        }
        force
    }

    /// Tangential force of A on B [N], its elastic part [N], and the parts that Coulomb's limit leaves.
    #[inline(always)]
    fn rub<L: Lanes>(
        &self,
        elastic: &Elastic<L>,
        contact: &Contact<L>,
        (root, press): (L, L),
        Before { carried, force: last_force, radius: last_radius }: Before<L>,
    ) -> (Triple<L>, Triple<L>, Kept<L>) {
        let (zero, one) = (L::all(0.0), L::all(1.0));
        let stiffness = elastic.tangential * root;
        // Where the contact shrinks the stretch stays, where it grows the force stays. New stretch counts with the mean
        // radius over the step.
        let radius = elastic.root_of_radius * root;
        let last = match last_radius {
            Some(radius) => radius,
            None => self::root(contact.last_overlap) * elastic.root_of_radius,
        };
        let (grows, shrinks) = (last.less(radius), radius.less(last));
        let ratio = last.or(radius, grows) / radius.or(last, grows);
        let shrunk = ratio.or(one, shrinks);
        let mean = mean_while_growing(one - ratio).or(one, grows);
        let stretch = contact.sliding.times(contact.lasted * stiffness * mean);
        let spring = carried.times(shrunk).plus(stretch);
        let (mut force, mut dashpot) = (spring, None);
        if self.damped {
            let of_plane = elastic.dashpots[1] * root.sqrt();
            let last = self.settings.dashpots.last_in_plane::<FORESEES, _>(last_force, contact);
            let in_plane = InPlane::of(contact, (of_plane, RISE), elastic.inverse_mass, last);
            force = in_plane.beside(spring);
            dashpot = Some(in_plane);
        }
        let limit = elastic.friction * press.or(zero, zero.less(press));
        let kept = within_limit(force, limit, contact);
        let slides = kept.force.less(one);
        let last = carried.times(shrunk);
        let limited =
            self.settings.dashpots.sliding::<FORESEES, _>((force, limit), last, &kept, contact);
        let mut elastic = limited;
        if let Some(dashpot) = dashpot {
            elastic = limited.minus(dashpot.part_of(limited));
        }
        let spring = elastic.or(spring, slides).times(kept.remains);
        (limited.or(force, slides).times(kept.remains), spring, kept)
    }
}

/// Tangential state of a contact at the last step.
#[derive(Clone, Copy)]
struct Before<L> {
    /// Elastic force, carried into the present contact plane [N].
    carried: Triple<L>,
    /// Elastic force in the last contact plane [N].
    force: Triple<L>,
    /// Contact radius [m]; `None` if it follows from the overlap.
    radius: Option<L>,
}

/// Radius of a shape with its bounding radius [m], see [`Hertz::radii`].
fn radius((shape, bounding): (&Shape, &f64)) -> f64 {
    if shape.kind() == Kind::Sphere || shape.kind().is_of_walls() {
        return *bounding;
    }
    libm::cbrt(3.0 * shape.volume() / (4.0 * PI))
}

/// Value of [`Hertz::widest`] for a shape that may count as a sphere of this radius [m]; 0 for walls.
fn widest_of(shape: &Shape, radius: f64) -> f64 {
    let root_of_radius = match shape {
        Shape::Sphere(sphere) => return sphere.radius,
        Shape::HalfSpace(_) | Shape::TriangleMesh(_) => return 0.0,
        _ if shape.kind().is_smooth() => curvature::flattest(shape),
        _ => radius.sqrt(),
    };
    root_of_radius * shape.inscribed_radius().sqrt()
}

/// Mean of `√δ` over its last value, while `δ` grows evenly and `√δ` by the given part of its last value. Exact from 0 on,
/// and to third order in that part.
#[inline(always)]
pub(crate) fn mean_while_growing<L: Lanes>(part: L) -> L {
    let one = L::all(1.0);
    one - part * (L::all(0.5) - part * (one + part) * L::all(1.0 / 12.0))
}

/// Square root; 0 for negative numbers.
#[inline(always)]
fn root<L: Lanes>(overlap: L) -> L {
    let zero = L::all(0.0);
    overlap.or(zero, zero.less(overlap)).sqrt()
}

/// Hardest contact with these constants and a contact radius [m].
fn hardest(constants: &Constants, size: f64, reduced_mass: f64) -> Hardest {
    let normal = 2.0 * constants.modulus * size;
    let tangential =
        if constants.friction > 0.0 { 8.0 * constants.shear_modulus * size } else { 0.0 };
    let ratio = dashpot_factor() * constants.damping_ratio;
    let dashpots = [normal, tangential].map(|stiffness| ratio * (stiffness * reduced_mass).sqrt());
    Hardest { stiffness: normal.max(tangential), dashpots, turning: [0.0; 2] }
}

impl<const FORESEES: bool> About for Hertz<FORESEES> {
    fn name(&self) -> &'static str {
        if self.frictional { "hertz-mindlin" } else { "hertz" }
    }

    /// The contact with a plane where the body is flattest, at the largest overlap.
    fn hardest(&self, body: &Body, other: MaterialId, reduced_mass: f64) -> Hardest {
        let constants = self.settings.interactions.of(body.material, other);
        let widest = self.widest[body.shape.index()] * body.scale;
        let size = widest * self.settings.largest_overlap.sqrt();
        self.settings.dashpots.in_packings(hardest(&constants, size, reduced_mass))
    }

    fn words(&self, a: MaterialId, b: MaterialId) -> String {
        let constants = self.settings.interactions.of(a, b);
        format!(
            "E* {:.4e} Pa, G* {:.4e} Pa, friction {}, damping ratio {:.4}, step for overlaps up to {:.3} of {}{}",
            constants.modulus,
            constants.shear_modulus,
            constants.friction,
            constants.damping_ratio,
            self.settings.largest_overlap,
            if self.curved || !self.limits.is_empty() {
                "half the shortest axis"
            } else {
                "a radius"
            },
            if self.curved {
                "; contacts are ellipses, by the curvature of both bodies"
            } else {
                ""
            },
        )
    }

    fn hardest_up_to(&self) -> Option<f64> {
        Some(self.settings.largest_overlap)
    }

    fn limits(&self) -> Vec<String> {
        self.limits.clone()
    }

    fn left_out(&self) -> Vec<&'static str> {
        let reasons = [
            (!self.frictional, "no tangential history: friction is 0 everywhere"),
            (!self.damped, "no dashpots: restitution is 1 everywhere"),
        ];
        reasons.into_iter().filter(|(is_out, _)| *is_out).map(|(_, reason)| reason).collect()
    }
}

impl<const FORESEES: bool> Model for Hertz<FORESEES> {
    type Constants<L: Lanes> = Elastic<L>;

    const BY_CURVATURE: bool = true;
    const FORESEES: bool = FORESEES;

    fn needs(&self) -> Needs {
        let velocity = self.frictional || self.damped || self.settings.dashpots.foreseen;
        Needs {
            velocity,
            spin: self.frictional,
            ahead: self.damped && self.settings.dashpots.foreseen,
            friction: self.frictional,
            tangential_dashpots: self
                .settings
                .interactions
                .iter()
                .any(|c| c.friction > 0.0 && c.damping_ratio > 0.0),
            curvature: self.curved,
            ..Needs::default()
        }
    }

    fn state(&self) -> &[StateColumn] {
        &self.state
    }

    fn constants(&self, a: &Body, b: &Body) -> Elastic<f64> {
        let constants = self.settings.interactions.of(a.material, b.material);
        let radius = |body: &Body| self.radii[body.shape.index()] * body.scale;
        let root_of_radius =
            if self.curved { 1.0 } else { (1.0 / (1.0 / radius(a) + 1.0 / radius(b))).sqrt() };
        Elastic::of(&constants, root_of_radius, reduced_mass(a, b))
    }

    #[inline(always)]
    fn spread<L: Lanes>(of: &impl Spread<Elastic<f64>, L>) -> Elastic<L> {
        Elastic {
            normal: of.of(|c| c.normal),
            tangential: of.of(|c| c.tangential),
            friction: of.of(|c| c.friction),
            dashpots: [of.of(|c| c.dashpots[0]), of.of(|c| c.dashpots[1])],
            root_of_radius: L::all(1.0),
            inverse_mass: of.of(|c| c.inverse_mass),
        }
    }

    #[inline(always)]
    fn curved<L: Lanes>(&self, elastic: &Elastic<L>, root_of_radius: L) -> Elastic<L> {
        let of_dashpot = root_of_radius.sqrt();
        Elastic {
            normal: elastic.normal * root_of_radius,
            tangential: elastic.tangential * root_of_radius,
            friction: elastic.friction,
            dashpots: [elastic.dashpots[0] * of_dashpot, elastic.dashpots[1] * of_dashpot],
            root_of_radius,
            inverse_mass: elastic.inverse_mass,
        }
    }

    #[inline(always)]
    fn dissipates<L: Lanes>(&self, elastic: &Elastic<L>) -> [u8; 2] {
        [L::all(0.0).less(elastic.dashpots[0]), elastic.frictional()]
    }

    #[inline(always)]
    fn last<L: Lanes>(&self, elastic: &Elastic<L>, overlap: L, state: &[L]) -> Action<L> {
        let tangential = self.tangential(state);
        let root = if self.curved { state[state.len() - 1] } else { root(overlap) };
        let press = if self.damped { self.pressed(state) } else { elastic.normal * root * overlap };
        Action {
            press,
            rub: tangential,
            viscous: Triple::zero(),
            kept: Kept::all(),
            moment: Triple::zero(),
            stored: elastic.stored(overlap, root, tangential),
        }
    }

    #[inline(always)]
    fn act<L: Lanes>(
        &self,
        elastic: &Elastic<L>,
        contact: &Contact<L>,
        state: &mut [L],
    ) -> Action<L> {
        let zero = Triple::zero();
        let root = root(contact.overlap);
        let press = self.press(elastic, contact, root, state);
        let (mut spring, mut rub, mut kept) = (zero, zero, Kept::all());
        let frictional = elastic.frictional();
        if frictional != 0 {
            let last = self.tangential(state);
            let carried = carried(last, contact);
            let radius = if self.curved { Some(state[state.len() - 1]) } else { None };
            let before = Before { carried, force: last, radius };
            let (force, stretched, left) = self.rub(elastic, contact, (root, press), before);
            // No time has passed at the start of a stage, so the elastic force stays unchanged.
            let now = if contact.dt > 0.0 { stretched } else { carried };
            spring = now.or(zero, frictional);
            rub = force.or(zero, frictional);
            kept = left;
        }
        if self.frictional {
            [state[0], state[1], state[2]] = [spring.x, spring.y, spring.z];
        }
        let width = state.len();
        if self.damped {
            state[width - if self.curved { 2 } else { 1 }] = press;
        }
        if self.curved {
            state[width - 1] = elastic.root_of_radius * root;
        }
        Action {
            press,
            rub,
            viscous: rub.minus(spring),
            kept,
            moment: zero,
            stored: elastic.stored(contact.overlap, root, spring),
        }
    }

    #[inline(always)]
    fn elastic<L: Lanes>(&self, elastic: &Elastic<L>, overlap: L) -> L {
        elastic.normal * root(overlap) * overlap
    }

    fn turning(&self, elastic: &Elastic<f64>, overlap: f64) -> Turning {
        let root = root(overlap);
        let [normal_dashpot, tangential_dashpot] = elastic.dashpots.map(|c| c * root.sqrt());
        let frictional = |value: f64| if elastic.friction > 0.0 { value } else { 0.0 };
        Turning {
            normal_dashpot,
            tangential_stiffness: frictional(elastic.tangential * root),
            tangential_dashpot: frictional(tangential_dashpot),
            friction: elastic.friction,
        }
    }

    fn stiffness(&self, elastic: &Elastic<f64>, overlap: f64, dt: f64) -> f64 {
        let root = root(overlap);
        1.5 * elastic.normal * root + elastic.dashpots[0] * root.sqrt() / dt
    }
}
