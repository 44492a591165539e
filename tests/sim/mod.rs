//! Time step and run: motion, energies, stages, published cases.

mod audit;
mod books;
mod motion;
mod stages;
pub(crate) mod symmetries;
mod time_steps;
mod unions;
mod units;
pub(crate) mod verification;
