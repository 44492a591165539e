//! Shapes, their sizes and packings of them.

mod cut;
mod kinds;
mod rockable;
mod sizes;
mod solids;
mod superellipsoids;
pub(crate) mod unions;
