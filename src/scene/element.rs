//! `[cell]`: strain of a periodic domain as a whole.

use super::motions;
use super::reader::{Given, Section};
use crate::cell::{AXES, Cell};
use crate::drive::element::{Control, Goal, gradient};
use crate::measure::COMPONENTS;
use crate::walls::courses::TimeFunction;
use std::path::Path;

/// The components, in the order of [`COMPONENTS`].
const NAMES: [&str; 6] = ["xx", "yy", "zz", "xy", "xz", "yz"];
/// Largest strain of the cell in a step [-].
const MOST_IN_STEP: f64 = 1e-3;
/// Number of points at which the course of a cell with given rates is checked before the run.
const LOOKS: u32 = 1000;

/// Domain in the form that the flow of a `[cell]` can carry.
pub(super) fn domain(root: &Section, domain: Option<&Cell>) -> Option<Cell> {
    let before = domain?;
    let Some(given) = root.get("cell") else {
        if let Some(edges) = root.section("domain").and_then(|domain| domain.get("edges")) {
            edges.fail_whole("needs a [cell]; an empty one keeps the edges");
        }
        return Some(*before);
    };
    let carried = if before.strained().is_some() { Some(*before) } else { before.at_rest() };
    if carried.is_none() {
        given.fail_whole(
            "needs a domain that is periodic along x, y and z, and without `shear`: use `xy = { rate = .. }` instead",
        );
    }
    carried
}

/// Reads the control of the cell; `None` if it is invalid, and `Some(None)` if there is no `[cell]`.
#[expect(clippy::option_option, reason = "wrong, none, or one")]
pub(super) fn control(root: &Section, folder: &Path) -> Option<Option<Control>> {
    let Some(section) = root.section("cell") else {
        return root.get("cell").is_none().then_some(None);
    };
    let goals = goals(&section, folder)?;
    let number = |key, default| section.number_or(key, default);
    let (ramp, gain) = (number("ramp", 0.0), number("gain", 1.0));
    let max_rate = section.optional("max_rate", Given::number)?;
    let control = Control { goals, ramp: ramp?, max_rate: max_rate.unwrap_or(0.0), gain: gain? };
    if control.has_target() && max_rate.is_none() {
        section.fail(
            "a component has a `stress` but there is no `max_rate`, the highest strain rate [1/s]. A strain of 1e-3 \
             in the time d sqrt(density / stress) is slow, with particle diameter d",
        );
        return None;
    }
    for key in ["ramp", "max_rate", "gain"] {
        if !control.has_target() {
            section.refuse(key, "has no effect without a `stress`");
        }
    }
    Some(Some(control))
}

/// Goals of all components.
fn goals(section: &Section, folder: &Path) -> Option<[Goal; 6]> {
    let mut given: [Option<Goal>; 6] = Default::default();
    for (name, goal) in NAMES.into_iter().zip(&mut given) {
        *goal = section.optional(name, |given| self::goal(given, folder))?;
    }
    if let Some(of_all) = section.get("isotropic") {
        if given[..3].iter().any(Option::is_some) {
            of_all.fail_whole("applies to x, y and z: leave out `xx`, `yy` and `zz`");
            return None;
        }
        let goal = match goal(&of_all, folder)? {
            Goal::Stress(stress) => Goal::MeanStress(stress),
            other => other,
        };
        given[..3].fill(Some(goal));
    }
    if let Some(across) = section.get("plane_strain") {
        let axis = across.one_of(&[("x", 0), ("y", 1), ("z", 2)])?;
        if given[axis].is_some() {
            let name = NAMES[axis];
            across
                .fail(format!("keeps the cell's length along {}: leave out `{name}`", AXES[axis]));
            return None;
        }
        given[axis] = Some(Goal::Rate(0.0));
    }
    if section.boolean_or("constant_volume", false)? {
        if given[..3].iter().all(Option::is_some) {
            section
                .get("constant_volume")?
                .fail("needs a free component: leave out at least one of `xx`, `yy` and `zz`");
            return None;
        }
        for goal in given[..3].iter_mut().filter(|goal| goal.is_none()) {
            *goal = Some(Goal::Volume);
        }
    }
    Some(given.map(|goal| goal.unwrap_or(Goal::Rate(0.0))))
}

/// A rate, a stress, or a path of strain.
fn goal(given: &Given, folder: &Path) -> Option<Goal> {
    let section = given.section()?;
    let rate = section.optional("rate", Given::number)?;
    let stress = section.optional("stress", Given::number)?;
    let path = ["table", "amplitude", "frequency"].iter().any(|key| section.get(key).is_some());
    match (rate, stress, path) {
        (Some(rate), None, false) => Some(Goal::Rate(rate)),
        (None, Some(stress), false) => Some(Goal::Stress(stress)),
        (None, None, true) => motions::way(&section, ("strain", 1.0), folder).map(Goal::Path),
        _ => {
            given.fail_whole(
                "give one of `rate`, `stress`, `table`, and `amplitude` with `frequency`",
            );
            None
        }
    }
}

/// Rejects settings that are incompatible with a strained cell.
pub(super) fn check_others(root: &Section, walls: usize) {
    if root.get("cell").is_none() {
        return;
    }
    if walls > 0
        && let Some(given) = root.get("cell")
    {
        given.fail_whole("not with walls, which the flow would carry along: leave the walls out, or use moving walls");
    }
    if let Some(given) = root.get("gravity")
        && given.vector().is_some_and(|gravity| gravity.norm() > 0.0)
    {
        given.fail("must be 0 with a [cell]: it would accelerate the particles for ever");
    }
    let rain = root.section("fill").and_then(|fill| fill.get("rain"));
    let others = [rain, root.get("inlet"), root.get("outlet")];
    for given in others.into_iter().flatten() {
        given.fail_whole("not with a [cell]: use [[fill.random]], [[fill.lattice]] or [[fill.file]], or `start` from \
             a stage without it");
    }
}

/// Checks that rates are slow enough, and that the cell stays wide enough if its course is known. Lengths in
/// m, times in s.
pub(super) fn check_course(
    root: &Section,
    control: &Control,
    domain: &Cell,
    (dt, lasts): (f64, f64),
    least: f64,
) {
    let Some(section) = root.section("cell") else { return };
    let fastest = control.fastest();
    let fastest = fastest.iter().fold(0.0_f64, |most, rate| most.max(rate.abs()));
    if fastest * dt > MOST_IN_STEP {
        section.fail(format!(
            "strains by {:.2e} in a step; must be at most {MOST_IN_STEP:e}: use a rate of at most {:.3e} 1/s, or a \
             shorter step",
            fastest * dt,
            MOST_IN_STEP / dt
        ));
        return;
    }
    // With `start` the cell is that of the snapshot.
    if control.has_target() || root.get("start").is_some() {
        return;
    }
    let mut cell = *domain;
    let interval = lasts / f64::from(LOOKS);
    for look in 1..=LOOKS {
        let rates = control.rates([interval * f64::from(look), interval], |_| 0.0);
        cell.set_rate(&gradient(&rates));
        cell.carry(interval, 0.0);
        if let Some((axis, width)) = cell.thin(least).next() {
            let strain = cell.strained().map(|strained| -strained.strain);
            let strains = COMPONENTS.map(|[i, j]| strain.map_or(0.0, |strain| strain[(i, j)]));
            let all: Vec<String> = (0..6)
                .filter(|&k| strains[k] != 0.0)
                .map(|k| format!("{} = {:.3}", NAMES[k], strains[k]))
                .collect();
            section.fail(format!(
                "with strains {} the cell is {width:.4e} m wide across {axis}; it must stay at least {least:.4e} m, \
                 twice the largest bounding diameter and the skin: use more particles, or fewer steps",
                all.join(", ")
            ));
            return;
        }
    }
}

/// Description of the control of a cell.
pub(super) fn words(control: &Control) -> String {
    let Control { goals, ramp, max_rate, gain } = control;
    let one = |(k, goal): (usize, &Goal)| match goal {
        Goal::Rate(rate) => format!("{} at {rate} 1/s", NAMES[k]),
        Goal::Path(TimeFunction::Oscillation { amplitude, frequency, .. }) => {
            format!("{} oscillates by {amplitude} at {frequency} 1/s", NAMES[k])
        }
        Goal::Path(way) => {
            format!("{} by a table, at most {:.3e} 1/s", NAMES[k], way.fastest())
        }
        Goal::Stress(stress) => format!("{} to {stress:e} Pa", NAMES[k]),
        Goal::MeanStress(stress) => format!("{} with a mean stress of {stress:e} Pa", NAMES[k]),
        Goal::Volume => format!("{} keeps the volume", NAMES[k]),
    };
    let rests = |(_, goal): &(usize, &Goal)| **goal != Goal::Rate(0.0);
    let mut all: Vec<String> = goals.iter().enumerate().filter(rests).map(one).collect();
    if all.is_empty() {
        all.push("rests".to_owned());
    }
    if control.has_target() {
        all.push(format!("at most {max_rate} 1/s, gain {gain}"));
    }
    if *ramp > 0.0 {
        all.push(format!("targets reached in {ramp} s"));
    }
    all.join("; ")
}
