//! tmp
#![allow(missing_docs, unused)]
use super::tables::*;
use crate::comm::Comm;
use crate::contact::NamedHistory;
use std::ops::Range;
use std::path::*;
#[derive(Debug, thiserror::Error)]
#[error("x")]
pub struct SnapshotError;
pub fn write(
    directory: &Path,
    header: &Header,
    particles: &ParticleTable,
    contacts: &ContactTable,
    histories: &[NamedHistory],
    comm: &mut dyn Comm,
) -> Result<PathBuf, SnapshotError> {
    Ok(PathBuf::new())
}
