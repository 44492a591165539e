//! Particles and pieces of unions as bodies, each with the parameters of its shape.

use super::materials::Materials;
use crate::math::{Quat, Vec3};
use crate::output::header::Header;
use crate::output::tables::ParticleTable;
use crate::shape::Shape;
use nalgebra::Quaternion;
use std::borrow::Cow;

/// A particle, or a piece of a union.
pub(super) struct Body<'a> {
    pub(super) id: u64,
    pub(super) clump: Option<u64>,
    /// Index of the shape of the particle.
    pub(super) shape: u16,
    pub(super) material: usize,
    pub(super) geometry: &'a Shape,
    pub(super) scale: f64,
    pub(super) position: Vec3,
    pub(super) turn: Quat,
    pub(super) velocity: Vec3,
    pub(super) spin: Vec3,
    pub(super) mass: f64,
    pub(super) inertia: Vec3,
}

impl Body<'_> {
    pub(super) fn volume(&self) -> f64 {
        self.geometry.volume() * self.scale.powi(3)
    }

    pub(super) fn radius(&self) -> f64 {
        self.geometry.equal_radius() * self.scale
    }

    pub(super) fn clump_id(&self) -> i64 {
        self.clump.map_or(-1, |id| id as i64)
    }
}

/// Numbers of the shape of a body: name, unit, numbers in a row. Only vertices may have several rows.
pub(super) type Parameter = (&'static str, &'static str, usize, Vec<f64>);

/// Group of a kind in the file, and the parameters of a shape of this kind, enlarged by a factor.
pub(super) fn parameters(shape: &Shape, scale: f64) -> (&'static str, Vec<Parameter>) {
    let length = |name, of: f64| (name, "m", 1, vec![of * scale]);
    let lengths = |name, of: Vec3| (name, "m", 3, (of * scale).as_slice().to_vec());
    let exponents = |of: [f64; 2]| ("exponents", "1", 2, of.to_vec());
    let vertices = |of: &[Vec3]| {
        let all: Vec<Vec3> = of.iter().map(|vertex| vertex * scale).collect();
        ("vertices", "m", 3, bytemuck::cast_slice(&all).to_vec())
    };
    match shape {
        Shape::Sphere(ball) => ("Sphere", vec![length("radius", ball.radius)]),
        Shape::Ellipsoid(body) => ("Ellipsoid", vec![lengths("semi_axes", body.semi_axes)]),
        Shape::Superellipsoid(body) => (
            "Superellipsoid",
            vec![lengths("semi_axes", body.semi_axes()), exponents(body.exponents())],
        ),
        Shape::PolySuperellipsoid(body) => {
            let [positive, negative] = body.semi_axes();
            let columns = [
                lengths("semi_axes_positive", positive),
                lengths("semi_axes_negative", negative),
                exponents(body.exponents()),
                lengths("centre", body.centre()),
                ("axes", "1", 9, body.axes().transpose().as_slice().to_vec()),
            ];
            ("PolySuperellipsoid", columns.into())
        }
        Shape::Spherocylinder(body) => {
            ("Spherocylinder", vec![length("length", body.length), length("radius", body.radius)])
        }
        Shape::Polyhedron(body) => ("Polyhedron", vec![vertices(body.hull().vertices())]),
        Shape::RoundedPolyhedron(body) => (
            "RoundedPolyhedron",
            vec![vertices(body.core().vertices()), length("radius", body.radius())],
        ),
        Shape::Union(_) => ("Clump", Vec::new()),
        Shape::Other(_) | Shape::HalfSpace(_) | Shape::TriangleMesh(_) => ("Other", Vec::new()),
    }
}

/// Particles by id, then the pieces of unions.
pub(super) fn bodies<'a>(
    header: &Header,
    particles: &ParticleTable,
    shapes: &'a [Cow<'a, Shape>],
    materials: &Materials,
) -> Vec<Body<'a>> {
    let mut all = Vec::with_capacity(particles.id.len());
    for (row, id) in particles.id.iter().enumerate() {
        let shape = particles.shape[row].index();
        let (of, geometry, scale) =
            (&header.shapes[shape], &*shapes[shape], particles.scale_of(row));
        let [w, x, y, z] = particles.quaternion.get(row).copied().unwrap_or([1.0, 0.0, 0.0, 0.0]);
        all.push(Body {
            id: id.0,
            clump: matches!(geometry, Shape::Union(_)).then_some(id.0),
            shape: particles.shape[row].0,
            material: materials.of_shapes[shape],
            geometry,
            scale,
            position: particles.position[row],
            turn: Quat::new_unchecked(Quaternion::new(w, x, y, z)),
            velocity: particles.velocity[row],
            spin: particles.angular_velocity.get(row).copied().unwrap_or_default(),
            mass: of.mass * scale.powi(3),
            inertia: of.inertia * scale.powi(5),
        });
    }
    let mut next = header.next_id.max(all.last().map_or(0, |body| body.id + 1));
    for k in 0..all.len() {
        let Shape::Union(union) = all[k].geometry else { continue };
        for piece in union.pieces() {
            let (whole, shape) = (&all[k], &piece.shape);
            let arm = whole.turn * (piece.centre * whole.scale);
            let mass = whole.mass / whole.volume() * shape.volume() * whole.scale.powi(3);
            let piece = Body {
                id: next,
                geometry: shape,
                position: whole.position + arm,
                turn: whole.turn * piece.rotation,
                velocity: whole.velocity + whole.spin.cross(&arm),
                mass,
                inertia: shape.gyration() * (mass * whole.scale * whole.scale),
                ..*whole
            };
            all.push(piece);
            next += 1;
        }
    }
    all
}
