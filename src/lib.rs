//! **dem-mpi**: a discrete element method for non-spherical grains on distributed memory.
//!
//! The modules, in the order in which they may import each other (a module uses only rows above
//! its own; `tests/project/layers.rs` checks it):
//!
//! | row | modules | what they are |
//! |---|---|---|
//! | 1 | [`ids`] [`math`] [`lanes`] [`timing`] [`files`] | identifiers, vectors, eight numbers at once, timing, files that others may have made |
//! | 2 | [`text`] [`random`] | text from files and to terminals; random numbers |
//! | 3 | [`arguments`] | what programs print about their arguments |
//! | 4 | [`cell`] [`shape`] [`comm`] | the box and its periods; shapes; communication |
//! | 5 | [`contact`] | from two shapes to overlap, normal and point |
//! | 6 | [`population`] | what particles are made of, and how they are mixed |
//! | 7 | [`walls`] | planes and surfaces of triangles, and how they move |
//! | 8 | [`particles`] [`pairs`] | columns of everything a rank owns or sees; pairs that stand by themselves |
//! | 9 | [`law`] [`motion`] | from overlap to force; from force to motion |
//! | 10 | [`search`] | which pairs may touch |
//! | 11 | [`contacts`] | those that do: what is remembered of them, what acts in them |
//! | 12 | [`measure`] | energies and other scalars of the whole system |
//! | 13 | [`domain`] [`drive`] | who owns what; what acts from outside |
//! | 14 | [`output`] | what is written |
//! | 15 | [`sim`] [`post`] | the step and the run; what is computed from a snapshot |
//! | 16 | [`scene`] | the user's file, checked, and turned into a simulation |
//! | 17 | [`sweep`] | many runs of one scene |
//! | 18 | [`guide`] | how to use it: pages to read |
//!
//! They stand in three libraries. `dem-law` (`src/law`) is [`law`], which takes longest to compile. `dem-grains` (`src/grains`) has the other rows up
//! to [`search`] but [`arguments`] and [`comm`], and needs neither MPI nor HDF5. This one has the rest, and the modules of both as its own.
//!
//! Conventions everywhere: SI units; compression and overlap are positive; a contact's normal is a
//! unit vector **from A to B**, where A is the body with the lower id (a facet of a wall is always B);
//! slots of bodies run owned | ghosts | facets.
//!
//! Same bits on any number of ranks, because
//! * both owners of a pair compute it from the same numbers, A first;
//! * a particle's force is the sum over its contacts in the order of space ([`particles::order`]), which is renewed at fixed numbers of
//!   steps, and saved;
//! * system-wide sums go through an exact accumulator ([`math::ExactSum`]);
//! * what is remembered of a touching contact is state that moves and is saved with its particles;
//!   what is remembered of a pair that does not touch never changes a result.

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

pub mod guide;
