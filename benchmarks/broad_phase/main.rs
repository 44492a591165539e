//! Growth of the time of the pair search with the number of particles, for equal and unequal sizes.
//!
//! ```text
//! cargo bench --bench broad_phase                        prints; a table and a plot go to target/
//! cargo bench --bench broad_phase -- --record FOLDER     the same into this folder
//! ```
//!
//! Balls are at random places and overlap; their volume is 0.6 of the box, so that there are as many
//! close pairs as in a packing. The time is the shortest of several repeats.

use benchmarking::lines::{self, Line};
use clap::Parser;
use dem_mpi::cell::Cell;
use dem_mpi::ids::{GlobalId, MaterialId, ShapeId};
use dem_mpi::math::Vec3;
use dem_mpi::particles::records::Particle;
use dem_mpi::particles::{Needs, Particles};
use dem_mpi::population::Library;
use dem_mpi::random::Random;
use dem_mpi::search::close_pairs;
use dem_mpi::shape::{Shape, Sphere};
use plotters::prelude::IntoLogRange;
use std::fmt::Write;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Parser)]
struct Arguments {
    /// Write the table and the plot into this folder.
    #[arg(long, value_name = "FOLDER", default_value = "target/broad-phase")]
    record: PathBuf,
    /// Cargo passes this.
    #[arg(long, hide = true)]
    bench: bool,
}

/// Largest radius over smallest.
const RATIO: f64 = 20.0;
/// Number of radii of a continuous distribution.
const STEPS: u32 = 32;
const SOLID: f64 = 0.6;
const REPEATS: u32 = 7;

/// Radii, each with its share of the particles by number.
type Mix = Vec<(f64, f64)>;

fn mixes() -> [(&'static str, Mix); 4] {
    let graded = |power: i32| {
        let radius = |k| RATIO.powf(f64::from(k) / f64::from(STEPS - 1) - 1.0);
        (0..STEPS).map(|k| (radius(k), radius(k).powi(power))).collect()
    };
    [
        ("equal", vec![(1.0, 1.0)]),
        ("two sizes 1:20, half the volume each", vec![(1.0, 1.0), (1.0 / RATIO, RATIO.powi(3))]),
        ("log-uniform 1:20 by volume", graded(-3)),
        ("log-uniform 1:20 by number", graded(0)),
    ]
}

/// `count` balls of a mix at random places. Numbers of each size are exact, at least one.
fn balls(mix: &Mix, count: usize) -> Particles {
    let total: f64 = mix.iter().map(|(_, share)| share).sum();
    let mut library = Library::default();
    let mut shapes = Vec::new();
    for &(radius, share) in mix {
        let shape = library.push("ball", Shape::Sphere(Sphere { radius }), MaterialId(0), 1.0);
        let number = (count as f64 * share / total).round().max(1.0) as usize;
        shapes.extend(std::iter::repeat_n(shape, number));
    }
    library.particle_shapes = mix.len();
    let volume = |shape: &ShapeId| library.shapes[shape.index()].volume();
    let side = (shapes.iter().map(volume).sum::<f64>() / SOLID).cbrt();
    let mut particles = Particles::new(Needs::default(), library, Vec::new(), Cell::OPEN);
    for (k, &shape) in shapes.iter().enumerate() {
        let mut random = Random::of(1, k as u64);
        let place = Vec3::from_fn(|_, _| 0.5 * side * random.signed());
        particles.push_owned(&Particle::at_rest(GlobalId(k as u64), shape, place));
    }
    particles
}

fn main() -> anyhow::Result<()> {
    let Arguments { record, .. } = Arguments::parse();
    std::fs::create_dir_all(&record)?;
    let mut table = "mix,particles,pairs,microseconds_per_particle\n".to_owned();
    let mut lines = Vec::new();
    for (name, mix) in mixes() {
        let mut points = Vec::new();
        for count in [1_000, 10_000, 100_000] {
            let particles = balls(&mix, count);
            let skin = 0.1 * mix.iter().map(|(radius, _)| radius).fold(f64::MAX, |a, &b| a.min(b));
            let mut pairs = 0;
            let mut least = f64::INFINITY;
            for _ in 0..REPEATS {
                let begin = Instant::now();
                pairs = close_pairs(&particles, skin).len();
                least = least.min(begin.elapsed().as_secs_f64());
            }
            let count = particles.owned;
            let each = 1e6 * least / count as f64;
            println!(
                "{name:<40} {count:>7} particles {pairs:>9} pairs {each:>8.3} µs per particle"
            );
            writeln!(table, "{name},{count},{pairs},{each:.4}")?;
            points.push((count as f64, 1e3 * least));
        }
        lines.push(Line { name: name.to_owned(), points });
    }
    std::fs::write(record.join("broad_phase.csv"), table.replace(", half", "; half"))?;
    let names = ["particles", "time of a list (ms)"];
    let (across, up) = ((800.0..2e5).log_scale(), (0.1..1e4).log_scale());
    lines::draw(&record.join("broad_phase.svg"), names, across, up, &lines)
}
