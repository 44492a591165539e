//! The audit of contacts: every so many steps a sample of those that touch is resolved again, to convergence
//! ([`Converged`]), and the errors of the run's own answers are kept for the report. It changes nothing of the simulation.
//!
//! Seed, step and identifiers decide which contacts are in the sample, and who owns A resolves them: the same on any number of
//! ranks. Counts and largest errors are of all that were resolved; of very many, medians and percentiles are of those with the
//! 4,096 least random numbers. Only contacts that touch are looked at: what a method takes for apart is not.
//!
//! Contacts of unions are left out: no resolver finds them, they are made of contacts of pieces.
//!
//! Cost: a contact takes 14 µs of ellipsoids, about 50 µs of superellipsoids, 2 µs of polyhedra, less than 1 µs of spheres. A
//! fiftieth of the contacts every 1,000 steps takes 0.2 % of the time of settled ellipsoids, less of all others.

use super::Simulation;
use crate::comm::{Comm, wire};
use crate::contact::{Converged, Geometry, Outcome, Pair, Touch, ordered};
use crate::math::{ExactSum, larger_number};
use crate::measure::shortest_axis;
use crate::output::report::audit::{Audit, OfKinds, Spread};
use crate::random::mixed;
use crate::shape::Kind;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How contacts are audited.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// Steps between audits; 0: none.
    pub every: u64,
    /// So many contacts of all ranks at each, in the mean; `None`: [`Settings::ONE_OF`] and [`Settings::MOST`] decide.
    pub contacts: Option<u64>,
    /// Seed of the sample.
    pub seed: u64,
}

impl Settings {
    /// Steps between audits, if the user does not say.
    pub const EVERY: u64 = 1000;
    /// One contact of so many is resolved again at each, if the user does not say ...
    pub const ONE_OF: f64 = 50.0;
    /// ... but not more than this.
    pub const MOST: f64 = 1000.0;

    /// What is resolved again, and what it costs, for `--plan`.
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

    /// The part of `touching` contacts that is resolved again.
    fn sample(&self, touching: f64) -> f64 {
        // Of very few, the steps take no longer, but the audit would.
        let usual = (touching / Self::ONE_OF).max(1.0).min(0.25 * touching).min(Self::MOST);
        self.contacts.map_or(usual, |contacts| contacts as f64) / touching
    }
}

/// So many errors of each pair of kinds are kept at least, on all ranks together.
const KEPT: usize = 4096;

/// So many terms are summed before digits are carried: few of what an [`ExactSum`] holds.
const TERMS: u64 = 1 << 20;

/// Which errors.
const OVERLAP: usize = 0;
const RELATIVE: usize = 1;
const NORMAL: usize = 2;
const POINT: usize = 3;
const FORCE: usize = 4;

/// Errors of one contact: overlap and point over the shortest axis, relative overlap, angle [rad], force [N]. Not a number where
/// there is none.
type Errors = [f64; 5];

/// What the audits of a run have found so far, on this rank.
#[derive(Clone, Debug)]
pub struct Auditor {
    settings: Settings,
    audits: u64,
    of_kinds: BTreeMap<(Kind, Kind), Found>,
}

/// What was found of contacts between two kinds.
#[derive(Clone, Debug, Default)]
struct Found {
    contacts: u64,
    spurious: u64,
    unresolved: u64,
    /// Sum of the sizes of the elastic forces of those that are no error [N].
    force: ExactSum,
    largest: Errors,
    /// Random number and errors of some.
    kept: Vec<(u64, Errors)>,
}

impl Auditor {
    /// Before the first step.
    pub const fn new(settings: Settings) -> Self {
        Self { settings, audits: 0, of_kinds: BTreeMap::new() }
    }

    /// What was found so far; nothing is left.
    pub(super) const fn take(&mut self) -> Self {
        std::mem::replace(self, Self::new(self.settings))
    }

    /// Is there an audit after this step?
    pub const fn is_due(&self, step: u64) -> bool {
        self.settings.every > 0 && step.is_multiple_of(self.settings.every)
    }

    /// Resolves a sample again. Contacts must belong to the positions. Collective.
    pub fn look(&mut self, sim: &Simulation, comm: &mut dyn Comm) {
        // Contacts of unions are put together of those of their pieces.
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
        // Beyond 1 all are taken.
        let highest = (self.settings.sample(touching[0] as f64) * 2f64.powi(64)) as u64;
        for (pair, touch) in sim.contacts.touches(particles).filter(|&(pair, _)| is_audited(pair)) {
            let [a, b] = [pair.a, pair.b].map(|slot| sim.particles.id[slot.index()].0);
            let number = mixed(&[self.settings.seed, sim.step, a, b]);
            if number <= highest {
                // Of those taken, any number is as likely again.
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
            // Adhesion holds on across a gap.
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

    /// The figures of all ranks, on rank 0; elsewhere without those by kinds. Collective.
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
        // A state that is not a number is reported when the list of pairs is rebuilt.
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

    /// What all ranks have found, and on rank 0 the errors that are kept; `None` if nothing. Collective.
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
        // Of very many, each rank sends few: of all together, about 2 KEPT.
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
    ) -> OfKinds {
        let Self { contacts, spurious, unresolved, .. } = *self;
        let touching = (contacts - spurious - unresolved).max(1);
        let mean_force = self.force.value() / touching as f64;
        let spread = |which: usize, unit: f64| spread(kept, which, self.largest[which], unit);
        OfKinds {
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

/// Of one of the errors of many contacts, over a unit.
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
