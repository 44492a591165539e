//! The law of the scene: its `kind` and settings in `[law]`, its constants in `[[material]]` and `[[interaction]]`.
//!
//! Another law has a [`Kind`] of its own, its settings in [`kind`], and a function that reads its constants.

use super::matter::Materials;
use super::reader::{Range, Section};
use crate::ids::MaterialId;
use crate::law::linear::{self, damping_ratio_of_restitution};
use crate::law::{Choice, Interactions, Mixing};

/// A law and its settings, without the constants of materials.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// Linear springs and dashpots with friction.
    Linear {
        /// Are dashpots kept from attracting?
        limit_damping: bool,
    },
}

/// The law that `[law]` asks for. `in_contact` is what `[contact]` says of dashpots; they may be limited there instead.
pub(super) fn kind(root: &Section, in_contact: Option<bool>) -> Kind {
    let default = in_contact.unwrap_or(true);
    let law = root.read_or("law", default, |given| {
        let section = given.section()?;
        let kind = section.read_or("kind", (), |given| given.one_of(&[("linear", ())]));
        let limit_damping = section.read_or("limit_damping", default, |given| {
            if in_contact.is_some() {
                given.fail("stands in [contact], too: say it once");
            }
            given.boolean()
        });
        section.finish();
        kind.and(limit_damping)
    });
    Kind::Linear { limit_damping: law.unwrap_or(default) }
}

/// The materials, and the law with their constants, `None` if any is wrong.
pub(super) fn materials(root: &Section, kind: Kind) -> (Materials, Option<Choice>) {
    match kind {
        Kind::Linear { limit_damping } => {
            let read = |section: &Section, mixed: Option<&linear::Constants>| {
                of_linear(section, mixed, limit_damping)
            };
            let (materials, interactions) = with_constants(root, "`normal_stiffness` [N/m]", read);
            let law = interactions.map(|interactions| {
                Choice::Linear(linear::Settings { interactions, limit_damping })
            });
            (materials, law)
        }
    }
}

/// The materials, and their constants as `read` finds them in a section: those of one material, or of two, with what is left
/// out taken from the mixed ones. `needed` are the keys without which there are none.
fn with_constants<C: Mixing + Default>(
    root: &Section,
    needed: &str,
    read: impl Fn(&Section, Option<&C>) -> Option<C>,
) -> (Materials, Option<Interactions<C>>) {
    let (materials, own) = Materials::read(root, needed, |section| read(section, None));
    let own: Option<Vec<C>> = own.into_iter().collect();
    let mut interactions = own.map(|own| Interactions::new(&own));
    let mut seen = Vec::new();
    let mut complete = true;
    for section in root.sections("interaction") {
        let pair = between(&section, &materials, &mut seen);
        let mixed = match (&interactions, pair) {
            (Some(interactions), Some((a, b))) => *interactions.of(a, b),
            // A mistake has been found; this one is only read for more of them.
            _ => C::default(),
        };
        let constants = read(&section, Some(&mixed));
        section.finish();
        match (&mut interactions, pair, constants) {
            (Some(interactions), Some((a, b)), Some(constants)) => {
                interactions.set(a, b, constants);
            }
            _ => complete = false,
        }
    }
    (materials, interactions.filter(|_| complete))
}

/// The two materials of an `[[interaction]]`, the lower id first; `seen` are those of the ones before.
fn between(
    section: &Section,
    materials: &Materials,
    seen: &mut Vec<(MaterialId, MaterialId)>,
) -> Option<(MaterialId, MaterialId)> {
    section.require("between", "the names of two materials", |given| {
        let names = given.list("a list of two materials")?;
        let [a, b] = &names[..] else {
            given.fail("must be a list of two materials");
            return None;
        };
        let (a, b) = (materials.find(a), materials.find(b));
        let (a, b) = (a?.min(b?), a?.max(b?));
        if seen.contains(&(a, b)) {
            given.fail("these two have an interaction already");
        }
        seen.push((a, b));
        Some((a, b))
    })
}

/// Contact constants of a material, or of two, with what is left out taken from `mixed`.
fn of_linear(
    section: &Section,
    mixed: Option<&linear::Constants>,
    limit_damping: bool,
) -> Option<linear::Constants> {
    let normal_stiffness = match mixed {
        None => section.number("normal_stiffness", Range::Positive, "N/m"),
        Some(mixed) => {
            section.number_or("normal_stiffness", mixed.normal_stiffness, Range::Positive, "N/m")
        }
    };
    let tangential = mixed.map_or(normal_stiffness, |m| Some(m.tangential_stiffness));
    let tangential_stiffness = section.number_or(
        "tangential_stiffness",
        tangential.unwrap_or_default(),
        Range::NotNegative,
        "N/m",
    );
    let friction =
        section.number_or("friction", mixed.map_or(0.0, |m| m.friction), Range::NotNegative, "");
    // One with a mistake has no stiffness at all.
    let is_known = match mixed {
        Some(mixed) => mixed.normal_stiffness > 0.0,
        None => normal_stiffness.is_some() || section.get("tangential_stiffness").is_some(),
    };
    if is_known && friction.is_some_and(|f| f > 0.0) && tangential_stiffness == Some(0.0) {
        section.fail("friction needs a spring: `tangential_stiffness` must be greater than 0");
    }
    let damping = mixed.map_or(0.0, |m| m.normal_damping_ratio);
    let normal_damping_ratio = section.read_or("restitution", damping, |given| {
        let restitution = given.number(Range::UpToOne, "")?;
        Some(damping_ratio_of_restitution(restitution, limit_damping))
    });
    let tangential_damping_ratio = section.number_or(
        "tangential_damping_ratio",
        mixed.map_or(0.0, |m| m.tangential_damping_ratio),
        Range::NotNegative,
        "",
    );
    Some(linear::Constants {
        normal_stiffness: normal_stiffness?,
        tangential_stiffness: tangential_stiffness?,
        friction: friction?,
        normal_damping_ratio: normal_damping_ratio?,
        tangential_damping_ratio: tangential_damping_ratio?,
    })
}
