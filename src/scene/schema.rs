//! A JSON schema of scene files, by which editors complete and check them: names, units and meanings as [`keys`] lists them,
//! types and ranges as the reader checks them (`tests/scene/schema.rs` compares the two).
//!
//! It knows each table by itself. What concerns several (names, the stable time step, room) `dem-mpi --check` finds.

use super::geometry;
use super::keys::{self, Key};
use super::reader::Range;
use crate::cell::{AXES, SIDES};
use crate::shape::{Kind, Superellipsoid};
use serde_json::{Map, Value, json};

/// Keys of `[[material]]` that an `[[interaction]]` may have, too.
const OF_TWO_MATERIALS: [&str; 9] = [
    "normal_stiffness",
    "tangential_stiffness",
    "friction",
    "restitution",
    "tangential_damping_ratio",
    "rolling_friction",
    "twisting_friction",
    "turning_damping_ratio",
    "surface_energy",
];

/// The schema of a scene file, of draft 7.
pub fn schema() -> Value {
    let mut root = table("");
    let mut fill = Map::new();
    for name in keys::all().chunk_by(|a, b| a.table == b.table).map(|rows| &rows[0]) {
        let mut one = table(&name.table);
        if !name.meaning.is_empty() && name.names.is_empty() {
            one["description"] = json!(name.meaning);
        }
        let one = if name.is_list { list(&one) } else { one };
        match name.table.split_once('.') {
            Some(("fill", of_fill)) => drop(fill.insert(of_fill.to_owned(), one)),
            _ if name.table.is_empty() => {}
            _ => root["properties"][&name.table] = one,
        }
    }
    root["properties"]["fill"] = closed(&fill, &[]);
    root["$schema"] = json!("http://json-schema.org/draft-07/schema#");
    root["title"] = json!("Scene of dem-mpi");
    root
}

/// The rows of a table, as the properties of an object.
fn table(name: &str) -> Value {
    let mut properties = Map::new();
    for key in keys::all().iter().filter(|key| key.table == name) {
        for word in &key.names {
            let mut property = value(name, word).unwrap_or_else(|| json!({}));
            let again = properties.get(word).is_some();
            property["description"] = if again {
                // A key of two shapes stands in two rows.
                let before = properties[word]["description"].as_str().unwrap_or_default();
                json!(format!("{before}. Or: {}", description(key)))
            } else {
                json!(description(key))
            };
            properties.insert(word.clone(), property);
        }
    }
    if name == "interaction" {
        let material = table("material");
        for key in OF_TWO_MATERIALS {
            properties.insert(key.to_owned(), material["properties"][key].clone());
        }
    }
    let mut object = closed(&properties, required(name));
    if name == "shape" {
        object["allOf"] = Kind::ALL.into_iter().filter_map(keys_of_kind).collect();
    }
    object
}

/// Unit and meaning.
fn description(key: &Key) -> String {
    if key.unit.is_empty() {
        key.meaning.clone()
    } else if key.meaning.is_empty() {
        format!("[{}]", key.unit)
    } else {
        format!("[{}] {}", key.unit, key.meaning)
    }
}

/// A shape of a kind has no keys of other kinds.
fn keys_of_kind(kind: Kind) -> Option<Value> {
    let own = geometry::keys(kind)?;
    let of_others = Kind::ALL.into_iter().filter_map(geometry::keys).flatten();
    let refused: Map<String, Value> = of_others
        .filter(|key| !own.contains(key))
        .map(|key| ((*key).to_owned(), json!(false)))
        .collect();
    Some(json!({
        "if": { "properties": { "kind": { "const": kind.name() } }, "required": ["kind"] },
        "then": { "properties": refused },
    }))
}

/// Keys without which a table is refused, whatever the others.
fn required(table: &str) -> &'static [&'static str] {
    match table {
        "" => &["domain", "material", "shape", "time", "output"],
        "domain" => &["low", "high"],
        "wall" | "inlet" | "outlet" => &["name"],
        "servo" | "motion" => &["walls"],
        "material" => &["name", "density"],
        "interaction" => &["between"],
        "shape" => &["name", "kind"],
        "time" => &["step"],
        "output" => &["directory"],
        "fill.rain" => &["count"],
        "fill.file" => &["path"],
        _ => &[],
    }
}

/// What a key may be; `None` of one that is not known here.
#[expect(clippy::match_same_arms, reason = "table by table, as the keys are listed")]
pub fn value(table: &str, key: &str) -> Option<Value> {
    let any = number(Range::Any);
    let positive = number(Range::Positive);
    let not_negative = number(Range::NotNegative);
    let below_one = number(Range::BelowOne);
    Some(match (table, key) {
        ("", "title" | "start") => text(),
        ("", "seed") => whole(0),
        ("", "gravity") => vector(&any),
        ("", "global_damping") => not_negative,

        ("domain", "low" | "high") => vector(&any),
        ("domain", "periodic") => vector(&boolean()),
        ("domain", "shear") => {
            let axis = words(&AXES);
            object(&[("along", axis.clone()), ("across", axis), ("rate", any)])
        }
        ("domain", "walls") => list(&words(&SIDES.map(|(side, ..)| side))),
        ("domain", "wall_material") => text(),
        ("domain", "wall_velocity") => {
            let sides = SIDES.map(|(side, ..)| (side.to_owned(), vector(&any)));
            closed(&sides.into_iter().collect(), &[])
        }

        ("wall", "name" | "material" | "mesh") => text(),
        ("wall", "cylinder") => {
            object(&[("from", vector(&any)), ("to", vector(&any)), ("radius", positive)])
        }
        ("wall", "cone") => {
            let radii = exactly(2, &not_negative);
            object(&[("from", vector(&any)), ("to", vector(&any)), ("radius", radii)])
        }
        ("wall", "scale") => positive,
        ("wall", "shift") => vector(&any),
        ("wall", "weld") => not_negative,
        ("wall", "turn") => object(&[("axis", vector(&any)), ("angle", any)]),
        ("wall", "smooth") => json!({ "type": "number", "minimum": 0, "maximum": 60 }),
        ("wall", "point" | "normal" | "velocity" | "surface_velocity" | "torque_about") => {
            vector(&any)
        }
        ("wall", "planes") => some(&object(&[("point", vector(&any)), ("normal", vector(&any))])),
        ("wall", "rotation") => {
            object(&[("about", vector(&any)), ("axis", vector(&any)), ("rate", any)])
        }

        ("motion", "walls") => some(&text()),
        ("motion", "along" | "about" | "axis") => vector(&any),
        ("motion", "amplitude" | "phase") => any,
        ("motion", "frequency" | "mass") => positive,
        ("motion", "force") => any,
        ("motion", "table") => text(),
        ("motion", "interpolation") => words(&["linear", "smooth"]),

        ("servo", "walls") => some(&text()),
        ("servo", "stress" | "force" | "max_speed" | "gain") => positive,
        ("servo", "along") => vector(&any),
        ("servo", "coupled") => boolean(),

        ("material", "name") => text(),
        ("material", "density" | "normal_stiffness" | "youngs_modulus") => positive,
        ("material", "tangential_stiffness" | "friction" | "tangential_damping_ratio") => {
            not_negative
        }
        ("material", "rolling_friction" | "twisting_friction" | "turning_damping_ratio") => {
            not_negative
        }
        ("material", "surface_energy") => not_negative,
        ("material", "restitution") => number(Range::UpToOne),
        ("material", "poisson_ratio") => json!({ "type": "number", "minimum": 0, "maximum": 0.5 }),
        ("interaction", "between") => exactly(2, &text()),

        ("shape", "name" | "material" | "file") => text(),
        ("shape", "kind") => {
            let kinds = Kind::ALL.into_iter().filter(|&kind| geometry::keys(kind).is_some());
            words(&kinds.map(Kind::name).collect::<Vec<_>>())
        }
        ("shape", "radius" | "diameter" | "aspect_ratio" | "length" | "scale") => positive,
        ("shape", "semi_axes" | "semi_axes_positive" | "semi_axes_negative") => vector(&positive),
        ("shape", "exponents") => exactly(2, &number(Range::Exponent)),
        ("shape", "vertices") => list(&vector(&any)),
        ("shape", "edges") => vector(&positive),
        ("shape", "size") => size(&positive),

        ("contact", "method") => words(&["auto", "common-normal", "gjk-erosion", "epa"]),
        ("contact", "erosion_ratio" | "erosion_increment" | "tolerance") => below_one,
        ("contact", "spurious" | "polish") => boolean(),

        ("law", "normal") => words(&["linear", "hertz"]),
        ("law", "tangential") => words(&["linear", "mindlin", "none"]),
        ("law", "largest_overlap") => below_one,
        ("law", "rolling" | "twisting") => words(&["none", "spring"]),
        ("law", "adhesion") => words(&["none", "dmt", "jkr"]),
        ("law", "limit_damping") => boolean(),

        ("time", "step") => either(&[positive, words(&["auto"])]),
        ("time", "steps") => whole(0),
        ("time", "duration") => positive,
        ("time", "allow_unstable") => boolean(),
        ("stop", "rest" | "unbalanced" | "servo") => below_one,
        ("neighbours", "skin") => not_negative,
        ("neighbours", "imbalance") => number(Range::FromOne),
        ("neighbours", "order_every") => whole(1),
        ("audit", "every" | "seed") => whole(0),
        ("audit", "contacts") => whole(1),
        ("output", "directory") => text(),
        ("output", "snapshot_every" | "history_every") => whole(0),

        ("fill.rain" | "fill.lattice" | "inlet", "shapes") => {
            let shares =
                json!({ "type": "object", "additionalProperties": positive, "minProperties": 1 });
            either(&[some(&text()), shares])
        }
        ("fill.rain" | "fill.lattice" | "inlet", "shares") => words(&["number", "mass"]),
        ("inlet" | "outlet", "name") => text(),
        ("inlet" | "outlet", "low" | "high") => vector(&any),
        ("fill.rain" | "inlet" | "outlet", "axis") => exactly(2, &vector(&any)),
        ("fill.rain" | "inlet" | "outlet", "radius") => positive,
        ("inlet" | "outlet", "every") => whole(1),
        ("wall", "wear") | ("inlet" | "outlet", "list") => boolean(),
        ("outlet", "point" | "normal") | ("inlet", "velocity") => vector(&any),
        ("inlet", "rate" | "mass_rate" | "count" | "mass") => positive,
        ("inlet", "begin" | "spread" | "spin") => not_negative,
        ("stop", "left") => whole(1),
        ("stop", "remaining") => whole(0),
        ("stop", "after") => not_negative,
        ("fill.rain", "count" | "every") => whole(1),
        ("fill.rain", "spacing") => positive,
        ("fill.lattice", "spacing") => either(&[positive.clone(), vector(&positive)]),
        ("fill.rain" | "fill.lattice", "low" | "high" | "velocity") => vector(&any),
        ("fill.rain" | "fill.lattice" | "inlet", "orientation") => orientation(&any),
        ("fill.lattice", "first") => vector(&any),
        ("fill.lattice", "count") => vector(&whole(1)),
        ("fill.lattice", "jitter") => not_negative,
        ("fill.file", "path") => text(),
        _ => return None,
    })
}

/// How sizes are distributed: one law, by number or by mass.
fn size(positive: &Value) -> Value {
    let (two, by) = (exactly(2, positive), words(&["number", "mass"]));
    let law = |law: &str, value: Value, has_limits: bool| {
        let mut keys = Map::from_iter([(law.to_owned(), value), ("by".to_owned(), by.clone())]);
        let mut required = vec![law];
        if !has_limits {
            keys.insert("limits".to_owned(), two.clone());
            required.push("limits");
        }
        closed(&keys, &required)
    };
    let parameters = |names: [&str; 2]| object(&names.map(|name| (name, positive.clone())));
    let row = exactly(2, &number(Range::NotNegative));
    either(&[
        law("uniform", two.clone(), true),
        law("table", json!({ "type": "array", "items": row, "minItems": 2 }), true),
        law("normal", parameters(["mean", "deviation"]), false),
        law("lognormal", parameters(["median", "sigma"]), false),
        law("weibull", parameters(["scale", "shape"]), false),
    ])
}

/// A word, or an own axis along a direction.
fn orientation(any: &Value) -> Value {
    let tilt = json!({ "type": "number", "minimum": 0, "maximum": 180 });
    let keys = [("axis", vector(any)), ("spread", tilt), ("own", words(&["x", "y", "z"]))];
    let keys = keys.map(|(key, value)| (key.to_owned(), value));
    either(&[words(&["random", "upright"]), closed(&Map::from_iter(keys), &["axis"])])
}

fn number(range: Range) -> Value {
    let exponents = Superellipsoid::EXPONENTS;
    match range {
        Range::Any => json!({ "type": "number" }),
        Range::Positive => json!({ "type": "number", "exclusiveMinimum": 0 }),
        Range::NotNegative => json!({ "type": "number", "minimum": 0 }),
        Range::UpToOne => json!({ "type": "number", "exclusiveMinimum": 0, "maximum": 1 }),
        Range::BelowOne => {
            json!({ "type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1 })
        }
        Range::FromOne => json!({ "type": "number", "minimum": 1 }),
        Range::Exponent => {
            json!({ "type": "number", "minimum": exponents.start(), "maximum": exponents.end() })
        }
    }
}

/// A whole number from `least` up; 1e5 is one, too.
fn whole(least: u64) -> Value {
    json!({ "type": "integer", "minimum": least })
}

fn boolean() -> Value {
    json!({ "type": "boolean" })
}

fn text() -> Value {
    json!({ "type": "string", "minLength": 1 })
}

fn words(words: &[&str]) -> Value {
    json!({ "enum": words })
}

fn list(item: &Value) -> Value {
    json!({ "type": "array", "items": item })
}

/// A list that is not empty.
fn some(item: &Value) -> Value {
    json!({ "type": "array", "items": item, "minItems": 1 })
}

fn exactly(count: usize, item: &Value) -> Value {
    json!({ "type": "array", "items": item, "minItems": count, "maxItems": count })
}

/// [x, y, z].
fn vector(item: &Value) -> Value {
    exactly(3, item)
}

fn either(values: &[Value]) -> Value {
    json!({ "anyOf": values })
}

/// A table that has these keys, all of them.
fn object(keys: &[(&str, Value)]) -> Value {
    let required: Vec<&str> = keys.iter().map(|(key, _)| *key).collect();
    let properties = keys.iter().map(|(key, value)| ((*key).to_owned(), value.clone()));
    closed(&properties.collect(), &required)
}

/// A table that has no other keys than these.
fn closed(properties: &Map<String, Value>, required: &[&str]) -> Value {
    json!({ "type": "object", "properties": properties, "required": required, "additionalProperties": false })
}
