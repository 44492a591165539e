//! All tests of the study in one binary.

mod machine;
#[path = "../../../tests/packings.rs"]
mod packings;
#[path = "../../../tests/random.rs"]
mod random;
mod sensitivity;
mod single_contact;
mod stages;
mod statements;
mod triaxial;
