//! Construction of the cells behind triangles ([`super::solid`]).
//!
//! Behind a triangle lies a frustum: below its plane, within the planes at its edges, as deep as contacts can be. Most frusta are one cell.
//! Others are cut:
//!
//! 1. Where a back is near, its shadow is divided from the rest of the frustum and ends halfway. For triangles that are small beside
//!    particles, and for backs at an even distance, the whole frustum ends at half of the least distance.
//! 2. Where the frustum extends through a convex edge that the triangle does not have itself, it is cut by the plane that halves the angle
//!    there.
//! 3. Where another part enters what is left, with the triangle on one side of it, the cell ends halfway.
//! 4. Where a triangle of its own part enters what is left, that is cut by the plane of this triangle. Only the pieces behind the part remain,
//!    so no cell extends out of a closed surface.
//!
//! Faces in one plane within the digits of a file are one *flat*, with one set of cuts.

use super::TriangleMesh;
use super::nearest::{is_over, nearest_on};
use crate::math::{Vec3, bounds};
use crate::shape::clip::{Clipped, cube};
use crate::shape::facets::Plane;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};

/// Triangle beyond each side of a triangle, with the index of the shared side in it.
pub(super) type Beyond = [Option<(u32, usize)>; 3];

/// A side of a surface: its front, or its back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Front {
    /// The side of the normal of the first triangle of the part.
    Front,
    /// The opposite side.
    Back,
}

impl Front {
    pub(super) const fn index(self) -> usize {
        self as usize
    }

    pub(super) const fn sign(self) -> f64 {
        match self {
            Self::Front => 1.0,
            Self::Back => -1.0,
        }
    }
}

/// Cosine above which the normals of faces are so near that cells are cut only by their own edges.
const BENT: f64 = 0.9999;
/// A cell that more faces enter is cut only by its own edges.
const MOST: usize = 64;
/// Distance beside a face within which a point still counts as over it, over the size of the surface.
const OVER: f64 = 1e-6;
/// Cosine of the largest angle between a normal and the opposite one for which a surface is the back of a plate.
const BACK: f64 = 0.5;
/// A cell down to halfway to a back is deep enough beyond this part of the depth of contacts.
const ENOUGH: f64 = 0.5;
/// Frusta narrower than this part of that depth end at one depth.
const SMALL: f64 = 0.125;
/// Backs are at an even distance if their distances differ by less than this factor.
const EVEN: f64 = 1.1;
/// Part of a frustum that the shadows of such backs must cover.
const COVERED: f64 = 0.999;
/// A frustum with more backs than this is halved first.
const FEW: usize = 8;
/// Largest number of cuts of a frustum.
const CUTS: usize = 64;
/// Largest extent of a frustum beside its triangle, over its depth.
const WIDEST: f64 = 64.0;

/// Further planes of cells, one cell after the other.
///
/// The cells of one triangle are consecutive, first those seen from its front, then those from its back.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Cells {
    planes: Vec<Plane>,
    /// Index of the first plane of each cell.
    first_plane: Vec<u32>,
    /// Index of the first cell of each side of each triangle.
    first_cell: Vec<u32>,
    /// Number of times that a triangle was examined for another.
    pub(super) looked_at: usize,
}

impl Default for Cells {
    fn default() -> Self {
        Self { planes: Vec::new(), first_plane: vec![0], first_cell: vec![0], looked_at: 0 }
    }
}

impl Cells {
    fn push(&mut self, cells: &[Vec<Plane>]) {
        for planes in cells {
            self.planes.extend(planes);
            self.first_plane.push(self.planes.len() as u32);
        }
        self.first_cell.push(self.first_plane.len() as u32 - 1);
    }

    /// Planes of each cell of a side with this number.
    pub(super) fn of(&self, side: usize) -> impl Iterator<Item = &[Plane]> {
        let cells = self.first_cell[side] as usize..=self.first_cell[side + 1] as usize;
        let range = |ends: &[u32]| &self.planes[ends[0] as usize..ends[1] as usize];
        self.first_plane[cells].windows(2).map(range)
    }

    /// Number of cells.
    pub(super) const fn len(&self) -> usize {
        self.first_plane.len() - 1
    }

    /// All planes.
    pub(super) fn planes(&mut self) -> impl Iterator<Item = &mut Plane> {
        self.planes.iter_mut()
    }

    /// Memory that they hold [bytes].
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.planes)
            + size_of_val(&*self.first_plane)
            + size_of_val(&*self.first_cell)
    }
}

/// A side of a triangle, behind which cells are constructed.
struct CellSide {
    triangle: u32,
    front: Front,
    own: Plane,
    /// Planes at its edges.
    borders: [Plane; 3],
    corners: [Vec3; 3],
    middle: Vec3,
    /// Diagonal of its bounding box [m].
    size: f64,
}

impl CellSide {
    /// Plane at the end of a frustum of this depth [m].
    fn bottom(&self, depth: f64) -> Plane {
        Plane { normal: -self.own.normal, offset: depth - self.own.offset }
    }

    /// Part of a polygon within the planes at the edges and the given ones.
    fn within(&self, polygon: &[Vec3], planes: &[Plane]) -> Vec<Vec3> {
        let all = self.borders.iter().chain(planes);
        all.fold(polygon.to_vec(), |polygon, plane| below(&polygon, plane))
    }

    /// A plane relative to the middle.
    fn place(&self, plane: &Plane) -> Plane {
        Plane { offset: plane.offset - plane.normal.dot(&self.middle), ..*plane }
    }
}

/// A triangle behind another.
#[derive(Clone)]
struct Back {
    triangle: u32,
    /// Half-space of the points nearer to the triangle in front.
    halfway: Plane,
    /// Part of the triangle that is under the triangle in front.
    polygon: Vec<Vec3>,
    /// Least and greatest half of the distance [m].
    half: [f64; 2],
}

/// A part of a frustum.
struct Part {
    /// Its planes, without those of the frustum.
    planes: Vec<Plane>,
    /// Part of the triangle over it.
    foot: Vec<Vec3>,
    backs: Vec<Back>,
}

/// Construction of all cells of a surface.
pub(super) struct Making<'a> {
    mesh: &'a TriangleMesh,
    neighbours: &'a [Beyond],
    /// Largest depth of contacts [m].
    deep: f64,
    /// A triangle of the second flat, for each two flats that meet.
    ridges: BTreeMap<(u32, u32), u32>,
    /// The box around each flat [m].
    boxes: Vec<[Vec3; 2]>,
    looked_at: usize,
}

impl<'a> Making<'a> {
    /// Construction for a surface whose parts and borders are known.
    pub(super) fn of(mesh: &'a TriangleMesh, neighbours: &'a [Beyond], deep: f64) -> Self {
        let empty = [Vec3::repeat(f64::INFINITY), Vec3::repeat(f64::NEG_INFINITY)];
        let mut boxes = vec![empty; mesh.facets.faces.len()];
        let mut ridges = BTreeMap::new();
        for (triangle, beyond) in (0..).zip(neighbours) {
            let flat = mesh.flat_of(triangle);
            let (low, high) = bounds(&mesh.corners(&mesh.triangles[triangle as usize]));
            let [lowest, highest] = &mut boxes[flat as usize];
            (*lowest, *highest) = (lowest.inf(&low), highest.sup(&high));
            for &(other, _) in beyond.iter().flatten() {
                let second = mesh.flat_of(other);
                if flat != second {
                    ridges.entry((flat, second)).or_insert(other);
                }
            }
        }
        Self { mesh, neighbours, deep, ridges, boxes, looked_at: 0 }
    }

    /// All cells.
    pub(super) fn cells(mut self) -> Cells {
        let mut cells = Cells::default();
        for triangle in 0..self.mesh.triangles.len() as u32 {
            for front in [Front::Front, Front::Back] {
                cells.push(&self.behind(triangle, front));
            }
        }
        cells.looked_at = self.looked_at;
        cells
    }

    /// Largest rounding by files [m].
    fn rounded(&self) -> f64 {
        self.mesh.solid().rounded
    }

    fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.mesh.corners(&self.mesh.triangles[triangle as usize])
    }

    /// Further planes of the cells behind a triangle.
    fn behind(&mut self, triangle: u32, front: Front) -> Vec<Vec<Plane>> {
        let corners = self.corners(triangle);
        let (low, high) = bounds(&corners);
        let seat = CellSide {
            triangle,
            front,
            own: self.mesh.plane_from(triangle, front),
            borders: self.mesh.borders(triangle),
            corners,
            middle: (corners[0] + corners[1] + corners[2]) / 3.0,
            size: (high - low).norm(),
        };
        let Some(whole) = self.body(&seat, &[seat.bottom(2.0 * self.deep)]) else {
            return Vec::new();
        };
        let vertices = whole.left().iter().map(|&k| whole.vertices()[k as usize] + seat.middle);
        let around: Vec<Vec3> = vertices.collect();
        let around = bounds(&around);
        let near = self.near(&seat, around);
        let beyond = self.beyond(&seat, around);
        let mut cells = Vec::new();
        for mut planes in self.by_backs(&seat, &[], &near, &beyond) {
            let (left, cuts) = self.cuts_by(&seat, &planes, &beyond);
            let again = if left.len() == beyond.len() {
                vec![planes]
            } else {
                // A flat that cuts nothing may be a back.
                self.by_backs(&seat, &planes.split_off(1), &near, &left)
            };
            for mut planes in again {
                planes.extend(&cuts);
                self.keep_behind(&seat, planes, &near, &mut cells);
            }
        }
        cells
    }

    /// The frustum within the given planes as well, relative to the middle.
    fn body(&self, seat: &CellSide, planes: &[Plane]) -> Option<Clipped> {
        let mut body = Clipped::default();
        body.begin(&cube(2.0 * seat.size + WIDEST * self.deep));
        let all = [&seat.own].into_iter().chain(&seat.borders).chain(planes);
        all.map(|plane| seat.place(plane)).all(|plane| body.cut(&plane)).then_some(body)
    }

    /// Triangles of other flats in a box that may enter a frustum of twice the depth, in rising order.
    fn near(&mut self, seat: &CellSide, (low, high): (Vec3, Vec3)) -> Vec<u32> {
        let level = self.mesh.solid().level;
        let flat = self.mesh.flat_of(seat.triangle);
        let mut near = Vec::new();
        self.mesh.grid.for_each_in(&low, &high, |other| near.push(other));
        near.sort_unstable();
        near.dedup();
        self.looked_at += near.len();
        near.retain(|&other| {
            let corners = self.corners(other);
            let is_beyond = |plane: &Plane, level: f64| {
                corners.iter().all(|corner| corner.dot(&plane.normal) - plane.offset >= level)
            };
            self.mesh.flat_of(other) != flat
                && !is_beyond(&seat.own, -level)
                && !is_beyond(&seat.bottom(2.0 * self.deep), 0.0)
                && !seat.borders.iter().any(|border| is_beyond(border, -level))
        });
        near
    }

    /// Flats around a box that meet that of a triangle in convex edges and have it behind their planes, in rising order.
    fn beyond(&self, seat: &CellSide, (low, high): (Vec3, Vec3)) -> Vec<(u32, Plane)> {
        let own = self.mesh.flat_of(seat.triangle);
        let reach = Vec3::repeat(self.deep);
        let (low, high) = (low - reach, high + reach);
        let is_near = |&(&(_, flat), _): &(&(u32, u32), &u32)| {
            let [lowest, highest] = &self.boxes[flat as usize];
            (0..3).all(|axis| lowest[axis] <= high[axis] && highest[axis] >= low[axis])
        };
        let is_convex = |(flat, other): (u32, u32)| {
            // A flat may have several faces: that at the triangle's own edge, whose plane the frustum has, is taken first.
            let at_edge = self.neighbours[seat.triangle as usize].iter().flatten();
            let other =
                at_edge.map(|of| of.0).find(|&of| self.mesh.flat_of(of) == flat).unwrap_or(other);
            let plane = self.mesh.plane_from(other, seat.front);
            let is_convex = seat.own.normal.dot(&plane.normal) <= BENT
                && self.lies_below(seat.triangle, &plane)
                && self.lies_below(other, &seat.own);
            is_convex.then_some((flat, plane))
        };
        let all = self.ridges.range((own, 0)..=(own, u32::MAX)).filter(is_near);
        all.filter_map(|(&(_, flat), &other)| is_convex((flat, other))).collect()
    }

    /// Whether a triangle lies behind a plane, or in it.
    fn lies_below(&self, triangle: u32, plane: &Plane) -> bool {
        let height = |corner: &Vec3| corner.dot(&plane.normal) - plane.offset;
        self.corners(triangle).iter().all(|corner| height(corner) <= self.rounded())
    }

    /// Parts of the frustum within these planes, each of which ends halfway to its backs, without the flats of `but`.
    ///
    /// Each part is given by its planes, of which the first is its end.
    fn by_backs(
        &self,
        seat: &CellSide,
        planes: &[Plane],
        near: &[u32],
        but: &[(u32, Plane)],
    ) -> Vec<Vec<Plane>> {
        let backs = near.iter().filter_map(|&other| self.back(seat, other, planes, but)).collect();
        let foot = seat.within(&seat.corners, planes);
        let mut parts = VecDeque::from([Part { planes: planes.to_vec(), foot, backs }]);
        let mut done = Vec::new();
        let mut cuts = 0;
        while let Some(mut part) = parts.pop_front() {
            let half = part.backs.iter().map(|back| back.half[0]).fold(self.deep, f64::min);
            let (along, width) = extent(&part.foot, &seat.own.normal);
            let is_whole = half >= ENOUGH * self.deep
                || width <= SMALL * self.deep
                || cuts >= CUTS
                || self.is_even(seat, &part, half);
            if is_whole {
                part.planes.insert(0, seat.bottom(half));
                done.push(part.planes);
            } else if part.backs.len() > FEW {
                let middle = Plane { normal: along.0, offset: along.1 };
                let other = part.beyond(&middle);
                part.cut(&middle);
                parts.extend([part, other]);
                cuts += 1;
            } else {
                cuts += self.divide(seat, part, &mut parts);
            }
        }
        done
    }

    /// Divides the shadow of the nearest back from the rest of a part. Returns the number of new parts.
    fn divide(&self, seat: &CellSide, mut part: Part, parts: &mut VecDeque<Part>) -> usize {
        let nearer = |one: &(usize, &Back), other: &(usize, &Back)| {
            one.1.half[0].total_cmp(&other.1.half[0])
        };
        let nearest = part.backs.iter().enumerate().min_by(nearer).map_or(0, |(k, _)| k);
        let Back { triangle, halfway, .. } = part.backs.remove(nearest);
        let [a, b, c] = self.corners(triangle);
        let mut count = 1;
        for (from, to, third) in [(a, b, c), (b, c, a), (c, a, b)] {
            let across = (to - from).cross(&seat.own.normal).normalize();
            let normal = if (third - from).dot(&across) > 0.0 { -across } else { across };
            let side = Plane { normal, offset: normal.dot(&from) };
            let is_beyond = |p: &Vec3| p.dot(&side.normal) - side.offset > self.rounded();
            if part.foot.iter().any(is_beyond) {
                parts.push_back(part.beyond(&side));
                part.cut(&side);
                count += 1;
            }
        }
        part.cut(&halfway);
        parts.push_back(part);
        count
    }

    /// A triangle as a back of the seat, if it is one.
    fn back(
        &self,
        seat: &CellSide,
        other: u32,
        planes: &[Plane],
        but: &[(u32, Plane)],
    ) -> Option<Back> {
        let Self { mesh, .. } = self;
        let [own, of] = [seat.triangle, other].map(|t| mesh.triangles[t as usize].corners);
        let is_left_out =
            but.binary_search_by_key(&self.mesh.flat_of(other), |(flat, _)| *flat).is_ok()
                || of.iter().any(|k| own.contains(k));
        if is_left_out {
            return None;
        }
        let mut plane = mesh.plane_from(other, seat.front);
        if mesh.part_of(other) != mesh.part_of(seat.triangle)
            && plane.normal.dot(&seat.own.normal) > 0.0
        {
            plane = Plane { normal: -plane.normal, offset: -plane.offset };
        }
        if plane.normal.dot(&seat.own.normal) >= -BACK {
            return None;
        }
        let polygon = seat.within(&self.corners(other), planes);
        let heights = || polygon.iter().map(|p| p.dot(&seat.own.normal) - seat.own.offset);
        // A triangle that passes through the plane is not a back.
        let is_back = !polygon.is_empty() && heights().all(|h| h < -mesh.solid().level);
        let half = [f64::min, f64::max].map(|of| heights().map(|h| -0.5 * h).reduce(of));
        let half = [half[0]?, half[1]?];
        (is_back && half[0] < self.deep).then(|| {
            let halfway = nearer(&plane, &seat.own);
            Back { triangle: other, halfway, polygon, half }
        })
    }

    /// Whether backs cover a part almost everywhere at about twice the distance `half` of the nearest one [m].
    fn is_even(&self, seat: &CellSide, part: &Part, half: f64) -> bool {
        let Plane { normal, offset } = seat.own;
        let [x, y] = across(&normal);
        let size = 2.0 * seat.size + WIDEST * self.deep;
        let middle = seat.middle - normal * (seat.middle.dot(&normal) - offset + 2.0 * half);
        let square = [x + y, y - x, -x - y, x - y].map(|way| middle + way * size);
        let section = area(&seat.within(&square, &part.planes), &normal);
        let even = part.backs.iter().filter(|back| back.half[1] <= EVEN * half);
        even.map(|back| area(&back.polygon, &normal)).sum::<f64>() >= COVERED * section
    }

    /// Flats of `beyond` that enter the frustum within these planes, and the planes that halve the angles there.
    ///
    /// The part that is cut off is over these flats, so it belongs to the cells behind them.
    fn cuts_by(
        &self,
        seat: &CellSide,
        planes: &[Plane],
        beyond: &[(u32, Plane)],
    ) -> (Vec<(u32, Plane)>, Vec<Plane>) {
        if beyond.is_empty() {
            return Default::default();
        }
        let Some(whole) = self.body(seat, planes) else { return Default::default() };
        let level = self.mesh.solid().level;
        let comes_in = |cell: &Clipped, cut: &Plane| {
            let height = |&k: &u32| cell.vertices()[k as usize].dot(&cut.normal) - cut.offset;
            cell.left().iter().any(|k| height(k) > level)
        };
        let cut_by = |plane: &Plane| seat.place(&nearer(plane, &seat.own));
        let mut left: Vec<(u32, Plane)> = beyond.to_vec();
        left.retain(|(_, plane)| comes_in(&whole, &cut_by(plane)));
        if left.len() > MOST {
            return Default::default();
        }
        // A volume that a removed flat does not own may belong to none, so those that are left are examined again.
        loop {
            let owns = |&(flat, plane): &(u32, Plane)| {
                let others = left.iter().filter(|(other, _)| *other != flat);
                let nearest = others.map(|(_, other)| nearer(other, &plane));
                let limits = [nearer(&seat.own, &plane), plane].into_iter().chain(nearest);
                let mut off = whole.clone();
                let is_there = limits.map(|limit| seat.place(&limit)).all(|limit| off.cut(&limit));
                !is_there || self.stands_over(flat, &plane, &off, &seat.middle)
            };
            let owned: Vec<(u32, Plane)> = left.iter().copied().filter(owns).collect();
            if owned.len() == left.len() {
                break;
            }
            left = owned;
        }
        // Only planes that cut off what the previous ones leave.
        let mut cell = whole;
        let cuts = left.iter().filter(|(_, plane)| {
            let cut = cut_by(plane);
            comes_in(&cell, &cut) && cell.cut(&cut)
        });
        let planes = cuts.map(|(_, plane)| nearer(plane, &seat.own)).collect();
        (left, planes)
    }

    /// Whether a body relative to a place is over a flat, by its vertices and points between them.
    fn stands_over(&self, flat: u32, plane: &Plane, body: &Clipped, place: &Vec3) -> bool {
        let tolerance = OVER * self.mesh.reach;
        let is_over_it = |point: &Vec3| {
            let point = point + place;
            let foot = point - plane.normal * (point.dot(&plane.normal) - plane.offset);
            let reach = Vec3::repeat(tolerance.max(self.rounded()));
            let mut found = false;
            self.mesh.grid.for_each_in(&(foot - reach), &(foot + reach), |triangle| {
                found = found
                    || self.mesh.flat_of(triangle) == flat
                        && is_over(&self.corners(triangle), &foot, tolerance);
            });
            found
        };
        let vertices: Vec<Vec3> =
            body.left().iter().map(|&k| body.vertices()[k as usize]).collect();
        vertices.iter().enumerate().all(|(k, one)| {
            let between = |other: &Vec3| {
                [0.25, 0.5, 0.75].iter().all(|part| is_over_it(&(one + (other - one) * *part)))
            };
            is_over_it(one) && vertices[..k].iter().all(between)
        })
    }

    /// Adds a cell. Where triangles of its own part enter it, it is cut into pieces, and those in front of the part are dropped.
    fn keep_behind(
        &self,
        seat: &CellSide,
        mut planes: Vec<Plane>,
        near: &[u32],
        cells: &mut Vec<Vec<Plane>>,
    ) {
        let part = self.mesh.part_of(seat.triangle);
        let is_own = |other: &u32| self.mesh.part_of(*other) == part;
        let (of_part, of_others): (Vec<u32>, Vec<u32>) = near.iter().copied().partition(is_own);
        for other in of_others {
            if let Some(halfway) = self.halfway(seat, other)
                && self.comes_in(seat, other, &planes)
            {
                planes.push(halfway);
            }
        }
        let mut pieces = vec![(planes, of_part)];
        let mut cuts = 0;
        while let Some((planes, mut inside)) = pieces.pop() {
            inside.retain(|&other| self.comes_in(seat, other, &planes));
            let Some(other) = inside.pop() else {
                if cuts == 0 || self.is_behind(seat, &planes) {
                    cells.push(planes);
                }
                continue;
            };
            let behind = self.mesh.plane_from(other, seat.front);
            let before = Plane { normal: -behind.normal, offset: -behind.offset };
            let sides = if cuts < CUTS { &[before, behind][..] } else { &[behind] };
            for side in sides {
                pieces.push(([&*planes, &[*side]].concat(), inside.clone()));
            }
            cuts += 1;
        }
    }

    /// Plane halfway to a triangle of another part, if the triangle of the seat lies on one side of its plane.
    fn halfway(&self, seat: &CellSide, other: u32) -> Option<Plane> {
        let plane = self.mesh.plane_from(other, Front::Front);
        let back = Plane { normal: -plane.normal, offset: -plane.offset };
        let plane =
            [plane, back].into_iter().find(|plane| self.lies_below(seat.triangle, plane))?;
        (plane.normal.dot(&seat.own.normal) <= BENT).then(|| nearer(&plane, &seat.own))
    }

    /// Whether a triangle enters the frustum within these planes by more than the rounding of files.
    fn comes_in(&self, seat: &CellSide, other: u32, planes: &[Plane]) -> bool {
        let all = [&seat.own].into_iter().chain(&seat.borders).chain(planes);
        let mut polygon = self.corners(other).to_vec();
        for Plane { normal, offset } in all {
            polygon = below(&polygon, &Plane { normal: *normal, offset: offset - self.rounded() });
        }
        !polygon.is_empty()
    }

    /// Whether the middle of the frustum within these planes is behind the part.
    fn is_behind(&self, seat: &CellSide, planes: &[Plane]) -> bool {
        let Some(body) = self.body(seat, planes) else { return false };
        let vertices = body.left().iter().map(|&k| body.vertices()[k as usize]);
        let middle = vertices.sum::<Vec3>() / body.left().len() as f64 + seat.middle;
        let distance = (nearest_on(&seat.corners, &middle) - middle).norm();
        let mut near = Vec::new();
        self.mesh.triangles_near(&middle, distance + self.rounded(), &mut near);
        let part = self.mesh.part_of(seat.triangle);
        self.mesh.side_of(part, &middle, &near) != seat.front
    }
}

impl Part {
    /// Keeps the part behind a plane.
    fn cut(&mut self, plane: &Plane) {
        self.planes.push(*plane);
        self.foot = below(&self.foot, plane);
        for back in &mut self.backs {
            back.polygon = below(&back.polygon, plane);
        }
        let has_area = |back: &Back| {
            let largest = back.polygon.iter().map(|p| (p - back.polygon[0]).norm_squared());
            area_of(&back.polygon).norm() > 1e-9 * largest.fold(0.0, f64::max)
        };
        self.backs.retain(has_area);
    }

    /// Part beyond a plane.
    fn beyond(&self, plane: &Plane) -> Self {
        let Self { planes, foot, backs } = self;
        let mut part = Self { planes: planes.clone(), foot: foot.clone(), backs: backs.clone() };
        part.cut(&Plane { normal: -plane.normal, offset: -plane.offset });
        part
    }
}

/// Half-space of the points nearer to the second of two planes than to the first, behind both.
fn nearer(first: &Plane, second: &Plane) -> Plane {
    let across = first.normal - second.normal;
    let length = across.norm();
    Plane { normal: across / length, offset: (first.offset - second.offset) / length }
}

/// Part of a convex polygon below a plane.
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

/// Two unit vectors at right angles to a third and each other.
fn across(normal: &Vec3) -> [Vec3; 2] {
    let one = Vec3::ith(normal.iamin(), 1.0).cross(normal).normalize();
    [one, normal.cross(&one)]
}

/// Twice the area of a polygon, along its normal [m²].
fn area_of(polygon: &[Vec3]) -> Vec3 {
    let fan = |pair: &[Vec3]| (pair[0] - polygon[0]).cross(&(pair[1] - polygon[0]));
    polygon.windows(2).map(fan).sum()
}

/// Twice the area of a polygon's shadow along a unit vector [m²].
fn area(polygon: &[Vec3], along: &Vec3) -> f64 {
    area_of(polygon).dot(along).abs()
}

/// Plane across the middle of a polygon along its longer extent, and that extent [m].
fn extent(polygon: &[Vec3], normal: &Vec3) -> ((Vec3, f64), f64) {
    let longer = across(normal).map(|way| {
        let places = || polygon.iter().map(|p| p.dot(&way));
        let low = places().fold(f64::INFINITY, f64::min);
        let high = places().fold(f64::NEG_INFINITY, f64::max);
        ((way, 0.5 * (low + high)), high - low)
    });
    let [one, other] = longer;
    if one.1 >= other.1 { one } else { other }
}
