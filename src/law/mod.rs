//! Force laws: from the geometry of a contact to the forces and moments of its bodies.

pub mod linear;
pub mod stability;

use crate::contact::{History, Pair, Touch};
use crate::ids::MaterialId;
use crate::math::Vec3;
use crate::particles::{Needs, Particles};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// What a body is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Name in the scene.
    pub name: String,
    /// Density [kg/m³].
    pub density: f64,
    /// How two bodies of this material act on each other.
    pub contact: Constants,
}

/// The constants of a contact between two materials; by default nothing acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Constants {
    /// Normal stiffness of a contact [N/m].
    pub normal_stiffness: f64,
    /// Tangential stiffness of a contact [N/m].
    pub tangential_stiffness: f64,
    /// Coefficient of friction [-].
    pub friction: f64,
    /// Damping ratio of the normal dashpot, as a fraction of critical damping of the pair [-].
    pub normal_damping_ratio: f64,
    /// Damping ratio of the tangential dashpot [-].
    pub tangential_damping_ratio: f64,
}

impl Constants {
    /// Of a contact between two materials about which the scene says nothing more: stiffnesses as of
    /// two half springs in series (the harmonic mean), the lower friction, the mean damping ratios.
    pub fn mixed(a: &Self, b: &Self) -> Self {
        let series = |x: f64, y: f64| if x + y > 0.0 { 2.0 * x * y / (x + y) } else { 0.0 };
        Self {
            normal_stiffness: series(a.normal_stiffness, b.normal_stiffness),
            tangential_stiffness: series(a.tangential_stiffness, b.tangential_stiffness),
            friction: if a.friction < b.friction { a.friction } else { b.friction },
            normal_damping_ratio: 0.5 * (a.normal_damping_ratio + b.normal_damping_ratio),
            tangential_damping_ratio: 0.5
                * (a.tangential_damping_ratio + b.tangential_damping_ratio),
        }
    }

    /// Does a contact feel tangential motion?
    pub fn is_frictional(&self) -> bool {
        self.friction > 0.0 && self.tangential_stiffness > 0.0
    }
}

/// The damping ratio `ζ` of a linear dashpot that gives a head-on collision this coefficient of
/// restitution, in (0, 1].
///
/// If the dashpot may attract until the overlap is zero, `e = exp(-π ζ / √(1 - ζ²))`. If `limited`, the
/// contact ends when the force does, and with `ζ = sin θ` it is `e = exp(-(π - 2θ) tan θ)`, beyond critical
/// damping with `ζ = cosh u` `e = exp(-2u coth u)` (Schwager and Pöschel 2007,
/// DOI 10.1007/s10035-007-0065-z).
pub fn damping_ratio_of_restitution(restitution: f64, limited: bool) -> f64 {
    let wanted = -libm::log(restitution);
    if !limited {
        return wanted / (PI * PI + wanted * wanted).sqrt();
    }
    if wanted == 0.0 {
        return 0.0;
    }
    // At critical damping the exponent is 2.
    if wanted < 2.0 {
        libm::sin(bisect(0.0, 0.5 * PI, |θ| (PI - 2.0 * θ) * libm::tan(θ) < wanted))
    } else {
        // u coth u lies between u and u + 1.
        libm::cosh(bisect(0.0, 0.5 * wanted, |u| u == 0.0 || 2.0 * u / libm::tanh(u) < wanted))
    }
}

/// The place between `low` and `high` up to which `below` holds.
fn bisect(mut low: f64, mut high: f64, below: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// The constants of every pair of materials.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Interactions {
    materials: usize,
    constants: Vec<Constants>,
}

impl Interactions {
    /// Mixed from the materials.
    pub fn new(materials: &[Material]) -> Self {
        let constants = materials
            .iter()
            .flat_map(|a| materials.iter().map(|b| Constants::mixed(&a.contact, &b.contact)))
            .collect();
        Self { materials: materials.len(), constants }
    }

    /// Of these two materials, in either order.
    #[inline]
    pub fn of(&self, a: MaterialId, b: MaterialId) -> &Constants {
        &self.constants[a.index() * self.materials + b.index()]
    }

    /// Replaces those of two materials.
    pub fn set(&mut self, a: MaterialId, b: MaterialId, constants: Constants) {
        self.constants[a.index() * self.materials + b.index()] = constants;
        self.constants[b.index() * self.materials + a.index()] = constants;
    }

    /// Those of a material with each material.
    pub fn of_material(&self, material: MaterialId) -> &[Constants] {
        &self.constants[material.index() * self.materials..][..self.materials]
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = &Constants> {
        self.constants.iter()
    }
}

/// What a contact does to its two bodies in this step. Until a law has found it, the touch stands in its place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Force of A on B [N]; A feels the opposite. First the normal.
    pub force: Vec3,
    /// Energy lost since the last step [J]. First the overlap [m].
    pub dissipated: f64,
}

impl Load {
    /// The place for the load of this touch.
    pub fn of(touch: &Touch) -> Self {
        let mut load = Self::default();
        load.stand_for(touch);
        load
    }

    /// The same, in place. Number by number: a whole one would go through memory twice.
    #[inline]
    pub fn stand_for(&mut self, touch: &Touch) {
        for axis in 0..3 {
            self.force[axis] = touch.normal[axis];
        }
        self.dissipated = touch.overlap;
    }

    /// Normal and overlap [m] of the touch, as long as that stands here.
    pub const fn touch(&self) -> (&Vec3, f64) {
        (&self.force, self.dissipated)
    }
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

/// What a moving wall did to a particle since the last step.
#[derive(Clone, Copy, Debug)]
pub struct WallWork {
    /// The particle and the wall.
    pub pair: Pair,
    /// Work on the particle [J].
    pub energy: f64,
}

/// The pairs that touch or have just come apart, and what laws remember of them.
#[derive(Debug)]
pub struct Memory<'a> {
    /// All pairs that may touch.
    pub listed: &'a [Pair],
    /// Which of those.
    pub pairs: &'a [u32],
    /// The last touch of each.
    pub history: &'a mut [History],
    /// Tangential spring of each [m]; empty if the law does not need springs.
    pub springs: &'a mut [Vec3],
    /// Normal force of each [N]; empty if the law has no dashpots, and it follows from the overlap.
    pub normal_forces: &'a mut [f64],
    /// Where each acts, seen from the centre of A [m]; empty if all are balls, where it follows from the overlap.
    pub points: &'a [Vec3],
}

impl Memory<'_> {
    /// The bodies of one of them.
    #[inline]
    pub fn pair(&self, place: usize) -> Pair {
        self.listed[self.pairs[place] as usize]
    }

    /// The tangential spring of one of them [m]; zero if the law does not need springs.
    #[inline]
    pub fn spring(&self, place: usize) -> Vec3 {
        self.springs.get(place).copied().unwrap_or_default()
    }
}

/// A law of contact forces.
pub trait ForceLaw: Send + Sync {
    /// As reports name it.
    fn name(&self) -> &'static str;

    /// Which columns it reads.
    fn needs(&self) -> Needs;

    /// Turns each touch into its load, and brings the memory up to date, of which these are the first. `dt` [s] is
    /// 0 at the start of a stage: springs do not stretch, and nothing is lost.
    fn apply(
        &self,
        loads: &mut [Load],
        memory: &mut Memory,
        particles: &Particles,
        dt: f64,
        wall_work: &mut Vec<WallWork>,
    );

    /// Finds the loads of the pairs that have come apart since the last step, the last of the memory: no force, but
    /// what their last contact lost. The memory is that of the last touch.
    fn part(
        &self,
        loads: &mut [Load],
        memory: &Memory,
        particles: &Particles,
        dt: f64,
        wall_work: &mut Vec<WallWork>,
    );

    /// The normal force of a pair that touches without dashpots [N].
    fn elastic(&self, pair: Pair, particles: &Particles, overlap: f64) -> f64;

    /// How much the normal force of a pair that touches rises when its bodies come nearer within one step of
    /// `dt` [s], over the way [N/m].
    fn stiffness(&self, pair: Pair, particles: &Particles, dt: f64) -> f64;

    /// Elastic energy in a contact with this overlap [m] and tangential spring [m], in J.
    fn stored(&self, a: MaterialId, b: MaterialId, overlap: f64, spring: &Vec3) -> f64;
}
