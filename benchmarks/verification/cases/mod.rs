//! Published cases and closed forms, each with the published number and that of this program. The command
//! `verification` runs all of them; the tests run the short ones.
//!
//! To add a source, write a file with a function `run(effort) -> Findings` and name it in [`sources`].

pub(crate) mod arch;
pub(crate) mod balance;
mod ball;
pub(crate) mod chung_ooi;
pub(crate) mod convergence;
mod decks;
pub(crate) mod dominoes;
pub(crate) mod elastic;
pub(crate) mod elliptic;
pub(crate) mod faces;
pub(crate) mod free_motion;
pub(crate) mod incline;
pub(crate) mod lammps;
pub(crate) mod mfix;
pub(crate) mod moving_walls;
pub(crate) mod other_codes;
pub(crate) mod packing;
mod setup;
pub(crate) mod shear;
pub(crate) mod steps;
pub(crate) mod sticking;
pub(crate) mod unequal;
pub(crate) mod unions;
mod ways;

pub(crate) use ball::{Ball, Throw};
pub(crate) use setup::{Body, Frame, Grain, Plane, Setup, least_squares};
pub(crate) use ways::Ways;

/// Extent of the verification.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Effort {
    /// For the tests: seconds.
    Quick,
    /// For the record: minutes.
    Full,
}

impl Effort {
    /// Selects one of two values.
    pub(crate) fn pick<T>(self, quick: T, full: T) -> T {
        match self {
            Self::Quick => quick,
            Self::Full => full,
        }
    }
}

/// A comparison of a known number with that of the program.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    /// Name of the sub-case.
    pub(crate) what: String,
    /// Published number, or that of the closed form.
    pub(crate) published: f64,
    /// Number of this program.
    pub(crate) own: f64,
    /// Scale of the difference.
    pub(crate) scale: f64,
}

impl Row {
    /// The difference over the scale; infinite if it is not a number, so that it is the worst.
    pub(crate) fn deviation(&self) -> f64 {
        let deviation = (self.own - self.published).abs() / self.scale;
        if deviation.is_nan() { f64::INFINITY } else { deviation }
    }
}

/// A case with all its sub-cases.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    /// Paper, or test of a code.
    pub(crate) source: &'static str,
    /// Name of the simulated system.
    pub(crate) name: String,
    /// Compared quantity, with its unit.
    pub(crate) quantity: String,
    /// Largest accepted deviation.
    pub(crate) tolerance: f64,
    /// Reason why the tolerance is not smaller.
    pub(crate) reason: String,
    /// Sub-cases.
    pub(crate) rows: Vec<Row>,
    /// Reason why the program cannot fulfil the case yet, if it is known.
    pub(crate) short_until: Option<&'static str>,
}

/// Result of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Within the tolerance.
    Holds,
    /// Outside the tolerance, as is known.
    FallsShort,
    /// Outside the tolerance for an unknown reason.
    Fails,
    /// Within the tolerance although it is marked as falling short: the mark is out of date.
    HoldsNow,
}

impl Verdict {
    /// Name in tables.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::FallsShort => "falls short",
            Self::Fails => "FAILS",
            Self::HoldsNow => "HOLDS, though it is said to fall short",
        }
    }

    /// Whether the result is the expected one.
    pub(crate) fn is_expected(self) -> bool {
        matches!(self, Self::Holds | Self::FallsShort)
    }
}

impl Case {
    /// A case without sub-cases.
    pub(crate) fn new(
        source: &'static str,
        name: impl Into<String>,
        quantity: impl Into<String>,
        tolerance: f64,
        reason: impl Into<String>,
    ) -> Self {
        Self {
            source,
            name: name.into(),
            quantity: quantity.into(),
            tolerance,
            reason: reason.into(),
            rows: Vec::new(),
            short_until: None,
        }
    }

    /// Adds a sub-case whose deviation is relative to the published number.
    pub(crate) fn relative(&mut self, what: impl Into<String>, published: f64, own: f64) {
        self.over(published.abs(), what, published, own);
    }

    /// Adds a sub-case whose deviation is the difference itself.
    pub(crate) fn absolute(&mut self, what: impl Into<String>, published: f64, own: f64) {
        self.over(1.0, what, published, own);
    }

    /// Adds a sub-case whose difference is divided by `scale`.
    pub(crate) fn over(&mut self, scale: f64, what: impl Into<String>, published: f64, own: f64) {
        self.rows.push(Row { what: what.into(), published, own, scale });
    }

    /// The sub-case with the largest deviation.
    pub(crate) fn worst(&self) -> &Row {
        let larger = |a: &&Row, b: &&Row| a.deviation().total_cmp(&b.deviation());
        self.rows.iter().max_by(larger).expect("a case has sub-cases")
    }

    /// Compares the worst sub-case with the tolerance.
    pub(crate) fn verdict(&self) -> Verdict {
        let holds = self.worst().deviation() <= self.tolerance;
        match (holds, self.short_until) {
            (true, None) => Verdict::Holds,
            (true, Some(_)) => Verdict::HoldsNow,
            (false, Some(_)) => Verdict::FallsShort,
            (false, None) => Verdict::Fails,
        }
    }
}

/// A line of a picture.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    /// Name in the legend.
    pub(crate) name: String,
    /// x and y.
    pub(crate) points: Vec<(f64, f64)>,
}

impl Curve {
    /// A line through these points.
    pub(crate) fn new(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), points }
    }
}

/// Plot of a source.
#[derive(Clone, Debug)]
pub(crate) struct Picture {
    /// Name of the file, without ending.
    pub(crate) file: &'static str,
    /// Labels of x and y.
    pub(crate) axes: [&'static str; 2],
    /// Whether both axes are logarithmic.
    pub(crate) is_logarithmic: bool,
    /// Lines of the plot.
    pub(crate) curves: Vec<Curve>,
}

/// Picture of the bodies from the side.
#[derive(Clone, Debug)]
pub(crate) struct Drawing {
    /// Name of the file, without ending.
    pub(crate) file: &'static str,
    /// Title of the picture.
    pub(crate) title: &'static str,
    /// Text of the file.
    pub(crate) svg: String,
}

/// Results of a source.
#[derive(Clone, Debug, Default)]
pub(crate) struct Findings {
    /// Cases of the source.
    pub(crate) cases: Vec<Case>,
    /// Plots of the source.
    pub(crate) pictures: Vec<Picture>,
    /// Pictures of the bodies.
    pub(crate) drawings: Vec<Drawing>,
    /// Omitted parts, with the reasons.
    pub(crate) notes: Vec<String>,
}

/// Content of a file of the independent reference of 2026-11, which the tests also use.
pub(crate) fn parse_reference(name: &str) -> serde_json::Value {
    let path = format!("{}/tests/reference/{name}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// A source: its name, and the function that runs its cases.
pub(crate) type Source = (&'static str, fn(Effort) -> Findings);

/// All sources, in the order of the table.
pub(crate) fn sources() -> [Source; 20] {
    [
        ("mfix", mfix::run),
        ("lammps", lammps::run),
        ("chung_ooi", chung_ooi::run),
        ("elliptic", elliptic::run),
        ("elastic", elastic::run),
        ("sticking", sticking::run),
        ("free_motion", free_motion::run),
        ("moving_walls", moving_walls::run),
        ("incline", incline::run),
        ("faces", faces::run),
        ("balance", balance::run),
        ("arch", arch::run),
        ("dominoes", dominoes::run),
        ("unequal", unequal::run),
        ("unions", unions::run),
        ("packing", packing::run),
        ("shear", shear::run),
        ("steps", steps::run),
        ("convergence", convergence::run),
        ("other_codes", other_codes::run),
    ]
}
