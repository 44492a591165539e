//! Particles at the start.

use super::{Fill, Lattice, Listed, Scene};
use crate::ids::GlobalId;
use crate::math::Vec3;
use crate::particles::records::Particle;
use crate::population::Library;
use crate::random::Random;

/// Particles of all fills, in the order of the file, with ids from 0 or those of a file. Each depends only on the
/// scene and its id, so that every rank can list them all and keep its own.
pub fn initial(scene: &Scene) -> impl Iterator<Item = Particle> {
    let mut next = 0;
    scene.initial.iter().flat_map(move |fill| {
        let first = next;
        next = fill.end(first);
        of_fill(fill, first, scene.seed, &scene.library)
    })
}

/// Particles of a fill, with ids from `first` on, or those of its file.
pub(super) fn of_fill<'a>(
    fill: &'a Fill,
    first: u64,
    seed: u64,
    library: &'a Library,
) -> impl Iterator<Item = Particle> + 'a {
    (0..fill.count()).map(move |k| match fill {
        Fill::Lattice(lattice) => on_lattice(lattice, k, first + k, (seed, library)),
        Fill::Listed(list) => listed(&list[k as usize], library),
    })
}

fn on_lattice(lattice: &Lattice, k: u64, id: u64, (seed, library): (u64, &Library)) -> Particle {
    let mut random = Random::of(seed, id);
    let shape = lattice.mix.pick(random.unit());
    let scale = library.sizes[shape.index()].draw(&mut random);
    let [nx, ny, _] = lattice.count.map(u64::from);
    let place = Vec3::new((k % nx) as f64, (k / nx % ny) as f64, (k / (nx * ny)) as f64);
    let position = lattice.first + lattice.spacing.component_mul(&place);
    let still = Particle::at_rest(GlobalId(id), shape, position);
    let quaternion = lattice.orientations.draw(&mut random);
    let mut particle = Particle { scale, quaternion, velocity: lattice.velocity, ..still };
    if lattice.jitter > 0.0 {
        particle.position += Vec3::from_fn(|_, _| lattice.jitter * (2.0 * random.unit() - 1.0));
    }
    particle
}

fn listed(row: &Listed, library: &Library) -> Particle {
    let still = Particle::at_rest(GlobalId(row.id), row.shape, row.position);
    let Listed { scale, velocity, quaternion, .. } = *row;
    Particle { scale, velocity, quaternion, ..still }.spinning(row.angular_velocity, library)
}
