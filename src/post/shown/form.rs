//! Drawings of a single shape: from three sides and obliquely, each piece in its own colour, and its surface.
//!
//! Triangles are drawn from the farthest to the nearest, in parallel light from above and the left. Triangles of unions are
//! divided to a fifth of the bounding radius, and left out within other pieces.

use super::side::scale_bar;
use crate::math::{Mat3, Vec3};
use crate::post::surface::{Detail, Surface};
use crate::post::vtp::{Array, Cells, NORMALS, PolyData};
use crate::shape::Shape;
use crate::shape::union::Piece;
use std::fmt::Write;

/// Red, green and blue of the pieces, repeated in this order.
const COLOURS: [[f64; 3]; 6] = [
    [127.0, 176.0, 212.0],
    [227.0, 178.0, 60.0],
    [94.0, 184.0, 151.0],
    [214.0, 127.0, 84.0],
    [204.0, 154.0, 190.0],
    [160.0, 168.0, 176.0],
];

/// Half the width of a panel [px].
const HALF: f64 = 120.0;
const MARGIN: f64 = 12.0;
const HEAD: f64 = 26.0;
const FOOT: f64 = 34.0;
/// Largest side of a triangle of a piece, over the bounding radius.
const FINE: f64 = 0.2;

/// Surface of a shape, by pieces; one piece if it is not a union.
#[derive(Clone, Debug)]
pub struct Form {
    shape: Shape,
    pieces: Vec<Surface>,
}

/// A triangle that may be visible: its corners in the axes of the shape [m], its outward normal, and its piece.
struct Triangle {
    corners: [Vec3; 3],
    normal: Vec3,
    piece: usize,
}

impl Form {
    /// Form of a shape.
    pub fn of(shape: &Shape) -> Self {
        let of_piece = |piece: &Piece| Surface::of_piece(piece, Detail::default());
        let pieces = match shape {
            Shape::Union(body) => body.pieces().iter().map(of_piece).collect(),
            _ => vec![Surface::of(shape, Detail::FINE)],
        };
        Self { shape: shape.clone(), pieces }
    }

    /// The surface as polygons, with the number of the piece of each, from 0.
    pub fn surface(&self) -> PolyData {
        let (mut points, mut normals): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let (mut members, mut ends, mut numbers) = (Vec::new(), Vec::new(), Vec::new());
        for (piece, surface) in (0..).zip(&self.pieces) {
            let first = points.len() as i64 / 3;
            points.extend(surface.points.iter().flatten());
            normals.extend(surface.normals.iter().flatten());
            for face in surface.faces() {
                members.extend(face.iter().map(|&member| first + i64::from(member)));
                ends.push(members.len() as i64);
                numbers.push(piece);
            }
        }
        PolyData {
            time: 0.0,
            point_count: points.len() / 3,
            points: Array::new("Points", 3, &points),
            cells: Cells::Polygons,
            members,
            ends,
            of_points: vec![Array::new(NORMALS, 3, &normals)],
            of_cells: vec![Array::new::<i32>("piece", 1, &numbers)],
        }
    }

    /// Four panels at one scale, with a scale bar: along y, along -x, from above, and obliquely.
    pub fn svg(&self) -> String {
        let radius = self.shape.bounding_radius();
        let (width, height) = (4.0 * 2.0 * HALF + 5.0 * MARGIN, 2.0 * HALF + HEAD + FOOT);
        let mut out = format!(
            r##"<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0}" height="{height:.0}" viewBox="0 0 {width:.1} {height:.1}">
<rect width="100%" height="100%" fill="#FFFFFF"/>
"##
        );
        let triangles = self.triangles();
        let aslant = Vec3::new(-0.55, 0.7, -0.45).normalize();
        let right = aslant.cross(&Vec3::z()).normalize();
        let views = [
            ("x and z", Vec3::x(), Vec3::z()),
            ("y and z", Vec3::y(), Vec3::z()),
            ("x and y", Vec3::x(), Vec3::y()),
            ("aslant", right, right.cross(&aslant)),
        ];
        for (k, (title, right, up)) in (0..).zip(views) {
            let left = MARGIN + f64::from(k) * (2.0 * HALF + MARGIN);
            let _ = writeln!(
                out,
                r##"<text x="{left:.1}" y="17" font-family="sans-serif" font-size="13" fill="#5B6672">{title}</text>
<g transform="translate({:.1} {:.1})" fill="currentColor" stroke="currentColor" stroke-width="0.4" stroke-linejoin="round">"##,
                left + HALF,
                HEAD + HALF
            );
            let seen = Mat3::from_columns(&[right, up, right.cross(&up)]).transpose();
            panel(&triangles, &seen, HALF / radius, &mut out);
            out.push_str("</g>\n");
        }
        scale_bar(HALF / radius, 120.0, [MARGIN, height - 14.0], &mut out);
        out.push_str("</svg>\n");
        out
    }

    /// Triangles of all pieces that may be visible.
    fn triangles(&self) -> Vec<Triangle> {
        let longest = FINE * self.shape.bounding_radius();
        let mut all = Vec::new();
        for (piece, surface) in self.pieces.iter().enumerate() {
            for face in surface.faces() {
                for k in 2..face.len() {
                    let corner = |member: usize| surface.points[face[member] as usize];
                    let corners = [corner(0), corner(k - 1), corner(k)];
                    let area = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
                    if let Some(normal) = area.try_normalize(0.0) {
                        let triangle = Triangle { corners, normal, piece };
                        self.divide(triangle, longest, &mut all);
                    }
                }
            }
        }
        all
    }

    /// Halves a triangle of a union until it is small, and leaves out parts within other pieces.
    fn divide(&self, triangle: Triangle, longest: f64, into: &mut Vec<Triangle>) {
        let Shape::Union(body) = &self.shape else {
            into.push(triangle);
            return;
        };
        let Triangle { corners: [a, b, c], normal, piece } = triangle;
        let sides = [(a, b, c), (b, c, a), (c, a, b)];
        let length = |side: &(Vec3, Vec3, Vec3)| (side.1 - side.0).norm();
        let (p, q, r) = sides
            .into_iter()
            .reduce(|one, other| if length(&other) > length(&one) { other } else { one })
            .expect("three sides");
        if (q - p).norm() > longest {
            let middle = (p + q) * 0.5;
            for corners in [[p, middle, r], [middle, q, r]] {
                self.divide(Triangle { corners, normal, piece }, longest, into);
            }
            return;
        }
        let middle = (a + b + c) / 3.0 + normal * (1e-3 * longest);
        let holds = |(number, other): (usize, &Piece)| number != piece && other.contains(&middle);
        if !body.pieces().iter().enumerate().any(holds) {
            into.push(triangle);
        }
    }
}

/// Draws the triangles that face the viewer, the farthest first; `seen` rotates into axes to the right, up and towards the
/// viewer. Consecutive triangles of one colour are one path.
fn panel(triangles: &[Triangle], seen: &Mat3, scale: f64, out: &mut String) {
    let light = Vec3::new(-0.4, 0.6, 0.7).normalize();
    let mut drawn: Vec<(f64, String, String)> = Vec::new();
    for Triangle { corners, normal, piece } in triangles {
        let normal = seen * normal;
        if normal.z <= 0.0 {
            continue;
        }
        let [a, b, c] = corners.map(|corner| seen * corner * scale);
        let bright = 0.55 + 0.45 * normal.dot(&light).max(0.0);
        let [red, green, blue] = COLOURS[piece % COLOURS.len()].map(|part| (part * bright) as u8);
        let path =
            format!("M{:.1} {:.1}L{:.1} {:.1} {:.1} {:.1}z", a.x, -a.y, b.x, -b.y, c.x, -c.y);
        drawn.push((a.z + b.z + c.z, format!("#{red:02X}{green:02X}{blue:02X}"), path));
    }
    drawn.sort_by(|one, other| one.0.total_cmp(&other.0));
    for of_one_colour in drawn.chunk_by(|one, other| one.1 == other.1) {
        let _ = write!(out, r#"<path color="{}" d=""#, of_one_colour[0].1);
        for (.., path) in of_one_colour {
            out.push_str(path);
        }
        out.push_str("\"/>\n");
    }
}
