//! Outlines of walls in side views: edges of meshes, cylinders and cones at which the surface turns away, its rims, and planes
//! that are seen edge-on. The sides of a box are left out, as views draw boxes.

use crate::math::Vec3;
use crate::output::header::Header;
use crate::post::region::ACROSS;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Both ends of a line in the view: x and z [m].
type Line = [[f64; 2]; 2];

/// Corner of a triangle as bits, which neighbours share.
type Corner = [u64; 3];

/// Outlines of all walls of a snapshot.
#[derive(Clone, Debug, Default)]
pub(super) struct Walls {
    lines: Vec<Line>,
    /// Planes seen edge-on: a point and a direction, and planes of the same wall that end them, each a point and a normal.
    planes: Vec<Plane>,
}

#[derive(Clone, Debug)]
struct Plane {
    point: Vec3,
    along: Vec3,
    ends: Vec<(Vec3, Vec3)>,
}

impl Walls {
    /// Largest sine of the angle between a face and the view at which it is seen edge-on.
    const EDGE_ON: f64 = 1e-3;

    pub(super) fn of(header: &Header) -> Self {
        /// Ends of an edge, and the sides of the triangles beside it that are seen.
        type Edge = (Line, Vec<i8>);
        let mut edges: BTreeMap<(usize, [Corner; 2]), Edge> = BTreeMap::new();
        for (wall, corners) in header.triangles_in_place() {
            let [a, b, c] = corners;
            let normal = (b - a).cross(&(c - a));
            let turned = normal.y / normal.norm();
            let side = if turned.abs() < Self::EDGE_ON { 0 } else { turned.signum() as i8 };
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let mut ends =
                    [from, to].map(|corner| [0, 1, 2].map(|k| (corner[k] + 0.0).to_bits()));
                ends.sort_unstable();
                let line = [from, to].map(|corner| [corner.x, corner.z]);
                edges.entry((wall, ends)).or_insert((line, Vec::new())).1.push(side);
            }
        }
        let is_seen =
            |(_, sides): &Edge| sides.len() == 1 || sides.iter().any(|side| *side != sides[0]);
        let lines = edges.into_values().filter(is_seen).map(|(line, _)| line).collect();
        let mut planes = Vec::new();
        for wall in &header.walls {
            let all = wall.planes();
            for (k, &(point, normal)) in all.iter().enumerate() {
                let of_box = all.len() == 1 && normal.amax() > ACROSS;
                if normal.y.abs() < Self::EDGE_ON && !of_box {
                    let along = Vec3::new(-normal.z, 0.0, normal.x).normalize();
                    let others = all.iter().enumerate().filter(|(other, _)| *other != k);
                    planes.push(Plane {
                        point,
                        along,
                        ends: others.map(|(_, end)| *end).collect(),
                    });
                }
            }
        }
        Self { lines, planes }
    }

    /// Ranges along x and z, widened to the lines, but at most by the longer range on each side [m].
    pub(super) fn around(&self, low: &mut [f64; 2], high: &mut [f64; 2]) {
        let most = (high[0] - low[0]).max(high[1] - low[1]);
        let limits = [0, 1].map(|k| [low[k] - most, high[k] + most]);
        for end in self.lines.as_flattened() {
            for k in 0..2 {
                low[k] = low[k].min(end[k]).max(limits[k][0]);
                high[k] = high[k].max(end[k]).min(limits[k][1]);
            }
        }
    }

    /// Draws the parts of all lines within these ranges; `place` converts metres to pixels.
    pub(super) fn draw(
        &self,
        [low, high]: [[f64; 2]; 2],
        place: impl Fn(f64, f64) -> [f64; 2],
        out: &mut String,
    ) {
        let reach = (high[0] - low[0]).hypot(high[1] - low[1]);
        let middle = Vec3::new(0.5 * (low[0] + high[0]), 0.0, 0.5 * (low[1] + high[1]));
        let of_planes = self.planes.iter().filter_map(|plane| plane.line(&middle, reach));
        let lines = self.lines.iter().copied().chain(of_planes);
        let mut path = String::new();
        for line in lines.filter_map(|line| clipped(line, [low, high])) {
            let [[x0, y0], [x1, y1]] = line.map(|[x, z]| place(x, z));
            if (x1 - x0).hypot(y1 - y0) >= 0.05 {
                let _ = write!(path, "M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}");
            }
        }
        if !path.is_empty() {
            let style = r##"class="walls" fill="none" stroke="#5B6672" stroke-width="1.2""##;
            let _ = writeln!(out, r#"<path {style} d="{path}"/>"#);
        }
    }
}

impl Plane {
    /// The plane as a line about the foot of `middle`, as far as other planes of its wall leave it.
    fn line(&self, middle: &Vec3, reach: f64) -> Option<Line> {
        let foot = (middle - self.point).dot(&self.along);
        let (mut from, mut to) = (foot - 2.0 * reach, foot + 2.0 * reach);
        for (point, normal) in &self.ends {
            let (slope, height) = (self.along.dot(normal), (self.point - point).dot(normal));
            if slope.abs() > 1e-12 {
                let at = -height / slope;
                if slope > 0.0 { from = from.max(at) } else { to = to.min(at) }
            }
        }
        let end = |at: f64| self.point + self.along * at;
        (from < to).then(|| [from, to].map(|at| [end(at).x, end(at).z]))
    }
}

/// Part of a line within ranges along x and z.
fn clipped([from, to]: Line, [low, high]: [[f64; 2]; 2]) -> Option<Line> {
    let (mut begin, mut end) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        let way = to[k] - from[k];
        for (room, way) in [(from[k] - low[k], -way), (high[k] - from[k], way)] {
            if way > 0.0 {
                end = end.min(room / way);
            } else if way < 0.0 {
                begin = begin.max(room / way);
            } else if room < 0.0 {
                return None;
            }
        }
    }
    let at = |share: f64| [0, 1].map(|k| from[k] + share * (to[k] - from[k]));
    (begin <= end).then(|| [at(begin), at(end)])
}
