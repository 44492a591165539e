//! Thickness of a volume that two bodies share in several lumps, some of which are joined.
//!
//! # Definition
//!
//! Let `V_j` be the volume of lump `j`, and `ω_ij` the degree to which the lumps `i` and `j` are joined, from 0 to 1. With the moments of all
//! lumps joined to lump `i`,
//!
//! `W_i = Σ_j ω_ij V_j`, and centroid `c_i` and covariance `C_i` under the weights `ω_ij`, `s_i = 1 / tr(C_i⁻¹)`,
//!
//! the elastic energy of a contact of stiffness `k` is `U = 6 k Σ_i (V_i / W_i) s_i = k D² / 2`.
//!
//! - Where all lumps are joined (`ω = 1`), `U = 6 k s`: the energy of two bodies ([`super::faces`]). This holds for a plane however it is cut into
//!   triangles, and for a body cut into pieces.
//! - Where lumps are apart (`ω = 0`), as in a concave corner, each has its own energy.
//!
//! # Gradient
//!
//! Let the first body move. As for two bodies, `dU = Σ_j ∫ q_j v·n dA` over its facets in lump `j`, with `K_i = s_i C_i⁻¹` and
//!
//! `q_j(x) = 6 k [ s_j / W_j + Σ_i ω_ij (V_i / W_i²) (|K_i (x - c_i)|² - 2 s_i) ]`.
//!
//! Facets between two of its pieces that are joined contribute nothing: their pressures are the same, and their normals opposite.

use super::faces::{FAR, axes_along, fan, thinness};
use super::thickness::{THIN, Thickness};
use crate::math::{Mat3, Vec3};
use crate::shape::clip::{Clipped, Face};

/// A volume that two bodies share, as a body that was cut: its uncut facets are those of the first body.
pub(super) struct SharedVolume<'a> {
    shared: &'a Clipped,
    /// Rotation and scale from the axes and unit of length of the volume to those of all lumps.
    turn: Mat3,
    /// Position of its origin [m].
    from: Vec3,
}

impl<'a> SharedVolume<'a> {
    /// A lump in its own axes.
    pub(super) fn of(shared: &'a Clipped) -> Self {
        Self { shared, turn: Mat3::identity(), from: Vec3::zeros() }
    }

    /// A lump in other axes: turned, scaled and moved.
    pub(super) const fn placed(shared: &'a Clipped, turn: Mat3, from: Vec3) -> Self {
        Self { shared, turn, from }
    }

    fn at(&self, vertex: usize) -> Vec3 {
        self.turn * self.shared.vertices()[vertex] + self.from
    }

    fn faces(&self) -> impl Iterator<Item = Face<'_>> {
        self.shared.faces()
    }

    /// Vector area of the facets of the first body [m²].
    pub(super) fn area(&self) -> Vec3 {
        let own = self.faces().filter(|face| !face.is_cut).flat_map(|face| fan(face.corners));
        own.map(|corners| {
            let [a, b, c] = corners.map(|k| self.at(k));
            (b - a).cross(&(c - a)) * 0.5
        })
        .sum()
    }
}

/// Thickness of a volume of several lumps, and for each member whether it has a volume.
///
/// A member is a group of lumps that are joined to all others to the same degree, given by `weight`. Moments are summed in axes of which the
/// third is `upright`, a unit vector; `size` is that of the first body [m].
pub(super) fn thickness_of(
    members: &[Vec<SharedVolume>],
    weight: impl Fn(usize, usize) -> f64,
    upright: &Vec3,
    size: f64,
) -> Option<(Thickness, Vec<bool>)> {
    let axes = axes_along(upright);
    let first = members.first()?.first()?;
    let origin = first.at(*first.shared.left().first()? as usize);
    let mut all = Moments::none();
    let mut of_member = Vec::with_capacity(members.len());
    for lumps in members {
        let mut moments = Moments::none();
        for lump in lumps {
            moments.add(&Moments::of(lump, &axes, &origin), 1.0);
        }
        all.add(&moments, 1.0);
        of_member.push(moments);
    }
    let has_volume: Vec<bool> = of_member.iter().map(|moments| moments.volume > 0.0).collect();
    let with_volume: Vec<usize> = (0..members.len()).filter(|&k| has_volume[k]).collect();
    let (middle, covariance) = all.centroid_and_covariance()?;

    let of_one = |&i: &usize| {
        let mut sum = Moments::none();
        for &j in &with_volume {
            sum.add(&of_member[j], weight(i, j));
        }
        OfOne::of(&sum)
    };
    let of_one: Vec<OfOne> = with_volume.iter().map(of_one).collect();
    let mut square = 0.0;
    for (&i, one) in with_volume.iter().zip(&of_one) {
        square += 12.0 * (of_member[i].volume / one.weight) * one.s;
    }
    let thickness = square.sqrt();
    let is_thick = thickness > THIN * size;
    if !is_thick {
        return None;
    }
    let mut sum = Wrench::default();
    for (&j, own) in with_volume.iter().zip(&of_one) {
        let mut pressure = Pressure { a: Mat3::zeros(), b: Vec3::zeros(), e: own.s / own.weight };
        for (&i, one) in with_volume.iter().zip(&of_one) {
            let part = weight(i, j) * of_member[i].volume / (one.weight * one.weight);
            pressure.add(one, part, &middle);
        }
        let place = |at: Vec3| axes.tr_mul(&(at - origin)) - middle;
        for lump in &members[j] {
            sum.press(lump, &pressure, place);
        }
    }
    let found = sum.about(middle, thickness, covariance);
    Some((found.placed(1.0, &axes).with_origin(&origin), has_volume))
}

/// Force and moment about the middle, over six times the stiffness, and the largest distance of facets from it [m].
#[derive(Default)]
struct Wrench {
    force: Vec3,
    moment: Vec3,
    reach: f64,
}

impl Wrench {
    /// Adds a pressure on the facets of the first body.
    fn press(&mut self, lump: &SharedVolume, pressure: &Pressure, place: impl Fn(Vec3) -> Vec3) {
        for face in lump.faces().filter(|face| !face.is_cut) {
            for corners in fan(face.corners) {
                let corners = corners.map(|k| place(lump.at(k)));
                self.reach = corners.iter().map(Vec3::norm).fold(self.reach, f64::max);
                let (force, moment) = pressure.on(&corners);
                self.force += force;
                self.moment += moment;
            }
        }
    }

    /// The wrench as a contact of this thickness. The distance of the axis is limited, as the axis of a very small force is far away.
    fn about(&self, middle: Vec3, thickness: f64, covariance: Mat3) -> Thickness {
        let (force, moment) = (self.force * 6.0, self.moment * 6.0);
        let length = force.norm();
        let normal = if length > 0.0 { force / length } else { Vec3::z() };
        let lever =
            if length > 0.0 { force.cross(&moment) / (length * length) } else { Vec3::zeros() };
        let far = lever.norm() / (FAR * self.reach);
        let lever = if far > 1.0 { lever / far } else { lever };
        let rest = moment - lever.cross(&force);
        Thickness {
            thickness,
            normal,
            gain: length / thickness,
            point: middle + lever,
            couple: if far > 1.0 { rest } else { normal * rest.dot(&normal) },
            centroid: middle,
            covariance,
        }
    }
}

/// Moments of one lump or of several, about the origin of their contact.
#[derive(Clone, Copy)]
struct Moments {
    volume: f64,
    first: Vec3,
    second: Mat3,
}

/// `W`, `s`, `K` and `c` of the lumps joined to a lump.
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

impl Moments {
    fn none() -> Self {
        Self { volume: 0.0, first: Vec3::zeros(), second: Mat3::zeros() }
    }

    /// Moments of a polyhedron about an origin, in axes that are columns.
    fn of(lump: &SharedVolume, axes: &Mat3, origin: &Vec3) -> Self {
        let place = |k: usize| axes.tr_mul(&(lump.at(k) - origin));
        let (mut volume, mut first, mut second) = (0.0, Vec3::zeros(), Mat3::zeros());
        // About one of its own vertices, so that thin volumes keep their digits.
        let Some(&apex) = lump.shared.left().first() else { return Self::none() };
        let base = place(apex as usize);
        for face in lump.faces().filter(|face| !face.corners.contains(&apex)) {
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

    /// Centroid and covariance; `None` if there is no volume.
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

    /// `n ∫ q dA` and `∫ q x × n dA` for a triangle, by a rule that is exact for cubic functions.
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
