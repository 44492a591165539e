//! Particles and their contacts: shapes, contact detection, search and motion.
//!
//! This library needs neither MPI nor HDF5. [`dem-mpi`] re-exports its modules and describes their order.
//!
//! [`dem-mpi`]: ../dem_mpi/index.html

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod files;
pub mod ids;
pub mod lanes;
pub mod math;
pub mod text;
pub mod timing;

pub mod random;

pub mod cell;
pub mod shape;

pub mod contact;

pub mod population;

pub mod walls;

pub mod pairs;
pub mod particles;

pub mod motion;

pub mod search;
