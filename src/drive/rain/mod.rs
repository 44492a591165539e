//! Rain: layers of particles that appear in a slab and fall.
//!
//! A layer is filled as [`layer`] says; it falls when its place is free ([`gauge`]).

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

/// A particle may reach out of a region by so much of a cell, for rounding.
const ROUNDING: f64 = 1e-6;

/// Where the particles of a layer are that leaves places out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Within {
    /// They are in it with their whole bounding spheres, and clear of walls.
    pub region: Region,
    /// How many of a layer are within the region, about.
    pub places: u64,
    /// How many of these are clear of walls that stand as at the beginning, about; not 0.
    pub free: u64,
}

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
    /// Orientations.
    pub orientations: Orientations,
    /// The region in the slab to which particles keep, clear of walls; `None`: the whole slab, of which walls are clear.
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

    /// Particles in a layer, about, if it leaves places out.
    pub fn in_layer(&self) -> u64 {
        self.within.as_ref().map_or_else(|| self.per_layer(), |within| within.free.max(1))
    }

    /// Particles in the next layer, if so many have fallen; at most, if it leaves places out.
    pub fn in_next_layer(&self, fallen: u64) -> u64 {
        self.count.saturating_sub(fallen).min(self.per_layer())
    }

    /// Does the slab reach behind a wall? Rounding is forgiven.
    pub fn is_through(&self, wall: &Wall) -> bool {
        wall.depth(&(self.low, self.high)) / self.spacing > ROUNDING
    }

    /// Layers in all; the last one may be partly filled.
    pub fn layers(&self) -> u64 {
        self.count.div_ceil(self.in_layer())
    }

    /// Steps from one layer to the next, if nothing else holds them up: as many as a layer needs to fall out of the slab,
    /// rounded up to a multiple of `every`. `None` if it does not fall out. Gravity in m/s², the step in s.
    pub fn interval(&self, gravity: &Vec3, cell: &Cell, dt: f64) -> Option<u64> {
        let extent = self.high - self.low;
        let out = cell
            .open_axes()
            .filter_map(|axis| time_to_go(extent[axis], self.velocity[axis], gravity[axis]))
            .reduce(f64::min)?;
        let steps = ((out / dt).ceil() as u64).max(1);
        Some(steps.div_ceil(self.every).saturating_mul(self.every))
    }

    /// How many steps a particle needs to fall from the slab to a bed of this depth [m] on the far side of the box from `low`
    /// to `high` [m]. `None` if it does not get there. Gravity in m/s², the step in s.
    pub fn fall(&self, low: &Vec3, high: &Vec3, bed: f64, gravity: &Vec3, dt: f64) -> Option<u64> {
        let axis = if *gravity == Vec3::zeros() { self.velocity.iamax() } else { gravity.iamax() };
        let (speed, pull) = (self.velocity[axis], gravity[axis]);
        let is_down = pull < 0.0 || (pull == 0.0 && speed < 0.0);
        let distance =
            if is_down { self.low[axis] - low[axis] } else { high[axis] - self.high[axis] };
        Some((time_to_go((distance - bed).max(0.0), speed, pull)? / dt).ceil() as u64)
    }
}

/// When a body that starts at a velocity [m/s] under an acceleration [m/s²] is first a distance [m] away; `None` for never [s].
fn time_to_go(distance: f64, velocity: f64, acceleration: f64) -> Option<f64> {
    // Against the acceleration it may get there before it turns.
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

/// How many cells of at least this width fit into a length, rounding forgiven.
pub fn cells_along(length: f64, width: f64) -> u32 {
    (length / width * (1.0 + 1e-9)).floor() as u32
}

#[cfg(test)]
mod tests {
    use super::time_to_go;

    /// The way after the time is the distance, and half as long before it is not, whichever way it started.
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
