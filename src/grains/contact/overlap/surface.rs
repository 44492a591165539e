//! A body with faces and a surface of triangles: the thickness of what it shares with the cells behind them
//! ([`crate::shape::triangle_mesh`]).
//!
//! # Definition
//!
//! Let `V_j` be the volume that the body shares with cell `j`, and `ω_ij` how far the cells `i` and `j` are one surface. With the moments of
//! all that is one with cell `i`,
//!
//! `W_i = Σ_j ω_ij V_j`, and centroid `c_i` and covariance `C_i` under the weights `ω_ij`, `s_i = 1 / tr(C_i⁻¹)`,
//!
//! the elastic energy of a contact of stiffness `k` is `U = 6 k Σ_i (V_i / W_i) s_i = k D² / 2`.
//!
//! - Where all is one (`ω = 1`), as in a plane however it is cut into triangles, `U = 6 k s`: the energy of two bodies ([`super::faces`]).
//! - Where cells are apart (`ω = 0`), as in a concave corner, each has its own energy.
//!
//! # Gradient
//!
//! Cells do not move, so that only the facets of the body do. As of two bodies, `dU = Σ_j ∫ q_j v·n dA` over the facets within cell
//! `j`, with `K_i = s_i C_i⁻¹` and
//!
//! `q_j(x) = 6 k [ s_j / W_j + Σ_i ω_ij (V_i / W_i²) (|K_i (x - c_i)|² - 2 s_i) ]`.
//!
//! # Contacts
//!
//! Faces that are one to any part, directly or by way of others, make one contact, which belongs to the pair of the lowest of them. Edges and corners have none.

use super::faces::{FAR, axes_along, fan, thinness};
use super::seen::{Seen, Shared};
use super::sides::Side;
use super::sides_on_surface::{Room, clear_of};
use super::thickness::{THIN, Thickness};
use super::{Batch, ContactResolver, Definition, Found, Outcome, Posed, Why, patch, touch};
use crate::math::{Mat3, Vec3};
use crate::shape::Shape;
use crate::shape::clip::Clipped;
use crate::shape::facets::Plane;
use crate::shape::triangle_mesh::{Front, MeshFacet, Near, TriangleMesh};
use std::cell::RefCell;
use std::ops::Range;

/// Resolves a body with faces or a straight side (A) against a facet of a surface of triangles (B). For faces it must have cells
/// ([`TriangleMesh::with_cells`]). The relative position runs from the centre of A to the reference point of the wall.
#[derive(Clone, Copy, Debug, Default)]
pub struct OverlapWithSurface;

/// All contacts of one body with one surface.
#[derive(Default)]
struct Scratch {
    near: Vec<Near>,
    sides: Vec<(u32, Front)>,
    cells: Vec<Cell>,
    /// Room for cells, kept from one body to the next.
    spare: Vec<Clipped>,
    members: Vec<Member>,
    weights: Vec<f64>,
    of_sides: Room,
    found: Vec<Shared>,
}

/// What a body shares with one cell.
struct Cell {
    triangle: u32,
    flat: u32,
    front: Front,
    shared: Clipped,
    /// The area that lies in the plane of the triangle, along its normal [m²].
    area: Vec3,
}

/// Cells of a flat that are one.
struct Member {
    cells: Range<usize>,
    /// The lowest with which it is one to any part.
    group: usize,
    moments: Moments,
}

/// Of one cell or of several, about the origin of their contact.
#[derive(Clone, Copy)]
struct Moments {
    volume: f64,
    first: Vec3,
    second: Mat3,
}

/// `s`, `K` and `c` of what is one with a cell.
struct OfOne {
    weight: f64,
    s: f64,
    k: Mat3,
    centroid: Vec3,
}

/// A quadratic function of a point: `xᵀ A x - 2 b·x + e`.
struct Pressure {
    a: Mat3,
    b: Vec3,
    e: f64,
}

thread_local! {
    static SCRATCH: RefCell<Scratch> = RefCell::default();
}

impl ContactResolver for OverlapWithSurface {
    fn name(&self) -> &'static str {
        "thickness"
    }

    fn definition(&self) -> Definition {
        Definition::Thickness
    }

    fn touch(&self, a: &Posed, b: &Posed, r: &Vec3, _: Option<&Vec3>) -> Outcome {
        SCRATCH.with_borrow_mut(|scratch| {
            let seen = Seen::of(a, b, r);
            scratch.find(&seen);
            match scratch.contact(&seen, b.facet) {
                Ok(found) => Outcome::Touching(touch(&found)),
                Err(outcome) => outcome,
            }
        })
    }

    fn resolve(&self, batch: &Batch, found: &mut Found) {
        SCRATCH.with_borrow_mut(|scratch| {
            // Pairs of one body with facets of one wall follow each other.
            let mut last = None;
            for &index in batch.active {
                let pair = batch.pairs[index as usize];
                let r = batch.bodies.relative(pair);
                let frames = batch.bodies.frames(pair);
                let (a, b) = batch.bodies.posed(pair, &frames);
                let seen = Seen::of(&a, &b, &r);
                let this = Some((pair.a, batch.bodies.shape[pair.b.index()]));
                if this != last {
                    scratch.find(&seen);
                    last = this;
                }
                match scratch.contact(&seen, b.facet) {
                    Ok(shared) => found.contacts.push_with(index, &touch(&shared), &patch(&shared)),
                    Err(outcome) => found.note(index, outcome),
                }
            }
        });
    }
}

/// The contacts of a body with faces and a surface of triangles that has cells, or of one with a straight side and any, each with the lowest of its facets; `r` is from the
/// centre of A to the reference point of its wall [m]. None of others.
pub fn thickness_on_surface(a: &Posed, b: &Posed, r: &Vec3) -> Vec<(u32, Thickness)> {
    let has_side = a.shape.kind().has_side();
    if !matches!(b.shape, Shape::TriangleMesh(mesh) if has_side || mesh.has_cells()) {
        return Vec::new();
    }
    SCRATCH.with_borrow_mut(|scratch| {
        scratch.find(&Seen::of(a, b, r));
        scratch.found.iter().map(|found| (found.facet, found.thickness)).collect()
    })
}

impl Scratch {
    /// Finds all contacts of a body with a surface.
    fn find(&mut self, seen: &Seen) {
        self.found.clear();
        if let Some(side) = Side::of(seen.a) {
            self.of_sides.find(&side, seen, &mut self.found);
            return;
        }
        self.spare.extend(self.cells.drain(..).map(|cell| cell.shared));
        self.find_cells(seen);
        self.group(seen.mesh);
        for first in 0..self.members.len() {
            if self.members[first].group == first {
                let found = self.measure(first, seen);
                self.found.extend(found);
            }
        }
    }

    /// The contact that belongs to a facet, in world axes.
    fn contact(&self, seen: &Seen, facet: u32) -> Result<Thickness, Outcome> {
        if let Some(Shared { thickness, .. }) = self.found.iter().find(|found| found.facet == facet)
        {
            // A number that is none ends here.
            return if thickness.thickness.is_finite() && thickness.gain.is_finite() {
                Ok(*thickness)
            } else {
                Err(Outcome::Failed(Why::NotFinite))
            };
        }
        // Until it comes to the facet it does not touch.
        let clear = match (seen.mesh.facet(facet), Side::of(seen.a)) {
            (of, Some(side)) => clear_of(&side, seen, &of),
            // What touches another face may come to have its contact with this one at once.
            (MeshFacet::Face { .. }, None) if !self.found.is_empty() => 0.0,
            (MeshFacet::Face { normal, offset }, None) => {
                let height = seen.centre.dot(&normal) - offset;
                let sign = if height < 0.0 { -1.0 } else { 1.0 };
                // Behind its plane, over a face beside it, a body is half as far from the space behind this face, or farther.
                0.5 * seen.height_over(&Plane { normal: normal * sign, offset: offset * sign })
            }
            // Edges and corners have no contacts of their own with faces.
            _ => return Err(Outcome::Apart(f64::INFINITY)),
        };
        Err(if !clear.is_finite() {
            Outcome::Failed(Why::NotFinite)
        } else if seen.mesh.has_images() {
            Outcome::Apart(0.0)
        } else {
            Outcome::Apart(clear.max(0.0))
        })
    }

    /// Cuts the body by the cells near it.
    fn find_cells(&mut self, seen: &Seen) {
        let Self { near, sides, cells, spare, .. } = self;
        let Seen { a, mesh, .. } = seen;
        let Some(body) = a.shape.facets() else { return };
        mesh.triangles_near(&seen.centre, a.bounding_radius(), near);
        sides.clear();
        for k in 0..near.len() {
            let triangle = near[k].triangle;
            let part = mesh.part_of(triangle);
            let known = sides.iter().find(|(of, _)| *of == part).map(|(_, front)| *front);
            let front = known.unwrap_or_else(|| {
                let front = mesh.side_of(part, &seen.centre, near);
                sides.push((part, front));
                front
            });
            let own = Some(mesh.plane_from(triangle, front));
            let Some(own) = own.filter(|own| seen.height_over(own) < 0.0) else { continue };
            let own = seen.place(&own);
            for mut planes in mesh.cells(triangle, front) {
                let mut shared = spare.pop().unwrap_or_default();
                shared.begin(body);
                if !(shared.cut(&own) && planes.all(|plane| shared.cut(&seen.place(&plane)))) {
                    spare.push(shared);
                    continue;
                }
                shared.end();
                let area = area_in(&shared, &own);
                cells.push(Cell { triangle, flat: mesh.flat_of(triangle), front, shared, area });
            }
        }
    }

    /// Joins the cells of a flat, where they are one with all others to the same part, and finds what is one to any part.
    fn group(&mut self, mesh: &TriangleMesh) {
        let Self { cells, members, weights, .. } = self;
        cells.sort_unstable_by_key(|cell| (cell.flat, cell.triangle));
        let mut flats: Vec<Range<usize>> = Vec::new();
        for k in 0..cells.len() {
            match flats.last_mut() {
                Some(flat) if cells[flat.start].flat == cells[k].flat => flat.end = k + 1,
                _ => flats.push(k..k + 1),
            }
        }
        let together = |i: usize, j: usize| {
            let of = |k: usize| (cells[k].triangle, cells[k].front);
            mesh.together(of(i), of(j))
        };
        let mut is_split = vec![false; flats.len()];
        for (a, one) in flats.iter().enumerate() {
            for (b, other) in flats[..a].iter().enumerate() {
                let first = together(one.start, other.start);
                let meet = mesh.do_meet(cells[one.start].flat, cells[other.start].flat);
                let differs =
                    |i: usize| other.clone().any(|j| together(i, j).to_bits() != first.to_bits());
                if !meet && one.clone().any(differs) {
                    (is_split[a], is_split[b]) = (true, true);
                }
            }
        }
        members.clear();
        for (flat, is_split) in flats.into_iter().zip(is_split) {
            let own = |cells| Member { cells, group: 0, moments: Moments::none() };
            if is_split {
                members.extend(flat.map(|k| own(k..k + 1)));
            } else {
                members.push(own(flat));
            }
        }
        let count = members.len();
        weights.clear();
        weights.resize(count * count, 1.0);
        for i in 0..count {
            members[i].group = i;
            for j in 0..i {
                let together = together(members[i].cells.start, members[j].cells.start);
                weights[i * count + j] = together;
                weights[j * count + i] = together;
                if together > 0.0 {
                    let (one, other) = (members[i].group, members[j].group);
                    let (low, high) = (one.min(other), one.max(other));
                    members.iter_mut().filter(|m| m.group == high).for_each(|m| m.group = low);
                }
            }
        }
    }

    /// Thickness of what is shared with the cells of a group, and its gradient.
    fn measure(&mut self, group: usize, seen: &Seen) -> Option<Shared> {
        let Self { cells, members, weights, .. } = self;
        let count = members.len();
        let weight = |i: usize, j: usize| weights[i * count + j];
        let of_group: Vec<usize> = (group..count).filter(|&k| members[k].group == group).collect();
        let cells_of = |k: usize| &cells[members[k].cells.clone()];
        let area: Vec3 = of_group.iter().flat_map(|&k| cells_of(k)).map(|cell| cell.area).sum();
        let first = &cells[members[group].cells.start];
        let upright = if area == Vec3::zeros() {
            let own = seen.mesh.plane_from(first.triangle, first.front);
            seen.place(&own).normal
        } else {
            area.normalize()
        };
        let axes = axes_along(&upright);
        let origin = first.shared.vertices()[*first.shared.left().first()? as usize];

        let mut all = Moments::none();
        for &k in &of_group {
            let mut moments = Moments::none();
            for cell in &cells[members[k].cells.clone()] {
                moments.add(&Moments::of(&cell.shared, &axes, &origin), 1.0);
            }
            all.add(&moments, 1.0);
            members[k].moments = moments;
        }
        let of_group: Vec<usize> =
            of_group.into_iter().filter(|&k| members[k].moments.volume > 0.0).collect();
        let (middle, covariance) = all.centroid_and_covariance()?;

        let of_one = |&i: &usize| {
            let mut sum = Moments::none();
            for &j in &of_group {
                sum.add(&members[j].moments, weight(i, j));
            }
            OfOne::of(&sum)
        };
        let of_one: Vec<OfOne> = of_group.iter().map(of_one).collect();
        let mut square = 0.0;
        for (&i, one) in of_group.iter().zip(&of_one) {
            square += 12.0 * (members[i].moments.volume / one.weight) * one.s;
        }
        let thickness = square.sqrt();
        let is_thick = thickness > THIN * seen.a.shape.bounding_radius();
        if !is_thick {
            return None;
        }

        let (mut force, mut moment, mut reach) = (Vec3::zeros(), Vec3::zeros(), 0.0_f64);
        for (&j, own) in of_group.iter().zip(&of_one) {
            let mut pressure =
                Pressure { a: Mat3::zeros(), b: Vec3::zeros(), e: own.s / own.weight };
            for (&i, one) in of_group.iter().zip(&of_one) {
                let part = weight(i, j) * members[i].moments.volume / (one.weight * one.weight);
                pressure.add(one, part, &middle);
            }
            for Cell { shared, .. } in &cells[members[j].cells.clone()] {
                let place = |k: usize| axes.tr_mul(&(shared.vertices()[k] - origin)) - middle;
                for face in shared.faces().filter(|face| !face.is_cut) {
                    for corners in fan(face.corners) {
                        let corners = corners.map(place);
                        reach = corners.iter().map(Vec3::norm).fold(reach, f64::max);
                        let (f, m) = pressure.on(&corners);
                        force += f;
                        moment += m;
                    }
                }
            }
        }
        let (force, moment) = (force * 6.0, moment * 6.0);
        let length = force.norm();
        let normal = if length > 0.0 { force / length } else { Vec3::z() };
        // The axis of a force that hardly is one lies far away.
        let lever =
            if length > 0.0 { force.cross(&moment) / (length * length) } else { Vec3::zeros() };
        let far = lever.norm() / (FAR * reach);
        let lever = if far > 1.0 { lever / far } else { lever };
        let rest = moment - lever.cross(&force);
        let found = Thickness {
            thickness,
            normal,
            gain: length / thickness,
            point: middle + lever,
            couple: if far > 1.0 { rest } else { normal * rest.dot(&normal) },
            centroid: middle,
            covariance,
        };
        let in_body = found.placed(1.0, &axes).with_origin(&origin);
        let touched = of_group.iter().flat_map(|&k| &cells[members[k].cells.clone()]);
        let facet = touched.map(|cell| seen.mesh.face_of(cell.triangle)).min()?;
        Some(Shared { facet, thickness: in_body.placed(seen.a.scale, seen.a.frame) })
    }
}

/// The area of a cut body that lies in a plane, along its normal [m²].
fn area_in(shared: &Clipped, plane: &Plane) -> Vec3 {
    let vertices = shared.vertices();
    let mut area = Vec3::zeros();
    for face in shared.faces().filter(|face| face.is_cut && face.plane == *plane) {
        for [a, b, c] in fan(face.corners) {
            area += (vertices[b] - vertices[a]).cross(&(vertices[c] - vertices[a])) * 0.5;
        }
    }
    area
}

impl Moments {
    fn none() -> Self {
        Self { volume: 0.0, first: Vec3::zeros(), second: Mat3::zeros() }
    }

    /// Of a polyhedron, in axes that are columns, about an origin.
    fn of(shared: &Clipped, axes: &Mat3, origin: &Vec3) -> Self {
        let place = |k: usize| axes.tr_mul(&(shared.vertices()[k] - origin));
        let (mut volume, mut first, mut second) = (0.0, Vec3::zeros(), Mat3::zeros());
        // About one of its own vertices, so that thin ones keep their digits.
        let Some(&apex) = shared.left().first() else { return Self::none() };
        let base = place(apex as usize);
        for face in shared.faces().filter(|face| !face.corners.contains(&apex)) {
            for corners in fan(face.corners) {
                let [a, b, c] = corners.map(|k| place(k) - base);
                let sixfold = a.dot(&b.cross(&c));
                let sum = a + b + c;
                volume += sixfold;
                first += sum * sixfold;
                let squares = sum * sum.transpose()
                    + a * a.transpose()
                    + b * b.transpose()
                    + c * c.transpose();
                second += squares * sixfold;
            }
        }
        if volume.is_nan() || volume <= 0.0 {
            return Self::none();
        }
        let (volume, first, second) = (volume / 6.0, first / 24.0, second / 120.0);
        Self {
            volume,
            first: first + base * volume,
            second: second
                + base * first.transpose()
                + first * base.transpose()
                + base * base.transpose() * volume,
        }
    }

    fn add(&mut self, other: &Self, weight: f64) {
        self.volume += weight * other.volume;
        self.first += other.first * weight;
        self.second += other.second * weight;
    }

    /// `None` if there is no volume.
    fn centroid_and_covariance(&self) -> Option<(Vec3, Mat3)> {
        if self.volume <= 0.0 {
            return None;
        }
        let centroid = self.first / self.volume;
        Some((centroid, self.second / self.volume - centroid * centroid.transpose()))
    }
}

impl OfOne {
    fn of(sum: &Moments) -> Self {
        let thin = || {
            let (centroid, covariance) = sum.centroid_and_covariance()?;
            let (s, k) = thinness(&covariance)?;
            Some((s, k, centroid))
        };
        let (s, k, centroid) = thin().unwrap_or_default();
        Self { weight: sum.volume, s, k, centroid }
    }
}

impl Pressure {
    /// Adds `part (|K (x - c)|² - 2 s)`, with `x` about the middle.
    fn add(&mut self, one: &OfOne, part: f64, middle: &Vec3) {
        let squared = one.k * one.k * part;
        let way = one.centroid - middle;
        self.a += squared;
        self.b += squared * way;
        self.e += way.dot(&(squared * way)) - 2.0 * part * one.s;
    }

    /// `n ∫ q dA` and `∫ q x × n dA` of a triangle, by a rule that is exact for cubic functions.
    fn on(&self, [p, q, r]: &[Vec3; 3]) -> (Vec3, Vec3) {
        let area = (q - p).cross(&(r - p)) * 0.5;
        let points = [*p, *q, *r, (p + q) * 0.5, (q + r) * 0.5, (r + p) * 0.5, (p + q + r) / 3.0];
        let weights = [0.05, 0.05, 0.05, 2.0 / 15.0, 2.0 / 15.0, 2.0 / 15.0, 0.45];
        let (mut total, mut at) = (0.0, Vec3::zeros());
        for (x, weight) in points.iter().zip(weights) {
            let q = weight * (x.dot(&(self.a * x)) - 2.0 * self.b.dot(x) + self.e);
            total += q;
            at += x * q;
        }
        (area * total, at.cross(&area))
    }
}
