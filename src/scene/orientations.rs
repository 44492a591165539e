//! Orientations of new particles: from the file as written to [`Orientations`].

use super::Orientations;
use super::reader::{Given, Range, Section};

/// Degrees; the whole sphere.
const LARGEST_TILT: f64 = 180.0;

/// The `orientation` of what appears, random if the file does not say.
pub(super) fn orientations(section: &Section) -> Option<Orientations> {
    section.read_or("orientation", Orientations::Random, |given| {
        if given.entries().is_some() {
            return along(given);
        }
        given.one_of(&[("random", Orientations::Random), ("upright", Orientations::Upright)])
    })
}

/// An own axis along a direction.
fn along(given: &Given) -> Option<Orientations> {
    let section = given.section()?;
    let axis = section.require("axis", "[x, y, z], of any length", Given::direction);
    let spread = section.number_or("spread", 0.0, Range::NotNegative, "degrees");
    let own = section.read_or("own", 2, |given| given.one_of(&[("x", 0), ("y", 1), ("z", 2)]));
    section.finish();
    let (axis, spread, own) = (axis?, spread?, own?);
    if spread > LARGEST_TILT {
        section.get("spread")?.fail(format!("must be at most {LARGEST_TILT:?} degrees"));
        return None;
    }
    // Of small angles the cosine has few digits.
    let half = libm::sin(0.5 * spread.to_radians());
    Some(Orientations::Along { own, axis, cap: 2.0 * half * half })
}
