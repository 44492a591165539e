//! Input from other programs: encodings, line ends, headers, amounts, speed, and error messages.

use crate::support::expect_refused;
use dem_mpi::math::Vec3;
use dem_mpi::scene::plan::plan;
use dem_mpi::scene::{Fill, Scene, SceneErrors};
use dem_mpi::shape::mesh;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// A scene without particles and shapes.
const REST: &str = r#"
[domain]
low = [-1, -1, -1]
high = [1, 1, 1]
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e5
[time]
step = 1e-6
steps = 10
[output]
directory = "out"
"#;
const BALL: &str = "[[shape]]\nname = \"ball\"\nkind = \"sphere\"\nradius = 0.01\n";
const ONE: &str = "[[fill.lattice]]\nfirst = [0, 0, 0]\ncount = [1, 1, 1]\n";

fn parse(text: &str, folder: &Path) -> Result<Scene, SceneErrors> {
    Scene::parse(text, "scene.toml", folder, &[])
}

fn refused(text: &str, folder: &Path) -> String {
    parse(text, folder).unwrap_err().to_string()
}

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

/// Encodings of a text by programs that do not write plain UTF-8 alone.
fn written(text: &str) -> [Vec<u8>; 6] {
    let units = |unit: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(unit).collect::<Vec<u8>>();
    [
        text.as_bytes().to_vec(),
        [b"\xef\xbb\xbf", text.as_bytes()].concat(),
        [vec![0xff, 0xfe], units(u16::to_le_bytes)].concat(),
        [vec![0xfe, 0xff], units(u16::to_be_bytes)].concat(),
        text.replace('\n', "\r\n").into_bytes(),
        text.replace('\n', "\r").into_bytes(),
    ]
}

fn program(name: &str, arguments: &[&str], folder: &Path) -> Output {
    Command::new(name).args(arguments).current_dir(folder).output().unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Scene, list of particles and table of a motion are identical in each encoding.
#[test]
fn encodings_and_line_ends_change_nothing() {
    let folder = folder();
    let text = format!(
        "{REST}{BALL}[[fill.file]]\npath = \"grains.csv\"\n[[wall]]\nname = \"lid\"\npoint = [0, 0, -1]\nnormal = [0, 0, 1]\n\
         [[motion]]\nwalls = [\"lid\"]\nalong = [0, 0, 1]\ntable = \"shake.csv\"\n"
    );
    let (grains, shake) =
        ("x,y,z\n0.1,0.2,0.3\n# é\n0.1,0.2,0.4\n", "time_s,displacement_m\n0,0\n1,1e-7\n");
    let mut first: Option<Scene> = None;
    for ((scene, grains), shake) in written(&text).iter().zip(written(grains)).zip(written(shake)) {
        fs::write(folder.path().join("grains.csv"), grains).unwrap();
        fs::write(folder.path().join("shake.csv"), shake).unwrap();
        let path = folder.path().join("scene.toml");
        fs::write(&path, scene).unwrap();
        let scene = Scene::read(&path, &[]).unwrap_or_else(|errors| panic!("{errors}"));
        let first = first.get_or_insert_with(|| scene.clone());
        assert_eq!(scene.initial, first.initial);
        assert_eq!(scene.walls, first.walls);
        assert_eq!(scene.text.lines().collect::<Vec<_>>(), first.text.lines().collect::<Vec<_>>());
    }
    // Half a unit of UTF-16, UTF-16 without a mark, and Latin-1.
    let place = folder.path().join("grains.csv");
    for (bytes, wrong) in [
        (&b"\xff\xfex"[..], "is damaged UTF-16"),
        (b"x\0,\0y\0,\0z\0\n\0", "line 1: has the character NUL"),
        (b"x,y,z\n# K\xf6rner\n", "line 2: the byte 0xf6 is not UTF-8"),
        (b"x;y;z\n0,1;0,2;0,3\n", "columns are separated by ';' here; write commas"),
    ] {
        fs::write(&place, bytes).unwrap();
        let errors = refused(&text, folder.path());
        assert!(errors.contains(wrong), "{wrong}: {errors}");
    }
}

const TRIANGLE: &str =
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";

fn binary(header: &[u8], triangles: &[[Vec3; 3]]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, 0);
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        let normal = [0.0; 3];
        let numbers = normal.iter().chain(triangle.iter().flatten());
        bytes.extend(numbers.flat_map(|x| (*x as f32).to_le_bytes()));
        bytes.extend([0, 0]);
    }
    bytes
}

#[test]
fn meshes_are_read_however_they_are_written() {
    let folder = folder();
    let read = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        mesh::triangles(&path).map_err(|error| error.to_string())
    };
    let one = [[Vec3::zeros(), Vec3::x(), Vec3::y()]];
    // Without the first line, the last corner of the face would be another.
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\n";
    let stl = format!("solid plate\n{TRIANGLE}endsolid plate\n");
    for bytes in written(obj) {
        assert_eq!(read("a.obj", &bytes).unwrap(), one);
    }
    for bytes in written(&stl) {
        assert_eq!(read("a.stl", &bytes).unwrap(), one);
    }
    for header in ["", "solid", "solid Exported facets by CAD", "solid facet\nvertex"] {
        assert_eq!(read("a.STL", &binary(header.as_bytes(), &one)).unwrap(), one, "{header}");
    }
    for text in [
        format!("# by a program\n\n{stl}"),
        format!("K\u{f6}rper, facetted\n{stl}trailing words\n"),
        stl.replace("facet normal 0 0 1", "FACET NORMAL nan nan nan")
            .replace("outer", "# why\nOuter"),
    ] {
        assert_eq!(read("a.stl", text.as_bytes()).unwrap(), one, "{text}");
    }
    assert_eq!(
        read(
            "a.obj",
            b"# K\xf6rper\nv 0 0 0\nv 1 0 0 1\nv 0 1 0 0.5 0.5 0.5\nf -3/1 2//1 \\\n 3/1/1 # end\n"
        )
        .unwrap(),
        one
    );
    // A face may precede its corners.
    assert_eq!(read("a.obj", b"f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").unwrap(), one);

    let cut = binary(b"", &one)[..120].to_vec();
    let huge = binary(b"", &[[Vec3::zeros(), Vec3::x() * 1e300, Vec3::y()]]);
    let cases: [(&str, Vec<u8>, &str); 17] = [
        ("a.stl", b"".to_vec(), "is empty; an STL file of triangles is needed"),
        ("a.obj", b"".to_vec(), "is empty; an OBJ file of triangles is needed"),
        ("a.obj", b"v 0 0 0\n".to_vec(), "has no triangles"),
        ("a.stl", b"solid x\nendsolid x\n".to_vec(), "has no triangles"),
        ("a.obj", b"v 0 0 0\nv inf 0 0\n".to_vec(), "line 2: `inf` is not a finite number"),
        (
            "a.obj",
            b"v 0,5 0 0\n".to_vec(),
            "line 1: `0,5` is not a finite number; decimals are written with a point",
        ),
        ("a.obj", b"v 0 0\n".to_vec(), "line 1: a corner needs three coordinates, not 2"),
        (
            "a.obj",
            b"v 0 0 0\n\nf 1 2 3\n".to_vec(),
            "line 3: this face has the corner 2; the file has 1",
        ),
        ("a.obj", b"v 0 0 0\nf 1 -2 3\n".to_vec(), "line 2: `-2` is not a corner of a face"),
        ("a.obj", b"v 0 0 0\nf 1 0 3\n".to_vec(), "line 2: `0` is not a corner of a face"),
        ("a.stl", stl.as_bytes()[..55].to_vec(), "line 4: the file ends before `endsolid`"),
        (
            "a.stl",
            stl.replace("1 0 0", "1 0 nan").into_bytes(),
            "line 5: `nan` is not a finite number",
        ),
        (
            "a.stl",
            stl.replace("endloop", "vertex 1 1 0\nendloop").into_bytes(),
            "line 9: this facet has 4 vertices",
        ),
        (
            "a.stl",
            stl.replace("outer loop", "outer loops\nloop").into_bytes(),
            "line 4: expected `vertex` or `endloop`, not `loop`",
        ),
        ("a.stl", TRIANGLE.as_bytes().to_vec(), "line 1: expected `solid`, not `facet`"),
        ("a.stl", cut, "its header gives 1 triangles, but its bytes are for 0"),
        ("a.stl", huge, "triangle 0 (the first is 0) has a coordinate that is not finite"),
    ];
    for (name, bytes, wrong) in cases {
        let error = read(name, &bytes).unwrap_err();
        assert!(error.contains(wrong), "{wrong}: {error}");
    }
}

/// A polygon of many corners is cut into triangles of which few meet in one corner. The search for cells behind them then takes
/// only seconds.
#[test]
fn polygons_may_have_many_corners() {
    let folder = folder();
    let corners = 10_000;
    let mut text = String::new();
    for k in 0..corners {
        let (sine, cosine) = (std::f64::consts::TAU * f64::from(k) / f64::from(corners)).sin_cos();
        writeln!(text, "v {cosine:?} {sine:?} -0.5").unwrap();
    }
    text += "f";
    (1..=corners).for_each(|k| write!(text, " {k}").unwrap());
    let path = folder.path().join("disc.obj");
    fs::write(&path, text).unwrap();
    let triangles = mesh::triangles(&path).unwrap();
    assert_eq!(triangles.len(), corners as usize - 2);
    let area: f64 = triangles.iter().map(|[a, b, c]| 0.5 * (b - a).cross(&(c - a)).z).sum();
    let exact = 0.5 * f64::from(corners) * (std::f64::consts::TAU / f64::from(corners)).sin();
    assert!((area / exact - 1.0).abs() < 1e-12, "{area}");
    let begin = Instant::now();
    let block = "[[shape]]\nname = \"block\"\nkind = \"polyhedron\"\nedges = [0.1, 0.1, 0.1]\n";
    parse(
        &format!("{REST}{block}{ONE}[[wall]]\nname = \"disc\"\nmesh = \"disc.obj\"\n"),
        folder.path(),
    )
    .unwrap();
    assert!(begin.elapsed() < Duration::from_secs(15), "{:?}", begin.elapsed());
}

/// A text STL keeps its digits; for a binary STL the plan reports the loss.
#[test]
fn far_meshes_keep_their_digits_or_are_warned_of() {
    let folder = folder();
    let corners = [[0.1, 0.2, 0.3], [0.4, 0.2, 0.3], [0.1, 0.7, 0.3]];
    let at = |offset: f64| [corners.map(|[x, y, z]| Vec3::new(x + offset, y, z))];
    let text = |offset: f64| {
        let mut text = "solid far\nfacet normal 0 0 1\nouter loop\n".to_owned();
        for corner in at(offset).as_flattened() {
            writeln!(text, "vertex {:?} {:?} {:?}", corner.x, corner.y, corner.z).unwrap();
        }
        text + "endloop\nendfacet\nendsolid far\n"
    };
    let path = folder.path().join("far.stl");
    fs::write(&path, text(12345.6789)).unwrap();
    assert_eq!(mesh::triangles(&path).unwrap(), at(12345.6789), "digits beyond the seventh");
    let scene = |offset: f64| {
        format!(
            "{REST}{BALL}{ONE}[[wall]]\nname = \"far\"\nmesh = \"far.stl\"\nshift = [{:?}, 0, 0]\n",
            -offset
        )
    };
    let warned = |offset: f64| {
        plan(&parse(&scene(offset), folder.path()).unwrap(), 1)
            .contains("binary STL has seven digits")
    };
    assert!(!warned(12345.6789));
    for (offset, far) in [(0.0, false), (10.0, false), (1e4, true)] {
        fs::write(&path, binary(b"", &at(offset))).unwrap();
        assert_eq!(warned(offset), far, "{offset}");
    }
}

/// Twelve corners of an L, two of which lie within faces of the hull, are rejected. Points on edges of a box are valid.
#[test]
fn corners_within_faces_are_refused() {
    let outline = |points: &[[f64; 2]]| {
        let at = |z: f64| points.iter().map(move |[x, y]| format!("[{x:?}, {y:?}, {z:?}]"));
        let all = at(0.0).chain(at(0.01)).collect::<Vec<_>>().join(", ");
        format!(
            "{REST}[[shape]]\nname = \"part\"\nkind = \"polyhedron\"\nvertices = [{all}]\n{ONE}"
        )
    };
    let l = [[0.0, 0.0], [0.02, 0.0], [0.02, 0.01], [0.01, 0.01], [0.01, 0.02], [0.0, 0.02]];
    let errors = refused(&outline(&l), Path::new(""));
    assert!(
        errors.contains("point 3 (the first is 0) is within a face of the convex hull"),
        "{errors}"
    );
    // The corner is off the face by rounding, outwards and inwards.
    for off in [-1e-11, 1e-11] {
        let off = outline(&l).replace("[0.01, 0.01, 0.0]", &format!("[0.01, 0.01, {off:e}]"));
        assert!(refused(&off, Path::new("")).contains("is within a face"));
    }
    let volume = |points: &[[f64; 2]]| {
        parse(&outline(points), Path::new("")).unwrap().library.shapes[0].volume()
    };
    let on_edges = [[0.0, 0.0], [0.01, 0.0], [0.02, 0.0], [0.02, 0.02], [0.0, 0.02]];
    assert!((volume(&on_edges) / 4e-6 - 1.0).abs() < 1e-12);
}

#[test]
fn what_once_panicked_is_refused() {
    let text = format!("{REST}[[fill.file]]\npath = \"grains.csv\"\n");
    let folder = folder();
    fs::write(folder.path().join("grains.csv"), "x,y,z\n0,0,0\n").unwrap();
    let errors = refused(&text, folder.path());
    assert!(errors.contains("[[shape]] is missing"), "{errors}");
    let text = format!("{REST}{BALL}{ONE}");
    for change in ["#=1", " #x=1", "# a = b", "=1", "\u{feff}=1"] {
        let errors = Scene::parse(&text, "scene.toml", folder.path(), &[change.to_owned()]);
        assert!(errors.unwrap_err().to_string().contains("--set"), "{change}");
    }
    // Each length of a scene.
    let wall = |wall: &str| format!("{text}[[wall]]\nname = \"w\"\n{wall}\n");
    for far in ["1e31", "-1e200", "1e308"] {
        for text in [
            wall(&format!(
                "cone = {{ from = [0, 0, 0], to = [0, 0, {far}], radius = [0.01, 0.02] }}"
            )),
            wall(&format!("cylinder = {{ from = [{far}, 0, 0], to = [0, 0, 0], radius = 0.1 }}")),
            wall(&format!("point = [0, {far}, 0]\nnormal = [0, 0, 1]")),
            text.replace("low = [-1, -1, -1]", "low = [-1e200, -1, -1]"),
            text.replace("radius = 0.01", "radius = 1e300"),
            text.replace("radius = 0.01", "radius = 1e-200"),
            text.replace("first = [0, 0, 0]", &format!("first = [0, {far}, 0]")),
            text.replace("first", "jitter = 1e250\nspacing = 1e201\nfirst"),
            format!("{text}[neighbours]\nskin = 1e99\n"),
        ] {
            let errors = refused(&text, folder.path());
            assert!(
                errors.contains("is outside the range of lengths, 1e-40 to 1e30 m"),
                "{errors}"
            );
        }
    }
}

/// Many errors are counted, long values are cut short, and control characters are not printed.
#[test]
fn messages_are_short_and_plain() {
    let mut text = format!("{REST}{BALL}{ONE}");
    for k in 0..50_000 {
        writeln!(text, "[unknown_{k}]\nx = 1").unwrap();
    }
    let begin = Instant::now();
    let errors = refused(&text, Path::new(""));
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
    assert_eq!(errors.lines().count(), 22);
    assert!(errors.ends_with("and 49980 more") && errors.len() < 20_000, "{} bytes", errors.len());
    let long = "a".repeat(3_000_000);
    for text in [
        format!("{REST}{BALL}{ONE}[more]\nx = \"{long}\"\n"),
        format!("\"{long}\" = 1\n{REST}{BALL}{ONE}"),
        format!("seed = \"{long}\"\n{REST}{BALL}{ONE}"),
        format!("gravity = [{}0]\n{REST}{BALL}{ONE}", "0, ".repeat(1_000_000)),
        format!("{REST}{}{ONE}", BALL.replace("sphere", &long)),
    ] {
        let begin = Instant::now();
        let errors = refused(&text, Path::new(""));
        assert!(errors.len() < 3000, "{} bytes", errors.len());
        assert!(begin.elapsed() < Duration::from_secs(10), "{:?}", begin.elapsed());
    }

    let folder = folder();
    let obeyed =
        |text: &str| text.contains(|c: char| c.is_control() && c != '\n' || c == '\u{202e}');
    let escapes =
        "title = \"\\u001b[31mred\\u0007\\u202e\"\n\"\\u001b]0;x\\u0007\" = \"\\u009b\"\n";
    fs::write(folder.path().join("bad\u{1b}.toml"), format!("{escapes}{REST}{BALL}{ONE}")).unwrap();
    fs::write(
        folder.path().join("good.toml"),
        format!("title = \"\\u001b[31mred\\u0007\"\n{REST}{BALL}{ONE}"),
    )
    .unwrap();
    let program_of_runs = env!("CARGO_BIN_EXE_dem-mpi");
    for (arguments, status) in [
        (&["bad\u{1b}.toml", "--check"][..], 2),
        (&["good.toml", "--plan"], 0),
        (&["good.toml", "--out", "o"], 0),
        (&["good.toml", "--steps", "\u{1b}[31m"], 2),
        (&["good.toml", "--set", "\u{1b}=\u{7}"], 2),
    ] {
        let output = program(program_of_runs, arguments, folder.path());
        assert_eq!(output.status.code(), Some(status), "{}", said(&output));
        let all = said(&output) + &String::from_utf8_lossy(&output.stdout);
        assert!(!obeyed(&all), "{arguments:?}: {all:?}");
    }
}

/// Negative values of options are rejected as values.
#[test]
fn negative_numbers_are_values() {
    let folder = folder();
    fs::write(folder.path().join("scene.toml"), format!("{REST}{BALL}{ONE}")).unwrap();
    for option in ["--steps", "--threads", "--trace-particle", "--error"] {
        let output =
            program(env!("CARGO_BIN_EXE_dem-mpi"), &["scene.toml", option, "-1"], folder.path());
        assert_eq!(output.status.code(), Some(2));
        assert!(said(&output).contains("invalid value '-1' for"), "{option}: {}", said(&output));
    }
    let run = env!("CARGO_BIN_EXE_dem-mpi");
    let output = program(run, &["scene.toml", "--plan", "--threads", "65"], folder.path());
    assert!(said(&output).contains("65 is not in 1..=64"), "{}", said(&output));
    let [one, most] = ["1", "64"].map(|threads| {
        program(run, &["scene.toml", "--plan", "--threads", threads], folder.path())
    });
    assert_eq!(most.status.code(), Some(0), "{}", said(&most));
    assert!(one.stdout.len() > 500 && most.stdout.len() > 500, "{}", said(&most));
    for option in ["--margin", "--grid"] {
        let output =
            program(env!("CARGO_BIN_EXE_dem-post"), &["out", option, "-1d"], folder.path());
        assert!(said(&output).contains("invalid value '-1d' for"), "{option}: {}", said(&output));
    }
}

/// The time of reading grows linearly with the length of files.
#[test]
fn long_files_are_read_in_linear_time() {
    let folder = folder();
    let rows = 100_000;
    let mut sizes = format!("{REST}{BALL}size = {{ table = [\n");
    let mut shake = "time_s,displacement_m\n".to_owned();
    for k in 0..=rows {
        let part = f64::from(k) / f64::from(rows);
        writeln!(sizes, "[{:?}, {part:?}],", 1.0 + part).unwrap();
        writeln!(shake, "{part:?},{:?}", 1e-6 * part).unwrap();
    }
    sizes += "] }\n";
    let begin = Instant::now();
    parse(&format!("{sizes}{ONE}"), folder.path()).unwrap();
    fs::write(folder.path().join("shake.csv"), &shake).unwrap();
    let moved = format!(
        "{REST}{BALL}{ONE}[[wall]]\nname = \"lid\"\npoint = [0, 0, -1]\nnormal = [0, 0, 1]\n[[motion]]\nwalls = [\"lid\"]\nalong = [0, 0, 1]\n\
         table = \"shake.csv\"\n"
    );
    parse(&moved, folder.path()).unwrap();
    // Each row has an error, and the message gives the line.
    fs::write(folder.path().join("shake.csv"), shake.replace("\n0.", "\nx0.")).unwrap();
    let errors = refused(&moved, folder.path());
    assert!(
        errors.contains("line 12: `x0.0001` is not a number")
            && errors.contains("more mistakes like these"),
        "{errors}"
    );
    let mut grains = "x,y,z\n".to_owned();
    (0..rows).for_each(|k| writeln!(grains, "0,0,{k}").unwrap());
    fs::write(folder.path().join("grains.csv"), grains).unwrap();
    let listed = format!("{REST}{BALL}[[fill.file]]\npath = \"grains.csv\"\n");
    let errors = refused(&listed, folder.path());
    assert!(errors.contains("line 4, particle 2 at"), "{errors}");
    assert!(begin.elapsed() < Duration::from_secs(30), "{:?}", begin.elapsed());
}

/// Positions in mm with radii in m are rejected before all pairs are listed. A few overlapping particles are left to the checks of
/// the run.
#[test]
fn crowds_are_refused_early() {
    let folder = folder();
    let listed = format!("{REST}{BALL}[[fill.file]]\npath = \"grains.csv\"\n");
    let write = |count: usize, spacing: f64| {
        let mut text = "x,y,z\n".to_owned();
        for k in 0..count {
            let at = |n: usize| spacing * (n % 40) as f64 - 0.8;
            writeln!(text, "{:?},{:?},{:?}", at(k), at(k / 40), at(k / 1600)).unwrap();
        }
        fs::write(folder.path().join("grains.csv"), text).unwrap();
    };
    write(50_000, 4e-5);
    let errors = refused(&listed, folder.path());
    assert!(
        errors.contains("listed particles and more lie within others, such as 1 and 0 at"),
        "{errors}"
    );
    for (count, spacing) in [(50_000, 0.02), (900, 4e-5)] {
        write(count, spacing);
        let scene = parse(&listed, folder.path()).unwrap_or_else(|errors| panic!("{errors}"));
        assert_eq!(scene.initial.iter().map(Fill::count).sum::<u64>(), count as u64);
    }
}

/// Pairs whose numbers would overflow are rejected. A byte order mark is ignored.
#[test]
fn pairs_are_numbers() {
    let folder = folder();
    let sphere = |radius: &str| {
        format!(
            "{{\"id\": \"a\", \"rA\": {radius}, \"rB\": 1, \"cA\": [0, 0, 0], \"cB\": [1, 0, 0]}}\n"
        )
    };
    let ellipsoid = |axis: &str, x: &str| {
        format!(
            "id,aA,bA,cA,aB,bB,cB,xA,yA,zA,xB,yB,zB,qwA,qxA,qyA,qzA,qwB,qxB,qyB,qzB\n\
             1,{axis},2,3,2,2,1,0,0,0,{x},1,1,1,0,0,0,1,0,0,0\n"
        )
    };
    let path = folder.path().join("pairs");
    let run = |text: &[u8]| {
        fs::write(&path, text).unwrap();
        program(env!("CARGO_BIN_EXE_dem-contact"), &["pairs", "--repeats", "0"], folder.path())
    };
    let expected = run(sphere("0.5").as_bytes());
    assert_eq!(expected.status.code(), Some(0), "{}", said(&expected));
    for bytes in &written(&sphere("0.5"))[1..] {
        assert_eq!(run(bytes).stdout, expected.stdout);
    }
    // A pair this far apart has no answer.
    assert_eq!(run(ellipsoid("1", "1e200").as_bytes()).status.code(), Some(1));
    for text in [
        sphere("1e154"),
        sphere("1e-300"),
        ellipsoid("1e-300", "1"),
        ellipsoid("1e200", "1"),
        sphere("0.5").replace("\"a\"", "\"\\u001b[31m\""),
    ] {
        let output = run(text.as_bytes());
        assert_eq!(
            output.status.code(),
            Some(2),
            "{text}: {}",
            String::from_utf8_lossy(&output.stdout)
        );
        assert!(said(&output).contains("pairs:"), "{}", said(&output));
    }
}

/// An impossible folder is an input error and not a disk error.
#[test]
fn folders_that_cannot_be_are_named() {
    let folder = folder();
    fs::write(folder.path().join("scene.toml"), format!("{REST}{BALL}{ONE}")).unwrap();
    for out in ["scene.toml/x", &"n".repeat(300)] {
        let output =
            program(env!("CARGO_BIN_EXE_dem-mpi"), &["scene.toml", "--out", out], folder.path());
        let said = said(&output);
        assert_eq!(output.status.code(), Some(2));
        assert!(said.contains("cannot write into") && !said.contains("disk"), "{said}");
    }
}

/// A density beyond the range of numbers leaves no stable limit.
#[test]
fn a_step_out_of_range_is_refused() {
    let good = "[[material]]\nname = \"glass\"\ndensity = 2500\nnormal_stiffness = 1e4\n[time]\nstep = \"auto\"\n";
    expect_refused(good, "density = 2500", "density = 1e308", "out of the range of numbers");
    let given = good.replace("\"auto\"", "1e-5");
    expect_refused(&given, "density = 2500", "density = 1e308", "out of the range of numbers");
}
