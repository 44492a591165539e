//! Volume, centre of mass and inertia of polyhedra, sharp and rounded: exact, piece by piece.
//!
//! A polyhedron is a sum of signed tetrahedra with any common corner. A polyhedron rounded by a sphere of radius `r` consists of four parts by
//! Steiner's formula: that polyhedron, a prism of height `r` on each face, a wedge of a cylinder along each edge and a sector of a sphere at
//! each corner. Its volume is `V = V₀ + S r + M r² + 4π/3 r³` with the surface `S` and half the sum `M` of edge lengths times exterior angles.
//!
//! The second moments of all these pieces have closed forms. The moments of the sectors follow from integrals of `u` and `u uᵀ` over a spherical
//! polygon, which Stokes's theorem turns into sums over its sides (Arvo 1995, "Applications of irradiance tensors",
//! DOI 10.1145/218380.218467).

use super::clip::Clipped;
use super::hull::Hull;
use crate::math::{Mat3, Quat, Vec3};
use serde::{Deserialize, Serialize};

/// Part of the trace below which off-diagonal second moments are rounding and the axes are kept.
const ALIGNED: f64 = 1e-12;
/// Angle below which two normals belong to one face [rad].
const SAME_FACE: f64 = 1e-12;

/// Position of a shape's own axes in those of the user's file: `x_file = centre + axes · x_own`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Placement {
    /// The centre of mass [m].
    pub centre: Vec3,
    /// Rotation from the own axes, the principal ones, to those of the file.
    pub axes: Quat,
}

/// Mass properties of a body of uniform density 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Principal {
    /// Volume [m³].
    pub volume: f64,
    /// Principal moments of inertia over mass [m²].
    pub gyration: Vec3,
    /// Centre of mass and principal axes.
    pub placement: Placement,
}

/// Integrals over a body: of `1`, `x` and `x xᵀ`.
#[derive(Clone, Copy, Debug)]
pub struct Moments {
    pub(super) volume: f64,
    pub(super) first: Vec3,
    pub(super) second: Mat3,
    /// Origin of `x`, near the body: far away all digits would cancel.
    pub(super) origin: Vec3,
}

impl Moments {
    /// Moments of an empty body.
    pub(super) fn none(origin: Vec3) -> Self {
        Self { volume: 0.0, first: Vec3::zeros(), second: Mat3::zeros(), origin }
    }

    /// Adds the moments of another body about the same origin, or subtracts them.
    pub(super) fn add(&mut self, other: &Self, sign: f64) {
        self.volume += other.volume * sign;
        self.first += other.first * sign;
        self.second += other.second * sign;
    }

    /// Moments of the body inside a closed surface of triangles whose fronts face outwards.
    pub fn of_surface(triangles: &[[Vec3; 3]]) -> Self {
        let corners = triangles.as_flattened();
        let origin = corners.iter().sum::<Vec3>() / corners.len() as f64;
        let mut sum = Self::none(origin);
        for triangle in triangles {
            sum.add_tetrahedron(&triangle.map(|corner| corner - origin));
        }
        sum
    }

    /// Volume [m³].
    pub const fn volume(&self) -> f64 {
        self.volume
    }

    /// Moments of a cut polyhedron whose vertices are relative to the origin.
    pub(super) fn of_cut(body: &Clipped, origin: &Vec3) -> Self {
        let mut sum = Self::none(*origin);
        for face in body.faces() {
            let corner = |k: usize| body.vertices()[face.corners[k] as usize];
            for k in 2..face.corners.len() {
                sum.add_tetrahedron(&[corner(0), corner(k - 1), corner(k)]);
            }
        }
        sum
    }

    /// Adds the tetrahedron from the origin to a triangle.
    fn add_tetrahedron(&mut self, corners: &[Vec3; 3]) {
        let [a, b, c] = corners;
        let volume = a.dot(&b.cross(c)) / 6.0;
        self.volume += volume;
        self.first += (a + b + c) * (volume / 4.0);
        self.second += squares(corners) * (volume / 20.0);
    }

    /// Moments of a polyhedron.
    pub fn of(hull: &Hull) -> Self {
        let vertices = hull.vertices();
        let origin = vertices.iter().sum::<Vec3>() / vertices.len() as f64;
        let mut sum = Self::none(origin);
        for triangle in hull.triangles() {
            sum.add_tetrahedron(&triangle.corners.map(|k| vertices[k as usize] - origin));
        }
        sum
    }

    /// Moments of a polyhedron with a sphere of this radius [m] rolled around it.
    pub fn of_rounded(hull: &Hull, radius: f64) -> Self {
        let mut sum = Self::of(hull);
        let square = radius * radius;
        let r = [radius, square, square * radius, square * square, square * square * radius];
        let normal = |plane: u32| hull.planes()[plane as usize].normal;
        let corner = |k: u32| hull.vertices()[k as usize] - sum.origin;
        // An edge occurs once in each direction; the reverse direction gives the face across it.
        let mut sides = Vec::with_capacity(3 * hull.triangles().len());
        // Any normal at each corner, from which its sector is divided into triangles.
        let mut pivots = vec![Vec3::zeros(); hull.vertices().len()];
        let mut pieces = Vec::new();
        for triangle in hull.triangles() {
            let n = normal(triangle.plane);
            let [i, j, k] = triangle.corners;
            pieces.push(prism([i, j, k].map(corner), &n, &r));
            for (from, to) in [(i, j), (j, k), (k, i)] {
                sides.push(((from, to), n));
                pivots[from as usize] = n;
            }
        }
        sides.sort_by_key(|&(edge, _)| edge);
        for &((from, to), left) in &sides {
            let across = sides.binary_search_by_key(&(to, from), |&(edge, _)| edge);
            let Some(arc) = across.ok().and_then(|k| Arc::between(&sides[k].1, &left)) else {
                continue; // within one face
            };
            pieces.push(arc.sector(&corner(from), &pivots[from as usize], &r));
            if from < to {
                pieces.push(arc.wedge(&corner(from), &corner(to), &r));
            }
        }
        for (volume, first, second) in pieces {
            sum.volume += volume;
            sum.first += first;
            sum.second += second;
        }
        sum
    }

    /// Volume, centre of mass, principal axes and moments.
    ///
    /// Axes that are principal within rounding are kept. Others are rotated as little as Jacobi's method does.
    pub fn principal(&self) -> Principal {
        let centre = self.first / self.volume;
        let (axes, squares) = eigen(self.second / self.volume - centre * centre.transpose());
        let gyration =
            Vec3::new(squares.y + squares.z, squares.x + squares.z, squares.x + squares.y);
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(axes);
        let placement =
            Placement { centre: self.origin + centre, axes: Quat::from_rotation_matrix(&rotation) };
        Principal { volume: self.volume, gyration, placement }
    }
}

/// `(a + b + c)(a + b + c)ᵀ + a aᵀ + b bᵀ + c cᵀ`.
///
/// It is 20 times the mean of `x xᵀ` over a tetrahedron with its fourth corner at the origin, and 12 times that over the triangle.
fn squares(corners: &[Vec3; 3]) -> Mat3 {
    let [a, b, c] = corners;
    let sum = a + b + c;
    sum * sum.transpose() + a * a.transpose() + b * b.transpose() + c * c.transpose()
}

/// `a bᵀ + b aᵀ`
fn mixed(a: &Vec3, b: &Vec3) -> Mat3 {
    a * b.transpose() + b * a.transpose()
}

/// Integrals of `1`, `x`, `x xᵀ` over a piece.
type Piece = (f64, Vec3, Mat3);

/// Integrals over a prism of height `r` on a triangle, along its normal.
fn prism(corners: [Vec3; 3], normal: &Vec3, r: &[f64; 5]) -> Piece {
    let [a, b, c] = corners;
    let area = 0.5 * (b - a).cross(&(c - a)).norm();
    let middle = (a + b + c) / 3.0;
    let first = middle * (area * r[0]) + normal * (area * r[1] / 2.0);
    let second = squares(&corners) * (area / 12.0 * r[0])
        + mixed(&middle, normal) * (area * r[1] / 2.0)
        + normal * normal.transpose() * (area * r[2] / 3.0);
    (area * r[0], first, second)
}

/// Unit vectors from the normal of one face to that of the next.
struct Arc {
    start: Vec3,
    end: Vec3,
    /// Unit vector about which the start rotates into the end.
    axis: Vec3,
    angle: f64,
    sine: f64,
    cosine: f64,
}

impl Arc {
    /// The arc between two normals; `None` if they belong to one face.
    fn between(start: &Vec3, end: &Vec3) -> Option<Self> {
        let across = start.cross(end);
        let (sine, cosine) = (across.norm(), start.dot(end));
        let angle = libm::atan2(sine, cosine);
        (sine > SAME_FACE).then(|| Self {
            start: *start,
            end: *end,
            axis: across / sine,
            angle,
            sine,
            cosine,
        })
    }

    /// `∫ u dφ` along the arc.
    fn mean(&self) -> Vec3 {
        (self.end - self.start).cross(&self.axis)
    }

    /// Integrals over the wedge of a cylinder along the edge from `p` to `q`.
    fn wedge(&self, p: &Vec3, q: &Vec3, r: &[f64; 5]) -> Piece {
        let along = q - p;
        let length = along.norm();
        let side = self.axis.cross(&self.start);
        let round = self.sine * self.cosine;
        let directions = self.start * self.start.transpose() * (0.5 * (self.angle + round))
            + side * side.transpose() * (0.5 * (self.angle - round))
            + mixed(&self.start, &side) * (0.5 * self.sine * self.sine);
        let middle = (p + q) * 0.5;
        let line = p * p.transpose() + mixed(p, &along) * 0.5 + along * along.transpose() / 3.0;
        let area = 0.5 * self.angle * r[1];
        let first = middle * area + self.mean() * (r[2] / 3.0);
        let second =
            line * area + mixed(&middle, &self.mean()) * (r[2] / 3.0) + directions * (r[3] / 4.0);
        (length * area, first * length, second * length)
    }

    /// Share of this arc in the sector of a sphere at a corner.
    ///
    /// For the area of the spherical polygon, it is the triangle of the arc and `pivot`; for the other integrals, the term of this side of the
    /// polygon.
    fn sector(&self, corner: &Vec3, pivot: &Vec3, r: &[f64; 5]) -> Piece {
        // Van Oosterom and Strackee 1983, DOI 10.1109/TBME.1983.325207.
        let triple = pivot.dot(&self.start.cross(&self.end));
        let whole = 1.0 + pivot.dot(&self.start) + self.cosine + self.end.dot(pivot);
        let solid = 2.0 * libm::atan2(triple, whole);
        let normals = self.axis * (0.5 * self.angle);
        let directions = (Mat3::identity() * solid + self.mean() * self.axis.transpose()) / 3.0;
        let directions = (directions + directions.transpose()) * 0.5;
        let first = corner * (solid * r[2] / 3.0) + normals * (r[3] / 4.0);
        let second = corner * corner.transpose() * (solid * r[2] / 3.0)
            + mixed(corner, &normals) * (r[3] / 4.0)
            + directions * (r[4] / 5.0);
        (solid * r[2] / 3.0, first, second)
    }
}

/// Eigenvectors (columns, a rotation) and eigenvalues of a symmetric matrix by Jacobi's method.
///
/// The method keeps the vectors near the axes (Golub and Van Loan 2013, *Matrix Computations*, section 8.5).
fn eigen(mut m: Mat3) -> (Mat3, Vec3) {
    let mut vectors = Mat3::identity();
    let small = ALIGNED * m.trace();
    // Convergence is quadratic, so a handful of sweeps is enough.
    for _ in 0..20 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if m[(p, q)].abs() <= small {
                continue;
            }
            let ratio = (m[(q, q)] - m[(p, p)]) / (2.0 * m[(p, q)]);
            let length = ratio.abs() + (ratio * ratio + 1.0).sqrt();
            let tangent = if ratio < 0.0 { -1.0 / length } else { 1.0 / length };
            let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
            let sine = tangent * cosine;
            let mut turn = Mat3::identity();
            (turn[(p, p)], turn[(q, q)]) = (cosine, cosine);
            (turn[(p, q)], turn[(q, p)]) = (sine, -sine);
            m = turn.transpose() * m * turn;
            vectors *= turn;
        }
    }
    (vectors, m.diagonal())
}
