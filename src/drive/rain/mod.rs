//! Rain: layers of particles that appear in a slab and fall.
//!
//! [`layer`] fills a layer; [`gauge`] inserts it when its place is free.

pub mod gauge;
pub mod layer;

pub use gauge::{RainGauge, saved};
pub use layer::{LOOKED_AT, Layer, Site, of_layer};

use super::region::Region;
use crate::cell::Cell;
use crate::math::Vec3;
use crate::population::mix::Mix;
use crate::population::orientations::Orientations;
use crate::walls::Wall;
use serde::{Deserialize, Serialize};

/// Largest distance by which a particle may reach out of a region, over the spacing, for rounding.
const ROUNDING: f64 = 1e-6;

/// Region of the particles of a layer that leaves places out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Within {
    /// Region of their whole bounding spheres, which are also clear of walls.
    pub region: Region,
    /// Approximate number of places of a layer within the region.
    pub places: u64,
    /// Approximate number of these that are clear of walls at the beginning; not 0.
    pub free: u64,
}

/// Layers of particles that fall in at intervals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rain {
    /// Shapes, and their shares of the particles.
    pub mix: Mix,
    /// Total number of particles.
    pub count: u64,
    /// Steps between layers; a layer waits until its place is free.
    pub every: u64,
    /// Lowest corner of the slab in which a layer appears [m].
    pub low: Vec3,
    /// Highest corner of the slab [m].
    pub high: Vec3,
    /// Smallest width of a particle's cell, at least the size of any particle [m].
    pub spacing: f64,
    /// Initial velocity [m/s].
    pub velocity: Vec3,
    /// Orientations.
    pub orientations: Orientations,
    /// Region in the slab for the particles, clear of walls; `None` for the whole slab, which walls do not reach.
    pub within: Option<Within>,
}

impl Rain {
    /// Cells along each axis.
    pub fn cells(&self) -> [u32; 3] {
        let extent = self.high - self.low;
        [0, 1, 2].map(|axis| cells_along(extent[axis], self.spacing))
    }

    /// Particles in a full layer.
    pub fn per_layer(&self) -> u64 {
        self.cells().iter().fold(1, |all: u64, &n| all.saturating_mul(n.into()))
    }

    /// Particles in a layer; approximate if it leaves places out.
    pub fn in_layer(&self) -> u64 {
        self.within.as_ref().map_or_else(|| self.per_layer(), |within| within.free.max(1))
    }

    /// Particles in the next layer after `fallen`; an upper bound if it leaves places out.
    pub fn in_next_layer(&self, fallen: u64) -> u64 {
        self.count.saturating_sub(fallen).min(self.per_layer())
    }

    /// Does the slab reach behind a wall? Rounding is tolerated.
    pub fn is_through(&self, wall: &Wall) -> bool {
        wall.depth(&(self.low, self.high)) / self.spacing > ROUNDING
    }

    /// Total number of layers; the last one may be partly filled.
    pub fn layers(&self) -> u64 {
        self.count.div_ceil(self.in_layer())
    }

    /// Steps from one layer to the next without other delays: the time of a layer to fall out of the slab, rounded up to a
    /// multiple of `every`. `None` if it does not fall out. Gravity in m/s², the step in s.
    pub fn interval(&self, gravity: &Vec3, cell: &Cell, dt: f64) -> Option<u64> {
        let extent = self.high - self.low;
        let out = cell
            .open_axes()
            .filter_map(|axis| time_to_go(extent[axis], self.velocity[axis], gravity[axis]))
            .reduce(f64::min)?;
        let steps = ((out / dt).ceil() as u64).max(1);
        Some(steps.div_ceil(self.every).saturating_mul(self.every))
    }

    /// Steps of a particle to fall from the slab to a bed of this depth [m], on the far side of the box from `low` to
    /// `high` [m]. `None` if it does not get there. Gravity in m/s², the step in s.
    pub fn fall(&self, low: &Vec3, high: &Vec3, bed: f64, gravity: &Vec3, dt: f64) -> Option<u64> {
        let axis = if *gravity == Vec3::zeros() { self.velocity.iamax() } else { gravity.iamax() };
        let (speed, pull) = (self.velocity[axis], gravity[axis]);
        let is_down = pull < 0.0 || (pull == 0.0 && speed < 0.0);
        let distance =
            if is_down { self.low[axis] - low[axis] } else { high[axis] - self.high[axis] };
        Some((time_to_go((distance - bed).max(0.0), speed, pull)? / dt).ceil() as u64)
    }
}

/// Time after which a body with this initial velocity [m/s] and acceleration [m/s²] is first a distance [m] away [s];
/// `None` for never.
fn time_to_go(distance: f64, velocity: f64, acceleration: f64) -> Option<f64> {
    // It may get there against the acceleration, before it turns.
    let before_it_turns = velocity * velocity - 2.0 * acceleration.abs() * distance;
    let is_braked = velocity * acceleration < 0.0;
    let speed = velocity.abs();
    if acceleration == 0.0 || (is_braked && before_it_turns >= 0.0) {
        let later = if acceleration == 0.0 { speed } else { before_it_turns.sqrt() };
        return (speed > 0.0).then(|| 2.0 * distance / (speed + later));
    }
    let towards = if is_braked { -speed } else { speed };
    let there = 2.0f64.mul_add(acceleration.abs() * distance, speed * speed).sqrt();
    Some((there - towards) / acceleration.abs())
}

/// Number of cells of at least this width that fit into a length; rounding is tolerated.
pub fn cells_along(length: f64, width: f64) -> u32 {
    (length / width * (1.0 + 1e-9)).floor() as u32
}

#[cfg(test)]
mod tests {
    use super::time_to_go;

    /// At the returned time the distance is reached, and never before, for any initial direction.
    #[test]
    fn the_time_out_of_the_slab_is_that_of_a_fall() {
        for (velocity, acceleration) in
            [(0.0, -9.81), (-2.0, -9.81), (2.0, -9.81), (3.0, -1.0), (-0.5, 0.0), (0.1, 0.3)]
        {
            let way = |t: f64| (velocity * t + 0.5 * acceleration * t * t).abs();
            let time = time_to_go(0.7, velocity, acceleration).unwrap();
            assert!((way(time) - 0.7).abs() < 1e-14, "{velocity} {acceleration}: {}", way(time));
            for k in 1..1000 {
                assert!(way(time * f64::from(k) / 1000.0) < 0.7, "{velocity} {acceleration} {k}");
            }
        }
        assert_eq!(time_to_go(0.7, 0.0, 0.0), None);
    }
}
