//! `dem-mpi --shape`: numbers of shapes against closed forms, their drawing and their surface.

use super::{arrays, close};
use crate::shape::unions::{ELL, obj_of_cubes};
use dem_mpi::math::Vec3;
use std::f64::consts::PI;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const SCENE: &str = r#"
domain = { low = [-9, -9, -9], high = [9, 9, 9], walls = ["-z"] }
material = [{ name = "m", density = 2000, normal_stiffness = 1e4 }]
fill = { lattice = [{ shapes = ["ell"], first = [0, 0, 0], count = [1, 1, 1] }] }
time = { step = "auto", steps = 10 }
output = { directory = "out" }
[[shape]]
name = "cube"
kind = "polyhedron"
edges = [1, 1, 1]
[[shape]]
name = "ell"
kind = "union"
pieces = [{ shape = "cube" }, { shape = "cube", at = [1, 0, 0] }, { shape = "cube", at = [0, 1, 0] }]
[[shape]]
name = "cut"
kind = "union"
file = "ell.obj"
pieces = 8
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [3, 2, 1]
[[shape]]
name = "a barrel"
kind = "superellipsoid"
semi_axes = [3, 2, 1]
exponents = [0.5, 0.7]
"#;

fn shape(folder: &Path, name: &str, more: &[&str]) -> Output {
    let words = [&["scene.toml", "--shape", name], more].concat();
    let program =
        Command::new(env!("CARGO_BIN_EXE_dem-mpi")).args(words).current_dir(folder).output();
    program.expect("the program runs")
}

/// Numbers after a label.
fn numbers(page: &str, label: &str) -> Vec<f64> {
    let line = page.lines().find(|line| line.starts_with(label)).expect(label);
    let words = line[label.len()..].split([' ', ',', '[', ']']);
    words.filter_map(|word| word.parse().ok()).collect()
}

/// Volume of superellipsoids: `2 a b c e1 e2 B(e1/2 + 1, e1) B(e2/2, e2/2)` (Jaklič, Leonardis, Solina 2000, 10.1007/978-94-015-9456-1).
fn superellipsoid(axes: [f64; 3], [e1, e2]: [f64; 2]) -> f64 {
    let beta = |a: f64, b: f64| libm::tgamma(a) * libm::tgamma(b) / libm::tgamma(a + b);
    let [a, b, c] = axes;
    2.0 * a * b * c * e1 * e2 * beta(0.5 * e1 + 1.0, e1) * beta(0.5 * e2, 0.5 * e2)
}

/// Volume inside a closed surface of a file, by the divergence theorem.
fn volume_of(file: &[u8]) -> f64 {
    let points: Vec<f64> = arrays(file)("Points");
    let (members, ends): (Vec<i32>, Vec<i32>) =
        (arrays(file)("connectivity"), arrays(file)("offsets"));
    let point = |k: i32| Vec3::from_column_slice(&points[3 * k as usize..][..3]);
    let mut first = 0;
    let mut sum = 0.0;
    for end in ends {
        let face = &members[first..end as usize];
        first = end as usize;
        for k in 2..face.len() {
            sum += point(face[0]).dot(&point(face[k - 1]).cross(&point(face[k]))) / 6.0;
        }
    }
    sum
}

#[test]
fn shapes_are_told_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("scene.toml"), SCENE).unwrap();
    fs::write(at.join("ell.obj"), obj_of_cubes(&ELL)).unwrap();
    let page = |name: &str| {
        let told = shape(at, name, &["--out", "drawn"]);
        assert_eq!(told.status.code(), Some(0), "{}", String::from_utf8_lossy(&told.stderr));
        String::from_utf8(told.stdout).unwrap()
    };
    let barrel = superellipsoid([3.0, 2.0, 1.0], [0.5, 0.7]);
    let egg = 8.0 * PI;
    let of_egg = [5.0, 10.0, 13.0].map(|squares| 2000.0 * egg * squares / 5.0);
    let of_ell = [5.0 / 6.0, 1.5, 11.0 / 6.0].map(|moment| 2000.0 * moment);
    let cases = [
        ("ell", 3.0, Some(of_ell), 1e-9),
        ("cut", 3.0, Some(of_ell), 0.02),
        ("egg", egg, Some(of_egg), 0.02),
        ("a barrel", barrel, None, 0.04),
    ];
    for (name, volume, inertia, of_drawing) in cases {
        let page = page(name);
        close(numbers(&page, "volume")[0], volume, 1e-11, name);
        close(numbers(&page, "mass")[0], 2000.0 * volume, 1e-11, name);
        for (found, expected) in
            numbers(&page, "inertia").into_iter().zip(inertia.into_iter().flatten())
        {
            close(found, expected, 1e-8, name);
        }
        let stem = name.replace(' ', "_");
        let vtp = fs::read(at.join("drawn").join(format!("{stem}.vtp"))).unwrap();
        close(volume_of(&vtp), volume, of_drawing, name);
        let svg = fs::read_to_string(at.join("drawn").join(format!("{stem}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{name}");
        assert!(svg.matches('M').count() > 50 && svg.len() < 1_000_000, "{name}: {}", svg.len());
    }
    let ell = page("ell");
    let centre = numbers(&ell, "centre");
    assert!((centre[0] - 1.0 / 3.0).abs() < 1e-9 && (centre[1] - 1.0 / 3.0).abs() < 1e-9, "{ell}");
    // Distance from the centre to the far corners (3/2, -1/2, 1/2).
    close(
        numbers(&ell, "bounding ball")[0],
        (49.0_f64 / 36.0 + 25.0 / 36.0 + 0.25).sqrt(),
        1e-9,
        "ball",
    );
    assert!(ell.contains("piece 3") && !ell.contains("piece 4"), "{ell}");
    let vtp = fs::read(at.join("drawn/ell.vtp")).unwrap();
    let points: Vec<f64> = arrays(&vtp)("Points");
    let count = format!("NumberOfPoints=\"{}\"", points.len() / 3);
    assert!(String::from_utf8_lossy(&vtp).contains(&count), "{count}");
    let pieces: Vec<i32> = arrays(&vtp)("piece");
    assert_eq!(
        (0..3).map(|k| pieces.iter().filter(|&&p| p == k).count()).collect::<Vec<_>>(),
        [6; 3]
    );
}

#[test]
fn a_shape_that_is_not_there_is_told() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    fs::write(folder.path().join("ell.obj"), obj_of_cubes(&ELL)).unwrap();
    let told = shape(folder.path(), "eg", &[]);
    let errors = String::from_utf8_lossy(&told.stderr).into_owned();
    assert_eq!(told.status.code(), Some(2), "{errors}");
    assert!(
        errors.contains("did you mean `egg`? (there are: cube, ell, cut, egg, a barrel)"),
        "{errors}"
    );
    // Without an output folder nothing is written.
    let told = shape(folder.path(), "egg", &[]);
    assert!(told.status.success() && told.stdout.starts_with(b"shape             egg\n"));
    assert_eq!(folder.path().read_dir().unwrap().count(), 2);
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    let refused = shape(folder.path(), "egg", &["--out", "file/drawn"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("cannot write file/drawn"));
}
