//! Audit of contacts: at regular steps a sample of the touching contacts is resolved again, to convergence ([`Converged`]).
//! The errors of the run's own results are kept for the report. The audit does not change the simulation.
//!
//! Seed, step and ids determine the sample, and the owner of A resolves a contact, so the results do not depend on the
//! number of ranks. Counts and largest errors cover all contacts resolved. For very many contacts, medians and percentiles
//! cover those with the 4,096 smallest random numbers. Only touching contacts are audited: a contact that a method wrongly
//! takes for separate is not found.
//!
//! Contacts of unions are left out: no resolver finds them, they are made of contacts of pieces.
//!
//! Cost: a contact takes 14 µs for ellipsoids, about 50 µs for superellipsoids, 2 µs for polyhedra, less than 1 µs for
//! spheres. A fiftieth of the contacts every 1,000 steps takes 0.2 % of the time of settled ellipsoids, less for all
//! others.

use super::Simulation;
use crate::comm::{Comm, wire};
use crate::contact::{Converged, Geometry, Outcome, Pair, Touch, ordered};
use crate::math::{ExactSum, larger_number};
use crate::measure::shortest_axis;
use crate::output::report::audit::{Audit, KindErrors, Spread};
use crate::random::mixed;
use crate::shape::Kind;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Settings of the audit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// Steps between audits; 0 for none.
    pub every: u64,
    /// Mean number of contacts over all ranks at each audit; `None` for [`Settings::ONE_OF`] and [`Settings::MOST`].
    pub contacts: Option<u64>,
    /// Seed of the sample.
    pub seed: u64,
}

impl Settings {
    /// Default number of steps between audits.
    pub const EVERY: u64 = 1000;
    /// By default one of this number of contacts is resolved again ...
    pub const ONE_OF: f64 = 50.0;
    /// ... but at most this number.
    pub const MOST: f64 = 1000.0;

    /// Sample and cost, for `--plan`.
    pub fn words(&self) -> String {
        let Self { every, contacts, seed: _ } = self;
        let sample = contacts.map_or_else(
            || format!("one contact in {}, {} at most,", Self::ONE_OF, Self::MOST),
            |contacts| format!("about {contacts} contacts"),
        );
        let is_cheap = contacts.is_none() && *every >= Self::EVERY;
        let cost = if is_cheap { ": less than 1 % of the time" } else { "" };
        format!("every {every} steps {sample} resolved again, 0.2 to 60 µs each{cost}")
    }

    /// Part of `touching` contacts that is resolved again.
    fn sample(&self, touching: f64) -> f64 {
        // A quarter at most: with very few contacts the audit would take longer than the steps.
        let usual = (touching / Self::ONE_OF).max(1.0).min(0.25 * touching).min(Self::MOST);
        self.contacts.map_or(usual, |contacts| contacts as f64) / touching
    }
}

/// Smallest number of errors that is kept for each pair of kinds, over all ranks.
const KEPT: usize = 4096;

/// Number of terms after which digits are carried, far below the capacity of an [`ExactSum`].
const TERMS: u64 = 1 << 20;

/// Indices of errors.
const OVERLAP: usize = 0;
const RELATIVE: usize = 1;
const NORMAL: usize = 2;
const POINT: usize = 3;
const FORCE: usize = 4;

/// Errors of one contact: overlap and point over the shortest axis, relative overlap, angle [rad], force [N]. NaN where
/// undefined.
type Errors = [f64; 5];

/// Results of the audits of a run so far, on this rank.
#[derive(Clone, Debug)]
pub struct Auditor {
    settings: Settings,
    audits: u64,
    of_kinds: BTreeMap<(Kind, Kind), Found>,
}

/// Results for contacts between two kinds.
#[derive(Clone, Debug, Default)]
struct Found {
    contacts: u64,
    spurious: u64,
    unresolved: u64,
    /// Sum of the magnitudes of the true elastic forces [N].
    force: ExactSum,
    largest: Errors,
    /// Random number and errors of some contacts.
    kept: Vec<(u64, Errors)>,
}

impl Auditor {
    /// Auditor before the first step.
    pub const fn new(settings: Settings) -> Self {
        Self { settings, audits: 0, of_kinds: BTreeMap::new() }
    }

    /// Returns the results so far and resets them.
    pub(super) const fn take(&mut self) -> Self {
        std::mem::replace(self, Self::new(self.settings))
    }

    /// Is there an audit after this step?
    pub const fn is_due(&self, step: u64) -> bool {
        self.settings.every > 0 && step.is_multiple_of(self.settings.every)
    }

    /// Resolves a sample again. Contacts must belong to the positions. Collective.
    pub fn look(&mut self, sim: &Simulation, comm: &mut dyn Comm) {
        // Contacts of unions consist of those of their pieces.
        let particles = &sim.particles;
        let is_audited =
            |pair: Pair| pair.a.index() < particles.owned && particles.body_of(pair.b) == pair.b;
        let mut touching =
            [sim.contacts.iter().filter(|&(pair, _)| is_audited(pair)).count() as i64];
        comm.sum(&mut touching);
        self.audits += 1;
        if touching[0] == 0 {
            return;
        }
        // A sample above 1 saturates and takes all contacts.
        let highest = (self.settings.sample(touching[0] as f64) * 2f64.powi(64)) as u64;
        for (pair, touch) in sim.contacts.touches(particles).filter(|&(pair, _)| is_audited(pair)) {
            let [a, b] = [pair.a, pair.b].map(|slot| sim.particles.id[slot.index()].0);
            let number = mixed(&[self.settings.seed, sim.step, a, b]);
            if number <= highest {
                // A new random number, because those of the sample are all small.
                self.resolve(sim, pair, &touch, mixed(&[number]));
            }
        }
    }

    fn resolve(&mut self, sim: &Simulation, pair: Pair, touch: &Touch, number: u64) {
        let bodies = sim.particles.bodies();
        let kinds = ordered((bodies.shape_of(pair.a).kind(), bodies.shape_of(pair.b).kind()));
        let Some(resolver) = sim.resolvers.get(kinds) else { return };
        let frames = bodies.frames(pair);
        let (a, b) = bodies.posed(pair, &frames);
        let converged = Converged::of(kinds, resolver.definition());
        let outcome = converged.touch(&a, &b, &bodies.relative(pair));
        let elastic =
            |normal, overlap| sim.law.elastic(pair, &sim.particles, &Geometry { normal, overlap });
        let axis = shortest_axis(&sim.particles, pair.a, pair.b);
        let found = self.of_kinds.entry(kinds).or_default();
        found.contacts += 1;
        let Touch { overlap, normal, point } = *touch;
        let force = elastic(normal, overlap);
        let errors = match outcome {
            Outcome::Touching(truth) => {
                let true_force = elastic(truth.normal, truth.overlap);
                found.add_force(true_force.abs());
                [
                    (overlap - truth.overlap).abs() / axis,
                    (overlap / truth.overlap - 1.0).abs(),
                    libm::atan2(normal.cross(&truth.normal).norm(), normal.dot(&truth.normal)),
                    (point - truth.point).norm() / axis,
                    (force - true_force).abs(),
                ]
            }
            // Adhesive contacts exist across a gap.
            Outcome::Apart(clearance) if overlap <= 0.0 => {
                let true_force = elastic(normal, -clearance);
                found.add_force(true_force.abs());
                let [off, force] = [(overlap + clearance).abs(), (force - true_force).abs()];
                [off / axis, f64::NAN, f64::NAN, f64::NAN, force]
            }
            Outcome::Apart(clearance) => {
                found.spurious += 1;
                [(overlap + clearance) / axis, f64::NAN, f64::NAN, f64::NAN, force.abs()]
            }
            Outcome::Failed(_) => {
                found.unresolved += 1;
                return;
            }
        };
        found.keep(number, errors);
    }

    /// Figures over all ranks, on rank 0; elsewhere without those by kinds. Collective.
    pub fn figures(&self, sim: &Simulation, comm: &mut dyn Comm) -> Audit {
        let all = Kind::ALL.into_iter().enumerate();
        let pairs = all.flat_map(|(k, a)| Kind::ALL[k..].iter().map(move |&b| (a, b)));
        let none = Found::default();
        let mut of_kinds = Vec::new();
        let mut contacts = 0;
        for kinds in pairs {
            let Some(resolver) = sim.resolvers.get(kinds) else { continue };
            let here = self.of_kinds.get(&kinds).unwrap_or(&none);
            let Some((found, kept)) = here.of_all_ranks(comm) else { continue };
            contacts += found.contacts;
            if comm.is_root() {
                let against = Converged::of(kinds, resolver.definition()).name();
                let (a, b) = kinds;
                of_kinds.push(found.figures([a.name(), b.name()], resolver.name(), against, &kept));
            }
        }
        let Settings { every, seed, .. } = self.settings;
        let without_unions = !sim.particles.library.pieces.is_empty();
        Audit { every, seed, audits: self.audits, contacts, without_unions, of_kinds }
    }
}

impl Found {
    fn add_force(&mut self, force: f64) {
        // A state that is not finite is reported when the list of pairs is rebuilt.
        if force.is_finite() {
            self.force.add(force);
        }
        if self.contacts.is_multiple_of(TERMS) {
            self.force.carry();
        }
    }

    fn keep(&mut self, number: u64, errors: Errors) {
        for (largest, error) in self.largest.iter_mut().zip(errors) {
            *largest = larger_number(*largest, error);
        }
        self.kept.push((number, errors));
        if self.kept.len() >= 2 * KEPT {
            self.kept.select_nth_unstable_by_key(KEPT, |(number, _)| *number);
            self.kept.truncate(KEPT);
        }
    }

    /// Results of all ranks, and on rank 0 the errors that are kept; `None` if there are none. Collective.
    fn of_all_ranks(&self, comm: &mut dyn Comm) -> Option<(Self, Vec<Errors>)> {
        let counts = [self.contacts, self.spurious, self.unresolved].map(|count| count as i64);
        let mut numbers: Vec<i64> = counts.into_iter().chain(*self.force.limbs()).collect();
        let mut largest = self.largest;
        comm.sum(&mut numbers);
        comm.max(&mut largest);
        let (counts, limbs) = numbers.split_at(3);
        let [contacts, spurious, unresolved] = [0, 1, 2].map(|k| counts[k] as u64);
        if contacts == 0 {
            return None;
        }
        // With very many contacts each rank sends few, together about 2 `KEPT`.
        let share = 2.0 * KEPT as f64 / (contacts - unresolved).max(1) as f64;
        let highest = if share < 0.5 { (share * 2f64.powi(64)) as u64 } else { u64::MAX };
        let sent: Vec<&(u64, Errors)> =
            self.kept.iter().filter(|(number, _)| *number <= highest).collect();
        let gathered = comm.gather(wire::encode(&sent)).unwrap_or_default();
        let mut kept: Vec<(u64, Errors)> =
            gathered.iter().flat_map(|bytes| wire::decode::<Vec<(u64, Errors)>>(bytes)).collect();
        kept.sort_unstable_by_key(|(number, _)| *number);
        kept.truncate(KEPT);
        let force = ExactSum::from_limbs(limbs);
        let found = Self { contacts, spurious, unresolved, force, largest, kept: Vec::new() };
        Some((found, kept.into_iter().map(|(_, errors)| errors).collect()))
    }

    fn figures(
        &self,
        kinds: [&'static str; 2],
        method: &'static str,
        against: &'static str,
        kept: &[Errors],
    ) -> KindErrors {
        let Self { contacts, spurious, unresolved, .. } = *self;
        let touching = (contacts - spurious - unresolved).max(1);
        let mean_force = self.force.value() / touching as f64;
        let spread = |which: usize, unit: f64| spread(kept, which, self.largest[which], unit);
        KindErrors {
            kinds,
            method,
            against,
            contacts,
            spurious,
            unresolved,
            mean_force_n: mean_force,
            overlap: spread(OVERLAP, 1.0),
            relative_overlap: spread(RELATIVE, 1.0),
            normal_rad: spread(NORMAL, 1.0),
            point: spread(POINT, 1.0),
            force: spread(FORCE, mean_force),
        }
    }
}

/// Median, percentile and maximum of one of the errors, over a unit.
fn spread(all: &[Errors], which: usize, largest: f64, unit: f64) -> Spread {
    let mut errors: Vec<f64> = all.iter().map(|errors| errors[which]).collect();
    errors.retain(|error| !error.is_nan());
    if errors.is_empty() {
        return Spread { median: f64::NAN, p99: f64::NAN, max: f64::NAN };
    }
    errors.sort_by(f64::total_cmp);
    let at = |percent: usize| errors[(errors.len() - 1) * percent / 100] / unit;
    Spread { median: at(50), p99: at(99), max: largest / unit }
}
