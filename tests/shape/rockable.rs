//! Bodies of Rockable and exaDEM, against Steiner's formula.

use crate::support::completed;
use dem_mpi::scene::Scene;
use dem_mpi::shape::Shape;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;

/// A body with these corners and faces. Words that a reader may pass over stand before and behind.
fn body(name: &str, radius: f64, corners: &[[f64; 3]], faces: &[&[usize]]) -> String {
    let mut text =
        format!("<\nname {name}\nradius {radius:e}\npreCompDone y\nnv {}\n", corners.len());
    for [x, y, z] in corners {
        writeln!(text, "{x:?} {y} {z:e}").unwrap();
    }
    let mut edges: Vec<[usize; 2]> = (faces.iter())
        .flat_map(|face| (0..face.len()).map(|k| [face[k], face[(k + 1) % face.len()]]))
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    writeln!(text, "ne {}", edges.len()).unwrap();
    for [a, b] in &edges {
        writeln!(text, "{a} {b}").unwrap();
    }
    writeln!(text, "nf {}", faces.len()).unwrap();
    for face in faces {
        let words: Vec<String> = face.iter().map(ToString::to_string).collect();
        writeln!(text, "{} {} ", face.len(), words.join(" ")).unwrap();
    }
    text + "obb.extent 1.0 1.0 1.0\nvolume 77\nI/m 1 1 1\norientation 1.0 0.0 0.0 0.0\n>\n\n"
}

/// A prism of height `c` over these corners. Faces run one way and the other, as in files of both codes.
fn prism(name: &str, base: &[[f64; 2]], c: f64) -> String {
    let n = base.len();
    let corners: Vec<[f64; 3]> =
        [0.0, c].iter().flat_map(|&z| base.iter().map(move |&[x, y]| [x, y, z])).collect();
    let mut faces: Vec<Vec<usize>> = vec![(0..n).collect(), (n..2 * n).collect()];
    faces.extend((0..n).map(|k| vec![k, (k + 1) % n, n + (k + 1) % n, n + k]));
    let faces: Vec<&[usize]> = faces.iter().map(|face| &face[..]).collect();
    body(name, 0.25, &corners, &faces)
}

const BRICK: [[f64; 2]; 4] = [[-0.5, -1.0], [0.5, -1.0], [0.5, 1.0], [-0.5, 1.0]];

/// The shape of this name in a scene with this file.
fn shape(text: &str, name: &str, more: &str) -> Result<Shape, String> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("bodies.shp"), text).unwrap();
    let scene = completed(&format!(
        "[[shape]]\nname = \"{name}\"\nkind = \"rounded-polyhedron\"\nfile = \"bodies.shp\"\n{more}\n"
    ));
    let scene = Scene::parse(&scene, "scene.toml", folder.path(), &[]);
    scene.map(|scene| scene.library.shapes[0].clone()).map_err(|errors| errors.to_string())
}

/// Volume of all points within `r` of a body with this volume and surface, and this sum of the lengths of its edges times
/// the turns of the normal over them.
fn steiner(volume: f64, surface: f64, bends: f64, r: f64) -> f64 {
    volume + surface * r + 0.5 * bends * r * r + 4.0 / 3.0 * PI * r.powi(3)
}

#[test]
fn bodies_of_rockable() {
    let tip = 0.3;
    let octahedron = [
        [tip, 0., 0.],
        [0., tip, 0.],
        [0., 0., tip],
        [-tip, 0., 0.],
        [0., -tip, 0.],
        [0., 0., -tip],
    ];
    let faces: [&[usize]; 8] = [
        &[0, 1, 2],
        &[1, 2, 3],
        &[2, 3, 4],
        &[4, 2, 0],
        &[0, 5, 1],
        &[5, 1, 3],
        &[3, 5, 4],
        &[4, 0, 5],
    ];
    let octahedron = body("Octahedron", 0.1, &octahedron, &faces);
    let both = prism("brick", &BRICK, 3.0) + &octahedron;
    let mm: f64 = 1e-3;
    let found = shape(&both, "brick", "scale = 1e-3").unwrap().volume();
    let [a, b, c] = [1.0, 2.0, 3.0];
    let exact =
        steiner(a * b * c, 2.0 * (a * b + b * c + c * a), 4.0 * (a + b + c) * PI / 2.0, 0.25);
    assert!((found / (exact * mm.powi(3)) - 1.0).abs() < 1e-13, "{found} {exact}");

    // Files have six digits, with which corners of a face are not in one plane.
    let rough = prism("brick", &BRICK, 3.0).replace("\n0.5 1 3e0\n", "\n0.5 1.00001 3e0\n");
    let found = shape(&rough, "brick", "").unwrap().volume();
    assert!((1e-7..1e-4).contains(&(found / exact - 1.0)), "{found} {exact}");

    // The only body of a file may have any name.
    let edge = tip * 2_f64.sqrt();
    let bend = PI - (-1.0 / 3.0_f64).acos();
    let exact = steiner(
        2_f64.sqrt() / 3.0 * edge.powi(3),
        2.0 * 3_f64.sqrt() * edge * edge,
        12.0 * edge * bend,
        0.1,
    );
    for (text, name) in [(&both, "Octahedron"), (&octahedron, "stone")] {
        let found = shape(text, name, "").unwrap().volume();
        assert!((found / exact - 1.0).abs() < 1e-13, "{found} {exact}");
    }
}

#[test]
fn bodies_of_rockable_that_are_refused() {
    let brick = prism("brick", &BRICK, 3.0);
    let ell = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]];
    let point = [0.0; 3];
    for (text, more, said) in [
        (prism("ell", &ell, 1.0), "", "is not convex: corners are up to 1.0000e0 before a face"),
        (body("ball", 0.5, &[point], &[]), "", "write kind = \"sphere\" and radius = 0.5"),
        (body("rod", 0.5, &[point, [0.0, 3.0, 4.0]], &[]), "", "length = 5.0 and radius = 0.5"),
        (
            body("plate", 0.1, &[point, [1., 0., 0.], [0., 1., 0.]], &[&[0, 1, 2]]),
            "",
            "do not enclose a body",
        ),
        (brick.replace("4 0 1 2 3 ", "4 0 1 2 9 "), "", "a corner that is not there"),
        (brick.replace("radius 2.5e-1", "radius r"), "", "line 3: `r` is not a radius"),
        (brick.replace("radius 2.5e-1", "radius -1"), "", "file"),
        (brick[..150].to_owned(), "", "was it cut off?"),
        (
            brick.clone() + &prism("other", &BRICK, 1.0),
            "",
            "give the shape the name of one: brick, other",
        ),
        (brick.clone(), "radius = 0.1", "radius = 0.1: is in the `file`"),
        (String::new(), "", "has 0 bodies"),
    ] {
        let errors = shape(&text, "stone", more).expect_err(said);
        assert!(errors.contains(said), "{said}: {errors}");
    }
}
