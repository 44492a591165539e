//! A body of convex pieces, of any form: concave or of several lumps.
//!
//! Pieces may touch and overlap. Volume, centre and moments of inertia are those of the points in any piece.
//!
//! A union has no contacts of its own. Its pieces do ([`crate::particles::pieces`]), and those at one place of the body make one contact. The
//! body stores the degree to which two pieces are joined ([`Union::oneness`]): 1 where everything between their points is in the body, as
//! between two halves of a box; 0 across a dent.

mod mass;

use super::facets::Facets;
use super::moments::{Moments, Placement, Principal};
use super::{Convex, Shape};
use crate::math::{Quat, Vec3, bounds};
use crate::random::Random;
use serde::{Deserialize, Serialize};

/// A convex part of a body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Piece {
    /// Geometry.
    pub shape: Shape,
    /// Centre of mass [m].
    pub centre: Vec3,
    /// Rotation from the piece's axes to those of the body.
    pub rotation: Quat,
}

impl Piece {
    /// Whether a point, in the axes of the body, is in the piece.
    pub fn contains(&self, point: &Vec3) -> bool {
        self.shape.contains(&self.rotation.inverse_transform_vector(&(point - self.centre)))
    }

    fn support(&self, direction: &Vec3) -> Vec3 {
        let own = self.rotation.inverse_transform_vector(direction);
        self.centre + self.rotation * self.shape.support(&own)
    }

    /// A random point of the piece.
    fn point(&self, random: &mut Random) -> Vec3 {
        let half = self.shape.half_lengths();
        loop {
            let point = half.map(|half| half * random.signed());
            if self.shape.contains(&point) {
                return self.centre + self.rotation * point;
            }
        }
    }
}

/// Reason why no body can be made of pieces.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum UnionError {
    /// There is no piece.
    #[error("a union needs at least one piece")]
    Empty,
    /// There are more pieces than names.
    #[error("a union has at most {most} pieces, not {count}", most = Union::MOST)]
    TooMany {
        /// Number of pieces.
        count: usize,
    },
    /// A piece adds nothing.
    #[error("piece {inner} is within piece {outer}: leave it out")]
    Within {
        /// Number of the inner piece, from 1.
        inner: usize,
        /// Number of the outer piece, from 1.
        outer: usize,
    },
}

/// A body of convex pieces about its centre of mass, axes along its principal axes of inertia.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct Union(Stored);

/// Representation in messages and files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Stored {
    pieces: Vec<Piece>,
    volume: f64,
    gyration: Vec3,
    bounding_radius: f64,
    placement: Placement,
    /// Relative error of the volume.
    error: f64,
    /// See [`Union::far`].
    far: f64,
    /// See [`Union::asked`].
    #[serde(default)]
    asked: u32,
    /// See [`Union::oneness`], row by row.
    oneness: Vec<f64>,
}

impl From<Union> for Stored {
    fn from(Union(stored): Union) -> Self {
        stored
    }
}

impl TryFrom<Stored> for Union {
    type Error = String;

    fn try_from(stored: Stored) -> Result<Self, String> {
        let count = stored.pieces.len();
        let is_sound = (1..=Self::MOST).contains(&count) && stored.oneness.len() == count * count;
        is_sound.then_some(Self(stored)).ok_or_else(|| format!("no union of {count} pieces"))
    }
}

/// Share of the points between two pieces in the body below which the pieces are not joined.
const APART: f64 = 0.9;
/// Number of points sampled between two pieces.
const LOOKS: usize = 1000;
/// Points this near to a piece count as in it, over the size of the body.
const NEAR: f64 = 1e-9;

impl Union {
    /// Largest number of pieces of a body.
    pub const MOST: usize = 1 << 10;

    /// A body of pieces in any axes.
    ///
    /// # Errors
    /// If there are no pieces or too many, or if one is within another.
    pub fn new(pieces: Vec<Piece>) -> Result<Self, UnionError> {
        Self::check(&pieces)?;
        let (principal, error) = mass::of(&pieces)?;
        Ok(Self::seen_from(&principal, pieces, error))
    }

    /// A body whose pieces, all with faces, represent the inside of a closed surface of triangles, in the same axes.
    ///
    /// Mass and inertia are those of the surface. Pieces within others are left out.
    ///
    /// # Errors
    /// If there are no pieces or too many.
    pub fn in_surface(mut pieces: Vec<Piece>, surface: &[[Vec3; 3]]) -> Result<Self, UnionError> {
        let moments = Moments::of_surface(surface);
        let of_pieces = loop {
            Self::check(&pieces)?;
            match mass::of(&pieces) {
                Ok((principal, _)) => break principal.volume,
                Err(UnionError::Within { inner, .. }) => drop(pieces.remove(inner - 1)),
                Err(error) => return Err(error),
            }
        };
        let error = of_pieces / moments.volume() - 1.0;
        let mut body = Self::seen_from(&moments.principal(), pieces, error);
        body.0.far = body.distance_to(surface);
        Ok(body)
    }

    fn check(pieces: &[Piece]) -> Result<(), UnionError> {
        match pieces.len() {
            0 => Err(UnionError::Empty),
            count if count > Self::MOST => Err(UnionError::TooMany { count }),
            _ => Ok(()),
        }
    }

    fn seen_from(principal: &Principal, mut pieces: Vec<Piece>, error: f64) -> Self {
        let placement = principal.placement;
        for piece in &mut pieces {
            let seen = piece.centre - placement.centre;
            piece.centre = placement.axes.inverse_transform_vector(&seen);
            piece.rotation = placement.axes.inverse() * piece.rotation;
        }
        let reach = |piece: &Piece| match piece.shape.facets() {
            Some(facets) if piece.shape.margin() <= 0.0 => {
                let corners = facets.vertices().iter();
                corners.map(|at| (piece.centre + piece.rotation * at).norm()).fold(0.0, f64::max)
            }
            _ => piece.centre.norm() + piece.shape.bounding_radius(),
        };
        let bounding_radius = pieces.iter().map(reach).fold(0.0, f64::max);
        let oneness = oneness(&pieces);
        let (volume, gyration) = (principal.volume, principal.gyration);
        Self(Stored {
            pieces,
            volume,
            gyration,
            bounding_radius,
            placement,
            error,
            far: 0.0,
            asked: 0,
            oneness,
        })
    }

    /// Pieces, in the axes of the body.
    pub fn pieces(&self) -> &[Piece] {
        &self.0.pieces
    }

    /// Relative error of the volume; 0 where it is exact within rounding.
    ///
    /// For a body that represents a surface, it is the relative excess of the volume of its pieces.
    pub const fn error(&self) -> f64 {
        self.0.error
    }

    /// Largest distance of pieces from the surface that they represent [m]; 0 without a surface.
    pub const fn far(&self) -> f64 {
        self.0.far
    }

    /// Largest number of pieces into which the mesh was to be cut; 0 without a mesh.
    pub const fn asked(&self) -> u32 {
        self.0.asked
    }

    /// Copy that records the largest number of pieces into which its mesh was to be cut.
    #[must_use]
    pub const fn of_at_most(mut self, asked: u32) -> Self {
        self.0.asked = asked;
        self
    }

    /// Largest distance of pieces with faces from a surface, which is given in the axes of the file [m].
    ///
    /// It is taken at the corners, the middles of sides and the middles of the surface's triangles.
    fn distance_to(&self, surface: &[[Vec3; 3]]) -> f64 {
        let Placement { centre, axes } = self.0.placement;
        let points = surface.iter().flat_map(|[a, b, c]| {
            [*a, *b, *c, (a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5, (a + b + c) / 3.0]
        });
        let far = |point: Vec3| self.depth(&axes.inverse_transform_vector(&(point - centre))).abs();
        points.map(far).fold(0.0, f64::max)
    }

    /// Depth of a point in the deepest piece with faces [m]; negative outside of all.
    fn depth(&self, point: &Vec3) -> f64 {
        let depth = |piece: &Piece| {
            let own = piece.rotation.inverse_transform_vector(&(point - piece.centre));
            let planes = piece.shape.facets().into_iter().flat_map(Facets::planes);
            planes.map(|plane| plane.offset - plane.normal.dot(&own)).fold(f64::INFINITY, f64::min)
        };
        self.0.pieces.iter().map(depth).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Degree to which two pieces are joined, from 0 to 1.
    #[inline]
    pub fn oneness(&self, one: usize, other: usize) -> f64 {
        self.0.oneness[one * self.0.pieces.len() + other]
    }
}

/// Degrees from the share of the points between two pieces that is in the body.
fn oneness(pieces: &[Piece]) -> Vec<f64> {
    let count = pieces.len();
    let (low, high) = bounds(&pieces.iter().map(|piece| piece.centre).collect::<Vec<_>>());
    let largest = pieces.iter().map(|piece| piece.shape.bounding_radius()).fold(0.0, f64::max);
    let near = NEAR * ((high - low).norm() + largest);
    let mut oneness = vec![1.0; count * count];
    for one in 0..count {
        for other in 0..one {
            let mut random = Random::of(one as u64, other as u64);
            let is_held = |_: &usize| {
                let (a, b) = (pieces[one].point(&mut random), pieces[other].point(&mut random));
                let at = a + (b - a) * random.unit();
                pieces.iter().any(|piece| is_near(piece, &at, near))
            };
            let share = (0..LOOKS).filter(is_held).count() as f64 / LOOKS as f64;
            let value = ((share - APART) / (1.0 - APART)).max(0.0);
            oneness[one * count + other] = value;
            oneness[other * count + one] = value;
        }
    }
    oneness
}

/// Whether a point is in a piece, or at most `near` outside.
fn is_near(piece: &Piece, point: &Vec3, near: f64) -> bool {
    let inwards = piece.centre - point;
    let distance = inwards.norm();
    distance <= near || piece.contains(&(point + inwards * (near / distance)))
}

impl Convex for Union {
    fn support(&self, direction: &Vec3) -> Vec3 {
        let points = self.0.pieces.iter().map(|piece| piece.support(direction));
        let farther = |a: Vec3, b: Vec3| if b.dot(direction) > a.dot(direction) { b } else { a };
        points.reduce(farther).unwrap_or_default()
    }

    fn bounding_radius(&self) -> f64 {
        self.0.bounding_radius
    }

    /// Inscribed radius of the thinnest piece.
    fn inscribed_radius(&self) -> f64 {
        let radii = self.0.pieces.iter().map(|piece| piece.shape.inscribed_radius());
        radii.fold(f64::INFINITY, f64::min)
    }

    fn volume(&self) -> f64 {
        self.0.volume
    }

    fn gyration(&self) -> Vec3 {
        self.0.gyration
    }

    fn contains(&self, point: &Vec3) -> bool {
        self.0.pieces.iter().any(|piece| piece.contains(point))
    }

    fn placement(&self) -> Option<&Placement> {
        Some(&self.0.placement)
    }
}
