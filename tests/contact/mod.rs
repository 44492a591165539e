//! Contact resolution: overlap, normal and point of two shapes.

mod cells;
mod contract;
mod curvature;
pub(crate) mod overlap;
mod pairs;
mod reference;
mod robustness;
pub(crate) mod sides;
mod unions;
