//! Sizes of the particles at the end of a run against those requested in the scene: particles present, and particles that
//! have left.

use crate::comm::Comm;
use crate::drive::Drive;
use crate::ids::ShapeId;
use crate::output::report::sizes::{Below, Figures, SizesOf};
use crate::particles::Particles;
use crate::population::census::Census;
use crate::population::sizes::{By, Distribution};

/// Sizes for every shape that has or had particles and has a law of sizes in the scene. They are the same on all ranks, for
/// any number of ranks. Collective.
pub fn sizes(
    particles: &Particles,
    drives: &[Box<dyn Drive>],
    comm: &mut dyn Comm,
) -> Vec<SizesOf> {
    let library = &particles.library;
    let laws = library.sizes.iter().enumerate().filter_map(|(index, sizes)| {
        Some((ShapeId(index as u16), sizes.distribution()?, sizes.words()))
    });
    let mut all = Vec::new();
    for (shape, asked, law) in laws {
        let Some(mut found) = Census::of_shape(shape, library) else { continue };
        for slot in (0..particles.owned).filter(|&slot| particles.shape[slot] == shape) {
            found.add(particles.scale_of(slot));
        }
        comm.sum(found.sums_mut());
        let present = found.count();
        for left in drives.iter().flat_map(|drive| drive.sizes_left(shape)) {
            found.add_all(left.sums());
        }
        if found.count() == 0 {
            continue;
        }
        let below = [By::Number, By::Mass].map(|by| (by, found.below(by)));
        let difference = below.each_ref().map(|(by, below)| {
            let off = |(k, below): (usize, &f64)| (asked.below(*by, found.edge(k)) - below).abs();
            below.iter().enumerate().map(off).fold(0.0, f64::max)
        });
        all.push(SizesOf {
            shape: library.names[shape.index()].clone(),
            law,
            particles: found.count() as u64,
            left: (found.count() - present) as u64,
            asked: figures_of(&asked),
            found: figures(&found, &below),
            largest_difference_by_number: difference[0],
            largest_difference_by_mass: difference[1],
            curve: curve(&asked, &found, &below),
        });
    }
    all
}

fn curve(asked: &Distribution, found: &Census, below: &[(By, Vec<f64>); 2]) -> Vec<Below> {
    let step = Census::CELLS / SizesOf::ROWS;
    let [(_, by_number), (_, by_mass)] = below;
    let row = |edge: usize| {
        let scale = found.edge(edge);
        Below {
            scale,
            asked_by_number: asked.below(By::Number, scale),
            found_by_number: by_number[edge],
            asked_by_mass: asked.below(By::Mass, scale),
            found_by_mass: by_mass[edge],
        }
    };
    (0..=SizesOf::ROWS).map(|k| row(k * step)).collect()
}

/// Figures of the law.
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

/// Figures of the particles.
fn figures(found: &Census, below: &[(By, Vec<f64>); 2]) -> Figures {
    let [by_number, by_mass] = below.each_ref().map(|(_, below)| {
        [0.1, 0.5, 0.9].map(|share| {
            let edge = (1..Census::CELLS).find(|&edge| below[edge] >= share);
            let edge = edge.unwrap_or(Census::CELLS);
            let [low, high] = [below[edge - 1], below[edge]];
            let part = if high > low { (share - low) / (high - low) } else { 1.0 };
            let [a, b] = [edge - 1, edge].map(|edge| found.edge(edge));
            a + (b - a) * part.clamp(0.0, 1.0)
        })
    });
    let [one, two, three] = found.mean_powers();
    Figures {
        by_number_d10_d50_d90: by_number,
        by_mass_d10_d50_d90: by_mass,
        mean: one,
        deviation: (two - one * one).max(0.0).sqrt(),
        sauter_mean: if two > 0.0 { three / two } else { 0.0 },
    }
}
