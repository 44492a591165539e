//! Many runs of one scene: `dem-mpi sweep`.
//!
//! Each combination of values is a run of this program as a child process, in its own folder. Beside the files of the run this folder has
//!
//! * `scene.toml`, the scene with the values;
//! * `log.txt`, the messages of the run;
//! * `sweep.json`, its status and its time.
//!
//! The folder of the sweep has `sweep.csv`, a row for each run, and `sweep.svg`, the measures against the first key with several numbers.
//! The next call of a sweep continues it: finished runs stay, others go on from their newest snapshot.

mod results;
mod varied;

use crate::arguments::{FAILED, STOPPED, UNMET};
use crate::comm::alone::Alone;
use crate::files;
use crate::output::report::version;
use crate::output::{self, snapshot};
use crate::scene::{Scene, assemble};
use crate::text::{MOST_NAMED, listed, print_error};
use clap::Parser;
pub use results::FIGURES;
use results::{OF_POST, is_of_post};
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::{available_parallelism, sleep};
use std::time::{Duration, Instant};
pub use varied::{Combination, Varied, combinations};

/// Number of combinations whose errors are printed; the others are counted.
const SHOWN: usize = 3;
/// Number of last messages of a failed run that are printed.
const WORDS: usize = 4;
/// Time between checks of the runs.
const POLL: Duration = Duration::from_millis(20);

/// Run a scene with all combinations of values, each in a folder of its own, and put what came out in one table.
///
/// A sweep that was interrupted goes on when it is called again: runs that are done stay, others go on from their newest
/// snapshot.
#[derive(Parser, Clone, Debug)]
#[command(name = "sweep", bin_name = "dem-mpi sweep", display_name = "dem-mpi sweep", version = version(), color = clap::ColorChoice::Never)]
pub struct Sweep {
    /// The scene: what to simulate, a TOML file
    scene: PathBuf,
    /// Values of a key of the scene: path.to.key=value,value,... or path.to.key=1..3 (1, 2 and 3). May be repeated: all combinations run
    #[arg(long, value_name = "KEY=VALUES", required = true, value_parser = Varied::parse)]
    vary: Vec<Varied>,
    /// Change a value of the scene in all runs: path.to.key=value (may be repeated)
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Measures in the table, with commas between: columns of history.csv, with their last values, figures of report.json
    /// such as packing.coordination, and those of dem-post such as post.summary.solid_fraction. Default: all columns of
    /// history.csv, without a plot
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    measure: Vec<String>,
    /// Options of dem-post for measures that begin with `post.`, such as "--slope radial"
    #[arg(
        long,
        value_name = "OPTIONS",
        default_value = "",
        hide_default_value = true,
        allow_hyphen_values = true
    )]
    post: String,
    /// The folder for the table and the folders of the runs. Default: the scene's output.directory with `_sweep` behind it
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// So many runs at once. Default: as many as there are cores for their ranks
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    jobs: Option<u32>,
    /// Ranks of each run, started by mpirun, or by what the variable MPIRUN names. One rank needs none
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=65536))]
    ranks: u32,
}

/// Status of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Status {
    /// Not ended.
    #[default]
    Open,
    Done,
    /// Done without reaching `[stop]`.
    Unmet,
    /// Stopped by a signal; can continue.
    Stopped,
    Failed,
}

impl Status {
    const fn is_over(self) -> bool {
        matches!(self, Self::Done | Self::Unmet)
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Done => "done",
            Self::Unmet => "unmet",
            Self::Stopped => "stopped",
            Self::Failed => "failed",
        }
    }
}

/// Content of `sweep.json`.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct State {
    status: Status,
    /// Sum over all parts of the run.
    wall_s: f64,
}

/// A run.
struct Job {
    combination: Combination,
    /// Overrides, as for `--set`.
    overrides: Vec<String>,
    /// The scene with them.
    text: String,
    folder: PathBuf,
    state: State,
    measured: Vec<Option<f64>>,
}

impl Sweep {
    /// Runs all unfinished jobs, until `signal` has a number. Returns the exit status.
    ///
    /// # Errors
    /// Errors of the scene or the arguments; no run has begun.
    pub fn run(&self, signal: &AtomicUsize) -> Result<u8, String> {
        let jobs = self.jobs()?;
        let (first, _) = jobs.first().ok_or("nothing to run")?;
        let out = first.folder.parent().unwrap_or(Path::new("")).to_owned();
        let names = self.names(&jobs)?;
        let mut jobs: Vec<Job> = jobs.into_iter().map(|(job, _)| job).collect();
        for job in &mut jobs {
            job.take_up()?;
            if job.state.status.is_over() {
                job.measure(&names, &self.post);
            }
        }
        let _held_until_the_end =
            output::claim(&out, &mut Alone::default()).map_err(|error| error.to_string())?;
        let mut sweep = Running { order: self, out: &out, names: &names, jobs, children: vec![] };
        Ok(sweep.all(signal).unwrap_or_else(|error| {
            print_error(format_args!("{}: {error}; the runs are stopped", out.display()));
            sweep.stop();
            sweep.children.iter_mut().for_each(|(_, child, _)| drop(child.wait()));
            FAILED
        }))
    }

    /// All combinations, each checked as a run would check it, with the columns of its history.
    fn jobs(&self) -> Result<Vec<(Job, Vec<String>)>, String> {
        let mut jobs: Vec<(Job, Vec<String>)> = Vec::new();
        let mut wrong = Vec::new();
        let mut out = self.out.clone();
        for combination in combinations(&self.vary)? {
            let own = self.vary.iter().zip(&combination.values);
            let own = own.map(|(varied, value)| format!("{}={value}", varied.key));
            let overrides: Vec<String> = self.set.iter().cloned().chain(own).collect();
            match Scene::read(&self.scene, &overrides) {
                Err(errors) => wrong.push(format!("{}: {errors}", combination.name)),
                Ok(scene) => {
                    let out = out.get_or_insert_with(|| {
                        let mut name = scene.out.file_name().unwrap_or_default().to_owned();
                        name.push("_sweep");
                        scene.out.with_file_name(name)
                    });
                    let folder = out.join(&combination.name);
                    let sim = assemble::assemble(&scene, &Alone::default());
                    if let Err(words) = scene.stop.check(&sim) {
                        wrong.push(format!("{}: {words}", combination.name));
                    }
                    let columns = sim.columns();
                    let (state, measured) = (State::default(), Vec::new());
                    let text = scene.text;
                    let job = Job { combination, overrides, text, folder, state, measured };
                    jobs.push((job, columns));
                }
            }
        }
        if wrong.is_empty() {
            return Ok(jobs);
        }
        let more = wrong.len().saturating_sub(SHOWN);
        wrong.truncate(SHOWN);
        let more = if more > 0 { format!("\nand {more} more combinations") } else { String::new() };
        Err(format!("{}{more}", wrong.join("\n")))
    }

    /// Measures, which every run must have.
    fn names(&self, jobs: &[(Job, Vec<String>)]) -> Result<Vec<String>, String> {
        for name in &self.measure {
            let is_there = |columns: &[String]| columns.contains(name);
            let lacking = jobs.iter().find(|(_, columns)| !is_there(columns));
            if let Some((job, columns)) =
                lacking.filter(|_| !FIGURES.contains(&&**name) && !is_of_post(name))
            {
                return Err(format!(
                    "--measure {name}: run {} has no such column in history.csv and no such figure in report.json. Columns are {}; figures are {}; those of dem-post begin with `{OF_POST}`",
                    job.combination.name,
                    columns.join(", "),
                    FIGURES.join(", ")
                ));
            }
        }
        if !self.measure.is_empty() {
            return Ok(self.measure.clone());
        }
        let mut all: Vec<String> = Vec::new();
        for (_, columns) in jobs {
            for name in columns {
                if !all.contains(name) {
                    all.push(name.clone());
                }
            }
        }
        Ok(all)
    }
}

impl Job {
    /// Restores the state of an earlier call.
    fn take_up(&mut self) -> Result<(), String> {
        let folder = &self.folder;
        let is_empty = fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
        if is_empty || !folder.exists() {
            return Ok(());
        }
        let state = files::read_to_string(&folder.join("sweep.json")).ok();
        let state = state.and_then(|text| serde_json::from_str(&text).ok());
        let cure = "give another --out, or move it away";
        self.state =
            state.ok_or_else(|| format!("{} was not made by a sweep: {cure}", folder.display()))?;
        let before = files::read_to_string(&folder.join("scene.toml")).unwrap_or_default();
        if before == self.text {
            Ok(())
        } else {
            Err(format!("{} has a run of another scene: {cure}", folder.display()))
        }
    }

    /// Reads the measures of a run that is over, those of dem-post after a call of it. A failure is told, and its cells stay
    /// empty.
    fn measure(&mut self, names: &[String], options: &str) {
        if names.iter().any(|name| is_of_post(name))
            && let Err(error) = self.call_dem_post(options)
        {
            print_error(format_args!("{}: {error}", self.combination.name));
        }
        self.measured = results::measured(&self.folder, names);
        for (name, _) in names.iter().zip(&self.measured).filter(|(_, found)| found.is_none()) {
            print_error(format_args!("{}: there is no number `{name}`", self.combination.name));
        }
    }

    fn call_dem_post(&self, options: &str) -> io::Result<()> {
        let program = std::env::current_exe()?.with_file_name("dem-post");
        // Figures of an earlier call, with other options.
        let _ = fs::remove_file(results::of_post(&self.folder));
        let mut command = Command::new(&program);
        command.args(options.split_whitespace()).arg("--").arg(&self.folder);
        let done = command.stdin(Stdio::null()).output().map_err(|error| {
            io::Error::other(format!("{} cannot be started: {error}", program.display()))
        })?;
        if done.status.success() {
            return Ok(());
        }
        Err(io::Error::other(String::from_utf8_lossy(&done.stderr).trim().to_owned()))
    }

    fn store(&self) -> io::Result<()> {
        let text = serde_json::to_string_pretty(&self.state)?;
        files::replace(&self.folder.join("sweep.json"), |file| writeln!(file, "{text}")).map(drop)
    }

    fn row(&self) -> results::Row<'_> {
        results::Row {
            values: &self.combination.values,
            folder: &self.combination.name,
            status: self.state.status.name(),
            wall_s: self.state.wall_s,
            measured: &self.measured,
        }
    }

    fn has_snapshot(&self) -> bool {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        entries.into_iter().any(|entry| snapshot::step_of(&entry.path()).is_some())
    }

    /// Last messages of the run.
    fn last_words(&self) -> String {
        let text = fs::read(self.folder.join("log.txt")).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
        lines[lines.len().saturating_sub(WORDS)..].join("\n  ")
    }
}

/// A sweep in progress.
struct Running<'a> {
    order: &'a Sweep,
    out: &'a Path,
    names: &'a [String],
    jobs: Vec<Job>,
    /// Running processes with the indices of their jobs.
    children: Vec<(usize, Child, Instant)>,
}

impl Running<'_> {
    fn all(&mut self, signal: &AtomicUsize) -> io::Result<u8> {
        let cores = available_parallelism().map_or(1, usize::from);
        let by_cores = (cores / self.order.ranks as usize).max(1);
        let at_once = self.order.jobs.map_or(by_cores, |jobs| jobs as usize);
        let is_open = |job: &Job| !job.state.status.is_over();
        let mut waiting: Vec<usize> =
            (0..self.jobs.len()).filter(|&k| is_open(&self.jobs[k])).collect();
        let count = self.jobs.len();
        if waiting.len() < count {
            print_error(format_args!("{} of {count} runs are done already", count - waiting.len()));
        }
        waiting.reverse();
        self.write_table()?;
        let mut is_stopping = false;
        loop {
            if signal.load(Ordering::Relaxed) != 0 && !is_stopping {
                is_stopping = true;
                waiting.clear();
                print_error("a signal stops the sweep: its runs write snapshots and end");
                self.stop();
            }
            while self.children.len() < at_once
                && let Some(job) = waiting.pop()
            {
                let child = self.start(job)?;
                self.children.push((job, child, Instant::now()));
            }
            if self.children.is_empty() {
                return self.end();
            }
            sleep(POLL);
            self.look(is_stopping)?;
        }
    }

    /// Starts a run, or continues it.
    fn start(&mut self, job: usize) -> io::Result<Child> {
        self.jobs[job].state.status = Status::Open;
        let Job { folder, text, overrides, .. } = &self.jobs[job];
        fs::create_dir_all(folder)?;
        files::replace(&folder.join("scene.toml"), |file| file.write_all(text.as_bytes()))?;
        self.jobs[job].store()?;
        let log = File::options().append(true).create(true).open(folder.join("log.txt"))?;
        let program = std::env::current_exe()?;
        let ranks = self.order.ranks;
        let mut command = if ranks == 1 {
            Command::new(program)
        } else {
            let launcher = std::env::var_os("MPIRUN").unwrap_or("mpirun".into());
            let mut command = Command::new(launcher);
            command.arg("-n").arg(ranks.to_string()).arg(program);
            command
        };
        command.args(overrides.iter().flat_map(|change| ["--set", change]));
        command.arg("--out").arg(folder);
        if self.jobs[job].has_snapshot() {
            command.arg("--start").arg(folder);
        } else {
            command.arg("--overwrite");
        }
        command.arg("--").arg(&self.order.scene);
        // Ranks of several jobs would be bound to the same cores: Open MPI up to 4, and 5.
        command.env("OMPI_MCA_hwloc_base_binding_policy", "none");
        command.env("PRTE_MCA_hwloc_default_binding_policy", "none");
        // Ctrl-C in a terminal is for the sweep, which tells its runs.
        command.process_group(0);
        command.stdin(Stdio::null()).stdout(log.try_clone()?).stderr(log);
        let started = command.spawn();
        started.map_err(|error| {
            let program = command.get_program().display();
            io::Error::other(format!("{program} cannot be started: {error}"))
        })
    }

    /// Asks all runs to write a snapshot and end. mpirun passes this signal on.
    fn stop(&self) {
        for (_, child, _) in &self.children {
            let _ = Command::new("sh").arg("-c").arg(format!("kill -USR1 {}", child.id())).status();
        }
    }

    /// Notes the runs that have ended.
    fn look(&mut self, is_stopping: bool) -> io::Result<()> {
        let mut at = 0;
        while at < self.children.len() {
            let (job, child, begin) = &mut self.children[at];
            let Some(ended) = child.try_wait()? else {
                at += 1;
                continue;
            };
            let (job, seconds) = (*job, begin.elapsed().as_secs_f64());
            self.children.swap_remove(at);
            let status = match ended.code().map(u8::try_from) {
                Some(Ok(0)) => Status::Done,
                Some(Ok(UNMET)) => Status::Unmet,
                Some(Ok(STOPPED)) => Status::Stopped,
                _ if is_stopping => Status::Stopped,
                _ => Status::Failed,
            };
            let over = self.jobs.iter().filter(|job| job.state.status.is_over()).count();
            let (count, one) = (self.jobs.len(), &mut self.jobs[job]);
            one.state.status = status;
            one.state.wall_s += seconds;
            one.store()?;
            let name = one.combination.name.clone();
            if status.is_over() {
                one.measure(self.names, &self.order.post);
                print_error(format_args!(
                    "{} of {count}: {name} is {} after {seconds:.1} s",
                    over + 1,
                    status.name()
                ));
            } else {
                print_error(format_args!(
                    "{name} {} ({ended}):\n  {}",
                    status.name(),
                    one.last_words()
                ));
            }
            self.write_table()?;
        }
        Ok(())
    }

    fn rows(&self) -> Vec<results::Row<'_>> {
        self.jobs.iter().map(Job::row).collect()
    }

    fn write_table(&self) -> io::Result<()> {
        results::write_table(
            &self.out.join("sweep.csv"),
            &self.order.vary,
            self.names,
            &self.rows(),
        )
    }

    /// Draws the plot and lists unfinished runs. Returns the exit status.
    fn end(&self) -> io::Result<u8> {
        let plot = self.out.join("sweep.svg");
        let drawn = if self.order.measure.is_empty() {
            None
        } else {
            results::plot(&self.order.vary, self.names, &self.rows())
        };
        match drawn {
            Some(Ok(svg)) => drop(files::replace(&plot, |file| file.write_all(svg.as_bytes()))?),
            Some(Err(error)) => print_error(format_args!("{}: {error}", plot.display())),
            None => {}
        }
        let of = |status: Status| {
            self.jobs
                .iter()
                .filter(move |job| job.state.status == status)
                .map(|job| &job.combination.name)
        };
        let mut answer = 0;
        for (status, end, what) in [
            (Status::Unmet, UNMET, "have done all their steps without reaching [stop]"),
            (Status::Open, STOPPED, "have not begun: call the sweep again"),
            (Status::Stopped, STOPPED, "were stopped: call the sweep again"),
            (Status::Failed, FAILED, "failed (see log.txt in their folders)"),
        ] {
            let count = of(status).count();
            if count > 0 {
                answer = end;
                print_error(format_args!(
                    "{count} of {} runs {what}: {}",
                    self.jobs.len(),
                    listed(of(status), MOST_NAMED)
                ));
            }
        }
        print_error(format_args!("{} has what came out", self.out.join("sweep.csv").display()));
        Ok(answer)
    }
}
