//! Materials, their interactions, and shapes: from the file as written to the library.

use super::Mix;
use super::geometry::geometry;
use super::reader::{Given, Range, Section};
use super::report::suggestion;
use crate::ids::{MaterialId, ShapeId};
use crate::law::linear::{Constants, Interactions, damping_ratio_of_restitution};
use crate::particles::sizes::Sizes;
use crate::particles::{Library, of_inertia, of_mass};
use crate::shape::{Shape, Sphere};
use serde::{Deserialize, Serialize};
use std::path::Path;

// --- names ---

/// The names of all materials, or of all shapes, or of all walls.
#[derive(Default)]
pub(super) struct Names {
    kind: &'static str,
    pub(super) names: Vec<String>,
}

impl Names {
    pub(super) const fn of(kind: &'static str) -> Self {
        Self { kind, names: Vec::new() }
    }

    /// Reads the name of the next entry. One without a name gets an empty one, so that indices stay.
    pub(super) fn add(&mut self, section: &Section) {
        let name = section.require("name", "any text", |given| {
            let name = given.text()?;
            if self.names.iter().any(|n| n == name) {
                given.fail(format!("another {} has this name", self.kind));
            }
            Some(name.to_owned())
        });
        self.names.push(name.unwrap_or_default());
    }

    pub(super) fn listing(&self) -> impl Iterator<Item = &str> {
        self.names.iter().map(String::as_str).filter(|name| !name.is_empty())
    }

    /// The index of a name that the file gives.
    pub(super) fn find(&self, given: &Given, name: &str) -> Option<usize> {
        let index = self.names.iter().position(|n| n == name);
        if index.is_none() {
            let hint = suggestion(name, self.listing(), "there are");
            given.fail(format!("no such {}{hint}", self.kind));
        }
        index
    }

    /// The index of the name under this key; of the only one there is, if the key is left out.
    pub(super) fn find_in(&self, section: &Section, key: &'static str) -> Option<usize> {
        match section.get(key) {
            Some(given) => self.find(&given, given.text()?),
            None if self.names.len() == 1 => Some(0),
            None => {
                let names = self.listing().collect::<Vec<_>>().join(", ");
                if !names.is_empty() {
                    section.fail(format!("`{key}` is missing: one of {names}"));
                }
                None
            }
        }
    }
}

// --- materials ---

/// What a body is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Its name.
    pub name: String,
    /// Density [kg/m³].
    pub density: f64,
}

pub(super) struct Materials {
    pub(super) names: Names,
    pub(super) items: Vec<Option<Material>>,
    /// How two bodies of each act on each other.
    constants: Vec<Option<Constants>>,
}

impl Materials {
    pub(super) fn read(root: &Section, limit_damping: bool) -> Self {
        let mut names = Names::of("material");
        let what = "`name`, `density` [kg/m3], `normal_stiffness` [N/m]";
        let sections = root.some_sections("material", what);
        let read = sections.iter().map(|section| {
            names.add(section);
            let name = names.names.last().cloned();
            let density = section.number("density", Range::Positive, "kg/m3");
            let constants = constants(section, None, limit_damping);
            section.finish();
            let material = name.zip(density).map(|(name, density)| Material { name, density });
            (material, constants)
        });
        let (items, constants) = read.unzip();
        Self { names, items, constants }
    }

    pub(super) fn find_in(&self, section: &Section, key: &'static str) -> Option<MaterialId> {
        self.names.find_in(section, key).map(|index| MaterialId(index as u16))
    }

    pub(super) fn get(&self, id: MaterialId) -> Option<&Material> {
        self.items[id.index()].as_ref()
    }
}

/// Contact constants of a material, or of two, with what is left out taken from `mixed`.
fn constants(
    section: &Section,
    mixed: Option<&Constants>,
    limit_damping: bool,
) -> Option<Constants> {
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
    Some(Constants {
        normal_stiffness: normal_stiffness?,
        tangential_stiffness: tangential_stiffness?,
        friction: friction?,
        normal_damping_ratio: normal_damping_ratio?,
        tangential_damping_ratio: tangential_damping_ratio?,
    })
}

pub(super) fn interactions(
    root: &Section,
    materials: &Materials,
    limit_damping: bool,
) -> Option<Interactions> {
    let all: Option<Vec<Constants>> = materials.constants.iter().copied().collect();
    let mut interactions = all.map(|all| Interactions::new(&all));
    let mut seen = Vec::new();
    let mut complete = true;
    for section in root.sections("interaction") {
        let pair = section.require("between", "the names of two materials", |given| {
            let names = given.list("a list of two materials")?;
            let [a, b] = &names[..] else {
                given.fail("must be a list of two materials");
                return None;
            };
            let id = |given: &Given| {
                materials.names.find(given, given.text()?).map(|index| MaterialId(index as u16))
            };
            let (a, b) = (id(a), id(b));
            let (a, b) = (a?.min(b?), a?.max(b?));
            if seen.contains(&(a, b)) {
                given.fail("these two have an interaction already");
            }
            seen.push((a, b));
            Some((a, b))
        });
        let mixed = match (&interactions, pair) {
            (Some(interactions), Some((a, b))) => *interactions.of(a, b),
            // A mistake has been found; this one is only read for more of them.
            _ => Constants::default(),
        };
        let constants = constants(&section, Some(&mixed), limit_damping);
        section.finish();
        match (&mut interactions, pair, constants) {
            (Some(interactions), Some((a, b)), Some(constants)) => {
                interactions.set(a, b, constants);
            }
            _ => complete = false,
        }
    }
    interactions.filter(|_| complete)
}

// --- shapes ---

pub(super) struct Shapes {
    pub(super) names: Names,
    /// One entry per shape of the file; a sphere of no size where there was a mistake.
    pub(super) library: Library,
    /// No mistake in any.
    pub(super) complete: bool,
}

impl Shapes {
    /// Paths of meshes are relative to `folder`.
    pub(super) fn read(root: &Section, materials: &Materials, folder: &Path) -> Self {
        let mut shapes =
            Self { names: Names::of("shape"), library: Library::default(), complete: true };
        for section in &root.some_sections("shape", "`name`, `kind` and its size") {
            shapes.names.add(section);
            let material = materials.find_in(section, "material");
            let geometry = geometry(section, folder);
            let sizes = section.read_or("size", Sizes::One, sizes);
            section.finish();
            let density = material.and_then(|id| materials.get(id)).map(|m| m.density);
            shapes.complete &= match (&geometry, density, &sizes) {
                (Some(geometry), Some(density), Some(sizes)) => {
                    has_mass(section, geometry, density, sizes)
                }
                _ => false,
            };
            let id = shapes.library.push(
                shapes.names.names.last().map_or("", String::as_str),
                geometry.unwrap_or(Shape::Sphere(Sphere { radius: 0.0 })),
                material.unwrap_or(MaterialId(0)),
                density.unwrap_or_default(),
            );
            shapes.library.set_sizes(id, sizes.unwrap_or_default());
        }
        shapes.library.particle_shapes = shapes.library.shapes.len();
        shapes
    }

    /// Of the particles of a mix [m].
    pub(super) fn largest_radius(&self, mix: &Mix) -> f64 {
        let Library { shapes, sizes, .. } = &self.library;
        let largest = |id: ShapeId| {
            let [_, scale] = sizes[id.index()].scales();
            shapes[id.index()].bounding_radius() * scale
        };
        mix.shapes().map(largest).fold(0.0, f64::max)
    }
}

/// How sizes are distributed, by number: scales of all lengths of the shape.
fn sizes(given: &Given) -> Option<Sizes> {
    let section = given.section()?;
    let what = "a list of two numbers greater than 0: the smallest scale and the largest";
    let scales = section.require("uniform", what, |given| {
        let [least, largest] = given.list_of(what)?.map(|item| item.number(Range::Positive, ""));
        let (least, largest) = (least?, largest?);
        if least > largest {
            given.fail(format!("{least:?} is more than {largest:?}; must be {what}"));
            return None;
        }
        Some([least, largest])
    });
    section.finish();
    scales.map(Sizes::Uniform)
}

/// A size of 1e-200 m is a positive number, but its volume is not.
fn has_mass(section: &Section, geometry: &Shape, density: f64, sizes: &Sizes) -> bool {
    let mass = density * geometry.volume();
    for scale in sizes.scales() {
        let (mass, inertia) =
            (mass * of_mass(scale), geometry.gyration() * mass * of_inertia(scale));
        if !(mass.is_normal() && inertia.iter().all(|i| i.is_normal())) {
            section.fail(format!(
                "mass ({mass:e} kg) or moment of inertia leave the range of numbers"
            ));
            return false;
        }
    }
    true
}
