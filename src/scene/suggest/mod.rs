//! Time step and contact method that a scene needs for an accepted error: `dem-mpi --suggest`.
//!
//! # The trial
//! The scene runs repeatedly from one start, over the same time, on one rank and in memory. A trial lasts at most
//! [`LONGEST`] steps of the stable limit, and fewer if steps times particles would exceed [`WORK`], but at least
//! [`SHORTEST`]. If the stage is shorter, the trial is the whole stage.
//!
//! # The error
//! The largest of three errors, against the same trial with converged settings:
//! * **stress**: the mean stress of the contacts, relative. It is the sum over the contacts of force times branch, a third
//!   of the trace, which is the mean stress times the volume (Love 1927; Weber 1966); at a wall the branch ends there;
//! * **contacts**: the mean coordination number, walls included, relative;
//! * **energy**: the energy error at the end, over the dissipated energy, or over the largest kinetic and elastic energy
//!   where that is more. It is zero in a converged trial.
//!
//! Stress and coordination number are means over the last fifth of the trial, at the same moments in all trials.
//!
//! # The estimate
//! Steps of 0.8 of the stable limit, half of that, a quarter, and so on, with the method `auto`, make a ladder. The
//! **difference** of a step is the largest between its result and those of the shorter steps, at least two. It counts
//! twice: an error that falls with the step to the power of p is less than `1 / (1 - 2^(-2p))` times the difference from a
//! step a quarter as long, 4/3 with p = 1 and 2 with p = 1/2.
//!
//! Packings that still move are chaotic. The **floor** is the difference between runs with nearly equal starts. The steps
//! that may be proposed run [`COPIES`] times each, from starts in which every particle was moved by up to [`NUDGE`] of the
//! smallest inscribed radius. With `s` for the standard deviation of these copies, pooled over the steps, the floor is
//! `t √2 s`, where t is Student's factor of 95 %. No step reduces the error of single values below the floor. In a short
//! trial with few collisions a displacement of [`NUDGE`] may not grow to its full size, so a longer run has a higher floor.
//!
//! The **expected error** of a step is `√((2 difference)² + floor²)` for stress and contacts, and the energy error for
//! energy. A step is proposed if its expected error and that of half the step are within the accepted error: a single one
//! may be so by chance.
//!
//! # Accuracy of the estimate
//! `cargo bench --bench work_precision -- --suggest` requests 5 % and 1 % in 20 scenes that allow them, and compares with
//! converged steps: 39 of 40 errors were within the accepted one, the other was 1.01 %. The expected error is no bound.
//! Contacts that carry next to nothing open and close with any change of the step. The error of their number was up to 3.8
//! times the expected one.

mod estimate;
mod page;
mod trial;

use crate::shape::Kind;
use estimate::Rung;
pub use estimate::{Expected, Floor};
use std::path::Path;
use std::sync::atomic::AtomicUsize;
pub use trial::{Answer, TrialError, Trials, Variant};

/// Largest length of a trial, in steps of the stable limit.
pub const LONGEST: f64 = 20_000.0;
/// Smallest length of a trial, if the stage is not shorter.
pub const SHORTEST: f64 = 400.0;
/// Largest number of steps of the stable limit times particles, unless a trial would be shorter than [`SHORTEST`].
pub const WORK: f64 = 4e6;
/// Displacement of particles in the starts of copies, over the smallest inscribed radius [-].
pub const NUDGE: f64 = 1e-9;
/// Runs of each step that may be proposed first, including the unmoved one.
pub const COPIES: u64 = 3;
/// Longest step over the stable limit; each further one is half as long.
pub const FIRST: f64 = 0.8;
/// Largest number of steps in the ladder.
const RUNGS: usize = 7;
/// Number of steps in the ladder with copies.
const COPIED: usize = 3;
/// Smallest number of shorter steps with which a step is compared.
const FINER: usize = 2;
/// A method is changed if it takes less than this part of the time.
const FASTER: f64 = 0.9;

/// Methods tried beside `auto`: keys of `[contact]`.
const METHODS: [&[(&str, &str)]; 4] = [
    &[("method", "\"epa\"")],
    &[("method", "\"epa\""), ("tolerance", "1e-4")],
    &[("method", "\"gjk-erosion\"")],
    &[("method", "\"gjk-erosion\""), ("erosion_ratio", "0.01")],
];
const AUTO: &[(&str, &str)] = &[("method", "\"auto\"")];

/// Scene and accepted error of a suggestion.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// The scene's file.
    pub scene: &'a Path,
    /// Overrides, as for [`super::Scene::read`].
    pub overrides: &'a [String],
    /// Snapshot of the same stage from which trials begin; without it, they begin as the scene does.
    pub start: Option<&'a Path>,
    /// Accepted error [-].
    pub error: f64,
    /// Nonzero once a signal has requested the end.
    pub signal: &'a AtomicUsize,
}

/// Proposed settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Suggestion {
    /// Can the accepted error be expected for single values, and not only for means of many runs?
    pub is_kept: bool,
    /// Result of a trial with the proposed settings.
    pub run: Answer,
    /// Keys of `[contact]` and their values in TOML.
    pub contact: Vec<(String, String)>,
    /// Expected errors of `run`.
    pub expected: Expected,
    /// Difference between runs with nearly equal starts.
    pub floor: Floor,
    /// Text for the user: the lines of the scene to change, the expected errors, the trials, and their reliability.
    pub text: String,
}

/// Proposes step and method. `progress` receives a line after every trial.
///
/// # Errors
/// See [`TrialError`].
pub fn suggest(
    question: &Question,
    progress: &mut dyn FnMut(&str),
) -> Result<Suggestion, TrialError> {
    let trials = Trials::new(question)?;
    let (rungs, chosen) = climb(&trials, question.error, progress)?;
    let floor = Floor::of(&rungs);
    let best = estimate::best(&rungs).ok_or_else(|| trials.nothing())?;
    let is_kept = chosen.is_some();
    let Some(rung) = chosen.or_else(|| lost(&rungs, &floor)).or_else(|| nearest(&rungs, &floor))
    else {
        let why_not = rungs.iter().rev().find_map(|rung| rung.why_not.clone());
        return Err(why_not.map_or_else(|| trials.nothing(), TrialError::Trial));
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
            if let Err(stopped @ TrialError::Signal(_)) = tried {
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
    if let Err(stopped @ TrialError::Signal(_)) = softer {
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

/// Runs the ladder until a step keeps the error; returns it and the step, if any.
fn climb(
    trials: &Trials,
    error: f64,
    progress: &mut dyn FnMut(&str),
) -> Result<(Vec<Rung>, Option<usize>), TrialError> {
    let mut rungs: Vec<Rung> = Vec::new();
    for k in 0..RUNGS {
        let mut rung = Rung { runs: Vec::new(), why_not: None };
        for copy in 0..if k < COPIED { COPIES } else { 1 } {
            match trials.run(&Variant { copy, contact: AUTO, ..Variant::of(k) }) {
                Ok(run) => rung.runs.push(run),
                // A long step may fail by its length; an invalid scene fails with every step.
                Err(TrialError::Trial(why)) => {
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
        // Shorter steps would not reduce the error below the floor.
        if floor.largest() > error && lost(&rungs, &floor).is_some() {
            break;
        }
    }
    Ok((rungs, None))
}

/// Longest step whose difference from shorter ones is within the floor.
fn lost(rungs: &[Rung], floor: &Floor) -> Option<usize> {
    let is_lost = |&k: &usize| estimate::difference(rungs, k).is_some_and(|d| d.is_within(floor));
    (0..rungs.len().saturating_sub(FINER)).find(is_lost).filter(|_| floor.largest() > 0.0)
}

/// Step with the smallest expected error.
fn nearest(rungs: &[Rung], floor: &Floor) -> Option<usize> {
    let expected = |k| Some((estimate::expected(rungs, k, floor)?.largest(), k));
    let all = (0..rungs.len().saturating_sub(FINER)).filter_map(expected);
    all.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, k)| k)
}
