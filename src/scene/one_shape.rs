//! Page, drawing and surface of one shape of a scene, for `dem-mpi --shape`.

use super::Scene;
use super::mistakes::suggestion;
use super::plan;
use crate::files;
use crate::ids::ShapeId;
use crate::math::{Quat, Vec3};
use crate::post::form::Form;
use crate::shape::union::Piece;
use crate::shape::{Kind, Shape};
use crate::text::shown;
use std::fmt::{Display, Write as _};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Width of the names of numbers.
const LABELS: usize = 18;

impl Scene {
    /// Shape with this name.
    ///
    /// # Errors
    /// If there is no such shape; the text lists the names.
    pub fn shape(&self, name: &str) -> Result<ShapeId, String> {
        let names = &self.library.names[..self.library.own_shapes()];
        let found = names.iter().position(|other| other == name);
        found.map(|index| ShapeId(index as u16)).ok_or_else(|| {
            let hint = suggestion(name, names.iter().map(String::as_str), "there are");
            format!("--shape {}: no such shape{hint}", shown(name))
        })
    }
}

/// Kind, volume, mass, centre, axes, moments of inertia, balls and pieces of a shape, one line each.
pub fn page(scene: &Scene, shape: ShapeId) -> String {
    let library = &scene.library;
    let index = shape.index();
    let body = &library.shapes[index];
    let mut page = String::new();
    let mut line = |label: &str, text: &dyn Display| {
        let _ = writeln!(page, "{label:<LABELS$}{text}");
    };
    let material = &scene.materials[library.materials[index].index()];
    line("shape", &shown(&library.names[index]));
    line("kind", &body.kind().name());
    line("material", &format!("{}, {:?} kg/m3", shown(&material.name), material.density));
    line("volume", &format!("{:.12e} m3", body.volume()));
    line("mass", &format!("{:.12e} kg", library.mass[index]));
    let upright = (Vec3::zeros(), Quat::identity());
    let (centre, axes) = body.placement().map_or(upright, |place| (place.centre, place.axes));
    line("centre", &format!("{} m, in the axes of the scene's entry", listed(&centre)));
    line("principal axes", &format!("turned from those by the quaternion {}", turned(&axes)));
    let inertia = body.gyration() * library.mass[index];
    line("inertia", &format!("{} kg m2, about the principal axes", listed(&inertia)));
    line("bounding ball", &format!("radius {:.9e} m, about the centre", body.bounding_radius()));
    if body.kind() != Kind::Union {
        let radius = body.inscribed_radius();
        line("inscribed ball", &format!("radius {radius:.9e} m, about the centre"));
    }
    line("half lengths", &format!("{} m, along the principal axes", listed(&body.half_lengths())));
    if let Some(faces) = faces_of(body) {
        line("faces", &faces);
    }
    let [least, largest] = library.scales[index];
    if [least, largest] != [1.0; 2] {
        line("sizes", &format!("lengths from {least:?} to {largest:?} times these"));
    }
    if let Shape::Union(union) = body {
        line("pieces", &plan::pieces_of(union));
        for (number, piece) in (1..).zip(union.pieces()) {
            line(&format!("  piece {number}"), &piece_of(piece));
        }
    }
    page
}

fn piece_of(Piece { shape, centre, rotation }: &Piece) -> String {
    let (kind, volume) = (shape.kind().name(), shape.volume());
    let faces = faces_of(shape).map_or_else(String::new, |faces| format!(", {faces}"));
    let (at, turn) = (listed(centre), turned(rotation));
    format!("{kind} of {volume:.6e} m3{faces}, at {at} m, turned by {turn}")
}

fn faces_of(shape: &Shape) -> Option<String> {
    let facets = shape.facets()?;
    let (faces, corners) = (facets.planes().len(), facets.vertices().len());
    Some(format!("{faces} faces, {corners} corners"))
}

fn listed(vector: &Vec3) -> String {
    format!("[{:.9e}, {:.9e}, {:.9e}]", vector.x, vector.y, vector.z)
}

fn turned(quaternion: &Quat) -> String {
    let q = quaternion.quaternion();
    format!("[{:.9}, {:.9}, {:.9}, {:.9}]", q.w, q.i, q.j, q.k)
}

/// Draws a shape into a folder, which is created if it is missing: an SVG from three sides and aslant, and its surface as
/// VTP. Both have the centre of the shape as origin and its principal axes. Returns their paths.
///
/// # Errors
/// If a file cannot be written; the text names it and the reason.
pub fn draw(scene: &Scene, shape: ShapeId, folder: &Path) -> Result<[PathBuf; 2], String> {
    let wrong =
        |path: &Path, error: std::io::Error| format!("cannot write {}: {error}", path.display());
    std::fs::create_dir_all(folder).map_err(|error| wrong(folder, error))?;
    let name = &scene.library.names[shape.index()];
    let is_plain = |c: char| c.is_alphanumeric() || "-_".contains(c);
    let stem: String = name.chars().map(|c| if is_plain(c) { c } else { '_' }).collect();
    let form = Form::of(&scene.library.shapes[shape.index()]);
    let [svg, vtp] = ["svg", "vtp"].map(|ending| folder.join(format!("{stem}.{ending}")));
    let drawing = form.svg();
    files::replace(&svg, |file| file.write_all(drawing.as_bytes()))
        .map_err(|error| wrong(&svg, error))?;
    let surface = form.surface();
    files::replace(&vtp, |file| surface.write(file)).map_err(|error| wrong(&vtp, error))?;
    Ok([svg, vtp])
}
