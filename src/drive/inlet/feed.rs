//! Inlets of a running simulation: particles that are due are placed.
//!
//! A particle of an inlet has a number. Its shape, size, orientation and velocity follow from this number and the scene's
//! seed. A large one that finds no place is not replaced by a smaller one: it waits, and those behind it wait too. Its
//! place is drawn anew at each try, and there are [`TRIES`] at a time. A try fails if the particle's bounding sphere meets
//! that of an existing particle or of a new one of a lower number, or reaches behind a wall. Each rank checks against its
//! own particles, and one sum over all ranks gives the free tries. The result is the same on all ranks, and does not
//! depend on their number. At most [`MOST_AT_ONCE`] particles of an inlet appear at a time, which limits the list on each
//! rank.

use super::{Amount, Inlet};
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::drive::lists::Lists;
use crate::drive::region::Region;
use crate::drive::{
    Drive, DriveError, Moment, Newcomers, Observer, Outcome, Reporter, Restart, SavedColumn,
    Standing,
};
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::particles::Particles;
use crate::particles::records::Particle;
use crate::population::Library;
use crate::random::{Random, mixed};
use crate::walls::{Wall, met_by};

/// Tries of a particle to find a place at one time.
pub const TRIES: usize = 50;
/// Largest number of particles of an inlet that appear at one time.
pub const MOST_AT_ONCE: u64 = 1000;
/// Number of particles that look for places together, before it is checked whether one has found none.
const TOGETHER: usize = 32;
/// Tag of the random numbers of inlets.
const STREAM: u64 = 0x696e_6c65_7473;

/// An inlet with its counts in this stage.
#[derive(Clone, Debug)]
struct Running {
    inlet: Inlet,
    /// Seed of the scene, and number of the inlet.
    names: [u64; 2],
    /// Number of particles so far, the number of the next one.
    count: u64,
    /// Their mass [kg].
    mass: f64,
    /// Particles, or mass in kg, that were due and had found no place at the last check.
    missing: f64,
    /// Has a warning been given?
    warned: bool,
}

/// The inlets of a running simulation.
#[derive(Clone, Debug)]
pub struct Inlets {
    all: Vec<Running>,
    warnings: Vec<String>,
    lists: Lists,
}

// Columns in a snapshot: a row for each inlet.
const NAMES: StateColumn = StateColumn::new("name", 1, "1");
const COUNT: StateColumn = StateColumn::new("entered", 1, "1");
const MASS: StateColumn = StateColumn::new("entered_mass", 1, "kg");
const MISSING: StateColumn = StateColumn::new("missing", 1, "1");
/// Rate by number; 0 for an inlet with a rate by mass.
const RATE: StateColumn = StateColumn::new("rate", 1, "1/s");
/// Rate by mass; 0 for an inlet with a rate by number.
const MASS_RATE: StateColumn = StateColumn::new("mass_rate", 1, "kg/s");
const BEGIN: StateColumn = StateColumn::new("begin", 1, "s");

impl Inlets {
    /// Inlets before the first particle.
    pub fn new(inlets: Vec<Inlet>, seed: u64) -> Self {
        let list = |Inlet { name, list, .. }: &Inlet| list.then(|| format!("entered_{name}"));
        let lists = Lists::new(inlets.iter().map(list));
        let running = |(inlet, number)| {
            let names = [seed, number];
            Running { inlet, names, count: 0, mass: 0.0, missing: 0.0, warned: false }
        };
        Self {
            all: inlets.into_iter().zip(0..).map(running).collect(),
            warnings: Vec::new(),
            lists,
        }
    }
}

impl Running {
    /// Tag of the random numbers of a step.
    fn stream(&self, step: u64) -> u64 {
        let [seed, number] = self.names;
        mixed(&[seed, STREAM, number, step])
    }

    /// Has the inlet reached its end?
    fn is_over(&self) -> bool {
        self.inlet.is_over(self.count, self.mass)
    }

    /// A particle by its number, without place and id.
    fn grain(&self, number: u64, moment: &Moment, library: &Library) -> Particle {
        let Inlet { mix, velocity, spread, spin, orientations, .. } = &self.inlet;
        // Another stage has other particles.
        let mut random = Random::of(self.stream(moment.step - moment.stage_step), number);
        let shape = mix.pick(random.unit());
        let scale = library.sizes[shape.index()].draw(&mut random);
        let quaternion = orientations.draw(&mut random);
        let off = Vec3::from_fn(|_, _| spread * random.signed());
        let still = Particle::at_rest(GlobalId(0), shape, Vec3::zeros());
        let group = self.inlet.group;
        let grain = Particle { scale, group, quaternion, velocity: velocity + off, ..still };
        if *spin == 0.0 {
            return grain;
        }
        grain.spinning(Vec3::from_fn(|_, _| spin * random.signed()), library)
    }

    /// Particles that are due, in the order of their numbers.
    fn due(&self, moment: &Moment, library: &Library) -> Vec<Particle> {
        let Self { inlet, .. } = self;
        let seconds = inlet.fed_for(moment.stage_time);
        let (mut count, mut mass) = (self.count, self.mass);
        let mut due = Vec::new();
        while count - self.count < MOST_AT_ONCE && !inlet.is_over(count, mass) {
            let grain = self.grain(count, moment, library);
            let of_grain = library.mass_at(grain.shape, grain.scale);
            let has_time = match inlet.rate {
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

    /// Amount that was due by the rate and the end and has not come, in the unit of the rate: particles or kg. The first
    /// `found` of the `due` particles have a place.
    fn missing(&self, due: &[Particle], found: usize, moment: &Moment, library: &Library) -> f64 {
        let Self { inlet, mass, .. } = self;
        let (count, waiting) = (self.count as f64, &due[found..]);
        let by_rate = match inlet.rate {
            // Rounded like the due particles, so that one due only by rounding counts as due.
            Amount::Count(rate) => (rate * inlet.fed_for(moment.stage_time)).floor() - count,
            Amount::Mass(rate) => rate * (moment.stage_time - inlet.begin) - mass,
        };
        let Some(until) = inlet.until else { return by_rate };
        // If the list of due particles is cut off, the rest is estimated with the mean mass.
        let is_cut = due.len() as u64 >= MOST_AT_ONCE;
        let mean = || library.mean_over(&inlet.mix, |shape| library.mass[shape.index()]);
        let by_end = match (inlet.rate, until) {
            (Amount::Count(_), Amount::Count(most)) => most - count,
            (Amount::Mass(_), Amount::Mass(most)) => most - mass,
            (Amount::Count(_), Amount::Mass(most)) if is_cut => ((most - mass) / mean()).ceil(),
            (Amount::Count(_), Amount::Mass(_)) => waiting.len() as f64,
            (Amount::Mass(_), Amount::Count(most)) if is_cut => (most - count) * mean(),
            (Amount::Mass(_), Amount::Count(most)) if count + waiting.len() as f64 >= most => {
                waiting.iter().map(|grain| library.mass_at(grain.shape, grain.scale)).sum()
            }
            (Amount::Mass(_), Amount::Count(_)) => return by_rate,
        };
        by_rate.min(by_end)
    }

    /// Adds the particles that find a place now to `entered`, behind those of other inlets. Returns a warning, once, if
    /// others wait. Collective.
    fn enter(
        &mut self,
        moment: &Moment,
        entered: &mut Vec<Particle>,
        particles: &Particles,
        comm: &mut dyn Comm,
    ) -> Option<String> {
        let library = &particles.library;
        let due = self.due(moment, library);
        if due.is_empty() {
            self.missing = 0.0;
            return None;
        }
        let region = &self.inlet.region;
        let stream = self.stream(moment.step);
        let near = near(region, &due, particles);
        let first = self.count;
        let mut found = 0;
        // If one finds no place, those behind it wait.
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
                self.count += 1;
                self.mass += library.mass_at(grain.shape, grain.scale);
                found += 1;
            }
            if found - before < some.len() {
                break;
            }
        }
        let has_more = found as u64 == MOST_AT_ONCE && !self.due(moment, library).is_empty();
        let is_short = has_more || found < due.len();
        self.missing = if is_short { self.missing(&due, found, moment, library) } else { 0.0 };
        if !is_short || std::mem::replace(&mut self.warned, true) {
            return None;
        }
        Some(self.short(moment.step, due.len() - found, has_more))
    }

    /// Warning that particles wait behind the first that has found no place, or because more are due than can come at a
    /// time.
    fn short(&self, step: u64, waiting: usize, has_more: bool) -> String {
        let name = &self.inlet.name;
        if has_more {
            return format!(
                "inlet `{name}`: at step {step} more than {MOST_AT_ONCE} of its particles are due, the maximum at a \
                 time; the others wait. Make `every` smaller"
            );
        }
        format!(
            "inlet `{name}`: at step {step} {waiting} of its particles found no free place and wait. If this \
             continues, the rate exceeds what its region and `velocity` allow"
        )
    }

    /// Warnings at the end of a run for particles that have not come.
    fn last_warnings(&self, has_stopped: bool) -> Vec<String> {
        let Self { inlet: Inlet { name, rate, until, .. }, count, mass, missing, .. } = self;
        let mut warnings = Vec::new();
        if *missing > 0.0 {
            let missing = match rate {
                Amount::Count(_) => format!("{missing} particles"),
                Amount::Mass(_) => format!("{missing:.4e} kg"),
            };
            warnings.push(format!(
                "inlet `{name}`: {missing} due were not inserted; inserted: {count} particles, {mass:.4e} kg"
            ));
        }
        let short = match *until {
            Some(Amount::Count(most)) => format!("{count} of {most} particles"),
            Some(Amount::Mass(most)) => format!("{mass:.4e} of {most:?} kg"),
            None => return warnings,
        };
        if !has_stopped && !self.is_over() {
            warnings.push(format!(
                "inlet `{name}`: only {short} inserted: too few steps, no free place, or more than \
                 {MOST_AT_ONCE} due at a time"
            ));
        }
        warnings
    }
}

/// Centres and bounding radii [m] of this rank's particles near a region in which particles are due.
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

/// For each try of each particle: 1 if one of these particles or a wall is in its place.
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
    fn insert(
        &mut self,
        moment: &Moment,
        first_id: u64,
        particles: &Particles,
        comm: &mut dyn Comm,
    ) -> Option<Newcomers> {
        let mut entered = Vec::new();
        for (k, running) in self.all.iter_mut().enumerate() {
            if moment.stage_step.is_multiple_of(running.inlet.every) {
                let before = entered.len();
                self.warnings.extend(running.enter(moment, &mut entered, particles, comm));
                for (id, particle) in (first_id..).zip(&mut entered).skip(before) {
                    particle.id = GlobalId(id);
                }
                self.lists.note(moment.step, k, &entered[before..]);
            }
        }
        (!entered.is_empty()).then(|| Newcomers::of(entered))
    }
}

impl Observer for Inlets {
    fn lists(&mut self) -> Option<&mut Lists> {
        Some(&mut self.lists)
    }
}

impl Reporter for Inlets {
    fn name(&self) -> &'static str {
        "inlets"
    }

    fn counted(&self) -> Vec<(String, f64)> {
        let of_one = |Running { inlet, count, mass, missing, .. }: &Running| {
            let Inlet { name, rate, .. } = inlet;
            let unit = if matches!(rate, Amount::Mass(_)) { "_kg" } else { "" };
            [
                (format!("entered_{name}"), *count as f64),
                (format!("entered_{name}_kg"), *mass),
                (format!("missing_{name}{unit}"), *missing),
            ]
        };
        self.all.iter().flat_map(of_one).collect()
    }

    fn warnings(&mut self) -> Vec<String> {
        std::mem::take(&mut self.warnings)
    }

    fn standing(&self) -> Standing {
        let feeds = |running: &Running| running.inlet.until.is_some() && !running.is_over();
        let unfinished = self.all.iter().any(feeds).then_some("an inlet is not finished");
        Standing { unfinished, ..Standing::default() }
    }

    fn outcome(&self, _walls: &[Wall], has_stopped: bool) -> Outcome {
        let warnings = self.all.iter().flat_map(|running| running.last_warnings(has_stopped));
        Outcome { warnings: warnings.collect(), ..Outcome::default() }
    }

    fn save(&self, _walls: &[Wall], _comm: &mut dyn Comm) -> Vec<SavedColumn> {
        let all = || self.all.iter();
        vec![
            SavedColumn::texts(NAMES, all().map(|running| running.inlet.name.clone())),
            SavedColumn::counts(COUNT, all().map(|running| running.count)),
            SavedColumn::reals(MASS, all().map(|running| running.mass)),
            SavedColumn::reals(MISSING, all().map(|running| running.missing)),
            SavedColumn::reals(RATE, all().map(|running| running.inlet.rates()[0])),
            SavedColumn::reals(MASS_RATE, all().map(|running| running.inlet.rates()[1])),
            SavedColumn::reals(BEGIN, all().map(|running| running.inlet.begin)),
        ]
    }

    /// A new stage starts from the first particle.
    fn resume(&mut self, restart: &Restart, _walls: &mut [Wall]) -> Result<(), DriveError> {
        if restart.is_new_stage {
            return Ok(());
        }
        let saved = restart.saved;
        let (counts, masses) = (saved.counts(&COUNT)?, saved.reals(&MASS)?);
        let all_missing = saved.reals(&MISSING)?;
        let (rates, mass_rates) = (saved.reals(&RATE)?, saved.reals(&MASS_RATE)?);
        // Older snapshots lack this column: all their inlets began with the stage.
        let begins = saved.reals(&BEGIN).ok();
        let names = saved.texts(&NAMES)?;
        for Running { inlet, count, mass, missing, .. } in &mut self.all {
            let Some(row) = names.iter().position(|name| inlet.name == *name) else {
                return Err(inlet.unknown("did not exist"));
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
            (*count, *mass, *missing) = (counts[row], masses[row], all_missing[row]);
        }
        Ok(())
    }

    fn joins(&mut self) -> Result<(), DriveError> {
        let first = self.all.first();
        first.map_or(Ok(()), |running| Err(running.inlet.unknown("did not exist")))
    }
}
