//! Inlets and outlets, from the parsed file.

use super::fills::{Fills, reaching};
use super::orientations::orientations;
use super::reader::Section;
use super::regions::region;
use super::{Inlet, Outlet, Rain};
use crate::cell::{AXES, Cell};
use crate::drive::inlet::Amount;
use crate::drive::rain::{Within, of_layer};
use crate::drive::region::Region;
use crate::math::Vec3;
use crate::output::table::has_column;
use crate::population::Library;
use crate::random::Random;

/// Default steps between checks of an outlet.
const LOOK_EVERY: u64 = 10;
/// Default steps between insertions of an inlet.
const ENTER_EVERY: u64 = 100;
/// Characters that file names cannot hold on some systems.
const UNFIT_FOR_FILES: [char; 9] = ['/', '\\', ':', '*', '?', '"', '<', '>', '|'];
/// Longest name with a list [bytes]. Systems allow 255 for the name of a file.
const LONGEST_LISTED: usize = 200;

/// Reads all `[[outlet]]`.
pub(super) fn outlets(root: &Section, domain: Option<&Cell>) -> Option<Vec<Outlet>> {
    let mut names = Vec::new();
    let read = |section: &Section| {
        let name = name(section, &mut names);
        let every = section.whole_or("every", LOOK_EVERY);
        let region = region(section, true);
        let list = list(section, name.as_deref());
        let (region, domain) = (region?, domain?);
        if let Region::Behind { normal, .. } = region
            && let Some(axis) = domain.repeats_along(&normal)
        {
            section.get("normal")?.fail(format!(
                "the domain is periodic along {}, so a plane across it has no side behind it. Use `low` and `high`",
                AXES[axis]
            ));
            return None;
        }
        Some(Outlet { name: name?, region, every: every?, list: list? })
    };
    // All are read, so that all errors are reported at once.
    let all: Vec<Option<Outlet>> = root.sections("outlet").iter().map(read).collect();
    all.into_iter().collect()
}

/// Rejects outlets that take particles away where they appear.
pub(super) fn check_apart(
    root: &Section,
    (inlets, rain): (Option<&Vec<Inlet>>, Option<(&Rain, &Library)>),
    outlets: Option<&Vec<Outlet>>,
    domain: Option<&Cell>,
) {
    /// Number of places of a region that are checked.
    const PLACES: u64 = 64;
    let (Some(outlets), Some(cell)) = (outlets, domain) else { return };
    let taken = |places: Vec<Vec3>| {
        let mut holding = places
            .iter()
            .filter_map(|place| outlets.iter().find(|outlet| outlet.region.holds(place, cell)));
        let outlet = holding.next()?;
        Some(format!(
            "overlaps outlet `{}`, which would remove its particles; move one of them",
            outlet.name
        ))
    };
    for (section, inlet) in root.sections("inlet").iter().zip(inlets.into_iter().flatten()) {
        let places = (0..PLACES).filter_map(|k| inlet.region.draw(&mut Random::of(0, k)));
        if let Some(problem) = taken(places.collect()) {
            section.fail(problem);
        }
    }
    let places = |(rain, library): (&Rain, &Library)| -> Vec<Vec3> {
        if let Some(Within { region, .. }) = &rain.within {
            return (0..PLACES).filter_map(|k| region.draw(&mut Random::of(0, k))).collect();
        }
        let count = rain.in_next_layer(0).min(PLACES);
        (0..count).map(|k| of_layer(rain, 0, 0, k, library).position).collect()
    };
    if let Some(places) = rain.map(places)
        && let Some(problem) = taken(places)
        && let Some(given) = root.section("fill").and_then(|fill| fill.get("rain"))
    {
        given.fail(problem);
    }
}

/// Reads all `[[inlet]]`.
pub(super) fn inlets(root: &Section, fills: &Fills) -> Option<Vec<Inlet>> {
    let mut names = Vec::new();
    let sections = root.sections("inlet");
    let all: Vec<Option<Inlet>> =
        sections.iter().map(|section| inlet(section, fills, &mut names)).collect();
    let rain = root.section("fill").and_then(|fill| fill.get("rain"));
    if let (Some(section), Some(_)) = (sections.first(), rain) {
        section.fail(
            "not with [fill.rain], whose layers may overlap its particles; use a second [[inlet]]",
        );
    }
    if let (Some(section), Some(_)) = (sections.first(), fills.domain.and_then(Cell::shear)) {
        section.fail("not in a sheared domain");
    }
    all.into_iter().collect()
}

fn inlet(section: &Section, fills: &Fills, names: &mut Vec<String>) -> Option<Inlet> {
    let name = name(section, names);
    let mix = fills.mix(section);
    let region = region(section, false);
    let amount = |count: &str, mass: &str| {
        let given = [count, mass].map(|key| section.get(key).map(|given| given.number()));
        match given {
            [Some(_), Some(_)] => {
                section.fail(format!("give either `{count}` or `{mass}`"));
                None
            }
            [Some(count), None] => count.map(|count| Some(Amount::Count(count))),
            [None, Some(mass)] => mass.map(|mass| Some(Amount::Mass(mass))),
            [None, None] => Some(None),
        }
    };
    let rate = amount("rate", "mass_rate");
    let until = amount("count", "mass");
    if let (Some(Some(Amount::Count(count))), Some(given)) = (until, section.get("count"))
        && count.fract() != 0.0
    {
        given.fail("must be a whole number");
    }
    if rate == Some(None) {
        section.fail("`rate` is missing: particles per second [1/s]; or `mass_rate` [kg/s]");
    }
    let begin = section.number_or("begin", 0.0);
    let every = section.whole_or("every", ENTER_EVERY);
    let velocity = section.vector_or("velocity", Vec3::zeros());
    let spread = section.number_or("spread", 0.0);
    let spin = section.number_or("spin", 0.0);
    let orientations = orientations(section);
    let list = list(section, name.as_deref());
    let (region, domain, velocity, spread) = (region?, fills.domain?, velocity?, spread?);
    let (low, high) = region.bounds()?;
    if let Some(beyond) = domain.beyond(&low, &high) {
        section.fail(reaching(&beyond));
    }
    if fills.gravity == Vec3::zeros() && velocity == Vec3::zeros() && spread == 0.0 {
        section.fail("its particles would not move: gravity, `velocity` and `spread` are 0");
    }
    Some(Inlet {
        name: name?,
        mix: mix?,
        region,
        rate: rate??,
        begin: begin?,
        until: until?,
        every: every?,
        velocity,
        spread,
        spin: spin?,
        orientations: orientations?,
        list: list?,
        group: 0,
    })
}

/// Is a list of passing particles requested? It is a file with the name of the inlet or outlet in its name.
fn list(section: &Section, name: Option<&str>) -> Option<bool> {
    section.read_or("list", false, |given| {
        let list = given.boolean()?;
        let is_unfit = |c: char| c.is_control() || UNFIT_FOR_FILES.contains(&c);
        let may_be_listed =
            name.is_none_or(|name| name.len() <= LONGEST_LISTED && !name.contains(is_unfit));
        if list && !may_be_listed {
            given.fail(format!(
                "the name is used for the file of the list: use at most {LONGEST_LISTED} bytes, without control \
                 characters and without {}; or omit `list`",
                UNFIT_FOR_FILES.map(String::from).join(" ")
            ));
        }
        Some(list)
    })
}

/// A unique name whose columns of `history.csv` differ from those of the others: columns of masses end in `_kg`.
fn name(section: &Section, names: &mut Vec<String>) -> Option<String> {
    section.require("name").and_then(|given| {
        let name = given.text()?.to_owned();
        if names.contains(&name) {
            given.fail("another has this name");
        }
        let shares_column = |other: &&String| {
            name.strip_suffix("_kg") == Some(other) || other.strip_suffix("_kg") == Some(&name)
        };
        if let Some(other) = names.iter().find(shares_column) {
            given.fail(format!(
                "it and `{other}` would share a column of history.csv, where masses end in _kg: use another name"
            ));
        }
        let kinds = ["entered", "left", "missing"];
        if let Some(kind) = kinds.iter().find(|kind| has_column(&format!("{kind}_{name}"))) {
            given.fail(format!("history.csv has a column {kind}_{name} already: use another name"));
        }
        names.push(name.clone());
        Some(name)
    })
}
