//! Largest stable time step.
//!
//! The leapfrog of [`dem_grains::motion`] is stable up to `Δt = 2 / ω` for the highest frequency `ω` of the assembly. By
//! Gershgorin's circles, `ω² <= 2 k C / m` for a body with `C` contacts of stiffness `k`. A contact far from the centre
//! also turns the body. This makes its surface [`Shape::surface_compliance`](crate::shape::Shape::surface_compliance) times
//! as compliant as its centre, 3.5 for a sphere. No motion moves all contacts of a body like the most compliant one: where
//! spheres turn against all their neighbours the mean is 5/3. This ratio is applied to every shape.
//!
//! A dashpot `c` acts on the velocity of half a step before: with `γ <= 2 c C / m`, found like `ω²`, the step is stable
//! while `ω² Δt² + 2 γ Δt < 4`. With predicted velocities ([`super::kernel`]) tangential dashpots count 1.2 times. The
//! damping ratio of a mode grows with its frequency: tangential dashpots of half the critical damping of a pair reduce the
//! step of a packed bed by four fifths. Normal dashpots have less effect: a motion feels a third of them, and they turn a
//! body only as far as it is not round. Partners are assumed to be as heavy as the heaviest particle; walls are few.
//!
//! Where a side is flat the contact point runs over it when the body turns: with the radius of curvature `ρ` there, a force
//! `F` turns it back with the stiffness `F ρ`. Overlaps are some thousandths of a size. So even for discs of 5:1 this is
//! hundredths of `k` and is neglected. Sides of blunt superellipsoids are flat to rounding in their middle, and no step is
//! short enough there: see [`lost_levers`].
//!
//! The number and stiffness of contacts follow from the bodies that can meet. For each material of other bodies, contacts
//! are counted up to the number of such bodies and up to the number that fits around the body, the stiffest first. Equal
//! spheres fit [`CONTACTS`] times, smaller ones more often by the area of their caps on its surface. Six contacts are with
//! walls, which do not move and so count half. A few contacts alone can move together: each of them counts with its whole
//! compliance.
//!
//! For particles of many sizes the smallest and the largest of each shape are considered, each among the heaviest and the
//! smallest of a material. A contact is no stiffer than that with a plane for the stiffer one of its bodies.
//!
//! More contacts than that at full stiffness would need a shorter step; usually there are fewer, and the bound is safe.
//! Before a run is stopped for its step, [`limit_of_contacts`] checks the actual contacts.

use super::{Body, ForceLaw, Hardest};
use crate::contact::{Geometry, Pair};
use crate::ids::{MaterialId, ShapeId, Slot};
use crate::math::{Mat3, Vec3};
use crate::particles::Particles;
use crate::population::Library;
use crate::shape::Shape;
use std::collections::BTreeMap;

/// Contacts per particle in the estimate: those of the densest packing of spheres.
pub const CONTACTS: f64 = 12.0;

/// Contacts with walls in the estimate, each counted like one with a particle: twelve walls all around.
const OF_WALLS: f64 = 6.0;

/// Compliance of a sphere's surface in the motion that strains all contacts most, over that at a single contact.
const TOGETHER: f64 = (5.0 / 3.0) / 3.5;

/// Part of the normal dashpots that a motion feels.
const ALONG_NORMALS: f64 = 1.0 / 3.0;

/// Bound of the time step, and the body and contact that set it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeStepLimit {
    /// Largest stable step [s].
    pub dt: f64,
    /// Shape with the highest frequency.
    pub shape: ShapeId,
    /// Its mass [kg].
    pub mass: f64,
    /// Stiffness of its contacts that count most [N/m].
    pub stiffness: f64,
    /// Partner in these contacts.
    pub partner: Partner,
    /// Overlap over the radius of the smaller body at which they have this stiffness [-]; `None` if at any.
    pub overlap: Option<f64>,
}

/// Contact partners of one material.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Partner {
    /// Particles.
    Particles(MaterialId),
    /// Walls.
    Walls(MaterialId),
}

impl Partner {
    const fn material(self) -> MaterialId {
        match self {
            Self::Particles(material) | Self::Walls(material) => material,
        }
    }
}

impl TimeStepLimit {
    /// Text about the body and contact that set the limit, without the name of the shape.
    #[must_use]
    pub fn words(&self, library: &Library) -> String {
        let overlap = self.overlap.map_or_else(String::new, |overlap| {
            format!(" at an overlap of {overlap:.3} of the radius, law.largest_overlap")
        });
        let with = match self.partner {
            Partner::Walls(_) => " on walls".to_owned(),
            Partner::Particles(material) if material == library.materials[self.shape.index()] => {
                String::new()
            }
            Partner::Particles(material) => {
                let of_material = library.materials.iter().position(|&own| own == material);
                format!(" on `{}`", library.names[of_material.unwrap_or_default()])
            }
        };
        format!("{:.3e} kg, stiffness {:.3e} N/m{with}{overlap}", self.mass, self.stiffness)
    }
}

/// Bodies of a partner.
#[derive(Clone, Copy, Debug)]
struct PartnerBodies {
    /// Largest number of them.
    most: f64,
    /// Smallest cube root of a volume [m].
    smallest: f64,
    /// Smallest and largest mass [kg].
    masses: [f64; 2],
}

/// Bodies that can be touched in a library; shapes without particles are left out.
fn kin(library: &Library) -> BTreeMap<Partner, PartnerBodies> {
    let mut all = BTreeMap::new();
    for &material in &library.materials[library.facets()] {
        let infinite = f64::INFINITY;
        let walls = PartnerBodies { most: infinite, smallest: infinite, masses: [infinite; 2] };
        all.insert(Partner::Walls(material), walls);
    }
    for body in bodies(library) {
        let none =
            PartnerBodies { most: 0.0, smallest: f64::INFINITY, masses: [f64::INFINITY, 0.0] };
        let kin = all.entry(Partner::Particles(body.material)).or_insert(none);
        let [least, largest] = kin.masses;
        kin.masses = [least.min(body.mass), largest.max(body.mass)];
        kin.smallest = kin.smallest.min(size(library, &body));
    }
    for (material, most) in
        library.materials.iter().zip(&library.most).take(library.particle_shapes)
    {
        if let Some(kin) = all.get_mut(&Partner::Particles(*material)) {
            kin.most += most;
        }
    }
    all
}

/// Cube root of the volume of a body [m].
fn size(library: &Library, body: &Body) -> f64 {
    libm::cbrt(library.shapes[body.shape.index()].volume()) * body.scale
}

/// Reduced mass of two bodies, one of which may be a wall or held [kg].
fn reduced(mass: f64, other: f64) -> f64 {
    if other.is_infinite() {
        mass
    } else if mass.is_infinite() {
        other
    } else {
        mass * other / (mass + other)
    }
}

/// Contacts of the bodies of one material.
struct Contacts<'a> {
    law: &'a dyn ForceLaw,
    kin: &'a BTreeMap<Partner, PartnerBodies>,
    material: MaterialId,
    /// Hardest contacts of particles of other materials with it, in the order of materials.
    back: Vec<(MaterialId, Hardest)>,
}

impl<'a> Contacts<'a> {
    /// Contacts of the bodies of a material, among all moving bodies in the order of materials.
    fn of(
        material: MaterialId,
        all: &[(usize, Body)],
        law: &'a dyn ForceLaw,
        kin: &'a BTreeMap<Partner, PartnerBodies>,
    ) -> Self {
        let mut contacts = Self { law, kin, material, back: Vec::new() };
        let own = Partner::Particles(material);
        contacts.back = all
            .chunk_by(of_one_material)
            .map(|others| {
                let each = others.iter().map(|(_, body)| contacts.on_plane(body, own, &kin[&own]));
                let hardest = each.reduce(|a, b| a.by(&b, f64::max));
                (others[0].1.material, hardest.expect("no part is empty"))
            })
            .collect();
        contacts
    }

    /// Contact with a plane of a material, with the heaviest of its bodies.
    fn on_plane(&self, body: &Body, partner: Partner, kin: &PartnerBodies) -> Hardest {
        let [_, heaviest] = kin.masses;
        self.law.about().hardest(body, partner.material(), reduced(body.mass, heaviest))
    }

    /// Contact of a body with those of a partner.
    fn hardest(&self, body: &Body, partner: Partner, kin: &PartnerBodies) -> Hardest {
        let own = self.on_plane(body, partner, kin);
        let Partner::Particles(material) = partner else { return own };
        let back = self.back.binary_search_by_key(&material, |(material, _)| *material);
        back.map_or(own, |at| own.softer(&self.back[at].1))
    }

    /// Number of bodies of a partner that there can be around a body, and number that fits around one of its size [m].
    fn count(&self, own_size: f64, partner: Partner, kin: &PartnerBodies) -> [f64; 2] {
        let itself = if partner == Partner::Particles(self.material) { 1.0 } else { 0.0 };
        let fit = match partner {
            Partner::Walls(_) => OF_WALLS,
            Partner::Particles(_) => fit(own_size, kin.smallest),
        };
        [kin.most - itself, fit]
    }
}

fn of_one_material((_, a): &(usize, Body), (_, b): &(usize, Body)) -> bool {
    a.material == b.material
}

/// Bodies that are not held; held bodies do not oscillate.
fn moving(library: &Library) -> impl Iterator<Item = Body> + '_ {
    bodies(library).filter(|body| body.mass.is_finite())
}

/// Number of partners of one size [m] that fit around a body of another.
fn fit(size: f64, partners: f64) -> f64 {
    CONTACTS * (0.5 * (1.0 + size / partners)).powi(2)
}

/// Smallest and largest particles of each shape; shapes without particles are left out.
fn bodies(library: &Library) -> impl Iterator<Item = Body> + '_ {
    let is_there = |&(shape, _): &(ShapeId, f64)| library.most[shape.index()] > 0.0;
    library.extremes().filter(is_there).map(|(shape, scale)| Body::of(library, shape, scale))
}

/// Contacts of a body with bodies of one partner.
struct Around {
    /// Largest number of contacts.
    most: f64,
    /// Number that fits if there are no others.
    fit: f64,
    each: Hardest,
    with: Partner,
}

/// Largest sum of `adds` over the contacts of a body, and the partner that adds most. Only the given part of the contacts
/// that fit counts, but each with its whole value.
fn fullest(part: f64, around: &[Around], adds: fn(&Hardest) -> f64) -> (f64, Option<Partner>) {
    let mut contacts: Vec<(&Around, f64)> =
        around.iter().map(|contacts| (contacts, adds(&contacts.each))).collect();
    contacts.sort_by(|(a, of_a), (b, of_b)| (b.fit * of_b).total_cmp(&(a.fit * of_a)));
    let (mut room, mut sum, mut largest) = (1.0, 0.0, (0.0, None));
    for (contacts, each) in contacts {
        let fit = part * contacts.fit;
        let count = contacts.most.min(room * fit);
        room -= count / fit;
        sum += count * each;
        if count * each > largest.0 {
            largest = (count * each, Some(contacts.with));
        }
    }
    (sum, largest.1)
}

/// Stable step of a body with these contacts [s], and the partner that counts most.
fn stable_step(library: &Library, body: &Body, around: &[Around]) -> (f64, Option<Partner>) {
    let (stiffness, partner) = fullest(TOGETHER, around, |h| h.stiffness + h.turning[0]);
    let (tangential, _) = fullest(TOGETHER, around, |h| h.dashpots[1] + h.turning[1]);
    let (normal, _) = fullest(ALONG_NORMALS, around, |h| h.dashpots[0]);
    let shape = &library.shapes[body.shape.index()];
    let compliance = shape.surface_compliance();
    let flatness = shape.inscribed_radius() / shape.bounding_radius();
    let across = 1.0 + (compliance - 1.0) * (1.0 - flatness * flatness);
    let frequency_squared = 2.0 * compliance * stiffness / body.mass;
    let rate = 2.0 * (compliance * tangential + across * normal) / body.mass;
    (4.0 / (rate + (rate * rate + 4.0 * frequency_squared).sqrt()), partner)
}

/// Applies `find` to each moving body and its contacts; each result comes with its place among all. The contacts with other
/// materials are held for one material at a time.
fn of_each<T>(
    library: &Library,
    law: &dyn ForceLaw,
    mut find: impl FnMut(&Body, &Contacts) -> T,
) -> Vec<(usize, T)> {
    let kin = kin(library);
    let mut all: Vec<(usize, Body)> = moving(library).enumerate().collect();
    all.sort_by_key(|(_, body)| body.material);
    let mut found = Vec::new();
    for own in all.chunk_by(of_one_material) {
        let contacts = Contacts::of(own[0].1.material, &all, law, &kin);
        found.extend(own.iter().map(|(place, body)| (*place, find(body, &contacts))));
    }
    found
}

/// Limit over all shapes of particles; `None` if no contact can push them.
pub fn time_step_limit(library: &Library, law: &dyn ForceLaw) -> Option<TimeStepLimit> {
    let all = of_each(library, law, |body, contacts| limit_of(library, body, contacts));
    let limits = all.into_iter().filter_map(|(place, limit)| Some((place, limit?)));
    let shortest = limits.min_by(|a, b| a.1.dt.total_cmp(&b.1.dt).then(a.0.cmp(&b.0)));
    shortest.map(|(_, limit)| limit)
}

/// Limit of one body; `None` if no contact can push it.
fn limit_of(library: &Library, body: &Body, contacts: &Contacts) -> Option<TimeStepLimit> {
    let own_size = size(library, body);
    let around = |(&with, kin): (&Partner, &PartnerBodies)| {
        let [most, fit] = contacts.count(own_size, with, kin);
        Around { most, fit, each: contacts.hardest(body, with, kin), with }
    };
    let around: Vec<Around> = contacts.kin.iter().map(around).collect();
    let (dt, partner) = stable_step(library, body, &around);
    let partner = partner?;
    let Hardest { stiffness, turning: [spring, _], .. } =
        contacts.hardest(body, partner, &contacts.kin[&partner]);
    Some(TimeStepLimit {
        dt,
        shape: body.shape,
        mass: body.mass,
        stiffness: stiffness + spring,
        partner,
        overlap: contacts.law.about().hardest_up_to(),
    })
}

/// Limit with the present contacts of this rank's particles [s], infinite without contacts. The second value is the largest
/// overlap, over the radius of the smaller body, at the particle that sets it.
pub fn limit_of_contacts<'a>(
    particles: &Particles,
    contacts: impl Iterator<Item = (Pair, &'a Geometry)>,
    law: &dyn ForceLaw,
) -> (f64, f64) {
    let library = &particles.library;
    let body_in = |slot: usize| Body::of(library, particles.shape[slot], particles.scale_of(slot));
    let mut particles_around: BTreeMap<usize, (f64, Vec<Around>)> = BTreeMap::new();
    for (pair, geometry) in contacts {
        let radii = [pair.a, pair.b].map(Slot::index).map(|slot| particles.inscribed_radius(slot));
        let slots = [pair.a, pair.b].map(|slot| particles.body_of(slot).index());
        let bodies = slots.map(body_in);
        let overlap = geometry.overlap.max(0.0) / radii[0].min(radii[1]);
        let stiffer = law.about().stiffens(overlap, library);
        let mass = reduced(bodies[0].mass, bodies[1].mass);
        let on_other =
            |body: usize| law.about().hardest(&bodies[body], bodies[1 - body].material, mass);
        let is_wall = particles.wall_of(pair.b).is_some();
        let moves = |slot: usize| slot < particles.owned && !particles.is_held(slot);
        for (body, &slot) in slots.iter().enumerate().filter(|&(_, &slot)| moves(slot)) {
            let (own, other) = (&bodies[body], &bodies[1 - body]);
            let (fit, each, with) = if is_wall {
                (OF_WALLS, on_other(body), Partner::Walls(other.material))
            } else {
                let each = on_other(body).softer(&on_other(1 - body));
                let fit = fit(size(library, own), size(library, other));
                (fit, each, Partner::Particles(other.material))
            };
            let (largest, around) = particles_around.entry(slot).or_default();
            *largest = largest.max(overlap);
            around.push(Around { most: 1.0, fit, each: each.stiffened(stiffer), with });
        }
    }
    let limits = particles_around.into_iter().map(|(slot, (overlap, around))| {
        (stable_step(library, &body_in(slot), &around).0, overlap)
    });
    limits.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 0.0))
}

/// Part of the stable limit that an automatic step uses [-].
const OWN: f64 = 0.8;

/// Automatic step for a stable limit [s]. It is rounded to two decimal digits, so that the printed number is exact;
/// rounding adds up to 4 %.
pub fn own_step(limit: f64) -> f64 {
    format!("{:.1e}", OWN * limit).parse().unwrap_or(OWN * limit)
}

/// Highest frequency at which two bodies oscillate on the spring of one contact, without dashpots [rad/s]: `√(k / m)`. `k`
/// is their largest stiffness, `m` the reduced mass of a body and its lightest partner. `None` if no contact can push.
pub fn highest_frequency(library: &Library, law: &dyn ForceLaw) -> Option<f64> {
    let of_body = |body: &Body, contacts: &Contacts| {
        let squared = contacts.kin.iter().filter_map(|(&partner, kin)| {
            let [most, _] = contacts.count(0.0, partner, kin);
            let [lightest, _] = kin.masses;
            let stiffness = contacts.hardest(body, partner, kin).stiffness;
            (most > 0.0).then(|| stiffness / reduced(body.mass, lightest))
        });
        squared.fold(0.0, f64::max)
    };
    let all = of_each(library, law, of_body);
    let highest = all.into_iter().map(|(_, squared)| squared).fold(0.0, f64::max);
    (highest > 0.0).then(|| highest.sqrt())
}

/// Distance from the middle of a side within which a contact rocks a body faster than steps of `dt` [s] can follow, over
/// the half length of the body. It is 0 if there is none. `acceleration` is that of the load, like gravity [m/s²]. `scale`
/// is the size of the body over that of its shape.
///
/// A body on a plane, tilted by `θ` from a flat side, is turned back by its load `N` with the lever `x(θ)` about the
/// contact. `I` is its moment of inertia about the contact. The leapfrog follows that while `N x dt² / (I θ) < 4`. Towards
/// the middle `x / θ` grows to the radius of curvature. It is infinite in the middle of any side of a superellipsoid with
/// an exponent below 1. There the integration adds energy to the body, which is negligible where the distance is small.
pub fn lost_levers(shape: &Shape, scale: f64, acceleration: f64, dt: f64) -> f64 {
    let sides = (0..3).flat_map(|axis| {
        let [side, along, across] = [0, 1, 2].map(|k| Vec3::ith((axis + k) % 3, 1.0));
        [(side, along), (-side, along), (side, across), (-side, across)]
    });
    let rate = acceleration * dt * dt / scale;
    sides.map(|(side, along)| lost_lever(shape, &side, &along, rate)).fold(0.0, f64::max)
}

/// Distance for one side, in one direction along it. `rate` contains the square of the step [m].
fn lost_lever(shape: &Shape, side: &Vec3, along: &Vec3, rate: f64) -> f64 {
    let axis = side.cross(along);
    let inertia = axis.dot(&(Mat3::from_diagonal(&shape.gyration()) * axis));
    let lever = |tilt: f64| {
        let ends = [tilt, -tilt].map(|tilt| shape.support(&(side + along * tilt).normalize()));
        (0.5 * (ends[0] - ends[1]).dot(along), 0.5 * (ends[0] + ends[1]).dot(side))
    };
    let is_lost = |tilt: f64| {
        let (lever, height) = lever(tilt);
        rate * lever > 4.0 * tilt * (inertia + height * height + lever * lever)
    };
    let [mut lost, mut followed] = [1e-9, 1.0];
    if !is_lost(lost) || is_lost(followed) {
        return 0.0;
    }
    for _ in 0..60 {
        let middle = f64::sqrt(lost * followed);
        if is_lost(middle) { lost = middle } else { followed = middle }
    }
    let half_length = 0.5 * (shape.support(along) - shape.support(&-along)).dot(along);
    lever(lost).0 / half_length
}
