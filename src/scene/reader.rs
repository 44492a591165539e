//! Readers of values and tables, which check types and ranges.
//!
//! A reader never stops at a mistake. It reports the mistake ([`Mistakes`]) and returns `None`, so that one run
//! finds all mistakes of a file. A [`Section`] remembers which keys it was asked for; those are the
//! keys that exist, all others are refused by [`Section::finish`].

use super::input::{Node, Table, Value, name_of};
use super::mistakes::{Location, Mistakes, not_there, suggestion};
use crate::math::Vec3;
use crate::shape::{LENGTHS, Superellipsoid};
use crate::text::shown;
use std::cell::RefCell;
use std::fmt;

/// Which numbers are allowed.
#[derive(Clone, Copy, Debug)]
pub(super) enum Range {
    Any,
    Positive,
    NotNegative,
    /// In (0, 1].
    UpToOne,
    /// As of a superellipsoid, [`Superellipsoid::EXPONENTS`].
    Exponent,
    /// In (0, 1).
    BelowOne,
    /// From 1 up.
    FromOne,
}

impl Range {
    fn holds(self, x: f64) -> bool {
        x.is_finite()
            && match self {
                Self::Any => true,
                Self::Positive => x > 0.0,
                Self::NotNegative => x >= 0.0,
                Self::UpToOne => x > 0.0 && x <= 1.0,
                Self::Exponent => Superellipsoid::EXPONENTS.contains(&x),
                Self::BelowOne => x > 0.0 && x < 1.0,
                Self::FromOne => x >= 1.0,
            }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let exponents = Superellipsoid::EXPONENTS;
        f.write_str(match self {
            Self::Any => "a finite number",
            Self::Positive => "a number greater than 0",
            Self::NotNegative => "a number, 0 or greater",
            Self::UpToOne => "a number greater than 0 and at most 1",
            Self::Exponent => {
                return write!(
                    f,
                    "a number from {} to {}: 2 / n for powers of n, so 0.25 for 8 (a box, a cylinder, an octahedron or a cone \
                     is a `polyhedron`, with round edges a `rounded-polyhedron`)",
                    exponents.start(),
                    exponents.end()
                );
            }
            Self::BelowOne => "a number greater than 0 and less than 1",
            Self::FromOne => "a number, 1 or greater",
        })
    }
}

/// A value that the file gives.
#[derive(Clone, Debug)]
pub(super) struct Given<'a> {
    node: &'a Node,
    path: String,
    mistakes: &'a Mistakes,
}

impl<'a> Given<'a> {
    /// The whole input.
    pub(super) fn root(node: &'a Node, mistakes: &'a Mistakes) -> Self {
        Self { node, path: String::new(), mistakes }
    }

    /// Where it stands.
    pub(super) const fn location(&self) -> &'a Location {
        &self.node.location
    }

    /// Key path and value, then what is wrong.
    pub(super) fn fail(&self, what: impl fmt::Display) {
        let value = match &self.node.value {
            Value::Boolean(b) => format!(" = {b}"),
            Value::Integer(i) => format!(" = {i}"),
            Value::Number(x) => format!(" = {x:?}"),
            Value::Text(s) => format!(" = \"{}\"", shown(s)),
            Value::Date(s) => format!(" = {}", shown(s)),
            Value::List(list)
                if list.iter().any(|n| matches!(n.value, Value::Table(_) | Value::List(_))) =>
            {
                String::new()
            }
            Value::List(list) => {
                // No more of them are shown.
                let first = list.iter().take(100).map(|node| node.value.to_toml()).collect();
                format!(" = {}", shown(toml::Value::Array(first)))
            }
            Value::Table(_) => String::new(),
        };
        self.mistakes.add(&self.node.location, format!("{}{value}: {what}", self.path));
    }

    /// What was expected, for a value of another type.
    pub(super) fn expected<T>(&self, what: &dyn fmt::Display) -> Option<T> {
        self.fail(format!("must be {what}, not {}", self.node.value.type_name()));
        None
    }

    /// A finite number of this range; `unit` may be empty.
    pub(super) fn number(&self, range: Range, unit: &str) -> Option<f64> {
        let allowed = Allowed(&range, unit);
        let Some(x) = self.as_number() else { return self.expected(&allowed) };
        if !range.holds(x) {
            self.fail(format!("must be {allowed}"));
            return None;
        }
        let (size, least, most) = (x.abs(), *LENGTHS.start(), *LENGTHS.end());
        if unit == "m" && (size > most || size < least && matches!(range, Range::Positive)) {
            self.fail(format!("leaves the range of lengths, from {least:e} to {most:e} m"));
            return None;
        }
        Some(x)
    }

    /// A whole number from `least` up; `1e5` will do too.
    pub(super) fn whole(&self, least: u64) -> Option<u64> {
        // Up to here every whole number is an f64.
        let exact = 0.0..=(1_u64 << 53) as f64;
        let allowed = format!("a whole number, {least} or greater");
        let whole = match self.node.value {
            Value::Integer(i) => u64::try_from(i).ok(),
            Value::Number(x) => (x.fract() == 0.0 && exact.contains(&x)).then_some(x as u64),
            _ => return self.expected(&allowed),
        };
        let whole = whole.filter(|&n| n >= least);
        if whole.is_none() {
            let too_large = matches!(self.node.value, Value::Number(x) if x > *exact.end());
            self.fail(if too_large {
                "is too large".to_owned()
            } else {
                format!("must be {allowed}")
            });
        }
        whole
    }

    pub(super) fn boolean(&self) -> Option<bool> {
        match self.node.value {
            Value::Boolean(b) => Some(b),
            _ => self.expected(&"true or false"),
        }
    }

    /// Says what is doubtful of a value that may be as it is.
    pub(super) fn warn(&self, what: impl fmt::Display) {
        self.mistakes.warn(format!("{}: {what}", self.path));
    }

    /// The text, if it is one.
    pub(super) fn as_text(&self) -> Option<&'a str> {
        if let Value::Text(text) = &self.node.value { Some(text) } else { None }
    }

    /// The number, if it is one.
    pub(super) fn as_number(&self) -> Option<f64> {
        match self.node.value {
            Value::Integer(i) => Some(i as f64),
            Value::Number(x) => Some(x),
            _ => None,
        }
    }

    /// The three numbers, if it is a list of them.
    pub(super) fn as_vector(&self) -> Option<Vec3> {
        let Value::List(items) = &self.node.value else { return None };
        let numbers: Option<Vec<f64>> = self.items(items).iter().map(Self::as_number).collect();
        numbers.filter(|numbers| numbers.len() == 3).map(Vec3::from_vec)
    }

    pub(super) fn text(&self) -> Option<&'a str> {
        match &self.node.value {
            Value::Text(s) if !s.is_empty() => Some(s),
            Value::Text(_) => {
                self.fail("must not be empty");
                None
            }
            _ => self.expected(&"a string"),
        }
    }

    /// One of these words.
    pub(super) fn one_of<T: Copy>(&self, words: &[(&str, T)]) -> Option<T> {
        let text = self.text()?;
        let found = words.iter().find(|(word, _)| *word == text);
        if found.is_none() {
            let known = words.iter().map(|&(word, _)| word);
            let hint = suggestion(text, known, "allowed");
            self.fail(format!("no such choice{}{hint}", not_there("", text, &hint)));
        }
        found.map(|&(_, meaning)| meaning)
    }

    /// The items of a list.
    pub(super) fn list(&self, what: &str) -> Option<Vec<Self>> {
        match &self.node.value {
            Value::List(items) => Some(self.items(items)),
            _ => self.expected(&what),
        }
    }

    /// The same of so many items.
    pub(super) fn list_of<const N: usize>(&self, what: &str) -> Option<[Self; N]> {
        let items = self.list(what)?;
        let count = items.len();
        let exactly = items.try_into().ok();
        if exactly.is_none() {
            self.fail(format!("has {count} items; must be {what}"));
        }
        exactly
    }

    fn items(&self, items: &'a [Node]) -> Vec<Self> {
        let item = |(k, node)| Self {
            node,
            path: joined(&self.path, &name_of(node, k)),
            mistakes: self.mistakes,
        };
        items.iter().enumerate().map(item).collect()
    }

    /// Three items, each read in the same way.
    fn three<T>(&self, what: &str, read: impl Fn(&Self) -> Option<T>) -> Option<[T; 3]> {
        let what = format!("a list of three: [x, y, z], each {what}");
        let [x, y, z] = self.list_of(&what)?.map(|item| read(&item));
        Some([x?, y?, z?])
    }

    pub(super) fn vector(&self, range: Range, unit: &str) -> Option<Vec3> {
        let allowed = Allowed(&range, unit).to_string();
        self.three(&allowed, |item| item.number(range, unit)).map(Vec3::from)
    }

    /// A unit vector from one of any length.
    pub(super) fn direction(&self) -> Option<Vec3> {
        let vector = self.vector(Range::Any, "")?;
        if vector.amax() == 0.0 {
            self.fail("must have a length greater than 0");
            return None;
        }
        // Scaled first, because the squares of tiny components vanish.
        Some((vector / vector.amax()).normalize())
    }

    pub(super) fn three_booleans(&self) -> Option<[bool; 3]> {
        self.three("true or false", Self::boolean)
    }

    /// Three counts, none of them 0.
    pub(super) fn three_counts(&self) -> Option<[u32; 3]> {
        self.three("a whole number, 1 or greater", |item| {
            let count = u32::try_from(item.whole(1)?).ok();
            if count.is_none() {
                item.fail("is too large");
            }
            count
        })
    }

    /// One number for all axes, or one for each.
    pub(super) fn number_or_vector(&self, range: Range, unit: &str) -> Option<Vec3> {
        match self.node.value {
            Value::List(_) => self.vector(range, unit),
            _ => self.number(range, unit).map(Vec3::repeat),
        }
    }

    /// Points in space.
    pub(super) fn points(&self, unit: &str) -> Option<Vec<Vec3>> {
        let items = self.list(&format!("a list of points, each [x, y, z] [{unit}]"))?;
        let points: Vec<Option<Vec3>> =
            items.iter().map(|item| item.vector(Range::Any, unit)).collect();
        points.into_iter().collect()
    }

    /// Keys and values of a table, `None` if it is none.
    pub(super) fn entries(&self) -> Option<Vec<(&'a str, Self)>> {
        let Value::Table(table) = &self.node.value else { return None };
        let entry = |(key, node): (&'a String, &'a Node)| {
            let path = joined(&self.path, key);
            (key.as_str(), Self { node, path, mistakes: self.mistakes })
        };
        Some(table.iter().map(entry).collect())
    }

    pub(super) fn section(&self) -> Option<Section<'a>> {
        match &self.node.value {
            Value::Table(table) => {
                Some(Section { given: self.clone(), table, asked: RefCell::default() })
            }
            Value::List(items) => {
                let header = &self.path;
                if !items.iter().all(|item| matches!(item.value, Value::Table(_))) {
                    return self.expected(&"a table, { key = value, ... }");
                }
                self.mistakes.add(
                    self.location(),
                    format!("{header}: there can be only one; write [{header}], not [[{header}]]"),
                );
                None
            }
            _ => self.expected(&"a table"),
        }
    }

    /// The tables of `[[header]]`.
    pub(super) fn sections(&self) -> Vec<Section<'a>> {
        if let Value::List(items) = &self.node.value {
            return self.items(items).iter().filter_map(Self::section).collect();
        }
        let header = &self.path;
        let message = format!("{header}: there can be several; write [[{header}]], not [{header}]");
        self.mistakes.add(self.location(), message);
        Vec::new()
    }
}

/// A path and one key more, as TOML and `--set` have it.
fn joined(path: &str, key: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let dot = if path.is_empty() { "" } else { "." };
    if !key.is_empty() && key.len() < 100 && key.chars().all(bare) {
        format!("{path}{dot}{key}")
    } else {
        format!("{path}{dot}\"{}\"", shown(key))
    }
}

/// A range and a unit, as messages name them.
struct Allowed<'a>(&'a Range, &'a str);

impl fmt::Display for Allowed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.1 {
            "" => self.0.fmt(f),
            unit => write!(f, "{} [{unit}]", self.0),
        }
    }
}

/// A table that is being read.
#[derive(Debug)]
pub(super) struct Section<'a> {
    given: Given<'a>,
    table: &'a Table,
    asked: RefCell<Vec<&'static str>>,
}

impl<'a> Section<'a> {
    /// The value of a key, if there is one.
    pub(super) fn get(&self, key: &'static str) -> Option<Given<'a>> {
        if !self.asked.borrow().contains(&key) {
            self.asked.borrow_mut().push(key);
        }
        let path = joined(&self.given.path, key);
        self.table.get(key).map(|node| Given { node, path, mistakes: self.given.mistakes })
    }

    /// Says of a key that is given why it is of no use here; one that is not given stays unknown.
    pub(super) fn refuse(&self, key: &'static str, why: &str) {
        if self.table.get(key).is_some()
            && let Some(given) = self.get(key)
        {
            given.fail(why);
        }
    }

    /// The value of a key that must be there.
    pub(super) fn require<T>(
        &self,
        key: &'static str,
        what: &str,
        read: impl FnOnce(&Given<'a>) -> Option<T>,
    ) -> Option<T> {
        let given = self.get(key);
        if given.is_none() {
            self.fail(format!("`{key}` is missing: {what}"));
        }
        read(&given?)
    }

    /// The value of a key, or what it is if the key is not there; `None` if it is wrong.
    pub(super) fn read_or<T>(
        &self,
        key: &'static str,
        default: T,
        read: impl FnOnce(&Given<'a>) -> Option<T>,
    ) -> Option<T> {
        self.get(key).map_or(Some(default), |given| read(&given))
    }

    /// A number that must be there.
    pub(super) fn number(&self, key: &'static str, range: Range, unit: &str) -> Option<f64> {
        let what = Allowed(&range, unit).to_string();
        self.require(key, &what, |given| given.number(range, unit))
    }

    /// A number that may be there.
    pub(super) fn number_or(
        &self,
        key: &'static str,
        default: f64,
        range: Range,
        unit: &str,
    ) -> Option<f64> {
        self.read_or(key, default, |given| given.number(range, unit))
    }

    /// A vector that must be there.
    pub(super) fn vector(&self, key: &'static str, unit: &str) -> Option<Vec3> {
        self.require(key, &format!("[x, y, z] [{unit}]"), |given| given.vector(Range::Any, unit))
    }

    /// A vector that may be there.
    pub(super) fn vector_or(&self, key: &'static str, default: Vec3, unit: &str) -> Option<Vec3> {
        self.read_or(key, default, |given| given.vector(Range::Any, unit))
    }

    /// A table that must be there.
    pub(super) fn section(&self, key: &'static str, what: &str) -> Option<Section<'a>> {
        let given = self.get(key);
        if given.is_none() {
            self.fail(format!("[{key}] is missing: {what}"));
        }
        given?.section()
    }

    /// The tables of a `[[key]]` that must be there.
    pub(super) fn some_sections(&self, key: &'static str, what: &str) -> Vec<Section<'a>> {
        if self.get(key).is_none() {
            self.fail(format!("[[{key}]] is missing: {what}"));
        }
        self.sections(key)
    }

    /// The tables of `[[key]]`, none if there are none.
    pub(super) fn sections(&self, key: &'static str) -> Vec<Section<'a>> {
        self.get(key).map_or_else(Vec::new, |given| given.sections())
    }

    /// Says what is wrong with the table as a whole.
    pub(super) fn fail(&self, what: impl fmt::Display) {
        let path = &self.given.path;
        let colon = if path.is_empty() { "" } else { ": " };
        self.given.mistakes.add(self.given.location(), format!("{path}{colon}{what}"));
    }

    /// Refuses the keys that nobody asked for.
    pub(super) fn finish(&self) {
        let asked = self.asked.borrow();
        for (key, node) in self.table {
            if !asked.contains(&key.as_str()) {
                let path = joined(&self.given.path, key);
                let hint = suggestion(key, asked.iter().copied(), "allowed here");
                Given { node, path, mistakes: self.given.mistakes }
                    .fail(format!("no such key{}{hint}", not_there(&self.given.path, key, &hint)));
            }
        }
    }
}
