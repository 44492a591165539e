//! JSON schema of scene files from the table of keys, for completion and checks in editors.
//!
//! It checks each table separately. Conditions between tables (names, the stable time step, room) are checked by
//! `dem-mpi --check`.

use super::geometry;
use super::keys::SCENE;
use super::kind::{Key, Keys, Kind, Range};
use crate::shape;
use serde_json::{Map, Value, json};

/// The schema of a scene file, of draft 7.
pub fn schema() -> Value {
    let mut root = of(&SCENE);
    if let Kind::Table(keys) = &*SCENE {
        let has = |key: &str| json!({ "required": [key] });
        root["if"] = json!({ "anyOf": [has("include"), has("like")] });
        // The other parts may be in the included files.
        root["then"] = json!(true);
        root["else"] = needed(keys);
    }
    root["$schema"] = json!("http://json-schema.org/draft-07/schema#");
    root["title"] = json!("Scene of dem-mpi");
    root
}

fn of(kind: &Kind) -> Value {
    match kind {
        Kind::Number(range) => number(range),
        // 1e5 is a whole number, too.
        Kind::Whole(least) => json!({ "type": "integer", "minimum": least }),
        Kind::Boolean => json!({ "type": "boolean" }),
        Kind::Text | Kind::File => json!({ "type": "string", "minLength": 1 }),
        Kind::Words(words) => json!({ "enum": words }),
        Kind::List { names, least, item } => {
            let mut list = json!({ "type": "array", "items": of(item) });
            if names.is_empty() && *least > 0 {
                list["minItems"] = json!(least);
            } else if !names.is_empty() {
                list["minItems"] = json!(names.len());
                list["maxItems"] = json!(names.len());
            }
            list
        }
        Kind::Table(keys) if keys.ways.is_empty() => table(keys),
        Kind::Table(keys) => json!({ "anyOf": keys.ways.iter().map(table).collect::<Vec<_>>() }),
        Kind::Named(item) => {
            json!({ "type": "object", "additionalProperties": of(item), "minProperties": 1 })
        }
        Kind::Either(kinds) => json!({ "anyOf": kinds.iter().map(of).collect::<Vec<_>>() }),
    }
}

fn number(range: &Range) -> Value {
    let mut number = json!({ "type": "number" });
    if range.least.is_finite() {
        number[if range.above { "exclusiveMinimum" } else { "minimum" }] = json!(range.least);
    }
    if range.most.is_finite() {
        number[if range.below { "exclusiveMaximum" } else { "maximum" }] = json!(range.most);
    }
    number
}

/// Required keys of tables with headers.
fn needed(keys: &Keys) -> Value {
    let required = keys.all.iter().filter(|key| key.required).map(|key| &key.name);
    let inside = keys.all.iter().filter_map(|key| {
        let needed = match &key.kind {
            Kind::Table(inner) if inner.table.is_some() => needed(inner),
            Kind::List { item, .. } => match &**item {
                Kind::Table(inner) if inner.table.is_some() => json!({ "items": needed(inner) }),
                _ => return None,
            },
            _ => return None,
        };
        Some((key.name.clone(), needed))
    });
    let inside: Map<String, Value> = inside.collect();
    json!({ "required": required.collect::<Vec<_>>(), "properties": inside })
}

/// A table with no other keys than these.
fn table(keys: &Keys) -> Value {
    let property = |key: &Key| {
        let mut value = of(&key.kind);
        if !key.meaning.is_empty() {
            value["description"] = json!(key.meaning);
        }
        (key.name.clone(), value)
    };
    let properties: Map<String, Value> = keys.all.iter().map(property).collect();
    let mut object =
        json!({ "type": "object", "properties": properties, "additionalProperties": false });
    if keys.table.is_none() {
        let required = keys.all.iter().filter(|key| key.required).map(|key| &key.name);
        object["required"] = json!(required.collect::<Vec<_>>());
    }
    if keys.table.as_deref() == Some("shape") {
        object["allOf"] =
            shape::Kind::ALL.into_iter().filter_map(|kind| keys_of_kind(keys, kind)).collect();
    }
    object
}

/// Rejects keys of other kinds for a shape of a kind.
fn keys_of_kind(keys: &Keys, kind: shape::Kind) -> Option<Value> {
    geometry::keys(kind)?;
    let refused = keys.all.iter().filter(|key| !geometry::has(Some(kind), &key.name));
    let refused: Map<String, Value> = refused.map(|key| (key.name.clone(), json!(false))).collect();
    Some(json!({
        "if": { "properties": { "kind": { "const": kind.name() } }, "required": ["kind"] },
        "then": { "properties": refused },
    }))
}
