//! Boxes beside closed solids with inner corners and rounded coordinates, against distances between boxes and triangles. Plates with other
//! parts behind them.

use crate::contact::overlap::cuboid;
use crate::support::Frame;
use crate::support::random::Draw;
use crate::walls::faces_on_meshes::Lying;
use crate::walls::meshes::{self, Triangles};
use dem_mpi::contact::{Posed, Thickness};
use dem_mpi::math::{Mat3, Vec3, rotation_about};
use dem_mpi::random::Random;
use dem_mpi::shape::triangle_mesh::TriangleMesh;
use dem_mpi::shape::{HalfSpace, Shape};
use std::sync::Arc;

/// Sizes of boxes [m].
const LEAST: f64 = 0.3;
const MOST: f64 = 0.8;

/// A surface with cells for boxes up to this size.
fn surface_for(size: f64, triangles: &Triangles) -> Shape {
    let mesh = TriangleMesh::new(triangles, 0.1).expect("a surface");
    Shape::TriangleMesh(Arc::new(mesh.with_cells(size * 3.0_f64.sqrt()).expect("two sides")))
}

fn surface(triangles: &Triangles) -> Shape {
    surface_for(MOST, triangles)
}

/// Triangles of a plane polygon, by ear clipping.
fn ears(outline: &[[f64; 2]]) -> Vec<[usize; 3]> {
    let turn = |[a, b, c]: [usize; 3]| {
        let [[ax, ay], [bx, by], [cx, cy]] = [outline[a], outline[b], outline[c]];
        (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    };
    let mut left: Vec<usize> = (0..outline.len()).collect();
    let mut triangles = Vec::new();
    while left.len() > 2 {
        let n = left.len();
        let corners = |k: usize| [left[(k + n - 1) % n], left[k], left[(k + 1) % n]];
        let is_ear = |&k: &usize| {
            let [a, b, c] = corners(k);
            let is_inside = |&p: &usize| {
                [[a, b, p], [b, c, p], [c, a, p]].into_iter().all(|corners| turn(corners) >= 0.0)
            };
            let mut others = left.iter().filter(|p| ![a, b, c].contains(p));
            turn([a, b, c]) > 1e-9 && !others.any(is_inside)
        };
        let ear = (0..n).find(is_ear).expect("an ear");
        triangles.push(corners(ear));
        left.remove(ear);
    }
    triangles
}

/// Surface of a prism over a counter-clockwise outline.
fn prism(outline: &[[f64; 2]], half: f64) -> Triangles {
    let at = |k: usize, z: f64| Vec3::new(outline[k][0], outline[k][1], z);
    let mut triangles = Triangles::new();
    for [a, b, c] in ears(outline) {
        triangles.push([at(a, half), at(b, half), at(c, half)]);
        triangles.push([at(c, -half), at(b, -half), at(a, -half)]);
    }
    for k in 0..outline.len() {
        let next = (k + 1) % outline.len();
        let [a, b, c, d] = [at(k, -half), at(next, -half), at(next, half), at(k, half)];
        // The diagonal alternates.
        triangles.extend(if k % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
    }
    triangles
}

/// Outlines with inner corners.
fn outline(kind: usize, random: &mut Random) -> Vec<[f64; 2]> {
    let (w, h) = (1.5 + 2.0 * random.unit(), 1.5 + 2.0 * random.unit());
    let (s, t) = (w * (0.3 + 0.4 * random.unit()), h * (0.3 + 0.4 * random.unit()));
    match kind {
        0 => vec![[0.0, 0.0], [w, 0.0], [w, t], [s, t], [s, h], [0.0, h]],
        1 => vec![[0.0, 0.0], [w, 0.0], [w, h], [0.7 * w, h], [s, t], [0.2 * w, h], [0.0, h]],
        2 => {
            let (a, b) = (0.3 * w, 0.7 * w);
            vec![[0.0, 0.0], [w, 0.0], [w, h], [b, h], [b, t], [a, t], [a, h], [0.0, h]]
        }
        _ => (0..10)
            .map(|k| {
                let radius = if k % 2 == 0 { w } else { 0.4 * w + 0.2 * random.unit() };
                let (sine, cosine) = libm::sincos(0.2 * std::f64::consts::PI * f64::from(k));
                [radius * cosine, radius * sine]
            })
            .collect(),
    }
}

/// A box with its half edges along the axes of its frame.
struct Cuboid {
    frame: Mat3,
    centre: Vec3,
    half: Vec3,
}

impl Cuboid {
    fn seen(&self, triangle: &[Vec3; 3]) -> [Vec3; 3] {
        triangle.map(|p| self.frame.tr_mul(&(p - self.centre)))
    }

    /// Whether a part of a segment lies in the box; the segment is in the box's axes.
    fn holds_of(&self, from: &Vec3, to: &Vec3) -> bool {
        let (mut begin, mut end) = (0.0_f64, 1.0_f64);
        for axis in 0..3 {
            let (start, way) = (from[axis], to[axis] - from[axis]);
            let [one, other] = [-1.0, 1.0].map(|side| (side * self.half[axis] - start) / way);
            begin = begin.max(one.min(other));
            end = end.min(one.max(other));
        }
        begin < end
    }

    fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|k| {
            Vec3::from_fn(|axis, _| self.half[axis] * if k >> axis & 1 == 1 { 1.0 } else { -1.0 })
        })
    }

    fn edges(&self) -> impl Iterator<Item = [Vec3; 2]> {
        let corners = self.corners();
        let ends = (0..8).flat_map(|k| (0..3).map(move |axis| (k, k | 1 << axis)));
        ends.filter(|(k, l)| k != l).map(move |(k, l)| [corners[k], corners[l]])
    }

    /// Distance to a triangle; `None` if they intersect.
    fn distance(&self, triangle: &[Vec3; 3]) -> Option<f64> {
        let [a, b, c] = self.seen(triangle);
        let sides = [[a, b], [b, c], [c, a]];
        if sides.iter().any(|[from, to]| self.holds_of(from, to))
            || self.edges().any(|edge| goes_through(&edge, &[a, b, c]))
        {
            return None;
        }
        let of_triangle = [a, b, c]
            .into_iter()
            .map(|p| (p - p.inf(&self.half).sup(&-self.half)).norm())
            .fold(f64::INFINITY, f64::min);
        let of_box = self.corners().map(|p| over(&p, &[a, b, c]).unwrap_or(f64::INFINITY));
        let of_edges = self.edges().flat_map(|edge| sides.map(|side| between(&edge, &side)));
        Some(of_edges.chain(of_box).fold(of_triangle, f64::min))
    }
}

/// Height of a point above a triangle, if its projection is inside.
fn over(p: &Vec3, [a, b, c]: &[Vec3; 3]) -> Option<f64> {
    let normal = (b - a).cross(&(c - a)).normalize();
    let is_within = |from: &Vec3, to: &Vec3| normal.cross(&(to - from)).dot(&(p - from)) >= 0.0;
    (is_within(a, b) && is_within(b, c) && is_within(c, a)).then(|| (p - a).dot(&normal).abs())
}

fn goes_through([from, to]: &[Vec3; 2], triangle: &[Vec3; 3]) -> bool {
    let [a, b, c] = triangle;
    let normal = (b - a).cross(&(c - a));
    let (start, end) = ((from - a).dot(&normal), (to - a).dot(&normal));
    start * end <= 0.0 && over(&(from + (to - from) * (start / (start - end))), triangle).is_some()
}

/// Distance of two segments by alternating projections, exact where they end or are perpendicular.
fn between([a, b]: &[Vec3; 2], [c, d]: &[Vec3; 2]) -> f64 {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv) = (u.dot(&u), u.dot(&v), v.dot(&v));
    let (uw, vw) = (u.dot(&w), v.dot(&w));
    let determinant = uu * vv - uv * uv;
    let s = if determinant > 1e-12 * uu * vv { (uv * vw - vv * uw) / determinant } else { 0.0 };
    let s = s.clamp(0.0, 1.0);
    let t = ((uv * s + vw) / vv).clamp(0.0, 1.0);
    let s = ((uv * t - uw) / uu).clamp(0.0, 1.0);
    (a + u * s - c - v * t).norm()
}

/// Winding number of a closed surface around a point.
fn winding(triangles: &Triangles, point: &Vec3) -> f64 {
    let solid_angle = |triangle: &[Vec3; 3]| {
        let [a, b, c] = triangle.map(|p| p - point);
        let [x, y, z] = [a, b, c].map(|p| p.norm());
        let below = x * y * z + a.dot(&b) * z + b.dot(&c) * x + c.dot(&a) * y;
        2.0 * libm::atan2(a.dot(&b.cross(&c)), below)
    };
    triangles.iter().map(solid_angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

/// A closed solid in any position, with exact and with rounded corners.
struct Solid {
    exact: Triangles,
    rounded: Triangles,
    size: f64,
}

impl Solid {
    /// `digits` selects the rounding of corners: single precision, or a random shift of this length.
    fn of(kind: usize, digits: Option<f64>, random: &mut Random) -> Self {
        let outline = outline(kind, random);
        let frame = random.frame();
        let shift = random.direction() * 3.0;
        let plain = prism(&outline, 0.7 + 0.8 * random.unit());
        let exact: Triangles = plain
            .iter()
            .map(|t| t.map(|p| frame * (p - Vec3::new(1.0, 1.0, 0.0)) + shift))
            .collect();
        let mut moved = std::collections::BTreeMap::new();
        let mut round = |p: Vec3| match digits {
            None => p.map(|x| f64::from(x as f32)),
            Some(off) => {
                let key = [p.x, p.y, p.z].map(|x| (x * 1e6).round() as i64);
                p + *moved.entry(key).or_insert_with(|| random.direction() * off)
            }
        };
        let rounded = exact.iter().map(|t| t.map(&mut round)).collect();
        Self { exact, rounded, size: 5.0 }
    }

    /// A random box with its centre outside, and its distance from the surface.
    fn box_beside(&self, random: &mut Random) -> Option<(Cuboid, Option<f64>)> {
        let half = Vec3::from_fn(|_, _| 0.5 * (LEAST + (MOST - LEAST) * random.unit()));
        let [a, b, c] = self.exact[(random.unit() * self.exact.len() as f64) as usize];
        let (s, t) = (random.unit(), random.unit());
        let on = a + ((b - a) * (1.0 - t) + (c - a) * t) * s.sqrt();
        let centre = on + random.direction() * (0.2 + 0.8 * random.unit());
        let cuboid = Cuboid { frame: random.frame(), centre, half };
        if winding(&self.rounded, &centre).abs() > 0.5 {
            return None;
        }
        let each = self.rounded.iter().map(|triangle| cuboid.distance(triangle));
        let distance = each.reduce(|one, other| Some(one?.min(other?)))?;
        Some((cuboid, distance))
    }
}

/// There is no contact where the bodies share nothing, and one where they share a tenth of a box.
#[test]
fn beside_inner_corners_nothing_is_felt_from_afar() {
    let seed = 2026;
    println!("seed {seed}");
    let (mut apart, mut shared, mut wrong) = (0, 0, Vec::new());
    for k in 0..96 {
        let mut random = Random::of(seed, k as u64);
        let digits = [None, Some(1e-8), Some(1e-6), Some(1e-4)][k / 4 % 4];
        let solid = Solid::of(k % 4, digits, &mut random);
        let mesh = surface(&solid.rounded);
        for _ in 0..200 {
            let Some((cuboid_, distance)) = solid.box_beside(&mut random) else { continue };
            let Cuboid { frame, centre, half } = cuboid_;
            let body = cuboid(half * 2.0);
            let lying = Lying { body: &body, frame, wall: Mat3::identity(), scale: 1.0, centre };
            let found = lying.on(&mesh);
            let core = Cuboid { half: half * 0.9, ..cuboid_ };
            if distance.is_some_and(|distance| distance > 1e-6 * solid.size) {
                apart += 1;
                if let Some((_, found)) = found.first() {
                    wrong.push((k, digits, distance, found.thickness));
                }
            } else if solid.rounded.iter().any(|triangle| core.distance(triangle).is_none()) {
                shared += 1;
                if found.is_empty() {
                    wrong.push((k, digits, distance, 0.0));
                }
            }
        }
    }
    println!(
        "{apart} apart, {shared} share, wrong {}: {:?}",
        wrong.len(),
        &wrong[..wrong.len().min(5)]
    );
    assert!(apart > 3000 && shared > 3000, "{apart} {shared}");
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// Faces that are plane up to the digits of a file give the forces of planes.
#[test]
fn faces_that_are_rounded_press_as_planes_do() {
    let seed = 2027;
    println!("seed {seed}");
    let (mut differing, mut touching) = (0, 0);
    for k in 0..40 {
        let mut random = Random::of(seed, k as u64);
        let solid = Solid::of(k % 4, None, &mut random);
        let [exact, rounded] = [&solid.exact, &solid.rounded].map(surface);
        for _ in 0..100 {
            let Some((Cuboid { frame, centre, half }, None)) = solid.box_beside(&mut random) else {
                continue;
            };
            let body = cuboid(half * 2.0);
            let lying = Lying { body: &body, frame, wall: Mat3::identity(), scale: 1.0, centre };
            let [one, other] = [&exact, &rounded].map(|mesh| {
                let found = lying.on(mesh);
                let force: Vec3 = found.iter().map(|(_, of)| of.force()).sum();
                (force, found.iter().map(|(_, of)| of.thickness).fold(0.0, f64::max))
            });
            let off = (one.0 - other.0).norm() / (one.1 + 1e-2);
            differing += usize::from(off > 1e-4);
            touching += 1;
        }
    }
    // In a deep notch, rounding decides whether a cut exists.
    println!("{differing} of {touching} differ");
    assert!(touching > 1000 && 100 * differing < touching, "{differing} of {touching}");
}

/// A brace whose edge nearly touches a plate from behind takes no load from a body on the plate.
#[test]
fn a_plate_holds_what_lies_on_it_over_a_brace_and_beside() {
    let seed = 2028;
    println!("seed {seed}");
    let plane = Shape::HalfSpace(HalfSpace { normal: Vec3::z(), offset: 0.0 });
    let body = cuboid(Vec3::new(0.1, 0.08, 0.06));
    let depth = 5e-4;
    let (mut beside, mut least, mut most, mut count) = (0.0_f64, 1.0_f64, 1.0_f64, 0);
    for gap in [0.0, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3] {
        for degrees in [20.0, 30.0, 45.0, 60.0, 75.0_f64] {
            let mut random = Random::of(seed, count);
            let (sine, cosine) = libm::sincos(degrees.to_radians());
            let at = |x: f64, y: f64, z: f64| Vec3::new(x, y, z);
            let [a, b, c, d] =
                [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, y]| at(x, y, 0.0));
            let upper = [-0.1, 0.1].map(|y| at(0.2, y, -gap));
            let lower = upper.map(|p| p + at(0.2 * cosine, 0.0, -0.2 * sine));
            let mesh = vec![
                [a, b, d],
                [b, c, d],
                [upper[0], upper[1], lower[1]],
                [upper[0], lower[1], lower[0]],
            ];
            let mesh = surface_for(0.1, &mesh);
            for k in 0..40 {
                let turn = rotation_about(&Vec3::z(), 3.0 * random.signed());
                let frame = turn.to_rotation_matrix().into_inner();
                let near = k % 2 == 0;
                let reach = if near { 0.1 } else { 0.4 };
                let place = at(random.signed(), random.signed(), 0.0) * reach;
                let place = if near { place + at(0.25, 0.0, 0.0) } else { place };
                let centre = place + at(0.0, 0.0, 0.03 - depth);
                let lying =
                    Lying { body: &body, frame, wall: Mat3::identity(), scale: 1.0, centre };
                let expected = lying.on_plane(&plane).expect("they touch").force().z;
                let force: f64 = lying.on(&mesh).iter().map(|(_, of)| of.force().z).sum();
                // Farther from the brace than the box reaches.
                let is_clear = place.x < 0.13 || place.x > 0.47 || place.y.abs() > 0.17;
                if is_clear {
                    beside = beside.max((force / expected - 1.0).abs());
                }
                (least, most) = (least.min(force / expected), most.max(force / expected));
                count += 1;
            }
        }
    }
    println!("{count}: beside the brace off by {beside:.1e}, over it {least:.3} to {most:.3}");
    // The edge of the brace acts, too, where the box is deeper than the gap, with half the force of a face.
    assert!(beside < 1e-9 && least > 0.99 && most < 1.6, "{beside:e} {least} {most}");
}

/// Two blocks with a common edge, at which four triangles meet, give the forces of two separate blocks.
#[test]
fn blocks_with_an_edge_in_common_are_two_blocks() {
    let seed = 2029;
    println!("seed {seed}");
    let (mut apart, mut touching, mut differing) = (0, 0, 0);
    for k in 0..8 {
        let mut random = Random::of(seed, k);
        let frame = random.frame();
        let block = |low: Vec3, high: Vec3| -> Triangles {
            let turned = |t: &[Vec3; 3]| t.map(|p| frame * p);
            meshes::cuboid(low, high).iter().map(turned).collect()
        };
        let at = |x: f64, z: f64| Vec3::new(x, x, z);
        let blocks = [block(at(-2.0, -1.5), at(0.0, 1.5)), block(at(0.0, -1.5), at(2.0, 1.5))];
        let both = blocks.concat();
        let mesh = surface(&both);
        let blocks = blocks.map(|block| surface(&block));
        let solid = Solid { exact: both.clone(), rounded: both, size: 4.0 };
        for _ in 0..300 {
            let Some((Cuboid { frame, centre, half }, distance)) = solid.box_beside(&mut random)
            else {
                continue;
            };
            let body = cuboid(half * 2.0);
            let lying = Lying { body: &body, frame, wall: Mat3::identity(), scale: 1.0, centre };
            let sum = |found: &[(u32, Thickness)]| -> Vec3 {
                found.iter().map(|(_, of)| of.force()).sum()
            };
            let found = lying.on(&mesh);
            if distance.is_some_and(|distance| distance > 1e-6) {
                apart += 1;
                assert!(found.is_empty(), "{k} {distance:?}");
            } else {
                let each = [0, 1].map(|k: usize| lying.on(&blocks[k]));
                // A box that touches both may lie on a plane of both and is left out.
                if each.iter().any(Vec::is_empty) {
                    touching += 1;
                    let off = (sum(&found) - sum(&each.concat())).norm();
                    differing += usize::from(off > 1e-9);
                }
            }
        }
    }
    println!("{apart} apart, {touching} touch, {differing} differ");
    // At depths from a fifth of a box, cuts of one part by the other may matter.
    assert!(apart > 300 && touching > 300, "{apart} {touching}");
    assert!(100 * differing < touching, "{differing}");
}

/// A fin on a plate, at an edge of three triangles: there is no contact from afar, and beside it the plate is a plane.
#[test]
fn a_fin_on_a_plate_is_a_sheet_of_its_own() {
    let seed = 2030;
    println!("seed {seed}");
    let plane = Shape::HalfSpace(HalfSpace { normal: Vec3::z(), offset: 0.0 });
    let at = |x: f64, y: f64, z: f64| Vec3::new(x, y, z);
    let sheet = |[a, b, c, d]: [Vec3; 4]| [[a, b, c], [a, c, d]];
    let (mut apart, mut beside, mut worst) = (0, 0, 0.0_f64);
    for degrees in [50.0, 90.0, 120.0_f64] {
        let mut random = Random::of(seed, degrees as u64);
        let (sine, cosine) = libm::sincos(degrees.to_radians());
        let (from, to) = (at(0.0, -4.0, 0.0), at(0.0, 4.0, 0.0));
        let over = at(3.0 * cosine, 0.0, 3.0 * sine);
        let mut triangles = Triangles::new();
        for out in [at(4.0, 0.0, 0.0), at(-4.0, 0.0, 0.0), over] {
            triangles.extend(sheet([from, to, to + out, from + out]));
        }
        let mesh = surface(&triangles);
        for k in 0..1000 {
            let half = Vec3::from_fn(|_, _| 0.5 * (LEAST + (MOST - LEAST) * random.unit()));
            let body = cuboid(half * 2.0);
            let frame = random.frame();
            let low = -Posed::new(&body, &frame).support(&-Vec3::z()).z;
            let above = 0.3 * random.unit() * if k % 2 == 0 { 1.0 } else { -0.3 };
            let centre = at(1.5 * random.signed(), random.signed(), low + above);
            let lying = Lying { body: &body, frame, wall: Mat3::identity(), scale: 1.0, centre };
            let box_of = Cuboid { frame, centre, half };
            let to_fin = triangles[4..].iter().map(|fin| box_of.distance(fin));
            let Some(Some(_)) = to_fin.reduce(|a, b| Some(a?.min(b?))) else { continue };
            if above > 1e-6 {
                apart += 1;
                assert!(lying.on(&mesh).is_empty(), "{degrees} {centre}");
            } else if centre.x.abs() > 0.1 + half.norm() {
                beside += 1;
                let expected = lying.on_plane(&plane).expect("they touch").force();
                let force: Vec3 = lying.on(&mesh).iter().map(|(_, of)| of.force()).sum();
                worst = worst.max((force - expected).norm());
            }
        }
    }
    println!("{apart} apart, {beside} on the plate, worst {worst:.1e}");
    assert!(apart > 300 && beside > 300 && worst < 1e-12, "{apart} {beside} {worst:e}");
}

/// Each triangle checks few others on a surface of any fineness: at half the width, hardly more of them.
#[test]
fn triangles_ask_no_more_others_where_they_are_finer() {
    let asked = |count: usize| {
        let mesh = TriangleMesh::new(&terrain(count), 0.1).expect("a surface");
        let mesh = mesh.with_cells(0.06 * 3.0_f64.sqrt()).expect("two sides");
        let [cells, asked] = mesh.cells_made();
        println!("{count}: {} triangles, {cells} cells, {asked} asked", mesh.len());
        assert!(cells < 3 * mesh.len(), "{cells}");
        asked as f64 / mesh.len() as f64
    };
    let [coarse, fine] = [20, 40].map(asked);
    assert!(fine < 2.5 * coarse && fine < 400.0, "{coarse} {fine}");
}

/// A terrain of squares over 0.6 m.
fn terrain(count: usize) -> Triangles {
    let at = |i: usize, j: usize| {
        let [x, y] = [i, j].map(|k| 0.6 * (k as f64 / count as f64 - 0.5));
        Vec3::new(x, y, 0.01 * libm::sin(40.0 * x) * libm::cos(30.0 * y))
    };
    let square = |k: usize| {
        let (i, j) = (k % count, k / count);
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..count * count).flat_map(square).collect()
}
