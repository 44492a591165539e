//! **dem-mpi**: a discrete element method for non-spherical grains on distributed memory.
//!
//! The modules, in the order in which they may import each other (a module uses only rows above
//! its own; `tests/project/layers.rs` checks it):
//!
//! | row | modules | what they are |
//! |---|---|---|
//! | 1 | [`ids`] [`math`] [`lanes`] [`timing`] [`files`] | identifiers, vectors, eight numbers at once, timing, files that others may have made |
//! | 2 | [`text`] [`random`] | text from files and to terminals; random numbers |
//! | 3 | [`arguments`] | texts of programs about their arguments |
//! | 4 | [`cell`] [`shape`] [`comm`] | the box and its periods; shapes; communication |
//! | 5 | [`contact`] | from two shapes to overlap, normal and point |
//! | 6 | [`population`] | materials and mixtures of particles |
//! | 7 | [`walls`] | planes and surfaces of triangles, and their motions |
//! | 8 | [`particles`] [`pairs`] | columns of all owned and visible particles; single pairs of bodies |
//! | 9 | [`law`] [`motion`] | from overlap to force; from force to motion |
//! | 10 | [`search`] | pairs that may touch |
//! | 11 | [`contacts`] | pairs that touch, with their state and forces |
//! | 12 | [`measure`] | energies and other scalars of the whole system |
//! | 13 | [`domain`] [`drive`] | ownership of particles; influences from outside |
//! | 14 | [`output`] | output files |
//! | 15 | [`sim`] [`post`] | the step and the run; analysis of snapshots |
//! | 16 | [`scene`] | the user's file, checked and turned into a simulation |
//! | 17 | [`sweep`] | many runs of one scene |
//!
//! Pages for users are a book in `src/guide`, which `run/book` makes.
//!
//! They are in three crates. `dem-law` (`src/law`) is [`law`], which takes longest to compile. `dem-grains` (`src/grains`)
//! has the other rows up to [`search`], except [`arguments`] and [`comm`], and needs neither MPI nor HDF5. This crate has
//! the rest, and re-exports the modules of both.
//!
//! Conventions everywhere: SI units; compression and overlap are positive; slots of bodies run owned | ghosts | facets. A
//! contact's normal is a unit vector **from A to B**, where A is the body with the lower id (a facet of a wall is always
//! B).
//!
//! The bits do not depend on the number of ranks, because
//! * both owners of a pair compute it from the same numbers, A first;
//! * a particle's force is the sum over its contacts in spatial order ([`particles::order`]), which is renewed at fixed
//!   numbers of steps, and saved;
//! * system-wide sums go through an exact accumulator ([`math::ExactSum`]);
//! * the state of a touching contact moves and is saved with its particles; data kept for a pair that does not touch never
//!   changes a result.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub use dem_grains::{
    cell, contact, files, ids, lanes, math, motion, pairs, particles, population, random, search,
    shape, text, timing, walls,
};
pub use dem_law as law;

pub mod arguments;

pub mod comm;

pub mod contacts;

pub mod measure;

pub mod domain;
pub mod drive;

pub mod output;

#[allow(clippy::disallowed_methods, reason = "no particle moves by what is computed here")]
pub mod post;
pub mod sim;

pub mod scene;

pub mod sweep;

// The programs in the guide are tested.
#[cfg(doctest)]
#[doc = include_str!("guide/extend.md")]
struct Extend;
