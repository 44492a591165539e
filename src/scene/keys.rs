//! The keys of a scene file, as the documentation of [`super`] lists them, for the terminal.

/// The table of the documentation: key, unit, meaning.
const TABLE: &str = include_str!("keys.md");
/// No line is longer.
const WIDTH: usize = 110;
/// Where meanings begin.
const INDENT: usize = 30;

/// A row of the list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    /// As it stands in the file: `domain`, `fill.lattice`; empty at the top.
    pub table: String,
    /// There may be several such tables: `[[wall]]`.
    pub is_list: bool,
    /// `low`, `high`; none in the row of a table itself and in a row that goes on.
    pub names: Vec<String>,
    /// Unit, or empty.
    pub unit: String,
    /// What it means, and its default.
    pub meaning: String,
}

/// All rows, in the order of the list.
pub fn all() -> Vec<Key> {
    let (mut table, mut is_list) = (String::new(), false);
    let rows = TABLE.lines().skip(2).map(|row| {
        let mut cells = row.trim_matches('|').splitn(3, '|').map(str::trim);
        let [key, unit, meaning] = [(); 3].map(|()| cells.next().unwrap_or_default());
        let names = quoted(key);
        let is_table = key.starts_with("**");
        if is_table {
            names[0].trim_matches(['[', ']']).clone_into(&mut table);
            is_list = names[0].starts_with("[[");
        }
        let names = if is_table { Vec::new() } else { names };
        Key { table: table.clone(), is_list, names, unit: unit.to_owned(), meaning: plain(meaning) }
    });
    rows.collect()
}

/// The list of one table, or of all, as text.
///
/// # Errors
/// No such table: what there is.
pub fn text(table: Option<&str>) -> Result<String, String> {
    let (mut text, mut before) = (String::new(), None);
    let asked = table.map(|name| name.trim_matches(['[', ']']));
    for key in all().iter().filter(|key| asked.is_none_or(|asked| asked == key.table)) {
        if before != Some(&key.table) && !key.table.is_empty() {
            text.extend(["\n[", &key.table, "]\n"]);
        }
        before = Some(&key.table);
        if key.names.is_empty() && key.meaning.is_empty() {
            continue;
        }
        let unit = if key.unit.is_empty() { String::new() } else { format!(" [{}]", key.unit) };
        let mut line = format!("  {}{unit}", key.names.join(", "));
        if line.len() + 2 > INDENT && !key.meaning.is_empty() {
            text += &line;
            text.push('\n');
            line.clear();
        }
        line = format!("{line:INDENT$}");
        for word in key.meaning.split(' ') {
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
        let mut tables: Vec<String> = all().into_iter().map(|key| key.table).collect();
        tables.dedup();
        let tables = tables.into_iter().filter(|name| !name.is_empty()).collect::<Vec<_>>();
        return Err(format!(
            "--keys {}: no such table; there are {}",
            table.unwrap_or_default(),
            tables.join(", ")
        ));
    }
    Ok(text.trim_start_matches('\n').to_owned())
}

/// The words between backticks.
fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Without the marks of Markdown, and without the names of modules, which a terminal cannot follow.
fn plain(cell: &str) -> String {
    let mut text = cell.to_owned();
    while let Some(begin) = text.find(" ([`") {
        let end = text[begin..].find("`])").map_or(text.len(), |end| begin + end + 3);
        text.replace_range(begin..end, "");
    }
    text.replace("**", "").replace('`', "")
}
