//! What the points of a segment see of a surface: of each facet the stretch of the segment whose points stand over it.

use super::{MeshFacet, NONE, TriangleMesh};
use crate::math::Vec3;

/// A stretch of a segment whose points stand over one facet. A place on the segment is its middle and `s` times the way to its end, `s` from -1
/// to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// The facet.
    pub facet: u32,
    /// The first and the last `s`.
    pub range: [f64; 2],
    /// From the nearest point of the facet to the place `s`: `way[0] + s way[1]` [m].
    pub way: [Vec3; 2],
    /// Of a face its normal, on the side from which it is seen.
    pub normal: Option<Vec3>,
}

impl Stretch {
    /// The part of it that is lower than this along a normal [m].
    pub fn lower_than(&self, normal: &Vec3, height: f64) -> Option<[f64; 2]> {
        let [start, slope] = self.way.map(|way| way.dot(normal));
        let mut range = self.range;
        keep(&mut range, height - start, -slope);
        (range[0] < range[1]).then_some(range)
    }
}

impl TriangleMesh {
    /// The stretches of a segment from `middle - end` to `middle + end` whose points may be within a distance of the surface, in the order of
    /// its facets. They reach over the borders of facets by `tolerance`. All lengths in m, in the axes of the wall.
    ///
    /// A face is seen from the side on which the stretch is, and that on which the middle is if the stretch goes through its plane.
    pub fn stretches(
        &self,
        middle: &Vec3,
        end: &Vec3,
        distance: f64,
        tolerance: f64,
        stretches: &mut Vec<Stretch>,
    ) {
        stretches.clear();
        let reach = end.abs().add_scalar(distance);
        let mut near = Vec::new();
        self.grid.for_each_in(&(middle - reach), &(middle + reach), |triangle| near.push(triangle));
        near.sort_unstable();
        near.dedup();

        let line = Line { middle, end, distance, tolerance };
        let mut over_faces = Vec::new();
        let mut others = Vec::new();
        for triangle in &near {
            let triangle = &self.triangles[*triangle as usize];
            let [face, beside @ ..] = triangle.facets;
            others.extend(beside.into_iter().filter(|&facet| facet != NONE));
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
        // However a face is cut, it is seen as one.
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
        stretches.extend(others.into_iter().filter_map(|facet| self.on_other(&line, facet)));
    }

    /// The normal of a face, the height of the middle over it, and how much higher the end is.
    fn height_over(&self, line: &Line, face: u32) -> (Vec3, f64, f64) {
        let MeshFacet::Face { normal, offset } = &self.facets[face as usize] else {
            unreachable!("a triangle has a face")
        };
        (*normal, line.middle.dot(normal) - offset, line.end.dot(normal))
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
            normal: Some(normal * sign),
        }
    }

    /// The stretch that stands over an edge or a corner.
    fn on_other(&self, line: &Line, facet: u32) -> Option<Stretch> {
        let Line { middle, end, tolerance, .. } = *line;
        let mut range = [-1.0, 1.0];
        let way = match &self.facets[facet as usize] {
            MeshFacet::Edge { from, along, length, first, quarter, opening } => {
                let from = middle - from;
                let [place, slope] = [from.dot(along), end.dot(along)];
                let way = [from - along * place, end - along * slope];
                if !line.is_near(way) {
                    return None;
                }
                let (sine, cosine) = libm::sincos(*opening);
                let last = first * sine - quarter * cosine;
                keep(&mut range, place + tolerance, slope);
                keep(&mut range, length - place + tolerance, -slope);
                for within in [quarter, &last] {
                    keep(&mut range, way[0].dot(within) + tolerance, way[1].dot(within));
                }
                way
            }
            MeshFacet::Corner { at, edges } => {
                let way = [middle - at, *end];
                if !line.is_near(way) {
                    return None;
                }
                for along in edges {
                    keep(&mut range, tolerance - way[0].dot(along), -way[1].dot(along));
                }
                way
            }
            MeshFacet::Face { .. } | MeshFacet::Strip(_) => return None,
        };
        (range[0] < range[1]).then_some(Stretch { facet, range, way, normal: None })
    }
}

/// A segment, how near facets must be, and how far over their borders they reach.
struct Line<'a> {
    middle: &'a Vec3,
    end: &'a Vec3,
    distance: f64,
    tolerance: f64,
}

impl Line<'_> {
    /// Does a way come so near to zero on the segment?
    fn is_near(&self, way: [Vec3; 2]) -> bool {
        let square = way[1].norm_squared();
        let nearest = if square > 0.0 { -way[0].dot(&way[1]) / square } else { 0.0 };
        let nearest = way[0] + way[1] * nearest.clamp(-1.0, 1.0);
        nearest.norm_squared() < self.distance * self.distance
    }

    /// The part of it whose points stand over a triangle.
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

/// Leaves of a range what has `start + s slope >= 0`.
fn keep(range: &mut [f64; 2], start: f64, slope: f64) {
    if slope > 0.0 {
        range[0] = range[0].max(-start / slope);
    } else if slope < 0.0 {
        range[1] = range[1].min(-start / slope);
    } else if start < 0.0 {
        range[1] = f64::NEG_INFINITY;
    }
}
