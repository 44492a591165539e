//! Readers of values and tables. The table of keys ([`SCENE`]) gives the allowed values. [`form`](super::form) checks them
//! before any reader, and reports each error ([`Mistakes`]).
//!
//! A reader returns `None` for a value that is not allowed and continues, so that one run finds all errors of a file.

use super::input::{Node, Table, Value, name_of};
use super::keys::SCENE;
use super::kind::{Allowed, Key, Keys, Kind};
use super::mistakes::{Location, Mistakes};
use crate::math::Vec3;
use crate::shape::LENGTHS;
use crate::text::shown;
use std::fmt;

/// A value of the file, with its allowed values.
#[derive(Clone, Debug)]
pub(super) struct Given<'a> {
    pub(super) node: &'a Node,
    pub(super) path: String,
    pub(super) kind: &'static Kind,
    /// Unit of its numbers, or empty.
    pub(super) unit: &'static str,
    mistakes: &'a Mistakes,
}

impl<'a> Given<'a> {
    /// The whole input.
    pub(super) fn root(node: &'a Node, mistakes: &'a Mistakes) -> Self {
        Self { node, path: String::new(), kind: &SCENE, unit: "", mistakes }
    }

    /// Location in the file.
    pub(super) const fn location(&self) -> &'a Location {
        &self.node.location
    }

    /// Reports an error with key path and value.
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
                // Longer lists are cut.
                let first = list.iter().take(100).map(|node| node.value.to_toml()).collect();
                format!(" = {}", shown(toml::Value::Array(first)))
            }
            Value::Table(_) => String::new(),
        };
        self.mistakes.add(&self.node.location, format!("{}{value}: {what}", self.path));
    }

    /// Reports an error without the value.
    pub(super) fn fail_whole(&self, what: impl fmt::Display) {
        let colon = if self.path.is_empty() { "" } else { ": " };
        self.mistakes.add(self.location(), format!("{}{colon}{what}", self.path));
    }

    /// Adds a warning about an allowed value.
    pub(super) fn warn(&self, what: impl fmt::Display) {
        self.mistakes.warn(format!("{}: {what}", self.path));
    }

    /// The number, if it is one, in range or not.
    pub(super) fn as_number(&self) -> Option<f64> {
        match self.node.value {
            Value::Integer(i) => Some(i as f64),
            Value::Number(x) => Some(x),
            _ => None,
        }
    }

    /// Is a length outside the range in which its cube is finite and, if it must be positive, not 0?
    pub(super) fn leaves_lengths(&self, x: f64, is_positive: bool) -> bool {
        let (size, least, most) = (x.abs(), *LENGTHS.start(), *LENGTHS.end());
        self.unit == "m" && (size > most || size < least && is_positive)
    }

    /// A number in the range of the table.
    pub(super) fn number(&self) -> Option<f64> {
        let x = self.as_number()?;
        let range =
            self.as_one(|kind| if let Kind::Number(range) = kind { Some(range) } else { None })?;
        let is_positive = range.above && range.least == 0.0;
        (range.holds(x) && !self.leaves_lengths(x, is_positive)).then_some(x)
    }

    /// A whole number; `1e5` is allowed.
    pub(super) fn whole(&self) -> Option<u64> {
        let whole = match self.node.value {
            Value::Integer(i) => u64::try_from(i).ok(),
            Value::Number(x) => (x.fract() == 0.0 && EXACT.contains(&x)).then_some(x as u64),
            _ => None,
        };
        let least =
            self.as_one(|kind| if let Kind::Whole(least) = kind { Some(*least) } else { None })?;
        whole.filter(|&n| n >= least)
    }

    pub(super) const fn boolean(&self) -> Option<bool> {
        if let Value::Boolean(b) = self.node.value { Some(b) } else { None }
    }

    /// A text that is not empty.
    pub(super) fn text(&self) -> Option<&'a str> {
        if let Value::Text(text) = &self.node.value { Some(&**text) } else { None }
            .filter(|text| !text.is_empty())
    }

    /// Meaning of a word, one of those in the table.
    pub(super) fn one_of<T: Copy>(&self, words: &[(&str, T)]) -> Option<T> {
        let text = self.text()?;
        let known = |kind: &Kind| if let Kind::Words(all) = kind { Some(all.len()) } else { None };
        debug_assert_eq!(self.as_one(known), Some(words.len()), "{}: words", self.path);
        words.iter().find(|(word, _)| *word == text).map(|&(_, meaning)| meaning)
    }

    /// The items of a list.
    pub(super) fn list(&self) -> Option<Vec<Self>> {
        let Value::List(items) = &self.node.value else { return None };
        let of = |kind: &'static Kind| {
            if let Kind::List { item, .. } = kind { Some(&**item) } else { None }
        };
        let kind = self.as_one(of)?;
        let item = |(k, node)| Self {
            node,
            path: joined(&self.path, &name_of(node, k)),
            kind,
            ..self.clone()
        };
        Some(items.iter().enumerate().map(item).collect())
    }

    /// `N` items, each read in the same way.
    pub(super) fn list_of<const N: usize, T: Copy>(
        &self,
        read: impl Fn(&Self) -> Option<T>,
    ) -> Option<[T; N]> {
        let items: Option<Vec<T>> = self.list()?.iter().map(read).collect();
        items?.try_into().ok()
    }

    /// Three numbers.
    pub(super) fn vector(&self) -> Option<Vec3> {
        self.list_of(Self::number).map(|[x, y, z]| Vec3::new(x, y, z))
    }

    /// A unit vector from one of any length.
    pub(super) fn direction(&self) -> Option<Vec3> {
        let vector = self.vector()?;
        if vector.amax() == 0.0 {
            self.fail("must have a length greater than 0");
            return None;
        }
        // Scaled first, because the squares of tiny components vanish.
        Some((vector / vector.amax()).normalize())
    }

    /// Keys and values of a table with free names or words as keys; `None` if it is no table.
    pub(super) fn entries(&self) -> Option<Vec<(&'a str, Self)>> {
        let Value::Table(table) = &self.node.value else { return None };
        let entry = |(key, node): (&'a String, &'a Node)| {
            let kind = self.as_one(|kind| match kind {
                Kind::Named(item) => Some(Some(&**item)),
                Kind::Table(keys) => Some(keys.find(key).map(|key| &key.kind)),
                _ => None,
            })??;
            Some((key.as_str(), Self { node, path: joined(&self.path, key), kind, ..self.clone() }))
        };
        Some(table.iter().filter_map(entry).collect())
    }

    pub(super) fn section(&self) -> Option<Section<'a>> {
        let Value::Table(table) = &self.node.value else { return None };
        let of = |kind: &'static Kind| if let Kind::Table(keys) = kind { Some(keys) } else { None };
        Some(Section { given: self.clone(), table, keys: self.as_one(of)? })
    }

    /// The tables of a list.
    pub(super) fn sections(&self) -> Vec<Section<'a>> {
        self.list().iter().flatten().filter_map(Self::section).collect()
    }

    /// Matching kind among the allowed ones.
    fn as_one<T>(&self, read: impl Fn(&'static Kind) -> Option<T>) -> Option<T> {
        let found = match self.kind {
            Kind::Either(kinds) => kinds.iter().find_map(read),
            kind => read(kind),
        };
        debug_assert!(found.is_some(), "{}: keys.md says something else", self.path);
        found
    }
}

/// Range in which every whole number is an f64.
pub(super) const EXACT: std::ops::RangeInclusive<f64> = 0.0..=(1_u64 << 53) as f64;

/// A path with one more key, in the notation of TOML and `--set`.
fn joined(path: &str, key: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let dot = if path.is_empty() { "" } else { "." };
    if !key.is_empty() && key.len() < 100 && key.chars().all(bare) {
        format!("{path}{dot}{key}")
    } else {
        format!("{path}{dot}\"{}\"", shown(key))
    }
}

/// A table that is being read.
#[derive(Clone, Debug)]
pub(super) struct Section<'a> {
    given: Given<'a>,
    pub(super) table: &'a Table,
    pub(super) keys: &'static Keys,
}

impl<'a> Section<'a> {
    /// Row of a key, which must exist.
    fn key(&self, key: &str) -> Option<&'static Key> {
        let found = self.keys.find(key);
        debug_assert!(found.is_some(), "keys.md has no `{key}` in {}", self.given.path);
        found
    }

    /// The value of a key, if there is one.
    pub(super) fn get(&self, key: &str) -> Option<Given<'a>> {
        let row = self.key(key)?;
        self.table.get(key).map(|node| Given {
            node,
            path: joined(&self.given.path, key),
            kind: &row.kind,
            unit: &row.unit,
            mistakes: self.given.mistakes,
        })
    }

    /// A value with a key that has no row.
    pub(super) fn stray(&self, key: &str, node: &'a Node) -> Given<'a> {
        Given { node, path: joined(&self.given.path, key), ..self.given.clone() }
    }

    /// Reports why a given key is not used here.
    pub(super) fn refuse(&self, key: &str, why: &str) {
        if let Some(given) = self.get(key) {
            given.fail(why);
        }
    }

    /// Value of a required key.
    pub(super) fn require(&self, key: &str) -> Option<Given<'a>> {
        let (given, row) = (self.get(key), self.key(key)?);
        // Keys that are always required have been reported already.
        if given.is_none() && !row.required {
            self.fail(format!("`{key}` is missing: {}", Allowed(&row.kind, &row.unit)));
        }
        given
    }

    /// Value of a key, or the default if it is absent; `None` if it is invalid.
    pub(super) fn read_or<T>(
        &self,
        key: &str,
        default: T,
        read: impl FnOnce(&Given<'a>) -> Option<T>,
    ) -> Option<T> {
        self.get(key).map_or(Some(default), |given| read(&given))
    }

    /// Value of a key, or `Some(None)` if it is absent; `None` if it is invalid.
    #[expect(clippy::option_option, reason = "wrong, none, or one")]
    pub(super) fn optional<T>(
        &self,
        key: &str,
        read: impl FnOnce(&Given<'a>) -> Option<T>,
    ) -> Option<Option<T>> {
        self.read_or(key, None, |given| read(given).map(Some))
    }

    /// A required number.
    pub(super) fn number(&self, key: &str) -> Option<f64> {
        self.require(key)?.number()
    }

    /// An optional number.
    pub(super) fn number_or(&self, key: &str, default: f64) -> Option<f64> {
        self.read_or(key, default, Given::number)
    }

    /// An optional whole number.
    pub(super) fn whole_or(&self, key: &str, default: u64) -> Option<u64> {
        self.read_or(key, default, Given::whole)
    }

    /// An optional truth value.
    pub(super) fn boolean_or(&self, key: &str, default: bool) -> Option<bool> {
        self.read_or(key, default, Given::boolean)
    }

    /// A required vector.
    pub(super) fn vector(&self, key: &str) -> Option<Vec3> {
        self.require(key)?.vector()
    }

    /// An optional vector.
    pub(super) fn vector_or(&self, key: &str, default: Vec3) -> Option<Vec3> {
        self.read_or(key, default, Given::vector)
    }

    /// Table of a key, if it is given.
    pub(super) fn section(&self, key: &str) -> Option<Section<'a>> {
        self.get(key)?.section()
    }

    /// Tables of `[[key]]`; empty if there are none.
    pub(super) fn sections(&self, key: &str) -> Vec<Section<'a>> {
        self.get(key).map_or_else(Vec::new, |given| given.sections())
    }

    /// Reports an error of the whole table.
    pub(super) fn fail(&self, what: impl fmt::Display) {
        self.given.fail_whole(what);
    }

    /// Path in the file.
    pub(super) fn path(&self) -> &str {
        &self.given.path
    }
}
