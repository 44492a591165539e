//! All tests in one binary, one module per subject; those inside MPI are in `ranks`.

mod comm;
mod comm_cases;
mod contact_reference;
mod contract;
mod drives;
mod kinds;
mod laws;
mod layers;
mod made_up;
mod motion;
mod other_codes;
mod packings;
mod pairs;
mod post;
mod program;
mod random;
mod ranks_threads;
mod robustness;
mod scene;
mod servo;
mod snapshot;
mod solids;
mod superellipsoids;
mod support;
mod units;
mod verification;
