//! Cost of contacts in the compression, beside that of the same pairs alone: 1,000 steps on two ranks from a snapshot
//! at about 10 % strain, for each method that has runs. The machine must do nothing else.

use super::Method;
use crate::packed::Packed;
use crate::record::store;
use crate::simulation::{Signals, absolute, dem_mpi, run};
use anyhow::{Context, Result};
use benchmarking::quartiles;
use clap::Args;
use dem_mpi::output::performance::Performance;
use dem_mpi::pairs::{Pairs, resolve, time};
use dem_mpi::post::history::History;
use dem_mpi::post::series;
use std::fmt::Write;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// Plan of the measurement.
#[derive(Args, Clone, Debug)]
pub struct Plan {
    /// Repetitions in turn; medians count
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..))]
    pub rounds: u32,
    /// The folder of the runs of `triaxial` [default: out/paper/triaxial in the checkout]
    #[arg(long, value_name = "DIR", value_parser = absolute)]
    pub out: Option<PathBuf>,
}

const RANKS: u32 = 2;
const STEPS: u64 = 1000;
/// Repeats of the timing of pairs alone, of which the median counts.
const REPEATS: usize = 15;

/// State in which a method is measured.
struct State {
    method: Method,
    snapshot: PathBuf,
    /// Touching pairs, and the others from the nearest on.
    touching: Packed,
    apart: Packed,
    rounds: Vec<Round>,
}

/// One measurement of a method.
#[derive(Clone, Copy)]
struct Round {
    /// Contacts of all particles; a contact between particles counts twice.
    ends: f64,
    /// Resolved pairs that do not touch, for each contact.
    near_misses: f64,
    /// Time per contact in the run [ns].
    contact_ns: f64,
    /// Time per step [ms].
    step_ms: f64,
    /// Time of contact resolution per step [ms].
    resolution_ms: f64,
    /// Time of a touching pair alone [ns].
    touching_ns: f64,
    /// Time of a near miss alone [ns]; 0 if the run has none.
    near_ns: f64,
}

impl Plan {
    /// Measures, prints the table and writes it to `report/cost.csv`, with the checkout as current directory.
    ///
    /// # Errors
    /// If a snapshot cannot be read, a run fails or is stopped, or a file cannot be written.
    pub fn run(&self, signals: &Signals) -> Result<()> {
        let out = self.out.clone().unwrap_or_else(|| "out/paper/triaxial".into());
        let mut states = Vec::new();
        for method in Method::ALL {
            let shear = out.join(method.folder()).join("shear");
            if shear.join("last.vtkhdf").exists() {
                states.push(State::read(method, &shear)?);
            }
        }
        let work = out.join("cost");
        fs::create_dir_all(&work)?;
        for _ in 0..self.rounds {
            for state in &mut states {
                state.measure(&work, signals)?;
            }
        }
        fs::remove_dir_all(&work)?;
        let mut table = String::from(
            "method,touching_ns,near_miss_ns,near_misses_per_contact,predicted_ns_per_contact,ns_per_contact_in_the_run,\
             predicted_ms_per_step,ms_per_step,over_prediction\n",
        );
        for state in &states {
            state.row(&mut table);
        }
        store(&out.join("report"), &[("cost.csv".into(), table.clone())])?;
        print!("{table}");
        Ok(())
    }
}

impl State {
    fn read(method: Method, shear: &Path) -> Result<Self> {
        let mut snapshots = series::all(shear)?;
        let snapshot = snapshots.swap_remove(snapshots.len() * 3 / 10);
        let all = Packed::read(&snapshot)?;
        let answers = resolve(&all.pairs()?, &method.resolver());
        let overlap = |pair: usize| answers[pair].touch.map_or(f64::NEG_INFINITY, |t| t.overlap);
        let (touching, mut apart): (Vec<usize>, Vec<usize>) =
            (0..all.len()).partition(|&pair| overlap(pair) > 0.0);
        apart.sort_by(|&a, &b| overlap(b).total_cmp(&overlap(a)));
        let (touching, apart) = (all.some(&touching), all.some(&apart));
        Ok(Self { method, snapshot, touching, apart, rounds: Vec::new() })
    }

    fn measure(&mut self, work: &Path, signals: &Signals) -> Result<()> {
        let folder = work.join("run");
        let mut arguments: Vec<String> = Vec::new();
        let settings = self.method.settings().iter();
        let settings = settings.map(|(key, value)| format!("contact.{key}={value}"));
        let outputs =
            ["time.steps=1_000_000_000", "output.snapshot_every=0", "output.history_every=0"];
        for setting in settings.chain(outputs.map(str::to_owned)) {
            arguments.extend(["--set".to_owned(), setting]);
        }
        let (start, out) = (self.snapshot.display().to_string(), folder.display().to_string());
        let steps = STEPS.to_string();
        let rest = ["--start", &start, "--out", &out, "--overwrite", "--steps", &steps];
        arguments.extend(rest.map(str::to_owned));
        let command = dem_mpi(RANKS, "run/paper/triaxial/shear.toml", &arguments)?;
        let what = format!("{} from {start}", self.method.folder());
        run(command, &what, &work.join("log"), false, signals)?;

        let rows = Performance::read(&folder)?;
        let row = rows.last().with_context(|| format!("{what} has no performance.csv"))?;
        let history = History::read(File::open(folder.join("history.csv"))?)?;
        let last = |name: &str| history.last(name).with_context(|| format!("{what} has no {name}"));
        let near_misses = row.resolved_pairs as f64 / row.contacts as f64 - 1.0;
        let per_step = 1e3 / row.steps as f64;
        // The number of separate pairs is that resolved by the run, for some methods none.
        let near = (near_misses * self.touching.len() as f64) as usize;
        let near = self.apart.some(&(0..near.min(self.apart.len())).collect::<Vec<_>>());
        self.rounds.push(Round {
            ends: last("coordination")? * last("particles")?,
            near_misses,
            contact_ns: 1e9 * row.contact_resolution_s / row.contacts as f64,
            step_ms: per_step * row.wall_s,
            resolution_ms: per_step * row.contact_resolution_s / f64::from(RANKS),
            touching_ns: self.batched_ns(&self.touching.pairs()?),
            near_ns: self.batched_ns(&near.pairs()?),
        });
        Ok(())
    }

    /// Time of a pair in a batch, as in a simulation [ns]; 0 without pairs.
    fn batched_ns(&self, pairs: &Pairs) -> f64 {
        if pairs.is_empty() {
            return 0.0;
        }
        let method = self.method.resolver();
        time(pairs, &resolve(pairs, &method), &method, REPEATS).batched
    }

    fn row(&self, table: &mut String) {
        let Some(last) = self.rounds.last() else { return };
        let median = |pick: fn(&Round) -> f64| quartiles(self.rounds.iter().map(pick).collect())[1];
        // Contacts with walls have closed forms and cost next to nothing.
        let touching = self.touching.len() as f64;
        let among = touching / (last.ends - touching);
        let (of_touching, of_near) = (median(|r| r.touching_ns), median(|r| r.near_ns));
        let predicted = among * of_touching + last.near_misses * of_near;
        let (contact, step) = (median(|r| r.contact_ns), median(|r| r.step_ms));
        let predicted_step = step - median(|r| r.resolution_ms) * (1.0 - predicted / contact);
        let _ = writeln!(
            table,
            "{},{of_touching:.1},{of_near:.1},{:.3},{predicted:.1},{contact:.1},{predicted_step:.3},{step:.3},{:.3}",
            self.method.folder(),
            last.near_misses,
            step / predicted_step,
        );
    }
}
