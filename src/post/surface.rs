//! Surfaces of bodies as triangles and polygons, for pictures.
//!
//! The surface of a polyhedron is its faces. For any other convex body the points are its support points along the corners of a
//! subdivided icosahedron; the direction is the normal there. Flat parts stay flat, and edges stay sharp. A spherocylinder has
//! circles at the ends of its cylinder, so that the cylinder is straight.

use crate::math::Vec3;
use crate::shape::union::Piece;
use crate::shape::{Core, Kind, Shape};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

/// Surface of a shape, in its axes and about its centre.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Points on the surface [m].
    pub points: Vec<Vec3>,
    /// Outward unit normal at each point.
    pub normals: Vec<Vec3>,
    /// Points of all faces, one face after the other, counter-clockwise seen from outside.
    pub members: Vec<u32>,
    /// End of each face in `members`.
    pub ends: Vec<u32>,
}

/// Number of subdivisions of the triangles of an icosahedron into four: 20, 80, 320, 1,280, ... triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Detail(u8);

impl Detail {
    /// Finest detail: more would exceed the resolution of any picture, and a particle would take a megabyte.
    pub const FINEST: u8 = 5;
    /// 1,280 triangles for a ball.
    pub const FINE: Self = Self(3);
}

impl Default for Detail {
    fn default() -> Self {
        Self(2)
    }
}

impl std::str::FromStr for Detail {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let is_known = |detail: &u8| *detail <= Self::FINEST;
        let known = text.parse().ok().filter(is_known);
        known.map(Self).ok_or_else(|| format!("a whole number from 0 to {}", Self::FINEST))
    }
}

impl Surface {
    /// Surface of a shape.
    pub fn of(shape: &Shape, detail: Detail) -> Self {
        if let Shape::Union(body) = shape {
            let mut surface = Self::default();
            for piece in body.pieces() {
                surface.append(&Self::of_piece(piece, detail));
            }
            return surface;
        }
        if shape.kind() == Kind::Polyhedron
            && let Some(facets) = shape.facets()
        {
            return Self::of_faces(facets);
        }
        if let Core::Segment(half) = shape.core() {
            return Self::of_spherocylinder(half, shape.margin(), detail);
        }
        let (directions, triangles) = sphere(detail);
        let points: Vec<Vec3> =
            directions.iter().map(|direction| shape.support(direction)).collect();
        let mut surface = Self { points, normals: directions, ..Self::default() };
        for corners in triangles {
            surface.push(&corners);
        }
        surface
    }

    /// Surface of a piece, in the axes of its body and about its centre.
    pub fn of_piece(Piece { shape, centre, rotation }: &Piece, detail: Detail) -> Self {
        let mut surface = Self::of(shape, detail);
        surface.points.iter_mut().for_each(|point| *point = centre + rotation * *point);
        surface.normals.iter_mut().for_each(|normal| *normal = rotation * *normal);
        surface
    }

    fn append(&mut self, other: &Self) {
        let (first, before) = (self.points.len() as u32, self.members.len() as u32);
        self.points.extend(&other.points);
        self.normals.extend(&other.normals);
        self.members.extend(other.members.iter().map(|member| first + member));
        self.ends.extend(other.ends.iter().map(|end| before + end));
    }

    fn of_faces(facets: &crate::shape::facets::Facets) -> Self {
        let mut surface = Self::default();
        let mut first = 0;
        for (plane, &end) in facets.planes().iter().zip(facets.ends()) {
            let corners = &facets.corners()[first..end as usize];
            first = end as usize;
            let begin = surface.points.len() as u32;
            // Each corner has a point for every face, with the normal of that face.
            for &corner in corners {
                surface.points.push(facets.vertices()[corner as usize]);
                surface.normals.push(plane.normal);
            }
            surface.members.extend(begin..begin + corners.len() as u32);
            surface.ends.push(surface.members.len() as u32);
        }
        surface
    }

    /// Surface of a spherocylinder along the local x.
    fn of_spherocylinder(half: f64, radius: f64, Detail(detail): Detail) -> Self {
        let around = 5_u32 << detail;
        let rings = (around / 4).max(1);
        let mut surface = Self::default();
        // From the pole at -x to that at +x; the equator appears twice, once at each end of the cylinder.
        for end in [-1.0, 1.0] {
            for ring in 0..=rings {
                let towards_equator = if end < 0.0 { ring } else { rings - ring };
                let latitude = 0.5 * PI * f64::from(towards_equator) / f64::from(rings);
                for k in 0..around {
                    let (sin, cos) = (TAU * f64::from(k) / f64::from(around)).sin_cos();
                    let normal =
                        Vec3::new(end * latitude.cos(), latitude.sin() * cos, latitude.sin() * sin);
                    surface.points.push(Vec3::new(end * half, 0.0, 0.0) + normal * radius);
                    surface.normals.push(normal);
                }
            }
        }
        for ring in 0..=2 * rings {
            for k in 0..around {
                let next = (k + 1) % around;
                let [low, high] = [ring * around, (ring + 1) * around];
                let corners = match ring {
                    0 => vec![low, high + next, high + k],
                    last if last == 2 * rings => vec![low + k, low + next, high],
                    _ => vec![low + k, low + next, high + next, high + k],
                };
                surface.push(&corners);
            }
        }
        surface
    }

    /// Adds a face, unless two of its corners coincide.
    fn push(&mut self, corners: &[u32]) {
        let point = |k: usize| self.points[corners[k % corners.len()] as usize];
        if (0..corners.len()).all(|k| point(k) != point(k + 1)) {
            self.members.extend(corners);
            self.ends.push(self.members.len() as u32);
        }
    }

    /// Points of each face.
    pub fn faces(&self) -> impl Iterator<Item = &[u32]> {
        let firsts = std::iter::once(0).chain(self.ends.iter().copied());
        firsts.zip(&self.ends).map(|(first, &end)| &self.members[first as usize..end as usize])
    }
}

/// Unit vectors and their triangles, counter-clockwise seen from outside.
fn sphere(Detail(detail): Detail) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    const FACES: [[u32; 3]; 20] = [
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let corners = [
        [-1.0, golden, 0.0],
        [1.0, golden, 0.0],
        [-1.0, -golden, 0.0],
        [1.0, -golden, 0.0],
        [0.0, -1.0, golden],
        [0.0, 1.0, golden],
        [0.0, -1.0, -golden],
        [0.0, 1.0, -golden],
        [golden, 0.0, -1.0],
        [golden, 0.0, 1.0],
        [-golden, 0.0, -1.0],
        [-golden, 0.0, 1.0],
    ];
    let mut points: Vec<Vec3> = corners.iter().map(|c| Vec3::from(*c).normalize()).collect();
    let mut triangles = FACES.to_vec();
    for _ in 0..detail {
        let mut middles = HashMap::new();
        let mut middle = |points: &mut Vec<Vec3>, a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(a, b)| middle(&mut points, a, b));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (points, triangles)
}
