//! Picture of the packing from the side: an orthographic view along +y (x to the right, z up). Every particle is drawn as
//! its silhouette, exactly for an ellipsoid, to a hundredth of its size for other shapes.
//!
//! The silhouette of a convex body is the convex hull of its support points along directions across the view. The
//! silhouette of an ellipsoid with the matrix `A` (see [`crate::shape::Form`]) is the ellipse of the 2 × 2 block of `A`. It
//! is written as an SVG ellipse, because a polygon is five times as long.
//!
//! Visible faces are drawn, too, unless there are very many particles: for rounded bodies the flat parts.

use super::side::scale_bar;
use super::walls::Walls;
use crate::contact::Posed;
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::output::header::Header;
use crate::output::tables::ParticleTable;
use crate::post::PostError;
use crate::post::region::{Bounds, Members, Turned};
use crate::shape::{Core, Shape};
use nalgebra::{Matrix2, Vector2};
use std::cmp::Ordering;
use std::fmt::Write;

/// The particles nearest to the viewer.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    walls: Walls,
    /// Whether the picture is widened to the walls.
    is_whole: bool,
    grains: Vec<Grain>,
    /// Nearest of the particles that were left out: none behind it is needed.
    left_out: Option<Depth>,
}

#[derive(Clone, Debug)]
struct Grain {
    depth: Depth,
    /// x and z of the centre [m].
    centre: [f64; 2],
    outline: Outline,
    /// Visible faces.
    faces: Vec<Face>,
    contacts: i32,
}

/// Order by the y of the centre [m], then by id, so that a picture does not depend on the order of rows.
#[derive(Clone, Copy, Debug)]
struct Depth(f64, GlobalId);

impl Depth {
    fn nearer(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

/// Silhouette about the centre of a particle.
#[derive(Clone, Debug)]
enum Outline {
    Ellipse {
        /// The longer one first [m].
        semi_axes: [f64; 2],
        /// Angle from x to the longer one, towards z [degrees].
        angle: f64,
    },
    /// Corners (x, z), counter-clockwise [m].
    Polygon(Vec<Vector2<f64>>),
}

impl Outline {
    fn of(body: &Posed) -> Self {
        if !body.shape.kind().is_ellipsoidal() {
            return Self::Polygon(polygon(body));
        }
        let [xx, _, zz, _, xz, _] = body.form();
        let mut eigen = Matrix2::new(xx, xz, xz, zz).symmetric_eigenvalues();
        if eigen.x < eigen.y {
            eigen.swap_rows(0, 1);
        }
        Self::Ellipse {
            semi_axes: [eigen.x.max(0.0).sqrt(), eigen.y.max(0.0).sqrt()],
            angle: 0.5 * (2.0 * xz).atan2(xx - zz).to_degrees(),
        }
    }

    /// Largest distance from the centre [m].
    fn reach(&self) -> f64 {
        match self {
            Self::Ellipse { semi_axes: [long, _], .. } => *long,
            Self::Polygon(corners) => corners.iter().map(Vector2::norm).fold(0.0, f64::max),
        }
    }
}

/// Silhouette of a body: its ends along x and z, and the farthest point beyond each side of the polygon. Sides that bulge
/// by less than a hundredth of the body's size have no further point.
fn polygon(body: &Posed) -> Vec<Vector2<f64>> {
    const BULGE: f64 = 0.01;
    let farthest = |x: f64, z: f64| {
        let point = body.support(&Vec3::new(x, 0.0, z));
        Vector2::new(point.x, point.z)
    };
    let ends = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)].map(|(x, z)| farthest(x, z));
    let least = BULGE * body.bounding_radius();
    let mut corners = Vec::new();
    // Sides still to be examined, the next one last.
    let mut sides: Vec<_> = (0..4).rev().map(|k| [ends[k], ends[(k + 1) % 4]]).collect();
    while let Some([from, to]) = sides.pop() {
        let side = to - from;
        if side.norm() <= least {
            corners.push(from);
            continue;
        }
        let normal = Vector2::new(side.y, -side.x).normalize();
        let out = farthest(normal.x, normal.y);
        if (out - from).dot(&normal) > least {
            sides.extend([[out, to], [from, out]]);
        } else {
            corners.push(from);
        }
    }
    corners
}

/// A flat part of a body, seen from the side.
#[derive(Clone, Debug)]
struct Face {
    /// x and z from the centre of the particle [m].
    corners: Vec<Vector2<f64>>,
    /// Darkness: 0 if it faces the light, 1 if it turns away.
    shade: f64,
}

/// Largest sine of the angle between a face and the view at which it counts as seen edge-on.
const EDGE_ON: f64 = 0.01;

impl Face {
    /// Faces that the viewer sees.
    fn seen(body: &Posed) -> Vec<Self> {
        let Core::Hull(hull) = body.shape.core() else { return Vec::new() };
        let facets = hull.facets();
        let light = Vec3::new(-0.4, -0.7, 0.6);
        let mut start = 0;
        let mut seen = Vec::new();
        for (&end, plane) in facets.ends().iter().zip(facets.planes()) {
            let corners = &facets.corners()[start..end as usize];
            start = end as usize;
            let normal = body.frame * plane.normal;
            if normal.y < -EDGE_ON {
                let outwards = normal * body.shape.margin();
                let place = |&corner: &u32| {
                    let inner = body.frame * facets.vertices()[corner as usize];
                    let point = (inner + outwards) * body.scale;
                    Vector2::new(point.x, point.z)
                };
                let shade = 1.0 - normal.dot(&light).max(0.0);
                seen.push(Self { corners: corners.iter().map(place).collect(), shade });
            }
        }
        seen
    }
}

impl Picture {
    /// Picture without particles yet, with the walls of a snapshot; of the whole snapshot, or of a region.
    pub fn of(header: &Header, is_whole: bool) -> Self {
        Self { walls: Walls::of(header), is_whole, ..Self::default() }
    }

    /// Largest number of particles drawn: those with the smallest y.
    pub const LIMIT: usize = 5000;

    /// Largest number of particles drawn with faces: a file of some megabytes.
    const MOST_WITH_FACES: usize = 1000;

    /// Adds the particles that are in the region.
    ///
    /// # Errors
    /// If `members` does not have the particle.
    pub fn add(
        &mut self,
        header: &Header,
        particles: &ParticleTable,
        members: &Members,
    ) -> Result<(), PostError> {
        for (row, &id) in particles.id.iter().enumerate() {
            if members.holds(id)? {
                let body = Turned::of(header, particles, row);
                let contacts = particles.coordination.get(row).copied().unwrap_or(0);
                self.push(id, &particles.position[row], &body.posed(), contacts);
            }
        }
        Ok(())
    }

    /// Adds a body with its centre [m] and number of contacts; for a union each piece.
    pub fn push(&mut self, id: GlobalId, centre: &Vec3, body: &Posed, contacts: i32) {
        if let Shape::Union(union) = body.shape {
            for piece in union.pieces() {
                let frame = body.frame * piece.rotation.to_rotation_matrix().into_inner();
                let at = centre + body.frame * piece.centre * body.scale;
                let piece = Posed { scale: body.scale, ..Posed::new(&piece.shape, &frame) };
                self.push(id, &at, &piece, contacts);
            }
            return;
        }
        let depth = Depth(centre.y, id);
        if self.left_out.is_some_and(|other| depth.nearer(&other).is_gt()) {
            return;
        }
        self.grains.push(Grain {
            depth,
            centre: [centre.x, centre.z],
            outline: Outline::of(body),
            faces: Face::seen(body),
            contacts,
        });
        if self.grains.len() >= 2 * Self::LIMIT {
            self.keep_nearest();
        }
    }

    fn keep_nearest(&mut self) {
        if self.grains.len() > Self::LIMIT {
            self.grains.select_nth_unstable_by(Self::LIMIT, |a, b| a.depth.nearer(&b.depth));
            self.left_out = Some(self.grains[Self::LIMIT].depth);
            self.grains.truncate(Self::LIMIT);
        }
    }

    /// The drawing, far particles first. Colours darken with the number of contacts.
    pub fn svg(mut self, bounds: Option<&Bounds>) -> String {
        let frame = self.frame(bounds);
        self.svg_in(&frame)
    }

    /// Sorts the particles, far ones first, and finds the frame around them.
    fn frame(&mut self, bounds: Option<&Bounds>) -> Frame {
        self.keep_nearest();
        self.grains.sort_by(|a, b| b.depth.nearer(&a.depth));
        Frame::around(self, bounds)
    }

    fn svg_in(&self, frame: &Frame) -> String {
        let mut out = String::new();
        frame.open(&mut out);
        let with_faces = self.grains.len() <= Self::MOST_WITH_FACES;
        for grain in &self.grains {
            frame.draw(grain, &mut out);
            if with_faces {
                frame.draw_faces(grain, &mut out);
            }
        }
        out.push_str("</g>\n");
        self.walls.draw(frame.ranges(), |x, z| frame.place(x, z).into(), &mut out);
        frame.legend(&mut out);
        out.push_str("</svg>\n");
        out
    }
}

/// Pictures beside each other at one scale, with a common floor, each under its title.
pub fn side_by_side(pictures: Vec<(String, Picture, Option<Bounds>)>) -> String {
    const HEAD: f64 = 30.0;
    let framed = pictures.into_iter().map(|(title, mut picture, bounds)| {
        let frame = picture.frame(bounds.as_ref());
        (title, picture, frame)
    });
    let mut framed: Vec<_> = framed.collect();
    let scale = framed.iter().map(|(_, _, frame)| frame.scale).fold(f64::INFINITY, f64::min);
    for (_, _, frame) in &mut framed {
        frame.scale_to(scale);
    }
    let width: f64 = framed.iter().map(|(_, _, frame)| frame.width).sum();
    let tallest = framed.iter().map(|(_, _, frame)| frame.height).fold(0.0, f64::max);
    let height = tallest + HEAD;
    let mut out = format!(
        r##"<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0}" height="{height:.0}" viewBox="0 0 {width:.1} {height:.1}">
<rect width="100%" height="100%" fill="#FFFFFF"/>
"##
    );
    let mut left = 0.0;
    for (title, picture, frame) in framed {
        let top = height - frame.height;
        let _ = write!(
            out,
            r##"<text x="{:.1}" y="20" font-family="sans-serif" font-size="14" fill="#1F2933">{title}</text>
<g transform="translate({left:.1} {top:.1})">
{}</g>
"##,
            left + Frame::MARGIN,
            picture.svg_in(&frame)
        );
        left += frame.width;
    }
    out.push_str("</svg>\n");
    out
}

/// Colours, each for two numbers of contacts: 0-1 (rattlers), 2-3, and so on to 12 and more.
const TONES: [(&str, &str); 7] = [
    ("#FDE9B8", "#E3B23C"),
    ("#DDEBF5", "#A9CBE3"),
    ("#BBD6EA", "#7FB0D4"),
    ("#93BEDD", "#5593C2"),
    ("#69A1CC", "#3275AB"),
    ("#4483B5", "#1D5A8E"),
    ("#2B6598", "#0F3F69"),
];

fn tone_of(contacts: i32) -> usize {
    (contacts.max(0) as usize / 2).min(TONES.len() - 1)
}

/// Conversion from metres to the units of the drawing, which are pixels.
struct Frame {
    /// Lowest x and highest z [m].
    left: f64,
    top: f64,
    /// Extent to the highest x and to the lowest z [m].
    extent: [f64; 2],
    /// Pixels per metre.
    scale: f64,
    /// Space on the left that centres a narrow packing [px].
    inset: f64,
    width: f64,
    height: f64,
    /// Sides of the region, if any, in metres: x and z.
    sides: Option<[[f64; 2]; 2]>,
}

impl Frame {
    const MARGIN: f64 = 12.0;
    const LEGEND: f64 = 66.0;
    const LONGEST: f64 = 720.0;
    /// Smallest width, needed by the legend [px].
    const NARROWEST: f64 = 500.0;

    fn around(picture: &Picture, bounds: Option<&Bounds>) -> Self {
        let mut low = [f64::INFINITY; 2];
        let mut high = [f64::NEG_INFINITY; 2];
        for grain in &picture.grains {
            let reach = grain.outline.reach();
            for (k, centre) in grain.centre.into_iter().enumerate() {
                low[k] = low[k].min(centre - reach);
                high[k] = high[k].max(centre + reach);
            }
        }
        let sides = bounds.map(|b| [[b.low.x, b.high.x], [b.low.z, b.high.z]]);
        for (k, [from, to]) in sides.into_iter().flatten().enumerate() {
            low[k] = low[k].min(from);
            high[k] = high[k].max(to);
        }
        if !(low[0] < high[0] && low[1] < high[1]) {
            (low, high) = ([0.0; 2], [1.0; 2]);
        }
        if picture.is_whole {
            picture.walls.around(&mut low, &mut high);
        }
        let extent = [high[0] - low[0], high[1] - low[1]];
        let (inset, width, height) = (0.0, 0.0, 0.0);
        let mut frame =
            Self { left: low[0], top: high[1], extent, scale: 0.0, inset, width, height, sides };
        frame.scale_to(Self::LONGEST / extent[0].max(extent[1]));
        frame
    }

    /// Sets the scale [px/m] and the sizes that depend on it.
    fn scale_to(&mut self, scale: f64) {
        let [wide, tall] = self.extent.map(|length| length * scale);
        self.scale = scale;
        self.width = (wide + 2.0 * Self::MARGIN).max(Self::NARROWEST);
        self.inset = 0.5 * (self.width - wide);
        self.height = tall + 2.0 * Self::MARGIN + Self::LEGEND;
    }

    /// Lower and upper ends along x and z [m].
    fn ranges(&self) -> [[f64; 2]; 2] {
        let [wide, tall] = self.extent;
        [[self.left, self.top - tall], [self.left + wide, self.top]]
    }

    fn place(&self, x: f64, z: f64) -> (f64, f64) {
        ((x - self.left) * self.scale + self.inset, (self.top - z) * self.scale + Self::MARGIN)
    }

    fn draw(&self, grain: &Grain, out: &mut String) {
        let tone = tone_of(grain.contacts);
        let [x, z] = grain.centre;
        match &grain.outline {
            Outline::Ellipse { semi_axes, angle } => {
                let (x, y) = self.place(x, z);
                let [long, short] = semi_axes.map(|s| s * self.scale);
                // The y of SVG points down, so that angles change sign.
                let turn = -angle;
                let _ = write!(
                    out,
                    r#"<ellipse rx="{long:.1}" ry="{short:.1}" fill="url(#tone{tone})" "#
                );
                let _ =
                    writeln!(out, r#"transform="translate({x:.1} {y:.1}) rotate({turn:.0})"/>"#);
            }
            Outline::Polygon(corners) => {
                let _ = write!(out, r#"<path fill="url(#tone{tone})" d=""#);
                self.path(grain, corners, out);
                out.push_str("\"/>\n");
            }
        }
    }

    /// Draws the flat parts of a particle over its silhouette: dark where they turn from the light.
    fn draw_faces(&self, grain: &Grain, out: &mut String) {
        for Face { corners, shade } in &grain.faces {
            let _ = write!(out, r#"<path fill-opacity="{:.2}" d=""#, 0.4 * shade);
            self.path(grain, corners, out);
            out.push_str("\"/>\n");
        }
    }

    /// Writes a polygon about the centre of a particle in tenths of pixels, each corner relative to the previous one. This
    /// is short, and errors do not accumulate.
    fn path(&self, grain: &Grain, corners: &[Vector2<f64>], out: &mut String) {
        let [x, z] = grain.centre;
        let mut tenths: Vec<_> = corners
            .iter()
            .map(|corner| self.place(x + corner.x, z + corner.y))
            .map(|(x, y)| [(10.0 * x).round(), (10.0 * y).round()])
            .collect();
        tenths.dedup();
        let [x, y] = tenths[0];
        let _ = write!(out, "M{} {}l", x / 10.0, y / 10.0);
        for (k, pair) in tenths.windows(2).enumerate() {
            let [from, to] = [pair[0], pair[1]];
            let gap = if k == 0 { "" } else { " " };
            let (x, y) = ((to[0] - from[0]) / 10.0, (to[1] - from[1]) / 10.0);
            let _ = write!(out, "{gap}{x} {y}");
        }
        out.push('z');
    }

    fn open(&self, out: &mut String) {
        let (w, h) = (self.width, self.height);
        let _ = writeln!(
            out,
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{w:.0}" height="{h:.0}" viewBox="0 0 {w:.1} {h:.1}">
<rect width="100%" height="100%" fill="#FFFFFF"/>
<defs>"##
        );
        for (k, (light, dark)) in TONES.iter().enumerate() {
            let _ = writeln!(
                out,
                r#"<radialGradient id="tone{k}"><stop offset="0.35" stop-color="{light}"/><stop offset="1" stop-color="{dark}"/></radialGradient>"#
            );
        }
        out.push_str("</defs>\n");
        if let Some([[x0, x1], [z0, z1]]) = self.sides {
            let (left, top) = self.place(x0, z1);
            let (right, bottom) = self.place(x1, z0);
            let (w, h) = (right - left, bottom - top);
            let _ = writeln!(
                out,
                r##"<rect x="{left:.1}" y="{top:.1}" width="{w:.1}" height="{h:.1}" fill="none" stroke="#A9B2BC"/>"##
            );
        }
        out.push_str("<g stroke=\"#12324F\" stroke-width=\"0.5\" stroke-opacity=\"0.75\">\n");
    }

    fn legend(&self, out: &mut String) {
        let y = self.height - Self::LEGEND + 14.0;
        scale_bar(self.scale, 120.0, [Self::MARGIN, y + 32.0], out);
        let _ = writeln!(
            out,
            r##"<g font-family="sans-serif" font-size="12" fill="#5B6672"><text x="{:.0}" y="{:.1}">contacts</text>"##,
            Self::MARGIN,
            y + 11.0
        );
        for k in 0..TONES.len() {
            let x = Self::MARGIN + 66.0 + 58.0 * k as f64;
            let label = match k {
                0 => "0–1".to_string(),
                k if k + 1 == TONES.len() => format!("{}+", 2 * k),
                k => format!("{}–{}", 2 * k, 2 * k + 1),
            };
            let _ = writeln!(
                out,
                r##"<circle cx="{:.0}" cy="{:.1}" r="6.5" fill="url(#tone{k})" stroke="#12324F" stroke-width="0.5"/><text x="{:.0}" y="{:.1}">{label}</text>"##,
                x,
                y + 7.0,
                x + 10.0,
                y + 11.0
            );
        }
        out.push_str("</g>\n");
    }
}
