//! Contact resolution: from two bodies in place to overlap, normal and contact point.
//!
//! The overlap is defined by the common normal. `h` is the support function of a body about its own centre, and `r` points from
//! the centre of A to the centre of B. For every unit vector `n`, `δ(n) = h_A(n) + h_B(-n) - n·r` is an upper bound of the overlap:
//!
//! - **overlap = min δ(n)** over all `n`;
//! - the normal is the minimiser, from A to B;
//! - `P_A` and `P_B` are the support points along the normal;
//! - the contact point is the middle of the segment between them. Where edges or faces touch along more than a point, it is the
//!   centroid of all such segments.
//!
//! All geometry works on `r`, never on positions, so a pair 10⁶ sizes from the origin loses no digits.
//!
//! Two bodies with faces, and such a body on a plane or on triangles, have another definition unless a method is asked for by
//! name. The thickness of the shared volume is the overlap, its gradient gives the normal, and a [`Patch`] comes with each contact
//! ([`thickness`]).
//!
//! A resolver works on a batch of pairs of one pair of kinds, with one virtual call per batch. A pair that touched at the last
//! step brings its last normal as a warm start.

mod clearance;
mod common_normal;
mod converged;
mod cores;
pub mod curvature;
mod epa;
mod eroded_gjk;
mod fallback;
mod gjk;
mod half_space;
mod in_lanes;
mod methods;
mod newton;
mod overlap;
mod patch;
mod polish;
mod record;
mod smooth_common_normal;
mod sphere_sphere;
mod triangle_mesh;

pub use clearance::clearance;
pub use common_normal::{CommonNormal, SeededCommonNormal};
pub use converged::{Converged, Definition};
pub use cores::Cores;
pub use epa::Epa;
pub use eroded_gjk::ErodedGjk;
pub use fallback::Chain;
pub use half_space::AgainstHalfSpace;
pub use methods::{Method, needs_form, table, table_with_patches};
pub use overlap::{
    OfPieces, Overlap, OverlapWithSurface, PairOfPieces, Thickness, contact_of, thickness,
    thickness_of_pieces, thickness_of_pieces_on_surface, thickness_on_surface,
};
pub use record::{ContactRecord, ContactRecords, Geometry, StateColumn};
pub use smooth_common_normal::SmoothCommonNormal;
pub use sphere_sphere::SphereSphere;
pub use triangle_mesh::{AgainstTriangleMesh, cut};

use crate::cell::Cell;
use crate::ids::{ShapeId, Slot};
use crate::lanes::{Eight, Gather, Row as _, RowPairs, Triple, WIDTH, row};
use crate::math::{Mat3, Quat, Vec3};
use crate::shape::facets::Plane;
use crate::shape::hull::Hull;
use crate::shape::{Core, Form, Kind, Shape};

/// The geometry of one contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Touch {
    /// Penetration depth, positive [m].
    pub overlap: f64,
    /// Unit normal from A to B.
    pub normal: Vec3,
    /// Contact point relative to the centre of A [m].
    pub point: Vec3,
}

impl Touch {
    /// Outcome of this geometry: touching if the overlap is positive, failed if it is not a number.
    fn outcome(self) -> Outcome {
        if self.overlap > 0.0 {
            Outcome::Touching(self)
        } else if self.overlap <= 0.0 {
            // `δ` along any direction bounds the distance from below.
            Outcome::Apart(-self.overlap)
        } else {
            Outcome::Failed(Why::NotFinite)
        }
    }
}

/// Mean distance of the points of a disc from its axis over its radius of gyration: `2√2/3`.
const ON_A_DISC: f64 = 0.942_809_041_582_063_4;
/// Difference of that ratio between a disc and a line, on which it is `√3/2`, as a part of the ratio on a disc.
const LESS_ON_A_LINE: f64 = 0.081_441_346_456_308_4;

/// Additional data of a contact between bodies with faces, see [`overlap`](thickness).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Force over the derivative of the energy with respect to the overlap [-].
    pub gain: f64,
    /// Moment of A on B about the contact point, over the same derivative [m].
    pub lever: Vec3,
    /// Covariance of the shared volume, in world axes: xx, yy, zz, yz, xz, xy [m²].
    pub covariance: [f64; 6],
}

impl Patch {
    /// Patch of a contact in one point.
    pub const POINT: Self =
        Self { gain: 1.0, lever: Vec3::new(0.0, 0.0, 0.0), covariance: [0.0; 6] };

    /// Product of the covariance and a vector.
    pub fn times(&self, v: &Vec3) -> Vec3 {
        let [xx, yy, zz, yz, xz, xy] = self.covariance;
        Vec3::new(
            xx * v.x + xy * v.y + xz * v.z,
            xy * v.x + yy * v.y + yz * v.z,
            xz * v.x + yz * v.y + zz * v.z,
        )
    }

    /// Mean distance of the patch from an axis through its middle [m], from the covariance alone.
    ///
    /// It is `2√2/3` of the radius of gyration on a disc and `√3/2` of it on a line. On rectangles it is within 0.9 % of the exact value.
    pub fn mean_distance(&self, axis: &Vec3) -> f64 {
        let [xx, yy, zz, yz, xz, xy] = self.covariance;
        let trace = xx + yy + zz - axis.dot(&self.times(axis));
        if trace <= 0.0 {
            return 0.0;
        }
        let adjugate = Self {
            covariance: [
                yy * zz - yz * yz,
                xx * zz - xz * xz,
                xx * yy - xy * xy,
                xz * xy - xx * yz,
                xy * yz - yy * xz,
                xz * yz - zz * xy,
            ],
            ..*self
        };
        let determinant = axis.dot(&adjugate.times(axis));
        // Difference of the two principal variances over their sum.
        let long = (1.0 - 4.0 * determinant / (trace * trace)).clamp(0.0, 1.0).sqrt();
        ON_A_DISC * trace.sqrt() * (1.0 - LESS_ON_A_LINE * long * long * long)
    }
}

/// Result of a resolver for one pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The bodies do not touch, and cannot touch before their surfaces have come nearer by this distance [m] (0 if unknown).
    Apart(f64),
    /// The bodies overlap.
    Touching(Touch),
    /// The resolver cannot decide, and the next one of the chain must. This never means "no contact".
    Failed(Why),
}

/// Reason why a resolver failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// The iteration limit was reached.
    NoConvergence,
    /// The centres coincide, or the bodies are so deep in each other that the method has no answer.
    TooDeep,
    /// An input or a result is not finite.
    NotFinite,
    /// A body has edges, and the method needs curvature.
    NotSmooth,
}

/// A body in place: shape, rotation from its own frame to the world, and size.
///
/// Lengths of the body are those of the shape times the scale. A scale of 1 changes no bit.
#[derive(Clone, Copy, Debug)]
pub struct Posed<'a> {
    /// Geometry at a scale of 1.
    pub shape: &'a Shape,
    /// Columns are the body's axes in the world.
    pub frame: &'a Mat3,
    /// Lengths of the body over those of the shape [-].
    pub scale: f64,
    /// Number of the facet of a triangle mesh; 0 for all other shapes.
    pub facet: u32,
}

/// A facet of a wall in place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacetInPlace {
    /// Columns are the axes of the wall in the world.
    pub frame: Mat3,
    /// Number of the facet within the wall.
    pub number: u32,
}

impl<'a> Posed<'a> {
    /// A body at a scale of 1.
    #[inline]
    pub const fn new(shape: &'a Shape, frame: &'a Mat3) -> Self {
        Self { shape, frame, scale: 1.0, facet: 0 }
    }

    /// Support point along `direction`, in world axes, relative to the body's centre [m].
    #[inline]
    pub fn support(&self, direction: &Vec3) -> Vec3 {
        self.frame * (self.shape.support(&self.frame.tr_mul(direction)) * self.scale)
    }

    /// Support point of the core, which is the body without its margin [m].
    #[inline]
    pub fn core_support(&self, direction: &Vec3) -> Vec3 {
        self.frame * (self.shape.core_support(&self.frame.tr_mul(direction)) * self.scale)
    }

    /// Whether a point in world axes, relative to the body's centre [m], is in the body.
    #[inline]
    pub fn contains(&self, point: &Vec3) -> bool {
        self.shape.contains(&(self.frame.tr_mul(point) / self.scale))
    }

    /// [`Convex::bounding_radius`](crate::shape::Convex::bounding_radius) [m].
    #[inline]
    pub fn bounding_radius(&self) -> f64 {
        self.shape.bounding_radius() * self.scale
    }

    /// [`Convex::inscribed_radius`](crate::shape::Convex::inscribed_radius) [m].
    #[inline]
    pub fn inscribed_radius(&self) -> f64 {
        self.shape.inscribed_radius() * self.scale
    }

    /// [`Convex::smallest_curvature_radius`](crate::shape::Convex::smallest_curvature_radius) [m].
    #[inline]
    pub fn smallest_curvature_radius(&self) -> f64 {
        self.shape.smallest_curvature_radius() * self.scale
    }

    /// [`Convex::margin`](crate::shape::Convex::margin) [m].
    #[inline]
    pub fn margin(&self) -> f64 {
        self.shape.margin() * self.scale
    }

    /// Half lengths along the local axes [m], see [`Shape::semi_axes`].
    #[inline]
    pub fn semi_axes(&self) -> Vec3 {
        self.shape.semi_axes() * self.scale
    }

    /// The matrix of an ellipsoid in place [m²], see [`Form`].
    #[inline]
    pub fn form(&self) -> Form {
        let square = self.scale * self.scale;
        self.shape.form(self.frame).map(|entry| entry * square)
    }

    /// Flat part of the body, see [`Core`].
    #[inline]
    pub(crate) fn core(&self) -> PosedCore<'a> {
        match self.shape.core() {
            Core::Curved => PosedCore::Curved,
            Core::Segment(half) => PosedCore::Segment(self.frame.column(0) * (half * self.scale)),
            Core::Hull(hull) => {
                PosedCore::Hull(PosedHull { hull, frame: self.frame, scale: self.scale })
            }
        }
    }

    /// Whether the body has no edges, faces or segments.
    #[inline]
    pub(crate) fn is_curved(&self) -> bool {
        matches!(self.shape.core(), Core::Curved)
    }
}

/// Flat part of a body in place, see [`Core`].
pub(crate) enum PosedCore<'a> {
    /// No flat part.
    Curved,
    /// A segment: from its middle to one of its ends, in world axes [m].
    Segment(Vec3),
    /// The faces and edges of a polyhedron.
    Hull(PosedHull<'a>),
}

/// A polyhedron in place, in world axes about the body's centre.
#[derive(Clone, Copy)]
pub(crate) struct PosedHull<'a> {
    hull: &'a Hull,
    frame: &'a Mat3,
    scale: f64,
}

impl PosedHull<'_> {
    /// A vertex [m].
    #[inline]
    fn vertex(&self, index: usize) -> Vec3 {
        self.frame * (self.hull.vertices()[index] * self.scale)
    }

    /// The vertices at most `depth` [m] below the highest along a unit vector, see [`Hull::top`].
    fn top(&self, direction: &Vec3, depth: f64) -> Vec<usize> {
        self.hull.top(&self.frame.tr_mul(direction), depth / self.scale)
    }

    /// Height of a vertex along a unit vector [m].
    fn height(&self, index: usize, direction: &Vec3) -> f64 {
        self.hull.vertices()[index].dot(&self.frame.tr_mul(direction)) * self.scale
    }

    /// Support point along a direction [m].
    fn support(&self, direction: &Vec3) -> Vec3 {
        self.frame * (self.hull.support(&self.frame.tr_mul(direction)) * self.scale)
    }

    fn bounding_radius(&self) -> f64 {
        self.hull.bounding_radius() * self.scale
    }

    /// The planes of its faces: outward unit normal, and distance from the centre [m].
    fn planes(&self) -> impl Iterator<Item = (Vec3, f64)> {
        let in_place = |plane: &Plane| (self.frame * plane.normal, plane.offset * self.scale);
        self.hull.planes().iter().map(in_place)
    }
}

/// The bound `δ(n)` along a direction, with the contact point that belongs to it (section 1.2 of the paper).
///
/// The contact point is the middle of the support points on the original bodies. Where an edge or a face lies along the contact,
/// it is the centroid of the support points that both bodies share.
#[inline]
pub fn touch_along(a: &Posed, b: &Posed, r: &Vec3, normal: &Vec3) -> Touch {
    let on_a = a.support(normal);
    let on_b = b.support(&-normal) + r;
    let overlap = (on_a - on_b).dot(normal);
    let middle = (on_a + on_b) * 0.5;
    let point = if overlap > 0.0 && !(a.is_curved() && b.is_curved()) {
        patch::centre_between(a, b, r, normal, overlap) + normal * middle.dot(normal)
    } else {
        middle
    };
    Touch { overlap, normal: *normal, point }
}

/// Contact point of a sphere of this radius, relative to its centre [m]: the middle of the overlap.
#[inline]
pub fn touch_of_sphere(radius: f64, normal: &Vec3, overlap: f64) -> Vec3 {
    normal * (radius - 0.5 * overlap)
}

/// Contact geometry of a sphere and another sphere or a plane across a gap between their surfaces [m]; the overlap is negative.
///
/// # Panics
/// If A is not a sphere.
pub fn across_gap(bodies: &Bodies, pair: Pair, gap: f64) -> Touch {
    let Pair { a, b } = pair;
    let Shape::Sphere(sphere) = bodies.shape_of(a) else { panic!("only spheres outlive overlaps") };
    let normal = match bodies.shape_of(b) {
        Shape::HalfSpace(plane) => -(bodies.frame(b) * plane.normal),
        _ => bodies.relative(pair).normalize(),
    };
    let radius = sphere.radius * bodies.scale_of(a);
    Touch { overlap: -gap, normal, point: touch_of_sphere(radius, &normal, -gap) }
}

/// Unit of length of a pair [m]: the power of two at or below the longer of two lengths.
///
/// Iterative methods divide all lengths by it before they compare with a tolerance. A tolerance thus means the same for particles
/// of nanometres and of kilometres. Division by a power of two changes no bit of a significand.
fn unit_of_length(a: f64, b: f64) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    let longer = if a < b { b } else { a };
    f64::from_bits(longer.to_bits() & EXPONENT)
}

/// Two bodies that may touch. A has the lower id.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Pair {
    /// The body with the lower id.
    pub a: Slot,
    /// The other; a wall is always here.
    pub b: Slot,
}

/// A touching pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Index of the pair in the batch.
    pub pair: u32,
    /// Geometry of the contact.
    pub touch: Touch,
}

/// Touching pairs, in columns.
#[derive(Clone, Debug, Default)]
pub struct Touching {
    /// Indices of the pairs in the batch.
    pub pair: Vec<u32>,
    /// Normals and overlaps.
    pub geometry: Vec<Geometry>,
    /// Contact points relative to the centre of A [m]; empty if points are left out.
    pub point: Vec<Vec3>,
    /// Patches of the contacts; empty if patches are left out.
    pub patch: Vec<Patch>,
    /// Whether points are left out. For spheres they follow from normal and overlap.
    pub without_points: bool,
    /// Whether patches are kept. Contacts in one point do not need them.
    pub with_patches: bool,
}

impl Touching {
    /// Number of contacts.
    pub const fn len(&self) -> usize {
        self.pair.len()
    }

    /// Whether there are no contacts.
    pub const fn is_empty(&self) -> bool {
        self.pair.is_empty()
    }

    /// All contacts; points that were left out are zero.
    pub fn iter(&self) -> impl Iterator<Item = Contact> {
        (0..self.len()).map(|row| {
            let Geometry { normal, overlap } = self.geometry[row];
            let point = self.point.get(row).copied().unwrap_or_default();
            Contact { pair: self.pair[row], touch: Touch { overlap, normal, point } }
        })
    }

    /// Adds a contact in one point.
    #[inline]
    pub fn push(&mut self, pair: u32, touch: &Touch) {
        self.push_with(pair, touch, &Patch::POINT);
    }

    #[inline]
    fn push_with(&mut self, pair: u32, touch: &Touch, patch: &Patch) {
        let Touch { overlap, normal, point } = *touch;
        self.pair.push(pair);
        self.geometry.push(Geometry { normal, overlap });
        if !self.without_points {
            self.point.push(point);
        }
        if self.with_patches {
            self.patch.push(*patch);
        }
    }

    /// Adds the contacts of eight pairs.
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    fn push_eight<L: Eight>(
        &mut self,
        pairs: &[u32; WIDTH],
        overlap: L,
        normal: Triple<L>,
        point: Triple<L>,
    ) {
        let start = self.pair.len();
        self.pair.extend_from_slice(pairs);
        self.geometry.resize(start + WIDTH, Geometry::default());
        for (geometry, row) in self.geometry[start..].iter_mut().zip(normal.rows(overlap)) {
            row.write(bytemuck::cast_mut(geometry));
        }
        if !self.without_points {
            self.point.resize(start + WIDTH, Vec3::zeros());
            for (point, row) in self.point[start..].iter_mut().zip(point.rows(overlap)) {
                *point = row.first_three().into();
            }
        }
        if self.with_patches {
            self.patch.resize(start + WIDTH, Patch::POINT);
        }
    }

    /// Keeps the contacts whose entry in `stays` is true.
    pub fn keep(&mut self, stays: &[bool]) {
        fn keep<T>(column: &mut Vec<T>, stays: &[bool]) {
            let mut stays = stays.iter();
            column.retain(|_| stays.next() == Some(&true));
        }
        keep(&mut self.pair, stays);
        keep(&mut self.geometry, stays);
        keep(&mut self.point, stays);
        keep(&mut self.patch, stays);
    }

    fn clear(&mut self) {
        self.pair.clear();
        self.geometry.clear();
        self.point.clear();
        self.patch.clear();
    }

    /// Memory that the columns hold [bytes].
    pub fn bytes(&self) -> usize {
        self.pair.capacity() * size_of::<u32>()
            + self.geometry.capacity() * size_of::<Geometry>()
            + self.point.capacity() * size_of::<Vec3>()
            + self.patch.capacity() * size_of::<Patch>()
    }
}

/// Read-only view of all bodies of a rank, indexed by slot.
#[derive(Clone, Copy, Debug)]
pub struct Bodies<'a> {
    /// Centres [m]; of a facet, the reference point of its wall.
    pub position: &'a [Vec3],
    /// Rotations from body to world of all but facets, which come last; `None` if all are spheres.
    pub quaternion: Option<&'a [Quat]>,
    /// All facets of walls.
    pub facets: &'a [FacetInPlace],
    /// Matrices of ellipsoids and spheres in place, see [`Form`]; `None` if no method needs them.
    pub form: Option<&'a [Form]>,
    /// Shape of each body.
    pub shape: &'a [ShapeId],
    /// Shapes of the scene.
    pub library: &'a [Shape],
    /// Least radii of curvature of the shapes [m].
    pub curvature_radius: &'a [f64],
    /// Lengths of each body over those of its shape [-]; `None` if all scales are 1.
    pub scale: Option<&'a [f64]>,
    /// Domain with its periodic directions.
    pub cell: &'a Cell,
}

impl Bodies<'_> {
    /// Vector from the centre of A to the nearest image of the centre of B [m].
    ///
    /// Walls have no images: a surface that crosses a periodic boundary lists its images itself.
    #[inline]
    pub fn relative(&self, pair: Pair) -> Vec3 {
        let way = self.position[pair.b.index()] - self.position[pair.a.index()];
        let is_wall = pair.b.index() >= self.shape.len() - self.facets.len();
        if is_wall { way } else { self.cell.nearest(way) }
    }

    /// The shape of a body.
    #[inline]
    pub fn shape_of(&self, slot: Slot) -> &Shape {
        &self.library[self.shape[slot.index()].index()]
    }

    /// Lengths of a body over those of its shape [-].
    #[inline]
    pub fn scale_of(&self, slot: Slot) -> f64 {
        self.scale.map_or(1.0, |scale| scale[slot.index()])
    }

    /// Least radius of curvature of a body [m].
    #[inline]
    pub fn curvature_radius_of(&self, slot: Slot) -> f64 {
        self.curvature_radius[self.shape[slot.index()].index()] * self.scale_of(slot)
    }

    /// The rotation of a body from its own frame to the world.
    #[inline]
    pub fn frame(&self, slot: Slot) -> Mat3 {
        let quaternion = self.quaternion.and_then(|all| all.get(slot.index()));
        if let Some(quaternion) = quaternion {
            return quaternion.to_rotation_matrix().into_inner();
        }
        self.facet(slot).map_or_else(Mat3::identity, |facet| facet.frame)
    }

    /// Facet of a wall; `None` for a particle.
    #[inline]
    fn facet(&self, slot: Slot) -> Option<&FacetInPlace> {
        let first = self.shape.len() - self.facets.len();
        slot.index().checked_sub(first).and_then(|facet| self.facets.get(facet))
    }

    /// Frames of both bodies of a pair.
    #[inline]
    pub fn frames(&self, pair: Pair) -> [Mat3; 2] {
        [self.frame(pair.a), self.frame(pair.b)]
    }

    /// Both bodies of a pair in place, with their [`Bodies::frames`].
    #[inline]
    pub fn posed<'b>(&'b self, pair: Pair, frames: &'b [Mat3; 2]) -> (Posed<'b>, Posed<'b>) {
        (self.posed_body(pair.a, &frames[0]), self.posed_body(pair.b, &frames[1]))
    }

    /// A body in place, with its [`Bodies::frame`].
    #[inline]
    pub fn posed_body<'b>(&'b self, slot: Slot, frame: &'b Mat3) -> Posed<'b> {
        let facet = self.facet(slot).map_or(0, |facet| facet.number);
        Posed { shape: self.shape_of(slot), frame, scale: self.scale_of(slot), facet }
    }
}

/// Entries of a column of vectors for eight bodies.
#[expect(clippy::inline_always, reason = "see `lanes`")]
#[inline(always)]
pub fn vectors<L: Eight>(all: &[Vec3], bodies: Gather) -> Triple<L> {
    triple(&bodies.rows(all))
}

/// Eight vectors in lanes.
#[expect(clippy::inline_always, reason = "see `lanes`")]
#[inline(always)]
pub fn triple<L: Eight>([a, b, c, d, e, f, g, h]: &[&Vec3; WIDTH]) -> Triple<L> {
    Triple::of(&[
        a.as_ref(),
        b.as_ref(),
        c.as_ref(),
        d.as_ref(),
        e.as_ref(),
        f.as_ref(),
        g.as_ref(),
        h.as_ref(),
    ])
}

/// Numbers of pairs that each resolver answered or passed on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Pairs listed, summed over the steps.
    pub listed: u64,
    /// Pairs examined.
    pub pairs: u64,
    /// Pairs found touching.
    pub contacts: u64,
    /// Pairs that the first resolver passed on, by the stage of the chain that answered (at most 4).
    pub fallbacks: [u64; 4],
}

/// Index of a pair's contact among those of the last step, if it touched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Previous(u32);

impl Previous {
    /// The pair did not touch at the last step.
    pub const NONE: Self = Self(u32::MAX);

    /// Refers to this contact of the last step.
    pub const fn at(index: usize) -> Self {
        Self(index as u32)
    }

    /// The index; beyond any list if the pair did not touch.
    #[inline]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Pairs of one pair of kinds to be resolved.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// A range of the pair list, or all of it.
    pub pairs: &'a [Pair],
    /// Index in `geometry` of each pair; empty if all bodies are spheres, whose resolvers do not need it.
    pub previous: &'a [Previous],
    /// Geometry of the contacts of the last step.
    pub geometry: &'a [Geometry],
    /// Indices of the pairs to resolve.
    pub active: &'a [u32],
    /// All bodies of the rank.
    pub bodies: Bodies<'a>,
}

impl<'a> Batch<'a> {
    /// Normal of a pair at the last step, if it touched then.
    #[inline]
    pub fn last_normal(&self, index: u32) -> Option<&'a Vec3> {
        let geometry = self.geometry.get(self.previous.get(index as usize)?.index())?;
        geometry.touched().then_some(&geometry.normal)
    }

    /// Slots of the pairs, for columns with this number of bodies.
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    fn slots(&self, bodies: usize) -> RowPairs<'a> {
        RowPairs::new(bytemuck::cast_slice(self.pairs), bodies)
    }

    /// Last normal of a pair that is known to have touched.
    #[inline]
    pub fn normal(&self, index: u32) -> &'a Vec3 {
        &self.geometry[self.previous[index as usize].index()].normal
    }
}

/// Results of the resolvers in a step.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Pairs that touch.
    pub contacts: Touching,
    /// Pairs that do not touch, and the distance by which their surfaces can come nearer before they do [m].
    pub apart: Vec<(u32, f64)>,
    /// Pairs that the resolver could not resolve.
    pub failed: Vec<(u32, Why)>,
    /// Number of pairs that each resolver of a chain resolved.
    pub tally: Tally,
}

impl Found {
    /// Clears the results of the last step, but not the tally.
    pub fn clear(&mut self) {
        self.contacts.clear();
        self.apart.clear();
        self.failed.clear();
    }

    /// Adds the result of one pair.
    #[inline]
    pub fn note(&mut self, pair: u32, outcome: Outcome) {
        match outcome {
            Outcome::Apart(clearance) => self.apart.push((pair, clearance)),
            Outcome::Touching(touch) => self.contacts.push(pair, &touch),
            Outcome::Failed(why) => self.failed.push((pair, why)),
        }
    }

    /// Adds the results of up to eight pairs that touch or have a negative overlap. Returns a bit mask of the remaining lanes.
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    fn note_eight<L: Eight>(&mut self, pairs: &[u32], touches: &in_lanes::Touches<L>) -> u8 {
        let in_lanes::Touches { touching, overlap, normal, point } = *touches;
        let apart = overlap.at_most(L::all(0.0));
        if let Some(eight) = pairs.first_chunk::<WIDTH>()
            && touching == u8::MAX
        {
            // The common case: most active pairs touch.
            self.contacts.push_eight(eight, overlap, normal, point);
            return 0;
        }
        let (geometry, points) = (normal.rows(overlap), point.store());
        let mut others = 0;
        for (lane, &pair) in pairs.iter().enumerate() {
            let [x, y, z, overlap] = geometry[lane].numbers();
            if touching >> lane & 1 == 1 {
                let (normal, point) = (Vec3::new(x, y, z), row(&points, lane).into());
                self.contacts.push(pair, &Touch { overlap, normal, point });
            } else if apart >> lane & 1 == 1 {
                self.apart.push((pair, -overlap));
            } else {
                others |= 1 << lane;
            }
        }
        others
    }
}

thread_local! {
    static DIRECTIONS: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

/// Number of directions tried so far on this thread, where eight lanes count as one.
///
/// Each iteration of GJK, EPA and Newton's method asks both bodies for their support point along one direction.
pub fn directions_tried() -> u64 {
    DIRECTIONS.get()
}

#[inline]
fn count_direction() {
    DIRECTIONS.set(DIRECTIONS.get() + 1);
}

/// A method that resolves pairs of convex bodies.
pub trait ContactResolver: Send + Sync {
    /// Name in the scene file and in reports.
    fn name(&self) -> &'static str;

    /// Names of the stages that may answer, in order; more than one for a chain.
    fn stages(&self) -> Vec<&'static str> {
        vec![self.name()]
    }

    /// Definition of the overlap that the method computes.
    fn definition(&self) -> Definition {
        Definition::LeastOverlap
    }

    /// Resolves one pair. `r` points from the centre of A to the centre of B [m]; `warm` is the normal of the last step.
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome;

    /// Resolves the active pairs of a batch. Each pair goes into one of the lists of `found`, in any order.
    fn resolve(&self, batch: &Batch, found: &mut Found) {
        resolve_each(self, batch, found);
    }
}

/// Resolves the active pairs of a batch one after the other.
fn resolve_each(resolver: &(impl ContactResolver + ?Sized), batch: &Batch, found: &mut Found) {
    for &index in batch.active {
        found.note(index, resolve_one(resolver, batch, index));
    }
}

/// Resolves one pair of a batch.
#[inline]
fn resolve_one(resolver: &(impl ContactResolver + ?Sized), batch: &Batch, index: u32) -> Outcome {
    let pair = batch.pairs[index as usize];
    let r = batch.bodies.relative(pair);
    let frames = batch.bodies.frames(pair);
    let (a, b) = batch.bodies.posed(pair, &frames);
    resolver.touch(&a, &b, &r, batch.last_normal(index))
}

/// Resolvers by pair of kinds.
pub struct Table {
    entries: Vec<((Kind, Kind), Box<dyn ContactResolver>)>,
}

impl Table {
    /// An empty table.
    pub const fn new() -> Self {
        Self { entries: Vec::new() }
    }

    /// Sets the resolver of pairs of these kinds, in either order.
    pub fn insert(&mut self, kinds: (Kind, Kind), resolver: Box<dyn ContactResolver>) {
        self.entries.push((ordered(kinds), resolver));
    }

    /// Returns the resolver of pairs of these kinds, in either order.
    pub fn get(&self, kinds: (Kind, Kind)) -> Option<&dyn ContactResolver> {
        let kinds = ordered(kinds);
        self.entries.iter().find(|(k, _)| *k == kinds).map(|(_, r)| &**r)
    }
}

impl Default for Table {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns the two kinds in the order of batches.
pub fn ordered((a, b): (Kind, Kind)) -> (Kind, Kind) {
    if a <= b { (a, b) } else { (b, a) }
}

/// Frames of two bodies and a direction that differ for each `k`, for tests.
#[cfg(test)]
fn orientations(k: f64) -> ([Mat3; 2], Vec3) {
    let frame = |roll, pitch, yaw| {
        crate::math::Quat::from_euler_angles(roll, pitch, yaw).to_rotation_matrix().into_inner()
    };
    let direction = Vec3::new((1.3 * k).sin(), (2.9 * k).sin(), (0.7 * k).cos()).normalize();
    ([frame(k, 1.7 * k, 0.3 * k), frame(2.1 * k, k, 0.7 * k)], direction)
}
