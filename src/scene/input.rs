//! The user's file as TOML values with their locations, with the overrides of the command line applied.

use super::mistakes::{Location, Mistakes, suggestion};
use crate::text::{Lines, shown};
use std::collections::BTreeMap;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// A table of the file.
pub(super) type Table = BTreeMap<String, Node>;

/// A value with its location.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) value: Value,
    pub(super) location: Location,
}

/// A TOML value.
#[derive(Clone, Debug)]
pub(super) enum Value {
    Boolean(bool),
    Integer(i64),
    Number(f64),
    Text(String),
    Date(String),
    List(Vec<Node>),
    Table(Table),
}

impl Value {
    pub(super) const fn type_name(&self) -> &'static str {
        match self {
            Self::Boolean(_) => "a truth value",
            Self::Integer(_) | Self::Number(_) => "a number",
            Self::Text(_) => "a string",
            Self::Date(_) => "a date; write it in quotes if it is a text",
            Self::List(_) => "a list",
            Self::Table(_) => "a table",
        }
    }

    pub(super) fn to_toml(&self) -> toml::Value {
        match self {
            Self::Boolean(b) => toml::Value::Boolean(*b),
            Self::Integer(i) => toml::Value::Integer(*i),
            Self::Number(x) => toml::Value::Float(*x),
            Self::Text(s) | Self::Date(s) => toml::Value::String(s.clone()),
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

/// Message for text that is not TOML, with the piece to which the parser points.
fn not_toml(text: &str, message: &str, span: Option<std::ops::Range<usize>>) -> String {
    let cure = span.as_ref().and_then(|span| bare_point(text, span.start));
    let cure = cure.map_or_else(String::new, |cure| format!("; write {cure}"));
    let piece = span.and_then(|span| text.get(span)).map(str::trim);
    match piece.filter(|piece| !piece.is_empty() && !piece.contains('\n') && piece.len() < 60) {
        Some(piece) => format!("not valid TOML: {message}: `{}`{cure}", shown(piece)),
        None => format!("not valid TOML: {message}{cure}"),
    }
}

/// The number at this place in valid TOML, with digits before and after its point.
fn bare_point(text: &str, place: usize) -> Option<String> {
    let (before, after) = text.split_at_checked(place)?;
    let is_part = |c: char| c.is_ascii_alphanumeric() || "+-._".contains(c);
    let begin = before.trim_end_matches(is_part).len();
    let end = place + (after.len() - after.trim_start_matches(is_part).len());
    let number = &text[begin..end];
    // A text that is no number without the point is no number with it.
    number.replace('_', "").parse::<f64>().ok()?;
    let (whole, part) = number.split_once('.')?;
    let whole = if whole.ends_with(|c: char| c.is_ascii_digit()) {
        whole.to_owned()
    } else {
        format!("{whole}0")
    };
    let part = if part.starts_with(|c: char| c.is_ascii_digit()) {
        part.to_owned()
    } else {
        format!("0{part}")
    };
    let written = format!("{whole}.{part}");
    (written != number).then(|| shown(written))
}

/// Parses a text; `None` if it is not TOML, which is reported. `at` gives the location of a line.
pub(super) fn read(
    text: &str,
    at: &dyn Fn(usize) -> Location,
    mistakes: &Mistakes,
) -> Option<Node> {
    let lines = Lines::of(text);
    let location = |offset: usize| at(lines.at(offset));
    let (table, errors) = DeTable::parse_recoverable(text);
    for error in &errors {
        let location = error.span().map_or(Location::File, |span| location(span.start));
        mistakes.add(&location, not_toml(text, error.message(), error.span()));
    }
    if !errors.is_empty() {
        return None;
    }
    let value = Value::Table(table_of(table.get_ref(), &location));
    Some(Node { value, location: Location::File })
}

/// The whole input as TOML text.
pub(super) fn to_text(root: &Node) -> String {
    toml::to_string_pretty(&root.value.to_toml()).expect("a table of plain values is valid TOML")
}

/// Converts a table; `location` gives the location of an offset in the text.
fn table_of(table: &DeTable, location: &dyn Fn(usize) -> Location) -> Table {
    let entry = |(key, value): (&Spanned<DeString>, &Spanned<DeValue>)| {
        let node = Node {
            value: value_of(value.get_ref(), location),
            location: location(key.span().start),
        };
        (key.get_ref().to_string(), node)
    };
    table.iter().map(entry).collect()
}

fn value_of(value: &DeValue, location: &dyn Fn(usize) -> Location) -> Value {
    match value {
        DeValue::Boolean(b) => Value::Boolean(*b),
        DeValue::Integer(i) => match i64::from_str_radix(i.as_str(), i.radix()) {
            Ok(i) => Value::Integer(i),
            // Too long for an integer: rejected where a whole number is required.
            Err(_) if i.radix() == 10 => Value::Number(i.as_str().parse().unwrap_or(f64::INFINITY)),
            Err(_) => {
                let radix = f64::from(i.radix());
                let digits = i.as_str().chars().filter_map(|c| c.to_digit(i.radix()));
                Value::Number(digits.fold(0.0, |x, digit| x * radix + f64::from(digit)))
            }
        },
        DeValue::Float(x) => Value::Number(x.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::String(s) => Value::Text(s.to_string()),
        DeValue::Datetime(d) => Value::Date(d.to_string()),
        DeValue::Array(list) => {
            let item = |item: &Spanned<DeValue>| Node {
                value: value_of(item.get_ref(), location),
                location: location(item.span().start),
            };
            Value::List(list.iter().map(item).collect())
        }
        DeValue::Table(table) => Value::Table(table_of(table, location)),
    }
}

// --- overrides ---

/// Applies the overrides of the command line.
pub(super) fn apply_all(root: &mut Node, overrides: &[String], mistakes: &Mistakes) {
    for text in overrides {
        let location = Location::Override(text.clone());
        if let Err(message) = apply(root, text, &location) {
            mistakes.add(&location, message);
        }
    }
}

/// Applies `path.to.key=value`. A word that is not a TOML value is taken as a string.
fn apply(root: &mut Node, text: &str, location: &Location) -> Result<(), String> {
    let expected = "an override is `path.to.key=value`, as in `time.steps=1000`";
    let (path, value) = text.split_once('=').ok_or(expected)?;
    let path = keys_of(path).ok_or(expected)?;
    let value = match DeValue::parse(value.trim()) {
        Ok(parsed) => value_of(parsed.get_ref(), &|_| location.clone()),
        Err(error) if value.trim().starts_with(['[', '{', '"', '\'']) => {
            return Err(format!("the value is not TOML: {}", error.message()));
        }
        Err(_) => Value::Text(value.trim().to_owned()),
    };
    put(root, &path, Node { value, location: location.clone() })
}

/// Keys of a dotted path, read like TOML; keys that TOML requires in quotes, like `+z`, work without.
fn keys_of(path: &str) -> Option<Vec<String>> {
    let line = format!("{path} = 0");
    let mut keys = Vec::new();
    if let Ok(table) = DeTable::parse(&line) {
        let mut level = Some(table.get_ref());
        while let Some((key, value)) = level.and_then(|table| table.iter().next()) {
            keys.push(key.get_ref().to_string());
            level = value.get_ref().as_table();
        }
    } else {
        keys.extend(path.split('.').map(|key| key.trim().to_owned()));
        if keys.iter().any(|key| key.is_empty() || key.contains(['"', '\'', ' '])) {
            return None;
        }
    }
    // A path that is a comment has no keys.
    (!keys.is_empty()).then_some(keys)
}

/// Puts a value at a path. Missing tables on the way are created; their names are checked when the scene is
/// read.
fn put(node: &mut Node, path: &[String], new: Node) -> Result<(), String> {
    let Some((key, rest)) = path.split_first() else {
        *node = new;
        return Ok(());
    };
    match &mut node.value {
        Value::Table(table) => {
            let empty = Node { value: Value::Table(Table::new()), location: new.location.clone() };
            put(table.entry(key.clone()).or_insert(empty), rest, new)
        }
        Value::List(list) => {
            let names: Vec<String> =
                list.iter().enumerate().map(|(k, item)| name_of(item, k)).collect();
            let by_name = names.iter().position(|name| name == key);
            let by_index = || key.parse().ok().filter(|&k: &usize| k < list.len());
            let index = by_name.or_else(by_index).ok_or_else(|| {
                let names = names.iter().map(String::as_str);
                format!("there is no `{key}` here{}", suggestion(key, names, "there are"))
            })?;
            put(&mut list[index], rest, new)
        }
        other => Err(format!("`{key}` does not exist: its parent is {}", other.type_name())),
    }
}

/// Name of a list item in a path: its `name`, or else its index.
pub(super) fn name_of(item: &Node, index: usize) -> String {
    match &item.value {
        Value::Table(table) => match table.get("name").map(|node| &node.value) {
            Some(Value::Text(name)) => name.clone(),
            _ => index.to_string(),
        },
        _ => index.to_string(),
    }
}
