//! Materials and shapes, from the parsed file to the library.

use super::Mix;
use super::before;
use super::geometry::{geometry, is_union};
use super::mistakes::suggestion;
use super::pieces::union;
use super::reader::{Given, Section};
use super::sizes::sizes;
use crate::ids::{MaterialId, ShapeId};
use crate::population::sizes::Sizes;
use crate::population::{Library, of_inertia, of_mass};
use crate::shape::{Shape, Sphere};
use crate::text::{MOST_NAMED, listed};
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};
use std::path::Path;

// --- names ---

/// Names of all materials, or of all shapes, or of all walls.
#[derive(Default)]
pub(super) struct Names {
    kind: &'static str,
    pub(super) all: Vec<String>,
    /// First index of each name.
    indices: HashMap<String, usize>,
    /// Entries that are pieces of others; they are used only where they are named.
    pieces: BTreeSet<usize>,
}

impl Names {
    pub(super) fn of(kind: &'static str) -> Self {
        Self { kind, ..Self::default() }
    }

    /// First index of this name.
    pub(super) fn index(&self, name: &str) -> Option<usize> {
        self.indices.get(name).copied()
    }

    pub(super) fn push(&mut self, name: &str) {
        self.indices.entry(name.to_owned()).or_insert(self.all.len());
        self.all.push(name.to_owned());
    }

    /// Reads the name of the next entry. An entry without a name gets an empty one, so that indices stay.
    pub(super) fn add(&mut self, section: &Section) {
        let given = section.require("name");
        let name = given.as_ref().and_then(Given::text).unwrap_or_default();
        if let Some(given) = given.filter(|_| !name.is_empty() && self.index(name).is_some()) {
            given.fail(format!("another {} has this name", self.kind));
        }
        self.push(name);
    }

    pub(super) fn listing(&self) -> impl Iterator<Item = &str> {
        self.all.iter().map(String::as_str).filter(|name| !name.is_empty())
    }

    /// Index of a name in the file; an unknown one is reported.
    pub(super) fn find(&self, given: &Given, name: &str) -> Option<usize> {
        let index = self.index(name);
        if index.is_none() {
            let hint = suggestion(name, self.listing(), "there are");
            given.fail(format!("no such {}{hint}", self.kind));
        }
        index
    }

    /// Index of the name under this key; without the key, of the only entry that is not a piece.
    pub(super) fn find_in(&self, section: &Section, key: &str) -> Option<usize> {
        let mut whole = (0..self.all.len()).filter(|index| !self.pieces.contains(index));
        match (section.get(key), whole.next(), whole.next()) {
            (Some(given), ..) => self.find(&given, given.text()?),
            (None, only, None) if only.is_some() => only,
            (None, ..) => {
                let names = listed(self.listing(), MOST_NAMED);
                if !names.is_empty() {
                    section.fail(format!("`{key}` is missing: one of {names}"));
                }
                None
            }
        }
    }
}

// --- materials ---

/// A material of bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Its name.
    pub name: String,
    /// Density [kg/m³].
    pub density: f64,
}

pub(super) struct Materials {
    names: Names,
    pub(super) items: Vec<Option<Material>>,
}

impl Materials {
    /// All materials, with the results of `read` for their sections.
    pub(super) fn read<C>(
        root: &Section,
        read: impl Fn(&Section) -> Option<C>,
    ) -> (Self, Vec<Option<C>>) {
        let mut names = Names::of("material");
        let sections = root.sections("material");
        let all = sections.iter().map(|section| {
            names.add(section);
            let name = names.all.last().cloned();
            let density = section.number("density");
            let constants = read(section);
            let material = name.zip(density).map(|(name, density)| Material { name, density });
            (material, constants)
        });
        let (items, constants) = all.unzip();
        (Self { names, items }, constants)
    }

    /// Names, by `MaterialId`.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.names.all.iter().map(String::as_str)
    }

    pub(super) fn find(&self, given: &Given) -> Option<MaterialId> {
        self.names.find(given, given.text()?).map(|index| MaterialId(index as u16))
    }

    pub(super) fn find_in(&self, section: &Section, key: &str) -> Option<MaterialId> {
        self.names.find_in(section, key).map(|index| MaterialId(index as u16))
    }

    pub(super) fn get(&self, id: MaterialId) -> Option<&Material> {
        self.items[id.index()].as_ref()
    }
}

// --- shapes ---

pub(super) struct Shapes {
    pub(super) names: Names,
    /// One entry per shape of the file; a sphere of no size for an invalid one.
    pub(super) library: Library,
    /// Are all shapes valid?
    pub(super) complete: bool,
}

impl Shapes {
    /// Reads all shapes. Paths of meshes are relative to `folder`. Meshes keep their cut from the snapshot
    /// with which the run begins.
    pub(super) fn read(
        root: &Section,
        materials: &Materials,
        folder: &Path,
        before: Option<&Path>,
    ) -> Self {
        let mut shapes =
            Self { names: Names::of("shape"), library: Library::default(), complete: true };
        let sections = root.sections("shape");
        for section in &sections {
            shapes.names.add(section);
        }
        let (geometries, pieces) = geometries(&sections, &shapes.names, folder, before);
        shapes.names.pieces = pieces;
        for (k, (section, geometry)) in sections.iter().zip(geometries).enumerate() {
            let material = materials.find_in(section, "material");
            let sizes = section.read_or("size", Sizes::One, sizes);
            let density = material.and_then(|id| materials.get(id)).map(|m| m.density);
            shapes.complete &= match (&geometry, density, &sizes) {
                (Some(geometry), Some(density), Some(sizes)) => {
                    has_mass(section, geometry, density, sizes)
                }
                _ => false,
            };
            let id = shapes.library.push(
                &shapes.names.all[k],
                geometry.unwrap_or(Shape::Sphere(Sphere { radius: 0.0 })),
                material.unwrap_or(MaterialId(0)),
                density.unwrap_or_default(),
            );
            shapes.library.set_sizes(id, sizes.unwrap_or_default());
        }
        shapes.library.particle_shapes = shapes.library.shapes.len();
        shapes
    }

    /// Largest bounding radius of the particles of a mix [m].
    pub(super) fn largest_radius(&self, mix: &Mix) -> f64 {
        let Library { shapes, sizes, .. } = &self.library;
        let largest = |id: ShapeId| {
            let [_, scale] = sizes[id.index()].scales();
            shapes[id.index()].bounding_radius() * scale
        };
        mix.shapes().map(largest).fold(0.0, f64::max)
    }
}

/// Shapes of all sections, and those that are pieces of unions; a piece is never a union.
fn geometries(
    sections: &[Section],
    names: &Names,
    folder: &Path,
    before: Option<&Path>,
) -> (Vec<Option<Shape>>, BTreeSet<usize>) {
    let pieces = RefCell::new(BTreeSet::new());
    let single = |section: &Section| (!is_union(section)).then(|| geometry(section, folder));
    let singles: Vec<Option<Option<Shape>>> = sections.iter().map(single).collect();
    let find = |given: &Given| {
        let index = names.find(given, given.text()?)?;
        pieces.borrow_mut().insert(index);
        let Some(shape) = &singles[index] else {
            given.fail("is a union, but pieces must be convex: name its pieces here");
            return None;
        };
        shape.clone()
    };
    let of = |(section, single): (&Section, &Option<Option<Shape>>)| match single {
        Some(shape) => shape.clone(),
        None => union(section, find, folder, |name| before::union(before?, name)),
    };
    let all = sections.iter().zip(&singles).map(of).collect();
    (all, pieces.into_inner())
}

/// Checks mass and moments of inertia: a size of 1e-200 m is a positive number, but its volume is not.
fn has_mass(section: &Section, geometry: &Shape, density: f64, sizes: &Sizes) -> bool {
    let mass = density * geometry.volume();
    for scale in sizes.scales() {
        let (mass, inertia) =
            (mass * of_mass(scale), geometry.gyration() * mass * of_inertia(scale));
        if !(mass.is_normal() && inertia.iter().all(|i| i.is_normal())) {
            section.fail(format!(
                "mass ({mass:e} kg) or moment of inertia are outside the range of numbers"
            ));
            return false;
        }
    }
    true
}
