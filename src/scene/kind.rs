//! Allowed values of a scene, in the notation of the table of keys: `number > 0`, `[x, y, z]`,
//! `number > 0 or "auto"`.

use std::fmt;

/// Allowed values of a key.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    /// A finite number.
    Number(Range),
    /// A whole number, at least this large.
    Whole(u64),
    Boolean,
    /// A text that is not empty.
    Text,
    /// Path of a file, relative to the scene's folder.
    File,
    /// One of these words.
    Words(Vec<String>),
    /// One item per name; without names at least `least` items.
    List {
        names: Vec<String>,
        least: usize,
        item: Box<Kind>,
    },
    /// A table with these keys.
    Table(Keys),
    /// A table whose keys are free names, at least one.
    Named(Box<Kind>),
    Either(Vec<Kind>),
}

/// The keys of a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Keys {
    /// Name in the file, like `fill.rain`; empty at the top, `None` within a value.
    pub(super) table: Option<String>,
    pub(super) all: Vec<Key>,
    /// Sets of keys that go together, each with its required keys, if not all of them do.
    pub(super) ways: Vec<Keys>,
}

/// A key and its value.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Key {
    pub(super) name: String,
    /// Unit of its numbers, or empty.
    pub(super) unit: String,
    pub(super) kind: Kind,
    pub(super) required: bool,
    /// Meaning, after its unit; empty within a value.
    pub(super) meaning: String,
}

impl Keys {
    pub(super) fn find(&self, name: &str) -> Option<&Key> {
        self.all.iter().find(|key| key.name == name)
    }

    /// All keys of the ways, none of which is required.
    fn of_ways(ways: Vec<Self>) -> Self {
        let mut all: Vec<Key> = Vec::new();
        for key in ways.iter().flat_map(|way| &way.all) {
            if all.iter().all(|known| known.name != key.name) {
                all.push(Key { required: false, ..key.clone() });
            }
        }
        Self { all, ways, ..Self::default() }
    }
}

/// Allowed numbers: an interval, with or without its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Range {
    pub(super) least: f64,
    pub(super) above: bool,
    pub(super) most: f64,
    pub(super) below: bool,
}

impl Range {
    const ANY: Self =
        Self { least: f64::NEG_INFINITY, above: true, most: f64::INFINITY, below: true };

    pub(super) fn holds(&self, x: f64) -> bool {
        (if self.above { x > self.least } else { x >= self.least })
            && (if self.below { x < self.most } else { x <= self.most })
    }
}

// --- from the table ---

impl Kind {
    /// Parses a cell of the table, which may hold several kinds, separated by semicolons; `unit` is that of the
    /// numbers.
    pub(super) fn parse(cell: &str, unit: &str) -> Self {
        let mut parser = Parser { rest: cell, unit };
        let kind = parser.kind();
        assert!(parser.rest.trim().is_empty(), "keys.md: `{cell}` ends at `{}`", parser.rest);
        kind
    }
}

struct Parser<'a> {
    rest: &'a str,
    unit: &'a str,
}

impl<'a> Parser<'a> {
    fn eat(&mut self, token: &str) -> bool {
        let rest = self.rest.trim_start().strip_prefix(token);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    fn expect(&mut self, token: &str) {
        assert!(self.eat(token), "keys.md: no `{token}` before `{}`", self.rest);
    }

    /// Text before a mark; the mark is skipped.
    fn until(&mut self, mark: char) -> &'a str {
        let (before, rest) = self.rest.split_once(mark).expect("keys.md closes what it opens");
        self.rest = rest;
        before.trim()
    }

    fn number(&mut self) -> Option<f64> {
        let rest = self.rest.trim_start();
        let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        let number = rest[..end].parse().ok()?;
        self.rest = &rest[end..];
        Some(number)
    }

    fn kind(&mut self) -> Kind {
        let mut all = vec![self.one()];
        while self.eat("or ") {
            all.push(self.one());
        }
        if all.len() == 1 {
            return all.remove(0);
        }
        if all.iter().all(|kind| matches!(kind, Kind::Table(_))) {
            let keys = |kind| if let Kind::Table(keys) = kind { Some(keys) } else { None };
            return Kind::Table(Keys::of_ways(all.into_iter().filter_map(keys).collect()));
        }
        Kind::Either(all)
    }

    fn one(&mut self) -> Kind {
        if let Some(number) = self.number() {
            if self.eat("or more of ") {
                let item = Box::new(self.one());
                return Kind::List { names: Vec::new(), least: number as usize, item };
            }
            let above = !self.eat("<=");
            if above {
                self.expect("<");
            }
            self.expect("number");
            return Kind::Number(self.upper(Range { least: number, above, ..Range::ANY }));
        }
        match () {
            () if self.eat("number") => Kind::Number(self.lower()),
            () if self.eat("whole >=") => Kind::Whole(self.number().expect("a number") as u64),
            () if self.eat("true or false") => Kind::Boolean,
            () if self.eat("text") => Kind::Text,
            () if self.eat("file") => Kind::File,
            () if self.eat("list of ") => {
                Kind::List { names: Vec::new(), least: 0, item: Box::new(self.one()) }
            }
            () if self.eat("[") => {
                let names = self.until(']').split(", ").map(str::to_owned).collect();
                let item = if self.eat(", each ") { self.one() } else { Kind::Number(Range::ANY) };
                Kind::List { names, least: 0, item: Box::new(item) }
            }
            () if self.eat("{ NAME = ") => {
                let item = Box::new(self.kind());
                self.expect("}");
                Kind::Named(item)
            }
            () if self.eat("{") => Kind::Table(self.keys()),
            () => Kind::Words(self.words()),
        }
    }

    fn lower(&mut self) -> Range {
        let above = !self.eat(">=");
        if above && !self.eat(">") {
            return self.upper(Range::ANY);
        }
        Range { least: self.number().expect("a number"), above, ..Range::ANY }
    }

    fn upper(&mut self, range: Range) -> Range {
        let below = !self.eat("<=");
        if below && !self.eat("<") {
            return range;
        }
        Range { most: self.number().expect("a number"), below, ..range }
    }

    /// Words in quotes, with `or` between them.
    fn words(&mut self) -> Vec<String> {
        let mut words = Vec::new();
        self.expect("\"");
        loop {
            words.push(self.until('"').to_owned());
            if !self.eat("or \"") {
                return words;
            }
        }
    }

    /// Keys between braces: `name = kind [unit]`, with a question mark behind optional names.
    fn keys(&mut self) -> Keys {
        let mut keys = Keys::default();
        loop {
            let (names, required) = if self.rest.trim_start().starts_with('"') {
                (self.words(), false)
            } else {
                let rest = self.rest.trim_start();
                let end = rest.find([' ', '?']).expect("a name and what it may be");
                self.rest = &rest[end..];
                (vec![rest[..end].to_owned()], !self.eat("?"))
            };
            self.expect("=");
            let kind = self.kind();
            let unit = if self.eat("[") { self.until(']') } else { self.unit };
            keys.all.extend(names.into_iter().map(|name| Key {
                name,
                unit: unit.to_owned(),
                kind: kind.clone(),
                required,
                meaning: String::new(),
            }));
            if !self.eat(",") {
                self.expect("}");
                return keys;
            }
        }
    }
}

// --- in messages ---

/// Allowed values, with the unit of the numbers, for messages.
pub(super) struct Allowed<'a>(pub(super) &'a Kind, pub(super) &'a str);

impl fmt::Display for Allowed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(kind, unit) = self;
        match kind {
            Kind::Number(range) => match *unit {
                "" => range.fmt(f),
                unit => write!(f, "{range} [{unit}]"),
            },
            Kind::Whole(least) => write!(f, "a whole number, {least} or greater"),
            Kind::Boolean => f.write_str("true or false"),
            Kind::Text => f.write_str("a string"),
            Kind::File => f.write_str("the path of a file"),
            Kind::Words(words) => {
                let (last, others) = words.split_last().expect("a word");
                others.iter().try_for_each(|word| write!(f, "\"{word}\" or "))?;
                write!(f, "\"{last}\"")
            }
            Kind::List { names, least, item } => {
                match (&names[..], least) {
                    ([_, _], _) => write!(f, "a list of two: [{}]", names.join(", "))?,
                    ([_, ..], _) => write!(f, "a list of three: [{}]", names.join(", "))?,
                    ([], 0) => f.write_str("a list")?,
                    ([], 1) => f.write_str("a list of one or more")?,
                    ([], _) => f.write_str("a list of two or more")?,
                }
                write!(f, ", each {}", Allowed(item, unit))
            }
            Kind::Table(keys) if keys.all.len() < 4 && keys.ways.is_empty() => {
                let names: Vec<&str> = keys.all.iter().map(|key| &*key.name).collect();
                write!(f, "a table, {{ {} }}", names.join(", "))
            }
            Kind::Table(_) => f.write_str("a table, { key = value, ... }"),
            Kind::Named(item) => write!(f, "a table, {{ name = {}, ... }}", Allowed(item, unit)),
            Kind::Either(kinds) => {
                let all: Vec<String> =
                    kinds.iter().map(|kind| Allowed(kind, unit).to_string()).collect();
                f.write_str(&all.join(", or "))
            }
        }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { least, above, most, below } = self;
        match (least.is_finite(), most.is_finite()) {
            (false, _) => f.write_str("a finite number"),
            (true, false) if *above => write!(f, "a number greater than {least}"),
            (true, false) => write!(f, "a number, {least} or greater"),
            (true, true) if !above && !below => write!(f, "a number from {least} to {most}"),
            (true, true) => {
                let from = if *above { "greater than" } else { "not less than" };
                let to = if *below { "less than" } else { "at most" };
                write!(f, "a number {from} {least} and {to} {most}")
            }
        }
    }
}
