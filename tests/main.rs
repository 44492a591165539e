//! All tests in one binary, one module per subject.

mod post;
