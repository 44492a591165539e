//! What acts on the particles from outside.

pub mod rain;
pub mod servo;
