//! Convex hull of points: the surface of a polyhedron.
//!
//! Points are added one by one. A point outside replaces the faces that it sees (the incremental algorithm: de Berg et al. 2008,
//! *Computational Geometry*, section 11.2). Exact predicates decide which faces a point sees (Shewchuk 1997, DOI 10.1007/PL00009321). The
//! result is a closed convex surface whatever the rounding of the points. The corners of a face, four or a thousand, need not be exactly in one
//! plane. The time grows with the square of the number of points, which is negligible for a particle that is read once. Faster crates depend
//! on another linear algebra library.

use super::facets::{Facets, Plane};
use crate::math::{Mat3, Vec3};
use robust::{Coord3D, orient3d};
use serde::{Deserialize, Serialize};

/// Thickness over size below which a body is flat.
const FLAT: f64 = 1e-6;
/// Distance over size below which points are one.
const SAME: f64 = 1e-9;
/// Triangles with their corners in the plane of a larger one, within this part of the size, belong to its face.
const COPLANAR: f64 = 1e-10;
/// Largest number of points; more would take seconds.
const MOST: usize = 10_000;
/// Sizes whose third powers, and quotients of these, do not overflow or underflow [m].
const SIZES: std::ops::RangeInclusive<f64> = 1e-60..=1e60;
/// Largest number of vertices that are searched one by one for the farthest; for more, the search climbs along the surface.
const SCAN: usize = 64;

/// Reason why points have no convex hull that could be a particle.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HullError {
    /// Too few points for a body.
    #[error("{count} points have no volume; at least 4 are needed")]
    TooFew {
        /// Number of points.
        count: usize,
    },
    /// More points than are supported.
    #[error("{count} points are too many; reduce the mesh to at most {MOST}")]
    TooMany {
        /// Number of points.
        count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("point {index} (the first is 0) is not finite")]
    NotFinite {
        /// Index of the point.
        index: usize,
    },
    /// The size is outside the range of computations.
    #[error("a body of {size:e} m is outside the range of numbers")]
    Size {
        /// Half the diagonal of the box around the points [m].
        size: f64,
    },
    /// Two points at one place.
    #[error("points {first} and {second} (the first is 0) are the same")]
    Same {
        /// First point.
        first: usize,
        /// Second point.
        second: usize,
    },
    /// All points lie in a plane within rounding.
    #[error("all points lie in one plane; the body has no volume")]
    Flat,
    /// A point is not a corner of the convex hull.
    #[error(
        "not convex: point {index} (the first is 0) is {depth:.4e} m inside the convex hull of the others"
    )]
    Inside {
        /// Index of the point.
        index: usize,
        /// Depth below the hull's surface [m].
        depth: f64,
    },
    /// A point lies on the convex hull, but neither at a corner nor on an edge.
    #[error(
        "point {index} (the first is 0) is within a face of the convex hull, as at a dent or a hole. If the hull is \
         meant, leave out all points inside faces; particles with dents are not supported"
    )]
    WithinFace {
        /// Index of the point.
        index: usize,
    },
}

/// A triangle of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Triangle {
    /// Indices of its vertices, counter-clockwise seen from outside.
    pub corners: [u32; 3],
    /// Index of its plane.
    pub plane: u32,
}

/// Serialised data of a hull, from which all other data follow.
#[derive(Serialize, Deserialize)]
struct Written {
    vertices: Vec<Vec3>,
    triangles: Vec<Triangle>,
    planes: Vec<Plane>,
}

impl TryFrom<Written> for Hull {
    type Error = &'static str;

    fn try_from(Written { vertices, triangles, planes }: Written) -> Result<Self, Self::Error> {
        let is_known = |triangle: &Triangle| {
            triangle.corners.iter().all(|&corner| (corner as usize) < vertices.len())
                && (triangle.plane as usize) < planes.len()
        };
        let is_surface =
            vertices.len() > 3 && triangles.len() > 3 && triangles.iter().all(is_known);
        if !(is_surface && vertices.iter().flatten().all(|x| x.is_finite())) {
            return Err("a surface of triangles whose corners and planes are not there");
        }
        Ok(Self::assembled(vertices, triangles, planes))
    }
}

impl From<Hull> for Written {
    fn from(Hull { vertices, triangles, planes, .. }: Hull) -> Self {
        Self { vertices, triangles, planes }
    }
}

/// A convex surface, closed, with the origin inside or not.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Written", into = "Written")]
pub struct Hull {
    vertices: Vec<Vec3>,
    triangles: Vec<Triangle>,
    planes: Vec<Plane>,
    facets: Facets,
    /// Neighbours of vertex `k` are `neighbours[first[k]..first[k + 1]]`.
    neighbours: Vec<u32>,
    first: Vec<u32>,
    /// Farthest vertex in the middle of each octant: bit 0 is set where x is positive, bit 1 for y, bit 2 for z.
    octants: [u32; 8],
    bounding_radius: f64,
    inscribed_radius: f64,
    half_extents: Vec3,
}

impl Hull {
    /// The convex hull of points; those inside it or on a face are left out.
    ///
    /// # Errors
    /// See [`HullError`], all but [`HullError::Inside`] and [`HullError::WithinFace`].
    pub fn of(points: &[Vec3]) -> Result<Self, HullError> {
        let size = checked_size(points)?;
        let surface = surface(points, &first_tetrahedron(points, size)?);
        // Vertices keep the order of the points.
        let mut is_vertex = vec![false; points.len()];
        surface.iter().flatten().for_each(|&k| is_vertex[k] = true);
        let mut index = vec![0; points.len()];
        let mut vertices = Vec::new();
        for k in (0..points.len()).filter(|&k| is_vertex[k]) {
            index[k] = vertices.len() as u32;
            vertices.push(points[k]);
        }
        let corners: Vec<[u32; 3]> = surface.iter().map(|t| t.map(|k| index[k])).collect();
        let (planes, plane_of) = planes(&vertices, &corners, COPLANAR * size);
        let corners_of_faces = corners_of_faces(&vertices, &corners, &plane_of);
        if corners_of_faces.len() < vertices.len() {
            return Self::of(&corners_of_faces);
        }
        let triangles = corners
            .into_iter()
            .zip(plane_of)
            .map(|(corners, plane)| Triangle { corners, plane })
            .collect();
        Ok(Self::assembled(vertices, triangles, planes))
    }

    fn assembled(vertices: Vec<Vec3>, triangles: Vec<Triangle>, planes: Vec<Plane>) -> Self {
        let mut around = vec![Vec::new(); vertices.len()];
        for Triangle { corners: [a, b, c], .. } in &triangles {
            // Each edge occurs once in each direction.
            for (from, to) in [(a, b), (b, c), (c, a)] {
                around[*from as usize].push(*to);
            }
        }
        let mut first = vec![0];
        let mut neighbours = Vec::new();
        for list in around {
            neighbours.extend(list);
            first.push(neighbours.len() as u32);
        }
        let longest = |of: &dyn Fn(&Vec3) -> f64| vertices.iter().map(of).fold(0.0, f64::max);
        let bounding_radius = longest(&Vec3::norm);
        let half_extents =
            Vec3::new(longest(&|v| v.x.abs()), longest(&|v| v.y.abs()), longest(&|v| v.z.abs()));
        let inscribed_radius = planes.iter().map(|p| p.offset).fold(f64::INFINITY, f64::min);
        let octants = std::array::from_fn(|octant| {
            let sign = |bit: usize| if octant >> bit & 1 == 1 { 1.0 } else { -1.0 };
            farthest(&vertices, &Vec3::new(sign(0), sign(1), sign(2))) as u32
        });
        let facets = {
            let sides = triangles.iter().map(|t| (t.corners, t.plane));
            Facets::of_triangles(&vertices, sides, &planes)
        };
        Self {
            vertices,
            triangles,
            planes,
            facets,
            neighbours,
            first,
            octants,
            bounding_radius,
            inscribed_radius,
            half_extents,
        }
    }

    /// Copy relative to `origin`, in axes that are the columns of `axes`.
    #[must_use]
    pub fn seen_from(&self, origin: &Vec3, axes: &Mat3) -> Self {
        let vertices = self.vertices.iter().map(|v| axes.tr_mul(&(v - origin))).collect();
        let planes = self
            .planes
            .iter()
            .map(|plane| Plane {
                normal: axes.tr_mul(&plane.normal).normalize(),
                offset: plane.offset - plane.normal.dot(origin),
            })
            .collect();
        Self::assembled(vertices, self.triangles.clone(), planes)
    }

    /// Corners of the body [m].
    pub fn vertices(&self) -> &[Vec3] {
        &self.vertices
    }

    /// Triangles of the surface; faces with more than three corners are divided.
    pub fn triangles(&self) -> &[Triangle] {
        &self.triangles
    }

    /// Planes of the faces, largest triangle first.
    pub fn planes(&self) -> &[Plane] {
        &self.planes
    }

    /// Faces as polygons.
    pub const fn facets(&self) -> &Facets {
        &self.facets
    }

    /// Farthest vertex along `direction` (any length but zero) [m].
    #[inline]
    pub fn support(&self, direction: &Vec3) -> Vec3 {
        self.vertices[self.farthest(direction)]
    }

    #[inline]
    fn farthest(&self, direction: &Vec3) -> usize {
        if self.vertices.len() <= SCAN {
            farthest(&self.vertices, direction)
        } else {
            self.climbed(direction)
        }
    }

    fn neighbours_of(&self, vertex: usize) -> impl Iterator<Item = usize> {
        let range = self.first[vertex] as usize..self.first[vertex + 1] as usize;
        self.neighbours[range].iter().map(|&k| k as usize)
    }

    /// Farthest vertex, reached from neighbour to neighbour: on a convex body only the farthest has no neighbour farther out.
    fn climbed(&self, direction: &Vec3) -> usize {
        let bit = |x: f64| usize::from(x > 0.0);
        let octant = bit(direction.x) | bit(direction.y) << 1 | bit(direction.z) << 2;
        let mut here = self.octants[octant] as usize;
        let mut along = self.vertices[here].dot(direction);
        loop {
            let before = here;
            for neighbour in self.neighbours_of(before) {
                let there = self.vertices[neighbour].dot(direction);
                if there > along {
                    (here, along) = (neighbour, there);
                }
            }
            if here == before {
                return here;
            }
        }
    }

    /// Vertices at most `depth` [m] below the farthest along a unit vector, which comes first.
    ///
    /// There is one for a corner, two for an edge, and more for a face or a blunt corner.
    pub fn top(&self, direction: &Vec3, depth: f64) -> Vec<usize> {
        let mut top = vec![self.farthest(direction)];
        let least = self.vertices[top[0]].dot(direction) - depth;
        // The vertices within that depth are connected.
        let mut next = 0;
        while next < top.len() {
            for neighbour in self.neighbours_of(top[next]) {
                if self.vertices[neighbour].dot(direction) >= least && !top.contains(&neighbour) {
                    top.push(neighbour);
                }
            }
            next += 1;
        }
        top
    }

    /// Depth of a point below the surface [m]; negative outside.
    pub fn depth(&self, point: &Vec3) -> f64 {
        let below = |plane: &Plane| plane.offset - plane.normal.dot(point);
        self.planes.iter().map(below).fold(f64::INFINITY, f64::min)
    }

    /// Distance of a point from the body [m]; 0 inside.
    pub fn distance(&self, point: &Vec3) -> f64 {
        if self.depth(point) >= 0.0 {
            return 0.0;
        }
        let squared = |triangle: &Triangle| {
            squared_distance(point, triangle.corners.map(|k| self.vertices[k as usize]))
        };
        self.triangles.iter().map(squared).fold(f64::INFINITY, f64::min).sqrt()
    }

    /// Whether a point is at most `radius` [m] from the body.
    pub fn is_near(&self, point: &Vec3, radius: f64) -> bool {
        let above = |plane: &Plane| plane.normal.dot(point) - plane.offset;
        if self.planes.iter().any(|plane| above(plane) > radius) {
            return false;
        }
        let near = |triangle: &Triangle| {
            let corners = triangle.corners.map(|k| self.vertices[k as usize]);
            squared_distance(point, corners) <= radius * radius
        };
        self.planes.iter().all(|plane| above(plane) <= 0.0) || self.triangles.iter().any(near)
    }

    /// Radius of the smallest sphere about the origin that contains the body [m].
    pub const fn bounding_radius(&self) -> f64 {
        self.bounding_radius
    }

    /// Radius of the largest sphere about the origin inside the body [m]; negative if the origin is outside.
    pub const fn inscribed_radius(&self) -> f64 {
        self.inscribed_radius
    }

    /// Half lengths along the axes of the smallest box about the origin that contains the body [m].
    pub const fn half_extents(&self) -> Vec3 {
        self.half_extents
    }
}

/// Squared distance of a point from a triangle [m²].
fn squared_distance(point: &Vec3, [a, b, c]: [Vec3; 3]) -> f64 {
    let sides = [(a, b), (b, c), (c, a)];
    let normal = (b - a).cross(&(c - a));
    if sides.iter().all(|(from, to)| normal.cross(&(to - from)).dot(&(point - from)) >= 0.0) {
        let along = normal.dot(&(point - a));
        return along * along / normal.norm_squared();
    }
    let from_side = |(from, to): (Vec3, Vec3)| {
        let (side, off) = (to - from, point - from);
        let part = (side.dot(&off) / side.norm_squared()).clamp(0.0, 1.0);
        (off - side * part).norm_squared()
    };
    sides.map(from_side).into_iter().fold(f64::INFINITY, f64::min)
}

/// Index of the point farthest along a direction, the first of several.
#[inline]
fn farthest(points: &[Vec3], direction: &Vec3) -> usize {
    // Four at a time, because each comparison waits for the previous one.
    let (mut best, mut along) = ([0; 4], [f64::NEG_INFINITY; 4]);
    for (k, four) in points.chunks(4).enumerate() {
        for (lane, point) in four.iter().enumerate() {
            let there = point.dot(direction);
            let is_farther = there > along[lane];
            best[lane] = if is_farther { 4 * k + lane } else { best[lane] };
            along[lane] = if is_farther { there } else { along[lane] };
        }
    }
    (1..4)
        .fold((best[0], along[0]), |first, lane| {
            let (index, there) = (best[lane], along[lane]);
            let is_first = there > first.1 || (there == first.1 && index < first.0);
            if is_first { (index, there) } else { first }
        })
        .0
}

/// Half the diagonal of the box around points, of which there is at least one [m].
pub(super) fn size(points: &[Vec3]) -> f64 {
    let (mut low, mut high) = (points[0], points[0]);
    for point in points {
        (low, high) = (low.inf(point), high.sup(point));
    }
    0.5 * (high - low).norm()
}

/// Size of points that are valid for a hull [m].
fn checked_size(points: &[Vec3]) -> Result<f64, HullError> {
    let count = points.len();
    if count < 4 {
        return Err(HullError::TooFew { count });
    }
    if count > MOST {
        return Err(HullError::TooMany { count });
    }
    if let Some(index) = points.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return Err(HullError::NotFinite { index });
    }
    let size = size(points);
    if size > 0.0 && !SIZES.contains(&size) {
        return Err(HullError::Size { size });
    }
    let mut sorted: Vec<usize> = (0..count).collect();
    sorted.sort_by(|&i, &j| points[i].x.total_cmp(&points[j].x));
    for (k, &i) in sorted.iter().enumerate() {
        for &j in sorted[k + 1..].iter().take_while(|&&j| points[j].x - points[i].x <= SAME * size)
        {
            if (points[j] - points[i]).norm() <= SAME * size {
                return Err(HullError::Same { first: i.min(j), second: i.max(j) });
            }
        }
    }
    Ok(size)
}

/// Faces of a tetrahedron of four points far from each other, counter-clockwise seen from outside.
fn first_tetrahedron(points: &[Vec3], size: f64) -> Result<[[usize; 3]; 4], HullError> {
    let largest = |of: &dyn Fn(&Vec3) -> f64| {
        let sizes = points.iter().map(of).enumerate();
        sizes.fold((0, -1.0), |best, item| if item.1 > best.1 { item } else { best })
    };
    let p = points[0];
    let (i, length) = largest(&|x| (x - p).norm());
    let edge = (points[i] - p) / length;
    let (j, width) = largest(&|x| (x - p).cross(&edge).norm());
    if width <= FLAT * size {
        return Err(HullError::Flat);
    }
    let up = edge.cross(&(points[j] - p)).normalize();
    let (k, height) = largest(&|x| (x - p).dot(&up).abs());
    if height <= FLAT * size {
        return Err(HullError::Flat);
    }
    // The fourth point must not see the first face.
    let (i, j) = if sees(points, [0, i, j], k) { (j, i) } else { (i, j) };
    Ok([[0, i, j], [0, k, i], [i, k, j], [j, k, 0]])
}

/// Whether a point is strictly outside the plane of a face.
fn sees(points: &[Vec3], face: [usize; 3], point: usize) -> bool {
    let coord = |k: usize| Coord3D { x: points[k].x, y: points[k].y, z: points[k].z };
    let [a, b, c] = face.map(coord);
    orient3d(a, b, c, coord(point)) < 0.0
}

/// Faces of the convex hull, counter-clockwise seen from outside.
fn surface(points: &[Vec3], start: &[[usize; 3]; 4]) -> Vec<[usize; 3]> {
    let mut faces = start.to_vec();
    let mut outline: Vec<(usize, usize)> = Vec::new();
    for point in 0..points.len() {
        outline.clear();
        faces.retain(|&face| {
            let seen = sees(points, face, point);
            if seen {
                let [a, b, c] = face;
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    // An edge between two seen faces occurs once in each direction.
                    match outline.iter().position(|&edge| edge == (to, from)) {
                        Some(k) => drop(outline.swap_remove(k)),
                        None => outline.push((from, to)),
                    }
                }
            }
            !seen
        });
        faces.extend(outline.iter().map(|&(from, to)| [from, to, point]));
    }
    faces
}

/// Distinct planes of the triangles, and the index of each triangle's plane.
///
/// The largest triangle of a face gives its plane, because the normals of slivers are inaccurate.
fn planes(vertices: &[Vec3], triangles: &[[u32; 3]], tolerance: f64) -> (Vec<Plane>, Vec<u32>) {
    let corners = |k: usize| triangles[k].map(|c| vertices[c as usize]);
    let across: Vec<Vec3> = (0..triangles.len())
        .map(|k| {
            let [a, b, c] = corners(k);
            (b - a).cross(&(c - a))
        })
        .collect();
    let mut by_area: Vec<usize> = (0..triangles.len()).collect();
    by_area.sort_by(|&i, &j| across[j].norm_squared().total_cmp(&across[i].norm_squared()));
    let mut planes: Vec<Plane> = Vec::new();
    let mut plane_of = vec![0; triangles.len()];
    for k in by_area {
        let corners = corners(k);
        let holds = |plane: &Plane| {
            corners.iter().all(|p| (plane.normal.dot(p) - plane.offset).abs() <= tolerance)
        };
        let known = planes.iter().position(holds).unwrap_or_else(|| {
            let normal = across[k].normalize();
            let offset = (corners[0] + corners[1] + corners[2]).dot(&normal) / 3.0;
            planes.push(Plane { normal, offset });
            planes.len() - 1
        });
        plane_of[k] = known as u32;
    }
    (planes, plane_of)
}

/// Vertices at which three faces meet; others lie on an edge or a face within rounding.
fn corners_of_faces(vertices: &[Vec3], triangles: &[[u32; 3]], plane_of: &[u32]) -> Vec<Vec3> {
    let mut planes_at: Vec<Vec<u32>> = vec![Vec::new(); vertices.len()];
    for (corners, plane) in triangles.iter().zip(plane_of) {
        for &corner in corners {
            let planes = &mut planes_at[corner as usize];
            if !planes.contains(plane) {
                planes.push(*plane);
            }
        }
    }
    let meeting = vertices.iter().zip(&planes_at).filter(|(_, planes)| planes.len() > 2);
    meeting.map(|(vertex, _)| *vertex).collect()
}

#[cfg(test)]
mod tests {
    use super::{Hull, HullError};
    use crate::math::Vec3;

    /// Points of a sphere, in no order.
    fn round(count: usize, seed: f64) -> Vec<Vec3> {
        let point = |k| {
            let k = k as f64 + seed;
            Vec3::new((1.3 * k).sin(), (2.9 * k).sin(), (0.7 * k).cos()).normalize()
        };
        (0..count).map(point).collect()
    }

    #[test]
    fn climbing_finds_the_farthest() {
        let points = round(500, 0.0);
        let hull = Hull::of(&points).unwrap();
        assert_eq!(hull.vertices(), points);
        // Euler: a closed surface of triangles.
        assert_eq!(hull.triangles().len(), 2 * points.len() - 4);
        for direction in round(2000, 0.5) {
            let best = points.iter().map(|p| p.dot(&direction)).fold(-1.0, f64::max);
            assert!((hull.support(&direction).dot(&direction) - best).abs() < 1e-15);
        }
    }

    #[test]
    fn every_point_is_below_every_face() {
        // A lattice has many points in one plane and on one line.
        let point = |k: u32| Vec3::from([k % 5, k / 5 % 5, k / 25].map(|i| f64::from(i) * 0.1));
        let points: Vec<Vec3> = (0..125).map(|k| point(k * 57 % 125)).collect();
        let hull = Hull::of(&points).unwrap();
        assert!(points.iter().all(|p| hull.depth(p) > -1e-15));
        assert_eq!((hull.vertices().len(), hull.planes().len()), (8, 6), "a cube");
    }

    #[test]
    fn what_is_written_is_the_whole_hull() {
        let hull = Hull::of(&round(80, 0.0)).unwrap();
        let text = serde_json::to_string(&hull).unwrap();
        assert_eq!(serde_json::from_str::<Hull>(&text).unwrap(), hull);
    }

    #[test]
    fn what_is_no_body_is_said() {
        let corner = |x: f64, y: f64, z: f64| Vec3::new(x, y, z);
        let tetrahedron = [
            corner(0.0, 0.0, 0.0),
            corner(1.0, 0.0, 0.0),
            corner(0.0, 1.0, 0.0),
            corner(0.0, 0.0, 1.0),
        ];
        let with = |more: Vec3| Hull::of(&[&tetrahedron[..], &[more]].concat()).unwrap_err();
        assert_eq!(Hull::of(&tetrahedron[..3]), Err(HullError::TooFew { count: 3 }));
        assert_eq!(with(corner(0.0, f64::NAN, 0.0)), HullError::NotFinite { index: 4 });
        assert_eq!(with(corner(0.0, 1.0, 1e-12)), HullError::Same { first: 2, second: 4 });
        let flat = tetrahedron.map(|p| p.component_mul(&corner(1.0, 1.0, 1e-9)));
        assert_eq!(Hull::of(&flat[..3]), Err(HullError::TooFew { count: 3 }));
        let square = [flat[0], flat[1], flat[2], corner(1.0, 1.0, 1e-9)];
        assert_eq!(Hull::of(&square), Err(HullError::Flat));
        assert!(matches!(with(corner(1e200, 0.0, 0.0)), HullError::Size { .. }));
    }
}
