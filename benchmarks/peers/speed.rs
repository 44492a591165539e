//! Time of a step by each code, in turns.

use crate::case::{Apart, Case};
use crate::codes::{Code, Run, Steps, own, run};
use anyhow::ensure;
use benchmarking::machine::load;
use benchmarking::quartiles;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Time after which codes are compared, before they are timed [s].
const CHECKED: f64 = 1e-3;

#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    turns: Turns,
    /// Codes other than this program that are left out.
    #[arg(long, value_delimiter = ',')]
    without: Vec<String>,
    /// Also this program with the spheres in a random order.
    #[arg(long)]
    shuffled: bool,
    /// Also this program with narrower registers: AVX's, and those of every processor.
    #[arg(long)]
    registers: bool,
    /// Copies of the state side by side along x and along y: 7 make 980,000 spheres.
    #[arg(long, default_value_t = 1)]
    tiles: u32,
}

/// Length and number of runs.
#[derive(clap::Args)]
pub(crate) struct Turns {
    /// Steps of a run; a run of a tenth precedes it, to subtract the CPU time of the start.
    #[arg(long, default_value_t = 1000)]
    steps: u64,
    /// Number of rounds, in each of which every code has one turn.
    #[arg(long, default_value_t = 9)]
    rounds: u32,
    /// Numbers of ranks.
    #[arg(long, value_delimiter = ',', default_values_t = [1, 2])]
    ranks: Vec<u32>,
}

/// Time of a run in µs per particle and step.
struct Row {
    code: Code,
    ranks: u32,
    round: u32,
    wall: f64,
    cpu: f64,
}

/// Writes `time.csv`, or `tiles_<n>.csv`, and `versions.txt`, and prints the medians.
pub(crate) fn time(mut case: Case, options: &Options, record: &Path) -> anyhow::Result<()> {
    case.tile(options.tiles);
    let case = &case;
    let mut codes = vec![Code::Own, Code::Lammps, Code::Liggghts];
    codes.retain(|code| !options.without.iter().any(|name| name == code.name()));
    if options.shuffled {
        codes.push(Code::OwnShuffled);
    }
    if options.registers {
        codes.extend([Code::OwnAvx, Code::OwnAny]);
    }
    ensure!(codes.contains(&Code::Own), "this program cannot be left out");
    let missing: Vec<_> = codes.iter().filter(|c| !c.is_installed()).map(|c| c.name()).collect();
    ensure!(
        missing.is_empty(),
        "not installed: {}; install or leave out by --without",
        missing.join(", ")
    );
    let file = if options.tiles == 1 {
        let mut versions = String::new();
        for &code in &codes {
            writeln!(versions, "{:<17}{}", code.name(), code.version()?)?;
        }
        fs::write(record.join("versions.txt"), versions)?;
        record.join("time.csv")
    } else {
        record.join(format!("tiles_{}.csv", options.tiles))
    };
    compare(case, &codes)?;
    options.turns.time(&mut codes, case.start.len(), &file, |code, count, ranks| {
        run(code, case, Steps { step: case.step, count, ranks })
    })
}

/// Writes `settled.csv` and prints the medians.
pub(crate) fn settled(turns: &Turns, record: &Path) -> anyhow::Result<()> {
    let scene = Path::new("benchmarks/settled/scene.toml");
    let folder = tempfile::tempdir()?;
    let one = |code, count: u64, ranks| {
        own(code, scene, &[("time.steps", count.to_string())], ranks, folder.path())
    };
    let particles = one(Code::Own, 1, 1)?.end.len();
    turns.time(&mut [Code::Own], particles, &record.join("settled.csv"), one)
}

impl Turns {
    /// Times codes in turns with `particles` particles, writes the table into a file and prints the medians. `run` takes code,
    /// steps and ranks.
    pub(crate) fn time(
        &self,
        codes: &mut [Code],
        particles: usize,
        file: &Path,
        run: impl Fn(Code, u64, u32) -> anyhow::Result<Run>,
    ) -> anyhow::Result<()> {
        let mut rows = Vec::new();
        let mut csv =
            String::from("ranks,round,code,steps,wall_s,cpu_s,short_steps,short_cpu_s,load\n");
        let (steps, short) = (self.steps, (self.steps / 10).max(1));
        for &ranks in &self.ranks {
            for round in 0..self.rounds {
                // Each round begins with another code.
                codes.rotate_left(1);
                for &code in &*codes {
                    let (few, many) = (run(code, short, ranks)?, run(code, steps, ranks)?);
                    let load = load(1);
                    writeln!(
                        csv,
                        "{ranks},{round},{},{steps},{},{},{short},{},{load}",
                        code.name(),
                        many.seconds,
                        many.cpu,
                        few.cpu
                    )?;
                    let particles = particles as f64 * 1e-6;
                    let wall = many.seconds / (steps as f64 * particles);
                    let cpu = (many.cpu - few.cpu) / ((steps - short) as f64 * particles);
                    rows.push(Row { code, ranks, round, wall, cpu });
                }
                fs::write(file, &csv)?;
            }
        }
        print(&rows, &self.ranks);
        Ok(())
    }
}

/// Checks that all codes agree, as far as their laws are the same, at this step.
fn compare(case: &Case, codes: &[Code]) -> anyhow::Result<()> {
    let steps = Steps::until(CHECKED, case.step);
    let own = run(Code::Own, case, steps)?.end;
    let way = Apart::of(&case.start, &own).median;
    for &code in codes.iter().filter(|&&code| code != Code::Own) {
        for ranks in [1, 2] {
            let end = run(code, case, Steps { ranks, ..steps })?.end;
            let apart = Apart::of(&own, &end);
            let part = apart.median / way;
            println!(
                "{} ({ranks} rank{}) is {:.1e} m from dem-mpi after {} steps (median), {:.2} % of the way; at most {:.1e} m",
                code.name(),
                if ranks == 1 { "" } else { "s" },
                apart.median,
                steps.count,
                100.0 * part,
                apart.largest
            );
            // Sliding contacts of LIGGGHTS have no dashpot.
            let allowed = if code == Code::Liggghts { 0.03 } else { 0.006 };
            ensure!(part < allowed, "{} does something else", code.name());
        }
    }
    println!();
    Ok(())
}

/// Prints medians over the rounds.
fn print(rows: &[Row], ranks: &[u32]) {
    println!(
        "µs per particle-step: median (quartiles), least; ratio: median over rounds of a code's time over dem-mpi's of that round\n"
    );
    println!(
        "| ranks | code | wall | least | ratio | CPU | least | ratio |\n|---|---|---|---|---|---|---|---|"
    );
    for &ranks in ranks {
        let mut codes: Vec<Code> = Vec::new();
        for row in rows.iter().filter(|row| row.ranks == ranks) {
            if !codes.contains(&row.code) {
                codes.push(row.code);
            }
        }
        codes.sort_by_key(|code| code.name());
        for code in codes {
            let of =
                |code: Code| rows.iter().filter(move |row| row.ranks == ranks && row.code == code);
            let mut line = format!("| {ranks} | {} |", code.name());
            for value in [(|row| row.wall) as fn(&Row) -> f64, |row| row.cpu] {
                let [low, median, high] = quartiles(of(code).map(value).collect());
                let least = of(code).map(value).fold(f64::INFINITY, f64::min);
                let ratios = of(code).filter_map(|row| {
                    let own = of(Code::Own).find(|own| own.round == row.round)?;
                    Some(value(row) / value(own))
                });
                let [_, ratio, _] = quartiles(ratios.collect());
                write!(line, " {median:.3} ({low:.3} to {high:.3}) | {least:.3} | {ratio:.2} |")
                    .expect("a string takes all");
            }
            println!("{line}");
        }
    }
}
