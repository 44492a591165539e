//! Estimated positions of the particles of a scene: a settled bed, cut among the ranks.

use super::{Fill, Mix, Scene};
use crate::math::Vec3;
use std::f64::consts::PI;

/// Volume of particles over volume of the bed, in estimates.
const PACKING_FRACTION: f64 = 0.6;

/// Share of the busiest rank in the settled bed.
pub(super) struct Share {
    pub(super) owned: f64,
    pub(super) ghosts: f64,
    pub(super) neighbours: usize,
}

impl Share {
    pub(super) fn estimate(scene: &Scene, ranks: u32, reach: f64) -> Self {
        let bed = Block::bed(scene);
        let count = scene.particle_count() as f64;
        let sizes = Sizes::of(scene, &bed);
        let mut blocks = Vec::new();
        bed.cut(ranks.max(1), &mut blocks);
        let periodic = scene.domain.periodic();
        let mut share = Self { owned: count / f64::from(ranks.max(1)), ghosts: 0.0, neighbours: 0 };
        // With very many blocks a sample suffices.
        for block in blocks.iter().step_by(1 + blocks.len() / 1024) {
            let halo = block.grown(reach, &bed, periodic);
            let ghosts = sizes.ghosts(block, &bed, periodic);
            let neighbours = blocks
                .iter()
                .filter(|other| !std::ptr::eq(*other, block) && halo.meets(other, &bed, periodic))
                .count();
            share.ghosts = share.ghosts.max(ghosts);
            share.neighbours = share.neighbours.max(neighbours);
        }
        share
    }
}

/// Mix of the particle sizes in the bed.
struct Sizes {
    /// Bounding radius [m] and number density [1/m³] of each class.
    classes: Vec<(f64, f64)>,
    skin: f64,
}

impl Sizes {
    fn of(scene: &Scene, bed: &Block) -> Self {
        // All particles of a shape count with their mean volume.
        let class = |(of_shape, &radius): (OfShape, &f64)| {
            (radius * libm::cbrt(of_shape.mean_volume()), of_shape.count / bed.volume())
        };
        let classes = counts(scene).into_iter().zip(&scene.library.radius).map(class).collect();
        Self { classes, skin: scene.skin }
    }

    /// Number of particles around a block that are in a pair with one in it, for random positions. In a layer at
    /// some distance, those count that find at least one partner in the part of their reach beyond its face.
    fn ghosts(&self, block: &Block, bed: &Block, periodic: [bool; 3]) -> f64 {
        const LAYERS: u32 = 32;
        let largest = self.classes.iter().map(|&(radius, _)| radius).fold(0.0, f64::max);
        let of_class = |&(radius, density): &(f64, f64)| {
            let width = (radius + largest + self.skin) / f64::from(LAYERS);
            let volume = |layers| block.grown(f64::from(layers) * width, bed, periodic).volume();
            let in_layer = |layer| {
                let distance = (f64::from(layer) + 0.5) * width;
                let partners: f64 = (self.classes.iter())
                    .map(|&(other, density)| (radius + other + self.skin, density))
                    .filter(|&(reach, _)| reach > distance)
                    .map(|(reach, density)| density * cap(reach, reach - distance))
                    .sum();
                density * (volume(layer + 1) - volume(layer)) * (1.0 - libm::exp(-partners))
            };
            (0..LAYERS).map(in_layer).sum::<f64>()
        };
        self.classes.iter().map(of_class).sum()
    }
}

/// Volume of a spherical cap of this height [m³].
fn cap(radius: f64, height: f64) -> f64 {
    PI * height * height * (3.0 * radius - height) / 3.0
}

/// A box.
#[derive(Clone, Copy)]
struct Block {
    low: Vec3,
    high: Vec3,
}

impl Block {
    /// Bed of the particles: on the side to which gravity pulls, or in the whole domain.
    fn bed(scene: &Scene) -> Self {
        let (low, high) = scene.domain.corners();
        let mut bed = Self { low, high };
        if scene.gravity != Vec3::zeros() {
            let axis = scene.gravity.iamax();
            let extent = bed.high[axis] - bed.low[axis];
            let full = bed.volume() / extent;
            let height = (solid_volume(scene) / PACKING_FRACTION / full).min(extent);
            if scene.gravity[axis] < 0.0 {
                bed.high[axis] = bed.low[axis] + height;
            } else {
                bed.low[axis] = bed.high[axis] - height;
            }
        }
        bed
    }

    fn volume(&self) -> f64 {
        (self.high - self.low).product()
    }

    /// Halves along the longest side until each rank has one block.
    fn cut(self, ranks: u32, blocks: &mut Vec<Self>) {
        if ranks == 1 {
            blocks.push(self);
            return;
        }
        let extent = self.high - self.low;
        let axis = extent.imax();
        let lower_ranks = ranks / 2;
        let at = self.low[axis] + extent[axis] * f64::from(lower_ranks) / f64::from(ranks);
        let (mut lower, mut upper) = (self, self);
        lower.high[axis] = at;
        upper.low[axis] = at;
        lower.cut(lower_ranks, blocks);
        upper.cut(ranks - lower_ranks, blocks);
    }

    /// Block extended by `by` on all sides, but not beyond the bed where it does not repeat, and nowhere wider
    /// than the bed.
    fn grown(&self, by: f64, bed: &Self, periodic: [bool; 3]) -> Self {
        let mut grown = Self { low: self.low.add_scalar(-by), high: self.high.add_scalar(by) };
        for (axis, repeats) in periodic.into_iter().enumerate() {
            let (low, high) = (bed.low[axis], bed.high[axis]);
            if !repeats {
                grown.low[axis] = grown.low[axis].max(low);
                grown.high[axis] = grown.high[axis].min(high);
            } else if grown.high[axis] - grown.low[axis] > high - low {
                (grown.low[axis], grown.high[axis]) = (low, high);
            }
        }
        grown
    }

    /// Does it overlap another block or one of the other's periodic images?
    fn meets(&self, other: &Self, bed: &Self, periodic: [bool; 3]) -> bool {
        (0..3).all(|axis| {
            let period = if periodic[axis] { bed.high[axis] - bed.low[axis] } else { 0.0 };
            [-period, 0.0, period].into_iter().any(|shift| {
                other.low[axis] + shift < self.high[axis]
                    && other.high[axis] + shift > self.low[axis]
            })
        })
    }
}

/// Volume of all particles [m³].
fn solid_volume(scene: &Scene) -> f64 {
    let counts = counts(scene);
    counts.iter().zip(&scene.library.shapes).map(|(of, shape)| of.volume * shape.volume()).sum()
}

/// Particles of a shape.
#[derive(Clone, Copy, Default)]
struct OfShape {
    count: f64,
    /// Volume of all of them over that of the shape.
    volume: f64,
}

impl OfShape {
    /// Mean volume over that of the shape.
    fn mean_volume(self) -> f64 {
        if self.count > 0.0 { self.volume / self.count } else { 1.0 }
    }
}

/// Expected number of particles of each shape; mixes count by their shares.
fn counts(scene: &Scene) -> Vec<OfShape> {
    let mut counts = vec![OfShape::default(); scene.library.particle_shapes];
    let mut mixes: Vec<(&Mix, u64)> = scene.to_come().collect();
    for fill in &scene.initial {
        match fill {
            Fill::Lattice(lattice) => mixes.push((&lattice.mix, fill.count())),
            Fill::Listed(list) => {
                for row in list {
                    let of_shape = &mut counts[row.shape.index()];
                    of_shape.count += 1.0;
                    of_shape.volume += row.scale.powi(3);
                }
            }
        }
    }
    for (mix, count) in mixes {
        for (shape, share) in mix.shares() {
            let of_shape = &mut counts[shape.index()];
            let number = share * count as f64;
            of_shape.count += number;
            of_shape.volume += number * scene.library.sizes[shape.index()].mean_volume();
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::{Block, Sizes};
    use crate::cell::Cell;
    use crate::math::Vec3;
    use crate::random::Random;

    /// Two sizes, 1:5, at random in a box that two ranks share and that repeats along their border: ghosts
    /// counted one by one.
    #[test]
    fn ghosts_of_unequal_sizes_are_as_many_as_counted() {
        let bed = Block { low: Vec3::zeros(), high: Vec3::repeat(1.0) };
        let mut block = bed;
        block.high.x = 0.5;
        let (classes, skin) = ([(0.03, 600), (0.15, 20)], 0.01);
        let sizes =
            Sizes { classes: classes.map(|(radius, n)| (radius, f64::from(n))).to_vec(), skin };
        let estimate = sizes.ghosts(&block, &bed, [false, true, true]);

        let (mut counted, draws) = (0, 400);
        for draw in 0..draws {
            let mut random = Random::of(3, draw);
            let mut bodies = Vec::new();
            for (radius, n) in classes {
                for _ in 0..n {
                    bodies.push((Vec3::from_fn(|_, _| random.unit()), radius));
                }
            }
            let (here, there): (Vec<_>, Vec<_>) = bodies.into_iter().partition(|(p, _)| p.x < 0.5);
            let cell = Cell::new(Vec3::zeros(), Vec3::repeat(1.0), [false, true, true]);
            let is_paired = |(p, r): &&(Vec3, f64)| {
                here.iter().any(|(q, s)| cell.nearest(p - q).norm() < r + s + skin)
            };
            counted += there.iter().filter(is_paired).count();
        }
        let counted = counted as f64 / draws as f64;
        assert!((estimate / counted - 1.0).abs() < 0.05, "{estimate} but {counted}");
        let within_the_largest_reach = 0.31 * 620.0;
        assert!(estimate < 0.5 * within_the_largest_reach, "{estimate}");
    }
}
