//! The user's file as it is written: TOML whose every value knows its place, the overrides of the
//! command line, and readers that check a value's type and range.
//!
//! A reader never stops at a mistake. It tells the [`Report`] and returns `None`, so that one run
//! finds all mistakes of a file. A [`Section`] remembers which keys it was asked for; those are the
//! keys that exist, all others are refused by [`Section::finish`].

use super::report::{Place, Report, suggestion};
use crate::math::Vec3;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt;
use toml::de::{DeTable, DeValue};

/// A table of the file.
pub(super) type Table = BTreeMap<String, Node>;

/// A value and where it was given.
#[derive(Clone, Debug)]
pub(super) struct Node {
    value: Value,
    place: Place,
}

#[derive(Clone, Debug)]
enum Value {
    Boolean(bool),
    Integer(i64),
    Number(f64),
    Text(String),
    List(Vec<Node>),
    Table(Table),
}

impl Value {
    const fn type_name(&self) -> &'static str {
        match self {
            Self::Boolean(_) => "a truth value",
            Self::Integer(_) | Self::Number(_) => "a number",
            Self::Text(_) => "a string",
            Self::List(_) => "a list",
            Self::Table(_) => "a table",
        }
    }

    fn to_toml(&self) -> toml::Value {
        match self {
            Self::Boolean(b) => toml::Value::Boolean(*b),
            Self::Integer(i) => toml::Value::Integer(*i),
            Self::Number(x) => toml::Value::Float(*x),
            Self::Text(s) => toml::Value::String(s.clone()),
            Self::List(list) => {
                toml::Value::Array(list.iter().map(|node| node.value.to_toml()).collect())
            }
            Self::Table(table) => toml::Value::Table(
                table.iter().map(|(key, node)| (key.clone(), node.value.to_toml())).collect(),
            ),
        }
    }
}

// --- from text ---

/// The file and the overrides, or `None` if the text is not TOML (the report says where).
pub(super) fn read(text: &str, overrides: &[String], report: &Report) -> Option<Node> {
    let place = |offset: usize| Place::Line(1 + text[..offset].matches('\n').count());
    let (table, errors) = DeTable::parse_recoverable(text);
    for error in &errors {
        let place = error.span().map_or(Place::File, |span| place(span.start.min(text.len())));
        report.add(&place, format!("not valid TOML: {}", error.message()));
    }
    if !errors.is_empty() {
        return None;
    }
    let value = Value::Table(table_of(table.get_ref(), &place, report));
    let mut root = Node { value, place: Place::File };
    for text in overrides {
        apply(&mut root, text, report);
    }
    Some(root)
}

/// The whole input as TOML text.
pub(super) fn to_text(root: &Node) -> String {
    toml::to_string_pretty(&root.value.to_toml()).expect("a table of plain values is valid TOML")
}

fn table_of(table: &DeTable, place: &dyn Fn(usize) -> Place, report: &Report) -> Table {
    table
        .iter()
        .filter_map(|(key, value)| {
            let place_of_key = place(key.span().start);
            let value = value_of(value.get_ref(), &place_of_key, place, report)?;
            Some((key.get_ref().to_string(), Node { value, place: place_of_key }))
        })
        .collect()
}

/// A value at `here`; `None` if it is of a kind that no scene uses.
fn value_of(
    value: &DeValue,
    here: &Place,
    place: &dyn Fn(usize) -> Place,
    report: &Report,
) -> Option<Value> {
    Some(match value {
        DeValue::Boolean(b) => Value::Boolean(*b),
        DeValue::Integer(i) => {
            let Ok(i) = i64::from_str_radix(i.as_str(), i.radix()) else {
                report.add(here, format!("the integer {i} does not fit into 64 bits"));
                return None;
            };
            Value::Integer(i)
        }
        DeValue::Float(x) => Value::Number(x.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::String(s) => Value::Text(s.to_string()),
        DeValue::Datetime(d) => Value::Text(d.to_string()),
        DeValue::Array(list) => Value::List(
            list.iter()
                .filter_map(|item| {
                    let here = place(item.span().start);
                    let value = value_of(item.get_ref(), &here, place, report)?;
                    Some(Node { value, place: here })
                })
                .collect(),
        ),
        DeValue::Table(table) => Value::Table(table_of(table, place, report)),
    })
}

// --- overrides ---

/// Applies `path.to.key=value`.
fn apply(root: &mut Node, text: &str, report: &Report) {
    let place = Place::Override(text.to_owned());
    let result = parse_override(text, &place)
        .and_then(|(path, value)| put(root, &path, Node { value, place: place.clone() }));
    if let Err(message) = result {
        report.add(&place, message);
    }
}

/// Keys and value of an override. What is not a TOML value is taken as a string.
fn parse_override(text: &str, place: &Place) -> Result<(Vec<String>, Value), String> {
    let expected = || "an override is `path.to.key=value`, as in `time.steps=1000`".to_owned();
    let (path, value) = text.split_once('=').ok_or_else(expected)?;
    let line = format!("{path} = 0");
    let table = DeTable::parse(&line).map_err(|_| expected())?;
    let mut keys = Vec::new();
    let mut level = table.get_ref();
    while let Some((key, value)) = level.iter().next() {
        keys.push(key.get_ref().to_string());
        match value.get_ref() {
            DeValue::Table(inner) => level = inner,
            _ => break,
        }
    }
    let report = Report::default();
    let value = match DeValue::parse(value.trim()) {
        Ok(parsed) => value_of(parsed.get_ref(), place, &|_| place.clone(), &report)
            .ok_or_else(|| "the integer does not fit into 64 bits".to_owned())?,
        Err(_) => Value::Text(value.trim().to_owned()),
    };
    Ok((keys, value))
}

/// Puts a value where the path leads. Tables on the way are made if they are missing: whether their
/// names exist is found when the scene is read.
fn put(node: &mut Node, path: &[String], new: Node) -> Result<(), String> {
    let Some((key, rest)) = path.split_first() else {
        *node = new;
        return Ok(());
    };
    match &mut node.value {
        Value::Table(table) => {
            let empty = Node { value: Value::Table(Table::new()), place: new.place.clone() };
            put(table.entry(key.clone()).or_insert(empty), rest, new)
        }
        Value::List(list) => {
            let names: Vec<String> =
                list.iter().enumerate().map(|(k, item)| name_of(item, k)).collect();
            let index = names
                .iter()
                .position(|name| name == key)
                .or_else(|| key.parse().ok().filter(|&k: &usize| k < list.len()))
                .ok_or_else(|| {
                    let names = names.iter().map(String::as_str);
                    format!("there is no `{key}` here{}", suggestion(key, names, "there are"))
                })?;
            put(&mut list[index], rest, new)
        }
        other => Err(format!("`{key}` leads nowhere: before it stands {}", other.type_name())),
    }
}

/// What an item of a list is called in a path: its `name`, or else its index.
fn name_of(item: &Node, index: usize) -> String {
    match &item.value {
        Value::Table(table) => match table.get("name").map(|node| &node.value) {
            Some(Value::Text(name)) => name.clone(),
            _ => index.to_string(),
        },
        _ => index.to_string(),
    }
}

// --- readers ---

/// Which numbers are allowed.
#[derive(Clone, Copy, Debug)]
pub(super) enum Range {
    Any,
    Positive,
    NotNegative,
    /// In (0, 1].
    UpToOne,
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
                Self::BelowOne => x > 0.0 && x < 1.0,
                Self::FromOne => x >= 1.0,
            }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Any => "a finite number",
            Self::Positive => "a number greater than 0",
            Self::NotNegative => "a number, 0 or greater",
            Self::UpToOne => "a number greater than 0 and at most 1",
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
    report: &'a Report,
}

impl<'a> Given<'a> {
    /// The whole input.
    pub(super) fn root(node: &'a Node, report: &'a Report) -> Self {
        Self { node, path: String::new(), report }
    }

    /// Where it stands.
    pub(super) const fn place(&self) -> &'a Place {
        &self.node.place
    }

    /// Key path and value, then what is wrong.
    pub(super) fn fail(&self, what: impl fmt::Display) {
        let value = match &self.node.value {
            Value::Boolean(b) => format!(" = {b}"),
            Value::Integer(i) => format!(" = {i}"),
            Value::Number(x) => format!(" = {x:?}"),
            Value::Text(s) => format!(" = \"{s}\""),
            Value::List(list) if list.iter().all(|n| matches!(n.value, Value::Table(_))) => {
                String::new()
            }
            list @ Value::List(_) => format!(" = {}", list.to_toml()),
            Value::Table(_) => String::new(),
        };
        self.report.add(&self.node.place, format!("{}{value}: {what}", self.path));
    }

    /// What was expected, for a value of another type.
    fn expected<T>(&self, what: &dyn fmt::Display) -> Option<T> {
        self.fail(format!("must be {what}, not {}", self.node.value.type_name()));
        None
    }

    fn raw_number(&self) -> Option<f64> {
        match self.node.value {
            Value::Integer(i) => Some(i as f64),
            Value::Number(x) => Some(x),
            _ => None,
        }
    }

    /// A finite number of this range; `unit` may be empty.
    pub(super) fn number(&self, range: Range, unit: &str) -> Option<f64> {
        let allowed = Allowed(&range, unit);
        let Some(x) = self.raw_number() else { return self.expected(&allowed) };
        if !range.holds(x) {
            self.fail(format!("must be {allowed}"));
            return None;
        }
        Some(x)
    }

    /// A whole number from `least` up; `1e5` will do too.
    pub(super) fn whole(&self, least: u64) -> Option<u64> {
        // Up to here every whole number is an f64.
        let most = (1_u64 << 53) as f64;
        let Some(x) = self.raw_number() else {
            return self.expected(&format!("a whole number, {least} or greater"));
        };
        if x.fract() != 0.0 || !(least as f64..=most).contains(&x) {
            self.fail(format!("must be a whole number, {least} or greater"));
            return None;
        }
        Some(x as u64)
    }

    pub(super) fn boolean(&self) -> Option<bool> {
        match self.node.value {
            Value::Boolean(b) => Some(b),
            _ => self.expected(&"true or false"),
        }
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
            self.fail(format!("no such choice{}", suggestion(text, known, "allowed")));
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

    fn items(&self, items: &'a [Node]) -> Vec<Self> {
        let item = |(k, node)| Self {
            node,
            path: format!("{}.{}", self.path, name_of(node, k)),
            report: self.report,
        };
        items.iter().enumerate().map(item).collect()
    }

    /// Three items, each read in the same way.
    fn three<T>(&self, what: &str, read: impl Fn(&Self) -> Option<T>) -> Option<[T; 3]> {
        let what = format!("a list of three: [x, y, z], each {what}");
        let items = self.list(&what)?;
        if items.len() != 3 {
            self.fail(format!("must be {what}, not of {}", items.len()));
            return None;
        }
        let read: Vec<Option<T>> = items.iter().map(read).collect();
        let read: Vec<T> = read.into_iter().collect::<Option<_>>()?;
        read.try_into().ok()
    }

    pub(super) fn vector(&self, range: Range, unit: &str) -> Option<Vec3> {
        let allowed = Allowed(&range, unit).to_string();
        self.three(&allowed, |item| item.number(range, unit)).map(Vec3::from)
    }

    pub(super) fn three_booleans(&self) -> Option<[bool; 3]> {
        self.three("true or false", Self::boolean)
    }

    pub(super) fn three_whole(&self, least: u64) -> Option<[u64; 3]> {
        self.three(&format!("a whole number, {least} or greater"), |item| item.whole(least))
    }

    /// One number for all axes, or one for each.
    pub(super) fn number_or_vector(&self, range: Range, unit: &str) -> Option<Vec3> {
        match self.node.value {
            Value::List(_) => self.vector(range, unit),
            _ => self.number(range, unit).map(Vec3::repeat),
        }
    }

    /// Keys and values of a table, `None` if it is none.
    pub(super) fn entries(&self) -> Option<Vec<(&'a str, Self)>> {
        let Value::Table(table) = &self.node.value else { return None };
        let entry = |(key, node): (&'a String, &'a Node)| {
            let path = format!("{}.{key}", self.path);
            (key.as_str(), Self { node, path, report: self.report })
        };
        Some(table.iter().map(entry).collect())
    }

    pub(super) fn section(&self) -> Option<Section<'a>> {
        match &self.node.value {
            Value::Table(table) => {
                Some(Section { given: self.clone(), table, asked: RefCell::default() })
            }
            Value::List(_) => {
                let header = &self.path;
                self.report.add(
                    self.place(),
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
        self.report.add(self.place(), message);
        Vec::new()
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
        let path = if self.given.path.is_empty() {
            key.to_owned()
        } else {
            format!("{}.{key}", self.given.path)
        };
        self.table.get(key).map(|node| Given { node, path, report: self.given.report })
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
        let what = format!("[x, y, z] [{unit}]");
        self.require(key, &what, |given| given.vector(Range::Any, unit))
    }

    /// A vector that may be there.
    pub(super) fn vector_or(&self, key: &'static str, default: Vec3, unit: &str) -> Option<Vec3> {
        self.read_or(key, default, |given| given.vector(Range::Any, unit))
    }

    /// A table that must be there.
    pub(super) fn section(&self, key: &'static str, what: &str) -> Option<Section<'a>> {
        self.require(key, what, Given::section)
    }

    /// The tables of `[[key]]`, none if there are none.
    pub(super) fn sections(&self, key: &'static str) -> Vec<Section<'a>> {
        self.get(key).map_or_else(Vec::new, |given| given.sections())
    }

    /// Says what is wrong with the table as a whole.
    pub(super) fn fail(&self, what: impl fmt::Display) {
        let path = &self.given.path;
        let colon = if path.is_empty() { "" } else { ": " };
        self.given.report.add(self.given.place(), format!("{path}{colon}{what}"));
    }

    /// Refuses the keys that nobody asked for.
    pub(super) fn finish(&self) {
        let asked = self.asked.borrow();
        for (key, node) in self.table {
            if !asked.contains(&key.as_str()) {
                let path = &self.given.path;
                let dot = if path.is_empty() { "" } else { "." };
                let path = format!("{path}{dot}{key}");
                let hint = suggestion(key, asked.iter().copied(), "allowed here");
                Given { node, path, report: self.given.report }.fail(format!("no such key{hint}"));
            }
        }
    }
}
