//! Numbers as text, in groups, for the terminal and the page.

/// A group of numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Title of the group.
    pub title: String,
    /// Numbers of the group.
    pub rows: Vec<Row>,
}

/// A number as text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Name of the number.
    pub label: String,
    /// Value.
    pub value: String,
    /// Unit, perhaps with a prefix; empty for a ratio.
    pub unit: String,
}

impl Row {
    /// A count.
    pub(super) fn count(label: &str, value: f64) -> Self {
        Self { label: label.into(), value: grouped(value), unit: String::new() }
    }

    /// A number in other words.
    pub(super) fn text(label: &str, value: String, unit: &str) -> Self {
        Self { label: label.into(), value, unit: unit.into() }
    }

    /// A number in this unit, which may take a prefix; `None` without a value.
    pub(super) fn number(label: &str, value: Option<f64>, unit: &str) -> Option<Self> {
        let value = value?;
        let (value, unit) = match unit {
            "Pa" | "N" => prefixed(value, unit),
            "%" => (value * 100.0, "%".to_string()),
            _ => (value, unit.to_string()),
        };
        Some(Self { label: label.into(), value: readable(value), unit })
    }
}

/// The rows that have a value.
pub(super) fn rows<const N: usize>(rows: [Option<Row>; N]) -> Vec<Row> {
    rows.into_iter().flatten().collect()
}

/// The value with a unit prefix that leaves one to three digits before the point.
fn prefixed(value: f64, unit: &str) -> (f64, String) {
    let prefixes = [(1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ")];
    let fit = prefixes.iter().find(|(scale, _)| value.abs() >= *scale);
    let (scale, prefix) = if value == 0.0 { (1.0, "") } else { *fit.unwrap_or(&(1e-9, "n")) };
    (value / scale, format!("{prefix}{unit}"))
}

/// The value with four significant digits, with a power of ten if it is very large or small.
pub fn readable(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        return "0".into();
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.3e}");
    }
    let decimals = (3 - size.log10().floor() as i32).max(0) as usize;
    format!("{value:.decimals$}")
}

/// A count with separated thousands, and one half if there is one.
fn grouped(value: f64) -> String {
    let digits = (value.floor() as u64).to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{2009}');
        }
        out.push(digit);
    }
    if value.fract() != 0.0 {
        out.push_str(".5");
    }
    out
}
