//! All tests that need no mpirun, in one binary: one module per subject.

mod comm;
mod comm_cases;
mod contact_reference;
mod contract;
mod laws;
mod layers;
mod made_up;
mod post;
mod ranks_threads;
mod scene;
mod snapshot;
mod superellipsoids;
mod support;
