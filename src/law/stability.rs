//! The largest stable time step.
//!
//! The leapfrog of [`dem_grains::motion`] is stable up to `Δt = 2 / ω` for the highest frequency `ω` of
//! the assembly. By Gershgorin's circles, `ω² <= 2 k C / m` for a body with `C` contacts of stiffness
//! `k`; a contact far from the centre also turns the body, which makes its surface
//! [`Shape::surface_compliance`](crate::shape::Shape::surface_compliance) times as compliant as its
//! centre, 3.5 for a sphere. No motion moves all contacts around a body like its most compliant: where spheres turn against
//! all their neighbours it is 5/3 in the mean, and that part is taken of every shape's.
//!
//! A dashpot `c` feels the velocity of half a step before: with `γ <= 2 c C / m`, found like `ω²`, the step is stable
//! while `ω² Δt² + 2 γ Δt < 4`. Where velocities are foreseen ([`super::kernel`]) tangential dashpots count 1.2 times. The faster a mode, the more of critical damping it has: tangential dashpots of half of it
//! for a pair take four fifths of the step of a packed bed. Those along the normals do less: a motion feels a third of
//! them, and they turn a body by no more than its flatness lets them. Partners are taken as heavy as the heaviest grain;
//! walls are few.
//!
//! Where a side is flat the contact point runs over it when the body turns: with the radius of curvature `ρ` there, a
//! force `F` turns it back with the stiffness `F ρ`. Overlaps are some thousandths of a size, so that for bodies as flat as
//! discs of 5:1 this is hundredths of `k` and changes nothing. Sides of blunt superellipsoids are flat to rounding in
//! their middle, and no step is short enough there: see [`lost_levers`].
//!
//! Contacts are as stiff as those of the bodies that meet: for each material that bodies can have, as many contacts as there can be
//! such bodies and as fit around the body, the stiffest first. Equal spheres are [`CONTACTS`]; smaller ones more, as many more as
//! their caps fit on its surface; six are walls, which do not move away and so count half. A few contacts alone can
//! move together: then each counts with its whole compliance.
//!
//! Of particles of many sizes the smallest and the largest of each shape are looked at, each among the heaviest and the
//! smallest of a material. A contact is no stiffer than on a plane for the stiffer one of its bodies.
//!
//! More contacts than that at full stiffness would need a shorter step; fewer is the rule, and the bound is then on the safe side.
//! Before a run ends for it, [`limit_of_contacts`] looks at the contacts that are there.

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

/// Contacts with walls in the estimate, each like one with a partner: twelve walls all around.
const OF_WALLS: f64 = 6.0;

/// Compliance of a sphere's surface in the motion that strains all contacts most, over that at a single one.
const TOGETHER: f64 = (5.0 / 3.0) / 3.5;

/// Part of the dashpots along the normals that a motion feels.
const ALONG_NORMALS: f64 = 1.0 / 3.0;

/// A bound of the time step, and what sets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeStepLimit {
    /// The largest stable step [s].
    pub dt: f64,
    /// The shape with the highest frequency.
    pub shape: ShapeId,
    /// Its mass [kg].
    pub mass: f64,
    /// The stiffness of the contacts that count most in it [N/m].
    pub stiffness: f64,
    /// What they are with.
    pub partner: Partner,
    /// The overlap over the radius of the smaller body at which they have it [-]; `None` if they have it at any.
    pub overlap: Option<f64>,
}

/// Bodies of one material that others touch.
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
    /// What sets it, but for the name of the shape.
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

/// The bodies of a partner.
#[derive(Clone, Copy, Debug)]
struct Kin {
    /// How many there can be.
    most: f64,
    /// The least cube root of a volume [m].
    smallest: f64,
    /// The least and the largest mass [kg].
    masses: [f64; 2],
}

/// What bodies can touch in a library, particles that are none left out.
fn kin(library: &Library) -> BTreeMap<Partner, Kin> {
    let mut all = BTreeMap::new();
    for &material in &library.materials[library.facets()] {
        let infinite = f64::INFINITY;
        let walls = Kin { most: infinite, smallest: infinite, masses: [infinite; 2] };
        all.insert(Partner::Walls(material), walls);
    }
    for body in bodies(library) {
        let none = Kin { most: 0.0, smallest: f64::INFINITY, masses: [f64::INFINITY, 0.0] };
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

/// The cube root of the volume of a body [m].
fn size(library: &Library, body: &Body) -> f64 {
    libm::cbrt(library.shapes[body.shape.index()].volume()) * body.scale
}

/// The reduced mass of two bodies of which one may be a wall or held [kg].
fn reduced(mass: f64, other: f64) -> f64 {
    if other.is_infinite() {
        mass
    } else if mass.is_infinite() {
        other
    } else {
        mass * other / (mass + other)
    }
}

/// What bodies of one material touch.
struct Contacts<'a> {
    law: &'a dyn ForceLaw,
    kin: &'a BTreeMap<Partner, Kin>,
    material: MaterialId,
    /// The hardest contacts of particles of other materials with it, in the order of materials.
    back: Vec<(MaterialId, Hardest)>,
}

impl<'a> Contacts<'a> {
    /// Of the bodies of a material, among all that move, in the order of materials.
    fn of(
        material: MaterialId,
        all: &[(usize, Body)],
        law: &'a dyn ForceLaw,
        kin: &'a BTreeMap<Partner, Kin>,
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

    /// On a plane of a material, with the heaviest of its bodies.
    fn on_plane(&self, body: &Body, partner: Partner, kin: &Kin) -> Hardest {
        let [_, heaviest] = kin.masses;
        self.law.about().hardest(body, partner.material(), reduced(body.mass, heaviest))
    }

    /// Of a body with those of a partner.
    fn hardest(&self, body: &Body, partner: Partner, kin: &Kin) -> Hardest {
        let own = self.on_plane(body, partner, kin);
        let Partner::Particles(material) = partner else { return own };
        let back = self.back.binary_search_by_key(&material, |(material, _)| *material);
        back.map_or(own, |at| own.softer(&self.back[at].1))
    }

    /// How many of a partner there can be around a body, and fit around one of its size [m].
    fn count(&self, own_size: f64, partner: Partner, kin: &Kin) -> [f64; 2] {
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

/// Bodies that are not held. A held one has no period.
fn moving(library: &Library) -> impl Iterator<Item = Body> + '_ {
    bodies(library).filter(|body| body.mass.is_finite())
}

/// How many bodies of a size [m] fit around one of another.
fn fit(size: f64, partners: f64) -> f64 {
    CONTACTS * (0.5 * (1.0 + size / partners)).powi(2)
}

/// Particles that bound all others, shapes of which there are none left out.
fn bodies(library: &Library) -> impl Iterator<Item = Body> + '_ {
    let is_there = |&(shape, _): &(ShapeId, f64)| library.most[shape.index()] > 0.0;
    library.extremes().filter(is_there).map(|(shape, scale)| Body::of(library, shape, scale))
}

/// Contacts of a body with bodies of one kind.
struct Around {
    /// How many there can be.
    most: f64,
    /// How many fit, were there no others.
    fit: f64,
    each: Hardest,
    with: Partner,
}

/// The most that contacts of a body sum up to, and those that add most to it. A part of those that fit counts, with the whole of what each adds.
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

/// The stable step of a body with these contacts [s], and those that count most.
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

/// Something of each body that moves and what it touches, with its place among all. What others do to a material is held for one material at a
/// time.
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

/// The limit over all shapes of particles; `None` if nothing can push them.
pub fn time_step_limit(library: &Library, law: &dyn ForceLaw) -> Option<TimeStepLimit> {
    let all = of_each(library, law, |body, contacts| limit_of(library, body, contacts));
    let limits = all.into_iter().filter_map(|(place, limit)| Some((place, limit?)));
    let shortest = limits.min_by(|a, b| a.1.dt.total_cmp(&b.1.dt).then(a.0.cmp(&b.0)));
    shortest.map(|(_, limit)| limit)
}

/// The limit of one body; `None` if nothing can push it.
fn limit_of(library: &Library, body: &Body, contacts: &Contacts) -> Option<TimeStepLimit> {
    let own_size = size(library, body);
    let around = |(&with, kin): (&Partner, &Kin)| {
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

/// The limit with the contacts of this rank's particles as they are [s], and the largest overlap over the radius of the smaller body
/// at the particle that sets it; infinite where nothing touches.
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

/// The part of the stable limit that a program's own step takes [-].
const OWN: f64 = 0.8;

/// The program's own step for a stable limit [s], by its decimal digits: the number that is printed is the number itself. Rounding goes up
/// by 4 % at most.
pub fn own_step(limit: f64) -> f64 {
    format!("{:.1e}", OWN * limit).parse().unwrap_or(OWN * limit)
}

/// The highest frequency at which two bodies oscillate on the spring of one contact, without dashpots [rad/s]: `√(k / m)` with
/// the largest stiffness that they can have and the reduced mass of a body and the lightest of its partners. `None` if nothing pushes.
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

/// How far from the middle of a side, over the half length of the body, a contact rocks it faster than steps of `dt` [s] can
/// follow; 0 where they always can. `acceleration` is that of the load, as gravity is [m/s²]; `scale` is the size of the body
/// over that of its shape.
///
/// A body on a plane that is tilted by `θ` from a flat side is turned back by its load `N` with the lever `x(θ)`, about the
/// contact, where its moment of inertia is `I`. The leapfrog follows that while `N x dt² / (I θ) < 4`. Towards the middle
/// `x / θ` grows to the radius of curvature, which is infinite in the middle of any side of a superellipsoid with an exponent
/// below 1: there the body is heated, which amounts to little where the part is small.
pub fn lost_levers(shape: &Shape, scale: f64, acceleration: f64, dt: f64) -> f64 {
    let sides = (0..3).flat_map(|axis| {
        let [side, along, across] = [0, 1, 2].map(|k| Vec3::ith((axis + k) % 3, 1.0));
        [(side, along), (-side, along), (side, across), (-side, across)]
    });
    let rate = acceleration * dt * dt / scale;
    sides.map(|(side, along)| lost_lever(shape, &side, &along, rate)).fold(0.0, f64::max)
}

/// The same of one side, in one direction along it. `rate` has the square of the step in it [m].
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
