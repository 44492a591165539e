//! Reference: a hand-written program for equal elastic spheres without any other feature. It has the program's integrator and its
//! pair list, checks the validity of the list, and records no energies.

use super::{SIZE, STEP, STIFFNESS};
use dem_mpi::math::Vec3;

/// Equal elastic spheres.
pub(crate) struct Plain {
    position: Vec<Vec3>,
    velocity: Vec<Vec3>,
    force: Vec<Vec3>,
    listed_at: Vec<Vec3>,
    /// Pairs that may touch.
    pub(crate) pairs: Vec<[u32; 2]>,
    /// Half a step over the mass [s/kg].
    kick: f64,
    skin: f64,
}

impl Plain {
    /// Spheres at rest, with the forces at these positions [m].
    pub(crate) fn new(position: Vec<Vec3>, pairs: Vec<[u32; 2]>, mass: f64, skin: f64) -> Self {
        let zeros = vec![Vec3::zeros(); position.len()];
        let (velocity, force) = (zeros.clone(), zeros);
        let listed_at = position.clone();
        let kick = 0.5 * STEP / mass;
        let mut plain = Self { position, velocity, force, listed_at, pairs, kick, skin };
        plain.find_forces();
        plain
    }

    /// Does one step; returns whether the pair list is still valid.
    pub(crate) fn step(&mut self) -> bool {
        let mut farthest = 0.0;
        for k in 0..self.position.len() {
            self.velocity[k] += self.force[k] * self.kick;
            self.position[k] += self.velocity[k] * STEP;
            let moved = (self.position[k] - self.listed_at[k]).norm_squared();
            farthest = if moved > farthest { moved } else { farthest };
        }
        self.find_forces();
        for (velocity, force) in self.velocity.iter_mut().zip(&self.force) {
            *velocity += force * self.kick;
        }
        farthest <= 0.25 * self.skin * self.skin
    }

    fn find_forces(&mut self) {
        self.force.fill(Vec3::zeros());
        for &[a, b] in &self.pairs {
            let (a, b) = (a as usize, b as usize);
            let apart = self.position[b] - self.position[a];
            let squared = apart.norm_squared();
            if squared < 4.0 * SIZE * SIZE {
                let distance = squared.sqrt();
                let force = apart * (STIFFNESS * (2.0 * SIZE - distance) / distance);
                self.force[a] -= force;
                self.force[b] += force;
            }
        }
    }

    /// Number of pairs that touch.
    pub(crate) fn touching(&self) -> usize {
        let apart = |&[a, b]: &[u32; 2]| self.position[b as usize] - self.position[a as usize];
        self.pairs.iter().filter(|pair| apart(pair).norm() < 2.0 * SIZE).count()
    }

    /// Memory [bytes].
    pub(crate) fn bytes(&self) -> usize {
        let vectors = [&self.position, &self.velocity, &self.force, &self.listed_at];
        vectors.iter().map(|column| size_of_val(&column[..])).sum::<usize>()
            + size_of_val(&self.pairs[..])
    }
}
