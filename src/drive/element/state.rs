//! State of the control of a cell in snapshots: a row for each component.

use super::control::State;
use super::{Element, SUMS};
use crate::comm::Comm;
use crate::contact::StateColumn;
use crate::drive::errors::{Course, Errors, PARTS};
use crate::drive::{DriveError, Restart, SavedColumn, load};
use crate::math::ExactSum;
use crate::measure::COMPONENTS;

/// Name of [`Element`] among the drives.
pub(super) const NAME: &str = "cell";

/// Name of the component.
const COMPONENT: StateColumn = StateColumn::new("component", 1, "");
/// [`State::rate`].
const RATE: StateColumn = StateColumn::new("rate", 1, "1/s");
/// [`State::modulus`].
const MODULUS: StateColumn = StateColumn::new("modulus", 1, "Pa");
/// [`State::first`].
const FIRST: StateColumn = StateColumn::new("first", 1, "Pa");
/// 1 once the stage has begun.
const BEGUN: StateColumn = StateColumn::new("begun", 1, "1");
/// Errors since the last check of `[stop]`.
const RECENT: StateColumn = StateColumn::new("recent", 4, "1");
/// Errors since the stage began; parts without steps are zero.
const COURSE: StateColumn = StateColumn::new("course", 4 * PARTS, "1");
/// Exact sums over all ranks: stress times volume. The other column has moduli times volume in its first three
/// rows.
const STRESS: StateColumn = StateColumn::new("stress", ExactSum::LIMBS, "2^(32 k - 1074) J");
const MODULI: StateColumn = StateColumn::new("moduli", ExactSum::LIMBS, "2^(32 k - 1074) J");

/// Columns over all ranks. Collective.
pub(super) fn saved(element: &Element, comm: &mut dyn Comm) -> Vec<SavedColumn> {
    let Element { states, records, has_begun, sums, .. } = element;
    if sums.is_empty() {
        return Vec::new();
    }
    let mut sums = load::of_all_ranks(sums.iter(), comm);
    let mut moduli = sums.split_off(COMPONENTS.len());
    moduli.resize(COMPONENTS.len(), ExactSum::default());
    let names = (0..COMPONENTS.len()).map(super::name_of);
    vec![
        SavedColumn::texts(COMPONENT, names),
        SavedColumn::reals(RATE, states.iter().map(|state| state.rate)),
        SavedColumn::reals(MODULUS, states.iter().map(|state| state.modulus)),
        SavedColumn::reals(FIRST, states.iter().map(|state| state.first)),
        SavedColumn::counts(BEGUN, states.iter().map(|_| u64::from(*has_begun))),
        SavedColumn::reals(RECENT, records.iter().flat_map(|record| record.recent.numbers())),
        SavedColumn::reals(COURSE, records.iter().flat_map(|record| record.course.numbers())),
        SavedColumn::integers(STRESS, sums.iter().flat_map(|sum| *sum.limbs())),
        SavedColumn::integers(MODULI, moduli.iter().flat_map(|sum| *sum.limbs())),
    ]
}

/// Restores the state; in a new stage only the state of the control law.
pub(super) fn resume(element: &mut Element, restart: &Restart) -> Result<(), DriveError> {
    let saved = restart.saved;
    let (rates, moduli) = (saved.reals(&RATE)?, saved.reals(&MODULUS)?);
    let (first, begun) = (saved.reals(&FIRST)?, saved.counts(&BEGUN)?);
    let recents: &[[f64; 4]] = saved.reals(&RECENT)?.as_chunks().0;
    let courses = saved.reals(&COURSE)?.as_chunks::<4>().0.as_chunks::<PARTS>().0;
    let stress: &[[i64; ExactSum::LIMBS]] = saved.integers(&STRESS)?.as_chunks().0;
    let stiffness: &[[i64; ExactSum::LIMBS]] = saved.integers(&MODULI)?.as_chunks().0;
    if rates.len() != COMPONENTS.len() {
        return Err(DriveError(format!("the state of `{NAME}` has {} components", rates.len())));
    }
    for (k, state) in element.states.iter_mut().enumerate() {
        *state = State { rate: rates[k], modulus: moduli[k], first: first[k] };
        if restart.is_new_stage {
            // The last rate of another stage is no estimate for the new targets.
            *state = State { rate: 0.0, ..*state };
        }
    }
    if restart.is_new_stage {
        return Ok(());
    }
    element.has_begun = begun[0] != 0;
    for (record, (recent, course)) in element.records.iter_mut().zip(recents.iter().zip(courses)) {
        record.recent = Errors::of(recent);
        record.course = Course::of(course);
    }
    if !element.sums.is_empty() {
        let all = stress.iter().chain(stiffness).take(SUMS);
        element.sums = all.map(|limbs| restart.sum(limbs)).collect();
    }
    Ok(())
}
