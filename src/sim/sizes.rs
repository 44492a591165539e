//! Which sizes particles have at the end of a run, beside those that the scene asks for.

use crate::comm::Comm;
use crate::ids::ShapeId;
use crate::output::report::sizes::{Below, Figures, SizesOf};
use crate::particles::Particles;
use crate::particles::sizes::{By, Distribution};

/// Squares and cubes of scales over the largest are summed in so many parts of 1: sums of 10^8 still fit.
const PARTS: f64 = (1_u64 << 36) as f64;

/// Of every shape of which there are particles and that has a law of sizes in the scene. The same on all ranks, whatever their number. Collective.
pub fn sizes(particles: &Particles, comm: &mut dyn Comm) -> Vec<SizesOf> {
    let library = &particles.library;
    let laws = library.sizes.iter().enumerate().filter_map(|(index, sizes)| {
        let shape = ShapeId(index as u16);
        sizes.distribution().map(|asked| (shape, asked, sizes.words()))
    });
    let laws: Vec<_> = laws.collect();
    laws.into_iter()
        .filter_map(|(shape, asked, law)| {
            let found = Found::of(shape, &asked, particles, comm);
            if found.count() == 0 {
                return None;
            }
            let curve = curve(&asked, &found);
            let difference = |by| {
                let edges = (0..=SizesOf::CELLS).map(|edge| (found.edge(edge), edge));
                edges
                    .map(|(s, k)| (asked.below(by, s) - found.below(by, k)).abs())
                    .fold(0.0, f64::max)
            };
            Some(SizesOf {
                shape: library.names[shape.index()].clone(),
                law,
                particles: found.count() as u64,
                asked: figures_of(&asked),
                found: found.figures(),
                largest_difference_by_number: difference(By::Number),
                largest_difference_by_mass: difference(By::Mass),
                curve,
            })
        })
        .collect()
}

fn curve(asked: &Distribution, found: &Found) -> Vec<Below> {
    let step = SizesOf::CELLS / SizesOf::ROWS;
    let row = |edge: usize| {
        let scale = found.edge(edge);
        Below {
            scale,
            asked_by_number: asked.below(By::Number, scale),
            found_by_number: found.below(By::Number, edge),
            asked_by_mass: asked.below(By::Mass, scale),
            found_by_mass: found.below(By::Mass, edge),
        }
    };
    (0..=SizesOf::ROWS).map(|k| row(k * step)).collect()
}

/// Of the law.
fn figures_of(asked: &Distribution) -> Figures {
    let [one, two, three] = asked.mean_powers();
    let tenths = |by| [0.1, 0.5, 0.9].map(|share| asked.quantile(by, share));
    Figures {
        by_number_d10_d50_d90: tenths(By::Number),
        by_mass_d10_d50_d90: tenths(By::Mass),
        mean: one,
        deviation: (two - one * one).max(0.0).sqrt(),
        sauter_mean: three / two,
    }
}

/// Particles of one shape, counted by size.
struct Found {
    limits: [f64; 2],
    /// Particles below each edge of the cells.
    number: Vec<i64>,
    /// Sum of their cubes, in parts of the largest.
    mass: Vec<i64>,
    /// Sums of scales and their squares, in parts of the largest.
    moments: [i64; 2],
}

impl Found {
    /// Collective.
    fn of(
        shape: ShapeId,
        asked: &Distribution,
        particles: &Particles,
        comm: &mut dyn Comm,
    ) -> Self {
        // A list may have given sizes beyond the law's.
        let [least, largest] = particles.library.scales[shape.index()];
        let limits = asked.limits();
        let limits = [least.min(limits[0]), largest.max(limits[1])];
        let cells = SizesOf::CELLS;
        let mut sums = vec![0_i64; 2 * (cells + 1) + 2];
        let (width, [least, largest]) = (libm::log(limits[1] / limits[0]), limits);
        for slot in (0..particles.owned).filter(|&slot| particles.shape[slot] == shape) {
            let scale = particles.scale_of(slot);
            let place = libm::log(scale / least) / width * cells as f64;
            // Counted below the upper edge of its cell.
            let edge = 1 + (place.max(0.0) as usize).min(cells - 1);
            let part = scale / largest;
            sums[edge] += 1;
            sums[cells + 1 + edge] += (part * part * part * PARTS) as i64;
            sums[2 * (cells + 1)] += (part * PARTS) as i64;
            sums[2 * (cells + 1) + 1] += (part * part * PARTS) as i64;
        }
        comm.sum(&mut sums);
        let below = |all: &[i64]| {
            let summed = all.iter().scan(0, |sum, &one| {
                *sum += one;
                Some(*sum)
            });
            summed.collect()
        };
        let (number, rest) = sums.split_at(cells + 1);
        let (mass, moments) = rest.split_at(cells + 1);
        let moments = [moments[0], moments[1]];
        Self { limits, number: below(number), mass: below(mass), moments }
    }

    fn count(&self) -> i64 {
        self.number[SizesOf::CELLS]
    }

    /// The scale at an edge of the cells.
    fn edge(&self, edge: usize) -> f64 {
        let [least, largest] = self.limits;
        least * libm::pow(largest / least, edge as f64 / SizesOf::CELLS as f64)
    }

    /// The share below an edge.
    fn below(&self, by: By, edge: usize) -> f64 {
        let shares = match by {
            By::Number => &self.number,
            By::Mass => &self.mass,
        };
        shares[edge] as f64 / shares[SizesOf::CELLS].max(1) as f64
    }

    fn figures(&self) -> Figures {
        let tenths = |by| {
            [0.1, 0.5, 0.9].map(|share| {
                let edge = (1..SizesOf::CELLS).find(|&edge| self.below(by, edge) >= share);
                let edge = edge.unwrap_or(SizesOf::CELLS);
                let [low, high] = [edge - 1, edge].map(|edge| self.below(by, edge));
                let part = if high > low { (share - low) / (high - low) } else { 1.0 };
                let [a, b] = [edge - 1, edge].map(|edge| self.edge(edge));
                a + (b - a) * part.clamp(0.0, 1.0)
            })
        };
        let largest = self.limits[1];
        let count = self.count().max(1) as f64;
        let [sum, squares] = self.moments.map(|sum| sum as f64 / PARTS);
        let (mean, square) = (sum / count, squares / count);
        let cubes = self.mass[SizesOf::CELLS] as f64 / PARTS;
        Figures {
            by_number_d10_d50_d90: tenths(By::Number),
            by_mass_d10_d50_d90: tenths(By::Mass),
            mean: mean * largest,
            deviation: (square - mean * mean).max(0.0).sqrt() * largest,
            sauter_mean: if squares > 0.0 { cubes / squares * largest } else { 0.0 },
        }
    }
}
