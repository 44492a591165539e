//! Scene files: reading, checks and assembly of a simulation.

mod foreign;
mod many;
mod mutated;
mod read;
mod ready;
mod scattered;
mod scenes;
mod schema;
mod suggest;
