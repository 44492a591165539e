//! Scene files: reading, checks and assembly of a simulation.

mod exchanged;
mod foreign;
mod many;
mod mutated;
mod read;
mod ready;
mod scattered;
mod scenes;
mod schema;
mod suggest;
