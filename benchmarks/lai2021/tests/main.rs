//! All tests of the study in one binary.

mod machine;
#[path = "../../../tests/support/packings.rs"]
mod packings;
#[path = "../../../tests/support/random.rs"]
mod random;
mod sensitivity;
mod single_contact;
mod stages;
mod statements;
mod triaxial;
