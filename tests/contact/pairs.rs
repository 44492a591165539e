//! `dem-contact` from the command line, against the independent reference: see `tests/reference/README.md`.

use crate::support::reference;
use dem_mpi::contact::{Epa, ErodedGjk, Method, Outcome, ordered, table};
use dem_mpi::math::Vec3;
use dem_mpi::pairs::read::read;
use dem_mpi::pairs::write::ANSWER_COLUMNS;
use dem_mpi::shape::Kind;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write;
use std::process::{Command, Output, Stdio};

fn dem_contact(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_dem-contact"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // A program that ignores its input may have ended already.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}

type Row = BTreeMap<String, String>;

fn rows(csv: &[u8]) -> Vec<Row> {
    csv::Reader::from_reader(csv).deserialize().collect::<Result<_, _>>().unwrap()
}

fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column} = {}", row[column]))
}

fn vector(row: &Row, stem: &str) -> Vec3 {
    Vec3::from(["x", "y", "z"].map(|axis| number(row, &format!("{stem}{axis}"))))
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Checks that every row has the same bits as the library's result for that pair.
fn check_bits(file: &str, arguments: &[&str], method: &Method) {
    let text = reference(file);
    let output = dem_contact(&[&["-", "--repeats", "1"], arguments].concat(), &text);
    let times = said(&output);
    assert!(["ns cold", "ns warm", "ns batched"].iter().all(|t| times.contains(t)), "{times}");
    assert!(output.stdout.starts_with(ANSWER_COLUMNS.join(",").as_bytes()), "{file}");
    let pairs = read(file, &text).unwrap();
    let answers = rows(&output.stdout);
    assert_eq!(answers.len(), pairs.len(), "{file}");
    let table = table(method, &Kind::ALL);
    let mut met = [0; 3];
    for (k, row) in answers.iter().enumerate() {
        let (a, b, r) = pairs.posed(k);
        let resolver = table.get(ordered((a.shape.kind(), b.shape.kind()))).unwrap();
        assert_eq!(row["id"], pairs.name(k));
        match resolver.touch(&a, &b, &r, None) {
            Outcome::Touching(touch) => {
                let centre = pairs.centre_of_a(k);
                let same = |stem: &str, v: Vec3| {
                    let bits = |v: Vec3| [v.x, v.y, v.z].map(f64::to_bits);
                    assert_eq!(bits(vector(row, stem)), bits(v), "{file} {}: {stem}", row["id"]);
                };
                let overlap = number(row, "overlap");
                let id = &row["id"];
                assert_eq!(overlap.to_bits(), touch.overlap.to_bits(), "{file} {id}: {overlap:e}");
                same("n", touch.normal);
                same("C", centre + touch.point);
                same("PA", centre + a.support(&touch.normal));
                same("PB", centre + (b.support(&-touch.normal) + r));
                assert!(resolver.stages().contains(&row["solver"].as_str()), "{}", row["solver"]);
                let iterations: u32 = row["iterations"].parse().unwrap();
                let closed = row["solver"] == "sphere-sphere";
                assert!(closed == (iterations == 0), "{file} {id}: {iterations} iterations");
                assert!(iterations < 10_000, "{file} {id}: {iterations} iterations");
                met[0] += 1;
            }
            Outcome::Apart(bound) => {
                // A batch may find another bound, which differs by rounding near touch.
                let rounding = 4e-16 * (a.shape.bounding_radius() + b.shape.bounding_radius());
                assert!(number(row, "overlap") <= rounding - bound, "{file} {}", row["id"]);
                met[1] += 1;
            }
            Outcome::Failed(_) => {
                assert!(row["overlap"].is_empty() && row["solver"].is_empty(), "{row:?}");
                met[2] += 1;
            }
        }
    }
    assert!(met[0] > 0);
    assert_eq!(output.status.code(), Some(i32::from(met[2] > 0)), "{file}: {times}");
}

#[test]
fn the_program_gives_the_bits_of_the_library() {
    for file in [
        "caseI.csv",
        "extreme_public.csv",
        "spheres_public.jsonl",
        "superellipsoids_public.jsonl",
        "polyhedra_public.jsonl",
    ] {
        check_bits(file, &[], &Method::Auto);
    }
    let erosion =
        Method::GjkErosion(ErodedGjk { ratio: 0.02, tolerance: 1e-8, ..ErodedGjk::default() });
    let settings =
        ["--method", "gjk-erosion", "--set", "erosion_ratio=0.02", "--set", "tolerance=1e-8"];
    check_bits("caseI.csv", &settings, &erosion);
    let epa = Epa::new(1e-6);
    check_bits("caseI.csv", &["--method", "epa", "--set", "tolerance=1e-6"], &Method::Epa(epa));
    let plain = ["--method", "epa", "--set", "tolerance=1e-6", "--set", "polish=false"];
    check_bits("caseI.csv", &plain, &Method::Epa(Epa { polish: false, ..epa }));
}

/// Unions have a row for each contact. Balls have closed forms, and a box in two blocks has the same row as the whole box.
#[test]
fn unions_have_a_row_for_each_place() {
    let ball = |x: f64, z: f64| format!("{{\"r\": 1, \"c\": [{x}, 0, {z}]}}");
    let dimers = |id: &str, z: f64| {
        let (a, b) = ([ball(0.0, 0.0), ball(2.0, 0.0)], [ball(0.0, z), ball(2.0, z)]);
        format!("{{\"id\": \"{id}\", \"UA\": [{}], \"UB\": [{}]}}\n", a.join(", "), b.join(", "))
    };
    let block = |low: f64, high: f64| {
        let corners: Vec<[f64; 3]> = (0..8)
            .map(|k| [[low, high][k & 1], [-0.5, 0.5][k >> 1 & 1], [-0.5, 0.5][k >> 2]])
            .collect();
        format!("{corners:?}")
    };
    let above = "[[-0.3,-0.4,0.45],[0.3,-0.4,0.45],[-0.3,0.4,0.47],[0.3,0.4,0.47],[0,0,2]]";
    let cut = format!(
        "{{\"id\": \"cut\", \"UA\": [{{\"V\": {}}}, {{\"V\": {}}}], \"UB\": [{{\"V\": {above}}}]}}\n",
        block(-0.5, 0.1),
        block(0.1, 0.5)
    );
    let whole = format!("{{\"id\": \"whole\", \"VA\": {}, \"VB\": {above}}}\n", block(-0.5, 0.5));
    let text = dimers("flush", 1.9) + &dimers("apart", 2.3) + &cut + &whole;
    let output = dem_contact(&["-"], &text);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let all = rows(&output.stdout);
    let of = |id: &str| all.iter().filter(|row| row["id"] == id).collect::<Vec<_>>();
    let flush = of("flush");
    assert_eq!(flush.len(), 2);
    for (row, x) in flush.into_iter().zip([0.0, 2.0]) {
        let near = |stem: &str, expected: Vec3| {
            let found = vector(row, stem);
            assert!((found - expected).norm() < 1e-14, "{stem}: {found} but {expected}");
        };
        near("n", Vec3::z());
        near("C", Vec3::new(x, 0.0, 0.95));
        near("PA", Vec3::new(x, 0.0, 1.0));
        near("F", Vec3::z() * 0.1);
        // The moment is about the middle of the first dimer.
        near("M", Vec3::y() * (0.1 * (1.0 - x)));
        assert!((number(row, "energy") - 0.005).abs() < 1e-15);
        assert_eq!(row["solver"], "pieces");
    }
    let apart = of("apart");
    assert!(apart.len() == 1 && (number(apart[0], "overlap") + 0.3).abs() < 1e-14, "{apart:?}");
    let (cut, whole) = (of("cut"), of("whole"));
    assert_eq!((cut.len(), whole.len()), (1, 1));
    for column in ["thickness", "Fx", "Fy", "Fz", "Mx", "My", "Mz", "energy"] {
        let [found, expected] = [&cut, &whole].map(|rows| number(rows[0], column));
        assert!((found - expected).abs() < 1e-12, "{column}: {found} but {expected}");
    }
    // The law of a scene in each contact.
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.toml");
    std::fs::write(&scene, crate::support::completed("")).unwrap();
    let law = ["-", "--repeats", "0", "--law", scene.to_str().unwrap()];
    let of_law = rows(&dem_contact(&law, &text).stdout);
    assert_eq!(of_law.len(), all.len());
    for (row, unit) in of_law.iter().zip(&all).filter(|(row, _)| row["id"] != "apart") {
        for column in ["Fx", "Fy", "Fz", "Mx", "My", "Mz", "energy"] {
            let (found, expected) =
                (number(row, &format!("law_{column}")), 1e4 * number(unit, column));
            assert!((found - expected).abs() < 1e-8, "{column}: {found} but {expected}");
        }
    }
    let wrong = dem_contact(&["-"], "{\"id\": 1, \"UA\": [{\"x\": 1}], \"UB\": []}");
    assert!(said(&wrong).contains("UA[0] is not a piece"), "{}", said(&wrong));
    let empty = dem_contact(&["-"], "{\"id\": 1, \"UA\": [], \"UB\": []}");
    assert!(said(&empty).contains("UA: a union needs at least one piece"), "{}", said(&empty));
}

/// Clearances agree with the reference, too, and are continuous through touching.
#[test]
fn overlaps_have_their_sign() {
    for file in ["caseI.csv", "caseIII_public.csv", "extreme_public.csv"] {
        let text = reference(file);
        let answers = rows(&dem_contact(&["-", "--repeats", "0"], &text).stdout);
        for (row, answer) in rows(text.as_bytes()).iter().zip(&answers) {
            // Without a unique normal the last stage answers to its own tolerance, or no stage answers.
            if row["unique"] == "0" {
                continue;
            }
            let size = ["aA", "bA", "cA", "aB", "bB", "cB"].map(|c| number(row, c));
            let size = size.into_iter().fold(0.0, f64::max);
            let off = (number(answer, "overlap") - number(row, "overlap")).abs();
            let size = size + number(row, "overlap").abs();
            assert!(off <= 1e-13 * size, "{file} {}: off by {off:e}", row["id"]);
            let off = (vector(answer, "n") - vector(row, "n")).norm();
            let known = 2e-7 * size / number(row, "kappa");
            assert!(off <= known.max(1e-7), "{file} {}: normal off by {off:e}", row["id"]);
        }
    }
}

#[test]
fn a_bad_file_is_one_message() {
    let good = reference("caseI.csv");
    let line = |k: usize| good.lines().nth(k).unwrap();
    let ellipsoid = format!("{}\n{}\n", line(0), line(1));
    let with = |from: &str, to: &str| ellipsoid.replacen(from, to, 1);
    let sphere = reference("spheres_public.jsonl").lines().next().unwrap().to_string();
    let cases = [
        (String::new(), "has no pairs"),
        (with("target=0.000,1.0", "target=0.000,-1.0"), "input:2: aA = -1 is not positive"),
        (with("target=0.000,1.0", "target=0.000,one"), "input:2: aA = `one` is not a number"),
        (with("target=0.000,1.0", "target=0.000,inf"), "input:2: aA = inf is not finite"),
        (with(",qwB", ",qw"), "input:2: there is no column `qwB`"),
        (with(",0.35,0.0,1.0,", ",0.35,0.0,0.0,"), "qwB: the quaternion is zero"),
        (format!("{ellipsoid}1,2\n"), "input:3: "),
        (format!("{sphere}\n{{\n"), "input:2: not JSON"),
        (sphere.replace("\"rB\"", "\"r\""), "input:1: rB = null is not a number"),
        (sphere.replace("\"cA\": [", "\"cA\": [1.0, "), "is not a list of 3 numbers"),
        ("{\"id\": 1}".into(), "input:1: of unknown kind"),
    ];
    for (text, message) in cases {
        let output = dem_contact(&["-"], &text);
        let said = said(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(message) && said.lines().count() == 1, "{message}: {said}");
        assert!(output.stdout.is_empty());
    }
    for (arguments, message) in [
        (&["no/such/file.csv"][..], "no/such/file.csv: cannot be read: No such file"),
        (&["-", "--method", "epa", "--set", "erosion_ratio=0.1"], "the method here is epa"),
        (&["-", "--method", "epa", "--set", "tolerance=2"], "must lie between 0 and 1"),
        (&["-", "--method", "epa", "--set", "polish=no"], "polish=no"),
        (&["-", "--set", "tolerance"], "write KEY=VALUE"),
    ] {
        let output = dem_contact(arguments, &ellipsoid);
        let said = said(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(message) && said.lines().count() == 1, "{message}: {said}");
    }
}

#[test]
fn superellipsoids_of_any_exponent_and_solids_are_read() {
    let body = r#"{"abc": [1, 1, 1], "e1": 1, "e2": E, "c": [X, 0, 0], "q": [1, 0, 0, 0]}"#;
    let pair = |e: &str| {
        let (a, b) = (body.replace('X', "0"), body.replace('X', "1.5"));
        format!("{{\"id\": \"{e}\", \"A\": {a}, \"B\": {b}}}\n").replace('E', e)
    };
    let text = pair("1") + &pair("0.4") + &pair("1.6");
    let output = dem_contact(&["-", "--repeats", "0"], &text);
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    for answer in rows(&output.stdout) {
        // All of them reach to 1 along x; one with crests has a smaller overlap along another direction.
        let short = 0.5 - number(&answer, "overlap");
        let expected = if answer["id"] == "1.6" { 0.01..0.1 } else { -1e-14..1e-14 };
        assert!(expected.contains(&short), "{answer:?}");
    }
    for bad in [pair("2.5"), "{\"id\": 4, \"VA\": [], \"VB\": []}\n".into()] {
        let output = dem_contact(&["-", "--repeats", "0"], &(text.clone() + &bad));
        assert_eq!(output.status.code(), Some(2));
        let said = said(&output);
        assert!(said.contains("input:4: ") && said.lines().count() == 1, "{said}");
    }
}

/// Ellipsoids a metre apart, with these semi-axes.
fn ellipsoids_of(sizes: impl Iterator<Item = f64>) -> String {
    let mut text =
        "id,aA,bA,cA,aB,bB,cB,xA,yA,zA,qwA,qxA,qyA,qzA,xB,yB,zB,qwB,qxB,qyB,qzB\n".to_owned();
    for (id, size) in sizes.enumerate() {
        let axes = format!("{size:?},1.0,1.0");
        writeln!(text, "{id},{axes},{axes},0,0,0,1,0,0,0,1,0,0,1,0,0,0").unwrap();
    }
    text
}

/// A hundred sizes that recur in turn make only a hundred shapes.
#[test]
fn shapes_that_come_up_again_are_not_new() {
    let pairs = 70_000;
    let size = |pair: u32| 1.0 + f64::from(pair % 100) / 64.0;
    let text = ellipsoids_of((0..pairs).map(size));
    let read_back = read("sizes", &text).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(read_back.len(), pairs as usize);
    for pair in 0..pairs {
        let (a, b, _) = read_back.posed(pair as usize);
        assert_eq!([a, b].map(|body| body.shape.semi_axes().x), [size(pair); 2], "{pair}");
    }
    // The limit holds for shapes that are all different.
    let text = ellipsoids_of((0..pairs).map(|pair| 1.0 + f64::from(pair) / 1e6));
    let error = read("sizes", &text).unwrap_err().to_string();
    assert_eq!(error, "sizes:65538: more than 65,536 different shapes: split the file");
}

/// At a distance whose square overflows, the row has no numbers and no solver.
#[test]
fn nobody_is_named_where_there_is_no_answer() {
    let pair =
        |x: &str| r#"{"id": "X", "rA": 1, "rB": 1, "cA": [0,0,0], "cB": [X,0,0]}"#.replace('X', x);
    let output = dem_contact(&["-", "--repeats", "0"], &[pair("3"), pair("1e200")].join("\n"));
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let solvers = rows(&output.stdout).into_iter().map(|mut row| {
        let numbers =
            [row.remove("overlap"), row.remove("nx"), row.remove("Cz")].map(Option::unwrap);
        (row.remove("solver").unwrap(), numbers.iter().all(String::is_empty))
    });
    let solvers: Vec<_> = solvers.collect();
    assert_eq!(solvers, [("sphere-sphere".into(), false), (String::new(), true)]);
}

/// Erosion and EPA have the paper's parameters by default.
#[test]
fn defaults_are_the_papers() {
    assert_eq!((ErodedGjk::default().ratio, ErodedGjk::default().increment), (0.05, 0.01));
    assert_eq!(Epa::default().tolerance, 1e-8);
}

/// `--law` with JKR across a gap. A pair that has not touched has no force, and one that has touched has the theory's force and
/// energy. Beyond the gap at which contacts end the force is zero.
#[test]
fn a_law_says_what_acts_across_a_gap() {
    let (radius, modulus, work) = (1e-3_f64, 0.5 * 1e8 / (1.0 - 0.09), 0.1_f64);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let scene = "domain = { low = [0, 0, 0], high = [1, 1, 1] }\nlaw = { normal = \"hertz\", adhesion = \"jkr\" }\n\
        material = [{ name = \"m\", density = 2500, youngs_modulus = 1e8, poisson_ratio = 0.3, surface_energy = 0.05, \
        friction = 0.5, restitution = 0.5 }]\n\
        shape = [{ name = \"ball\", kind = \"sphere\", radius = 0.01 }]\ntime = { step = 1e-7, steps = 1 }\n\
        output = { directory = \"out\" }\nfill.lattice = [{ first = [0.5, 0.5, 0.5], count = [1, 1, 1] }]\n";
    std::fs::write(&path, scene).unwrap();
    // A contact radius at which the surfaces are apart.
    let reduced = 0.5 * radius;
    let pi = std::f64::consts::PI;
    let a = 0.6 * (2.0 * pi * work * reduced * reduced / modulus).cbrt();
    let gap = (2.0 * pi * work * a / modulus).sqrt() - a * a / reduced;
    let force =
        4.0 / 3.0 * modulus * a.powi(3) / reduced - (8.0 * pi * work * modulus * a.powi(3)).sqrt();
    let energy = 8.0 / 15.0 * modulus * a.powi(5) / (reduced * reduced)
        - 2.0 / 3.0 * (8.0 * pi * work * modulus).sqrt() * a.powf(3.5) / reduced
        + pi * work * a * a;
    for (touched, gap, force, energy) in
        [(true, gap, force, energy), (false, gap, 0.0, 0.0), (true, 2.0 * gap, 0.0, 0.0)]
    {
        let pair = format!(
            "{{\"id\": \"p\", \"rA\": {radius}, \"rB\": {radius}, \"cA\": [0, 0, 0], \"cB\": [0, {}, 0]}}\n",
            2.0 * radius + gap
        );
        let mut arguments = vec!["-", "--repeats", "0", "--law", path.to_str().unwrap()];
        arguments.extend(touched.then_some("--touched"));
        let output = dem_contact(&arguments, &pair);
        let row = &rows(&output.stdout)[0];
        // The gap is a difference of lengths of 2 mm.
        let close = |found: f64, expected: f64| (found - expected).abs() <= 1e-6 * expected.abs();
        let found = vector(row, "law_F");
        assert!(
            close(found.y, force) && found.x == 0.0,
            "{found} N, {force:e} N, {}",
            said(&output)
        );
        assert!(close(number(row, "law_energy"), energy), "{} J, {energy:e} J", row["law_energy"]);
    }
}

/// `--law` gives the force, moment and energy of the scene's law: two balls with Hertz contact and adhesion, and with linear
/// springs.
#[test]
fn a_law_says_what_acts() {
    let scene = |law: &str, material: &str| {
        format!(
            "domain = {{ low = [0, 0, 0], high = [1, 1, 1] }}\nlaw = {{ {law} }}\n\
             material = [{{ name = \"m\", density = 2500, {material} }}]\n\
             shape = [{{ name = \"ball\", kind = \"sphere\", radius = 0.01 }}]\ntime = {{ step = 1e-7, steps = 1 }}\n\
             output = {{ directory = \"out\" }}\nfill.lattice = [{{ first = [0.5, 0.5, 0.5], count = [1, 1, 1] }}]\n"
        )
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let (radius, other, overlap) = (2e-3, 1e-3, 1e-6);
    let pair = format!(
        "{{\"id\": \"p\", \"rA\": {radius}, \"rB\": {other}, \"cA\": [0, 0, 0], \"cB\": [0, {}, 0]}}\n",
        radius + other - overlap
    );
    let reduced: f64 = radius * other / (radius + other);
    let modulus = 0.5 * 1e9 / (1.0 - 0.09);
    let hertz = 4.0 / 3.0 * modulus * reduced.sqrt() * overlap.powf(1.5);
    let pulls = 4.0 * std::f64::consts::PI * 0.02 * reduced;
    for (law, material, force, energy) in [
        ("", "normal_stiffness = 1e5", 1e5 * overlap, 0.5e5 * overlap * overlap),
        (
            "normal = \"hertz\", adhesion = \"dmt\"",
            "youngs_modulus = 1e9, poisson_ratio = 0.3, surface_energy = 0.02, friction = 0.5",
            hertz - pulls,
            0.4 * hertz * overlap - pulls * overlap,
        ),
    ] {
        // Other parts of the scene do not act on a pair, not even an outlet that would remove both bodies.
        let outlet = "outlet = [{ name = \"low\", point = [0, 0, 0.1], normal = [0, 0, 1] }]\n";
        std::fs::write(&path, scene(law, material) + outlet).unwrap();
        let output = dem_contact(&["-", "--repeats", "0", "--law", path.to_str().unwrap()], &pair);
        assert!(output.status.success(), "{}", said(&output));
        let row = &rows(&output.stdout)[0];
        // The overlap is a difference of lengths of 3 mm.
        let close = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-9;
        let found = vector(row, "law_F");
        assert!(
            close(found.y, force) && found.x == 0.0 && found.z == 0.0,
            "{found} N, {force:e} N"
        );
        assert!(vector(row, "law_M").norm() < 1e-18);
        assert!(close(number(row, "law_energy"), energy), "{} J, {energy:e} J", row["law_energy"]);
    }
    let to_law = path.to_str().unwrap();
    let touched = dem_contact(&["-", "--law", to_law, "--touched"], &pair);
    assert!(said(&touched).contains("only adhesion = \"jkr\""), "{}", said(&touched));
    let egg = "id,aA,bA,cA,aB,bB,cB,xA,yA,zA,qwA,qxA,qyA,qzA,xB,yB,zB,qwB,qxB,qyB,qzB\n\
               e,1,1,2,1,1,1,0,0,0,1,0,0,0,0,0,2.9,1,0,0,0\n";
    let output = dem_contact(&["-", "--law", path.to_str().unwrap()], egg);
    assert!(said(&output).contains("is not a sphere"), "{}", said(&output));
    let wrong = dem_contact(&["-", "--law", path.to_str().unwrap(), "--materials", "m,n"], &pair);
    assert!(said(&wrong).contains("no material `n`: there are m"), "{}", said(&wrong));
}
