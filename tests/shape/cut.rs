//! Meshes of any form, cut into convex pieces that later stages keep.

use super::unions::{ELL, JACK, has, obj_of_cubes};
use crate::support::{begun, completed};
use dem_mpi::comm::Comm as _;
use dem_mpi::comm::alone::Alone;
use dem_mpi::math::{Quat, Vec3};
use dem_mpi::output::snapshot;
use dem_mpi::scene::Scene;
use dem_mpi::scene::assemble::{Continuation, assemble, take_up};
use dem_mpi::scene::plan::plan;
use dem_mpi::shape::mesh::triangles;
use dem_mpi::shape::union::Piece;
use dem_mpi::shape::{Convex as _, Polyhedron, Shape, Union};
use std::fs;
use std::path::{Path, PathBuf};

fn file(folder: &Path, places: &[[f64; 3]]) -> PathBuf {
    let path = folder.join("body.obj");
    fs::write(&path, obj_of_cubes(places)).unwrap();
    path
}

/// Scene of a body that is cut from a mesh.
fn cut(path: &Path, more: &str) -> String {
    let path = path.display().to_string();
    completed(&format!(
        "{more}\n[[shape]]\nname = \"body\"\nkind = \"union\"\nfile = {path:?}\npieces = 8\n[domain]\nlow = [-9, -9, -9]\nhigh = [9, 9, 9]\n"
    ))
}

fn read(text: &str) -> Scene {
    Scene::parse(text, "test", Path::new(""), &[]).unwrap_or_else(|errors| panic!("{errors}"))
}

fn union_of(scene: &Scene) -> &Union {
    let Shape::Union(body) = &scene.library.shapes[0] else { panic!("a union") };
    body
}

/// Volume and moments are the mesh's, and the number of pieces is at most the requested one.
#[test]
fn a_mesh_is_cut_into_pieces() {
    let folder = tempfile::tempdir().unwrap();
    for (places, moments) in
        [(&ELL[..], [5.0 / 6.0, 1.5, 11.0 / 6.0]), (&JACK[..], [31.0 / 6.0; 3])]
    {
        let path = file(folder.path(), places);
        let scene = read(&cut(&path, ""));
        let body = union_of(&scene);
        has(body, places.len() as f64, moments, 1e-12, "of a mesh");
        assert!(body.pieces().len() <= 8, "{} pieces", body.pieces().len());
        assert!(
            body.far() <= 0.05 * body.bounding_radius() && body.error().abs() < 0.05,
            "{body:?}"
        );
    }
    // Repeated halving would give eight pieces.
    let stone = format!("{}/run/stones/stone.obj", env!("CARGO_MANIFEST_DIR"));
    let text = cut(Path::new(&stone), "").replace("pieces = 8", "pieces = 5\ntolerance = 0.1");
    let scene = read(&text);
    let body = union_of(&scene);
    assert_eq!(body.pieces().len(), 5);
    assert!(body.error().abs() < 0.02 && body.far() < 0.07 * body.bounding_radius(), "{body:?}");
    // The plan names the library with its version.
    let manifest = include_str!("../../Cargo.toml");
    let (_, version) = manifest.split_once("parry3d-f64 = { version = \"").expect("a library");
    let version = &version[..version.find('"').expect("a version")];
    let told = plan(&scene, 1);
    assert!(told.contains(&format!("(V-HACD of parry3d-f64 {version}, 64 cells")), "{told}");
    let text = text.replace("tolerance = 0.1", "tolerance = 0.01");
    let refused = Scene::parse(&text, "test", Path::new(""), &[]).unwrap_err().to_string();
    assert!(refused.contains("more than `tolerance` = 0.01: use more `pieces`"), "{refused}");
}

/// A stage keeps the pieces of its snapshot, even if the library would now cut the mesh differently.
#[test]
fn pieces_stay_as_they_were_cut() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), &ELL);
    let text = cut(&path, "");
    let scene = read(&text);
    // Two blocks, like another library's cut.
    let surface = triangles(&path).unwrap();
    let block = |low: [f64; 3], high: [f64; 3]| {
        let side = |corner: usize, axis: usize| [low, high][corner >> axis & 1][axis];
        let corners: Vec<Vec3> = (0..8).map(|k| Vec3::from_fn(|axis, _| side(k, axis))).collect();
        let body = Polyhedron::new(&corners).unwrap();
        let (centre, rotation): (Vec3, Quat) = (body.placement().centre, body.placement().axes);
        Piece { shape: Shape::Polyhedron(Box::new(body)), centre, rotation }
    };
    let other = vec![
        block([-0.5, -0.5, -0.5], [1.5, 0.5, 0.5]),
        block([-0.5, -0.5, -0.5], [0.5, 1.5, 0.5]),
    ];
    let other = Union::in_surface(other, &surface).unwrap().of_at_most(8);
    assert_ne!(union_of(&scene), &other);

    let mut comm = Alone::default();
    let sim = begun(&scene, &mut comm);
    let mut header = sim.header(&scene.text, &[], &mut comm);
    header.shapes[0].semi_axes = other.half_lengths();
    header.shapes[0].geometry = Some(Shape::Union(Box::new(other.clone())));
    let (particles, contacts, records) =
        (sim.particle_table(comm.rank()), sim.contact_table(), sim.contact_records());
    let before = folder.path().join("before");
    snapshot::write(&before, &header, &particles, &contacts, &records, &mut comm).unwrap();

    let toml = folder.path().join("scene.toml");
    fs::write(&toml, &text).unwrap();
    let go_on = |more: &[&str]| {
        let more: Vec<String> = more.iter().map(|&word| word.to_owned()).collect();
        Scene::read_to_go_on(&toml, &more, &before).unwrap_or_else(|errors| panic!("{errors}"))
    };
    let again = go_on(&[]);
    assert_eq!(union_of(&again), &other);
    assert_eq!(again.library.pieces.len(), 2);
    let mut sim = assemble(&again, &comm);
    take_up(&mut sim, &again, &before, Continuation::SameStage, &mut comm).unwrap();
    assert_eq!(sim.particles.pieces(), 2);
    // The next stage keeps them, too.
    let next = read(&cut(&path, &format!("start = {:?}", before.display().to_string())));
    assert_eq!(union_of(&next), &other);
    // With other settings the mesh is cut again.
    assert_ne!(union_of(&go_on(&["shape.body.pieces=7"])), &other);
    assert_ne!(union_of(&go_on(&["shape.body.scale=2"])), &other);
}
