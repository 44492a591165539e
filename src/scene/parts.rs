//! Parts of a scene from elsewhere: included files, and the scene of the previous stage.
//!
//! The values of a scene override those of its parts. Tables are merged key by key, lists of named tables by these names;
//! every other value is replaced.

use super::before;
use super::form;
use super::input::{self, Node, Table, Value};
use super::keys::SCENE;
use super::kind::{Keys, Kind};
use super::mistakes::{Location, Mistakes};
use super::reader::Given;
use crate::text as files;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest depth of nested includes.
const DEEPEST: usize = 16;
/// Largest number of files of one scene.
const MOST_FILES: usize = 100;

/// Keys that `like` takes: places, properties and contacts of particles.
const TAKEN: [&str; 8] =
    ["domain", "gravity", "material", "interaction", "shape", "wall", "contact", "law"];

/// Files named by a scene that must exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Need<'a> {
    AllFiles,
    /// All but the snapshot from which the stage began: it continues from this one.
    Snapshot(&'a Path),
}

/// A scene with all its parts.
pub(super) struct Whole {
    pub(super) root: Node,
    /// Folder of the files that it names.
    pub(super) folder: PathBuf,
    /// The scene as a text that needs no other one.
    pub(super) text: String,
}

/// Reads a scene and its parts, and applies the overrides; `None` if one of the texts is not available.
pub(super) fn read(
    text: &str,
    (file, folder): (&str, &Path),
    overrides: &[String],
    need: Need,
    mistakes: &Mistakes,
) -> Option<Whole> {
    let root = input::read(text, &Location::Line, mistakes)?;
    let mut files =
        Files { open: vec![(file.to_owned(), folder.join(file_name(file)))], count: 0, mistakes };
    let (mut root, includes) = files.with_included(root, folder)?;
    let is_like = like(&mut root, folder, overrides, need, mistakes)?;
    input::apply_all(&mut root, overrides, mistakes);
    remove(&mut root, "like");
    if let Some(given) = given(&root, "include", mistakes) {
        given.fail("must be in a file, not an override");
    }
    let own = folder_of(&root, mistakes);
    let beside = own.clone().unwrap_or_else(|| folder.to_owned());
    let mut lines = String::new();
    if own.is_none() && names_files(&root.value, &SCENE) {
        let folder = if beside == Path::new("") { Path::new(".") } else { &*beside };
        lines = format!("folder = {}\n", toml::Value::from(folder.display().to_string()));
    }
    let is_as_written = overrides.is_empty() && !includes && !is_like;
    lines += &if is_as_written { text.to_owned() } else { input::to_text(&root) };
    Some(Whole { root, folder: beside, text: lines })
}

fn file_name(file: &str) -> &Path {
    Path::new(Path::new(file).file_name().unwrap_or_default())
}

/// The value of a key at the top.
fn given<'a>(root: &'a Node, key: &str, mistakes: &'a Mistakes) -> Option<Given<'a>> {
    Given::root(root, mistakes).section()?.get(key)
}

/// Folder of files that the scene sets itself.
fn folder_of(root: &Node, mistakes: &Mistakes) -> Option<PathBuf> {
    given(root, "folder", mistakes)?.text().map(PathBuf::from)
}

fn remove(root: &mut Node, key: &str) {
    if let Value::Table(table) = &mut root.value {
        table.remove(key);
    }
}

// --- include ---

/// Files that are being read.
struct Files<'a> {
    /// Nested files, with their names in messages and their paths.
    open: Vec<(String, PathBuf)>,
    count: usize,
    mistakes: &'a Mistakes,
}

impl Files<'_> {
    /// A file merged with its includes, and whether it has any. Paths are relative to its folder.
    fn with_included(&mut self, mut root: Node, folder: &Path) -> Option<(Node, bool)> {
        let Some(include) = given(&root, "include", self.mistakes) else {
            return Some((root, false));
        };
        let before = self.mistakes.count();
        form::check(&include);
        if self.mistakes.count() > before {
            return None;
        }
        let all = include.list().unwrap_or_else(|| vec![include.clone()]);
        let mut base = Node { value: Value::Table(Table::new()), location: Location::File };
        for given in all {
            let mut part = self.included(&given, folder)?;
            let parent = Path::new(given.text()?).parent().map(Path::to_owned).unwrap_or_default();
            let beside = folder_of(&part, self.mistakes).map_or(parent, |own| absolute(&own));
            rebase(&mut part.value, &SCENE, &beside);
            remove(&mut part, "folder");
            merge(&mut base, part);
        }
        remove(&mut root, "include");
        merge(&mut base, root);
        Some((base, true))
    }

    /// One included file.
    fn included(&mut self, given: &Given, folder: &Path) -> Option<Node> {
        let path = folder.join(given.text()?);
        let name = files::shown(path.display());
        self.count += 1;
        if self.open.len() > DEEPEST || self.count > MOST_FILES {
            given.fail(format!(
                "exceeds the limit: a scene has at most {MOST_FILES} files, nested {DEEPEST} deep"
            ));
            return None;
        }
        let is_open = |(_, open): &(String, PathBuf)| is_one_file(open, &path);
        if let Some(first) = self.open.iter().position(is_open) {
            let circle: Vec<&str> = self.open[first..].iter().map(|(name, _)| &**name).collect();
            given.fail(format!("is circular: {} includes {name}", circle.join(" includes ")));
            return None;
        }
        let text =
            files::read(&path).map_err(|error| given.fail(format!("{name} {error}"))).ok()?;
        let file: Arc<str> = name.as_str().into();
        let part =
            input::read(&text, &|line| Location::In(Arc::clone(&file), line), self.mistakes)?;
        self.open.push((name, path.clone()));
        let part = self.with_included(part, path.parent().unwrap_or(Path::new("")));
        self.open.pop();
        part.map(|(part, _)| part)
    }
}

fn is_one_file(a: &Path, b: &Path) -> bool {
    a == b || a.canonicalize().ok().is_some_and(|a| Some(a) == b.canonicalize().ok())
}

/// Overrides the values of one scene by those of another.
fn merge(base: &mut Node, over: Node) {
    merge_values(base, over, Some(&SCENE));
}

fn merge_tables(base: &mut Table, over: Table, keys: &Keys) {
    for (name, over) in over {
        let kind = keys.find(&name).map(|key| &key.kind);
        match base.get_mut(&name) {
            Some(base) => merge_values(base, over, kind),
            None => drop(base.insert(name, over)),
        }
    }
}

/// Merges values of a kind, if the key is known.
fn merge_values(base: &mut Node, over: Node, kind: Option<&Kind>) {
    match (&mut base.value, over.value, kind) {
        (Value::Table(base), Value::Table(over), Some(Kind::Table(keys)))
            if keys.table.is_some() =>
        {
            merge_tables(base, over, keys);
        }
        (Value::List(base), Value::List(over), Some(Kind::List { item: kind, .. }))
            if has_names(base) && has_names(&over) =>
        {
            for over in over {
                let is_it = |base: &&mut Node| name_of(base) == name_of(&over);
                match base.iter_mut().find(is_it) {
                    Some(base) => merge_values(base, over, Some(kind)),
                    None => base.push(over),
                }
            }
        }
        (base, over, _) => *base = over,
    }
    base.location = over.location;
}

fn name_of(node: &Node) -> Option<&str> {
    match &node.value {
        Value::Table(table) => match &table.get("name")?.value {
            Value::Text(name) => Some(name),
            _ => None,
        },
        _ => None,
    }
}

fn has_names(list: &[Node]) -> bool {
    !list.is_empty() && list.iter().all(|node| name_of(node).is_some())
}

// --- paths ---

/// Prefixes the paths of files with a folder.
fn rebase(value: &mut Value, kind: &Kind, folder: &Path) {
    match (value, kind) {
        (Value::Text(path), Kind::File) => *path = folder.join(&**path).display().to_string(),
        (Value::Table(table), Kind::Table(keys)) => {
            for (name, node) in table {
                if let Some(key) = keys.find(name) {
                    rebase(&mut node.value, &key.kind, folder);
                }
            }
        }
        (Value::List(items), Kind::List { item, .. }) => {
            for node in items {
                rebase(&mut node.value, item, folder);
            }
        }
        _ => {}
    }
}

/// Absolute path of a folder.
fn absolute(folder: &Path) -> PathBuf {
    std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned())
}

/// Does the value name a file?
fn names_files(value: &Value, kind: &Kind) -> bool {
    match (value, kind) {
        (Value::Text(_), Kind::File) => true,
        (Value::Table(table), Kind::Table(keys)) => table.iter().any(|(name, node)| {
            keys.find(name).is_some_and(|key| names_files(&node.value, &key.kind))
        }),
        (Value::List(items), Kind::List { item, .. }) => {
            items.iter().any(|node| names_files(&node.value, item))
        }
        _ => false,
    }
}

// --- like ---

/// Merges the scene of the previous stage, if this one requests it; `None` if that fails.
fn like(
    root: &mut Node,
    folder: &Path,
    overrides: &[String],
    need: Need,
    mistakes: &Mistakes,
) -> Option<bool> {
    // Errors in overrides are reported where they are applied.
    let mut changed = root.clone();
    input::apply_all(&mut changed, overrides, &Mistakes::default());
    let Some(like) = given(&changed, "like", mistakes) else { return Some(false) };
    let before = mistakes.count();
    form::check(&like);
    if mistakes.count() > before {
        return None;
    }
    let start = given(&changed, "start", mistakes);
    let Some(start) = start else {
        like.fail("needs `start`, the snapshot with the scene to use");
        return None;
    };
    let snapshot = match need {
        Need::AllFiles => PathBuf::from(start.text()?),
        // Its own snapshot has these parts already.
        Need::Snapshot(own) => own.to_owned(),
    };
    let scene = before::scene(&snapshot).map_err(|error| like.fail(error)).ok()?;
    if scene.is_empty() {
        like.fail(format!("{} has no scene", snapshot.display()));
        return None;
    }
    let file: Arc<str> = format!("the scene in {}", snapshot.display()).into();
    let mut base = input::read(&scene, &|line| Location::In(Arc::clone(&file), line), mistakes)?;
    let beside = folder_of(&base, mistakes);
    let own = folder_of(&changed, mistakes).unwrap_or_else(|| folder.to_owned());
    if let Value::Table(table) = &mut base.value {
        table.retain(|key, _| TAKEN.contains(&&**key));
    }
    if let Some(beside) = beside.filter(|beside| *beside != own) {
        rebase(&mut base.value, &SCENE, &absolute(&beside));
    }
    std::mem::swap(root, &mut base);
    merge(root, base);
    Some(true)
}
