//! Runs of a method, from packing to shear.

use super::TriaxialError;
use super::stages::another_packing;
use crate::spread::Spread;
use clap::ValueEnum;
use clap::builder::PossibleValue;
use dem_mpi::contact::{self, Epa, ErodedGjk};
use dem_mpi::output::performance::Performance;
use dem_mpi::output::snapshot::Reader;
use dem_mpi::post::PostError;
use dem_mpi::post::draw::{BLUE, GREEN, INK, ORANGE};
use dem_mpi::post::history::History;
use dem_mpi::post::picture::{Picture, side_by_side};
use dem_mpi::post::report::{Report, Summary, readable};
use dem_mpi::post::series::{self, Analysed, Choice};
use dem_mpi::post::sums::quotient;
use plotters::style::RGBColor;
use std::fs;
use std::ops::RangeInclusive;
use std::path::Path;

/// A method of contact resolution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The exact method.
    CommonNormal,
    /// The reference method of the paper.
    Epa,
    /// The method studied in the paper as described there: erosion if GJK finds the bodies touching.
    CheckedErosion,
    /// Erosion alone, which also finds bodies that nearly touch.
    Erosion,
}

impl Method {
    /// All methods, in the order of figures and reports.
    pub const ALL: [Self; 4] = [Self::CommonNormal, Self::Epa, Self::CheckedErosion, Self::Erosion];

    /// Folder of the runs.
    pub const fn folder(self) -> &'static str {
        match self {
            Self::CommonNormal => "common-normal",
            Self::Epa => "epa",
            Self::CheckedErosion => "gjk-gjk-erosion",
            Self::Erosion => "gjk-erosion",
        }
    }

    /// Settings in the table `contact` of a scene.
    pub const fn settings(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::CommonNormal => &[("method", "common-normal")],
            // With its secant steps, EPA has all digits of nearly every contact from this tolerance on.
            Self::Epa => &[("method", "epa"), ("tolerance", "1e-4")],
            Self::CheckedErosion => &[("method", "gjk-erosion"), ("spurious", "false")],
            Self::Erosion => &[("method", "gjk-erosion")],
        }
    }

    /// Resolver with the same settings, for pairs alone.
    pub fn resolver(self) -> contact::Method {
        match self {
            Self::CommonNormal => contact::Method::CommonNormal,
            Self::Epa => contact::Method::Epa(Epa { tolerance: 1e-4, ..Epa::default() }),
            Self::CheckedErosion => {
                contact::Method::GjkErosion(ErodedGjk { spurious: false, ..ErodedGjk::default() })
            }
            Self::Erosion => contact::Method::GjkErosion(ErodedGjk::default()),
        }
    }

    /// Whether the method is one of the two readings of erosion.
    pub const fn is_erosion(self) -> bool {
        matches!(self, Self::CheckedErosion | Self::Erosion)
    }

    /// Name in figures and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::CommonNormal => "common normal",
            Self::Epa => "EPA",
            Self::CheckedErosion => "GJK + erosion",
            Self::Erosion => "erosion",
        }
    }

    pub(crate) const fn colour(self) -> RGBColor {
        match self {
            Self::CommonNormal => INK,
            Self::Epa => ORANGE,
            Self::CheckedErosion => GREEN,
            Self::Erosion => BLUE,
        }
    }
}

/// Values are named like the folders of the runs.
impl ValueEnum for Method {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.folder()))
    }
}

/// Data of the runs of a method.
#[derive(Clone, Debug)]
pub struct Run {
    /// The method.
    pub method: Method,
    /// Report after random packing.
    pub packing: Option<Report>,
    /// Reports after random packing from other seeds.
    pub other_packings: Vec<Report>,
    /// Report under the confining pressure.
    pub consolidation: Option<Report>,
    /// Reports of all snapshots of the compression, with strains relative to the first.
    pub shear: Vec<Report>,
    /// Stages before the compression that are unfinished, and so have no report.
    pub unfinished: Vec<&'static str>,
    /// Energy error over the dissipated energy at the end of each stage.
    pub missing_energy: Vec<(&'static str, f64)>,
    /// Cost of each stage.
    pub costs: Vec<Cost>,
}

/// Cost of a stage, over all runs that did a part of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Cost {
    /// Name of the stage.
    pub stage: &'static str,
    /// Number of steps in all runs.
    pub steps: u64,
    /// Wall-clock time [s].
    pub seconds: f64,
    /// Number of ranks of the last run.
    pub ranks: u32,
    /// Wall-clock time times ranks in hours; `None` if some steps of the stage are not included.
    pub core_hours: Option<f64>,
    /// Contact resolution per contact in the last run [ns].
    pub contact_ns: Option<f64>,
}

/// Pictures of the packing before and after the compression.
pub(crate) struct Pictures {
    packing: Picture,
    sheared: Picture,
}

impl Pictures {
    /// Fig. 9.
    pub(crate) fn drawn(self, run: &Run) -> String {
        let name = run.method.name();
        let strain = run.shear.last().and_then(|r| r.summary.axial_strain);
        let at =
            strain.map_or(String::new(), |e| format!(" at a strain of {} %", readable(100.0 * e)));
        let bounds = |report: Option<&Report>| report.and_then(|r| r.packing_m);
        side_by_side(vec![
            (
                format!("(a) {name}, after random packing"),
                self.packing,
                bounds(run.packing.as_ref()),
            ),
            (format!("(b) {name}, compressed{at}"), self.sheared, bounds(run.shear.last())),
        ])
    }
}

impl Run {
    /// Reads the data of a method in `root`. Pictures are returned if both states exist.
    pub(crate) fn read(
        root: &Path,
        method: Method,
        choice: &Choice,
    ) -> Result<(Self, Option<Pictures>), TriaxialError> {
        let folder = root.join(method.folder());
        let stage = |name: &str| folder.join(name);
        let shear = match if_any(series::all(&stage("shear")))? {
            Some(files) => series::reports(&series::open(&files)?, choice)?,
            None => Analysed::default(),
        };
        let mut unfinished = Vec::new();
        let mut next_has_begun = !shear.reports.is_empty();
        // A stage is finished if the next one has begun from it, or if its header or the script that ran
        // it marks it so.
        let mut last = |name| -> Result<Option<(Report, Picture)>, TriaxialError> {
            let Some(file) = if_any(series::newest(&stage(name)))? else { return Ok(None) };
            let reader = Reader::open(&file).map_err(PostError::from)?;
            let says_so = !reader.header().stop.is_empty() || stage(name).join("done").exists();
            if !std::mem::replace(&mut next_has_begun, true) && !says_so {
                unfinished.push(name);
                return Ok(None);
            }
            let Analysed { mut reports, picture, .. } =
                series::reports(&series::open(&[file])?, choice)?;
            Ok(reports.pop().map(|report| (report, picture)))
        };
        let (consolidation, packing) = (last("consolidation")?, last("packing")?);
        let stages = ["packing", "consolidation", "shear"];
        let mut other_packings = Vec::new();
        for folder in (2..).map(|number| stage(&another_packing(number))) {
            // An unfinished packing has no data yet.
            if !folder.join("done").exists() {
                break;
            }
            if let Some(newest) = if_any(series::newest(&folder))? {
                let mut newest = series::reports(&series::open(&[newest])?, choice)?;
                other_packings.extend(newest.reports.pop());
            }
        }
        let mut run = Self {
            method,
            packing: packing.as_ref().map(|(report, _)| report.clone()),
            other_packings,
            consolidation: consolidation.map(|(report, _)| report),
            shear: shear.reports,
            unfinished,
            missing_energy: stages
                .into_iter()
                .filter_map(|name| Some((name, missing_energy(&stage(name))?)))
                .collect(),
            costs: Vec::new(),
        };
        let costs = stages.into_iter().filter_map(|name| cost(name, &stage(name))).map(|cost| {
            let is_whole = run.steps_of(cost.stage) == Some(cost.steps);
            Cost { core_hours: cost.core_hours.filter(|_| is_whole), ..cost }
        });
        run.costs = costs.collect();
        let pictures = packing
            .filter(|_| !run.shear.is_empty())
            .map(|(_, packing)| Pictures { packing, sheared: shear.picture });
        Ok((run, pictures))
    }

    /// Number of steps of a stage, from the states before and after it.
    fn steps_of(&self, stage: &str) -> Option<u64> {
        let step = |report: Option<&Report>| report.map(|report| report.summary.step);
        let (packed, consolidated) =
            (step(self.packing.as_ref()), step(self.consolidation.as_ref()));
        let (begin, end) = match stage {
            "packing" => (Some(0), packed),
            "consolidation" => (packed, consolidated),
            _ => (consolidated, step(self.shear.last())),
        };
        end?.checked_sub(begin?)
    }

    /// Whether there is no data.
    pub fn is_empty(&self) -> bool {
        self.packing.is_none()
            && self.consolidation.is_none()
            && self.shear.is_empty()
            && self.unfinished.is_empty()
    }

    /// All packings; none if the first is unfinished.
    pub fn packings(&self) -> impl Iterator<Item = &Report> {
        let others = self.packing.iter().flat_map(|_| &self.other_packings);
        self.packing.iter().chain(others)
    }

    /// Spread of a number over all packings.
    pub fn packed(&self, pick: impl Fn(&Report) -> Option<f64>) -> Option<Spread> {
        let values: Vec<f64> = self.packings().map(pick).collect::<Option<_>>()?;
        (!values.is_empty()).then(|| Spread::of(&values))
    }

    /// Report of the snapshot with the largest `q/p` of the compression.
    pub fn peak(&self) -> Option<&Report> {
        let ratio = |report: &&Report| report.summary.q_over_p;
        let strained = self.shear.iter().filter(|r| r.summary.axial_strain.is_some());
        strained
            .filter(|r| ratio(r).is_some())
            .max_by(|a, b| ratio(a).unwrap_or(0.0).total_cmp(&ratio(b).unwrap_or(0.0)))
    }

    /// Mean of a number over the snapshots in a range of axial strain.
    pub fn mean_over(&self, strains: &RangeInclusive<f64>, pick: Pick) -> Option<f64> {
        let values = self.curve(pick).into_iter().filter(|(strain, _)| strains.contains(strain));
        let values: Vec<f64> = values.map(|(_, value)| value).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    }

    /// Axial strain and a number of each snapshot of the compression, by strain.
    pub fn curve(&self, pick: Pick) -> Vec<(f64, f64)> {
        let points = self.shear.iter().map(|r| (r.summary.axial_strain, pick(&r.summary)));
        points.filter_map(|(strain, value)| strain.zip(value)).collect()
    }

    /// Largest axial strain.
    pub fn strain(&self) -> Option<f64> {
        self.shear.last()?.summary.axial_strain
    }

    /// States in which packings are compared: name and report.
    pub fn states(&self) -> impl Iterator<Item = (&'static str, &Report)> {
        let states = [
            ("packing", self.packing.as_ref()),
            ("consolidation", self.consolidation.as_ref()),
            ("peak", self.peak()),
            ("end", self.shear.last()),
        ];
        states.into_iter().filter_map(|(name, report)| Some((name, report?)))
    }
}

/// Selects a number of a summary.
pub type Pick = fn(&Summary) -> Option<f64>;

/// Root mean square difference of two curves over their common range, by linear interpolation.
pub fn rms_difference(a: &[(f64, f64)], b: &[(f64, f64)]) -> Option<f64> {
    const SAMPLES: u32 = 200;
    let low = a.first()?.0.max(b.first()?.0);
    let high = a.last()?.0.min(b.last()?.0);
    if low >= high {
        return None;
    }
    let squares = (0..=SAMPLES).map(|k| {
        let x = low + (high - low) * f64::from(k) / f64::from(SAMPLES);
        (at(a, x) - at(b, x)).powi(2)
    });
    Some((squares.sum::<f64>() / f64::from(SAMPLES + 1)).sqrt())
}

/// Value of a curve at `x`, which it must cover.
fn at(curve: &[(f64, f64)], x: f64) -> f64 {
    let next = curve.partition_point(|p| p.0 < x).clamp(1, curve.len() - 1);
    let ((x0, y0), (x1, y1)) = (curve[next - 1], curve[next]);
    if x1 > x0 { y0 + (y1 - y0) * (x - x0) / (x1 - x0) } else { y1 }
}

/// `None` for a folder that does not exist, or has no snapshot yet.
fn if_any<T>(found: Result<T, PostError>) -> Result<Option<T>, PostError> {
    match found {
        Ok(found) => Ok(Some(found)),
        Err(PostError::NoSnapshot { .. }) => Ok(None),
        Err(PostError::Unlisted { cause, .. }) if cause.kind() == std::io::ErrorKind::NotFound => {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

fn missing_energy(stage: &Path) -> Option<f64> {
    let history = History::read(fs::File::open(stage.join("history.csv")).ok()?).ok()?;
    let dissipated = history.last("dissipated_J").filter(|&d| d > 0.0)?;
    Some(history.last("missing_J")?.abs() / dissipated)
}

/// Cost of the runs of a stage, if they recorded it.
fn cost(stage: &'static str, folder: &Path) -> Option<Cost> {
    Cost::of(stage, &Performance::read(folder).ok()?)
}

impl Cost {
    /// Cost from the rows of the stage's runs, at least one.
    pub fn of(stage: &'static str, runs: &[Performance]) -> Option<Self> {
        let last = runs.last()?;
        let hours = |run: &Performance| run.wall_s * f64::from(run.ranks) / 3600.0;
        Some(Self {
            stage,
            steps: runs.iter().map(|run| run.steps).sum(),
            seconds: runs.iter().map(|run| run.wall_s).sum(),
            ranks: last.ranks,
            core_hours: Some(runs.iter().map(hours).sum()),
            contact_ns: quotient(1e9 * last.contact_resolution_s, last.contacts as f64),
        })
    }
}
