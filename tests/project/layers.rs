//! The folders are the architecture: a module imports only modules from rows above its own.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Modules by row, in the order of `src/lib.rs`.
const ROWS: [&[&str]; 17] = [
    &["ids", "math", "lanes", "timing", "files"],
    &["text", "random"],
    &["arguments"],
    &["cell", "shape", "comm"],
    &["contact"],
    &["population"],
    &["walls"],
    &["particles", "pairs"],
    &["law", "motion"],
    &["search"],
    &["contacts"],
    &["measure"],
    &["domain", "drive"],
    &["output"],
    &["sim", "post"],
    &["scene"],
    &["sweep"],
];

pub(super) fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// Modules that the code of a text names after `crate::`.
fn imports(text: &str) -> Vec<String> {
    text.lines()
        .map(str::trim)
        .filter(|line| !line.starts_with("//"))
        .flat_map(|line| line.split("crate::").skip(1))
        .map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect())
        .filter(|name: &String| !name.is_empty())
        .collect()
}

#[test]
fn imports_point_up_the_rows() {
    let row_of: BTreeMap<&str, usize> = ROWS
        .iter()
        .enumerate()
        .flat_map(|(row, names)| names.iter().map(move |&n| (n, row)))
        .collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut wrong = Vec::new();
    let mut seen = 0;
    for path in files {
        // The modules of `grains` belong to the program's rows.
        let inside = path.strip_prefix(&root).unwrap();
        let inside = inside.strip_prefix("grains").unwrap_or(inside);
        let module = inside.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
        let Some(&row) = row_of.get(module) else {
            assert!(["lib", "bin"].contains(&module), "{module} has no row");
            continue;
        };
        let text = fs::read_to_string(&path).unwrap();
        for hidden in ["crate::{", "super::super::"] {
            assert!(
                !text.contains(hidden),
                "{}: {hidden} hides what is imported",
                inside.display()
            );
        }
        for import in imports(&text) {
            let Some(&of) = row_of.get(import.as_str()) else {
                wrong.push(format!("{}: crate::{import} has no row", inside.display()));
                continue;
            };
            seen += 1;
            if of >= row && import != module {
                wrong.push(format!("{}: {module} imports {import}", inside.display()));
            }
        }
    }
    assert!(seen > 100, "the imports were found: {seen}");
    assert!(wrong.is_empty(), "imports against the rows:\n{}", wrong.join("\n"));
}

/// Names after `super::` in code that are files or folders beside this one.
fn neighbours(text: &str, beside: &[String]) -> Vec<String> {
    let code: Vec<&str> = text.split("#[cfg(test)]").next().unwrap_or_default().lines().collect();
    let code = code.into_iter().filter(|line| !line.trim().starts_with("//")).collect::<String>();
    let words = code.split("super::").skip(1).flat_map(|rest| {
        let group = rest.strip_prefix('{').and_then(|rest| rest.split('}').next());
        let names = group.unwrap_or_else(|| rest.split([':', ';', ' ', '(']).next().unwrap_or(""));
        names.split(',').map(|name| name.trim().split(':').next().unwrap_or("").to_owned())
    });
    words.filter(|name| beside.contains(name)).collect()
}

/// Files of one folder do not import each other in a circle.
#[test]
fn no_circles_within_a_folder() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut folders: BTreeMap<PathBuf, BTreeMap<String, Vec<String>>> = BTreeMap::new();
    let name_of = |path: &Path| path.file_stem().unwrap().to_str().unwrap().to_owned();
    for path in &files {
        let folder = path.parent().unwrap();
        let beside: Vec<String> =
            fs::read_dir(folder).unwrap().map(|entry| name_of(&entry.unwrap().path())).collect();
        let name = name_of(path);
        if name != "mod" && name != "lib" {
            let imports = neighbours(&fs::read_to_string(path).unwrap(), &beside);
            folders.entry(folder.to_owned()).or_default().insert(name, imports);
        }
    }
    let mut seen = 0;
    for (folder, mut open) in folders {
        seen += open.values().map(Vec::len).sum::<usize>();
        // Removes files that import no remaining file; a circle is never removed.
        loop {
            let left: Vec<String> = open.keys().cloned().collect();
            open.retain(|name, imports| imports.iter().any(|i| i != name && left.contains(i)));
            if open.len() == left.len() {
                break;
            }
        }
        assert!(open.is_empty(), "{}: a circle of {:?}", folder.display(), open.keys());
    }
    assert!(seen > 50, "only {seen} imports were found");
}

/// Longest function [lines].
const LONGEST: usize = 80;

/// Functions fit on a screen.
#[test]
fn no_function_is_too_long() {
    let mut files = Vec::new();
    sources(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut files);
    let (mut wrong, mut count) = (Vec::new(), 0);
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        for (k, line) in lines.iter().enumerate() {
            let code = line.trim_start();
            let before = code.split("fn ").next().unwrap_or_default();
            let words = ["pub", "pub(crate)", "pub(super)", "const", "unsafe", "extern", "\"C\""];
            let is_head =
                before.split_whitespace().all(|w| words.contains(&w) || w.starts_with("pub("));
            if !code.contains("fn ") || !is_head || code.ends_with(';') {
                continue;
            }
            let end = format!("{}}}", &line[..line.len() - code.len()]);
            let Some(length) = lines[k..].iter().position(|line| *line == end) else { continue };
            count += 1;
            if length + 1 > LONGEST {
                wrong.push(format!("{}:{}: {} lines", file.display(), k + 1, length + 1));
            }
        }
    }
    assert!(count > 3000, "{count}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
