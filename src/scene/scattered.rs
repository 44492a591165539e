//! Particles at random places, no two of which touch.

use super::fills::Fills;
use super::orientations::orientations;
use super::reader::{Given, Section};
use super::{Fill, Listed, Mix, packing};
use crate::cell::Cell;
use crate::ids::ShapeId;
use crate::math::Vec3;
use crate::random::Random;
use std::collections::HashMap;

/// Number of tries for the place of a particle before the region counts as full.
const TRIES: u32 = 20_000;

/// Bounding balls in a box, in cells as wide as the largest of them.
struct Balls<'a> {
    domain: &'a Cell,
    /// Width of a cell along each axis [m], and number of cells along a periodic one.
    width: Vec3,
    cells: [Option<i64>; 3],
    in_cell: HashMap<[i64; 3], Vec<usize>>,
    /// Centres and radii [m].
    placed: Vec<(Vec3, f64)>,
}

impl<'a> Balls<'a> {
    fn new(domain: &'a Cell, largest_radius: f64) -> Self {
        let sides = domain.sides();
        let periodic = domain.periodic();
        let least = 2.0 * largest_radius;
        let cells: [Option<i64>; 3] = std::array::from_fn(|axis| {
            periodic[axis].then(|| ((sides[axis] / least).floor() as i64).max(1))
        });
        let width =
            Vec3::from_fn(|axis, _| cells[axis].map_or(least, |count| sides[axis] / count as f64));
        Self { domain, width, cells, in_cell: HashMap::new(), placed: Vec::new() }
    }

    /// Cell of a place.
    fn cell(&self, place: &Vec3) -> [i64; 3] {
        let (low, _) = self.domain.corners();
        std::array::from_fn(|axis| {
            let number = ((place[axis] - low[axis]) / self.width[axis]).floor() as i64;
            self.cells[axis].map_or(number, |count| number.rem_euclid(count))
        })
    }

    /// Is there room for a ball?
    fn has_room(&self, place: &Vec3, radius: f64) -> bool {
        let cell = self.cell(place);
        let apart = |&other: &usize| {
            let (centre, of_other) = self.placed[other];
            self.domain.nearest(place - centre).norm() > radius + of_other
        };
        (0..27).all(|k: i64| {
            let near: [i64; 3] = std::array::from_fn(|axis| {
                let number = cell[axis] + k / 3_i64.pow(axis as u32) % 3 - 1;
                self.cells[axis].map_or(number, |count| number.rem_euclid(count))
            });
            self.in_cell.get(&near).is_none_or(|others| others.iter().all(apart))
        })
    }

    fn add(&mut self, place: Vec3, radius: f64) {
        self.in_cell.entry(self.cell(&place)).or_default().push(self.placed.len());
        self.placed.push((place, radius));
    }
}

/// Amount of scattered particles.
#[derive(Clone, Copy)]
enum Amount {
    Count(u64),
    /// Volume of the particles [m³].
    Volume(f64),
}

impl Fills<'_> {
    /// Particles of `[[fill.random]]`, from the seed and their ids. They touch none of the earlier
    /// fills.
    pub(super) fn scattered(
        &self,
        section: &Section,
        before: &[Option<Fill>],
    ) -> Option<Vec<Listed>> {
        let mix = self.mix(section);
        let velocity = section.vector_or("velocity", Vec3::zeros());
        let orientations = orientations(section);
        let corner = |key| section.optional(key, Given::vector);
        let (low, high) = (corner("low"), corner("high"));
        let count = section.optional("count", Given::whole);
        let fraction = section.optional("solid_fraction", Given::number);
        let domain = self.domain?;
        let (lowest, highest) = domain.corners();
        let (low, high) = (low?.unwrap_or(lowest), high?.unwrap_or(highest));
        let box_of = high - low;
        if box_of.min() < 0.0 || domain.beyond(&low, &high).is_some() {
            section.fail("`low` and `high` are not the corners of a box within the domain");
            return None;
        }
        let amount = match (count?, fraction?) {
            (Some(count), None) => Amount::Count(count),
            (None, Some(fraction)) => Amount::Volume(fraction * box_of.product()),
            _ => {
                section.fail("give either `count` or `solid_fraction`");
                return None;
            }
        };
        let (mix, velocity, orientations) = (mix?, velocity?, orientations?);
        if !self.shapes.complete {
            return None;
        }
        let library = &self.shapes.library;
        let radius = |shape: ShapeId, scale: f64| library.radius[shape.index()] * scale;
        let mut first_id = 0;
        let mut there = Vec::new();
        for fill in before.iter().flatten() {
            let particles = packing::of_fill(fill, first_id, self.seed, library);
            there.extend(particles.map(|one| (one.position, radius(one.shape, one.scale))));
            first_id = fill.end(first_id);
        }
        let largest = there.iter().map(|&(_, radius)| radius);
        let mut balls = Balls::new(domain, largest.fold(library.largest_radius(), f64::max));
        for (place, radius) in there {
            balls.add(place, radius);
        }
        let mut rows = Vec::new();
        let mut volume = 0.0;
        loop {
            let is_full = match amount {
                Amount::Count(count) => rows.len() as u64 >= count,
                Amount::Volume(most) => volume >= most,
            };
            if is_full {
                return Some(rows);
            }
            let id = first_id + rows.len() as u64;
            let mut random = Random::of(self.seed, id);
            let shape = mix.pick(random.unit());
            let scale = library.sizes[shape.index()].draw(&mut random);
            let quaternion = orientations.draw(&mut random);
            let radius = radius(shape, scale);
            let Some(position) = place(&balls, [low, high], radius, &mut random) else {
                section.fail(full(rows.len(), &mix));
                return None;
            };
            balls.add(position, radius);
            volume += library.shapes[shape.index()].volume() * scale.powi(3);
            let angular_velocity = Vec3::zeros();
            rows.push(Listed {
                id,
                shape,
                scale,
                position,
                quaternion,
                velocity,
                angular_velocity,
            });
        }
    }
}

/// A random place for a ball [m], wholly between the corners along axes that do not repeat.
fn place(balls: &Balls, [low, high]: [Vec3; 2], radius: f64, random: &mut Random) -> Option<Vec3> {
    let periodic = balls.domain.periodic();
    let margin = Vec3::from_fn(|axis, _| if periodic[axis] { 0.0 } else { radius });
    let room = high - low - margin * 2.0;
    if room.min() < 0.0 {
        return None;
    }
    (0..TRIES)
        .map(|_| low + margin + Vec3::from_fn(|axis, _| room[axis] * random.unit()))
        .find(|place| balls.has_room(place, radius))
}

/// Error for a region without further room.
fn full(placed: usize, mix: &Mix) -> String {
    let several =
        if mix.shapes().count() > 1 { ", fill with larger shapes before smaller ones" } else { "" };
    format!(
        "no place is left after {placed} particles, whose bounding balls must not touch: use fewer{several}, or use a \
         larger box that is compressed later"
    )
}
