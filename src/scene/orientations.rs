//! Orientations of new particles, from the parsed file to [`Orientations`].

use super::Orientations;
use super::reader::{Given, Section};

/// The `orientation` of new particles; random by default.
pub(super) fn orientations(section: &Section) -> Option<Orientations> {
    section.read_or("orientation", Orientations::Random, |given| {
        if given.text().is_none() {
            return along(given);
        }
        given.one_of(&[("random", Orientations::Random), ("upright", Orientations::Upright)])
    })
}

/// A body axis along a direction.
fn along(given: &Given) -> Option<Orientations> {
    let section = given.section()?;
    let axis = section.require("axis").and_then(|given| given.direction());
    let spread = section.number_or("spread", 0.0);
    let own = section.read_or("own", 2, |given| given.one_of(&[("x", 0), ("y", 1), ("z", 2)]));
    let (axis, spread, own) = (axis?, spread?, own?);
    // The cosine of a small angle has few significant digits.
    let half = libm::sin(0.5 * spread.to_radians());
    Some(Orientations::Along { own, axis, cap: 2.0 * half * half })
}
