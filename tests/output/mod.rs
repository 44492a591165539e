//! Output files: writing and reading back.

mod files;
mod hostile;
mod snapshot;
