//! Runs of section 3: random packing, consolidation and triaxial compression by dem-mpi, from the scenes in `run/paper/triaxial`,
//! then the report.
//!
//! Each stage stores its arguments in its folder, in `words`: those of all methods in the first line, those of its own method in
//! the second. With the same arguments an interrupted stage continues, and one that is `done` is not run again.

use super::{Method, regenerate};
use crate::record::{machine, short_commit, store};
use crate::simulation::{Signals, absolute, dem_mpi, run};
use anyhow::{Result, ensure};
use clap::{Args, ValueEnum};
use dem_mpi::post::series::{self, Choice};
use std::fmt::Write as _;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Plan of the runs.
#[derive(Args, Clone, Debug)]
pub struct Plan {
    /// 600 grains and a wall 5 times faster: minutes. Without it: 5,120 grains, hours
    #[arg(long)]
    pub quick: bool,
    /// The wall comes down at N mm/s; the paper's rate is 1 [default: 1, with --quick 5]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=999))]
    pub rate: Option<u32>,
    /// Gravity stays on after the packing
    #[arg(long)]
    pub gravity: bool,
    /// Another packing of the same kind [default: 1]
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Packings of each kind: the tests continue from the first; the others, with the seeds after its own, show the scatter
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=99))]
    pub packings: u32,
    /// Stiffness of all contacts [N/m]; the paper's is 1.5e5
    #[arg(long, value_name = "K", value_parser = positive)]
    pub stiffness: Option<String>,
    /// Law of contacts: the paper's linear springs, or elastic bodies that are as stiff at the mean force of 100 kPa
    #[arg(long, value_enum, default_value_t)]
    pub law: Springs,
    /// The first of both erosions; the paper's is 0.05
    #[arg(long, value_name = "R", value_parser = part_of_one)]
    pub erosion_ratio: Option<String>,
    /// Method of contact resolution; gjk-gjk-erosion is erosion only if GJK says that bodies touch, as the paper reads; may be
    /// repeated
    #[arg(long = "method", value_name = "M", value_enum, default_value = "common-normal")]
    pub methods: Vec<Method>,
    /// Ranks of each run
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..))]
    pub ranks: u32,
    /// Where runs and report go [default: out/paper/triaxial, with --law hertz out/paper/hertz-triaxial, with --quick out/paper/quick,
    /// in the checkout]
    #[arg(long, value_name = "DIR", value_parser = absolute)]
    pub out: Option<PathBuf>,
    /// Print what the runs print
    #[arg(skip = true)]
    pub aloud: bool,
}

/// Law of the normal force.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Springs {
    /// Linear, as in the paper.
    #[default]
    Linear,
    /// Elastic bodies: Hertz and Mindlin.
    Hertz,
}

/// Checks for a positive number, kept as text.
fn positive(text: &str) -> Result<String, String> {
    let is_one = text.parse().is_ok_and(|number: f64| number > 0.0 && number.is_finite());
    if is_one { Ok(text.into()) } else { Err("must be a number above 0".into()) }
}

/// Checks for a number between zero and one, kept as text.
fn part_of_one(text: &str) -> Result<String, String> {
    let is_one = text.parse().is_ok_and(|number: f64| number > 0.0 && number < 1.0);
    if is_one { Ok(text.into()) } else { Err("must be a number between 0 and 1".into()) }
}

/// Arguments of dem-mpi.
#[derive(Clone, Debug, Default)]
pub struct Words(Vec<String>);

impl Words {
    /// Changes a value of the scene.
    pub fn set(&mut self, key: &str, value: impl std::fmt::Display) {
        self.0.extend(["--set".to_owned(), format!("{key}={value}")]);
    }

    /// Changes the stiffness of all contacts [N/m].
    pub fn set_stiffness(&mut self, stiffness: &str) {
        for material in ["grain", "wall"] {
            for direction in ["normal", "tangential"] {
                self.set(&format!("material.{material}.{direction}_stiffness"), stiffness);
            }
        }
    }

    /// The arguments one by one.
    pub fn arguments(&self) -> &[String] {
        &self.0
    }

    /// The line in the file `words`.
    pub fn line(&self) -> String {
        self.0.join(" ")
    }
}

/// A stage, with the changes to its scene that are common to all methods.
struct Stage {
    name: String,
    /// Stage from which it starts.
    before: Option<&'static str>,
    words: Words,
}

impl Plan {
    /// Plan of the paper's test by these methods.
    pub const fn new(methods: Vec<Method>) -> Self {
        Self {
            quick: false,
            rate: None,
            gravity: false,
            seed: None,
            packings: 1,
            stiffness: None,
            law: Springs::Linear,
            erosion_ratio: None,
            methods,
            ranks: 2,
            out: None,
            aloud: true,
        }
    }

    fn rate(&self) -> u32 {
        self.rate.unwrap_or(if self.quick { 5 } else { 1 })
    }

    /// Folder of runs and report; a path in the checkout stays relative to it.
    fn folder(&self) -> PathBuf {
        let usual = match (self.quick, self.law) {
            (true, _) => "out/paper/quick",
            (false, Springs::Hertz) => "out/paper/hertz-triaxial",
            (false, Springs::Linear) => "out/paper/triaxial",
        };
        self.out.clone().unwrap_or_else(|| usual.into())
    }

    fn stages(&self) -> Vec<Stage> {
        let [mut packing, mut consolidation, mut shear] = [const { Words(Vec::new()) }; 3];
        if self.quick {
            packing.set("fill.rain.count", 600);
            packing.set("domain.high", "[0.02, 0.02, 0.09]");
            packing.set("fill.rain.low", "[0.0, 0.0, 0.07]");
            packing.set("fill.rain.high", "[0.02, 0.02, 0.09]");
            for words in [&mut consolidation, &mut shear] {
                words.set("domain.high", "[0.02, 0.02, 0.038]");
            }
        }
        let rate = self.rate();
        let steps = if self.quick { 1_080_000 } else { 2_160_000 } / rate;
        let velocity = format!(r#"{{ "+z" = [0.0, 0.0, -0.{rate:03}] }}"#);
        shear.set("domain.wall_velocity", velocity);
        shear.set("time.steps", steps);
        shear.set("output.snapshot_every", steps / 105);
        shear.set("output.history_every", 1000 / rate);
        if let Some(seed) = self.seed {
            packing.set("seed", seed);
        }
        if let Some(stiffness) = &self.stiffness {
            for words in [&mut packing, &mut consolidation, &mut shear] {
                words.set_stiffness(stiffness);
            }
        }
        if self.law == Springs::Hertz {
            // The scenes have this law already; as an argument it distinguishes these runs from others.
            for words in [&mut packing, &mut consolidation, &mut shear] {
                words.set("law.normal", "hertz");
            }
        }
        if self.gravity {
            for words in [&mut consolidation, &mut shear] {
                words.set("gravity", "[0.0, 0.0, -9.81]");
            }
        }
        let stage = |name: &str, before, words| Stage { name: name.to_owned(), before, words };
        let mut stages = vec![
            stage("packing", None, packing.clone()),
            stage("consolidation", Some("packing"), consolidation),
            stage("shear", Some("consolidation"), shear),
        ];
        for number in 2..=self.packings {
            let mut another = packing.clone();
            another.set("seed", self.seed.unwrap_or(1) + u64::from(number) - 1);
            stages.push(stage(&another_packing(number), None, another));
        }
        stages
    }

    /// Changes to the scene of a stage for a method.
    fn of_method(&self, method: Method, stage: &str) -> Words {
        let mut words = Words::default();
        for (key, value) in method.settings() {
            words.set(&format!("contact.{key}"), value);
        }
        if let Some(ratio) = self.erosion_ratio.as_ref().filter(|_| method.is_erosion()) {
            words.set("contact.erosion_ratio", ratio);
        }
        let stage = if stage.starts_with("packing") { "packing" } else { stage };
        match (method, stage) {
            // Forces of erosion have no potential: particles never come quite to rest, and not at all if forces jump at touch.
            (Method::Erosion, "packing") => words.set("stop.unbalanced", 0.05),
            (Method::CheckedErosion, "packing") => words.set("time.steps", "150_000"),
            // About as many steps as with the common normal.
            (Method::Erosion | Method::CheckedErosion, "consolidation") => {
                words.set("time.steps", "75_000");
            }
            _ => {}
        }
        words
    }

    /// The equivalent command line.
    fn command(&self) -> String {
        let mut text = "run/paper/triaxial/run".to_owned();
        let flag = |is_given, name: &str| if is_given { format!(" {name}") } else { String::new() };
        let option = |name: &str, value: Option<&str>| {
            value.map_or_else(String::new, |value| format!(" {name} {value}"))
        };
        text += &flag(self.quick, "--quick");
        let _ = write!(text, " --rate {}", self.rate());
        text += &flag(self.gravity, "--gravity");
        text += &option("--seed", self.seed.map(|seed| seed.to_string()).as_deref());
        text += &option(
            "--packings",
            (self.packings > 1).then(|| self.packings.to_string()).as_deref(),
        );
        text += &option("--stiffness", self.stiffness.as_deref());
        text += &option("--law", (self.law == Springs::Hertz).then_some("hertz"));
        text += &option("--erosion-ratio", self.erosion_ratio.as_deref());
        for method in &self.methods {
            text += &option("--method", Some(method.folder()));
        }
        text + &option("--ranks", Some(&self.ranks.to_string()))
    }

    /// Runs the missing stages, with the checkout as current directory, and writes the report on all methods with runs. Returns
    /// its path.
    ///
    /// # Errors
    /// If a folder has a run with other arguments, a run fails or is stopped, or a file cannot be written or read.
    pub fn run(&self, signals: &Signals) -> Result<PathBuf> {
        let (out, stages) = (self.folder(), self.stages());
        // One report compares all methods, so that their arguments must agree.
        for entry in fs::read_dir(&out).into_iter().flatten() {
            let folder = entry?.path();
            for Stage { name, words, .. } in &stages {
                check_words(&folder.join(name), 0, words)?;
            }
        }
        for &method in &self.methods {
            for stage in &stages {
                self.run_stage(&out.join(method.folder()), method, stage, signals)?;
            }
        }
        let report = out.join("report");
        store(&report, &regenerate(&out, &Choice::default())?)?;
        let text = machine(&self.command(), "") + &commits(&out)?;
        store(&report, &[("machine.txt".into(), text.clone())])?;
        if self.aloud {
            print!("{text}");
        }
        Ok(report)
    }

    /// Runs a stage of a method, continues it, or finds it done.
    fn run_stage(
        &self,
        folder: &Path,
        method: Method,
        stage: &Stage,
        signals: &Signals,
    ) -> Result<()> {
        let here = folder.join(&stage.name);
        let own = self.of_method(method, &stage.name);
        check_words(&here, 1, &own)?;
        if here.join("done").exists() {
            return Ok(());
        }
        let words = format!("{}\n{}\n", stage.words.line(), own.line());
        store(&here, &[("words".into(), words)])?;
        if let Some(commit) = short_commit() {
            let commits = fs::File::options().create(true).append(true).open(here.join("commits"));
            writeln!(commits?, "{commit}")?;
        }
        let log = here.join("run.log");
        let mut arguments = own;
        let directory = here.display().to_string();
        arguments.0.extend(["--out".to_owned(), directory.clone()]);
        arguments.0.extend_from_slice(&stage.words.0);
        if let Some(before) = stage.before {
            arguments.set("start", folder.join(before).display());
        }
        if series::all(&here).is_ok() {
            arguments.0.extend(["--start".to_owned(), directory.clone()]);
        } else if log.exists() {
            fs::remove_file(&log)?;
        }
        let law = if self.law == Springs::Hertz { "hertz/" } else { "" };
        let scene = stage.name.split('-').next().unwrap_or_default();
        let scene = format!("run/paper/triaxial/{law}{scene}.toml");
        let command = dem_mpi(self.ranks, &scene, &arguments.0)?;
        run(command, &directory, &log, self.aloud, signals)?;
        store(&here, &[("done".into(), String::new())])
    }
}

/// Folder of another packing of the same kind.
pub(super) fn another_packing(number: u32) -> String {
    format!("packing-{number}")
}

/// Checks that a run in the folder, if there is one, was made with these arguments in this line.
fn check_words(folder: &Path, line: usize, words: &Words) -> Result<()> {
    if folder.join("done").exists() || folder.join("last.vtkhdf").exists() {
        let known = fs::read_to_string(folder.join("words")).unwrap_or_default();
        ensure!(
            known.lines().nth(line) == Some(&words.line()),
            "{} is of a run with other words: give --out another folder, or remove it",
            folder.display()
        );
    }
    Ok(())
}

/// Commits at which each stage ran, as lines of `machine.txt`.
fn commits(out: &Path) -> Result<String> {
    let mut lines = Vec::new();
    for method in fs::read_dir(out)? {
        let method = method?;
        for stage in fs::read_dir(method.path()).into_iter().flatten() {
            let stage = stage?;
            let Ok(text) = fs::read_to_string(stage.path().join("commits")) else { continue };
            let mut commits: Vec<&str> = text.lines().collect();
            commits.dedup();
            let [method, stage] = [method.file_name(), stage.file_name()];
            let (method, stage) = (method.display(), stage.display());
            lines.push(format!("stage    {method}/{stage}: {}\n", commits.join(" ")));
        }
    }
    lines.sort();
    Ok(lines.concat())
}
