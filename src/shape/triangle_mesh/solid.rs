//! What lies behind triangles, for grains with faces.
//!
//! A face of a grain has no contact point that a triangle could be asked about: what counts is what the grain shares with the
//! body of the wall ([`crate::contact::thickness`]). That body is made of *cells*. Behind each triangle lies one, convex, bounded by
//!
//! - the plane of the triangle,
//! - at each of its edges the plane that halves the angle to the next triangle; where the surface ends, the plane upright on it,
//! - a plane at a depth: that of the farthest that a grain can reach, or half of the distance to the surface behind,
//! - where it would reach through a convex edge that it does not have itself, the plane that halves the angle there.
//!
//! Cells of one side do not overlap, and together leave no gap near the surface. They never move in the axes of the wall, so that an energy
//! of what a grain shares with them depends on its pose alone.
//!
//! A grain is in front of a part of the surface that hangs together, on the side of its centre: that on which the centre is of the
//! nearest triangle.
//!
//! # Which cells are one surface
//!
//! | two triangles | weight |
//! |---|---|
//! | of one face, or of faces that meet in convex edges only | 1 |
//! | of faces that meet in a concave edge | from 1 below [`ONE`] to 0 above [`APART`], by its angle |
//! | of others, neither of which is in front of the other | 1 |
//! | of others | the same by the angle between their normals, or by that at which the nearest points of both stand over each other, if that is more |

use super::TriangleMesh;
use super::building::{Side, sides_of};
use super::nearest::{nearest_on, nearest_on_segment};
use crate::math::{Vec3, bounds};
use crate::shape::clip::{Clipped, inside};
use crate::shape::facets::Plane;
use serde::{Deserialize, Serialize};

/// Faces of a smaller concave angle are one surface [rad].
const ONE: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// Faces of a larger concave angle are two surfaces [rad].
const APART: f64 = 45.0 * std::f64::consts::PI / 180.0;
/// Cells are cut only by their own edges where normals of faces are as near as this, as a cosine.
const BENT: f64 = 0.9999;
/// A cell into which more faces come is cut by its own edges alone.
const MOST: usize = 64;
/// How far beside a face a point stands over it, over the size of the surface.
const OVER: f64 = 1e-7;
/// Folds that are sharper than this have no plane that halves them: sum of unit vectors across.
const FOLDED: f64 = 1e-6;
/// What is nearer to a plane than this part of the size of the surface lies in it.
const LEVEL: f64 = 1e-10;
/// A surface whose normal is turned from the opposite one by more than an angle with this cosine is not the back of a plate.
const BACK: f64 = 0.5;
/// A point of a triangle is at a corner, or on a side, if it is as near as this, over the size of the triangle.
const AT: f64 = 1e-9;

/// Why a surface has no two sides.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum NoSolid {
    /// Three triangles at an edge.
    #[error("has an edge of three triangles or more at ({:e}, {:e}, {:e}) m: what is behind them cannot be told", .0.x, .0.y, .0.z)]
    Crowded(Vec3),
    /// A Möbius strip.
    #[error("has one side only, as a Möbius strip, seen at ({:e}, {:e}, {:e}) m", .0.x, .0.y, .0.z)]
    OneSided(Vec3),
    /// Two triangles on each other.
    #[error("is folded onto itself at ({:e}, {:e}, {:e}) m", .0.x, .0.y, .0.z)]
    Folded(Vec3),
    /// A cylinder or a cone.
    #[error("is no surface of triangles")]
    Round,
}

/// What is behind one triangle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Behind {
    /// Whether the normal of its face points to the side that its part calls the front: 1, or -1.
    sign: f64,
    /// Which part of the surface it belongs to.
    part: u32,
    /// At each edge, the plane that halves the angle, with its normal out of the cell.
    borders: [Plane; 3],
    /// How deep its cell is, seen from the front and from the back [m].
    depth: [f64; 2],
}

/// Faces that meet, with their weights seen from the front and from the back.
type Meeting = (u32, u32, [f64; 2]);

/// The triangle beyond each side of one, and which of its sides that is.
type Beyond = [Option<(u32, usize)>; 3];

/// By two faces that meet, a triangle of the second.
type Ridges = std::collections::BTreeMap<(u32, u32), u32>;

/// What is behind all triangles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Solid {
    behind: Vec<Behind>,
    /// In rising order.
    meetings: Vec<Meeting>,
    /// Further planes of cells, those of one behind the other, and where those of each begin: from the front, then from the back.
    cuts: Vec<Plane>,
    first_cut: Vec<u32>,
    /// What is nearer to a plane lies in it [m].
    level: f64,
}

impl Solid {
    /// Takes axes that begin at this place [m].
    pub(super) fn see_from(&mut self, place: &Vec3) {
        let borders = self.behind.iter_mut().flat_map(|behind| &mut behind.borders);
        for plane in borders.chain(&mut self.cuts) {
            plane.offset -= plane.normal.dot(place);
        }
    }

    /// Bytes that it holds.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.behind)
            + size_of_val(&*self.meetings)
            + size_of_val(&*self.cuts)
            + size_of_val(&*self.first_cut)
    }

    fn meeting(&self, one: u32, other: u32) -> Option<&Meeting> {
        let key = (one.min(other), one.max(other));
        let place = self.meetings.binary_search_by_key(&key, |m| (m.0, m.1)).ok()?;
        Some(&self.meetings[place])
    }
}

/// A side of a surface: its front, or its back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Front {
    /// As the first triangle of its part has it.
    Front,
    /// The other.
    Back,
}

impl Front {
    const fn index(self) -> usize {
        self as usize
    }

    const fn sign(self) -> f64 {
        match self {
            Self::Front => 1.0,
            Self::Back => -1.0,
        }
    }
}

/// A triangle near a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Its number.
    pub triangle: u32,
    /// Its distance from the point [m].
    pub distance: f64,
}

impl TriangleMesh {
    /// With what is behind its triangles, for grains with faces that reach so far at most [m].
    ///
    /// # Errors
    /// If the surface has no two sides.
    pub fn with_cells(mut self, farthest: f64) -> Result<Self, NoSolid> {
        self.add_cells(farthest)?;
        Ok(self)
    }

    /// Adds what is behind its triangles: see [`TriangleMesh::with_cells`].
    ///
    /// # Errors
    /// If the surface has no two sides; then nothing is added.
    pub fn add_cells(&mut self, farthest: f64) -> Result<(), NoSolid> {
        self.solid = None;
        if !self.facets.strips.is_empty() {
            return Err(NoSolid::Round);
        }
        let mut solid = Solid {
            behind: Vec::with_capacity(self.triangles.len()),
            meetings: Vec::new(),
            cuts: Vec::new(),
            first_cut: vec![0; 2 * self.triangles.len() + 1],
            level: LEVEL * self.reach,
        };
        let neighbours = self.neighbours()?;
        let parts = self.parts(&neighbours)?;
        for (triangle, ((sign, part), beyond)) in (0..).zip(parts.iter().zip(&neighbours)) {
            let mut borders = [Plane { normal: Vec3::zeros(), offset: 0.0 }; 3];
            for (k, border) in borders.iter_mut().enumerate() {
                let (from, across) = self.across(triangle, k);
                let beyond = beyond[k].map_or_else(Vec3::zeros, |(t, k)| self.across(t, k).1);
                let out = across - beyond;
                let length = out.norm();
                if length < FOLDED {
                    return Err(NoSolid::Folded(from));
                }
                let normal = out / length;
                *border = Plane { normal, offset: normal.dot(&from) };
            }
            let depth = [farthest; 2];
            solid.behind.push(Behind { sign: *sign, part: *part, borders, depth });
        }
        solid.meetings = self.meetings(&neighbours, &solid);
        self.solid = Some(solid);
        let ridges = self.ridges(&neighbours);
        let (mut depths, mut cuts, mut first_cut) = (Vec::new(), Vec::new(), vec![0]);
        for triangle in 0..self.triangles.len() as u32 {
            let beside = self.triangles_beside(triangle, farthest);
            depths.push([Front::Front, Front::Back].map(|front| {
                let beyond = self.beyond(triangle, front, &beside, &ridges);
                let first = self.depth(triangle, front, &beside, &beyond, farthest);
                let depths = [first, 0.5 * farthest];
                let (faces, planes) = self.cuts_by(triangle, front, &beyond, depths);
                cuts.extend(planes);
                first_cut.push(cuts.len() as u32);
                if faces.len() == beyond.len() {
                    first
                } else {
                    self.depth(triangle, front, &beside, &faces, farthest)
                }
            }));
        }
        if let Some(solid) = &mut self.solid {
            for (behind, depth) in solid.behind.iter_mut().zip(depths) {
                behind.depth = depth;
            }
            (solid.cuts, solid.first_cut) = (cuts, first_cut);
        }
        Ok(())
    }

    /// Are there cells behind its triangles?
    pub const fn has_cells(&self) -> bool {
        self.solid.is_some()
    }

    /// The triangles nearer to a point than a distance [m], in rising order.
    pub fn triangles_near(&self, point: &Vec3, distance: f64, near: &mut Vec<Near>) {
        near.clear();
        let reach = Vec3::repeat(distance);
        self.grid.for_each_in(&(point - reach), &(point + reach), |triangle| {
            let corners = self.corners(&self.triangles[triangle as usize]);
            let from_it = (nearest_on(&corners, point) - point).norm();
            if from_it < distance {
                near.push(Near { triangle, distance: from_it });
            }
        });
        near.sort_unstable_by_key(|near| near.triangle);
        near.dedup_by_key(|near| near.triangle);
    }

    /// The face of a triangle.
    pub fn face_of(&self, triangle: u32) -> u32 {
        self.triangles[triangle as usize].facets[0]
    }

    /// The part of the surface to which a triangle belongs.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn part_of(&self, triangle: u32) -> u32 {
        self.behind(triangle).part
    }

    /// On which side of one of its parts a point is, by the nearest of these triangles that belong to it. Where that is nearest at an edge or a
    /// corner, by the mean of the normals there, weighted by the angles of triangles (Bærentzen and Aanæs 2005, DOI 10.1109/TVCG.2005.49).
    ///
    /// # Panics
    /// If there are no cells.
    pub fn side_of(&self, part: u32, point: &Vec3, near: &[Near]) -> Front {
        let of_part = || near.iter().filter(|near| self.part_of(near.triangle) == part);
        let by_distance = |one: &&Near, other: &&Near| one.distance.total_cmp(&other.distance);
        let Some(first) = of_part().min_by(by_distance) else { return Front::Front };
        let nearest = nearest_on(&self.corners(&self.triangles[first.triangle as usize]), point);
        let there = self.vertices_at(first.triangle, &nearest);
        let mut height = 0.0;
        for Near { triangle, .. } in of_part() {
            let corners = self.triangles[*triangle as usize].corners;
            if there.iter().all(|vertex| corners.contains(vertex)) {
                let weight =
                    if let [vertex] = *there { self.angle_at(*triangle, vertex) } else { 1.0 };
                let Plane { normal, .. } = self.plane_from(*triangle, Front::Front);
                height += weight * (point - nearest).dot(&normal);
            }
        }
        if height < 0.0 { Front::Back } else { Front::Front }
    }

    /// The vertices of a triangle between which a point of it lies: one at a corner, two on a side.
    fn vertices_at(&self, triangle: u32, point: &Vec3) -> Vec<u32> {
        let numbers = self.triangles[triangle as usize].corners;
        let corners = self.corners(&self.triangles[triangle as usize]);
        let size = (corners[1] - corners[0]).norm().max((corners[2] - corners[0]).norm());
        let is_at = |place: &Vec3| (place - point).norm() <= AT * size;
        if let Some(k) = (0..3).find(|&k| is_at(&corners[k])) {
            return vec![numbers[k]];
        }
        let sides = [[0, 1], [1, 2], [2, 0]];
        let side = sides
            .into_iter()
            .find(|&[from, to]| is_at(&nearest_on_segment(&corners[from], &corners[to], point)));
        side.map_or_else(|| numbers.to_vec(), |side| side.map(|k| numbers[k]).to_vec())
    }

    /// The angle of a triangle at one of its corners [rad].
    fn angle_at(&self, triangle: u32, vertex: u32) -> f64 {
        let [a, b, c] = self.triangles[triangle as usize].corners;
        let [one, other] = if vertex == a {
            [b, c]
        } else if vertex == b {
            [c, a]
        } else {
            [a, b]
        };
        let way = |to: u32| self.vertices[to as usize] - self.vertices[vertex as usize];
        angle_between(&way(one), &way(other))
    }

    /// The planes of the cell behind a triangle, seen from a side: first its own.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn cell(&self, triangle: u32, front: Front) -> impl Iterator<Item = Plane> {
        let Solid { cuts, first_cut, .. } = self.solid();
        let number = 2 * triangle as usize + front.index();
        let cuts = &cuts[first_cut[number] as usize..first_cut[number + 1] as usize];
        let depth = self.behind(triangle).depth[front.index()];
        self.frustum(triangle, front, depth).into_iter().chain(cuts.iter().copied())
    }

    /// The planes of that cell without cuts: its own, those at its edges, and that of the depth.
    fn frustum(&self, triangle: u32, front: Front, depth: f64) -> [Plane; 5] {
        let own = self.plane_from(triangle, front);
        let bottom = Plane { normal: -own.normal, offset: depth - own.offset };
        let [a, b, c] = self.behind(triangle).borders;
        [own, a, b, c, bottom]
    }

    /// The plane of a triangle, with its normal to the side from which it is seen.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn plane_from(&self, triangle: u32, front: Front) -> Plane {
        let Plane { normal, offset } = self.plane(triangle);
        let sign = self.behind(triangle).sign * front.sign();
        Plane { normal: normal * sign, offset: offset * sign }
    }

    /// How far the cells behind two triangles are one surface, each seen from a side: from 0 to 1.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn together(&self, one: (u32, Front), other: (u32, Front)) -> f64 {
        let triangles = [one.0, other.0];
        let faces = triangles.map(|t| self.face_of(t));
        if faces[0] == faces[1] {
            return 1.0;
        }
        let solid = self.solid();
        if let Some((.., weights)) = solid.meeting(faces[0], faces[1]) {
            return weights[one.1.index()];
        }
        let normals = [one, other].map(|(triangle, front)| self.plane_from(triangle, front).normal);
        let corners = triangles.map(|t| self.corners(&self.triangles[t as usize]));
        let over = |k: usize| {
            let above = |corner: &Vec3| (corner - corners[k][0]).dot(&normals[k]);
            corners[1 - k].iter().map(above).fold(f64::NEG_INFINITY, f64::max)
        };
        if over(0) <= solid.level && over(1) <= solid.level {
            return 1.0;
        }
        let angle = angle_between(&normals[0], &normals[1]);
        if angle >= APART {
            return 0.0;
        }
        let [own, others] = triangles.map(|t| &self.triangles[t as usize].corners);
        if own.iter().any(|k| others.contains(k)) {
            return weight(angle);
        }
        let way = way_between(&corners[0], &corners[1]);
        let distance = way.norm();
        if distance == 0.0 {
            return 0.0;
        }
        let elevation = (way.dot(&normals[0]).max(-way.dot(&normals[1])) / distance).min(1.0);
        weight(angle.max(libm::asin(elevation)))
    }

    /// Do two faces meet in an edge? Then all of their cells are one to the same part.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn do_meet(&self, one: u32, other: u32) -> bool {
        self.solid().meeting(one, other).is_some()
    }

    fn solid(&self) -> &Solid {
        self.solid.as_ref().expect("grains with faces ask for cells first")
    }

    fn behind(&self, triangle: u32) -> &Behind {
        &self.solid().behind[triangle as usize]
    }

    /// The plane of the face of a triangle.
    fn plane(&self, triangle: u32) -> Plane {
        self.facets.faces[self.face_of(triangle) as usize]
    }

    /// Where a side of a triangle begins, and the unit vector that leads out of it there, in its plane.
    fn across(&self, triangle: u32, side: usize) -> (Vec3, Vec3) {
        let triangle_of = &self.triangles[triangle as usize];
        // Both triangles of an edge begin at the same end.
        let ends = [triangle_of.corners[side], triangle_of.corners[(side + 1) % 3]];
        let [from, to] =
            [ends[0].min(ends[1]), ends[0].max(ends[1])].map(|k| self.vertices[k as usize]);
        let third = self.vertices[triangle_of.corners[(side + 2) % 3] as usize];
        let normal = self.plane(triangle).normal;
        let across = normal.cross(&(to - from)).normalize();
        (from, if (third - from).dot(&across) > 0.0 { -across } else { across })
    }

    /// The triangle beyond each side of each triangle, and which of its sides that is.
    fn neighbours(&self) -> Result<Vec<Beyond>, NoSolid> {
        let sides = sides_of(self.triangles.iter().map(|triangle| triangle.corners));
        let mut neighbours = vec![[None; 3]; self.triangles.len()];
        for of in sides.chunk_by(Side::is_same) {
            match of {
                [_] => {}
                [one, other] => {
                    for (one, other) in [(one, other), (other, one)] {
                        neighbours[one.triangle as usize][one.number as usize] =
                            Some((other.triangle, other.number as usize));
                    }
                }
                _ => return Err(NoSolid::Crowded(self.vertices[of[0].ends[0] as usize])),
            }
        }
        Ok(neighbours)
    }

    /// The sign of each triangle, and the part to which it belongs.
    fn parts(&self, neighbours: &[Beyond]) -> Result<Vec<(f64, u32)>, NoSolid> {
        let mut found: Vec<Option<(f64, u32)>> = vec![None; self.triangles.len()];
        let mut part = 0;
        for first in 0..self.triangles.len() as u32 {
            if found[first as usize].is_some() {
                continue;
            }
            found[first as usize] = Some((1.0, part));
            let mut next = vec![first];
            while let Some(triangle) = next.pop() {
                let sign = found[triangle as usize].map_or(1.0, |(sign, _)| sign);
                for (k, beyond) in neighbours[triangle as usize].iter().enumerate() {
                    let &Some((other, side)) = beyond else { continue };
                    // Seen from the front, the way across turned a quarter about the edge is the normal, and in the next triangle that to
                    // the other side.
                    let turns = |t: u32, k: usize| {
                        let (from, across) = self.across(t, k);
                        let corners = &self.triangles[t as usize].corners;
                        let ends =
                            [corners[k], corners[(k + 1) % 3]].map(|k| self.vertices[k as usize]);
                        let to = if ends[0] == from { ends[1] } else { ends[0] };
                        self.plane(t).normal.cross(&(to - from)).dot(&across).signum()
                    };
                    let expected = -sign * turns(triangle, k) * turns(other, side);
                    match &mut found[other as usize] {
                        Some((sign, _)) if *sign != expected => {
                            return Err(NoSolid::OneSided(self.across(triangle, k).0));
                        }
                        Some(_) => {}
                        of => {
                            *of = Some((expected, part));
                            next.push(other);
                        }
                    }
                }
            }
            part += 1;
        }
        Ok(found.into_iter().flatten().collect())
    }

    /// Faces that meet in edges.
    fn meetings(&self, neighbours: &[Beyond], solid: &Solid) -> Vec<Meeting> {
        let mut meetings: Vec<Meeting> = Vec::new();
        for (triangle, beyond) in (0..).zip(neighbours) {
            for &(other, side) in beyond.iter().flatten() {
                let (one, two) = (self.face_of(triangle), self.face_of(other));
                if one >= two {
                    continue;
                }
                let normal = self.plane(triangle).normal * solid.behind[triangle as usize].sign;
                let turned = self.plane(other).normal * solid.behind[other as usize].sign;
                let angle = angle_between(&normal, &turned);
                // From the edge into the other triangle, over the front of the first.
                let rises = -self.across(other, side).1.dot(&normal) > 0.0;
                let concave = weight(angle);
                meetings.push((one, two, if rises { [concave, 1.0] } else { [1.0, concave] }));
            }
        }
        meetings.sort_by_key(|meeting| (meeting.0, meeting.1));
        // Of several edges, the one that holds least together counts.
        meetings.dedup_by(|again, first| {
            let is_same = (again.0, again.1) == (first.0, first.1);
            if is_same {
                first.2 = [0, 1].map(|k| first.2[k].min(again.2[k]));
            }
            is_same
        });
        meetings
    }

    /// The faces that meet in edges.
    fn ridges(&self, neighbours: &[Beyond]) -> Ridges {
        let mut ridges = Ridges::new();
        for (triangle, beyond) in (0..).zip(neighbours) {
            for (other, _) in beyond.iter().copied().flatten() {
                let faces = (self.face_of(triangle), self.face_of(other));
                if faces.0 != faces.1 {
                    ridges.entry(faces).or_insert(other);
                }
            }
        }
        ridges
    }

    /// The triangles that may be so near to one [m], without those of its face.
    fn triangles_beside(&self, triangle: u32, farthest: f64) -> Vec<u32> {
        let (low, high) = bounds(&self.corners(&self.triangles[triangle as usize]));
        let reach = Vec3::repeat(farthest);
        let mut beside = Vec::new();
        self.grid.for_each_in(&(low - reach), &(high + reach), |other| beside.push(other));
        beside.sort_unstable();
        beside.dedup();
        let face = self.face_of(triangle);
        beside.retain(|&other| self.face_of(other) != face);
        beside
    }

    /// The planes of faces beside that meet the face of a triangle in convex edges, with it behind them, in the order of faces.
    fn beyond(
        &self,
        triangle: u32,
        front: Front,
        beside: &[u32],
        ridges: &Ridges,
    ) -> Vec<(u32, Plane)> {
        let own = self.plane_from(triangle, front);
        let mut faces: Vec<u32> = beside.iter().map(|&other| self.face_of(other)).collect();
        faces.sort_unstable();
        faces.dedup();
        let meets = |face| Some((face, *ridges.get(&(self.face_of(triangle), face))?));
        let convex = faces.into_iter().filter_map(meets).filter(|&(_, other)| {
            let beyond = self.plane_from(other, front);
            own.normal.dot(&beyond.normal) <= BENT
                && self.lies_below(triangle, &beyond)
                && self.lies_below(other, &own)
        });
        convex.map(|(face, other)| (face, self.plane_from(other, front))).collect()
    }

    /// Of such faces those that come into the cell behind a triangle, and the planes that halve the angles there. What is cut off, as
    /// deep as grains reach, stands over these faces, so that it belongs to the cells behind them.
    fn cuts_by(
        &self,
        triangle: u32,
        front: Front,
        beyond: &[(u32, Plane)],
        [depth, reached]: [f64; 2],
    ) -> (Vec<(u32, Plane)>, Vec<Plane>) {
        if beyond.is_empty() {
            return Default::default();
        }
        let own = self.plane_from(triangle, front);
        let corners = self.corners(&self.triangles[triangle as usize]);
        let (low, high) = bounds(&corners);
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let from_middle =
            |plane: Plane| Plane { offset: plane.offset - plane.normal.dot(&middle), ..plane };
        let cell = |depth: f64| {
            let planes = self.frustum(triangle, front, depth).map(from_middle);
            let mut cell = Clipped::default();
            cell.begin(&inside(&planes, 2.0 * ((high - low).norm() + depth))?);
            Some(cell)
        };
        let (Some(whole), Some(near)) = (cell(depth), cell(depth.min(reached))) else {
            return Default::default();
        };
        let level = self.solid().level;
        let comes_in = |cell: &Clipped, cut: &Plane| {
            let height = |&k: &u32| cell.vertices()[k as usize].dot(&cut.normal) - cut.offset;
            cell.left().iter().any(|k| height(k) > level)
        };
        let cut_by = |plane: &Plane| from_middle(nearer(plane, &own));
        let mut left: Vec<(u32, Plane)> = beyond.to_vec();
        left.retain(|(_, plane)| comes_in(&whole, &cut_by(plane)));
        if left.len() > MOST {
            return Default::default();
        }
        // What one of them does not own may belong to none: those that are left are looked at again.
        loop {
            let owns = |&(face, plane): &(u32, Plane)| {
                let others = left.iter().map(|(_, other)| other);
                let others = others.filter(|other| (other.normal - plane.normal).norm() > FOLDED);
                let nearest = others.map(|other| nearer(other, &plane));
                let limits = [nearer(&own, &plane), plane].into_iter().chain(nearest);
                let mut off = near.clone();
                let is_there = limits.map(from_middle).all(|limit| off.cut(&limit));
                !is_there || self.stand_over(face, &plane, &off, &middle)
            };
            let owned: Vec<(u32, Plane)> = left.iter().copied().filter(owns).collect();
            if owned.len() == left.len() {
                break;
            }
            left = owned;
        }
        // Those that cut off what others leave.
        let mut cell = whole;
        let cuts = left.iter().filter(|(_, plane)| {
            let cut = cut_by(plane);
            comes_in(&cell, &cut) && cell.cut(&cut)
        });
        let planes = cuts.map(|(_, plane)| nearer(plane, &own)).collect();
        (left, planes)
    }

    /// Does a body, seen from a place, stand over a face, by its vertices and points between them?
    fn stand_over(&self, face: u32, plane: &Plane, body: &Clipped, place: &Vec3) -> bool {
        let is_over = |point: &Vec3| {
            let point = point + place;
            let foot = point - plane.normal * (point.dot(&plane.normal) - plane.offset);
            self.is_on_face(face, &foot, OVER * self.reach)
        };
        let vertices: Vec<Vec3> =
            body.left().iter().map(|&k| body.vertices()[k as usize]).collect();
        vertices.iter().enumerate().all(|(k, one)| {
            let between = |other: &Vec3| {
                [0.25, 0.5, 0.75].iter().all(|part| is_over(&(one + (other - one) * *part)))
            };
            is_over(one) && vertices[..k].iter().all(between)
        })
    }

    /// Does a triangle lie behind a plane, or in it?
    fn lies_below(&self, triangle: u32, plane: &Plane) -> bool {
        let corners = self.corners(&self.triangles[triangle as usize]);
        let height = |corner: &Vec3| corner.dot(&plane.normal) - plane.offset;
        corners.iter().all(|corner| height(corner) <= self.solid().level)
    }

    /// How deep a cell can be: half of the way to what is behind it, without these faces.
    fn depth(
        &self,
        triangle: u32,
        front: Front,
        beside: &[u32],
        but: &[(u32, Plane)],
        farthest: f64,
    ) -> f64 {
        let own = &self.triangles[triangle as usize];
        let [plane, borders @ .., _] = self.frustum(triangle, front, farthest);
        let mut depth = farthest;
        let mut polygon = Vec::new();
        for &other in beside {
            let of = &self.triangles[other as usize];
            let is_left_out = but.binary_search_by_key(&of.facets[0], |(face, _)| *face).is_ok()
                || of.corners.iter().any(|k| own.corners.contains(k));
            if is_left_out {
                continue;
            }
            let is_back = if self.part_of(other) == self.part_of(triangle) {
                self.plane_from(other, front).normal.dot(&plane.normal) < -BACK
            } else {
                self.plane(other).normal.dot(&plane.normal).abs() > BACK
            };
            if !is_back {
                continue;
            }
            polygon.clear();
            polygon.extend(self.corners(of));
            for border in &borders {
                polygon = below(&polygon, border);
            }
            let heights = || polygon.iter().map(|p| p.dot(&plane.normal) - plane.offset);
            // What comes through the plane is no back.
            if heights().all(|height| height < -self.solid().level) {
                depth = heights().fold(depth, |depth, height| depth.min(-0.5 * height));
            }
        }
        depth
    }
}

/// The half-space of what is nearer to the second of two planes than to the first, behind both.
fn nearer(first: &Plane, second: &Plane) -> Plane {
    let across = first.normal - second.normal;
    let length = across.norm();
    Plane { normal: across / length, offset: (first.offset - second.offset) / length }
}

/// 1 of small angles, 0 of large ones.
fn weight(angle: f64) -> f64 {
    let x = ((APART - angle) / (APART - ONE)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

fn angle_between(one: &Vec3, other: &Vec3) -> f64 {
    libm::atan2(one.cross(other).norm(), one.dot(other))
}

/// What of a convex polygon lies below a plane.
fn below(polygon: &[Vec3], plane: &Plane) -> Vec<Vec3> {
    let height = |p: &Vec3| p.dot(&plane.normal) - plane.offset;
    let mut left = Vec::with_capacity(polygon.len() + 1);
    for (k, p) in polygon.iter().enumerate() {
        let q = &polygon[(k + 1) % polygon.len()];
        let (here, there) = (height(p), height(q));
        if here <= 0.0 {
            left.push(*p);
        }
        if (here <= 0.0) != (there <= 0.0) {
            left.push(p + (q - p) * (here / (here - there)));
        }
    }
    left
}

/// The shortest way from a triangle to another that does not cross it [m].
fn way_between(one: &[Vec3; 3], other: &[Vec3; 3]) -> Vec3 {
    let to_corners = other.iter().map(|corner| corner - nearest_on(one, corner));
    let from_corners = one.iter().map(|corner| nearest_on(other, corner) - corner);
    let sides = |t: &[Vec3; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    let between = sides(one)
        .into_iter()
        .flat_map(|side| sides(other).map(|beyond| between_segments(side, beyond)));
    to_corners
        .chain(from_corners)
        .chain(between)
        .min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))
        .unwrap_or_else(Vec3::zeros)
}

/// The way between the nearest points of two lines if they lie within both segments, else that between the first ends.
fn between_segments((a, b): (Vec3, Vec3), (c, d): (Vec3, Vec3)) -> Vec3 {
    let (along, beyond, way) = (b - a, d - c, c - a);
    let (aa, bb, ab) = (along.norm_squared(), beyond.norm_squared(), along.dot(&beyond));
    let determinant = aa * bb - ab * ab;
    let (s, t) = (
        (way.dot(&along) * bb - way.dot(&beyond) * ab) / determinant,
        (way.dot(&along) * ab - way.dot(&beyond) * aa) / determinant,
    );
    let within = |x: f64| (0.0..=1.0).contains(&x);
    if within(s) && within(t) { way + beyond * t - along * s } else { way }
}
