//! Construction of facets from triangles.

use super::facets::{Edge, Facets};
use super::grid::Grid;
use super::{COPLANAR, Findings, NONE, Strip, Triangle, TriangleMesh};
use crate::math::{Vec3, bounds};
use crate::shape::facets::Plane;
use std::collections::HashMap;

/// Twice the area over the squared longest side below which a triangle is degenerate.
const SLIVER: f64 = 1e-9;
/// An edge with a smaller opening has no directions [rad].
const LEAST_OPENING: f64 = 1e-10;

/// A side of a triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Side {
    /// Vertices, the lower first.
    pub(super) ends: [u32; 2],
    pub(super) triangle: u32,
    /// Index of the side in the triangle.
    pub(super) number: u32,
    /// Whether the triangle has the lower vertex first.
    rises: bool,
}

impl Side {
    pub(super) fn is_same(&self, other: &Self) -> bool {
        self.ends == other.ends
    }
}

/// Sides of triangles, sorted so that sides with the same ends are consecutive.
pub(super) fn sides_of(triangles: impl Iterator<Item = [u32; 3]>) -> Vec<Side> {
    let mut sides = Vec::new();
    for (corners, triangle) in triangles.zip(0..) {
        for number in 0..3 {
            let (from, to) = (corners[number], corners[(number + 1) % 3]);
            let ends = [from.min(to), from.max(to)];
            sides.push(Side { ends, triangle, number: number as u32, rises: from < to });
        }
    }
    sides.sort_unstable();
    sides
}

/// A surface under construction.
#[derive(Default)]
pub(super) struct Building {
    pub(super) vertices: Vec<Vec3>,
    pub(super) corners: Vec<[u32; 3]>,
    /// Sides of the triangles, see [`sides_of`].
    pub(super) sides: Vec<Side>,
    pub(super) of_triangle: Vec<[u32; 4]>,
    facets: Facets,
    size: f64,
    /// Distance below which corners are merged, or count as in a side [m].
    pub(super) near: f64,
    /// Number of triangles that are not images.
    pub(super) own: usize,
}

impl Building {
    /// Replaces the triangles; the first `own` are not images.
    pub(super) fn take(&mut self, corners: Vec<[u32; 3]>, own: usize) {
        self.of_triangle = vec![[NONE; 4]; corners.len()];
        (self.corners, self.own) = (corners, own);
    }

    /// The finished surface. Contacts with normals that differ by less than an angle count once [rad].
    pub(super) fn finished(self, smooth: f64) -> TriangleMesh {
        let Self { vertices, corners, of_triangle, facets, own, .. } = self;
        let (low, high) = bounds(&vertices);
        let triangle = |(&corners, facets): (&[u32; 3], [u32; 4])| Triangle { corners, facets };
        TriangleMesh {
            triangles: corners.iter().zip(of_triangle).map(triangle).collect(),
            own,
            facets,
            grid: Grid::of(&vertices, &corners),
            solid: None,
            bulge: 0.0,
            smooth: libm::cos(smooth),
            reach: vertices.iter().map(Vec3::norm).fold(0.0, f64::max),
            bounds: [low, high],
            findings: Findings::default(),
            checksum: checksum(&vertices, &corners),
            vertices,
        }
    }

    pub(super) fn vertex(&self, k: u32) -> Vec3 {
        self.vertices[k as usize]
    }

    /// Twice the area, along the normal.
    fn area(&self, triangle: usize) -> Vec3 {
        let [a, b, c] = self.corners[triangle].map(|k| self.vertex(k));
        (b - a).cross(&(c - a))
    }

    /// Adds a strip between vertices, as two triangles unless they have no area.
    pub(super) fn push_strip(&mut self, strip: Strip, ends: [u32; 4], is_there: [bool; 2]) {
        let number = self.facets.len() as u32;
        let mut vertices = ends;
        vertices.sort_unstable();
        self.facets.push_strip(strip, &vertices);
        let [a, b, c, d] = ends;
        let pair = [[a, b, d], [a, d, c]];
        for (corners, _) in pair.into_iter().zip(is_there).filter(|(_, is_there)| *is_there) {
            self.corners.push(corners);
            self.of_triangle.push([number, NONE, NONE, NONE]);
        }
    }

    /// Adds the rims of strips, first all of one end.
    pub(super) fn find_rims(&mut self) {
        for end in 0..2 {
            for (of, corners) in self.of_triangle.iter_mut().zip(&self.corners) {
                for (number, &from) in corners.iter().enumerate() {
                    let to = corners[(number + 1) % 3];
                    // Vertices of both ends alternate.
                    if from % 2 == end && to % 2 == end {
                        let ends = [from.min(to), from.max(to)];
                        of[1 + number] = self.facets.push_edge(Edge { ends, ..Edge::default() });
                    }
                }
            }
        }
    }

    pub(super) fn find_sides(&mut self, findings: &mut Findings) {
        self.sides = sides_of(self.corners.iter().copied());
        let is_own = |of: &&[Side]| of.iter().any(|side| (side.triangle as usize) < self.own);
        for of in self.sides.chunk_by(Side::is_same).filter(is_own) {
            match of {
                [_] => findings.open_edges += 1,
                [one, other] => findings.turned_edges += usize::from(one.rises == other.rises),
                _ => findings.crowded_edges += 1,
            }
        }
    }

    /// Grows faces from large triangles to their neighbours in the same plane.
    pub(super) fn find_faces(&mut self) {
        // Index of the first side with the same ends, for each side of a triangle.
        let mut sides_at = vec![[0_u32; 3]; self.corners.len()];
        let mut begin = 0;
        for of in self.sides.chunk_by(Side::is_same) {
            for side in of {
                sides_at[side.triangle as usize][side.number as usize] = begin;
            }
            begin += of.len() as u32;
        }
        let mut order: Vec<usize> = (0..self.corners.len()).collect();
        let areas: Vec<f64> = order.iter().map(|&k| self.area(k).norm_squared()).collect();
        order.sort_by(|&a, &b| areas[b].total_cmp(&areas[a]));
        for seed in order {
            if self.of_triangle[seed][0] != NONE {
                continue;
            }
            let face = self.facets.len() as u32;
            let normal = self.area(seed).normalize();
            let offset = self.vertex(self.corners[seed][0]).dot(&normal);
            let (mut areas, mut vertices, mut next) = (Vec::new(), Vec::new(), vec![seed as u32]);
            self.of_triangle[seed][0] = face;
            while let Some(triangle) = next.pop() {
                let own = self.area(triangle as usize);
                areas.push(own * own.dot(&normal).signum());
                vertices.extend(self.corners[triangle as usize]);
                let beside = sides_at[triangle as usize].iter().flat_map(|&begin| {
                    let sides = &self.sides[begin as usize..];
                    sides.iter().take_while(|side| side.is_same(&sides[0]))
                });
                for neighbour in beside.map(|side| side.triangle) {
                    let corners = self.corners[neighbour as usize].map(|k| self.vertex(k));
                    let off = |corner: &Vec3| (corner.dot(&normal) - offset).abs();
                    let of = &mut self.of_triangle[neighbour as usize][0];
                    if *of == NONE && corners.iter().all(|c| off(c) <= COPLANAR * self.size) {
                        *of = face;
                        next.push(neighbour);
                    }
                }
            }
            // From all triangles of the face, so that it is exact where one of them is narrow.
            let normal = snapped(&sum(&areas));
            vertices.sort_unstable();
            vertices.dedup();
            let heights = vertices.iter().map(|&k| self.vertex(k).dot(&normal));
            let (low, high) =
                heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            self.facets.push_face(Plane { normal, offset: 0.5 * (low + high) }, &vertices);
        }
    }

    pub(super) fn find_edges(&mut self) {
        let sides = std::mem::take(&mut self.sides);
        for of in sides.chunk_by(Side::is_same) {
            let ends = of[0].ends;
            let [from, to] = ends.map(|k| self.vertex(k));
            let length = (to - from).norm();
            let along = (to - from) / length;
            let Some((first, opening)) = self.directions(of, &from, &along) else {
                continue;
            };
            let edge = Edge { ends, per_length: 1.0 / length, first, opening };
            let number = self.facets.push_edge(edge);
            for side in of {
                self.of_triangle[side.triangle as usize][1 + side.number as usize] = number;
            }
        }
        self.sides = sides;
    }

    /// First direction in which an edge faces, and the angle to the last; `None` if it faces nowhere.
    ///
    /// The edge faces between the two of its triangles that have the largest angle between them.
    fn directions(&self, of: &[Side], from: &Vec3, along: &Vec3) -> Option<(Vec3, f64)> {
        let mut faces: Vec<u32> =
            of.iter().map(|side| self.of_triangle[side.triangle as usize][0]).collect();
        faces.dedup();
        if of.len() == 2 && faces.len() == 1 && !self.is_folded(of) {
            return None;
        }
        // From the edge into each triangle.
        let into = |side: &Side| {
            let corner = self.corners[side.triangle as usize][(side.number as usize + 2) % 3];
            let face = self.of_triangle[side.triangle as usize][0];
            let Plane { normal, .. } = self.facets.faces[face as usize];
            let across = normal.cross(along).normalize();
            across * (self.vertex(corner) - from).dot(&across).signum()
        };
        let into: Vec<Vec3> = of.iter().map(into).collect();
        let (x, y) = (into[0], along.cross(&into[0]));
        let turn = std::f64::consts::TAU;
        let mut angles: Vec<(f64, Vec3)> =
            into.iter().map(|d| (libm::atan2(d.dot(&y), d.dot(&x)).rem_euclid(turn), *d)).collect();
        angles.sort_by(|a, b| a.0.total_cmp(&b.0));
        let gap = |k: usize| {
            let next = angles.get(k + 1).map_or(angles[0].0 + turn, |next| next.0);
            next - angles[k].0
        };
        let widest = (0..angles.len()).max_by(|&a, &b| gap(a).total_cmp(&gap(b)))?;
        let opening = gap(widest) - std::f64::consts::PI;
        let inwards = angles[widest].1;
        (opening > LEAST_OPENING).then(|| (along.cross(&inwards), opening))
    }

    /// Whether two triangles in a plane lie on each other.
    fn is_folded(&self, of: &[Side]) -> bool {
        let [one, other] = [of[0], of[1]].map(|side| {
            let corner = self.corners[side.triangle as usize][(side.number as usize + 2) % 3];
            let [from, to] = side.ends.map(|k| self.vertex(k));
            (to - from).cross(&(self.vertex(corner) - from))
        });
        one.dot(&other) > 0.0
    }

    /// Adds the corners, which are the ends of edges.
    pub(super) fn find_corners(&mut self) {
        let mut has_edge = vec![false; self.vertices.len()];
        for facet in self.of_triangle.iter().flat_map(|of| &of[1..]).filter(|&&e| e != NONE) {
            for &vertex in self.facets.vertices_of(*facet) {
                has_edge[vertex as usize] = true;
            }
        }
        let mut beyond: Vec<Vec<u32>> = vec![Vec::new(); self.vertices.len()];
        for of in self.sides.chunk_by(Side::is_same) {
            let [from, to] = of[0].ends;
            beyond[from as usize].push(to);
            beyond[to as usize].push(from);
        }
        for &vertex in self.corners.iter().flatten() {
            if std::mem::take(&mut has_edge[vertex as usize]) {
                self.facets.push_corner(vertex, &beyond[vertex as usize]);
            }
        }
    }
}

/// Sum by halves, so that many terms have few roundings.
fn sum(vectors: &[Vec3]) -> Vec3 {
    match vectors {
        [] => Vec3::zeros(),
        [one] => *one,
        _ => {
            let (one, other) = vectors.split_at(vectors.len() / 2);
            sum(one) + sum(other)
        }
    }
}

/// Unit vector of a vector; exactly along an axis if it is so within rounding.
fn snapped(vector: &Vec3) -> Vec3 {
    let unit = vector.normalize();
    let main = unit.iamax();
    let mut axis = Vec3::zeros();
    axis[main] = unit[main].signum();
    if (unit - axis).amax() < 1e-15 { axis } else { unit }
}

/// Triangles with merged vertices: those within `weld` or rounding of each other become one.
///
/// Triangles without area and duplicates are left out.
pub(super) fn welded(
    corners: &[[Vec3; 3]],
    own: usize,
    weld: f64,
    findings: &mut Findings,
) -> Building {
    let points: Vec<Vec3> = corners.iter().flatten().map(|c| c.map(|x| x + 0.0)).collect();
    let compare = |a: &Vec3, b: &Vec3| {
        a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
    };
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| compare(&points[a], &points[b]));
    let (low, high) = bounds(&points);
    let size = (high - low).norm();
    let near = weld.max(COPLANAR * size);
    let (mut vertices, mut number) = (Vertices::apart_by(near), vec![0; points.len()]);
    let mut last = None;
    for k in order {
        if last.is_none_or(|last: usize| points[last] != points[k]) {
            number[k] = vertices.number_of(&points[k]);
        } else if let Some(last) = last {
            number[k] = number[last];
        }
        last = Some(k);
    }
    let vertices = vertices.all;
    let (numbers, _) = number.as_chunks::<3>();
    let mut seen = std::collections::BTreeSet::new();
    let mut is_sound = |triangle: &&[u32; 3]| {
        let mut key = **triangle;
        key.sort_unstable();
        has_area(&triangle.map(|k| vertices[k as usize])) && seen.insert(key)
    };
    let (of_own, of_images) = numbers.split_at(own);
    let mut triangles: Vec<[u32; 3]> = of_own.iter().filter(|of| is_sound(of)).copied().collect();
    let sound = triangles.len();
    findings.left_out = own - sound;
    triangles.extend(of_images.iter().filter(|of| is_sound(of)));
    let mut building = Building { vertices, size, near, ..Building::default() };
    building.take(triangles, sound);
    building
}

/// Whether a triangle is not flat within rounding.
pub(super) fn has_area([a, b, c]: &[Vec3; 3]) -> bool {
    let longest = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
    (b - a).cross(&(c - a)).norm() > SLIVER * longest
}

/// Points of which no two are nearer than a distance.
struct Vertices {
    near: f64,
    all: Vec<Vec3>,
    /// Points in each cell of a grid, whose cells are four times as wide.
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl Vertices {
    fn apart_by(near: f64) -> Self {
        Self { near, all: Vec::new(), cells: HashMap::new() }
    }

    fn cell(&self, point: &Vec3) -> [i64; 3] {
        let width = 4.0 * self.near;
        [point.x, point.y, point.z].map(|x| (x / width).floor() as i64)
    }

    /// Number of the first point near this one, which is added if there is none.
    fn number_of(&mut self, point: &Vec3) -> u32 {
        let around = Vec3::repeat(self.near);
        let (low, high) = (self.cell(&(point - around)), self.cell(&(point + around)));
        let mut found: Option<u32> = None;
        for x in low[0]..=high[0] {
            for y in low[1]..=high[1] {
                for z in low[2]..=high[2] {
                    let here = self.cells.get(&[x, y, z]).into_iter().flatten();
                    let is_near = |&&k: &&u32| (self.all[k as usize] - point).norm() <= self.near;
                    found = found.into_iter().chain(here.filter(is_near).copied()).min();
                }
            }
        }
        found.unwrap_or_else(|| {
            let number = self.all.len() as u32;
            self.all.push(*point);
            self.cells.entry(self.cell(point)).or_default().push(number);
            number
        })
    }
}

/// FNV-1a hash of all numbers.
fn checksum(vertices: &[Vec3], corners: &[[u32; 3]]) -> u64 {
    let numbers = vertices.iter().flat_map(|v| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>());
    let corners = corners.iter().flatten().map(|&k| u64::from(k));
    numbers.chain(corners).fold(0xcbf2_9ce4_8422_2325, |hash, number| {
        number
            .to_le_bytes()
            .iter()
            .fold(hash, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
    })
}
