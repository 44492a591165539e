//! Volume behind triangles, for particles with faces.
//!
//! A face of a particle has no contact point for which a triangle could be examined. Its contact follows from the volume that the particle
//! shares with the body of the wall ([`crate::contact::thickness`]). That body consists of *cells*. Behind each triangle there are one or
//! more of them, convex and bounded by
//!
//! - the plane of the triangle,
//! - at each of its edges the plane that halves the angle to the next triangle; where the surface ends, the plane upright on it,
//! - a plane as deep as contacts can be,
//! - further planes where a surface is nearer behind, and where cells would extend through others ([`super::cells`]).
//!
//! Cells of one side do not overlap near the surface, and leave no gap there. They never move in the axes of the wall, so the energy of the
//! shared volume depends on the pose of the particle alone.
//!
//! A particle is in front of a connected part of the surface on the side of its centre: the side of the nearest triangle where the centre is.
//!
//! # Joined cells
//!
//! A *flat* is a face, or several faces in one plane within the digits of a file.
//!
//! | two triangles | weight |
//! |---|---|
//! | of one flat, or of flats that meet in convex edges only | 1 |
//! | of flats that meet in a concave edge | from 1 below [`ONE`] to 0 above [`APART`], by its angle |
//! | of others, neither of which is in front of the other | 1 |
//! | of others | the same, by the angle between their normals, or by the elevation of the nearest points of both over each other, if that is larger |

use super::building::{Side, sides_of};
use super::cells::{Beyond, Cells, Front, Making};
use super::nearest::{nearest_on, nearest_on_segment};
use super::{NONE, TriangleMesh};
use crate::math::Vec3;
use crate::shape::facets::Plane;
use serde::{Deserialize, Serialize};

/// Faces with a smaller concave angle are one surface [rad].
const ONE: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// Faces with a larger concave angle are two surfaces [rad].
const APART: f64 = 45.0 * std::f64::consts::PI / 180.0;
/// Sum of unit vectors across a fold below which no plane halves it.
const FOLDED: f64 = 1e-6;
/// A point nearer to a plane than this part of the size of the surface counts as in it.
const LEVEL: f64 = 1e-10;
/// Bound of the rounding by a file, seven digits in STL, over the size of the surface.
const ROUNDED: f64 = 2e-7;
/// Largest depth of contacts, over the largest extent of particles.
const DEEP: f64 = 1.0 / 3.0;
/// A point this near to a corner or side of a triangle counts as on it, over the size of the triangle.
const AT: f64 = 1e-9;

/// Reason why a surface does not have two sides.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum NoSolid {
    /// A Möbius strip.
    #[error("has only one side, as a Möbius strip, at ({:e}, {:e}, {:e}) m", .0.x, .0.y, .0.z)]
    OneSided(Vec3),
    /// Two triangles on each other.
    #[error("is folded onto itself at ({:e}, {:e}, {:e}) m", .0.x, .0.y, .0.z)]
    Folded(Vec3),
    /// A cylinder or a cone.
    #[error("is not a surface of triangles")]
    Round,
}

/// Data of the volume behind one triangle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Behind {
    /// Sign of the normal of its face towards the front of its part: 1 or -1.
    sign: f64,
    /// Part of the surface to which the triangle belongs.
    part: u32,
    /// Plane that halves the angle at each edge, with its normal out of the cell.
    borders: [Plane; 3],
}

/// Two flats that meet, with their weights seen from the front and from the back.
type Meeting = (u32, u32, [f64; 2]);

/// Volume behind all triangles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Solid {
    behind: Vec<Behind>,
    /// Flat of each face.
    flat_of: Vec<u32>,
    /// In rising order.
    meetings: Vec<Meeting>,
    cells: Cells,
    /// Distance from a plane below which a point counts as in it [m].
    pub(super) level: f64,
    /// Distance from a plane below which a point rounded by a file counts as in it [m].
    pub(super) rounded: f64,
}

impl Solid {
    /// Moves the origin of the axes to this place [m].
    pub(super) fn see_from(&mut self, place: &Vec3) {
        let borders = self.behind.iter_mut().flat_map(|behind| &mut behind.borders);
        for plane in borders.chain(self.cells.planes()) {
            plane.offset -= plane.normal.dot(place);
        }
    }

    /// Memory that it holds [bytes].
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.behind)
            + size_of_val(&*self.flat_of)
            + size_of_val(&*self.meetings)
            + self.cells.bytes()
    }

    fn meeting(&self, one: u32, other: u32) -> Option<&Meeting> {
        let key = (one.min(other), one.max(other));
        let place = self.meetings.binary_search_by_key(&key, |m| (m.0, m.1)).ok()?;
        Some(&self.meetings[place])
    }
}

/// Sign of a triangle, -1 if it is reversed against the first one of its part, and the number of that part.
type Orientation = (f64, u32);

/// A triangle near a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Number of the triangle.
    pub triangle: u32,
    /// Distance from the point [m].
    pub distance: f64,
}

impl TriangleMesh {
    /// Copy with the volume behind the triangles, for particles with faces that reach this far at most [m].
    ///
    /// # Errors
    /// If the surface does not have two sides.
    pub fn with_cells(mut self, farthest: f64) -> Result<Self, NoSolid> {
        self.add_cells(farthest)?;
        Ok(self)
    }

    /// Adds the volume behind the triangles, see [`TriangleMesh::with_cells`].
    ///
    /// # Errors
    /// If the surface does not have two sides; then nothing is added.
    pub fn add_cells(&mut self, farthest: f64) -> Result<(), NoSolid> {
        self.solid = None;
        if !self.facets.strips.is_empty() {
            return Err(NoSolid::Round);
        }
        let mut solid = Solid {
            behind: Vec::with_capacity(self.triangles.len()),
            meetings: Vec::new(),
            cells: Cells::default(),
            flat_of: Vec::new(),
            level: LEVEL * self.reach,
            rounded: ROUNDED * self.reach,
        };
        let (neighbours, parts) = self.neighbours()?;
        solid.flat_of = self.flats(&neighbours, solid.rounded);
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
            solid.behind.push(Behind { sign: *sign, part: *part, borders });
        }
        solid.meetings = self.meetings(&neighbours, &solid);
        self.solid = Some(solid);
        let cells = Making::of(self, &neighbours, DEEP * farthest).cells();
        if let Some(solid) = &mut self.solid {
            solid.cells = cells;
        }
        Ok(())
    }

    /// Whether there are cells behind the triangles.
    pub const fn has_cells(&self) -> bool {
        self.solid.is_some()
    }

    /// Cost of the cells: their number, and the number of times that a triangle was examined for another.
    pub fn cells_made(&self) -> [usize; 2] {
        self.solid.as_ref().map_or([0; 2], |solid| [solid.cells.len(), solid.cells.looked_at])
    }

    /// Finds the triangles nearer to a point than a distance [m], in rising order.
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

    /// Face of a triangle.
    pub fn face_of(&self, triangle: u32) -> u32 {
        self.triangles[triangle as usize].facets[0]
    }

    /// Flat to which a triangle belongs, with the number of its first face.
    ///
    /// A flat consists of faces in one plane within the digits of a file.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn flat_of(&self, triangle: u32) -> u32 {
        self.solid().flat_of[self.face_of(triangle) as usize]
    }

    /// Part of the surface to which a triangle belongs.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn part_of(&self, triangle: u32) -> u32 {
        self.behind(triangle).part
    }

    /// Side of a part of the surface on which a point is, by the nearest of those triangles in `near` that belong to the part.
    ///
    /// Where the nearest point is on an edge or a corner, the mean of the normals there decides, weighted by the angles of triangles (Bærentzen and
    /// Aanæs 2005, DOI 10.1109/TVCG.2005.49).
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

    /// Vertices of a triangle between which a point of it lies: one at a corner, two on a side.
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

    /// Angle of a triangle at one of its corners [rad].
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

    /// Planes of the cells behind a triangle, seen from a side, without that of the triangle.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn cells(
        &self,
        triangle: u32,
        front: Front,
    ) -> impl Iterator<Item = impl Iterator<Item = Plane>> {
        let Behind { borders, .. } = self.behind(triangle);
        let own = self.solid().cells.of(2 * triangle as usize + front.index());
        own.map(|planes| borders.iter().chain(planes).copied())
    }

    /// Planes at the edges of a triangle, with their normals out of its cells.
    pub(super) fn borders(&self, triangle: u32) -> [Plane; 3] {
        self.behind(triangle).borders
    }

    /// Plane of a triangle, with its normal to the side from which it is seen.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn plane_from(&self, triangle: u32, front: Front) -> Plane {
        let Plane { normal, offset } = self.plane(triangle);
        let sign = self.behind(triangle).sign * front.sign();
        Plane { normal: normal * sign, offset: offset * sign }
    }

    /// Degree to which the cells behind two triangles are joined, each seen from a side: from 0 to 1.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn together(&self, one: (u32, Front), other: (u32, Front)) -> f64 {
        let triangles = [one.0, other.0];
        let flats = triangles.map(|t| self.flat_of(t));
        if flats[0] == flats[1] {
            return 1.0;
        }
        let solid = self.solid();
        if let Some((.., weights)) = solid.meeting(flats[0], flats[1]) {
            return weights[one.1.index()];
        }
        let normals = [one, other].map(|(triangle, front)| self.plane_from(triangle, front).normal);
        let corners = triangles.map(|t| self.corners(&self.triangles[t as usize]));
        let over = |k: usize| {
            let above = |corner: &Vec3| (corner - corners[k][0]).dot(&normals[k]);
            corners[1 - k].iter().map(above).fold(f64::NEG_INFINITY, f64::max)
        };
        if over(0) <= solid.rounded && over(1) <= solid.rounded {
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

    /// Whether two flats meet in an edge. If so, all of their cells are joined to the same degree.
    ///
    /// # Panics
    /// If there are no cells.
    pub fn do_meet(&self, one: u32, other: u32) -> bool {
        self.solid().meeting(one, other).is_some()
    }

    pub(super) fn solid(&self) -> &Solid {
        self.solid.as_ref().expect("grains with faces ask for cells first")
    }

    fn behind(&self, triangle: u32) -> &Behind {
        &self.solid().behind[triangle as usize]
    }

    /// Plane of the face of a triangle.
    pub(super) fn plane(&self, triangle: u32) -> Plane {
        self.facets.faces[self.face_of(triangle) as usize]
    }

    /// Begin of a side of a triangle, and the unit vector out of the triangle there, in its plane.
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

    /// Triangle beyond each side of each triangle, with the index of the shared side in it; and the sign and the part of each triangle.
    ///
    /// # Errors
    /// If a part has one side only.
    fn neighbours(&self) -> Result<(Vec<Beyond>, Vec<Orientation>), NoSolid> {
        let sides = sides_of(self.triangles.iter().map(|triangle| triangle.corners));
        let mut neighbours = vec![[None; 3]; self.triangles.len()];
        let join = |neighbours: &mut [Beyond], [one, other]: [&Side; 2]| {
            for (one, other) in [(one, other), (other, one)] {
                neighbours[one.triangle as usize][one.number as usize] =
                    Some((other.triangle, other.number as usize));
            }
        };
        for of in sides.chunk_by(Side::is_same) {
            if let [one, other] = of {
                join(&mut neighbours, [one, other]);
            }
        }
        let parts = self.parts(&neighbours)?;
        let mut across = neighbours.clone();
        for of in sides.chunk_by(Side::is_same).filter(|of| of.len() > 2) {
            for pair in self.pairs_around(of, &parts) {
                join(&mut across, pair);
            }
        }
        // Parts that would have one side only stay apart.
        Ok(match self.parts(&across) {
            Ok(joined) => (across, joined),
            Err(_) => (neighbours, parts),
        })
    }

    /// Pairs of sides that continue in each other, among three or more sides of triangles with the same ends.
    ///
    /// Where all triangles agree on their orientation, sides with a solid between them are paired. Otherwise neighbours around the edge are paired
    /// that belong to one part and have one side of it between them. The remaining sides are paired in order of the least bend, below a right angle.
    fn pairs_around<'a>(&self, of: &'a [Side], parts: &[(f64, u32)]) -> Vec<[&'a Side; 2]> {
        struct Around<'a> {
            side: &'a Side,
            into: Vec3,
            angle: f64,
            part: u32,
            /// Whether the corners run around it seen from beyond; `shows_front`: whether that is the front of its part.
            turns: bool,
            shows_front: bool,
        }
        let [from, to] = of[0].ends.map(|k| self.vertices[k as usize]);
        let along = (to - from).normalize();
        let x = -self.across(of[0].triangle, of[0].number as usize).1;
        let y = along.cross(&x);
        let around = |side: &'a Side| {
            let into = -self.across(side.triangle, side.number as usize).1;
            let [a, b, c] = self.corners(&self.triangles[side.triangle as usize]);
            let (sign, part) = parts[side.triangle as usize];
            let beyond = along.cross(&into);
            let turns = (b - a).cross(&(c - a)).dot(&beyond) > 0.0;
            let shows_front = sign * self.plane(side.triangle).normal.dot(&beyond) > 0.0;
            let angle = libm::atan2(into.dot(&y), into.dot(&x));
            Around { side, into, angle, part, turns, shows_front }
        };
        let mut around: Vec<Around> = of.iter().map(around).collect();
        around.sort_by(|one, other| one.angle.total_cmp(&other.angle));
        let next = |k: usize| (k + 1) % around.len();
        let agree = (0..around.len()).all(|k| around[k].turns != around[next(k)].turns);
        let is_between = |k: usize| {
            let [one, other] = [&around[k], &around[next(k)]];
            if agree {
                !one.turns
            } else {
                one.part == other.part && one.shows_front != other.shows_front
            }
        };
        let beside = (0..around.len()).filter(|&k| is_between(k)).map(|k| [k, next(k)]);
        let bend = |&[k, l]: &[usize; 2]| around[k].into.dot(&around[l].into);
        let all = (0..around.len()).flat_map(|k| (0..k).map(move |l| [l, k]));
        let mut flat: Vec<[usize; 2]> = all.filter(|pair| bend(pair) < 0.0).collect();
        flat.sort_by(|one, other| bend(one).total_cmp(&bend(other)));
        let mut pairs: Vec<[usize; 2]> = Vec::new();
        for pair in beside.chain(flat) {
            if !pairs.iter().flatten().any(|k| pair.contains(k)) {
                pairs.push(pair);
            }
        }
        pairs.into_iter().map(|pair| pair.map(|k| around[k].side)).collect()
    }

    /// Sign of each triangle, and the part to which it belongs.
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
                    // Seen from the front, the outward vector turned by a quarter about the edge is the normal. In the next triangle it is the normal
                    // to the other side.
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

    /// Flat of each face: neighbours of its first face, directly or through others, that are in its plane within this distance [m].
    fn flats(&self, neighbours: &[Beyond], rounded: f64) -> Vec<u32> {
        let mut flat_of = vec![NONE; self.facets.faces.len()];
        let mut is_known = vec![false; self.triangles.len()];
        let mut first = flat_of.clone();
        for triangle in (0..self.triangles.len() as u32).rev() {
            first[self.face_of(triangle) as usize] = triangle;
        }
        for (flat, (plane, first)) in (0..).zip(self.facets.faces.iter().zip(first)) {
            if flat_of[flat as usize] != NONE {
                continue;
            }
            flat_of[flat as usize] = flat;
            let off = |&k: &u32| self.vertices[k as usize].dot(&plane.normal) - plane.offset;
            let is_in = |face| {
                self.facets.vertices_of(face).iter().all(|vertex| off(vertex).abs() <= rounded)
            };
            let mut next = vec![first];
            while let Some(triangle) = next.pop() {
                for &(other, _) in neighbours[triangle as usize].iter().flatten() {
                    let face = self.face_of(other);
                    if flat_of[face as usize] == NONE && is_in(face) {
                        flat_of[face as usize] = flat;
                    }
                    if flat_of[face as usize] == flat
                        && !std::mem::replace(&mut is_known[other as usize], true)
                    {
                        next.push(other);
                    }
                }
            }
        }
        flat_of
    }

    /// Flats that meet in edges.
    fn meetings(&self, neighbours: &[Beyond], solid: &Solid) -> Vec<Meeting> {
        let mut meetings: Vec<Meeting> = Vec::new();
        for (triangle, beyond) in (0..).zip(neighbours) {
            for &(other, side) in beyond.iter().flatten() {
                let [one, two] =
                    [triangle, other].map(|of| solid.flat_of[self.face_of(of) as usize]);
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
        // Where two flats share several edges, the least weight counts.
        meetings.dedup_by(|again, first| {
            let is_same = (again.0, again.1) == (first.0, first.1);
            if is_same {
                first.2 = [0, 1].map(|k| first.2[k].min(again.2[k]));
            }
            is_same
        });
        meetings
    }
}

/// Weight of an angle: 1 for small angles, 0 for large ones.
fn weight(angle: f64) -> f64 {
    let x = ((APART - angle) / (APART - ONE)).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

fn angle_between(one: &Vec3, other: &Vec3) -> f64 {
    libm::atan2(one.cross(other).norm(), one.dot(other))
}

/// Shortest vector from a triangle to another that does not intersect it [m].
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

/// Vector between the nearest points of two lines if these lie within both segments, else between the first ends.
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
