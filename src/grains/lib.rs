//! Grains, their contacts, and what acts in them: the numbers of a step, which nothing of MPI, HDF5 and scenes can change.
//!
//! A library of its own: what is above it is built in a minute, and its tests need nothing installed. [`dem-mpi`] has its modules as its own,
//! and says in which order they stand.
//!
//! [`dem-mpi`]: ../dem_mpi/index.html

pub mod files;
pub mod ids;
pub mod lanes;
pub mod math;
pub mod text;
pub mod timing;

pub mod cell;
pub mod random;
pub mod shape;

pub mod contact;

pub mod pairs;
pub mod particles;

pub mod motion;

pub mod search;
