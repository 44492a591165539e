//! Contacts of bodies with faces: from what they share, not from one depth.
//!
//! A polyhedron on a face has no single contact point and no smooth depth: the deepest point jumps from corner to corner
//! when the face tilts, and a force that depends on one depth gives energy, or lets a block at rest creep. Here the
//! polyhedron that both bodies share is found exactly ([`crate::shape::clip`]), and the energy of the contact is that
//! of a spring which is compressed by its thickness ([`thickness`]).

mod thickness;

pub use thickness::{Thickness, thickness};
