//! Particles with faces on walls of triangles: planes with any triangulation, force and moment as the gradient of an energy, identical bits.

use crate::contact::overlap::{cuboid, derivative, solid, solids};
use crate::support::random::Draw;
use crate::support::{Bench, Frame, OnRanks, close, scene};
use crate::walls::meshes::{self, Triangles};
use dem_mpi::contact::{
    ContactResolver, Epa, Outcome, OverlapWithSurface, Posed, Thickness, thickness,
    thickness_on_surface,
};
use dem_mpi::math::{Mat3, Quat, Vec3, rotation_about};
use dem_mpi::particles::records::Particle;
use dem_mpi::random::Random;
use dem_mpi::shape::triangle_mesh::TriangleMesh;
use dem_mpi::shape::{HalfSpace, Shape};
use std::sync::Arc;

/// A body is never nearer to a contact with a facet than its reported clearance. This holds at convex edges, too, where the contact passes
/// from face to face.
#[test]
fn a_clearance_is_kept_beside_convex_edges() {
    let block = surface(&meshes::cuboid(Vec3::new(-1.0, -1.0, -1.5), Vec3::zeros()));
    let Shape::TriangleMesh(mesh) = &block else { panic!("no mesh") };
    let (cube, upright) = (cuboid(Vec3::repeat(0.4)), Mat3::identity());
    let mut random = Random::of(2, 2);
    let mut seen = [0; 2];
    for k in 0..40_000 {
        // Near the upper edges, flush or rotated.
        let turn = if k % 3 == 0 {
            Mat3::identity()
        } else {
            random.rotation().to_rotation_matrix().into_inner()
        };
        let body = Posed::new(&cube, &turn);
        let low = -body.support(&-Vec3::z()).z;
        let centre = Vec3::new(
            0.3 * random.signed(),
            -0.5 + 0.6 * random.signed(),
            low + 0.05 * random.signed(),
        );
        let touch = |facet: u32, centre: Vec3| {
            let wall = Posed { facet, ..Posed::new(&block, &upright) };
            OverlapWithSurface.touch(&body, &wall, &-centre, None)
        };
        for facet in mesh.near(&centre, body.bounding_radius() + 0.05) {
            let Outcome::Apart(clear) = touch(facet, centre) else { continue };
            if !(clear > 0.0 && clear < 0.2) {
                continue;
            }
            for _ in 0..4 {
                let way = random.direction() * (0.999 * clear);
                let touching = matches!(touch(facet, centre + way), Outcome::Touching(_));
                assert!(!touching, "facet {facet}, {centre} {turn}: {clear}, {way}");
                seen[0] += 1;
            }
            seen[1] += 1;
        }
    }
    assert!(seen[1] > 3000, "{seen:?}");
}

/// Surface of a convex polyhedron with each triangle cut into four, `times` times.
fn refined(body: &Shape, times: u32) -> Triangles {
    let Shape::Polyhedron(body) = body else { panic!("no polyhedron") };
    let hull = body.hull();
    let of_hull = |corners: [u32; 3]| corners.map(|k| hull.vertices()[k as usize]);
    let mut triangles: Triangles =
        hull.triangles().iter().map(|triangle| of_hull(triangle.corners)).collect();
    for _ in 0..times {
        let quarters = |[a, b, c]: [Vec3; 3]| {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(from, to)| (from + to) * 0.5);
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(quarters).collect();
    }
    triangles
}

/// Convex bodies with edges of all angles: needles, wedges, boxes.
fn sharp_solids(random: &mut Random) -> Vec<(String, Shape)> {
    let mut solids = vec![("box".to_owned(), cuboid(Vec3::new(2.0, 1.6, 1.2)))];
    for degrees in [20.0, 50.0, 80.0, 88.0_f64] {
        let half = libm::tan(0.5 * degrees.to_radians());
        let corners = [-1.5, 1.5].map(|y| {
            [Vec3::new(0.0, y, 0.0), Vec3::new(2.0, y, 2.0 * half), Vec3::new(2.0, y, -2.0 * half)]
        });
        solids.push((format!("wedge of {degrees} degrees"), solid(&corners.concat())));
    }
    for k in 0..6 {
        let corners: Vec<Vec3> = (0..4).map(|_| random.direction() * 1.5).collect();
        solids.push((format!("tetrahedron {k}"), solid(&corners)));
    }
    solids
}

/// Nearly equal distances with and without a common part of two bodies, on an approach from far away.
fn first_touch(is_shared: impl Fn(f64) -> bool) -> (f64, f64) {
    let (mut within, mut beyond) = (5.0, 5.0);
    while !is_shared(within) {
        (within, beyond) = (within - 0.02, within);
    }
    for _ in 0..50 {
        let middle = 0.5 * (within + beyond);
        if is_shared(middle) { within = middle } else { beyond = middle }
    }
    (within, beyond)
}

/// Beside edges and tips of any angle the force starts exactly at touch: against EPA on convex bodies.
#[test]
fn nothing_is_felt_beside_an_edge_before_it_is_touched() {
    let mut random = Random::of(2026, 21);
    let solids = sharp_solids(&mut random);
    let upright = Mat3::identity();
    for (name, solid) in &solids {
        for times in [0, 1, 2, 3] {
            let mesh = surface(&refined(solid, times));
            let (mut wrong, mut missed) = (0, 0);
            for _ in 0..1000 {
                let body = cuboid(Vec3::from_fn(|_, _| 0.3 + 0.5 * random.unit()));
                let frame = random.frame();
                let towards = random.direction();
                let lying = |distance: f64| Lying {
                    body: &body,
                    frame,
                    wall: Mat3::identity(),
                    scale: 1.0,
                    centre: towards * distance,
                };
                let is_shared = |distance: f64| {
                    let (a, b) = (Posed::new(&body, &frame), Posed::new(solid, &upright));
                    let outcome = Epa::default().touch(&a, &b, &(-towards * distance), None);
                    matches!(outcome, Outcome::Touching(_))
                };
                let (within, beyond) = first_touch(is_shared);
                let gap = libm::pow(10.0, -4.0 * random.unit()) * 0.3;
                wrong += usize::from(!lying(beyond + gap).on(&mesh).is_empty());
                missed += usize::from(lying(within - 0.02).on(&mesh).is_empty());
            }
            assert_eq!((wrong, missed), (0, 0), "{name}, {times}");
        }
    }
}

/// A floor with a pit acts as a plane on bodies beside the pit. This holds even where triangles of the floor are in line with a wall of the
/// pit.
#[test]
fn beside_a_pit_a_floor_is_a_plane() {
    let at = |x: f64, y: f64, z: f64| Vec3::new(x, y, z);
    let plane = Shape::HalfSpace(HalfSpace { normal: Vec3::z(), offset: 0.0 });
    let square = |[a, b, c, d]: [Vec3; 4]| [[a, b, c], [a, c, d]];
    let mut random = Random::of(2026, 24);
    for (name, pit) in [("wide", 1.0), ("narrow", 0.3)] {
        // Lines of the floor in line with the walls of the pit, and moved away from it.
        for moved in [0.0, 0.02, 0.4] {
            let mut floor = Triangles::new();
            let lines = [-4.0, -moved, pit + moved, 4.0];
            let corner = |i: usize, j: usize| {
                // The pit is in the middle.
                let inside = |k: usize| (1..3).contains(&k);
                let bring = |k: usize| if k == 1 { 0.0 } else { pit };
                if moved > 0.0 && inside(i) && inside(j) {
                    at(bring(i), bring(j), 0.0)
                } else {
                    at(lines[i], lines[j], 0.0)
                }
            };
            for i in 0..3 {
                for j in (0..3).filter(|&j| (i, j) != (1, 1)) {
                    let ends = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                    floor.extend(square(ends.map(|(i, j)| corner(i, j))));
                }
            }
            let rim = [(0.0, 0.0), (pit, 0.0), (pit, pit), (0.0, pit)];
            for k in 0..4 {
                let ([x, y], [u, v]) = (rim[k].into(), rim[(k + 1) % 4].into());
                floor.extend(square([
                    at(x, y, 0.0),
                    at(u, v, 0.0),
                    at(u, v, -1.0),
                    at(x, y, -1.0),
                ]));
            }
            let mesh = surface(&floor);
            let mut worst = 0.0_f64;
            for k in 0..400 {
                let body = cuboid(Vec3::from_fn(|_, _| 0.3 + 0.5 * random.unit()));
                let frame = random.frame();
                let posed = Posed::new(&body, &frame);
                // Over the line of a wall, on one side of the pit.
                let beside = -posed.bounding_radius() - 0.01 * random.unit();
                let along = 0.4 * random.signed();
                let [x, y] = if k % 2 == 0 { [along, beside] } else { [beside, along] };
                let low = -posed.support(&-Vec3::z()).z;
                let centre = at(x, y, low - 0.05 * random.unit());
                let wall = Mat3::identity();
                let lying = Lying { body: &body, frame, wall, scale: 1.0, centre };
                worst = worst.max(lying.off_the_plane(&mesh, &plane, [0, k]));
            }
            println!("{name}, {moved}: {worst:.1e}");
            assert!(worst < 1e-12, "{name}, {moved}: {worst:e}");
        }
    }
}

/// The force of a convex block on a body is independent of the triangulation of its faces.
#[test]
fn a_convex_block_is_the_same_however_its_faces_are_cut() {
    let mut random = Random::of(2026, 22);
    let solids = sharp_solids(&mut random);
    for (name, solid) in &solids {
        let [whole, cut @ ..] = [0, 1, 2, 3].map(|times| surface(&refined(solid, times)));
        let mut worst = 0.0_f64;
        for _ in 0..400 {
            let body = cuboid(Vec3::from_fn(|_, _| 0.3 + 0.5 * random.unit()));
            let lying = Lying {
                body: &body,
                frame: random.frame(),
                wall: Mat3::identity(),
                scale: 1.0,
                centre: Vec3::zeros(),
            };
            let towards = random.direction();
            let at = |distance: f64| lying.moved(towards * distance);
            let (within, _) = first_touch(|distance| at(distance).on_plane(solid).is_some());
            let pressed = at(within - 0.02 * random.unit());
            let sum = |mesh: &Shape| {
                let found = pressed.on(mesh);
                let force: Vec3 = found.iter().map(|(_, of)| of.force()).sum();
                (found.iter().map(|(_, of)| of.energy()).sum::<f64>(), force)
            };
            let (energy, force) = sum(&whole);
            for mesh in &cut {
                let (again, other) = sum(mesh);
                // Thin contacts are affected by rounding.
                let off = (again - energy).abs() / (energy + 1e-6);
                worst = worst.max(off).max((other - force).norm() / (force.norm() + 1e-3));
            }
        }
        println!("{name}: {worst:.1e}");
        assert!(worst < 1e-9, "{name}: {worst:e}");
    }
}

/// A surface with cells for bodies of the size of [`solids`].
pub(crate) fn surface(triangles: &Triangles) -> Shape {
    let mesh = TriangleMesh::new(triangles, 0.1).expect("a surface");
    Shape::TriangleMesh(Arc::new(mesh.with_cells(2.0).expect("two sides")))
}

/// A surface over squares, cut along either diagonal, with heights at their corners.
pub(crate) fn relief(count: usize, width: f64, height: impl Fn(f64, f64) -> f64) -> Triangles {
    ragged(count, width, 0.0, height)
}

/// A surface over squares whose inner corners are moved by up to this part of a square.
pub(crate) fn ragged(
    count: usize,
    width: f64,
    jitter: f64,
    height: impl Fn(f64, f64) -> f64,
) -> Triangles {
    let mut random = Random::of(8, 0);
    let mut corners = Vec::new();
    for k in 0..(count + 1) * (count + 1) {
        let mut at = |k: usize| {
            let off = if k == 0 || k == count { 0.0 } else { jitter * random.signed() };
            ((k as f64 + off) / count as f64 - 0.5) * width
        };
        let (x, y) = (at(k % (count + 1)), at(k / (count + 1)));
        corners.push(Vec3::new(x, y, height(x, y)));
    }
    meshes::cut(count, &corners, &mut random)
}

/// A ring of strips about the y axis, of this radius and half length, without ends.
pub(crate) fn drum(radius: f64, half: f64, strips: usize) -> Triangles {
    let at = |k: usize, y: f64| {
        let angle = std::f64::consts::TAU * (k % strips) as f64 / strips as f64;
        let (sine, cosine) = libm::sincos(angle);
        Vec3::new(radius * sine, y, -radius * cosine)
    };
    let strip = |k: usize| {
        let [a, b, c, d] = [at(k, -half), at(k + 1, -half), at(k + 1, half), at(k, half)];
        [[a, b, c], [a, c, d]]
    };
    (0..strips).flat_map(strip).collect()
}

/// A body on a surface, or on the plane below it.
pub(crate) struct Lying<'a> {
    pub(crate) body: &'a Shape,
    pub(crate) frame: Mat3,
    pub(crate) wall: Mat3,
    pub(crate) scale: f64,
    /// Vector from the reference point of the wall [m].
    pub(crate) centre: Vec3,
}

impl Lying<'_> {
    pub(crate) fn on(&self, surface: &Shape) -> Vec<(u32, Thickness)> {
        let body = Posed { scale: self.scale, ..Posed::new(self.body, &self.frame) };
        thickness_on_surface(&body, &Posed::new(surface, &self.wall), &-self.centre)
    }

    pub(crate) fn on_plane(&self, plane: &Shape) -> Option<Thickness> {
        let body = Posed { scale: self.scale, ..Posed::new(self.body, &self.frame) };
        thickness(&body, &Posed::new(plane, &self.wall), &-self.centre)
    }

    pub(crate) fn energy(&self, surface: &Shape) -> f64 {
        self.on(surface).iter().map(|(_, found)| found.energy()).sum()
    }

    /// Deviation of its one contact with a plane of triangles from that with the plane; `pose` names it in messages.
    pub(crate) fn off_the_plane(&self, flat: &Shape, plane: &Shape, pose: [usize; 2]) -> f64 {
        let expected = self.on_plane(plane).expect("they touch");
        let found = self.on(flat);
        assert_eq!(found.len(), 1, "{pose:?}");
        // Rounding of positions limits thin contacts to a fraction of a hundredth of the size.
        let thin = (expected.thickness / (1e-2 * self.scale)).min(1.0);
        difference(&found[0].1, &expected) * thin
    }

    /// Deviation of force and moment of all contacts from the gradient of their energy, over the largest thickness.
    pub(crate) fn error_of_gradient(&self, surface: &Shape) -> f64 {
        let found = self.on(surface);
        let force: Vec3 = found.iter().map(|(_, found)| found.force()).sum();
        let moment: Vec3 = found.iter().map(|(_, found)| found.moment()).sum();
        let thickness = found.iter().map(|(_, f)| f.thickness).fold(0.0, f64::max);
        let step = 1e-4 * thickness;
        let error = |k: usize| {
            let axis = Vec3::ith(k, 1.0);
            let along = derivative(|h| self.moved(axis * h).energy(surface), step);
            let about = derivative(|h| self.turned(&axis, h).energy(surface), step);
            (along - force[k]).abs().max((about - moment[k]).abs()) / thickness
        };
        (0..3).map(error).fold(0.0, f64::max)
    }

    pub(crate) fn moved(&self, by: Vec3) -> Self {
        Self { centre: self.centre + by, ..*self }
    }

    pub(crate) fn turned(&self, axis: &Vec3, angle: f64) -> Self {
        let frame = rotation_about(axis, angle).to_rotation_matrix() * self.frame;
        Self { frame, ..*self }
    }
}

/// Deviation of one contact from another in force, moment, thickness and covariance, over the thickness.
fn difference(one: &Thickness, other: &Thickness) -> f64 {
    let all = [
        (one.force() - other.force()).norm() / other.thickness,
        (one.moment() - other.moment()).norm() / other.thickness,
        (one.thickness - other.thickness).abs() / other.thickness,
        (one.covariance - other.covariance).norm(),
    ];
    all.into_iter().fold(0.0, f64::max)
}

#[test]
fn a_plane_of_triangles_is_the_plane() {
    let plane = Shape::HalfSpace(HalfSpace { normal: Vec3::z(), offset: 0.0 });
    let mut random = Random::of(20_261_125, 1);
    let (mut worst, mut met) = (0.0_f64, 0);
    for count in [1, 2, 4, 8, 16] {
        let flat = surface(&ragged(count, 8.0, 0.24, |_, _| 0.0));
        for body in &solids() {
            for k in 0..120 {
                let scale = 0.5 + random.unit();
                // Half of the poses are flat, or nearly so.
                let frame = if k % 2 == 0 {
                    random.frame()
                } else {
                    rotation_about(&Vec3::x(), 1e-3 * random.signed())
                        .to_rotation_matrix()
                        .into_inner()
                };
                let wall = random.frame();
                let mut lying =
                    Lying { body, frame: wall * frame, wall, scale, centre: Vec3::zeros() };
                let posed = Posed { scale, ..Posed::new(body, &lying.frame) };
                // Depth of the polyhedron used for contacts, which extends beyond a rounded one.
                let vertices = body.facets().unwrap().vertices().iter();
                let below = vertices.map(|v| -(frame * v).z * scale).fold(f64::MIN, f64::max);
                let depth = posed.inscribed_radius() * libm::pow(10.0, -6.0 * random.unit()) * 0.4;
                // The body is above the plane.
                let place = Vec3::new(random.signed(), random.signed(), below - depth);
                lying.centre = wall * place;
                worst = worst.max(lying.off_the_plane(&flat, &plane, [count, k]));
                met += 1;
            }
        }
    }
    assert_eq!(met, 3600);
    println!("worst {worst:.1e}");
    assert!(worst < 1e-12, "{worst:e}");
}

/// Surfaces with edges and corners of all kinds.
pub(crate) fn surfaces() -> Vec<(&'static str, Triangles)> {
    let slope = |degrees: f64| libm::tan(degrees.to_radians());
    let (steep, gentle) = (slope(30.0), slope(15.0));
    let wave = |x: f64| libm::cos(1.3 * x);
    vec![
        ("valley of 120 degrees", relief(8, 8.0, |x, _| steep * x.abs())),
        ("valley of 150 degrees", relief(8, 8.0, |x, _| gentle * x.abs())),
        ("ridge of 120 degrees", relief(8, 8.0, |x, _| -steep * x.abs())),
        ("sharp ridge", relief(8, 8.0, |x, _| -3.0 * x.abs())),
        ("pit", relief(8, 8.0, |x, y| steep * x.abs().max(y.abs()))),
        ("tip", relief(8, 8.0, |x, y| -steep * x.abs().max(y.abs()))),
        ("bumps", relief(16, 8.0, |x, y| 0.2 * wave(x) * wave(y))),
        ("saddle", relief(16, 8.0, |x, y| 0.1 * (x * x - y * y))),
        ("steps", relief(8, 8.0, |x, _| if x > 0.5 { 0.15 } else { 0.0 })),
        ("drum", drum(3.0, 3.0, 24)),
        ("box", meshes::cuboid(Vec3::new(-2.0, -2.0, -2.0), Vec3::new(0.6, 0.7, 0.5))),
    ]
}

/// A height above a surface of this name, or within it [m].
pub(crate) fn above(name: &str) -> f64 {
    if name == "drum" { 0.0 } else { 3.0 }
}

/// Lowers a body onto a surface to a given thickness.
pub(crate) fn lowered<'a>(
    body: &'a Shape,
    surface: &Shape,
    random: &mut Random,
    (from, depth): (f64, f64),
) -> Option<Lying<'a>> {
    let frame = random.frame();
    let (x, y) = (1.2 * random.signed(), 1.2 * random.signed());
    let lying =
        Lying { body, frame, wall: Mat3::identity(), scale: 1.0, centre: Vec3::new(x, y, 0.0) };
    let at = |z: f64| lying.moved(Vec3::z() * z);
    let deepest =
        |z: f64| at(z).on(surface).iter().map(|(_, found)| found.thickness).fold(0.0, f64::max);
    // From above, in steps that are small compared with the thickness.
    let mut z = from;
    while z > -4.0 && deepest(z) < depth {
        z -= 0.4 * depth;
    }
    (z > -4.0).then(|| at(z))
}

#[test]
fn force_and_moment_are_the_gradient_of_the_energy() {
    let mut random = Random::of(20_261_125, 2);
    let mut report = Vec::new();
    for (name, triangles) in surfaces() {
        let surface = surface(&triangles);
        let (mut worst, mut met, mut several) = (0.0_f64, 0, 0);
        for body in &solids() {
            let size = Posed::new(body, &Mat3::identity()).inscribed_radius();
            for _ in 0..40 {
                let depth = size * libm::pow(10.0, -1.5 * random.unit()) * 0.4;
                let lying = lowered(body, &surface, &mut random, (above(name), depth));
                let Some(lying) = lying else { continue };
                let found = lying.on(&surface);
                worst = worst.max(lying.error_of_gradient(&surface));
                met += 1;
                several += usize::from(found.len() > 1);
            }
        }
        println!("{name}: {met} poses, {several} of several contacts, worst {worst:.1e}");
        report.push((name, met, worst));
    }
    for (name, met, worst) in report {
        assert!(met > 100, "{name}: only {met}");
        assert!(worst < 1e-6, "{name}: {worst:e}");
    }
}

/// Three quarters of a face lie on a table: the force acts there, as strong as below a whole face.
#[test]
fn a_block_stands_over_the_edge_of_a_table() {
    let table = surface(&meshes::cuboid(Vec3::new(-4.0, -4.0, -4.0), Vec3::new(0.0, 4.0, 0.0)));
    let block = cuboid(Vec3::new(1.0, 1.0, 1.0));
    let depth = 1e-3;
    let lying = Lying {
        body: &block,
        frame: Mat3::identity(),
        wall: Mat3::identity(),
        scale: 1.0,
        centre: Vec3::new(-0.25, 0.0, 0.5 - depth),
    };
    let found = lying.on(&table);
    let [(_, found)] = &found[..] else { panic!("{} contacts", found.len()) };
    close(found.force().z, -depth, 1e-5, "force");
    close(found.point.x, -0.125, 1e-9, "where it acts");
    assert!(found.force().xy().norm() < 1e-8 * depth, "{found:?}");
}

/// A brick slides and tumbles over the edges and corners of a plane of triangles, without any effect of them.
#[test]
fn a_brick_does_not_feel_the_edges_of_a_plane() {
    does_not_feel_the_edges_of_a_plane(meshes::BRICK);
}

/// Compares a particle thrown onto a plane with one thrown onto a plane of triangles.
pub(crate) fn does_not_feel_the_edges_of_a_plane(shape: &str) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sheet.obj");
    meshes::write_obj(&ragged(35, 0.14, 0.24, |_, _| 0.0), &file);
    let walls = [
        format!("mesh = \"{}\"", file.display()),
        "point = [0, 0, 0]\nnormal = [0, 0, 1]".to_owned(),
    ];
    let scenes = walls.map(|wall| {
        let text = meshes::alone(shape, &wall, -Vec3::z() * 98.1, 0.4);
        scene(&text.replace("restitution = 1", "restitution = 0.2"))
    });
    let start = meshes::at(Vec3::new(-0.03, -0.03, 0.0125), Vec3::new(1.0, 0.8, -0.1));
    let turned = Particle { quaternion: Quat::from_euler_angles(0.3, 0.4, 0.5), ..start };
    let mut benches = scenes.map(|scene| Bench::of(&scene, std::slice::from_ref(&turned)));
    let (mut off, mut largest, mut touching) = ([0.0_f64; 2], 0.0_f64, 0);
    for _ in 0..6000 {
        benches.iter_mut().for_each(Bench::step);
        let [m, p] = &benches;
        let state = |b: &Bench| (b.sim.particles.force[0].vector, b.sim.particles.position[0]);
        let (on_mesh, on_plane) = (state(m), state(p));
        off[0] = off[0].max((on_mesh.0 - on_plane.0).norm());
        off[1] = off[1].max((on_mesh.1 - on_plane.1).norm());
        largest = largest.max(on_plane.0.norm());
        assert_eq!(m.sim.contacts.len(), p.sim.contacts.len());
        touching += p.sim.contacts.len();
    }
    let way = benches[0].sim.particles.position[0] - turned.position;
    println!(
        "{touching} touches on {:.3} m, force off by {:e}, place by {:e} m",
        way.norm(),
        off[0] / largest,
        off[1]
    );
    assert!(touching > 2000 && way.norm() > 0.02);
    // Impacts on corners amplify rounding.
    assert!(off[0] < 1e-9 * largest && off[1] < 1e-9 * 0.01, "{off:?}");
}

/// Bricks that tumble in the drum of the ready scene.
#[test]
fn a_drum_of_bricks_is_the_same_on_any_number_of_ranks_and_after_a_restart() {
    is_the_same_in_the_drum([
        "kind = \"polyhedron\"\nedges = [3e-3, 2.4e-3, 2e-3]",
        "kind = \"rounded-polyhedron\"\nradius = 3e-4\nedges = [2.4e-3, 2e-3, 1.6e-3]",
    ]);
}

/// Checks the drum of the ready scene with two other shapes of the size of its balls.
pub(crate) fn is_the_same_in_the_drum([one, other]: [&str; 2]) {
    let text = std::fs::read_to_string("run/drum/scene.toml").unwrap();
    let ball = "kind = \"sphere\"\ndiameter = 3e-3";
    assert_eq!(text.matches(ball).count(), 2);
    let text = text
        .replacen(ball, one, 1)
        .replace(ball, other)
        .replace("spacing = 3.1e-3", "spacing = 4.6e-3")
        .replace("-9.81", "-98.1")
        .replace("\"drum.obj\"", "\"run/drum/drum.obj\"");
    let scene = scene(&text);
    let folder = tempfile::tempdir().unwrap();
    let state = OnRanks::of(&scene).the_same_everywhere(3000, folder.path());
    assert!(state.number("wall_contacts") > 30.0, "{:?}", state.number("wall_contacts"));
}
