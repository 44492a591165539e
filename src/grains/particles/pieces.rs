//! Pieces of unions, with slots between those of bodies and of facets.
//!
//! Search, resolvers and laws treat pieces like bodies. A piece has the pose and the velocity that its body gives it, by one formula, so that
//! all ranks have the same bits. Its shape in the library has the mass of the body. Forces on pieces are added to their bodies in the order of
//! the pieces.

use super::Particles;
use crate::contact::Pair;
use crate::ids::{ShapeId, Slot};
use crate::math::{Quat, Vec3};
use crate::shape::Union;

/// Columns of pieces.
#[derive(Clone, Debug, Default)]
pub struct PieceColumns {
    /// Slot of the body of each piece.
    body: Vec<u32>,
}

impl Particles {
    /// Number of slots of bodies of particles, which those of pieces follow.
    pub const fn first_piece(&self) -> usize {
        self.owned + self.ghosts
    }

    /// Number of pieces.
    pub const fn pieces(&self) -> usize {
        self.pieces.body.len()
    }

    /// Slot of the body to which a piece belongs; the same slot for all others.
    #[inline]
    pub fn body_of(&self, slot: Slot) -> Slot {
        let piece = slot.index().checked_sub(self.first_piece());
        piece.and_then(|piece| self.pieces.body.get(piece)).map_or(slot, |&body| Slot(body))
    }

    /// The bodies of a pair of pieces.
    #[inline]
    pub fn bodies_of(&self, Pair { a, b }: Pair) -> Pair {
        Pair { a: self.body_of(a), b: self.body_of(b) }
    }

    /// Whether the slot is an owned particle, or a piece of one.
    #[inline]
    pub fn is_owned(&self, slot: Slot) -> bool {
        self.body_of(slot).index() < self.owned
    }

    /// Whether two pairs have the same bodies.
    #[inline]
    pub fn have_same_bodies(&self, one: Pair, other: Pair) -> bool {
        self.bodies_of(one) == self.bodies_of(other)
    }

    /// Appends the slots of pieces, after all owned particles and ghosts.
    pub(super) fn append_pieces(&mut self) {
        self.pieces.body.clear();
        if self.library.pieces.is_empty() {
            return;
        }
        for body in 0..self.first_piece() {
            let Some((union, first)) = self.library.union(self.shape[body]) else { continue };
            let count = union.pieces().len();
            let id = self.id[body];
            self.id.extend((0..count).map(|piece| id.piece(piece)));
            self.shape.extend((first..first + count).map(|shape| ShapeId(shape as u16)));
            self.standing.resize(self.id.len(), self.standing[body]);
            if self.needs.scale {
                self.scale.resize(self.id.len(), self.scale[body]);
            }
            self.pieces.body.resize(self.pieces.body.len() + count, body as u32);
        }
        self.lengthen();
        let (slots, needs) = (self.slots(), self.needs);
        if let Some(orientation) = &mut self.orientation {
            orientation.resize(slots, needs);
        }
    }

    /// Updates poses and velocities of pieces from their bodies.
    pub fn place_pieces(&mut self) {
        let first = self.first_piece();
        for piece in 0..self.pieces.body.len() {
            let (slot, body) = (first + piece, self.pieces.body[piece] as usize);
            let Some((union, number)) = self.library.piece(self.shape[slot]) else { continue };
            let (arm, turn) = self.place_in(union, number, body);
            self.position[slot] = self.position[body] + arm;
            self.velocity[slot] = self.velocity[body];
            if let Some(spin) = &mut self.spin {
                let turning = spin.angular_velocity[body];
                spin.angular_velocity[slot] = turning;
                self.velocity[slot] += turning.cross(&arm);
            }
            if self.needs.ahead {
                let [gain, turning] = self.ahead_of(body);
                self.ahead.velocity[slot] = gain + turning.cross(&arm);
                if let Some(of_piece) = self.ahead.angular_velocity.get_mut(slot) {
                    *of_piece = turning;
                }
            }
            if let Some(travel) = self.travel.get(body).copied() {
                self.travel[slot] = travel;
            }
            let scale = self.scale_of(slot);
            let Self { orientation, library, shape, .. } = self;
            if let Some(orientation) = orientation {
                orientation.set(slot, turn, &library.shapes[shape[slot].index()], scale);
            }
        }
    }

    /// Vector from the centre of a body to that of one of its pieces [m], and the rotation of the piece.
    fn place_in(&self, union: &Union, number: usize, body: usize) -> (Vec3, Quat) {
        let piece = &union.pieces()[number];
        let turn =
            self.orientation.as_ref().map_or_else(Quat::identity, |all| all.quaternion[body]);
        (turn * (piece.centre * self.scale_of(body)), turn * piece.rotation)
    }

    /// Pieces of owned particles: slot of the piece, slot of the particle, and vector from the particle's centre to the piece's [m].
    pub fn owned_pieces(&self) -> impl Iterator<Item = (usize, usize, Vec3)> + '_ {
        let of = self.pieces.body.iter().zip(self.first_piece()..);
        of.filter(|&(&body, _)| (body as usize) < self.owned).map(|(&body, slot)| {
            (slot, body as usize, self.position[slot] - self.position[body as usize])
        })
    }
}
