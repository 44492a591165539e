//! Repeated runs of one scene over one time: with another step, method or stiffness, or a slightly moved start.

use super::{FIRST, LONGEST, NUDGE, Question, SHORTEST, WORK};
use crate::comm::Comm;
use crate::comm::alone::Alone;
use crate::contacts::Loaded;
use crate::random::{Random, mixed};
use crate::scene::assemble;
use crate::scene::parts::Need;
use crate::scene::{Rain, Scene, plan};
use crate::sim::report::machine_bytes;
use crate::sim::{Simulation, run};
use std::fmt::Display;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;
use toml::{Table, Value};

/// Number of parts of a trial, the last of which is averaged over.
const LAST_PART: u64 = 5;
/// Number of energy measurements in a trial.
const LOOKS: u64 = 50;
/// Keys of `[contact]` that belong to a method.
const OF_METHODS: [&str; 6] =
    ["method", "erosion_ratio", "erosion_increment", "tolerance", "spurious", "polish"];
/// Stiffness of softer contacts over the scene's [-].
pub(super) const SOFTER: f64 = 0.1;

/// Reason for a missing result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TrialError {
    /// The scene, its start or the question is invalid.
    #[error("{0}")]
    Input(String),
    /// A trial failed.
    #[error("{0}")]
    Trial(String),
    /// A trial exceeded its time.
    #[error("slower")]
    Slower,
    /// A signal of this number requested the end.
    #[error("stopped by a signal")]
    Signal(usize),
}

/// Result of a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Step [s].
    pub dt: f64,
    /// Number of steps.
    pub steps: u64,
    /// Wall clock of the steps [s].
    pub seconds: f64,
    /// Sum over the contacts of force times branch, a third of the trace: mean stress times volume, averaged over the last
    /// fifth [J].
    pub stress: f64,
    /// Mean coordination number with walls, averaged over the last fifth [-].
    pub coordination: f64,
    /// Energy error over the dissipated energy, or over the largest kinetic and elastic energy where that is more [-].
    pub missing: f64,
    /// Largest measured overlap over the shortest axis of the smaller body [-].
    pub largest_overlap: f64,
}

/// Settings of a trial.
#[derive(Clone, Copy, Debug)]
pub struct Variant<'a> {
    /// Number of halvings of the step, from [`FIRST`] of the limit.
    pub halvings: usize,
    /// Number of the moved start; 0 for the unmoved one.
    pub copy: u64,
    /// Keys of `[contact]` in place of the scene's; empty for the method `auto`.
    pub contact: &'a [(&'a str, &'a str)],
    /// Are contacts a tenth as stiff, and the step √10 times as long?
    pub softer: bool,
    /// Largest run time [s].
    pub longest: f64,
}

impl Variant<'_> {
    /// The scene with the method `auto`, unmoved.
    pub const fn of(halvings: usize) -> Self {
        Self { halvings, copy: 0, contact: &[], softer: false, longest: f64::INFINITY }
    }
}

/// Data common to all trials of a scene.
#[derive(Debug)]
pub struct Trials<'a> {
    pub(super) question: &'a Question<'a>,
    /// The scene without changes.
    pub(super) scene: Scene,
    /// Stable limit [s].
    pub(super) limit: f64,
    /// Longest step of a trial [s].
    pub(super) first: f64,
    /// Number of steps of a trial with it.
    pub(super) steps: u64,
    /// Particles at the start, and all of the rain if it has not begun.
    pub(super) particles: u64,
    /// Steps of the stage before the start, and time left of the stage [s].
    pub(super) behind: u64,
    pub(super) left: f64,
}

impl<'a> Trials<'a> {
    /// Reads the scene and its start.
    ///
    /// # Errors
    /// If they are invalid, or if there is no stable limit.
    pub fn new(question: &'a Question<'a>) -> Result<Self, TrialError> {
        let (file, overrides) = (question.scene, question.overrides);
        let read = match question.start {
            Some(snapshot) => Scene::read_to_go_on(file, overrides, snapshot),
            None => Scene::read(file, overrides),
        };
        let scene = read.map_err(wrong)?;
        let (sim, resumed) = started(&scene, question.start)?;
        let Some(limit) = scene.time_step_limit() else {
            return Err(TrialError::Input(format!(
                "{}: no contact has a stiffness, so there is no stable limit of the step; give a material a stiffness",
                question.scene.display()
            )));
        };
        if let Some(inlet) = scene.inlets.iter().find(|inlet| {
            inlet.until.is_none()
                || sim.drives.iter().any(|drive| drive.standing().unfinished.is_some())
        }) {
            return Err(TrialError::Input(format!(
                "{}: inlet `{}` inserts particles in different places with every step, so trials cannot be compared: \
                 use a stage without inlets, with these particles in its `start`",
                question.scene.display(),
                inlet.name
            )));
        }
        // A snapshot within the stage holds what has fallen.
        let rain = scene.rain.as_ref().filter(|_| !resumed).map_or(0, |rain| rain.count);
        let particles = sim.particles.owned as u64 + rain;
        let behind = sim.step - sim.stage_begin.0;
        let left = scene.steps.saturating_sub(behind) as f64 * scene.dt;
        if particles == 0 || left == 0.0 {
            return Err(TrialError::Input(format!(
                "{}: no particles or no steps are left for trials",
                question.scene.display()
            )));
        }
        let first = rounded_down(FIRST * limit.dt);
        let longest = (WORK / particles as f64).clamp(SHORTEST, LONGEST) * limit.dt;
        let parts = (longest.min(left) / (LAST_PART as f64 * first)).round().max(1.0);
        let steps = LAST_PART * parts as u64;
        Ok(Self { question, scene, limit: limit.dt, first, steps, particles, behind, left })
    }

    /// Stable limit [s].
    pub const fn limit(&self) -> f64 {
        self.limit
    }

    /// Duration of a trial [s].
    pub fn time(&self) -> f64 {
        self.steps as f64 * self.first
    }

    /// Error for trials without contacts to compare.
    pub(super) fn nothing(&self) -> TrialError {
        TrialError::Input(format!(
            "{}: no particle has a contact in the last fifth of the trial, which lasts {:.3e} s: use a snapshot with \
             contacts (--start)",
            self.question.scene.display(),
            self.time()
        ))
    }

    /// Steps between layers of rain.
    pub(super) fn rain_every(&self, rain: &Rain, dt: f64) -> u64 {
        // A multiple of the longest step, so that layers fall at the same moments with all steps.
        let every = (rain.every as f64 * self.scene.dt / self.first).round().max(1.0);
        (every * self.first / dt).round() as u64
    }

    /// Runs a trial.
    ///
    /// # Errors
    /// If it cannot be run to its end.
    pub fn run(&self, variant: &Variant) -> Result<Answer, TrialError> {
        let finer = self.steps << variant.halvings;
        let steps = if variant.softer {
            LAST_PART * (finer as f64 * SOFTER.sqrt() / LAST_PART as f64).ceil() as u64
        } else {
            finer
        };
        let dt = self.first * (self.steps as f64 / steps as f64);
        let scene = self.varied(variant, dt)?;
        let (mut sim, resumed) = started(&scene, self.question.start)?;
        if variant.copy > 0 {
            nudge(&mut sim, mixed(&[scene.seed, variant.copy]));
        }
        let mut comm = Alone::default();
        if !resumed {
            run::begin(&mut sim, &mut comm).map_err(wrong)?;
        }
        self.go(&mut sim, (steps, u64::from(resumed)), variant.longest, &mut comm)
    }

    /// Steps through a trial and measures. The energy balance begins after `unseen` steps: contacts from a snapshot have no
    /// forces, and no energy, before the first step.
    fn go(
        &self,
        sim: &mut Simulation,
        (steps, unseen): (u64, u64),
        longest: f64,
        comm: &mut dyn Comm,
    ) -> Result<Answer, TrialError> {
        let between = (steps / self.steps).max(1);
        let mut done = 0;
        while done < unseen {
            sim.step(comm).map_err(|error| TrialError::Trial(error.to_string()))?;
            done += 1;
        }
        let begin = sim.measure(comm);
        let (mut most_moving, mut largest_overlap) = (begin.moving(), begin.largest_overlap);
        let (mut stress, mut coordination, mut samples) = (0.0, 0.0, 0_u64);
        let mut seconds = 0.0;
        while done < steps {
            match self.question.signal.load(Ordering::Relaxed) {
                0 => {}
                signal => return Err(TrialError::Signal(signal)),
            }
            let started = Instant::now();
            let until = ((done / between + 1) * between).min(steps);
            while done < until {
                sim.step(comm).map_err(|error| TrialError::Trial(error.to_string()))?;
                done += 1;
            }
            seconds += started.elapsed().as_secs_f64();
            if seconds > longest {
                return Err(TrialError::Slower);
            }
            if done > steps - steps / LAST_PART {
                let [product, contacts] = contacts_of(sim);
                (stress, coordination) = (stress + product, coordination + contacts);
                samples += 1;
            }
            if done.is_multiple_of((steps / LOOKS).max(1) * between) || done == steps {
                let now = sim.measure(comm);
                most_moving = most_moving.max(now.moving());
                largest_overlap = largest_overlap.max(now.largest_overlap);
            }
        }
        let end = sim.measure(comm);
        let of = (end.dissipated - begin.dissipated).max(most_moving);
        let missing = if of > 0.0 { (end.missing() - begin.missing()) / of } else { 0.0 };
        let [stress, coordination] = [stress, coordination].map(|sum| sum / samples as f64);
        if !(stress.is_finite() && missing.is_finite()) {
            return Err(TrialError::Trial("a stress or an energy is not a number".to_owned()));
        }
        if stress == 0.0 || coordination == 0.0 {
            return Err(self.nothing());
        }
        Ok(Answer { dt: sim.dt, steps, seconds, stress, coordination, missing, largest_overlap })
    }

    /// Scene with another step, method or stiffness.
    fn varied(&self, variant: &Variant, dt: f64) -> Result<Scene, TrialError> {
        let mut root: Table = self.scene.text.parse().map_err(wrong)?;
        section(&mut root, "time").insert("step".to_owned(), Value::Float(dt));
        section(&mut root, "audit").insert("every".to_owned(), Value::Integer(0));
        if let Some(rain) = &self.scene.rain {
            let every = Value::Integer(self.rain_every(rain, dt) as i64);
            section(section(&mut root, "fill"), "rain").insert("every".to_owned(), every);
        }
        let contact = section(&mut root, "contact");
        contact.retain(|key, _| !OF_METHODS.contains(&key));
        for (key, value) in variant.contact {
            let given: Table = format!("{key} = {value}").parse().map_err(wrong)?;
            contact.extend(given);
        }
        if variant.softer {
            soften(&mut root);
        }
        let Question { scene, start, .. } = self.question;
        let folder = scene.parent().unwrap_or(Path::new(""));
        let need = start.map_or(Need::AllFiles, Need::Snapshot);
        let text = root.to_string();
        let of_trial = Scene::parse_for(&text, "the trial's scene", folder, &[], need);
        of_trial.map_err(|errors| TrialError::Trial(errors.to_string()))
    }
}

fn wrong(error: impl Display) -> TrialError {
    TrialError::Input(error.to_string())
}

/// The number rounded down to three digits.
fn rounded_down(number: f64) -> f64 {
    let unit = 10.0_f64.powi(libm::log10(number).floor() as i32 - 2);
    // By decimal digits, so that its halves have few digits, too.
    let text = format!("{}e{}", (number / unit).floor(), libm::log10(unit).round());
    text.parse().unwrap_or(number)
}

/// Simulation at its start; true if it continues within a stage.
fn started(scene: &Scene, start: Option<&Path>) -> Result<(Simulation, bool), TrialError> {
    let from = assemble::first_snapshot(scene, start);
    if from.is_none() {
        plan::fits(scene, 1, machine_bytes()).map_err(wrong)?;
    }
    let (sim, _) = assemble::started(scene, from, &mut Alone::default()).map_err(wrong)?;
    Ok((sim, start.is_some()))
}

/// Moves every particle by a small random displacement.
fn nudge(sim: &mut Simulation, seed: u64) {
    let particles = &mut sim.particles;
    let most = NUDGE * particles.library.least_inscribed_radius();
    for slot in 0..particles.owned {
        let mut random = Random::of(seed, particles.id[slot].0);
        for axis in 0..3 {
            particles.position[slot][axis] += most * random.signed();
        }
    }
}

/// Sum over the contacts of force times branch, a third of the trace [J]; mean number of contacts of a particle.
fn contacts_of(sim: &Simulation) -> [f64; 2] {
    let particles = &sim.particles;
    let (mut product, mut ends) = (0.0, 0_u64);
    for contact in sim.contacts.loaded(&*sim.law, particles) {
        let Loaded { pair, force, point, .. } = contact;
        if pair.a.index() >= particles.owned {
            continue;
        }
        let is_wall = pair.b.index() >= particles.first_facet();
        let branch = if is_wall { point } else { particles.bodies().relative(pair) };
        product += force.dot(&branch) / 3.0;
        ends += if is_wall { 1 } else { 2 };
    }
    [product, ends as f64 / particles.owned.max(1) as f64]
}

/// Table of this name, created if it is missing.
fn section<'a>(table: &'a mut Table, name: &str) -> &'a mut Table {
    let entry = table.entry(name.to_owned()).or_insert_with(|| Value::Table(Table::new()));
    if !entry.is_table() {
        *entry = Value::Table(Table::new());
    }
    entry.as_table_mut().expect("made a table above")
}

/// Reduces the stiffness of all contacts to a tenth.
fn soften(root: &mut Table) {
    for name in ["material", "interaction"] {
        let list = root.get_mut(name).and_then(Value::as_array_mut);
        for table in list.into_iter().flatten().filter_map(Value::as_table_mut) {
            for key in ["normal_stiffness", "tangential_stiffness", "youngs_modulus"] {
                let Some(value) = table.get_mut(key) else { continue };
                let number = value.as_float().or_else(|| value.as_integer().map(|n| n as f64));
                if let Some(number) = number {
                    *value = Value::Float(SOFTER * number);
                }
            }
        }
    }
}
