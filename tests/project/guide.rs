//! The guide is true: its scenes can be read, its links lead somewhere, and its list of keys is complete.

use anyhow::Context;
use dem_mpi::cell::Cell;
use dem_mpi::output::table::Columns;
use dem_mpi::scene::{Scene, keys};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Pages of the book, without its table of contents.
fn pages() -> anyhow::Result<Vec<PathBuf>> {
    let mut pages = Vec::new();
    for entry in fs::read_dir("src/guide")? {
        let path = entry?.path();
        if path.extension().is_some_and(|e| e == "md") && !path.ends_with("SUMMARY.md") {
            pages.push(path);
        }
    }
    pages.sort();
    assert!(pages.len() >= 12, "{pages:?}");
    Ok(pages)
}

/// TOML blocks of a page.
fn scenes(page: &str) -> Vec<String> {
    let blocks = page.split("```toml\n").skip(1);
    blocks.map(|rest| rest.split("```").next().unwrap().to_owned()).collect()
}

/// Whether everything that a part says stands in the whole; of a list of tables each has its like there.
fn is_part(part: &Value, whole: &Value) -> bool {
    let is_table = |values: &[Value]| values.iter().all(Value::is_table) && !values.is_empty();
    match (part, whole) {
        (Value::Table(part), Value::Table(whole)) => part
            .iter()
            .all(|(key, value)| whole.get(key).is_some_and(|in_it| is_part(value, in_it))),
        (Value::Array(part), Value::Array(whole)) if is_table(part) => {
            part.iter().all(|value| whole.iter().any(|in_it| is_part(value, in_it)))
        }
        _ => part == whole,
    }
}

/// Completes a part of a scene with the other tables of the first scene.
fn completed(part: &str) -> anyhow::Result<String> {
    let mut scene: Table = fs::read_to_string("run/first/scene.toml")?.parse()?;
    let part: Table = part.parse()?;
    // Shapes of a part replace those of the first scene, and the fill then uses only its `ball`.
    if part.contains_key("shape") {
        scene.insert(
            "fill".to_owned(),
            Value::Table("lattice = [{ shapes = [\"ball\"] }]".parse()?),
        );
    }
    scene.extend(part.into_iter().filter(|(key, _)| key != "start"));
    Ok(toml::to_string(&scene)?)
}

#[test]
fn every_scene_of_the_guide_can_be_read() -> anyhow::Result<()> {
    let (mut count, mut parts) = (0, 0);
    for path in pages()? {
        for (k, block) in scenes(&fs::read_to_string(&path)?).iter().enumerate() {
            let name = format!("{}, block {k}", path.display());
            // A part of a ready scene, which is named above it.
            let first = block.lines().next().and_then(|line| line.strip_prefix("# "));
            if let Some(scene) =
                first.filter(|scene| Path::new(scene).extension().is_some_and(|e| e == "toml"))
            {
                let whole = fs::read_to_string(scene).with_context(|| name.clone())?;
                let whole = Value::Table(whole.parse::<Table>().with_context(|| name.clone())?);
                let part = Value::Table(block.parse::<Table>().with_context(|| name.clone())?);
                assert!(is_part(&part, &whole), "{name}: is not in {scene}");
                parts += 1;
                continue;
            }
            if block.contains("include =") || block.contains("like =") {
                // The included files or the earlier stage do not exist here.
                block.parse::<Table>().with_context(|| name)?;
                continue;
            }
            let text = if block.contains("[time]") { block.clone() } else { completed(block)? };
            Scene::parse(&text, &name, Path::new(""), &[]).with_context(|| name)?;
            count += 1;
        }
    }
    assert!(count >= 9 && parts >= 9, "{count} scenes, {parts} parts of ready ones");
    Ok(())
}

/// Decks of other codes in the guide are those that are run.
#[test]
fn decks_are_those_of_the_benchmarks() -> anyhow::Result<()> {
    let mut seen = 0;
    for path in pages()? {
        let text = fs::read_to_string(&path)?;
        let blocks = text.split("```text\n# benchmarks/").skip(1);
        for (name, block) in blocks.filter_map(|rest| rest.split("```").next()?.split_once('\n')) {
            let deck = fs::read_to_string(Path::new("benchmarks").join(name))?;
            let lines: Vec<_> = deck.lines().filter(|line| !line.starts_with('#')).collect();
            assert_eq!(block.lines().collect::<Vec<_>>(), lines, "{}: {name}", path.display());
            seen += 1;
        }
    }
    assert_eq!(seen, 2);
    Ok(())
}

/// Tables and keys of a scene file; nested tables have names like `fill.rain`.
fn named(table: &str, value: &Value, into: &mut BTreeSet<(String, String)>) {
    let all = match value {
        Value::Array(tables) => tables.iter().collect(),
        other => vec![other],
    };
    for entry in all.into_iter().filter_map(Value::as_table) {
        for (key, value) in entry {
            if table == "fill" {
                named(&format!("fill.{key}"), value, into);
            } else {
                into.insert((table.to_owned(), key.clone()));
            }
        }
    }
}

/// The list of keys contains all keys of the good scenes and, with exceptions below, no others.
#[test]
fn the_list_of_keys_is_that_of_scenes() -> anyhow::Result<()> {
    let mut used = BTreeSet::new();
    for entry in fs::read_dir("tests/scenes/good")? {
        let path = entry?.path();
        if path.extension().is_none_or(|e| e != "toml") {
            continue;
        }
        // The scene is valid, so every key in it is read.
        Scene::read(&path, &[]).with_context(|| path.display().to_string())?;
        let scene: Table = fs::read_to_string(&path)?.parse()?;
        for (key, value) in &scene {
            match value {
                Value::Table(_) => named(key, value, &mut used),
                Value::Array(list) if list.iter().any(Value::is_table) => {
                    named(key, value, &mut used);
                }
                _ => drop(used.insert((String::new(), key.clone()))),
            }
        }
    }
    let listed: BTreeSet<(String, String)> = keys::all()
        .into_iter()
        .flat_map(|row| row.names.into_iter().map(move |name| (row.table.clone(), name)))
        .collect();
    let unlisted: Vec<_> = used.difference(&listed).collect();
    // Interactions have constants that a material has, too.
    let unused = listed.difference(&used).filter(|(table, _)| table != "interaction");
    // The key `like` needs an earlier stage.
    let unused: Vec<_> = unused.filter(|(_, key)| key != "like").collect();
    assert!(
        unlisted.is_empty() && unused.is_empty(),
        "not listed: {unlisted:?}; in no scene: {unused:?}"
    );
    Ok(())
}

#[test]
fn keys_are_printed_by_table() {
    let domain = keys::text(Some("domain")).unwrap();
    assert!(domain.starts_with("[domain]\n") && domain.contains("\n  low [m]  "), "{domain}");
    assert_eq!(domain, keys::text(Some("[domain]")).unwrap());
    assert!(domain.lines().all(|line| line.chars().count() <= 110), "{domain}");
    let all = keys::text(None).unwrap();
    assert!(all.contains(&domain) && all.contains("\n[fill.file]\n"));
    assert!(!all.contains("crate::") && !all.contains('`'), "{all}");
    assert!(keys::text(Some("domains")).unwrap_err().contains("there are domain, cell, wall"));
}

/// Sentence openings that hide the subject are found neither on pages nor in comments.
#[test]
fn sentences_begin_with_their_subject() -> anyhow::Result<()> {
    const HIDDEN: [&str; 7] =
        ["What ", "Which ", "Whoever ", "Those of ", "That of ", "The same ", "Of "];
    let mut pages: Vec<PathBuf> = vec!["README.md".into(), "benchmarks/README.md".into()];
    pages.extend(self::pages()?);
    let mut wrong = Vec::new();
    for page in pages {
        let text = fs::read_to_string(&page)?;
        let prose = text.split("```").step_by(2).flat_map(str::lines);
        let prose = prose.filter(|line| !line.starts_with(['|', '#', '<']));
        for line in prose {
            let sentences = line.trim_start_matches(['*', '-', ' ']).split(". ");
            let hidden = sentences.filter(|s| HIDDEN.iter().any(|word| s.starts_with(word)));
            wrong.extend(hidden.map(|sentence| format!("{}: {sentence}", page.display())));
        }
    }
    let mut files = Vec::new();
    for folder in ["src", "tests", "benchmarks"] {
        super::layers::sources(Path::new(folder), &mut files);
    }
    assert!(files.len() > 400, "{}", files.len());
    for file in files {
        let text = fs::read_to_string(&file)?;
        for line in text.lines().map(str::trim_start).filter(|line| line.starts_with("//")) {
            let comment = line.trim_start_matches(['/', '!', ' ', '*', '-']);
            if HIDDEN.iter().any(|word| comment.starts_with(word)) {
                wrong.push(format!("{}: {comment}", file.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(())
}

/// Lines of a page outside its blocks of code.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut code = false;
    text.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        code ^= fence;
        !code && !fence
    })
}

/// A heading as an anchor, as mdBook and GitHub make it.
fn slug(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
    kept.flat_map(char::to_lowercase).map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// Anchors of a page: those of its headings.
fn anchors(text: &str) -> Vec<String> {
    let titles = prose(text).filter(|line| line.starts_with('#'));
    titles.map(|line| slug(line.trim_start_matches('#').trim())).collect()
}

/// Targets of the links and images of a line; code between backticks has none.
fn targets(line: &str) -> Vec<String> {
    let plain: String = line.split('`').step_by(2).collect::<Vec<_>>().join("code");
    let markdown = plain.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    let html = plain.split("src=\"").skip(1).filter_map(|rest| rest.split_once('"'));
    markdown.chain(html).map(|(target, _)| target.to_owned()).collect()
}

#[test]
fn links_lead_to_files_and_headings() -> anyhow::Result<()> {
    let mut files = pages()?;
    files.extend(["README.md", "benchmarks/README.md", "src/guide/SUMMARY.md"].map(PathBuf::from));
    for folder in ["run", "benchmarks", "benchmarks/records"] {
        for entry in fs::read_dir(folder)? {
            let page = entry?.path().join("README.md");
            files.extend(page.is_file().then_some(page));
        }
    }
    let mut seen = 0;
    let mut wrong = Vec::new();
    for file in files {
        let text = fs::read_to_string(&file)?;
        for target in prose(&text).flat_map(targets) {
            if target.contains("://") {
                continue;
            }
            seen += 1;
            let (path, anchor) = target.split_once('#').unwrap_or((&target, ""));
            let to = match path {
                "" => file.clone(),
                path => file.parent().unwrap().join(path),
            };
            let found = to.exists()
                && (anchor.is_empty()
                    || anchors(&fs::read_to_string(&to)?).iter().any(|a| a == anchor));
            if !found {
                wrong.push(format!("{}: {target}", file.display()));
            }
        }
    }
    assert!(seen > 100, "only {seen} links were found");
    assert!(wrong.is_empty(), "dead links:\n{}", wrong.join("\n"));
    Ok(())
}

/// The list of keys names pages of the book, as text for terminals.
#[test]
fn pages_that_keys_name_exist() -> anyhow::Result<()> {
    let keys = fs::read_to_string("src/scene/keys.md")?;
    assert!(!keys.contains("crate::guide"), "a page is named as (the book's page `walls.md`)");
    let named = keys.split("the book's page `").skip(1).filter_map(|rest| rest.split_once('`'));
    let named: BTreeSet<&str> = named.map(|(page, _)| page).collect();
    assert!(named.len() >= 5, "{named:?}");
    for page in named {
        assert!(Path::new("src/guide").join(page).is_file(), "{page}");
    }
    Ok(())
}

/// The table of contents has every page once, and each page begins with its title.
#[test]
fn the_table_of_contents_has_every_page_once() -> anyhow::Result<()> {
    let summary = fs::read_to_string("src/guide/SUMMARY.md")?;
    let mut listed: Vec<PathBuf> =
        summary.lines().flat_map(targets).map(|page| Path::new("src/guide").join(page)).collect();
    listed.sort();
    let pages = pages()?;
    assert_eq!(listed, pages);
    for page in pages {
        let text = fs::read_to_string(&page)?;
        assert!(text.starts_with("# "), "{}: no title", page.display());
        let titles = prose(&text).filter(|line| line.starts_with("# ")).count();
        assert_eq!(titles, 1, "{}: titles", page.display());
    }
    Ok(())
}

/// The page of `history.csv` has each column of a run without walls.
#[test]
fn columns_of_the_history_have_a_page() -> anyhow::Result<()> {
    let page = fs::read_to_string("src/guide/history.md")?;
    let names = Columns::of(&[], Cell::OPEN).names(&[], &[]);
    let missing: Vec<_> =
        names.iter().filter(|name| !page.contains(&format!("`{name}`"))).collect();
    assert!(missing.is_empty(), "{missing:?}");
    Ok(())
}
