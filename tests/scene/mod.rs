//! The user's file, read, checked and made a simulation.

mod many;
mod mutated;
mod read;
mod ready;
mod scenes;
mod scattered;
mod schema;
mod suggest;
