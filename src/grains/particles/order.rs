//! The order of space of bodies, pairs and contacts, in which forces are summed. Neighbours in memory touch.
//!
//! The order of sums determines bits, so it may depend on positions only at moments that all runs of a scene share. The [`Standing`] of a
//! particle is its place in the order. It is renewed at fixed numbers of steps, saved, and migrates with the particle. The listing of pairs,
//! the ranks and restarts therefore have no influence.
//!
//! Particles are ordered in pencils as wide as one of them, in planes across the longest side of the domain, which are as small as possible.
//! Partners are then in few rows, and memory delivers each row from end to end. Along Hilbert's curve partners are nearer to each other, but
//! not in rows: a step of a million spheres takes longer (`benchmarks/records/2026-11-peers`).

use super::Particles;
use crate::ids::{GlobalId, Slot, Standing};
use crate::math::Vec3;
use std::f64::consts::PI;

/// Division of space into pencils.
struct Pencils {
    low: Vec3,
    /// Axes across the planes, across the pencils of a plane, and along a pencil.
    axes: [usize; 3],
    /// Cells per length in these directions [1/m].
    per_length: [f64; 3],
}

impl Pencils {
    /// Bits of a cell's number in these directions.
    const BITS: [u32; 3] = [20, 20, 23];

    fn of(particles: &Particles) -> Self {
        let Particles { cell, library, .. } = particles;
        let ((low, _), sides) = (cell.corners(), cell.sides());
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| sides[b].total_cmp(&sides[a]));
        let [longest, middle, shortest] = axes;
        let volume =
            |shape: usize| library.shapes[shape].volume() * library.sizes[shape].mean_volume();
        let least = (0..library.particle_shapes).map(volume).fold(f64::INFINITY, f64::min);
        let per_width = 1.0 / libm::cbrt(least * 6.0 / PI);
        let along = f64::from(1 << Self::BITS[2]) / sides[middle];
        Self { low, axes: [longest, shortest, middle], per_length: [per_width, per_width, along] }
    }

    /// Standing of a place. Cells beyond the domain and beyond the last number count as the last one.
    fn standing(&self, place: &Vec3) -> Standing {
        let mut number = 0;
        for (k, (&axis, &bits)) in self.axes.iter().zip(&Self::BITS).enumerate() {
            let cell = ((place[axis] - self.low[axis]) * self.per_length[k]) as u64;
            number = number << bits | cell.min((1 << bits) - 1);
        }
        Standing(number)
    }
}

impl Particles {
    /// Removes the standings of owned particles.
    pub fn forget_order(&mut self) {
        self.standing[..self.owned].fill(Standing::LAST);
    }

    /// Sets the standings of owned particles that have none, by their places.
    pub fn complete_order(&mut self) {
        if !self.standing[..self.owned].contains(&Standing::LAST) {
            return;
        }
        let pencils = Pencils::of(self);
        for (standing, place) in self.standing.iter_mut().zip(&self.position).take(self.owned) {
            if *standing == Standing::LAST {
                *standing = pencils.standing(place);
            }
        }
    }

    /// Sorts the slots of owned particles, if many are out of order. Ghosts and walls must have been removed.
    pub fn sort_owned(&mut self) {
        let stands = |slot: usize| self.stands(Slot(slot as u32));
        let falls = (1..self.owned).filter(|&slot| stands(slot) < stands(slot - 1)).count();
        if falls <= self.owned / 64 {
            return;
        }
        let mut slots: Vec<u32> = (0..self.owned as u32).collect();
        slots.sort_unstable_by_key(|&slot| stands(slot as usize));
        self.each_column(|column| column.sort(&slots));
    }

    /// Sort key of a body: standing, then id.
    fn stands(&self, slot: Slot) -> (Standing, GlobalId) {
        (self.standing[slot.index()], self.id[slot.index()])
    }

    /// Place of each slot in the order; facets of walls come last.
    pub fn places(&self) -> Vec<u32> {
        let mut slots: Vec<u32> = (0..self.slots() as u32).collect();
        slots.sort_unstable_by_key(|&slot| self.stands(Slot(slot)));
        let mut places = vec![0; slots.len()];
        for (&slot, place) in slots.iter().zip(0..) {
            places[slot as usize] = place;
        }
        places
    }
}

#[cfg(test)]
mod tests {
    use crate::particles::crowd::crowd;

    /// Each particle keeps all its data, and slots then rise with the order.
    #[test]
    fn sorting_moves_whole_particles() {
        for sized in [false, true] {
            let mut particles = crowd(300, sized);
            particles.strip_to_owned();
            let all = |particles: &super::Particles| {
                let mut all: Vec<_> =
                    (0..particles.owned).map(|slot| particles.owned_particle(slot)).collect();
                all.sort_by_key(|particle| particle.id);
                all
            };
            let before = all(&particles);
            assert!(!particles.standing.is_sorted());
            particles.sort_owned();
            assert!(particles.standing.is_sorted());
            assert!(!particles.id.is_sorted());
            assert_eq!(all(&particles), before);
        }
    }
}
