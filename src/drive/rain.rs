//! tmp
#![allow(missing_docs)]
use crate::math::Vec3;
use crate::particles::{Library, Particles, records::Particle};
pub struct Rain {
    pub low: Vec3,
    pub high: Vec3,
    pub every: u64,
    pub count: u64,
}
pub fn layer(
    _rain: &Rain,
    _seed: u64,
    _index: u64,
    _first_id: u64,
    _library: &Library,
) -> Vec<Particle> {
    vec![]
}

/// The rain of a running simulation: what has fallen and when more is due.
#[derive()]
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

    /// After a restart: `layers` have fallen, the first of them of particle `first_id`.
    pub fn resume(&mut self, layers: u64, first_id: u64, library: &Library) {
        while self.layers < layers {
            let next = first_id + self.fallen;
            self.next_layer(next, library);
        }
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
