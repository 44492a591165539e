//! Errors of a scene, each with its location, all at once.

use crate::text::{counted, listed, shown};
use std::cell::RefCell;
use std::fmt;
use std::sync::Arc;

/// Location of a value of the scene.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Location {
    /// The file as a whole.
    File,
    /// A line of the file, from 1.
    Line(usize),
    /// A line of an included file, or of the scene named by `like`.
    In(Arc<str>, usize),
    /// A `--set` of the command line, as written.
    Override(String),
}

/// One error.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Its location.
    pub location: Location,
    /// Key path, value, error and allowed values.
    pub message: String,
}

/// All errors of a scene, in the order of the file.
#[derive(Debug, thiserror::Error)]
pub struct SceneErrors {
    /// The file's name.
    pub file: String,
    /// The errors, at least one.
    pub problems: Vec<Problem>,
}

/// Number of errors that are listed; the others are counted.
const SHOWN: usize = 20;
/// Number of known names that are listed; the others are counted.
const NAMES: usize = 60;
/// Longest name of the program [characters].
const LONGEST_NAME: usize = 60;

impl fmt::Display for SceneErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = self.problems.len();
        write!(f, "{} in the scene", counted(count as u64, "error"))?;
        for Problem { location, message } in self.problems.iter().take(SHOWN) {
            match location {
                Location::File => write!(f, "\n{}: {message}", self.file)?,
                Location::Line(line) => write!(f, "\n{}:{line}: {message}", self.file)?,
                Location::In(file, line) => write!(f, "\n{file}:{line}: {message}")?,
                Location::Override(text) => write!(f, "\n--set {}: {message}", shown(text))?,
            }
        }
        match count.saturating_sub(SHOWN) {
            0 => Ok(()),
            more => write!(f, "\nand {more} more"),
        }
    }
}

/// Collects errors while a scene is read. Readers share it, so it can be written to through a shared reference.
#[derive(Debug, Default)]
pub(super) struct Mistakes {
    problems: RefCell<Vec<Problem>>,
    warnings: RefCell<Vec<String>>,
}

impl Mistakes {
    pub(super) fn add(&self, location: &Location, message: String) {
        self.problems.borrow_mut().push(Problem { location: location.clone(), message });
    }

    pub(super) fn warn(&self, what: String) {
        self.warnings.borrow_mut().push(what);
    }

    /// Warnings, each once.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut all = self.warnings.take();
        all.sort();
        all.dedup();
        all
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count() == 0
    }

    pub(super) fn count(&self) -> usize {
        self.problems.borrow().len()
    }

    /// All errors as an error value.
    pub(super) fn into_errors(self, file: &str) -> SceneErrors {
        let mut problems = self.problems.into_inner();
        problems.sort_by(|a, b| a.location.cmp(&b.location));
        problems.dedup();
        SceneErrors { file: file.to_owned(), problems }
    }
}

/// Features of other codes that are not supported: table ("" for any), beginning of words in keys and choices, and
/// alternative.
const NOT_THERE: [(&str, &str, &str); 29] = [
    ("", "bond", "bonds are not supported yet"),
    ("", "liquid", "liquid bridges are not supported yet"),
    ("", "capillar", "liquid bridges are not supported yet"),
    ("", "temperature", "heat and temperatures are not supported yet"),
    ("", "conductivity", "heat and temperatures are not supported yet"),
    ("", "heat", "heat and temperatures are not supported yet"),
    ("", "clump", CLUMPS),
    ("", "multisphere", CLUMPS),
    ("", "fix", HELD),
    ("", "frozen", HELD),
    ("", "freeze", HELD),
    ("", "immobile", HELD),
    ("", "obstacle", HELD),
    ("", "intruder", PUSHED),
    ("", "force", PUSHED),
    ("", "addforce", PUSHED),
    ("", "fluid", DRAG),
    ("", "cfd", DRAG),
    ("", "drag", DRAG),
    ("", "viscosity", DRAG),
    ("domain", "strain", CELL),
    ("domain", "stress", CELL),
    ("domain", "pressure", CELL),
    ("domain", "deform", CELL),
    ("interaction", "youngs", OF_ONE),
    ("interaction", "poisson", OF_ONE),
    ("stop", "stress", REACHED),
    ("stop", "pressure", REACHED),
    ("stop", "strain", REACHED),
];

const CLUMPS: &str = "use a [[shape]] with kind = \"union\" and its `pieces`, or a `file` of balls";
const HELD: &str =
    "to fix particles, use a [[group]] that names them, with `fixed`, a `velocity` or a `rotation`";
const PUSHED: &str = "to move particles, use a [[group]] that names them, with a `force` or a `velocity`; for a \
     [[wall]] with a `mesh` use a [[motion]] with `mass` and `force`";
const DRAG: &str = "for the drag of a fluid with prescribed velocity, use a [[group]] with `drag`; coupled fluids are \
     not supported";
/// Hint for a pressed or strained cell.
pub(super) const CELL: &str =
    "to strain a periodic cell, use [cell] with a `stress` or a `rate` of each component";
const OF_ONE: &str = "belongs to one material; set it in [[material]]";
const REACHED: &str = "to end a stage by a column of history.csv, use `when`: when = [{ column = \"stress_lid_Pa\", \
     above = 1e6 }]";

/// Hint after "no such key" or "no such choice" if an unsupported feature is requested. Empty if the suggestion has a
/// guess.
pub(super) fn not_there(table: &str, asked: &str, suggestion: &str) -> String {
    if suggestion.starts_with(GUESS) {
        return String::new();
    }
    let words: Vec<String> = asked.split(['_', '-']).map(str::to_lowercase).collect();
    let is_asked = |of: &str, begins: &str| {
        (of.is_empty() || table.split('.').next() == Some(of))
            && words.iter().any(|word| word.starts_with(begins))
    };
    let known = NOT_THERE.iter().find(|(of, begins, _)| is_asked(of, begins));
    known.map_or_else(String::new, |(.., what)| format!(": {what}"))
}

/// Beginning of a suggestion with a guess.
const GUESS: &str = ", did you mean ";

/// Text after "no such …": a guess, if a known name is close, and the known names.
pub(super) fn suggestion<'a>(
    written: &str,
    known: impl IntoIterator<Item = &'a str>,
    what_they_are: &str,
) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    let written = written.to_lowercase();
    let length = written.chars().count();
    let most = 1 + length / 4;
    // Longer than any name, so none is close.
    let may_be_near = length <= LONGEST_NAME;
    let distance = |name: &'a str| {
        let begins = length > 2 && name.to_lowercase().starts_with(&written);
        let near = may_be_near && (begins || name.chars().count().abs_diff(length) <= most);
        let distance = near.then(|| strsim::damerau_levenshtein(&written, &name.to_lowercase()))?;
        (distance <= most || begins).then_some((distance, name))
    };
    let nearest = known.iter().copied().filter_map(distance).min_by_key(|&(distance, _)| distance);
    let guess = nearest.map_or_else(String::new, |(_, name)| format!("{GUESS}`{}`?", shown(name)));
    let mut list = listed(known.iter().map(shown), NAMES);
    if known.is_empty() {
        "none".clone_into(&mut list);
    }
    format!("{guess} ({what_they_are}: {list})")
}
