//! Check of keys, types and ranges of a scene against the table of keys. All errors are reported before readers interpret
//! the values.

use super::geometry;
use super::input::Value;
use super::kind::{Allowed, Key, Keys, Kind};
use super::mistakes::{not_there, suggestion};
use super::reader::{EXACT, Given, Section};
use crate::shape::{LENGTHS, Superellipsoid};

/// Checks a value and everything in it.
pub(super) fn check(given: &Given) {
    let kinds = if let Kind::Either(kinds) = given.kind {
        &kinds[..]
    } else {
        std::slice::from_ref(given.kind)
    };
    match kinds.iter().find(|kind| fits(kind, &given.node.value)) {
        // Another word may be one of a different kind.
        Some(Kind::Words(words)) if kinds.len() > 1 && !is_of(given, words) => {
            given.fail(format!("must be {}", Allowed(given.kind, given.unit)));
        }
        Some(kind) => check_one(given, kind),
        None => expected(given),
    }
}

/// Is a value of a type, in any range?
const fn fits(kind: &Kind, value: &Value) -> bool {
    match kind {
        Kind::Number(_) | Kind::Whole(_) => matches!(value, Value::Integer(_) | Value::Number(_)),
        Kind::Boolean => matches!(value, Value::Boolean(_)),
        Kind::Text | Kind::File | Kind::Words(_) => matches!(value, Value::Text(_)),
        Kind::List { .. } => matches!(value, Value::List(_)),
        Kind::Table(_) | Kind::Named(_) => matches!(value, Value::Table(_)),
        Kind::Either(_) => false,
    }
}

/// Reports the expected type of a value.
fn expected(given: &Given) {
    let header = &given.path;
    let is_table = |kind: &Kind| matches!(kind, Kind::Table(_));
    match (given.kind, &given.node.value) {
        (Kind::List { names, item, .. }, _) if names.is_empty() && is_table(item) => {
            given
                .fail_whole(format!("may occur several times; write [[{header}]], not [{header}]"));
        }
        (Kind::Table(_), Value::List(items))
            if items.iter().all(|item| matches!(item.value, Value::Table(_))) =>
        {
            given.fail_whole(format!("may occur only once; write [{header}], not [[{header}]]"));
        }
        (kind, value) => {
            given.fail(format!("must be {}, not {}", Allowed(kind, given.unit), value.type_name()));
        }
    }
}

fn check_one(given: &Given, kind: &'static Kind) {
    let allowed = Allowed(kind, given.unit);
    match kind {
        Kind::Number(range) => {
            let x = given.as_number().unwrap_or(f64::NAN);
            if !range.holds(x) {
                let is_exponent = (range.least..=range.most) == Superellipsoid::EXPONENTS;
                given.fail(format!(
                    "must be {allowed}{}",
                    if is_exponent { OF_EXPONENTS } else { "" }
                ));
            } else if given.number().is_none() {
                let (least, most) = (LENGTHS.start(), LENGTHS.end());
                given.fail(format!("is outside the range of lengths, {least:e} to {most:e} m"));
            }
        }
        Kind::Whole(_) => {
            if given.as_number().is_some_and(|x| x > *EXACT.end()) && given.whole().is_none() {
                given.fail("is too large");
            } else if given.whole().is_none() {
                given.fail(format!("must be {allowed}"));
            }
        }
        Kind::Text | Kind::File if given.text().is_none() => given.fail("must not be empty"),
        Kind::Words(words) => check_word(given, words),
        Kind::List { names, least, .. } => {
            let items = given.list().unwrap_or_default();
            let count = items.len();
            if !names.is_empty() && count != names.len() {
                given.fail(format!("has {count} items; must be {allowed}"));
                return;
            }
            if count < *least {
                given.fail(format!("must be {allowed}"));
            }
            items.iter().for_each(check);
        }
        Kind::Named(_) => {
            let entries = given.entries().unwrap_or_default();
            if entries.is_empty() {
                given.fail(format!("must be {allowed}"));
            }
            for (_, entry) in &entries {
                check(entry);
            }
        }
        Kind::Table(_) => {
            if let Some(section) = given.section() {
                check_table(&section);
            }
        }
        Kind::Boolean | Kind::Text | Kind::File | Kind::Either(_) => {}
    }
}

/// Hint after the range of exponents.
const OF_EXPONENTS: &str = ": for powers of n use 2 / n, so 0.25 for 8 (for boxes, cylinders, octahedra and cones use \
     a `polyhedron`, with round edges a `rounded-polyhedron`)";

fn is_of(given: &Given, words: &[String]) -> bool {
    given.text().is_some_and(|text| words.iter().any(|word| word == text))
}

fn check_word(given: &Given, words: &[String]) {
    let Some(text) = given.text() else {
        given.fail("must not be empty");
        return;
    };
    if !is_of(given, words) {
        let hint = suggestion(text, words.iter().map(String::as_str), "allowed");
        given.fail(format!("no such choice{}{hint}", not_there("", text, &hint)));
    }
}

fn check_table(section: &Section) {
    let Section { keys, .. } = section;
    let is_allowed = |key: &&Key| {
        keys.table.as_deref() != Some("shape") || geometry::has_key(section, &key.name)
    };
    let allowed = || keys.all.iter().filter(is_allowed);
    for (name, node) in section.table {
        if let Some(key) = allowed().find(|key| key.name == *name) {
            section.get(&key.name).iter().for_each(check);
        } else {
            let hint = suggestion(name, allowed().map(|key| &*key.name), "allowed here");
            let what = format!("no such key{}{hint}", not_there(section.path(), name, &hint));
            section.stray(name, node).fail(what);
        }
    }
    for key in keys.all.iter().filter(|key| key.required && !section.table.contains_key(&key.name))
    {
        section.fail(missing(key));
    }
}

/// Message about a missing required key.
fn missing(key: &Key) -> String {
    let Key { name, kind, unit, meaning, .. } = key;
    let needed = |keys: &Keys| {
        let needed = keys.all.iter().filter(|key| key.required);
        needed.map(|key| format!("`{}`", key.name)).collect::<Vec<_>>().join(", ")
    };
    match kind {
        Kind::Table(keys) => format!("[{name}] is missing: {meaning} ({})", needed(keys)),
        Kind::List { item, .. } if let Kind::Table(keys) = &**item => {
            format!("[[{name}]] is missing: {meaning} ({})", needed(keys))
        }
        kind => format!("`{name}` is missing: {}", Allowed(kind, unit)),
    }
}
