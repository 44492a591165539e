//! Thickness of straight sides on a surface of triangles, a cylinder or a cone.
//!
//! # Definition
//!
//! Each point of the axis is over some facets of the surface ([`TriangleMesh::stretches`]). Over each there is a depth `δ(s)`: the radius less
//! the distance. Stretches count as one surface if they meet, or pass each other at the same depth, with normals that differ by less than 30
//! degrees. On one surface the largest `δ` counts, which is a continuous function. A *chain* is a part of the axis where it is positive. Along a
//! chain without dips, as over a convex edge,
//!
//! `D² = ∫ δ³ ds / ∫ δ ds`,
//!
//! as on a plane ([`super::sides`]). The elastic energy is `k D² / 2`, and force and moment are its gradient.
//!
//! Where `δ` dips, as over a shallow fold, across a hole or from inside a cylinder, the chain consists of lobes `i`, and
//!
//! `D² = Σ_i ∫_i δ³ ds / Σ_j ω_ij ∫_j δ ds`, `ω_ij = 1 - (1 - u_i) (1 - u_j)`, `u_i = x (2 - x)`, `x = min(1, m² / D_i²)`
//!
//! with the lowest dip `m` between both. Two lobes that part have their own energies (`ω = 0`), and a dip of depth zero changes nothing (`ω = 1`).
//!
//! - A plane is one face however it is cut: its force is that of the plane.
//! - Over a convex edge force and energy have no jump.
//! - Strips of a cylinder or cone are one surface. Contacts end with a jump where that surface ends.
//! - Faces of a fold that turns by more than 30 degrees have contacts of their own. For overlaps beyond a seventh of the radius, the axis can
//!   move from over one face to over the other, where a force ends with a jump. Beyond a fifteenth of the radius the force jumps where the axis
//!   passes a corner of a hole.
//!
//! # Contacts
//!
//! A chain belongs to the pair of the lowest of its facets. Chains with the same lowest facet make one contact with the sum of their energies.

use super::seen::{Seen, Shared};
use super::sides::{Integrals, Side};
use super::thickness::{THIN, Thickness};
use crate::contact::patch::nearest_of_segments;
use crate::math::Vec3;
use crate::shape::triangle_mesh::{FLAT, MeshFacet, Over, Rim, Stretch};
use nalgebra::Matrix3x2;

/// Extent of stretches beyond borders, over the radius.
const BORDER: f64 = 1e-9;
/// Slopes that differ by less than this make no dip, over the radius.
const LEVEL: f64 = 1e-9;
/// Cosine of 30 degrees: facets that turn by less are one surface.
const ONE: f64 = 0.866_025_403_784_438_6;

/// A derivative. For a depth along `n` at `s` it is `n` and `s n`, so that the second column times the axis is the moment.
type DepthGradient = Matrix3x2<f64>;

/// A part of the axis over one facet with `δ > 0`.
#[derive(Clone, Copy, Debug)]
struct Part {
    seen: Stretch,
    range: [f64; 2],
    /// Number of the surface: parts of one surface have the same.
    group: usize,
}

/// Consecutive parts.
type Chain = Vec<Part>;

/// Working memory, kept from one body to the next.
#[derive(Default)]
pub(super) struct Room {
    stretches: Vec<Stretch>,
    parts: Vec<Part>,
    breaks: Vec<f64>,
    chains: Vec<Chain>,
}

impl Room {
    /// Finds all contacts of a body with a straight side.
    pub(super) fn find(&mut self, side: &Side, seen: &Seen, found: &mut Vec<Shared>) {
        // In the axes of the wall.
        let side = Side { end: seen.wall.tr_mul(&side.end), radius: side.radius };
        let border = BORDER * side.radius;
        seen.mesh.stretches(&seen.centre, &side.end, side.radius, border, &mut self.stretches);
        self.parts.clear();
        let ranges = |seen: &Stretch| seen.nearer_than(side.radius).into_iter().flatten();
        let parts = self.stretches.iter().flat_map(|seen| ranges(seen).map(|range| (*seen, range)));
        let parts = parts.zip(0..).map(|((seen, range), group)| Part { seen, range, group });
        self.parts.extend(parts);
        self.group(&side, seen);
        self.find_chains();
        let lowest = |chain: &Chain| chain.iter().map(|part| part.seen.facet).min();
        self.chains.sort_by_key(lowest);
        for of_one in self.chains.chunk_by(|one, other| lowest(one) == lowest(other)) {
            let thickness = side.in_chains(of_one).map(|found| found.placed(1.0, seen.wall));
            let owner = lowest(&of_one[0]);
            found
                .extend(thickness.zip(owner).map(|(thickness, facet)| Shared { facet, thickness }));
        }
    }

    /// Groups the parts of one surface, and finds all places where the deepest part may change.
    fn group(&mut self, side: &Side, seen: &Seen) {
        let Self { parts, breaks, .. } = self;
        breaks.clear();
        breaks.extend(
            parts.iter().flat_map(|part| part.range.into_iter().chain(part.seen.farthest())),
        );
        for k in 1..parts.len() {
            for l in 0..k {
                let (one, other) = (parts[l], parts[k]);
                let range = [one.range[0].max(other.range[0]), one.range[1].min(other.range[1])];
                let facets = [one.seen.facet, other.seen.facet];
                let adjoin = facets[0] == facets[1] || seen.mesh.adjoin(facets[0], facets[1]);
                let hang_together = || {
                    adjoin
                        || one.lies_in(&other, range, side, seen)
                        || other.lies_in(&one, range, side, seen)
                };
                if range[0] > range[1] || !hang_together() {
                    continue;
                }
                let crossings = one.crossings(&other, range);
                let at = crossings[0].unwrap_or(0.5 * (range[0] + range[1]));
                if one.seen.out(at).dot(&other.seen.out(at)) < ONE {
                    continue;
                }
                breaks.extend(crossings.into_iter().flatten());
                let (low, high) = (one.group.min(other.group), one.group.max(other.group));
                parts.iter_mut().filter(|p| p.group == high).for_each(|p| p.group = low);
            }
        }
        breaks.sort_unstable_by(f64::total_cmp);
        breaks.dedup();
    }

    /// Follows the deepest part of each surface along the axis.
    fn find_chains(&mut self) {
        let Self { parts, breaks, chains, .. } = self;
        parts.sort_unstable_by_key(|part| (part.group, part.seen.facet));
        chains.clear();
        for of_one in parts.chunk_by(|one, other| one.group == other.group) {
            let mut goes_on = false;
            for between in breaks.windows(2) {
                let middle = 0.5 * (between[0] + between[1]);
                let there = |part: &&Part| part.range[0] <= middle && middle <= part.range[1];
                let distance = |part: &&Part| part.seen.distance(middle);
                let nearer = |one: &&Part, other: &&Part| distance(one).total_cmp(&distance(other));
                let Some(deepest) = of_one.iter().filter(there).min_by(nearer) else {
                    goes_on = false;
                    continue;
                };
                let part = Part { range: [between[0], between[1]], ..*deepest };
                match chains.last_mut().filter(|_| goes_on) {
                    None => chains.push(vec![part]),
                    Some(chain) => match chain.last_mut() {
                        Some(last) if last.seen == part.seen && !part.dips_at(between[0]) => {
                            last.range[1] = part.range[1];
                        }
                        _ => chain.push(part),
                    },
                }
                goes_on = true;
            }
        }
    }
}

/// Lower bound of the distance of a body with a straight side from a facet [m].
pub(super) fn clear_of(side: &Side, seen: &Seen, facet: &MeshFacet) -> f64 {
    let end = seen.wall.tr_mul(&side.end);
    let axis = [seen.centre - end, seen.centre + end];
    let to_segment = |other: &[Vec3; 2]| {
        let (p, q) = nearest_of_segments(&axis, other);
        (q - p).norm()
    };
    let distance = match facet {
        MeshFacet::Face { normal, offset } => {
            let [one, other] = axis.map(|place| place.dot(normal) - offset);
            if one * other < 0.0 { 0.0 } else { one.abs().min(other.abs()) }
        }
        MeshFacet::Edge { from, along, length, .. } => to_segment(&[*from, from + along * *length]),
        MeshFacet::Corner { at } => to_segment(&[*at, *at]),
        MeshFacet::Strip(strip) | MeshFacet::Rim(Rim { strip, .. }) => strip.clear_of(&axis),
    };
    distance - side.radius
}

impl Part {
    /// Whether the depth has a smooth minimum at `s`, which is a break.
    fn dips_at(&self, s: f64) -> bool {
        self.seen.farthest() == Some(s)
    }

    /// Whether a point of the surface below lies in the face of another part, both seen from the middle of a range.
    fn lies_in(&self, face: &Self, range: [f64; 2], side: &Side, seen: &Seen) -> bool {
        let Over::Face(normal) = face.seen.over else { return false };
        let middle = 0.5 * (range[0] + range[1]);
        let [below, on_face] = [self, face].map(|part| part.seen.way_to(middle));
        let flat = FLAT * side.radius;
        (below - on_face).dot(&normal).abs() <= flat && {
            let point = seen.centre + side.end * middle - below;
            seen.mesh.is_on_face(face.seen.facet, &point, flat)
        }
    }

    /// Places in a range where two parts have the same distance.
    ///
    /// The squares of distances are quadratic functions, except for cylinders and cones, whose parts have the same distance where they meet.
    fn crossings(&self, other: &Self, range: [f64; 2]) -> [Option<f64>; 2] {
        if let Over::Round(_) = &self.seen.over {
            return [None; 2];
        }
        let of = |f: fn(&[Vec3; 2]) -> f64| f(&self.seen.way) - f(&other.seen.way);
        let a = of(|way| way[1].norm_squared());
        let b = of(|way| way[0].dot(&way[1]));
        let c = of(|way| way[0].norm_squared());
        let discriminant = b * b - a * c;
        if discriminant.is_nan() || discriminant < 0.0 {
            return [None; 2];
        }
        let q = -(b + discriminant.sqrt().copysign(b));
        let is_there = |s: &f64| range[0] < *s && *s < range[1];
        let [one, two] = [q / a, c / q].map(|s| Some(s).filter(is_there));
        if one.is_some() { [one, two] } else { [two, None] }
    }

    fn add_to(&self, integrals: &mut Integrals, radius: f64) {
        let depth = |s: f64| radius - self.seen.distance(s);
        match &self.seen.over {
            Over::Face(normal) => {
                integrals.add_straight(self.range, self.range.map(depth), &-normal);
            }
            Over::Sharp => integrals.add(self.range, &self.seen.way.map(|way| -way), radius),
            Over::Round(_) => integrals.add_bent(self.range, |s| (depth(s), -self.seen.out(s))),
        }
    }

    /// Derivative of the depth at `s`.
    fn pull(&self, s: f64) -> DepthGradient {
        let into = -self.seen.out(s);
        DepthGradient::from_columns(&[into, into * s])
    }
}

/// A part of a chain without dips.
#[derive(Default)]
struct Lobe {
    integrals: Integrals,
    /// Derivatives of `∫ δ ds` and `∫ δ³ ds`.
    of_depth: DepthGradient,
    of_cube: DepthGradient,
}

/// Boundary between two lobes.
struct Dip {
    /// `m` [m].
    depth: f64,
    of_depth: DepthGradient,
    /// Derivative of the position of the dip.
    of_place: DepthGradient,
}

impl Dip {
    /// The dip between two parts, if there is one.
    fn between(one: &Part, next: &Part, radius: f64) -> Option<Self> {
        let s = one.range[1];
        let depth = radius - one.seen.distance(s);
        let own = one.pull(s);
        if one.dips_at(s) || next.dips_at(s) {
            let (turn, bend) = one.seen.bend(s);
            let of_slope = DepthGradient::from_columns(&[-turn, -one.seen.out(s) - turn * s]);
            let of_place = of_slope / bend;
            return (-bend > LEVEL * radius).then_some(Self { depth, of_depth: own, of_place });
        }
        let slopes = [-one.seen.slope(s), -next.seen.slope(s)];
        if slopes[0] >= 0.0 || slopes[1] <= 0.0 || slopes[1] - slopes[0] < LEVEL * radius {
            return None;
        }
        let of_place = (own - next.pull(s)) / (slopes[1] - slopes[0]);
        Some(Self { depth, of_depth: own + of_place * slopes[0], of_place })
    }
}

/// `D²` of a chain, and its derivative.
fn square_of(lobes: &[Lobe], dips: &[Dip]) -> (f64, DepthGradient) {
    let (mut square, mut of_square) = (0.0, DepthGradient::zeros());
    for (i, own) in lobes.iter().enumerate() {
        // Such a small lobe is rounding only.
        if own.cube() <= 0.0 {
            continue;
        }
        let (mut weight, mut of_weight) = (0.0, DepthGradient::zeros());
        for (j, other) in lobes.iter().enumerate() {
            let between = dips[i.min(j)..i.max(j)].iter();
            let lowest = between.min_by(|one, other| one.depth.total_cmp(&other.depth));
            let (one, of_one) =
                lowest.map_or((1.0, DepthGradient::zeros()), |dip| together(dip, own, other));
            weight += one * other.depth();
            of_weight += other.of_depth * one + of_one * other.depth();
        }
        square += own.cube() / weight;
        of_square += own.of_cube / weight - of_weight * (own.cube() / (weight * weight));
    }
    (square, of_square)
}

/// `ω` of two lobes with a dip between them, and its derivative.
fn together(dip: &Dip, one: &Lobe, other: &Lobe) -> (f64, DepthGradient) {
    if one.cube() <= 0.0 || other.cube() <= 0.0 {
        return (1.0, DepthGradient::zeros());
    }
    let part = |lobe: &Lobe| {
        let inverse = lobe.depth() / lobe.cube();
        let x = dip.depth * dip.depth * inverse;
        if x >= 1.0 {
            return (1.0, DepthGradient::zeros());
        }
        let of_x = dip.of_depth * (2.0 * dip.depth * inverse)
            + (lobe.of_depth / lobe.depth() - lobe.of_cube / lobe.cube()) * x;
        (x * (2.0 - x), of_x * (2.0 * (1.0 - x)))
    };
    let ((u, of_u), (v, of_v)) = (part(one), part(other));
    (1.0 - (1.0 - u) * (1.0 - v), of_u * (1.0 - v) + of_v * (1.0 - u))
}

impl Lobe {
    /// `∫ δ ds` [m].
    const fn depth(&self) -> f64 {
        self.integrals.depth[0]
    }

    /// `∫ δ³ ds` [m³].
    const fn cube(&self) -> f64 {
        self.integrals.depth[3]
    }
}

impl Side {
    /// Lobes of a chain, with the dips between them.
    fn lobes(&self, chain: &Chain) -> (Vec<Lobe>, Vec<Dip>) {
        let (mut lobes, mut dips) = (vec![Lobe::default()], Vec::new());
        for (k, part) in chain.iter().enumerate() {
            let dip = k.checked_sub(1).and_then(|k| Dip::between(&chain[k], part, self.radius));
            if let Some(dip) = dip {
                lobes.push(Lobe::default());
                dips.push(dip);
            }
            if let Some(lobe) = lobes.last_mut() {
                part.add_to(&mut lobe.integrals, self.radius);
            }
        }
        for lobe in &mut lobes {
            let Integrals { normal, moment, .. } = &lobe.integrals;
            lobe.of_depth = DepthGradient::from_columns(&[normal[0], moment[0]]);
            lobe.of_cube = DepthGradient::from_columns(&[normal[1], moment[1]]) * 3.0;
        }
        for (k, Dip { depth, of_place, .. }) in dips.iter().enumerate() {
            for (lobe, sign) in [(k, 1.0), (k + 1, -1.0)] {
                lobes[lobe].of_depth += of_place * (sign * depth);
                lobes[lobe].of_cube += of_place * (sign * depth * depth * depth);
            }
        }
        (lobes, dips)
    }

    /// Thickness along these chains together.
    fn in_chains(&self, chains: &[Chain]) -> Option<Thickness> {
        let (mut squared, mut of_squared) = (0.0, DepthGradient::zeros());
        let mut moments = [0.0; 3];
        let mut foot = Vec3::zeros();
        for chain in chains {
            let (lobes, dips) = self.lobes(chain);
            let of_chain =
                [0, 1, 2].map(|k| lobes.iter().map(|lobe| lobe.integrals.depth[k]).sum::<f64>());
            if of_chain[0] <= 0.0 {
                continue;
            }
            let (square, of_square) = square_of(&lobes, &dips);
            squared += square;
            of_squared += of_square;
            moments.iter_mut().zip(of_chain).for_each(|(sum, of)| *sum += of);
            let mean = of_chain[1] / of_chain[0];
            let part = chain.iter().find(|part| mean <= part.range[1]).or(chain.last())?;
            let (out, distance) = (part.seen.out(mean), part.seen.distance(mean));
            foot += (self.end * mean - out * distance) * of_chain[0];
        }
        let thickness = squared.sqrt();
        if thickness <= THIN * self.radius {
            return None;
        }
        let [depth, mean, square] = moments;
        let variance = (square / depth - (mean / depth) * (mean / depth)).max(0.0);
        let covariance = self.end * self.end.transpose() * variance;
        let force: Vec3 = of_squared.column(0) * 0.5;
        let moment = self.end.cross(&(of_squared.column(1) * 0.5));
        let middle = foot / depth + force.normalize() * (0.5 * thickness);
        Some(Thickness::pressing(thickness, force, moment, middle, covariance))
    }
}
