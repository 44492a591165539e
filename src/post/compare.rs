//! Several runs, or stages of one run, side by side.
//!
//! Time and step go on from stage to stage. A stage whose snapshot of origin is of another given run continues that run: its
//! strains, its displacements of walls and its elapsed time count from the first of these stages.

use super::PostError;
use super::diff::shortened;
use super::draw::PlotError;
use super::history::{Curve, History};
use super::report::{Report, csv};
use super::series::{self, Analysed, Choice, Snapshot};
use crate::files;
use crate::output::growing::whole_lines;
use crate::output::header::Header;
use crate::output::snapshot::Reader;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Errors of a comparison.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// A single run was given.
    #[error("--compare takes two runs or more, not {0}: name the folder of each")]
    FewRuns(usize),
    /// Nothing can be drawn.
    #[error(
        "the runs have no quantity in common that changes: --compare needs a history.csv in the folders of two runs, or \
         two snapshots of a run and one of another"
    )]
    NothingInCommon,
    /// A quantity has two units.
    #[error(
        "{quantity} is in {first} in run {of_first} and in {second} in run {of_second}: convert one of the tables"
    )]
    OtherUnit {
        /// Name of the quantity.
        quantity: String,
        /// Label with the unit in one run.
        first: String,
        /// This run.
        of_first: String,
        /// Label with the unit in another run.
        second: String,
        /// This run.
        of_second: String,
    },
    /// Snapshots cannot be measured.
    #[error(transparent)]
    Post(#[from] PostError),
    /// A plot cannot be drawn.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// A table cannot be made.
    #[error(transparent)]
    Table(#[from] ::csv::Error),
}

/// Names of columns, and cells by row.
#[derive(Clone, Debug, Default)]
struct Cells {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Cells {
    fn read(text: &[u8]) -> Result<Self, ::csv::Error> {
        let mut table = ::csv::ReaderBuilder::new().trim(::csv::Trim::All).from_reader(text);
        let owned = |record: &::csv::StringRecord| record.iter().map(str::to_owned).collect();
        let names = owned(table.headers()?);
        let rows = table.records().map(|record| Ok(owned(&record?)));
        Ok(Self { names, rows: rows.collect::<Result<_, ::csv::Error>>()? })
    }
}

/// A run of a comparison.
#[derive(Clone, Debug)]
pub struct Run {
    /// Name of the folder, with folders above it if another run has the same name.
    pub name: String,
    /// The folder.
    pub folder: PathBuf,
    /// Header of the newest snapshot.
    pub header: Header,
    /// Report of each snapshot.
    pub reports: Vec<Report>,
    /// Scalars by time; empty without a table.
    pub history: History,
    /// Index of the run from a snapshot of which this one began.
    pub before: Option<usize>,
    /// Rows of the history.
    cells: Cells,
}

/// Runs to compare, at least two.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// The runs, in the order of the arguments.
    pub runs: Vec<Run>,
    /// Skipped snapshots and tables, and doubts about numbers.
    pub notes: Vec<String>,
}

impl Comparison {
    /// Reads and measures runs. Files of one folder are of one run.
    ///
    /// # Errors
    /// See [`CompareError`].
    pub fn of(files: &[PathBuf], choice: &Choice) -> Result<Self, CompareError> {
        let mut folders: Vec<(&Path, Vec<PathBuf>)> = Vec::new();
        for file in files {
            let folder = file.parent().unwrap_or(Path::new("."));
            match folders.iter_mut().find(|(other, _)| *other == folder) {
                Some((_, files)) => files.push(file.clone()),
                None => folders.push((folder, vec![file.clone()])),
            }
        }
        if folders.len() < 2 {
            return Err(CompareError::FewRuns(folders.len()));
        }
        let names = names(&folders.iter().map(|(folder, _)| *folder).collect::<Vec<_>>());
        let mut all = Self { runs: Vec::new(), notes: Vec::new() };
        for ((folder, files), name) in folders.into_iter().zip(names) {
            let run = all.read(folder, &files, name, choice)?;
            all.runs.push(run);
        }
        for k in 0..all.runs.len() {
            all.runs[k].before = all.origin(k);
        }
        all.relate_strains();
        Ok(all)
    }

    /// Reads a run, and notes what is skipped.
    fn read(
        &mut self,
        folder: &Path,
        files: &[PathBuf],
        name: String,
        choice: &Choice,
    ) -> Result<Run, CompareError> {
        let snapshots: Vec<Snapshot> = series::open(files)?;
        let Analysed { reports, left_out, .. } = series::reports(&snapshots, choice)?;
        let doubts = reports.last().map(|report| report.doubts.clone()).unwrap_or_default();
        let newest = snapshots.last().map_or(folder, |snapshot| &snapshot.path);
        let header = Reader::open(newest).map_err(PostError::from)?.header().clone();
        let (mut history, mut cells) = (History::default(), Cells::default());
        let path = folder.join("history.csv");
        let mut notes: Vec<String> = left_out.into_iter().chain(doubts).collect();
        if let Ok(text) = files::read(&path) {
            match History::read(&text[..]) {
                Ok(read) => (history, cells) = (read, Cells::read(whole_lines(&text))?),
                Err(error) => notes.push(format!("{} is left out: {error}", path.display())),
            }
        }
        self.notes.extend(notes.iter().map(|note| format!("{name}: {}", note.trim_end())));
        let folder = folder.to_owned();
        Ok(Run { name, folder, header, reports, history, before: None, cells })
    }

    /// Run from which another began: its folder has the name in `start` of the scene, and its snapshot of that step is of
    /// that time.
    fn origin(&self, of: usize) -> Option<usize> {
        let Header { stage_begin: (step, time), .. } = self.runs[of].header;
        let start = scene(&self.runs[of]).get("start")?.as_str().map(PathBuf::from)?;
        let is_file = start.extension().is_some_and(|ending| ending == "vtkhdf");
        let start = if is_file { start.parent()? } else { &start };
        let common = |folder: &Path| {
            let pairs = folder.components().rev().zip(start.components().rev());
            pairs.take_while(|(a, b)| a == b).count()
        };
        let began_earlier = |run: &Run| run.header.stage_begin.0 < step;
        let agrees = |run: &Run| {
            let mut summaries = run.reports.iter().map(|report| &report.summary);
            summaries.all(|s| s.step != step || s.time_s.to_bits() == time.to_bits())
        };
        let others = self.runs.iter().enumerate();
        let others = others.filter(|&(k, run)| k != of && began_earlier(run) && agrees(run));
        let shared =
            others.map(|(k, run)| (common(&run.folder), k)).filter(|(count, _)| *count > 0);
        shared.max_by_key(|&(count, k)| (count, std::cmp::Reverse(k))).map(|(_, k)| k)
    }

    /// Indices of a run and of the runs that it continues, the first of all in front.
    pub fn stages(&self, of: usize) -> Vec<usize> {
        let mut stages: Vec<usize> =
            std::iter::successors(Some(of), |&k| self.runs[k].before).collect();
        stages.reverse();
        stages
    }

    /// Time at which the first stage of a run began [s].
    pub fn begin(&self, of: usize) -> f64 {
        self.runs[self.stages(of)[0]].header.stage_begin.1
    }

    /// Strains of a continued run are relative to the first snapshot of the earliest stage that walls or periods enclose as they
    /// do the run.
    fn relate_strains(&mut self) {
        for k in 0..self.runs.len() {
            let Some(own) = self.runs[k].reports.last().map(|report| report.enclosed) else {
                continue;
            };
            let suits = |first: &&Report| {
                first.packing_m.is_some() && (0..3).all(|k| first.enclosed[k] || !own[k])
            };
            let stages = self.stages(k);
            let mut firsts = stages.iter().filter_map(|&stage| self.runs[stage].reports.first());
            let Some(first) = firsts.find(suits).cloned() else { continue };
            if stages.len() > 1 {
                self.runs[k].reports.iter_mut().for_each(|report| report.strain_against(&first));
            }
        }
    }

    /// History of a run, behind the rows of the stages before it.
    pub fn joined(&self, of: usize) -> History {
        let stages = self.stages(of);
        let ends = stages[1..].iter().map(|&next| self.runs[next].header.stage_begin.1);
        let ends: Vec<f64> = ends.chain([f64::INFINITY]).collect();
        let joined = |Curve { name, .. }: &Curve| {
            let parts = stages.iter().zip(&ends).filter_map(|(&stage, &end)| {
                let points = &self.runs[stage].history.curve(name)?.points;
                Some(points.iter().copied().filter(move |point| point.0 < end))
            });
            Curve { name: name.clone(), points: parts.flatten().collect() }
        };
        History { curves: self.runs[of].history.curves.iter().map(joined).collect() }
    }

    /// Keys of the scenes whose values differ, each with the value in every run.
    pub fn differences(&self) -> Vec<Vec<String>> {
        let scenes: Vec<BTreeMap<String, String>> = self.runs.iter().map(keys).collect();
        let all: BTreeSet<&String> = scenes.iter().flat_map(BTreeMap::keys).collect();
        let values = |key: &String| {
            scenes.iter().map(|scene| scene.get(key).map_or("–", |value| value)).collect::<Vec<_>>()
        };
        let differs = |values: &[&str]| values.iter().any(|value| *value != values[0]);
        let rows = all.into_iter().map(|key| (key, values(key)));
        let rows = rows.filter(|(_, values)| differs(values));
        let row = |(key, values): (&String, Vec<&str>)| {
            [key.clone()].into_iter().chain(values.into_iter().map(shortened)).collect()
        };
        rows.map(row).collect()
    }

    /// All rows as one table: the history of each run, then its snapshots.
    ///
    /// # Errors
    /// If a table cannot be made.
    pub fn csv(&self) -> Result<String, CompareError> {
        let mut parts: Vec<(usize, &str, Cells)> = Vec::new();
        for (k, run) in self.runs.iter().enumerate() {
            let snapshots = csv(run.reports.iter().map(|report| &report.summary))?;
            parts.push((k, "history", run.cells.clone()));
            parts.push((k, "snapshots", Cells::read(snapshots.as_bytes())?));
        }
        let mut names: Vec<&str> = Vec::new();
        for name in parts.iter().flat_map(|(.., cells)| &cells.names) {
            if !names.contains(&&**name) {
                names.push(name);
            }
        }
        let mut table = ::csv::Writer::from_writer(Vec::new());
        table.write_record(["run", "source", "elapsed_s"].iter().chain(&names))?;
        for (k, source, cells) in &parts {
            let places: Vec<Option<usize>> =
                names.iter().map(|name| cells.names.iter().position(|own| own == name)).collect();
            let time = cells.names.iter().position(|name| name == "time_s");
            let begin = self.begin(*k);
            for row in &cells.rows {
                let cell = |place: &Option<usize>| place.and_then(|k| row.get(k)).map_or("", |c| c);
                let elapsed = cell(&time).parse::<f64>().map(|time| time - begin);
                let elapsed = elapsed.map_or_else(|_| String::new(), |time| format!("{time:?}"));
                let known = [&*self.runs[*k].name, source, &elapsed];
                table.write_record(known.into_iter().chain(places.iter().map(cell)))?;
            }
        }
        let bytes = table.into_inner().map_err(|error| ::csv::Error::from(error.into_error()))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }
}

/// Shortest different ends of the paths.
fn names(folders: &[&Path]) -> Vec<String> {
    let end = |folder: &Path, count: usize| -> PathBuf {
        let all = folder.components().count();
        folder.components().skip(all.saturating_sub(count)).collect()
    };
    let name = |folder: &&Path| {
        let is_alone = |count: &usize| {
            let others = folders.iter().filter(|other| *other != folder);
            others.into_iter().all(|other| end(other, *count) != end(folder, *count))
        };
        let count = (1..folder.components().count()).find(is_alone).unwrap_or(usize::MAX);
        end(folder, count).display().to_string()
    };
    folders.iter().map(name).collect()
}

/// Scene of a run; empty if it has none.
fn scene(run: &Run) -> Table {
    run.header.scene.parse().unwrap_or_default()
}

/// Keys of the scene of a run, as `--set` names them, with their values. The output folder is left out.
fn keys(run: &Run) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    collect(String::new(), &Value::Table(scene(run)), &mut all);
    all.remove("output.directory");
    all
}

/// Adds the keys of a value. Tables in a list go by their name, otherwise by their place from 0.
fn collect(path: String, value: &Value, all: &mut BTreeMap<String, String>) {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Table(table) => {
            table.iter().for_each(|(key, value)| collect(below(key), value, all));
        }
        Value::Array(list) if !list.is_empty() && list.iter().all(Value::is_table) => {
            for (place, table) in list.iter().enumerate() {
                let name = table.get("name").and_then(Value::as_str);
                collect(below(&name.map_or_else(|| place.to_string(), str::to_owned)), table, all);
            }
        }
        value => drop(all.insert(path, value.to_string())),
    }
}
