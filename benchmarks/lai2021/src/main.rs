//! lai2021: the study of Lai et al. (2021), one subcommand for each part.

use anyhow::{Context, Result};
use clap::{Args, Parser, Subcommand, ValueEnum};
use dem_mpi::pairs::{Pairs, write};
use dem_mpi::post::Settings;
use dem_mpi::post::fabric::Among;
use dem_mpi::post::region::{Bounds, Margin, Region};
use dem_mpi::post::series::Choice;
use lai2021::cases::{self, Meeting, Sampling};
use lai2021::record::store;
use lai2021::simulation::{CHECKOUT, STOPPED, Signals, SimulationError, absolute};
use lai2021::triaxial::{cost, stages};
use lai2021::{sensitivity, single_contact, statements, triaxial};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Lai et al. (2021), regenerated: GJK with radial erosion beside EPA and the common normal.
#[derive(Parser)]
#[command(version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write the pairs of a case of section 2 as CSV, for dem-contact
    Generate {
        #[arg(value_enum)]
        case: Case,
        /// Number of random pairs to draw
        #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
        count: u32,
        /// Seed of the random pairs: the same seed gives the same pairs on every machine
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
    /// All: section-2, triaxial, sensitivity, and the table of all statements
    All {
        /// Smaller packings, fewer pairs, no EPA and no sensitivity: minutes
        #[arg(long)]
        quick: bool,
    },
    /// Section 2: figures 5 to 8 and table 1, from single contacts
    #[command(name = "section-2")]
    Section2 {
        /// Where to write [default: out/paper/single-contact in the checkout]
        #[arg(long, value_name = "DIR", value_parser = absolute)]
        out: Option<PathBuf>,
        #[command(flatten)]
        plan: single_contact::Plan,
    },
    /// The runs of section 3 (packing, consolidation, triaxial compression) and section-3 of them. Stopped at any moment
    /// they go on from their newest snapshots when called again with the same words
    Triaxial(stages::Plan),
    /// Cost of contacts in the runs of triaxial, beside the same pairs resolved alone
    Cost(cost::Plan),
    /// Section 3: figures 9 to 14, from the runs DIR/METHOD/STAGE, METHOD being common-normal, epa, gjk-erosion,
    /// gjk-gjk-erosion and STAGE packing, consolidation, shear
    #[command(name = "section-3")]
    Section3 {
        /// The folder of the runs
        #[arg(value_name = "DIR")]
        runs: PathBuf,
        /// Where to write [default: `post` in DIR]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        #[command(flatten)]
        measured: Measured,
    },
    /// Dependence of the packings of section 3 on erosion ratio and stiffness, shape, gravity and rate. Stopped at any moment
    /// it goes on when called again with the same words
    Sensitivity(sensitivity::Plan),
    /// Every statement in one table with counts: statements.md and statements.csv
    Statements {
        /// Folders written by section-2, section-3 and sensitivity
        #[arg(required = true, value_name = "DIR")]
        folders: Vec<PathBuf>,
        /// Where to write [default: the last DIR]
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
}

/// A case of section 2.
#[derive(Clone, Copy, ValueEnum)]
enum Case {
    /// Parallel 1:2 ellipsoids, overlap 0 to 0.05 m
    #[value(name = "case-i")]
    Parallel,
    /// Long axis 1 to 4 m, B turned by 0 to 180 degrees, overlap 0.02 m
    #[value(name = "case-ii")]
    Turned,
    /// Random 1:2 ellipsoids, overlap 0 to 0.05 m
    #[value(name = "case-iii")]
    Random,
    /// Random 1:2 ellipsoids, clearance 0 to 1 m
    #[value(name = "case-iii-apart")]
    Apart,
}

/// Region and contacts to measure in packings.
#[derive(Args)]
struct Measured {
    /// Measure only in this box, in metres; a particle belongs to it if its centre does
    #[arg(long, value_name = "x0,x1,y0,y1,z0,z1", allow_hyphen_values = true)]
    region: Option<Bounds>,
    /// Leave out a layer along the sides, in metres (0.004) or grain diameters (1.5d)
    #[arg(long, value_name = "LENGTH", conflicts_with = "region")]
    margin: Option<Margin>,
    /// Count contacts with walls too in fabric, roses and force distributions
    #[arg(long)]
    fabric_with_walls: bool,
}

impl Measured {
    fn choice(&self) -> Choice {
        let Self { region, margin, fabric_with_walls } = *self;
        let among = if fabric_with_walls { Among::ParticlesAndWalls } else { Among::Particles };
        let region = region.map_or(Region::Whole, Region::Box);
        Choice { settings: Settings { region, among }, margin }
    }
}

/// Exit status after a failed run of dem-mpi.
const FAILED: u8 = 1;
/// Exit status after a wrong argument, or a file that cannot be read or written.
const WRONG_INPUT: u8 = 2;

fn main() -> ExitCode {
    let error = match run(Arguments::parse().command) {
        Ok(()) => return ExitCode::SUCCESS,
        Err(error) if is_closed_pipe(&error) => return ExitCode::SUCCESS,
        Err(error) => error,
    };
    eprintln!("lai2021: {error:#}");
    ExitCode::from(match error.downcast_ref() {
        Some(SimulationError::Stopped { .. }) => STOPPED,
        Some(SimulationError::Failed { .. }) => FAILED,
        _ => WRONG_INPUT,
    })
}

fn run(command: Command) -> Result<()> {
    match command {
        Command::Generate { case, count, seed } => {
            let pairs = generate(case, count as usize, seed);
            write::pairs(&pairs, BufWriter::new(std::io::stdout().lock()))?;
        }
        Command::Section2 { out, plan } => {
            in_the_checkout()?;
            let out = out.unwrap_or_else(|| SINGLE_CONTACT.into());
            plan.run(&out)?;
            look_at(&out.join("report.md"));
        }
        Command::Triaxial(plan) => {
            in_the_checkout()?;
            look_at(&plan.run(&Signals::take()?)?.join("report.md"));
        }
        Command::Cost(plan) => {
            in_the_checkout()?;
            plan.run(&Signals::take()?)?;
        }
        Command::Section3 { runs, out, measured } => {
            let out = out.unwrap_or_else(|| runs.join("post"));
            store(&out, &triaxial::regenerate(&runs, &measured.choice())?)?;
            look_at(&out.join("report.md"));
        }
        Command::Statements { folders, out } => {
            let out = out.or_else(|| folders.last().cloned()).unwrap_or_default();
            store(&out, &statements::regenerate(&folders)?)?;
            look_at(&out.join("statements.md"));
        }
        Command::Sensitivity(plan) => {
            in_the_checkout()?;
            look_at(&plan.run(&Signals::take()?)?);
        }
        Command::All { quick } => all(quick)?,
    }
    Ok(())
}

/// Output folder of section 2.
const SINGLE_CONTACT: &str = "out/paper/single-contact";

/// Runs all parts in turn; finished parts are not run again.
fn all(quick: bool) -> Result<()> {
    use triaxial::Method::{CheckedErosion, CommonNormal, Epa, Erosion};
    in_the_checkout()?;
    let signals = Signals::take()?;
    let (plan, runs, out) = if quick {
        let methods = vec![CommonNormal, CheckedErosion, Erosion];
        let runs = stages::Plan { quick, ..stages::Plan::new(methods) };
        (single_contact::Plan { count: 10_000, seed: 1, repeats: 1 }, runs, "out/paper/quick")
    } else {
        let methods = vec![CommonNormal, CheckedErosion, Erosion, Epa];
        let runs = stages::Plan { rate: Some(10), packings: 3, ..stages::Plan::new(methods) };
        (single_contact::Plan { count: 1_000_000, seed: 1, repeats: 3 }, runs, "out/paper")
    };
    let section_2 = Path::new(SINGLE_CONTACT);
    if plan.is_done(section_2) {
        println!("Section 2 is in {SINGLE_CONTACT}; without that folder it is done again");
    } else {
        plan.run(section_2)?;
    }
    let mut folders = vec![PathBuf::from(SINGLE_CONTACT), runs.run(&signals)?];
    if !quick {
        folders.push(sensitivity::Plan::default().run(&signals)?);
    }
    store(Path::new(out), &statements::regenerate(&folders)?)?;
    look_at(&Path::new(out).join("statements.md"));
    Ok(())
}

/// Makes the checkout the current directory.
fn in_the_checkout() -> Result<()> {
    std::env::set_current_dir(CHECKOUT).with_context(|| format!("cannot go to {CHECKOUT}"))
}

fn look_at(page: &Path) {
    let page = page.canonicalize().unwrap_or_else(|_| page.to_path_buf());
    // A reader that stops early is not an error: the files are written by then.
    let _ = writeln!(std::io::stdout(), "\nLook at the figures:  {}", page.display());
}

fn generate(case: Case, count: usize, seed: u64) -> Pairs {
    let random = |meeting| cases::case_3(meeting, Sampling::CentreLine, count, seed);
    match case {
        Case::Parallel => cases::case_1(cases::OFFSET, &cases::overlaps_of_case_1()),
        Case::Turned => cases::case_2(&cases::steps(1.0, 4.0, 6), &cases::steps(0.0, 180.0, 36)),
        Case::Random => random(Meeting::Contact),
        Case::Apart => random(Meeting::NonContact),
    }
}

/// True for a closed pipe: a reader that stops early, such as `head`, is not an error.
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    let kind = match error.downcast_ref::<csv::Error>().map(csv::Error::kind) {
        Some(csv::ErrorKind::Io(error)) => Some(error.kind()),
        _ => None,
    };
    kind == Some(std::io::ErrorKind::BrokenPipe)
}
