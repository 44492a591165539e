//! A body with faces on a surface of triangles: the thickness of its volume in the cells behind them ([`crate::shape::triangle_mesh`]).
//!
//! The moving body is the one with faces, and the cells are fixed. Cells are joined to the degree to which the surface joins their triangles
//! ([`super::together`]).
//!
//! # Contacts
//!
//! Faces joined to any degree, directly or through others, make one contact. It belongs to the pair of the lowest of them. Edges and corners
//! have no contacts.

use super::faces::fan;
use super::seen::{Seen, Shared};
use super::sides::Side;
use super::sides_on_surface::{Room, clear_of};
use super::thickness::Thickness;
use super::together::{SharedVolume, thickness_of};
use super::{Batch, ContactResolver, Definition, Found, Outcome, Posed, Why, patch, touch};
use crate::math::Vec3;
use crate::shape::Shape;
use crate::shape::clip::Clipped;
use crate::shape::facets::Plane;
use crate::shape::triangle_mesh::{Front, MeshFacet, Near, TriangleMesh};
use std::cell::RefCell;
use std::ops::Range;

/// Resolver of a body with faces or a straight side (A) against a facet of a surface of triangles (B).
///
/// For bodies with faces, B must have cells ([`TriangleMesh::with_cells`]). The relative position points from the centre of A to the
/// reference point of the wall.
#[derive(Clone, Copy, Debug, Default)]
pub struct OverlapWithSurface;

/// All contacts of one body with one surface.
#[derive(Default)]
struct Scratch {
    near: Vec<Near>,
    sides: Vec<(u32, Front)>,
    cells: Vec<Cell>,
    /// Memory for cells, kept from one body to the next.
    spare: Vec<Clipped>,
    members: Vec<Member>,
    weights: Vec<f64>,
    of_sides: Room,
    found: Vec<Shared>,
}

/// Volume that a body shares with one cell.
struct Cell {
    triangle: u32,
    flat: u32,
    front: Front,
    shared: Clipped,
    /// Area that lies in the plane of the triangle, along its normal [m²].
    area: Vec3,
}

/// Cells of a flat that are treated as one.
struct Member {
    cells: Range<usize>,
    /// The lowest member to which this one is joined.
    group: usize,
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
            // Pairs of one body with facets of one wall are consecutive.
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

/// Contacts of a body with a surface of triangles, each with the lowest of its facets.
///
/// A body with faces needs a surface with cells; a body with a straight side takes any surface. There are no contacts for other bodies. `r` points
/// from the centre of A to the reference point of the wall [m].
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

/// A cell, by its triangle and the side of the triangle on which it is.
type Behind = (u32, Front);

/// Volumes that a body with faces shares with cells of a surface.
pub(super) fn cells_of(seen: &Seen) -> Vec<(Behind, Clipped)> {
    SCRATCH.with_borrow_mut(|scratch| {
        scratch.spare.extend(scratch.cells.drain(..).map(|cell| cell.shared));
        scratch.find_cells(seen);
        let Scratch { cells, .. } = scratch;
        cells.sort_unstable_by_key(|cell| (cell.flat, cell.triangle));
        cells.drain(..).map(|cell| ((cell.triangle, cell.front), cell.shared)).collect()
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
            // A NaN ends here.
            return if thickness.thickness.is_finite() && thickness.gain.is_finite() {
                Ok(*thickness)
            } else {
                Err(Outcome::Failed(Why::NotFinite))
            };
        }
        // The facet is not touched before the body reaches it.
        let clear = match (seen.mesh.facet(facet), Side::of(seen.a)) {
            (of, Some(side)) => clear_of(&side, seen, &of),
            // A body that touches another face may have its contact with this one in the next step.
            (MeshFacet::Face { .. }, None) if !self.found.is_empty() => 0.0,
            (MeshFacet::Face { normal, offset }, None) => {
                let height = seen.centre.dot(&normal) - offset;
                let sign = if height < 0.0 { -1.0 } else { 1.0 };
                // Behind its plane, over a neighbouring face, a body is at least half as far from the space behind this face.
                0.5 * seen.height_over(&Plane { normal: normal * sign, offset: offset * sign })
            }
            // Edges and corners have no contacts of their own with bodies with faces.
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

    /// Groups the cells of each flat that are joined to all others to the same degree, and then all members joined to any degree.
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
            let own = |cells| Member { cells, group: 0 };
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

    /// Thickness of the volume in the cells of a group, and its gradient.
    fn measure(&self, group: usize, seen: &Seen) -> Option<Shared> {
        let Self { cells, members, weights, .. } = self;
        let count = members.len();
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
        let lumps: Vec<Vec<SharedVolume>> = of_group
            .iter()
            .map(|&k| cells_of(k).iter().map(|cell| SharedVolume::of(&cell.shared)).collect())
            .collect();
        let weight = |i: usize, j: usize| weights[of_group[i] * count + of_group[j]];
        let size = seen.a.shape.bounding_radius();
        let (found, with_volume) = thickness_of(&lumps, weight, &upright, size)?;
        let touched = of_group.iter().zip(with_volume).filter(|(_, has_volume)| *has_volume);
        let touched = touched.flat_map(|(&k, _)| cells_of(k));
        let facet = touched.map(|cell| seen.mesh.face_of(cell.triangle)).min()?;
        Some(Shared { facet, thickness: found.placed(seen.a.scale, seen.a.frame) })
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
