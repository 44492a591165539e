//! The law of the scene: its `kind` and settings in `[law]`, its constants in `[[material]]` and `[[interaction]]`.
//!
//! Another law needs a [`Kind`], its settings in [`kind`], and a function that reads its constants.

use super::matter::Materials;
use super::reader::Section;
use super::walls;
use crate::contact::curvature::LARGEST_RATIO;
use crate::ids::MaterialId;
use crate::law::hertz::{self, jkr};
use crate::law::linear::{self, damping_ratio_of_restitution};
use crate::law::{Additions, Choice, Dashpots, Interactions, Mixing};
use crate::law::{dmt, rolling};
use crate::population::Library;
use crate::shape::{Kind as ShapeKind, Shape};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Bound;

/// A law and its settings, without the constants of materials.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// Linear springs and dashpots with friction.
    Linear {
        /// Options of dashpots.
        dashpots: Dashpots,
    },
    /// Elastic bodies.
    Hertz {
        /// Options of dashpots.
        dashpots: Dashpots,
        /// Is `tangential` friction requested?
        mindlin: bool,
        /// Largest overlap that the time step allows for.
        largest_overlap: LargestOverlap,
    },
}

/// Largest overlap that the time step of elastic bodies allows for.
#[derive(Clone, Copy, Debug)]
pub(super) enum LargestOverlap {
    /// Given in the scene, over the radius, or that of the largest sphere in a particle about its centre [-].
    Given(f64),
    /// From the overlap of particles under the stress on walls.
    Under {
        /// Highest stress of all servos [Pa].
        servos: f64,
        /// Factor on it if other walls are driven [-].
        times: f64,
    },
}

impl LargestOverlap {
    /// Overlap over the radius between materials of these constants, if free walls press with a stress [Pa], [-].
    fn value(self, interactions: &hertz::Interactions, of_free_walls: f64) -> f64 {
        match self {
            Self::Given(overlap) => overlap,
            Self::Under { servos, times } => interactions
                .iter()
                .map(|constants| {
                    hertz::overlap_under(times * servos.max(of_free_walls), &constants)
                })
                .fold(LEAST_LARGEST_OVERLAP, f64::max)
                .min(MOST_LARGEST_OVERLAP),
        }
    }
}

/// Additions to the forces that `[law]` requests.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Requests {
    rolling: bool,
    twisting: bool,
    adhesion: Adhesion,
}

/// Model of attraction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Adhesion {
    #[default]
    None,
    /// After Derjaguin, Muller and Toporov.
    Dmt,
    /// After Johnson, Kendall and Roberts.
    Jkr,
}

impl Requests {
    const fn turning(self) -> bool {
        self.rolling || self.twisting
    }

    fn is_jkr(self) -> bool {
        self.adhesion == Adhesion::Jkr
    }
}

/// Smallest overlap over radius that the step of Hertzian contacts allows for, unless the scene sets it.
const LEAST_LARGEST_OVERLAP: f64 = 0.01;
/// Largest value that a load gives it.
const MOST_LARGEST_OVERLAP: f64 = 0.5;

/// Factor on the stress of servos and free walls if other walls are driven: the stress ratio at which particles with a
/// friction angle of 37 degrees yield.
const DRIVEN: f64 = 4.0;

/// Overlap under the highest stress of walls: that of all servos, and more if walls are driven too.
fn under_load(root: &Section) -> LargestOverlap {
    let servos = walls::highest_stress(root);
    LargestOverlap::Under { servos, times: if walls::are_driven(root) { DRIVEN } else { 1.0 } }
}

/// Law requested by `[law]`.
pub(super) fn kind(root: &Section) -> (Kind, Requests) {
    let linear = (Kind::Linear { dashpots: Dashpots::default() }, Requests::default());
    let law = root.read_or("law", linear, |given| {
        let section = given.section()?;
        let limited = section.boolean_or("limit_damping", true);
        let foreseen = section.boolean_or("foresee", false);
        let offered = [("linear", false), ("hertz", true)];
        let is_hertz = section.read_or("normal", false, |given| given.one_of(&offered))?;
        let asked = asked(&section, is_hertz);
        // Adhesion attracts regardless of dashpots.
        let is_jkr = asked.is_some_and(Requests::is_jkr);
        let dashpots = Dashpots { limited: limited? && !is_jkr, foreseen: foreseen? };
        let kind = parts(&section, is_hertz, dashpots, root);
        kind.zip(asked)
    });
    law.unwrap_or(linear)
}

/// Additions to the forces.
fn asked(section: &Section, is_hertz: bool) -> Option<Requests> {
    let spring = |key| {
        section.read_or(key, false, |given| given.one_of(&[("none", false), ("spring", true)]))
    };
    let (rolling, twisting) = (spring("rolling"), spring("twisting"));
    let adhesion = section.read_or("adhesion", Adhesion::None, |given| {
        let offered = [("none", Adhesion::None), ("dmt", Adhesion::Dmt), ("jkr", Adhesion::Jkr)];
        let adhesion = given.one_of(&offered)?;
        if adhesion == Adhesion::Jkr && !is_hertz {
            given.fail("\"jkr\" needs normal = \"hertz\"; with linear springs use \"dmt\"");
        }
        Some(adhesion)
    });
    let asked = Requests { rolling: rolling?, twisting: twisting?, adhesion: adhesion? };
    if asked.is_jkr() {
        for key in ["rolling", "twisting"] {
            if let Some(given) = section.get(key)
                && asked.turning()
            {
                given.fail(
                    "not with adhesion = \"jkr\", as its stiffness needs a compressive load. Use \"none\", or \
                     adhesion = \"dmt\"",
                );
            }
        }
        section.refuse(
            "limit_damping",
            "is not used with adhesion = \"jkr\", where contacts and dashpots attract",
        );
    }
    Some(asked)
}

/// The law from its parts along the normal and in the contact plane.
fn parts(section: &Section, is_hertz: bool, dashpots: Dashpots, root: &Section) -> Option<Kind> {
    if !is_hertz {
        section.read_or("tangential", (), |given| {
            let offered = [("linear", true), ("none", false), ("mindlin", false)];
            if !given.one_of(&offered)? {
                given.fail(
                    "linear normal springs need \"linear\" (friction 0 omits it); \"none\" and \"mindlin\" need \
                     normal = \"hertz\"",
                );
            }
            Some(())
        })?;
        refuse(section, &["largest_overlap"], "hertz");
        return Some(Kind::Linear { dashpots });
    }
    let mindlin = section.read_or("tangential", true, |given| {
        let offered = [("mindlin", Some(true)), ("none", Some(false)), ("linear", None)];
        let mindlin = given.one_of(&offered)?;
        if mindlin.is_none() {
            given.fail(
                "the tangential stiffness of Hertzian contacts depends on their area: use \"mindlin\" or \"none\", or \
                 normal = \"linear\"",
            );
        }
        mindlin
    })?;
    let largest_overlap = section.read_or("largest_overlap", under_load(root), |given| {
        given.number().map(LargestOverlap::Given)
    })?;
    Some(Kind::Hertz { dashpots, mindlin, largest_overlap })
}

/// Rejects keys that only another normal law uses.
fn refuse(section: &Section, keys: &[&str], normal: &str) {
    for key in keys {
        section
            .refuse(key, &format!("is not used by this law, only by [law] normal = \"{normal}\""));
    }
}

/// Reports the shapes of particles that the law cannot have; `false` if there are any.
pub(super) fn check_shapes(root: &Section, law: &Choice, library: &Library) -> bool {
    let sections = root.sections("shape");
    let unfit = unfit(law, library);
    for (id, message) in &unfit {
        if let Some(section) = sections.get(*id) {
            section.fail(message.clone());
        }
    }
    let is_jkr = matches!(law, Choice::Jkr(_));
    let surfaces = walls::surfaces(root);
    if is_jkr {
        for surface in &surfaces {
            surface.fail(
                "not with adhesion = \"jkr\", whose contacts attract across gaps only between spheres and planes. Use \
                 `planes`, or adhesion = \"dmt\"",
            );
        }
    }
    unfit.is_empty() && (surfaces.is_empty() || !is_jkr)
}

/// First shape of particles that each part of the law cannot have, with the reason.
pub(super) fn unfit(law: &Choice, library: &Library) -> Vec<(usize, String)> {
    let shapes = 0..library.particle_shapes;
    let first = |reason: &dyn Fn(&Shape, &str) -> Option<String>| {
        let of = |id: usize| Some((id, reason(&library.shapes[id], &library.names[id])?));
        shapes.clone().find_map(of)
    };
    let of_forces = match law.forces() {
        Choice::Hertz(_) => {
            let with_faces = shapes.clone().find(|&id| !library.shapes[id].kind().is_smooth());
            let with_faces = with_faces.map(|id| library.names[id].as_str());
            first(&|shape, name| unfit_for_hertz(shape, name, with_faces))
        }
        _ => None,
    };
    let of_adhesion = match law {
        Choice::With(_, Additions { adhesion: Some(_), .. }) => first(&unfit_for_dmt),
        Choice::Jkr(_) => first(&unfit_for_jkr),
        _ => None,
    };
    of_forces.into_iter().chain(of_adhesion).collect()
}

/// `with_faces` names a shape of the scene that has faces or straight sides.
fn unfit_for_hertz(shape: &Shape, name: &str, with_faces: Option<&str>) -> Option<String> {
    let kind = shape.kind();
    if let Some(other) = with_faces.filter(|_| kind.is_smooth() && kind != ShapeKind::Sphere) {
        return Some(format!(
            "normal = \"hertz\" uses the curvature of `{name}`, but faces or straight sides of `{other}` have none. \
             Use normal = \"linear\", spheres, or shapes that are all smooth or all with faces"
        ));
    }
    // Some superellipsoids are ellipsoids.
    let is_ellipsoid = match shape {
        Shape::Superellipsoid(body) => body.as_ellipsoid().is_some(),
        _ => shape.kind() == ShapeKind::Ellipsoid,
    };
    (is_ellipsoid && is_long(shape)).then(|| {
        format!(
            "`{name}` is longer than {:.0} times its thickness, the limit of the elliptic integrals of normal = \
             \"hertz\": use normal = \"linear\"",
            LARGEST_RATIO.sqrt()
        )
    })
}

fn unfit_for_dmt(shape: &Shape, name: &str) -> Option<String> {
    (shape.kind() != ShapeKind::Sphere).then(|| {
        format!(
            "`{name}` is not a sphere, but adhesion = \"dmt\" needs one radius: use adhesion = \"none\""
        )
    })
}

fn unfit_for_jkr(shape: &Shape, name: &str) -> Option<String> {
    (shape.kind() != ShapeKind::Sphere).then(|| {
        format!(
            "`{name}` is not a sphere, but adhesion = \"jkr\" has no exact solution for elliptic contacts. Use \
             adhesion = \"none\""
        )
    })
}

/// Can the ratio of its radii of curvature exceed the range in which Hertz's law is fitted?
fn is_long(shape: &Shape) -> bool {
    let half = shape.half_lengths();
    half.max() / half.min() > LARGEST_RATIO.sqrt()
}

/// Materials, and the law with their constants; `None` if any is invalid.
pub(super) fn materials(
    root: &Section,
    (kind, asked): (Kind, Requests),
) -> (Materials, Option<Choice>) {
    match kind {
        Kind::Linear { dashpots } => {
            let read = |section: &Section, mixed: Option<&linear::Constants>| {
                of_linear(section, mixed, dashpots.limited)
            };
            let law = |interactions| Choice::Linear(linear::Settings { interactions, dashpots });
            with_more(root, asked, read, law)
        }
        Kind::Hertz { dashpots, mindlin, largest_overlap } => {
            let read = |section: &Section, mixed: Option<&hertz::Constants>| {
                of_hertz(section, mixed, dashpots.limited, mindlin)
            };
            let law = |interactions| {
                // Walls that move freely are not known yet.
                let largest_overlap = largest_overlap.value(&interactions, 0.0);
                Choice::Hertz(hertz::Settings { interactions, dashpots, largest_overlap })
            };
            with_more(root, asked, read, law)
        }
    }
}

/// Adapts the law to the stress of walls that move freely [Pa].
pub(super) fn under_free_walls(
    mut law: Choice,
    (kind, _): (Kind, Requests),
    stress: f64,
) -> Choice {
    if let (Kind::Hertz { largest_overlap, .. }, Some(settings)) = (kind, law.hertz_mut()) {
        settings.largest_overlap = largest_overlap.value(&settings.interactions, stress);
    }
    law
}

/// Materials, and the law of these constants with the requested additions.
fn with_more<C: Mixing + Default>(
    root: &Section,
    asked: Requests,
    read: impl Fn(&Section, Option<&C>) -> Option<C>,
    law: impl Fn(Interactions<C>) -> Choice,
) -> (Materials, Option<Choice>) {
    let all = |section: &Section, mixed: Option<&(C, (rolling::Constants, dmt::Constants))>| {
        let forces = read(section, mixed.map(|(forces, _)| forces));
        let turning = of_turning(section, mixed.map(|(_, (turning, _))| turning), asked);
        let adhesion = of_adhesion(section, mixed.map(|(_, (_, adhesion))| adhesion), asked);
        Some((forces?, (turning?, adhesion?)))
    };
    let (materials, interactions) = with_constants(root, all);
    let law = interactions.map(|all| {
        let forces = law(all.map(|(forces, _)| *forces));
        let adhesion = || all.map(|(_, (_, adhesion))| *adhesion);
        let forces = match forces {
            Choice::Hertz(elastic) if asked.is_jkr() => {
                return Choice::Jkr(jkr::Settings { elastic, adhesion: adhesion() });
            }
            forces => forces,
        };
        let adhesion = (asked.adhesion == Adhesion::Dmt).then(adhesion);
        if !asked.turning() && adhesion.is_none() {
            return forces;
        }
        let turning = asked.turning().then(|| all.map(|(_, (turning, _))| *turning));
        Choice::With(Box::new(forces), Additions { turning, adhesion })
    });
    (materials, law)
}

/// Attraction in contacts of a material, or of two, with missing values taken from `mixed`.
fn of_adhesion(
    section: &Section,
    mixed: Option<&dmt::Constants>,
    asked: Requests,
) -> Option<dmt::Constants> {
    let mixed = mixed.copied().unwrap_or_default();
    if asked.adhesion == Adhesion::None {
        let by = "is not used by this law, only by [law] adhesion = \"dmt\" or \"jkr\"";
        section.refuse("surface_energy", by);
        return Some(mixed);
    }
    let energy = section.number_or("surface_energy", mixed.surface_energy);
    Some(dmt::Constants { surface_energy: energy? })
}

/// Default damping ratio of rolling and twisting springs: that of Ai et al.
const TURNING_DAMPING_RATIO: f64 = 0.3;

/// Resistance to rolling and twisting in contacts of a material, or of two, with missing values taken from `mixed`.
fn of_turning(
    section: &Section,
    mixed: Option<&rolling::Constants>,
    asked: Requests,
) -> Option<rolling::Constants> {
    let mixed = mixed.copied().unwrap_or(rolling::Constants {
        damping_ratio: TURNING_DAMPING_RATIO,
        ..rolling::Constants::default()
    });
    let used = |key, used: bool, by: &str| {
        if !used {
            section.refuse(key, &format!("is not used by this law, only by [law] {by}"));
        }
    };
    used("rolling_friction", asked.rolling, "rolling = \"spring\"");
    used("twisting_friction", asked.twisting, "twisting = \"spring\"");
    let either = "rolling = \"spring\" or twisting = \"spring\"";
    used("turning_damping_ratio", asked.turning(), either);
    let number = |key, is_asked: bool, default| {
        if is_asked { section.number_or(key, default) } else { Some(0.0) }
    };
    let rolling = number("rolling_friction", asked.rolling, mixed.rolling_friction);
    let twisting = number("twisting_friction", asked.twisting, mixed.twisting_friction);
    let ratio = number("turning_damping_ratio", asked.turning(), mixed.damping_ratio);
    Some(rolling::Constants {
        rolling_friction: rolling?,
        twisting_friction: twisting?,
        damping_ratio: ratio?,
    })
}

/// Largest number of materials; checking the pairs of more would take seconds.
const MOST_MATERIALS: usize = 1000;

/// Materials, and their constants as `read` returns them for a section: those of one material, or of two, with missing
/// values taken from the mixed ones.
fn with_constants<C: Mixing + Default>(
    root: &Section,
    read: impl Fn(&Section, Option<&C>) -> Option<C>,
) -> (Materials, Option<Interactions<C>>) {
    let (materials, own) = Materials::read(root, |section| read(section, None));
    let count = own.len();
    if count > MOST_MATERIALS {
        root.fail(format!("has {count} materials; must be at most {MOST_MATERIALS}"));
    }
    let own: Option<Vec<C>> = own.into_iter().collect();
    let own = own.filter(|_| count <= MOST_MATERIALS);
    let mut interactions = own.map(|own| Interactions::new(&own));
    let mut seen = BTreeSet::new();
    let mut complete = true;
    for section in root.sections("interaction") {
        let pair = between(&section, &materials, &mut seen);
        let mixed = match (&interactions, pair) {
            (Some(interactions), Some((a, b))) => interactions.of(a, b),
            // After an error this section is only read to find further errors.
            _ => C::default(),
        };
        let constants = read(&section, Some(&mixed));
        match (&mut interactions, pair, constants) {
            (Some(interactions), Some((a, b)), Some(constants)) => {
                interactions.set(a, b, constants);
            }
            _ => complete = false,
        }
    }
    (materials, interactions.filter(|_| complete))
}

/// Optional keys of materials, with their neutral values.
const MAY_BE_LEFT_OUT: [(&str, f64); 6] = [
    ("friction", 0.0),
    ("restitution", 1.0),
    ("tangential_damping_ratio", 0.0),
    ("rolling_friction", 0.0),
    ("twisting_friction", 0.0),
    ("surface_energy", 0.0),
];

/// Number of pairs of materials that a warning names; the others are counted.
const PAIRS_SHOWN: usize = 20;

/// Warnings about properties of one material that act differently in contacts with another that does not set them. They
/// cover each pair that can touch, in a scene without errors.
pub(super) fn left_out<'a>(
    root: &Section<'a>,
    materials: &Materials,
    library: &Library,
) -> Vec<String> {
    let of_both = |section: Section<'a>| {
        let [a, b] = section.get("between")?.list_of(|name| materials.find(name))?;
        Some(((a.min(b), a.max(b)), section))
    };
    let of_both: BTreeMap<_, _> =
        root.sections("interaction").into_iter().filter_map(of_both).collect();
    let values = |section: &Section| {
        MAY_BE_LEFT_OUT.map(|(key, nothing)| Some((section.get(key)?.number()?, nothing)))
    };
    let own: Vec<_> = root.sections("material").iter().map(values).collect();
    let acts_in_one = |given_by: MaterialId, silent: MaterialId| {
        let of_both = of_both.get(&(given_by.min(silent), given_by.max(silent)));
        let keys = MAY_BE_LEFT_OUT.iter().zip(&own[given_by.index()]).zip(&own[silent.index()]);
        keys.filter_map(move |(((key, _), given), silent)| {
            let acts = given.is_some_and(|(value, nothing)| value != nothing) && silent.is_none();
            (acts && of_both.is_none_or(|of| of.get(key).is_none())).then_some(*key)
        })
    };
    let grains: BTreeSet<MaterialId> =
        library.materials[..library.particle_shapes].iter().copied().collect();
    let all: BTreeSet<MaterialId> = library.materials.iter().copied().collect();
    let names: Vec<&str> = materials.names().collect();
    let (mut told, mut more) = (Vec::new(), 0);
    for &a in &all {
        for &b in all.range((Bound::Excluded(a), Bound::Unbounded)) {
            if !grains.contains(&a) && !grains.contains(&b) {
                continue;
            }
            let [of_one, of_other] = [acts_in_one(a, b), acts_in_one(b, a)];
            let (one, other) = (names[a.index()], names[b.index()]);
            let mut all =
                of_one.map(|key| (key, other)).chain(of_other.map(|key| (key, one))).peekable();
            if all.peek().is_none() {
                continue;
            }
            if told.len() == PAIRS_SHOWN {
                more += 1;
                continue;
            }
            let all: Vec<_> = all.map(|(key, silent)| lacks(key, silent)).collect();
            told.push(format!(
                "between materials \"{one}\" and \"{other}\" {}: set it there, to 0 (`restitution` to 1) if that is \
                 intended, or in an [[interaction]] of both",
                all.join("; ")
            ));
        }
    }
    if more > 0 {
        told.push(format!("the same applies to {more} more pairs of materials"));
    }
    told
}

/// Effect of a key in contacts with a material that does not set it.
fn lacks(key: &str, silent: &str) -> String {
    let what = match key {
        "restitution" => "dashpots of `restitution` have half the strength of the other",
        "tangential_damping_ratio" => "`tangential_damping_ratio` has half the value of the other",
        key => &format!("`{key}` is 0"),
    };
    format!("{what}, because \"{silent}\" has none")
}

/// The two materials of an `[[interaction]]`, the lower id first; `seen` holds those of earlier ones.
fn between(
    section: &Section,
    materials: &Materials,
    seen: &mut BTreeSet<(MaterialId, MaterialId)>,
) -> Option<(MaterialId, MaterialId)> {
    section.require("between").and_then(|given| {
        let [a, b] = given.list_of(|name| Some(materials.find(name)))?;
        let (a, b) = (a?.min(b?), a?.max(b?));
        if !seen.insert((a, b)) {
            given.fail("has an interaction already");
        }
        Some((a, b))
    })
}

/// Contact constants of a material, or of two, with missing values taken from `mixed`.
fn of_linear(
    section: &Section,
    mixed: Option<&linear::Constants>,
    limit_damping: bool,
) -> Option<linear::Constants> {
    if mixed.is_none() {
        refuse(section, &["youngs_modulus", "poisson_ratio"], "hertz");
    }
    let normal_stiffness = match mixed {
        None => section.number("normal_stiffness"),
        Some(mixed) => section.number_or("normal_stiffness", mixed.normal_stiffness),
    };
    let tangential = mixed.map_or(normal_stiffness, |m| Some(m.tangential_stiffness));
    let tangential_stiffness =
        section.number_or("tangential_stiffness", tangential.unwrap_or_default());
    let friction = section.number_or("friction", mixed.map_or(0.0, |m| m.friction));
    // After an error the stiffness is unknown.
    let is_known = match mixed {
        Some(mixed) => mixed.normal_stiffness > 0.0,
        None => normal_stiffness.is_some() || section.get("tangential_stiffness").is_some(),
    };
    if is_known && friction.is_some_and(|f| f > 0.0) && tangential_stiffness == Some(0.0) {
        section.fail("friction needs a spring: `tangential_stiffness` must be greater than 0");
    }
    let damping = mixed.map_or(0.0, |m| m.normal_damping_ratio);
    let normal_damping_ratio = section.read_or("restitution", damping, |given| {
        let restitution = given.number()?;
        Some(damping_ratio_of_restitution(restitution, limit_damping))
    });
    let tangential_damping_ratio = section
        .number_or("tangential_damping_ratio", mixed.map_or(0.0, |m| m.tangential_damping_ratio));
    Some(linear::Constants {
        normal_stiffness: normal_stiffness?,
        tangential_stiffness: tangential_stiffness?,
        friction: friction?,
        normal_damping_ratio: normal_damping_ratio?,
        tangential_damping_ratio: tangential_damping_ratio?,
    })
}

/// Constants of Hertzian contacts of a material, or of two, with missing values taken from `mixed`.
fn of_hertz(
    section: &Section,
    mixed: Option<&hertz::Constants>,
    limit_damping: bool,
    mindlin: bool,
) -> Option<hertz::Constants> {
    let others = ["normal_stiffness", "tangential_stiffness", "tangential_damping_ratio"];
    refuse(section, &others, "linear");
    let elastic = if mixed.is_some() {
        Some((0.0, 0.0))
    } else {
        let youngs = section.number("youngs_modulus");
        youngs.zip(section.number("poisson_ratio"))
    };
    let friction = section.read_or("friction", mixed.map_or(0.0, |m| m.friction), |given| {
        if !mindlin {
            given.fail("is not used with [law] tangential = \"none\", but with \"mindlin\"");
        }
        given.number()
    });
    let damping = mixed.map_or(0.0, |m| m.damping_ratio);
    let damping_ratio = section.read_or("restitution", damping, |given| {
        let restitution = given.number()?;
        Some(damping_ratio_of_restitution(restitution, limit_damping))
    });
    let ((youngs, poisson), friction, damping_ratio) = (elastic?, friction?, damping_ratio?);
    Some(match mixed {
        Some(mixed) => hertz::Constants { friction, damping_ratio, ..*mixed },
        None => hertz::Constants::of_material(youngs, poisson, friction, damping_ratio),
    })
}
