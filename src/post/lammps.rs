//! A LAMMPS text dump of the particles, for OVITO, which reads no VTKHDF.
//!
//! `shapex shapey shapez` are **full axes** (diameters), as LAMMPS itself writes them since July 2020; OVITO halves them to its
//! "Aspherical Shape", which has semi-axes. The quaternion has the order (x, y, z, w) of OVITO and LAMMPS. Types count from 1;
//! ids are those of the snapshot, from 0. `radius` is that of the sphere of equal volume.
//!
//! OVITO reads the columns `SuperquadricRoundness.Phi` and `.Theta` as exponents of superellipsoids, and draws these, ellipsoids and spheres as
//! they are. All other shapes are drawn as the ellipsoids in their boxes until a mesh is loaded as the shape of their type ([`meshes`]).

use super::surface::{Detail, Surface};
use crate::cell::Shear;
use crate::math::Vec3;
use crate::output::header::{Header, ShapeRow};
use crate::output::tables::ParticleTable;
use crate::shape::{Kind, Shape};
use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::{self, Write};

/// Axes along and across which LAMMPS can tilt a box: xy, xz, yz.
const TILTS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// Types whose shape a dump cannot describe, with the name of the shape and its surface for OVITO as OBJ.
///
/// OVITO enlarges the mesh of a type by the radius of each particle, so its unit is the radius of the sphere of equal volume.
pub fn meshes(header: &Header) -> Vec<(usize, &str, String)> {
    let described = [Kind::Sphere, Kind::Ellipsoid, Kind::Superellipsoid];
    let bodies = header.shapes.iter().map(|row| (&*row.name, row.body()));
    let others = (1..).zip(bodies).filter(|(_, (_, body))| !described.contains(&body.kind()));
    let obj = |(kind, (name, body)): (usize, (_, Cow<Shape>))| {
        let surface = Surface::of(&body, Detail::FINE);
        let unit = 1.0 / body.equal_radius();
        let mut text = String::new();
        for point in surface.points.iter().map(|point| point * unit) {
            let _ = writeln!(text, "v {:e} {:e} {:e}", point.x, point.y, point.z);
        }
        for face in surface.faces() {
            text.push('f');
            for corner in face {
                let _ = write!(text, " {}", corner + 1);
            }
            text.push('\n');
        }
        (kind, name, text)
    };
    others.map(obj).collect()
}

/// Writes the lines above the rows of atoms. The box of a sheared or strained cell is tilted, if LAMMPS can do so.
///
/// # Errors
/// If the writer fails.
pub fn write_header(out: &mut impl Write, header: &Header, particles: usize) -> io::Result<()> {
    let sides = header.cell.periodic().map(|periodic| if periodic { "pp" } else { "ff" });
    writeln!(out, "ITEM: TIMESTEP\n{}", header.step)?;
    writeln!(out, "ITEM: NUMBER OF ATOMS\n{particles}")?;
    let (low, high) = header.cell.corners();
    let tilt = header.cell.shear().and_then(|Shear { along, across, .. }| {
        TILTS.iter().position(|axes| *axes == (along, across)).map(|tilt| (tilt, along))
    });
    if header.cell.strained().is_some() {
        let edges = header.cell.edges();
        let [xy, xz, yz] = [edges.m12, edges.m13, edges.m23];
        let wider = [[0.0, xy, xz, xy + xz], [0.0, yz, 0.0, yz], [0.0; 4]];
        writeln!(out, "ITEM: BOX BOUNDS xy xz yz {}", sides.join(" "))?;
        for (k, (wider, tilt)) in wider.iter().zip([xy, xz, yz]).enumerate() {
            let [least, most] = [f64::min, f64::max].map(|of| wider.iter().copied().fold(0.0, of));
            writeln!(out, "{:e} {:e} {:e}", low[k] + least, high[k] + most, tilt)?;
        }
    } else if let Some((tilt, along)) = tilt {
        // The tilted box, and the bounds around it.
        let slid = header.cell.slid();
        writeln!(out, "ITEM: BOX BOUNDS xy xz yz {}", sides.join(" "))?;
        for k in 0..3 {
            let wider = if k == along { [slid.min(0.0), slid.max(0.0)] } else { [0.0; 2] };
            let tilted = if k == tilt { slid } else { 0.0 };
            writeln!(out, "{:e} {:e} {:e}", low[k] + wider[0], high[k] + wider[1], tilted)?;
        }
    } else {
        writeln!(out, "ITEM: BOX BOUNDS {}", sides.join(" "))?;
        for k in 0..3 {
            writeln!(out, "{:e} {:e}", low[k], high[k])?;
        }
    }
    writeln!(
        out,
        "ITEM: ATOMS id type x y z quati quatj quatk quatw shapex shapey shapez vx vy vz radius SuperquadricRoundness.Phi \
         SuperquadricRoundness.Theta omegax omegay omegaz angmomx angmomy angmomz"
    )
}

/// Writes one row per particle, with enough digits to restore the bits.
///
/// # Errors
/// If the writer fails.
pub fn write_particles(
    out: &mut impl Write,
    header: &Header,
    particles: &ParticleTable,
) -> io::Result<()> {
    let bodies: Vec<(f64, [f64; 2])> = header.shapes.iter().map(size_and_exponents).collect();
    for (row, id) in particles.id.iter().enumerate() {
        let shape = &header.shapes[particles.shape[row].index()];
        let (radius, [along, across]) = bodies[particles.shape[row].index()];
        let turning = |of: &[Vec3]| of.get(row).copied().unwrap_or_default();
        let (w, l) = (turning(&particles.angular_velocity), turning(&particles.angular_momentum));
        let (x, v) = (&particles.position[row], &particles.velocity[row]);
        let [qw, qx, qy, qz] =
            particles.quaternion.get(row).copied().unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let axes = shape.semi_axes * (2.0 * particles.scale_of(row));
        write!(out, "{} {}", id, particles.shape[row].0 + 1)?;
        let shape = [qx, qy, qz, qw, axes.x, axes.y, axes.z];
        let of_size = [radius * particles.scale_of(row), across, along];
        let numbers =
            [x.as_slice(), &shape[..], v.as_slice(), &of_size, w.as_slice(), l.as_slice()];
        for number in numbers.into_iter().flatten() {
            write!(out, " {number:e}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Radius of the sphere of equal volume [m], and exponents: those of an ellipsoid are 1.
fn size_and_exponents(row: &ShapeRow) -> (f64, [f64; 2]) {
    let body = row.body();
    let exponents = match &*body {
        Shape::Superellipsoid(body) => body.exponents(),
        _ => [1.0; 2],
    };
    (body.equal_radius(), exponents)
}
