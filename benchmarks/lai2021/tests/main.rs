//! All tests of the study in one binary.

mod machine;
#[path = "../../../tests/packings.rs"]
mod packings;
mod sensitivity;
mod single_contact;
mod stages;
mod statements;
mod triaxial;
