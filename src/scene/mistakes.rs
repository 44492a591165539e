//! What is wrong with a scene: every mistake with its place, all in one go.

use std::cell::RefCell;
use std::fmt;

/// Where a value of the scene was given.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Location {
    /// Nowhere: it is the file as a whole.
    File,
    /// A line of the file, from 1.
    Line(usize),
    /// `--set` of the command line, as it was written.
    Override(String),
}

/// One mistake.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Where it is.
    pub location: Location,
    /// Key path, value, what is wrong and what is allowed.
    pub message: String,
}

/// All mistakes of a scene, in the order of the file.
#[derive(Debug, thiserror::Error)]
pub struct SceneErrors {
    /// The file's name.
    pub file: String,
    /// The mistakes, at least one.
    pub problems: Vec<Problem>,
}

impl fmt::Display for SceneErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.problems.len();
        write!(f, "{count} mistake{} in the scene", if count == 1 { "" } else { "s" })?;
        for Problem { location, message } in &self.problems {
            match location {
                Location::File => write!(f, "\n{}: {message}", self.file)?,
                Location::Line(line) => write!(f, "\n{}:{line}: {message}", self.file)?,
                Location::Override(text) => write!(f, "\n--set {text}: {message}")?,
            }
        }
        Ok(())
    }
}

/// Collects mistakes while a scene is read. Readers share it, so it can be written to through a
/// shared reference.
#[derive(Debug, Default)]
pub(super) struct Mistakes {
    problems: RefCell<Vec<Problem>>,
}

impl Mistakes {
    pub(super) fn add(&self, location: &Location, message: String) {
        self.problems.borrow_mut().push(Problem { location: location.clone(), message });
    }

    pub(super) fn is_empty(&self) -> bool {
        self.problems.borrow().is_empty()
    }

    /// All mistakes as an error.
    pub(super) fn into_errors(self, file: &str) -> SceneErrors {
        let mut problems = self.problems.into_inner();
        problems.sort_by(|a, b| a.location.cmp(&b.location));
        problems.dedup();
        SceneErrors { file: file.to_owned(), problems }
    }
}

/// What other codes have and this one has not yet, by parts of the names of keys.
const NOT_YET: [(&str, &str); 6] = [
    ("bond", "bonds"),
    ("liquid", "liquid bridges"),
    ("capillar", "liquid bridges"),
    ("temperature", "heat and temperatures"),
    ("conductivity", "heat and temperatures"),
    ("clump", "clumps"),
];

/// What stands behind "no such key" if the key asks for something that is not there yet.
pub(super) fn not_yet(key: &str) -> String {
    let known = NOT_YET.iter().find(|(part, _)| key.to_lowercase().contains(part));
    known.map_or_else(String::new, |(_, what)| format!(": {what} are not supported yet"))
}

/// What stands behind "no such …": a guess, if a known name is close to what was written, and the
/// known names.
pub(super) fn suggestion<'a>(
    written: &str,
    known: impl IntoIterator<Item = &'a str>,
    what_they_are: &str,
) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    let distance =
        |name: &str| strsim::damerau_levenshtein(&written.to_lowercase(), &name.to_lowercase());
    let is_close = |name: &str| {
        distance(name) <= 1 + written.chars().count() / 4
            || (written.len() > 2 && name.starts_with(written))
    };
    let nearest = known.iter().filter(|name| is_close(name)).min_by_key(|name| distance(name));
    let guess = nearest.map_or_else(String::new, |name| format!(", did you mean `{name}`?"));
    let list = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
    format!("{guess} ({what_they_are}: {list})")
}
