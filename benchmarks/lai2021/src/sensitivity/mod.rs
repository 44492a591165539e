//! Dependence of the packings of section 3 on the choices of the paper: erosion ratio and stiffness, in packings, in
//! their rest and in their compression; the shape of the particles; gravity in the compression; the rate of the
//! compression.
//!
//! | file | content |
//! |---|---|
//! | [`cases`] | runs of packings and tests, several at a time |
//! | [`packings`] | the tables of packings: erosion, rest, aspect |
//! | [`compressions`] | the tables of triaxial tests: response, gravity, rate |
//! | [`table`] [`plot`] | tables, means, drawings |

pub mod cases;
pub mod compressions;
pub mod packings;
pub mod plot;
pub mod table;

use crate::record::{machine, store};
use crate::simulation::{Signals, absolute};
use anyhow::Result;
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// A question of the sensitivity study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Question {
    /// Packings by erosion ratio and stiffness
    Erosion,
    /// Whether such packings come to rest
    Rest,
    /// Triaxial tests by erosion ratio and stiffness
    Response,
    /// Packings by the shape of the particles
    Aspect,
    /// Triaxial tests with gravity and without
    Gravity,
    /// Triaxial tests at two rates
    Rate,
}

/// Plan of the runs.
#[derive(Args, Clone, Debug)]
pub struct Plan {
    /// A part; may be repeated [default: all six]
    #[arg(long, value_name = "PART", value_enum)]
    pub only: Vec<Question>,
    /// Packings of each kind in all parts but rate
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..))]
    pub seeds: u64,
    /// Particles in rest and response: 600, or the paper's 5120
    #[arg(long, value_name = "N", default_value_t = 600, value_parser = grains)]
    pub grains: u32,
    /// Speed of the lid in response [mm/s] [default: 5, for 5120 particles 10]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=999))]
    pub lid: Option<u32>,
    /// Runs at a time, one core each
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..))]
    pub jobs: u32,
    /// Where runs and report go [default: out/paper/sensitivity in the checkout]
    #[arg(long, value_name = "DIR", value_parser = absolute)]
    pub out: Option<PathBuf>,
}

fn grains(text: &str) -> Result<u32, String> {
    match text {
        "600" => Ok(600),
        "5120" => Ok(5120),
        _ => Err("must be 600 or 5120".into()),
    }
}

impl Default for Plan {
    fn default() -> Self {
        Self { only: Vec::new(), seeds: 3, grains: 600, lid: None, jobs: 2, out: None }
    }
}

impl Plan {
    fn lid(&self) -> u32 {
        self.lid.unwrap_or(if self.grains == 600 { 5 } else { 10 })
    }

    /// Runs the missing cases, with the checkout as current directory, and writes the tables. Returns their folder.
    ///
    /// # Errors
    /// If a folder has a run with other arguments, a run fails or is stopped, or a file cannot be written or read.
    pub fn run(&self, signals: &Signals) -> Result<PathBuf> {
        let out = self.out.clone().unwrap_or_else(|| "out/paper/sensitivity".into());
        let report = out.join("report");
        let questions = if self.only.is_empty() { Question::value_variants() } else { &self.only };
        for question in questions {
            let files = match question {
                Question::Erosion => packings::erosion(self, &out, signals)?,
                Question::Rest => packings::rest(self, &out, signals)?,
                Question::Aspect => packings::aspect(self, &out, signals)?,
                Question::Response => compressions::response(self, &out, signals)?,
                Question::Gravity => compressions::gravity(self, &out, signals)?,
                Question::Rate => compressions::rate(&out, signals)?,
            };
            store(&report, &files)?;
            self.record(*question, &report)?;
        }
        Ok(report)
    }

    fn record(&self, question: Question, report: &Path) -> Result<()> {
        let name =
            question.to_possible_value().expect("no question is hidden").get_name().to_owned();
        let Self { seeds, grains, jobs, .. } = self;
        let command = format!(
            "run/paper/sensitivity/run --only {name} --seeds {seeds} --grains {grains} --lid {} --jobs {jobs}",
            self.lid()
        );
        store(report, &[(format!("machine_{name}.txt"), machine(&command, ""))])
    }
}

/// Files, by name and content.
type Files = Vec<(String, String)>;
