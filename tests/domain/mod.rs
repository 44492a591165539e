//! Domains: identical bits on any number of ranks, and sheared cells.

mod ranks_threads;
mod shear;
