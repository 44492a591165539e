//! Errors and times of every method on the pairs of one shape.

use crate::methods::{Contestant, Family};
use crate::pairs::{Grain, Pairs, Truth, common_normal};
use dem_mpi::contact::{Batch, Found, Geometry, Outcome, Touch};
use dem_mpi::shape::Kind;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Extent of the measurements.
pub(crate) struct Effort {
    pub(crate) pairs: u64,
    pub(crate) rounds: usize,
    /// Time for which a packing falls before it is timed [s].
    pub(crate) settling: f64,
    /// Least duration of one timing.
    least: Duration,
}

impl Effort {
    pub(crate) const FULL: Self =
        Self { pairs: 1024, rounds: 21, settling: 4.0, least: Duration::from_micros(200) };
    pub(crate) const QUICK: Self =
        Self { pairs: 128, rounds: 3, settling: 0.5, least: Duration::from_micros(5) };
}

/// Previous knowledge of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    Cold,
    /// The method's own normal, off by [`TURNED`], as it would be stored in a run. For separate pairs, which represent
    /// pairs that have just separated, the true normal.
    Warm,
}

impl Start {
    pub(crate) const BOTH: [Self; 2] = [Self::Cold, Self::Warm];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Cold => "cold",
            Self::Warm => "warm",
        }
    }
}

/// Rotation of a particle in a step [rad].
const TURNED: f64 = 1e-4;
/// Number of pairs timed together.
const TOGETHER: usize = 256;
/// Largest overlap and clearance [short axes].
const DEEPEST: f64 = 0.05;
const FARTHEST: f64 = 1.0;
/// Largest accepted difference between reference and common normal, relative to the longest axis.
const ROUNDING: f64 = 2e-14;

/// Nanoseconds per pair: median and quartiles over the rounds, of the mean over all pairs.
#[derive(Clone, Copy)]
pub(crate) struct Time {
    pub(crate) median: f64,
    pub(crate) quartiles: [f64; 2],
}

/// Distribution of the errors of many contacts.
#[derive(Clone, Copy)]
pub(crate) struct Spread {
    pub(crate) median: f64,
    pub(crate) p99: f64,
    pub(crate) max: f64,
}

impl Spread {
    fn of(mut values: Vec<f64>) -> Self {
        if values.is_empty() {
            return Self { median: f64::NAN, p99: f64::NAN, max: f64::NAN };
        }
        values.sort_by(f64::total_cmp);
        let at = |percent: usize| values[(values.len() - 1) * percent / 100];
        Self { median: at(50), p99: at(99), max: at(100) }
    }
}

/// Measured method and pairs.
#[derive(Clone)]
pub(crate) struct Entry {
    pub(crate) grain: String,
    pub(crate) start: Start,
    pub(crate) family: Family,
    pub(crate) settings: String,
    /// Family and settings in one text.
    pub(crate) method: String,
}

/// Results of a method on touching pairs. Lengths are in short axes.
pub(crate) struct Contacts {
    pub(crate) entry: Entry,
    pub(crate) time: Time,
    pub(crate) overlap: Spread,
    pub(crate) relative_overlap: Spread,
    /// Angle between the normals [rad].
    pub(crate) normal: Spread,
    pub(crate) point: Spread,
    pub(crate) missed: usize,
    pub(crate) failed: usize,
}

/// Results of a method on separate pairs.
pub(crate) struct Rejections {
    pub(crate) entry: Entry,
    pub(crate) time: Time,
    /// Number of pairs reported as touching.
    pub(crate) spurious: usize,
    pub(crate) failed: usize,
}

/// Measures everything on one shape.
pub(crate) fn grain(
    grain: &Grain,
    contestants: &[Contestant],
    effort: &Effort,
) -> (Vec<Contacts>, Vec<Rejections>) {
    let mut touching = Pairs::case_3(grain, effort.pairs, |unit| DEEPEST * unit);
    let apart = Pairs::case_3(grain, effort.pairs, |unit| -FARTHEST * unit);
    // Polyhedra are placed by all facets of their difference, which needs no check.
    if grain.shape.kind() != Kind::Polyhedron {
        check(&mut touching, grain);
    }
    let (mut contacts, mut rejections) = (Vec::new(), Vec::new());
    for start in Start::BOTH {
        let entry = |contestant: &Contestant| Entry {
            grain: grain.name.clone(),
            start,
            family: contestant.family,
            settings: contestant.settings.clone(),
            method: contestant.name(),
        };
        let remembered = |pairs: &Pairs| -> Vec<Vec<Geometry>> {
            let of = |contestant| match start {
                Start::Cold => pairs.strangers(),
                Start::Warm => warm(contestant, pairs),
            };
            contestants.iter().map(of).collect()
        };
        let geometries = remembered(&touching);
        let times = times(contestants, &touching, &geometries, effort);
        for ((contestant, geometry), time) in contestants.iter().zip(&geometries).zip(times) {
            contacts.push(errors(contestant, &touching, geometry, entry(contestant), time));
        }
        let geometries = remembered(&apart);
        let times = self::times(contestants, &apart, &geometries, effort);
        for ((contestant, geometry), time) in contestants.iter().zip(&geometries).zip(times) {
            let found = resolve(contestant, &apart, geometry);
            let (spurious, failed) = (found.contacts.len(), found.failed.len());
            rejections.push(Rejections { entry: entry(contestant), time, spurious, failed });
        }
    }
    (contacts, rejections)
}

/// Checks that the pairs have the constructed overlap. Searches from the common normal's own start and from all axes of
/// both bodies must find this overlap, and none less. Superellipsoids may have several minima; the least overlap found
/// becomes the reference.
fn check(pairs: &mut Pairs, grain: &Grain) {
    let rounding = ROUNDING * grain.shape.bounding_radius();
    for index in 0..pairs.truth.len() {
        let mut truth = pairs.truth[index];
        let (a, b, r) = pairs.pair(index);
        let axes = [a.frame, b.frame].into_iter().flat_map(|frame| frame.column_iter());
        let starts = axes.flat_map(|axis| [Some(axis.into_owned()), Some(-axis)]);
        for start in starts.chain([None]) {
            let outcome = common_normal(&a, &b, &r, start.as_ref());
            if grain.shape.kind().is_ellipsoidal() {
                let Outcome::Touching(touch) = outcome else {
                    panic!("{}, pair {index}: {outcome:?}", grain.name)
                };
                let off = (touch.overlap - truth.overlap).abs();
                assert!(off <= rounding, "{}, pair {index}: overlap off by {off:e}", grain.name);
            } else if let Outcome::Touching(Touch { overlap, normal, point }) = outcome
                && overlap < truth.overlap - rounding
            {
                truth = Truth { overlap, normal, point };
            }
        }
        pairs.truth[index] = truth;
    }
}

/// Stored normals of the pairs, see [`Start::Warm`].
pub(crate) fn warm(contestant: &Contestant, pairs: &Pairs) -> Vec<Geometry> {
    let found = resolve(contestant, pairs, &pairs.strangers());
    pairs.acquaintances(&found.contacts, TURNED)
}

pub(crate) fn resolve(contestant: &Contestant, pairs: &Pairs, geometry: &[Geometry]) -> Found {
    let mut found = Found::default();
    contestant.resolver.resolve(&pairs.batch(geometry), &mut found);
    found
}

/// Time of each method. The methods run in turn, repeatedly, so that a busy machine slows all of them. They run on a
/// few pairs at a time, so that few samples are interrupted.
pub(crate) fn times(
    contestants: &[Contestant],
    pairs: &Pairs,
    geometries: &[Vec<Geometry>],
    effort: &Effort,
) -> Vec<Time> {
    let batches: Vec<Batch> = geometries.iter().map(|geometry| pairs.batch(geometry)).collect();
    let Some(&all) = batches.first() else { return Vec::new() };
    let mut found = Found::default();
    let mut sums = vec![[0.0; 3]; contestants.len()];
    for active in all.active.chunks(TOGETHER) {
        let mut samples = vec![Vec::new(); contestants.len()];
        for _ in 0..effort.rounds {
            for ((contestant, batch), samples) in contestants.iter().zip(&batches).zip(&mut samples)
            {
                let batch = Batch { active, ..*batch };
                let begin = Instant::now();
                let mut runs = 0;
                let spent = loop {
                    found.clear();
                    contestant.resolver.resolve(black_box(&batch), &mut found);
                    runs += 1;
                    let spent = begin.elapsed();
                    if spent >= effort.least {
                        break spent;
                    }
                };
                black_box(&found);
                samples.push(spent.as_secs_f64() * 1e9 / f64::from(runs));
            }
        }
        for (sums, samples) in sums.iter_mut().zip(&mut samples) {
            samples.sort_by(f64::total_cmp);
            for (quarter, sum) in (1..).zip(sums) {
                *sum += samples[(samples.len() - 1) * quarter / 4];
            }
        }
    }
    let per_pair = |sum: f64| sum / all.active.len() as f64;
    (sums.iter())
        .map(|sums| sums.map(per_pair))
        .map(|[low, median, high]| Time { median, quartiles: [low, high] })
        .collect()
}

fn errors(
    contestant: &Contestant,
    pairs: &Pairs,
    geometry: &[Geometry],
    entry: Entry,
    time: Time,
) -> Contacts {
    let found = resolve(contestant, pairs, geometry);
    let of_all = |error: &dyn Fn(&Touch, &Truth) -> f64| {
        let errors = found.contacts.iter().map(|contact| {
            let truth = &pairs.truth[contact.pair as usize];
            error(&contact.touch, truth)
        });
        Spread::of(errors.collect())
    };
    Contacts {
        time,
        overlap: of_all(&|touch, truth| (touch.overlap - truth.overlap).abs()),
        relative_overlap: of_all(&|touch, truth| (touch.overlap / truth.overlap - 1.0).abs()),
        normal: of_all(&|touch, truth| {
            touch.normal.cross(&truth.normal).norm().atan2(touch.normal.dot(&truth.normal))
        }),
        point: of_all(&|touch, truth| (touch.point - truth.point).norm()),
        missed: pairs.truth.len() - found.contacts.len() - found.failed.len(),
        failed: found.failed.len(),
        entry,
    }
}
