//! A LAMMPS text dump of the particles, for OVITO, which reads no VTKHDF.
//!
//! `shapex shapey shapez` are **full axes** (diameters), as LAMMPS itself writes them since July 2020; OVITO halves them to its
//! "Aspherical Shape", which has semi-axes. The quaternion has the order (x, y, z, w) of OVITO and LAMMPS. Types count from 1;
//! ids are those of the snapshot, from 0. A dump has only ellipsoids: all other shapes are drawn as the ellipsoids in their
//! boxes ([`drawn_otherwise`]).

use crate::cell::Shear;
use crate::output::header::Header;
use crate::output::tables::ParticleTable;
use crate::shape::Kind;
use std::io::{self, Write};

/// Axes along and across which LAMMPS can tilt a box: xy, xz, yz.
const TILTS: [(usize, usize); 3] = [(0, 1), (0, 2), (1, 2)];

/// Names of shapes that are not ellipsoids, but are drawn as such.
pub fn drawn_otherwise(header: &Header) -> Vec<&str> {
    let is_true = |kind: &str| [Kind::Sphere, Kind::Ellipsoid].iter().any(|k| k.name() == kind);
    header.shapes.iter().filter(|row| !is_true(&row.kind)).map(|row| &*row.name).collect()
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
    writeln!(out, "ITEM: ATOMS id type x y z quati quatj quatk quatw shapex shapey shapez vx vy vz")
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
    for (row, id) in particles.id.iter().enumerate() {
        let shape = &header.shapes[particles.shape[row].index()];
        let (x, v) = (&particles.position[row], &particles.velocity[row]);
        let [qw, qx, qy, qz] =
            particles.quaternion.get(row).copied().unwrap_or([1.0, 0.0, 0.0, 0.0]);
        let axes = shape.semi_axes * (2.0 * particles.scale_of(row));
        write!(out, "{} {}", id, particles.shape[row].0 + 1)?;
        for number in [x.x, x.y, x.z, qx, qy, qz, qw, axes.x, axes.y, axes.z, v.x, v.y, v.z] {
            write!(out, " {number:e}")?;
        }
        writeln!(out)?;
    }
    Ok(())
}
