//! Rain: layers of particles that appear in a slab and fall.
//!
//! The slab is cut into equal cells, at least one spacing wide. A particle stands in the middle of
//! its cell, moved by a random step that leaves its bounding sphere inside: no two particles of a
//! layer can overlap, not even across a periodic border, and none leaves the slab.

use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::particles::mix::Mix;
use crate::particles::{Library, Particles, records::Particle};
use crate::random::Random;
use serde::{Deserialize, Serialize};

/// Layers of particles that fall in at intervals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rain {
    /// Which shapes, and their share of the particles.
    pub mix: Mix,
    /// How many particles in all.
    pub count: u64,
    /// Steps between layers; a layer waits until its place is free.
    pub every: u64,
    /// Lowest corner of the slab in which a layer appears [m].
    pub low: Vec3,
    /// Highest corner of the slab [m].
    pub high: Vec3,
    /// Least width of a particle's cell, which no particle exceeds [m].
    pub spacing: f64,
    /// Velocity at the start [m/s].
    pub velocity: Vec3,
}

impl Rain {
    /// Cells along each axis.
    pub fn cells(&self) -> [u32; 3] {
        let extent = self.high - self.low;
        [0, 1, 2].map(|axis| cells_along(extent[axis], self.spacing))
    }

    /// Particles in a full layer.
    pub fn per_layer(&self) -> u64 {
        self.cells().iter().map(|&n| u64::from(n)).product()
    }

    /// Layers in all; the last one may be partly filled.
    pub fn layers(&self) -> u64 {
        self.count.div_ceil(self.per_layer())
    }
}

/// How many cells of at least this width fit into a length, rounding forgiven.
pub fn cells_along(length: f64, width: f64) -> u32 {
    (length / width * (1.0 + 1e-9)).floor() as u32
}

/// The particles of layer `index` (from 0); none if all have fallen. Ids count from `first_id`. Shape,
/// attitude and place are those of the id under the scene's `seed`.
pub fn layer(
    rain: &Rain,
    seed: u64,
    index: u64,
    first_id: u64,
    library: &Library,
) -> Vec<Particle> {
    let [nx, ny, nz] = rain.cells().map(u64::from);
    let cell = (rain.high - rain.low).component_div(&Vec3::new(nx as f64, ny as f64, nz as f64));
    let per_layer = nx * ny * nz;
    let count = rain.count.saturating_sub(index * per_layer).min(per_layer);
    (0..count)
        .map(|k| {
            let id = first_id + k;
            let mut random = Random::of(seed, id);
            let shape = rain.mix.pick(random.unit());
            let radius = library.shapes[shape.index()].bounding_radius();
            let place = [k % nx, k / nx % ny, k / (nx * ny)];
            let position = Vec3::from_fn(|axis, _| {
                let room = (0.5 * cell[axis] - radius).max(0.0);
                rain.low[axis] + (place[axis] as f64 + 0.5) * cell[axis] + room * random.signed()
            });
            Particle {
                velocity: rain.velocity,
                quaternion: random.rotation(),
                ..Particle::at_rest(GlobalId(id), shape, position)
            }
        })
        .collect()
}

/// The rain of a running simulation: what has fallen and when more is due.
#[derive(Clone, Debug)]
pub struct RainGauge {
    rain: Rain,
    seed: u64,
    /// Layers that have fallen in this stage.
    pub layers: u64,
    /// Particles that have fallen in this stage.
    pub fallen: u64,
}

impl RainGauge {
    /// Before the first layer.
    pub const fn new(rain: Rain, seed: u64) -> Self {
        Self { rain, seed, layers: 0, fallen: 0 }
    }

    /// After a restart: so many layers have fallen.
    pub fn resume(&mut self, layers: u64) {
        self.layers = layers;
        self.fallen = self.rain.count.min(layers * self.rain.per_layer());
    }

    /// May a layer fall after this many steps of the stage?
    pub const fn is_due(&self, stage_step: u64) -> bool {
        !self.is_over() && stage_step.is_multiple_of(self.rain.every)
    }

    /// Has everything fallen?
    pub const fn is_over(&self) -> bool {
        self.fallen >= self.rain.count
    }

    /// Is an owned particle where the next layer would appear?
    pub fn is_blocked(&self, particles: &Particles) -> bool {
        (0..particles.owned).any(|slot| {
            let radius = particles.library.shapes[particles.shape[slot].index()].bounding_radius();
            let p = particles.position[slot];
            (0..3).all(|axis| {
                p[axis] + radius > self.rain.low[axis] && p[axis] - radius < self.rain.high[axis]
            })
        })
    }

    /// The next layer, the same on every rank; its first particle gets the id `first_id`.
    pub fn next_layer(&mut self, first_id: u64, library: &Library) -> Vec<Particle> {
        let layer = layer(&self.rain, self.seed, self.layers, first_id, library);
        self.layers += 1;
        self.fallen += layer.len() as u64;
        layer
    }
}
