//! Walls of triangles: planes with any triangulation, edges and corners in closed form, folds, energy, identical bits.

use crate::support::{Bench, MATERIAL, OnRanks, close, scene};
use dem_mpi::contact::{AgainstTriangleMesh, ContactResolver, Epa, Outcome, Posed, Touch};
use dem_mpi::ids::{GlobalId, ShapeId};
use dem_mpi::math::{Mat3, Quat, Vec3, rotation_about};
use dem_mpi::output::snapshot::Reader;
use dem_mpi::particles::records::Particle;
use dem_mpi::post::export;
use dem_mpi::random::Random;
use dem_mpi::scene::Scene;
use dem_mpi::shape::mesh;
use dem_mpi::shape::triangle_mesh::{MeshFacet, SurfaceError, TriangleMesh};
use dem_mpi::shape::{Ellipsoid, Polyhedron, Shape, Sphere, Superellipsoid};
use std::fmt::Write;
use std::path::Path;
use std::sync::Arc;

pub(crate) type Triangles = Vec<[Vec3; 3]>;

/// Squares with random corners in a plane, cut along either diagonal; the border is straight.
fn sheet(count: usize, width: f64, place: impl Fn(f64, f64) -> Vec3) -> Triangles {
    let mut random = Random::of(5, 0);
    let mut corners = Vec::new();
    for j in 0..=count {
        for i in 0..=count {
            let mut off = |k: usize| {
                let inside = k > 0 && k < count;
                let random = random.signed();
                if inside { 0.45 * random } else { 0.0 }
            };
            let step = width / count as f64;
            let (u, v) = ((i as f64 + off(i)) * step, (j as f64 + off(j)) * step);
            corners.push(place(u - 0.5 * width, v - 0.5 * width));
        }
    }
    cut(count, &corners, &mut random)
}

/// Triangles of `count` squares along each side, cut along either diagonal, from all of their corners row by row.
pub(crate) fn cut(count: usize, corners: &[Vec3], random: &mut Random) -> Triangles {
    let at = |i: usize, j: usize| corners[j * (count + 1) + i];
    let mut triangles = Vec::new();
    for j in 0..count {
        for i in 0..count {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            triangles.extend(if random.unit() < 0.5 {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            });
        }
    }
    triangles
}

/// The six sides of a box, each of two triangles.
pub(crate) fn cuboid(low: Vec3, high: Vec3) -> Triangles {
    let mut triangles = Vec::new();
    for axis in 0..3 {
        for side in [low, high] {
            let at = |u: f64, v: f64| {
                let mut corner = side;
                corner[(axis + 1) % 3] = u;
                corner[(axis + 2) % 3] = v;
                corner
            };
            let ([u0, v0], [u1, v1]) =
                ([low, high]).map(|c| [c[(axis + 1) % 3], c[(axis + 2) % 3]]).into();
            let [a, b, c, d] = [at(u0, v0), at(u1, v0), at(u1, v1), at(u0, v1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    triangles
}

pub(crate) fn write_obj(triangles: &Triangles, path: &Path) {
    let mut text = String::new();
    for corner in triangles.iter().flatten() {
        writeln!(text, "v {:?} {:?} {:?}", corner.x, corner.y, corner.z).unwrap();
    }
    for k in 0..triangles.len() {
        writeln!(text, "f {} {} {}", 3 * k + 1, 3 * k + 2, 3 * k + 3).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

/// Scene of one particle of a shape and a wall.
pub(crate) fn alone(shape: &str, wall: &str, gravity: Vec3, friction: f64) -> String {
    beside(shape, &format!("[[wall]]\nname = \"wall\"\n{wall}"), gravity, friction)
}

/// Scene of one particle and several walls, each with its own `[[wall]]`.
pub(crate) fn beside(shape: &str, walls: &str, gravity: Vec3, friction: f64) -> String {
    format!(
        r#"
gravity = [{:?}, {:?}, {:?}]
[domain]
low = [-0.2, -0.2, -0.2]
high = [0.2, 0.2, 0.2]
{walls}
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e5
friction = {friction:?}
restitution = 1
[[shape]]
name = "grain"
{shape}
[time]
step = 1e-5
"#,
        gravity.x, gravity.y, gravity.z
    )
}

const BALL: &str = "kind = \"sphere\"\nradius = 0.01";
const EGG: &str = "kind = \"ellipsoid\"\nsemi_axes = [0.012, 0.009, 0.007]";
pub(crate) const BRICK: &str = "kind = \"polyhedron\"\nedges = [0.02, 0.016, 0.012]";
pub(crate) const ROD: &str = "kind = \"spherocylinder\"\nlength = 0.012\nradius = 0.005";
const BLUNT: &str =
    "kind = \"superellipsoid\"\nsemi_axes = [0.011, 0.009, 0.008]\nexponents = [0.7, 0.8]";

pub(crate) fn at(position: Vec3, velocity: Vec3) -> Particle {
    Particle { velocity, ..Particle::at_rest(GlobalId(0), ShapeId(0), position) }
}

/// Smooth particles slide and roll over the edges and corners of a plane of triangles, without any effect of them.
#[test]
fn a_plane_of_triangles_is_the_plane() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sheet.obj");
    let tilt = Vec3::new(0.6, 0.0, 0.8);
    let along = Vec3::new(0.8, 0.0, -0.6);
    for (k, normal) in [Vec3::z(), tilt].into_iter().enumerate() {
        let place =
            |u: f64, v: f64| if k == 0 { Vec3::new(u, v, 0.0) } else { along * u + Vec3::y() * v };
        write_obj(&sheet(140, 0.14, place), &file);
        let mesh = format!("mesh = {file:?}");
        let plane =
            format!("point = [0, 0, 0]\nnormal = [{:?}, {:?}, {:?}]", normal.x, normal.y, normal.z);
        for shape in [BALL, EGG, BLUNT] {
            let scenes = [&mesh, &plane].map(|wall| {
                let text = alone(shape, wall, -normal * 98.1, 0.4);
                scene(&text.replace("restitution = 1", "restitution = 0.2"))
            });
            let surface = &scenes[0].walls[0].mesh.as_ref().unwrap().surface;
            if k == 0 {
                let faces = surface.facets().filter(|f| matches!(f, MeshFacet::Face { .. }));
                assert_eq!(faces.count(), 1, "a plane is one face");
            }
            let start = at(normal * 0.0102 - place(0.04, 0.03), place(1.0, 0.8) - normal * 0.1);
            let turned = Particle { quaternion: Quat::from_euler_angles(0.3, 0.4, 0.5), ..start };
            let mut benches = scenes.map(|scene| Bench::of(&scene, std::slice::from_ref(&turned)));
            let (mut force_off, mut place_off, mut largest, mut touching): (f64, f64, f64, usize) =
                (0.0, 0.0, 0.0, 0);
            let mut way = 0.0;
            for _ in 0..6000 {
                benches.iter_mut().for_each(Bench::step);
                let [m, p] = &benches;
                let force = |b: &Bench| b.sim.particles.force[0].vector;
                force_off = force_off.max((force(m) - force(p)).norm());
                largest = largest.max(force(p).norm());
                let off = m.sim.particles.position[0] - p.sim.particles.position[0];
                place_off = place_off.max(off.norm());
                assert_eq!(m.sim.contacts.len(), p.sim.contacts.len());
                touching += p.sim.contacts.len();
                way += p.sim.particles.velocity[0].norm() * 1e-5;
            }
            println!(
                "{k} {shape:?}: {touching} touches on {way:.3} m, force off by {:e}, place by {place_off:e} m",
                force_off / largest
            );
            assert!(touching > 2000 && way > 0.02);
            assert!(force_off < 1e-12 * largest && place_off < 1e-12 * 0.01);
        }
    }
}

fn touch(mesh: &Arc<TriangleMesh>, facet: u32, body: &Shape, centre: Vec3, turn: Quat) -> Outcome {
    let frame = turn.to_rotation_matrix().into_inner();
    let (shape, upright) = (Shape::TriangleMesh(mesh.clone()), Mat3::identity());
    let wall = Posed { facet, ..Posed::new(&shape, &upright) };
    AgainstTriangleMesh::default().touch(&Posed::new(body, &frame), &wall, &-centre, None)
}

/// All contacts of a body with a mesh, before any are merged.
fn touches(mesh: &Arc<TriangleMesh>, body: &Shape, centre: Vec3, turn: Quat) -> Vec<(u32, Touch)> {
    let near = mesh.near(&centre, body.bounding_radius());
    near.into_iter()
        .filter_map(|facet| match touch(mesh, facet, body, centre, turn) {
            Outcome::Touching(touch) => Some((facet, touch)),
            Outcome::Apart(_) => None,
            Outcome::Failed(why) => panic!("{why:?}"),
        })
        .collect()
}

/// A sphere at a face, an edge and a corner of a box, from all sides: the distance of its centre from the box.
#[test]
fn a_sphere_meets_a_box_in_closed_form() {
    let half = Vec3::new(1.0, 0.7, 0.5);
    let mesh = Arc::new(TriangleMesh::new(&cuboid(-half, half), 0.1).unwrap());
    assert_eq!(mesh.facet_count(), 6 + 12 + 8);
    let radius = 0.6;
    let (ball, mut of_kind) = (Shape::Sphere(Sphere { radius }), [0; 3]);
    let mut random = Random::of(1, 1);
    for _ in 0..20_000 {
        let centre = Vec3::from_fn(|k, _| (half[k] + radius) * random.signed());
        let nearest = Vec3::from_fn(|k, _| centre[k].clamp(-half[k], half[k]));
        let (way, outside) =
            (centre - nearest, (0..3).filter(|&k| centre[k].abs() > half[k]).count());
        if outside == 0 {
            continue;
        }
        let found = touches(&mesh, &ball, centre, Quat::identity());
        // Contacts from the outside; a sphere may reach the far side of a thin box, too.
        let front: Vec<_> =
            found.iter().filter(|(_, t)| t.normal.dot(&way) < -0.999_999 * way.norm()).collect();
        let overlap = radius - way.norm();
        if overlap <= 0.0 {
            assert!(found.is_empty(), "{centre} {found:?}");
            continue;
        }
        assert_eq!(front.len(), 1, "{centre}: {found:?}");
        let (_, touch) = front[0];
        assert!((touch.overlap - overlap).abs() < 1e-14);
        assert!((touch.point + way * ((radius - 0.5 * overlap) / way.norm())).norm() < 1e-14);
        of_kind[outside - 1] += 1;
    }
    assert!(of_kind.iter().all(|&count| count > 300), "{of_kind:?}");
}

/// Overlap with a box along a direction out of it.
fn overlap_along(body: &Posed, centre: &Vec3, half: &Vec3, n: &Vec3) -> f64 {
    -(body.support(&-n) + centre).dot(n) + half.dot(&n.abs())
}

/// Least overlap along directions out of a box, by brute force.
fn least(body: &Posed, centre: &Vec3, half: &Vec3) -> (f64, Vec3) {
    let overlap = |n: &Vec3| overlap_along(body, centre, half, n);
    let mut best = (f64::INFINITY, Vec3::z());
    let try_one = |n: Vec3, best: &mut (f64, Vec3)| {
        let found = overlap(&n);
        if found < best.0 {
            *best = (found, n);
        }
    };
    for k in 0..4000 {
        let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / 4000.0;
        let (s, c) = (2.399_963_229_728_653 * f64::from(k)).sin_cos();
        let ring = (1.0 - z * z).sqrt();
        try_one(Vec3::new(ring * c, ring * s, z), &mut best);
    }
    let mut random = Random::of(2, 2);
    for k in 0..6000 {
        let size = 0.1 * 0.997_f64.powi(k);
        let n = (best.1 + Vec3::from_fn(|_, _| size * random.signed())).normalize();
        try_one(n, &mut best);
    }
    best
}

/// Ellipsoids around a sharp lip, like at the orifice of a silo with thick walls. Contacts agree with EPA on the whole wedge and exist only where EPA
/// finds one.
#[test]
fn smooth_grains_meet_a_sharp_lip_only_where_they_overlap_it() {
    for degrees in [25.0, 45.0, 70.0, 100.0] {
        // Two walls that meet in an edge along y through the origin; the wedge between them is solid.
        let up = Vec3::new(
            libm::cos(f64::to_radians(degrees)),
            0.0,
            libm::sin(f64::to_radians(degrees)),
        );
        let corners = [-3.0, 3.0]
            .map(|y| [Vec3::zeros(), Vec3::x() * 3.0, up * 3.0].map(|at| at + Vec3::y() * y));
        let [near, far] = corners;
        let mut triangles: Triangles = vec![[near[0], near[1], near[2]], [far[0], far[2], far[1]]];
        for (k, l) in [(0, 1), (1, 2), (2, 0)] {
            triangles.extend([[near[k], far[k], far[l]], [near[k], far[l], near[l]]]);
        }
        let mesh = Arc::new(TriangleMesh::new(&triangles, 0.1).unwrap());
        let wedge = Polyhedron::new(&corners.concat()).unwrap();
        // The hull has its own centre and axes.
        let (own, axes) =
            (wedge.placement().centre, wedge.placement().axes.to_rotation_matrix().into_inner());
        let wedge = Shape::Polyhedron(Box::new(wedge));
        let egg = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(0.6, 0.2, 0.15) });
        let (mut random, mut met, mut apart) = (Random::of(5, 5), 0, 0);
        let (mut several, mut worst) = (0, 0.0_f64);
        while met < 300 || apart < 3000 {
            let centre = Vec3::new(0.7 * random.signed(), random.signed(), 0.7 * random.signed());
            let turn = random.rotation();
            let frame = turn.to_rotation_matrix().into_inner();
            let body = Posed::new(&egg, &frame);
            let expected =
                Epa::new(1e-12).touch(&body, &Posed::new(&wedge, &axes), &(own - centre), None);
            match expected {
                Outcome::Apart(_) => {
                    let found = touches(&mesh, &egg, centre, turn);
                    assert!(found.is_empty(), "{degrees}: {centre} {turn}: {found:?}");
                    apart += 1;
                }
                Outcome::Touching(least) if least.overlap < 0.02 => {
                    let found = touches(&mesh, &egg, centre, turn);
                    let deep = |(_, touch): &(u32, Touch)| touch.overlap;
                    let (facet, touch) = found
                        .iter()
                        .min_by(|one, other| deep(one).total_cmp(&deep(other)))
                        .unwrap_or_else(|| panic!("{degrees}: {centre} {turn}: {least:?}"));
                    worst = worst.max((touch.overlap - least.overlap).abs());
                    // Other contacts occur only with the lip far inside the body.
                    for (other, _) in found.iter().filter(|(other, _)| other != facet) {
                        assert!(mesh.are_face_and_edge(*facet, *other), "{found:?} {least:?}");
                        several += 1;
                    }
                    met += 1;
                }
                _ => {}
            }
        }
        println!(
            "{degrees} degrees: {met} touch, {several} twice, off by {worst:.1e}; {apart} do not"
        );
        assert!(worst < 1e-9, "{worst:e}");
    }
}

/// A long body beside the rim of a sheet touches only the sheet itself, however far it reaches over the sheet's plane.
#[test]
fn a_long_grain_beside_a_rim_touches_only_what_is_there() {
    let [a, b, c, d] =
        [[-4.0, -4.0], [0.0, -4.0], [0.0, 4.0], [-4.0, 4.0]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let mesh = Arc::new(TriangleMesh::new(&[[a, b, c], [a, c, d]], 0.1).unwrap());
    let axes = Vec3::new(1.0, 0.05, 0.07);
    let egg = Shape::Ellipsoid(Ellipsoid { semi_axes: axes });
    // Least level of the ellipsoid on the sheet: below 1 they intersect.
    let level = |centre: Vec3, turn: Quat| {
        let seen = |way: Vec3| (turn.inverse() * way).component_div(&axes);
        let (x, y, at) = (seen(Vec3::x()), seen(Vec3::y()), seen(-centre));
        let (xx, xy, yy) = (x.dot(&x), x.dot(&y), y.dot(&y));
        let (ax, ay) = (at.dot(&x), at.dot(&y));
        let across = (xy * ay - yy * ax) / (xx * yy - xy * xy);
        let [u, v] = if across <= 0.0 {
            [across, (xy * ax - xx * ay) / (xx * yy - xy * xy)]
        } else {
            [0.0, -ay / yy]
        };
        (at + x * u + y * v).norm()
    };
    let mut random = Random::of(6, 6);
    let (mut met, mut apart) = (0, 0);
    for _ in 0..40_000 {
        let centre = Vec3::new(0.6 * random.signed(), 0.5 * random.signed(), 0.6 * random.signed());
        let turn = random.rotation();
        let (level, found) = (level(centre, turn), touches(&mesh, &egg, centre, turn));
        if level > 1.0 {
            assert!(found.is_empty(), "{level} {centre} {turn}: {found:?}");
            apart += 1;
        } else if level > 0.95 {
            assert!(!found.is_empty(), "{level} {centre} {turn}");
            met += 1;
        }
    }
    assert!(met > 300 && apart > 3000, "{met} {apart}");
}

/// Ellipsoids and superellipsoids at the surface of a box have one contact, with the least overlap with the whole box.
#[test]
fn smooth_grains_meet_a_box_once_where_they_overlap_it_least() {
    let half = Vec3::new(1.0, 0.7, 0.5);
    let mesh = Arc::new(TriangleMesh::new(&cuboid(-half, half), 0.1).unwrap());
    let egg = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(0.5, 0.3, 0.2) });
    let blunt = Shape::Superellipsoid(Superellipsoid::new(Vec3::new(0.4, 0.3, 0.2), [0.7, 0.9]));
    let (mut of_kind, mut worst) = ([0; 3], [0.0_f64; 2]);
    let mut random = Random::of(3, 3);
    for k in 0..500 {
        let body = if k % 2 == 0 { &egg } else { &blunt };
        let turn = random.rotation();
        let frame = turn.to_rotation_matrix().into_inner();
        let posed = Posed::new(body, &frame);
        // This depth along a direction out of the box.
        let mut out = Vec3::from_fn(|_, _| random.signed());
        match k % 3 {
            0 => out = Vec3::ith(k / 3 % 3, out.x.signum()),
            1 => out[k / 3 % 3] = 0.0,
            _ => {}
        }
        out.normalize_mut();
        let on_box = half.component_mul(&out.map(|x| if x == 0.0 { 0.3 } else { x.signum() }));
        let centre = on_box - posed.support(&-out) - out * 1e-3;
        let (found_by_force, normal) = least(&posed, &centre, &half);
        let found = touches(&mesh, body, centre, turn);
        assert_eq!(found.len(), 1, "{k}: {found:?}, {found_by_force} along {normal}");
        let (facet, touch) = &found[0];
        // Any direction bounds the least overlap from above, so this is the least one to rounding.
        let bound = overlap_along(&posed, &centre, &half, &-touch.normal);
        worst[0] = worst[0].max((touch.overlap - bound).abs());
        worst[1] = worst[1].max(touch.overlap - found_by_force);
        of_kind[match mesh.facet(*facet) {
            MeshFacet::Face { .. } => 0,
            MeshFacet::Edge { .. } => 1,
            MeshFacet::Corner { .. } => 2,
            MeshFacet::Strip(_) | MeshFacet::Rim(_) => unreachable!("a box has no strips"),
        }] += 1;
    }
    println!("{of_kind:?} {worst:?}");
    assert!(of_kind.iter().all(|&count| count > 100), "{of_kind:?}");
    assert!(worst[0] < 1e-14 && worst[1] < 1e-14, "{worst:?}");
}

/// In the fold between two sheets a ball has two contacts, or one if the fold counts as smooth.
#[test]
fn a_fold_has_two_contacts_and_a_smooth_one_has_one() {
    let folder = tempfile::tempdir().unwrap();
    for (angle, smooth, contacts) in
        [(90.0, 10.0, 2), (11.0, 10.0, 2), (9.0, 10.0, 1), (9.0, 5.0, 2)]
    {
        let half = 0.5 * f64::to_radians(angle);
        let place = |u: f64, v: f64| Vec3::new(u * half.cos(), v, u.abs() * half.sin());
        let triangles: Triangles = [(-0.05, 0.0), (0.0, 0.05)]
            .into_iter()
            .flat_map(|(low, high)| {
                let [a, b] = [place(low, -0.05), place(high, -0.05)];
                let [c, d] = [place(high, 0.05), place(low, 0.05)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let file = folder.path().join("fold.obj");
        write_obj(&triangles, &file);
        let wall = format!("mesh = {file:?}\nsmooth = {smooth:?}");
        let text = alone(BALL, &wall, Vec3::zeros(), 0.0);
        let mut bench = Bench::of(
            &scene(&text),
            &[at(Vec3::z() * ((0.01 - 1e-6) / half.cos()), Vec3::zeros())],
        );
        assert_eq!(bench.sim.contacts.len(), contacts, "{angle} {smooth}");
        bench.step();
        let lifted = bench.sim.particles.force[0].vector;
        let expected = contacts as f64 * 1e5 * 1e-6 * if contacts == 2 { half.cos() } else { 1.0 };
        assert!((lifted.norm() / expected - 1.0).abs() < 1e-2, "{lifted} {expected}");
    }
}

/// A ball on a face beside a slit keeps its contact with the face, independent of the rim beyond the slit.
#[test]
fn a_ball_beside_a_slit_rests_on_the_face() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("slit.obj");
    let (width, overlap) = (1.5e-3, 2e-4);
    let corner = |x: f64, y: f64| Vec3::new(x, y, 0.0);
    let mut triangles: Triangles = Vec::new();
    // Around the slit 0 < x < width, |y| < 0.02.
    let (xs, ys) = ([-0.03, 0.0, width, 0.03], [-0.03, -0.02, 0.02, 0.03]);
    for (i, j) in (0..9).map(|k| (k % 3, k / 3)).filter(|&ij| ij != (1, 1)) {
        let [a, b] = [corner(xs[i], ys[j]), corner(xs[i + 1], ys[j])];
        let [c, d] = [corner(xs[i + 1], ys[j + 1]), corner(xs[i], ys[j + 1])];
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    write_obj(&triangles, &file);
    let text = alone(BALL, &format!("mesh = {file:?}\nsmooth = 5"), Vec3::zeros(), 0.0);
    let mut deepest: Vec<f64> = Vec::new();
    for x in [-1e-4, -3e-4, -6e-4, -1e-3] {
        let bench =
            Bench::of(&scene(&text), &[at(Vec3::new(x, 0.0, 0.01 - overlap), Vec3::zeros())]);
        let found: Vec<f64> = bench.sim.contacts.iter().map(|(_, g)| g.overlap).collect();
        deepest.push(found.iter().copied().fold(0.0, f64::max));
        assert_eq!(
            found.len(),
            1 + usize::from((width - x).hypot(0.01 - overlap) < 0.01),
            "{x}: {found:?}"
        );
    }
    assert!(deepest.iter().all(|found| (found / overlap - 1.0).abs() < 1e-9), "{deepest:?}");
}

/// In a tube that is hardly wider, a ball touches several strips of a fine mesh, which count as one surface.
#[test]
fn a_ball_in_a_tight_tube_has_one_contact() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tube.obj");
    let radius = 0.0125;
    write_obj(&crate::walls::faces_on_meshes::drum(radius, 0.05, 90), &file);
    let wall = format!("mesh = {file:?}\nsmooth = 10");
    let text = alone(BALL, &wall, Vec3::zeros(), 0.0);
    for degrees in [0.0, 1.0, 2.0, 3.0] {
        let angle = f64::to_radians(degrees);
        let down = Vec3::new(angle.sin(), 0.0, -angle.cos());
        let place = down * (radius - 0.01 + 0.01 * radius);
        let bench = Bench::of(&scene(&text), &[at(place, Vec3::zeros())]);
        assert_eq!(bench.sim.contacts.len(), 1, "{degrees} degrees");
    }
}

/// Particles at the edges and corners of a box conserve energy to the order of the step, without friction and damping. With friction the energy error
/// falls as fast.
#[test]
fn energy_is_kept_over_edges_and_corners() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("box.obj");
    write_obj(&cuboid(Vec3::repeat(-0.03), Vec3::repeat(0.03)), &file);
    let wall = format!("mesh = {file:?}");
    let shapes = [BALL, EGG, BRICK, ROD];
    for (shape, friction) in [0.0, 0.5].into_iter().flat_map(|mu| shapes.map(|shape| (shape, mu))) {
        let missing = |dt: f64| {
            let mut worst: f64 = 0.0;
            let mut touched = 0;
            for k in 0..12 {
                let mut random = Random::of(4, k);
                let text = alone(shape, &wall, Vec3::zeros(), friction)
                    .replace("step = 1e-5", &format!("step = {dt:?}"));
                let edge =
                    Vec3::new(0.03, if k % 2 == 0 { 0.03 } else { 0.01 * random.signed() }, 0.03);
                let aim = edge + Vec3::from_fn(|_, _| 0.004 * random.signed());
                let way = Vec3::new(1.0, random.signed(), 1.0).normalize();
                let turned =
                    Particle { quaternion: random.rotation(), ..at(aim + way * 0.016, -way) };
                let mut bench = Bench::of(&scene(&text), &[turned]);
                let before = bench.measure().kinetic();
                for _ in 0..(0.02 / dt) as usize {
                    bench.step();
                    touched += bench.sim.contacts.len();
                }
                let after = bench.measure();
                assert_eq!(bench.sim.contacts.len(), 0);
                let lost = if friction == 0.0 { before - after.kinetic() } else { after.missing() };
                worst = worst.max(lost.abs() / before);
            }
            assert!(touched > 0);
            worst
        };
        let [long, short] = [missing(1e-5), missing(2.5e-6)];
        println!("{shape:?}, friction {friction}: {long:e}, {short:e}");
        assert!(long < 2e-2 && short < 0.35 * long, "{long:e} {short:e}");
    }
}

/// In a drum of strips a ball oscillates like in a cylinder, more accurately with more strips.
#[test]
fn a_drum_of_triangles_comes_to_the_cylinder() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("drum.obj");
    let (drum, radius) = (0.05, 0.01);
    let off = |strips: u32| {
        // Radius between corners and strips that gives the area of the cylinder.
        let turn = std::f64::consts::TAU / f64::from(strips);
        let wide = drum * (turn / turn.sin()).sqrt();
        let place = |k: u32, y: f64| {
            let (s, c) = (f64::from(k) * turn).sin_cos();
            Vec3::new(wide * s, y, -wide * c)
        };
        let mut triangles = Vec::new();
        for k in 0..strips {
            let [a, b] = [place(k, -0.02), place(k + 1, -0.02)];
            let [c, d] = [place((k + 1) % strips, 0.02), place(k, 0.02)];
            let b = if k + 1 == strips { place(0, -0.02) } else { b };
            triangles.extend([[a, b, c], [a, c, d]]);
        }
        write_obj(&triangles, &file);
        let text = alone(BALL, &format!("mesh = {file:?}"), -Vec3::z() * 9.81, 0.0);
        // The ball slides to and fro.
        let swing: f64 = 0.4;
        let start = Vec3::new(swing.sin(), 0.0, -swing.cos()) * (drum - radius);
        let mut bench = Bench::of(&scene(&text), &[at(start, Vec3::zeros())]);
        let (mut before, mut times) = (start.x, Vec::new());
        for step in 1..60_000_u32 {
            bench.step();
            let x = bench.sim.particles.position[0].x;
            if before > 0.0 && x <= 0.0 {
                times.push(f64::from(step) * 1e-5);
            }
            before = x;
        }
        let period = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
        let expected = std::f64::consts::TAU
            * ((drum - radius) / 9.81).sqrt()
            * (1.0 + swing.powi(2) / 16.0 + 11.0 * swing.powi(4) / 3072.0);
        (period / expected - 1.0).abs()
    };
    let all = [36, 72, 144, 288].map(off);
    println!("periods are off by {all:?}");
    assert!(all[3] < 3e-3, "{all:?}");
}

/// A rotating tray with a hump of triangles below a crowd.
fn tray(folder: &Path) -> Scene {
    let file = folder.join("tray.obj");
    let mut triangles =
        sheet(6, 0.08, |u, v| Vec3::new(u, v, 4e-3 * libm::sin(90.0 * u) * libm::sin(110.0 * v)));
    let mut tub = cuboid(Vec3::new(-0.02, -0.02, -0.01), Vec3::new(0.02, 0.02, 0.06));
    // The tub has no lid.
    tub.retain(|t| t.iter().any(|c| c.z < 0.0));
    triangles.extend(tub);
    write_obj(&triangles, &file);
    let file = file.display();
    scene(&format!(
        r#"
seed = 3
gravity = [1.0, 0.5, -98.1]
global_damping = 2.0
[domain]
low = [-0.05, -0.05, -0.05]
high = [0.05, 0.05, 0.1]
walls = ["-x", "+x", "-y", "+y", "-z", "+z"]
[[wall]]
name = "tray"
mesh = "{file}"
shift = [0.001, 0.0, 0.0]
rotation = {{ about = [0.0, 0.0, 0.0], axis = [0.1, 0.2, 1.0], rate = 15.0 }}
{MATERIAL}
[[shape]]
name = "long"
kind = "ellipsoid"
diameter = 0.003
aspect_ratio = 2.0
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.0016
[[shape]]
name = "blunt"
kind = "superellipsoid"
semi_axes = [0.0019, 0.0016, 0.0013]
exponents = [0.7, 0.8]
[[fill.lattice]]
shapes = {{ long = 2, ball = 1, blunt = 1 }}
low = [-0.017, -0.017, 0.008]
high = [0.017, 0.017, 0.05]
spacing = 0.005
velocity = [0.3, -0.2, -1.0]
"#
    ))
}

#[test]
fn a_turning_tray_is_the_same_on_any_number_of_ranks_and_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let scene = tray(folder.path());
    let steps = 2400;
    let (alone, meshed) = OnRanks::of(&scene).run_and_look(1, steps, |sim| {
        let first = sim.particles.first_facet();
        let on_mesh = |pair: &dem_mpi::contact::Pair| {
            pair.b.index() >= first && sim.particles.wall_of(pair.b) == Some(6)
        };
        sim.contacts.iter().filter(|(pair, _)| on_mesh(pair)).count()
    });
    let count = alone.bits.len();
    assert!(count > 150 && meshed[0] > 40, "{count} with {meshed:?} contacts");
    for ranks in [2, 3, 4, 8] {
        alone.expect(&OnRanks::of(&scene).run(ranks, steps), &format!("{ranks} ranks"));
    }
    let saved = folder.path().join("saved");
    OnRanks::of(&scene).leaves_no_trace(&alone, steps, &[[1, 3], [4, 1]], &saved);

    // The snapshot has the tray in its current position.
    let reader = Reader::open(&saved).unwrap();
    let mesh = &scene.walls[6].mesh.as_ref().unwrap().surface;
    let axis = Vec3::new(0.1, 0.2, 1.0).normalize();
    let turn = rotation_about(&axis, 15.0 * reader.header().time);
    let placed = reader.header().triangles_in_place();
    assert_eq!(placed.len(), mesh.len());
    for ((wall, found), expected) in placed.iter().zip(mesh.triangles()) {
        assert_eq!(*wall, 6);
        let off = |k: usize| (found[k] - turn * expected[k]).norm();
        assert!((0..3).all(|k| off(k) < 1e-15), "{found:?}");
    }
    // The six planes are exported, too, each as a polygon.
    assert!(export::walls(&reader).unwrap().ends.len() > mesh.len());
}

/// A box with separately cut sides, so that corners lie within sides of others.
fn patchwork(half: &Vec3, off: f64) -> Triangles {
    let (mut random, mut all) = (Random::of(3, 0), Vec::new());
    for (side, count) in [5, 3, 4, 7, 2, 6].into_iter().enumerate() {
        let (axis, out) = (side / 2, if side % 2 == 0 { 1.0 } else { -1.0 });
        let mut corners = Vec::new();
        for j in 0..=count {
            for i in 0..=count {
                let mut corner = Vec3::repeat(out);
                corner[(axis + 1) % 3] = 2.0 * i as f64 / count as f64 - 1.0;
                corner[(axis + 2) % 3] = 2.0 * j as f64 / count as f64 - 1.0;
                let noise = Vec3::from_fn(|_, _| off * random.signed());
                corners.push(corner.component_mul(half) + noise);
            }
        }
        all.extend(cut(count, &corners, &mut random));
    }
    all
}

/// Triangles that share no whole sides still form a box, with one contact at the distance of its surface. Corners that differ slightly can be welded.
#[test]
fn sides_that_are_cut_otherwise_than_their_neighbours_hang_together() {
    let half = Vec3::new(1.0, 0.7, 0.5);
    let radius = 0.1;
    let ball = Shape::Sphere(Sphere { radius });
    for (off, weld, rounding) in [(0.0, 0.0, 1e-14), (1e-9, 1e-8, 1e-8)] {
        let triangles = patchwork(&half, off);
        let mesh = TriangleMesh::with_images(&triangles, triangles.len(), weld, 0.1).unwrap();
        let findings = mesh.findings();
        assert!(findings.cut > 20 && findings.open_edges == 0, "{findings:?}");
        assert_eq!(findings.crowded_edges, 0);
        let (mesh, mut random, mut met) = (Arc::new(mesh), Random::of(1, 2), 0);
        for _ in 0..20_000 {
            let centre = Vec3::from_fn(|k, _| (half[k] + radius) * random.signed());
            let nearest = Vec3::from_fn(|k, _| centre[k].clamp(-half[k], half[k]));
            let way = centre - nearest;
            let touches = touches(&mesh, &ball, centre, Quat::identity());
            if way == Vec3::zeros() || (way.norm() - radius).abs() < rounding {
                continue;
            }
            assert_eq!(touches.is_empty(), way.norm() > radius, "{centre:?}");
            assert!(off > 0.0 || touches.len() <= 1, "{centre:?}: {touches:?}");
            // A rough plane consists of many, and the deepest contact counts.
            let overlaps = touches.iter().map(|(_, touch)| touch.overlap);
            if let Some(overlap) = overlaps.reduce(f64::max) {
                met += 1;
                let expected = radius - way.norm();
                assert!((overlap - expected).abs() < rounding, "{overlap} {expected}");
            }
        }
        assert!(met > 1000, "{met}");
    }
    let apart = patchwork(&half, 1e-9);
    assert!(TriangleMesh::new(&apart, 0.1).unwrap().findings().open_edges > 100);
}

/// Any triangles give a surface or an error, without delay.
#[test]
fn any_triangles_are_a_surface_or_refused() {
    let (mut surfaces, mut refused) = (0, 0);
    for id in 0..3000 {
        let mut random = Random::of(4, id);
        let count = 2 + (20.0 * random.unit()) as usize;
        let flat = if id % 2 == 0 { 0.0 } else { 1.0 };
        let mut corner = || {
            // Some corners are on a grid, so that many lie on sides of others.
            let place = Vec3::from_fn(|_, _| random.signed());
            let place = if random.unit() < 0.7 { place.map(|x| (3.0 * x).round()) } else { place };
            Vec3::new(place.x, place.y, flat * place.z)
        };
        let triangles: Triangles = (0..count).map(|_| [0; 3].map(|_| corner())).collect();
        let weld = [0.0, 1e-6, 0.1, 1.0][id as usize % 4];
        match TriangleMesh::with_images(&triangles, count, weld, 0.1) {
            Ok(mesh) => {
                let area = |[a, b, c]: [Vec3; 3]| (b - a).cross(&(c - a)).norm();
                assert!(mesh.triangles().all(|corners| area(corners) > 0.0), "{triangles:?}");
                surfaces += usize::from(mesh.facet_count() > 0);
            }
            Err(_) => refused += 1,
        }
    }
    println!("{surfaces} surfaces, {refused} refused");
    assert!(surfaces > 1500, "{surfaces} {refused}");
}

#[test]
fn meshes_that_are_no_surface_are_refused_and_others_are_described() {
    let square = |a: Vec3, b: Vec3, c: Vec3, d: Vec3| vec![[a, b, c], [a, c, d]];
    let at = |x: f64, y: f64| Vec3::new(x, y, 0.0);
    let whole = square(at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0));
    // A corner in the middle of a side.
    let mut halves = whole.clone();
    halves.extend(square(at(1.0, 0.0), at(2.0, 0.0), at(2.0, 0.5), at(1.0, 0.5)));
    let mesh = TriangleMesh::new(&halves, 0.1).unwrap();
    assert_eq!((mesh.len(), mesh.findings().cut, mesh.findings().open_edges), (5, 1, 7));
    assert!(mesh.summary().contains("1 divisions of triangles"), "{}", mesh.summary());
    assert_eq!(
        TriangleMesh::new(&[[at(0.0, 0.0), at(1.0, 1.0), at(2.0, 2.0)]], 0.1),
        Err(SurfaceError::Empty)
    );
    let nan = [[at(0.0, 0.0), at(1.0, 1.0), at(f64::NAN, 2.0)]];
    assert_eq!(TriangleMesh::new(&nan, 0.1), Err(SurfaceError::NotFinite(0)));
    // A duplicate, one without area, one in another orientation, and three at one edge.
    let mut odd = whole.clone();
    odd.push(whole[0]);
    odd.push([at(0.0, 0.0), at(0.0, 0.0), at(1.0, 0.0)]);
    odd.push([at(1.0, 0.0), at(1.0, 1.0), at(2.0, 0.0)]);
    odd.push([at(1.0, 0.0), at(1.0, 1.0), Vec3::new(1.0, 0.0, 1.0)]);
    let mesh = TriangleMesh::new(&odd, 0.1).unwrap();
    let findings = mesh.findings();
    assert_eq!((findings.left_out, findings.crowded_edges), (2, 1));
    assert!(mesh.summary().contains("1 edges of three or more triangles"), "{}", mesh.summary());
    // A ball in front of that edge does not touch the edge, as the third triangle stands there.
    let ball = Shape::Sphere(Sphere { radius: 0.1 });
    close(
        touches(&Arc::new(mesh), &ball, Vec3::new(0.95, 0.5, 0.09), Quat::identity()).len() as f64,
        2.0,
        0.0,
        "contacts in a fold",
    );
}

/// A convex polygon is cut into triangles; a concave one is rejected from any starting corner.
#[test]
fn polygons_with_a_dent_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("polygon.obj");
    let read = |corners: &[[f64; 2]], first: usize| {
        let mut text = String::new();
        for [x, y] in corners {
            writeln!(text, "v {x} {y} 0").unwrap();
        }
        text += "f";
        (0..corners.len()).for_each(|k| {
            write!(text, " {}", (first + k) % corners.len() + 1).unwrap();
        });
        std::fs::write(&path, text).unwrap();
        mesh::triangles(&path)
    };
    let area = |triangles: &Triangles| -> f64 {
        triangles.iter().map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a)).norm()).sum()
    };
    let house = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 3.0], [0.0, 2.0]];
    let notched = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 0.5], [0.0, 2.0]];
    let star: [[f64; 2]; 5] = std::array::from_fn(|k| {
        let angle = 0.8 * std::f64::consts::PI * k as f64;
        [angle.cos(), angle.sin()]
    });
    // A corner within a side, rotated and written with six digits, still counts as convex.
    let side = [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    for k in 0..40 {
        let (sine, cosine) = (0.157 * f64::from(k)).sin_cos();
        let six = |x: f64| (1e6 * x).round() * 1e-6;
        let turned = side.map(|[x, y]| [six(cosine * x - sine * y), six(sine * x + cosine * y)]);
        for first in 0..5 {
            assert_eq!(read(&turned, first).unwrap().len(), 3, "{k} {first}");
        }
    }
    // Lines are not faces.
    std::fs::write(&path, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nl 1 2 4 3\np 4\n").unwrap();
    assert_eq!(mesh::triangles(&path).unwrap().len(), 1);
    for first in 0..5 {
        let whole = read(&house, first).unwrap();
        assert_eq!(whole.len(), 3);
        close(area(&whole), 5.0, 1e-15, "area");
        for dented in [&notched, &star] {
            let refused = read(dented, first).unwrap_err().to_string();
            assert!(refused.contains("5 corners that is not convex"), "{refused}");
        }
    }
}

/// A binary file with more triangles than it declares is rejected; a text may be in capitals.
#[test]
fn files_of_stl_are_read_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("two.stl");
    let mut bytes = vec![0_u8; 80];
    bytes.extend(2_u32.to_le_bytes());
    for k in 0..2 {
        for place in [0.0_f32, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, k as f32] {
            bytes.extend(place.to_le_bytes());
        }
        bytes.extend([0, 0]);
    }
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(mesh::triangles(&path).unwrap().len(), 2);
    // The header begins with `solid`, and the triangle count has the byte of a line feed.
    let mut many = bytes[..84].to_vec();
    many[..11].copy_from_slice(b"solid plate");
    many[80] = 10;
    many.extend(bytes[84..134].repeat(10));
    std::fs::write(&path, &many).unwrap();
    assert_eq!(mesh::triangles(&path).unwrap().len(), 10);
    bytes[80] = 1;
    std::fs::write(&path, &bytes).unwrap();
    let refused = mesh::triangles(&path).unwrap_err().to_string();
    assert!(refused.contains("50 more than its 1 triangles"), "{refused}");
    let text = "SOLID A\nFACET NORMAL 0 0 1\nOUTER LOOP\nVERTEX 0 0 0\nVERTEX 1E0 0 0\nVERTEX 0 1 0\nENDLOOP\nENDFACET\nENDSOLID A\n";
    for normal in ["0 0 1", "nan nan nan", "-NAN(IND) 0 0"] {
        std::fs::write(&path, text.replace("0 0 1\nOUTER", &format!("{normal}\nOUTER"))).unwrap();
        assert_eq!(mesh::triangles(&path).unwrap().len(), 1, "{normal}");
    }
    // A byte order mark, a name that is not UTF-8, line ends of an old Macintosh.
    let marked = [
        "\u{feff}".as_bytes(),
        b"solid K\xf6rper\r",
        text[8..].to_lowercase().replace('\n', "\r").as_bytes(),
    ]
    .concat();
    std::fs::write(&path, marked).unwrap();
    assert_eq!(mesh::triangles(&path).unwrap().len(), 1);
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    std::fs::write(&path, format!("solid plate\n{}endsolid plate\n", facet.repeat(4))).unwrap();
    assert_eq!(mesh::triangles(&path).unwrap().len(), 4);
}

/// Boxes beside a tilted sheet and boxes through it, by the distances of their corners.
#[test]
fn boxes_know_whether_a_triangle_comes_into_them() {
    let place = |u: f64, v: f64| Vec3::new(0.6 * u, v, 0.8 * u);
    let mesh = TriangleMesh::new(&sheet(5, 4.0, place), 0.1).unwrap();
    let (normal, mut random) = (Vec3::new(0.8, 0.0, -0.6), Random::of(8, 8));
    let mut counts = [0; 2];
    for _ in 0..2000 {
        let middle = Vec3::from_fn(|_, _| 0.5 * random.signed());
        let half = Vec3::from_fn(|_, _| 0.02 + 0.2 * random.unit());
        let comes = middle.dot(&normal).abs() < half.dot(&normal.abs());
        assert_eq!(mesh.comes_into(&(middle - half), &(middle + half)), comes);
        counts[usize::from(comes)] += 1;
    }
    assert!(counts.iter().all(|&count| count > 300), "{counts:?}");
}

/// A surface over two coordinates.
fn wavy(u: f64, v: f64) -> Vec3 {
    Vec3::new(u, v, 0.1 * libm::sin(7.0 * u) * libm::sin(5.0 * v))
}

/// Triangles in numbers like in large files: found through cells, with little memory for each.
#[test]
fn a_hundred_thousand_triangles_are_read_and_searched_quickly() {
    let triangles = sheet(224, 2.0, wavy);
    let mesh = TriangleMesh::new(&triangles, 0.1).unwrap();
    println!("{}", mesh.summary());
    assert!(mesh.len() > 100_000 && mesh.bytes() < 1000 * mesh.len());
    let mut random = Random::of(7, 7);
    for _ in 0..2000 {
        let point = wavy(random.signed(), random.signed());
        assert!(!mesh.near(&point, 0.01).is_empty());
        assert!(mesh.near(&(point + Vec3::z()), 0.01).is_empty());
    }
}

/// Initial positions of balls on [`wavy`].
const BEGIN: [[f64; 2]; 5] = [[-0.7, -0.6], [-0.2, 0.5], [0.1, -0.3], [0.4, 0.7], [0.8, -0.1]];
const BALL_RADIUS: f64 = 0.02;

/// Scene of balls that roll down a surface from a file.
fn rolling(file: &Path) -> Scene {
    let mut lattices = String::new();
    for [u, v] in BEGIN {
        let along = |axis: Vec3| (wavy(u + 1e-6 * axis.x, v + 1e-6 * axis.y) - wavy(u, v)) * 1e6;
        let (x, y) = (along(Vec3::x()), along(Vec3::y()));
        let place = wavy(u, v) + x.cross(&y).normalize() * (BALL_RADIUS - 1e-4);
        let way = (x - y).normalize() * 0.8;
        let [place, way] = [place, way].map(|v| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z));
        writeln!(
            lattices,
            "[[fill.lattice]]\nfirst = {place}\ncount = [1, 1, 1]\nvelocity = {way}"
        )
        .unwrap();
    }
    scene(&format!(
        r#"
gravity = [0, 0, -9.81]
[domain]
low = [-1.1, -1.1, -0.3]
high = [1.1, 1.1, 0.4]
[[wall]]
name = "ground"
mesh = "{}"
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e4
friction = 0.4
restitution = 0.3
[[shape]]
name = "ball"
kind = "sphere"
radius = {BALL_RADIUS:?}
{lattices}
[time]
step = 2e-4
"#,
        file.display()
    ))
}

/// Balls roll on a large mesh like on the triangles near them alone, on any number of ranks.
#[test]
fn balls_roll_on_a_hundred_thousand_triangles_as_on_those_near_them() {
    let folder = tempfile::tempdir().unwrap();
    let all = sheet(224, 2.0, wavy);
    // Two diameters around the whole path of a ball, which is shorter than two radii.
    let reach = 6.0 * BALL_RADIUS;
    let is_near = |corner: &Vec3| BEGIN.iter().any(|&[u, v]| (corner - wavy(u, v)).norm() < reach);
    let near: Triangles = all.iter().filter(|of| of.iter().any(is_near)).copied().collect();
    assert!(all.len() > 100_000 && near.len() < all.len() / 10 && near.len() > 1000);
    let [all, near] = [("all.obj", all), ("near.obj", near)].map(|(name, triangles)| {
        let file = folder.path().join(name);
        write_obj(&triangles, &file);
        rolling(&file)
    });
    let alone = OnRanks::of(&all).run(1, 200);
    assert!(OnRanks::of(&all).run(3, 200) == alone, "3 ranks");
    let few = OnRanks::of(&near).run(1, 200);
    let contacts = alone.number("wall_contacts");
    assert!(contacts >= 3.0, "{contacts} contacts");
    let vectors = |row: &[u64]| {
        let at = |k: usize| Vec3::from_fn(|axis, _| f64::from_bits(row[3 * k + axis]));
        [at(0), at(2)]
    };
    let (mut way, mut largest, mut off) = (f64::INFINITY, 0.0_f64, [0.0_f64; 2]);
    for (((id, row), (other, beside)), [u, v]) in alone.bits.iter().zip(&few.bits).zip(BEGIN) {
        assert_eq!(id, other);
        let ([place, force], [of_few, force_of_few]) = (vectors(row), vectors(beside));
        way = way.min((place - wavy(u, v)).norm() - BALL_RADIUS);
        largest = largest.max(force.norm());
        off[0] = off[0].max((place - of_few).norm());
        off[1] = off[1].max((force - force_of_few).norm());
    }
    let [place, force] = off;
    println!("{contacts} contacts; place off by {place:e} m, force by {:e}", force / largest);
    assert!(way > 5e-3, "a ball has gone {way:e} m only");
    assert!(
        place <= 1e-13 * BALL_RADIUS && force <= 1e-13 * largest,
        "place off by {place:e} m, force by {:e}",
        force / largest
    );
}
