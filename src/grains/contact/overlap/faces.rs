//! Thickness of the volume that two bodies share, and its gradient: force, moment and point of action.
//!
//! # Definition
//!
//! Let `P` be the set of points that belong to both bodies, a convex polyhedron with volume `V`, centroid `c` and covariance
//! `C = 1/V ∫_P (x - c)(x - c)ᵀ dV`. Its thickness is
//!
//! `D = √(12 s)`, `s = 1 / tr(C⁻¹) = det C / tr(cof C)`.
//!
//! A plate of any outline much wider than its thickness `t` has one small eigenvalue `t²/12`, so that `D = t`. For flush faces, `D` is the
//! overlap, whatever their area. The elastic energy of a contact of stiffness `k` is `U = k D² / 2`; force and moment are its gradient.
//!
//! # Gradient
//!
//! `D` depends on the relative pose alone. Let A move as a rigid body with the velocity field `v(x)`. Only the facets of
//! `P` that belong to A's surface move with it, with their outward normal `n`. By Reynolds' transport theorem
//!
//! `dV = ∫ v·n dA`, `d(V c) = ∫ x v·n dA`, hence `dC = 1/V ∫ (v·n) [(x - c)(x - c)ᵀ - C] dA`,
//!
//! over these facets: terms with `dc` vanish, as the mean of `x - c` does. From `s = 1 / tr(C⁻¹)` follows
//! `ds = s² tr(C⁻² dC)`. With `K = s C⁻¹ = cof C / tr(cof C)` and `w = K (x - c)`, and because `tr(s² C⁻² C) = s`,
//!
//! `dU = 6 k ds = ∫ q v·n dA`, `q(x) = 6 k / V (|w|² - s)`,
//!
//! a virtual pressure on the surface of `P`. So the force on A and the moment on A about the origin are
//!
//! `F = -Σ n ∫ q dA`, `T = -Σ ∫ q x × n dA` over the facets from A.
//!
//! If all of `P` moves, `D` does not change: both integrals over its whole surface are zero. The facets of B therefore give the opposite
//! force and moment, and momentum and angular momentum are conserved. `U` is continuous and goes to 0 with the overlap, so no closed path
//! gains energy.
//!
//! `q` is a quadratic function. Each facet is cut into triangles, on which `w` is linear, so the integrals of `q` and `x q` are exact.
//!
//! # Properties
//!
//! - A strip of width `L`, tilted by `θ` with the depth `d` in its middle, has `D² = d² + θ² L² / 4` for `θ <= 2 d / L`. The force is `k d`
//!   and the moment `k θ L² / 4`. The centre of force moves steadily from the middle to the deep edge, and reaches it when the other edge
//!   lifts off.
//! - An edge on a face has the stiffness `k / 2`, a corner of a box `0.30 k`, the tip of a regular tetrahedron `0.15 k`, a thin cap of a
//!   sphere `2/3 k`: `D` is not the depth of a single point. The area has no influence: two particles that share a quarter of a face press
//!   like two that share all of it.
//! - Once the thinner body is inside the other, `D` stays at its thickness and there is no force.
//! - Sliding along faces changes `D` by the order of `(D/L)² D`.
//!
//! # Related work
//!
//! No publication of this energy was found. Every energy that depends on the pose alone conserves energy (Feng 2021,
//! DOI 10.1016/j.cma.2020.113454; with the volume: DOI 10.1016/j.cma.2020.113493). Gonthier (2007, *Contact dynamics modelling for robotic
//! task simulation*, thesis, University of Waterloo) uses volume and inertia of the overlap, with forces that derive from no such energy.
//! Bouchard et al. (2015, *6D frictional contact for rigid bodies*, Graphics Interface) add the extent of the contact patch from its second
//! moments.

use super::thickness::{THIN, Thickness, size_of_both};
use crate::contact::Posed;
use crate::math::{Mat3, Vec3};
use crate::shape::Shape;
use crate::shape::clip::Clipped;
use crate::shape::facets::{Facets, Plane};
use std::cell::RefCell;

/// Largest distance of a force's axis from the centroid, over the radius of the shared volume.
///
/// Beyond it the bodies are so deep in each other that hardly anything but a moment is left, and there is no contact.
pub(super) const FAR: f64 = 2.0;

/// Working memory for clipping, kept from one pair to the next.
#[derive(Default)]
struct Scratch {
    shared: Clipped,
    /// Vertices that are left, relative to one of them, in axes of which the third is across the shared volume.
    local: Vec<Vec3>,
    /// `K (x - c)` of the vertices.
    turned: Vec<Vec3>,
    /// Planes of B about the centre of A.
    planes: Vec<Plane>,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

/// Thickness for two bodies of which the first has faces and the second has faces or is a half-space, see [`super::thickness()`].
///
/// Everything is computed in the axes and with the unit of length of A. The two orders of a pair agree only within rounding, and differ more
/// where faces coincide. Callers pass the body with the lower id first.
pub(super) fn of_faces(a: &Posed, b: &Posed, r: &Vec3) -> Option<Thickness> {
    SCRATCH.with_borrow_mut(|scratch| {
        let size = scratch.share(a, b, r)?;
        let found = scratch.measure(size)?;
        Some(found.placed(a.scale, a.frame))
    })
}

/// The polyhedron that two such bodies share, in the axes and with the unit of length of A.
pub(super) fn shared(a: &Posed, b: &Posed, r: &Vec3) -> Option<Clipped> {
    SCRATCH.with_borrow_mut(|scratch| {
        scratch.share(a, b, r)?;
        scratch.shared.end();
        Some(scratch.shared.clone())
    })
}

impl Scratch {
    /// Finds the shared volume; returns the size of both bodies in the unit of length of A.
    fn share(&mut self, a: &Posed, b: &Posed, r: &Vec3) -> Option<f64> {
        let body = a.shape.facets()?;
        let per_metre = 1.0 / a.scale;
        let r = a.frame.tr_mul(r) * per_metre;
        let turn = a.frame.tr_mul(b.frame);
        let size = body.bounding_radius();
        if let Shape::HalfSpace(plane) = b.shape {
            let offset = plane.offset * (b.scale * per_metre);
            self.against_plane(body, plane.normal, offset, &r, &turn)?;
            return Some(size);
        }
        let (other, scale) = (b.shape.facets()?, b.scale * per_metre);
        self.against_body(body, other, scale, &r, &turn)?;
        Some(size_of_both(size, other.bounding_radius() * scale))
    }

    /// Cuts a body by a half-space that contains the points below its plane.
    fn against_plane(
        &mut self,
        body: &Facets,
        normal: Vec3,
        offset: f64,
        r: &Vec3,
        turn: &Mat3,
    ) -> Option<()> {
        let normal = turn * normal;
        self.shared.begin(body);
        self.shared.cut(&Plane { normal, offset: offset + normal.dot(r) }).then_some(())
    }

    /// Cuts a body by the planes of another, first by the one for which the body's centre is farthest outside, which leaves a slab.
    fn against_body(
        &mut self,
        body: &Facets,
        other: &Facets,
        scale: f64,
        r: &Vec3,
        turn: &Mat3,
    ) -> Option<()> {
        self.planes.clear();
        self.planes.extend(other.planes().iter().map(|plane| {
            let normal = turn * plane.normal;
            Plane { normal, offset: plane.offset * scale + normal.dot(r) }
        }));
        let first = lowest(&self.planes)?;
        if self.planes[first].offset < -body.bounding_radius() {
            return None;
        }
        self.shared.begin(body);
        if !self.shared.cut(&self.planes[first]) {
            return None;
        }
        let (centre, radius) = self.ball();
        for (k, plane) in self.planes.iter().enumerate() {
            let cannot_cut = centre.dot(&plane.normal) + radius <= plane.offset;
            if k != first && !cannot_cut && !self.shared.cut(plane) {
                return None;
            }
        }
        Some(())
    }

    /// A ball that contains what is left.
    fn ball(&self) -> (Vec3, f64) {
        let left = || self.shared.left().iter().map(|&k| &self.shared.vertices()[k as usize]);
        let centre = left().sum::<Vec3>() / self.shared.left().len() as f64;
        let squared = |point: &Vec3| (point - centre).norm_squared();
        (centre, left().map(squared).fold(0.0, f64::max).sqrt())
    }

    /// Thickness of the shared volume, and its gradient, in the axes of A.
    fn measure(&mut self, size: f64) -> Option<Thickness> {
        self.shared.end();
        let by_cuts = self.has_fewer_cuts()?;
        let axes = self.axes(by_cuts)?;
        let vertices = self.shared.vertices();
        let &first = self.shared.left().first()?;
        let origin = vertices[first as usize];
        self.local.resize(vertices.len(), Vec3::zeros());
        for &vertex in self.shared.left() {
            self.local[vertex as usize] = axes.tr_mul(&(vertices[vertex as usize] - origin));
        }
        let Moments { volume, centroid, covariance } = self.moments(first)?;

        let (s, k) = thinness(&covariance)?;
        let thickness = (12.0 * s).sqrt();
        // False for NaN as well.
        let is_thick = thickness > THIN * size;
        if !is_thick {
            return None;
        }
        let (force, moment) = self.gradient(&k, &centroid, s, by_cuts);
        let (force, moment) = (force * (6.0 / volume), moment * (6.0 / volume));
        let squared = force.norm_squared();
        let lever = force.cross(&moment);
        let far = |vertex: &u32| self.local[*vertex as usize].norm_squared();
        let reach = self.shared.left().iter().map(far).fold(0.0, f64::max);
        let has_axis = lever.norm_squared() < FAR * FAR * reach * squared * squared;
        if !has_axis {
            return None;
        }
        let length = squared.sqrt();
        let normal = force / length;
        let found = Thickness {
            thickness,
            normal,
            gain: length / thickness,
            point: centroid + lever / squared,
            couple: normal * moment.dot(&normal),
            centroid,
            covariance,
        };
        Some(found.placed(1.0, &axes).with_origin(&origin))
    }

    /// Whether no more than half of the faces are cuts. `None` if one of the bodies has no facet here.
    fn has_fewer_cuts(&self) -> Option<bool> {
        let all = self.shared.faces().count();
        let cut = self.shared.faces().filter(|face| face.is_cut).count();
        (cut > 0 && cut < all).then_some(2 * cut <= all)
    }

    /// Axes, as columns, of which the third is along the vector area of the facets of A; `None` if that area is zero.
    ///
    /// In these axes the small second moment of a thin plate is not lost in the large ones.
    fn axes(&self, by_cuts: bool) -> Option<Mat3> {
        let vertices = self.shared.vertices();
        // The area of the whole surface is zero: that of the cuts is opposite to that of the other faces.
        let mut area = Vec3::zeros();
        for face in self.shared.faces().filter(|face| face.is_cut == by_cuts) {
            for [a, b, c] in fan(face.corners) {
                area += (vertices[b] - vertices[a]).cross(&(vertices[c] - vertices[a]));
            }
        }
        let length = if by_cuts { -area.norm() } else { area.norm() };
        if length == 0.0 {
            return None;
        }
        let up = area / length;
        Some(axes_along(&up))
    }

    /// Volume, centroid and covariance in local axes with this vertex as origin; `None` if there is no volume.
    fn moments(&self, origin: u32) -> Option<Moments> {
        let (mut volume, mut first) = (0.0, Vec3::zeros());
        let (mut squares, mut products) = (Vec3::zeros(), Vec3::zeros());
        // The tetrahedron between the origin and a face that contains it has no volume.
        for face in self.shared.faces().filter(|face| !face.corners.contains(&origin)) {
            for [a, b, c] in fan(face.corners) {
                let [a, b, c] = [&self.local[a], &self.local[b], &self.local[c]];
                // Six times the volume of the tetrahedron from the origin to the triangle.
                let sixfold = a.dot(&b.cross(c));
                let sum = a + b + c;
                volume += sixfold;
                first += sum * sixfold;
                let square = |i: usize| sum[i] * sum[i] + a[i] * a[i] + b[i] * b[i] + c[i] * c[i];
                let product =
                    |i: usize, j: usize| sum[i] * sum[j] + a[i] * a[j] + b[i] * b[j] + c[i] * c[j];
                squares += Vec3::new(square(0), square(1), square(2)) * sixfold;
                products += Vec3::new(product(1, 2), product(0, 2), product(0, 1)) * sixfold;
            }
        }
        if volume <= 0.0 {
            return None;
        }
        let centroid = first / (4.0 * volume);
        let (squares, products) = (squares / (20.0 * volume), products / (20.0 * volume));
        let [xx, yy, zz] = (squares - centroid.component_mul(&centroid)).into();
        let [yz, xz, xy] = (products
            - Vec3::new(centroid.y * centroid.z, centroid.x * centroid.z, centroid.x * centroid.y))
        .into();
        let covariance = Mat3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        Some(Moments { volume: volume / 6.0, centroid, covariance })
    }

    /// `Σ n ∫ (|w|² - s) dA` over the facets of A, and its moment about the centroid, in local axes: force and moment of A on B.
    ///
    /// With `by_cuts`, computed from the facets of B with the opposite sign.
    fn gradient(&mut self, k: &Mat3, centroid: &Vec3, s: f64, by_cuts: bool) -> (Vec3, Vec3) {
        self.turned.resize(self.local.len(), Vec3::zeros());
        for &vertex in self.shared.left() {
            let vertex = vertex as usize;
            self.local[vertex] -= centroid;
            self.turned[vertex] = k * self.local[vertex];
        }
        let (mut force, mut moment) = (Vec3::zeros(), Vec3::zeros());
        for face in self.shared.faces().filter(|face| face.is_cut == by_cuts) {
            for [a, b, c] in fan(face.corners) {
                let [p, q, r] = [&self.local[a], &self.local[b], &self.local[c]];
                let turned = [&self.turned[a], &self.turned[b], &self.turned[c]];
                let area = (q - p).cross(&(r - p)) * 0.5;
                let sum = turned[0] + turned[1] + turned[2];
                let squares = turned.map(Vec3::norm_squared);
                let both = sum.norm_squared() + (squares[0] + squares[1] + squares[2]);
                force += area * (both / 12.0 - s);
                // Integral of x |w|² over a triangle, where x and w are linear.
                let weight =
                    |i: usize| (both + 2.0 * (turned[i].dot(&sum) + squares[i])) / 60.0 - s / 3.0;
                moment += (p * weight(0) + q * weight(1) + r * weight(2)).cross(&area);
            }
        }
        if by_cuts { (-force, -moment) } else { (force, moment) }
    }
}

/// Moments of the shared volume, in local axes.
struct Moments {
    volume: f64,
    centroid: Vec3,
    covariance: Mat3,
}

/// Triangles of a polygon.
pub(super) fn fan(corners: &[u32]) -> impl Iterator<Item = [usize; 3]> {
    let first = corners[0] as usize;
    corners[1..].windows(2).map(move |two| [first, two[0] as usize, two[1] as usize])
}

/// Axes, as columns, of which the third is this unit vector.
pub(super) fn axes_along(up: &Vec3) -> Mat3 {
    let across = up.cross(&Vec3::ith(up.iamin(), 1.0)).normalize();
    Mat3::from_columns(&[across, up.cross(&across), *up])
}

/// `s = 1 / tr(C⁻¹)` and `K = s C⁻¹` of a covariance; `None` if the volume is thinner than rounding.
pub(super) fn thinness(covariance: &Mat3) -> Option<(f64, Mat3)> {
    let cofactors = cofactors(covariance);
    let sum = cofactors.trace();
    let determinant = covariance.row(0).transpose().dot(&cofactors.column(0));
    (determinant > 0.0 && sum > 0.0).then(|| (determinant / sum, cofactors / sum))
}

fn cofactors(m: &Mat3) -> Mat3 {
    let [x, y, z] = [m.column(0), m.column(1), m.column(2)];
    Mat3::from_columns(&[y.cross(&z), z.cross(&x), x.cross(&y)])
}

/// Index of the plane with the least offset, the first of several.
fn lowest(planes: &[Plane]) -> Option<usize> {
    let mut best: Option<usize> = None;
    for (k, plane) in planes.iter().enumerate() {
        if best.is_none_or(|best| plane.offset < planes[best].offset) {
            best = Some(k);
        }
    }
    best
}
