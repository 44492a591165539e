//! All tests that use the library from outside, in one binary.

mod comm;
mod comm_cases;
mod contact_reference;
mod contract;
mod snapshot;
