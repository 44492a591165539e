//! Shapes, their sizes and packings of them.

mod cut;
mod kinds;
mod sizes;
mod solids;
mod superellipsoids;
pub(crate) mod unions;
