//! Which time step and contact method a scene needs for the error that its user accepts: `dem-mpi --suggest`.
//!
//! # The trial
//! The scene runs again and again from one start, over the same time, on one rank and in memory. A trial lasts [`LONGEST`] steps
//! of the stable limit, or fewer, so that steps times particles are [`WORK`], but not fewer than [`SHORTEST`]; or the whole stage, if
//! that is shorter.
//!
//! # The error
//! Of a trial against the same trial with converged settings, the largest of
//! * **stress**: the mean stress of the contacts, relative. It is found as the sum over the contacts of force times branch, a
//!   third of the trace, which is the mean stress times the volume (Love 1927; Weber 1966); the branch ends at the wall, where
//!   there is one;
//! * **contacts**: the mean coordination number, walls included, relative;
//! * **energy**: what the balance of energies misses at the end, over what was dissipated, or over the largest kinetic and
//!   elastic energy where that is more. A converged trial misses nothing.
//!
//! Stress and coordination number are means over the last fifth of the trial, of the same moments in all trials.
//!
//! # How it is estimated
//! Steps of 0.8 of the stable limit, half of that, a quarter, and so on, with the method `auto`, make a ladder. The
//! **difference** of a step is the largest between its answer and those of the shorter steps, at least two. Twice that counts:
//! an error that falls with the step to the power of p is less than `1 / (1 - 2^(-2p))` times the difference from a step a
//! quarter as long, 4/3 with p = 1 and 2 with p = 1/2.
//!
//! Packings that still move are chaotic. The **floor** tells how far apart two runs are that nobody could tell apart at
//! their start: the steps that may be proposed run [`COPIES`] times each, from starts in which every particle was moved by up to
//! [`NUDGE`] of the smallest inscribed radius. With `s` for the standard deviation of these copies, pooled over the steps, the
//! floor is `t √2 s`, where t is Student's factor of 95 %. No step keeps single values nearer than the floor. A short trial of
//! a few collisions may not have made a difference of [`NUDGE`] grow to its full size, so that a longer run has a higher floor.
//!
//! The **expected error** of a step is `√((2 difference)² + floor²)` for stress and contacts, and what is missing for the energy. A
//! step is proposed if its expected error and that of half of it are within what is asked: one alone may be so by chance.
//!
//! # How often it is right
//! `cargo bench --bench work_precision -- --suggest` asks for 5 % and 1 % in 20 scenes that can keep them, and compares with
//! converged steps: 39 of 40 errors were within what was asked, the other was 1.01 %. The expected error is no bound: contacts
//! that carry next to nothing open and close with any change of the step, so the error of their number was up to 3.8 times the expected one.

mod estimate;
mod page;
mod trial;

use crate::shape::Kind;
use estimate::Rung;
pub use estimate::{Expected, Floor};
use std::path::Path;
use std::sync::atomic::AtomicUsize;
pub use trial::{Answer, Trials, Unanswered, Variant};

/// Length of a trial, in steps of the stable limit, at most.
pub const LONGEST: f64 = 20_000.0;
/// The same at least, if the stage is not shorter.
pub const SHORTEST: f64 = 400.0;
/// Steps of the stable limit times particles, at most, unless a trial would be shorter than that.
pub const WORK: f64 = 4e6;
/// How far the starts of copies are moved, over the smallest inscribed radius [-].
pub const NUDGE: f64 = 1e-9;
/// Runs of each step that may be proposed at first, the unmoved one included.
pub const COPIES: u64 = 3;
/// The longest step over the stable limit; each further one is half of that before.
pub const FIRST: f64 = 0.8;
/// Steps of the ladder at most.
const RUNGS: usize = 7;
/// Steps of the ladder that have copies.
const COPIED: usize = 3;
/// How many shorter steps a step is compared with, at least.
const FINER: usize = 2;
/// A method is changed if it takes less than this part of the time.
const FASTER: f64 = 0.9;

/// What is tried beside `auto`: keys of `[contact]`.
const METHODS: [&[(&str, &str)]; 4] = [
    &[("method", "\"epa\"")],
    &[("method", "\"epa\""), ("tolerance", "1e-4")],
    &[("method", "\"gjk-erosion\"")],
    &[("method", "\"gjk-erosion\""), ("erosion_ratio", "0.01")],
];
const AUTO: &[(&str, &str)] = &[("method", "\"auto\"")];

/// What is asked.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The scene's file.
    pub scene: &'a Path,
    /// Changes of it, as of [`super::Scene::read`].
    pub overrides: &'a [String],
    /// A snapshot of the same stage from which trials begin; without it, they begin as the scene does.
    pub start: Option<&'a Path>,
    /// The error that is accepted [-].
    pub error: f64,
    /// Not zero once a signal has asked for the end.
    pub signal: &'a AtomicUsize,
}

/// What is proposed.
#[derive(Clone, Debug, PartialEq)]
pub struct Suggestion {
    /// Is the error that was asked for to be expected of single values, and not only of means of many runs?
    pub is_kept: bool,
    /// What the proposed settings came to in the trial.
    pub run: Answer,
    /// Keys of `[contact]` and their values, as TOML has them.
    pub contact: Vec<(String, String)>,
    /// How large the errors of `run` are expected to be.
    pub expected: Expected,
    /// How far apart runs are that begin alike.
    pub floor: Floor,
    /// For a person: the lines of the scene to change, what to expect, what was tried, how sure it is.
    pub text: String,
}

/// Proposes step and method. `progress` gets a line after every trial.
///
/// # Errors
/// See [`Unanswered`].
pub fn suggest(
    question: &Question,
    progress: &mut dyn FnMut(&str),
) -> Result<Suggestion, Unanswered> {
    let trials = Trials::new(question)?;
    let (rungs, chosen) = climb(&trials, question.error, progress)?;
    let floor = Floor::of(&rungs);
    let best = estimate::best(&rungs).ok_or_else(|| trials.nothing())?;
    let is_kept = chosen.is_some();
    let Some(rung) = chosen.or_else(|| lost(&rungs, &floor)).or_else(|| nearest(&rungs, &floor))
    else {
        let why_not = rungs.iter().rev().find_map(|rung| rung.why_not.clone());
        return Err(why_not.map_or_else(|| trials.nothing(), Unanswered::Trial));
    };
    let expected = estimate::expected(&rungs, rung, &floor).ok_or_else(|| trials.nothing())?;
    let mut found = page::Found {
        question,
        trials: &trials,
        rungs: &rungs,
        floor,
        is_kept,
        run: rungs[rung].runs[0].clone(),
        plain: &rungs[rung].runs[0],
        method: AUTO,
        expected,
        others: Vec::new(),
        softer: None,
    };
    if trials.scene.particle_kinds() != [Kind::Sphere] {
        for method in METHODS {
            let longest = FASTER * found.run.seconds;
            let tried = trials.run(&Variant { contact: method, longest, ..Variant::of(rung) });
            progress(&page::of_method(method, &tried));
            if let Err(stopped @ Unanswered::Signal(_)) = tried {
                return Err(stopped);
            }
            if let Ok(run) = &tried {
                let of_method = estimate::from(run, &best, &floor);
                if of_method.is_at_most(question.error) && is_kept {
                    (found.run, found.method, found.expected) = (run.clone(), method, of_method);
                }
            }
            found
                .others
                .push((method, tried.map(|run| (estimate::from(&run, &best, &floor), run))));
        }
    }
    let softer = trials.run(&Variant { softer: true, ..Variant::of(rung) });
    if let Err(stopped @ Unanswered::Signal(_)) = softer {
        return Err(stopped);
    }
    progress("  softer contacts: tried");
    found.softer = Some(softer.map(|run| (estimate::from(&run, &best, &Floor::NONE), run)));
    let text = found.page();
    let page::Found { run, method, expected, .. } = found;
    let owned = |&(key, value): &(&str, &str)| (key.to_owned(), value.to_owned());
    let contact = method.iter().map(owned).collect();
    Ok(Suggestion { is_kept, run, contact, expected, floor, text })
}

/// Runs the ladder until a step keeps the error; which one that is, if any.
fn climb(
    trials: &Trials,
    error: f64,
    progress: &mut dyn FnMut(&str),
) -> Result<(Vec<Rung>, Option<usize>), Unanswered> {
    let mut rungs: Vec<Rung> = Vec::new();
    for k in 0..RUNGS {
        let mut rung = Rung { runs: Vec::new(), why_not: None };
        for copy in 0..if k < COPIED { COPIES } else { 1 } {
            match trials.run(&Variant { copy, contact: AUTO, ..Variant::of(k) }) {
                Ok(run) => rung.runs.push(run),
                // A long step may be too long; a scene that is wrong is so with every step.
                Err(Unanswered::Trial(why)) => {
                    rung = Rung { runs: Vec::new(), why_not: Some(why) };
                    break;
                }
                Err(other) => return Err(other),
            }
        }
        rungs.push(rung);
        progress(&page::of_rung(trials, &rungs, k));
        if k < COPIED {
            continue;
        }
        let floor = Floor::of(&rungs);
        let keeps = |j: usize| {
            estimate::expected(&rungs, j, &floor).is_some_and(|expected| expected.is_at_most(error))
        };
        if let Some(first) = (0..=k - FINER).find(|&j| keeps(j) && keeps(j + 1)) {
            return Ok((rungs, Some(first)));
        }
        // Shorter steps would not come nearer than that.
        if floor.largest() > error && lost(&rungs, &floor).is_some() {
            break;
        }
    }
    Ok((rungs, None))
}

/// The longest step that differs from shorter ones by no more than runs of one step do from each other.
fn lost(rungs: &[Rung], floor: &Floor) -> Option<usize> {
    let is_lost = |&k: &usize| estimate::difference(rungs, k).is_some_and(|d| d.is_within(floor));
    (0..rungs.len().saturating_sub(FINER)).find(is_lost).filter(|_| floor.largest() > 0.0)
}

/// The step with the smallest expected error.
fn nearest(rungs: &[Rung], floor: &Floor) -> Option<usize> {
    let expected = |k| Some((estimate::expected(rungs, k, floor)?.largest(), k));
    let all = (0..rungs.len().saturating_sub(FINER)).filter_map(expected);
    all.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, k)| k)
}
