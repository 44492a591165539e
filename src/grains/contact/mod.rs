//! Contact resolution: from two shapes in place to overlap, normal and contact point.
//!
//! The definition is the common normal. With `h` the support function of a body about its own
//! centre and `r` from the centre of A to the centre of B, for every unit vector `n`
//! `δ(n) = h_A(n) + h_B(-n) - n·r` bounds the overlap from above, and
//! **overlap = min δ(n)** over all `n`; the normal is the minimiser, from A to B; `P_A`, `P_B` are
//! the support points, and the contact point is the middle of the segment between them (of the centroid of
//! all such segments, where edges or faces touch along more than a point).
//! All geometry works on `r`, never on positions: a pair 10⁶ sizes from the origin loses nothing.
//!
//! Two bodies with faces, and one on a plane or on triangles, have another definition unless a method is asked for by name: the thickness of
//! what they share stands for the overlap, its gradient for the normal, and a [`Patch`] goes with each contact
//! ([`thickness`]).
//!
//! A resolver works on a batch of pairs of one pair of kinds: one virtual call per batch. Each
//! pair brings the normal of its last touch, if it touched, as a warm start.

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
    /// Contact point seen from the centre of A [m].
    pub point: Vec3,
}

impl Touch {
    /// A contact if the overlap is positive, and nothing to be trusted if it is not a number.
    fn outcome(self) -> Outcome {
        if self.overlap > 0.0 {
            Outcome::Touching(self)
        } else if self.overlap <= 0.0 {
            // Any direction bounds the distance from below.
            Outcome::Apart(-self.overlap)
        } else {
            Outcome::Failed(Why::NotFinite)
        }
    }
}

/// Mean distance of the points of a disc from its axis over its radius of gyration: `2√2/3`.
const ON_A_DISC: f64 = 0.942_809_041_582_063_4;
/// The part by which that of a line, `√3/2`, is less.
const LESS_ON_A_LINE: f64 = 0.081_441_346_456_308_4;

/// What a contact of faces has beside overlap, normal and point, see [`overlap`](thickness).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Force over the derivative of the energy by the overlap [-].
    pub gain: f64,
    /// Moment of A on B about the point over that derivative [m].
    pub lever: Vec3,
    /// Covariance of what both bodies hold, in world axes: xx, yy, zz, yz, xz, xy [m²].
    pub covariance: [f64; 6],
}

impl Patch {
    /// That of a contact in one point.
    pub const POINT: Self =
        Self { gain: 1.0, lever: Vec3::new(0.0, 0.0, 0.0), covariance: [0.0; 6] };

    /// The covariance times a vector.
    pub fn times(&self, v: &Vec3) -> Vec3 {
        let [xx, yy, zz, yz, xz, xy] = self.covariance;
        Vec3::new(
            xx * v.x + xy * v.y + xz * v.z,
            xy * v.x + yy * v.y + yz * v.z,
            xz * v.x + yz * v.y + zz * v.z,
        )
    }

    /// Mean distance from a unit vector through the middle [m], from the covariance alone: `2√2/3` of the radius of gyration about
    /// it on a disc, `√3/2` on a line, and within 0.9 % of it on rectangles.
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
        // Of the two principal variances, their difference over their sum.
        let long = (1.0 - 4.0 * determinant / (trace * trace)).clamp(0.0, 1.0).sqrt();
        ON_A_DISC * trace.sqrt() * (1.0 - LESS_ON_A_LINE * long * long * long)
    }
}

/// What a resolver says of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// The bodies do not touch, and will not while their surfaces have come nearer by less than this [m]
    /// (0 if nobody knows).
    Apart(f64),
    /// They overlap.
    Touching(Touch),
    /// This resolver cannot tell: the next of the chain must. Never means "no contact".
    Failed(Why),
}

/// Why a resolver gave up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Why {
    /// The iteration limit was reached.
    NoConvergence,
    /// The centres coincide, or the bodies are so deep in each other that the method has no answer.
    TooDeep,
    /// A number that is not finite came in or out.
    NotFinite,
    /// A body has edges, and the method needs curvature.
    NotSmooth,
}

/// A body in place: its shape, the rotation from its own frame to the world, and its size.
///
/// All lengths of the body are those of the shape times the scale. A scale of 1 changes no bit.
#[derive(Clone, Copy, Debug)]
pub struct Posed<'a> {
    /// Its geometry at a scale of 1.
    pub shape: &'a Shape,
    /// Columns are the body's axes in the world.
    pub frame: &'a Mat3,
    /// Lengths of the body over those of the shape [-].
    pub scale: f64,
    /// Which facet of a triangle mesh; 0 of all else.
    pub facet: u32,
}

/// Where a facet of a wall stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacetInPlace {
    /// Columns are the axes of the wall in the world.
    pub frame: Mat3,
    /// Its number within the wall.
    pub number: u32,
}

impl<'a> Posed<'a> {
    /// A body of the size of its shape.
    #[inline]
    pub const fn new(shape: &'a Shape, frame: &'a Mat3) -> Self {
        Self { shape, frame, scale: 1.0, facet: 0 }
    }

    /// Farthest point along `direction`, in world axes, seen from the body's centre [m].
    #[inline]
    pub fn support(&self, direction: &Vec3) -> Vec3 {
        self.frame * (self.shape.support(&self.frame.tr_mul(direction)) * self.scale)
    }

    /// The same of what is left without the margin.
    #[inline]
    pub fn core_support(&self, direction: &Vec3) -> Vec3 {
        self.frame * (self.shape.core_support(&self.frame.tr_mul(direction)) * self.scale)
    }

    /// Is a point, in world axes and seen from the body's centre [m], in the body?
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

    /// What is flat of it.
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

    /// Has it no edges, faces or segments?
    #[inline]
    pub(crate) fn is_curved(&self) -> bool {
        matches!(self.shape.core(), Core::Curved)
    }
}

/// What is flat of a body, see [`Core`].
pub(crate) enum PosedCore<'a> {
    /// Nothing.
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
    /// One of its vertices [m].
    #[inline]
    fn vertex(&self, index: usize) -> Vec3 {
        self.frame * (self.hull.vertices()[index] * self.scale)
    }

    /// The vertices at most `depth` [m] below the highest along a unit vector, see [`Hull::top`].
    fn top(&self, direction: &Vec3, depth: f64) -> Vec<usize> {
        self.hull.top(&self.frame.tr_mul(direction), depth / self.scale)
    }

    /// How high a vertex is along a unit vector [m].
    fn height(&self, index: usize, direction: &Vec3) -> f64 {
        self.hull.vertices()[index].dot(&self.frame.tr_mul(direction)) * self.scale
    }

    /// The highest point along a direction [m].
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

/// `δ(n)`, the bound that any direction gives, and the touch that goes with it (section 1.2 of the paper:
/// support points on the original bodies, contact point in their middle). Where an edge or a face
/// lies along the contact, many points are support points: the contact point is then the centroid of those
/// that both bodies share.
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

/// Where a sphere of this radius touches another body, seen from its centre: in the middle of the overlap [m].
#[inline]
pub fn touch_of_sphere(radius: f64, normal: &Vec3, overlap: f64) -> Vec3 {
    normal * (radius - 0.5 * overlap)
}

/// A sphere and another or a plane across a gap between their surfaces [m]: the overlap is negative.
///
/// # Panics
/// If the bodies are others.
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

/// The unit of length of a pair [m]: the power of two at or below the longer of two lengths.
///
/// Iterative methods divide all lengths by it before they compare anything with a tolerance, so a
/// tolerance means the same for grains of nanometres and of kilometres. A power of two changes no
/// bit of a significand.
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

/// A pair that touches now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Its index in the batch's pairs.
    pub pair: u32,
    /// Its geometry.
    pub touch: Touch,
}

/// Pairs that touch now, in columns.
#[derive(Clone, Debug, Default)]
pub struct Touching {
    /// Their indices in the batch's pairs.
    pub pair: Vec<u32>,
    /// Their normals and overlaps.
    pub geometry: Vec<Geometry>,
    /// Where each touches, seen from the centre of A [m]; none if they are left out.
    pub point: Vec<Vec3>,
    /// What else there is of contacts of faces; none if they are left out.
    pub patch: Vec<Patch>,
    /// Are points left out? Of spheres they follow from normal and overlap.
    pub without_points: bool,
    /// Are patches there? Only bodies with faces have any.
    pub with_patches: bool,
}

impl Touching {
    /// How many.
    pub const fn len(&self) -> usize {
        self.pair.len()
    }

    /// Are there none?
    pub const fn is_empty(&self) -> bool {
        self.pair.is_empty()
    }

    /// All of them; points that are left out are zero.
    pub fn iter(&self) -> impl Iterator<Item = Contact> {
        (0..self.len()).map(|row| {
            let Geometry { normal, overlap } = self.geometry[row];
            let point = self.point.get(row).copied().unwrap_or_default();
            Contact { pair: self.pair[row], touch: Touch { overlap, normal, point } }
        })
    }

    /// Adds a contact that is none of faces.
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

    /// The same of eight pairs.
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

    /// Keeps some of them.
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

    /// Bytes that it holds.
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
    /// Matrices of ellipsoids and spheres in place, see [`Form`]; `None` if no method asked for them.
    pub form: Option<&'a [Form]>,
    /// Shape of each body.
    pub shape: &'a [ShapeId],
    /// The scene's shapes.
    pub library: &'a [Shape],
    /// Their least radii of curvature [m].
    pub curvature_radius: &'a [f64],
    /// Lengths of each body over those of its shape [-]; `None` if all are as large as their shapes.
    pub scale: Option<&'a [f64]>,
    /// How the domain repeats.
    pub cell: &'a Cell,
}

impl Bodies<'_> {
    /// From the centre of A to the nearest image of the centre of B [m]. Walls have no images: a surface that goes through a period
    /// brings them along.
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

    /// A facet of a wall; `None` of a particle.
    #[inline]
    fn facet(&self, slot: Slot) -> Option<&FacetInPlace> {
        let first = self.shape.len() - self.facets.len();
        slot.index().checked_sub(first).and_then(|facet| self.facets.get(facet))
    }

    /// Both of a pair.
    #[inline]
    pub fn frames(&self, pair: Pair) -> [Mat3; 2] {
        [self.frame(pair.a), self.frame(pair.b)]
    }

    /// A pair in place, with its [`Bodies::frames`].
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

/// The vectors of eight bodies.
#[expect(clippy::inline_always, reason = "see `lanes`")]
#[inline(always)]
pub fn vectors<L: Eight>(all: &[Vec3], bodies: Gather) -> Triple<L> {
    triple(&bodies.rows(all))
}

/// Eight vectors.
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

/// How often each resolver answered, and how often it passed a pair on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Pairs listed, summed over the steps.
    pub listed: u64,
    /// Pairs looked at.
    pub pairs: u64,
    /// Pairs found touching.
    pub contacts: u64,
    /// Pairs which the first resolver passed on, by the stage of the chain that answered (at most 4).
    pub fallbacks: [u64; 4],
}

/// Index of the contact of a pair among those of the last step, if it touched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Previous(u32);

impl Previous {
    /// It did not touch.
    pub const NONE: Self = Self(u32::MAX);

    /// This contact of the last step.
    pub const fn at(index: usize) -> Self {
        Self(index as u32)
    }

    /// As an index; beyond any list if it did not touch.
    #[inline]
    pub const fn index(self) -> usize {
        self.0 as usize
    }
}

/// Pairs of one pair of kinds that are to be looked at.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// A stretch of the list of pairs, or all of it.
    pub pairs: &'a [Pair],
    /// Index in `geometry` of each; empty if all are spheres, of which no resolver asks.
    pub previous: &'a [Previous],
    /// Geometry of the contacts of the last step.
    pub geometry: &'a [Geometry],
    /// Which of them to look at.
    pub active: &'a [u32],
    /// Every body.
    pub bodies: Bodies<'a>,
}

impl<'a> Batch<'a> {
    /// The normal of a pair's last touch, if it touched at the last step.
    #[inline]
    pub fn last_normal(&self, index: u32) -> Option<&'a Vec3> {
        let geometry = self.geometry.get(self.previous.get(index as usize)?.index())?;
        geometry.touched().then_some(&geometry.normal)
    }

    /// The slots of the pairs, in columns of so many bodies.
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    fn slots(&self, bodies: usize) -> RowPairs<'a> {
        RowPairs::new(bytemuck::cast_slice(self.pairs), bodies)
    }

    /// The same of a pair that is known to have touched.
    #[inline]
    pub fn normal(&self, index: u32) -> &'a Vec3 {
        &self.geometry[self.previous[index as usize].index()].normal
    }
}

/// What resolvers found in a step.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Pairs that touch.
    pub contacts: Touching,
    /// Pairs that do not, and how much nearer their surfaces may come before they could [m].
    pub apart: Vec<(u32, f64)>,
    /// Pairs of which the resolver could not tell.
    pub failed: Vec<(u32, Why)>,
    /// How many pairs each resolver of a chain resolved.
    pub tally: Tally,
}

impl Found {
    /// Forgets the last step, but not the tally.
    pub fn clear(&mut self) {
        self.contacts.clear();
        self.apart.clear();
        self.failed.clear();
    }

    /// Takes note of one pair.
    #[inline]
    pub fn note(&mut self, pair: u32, outcome: Outcome) {
        match outcome {
            Outcome::Apart(clearance) => self.apart.push((pair, clearance)),
            Outcome::Touching(touch) => self.contacts.push(pair, &touch),
            Outcome::Failed(why) => self.failed.push((pair, why)),
        }
    }

    /// Takes note of up to eight pairs: those that touch, and those that are as far apart as their overlap is negative. Returns in
    /// which lanes there are others.
    #[expect(clippy::inline_always, reason = "see `lanes`")]
    #[inline(always)]
    fn note_eight<L: Eight>(&mut self, pairs: &[u32], touches: &in_lanes::Touches<L>) -> u8 {
        let in_lanes::Touches { touching, overlap, normal, point } = *touches;
        let apart = overlap.at_most(L::all(0.0));
        if let Some(eight) = pairs.first_chunk::<WIDTH>()
            && touching == u8::MAX
        {
            // As most are that are looked at.
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

/// How many directions were tried so far on this thread: what GJK, EPA and Newton's method have in common is that
/// each iteration asks both bodies for their support point along one direction. Lanes count as one.
pub fn directions_tried() -> u64 {
    DIRECTIONS.get()
}

#[inline]
fn count_direction() {
    DIRECTIONS.set(DIRECTIONS.get() + 1);
}

/// A method that resolves pairs of convex bodies.
pub trait ContactResolver: Send + Sync {
    /// As the scene file and reports name it.
    fn name(&self) -> &'static str;

    /// The names of the stages that may answer, in their order: of a chain, more than one.
    fn stages(&self) -> Vec<&'static str> {
        vec![self.name()]
    }

    /// What it looks for.
    fn definition(&self) -> Definition {
        Definition::LeastOverlap
    }

    /// Resolves one pair. `r` is from the centre of A to the centre of B [m]; `warm` the normal of the
    /// last touch.
    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, warm: Option<&Vec3>) -> Outcome;

    /// Resolves the active pairs of a batch. Each goes into one of the lists of `found`; their order
    /// means nothing.
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

/// Which resolver serves which pair of kinds.
pub struct Table {
    entries: Vec<((Kind, Kind), Box<dyn ContactResolver>)>,
}

impl Table {
    /// An empty table.
    pub const fn new() -> Self {
        Self { entries: Vec::new() }
    }

    /// Lets `resolver` serve pairs of these kinds, in either order.
    pub fn insert(&mut self, kinds: (Kind, Kind), resolver: Box<dyn ContactResolver>) {
        self.entries.push((ordered(kinds), resolver));
    }

    /// The resolver for pairs of these kinds, in either order.
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

/// The two kinds in the order of batches.
pub fn ordered((a, b): (Kind, Kind)) -> (Kind, Kind) {
    if a <= b { (a, b) } else { (b, a) }
}

/// The frames of two bodies and a direction, others for each `k`: for tests.
#[cfg(test)]
fn orientations(k: f64) -> ([Mat3; 2], Vec3) {
    let frame = |roll, pitch, yaw| {
        crate::math::Quat::from_euler_angles(roll, pitch, yaw).to_rotation_matrix().into_inner()
    };
    let direction = Vec3::new((1.3 * k).sin(), (2.9 * k).sin(), (0.7 * k).cos()).normalize();
    ([frame(k, 1.7 * k, 0.3 * k), frame(2.1 * k, k, 0.7 * k)], direction)
}
