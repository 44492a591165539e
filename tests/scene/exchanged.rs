//! Exchange files of the ON-DEM action: written, read back, and those of other programs.

use crate::support::{begun, save};
use dem_mpi::comm::Comm;
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::output::snapshot::{self, Reader};
use dem_mpi::output::tables::ParticleTable;
use dem_mpi::post::ondem;
use dem_mpi::scene::doubts::doubts;
use dem_mpi::scene::{Fill, Listed, Scene};
use dem_mpi::sim::Simulation;
use hdf5_metno::types::VarLenUnicode;
use hdf5_metno::{File, H5Type};
use std::fs;
use std::path::Path;

/// Shapes of all kinds, of which some have sizes.
const SHAPES: &str = r#"
gravity = [0, 0, -9.81]
[domain]
low = [-1, -1, -1]
high = [1, 1, 1]
walls = ["-z"]
wall_material = "oak"
[[material]]
name = "glass"
density = 2500
normal_stiffness = 1e5
[[material]]
name = "oak"
density = 700
normal_stiffness = 2e4
friction = 0.5
[[shape]]
name = "bead"
kind = "sphere"
radius = 0.07
material = "glass"
size = { uniform = [0.7, 1.1] }
[[shape]]
name = "egg"
kind = "ellipsoid"
semi_axes = [0.1, 0.05, 0.025]
material = "oak"
[[shape]]
name = "soap"
kind = "superellipsoid"
semi_axes = [0.1, 0.05, 0.06]
exponents = [0.5, 0.7]
material = "oak"
[[shape]]
name = "pear"
kind = "poly-superellipsoid"
semi_axes_positive = [0.1, 0.05, 0.06]
semi_axes_negative = [0.07, 0.06, 0.05]
exponents = [0.8, 0.9]
material = "oak"
[[shape]]
name = "rod"
kind = "spherocylinder"
length = 0.1
radius = 0.03
material = "glass"
[[shape]]
name = "brick"
kind = "polyhedron"
edges = [0.12, 0.09, 0.07]
material = "glass"
size = { uniform = [0.7, 1.1] }
[[shape]]
name = "die"
kind = "rounded-polyhedron"
edges = [0.12, 0.09, 0.07]
radius = 0.01
material = "glass"
[[shape]]
name = "dimer"
kind = "union"
pieces = [{ shape = "bead", at = [-0.03, 0, 0] }, { shape = "brick", at = [0.05, 0, 0] }]
material = "oak"
[time]
step = 1e-6
steps = 0
[output]
directory = "out"
"#;

const LATTICE: &str = r#"
[[fill.lattice]]
shapes = ["bead", "egg", "soap", "pear", "rod", "brick", "die", "dimer"]
first = [-0.6, -0.6, -0.9]
count = [5, 5, 3]
spacing = 0.3
jitter = 0.01
velocity = [1, 2, 3]
"#;

fn parsed(text: &str, folder: &Path) -> Result<Scene, String> {
    Scene::parse(text, "scene.toml", folder, &[]).map_err(|errors| errors.to_string())
}

/// Saves a snapshot in which each particle has another velocity and spin, and returns its table.
fn spinning(scene: &Scene, folder: &Path) -> (Reader, ParticleTable) {
    let comm = &mut Alone::default();
    let sim = begun(scene, comm);
    let mut particles = sim.particle_table(comm.rank());
    for (k, place) in particles.position.iter().enumerate() {
        particles.velocity[k] = place * 0.7;
        particles.angular_velocity[k] = Vec3::new(0.1, 0.3, 1.0) + place / 3.0;
    }
    let header = sim.header(&scene.text, &sim.measure(comm).wall_forces, comm);
    let (contacts, records) = (sim.contact_table(), sim.contact_records());
    snapshot::write(folder, &header, &particles, &contacts, &records, comm).unwrap();
    let reader = Reader::open(folder).unwrap();
    let particles = reader.particles(0..reader.particle_count()).unwrap();
    (reader, particles)
}

/// Saves a snapshot and returns its table.
fn saved(sim: &Simulation, scene: &Scene, folder: &Path) -> (Reader, ParticleTable) {
    save(sim, folder, scene, &mut Alone::default());
    let reader = Reader::open(folder).unwrap();
    let particles = reader.particles(0..reader.particle_count()).unwrap();
    (reader, particles)
}

fn rows(scene: &Scene) -> &[Listed] {
    let [Fill::Listed(rows)] = &scene.initial[..] else { panic!("{:?}", scene.initial) };
    rows
}

/// Ids, shapes, sizes, places, orientations, velocities and spins come back to the last bit.
#[test]
fn files_of_this_program_come_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let made = parsed(&format!("{SHAPES}{LATTICE}"), folder.path()).unwrap();
    let (reader, particles) = spinning(&made, &folder.path().join("first"));
    ondem::write(&folder.path().join("all.vtkhdf"), &reader).unwrap();

    let text = format!("{SHAPES}[[fill.file]]\npath = \"all.vtkhdf\"\n");
    let again = parsed(&text, folder.path()).unwrap();
    assert_eq!(rows(&again).len(), 75);
    for (k, row) in rows(&again).iter().enumerate() {
        assert_eq!((row.id, row.shape), (particles.id[k].0, particles.shape[k]));
        assert_eq!(row.scale.to_bits(), particles.scale_of(k).to_bits());
        let bits = |vector: &Vec3| vector.map(f64::to_bits);
        assert_eq!(bits(&row.position), bits(&particles.position[k]));
        assert_eq!(bits(&row.velocity), bits(&particles.velocity[k]));
        assert_eq!(bits(&row.angular_velocity), bits(&particles.angular_velocity[k]));
        let [x, y, z, w]: [f64; 4] = row.quaternion.coords.into();
        assert_eq!([w, x, y, z].map(f64::to_bits), particles.quaternion[k].map(f64::to_bits));
    }
    assert!(doubts(&again).iter().all(|doubt| !doubt.contains("differs")));

    // A run of no steps: spins pass through angular momenta, and come back to rounding.
    let still = begun(&again, &mut Alone::default());
    let (of_again, second) = saved(&still, &again, &folder.path().join("second"));
    let exact = |table: &ParticleTable| {
        (table.id.clone(), table.shape.clone(), table.scale.clone(), table.position.clone())
    };
    assert_eq!(exact(&second), exact(&particles));
    assert_eq!(
        (&second.velocity, &second.quaternion),
        (&particles.velocity, &particles.quaternion)
    );
    for (before, after) in particles.angular_velocity.iter().zip(&second.angular_velocity) {
        assert!((before - after).norm() <= 1e-14 * before.norm(), "{before:?} {after:?}");
    }
    for (before, after) in reader.header().shapes.iter().zip(&of_again.header().shapes) {
        assert_eq!((&before.name, &before.geometry), (&after.name, &after.geometry));
    }

    // A shape of another form is noticed.
    let other = parsed(
        &text.replace("semi_axes = [0.1, 0.05, 0.025]", "semi_axes = [0.1, 0.05, 0.026]"),
        folder.path(),
    );
    let told = doubts(&other.unwrap());
    let told: Vec<_> = told.iter().filter(|doubt| doubt.contains("differs")).collect();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("shape egg of the file differs from that of the scene"), "{told:?}");
}

fn column<T: H5Type>(file: &File, name: &str, shape: &[usize], values: &[T]) {
    let builder = file.new_dataset::<T>().shape(shape);
    builder.create(format!("VTKHDF/PointData/{name}").as_str()).unwrap().write_raw(values).unwrap();
}

/// A file in the layout of the exporter for Yade: integers of 32 bits, quaternions (x, y, z, w), no shapes but spheres, a clump without a body.
fn of_yade(path: &Path, clumps: [i32; 3]) {
    let file = File::create(path).unwrap();
    file.create_group("VTKHDF").unwrap().create_group("PointData").unwrap();
    column(&file, "body_id", &[3], &[7_i32, 5, 6]);
    column(&file, "material_id", &[3], &[1_i32, 0, 0]);
    column(&file, "clump_id", &[3], &clumps);
    column(&file, "radius", &[3], &[0.14, 0.07, 0.035]);
    column(&file, "position", &[3, 3], &[0.5, 0.0, 0.25, -0.5, 0.0, 0.0, 0.0, 0.5, 0.0]);
    column(
        &file,
        "orientation",
        &[3, 4],
        &[0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0],
    );
    let label: VarLenUnicode = "Sphere".parse().unwrap();
    column(&file, "shape_type", &[3], &[label.clone(), label.clone(), label]);
}

#[test]
fn files_of_yade_have_spheres() {
    let folder = tempfile::tempdir().unwrap();
    of_yade(&folder.path().join("yade.vtkhdf"), [-1; 3]);
    let keys = "types = { 0 = \"bead\", 1 = \"bead\" }\n";
    let text = format!("{SHAPES}[[fill.file]]\npath = \"yade.vtkhdf\"\n{keys}");
    let scene = parsed(&text, folder.path()).unwrap();
    let [five, six, seven] = rows(&scene) else { panic!("three particles") };
    assert_eq!([five.id, six.id, seven.id], [5, 6, 7]);
    assert_eq!([five.scale, six.scale, seven.scale], [1.0, 0.5, 2.0]);
    assert_eq!(seven.position, Vec3::new(0.5, 0.0, 0.25));
    assert!(
        seven.quaternion.angle_to(&Quat::from_axis_angle(&Vec3::z_axis(), std::f64::consts::PI))
            < 1e-15
    );
    assert!(
        six.quaternion.angle_to(&Quat::from_axis_angle(&Vec3::x_axis(), std::f64::consts::PI))
            < 1e-15
    );
    assert_eq!(six.velocity, Vec3::zeros());

    // Another ending with the format, and a piece of clump 7, whose body is there.
    of_yade(&folder.path().join("yade.h5"), [7, 7, -1]);
    let named = text.replace("yade.vtkhdf\"", "yade.h5\"\nformat = \"ondem\"");
    let scene = parsed(&named, folder.path()).unwrap();
    assert_eq!(rows(&scene).iter().map(|row| row.id).collect::<Vec<_>>(), [6, 7]);
}

#[test]
fn files_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{SHAPES}[[fill.file]]\npath = \"a.vtkhdf\"\ntypes = {{ 0 = \"bead\" }}\n");
    let path = folder.path().join("a.vtkhdf");
    let refused = |said: &str| {
        let errors = parsed(&text, folder.path()).unwrap_err();
        assert!(errors.contains(said), "{errors}");
    };
    refused("No such file");
    fs::write(&path, "no HDF5").unwrap();
    refused("open file");
    File::create(&path).unwrap();
    refused("it is no file of ON-DEM, as it has no /VTKHDF/PointData/body_id");
    // A clump without its body, and a material that is no shape.
    of_yade(&path, [-1, 3, 3]);
    refused("body 5 is a piece of clump 3, which the file does not have");
    of_yade(&path, [-1; 3]);
    refused("which shape has type 1?");
    let file = File::append(&path).unwrap();
    column(&file, "velocity", &[2, 3], &[0.0; 6]);
    file.close().unwrap();
    refused("/VTKHDF/PointData/velocity has another number of bodies");
    // 800 TB that are declared, and nothing is stored.
    let file = File::create(&path).unwrap();
    file.create_group("VTKHDF").unwrap().create_group("PointData").unwrap();
    let huge = file.new_dataset::<i64>().shape([100_000_000_000_000]).chunk([1000]);
    huge.create("VTKHDF/PointData/body_id").unwrap();
    file.close().unwrap();
    refused("/VTKHDF/PointData/body_id: it has more values than the file can hold");
}
