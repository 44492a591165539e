//! Cylinders and cones as walls: closed forms, all local maxima of the overlap, energy, identical bits, bad input.

use crate::support::{Bench, MATERIAL, OnRanks, ball, close, expect_refused, scene};
use dem_mpi::contact::{AgainstTriangleMesh, ContactResolver, Outcome, Posed, Touch};
use dem_mpi::math::{Mat3, Vec3};
use dem_mpi::particles::records::Particle;
use dem_mpi::random::Random;
use dem_mpi::scene::plan::plan;
use dem_mpi::shape::triangle_mesh::MeshFacet;
use dem_mpi::shape::{Ellipsoid, Shape, Sphere, Superellipsoid, TriangleMesh};
use std::f64::consts::TAU;
use std::sync::Arc;

/// All contacts of a body with facets of a surface whose axes are the world's.
fn on_facets(surface: &Arc<TriangleMesh>, body: &Posed, centre: &Vec3) -> Vec<(u32, Touch)> {
    let (shape, upright) = (Shape::TriangleMesh(surface.clone()), Mat3::identity());
    let reach = body.bounding_radius();
    let near = surface.near(centre, reach);
    let touch = |facet: u32| {
        let wall = Posed { facet, ..Posed::new(&shape, &upright) };
        match AgainstTriangleMesh::default().touch(body, &wall, &-centre, None) {
            Outcome::Touching(touch) => Some((facet, touch)),
            Outcome::Apart(_) => None,
            outcome @ Outcome::Failed(_) => panic!("{outcome:?}"),
        }
    };
    near.into_iter().filter_map(touch).collect()
}

fn touches(surface: &Arc<TriangleMesh>, body: &Posed, centre: &Vec3) -> Vec<Touch> {
    on_facets(surface, body, centre).into_iter().map(|(_, touch)| touch).collect()
}

/// A cylinder or a cone about z, from height 0.
struct Round {
    radius: f64,
    slope: f64,
    height: f64,
}

impl Round {
    fn surface(&self) -> Arc<TriangleMesh> {
        let end = self.radius + self.slope * self.height;
        let radii = [self.radius, end];
        Arc::new(TriangleMesh::of_revolution(&Vec3::zeros(), &(Vec3::z() * self.height), radii))
    }

    /// Normal away from the axis.
    fn normal(&self, angle: f64) -> Vec3 {
        Vec3::new(angle.cos(), angle.sin(), -self.slope).normalize()
    }

    /// Depth of a body along a normal, inside (1) or outside (-1).
    fn depth(&self, body: &Posed, centre: &Vec3, side: f64, angle: f64) -> f64 {
        let normal = self.normal(angle);
        let steep = (1.0 + self.slope * self.slope).sqrt();
        let deepest = body.support(&(normal * side)) + centre;
        side * (deepest.dot(&normal) - self.radius / steep)
    }

    /// Angle and depth of every local maximum (inside) or minimum (outside), by dense search and golden section.
    fn searched(&self, body: &Posed, centre: &Vec3, side: f64) -> Vec<(f64, f64)> {
        let count = 4000;
        let step = TAU / f64::from(count);
        let f = |angle: f64| side * self.depth(body, centre, side, angle);
        let mut found = Vec::new();
        for k in 0..count {
            let at = step * f64::from(k);
            if f(at) >= f(at - step) && f(at) > f(at + step) {
                let (mut low, mut high) = (at - step, at + step);
                let golden = 0.5 * (5_f64.sqrt() - 1.0);
                for _ in 0..80 {
                    let (x, y) = (high - golden * (high - low), low + golden * (high - low));
                    if f(x) > f(y) { high = y } else { low = x }
                }
                let angle = 0.5 * (low + high);
                found.push((angle, side * f(angle)));
            }
        }
        found
    }
}

/// Long and blunt bodies near the surface on both sides: contacts and maxima of the depth agree in number and depth.
#[test]
fn bodies_touch_where_they_are_deepest() {
    let mut random = Random::of(7, 0);
    let (mut counts, mut worst, mut close_ones) = ([0; 3], 0.0_f64, 0);
    for k in 0..1000 {
        let round = Round { radius: 1.0, slope: [0.0, 0.7][k % 2], height: 4.0 };
        let surface = round.surface();
        let body: Shape = if k % 4 < 2 {
            Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(0.97, 0.3, 0.25) })
        } else {
            Shape::Superellipsoid(Superellipsoid::new(Vec3::new(0.7, 0.3, 0.4), [0.8, 0.7]))
        };
        let turn = random.rotation().to_rotation_matrix().into_inner();
        let body = Posed::new(&body, &turn);
        let side = if k % 3 == 0 { -1.0 } else { 1.0 };
        let height = 2.0 + 0.5 * random.signed();
        let wide = round.radius + round.slope * height;
        let away = if side > 0.0 { wide - 0.8 * random.unit() } else { wide + 0.5 * random.unit() };
        let angle = TAU * random.unit();
        let centre = Vec3::new(away * angle.cos(), away * angle.sin(), height);
        let maxima = round.searched(&body, &centre, side);
        // Near the merging of two contacts, within two strips, only one of them is found.
        let next = maxima.iter().cycle().skip(1);
        let mut ways = maxima.iter().zip(next).map(|(a, b)| (b.0 - a.0).rem_euclid(TAU));
        if maxima.len() > 1 && ways.any(|way| way < 2.0 * TAU / 64.0) {
            close_ones += 1;
            continue;
        }
        let mut expected: Vec<f64> = maxima.into_iter().map(|(_, depth)| depth).collect();
        expected.sort_by(f64::total_cmp);
        if side < 0.0 {
            // From outside only the least is a contact; the others belong to the far side.
            expected.truncate(1);
        }
        expected.retain(|&depth| depth > 0.0);
        let mut found: Vec<f64> =
            touches(&surface, &body, &centre).iter().map(|touch| touch.overlap).collect();
        found.sort_by(f64::total_cmp);
        found.dedup_by(|a, b| (*a - *b).abs() < 1e-12);
        assert_eq!(found.len(), expected.len(), "{k}: {found:?} {expected:?}");
        for (found, expected) in found.iter().zip(&expected) {
            worst = worst.max((found - expected).abs());
        }
        counts[found.len().min(2)] += 1;
    }
    println!("{counts:?} with none, one, two; depths off by {worst:e}");
    assert!(close_ones < 50, "{close_ones}");
    assert!(worst < 1e-13 && counts.iter().all(|&count| count > 10), "{worst:e} {counts:?}");
}

/// Bodies longer than a thin pin touch it only on their side.
#[test]
fn a_thin_pin_is_touched_from_one_side() {
    let pin = Round { radius: 0.1, slope: 0.0, height: 4.0 };
    let surface = pin.surface();
    let upright = Mat3::identity();
    let egg = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(0.2, 1.0, 0.2) });
    let flat = Posed::new(&egg, &upright);
    for (x, overlap) in [(0.29, Some(0.01)), (0.35, None)] {
        let found = touches(&surface, &flat, &Vec3::new(x, 0.0, 2.0));
        let overlaps: Vec<f64> = found.iter().map(|touch| touch.overlap).collect();
        // At the border of two strips, both have the contact.
        assert_eq!(overlaps.len(), if overlap.is_some() { 2 } else { 0 }, "{x}: {found:?}");
        assert!(
            overlaps.iter().all(|a| overlap.is_some_and(|b| (a - b).abs() < 1e-12)),
            "{found:?}"
        );
    }
    let mut random = Random::of(9, 9);
    let mut met = 0;
    for _ in 0..20_000 {
        let body = Posed::new(&egg, &upright);
        let (angle, out) = (TAU * random.unit(), 0.1 + 1.3 * random.unit());
        let centre = Vec3::new(out * angle.cos(), out * angle.sin(), 2.0);
        for touch in touches(&surface, &body, &centre) {
            assert!(touch.normal.dot(&centre.xy().push(0.0)) < 0.0, "{centre}: {touch:?}");
            met += 1;
        }
    }
    assert!(met > 1000, "{met}");
}

/// A ball on the axis of a cone, up to rounding, has one contact.
#[test]
fn a_ball_on_the_axis_of_a_cone_touches_once() {
    let cone = Round { radius: 0.03, slope: 1.0, height: 0.07 };
    let surface = cone.surface();
    let (upright, ball) = (Mat3::identity(), Shape::Sphere(Sphere { radius: 0.05 }));
    let body = Posed::new(&ball, &upright);
    for x in [0.0, 1e-17, -1e-17, 5.5e-17, -3e-11, 3e-11, -1e-9, 1e-6] {
        for centre in [Vec3::new(x, 0.0, 0.03), Vec3::new(0.0, x, 0.03), Vec3::new(x, -x, 0.03)] {
            let found = touches(&surface, &body, &centre);
            assert!((1..3).contains(&found.len()), "{centre}: {found:?}");
        }
    }
}

#[test]
fn what_is_on_the_axis_touches_once() {
    let surface = Round { radius: 0.5, slope: 1.0, height: 2.0 }.surface();
    let ball = Shape::Sphere(Sphere { radius: 1.0 });
    let egg = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(1.2, 1.2, 0.8) });
    let upright = Mat3::identity();
    for body in [&ball, &egg].map(|shape| Posed::new(shape, &upright)) {
        let overlaps = [0.0, 1e-4, 2e-4].map(|off| {
            let found = touches(&surface, &body, &Vec3::new(0.8 * off, 0.6 * off, 0.6));
            assert_eq!(found.len(), 1, "{off}: {found:?}");
            found[0].overlap
        });
        let steps = [overlaps[1] - overlaps[0], overlaps[2] - overlaps[1]];
        assert!(steps[0] > 0.0 && (steps[0] / steps[1] - 1.0).abs() < 1e-3, "{overlaps:?}");
    }
}

/// Deepest overlap of a body with a surface, or 0 without contact. If both faces and edges or corners are touched, the smaller of their deepest
/// overlaps counts.
fn deepest(surface: &Arc<TriangleMesh>, body: &Posed, centre: &Vec3) -> f64 {
    let found = on_facets(surface, body, centre);
    let is_edge = |&(facet, _): &(u32, Touch)| {
        !matches!(surface.facet(facet), MeshFacet::Face { .. } | MeshFacet::Strip(_))
    };
    let deepest = |edges: bool| {
        let of_kind = found.iter().filter(|on| is_edge(on) == edges);
        of_kind.map(|(_, touch)| touch.overlap).max_by(f64::total_cmp)
    };
    match (deepest(false), deepest(true)) {
        (Some(face), Some(edge)) => face.min(edge),
        (face, edge) => face.or(edge).unwrap_or(0.0),
    }
}

/// Rims at both mouths of a cone and a cylinder, with bodies below, beside and over them. Contacts agree with a fine mesh up to the height of its
/// chords. The overlap has no jump across a rim.
#[test]
fn a_rim_is_felt_as_one() {
    let mut random = Random::of(20, 0);
    let (strips, mut seen, mut worst) = (720_u32, [0; 2], 0.0_f64);
    let egg = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(0.2, 0.2, 0.1) });
    let long = Shape::Ellipsoid(Ellipsoid { semi_axes: Vec3::new(0.12, 0.3, 0.1) });
    let tablet = Shape::Superellipsoid(Superellipsoid::new(Vec3::new(0.2, 0.2, 0.1), [0.8; 2]));
    let ball = Shape::Sphere(Sphere { radius: 0.15 });
    for round in [
        Round { radius: 0.9, slope: 0.8, height: 2.0 },
        Round { radius: 1.0, slope: 0.0, height: 2.0 },
    ] {
        let surface = round.surface();
        let at = |k: u32, height: f64| {
            let angle = TAU * f64::from(k % strips) / f64::from(strips);
            let radius = round.radius + round.slope * height;
            Vec3::new(radius * angle.cos(), radius * angle.sin(), height)
        };
        let triangles: Vec<[Vec3; 3]> = (0..strips)
            .flat_map(|k| {
                let [a, b] = [at(k, 0.0), at(k, round.height)];
                let [c, d] = [at(k + 1, 0.0), at(k + 1, round.height)];
                [[a, b, d], [a, d, c]]
            })
            .collect();
        let mesh = Arc::new(TriangleMesh::new(&triangles, 0.1).unwrap());
        let chord = 2.6 * (1.0 - (0.5 * TAU / f64::from(strips)).cos());
        for k in 0..1200 {
            let shape = [&egg, &long, &tablet, &ball][k % 4];
            let turn = random.rotation().to_rotation_matrix().into_inner();
            let body = Posed::new(shape, &turn);
            let height = if k % 3 == 0 { round.height } else { 0.0 };
            let place = (random.unit() * 720.0) as u32;
            let (rim, beyond) = (at(place, height), if height > 0.0 { 1.0 } else { -1.0 });
            let normal = round.normal(TAU * f64::from(place) / 720.0);
            let along = (at(place, 1.0) - at(place, 0.0)).normalize() * beyond;
            // This depth along a direction in which the rim faces, or nearly.
            let angle = 0.25 * TAU + (0.25 * TAU + 0.2) * random.signed();
            let out = normal * angle.cos() + along * angle.sin();
            let centre = rim - body.support(&-out) + out * 0.01 * (0.3 - random.unit());
            let (found, expected) =
                (deepest(&surface, &body, &centre), deepest(&mesh, &body, &centre));
            assert!(
                (found - expected).abs() < 3.0 * chord,
                "{k} {centre} {out}: {found} {expected}"
            );
            worst = worst.max((found - expected).abs());
            seen[usize::from(expected > 0.0)] += 1;
            // On a straight path no overlap changes faster than the position.
            let step = random.rotation() * Vec3::x() * 2e-4;
            let overlaps: Vec<f64> = (-30..30)
                .map(|k| deepest(&surface, &body, &(centre + step * f64::from(k))))
                .collect();
            let jump =
                overlaps.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
            assert!(jump < 2.1e-4, "{k} {centre} {out}: {jump}");
        }
    }
    println!("{seen:?} apart and touching, off by {worst:e}");
    assert!(seen.iter().all(|&count| count > 300), "{seen:?}");
}

/// Tablets fall through a cone without a floor: all of them pass, and the energy balance closes.
#[test]
fn tablets_run_through_a_cone() {
    let ellipsoid = "kind = \"ellipsoid\"\nsemi_axes = [0.004, 0.004, 0.002]";
    let blunt =
        "kind = \"superellipsoid\"\nsemi_axes = [0.004, 0.004, 0.002]\nexponents = [0.8, 0.8]";
    let cone = "cone = { from = [0, 0, 0], to = [0, 0, 0.04], radius = [0.018, 0.05] }";
    for (shape, count) in [(ellipsoid, 20), (blunt, 20)] {
        let text = one(shape, cone, -Vec3::z() * 9.81, 0.3, 5e-6)
            .replace("normal_stiffness", "restitution = 0.5\nnormal_stiffness");
        let mut random = Random::of(21, 1);
        let grains: Vec<_> = (0..count)
            .map(|k| {
                let angle = 2.4 * f64::from(k);
                let height = 0.008 + 0.003 * f64::from(k);
                let place = Vec3::new(0.019 * angle.cos(), 0.019 * angle.sin(), height);
                Particle {
                    quaternion: random.rotation(),
                    ..ball(k as u64, 0, place, Vec3::zeros())
                }
            })
            .collect();
        let mut bench = Bench::of(&scene(&text), &grains);
        let mut on_rim = 0;
        for _ in 0..40_000 {
            bench.step();
            on_rim += bench
                .sim
                .contacts
                .on_walls(&bench.sim.particles)
                .filter(|(pair, _)| {
                    let id = bench.sim.particles.id[pair.b.index()];
                    id.wall_and_facet().is_some_and(|(_, facet)| facet >= 64)
                })
                .count();
            if bench.sim.particles.position.iter().take(count as usize).all(|x| x.z < -0.01) {
                break;
            }
        }
        let after = bench.measure();
        let part = after.missing() / after.dissipated;
        println!("{shape:?}: {on_rim} contacts with rims, {part:e} of the dissipated missing");
        assert!(bench.sim.particles.position.iter().take(count as usize).all(|x| x.z < -0.01));
        assert!(on_rim > 25 && part.abs() < 1e-3, "{on_rim} {part:e}");
    }
}

/// Scene of one shape in a round wall.
fn one(shape: &str, wall: &str, gravity: Vec3, friction: f64, dt: f64) -> String {
    let [gx, gy, gz] = gravity.into();
    format!(
        r#"
gravity = [{gx:?}, {gy:?}, {gz:?}]
[domain]
low = [-0.1, -0.1, -0.1]
high = [0.1, 0.1, 0.1]
walls = ["-y", "+y"]
[[wall]]
name = "round"
{wall}
[[material]]
name = "m"
density = 2500
normal_stiffness = 1e5
friction = {friction:?}
[[shape]]
name = "body"
{shape}
[time]
step = {dt:?}
"#
    )
}

const CYLINDER: &str = "cylinder = { from = [0, -0.1, 0], to = [0, 0.1, 0], radius = 0.05 }";

/// A ball oscillates in a cylinder, sliding and rolling, with the period of the closed form.
#[test]
fn a_ball_swings_in_a_cylinder() {
    let (radius, apart, swing) = (0.01, 0.04, 0.2_f64);
    for (friction, inertia) in [(0.0, 1.0), (0.8, 1.4)] {
        let dt = 1e-5;
        let text =
            one("kind = \"sphere\"\nradius = 0.01", CYLINDER, -Vec3::z() * 9.81, friction, dt);
        let scene = scene(&text);
        // The overlap balances the load at the bottom, as far as the load is constant.
        let pressed = scene.library.mass[0] * 9.81 / 1e5;
        let start = Vec3::new(swing.sin(), 0.0, -swing.cos()) * (apart + pressed);
        let mut bench = Bench::of(&scene, &[ball(0, 0, start, Vec3::zeros())]);
        let (mut before, mut passes) = (start.x, Vec::new());
        for step in 1..150_000_u32 {
            bench.step();
            let now = bench.sim.particles.position[0].x;
            if before > 0.0 && now <= 0.0 {
                passes.push(dt * (f64::from(step) - now / (now - before)));
            }
            before = now;
        }
        let period = (passes[passes.len() - 1] - passes[0]) / (passes.len() - 1) as f64;
        let expected = TAU
            * (inertia * apart / 9.81_f64).sqrt()
            * (1.0 + swing.powi(2) / 16.0 + 11.0 * swing.powi(4) / 3072.0);
        close(period, expected, 3e-4, &format!("period, friction {friction}, radius {radius}"));
    }
}

/// Particles that tumble without friction conserve energy, better with shorter steps, in a cylinder and in a cone.
#[test]
fn energy_is_kept_in_round_walls() {
    let cone = "cone = { from = [0, -0.1, 0], to = [0, 0.1, 0], radius = [0.03, 0.07] }";
    let egg = "kind = \"ellipsoid\"\nsemi_axes = [0.02, 0.008, 0.01]";
    let block =
        "kind = \"superellipsoid\"\nsemi_axes = [0.02, 0.009, 0.012]\nexponents = [0.8, 0.7]";
    let rod = "kind = \"spherocylinder\"\nlength = 0.03\nradius = 0.005";
    let both = |shape| [(CYLINDER, shape), (cone, shape)];
    for (wall, shape) in [egg, block, rod].into_iter().flat_map(both) {
        let lost = [4e-6, 1e-6].map(|dt| {
            let scene = scene(&one(shape, wall, Vec3::new(0.0, 0.0, -9.81), 0.0, dt));
            let mut bench = Bench::of(
                &scene,
                &[ball(0, 0, Vec3::new(0.004, 0.01, 0.0), Vec3::new(0.6, 0.3, 0.5))],
            );
            let before = bench.measure();
            let (mut touched, mut most) = (0, 0);
            for _ in 0..(0.3 / dt) as u32 {
                bench.step();
                let contacts = bench.sim.contacts.iter().count();
                touched += u32::from(contacts > 0);
                most = most.max(contacts);
            }
            let after = bench.measure();
            let energy = |m: &dem_mpi::measure::Measures| m.kinetic() + m.gravity + m.stored;
            assert!(f64::from(touched) * dt > 0.002, "{touched} steps with contacts, most {most}");
            (energy(&after) - energy(&before)).abs() / before.kinetic()
        });
        println!("{wall} {shape:?}: {lost:?} of the energy");
        assert!(lost[1] < 1e-4 && lost[1] < 0.3 * lost[0].max(1e-6), "{wall} {shape}: {lost:?}");
    }
}

/// A rotating drum with many particles.
fn drum() -> String {
    format!(
        r#"
seed = 4
gravity = [0.5, 0.3, -98.1]
[domain]
low = [-0.012, -0.006, -0.012]
high = [0.012, 0.006, 0.012]
walls = ["-y", "+y"]
[[wall]]
name = "drum"
cylinder = {{ from = [0, -0.006, 0], to = [0, 0.006, 0], radius = 0.0115 }}
rotation = {{ about = [0, 0, 0], axis = [0, 1, 0], rate = 20 }}
{MATERIAL}
[[shape]]
name = "long"
kind = "ellipsoid"
diameter = 0.002
aspect_ratio = 2
[[shape]]
name = "ball"
kind = "sphere"
radius = 0.001
[[shape]]
name = "rod"
kind = "spherocylinder"
length = 0.0012
radius = 0.0009
[[fill.lattice]]
shapes = {{ long = 1, ball = 1, rod = 1 }}
low = [-0.0065, -0.006, -0.0085]
high = [0.0065, 0.006, 0.0025]
[time]
step = 2.5e-6
"#
    )
}

#[test]
fn a_round_drum_has_the_same_bits_everywhere() {
    let scene = scene(&drum());
    let folder = tempfile::tempdir().unwrap();
    let state = OnRanks::of(&scene).the_same_everywhere(10_000, folder.path());
    let [contacts, on_walls, received, dissipated, missing] =
        ["contacts", "wall_contacts", "received", "dissipated", "missing"]
            .map(|name| state.number(name));
    println!(
        "{contacts} contacts, {on_walls} on walls; received {received:e}, dissipated {dissipated:e}, missing {missing:e} J"
    );
    assert!(
        contacts > 5.0 && on_walls > 5.0 && received != 0.0,
        "{contacts} {on_walls} {received:e}"
    );
    assert!(missing.abs() < 2e-4 * dissipated, "{missing:e} of {dissipated:e} J");
    let page = plan(&scene, 1);
    assert!(page.contains("a cylinder, radius 1.150e-2 m"), "{page}");
}

#[test]
fn bad_round_walls_are_refused() {
    let good = drum();
    for (from, to, said) in [
        ("radius = 0.0115", "radius = 0", "a number greater than 0"),
        ("to = [0, 0.006, 0]", "to = [0, -0.006, 0]", "are the same point"),
        ("cylinder = {", "smooth = 5\ncylinder = {", "needs a `mesh`"),
        ("cylinder = {", "point = [0, 0, 0]\ncylinder = {", "a wall has one surface"),
        ("radius = 0.0115", "radius = 0.0115, side = 1", "side"),
        ("cylinder = { from", "cone = { from", "a list of two: [from, to]"),
        ("walls = [\"-y\", \"+y\"]", "periodic = [true, false, false]", "must span this period"),
    ] {
        expect_refused(&good, from, to, said);
    }
}
