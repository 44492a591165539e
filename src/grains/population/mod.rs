//! Properties of particles before they exist: shapes with masses and materials, distributions of sizes and orientations, mixes of shapes, and
//! counts by size of particles inserted or removed.

pub mod census;
pub mod mix;
pub mod orientations;
pub mod sizes;

use crate::ids::{MaterialId, ShapeId};
use crate::math::Vec3;
use crate::shape::{Shape, Union};
use serde::{Deserialize, Serialize};
use sizes::Sizes;
use std::ops::Range;

/// Data shared by particles of one shape.
///
/// The shapes of the particles are followed by pieces of unions, with the mass of their bodies. The last are facets of walls, with the mass of
/// their walls.
#[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Library {
    /// Geometry.
    pub shapes: Vec<Shape>,
    /// Name in the scene.
    pub names: Vec<String>,
    /// Material.
    pub materials: Vec<MaterialId>,
    /// Bounding radius [m].
    pub radius: Vec<f64>,
    /// Least radius of curvature [m].
    pub curvature_radius: Vec<f64>,
    /// Mass [kg].
    pub mass: Vec<f64>,
    /// Mass in contacts: infinite for held particles [kg].
    pub mass_felt: Vec<f64>,
    /// Principal moments of inertia [kg m²].
    pub inertia: Vec<Vec3>,
    /// Size distribution of new particles.
    pub sizes: Vec<Sizes>,
    /// Least and largest scale of a particle: lengths over those of its shape [-].
    pub scales: Vec<[f64; 2]>,
    /// Upper bound of the number of particles of each shape; infinite if unknown [-].
    pub most: Vec<f64>,
    /// Number of shapes of particles.
    pub particle_shapes: usize,
    /// Number of those that are shapes of held particles: the last ones, copies of the others in their order ([`Library::add_held`]).
    pub held_shapes: usize,
    /// Body's shape and number within it, for the next shapes, which are pieces. The remaining shapes are facets of walls.
    pub pieces: Vec<(ShapeId, u16)>,
}

/// Mass at a scale over that of the shape.
#[inline]
pub fn of_mass(scale: f64) -> f64 {
    scale * scale * scale
}

/// Moments of inertia at a scale over those of the shape.
#[inline]
pub fn of_inertia(scale: f64) -> f64 {
    (scale * scale) * of_mass(scale)
}

impl Library {
    /// Adds a shape with a `density` [kg/m³] and returns its id. A shape without finite volume, like a facet, has infinite mass.
    pub fn push(
        &mut self,
        name: &str,
        shape: Shape,
        material: MaterialId,
        density: f64,
    ) -> ShapeId {
        let volume = shape.volume();
        let (mass, inertia) = if volume.is_finite() {
            (density * volume, shape.gyration() * (density * volume))
        } else {
            (f64::INFINITY, Vec3::repeat(f64::INFINITY))
        };
        self.mass.push(mass);
        self.mass_felt.push(mass);
        self.inertia.push(inertia);
        self.radius.push(shape.bounding_radius());
        self.curvature_radius.push(shape.smallest_curvature_radius());
        self.shapes.push(shape);
        self.sizes.push(Sizes::default());
        self.scales.push([1.0; 2]);
        self.most.push(f64::INFINITY);
        self.names.push(name.to_owned());
        self.materials.push(material);
        ShapeId((self.shapes.len() - 1) as u16)
    }

    /// Adds the pieces of unions after the shapes of particles, with infinite mass for held ones. Walls must be added later.
    pub fn add_pieces(&mut self) {
        for of in 0..self.particle_shapes {
            let Shape::Union(body) = &self.shapes[of] else { continue };
            let pieces: Vec<Shape> =
                body.pieces().iter().map(|piece| piece.shape.clone()).collect();
            for (number, shape) in pieces.into_iter().enumerate() {
                let name = format!("{}, piece {}", self.names[of], number + 1);
                let id = self.push(&name, shape, self.materials[of], 0.0);
                self.mass[id.index()] = self.mass[of];
                self.mass_felt[id.index()] = self.mass_felt[of];
                self.inertia[id.index()] = self.inertia[of];
                self.pieces.push((ShapeId(of as u16), number as u16));
            }
        }
    }

    /// Shapes of particles and of pieces.
    pub fn grains(&self) -> Range<usize> {
        0..self.particle_shapes + self.pieces.len()
    }

    /// Facets of walls.
    pub fn facets(&self) -> Range<usize> {
        self.grains().end..self.shapes.len()
    }

    /// Body of a shape and index of the shape of its first piece, if it is a union.
    pub fn union(&self, shape: ShapeId) -> Option<(&Union, usize)> {
        let Shape::Union(body) = &self.shapes[shape.index()] else { return None };
        let first = self.pieces.iter().position(|piece| *piece == (shape, 0))?;
        Some((body, self.particle_shapes + first))
    }

    /// Body of a piece and the piece's number within it, if the shape is a piece.
    #[inline]
    pub fn piece(&self, shape: ShapeId) -> Option<(&Union, usize)> {
        let place = shape.index().checked_sub(self.particle_shapes)?;
        let &(of, number) = self.pieces.get(place)?;
        let Shape::Union(body) = &self.shapes[of.index()] else { return None };
        Some((body, usize::from(number)))
    }

    /// Sets the size distribution of new particles of a shape.
    pub fn set_sizes(&mut self, shape: ShapeId, sizes: Sizes) {
        self.scales[shape.index()] = sizes.scales();
        self.sizes[shape.index()] = sizes;
    }

    /// Extends the range of scales to a particle of this scale.
    pub fn admit(&mut self, shape: ShapeId, scale: f64) {
        let own = self.free(shape);
        for shape in [own, self.held(own)] {
            let [least, largest] = &mut self.scales[shape.index()];
            (*least, *largest) = (least.min(scale), largest.max(scale));
        }
    }

    /// Raises the bound of the number of particles of a shape of the scene; for held ones, if all of that shape are held.
    pub fn admit_number(&mut self, shape: ShapeId, count: f64) {
        let all_held = self.held_shapes > 0 && self.most[shape.index()] == 0.0;
        let shape = if all_held { self.held(shape) } else { shape };
        let most = &mut self.most[shape.index()];
        *most = most.max(count);
    }

    /// Upper bound of the number of particles of a shape of the scene, held or not.
    pub fn most_of(&self, shape: ShapeId) -> f64 {
        self.most[shape.index()].max(self.most[self.held(shape).index()])
    }

    /// Adds a copy of each shape for held particles. A contact with one of these is one with a body of infinite mass.
    ///
    /// `held` tells for a shape whether any of its particles may be held, and whether all are. Walls must be added later.
    pub fn add_held(&mut self, held: impl Fn(ShapeId) -> [bool; 2]) {
        let own = self.particle_shapes;
        self.shapes.extend_from_within(..own);
        self.names.extend_from_within(..own);
        self.materials.extend_from_within(..own);
        self.radius.extend_from_within(..own);
        self.curvature_radius.extend_from_within(..own);
        self.mass.extend_from_within(..own);
        self.mass_felt.resize(2 * own, f64::INFINITY);
        self.inertia.extend_from_within(..own);
        self.sizes.extend_from_within(..own);
        self.scales.extend_from_within(..own);
        self.most.extend_from_within(..own);
        for shape in 0..own {
            let [may_be_held, all_are_held] = held(ShapeId(shape as u16));
            if !may_be_held {
                self.most[own + shape] = 0.0;
            }
            if all_are_held {
                self.most[shape] = 0.0;
            }
        }
        (self.particle_shapes, self.held_shapes) = (2 * own, own);
    }

    /// Number of shapes of particles in the scene.
    pub const fn own_shapes(&self) -> usize {
        self.particle_shapes - self.held_shapes
    }

    /// Whether the shape is one of held particles.
    #[inline]
    pub const fn is_held(&self, shape: ShapeId) -> bool {
        let index = shape.0 as usize;
        index < self.particle_shapes && index + self.held_shapes >= self.particle_shapes
    }

    /// Shape of held particles for a shape of the scene.
    pub const fn held(&self, shape: ShapeId) -> ShapeId {
        ShapeId(shape.0 + self.held_shapes as u16)
    }

    /// Shape of the scene for one that may be that of held particles.
    #[inline]
    pub const fn free(&self, shape: ShapeId) -> ShapeId {
        if self.is_held(shape) { ShapeId(shape.0 - self.held_shapes as u16) } else { shape }
    }

    /// Mass of a particle in its contacts [kg]; infinite if it is held.
    #[inline]
    pub fn mass_in_contacts(&self, shape: ShapeId, scale: f64) -> f64 {
        self.mass_felt[shape.index()] * of_mass(scale)
    }

    /// Whether particles may have other sizes than their shapes.
    pub fn has_sizes(&self) -> bool {
        self.scales.iter().any(|scales| *scales != [1.0; 2])
    }

    /// Shapes of particles with the bounds of their scales: one bound if all are alike.
    pub fn extremes(&self) -> impl Iterator<Item = (ShapeId, f64)> + '_ {
        let of_shape = |(index, &[least, largest]): (usize, &[f64; 2])| {
            let larger = (largest > least).then_some(largest);
            let scales = std::iter::once(least).chain(larger);
            scales.map(move |scale| (ShapeId(index as u16), scale))
        };
        self.scales[..self.particle_shapes].iter().enumerate().flat_map(of_shape)
    }

    /// Largest distance of a particle with faces from a point of its surface [m]; 0 if no particle has faces.
    pub fn longest_with_faces(&self) -> f64 {
        let of = |shape: &Shape| {
            if shape.kind().has_faces() { 2.0 * shape.bounding_radius() } else { 0.0 }
        };
        let reach = |(shape, scale): (ShapeId, f64)| {
            scale
                * match &self.shapes[shape.index()] {
                    Shape::Union(body) => {
                        body.pieces().iter().map(|piece| of(&piece.shape)).fold(0.0, f64::max)
                    }
                    shape => of(shape),
                }
        };
        self.extremes().map(reach).fold(0.0, f64::max)
    }

    /// Mass of a particle of this shape and scale [kg].
    #[inline]
    pub fn mass_at(&self, shape: ShapeId, scale: f64) -> f64 {
        self.mass[shape.index()] * of_mass(scale)
    }

    /// Mean mass of the new particles of a shape [kg].
    pub fn mean_mass(&self, shape: ShapeId) -> f64 {
        self.mass[shape.index()] * self.sizes[shape.index()].mean_volume()
    }

    /// Mean over the particles of a mix of a quantity in proportion to volume, from its value for each shape at a scale of 1.
    pub fn mean_over(&self, mix: &mix::Mix, of_shape: impl Fn(ShapeId) -> f64) -> f64 {
        let volume = |shape: ShapeId| self.sizes[shape.index()].mean_volume();
        mix.shares().map(|(shape, share)| share * of_shape(shape) * volume(shape)).sum()
    }

    /// Principal moments of inertia of a particle of this shape and scale [kg m²].
    #[inline]
    pub fn inertia_at(&self, shape: ShapeId, scale: f64) -> Vec3 {
        self.inertia[shape.index()] * of_inertia(scale)
    }

    /// Whether mass and moments of inertia of a particle of this shape and scale neither overflow nor underflow.
    pub fn has_mass_at(&self, shape: ShapeId, scale: f64) -> bool {
        self.mass_at(shape, scale).is_normal()
            && self.inertia_at(shape, scale).iter().all(|i| i.is_normal())
    }

    /// Largest bounding radius of a particle [m].
    pub fn largest_radius(&self) -> f64 {
        let radius = |(shape, scale): (ShapeId, f64)| self.radius[shape.index()] * scale;
        self.extremes().map(radius).fold(0.0, f64::max)
    }

    /// Half the thickness of the thinnest particle [m]; infinite without shapes.
    pub fn least_inscribed_radius(&self) -> f64 {
        let radius =
            |(shape, scale): (ShapeId, f64)| self.shapes[shape.index()].inscribed_radius() * scale;
        self.extremes().map(radius).fold(f64::INFINITY, f64::min)
    }
}
