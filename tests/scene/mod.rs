//! The user's file, read, checked and made a simulation.

mod foreign;
mod many;
mod mutated;
mod read;
mod ready;
mod scattered;
mod scenes;
mod schema;
mod suggest;
