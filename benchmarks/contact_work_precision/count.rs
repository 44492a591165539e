//! Count of pairs whose common normal is not found, or is not that of least overlap.

use crate::pairs::{Pairs, direction};
use crate::record;
use benchmarking::machine::load;
use dem_mpi::contact::{CommonNormal, ContactResolver, Found, Outcome};
use dem_mpi::ids::ShapeId;
use dem_mpi::math::Vec3;
use dem_mpi::random::Random;
use dem_mpi::shape::{Ellipsoid, Shape};
use std::path::Path;

/// Number of pairs resolved together.
const CHUNK: u64 = 4096;
/// Largest difference of equal overlaps, relative to the longest semi-axis.
const ROUNDING: f64 = 1e-13;

#[derive(Default)]
struct Counted {
    pairs: u64,
    /// Pairs passed on to a fallback.
    not_converged: u64,
    missed: u64,
    /// Pairs for which another start leads to less overlap.
    wrong_minimum: u64,
    worst_overlap: f64,
}

/// Random ellipsoids of aspect ratios up to 10, touching by up to 5 % of the short axis. They are resolved without a
/// previous normal, in a batch, and again one by one from the twelve ends of their axes.
pub(crate) fn run(pairs: u64, folder: Option<&Path>) -> anyhow::Result<()> {
    let before = load(3);
    let mut counted = Counted::default();
    while counted.pairs < pairs {
        let count = CHUNK.min(pairs - counted.pairs);
        chunk(&mut counted, count);
        if counted.pairs.is_multiple_of(CHUNK * 64) {
            eprintln!("{} pairs", counted.pairs);
        }
    }
    let Counted { pairs, not_converged, missed, wrong_minimum, worst_overlap } = counted;
    let text = format!(
        "pairs: {pairs}\nnot converged: {not_converged}\nmissed: {missed}\nwrong minimum: {wrong_minimum}\n\
         largest error of the overlap, of the longest semi-axis: {worst_overlap:.1e}\n\
         {}load before: {before}\n",
        record::machine()
    );
    print!("{text}");
    folder.map_or(Ok(()), |folder| record::write_file(folder, "count.txt", &text))
}

fn chunk(counted: &mut Counted, count: u64) {
    let mut randoms: Vec<Random> = (0..count).map(|k| Random::of(10, counted.pairs + k)).collect();
    let library = randoms.iter_mut().flat_map(|random| [ellipsoid(random), ellipsoid(random)]);
    let mut pairs = Pairs::of(library.collect());
    for (k, random) in (0..).zip(&mut randoms) {
        let quaternions = [(); 2].map(|()| random.rotation());
        // The short axis of both is 1.
        let overlap = 0.05 * (1.0 - random.unit());
        pairs.push([ShapeId(2 * k), ShapeId(2 * k + 1)], quaternions, overlap, direction(random));
    }
    let mut found = Found::default();
    CommonNormal.resolve(&pairs.batch(&pairs.strangers()), &mut found);
    counted.not_converged += found.failed.len() as u64;
    counted.missed += found.apart.len() as u64;
    for contact in found.contacts.iter() {
        let index = contact.pair as usize;
        let (a, b, r) = pairs.pair(index);
        let size = a.shape.bounding_radius().max(b.shape.bounding_radius());
        let overlap = contact.touch.overlap;
        let error = (overlap - pairs.truth[index].overlap).abs() / size;
        counted.worst_overlap = counted.worst_overlap.max(error);
        let axes = [a.frame, b.frame].into_iter().flat_map(|frame| frame.column_iter());
        let mut starts = axes.flat_map(|axis| [axis.into_owned(), -axis]);
        let less = starts.any(|start| match CommonNormal.touch(&a, &b, &r, Some(&start)) {
            Outcome::Touching(other) => other.overlap < overlap - ROUNDING * size,
            Outcome::Apart(_) => overlap > ROUNDING * size,
            Outcome::Failed(_) => false,
        });
        counted.wrong_minimum += u64::from(less);
    }
    counted.pairs += count;
}

/// Semi-axes of 0.5 and of up to ten times that, uniform in the logarithm of the ratio.
fn ellipsoid(random: &mut Random) -> Shape {
    let mut longer = || 0.5 * 10f64.powf(random.unit());
    Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(longer(), longer(), 0.5) })
}
