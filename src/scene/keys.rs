//! Keys of a scene file: one table, which the documentation of [`super`] shows. The reader, the JSON schema and the list
//! for the terminal are derived from it.

use super::kind::{Key, Keys, Kind};
use std::sync::LazyLock;

/// The table of the documentation: key, unit, kind, meaning.
const TABLE: &str = include_str!("keys.md");
/// Largest width of lines.
const WIDTH: usize = 110;
/// Column in which meanings begin.
const INDENT: usize = 30;

/// A row of the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Name in the file: `domain`, `fill.lattice`; empty at the top.
    pub table: String,
    /// Can there be several such tables, like `[[wall]]`?
    pub is_list: bool,
    /// Names, like `low`, `high`; empty in the row of a table itself.
    pub names: Vec<String>,
    /// Unit, or empty; one for all names, or one for each, separated by commas.
    pub unit: String,
    /// Allowed values, and whether they are required; one for all names, or one for each, separated by semicolons.
    pub kind: String,
    /// Meaning and default.
    pub meaning: String,
}

/// All rows, in the order of the list.
pub fn all() -> Vec<Row> {
    let (mut table, mut is_list) = (String::new(), false);
    let rows = TABLE.lines().skip(2).map(|row| {
        let mut cells = row.trim_matches('|').splitn(4, '|').map(str::trim);
        let [key, unit, kind, meaning] = [(); 4].map(|()| cells.next().unwrap_or_default());
        let mut names = quoted(key);
        if key.starts_with("**") {
            names[0].trim_matches(['[', ']']).clone_into(&mut table);
            is_list = names[0].starts_with("[[");
            names.clear();
        }
        let [unit, kind] = [unit, kind].map(str::to_owned);
        Row { table: table.clone(), is_list, names, unit, kind, meaning: plain(meaning) }
    });
    rows.collect()
}

/// Allowed content of a scene: the tree of the rows.
pub(super) static SCENE: LazyLock<Kind> = LazyLock::new(|| {
    let rows = all();
    let mut tables: Vec<(&Row, Keys)> = Vec::new();
    for rows in rows.chunk_by(|a, b| a.table == b.table) {
        tables.push((&rows[0], keys_of(rows, &tables)));
    }
    let key = |name: &str, kind: Kind| Key {
        name: name.to_owned(),
        unit: String::new(),
        kind,
        required: false,
        meaning: String::new(),
    };
    let mut root = tables.remove(0).1;
    let mut fill = Keys { table: Some("fill".to_owned()), ..Keys::default() };
    for (row, keys) in tables {
        let (into, name) = match row.table.strip_prefix("fill.") {
            Some(name) => (&mut fill, name),
            None => (&mut root, &*row.table),
        };
        let (table, names) = (Kind::Table(keys), Vec::new());
        let kind =
            if row.is_list { Kind::List { names, least: 0, item: Box::new(table) } } else { table };
        let required = row.kind == "required";
        into.all.push(Key { required, meaning: row.meaning.clone(), ..key(name, kind) });
    }
    root.all.push(key("fill", Kind::Table(fill)));
    Kind::Table(root)
});

/// Keys in the rows of a table; some refer to earlier tables.
fn keys_of(rows: &[Row], tables: &[(&Row, Keys)]) -> Keys {
    let mut keys = Keys { table: Some(rows[0].table.clone()), ..Keys::default() };
    for row in rows {
        let (required, kind) =
            row.kind.strip_prefix("required: ").map_or((false, &*row.kind), |kind| (true, kind));
        for (k, name) in row.names.iter().enumerate() {
            let unit = of_name(&row.unit, ", ", k, row).trim_start_matches('-');
            let key = if let Some(table) = kind.strip_prefix("as in ") {
                let other = tables.iter().find(|(_, keys)| keys.table.as_deref() == Some(table));
                let other = other.and_then(|(_, keys)| keys.find(name)).cloned();
                other.expect("keys.md lists before what it refers to")
            } else {
                let kind = Kind::parse(of_name(kind, "; ", k, row), unit);
                let meaning = described(unit, &row.meaning);
                Key { name: name.clone(), unit: unit.to_owned(), kind, required, meaning }
            };
            // A key of two kinds of shape has two rows.
            match keys.all.iter_mut().find(|known| known.name == *name) {
                Some(known) => {
                    debug_assert_eq!((&known.kind, &known.unit), (&key.kind, &key.unit), "{name}");
                    known.meaning = format!("{}. Or: {}", known.meaning, key.meaning);
                }
                None => keys.all.push(key),
            }
        }
    }
    keys
}

/// Part of a cell for one of several names, if each has a separate part.
fn of_name<'a>(cell: &'a str, between: &str, name: usize, row: &Row) -> &'a str {
    let parts: Vec<&str> = cell.split(between).collect();
    if parts.len() == row.names.len() { parts[name] } else { cell }
}

/// Unit and meaning.
fn described(unit: &str, meaning: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!("[{unit}] ") };
    format!("{unit}{meaning}").trim_end().to_owned()
}

/// The list of one table, or of all, as text.
///
/// # Errors
/// If there is no such table; the text lists the tables.
pub fn text(table: Option<&str>) -> Result<String, String> {
    let (mut text, mut before) = (String::new(), None);
    let asked = table.map(|name| name.trim_matches(['[', ']']));
    let rows = all();
    for row in rows.iter().filter(|row| asked.is_none_or(|asked| asked == row.table)) {
        if before != Some(&row.table) && !row.table.is_empty() {
            text.extend(["\n[", &row.table, "]\n"]);
        }
        before = Some(&row.table);
        let Row { names, kind, meaning, .. } = row;
        let said = [&**kind, meaning].into_iter().filter(|said| !said.is_empty());
        let said = said.collect::<Vec<_>>().join("; ");
        if said.is_empty() {
            continue;
        }
        let unit = if row.unit.is_empty() { String::new() } else { format!(" [{}]", row.unit) };
        let mut line = format!("  {}{unit}", names.join(", "));
        if line.len() + 2 > INDENT {
            text += &line;
            text.push('\n');
            line.clear();
        }
        line = format!("{line:INDENT$}");
        for word in said.split(' ') {
            if line.len() + word.len() > WIDTH && line.len() > INDENT {
                text += line.trim_end();
                text.push('\n');
                line = " ".repeat(INDENT);
            }
            line += word;
            line.push(' ');
        }
        text += line.trim_end();
        text.push('\n');
    }
    if text.is_empty() {
        let mut tables: Vec<&str> = rows.iter().map(|row| &*row.table).collect();
        tables.dedup();
        return Err(format!(
            "--keys {}: no such table; there are {}",
            table.unwrap_or_default(),
            tables[1..].join(", ")
        ));
    }
    Ok(text.trim_start_matches('\n').to_owned())
}

/// The words between backticks.
fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Text without Markdown and without names of modules, which have no use in a terminal.
fn plain(cell: &str) -> String {
    let mut text = cell.to_owned();
    while let Some(begin) = text.find(" ([`") {
        let end = text[begin..].find("`])").map_or(text.len(), |end| begin + end + 3);
        text.replace_range(begin..end, "");
    }
    text.replace("**", "").replace('`', "")
}
