//! Bodies for tests.

use super::records::Particle;
use super::{Needs, Particles};
use crate::cell::Cell;
use crate::ids::{GlobalId, MaterialId, ShapeId};
use crate::math::Vec3;
use crate::population::Library;
use crate::random::Random;
use crate::shape::{Ellipsoid, Shape, Sphere};

/// Ellipsoids and spheres of two materials in any state, no two of them alike, of many sizes if `sized`, for tests.
pub fn crowd(count: u64, sized: bool) -> Particles {
    let mut library = Library { particle_shapes: 2, ..Library::default() };
    let egg = Ellipsoid { semi_axes: Vec3::new(2e-3, 1.5e-3, 1e-3) };
    library.push("egg", Shape::Ellipsoid(egg), MaterialId(0), 2500.0);
    library.push("sphere", Shape::Sphere(Sphere { radius: 1e-3 }), MaterialId(1), 1000.0);
    if sized {
        library.scales.fill([0.6, 1.6]);
    }
    let needs = Needs {
        velocity: true,
        spin: true,
        orientation: true,
        form: true,
        scale: sized,
        ahead: true,
        ..Needs::default()
    };
    let cell = Cell::new(Vec3::zeros(), Vec3::repeat(0.1), [false, false, true]);
    let mut particles = Particles::new(needs, library, Vec::new(), cell);
    for id in 0..count {
        let mut random = Random::of(3, id);
        let mut vector = |size: f64| Vec3::from_fn(|_, _| size * random.signed());
        let position = vector(0.05) + Vec3::repeat(0.05);
        let (velocity, momentum) = (vector(1.0), vector(1e-9));
        let (force, torque) = (vector(1e-2), vector(1e-5));
        let ahead = [vector(1e-2), vector(10.0)];
        particles.push_owned(&Particle {
            velocity,
            force,
            torque,
            ahead,
            angular_momentum: momentum,
            quaternion: random.rotation(),
            scale: if sized { 0.6 + random.unit() } else { 1.0 },
            ..Particle::at_rest(GlobalId(id), ShapeId(u16::from(id % 3 == 0)), position)
        });
    }
    particles.complete_order();
    particles.travel.resize(particles.slots(), 0.0);
    particles
}
