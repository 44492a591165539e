//! Particles from files of other codes: LAMMPS data files and dumps, Yade's text, tables with ids and radii.
//!
//! The files of LAMMPS are as version 29 Sep 2021 writes them, or by hand after its manual.

use crate::support::{OnRanks, begun, close, save};
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::output::snapshot::Reader;
use dem_mpi::post::lammps;
use dem_mpi::scene::doubts::doubts;
use dem_mpi::scene::{Fill, Listed, Scene};
use nalgebra::Quaternion;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// A domain from -1 to 1 m, glass of 2500 kg/m³, a bead of radius 0.01 m and an egg of semi-axes 0.1, 0.05 and 0.025 m.
const REST: &str = r#"
[domain]
low = [-1, -1, -1]
high = [1, 1, 1]
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e5
[[shape]]
name = "bead"
kind = "sphere"
radius = 0.01
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.1, 0.05, 0.025]
[time]
step = 1e-6
steps = 10
[output]
directory = "out"
"#;

const SPHERES: &str = "LAMMPS data file via write_data, version 29 Sep 2021, timestep = 0

2 atoms
2 atom types

-1 1 xlo xhi
-1 1 ylo yhi
-1 1 zlo zhi

Atoms # sphere

2 2 0.04 2500 0.5 0.2 0.3 0 0 0
1 1 0.02 2500 0.1 0.2 0.3 0 0 0

Velocities

1 1 2 3 0 0 0
2 1 2 3 4 5 6
";

const ELLIPSOIDS: &str = "LAMMPS data file via write_data, version 29 Sep 2021, timestep = 0

2 atoms
2 atom types
2 ellipsoids

-1 1 xlo xhi
-1 1 ylo yhi
-1 1 zlo zhi

Atoms # ellipsoid

1 1 1 2500 0.1 0.2 0.3 0 0 0
2 2 1 2500 0.5 0.2 0.3 0 0 0

Velocities

1 1 2 3 1 2 3
2 1 2 3 0 0 0

Ellipsoids

1 0.2 0.1 0.05 0.7071067811865476 0 0 0.7071067811865475
2 0.02 0.02 0.02 1 0 0 0
";

/// A frame of the ellipsoids above.
const FRAME: &str = "ITEM: TIMESTEP
WHEN
ITEM: NUMBER OF ATOMS
2
ITEM: BOX BOUNDS pp ff ff
-1.0000000000000000e+00 1.0000000000000000e+00
-1.0000000000000000e+00 1.0000000000000000e+00
-1.0000000000000000e+00 1.0000000000000000e+00
ITEM: ATOMS id type PLACE vx vy vz angmomx angmomy angmomz mass fx c_q[1] c_q[2] c_q[3] c_q[4] c_s[1] c_s[2] c_s[3]
2 2 SECOND 1 2 3 0 0 0 0.010472 0 1 0 0 0 0.02 0.02 0.02
1 1 FIRST 1 2 3 1 2 3 1.309 0 0.707107 0 0 0.707107 0.2 0.1 0.05
";

const EGG_AND_BEAD: &str = "types = { 1 = \"egg\", 2 = \"bead\" }\n";
const NAMED: &str = "columns = { \"c_q[1]\" = \"quatw\", \"c_q[2]\" = \"quati\", \"c_q[3]\" = \"quatj\", \"c_q[4]\" = \"quatk\", \"c_s[1]\" = \"shapex\", \
    \"c_s[2]\" = \"shapey\", \"c_s[3]\" = \"shapez\" }\n";

fn frame(step: u64, place: &str, [first, second]: [&str; 2]) -> String {
    let frame = FRAME.replace("WHEN", &step.to_string());
    frame.replace("PLACE", place).replace("FIRST", first).replace("SECOND", second)
}

/// A scene with particles from this file, and with these keys beside `path`.
fn with_file(name: &str, text: &str, keys: &str) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join(name), text).unwrap();
    let scene = format!("{REST}[[fill.file]]\npath = \"{name}\"\n{keys}");
    Scene::parse(&scene, "scene.toml", folder.path(), &[]).map_err(|errors| errors.to_string())
}

fn scene(name: &str, text: &str, keys: &str) -> Scene {
    with_file(name, text, keys).unwrap_or_else(|errors| panic!("{errors}"))
}

/// The particles of the only list.
fn rows(scene: &Scene) -> &[Listed] {
    let [Fill::Listed(rows)] = &scene.initial[..] else { panic!("{:?}", scene.initial) };
    rows
}

fn near(found: Vec3, expected: Vec3, tolerance: f64) {
    assert!((found - expected).amax() <= tolerance, "{found:?}, expected {expected:?}");
}

/// Ids, places, velocities and sizes to the last bit; rows come in the order of ids.
#[test]
fn spheres_of_a_data_file() {
    let types = "types = { 1 = \"bead\", 2 = \"bead\" }\n";
    // Without its comment a section Atoms is of spheres.
    for text in [
        SPHERES.to_owned(),
        SPHERES.replace(" # sphere", ""),
        SPHERES.replace("# sphere", "# granular"),
    ] {
        let scene = scene("spheres.data", &text, types);
        let [one, two] = rows(&scene) else { panic!("two particles") };
        assert_eq!([one.id, two.id], [1, 2]);
        assert_eq!([one.scale, two.scale], [1.0, 2.0]);
        assert_eq!(
            [one.position, two.position],
            [Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.5, 0.2, 0.3)]
        );
        assert_eq!([one.velocity; 2], [two.velocity, Vec3::new(1.0, 2.0, 3.0)]);
        assert_eq!(
            [one.angular_velocity, two.angular_velocity],
            [Vec3::zeros(), Vec3::new(4.0, 5.0, 6.0)]
        );
        // Where it begins, the next particle gets the id 3.
        let sim = begun(&scene, &mut Alone::default());
        assert_eq!(sim.next_id, 3);
        let volume = 4.0 / 3.0 * PI * 0.02_f64.powi(3);
        close(scene.library.mass_at(two.shape, two.scale), 2500.0 * volume, 1e-14, "mass");
    }
}

/// The quaternion begins with w, lengths are full ones, and velocities of section Velocities are angular momenta.
#[test]
fn ellipsoids_of_a_data_file() {
    let scene = scene("ellipsoids.lmp", ELLIPSOIDS, EGG_AND_BEAD);
    let [egg, bead] = rows(&scene) else { panic!("two particles") };
    assert_eq!((egg.scale, bead.scale), (1.0, 1.0));
    near(egg.quaternion * Vec3::x(), Vec3::y(), 1e-15);
    let mass = 2500.0 * 4.0 / 3.0 * PI * 0.1 * 0.05 * 0.025;
    // By a quarter turn about z its long axis lies along y. The angular momentum is 1, 2, 3 along x, y, z.
    let about = |one: f64, other: f64| mass / 5.0 * (one * one + other * other);
    let spin = Vec3::new(1.0 / about(0.1, 0.025), 2.0 / about(0.05, 0.025), 3.0 / about(0.1, 0.05));
    near(egg.angular_velocity, spin, 1e-13 * spin.amax());
    assert_eq!(bead.angular_velocity, Vec3::zeros());
    // The density of the file is that of the momentum; the particle has its material's, which is said.
    let denser =
        with_file("ellipsoids.lmp", &ELLIPSOIDS.replace(" 2500 ", " 5000 "), EGG_AND_BEAD).unwrap();
    near(rows(&denser)[0].angular_velocity, spin * 0.5, 1e-13 * spin.amax());
    assert!(
        denser.doubtful.iter().any(|doubt| doubt.contains("column density: 5000.0 is not used")),
        "{:?}",
        denser.doubtful
    );
    assert!(scene.doubtful.is_empty(), "{:?}", scene.doubtful);
}

/// The last frame or another; places that are scaled to the box, or beyond a period of it; columns of any name.
#[test]
fn frames_of_a_dump() {
    let plain = frame(100, "x y z", ["0.1 0.2 0.3", "0.5 0.2 0.3"]);
    let scaled = frame(200, "xs ys zs", ["0.55 0.6 0.65", "0.75 0.6 0.65"]);
    let beyond = frame(300, "xu yu zu", ["4.1 0.2 0.3", "-1.5 0.2 0.3"]);
    let two = frame(400, "x y z xs ys zs", ["0.1 0.2 0.3 0 0 0", "0.5 0.2 0.3 0 0 0"]);
    let text = ["ITEM: UNITS\nsi\n", &plain, &scaled, &beyond, "ITEM: TIME\n4\n", &two].concat();
    let keys = format!("{EGG_AND_BEAD}{NAMED}");
    let first = scene("run.dump", &plain, &keys);
    let [egg, bead] = rows(&first) else { panic!("two particles") };
    assert_eq!((egg.id, bead.id, egg.scale, bead.scale), (1, 2, 1.0, 1.0));
    near(egg.position, Vec3::new(0.1, 0.2, 0.3), 0.0);
    near(egg.quaternion * Vec3::x(), Vec3::y(), 1e-6);
    close(egg.angular_velocity.z, 3.0 / (1.309 / 5.0 * (0.1 * 0.1 + 0.05 * 0.05)), 1e-12, "spin");
    for (frame, at) in [("", 3), ("frame = 0\n", 0), ("frame = 1\n", 1), ("frame = 2\n", 2)] {
        let scene = scene("run.txt", &text, &format!("{frame}{keys}"));
        for (row, first) in rows(&scene).iter().zip(rows(&first)) {
            near(row.position, first.position, 1e-15 * f64::from(at.min(2)));
            assert_eq!((row.id, row.quaternion), (first.id, first.quaternion));
        }
    }
    let errors = with_file("run.dump", &text, &format!("frame = 4\n{keys}")).unwrap_err();
    assert!(errors.contains("the dump has frames 0 to 3, from time step 100 to 400"), "{errors}");
    // Columns that may be what is missing are named.
    let scene = scene("run.dump", &plain, EGG_AND_BEAD);
    assert!(
        scene.doubtful.iter().any(|d| d.contains("columns c_q[1], c_q[2]")),
        "{:?}",
        scene.doubtful
    );
}

/// A tilted box of a data file or a dump is a domain with these edges. Its particles are in the box of the domain, by whole edges.
#[test]
fn boxes_that_lean() {
    let edges = "edges = [[2.0, 0.0, 0.0], [0.5, 2.0, 0.0], [-0.25, 0.125, 2.0]]";
    let data = ELLIPSOIDS
        .replace("-1 1 zlo zhi", "-1 1 zlo zhi\n0.5 -0.25 0.125 xy xz yz")
        .replace("0.1 0.2 0.3 0 0 0", "1.4 1.2 0.3 0 0 0");
    // Places as fractions of the edges; ends of the box around the tilted one.
    let part = |[x, y, z]: [f64; 3]| {
        let w = 0.5 * (z + 1.0);
        let v = 0.5 * (y + 1.0 - 0.125 * w);
        format!("{:e} {v:e} {w:e}", 0.5 * (x + 1.0 - 0.5 * v + 0.25 * w))
    };
    let places = [[1.4, 1.2, 0.3], [0.5, 0.2, 0.3]].map(part);
    let dump = frame(100, "xs ys zs", [&places[0], &places[1]]).replace(
        "BOUNDS pp ff ff\n-1.0000000000000000e+00 1.0000000000000000e+00\n-1.0000000000000000e+00 1.0000000000000000e+00\n\
         -1.0000000000000000e+00 1.0000000000000000e+00",
        "BOUNDS xy xz yz pp pp pp\n-1.25 1.5 0.5\n-1 1.125 -0.25\n-1 1 0.125",
    );
    for (name, text, keys) in [
        ("a.data", &data, EGG_AND_BEAD.to_owned()),
        ("a.dump", &dump, format!("{EGG_AND_BEAD}{NAMED}")),
    ] {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(name), text).unwrap();
        let rest = REST.replace("high = [1, 1, 1]", &format!("{edges}\n[cell]"));
        let with = |rest: &str| {
            let scene = format!("{rest}[[fill.file]]\npath = \"{name}\"\n{keys}");
            Scene::parse(&scene, "scene.toml", folder.path(), &[]).map_err(|e| e.to_string())
        };
        let scene = with(&rest).unwrap_or_else(|errors| panic!("{name}: {errors}"));
        let [egg, bead] = rows(&scene) else { panic!("two particles") };
        // One whole second edge below.
        near(egg.position, Vec3::new(0.9, -0.8, 0.3), 1e-15);
        near(bead.position, Vec3::new(0.5, 0.2, 0.3), 1e-15);
        // The proposal of the message is this domain.
        let errors = with(REST).unwrap_err();
        assert!(errors.contains("write `low = [-1.0, -1.0, -1.0]`"), "{errors}");
        assert!(errors.contains(&format!("`{edges}`")), "{errors}");
        assert!(with(&rest.replace("0.5, 2.0", "0.4, 2.0")).is_err());
    }
}

/// Lines x y z r, as Yade and others write them, with and without a header.
#[test]
fn lines_of_places_and_radii() {
    let expected = [(Vec3::new(0.1, 0.2, 0.3), 0.5), (Vec3::new(-0.1, 0.2, 0.3), 2.0)];
    for (name, text) in [
        ("a.txt", "#format x_y_z_r\n0.1\t0.2\t0.3\t0.005\n# a comment\n-0.1\t0.2\t0.3\t0.02\n"),
        ("a.spheres", "0.1 0.2 0.3 0.005\n\n -0.1  0.2  0.3  0.02  # the second\n"),
        ("a.dat", "x y z r\n0.1 0.2 0.3 5e-3\n-0.1 0.2 0.3 2e-2\n"),
        ("a.dat", "# by hand\n# r x y z\n5e-3 0.1 0.2 0.3\n2e-2 -0.1 0.2 0.3\n"),
        ("a.csv", "# x, y, z, diameter\n0.1,0.2,0.3,0.01\n-0.1,0.2,0.3,0.04\n"),
        ("a.csv", "radius,x,y,z\n0.005,0.1,0.2,0.3\n0.02,-0.1,0.2,0.3\n"),
        ("a.csv", "# x,y,z in m, scale in 1\nscale,x,y,z\n0.5,0.1,0.2,0.3\n2,-0.1,0.2,0.3\n"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(name), text).unwrap();
        let (before, _) = REST.split_once("[[shape]]\nname = \"egg\"").unwrap();
        let (_, after) = REST.split_once("[time]").unwrap();
        let scene = format!("{before}[time]{after}[[fill.file]]\npath = \"{name}\"\n");
        let scene = Scene::parse(&scene, "scene.toml", folder.path(), &[])
            .unwrap_or_else(|e| panic!("{text}: {e}"));
        let found: Vec<_> = rows(&scene).iter().map(|row| (row.position, row.scale)).collect();
        assert_eq!(found, expected, "{text}");
    }
    // The size of the shape itself counts for nothing where all its particles are listed.
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.txt"), "0.1 0.2 0.3 0.005\n-0.1 0.2 0.3 0.02\n").unwrap();
    let sized = |radius: &str, keys: &str| {
        let (before, _) = REST.split_once("[[shape]]\nname = \"egg\"").unwrap();
        let (_, after) = REST.split_once("[time]\nstep = 1e-6").unwrap();
        let before = before.replace("radius = 0.01", &format!("radius = {radius}"));
        let text = format!(
            "{before}[time]\nstep = \"auto\"{after}[[fill.file]]\npath = \"a.txt\"\n{keys}"
        );
        Scene::parse(&text, "scene.toml", folder.path(), &[]).unwrap_or_else(|e| panic!("{e}"))
    };
    let (large, small) = (sized("1", ""), sized("0.005", ""));
    close(large.dt, small.dt, 1e-14, "step");
    close(large.skin, small.skin, 1e-14, "skin");
    let lattice = "[[fill.lattice]]\nfirst = [0, 0, -0.5]\ncount = [1, 1, 1]\n";
    assert!(sized("0.001", lattice).dt < 0.5 * small.dt);
    // The radius of another shape is that of the sphere of its volume.
    let text = "#format x_y_z_r_matId\n0.1 0.2 0.3 0.1 0\n-0.3 0.2 0.3 0.01 1\n";
    let scene = scene("a.txt", text, "types = { 0 = \"egg\", 1 = \"bead\" }\n");
    let [egg, bead] = rows(&scene) else { panic!("two particles") };
    let volume = scene.library.shapes[egg.shape.index()].volume() * egg.scale.powi(3);
    close(volume, 4.0 / 3.0 * PI * 0.1_f64.powi(3), 1e-14, "volume");
    assert_eq!((bead.scale, [egg.id, bead.id]), (1.0, [0, 1]));
}

/// A dump of this program comes back with the same bits, whatever the shapes.
#[test]
fn dumps_of_this_program() {
    let more = "[[shape]]\nname = \"brick\"\nkind = \"polyhedron\"\nedges = [0.06, 0.04, 0.02]\n[[fill.lattice]]\nshapes = [\"bead\", \"egg\", \"brick\"]\n\
        first = [-0.6, -0.6, 0]\ncount = [5, 5, 1]\nspacing = 0.3\nvelocity = [1, 2, 3]\n";
    let made = Scene::parse(&format!("{REST}{more}"), "scene.toml", Path::new(""), &[]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let comm = &mut Alone::default();
    let sim = begun(&made, comm);
    save(&sim, folder.path(), &made, comm);
    let reader = Reader::open(folder.path()).unwrap();
    let particles = reader.particles(0..reader.particle_count()).unwrap();
    let mut dump = Vec::new();
    lammps::write_header(&mut dump, reader.header(), particles.id.len()).unwrap();
    lammps::write_particles(&mut dump, reader.header(), &particles).unwrap();
    let (shapes, _) = more.split_once("[[fill.lattice]]").unwrap();
    let keys = format!("types = {{ 1 = \"bead\", 2 = \"egg\", 3 = \"brick\" }}\n{shapes}");
    let again = scene("own.dump", &String::from_utf8(dump).unwrap(), &keys);
    for (k, row) in rows(&again).iter().enumerate() {
        let [w, x, y, z] = particles.quaternion[k];
        let turn = Quat::new_normalize(Quaternion::new(w, x, y, z));
        assert_eq!(
            (row.id, row.shape, row.position),
            (particles.id[k].0, particles.shape[k], particles.position[k])
        );
        assert_eq!((row.velocity, row.scale), (particles.velocity[k], 1.0));
        assert!(row.quaternion.angle_to(&turn) < 1e-15);
    }
}

/// Ids with gaps are kept: the same bits on any number of ranks, over restarts, and whatever the order of the rows.
#[test]
fn ids_of_a_file_are_kept() {
    let row = |k: u64| {
        let at = |n: u64| 0.019 * n as f64 - 0.1;
        format!(
            "{},{:?},{:?},{:?},bead\n",
            7 + 1000 * ((k * 37) % 101),
            at(k % 5),
            at(k / 5 % 5),
            at(k / 25)
        )
    };
    let table = |order: &mut dyn Iterator<Item = u64>| {
        order.fold("id,x,y,z,shape\n".to_owned(), |mut text, k| {
            text.write_str(&row(k)).unwrap();
            text
        })
    };
    let group = "[[group]]\nname = \"one\"\nids = [7]\nfixed = true\n";
    let one = scene("a.csv", &table(&mut (0..100)), group);
    let other = scene("a.csv", &table(&mut (0..100).rev()), group);
    assert_eq!(one.initial, other.initial);
    assert_eq!(one.initial[0].count(), 100);
    let state = OnRanks::of(&one).the_same_on(40, &[2, 3], &[[2, 3]]);
    assert!(
        state.bits.iter().any(|(id, _)| *id == 7)
            && state.bits.iter().all(|(id, _)| id % 1000 == 7)
    );
    // With two files of the same ids, the second is numbered after the first, with a warning.
    let folder = tempfile::tempdir().unwrap();
    let text = "id,x,y,z,shape\n5,0,0,0,bead\n2,0.1,0,0,bead\n";
    fs::write(folder.path().join("a.csv"), text).unwrap();
    fs::write(folder.path().join("b.csv"), text.replace(",0,0,", ",0.5,0,")).unwrap();
    let both = format!(
        "{REST}[[fill.file]]\npath = \"a.csv\"\n[[fill.file]]\npath = \"b.csv\"\n[[fill.random]]\nshapes = [\"bead\"]\ncount = 2\n"
    );
    let both = Scene::parse(&both, "scene.toml", folder.path(), &[]).unwrap();
    let ids: Vec<u64> =
        dem_mpi::scene::packing::initial(&both).map(|particle| particle.id.0).collect();
    assert_eq!(ids, [2, 5, 6, 7, 8, 9]);
    assert!(
        doubts(&both).iter().any(|d| d.contains("ids below 6 belong to fills before")),
        "{:?}",
        doubts(&both)
    );
}

/// The file is refused with these words, which have the line, the cause and the cure.
fn refused((name, text, keys): (&str, String, String), said: &str) {
    let errors = with_file(name, &text, &keys).expect_err(said);
    assert!(errors.contains(said) && errors.contains("fill.file.0"), "{said}: {errors}");
    assert!(errors.lines().count() < 8, "{errors}");
}

#[test]
fn data_files_that_cannot_be_read() {
    let data = |from: &str, to: &str| {
        ("a.data", ELLIPSOIDS.replacen(from, to, 1), EGG_AND_BEAD.to_owned())
    };
    for (file, said) in [
        (
            data("-1 1 zlo zhi", "-1 1 zlo zhi\n0.1 0 0 xy xz yz"),
            "write `low = [-1.0, -1.0, -1.0]` and `edges = [[2.0, 0.0, 0.0], [0.1, 2.0, 0.0], [0.0, 0.0, 2.0]]` in [domain]",
        ),
        (
            data("-1 1 zlo zhi", "-1 1 zlo zhi\n0.1 0 xy xz yz"),
            "line 10: the tilts of a box are three",
        ),
        (
            data("-1 1 xlo xhi", "-1 xlo xhi\n0.1 0 0 xy xz yz"),
            "line 7: `-1 xlo xhi` is not a side of the box: write `low high xlo xhi` with low below high",
        ),
        (data("-1 1 zlo zhi", "1 -1 zlo zhi"), "line 9: `1 -1 zlo zhi` is not a side of the box"),
        (
            data("-1 1 ylo yhi", "0.1  0  0  xy  xz  yz"),
            "line 8: the box has the tilts 0.1, 0, 0 and not all of its sides: write `low high xlo xhi`",
        ),
        (data("-1 1 xlo xhi", "1 0 0 avec"), "line 7: the edges of the box have any direction"),
        (
            data("# ellipsoid", "# molecular"),
            "line 11: atom_style molecular is not read: write_data with `sphere`",
        ),
        (data("Atoms # ellipsoid", "Atomen"), "has no section Atoms: was it cut off?"),
        (
            data("2 atoms", "3 atoms"),
            "line 11: 2 atoms follow, and the header says 3: was the file cut off?",
        ),
        (data("1 1 1 2500", "1 1 0 2500"), "line 13: atom 1 is a point"),
        (data("1 0.2 0.1", "3 0.2 0.1"), "line 13: section Ellipsoids has no atom 1"),
        (
            data("2 1 2 3 0 0 0", "1 1 2 3 0 0 0"),
            "line 19: section Velocities has particle 1 twice",
        ),
        (
            data("2 1 2 3 0 0 0", "2 1 2 3 0 0"),
            "line 19: section Velocities has an id and 6 numbers in each line",
        ),
        (data("0.1 0.05", "0.1 half"), "line 23: `half` is not a number"),
        (
            data("0.3 0 0 0", "0.3 0 0"),
            "line 13: an atom has 9 numbers; of this atom_style it has 7, id type ellipsoidflag density x y z, or 10",
        ),
        (
            data("0.2 0.1 0.05", "0.2 0.2 0.05"),
            "line 13, lengths 0.2, 0.2, 0.05 m are not in the proportion of shape egg, 0.2, 0.1, 0.05 m",
        ),
        (
            data("2 2 1 2500", "2 4 1 2500"),
            "line 14, column type: which shape has type 4? `types` says so, as in { \"4\" = \"bead\" }",
        ),
        (
            data("Ellipsoids\n", "Ellipsoids\n\nBodies\n"),
            "particles of section Bodies are not read: spheres and ellipsoids are",
        ),
    ] {
        refused(file, said);
    }
}

#[test]
fn dumps_that_cannot_be_read() {
    let keys = format!("{EGG_AND_BEAD}{NAMED}");
    let plain = frame(100, "x y z", ["0.1 0.2 0.3", "0.5 0.2 0.3"]);
    let dump = |from: &str, to: &str| ("a.dump", plain.replacen(from, to, 1), keys.clone());
    for (file, said) in [
        (
            dump("ff ff\n-1.0000000000000000e+00 1", "ff ff\n1.0000000000000000e+00 1"),
            "line 6: `1.0000000000000000e+00 1.0000000000000000e+00` is not `low high` of the box",
        ),
        (
            dump(
                "BOUNDS pp ff ff\n-1.0000000000000000e+00 1.0000000000000000e+00",
                "BOUNDS xy xz yz pp ff ff\n-1 1 0.5",
            ),
            "the box is tilted, and the domain is not so: with a [cell], write `low = [-1.0, -1.0, -1.0]` and `edges = [[1.5, 0.0, 0.0], [0.5, ",
        ),
        (
            dump("BOX BOUNDS pp", "BOX BOUNDS abc origin pp"),
            "line 5: the edges of the box have any",
        ),
        (
            dump("NUMBER OF ATOMS\n2", "NUMBER OF ATOMS\n99999999999999"),
            "2 atoms follow, and the frame has 99999999999999: was the file cut off?",
        ),
        (dump("NUMBER OF ATOMS\n2", "NUMBER OF ATOMS\n-2"), "line 4: `-2` is no number of atoms"),
        (dump("ITEM: ATOMS", "ITEM: ENTRIES"), "the file ends within a frame"),
        (dump("c_q[4]", "c_q4"), "`columns` names `c_q[4]`, which the file has not"),
        (dump("vz ang", "VZ ang"), "column vz is missing"),
        (dump("type x y z", "type x y y"), "there are two columns `y`"),
        (
            dump("ITEM: TIMESTEP", "ITEM: TIME STEP"),
            "the dump has no `ITEM: TIMESTEP`; is it a text",
        ),
        (
            dump("2 2 0.5", "2.5 2 0.5"),
            "line 10, column id: `2.5` is not a whole number, 0 or greater",
        ),
        (("a.dump", plain.clone(), keys.replace("quatj", "quatjj")), "no such column"),
        (
            ("a.dump", plain.clone(), keys.replace("egg", "eggs")),
            "types.1 = \"eggs\": no such shape, did you mean `egg`?",
        ),
    ] {
        refused(file, said);
    }
}

#[test]
fn tables_that_cannot_be_read() {
    let table = |text: &str| ("a.csv", text.to_owned(), String::new());
    let lines = |text: &str| ("a.txt", text.to_owned(), String::new());
    let rod = "[[shape]]\nname = \"rod\"\nkind = \"spherocylinder\"\nlength = 0.1\nradius = 0.01\n";
    for (file, said) in [
        (
            table("x,y,z,shape,id\n0,0,0,bead,3\n0,0,0.5,bead,3\n"),
            "line 3, column id: particle 3 stands in line 2, too",
        ),
        (
            ("a.csv", "x,y,z\n".to_owned(), "frame = 1\n".to_owned()),
            "`frame` is of dumps of LAMMPS, and this file is none",
        ),
        (
            table("x,y,z,radius,scale\n0,0,0,1,1\n"),
            "columns scale, radius and diameter are one of them",
        ),
        (
            table("x,y,z,shape,radius\n0,0,0,bead,0\n"),
            "line 2, column radius: 0.0 must be greater than 0",
        ),
        (
            table("x,y,z,shape,id\n0,0,0,bead,3\n0,0,0.5,bead,-3\n"),
            "line 3, column id: `-3` is not a whole number",
        ),
        (
            lines("0.1 0.2 0.3 0.05 7\n"),
            "line 1: without names of columns a line is `x y z r`, four numbers; it has 5: write the names above",
        ),
        (lines("x y z shape r\n0.1 0.2 zero bead 1\n"), "line 2, column z: `zero` is not a number"),
        (
            ("a.txt", "x y z shape r\n0.1 0.2 0 rod 1\n".to_owned(), rod.to_owned()),
            "shape rod is a spherocylinder, whose `radius` is that of its edges",
        ),
    ] {
        refused(file, said);
    }
}
