//! Layers of rain: positions of their particles.
//!
//! The slab is cut into equal cells, at least one spacing wide. A particle stands in the middle of its cell, moved by a
//! random step that leaves its bounding sphere inside. So no two particles of a layer overlap, not even across a periodic
//! border, and none leaves the slab.
//!
//! A layer [`Within`] a region leaves out the cells where a particle would reach out of the region or meet a wall. The
//! particle takes the next cell, and those behind it follow, so that large particles do not become rarer. All ranks know
//! all walls, and find the same places.

use super::{ROUNDING, Rain};
use crate::cell::Cell;
use crate::drive::region::Region;
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::particles::records::Particle;
use crate::population::Library;
use crate::random::{Random, mixed};
use crate::walls::{Wall, met_by};

/// Largest number of cells of a layer that is checked before the run.
pub const LOOKED_AT: u64 = 20_000;
/// Tries of a particle to find a place in a cell.
const TRIES: usize = 50;
/// Tag of the random numbers of these places.
const STREAM: u64 = 0x7261_696e;

/// Particle `k` of a layer whose first one has the id `first_id`. Shape, size, orientation and place follow from its id and
/// the scene's `seed`.
pub fn of_layer(rain: &Rain, seed: u64, first_id: u64, k: u64, library: &Library) -> Particle {
    let id = first_id + k;
    let mut random = Random::of(seed, id);
    let shape = rain.mix.pick(random.unit());
    let scale = library.sizes[shape.index()].draw(&mut random);
    let radius = library.radius[shape.index()] * scale;
    let position = place_in_cell(rain, k, radius, &mut random);
    Particle {
        scale,
        velocity: rain.velocity,
        quaternion: rain.orientations.draw(&mut random),
        ..Particle::at_rest(GlobalId(id), shape, position)
    }
}

/// Random place in a cell of the slab that leaves a sphere inside.
fn place_in_cell(rain: &Rain, k: u64, radius: f64, random: &mut Random) -> Vec3 {
    let [nx, ny, nz] = rain.cells().map(u64::from);
    let cell = (rain.high - rain.low).component_div(&Vec3::new(nx as f64, ny as f64, nz as f64));
    let place = [k % nx, k / nx % ny, k / (nx * ny)];
    Vec3::from_fn(|axis, _| {
        let room = (0.5 * cell[axis] - radius).max(0.0);
        rain.low[axis] + (place[axis] as f64 + 0.5) * cell[axis] + room * random.signed()
    })
}

/// A layer that leaves places out.
#[derive(Clone, Copy, Debug)]
pub struct Layer {
    /// Seed of the scene.
    pub seed: u64,
    /// Number of the attempt; another attempt has other places.
    pub look: u64,
    /// Id of its first particle.
    pub first_id: u64,
    /// Largest number of particles.
    pub most: u64,
}

/// A layer of rain within a region, among walls.
#[derive(Clone, Copy, Debug)]
pub struct Site<'a> {
    /// The rain.
    pub rain: &'a Rain,
    /// Region of the particles' whole bounding spheres.
    pub region: &'a Region,
    /// The domain and its periods.
    pub cell: &'a Cell,
    /// Walls that particles must not meet.
    pub walls: &'a [&'a Wall],
}

impl Site<'_> {
    /// Does any cell of a layer have a place for a sphere of this radius [m]?
    pub fn has_place(&self, radius: f64) -> bool {
        (0..self.rain.per_layer()).any(|k| {
            let mut random = Random::of(STREAM, k);
            let mut tries =
                (0..4 * TRIES).map(|_| place_in_cell(self.rain, k, radius, &mut random));
            tries.any(|place| self.is_clear(&place, radius))
        })
    }

    /// Is a sphere of this radius [m] at this place within the region and clear of the walls?
    fn is_clear(&self, place: &Vec3, radius: f64) -> bool {
        self.region.distance(place, self.cell) + radius <= ROUNDING * self.rain.spacing
            && met_by(self.walls.iter().copied(), self.cell, place, radius).is_none()
    }

    /// Places of the particles of a layer, in the order of their ids: as many as find one.
    pub fn places(&self, layer: Layer, library: &Library) -> Vec<Vec3> {
        let Layer { seed, look, first_id, most } = layer;
        let rain = self.rain;
        let radius_of = |id: u64| {
            let grain = of_layer(rain, seed, id, 0, library);
            library.radius[grain.shape.index()] * grain.scale
        };
        let mut places = Vec::new();
        let mut radius = radius_of(first_id);
        for k in 0..rain.per_layer() {
            if places.len() as u64 == most {
                break;
            }
            let id = first_id + places.len() as u64;
            let mut random = Random::of(mixed(&[seed, STREAM, look, id]), k);
            let mut tries = (0..TRIES).map(|_| place_in_cell(rain, k, radius, &mut random));
            if let Some(place) = tries.find(|place| self.is_clear(place, radius)) {
                places.push(place);
                radius = radius_of(id + 1);
            }
        }
        places
    }
}
