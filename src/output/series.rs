//! Lists of a run's files with their times, `particles.vtkhdf.series` and `contacts.vtkhdf.series`. With them ParaView, which
//! otherwise orders files by name, plays them in seconds (file series of version 1.0).

use crate::files;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{self, Write as _};
use std::path::Path;

/// Version of the format that ParaView expects.
const VERSION: &str = "1.0";

#[derive(Serialize, Deserialize)]
struct Series {
    #[serde(rename = "file-series-version")]
    version: String,
    files: Vec<Entry>,
}

#[derive(Serialize, Deserialize)]
struct Entry {
    name: String,
    time: f64,
}

/// Times of the files of a list [s], by name; empty if the list cannot be read.
pub fn times(list: &Path) -> BTreeMap<String, f64> {
    let text = files::read_to_string(list).unwrap_or_default();
    let files =
        serde_json::from_str(&text).map_or_else(|_| Vec::new(), |series: Series| series.files);
    files.into_iter().map(|Entry { name, time }| (name, time)).collect()
}

/// Writes a list `name` of files with their times [s]. A crash leaves the old list, or none.
///
/// # Errors
/// If the list cannot be written.
pub fn write(directory: &Path, name: &str, files: Vec<(String, f64)>) -> io::Result<()> {
    let files = files.into_iter().map(|(name, time)| Entry { name, time }).collect();
    let text = serde_json::to_string_pretty(&Series { version: VERSION.to_owned(), files })?;
    files::replace(&directory.join(name), |file| file.write_all(text.as_bytes())).map(drop)
}
