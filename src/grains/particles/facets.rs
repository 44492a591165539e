//! Facets of walls, with slots after those of particles.

use super::Particles;
use crate::contact::FacetInPlace;
use crate::ids::{GlobalId, Slot};
use crate::math::{Mat3, Vec3};
use crate::walls::{self, Corners, Wall};

impl Particles {
    /// Velocity of a body's surface relative to the body in a contact with this normal, as of a conveyor belt [m/s].
    ///
    /// It is zero for all other bodies.
    #[inline]
    pub fn belt_at(&self, slot: Slot, normal: &Vec3) -> Vec3 {
        let facet = slot.index().checked_sub(self.first_facet());
        let belt = facet.and_then(|facet| self.facets.belts.get(facet));
        belt.map_or_else(Vec3::zeros, |belt| belt - normal * normal.dot(belt))
    }

    /// Slot of the first facet of a wall.
    pub const fn first_facet(&self) -> usize {
        self.first_piece() + self.pieces()
    }

    /// Index of the wall to which a facet in this slot belongs; `None` for a particle.
    #[inline]
    pub fn wall_of(&self, slot: Slot) -> Option<usize> {
        let facet = slot.index().checked_sub(self.first_facet())?;
        self.facets.wall.get(facet).map(|&wall| wall as usize)
    }

    /// Appends the slots of pieces and of the facets of walls after owned particles and ghosts.
    pub fn append_pieces_and_walls(&mut self) {
        self.append_pieces();
        self.id.extend(walls::ids(&self.walls));
        for (k, wall) in self.walls.iter().enumerate() {
            for facet in &wall.facets {
                self.shape.push(facet.shape);
                self.facets.wall.push(k as u32);
            }
        }
        for &id in &self.near_facets {
            let Some((wall, _)) = id.wall_and_facet() else { continue };
            let Some(mesh) = &self.walls[wall].mesh else { continue };
            self.id.push(id);
            self.shape.push(mesh.shape);
            self.facets.wall.push(wall as u32);
        }
        self.lengthen();
        let ids = &self.id[self.first_facet()..];
        let in_place = |id: &GlobalId| {
            let number = id.wall_and_facet().map_or(0, |(_, facet)| facet as u32);
            FacetInPlace { frame: Mat3::identity(), number }
        };
        self.facets.place = ids.iter().map(in_place).collect();
        self.place_walls();
    }

    /// Moves the walls to their poses after `step` steps, of which the last took `dt` [s].
    pub fn move_walls(&mut self, step: u64, dt: f64) {
        // Walls at rest, now and when they were placed, need no update.
        if !self.facets.any_moves && !self.walls.iter().any(Wall::is_moving) {
            return;
        }
        let room = self.room_of_turning();
        let nearer: Vec<f64> =
            self.walls.iter_mut().map(|wall| wall.advance(step, dt, &room)).collect();
        let first = self.first_facet();
        for (travel, &wall) in self.travel[first..].iter_mut().zip(&self.facets.wall) {
            *travel += nearer[wall as usize];
        }
        self.place_walls();
    }

    /// Copies poses and velocities of walls to the slots of their facets.
    ///
    /// # Panics
    /// If a wall rotates and there is no column for that, see [`Needs::spin`].
    fn place_walls(&mut self) {
        self.facets.any_moves = self.walls.iter().any(Wall::is_moving);
        self.facets.any_turns = false;
        self.facets.any_torque = false;
        self.facets.any_parallel = walls::any_parallel(&self.walls);
        for wall in &self.walls {
            let turns = wall.angular_velocity != Vec3::zeros();
            assert!(
                !turns || self.spin.is_some(),
                "wall \"{}\" turns in a simulation without angular velocities",
                wall.name
            );
            self.facets.any_turns |= turns;
            self.facets.any_torque |= turns || wall.torque.is_some();
        }
        let frames: Vec<Mat3> = self.walls.iter().map(Wall::frame).collect();
        let first = self.first_facet();
        self.facets.belts.clear();
        if self.walls.iter().any(Wall::is_belt) {
            let belt =
                |&wall: &u32| frames[wall as usize] * self.walls[wall as usize].surface_velocity;
            self.facets.belts.extend(self.facets.wall.iter().map(belt));
        }
        for (facet, &wall) in self.facets.wall.iter().enumerate() {
            let (slot, index) = (first + facet, wall as usize);
            let wall = &self.walls[index];
            self.position[slot] = wall.point;
            self.velocity[slot] = wall.velocity;
            if let Some(spin) = &mut self.spin {
                spin.angular_velocity[slot] = wall.angular_velocity;
            }
            self.facets.place[facet].frame = frames[index];
        }
    }

    /// Box that contains the centres of all particles of all ranks, if a wall rotates [m]; otherwise unused.
    pub fn room_of_turning(&self) -> Corners {
        if !self.walls.iter().any(Wall::turns) {
            return Corners::default();
        }
        // A particle is removed once its centre is outside by its own size.
        let slack = Vec3::repeat(self.library.largest_radius());
        let (low, high) = walls::room(&self.walls, &self.cell);
        (low - slack, high + slack)
    }
}
