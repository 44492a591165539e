//! Stretches of a segment over the facets of a surface: for each facet, the range of points that are over it.

use super::{MeshFacet, NONE, Rim, Strip, TriangleMesh};
use crate::math::Vec3;
use crate::shape::facets::Plane;

/// Rounding of directions and lengths.
const ROUNDING: f64 = 1e-15;
/// Number of chords that replace the arc of a rim; their heights are 2e-5 of the radius.
const CHORDS: u32 = 8;

/// A stretch of a segment whose points are over one facet.
///
/// A place on the segment is its middle and `s` times the vector to its end, with `s` from -1 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Number of the facet.
    pub facet: u32,
    /// First and last `s`.
    pub range: [f64; 2],
    /// Vector to the place `s` from the nearest point of the facet, or of the axis of a cylinder or cone: `way[0] + s way[1]` [m].
    pub way: [Vec3; 2],
    /// Kind of the facet.
    pub over: Over,
}

/// Kind of facet below the points of a stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Over {
    /// A face, with its normal on the side from which it is seen.
    Face(Vec3),
    /// An edge or a corner.
    Sharp,
    /// A cylinder or a cone.
    Round(Round),
}

/// A cylinder or a cone below a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Round {
    /// Side of the segment: 1 inside, -1 outside.
    pub side: f64,
    /// Height of the place `s` along the axis: `height[0] + s height[1]` [m].
    pub height: [f64; 2],
    /// Radius at that height: `radius[0] + s radius[1]` [m].
    pub radius: [f64; 2],
    /// Unit vector along the axis.
    pub axis: Vec3,
    /// Growth of the radius along the axis [-].
    pub slope: f64,
}

impl Strip {
    /// The whole surface seen from inside, and the vector from its axis.
    fn seen_from(&self, middle: &Vec3, end: &Vec3) -> (Round, [Vec3; 2]) {
        let Self { from, axis, radius, slope, .. } = *self;
        let from = middle - from;
        let height = [from.dot(&axis), end.dot(&axis)];
        let radius = [radius + slope * height[0], slope * height[1]];
        let way = [from - axis * height[0], end - axis * height[1]];
        (Round { side: 1.0, height, radius, axis, slope }, way)
    }

    /// Least distance of a segment from the surface, continued beyond its borders [m].
    pub fn clear_of(&self, [from, to]: &[Vec3; 2]) -> f64 {
        let (round, way) = self.seen_from(&((from + to) * 0.5), &((to - from) * 0.5));
        let stretch = Stretch { facet: 0, range: [-1.0, 1.0], way, over: Over::Round(round) };
        let least = stretch.distance(-1.0).min(stretch.distance(1.0));
        let most = stretch.distance(stretch.nearest_to_axis(round.radius[1]).clamp(-1.0, 1.0));
        least.max(-most).max(0.0)
    }
}

impl Round {
    /// Distance of a place from the surface, for its vector from the axis [m].
    fn distance(&self, way: &Vec3, s: f64) -> f64 {
        self.side * (self.radius[0] + s * self.radius[1] - way.norm()) / self.steep()
    }

    /// Distance across the axis over the distance from the surface.
    fn steep(&self) -> f64 {
        (1.0 + self.slope * self.slope).sqrt()
    }
}

impl Stretch {
    /// Vector to the place `s` from the nearest point of the facet, or from the axis of a cylinder or cone [m].
    pub fn way_to(&self, s: f64) -> Vec3 {
        self.way[0] + self.way[1] * s
    }

    /// Distance of the place `s` from the surface [m]; negative below a face, and on the other side of a cylinder or cone.
    pub fn distance(&self, s: f64) -> f64 {
        let way = self.way_to(s);
        match &self.over {
            Over::Face(normal) => way.dot(normal),
            Over::Sharp => way.norm(),
            Over::Round(round) => round.distance(&way, s),
        }
    }

    /// Unit vector out of the surface.
    pub fn out(&self, s: f64) -> Vec3 {
        match &self.over {
            Over::Face(normal) => *normal,
            Over::Sharp => unit(&self.way_to(s)),
            Over::Round(round) => {
                (round.axis * round.slope - unit(&self.way_to(s))) * (round.side / round.steep())
            }
        }
    }

    /// Derivative of the distance with respect to `s` [m].
    pub fn slope(&self, s: f64) -> f64 {
        let along = self.out(s).dot(&self.way[1]);
        match &self.over {
            Over::Face(_) | Over::Sharp => along,
            Over::Round(round) => along + round.side * round.radius[1] / round.steep(),
        }
    }

    /// Derivatives with respect to `s` of the unit vector out of a cylinder or cone, and of the slope of the distance.
    pub fn bend(&self, s: f64) -> (Vec3, f64) {
        let Over::Round(round) = &self.over else { return Default::default() };
        let way = self.way_to(s);
        let across = unit(&way);
        let turn = (self.way[1] - across * across.dot(&self.way[1]))
            * (-round.side / round.steep() / way.norm());
        (turn, turn.dot(&self.way[1]))
    }

    /// Place of a local maximum of the distance from a cylinder or cone, seen from inside.
    pub fn farthest(&self) -> Option<f64> {
        let Over::Round(Round { side: 1.0, radius, .. }) = &self.over else { return None };
        let place = self.nearest_to_axis(radius[1]);
        (self.range[0] < place && place < self.range[1]).then_some(place)
    }

    /// Minimum of the length of the vector less `growth` times `s`, which is a convex function.
    fn nearest_to_axis(&self, growth: f64) -> f64 {
        let square = self.way[1].norm_squared();
        if growth * growth >= square {
            // Also where nothing changes.
            return if growth == 0.0 { 0.0 } else { f64::INFINITY.copysign(growth) };
        }
        let nearest = -self.way[0].dot(&self.way[1]) / square;
        let rest = square * (square - growth * growth);
        nearest + growth * self.way_to(nearest).norm() / rest.sqrt()
    }

    /// Parts of the stretch that are nearer to the surface than this [m], in their order.
    pub fn nearer_than(&self, distance: f64) -> [Option<[f64; 2]>; 2] {
        let [low, high] = self.range;
        let some = |[from, to]: [f64; 2]| Some([from, to]).filter(|_| from < to);
        match &self.over {
            Over::Face(normal) => {
                let [start, slope] = self.way.map(|way| way.dot(normal));
                let mut range = self.range;
                keep(&mut range, distance - start, -slope);
                [some(range), None]
            }
            Over::Sharp => [self.within([distance, 0.0]).and_then(some), None],
            Over::Round(round) => {
                let [start, growth] = round.radius;
                let within = self.within([start - round.side * distance * round.steep(), growth]);
                if round.side < 0.0 {
                    return [within.and_then(some), None];
                }
                let Some([from, to]) = within else { return [some(self.range), None] };
                [some([low, from]), some([to, high])]
            }
        }
    }

    /// Range in which the length of the vector is less than `radius[0] + s radius[1]`.
    ///
    /// Newton's method from the ends never overshoots, because the difference is a convex function.
    fn within(&self, [radius, growth]: [f64; 2]) -> Option<[f64; 2]> {
        let [low, high] = self.range;
        let beyond = |s: f64| self.way_to(s).norm() - radius - s * growth;
        let middle = self.nearest_to_axis(growth).clamp(low, high);
        let is_within = beyond(middle) < 0.0;
        // True for NaN as well.
        if !is_within {
            return None;
        }
        let root = |mut s: f64| {
            for _ in 0..60 {
                let slope = unit(&self.way_to(s)).dot(&self.way[1]) - growth;
                let next = s - beyond(s) / slope;
                let goes_on =
                    (next - s) * (middle - s) > 0.0 && (middle - next) * (middle - s) > 0.0;
                if beyond(s) <= 0.0 || !goes_on {
                    break;
                }
                s = next;
            }
            s
        };
        Some([root(low), root(high)])
    }
}

/// Direction of a vector; zero for one of no length.
fn unit(vector: &Vec3) -> Vec3 {
    vector.try_normalize(0.0).unwrap_or_default()
}

impl TriangleMesh {
    /// Stretches of a segment from `middle - end` to `middle + end` that may be within a distance of the surface, in the order of its facets.
    ///
    /// They extend beyond the borders of facets by `tolerance`. All lengths are in m, in the axes of the wall. A face, a cylinder or a cone is seen
    /// from the side of the stretch; if the stretch passes through it, from the side of the middle.
    pub fn stretches(
        &self,
        middle: &Vec3,
        end: &Vec3,
        distance: f64,
        tolerance: f64,
        stretches: &mut Vec<Stretch>,
    ) {
        stretches.clear();
        let reach = end.abs().add_scalar(distance + self.bulge);
        let mut near = Vec::new();
        self.grid.for_each_in(&(middle - reach), &(middle + reach), |triangle| near.push(triangle));
        near.sort_unstable();
        near.dedup();

        let line = Line { middle, end, distance, tolerance };
        let mut over_faces = Vec::new();
        let mut others = Vec::new();
        for triangle in &near {
            let triangle = &self.triangles[*triangle as usize];
            let [face, edges @ ..] = triangle.facets;
            others.extend(edges.into_iter().filter(|&edge| edge != NONE));
            others.extend(triangle.corners.iter().filter_map(|&k| self.facets.corner_of(k)));
            if !self.facets.strips.is_empty() {
                others.push(face);
                continue;
            }
            let (_, height, slope) = self.height_over(&line, face);
            if height.abs() - slope.abs() >= distance {
                continue;
            }
            let range = line.over(&self.corners(triangle));
            over_faces.extend(range.map(|range| (face, range)));
        }
        over_faces.sort_unstable_by(|(one, a), (other, b)| {
            one.cmp(other).then_with(|| a[0].total_cmp(&b[0]))
        });
        // The triangles of a face are merged, however it is cut.
        let mut last: Option<(u32, [f64; 2])> = None;
        for (face, range) in over_faces {
            match &mut last {
                Some((of, [_, to])) if *of == face && range[0] <= *to => *to = to.max(range[1]),
                _ => {
                    stretches.extend(last.map(|(face, range)| self.on_face(&line, face, range)));
                    last = Some((face, range));
                }
            }
        }
        stretches.extend(last.map(|(face, range)| self.on_face(&line, face, range)));

        others.sort_unstable();
        others.dedup();
        for facet in others {
            if let MeshFacet::Rim(rim) = self.facet(facet) {
                stretches.extend(line.on_rim(facet, &rim));
            } else {
                stretches.extend(self.on_other(&line, facet));
            }
        }
    }

    /// Normal of a face, height of the middle over it, and rise from the middle to the end.
    fn height_over(&self, line: &Line, face: u32) -> (Vec3, f64, f64) {
        let Plane { normal, offset } = self.facets.faces[face as usize];
        (normal, line.middle.dot(&normal) - offset, line.end.dot(&normal))
    }

    fn on_face(&self, line: &Line, facet: u32, range: [f64; 2]) -> Stretch {
        let (normal, height, slope) = self.height_over(line, facet);
        let [from, to] = range.map(|s| height + s * slope);
        let seen = if from * to > 0.0 { from } else { height };
        let sign = if seen < 0.0 { -1.0 } else { 1.0 };
        Stretch {
            facet,
            range,
            way: [normal * height, normal * slope],
            over: Over::Face(normal * sign),
        }
    }

    /// The stretch over an edge, a corner or a strip.
    fn on_other(&self, line: &Line, facet: u32) -> Option<Stretch> {
        let Line { middle, end, tolerance, .. } = *line;
        let mut range = [-1.0, 1.0];
        let mut over = Over::Sharp;
        let way = match self.facet(facet) {
            MeshFacet::Edge { from, along, length, first, quarter, opening } => {
                let from = middle - from;
                let [place, slope] = [from.dot(&along), end.dot(&along)];
                let way = [from - along * place, end - along * slope];
                if !line.is_near(way) {
                    return None;
                }
                let (sine, cosine) = libm::sincos(opening);
                let last = first * sine - quarter * cosine;
                keep(&mut range, place + tolerance, slope);
                keep(&mut range, length - place + tolerance, -slope);
                for within in [quarter, last] {
                    keep(&mut range, way[0].dot(&within) + tolerance, way[1].dot(&within));
                }
                way
            }
            MeshFacet::Corner { at } => {
                let way = [middle - at, *end];
                if !line.is_near(way) {
                    return None;
                }
                for along in self.edges_at(facet) {
                    keep(&mut range, tolerance - way[0].dot(&along), -way[1].dot(&along));
                }
                way
            }
            MeshFacet::Strip(strip) => {
                let Strip { length, first, quarter, opening, .. } = strip;
                let (mut round, way) = strip.seen_from(middle, end);
                let (sine, cosine) = libm::sincos(opening);
                let last = first * sine - quarter * cosine;
                // The borders of a wide surface are rounded.
                let tolerance = tolerance + ROUNDING * round.radius[0].abs();
                for within in [quarter, last] {
                    keep(&mut range, way[0].dot(&within) + tolerance, way[1].dot(&within));
                }
                let within = |s: f64| round.distance(&(way[0] + way[1] * s), s);
                // Nearest point of the surface where the segment is at the largest distance.
                let [place, rise] = round.height;
                let beside = line.distance * round.slope / round.steep();
                let between_ends = |side: f64| {
                    let (mut range, foot) = (range, place - side * beside);
                    keep(&mut range, foot + tolerance, rise);
                    keep(&mut range, length - foot + tolerance, -rise);
                    range
                };
                // Beyond an end it may pass to the other side.
                let is_on = |side: &f64| {
                    let range = between_ends(*side);
                    range[0] < range[1] && range.iter().all(|&s| within(s) * side > 0.0)
                };
                let side = [1.0, -1.0].into_iter().find(is_on);
                let side = side.unwrap_or_else(|| within(0.0).signum());
                range = between_ends(side);
                round.side = side;
                over = Over::Round(round);
                way
            }
            MeshFacet::Face { .. } | MeshFacet::Rim(_) => return None,
        };
        (range[0] < range[1]).then_some(Stretch { facet, range, way, over })
    }
}

/// A segment, the largest distance of facets, and the extent of stretches beyond borders.
struct Line<'a> {
    middle: &'a Vec3,
    end: &'a Vec3,
    distance: f64,
    tolerance: f64,
}

impl Line<'_> {
    /// Whether a vector is shorter than the distance anywhere on the segment.
    fn is_near(&self, way: [Vec3; 2]) -> bool {
        let square = way[1].norm_squared();
        let nearest = if square > 0.0 { -way[0].dot(&way[1]) / square } else { 0.0 };
        let nearest = way[0] + way[1] * nearest.clamp(-1.0, 1.0);
        nearest.norm_squared() < self.distance * self.distance
    }

    /// Stretches over chords of a rim, beyond the surface.
    fn on_rim(&self, facet: u32, rim: &Rim) -> impl Iterator<Item = Stretch> {
        let from_centre = self.middle - rim.centre();
        let tolerance = self.tolerance + ROUNDING * rim.radius();
        let at = move |k: u32| rim.tangent(rim.strip.opening * (f64::from(k) / f64::from(CHORDS)));
        (0..CHORDS).filter_map(move |k| {
            let (begin, end) = (at(k), at(k + 1));
            let along = (end.at - begin.at).normalize();
            let from = self.middle - begin.at;
            let way = [from - along * from.dot(&along), self.end - along * self.end.dot(&along)];
            if !self.is_near(way) {
                return None;
            }
            let mut range = [-1.0, 1.0];
            for within in [begin.along, -end.along] {
                keep(&mut range, from_centre.dot(&within) + tolerance, self.end.dot(&within));
            }
            let out = begin.quarter + end.quarter;
            keep(&mut range, way[0].dot(&out) + self.tolerance, way[1].dot(&out));
            (range[0] < range[1]).then_some(Stretch { facet, range, way, over: Over::Sharp })
        })
    }

    /// Part of the segment whose points are over a triangle.
    fn over(&self, corners: &[Vec3; 3]) -> Option<[f64; 2]> {
        let [a, b, c] = corners;
        let normal = (b - a).cross(&(c - a));
        let mut range = [-1.0, 1.0];
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let inwards = normal.cross(&(to - from)).normalize();
            let start = (self.middle - from).dot(&inwards) + self.tolerance;
            keep(&mut range, start, self.end.dot(&inwards));
        }
        (range[0] < range[1]).then_some(range)
    }
}

/// Keeps the part of a range with `start + s slope >= 0`.
fn keep(range: &mut [f64; 2], start: f64, slope: f64) {
    if slope > 0.0 {
        range[0] = range[0].max(-start / slope);
    } else if slope < 0.0 {
        range[1] = range[1].min(-start / slope);
    } else if start < 0.0 {
        range[1] = f64::NEG_INFINITY;
    }
}
