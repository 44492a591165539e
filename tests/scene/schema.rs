//! The schema of scenes rejects exactly the values of a single table that the reader rejects.

use anyhow::{Context, Result};
use dem_mpi::contact::ErodedGjk;
use dem_mpi::scene::{Scene, schema};
use dem_mpi::shape::Superellipsoid;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn scenes(folder: &str) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            files.extend(scenes(&path.to_string_lossy())?);
        } else if path.extension().is_some_and(|e| e == "toml") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn read(path: &Path) -> Result<Value> {
    let scene: toml::Table = fs::read_to_string(path)?.parse()?;
    Ok(serde_json::to_value(scene)?)
}

/// Whether a value satisfies a schema. Supports only the keywords of draft 7 that the schema of scenes has.
fn keeps(value: &Value, schema: &Value) -> bool {
    let Value::Object(schema) = schema else { return schema == &Value::Bool(true) };
    schema.iter().all(|(keyword, asked)| keeps_one(value, schema, keyword, asked))
}

fn keeps_one(value: &Value, schema: &Map<String, Value>, keyword: &str, asked: &Value) -> bool {
    let number = |holds: fn(f64, f64) -> bool| {
        value.as_f64().is_none_or(|x| holds(x, asked.as_f64().unwrap()))
    };
    let count = |length: Option<usize>, holds: fn(u64, u64) -> bool| {
        length.is_none_or(|length| holds(length as u64, asked.as_u64().unwrap()))
    };
    let (list, table) = (value.as_array(), value.as_object());
    match keyword {
        "$schema" | "title" | "description" | "then" | "else" => true,
        "type" => match asked.as_str().unwrap() {
            "object" => table.is_some(),
            "array" => list.is_some(),
            "string" => value.is_string(),
            "boolean" => value.is_boolean(),
            "number" => value.is_number(),
            "integer" => value.as_f64().is_some_and(|x| x.fract() == 0.0),
            other => panic!("type {other}"),
        },
        "enum" => asked.as_array().unwrap().contains(value),
        "const" => asked == value,
        "minimum" => number(|x, least| x >= least),
        "maximum" => number(|x, most| x <= most),
        "exclusiveMinimum" => number(|x, least| x > least),
        "exclusiveMaximum" => number(|x, most| x < most),
        "minLength" => {
            count(value.as_str().map(|text| text.chars().count()), |n, least| n >= least)
        }
        "minItems" => count(list.map(Vec::len), |n, least| n >= least),
        "maxItems" => count(list.map(Vec::len), |n, most| n <= most),
        "minProperties" => count(table.map(Map::len), |n, least| n >= least),
        "items" => list.is_none_or(|items| items.iter().all(|item| keeps(item, asked))),
        "required" => table.is_none_or(|table| {
            asked.as_array().unwrap().iter().all(|key| table.contains_key(key.as_str().unwrap()))
        }),
        "properties" => table.is_none_or(|table| {
            let known = asked.as_object().unwrap();
            table.iter().all(|(key, value)| known.get(key).is_none_or(|asked| keeps(value, asked)))
        }),
        "additionalProperties" => table.is_none_or(|table| {
            let known = schema.get("properties").and_then(Value::as_object);
            let is_known = |key: &String| known.is_some_and(|known| known.contains_key(key));
            table.iter().all(|(key, value)| is_known(key) || keeps(value, asked))
        }),
        "anyOf" => asked.as_array().unwrap().iter().any(|one| keeps(value, one)),
        "allOf" => asked.as_array().unwrap().iter().all(|one| keeps(value, one)),
        "if" => {
            let branch = schema.get(if keeps(value, asked) { "then" } else { "else" });
            branch.is_none_or(|branch| keeps(value, branch))
        }
        other => panic!("the test does not know the keyword {other}"),
    }
}

#[test]
fn good_scenes_keep_to_the_schema() -> Result<()> {
    let schema = schema::schema();
    let mut files = scenes("tests/scenes/good")?;
    files.extend(scenes("run")?);
    assert!(files.len() > 15, "{} files", files.len());
    for file in files {
        assert!(keeps(&read(&file)?, &schema), "{}", file.display());
    }
    Ok(())
}

/// Whether a message of the reader is about an error that a schema can detect.
fn is_of_form(message: &str) -> bool {
    let says = |word: &str| message.contains(word);
    says("no such key") || says("no such choice") || says(": must be ") && says_form(message)
}

/// Whether a message is about the form of a value and not about another rule.
fn says_form(message: &str) -> bool {
    ["a ", "true", "the path", "\""]
        .iter()
        .any(|form| message.contains(&format!(": must be {form}")))
}

#[test]
fn bad_scenes_do_not() -> Result<()> {
    let schema = schema::schema();
    let mut refused = 0;
    for file in scenes("tests/scenes/bad")? {
        let Ok(scene) = read(&file) else { continue };
        let problems = Scene::read(&file, &[]).err().context("a bad scene")?.problems;
        if problems.iter().any(|problem| is_of_form(&problem.message)) {
            let kept = keeps(&scene, &schema);
            assert!(!kept, "{}: keeps to the schema, but {problems:#?}", file.display());
            refused += 1;
        }
    }
    assert!(refused >= 15, "{refused} scenes");
    Ok(())
}

/// All names of keys below a schema.
fn names(schema: &Value, into: &mut BTreeSet<String>) {
    match schema {
        Value::Object(table) => {
            if let Some(Value::Object(properties)) = table.get("properties") {
                into.extend(properties.keys().cloned());
            }
            table.values().for_each(|value| names(value, into));
        }
        Value::Array(list) => list.iter().for_each(|value| names(value, into)),
        _ => {}
    }
}

/// A key that the reader requests but the table lacks ends the program. This test covers the reverse: every name in the table
/// occurs in the code.
#[test]
fn every_key_of_the_table_is_read() -> Result<()> {
    let mut sources = String::new();
    for folder in ["src/scene", "src/scene/walls"] {
        for entry in fs::read_dir(folder)? {
            let path = entry?.path();
            if path.extension().is_some_and(|e| e == "rs") {
                sources += &fs::read_to_string(path)?;
            }
        }
    }
    let mut all = BTreeSet::new();
    names(&schema::schema(), &mut all);
    assert!(all.len() > 120, "{} keys", all.len());
    // Sides are read by their list.
    let unread = all.iter().filter(|name| !name.starts_with(['-', '+']));
    let unread: Vec<_> = unread.filter(|name| !sources.contains(&format!("\"{name}\""))).collect();
    assert!(unread.is_empty(), "no reader asks for {unread:?}");
    Ok(())
}

/// Ranges that the code has, too.
#[test]
fn ranges_of_the_table_are_those_of_the_code() {
    let schema = schema::schema();
    let at = |path: &str| schema.pointer(path).and_then(Value::as_f64);
    let exponents = "/properties/shape/items/properties/exponents/items";
    let range = Superellipsoid::EXPONENTS;
    assert_eq!(at(&format!("{exponents}/minimum")), Some(*range.start()));
    assert_eq!(at(&format!("{exponents}/maximum")), Some(*range.end()));
    let increment = "/properties/contact/properties/erosion_increment/minimum";
    assert_eq!(at(increment), Some(ErodedGjk::LEAST_INCREMENT));
}

/// Values of all kinds, of which each key accepts some.
fn samples() -> Vec<Value> {
    let mut all: Vec<Value> = [-1.0, 0.0, 0.3, 1.9].map(|x| json!(x)).into();
    all.extend([json!(true), json!("no such word"), json!(""), json!([]), json!({})]);
    all.extend([json!([1, 1, 1]), json!(["-x"]), json!({ "unknown": 1 })]);
    all
}

/// All scenes that differ from this one by the value of one key.
fn changed(scene: &Value) -> Vec<(String, Value)> {
    let mut paths = Vec::new();
    collect(scene, "", &mut paths);
    let mut all = Vec::new();
    for path in paths {
        for sample in samples() {
            let mut changed = scene.clone();
            *changed.pointer_mut(&path).expect("it is there") = sample.clone();
            all.push((format!("{path} = {sample}"), changed));
        }
        let (parent, key) = path.rsplit_once('/').expect("it begins with one");
        let mut without = scene.clone();
        if let Some(Value::Object(table)) = without.pointer_mut(parent) {
            table.remove(key);
            all.push((format!("without {path}"), without));
        }
    }
    all
}

fn collect(value: &Value, path: &str, into: &mut Vec<String>) {
    let inside: Vec<(String, &Value)> = match value {
        Value::Object(table) => table.iter().map(|(key, value)| (key.clone(), value)).collect(),
        // The first item represents the list.
        Value::Array(list) => list.iter().take(1).map(|value| ("0".to_owned(), value)).collect(),
        _ => Vec::new(),
    };
    for (key, value) in inside {
        let path = format!("{path}/{key}");
        collect(value, &path, into);
        into.push(path);
    }
}

fn to_toml(scene: &Value) -> Result<String> {
    let table: Map<String, Value> = serde_json::from_value(scene.clone())?;
    Ok(toml::to_string(&table)?)
}

/// The reader rejects every scene that the schema rejects. The schema rejects every wrong type, range or name that the reader
/// finds. All keys of the good scenes are tried.
#[test]
fn the_schema_says_what_the_reader_says() -> Result<()> {
    let (schema, folder) = (schema::schema(), Path::new("tests/scenes/good"));
    let (mut both, mut wrong) = (0, Vec::new());
    for name in ["every_key.toml", "hertz.toml", "solids.toml"] {
        for (change, scene) in changed(&read(&folder.join(name))?) {
            let Ok(text) = to_toml(&scene) else { continue };
            let problems =
                Scene::parse(&text, name, folder, &[]).err().map_or(vec![], |e| e.problems);
            let kept = keeps(&scene, &schema);
            if !kept && problems.is_empty() {
                wrong.push(format!("{name}: {change}: refused by the schema alone"));
            }
            if kept && problems.iter().any(|problem| is_of_form(&problem.message)) {
                let messages: Vec<&str> = problems.iter().map(|p| &*p.message).collect();
                wrong.push(format!("{name}: {change}: refused by the reader alone: {messages:?}"));
            }
            both += usize::from(!kept && !problems.is_empty());
        }
    }
    assert!(wrong.is_empty(), "{} differ:\n{}", wrong.len(), wrong.join("\n"));
    assert!(both > 500, "{both} refused by both");
    Ok(())
}
