//! All tests of the study in one binary.

#[path = "../../../tests/packings.rs"]
mod packings;
mod single_contact;
mod stages;
mod statements;
mod triaxial;
