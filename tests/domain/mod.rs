//! The same bits on any number of ranks, and cells that are sheared.

mod ranks_threads;
mod shear;
