//! All tests in one binary, one module per folder of `src`.

mod scene;
