//! Files that are written and read again.

mod files;
mod hostile;
mod snapshot;
