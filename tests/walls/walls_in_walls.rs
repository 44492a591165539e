//! Coincident surfaces: one contact, like with one of them.

use crate::support::{Bench, scene};
use crate::walls::meshes::{BRICK, ROD, Triangles, at, beside, write_obj};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::Vec3;
use dem_mpi::particles::records::Particle;
use dem_mpi::random::Random;
use dem_mpi::scene::assemble;
use dem_mpi::scene::doubts::doubts;
use dem_mpi::sim::run;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// A square in a plane of height z.
fn square([low, high]: [f64; 2], y: f64, z: f64) -> Triangles {
    let [a, b, c, d] =
        [(low, -y), (high, -y), (high, y), (low, y)].map(|(x, y)| Vec3::new(x, y, z));
    vec![[a, b, c], [a, c, d]]
}

const SHAPES: [(&str, f64); 4] = [
    ("kind = \"sphere\"\nradius = 0.01", 0.01),
    ("kind = \"ellipsoid\"\nsemi_axes = [0.012, 0.009, 0.007]", 0.007),
    (ROD, 0.005),
    (BRICK, 0.006),
];

/// Scene with sides of the domain, the lower at height 0, and walls.
fn text(sides: &str, walls: &str, shape: &str) -> String {
    let low = format!("walls = [{sides}]\nlow = [-0.2, -0.2, 0]");
    beside(shape, walls, Vec3::zeros(), 0.0).replace("low = [-0.2, -0.2, -0.2]", &low)
}

fn mesh(name: &str, triangles: &Triangles, folder: &Path) -> String {
    let file = folder.join(format!("{name}.obj"));
    write_obj(triangles, &file);
    format!("[[wall]]\nname = \"{name}\"\nmesh = \"{}\"\n", file.display())
}

/// Positions over the common part of two surfaces and over the end of one, on either side of it.
#[test]
fn surfaces_that_lie_in_each_other_count_once() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let plane = |name: &str| {
        format!("[[wall]]\nname = \"{name}\"\npoint = [0, 0, 0]\nnormal = [0, 0, 1]\n")
    };
    let (left, right) = (square([-0.1, 0.02], 0.1, 0.0), |z| square([0.0, 0.1], 0.08, z));
    let both = |z| [left.clone(), right(z)].concat();
    let cases = [
        ("patches", String::new(), mesh("patches", &both(0.0), folder)),
        ("nearly", String::new(), mesh("nearly", &both(1e-9), folder)),
        ("side", "\"-z\"".to_owned(), mesh("side", &left, folder)),
        ("planes", String::new(), plane("one") + &plane("other")),
        ("plane of the side", "\"-z\"".to_owned(), plane("one")),
        ("meshes", String::new(), mesh("a", &left, folder) + &mesh("b", &left, folder)),
        ("two", String::new(), mesh("c", &left, folder) + &mesh("d", &right(0.0), folder)),
    ];
    for (case, sides, walls) in &cases {
        for (shape, radius) in SHAPES {
            let scene = scene(&text(sides, walls, shape));
            let told = doubts(&scene);
            assert!(told.iter().any(|doubt| doubt.contains("coincide")), "{case}: {told:?}");
            // Rods and boxes over the border of a second mesh have two contacts.
            let across = radius >= 0.007 || !["two", "meshes"].contains(case);
            for x in [-0.03, -0.001, 0.0, 0.001, 0.01, 0.0195, 0.02, 0.021] {
                let has_floor = *case != "meshes" || x < 0.01;
                if !has_floor || !across && x != -0.03 {
                    continue;
                }
                if shape == BRICK && (x != -0.03 || ["patches", "nearly"].contains(case)) {
                    continue;
                }
                let bench =
                    Bench::of(&scene, &[at(Vec3::new(x, 0.0, 0.98 * radius), Vec3::zeros())]);
                let found: Vec<f64> = bench.sim.contacts.iter().map(|(_, g)| g.overlap).collect();
                assert_eq!(found.len(), 1, "{case} {shape} {x}: {found:?}");
                assert!(
                    (found[0] / (0.02 * radius) - 1.0).abs() < 1e-4,
                    "{case} {shape} {x}: {found:?}"
                );
            }
        }
    }
}

/// Plates that do not coincide give no warning.
#[test]
fn plates_beside_each_other_are_two() {
    let folder = tempfile::tempdir().unwrap();
    let apart = [square([-0.1, 0.0], 0.1, 0.05), square([0.0, 0.1], 0.1, 0.05)].concat();
    let walls = mesh("apart", &apart, folder.path())
        + &mesh("above", &square([-0.1, 0.1], 0.1, 0.1), folder.path());
    let told = doubts(&scene(&text("\"-z\"", &walls, SHAPES[0].0)));
    assert!(told.is_empty(), "{told:?}");
}

/// A closed ball of triangles that are smaller than the particles.
fn globe(radius: f64) -> Triangles {
    let (rows, columns) = (36, 72);
    let place = |i: u32, k: u32| {
        let (polar, turn) = (
            PI * f64::from(i) / f64::from(rows),
            TAU * f64::from(k % columns) / f64::from(columns),
        );
        let ring = if i.is_multiple_of(rows) { 0.0 } else { polar.sin() };
        Vec3::new(ring * turn.cos(), ring * turn.sin(), polar.cos()) * radius
    };
    let square = |i: u32, k: u32| {
        let [a, b, c, d] = [place(i, k), place(i + 1, k), place(i + 1, k + 1), place(i, k + 1)];
        [[a, b, c], [a, c, d]]
    };
    (0..rows * columns).flat_map(|n| square(n / columns, n % columns)).collect()
}

/// Particles that a surface of small triangles cuts are rejected at the start, with their centres on either side. Particles that it does not reach
/// are accepted.
#[test]
fn grains_that_a_surface_cuts_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let triangles = globe(0.1);
    let wall = mesh("globe", &triangles, folder.path());
    // Points of the surface.
    let part = [0.0, 0.25, 0.5, 0.75, 1.0];
    let points: Vec<Vec3> = triangles
        .iter()
        .flat_map(|[a, b, c]| {
            let on = move |u: f64, v: f64| a * (1.0 - u) + (b * (1.0 - v) + c * v) * u;
            part.iter().flat_map(move |&u| part.map(|v| on(u, v)))
        })
        .collect();
    let [egg, blunt] = [
        "kind = \"ellipsoid\"\nsemi_axes = [0.025, 0.02, 0.01]",
        "kind = \"superellipsoid\"\nsemi_axes = [0.025, 0.02, 0.01]\nexponents = [0.7, 0.8]",
    ]
    .map(|shape| {
        scene(&text("", &wall, shape).replace("low = [-0.2, -0.2, 0]", "low = [-0.2, -0.2, -0.2]"))
    });
    let mut random = Random::of(31, 0);
    let mut counts = [0; 2];
    for k in 0..120 {
        let scene = [&egg, &blunt][k % 2];
        let turn = random.rotation();
        let out = random.rotation() * Vec3::x();
        let centre = out * (0.1 + 0.03 * random.signed());
        let shape = &scene.library.shapes[0];
        // Factor by which the particle must shrink to be free of the points.
        let least = points
            .iter()
            .map(|point| turn.inverse() * (point - centre))
            .filter(|place| place.norm() < shape.bounding_radius())
            .map(|place| {
                let (mut low, mut high) = (0.0, 4.0);
                for _ in 0..30 {
                    let middle = 0.5 * (low + high);
                    if shape.contains(&(place / middle)) { high = middle } else { low = middle }
                }
                high
            })
            .fold(4.0, f64::min);
        let mut comm = Alone::default();
        let mut sim = assemble::assemble(scene, &comm);
        sim.particles.strip_to_owned();
        sim.insert(&Particle { quaternion: turn, ..at(centre, Vec3::zeros()) });
        let begun = run::begin(&mut sim, &mut comm);
        if least < 0.88 {
            let said = begun.expect_err("it is cut").to_string();
            assert!(said.contains("overlap by more than 5 %"), "{k} {least}: {said}");
            counts[0] += 1;
        } else if least > 1.0 {
            begun.unwrap_or_else(|error| panic!("{k} {least}: {error}"));
            counts[1] += 1;
        }
    }
    assert!(counts.iter().all(|&count| count > 20), "{counts:?}");
}
