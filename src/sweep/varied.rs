//! Values of a sweep: `--vary path.to.key=value,value`, a list of overrides for each run.

use std::collections::BTreeSet;

/// Largest number of runs; more are probably a typing error.
const MOST_RUNS: usize = 10_000;
/// Longer names of folders are cut, and numbered [bytes].
const LONGEST_NAME: usize = 150;

/// A key of the scene and its values.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Varied {
    /// Its path, as in `--set`.
    pub key: String,
    /// Values in TOML notation.
    pub values: Vec<String>,
}

/// One run of a sweep.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Combination {
    /// The name of its folder.
    pub name: String,
    /// Value of each varied key, in the order of the options.
    pub values: Vec<String>,
}

impl Varied {
    /// Reads `path.to.key=1,2,3`, or `seed=1..3`, both ends included.
    ///
    /// # Errors
    /// Cause.
    pub fn parse(text: &str) -> Result<Self, String> {
        const WANTED: &str =
            "give a key and its values, as in material.glass.friction=0.1,0.3 or seed=1..3";
        let (key, list) = text.split_once('=').ok_or(WANTED)?;
        let values = match range(list) {
            Some(values) => values?,
            None => split(list),
        };
        let key = key.trim();
        if key.is_empty() || values.iter().any(String::is_empty) {
            return Err(format!("a value is empty: {WANTED}"));
        }
        if key == "output.directory" || key == "output" {
            return Err("each run has a folder of its own in that of --out".to_owned());
        }
        let different: BTreeSet<&String> = values.iter().collect();
        if different.len() < values.len() {
            return Err("a value stands there twice".to_owned());
        }
        Ok(Self { key: key.to_owned(), values })
    }

    /// Are its values repetitions of one run?
    pub fn is_seed(&self) -> bool {
        self.short() == "seed"
    }

    /// The last part of its path.
    fn short(&self) -> &str {
        self.key.rsplit('.').next().unwrap_or_default()
    }
}

/// Whole numbers of a range like `1..3`; `None` for other texts.
fn range(list: &str) -> Option<Result<Vec<String>, String>> {
    let (first, last) = list.split_once("..")?;
    let (first, last): (i64, i64) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
    if first > last {
        return Some(Err(format!("the range {first}..{last} is empty")));
    }
    if last.abs_diff(first) >= MOST_RUNS as u64 {
        return Some(Err(format!("the range {first}..{last} has more than {MOST_RUNS} values")));
    }
    Some(Ok((first..=last).map(|number| number.to_string()).collect()))
}

/// Parts between commas outside of brackets and quotes.
fn split(list: &str) -> Vec<String> {
    let (mut parts, mut depth, mut quote) = (vec![String::new()], 0_i64, None);
    for c in list.chars() {
        match (c, quote) {
            (c, Some(open)) if c == open => quote = None,
            ('"' | '\'', None) => quote = Some(c),
            ('[' | '{', None) => depth += 1,
            (']' | '}', None) => depth -= 1,
            (',', None) if depth == 0 => {
                parts.push(String::new());
                continue;
            }
            _ => {}
        }
        if let Some(part) = parts.last_mut() {
            part.push(c);
        }
    }
    parts.iter().map(|part| part.trim().to_owned()).collect()
}

/// All combinations, the last key fastest.
///
/// # Errors
/// If a key occurs twice, or there are too many combinations.
pub fn combinations(all: &[Varied]) -> Result<Vec<Combination>, String> {
    let keys: BTreeSet<&String> = all.iter().map(|varied| &varied.key).collect();
    if let (true, Some(twice)) = (
        keys.len() < all.len(),
        all.iter().find(|a| all.iter().filter(|b| b.key == a.key).count() > 1),
    ) {
        return Err(format!("--vary {}: the key stands there twice", twice.key));
    }
    let count =
        all.iter().try_fold(1_usize, |count, varied| count.checked_mul(varied.values.len()));
    let count = count.filter(|count| *count <= MOST_RUNS);
    let count = count.ok_or_else(|| format!("there are more than {MOST_RUNS} combinations"))?;
    let short: BTreeSet<&str> = all.iter().map(Varied::short).collect();
    let is_short = short.len() == all.len();
    let mut names = BTreeSet::new();
    let combination = |number: usize| {
        let mut rest = number;
        let mut values: Vec<&String> = Vec::new();
        for varied in all.iter().rev() {
            values.push(&varied.values[rest % varied.values.len()]);
            rest /= varied.values.len();
        }
        values.reverse();
        let parts = all.iter().zip(&values).map(|(varied, value)| {
            let key = if is_short { varied.short() } else { &varied.key };
            format!("{key}={}", plain(value))
        });
        let mut name = plain(&parts.collect::<Vec<_>>().join("_"));
        if name.len() > LONGEST_NAME || !names.insert(name.clone()) {
            name.truncate(LONGEST_NAME);
            name = format!("{name}-{number}");
        }
        Combination { name, values: values.into_iter().cloned().collect() }
    };
    Ok((0..count).map(combination).collect())
}

/// A text in characters that every file system and shell accepts in names.
fn plain(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-+=.,".contains(c);
    text.chars()
        .filter(|c| !"\"' []{}".contains(*c))
        .map(|c| if is_plain(c) { c } else { '_' })
        .collect()
}
