//! What the project says of itself: guide, tables, layers.

mod guide;
mod layers;
mod tables;
