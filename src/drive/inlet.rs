//! Inlets: regions in which grains appear at a rate.
//!
//! What is due is a function of the clock of the stage alone: the rate times the time since the inlet began.
//!
//! A grain of an inlet has a number, and shape, size, orientation and velocity of its number under the scene's seed: a large
//! one that finds no place is not replaced by a smaller one, it waits, and those behind it wait. Its place is drawn anew at
//! each try, of which a grain has [`TRIES`] at a time. A try fails where the grain's bounding sphere would meet that of
//! a grain that is there, reach behind a wall, or meet that of a new one of a lower number. Each rank looks at its own
//! grains alone, and one sum over all ranks tells which tries are free; the rest is the same on all ranks. So are the grains,
//! whatever the number of ranks. At most [`MOST_AT_ONCE`] grains of an inlet appear at a time, so no rank has a list of more.

use super::listed::Listed;
use super::region::Region;
use super::{Drive, DriveError, Moment, Newcomers, SavedColumn, SavedState, Values};
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::particles::mix::Mix;
use crate::particles::orientations::Orientations;
use crate::particles::records::Particle;
use crate::particles::walls::{Wall, met_by};
use crate::particles::{Library, Particles};
use crate::random::{Random, mixed};
use serde::{Deserialize, Serialize};

/// How often a grain looks for a place at one time.
pub const TRIES: usize = 50;
/// How many grains of an inlet appear at one time at most.
pub const MOST_AT_ONCE: u64 = 1000;
/// So many grains look for places before it is asked whether one has found none.
const TOGETHER: usize = 32;
/// Names the random numbers of inlets.
const STREAM: u64 = 0x696e_6c65_7473;

/// A rate, or an amount.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Amount {
    /// Grains.
    Count(f64),
    /// Mass [kg].
    Mass(f64),
}

/// Where grains appear, and how many.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inlet {
    /// Its name in the scene.
    pub name: String,
    /// Which shapes, and their share of the grains by number.
    pub mix: Mix,
    /// Where centres of grains appear; it has an end.
    pub region: Region,
    /// Per second.
    pub rate: Amount,
    /// It begins so long after the beginning of the stage [s].
    pub begin: f64,
    /// After so many it ends; `None`: never.
    pub until: Option<Amount>,
    /// Steps between times at which grains appear.
    pub every: u64,
    /// Mean velocity at the start [m/s].
    pub velocity: Vec3,
    /// Each component of the velocity differs from its mean by up to this, at random [m/s].
    pub spread: f64,
    /// Each component of the angular velocity differs from 0 by up to this, at random [rad/s].
    pub spin: f64,
    /// Orientations.
    pub orientations: Orientations,
    /// Does it keep a list of its grains?
    pub list: bool,
}

impl Inlet {
    /// Has what was asked for come, with so many grains and so much mass [kg]? Never, if it feeds without an end.
    fn is_over(&self, count: u64, mass: f64) -> bool {
        match self.until {
            Some(Amount::Count(most)) => count as f64 >= most,
            Some(Amount::Mass(most)) => mass >= most,
            None => false,
        }
    }

    /// By number [1/s] and by mass [kg/s]; the one that is not given is 0.
    const fn rates(&self) -> [f64; 2] {
        match self.rate {
            Amount::Count(rate) => [rate, 0.0],
            Amount::Mass(rate) => [0.0, rate],
        }
    }

    /// Why it cannot go on in a stage that began with something else.
    fn unknown(&self, what: &str) -> DriveError {
        DriveError(format!(
            "inlet `{}` {what} when the stage began, and what is due is counted from then. Begin a new stage with the snapshot, \
             `start` in the scene",
            self.name
        ))
    }

    /// For how long it has fed at this time of the stage, both in s; less than 0 before it begins.
    fn fed_for(&self, stage_time: f64) -> f64 {
        // Rounding is forgiven: of the clock, which may be far ahead of the beginning of the inlet.
        stage_time * (1.0 + 1e-12) - self.begin
    }

    /// How many grains appear in a stage of so many seconds, about.
    pub fn expected(&self, seconds: f64, library: &Library) -> u64 {
        self.due_within(seconds - self.begin, library)
    }

    /// How many grains are due in so many seconds of those in which it feeds, about; no more than until its end.
    pub fn due_within(&self, seconds: f64, library: &Library) -> u64 {
        let mean = library.mean_over(&self.mix, |shape| library.mass[shape.index()]);
        let count = |amount: Amount| match amount {
            Amount::Count(count) => count,
            Amount::Mass(mass) => mass / mean,
        };
        let all = count(self.rate) * seconds.max(0.0);
        let all = self.until.map_or(all, |until| all.min(count(until)));
        // A whole number may come out a little above.
        (all * (1.0 - 1e-12)).ceil() as u64
    }

    /// In words, for `--plan`.
    pub fn words(&self) -> String {
        let amount = |amount: Amount, per: &str| match amount {
            Amount::Count(count) => format!("{count} particles{per}"),
            Amount::Mass(mass) => format!("{mass} kg{per}"),
        };
        let until =
            self.until.map_or_else(String::new, |until| format!(" until {}", amount(until, "")));
        let begin = if self.begin > 0.0 {
            format!(" from {:?} s of the stage on", self.begin)
        } else {
            String::new()
        };
        format!(
            "{}{begin}{until}, every {} steps, {}",
            amount(self.rate, " per second"),
            self.every,
            self.region.words()
        )
    }
}

/// What has come through an inlet in this stage.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Come {
    /// Grains, which is the number of the next one.
    pub count: u64,
    /// Their mass [kg].
    pub mass: f64,
    /// Grains or kg that were due and had found no place when last looked at.
    pub missing: f64,
}

/// The inlets of a running simulation.
#[derive(Clone, Debug)]
pub struct Inlets {
    all: Vec<Inlet>,
    seed: u64,
    come: Vec<Come>,
    /// Which have already warned.
    warned: Vec<bool>,
    warnings: Vec<String>,
    listed: Listed,
}

/// Names [`Inlets`] among the drives.
const NAME: &str = "inlets";
const NAMES: StateColumn = StateColumn::new("name", 1, "1");
const COUNT: StateColumn = StateColumn::new("entered", 1, "1");
const MASS: StateColumn = StateColumn::new("entered_mass", 1, "kg");
const MISSING: StateColumn = StateColumn::new("missing", 1, "1");
/// Of an inlet with a rate by mass 0.
const RATE: StateColumn = StateColumn::new("rate", 1, "1/s");
/// Of an inlet with a rate by number 0.
const MASS_RATE: StateColumn = StateColumn::new("mass_rate", 1, "kg/s");
const BEGIN: StateColumn = StateColumn::new("begin", 1, "s");

impl Inlets {
    /// Before the first grain.
    pub fn new(inlets: Vec<Inlet>, seed: u64) -> Self {
        let count = inlets.len();
        let (come, warned) = (vec![Come::default(); count], vec![false; count]);
        Self { all: inlets, seed, come, warned, warnings: Vec::new(), listed: Listed::default() }
    }

    /// What has come through each, in the order of the scene.
    pub fn come(&self) -> &[Come] {
        &self.come
    }

    /// A grain by its number, without place and id.
    fn grain(&self, inlet: usize, number: u64, moment: &Moment, library: &Library) -> Particle {
        let Inlet { mix, velocity, spread, spin, orientations, .. } = &self.all[inlet];
        // Another stage has other grains.
        let stage = moment.step - moment.stage_step;
        let mut random = Random::of(mixed(&[self.seed, STREAM, inlet as u64, stage]), number);
        let shape = mix.pick(random.unit());
        let scale = library.sizes[shape.index()].draw(&mut random);
        let quaternion = orientations.draw(&mut random);
        let off = Vec3::from_fn(|_, _| spread * random.signed());
        let still = Particle::at_rest(GlobalId(0), shape, Vec3::zeros());
        let grain = Particle { scale, quaternion, velocity: velocity + off, ..still };
        if *spin == 0.0 {
            return grain;
        }
        grain.spinning(Vec3::from_fn(|_, _| spin * random.signed()), library)
    }

    /// The grains that are due, in the order of their numbers.
    fn due(&self, inlet: usize, moment: &Moment, library: &Library) -> Vec<Particle> {
        let (of_inlet, come) = (&self.all[inlet], self.come[inlet]);
        let seconds = of_inlet.fed_for(moment.stage_time);
        let (mut count, mut mass) = (come.count, come.mass);
        let mut due = Vec::new();
        while count - come.count < MOST_AT_ONCE && !of_inlet.is_over(count, mass) {
            let grain = self.grain(inlet, count, moment, library);
            let of_grain = library.mass_at(grain.shape, grain.scale);
            let has_time = match of_inlet.rate {
                Amount::Count(rate) => (count + 1) as f64 <= rate * seconds,
                Amount::Mass(rate) => mass + of_grain <= rate * seconds,
            };
            if !has_time {
                break;
            }
            (count, mass) = (count + 1, mass + of_grain);
            due.push(grain);
        }
        due
    }

    /// What was due by the rate and the end and has not come, in the unit of the rate: grains or kg. `waiting` are the last of the
    /// grains that are `due`.
    fn missing(
        &self,
        inlet: usize,
        due: &[Particle],
        waiting: &[Particle],
        moment: &Moment,
        library: &Library,
    ) -> f64 {
        let (of_inlet, come) = (&self.all[inlet], self.come[inlet]);
        let count = come.count as f64;
        let by_rate = match of_inlet.rate {
            // As the grains that are due: one that is due by a rounding is one.
            Amount::Count(rate) => (rate * of_inlet.fed_for(moment.stage_time)).floor() - count,
            Amount::Mass(rate) => rate * (moment.stage_time - of_inlet.begin) - come.mass,
        };
        let Some(until) = of_inlet.until else { return by_rate };
        // Beyond a list that is cut off the end is known in the mean alone.
        let is_cut = due.len() as u64 >= MOST_AT_ONCE;
        let mean = || library.mean_over(&of_inlet.mix, |shape| library.mass[shape.index()]);
        let by_end = match (of_inlet.rate, until) {
            (Amount::Count(_), Amount::Count(most)) => most - count,
            (Amount::Mass(_), Amount::Mass(most)) => most - come.mass,
            (Amount::Count(_), Amount::Mass(most)) if is_cut => {
                ((most - come.mass) / mean()).ceil()
            }
            (Amount::Count(_), Amount::Mass(_)) => waiting.len() as f64,
            (Amount::Mass(_), Amount::Count(most)) if is_cut => (most - count) * mean(),
            (Amount::Mass(_), Amount::Count(most)) if count + waiting.len() as f64 >= most => {
                waiting.iter().map(|grain| library.mass_at(grain.shape, grain.scale)).sum()
            }
            (Amount::Mass(_), Amount::Count(_)) => return by_rate,
        };
        by_rate.min(by_end)
    }

    /// The grains of an inlet that find a place now, after those that have `entered` through others. Collective.
    fn enter(
        &mut self,
        inlet: usize,
        moment: &Moment,
        entered: &mut Vec<Particle>,
        particles: &Particles,
        comm: &mut dyn Comm,
    ) {
        let library = &particles.library;
        let due = self.due(inlet, moment, library);
        if due.is_empty() {
            self.come[inlet].missing = 0.0;
            return;
        }
        let region = &self.all[inlet].region;
        let stream = mixed(&[self.seed, STREAM, inlet as u64, moment.step]);
        let near = near(region, &due, particles);
        let first = self.come[inlet].count;
        let mut found = 0;
        // Where one finds no place, those behind it look for none.
        for (some, numbers) in due.chunks(TOGETHER).zip((first..).step_by(TOGETHER)) {
            let tries = (numbers..).zip(some).map(|(number, grain)| {
                let radius = library.radius[grain.shape.index()] * grain.scale;
                let mut random = Random::of(stream, number);
                let places = (0..TRIES).filter_map(|_| region.draw(&mut random)).collect();
                (radius, places)
            });
            let tries: Vec<(f64, Vec<Vec3>)> = tries.collect();
            let mut taken = taken_here(&near, &tries, particles);
            comm.sum(&mut taken);
            let before = found;
            for (k, (grain, (radius, places))) in some.iter().zip(&tries).enumerate() {
                let is_free = |place: &Vec3| {
                    entered.iter().all(|other| {
                        let reach = radius + library.radius[other.shape.index()] * other.scale;
                        let apart = particles.cell.nearest(place - other.position);
                        apart.norm_squared() > reach * reach
                    })
                };
                let mut free = places.iter().enumerate().filter(|(t, _)| taken[k * TRIES + t] == 0);
                let Some((_, place)) = free.find(|(_, place)| is_free(place)) else { break };
                entered.push(Particle { position: *place, ..grain.clone() });
                let come = &mut self.come[inlet];
                come.count += 1;
                come.mass += library.mass_at(grain.shape, grain.scale);
                found += 1;
            }
            if found - before < some.len() {
                break;
            }
        }
        let has_more = found as u64 == MOST_AT_ONCE && !self.due(inlet, moment, library).is_empty();
        self.note_missing(inlet, &due, found, has_more, (moment, library));
    }

    /// Notes grains for the list of an inlet that keeps one.
    fn note(&mut self, inlet: usize, moment: &Moment, grains: &[Particle]) {
        if self.all[inlet].list {
            let list = self.all[..inlet].iter().filter(|before| before.list).count();
            for grain in grains {
                self.listed.note(moment.step, list, grain.clone());
            }
        }
    }

    /// Grains that were due and have not come: those behind the first that have found a place, or there are more than can come
    /// at a time.
    fn note_missing(
        &mut self,
        inlet: usize,
        due: &[Particle],
        found: usize,
        has_more: bool,
        (moment, library): (&Moment, &Library),
    ) {
        let waiting = &due[found..];
        let is_short = has_more || !waiting.is_empty();
        let missing =
            if is_short { self.missing(inlet, due, waiting, moment, library) } else { 0.0 };
        self.come[inlet].missing = missing;
        if is_short && !self.warned[inlet] {
            self.warned[inlet] = true;
            let name = &self.all[inlet].name;
            let (step, waiting) = (moment.step, waiting.len());
            self.warnings.push(if has_more {
                format!(
                    "inlet `{name}`: at step {step} more than {MOST_AT_ONCE} of its particles are due, and no more come at a time; the others \
                     wait. Make `every` smaller"
                )
            } else {
                format!(
                    "inlet `{name}`: at step {step} {waiting} of its particles found no place and wait; they come when there is one. If this \
                     goes on, the rate is more than its region and `velocity` carry away"
                )
            });
        }
    }
}

/// Centres and bounding radii of the particles of this rank that are near a region where grains are due [m].
fn near(region: &Region, due: &[Particle], particles: &Particles) -> Vec<(Vec3, f64)> {
    let library = &particles.library;
    let radius = |grain: &Particle| library.radius[grain.shape.index()] * grain.scale;
    let largest = due.iter().map(radius).fold(0.0, f64::max);
    let Some((low, high)) = region.bounds() else { return Vec::new() };
    let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5 + Vec3::repeat(largest));
    (0..particles.owned)
        .filter(|&slot| particles.comes_into(slot, &middle, &half))
        .map(|slot| (particles.position[slot], particles.radius(slot)))
        .collect()
}

/// For every try of every grain 1 if one of these particles stands in its place, or a wall.
fn taken_here(near: &[(Vec3, f64)], tries: &[(f64, Vec<Vec3>)], particles: &Particles) -> Vec<i64> {
    let mut taken = Vec::with_capacity(tries.len() * TRIES);
    for (radius, places) in tries {
        for place in places {
            let by_particle = near.iter().any(|(position, other)| {
                let reach = radius + other;
                particles.cell.nearest(place - position).norm_squared() <= reach * reach
            });
            let by_wall = || met_by(&particles.walls, &particles.cell, place, *radius).is_some();
            taken.push(i64::from(by_particle || by_wall()));
        }
    }
    taken
}

impl Drive for Inlets {
    fn name(&self) -> &'static str {
        NAME
    }

    fn insert(
        &mut self,
        moment: &Moment,
        first_id: u64,
        particles: &Particles,
        comm: &mut dyn Comm,
    ) -> Option<Newcomers> {
        let mut entered = Vec::new();
        for inlet in 0..self.all.len() {
            if moment.stage_step.is_multiple_of(self.all[inlet].every) {
                let before = entered.len();
                self.enter(inlet, moment, &mut entered, particles, comm);
                for (id, particle) in (first_id..).zip(&mut entered).skip(before) {
                    particle.id = GlobalId(id);
                }
                self.note(inlet, moment, &entered[before..]);
            }
        }
        (!entered.is_empty()).then(|| Newcomers::of(entered))
    }

    fn unfinished(&self) -> Option<&'static str> {
        let mut all = self.all.iter().zip(&self.come);
        let feeds = |(inlet, come): (&Inlet, &Come)| {
            inlet.until.is_some() && !inlet.is_over(come.count, come.mass)
        };
        all.any(feeds).then_some("an inlet has not come to its end")
    }

    fn counted(&self) -> Vec<(String, f64)> {
        let of_one = |(Inlet { name, rate, .. }, come): (&Inlet, &Come)| {
            let unit = if matches!(rate, Amount::Mass(_)) { "_kg" } else { "" };
            [
                (format!("entered_{name}"), come.count as f64),
                (format!("entered_{name}_kg"), come.mass),
                (format!("missing_{name}{unit}"), come.missing),
            ]
        };
        self.all.iter().zip(&self.come).flat_map(of_one).collect()
    }

    fn lists(&self) -> Vec<String> {
        let listing = self.all.iter().filter(|inlet| inlet.list);
        listing.map(|Inlet { name, .. }| format!("entered_{name}")).collect()
    }

    fn listed(&mut self) -> Vec<(usize, Particle)> {
        self.listed.take()
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn last_warnings(&self, _walls: &[Wall], has_stopped: bool) -> Vec<String> {
        let mut warnings = Vec::new();
        for (inlet, come) in self.all.iter().zip(&self.come) {
            let Inlet { name, rate, until, .. } = inlet;
            if come.missing > 0.0 {
                let missing = match rate {
                    Amount::Count(_) => format!("{} particles", come.missing),
                    Amount::Mass(_) => format!("{:.4e} kg", come.missing),
                };
                warnings.push(format!(
                    "inlet `{name}`: {missing} that were due have not come; {} particles, {:.4e} kg, came",
                    come.count, come.mass
                ));
            }
            if has_stopped || inlet.is_over(come.count, come.mass) {
                continue;
            }
            let short = match *until {
                Some(Amount::Count(most)) => format!("{} of {most} particles", come.count),
                Some(Amount::Mass(most)) => format!("{:.4e} of {most:?} kg", come.mass),
                None => continue,
            };
            warnings.push(format!("inlet `{name}`: only {short} came: too few steps, no place, or more than {MOST_AT_ONCE} due at a time"));
        }
        warnings
    }

    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        let names = self.all.iter().map(|inlet| inlet.name.clone()).collect();
        let reals =
            |of: fn(&Come) -> f64| Values::Reals(self.come.iter().map(of).collect::<Vec<_>>());
        vec![
            SavedColumn::new(NAMES, Values::Texts(names)),
            SavedColumn::new(
                COUNT,
                Values::Counts(self.come.iter().map(|come| come.count).collect()),
            ),
            SavedColumn::new(MASS, reals(|come| come.mass)),
            SavedColumn::new(MISSING, reals(|come| come.missing)),
            SavedColumn::new(
                RATE,
                Values::Reals(self.all.iter().map(|of| of.rates()[0]).collect()),
            ),
            SavedColumn::new(
                MASS_RATE,
                Values::Reals(self.all.iter().map(|of| of.rates()[1]).collect()),
            ),
            SavedColumn::new(BEGIN, Values::Reals(self.all.iter().map(|of| of.begin).collect())),
        ]
    }

    /// A new stage begins with the first grain.
    fn resume(
        &mut self,
        saved: &SavedState,
        is_new_stage: bool,
        _walls: &mut [Wall],
        _is_root: bool,
    ) -> Result<(), DriveError> {
        if is_new_stage {
            return Ok(());
        }
        let (counts, masses) = (saved.counts(&COUNT)?, saved.reals(&MASS)?);
        let missing = saved.reals(&MISSING)?;
        let (rates, mass_rates) = (saved.reals(&RATE)?, saved.reals(&MASS_RATE)?);
        // Older snapshots have none: all of their inlets began with the stage.
        let begins = saved.reals(&BEGIN).ok();
        let names = saved.texts(&NAMES)?;
        for (inlet, come) in self.all.iter().zip(&mut self.come) {
            let Some(row) = names.iter().position(|name| inlet.name == *name) else {
                return Err(inlet.unknown("was not there"));
            };
            let before = [rates[row], mass_rates[row]];
            if inlet.rates() != before {
                let had = match before {
                    [0.0, mass] => format!("had a mass_rate of {mass:?}"),
                    [count, _] => format!("had a rate of {count:?}"),
                };
                return Err(inlet.unknown(&had));
            }
            let begin = begins.map_or(0.0, |begins| begins[row]);
            if inlet.begin != begin {
                return Err(inlet.unknown(&format!("had a begin of {begin:?}")));
            }
            *come = Come { count: counts[row], mass: masses[row], missing: missing[row] };
        }
        Ok(())
    }

    fn joins(&mut self) -> Result<(), DriveError> {
        self.all.first().map_or(Ok(()), |inlet| Err(inlet.unknown("was not there")))
    }
}

#[cfg(test)]
mod tests {
    use super::{Amount, Inlet};
    use crate::drive::region::Region;
    use crate::ids::ShapeId;
    use crate::math::Vec3;
    use crate::particles::mix::Mix;
    use crate::particles::orientations::Orientations;

    /// Grain by grain at the times at which they are due, when the clock is far ahead of the time between two.
    #[test]
    fn the_clock_is_rounded_and_no_grain_late() {
        let (rate, dt) = (1e5, 1e-5);
        for begin in [0.0, 0.1, 1.0, 7.3] {
            let inlet = Inlet {
                name: "tap".to_owned(),
                mix: Mix::new(&[(ShapeId(0), 1.0)]),
                region: Region::Box { low: Vec3::zeros(), high: Vec3::repeat(1.0) },
                rate: Amount::Count(rate),
                begin,
                until: None,
                every: 1,
                velocity: Vec3::zeros(),
                spread: 0.0,
                spin: 0.0,
                orientations: Orientations::Random,
                list: false,
            };
            let first = (begin / dt).round() as u64;
            for step in first..first + 1000 {
                let due = rate * inlet.fed_for(step as f64 * dt);
                assert_eq!(due.floor() as u64, step - first, "{begin}: {due}");
            }
            assert!(begin == 0.0 || inlet.fed_for(begin - dt) < 0.0);
        }
    }
}
