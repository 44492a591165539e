//! Cells of the stability map: scenes run as a user would start them, with the expected results.

use crate::scene::Scene;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::output::tables::ParticleTable;
use serde_json::Value;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Longest run; a longer one counts as hung.
const TIME_LIMIT: Duration = Duration::from_secs(600);
/// Largest accepted energy error over the dissipated energy.
const MISSING: f64 = 0.01;
/// Largest accepted share of resolved pairs that the first method passes on.
const FALLBACKS: f64 = 0.01;

/// Deviation of a result from its expected value.
pub(crate) struct Deviation {
    /// Name of the result.
    pub(crate) what: &'static str,
    /// Size of the deviation.
    pub(crate) is: f64,
    /// Largest accepted deviation.
    pub(crate) allowed: f64,
}

impl Deviation {
    /// Difference of a result from its expected value, over the unit.
    pub(crate) fn of(what: &'static str, is: f64, should: f64, unit: f64, allowed: f64) -> Self {
        Self { what, is: ((is - should) / unit).abs(), allowed }
    }

    fn holds(&self) -> bool {
        self.is <= self.allowed
    }
}

/// Comparison of a result with closed forms.
pub(crate) type Check = Box<dyn Fn(&Ran) -> Vec<Deviation> + Sync>;

/// A cell of the map.
pub(crate) struct Cell {
    /// Quantity that varies along its row.
    pub(crate) row: &'static str,
    /// Value of that quantity.
    pub(crate) value: String,
    /// Stages, each of which begins at the end of the one before.
    pub(crate) stages: Vec<Scene>,
    /// Expected results of this cell, in addition to those of every cell.
    pub(crate) check: Check,
    /// Ranks of the second run, whose result must have the same bits.
    pub(crate) ranks: u32,
    /// Whether the cell is also run with `--quick`.
    pub(crate) is_quick: bool,
}

impl Cell {
    /// A cell of one stage; `check` gives its deviations.
    #[expect(clippy::needless_pass_by_value, reason = "a number or a text")]
    pub(crate) fn new(
        row: &'static str,
        value: impl ToString,
        scene: Scene,
        check: impl Fn(&Ran) -> Vec<Deviation> + Sync + 'static,
    ) -> Self {
        let (value, stages) = (value.to_string(), vec![scene]);
        Self { row, value, stages, check: Box::new(check), ranks: 2, is_quick: false }
    }

    /// The cell, also run with `--quick`.
    pub(crate) fn quick(self) -> Self {
        Self { is_quick: true, ..self }
    }
}

/// Results of a run.
pub(crate) struct Ran {
    /// Content of `report.json`.
    pub(crate) report: Value,
    /// Particles of the last snapshot.
    pub(crate) particles: ParticleTable,
    /// Last row of `history.csv`, by columns.
    history: Vec<(String, f64)>,
}

impl Ran {
    /// A figure of the report; infinite if it is not a number.
    pub(crate) fn figure(&self, place: &str) -> f64 {
        self.report.pointer(place).and_then(Value::as_f64).unwrap_or(f64::INFINITY)
    }

    /// A figure of the last row of `history.csv`.
    pub(crate) fn last(&self, column: &str) -> f64 {
        let found = self.history.iter().find(|(name, _)| name == column);
        found.unwrap_or_else(|| panic!("history.csv has no column {column}")).1
    }

    fn warnings(&self) -> Vec<String> {
        let all = self.report["warnings"].as_array().map(Vec::as_slice).unwrap_or_default();
        all.iter().filter_map(Value::as_str).map(str::to_owned).collect()
    }

    /// Deviations that are checked for every scene.
    fn common(&self, grains: usize) -> Vec<Deviation> {
        let table = &self.particles;
        let vectors = table.position.iter().chain(&table.velocity).chain(&table.angular_velocity);
        let infinite = vectors.filter(|v| !v.iter().all(|x| x.is_finite())).count();
        let lost = grains as f64 - table.id.len() as f64;
        // Relative to the moved energy if next to nothing was dissipated.
        let dissipated = self.figure("/energy/dissipated_j");
        let moved = self.figure("/energy/largest_moved_j");
        let unit = if dissipated > 1e-3 * moved { dissipated } else { moved };
        let missing = self.figure("/energy/missing_j") / if unit > 0.0 { unit } else { 1.0 };
        let fallbacks = self.report.pointer("/contacts/fallback_share").and_then(Value::as_f64);
        vec![
            Deviation { what: "numbers that are none", is: infinite as f64, allowed: 0.0 },
            Deviation { what: "lost particles", is: lost.abs(), allowed: 0.0 },
            Deviation { what: "missing energy", is: missing.abs(), allowed: MISSING },
            Deviation { what: "fallbacks", is: fallbacks.unwrap_or(0.0), allowed: FALLBACKS },
        ]
    }
}

/// Result of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// Within the limits.
    Right,
    /// Within the limits, with a warning.
    RightAndWarned,
    /// Outside the limits, with a warning.
    Warned,
    /// Stopped with a message.
    Stopped,
    /// Rejected before the run.
    Refused,
    /// Outside the limits without a warning; also a hang, a panic, or different bits on more ranks.
    Wrong,
}

impl Outcome {
    /// All outcomes, the best first.
    pub(crate) const ALL: [Self; 6] = [
        Self::Right,
        Self::RightAndWarned,
        Self::Warned,
        Self::Stopped,
        Self::Refused,
        Self::Wrong,
    ];

    /// Name in the table.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::RightAndWarned => "right, warned",
            Self::Warned => "off, warned",
            Self::Stopped => "stopped",
            Self::Refused => "refused",
            Self::Wrong => "WRONG",
        }
    }
}

/// Outcome of a cell, with details.
pub(crate) struct Finding {
    pub(crate) outcome: Outcome,
    /// Message of the program, or the deviation.
    pub(crate) why: String,
    /// Wall-clock time of the first run [s].
    pub(crate) seconds: f64,
}

/// Exit status of a stage that has done its steps without fulfilling its `[stop]`.
const UNMET: i32 = 4;

/// End of a run of the program.
struct Ended {
    /// `None` if it hung.
    status: Option<ExitStatus>,
    said: String,
}

impl Ended {
    fn has_done_its_steps(&self) -> bool {
        matches!(self.status.and_then(|status| status.code()), Some(0 | UNMET))
    }
}

/// Runs a cell in a folder of its own.
pub(crate) fn find(cell: &Cell, folder: &Path) -> anyhow::Result<Finding> {
    std::fs::create_dir_all(folder)?;
    let wrong = |why: String, seconds| Finding { outcome: Outcome::Wrong, why, seconds };
    let begin = Instant::now();
    let first = stages(cell, folder, 1)?;
    let seconds = begin.elapsed().as_secs_f64();
    let second = stages(cell, folder, cell.ranks)?;
    let [code, again] = [&first, &second].map(|ended| ended.status.and_then(|s| s.code()));
    let panicked = [&first, &second].into_iter().find(|e| e.said.contains("panicked at"));
    if let Some(ended) = panicked {
        return Ok(wrong(format!("panic: {}", ended.said), seconds));
    }
    if code != again {
        let why =
            format!("status {code:?} on 1 rank, {again:?} on {}: {}", cell.ranks, second.said);
        return Ok(wrong(why, seconds));
    }
    Ok(match code {
        Some(0 | UNMET) => judge(cell, folder, seconds)?,
        Some(1) => Finding { outcome: Outcome::Stopped, why: told(&first.said, folder), seconds },
        Some(2) => Finding { outcome: Outcome::Refused, why: told(&first.said, folder), seconds },
        Some(other) => wrong(format!("status {other}: {}", first.said), seconds),
        None => wrong("no end within the time limit, or ended by a signal".to_owned(), seconds),
    })
}

/// Output folder of a stage.
fn output(folder: &Path, ranks: u32, stage: usize) -> PathBuf {
    folder.join(format!("out_{ranks}_{stage}"))
}

/// Runs all stages, up to the first that fails.
fn stages(cell: &Cell, folder: &Path, ranks: u32) -> anyhow::Result<Ended> {
    let mut ended = Ended { status: None, said: String::new() };
    for (stage, scene) in cell.stages.iter().enumerate() {
        let before = stage.checked_sub(1).map(|before| output(folder, ranks, before));
        let before = before.as_deref().and_then(Path::to_str);
        let (text, grains) = scene.texts(before);
        let path = folder.join(format!("scene_{stage}.toml"));
        std::fs::write(&path, text)?;
        std::fs::write(folder.join("grains.csv"), grains)?;
        let out = output(folder, ranks, stage);
        let mut words = vec![path.into_os_string(), "--out".into(), out.into()];
        if ranks > 1 {
            words.extend(["--threads".into(), ranks.to_string().into()]);
        }
        ended = call(env!("CARGO_BIN_EXE_dem-mpi"), &words, folder)?;
        if !ended.has_done_its_steps() {
            break;
        }
    }
    Ok(ended)
}

fn call(program: &str, words: &[std::ffi::OsString], folder: &Path) -> anyhow::Result<Ended> {
    let said = folder.join("stderr");
    let mut child = Command::new(program)
        .args(words)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(File::create(&said)?)
        .spawn()?;
    let begin = Instant::now();
    let mut pause = Duration::from_millis(1);
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break Some(status);
        }
        if begin.elapsed() > TIME_LIMIT {
            child.kill()?;
            child.wait()?;
            break None;
        }
        sleep(pause);
        pause = (2 * pause).min(Duration::from_millis(50));
    };
    Ok(Ended { status, said: std::fs::read_to_string(said)? })
}

/// Message with which a run has ended: all output except warnings, in one line.
fn told(said: &str, folder: &Path) -> String {
    // The first line only names the run, or announces errors.
    let lines = said.lines().skip(1).filter(|line| !line.starts_with("warning: "));
    let message = lines.map(str::trim).collect::<Vec<_>>().join(" ");
    message.replace(&format!("{}/", folder.display()), "").trim().to_owned()
}

/// Compares the results of a complete run with the expected ones.
fn judge(cell: &Cell, folder: &Path, seconds: f64) -> anyhow::Result<Finding> {
    let last = cell.stages.len() - 1;
    let ran = read(&output(folder, 1, last))?;
    let words = [1, cell.ranks].map(|ranks| output(folder, ranks, last).into_os_string());
    let mut diff = vec!["--diff".into()];
    diff.extend(words);
    let same = call(env!("CARGO_BIN_EXE_dem-post"), &diff, folder)?;
    if same.status.is_none_or(|status| !status.success()) {
        let why = format!("other bits on {} ranks", cell.ranks);
        return Ok(Finding { outcome: Outcome::Wrong, why, seconds });
    }
    let mut deviations = ran.common(cell.stages[0].grains.len());
    deviations.extend((cell.check)(&ran));
    let off = deviations.iter().find(|deviation| !deviation.holds());
    let warnings = ran.warnings();
    let off_by = |d: &Deviation| format!("{} {:.2e} (allowed {:.0e})", d.what, d.is, d.allowed);
    let (outcome, why) = match (off, warnings.first()) {
        (None, None) => {
            // The deviation that takes the largest part of its limit.
            let part = |d: &Deviation| if d.allowed > 0.0 { d.is / d.allowed } else { 0.0 };
            let nearest = deviations.iter().max_by(|a, b| part(a).total_cmp(&part(b)));
            (Outcome::Right, nearest.map(off_by).unwrap_or_default())
        }
        (None, Some(warning)) => (Outcome::RightAndWarned, warning.clone()),
        (Some(off), Some(warning)) => (Outcome::Warned, format!("{}; {warning}", off_by(off))),
        (Some(off), None) => (Outcome::Wrong, off_by(off)),
    };
    Ok(Finding { outcome, why, seconds })
}

fn read(out: &Path) -> anyhow::Result<Ran> {
    let report = serde_json::from_str(&std::fs::read_to_string(out.join("report.json"))?)?;
    let reader = Reader::open(out)?;
    let particles = reader.particles(0..reader.particle_count())?;
    let mut rows = csv::Reader::from_path(out.join("history.csv"))?;
    let names: Vec<String> = rows.headers()?.iter().map(str::to_owned).collect();
    let row = rows.records().last().transpose()?.unwrap_or_default();
    let numbers = row.iter().map(|cell| cell.parse().unwrap_or(f64::NAN));
    Ok(Ran { report, particles, history: names.into_iter().zip(numbers).collect() })
}
