//! Checks of the project itself: guide, tables, layers.

mod guide;
mod layers;
mod tables;
